"""Cracks, seams and loose parts of surfaces of triangles, as programs export them face by face."""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.solids.triangles import cluster, list_near_pairs, merge_corners

#: Width of a crack along the border that is closed, over the size of the surface [-].
_CRACK = 1e-4
#: Distance of two edges of the border that makes them a seam: over the size of the surface, and over their length [-].
_SEAM, _BESIDE = 1e-3, 0.1
#: Largest cosine between the directions of two edges of a seam, which run against each other [-].
_AGAINST = -0.7
#: Extent of corners that are merged, over the width of a crack: corners that are denser along a border stay [-].
_CHAIN = 4.0
#: Number of edges of seams after which the search ends: the surface is refused anyway [-].
_ENOUGH = 1000


def close_cracks(triangles: FloatArray) -> FloatArray:
    """Merge corners on the border of a surface that are nearer than a ten thousandth of its size.

    Faces that were exported one by one differ there by the rounding of their coordinates.

    Args:
        triangles: Corners of each triangle, shape (n, 3, 3) [m].

    Returns:
        The triangles without those that collapse, shape (m, 3, 3) [m].
    """
    points, faces = merge_corners(triangles)
    border = np.unique(_list_border(faces)[:, :2])
    if not len(border):
        return triangles
    size = float(np.ptp(points, axis=0).max())
    label = cluster(points[border], _CRACK * size)
    goal = border[np.unique(label, return_index=True)[1]][label]
    near = np.linalg.norm(points[goal] - points[border], axis=1) <= _CHAIN * _CRACK * size
    place = np.arange(len(points))
    place[border[near]] = goal[near]
    kept = (place[faces] != np.roll(place[faces], 1, axis=1)).all(axis=1)
    return np.asarray(points[place[faces[kept]]])


def refuse_seams(points: FloatArray, faces: IntArray, name: str) -> None:
    """Refuse a surface of which two parts of the border lie along each other: they were meant to be one edge.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        name: Name of the surface in messages.

    Raises:
        ValueError: If there is a seam, with its place.
    """
    number, gap, place = _find_seams(points, _list_border(faces))
    if number:
        least = "at least " if number >= _ENOUGH else ""
        raise ValueError(
            f"{name} has a seam: {least}{number} edges of its border lie within {1e3 * gap:.2g} mm of another part of "
            f"the border, as at ({describe(place)}) mm; join the faces there before the export"
        )


def _find_seams(points: FloatArray, border: IntArray) -> tuple[int, float, FloatArray]:
    """Return the number of edges of seams, the largest distance between two of them [m] and its place [m].

    Args:
        points: Positions of the points, shape (p, 3) [m].
        border: Points of each edge of the border and the third point of its triangle, shape (k, 3).
    """
    edges = border[:, :2]
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    square = np.maximum(_dot(along, along), 1e-300)
    length = np.sqrt(square)
    inward = points[border[:, 2]] - start
    inward -= (_dot(inward, along) / square)[:, None] * along
    close = _SEAM * float(np.ptp(points, axis=0).max())
    reach = np.maximum(close, _BESIDE * length)[:, None] / 2
    ends = np.stack([start, start + along])
    found, gap, place = set[int](), 0.0, np.zeros(3)
    for pairs in list_near_pairs(ends.min(axis=0) - reach, ends.max(axis=0) + reach):
        one, other = np.concatenate([pairs, pairs[::-1]], axis=1)
        against = _dot(along[one], along[other]) <= _AGAINST * length[one] * length[other]
        apart = (edges[one][:, :, None] != edges[other][:, None, :]).all(axis=(1, 2))
        one, other = one[against & apart], other[against & apart]
        away = start[one] + along[one] / 2 - start[other]
        away -= np.clip(_dot(away, along[other]) / square[other], 0.0, 1.0)[:, None] * along[other]
        distance = np.linalg.norm(away, axis=1)
        # The surface lies between the borders of a narrow strip: the other one is beyond the triangle at this edge.
        across = -_dot(away, inward[one]) > _dot(inward[one], inward[one]) / 2
        beside = ~across & (distance <= _BESIDE * np.minimum(length[one], length[other]))
        near = beside | (distance <= close)
        if near.any():
            found |= set(one[near].tolist())
            worst = np.argmax(np.where(near, distance, -1.0))
            if distance[worst] >= gap:
                gap, place = float(distance[worst]), start[one[worst]] + along[one[worst]] / 2
        if len(found) >= _ENOUGH:
            break
    return len(found), gap, place


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
        lowest = label[faces].min(axis=1, keepdims=True)
        np.minimum.at(label, before[faces], lowest)  # whole parts at once, so that long rows of points take few rounds
        np.minimum.at(label, faces, lowest)
        label = label[label]
        if (label == before).all():
            return label


def describe(place: FloatArray | tuple[float, ...]) -> str:
    """Write a position in millimetres."""
    return ", ".join(f"{round(1e3 * each, 2) + 0.0:g}" for each in place)


def _list_border(faces: IntArray) -> IntArray:
    """List the directed edges of one triangle only, and its third point, shape (k, 3)."""
    edges = np.concatenate([np.roll(faces, -k, axis=1) for k in range(3)])
    _, place, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(edges[count[place.ravel()] == 1])


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Compute the scalar products of k pairs of vectors, shape (k,)."""
    return np.asarray(np.einsum("kc,kc->k", one, other))
