"""Solve for the contact pressure between rigid indenters and an elastic surface by an active-set method.

The surface is divided into equal rectangular cells.  The pressures p of the cells minimise p K p / 2 + p gap over
p >= 0, where K maps pressures to displacements; weighted sums of the pressures (force and moments of each indenter) may
be prescribed.
At the minimum, cells in contact have no overlap and cells with a gap have no pressure.

Method: for a given set of cells in contact, conjugate gradients solve the linear systems for the pressures.  Cells
under tension are then removed from the set and cells with overlap are added, all at once while the number of wrong
cells decreases, otherwise one at a time (block principal pivoting: Judice and Pires 1994; Kim and Park 2011).  The
method ends after a finite number of exchanges.  K is a convolution, applied by the fast Fourier transform; the inverse
of the spectrum of K is the preconditioner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.signal.windows import parzen

from fem_reference.errors import ConvergenceError
from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from meshes.array_types import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class ActiveSetSettings:
    """Limits and tolerances of the search for the cells in contact and of its conjugate gradients."""

    #: Largest number of changes of the set of cells in contact [-].
    exchanges: int = 400
    #: Largest number of successive changes in which all wrong cells enter or leave the contact without a new minimum
    #: of the number of wrong cells [-].  After that only one cell changes at a time.
    patience: int = 10
    #: Overlap at a cell, over the largest penetration of the undeformed surface, below which the cell is free of
    #: overlap [-].
    negligible: float = 1e-8
    #: Pressure of the wrong sign over the largest pressure, and overlap over the largest penetration, up to which a
    #: single cell that is wrong in contact and out of it is left as it is [-].
    flicker: float = 1e-4
    #: Largest number of iterations of conjugate gradients [-].
    iterations: int = 1000
    #: Norm of the given displacement up to which it is zero, because its square is too small for a number [m].
    none: float = 1e-100
    #: Norm of the residual displacement over that of the given displacement at which the iteration stops [-].
    residual: float = 1e-8
    #: Norm of the residual displacement over that of the given displacement at which the iteration stops while the set
    #: of cells in contact still changes [-].  A pressure of the wrong sign then costs only one more change of the set.
    loose_residual: float = 1e-4
    #: Smallest value of the spectrum of the preconditioner, over its largest value [-].
    spectrum_floor: float = 1e-7
    #: Largest error of the prescribed sums in equilibrium, over the largest prescribed sum [-].
    balance: float = 1e-6


_SETTINGS = ActiveSetSettings()


class Exchange:
    """Choice of the unknowns that enter or leave the contact in one step of the pivoting.

    Args:
        count: Number of unknowns.
        patience: Largest number of exchanges of all wrong unknowns in a row without a new minimum of their number.

    Attributes:
        fewest: Smallest number of wrong unknowns so far.
        is_single: Whether the last choice was one unknown, because exchanges of all did not make the wrong ones fewer.
    """

    def __init__(self, count: int, patience: int) -> None:
        self.fewest, self._most, self._patience, self.is_single = count + 1, patience, patience, False

    def choose(self, wrong: BoolArray) -> BoolArray:
        """Choose the unknowns that enter or leave the contact.

        Args:
            wrong: Whether each unknown violates its condition of contact; changed in place.

        Returns:
            All wrong unknowns; only the last of them if exchanges of all did not make them fewer.
        """
        count, self.is_single = int(wrong.sum()), False
        if count < self.fewest:
            self.fewest, self._patience = count, self._most
        elif self._patience > 0:
            self._patience -= 1
        else:
            self.is_single = True
            # If only the last wrong unknown is exchanged, the exchanges cannot cycle (Murty 1974).
            wrong.flat[np.flatnonzero(wrong)[:-1]] = False
        return wrong


class Compliance(Protocol):
    """Symmetric positive definite map from tractions on cells to displacements, with a preconditioner."""

    def displace(self, pressure: FloatArray, /) -> FloatArray:
        """Compute the displacements of all cells [m] under tractions on the cells [Pa]."""

    def precondition(self, residual: FloatArray, /) -> FloatArray:
        """Multiply residual displacements by the scaled approximate inverse."""


class ComplianceOperator:
    """Linear map from pressures on a grid of rectangular cells to the mean downward displacements of the cells.

    Args:
        surface: Compliance of the top of a wide cover.
        shape: Number of cells along x and along y.
        cell: Edge lengths of a cell along x and y [m].
        addition: Function that computes the additional displacements [m] due to free side edges from the forces on all
            cells [N]; None for a wide cover.
    """

    def __init__(
        self,
        surface: SurfaceCompliance,
        shape: tuple[int, ...],
        cell: tuple[float, float],
        addition: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        self._shape, self._area, self._addition = shape, cell[0] * cell[1], addition
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        x, y = np.meshgrid(*(np.arange(n) * edge for n, edge in zip(shape, cell, strict=True)), indexing="ij")
        # In the periodic convolution, large offsets between cells stand for negative offsets.  Offsets that no pair of
        # cells has are clipped.
        turned = [
            np.minimum(np.minimum(np.arange(m), m - np.arange(m)), n - 1)
            for m, n in zip(self._padded, shape, strict=True)
        ]
        kernel = surface.average_over_cells(x, y, *cell)[np.ix_(*turned)]
        self._spectrum = fft.rfft2(kernel)
        near = fft.rfft2(kernel * taper(self._padded)).real
        self._inverse = kernel[0, 0] / np.maximum(near, _SETTINGS.spectrum_floor * near.max())

    def displace(self, pressure: FloatArray) -> FloatArray:
        """Compute the downward displacements of all cells [m] under pressures on the cells [Pa], shape of the grid."""
        wide = self._filter(pressure, self._spectrum)
        if self._addition is None:
            return wide
        return wide + self._addition(pressure.ravel() * self._area).reshape(self._shape)

    def precondition(self, residual: FloatArray) -> FloatArray:
        """Multiply residual displacements by the scaled inverse of the spectrum of the tapered compliance [m].

        The compliance is much larger for long waves than for short waves, above all for covers with a stiff top layer;
        the preconditioner gives all wave lengths similar weights.  See `taper`.
        """
        return self._filter(residual, self._inverse)

    def _filter(self, values: FloatArray, spectrum: npt.NDArray[np.inexact[Any]]) -> FloatArray:
        """Convolve values on the cells with the kernel whose Fourier transform is given."""
        full = fft.irfft2(fft.rfft2(values, self._padded) * spectrum, self._padded)
        return np.asarray(full[..., : self._shape[0], : self._shape[1]])


def taper(shape: tuple[int, ...]) -> FloatArray:
    """Return Parzen's window over the offsets of a periodic grid, largest at offset zero and zero at half a period.

    The kernel of a compliance has a kink at half a period, so that its spectrum has negative values, although the map
    on the cells is positive definite.  The spectrum of the window is positive (E. Parzen, Ann. Math. Stat. 32, 1961,
    951-989), and so is that of its product with a positive definite kernel.

    Args:
        shape: Number of offsets along each of two axes.
    """
    halves = (parzen(2 * (m // 2) + 1)[m // 2 :][np.minimum(np.arange(m), m - np.arange(m))] for m in shape)
    return np.asarray(np.outer(*halves))


def find_pressures(
    compliance: ComplianceOperator,
    gap: FloatArray,
    touching: BoolArray,
    *,
    columns: FloatArray | None = None,
    sums: FloatArray | None = None,
    shed: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Find the cells in contact, the contact pressures, and the motions of the indenters.

    Args:
        compliance: Map from pressures to displacements of the cells.
        gap: Gap between cover and indenters at each cell before the indenters move; negative for overlap, inf where no
            contact is possible, shape (rows, columns) [m].
        touching: Initial guess of the cells in contact, shape (rows, columns).
        columns: Downward displacement of the indenter at every cell per unit of each of k free motions, shape
            (k, rows, columns); None if the indenters cannot move.
        sums: Prescribed sums of the pressures times each column, shape (k,) [Pa times the unit of the column].
        shed: Whether to remove cells under tension first and to add none meanwhile, for an initial guess that is larger
            than the contact.  Cells under tension lift a stiff top layer against the indenter nearly everywhere.

    Returns:
        Pressures, shape (rows, columns) [Pa], and amounts of the k motions, shape (k,).

    Raises:
        ConvergenceError: If the active set or conjugate gradients do not converge, or if no motion balances the
            prescribed sums.
    """
    allowed = np.isfinite(gap)
    gap = np.where(allowed, gap, 0.0)
    columns = np.zeros((0, *gap.shape)) if columns is None else columns
    sums = np.zeros(0) if sums is None else sums
    exchange = Exchange(gap.size, _SETTINGS.patience)
    system, residual = _Touching(compliance, gap, columns, sums), _SETTINGS.loose_residual
    last = np.zeros_like(touching)
    for _ in range(_SETTINGS.exchanges):
        pressure, motion = system.solve(touching, residual)
        shed = shed and bool((touching & (pressure < 0)).any() and (touching & (pressure > 0)).any())
        if shed:
            touching = touching & (pressure >= 0)
            continue
        remaining = gap - np.tensordot(motion, columns, 1)
        overlap = remaining + compliance.displace(pressure)
        deepest = max(0.0, -float(remaining[allowed].min()))
        wrong = (touching & (pressure < 0)) | (allowed & ~touching & (overlap < -_SETTINGS.negligible * deepest))
        count = int(wrong.sum())
        if residual > _SETTINGS.residual and (count == 0 or count >= exchange.fewest):
            residual, exchange = _SETTINGS.residual, Exchange(gap.size, _SETTINGS.patience)
            continue
        # One cell that is wrong both in contact and out of it, by less than the residual, would change for ever.
        slight = min(
            pressure[wrong].min(initial=0.0) + _SETTINGS.flicker * np.abs(pressure).max(),
            overlap[wrong].min(initial=0.0) + _SETTINGS.flicker * deepest,
        )
        if count == 0 or (count == 1 and np.array_equal(wrong, last) and slight >= 0):
            system.check_balance(pressure)
            return pressure, motion
        last = exchange.choose(wrong)
        touching = touching ^ last
    raise ConvergenceError(f"the contact did not settle in {_SETTINGS.exchanges} exchanges on {gap.shape} cells")


