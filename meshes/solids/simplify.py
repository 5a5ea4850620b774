"""Collapse short edges of a surface of triangles, so that its offset does not fold at slivers and small steps."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Most passes over all edges [-].
_PASSES = 30
#: Smallest cosine by which a collapse may turn a triangle [-].
_TURNED = 0.3
#: Height over the longest side of a triangle below which a collapse must not bring it [-].
_SLIVER = 0.1


def collapse_short_edges(points: FloatArray, faces: IntArray, length: float) -> tuple[FloatArray, IntArray]:
    """Collapse edges below a length to one of their ends, while the surface stays a surface.

    A point on the border stays; the border keeps its points.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        length: Edges below this length are collapsed [m].

    Returns:
        Points and triangles that remain.
    """
    faces = faces.copy()
    for _ in range(_PASSES):
        edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
        keys, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        size = np.linalg.norm(points[keys[:, 0]] - points[keys[:, 1]], axis=1)
        border = set(keys[count == 1].ravel().tolist())
        around: dict[int, list[int]] = defaultdict(list)
        for number, face in enumerate(faces.tolist()):
            for point in face:
                around[point].append(number)
        locked: set[int] = set()
        removed: set[int] = set()
        for index in np.argsort(size, kind="stable"):
            if size[index] >= length:
                break
            removed |= _collapse(points, faces, around, keys[index].tolist(), (border, locked))
        if not removed:
            break
        faces = np.delete(faces, sorted(removed), axis=0)
    used, place = np.unique(faces, return_inverse=True)
    return points[used], place.reshape(-1, 3)


def _collapse(
    points: FloatArray, faces: IntArray, around: dict[int, list[int]], edge: list[int], kept: tuple[set[int], set[int]]
) -> set[int]:
    """Collapse one edge if possible; returns the triangles that vanish, and changes `faces` in place."""
    border, locked = kept
    gone, stays = edge if edge[1] in border else edge[::-1]
    if gone in border or gone in locked or stays in locked:
        return set()
    mine, others = around[gone], around[stays]
    shared = set(mine) & set(others)
    near = [{int(point) for face in each for point in faces[face]} for each in (mine, others)]
    if len((near[0] & near[1]) - {gone, stays}) != len(shared):
        return set()
    moving = [face for face in mine if face not in shared]
    before = faces[moving]
    after = np.where(before == gone, stays, before)
    one, other = (np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in (points[before], points[after]))
    product = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    # Slivers say nothing about the direction of the surface; only larger triangles must not turn.
    if (np.einsum("fc,fc->f", one, other) < _TURNED * product)[np.linalg.norm(one, axis=1) > 0.1 * _largest(one)].any():
        return set()
    shape = [_shapes(points[each]).min(initial=1.0) for each in (before, after)]
    if shape[1] < min(_SLIVER, shape[0]):
        return set()
    faces[moving] = after
    locked |= near[0] | near[1]
    return shared


def _shapes(triangles: FloatArray) -> FloatArray:
    """Return the height over the longest side of triangles, shape (n,) [-]."""
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    return np.asarray(area / np.maximum(sides**2, np.finfo(float).tiny))


def _largest(vectors: FloatArray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
