"""The solution of an indentation on one grid, and how the solutions on three grids become one result.

Every solver returns the same record, `GridSolution`.  `scale_solution`, `extrapolate_solutions` and `correct_solution`
make a new record from existing ones.  `GridStudy` holds the solutions of a loading path on all grids together with what
is needed to combine them and to estimate the error.
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

#: Normal force on each texel, shape (n,) [N], for an array and the indenter's pose over it.
TexelForces = Callable[[TexelArray, PlanarPose], FloatArray]

#: Safety factor on the change between two extrapolations; ASME V&V 20-2009 uses 1.25 for three grids [-].
_SAFETY = 1.25


@dataclass(frozen=True, kw_only=True, eq=False)
class GridSolution:
    """One indentation solved on one grid.

    Attributes:
        total_force: Force on the indenter [N].
        depth: Approach from first touch of the undeformed cover [m].
        area: Contact area [m2].
        overlap: Mean penetration that the contact solver leaves between the surfaces, divided by the depth [-].
        contact: Contact points in the indenter's frame: columns x, y [m] and force [N], shape (m, 3).  Where a solver
            returns no contact tractions, a substitute with the same total force.
        texel_forces: Function that returns the texel forces for an array and a pose.
    """

    total_force: float
    depth: float
    area: float
    overlap: float
    contact: FloatArray
    texel_forces: TexelForces


@dataclass(frozen=True, kw_only=True, eq=False)
class GridStudy:
    """All targets of a loading path, each solved on three grids.

    Attributes:
        solutions: The three solutions of every target, coarsest grid first.
        sizes: Element sizes of the three grids, coarsest first; only their ratios matter [-].
        least_order: Smallest order of convergence that error estimates assume [-].
        extrapolate: Whether a result is the limit of the three values, extrapolated with first order, rather than the
            value on the finest grid.  Right where the pressure is singular under a sharp edge: the error of a result
            then falls in proportion to the element size.
        least_overlap: Smallest relative penetration that the solver can resolve; error estimates count at least this
            much [-].
        base_error: Relative error of the largest texel force that comes from the base response [-].
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
        """Return the result of three values: the finest one, or their limit if the study extrapolates.

        Args:
            values: One value or array per grid, coarsest first.
        """
        return extrapolate(values, self.sizes) if self.extrapolate else np.asarray(values[-1], dtype=float)

    def estimate_error(self, values: Sequence[float]) -> float:
        """Return the estimated relative error of `combine(values)` [-].

        For an extrapolated result: the change from the extrapolation of the two coarser grids, times a safety factor.
        Otherwise, and where three values do not change monotonically and nothing was extrapolated: the grid convergence
        index.
        """
        result = float(self.combine(values))
        if result == 0:
            return 0.0
        if self.extrapolate and (values[1] - values[0]) * (values[2] - values[1]) >= 0:
            return _SAFETY * abs(result - float(extrapolate(values[:2], self.sizes[:2]))) / abs(result)
        return grid_convergence(values, self.sizes, least=self.least_order) / abs(result)


def scale_solution(solution: GridSolution, factor: float) -> GridSolution:
    """Multiply force and depth by a factor; the contact area stays.

    Exact at small strain without friction where the contact area does not depend on the load, as under a flat face.
    """
    return replace(
        solution,
        total_force=factor * solution.total_force,
        depth=factor * solution.depth,
        contact=solution.contact * [1, 1, factor],
        texel_forces=lambda array, pose: factor * solution.texel_forces(array, pose),
    )


def extrapolate_solutions(solutions: Sequence[GridSolution], sizes: Sequence[float]) -> GridSolution:
    """Extrapolate force, depth and texel forces with first order to element size zero (Richardson).

    Area, overlap and contact points are those of the finest grid.

    Args:
        solutions: Solutions of one target, coarsest grid first.
        sizes: Element sizes of the grids; only their ratios matter [-].
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

    The grids of finite strain and friction are coarse, need rounded edges and converge slowly.  The frictionless
    small-strain solution on the same grid under the same rounded shape has nearly the same discretisation error.  The
    difference of the two is therefore much more accurate than either (a control variate).

    Args:
        accurate: Converged frictionless small-strain solution of the target.
        baseline: Frictionless small-strain solution on the coarse grid, at the target divided by `share`.
        full: Solution with finite strain, friction or both on the same grid, at the same load or depth.
        control: Whether the target is a load or a depth.
        share: Fraction of the computed change that applies to the target.  Below 1 where the change was computed at a
            larger load or depth because the grid could not resolve it at the target; the change is proportional to the
            load to first order [-].
        area: Contact area to report; the corrected area if not given [m2].
    """

    def correct(quantity: Callable[[GridSolution], float]) -> float:
        return quantity(accurate) * (1 + share * (quantity(full) / quantity(baseline) - 1))

    if control == "load":
        force = share * full.total_force
        depth = force * correct(lambda each: each.depth / each.total_force)
    else:
        depth = share * full.depth
        force = depth * correct(lambda each: each.total_force / each.depth)

    def texel_forces(array: TexelArray, pose: PlanarPose) -> FloatArray:
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
    """Distribute the indenter's force over the points under it in proportion to the base pressure there.

    A substitute for the contact tractions, which the three-dimensional solvers do not return.

    Args:
        total_force: Force on the indenter [N].
        base: Base pressure.
        half: Half widths of the indenter's footprint [m].
        pose: Pose of the indenter in the frame of the base pressure.

    Returns:
        Columns x, y in the indenter's frame [m] and force [N], shape (k, 3).
    """
    x, y, pressure = base
    local_x, local_y = pose.to_indenter(*np.meshgrid(x, y, indexing="ij"))
    weight = np.outer(np.gradient(x), np.gradient(y)) * np.maximum(pressure, 0)
    under = (np.abs(local_x) <= half[0]) & (np.abs(local_y) <= half[1])
    return np.column_stack([local_x[under], local_y[under], weight[under] * total_force / weight[under].sum()])
