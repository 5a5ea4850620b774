"""Closed surfaces of triangles: checks before they are meshed, and nearest points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray

#: Distance between corners that are the same, over the size of the surface [-].
_SAME = 1e-7
#: Volume over the cube of the size below which a surface encloses nothing [-].
_FLAT = 1e-9
#: Height of a triangle over its longest side below which it is a line [-].
_THINNEST = 1e-10
#: Number of pairs of points or triangles that are compared at once, to limit the memory [-].
_PAIRS = 2_000_000


def check_closed(triangles: FloatArray, name: str, *, crossings: bool = True) -> None:
    """Check that triangles form a closed surface, oriented outwards, that does not intersect itself.

    Args:
        triangles: Corners of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
        name: Name of the surface in messages.
        crossings: Whether intersections are looked for.

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
    crossed = count_crossings(triangles) if crossings else 0
    if crossed:
        raise ValueError(f"{name} intersects itself in {crossed} pairs of triangles; repair it")


def merge_corners(triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Merge equal corners; returns points, shape (p, 3) [m], and the points of each triangle, shape (n, 3)."""
    flat = triangles.reshape(-1, 3)
    place = cluster(flat, _SAME * float(np.ptp(flat, axis=0).max()))
    first = np.unique(place, return_index=True)[1]
    return flat[first], place.reshape(-1, 3)


def cluster(points: FloatArray, distance: float) -> IntArray:
    """Number the clusters of points in which each coordinate has no gap wider than a distance [m], shape (p,).

    The distance is far below that of other points, so that clusters are single places.
    """
    label, count = np.zeros(len(points), dtype=np.int64), 0
    while True:  # a cut along one axis may open gaps along another
        for values in points.T:
            order = np.lexsort((values, label))
            apart = (np.diff(label[order]) != 0) | (np.diff(values[order]) > distance)
            label[order] = np.concatenate([[0], np.cumsum(apart)])
        if label.max(initial=0) == count:
            return label
        count = int(label.max())


def enclosed_volume(triangles: FloatArray) -> float:
    """Compute the volume that closed triangles enclose, negative if they face inwards [m3]."""
    corners = triangles - triangles.mean(axis=(0, 1))
    return float(np.linalg.det(corners).sum() / 6)


def count_crossings(triangles: FloatArray) -> int:
    """Count the pairs of triangles without a common corner of which an edge of one crosses the other."""
    return len(find_crossings(triangles))


def find_crossings(triangles: FloatArray) -> set[tuple[int, int]]:
    """Find the pairs of triangles without a common corner of which an edge of one crosses the other."""
    faces = merge_corners(triangles)[1]
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    crossing: set[tuple[int, int]] = set()
    for near in list_near_pairs(low, high):
        apart = (faces[near[0]][:, :, None] != faces[near[1]][:, None, :]).all(axis=(1, 2))
        one, other = near[0][apart], near[1][apart]
        hit = _edges_cross(triangles[one], triangles[other]) | _edges_cross(triangles[other], triangles[one])
        crossing |= {(int(min(pair)), int(max(pair))) for pair in zip(one[hit], other[hit], strict=True)}
    return crossing


def list_near_pairs(low: FloatArray, high: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """List the pairs of n boxes that overlap, in blocks: those that overlap along the axis where the fewest do.

    Args:
        low: Lower ends of the boxes, shape (n, 3) [m].
        high: Upper ends, shape (n, 3) [m].
    """
    orders = np.argsort(low, axis=0, kind="stable")
    ends = [np.searchsorted(low[order, k], high[order, k], side="right") for k, order in enumerate(orders.T)]
    axis = int(np.argmin([end.sum() for end in ends]))
    order, following = orders[:, axis], ends[axis] - np.arange(len(low)) - 1
    steps = np.concatenate([[0], np.cumsum(following)])
    start = 0
    while start < len(low):
        stop = max(start + 1, int(np.searchsorted(steps, steps[start] + _PAIRS, side="right")) - 1)
        count = following[start:stop]
        first = np.repeat(np.arange(start, stop), count)
        second = first + 1 + np.arange(count.sum()) - np.repeat(steps[start:stop] - steps[start], count)
        one, other = order[first], order[second]
        near = (low[one] <= high[other]).all(axis=1) & (high[one] >= low[other]).all(axis=1)
        yield one[near], other[near]
        start = stop


def nearest_points(points: FloatArray, triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Find the nearest points of triangles.

    Args:
        points: k points, shape (k, 3) [m].
        triangles: Corners of n triangles, shape (n, 3, 3) [m].

    Returns:
        Nearest points, shape (k, 3) [m], and the indices of their triangles, shape (k,).
    """
    out, owner = np.empty_like(points), np.empty(len(points), dtype=np.int64)
    middle = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
    block = max(1, _PAIRS // (2 * len(triangles)))
    for start in range(0, len(points), block):
        part = points[start : start + block]
        # The distance to the nearest middle is an upper bound; triangles that are farther away cannot be nearest.
        away = np.linalg.norm(part[:, None] - middle, axis=2)
        point, triangle = np.nonzero(away - radius <= away.min(axis=1)[:, None])
        candidate = _nearest_of_each(part[point], triangles[triangle])
        square = ((candidate - part[point]) ** 2).sum(axis=1)
        order = np.lexsort((triangle, square, point))
        best = order[np.searchsorted(point[order], np.arange(len(part)))]
        out[start : start + block], owner[start : start + block] = candidate[best], triangle[best]
    return out, owner


def _nearest_of_each(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return the nearest point of one triangle to one point, for k pairs of both, shape (k, 3)."""
    along = np.roll(triangles, -1, axis=1) - triangles
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    away = points[:, None] - triangles
    share = np.clip((away * along).sum(axis=-1) / square, 0.0, 1.0)
    sides = triangles + share[..., None] * along
    best = np.argmin(((sides - points[:, None]) ** 2).sum(axis=-1), axis=1)
    side = sides[np.arange(len(points)), best]
    normal = np.cross(along[:, 0], along[:, 1])
    double_area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(double_area, 1e-300)[:, None]
    plane = points - (away[:, 0] * normal).sum(axis=-1)[:, None] * normal
    inside = ((np.cross(along, plane[:, None] - triangles) * normal[:, None]).sum(axis=-1) >= 0).all(axis=-1)
    inside &= double_area > _THINNEST * square.max(axis=1)  # a line has no normal
    return np.asarray(np.where(inside[:, None], plane, side))


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
