"""Several rigid indenters in one small-strain contact problem: each at its own depth, guided or free to tilt.

The bodies are coupled through the cover only.  As in `contact`, pressure p >= 0 minimises p K p / 2 + p gap, here with
the force of every body prescribed and, where it is free to tilt, both moments about the point its weight acts at; the
multipliers are each body's approach and tilts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

from fem_reference.linear_response.point_spread import PointSpread, decay_length, point_spread
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, surface_compliance
from fem_reference.small_strain_contact.frictionless import ConvergenceError
from meshes import Cover, Indenter, TexelArray

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

#: Cells along the thickness on the two grids; the error falls as the cell size under sharp edges.
CELLS = (8, 16)
_STEPS = 4000


@dataclass(frozen=True, kw_only=True)
class Body:
    """One rigid indenter on the cover.

    Attributes:
        indenter: The shape.
        load: Its weight [N].
        at: Its axis in the array's frame [m].
        yaw: Its turn about that axis [rad].
        guided: Whether it can only move along the array's normal; else it tilts freely as well.
        centre: Where its weight acts, from its axis, in its own frame [m].
    """

    indenter: Indenter
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    guided: bool = True
    centre: tuple[float, float] = (0.0, 0.0)

    def local(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions in the indenter's frame [m]."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return c * (x - self.at[0]) + s * (y - self.at[1]), c * (y - self.at[1]) - s * (x - self.at[0])

    def corners(self) -> FloatArray:
        """Corners of the footprint in the array's frame, shape (4, 2) [m]."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        half = np.array(self.indenter.footprint)
        signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        turned: FloatArray = (signs * half) @ np.array([[c, s], [-s, c]])
        return np.asarray(turned + np.array(self.at))


@dataclass(frozen=True, kw_only=True, eq=False)
class Together:
    """What several indenters do at once.

    Attributes:
        texel_forces: Normal force on each texel, shape (n,) [N].
        outside: Force that no active texel feels [N].
        depths: Approach of each body's axis from first touch, shape (bodies,) [m].
        slopes: Tilts of each body: rise along x and along y, shape (bodies, 2) [-].
        contact: Touching cells: x, y in the array's frame [m] and force [N], shape (m, 3).
        error_estimate: Sum of texel changes between the grids over the load, `misplaced` [-].
    """

    texel_forces: FloatArray
    outside: float
    depths: FloatArray
    slopes: FloatArray
    contact: FloatArray
    error_estimate: dict[str, float]


def press_together(cover: Cover, array: TexelArray, bodies: Sequence[Body]) -> Together:
    """Press frictionless, rigid indenters into a laterally wide cover at once (small strain).

    Args:
        cover: The cover; hyperelastic materials are linearised at zero load.
        array: The texels under it.
        bodies: The indenters; their footprints must not overlap.

    Raises:
        ValueError: If a load is not positive.
        ConvergenceError: If the contact does not converge.
    """
    if not bodies or not all(0 < body.load < np.inf for body in bodies):
        raise ValueError("press_together needs at least one body, each with a positive load")
    spread = point_spread(cover)
    corners = np.concatenate([body.corners() for body in bodies])
    reach = max(1.5 * float(np.hypot(*np.ptp(corners, axis=0))), 4 * decay_length(cover))
    surface = surface_compliance(cover, reach)
    solved = [_solve(surface, bodies, corners, cover.thickness / count) for count in CELLS]
    coarse, fine = (_texel_forces(spread, array, contact) for contact, _ in solved)
    # The error is proportional to the cell: the last two grids say how much is left.
    forces = fine + (fine - coarse) / (CELLS[1] / CELLS[0] - 1)
    contact, motion = solved[-1]
    load = sum(body.load for body in bodies)
    return Together(
        texel_forces=forces,
        outside=load - float(forces.sum()),
        depths=motion[:, 0],
        slopes=motion[:, 1:],
        contact=contact,
        error_estimate={"misplaced": float(np.abs(fine - coarse).sum() / (2 * load))},
    )


