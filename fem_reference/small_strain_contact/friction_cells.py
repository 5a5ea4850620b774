"""Solve the contact with friction of one rigid indenter on rectangular cells at small strain, by increments.

Every cell bears a pressure and two shear tractions.  A cell in contact has no gap.  Where it sticks, it moves across
its normal with the indenter since its first contact; where it slides, its shear is the coefficient of friction times
the pressure, against the slip.  The traction depends on the displacement of each cell at its first contact, so that the
indenter is followed in steps of about equal growth of the contact.  The time of first contact within a step is
estimated from the rate at which the gap closed in the previous step.

In each step the open, sticking and sliding cells are found by exchanges.  The shear of sliding cells follows from a
return mapping (Simo and Laursen 1992): the slip, as a traction on the cell alone, is added to the last shear, which is
then shortened to the limit of friction.  The directions of all sliding cells are found together by Newton's method
(Alart and Curnier 1991), with the limits of the last pressures; see `SlipAxes`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.optimize import brentq

from fem_reference.errors import ConvergenceError
from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact.constrained_solver import (
    ActiveSetSettings,
    Exchange,
    solve_displacement,
    taper,
)
from meshes.array_types import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class FrictionSettings(ActiveSetSettings):
    """Limits and tolerances of the contact with friction on cells; exchanges are counted in each step."""

    #: Change of the shear of sliding cells over the largest pressure at which a step is solved [-].
    settled: float = 1e-3
    #: Ratio of two successive changes of the shear above which the return mapping is made softer [-].
    shrinks: float = 0.9
    #: Largest softness of the return mapping over the compliance of a cell alone [-].
    softest: float = 64.0
    #: As `patience`, without slip, before cells at the border may slide [-].
    sticking_patience: int = 3
    #: Tolerance of the travel in the search for a load, over the last step [-].
    depth: float = 1e-4


#: Factor by which the cells are widened where the contact reaches their edge [-].
WIDER = 1.25
_SETTINGS = FrictionSettings(exchanges=300, negligible=1e-7, residual=1e-6)


class VectorOperator:
    """Linear map from tractions on a grid of rectangular cells to their mean displacements, in three components.

    Args:
        layer: Compliance of the top of a wide cover.
        shape: Number of cells along x and along y.
        cell: Edge lengths of a cell along x and y [m].
        addition: Map from forces on all cells, shape (3, cells) [N], to additional displacements [m]; None for none.
    """

    def __init__(
        self,
        layer: VectorCompliance,
        shape: tuple[int, ...],
        cell: tuple[float, float],
        addition: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        self._shape, self._area, self._addition = shape, cell[0] * cell[1], addition
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        # In the periodic convolution, large offsets stand for negative offsets; those of no pair of cells are clipped.
        axes = [
            np.clip(np.where(np.arange(m) < n, np.arange(m), np.arange(m) - m), 1 - n, n - 1) * edge
            for m, n, edge in zip(self._padded, shape, cell, strict=True)
        ]
        x, y = np.meshgrid(*axes, indexing="ij")
        kernel = layer.average_over_cells(x, y, *cell)
        #: Mean of the displacements of a cell along its tangents per shear on it alone [m/Pa].
        self.own = float(kernel[1, 1, 0, 0] + kernel[2, 2, 0, 0]) / 2
        self._spectrum = fft.rfft2(kernel)
        near = np.moveaxis(fft.rfft2(kernel * taper(self._padded)), (0, 1), (2, 3))
        value, vector = np.linalg.eigh(near)
        value = np.maximum(value, _SETTINGS.spectrum_floor * value.max())
        turned = vector.conj().swapaxes(-1, -2)
        self._inverse = np.moveaxis(vector * (value.min() / value)[..., None, :] @ turned, (2, 3), (0, 1))

    def displace(self, traction: FloatArray) -> FloatArray:
        """Compute the displacements of all cells under tractions on the cells, shape (3, rows, columns) [m, Pa]."""
        out = self._filter(traction, self._spectrum)
        if self._addition is None:
            return out
        return out + self._addition(traction.reshape(3, -1) * self._area).reshape(out.shape)

    def precondition(self, residual: FloatArray) -> FloatArray:
        """Multiply residual displacements by the scaled inverse of the spectrum of the tapered compliance."""
        return self._filter(residual, self._inverse)

    def _filter(self, values: FloatArray, spectrum: npt.NDArray[np.complexfloating]) -> FloatArray:
        """Convolve values with the kernel of a spectrum, shape (3, 3, ...)."""
        found = (spectrum * fft.rfft2(values, self._padded)).sum(axis=1)
        return np.asarray(fft.irfft2(found, self._padded)[:, : self._shape[0], : self._shape[1]])


@dataclass(frozen=True, kw_only=True, eq=False)
class SlipAxes:
    """Compliance of cells in tangential axes along and across the shear, where slip adds to that across the shear.

    Slip is parallel to the shear, whose size is given by friction.  A small shear across turns both: it adds the slip
    over the shear to the compliance in this direction.

    Attributes:
        compliance: Map from tractions to displacements in the axes of the grid.
        along: Unit vector along the shear of each cell, shape (2, rows, columns) [-].
        softness: Compliance that is added across the shear, shape (rows, columns) [m/Pa].
    """

    compliance: VectorOperator
    along: FloatArray
    softness: FloatArray

    @classmethod
    def of(cls, compliance: VectorOperator, shear: FloatArray, softness: FloatArray) -> SlipAxes:
        """Choose the axes of shear tractions [Pa], shape (2, rows, columns); those of the grid where it is zero."""
        size = np.linalg.norm(shear, axis=0)
        along = np.where(size > 0, shear / np.where(size > 0, size, 1.0), np.array([1.0, 0.0])[:, None, None])
        return cls(compliance=compliance, along=along, softness=softness)

    def turn_to(self, values: FloatArray) -> FloatArray:
        """Turn vectors from the axes of the grid to these, shape (3, rows, columns)."""
        (x, y), (normal, first, second) = self.along, values
        return np.stack([normal, x * first + y * second, x * second - y * first])

    def turn_from(self, values: FloatArray) -> FloatArray:
        """Turn vectors from these axes to those of the grid, shape (3, rows, columns)."""
        (x, y), (normal, first, second) = self.along, values
        return np.stack([normal, x * first - y * second, y * first + x * second])

    def displace(self, traction: FloatArray) -> FloatArray:
        """Compute the displacements of all cells under tractions, shape (3, rows, columns) [m, Pa]."""
        moved = self.turn_to(self.compliance.displace(self.turn_from(traction)))
        moved[2] += self.softness * traction[2]
        return moved

    def precondition(self, residual: FloatArray) -> FloatArray:
        """Multiply residual displacements by the scaled approximate inverse."""
        scale = np.ones_like(residual)
        scale[2] = 1 / np.sqrt(1 + self.softness / self.compliance.own)
        return scale * self.turn_to(self.compliance.precondition(self.turn_from(scale * residual)))


@dataclass(frozen=True, kw_only=True, eq=False)
class RubbingState:
    """Contact with friction after a step.

    Attributes:
        travel: Travel of the indenter [m].
        traction: Pressure and shear tractions of all cells, shape (3, rows, columns) [Pa].
        moved: Displacements of all cells, same shape [m].
        touching: Whether each cell is in contact, shape (rows, columns).
        record: Displacement of each cell along its tangents, less that of the indenter, to which a sticking cell is
            held, shape (2, rows, columns) [m].
        before: State before the step.
    """

    travel: float
    traction: FloatArray
    moved: FloatArray
    touching: BoolArray
    record: FloatArray
    before: RubbingState | None = None


def is_cut_off(touching: BoolArray, open_below: BoolArray, open_above: BoolArray) -> bool:
    """Return whether a contact reaches an edge of its cells beyond which there may be more of it.

    Args:
        touching: Whether each cell is in contact, shape (rows, columns).
        open_below: Whether the contact may go on below the first cells along each axis, shape (2,).
        open_above: The same above the last cells.
    """
    ends = np.array([touching[[0, -1]].any(axis=1), touching[:, [0, -1]].any(axis=0)])
    return bool((ends & np.stack([open_below, open_above], axis=1)).any())


@dataclass(frozen=True, kw_only=True, eq=False)
class RubbingContact:
    """Contact of an indenter with friction on a grid of cells.

    Attributes:
        gap: Function that computes the gap of every cell after a travel of the indenter, shape (rows, columns) [m]; inf
            where no contact is possible.
        motion: Motion of the indenter per travel, against the normal of each cell and along its two tangents, shape
            (3, rows, columns) [-].
        compliance: Map from tractions to displacements in these components.
        area: Area of a cell [m2].
        friction: Coefficient of friction, inf for no slip [-].
    """

    gap: Callable[[float], FloatArray]
    motion: FloatArray
    compliance: VectorOperator
    area: float
    friction: float

    def measure_load(self, state: RubbingState) -> float:
        """Compute the force along the motion of the indenter [N]."""
        return float((state.traction * self.motion).sum()) * self.area

    def follow(
        self, touch: float, depth: float, steps: int, load: float | None = None, first: BoolArray | None = None
    ) -> RubbingState:
        """Follow the indenter from first touch to a depth or to a load.

        Steps of the root of the depth make the contact of a round body grow evenly, because its width is proportional
        to that root.

        Args:
            touch: Travel to the first touch [m].
            depth: Depth after the given number of steps [m].
            steps: Number of steps [-].
            load: Load at which the path ends [N]; None to end at the depth.
            first: Cells that are in contact at first touch, an initial guess, shape (rows, columns); None for none.

        Raises:
            ConvergenceError: If the open, sticking and sliding cells of a step are not found.
        """
        zero = np.zeros_like(self.motion)
        touching = zero[0].astype(bool) if first is None else first
        last = RubbingState(travel=touch, traction=zero, moved=zero, touching=touching, record=-touch * self.motion[1:])
        for number in itertools.count(1):
            ahead = self._advance(last, touch + depth * (number / steps) ** 2)
            if load is None and number == steps:
                return ahead
            if load is not None and self.measure_load(ahead) >= load:
                return self._reach(last, ahead, load)
            last = ahead
        raise AssertionError

    def _reach(self, last: RubbingState, ahead: RubbingState, load: float) -> RubbingState:
        """Find the state at a load [N] between those of two successive states."""
        near = min(last, ahead, key=lambda state: abs(self.measure_load(state) - load))

        def miss(travel: float) -> float:
            nonlocal near
            near = self._advance(last, travel)
            return self.measure_load(near) / load - 1

        brentq(miss, last.travel, ahead.travel, xtol=_SETTINGS.depth * (ahead.travel - last.travel))
        return near

    def _advance(self, last: RubbingState, travel: float) -> RubbingState:
        """Solve the contact at a travel [m] in one step after a state.

        Raises:
            ConvergenceError: If the open, sticking and sliding cells are not found.
        """
        gap, slips = self.gap(travel), bool(np.isfinite(self.friction))
        allowed = np.isfinite(gap)
        gap = np.where(allowed, gap, 0.0)
        record = self._predict_touch(last, gap, travel)
        goal = np.concatenate([-gap[None], record + travel * self.motion[1:]])
        least = _SETTINGS.negligible * float(gap.min(initial=0.0))
        is_given = last.before is None and last.touching.any()
        touching = allowed & (last.touching | (not is_given) & (gap + last.moved[0] < 0))
        traction = last.traction
        # Cells that touch in this step first slide without shear: those at the border would pull if they stuck.
        slides = slips & ~last.touching
        # Without slip they do only if they would otherwise pull in contact and overlap out of it in turn.
        yields, residual = slips, _SETTINGS.residual if slips else _SETTINGS.loose_residual
        exchange = Exchange(gap.size, _SETTINGS.patience if slips else _SETTINGS.sticking_patience)
        softness, own, before = np.full(gap.shape, np.inf), self.compliance.own, np.inf
        for _ in range(_SETTINGS.exchanges):
            sticks = touching & ~slides
            axes = SlipAxes.of(self.compliance, traction[1:], np.where(sticks | np.isinf(softness), 0.0, softness))
            fixed = np.concatenate([0 * traction[:1], np.where(touching & slides, traction[1:], 0.0)])
            wanted = axes.turn_to(goal - self.compliance.displace(fixed) if slides.any() else goal)
            held = np.stack([touching, sticks, sticks | (touching & np.isfinite(softness))])
            free = solve_displacement(axes, wanted, held, axes.turn_to(traction), residual)
            traction = fixed + axes.turn_from(free)
            moved = self.compliance.displace(traction)
            pulls, overlaps = touching & (traction[0] < 0), allowed & ~touching & (gap + moved[0] < least)
            wrong = pulls | overlaps
            if residual > _SETTINGS.residual and not 0 < wrong.sum() < exchange.fewest:
                residual, exchange = _SETTINGS.residual, Exchange(gap.size, _SETTINGS.sticking_patience)
                continue
            # Single cells that are wrong by less than the residual would change for ever.
            slight = (
                traction[0].min(initial=0.0, where=pulls) + _SETTINGS.flicker * traction[0].max() >= 0
                and (gap + moved[0]).min(initial=0.0, where=overlaps) >= _SETTINGS.flicker * gap.min()
            )
            if wrong.any() and not (exchange.is_single and slight):
                wrong = exchange.choose(wrong)
                if exchange.is_single and not yields:
                    yields, slides, exchange = True, slides | ~touching, Exchange(gap.size, _SETTINGS.patience)
                # A sticking cell that pulls slides without shear before it opens.
                freed = wrong & sticks & yields
                slides |= wrong & yields
                softness = np.where(wrong, np.inf, softness)
                traction = np.where(freed, traction[:1] * np.array([1.0, 0.0, 0.0])[:, None, None], traction)
                touching = touching ^ (wrong & ~freed)
                continue
            if not slips:
                break
            traction, slides, share, change = self._slide(traction, (goal - moved) / own, touching, slides)
            softness = own * share
            # With a soft return mapping the shear changes by less than its error.
            if change * own <= _SETTINGS.settled * self.compliance.own:
                break
            # Neighbours that slide together let the shear oscillate.
            if change > _SETTINGS.shrinks * before and own < _SETTINGS.softest * self.compliance.own:
                own *= 2
            before = change
            exchange = Exchange(gap.size, _SETTINGS.patience)
        else:
            raise ConvergenceError(
                f"contact and slip did not settle in {_SETTINGS.exchanges} exchanges; "
                "solve the bounds, no friction and no slip"
            )
        record = np.where(touching & ~slides, record, moved[1:] - travel * self.motion[1:])
        return RubbingState(
            travel=travel, traction=traction, moved=moved, touching=touching, record=record, before=last
        )

    def _predict_touch(self, last: RubbingState, gap: FloatArray, travel: float) -> FloatArray:
        """Return the record of every cell at the end of a step, shape (2, rows, columns) [m].

        That of cells in contact is unchanged.  For all others it is predicted at the time of their first contact, which
        follows from the gap at the end of the step and from the rate at which the gap closes.
        """
        before, step = last.before, travel - last.travel
        speed = 0.0 * last.moved if before is None else (last.moved - before.moved) / (last.travel - before.travel)
        closing = self.motion[0] - speed[0]
        # The gap changes with the travel by the motion against the normal.
        remains = gap + self.motion[0] * step + last.moved[0]
        ahead = np.clip(remains / np.where(closing > 0, closing, np.inf), 0.0, step)
        predicted = last.moved[1:] + ahead * speed[1:] - (last.travel + ahead) * self.motion[1:]
        return np.where(last.touching, last.record, predicted)

    def _slide(
        self, traction: FloatArray, excess: FloatArray, touching: BoolArray, slides: BoolArray
    ) -> tuple[FloatArray, BoolArray, FloatArray, float]:
        """Return the shear to the limit of friction where it exceeds this limit or the cell slides on.

        Args:
            traction: Tractions, shape (3, rows, columns) [Pa].
            excess: Displacements to where the cells would stick, as tractions, same shape [Pa].
            touching: Whether each cell is in contact, shape (rows, columns).
            slides: Whether each cell was assumed to slide, same shape.

        Returns:
            Tractions, whether each cell slides, slip as a traction over the shear of each sliding cell [-], inf where
            it has no shear, and the largest change of a shear over the largest pressure [-].
        """
        trial = np.where(touching, traction[1:] + excess[1:], 0.0)
        size, limit = np.linalg.norm(trial, axis=0), self.friction * np.maximum(traction[0], 0.0)
        slides = touching & ((size > limit) | (slides & ((excess * traction)[1:].sum(axis=0) > 0)))
        rubs, largest = slides & (size > 0) & (limit > 0), traction[0].max(initial=np.finfo(float).tiny)
        shear = trial * np.where(slides, np.divide(limit, size, out=np.zeros_like(size), where=rubs), 1.0)
        softness = np.maximum(np.divide(size, limit, out=np.full_like(size, np.inf), where=rubs) - 1, 0.0)
        change = np.abs(shear - traction[1:])[:, touching].max(initial=0.0) / largest
        return np.concatenate([traction[:1], shear]), slides, softness, float(change)
