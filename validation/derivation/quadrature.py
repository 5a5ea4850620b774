"""Gauss-Legendre quadrature over a rectangle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def gauss_points(size: tuple[float, float], order: int) -> tuple[FloatArray, FloatArray]:
    """Return the points and weights of Gauss-Legendre quadrature over a rectangle centred on the origin.

    Args:
        size: Edge lengths of the rectangle along x and y [m].
        order: Number of points along each edge [-].

    Returns:
        Points, shape (order^2, 2) [m], and weights that sum to 1, shape (order^2,) [-]: the weighted sum of a
        function's values at the points is the mean of the function over the rectangle.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, y = np.meshgrid(nodes * size[0] / 2, nodes * size[1] / 2)
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() / 4
