"""Outlines of flat faces, made of closed polygons: distances of points, checks, and splitting into convex parts.

One polygon bounds a face; further polygons bound holes in the face, or other pieces of the face.  A point is inside the
outline when it lies inside an odd number of polygons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from meshes.array_types import BoolArray, FloatArray

#: A corner (x, y) of a polygon [m].
Corner = tuple[float, float]
#: Corners (x, y) of a closed polygon, in order; a side joins the last corner to the first.
Polygon = Sequence[Corner]


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of computations with outlines.  Lengths are relative to the longer edge of the bounding rectangle."""

    #: Distance below which two points are equal [-].  It is well above rounding in double precision.
    coincident: float = 1e-9
    #: Difference of y below which two corners are equally high [-].  It is above the rounding of single precision in
    #: STL files, 6e-8.
    level: float = 1e-6
    #: Twice the area of the triangle of three neighbouring corners, over the edge squared, below which they lie on a
    #: line [-].  The value is far below that of a regular polygon of 10 000 sides.
    straight: float = 1e-12
    #: Largest number of directions of cuts that are tried to split a face into few convex parts [-].  They are those of
    #: the longest sides.  More directions rarely give fewer parts.
    directions: int = 8
    #: Straight segments of a full circle in the arcs of an inset outline [-]; they deviate by 0.12 % of the radius.
    arc_segments: int = 64


_NUMBERS = _Numbers()


def make_hexagon(across: float) -> list[Corner]:
    """Make the corners of a regular hexagon around the origin, counterclockwise, with two sides parallel to y [m].

    Args:
        across: Distance between opposite sides of the hexagon [m].
    """
    turn = np.pi / 6 + np.arange(6) * np.pi / 3
    return [(float(across / np.sqrt(3) * np.cos(t)), float(across / np.sqrt(3) * np.sin(t))) for t in turn]


def compute_signed_distance(polygons: Sequence[Polygon], x: FloatArray, y: FloatArray) -> FloatArray:
    """Compute the distance of points from the nearest side of an outline, positive inside and negative outside.

    Args:
        polygons: Closed polygons of the outline [m].
        x: x coordinates of the points, any shape [m].
        y: y coordinates of the points, same shape [m].

    Returns:
        Signed distances, same shape [m].
    """
    nearest = np.full(np.broadcast(x, y).shape, np.inf)
    inside = np.zeros(nearest.shape, dtype=bool)
    for (ax, ay), (bx, by) in list_sides(polygons).tolist():
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx**2 + dy**2), 0, 1)
        nearest = np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy))
        # A ray from the point along +x passes between inside and outside at each crossing of a side.
        if dy:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * dx / dy)
    return np.where(inside | (nearest == 0), nearest, -nearest)


