"""Null models: predictions of the stamp's images from tables and polynomials, without any model of the sensor.

A score of a model must be better than those of the null models to mean something.  As in the models, predicted counts
are limited to the range from zero to the largest count.  The published trial used quadratics.  The straight line is
added because a quadratic extrapolates badly, so a better score than that of the quadratic would show little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np

from meshes.array import FloatArray
from validation.calibration.stamp.case import StampCase

#: Function from the weight on the stamp [N] to predicted counts of the n texels, shape (n,) [-].
Predictor = Callable[[float], FloatArray]


def fit_zeros(cases: Sequence[StampCase], output_max: int) -> Predictor:  # noqa: ARG001 -- same signature for all
    """Return a predictor that gives zero counts for every texel under every load."""
    empty = np.zeros_like(cases[0].counts)
    return lambda _load: empty


def fit_pattern(cases: Sequence[StampCase], output_max: int) -> Predictor:
    """Return a predictor that multiplies the mean image of the fitted cases by a fitted quadratic in the load."""
    loads, counts = _stack_cases(cases)
    pattern = counts.mean(axis=0)
    size = counts @ pattern / (pattern @ pattern)
    curve = np.polynomial.Polynomial.fit(loads, size, 2)
    return lambda load: np.clip(float(curve(load)) * pattern, 0.0, output_max)


def fit_polynomials(cases: Sequence[StampCase], output_max: int, *, degree: int) -> Predictor:
    """Return a predictor with a separate fitted polynomial in the load for every texel."""
    loads, counts = _stack_cases(cases)
    coefficients = np.polynomial.polynomial.polyfit(loads, counts, degree)
    return lambda load: np.clip(np.polynomial.polynomial.polyval(load, coefficients), 0.0, output_max)


#: Null models by name: functions from the recordings to fit and the largest count to a predictor.
NULLS: Mapping[str, Callable[[Sequence[StampCase], int], Predictor]] = MappingProxyType(
    {
        "zeros": fit_zeros,
        "mean pattern x load curve": fit_pattern,
        "quadratic per texel": partial(fit_polynomials, degree=2),
        "line per texel": partial(fit_polynomials, degree=1),
    }
)


def _stack_cases(cases: Sequence[StampCase]) -> tuple[FloatArray, FloatArray]:
    """Return the loads of k cases, shape (k,) [N], and their counts on n texels, shape (k, n) [-]."""
    return np.array([case.file.load for case in cases]), np.array([case.counts for case in cases])
