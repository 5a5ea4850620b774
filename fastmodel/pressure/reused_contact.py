"""A solved contact that is carried along while its bodies rest or only slide, instead of solved anew.

A laterally wide cover answers everywhere alike: what slides without turning, pressed alike, keeps its pressure.  So
cell forces move with the bodies, by whole cells as they are and between them by shares, and follow the loads: they are
scaled, and lean with the point of pressure by a factor that is linear in place.  Under flat punches that is the answer
to another moment; elsewhere it is close for small moves, and larger ones, turns and meetings are solved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import chain
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import choose_kernel
from fastmodel.contact.interface import Reading
from fastmodel.contact.plate import Touching
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap_sampling import Load, Samples

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
#: Change of a body's force over itself, and of its pressure at the rims along x and y, over it [-].
_Change = tuple[float, float, float]

#: Cells by which a contact may slide before it is solved anew, by which its parts may move against one another, and by
#: which they may move and still count as unmoved [-].
_FAR, _APART, _STILL = 1.0, 0.05, 1e-4
#: Change of a body's force over itself, and of the pressure on any cell as the point of pressure moves, over it [-].
_HARDER, _LEANT = 5e-3, 0.2
#: Sine, squared, of the angle that cells of one body span at least for it to lean [-].
_FLAT = 1e-6
#: Lean that counts as none, and change that counts as none once a contact has come to rest [-].
_UPRIGHT, _REST = 1e-4, 1e-6


class Laid(NamedTuple):
    """The forces of a contact on cells.

    Attributes:
        forces: On each sampled cell, shape (m,) [N].
        level: Height over each body's lowest point up to which its cells go under the top, shape (bodies,) [m].
        approach: Of each body from its first touch of the undeformed cover, where known, shape (bodies,) [m].
        on_cells: From forces on sampled cells to forces on a window of whole cells, where forces go on to the base.
        origin: Row and column of that window's first cell.
    """

    forces: FloatArray
    level: FloatArray
    approach: FloatArray | None = None
    on_cells: Callable[[FloatArray], FloatArray] | None = None
    origin: tuple[int, int] = (0, 0)


class Base(Protocol):
    """The way from cells to texels at the base."""

    def of_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Force on each texel from forces on a window of cells, shape (n,) [N]."""


