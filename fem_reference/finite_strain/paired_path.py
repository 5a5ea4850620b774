"""One loading path in three dimensions, solved together with its frictionless twin at small strain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.elements.scaling import Units
from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.axisymmetric_path import PENALTY
from fem_reference.finite_strain.block_path import Block, SolidState, held, meshed, solid_state
from fem_reference.finite_strain.contact import Rigid, SurfaceContact
from fem_reference.finite_strain.hyperelastic import SmallStrainSolid, Solid
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.mesh_transfer import transferred
from fem_reference.finite_strain.newton import Equilibrium, Guess, Problem, first_solved

#: Overlap over the depth that may stay on both paths; it mostly cancels in what they differ by.  With friction, which
#: only one of them has, less cancels [-].
_OVERLAP, _OVERLAP_ALONG = 2e-3, 5e-4
#: Gap over the depth that counts as none [-].
_SHUT = 0.01
#: A node this close to the top lies on it, in thicknesses [-].
_TOUCH = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """One loading path twice on one grid.

    Attributes:
        elements: The grid.
        rest: The targets without friction at small strain.
        deep: The targets as asked for.
        ratio: Steepness of the second over that of the first [-].
    """

    elements: MixedElements
    rest: list[Equilibrium]
    deep: list[Equilibrium]
    ratio: float

    def changes(self, target: MixedElements) -> list[Guess]:
        """What the second adds to the first, scaled alike, on another grid."""
        out = []
        for rest, deep in zip(map(first_solved, self.rest), map(first_solved, self.deep), strict=True):
            change = deep.state - self.ratio * rest.state
            state = transferred(self.elements, target, change)
            out.append(Guess(state=state, depth=deep.depth - self.ratio * rest.depth))
        return out


def press_pair(
    path: LoadingPath,
    block: Block,
    approaches: Sequence[float],
    *,
    elements_per_thickness: int,
    before: Pair | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[SolidState], list[SolidState], Pair]:
    """Follow one loading path on one grid, and the same path without friction at small strain.

    The small-strain path starts at each target from the depth that is known, the other from the small-strain solution
    and what a coarser grid added to it; steps are walked only where that fails, or where friction asks for them.

    Args:
        path: What is pressed how far.
        block: What is meshed.
        approaches: Small-strain depth at each target [m].
        elements_per_thickness: Elements through the cover [-].
        before: The pair on a coarser grid.
        progress: Called with a line of text after each step.

    Returns:
        The states at small strain, those asked for, and the pair for a finer grid to start from.

    Raises:
        PathError: If the path stops early.
    """
    units = Units.of(path.cover)
    elements = meshed(block, units.scale_cover(path.cover), elements_per_thickness)
    solid = Solid.of_cover(elements, path.cover, units)
    at_rest = path.baseline
    undeformed = np.zeros(elements.displacements + elements.pressures)
    guesses = [Guess(state=undeformed, depth=at_rest.load_scale * depth / units.length) for depth in approaches]
    linear = solid.at_rest
    tell = None if progress is None else lambda text: progress(f"small strain, {text}")
    rest = _followed(at_rest, block, linear, guesses=guesses, progress=tell)
    small = path.load_scale == at_rest.load_scale
    starts = [] if path.friction else _starts(path, block, rest, elements, before)  # slip depends on the way
    deep = _followed(path, block, linear if small else solid, guesses=starts, progress=progress)
    states = [[solid_state(elements, units, each, block) for each in reached] for reached in (rest, deep)]
    return states[0], states[1], Pair(elements=elements, rest=rest, deep=deep, ratio=_ratio(path))


def _ratio(path: LoadingPath) -> float:
    """A path's load_scale over that of its small-strain twin [-]."""
    return path.load_scale / path.baseline.load_scale


def _starts(
    path: LoadingPath, block: Block, rest: Sequence[Equilibrium], elements: MixedElements, before: Pair | None
) -> list[Guess]:
    """The small-strain targets, scaled, with what the coarser grid added to its own."""
    ratio = _ratio(path)
    scaled = [Guess(state=ratio * each.state, depth=ratio * each.depth) for each in map(first_solved, rest)]
    nothing = Guess(state=np.zeros_like(rest[0].state), depth=0.0)
    changes = [nothing] * len(rest) if before is None else before.changes(elements)
    obstacle = block.obstacle.with_load_scale(path.load_scale)
    return [_changed(*each, elements, obstacle) for each in zip(scaled, changes, strict=True)]


def _changed(still: Guess, change: Guess, elements: MixedElements, obstacle: Rigid) -> Guess:
    """A change added to a solution whose points touched the obstacle where they were before they moved sideways.

    Points that touched lie on it again where they have moved to: under a penalty a false overlap is a large force.
    """
    state, depth = still.state + change.state, still.depth + change.depth
    top = np.flatnonzero(elements.nodes[:, 2] > 1 - _TOUCH)
    x, y, _ = elements.nodes[top].T
    gap = obstacle.at(x, y).value - still.depth - still.state[3 * top + 2]
    there = gap < _SHUT * still.depth
    top, gap = top[there], gap[there]
    moved = elements.nodes[top, :2] + np.column_stack([state[3 * top], state[3 * top + 1]])
    state[3 * top + 2] = obstacle.at(*moved.T).value - depth - gap
    return Guess(state=state, depth=depth)


def _followed(
    path: LoadingPath,
    block: Block,
    solid: Solid | SmallStrainSolid,
    *,
    guesses: Sequence[Guess],
    progress: Callable[[str], None] | None,
) -> list[Equilibrium]:
    """The path's targets on a solid that is prepared."""
    units = Units.of(path.cover)
    contact = SurfaceContact(
        solid.elements,
        1.0,
        block.obstacle.with_load_scale(path.load_scale),
        penalty=PENALTY / block.size,
        multiple=block.multiple,
        friction=path.friction,
    )
    problem = Problem(
        solid=solid,
        contact=contact,
        fixed=held(units.scale_cover(path.cover), solid.elements, block),
        units=units,
        load_scale=path.load_scale,
        overlap=_OVERLAP_ALONG if path.friction else _OVERLAP,
    )
    aims = [units.scale_target(value, path.control) for value in path.scaled_targets]
    return problem.follow(aims, control=path.control, first=0.02 * path.load_scale, guesses=guesses, progress=progress)
