"""Solve the contact of a rigid indenter with a curved top at small strain without slip.

A point of the top that the indenter has touched moves with it.  The traction therefore depends on how far each point
had moved when it was touched, and the indenter is followed in steps of about equal growth of the contact.  As without
friction, the unknowns are forces of hats (`pressure_shapes`), here along and across the normal: hats in contact have no
mean gap, and across the normal their mean displacement is that of the indenter since they were touched.  When a hat is
touched between two steps follows from how fast its gap closed in the step before.  A hat whose stick would pull it off
the indenter again, as at the border of the contact, slides in that step and sticks from there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from fem_reference.curved_cover.compliance import VectorCompliance
from fem_reference.curved_cover.contact import EXCHANGES, NEGLIGIBLE, SOFT, ContactForces, Exchange, describe_contact
from fem_reference.curved_cover.grid_press import GridPress
from fem_reference.curved_cover.pressure_shapes import MeanGaps
from fem_reference.errors import ConvergenceError
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Number of steps to the target: under a ball twice as many change the force by less than 0.2 % [-].
STEPS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """Contact after a step of the path.

    Attributes:
        travel: Distance by which the indenter moved from its pose [m].
        moved: Displacements of the w nodes that can be touched, shape (w, 3) [m].
        touching: Whether each of the m hats is in contact, shape (m,).
        record: Mean displacement less the motion of the indenter with which each hat sticks, shape (m, 3) [m].
        before: The state one step earlier.
    """

    travel: float
    moved: FloatArray
    touching: BoolArray
    record: FloatArray
    before: _State | None = None


class StickingPress(GridPress):
    """Contact without slip of one indenter on one mesh, at a depth or under a load; see `GridPress`."""

    def to(self, target: float, control: Literal["load", "depth"], steps: int = STEPS) -> ContactForces:
        """Follow the indenter to a load [N] or a depth [m] in a number of steps.

        Raises:
            TooShallowError: If the indenter touches less than the shapes of the pressure resolve.
            PiercedError: If the indenter would go through most of the cover.
            ConvergenceError: If the contact or the load is not found.
        """
        self._start()
        # In one step from first touch, points that are touched late stick where they were without load.
        whole = super().to(target, control)
        for number in range(1, steps):
            # The width of the contact of a round body grows with the root of the depth.
            depth = (whole.travel - self.touch) * (number / steps) ** 2
            contact, state = self._solve(depth)
            if control == "load" and contact.load >= target:
                break
            self._state = state
        if control == "depth":
            return self.at_depth(target)
        return self.under_load(target, start=whole.travel - self.touch, least=self._state.travel - self.touch)

    def at_depth(self, depth: float) -> ContactForces:
        """Solve the contact at a depth that is reached in one step from the last state [m]."""
        self._check_depth(depth)
        return self._solve(depth)[0]

    def _start(self) -> None:
        """Begin a path at first touch."""
        top = self._compliance.top
        self._spread = self._sampler.spread_whole()
        self._seen = self._sampler.nodes
        count = len(top.nodes)
        self._state = _State(
            travel=self.touch,
            moved=np.zeros((len(self._seen), 3)),
            touching=np.zeros(count, dtype=bool),
            record=np.zeros((count, 3)),
        )

    def _solve(self, depth: float) -> tuple[ContactForces, _State]:
        """Solve the contact at a depth [m], one step after the last state."""
        travel, top = self.touch + depth, self._compliance.top
        gaps = self._sampler.at(travel)
        record = self._record_touch(gaps, travel)
        hats = _Hats.on(gaps, top.normals, self._seen)
        aims = hats.tangents @ (record + travel * self._direction)[:, :, None]
        step = _Step(
            compliance=self._compliance.vectors, gaps=gaps, hats=hats, aims=aims[..., 0], direction=self._direction
        )
        found = step.find_forces(self._state.touching)
        contact = describe_contact(
            top, gaps, travel, self._direction,
            forces=found.forces[:, 0], nodal=found.nodal, stiffness=found.stiffness, remaining=found.remaining,
        )  # fmt: skip
        contact = replace(contact, shear=np.einsum("mj,mjc->mc", found.forces[:, 1:], hats.tangents))
        here = self._spread[self._seen].T @ found.moved - travel * self._direction
        record = np.where(found.sliding[:, None], here, record)
        state = _State(travel=travel, moved=found.moved, touching=found.touching, record=record, before=self._state)
        return contact, state

    def _record_touch(self, gaps: MeanGaps, travel: float) -> FloatArray:
        """Return what each hat keeps from its touch, predicted for those that are not in contact, shape (m, 3) [m]."""
        last, before = self._state, self._state.before
        step, spread = travel - last.travel, self._spread[self._seen].T
        normals = self._compliance.top.normals[self._seen]
        speed = np.zeros_like(last.moved)
        if before is not None:
            speed = (last.moved - before.moved) / (last.travel - before.travel)
        opened, opening = (-spread @ np.einsum("wc,wc->w", normals, each) for each in (last.moved, speed))
        closing = gaps.rate - opening
        gap = gaps.gap + gaps.rate * step + opened
        reaches = np.isfinite(gap) & (closing > 0)
        ahead = np.clip(np.where(reaches, gap, 0.0) / np.where(reaches, closing, 1.0), 0.0, step)[:, None]
        predicted = spread @ last.moved + ahead * (spread @ speed) - (last.travel + ahead) * self._direction
        return np.where(last.touching[:, None], last.record, predicted)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Hats:
    """Force of each of m hats along and across the normal, on the w nodes of the top that can be touched.

    Attributes:
        seen: Indices of these nodes in the top, shape (w,).
        spread: Force on each of these nodes per unit force of each hat, shape (w, m) [-].
        normals: Normals of the nodes, shape (w, 3) [-].
        tangents: Two directions across the mean normal of each hat, shape (m, 2, 3) [-].
    """

    seen: IntArray
    spread: sp.csc_matrix
    normals: FloatArray
    tangents: FloatArray

    @classmethod
    def on(cls, gaps: MeanGaps, normals: FloatArray, seen: IntArray) -> _Hats:
        """Place the forces of the hats."""
        mean = gaps.spread.T @ normals
        first = np.cross(mean, np.eye(3)[np.argmin(np.abs(mean), axis=1)])
        first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), np.finfo(float).tiny)
        second = np.cross(mean, first)
        second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), np.finfo(float).tiny)
        return cls(
            seen=seen,
            spread=sp.csc_matrix(gaps.spread.tocsr()[seen]),
            normals=normals[seen],
            tangents=np.stack([first, second], axis=1),
        )

    def load(self, hats: IntArray) -> FloatArray:
        """Return the forces on the nodes per unit force of k hats, shape (k, 3, w, 3) [-]."""
        share = self.spread[:, hats].toarray().T
        normal = -share[:, None, :, None] * self.normals
        return np.concatenate([normal, share[:, None, :, None] * self.tangents[hats][:, :, None, :]], axis=1)

    def measure(self, moved: FloatArray) -> FloatArray:
        """Return the mean displacements of all hats against and across the normal, for k fields, shape (k, m, 3) [m].

        Args:
            moved: Displacements of the nodes, shape (k, w, 3) [m].
        """
        count = len(moved)
        fields = np.concatenate([np.einsum("kwc,wc->kw", moved, -self.normals)[..., None], moved], axis=2)
        mean = (self.spread.T @ fields.transpose(1, 0, 2).reshape(len(self.seen), -1)).reshape(-1, count, 4)
        across = np.einsum("mkc,mjc->kmj", mean[..., 1:], self.tangents, optimize=True)
        return np.concatenate([mean[..., 0].T[..., None], across], axis=2)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """Solution with given hats in contact.

    Attributes:
        forces: Forces of the m hats along and across the normal, shape (m, 3) [N].
        nodal: Forces on the m nodes of the top, shape (m, 3) [N].
        stiffness: Increase of the load per travel [N/m].
        remaining: Mean gap under each hat, shape (m,) [m].
        moved: Displacements of the w nodes that can be touched, shape (w, 3) [m].
        touching: Whether each hat is in contact, shape (m,).
        sliding: Whether it is, and slides in this step, shape (m,).
    """

    forces: FloatArray
    nodal: FloatArray
    stiffness: float
    remaining: FloatArray
    moved: FloatArray
    touching: BoolArray
    sliding: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """Equations of one step of the indenter.

    Attributes:
        compliance: Compliance of the nodes of the top.
        gaps: Mean gaps of the m hats of the undeformed top.
        hats: Directions of their forces.
        aims: Mean displacements across the normal with which hats stick, shape (m, 2) [m].
        direction: Unit direction of the motion, shape (3,).
    """

    compliance: VectorCompliance
    gaps: MeanGaps
    hats: _Hats
    aims: FloatArray
    direction: FloatArray

    def find_forces(self, before: BoolArray) -> _Found:
        """Find the hats in contact and their forces, by exchanges as without friction.

        Args:
            before: Whether each hat was in contact in the last step, shape (m,).

        Raises:
            ConvergenceError: If the hats in contact are not found.
        """
        touching = (before | (self.gaps.gap < 0)) & np.isfinite(self.gaps.gap)
        released, sliding = np.zeros((2, len(touching)), dtype=bool)
        least = NEGLIGIBLE * float(self.gaps.gap.min(initial=0.0))
        exchange = Exchange(len(touching))
        for _ in range(EXCHANGES):
            found = self._solve(touching, sliding & touching)
            wrong = np.where(touching, found.forces[:, 0] < 0, found.remaining < least)
            if not wrong.any():
                return found
            wrong = exchange.choose(wrong)
            if exchange.is_single:  # such exchanges can cycle: a hat that sticks again has another force
                sliding |= wrong & ~touching & released
                released |= wrong & touching
            touching = touching ^ wrong
        raise ConvergenceError(f"the contact did not settle in {EXCHANGES} exchanges")

    def _solve(self, touching: BoolArray, sliding: BoolArray) -> _Found:
        """Solve for the forces with given hats in contact, some of which slide without friction."""
        hats, count = self.hats, len(touching)
        held = np.flatnonzero(touching)
        forces, nodal, moved = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((len(hats.seen), 3))
        stiffness, remaining = 0.0, self.gaps.gap
        if len(held):
            kept = np.flatnonzero(np.column_stack([touching, ~sliding, ~sliding])[held])
            loads = hats.load(held).reshape(3 * len(held), -1, 3)[kept]
            loaded = np.flatnonzero(np.abs(loads).max(axis=(0, 2)) > 0)
            columns = self.compliance.columns(hats.seen[loaded], hats.seen).reshape(3 * len(loaded), -1)
            each = (loads[:, loaded].reshape(len(kept), -1) @ columns).reshape(len(kept), -1, 3)
            mean = hats.measure(each)
            own = mean[:, held].reshape(len(kept), -1)[:, kept]
            own[np.diag_indices(len(kept))] += SOFT * np.trace(own)
            goals = np.column_stack([-self.gaps.gap, self.aims])[held].ravel()[kept]
            rates = np.column_stack([self.gaps.rate, hats.tangents @ self.direction])[held].ravel()[kept]
            solved, change = np.linalg.solve(own.T, np.stack([goals, rates], axis=1)).T
            forces[held[kept // 3], kept % 3] = solved
            nodal[hats.seen] = np.tensordot(solved, loads, 1)
            stiffness = float((np.tensordot(change, loads, 1) @ self.direction).sum())
            remaining = self.gaps.gap + solved @ mean[..., 0]
            moved = np.tensordot(solved, each, 1)
        return _Found(
            forces=forces, nodal=nodal, stiffness=stiffness, remaining=remaining, moved=moved,
            touching=touching, sliding=sliding,
        )  # fmt: skip