class Held:
    """One solved contact."""

    def __init__(
        self,
        touching: Touching,
        samples: Samples,
        laid: Laid,
        grid: CellGrid,
        base: Base | None,
        *,
        reach: Sequence[float],
        flat: bool,
        native: bool | None = False,
    ) -> None:
        """Remember the contact.

        Args:
            touching: The bodies that it was solved for.
            samples: Cells under them.
            laid: The solution.
            grid: The cells of the array.
            base: The way to the base, where the method knows it.
            reach: Height over each body's lowest point up to which those cells were looked at, shape (bodies,) [m].
            flat: Whether the array is one flat, even grid, on which contacts can slide.
            native: True for compiled loops, False for numpy, None for whichever is there.
        """
        self.samples, self.touching, self.reach = samples, touching, reach
        self._laid, self._grid, self._base = laid, grid, base
        self._apart = choose_kernel(_apart_loops, _apart, native=native)
        self._flat, self._between = flat, choose_kernel(_between_loops, _between, native=native)
        self._carried: list[float] = []
        self._windows: tuple[FloatArray, FloatArray | None] | None = None
        self.reading = self._read(laid.forces)

    def slid(self, now: Touching) -> tuple[int, int] | None:
        """Whole rows and columns by which the same bodies have slid; None where they have not moved at all."""
        way = self._way(now)
        if way is None:
            return 0, 0
        return None if max(*map(abs, way[0]), way[1]) <= _STILL else (round(way[0][1]), round(way[0][0]))

    def carry(self, now: Touching) -> Reading | None:
        """The contact where it is now; None where it must be solved anew."""
        way = self._way(now)
        if way is None or way[1] > (_APART if self._flat else _STILL):
            return None
        slid = (0.0, 0.0) if max(map(abs, way[0])) <= _STILL else way[0]
        if slid != (0.0, 0.0) and not self._may_slide(slid):
            return None
        changes = self._changes(now, slid)
        if changes is None or self._rests([*slid, *chain.from_iterable(changes)]):
            return None
        if len(changes) == 1 and max(map(abs, changes[0][1:])) <= _UPRIGHT:
            factor = 1 + changes[0][0]
            if slid == (0.0, 0.0):
                return _scaled(self.reading, factor)
            if self._windows is None:
                self._windows = self._on_windows(self._laid.forces)
            return self._shifted(*self._windows, slid, factor)
        forces = self._laid.forces.copy()
        for lean, change in zip(self._leans, changes, strict=True):
            forces[lean.mine] *= lean.factor(change)
        return self._read(forces) if slid == (0.0, 0.0) else self._shifted(*self._on_windows(forces), slid)

    def _rests(self, state: list[float]) -> bool:
        """Whether the contact has come to rest other than it was solved: what rests is worth a solution of its own."""
        was, self._carried = self._carried, state
        return max(map(abs, state)) > _REST and bool(
            was and max(abs(a - b) for a, b in zip(was, state, strict=True)) <= _REST
        )

    def _way(self, now: Touching) -> tuple[tuple[float, float], float] | None:
        """How far all bodies have slid together along x and y, and their parts against one another, in cells.

        None where other bodies touch than before, or one has tilted whose moments do not say so.
        """
        if self.touching.bodies != now.bodies:
            return None
        stood, stands, apart, edge = self.touching.standing, now.standing, 0.0, self._grid.edge
        # the first body says how far all have slid
        slid = stands[0].position[0] - stood[0].position[0] if self._flat else np.zeros(3)
        for a, b, load in zip(stood, stands, now.loads, strict=True):
            along, tilted = self._apart(
                a.rotation, a.position, b.rotation, b.position, a.shape.extents, slid, self._flat
            )
            if not load.tilts and tilted > _STILL * min(edge):
                return None
            apart = max(apart, along)
        x, y, _ = slid.tolist()
        return (x / edge[0], y / edge[1]), apart / min(edge)

    def _may_slide(self, slid: tuple[float, float]) -> bool:
        """Whether bodies lie within the grid altogether, then and now."""
        if max(map(abs, slid)) > _FAR:
            return False
        grid = self._grid
        low, high = self._bounds
        for k, size in ((0, grid.columns), (1, grid.rows)):
            if min(low[k], low[k] + slid[k]) < 0 or max(high[k], high[k] + slid[k]) > size:
                return False
        return True

    @cached_property
    def _bounds(self) -> tuple[list[float], list[float]]:
        """Lowest and highest x and y of all bodies, in cells from the grid's corner."""
        low, high = zip(*(standing.bounds(self._grid) for standing in self.touching.standing), strict=True)
        return np.concatenate(low).min(axis=0).tolist(), np.concatenate(high).max(axis=0).tolist()

    def _changes(self, now: Touching, slid: tuple[float, float]) -> list[_Change] | None:
        """How the pressure of each body follows its load; None where that is too much."""
        loads = list(zip(self.touching.loads, now.loads, strict=True))
        if any(abs(b.force - a.force) > _HARDER * a.force for a, b in loads):
            return None
        if not self._flat:
            still = _STILL * min(self._grid.edge)
            return (
                [(b.force / a.force - 1, 0.0, 0.0) for a, b in loads]
                if all(b.alike(a, still) for a, b in loads)
                else None
            )
        shift = (slid[0] * self._grid.edge[0], slid[1] * self._grid.edge[1])
        changes = [lean.change(a, b, shift) for lean, (a, b) in zip(self._leans, loads, strict=True)]
        return changes if all(abs(x) + abs(y) <= _LEANT for _, x, y in changes) else None

    @cached_property
    def _leans(self) -> list[_Lean]:
        return [_Lean(self.samples, self._laid.forces, body) for body in range(len(self.touching.bodies))]

    def _read(self, forces: FloatArray) -> Reading:
        """The reading of cell forces where the contact was solved."""
        spread = None
        if self._base is not None and self._laid.on_cells is not None:
            spread = self._base.of_window(self._laid.on_cells(forces), self._laid.origin)
        return Reading(self._grid.on_texels(self.samples, forces), spread, float(forces.sum()), self._laid.approach)

    def _on_windows(self, forces: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """The same forces on windows of cells: whole on the cell that they stand over, and as they go to the base."""
        rows, columns = self._window[1]
        own = np.bincount(self._in_window, forces, rows * columns).reshape(rows, columns).astype(np.float64, copy=False)
        return own, None if self._laid.on_cells is None else self._laid.on_cells(forces)

    @cached_property
    def _window(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First row and column of the window that holds the cells, and its size."""
        row, column = self.samples.row, self.samples.column
        first, last = (int(row.min()), int(column.min())), (int(row.max()), int(column.max()))
        return first, (last[0] - first[0] + 1, last[1] - first[1] + 1)

    @cached_property
    def _in_window(self) -> IntArray:
        """Which cell of that window each sampled cell is, row by row, shape (m,)."""
        (row, column), (_, columns) = self._window
        return np.asarray((self.samples.row - row) * columns + self.samples.column - column)

    def _shifted(
        self, own: FloatArray, spread: FloatArray | None, slid: tuple[float, float], factor: float = 1.0
    ) -> Reading:
        """The reading of windows of cell forces times a factor that have slid."""
        whole = (math.floor(slid[1]), math.floor(slid[0]))
        part = (slid[1] - whole[0], slid[0] - whole[1])
        first = self._window[0]
        moved = self._between(own, _linear(part[0]) * factor, _linear(part[1]))
        contact = self._grid.window_on_texels(moved, (first[0] + whole[0], first[1] + whole[1]))
        texels = None
        if self._base is not None and spread is not None:
            origin = self._laid.origin
            # one cell more on the lower side, see _cubic
            corner = (origin[0] + whole[0] - 1, origin[1] + whole[1] - 1)
            moved = self._between(spread, _cubic(part[0]) * factor, _cubic(part[1]))
            texels = self._base.of_window(moved, corner)
        return Reading(contact, texels, factor * float(own.sum()), self._laid.approach)


class _Lean:
    """How the pressure of one body follows its load: by a factor linear in place."""

    def __init__(self, samples: Samples, forces: FloatArray, body: int) -> None:
        self.mine = slice(None) if samples.bodies == 1 else (samples.body == body).nonzero()[0]
        x, y, forces = samples.x[self.mine], samples.y[self.mine], forces[self.mine]
        total = forces.sum()
        self._middle = (float(x @ forces / total), float(y @ forces / total))
        x, y = x - self._middle[0], y - self._middle[1]
        rim = self._rim = (float(np.abs(x).max()) or 1.0, float(np.abs(y).max()) or 1.0)
        self._x, self._y = x / rim[0], y / rim[1]
        xx, yy, xy = (
            float((forces * a * b).sum()) for a, b in ((self._x, self._x), (self._y, self._y), (self._x, self._y))
        )
        det = xx * yy - xy * xy
        # in a line there is no lean
        self._inverse = (yy / det, xx / det, -xy / det) if det > _FLAT * xx * yy else None

    def change(self, before: Load, now: Load, shift: tuple[float, float]) -> _Change:
        """What `factor` takes, from the load before to the one now after a shift [m]."""
        more = now.force - before.force
        if not now.tilts:
            return more / before.force, 0.0, 0.0
        # sums of force times place about the middle of pressure, in units of the rim
        u, v = (
            float(now.moment[k] - before.moment[k] - shift[k] * now.force - self._middle[k] * more) / self._rim[k]
            for k in (0, 1)
        )
        if self._inverse is None:
            return more / before.force, math.inf if max(abs(u), abs(v)) > _UPRIGHT * before.force else 0.0, 0.0
        a, b, c = self._inverse
        return more / before.force, a * u + c * v, c * u + b * v

    def factor(self, change: _Change) -> FloatArray:
        """What the force on each of the body's cells is multiplied by."""
        return 1 + change[0] + change[1] * self._x + change[2] * self._y


def _scaled(reading: Reading, factor: float) -> Reading:
    spread = reading.texel_forces
    return Reading(
        contact_forces=reading.contact_forces * factor,
        texel_forces=None if spread is None else spread * factor,
        carried=reading.carried * factor,
        approach=reading.approach,
    )


def _linear(part: float) -> FloatArray:
    """Shares of an even square on the cell it has left in part and on the next: areas, never negative."""
    return np.array([1 - part, part])


def _cubic(part: float) -> FloatArray:
    """Weights on the cells from -1 to 2 that act at a distance as one in between does (Lagrange)."""
    p, q, r = part + 1, part - 1, part - 2
    return np.array([-part * q * r / 6, p * q * r / 2, -p * part * r / 2, p * part * q / 6])


def _apart(  # noqa: PLR0917 -- numba kernels take positions
    was: FloatArray, at: FloatArray, now: FloatArray, to: FloatArray, extents: FloatArray, slid: FloatArray, flat: bool
) -> tuple[float, float]:
    """How far points of solids have moved at most, but for what all have slid: on a flat array along it; by tilts.

    What is round tilts as its axis does: its ends by the axis' own height, and their rims by as much as they face the
    array.

    Args:
        was: Axes of the solids before, shape (p, 3, 3) [-].
        at: Their origins before, shape (p, 3) [m].
        now: Their axes now.
        to: Their origins now.
        extents: As `Shape` has them, shape (p, 4) [m].
        slid: How far all have slid, shape (3,) [m].
        flat: Whether the array is flat.
    """
    way, change = to - at, now - was
    turn = np.add.reduce(np.abs(change) * extents[:, None, :3], axis=2)
    axis = change[:, :, 2]
    rim = extents[:, 3] * np.abs(now[:, 2, 2]) * np.sqrt((axis * axis).sum(axis=1))
    tilted = turn[:, 2] + rim + np.abs(way[:, 2] - way[0, 2])
    return float((np.abs(way - slid) + turn)[:, : 2 if flat else 3].max()), float(tilted.max())


def _apart_loops(  # noqa: PLR0917 -- numba kernels take positions
    was: FloatArray, at: FloatArray, now: FloatArray, to: FloatArray, extents: FloatArray, slid: FloatArray, flat: bool
) -> tuple[float, float]:
    """The same as loops, for numba."""
    most, tilted = 0.0, 0.0
    for p in range(len(at)):
        for i in range(3):
            turn = 0.0
            for k in range(3):
                turn += abs(now[p, i, k] - was[p, i, k]) * extents[p, k]
            if i < 2 or not flat:  # noqa: PLR2004 -- height
                most = max(most, turn + abs(to[p, i] - at[p, i] - slid[i]))
            if i == 2:  # noqa: PLR2004
                axis = 0.0
                for k in range(3):
                    axis += (now[p, k, 2] - was[p, k, 2]) ** 2
                turn += extents[p, 3] * abs(now[p, 2, 2]) * math.sqrt(axis)
                apart = to[p, 2] - at[p, 2] - to[0, 2] + at[0, 2]
                tilted = max(tilted, turn + abs(apart))
    return most, tilted


def _between(window: FloatArray, down: FloatArray, right: FloatArray) -> FloatArray:
    """A window moved by parts of a cell, larger by the reach of the weights along rows and columns."""
    rows, columns = window.shape
    half = np.zeros((rows + len(down) - 1, columns))
    for k, weight in enumerate(down):
        half[k : k + rows] += weight * window
    moved = np.zeros((len(half), columns + len(right) - 1))
    for k, weight in enumerate(right):
        moved[:, k : k + columns] += weight * half
    return moved


def _between_loops(window: FloatArray, down: FloatArray, right: FloatArray) -> FloatArray:
    """The same as loops, for numba."""
    rows, columns = window.shape
    moved = np.zeros((rows + len(down) - 1, columns + len(right) - 1))
    for i in range(rows):
        for j in range(columns):
            force = window[i, j]
            if force != 0.0:
                for k in range(len(down)):
                    for n in range(len(right)):
                        moved[i + k, j + n] += down[k] * right[n] * force
    return moved
