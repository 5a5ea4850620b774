"""Forces between rigid bodies and points of a curved cover, by exchange of points between contact and gap.

A point in contact has a force and no gap; any other point has a gap and no force.  The force of every body is
prescribed along one direction; for a body that is free to move in others, these are prescribed too.  The multipliers of
these constraints are the motions of the body.  Points are exchanged in blocks (Judice and Pires 1994), and one at a
time where blocks make no progress (Murty 1974).  The gaps are those of the undeformed cover along its normals; they are
measured again after each motion of a body, until the motion is small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fastmodel.contact.panels import PanelSamples, Wrench
from fastmodel.curved.cover import CurvedCover
from fastmodel.curved.gaps import measure_gaps
from fastmodel.pressure.gap_sampling import PosedBody
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Most exchanges of points, and of exchanges in blocks that do not reduce the number of wrong points [-].
_EXCHANGES, _PATIENCE = 100, 6
#: Overlap below which a point counts as free, over the thickness [-].
_NEGLIGIBLE = 1e-7
#: Most measurements of the gap, and change of a body's position at which they end, over the thickness [-].
_MEASUREMENTS, _SETTLED = 12, 1e-3
#: Height above the smallest gap up to which points are considered, over the thickness [-].
_REACH = 1.0
#: Cosine between a normal and the direction of a body's force, up to which the body does not press on a point [-].
_STEEP = 0.0
#: Share of the load that a body moves by, over its stiffness, to keep the equations regular where points do not
#: determine every motion of the body [-].
_LOOSE = 1e-9
#: Number of points with the smallest gaps that are in contact at first [-].
_FIRST = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedPressure:
    """Forces of all bodies on the m points of a curved cover.

    Attributes:
        forces: Force on each point against its normal, shape (m,) [N].
        travel: Distance that each body moved along the first direction of its load from the given pose, shape
            (bodies,) [m].
        points: Number of points in contact with each body, shape (bodies,) [-].
        owner: Number of the body that is nearest to each point, the only one that can press on it, shape (m,) [-].
        settled: Whether contact and position of every body were found within the tolerances.
    """

    forces: FloatArray
    travel: FloatArray
    points: IntArray
    owner: IntArray
    settled: bool


def solve_pressure(
    cover: CurvedCover, bodies: Sequence[PosedBody], loads: Sequence[Wrench], start: FloatArray | None = None
) -> CurvedPressure:
    """Find the forces of bodies on a cover under given loads.

    Args:
        cover: The cover.
        bodies: Shapes and poses of the bodies in the array's frame; they need not touch.  One that no normal of the
            points reaches has no points in the result, and does not change the forces of the others.
        loads: Force of each body on the cover with its sign reversed, as `Wrench` has it.
        start: Forces of a similar contact, from which the search starts, shape (m,) [N].
    """
    travel = np.zeros(len(bodies))
    touching = None if start is None else start > 0
    for _ in range(_MEASUREMENTS):
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
        columns, target, first = _build_constraints(cover, loads, owner, gap)
        forces, motion, found = _exchange(cover, gap, columns, target, touching)
        touching = forces > 0
        # The travel is what all motions of a body together do along the first: others may almost contain it.
        along = columns[touching][:, first]
        change = (along * (columns[touching] @ motion)[:, None]).sum(axis=0) / np.maximum(
            (along**2).sum(axis=0), np.finfo(float).tiny
        )
        travel = travel + change
        if found and np.abs(change).max() <= _SETTLED * cover.thickness:
            break
    points = np.bincount(owner[touching], minlength=len(bodies))
    return CurvedPressure(forces=forces, travel=travel, points=points, owner=owner, settled=found)


def _solve_without(
    cover: CurvedCover, bodies: Sequence[PosedBody], loads: Sequence[Wrench], missed: BoolArray
) -> CurvedPressure:
    """Find the forces of the bodies that some normal reaches; the others, for example in between points, have none."""
    kept = np.flatnonzero(~missed).tolist()
    travel, points = np.zeros(len(bodies)), np.zeros(len(bodies), dtype=np.int64)
    if not kept:
        count = len(cover.points)
        owner = np.zeros(count, dtype=np.int64)
        return CurvedPressure(forces=np.zeros(count), travel=travel, points=points, owner=owner, settled=False)
    found = solve_pressure(cover, [bodies[each] for each in kept], [loads[each] for each in kept])
    travel[kept], points[kept] = found.travel, found.points
    return replace(found, travel=travel, points=points, owner=np.array(kept)[found.owner])


def _measure(cover: CurvedCover, body: PosedBody, outward: FloatArray, travel: float) -> FloatArray:
    """Measure the gaps of a body that moved against `outward`; infinite where it cannot press, shape (m,) [m]."""
    moved = replace(body, position=body.position - travel * outward)
    gap = measure_gaps(moved, cover.points, cover.normals, behind=cover.thickness)
    gap = np.where(cover.normals @ outward > _STEEP, gap, np.inf)
    lowest = gap.min()
    return np.where(gap <= lowest + _REACH * cover.thickness, gap, np.inf) if np.isfinite(lowest) else gap


def _build_constraints(
    cover: CurvedCover, loads: Sequence[Wrench], owner: IntArray, gap: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Build the columns of motions of all bodies, shape (m, k), their forces (k,), and each body's first column."""
    count = len(cover.points)
    columns: list[FloatArray] = []
    target: list[float] = []
    first = []
    for number, load in enumerate(loads):
        own = np.flatnonzero((owner == number) & np.isfinite(gap))
        zero = np.zeros(count)
        samples = PanelSamples(
            body=owner, row=owner, column=owner, coverage=zero, x=zero, y=zero, gap=gap, place=cover.points,
            normal=cover.normals,
        )  # fmt: skip
        part, wanted = load.build_constraints(samples, own)
        whole = np.zeros((count, part.shape[1]))
        whole[own] = part
        first.append(len(target))
        columns += list(whole.T)
        target += wanted.tolist()
    return np.array(columns).T, np.array(target), np.array(first)


def _exchange(
    cover: CurvedCover, gap: FloatArray, columns: FloatArray, target: FloatArray, touching: BoolArray | None
) -> tuple[FloatArray, FloatArray, bool]:
    """Find the points in contact; return forces, shape (m,) [N], motions, shape (k,) [m], and whether they agree."""
    near = np.isfinite(gap)
    if touching is None or not (touching & near).any():
        touching = np.zeros(len(gap), dtype=bool)
        for column in np.unique(np.abs(columns) > 0, axis=1).T:
            own = np.flatnonzero(column & near)
            touching[own[np.argsort(gap[own])[:_FIRST]]] = True
    touching = touching & near
    loose = _LOOSE / float(np.diag(cover.compliance).mean())
    fewest, patience = len(gap) + 1, _PATIENCE
    forces, motion = np.zeros(len(gap)), np.zeros(len(target))
    for _ in range(_EXCHANGES):
        nodes = np.flatnonzero(touching)
        part = columns[nodes]
        system = np.block([[cover.compliance[np.ix_(nodes, nodes)], -part], [part.T, loose * np.eye(len(target))]])
        solved = np.linalg.solve(system, np.concatenate([-gap[nodes], target]))
        forces = np.zeros(len(gap))
        forces[nodes], motion = solved[: len(nodes)], solved[len(nodes) :]
        remaining = gap + cover.compliance[:, nodes] @ forces[nodes] - columns @ motion
        wrong = np.where(touching, forces < 0, remaining < -_NEGLIGIBLE * cover.thickness)
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
