"""Computes moving cases: static presses along the history, forces in time, and the signal chain of each model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fem_reference import ConvergenceError
from fem_reference.interpolation import estimate_interpolation
from meshes.array_types import BoolArray, FloatArray
from validation.campaign.case import Case
from validation.campaign.plan import OutOfBudgetError, check_budget
from validation.campaign.results import OUT_OF_BUDGET, SkippedCase
from validation.errors import InputError
from validation.moving.history import Curve, MovingCase, Samples, interpolate
from validation.moving.inertia import find_resonance, warn_of_inertia
from validation.moving.results import (
    TRUTH,
    MovingResult,
    MovingScore,
    average,
    measure_delay,
    measure_error,
    measure_misplaced,
)
from validation.published.in_time import own_chain
from validation.published.rules import PUBLISHED

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.campaign.bench import Bench
    from validation.campaign.plan import Budget
    from validation.campaign.results import CaseResult

#: Samples per second of all signals before the frames, as many as MuJoCo takes with its usual step of 1 ms [Hz].
RATE = 1000.0
#: Time from an instant at which contact is made or lost, within which an instant is listed apart [s].
_NEAR = 0.02
#: Share of the largest load below which there is no contact: rounding of a load that comes to zero [-].
_NOTHING = 1e-9
#: Largest relative difference of force and impulse from those of a body that rests [-], and how often a height is
#: halved to find one from which it does [-].
_AT_REST, _HALVINGS = 0.02, 5
#: Largest number of instants in the series of a result, and decimals of the forces there [-].
_MOST_SHOWN, _DIGITS = 500, 6
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


class Moved(NamedTuple):
    """Results of the moving cases of a campaign.

    Attributes:
        results: One result per scored case.
        skipped: The cases without scores.
        interrupted: Whether the run was interrupted.
    """

    results: tuple[MovingResult, ...] = ()
    skipped: tuple[SkippedCase, ...] = ()
    interrupted: bool = False


def run_moving(
    bench: Bench, cases: Sequence[MovingCase], progress: Progress | None = None, *, budget: Budget | None = None
) -> Moved:
    """Compute moving cases by the finite elements and all models, and score the models.

    Args:
        bench: Sensor with its models.
        cases: The moving cases.
        progress: Called before each static press with (finished cases, all cases, name of the press).
        budget: Time that all cases may take; None for no limit.
    """
    results: list[MovingResult] = []
    skipped: list[SkippedCase] = []
    for number, case in enumerate(cases):

        def report(line: str, number: int = number) -> None:
            check_budget(budget)
            if progress:
                progress(number, len(cases), line)

        def solve(state: Case, report: Callable[[str], None] = report) -> CaseResult:
            report(state.name)
            return bench.solve(state, report)

        try:
            moved = record_fall(case, bench.parameters) if case.fall else case
            curves = moved.divide(min(bench.parameters.array.pitch))
            states = list(dict.fromkeys(state for curve in curves for state in curve.cases))
            if bench.comparison is not None:
                bench.comparison.check_unseen(states)
            results.append(score_moving(bench, moved, curves, {state: solve(state) for state in states}))
        except (ValueError, ConvergenceError) as error:
            converged = not isinstance(error, ConvergenceError)
            skipped.append(SkippedCase.of(case.heaviest, str(error), converged=converged))
        except OutOfBudgetError:
            skipped.append(SkippedCase.of(case.heaviest, OUT_OF_BUDGET))
        except KeyboardInterrupt:
            skipped += [SkippedCase.of(each.heaviest, "interrupted") for each in cases[number:]]
            return Moved(tuple(results), tuple(skipped), interrupted=True)
    return Moved(tuple(results), tuple(skipped))


def record_fall(case: MovingCase, parameters: Parameters) -> MovingCase:
    """Let the indenter of a case fall on the fast model in MuJoCo; return the case with the force of its contacts.

    Only MuJoCo knows this force: it follows from the softness of its contacts, not from the cover, and is proportional
    to the weight.

    Raises:
        InputError: If the indenter does not fall on the array, or does not rest on it at the end.
    """
    from fastmodel.bench import TIMESTEP, Bench, Placement

    state = case.heaviest.turned
    place = Placement(indenter=state.indenter, load=state.load, at=state.pose.at, yaw=state.pose.yaw)
    steps = math.floor(case.times[-1] / TIMESTEP + 1e-9)
    bench = Bench(parameters, [place])

    def drop(height: float) -> FloatArray:
        readings = bench.drop([(*place.at, place.yaw)], height, steps)
        return np.array([0.0, *(each.carried for each in readings)])

    def rests(loads: FloatArray) -> bool:
        # At rest the contact bears the weight, and its impulse is that of the weight over the whole time.
        return bool(max(abs(loads[-1] / place.load - 1), abs(loads.sum() / steps / place.load - 1)) < _AT_REST)

    loads = drop(case.fall)
    if not loads.any():
        raise InputError("the indenter falls beside the array; change its place")
    if not rests(loads):
        lower = next((h for h in case.fall / 2.0 ** np.arange(1, _HALVINGS + 1) if rests(drop(h))), None)
        remedy = f"write fall = '{1e3 * lower:.3g} mm', from which it rests, or " if lower else ""
        raise InputError(
            f"fall: a body that falls by {1e3 * case.fall:.4g} mm does not rest on the cover at the end, because it "
            f"falls through MuJoCo's contacts or the history is too short; {remedy}end the history later"
        )
    loads *= min(1.0, case.most / loads.max())
    times = tuple((TIMESTEP * np.arange(len(loads))).tolist())
    return replace(case, times=times, values=tuple(loads.tolist()), poses=case.poses[:1] * len(loads))


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
    true, rows, rate = series[TRUTH], _list_chains(bench, [*shares[0]]), bench.parameters.electronics.rate_hz
    near = find_touches(samples.loads)
    scores, totals = [], {TRUTH: true[:, :-1].sum(axis=1)}
    for row in rows:
        passed = row.apply(series[row.model], 1 / RATE)
        found = hold(passed, rate)
        latency, misplaced = find_latency(bench.parameters, true, passed), measure_misplaced(true, found)
        guided = misplaced[~near & ~samples.moves]
        scores.append(
            MovingScore(
                case=case.name,
                model=row.title,
                chain=row.words,
                error=measure_error(true[:, :-1], found[:, :-1]),
                misplaced=average(guided),
                misplaced_high=average(guided, 0.95),
                touching=average(misplaced[near]),
                sliding=average(misplaced[~near & samples.moves]),
                delay=measure_delay(series[row.model][:, :-1], found[:, :-1], 1 / RATE),
                overshoot=round(float(found[:, :-1].sum(axis=1).max() / true[:, :-1].sum(axis=1).max()) - 1, 9),
                latency=latency + 0.5 / rate,
                latency_worst=latency + 1 / rate,
            )
        )
        totals[row.title] = found[:, :-1].sum(axis=1)
    kept = slice(None, None, math.ceil(len(true) / _MOST_SHOWN))
    return MovingResult(
        name=case.name,
        indenter=case.shape,
        states=sum(len(curve.cases) for curve in curves),
        interpolation_error=max(
            float(0.5 * estimate_interpolation(curve.positions, each[TRUTH]).sum(axis=1).max())
            for curve, each in zip(curves, shares, strict=True)
        ),
        fastest=case.fastest,
        resonance=resonance,
        warnings=tuple(_list_limits(bench, case, samples, resonance)),
        scores=tuple(scores),
        times=samples.times[kept],
        totals={model: np.round(total[kept], _DIGITS) for model, total in totals.items()},
    )


def _list_limits(bench: Bench, case: MovingCase, samples: Samples, resonance: float) -> Iterator[str]:
    """Yield sentences about what counts in a case and is not computed."""
    yield from warn_of_inertia(case.fastest, resonance)
    if case.fall:
        weight, most = case.values[-1], max(case.values)
        lowered = ", lowered for `deepest`" if most > (1 - _NOTHING) * case.most else ""
        yield "the load is that of MuJoCo's contacts, which the cover does not determine: spread and chain are scored"
        yield f"the impact is {most:.3g} N, {most / weight:.1f} times the weight of {weight:.3g} N{lowered}"
    if bench.friction and samples.moves.any():
        yield "the indenter slides: its friction, which is computed for a press, has another direction then"
    if bench.friction and (np.diff(samples.loads) < 0).any():
        yield "the load falls: with friction the slip of unloading is not computed"
    if count := np.count_nonzero(_list_changes(samples.loads)):
        yield f"instants at which contact is made or lost: {count}; adhesion is not computed, and they are listed apart"


def _list_changes(loads: FloatArray) -> BoolArray:
    """Return whether contact is made or lost from the sample before to each sample, shape (k,)."""
    touches = loads > _NOTHING * loads.max()
    return np.asarray(np.diff(touches, prepend=touches[0]))


def find_touches(loads: FloatArray) -> BoolArray:
    """Find the samples within 20 ms of one at which contact is made or lost, shape (k,).

    Args:
        loads: Load at each sample, shape (k,) [N].
    """
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(_list_changes(loads), 2 * round(_NEAR * RATE) + 1))


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
    design, high = bench.parameters.filter, bench.parameters.electronics.high_pass_hz
    frames = f"frames at {bench.parameters.electronics.rate_hz:g} Hz"
    words = f"{f'order {design.order}, {design.cutoff_hz:g} Hz, ' if design else ''}"
    words += f"{f'above {high:g} Hz, ' if high else ''}{frames}"

    def nothing(forces: FloatArray, step: float) -> FloatArray:  # noqa: ARG001 -- as the others
        return forces

    own = own_chain(design, high)
    rows = [_Chain(model, model, words, own) for model in bench.models if model in models]
    rows += [_Chain(TRUTH, EXACT, words, own), _Chain(TRUTH, HELD, frames, nothing)]
    for each in bench.comparison.rows if bench.comparison else ():
        terms = PUBLISHED[each.model.name].terms or {"": nothing}
        for setting, term in terms.items():
            title = f"{each.model.title}, {each.variant}" + (f", {setting}" if len(terms) > 1 else "")
            rows.append(_Chain(each.name, title, f"{setting + ', ' if setting else ''}{frames}", term))
    return rows
