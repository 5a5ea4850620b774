# ruff: noqa: PLR0917, PLR2004, PLR0912, C901 -- kernels take arrays by position, and their tolerances stand where they act
"""Compiled kernels that compute the pressure on cells; `fastmodel.pressure.solvers` describes the methods.

These kernels and the functions that they call are in one file, because numba's cache checks only the file of the
called kernel for changes.
"""

from __future__ import annotations

import math

import numpy as np

from fastmodel.compiled import called_by_kernels
from meshes.array_types import FloatArray, IntArray

#: The compliance of the cover between the m cells under bodies.  The force on each cell is divided among four whole
#: cells.  The entries are: row and column in the window of the first of the four whole cells, shape (2, m); shares of
#: the four whole cells, shape (4, m) [-]; additional self compliance of each cell, shape (m,) [m/N]; the two matrices
#: of `SymmetricConvolution.matrices` [m/N]; and the shares of k loads in a force on each cell, shape (k, m) [-], with
#: the compliance between these loads that is added, shape (k, k) [m/N].  A flat cover has no such loads.
Cover = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


@called_by_kernels
def _spread_on_window(corner: IntArray, weight: FloatArray, forces: FloatArray, window: FloatArray) -> None:
    """Divide forces on m partly covered cells among whole cells; write the sums to `window` (rows, columns) [N]."""
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
    """Compute the displacements of m cells under forces on them, and write them to `moved`, shape (m,) [m].

    Args:
        cover: Compliance of the cover between the cells.
        forces: Force on each cell, shape (m,) [N].
        room: Working memory: a window of whole cells, and two arrays for the products with the convolution matrices.
        moved: Displacement of each cell, written here, shape (m,) [m].
    """
    corner, weight, own, first, second, shares, remainder = cover
    window, half, beside = room
    rows, cols = window.shape
    _spread_on_window(corner, weight, forces, window)
    # Only the part of the window with forces enters the products, if it is small.
    low, high, left, right = rows, 0, cols, 0
    for i in range(len(forces)):
        if forces[i] != 0.0:
            low, high = min(low, corner[0, i]), max(high, corner[0, i] + 2)
            left, right = min(left, corner[1, i]), max(right, corner[1, i] + 2)
    if 2 * (high - low) * (right - left) > rows * cols:
        np.dot(first, window, half)
        for t in range(half.shape[0]):
            for j in range(cols):
                beside[t % rows, t // rows * cols + j] = half[t, j]
        np.dot(beside, second, window)
    elif high > low:
        tall, wide, terms = high - low, right - left, len(second) // cols
        before, beneath = np.empty((len(first), tall)), np.empty((tall, wide))
        for i in range(tall):
            for r in range(len(first)):
                before[r, i] = first[r, low + i]
            for j in range(wide):
                beneath[i, j] = window[low + i, left + j]
        part = np.dot(before, beneath)
        narrow, across = np.empty((rows, terms * wide)), np.empty((terms * wide, cols))
        for r in range(terms):
            for j in range(wide):
                for n in range(cols):
                    across[r * wide + j, n] = second[r * cols + left + j, n]
                for i in range(rows):
                    narrow[i, r * wide + j] = part[r * rows + i, j]
        np.dot(narrow, across, window)
    for i in range(len(forces)):
        row, col = corner[0, i], corner[1, i]
        moved[i] = own[i] * forces[i] + weight[0, i] * window[row, col] + weight[1, i] * window[row, col + 1]
        moved[i] += weight[2, i] * window[row + 1, col] + weight[3, i] * window[row + 1, col + 1]
    loads = np.zeros(len(shares))
    for a in range(len(shares)):
        for i in range(len(forces)):
            loads[a] += shares[a, i] * forces[i]
    for a in range(len(shares)):
        sinks = 0.0
        for b in range(len(shares)):
            sinks += remainder[a, b] * loads[b]
        for i in range(len(forces)):
            moved[i] += shares[a, i] * sinks


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
        matrix[a, a] += 1e-12 * trace  # regularisation, so that the matrix can be inverted
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
def _satisfy(forces: FloatArray, columns: FloatArray, target: FloatArray, yielding: FloatArray) -> None:
    """Scale the cell forces of each body to its load, and let the slacks take up what is missing of other constraints.

    `forces` holds the forces on m cells and k slacks; see `minimise_energy` for the other arguments.
    """
    cells = len(forces) - len(target)
    for a in range(len(target)):
        if yielding[a] == 0.0:
            total, square = 0.0, 0.0
            for i in range(cells):
                total += forces[i] * columns[i, a]
                square += columns[i, a] ** 2
            for i in range(cells):
                if columns[i, a] != 0.0:
                    forces[i] = forces[i] * (target[a] / total) if total > 0 else target[a] / square * columns[i, a]
    for a in range(len(target)):
        if yielding[a] > 0.0:
            forces[cells + a] = target[a]
            for i in range(cells):
                forces[cells + a] -= forces[i] * columns[i, a]


@called_by_kernels
def _balance(
    forces: FloatArray,
    columns: FloatArray,
    target: FloatArray,
    yielding: FloatArray,
    matrix: FloatArray,
    found: FloatArray,
) -> bool:
    """Correct the forces on m cells and k slacks until columns.T @ forces = target, the balance of force and moments.

    Each correction multiplies the cell forces by factors that are linear in the columns.  If two corrections do not
    suffice, for example because the wanted centre of pressure lies beside the cells, the slacks take up the rest.

    Returns:
        Whether a correction was more than slight.
    """
    k, cells, changed, scale = len(target), len(forces) - len(target), False, 0.0
    for a in range(k):
        scale = max(scale, abs(target[a]))
    for _ in range(2):
        error = 0.0
        for a in range(k):
            found[a] = target[a]
            for i in range(len(forces)):
                found[a] -= forces[i] * columns[i, a]
            error = max(error, abs(found[a]) / scale)
        if error <= 1e-9:
            return changed
        changed = changed or error > 1e-6  # Smaller corrections change the displacements only within the tolerance.
        _solve_weighted(columns[:cells], forces[:cells], matrix, found)
        for i in range(cells):
            factor = 1.0
            for a in range(k):
                factor += columns[i, a] * found[a]
            forces[i] *= max(factor, 0.2)  # The factor is kept positive, so that forces stay positive.
    _satisfy(forces, columns, target, yielding)
    return True


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
    length: float, cells: int, active: FloatArray, residual: FloatArray, direction: FloatArray, forces: FloatArray
) -> bool:
    """Change the cell forces by one step of given length, and return whether the set of active cells changed.

    Active cells are those under pressure.  Forces that would become negative are set to zero, and inactive cells on
    which the surfaces overlap receive a force.  The slacks, which follow the `cells` cells, may have any sign.
    """
    other = False
    for i in range(len(forces)):
        if i >= cells:
            forces[i] -= length * direction[i]
        elif active[i] == 0.0:
            forces[i] = max(-length * residual[i], 0.0)
            other = other or forces[i] > 0
        else:
            forces[i] -= length * direction[i]
            if forces[i] < 0:
                forces[i], other = 0.0, True
    return other


