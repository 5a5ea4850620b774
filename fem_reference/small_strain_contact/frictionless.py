"""Frictionless contact of a rigid indenter on a compliant surface: the contact area is found, not assumed.

Minimise p K p / 2 - p (depth - gap) over p >= 0: pressure only where the surfaces touch, no overlap elsewhere.  K is a
convolution on square cells, applied with a fast Fourier transform.  For a guessed set of touching cells conjugate
gradients give the pressures; cells that are pulled leave the set and cells that are pierced join it, all at once while
that helps and one at a time where it does not (block principal pivoting: Judice and Pires 1994, Kim and Park 2011), so
the set is found in finitely many exchanges.  Long waves yield far more than short ones, above all under a stiff foil:
the inverse of the kernel's spectrum balances them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy import fft

from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from meshes import Indenter

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


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


class Sides(Protocol):
    """What the side edges of a cover of limited size change, in the indenter's frame."""

    @property
    def window(self) -> tuple[FloatArray, FloatArray]:
        """Centre and half widths of a rectangle that holds the contact, shape (2,) each [m]."""

    def hold(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Which points lie on the cover and in the window."""

    def yielding(self, x: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Forces at points [N] to what the sides add to the displacement there [m]."""


def touch(
    surface: SurfaceCompliance,
    indenter: Indenter,
    *,
    cells: int,
    load: float | None = None,
    depth: float | None = None,
    sides: Sides | None = None,
) -> Patch:
    """Press an indenter, refining the grid onto the contact until `cells` span it.

    Args:
        surface: How the top of a wide cover yields.
        indenter: The shape.
        cells: Cells across the longer side of the contact [-].
        load: Force [N]; or
        depth: Approach [m].  Exactly one of the two.
        sides: What free side edges change; None for a wide cover.

    Raises:
        ConvergenceError: If conjugate gradients do not converge, or the approach is too small for any cell to touch.
    """
    middle, half = (np.zeros(2), np.array(widest(indenter, surface.thickness))) if sides is None else sides.window
    sharp = is_flat(indenter)

    def gap(x: FloatArray, y: FloatArray) -> FloatArray:
        value = indenter.gap(x, y)
        return value if sides is None else np.where(sides.hold(x, y), value, np.inf)

    for _ in range(8):
        grid = _Grid.over(middle, half, cells if sharp else int(1.1 * cells))
        if sharp:
            grid = grid.matched(gap, half)
        yields = _Convolution(grid, surface, sides)
        heights = gap(*grid.inside)
        pressure, approach = _solve(yields, heights, grid.cell, load, depth)
        hit = pressure > 0
        # where all cells' centres are higher than the approach, the contact is around the lowest of them
        near = hit if hit.any() else heights == heights.min()
        reach = np.array([np.abs(grid.x[near] - middle[0]).max(), np.abs(grid.y[near] - middle[1]).max()])
        reach += grid.cell / 2
        if sharp or reach.max() > 0.8 * half.max():
            break
        half = np.minimum(np.maximum(1.1 * reach, 0.05 * half), half)
    if not hit.any():
        raise ConvergenceError(f"nothing touches on cells of {grid.cell * 1e3:.2g} mm; press deeper")
    return Patch(x=grid.x[hit], y=grid.y[hit], force=pressure[hit] * grid.cell**2, cell=grid.cell, depth=approach)


def widest(indenter: Indenter, thickness: float) -> tuple[float, float]:
    """Half widths that no contact passes before the cover is pierced: the footprint, or less of a large ball [m]."""
    if not indenter.axisymmetric:
        return indenter.footprint
    r = np.linspace(0, indenter.footprint[0], _RADII)
    low = np.flatnonzero(indenter.gap(r, np.zeros_like(r)) <= thickness)
    radius = float(r[min(int(low[-1]) + 1, len(r) - 1)])
    return radius, radius


#: Places along the radius at which a round shape's height is asked.
_RADII = 10_001


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Square cells, centred on the window's middle, that fill it exactly along its longer side."""

    x: FloatArray
    y: FloatArray
    cell: float
    middle: FloatArray
    scale: float = 1.0

    @classmethod
    def over(cls, middle: FloatArray, half: FloatArray, cells: int) -> _Grid:
        cell = 2 * half.max() / cells
        count = np.maximum(1, np.round(2 * half / cell)).astype(int)
        axes = [start + (np.arange(n) - (n - 1) / 2) * cell for start, n in zip(middle, count, strict=True)]
        x, y = np.meshgrid(*axes, indexing="ij")
        return cls(x=x, y=y, cell=cell, middle=middle)

    def matched(self, gap: Callable[[FloatArray, FloatArray], FloatArray], half: FloatArray) -> _Grid:
        """The same cells scaled so that those inside a flat face have exactly its area.

        A round edge cut into squares is too large or too small by chance; with the right area the error falls
        smoothly with the cell and can be extrapolated.
        """
        fine = _Grid.over(self.middle, half, 1201)
        area = np.isfinite(gap(fine.x, fine.y)).sum() * fine.cell**2
        own = int(np.isfinite(gap(self.x, self.y)).sum())
        if not own:
            raise ValueError(
                f"no cell of {self.cell * 1e3:.2g} mm has its middle on the indenter's face: its walls are too thin"
            )
        scale = np.sqrt(area / (own * self.cell**2))
        x, y = (m + (place - m) * scale for m, place in zip(self.middle, (self.x, self.y), strict=True))
        return _Grid(x=x, y=y, cell=self.cell * float(scale), middle=self.middle, scale=float(scale))

    @property
    def inside(self) -> tuple[FloatArray, FloatArray]:
        """Where the cells were before they were scaled: these tell what lies inside [m]."""
        x, y = (m + (place - m) / self.scale for m, place in zip(self.middle, (self.x, self.y), strict=True))
        return x, y


class _Convolution:
    """Cell pressures to cell displacements by a zero-padded fast Fourier transform, and what side edges add."""

    def __init__(self, grid: _Grid, surface: SurfaceCompliance, sides: Sides | None) -> None:
        self._shape = grid.x.shape
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in self._shape)
        offsets = [np.minimum(np.arange(m), m - np.arange(m)) * grid.cell for m in self._padded]
        x, y = np.meshgrid(*offsets, indexing="ij")
        kernel = surface.of_rectangle(x, y, grid.cell, grid.cell)
        self._spectrum = fft.rfft2(kernel)
        size = np.abs(self._spectrum)
        self._inverse = kernel[0, 0] / np.maximum(size, 1e-4 * size.max())
        self._more = None if sides is None else sides.yielding(grid.x.ravel(), grid.y.ravel())
        self._area = grid.cell**2

    def __call__(self, pressure: FloatArray) -> FloatArray:
        wide = self._filtered(pressure, self._spectrum)
        if self._more is None:
            return wide
        return wide + self._more(pressure.ravel() * self._area).reshape(self._shape)

    def balanced(self, overlap: FloatArray) -> FloatArray:
        """Long and short waves of an overlap brought to the same weight: the preconditioner [m]."""
        return self._filtered(overlap, self._inverse)

    def _filtered(self, values: FloatArray, spectrum: npt.NDArray[np.inexact[Any]]) -> FloatArray:
        full = fft.irfft2(fft.rfft2(values, self._padded) * spectrum, self._padded)
        return np.asarray(full[: self._shape[0], : self._shape[1]])


