"""Forces between rigid bodies and points of a curved cover.

A point of the cover is either in contact, with a force and no gap, or free, with a gap and no force.  The solver moves
points between these two sets until all forces press and no gap is negative.  It moves several points at once (block
pivoting, Judice and Pires 1994), and single points where this makes no progress (Murty 1974).  The force of each body
is prescribed along one direction, and along further directions if the body is free to move in them.  The Lagrange
multipliers of these constraints are the motions of the body.  Gaps are measured along the normals of the undeformed
cover.  They are measured again after each motion of a body, until the motion is small.

`press_points` presses one indenter on a guide; `fastmodel.indent` is its public form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from fastmodel.contact.bodies import add_geoms
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pressure.gap import BodyShape, PosedBody, describe_solid
from fastmodel.pressure.solvers import Load, join_constraints
from fastmodel.surface import CoverPoints
from meshes import Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import Pose

#: Largest number of consecutive steps of block pivoting that do not reduce the number of points in the wrong set [-].
_PATIENCE = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class PointPressure:
    """Forces of all bodies on the m points of a curved cover.

    Attributes:
        forces: Force on each point against its normal, shape (m,) [N].
        travel: Distance that each body moved along the first direction of its load from the given pose, shape
            (bodies,) [m].
        points: Number of points in contact with each body, shape (bodies,) [-].
        owner: Index of the body nearest to each point, the only one that can press on it, shape (m,) [-].
        settled: Whether the iteration for contact and positions of all bodies converged.
    """

    forces: FloatArray
    travel: FloatArray
    points: IntArray
    owner: IntArray
    settled: bool


def solve_pressure(
    cover: CoverPoints, bodies: Sequence[PosedBody], loads: Sequence[Load], start: FloatArray | None = None
) -> PointPressure:
    """Find the forces of bodies on a cover under given loads.

    Args:
        cover: The cover.
        bodies: Shapes and poses of the bodies in the array's frame, in contact or not.  A body that no normal of the
            points reaches has no points in the result, and does not change the forces of the others.
        loads: Force of each body on the cover with reversed sign, see `Load`.
        start: Forces of a similar contact, from which the search starts, shape (m,) [N].
    """
    travel = np.zeros(len(bodies))
    touching = None if start is None else start > 0
    for _ in range(12):
        gaps = np.array(
            [
                _measure(cover, body, load.directions[0], moved)
                for body, load, moved in zip(bodies, loads, travel, strict=True)
            ]
        )
        owner, gap = gaps.argmin(axis=0), gaps.min(axis=0)
        reached = np.isfinite(gaps).any(axis=1)
        if not reached.all():
            return _solve_without(cover, bodies, loads, ~reached)
        near = np.where(np.isfinite(gap), owner, -1)
        constraints, first = join_constraints(
            loads, near, cover.points, cover.normals, cover.spacing, cover.mean_compliance
        )
        columns = constraints[0]
        forces, motion, found = _exchange(cover, gap, constraints, touching)
        touching = forces > 0
        # The travel is computed from all motions of a body, projected on its first direction, because the other
        # directions may be almost parallel to the first.
        along = columns[touching][:, first]
        change = (along * (columns[touching] @ motion)[:, None]).sum(axis=0) / np.maximum(
            (along**2).sum(axis=0), np.finfo(float).tiny
        )
        travel = travel + change
        if found and np.abs(change).max() <= 1e-3 * cover.thickness:
            break
    points = np.bincount(owner[touching], minlength=len(bodies))
    return PointPressure(forces=forces, travel=travel, points=points, owner=owner, settled=found)


def _solve_without(
    cover: CoverPoints, bodies: Sequence[PosedBody], loads: Sequence[Load], missed: BoolArray
) -> PointPressure:
    """Compute the forces of the bodies that are not missed.

    A body is missed if no normal of the cover's points meets the body, for example because it lies between points.

    Args:
        cover: The cover.
        bodies: Shapes and poses of the bodies.
        loads: Load of each body.
        missed: Whether each body is missed, shape (bodies,).
    """
    kept = np.flatnonzero(~missed).tolist()
    travel, points = np.zeros(len(bodies)), np.zeros(len(bodies), dtype=np.int64)
    if not kept:
        count = len(cover.points)
        owner = np.zeros(count, dtype=np.int64)
        return PointPressure(forces=np.zeros(count), travel=travel, points=points, owner=owner, settled=False)
    found = solve_pressure(cover, [bodies[each] for each in kept], [loads[each] for each in kept])
    travel[kept], points[kept] = found.travel, found.points
    return replace(found, travel=travel, points=points, owner=np.array(kept)[found.owner])


def _measure(cover: CoverPoints, body: PosedBody, outward: FloatArray, travel: float) -> FloatArray:
    """Measure the gap between a body and each of the m points of a cover along the point's normal, shape (m,) [m].

    Gaps that exceed the smallest gap by more than the thickness of the cover, and gaps at points that face away from
    the body's force, are infinite.

    Args:
        cover: The cover.
        body: Shape of the body, and its pose before the motion.
        outward: Direction against which the body moves, unit vector, shape (3,) [-].
        travel: Distance of the motion [m].
    """
    moved = replace(body, position=body.position - travel * outward)
    gap = moved.measure_gaps(cover.points, cover.normals, behind=cover.thickness)
    gap = np.where(cover.normals @ outward > 0, gap, np.inf)
    lowest = gap.min()
    return np.where(gap <= lowest + cover.thickness, gap, np.inf) if np.isfinite(lowest) else gap


def _exchange(
    cover: CoverPoints,
    gap: FloatArray,
    constraints: tuple[FloatArray, FloatArray, FloatArray],
    touching: BoolArray | None,
) -> tuple[FloatArray, FloatArray, bool]:
    """Find which of the m points are in contact, and compute their forces.

    Args:
        cover: The cover.
        gap: Gap of the undeformed cover at each point, infinite where no body presses, shape (m,) [m].
        constraints: Columns of k constraints columns.T @ forces + slacks = target, shape (m, k), target, shape (k,)
            [N], and compliance of each slack, shape (k,) [m/N].
        touching: Whether each point is in contact at the start of the search, shape (m,); None if unknown.

    Returns:
        Forces, shape (m,) [N]; motions of the bodies along the constraints, shape (k,) [m]; and whether the search
        converged.
    """
    columns, target, yielding = constraints
    near = np.isfinite(gap)
    if touching is None or not (touching & near).any():
        touching = np.zeros(len(gap), dtype=bool)
        for column in np.unique(np.abs(columns) > 0, axis=1).T:
            own = np.flatnonzero(column & near)
            touching[own[np.argsort(gap[own])[:6]]] = True
    touching = touching & near
    # A constraint without slack has a very small compliance, which keeps the equations regular.
    loose = np.diag(1 / np.where(yielding > 0, yielding, 1e9 * cover.mean_compliance))
    fewest, patience = len(gap) + 1, _PATIENCE
    forces, motion = np.zeros(len(gap)), np.zeros(len(target))
    for _ in range(100):
        nodes = np.flatnonzero(touching)
        part = columns[nodes]
        system = np.block([[cover.compliance[np.ix_(nodes, nodes)], -part], [part.T, loose]])
        solved = np.linalg.solve(system, np.concatenate([-gap[nodes], target]))
        forces = np.zeros(len(gap))
        forces[nodes], motion = solved[: len(nodes)], solved[len(nodes) :]
        remaining = gap + cover.compliance[:, nodes] @ forces[nodes] - columns @ motion
        wrong = np.where(touching, forces < 0, remaining < -1e-7 * cover.thickness)
        count = int(wrong.sum())
        if count == 0:
            return forces, motion, True
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong[np.flatnonzero(wrong)[:-1]] = False
        touching = touching ^ wrong
        if not touching.any():
            touching[np.argmin(np.where(near, gap, np.inf))] = True
    return np.maximum(forces, 0.0), motion, False


@dataclass(frozen=True, kw_only=True, eq=False)
class PointPress:
    """Result of a press on a curved cover by the fast model.

    Attributes:
        texel_forces: Force on each of n texels along its normal, shape (n,) [N].
        forces: Force on each of m points of the surface against its normal, shape (m,) [N].
        force: Force of the indenter on the cover, shape (3,) [N].
        points: Number of points in contact [-].
        depth: Approach of the indenter along the direction since its first touch of a point [m].
    """

    texel_forces: FloatArray
    forces: FloatArray
    force: FloatArray
    points: int
    depth: float


def press_points(
    cover: CoverPoints,
    indenter: Indenter,
    pose: Pose,
    *,
    load: float,
    direction: npt.ArrayLike | None = None,
) -> PointPress:
    """Press an indenter that moves along a direction without turning; a guide bears the forces across it.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its path.
        load: Force along the direction [N].
        direction: Direction of motion, of any length, shape (3,) [-]; the direction that the indenter faces if None.

    Raises:
        FastModelError: If the load is not positive, the contact does not converge, or the indenter fits between the
            points of the cover.
        MissedArrayError: If the indenter never touches the cover.
    """
    if not 0 < load < np.inf:
        raise FastModelError(f"load must be positive, not {load} N")
    towards = pose.towards if direction is None else np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    wrench = Load.along_free_directions(load * outward, np.zeros(3), outward[None], rotates=False)
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    found = solve_pressure(cover, [body], [wrench])
    if not found.points.any():
        _refuse_small(cover.points, body.centres.mean(axis=0), outward)
    if not found.settled:
        raise FastModelError(f"the contact under {load:.4g} N was not found; use a smaller load")
    return PointPress(
        texel_forces=cover.influence @ found.forces,
        forces=found.forces,
        force=-found.forces @ cover.normals,
        points=int(found.points[0]),
        depth=float(found.travel[0]),
    )


def find_first_contact(
    cover: CoverPoints, indenter: Indenter, pose: Pose, direction: npt.ArrayLike, *, within: float
) -> IntArray:
    """Find the points of the undeformed cover that a rigid indenter reaches first: contact of two rigid bodies.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its path.
        direction: Direction of motion, of any length, shape (3,) [-].
        within: Distance along the direction from the first point up to which points count as reached at the same time
            [m].

    Returns:
        Indices of the points.

    Raises:
        MissedArrayError: If the indenter never touches the cover.
    """
    towards = np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    facing = np.flatnonzero(cover.normals @ outward > 0)
    gap = body.measure_gaps(cover.points[facing], np.broadcast_to(outward, (len(facing), 3)))
    return np.asarray(facing[gap <= within])


def pose_indenter(indenter: Indenter, pose: Pose) -> PosedBody:
    """Describe the solids of an indenter at a pose, in the array's frame."""
    spec = mujoco.MjSpec()
    add_geoms(spec, spec.worldbody.add_body(), indenter)
    model = spec.compile()
    turns = Rotation.from_quat(model.geom_quat, scalar_first=True).as_matrix()
    return PosedBody(
        shape=BodyShape.of([describe_solid(model, geom) for geom in range(model.ngeom)]),
        rotation=np.ascontiguousarray(pose.rotation @ turns),
        position=pose.position + model.geom_pos @ pose.rotation.T,
    )


