"""Closed surfaces of triangles: checks before they are meshed, and nearest points."""

from __future__ import annotations

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray

#: Distance between corners that are the same, over the size of the surface [-].
_SAME = 1e-7
#: Volume over the cube of the size below which a surface encloses nothing [-].
_FLAT = 1e-9
#: Number of pairs of points or triangles that are compared at once, to limit the memory [-].
_PAIRS = 2_000_000


def check_closed(triangles: FloatArray, name: str) -> None:
    """Check that triangles form a closed surface, oriented outwards, that does not intersect itself.

    Args:
        triangles: Corners of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
        name: Name of the surface in messages.

    Raises:
        ValueError: With one line that says what is wrong.
    """
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3) or not len(triangles):  # noqa: PLR2004
        raise ValueError(f"{name} needs triangles of shape (n, 3, 3)")
    if not np.isfinite(triangles).all():
        raise ValueError(f"{name} has a corner that is no number; export it again")
    faces = merge_corners(triangles)[1]
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    _, place, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    open_edges, crowded = int((count == 1).sum()), int((count > 2).sum())  # noqa: PLR2004
    if open_edges or crowded:
        what = f"{open_edges} open edges" if open_edges else f"{crowded} edges with more than two triangles"
        raise ValueError(f"{name} is not closed: it has {what}; close it in the program that made it")
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    if np.bincount(place.ravel(), sign).any():
        raise ValueError(f"{name} has triangles that face different ways; recompute its normals outwards")
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    volume = enclosed_volume(triangles)
    if abs(volume) < _FLAT * size**3:
        raise ValueError(f"{name} encloses no volume; export a solid")
    if volume < 0:
        raise ValueError(f"{name} is inside out: its triangles face inwards; reverse its normals")
    crossings = count_crossings(triangles)
    if crossings:
        raise ValueError(f"{name} intersects itself in {crossings} pairs of triangles; repair it")


def merge_corners(triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Merge equal corners; returns points, shape (p, 3) [m], and the points of each triangle, shape (n, 3)."""
    flat = triangles.reshape(-1, 3)
    cell = _SAME * float(np.ptp(flat, axis=0).max())
    rounded = np.floor((flat - flat.min(axis=0)) / cell + 0.3127).astype(np.int64)
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return flat[first], place.reshape(-1, 3)


def enclosed_volume(triangles: FloatArray) -> float:
    """Compute the volume that closed triangles enclose, negative if they face inwards [m3]."""
    corners = triangles - triangles.mean(axis=(0, 1))
    return float(np.linalg.det(corners).sum() / 6)


def count_crossings(triangles: FloatArray) -> int:
    """Count the pairs of triangles without a common corner of which an edge of one crosses the other."""
    faces = merge_corners(triangles)[1]
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    block = max(1, _PAIRS // len(triangles))
    crossing: set[tuple[int, int]] = set()
    for start in range(0, len(triangles), block):
        part = slice(start, start + block)
        near = (low[part, None] <= high).all(axis=2) & (high[part, None] >= low).all(axis=2)
        one, other = np.nonzero(near)
        one += start
        apart = (faces[one][:, :, None] != faces[other][:, None, :]).all(axis=(1, 2))
        one, other = one[apart], other[apart]
        hit = _edges_cross(triangles[one], triangles[other])
        crossing |= {(int(min(pair)), int(max(pair))) for pair in zip(one[hit], other[hit], strict=True)}
    return len(crossing)


def nearest_points(points: FloatArray, triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Find the nearest points of triangles.

    Args:
        points: k points, shape (k, 3) [m].
        triangles: Corners of n triangles, shape (n, 3, 3) [m].

    Returns:
        Nearest points, shape (k, 3) [m], and the indices of their triangles, shape (k,).
    """
    out, owner = np.empty_like(points), np.empty(len(points), dtype=np.int64)
    block = max(1, _PAIRS // (20 * len(triangles)))
    for start in range(0, len(points), block):
        part = slice(start, min(start + block, len(points)))
        candidates = _candidates(points[part], triangles)
        square = ((candidates - points[part, None, None]) ** 2).sum(axis=-1)
        best = np.argmin(square.reshape(len(square), -1), axis=1)
        out[part] = candidates.reshape(len(square), -1, 3)[np.arange(len(square)), best]
        owner[part] = best // 4
    return out, owner


def _candidates(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return for each point and triangle the nearest points of its three sides and its plane, shape (k, n, 4, 3).

    The point of the plane is replaced by that of a side where it lies outside the triangle.
    """
    start = triangles
    along = np.roll(triangles, -1, axis=1) - triangles
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    away = points[:, None, None] - start
    share = np.clip((away * along).sum(axis=-1) / square, 0.0, 1.0)
    sides = start + share[..., None] * along
    normal = np.cross(along[:, 0], along[:, 1])
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    height = (away[:, :, 0] * normal).sum(axis=-1)
    plane = points[:, None] - height[..., None] * normal
    inside = (np.cross(along, plane[:, :, None] - start) * normal[:, None]).sum(axis=-1) >= 0
    plane = np.where(inside.all(axis=-1)[..., None], plane, sides[:, :, 0])
    return np.concatenate([sides, plane[:, :, None]], axis=2)


def _edges_cross(one: FloatArray, other: FloatArray) -> BoolArray:
    """Return whether an edge of the first of each pair of triangles crosses the inside of the second, shape (k,)."""
    origin, first, second = other[:, 0], other[:, 1] - other[:, 0], other[:, 2] - other[:, 0]
    normal = np.cross(first, second)
    out = np.zeros(len(one), dtype=bool)
    for k in range(3):
        start, end = one[:, k], one[:, (k + 1) % 3]
        before = ((start - origin) * normal).sum(axis=1)
        after = ((end - origin) * normal).sum(axis=1)
        across = before * after < 0
        share = np.where(across, before / np.where(across, before - after, 1.0), 0.0)
        point = start + share[:, None] * (end - start) - origin
        square = np.maximum((normal**2).sum(axis=1), 1e-300)
        u = (np.cross(point, second) * normal).sum(axis=1) / square
        v = (np.cross(first, point) * normal).sum(axis=1) / square
        out |= across & (u > 0) & (v > 0) & (u + v < 1)
    return out
