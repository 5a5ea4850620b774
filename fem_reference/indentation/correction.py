"""Solve indentations at finite strain or with friction as corrections of accurate small-strain solutions.

Under sharp edges, and in three dimensions, finite-strain solutions are affordable only on coarse grids, whose
discretisation error is too large.  A loading path (ascending target loads or depths) is therefore solved twice on each
grid, without friction at small strain (the baseline) and with the requested strain and friction, and the difference
corrects an accurate small-strain solution, see `correct_solution`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from fem_reference import result_store
from fem_reference.finite_strain.block_path import Block, press_paired
from fem_reference.finite_strain.loading_path import LoadingPath, Progress, name_grid
from fem_reference.indentation.grid_solution import (
    GridSolution,
    add_refinements,
    correct_solution,
    extrapolate_solutions,
)
from fem_reference.indentation.rounding import SolidGrid, state_rounding

#: Solutions of a loading path on three grids: the baseline, then those with the requested strain and friction.  Both
#: are lists with one list per target, which holds one solution per grid.
SolvedPair = tuple[list[list[GridSolution]], list[list[GridSolution]]]

#: Statement about the contact tractions of a corrected solution, by topic.
CONTACT_ASSUMPTION = {
    "contact": "tractions and fields of the finest mesh of finite strain and friction, multiplied by one factor to the "
    "total force; their local error is that of this mesh, up to 10 % under edges"
}
#: Smallest estimated error of a loading path with friction: that of its steps and of its friction springs [-].
LEAST_FRICTION_ERROR = 0.015
#: Smallest estimated error of a loading path whose baseline has the same friction, steps and springs [-].  Most of the
#: error of steps and springs then cancels.
LEAST_PAIRED_FRICTION_ERROR = 0.003
#: Smallest depth over cover thickness at which the grids resolve the effect of finite strain under a flat face; at
#: smaller depths the effect is below the discretisation error [-].
_SMALLEST_RESOLVED_DEPTH = 0.04
#: Depth over the smallest resolved depth below which the effect of finite strain under a flat face, at most
#: proportional to the depth, is not computed [-].
_NEGLIGIBLE = 1e-4
#: Largest requested target, over the smallest resolved target, that is also used to correct the unresolved targets; a
#: larger one would be too far from these, and the smallest resolved target is solved in addition [-].
_SHARED_TARGET = 2.0


def correct_path(
    path: LoadingPath,
    accurate: Sequence[Sequence[GridSolution]],
    solve: Callable[[LoadingPath, Sequence[float]], SolvedPair],
) -> list[list[GridSolution]]:
    """Solve a loading path by correcting its small-strain solution without friction or, under flat faces, without slip.

    Under a flat face with the friction of the baseline, small loads are corrected by the scaled effect at a larger
    load, which the grids can resolve, or not at all at depths so small that the effect is negligible.  The contact area
    under a flat face is that of the small-strain solution.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        accurate: Small-strain solutions of every target on fine grids, coarsest first.
        solve: Function that solves baseline and full loading path on three coarse grids, given the loading path and
            the small-strain depth at each of its targets [m].

    Returns:
        For each target one corrected solution per coarse grid.
    """
    if _needs_no_correction(path, accurate):
        return [_keep_accurate(path, grids) for grids in accurate]
    flat = path.indenter.is_flat
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
    """Return whether finite strain has no effect under a flat face that is pressed so little."""
    if not path.indenter.is_flat or path.has_friction_effect or path.fields:
        return False
    return accurate[-1][-1].depth < _NEGLIGIBLE * _SMALLEST_RESOLVED_DEPTH * path.cover.thickness


def _find_limit(path: LoadingPath, grids: Sequence[GridSolution]) -> GridSolution:
    """Return the accurate solution of one target from those on its grids."""
    return extrapolate_solutions(grids) if path.indenter.is_flat and not path.baseline_friction else grids[-1]


def _keep_accurate(path: LoadingPath, grids: Sequence[GridSolution]) -> list[GridSolution]:
    """Return the accurate solution of one target, uncorrected, in place of the corrected one on each grid."""
    return [replace(_find_limit(path, grids), size=grid.size, area=grid.area) for grid in grids]


def solve_block_pair(
    path: LoadingPath,
    approaches: Sequence[float],
    *,
    grids: Sequence[SolidGrid],
    lay_out: Callable[[SolidGrid], Block],
    progress: Progress,
) -> SolvedPair:
    """Solve a loading path and its baseline on three three-dimensional grids, or read both from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        approaches: Small-strain depth at each target [m].
        grids: The three grids.
        lay_out: Function that returns the block to mesh on a grid.
        progress: Called with a line of text after each step.
    """

    def compute() -> SolvedPair:
        coarser, solved = None, []
        for number, grid in enumerate(grids):
            baseline, full, coarser = press_paired(
                replace(path, fields=path.fields and number == len(grids) - 1),
                lay_out(grid),
                approaches,
                elements_per_thickness=grid.count,
                coarser=coarser,
                progress=name_grid(progress, grid.count),
            )
            solved.append([[replace(each, size=1 / grid.count) for each in states] for states in (baseline, full)])
        return pair_grids(solved)

    block = lay_out(grids[0])
    inputs = {"path": path, "grids": grids, "pose": block.surface.pose, "free": block.free}
    return result_store.recall("block-press", inputs, compute)


def pair_grids(solved: Sequence[Sequence[Sequence[GridSolution]]]) -> SolvedPair:
    """Order solutions of baseline and full path, given by grid, kind of path and target, by kind, target and grid."""
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
