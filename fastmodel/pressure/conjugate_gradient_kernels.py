# ruff: noqa: PLR0917 -- kernels take their arrays by position
"""Compiled kernels of the contact solver; `conjugate_gradient` calls them.

All stand in one file: numba's cache notices a change in the file of the called kernel only, not in the files of the
functions that this kernel calls.
"""

from __future__ import annotations

import math

import numpy as np

from fastmodel.compiled import called_by_kernels
from meshes.array_types import FloatArray, IntArray

#: The compliance of the cover between sampled cells: for each cell the first of the four whole cells that it acts on
#: (row and column in the window), shape (2, m); its shares on these four, shape (4, m) [-]; its self compliance, shape
#: (m,) [m/N]; and the matrices of `SymmetricConvolution.matrices` [m/N].
Cover = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]

#: Sizes of windows are rounded up to a multiple of this, so that few different matrices are needed.
_BLOCK = 4
#: Least share of a body's load that the last pressures on its present cells must add up to, to serve as a start [-].
_USABLE = 0.5
#: Smallest factor by which one correction multiplies the force on a cell; this keeps forces positive [-].  Corrections
#: restore the balance of force and moments between the cells and the body.
_LEAST_FACTOR = 0.2
#: Most corrections of the balance in one step.
_CORRECTIONS = 40
#: Error of the balance, over the largest target, at which corrections end, and above which the iteration fails [-].
_BALANCED, _UNBALANCED = 1e-9, 1e-3
#: Error of the balance, over the largest target, up to which a correction leaves the displacements valid [-].
_SLIGHT = 1e-6
#: Square of the residual, over that of the displacement, below which only rounding is left [-].
_ROUNDING = 1e-20
#: Ridge added to small symmetric matrices, over their trace; keeps them regular [-].
_RIDGE = 1e-12


