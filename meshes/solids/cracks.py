"""Cracks, seams and loose parts of surfaces of triangles, as programs export them face by face."""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.solids.triangles import cluster, merge_corners

#: Width of a crack along the border that is closed, over the size of the surface [-].
_CRACK = 1e-4
#: Distance of two edges of the border that makes them a seam: over the size of the surface, and over their length [-].
_SEAM, _BESIDE = 1e-3, 0.1
#: Largest cosine between the directions of two edges of a seam, which run against each other [-].
_AGAINST = -0.7
#: Number of pairs of edges that are compared at once, to limit the memory [-].
_PAIRS = 2_000_000


def close_cracks(triangles: FloatArray) -> FloatArray:
    """Merge corners on the border of a surface that are nearer than a ten thousandth of its size.

    Faces that were exported one by one differ there by the rounding of their coordinates.

    Args:
        triangles: Corners of each triangle, shape (n, 3, 3) [m].

    Returns:
        The triangles without those that collapse, shape (m, 3, 3) [m].
    """
    points, faces = merge_corners(triangles)
    border = np.unique(_list_border(faces))
    if not len(border):
        return triangles
    size = float(np.ptp(points, axis=0).max())
    label = cluster(points[border], _CRACK * size)
    first = np.unique(label, return_index=True)[1]
    points[border] = points[border[first]][label]
    place = np.arange(len(points))
    place[border] = border[first][label]
    kept = (place[faces] != np.roll(place[faces], 1, axis=1)).all(axis=1)
    return np.asarray(points[faces[kept]])


def refuse_seams(points: FloatArray, faces: IntArray, name: str) -> None:
    """Refuse a surface of which two parts of the border lie along each other: they were meant to be one edge.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        name: Name of the surface in messages.

    Raises:
        ValueError: If there is a seam, with its place.
    """
    edges = _list_border(faces)
    size = float(np.ptp(points, axis=0).max())
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    middle = start + along / 2
    found, gap, place = 0, 0.0, np.zeros(3)
    for first in range(0, len(edges), block := max(1, _PAIRS // max(1, len(edges)))):
        part = slice(first, first + block)
        away = middle[part, None] - start
        share = np.clip((away * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
        distance = np.linalg.norm(away - share[..., None] * along, axis=2)
        against = along[part] @ along.T <= _AGAINST * length[part, None] * length
        apart = (edges[part, None, :, None] != edges[:, None, :]).all(axis=(2, 3))
        near = distance <= np.maximum(_SEAM * size, _BESIDE * np.minimum(length[part, None], length))
        row, column = np.nonzero(against & apart & near)
        if len(row):
            found += len(np.unique(row))
            worst = np.argmax(distance[row, column])
            if distance[row[worst], column[worst]] >= gap:
                gap, place = float(distance[row[worst], column[worst]]), middle[first + row[worst]]
    if found:
        raise ValueError(
            f"{name} has a seam: {found} edges of its border lie within {1e3 * gap:.2g} mm of another part of the "
            f"border, as at ({describe(place)}) mm; join the faces there before the export"
        )


def refuse_parts(points: FloatArray, faces: IntArray, name: str) -> None:
    """Refuse a surface of several parts that share no point: one of them was exported by mistake.

    Raises:
        ValueError: If there are several parts, with the place of the smallest.
    """
    part = label_parts(len(points), faces)[faces[:, 0]]
    corner = points[faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    labels = np.unique(part)
    if len(labels) > 1:
        each = np.bincount(part, area)[labels]
        middle = corner[part == labels[np.argmin(each)]].mean(axis=(0, 1))
        raise ValueError(
            f"{name} consists of {len(labels)} parts that do not hang together, the smallest with "
            f"{100 * each.min() / each.sum():.2g} % of the area near ({describe(middle)}) mm; export the touched "
            "surface alone, and one file for each cover"
        )


def describe_borders(points: FloatArray, border: IntArray, name: str) -> tuple[str, ...]:
    """State in a sentence that a surface has several borders, and where the smallest is; nothing if it has one.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        border: Points of each edge of the border, shape (k, 2).
        name: Name of the surface.
    """
    loop = label_parts(len(points), border)[border[:, 0]] if len(border) else border
    loops = [points[border[loop == each, 0]] for each in np.unique(loop)]
    if len(loops) <= 1:
        return ()
    width, middle = min((float(np.ptp(each, axis=0).max()), tuple(each.mean(axis=0))) for each in loops)
    sentence = (
        f"{name} has {len(loops)} borders, the smallest {1e3 * width:.3g} mm wide around ({describe(middle)}) mm; the "
        "cover ends at each of them with free sides: fill holes that are not meant"
    )
    return (sentence,)


def label_parts(count: int, faces: IntArray) -> IntArray:
    """Label points by the lowest point to which triangles or edges connect them, shape (count,).

    Args:
        count: Number of points [-].
        faces: Points of each triangle or edge, shape (f, k).
    """
    label = np.arange(count)
    while True:
        before = label.copy()
        np.minimum.at(label, faces, label[faces].min(axis=1, keepdims=True))
        label = label[label]
        if (label == before).all():
            return label


def describe(place: FloatArray | tuple[float, ...]) -> str:
    """Write a position in millimetres."""
    return ", ".join(f"{round(1e3 * each, 2) + 0.0:g}" for each in place)


def _list_border(faces: IntArray) -> IntArray:
    """List the directed edges of one triangle only, shape (k, 2)."""
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    _, place, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(edges[count[place.ravel()] == 1])
