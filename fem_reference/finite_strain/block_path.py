"""Finite-strain pressing of any shape, in three dimensions.

A wide cover is alike everywhere, so its mesh lies in the indenter's frame, and poses need no new solve.  A shape that
mirrors in x or in y is solved on the half or the quarter that is enough, without being asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fem_reference.elements.grading import grade_contact, layer_heights
from fem_reference.elements.line import Line, gauss_points, recover_pressure
from fem_reference.elements.scaling import Units
from fem_reference.elements.taylor_hood import MixedElements, mesh_layers, prepare_elements
from fem_reference.finite_strain.contact import Rigid
from fem_reference.finite_strain.indenter_surface import Obstacle
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.newton import Equilibrium
from meshes import Cover, FlatPunch

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

    def with_load_scale(self, load_scale: float) -> Rigid:
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
    mirrored = path.indenter.mirror_symmetry
    unit = Units.of(path.cover).length
    fillet, reach, *halves = (value / unit for value in (fillet, reach, *contact_half))
    size = min(1.0, 2 * min(halves)) / elements_per_thickness
    fine = _FINE * fillet if isinstance(path.indenter, FlatPunch) else 0.5 * size
    most = 1.2 * size
    if isinstance(path.indenter, FlatPunch) and not _rectangular(path.indenter, path.indenter.footprint):
        fine = most = max(min(size, _EVEN * fillet), _finest(halves, mirrored) / elements_per_thickness)
    sides = [grade_contact(half, reach, fine=fine, most=most) for half in halves]
    return Block(
        sides=[x if mirror else np.concatenate([-x[:0:-1], x]) for x, mirror in zip(sides, mirrored, strict=True)],
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


def _rectangular(shape: FlatPunch, footprint: tuple[float, float]) -> bool:
    """Whether a face fills the rectangle around it, so that its outline lies on the lines of a mesh."""
    half = np.array(footprint)
    corners = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    filled = abs(float(shape.signed_distance(np.zeros(1), np.zeros(1))[0]) - half.min()) < _ON_LINE * half.min()
    return filled and bool((np.abs(shape.signed_distance(*corners.T)) < _ON_LINE * half.min()).all())


#: Distance over the half width that counts as none [-].
_ON_LINE = 1e-6


def meshed(block: Block, cover: Cover, elements_per_thickness: int) -> MixedElements:
    """The block's elements, each in the region of its layer; lengths in thicknesses."""
    counts = [max(2, round(layer.thickness * elements_per_thickness)) for layer in cover.layers]
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=block.size)
    mesh, region = mesh_layers(block.sides, heights, layer)
    return prepare_elements(mesh, region=region)


def held(cover: Cover, elements: MixedElements, block: Block) -> npt.NDArray[np.int64]:
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


def solid_state(elements: MixedElements, units: Units, reached: Equilibrium, block: Block) -> SolidState:
    """A converged target in SI units, mirrored halves included; given in thicknesses and shear moduli."""
    x, y, z = elements.nodes.T
    base = np.flatnonzero(z < 1e-9 * z.max())
    # Positions on one line of the mesh differ by rounding, so they must be rounded before they are sorted.
    placed = np.round(np.stack([x[base], y[base]]), 12)
    base = base[np.lexsort((placed[1], placed[0]))]
    lines = [np.unique(place) for place in placed]
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


def _pressure(nodes: list[FloatArray], forces: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    """Base pressure at the two Gauss points of each edge of a face, from the reactions of its nodes.

    The error of the recovered pressure oscillates within an edge and vanishes at these points.
    """
    lines = [Line(edges=each[::2], order=2) for each in nodes]
    value = recover_pressure(lines, forces)
    points = [gauss_points(line.edges, 2)[0] for line in lines]
    return points, lines[0].at(points[0]) @ value @ lines[1].at(points[1]).T