@called_by_kernels
def _multiply(first: FloatArray, second: FloatArray, count: int) -> float:
    """Return the scalar product of the first `count` entries of two vectors."""
    total = 0.0
    for i in range(count):
        total += first[i] * second[i]
    return total


@called_by_kernels
def _begin(
    constraints: tuple[FloatArray, FloatArray, FloatArray],
    start: FloatArray,
    forces: FloatArray,
    columns: FloatArray,
    active: FloatArray,
) -> None:
    """Write the given forces and constraints of m cells in front of those of k slacks, which are always active."""
    given, _, yielding = constraints
    for i in range(len(start)):
        forces[i] = start[i]
        for a in range(len(yielding)):
            columns[i, a] = given[i, a]
    for a in range(len(yielding)):
        if yielding[a] > 0.0:
            columns[len(start) + a, a] = active[len(start) + a] = 1.0


@called_by_kernels
def _compare(forces: FloatArray, before: FloatArray, active: FloatArray) -> float:
    """Return the summed absolute change of the cell forces since the last step [N]; update `before` and `active`.

    `before` holds the m cells only; the slacks behind them stay active.
    """
    change = 0.0
    for i in range(len(before)):
        change += abs(forces[i] - before[i])
        before[i], active[i] = forces[i], 1.0 if forces[i] > 0 else 0.0
    return change


