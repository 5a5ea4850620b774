"""Several rigid indenters in one small-strain contact problem: each at its own depth, guided or free to tilt.

The bodies are coupled through the cover only.  The contact problem is that of `constrained_solver`, with the force of
every body prescribed and, where it is free to tilt, both moments about the point its weight acts at; the motions are
each body's approach and tilts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.linear_response.point_spread import PointSpread, point_spread
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, decay_length, surface_compliance
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator, find_pressures
from fem_reference.small_strain_contact.frictionless import guess_touching
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.pose import PlanarPose

#: Cells along the thickness on the two grids; the error falls as the cell size under sharp edges.
CELLS = (8, 16)
#: Reach of the table of compliances, in diagonals of the rectangle around all bodies and in decay lengths, whichever
#: is more [-].
_DIAGONALS, _DECAY_LENGTHS = 1.5, 4.0
#: Cells whose base response is superposed at once: bounds the memory of the table of cells and texels.
_BLOCK = 2000


@dataclass(frozen=True, kw_only=True)
class Body:
    """One rigid indenter on the cover.

    Attributes:
        indenter: The shape.
        load: Its weight [N].
        at: Its axis in the array's frame [m].
        yaw: Its turn about that axis [rad].
        guided: Whether it can only move along the array's normal; else it tilts freely as well.
        centre: Where its weight acts, from its axis, in its own frame [m].
    """

    indenter: Indenter
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    guided: bool = True
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def pose(self) -> PlanarPose:
        """Position and turn of the indenter in the array's frame."""
        return PlanarPose(at=self.at, yaw=self.yaw)

    @property
    def corners(self) -> FloatArray:
        """Corners of the footprint in the array's frame, shape (4, 2) [m]."""
        signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        return np.column_stack(self.pose.to_array(*(signs * self.indenter.footprint).T))

    @property
    def weight_point(self) -> FloatArray:
        """Point of the array's frame where the weight acts, shape (2,) [m]."""
        return np.array(self.pose.to_array(*np.array(self.centre)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SeveralIndentations:
    """Result of several indenters on the cover at once.

    Attributes:
        texel_forces: Normal force on each texel, shape (n,) [N].
        outside: Force that reaches no active texel [N].
        depths: Approach of each body's axis from first touch, shape (bodies,) [m].
        slopes: Tilts of each body: rise along x and along y, shape (bodies, 2) [-].
        contact: Touching cells: x, y in the array's frame [m] and force [N], shape (m, 3).
        error_estimate: Sum of texel changes between the grids over the load, `misplaced` [-].
    """

    texel_forces: FloatArray
    outside: float
    depths: FloatArray
    slopes: FloatArray
    contact: FloatArray
    error_estimate: dict[str, float]


def press_together(cover: Cover, array: TexelArray, bodies: Sequence[Body]) -> SeveralIndentations:
    """Press frictionless, rigid indenters into a laterally wide cover at once (small strain).

    Args:
        cover: The cover; hyperelastic materials are linearised at zero load.
        array: The texels under it.
        bodies: The indenters; their footprints must not overlap.

    Raises:
        ValueError: If a load is not positive.
        ConvergenceError: If the contact does not converge.
    """
    if not bodies or not all(0 < body.load < np.inf for body in bodies):
        raise ValueError("press_together needs at least one body, each with a positive load")
    spread = point_spread(cover)
    corners = np.concatenate([body.corners for body in bodies])
    diagonal = float(np.hypot(*np.ptp(corners, axis=0)))
    surface = surface_compliance(cover, max(_DIAGONALS * diagonal, _DECAY_LENGTHS * decay_length(cover)))
    solved = [_solve(surface, bodies, corners, cover.thickness / count) for count in CELLS]
    coarse, fine = (_superpose(spread, array, contact) for contact, _ in solved)
    # The error is proportional to the cell: the difference of the grids tells how much is left.
    forces = fine + (fine - coarse) / (CELLS[1] / CELLS[0] - 1)
    contact, motion = solved[-1]
    load = sum(body.load for body in bodies)
    return SeveralIndentations(
        texel_forces=forces,
        outside=load - float(forces.sum()),
        depths=motion[:, 0],
        slopes=motion[:, 1:],
        contact=contact,
        error_estimate={"misplaced": float(np.abs(fine - coarse).sum() / (2 * load))},
    )


def _superpose(spread: PointSpread, array: TexelArray, contact: FloatArray) -> FloatArray:
    """Texel forces of all cells, shape (n,) [N]."""
    blocks = np.array_split(contact, max(1, len(contact) // _BLOCK))
    return np.asarray(sum(block[:, 2] @ spread.texel_influence(array, block[:, :2]) for block in blocks))


def _solve(
    surface: SurfaceCompliance, bodies: Sequence[Body], corners: FloatArray, cell: float
) -> tuple[FloatArray, FloatArray]:
    """Touching cells with their forces, shape (m, 3), and approach and slopes of each body, shape (bodies, 3)."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    # Whole cells from the lowest corner on, so that edges along the axes fall between cells.
    count = np.maximum(1, np.ceil((high - low) / cell - 1e-9)).astype(int)
    x, y = np.meshgrid(*(low[i] + (np.arange(count[i]) + 0.5) * cell for i in range(2)), indexing="ij")
    gaps = np.array([body.indenter.gap(*body.pose.to_indenter(x, y)) for body in bodies])
    gap, owner = gaps.min(axis=0), gaps.argmin(axis=0)
    touching = np.any([guess_touching(np.where(owner == i, gap, np.inf), None) for i in range(len(bodies))], axis=0)
    columns, loads, mover = _constrain_bodies(bodies, np.where(np.isfinite(gap), owner, -1), x, y)
    compliance = ComplianceOperator(surface, x.shape, cell)
    pressure, found = find_pressures(compliance, gap, touching, columns=columns, sums=loads / cell**2)
    touching = pressure > 0
    motion = np.zeros((len(bodies), 3))
    for index, body in enumerate(bodies):
        own = found[mover == index]
        motion[index, : len(own)] = own
        motion[index, 0] -= motion[index, 1:] @ (body.weight_point - body.at)  # approach of the axis
    return np.column_stack([x[touching], y[touching], pressure[touching] * cell**2]), motion


def _constrain_bodies(
    bodies: Sequence[Body], owner: IntArray, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Free motions of all bodies: an approach each, and two tilts about its weight's point where it is not guided.

    Args:
        bodies: The indenters.
        owner: Body over each cell, -1 for none, shape (rows, columns).
        x: Centres of the cells [m].
        y: Centres of the cells [m].

    Returns:
        Displacement of the cells per motion, shape (k, rows, columns); force [N] or moment [N m] of each motion, shape
        (k,); and the body that each motion belongs to, shape (k,).
    """
    columns, loads, movers = [], [], []
    for index, body in enumerate(bodies):
        own = (owner == index).astype(float)
        point = body.weight_point
        tilts = [] if body.guided else [own * (x - point[0]), own * (y - point[1])]
        columns += [own, *tilts]
        loads += [body.load, *(0.0 for _ in tilts)]
        movers += [index] * (1 + len(tilts))
    return np.array(columns), np.array(loads), np.array(movers)
