"""Null models: what a table without any sensor model reaches on the same recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from validation.stamp.case import StampCase

FloatArray = npt.NDArray[np.float64]
Predictor = Callable[[float], FloatArray]

#: Degree of the load curves below; two as in the published trial.
_DEGREE = 2


def zeros(cases: Sequence[StampCase]) -> Predictor:
    """No counts at all."""
    empty = np.zeros_like(cases[0].counts)
    return lambda _load: empty


def pattern_times_curve(cases: Sequence[StampCase]) -> Predictor:
    """The mean image, scaled by a quadratic in the load."""
    loads, counts = _stacked(cases)
    pattern = counts.mean(axis=0)
    size = counts @ pattern / (pattern @ pattern)
    curve = np.polynomial.Polynomial.fit(loads, size, _DEGREE)
    return lambda load: np.maximum(float(curve(load)) * pattern, 0.0)


def quadratic_per_texel(cases: Sequence[StampCase]) -> Predictor:
    """A quadratic in the load for every texel on its own."""
    loads, counts = _stacked(cases)
    coefficients = np.polynomial.polynomial.polyfit(loads, counts, _DEGREE)
    return lambda load: np.maximum(np.polynomial.polynomial.polyval(load, coefficients), 0.0)


#: Null models by name.
NULLS: Mapping[str, Callable[[Sequence[StampCase]], Predictor]] = MappingProxyType(
    {
        "zeros": zeros,
        "mean pattern x load curve": pattern_times_curve,
        "quadratic per texel": quadratic_per_texel,
    }
)


def _stacked(cases: Sequence[StampCase]) -> tuple[FloatArray, FloatArray]:
    return np.array([case.file.load for case in cases]), np.array([case.counts for case in cases])
