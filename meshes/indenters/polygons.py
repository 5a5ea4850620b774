"""Outlines made of closed polygons: distances from them, and checks of a single polygon.

One polygon bounds a face; further ones bound holes in it, or other pieces of it.  A point is inside when it lies inside
an odd number of polygons.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Corner = tuple[float, float]
#: Corners (x, y) of a closed polygon, in order; the last one is joined to the first.
Polygon = Sequence[Corner]

#: Length below which two points coincide, over the size of the polygon: rounding in double precision [-].
_COINCIDENT = 1e-9
#: Segments of a full circle in the arcs of an inset outline: they miss the circle by 0.12 % of its radius [-].
_ARC_SEGMENTS = 64


def make_hexagon(across: float) -> list[Corner]:
    """Make a regular hexagon around the origin with two of its sides facing along x, counterclockwise [m].

    Args:
        across: Distance between opposite sides [m].
    """
    turn = np.pi / 6 + np.arange(6) * np.pi / 3
    return [(float(across / np.sqrt(3) * np.cos(t)), float(across / np.sqrt(3) * np.sin(t))) for t in turn]


def compute_signed_distance(polygons: Sequence[Polygon], x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance from the nearest side of all polygons, positive inside, negative outside.

    Args:
        polygons: Closed polygons [m].
        x: Positions, any shape [m].
        y: Positions of the same shape [m].

    Returns:
        Distances of the same shape [m].
    """
    nearest = np.full(np.broadcast(x, y).shape, np.inf)
    inside = np.zeros(nearest.shape, dtype=bool)
    for (ax, ay), (bx, by) in list_sides(polygons).tolist():
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx**2 + dy**2), 0, 1)
        nearest = np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy))
        if dy:  # a ray from the point along +x that crosses the side changes between inside and outside
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * dx / dy)
    return np.where(inside | (nearest == 0), nearest, -nearest)


def compute_distance_from_inset(polygons: Sequence[Polygon], inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance from the points that lie deeper inside than an inset; zero on them.

    Beyond a convex corner it is the distance from one point, so that its gradient is continuous there.

    Args:
        polygons: Closed polygons [m].
        inset: Least depth inside [m].
        x: Positions, any shape [m].
        y: Positions of the same shape [m].

    Returns:
        Distances of the same shape [m].

    Raises:
        ValueError: If no point lies that deep inside.
        ModuleNotFoundError: If manifold3d is not installed.
    """
    shrunk = _shrink(tuple(tuple((float(x), float(y)) for x, y in polygon) for polygon in polygons), inset)
    return np.maximum(-compute_signed_distance(shrunk, x, y), 0.0)


@lru_cache(maxsize=32)
def _shrink(polygons: tuple[tuple[Corner, ...], ...], inset: float) -> list[Polygon]:
    """Outlines of the points that lie deeper inside than the inset."""
    import manifold3d

    # manifold3d rounds coordinates to a fixed grid: lengths in insets are far above it
    section = manifold3d.CrossSection([np.array(each) / inset for each in polygons], manifold3d.FillRule.EvenOdd)
    section = section.offset(-1.0, manifold3d.JoinType.Round, circular_segments=_ARC_SEGMENTS)
    if section.is_empty():
        raise ValueError(f"an inset of {inset:.3g} m leaves nothing of the outline")
    return [polygon * inset for polygon in section.to_polygons()]


def find_inside(polygons: Sequence[Polygon], x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether points lie inside or on an outline; much faster than the signed distance.

    Args:
        polygons: Closed polygons [m].
        x: Positions, any shape [m].
        y: Positions of a shape that broadcasts with it [m].
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
    """First and last point of every side of all polygons, shape (n, 2, 2) [m]."""
    return np.concatenate([np.stack([each, np.roll(each, -1, axis=0)], axis=1) for each in polygons])


def check_polygon(polygon: Polygon) -> None:
    """Check that a polygon is simple; its corners may go either way round.

    Raises:
        ValueError: If it has fewer than three corners or two equal ones, encloses no area, or crosses or touches
            itself.
    """
    if len(polygon) < 3:  # noqa: PLR2004 -- a triangle
        raise ValueError(f"a polygon needs three corners or more, not {len(polygon)}")
    corners = np.array(polygon, dtype=float)
    if not np.isfinite(corners).all():
        raise ValueError("a polygon's corners must be numbers")
    size = float(np.ptp(corners, axis=0).max())
    for k, corner in enumerate(corners):
        equal = np.flatnonzero(np.hypot(*(corners[k + 1 :] - corner).T) <= _COINCIDENT * size)
        if len(equal):
            raise ValueError(f"corners {k + 1} and {k + 2 + equal[0]} of the polygon are the same")
    if np.abs(cross(corners[1] - corners[0], corners - corners[0])).max() <= _COINCIDENT * size**2:
        raise ValueError("the polygon's corners lie on one line: it encloses no area")
    meeting = _find_meeting_sides(corners, size)
    if meeting is not None:
        k, other = meeting
        raise ValueError(f"sides {k + 1} and {other + 1} of the polygon meet, so that it is not simple")


def _find_meeting_sides(corners: FloatArray, size: float) -> tuple[int, int] | None:
    """Find two sides that share a point other than a corner between them."""
    start, end = corners, np.roll(corners, -1, axis=0)
    n = len(corners)
    for k in range(n):
        a, b = start[k], end[k]
        ahead = end[(k + 1) % n] - b
        if abs(cross(b - a, ahead)) <= _COINCIDENT * size**2 and (b - a) @ ahead < 0:
            return k, (k + 1) % n  # the next side runs back along this one
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
    """Whether a line separates two points or goes through one, by their signed distances from it (2, n) [m]."""
    on_line = np.abs(distances) <= _COINCIDENT * size
    return np.asarray((np.sign(distances[0]) != np.sign(distances[1])) | on_line.any(axis=0))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of vectors in the plane, shapes (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
