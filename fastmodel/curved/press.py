"""Press a rigid indenter on a curved cover at a pose, under a load, without a simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from fastmodel.bench import add_geoms
from fastmodel.contact.panels import Wrench
from fastmodel.curved.cover import CurvedCover
from fastmodel.curved.gaps import measure_gaps
from fastmodel.curved.pressure import solve_pressure
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pose import rotate
from fastmodel.pressure.gap import describe_solid
from fastmodel.pressure.gap_sampling import BodyShape, PosedBody
from meshes import Indenter
from meshes.array_types import FloatArray, IntArray
from meshes.pose import Pose

#: Number of neighbours of a point whose distance counts as the spacing of the points [-].
_NEIGHBOURS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedPress:
    """Result of a press on a curved cover by the fast model.

    Attributes:
        texel_forces: Force on each of n texels along its normal, shape (n,) [N].
        forces: Force on each of m points of the surface against its normal, shape (m,) [N].
        force: Force of the indenter on the cover, shape (3,) [N].
        points: Number of points in contact [-].
    """

    texel_forces: FloatArray
    forces: FloatArray
    force: FloatArray
    points: int


def press_curved(
    cover: CurvedCover,
    indenter: Indenter,
    pose: Pose,
    *,
    load: float,
    direction: npt.ArrayLike | None = None,
) -> CurvedPress:
    """Press an indenter that moves along a direction without turning; a guide bears the forces across it.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its way.
        load: Force along the direction [N].
        direction: Direction of motion, any length, shape (3,); that in which the indenter looks if None.

    Raises:
        FastModelError: If the load is not positive, the contact was not found, or the indenter fits between the points
            of the cover.
        MissedArrayError: If the indenter never touches the cover.
    """
    if not 0 < load < np.inf:
        raise FastModelError(f"load must be positive, not {load} N")
    towards = pose.towards if direction is None else np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    wrench = Wrench(
        force=load, moment=np.zeros(3), tilts=False, vector=load * outward, directions=outward[None], rotates=False
    )
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    found = solve_pressure(cover, [body], [wrench])
    if not found.points.any():
        _refuse_small(cover.points, _find_middle(body), outward)
    if not found.settled:
        raise FastModelError(f"the contact under {load:.4g} N was not found; use a smaller load")
    return CurvedPress(
        texel_forces=cover.influence @ found.forces,
        forces=found.forces,
        force=-found.forces @ cover.normals,
        points=int(found.points[0]),
    )


def find_first_contact(
    cover: CurvedCover, indenter: Indenter, pose: Pose, direction: npt.ArrayLike, *, within: float
) -> IntArray:
    """Find the points of the undeformed cover that a rigid indenter reaches first: contact of two rigid bodies.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its way.
        direction: Direction of motion, any length, shape (3,).
        within: Distance along the direction up to which points count as reached with the first [m].

    Returns:
        Indices of the points.

    Raises:
        MissedArrayError: If the indenter never touches the cover.
    """
    towards = np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    facing = np.flatnonzero(cover.normals @ outward > 0)
    gap = measure_gaps(body, cover.points[facing], np.broadcast_to(outward, (len(facing), 3)))
    return np.asarray(facing[gap <= within])


def pose_indenter(indenter: Indenter, pose: Pose) -> PosedBody:
    """Describe the solids of an indenter at a pose, in the array's frame."""
    spec = mujoco.MjSpec()
    add_geoms(spec, spec.worldbody.add_body(), indenter)
    model = spec.compile()
    geoms = range(model.ngeom)
    turns = np.array([rotate(quaternion, np.eye(3)).T for quaternion in model.geom_quat])
    return PosedBody(
        shape=BodyShape(solids=tuple(describe_solid(model, geom) for geom in geoms)),
        rotation=pose.rotation @ turns,
        position=pose.position + model.geom_pos @ pose.rotation.T,
    )


def _move_to_touch(cover: CurvedCover, body: PosedBody, outward: FloatArray) -> PosedBody:
    """Move a body along a direction, unit vector against `outward`, until it touches a point of the undeformed cover.

    Raises:
        MissedArrayError: If it never does.
    """
    facing = cover.points[cover.normals @ outward > 0]
    middle = _find_middle(body)
    # far in front of the cover, so that the whole body lies ahead of every point
    spans = (*np.ptp(cover.points, axis=0), *np.ptp(body.position, axis=0), body.shape.halves.max())
    size = float(max(spans))
    start = max(float(((facing - middle) @ outward).max(initial=0.0)), 0.0) + 4 * size
    ahead = replace(body, position=body.position + start * outward)
    gap = measure_gaps(ahead, facing, np.broadcast_to(outward, facing.shape))
    if not np.isfinite(gap).any():
        _refuse_small(facing, middle, outward)
        raise MissedArrayError("the indenter never touches the cover; check its position and direction")
    return replace(ahead, position=ahead.position - gap.min() * outward)


def _find_middle(body: PosedBody) -> FloatArray:
    """Return the mean of the centres of a body's solids, shape (3,) [m]."""
    return np.asarray((body.position + np.einsum("pij,pj->pi", body.rotation, body.shape.centres)).mean(axis=0))


def _refuse_small(points: FloatArray, middle: FloatArray, outward: FloatArray) -> None:
    """Raise a FastModelError if a line against `outward` through the middle of an indenter passes between points."""
    if len(points) <= _NEIGHBOURS:
        return
    flat = points - np.outer((points - middle) @ outward, outward)
    tree = cKDTree(flat)
    beside, nearest = tree.query(middle)
    spacing = float(np.max(tree.query(flat[nearest], _NEIGHBOURS + 1)[0]))
    if beside <= spacing:
        raise FastModelError(
            f"the indenter fits between the points of the fast model, {1e3 * spacing:.2g} mm apart; press by finite "
            "elements, use a wider indenter, or derive the cover with smaller elements"
        )
