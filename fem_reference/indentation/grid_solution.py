"""Combine the solutions of an indentation on three grids to one result with an error estimate.

Every solver returns its solution on one grid as a `GridSolution`.  `scale_solution`, `extrapolate_solutions` and
`correct_solution` compute a new solution from existing solutions.  `GridStudy` contains the solutions of a loading path
on all grids and the properties of the grids from which results and errors are computed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fem_reference.finite_strain.block_path import BasePressure
from fem_reference.finite_strain.loading_path import Control
from fem_reference.grid_convergence import extrapolate, grid_convergence
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.pose import PlanarPose

#: Function that computes the normal force on each texel, shape (n,) [N], for an array and the pose of the indenter.
TexelForces = Callable[[TexelArray, PlanarPose], FloatArray]

#: Safety factor on the change between two extrapolations, from which the error of an extrapolated result is estimated;
#: ASME V&V 20-2009 uses 1.25 for three grids [-].
_SAFETY = 1.25


@dataclass(frozen=True, kw_only=True, eq=False)
class GridSolution:
    """Solution of one indentation on one grid.

    Attributes:
        total_force: Normal force on the indenter [N].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
        area: Contact area [m2].
        overlap: Mean penetration of indenter and cover that the contact solver does not remove, over the depth [-].
        contact: Columns x, y [m] and force [N] of m contact points in the frame of the indenter, shape (m, 3).  If a
            solver returns no contact tractions, the points are a substitute with the same total force.
        texel_forces: Function that computes the texel forces for an array and a pose of the indenter.
    """

    total_force: float
    depth: float
    area: float
    overlap: float
    contact: FloatArray
    texel_forces: TexelForces


@dataclass(frozen=True, kw_only=True, eq=False)
class GridStudy:
    """Solutions of every target load or depth of a loading path on three grids.

    Attributes:
        solutions: For every target the three solutions, coarsest grid first.
        sizes: Element sizes of the three grids, coarsest first; only the ratios of the sizes are used [-].
        least_order: Smallest order of convergence that error estimates assume [-].
        extrapolate: Whether a result is the value extrapolated to element size zero with order 1, or else the value on
            the finest grid.  Extrapolation is right under a sharp edge, where the singular pressure makes the error
            proportional to the element size.
        least_overlap: Smallest value of the penetration over the depth that error estimates assume [-].
        base_error: Relative error of the largest texel force due to the computed base response [-].
        assumptions: Statements about the solution for the user, by topic.
    """

    solutions: Sequence[Sequence[GridSolution]]
    sizes: Sequence[float]
    least_order: float
    extrapolate: bool = False
    least_overlap: float = 0.0
    base_error: float = 0.0
    assumptions: dict[str, str]

    def combine(self, values: Sequence[npt.ArrayLike]) -> FloatArray:
        """Compute the result from the values on the three grids: the value on the finest grid or the extrapolated one.

        Args:
            values: The same quantity on each grid, as number or array, coarsest grid first.
        """
        return extrapolate(values, self.sizes) if self.extrapolate else np.asarray(values[-1], dtype=float)

    def estimate_error(self, values: Sequence[float]) -> float:
        """Estimate the relative discretisation error of `combine(values)` [-].

        The error of an extrapolated result is its change from the extrapolation of the two coarser grids, times a
        safety factor.  In all other cases, also if the three values are not monotonic, the error is the grid
        convergence index.

        Args:
            values: The same quantity on each grid, coarsest grid first.
        """
        result = float(self.combine(values))
        if result == 0:
            return 0.0
        if self.extrapolate and (values[1] - values[0]) * (values[2] - values[1]) >= 0:
            return _SAFETY * abs(result - float(extrapolate(values[:2], self.sizes[:2]))) / abs(result)
        return grid_convergence(values, self.sizes, least=self.least_order) / abs(result)


def scale_solution(solution: GridSolution, factor: float) -> GridSolution:
    """Multiply force and depth of a solution by a factor, at the same contact area.

    The scaled solution is exact at small strain without friction if the contact area does not depend on the load, as
    under a flat face.
    """
    return replace(
        solution,
        total_force=factor * solution.total_force,
        depth=factor * solution.depth,
        contact=solution.contact * [1, 1, factor],
        texel_forces=lambda array, pose: factor * solution.texel_forces(array, pose),
    )


def extrapolate_solutions(solutions: Sequence[GridSolution], sizes: Sequence[float]) -> GridSolution:
    """Extrapolate force, depth and texel forces to element size zero with order of convergence 1 (Richardson).

    Contact area, overlap and contact points are those of the finest grid.

    Args:
        solutions: Solutions of one target on several grids, coarsest first.
        sizes: Element sizes of the grids in the same order; only the ratios of the sizes are used [-].
    """
    return replace(
        solutions[-1],
        total_force=float(extrapolate([each.total_force for each in solutions], sizes)),
        depth=float(extrapolate([each.depth for each in solutions], sizes)),
        texel_forces=lambda array, pose: extrapolate([each.texel_forces(array, pose) for each in solutions], sizes),
    )


def correct_solution(
    accurate: GridSolution,
    *,
    baseline: GridSolution,
    full: GridSolution,
    control: Control,
    share: float = 1.0,
    area: float | None = None,
) -> GridSolution:
    """Add the effect of finite strain or friction, computed on a coarse grid, to an accurate small-strain solution.

    Solutions with finite strain or friction use coarse grids and rounded edges, and converge slowly.  The frictionless
    small-strain solution on the same grid, under the same rounded indenter, has nearly the same discretisation error.
    The difference of the two solutions is therefore much more accurate than each of them (a control variate).

    Args:
        accurate: Converged frictionless small-strain solution at the target load or depth.
        baseline: Frictionless small-strain solution on the coarse grid, at the target divided by `share`.
        full: Solution with finite strain, friction or both on the same grid, at the same load or depth as `baseline`.
        control: Whether the target is a load or a depth.
        share: Target over the load or depth of `baseline`.  It is below 1 if the coarse grid cannot resolve the effect
            at the target; the relative effect is then multiplied by `share`, because to first order it is proportional
            to the load [-].
        area: Contact area of the result [m2]; None for the corrected area.
    """

    def correct(quantity: Callable[[GridSolution], float]) -> float:
        """Multiply a quantity of the accurate solution by its relative change from `baseline` to `full`."""
        return quantity(accurate) * (1 + share * (quantity(full) / quantity(baseline) - 1))

    if control == "load":
        force = share * full.total_force
        depth = force * correct(lambda each: each.depth / each.total_force)
    else:
        depth = share * full.depth
        force = depth * correct(lambda each: each.total_force / each.depth)

    def texel_forces(array: TexelArray, pose: PlanarPose) -> FloatArray:
        """Compute the corrected texel forces for an array and a pose of the indenter, shape (n,) [N]."""
        reference, before, after = (
            each.texel_forces(array, pose) / each.total_force for each in (accurate, baseline, full)
        )
        return np.asarray((reference + share * (after - before)) * force)

    return GridSolution(
        total_force=force,
        depth=depth,
        area=correct(lambda each: each.area) if area is None else area,
        overlap=max(baseline.overlap, full.overlap),
        contact=full.contact * [1, 1, force / full.total_force],
        texel_forces=texel_forces,
    )


def distribute_force(total_force: float, base: BasePressure, half: tuple[float, float], pose: PlanarPose) -> FloatArray:
    """Distribute the force on an indenter over points under its footprint, in proportion to the base pressure.

    These forces replace the contact tractions, which the three-dimensional solvers do not return.

    Args:
        total_force: Force on the indenter [N].
        base: Base pressure on a grid of points.
        half: Half widths of the footprint of the indenter along x and y [m].
        pose: Pose of the indenter in the frame of the base pressure.

    Returns:
        Columns x, y in the frame of the indenter [m] and force [N] of k points, shape (k, 3).
    """
    x, y, pressure = base
    local_x, local_y = pose.to_indenter(*np.meshgrid(x, y, indexing="ij"))
    weight = np.outer(np.gradient(x), np.gradient(y)) * np.maximum(pressure, 0)
    under = (np.abs(local_x) <= half[0]) & (np.abs(local_y) <= half[1])
    return np.column_stack([local_x[under], local_y[under], weight[under] * total_force / weight[under].sum()])