def _texel_forces(spread: PointSpread, array: TexelArray, contact: FloatArray) -> FloatArray:
    """Superpose the base response of every cell."""
    blocks = np.array_split(contact, max(1, len(contact) // 2000))
    return np.asarray(sum(block[:, 2] @ spread.texel_influence(array, block[:, :2]) for block in blocks))


def _solve(
    surface: SurfaceCompliance, bodies: Sequence[Body], corners: FloatArray, cell: float
) -> tuple[FloatArray, FloatArray]:
    """Touching cells with their forces, and approach and slopes of each body."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    # whole cells from the lowest corner on, so that edges along the axes fall between cells
    count = np.maximum(1, np.ceil((high - low) / cell - 1e-9)).astype(int)
    x, y = np.meshgrid(*(low[i] + (np.arange(count[i]) + 0.5) * cell for i in range(2)), indexing="ij")
    gaps = np.array([body.indenter.gap(*body.local(x, y)) for body in bodies])
    owner = gaps.argmin(axis=0)
    allowed = np.isfinite(gaps.min(axis=0))
    gap = np.where(allowed, gaps.min(axis=0), 0.0)
    columns, wanted, first = _constraints(bodies, owner, allowed, x, y)
    yields = _Convolution(surface, x.shape, cell)
    force, motion = _minimise(yields, gap, allowed, columns, wanted)
    hit = force > 0
    moved = np.zeros((len(bodies), 3))
    for index, body in enumerate(bodies):
        known = motion[first[index] : first[index] + (1 if body.guided else 3)]
        moved[index, : len(known)] = known
        moved[index, 0] -= moved[index, 1:] @ (_weight_point(body) - body.at)
    return np.column_stack([x[hit], y[hit], force[hit]]), moved


def _weight_point(body: Body) -> FloatArray:
    c, s = np.cos(body.yaw), np.sin(body.yaw)
    turned: FloatArray = np.array([[c, -s], [s, c]]) @ np.array(body.centre)
    return np.asarray(turned + np.array(body.at))


def _constraints(
    bodies: Sequence[Body], owner: npt.NDArray[np.int64], allowed: BoolArray, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Columns (k, rows, columns) that cell forces are summed with, the sums, and each body's first column."""
    columns: list[FloatArray] = []
    wanted: list[float] = []
    first: list[int] = []
    for index, body in enumerate(bodies):
        mine = ((owner == index) & allowed).astype(float)
        first.append(len(columns))
        columns.append(mine)
        wanted.append(body.load)
        if not body.guided:
            point = _weight_point(body)
            columns += [mine * (x - point[0]), mine * (y - point[1])]
            wanted += [0.0, 0.0]
    return np.array(columns), np.array(wanted), first


class _Convolution:
    """Cell forces to cell displacements by a zero-padded fast Fourier transform."""

    def __init__(self, surface: SurfaceCompliance, shape: tuple[int, ...], cell: float) -> None:
        self._shape = shape
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        offsets = [np.minimum(np.arange(m), m - np.arange(m)) * cell for m in self._padded]
        x, y = np.meshgrid(*offsets, indexing="ij")
        self._spectrum = fft.rfft2(surface.of_rectangle(x, y, cell, cell) / cell**2)

    def __call__(self, force: FloatArray) -> FloatArray:
        full = fft.irfft2(fft.rfft2(force, self._padded) * self._spectrum, self._padded)
        return np.asarray(full[: self._shape[0], : self._shape[1]])


def _minimise(
    yields: _Convolution, gap: FloatArray, allowed: BoolArray, columns: FloatArray, wanted: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Projected conjugate gradients; an overlap elsewhere joins the contact, a pull leaves it."""
    sizes = np.abs(columns).max(axis=(1, 2))
    scaled = columns / sizes[:, None, None]
    target = wanted / sizes
    force = _balanced(allowed.astype(float), scaled, target)
    direction, previous, conjugate = np.zeros_like(gap), 1.0, 0.0
    for _ in range(_STEPS):
        touching = force > 0
        overlap = yields(force) + gap
        motion = _fitted(overlap, scaled, touching)
        overlap -= np.tensordot(motion, scaled, 1)
        energy = float((overlap[touching] ** 2).sum())
        direction = np.where(touching, overlap + conjugate * energy / previous * direction, 0.0)
        previous, conjugate = energy, 1.0
        image = yields(direction)
        image -= np.tensordot(_fitted(image, scaled, touching), scaled, 1)
        step = float((overlap * direction)[touching].sum() / (image * direction)[touching].sum())
        moved = np.maximum(force - step * direction, 0.0)
        fresh = (force == 0) & (overlap < 0) & allowed
        if fresh.any():
            conjugate = 0.0
            moved[fresh] = -step * overlap[fresh]
        force = _balanced(moved, scaled, target)
        level = max(float(np.abs(motion).max()), 1e-12)
        if not fresh.any() and np.sqrt(energy / touching.sum()) < 1e-6 * level:
            return force, motion / sizes
    raise ConvergenceError(f"the contact did not converge in {_STEPS} iterations on {gap.shape} cells")


def _fitted(values: FloatArray, columns: FloatArray, where: BoolArray) -> FloatArray:
    """Coefficients of the columns that fit values best on some cells, shape (k,)."""
    mine = columns[:, where]
    return np.asarray(np.linalg.solve(mine @ mine.T, mine @ values[where]))


def _balanced(force: FloatArray, columns: FloatArray, target: FloatArray) -> FloatArray:
    """Forces times a factor that is linear in place for each body, so that the sums are what they must be."""
    for _ in range(50):
        miss = target - np.tensordot(columns, force, 2)
        if np.abs(miss).max() < 1e-12 * np.abs(target).max():
            break
        flat = columns.reshape(len(columns), -1)
        gram = (flat * force.ravel()) @ flat.T
        factor = 1 + np.tensordot(np.linalg.solve(gram, miss), columns, 1)
        force = force * np.maximum(factor, 0.1)
    return force
