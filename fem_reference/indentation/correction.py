"""Solve indentations at finite strain or with friction as corrections of accurate small-strain solutions.

Under sharp edges, and in three dimensions, finite-strain solutions are affordable only on coarse grids, whose
discretisation error is too large.  A loading path (ascending target loads or depths) is therefore solved twice on each
grid, without friction at small strain (the baseline) and with the requested strain and friction, and the difference
corrects an accurate small-strain solution, see `correct_solution`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.block_path import BasePressure, Block, BlockState, press_paired
from fem_reference.finite_strain.loading_path import LoadingPath, name_grid
from fem_reference.indentation.grid_solution import (
    BaseForces,
    GridSolution,
    add_refinements,
    correct_solution,
    extrapolate_solutions,
)
from fem_reference.indentation.rounding import SolidGrid, state_rounding
from meshes.array_types import FloatArray
from meshes.pose import Pose

#: Solutions of a loading path on three grids: the baseline, then those with the requested strain and friction.  Both
#: are lists with one list per target, which holds one solution per grid.
SolvedPair = tuple[list[list[GridSolution]], list[list[GridSolution]]]

#: Statement about the contact tractions of a corrected solution, by topic.
CONTACT_ASSUMPTION = {
    "contact": "tractions and fields of the finest mesh of finite strain and friction, multiplied by one factor to the "
    "total force; their local error is that of this mesh, up to 10 % under edges"
}
#: Smallest estimated error of a loading path with friction, which is that of its steps and of the springs; and of one
#: whose baseline has the same friction, steps and springs, so that the most of this error cancels [-].
LEAST_FRICTION_ERROR, LEAST_PAIRED_FRICTION_ERROR = 0.015, 0.003
#: Smallest depth over cover thickness at which the grids resolve the effect of finite strain under a flat face; at
#: smaller depths the effect is below the discretisation error [-].
_SMALLEST_RESOLVED_DEPTH = 0.04
#: Depth over the smallest resolved depth below which the effect of finite strain under a flat face, at most
#: proportional to the depth, is not computed [-].
_NEGLIGIBLE = 1e-4
#: Largest requested target, over the smallest resolved target, that is also used to correct the unresolved targets; a
#: larger one would be too far from these, and the smallest resolved target is solved in addition [-].
_SHARED_TARGET = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockModel:
    """Functions that mesh a loading path in three dimensions and evaluate its base pressure.

    Attributes:
        kind: Kind of the result in the result store.
        inputs: Inputs of the stored result besides loading path and grids.
        pose: Pose of the indenter in the frame of the mesh.
        grids: The three grids.
        lay_out: Function that returns the block to mesh on a grid.
        recover_pressure: Function that computes the base pressure of a solved state.
        integrate: Function that returns the forces on and outside the texels due to a base pressure, themselves a
            function of array and pose.
    """

    kind: str
    inputs: Mapping[str, Any]
    pose: Pose
    grids: Sequence[SolidGrid]
    lay_out: Callable[[SolidGrid], Block]
    recover_pressure: Callable[[BlockState], BasePressure]
    integrate: Callable[[BasePressure], BaseForces]


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
    path: LoadingPath, approaches: Sequence[float], model: BlockModel, progress: Callable[[str], None] | None
) -> SolvedPair:
    """Solve a loading path and its baseline on three three-dimensional grids, or read both from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        approaches: Small-strain depth at each target [m].
        model: Functions that mesh the loading path and evaluate its base pressure.
        progress: Called with a line of text after each step.
    """

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        coarser = None
        for number, grid in enumerate(model.grids):
            block = model.lay_out(grid)
            baseline, full, coarser = press_paired(
                path,
                block,
                approaches,
                elements_per_thickness=grid.count,
                coarser=coarser,
                progress=name_grid(progress, grid.count),
            )
            for name, states in (("baseline", baseline), ("full", full)):
                for i, state in enumerate(states):
                    key = f"{name}_{number}_{i}"
                    x, y, pressure = model.recover_pressure(state)
                    out |= {f"x_{key}": x, f"y_{key}": y, f"pressure_{key}": pressure}
                    out[f"contact_{key}"] = state.contact
                    if state.fields is not None and number == len(model.grids) - 1:
                        out |= state.fields.pack(f"fields_{key}")
                    out[f"scalars_{key}"] = np.array(
                        [state.load, state.depth, state.area, state.overlap / state.depth, state.energy]
                    )
        return out

    data = result_store.fetch(model.kind, {"path": path, "grids": model.grids, **model.inputs}, compute)
    baseline, full = (
        [
            [_read_solution(data, f"{name}_{k}_{i}", 1 / grid.count, each, model) for k, grid in enumerate(model.grids)]
            for i in range(len(path.targets))
        ]
        for name, each in (("baseline", path.baseline), ("full", path))
    )
    return baseline, full


def _read_solution(
    data: Mapping[str, FloatArray], key: str, size: float, path: LoadingPath, model: BlockModel
) -> GridSolution:
    """Build one solution from stored arrays; forces and depth are divided by the load scale of the loading path."""
    load, depth, area, overlap, energy = (float(value) for value in data[f"scalars_{key}"])
    force = load / path.load_scale
    base = data[f"x_{key}"], data[f"y_{key}"], data[f"pressure_{key}"] / path.load_scale
    x, y, *forces = data[f"contact_{key}"].T
    normal, *shear = np.array(forces) / path.load_scale
    turn = replace(model.pose, point=(0.0, 0.0, 0.0))
    return GridSolution(
        size=size,
        total_force=force,
        depth=depth / path.load_scale,
        area=area,
        overlap=overlap,
        contact=np.column_stack([*model.pose.to_indenter(x, y), normal]),
        base_forces=model.integrate(base),
        energy=energy / path.load_scale**2,
        shear=np.column_stack(turn.to_indenter(*shear)) if path.friction else None,
        fields=CoverFields.unpack(data, f"fields_{key}"),
    )


def _raise_targets(targets: Sequence[float], relative_depths: Sequence[float]) -> list[float]:
    """Replace target loads or depths that the grids cannot resolve by one larger target.

    Args:
        targets: Target loads or depths, ascending.
        relative_depths: Small-strain depth at each target over the smallest resolved depth [-].
    """
    least = targets[0] / relative_depths[0]
    shared = next((target for target in targets if least <= target <= _SHARED_TARGET * least), least)
    return [target if target >= least else shared for target in targets]
