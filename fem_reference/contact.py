"""Frictionless contact of a rigid indenter on a compliant surface: the contact area is found, not assumed.

Minimise p K p / 2 - p (depth - gap) over p >= 0: pressure only where the surfaces touch, no overlap elsewhere.  K is a
convolution on square cells, applied with a fast Fourier transform; the minimum is found by conjugate gradients on the
set of touching cells (Polonsky and Keer, Wear 231, 1999), at a given force or at a given depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

from fem_reference.slab import SurfaceCompliance
from meshes import Indenter

FloatArray = npt.NDArray[np.float64]


class ConvergenceError(RuntimeError):
    """A solver stopped before it reached its tolerance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """A solved contact in the indenter's frame.

    Attributes:
        x: Centres of the touching cells, shape (m,) [m].
        y: Centres of the touching cells, shape (m,) [m].
        force: Force on each, shape (m,) [N].
        cell: Edge length of a cell [m].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
    """

    x: FloatArray
    y: FloatArray
    force: FloatArray
    cell: float
    depth: float

    @property
    def total_force(self) -> float:
        """Sum of the cells' forces [N]."""
        return float(self.force.sum())

    @property
    def area(self) -> float:
        """Contact area [m2]."""
        return self.force.size * self.cell**2


def touch(
    surface: SurfaceCompliance,
    indenter: Indenter,
    *,
    cells: int,
    load: float | None = None,
    depth: float | None = None,
) -> Patch:
    """Press an indenter, refining the grid onto the contact until `cells` span it.

    Args:
        surface: How the cover's top yields.
        indenter: The shape.
        cells: Cells across the longer side of the contact [-].
        load: Force [N]; or
        depth: Approach [m].  Exactly one of the two.

    Raises:
        ConvergenceError: If conjugate gradients do not converge.
    """
    half = np.array(indenter.footprint)
    sharp = is_flat(indenter)
    for _ in range(8):
        grid = _Grid.over(half, cells if sharp else int(1.1 * cells))
        if sharp:
            grid = grid.matched(indenter)
        pressure, approach = _solve(grid, surface, indenter, load, depth)
        hit = pressure > 0
        reach = np.array([np.abs(grid.x[hit]).max(), np.abs(grid.y[hit]).max()]) + grid.cell / 2
        if sharp or reach.max() > 0.8 * half.max():
            break
        half = np.minimum(np.maximum(1.1 * reach, 0.05 * half), half)
    return Patch(x=grid.x[hit], y=grid.y[hit], force=pressure[hit] * grid.cell**2, cell=grid.cell, depth=approach)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Square cells, centred on the axis, that fill a rectangle exactly along its longer side."""

    x: FloatArray
    y: FloatArray
    cell: float
    scale: float = 1.0

    @classmethod
    def over(cls, half: FloatArray, cells: int) -> _Grid:
        cell = 2 * half.max() / cells
        count = np.maximum(1, np.round(2 * half / cell)).astype(int)
        axes = [(np.arange(n) - (n - 1) / 2) * cell for n in count]
        x, y = np.meshgrid(*axes, indexing="ij")
        return cls(x=x, y=y, cell=cell)

    def matched(self, indenter: Indenter) -> _Grid:
        """The same cells scaled so that those inside a flat face have exactly its area.

        A round edge cut into squares is too large or too small by chance; with the right area the error falls
        smoothly with the cell and can be extrapolated.
        """
        fine = _Grid.over(np.array(indenter.footprint), 1201)
        area = np.isfinite(indenter.gap(fine.x, fine.y)).sum() * fine.cell**2
        scale = np.sqrt(area / (np.isfinite(indenter.gap(self.x, self.y)).sum() * self.cell**2))
        return _Grid(x=self.x * scale, y=self.y * scale, cell=self.cell * float(scale), scale=float(scale))


class _Convolution:
    """Cell pressures to cell displacements by a zero-padded fast Fourier transform."""

    def __init__(self, grid: _Grid, surface: SurfaceCompliance) -> None:
        self._shape = grid.x.shape
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in self._shape)
        offsets = [np.minimum(np.arange(m), m - np.arange(m)) * grid.cell for m in self._padded]
        x, y = np.meshgrid(*offsets, indexing="ij")
        self._spectrum = fft.rfft2(surface.of_rectangle(x, y, grid.cell, grid.cell))

    def __call__(self, pressure: FloatArray) -> FloatArray:
        full = fft.irfft2(fft.rfft2(pressure, self._padded) * self._spectrum, self._padded)
        return np.asarray(full[: self._shape[0], : self._shape[1]])


def is_flat(indenter: Indenter) -> bool:
    """Whether the lower surface is a plane, so that its edge bounds the contact."""
    half = indenter.footprint
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 41), np.linspace(-half[1], half[1], 41))
    gap = indenter.gap(x, y)
    return bool((gap[np.isfinite(gap)] == 0).all())


def _solve(
    grid: _Grid, surface: SurfaceCompliance, indenter: Indenter, load: float | None, depth: float | None
) -> tuple[FloatArray, float]:
    """Pressures on the grid and the approach."""
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth")
    yields = _Convolution(grid, surface)
    gap = indenter.gap(grid.x / grid.scale, grid.y / grid.scale)
    allowed = np.isfinite(gap)
    gap = np.where(allowed, gap, 0.0)
    target = None if load is None else load / grid.cell**2
    pressure = np.where(allowed, 1.0, 0.0)
    scale = target if target is not None else float(depth or 0.0) * allowed.sum() / yields(pressure)[allowed].mean()
    pressure *= scale / pressure.sum()
    direction, previous, conjugate = np.zeros_like(pressure), 1.0, 0.0
    for _ in range(2000):
        touching = pressure > 0
        overlap = yields(pressure) + gap
        level = float(overlap[touching].mean()) if depth is None else depth
        overlap -= level  # negative where the cover would reach into the indenter
        energy = float((overlap[touching] ** 2).sum())
        direction = np.where(touching, overlap + conjugate * energy / previous * direction, 0.0)
        previous, conjugate = energy, 1.0
        image = yields(direction)
        if depth is None:
            image -= image[touching].mean()
        step = float((overlap * direction)[touching].sum() / (image * direction)[touching].sum())
        pressure = np.maximum(pressure - step * direction, 0.0) * allowed
        fresh = (pressure == 0) & (overlap < 0) & allowed
        if fresh.any():
            conjugate = 0.0
            pressure[fresh] = -step * overlap[fresh]
        if target is not None:
            pressure *= target / pressure.sum()
        if not fresh.any() and np.sqrt(energy / touching.sum()) < 1e-7 * max(abs(level), 1e-12):
            return pressure, level
    raise ConvergenceError(f"the contact did not converge in 2000 iterations on {grid.x.shape} cells")
