# ruff: noqa: PLR0917 -- numba kernels take positions
"""The inner loops of `cover_solver` and `foundation`, for numba; `iterate` and `match_springs` say what they take.

All in one file: numba's cache notices changes in the file of a kernel only, not in those of what it calls.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import called_by_kernels
from fastmodel.pressure.iteration import CORRECTIONS, KEPT, Contact, Cover

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
#: Most steps of Newton's method on springs.
SPRING_STEPS = 60


@called_by_kernels()
def _gram(columns: FloatArray, weight: FloatArray, matrix: FloatArray) -> None:
    """Sums of weight times column times column over the rows of `columns` (m, k), into `matrix` (k, k)."""
    k = columns.shape[1]
    for a in range(k):
        for b in range(a + 1):
            total = 0.0
            for i in range(columns.shape[0]):
                total += weight[i] * columns[i, a] * columns[i, b]
            matrix[a, b] = total
            matrix[b, a] = total


@called_by_kernels()
def _project(values: FloatArray, columns: FloatArray, sums: FloatArray) -> None:
    """Sums of values (m,) times columns (m, k), into `sums` (k,)."""
    for a in range(columns.shape[1]):
        total = 0.0
        for i in range(columns.shape[0]):
            total += values[i] * columns[i, a]
        sums[a] = total


@called_by_kernels()
def _eliminate(matrix: FloatArray, ridge: float, wanted: FloatArray, found: FloatArray) -> None:
    """Solve matrix @ found = wanted, without a choice of pivots, which a positive matrix does not need.

    Args:
        matrix: Symmetric, positive, shape (k, k); destroyed.
        ridge: What is added to its diagonal.
        wanted: Right-hand side, shape (k,).
        found: The solution, shape (k,).
    """
    k = matrix.shape[0]
    for i in range(k):
        found[i] = wanted[i]
        matrix[i, i] += ridge
    for i in range(k):
        for j in range(i + 1, k):
            factor = matrix[j, i] / matrix[i, i]
            for n in range(i, k):
                matrix[j, n] -= factor * matrix[i, n]
            found[j] -= factor * found[i]
    for i in range(k - 1, -1, -1):
        for n in range(i + 1, k):
            found[i] -= matrix[i, n] * found[n]
        found[i] /= matrix[i, i]


@called_by_kernels()
def scatter_loops(corner: IntArray, weight: FloatArray, forces: FloatArray, window: FloatArray) -> None:
    """Fill a window of cells with forces (m,), shared by weights (4, m) among four cells from each corner (2, m)."""
    for i in range(window.shape[0]):
        for j in range(window.shape[1]):
            window[i, j] = 0.0
    for i in range(len(forces)):
        if forces[i] != 0.0:
            row, col = corner[0, i], corner[1, i]
            window[row, col] += weight[0, i] * forces[i]
            window[row, col + 1] += weight[1, i] * forces[i]
            window[row + 1, col] += weight[2, i] * forces[i]
            window[row + 1, col + 1] += weight[3, i] * forces[i]


@called_by_kernels()
def _yields(
    cover: Cover, forces: FloatArray, window: FloatArray, half: FloatArray, beside: FloatArray, moved: FloatArray
) -> None:
    """Displacements of the sampled cells, into `moved` (m,); the others are room for windows."""
    target, weight, soft, first, second = cover
    rows, cols = window.shape
    scatter_loops(target, weight, forces, window)
    np.dot(first, window, half)
    for t in range(half.shape[0]):
        for j in range(cols):
            beside[t % rows, t // rows * cols + j] = half[t, j]
    np.dot(beside, second, window)
    for i in range(len(forces)):
        row, col = target[0, i], target[1, i]
        moved[i] = soft[i] * forces[i] + weight[0, i] * window[row, col] + weight[1, i] * window[row, col + 1]
        moved[i] += weight[2, i] * window[row + 1, col] + weight[3, i] * window[row + 1, col + 1]


@called_by_kernels()
def _balance(
    forces: FloatArray, columns: FloatArray, wanted: FloatArray, matrix: FloatArray, room: FloatArray
) -> tuple[float, bool]:
    """Scale forces until they add up to what is wanted: what they still miss, and whether they were changed."""
    k, changed, missed, scale = len(wanted), False, np.inf, 0.0
    for a in range(k):
        scale = max(scale, abs(wanted[a]))
    for _ in range(CORRECTIONS):
        _project(forces, columns, room[0])
        missed = 0.0
        for a in range(k):
            room[0, a] = wanted[a] - room[0, a]
            missed = max(missed, abs(room[0, a]))
        if missed <= 1e-9 * scale:
            break
        changed = True
        _gram(columns, forces, matrix)
        _eliminate(matrix, _ridge(matrix), room[0], room[1])
        for i in range(len(forces)):
            factor = 1.0
            for a in range(k):
                factor += columns[i, a] * room[1, a]
            forces[i] *= max(factor, KEPT)
    return missed, changed


@called_by_kernels()
def _ridge(matrix: FloatArray) -> float:
    """What keeps a matrix regular."""
    trace = 1e-288
    for a in range(len(matrix)):
        trace += matrix[a, a]
    return 1e-12 * trace


@called_by_kernels()
def _residual(
    forces: FloatArray, overlap: FloatArray, columns: FloatArray, motion: FloatArray, residual: FloatArray
) -> tuple[float, float, bool]:
    """Fill the overlap that rigid motion leaves: its square and that of all where cells touch; whether others come."""
    energy, size, comes = 0.0, 0.0, False
    for i in range(len(forces)):
        residual[i] = overlap[i]
        for a in range(len(motion)):
            residual[i] -= columns[i, a] * motion[a]
        if forces[i] > 0:
            energy += residual[i] * residual[i]
            size += overlap[i] * overlap[i]
        elif residual[i] < 0:
            comes = True
    return energy, size, comes


@called_by_kernels()
def _fit(
    active: FloatArray, values: FloatArray, columns: FloatArray, matrix: FloatArray, sums: FloatArray, found: FloatArray
) -> None:
    """Motions whose columns are nearest to some values on the touching cells; `matrix` and `sums` are room."""
    _gram(columns, active, matrix)
    for a in range(len(sums)):
        sums[a] = 0.0
        for i in range(len(values)):
            sums[a] += active[i] * values[i] * columns[i, a]
    _eliminate(matrix, _ridge(matrix), sums, found)


@called_by_kernels()
def _length(
    active: FloatArray,
    residual: FloatArray,
    direction: FloatArray,
    image: FloatArray,
    columns: FloatArray,
    shifts: FloatArray,
) -> tuple[float, float]:
    """Curvature along a direction, and the length of the step along it."""
    curvature, along = 0.0, 0.0
    for i in range(len(active)):
        free = direction[i]
        for a in range(len(shifts)):
            free -= active[i] * columns[i, a] * shifts[a]
        curvature += image[i] * free
        along += residual[i] * direction[i]
    return curvature, along / curvature if curvature > 0 else 0.0


@called_by_kernels()
def _advance(
    length: float,
    active: FloatArray,
    residual: FloatArray,
    direction: FloatArray,
    before: FloatArray,
    forces: FloatArray,
) -> bool:
    """Take the step; whether cells came or went."""
    anew = False
    for i in range(len(forces)):
        before[i] = forces[i]
        if active[i] == 0.0:
            forces[i] = -length * residual[i] if residual[i] < 0 else 0.0
            anew = anew or residual[i] < 0
        else:
            forces[i] -= length * direction[i]
            if forces[i] < 0:
                forces[i], anew = 0.0, True
    return anew


@called_by_kernels()
def _change(forces: FloatArray, before: FloatArray, active: FloatArray) -> float:
    """Sum of changes; fills which cells touch."""
    change = 0.0
    for i in range(len(forces)):
        change += abs(forces[i] - before[i])
        active[i] = 1.0 if forces[i] > 0 else 0.0
    return change


def iterate_loops(  # noqa: C901 -- one loop, as numba likes it
    contact: Contact, start: FloatArray, tolerance: float, most: int
) -> tuple[FloatArray, FloatArray, int, bool]:
    """As `cover_iteration.iterate`, but of the cells that each acts on row and column of the first, shape (2, m)."""
    cover, gap, columns, wanted = contact
    count, k = columns.shape
    rows, cols, tall = cover[3].shape[1], cover[4].shape[1], cover[3].shape[0]
    window, half, beside = np.empty((rows, cols)), np.empty((tall, cols)), np.empty((rows, tall // rows * cols))
    forces, before, active = start.copy(), start.copy(), np.zeros(count)
    overlap, residual, direction, image = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    matrix, room, motion = np.zeros((k, k)), np.zeros((2, k)), np.zeros(k)
    scale, previous, conjugate, anew = 0.0, 1.0, 0.0, True
    for a in range(k):
        scale = max(scale, abs(wanted[a]))
    for step in range(most + 1):
        missed, corrected = _balance(forces, columns, wanted, matrix, room)
        if missed > 1e-3 * scale:
            return forces, motion, step, False
        if _change(forces, before, active) < tolerance and step > 0:
            return forces, motion, step, True
        if anew or corrected:
            _yields(cover, forces, window, half, beside, overlap)
            for i in range(count):
                overlap[i] += gap[i]
        _fit(active, overlap, columns, matrix, room[0], motion)
        energy, size, comes = _residual(forces, overlap, columns, motion, residual)
        if energy <= 1e-20 * size and not comes:
            return forces, motion, step, True
        for i in range(count):
            direction[i] = active[i] * (residual[i] + conjugate * energy / previous * direction[i])
        _yields(cover, direction, window, half, beside, image)
        _fit(active, direction, columns, matrix, room[0], room[1])
        curvature, length = _length(active, residual, direction, image, columns, room[1])
        if not curvature > 0:
            return forces, motion, step, True
        previous, conjugate = energy, 0.0 if comes else 1.0
        anew = _advance(length, active, residual, direction, before, forces)
        if not anew:
            for i in range(count):
                overlap[i] -= length * image[i]
    return forces, motion, most, False


@called_by_kernels()
def _press(
    springs: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    motion: FloatArray,
    active: FloatArray,
    forces: FloatArray,
    level: FloatArray,
) -> float:
    """What is minimised, at some motion; fills the stiffness of pressed springs, forces and levels."""
    columns, gap, stiffness, target = springs
    value = 0.0
    for a in range(len(target)):
        value -= motion[a] * target[a]
    for i in range(len(gap)):
        level[i] = 0.0
        for a in range(len(target)):
            level[i] += columns[i, a] * motion[a]
        depth = max(level[i] - gap[i], 0.0)
        forces[i] = stiffness[i] * depth
        active[i] = stiffness[i] if depth > 0 else 0.0
        value += 0.5 * forces[i] * depth
    return value


@called_by_kernels()
def _first_motion(gap: FloatArray, stiffness: FloatArray, target: FloatArray, motion: FloatArray) -> float:
    """Put in the approach at which all springs together would bear the load; their stiffness."""
    total, lowest = 0.0, np.inf
    for i in range(len(gap)):
        total += stiffness[i]
        lowest = min(lowest, gap[i])
    motion[0] = lowest + target[0] / total
    return total


@called_by_kernels()
def _missed(forces: FloatArray, columns: FloatArray, target: FloatArray, room: FloatArray) -> float:
    """Fill what products with the columns are, and miss, shape (2, k); the largest miss."""
    _project(forces, columns, room[0])
    most = 0.0
    for a in range(len(target)):
        room[1, a] = target[a] - room[0, a]
        most = max(most, abs(room[1, a]))
    return most


@called_by_kernels()
def _newton(
    columns: FloatArray, active: FloatArray, ridge: float, miss: FloatArray, matrix: FloatArray, step: FloatArray
) -> None:
    """The step that would close the miss if no spring came or went."""
    _gram(columns, active, matrix)
    _eliminate(matrix, ridge, miss, step)


def match_springs_loops(
    columns: FloatArray, gap: FloatArray, stiffness: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """The same as loops, for numba."""
    count, k = columns.shape
    forces, level, active = np.empty(count), np.empty(count), np.empty(count)
    motion, tried, step, room, matrix = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros((2, k)), np.zeros((k, k))
    total = _first_motion(gap, stiffness, target, motion)
    value = _press((columns, gap, stiffness, target), motion, active, forces, level)
    for _ in range(SPRING_STEPS):
        if _missed(forces, columns, target, room) <= 1e-9 * target[0]:
            for i in range(count):
                forces[i] *= target[0] / room[0, 0]
            return forces, level, True
        _newton(columns, active, 1e-9 * total, room[1], matrix, step)
        share, before = 1.0, value
        while True:
            for a in range(k):
                tried[a] = motion[a] + share * step[a]
            value = _press((columns, gap, stiffness, target), tried, active, forces, level)
            if value <= before or share <= 1e-6:  # noqa: PLR2004 -- nothing is left
                break
            share /= 2
        for a in range(k):
            motion[a] = tried[a]
    return forces, level, False