class _Touching:
    """System of equations for pressures and motions with given cells in contact.

    Args:
        compliance, gap, columns, sums: As of `find_pressures`.
    """

    def __init__(self, compliance: ComplianceOperator, gap: FloatArray, columns: FloatArray, sums: FloatArray) -> None:
        self._compliance, self._wanted, self._columns, self._sums = compliance, [gap, *columns], columns, sums
        self._found = [np.zeros_like(gap)] * len(self._wanted)

    def solve(self, touching: BoolArray, residual: float) -> tuple[FloatArray, FloatArray]:
        """Solve for pressures and motions with zero gap at every cell in contact and with the prescribed sums.

        The pressures found before are the initial guess.

        Args:
            touching: Cells in contact, shape (rows, columns).
            residual: Norm of the residual displacement over that of the given displacement [-].

        Returns:
            Pressures [Pa], which may be negative, and amounts of the motions.
        """
        self._found = [
            solve_displacement(self._compliance, wanted, touching, found, residual)
            for wanted, found in zip(self._wanted, self._found, strict=True)
        ]
        at_rest, columns = self._found[0], self._columns
        if not len(columns):
            return -at_rest, np.zeros(0)
        per_motion = np.array(self._found[1:])
        stiffness = np.tensordot(columns, per_motion, ((1, 2), (1, 2)))
        # With too few cells in contact the tilt is undetermined, and `lstsq` returns the smallest motion.  Cells that
        # then overlap are added to the contact afterwards.
        balance = self._sums + np.tensordot(columns, at_rest, 2)
        motion: FloatArray = np.linalg.lstsq(stiffness, balance)[0].astype(float)
        return np.tensordot(motion, per_motion, 1) - at_rest, motion

    def check_balance(self, pressure: FloatArray) -> None:
        """Raise `ConvergenceError` if pressures [Pa] on the cells do not have the prescribed sums."""
        missing = self._sums - np.tensordot(self._columns, pressure, 2)
        if np.abs(missing).max(initial=0.0) > _SETTINGS.balance * np.abs(self._sums).max(initial=0.0):
            raise ConvergenceError("no motion of the indenters balances their loads and moments")