def _move_to_touch(cover: CoverPoints, body: PosedBody, outward: FloatArray) -> PosedBody:
    """Move a body along a direction, unit vector against `outward`, until it touches a point of the undeformed cover.

    Raises:
        MissedArrayError: If the body never touches a point.
    """
    facing = cover.points[cover.normals @ outward > 0]
    middle = body.centres.mean(axis=0)
    # Start far in front of the cover, so that the whole body lies before every point.
    spans = (*np.ptp(cover.points, axis=0), *np.ptp(body.position, axis=0), body.shape.halves.max())
    size = float(max(spans))
    start = max(float(((facing - middle) @ outward).max(initial=0.0)), 0.0) + 4 * size
    ahead = replace(body, position=body.position + start * outward)
    gap = ahead.measure_gaps(facing, np.broadcast_to(outward, facing.shape))
    if not np.isfinite(gap).any():
        _refuse_small(facing, middle, outward)
        raise MissedArrayError("the indenter never touches the cover; check its position and direction")
    return replace(ahead, position=ahead.position - gap.min() * outward)


def _refuse_small(points: FloatArray, middle: FloatArray, outward: FloatArray) -> None:
    """Refuse an indenter that fits between the points of a cover.

    Args:
        points: Points of the cover, shape (n, 3) [m].
        middle: Middle of the indenter, shape (3,) [m].
        outward: Direction against which the indenter moves, unit vector, shape (3,) [-].

    Raises:
        FastModelError: If the path of the indenter's middle passes a point at less than the spacing of the points.
    """
    if len(points) <= 4:  # noqa: PLR2004 -- the neighbours whose distance counts as the spacing
        return
    flat = points - np.outer((points - middle) @ outward, outward)
    tree = cKDTree(flat)
    beside, nearest = tree.query(middle)
    spacing = float(np.max(tree.query(flat[nearest], 5)[0]))
    if beside <= spacing:
        raise FastModelError(
            f"the indenter fits between the points of the fast model, {1e3 * spacing:.2g} mm apart; press by finite "
            "elements, use a wider indenter, or derive the cover with smaller elements"
        )
