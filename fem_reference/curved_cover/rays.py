"""Distance along lines to a rigid indenter, from its convex solids, and its travel to the first touch of a top."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fem_reference.curved_cover.facet_surface import FacetSurface
from meshes import Indenter, Primitive
from meshes.array_types import FloatArray
from meshes.pose import Pose
from meshes.solids.facets import QUADRILATERAL, facet_shape, split_facet

#: Component of a unit direction below which a line counts as parallel to a plane [-].
_PARALLEL = 1e-14
#: Number of parts along each side of a facet in the first stage of the search for the first touch [-].  The distance to
#: the indenter is measured at the middles of the parts.
_PARTS = 6
#: Number of facets, those nearest to the indenter, on which the search for the first touch continues [-].
_FACETS = 4
#: Number of points along each side of a square of reference coordinates in the search on a facet [-].
_POINTS = 9
#: Number of successively smaller squares in the search on a facet [-].
_SEARCHES = 6
#: Difference of travel below which nodes touch together, over the size of the top [-].
_SAME = 1e-4
#: Half the side of the next smaller square, over the distance between the points in the present square [-].
_ZOOM = 1.5


def measure_gaps(indenter: Indenter, points: FloatArray, directions: FloatArray, *, behind: float = 0.0) -> FloatArray:
    """Compute the distances from points to an indenter along lines.

    Args:
        indenter: Rigid indenter.
        points: Positions of k points in the indenter's frame, shape (k, 3) [m].
        directions: Unit directions, shape (k, 3) [-].
        behind: Distance behind a point within which an indenter that has passed the point is detected [m].

    Returns:
        Distances at which the lines enter the indenter, shape (k,) [m].  They are negative at points that are inside
        the indenter or that it has passed, and inf where the line misses the indenter or the indenter is more than
        `behind` behind the point.
    """
    gap = np.full(len(points), np.inf)
    for primitive in indenter.primitives():
        turn = Rotation.from_quat(primitive.quaternion, scalar_first=True).as_matrix()
        first, last = _cross(primitive, (points - np.array(primitive.position)) @ turn, directions @ turn)
        gap = np.minimum(gap, np.where((first <= last) & (last >= -behind), first, np.inf))
    return gap


def _cross(primitive: Primitive, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the distances along lines at which they enter and leave a convex solid.

    Args:
        primitive: Convex solid, a part of an indenter.
        points: Starts of k lines in the frame of the solid, shape (k, 3) [m].
        directions: Unit directions of the lines, shape (k, 3) [-].

    Returns:
        Distances of entry and of exit, shape (k,) each [m]; the entry is larger than the exit if a line misses the
        solid.
    """
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
    """Compute the distances at which lines enter and leave a sphere or, if all z components are zero, a cylinder.

    The body is centred at the origin.  Arguments and results are those of `_cross`, besides the radius [m].
    """
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
    """Compute the distances at which lines enter and leave a convex polyhedron.

    Args:
        points: Starts of k lines, shape (k, 3) [m].
        directions: Unit directions of the lines, shape (k, 3) [-].
        normals: Outward normals of p faces, shape (p, 3) [-].
        offsets: Distances of the faces from the origin along their normals, shape (p,) [m].

    Returns:
        Distances of entry and of exit, shape (k,) each [m]; the entry is larger than the exit if a line misses the
        body.
    """
    speed, room = directions @ normals.T, offsets - points @ normals.T
    moving = np.abs(speed) > _PARALLEL
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / speed
    outside = (~moving & (room < 0)).any(axis=1)
    first = np.where(moving & (speed < 0), at, -np.inf).max(axis=1)
    last = np.where(moving & (speed > 0), at, np.inf).min(axis=1)
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def find_touch(top: FacetSurface, indenter: Indenter, pose: Pose) -> float:
    """Compute the travel of an indenter from its pose to first touch of the undeformed top.

    Only the part of the top whose normal is against the direction can be touched.

    Returns:
        Distance; negative if the indenter overlaps the top in its pose, inf if it never touches [m].
    """
    middle, area, _ = top.split(_PARTS)
    place = split_facet(top.facets.shape[1], _PARTS)[0]
    distance = _measure_travel(middle.reshape(-1, 3), area.reshape(-1, 3), indenter, pose)
    each = distance.reshape(middle.shape[:2])
    if not np.isfinite(each).any():
        return float("inf")
    best = float(each.min())
    for facet in np.argsort(each.min(axis=1))[:_FACETS]:
        if np.isfinite(each[facet].min()):
            start = place[np.argmin(each[facet])]
            best = min(best, _search_facet(top, int(facet), start, indenter, pose))
    return best


