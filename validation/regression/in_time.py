"""Experiments on what changes in time: creep, published filters, scores of a moving case, and the filter of a step.

All of them are fixed, and independent of the sensor: a history and texel forces from formulas.
"""

from __future__ import annotations

import numpy as np

import fastmodel
from fastmodel.signal.creep import Creep
from meshes import Pose, Sphere
from meshes.array_types import FloatArray
from validation.calibration.step_response import fit_step, respond
from validation.campaign.bench import LayeredBench
from validation.campaign.case import Case
from validation.campaign.results import CaseResult
from validation.moving.history import MovingCase
from validation.moving.run import score_moving
from validation.published.rules import PUBLISHED
from validation.regression.made_up import make_case_result
from validation.regression.reading import Readings, Subject, read
from validation.sensor_file import BUILT_IN

#: Built-in sensor whose array and electronics the made-up moving case has.
_SENSOR = "wts-0614-34"
#: Width of the true and of the predicted spread of the made-up case [m].
_WIDTHS = 4e-3, 4.4e-3
#: Order, cut-off [Hz], delay [s] and instant [s] of the made-up step, and its frames per second [Hz].
_ORDER, _CUTOFF, _DELAY, _STEP, _FRAMES = 2, 12.0, 4e-3, 1.0013, 271.0
#: Times under load at which creep is guarded [s].
_AGES = 1.0, 2.0, 10.0, 100.0
#: Shown instants of the made-up case whose forces are guarded: the rise, the fall, the slide and the end [-].
_SHOWN = [40, 100, 225, 325]


def measure_time(subject: Subject) -> Readings:  # noqa: ARG001 -- the experiments are fixed
    """Measure creep of a held load, steps through published filters, a moving case, and a fitted filter."""
    creep, held, age = Creep(0.12), {}, 0.0
    states = creep.settle(np.zeros(1))
    for seconds in _AGES:
        reading, states = creep.step(states, np.ones(1), seconds - age)
        held[f"{seconds:g} s"], age = float(reading[0]), seconds
    step = np.append(0.0, np.ones(100))
    passed = {
        f"{model.name}, {setting}": term(step, 1e-3)[[6, 20]].tolist()
        for model in PUBLISHED.values()
        for setting, term in model.terms.items()
    }
    times = np.arange(2 * _FRAMES) / _FRAMES
    sums = 500 + 2000 * respond(_ORDER, 2 * np.pi * _CUTOFF * (times - _STEP - _DELAY))
    found = fit_step(times, sums + 5 * np.sin(1e4 * times), _STEP)
    return {
        "creep of a held load": read(held, "-", "0.1 % of each"),
        "step through published filters, after 6 and 20 ms": read(passed, "-", "0.2 % of each"),
        "filter of a step": read(
            {"cut-off": found.cutoff.value, "low": found.cutoff.low, "high": found.cutoff.high}, "Hz", "0.5 % of each"
        ),
        "delay of a step": read(found.delay.value, "ms", "1 % of each"),
        **_score_made_up(),
    }


def _score_made_up() -> Readings:
    """Score the made-up moving case: a load that comes, goes and slides."""
    parameters = fastmodel.load(_SENSOR)
    bench = LayeredBench(cover=BUILT_IN[_SENSOR].layered_cover, parameters=parameters)
    centres = parameters.array.centres[:, :2]

    def spread(state: Case, width: float) -> FloatArray:
        apart = ((centres - state.pose.at) ** 2).sum(axis=1)
        return np.asarray(state.load * np.exp(-apart / (2 * width**2)) * 0.11)

    def solve(state: Case) -> CaseResult:
        true, model = (spread(state, width) for width in _WIDTHS)
        return make_case_result(state, true, model, parameters)

    places = [(0.0, 0.0)] * 4 + [(6e-3, 3e-3)] * 2
    case = MovingCase(
        name="made up", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm",
        times=(0.0, 0.05, 0.1, 0.3, 0.6, 0.7), values=(0.0, 0.0, 3.0, 2.0, 2.0, 0.0),
        poses=tuple(Pose.planar(at=at) for at in places),
    )  # fmt: skip
    curves = case.divide(parameters.array.pitch[0])
    result = score_moving(bench, case, curves, {state: solve(state) for curve in curves for state in curve.cases})
    (fast,) = (each for each in result.scores if each.model == "fast")
    names = ("error", "misplaced", "misplaced_high", "touching", "sliding", "overshoot")
    shares = {name: getattr(fast, name) for name in names}
    totals = {model: result.totals[model][_SHOWN].tolist() for model in ("truth", "fast")}
    return {
        "force on the texels of a moving case": read(totals, "N", "0.2 % of each"),
        "scores of a moving case": read(shares, "%", 0.02),
        "delay and latency of a moving case": read(
            {"delay": fast.delay, "latency": fast.latency, "worst": fast.latency_worst}, "ms", 0.05
        ),
    }
