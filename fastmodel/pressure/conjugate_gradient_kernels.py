# ruff: noqa: PLR0917 -- kernels take their arrays by position
"""Compiled kernels of the solver for the pressure on a cover; `conjugate_gradient` describes the method and calls them.

All kernels stand in one file, because numba's cache checks only the file of the called kernel for changes, not the
files of the functions that this kernel calls.
"""

from __future__ import annotations

import numpy as np

from fastmodel.compiled import called_by_kernels
from meshes.array_types import FloatArray, IntArray

#: The compliance of the cover between the m cells under bodies.  The force on each cell is divided among four whole
#: cells.  The entries are: row and column in the window of the first of the four whole cells, shape (2, m); shares of
#: the four whole cells, shape (4, m) [-]; additional self compliance of each cell, shape (m,) [m/N]; and the two
#: matrices of `SymmetricConvolution.matrices` [m/N].
Cover = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]

#: Smallest factor by which one correction multiplies the force on a cell; a positive factor keeps forces positive [-].
#: Corrections restore the balance of force and moments between the cells and the bodies.
_LEAST_FACTOR = 0.2
#: Largest number of corrections, in one step of the iteration, that restore the balance of force and moments [-].
_CORRECTIONS = 40
#: Errors of the balance of force and moments, over the largest prescribed value [-]: below the first, corrections end;
#: above the second, the iteration fails.
_BALANCED, _UNBALANCED = 1e-9, 1e-3
#: Error of that balance, over the largest prescribed value, up to which a correction leaves displacements valid [-].
_SLIGHT = 1e-6
#: Sum of squares of the residual over that of the overlap, below which the residual is only rounding error [-].
_ROUNDING = 1e-20
#: Value added to the diagonal of small symmetric matrices, over their trace, so that they can be inverted [-].
_RIDGE = 1e-12


@called_by_kernels
def _spread_on_window(corner: IntArray, weight: FloatArray, forces: FloatArray, window: FloatArray) -> None:
    """Divide forces on m partly covered cells among whole cells; write these to `window` (rows, columns) [N]."""
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
    """Compute the displacements `moved` of m cells under forces on them, (m,) [m]; `room` is working memory."""
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
    """Solve (C^T W C) x = b by Gaussian elimination; the matrix is positive definite, so no pivoting is needed.

    Args:
        columns: Matrix C, shape (m, k).
        weight: Diagonal of the matrix W, shape (m,).
        matrix: Working memory, shape (k, k).
        found: Right-hand side b; overwritten with the solution x, shape (k,).
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
    """Fit columns @ motion (m,) to values (m,) on the active cells by least squares; write to `motion`, shape (k,).

    `active` is 1 for cells under pressure, else 0, shape (m,); `matrix` is working memory, shape (k, k).
    """
    for a in range(len(motion)):
        motion[a] = 0.0
        for i in range(len(values)):
            motion[a] += active[i] * values[i] * columns[i, a]
    _solve_weighted(columns, active, matrix, motion)


@called_by_kernels
def _scale_sums(forces: FloatArray, columns: FloatArray, target: FloatArray) -> None:
    """Scale the cell forces so that they add up exactly to the load of each body.

    The columns of the constraints on sums of forces consist of ones and zeros.  If the centre of pressure lies at the
    rim of the cells under a body, the corrections leave a small error of the balance.  After scaling, only the moments
    have this error.
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
    """Correct the cell forces until columns.T @ forces = target, the balance of force and moments.

    Each correction multiplies the forces by factors that are linear in the columns.

    Returns:
        The remaining error of the balance over the largest target [-], and whether a correction exceeded `_SLIGHT`.
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
) -> tuple[float, float, float, bool]:
    """Fit rigid motions of the bodies to the overlap, and subtract them from the overlap.

    The overlap of a cell is its displacement plus its gap.  The motions are written to `motion`, shape (k,) [m], and
    the difference to `residual`, shape (m,) [m].

    Returns:
        Sums of squares of residual and of overlap over the active cells [m2], the sum of the absolute residual over
        active cells and over inactive cells, that is, cells without pressure, on which the surfaces overlap [m]; and
        whether there are such inactive cells.
    """
    _fit_motion(active, overlap, columns, matrix, motion)
    energy, size, total, grows = 0.0, 0.0, 0.0, False
    for i in range(len(active)):
        residual[i] = overlap[i]
        for a in range(len(motion)):
            residual[i] -= columns[i, a] * motion[a]
        energy += active[i] * residual[i] * residual[i]
        size += active[i] * overlap[i] * overlap[i]
        if active[i] != 0.0 or residual[i] < 0:
            total += abs(residual[i])
            grows = grows or active[i] == 0.0
    return energy, size, total, grows


@called_by_kernels
def _measure_curvature(
    active: FloatArray,
    columns: FloatArray,
    vectors: tuple[FloatArray, FloatArray, FloatArray],
    matrix: FloatArray,
    shifts: FloatArray,
) -> tuple[float, float]:
    """Compute the second and first derivatives of the energy with respect to the length of the search step.

    Rigid motions of the bodies are subtracted from the direction before the second derivative is computed.

    Args:
        active: 1 for cells under pressure, else 0, shape (m,).
        columns: Columns of the k constraints, shape (m, k).
        vectors: Residual, search direction, and displacements under forces equal to the direction, each of shape (m,).
        matrix: Working memory, shape (k, k).
        shifts: Working memory, shape (k,).
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
    """Change the cell forces by one step of given length, and return whether the set of active cells changed.

    Active cells are those under pressure.  Forces that would become negative are set to zero, and inactive cells on
    which the surfaces overlap receive a force.
    """
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
    """Add the vector `added`, multiplied by a factor, to the vector `values`, in place; both of shape (m,)."""
    for i in range(len(values)):
        values[i] += factor * added[i]