def find_first_node(top: FacetSurface, indenter: Indenter, pose: Pose, touch: float) -> int:
    """Find the node of the top next to the first touch; of nodes that touch together, that nearest to the axis.

    Args:
        top: Top of the cover.
        indenter: Rigid indenter.
        pose: Initial pose.
        touch: Travel to the first touch [m].
    """
    travel = _measure_travel(top.nodes, top.normals, indenter, pose)
    axis = np.linalg.norm(np.cross(top.nodes - pose.position, pose.towards), axis=1)
    first = travel <= max(touch, float(travel.min())) + _SAME * float(np.ptp(top.nodes, axis=0).max())
    if not first.any() or not np.isfinite(travel).any():  # The indenter passes between the nodes.
        return int(np.argmin(np.linalg.norm(top.nodes - pose.position - touch * pose.towards, axis=1)))
    return int(np.argmin(np.where(first, axis, np.inf)))


def explain_miss(top: FacetSurface, pose: Pose) -> str:
    """State why an indenter does not touch: it passes beside the top, or between the points that are searched."""
    facing = np.flatnonzero(top.normals @ pose.towards < 0)
    beside = np.linalg.norm(np.cross(top.nodes[facing] - pose.position, pose.towards), axis=1)
    spacing = float(np.sqrt(np.linalg.norm(top.split(1)[1], axis=2).mean()))
    if beside.min(initial=np.inf) <= spacing:
        return (
            "the indenter is too small for this mesh: it passes between points of the elements, "
            f"{1e3 * spacing:.2g} mm wide; use a wider indenter or smaller elements"
        )
    return "the indenter never touches the cover; check its position and direction"


def _search_facet(top: FacetSurface, facet: int, start: FloatArray, indenter: Indenter, pose: Pose) -> float:
    """Find the smallest travel of an indenter to a point of one facet.

    The search goes through successively smaller squares of reference coordinates around the nearest point so far, and
    begins around the reference coordinates `start`.
    """
    count = top.facets.shape[1]
    square = count == QUADRILATERAL
    low, high = (-1.0, 1.0) if square else (0.0, 1.0)
    half, best = 2.0 / _PARTS, np.inf
    for _ in range(_SEARCHES):
        u, v = (np.clip(np.linspace(c - half, c + half, _POINTS), low, high) for c in start)
        place = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        if not square:
            place = place[place.sum(axis=1) <= 1]
        points = facet_shape(count, place) @ top.nodes[top.facets[facet]]
        found = _measure_travel(points, np.broadcast_to(-pose.towards, points.shape), indenter, pose)
        if found.min() < best:
            best, start = float(found.min()), place[np.argmin(found)]
        half *= _ZOOM / ((_POINTS - 1) / 2)
    return best


def _measure_travel(points: FloatArray, normals: FloatArray, indenter: Indenter, pose: Pose) -> FloatArray:
    """Measure the travel of the indenter to each of k points, shape (k,) [m]; inf where normals point away."""
    back = np.broadcast_to(pose.vectors_to_indenter(-pose.towards), points.shape)
    # The lines start far behind the points, so that an indenter that has passed a point is detected as well.
    far = float(np.ptp(points, axis=0).max()) * 2 + float(np.linalg.norm(pose.position - points.mean(axis=0)))
    found = measure_gaps(indenter, pose.points_to_indenter(points) - far * back, back) - far
    return np.where(normals @ pose.towards < 0, found, np.inf)
