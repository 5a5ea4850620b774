"""Cubic interpolation between computed points, and the estimate of its error."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from meshes.array_types import FloatArray

#: Number of points below which the interpolation has no estimate, and degree of the splines [-].
_FEWEST, _DEGREE = 4, 3


def interpolate(nodes: FloatArray, values: FloatArray) -> BSpline:
    """Return the cubic spline through values, shape (m, ...), at ascending nodes, shape (m,); linear between two."""
    return make_interp_spline(nodes, values, k=min(_DEGREE, len(nodes) - 1))


def estimate_interpolation(nodes: FloatArray, values: FloatArray) -> FloatArray:
    """Estimate the error of the interpolation at each node, shape (m, ...).

    Every other point is left out and interpolated.  The error of a cubic spline falls with the fourth power of the
    distance of the points; an eighth of the error with half of the points is taken.  It is zero below four points.
    """
    if len(nodes) < _FEWEST:
        return np.zeros_like(values)
    kept = sorted({*range(len(nodes) - 1, -1, -2), 0})
    return np.asarray(np.abs(interpolate(nodes[kept], values[kept])(nodes) - values) / 8)
