"""How high a geom's underside stands over the array: one vertical line per point, all at once.

Every geom that MuJoCo collides is convex (meshes collide as their hull), so a vertical line meets it in one interval;
its lower end is the gap.  Geoms are taken in the array's frame by a rotation and a position.

Solids with sharp edges may be made to stand out on all sides by a little.  Under such an edge pressure is singular;
cells of even pressure miss a part of it, as if the edge stood back.  Standing out by about an eighth of a cell makes
up for that; that the underside comes lower everywhere changes nothing, since only differences of height matter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError

FloatArray = npt.NDArray[np.float64]
#: (origins (3, m), direction (3,)) in the geom's frame -> lower and upper end of each interval, empty where crossed.
Chord = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

#: Component of a unit normal along a line below which the line runs in the face [-].
_PARALLEL = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A geom's shape in its own frame.

    Attributes:
        chord: Where lines meet it.
        kind: 0 polytope, 1 ellipsoid, 2 cylinder, 3 capsule.
        size: Half axes of an ellipsoid; radius and half length of a cylinder or capsule, shape (3,) [m].
        planes: Outward normal and offset of a polytope's faces, shape (f, 4) [-, m].
        centre: Of the box that holds it, shape (3,) [m].
        half: Half edges of that box, shape (3,) [m].
    """

    chord: Chord
    kind: int
    size: FloatArray
    planes: FloatArray
    centre: FloatArray
    half: FloatArray

    def lower(self, x: FloatArray, y: FloatArray, rotation: FloatArray, position: FloatArray) -> FloatArray:
        """Height of the underside over the array's plane, inf where there is none [m].

        Args:
            x: Positions in the array's frame, shape (m,) [m].
            y: Positions, shape (m,) [m].
            rotation: The geom's axes in the array's frame, as columns, shape (3, 3) [-].
            position: The geom's origin in the array's frame, shape (3,) [m].
        """
        local = rotation.T
        origins = local[:, :1] * (x - position[0]) + local[:, 1:2] * (y - position[1]) - local[:, 2:] * position[2]
        low, high = self.chord(origins, local[:, 2])
        return np.where((low <= high) & (low > -np.inf), low, np.inf)


def solid(model: Any, geom: int, edge: float = 0.0) -> Solid:  # noqa: ANN401, PLR0911 -- MjModel; one way out per type
    """The shape of a geom.

    Args:
        model: The compiled model.
        geom: Its id.
        edge: Distance by which sharp edges stand out [m].

    Raises:
        FastModelError: If the geom is a height field or a signed distance field, which have no convex shape.
    """
    kind, size, kinds = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom].copy(), mujoco.mjtGeom
    box = model.geom_aabb[geom]
    bounds = (box[:3].copy(), box[3:] + edge)
    match kind:
        case kinds.mjGEOM_PLANE:
            return _faces(np.array([[0.0, 0, 1, 0]]), np.zeros(3), np.full(3, np.inf))
        case kinds.mjGEOM_BOX:
            return _faces(np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.tile(size + edge, 2)]), *bounds)
        case kinds.mjGEOM_MESH:
            return _faces(_hull(_vertices(model, geom), edge), *bounds)
        case kinds.mjGEOM_SPHERE:
            return _round(_ellipsoid(np.repeat(size[0], 3)), 1, np.repeat(size[0], 3), *bounds)
        case kinds.mjGEOM_ELLIPSOID:
            return _round(_ellipsoid(size), 1, size, *bounds)
        case kinds.mjGEOM_CYLINDER:
            return _round(_cylinder(size[0], size[1], edge), 2, size, *bounds)
        case kinds.mjGEOM_CAPSULE:
            return _round(_capsule(size[0], size[1]), 3, size, *bounds)
    raise FastModelError(
        f"geom {model.geom(geom).name!r} is of type {kind.name}; the contact methods 'foundation' and 'cover' take "
        f"planes, spheres, ellipsoids, capsules, cylinders, boxes and meshes (as their convex hull)"
    )