def minimise_energy(
    cover: Cover,
    gap: FloatArray,
    constraints: tuple[FloatArray, FloatArray, FloatArray],
    start: FloatArray,
    limits: tuple[float, float, int],
) -> tuple[FloatArray, FloatArray, FloatArray, int, bool]:
    """Kernel: compute the forces on m cells that minimise the energy under k constraints, by conjugate gradients.

    A constraint that may be missed has a slack: an unknown of any sign that is added to the sum over the cells, and
    whose square times half its compliance is added to the energy.

    Args:
        cover: Compliance of the cover between the cells.
        gap: Gap between the undeformed surfaces, shape (m,) [m].
        constraints: Columns of the constraints columns.T @ forces + slacks = target, shape (m, k); target, shape (k,)
            [N]; and compliance of each slack, 0 for a constraint without slack, shape (k,) [m/N].
        start: Forces from which the iteration starts, shape (m,) [N].
        limits: Limits at which the iteration stops: sum of the changes of forces in one step [N], summed residual [m],
            and largest number of steps [-].

    Returns:
        Cell forces, shape (m,) [N].  These forces on the whole cells of the window, shape (rows, columns) [N].
        Lagrange multipliers of the constraints, shape (k,) [m].  Number of steps.  Whether the iteration converged.
    """
    (_, target, yielding), (count, k) = constraints, constraints[0].shape
    rows, cols, tall = cover[3].shape[1], cover[4].shape[1], cover[3].shape[0]
    room = (np.empty((rows, cols)), np.empty((tall, cols)), np.empty((rows, tall // rows * cols)))
    unknowns, columns = count + k, np.zeros((count + k, k))
    forces, active, overlap, before = np.zeros(unknowns), np.zeros(unknowns), np.zeros(unknowns), np.zeros(count)
    residual, direction, image = np.zeros(unknowns), np.zeros(unknowns), np.zeros(unknowns)
    _begin(constraints, start, forces, columns, active)
    _satisfy(forces, columns, target, yielding)
    matrix, shifts, motion = np.zeros((k, k)), np.zeros(k), np.zeros(k)
    previous, conjugate, other, step, converged = 1.0, 0.0, True, 0, False
    while not converged:
        corrected = _balance(forces, columns, target, yielding, matrix, shifts)
        converged = _compare(forces, before, active) < limits[0] and step > 0
        if converged or step == limits[2]:
            break
        # The overlap is computed anew only after cells joined or left the active set, or after a large correction.
        if other or corrected:
            _displace(cover, forces[:count], room, overlap)
            for i in range(count):
                overlap[i] += gap[i]
            for a in range(k):
                overlap[count + a] = yielding[a] * forces[count + a]
        energy, size, total, grows = _compute_residual(active, overlap, columns, matrix, motion, residual)
        # The iteration ends if the residual is small enough or consists of rounding errors only.
        if total <= limits[1] or (energy <= 1e-20 * size and not grows):
            converged = True
            break
        # The search direction is conjugate to the previous one.  After cells were added to the active set it is the
        # residual alone.
        for i in range(unknowns):
            direction[i] = active[i] * (residual[i] + conjugate * energy / previous * direction[i])
        _displace(cover, direction[:count], room, image)
        for a in range(k):
            image[count + a] = yielding[a] * direction[count + a]
        curvature, slope = _measure_curvature(active, columns, (residual, direction, image), matrix, shifts)
        if grows and not energy > 1e-20 * size:
            # The active cells are in balance, but others overlap; the step is along the overlap of these alone.
            for i in range(unknowns):
                direction[i] = (1.0 - active[i]) * min(residual[i], 0.0)
            _displace(cover, direction[:count], room, image)
            curvature, slope = _multiply(image, direction, count), _multiply(residual, direction, count)
        converged = not curvature > 0
        if not converged:
            other = _advance(slope / curvature, count, active, residual, direction, forces)
            previous, conjugate, step = energy, 0.0 if grows else 1.0, step + 1
            if not other:
                for i in range(unknowns):
                    overlap[i] += -slope / curvature * image[i]
    _satisfy(forces, columns, target, yielding)
    _spread_on_window(cover[0], cover[1], forces[:count], room[0])
    return forces[:count].copy(), room[0], motion, step, converged


def place_cells(
    samples: tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray],
    grid: tuple[IntArray, FloatArray, FloatArray],
    near: FloatArray,
    square: float,
) -> tuple[tuple[int, int], tuple[int, int], IntArray, FloatArray, FloatArray]:
    """Kernel: divide each cell under a body among the four whole cells around the centroid of the covered part.

    Args:
        samples: Row, column, coverage, x and y of the cells, see `GapSamples`.
        grid: Arrays that describe the contact grid, see `CellGrid.arrays`.
        near: Compliance between cells that lie 0 or 1 rows and columns apart, shape (2, 2) [m/N].
        square: Displacement at the centre of a whole cell under unit force on this cell of a half space [m/N].

    Returns:
        Row and column in the contact grid of the first cell of a window that contains all these whole cells.  Rows and
        columns of the window.  The first three entries of `Cover`.
    """
    row, column, coverage, x, y = samples
    _, low, edge = grid
    top, left, rows, cols = row[0], column[0], 0, 0
    for k in range(len(x)):
        top, left = min(top, row[k]), min(left, column[k])
        rows, cols = max(rows, row[k] + 1), max(cols, column[k] + 1)
    # extend the window by one cell on each side
    top, left, rows, cols = top - 1, left - 1, rows - top + 2, cols - left + 2
    corner, weight = np.empty((2, len(x)), dtype=np.int64), np.empty((4, len(x)))
    own = np.empty(len(x))
    for k in range(len(x)):
        # rounded to 1e-9 cells, so that rounding errors do not divide a fully covered cell among four cells
        u = math.floor(1e9 * ((x[k] - low[0]) / edge[0] - 0.5 - left) + 0.5) * 1e-9
        v = math.floor(1e9 * ((y[k] - low[1]) / edge[1] - 0.5 - top) + 0.5) * 1e-9
        corner[0, k], corner[1, k] = math.floor(v), math.floor(u)
        a, b = u - math.floor(u), v - math.floor(v)
        p, q, r, s = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
        weight[0, k], weight[1, k], weight[2, k], weight[3, k] = p, q, r, s
        # Self compliance that the convolution gives for a force divided among four cells.  That of a whole cell is
        # near[0, 0].
        interpolated = near[0, 0] * (p * p + q * q + r * r + s * s) + 2 * near[0, 1] * (p * q + r * s)
        interpolated += 2 * near[1, 0] * (p * r + q * s) + 2 * near[1, 1] * (p * s + q * r)
        own[k] = near[0, 0] - interpolated + square * (1 / math.sqrt(coverage[k]) - 1)
    # The window is enlarged to multiples of 4 cells, so that fewer sizes of convolution matrices are needed.
    shape = ((rows + 3) // 4 * 4, (cols + 3) // 4 * 4)
    return (top, left), shape, corner, weight, own


@called_by_kernels
def _press_springs(
    gap: FloatArray,
    stiffness: FloatArray,
    constraints: tuple[FloatArray, FloatArray, FloatArray],
    motion: FloatArray,
    found: tuple[FloatArray, FloatArray],
) -> float:
    """Move a body by `motion`, shape (k,) [m], and return the energy of springs, slacks and loads [J].

    The gap below which each cell is in contact [m] and the force on it [N], each of shape (m,), are written to `found`.
    """
    (columns, target, yielding), (height, forces), energy = constraints, found, 0.0
    for a in range(len(motion)):
        energy -= motion[a] * target[a]
        energy += 0.5 * motion[a] ** 2 / yielding[a] if yielding[a] > 0 else 0.0
    for i in range(len(gap)):
        height[i] = 0.0
        for a in range(len(motion)):
            height[i] += columns[i, a] * motion[a]
        forces[i] = stiffness[i] * max(height[i] - gap[i], 0.0)
        energy += 0.5 * forces[i] * (height[i] - gap[i])
    return energy


def match_springs(
    gap: FloatArray, stiffness: FloatArray, constraints: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Kernel: find the motion of one body at which the springs of m cells carry the body's force and moments.

    Args:
        gap: Gap between body and cover at each cell, shape (m,) [m].
        stiffness: Force per displacement of each cell, shape (m,) [N/m].
        constraints: The k constraints, see `minimise_energy`; the first, on the force, has no slack.

    Returns:
        Force on each cell, shape (m,) [N]; gap below which each cell is in contact, shape (m,) [m].
    """
    (given, target, yielding), (count, k) = constraints, constraints[0].shape
    # The diagonal of the tangent matrix stands in rows behind those of the cells; a small part of it makes the matrix
    # invertible even if few cells touch.
    columns, weight, matrix = np.zeros((count + k, k)), np.zeros(count + k), np.zeros((k, k))
    motion, trial, step, height, forces = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros(count), np.zeros(count)
    total, lowest, carried = 0.0, gap[0], 0.0
    for i in range(count):
        total, lowest = total + stiffness[i], min(lowest, gap[i])
        for a in range(k):
            columns[i, a] = given[i, a]
    for a in range(k):
        columns[count + a, a] = 1.0
        weight[count + a] = 1e-9 * total + (1 / yielding[a] if yielding[a] > 0 else 0.0)
    motion[0] = lowest + target[0] / total
    value = _press_springs(gap, stiffness, constraints, motion, (height, forces))
    for _ in range(60):
        missing = 0.0
        for a in range(k):
            step[a] = target[a] - (motion[a] / yielding[a] if yielding[a] > 0 else 0.0)
            for i in range(count):
                step[a] -= forces[i] * columns[i, a]
            missing = max(missing, abs(step[a]))
        if missing <= 1e-9 * target[0]:
            break
        for i in range(count):
            weight[i] = stiffness[i] if forces[i] > 0 else 0.0
        _solve_weighted(columns, weight, matrix, step)
        share, before = 1.0, value
        while True:
            for a in range(k):
                trial[a] = motion[a] + share * step[a]
            value = _press_springs(gap, stiffness, constraints, trial, (height, forces))
            if value <= before or share <= 1e-6:
                break
            share /= 2
        for a in range(k):
            motion[a] = trial[a]
    for i in range(count):
        carried += forces[i] * columns[i, 0]
    for i in range(count):
        forces[i] *= target[0] / carried
    return forces, height


def spread_on_window(corner: IntArray, weight: FloatArray, forces: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Kernel: divide forces on m partly covered cells among whole cells of a window, shape (rows, columns) [N]."""
    window = np.zeros(shape)
    _spread_on_window(corner, weight, forces, window)
    return window


def gather_shares(
    corners: IntArray, parts: FloatArray, shared: IntArray, shares: FloatArray, count: int
) -> tuple[IntArray, FloatArray]:
    """Kernel: find the loads among which forces on k cells of a curved cover are distributed.

    Args:
        corners: Indices of the three points of the cover around each cell, shape (k, 3).
        parts: Weights of these points, shape (k, 3) [-].
        shared: Indices of q loads for each point of the cover, shape (p, q).
        shares: Parts of a force on the point that these loads take, shape (p, q) [-].
        count: Number of all loads.

    Returns:
        Indices of the j loads, shape (j,), and their parts of a force on each cell, shape (j, k) [-].
    """
    number, used = np.full(count, -1), 0
    loads = np.empty(count, dtype=np.int64)
    for k in range(len(corners)):
        for n in range(3):
            for load in shared[corners[k, n]]:
                if number[load] < 0:
                    number[load], loads[used] = used, load
                    used += 1
    out = np.zeros((used, len(corners)))
    for k in range(len(corners)):
        for n in range(3):
            for q in range(shared.shape[1]):
                out[number[shared[corners[k, n], q]], k] += parts[k, n] * shares[corners[k, n], q]
    return loads[:used].copy(), out


@called_by_kernels
def _fill_columns(
    place: FloatArray, normal: FloatArray, centre: FloatArray, along: tuple[FloatArray, FloatArray], edge: float
) -> FloatArray:
    """Compute the force along k directions and the moment about j turns of unit forces on m cells, shape (m, k + j).

    Args:
        place: Positions of the cells, shape (m, 3) [m].
        normal: Normals of the cells, against which the forces act, shape (m, 3) [-].
        centre: Point about which moments are taken, shape (3,) [m].
        along: Directions, shape (k, 3), and turns, shape (j, 3) [-].
        edge: Length by which the moments are divided [m].
    """
    directions, turns = along
    k, columns = len(directions), np.zeros((len(place), len(directions) + len(turns)))
    for i in range(len(place)):
        for a in range(k):
            for n in range(3):
                columns[i, a] += normal[i, n] * directions[a, n]
        for n in range(3 * (len(turns) > 0)):
            p, q = (n + 1) % 3, (n + 2) % 3
            moment = (place[i, p] - centre[p]) * normal[i, q] - (place[i, q] - centre[q]) * normal[i, p]
            for b in range(len(turns)):
                columns[i, k + b] += moment / edge * turns[b, n]
    return columns


def constrain_forces(
    place: FloatArray, normal: FloatArray, load: tuple[FloatArray, FloatArray, FloatArray, FloatArray], edge: float
) -> tuple[FloatArray, FloatArray]:
    """Kernel: build columns and target of the constraints of one body, see `Load.build_constraints`.

    Args:
        place: Positions of m cells, shape (m, 3) [m].
        normal: Normals of the cells, shape (m, 3) [-].
        load: Force, shape (3,) [N], and a point on its line of action, shape (3,) [m]; directions, shape (k, 3), and
            turns, shape (j, 3) [-].
        edge: Edge of a cell [m].

    Returns:
        Columns, shape (m, k + j), and target, shape (k + j,) [N].
    """
    vector, point, directions, turns = load
    low, high, middle = place[0].copy(), place[0].copy(), np.zeros(3)
    for i in range(len(place)):
        for n in range(3):
            low[n], high[n] = min(low[n], place[i, n]), max(high[n], place[i, n])
            middle[n] += place[i, n] / len(place)
    along, size, centre, apart = 0.0, 0.0, np.zeros(3), np.zeros(3)
    for n in range(3):
        along += vector[n] * (middle[n] - point[n])
        size += vector[n] ** 2
    for n in range(3):
        wanted = point[n] + along / size * vector[n]
        centre[n] = min(max(wanted, low[n]), high[n])
        apart[n] = wanted - centre[n]
    target = np.zeros(len(directions) + len(turns))
    for n in range(3):
        for a in range(len(directions)):
            target[a] += vector[n] * directions[a, n]
        moment = apart[(n + 1) % 3] * vector[(n + 2) % 3] - apart[(n + 2) % 3] * vector[(n + 1) % 3]
        for b in range(len(turns)):
            target[len(directions) + b] += moment / edge * turns[b, n]
    return _fill_columns(place, normal, centre, (directions, turns), edge), target


def find_modes(
    place: FloatArray,
    normal: FloatArray,
    forces: FloatArray,
    along: tuple[FloatArray, FloatArray],
    edge: float,
) -> tuple[FloatArray, float, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Kernel: find how the forces of one body on m cells change with its load, see `Solved`.

    Args:
        place: Positions of the cells, shape (m, 3) [m].
        normal: Normals of the cells, shape (m, 3) [-].
        forces: Force of the body on each cell, shape (m,) [N].
        along: First direction of the load, shape (1, 3), and its j turns, shape (j, 3) [-].
        edge: Length by which moments are divided [m].

    Returns:
        Centre of the forces, shape (3,) [m], and largest distance of a force from it [m].  The forces, and their change
        by each mode, shape (2 + j, m) [N].  Moments of each of them about the origin, shape (2 + j, 3) [N m].  Changes
        of force and moments by each mode, shape (1 + j, 1 + j) [N].  Largest relative change of a force by each mode,
        shape (1 + j,) [-].
    """
    centre, total = np.zeros(3), 0.0
    for i in range(len(forces)):
        total += forces[i]
        for n in range(3):
            centre[n] += forces[i] * place[i, n]
    centre /= total
    columns = _fill_columns(place, normal, centre, along, edge)
    k, farthest = columns.shape[1], 0.0
    gram, largest = np.zeros((k, k)), np.zeros(k)
    modes, moments = np.zeros((1 + k, len(forces))), np.zeros((1 + k, 3))
    for i in range(len(forces)):
        if forces[i] == 0.0:
            continue
        modes[0, i] = forces[i]
        square = 0.0
        for n in range(3):
            square += (place[i, n] - centre[n]) ** 2
        farthest = max(farthest, square)
        for a in range(k):
            modes[1 + a, i] = forces[i] * columns[i, a]
            largest[a] = max(largest[a], abs(columns[i, a]))
            for b in range(k):
                gram[a, b] += forces[i] * columns[i, a] * columns[i, b]
        for n in range(3):
            p, q = (n + 1) % 3, (n + 2) % 3
            arm = place[i, p] * normal[i, q] - place[i, q] * normal[i, p]
            for a in range(1 + k):
                moments[a, n] += modes[a, i] * arm
    return centre, math.sqrt(farthest), modes, moments, gram, largest
