"""Computes moving cases: static presses along the history, forces in time, and the signal chain of each model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fem_reference import ConvergenceError
from meshes.array_types import BoolArray, FloatArray
from validation.campaign.case import Case
from validation.campaign.plan import OutOfBudgetError, check_budget
from validation.campaign.results import OUT_OF_BUDGET
from validation.moving.history import Curve, MovingCase, Samples, estimate_interpolation, interpolate
from validation.moving.inertia import find_resonance, warn_of_inertia
from validation.moving.results import (
    TRUTH,
    MovingResult,
    MovingScore,
    measure_delay,
    measure_error,
    measure_misplaced,
)
from validation.published.in_time import butterworth
from validation.published.rules import PUBLISHED

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.campaign.bench import Bench
    from validation.campaign.plan import Budget
    from validation.campaign.results import CaseResult

#: Samples per second of all signals before the frames, as many as MuJoCo takes with its usual step of 1 ms [Hz].
RATE = 1000.0
#: Null model: the truth through the sensor's filter and frames.
EXACT = "exact spread"
#: Null model: the truth, sampled by the frames and held.
HELD = "truth at each frame"

Progress = Callable[[int, int, str], None]


class _Chain(NamedTuple):
    """What one row does in time.

    Attributes:
        model: Name of the static model.
        title: Name of the row.
        words: What the row does in time.
        apply: Function of forces at equal intervals, shape (k, n + 1) [N], and of the interval [s].
    """

    model: str
    title: str
    words: str
    apply: Callable[[FloatArray, float], FloatArray]


def run_moving(
    bench: Bench, cases: Sequence[MovingCase], progress: Progress | None = None, *, budget: Budget | None = None
) -> tuple[tuple[MovingResult, ...], tuple[str, ...]]:
    """Compute moving cases by the finite elements and all models, and score the models.

    Args:
        bench: Sensor with its models.
        cases: The moving cases.
        progress: Called before each static press with (number done, number of all, name of the case).
        budget: Time that all cases may take; None for no limit.

    Returns:
        The results; and a line for each case that a model cannot compute, or that was stopped, with the reason.
    """
    results, faults, done = [], [], 0
    divided = [case.divide(min(bench.parameters.array.pitch)) for case in cases]
    listed = [list(dict.fromkeys(state for curve in curves for state in curve.cases)) for curves in divided]
    for case, curves, states in zip(cases, divided, listed, strict=True):
        solved: dict[Case, CaseResult] = {}
        try:
            if bench.comparison is not None:
                bench.comparison.check_unseen(states)
            for state in states:
                check_budget(budget)
                if progress:
                    progress(done + len(solved), sum(map(len, listed)), state.name)
                solved[state] = bench.solve(state)
            results.append(score_moving(bench, case, curves, solved))
        except (ValueError, ConvergenceError) as error:
            faults.append(f"moving case {case.name!r}: {error}")
        except OutOfBudgetError:
            faults.append(f"moving case {case.name!r}: {OUT_OF_BUDGET}")
        except KeyboardInterrupt:
            faults.append(f"moving case {case.name!r} and those after it: interrupted")
            break
        done += len(states)
    return tuple(results), tuple(faults)


def score_moving(
    bench: Bench, case: MovingCase, curves: Sequence[Curve], solved: Mapping[Case, CaseResult]
) -> MovingResult:
    """Score one moving case whose static presses are solved.

    Args:
        bench: Sensor with its models.
        case: The moving case.
        curves: Its static states.
        solved: Result of each state.
    """
    samples, resonance = case.sample(RATE), find_resonance(bench.cover)
    shares = [_collect_shares([solved[state] for state in curve.cases]) for curve in curves]
    series = {
        model: samples.loads[:, None] * _interpolate(samples, curves, [each[model] for each in shares])
        for model in shares[0]
    }
    true, rows = series[TRUTH], _list_chains(bench, [*shares[0]])
    scores, totals = [], {TRUTH: true[:, :-1].sum(axis=1)}
    for row in rows:
        passed = row.apply(series[row.model], 1 / RATE)
        found = hold(passed, bench.parameters.electronics.rate_hz)
        latency = find_latency(bench.parameters, true, passed)
        scores.append(
            MovingScore(
                case=case.name,
                model=row.title,
                chain=row.words,
                error=measure_error(true[:, :-1], found[:, :-1]),
                misplaced=measure_misplaced(true, found),
                delay=measure_delay(series[row.model][:, :-1], found[:, :-1], 1 / RATE),
                overshoot=round(float(found[:, :-1].sum(axis=1).max() / true[:, :-1].sum(axis=1).max()) - 1, 9),
                latency=latency + 0.5 / bench.parameters.electronics.rate_hz,
                latency_worst=latency + 1 / bench.parameters.electronics.rate_hz,
            )
        )
        totals[row.title] = found[:, :-1].sum(axis=1)
    return MovingResult(
        name=case.name,
        indenter=case.shape,
        states=sum(len(curve.cases) for curve in curves),
        interpolation_error=max(
            estimate_interpolation(curve, each[TRUTH]) for curve, each in zip(curves, shares, strict=True)
        ),
        fastest=case.fastest,
        resonance=resonance,
        warnings=warn_of_inertia(case.fastest, resonance),
        scores=tuple(scores),
        times=samples.times,
        totals=totals,
    )


def hold(forces: FloatArray, frames_per_second: float) -> FloatArray:
    """Return the forces of the latest frame at each instant; a frame has the forces of the latest sample.

    Args:
        forces: Forces at the sampling rate, shape (k, ...) [N].
        frames_per_second: Rate of the frames [Hz].
    """
    times = np.arange(len(forces)) / RATE
    frames = np.floor(times * frames_per_second + 1e-9) / frames_per_second
    return np.asarray(forces[np.floor(frames * RATE + 1e-9).astype(int)])


def find_latency(parameters: Parameters, true: FloatArray, passed: FloatArray) -> float:
    """Find the time from first touch to the first sample with a count above zero, before it waits for a frame [s].

    Args:
        parameters: Parameters of the sensor.
        true: True forces on texels and outside, shape (k, n + 1) [N].
        passed: Forces of a model after its filter [N].

    Returns:
        The time; NaN if the cover is touched from the beginning, or no count rises.
    """
    counts = parameters.electronics.counts(np.clip(passed[:, :-1], 0, None))
    lit, touched = np.flatnonzero(np.asarray(counts).any(axis=1)), np.flatnonzero(true.sum(axis=1) > 0)
    if not len(touched) or touched[0] == 0 or not len(lit) or lit[0] == 0:
        return float("nan")
    return float(lit[0] - (touched[0] - 1)) / RATE


def _collect_shares(results: Sequence[CaseResult]) -> dict[str, FloatArray]:
    """Collect the shares of the load on texels and outside by model, shape (m, n + 1) each [-]."""

    def share(forces: FloatArray, outside: float, load: float) -> FloatArray:
        return np.append(forces, outside) / load

    found = {TRUTH: [share(each.reference.texel_forces, each.reference.outside, each.case.load) for each in results]}
    for kind in ("predictions", "published"):
        for model in getattr(results[0], kind):
            found[model] = [
                share(each.texel_forces, each.outside, result.case.load)
                for result in results
                for each in [getattr(result, kind)[model]]
            ]
    return {model: np.array(rows) for model, rows in found.items()}


def _interpolate(samples: Samples, curves: Sequence[Curve], shares: Sequence[FloatArray]) -> FloatArray:
    """Interpolate the shares of one model at all instants, shape (k, n + 1) [-]."""
    out = np.empty((len(samples.times), shares[0].shape[1]))
    for number, (curve, values) in enumerate(zip(curves, shares, strict=True)):
        here: BoolArray = samples.curves == number
        out[here] = interpolate(curve, values, samples.positions[here])
    return out


def _list_chains(bench: Bench, models: Sequence[str]) -> list[_Chain]:
    """List the rows: models of the bench and null models with the sensor's chain, published ones with their own."""
    design = bench.parameters.filter
    frames = f"frames at {bench.parameters.electronics.rate_hz:g} Hz"
    words = f"{f'order {design.order}, {design.cutoff_hz:g} Hz, ' if design else ''}{frames}"

    def nothing(forces: FloatArray, step: float) -> FloatArray:  # noqa: ARG001 -- as the others
        return forces

    own = butterworth(design.order, design.cutoff_hz) if design else nothing
    rows = [_Chain(model, model, words, own) for model in bench.models if model in models]
    rows += [_Chain(TRUTH, EXACT, words, own), _Chain(TRUTH, HELD, frames, nothing)]
    for each in bench.comparison.rows if bench.comparison else ():
        terms = PUBLISHED[each.model.name].terms or {"": nothing}
        for setting, term in terms.items():
            title = f"{each.model.title}, {each.variant}" + (f", {setting}" if len(terms) > 1 else "")
            rows.append(_Chain(each.name, title, f"{setting + ', ' if setting else ''}{frames}", term))
    return rows
