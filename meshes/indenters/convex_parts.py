"""Splitting of the outline of a flat face into convex polygons."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from meshes.indenters.polygons import FloatArray, Polygon, cross, list_sides

#: Distance below which two points count as equal, over the longer edge of the outline's bounding rectangle: rounding in
#: double precision [-].
_COINCIDENT = 1e-9
#: Difference of y below which two corners count as equally high, over the longer edge of the outline's bounding
#: rectangle: coordinates stored in single precision differ by up to this much [-].
_LEVEL = 1e-6
#: Twice the area of the triangle of three neighbouring corners, below which the corners count as lying on a straight
#: line, over the square of the longer edge of the outline's bounding rectangle [-].
_STRAIGHT = 1e-12
#: Number of sides, the longest ones, whose directions are tried for the parallel lines that cut the outline [-].
_MOST_DIRECTIONS = 8


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
    longest = np.argsort(-np.hypot(*along.T), kind="stable")[:_MOST_DIRECTIONS]
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
        if not levels or y > levels[-1] + _LEVEL * size:
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
    """Return whether a trapezoid stands on the upper edge of a part, and the union of the two is convex.

    Args:
        part: Rows (left x, right x, y) of the part, by ascending y [m].
        bottom: Lower row (left x, right x, y) of the trapezoid [m].
        top: Upper row of the trapezoid [m].
        size: Longer edge of the outline's bounding rectangle [m].
    """
    rows = np.array(part)
    if np.abs(rows[-1] - bottom).max() > _COINCIDENT * size:
        return False
    # The ends of the trapezoid's upper edge must not lie outside the straight continuation of any side of the part.
    # Comparison with the uppermost side alone is not enough: where slabs are thin, the change of direction from one
    # slab to the next is within rounding, but the sum of many changes is not.
    rise = np.diff(rows, axis=0)
    outside = top[:2] - rows[1:, :2] - rise[:, :2] / rise[:, 2:] * (top[2] - rows[1:, 2:])
    slack = _LEVEL * size
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
    ring = ring[np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > _COINCIDENT * size]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[np.abs(cross(before, after)) > _STRAIGHT * size**2])
