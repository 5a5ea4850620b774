"""Rigid frictionless shapes on a wide cover by boundary elements on its exact compliance.

The method serves shapes that have no closed form, and uses no finite elements.  The pressure is constant on rectangles
that shrink toward the edge of the shape, so that few of them resolve the singular pressure there.  Displacements are
compared at their centres, and the contact area is found by an active set.  The half-space part of the compliance is
integrated exactly (Love 1929; Johnson, Contact Mechanics, 1985, eq. 3.25); the rest is smooth and integrated by four
Gauss points.  Shapes must be symmetric about x = 0 and y = 0; a quarter is solved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

from fem_reference.closed_form.layer import half_space_compliance, hankel_nodes, point_response_spline, transfer
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray

#: Most exchanges of the active set.
_EXCHANGES = 60
#: Overlap below which a cell counts as free of overlap, relative to the wanted displacement [-].
_ROUNDING = 1e-9
#: Points of the compliance's table per thickness of the thinnest layer, and Gauss points along a texel's edge.
_TABLE, _POINTS = 16, 8
#: Position of the two Gauss points of an edge, from its middle, over its length [-].
_GAUSS = 0.5 / np.sqrt(3)
#: The grid is laid out again on the area that touches, with this margin, if the contact reaches less than that part of
#: its half width [-].
_MARGIN, _FILLED = 1.1, 0.8


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedCells:
    """A solved contact in the shape's frame.

    Attributes:
        cover: The cover that was pressed.
        depth: Approach from first touch [m].
        x: Centres of the touching cells, shape (m,) [m].
        y: Shape (m,) [m].
        force: Force on each, shape (m,) [N].
    """

    cover: Cover
    depth: float
    x: FloatArray
    y: FloatArray
    force: FloatArray

    @property
    def total_force(self) -> float:
        """Force on the shape [N]."""
        return float(self.force.sum())

    def texel_forces(self, array: TexelArray) -> FloatArray:
        """Integrate the exact point response over each texel, for a shape at the array's origin, shape (n,) [N]."""
        half = np.array(array.texel_size) / 2
        points, weights = np.polynomial.legendre.leggauss(_POINTS)
        reach = float(np.hypot(*(np.abs(array.centres[:, :2]).max(axis=0) + half))) + float(
            np.hypot(self.x, self.y).max()
        )
        response = point_response_spline(self.cover, reach)
        out = np.empty(array.count)
        for i, (cx, cy) in enumerate(array.centres[:, :2]):
            x, y = cx + half[0] * points[:, None, None], cy + half[1] * points[:, None]
            value = response(np.hypot(x - self.x, y - self.y)) @ self.force
            out[i] = weights @ value @ weights * half[0] * half[1]
        return np.where(array.active, out, 0.0)


def pressed_shape(cover: Cover, indenter: Indenter, depth: float, *, cells: int = 24) -> PressedCells:
    """Press a shape that is symmetric about x = 0 and y = 0 into a laterally wide cover.

    Args:
        cover: Layers; linear elastic at zero load.
        indenter: The shape.
        depth: Approach from first touch [m].
        cells: Cells along each side of the quarter [-].

    Raises:
        RuntimeError: If the active set does not settle.
    """
    half = np.array(indenter.footprint)
    for _ in range(2):  # the second grid covers the area that touches
        x, y = (_grade_toward_edge(extent, cells) for extent in half)
        centres = np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, indexing="ij")
        sizes = np.meshgrid(np.diff(x), np.diff(y), indexing="ij")
        u, v, wide, high = (each.ravel() for each in (*centres, *sizes))
        pressure = _solve_active_set(_assemble(cover, u, v, wide, high), indenter.gap(u, v), depth)
        hit = pressure > 0
        touched = np.array([(u + wide / 2)[hit].max(), (v + high / 2)[hit].max()])
        if (touched > _FILLED * half).all():
            break
        half = np.minimum(_MARGIN * touched, half)
    force = (pressure * wide * high)[hit]
    signs = [(a, b) for a in (1, -1) for b in (1, -1)]
    return PressedCells(
        cover=cover,
        depth=depth,
        x=np.concatenate([a * u[hit] for a, _ in signs]),
        y=np.concatenate([b * v[hit] for _, b in signs]),
        force=np.concatenate([force for _ in signs]),
    )


def _grade_toward_edge(extent: float, cells: int) -> FloatArray:
    """Nodes from the middle to the edge, spaced for a pressure with a square-root singularity at the edge [m]."""
    return extent * np.sin(np.linspace(0, np.pi / 2, cells + 1))


def _assemble(cover: Cover, u: FloatArray, v: FloatArray, wide: FloatArray, high: FloatArray) -> FloatArray:
    """Displacement at each centre per pressure on each cell and its three mirror images, shape (m, m) [m/Pa]."""
    top = cover.layers[-1].material
    half_space = (1 - top.poisson_ratio) / (2 * np.pi * top.shear_modulus)
    regular = _tabulate_regular(cover, 2.1 * float(np.hypot(u.max(), v.max())))
    out = np.zeros((len(u), len(u)))
    for a in (1, -1):
        for b in (1, -1):
            dx, dy = u[:, None] - a * u, v[:, None] - b * v
            out += half_space * _integrate_distance(dx, dy, wide / 2, high / 2)
            for s in (_GAUSS, -_GAUSS):
                for t in (_GAUSS, -_GAUSS):
                    out += regular(np.hypot(dx + s * wide, dy + t * high)) * (wide * high / 4)
    return out


def _tabulate_regular(cover: Cover, reach: float) -> CubicSpline:
    """Tabulate the compliance less that of a half space of the top layer, over the distance [m/N]."""
    k, weight = hankel_nodes(cover, reach)
    excess = (transfer(cover, k).compliance - half_space_compliance(cover.layers[-1], k)) * k * weight / (2 * np.pi)
    thinnest = min(layer.thickness for layer in cover.layers)
    radius = np.linspace(0, reach, int(_TABLE * reach / thinnest) + 16)
    table = np.concatenate([j0(np.outer(part, k)) @ excess for part in np.array_split(radius, len(radius) // 64 + 1)])
    return CubicSpline(radius, table)


def _integrate_distance(x: FloatArray, y: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Integral of 1 / distance over rectangles of half sides a and b around the origin, at (x, y) [m]."""
    out = np.zeros_like(x)
    for s in (1, -1):
        for t in (1, -1):
            p, q = x + s * a, y + t * b
            r = np.hypot(p, q)
            out += s * t * (p * np.arctanh(q / r) + q * np.arctanh(p / r))
    return out


def _solve_active_set(matrix: FloatArray, gap: FloatArray, depth: float) -> FloatArray:
    """Find the pressures for which no cell is under tension and none overlaps the shape, shape (m,) [Pa]."""
    allowed = np.isfinite(gap)
    wanted = np.where(allowed, depth - gap, 0.0)
    touching = allowed & (wanted > 0)
    for _ in range(_EXCHANGES):
        pressure = np.zeros_like(gap)
        pressure[touching] = np.linalg.solve(matrix[np.ix_(touching, touching)], wanted[touching])
        under_tension = touching & (pressure < 0)
        overlapping = allowed & ~touching & (matrix @ pressure < wanted * (1 - _ROUNDING))
        if not (under_tension | overlapping).any():
            return pressure
        touching = touching ^ (under_tension | overlapping)
    raise RuntimeError(f"the contact did not settle in {_EXCHANGES} exchanges on {len(gap)} cells")
