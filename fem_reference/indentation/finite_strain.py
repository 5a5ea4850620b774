"""Solve indentations at finite strain or with friction, mostly as corrections of accurate small-strain solutions.

On a wide cover the mesh is fixed in the frame of the indenter, and one stored solution is valid for all poses.  There,
an indenter with a smooth shape of revolution is solved directly in the r-z plane.  Under sharp edges, and in three
dimensions, finite-strain solutions are affordable only on coarse grids, whose discretisation error is too large.  A
loading path (ascending target loads or depths) is therefore solved twice on each grid: without friction at small strain
(the baseline), and with the requested strain and friction.  The difference corrects an accurate small-strain solution,
see `correct_solution`.  On a cover of limited size the solution depends on the pose.

A finite-strain solution under a perfectly sharp edge does not converge as the mesh is refined, and the elements must
resolve a rounded edge.  The radius is therefore as small as the finest grid can resolve; results state the radius.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fem_reference import result_store
from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.axisymmetric_path import DEEP, press_axisymmetric
from fem_reference.finite_strain.block_path import Block, is_rectangular, lay_out_block, lay_out_cover, press_paired
from fem_reference.finite_strain.contact_problem import OVERLAP, SolvedPath
from fem_reference.finite_strain.loading_path import LoadingPath, Progress, name_grid, report
from fem_reference.indentation import small_strain
from fem_reference.indentation.grid_solution import (
    GridSolution,
    GridStudy,
    add_refinements,
    correct_solution,
    extrapolate_solutions,
    scale_solution,
    scale_to_target,
)
from fem_reference.linear_response.surface_compliance import choose_reach, choose_solid_reach, warn_of_boundary
from fem_reference.small_strain_contact.free_edges import find_mirror_planes
from meshes import FlatPunch, Indenter
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose

#: Radius of rounded edges in axisymmetric meshes, over the smaller of cover thickness and half width of the indenter
#: [-].
_FINE = 1 / 20
#: Largest depth over thickness for which the radius of rounded edges in axisymmetric meshes is enlarged [-].
_DEEPEST = 0.6
#: Radius of rounded edges in three dimensions, where elements are larger, over the smaller of cover thickness and half
#: width of the indenter [-].
_COARSE = 1 / 5
#: Number of elements through the cover on the three grids in three dimensions; the result is that of the finest [-].
SOLID_GRIDS = (2, 3, 4)
#: Larger radius of rounded edges, over that of `choose_solid_fillet`, on the two other grids of three grids that refine
#: radius and elements alternately [-].
_WIDE_EDGE = 3 / 4
#: Smaller radius of rounded edges, over that of `choose_solid_fillet`, on the grid with smaller edges of three grids
#: that refine radius and elements alternately [-].
_NARROW_EDGE = 3 / 8
#: Safety factor for edges on mesh lines [-]: estimated difference between the results with the smaller radius and with
#: a sharp edge, over the difference between the results with the two radii.  In the r-z plane without slip at finite
#: strain, radii down to a fortieth of the thickness can be solved, and the ratio is 0.9 to 2.1
#: (`tests/verification/test_rounded_edges.py`).
_ON_LINES = 2.0
#: Safety factor for edges that are not on mesh lines, which the elements resolve less well; else as `_ON_LINES` [-].
_OFF_LINES = 3.0
#: Largest distance from a convex corner of a face to its inset outline, over the inset, for a corner of 50 degrees [-].
#: Points of the face that are farther from the inset outline lie on a wall that the inset removes.
_MITER = 2.4
#: Smallest width of the thickest wall of a face that a grid can resolve, over half the footprint [-].
_THINNEST_WALL = 0.05
#: Number of sample points along each side of the footprint in the measurement of a face's wall thickness [-].
_SAMPLES = 81


@dataclass(frozen=True, kw_only=True)
class SolidGrid:
    """One of the grids in three dimensions.

    Attributes:
        count: Number of elements through the cover [-].
        fillet: Radius of rounded edges of the indenter [m].
    """

    count: int
    fillet: float


def choose_solid_grids(thickness: float, indenter: Indenter, *, in_turn: bool) -> tuple[SolidGrid, ...]:
    """Choose three grids for the solution at finite strain or with friction in three dimensions.

    With friction the force rises as the radius of an edge falls, and falls with finer elements.  If both were refined
    together, the two effects would cancel in the differences between the grids.  They are therefore refined
    alternately: the second grid has edges of half the radius of the first one, the third grid has more elements than
    the first.

    Args:
        thickness: Thickness of the cover [m].
        indenter: Indenter with a flat face or with edges.
        in_turn: Whether radius and elements are refined alternately.

    Raises:
        ValueError: If even the thickest wall is too thin, see `choose_solid_fillet`.
    """
    fillet = choose_solid_fillet(thickness, indenter)
    if in_turn:
        parts = ((SOLID_GRIDS[0], _WIDE_EDGE), (SOLID_GRIDS[0], _NARROW_EDGE), (SOLID_GRIDS[1], _WIDE_EDGE))
        return tuple(SolidGrid(count=count, fillet=share * fillet) for count, share in parts)
    return tuple(SolidGrid(count=n, fillet=scale_fillet(fillet, n, SOLID_GRIDS)) for n in SOLID_GRIDS)


def choose_edge_safety(path: LoadingPath, pose: Pose) -> float:
    """Choose the safety factor on the effect of the radius of rounded edges [-].

    It is `_ON_LINES` if the edges of the face lie on mesh lines, else `_OFF_LINES`, and 0 if the grids do not refine
    radius and elements alternately.

    Args:
        path: Cover, indenter and friction.
        pose: Pose of the indenter in the frame of the mesh.
    """
    if not path.refines_in_turn:
        return 0.0
    face = path.indenter
    on_lines = pose.is_aligned and isinstance(face, FlatPunch) and is_rectangular(face)
    return _ON_LINES if on_lines else _OFF_LINES


def choose_fillet(thickness: float, indenter: Indenter, depth: float = 0.0) -> float:
    """Choose the radius of rounded edges of an indenter of revolution on the finest axisymmetric grid [m].

    Args:
        thickness: Thickness of the cover [m].
        indenter: Indenter of revolution.
        depth: Small-strain depth at the last target [m].  Deep in the cover, elements turn inside out at small radii.
    """
    share = min(depth / thickness, _DEEPEST)
    return min(thickness, *indenter.footprint) * _FINE * max(1.0, share / DEEP)


def choose_solid_fillet(thickness: float, indenter: Indenter) -> float:
    """Choose the radius of an indenter's rounded edges on the finest three-dimensional grid [m].

    Radii are proportional to the element size, so coarser grids have larger radii.  A wall is a strip of the indenter's
    flat face, such as a leg of the letter H.  The radius is limited so that the middle of the thickest wall stays flat
    even with the radius of the coarsest grid.

    Args:
        thickness: Thickness of the cover, which sets the element size [m].
        indenter: Indenter with a flat face or with edges.

    Raises:
        ValueError: If even the thickest wall is too thin.
    """
    within = min(indenter.footprint)
    if isinstance(indenter, FlatPunch):
        within = min(within, 2 * float(indenter.signed_distance(*_sample_footprint(indenter)).max()))
    if within < _THINNEST_WALL * max(indenter.footprint):
        raise ValueError(
            f"no wall of the indenter's face is wider than about {max(within, 0) * 1e3:.2g} mm, too thin beside "
            f"{2e3 * max(indenter.footprint):.3g} mm for the grids of finite strain and friction; press it without "
            "friction into linear-elastic layers"
        )
    return min(thickness, within) * _COARSE


def scale_fillet(fillet: float, count: int, grids: Sequence[int]) -> float:
    """Compute the radius of rounded edges on one of several grids, in proportion to the element size [m].

    The differences between the grids, and thus the error estimates, then include the effect of the rounding.

    Args:
        fillet: Radius of rounded edges on the finest grid [m].
        count: Number of elements through the cover on this grid [-].
        grids: Number of elements through the cover on every grid, finest last [-].
    """
    return fillet * grids[-1] / count


def state_rounding(indenter: Indenter, fillet: float) -> dict[str, str]:
    """State in words, by topic, how edges or facets of an indenter are rounded; empty for a smooth indenter.

    Args:
        indenter: Indenter with its shape.
        fillet: Radius of rounded edges on the finest grid [m].
    """
    if indenter.is_flat:
        rounding = f"rounded with {fillet * 1e3:.3g} mm on the finest grid"
        lost = (
            f"; walls thinner than {2e3 * fillet:.3g} mm are left out of that" if _loses_wall(indenter, fillet) else ""
        )
        return {"edge": f"sharp at small strain, {rounding} for what finite strain or friction adds{lost}"}
    return {} if indenter.axisymmetric else {"surface": f"facets and edges rounded over {fillet * 1e3:.3g} mm"}


def _loses_wall(indenter: Indenter, fillet: float) -> bool:
    """Return whether some wall of the face is so thin that no flat part remains between its rounded edges."""
    if indenter.axisymmetric or not isinstance(indenter, FlatPunch):
        return False
    x, y = _sample_footprint(indenter)
    far = indenter.distance_from_inset(fillet, x, y) > _MITER * fillet
    return bool((far & (indenter.signed_distance(x, y) >= 0)).any())


def _sample_footprint(indenter: Indenter) -> tuple[FloatArray, FloatArray]:
    """Return x and y of the points of a regular grid over the footprint of an indenter [m]."""
    x, y = np.meshgrid(*(np.linspace(-half, half, _SAMPLES) for half in indenter.footprint))
    return x, y


#: Solutions of a loading path on three grids: the baseline, then those with the requested strain and friction.  Both
#: are lists with one list per target, which holds one solution per grid.
SolvedPair = tuple[list[list[GridSolution]], list[list[GridSolution]]]

#: Assumption on the contact tractions of a corrected solution, by topic.
CONTACT_ASSUMPTION = {
    "contact": "tractions and fields of the finest mesh of finite strain and friction, multiplied by one factor to the "
    "total force; their local error is that of this mesh, up to 10 % under edges"
}
#: Smallest estimated relative error of the force with friction, due to the steps of the path and to the tangential
#: springs of the friction model [-].
_LEAST_FRICTION_ERROR = 0.015
#: Smallest estimated relative error of the force if the baseline has the same friction, steps and springs, so that most
#: of their error cancels [-].
_LEAST_PAIRED_FRICTION_ERROR = 0.003
#: Smallest depth over cover thickness at which the grids resolve the effect of finite strain under a flat face [-].  At
#: smaller depths the effect is below the discretisation error.
_SMALLEST_RESOLVED_DEPTH = 0.04
#: Depth over the smallest resolved depth, below which the effect of finite strain under a flat face is not computed
#: [-].  The effect is at most proportional to the depth.
_NEGLIGIBLE = 1e-4
#: Largest requested target, over the smallest resolved target, that also serves to correct the unresolved targets [-].
#: A larger target would be too far from the unresolved ones; the smallest resolved target is then solved in addition.
_SHARED_TARGET = 2.0
#: First guess of what finite strain adds to the stiffness under a flat face, over depth per thickness [-]: it is 0.5 to
#: 0.6 under a disk as wide as the cover is thick, at a Poisson ratio of 0.4.
_STIFFENING = 0.5
#: The depth of a load is found by iteration: it ends when two depths differ by this share [-], after this many
#: solutions at most [-].
_CLOSE, _MOST_PASSES = 0.01, 6
#: Largest difference between the force at the last depth and the load, over the load, that `_approach` bridges [-].
_SETTLED = 0.03


def correct_path(
    path: LoadingPath,
    accurate: Sequence[Sequence[GridSolution]],
    solve: Callable[[LoadingPath, Sequence[float]], SolvedPair],
) -> list[list[GridSolution]]:
    """Solve a loading path by correcting its small-strain solution, without friction or with that of the path.

    Under a flat face with the friction of the baseline, small loads are corrected by the scaled effect at a larger
    load, which the grids can resolve, or not at all at depths so small that the effect is negligible.  The contact area
    under a flat face is that of the small-strain solution.  There loads are solved as depths, see `_find_depths`.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        accurate: Small-strain solutions of every target on fine grids, coarsest first.
        solve: Function that solves baseline and full loading path on three coarse grids, given the loading path and
            the small-strain depth at each of its targets [m].

    Returns:
        For each target one corrected solution per coarse grid.
    """
    if _needs_no_correction(path, accurate):
        return [
            [replace(_find_limit(path, grids), size=grid.size, area=grid.area) for grid in grids] for grids in accurate
        ]
    flat = path.indenter.is_flat
    if flat and path.control == "load" and not path.has_friction_effect:
        return _find_depths(path, accurate, solve)
    solved_targets = list(path.targets)
    if flat and not path.has_friction_effect:
        least_depth = _SMALLEST_RESOLVED_DEPTH * path.cover.thickness
        solved_targets = _raise_targets(path.targets, [grids[-1].depth / least_depth for grids in accurate])
    approach = {
        solved: grids[-1].depth * solved / target
        for target, solved, grids in zip(path.targets, solved_targets, accurate, strict=True)
    }
    stops = sorted(approach)
    baseline, full = solve(replace(path, targets=tuple(stops)).at_model_strain, [approach[stop] for stop in stops])
    out = []
    for target, solved, grids in zip(path.targets, solved_targets, accurate, strict=True):
        limit = _find_limit(path, grids)
        index = stops.index(solved)
        corrected = [
            correct_solution(
                limit,
                baseline=without,
                full=with_effect,
                control=path.control,
                share=target / solved,
                area=grid.area if flat else None,
            )
            for without, with_effect, grid in zip(baseline[index], full[index], grids, strict=True)
        ]
        out.append(add_refinements(corrected) if path.refines_in_turn else corrected)
    return out


def _find_depths(
    path: LoadingPath,
    accurate: Sequence[Sequence[GridSolution]],
    solve: Callable[[LoadingPath, Sequence[float]], SolvedPair],
) -> list[list[GridSolution]]:
    """Correct the small-strain solutions of target loads under a flat face at the depths that belong to them.

    How much a rounded edge stiffens or softens a solution depends on how deep it lies in the cover.  At equal loads the
    baseline lies deeper than the solution at finite strain, and the two effects of the edge differ; at equal depths
    they cancel.  The depths are found by iteration, and a last small change follows from a local law (`_approach`).

    Args:
        path: As for `correct_path`, with target loads.
        accurate: As for `correct_path`.
        solve: As for `correct_path`.

    Raises:
        ConvergenceError: If the cover does not bear a load at the depth that is found for it.
    """
    limits = [_find_limit(path, grids) for grids in accurate]
    stiffness = [limit.total_force / limit.depth for limit in limits]
    depths = [limit.depth / (1 + _STIFFENING * limit.depth / path.cover.thickness) for limit in limits]
    for _ in range(_MOST_PASSES):
        part = replace(path, control="depth", targets=tuple(depths))
        scaled = [
            [scale_to_target(grid, depth, "depth") for grid in grids]
            for grids, depth in zip(accurate, depths, strict=True)
        ]
        found = correct_path(part, scaled, solve)
        factors = [
            _approach(grids[-1], target, small)
            for grids, target, small in zip(found, path.targets, stiffness, strict=True)
        ]
        if max(abs(factor - 1) for factor in factors) < _CLOSE:
            break
        depths = [factor * depth for factor, depth in zip(factors, depths, strict=True)]
    for grids, target in zip(found, path.targets, strict=True):
        _check_settled(grids[-1], target)
    return [
        [_carry(grid, target, _approach(grid, target, small)) for grid in grids]
        for grids, target, small in zip(found, path.targets, stiffness, strict=True)
    ]


def _approach(solution: GridSolution, load: float, stiffness: float) -> float:
    """Return the depth of a load over that of a solution nearby, if finite strain adds in proportion to the depth [-].

    Args:
        solution: The solution.
        load: The load [N].
        stiffness: Load over depth at small strain [N/m].
    """
    linear = stiffness * solution.depth
    excess = solution.total_force / linear - 1
    return 2 * load / linear / (1 + float(np.sqrt(max(1 + 4 * excess * load / linear, 0.0))))


def _check_settled(solution: GridSolution, load: float) -> None:
    """Raise a ConvergenceError if the force at the last depth is not close to the load [N]."""
    force = solution.total_force
    if abs(force - load) > _SETTLED * load:
        where = f"it bears {force:.4g} N at {1e3 * solution.depth:.3g} mm"
        raise ConvergenceError(f"no depth was found at which the cover bears {load:.4g} N; {where}")


def _carry(solution: GridSolution, load: float, factor: float) -> GridSolution:
    """Give a solution a load nearby and its depth times a factor; the shares of the texels stay.

    Args:
        solution: The solution.
        load: The load [N].
        factor: Factor on the depth [-].
    """
    share = load / solution.total_force
    return replace(
        scale_solution(solution, share),
        depth=factor * solution.depth,
        energy=share * factor * solution.energy,
        fields=None if solution.fields is None else solution.fields.scale(factor, share),
    )


def state_correction(path: LoadingPath, accurate: Sequence[Sequence[GridSolution]], fillet: float) -> dict[str, str]:
    """State in words, by topic, what a corrected solution assumes.

    Args:
        path: Cover, indenter and friction.
        accurate: Small-strain solutions of every target.
        fillet: Smallest radius of rounded edges [m].
    """
    if _needs_no_correction(path, accurate):
        return {"strain": "small, because what finite strain adds at this depth is negligible"}
    return state_rounding(path.indenter, fillet) | CONTACT_ASSUMPTION


def _needs_no_correction(path: LoadingPath, accurate: Sequence[Sequence[GridSolution]]) -> bool:
    """Return whether the last depth under a flat face is so small that the effect of finite strain is negligible."""
    if not path.indenter.is_flat or path.has_friction_effect or path.fields:
        return False
    return accurate[-1][-1].depth < _NEGLIGIBLE * _SMALLEST_RESOLVED_DEPTH * path.cover.thickness


def _find_limit(path: LoadingPath, grids: Sequence[GridSolution]) -> GridSolution:
    """Return the accurate small-strain solution of one target.

    Under a flat face it is extrapolated to element size zero, else it is that of the finest grid.
    """
    return extrapolate_solutions(grids) if path.indenter.is_flat else grids[-1]


def pair_grids(solved: Sequence[Sequence[Sequence[GridSolution]]]) -> SolvedPair:
    """Reorder the solutions of a loading path and its baseline.

    Args:
        solved: Solutions by grid, by kind (baseline, then full path) and by target.

    Returns:
        Solutions by kind, by target and by grid.
    """
    baseline, full = ([list(grids) for grids in zip(*side, strict=True)] for side in zip(*solved, strict=True))
    return baseline, full


def _raise_targets(targets: Sequence[float], relative_depths: Sequence[float]) -> list[float]:
    """Replace target loads or depths that the grids cannot resolve by one larger target.

    Args:
        targets: Target loads or depths, ascending.
        relative_depths: Small-strain depth at each target over the smallest resolved depth [-].
    """
    least = targets[0] / relative_depths[0]
    shared = next((target for target in targets if least <= target <= _SHARED_TARGET * least), least)
    return [target if target >= least else shared for target in targets]


#: Number of elements through the cover on each axisymmetric grid, coarsest grid first [-].  Three neighbouring grids
#: are solved.  The result is that of the finest of the three, with an error estimate from all three.
GRIDS = (6, 9, 13, 19, 28)


def study_path(
    path: LoadingPath,
    place: Place,
    progress: Progress,
    refinement: int = 0,
    rubbing: GridStudy | None = None,
    *,
    start: SolvedPath | None = None,
) -> GridStudy:
    """Solve a loading path on three grids.

    Corrections of the small-strain solution have no singularity under a sharp edge, so they are assumed to converge
    with order 2, and with order 1 with friction.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        place: Array, and pose of the indenter, which matter on a cover of limited size.
        progress: Called with a line of text after each step.
        refinement: Number of axisymmetric grids that are skipped at the coarse end and added at the fine end [-].
        rubbing: Small-strain solutions with friction, to be corrected instead of frictionless ones.
        start: Part of this path that was solved before, for initial guesses in the r-z plane.

    Returns:
        The solutions of every target with the element sizes and the expected order of convergence.

    Raises:
        ValueError: If the base of a cover of limited size slides and the problem is not symmetric in both planes, so
            that the cover could move.
    """
    cover, indenter = path.cover, path.indenter
    pose = Pose() if cover.size is None else place.pose
    if cover.size is not None and cover.base == "sliding" and not all(find_mirror_planes(indenter, pose)):
        raise ValueError(
            "a cover of limited size that slides on its base stays where it is only under a shape that mirrors in both "
            "its middle planes; press its middle, bond its base, or take linear-elastic layers"
        )
    if rubbing is not None:
        path = replace(path, baseline_friction=path.friction)
    in_plane = path.is_in_plane
    grids = () if in_plane else choose_solid_grids(cover.thickness, indenter, in_turn=path.refines_in_turn)
    accurate, approach = None, 0.0
    if in_plane and not indenter.is_flat and rubbing is None:
        contact = small_strain.estimate_contact(path, None, progress)
        fillet = choose_fillet(cover.thickness, indenter)
        solutions = _solve_axisymmetric(path.at_model_strain, contact, progress, refinement, fillet, start=start)
        assumptions = state_rounding(indenter, fillet)
    else:
        accurate = rubbing or small_strain.study_path(path, None if cover.size is None else place, progress)
        contact, approach = accurate.solutions[-1][0].contact[:, :2], accurate.solutions[-1][-1].depth
        fillet = choose_fillet(cover.thickness, indenter, approach) if in_plane else min(grid.fillet for grid in grids)

        def solve(part: LoadingPath, approaches: Sequence[float]) -> SolvedPair:
            """Solve a loading path and its baseline on three grids."""
            nonlocal fillet
            if not in_plane:
                return _solve_block_pair(part, approaches, grids=grids, contact=contact, pose=pose, progress=progress)

            def run(radius: float) -> SolvedPair:
                press = partial(_solve_axisymmetric, contact=contact, progress=progress, refinement=refinement)
                baseline = press(part.baseline, fillet=radius, approach=approach)
                return baseline, press(part, fillet=radius, approach=approach, start=start)

            wider = choose_fillet(cover.thickness, indenter, _DEEPEST * cover.thickness)
            found, fillet = _widen_edge(run, fillet, wider, progress)
            return found

        solutions = correct_path(path, accurate.solutions, solve)
        assumptions = state_correction(path, accurate.solutions, fillet)
    least_error = _LEAST_PAIRED_FRICTION_ERROR if path.friction else 0.0
    return GridStudy(
        solutions=solutions,
        edge_safety=choose_edge_safety(path, pose),
        least_order=2.0 if accurate is not None and not path.has_friction_effect else 1.0,
        least_overlap=OVERLAP,
        least_error=_LEAST_FRICTION_ERROR if path.has_friction_effect else least_error,
        accurate=accurate,
        assumptions=assumptions,
        warnings=warn_of_boundary(cover) if cover.size is None else (),
    )


def _widen_edge(
    run: Callable[[float], SolvedPair], fillet: float, wider: float, progress: Progress
) -> tuple[SolvedPair, float]:
    """Solve with rounded edges of one radius, or with a wider one where a finer grid does not converge.

    Args:
        run: Function that solves with edges of a radius [m].
        fillet: The radius [m].
        wider: The wider radius [m].
        progress: Called with a line of text before the second attempt.

    Returns:
        Solutions and radius [m].  Those with the wider radius are read from the result store if they are there.
    """
    with contextlib.suppress(result_store.NotStoredError), result_store.stored_only():
        return run(wider), wider
    try:
        return run(fillet), fillet
    except PathConvergenceError as error:
        if error.solved is None or error.solved.coarse is None or fillet == wider:
            raise
        report(progress, f"edge rounded with {1e3 * wider:.2g} mm: no convergence with a sharper one")
        return run(wider), wider


def _solve_block_pair(
    path: LoadingPath,
    approaches: Sequence[float],
    *,
    grids: Sequence[SolidGrid],
    contact: FloatArray,
    pose: Pose,
    progress: Progress,
) -> SolvedPair:
    """Solve a loading path and its baseline on three three-dimensional grids, or read both from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        approaches: Small-strain depth at each target [m].
        grids: The three grids.
        contact: m points of the largest small-strain contact, shape (m, 2) [m].
        pose: Pose of the indenter in the frame of the mesh.
        progress: Called with a line of text after each step.
    """

    def compute() -> SolvedPair:
        coarser, solved = None, []
        for number, grid in enumerate(grids):
            baseline, full, coarser = press_paired(
                replace(path, fields=path.fields and number == len(grids) - 1),
                _lay_out(path, contact, pose, grid),
                approaches,
                elements_per_thickness=grid.count,
                coarser=coarser,
                progress=name_grid(progress, grid.count),
            )
            solved.append([[replace(each, size=1 / grid.count) for each in states] for states in (baseline, full)])
        return pair_grids(solved)

    inputs = {"path": path, "grids": grids, "pose": pose, "free": path.cover.size is not None}
    return result_store.fetch("block-press", inputs, compute)


def _lay_out(path: LoadingPath, contact: FloatArray, pose: Pose, grid: SolidGrid) -> Block:
    """Choose the part of the cover that is meshed in three dimensions, and its element sizes, for one grid.

    Args:
        path: Cover, indenter and targets.
        contact: m points of the largest small-strain contact, shape (m, 2) [m].
        pose: Pose of the indenter in the frame of the mesh.
        grid: Element count and edge radius.
    """
    if path.cover.size is not None:
        if isinstance(path.indenter, FlatPunch):
            contact = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * path.indenter.footprint
        return lay_out_cover(path, pose, contact, elements_per_thickness=grid.count, fillet=grid.fillet)
    half_x, half_y = path.indenter.footprint if path.indenter.is_flat else np.abs(contact).max(axis=0)
    return lay_out_block(
        path,
        elements_per_thickness=grid.count,
        contact_half=(float(half_x), float(half_y)),
        fillet=grid.fillet,
        reach=choose_solid_reach(path.cover),
    )


def _solve_axisymmetric(
    path: LoadingPath,
    contact: FloatArray,
    progress: Progress,
    refinement: int,
    fillet: float,
    *,
    approach: float = 0.0,
    start: SolvedPath | None = None,
) -> list[list[GridSolution]]:
    """Solve a loading path of an indenter of revolution on three grids, or read the solutions from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        contact: m points of the largest small-strain contact, columns x, y [m], shape (m, 2).
        progress: Called with a line of text after each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].
        fillet: Radius of rounded edges on the finest of the first three grids [m].
        approach: Small-strain depth at the last target under a flat face [m].
        start: Part of this path that was solved before, for initial guesses.

    Returns:
        For each target one solution per grid, coarsest first.
    """
    cover, indenter = path.cover, path.indenter
    grids = GRIDS[refinement : refinement + 3]

    def compute() -> list[list[GridSolution]]:
        radius = max(indenter.footprint) if indenter.is_flat else float(np.hypot(*contact[:, :2].T).max())
        out, coarse = [], start
        for count in grids:
            states, coarse = press_axisymmetric(
                replace(path, fields=path.fields and count == grids[-1]),
                elements_per_thickness=count,
                contact_radius=radius,
                fillet=scale_fillet(fillet, count, GRIDS[:3]),
                reach=choose_reach(cover, radius),
                approach=approach,
                coarse=coarse,
                progress=name_grid(progress, count),
            )
            out.append(states)
        return [list(each) for each in zip(*out, strict=True)]

    return result_store.fetch("finite-press", {"path": path, "grids": grids, "fillet": fillet}, compute)
