"""Null models: what a table without any sensor model reaches on the same recordings.

Each knows beforehand what the models know: no count is negative or above the largest one.  Quadratics are what the
published trial used; the line is there because a quadratic extrapolates badly, and beating it would prove little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from validation.calibration.stamp.case import StampCase

FloatArray = npt.NDArray[np.float64]
Predictor = Callable[[float], FloatArray]


def zeros(cases: Sequence[StampCase], output_max: int) -> Predictor:  # noqa: ARG001 -- one signature for all
    """No counts at all."""
    empty = np.zeros_like(cases[0].counts)
    return lambda _load: empty


def pattern_times_curve(cases: Sequence[StampCase], output_max: int) -> Predictor:
    """The mean image, scaled by a quadratic in the load."""
    loads, counts = _stacked(cases)
    pattern = counts.mean(axis=0)
    size = counts @ pattern / (pattern @ pattern)
    curve = np.polynomial.Polynomial.fit(loads, size, 2)
    return lambda load: np.clip(float(curve(load)) * pattern, 0.0, output_max)


def quadratic_per_texel(cases: Sequence[StampCase], output_max: int) -> Predictor:
    """A quadratic in the load for every texel on its own."""
    return _polynomial_per_texel(cases, output_max, 2)


def line_per_texel(cases: Sequence[StampCase], output_max: int) -> Predictor:
    """A straight line in the load for every texel on its own."""
    return _polynomial_per_texel(cases, output_max, 1)


def _polynomial_per_texel(cases: Sequence[StampCase], output_max: int, degree: int) -> Predictor:
    loads, counts = _stacked(cases)
    coefficients = np.polynomial.polynomial.polyfit(loads, counts, degree)
    return lambda load: np.clip(np.polynomial.polynomial.polyval(load, coefficients), 0.0, output_max)


#: Null models by name.
NULLS: Mapping[str, Callable[[Sequence[StampCase], int], Predictor]] = MappingProxyType(
    {
        "zeros": zeros,
        "mean pattern x load curve": pattern_times_curve,
        "quadratic per texel": quadratic_per_texel,
        "line per texel": line_per_texel,
    }
)


def _stacked(cases: Sequence[StampCase]) -> tuple[FloatArray, FloatArray]:
    return np.array([case.file.load for case in cases]), np.array([case.counts for case in cases])
