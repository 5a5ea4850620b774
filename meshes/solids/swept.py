"""Covers swept from a surface of quadrilaterals: base surfaces, meshes of hexahedra, and covers of even thickness.

In the frame of the array y runs along the axis of a finger, and z out of the pad at its middle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from meshes.array import TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.solids.facets import node_normals
from meshes.solids.solid_mesh import SolidMesh
from meshes.solids.texels import cylinder_texels, fingertip_texels
from meshes.surfaces.triangles import cluster

#: Number of layers of elements through a cover unless one is given [-].
LAYERS = 4
#: Half of the angle that a face of the cubed sphere spans [rad].  The angle is divided evenly into elements.
_FACE = np.pi / 4
#: Advice at the end of error messages about a mesh of too many elements.
_COARSER = "take a thicker cover or a larger element size"


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of the meshes of swept covers."""

    #: Distance below which points are equal, over the size of the surface [-]; above the rounding at borders of grids.
    #: It is also the tolerance of a number of elements, for rounding.
    same: float = 1e-7
    #: Largest number of quadrilaterals of a surface [-].  The memory of a workstation does not suffice for more.
    most_quads: int = 20_000
    #: Largest number of quadrilaterals along an edge [-].  Checked before memory is allocated.
    most_along: int = 1000
    #: Smallest accepted number of layers of elements [-]; a single layer is too stiff (it locks).
    least_layers: int = 2
    #: Height of the elements at base and top over that in the middle of a cover of many layers [-]; chosen by
    #: judgement.
    grading: float = 0.5
    #: Element size along the base over the thickness, unless one is given [-]; chosen by judgement.
    element_size: float = 0.5
    #: Element size over the thickness, and number of layers, of each of three meshes for an error estimate [-].  They
    #: were chosen by the coverage of the estimates.
    meshes: tuple[tuple[float, int], ...] = ((0.48, 3), (0.38, 3), (0.3, 4))


_NUMBERS = _Numbers()


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseSurface:
    """Surface of q quadrilaterals with 9 nodes each (quadratic), and its unit normals out of the base.

    Attributes:
        points: Positions of the p points, shape (p, 3) [m].
        normals: Unit normals at the points, shape (p, 3) [-].
        quads: Indices of the points of each quadrilateral in lexicographic order, counterclockwise as seen from
            outside, shape (q, 9).
        source: Origin of the surface, in words.
        settings: Settings of the surface.
    """

    points: FloatArray
    normals: FloatArray
    quads: IntArray
    source: str
    settings: Mapping[str, float] = field(default_factory=dict)


def flat_surface(size: tuple[float, float], element_size: float) -> BaseSurface:
    """Make a rectangle in the plane z = 0 around the origin.

    Args:
        size: Edge lengths along x and y [m].
        element_size: Largest edge length of a quadrilateral [m].
    """
    x, y = (np.linspace(-edge / 2, edge / 2, 2 * _count(edge, element_size) + 1) for edge in size)
    points = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1)
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    settings = {"width": size[0], "length": size[1], "element_size": element_size}
    return join_grids([(points, up)], "flat pad", settings)


def cylinder_surface(radius: float, angle: float, length: float, element_size: float) -> BaseSurface:
    """Make a segment of a cylinder about the y axis; z points out of the middle of the segment.

    Args:
        radius: Radius of the base [m].
        angle: Opening angle of the segment, less than 360 degrees [rad].
        length: Length along y, around y = 0 [m].
        element_size: Largest edge length of a quadrilateral [m].
    """
    turn = np.linspace(-angle / 2, angle / 2, 2 * _count(radius * angle, element_size) + 1)
    y = np.linspace(-length / 2, length / 2, 2 * _count(length, element_size) + 1)
    settings = {"radius": radius, "angle": angle, "length": length, "element_size": element_size}
    return join_grids([_roll(turn, y, radius)], "cylinder segment", settings)


