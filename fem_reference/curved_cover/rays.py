"""Distance along lines to a rigid indenter, from its convex solids."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from meshes import Indenter, Primitive
from meshes.array_types import FloatArray

#: Component of a unit direction below which a line counts as parallel to a plane [-].
_PARALLEL = 1e-14


def measure_gaps(indenter: Indenter, points: FloatArray, directions: FloatArray, *, behind: float = 0.0) -> FloatArray:
    """Compute the distances from points to an indenter along lines.

    Args:
        indenter: The indenter.
        points: k points in the indenter's frame, shape (k, 3) [m].
        directions: Unit directions, shape (k, 3) [-].
        behind: Distance behind a point up to which an indenter that has passed it counts [m].

    Returns:
        Distances at which the lines enter the indenter; negative at points inside it or passed by it; inf where it is
        not hit or lies farther behind the point, shape (k,) [m].
    """
    gap = np.full(len(points), np.inf)
    for primitive in indenter.primitives():
        turn = _rotation(primitive.quaternion)
        first, last = _cross(primitive, (points - np.array(primitive.position)) @ turn, directions @ turn)
        gap = np.minimum(gap, np.where((first <= last) & (last >= -behind), first, np.inf))
    return gap


def _cross(primitive: Primitive, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where lines enter and leave a convex solid, in its frame; the first is larger if they miss it [m]."""
    if primitive.kind == "sphere":
        return _cross_round(points, directions, primitive.size[0])
    if primitive.kind == "box":
        size = np.array(primitive.size)
        return _cross_planes(points, directions, np.concatenate([np.eye(3), -np.eye(3)]), np.concatenate([size, size]))
    if primitive.kind == "hull":
        corners = np.array(primitive.vertices)
        scale = float(np.ptp(corners, axis=0).max())
        planes = ConvexHull(corners / scale).equations
        return _cross_planes(points, directions, planes[:, :3], -planes[:, 3] * scale)
    radius, half = primitive.size
    across = np.array([1.0, 1.0, 0.0])
    first, last = _cross_round(points * across, directions * across, radius)
    ends = _cross_planes(points, directions, np.array([[0, 0, 1.0], [0, 0, -1.0]]), np.array([half, half]))
    first, last = np.maximum(first, ends[0]), np.minimum(last, ends[1])
    if primitive.kind == "capsule":
        for end in (-half, half):
            start, stop = _cross_round(points - np.array([0, 0, end]), directions, radius)
            missed, hit = first > last, start <= stop
            first = np.where(hit & (missed | (start < first)), start, first)
            last = np.where(hit & (missed | (stop > last)), stop, last)
    return first, last


def _cross_round(points: FloatArray, directions: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Intersect lines with |x| <= radius; components that do not count are zero."""
    square = (directions**2).sum(axis=1)
    along = (points * directions).sum(axis=1)
    rest = along**2 - square * ((points**2).sum(axis=1) - radius**2)
    root = np.sqrt(np.maximum(rest, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = (-along - root) / square, (-along + root) / square
    parallel = square < _PARALLEL**2
    inside = (points**2).sum(axis=1) <= radius**2
    first = np.where(parallel, np.where(inside, -np.inf, np.inf), np.where(rest >= 0, first, np.inf))
    last = np.where(parallel, np.where(inside, np.inf, -np.inf), np.where(rest >= 0, last, -np.inf))
    return first, last


def _cross_planes(
    points: FloatArray, directions: FloatArray, normals: FloatArray, offsets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Intersect lines with the points whose component along each of p outward normals is at most its offset."""
    speed, room = directions @ normals.T, offsets - points @ normals.T
    moving = np.abs(speed) > _PARALLEL
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / speed
    outside = (~moving & (room < 0)).any(axis=1)
    first = np.where(moving & (speed < 0), at, -np.inf).max(axis=1)
    last = np.where(moving & (speed > 0), at, np.inf).min(axis=1)
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def _rotation(quaternion: tuple[float, float, float, float]) -> FloatArray:
    """Return the rotation matrix of a unit quaternion with the scalar first, shape (3, 3)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
