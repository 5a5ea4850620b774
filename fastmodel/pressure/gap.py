"""Shapes of bodies, and the gap between them and the undeformed cover.

Each accepted geom is convex; a mesh counts as its convex hull, as in MuJoCo.  A line therefore intersects a geom in
one interval, and the nearer end of this interval is the gap along the line.  A body consists of one or several solids.
Its gap is the smallest gap of its solids, so that solids which overlap or share an edge are counted once.  Over a plate
the gap is averaged over each cell of the contact grid, from `POINTS` x `POINTS` sampled points.  Over a curved cover
the gap is measured along the normals at the points of the cover.

The pressure under a sharp edge is singular.  Cells with uniform pressure omit part of the singular pressure, with the
same effect as an edge that lies farther inside.  To compensate, solids with sharp edges may be enlarged by about an
eighth of a cell.  The enlargement also lowers the whole surface, which has no effect because the contact solution
depends only on height differences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.errors import FastModelError
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap_kernels import (
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    POLYTOPE,
    Shape,
    cross_lines,
    sample_body,
)
from meshes.array_types import FloatArray, IntArray


class Solid(NamedTuple):
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
    middle, half, planes = np.zeros(3), size, np.zeros((0, 4))
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
            number, size = ELLIPSOID, np.repeat(size[0], 3)
            half = size
        case kinds.mjGEOM_ELLIPSOID:
            number = ELLIPSOID
        case kinds.mjGEOM_CYLINDER:
            number, half = CYLINDER, size[[0, 0, 1]]
        case kinds.mjGEOM_CAPSULE:
            number, half = CAPSULE, np.array([size[0], size[0], size[0] + size[1]])
        case _:
            raise FastModelError(
                f"geom {model.geom(geom).name!r} (id {geom}) of body {model.body(model.geom_bodyid[geom]).name!r} is "
                f"of type {kind.name}, which is no convex solid"
            )
    return Solid(number, size, planes, middle, half + edge)


def find_vertices(model: mujoco.MjModel, geom: int) -> FloatArray:
    """Find the n vertices of a mesh geom in the frame of the geom, shape (n, 3) [m]."""
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return np.array(model.mesh_vert[first : first + count], dtype=np.float64)


@lru_cache(maxsize=1000)
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
    # triangles whose planes agree to six decimal places count as one face
    _, kept = np.unique(np.round(equations * scale, 6), axis=0, return_index=True)
    planes = np.column_stack([equations[kept, :3], edge - equations[kept, 3]])
    planes.flags.writeable = False
    return planes


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyShape:
    """The p solids of one body as the arrays that the compiled kernels take; see `Solid`.

    Attributes:
        kinds: Kind of each solid, shape (p,).
        sizes: Size of each solid, shape (p, 3) [m].
        planes: Planes of all faces, shape (f, 4) [-, m].
        starts: Index of the first plane of each solid, and f, shape (p + 1,).
        centres: Centre of each solid's bounding box in the frame of the solid, shape (p, 3) [m].
        halves: Half edge lengths of each solid's bounding box, shape (p, 3) [m].
        edge: Distance by which solids with sharp edges are enlarged [m].
    """

    kinds: IntArray
    sizes: FloatArray
    planes: FloatArray
    starts: IntArray
    centres: FloatArray
    halves: FloatArray
    edge: float = 0.0

    @classmethod
    def of(cls, solids: Sequence[Solid], edge: float = 0.0) -> BodyShape:
        """Combine solids to one body; `edge` is the distance by which the solids were enlarged [m]."""
        return cls(
            kinds=np.array([each.kind for each in solids], dtype=np.int64),
            sizes=np.array([each.size for each in solids]),
            planes=np.concatenate([each.planes for each in solids]),
            starts=np.cumsum([0, *(len(each.planes) for each in solids)], dtype=np.int64),
            centres=np.array([each.centre for each in solids]),
            halves=np.array([each.half for each in solids]),
            edge=edge,
        )

    @cached_property
    def arrays(self) -> Shape:
        """The solids as a tuple of arrays, which compiled kernels take as one argument."""
        return self.kinds, self.sizes, self.planes, self.starts, self.centres, self.halves


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedBody:
    """The shape of a body, with the pose of each of its p solids.

    Attributes:
        shape: The solids of the body.
        rotation: Axes of each solid in the array's frame, as columns, shape (p, 3, 3) [-].
        position: Origin of each solid in the array's frame, shape (p, 3) [m].
        depth: Deepest penetration of the body into the geoms of the array in MuJoCo [m].
    """

    shape: BodyShape
    rotation: FloatArray
    position: FloatArray
    depth: float = np.inf

    @property
    def floor(self) -> float:
        """Smallest possible gap [m].

        MuJoCo measures the penetration along the contact normal, which may be inclined.  Where the body lies deeper
        than that, and deeper than the enlargement of its edges explains, the body passes beside the array.
        """
        return -2 * self.depth - 4 * self.shape.edge

    @property
    def is_convex(self) -> bool:
        """Whether the body is one convex solid."""
        return len(self.position) == 1

    def measure_motion(self, other: PosedBody, point: FloatArray, normal: FloatArray) -> tuple[float, float, float]:
        """Measure the motion from another pose of the same rigid body to this one, near a point of the cover.

        Args:
            other: The other pose.
            point: The point in the array's frame, shape (3,) [m].
            normal: Normal of the cover at the point, shape (3,) [-].

        Returns:
            Distance along the cover [m], and angles of rotation about the normal and about other axes [rad]; infinite
            for a body of another shape.
        """
        if self.shape is not other.shape and not all(map(np.array_equal, self.shape.arrays, other.shape.arrays)):
            return np.inf, np.inf, np.inf
        poses = self.rotation[0], self.position[0], other.rotation[0], other.position[0]
        found: tuple[float, float, float] = compile_kernel(_measure_motion)(poses, point, normal)
        return found

    def measure_gaps(self, points: FloatArray, normals: FloatArray, *, behind: float = 0.0) -> FloatArray:
        """Measure the distance from points to the body along their normals.

        Args:
            points: Positions of k points in the array's frame, shape (k, 3) [m].
            normals: Unit normals at the points, shape (k, 3) [-].
            behind: Distance behind a point within which a body that has passed the point is detected [m].

        Returns:
            Distance at which each normal enters the body, shape (k,) [m].  It is negative at points that are inside the
            body or that it has passed, and infinite where the normal misses the body or the body is more than `behind`
            behind the point.
        """
        lines = np.ascontiguousarray(points), np.ascontiguousarray(normals)
        enter, leave = compile_kernel(cross_lines)(self.shape.arrays, self.rotation, self.position, *lines)
        return np.asarray(np.where(leave >= -behind, enter, np.inf).min(axis=0, initial=np.inf))

    @property
    def centres(self) -> FloatArray:
        """Centre of each solid's bounding box in the array's frame, shape (p, 3) [m]."""
        return np.asarray(self.position + np.einsum("pij,pj->pi", self.rotation, self.shape.centres))


@dataclass(frozen=True, eq=False)
class GapSamples:
    """The m cells of the contact grid under bodies; a cell under two bodies is listed for each body.

    All arrays have shape (m,) unless another shape is given.

    Attributes:
        body: Index of the body above the cell, from 0 and in rising order.
        row: Row of the cell in the contact grid.
        column: Column of the cell in the contact grid.
        coverage: Share of the cell's area that lies under the body [-].
        x: x of the centroid of the covered part of the cell on the contact grid [m].
        y: y of the centroid of the covered part of the cell on the contact grid [m].
        gap: Mean gap between the body's surface and the undeformed cover over the covered part [m].
        place: Centroid of the covered part in the array's frame, shape (m, 3) [m].
        normal: Outward normal of the cell in the array's frame, shape (m, 3) [-].
    """

    body: IntArray
    row: IntArray
    column: IntArray
    coverage: FloatArray
    x: FloatArray
    y: FloatArray
    gap: FloatArray
    place: FloatArray
    normal: FloatArray

    @property
    def count(self) -> int:
        """Number m of cells, summed over all bodies."""
        return len(self.body)

    @cached_property
    def bodies_found(self) -> list[int]:
        """Indices of the bodies that lie over at least one cell."""
        return np.bincount(self.body).nonzero()[0].tolist()

    @cached_property
    def lowest(self) -> FloatArray:
        """Smallest gap over the cells under each body, shape (bodies,) [m]."""
        bodies = int(self.body[-1]) + 1
        if bodies == 1:
            return np.array([self.gap.min()])
        lowest = np.full(bodies, np.inf)
        np.minimum.at(lowest, self.body, self.gap)
        return lowest


def sample_gap(grid: CellGrid, bodies: Sequence[PosedBody], reach: Sequence[float]) -> GapSamples:
    """Average the gap under each body over the cells of the contact grid.

    Args:
        grid: The contact grid.
        bodies: Shapes and poses of the bodies.
        reach: For each body, gap above the body's smallest gap up to which cells are kept, with their neighbours [m].
    """
    kernel = compile_kernel(sample_body)
    found = [
        kernel((each.shape.arrays, each.shape.edge, each.rotation, each.position), grid.arrays, height, each.floor)
        for each, height in zip(bodies, reach, strict=True)
    ]
    row, column, coverage, x, y, gap = (
        found[0] if len(found) == 1 else (np.concatenate(each) for each in zip(*found, strict=True))
    )
    # The arrays are filled in place, which takes a quarter of the time of `column_stack` and `tile` for small arrays.
    place, normal = np.zeros((len(x), 3)), np.zeros((len(x), 3))
    place[:, 0], place[:, 1], normal[:, 2] = x, y, 1.0
    body = np.repeat(np.arange(len(found)), [len(each[0]) for each in found])
    return GapSamples(body, row, column, coverage, x, y, gap, place, normal)


def _measure_motion(
    poses: tuple[FloatArray, FloatArray, FloatArray, FloatArray], point: FloatArray, normal: FloatArray
) -> tuple[float, float, float]:
    """Kernel, which calls no function of another file: measure the motion of a rigid body near a point.

    Args:
        poses: Axes of the body, as columns, shape (3, 3) [-], and its origin, shape (3,) [m]; both before the motion.
        point: The point, shape (3,) [m].
        normal: Unit normal of the surface at the point, shape (3,) [-].

    Returns:
        Distance of the motion along the surface [m], and, for small rotations, angles about the normal and about axes
        in the surface [rad].
    """
    rotation, position, before, origin = poses
    turn = np.dot(rotation, np.ascontiguousarray(before.T))
    moved = position - point
    axis = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    for i in range(3):
        for j in range(3):
            moved[i] += turn[i, j] * (point[j] - origin[j])
    along, about, slide, tilt = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        along += moved[i] * normal[i]
        about += axis[i] * normal[i]
    for i in range(3):
        slide += (moved[i] - along * normal[i]) ** 2
        tilt += (axis[i] - about * normal[i]) ** 2
    return math.sqrt(slide), abs(about), math.sqrt(tilt)
