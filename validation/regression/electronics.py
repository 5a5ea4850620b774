"""Experiments on the conversion of forces to counts: the sensor's own one, and every stage of it by itself.

The forces are applied to all texels at once and bypass contact, filter and point spread.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fastmodel import ChainFunctions, Electronics, Gaussian, Parameters
from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.regression.subject import Subject, Values, list_texels

#: Lightest and heaviest force at which the characteristic is evaluated, wide enough for any sensor [N].  They must not
#: depend on the sensor's own sensitivity: a changed sensitivity would then hide itself.
_LIGHTEST, _HEAVIEST = 1e-6, 1e6
#: Number of forces, evenly spaced by ratio, and of bisections between two of them [-].
_FORCES, _BISECTIONS = 241, 60
#: Levels of output over the largest output, at which the force is measured [-].
_LEVELS = (0.01, 0.25, 0.5, 0.75, 0.99)
#: Electronics of the stages.  Each stage changes these numbers only.
_LINE = Electronics(rate_hz=100.0, sensitivity=500.0, offset=-20.0, output_max=1000, bits=10)
#: Forces on the texels of the stages, light to beyond the largest count, then unloading [N].
_LOADING = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.2, 1.6, 1.9, 2.0, 2.1, 3.0)
#: Stages by name, as changes of `_LINE`.
STAGES: Mapping[str, Mapping[str, Any]] = {
    "line": {},
    "polynomial": {"characteristic": (-20.0, 700.0, -150.0, 20.0, -2.0, 0.1)},
    "gains of texels": {"gains": tuple(0.7 + 0.05 * texel for texel in range(len(_LOADING)))},
    "threshold": {"threshold": 60.0},
    "saturation band": {"saturation_band": 300.0},
    "temperature": {"temperature_coefficient": -0.01, "temperature_excess": 15.0},
    "force through the cover": {"calibrated": "through the cover, tip 1 mm", "tip_share": 0.8},
    "hysteresis": {"hysteresis_share": 0.4, "hysteresis_width": 0.3},
}


def measure_characteristic(subject: Subject) -> Values:
    """Measure force thresholds, sensitivity, largest count and counts of every texel of the sensor itself."""
    array, electronics = subject.parameters.array, subject.parameters.electronics
    functions = ChainFunctions(replace(subject.parameters, filter=None), electronics.rate_hz, spreads=False)

    def count(force: float) -> FloatArray:
        state = functions.settle(np.full(array.count, force))
        return np.asarray(functions.frame(state)[1].counts, dtype=np.float64)

    def average(force: float) -> float:
        return float(count(force)[array.active].mean())

    largest = max(average(force) for force in np.geomspace(_LIGHTEST, _HEAVIEST, _FORCES))
    if largest <= 0:
        raise ValueError("no force gives a count")
    forces = {f"{100 * level:.0f} % of full scale": _find_force(average, level * largest) for level in _LEVELS}
    first, last, half = (forces[f"{level} % of full scale"] for level in (25, 75, 50))
    return {
        "force": forces,
        "sensitivity": 0.5 * largest / (last - first),
        "largest count (saturation)": float(count(_HEAVIEST).max()),
        "counts of each texel": list_texels(array, count(half)),
        "frame rate": electronics.rate_hz,
        "noise": electronics.noise,
    }


def measure_stages(subject: Subject) -> Values:  # noqa: ARG001 -- every experiment takes the sensor
    """Measure the counts of each stage of the electronics under fixed forces, and their grey levels."""
    values: dict[str, dict[str, list[float]]] = {}
    for stage, changes in STAGES.items():
        functions = ChainFunctions(_make_row(replace(_LINE, **changes)), _LINE.rate_hz, spreads=False)
        state = functions.settle(np.zeros(len(_LOADING)))
        outputs = {}
        for name, share in (("loading", 1.0), ("unloading", 0.7)):
            state = functions.take(state, share * np.array(_LOADING))
            state, output = functions.frame(state)
            outputs[name] = output.counts.tolist()
            outputs[f"{name}, grey"] = output.image.ravel().tolist()
        values[stage] = outputs
    return values


def _make_row(electronics: Electronics) -> Parameters:
    """Make the parameters of a single row of texels, one for each force, without point spread."""
    return Parameters(
        array=TexelArray.grid(1, len(_LOADING), 3e-3),
        spread=Gaussian(sigma_x=0.1, sigma_y=0.1, ksize_x=1, ksize_y=1),
        electronics=electronics,
    )


def _find_force(count: Callable[[float], float], level: float) -> float:
    """Find the smallest force at which the counts reach a level [N]."""
    forces = np.geomspace(_LIGHTEST, _HEAVIEST, _FORCES).tolist()
    index = next(index for index, force in enumerate(forces) if count(force) >= level)
    if index == 0:
        return float(forces[0])
    below, above = forces[index - 1], forces[index]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (below + above)
        below, above = (below, middle) if count(middle) >= level else (middle, above)
    return float(above)