def fingertip_surface(radius: float, length: float, element_size: float) -> BaseSurface:
    """Make the front half of a finger: half a cylinder from y = -length to 0 with a quarter sphere at its end y > 0.

    The sphere is meshed by the faces of a cube, projected onto it with even angles (cubed sphere; Ronchi, Iacono and
    Paolucci 1996).  All points have z >= 0.  The pole of the sphere is at (0, radius, 0).

    Args:
        radius: Radius of cylinder and sphere [m].
        length: Length of the cylinder [m].
        element_size: Largest edge length of a quadrilateral [m].
    """
    half = _count(radius * _FACE, element_size)
    even, part = np.linspace(-_FACE, _FACE, 4 * half + 1), np.linspace(0.0, _FACE, 2 * half + 1)
    faces = []
    # Four faces of the cube, whose normals are +y, +z, +x and -x.  The three numbers are the axes of the face's first
    # and second coordinate and of its normal; -1 stands for -x.
    for axes, u, v in (
        ((0, 2, 1), even, part),
        ((0, 1, 2), even, part),
        ((2, 1, 0), part, part),
        ((2, 1, -1), part, part),
    ):
        first, second = np.meshgrid(np.tan(u), np.tan(v))
        out = np.empty((*first.shape, 3))
        out[..., axes[0]], out[..., axes[1]] = first, second
        out[..., max(axes[2], 0)] = 1.0 if axes[2] >= 0 else -1.0
        out /= np.linalg.norm(out, axis=-1, keepdims=True)
        faces.append((radius * out, out))
    turn = np.linspace(-np.pi / 2, np.pi / 2, 8 * half + 1)
    y = np.linspace(-length, 0.0, 2 * _count(length, element_size) + 1)
    settings = {"radius": radius, "length": length, "element_size": element_size}
    return join_grids([_roll(turn, y, radius), *faces], "fingertip", settings)


