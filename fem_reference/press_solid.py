"""Finite-strain pressing of any shape, in three dimensions.

A wide cover is alike everywhere, so its mesh lies in the indenter's frame, and poses need no new solve.  A shape that
mirrors in x or in y is solved on the half or the quarter that is enough, without being asked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import scipy.linalg
import skfem

from fem_reference.axisymmetric import edge_shape, layer_heights
from fem_reference.elements import MixedElements, mixed_elements
from fem_reference.equilibrium import Equilibrium, Guess, Problem
from fem_reference.finite_strain import SmallStrainSolid, Solid
from fem_reference.loading_path import LoadingPath
from fem_reference.obstacle import Obstacle
from fem_reference.press_axisymmetric import PENALTY
from fem_reference.surface_contact import Rigid, SurfaceContact
from fem_reference.transfer import transferred
from fem_reference.units import Units
from meshes import Cover, Indenter
from meshes.indenter import Flat

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidState:
    """One converged target of a loading path.

    Attributes:
        depth: Approach from first touch [m].
        load: Force of the whole indenter [N].
        area: Reference area that touches, of the whole [m2].
        overlap: Mean distance that the penalty left between the surfaces [m].
        x: Positions of the base pressure along x, ascending, mirrored halves included, shape (m,) [m].
        y: Positions along y, shape (n,) [m].
        pressure: Base pressure, shape (m, n) [Pa].
        reaction: Sum of the base reactions, of the whole [N].
        lines: Positions of the meshed base's nodes along x and along y [m].
        forces: Base reactions on them, a value for each pair [N].
    """

    depth: float
    load: float
    area: float
    overlap: float
    x: FloatArray
    y: FloatArray
    pressure: FloatArray
    reaction: float
    lines: tuple[FloatArray, FloatArray]
    forces: FloatArray


class Steepened(Protocol):
    """What comes down on a block, and can do so with all its heights scaled."""

    def with_steepness(self, steepness: float) -> Rigid:
        """The same with that factor on its heights [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """The part of a cover that is meshed, lengths in thicknesses.

    Attributes:
        sides: Nodes along x and along y, ascending.
        mirrored: Whether the planes x = 0 and y = 0 are planes of symmetry, from which `sides` start.
        size: Size of the elements under the contact.
        obstacle: What comes down on it.
        free: Whether the side faces are free; else nothing moves there.
    """

    sides: list[FloatArray]
    mirrored: tuple[bool, bool]
    size: float
    obstacle: Steepened
    free: bool = False

    @property
    def multiple(self) -> float:
        """Whole force over the force on the meshed part [-]."""
        return float((1 + self.mirrored[0]) * (1 + self.mirrored[1]))


def mirrors(indenter: Indenter) -> tuple[bool, bool]:
    """Whether the shape is its own mirror image in the planes x = 0 and y = 0."""
    half = indenter.footprint
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 61), np.linspace(-half[1], half[1], 61))
    # a face's gap jumps on its outline, where rounding tells what is inside; the distance from it does not
    gap = indenter.inside(x, y) if isinstance(indenter, Flat) else np.nan_to_num(indenter.gap(x, y), posinf=-1.0)
    scale = 1e-9 + 1e-6 * max(half)
    return bool(np.abs(gap - gap[:, ::-1]).max() < scale), bool(np.abs(gap - gap[::-1]).max() < scale)


def lay_out(
    path: LoadingPath, *, elements_per_thickness: int, contact_half: tuple[float, float], fillet: float, reach: float
) -> Block:
    """The block under a shape on a wide cover.

    Args:
        path: What is pressed.
        elements_per_thickness: Elements through the cover [-].
        contact_half: Half widths of the largest contact; the mesh is fine up to them [m].
        fillet: Radius of the rounding of sharp edges [m].
        reach: Distance from the contact to the outer boundary [m].
    """
    mirrored = mirrors(path.indenter)
    unit = Units.of(path.cover).length
    fillet, reach, *halves = (value / unit for value in (fillet, reach, *contact_half))
    size = min(1.0, 2 * min(halves)) / elements_per_thickness
    fine = _FINE * fillet if isinstance(path.indenter, Flat) else 0.5 * size
    most = 1.2 * size
    if isinstance(path.indenter, Flat) and not _rectangular(path.indenter, path.indenter.footprint):
        fine = most = max(min(size, _EVEN * fillet), _finest(halves, mirrored) / elements_per_thickness)
    return Block(
        sides=[_side(half, (fine, most), reach, mirror=m) for half, m in zip(halves, mirrored, strict=True)],
        mirrored=mirrored,
        size=size,
        obstacle=Obstacle(indenter=path.indenter, fillet=fillet, unit=unit),
    )


#: Elements over the radius of a rounded edge, across the edge where it lies on the mesh's lines and where it may be
#: anywhere [-].
_FINE, _EVEN = 0.6, 1.3