@called_by_kernels
def _compare(forces: FloatArray, before: FloatArray, active: FloatArray) -> float:
    """Return the summed absolute change of the cell forces since the last step [N]; update `before` and `active`."""
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
    limits: tuple[float, float, int],
) -> tuple[FloatArray, FloatArray, FloatArray, int, bool]:
    """Kernel: compute the forces on m cells that minimise the energy under k constraints, by conjugate gradients.

    Args:
        cover: Compliance of the cover between the cells.
        gap: Gap between the undeformed surfaces, shape (m,) [m].
        columns: Columns of the constraints columns.T @ forces = target, shape (m, k).
        target: Prescribed values of the constraints, shape (k,) [N].
        start: Forces from which the iteration starts, shape (m,) [N].
        limits: Sum of the changes of forces in one step below which the iteration stops [N]; summed residual below
            which it stops too [m]; and largest number of steps.

    Returns:
        Cell forces, those in `start` if the constraints cannot be satisfied, shape (m,) [N]; these forces on the whole
        cells of the window, shape (rows, columns) [N]; Lagrange multipliers of the constraints, shape (k,) [m]; number
        of steps; and whether the iteration converged.
    """
    count, k = columns.shape
    rows, cols, tall = cover[3].shape[1], cover[4].shape[1], cover[3].shape[0]
    room = (np.empty((rows, cols)), np.empty((tall, cols)), np.empty((rows, tall // rows * cols)))
    forces, before, active = start.copy(), np.zeros(count), np.zeros(count)
    overlap, residual, direction, image = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    matrix, shifts, motion = np.zeros((k, k)), np.zeros(k), np.zeros(k)
    previous, conjugate, other, step, converged = 1.0, 0.0, True, 0, False
    while not converged:
        error, corrected = _balance(forces, columns, target, matrix, shifts)
        converged = _compare(forces, before, active) < limits[0] and step > 0
        if converged or step == limits[2]:
            break
        if not error <= _UNBALANCED:  # also true if the error is nan
            forces[:] = start
            break
        # the overlap is computed anew only after cells joined or left the active set or after a large correction
        if other or corrected:
            _displace(cover, forces, room, overlap)
            _add_scaled(1.0, gap, overlap)
        energy, size, total, grows = _compute_residual(active, overlap, columns, matrix, motion, residual)
        if total <= limits[1] or (energy <= _ROUNDING * size and not grows):
            converged = True
            break
        # the conjugate search direction, restarted from the residual after cells were added to the active set
        for i in range(count):
            direction[i] = active[i] * (residual[i] + conjugate * energy / previous * direction[i])
        _displace(cover, direction, room, image)
        curvature, slope = _measure_curvature(active, columns, (residual, direction, image), matrix, shifts)
        converged = not curvature > 0
        if not converged:
            other = _advance(slope / curvature, active, residual, direction, forces)
            previous, conjugate, step = energy, 0.0 if grows else 1.0, step + 1
            if not other:
                _add_scaled(-slope / curvature, image, overlap)
    _spread_on_window(cover[0], cover[1], forces, room[0])
    return forces, room[0], motion, step, converged
