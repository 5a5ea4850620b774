"""Solve the contact of a rigid indenter with a curved top at small strain, frictionless or without slip.

The unknowns are the forces of the shape functions of the contact pressure (hats; `pressure_shapes`), one for each node
of the top.  The gap is the distance to the indenter along the undeformed normals.  Hats in contact have a mean gap of
zero and a positive force.  All other hats have a positive mean gap and no force.  The set of hats in contact is found
by block principal pivoting (Judice and Pires 1994).  The compliance of a node needs one solution of the factorised
solid for each direction of the force.  It is computed when the node first bears a force, and stored.

Without slip a point of the top moves with the indenter after contact.  The traction depends on the displacement of each
point at its first contact, so the indenter is followed in steps of about equal growth of the contact.  The forces of
hats then act along and across the normal. Across the normal the mean displacement of a hat in contact is the
displacement of the indenter since first contact of the hat.  The time of first contact within a step is estimated from
the rate at which the gap closed in the previous step.  A hat that would be under tension if it stuck, as at the border
of the contact, slides in this step and sticks afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fem_reference.curved_cover.pressure_shapes import GapSampler, MeanGaps
from fem_reference.curved_cover.responses import find_top
from fem_reference.curved_cover.solid import CoverSolid
from fem_reference.errors import ConvergenceError, PiercedError, TooShallowError
from fem_reference.finite_strain.loading_path import Control
from fem_reference.small_strain_contact.constrained_solver import Exchange
from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class SolidContactSettings:
    """Limits and tolerances of the contact with a curved top, and of the search for a load."""

    #: Number of unit forces on the top that are solved for at once, to limit the memory [-].
    block: int = 64
    #: Largest number of changes of the set of hats (shape functions of the pressure) in contact [-].
    exchanges: int = 200
    #: Largest number of successive changes in which all wrong hats enter or leave the contact without a new minimum of
    #: the number of wrong hats [-].  After that only one hat changes at a time.
    patience: int = 8
    #: Largest accepted overlap under a hat without contact, over the deepest overlap of the undeformed top [-].
    negligible: float = 1e-9
    #: Additional compliance of each hat, over the sum of the compliances of all hats in contact [-].  Without it the
    #: equations are singular under an indenter smaller than a facet, where the hats are linearly dependent.
    soft: float = 1e-8
    #: Gap over the deepest overlap below which a hat, a shape function of the pressure, counts towards the area of
    #: contact [-].  Near a sharp edge the pressure oscillates, and hats next to large forces have small gaps.
    closed: float = 0.02
    #: Largest difference between the load and its target, over the target [-].
    load_error: float = 1e-7
    #: Largest number of depths that are tried in the search for a load [-].
    steps: int = 60
    #: Number of steps in the search for a load after which the interval of depths is bisected instead of a secant step
    #: [-].  Bisection also shrinks the interval where secant steps do not.
    bisect: int = 5
    #: Number of hats (shape functions of the pressure) in contact at the depth at which the search for a load starts
    #: [-].
    first_nodes: int = 4


_SETTINGS = SolidContactSettings()

#: Number of steps to the target without slip [-].  Under a ball, twice as many steps change the force by less than 0.2
#: %.
STEPS = 16


class TopCompliance:
    """Displacements of the m nodes of a top per force on one node, along d directions at each node.

    A place is one direction at one node; place d * node + i is the i-th direction of the node.

    Args:
        solid: Factorised cover.
        vectors: Whether the directions are x, y and z; else only that against the normal.

    Attributes:
        directions: The directions, shape (m, d, 3) [-].
    """

    def __init__(self, solid: CoverSolid, *, vectors: bool = False) -> None:
        self.solid, self.top = solid, find_top(solid.mesh)
        self.directions = -self.top.normals[:, None]
        if vectors:
            self.directions = np.broadcast_to(np.eye(3), (len(self.top.nodes), 3, 3))
        self._rows: dict[int, FloatArray] = {}

    def rows(self, loaded: IntArray) -> FloatArray:
        """Return the displacements of all places of the top per unit force on each of k places.

        Args:
            loaded: Indices of the loaded places, shape (k,).

        Returns:
            Displacements, shape (k, m * d) [m/N].
        """
        missing = np.array([place for place in loaded.tolist() if place not in self._rows], dtype=np.int64)
        count = self.directions.shape[1]
        for start in range(0, len(missing), _SETTINGS.block):
            part = missing[start : start + _SETTINGS.block]
            forces = np.zeros((len(part), len(self.solid.nodes), 3))
            forces[np.arange(len(part)), self.top.index[part // count]] = self.directions[part // count, part % count]
            moved = self.solid.solve(self.top.index, forces=forces)
            found = np.einsum("kmc,mdc->kmd", moved, self.directions, optimize=True).reshape(len(part), -1)
            self._rows.update(zip(part.tolist(), found, strict=True))
        return np.array([self._rows[place] for place in loaded.tolist()]).reshape(len(loaded), -1)

    def add_up(self, forces: FloatArray) -> FloatArray:
        """Return the force vectors on the nodes from forces on the places, shape (m, 3) [N]."""
        return np.asarray(np.einsum("md,mdc->mc", forces.reshape(self.directions.shape[:2]), self.directions))


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactForces:
    """Contact of an indenter in one position with the m nodes of a top.

    Attributes:
        forces: Force of the pressure of each hat, opposite to the normal, never negative, shape (m,) [N].
        nodal: Nodal forces, by the shape functions of the displacement, equivalent to the pressures of the hats and to
            the shear of sticking hats, shape (m, 3) [N].
        area: Area of the hats in contact and of those whose gap is below 2 % of the depth [m2].
        travel: Distance by which the indenter moved from its pose, along its direction [m].
        load: Force of the indenter on the cover along its direction [N].
        stiffness: Increase of the load per travel with the same hats in contact [N/m].
        shear: Force of the indenter on the cover across the normal of each hat, shape (m, 3) [N]; None if frictionless.
    """

    forces: FloatArray
    nodal: FloatArray
    area: float
    travel: float
    load: float
    stiffness: float
    shear: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """Forces and displacements for a given set of hats in contact.

    Attributes:
        forces: Forces of the h hats along d directions, the first against the normal, shape (h, d) [N].
        change: Derivative of `forces` with respect to the travel of the indenter, shape (h, d) [N/m].
        moved: Displacement of each place of the `TopCompliance`, that is of each node along each direction, shape
            (places,) [m].
        remaining: Mean gap under each hat in the deformed state, shape (h,) [m].
        touching: Whether each hat is in contact, shape (h,).
        sliding: Whether each hat is in contact and slides in this step, shape (h,).
    """

    forces: FloatArray
    change: FloatArray
    moved: FloatArray
    remaining: FloatArray
    touching: BoolArray
    sliding: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Equations:
    """Equations of the forces of h hats along d directions.

    Attributes:
        compliance: Compliance of the top.
        gaps: Mean gaps of the undeformed top.
        loads: Force on each place of the compliance (row) per unit force of a hat along one of its directions (column
            d * hat + i for direction i), shape (places, h * d) [-].
        goals: Mean displacement of each hat along each direction if the hat is in contact, shape (h, d) [m].
        rates: Derivative of `goals` with respect to the travel of the indenter, shape (h, d) [-].
    """

    compliance: TopCompliance
    gaps: MeanGaps
    loads: sp.csc_matrix
    goals: FloatArray
    rates: FloatArray

    def find_forces(self, touching: BoolArray) -> _Found:
        """Find the hats in contact and their forces.

        Args:
            touching: First guess of the hats in contact, shape (h,).

        Raises:
            ConvergenceError: If the active set does not converge.
        """
        released, sliding = np.zeros((2, len(touching)), dtype=bool)
        least = _SETTINGS.negligible * float(self.gaps.gap.min(initial=0.0))
        exchange = Exchange(len(touching), _SETTINGS.patience)
        for _ in range(_SETTINGS.exchanges):
            found = self._solve(touching, sliding & touching)
            wrong = np.where(touching, found.forces[:, 0] < 0, found.remaining < least)
            if not wrong.any():
                return found
            wrong = exchange.choose(wrong)
            # Without slip, exchanges of single hats can cycle, because a hat that sticks again has another force.  A
            # hat that enters the contact a second time therefore slides in this step.
            if exchange.is_single:
                sliding |= wrong & ~touching & released
                released |= wrong & touching
            touching = touching ^ wrong
        raise ConvergenceError(f"the contact did not settle in {_SETTINGS.exchanges} exchanges")

    def _solve(self, touching: BoolArray, sliding: BoolArray) -> _Found:
        """Solve for the contact forces if the hats (shape functions of the pressure) in contact are given.

        Args:
            touching: Whether each of h hats is in contact, shape (h,).
            sliding: Whether each hat is in contact and slides without friction, shape (h,).
        """
        count, d = self.goals.shape
        kept = np.flatnonzero(np.column_stack([touching, *[touching & ~sliding] * (d - 1)]))
        forces, change = np.zeros((2, count, d))
        moved, remaining = np.zeros(self.loads.shape[0]), self.gaps.gap
        if len(kept):
            loads = self.loads[:, kept]
            loaded = np.flatnonzero(np.diff(loads.tocsr().indptr))
            each = loads[loaded].T @ self.compliance.rows(loaded)
            own = np.asarray(loads.T @ each.T)
            softness = np.broadcast_to(self.gaps.softness, count)
            own[np.diag_indices(len(kept))] += softness[kept // d] + _SETTINGS.soft * np.trace(own)
            goals = np.stack([self.goals.ravel()[kept], self.rates.ravel()[kept]], axis=1)
            forces.flat[kept], change.flat[kept] = np.linalg.solve(own, goals).T
            moved = forces.flat[kept] @ each
            remaining = self.gaps.gap + self.loads[:, ::d].T @ moved + softness * forces[:, 0]
        return _Found(
            forces=forces, change=change, moved=moved, remaining=remaining, touching=touching, sliding=sliding
        )


class MeshPress:
    """Frictionless contact of one indenter on one mesh, at a depth or under a load.

    Args:
        compliance: Compliance of the top of the mesh.
        sampler: Points of the top that the indenter can touch.
        direction: Unit direction of the motion, shape (3,).
        touch: Travel to the first touch [m].
        deepest: Largest depth that is solved [m].

    Attributes:
        sampler: Points of the top that the indenter can touch.
        touch: Travel to the first touch [m].
    """

    def __init__(
        self, compliance: TopCompliance, sampler: GapSampler, direction: FloatArray, touch: float, deepest: float
    ) -> None:
        self._compliance, self.sampler, self._direction = compliance, sampler, direction
        self.touch, self._deepest = touch, deepest

    def to(self, target: float, control: Control, steps: int = STEPS) -> ContactForces:  # noqa: ARG002 -- no path
        """Solve for the contact under a load [N] or at a depth [m].

        Raises:
            TooShallowError: If the contact is too small for the shape functions of the pressure.
            PiercedError: If the indenter would go through most of the cover.
            ConvergenceError: If the contact or the depth at a load does not converge.
        """
        found = self.at_depth(target) if control == "depth" else self.under_load(target)
        if not found.load > 0:
            raise TooShallowError(
                f"at a depth of {1e3 * target:.3g} mm the indenter touches less than the mesh of the cover resolves; "
                "use a larger depth or a finer mesh"
            )
        return found

    def at_depth(self, depth: float) -> ContactForces:
        """Solve the contact of the indenter with the top at a depth [m]."""
        if depth > self._deepest:
            raise PiercedError(
                f"at a depth of {1e3 * depth:.4g} mm the indenter would go through most of the cover; use at most "
                f"{1e3 * self._deepest:.4g} mm",
                "depth",
            )
        return self._solve(self.touch + depth)

    def _solve(self, travel: float) -> ContactForces:
        """Solve the contact after the indenter moved by a distance from its pose [m]."""
        gaps = self.sampler.at(travel)
        equations = _Equations(
            compliance=self._compliance,
            gaps=gaps,
            loads=gaps.spread,
            goals=-gaps.gap[:, None],
            rates=gaps.rate[:, None],
        )
        return self._describe(equations, equations.find_forces(gaps.gap < 0), travel)

    def _describe(self, equations: _Equations, found: _Found, travel: float) -> ContactForces:
        """Compute load, area and nodal forces of a solved contact after a travel of the indenter [m]."""
        gaps, compliance = equations.gaps, self._compliance
        nodal, more = (compliance.add_up(equations.loads @ each.ravel()) for each in (found.forces, found.change))
        closed = found.remaining < -_SETTINGS.closed * gaps.gap.min(initial=0.0)
        return ContactForces(
            forces=found.forces[:, 0],
            nodal=nodal,
            area=float(gaps.area[closed].sum()),
            travel=travel,
            load=float((nodal @ self._direction).sum()),
            stiffness=float((more @ self._direction).sum()),
        )

    def under_load(self, load: float, *, start: float | None = None, least: float = 0.0) -> ContactForces:
        """Find the depth at which the indenter bears a load, by the secant method between bounds.

        The first step uses the stiffness of the contact, which neglects the growth of the contact within a hat.

        Args:
            load: The load [N].
            start: Depth at which the search starts; None starts where a few hats are in contact [m].
            least: Lower bound of the depth [m].
        """
        low, high = least, np.inf
        depth, before = self._deepest / 128 if start is None else start, None
        while start is None and depth < self._deepest:
            if (self.at_depth(depth).forces > 0).sum() >= _SETTINGS.first_nodes:
                break
            depth = min(2 * depth, self._deepest)
        for number in range(1, _SETTINGS.steps + 1):
            contact = self.at_depth(min(depth, self._deepest))
            excess = contact.load - load
            if abs(excess) <= _SETTINGS.load_error * load:
                return contact
            if excess < 0 and depth >= self._deepest:
                raise PiercedError(
                    f"{load:.4g} N would press the indenter through most of the cover; use at most {contact.load:.3g} "
                    "N, a wider indenter or a stiffer cover",
                    "load",
                )
            low, high = (depth, high) if excess < 0 else (low, depth)
            slope = contact.stiffness
            if before is not None and (contact.load - before[1]) * (depth - before[0]) > 0:
                slope = (contact.load - before[1]) / (depth - before[0])
            before = depth, contact.load
            depth = min(depth - excess / slope, self._deepest) if slope > 0 else self._deepest
            if not low < depth < high or (number % _SETTINGS.bisect == 0 and np.isfinite(high)):
                depth = (low + high) / 2 if np.isfinite(high) else self._deepest
        raise ConvergenceError(f"the depth under {load:.4g} N was not found in {_SETTINGS.steps} steps")


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """Contact after a step of a path without slip.

    Attributes:
        travel: Distance by which the indenter moved from its pose [m].
        moved: Displacements of the m nodes of the top, shape (m, 3) [m].
        touching: Whether each of the m hats is in contact, shape (m,).
        record: Mean displacement of each hat minus that of the indenter, shape (m, 3) [m].  It is constant while the
            hat sticks.
        before: State of the previous step.
    """

    travel: float
    moved: FloatArray
    touching: BoolArray
    record: FloatArray
    before: _State | None = None


class StickingPress(MeshPress):
    """Contact of one indenter without slip on one mesh; see `MeshPress`.

    The compliance of the top needs the directions x, y and z at each node.
    """

    def to(self, target: float, control: Control, steps: int = STEPS) -> ContactForces:
        """Follow the indenter to a load [N] or a depth [m] in a number of steps; see `MeshPress.to`."""
        count = len(self._compliance.top.nodes)
        self._spread = self.sampler.spread_whole().T
        self._state = self._next = _State(
            travel=self.touch,
            moved=np.zeros((count, 3)),
            touching=np.zeros(count, dtype=bool),
            record=np.zeros((count, 3)),
        )
        # If the whole depth were one step, points that touch late would stick at their position in the unloaded state.
        # This solution only gives the final depth.
        whole = super().to(target, control)
        for number in range(1, steps):
            # Steps of the root of the depth make the contact of a round body grow evenly, because its width is
            # proportional to that root.
            contact = self.at_depth((whole.travel - self.touch) * (number / steps) ** 2)
            if control == "load" and contact.load >= target:
                break
            self._state = self._next
        if control == "depth":
            return self.at_depth(target)
        return self.under_load(target, start=whole.travel - self.touch, least=self._state.travel - self.touch)

    def _solve(self, travel: float) -> ContactForces:
        """Solve the contact at a travel [m] in one step after the last state, and store the new state."""
        gaps, normals, last = self.sampler.at(travel), self._compliance.top.normals, self._state
        record = self._record_touch(gaps, travel)
        mean = gaps.spread.T @ normals
        first = _normalise(np.cross(mean, np.eye(3)[np.argmin(np.abs(mean), axis=1)]))
        tangents = np.stack([first, _normalise(np.cross(mean, first))], axis=1)
        aims = tangents @ (record + travel * self._direction)[:, :, None]
        equations = _Equations(
            compliance=self._compliance,
            gaps=gaps,
            loads=_load_vectors(gaps.spread, normals, tangents),
            goals=np.column_stack([-gaps.gap, aims[..., 0]]),
            rates=np.column_stack([gaps.rate, tangents @ self._direction]),
        )
        found = equations.find_forces((last.touching | (gaps.gap < 0)) & np.isfinite(gaps.gap))
        moved = found.moved.reshape(-1, 3)
        here = self._spread @ moved - travel * self._direction
        record = np.where(found.sliding[:, None], here, record)
        self._next = _State(travel=travel, moved=moved, touching=found.touching, record=record, before=last)
        shear = np.einsum("mj,mjc->mc", found.forces[:, 1:], tangents)
        return replace(self._describe(equations, found, travel), shear=shear)

    def _record_touch(self, gaps: MeanGaps, travel: float) -> FloatArray:
        """Return the mean displacement of every hat minus that of the indenter at the end of a step, shape (m, 3) [m].

        This record is unchanged for hats in contact, which stick.  For all other hats it is predicted at the time of
        their first contact, which follows from the gap and from the rate at which the gap closes.
        """
        last, before, normals = self._state, self._state.before, self._compliance.top.normals
        step = travel - last.travel
        speed = np.zeros_like(last.moved)
        if before is not None:
            speed = (last.moved - before.moved) / (last.travel - before.travel)
        opened, opening = (-self._spread @ np.einsum("mc,mc->m", normals, each) for each in (last.moved, speed))
        closing = gaps.rate - opening
        gap = gaps.gap + gaps.rate * step + opened
        reaches = np.isfinite(gap) & (closing > 0)
        ahead = np.clip(np.where(reaches, gap, 0.0) / np.where(reaches, closing, 1.0), 0.0, step)[:, None]
        predicted = self._spread @ last.moved + ahead * (self._spread @ speed)
        predicted -= (last.travel + ahead) * self._direction
        return np.where(last.touching[:, None], last.record, predicted)


def _normalise(vectors: FloatArray) -> FloatArray:
    """Divide vectors, shape (m, 3), by their lengths; zero vectors stay."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _load_vectors(spread: sp.csc_matrix, normals: FloatArray, tangents: FloatArray) -> sp.csc_matrix:
    """Return the forces on the nodes per unit force of each hat, shape (3 m, 3 m) [-].

    Row 3 i + c is the component c (x, y or z) of the force on node i.  Column 3 j + d is the direction d of the force
    of hat j: against the normal, then along the two tangents.

    Args:
        spread: Force on each node (row) per unit force of each hat (column), shape (m, m) [-].
        normals: Normals of the nodes, shape (m, 3) [-].
        tangents: Two directions across the mean normal of each hat, shape (m, 2, 3) [-].
    """
    share = spread.tocoo()
    along = np.concatenate([-normals[share.row][:, None], tangents[share.col]], axis=1) * share.data[:, None, None]
    axis = np.arange(3)
    rows = np.broadcast_to(3 * share.row[:, None, None] + axis, along.shape)
    columns = np.broadcast_to(3 * share.col[:, None, None] + axis[:, None], along.shape)
    size = 3 * spread.shape[0], 3 * spread.shape[1]
    return sp.csc_matrix((along.ravel(), (rows.ravel(), columns.ravel())), shape=size)
