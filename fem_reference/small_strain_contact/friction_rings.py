"""Solve the contact with friction of an indenter of revolution on a wide cover at small strain, in the r-z plane.

The finite elements give the compliance of the top to a constant pressure and to a radial shear traction on each of n
rings, from one factorisation.  The contact is then solved for the tractions of the rings only.  The indenter approaches
in steps, because slip depends on the loading history.  In each step an active set of open, sticking and sliding rings
is found: no ring pulls, open rings do not penetrate, sticking rings do not move along the indenter, and the shear of
sliding rings is the coefficient of friction times the pressure and opposes the slip (Wriggers, Computational Contact
Mechanics, 2006, sections 4.2 and 5.2).  The solution corrects the accurate frictionless one, see `correct_path`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from fem_reference import result_store
from fem_reference.elements.grading import ON_BOUNDARY, grade_around_edge, growing_steps
from fem_reference.elements.line import Line
from fem_reference.errors import ConvergenceError
from fem_reference.fields.cover_fields import recover_fields
from fem_reference.finite_strain.contact import divide_rings
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.loading_path import Control, LoadingPath, Progress, Units, name_grid, report
from fem_reference.indentation import small_strain
from fem_reference.indentation.finite_strain import SolvedPair, correct_path, pair_grids
from fem_reference.indentation.grid_solution import GridSolution, GridStudy, RadialBase
from fem_reference.linear_response.axisymmetric import RadialCover
from fem_reference.linear_response.surface_compliance import choose_friction_reach
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover, Indenter
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class RingSettings:
    """Constants of the contact with friction on concentric rings, and of the search for the state of the rings."""

    #: Radius of the outermost ring under a curved indenter, over that of the largest contact without friction [-].
    margin: float = 1.2
    #: Rings across the largest contact of a curved indenter, per element through the cover [-].
    rings: int = 6
    #: Steps of the approach of a curved indenter, per element through the cover [-].
    steps: int = 8
    #: Width of the rings at the edge of a flat face over its radius, times the square of the number of elements
    #: through the cover [-].
    edge: float = 0.2
    #: Size ratio of neighbouring elements, minus one, times the number of elements through the cover [-].
    growth: float = 1.2
    #: Number of rings in each of two groups at the edge of the contact [-].  The position of the edge follows from the
    #: ratio of the forces on the two groups.
    fit: int = 2
    #: Relative tolerance of the conditions of contact and slip [-].
    tolerance: float = 1e-9
    #: Number of changes of the active set after which only one ring, the one with the largest violation, changes [-].
    all_at_once: int = 40
    #: Largest number of changes of the active set of rings [-].
    exchanges: int = 2000
    #: Smallest estimated error of a result [-].
    least_error: float = 5e-4


_SETTINGS = RingSettings()


#: Number of elements through the cover on the grids for contact with friction in the r-z plane, coarsest first [-].
#: Three neighbouring grids give a result and its error.
GRIDS = (6, 9, 13, 19, 28)
#: Positions of the Gauss points across a ring, from -1 to 1, and their weights, shape (4,) each [-].
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
#: Lower bound of denominators that may be zero.
_TINY = 1e-300
#: Condition of a ring of the top that is not in contact.
_OPEN = 0
#: Condition of a ring of the top that sticks to the indenter.
_STICKS = 1
#: Condition of a ring of the top that slides, with the shear on the cover directed outwards; all conditions above
#: `_STICKS` slide.
_OUTWARD = 2
#: Condition of a ring of the top that slides, with the shear on the cover directed inwards.
_INWARD = 3


class _Step(NamedTuple):
    """State of the rings after one step of the approach of the indenter, in units of computation.

    Attributes:
        depth: Approach of the indenter.
        traction: Pressures of the n rings, then their shears, shape (2 n,).
        outward: Outward displacement of each ring times its area, shape (n,).
        condition: Condition of each ring, shape (n,).
        gap: Gap between the indenter and each ring times its area, shape (n,).
        rate: Change of `outward` per depth in the last step, shape (n,).
        closing: Decrease of `gap` per depth in the last step, shape (n,).
    """

    depth: float
    traction: FloatArray
    outward: FloatArray
    condition: IntArray
    gap: FloatArray
    rate: FloatArray
    closing: FloatArray


class RingContact:
    """Compliance of the top of a wide cover to tractions on rings, in units of its thickness and top shear modulus.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Indenter of revolution.
        contact_radius: Radius of the largest contact without friction [m].
        count: Number of elements through the cover [-].
    """

    def __init__(self, cover: Cover, indenter: Indenter, *, contact_radius: float, count: int) -> None:
        self._units = Units.of(cover)
        unit = self._units.length
        self._cover, self._indenter, self._count = cover, indenter, count
        # The area of cells may give a radius slightly above that of the indenter.
        self._rim = indenter.footprint[0] / unit
        self._radius = min(contact_radius / unit, self._rim)
        self._reach = choose_friction_reach(cover, contact_radius) / unit
        self._edges, radii = self._grade()
        self._radial = RadialCover.mesh(cover, count, radii, surface_size=float(np.diff(self._edges).min()))
        self._system = ConstrainedSystem(self._radial.constrained).factorise(self._radial.stiffness)
        self._load_shapes(radii)

    def _grade(self) -> tuple[FloatArray, FloatArray]:
        """Return the edges of the rings and those of all elements along the radius [thicknesses]."""
        growth = 1 + _SETTINGS.growth / self._count
        coarse = min(1.0, self._radius) / self._count
        if self._indenter.is_flat:
            rim = self._rim
            radii = grade_around_edge(_SETTINGS.edge * rim / self._count**2, coarse, rim, self._reach, growth)
            return radii[: int(np.argmin(np.abs(radii - rim))) + 1], radii
        width = self._radius / (_SETTINGS.rings * self._count)
        outer = min(width * np.ceil(_SETTINGS.margin * self._radius / width - ON_BOUNDARY), self._rim)
        # The rings end at the rim of the indenter: beyond it there is no gap.
        edges = np.linspace(0.0, outer, int(np.ceil(outer / width - ON_BOUNDARY)) + 1)
        width = float(edges[1])
        beyond = growing_steps(
            width, self._reach - edges[-1], lambda step: step * (growth**2 if step < coarse else growth)
        )
        radii = np.concatenate([edges, edges[-1] + np.cumsum(beyond)])
        radii[-1] = self._reach
        return np.asarray(edges), radii

    def _load_shapes(self, radii: FloatArray) -> None:
        """Compute nodal loads, displacements and base reactions per traction on each ring, and the compliance."""
        half = np.diff(self._edges)[:, None] / 2
        self._points = self._edges[:-1, None] + half * (_NODES + 1)
        self._area_weights = 2 * np.pi * self._points * half * _WEIGHTS
        rings = len(half)
        owner = np.repeat(np.arange(rings), len(_NODES))
        weights = np.zeros((owner.size, rings))
        weights[np.arange(owner.size), owner] = self._area_weights.ravel()
        on_nodes = np.asarray(Line(edges=radii, order=2).at(self._points.ravel()).T @ weights)
        elements, top = self._radial.elements, self._radial.top
        self._shapes = np.zeros((elements.displacements + elements.pressures, 2 * rings))
        self._shapes[2 * top + 1, :rings] = -on_nodes
        self._shapes[2 * top, rings:] = on_nodes
        self._response = self._system.solve(self._shapes)
        self._reactions = np.column_stack(
            [self._system.reaction(self._response[:, column], self._shapes[:, column]) for column in range(2 * rings)]
        )
        compliance = self._shapes.T @ self._response
        self._compliance = (compliance + compliance.T) / 2
        self._area = self._area_weights.sum(axis=1)

    def press(
        self, targets: Sequence[float], control: Control, *, friction: float, depth: float, fields: bool = False
    ) -> list[GridSolution]:
        """Press the indenter to every target load [N] or depth [m], ascending.

        Args:
            targets: Loads or depths.
            control: Whether the targets are loads or depths.
            friction: Coefficient of friction, inf for no slip [-].
            depth: Depth at the last target without friction [m].
            fields: Whether to compute displacement and stress in the cover.

        Raises:
            ConvergenceError: If the conditions of the rings do not settle.
        """
        unit = self._units.length if control == "depth" else self._units.force
        rings = len(self._area)
        zero = np.zeros(rings)
        here = _Step(0.0, np.zeros(2 * rings), zero, np.full(rings, _OPEN), zero, zero, zero)

        plan = self._plan_depths(depth / self._units.length, 1 if friction == 0 else _SETTINGS.steps * self._count)
        following = next(plan)
        reached: list[GridSolution] = []
        for target in (each / unit for each in targets):
            while self._measure(ahead := self._advance(here, following, friction), control) < target:
                here, following = ahead, next(plan)
            if control == "load":
                ahead = self._find_load(here, ahead, target, friction)
            elif ahead.depth > target:
                ahead = self._advance(here, target, friction)
            here = ahead
            reached.append(self._describe(here, rubs=friction > 0, fields=fields))
        return reached

    def _plan_depths(self, last: float, steps: int) -> Iterator[float]:
        """Yield depths at which the contact radius has grown evenly, without end; depth number `steps` is `last`."""
        steps = 1 if self._indenter.is_flat else steps
        for number in itertools.count(1):
            share = number / steps
            inside = self._height(np.array([min(share, 1.0), 1.0]) * self._radius)
            yield last * (share if self._indenter.is_flat or share > 1 else float(inside[0] / inside[1]))

    def _find_load(self, here: _Step, ahead: _Step, target: float, friction: float) -> _Step:
        """Find the equilibrium at the load `target`, which lies between the loads of the steps `here` and `ahead`."""

        def miss(depth: float) -> float:
            """Compute the load at a depth over the target, minus 1 [-]."""
            return self._measure(self._advance(here, depth, friction), "load") / target - 1

        depth = brentq(miss, here.depth, ahead.depth, xtol=1e-14, rtol=_SETTINGS.tolerance)
        return self._advance(here, float(depth), friction)

    def _measure(self, step: _Step, control: Control) -> float:
        """Return the depth or, under load control, the load of a solved step, in units of computation."""
        return step.depth if control == "depth" else float(self._area @ step.traction[: len(self._area)])

    def _height(self, radius: FloatArray) -> FloatArray:
        """Return the height of the indenter above its tip at distances from the axis [thicknesses]."""
        unit = self._units.length
        height = self._indenter.gap(radius * unit, np.zeros_like(radius)) / unit
        return np.zeros_like(height) if self._indenter.is_flat else np.asarray(height)

    def _advance(self, before: _Step, depth: float, friction: float) -> _Step:
        """Solve for the tractions of the rings at a depth, after a step at a smaller depth.

        Raises:
            ConvergenceError: If the conditions of the rings do not settle.
        """
        n = len(self._area)
        wanted = ((depth - self._height(self._points)) * self._area_weights).sum(axis=1)
        target = np.concatenate([wanted, self._predict_touch(before, depth)])
        scale = max(float(np.abs(target).max()), _TINY)
        if not scale < np.inf:  # An infinite scale would hide every violation.
            raise ConvergenceError("the gap between indenter and cover is not finite under every ring")
        condition = before.condition.copy()
        condition[(condition == _OPEN) & (wanted > 0)] = _STICKS if friction else _INWARD
        if not before.condition.any():
            condition[wanted <= 0] = _OPEN
        for exchange in range(_SETTINGS.exchanges):
            traction = self._balance(condition, target, friction)
            pressure, shear = traction[:n], traction[n:]
            moved = self._compliance @ traction
            excess = _find_violations(condition, pressure, shear, (moved - target) / scale, friction)
            if not (excess > _SETTINGS.tolerance).any():
                gap, step = moved[:n] - wanted, max(depth - before.depth, _TINY)
                rate, closing = (moved[n:] - before.outward) / step, (before.gap - gap) / step
                return _Step(depth, traction, moved[n:], condition, gap, rate, closing)
            worst = excess > (
                _SETTINGS.tolerance if exchange < _SETTINGS.all_at_once else excess.max() * (1 - _SETTINGS.tolerance)
            )
            condition[worst] = _exchange(condition[worst], pressure[worst], shear[worst], friction)
        raise ConvergenceError(f"contact and slip of {n} rings did not settle in {_SETTINGS.exchanges} exchanges")

    def _predict_touch(self, before: _Step, depth: float) -> FloatArray:
        """Return the outward displacement of each ring times its area at the moment of touch, shape (n,).

        For rings without contact it is predicted from their motion in the last step.
        """
        if not before.depth:
            return before.outward
        ahead = before.gap / np.where(before.closing > 0, before.closing, np.inf)
        ahead = np.where(before.condition == _OPEN, np.clip(ahead, 0.0, depth - before.depth), 0.0)
        return np.asarray(before.outward + ahead * before.rate)

    def _balance(self, condition: IntArray, target: FloatArray, friction: float) -> FloatArray:
        """Solve for the tractions of all rings with given conditions (open, sticking, sliding), shape (2 n,)."""
        n = len(condition)
        closed, sticks = np.flatnonzero(condition != _OPEN), np.flatnonzero(condition == _STICKS)
        slides = np.flatnonzero(condition > _STICKS)
        unknown = np.concatenate([closed, n + sticks])
        matrix = self._compliance[np.ix_(unknown, unknown)].copy()
        if friction and slides.size:
            sign = np.where(condition[slides] == _OUTWARD, friction, -friction)
            column = np.searchsorted(closed, slides)
            matrix[:, column] += self._compliance[np.ix_(unknown, n + slides)] * sign
        out = np.zeros(2 * n)
        out[unknown] = np.linalg.solve(matrix, target[unknown])
        if friction and slides.size:
            out[n + slides] = sign * out[slides]
        return out

    def _describe(self, step: _Step, *, rubs: bool, fields: bool) -> GridSolution:
        """Convert a solved step to a solution in SI units."""
        n, units, radial = len(self._area), self._units, self._radial
        pressure, shear = step.traction[:n], step.traction[n:]
        load = float(self._area @ pressure)
        closed = pressure > 0
        middle = (self._area_weights * self._points).sum(axis=1) / self._area
        rings = np.column_stack([middle, self._area * pressure, self._area * shear])[closed]
        points = divide_rings(rings * [units.length, units.force, units.force])
        found = None
        if fields:
            solid = Solid.from_cover(radial.elements, self._cover, units)
            found = recover_fields(solid, self._response @ step.traction, units, linear=True)
        return GridSolution(
            size=1 / self._count,
            total_force=load * units.force,
            depth=step.depth * units.length,
            area=np.pi * self._find_edge(step) ** 2 * units.length**2,
            contact=points[:, :3],
            shear=points[:, 3:] if rubs else None,
            base=RadialBase(
                spread=radial.recover_base(self._reactions @ step.traction, load), force=load * units.force
            ),
            energy=float(step.traction @ self._compliance @ step.traction) / 2 * units.force * units.length,
            fields=found,
        )

    def _find_edge(self, step: _Step) -> float:
        """Find the radius of the contact [thicknesses].

        Near the edge a of a smooth contact the pressure is proportional to the square root of a^2 - r^2 (Johnson 1985,
        section 5.1).  The radius a follows from the ratio of the forces on the outermost rings and on the rings next to
        them.
        """
        pressure = step.traction[: len(self._area)]
        last = int(np.flatnonzero(pressure > 0)[-1])
        if self._indenter.is_flat or last < 2 * _SETTINGS.fit or last + 1 == len(pressure):
            return float(self._edges[last + 1])
        inner, middle = self._edges[[last + 1 - 2 * _SETTINGS.fit, last + 1 - _SETTINGS.fit]]
        force = self._area * pressure
        ratio = (
            force[last + 1 - _SETTINGS.fit :].sum()
            / force[last + 1 - 2 * _SETTINGS.fit : last + 1 - _SETTINGS.fit].sum()
        )

        def miss(radius: float) -> float:
            """Compute the error of the ratio of the forces on two groups of rings for a contact radius."""
            outside = (radius**2 - middle**2) ** 1.5
            return float(outside - ratio * ((radius**2 - inner**2) ** 1.5 - outside))

        low, high = self._edges[[last, last + 2]]
        if miss(low) >= 0 or miss(high) <= 0:
            return float(self._edges[last + 1])
        return float(brentq(miss, low, high))


def _find_violations(
    condition: IntArray, pressure: FloatArray, shear: FloatArray, miss: FloatArray, friction: float
) -> FloatArray:
    """Measure by how much the rings violate their conditions, shape (n,); at most 0 where they do not.

    Args:
        condition: Condition of each of the n rings, shape (n,).
        pressure: Pressure of each ring, shape (n,).
        shear: Shear of each ring, shape (n,).
        miss: Relative difference of the 2 n displacements from those in contact that sticks, shape (2 n,).
        friction: Coefficient of friction [-].
    """
    n = len(condition)
    largest = max(float(np.abs(pressure).max(initial=0.0)), _TINY)
    out = np.where(condition == _OPEN, -miss[:n], -pressure / largest)
    if 0 < friction < np.inf:
        beyond = (np.abs(shear) - friction * pressure) / (friction * largest)
        out = np.where((condition == _STICKS) & (pressure > 0), np.maximum(out, beyond), out)
        along = np.where(condition == _OUTWARD, miss[n:], -miss[n:])
        out = np.where((condition > _STICKS) & (pressure > 0), np.maximum(out, along), out)
    return np.asarray(out)


def _exchange(condition: IntArray, pressure: FloatArray, shear: FloatArray, friction: float) -> IntArray:
    """Return the new conditions (open, sticking, sliding) of rings that violate their present conditions."""
    slides = np.where(shear > 0, _OUTWARD, _INWARD)
    after = np.where(
        condition == _OPEN, _STICKS if friction else _INWARD, np.where(condition == _STICKS, slides, _STICKS)
    )
    # A sticking ring under tension may be under pressure when it slides; it opens only if it slid or cannot slide.
    pulls = (pressure <= 0) & ((condition > _STICKS) | ((condition == _STICKS) & np.isinf(friction)))
    return np.where(pulls, _OPEN, after)


def least_area_error(indenter: Indenter, refinement: int) -> float:
    """Return the smallest estimated relative error of a contact area, whose radius is known to half a ring [-]."""
    return 0.0 if indenter.is_flat else 1 / (_SETTINGS.rings * GRIDS[refinement + 2])


def study_path(path: LoadingPath, progress: Progress, refinement: int = 0) -> GridStudy:
    """Solve a loading path with friction on three grids.

    Args:
        path: Wide cover, indenter of revolution, target loads or depths, and friction.
        progress: Called with a line of text before each solve.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        The solutions of every target, and how they converge.
    """
    accurate = small_strain.study_path(path, None, progress)
    grids = GRIDS[refinement : refinement + 3]
    smooth = accurate.solutions[-1][-1]

    def solve(part: LoadingPath, _approaches: Sequence[float]) -> SolvedPair:
        """Solve a loading path without and with friction on three grids, or read both from the result store."""
        part = replace(part, load_scale=1.0)

        def compute() -> SolvedPair:
            pairs = []
            for count in grids:
                report(name_grid(progress, count), "rings with friction")
                contact = RingContact(
                    part.cover, part.indenter, contact_radius=(smooth.area / np.pi) ** 0.5, count=count
                )
                fields = part.fields and count == grids[-1]
                pairs.append(
                    [
                        contact.press(part.targets, part.control, friction=each, depth=smooth.depth, fields=wanted)
                        for each, wanted in ((0.0, False), (part.friction, fields))
                    ]
                )
            return pair_grids(pairs)

        return result_store.fetch("friction-rings", {"path": part, "grids": grids}, compute)

    return GridStudy(
        solutions=correct_path(path, accurate.solutions, solve),
        least_error=_SETTINGS.least_error,
        least_area_error=least_area_error(path.indenter, refinement),
        accurate=accurate,
    )