def _finest(halves: Sequence[float], mirrored: tuple[bool, bool]) -> float:
    """Element size times the elements per thickness below which a mesh would outgrow the machine."""
    return max(half / (_MOST if mirror else _MOST / 2) for half, mirror in zip(halves, mirrored, strict=True))


#: Elements along half a footprint, for each element through the cover, at most [-].
_MOST = 6


def _rectangular(shape: Flat, footprint: tuple[float, float]) -> bool:
    """Whether a face fills the rectangle around it, so that its outline lies on the lines of a mesh."""
    half = np.array(footprint)
    corners = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    filled = abs(float(shape.inside(np.zeros(1), np.zeros(1))[0]) - half.min()) < _ON_LINE * half.min()
    return filled and bool((np.abs(shape.inside(*corners.T)) < _ON_LINE * half.min()).all())


#: Distance over the half width that counts as none [-].
_ON_LINE = 1e-6


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
        for rest, deep in zip(_pressed(self.rest), _pressed(self.deep), strict=True):
            change = deep.state - self.ratio * rest.state
            state = transferred(self.elements, target, change)
            out.append(Guess(state=state, depth=deep.depth - self.ratio * rest.depth))
        return out


def _pressed(path: Sequence[Equilibrium]) -> list[Equilibrium]:
    """A path's targets before the overlap was worked off, as each of them is first solved."""
    return [each.pressed or each for each in path]


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
    elements = _meshed(block, units.thin(path.cover), elements_per_thickness)
    solid = Solid.of_cover(elements, path.cover, units)
    at_rest = path.at_rest
    undeformed = np.zeros(elements.displacements + elements.pressures)
    guesses = [Guess(state=undeformed, depth=at_rest.steepness * depth / units.length) for depth in approaches]
    linear = solid.at_rest
    tell = None if progress is None else lambda text: progress(f"small strain, {text}")
    rest = _followed(at_rest, block, linear, guesses=guesses, progress=tell)
    small = path.steepness == at_rest.steepness
    starts = [] if path.friction else _starts(path, block, rest, elements, before)  # slip depends on the way
    deep = _followed(path, block, linear if small else solid, guesses=starts, progress=progress)
    states = [[_state(elements, units, each, block) for each in reached] for reached in (rest, deep)]
    return states[0], states[1], Pair(elements=elements, rest=rest, deep=deep, ratio=_ratio(path))


def _ratio(path: LoadingPath) -> float:
    """A path's steepness over that of its small-strain twin [-]."""
    return path.steepness / path.at_rest.steepness


def _starts(
    path: LoadingPath, block: Block, rest: Sequence[Equilibrium], elements: MixedElements, before: Pair | None
) -> list[Guess]:
    """The small-strain targets, scaled, with what the coarser grid added to its own."""
    ratio = _ratio(path)
    scaled = [Guess(state=ratio * each.state, depth=ratio * each.depth) for each in _pressed(rest)]
    nothing = Guess(state=np.zeros_like(rest[0].state), depth=0.0)
    changes = [nothing] * len(rest) if before is None else before.changes(elements)
    obstacle = block.obstacle.with_steepness(path.steepness)
    return [_changed(*each, elements, obstacle) for each in zip(scaled, changes, strict=True)]


def _changed(still: Guess, change: Guess, elements: MixedElements, obstacle: Rigid) -> Guess:
    """A change added to a solution whose points touched the obstacle where they were before they moved sideways.

    Points that touched lie on it again where they have moved to: under a penalty a false overlap is a large force.
    """
    state, depth = still.state + change.state, still.depth + change.depth
    top = np.flatnonzero(elements.nodes[:, 2] > 1 - _ON_LINE)
    x, y, _ = elements.nodes[top].T
    gap = obstacle.at(x, y).value - still.depth - still.state[3 * top + 2]
    there = gap < _SHUT * still.depth
    top, gap = top[there], gap[there]
    moved = elements.nodes[top, :2] + np.column_stack([state[3 * top], state[3 * top + 1]])
    state[3 * top + 2] = obstacle.at(*moved.T).value - depth - gap
    return Guess(state=state, depth=depth)


#: Gap over the depth that counts as none [-].
_SHUT = 0.01


def _meshed(block: Block, cover: Cover, elements_per_thickness: int) -> MixedElements:
    """The block's elements, each in the region of its layer; lengths in thicknesses."""
    counts = [max(2, round(layer.thickness * elements_per_thickness)) for layer in cover.layers]
    heights, region = layer_heights(cover, counts, top=block.size)
    mesh = skfem.MeshHex.init_tensor(*block.sides, heights)
    row = np.searchsorted(heights, mesh.p[2][mesh.t].mean(axis=0)) - 1
    return mixed_elements(mesh, region=region[row])


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
        block.obstacle.with_steepness(path.steepness),
        penalty=PENALTY / block.size,
        multiple=block.multiple,
        friction=path.friction,
    )
    problem = Problem(
        solid=solid,
        contact=contact,
        fixed=_held(units.thin(path.cover), solid.elements, block),
        units=units,
        steepness=path.steepness,
        overlap=_OVERLAP,
    )
    aims = [units.target(value, path.control) for value in path.scaled]
    return problem.follow(aims, control=path.control, first=0.02 * path.steepness, guesses=guesses, progress=progress)


