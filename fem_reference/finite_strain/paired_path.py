"""Solve a loading path on a block together with its baseline, the same loading path at small strain without friction.

A block is the part of a cover that is meshed in three dimensions.  Both solutions have nearly the same discretisation
error, which cancels in their difference (a control variate).  The difference is the effect of finite strain and
friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.fields.cover_fields import CoverFields, recover_fields
from fem_reference.finite_strain.axisymmetric_path import FIRST_DEPTH, PENALTY
from fem_reference.finite_strain.block_path import Block, BlockState, describe_state, find_constrained, mesh_block
from fem_reference.finite_strain.contact import SurfaceContact
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem, Guess
from fem_reference.finite_strain.hyperelastic import SmallStrainSolid, Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.mesh_transfer import transfer_state

#: Mean penetration over depth below which augmentation stops, without and with friction.  Most of the effect of the
#: penetration cancels in the difference from the baseline; with friction, which the baseline lacks, less cancels [-].
_OVERLAP, _FRICTION_OVERLAP = 2e-3, 5e-4
#: Smallest number of steps of a loading path with friction, over the number of elements through the cover.  The error
#: of the steps then decreases with the elements, and the differences between grids show both [-].
FRICTION_STEPS = 3
#: Gap between indenter and cover, over the depth, below which a node counts as in contact [-].
_CLOSED = 0.01
#: Distance from the top of the cover, over its thickness, below which a node counts as on the top [-].
_ON_TOP = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PairedPath:
    """Equilibria of a loading path and of its baseline on one grid.

    Attributes:
        elements: Elements of the grid.
        baseline: Equilibrium at every target at small strain without friction.
        full: Equilibrium at every target with the strain and friction of the loading path.
        ratio: Load scale of `full` over that of `baseline` [-].
    """

    elements: MixedElements
    baseline: Sequence[ContactEquilibrium]
    full: Sequence[ContactEquilibrium]
    ratio: float

    def transfer_changes(self, target: MixedElements) -> list[Guess]:
        """Interpolate the differences `full` - `ratio` * `baseline` at every target to another grid."""
        out = []
        for small, large in zip(self.baseline, self.full, strict=True):
            baseline, full = small.penalty_solution, large.penalty_solution
            change = transfer_state(self.elements, target, full.state - self.ratio * baseline.state)
            out.append(Guess(state=change, depth=full.depth - self.ratio * baseline.depth))
        return out


def press_paired(
    path: LoadingPath,
    block: Block,
    approaches: Sequence[float],
    *,
    elements_per_thickness: int,
    coarser: PairedPath | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[BlockState], list[BlockState], PairedPath]:
    """Solve one loading path and its baseline on one grid.

    The initial guess of the baseline at each target is the undeformed state at the given depth.  The initial guess of
    the full solution is the scaled baseline plus the difference found on a coarser grid.  Targets are reached in steps
    where these guesses fail, and always with friction, because slip depends on the loading history.

    Args:
        path: Cover, indenter, targets and friction.
        block: Part of the cover that is meshed.
        approaches: Small-strain depth at each target [m].
        elements_per_thickness: Number of elements through the cover [-].
        coarser: Solutions on a coarser grid; None on the coarsest.
        progress: Called with a line of text after each step.

    Returns:
        States of the baseline at every target, full states at every target, and the equilibria of both as initial
        guesses for a finer grid.

    Raises:
        PathConvergenceError: If a path stops before its last target.
    """
    units = path.units
    elements = mesh_block(block, units.scale_cover(path.cover), elements_per_thickness)
    solid = Solid.from_cover(elements, path.cover, units)
    small_strain_solid = solid.linearise_at_rest()
    # Baseline.
    scale = path.baseline.load_scale
    undeformed = np.zeros(elements.displacements + elements.pressures)
    guesses = [Guess(state=undeformed, depth=scale * depth / units.length) for depth in approaches]
    tell = None if progress is None else lambda text: progress(f"small strain, {text}")
    baseline = _follow(path.baseline, block, small_strain_solid, guesses, tell, friction_steps=0)
    # Full path.
    ratio = path.load_scale / scale
    guesses = [] if path.friction else _guess_full(path, block, baseline, elements, coarser)
    full_solid = small_strain_solid if path.load_scale == scale else solid
    full = _follow(path, block, full_solid, guesses, progress, friction_steps=FRICTION_STEPS * elements_per_thickness)
    before = [describe_state(small_strain_solid, units, each, block) for each in baseline]
    after = [
        replace(describe_state(full_solid, units, each, block), fields=_recover_fields(path, solid, block, each))
        for each in full
    ]
    return before, after, PairedPath(elements=elements, baseline=baseline, full=full, ratio=ratio)


def _recover_fields(path: LoadingPath, solid: Solid, block: Block, reached: ContactEquilibrium) -> CoverFields | None:
    """Compute displacement and stress in the whole block if the loading path asks for them."""
    if not path.fields:
        return None
    scale = path.load_scale
    fields = recover_fields(solid, reached.state, path.units, load_scale=scale, linear=scale != 1)
    return fields.unfold(block.symmetric)


def _guess_full(
    path: LoadingPath,
    block: Block,
    baseline: Sequence[ContactEquilibrium],
    elements: MixedElements,
    coarser: PairedPath | None,
) -> list[Guess]:
    """Return an initial guess for every target: the scaled baseline plus the difference found on the coarser grid."""
    ratio = path.load_scale / path.baseline.load_scale
    solutions = [each.penalty_solution for each in baseline]
    scaled = [Guess(state=ratio * each.state, depth=ratio * each.depth) for each in solutions]
    no_change = Guess(state=np.zeros_like(solutions[0].state), depth=0.0)
    changes = [no_change] * len(scaled) if coarser is None else coarser.transfer_changes(elements)
    surface = replace(block.surface, load_scale=path.load_scale)
    return [add_change(*each, elements, surface) for each in zip(scaled, changes, strict=True)]


def add_change(baseline: Guess, change: Guess, elements: MixedElements, surface: IndenterSurface) -> Guess:
    """Add a change to a small-strain solution without changing the gaps of the nodes in contact.

    At small strain the gap of a node is measured above its undeformed position, at finite strain above its deformed
    position.  Nodes in contact are moved vertically until the second gap equals the first gap, because the penalty
    method turns any false penetration into a large force.

    Args:
        baseline: Solution at small strain, scaled to the load of the full loading path.
        change: Displacements, pressures and depth to add.
        elements: Elements of the mesh of `baseline` and `change`.
        surface: Surface of the indenter with the heights of the full loading path.
    """
    state, depth = baseline.state + change.state, baseline.depth + change.depth
    top = np.flatnonzero(elements.nodes[:, 2] > 1 - _ON_TOP)
    x, y, _ = elements.nodes[top].T
    gap = surface.height(x, y) - baseline.depth - baseline.state[3 * top + 2]
    closed = gap < _CLOSED * baseline.depth
    top, gap = top[closed], gap[closed]
    moved = elements.nodes[top, :2] + np.column_stack([state[3 * top], state[3 * top + 1]])
    state[3 * top + 2] = surface.height(*moved.T) - depth - gap
    return Guess(state=state, depth=depth)


def _follow(
    path: LoadingPath,
    block: Block,
    solid: Solid | SmallStrainSolid,
    guesses: Sequence[Guess],
    progress: Callable[[str], None] | None,
    *,
    friction_steps: int,
) -> list[ContactEquilibrium]:
    """Solve a loading path on a meshed solid and return the equilibrium at every target."""
    problem = ContactProblem(
        solid=solid,
        contact=SurfaceContact(
            solid.elements,
            1.0,
            replace(block.surface, load_scale=path.load_scale),
            penalty=PENALTY / block.size,
            multiple=block.multiple,
            friction=path.friction,
        ),
        constrained=find_constrained(block, solid.elements, bonded=path.cover.base == "bonded"),
        units=path.units,
        load_scale=path.load_scale,
        overlap=_FRICTION_OVERLAP if path.friction else _OVERLAP,
        friction_steps=friction_steps,
    )
    first = FIRST_DEPTH * path.load_scale
    return problem.follow(path.scaled_targets, control=path.control, first=first, guesses=guesses, progress=progress)
