"""Place Gauss points under a traction and choose the number of terms of the series on curved layers.

Gauss points stand under a traction on an interval of angles, finely enough for a given harmonic.  The number of terms
follows from a tolerance.  The traction on the base converges exponentially.  The displacement of the top converges like
a power of the number of terms, because its terms fall like those of the load over their order; a smooth taper of the
last half of the terms makes the error small except where the load itself has a jump or a kink.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import expit

from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class SeriesSettings:
    """Numbers of Fourier series and of their quadrature."""

    #: Gauss points in a panel [-].
    points: int = 16
    #: Largest phase of a harmonic in a panel [rad].
    phase: float = 8.0
    #: Smallest number of panels in each half of the interval [-].
    panels: int = 2
    #: Largest change of a harmonic between two sets of panels, over the sum of the moduli of the forces [-].
    settled: float = 1e-9
    #: Smallest number of terms [-].
    first: int = 64
    #: Largest number of terms of the traction on the base [-].
    most_terms: int = 2**17
    #: First number of terms of the displacement of the top [-].
    first_top: int = 2**8
    #: Largest number of terms of the displacement of the top [-].
    most_top: int = 2**13
    #: Part of a sum that rounding leaves [-].
    rounding: float = 1e-14
    #: Order times span at which the transfer to the base is negligible: exp(-60) = 1e-26 [-].
    deep: float = 60.0


_SETTINGS = SeriesSettings()


#: A traction: constant, or a function of angles, shape (n,) [rad], that returns values, shape (n,) [Pa].
Traction = float | Callable[[FloatArray], FloatArray]


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
    panels = 2 * refinement * max(_SETTINGS.panels, int(np.ceil(np.pi * highest * half / (2 * _SETTINGS.phase))))
    nodes, weights = np.polynomial.legendre.leggauss(_SETTINGS.points)
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
    if np.abs(fine - coarse).max(initial=0.0) > _SETTINGS.settled * size:
        raise ValueError("the traction is not smooth inside its interval; split it into several loads where it jumps")


def count_base_terms(transfer: Callable[[FloatArray], FloatArray], span: float, tolerance: float) -> int:
    """Count the terms that the traction on the base needs.

    The transfer to the base decays exponentially, and no harmonic of a load is larger than that of the same load
    concentrated in one place, which grows no faster than the order.  So the sum of the norms of the transfer, times
    order + 1, over the terms that are left out bounds the truncation error of any load.

    Args:
        transfer: Function that computes the transfer to the base for orders, shape (n,), with shape (n, 2, 2) [-].
        span: Logarithm of the outer radius over that of the core [-].
        tolerance: Largest sum of the norms that are left out, over the sum of all norms [-].

    Raises:
        ValueError: If more than 131072 terms are needed, as in a layer thinner than about 0.0005 radii.
    """
    count = int(np.ceil(_SETTINGS.deep / span)) + _SETTINGS.first
    if count > _SETTINGS.most_terms:
        raise ValueError(
            f"the layer is too thin for its radius: its series needs more than {_SETTINGS.most_terms} terms"
        )
    norms = np.linalg.norm(transfer(np.arange(float(count))), axis=(1, 2)) * np.arange(1, count + 1)
    left_out = np.cumsum(norms[::-1])[::-1]
    return int(np.argmax(left_out <= max(tolerance, _SETTINGS.rounding) * left_out[0]))


def converge_top(evaluate: Callable[[int], FloatArray], tolerance: float) -> FloatArray:
    """Double the number of terms of a tapered series until its values settle.

    Args:
        evaluate: Function that sums a number of terms at some points, any shape.
        tolerance: Largest change by the last doubling, over the largest value [-].

    Raises:
        ValueError: If the values do not settle, as at a concentrated load, where they are infinite.
    """
    count = _SETTINGS.first_top
    before = evaluate(count)
    while count < _SETTINGS.most_top:
        count *= 2
        now = evaluate(count)
        change, size = np.abs(now - before).max(initial=0.0), np.abs(now).max(initial=0.0)
        if change <= tolerance * size:
            return now
        before = now
    raise ValueError(
        f"the displacement changes by {change / size:.1g} of its largest value between {count // 2} and {count} terms: "
        "it is infinite at a concentrated load, and the series converges slowly where a traction jumps"
    )


def taper(count: int) -> FloatArray:
    """Return factors of the terms of a series: 1 in the first half, then falling smoothly to 0, shape (count,) [-]."""
    x = np.clip(2 * np.arange(count) / count - 1, 1e-3, 1 - 1e-3)
    return np.asarray(expit(1 / x - 1 / (1 - x)))