def compute_distance_from_inset(polygons: Sequence[Polygon], inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
    """Compute the distance of points from the region that lies deeper inside an outline than an inset.

    Outside a convex corner the distance is measured from a single point, so that its gradient is continuous there.

    Args:
        polygons: Closed polygons of the outline [m].
        inset: Distance from the outline to the region inside it [m].
        x: x coordinates of the points, any shape [m].
        y: y coordinates of the points, same shape [m].

    Returns:
        Distances from the region, zero inside it, same shape [m].

    Raises:
        ValueError: If no point lies deeper inside the outline than the inset.
        ModuleNotFoundError: If manifold3d is not installed.
    """
    shrunk = _shrink(tuple(tuple((float(x), float(y)) for x, y in polygon) for polygon in polygons), inset)
    return np.maximum(-compute_signed_distance(shrunk, x, y), 0.0)


@lru_cache(maxsize=32)
def _shrink(polygons: tuple[tuple[Corner, ...], ...], inset: float) -> list[Polygon]:
    """Return the outline of the region that lies deeper inside polygons than an inset [m].

    Raises:
        ValueError: If no point lies deeper inside than the inset.
    """
    import manifold3d

    # manifold3d rounds coordinates to a grid of fixed spacing.  Coordinates are divided by the inset, so that they are
    # of order one or larger, far above this spacing.
    section = manifold3d.CrossSection([np.array(each) / inset for each in polygons], manifold3d.FillRule.EvenOdd)
    section = section.offset(-1.0, manifold3d.JoinType.Round, circular_segments=_NUMBERS.arc_segments)
    if section.is_empty():
        raise ValueError(f"an inset of {inset:.3g} m leaves nothing of the outline")
    return [polygon * inset for polygon in section.to_polygons()]


def find_inside(polygons: Sequence[Polygon], x: FloatArray, y: FloatArray) -> BoolArray:
    """Find out whether points lie inside or on an outline; much faster than `compute_signed_distance`.

    Args:
        polygons: Closed polygons of the outline [m].
        x: x coordinates of the points, any shape [m].
        y: y coordinates of the points, of a shape that broadcasts with that of `x` [m].

    Returns:
        True for points inside or on the outline, in the broadcast shape.
    """
    x, y = np.broadcast_arrays(x, y)
    flat_x, flat_y = x.ravel(), y.ravel()
    inside, on_side = np.zeros((2, flat_x.size), dtype=bool)
    for (ax, ay), (bx, by) in list_sides(polygons).tolist():
        beside = np.flatnonzero((flat_y >= min(ay, by)) & (flat_y <= max(ay, by)))
        px, py = flat_x[beside], flat_y[beside]
        if by == ay:
            on_side[beside] |= (px >= min(ax, bx)) & (px <= max(ax, bx))
            continue
        side_x = ax + (py - ay) * (bx - ax) / (by - ay)
        on_side[beside] |= px == side_x
        inside[beside] ^= ((ay > py) != (by > py)) & (px < side_x)
    return np.asarray((inside | on_side).reshape(x.shape))


def list_sides(polygons: Sequence[Polygon]) -> FloatArray:
    """Return the first and last point (x, y) of each of the n sides of all polygons, shape (n, 2, 2) [m]."""
    return np.concatenate([np.stack([each, np.roll(each, -1, axis=0)], axis=1) for each in polygons])


def check_polygon(polygon: Polygon) -> None:
    """Check that a polygon is simple; its corners may go clockwise or counterclockwise.

    Raises:
        ValueError: If the polygon has fewer than three corners or two equal corners, encloses no area, or crosses or
            touches itself.
    """
    if len(polygon) < 3:  # noqa: PLR2004 -- a triangle
        raise ValueError(f"a polygon needs three corners or more, not {len(polygon)}")
    corners = np.array(polygon, dtype=float)
    if not np.isfinite(corners).all():
        raise ValueError("a polygon's corners must be numbers")
    size = float(np.ptp(corners, axis=0).max())
    for k, corner in enumerate(corners):
        equal = np.flatnonzero(np.hypot(*(corners[k + 1 :] - corner).T) <= _NUMBERS.coincident * size)
        if len(equal):
            raise ValueError(f"corners {k + 1} and {k + 2 + equal[0]} of the polygon are the same")
    if np.abs(cross(corners[1] - corners[0], corners - corners[0])).max() <= _NUMBERS.coincident * size**2:
        raise ValueError("the polygon's corners lie on one line: it encloses no area")
    meeting = _find_meeting_sides(corners, size)
    if meeting is not None:
        k, other = meeting
        raise ValueError(f"sides {k + 1} and {other + 1} of the polygon meet, so that it is not simple")


def _find_meeting_sides(corners: FloatArray, size: float) -> tuple[int, int] | None:
    """Find two sides of a polygon that share a point other than the corner between neighbouring sides.

    Args:
        corners: Corners of the polygon, shape (n, 2) [m].
        size: Longer edge of the polygon's bounding rectangle [m].

    Returns:
        Indices of the two sides; None if there are none.
    """
    start, end = corners, np.roll(corners, -1, axis=0)
    n = len(corners)
    for k in range(n):
        a, b = start[k], end[k]
        ahead = end[(k + 1) % n] - b
        if abs(cross(b - a, ahead)) <= _NUMBERS.coincident * size**2 and (b - a) @ ahead < 0:
            return k, (k + 1) % n  # The next side of the polygon runs back along this side.
        others = np.arange(k + 2, n if k else n - 1)
        c, d = start[others], end[others]
        from_this = np.stack([cross(b - a, c - a), cross(b - a, d - a)]) / np.hypot(*(b - a))
        from_other = np.stack([cross(d - c, a - c), cross(d - c, b - c)]) / np.hypot(*(d - c).T)
        meets = _are_separated(from_this, size) & _are_separated(from_other, size)
        meets &= (np.maximum(np.minimum(a, b), np.minimum(c, d)) <= np.minimum(np.maximum(a, b), np.maximum(c, d))).all(
            1
        )
        if meets.any():
            return k, int(others[meets.argmax()])
    return None


def _are_separated(distances: FloatArray, size: float) -> BoolArray:
    """Return for n lines and pairs of points whether the line separates the points or goes through one of them.

    Args:
        distances: Signed distances of the two points from the line, shape (2, n) [m].
        size: Length to which the tolerance of rounding is relative [m].
    """
    on_line = np.abs(distances) <= _NUMBERS.coincident * size
    return np.asarray((np.sign(distances[0]) != np.sign(distances[1])) | on_line.any(axis=0))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Compute the cross product a_x b_y - a_y b_x of vectors in the plane, shapes (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def split_into_convex_parts(polygons: Sequence[Polygon]) -> list[FloatArray]:
    """Split a flat face, the set of points inside an odd number of polygons, into convex polygons.

    Parallel lines through all corners cut the face into slabs, which consist of trapezoids.  Trapezoids of neighbouring
    slabs are merged if their union is convex.  Lines parallel to x and to each of the longest sides are tried; the
    direction that gives the fewest parts is taken.

    Args:
        polygons: Simple polygons that do not cross one another [m].

    Returns:
        Corners of each convex part, counterclockwise, shape (k, 2) for k corners [m].
    """
    sides = list_sides(polygons)
    along = sides[:, 1] - sides[:, 0]
    longest = np.argsort(-np.hypot(*along.T), kind="stable")[: _NUMBERS.directions]
    angles = {0.0, *(round(float(np.arctan2(y, x) % np.pi), 9) % round(np.pi, 9) for x, y in along[longest])}
    fewest: list[FloatArray] = []
    for angle in sorted(angles):
        c, s = np.cos(angle), np.sin(angle)
        parts = _split_along_x(sides @ np.array([[c, -s], [s, c]]))
        if not fewest or len(parts) < len(fewest):
            fewest = [part @ np.array([[c, s], [-s, c]]) for part in parts]
    return fewest


def _split_along_x(sides: FloatArray) -> list[FloatArray]:
    """Split the face that n sides enclose into convex polygons, by lines parallel to x through all corners.

    While a part is made, it is a list of rows (left x, right x, y), ordered by ascending y.

    Args:
        sides: First and last point (x, y) of each side, shape (n, 2, 2) [m].

    Returns:
        Corners of each convex part, counterclockwise, shape (k, 2) for k corners [m].
    """
    size = float(np.ptp(sides, axis=(0, 1)).max())
    upward = np.take_along_axis(sides, np.argsort(sides[..., 1], axis=1)[..., None], axis=1)
    open_parts: list[list[FloatArray]] = []
    done: list[list[FloatArray]] = []
    for low, high in pairwise(_list_levels(sides, size)):
        crossing = upward[(upward[:, 0, 1] < (low + high) / 2) & (upward[:, 1, 1] > (low + high) / 2)]
        ends = np.stack([_intersect(crossing, low), _intersect(crossing, high)])
        ends = ends[:, np.argsort(ends.sum(axis=0))]
        following: list[list[FloatArray]] = []
        for k in range(0, ends.shape[1] - 1, 2):
            bottom, top = np.array([*ends[0, k : k + 2], low]), np.array([*ends[1, k : k + 2], high])
            below = next((part for part in open_parts if _extends(part, bottom, top, size)), None)
            if below is not None:
                open_parts = [part for part in open_parts if part is not below]
            following.append([*(below or [bottom]), top])
        done += open_parts
        open_parts = following
    return [_list_corners(part, size) for part in (*done, *open_parts)]


def _list_levels(sides: FloatArray, size: float) -> list[float]:
    """List the y coordinates of all corners, ascending; of corners that are equally high, only the lowest [m]."""
    levels: list[float] = []
    for y in np.unique(sides[..., 1]).tolist():
        if not levels or y > levels[-1] + _NUMBERS.level * size:
            levels.append(y)
    return levels


def _intersect(upward: FloatArray, y: float) -> FloatArray:
    """Return the x at which sides that cross a slab meet its upper or lower border, a line of constant y [m].

    Args:
        upward: Lower and upper end (x, y) of each side, shape (n, 2, 2) [m].
        y: The border's y [m].
    """
    (ax, ay), (bx, by) = upward[:, 0].T, upward[:, 1].T
    share = np.clip((y - ay) / (by - ay), 0, 1)
    return np.asarray(ax + share * (bx - ax))


def _extends(part: list[FloatArray], bottom: FloatArray, top: FloatArray, size: float) -> bool:
    """Return whether a trapezoid shares the upper edge of a part of a face, and the union of the two is convex.

    Args:
        part: Rows (left x, right x, y) of the part, by ascending y [m].
        bottom: Lower row (left x, right x, y) of the trapezoid [m].
        top: Upper row of the trapezoid [m].
        size: Longer edge of the outline's bounding rectangle [m].
    """
    rows = np.array(part)
    if np.abs(rows[-1] - bottom).max() > _NUMBERS.coincident * size:
        return False
    # The ends of the trapezoid's upper edge must not lie outside the straight continuation of any side of the part.
    # Comparison with the uppermost side alone is not enough: where slabs are thin, the change of direction from one
    # slab to the next is within rounding, but the sum of many changes is not.
    rise = np.diff(rows, axis=0)
    outside = top[:2] - rows[1:, :2] - rise[:, :2] / rise[:, 2:] * (top[2] - rows[1:, 2:])
    slack = _NUMBERS.level * size
    return bool((outside[:, 0] >= -slack).all() and (outside[:, 1] <= slack).all())


def _list_corners(part: list[FloatArray], size: float) -> FloatArray:
    """Return the corners of a part, counterclockwise, without duplicates and without corners on straight sides.

    Args:
        part: Rows (left x, right x, y) of the part, by ascending y [m].
        size: Longer edge of the outline's bounding rectangle [m].

    Returns:
        Corners (x, y), shape (k, 2) [m].
    """
    rows = np.array(part)
    ring = np.concatenate([rows[:, [1, 2]], rows[::-1, [0, 2]]])
    ring = ring[np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > _NUMBERS.coincident * size]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[np.abs(cross(before, after)) > _NUMBERS.straight * size**2])
