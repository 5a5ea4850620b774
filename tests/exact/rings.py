"""Press a rigid body of revolution with Coulomb friction into a wide layered cover by ring elements.

Pressure and shear traction act on rings; the pressure is constant on each, the shear proportional to the distance r
from the axis.  Their Hankel transforms are Bessel functions, so the displacements, averaged over rings, follow from the
exact compliance of the layers (`tests.exact.tractions`) by integrals over the wave number.  The load grows in
steps.  In each step, contact and slip are found in turn: no ring pulls, a ring sticks while its shear is below the
friction coefficient times its pressure, and the shear opposes the slip.  No code is shared with the finite elements,
and none with the contacts without slip of `no_slip`, which are the limit of large friction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from fem_reference.closed_form.contact import indent, integrate_texels
from fem_reference.closed_form.layer import hankel_nodes, place_gauss_points
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray
from tests.exact.active_set import solve_active_set
from tests.exact.tractions import traction_compliance, transfer_to_base

#: Radius of the outermost ring over that of the contact without friction [-].
_MARGIN = 1.12
#: Rings per load step on a curved indenter [-].
_RINGS_PER_STEP = 2
#: Largest wave number, times the width of a ring [-].
_SHORTEST = 60.0
#: Gauss points in each panel of the integral over the wave number [-].
_POINTS = 6
#: Largest number of repetitions of the search for contact and slip in a step, of the exchanges in each search, and
#: relative change of the shear at which the repetition ends [-].
_REPETITIONS, _EXCHANGES, _SETTLED = 200, 100, 1e-8


@dataclass(frozen=True, kw_only=True, eq=False)
class RingContact:
    """Solved contact with friction of a body of revolution with a wide cover.

    Attributes:
        cover: The cover that was pressed.
        depth: Approach of the indenter from first touch [m].
        edges: Radii of the edges of the n rings, shape (n + 1,) [m].
        pressure: Contact pressure on each ring, shape (n,) [Pa].
        shear: Shear traction on the cover at the middle of each ring, outward positive, shape (n,) [Pa].
        contact_radius: Radius of the contact [m].
    """

    cover: Cover
    depth: float
    edges: FloatArray
    pressure: FloatArray
    shear: FloatArray
    contact_radius: float

    @property
    def force(self) -> float:
        """Normal force on the indenter [N]."""
        return float(np.pi * np.diff(self.edges**2) @ self.pressure)

    def texel_forces(self, array: TexelArray, at: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
        """Compute the forces on the n texels of an array, for the indenter above the point `at` of the array [N]."""

        def base_pressure(reach: float) -> CubicSpline:
            k, weight = hankel_nodes(self.cover, reach + self.edges[-1])
            normal, shear = transfer_to_base(self.cover, k)
            disks, spirals = _transform_rings(self.edges, k)
            density = (normal * (disks @ self.pressure) + shear * (spirals @ self.shear)) * k * weight
            r = np.linspace(0, reach, int(60 * reach / self.cover.thickness) + 40)
            values = [j0(np.outer(part, k)) @ density for part in np.array_split(r, len(r) // 256 + 1)]
            return CubicSpline(r, np.concatenate(values), bc_type=("clamped", "not-a-knot"))

        return integrate_texels(array, at, base_pressure, self.cover.thickness)


def press_with_friction(
    cover: Cover, indenter: Indenter, depth: float, friction: float, *, rings: int = 64
) -> RingContact:
    """Press a body of revolution with Coulomb friction into a wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Sphere, rounded tip, cone or cylinder.
        depth: Approach of the indenter from first touch [m].
        friction: Coefficient of friction [-].
        rings: Number of rings [-].

    Raises:
        TypeError: If the indenter is not one of these shapes.
        ValueError: If the contact without friction reaches the rim of the indenter, or would have to pull.
        RuntimeError: If contact and slip do not settle.
    """
    smooth = indent(cover, indenter, depth=depth).contact_radius
    edges = np.linspace(0.0, 1.0, rings + 1) * smooth * (1.0 if indenter.is_flat else _MARGIN)
    if indenter.is_flat:
        edges = smooth * np.sin(np.pi / 2 * np.linspace(0.0, 1.0, rings + 1))
    gap = _average(edges, indenter)
    steps = 1 if indenter.is_flat else rings // _RINGS_PER_STEP
    blocks = _assemble(cover, edges)
    pressure, shear, slid = np.zeros(rings), np.zeros(rings), np.zeros(rings)
    for step in range(1, steps + 1):
        # The contact radius grows in equal steps if the depth is proportional to the height of the indenter there.
        height = _heights(np.array([step / steps, 1.0]) * smooth, indenter)
        part = depth * (height[0] / height[1] if height[1] else 1.0)
        pressure, shear = _solve_step(blocks, part - gap, friction, slid, shear)
        slid = blocks[2] @ pressure + blocks[3] @ shear
    return RingContact(
        cover=cover,
        depth=depth,
        edges=edges,
        pressure=pressure,
        shear=shear,
        contact_radius=smooth if indenter.is_flat else _find_edge(edges, pressure),
    )


def _heights(r: FloatArray, indenter: Indenter) -> FloatArray:
    """Return the height of the indenter over its tip at distances r from the axis [m]."""
    return indenter.gap(r, np.zeros_like(r))


def _average(edges: FloatArray, indenter: Indenter) -> FloatArray:
    """Average the height of the indenter over each ring, shape (n,) [m]."""
    if indenter.is_flat:
        return np.zeros(len(edges) - 1)
    r, weight = place_gauss_points(edges, 4)
    return np.asarray((_heights(r, indenter) * r * weight).reshape(-1, 4).sum(axis=1) / (np.diff(edges**2) / 2))


def _transform_rings(edges: FloatArray, k: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the Hankel transforms of unit tractions on the rings, shape (len(k), n) each [m2].

    The pressure 1 has the transform (r J1(k r)) / k of order 0, between the edges of its ring; the shear r / rho, where
    rho is the radius of the middle of the ring, has r^2 J2(k r) / (k rho) of order 1.
    """
    x = np.outer(k, edges)
    first = j1(x)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(x > 0, 2 * first / x - j0(x), 0.0)
    middle = (edges[1:] + edges[:-1]) / 2
    disks = np.diff(edges * first, axis=1) / k[:, None]
    return disks, np.diff(edges**2 * second, axis=1) / (k[:, None] * middle)