def join_grids(
    grids: Sequence[tuple[FloatArray, FloatArray | None]], source: str, settings: Mapping[str, float] | None = None
) -> BaseSurface:
    """Join grids of points, which share the points on their common borders, to one surface.

    Args:
        grids: Points of each grid, shape (r, c, 3) with odd r and c [m], and unit normals out of the base, shape (r, c,
            3) [-].  Without normals (None) they are computed from the points; the second direction of the grid is then
            counterclockwise of the first.
        source: Origin of the surface, in words.
        settings: Settings of the surface.

    Raises:
        ValueError: If a grid has an even number of rows or columns, or there are too many quadrilaterals.
    """
    count = sum((place.shape[0] // 2) * (place.shape[1] // 2) for place, _ in grids)
    if count > _NUMBERS.most_quads:
        raise ValueError(f"{source}: {count} quadrilaterals, more than {_NUMBERS.most_quads}: {_COARSER}")
    points, normals, quads, start = [], [], [], 0
    for place, given in grids:
        rows, columns = place.shape[:2]
        if rows % 2 == 0 or columns % 2 == 0 or min(rows, columns) < 3:  # noqa: PLR2004
            raise ValueError(f"a grid of 9-node quadrilaterals needs odd numbers of points, not {rows} x {columns}")
        index = np.arange(rows * columns).reshape(rows, columns)
        corner = index[:-2:2, :-2:2].reshape(-1, 1)
        each = corner + (np.arange(3)[:, None] * columns + np.arange(3)).reshape(1, 9)
        flat = place.reshape(-1, 3)
        own = node_normals(flat, each)[1]
        outward = own if given is None else given.reshape(-1, 3)
        inverted = np.einsum("qc,qc->q", own[each[:, 4]], outward[each[:, 4]]) < 0
        each[inverted] = each[inverted].reshape(-1, 3, 3).transpose(0, 2, 1).reshape(-1, 9)
        points.append(flat)
        normals.append(outward)
        quads.append(each + start)
        start += len(flat)
    return _merge_points(np.concatenate(points), np.concatenate(normals), np.concatenate(quads), source, settings or {})


def _merge_points(
    points: FloatArray, normals: FloatArray, quads: IntArray, source: str, settings: Mapping[str, float]
) -> BaseSurface:
    """Merge equal points of a surface; a merged point keeps the position and normal of its first copy."""
    label = cluster(points, _NUMBERS.same * float(np.ptp(points, axis=0).max()))
    _, first, place = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")  # The merged points are in the order in which they first occur.
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return BaseSurface(
        points=np.ascontiguousarray(points[first[order]]),
        normals=np.ascontiguousarray(normals[first[order]]),
        quads=rank[place.ravel()][quads],
        source=source,
        settings=settings,
    )


def _roll(turn: FloatArray, y: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return points and normals of a cylinder about y at angles from z towards x, shape (len(y), len(turn), 3)."""
    angle, along = np.meshgrid(turn, y)
    normals = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
    return radius * normals + along[..., None] * [0.0, 1.0, 0.0], normals


def _count(length: float, element_size: float) -> int:
    """Return the number of elements, of at most a given size, that fill a length.

    Raises:
        ValueError: If the number is too large for a mesh.
    """
    count = length / element_size
    if not count <= _NUMBERS.most_along:
        raise ValueError(
            f"elements of {1e3 * element_size:.3g} mm divide an edge of {1e3 * length:.4g} mm into more than "
            f"{_NUMBERS.most_along}: {_COARSER}"
        )
    return max(1, int(np.ceil(count - _NUMBERS.same)))


def sweep(
    surface: BaseSurface,
    thickness: npt.ArrayLike,
    *,
    layers: int = LAYERS,
    inward: bool = False,
    interfaces: Sequence[float] = (),
) -> SolidMesh:
    """Make the mesh of a cover between a base surface and the surface at a distance along its normals.

    The same input gives the same mesh bit by bit.  The nodes on the base are those of the surface.

    Args:
        surface: Base of the cover; its outer surface if `inward`.
        thickness: Thickness of the cover, one number or one per point of the surface, shape (p,) [m].
        layers: Number of layers of elements, which are thinner towards base and top [-].  With interfaces it is that
            through the whole thickness, but each material has at least two layers, and at least `layers` - 1.
        inward: Whether the surface is the outer surface; the base then lies below it.
        interfaces: Heights of the interfaces between materials, over the thickness, ascending [-].

    Raises:
        ValueError: If a thickness is not positive or there are too few layers.
    """
    height = np.broadcast_to(np.asarray(thickness, dtype=float), len(surface.points))
    if not (np.isfinite(height) & (height > 0)).all():
        raise ValueError(f"the thickness must be positive everywhere, not {height.min():.4g} m")
    if layers < _NUMBERS.least_layers:
        raise ValueError(f"a cover needs at least {_NUMBERS.least_layers} layers of elements, not {layers}")
    step = height[:, None] * surface.normals
    base = surface.points - step if inward else surface.points
    levels = grade_heights(layers, interfaces)
    layers = len(levels) - 1
    levels = np.sort(np.concatenate([levels, (levels[1:] + levels[:-1]) / 2]))
    nodes = base + levels[:, None, None] * step
    if inward:
        nodes[-1] = surface.points
    count, quads = len(base), surface.quads
    up = np.arange(3)[:, None] * count
    first = 2 * count * np.arange(layers)[:, None, None, None]
    cells = first + quads[None, :, None, :] + up
    sides = first + _border_edges(quads)[None, :, None, :] + up
    settings = {**surface.settings, "layers": layers, "inward": inward}
    if np.ptp(height) == 0:
        settings["thickness"] = float(height[0])
    return SolidMesh(
        nodes=nodes.reshape(-1, 3),
        cells=cells.reshape(-1, 27),
        base=quads.copy(),
        top=np.concatenate([quads + 2 * layers * count, sides.reshape(-1, 9)]),
        left_out=np.zeros((0, 9), dtype=np.int64),
        source=surface.source,
        settings=settings,
    )


def grade_heights(layers: int, interfaces: Sequence[float] = ()) -> FloatArray:
    """Return the heights of the element edges over the thickness, from 0 to 1, shape (e + 1,); see `sweep` [-]."""
    edges, ends = [np.zeros(1)], [0.0, *interfaces, 1.0]
    if not (np.diff(ends) > 0).all():
        raise ValueError(f"interfaces must ascend between 0 and 1, not {list(interfaces)}")
    for low, high in pairwise(ends):
        # Every layer has more elements on a finer mesh, so that the estimate of the error sees all of them.
        count = max(round(layers * (high - low)), layers - 1 if interfaces else layers, _NUMBERS.least_layers)
        size = _NUMBERS.grading + (1 - _NUMBERS.grading) * np.sin(np.pi * (np.arange(count) + 0.5) / count)
        edges.append(low + (high - low) * np.cumsum(size) / size.sum())
        edges[-1][-1] = high
    return np.concatenate(edges)


def _border_edges(quads: IntArray) -> IntArray:
    """List the edges that belong to one quadrilateral only, counterclockwise, as indices of 3 points, shape (s, 3)."""
    edges = quads[:, [[0, 1, 2], [2, 5, 8], [8, 7, 6], [6, 3, 0]]].reshape(-1, 3)
    _, place, count = np.unique(edges[:, 1], return_inverse=True, return_counts=True)
    return np.asarray(edges[count[place] == 1])


@dataclass(frozen=True, kw_only=True)
class SweptCover:
    """Cover of even thickness on a base surface that is meshed with any element size, with free sides.

    Attributes:
        texels: Texels on the base.
        thickness: Thickness of the cover, along the normals of the base [m].
        surface: Function that meshes the base surface with a largest element size [m].
        interfaces: Heights of the interfaces between materials, over the thickness, ascending [-].
    """

    texels: TexelArray
    thickness: float
    surface: Callable[[float], BaseSurface]
    interfaces: tuple[float, ...] = ()

    def divide(self, thicknesses: Sequence[float]) -> SweptCover:
        """Return the cover with layers of other thicknesses, from base to top [m]."""
        heights = np.cumsum(thicknesses)
        return replace(self, thickness=float(heights[-1]), interfaces=tuple((heights[:-1] / heights[-1]).tolist()))

    def mesh(self, element_size: float | None = None, *, layers: int = LAYERS) -> SolidMesh:
        """Mesh the cover by hexahedra.

        Args:
            element_size: Largest edge length along the base; half the thickness if None [m].
            layers: Number of layers of elements through the thickness [-].
        """
        size = _NUMBERS.element_size * self.thickness if element_size is None else element_size
        return sweep(self.surface(size), self.thickness, layers=layers, interfaces=self.interfaces)

    def meshes(self, size: float = 1.0) -> tuple[SolidMesh, SolidMesh, SolidMesh]:
        """Make three meshes from coarse to fine, with 3, 3 and 4 layers, from which errors are estimated.

        Args:
            size: Factor on the element sizes along the base [-].
        """
        coarse, middle, fine = (
            self.mesh(size * step * self.thickness, layers=layers) for step, layers in _NUMBERS.meshes
        )
        return coarse, middle, fine


def flat_pad(
    *, size: tuple[float, float] = (20e-3, 20e-3), thickness: float = 2e-3, rows: int = 5, pitch: float = 3.4e-3
) -> SweptCover:
    """Make a flat pad with free sides and a square array in its middle.

    Args:
        size: Edge lengths along x and y [m].
        thickness: Thickness [m].
        rows: Number of rows and of columns [-].
        pitch: Pitch of the texels, which touch one another [m].
    """
    texels = TexelArray.grid(rows, rows, pitch, name="flat-pad")
    return SweptCover(texels=texels, thickness=thickness, surface=partial(flat_surface, size))


def phalanx(
    *,
    radius: float = 6e-3,
    angle: float = float(np.radians(120)),
    length: float = 20e-3,
    thickness: float = 2e-3,
    rows: int = 8,
    columns: int = 5,
    pitch: float = 2.2e-3,
) -> SweptCover:
    """Make a segment of a cylinder about y, as on the middle of a finger, with square texels.

    Args:
        radius: Radius of the base [m].
        angle: Opening angle [rad].
        length: Length along y [m].
        thickness: Thickness [m].
        rows: Number of texels along y [-].
        columns: Number of texels around [-].
        pitch: Pitch of the texels; their edge length is 0.9 of it [m].
    """
    texels = cylinder_texels(
        radius, rows=rows, columns=columns, pitch=(pitch, pitch), size=(0.9 * pitch, 0.9 * pitch), name="phalanx"
    )
    surface = partial(cylinder_surface, radius, angle, length)
    return SweptCover(texels=texels, thickness=thickness, surface=surface)


def fingertip(
    *, radius: float = 6e-3, length: float = 14.4e-3, thickness: float = 2e-3, pitch: float = 2.35e-3
) -> SweptCover:
    """Make the front half of a fingertip: half a cylinder about y that ends in a quarter sphere; 66 texels by default.

    Args:
        radius: Radius of the base [m].
        length: Length of the cylinder, from y = -length to 0 [m].
        thickness: Thickness [m].
        pitch: Wanted pitch of the texels; their edge length is 0.85 of it [m].
    """
    texels = fingertip_texels(radius, length, pitch=pitch, size=0.85 * pitch, name="fingertip")
    return SweptCover(texels=texels, thickness=thickness, surface=partial(fingertip_surface, radius, length))