def is_flat(indenter: Indenter) -> bool:
    """Whether the lower surface is a plane, so that its edge bounds the contact."""
    half = indenter.footprint
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 41), np.linspace(-half[1], half[1], 41))
    gap = indenter.gap(x, y)
    return bool((gap[np.isfinite(gap)] == 0).all())


def _solve(
    yields: _Convolution, gap: FloatArray, cell: float, load: float | None, depth: float | None
) -> tuple[FloatArray, float]:
    """Pressures on the grid, from the gap of each cell (inf where none can touch), and the approach."""
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth")
    allowed = np.isfinite(gap)
    gap = np.where(allowed, gap, 0.0)
    touching = allowed if (gap == 0).all() else allowed & (gap <= _first_reach(gap, allowed, depth))
    fewest, patience = gap.size + 1, _PATIENCE
    for _ in range(_EXCHANGES):
        pressure, level = _held(yields, gap, touching, None if load is None else load / cell**2, depth)
        overlap = yields(pressure) + gap - level
        pulled = touching & (pressure < 0)
        pierced = allowed & ~touching & (overlap < -_NEGLIGIBLE * level)
        wrong = pulled | pierced
        count = int(wrong.sum())
        if count == 0:
            return pressure, level
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong = _last(wrong)
        touching = touching ^ wrong
    raise ConvergenceError(f"the contact did not settle in {_EXCHANGES} exchanges on {gap.shape} cells")


_EXCHANGES, _PATIENCE = 400, 10
#: Overlap that counts as none, relative to the approach.
_NEGLIGIBLE = 1e-8


def _first_reach(gap: FloatArray, allowed: BoolArray, depth: float | None) -> float:
    """Gap up to which cells are taken to touch at first: about half the depth, at least a few cells [m]."""
    few = float(np.sort(gap[allowed])[min(8, allowed.sum() - 1)])
    return max(few, 0.5 * depth) if depth is not None else float(np.quantile(gap[allowed], 0.2))


def _last(wrong: BoolArray) -> BoolArray:
    """Only the last of the cells: single exchanges cannot cycle (Murty 1974)."""
    out = np.zeros_like(wrong)
    out.flat[np.flatnonzero(wrong)[-1]] = True
    return out


def _held(
    yields: _Convolution, gap: FloatArray, touching: BoolArray, load: float | None, depth: float | None
) -> tuple[FloatArray, float]:
    """Pressures that hold the cover on the indenter over the touching cells, and the approach."""
    if load is None and depth is not None:
        return _conjugate_gradients(yields, depth - gap, touching), depth
    per_depth = _conjugate_gradients(yields, np.ones_like(gap), touching)
    if not gap[touching].any():
        level = float((load or 0.0) / per_depth.sum())
        return level * per_depth, level
    at_rest = _conjugate_gradients(yields, gap, touching)
    level = float(((load or 0.0) + at_rest.sum()) / per_depth.sum())
    return level * per_depth - at_rest, level


def _conjugate_gradients(yields: _Convolution, wanted: FloatArray, touching: BoolArray) -> FloatArray:
    """Pressures on the touching cells that move them by `wanted` [m]."""
    pressure = np.zeros_like(wanted)
    rest = np.where(touching, wanted, 0.0)
    small = _TIGHT * float(np.linalg.norm(rest))
    direction, previous = np.zeros_like(wanted), 1.0
    for _ in range(_ITERATIONS):
        if np.linalg.norm(rest) <= small:
            return pressure
        even = np.where(touching, yields.balanced(rest), 0.0)
        energy = float((rest * even).sum())
        direction = even + energy / previous * direction
        previous = energy
        image = np.where(touching, yields(direction), 0.0)
        step = energy / float((image * direction).sum())
        pressure += step * direction
        rest -= step * image
    raise ConvergenceError(f"conjugate gradients did not converge in {_ITERATIONS} iterations")


_ITERATIONS = 1000
#: Residual displacement relative to the wanted one.
_TIGHT = 1e-8
