"""The heights of geoms above the top of an array, along lines parallel to the array's normal."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from fastmodel.pressure.gap import describe_solid
from meshes.array_types import FloatArray, IntArray

#: Most points along one side of one geom of an array.
_MOST_POINTS = 40
#: Most points on all geoms of an array together, above which one point stands for each geom.
_MOST_TOGETHER = 2000


def sample_top(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, *, inset: float, spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Place points on the outer faces of an array's geoms.

    Args:
        model: The compiled model.
        data: A state with the poses of geoms.
        geoms: Ids of the array's geoms, which are boxes.
        inset: Distance from the sides of each box within which no points are placed [m].
        spacing: Distance between neighbouring points [m].

    Returns:
        The points in the world, shape (n, 3) [m], and the outward normals of their boxes, shape (n, 3) [-].
    """
    points, normals = [], []
    for geom in geoms.tolist():
        half = np.maximum(model.geom_size[geom, :2] - inset, 0.0)
        counts = [min(max(1, math.ceil(2 * side / spacing - 1e-9)), _MOST_POINTS) for side in half]
        if len(geoms) * counts[0] * counts[1] > _MOST_TOGETHER:
            counts = [1, 1] if len(geoms) > 1 else counts
        x, y = (side * ((2 * np.arange(count) + 1) / count - 1) for side, count in zip(half, counts, strict=True))
        local = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), model.geom_size[geom, 2])], axis=-1).reshape(
            -1, 3
        )
        axes = data.geom_xmat[geom].reshape(3, 3)
        points.append(data.geom_xpos[geom] + local @ axes.T)
        normals.append(np.tile(axes[:, 2], (len(local), 1)))
    return np.concatenate(points), np.concatenate(normals)


def find_span(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, points: FloatArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find the interval in which a line through each of n points lies within a geom.

    A mesh counts as its convex hull, as in MuJoCo's collisions.  A height field fills everything below its surface.

    Args:
        model: The compiled model.
        data: A state with the poses of geoms.
        geom: Id of the geom.
        points: The points in the world, shape (n, 3) [m].
        normals: Directions of the lines in the world, of unit length, shape (n, 3) [-].

    Returns:
        Distances along the line from the point to the lower and upper end of the interval, each of shape (n,) [m];
        inf and -inf for a line that misses the geom.
    """
    kinds = mujoco.mjtGeom
    kind = int(model.geom_type[geom])
    rotation, position = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    if kind in {kinds.mjGEOM_BOX, kinds.mjGEOM_MESH, kinds.mjGEOM_PLANE}:
        return _clip(describe_solid(model, geom).planes, (points - position) @ rotation, normals @ rotation)
    low, high = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
        far = float(np.linalg.norm(point - position)) + 2 * float(model.geom_rbound[geom])
        above, below = point + far * normal, point - far * normal
        if kind in {kinds.mjGEOM_HFIELD, kinds.mjGEOM_SDF}:
            reach = mujoco.mj_rayHfield if kind == kinds.mjGEOM_HFIELD else mujoco.mj_rayMesh
            down, up = reach(model, data, geom, above, -normal), far
        else:
            box = (position, data.geom_xmat[geom], model.geom_size[geom])
            down, up = (mujoco.mju_rayGeom(*box, *ray, kind) for ray in ((above, -normal), (below, normal)))
        if down >= 0:
            low[k], high[k] = up - far, far - down
    return low, high


def _clip(planes: FloatArray, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the interval of lines within a convex polytope; see `find_span`.

    Args:
        planes: Outward normal and offset of each of the f faces, shape (f, 4) [-, m].
        points: A point of each of n lines in the frame of the polytope, shape (n, 3) [m].
        directions: Direction of each line, shape (n, 3) [-].
    """
    slope, room = directions @ planes[:, :3].T, planes[:, 3] - points @ planes[:, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = room / slope
    low = np.where(slope < 0, crossing, -np.inf).max(axis=1)
    high = np.where(slope > 0, crossing, np.inf).min(axis=1)
    missed = (low > high) | ((slope == 0) & (room < 0)).any(axis=1)
    return np.where(missed, np.inf, low), np.where(missed, -np.inf, high)
