"""Distance from points of a curved cover, along their normals, to rigid bodies."""

from __future__ import annotations

import numpy as np

from fastmodel.pressure.gap import CYLINDER, ELLIPSOID, POLYTOPE
from fastmodel.pressure.gap_sampling import PosedBody
from meshes.array_types import FloatArray

#: Component of a unit direction below which a line counts as parallel to a plane [-].
_PARALLEL = 1e-12


def measure_gaps(body: PosedBody, points: FloatArray, normals: FloatArray, *, behind: float = 0.0) -> FloatArray:
    """Measure the distance from points to a body along their normals.

    Args:
        body: Solids of the body and their poses.
        points: k points in the array's frame, shape (k, 3) [m].
        normals: Their unit normals, shape (k, 3) [-].
        behind: Distance behind a point up to which a body that has passed it counts [m].

    Returns:
        Distance at which each normal enters the body; negative where the point lies inside it or was passed by it,
        infinite where the normal misses the body or it lies farther behind the point, shape (k,) [m].
    """
    gap = np.full(len(points), np.inf)
    for solid, rotation, position in zip(body.shape.solids, body.rotation, body.position, strict=True):
        start, along = (points - position) @ rotation, normals @ rotation
        if solid.kind == POLYTOPE:
            first, last = _cross_planes(start, along, solid.planes)
        elif solid.kind == ELLIPSOID:
            first, last = _cross_round(start / solid.size, along / solid.size, 1.0)
        else:
            radius, half = solid.size[:2]
            first, last = _cross_cylinder(start, along, radius, half)
            if solid.kind != CYLINDER:
                first, last = _add_caps(start, along, radius, half, (first, last))
        gap = np.minimum(gap, np.where((first <= last) & (last >= -behind), first, np.inf))
    return gap


def _cross_planes(start: FloatArray, along: FloatArray, planes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find where k lines enter and leave a polytope; the first exceeds the last where they miss it [m]."""
    speed, room = along @ planes[:, :3].T, planes[:, 3] - start @ planes[:, :3].T
    moving = np.abs(speed) > _PARALLEL
    at = np.divide(room, speed, out=np.zeros_like(room), where=moving)
    first = np.where(moving & (speed < 0), at, -np.inf).max(axis=1)
    last = np.where(moving & (speed > 0), at, np.inf).min(axis=1)
    outside = (~moving & (room < 0)).any(axis=1)
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def _cross_round(start: FloatArray, along: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Find where |start + s along| equals a radius: the ball in 3 components, the endless cylinder in 2 [m]."""
    square = (along**2).sum(axis=1)
    middle, inner = (along * start).sum(axis=1), (start**2).sum(axis=1) - radius**2
    root = middle**2 - square * inner
    parallel = square < _PARALLEL**2
    missed = np.where(parallel, inner > 0, root < 0)
    half = np.sqrt(np.maximum(root, 0.0))
    scale = np.where(parallel, 1.0, square)
    first = np.where(parallel, -np.inf, (-middle - half) / scale)
    last = np.where(parallel, np.inf, (-middle + half) / scale)
    return np.where(missed, np.inf, first), np.where(missed, -np.inf, last)


def _cross_cylinder(start: FloatArray, along: FloatArray, radius: float, half: float) -> tuple[FloatArray, FloatArray]:
    """Find where k lines enter and leave an upright cylinder of a half length [m]."""
    first, last = _cross_round(start[:, :2], along[:, :2], radius)
    ends = _cross_planes(start, along, np.array([[0.0, 0, 1, half], [0, 0, -1, half]]))
    return np.maximum(first, ends[0]), np.minimum(last, ends[1])


def _add_caps(
    start: FloatArray, along: FloatArray, radius: float, half: float, found: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Unite the interval in a cylinder with those in the balls at its ends, which together are a capsule [m]."""
    missed = found[0] > found[1]
    first, last = np.where(missed, np.inf, found[0]), np.where(missed, -np.inf, found[1])
    for end in (-half, half):
        enter, leave = _cross_round(start - np.array([0, 0, end]), along, radius)
        hit = enter <= leave
        first = np.where(hit, np.minimum(first, enter), first)
        last = np.where(hit, np.maximum(last, leave), last)
    return first, last
