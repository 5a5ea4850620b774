"""Pressure between rigid indenters and a compliant surface: the cells that touch are found, not assumed.

The surface is cut into square cells.  Their pressures p minimise p K p / 2 + p gap over p >= 0, where K maps pressures
to displacements; the sums of the pressures with given columns (force and moments of each body) may be prescribed.  At
the minimum, cells that touch have no overlap and cells with a gap have no pressure.

Method: for a guessed set of touching cells the pressures follow from linear systems, which conjugate gradients solve.
Cells under tension then leave the set and cells that overlap join it, all of them at once while their number falls and
one at a time otherwise (block principal pivoting: Judice and Pires 1994; Kim and Park 2011).  The number of exchanges
is finite.  K is a convolution, applied with the fast Fourier transform; the inverse of its spectrum preconditions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import fft

from fem_reference.errors import ConvergenceError
from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from meshes.array_types import BoolArray, FloatArray

#: Most exchanges of cells, and exchanges of all cells at once that may pass without fewer wrong cells than ever [-].
_EXCHANGES, _PATIENCE = 400, 10
#: Overlap below which a cell counts as free of overlap, relative to the deepest penetration of the gap [-].
_NEGLIGIBLE = 1e-8
#: Most iterations of conjugate gradients, and the residual displacement, relative to the wanted one, at which they
#: stop [-].
_ITERATIONS, _RESIDUAL = 1000, 1e-8
#: Smallest value of the spectrum in the preconditioner, relative to the largest [-].
_SPECTRUM_FLOOR = 1e-4
#: Relative deviation of the sums of pressures from the prescribed ones that is still an equilibrium [-].
_BALANCE = 1e-6


class ComplianceOperator:
    """Map from pressures on a grid of cells to the downward displacements of their centres.

    Args:
        surface: Compliance of a wide cover.
        shape: Cells along x and y.
        cell: Edge length of a cell [m].
        addition: Displacements that free side edges add, from the forces on all cells [N] to [m]; None for a wide
            cover.
    """

    def __init__(
        self,
        surface: SurfaceCompliance,
        shape: tuple[int, ...],
        cell: float,
        addition: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        self._shape, self._area, self._addition = shape, cell**2, addition
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        offsets = [np.minimum(np.arange(m), m - np.arange(m)) * cell for m in self._padded]
        x, y = np.meshgrid(*offsets, indexing="ij")
        kernel = surface.of_rectangle(x, y, cell, cell)
        self._spectrum = fft.rfft2(kernel)
        size = np.abs(self._spectrum)
        self._inverse = kernel[0, 0] / np.maximum(size, _SPECTRUM_FLOOR * size.max())

    def displace(self, pressure: FloatArray) -> FloatArray:
        """Displacements under pressures [Pa], shape of the grid [m]."""
        wide = self._filter(pressure, self._spectrum)
        if self._addition is None:
            return wide
        return wide + self._addition(pressure.ravel() * self._area).reshape(self._shape)

    def precondition(self, residual: FloatArray) -> FloatArray:
        """Residual displacements with all wave lengths brought to the same weight [m].

        Long waves yield far more than short ones, most of all under a stiff foil.
        """
        return self._filter(residual, self._inverse)

    def _filter(self, values: FloatArray, spectrum: npt.NDArray[np.inexact[Any]]) -> FloatArray:
        full = fft.irfft2(fft.rfft2(values, self._padded) * spectrum, self._padded)
        return np.asarray(full[: self._shape[0], : self._shape[1]])


def find_pressures(
    compliance: ComplianceOperator,
    gap: FloatArray,
    touching: BoolArray,
    *,
    columns: FloatArray | None = None,
    sums: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Find the cells that touch, their pressures, and the motion of the indenters.

    Args:
        compliance: Map from pressures to displacements.
        gap: Distance of each cell from the indenters before they move; negative where they overlap, inf where no
            contact is possible, shape (rows, columns) [m].
        touching: First guess of the cells that touch.
        columns: Displacement of every cell's indenter per unit of each free motion, shape (k, rows, columns); without
            them nothing moves.
        sums: Prescribed sum of pressures times each column, shape (k,) [Pa] times the column's unit.

    Returns:
        Pressures, shape (rows, columns) [Pa], and the motions, shape (k,).

    Raises:
        ConvergenceError: If the set of cells does not settle, the linear systems do not converge, or no motion
            balances the prescribed sums.
    """
    allowed = np.isfinite(gap)
    gap = np.where(allowed, gap, 0.0)
    columns = np.zeros((0, *gap.shape)) if columns is None else columns
    sums = np.zeros(0) if sums is None else sums
    fewest, patience = gap.size + 1, _PATIENCE
    for _ in range(_EXCHANGES):
        pressure, motion = _solve_touching(compliance, gap, touching, columns, sums)
        remaining = gap - np.tensordot(motion, columns, 1)
        overlap = compliance.displace(pressure) + remaining
        deepest = max(0.0, -float(remaining[allowed].min()))
        under_tension = touching & (pressure < 0)
        overlapping = allowed & ~touching & (overlap < -_NEGLIGIBLE * deepest)
        wrong = under_tension | overlapping
        count = int(wrong.sum())
        if count == 0:
            missing = sums - np.tensordot(columns, pressure, 2)
            if np.abs(missing).max(initial=0.0) > _BALANCE * np.abs(sums).max(initial=0.0):
                raise ConvergenceError("no motion of the indenters balances their loads and moments")
            return pressure, motion
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong.flat[np.flatnonzero(wrong)[:-1]] = False  # exchanges of the last cell alone cannot cycle (Murty 1974)
        touching = touching ^ wrong
    raise ConvergenceError(f"the contact did not settle in {_EXCHANGES} exchanges on {gap.shape} cells")


def _solve_touching(
    compliance: ComplianceOperator, gap: FloatArray, touching: BoolArray, columns: FloatArray, sums: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pressures that close the gap of every touching cell and have the prescribed sums, and the motions."""
    at_rest = _solve_displacement(compliance, gap, touching)
    per_motion = np.array([_solve_displacement(compliance, each, touching) for each in columns])
    if not len(columns):
        return -at_rest, np.zeros(0)
    stiffness = np.tensordot(columns, per_motion, ((1, 2), (1, 2)))
    # Too few touching cells leave a tilt undetermined: the smallest motion is taken, and cells that overlap then join.
    motion: FloatArray = np.linalg.lstsq(stiffness, sums + np.tensordot(columns, at_rest, 2))[0].astype(float)
    return np.tensordot(motion, per_motion, 1) - at_rest, motion


def _solve_displacement(compliance: ComplianceOperator, wanted: FloatArray, touching: BoolArray) -> FloatArray:
    """Pressures on the touching cells that displace them by `wanted` [m], by preconditioned conjugate gradients."""
    pressure = np.zeros_like(wanted)
    residual = np.where(touching, wanted, 0.0)
    small = _RESIDUAL * float(np.linalg.norm(residual))
    direction, previous = np.zeros_like(wanted), 1.0
    for _ in range(_ITERATIONS):
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
    raise ConvergenceError(f"conjugate gradients did not converge in {_ITERATIONS} iterations")