#: Overlap over the depth that is left alike by the path at small strain and by the one asked for: only what they differ
#: in counts [-].
_OVERLAP = 2e-3


def _side(half: float, steps: tuple[float, float], reach: float, *, mirror: bool) -> FloatArray:
    """Nodes along one side: up to `most` apart in the middle of the contact, fine at its edge, growing outside [m]."""
    fine, most = steps
    inner, step = [half], fine
    while inner[-1] > 0.6 * step:
        inner.append(inner[-1] - step)
        step = min(step * 1.5, most)
    inside = np.array(inner[::-1])
    inside = (inside - inside[0]) / (half - inside[0]) * half  # the last node falls on the axis
    outer, step = [half], fine
    while outer[-1] < half + reach:
        outer.append(outer[-1] + step)
        step *= 1.5
    positive = np.concatenate([inside, outer[1:]])
    return positive if mirror else np.concatenate([-positive[:0:-1], positive])


def _held(cover: Cover, elements: MixedElements, block: Block) -> npt.NDArray[np.int64]:
    """The base, the outer boundary unless it is free, and the planes of symmetry along their normals."""
    x, y, z = elements.nodes.T
    tolerance = 1e-9
    base = z < tolerance
    outer = np.zeros_like(base)
    for place, side, mirror in zip((x, y), block.sides, block.mirrored, strict=True):
        if block.free:
            continue
        outer |= place > side[-1] - tolerance
        if not mirror:
            outer |= place < side[0] + tolerance
    across = outer | (base if cover.base == "bonded" else np.zeros_like(base))
    planes = [(np.abs(place) < tolerance) & mirror for place, mirror in zip((x, y), block.mirrored, strict=True)]
    components = [across | planes[0], across | planes[1], base | outer]
    return np.concatenate([3 * np.flatnonzero(nodes) + i for i, nodes in enumerate(components)])


def _state(elements: MixedElements, units: Units, reached: Equilibrium, block: Block) -> SolidState:
    x, y, z = elements.nodes.T
    base = np.flatnonzero(z < 1e-9 * z.max())
    base = base[np.lexsort((y[base], x[base]))]
    lines = [np.unique(np.round(place[base], 12)) for place in (x, y)]
    forces = reached.reaction[3 * base + 2].reshape(len(lines[0]), len(lines[1]))
    points, pressure = _pressure(lines, forces)
    for axis in range(2):
        if block.mirrored[axis]:
            points[axis] = np.concatenate([-points[axis][::-1], points[axis]])
            pressure = np.concatenate([np.flip(pressure, axis), pressure], axis)
    return SolidState(
        depth=reached.depth * units.length,
        load=reached.load * units.force,
        area=reached.touch.area * units.length**2,
        overlap=reached.touch.overlap * units.length,
        x=points[0] * units.length,
        y=points[1] * units.length,
        pressure=pressure * units.stress,
        reaction=float(forces.sum()) * block.multiple * units.force,
        lines=(lines[0] * units.length, lines[1] * units.length),
        forces=forces * units.force,
    )


def _pressure(lines: list[FloatArray], forces: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    """Base pressure at the Gauss points of each face from nodal reactions.

    The mass of biquadratic faces on a tensor grid is a product of two line masses, so two small banded solves divide
    the reactions by it; at the two Gauss points of each edge its oscillation vanishes, as in the axisymmetric solve.
    """
    value = forces
    points = []
    for axis, nodes in enumerate(lines):
        value = np.moveaxis(scipy.linalg.solve(_line_mass(nodes), np.moveaxis(value, axis, 0), assume_a="pos"), 0, axis)
        read, place = _gauss_reader(nodes)
        value = np.moveaxis(np.tensordot(read, value, axes=(1, axis)), 0, axis)
        points.append(place)
    return points, value


def _line_mass(nodes: FloatArray) -> FloatArray:
    """Mass of quadratic edges, dense, shape (m, m) [m]."""
    points, weights = np.polynomial.legendre.leggauss(3)
    shape = edge_shape((points + 1) / 2)
    out = np.zeros((len(nodes), len(nodes)))
    for e in range(0, len(nodes) - 2, 2):
        out[e : e + 3, e : e + 3] += (shape * weights / 2) @ shape.T * (nodes[e + 2] - nodes[e])
    return out


def _gauss_reader(nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrix from nodal values to values at two Gauss points per edge, and where they are [m]."""
    t = (1 + np.array([-1, 1]) / np.sqrt(3)) / 2
    shape = edge_shape(t)
    edges = range(0, len(nodes) - 2, 2)
    out = np.zeros((2 * len(edges), len(nodes)))
    for row, e in enumerate(edges):
        out[2 * row : 2 * row + 2, e : e + 3] = shape.T
    place = np.concatenate([nodes[e] + t * (nodes[e + 2] - nodes[e]) for e in edges])
    return out, place