def place_cells(
    samples: tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray],
    grid: tuple[IntArray, FloatArray, FloatArray],
    near: FloatArray,
    square: float,
) -> tuple[tuple[int, int], tuple[int, int], IntArray, FloatArray, FloatArray]:
    """Divide each sampled cell among the four whole cells around the centroid of its covered part.

    Args:
        samples: Row, column, coverage, x and y of the cells, see `GapSamples`.
        grid: See `CellGrid.arrays`.
        near: Compliance between cells that lie 0 or 1 rows and columns apart, shape (2, 2) [m/N].
        square: Displacement at the centre of a whole cell under its own unit force on a half space [m/N].

    Returns:
        First cell (row and column) and size of a window that holds all these whole cells; and the first three entries
        of `Cover`.
    """
    row, column, coverage, x, y = samples
    _, low, edge = grid
    top, left, rows, cols = row[0], column[0], 0, 0
    for k in range(len(x)):
        top, left = min(top, row[k]), min(left, column[k])
        rows, cols = max(rows, row[k] + 1), max(cols, column[k] + 1)
    # a rim of one cell around
    top, left, rows, cols = top - 1, left - 1, rows - top + 2, cols - left + 2
    corner, weight = np.empty((2, len(x)), dtype=np.int64), np.empty((4, len(x)))
    own = np.empty(len(x))
    for k in range(len(x)):
        # rounded, so that rounding errors do not divide a whole cell
        u = math.floor(1e9 * ((x[k] - low[0]) / edge[0] - 0.5 - left) + 0.5) * 1e-9
        v = math.floor(1e9 * ((y[k] - low[1]) / edge[1] - 0.5 - top) + 0.5) * 1e-9
        corner[0, k], corner[1, k] = math.floor(v), math.floor(u)
        a, b = u - math.floor(u), v - math.floor(v)
        p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
        weight[0, k], weight[1, k], weight[2, k], weight[3, k] = p, q, r, s
        # compliance that the convolution gives the cell under its own force, instead of near[0, 0]
        interpolated = near[0, 0] * (p * p + q * q + r * r + s * s) + 2 * near[0, 1] * (p * q + r * s)
        interpolated += 2 * near[1, 0] * (p * r + q * s) + 2 * near[1, 1] * (p * s + q * r)
        own[k] = near[0, 0] - interpolated + square * (1 / math.sqrt(coverage[k]) - 1)
    shape = ((rows + _BLOCK - 1) // _BLOCK * _BLOCK, (cols + _BLOCK - 1) // _BLOCK * _BLOCK)
    return (top, left), shape, corner, weight, own


def find_start(
    last: tuple[IntArray, IntArray, FloatArray],
    samples: tuple[IntArray, IntArray, FloatArray, IntArray],
    wanted: FloatArray,
    scratch: FloatArray,
) -> FloatArray:
    """Forces to start from: the last pressures, scaled to the loads; uniform pressure where these do not suffice.

    Args:
        last: Row, column and pressure times the area of a whole cell [N] of the cells of the last solution.
        samples: Row, column, coverage and body of the cells, see `GapSamples`.
        wanted: Load of each body, shape (bodies,) [N].
        scratch: Zeros on the whole grid; left as zeros.
    """
    row, column, coverage, body = samples
    forces, sums, areas = np.zeros(len(row)), np.zeros(len(wanted)), np.zeros(len(wanted))
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = last[2][k]
    for k in range(len(row)):
        forces[k] = scratch[row[k], column[k]] * coverage[k]
        sums[body[k]] += forces[k]
        areas[body[k]] += coverage[k]
    for k in range(len(last[0])):
        scratch[last[0][k], last[1][k]] = 0.0
    for k in range(len(row)):
        b = body[k]
        if sums[b] > _USABLE * wanted[b]:
            forces[k] *= wanted[b] / sums[b]
        else:
            forces[k] = wanted[b] * coverage[k] / areas[b]
    return forces


@called_by_kernels
def _spread_on_window(corner: IntArray, weight: FloatArray, forces: FloatArray, window: FloatArray) -> None:
    """Forces on sampled cells (m,) as forces on whole cells, into `window` (rows, columns) [N]."""
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


@called_by_kernels
def _displace(
    cover: Cover, forces: FloatArray, room: tuple[FloatArray, FloatArray, FloatArray], moved: FloatArray
) -> None:
    """Displacements of the sampled cells under forces on them, into `moved` (m,) [m]; `room` is scratch memory."""
    corner, weight, own, first, second = cover
    window, half, beside = room
    rows, cols = window.shape
    _spread_on_window(corner, weight, forces, window)
    np.dot(first, window, half)
    for t in range(half.shape[0]):
        for j in range(cols):
            beside[t % rows, t // rows * cols + j] = half[t, j]
    np.dot(beside, second, window)
    for i in range(len(forces)):
        row, col = corner[0, i], corner[1, i]
        moved[i] = own[i] * forces[i] + weight[0, i] * window[row, col] + weight[1, i] * window[row, col + 1]
        moved[i] += weight[2, i] * window[row + 1, col] + weight[3, i] * window[row + 1, col + 1]


@called_by_kernels
def _solve_weighted(columns: FloatArray, weight: FloatArray, matrix: FloatArray, found: FloatArray) -> None:
    """Solve (C^T W C) x = b by elimination; the matrix is positive, so no pivoting is needed.

    Args:
        columns: C, shape (m, k).
        weight: Diagonal of W, shape (m,).
        matrix: Scratch memory, shape (k, k).
        found: b; replaced by x, shape (k,).
    """
    k, trace = len(found), 1e-288
    for a in range(k):
        for b in range(a + 1):
            total = 0.0
            for i in range(len(weight)):
                total += weight[i] * columns[i, a] * columns[i, b]
            matrix[a, b] = matrix[b, a] = total
        trace += matrix[a, a]
    for a in range(k):
        matrix[a, a] += _RIDGE * trace
    for a in range(k):
        for b in range(a + 1, k):
            factor = matrix[b, a] / matrix[a, a]
            for n in range(a, k):
                matrix[b, n] -= factor * matrix[a, n]
            found[b] -= factor * found[a]
    for a in range(k - 1, -1, -1):
        for n in range(a + 1, k):
            found[a] -= matrix[a, n] * found[n]
        found[a] /= matrix[a, a]


@called_by_kernels
def _fit_motion(
    active: FloatArray, values: FloatArray, columns: FloatArray, matrix: FloatArray, motion: FloatArray
) -> None:
    """Least-squares fit of columns @ motion (m,) to some values on the active cells, into `motion` (k,)."""
    for a in range(len(motion)):
        motion[a] = 0.0
        for i in range(len(values)):
            motion[a] += active[i] * values[i] * columns[i, a]
    _solve_weighted(columns, active, matrix, motion)


@called_by_kernels
def _scale_sums(forces: FloatArray, columns: FloatArray, target: FloatArray) -> None:
    """Scale forces so that the constraints on sums of forces hold exactly; these have columns of ones and zeros.

    If the centre of pressure lies at the rim of the sampled cells, the corrections leave a small error of balance.  The
    moments then keep that error, and the forces add up to the load.
    """
    for a in range(len(target)):
        is_sum, total = True, 0.0
        for i in range(len(forces)):
            is_sum = is_sum and (columns[i, a] == 0.0 or columns[i, a] == 1.0)
            total += forces[i] * columns[i, a]
        if is_sum and total > 0:
            for i in range(len(forces)):
                forces[i] *= 1.0 + columns[i, a] * (target[a] / total - 1.0)


@called_by_kernels
def _balance(
    forces: FloatArray, columns: FloatArray, target: FloatArray, matrix: FloatArray, found: FloatArray
) -> tuple[float, bool]:
    """Multiply forces by factors that are linear in the columns until columns.T @ forces = target.

    Returns:
        The error that remains, over the largest target, and whether forces were changed by more than `_SLIGHT`.
    """
    k, changed, error, scale = len(target), False, np.inf, 0.0
    for a in range(k):
        scale = max(scale, abs(target[a]))
    for _ in range(_CORRECTIONS):
        error = 0.0
        for a in range(k):
            found[a] = target[a]
            for i in range(len(forces)):
                found[a] -= forces[i] * columns[i, a]
            error = max(error, abs(found[a]) / scale)
        if error <= _BALANCED:
            break
        changed = changed or error > _SLIGHT
        _solve_weighted(columns, forces, matrix, found)
        for i in range(len(forces)):
            factor = 1.0
            for a in range(k):
                factor += columns[i, a] * found[a]
            forces[i] *= max(factor, _LEAST_FACTOR)
    if error > _BALANCED:
        _scale_sums(forces, columns, target)
    return error, changed


@called_by_kernels
def _compute_residual(
    active: FloatArray,
    overlap: FloatArray,
    columns: FloatArray,
    matrix: FloatArray,
    motion: FloatArray,
    residual: FloatArray,
) -> tuple[float, float, bool]:
    """Fit rigid motions to the overlap, into `motion` (k,) [m], and subtract them, into `residual` (m,) [m].

    Returns:
        Sums of squares of residual and overlap over the active cells [m2], and whether other cells overlap.
    """
    _fit_motion(active, overlap, columns, matrix, motion)
    energy, size, grows = 0.0, 0.0, False
    for i in range(len(active)):
        residual[i] = overlap[i]
        for a in range(len(motion)):
            residual[i] -= columns[i, a] * motion[a]
        energy += active[i] * residual[i] * residual[i]
        size += active[i] * overlap[i] * overlap[i]
        grows = grows or (active[i] == 0.0 and residual[i] < 0)
    return energy, size, grows


@called_by_kernels
def _measure_curvature(
    active: FloatArray,
    columns: FloatArray,
    vectors: tuple[FloatArray, FloatArray, FloatArray],
    matrix: FloatArray,
    shifts: FloatArray,
) -> tuple[float, float]:
    """Second and first derivative of the energy along the search direction, without its rigid motions [m].

    Args:
        active: 1 for cells under pressure, else 0, shape (m,).
        columns: Columns of the constraints, shape (m, k).
        vectors: Residual, direction, and displacements under forces along the direction, each of shape (m,).
        matrix: Scratch memory, shape (k, k).
        shifts: Scratch memory, shape (k,).
    """
    residual, direction, image = vectors
    _fit_motion(active, direction, columns, matrix, shifts)
    curvature, slope = 0.0, 0.0
    for i in range(len(active)):
        free = direction[i]
        for a in range(len(shifts)):
            free -= active[i] * columns[i, a] * shifts[a]
        curvature += image[i] * free
        slope += residual[i] * direction[i]
    return curvature, slope


@called_by_kernels
def _advance(
    length: float, active: FloatArray, residual: FloatArray, direction: FloatArray, forces: FloatArray
) -> bool:
    """Take one step; whether the set of active cells changed."""
    other = False
    for i in range(len(forces)):
        if active[i] == 0.0:
            forces[i] = max(-length * residual[i], 0.0)
            other = other or forces[i] > 0
        else:
            forces[i] -= length * direction[i]
            if forces[i] < 0:
                forces[i], other = 0.0, True
    return other


@called_by_kernels
def _add_scaled(factor: float, added: FloatArray, values: FloatArray) -> None:
    """Add a vector (m,), multiplied by a factor, to `values` (m,)."""
    for i in range(len(values)):
        values[i] += factor * added[i]


@called_by_kernels
def _compare(forces: FloatArray, before: FloatArray, active: FloatArray) -> float:
    """Sum of the changes of force since the last call [N]; updates `before` and `active`, 1 under pressure, else 0."""
    change = 0.0
    for i in range(len(forces)):
        change += abs(forces[i] - before[i])
        before[i], active[i] = forces[i], 1.0 if forces[i] > 0 else 0.0
    return change


def minimise_energy(
    cover: Cover,
    gap: FloatArray,
    columns: FloatArray,
    target: FloatArray,
    start: FloatArray,
    tolerance: float,
    most: int,
) -> tuple[FloatArray, FloatArray, FloatArray, int, bool]:
    """Solve one contact.  While the active set stays the same, the overlap is updated instead of computed anew.

    If the constraints cannot be met, the forces to start from are returned.

    Args:
        cover: The compliance.
        gap: Gap of the undeformed surfaces, shape (m,) [m].
        columns: Columns of the constraints, shape (m, k).
        target: Values of the constraints, shape (k,).
        start: Forces to start from, shape (m,) [N].
        tolerance: Change of the forces in one step at which to stop [N].
        most: Most steps.

    Returns:
        Cell forces, shape (m,) [N]; the same on the window of whole cells, shape (rows, columns) [N]; multipliers of
        the constraints, shape (k,) [m]; steps taken; whether it converged.
    """
    count, k = columns.shape
    rows, cols, tall = cover[3].shape[1], cover[4].shape[1], cover[3].shape[0]
    room = (np.empty((rows, cols)), np.empty((tall, cols)), np.empty((rows, tall // rows * cols)))
    forces, before, active = start.copy(), np.zeros(count), np.zeros(count)
    overlap, residual, direction, image = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    matrix, shifts, motion = np.zeros((k, k)), np.zeros(k), np.zeros(k)
    previous, conjugate, other, step, converged = 1.0, 0.0, True, 0, False
    while not converged:
        # the last step may have unbalanced the forces
        error, corrected = _balance(forces, columns, target, matrix, shifts)
        converged = _compare(forces, before, active) < tolerance and step > 0
        if converged or step == most:
            break
        if not error <= _UNBALANCED:  # true for nan as well
            forces[:] = start
            break
        # the residual is the overlap that no rigid motion of the bodies removes
        if other or corrected:
            _displace(cover, forces, room, overlap)
            _add_scaled(1.0, gap, overlap)
        energy, size, grows = _compute_residual(active, overlap, columns, matrix, motion, residual)
        # conjugate direction, restarted whenever cells are added
        for i in range(count):
            direction[i] = active[i] * (residual[i] + conjugate * energy / previous * direction[i])
        _displace(cover, direction, room, image)
        curvature, slope = _measure_curvature(active, columns, (residual, direction, image), matrix, shifts)
        converged = not curvature > 0 or (energy <= _ROUNDING * size and not grows)
        if not converged:
            other = _advance(slope / curvature, active, residual, direction, forces)
            previous, conjugate, step = energy, 0.0 if grows else 1.0, step + 1
            if not other:
                _add_scaled(-slope / curvature, image, overlap)
    _spread_on_window(cover[0], cover[1], forces, room[0])
    return forces, room[0], motion, step, converged
