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
from tests.exact.sphere_patch import Direction

#: Width of the rings around the axis, over the angle at which undeformed surfaces overlap [-].
_MARGIN = 1.05
#: Degrees in whose second half the compliance is fitted by that of a half space and its next term [-].
_FITTED = 3000


@dataclass(frozen=True, kw_only=True)
class BallContact:
    """Contact of a ball with a layer on a sphere.

    Attributes:
        force: Force along the axis [N].
        angle: Angle between the axis and the edge of the contact [rad].
        area: Area of the contact [m2].
        load: Forces on the rings, from which texel forces follow (`SphereLayer.texel_forces`).
    """

    force: float
    angle: float
    area: float
    load: RingLoad


@dataclass(frozen=True, kw_only=True, eq=False)
class RingLoad:
    """Forces on rings around an axis, toward the centre of the sphere; a load of `sphere.SphereLayer`.

    Attributes:
        angles: Angles of the rings from the axis, shape (n,) [rad].
        forces: Sums of the forces on each, shape (n,) [N].
        direction: Direction of the axis, of any length, shape (3,) [-].
    """

    angles: FloatArray
    forces: FloatArray
    direction: Direction = (0.0, 0.0, 1.0)

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return the angles, and forces (outward, along the angle), as `CapLoad.place` does."""
        return self.angles, np.stack([-self.forces, 0 * self.forces], axis=1)


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
    compliance = _extend(layer.transfer(np.arange(min(degrees, _FITTED))).compliance[:, 0, 0], degrees)
    matrix = np.einsum("n,ni,nj->ij", (np.arange(degrees) + 0.5) * compliance, part, part, optimize=True)
    centre = outer + radius - depth
    gap = centre * np.cos(middle) - np.sqrt(radius**2 - (centre * np.sin(middle)) ** 2) - outer
    pressure = solve_active_set(matrix, -gap * part[0])
    force = np.pi * outer**2 * float(pressure @ np.diff(np.sin(edges) ** 2))
    angle = find_end(middle, pressure)
    forces = 2 * np.pi * outer**2 * pressure * part[0]
    load = RingLoad(angles=middle, forces=forces)
    return BallContact(force=force, angle=angle, area=2 * np.pi * outer**2 * (1 - np.cos(angle)), load=load)


def find_end(places: FloatArray, pressure: FloatArray) -> float:
    """Find the place at which the square of the pressure vanishes, a polynomial of the square of the place.

    Args:
        places: Distances of elements from the middle of the contact, ascending, shape (n,).
        pressure: Pressure there, 0 outside the contact, shape (n,).
    """
    last = int(np.flatnonzero(pressure > 0)[-1])
    near = slice(last // 2, last)  # without the last element, which the edge may cut
    scale, size = places[last] ** 2, pressure[0] ** 2
    roots = np.roots(np.polyfit(places[near] ** 2 / scale, pressure[near] ** 2 / size, 2))
    return float(np.sqrt(scale * roots.real[np.argmin(np.abs(roots - 1))]))


def _extend(compliance: FloatArray, degrees: int) -> FloatArray:
    """Continue the compliance of the first degrees by its asymptotic series in 1 / (n + 1/2), shape (degrees,)."""
    more = np.arange(len(compliance), degrees) + 0.5
    near = np.arange(len(compliance) // 2, len(compliance)) + 0.5
    terms = np.linalg.lstsq(near[:, None] ** -np.arange(1.0, 4.0), compliance[len(compliance) // 2 :], rcond=None)[0]
    return np.concatenate([compliance, more[:, None] ** -np.arange(1.0, 4.0) @ terms])


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
