"""Place Gauss points under a traction that acts on an interval of angles, finely enough for a given harmonic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes.array_types import FloatArray

#: A traction: constant, or a function of angles, shape (n,) [rad], that returns values, shape (n,) [Pa].
Traction = float | Callable[[FloatArray], FloatArray]

#: Gauss points in a panel [-], largest phase of a harmonic in a panel [rad], and smallest number of panels
#: in each half of the interval [-].
_POINTS, _PHASE, _PANELS = 16, 8.0, 2
#: Largest change of a harmonic between two sets of panels, over the sum of the moduli of the forces [-].
_SETTLED = 1e-9


def place_points(start: float, end: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
    """Place Gauss points on an interval, so that a traction that ends like a square root at either end is integrated.

    The substitution angle = middle + half width sin(t), with panels of equal length in t, turns such an end, as that of
    a Hertzian pressure, into an analytic function.

    The middle is an end of two panels, so that either half of the points integrates its half of the interval.

    Args:
        start: Lower end of the interval [rad].
        end: Upper end [rad].
        highest: Highest harmonic that will be integrated [-].
        refinement: Factor on the number of panels [-].

    Returns:
        Angles, shape (n,) [rad], and weights, shape (n,) [rad].
    """
    half = (end - start) / 2
    panels = 2 * refinement * max(_PANELS, int(np.ceil(np.pi * highest * half / (2 * _PHASE))))
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.linspace(-np.pi / 2, np.pi / 2, panels + 1)
    width = np.diff(edges)[:, None] / 2
    t, weight = (edges[:-1, None] + width * (nodes + 1)).ravel(), (width * weights).ravel()
    return (start + end) / 2 + half * np.sin(t), weight * half * np.cos(t)


def sample(traction: Traction, angles: FloatArray) -> FloatArray:
    """Evaluate a traction at angles, shape (n,) [Pa].

    Raises:
        ValueError: If a value is not finite, or the values do not have the shape of the angles.
    """
    values = np.asarray(traction(angles) if callable(traction) else traction, dtype=float)
    if values.shape not in {(), angles.shape}:
        raise ValueError(f"the traction returns shape {values.shape} for angles of shape {angles.shape}")
    if not np.isfinite(values).all():
        raise ValueError("the traction is not finite everywhere on its interval")
    return np.broadcast_to(values, angles.shape)


def check_resolved(coarse: npt.NDArray[Any], fine: npt.NDArray[Any], size: float) -> None:
    """Compare the harmonics from two sets of panels.

    Args:
        coarse: Harmonics, any shape.
        fine: The same from twice the panels.
        size: Sum of the moduli of the forces, in the unit of the harmonics.

    Raises:
        ValueError: If they differ by more than 1e-9 of `size`.
    """
    if np.abs(fine - coarse).max(initial=0.0) > _SETTLED * size:
        raise ValueError("the traction is not smooth inside its interval; split it into several loads where it jumps")
