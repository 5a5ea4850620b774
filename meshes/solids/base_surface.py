"""Surfaces of quadrilaterals from which covers are swept: planes, cylinders, fingertips and surfaces given on a grid.

In the frame of the array y runs along the axis of a finger, and z out of the pad at its middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.solids.facets import node_normals

#: Size of the cells in which points count as equal, over the size of the surface, and offset of the cells, so that
#: coordinates on round numbers do not lie on the border of a cell [-].
_SAME, _OFFSET = 1e-7, 0.3127
#: Largest number of quadrilaterals of a surface, and of those along an edge [-].
_MOST_QUADS, _MOST_ALONG = 20_000, 1000
#: What to do against too many elements.
_COARSER = "take a thicker cover or a larger element size"
#: Half of the face of a cube in the angle that the cubed sphere divides evenly [rad].
_FACE = np.pi / 4


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseSurface:
    """Surface of q quadrilaterals with 9 nodes each (quadratic), and its unit normals out of the base.

    Attributes:
        points: Positions of the p points, shape (p, 3) [m].
        normals: Unit normals at the points, shape (p, 3) [-].
        quads: Indices of the points of each quadrilateral in lexicographic order, counterclockwise as seen from
            outside, shape (q, 9).
        source: Where the surface comes from.
        settings: Numbers that describe it.
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

    The sphere is meshed by the faces of a cube that are projected onto it with even angles (cubed sphere; Ronchi,
    Iacono and Paolucci 1996).  All points have z >= 0; the pole of the sphere is at (0, radius, 0).

    Args:
        radius: Radius of cylinder and sphere [m].
        length: Length of the cylinder [m].
        element_size: Largest edge length of a quadrilateral [m].
    """
    half = _count(radius * _FACE, element_size)
    even, part = np.linspace(-_FACE, _FACE, 4 * half + 1), np.linspace(0.0, _FACE, 2 * half + 1)
    faces = []
    for axes, u, v in (
        ((0, 2, 1), even, part),  # towards +y: the face's coordinates run along x and z
        ((0, 1, 2), even, part),  # towards +z
        ((2, 1, 0), part, part),  # towards +x
        ((2, 1, -1), part, part),  # towards -x
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
        grids: For each grid its points, shape (r, c, 3) with odd r and c [m], and unit normals out of the base, shape
            (r, c, 3); None to compute normals from the points, with the second direction counterclockwise of the first.
        source: Where the surface comes from.
        settings: Numbers that describe it.

    Raises:
        ValueError: If a grid has an even number of rows or columns, or there are too many quadrilaterals.
    """
    count = sum((place.shape[0] // 2) * (place.shape[1] // 2) for place, _ in grids)
    if count > _MOST_QUADS:
        raise ValueError(f"{source}: {count} quadrilaterals, more than {_MOST_QUADS}: {_COARSER}")
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
    cell = _SAME * float(np.ptp(points, axis=0).max())
    rounded = np.floor((points - points.min(axis=0)) / cell + _OFFSET).astype(np.int64)
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")  # points stay in the order of the grids
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
    """Return the number of elements of at most a size that fill a length.

    Raises:
        ValueError: If it is too large for a mesh.
    """
    count = length / element_size
    if not count <= _MOST_ALONG:
        raise ValueError(
            f"elements of {1e3 * element_size:.3g} mm divide an edge of {1e3 * length:.4g} mm into more than "
            f"{_MOST_ALONG}: {_COARSER}"
        )
    return max(1, int(np.ceil(count - _SAME)))
