"""The shapes of a model's geoms, as the gap between bodies and the array is computed from them.

Every geom that MuJoCo collides is convex; a mesh collides as its convex hull.  A line along the array's normal
therefore crosses a geom in one interval, and the lower end of that interval is the gap.

The pressure under a sharp edge is singular.  Cells of uniform pressure miss part of it, which has the same effect as an
edge farther inside.  Solids with sharp edges may be enlarged by about an eighth of a cell to compensate.  This lowers
the whole surface as well, which changes nothing: the contact solution depends on height differences only.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from fastmodel.errors import FastModelError
from meshes.array_types import FloatArray

#: Values of `Solid.kind`.
POLYTOPE, ELLIPSOID, CYLINDER, CAPSULE = range(4)
#: Decimal places to which the planes of two hull triangles must agree to count as one face [-].
_FACE_DECIMALS = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A geom's shape in its own frame.

    Attributes:
        kind: `POLYTOPE`, `ELLIPSOID`, `CYLINDER` or `CAPSULE`.
        size: Half axes of an ellipsoid; radius and half length of a cylinder or capsule, shape (3,) [m].
        planes: Outward normal and offset of each face of a polytope, shape (f, 4) [-, m].
        centre: Centre of the bounding box, shape (3,) [m].
        half: Half edges of the bounding box, shape (3,) [m].
    """

    kind: int
    size: FloatArray
    planes: FloatArray
    centre: FloatArray
    half: FloatArray


def describe_solid(model: mujoco.MjModel, geom: int, edge: float = 0.0) -> Solid:
    """Read the shape of a geom from a compiled model.

    Args:
        model: The compiled model.
        geom: Id of the geom.
        edge: Distance by which solids with sharp edges are enlarged [m].

    Raises:
        FastModelError: If the geom is a height field or a signed distance field, which are not convex.
    """
    kind, size, kinds = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom].copy(), mujoco.mjtGeom
    box, no_planes = model.geom_aabb[geom] + np.repeat([0.0, edge], 3), np.zeros((0, 4))
    match kind:
        case kinds.mjGEOM_PLANE:
            number, planes, box = POLYTOPE, np.array([[0.0, 0, 1, 0]]), np.repeat([0.0, np.inf], 3)
        case kinds.mjGEOM_BOX:
            number, planes = POLYTOPE, np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.tile(size + edge, 2)])
        case kinds.mjGEOM_MESH:
            number, planes = POLYTOPE, _find_hull_planes(model, geom, edge)
        case kinds.mjGEOM_SPHERE:
            number, planes, size = ELLIPSOID, no_planes, np.repeat(size[0], 3)
        case kinds.mjGEOM_ELLIPSOID:
            number, planes = ELLIPSOID, no_planes
        case kinds.mjGEOM_CYLINDER:
            number, planes = CYLINDER, no_planes
        case kinds.mjGEOM_CAPSULE:
            number, planes = CAPSULE, no_planes
        case _:
            raise FastModelError(
                f"geom {model.geom(geom).name!r} is of type {kind.name}; the contact methods 'foundation' and 'cover' "
                f"take planes, spheres, ellipsoids, capsules, cylinders, boxes and meshes (as their convex hull)"
            )
    return Solid(kind=number, size=size, planes=planes, centre=box[:3], half=box[3:])


def _find_hull_planes(model: mujoco.MjModel, geom: int, edge: float) -> FloatArray:
    """Planes of the convex hull of a mesh, one for each flat face, shape (f, 4) [-, m]."""
    from scipy.spatial import ConvexHull

    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.array(model.mesh_vert[first : first + count], dtype=np.float64)
    equations = ConvexHull(vertices).equations
    scale = np.array([1, 1, 1, 1 / np.ptp(vertices, axis=0).max()])
    _, kept = np.unique(np.round(equations * scale, _FACE_DECIMALS), axis=0, return_index=True)
    return np.column_stack([equations[kept, :3], edge - equations[kept, 3]])
