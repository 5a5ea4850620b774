"""Description of the shapes of MuJoCo geoms, from which the gap between bodies and the array is computed.

The gap is the vertical distance between the lower surface of a body and the undeformed top of the cover.  Every geom
accepted here is convex; a mesh counts as its convex hull, as in MuJoCo.  A line along the array's normal
therefore intersects a geom in one interval, and the height of the lower end of this interval is the gap.

The pressure under a sharp edge is singular.  Cells with uniform pressure omit part of the singular pressure, which has
the same effect as an edge that lies farther inside.  To compensate, solids with sharp edges may be enlarged by about an
eighth of a cell.  The enlargement also lowers the whole surface, without effect: the contact solution depends on height
differences only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np

from fastmodel.errors import FastModelError
from meshes.array_types import FloatArray

#: Values of `Solid.kind`; a polytope is a convex solid with flat faces.
POLYTOPE, ELLIPSOID, CYLINDER, CAPSULE = range(4)
#: Types of geoms that are not convex solids.
_NOT_SOLID = (int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_SDF))
#: Decimal places to which the plane equations of two triangles of a convex hull are compared; triangles in the same
#: plane count as one face [-].
_FACE_DECIMALS = 6
#: Number of meshes whose planes are kept for other sensors and other worlds of the same model [-].
_MOST_HULLS = 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """The shape of a geom, in the frame of the geom.

    Attributes:
        kind: `POLYTOPE`, `ELLIPSOID`, `CYLINDER` or `CAPSULE`.
        size: Half axes of an ellipsoid; radius and half length of a cylinder or capsule, shape (3,) [m].
        planes: Outward normal and offset of each of the f faces of a polytope, shape (f, 4) [-, m].
        centre: Centre of the solid's bounding box, shape (3,) [m].
        half: Half edge lengths of the bounding box, shape (3,) [m].
    """

    kind: int
    size: FloatArray
    planes: FloatArray
    centre: FloatArray
    half: FloatArray


def describe_solid(model: mujoco.MjModel, geom: int, edge: float = 0.0) -> Solid:
    """Read the shape of a geom from a compiled model, and return it as a solid.

    Args:
        model: The compiled model.
        geom: Id of the geom.
        edge: Distance by which solids with sharp edges are enlarged [m].

    Raises:
        FastModelError: If the geom is a height field or a signed distance field, which are not convex.
    """
    kind, size, kinds = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom].copy(), mujoco.mjtGeom
    middle, half, no_planes = np.zeros(3), size, np.zeros((0, 4))
    match kind:
        case kinds.mjGEOM_PLANE:
            number, planes, half = POLYTOPE, np.array([[0.0, 0, 1, 0]]), np.full(3, np.inf)
        case kinds.mjGEOM_BOX:
            number, planes = POLYTOPE, np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.tile(size + edge, 2)])
        case kinds.mjGEOM_MESH:
            vertices = find_vertices(model, geom)
            number, planes = POLYTOPE, _find_hull_planes(vertices.tobytes(), edge)
            middle, half = (vertices.max(axis=0) + vertices.min(axis=0)) / 2, np.ptp(vertices, axis=0) / 2
        case kinds.mjGEOM_SPHERE:
            number, planes, half = ELLIPSOID, no_planes, np.repeat(size[0], 3)
        case kinds.mjGEOM_ELLIPSOID:
            number, planes = ELLIPSOID, no_planes
        case kinds.mjGEOM_CYLINDER:
            number, planes, half = CYLINDER, no_planes, size[[0, 0, 1]]
        case kinds.mjGEOM_CAPSULE:
            number, planes, half = CAPSULE, no_planes, np.array([size[0], size[0], size[0] + size[1]])
        case _:
            raise FastModelError(
                f"geom {model.geom(geom).name!r} (id {geom}) of body {model.body(model.geom_bodyid[geom]).name!r} is "
                f"of type {kind.name}, which is no convex solid"
            )
    return Solid(
        kind=number, size=half if kind == kinds.mjGEOM_SPHERE else size, planes=planes, centre=middle, half=half + edge
    )


def is_solid(model: mujoco.MjModel, geom: int) -> bool:
    """Return whether the shape of a geom is a convex solid, which `describe_solid` takes."""
    return int(model.geom_type[geom]) not in _NOT_SOLID


def find_vertices(model: mujoco.MjModel, geom: int) -> FloatArray:
    """Find the n vertices of a mesh geom in the frame of the geom, shape (n, 3) [m]."""
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return np.array(model.mesh_vert[first : first + count], dtype=np.float64)


@lru_cache(maxsize=_MOST_HULLS)
def _find_hull_planes(vertices: bytes, edge: float) -> FloatArray:
    """Find the planes of the f flat faces of the convex hull of n vertices, moved outwards by `edge`, shape (f, 4).

    The columns are the outward normal [-] and the offset [m].

    Args:
        vertices: The bytes of an array of vertices, shape (n, 3) [m]; planes of equal vertices are computed once.
        edge: Distance by which the planes are moved [m].
    """
    from scipy.spatial import ConvexHull

    corners = np.frombuffer(vertices).reshape(-1, 3)
    equations = ConvexHull(corners).equations
    scale = np.array([1, 1, 1, 1 / np.ptp(corners, axis=0).max()])
    _, kept = np.unique(np.round(equations * scale, _FACE_DECIMALS), axis=0, return_index=True)
    planes = np.column_stack([equations[kept, :3], edge - equations[kept, 3]])
    planes.flags.writeable = False
    return planes
