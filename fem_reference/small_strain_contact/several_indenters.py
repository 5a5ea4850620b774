"""Solve the small-strain contact of several rigid indenters with one cover, each guided or free to tilt.

The indenters interact only through the cover.  `constrained_solver` solves the contact problem.  Prescribed are the
force on every indenter and, for an indenter that is free to tilt, zero moments about x and y through the point where
its weight acts.  The unknown motions are the approach of every indenter and its two tilts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.grid_convergence import pool_errors, texel_convergence
from fem_reference.linear_response.axisymmetric import point_spread
from fem_reference.linear_response.point_spread import superpose
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, decay_length, surface_compliance
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator, find_pressures
from fem_reference.small_strain_contact.frictionless import guess_touching
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.pose import Pose

#: Number of cells per cover thickness on the two grids; under sharp edges the error is proportional to cell size [-].
CELLS = (8, 16)
#: Smallest reach of the table of the surface compliance, over the diagonal of the rectangle around all indenters [-].
_DIAGONALS = 1.5
#: Smallest reach of the table of the surface compliance, over the decay length of the cover's response [-].
_DECAY_LENGTHS = 4.0
#: Safety factor on the change of a force between two grids (Roache 1994) [-].
_SAFETY = 3.0
#: Largest number of cells of a grid, for which memory and time suffice [-].
_MOST_CELLS = 4_000_000
#: Points along each edge of the rectangle in which two footprints may overlap [-], and its least edge [m].
_POINTS, _LEAST_EDGE = 100, 1e-9


@dataclass(frozen=True, kw_only=True)
class Body:
    """One of several rigid indenters on a cover, with its weight and pose.

    Attributes:
        indenter: Indenter with its shape.
        load: Weight of the indenter [N].
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].
        guided: Whether the indenter moves only along the normal of the array; otherwise it can also tilt freely.
        centre: Point where the weight acts, in the frame of the indenter [m].
    """

    indenter: Indenter
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    guided: bool = True
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def pose(self) -> Pose:
        """Pose of the indenter in the frame of the array."""
        return Pose.planar(at=self.at, yaw=self.yaw)

    @property
    def weight_point(self) -> FloatArray:
        """Point where the weight acts, in the frame of the array, shape (2,) [m]."""
        return np.array(self.pose.to_array(*np.array(self.centre)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SeveralIndentations:
    """Result of pressing several indenters into a cover at once.

    Attributes:
        texel_forces: Normal force on each of n texels, shape (n,) [N].
        texel_errors: Estimated errors of `texel_forces`, half widths of 95 % intervals: three times their changes
            between the two grids (Roache 1994), but at least the mean relative change of all, plus the error of the
            base response, shape (n,) [N].
        outside: Force on the base outside the active texels, computed independently of the loads [N].
        outside_error: The same error of `outside` [N].
        depths: Approach of each indenter from first touch, at its axis, shape (bodies,) [m].
        slopes: Tilts of each indenter as slopes along x and along y, shape (bodies, 2) [-].
        contact: Columns x, y in the frame of the array [m] and force [N] of the m cells in contact, shape (m, 3).
        contact_area: Area of these cells [m2].
        error_estimate: Changes between the two grids: `misplaced`, half the sum of the absolute changes of texel forces
            over the load; `peak_texel`, `depth` and `contact_area`, over their values [-].
    """

    texel_forces: FloatArray
    texel_errors: FloatArray
    outside: float
    outside_error: float
    depths: FloatArray
    slopes: FloatArray
    contact: FloatArray
    contact_area: float
    error_estimate: dict[str, float]


def press_together(
    cover: Cover, array: TexelArray, bodies: Sequence[Body], *, cells: tuple[int, int] = CELLS
) -> SeveralIndentations:
    """Press several frictionless, rigid indenters into a laterally wide cover at once, at small strain.

    Args:
        cover: Cover; hyperelastic materials are linearised at zero load.
        array: Array with the texels under the cover.
        bodies: Indenters with weights and poses; their footprints must not overlap.
        cells: Number of cells per cover thickness on the two grids [-].

    Raises:
        ValueError: If a load is not positive, or footprints overlap or are too far apart for one grid.
        ConvergenceError: If the contact does not converge.
    """
    if not bodies or not all(0 < body.load < np.inf for body in bodies):
        raise ValueError("press_together needs at least one body, each with a positive load")
    placed = [(body.indenter, body.pose) for body in bodies]
    if find_overlap(placed):
        raise ValueError("the footprints of two indenters overlap; move one of them")
    corners = np.concatenate([_find_corners(*each) for each in placed])
    if np.prod(np.ptp(corners, axis=0) * cells[-1] / cover.thickness) > _MOST_CELLS:
        raise ValueError("the bodies are too far apart to be solved together; press each alone")
    spread = point_spread(cover)
    diagonal = float(np.hypot(*np.ptp(corners, axis=0)))
    surface = surface_compliance(cover, max(_DIAGONALS * diagonal, _DECAY_LENGTHS * decay_length(cover)))
    solved = [_solve(surface, bodies, corners, cover.thickness / count) for count in cells]
    coarse, fine = (superpose(contact, spread, array, Pose()) for contact, _ in solved)
    # The error of the forces is proportional to the cell size, so they are extrapolated to cell size zero.
    forces = fine + (fine - coarse) / (cells[1] / cells[0] - 1)
    contact, motion = solved[-1]
    bases = [superpose(contact, each, array, Pose()) for each in spread.on_grids]
    errors = _SAFETY * np.abs(fine - coarse) + texel_convergence(bases, spread.sizes)
    load, change, peak = sum(body.load for body in bodies), np.abs(fine - coarse)[:-1], int(fine[:-1].argmax())
    areas = [len(each) * (cover.thickness / count) ** 2 for (each, _), count in zip(solved, cells, strict=True)]
    depths = [float(each[:, 0].max()) for _, each in solved]
    return SeveralIndentations(
        texel_forces=forces[:-1],
        texel_errors=pool_errors(errors[:-1], forces[:-1]),
        outside=float(forces[-1]),
        outside_error=float(errors[-1]),
        depths=motion[:, 0],
        slopes=motion[:, 1:],
        contact=contact,
        contact_area=areas[-1],
        error_estimate={
            "misplaced": float(change.sum() / (2 * load)),
            "peak_texel": float(change[peak] / fine[peak]),
            "depth": abs(depths[1] / depths[0] - 1),
            "contact_area": abs(areas[1] / areas[0] - 1),
        },
    )


def find_overlap(placed: Sequence[tuple[Indenter, Pose]]) -> tuple[int, int] | None:
    """Find two indenters whose footprints overlap.

    Args:
        placed: Indenters with their poses.

    Returns:
        Their indices in ascending order; None if all are apart.
    """
    boxes = [_find_corners(*each) for each in placed]
    for pair in itertools.combinations(range(len(placed)), 2):
        low = np.max([boxes[k].min(axis=0) for k in pair], axis=0)
        high = np.min([boxes[k].max(axis=0) for k in pair], axis=0)
        if (high - low < _LEAST_EDGE).any():
            continue
        x, y = np.meshgrid(*(low[:, None] + np.outer(high - low, (np.arange(_POINTS) + 0.5) / _POINTS)))
        gaps = [indenter.gap(*pose.to_indenter(x, y)) for indenter, pose in (placed[k] for k in pair)]
        if np.isfinite(gaps).all(axis=0).any():
            return pair
    return None


def _find_corners(indenter: Indenter, pose: Pose) -> FloatArray:
    """Return the corners of the rectangle around a footprint, in the frame of the array, shape (4, 2) [m]."""
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    return np.column_stack(pose.to_array(*(signs * indenter.footprint).T))


def _solve(
    surface: SurfaceCompliance, bodies: Sequence[Body], corners: FloatArray, cell: float
) -> tuple[FloatArray, FloatArray]:
    """Solve the contact of all indenters on one grid of cells.

    Args:
        surface: Compliance of the top of the cover.
        bodies: Indenters with weights and poses.
        corners: Corners of all footprints in the frame of the array, shape (k, 2) [m].
        cell: Edge length of a cell [m].

    Returns:
        Columns x, y [m] and force [N] of the m cells in contact, shape (m, 3), and approach [m] and slopes along x and
        y [-] of each indenter, shape (bodies, 3).
    """
    low, high = corners.min(axis=0), corners.max(axis=0)
    # The grid starts at the lowest corner, so that edges of footprints along the axes coincide with cell edges.
    count = np.maximum(1, np.ceil((high - low) / cell - 1e-9)).astype(int)
    x, y = np.meshgrid(*(low[i] + (np.arange(count[i]) + 0.5) * cell for i in range(2)), indexing="ij")
    gaps = np.array([body.indenter.gap(*body.pose.to_indenter(x, y)) for body in bodies])
    gap, owner = gaps.min(axis=0), gaps.argmin(axis=0)
    touching = np.any([guess_touching(np.where(owner == i, gap, np.inf), None) for i in range(len(bodies))], axis=0)
    columns, loads, mover = _constrain_bodies(bodies, np.where(np.isfinite(gap), owner, -1), x, y)
    compliance = ComplianceOperator(surface, x.shape, (cell, cell))
    pressure, found = find_pressures(compliance, gap, touching, columns=columns, sums=loads / cell**2)
    touching = pressure > 0
    motion = np.zeros((len(bodies), 3))
    for index, body in enumerate(bodies):
        own = found[mover == index]
        motion[index, : len(own)] = own
        # The approach is that of the indenter's axis, not that of the point where its weight acts.
        motion[index, 0] -= motion[index, 1:] @ (body.weight_point - body.at)
    return np.column_stack([x[touching], y[touching], pressure[touching] * cell**2]), motion


def _constrain_bodies(
    bodies: Sequence[Body], owner: IntArray, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """List the k free motions of all indenters: an approach, and two tilts if the indenter is not guided.

    The tilts are rotations about the point where the weight acts.

    Args:
        bodies: Indenters with weights and poses.
        owner: Index of the indenter above each cell, -1 for none, shape (rows, columns).
        x: x coordinates of the centres of the cells, shape (rows, columns) [m].
        y: y coordinates of the centres of the cells, shape (rows, columns) [m].

    Returns:
        Downward displacement of the indenter at each cell per unit of each motion, shape (k, rows, columns).
        Prescribed force [N] or moment [N m] of each motion, shape (k,).  Index of the indenter of each motion, shape
        (k,).
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