def _faces(planes: FloatArray, centre: FloatArray, half: FloatArray) -> Solid:
    chord = _polytope(planes[:, :3], planes[:, 3])
    return Solid(chord=chord, kind=0, size=np.zeros(3), planes=planes, centre=centre, half=half)


def _round(chord: Chord, kind: int, size: FloatArray, centre: FloatArray, half: FloatArray) -> Solid:
    return Solid(chord=chord, kind=kind, size=size, planes=np.zeros((0, 4)), centre=centre, half=half)


def _vertices(model: Any, geom: int) -> FloatArray:  # noqa: ANN401 -- MjModel
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return np.array(model.mesh_vert[first : first + count], dtype=np.float64)


def _hull(vertices: FloatArray, edge: float) -> FloatArray:
    """The half spaces of the convex hull, each face once."""
    from scipy.spatial import ConvexHull

    equations = ConvexHull(vertices).equations
    scale = np.array([1, 1, 1, 1 / np.ptp(vertices, axis=0).max()])
    _, first = np.unique(np.round(equations * scale, 6), axis=0, return_index=True)
    return np.column_stack([equations[first, :3], edge - equations[first, 3]])


def _polytope(normals: FloatArray, offsets: FloatArray) -> Chord:
    """Points q with normals @ q <= offsets."""

    def chord(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        slope = normals @ direction
        room = offsets[:, None] - normals @ origins
        under, over = slope < -_PARALLEL, slope > _PARALLEL
        low = (room[under] / slope[under, None]).max(axis=0, initial=-np.inf)
        high = (room[over] / slope[over, None]).min(axis=0, initial=np.inf)
        beside = ~(under | over)
        if beside.any():
            low = np.where(room[beside].min(axis=0) >= 0, low, np.inf)
        return low, high

    return chord


def _ellipsoid(half_axes: FloatArray) -> Chord:
    def chord(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _roots(origins / half_axes[:, None], direction / half_axes, 1.0)

    return chord


def _cylinder(inner_radius: float, half: float, edge: float = 0.0) -> Chord:
    caps = _polytope(np.array([[0.0, 0, 1], [0, 0, -1]]), np.array([half, half]) + edge)

    def chord(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        # lying, the round side presses, which is not sharp: its curvature stays
        radius = inner_radius + edge * direction[2] ** 2
        low, high = caps(origins, direction)
        if np.hypot(direction[0], direction[1]) < _PARALLEL:
            return np.where(np.hypot(origins[0], origins[1]) <= radius, low, np.inf), high
        wall = _roots(origins[:2], direction[:2], radius)
        return np.maximum(low, wall[0]), np.minimum(high, wall[1])

    return chord


def _capsule(radius: float, half: float) -> Chord:
    parts = [_cylinder(radius, half), _ellipsoid(np.repeat(radius, 3))]

    def chord(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        end = np.array([[0.0], [0.0], [half]])
        found = [parts[0](origins, direction), *(parts[1](origins + sign * end, direction) for sign in (1, -1))]
        hit = [low <= high for low, high in found]
        low = np.min([np.where(ok, a, np.inf) for ok, (a, _) in zip(hit, found, strict=True)], axis=0)
        high = np.max([np.where(ok, b, -np.inf) for ok, (_, b) in zip(hit, found, strict=True)], axis=0)
        return low, high

    return chord


def _roots(origins: FloatArray, direction: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Where |origin + z direction| = radius: both roots, or an empty interval."""
    a = direction @ direction
    b = direction @ origins
    c = np.einsum("ij,ij->j", origins, origins) - radius**2
    root = b**2 - a * c
    reach = np.sqrt(np.maximum(root, 0.0))
    return np.where(root >= 0, (-b - reach) / a, np.inf), (-b + reach) / a
