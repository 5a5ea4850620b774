"""Solve the contact of a rigid frictionless indenter with a wide cover by boundary elements.

A wide cover is so large that its edges have no effect.  The method uses the exact compliance of the cover and no finite
elements; it verifies contacts of shapes without an exact solution.  The contact pressure is constant on each of many
rectangular cells, which shrink toward the edge of the contact, so that few cells resolve the singular pressure at the
edge.  Displacement and gap are compared at the centres of the cells, and an active-set method finds the contact area.
The compliance is split into the compliance of a half space, integrated exactly (Love 1929; Johnson, Contact Mechanics,
1985, eq. 3.25), and a smooth remainder, integrated with four Gauss points per cell.  Shapes must be symmetric about
x = 0 and y = 0; one quarter is solved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.closed_form.active_set import solve_active_set
from fem_reference.closed_form.influence import superpose, tabulate_excess
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray

#: Distance of the two Gauss points on a side of a cell from the middle of the side, over the length of the side [-].
_GAUSS = 0.5 / np.sqrt(3)
#: Second solution on a smaller grid: half width of the new grid over that of the contact, and half width of the contact
#: over that of the first grid below which the second solution is needed [-].
_MARGIN, _FILLED = 1.1, 0.8


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedCells:
    """Solved contact of a rigid indenter with a cover, as forces at points in the frame of the indenter.

    Attributes:
        cover: The cover that was pressed.
        depth: Approach of the indenter from first touch [m].
        x: x coordinates of the centres of the m cells in contact, shape (m,) [m].
        y: y coordinates of these centres, shape (m,) [m].
        force: Contact force on each of these cells, shape (m,) [N].
    """

    cover: Cover
    depth: float
    x: FloatArray
    y: FloatArray
    force: FloatArray

    @property
    def total_force(self) -> float:
        """Normal force on the indenter [N]."""
        return float(self.force.sum())

    def texel_forces(self, array: TexelArray) -> FloatArray:
        """Compute the forces on the n texels of an array, for the indenter above the origin of the array.

        Returns:
            Force on each texel; 0 on inactive texels, which measure nothing, shape (n,) [N].
        """
        return superpose(self.cover, array, self.x, self.y, self.force)


def pressed_shape(cover: Cover, indenter: Indenter, depth: float, *, cells: int = 24) -> PressedCells:
    """Press a rigid indenter that is symmetric about x = 0 and y = 0 into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Indenter with its shape.
        depth: Approach of the indenter from first touch [m].
        cells: Number of boundary elements along each side of the solved quarter [-].

    Returns:
        The contact forces on the cells in contact.

    Raises:
        RuntimeError: If the active-set method does not converge.
    """
    half = np.array(indenter.footprint)
    for _ in range(2):  # the second grid covers the contact of the first solution
        x, y = (_grade_toward_edge(extent, cells) for extent in half)
        centres = np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, indexing="ij")
        sizes = np.meshgrid(np.diff(x), np.diff(y), indexing="ij")
        u, v, wide, high = (each.ravel() for each in (*centres, *sizes))
        pressure = solve_active_set(_assemble(cover, u, v, wide, high), depth - indenter.gap(u, v))
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
    """Place nodes from 0 to `extent`, spaced for a pressure with a square-root singularity at `extent` [m]."""
    return extent * np.sin(np.linspace(0, np.pi / 2, cells + 1))


def _assemble(cover: Cover, u: FloatArray, v: FloatArray, wide: FloatArray, high: FloatArray) -> FloatArray:
    """Assemble the compliance matrix of the m cells of a quarter of the contact.

    Args:
        cover: Cover under the indenter.
        u: x coordinates of the centres of the cells, shape (m,) [m].
        v: y coordinates of the centres, shape (m,) [m].
        wide: Sizes of the cells along x, shape (m,) [m].
        high: Sizes of the cells along y, shape (m,) [m].

    Returns:
        Displacement at each centre (rows) per pressure on each cell and its three mirror images (columns), shape (m, m)
        [m/Pa].
    """
    excess = tabulate_excess(cover)
    out = np.zeros((len(u), len(u)))
    for a in (1, -1):
        for b in (1, -1):
            dx, dy = u[:, None] - a * u, v[:, None] - b * v
            out += excess.half_space * _integrate_distance(dx, dy, wide / 2, high / 2)
            for s in (_GAUSS, -_GAUSS):
                for t in (_GAUSS, -_GAUSS):
                    out += excess(np.hypot(dx + s * wide, dy + t * high)) * (wide * high / 4)
    return out


def _integrate_distance(x: FloatArray, y: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Integrate 1 / distance from (x, y) over rectangles with half sides a and b around the origin [m]."""
    out = np.zeros_like(x)
    for s in (1, -1):
        for t in (1, -1):
            p, q = x + s * a, y + t * b
            r = np.hypot(p, q)
            out += s * t * (p * np.arctanh(q / r) + q * np.arctanh(p / r))
    return out
