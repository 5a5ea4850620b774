"""Outlines of flat faces: corners of polygons, the distance from them, and the convex polygons they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Corner = tuple[float, float]
#: Corners of a closed polygon, in order.
Loop = Sequence[Corner]

#: Length that counts as none, over the size of the outline [-].
_NOTHING = 1e-9
#: What single precision leaves of a length, over the size of the outline: corners this close stand level [-].
_ROUNDING = 1e-6
#: Straight pieces of a whole circle that stand for the arcs of an inset outline [-].
_ARC = 64
#: Directions of sides that are tried for slabs [-].
_DIRECTIONS = 8


def flats_of_circle(diameter: float) -> float:
    """Width across flats of the hexagon that has a circle's area: sqrt(3) / 2 w^2 = pi / 4 d^2 [m]."""
    return diameter * float(np.sqrt(np.pi / (2 * np.sqrt(3))))


def hexagon(across: float) -> list[Corner]:
    """Corners, counterclockwise, of a hexagon with flats facing along x [m]."""
    turn = np.pi / 6 + np.arange(6) * np.pi / 3
    return [(float(across / np.sqrt(3) * np.cos(t)), float(across / np.sqrt(3) * np.sin(t))) for t in turn]


def inside_loops(loops: Sequence[Loop], x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance from the nearest of several outlines, positive inside an odd number of them, any shape [m]."""
    nearest = np.full(np.broadcast(x, y).shape, np.inf)
    crossings = np.zeros(nearest.shape, dtype=bool)
    for (ax, ay), (bx, by) in sides(loops).tolist():
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx**2 + dy**2), 0, 1)
        nearest = np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy))
        if dy:
            crossings ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * dx / dy)
    return np.where(crossings | (nearest == 0), nearest, -nearest)


def beyond_loops(loops: Sequence[Loop], inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance outside of what an inset leaves inside an odd number of outlines, any shape [m].

    Around a corner that stands out this is the distance from a point, so that it bends there but has no crease.

    Raises:
        ValueError: If the inset leaves nothing.
    """
    left = _inset(tuple(tuple((float(x), float(y)) for x, y in loop) for loop in loops), inset)
    return np.maximum(-inside_loops(left, x, y), 0.0)


@lru_cache(maxsize=32)
def _inset(loops: tuple[tuple[Corner, ...], ...], inset: float) -> list[Loop]:
    """Outlines of the points that lie deeper inside than the inset."""
    import manifold3d

    section = manifold3d.CrossSection([np.array(loop) / inset for loop in loops], manifold3d.FillRule.EvenOdd).offset(
        -1.0, manifold3d.JoinType.Round, circular_segments=_ARC
    )
    if section.is_empty():
        raise ValueError(f"an inset of {inset:.3g} m leaves nothing of the outline")
    return [polygon * inset for polygon in section.to_polygons()]


def within_loops(loops: Sequence[Loop], x: FloatArray, y: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether points lie inside an odd number of outlines, or on one; far quicker than the distance."""
    x, y = np.broadcast_arrays(x, y)
    flat_x, flat_y = x.ravel(), y.ravel()
    crossings, on = np.zeros((2, flat_x.size), dtype=bool)
    for (ax, ay), (bx, by) in sides(loops).tolist():
        level = np.flatnonzero((flat_y >= min(ay, by)) & (flat_y <= max(ay, by)))
        here_x, here_y = flat_x[level], flat_y[level]
        if by == ay:
            on[level] |= (here_x >= min(ax, bx)) & (here_x <= max(ax, bx))
            continue
        side = ax + (here_y - ay) * (bx - ax) / (by - ay)
        on[level] |= here_x == side
        crossings[level] ^= ((ay > here_y) != (by > here_y)) & (here_x < side)
    return np.asarray((crossings | on).reshape(x.shape))


def sides(loops: Sequence[Loop]) -> FloatArray:
    """First and last point of every side, shape (n, 2, 2) [m]."""
    return np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])


def check_loop(loop: Loop) -> None:
    """Check that a polygon is simple; either order of its corners is good.

    Raises:
        ValueError: If it has too few corners, repeats one, encloses nothing or crosses or touches itself.
    """
    if len(loop) < 3:  # noqa: PLR2004 -- a triangle
        raise ValueError(f"a polygon needs three corners or more, not {len(loop)}")
    corners = np.array(loop, dtype=float)
    if not np.isfinite(corners).all():
        raise ValueError("a polygon's corners must be numbers")
    size = float(np.ptp(corners, axis=0).max())
    for k, corner in enumerate(corners):
        again = np.flatnonzero(np.hypot(*(corners[k + 1 :] - corner).T) <= _NOTHING * size)
        if len(again):
            raise ValueError(f"corners {k + 1} and {k + 2 + again[0]} of the polygon are the same")
    if np.abs(_cross(corners[1] - corners[0], corners - corners[0])).max() <= _NOTHING * size**2:
        raise ValueError("the polygon's corners lie on one line: it encloses no area")
    crossing = _crossing(corners, size)
    if crossing is not None:
        k, other = crossing
        raise ValueError(f"sides {k + 1} and {other + 1} of the polygon meet, so that it is not simple")


def area(loop: Loop) -> float:
    """Area of a polygon, positive where its corners go counterclockwise [m2]."""
    first = np.array(loop, dtype=float)
    x, y = (first - first[0]).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def _crossing(corners: FloatArray, size: float) -> tuple[int, int] | None:
    """Two sides that share a point which is not a corner of both, if there are any."""
    start, end = corners, np.roll(corners, -1, axis=0)
    n = len(corners)
    for k in range(n):
        a, b = start[k], end[k]
        ahead = end[(k + 1) % n] - b
        if abs(_cross(b - a, ahead)) <= _NOTHING * size**2 and (b - a) @ ahead < 0:
            return k, (k + 1) % n
        others = np.arange(k + 2, n if k else n - 1)
        c, d = start[others], end[others]
        from_here = np.stack([_cross(b - a, c - a), _cross(b - a, d - a)]) / np.hypot(*(b - a))
        from_there = np.stack([_cross(d - c, a - c), _cross(d - c, b - c)]) / np.hypot(*(d - c).T)
        met = _apart(from_here, size) & _apart(from_there, size)
        met &= (np.maximum(np.minimum(a, b), np.minimum(c, d)) <= np.minimum(np.maximum(a, b), np.maximum(c, d))).all(1)
        if met.any():
            return k, int(others[met.argmax()])
    return None


def _apart(distances: FloatArray, size: float) -> npt.NDArray[np.bool_]:
    """Whether two points lie on different sides of a line, or one of them on it."""
    near = np.abs(distances) <= _NOTHING * size
    return np.asarray((np.sign(distances[0]) != np.sign(distances[1])) | near.any(axis=0))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def convex_parts(loops: Sequence[Loop]) -> list[FloatArray]:
    """Convex polygons that tile what lies inside an odd number of outlines.

    Slabs between the corners give trapezoids; those of neighbouring slabs that are convex together become one.  The
    slabs run along that of the longest sides which gives the fewest parts.

    Args:
        loops: Simple polygons that do not cross one another.

    Returns:
        Corners of each part, shape (k, 2) [m].
    """
    every = sides(loops)
    along = every[:, 1] - every[:, 0]
    longest = np.argsort(-np.hypot(*along.T), kind="stable")[:_DIRECTIONS]
    angles = {0.0, *(round(float(np.arctan2(y, x) % np.pi), 9) % round(np.pi, 9) for x, y in along[longest])}
    found: list[FloatArray] = []
    for angle in sorted(angles):
        c, s = np.cos(angle), np.sin(angle)
        turned = _slabs(every @ np.array([[c, -s], [s, c]]))
        if not found or len(turned) < len(found):
            found = [part @ np.array([[c, s], [-s, c]]) for part in turned]
    return found


def _slabs(every: FloatArray) -> list[FloatArray]:
    """Convex polygons that tile what the sides (n, 2, 2) enclose, cut along x."""
    size = float(np.ptp(every, axis=(0, 1)).max())
    levels = _levels(every, size)
    upward = np.take_along_axis(every, np.argsort(every[..., 1], axis=1)[..., None], axis=1)
    open_parts: list[list[FloatArray]] = []
    done: list[list[FloatArray]] = []
    for low, high in pairwise(levels):
        crossing = upward[(upward[:, 0, 1] < (low + high) / 2) & (upward[:, 1, 1] > (low + high) / 2)]
        ends = np.stack([_at(crossing, low), _at(crossing, high)])
        ends = ends[:, np.argsort(ends.sum(axis=0))]
        rows = [(np.array([*ends[0, k : k + 2], low]), np.array([*ends[1, k : k + 2], high])) for k in _pairs(ends)]
        following: list[list[FloatArray]] = []
        for bottom, top in rows:
            mate = next((part for part in open_parts if _goes_on(part, bottom, top, size)), None)
            if mate is not None:
                open_parts = [part for part in open_parts if part is not mate]
            following.append([*(mate or [bottom]), top])
        done += open_parts
        open_parts = following
    return [_corners(part, size) for part in (*done, *open_parts)]


def _levels(every: FloatArray, size: float) -> list[float]:
    """Heights of all corners, those within rounding of one another once [m]."""
    levels: list[float] = []
    for level in np.unique(every[..., 1]).tolist():
        if not levels or level > levels[-1] + _ROUNDING * size:
            levels.append(level)
    return levels


def _pairs(ends: FloatArray) -> range:
    return range(0, ends.shape[1] - 1, 2)


def _at(upward: FloatArray, level: float) -> FloatArray:
    """Where sides that cross a slab meet its bottom or top [m]."""
    (ax, ay), (bx, by) = upward[:, 0].T, upward[:, 1].T
    share = np.clip((level - ay) / (by - ay), 0, 1)
    return np.asarray(ax + share * (bx - ax))


def _goes_on(part: list[FloatArray], bottom: FloatArray, top: FloatArray, size: float) -> bool:
    """Whether a trapezoid stands on the whole top of a part, and is convex together with it."""
    rows = np.array(part)
    if np.abs(rows[-1] - bottom).max() > _NOTHING * size:
        return False
    # The new ends must not lie outside the line on of any side below: one by one is not enough where slabs are thin.
    rise = np.diff(rows, axis=0)
    beyond = top[:2] - rows[1:, :2] - rise[:, :2] / rise[:, 2:] * (top[2] - rows[1:, 2:])
    slack = _ROUNDING * size
    return bool((beyond[:, 0] >= -slack).all() and (beyond[:, 1] <= slack).all())


def _corners(part: list[FloatArray], size: float) -> FloatArray:
    """Corners, counterclockwise, from the left and right ends at each level; those on a straight side are left out."""
    rows = np.array(part)
    ring = np.concatenate([rows[:, [1, 2]], rows[::-1, [0, 2]]])
    ring = ring[np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > _NOTHING * size]
    here, there = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[np.abs(_cross(here, there)) > _NOTHING * size**2 * 1e-3])
