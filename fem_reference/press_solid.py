"""Finite-strain pressing of any shape, in three dimensions.

A wide cover is alike everywhere, so its mesh lies in the indenter's frame, and poses need no new solve.  A shape that
mirrors in x or in y is solved on the half or the quarter that is enough, without being asked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
import skfem

from fem_reference.axisymmetric import edge_shape, layer_heights
from fem_reference.elements import MixedElements, mixed_elements
from fem_reference.equilibrium import Equilibrium, Problem
from fem_reference.finite_strain import Solid
from fem_reference.obstacle import Obstacle
from fem_reference.press_axisymmetric import PENALTY
from fem_reference.surface_contact import Rigid, SurfaceContact
from fem_reference.transfer import Coarse
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
    obstacle: Rigid
    free: bool = False


def mirrors(indenter: Indenter) -> tuple[bool, bool]:
    """Whether the shape is its own mirror image in the planes x = 0 and y = 0."""
    half = indenter.footprint
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 61), np.linspace(-half[1], half[1], 61))
    gap = np.nan_to_num(indenter.gap(x, y), posinf=-1.0)
    scale = 1e-9 + 1e-6 * max(half)
    return bool(np.abs(gap - gap[:, ::-1]).max() < scale), bool(np.abs(gap - gap[::-1]).max() < scale)


def press_solid(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    *,
    control: str,
    elements_per_thickness: int,
    contact_half: tuple[float, float],
    fillet: float,
    reach: float,
    steepness: float = 1.0,
    friction: float = 0.0,
    coarse: Coarse | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[SolidState], Coarse]:
    """Follow one loading path; return the state at every target, and the path for a finer mesh to start from.

    Args:
        cover: Layers; a small-strain material counts as neo-Hookean with the same moduli.
        indenter: Any shape with a gap.
        targets: Loads [N] or depths [m], ascending.
        control: "load" or "depth".
        elements_per_thickness: Elements through the cover [-].
        contact_half: Half widths of the largest contact; the mesh is fine up to them [m].
        fillet: Radius of the rounding of sharp edges [m].
        reach: Distance from the contact to the outer boundary [m].
        steepness: Factor on the indenter's heights, see `Obstacle` [-].
        friction: Coefficient of Coulomb's law, inf for no slip; such a path is walked in small steps [-].
        coarse: The same path on a coarser mesh, to start from.
        progress: Called with a line of text after each step.

    Raises:
        PathError: If the path stops early.
    """
    mirrored = mirrors(indenter)
    unit = Units.of(cover).length
    fillet, reach, *halves = (value / unit for value in (fillet, reach, *contact_half))
    size = min(1.0, 2 * min(halves)) / elements_per_thickness
    fine = 2.4 * fillet / elements_per_thickness if isinstance(indenter, Flat) else 0.5 * size
    block = Block(
        sides=[_side(half, (fine, size), reach, mirror=m) for half, m in zip(halves, mirrored, strict=True)],
        mirrored=mirrored,
        size=size,
        obstacle=Obstacle(indenter=indenter, fillet=fillet, unit=unit, steepness=steepness),
    )
    return follow_block(
        cover,
        block,
        targets,
        control=control,
        elements_per_thickness=elements_per_thickness,
        steepness=steepness,
        friction=friction,
        coarse=coarse,
        progress=progress,
    )


def follow_block(
    cover: Cover,
    block: Block,
    targets: Sequence[float],
    *,
    control: str,
    elements_per_thickness: int,
    steepness: float = 1.0,
    friction: float = 0.0,
    coarse: Coarse | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[SolidState], Coarse]:
    """`press_solid` on a block that is laid out already.

    Args:
        cover: As for `press_solid`.
        block: What is meshed.
        targets: As for `press_solid`.
        control: As for `press_solid`.
        elements_per_thickness: As for `press_solid` [-].
        steepness: As for `press_solid` [-].
        friction: As for `press_solid` [-].
        coarse: As for `press_solid`.
        progress: As for `press_solid`.

    Raises:
        PathError: As for `press_solid`.
    """
    units = Units.of(cover)
    thin = units.thin(cover)
    counts = [max(2, round(layer.thickness * elements_per_thickness)) for layer in thin.layers]
    heights, region = layer_heights(thin, counts, top=block.size)
    mesh = skfem.MeshHex.init_tensor(*block.sides, heights)
    row = np.searchsorted(heights, mesh.p[2][mesh.t].mean(axis=0)) - 1
    elements = mixed_elements(mesh, region=region[row])
    multiple = float((1 + block.mirrored[0]) * (1 + block.mirrored[1]))
    problem = Problem(
        solid=Solid.of_cover(elements, cover, units),
        contact=SurfaceContact(
            elements, 1.0, block.obstacle, penalty=PENALTY / block.size, multiple=multiple, friction=friction
        ),
        fixed=_held(thin, elements, block),
        units=units,
    )
    aims = [units.target(value, control) for value in targets]
    guesses = () if coarse is None or friction else coarse.guesses(elements)
    path = problem.follow(aims, control=control, first=0.02 * steepness, guesses=guesses, progress=progress)
    states = [_state(elements, units, reached, block.mirrored, multiple) for reached in path]
    return states, Coarse(elements=elements, path=path)


def _side(half: float, steps: tuple[float, float], reach: float, *, mirror: bool) -> FloatArray:
    """Nodes along one side: coarser in the middle of the contact, fine at its edge, growing outside [m]."""
    fine, coarse = steps
    inner, step = [half], fine
    while inner[-1] > 0.6 * step:
        inner.append(inner[-1] - step)
        step = min(step * 1.5, 1.2 * coarse)
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


def _state(
    elements: MixedElements, units: Units, reached: Equilibrium, mirrored: tuple[bool, bool], multiple: float
) -> SolidState:
    x, y, z = elements.nodes.T
    base = np.flatnonzero(z < 1e-9 * z.max())
    base = base[np.lexsort((y[base], x[base]))]
    lines = [np.unique(np.round(place[base], 12)) for place in (x, y)]
    forces = reached.reaction[3 * base + 2].reshape(len(lines[0]), len(lines[1]))
    points, pressure = _pressure(lines, forces)
    for axis in range(2):
        if mirrored[axis]:
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
        reaction=float(forces.sum()) * multiple * units.force,
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
