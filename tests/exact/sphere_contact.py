"""Press a ball into an elastic layer bonded to a rigid sphere, exactly: pressures on rings by Legendre series.

The pressure is constant on each of many rings around the axis.  The displacement averaged over a ring follows from the
harmonics of `sphere.SphereLayer` by integrals of Legendre polynomials, which are closed forms.  Rings in contact have
no gap along the normals of the undeformed layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.array_types import FloatArray
from tests.exact.active_set import solve_active_set
from tests.exact.sphere import SphereLayer

#: Width of the rings around the axis, over the angle at which undeformed surfaces overlap [-].
_MARGIN = 1.05


@dataclass(frozen=True, kw_only=True)
class BallContact:
    """Contact of a ball with a layer on a sphere.

    Attributes:
        force: Force along the axis [N].
        angle: Angle between the axis and the edge of the contact [rad].
        area: Area of the contact [m2].
    """

    force: float
    angle: float
    area: float


def press_ball(layer: SphereLayer, radius: float, depth: float, *, rings: int = 80, degrees: int = 6000) -> BallContact:
    """Press a rigid ball into a layer on a sphere along the axis through both centres, without friction.

    Args:
        layer: The layer.
        radius: Radius of the ball [m].
        depth: Approach from first touch [m].
        rings: Number of rings.
        degrees: Number of terms of the series.
    """
    outer = layer.outer_radius
    overlap = np.sqrt(2 * depth * radius * outer / (radius + outer)) / outer
    edges = np.linspace(0, _MARGIN * overlap, rings + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    part = _integrate_rings(np.cos(edges), degrees)
    compliance = layer.transfer(np.arange(degrees)).compliance[:, 0, 0]
    matrix = np.einsum("n,ni,nj->ij", (np.arange(degrees) + 0.5) * compliance, part, part, optimize=True)
    centre = outer + radius - depth
    gap = centre * np.cos(middle) - np.sqrt(radius**2 - (centre * np.sin(middle)) ** 2) - outer
    pressure = solve_active_set(matrix, -gap * part[0])
    force = np.pi * outer**2 * float(pressure @ np.diff(np.sin(edges) ** 2))
    # The square of the pressure vanishes linearly at the edge.
    last = np.flatnonzero(pressure > 0)[-1]
    slope, offset = np.polyfit(middle[last - 3 : last], pressure[last - 3 : last] ** 2, 1)
    angle = float(-offset / slope)
    return BallContact(force=force, angle=angle, area=2 * np.pi * outer**2 * (1 - np.cos(angle)))


def _integrate_rings(x: FloatArray, degrees: int) -> FloatArray:
    """Integrate Legendre polynomials times the sine over rings between angles of cosines x, shape (degrees, rings)."""
    value = np.ones((degrees + 1, len(x)))
    value[1] = x
    for n in range(1, degrees):
        value[n + 1] = ((2 * n + 1) * x * value[n] - n * value[n - 1]) / (n + 1)
    below = np.concatenate([np.ones((1, len(x))), value[:-2]])
    n = np.arange(degrees)[:, None]
    cap = (below - value[1 : degrees + 1]) / (2 * n + 1)
    return np.diff(cap, axis=1)
