"""Null models: scores that a table reaches on the same recordings without any model of the sensor.

The null models share one fact with the models: no count is negative or above the largest one.  The published trial used
quadratics.  The straight line is added because a quadratic extrapolates badly and would be too easy to beat.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np

from meshes.array import FloatArray
from validation.calibration.stamp.case import StampCase

#: From a load [N] to counts, shape (n,).
Predictor = Callable[[float], FloatArray]


def fit_zeros(cases: Sequence[StampCase], output_max: int) -> Predictor:  # noqa: ARG001 -- same signature for all
    """Predict no counts at all."""
    empty = np.zeros_like(cases[0].counts)
    return lambda _load: empty


def fit_pattern(cases: Sequence[StampCase], output_max: int) -> Predictor:
    """Fit the mean image, scaled by a quadratic in the load."""
    loads, counts = _stack_cases(cases)
    pattern = counts.mean(axis=0)
    size = counts @ pattern / (pattern @ pattern)
    curve = np.polynomial.Polynomial.fit(loads, size, 2)
    return lambda load: np.clip(float(curve(load)) * pattern, 0.0, output_max)


def fit_polynomials(cases: Sequence[StampCase], output_max: int, *, degree: int) -> Predictor:
    """Fit a polynomial in the load to every texel separately."""
    loads, counts = _stack_cases(cases)
    coefficients = np.polynomial.polynomial.polyfit(loads, counts, degree)
    return lambda load: np.clip(np.polynomial.polynomial.polyval(load, coefficients), 0.0, output_max)


#: Null models by name: functions from fitted cases and the largest count to a predictor.
NULLS: Mapping[str, Callable[[Sequence[StampCase], int], Predictor]] = MappingProxyType(
    {
        "zeros": fit_zeros,
        "mean pattern x load curve": fit_pattern,
        "quadratic per texel": partial(fit_polynomials, degree=2),
        "line per texel": partial(fit_polynomials, degree=1),
    }
)


def _stack_cases(cases: Sequence[StampCase]) -> tuple[FloatArray, FloatArray]:
    """Loads, shape (k,) [N], and counts, shape (k, n) [-]."""
    return np.array([case.file.load for case in cases]), np.array([case.counts for case in cases])
