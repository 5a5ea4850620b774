"""Blocks of hexahedra under an indenter of any shape: layout, mesh, constraints and base pressure.

A wide cover is the same everywhere, so its block lies in the indenter's frame and one solution serves all poses.  If
the indenter is symmetric in x or y, only the half or quarter on the positive side is meshed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.elements.grading import grade_contact, layer_heights
from fem_reference.elements.line import Line, gauss_points, recover_pressure
from fem_reference.elements.taylor_hood import MixedElements, mesh_layers, prepare_elements
from fem_reference.finite_strain.contact_problem import ContactEquilibrium
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from meshes import Cover, FlatPunch
from meshes.array_types import FloatArray, IntArray

#: Ascending positions along x, shape (m,), and y, shape (n,) [m], and base pressure on their grid, shape (m, n) [Pa].
BasePressure = tuple[FloatArray, FloatArray, FloatArray]

#: Element size over the radius of a rounded edge: across an edge that lies on mesh lines, and everywhere under a face
#: whose edge does not [-].
_ON_LINE_ELEMENT, _OFF_LINE_ELEMENT = 0.6, 1.3
#: Element size over the one that the elements through the cover give: at the edge of the contact under a curved shape,
#: and largest size in the contact [-].
_EDGE_ELEMENT, _LARGEST_ELEMENT = 0.5, 1.2
#: Largest number of equal elements along half a footprint, for each element through the cover.  More would need more
#: memory than common machines have [-].
_MOST_ELEMENTS = 6
#: Least number of elements in each layer.
_LAYER_ELEMENTS = 2
#: Distance over the smaller half width below which a point lies on an outline [-].
_ON_OUTLINE = 1e-6
#: Distance from a boundary below which a node lies on it, in thicknesses [-].
_ON_BOUNDARY = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockState:
    """The solution at one target of a path on a block.

    Attributes:
        depth: Approach from first touch [m].
        load: Force of the whole indenter [N].
        area: Reference area of the whole contact [m2].
        overlap: Mean penetration that the penalty leaves [m].
        lines: Positions of the base nodes of the meshed part along x, shape (m,), and y, shape (n,) [m].
        forces: Base reactions at these nodes, shape (m, n) [N].
        symmetric: Whether x = 0 and y = 0 are planes of symmetry, beyond which nothing is meshed.
    """

    depth: float
    load: float
    area: float
    overlap: float
    lines: tuple[FloatArray, FloatArray]
    forces: FloatArray
    symmetric: tuple[bool, bool]


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """The part of a cover that is meshed, in units of its thickness.

    Attributes:
        sides: Element edges along x and along y, ascending.
        symmetric: Whether x = 0 and y = 0 are planes of symmetry, at which `sides` start.
        size: Element size under the contact.
        surface: Surface of the indenter.
        free: Whether the side faces are free; otherwise nothing moves there.
    """

    sides: Sequence[FloatArray]
    symmetric: tuple[bool, bool]
    size: float
    surface: IndenterSurface
    free: bool = False

    @property
    def multiple(self) -> float:
        """Force on the whole cover over the force on the meshed part [-]."""
        return float((1 + self.symmetric[0]) * (1 + self.symmetric[1]))


def lay_out_block(
    path: LoadingPath, *, elements_per_thickness: int, contact_half: tuple[float, float], fillet: float, reach: float
) -> Block:
    """Lay out the block under a shape on a wide cover.

    Args:
        path: Cover, indenter and targets.
        elements_per_thickness: Elements through the cover [-].
        contact_half: Half widths of the largest contact, in which elements are small [m].
        fillet: Radius of rounded edges [m].
        reach: Distance from the contact to the outer boundary [m].
    """
    indenter = path.indenter
    symmetric = indenter.mirror_symmetry
    unit = path.units.length
    fillet, reach, *halves = (value / unit for value in (fillet, reach, *contact_half))
    size = min(1.0, 2 * min(halves)) / elements_per_thickness
    fine = _ON_LINE_ELEMENT * fillet if isinstance(indenter, FlatPunch) else _EDGE_ELEMENT * size
    most = _LARGEST_ELEMENT * size
    if isinstance(indenter, FlatPunch) and not _is_rectangular(indenter):
        finest = max(half / (1 if mirror else 0.5) for half, mirror in zip(halves, symmetric, strict=True))
        finest /= _MOST_ELEMENTS * elements_per_thickness
        fine = most = max(min(size, _OFF_LINE_ELEMENT * fillet), finest)
    sides = [grade_contact(half, reach, fine=fine, most=most) for half in halves]
    return Block(
        sides=[x if mirror else np.concatenate([-x[:0:-1], x]) for x, mirror in zip(sides, symmetric, strict=True)],
        symmetric=symmetric,
        size=size,
        surface=IndenterSurface(indenter=indenter, fillet=fillet, unit=unit),
    )


def mesh_block(block: Block, cover: Cover, elements_per_thickness: int) -> MixedElements:
    """Mesh a block of the cover with hexahedra; the region number of an element is the index of its layer.

    Args:
        block: Extent of the block and element sizes along x and y.
        cover: The layers; all lengths are divided by the thickness of the cover.
        elements_per_thickness: Number of elements through the cover; each layer gets at least two [-].
    """
    counts = [max(_LAYER_ELEMENTS, round(layer.thickness * elements_per_thickness)) for layer in cover.layers]
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=block.size)
    mesh, region = mesh_layers(block.sides, heights, layer)
    return prepare_elements(mesh, region=region)


def find_constrained(block: Block, elements: MixedElements, *, bonded: bool) -> IntArray:
    """Return the constrained displacements of a meshed block.

    These are the base (all components if bonded, else the normal one), the outer boundary unless it is free, and the
    normal components on planes of symmetry.
    """
    x, y, z = elements.nodes.T
    base = z < _ON_BOUNDARY
    outer = np.zeros_like(base)
    planes = []
    for position, side, mirror in zip((x, y), block.sides, block.symmetric, strict=True):
        planes.append((np.abs(position) < _ON_BOUNDARY) & mirror)
        if not block.free:
            outer |= position > side[-1] - _ON_BOUNDARY
            outer |= (position < side[0] + _ON_BOUNDARY) & (not mirror)
    across = outer | (base & bonded)
    components = [across | planes[0], across | planes[1], base | outer]
    return np.concatenate([3 * np.flatnonzero(nodes) + i for i, nodes in enumerate(components)])


def describe_state(elements: MixedElements, units: Units, reached: ContactEquilibrium, block: Block) -> BlockState:
    """Return a converged target in SI units."""
    x, y, z = elements.nodes.T
    base = np.flatnonzero(z < _ON_BOUNDARY)
    # Nodes lie on the element edges and midway between them.  Nodes on one mesh line differ by rounding; each belongs
    # to the nearest line.
    lines = [np.interp(np.arange(2 * len(side) - 1) / 2, np.arange(len(side)), side) for side in block.sides]
    forces = np.zeros((len(lines[0]), len(lines[1])))
    nearest = [
        np.searchsorted((line[1:] + line[:-1]) / 2, each[base]) for line, each in zip(lines, (x, y), strict=True)
    ]
    forces[nearest[0], nearest[1]] = reached.reaction[3 * base + 2]
    return BlockState(
        depth=reached.depth * units.length,
        load=reached.load * units.force,
        area=reached.contact.area * units.length**2,
        overlap=reached.contact.overlap * units.length,
        lines=(lines[0] * units.length, lines[1] * units.length),
        forces=forces * units.force,
        symmetric=block.symmetric,
    )


def recover_nodal_pressure(state: BlockState) -> BasePressure:
    """Return the base pressure at the nodes of the base: the biquadratic one whose nodal forces are the reactions."""
    return _unfold(list(state.lines), recover_pressure(_make_lines(state), state.forces), state.symmetric)


def recover_gauss_pressure(state: BlockState) -> BasePressure:
    """Return the base pressure at the two Gauss points of each edge.

    The error of the recovered pressure oscillates within an edge and vanishes at these points.
    """
    lines = _make_lines(state)
    points = [gauss_points(line.edges, 2)[0] for line in lines]
    pressure = recover_pressure(lines, state.forces)
    return _unfold(points, lines[0].at(points[0]) @ pressure @ lines[1].at(points[1]).T, state.symmetric)


def _make_lines(state: BlockState) -> list[Line]:
    return [Line(edges=nodes[::2], order=2) for nodes in state.lines]


def _unfold(lines: list[FloatArray], values: FloatArray, symmetric: tuple[bool, bool]) -> BasePressure:
    """Add the mirror image of values on a grid; positions on a plane of symmetry are not repeated."""
    for axis in range(2):
        if symmetric[axis]:
            first = int(lines[axis][0] == 0)
            image = np.flip(np.delete(values, slice(first), axis), axis)
            lines[axis] = np.concatenate([-lines[axis][first:][::-1], lines[axis]])
            values = np.concatenate([image, values], axis)
    return lines[0], lines[1], values


def _is_rectangular(shape: FlatPunch) -> bool:
    """Return whether a face fills the rectangle around it, so that its outline lies on mesh lines."""
    half = np.array(shape.footprint)
    corners = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    filled = abs(float(shape.signed_distance(np.zeros(1), np.zeros(1))[0]) - half.min()) < _ON_OUTLINE * half.min()
    return filled and bool((np.abs(shape.signed_distance(*corners.T)) < _ON_OUTLINE * half.min()).all())