def solve_displacement(
    compliance: Compliance, wanted: FloatArray, touching: BoolArray, start: FloatArray, tolerance: float
) -> FloatArray:
    """Solve for the pressures [Pa] on the cells in contact that displace them by `wanted` [m], by conjugate gradients.

    The preconditioner is that of `compliance`; `start` is the initial guess [Pa], and `tolerance` the norm of the
    residual over that of `wanted` [-].
    """
    given = np.where(touching, wanted, 0.0)
    size = float(np.linalg.norm(given))
    if size <= _SETTINGS.none:
        return np.zeros_like(given)
    pressure = np.where(touching, start, 0.0)
    residual = given - np.where(touching, compliance.displace(pressure), 0.0) if pressure.any() else given
    small = tolerance * size
    direction, previous = np.zeros_like(wanted), 1.0
    for _ in range(_SETTINGS.iterations):
        if np.linalg.norm(residual) <= small:
            return pressure
        weighted = np.where(touching, compliance.precondition(residual), 0.0)
        energy = float((residual * weighted).sum())
        direction = weighted + energy / previous * direction
        previous = energy
        image = np.where(touching, compliance.displace(direction), 0.0)
        step = energy / float((image * direction).sum())
        pressure += step * direction
        residual -= step * image
    raise ConvergenceError(f"conjugate gradients did not converge in {_SETTINGS.iterations} iterations")
