"""Combine the solutions of an indentation on three grids to one result with an error estimate.

Every solver returns its solution on one grid as a `GridSolution`.  `scale_solution`, `extrapolate_solutions` and
`correct_solution` compute a new solution from existing solutions.  `GridStudy` contains the solutions of a loading path
on all grids and the properties of the grids from which results and errors are computed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fem_reference.finite_strain.loading_path import Control
from fem_reference.grid_convergence import grid_convergence, texel_convergence
from fem_reference.linear_response.point_spread import PointSpread
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields

#: Safety factor on the change between two extrapolations, from which the error of an extrapolated result is estimated;
#: ASME V&V 20-2009 uses 1.25 for three grids [-].
_SAFETY = 1.25
#: Smallest estimated error of an extrapolated result, over its difference from the finest grid [-].
_LEAST_SHARE = 0.2


class Base(ABC):
    """Distributed load on the base of a cover under one indenter, from which texel forces follow."""

    @abstractmethod
    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:
        """Compute the normal force on each of n texels, then that outside the active texels, shape (n + 1,) [N].

        Args:
            array: Array with the texels.
            pose: Pose of the indenter.
        """

    def estimate_error(self, place: Place, texel: int, share: float) -> float:  # noqa: ARG002 -- none by default
        """Estimate the relative error of the force on a texel due to a computed response of the base [-].

        Args:
            place: Array, and pose of the indenter.
            texel: Index of the texel.
            share: Force on the texel over the force on the indenter [-].
        """
        return 0.0

    def texel_errors(self, place: Place, shares: FloatArray) -> FloatArray:  # noqa: ARG002 -- none by default
        """Estimate the errors of all forces due to a computed response of the base, over the force on the indenter [-].

        Args:
            place: Array, and pose of the indenter.
            shares: Forces on n texels and outside over the force on the indenter, shape (n + 1,) [-].
        """
        return np.zeros_like(shares)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialBase(Base):
    """Axisymmetric load on the base around the axis of the indenter.

    Attributes:
        spread: Base pressure per force as a function of the distance from the axis.
        force: The force [N].
    """

    spread: PointSpread
    force: float

    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:
        """Integrate the axisymmetric base pressure over the texels and outside them, see `Base.forces`."""
        return self.spread.base_forces(array, np.array(pose.at[:1]), np.array(pose.at[1:]), np.array([[self.force]]))


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseSum(Base):
    """Weighted sum of loads on the base.

    Attributes:
        parts: Weight and load of each part.
        like: Load whose response has the same error as the sum; None for no error.
    """

    parts: tuple[tuple[float, Base], ...]
    like: Base | None = None

    def forces(self, array: TexelArray, pose: Pose) -> FloatArray:
        """Compute the weighted sum of the texel forces of the parts, see `Base.forces`.

        Parts of weight 0 are not evaluated.
        """
        return np.asarray(sum(weight * base.forces(array, pose) for weight, base in self.parts if weight))

    def estimate_error(self, place: Place, texel: int, share: float) -> float:
        """Estimate the relative error of the force on a texel as that of the load `like`, see `Base.estimate_error`."""
        return 0.0 if self.like is None else self.like.estimate_error(place, texel, share)

    def texel_errors(self, place: Place, shares: FloatArray) -> FloatArray:
        """Estimate the errors of all forces as those of the load `like`, see `Base.texel_errors`."""
        return np.zeros_like(shares) if self.like is None else self.like.texel_errors(place, shares)


@dataclass(frozen=True, kw_only=True, eq=False)
class GridSolution:
    """Solution of one indentation on one grid.

    Attributes:
        size: Size of cells or elements; only ratios of sizes are used.
        total_force: Normal force on the indenter [N].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
        area: Contact area [m2].
        area_spread: Area in which the edge of the contact lies between two points of the grid, over `area`; 0 where the
            edge is located more finely [-].
        contact: Columns x, y [m] and normal force [N] of m contact points in the frame of the indenter, shape (m, 3).
        base: Load on the base.
        energy: Elastic energy stored in the cover [J].
        overlap: Mean penetration of indenter and cover that remains in the contact solution, over the depth [-].
        shear: Components x and y of the frictional force on the cover at the contact points, in the frame of the
            indenter, shape (m, 2) [N]; None without friction.
        fields: Displacement and stress in the cover in the frame of the mesh: of the array on a cover of limited size,
            else of the indenter; None unless the solver computed them.
    """

    size: float
    total_force: float
    depth: float
    area: float
    contact: FloatArray
    base: Base
    energy: float
    overlap: float = 0.0
    area_spread: float = 0.0
    shear: FloatArray | None = None
    fields: CoverFields | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class GridStudy:
    """Solutions of every target load or depth of a loading path on three grids.

    Attributes:
        solutions: For every target the three solutions, coarsest grid first.
        least_order: Smallest order of convergence that error estimates assume [-].
        most_order: Largest order of convergence that error estimates assume [-].
        edge_safety: Safety factor on the difference between the first and the second solution [-].  It applies if the
            second solution has edges of half the radius and the same elements, and only the third has smaller elements
            (`add_refinements`).  It is 0 if each grid refines radius and elements.
        extrapolate: Whether a result is extrapolated to element size zero with order 1, instead of taken from the
            finest grid.  Extrapolation is right under a sharp edge, where the singular pressure makes the error
            proportional to the element size.
        least_overlap: Smallest value of the penetration over the depth that error estimates assume [-].
        least_error: Smallest estimated relative discretisation error [-].
        least_area_error: Smallest estimated relative error of the contact area [-].
        accurate: Study of the small-strain solutions that `solutions` correct, whose errors are added; None if the
            solutions are not corrections.
        assumptions: Statements about the solution for the user, by topic.
        warnings: Sentences about errors that are not part of any estimate.
    """

    solutions: Sequence[Sequence[GridSolution]]
    least_order: float = 1.0
    most_order: float = 4.0
    edge_safety: float = 0.0
    extrapolate: bool = False
    least_overlap: float = 0.0
    least_error: float = 0.0
    least_area_error: float = 0.0
    accurate: GridStudy | None = None
    assumptions: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def combine(self, grids: Sequence[GridSolution], quantity: Callable[[GridSolution], npt.ArrayLike]) -> FloatArray:
        """Compute a quantity of the result from the solutions of one target on the three grids.

        All quantities of a target are the same weighted mean of the values on the three grids, so that forces which
        balance on every grid also balance in the result.

        Args:
            grids: Solutions of one target, coarsest grid first.
            quantity: Function that returns the quantity, a number or an array, of a solution.
        """
        weights = weigh_grids(grids) if self.extrapolate else (0.0, 0.0, 1.0)
        return _average(grids, weights, quantity)

    def estimate_error(self, grids: Sequence[GridSolution], quantity: Callable[[GridSolution], float]) -> float:
        """Estimate the relative discretisation error of `combine(grids, quantity)` [-].

        The error of an extrapolated result is its change from the extrapolation of the two coarser grids times a safety
        factor, but at least a fraction of the extrapolation itself.  If radius and elements are refined alternately,
        the errors of both are added, each with convergence of order 1.  In all other cases the error is the grid
        convergence index.

        Args:
            grids: Solutions of one target, coarsest grid first.
            quantity: Function that returns the quantity of a solution.
        """
        values, result = [float(quantity(each)) for each in grids], float(self.combine(grids, quantity))
        if result == 0:
            return 0.0
        found = self._compare_extrapolated(grids, values, result)
        sizes = [each.size for each in grids]
        error = (
            grid_convergence(values, sizes, least=self.least_order, most=self.most_order)
            if found is None
            else float(found)
        )
        return max(error / abs(result), self.least_error)

    def texel_errors(self, grids: Sequence[GridSolution], quantity: Callable[[GridSolution], FloatArray]) -> FloatArray:
        """Estimate the discretisation errors of `combine(grids, quantity)` for n forces, shape (n,) [N].

        The rules are those of `estimate_error`, with one order of convergence for all (`texel_convergence`).

        Args:
            grids: Solutions of one target, coarsest grid first.
            quantity: Function that returns the forces of a solution, shape (n,) [N].
        """
        values, result = [np.asarray(quantity(each)) for each in grids], self.combine(grids, quantity)
        error = self._compare_extrapolated(grids, values, result)
        if error is None:
            sizes = [each.size for each in grids]
            error = texel_convergence(values, sizes, least=self.least_order, most=self.most_order)
        return np.asarray(np.maximum(error, self.least_error * np.abs(result)))

    def _compare_extrapolated(
        self, grids: Sequence[GridSolution], values: Sequence[npt.ArrayLike], result: npt.ArrayLike
    ) -> FloatArray | None:
        """Estimate the errors of extrapolated or alternately refined values; None if neither is the case."""
        (first, second, third), sizes = map(np.asarray, values), [each.size for each in grids]
        if self.extrapolate and weigh_grids(grids)[1]:
            before = second + (second - first) * sizes[1] / (sizes[0] - sizes[1])
            return np.asarray(np.maximum(_SAFETY * np.abs(result - before), _LEAST_SHARE * np.abs(result - third)))
        if self.edge_safety:
            elements = np.abs(third - second) * sizes[2] / (sizes[1] - sizes[2])
            return np.asarray(self.edge_safety * np.abs(second - first) + _SAFETY * elements)
        return None


def estimate_spread(values: Sequence[float]) -> float:
    """Estimate the relative error of the last of several values that scatter from grid to grid [-].

    A contact area is located from the cells at its edge, and its error depends on the position of the edge within them.
    The estimate is twice the largest difference between the values.
    """
    return 2 * float(np.ptp(values)) / abs(values[-1])


def weigh_grids(grids: Sequence[GridSolution]) -> tuple[float, float, float]:
    """Compute the weights of the solutions on three grids in the extrapolation to element size zero (Richardson).

    The order of convergence is 1, and the two finest grids are used.  If the ratio of force and depth is not monotonic
    over the grids, the finest grid has all the weight.

    Args:
        grids: Solutions of one target, coarsest grid first.
    """
    first, second, third = (each.total_force / each.depth for each in grids)
    if (second - first) * (third - second) < 0:
        return 0.0, 0.0, 1.0
    share = grids[2].size / (grids[1].size - grids[2].size)
    return 0.0, -share, 1 + share


def _average(
    grids: Sequence[GridSolution], weights: Sequence[float], quantity: Callable[[GridSolution], npt.ArrayLike]
) -> FloatArray:
    """Compute the weighted sum of a quantity over several solutions; solutions of weight 0 are not evaluated."""
    parts = [w * np.asarray(quantity(each), dtype=float) for each, w in zip(grids, weights, strict=True) if w]
    return np.asarray(sum(parts))


def scale_solution(solution: GridSolution, factor: float) -> GridSolution:
    """Multiply force and depth of a solution by a factor, at the same contact area.

    The scaled solution is exact at small strain, without friction or without slip, if the contact area does not depend
    on the load, as under a flat face.
    """
    return replace(
        solution,
        total_force=factor * solution.total_force,
        depth=factor * solution.depth,
        contact=solution.contact * [1, 1, factor],
        shear=None if solution.shear is None else factor * solution.shear,
        base=BaseSum(parts=((factor, solution.base),), like=solution.base),
        energy=factor**2 * solution.energy,
    )


def scale_to_target(solution: GridSolution, target: float, control: Control) -> GridSolution:
    """Scale a solution by `scale_solution` to a target load [N] or depth [m], whichever `control` names."""
    return scale_solution(solution, target / (solution.depth if control == "depth" else solution.total_force))


def extrapolate_solutions(solutions: Sequence[GridSolution]) -> GridSolution:
    """Extrapolate force, depth, energy and texel forces to element size zero with order of convergence 1 (Richardson).

    Contact area, overlap and contact points are those of the finest grid.

    Args:
        solutions: Solutions of one target on several grids, coarsest first.
    """
    return _combine_solutions(solutions, weigh_grids(solutions))


def _combine_solutions(solutions: Sequence[GridSolution], weights: Sequence[float]) -> GridSolution:
    """Combine solutions on several grids to one solution.

    Force, depth, energy and texel forces are weighted sums; all other attributes are those of the last solution.
    """
    return replace(
        solutions[-1],
        total_force=float(_average(solutions, weights, lambda each: each.total_force)),
        depth=float(_average(solutions, weights, lambda each: each.depth)),
        base=BaseSum(
            parts=tuple(zip(weights, (each.base for each in solutions), strict=True)), like=solutions[-1].base
        ),
        energy=float(_average(solutions, weights, lambda each: each.energy)),
    )


def add_refinements(solutions: Sequence[GridSolution]) -> list[GridSolution]:
    """Turn solutions that refine one property each into successive refinements.

    The two refinements are assumed to be independent of each other (combination technique, Griebel et al. 1992).
    Contact area, overlap, contact points and fields of the last returned solution are those of the solution with
    smaller elements.

    Args:
        solutions: A solution, one with edges of smaller radius, and one with smaller elements.

    Returns:
        The first two solutions, and the second one plus the change from the first one to the third one.
    """
    return [*solutions[:2], _combine_solutions(solutions, (-1.0, 1.0, 1.0))]


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
    The difference of the two solutions is therefore much more accurate than each of them (a control variate).  The
    contact tractions are not corrected: those of `full` are multiplied by one factor, which makes their sum the force
    of the result.  The displacements in the cover are multiplied by one factor to the depth of the result.

    Args:
        accurate: Converged frictionless small-strain solution at the target load or depth.
        baseline: Frictionless small-strain solution on the coarse grid, at the target divided by `share`.
        full: Solution with finite strain, friction or both on the same grid, at the same load or depth as `baseline`.
        control: Whether the target is a load or a depth.
        share: Target over the load or depth of `baseline` [-].  It is below 1 if the coarse grid cannot resolve the
            effect at the target.  The relative effect is then multiplied by `share`, because to first order it is
            proportional to the load.
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

    # Texel forces per total force are those of the accurate solution plus their change from `baseline` to `full`.
    weights = (force / accurate.total_force, -share * force / baseline.total_force, share * force / full.total_force)
    scale = force / full.total_force
    return GridSolution(
        size=full.size,
        total_force=force,
        depth=depth,
        area=correct(lambda each: each.area) if area is None else area,
        overlap=max(baseline.overlap, full.overlap),
        contact=full.contact * [1, 1, scale],
        base=BaseSum(parts=tuple(zip(weights, (accurate.base, baseline.base, full.base), strict=True))),
        energy=force * depth * correct(lambda each: each.energy / (each.total_force * each.depth)),
        shear=None if full.shear is None else full.shear * scale,
        fields=None if full.fields is None else full.fields.scale(depth / full.depth, scale),
    )