def _assemble(cover: Cover, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Assemble the displacements, averaged over rings, per traction on each ring, shape (n, n) each [m/Pa].

    Returns:
        Displacement downwards per pressure and per shear, and displacement outward per pressure and per shear.
    """
    top = cover.layers[-1].material
    plane = (1 - top.poisson_ratio) / top.shear_modulus
    largest = _SHORTEST / float(np.diff(edges).min())
    width = np.pi / (2 * edges[-1])
    panels = np.concatenate(
        [np.geomspace(1e-5 / cover.thickness, width, 40)[:-1], np.arange(1, largest / width + 1) * width]
    )
    panels = np.concatenate([[0.0], panels])
    k, weight = place_gauss_points(panels, _POINTS)
    normal, mixed, shear = (np.zeros((len(edges) - 1,) * 2) for _ in range(3))
    for chunk in np.array_split(np.arange(len(k)), len(k) // 4096 + 1):
        compliance = traction_compliance(cover, k[chunk]) * (k * weight)[chunk, None, None]
        disks, spirals = _transform_rings(edges, k[chunk])
        normal += disks.T @ (compliance[:, 0, :1] * disks)
        mixed += disks.T @ (compliance[:, 0, 1:] * spirals)
        shear += spirals.T @ (compliance[:, 1, 1:] * spirals)
    # Beyond the largest wave number the half space remains; products of different Bessel functions average to zero.
    middle = (edges[1:] + edges[:-1]) / 2
    tail = plane / (2 * np.pi * panels[-1] ** 2)
    normal += tail * _couple_edges(edges, np.ones_like(middle))
    shear += tail * _couple_edges(edges**3, middle)
    area = (np.diff(edges**2) / 2)[:, None]
    moment = (np.diff(edges**4) / 4)[:, None] / middle[:, None] ** 2
    return normal / area, mixed / area, mixed.T / moment, shear / moment


def _couple_edges(value: FloatArray, scale: FloatArray) -> FloatArray:
    """Couple rings with themselves and their neighbours by a value at each edge, over the scales of both rings."""
    out = np.diag((value[1:] + value[:-1]) / scale**2)
    off = value[1:-1] / (scale[1:] * scale[:-1])
    return np.asarray(out - np.diag(off, 1) - np.diag(off, -1))


def _solve_step(
    blocks: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    wanted: FloatArray,
    friction: float,
    before: FloatArray,
    shear: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Find pressure and shear of one load step.

    Args:
        blocks: Matrices from `_assemble`.
        wanted: Displacement downwards that contact requires, shape (n,) [m].
        friction: Coefficient of friction [-].
        before: Outward displacement at the end of the step before, shape (n,) [m].
        shear: Shear at the end of the step before, shape (n,) [Pa].

    Raises:
        RuntimeError: If contact and slip do not settle.
    """
    down, down_shear, out_pressure, out = blocks
    for _ in range(_REPETITIONS):
        pressure = solve_active_set(down, wanted - down_shear @ shear, rounding=1e-12)
        previous = shear
        shear = _find_slip(out, before - out_pressure @ pressure, friction * pressure)
        if np.abs(shear - previous).max() <= _SETTLED * pressure.max():
            return pressure, shear
    raise RuntimeError(f"contact and slip did not settle in {_REPETITIONS} repetitions")


def _find_slip(matrix: FloatArray, wanted: FloatArray, limit: FloatArray) -> FloatArray:
    """Find the shear of rings that stick or slip, by exchanges, shape (n,) [Pa].

    Args:
        matrix: Outward displacement per shear, shape (n, n) [m/Pa].
        wanted: Outward displacement that the shear must add so that a ring sticks, shape (n,) [m].
        limit: Largest shear of each ring, shape (n,) [Pa].
    """
    stick = limit > 0
    sign = np.zeros(len(limit))
    for _ in range(_EXCHANGES):
        shear = np.where(stick, 0.0, sign * limit)
        right = wanted[stick] - matrix[np.ix_(stick, ~stick)] @ shear[~stick]
        shear[stick] = np.linalg.solve(matrix[np.ix_(stick, stick)], right)
        beyond = stick & (np.abs(shear) > limit * (1 + 1e-12))
        # Slip is the displacement beyond the wanted one; shear on the cover opposes it.
        slip = matrix @ shear - wanted
        back = ~stick & (limit > 0) & (slip * sign > 0)
        if not (beyond | back).any():
            return shear
        sign = np.where(beyond, np.sign(shear), sign)
        stick = stick ^ (beyond | back)
    raise RuntimeError(f"slip did not settle in {_EXCHANGES} exchanges")


def _find_edge(edges: FloatArray, pressure: FloatArray) -> float:
    """Find the contact radius: where the square of the pressure is zero, extrapolated over r^2 [m].

    The last ring is only partly in contact; the two rings before it are used.
    """
    last = int(np.flatnonzero(pressure > 0)[-1])
    if last < 2 or pressure[last - 2] <= pressure[last - 1]:
        return float(edges[last + 1])
    (r, s), (before, after) = (edges[:-1] + edges[1:])[last - 2 : last] ** 2 / 4, pressure[last - 2 : last] ** 2
    found = np.sqrt(s + after * (s - r) / (before - after))
    return float(np.clip(found, edges[last], edges[min(last + 2, len(edges) - 1)]))
