"""Checks of a press into a solid cover: nothing lies inside the indenter, and the shape of the cover is good enough."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fem_reference.errors import ConvergenceError
from meshes import Indenter, Primitive
from meshes.array_types import FloatArray
from meshes.pose import Pose
from meshes.solids.solid_mesh import SolidMesh, measure_thickness

#: Largest accepted penetration over the depth, and over the thickness of the cover [-].  The contact is solved on
#: cells, so that single nodes at a border or beside a contact narrower than the elements lie inside the indenter.
_TOLERANCE = (0.75, 0.03)
#: Relative error of depth or load over the error of the shape divided by the depth [-], of facets and of smoothed
#: surfaces, whose errors have no kinks.  On a sphere of 320 triangles it was 0.45 and 0.03, on fingertips of 200 and
#: 800 smoothed triangles 0.13 and 0.05.  The largest texel force changes by half as much.
_SHAPE = (0.5, 0.1)
#: Relative error by the shape above which the depth of a press is not known [-].
MOST_SHAPE = 0.15


def check_penetration(
    mesh: SolidMesh, displacement: FloatArray, indenter: Indenter, pose: Pose, *, travel: float, depth: float
) -> None:
    """Check that no free point of the surface of a pressed cover lies inside the indenter.

    Args:
        mesh: Mesh of the cover.
        displacement: Displacement of its nodes, shape (n, 3) [m].
        indenter: Rigid indenter.
        pose: Pose of the indenter before its motion.
        travel: Distance of its motion from the pose [m].
        depth: Distance of its motion from the first touch [m].

    Raises:
        ConvergenceError: If a point lies inside by more than the tolerance.
    """
    free = np.unique(np.concatenate([mesh.top.ravel(), mesh.left_out.ravel()]))
    points = mesh.nodes[free] + displacement[free]
    inside = measure_penetration(indenter, pose.points_to_indenter(points - travel * pose.towards))
    deepest = int(inside.argmax())
    allowed = max(_TOLERANCE[0] * depth, _TOLERANCE[1] * measure_thickness(mesh))
    if inside[deepest] > allowed:
        place = ", ".join(f"{1e3 * each:.3g}" for each in mesh.nodes[free[deepest]])
        raise ConvergenceError(
            f"the cover passes through the indenter by {1e3 * inside[deepest]:.2g} mm at ({place}) mm, more than "
            f"{1e3 * allowed:.2g} mm: the indenter touches a part that is left out or lies beside the contact; press "
            "less deep, from another side, or change left_out"
        )


def shape_error(mesh: SolidMesh, depth: float) -> float:
    """Estimate the relative error of depth or load by the error of a cover's shape, such as facets [-]."""
    return _SHAPE[bool(mesh.settings.get("smooth"))] * mesh.geometry_error / depth


def warn_of_shape(mesh: SolidMesh, depth: float) -> tuple[str, ...]:
    """State in a sentence that the shape of the cover is too coarse for a depth [m]; empty if it is not."""
    share = shape_error(mesh, depth)
    if share <= MOST_SHAPE:
        return ()
    sentence = (
        f"the shape of the cover is known to {1e3 * mesh.geometry_error:.2g} mm, and the depth to {share:.0%} by that; "
        "export the surfaces with smaller triangles, or press deeper"
    )
    return (sentence,)


def measure_penetration(indenter: Indenter, points: FloatArray) -> FloatArray:
    """Compute how deep points lie inside an indenter, shape (k,) [m]; zero or less outside.

    Args:
        indenter: Rigid indenter.
        points: Positions in the indenter's frame, shape (k, 3) [m].
    """
    out = np.full(len(points), -np.inf)
    for primitive in indenter.primitives():
        turn = Rotation.from_quat(primitive.quaternion, scalar_first=True).as_matrix()
        out = np.maximum(out, _measure_inside(primitive, (points - np.array(primitive.position)) @ turn))
    return out


def _measure_inside(primitive: Primitive, points: FloatArray) -> FloatArray:
    """Compute the distance of points from the surface of a convex solid, negative outside, shape (k,) [m]."""
    size = np.array(primitive.size)
    if primitive.kind == "sphere":
        return np.asarray(size[0] - np.linalg.norm(points, axis=1))
    if primitive.kind == "box":
        return np.asarray((size - np.abs(points)).min(axis=1))
    if primitive.kind == "hull":
        planes = ConvexHull(np.array(primitive.vertices)).equations
        return np.asarray(-(points @ planes[:, :3].T + planes[:, 3]).max(axis=1))
    across, along = np.hypot(points[:, 0], points[:, 1]), np.abs(points[:, 2]) - size[1]
    if primitive.kind == "capsule":
        return np.asarray(size[0] - np.hypot(across, np.maximum(along, 0.0)))
    return np.asarray(np.minimum(size[0] - across, -along))
