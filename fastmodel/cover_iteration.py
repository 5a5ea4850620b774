"""The inner loop of `cover_solver`: one function that runs as it stands, and compiled by numba where numba is there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Least share of a cell's force that one correction of the balance leaves, so that none changes its sign [-].
_KEPT = 0.2
#: Most corrections of the balance in one step.
_CORRECTIONS = 40


def iterate(  # noqa: C901, PLR0915, PLR0917 -- one loop as published; numba kernels take positions
    target: IntArray,
    weight: FloatArray,
    soft: FloatArray,
    first: FloatArray,
    second: FloatArray,
    gap: FloatArray,
    columns: FloatArray,
    wanted: FloatArray,
    start: FloatArray,
    tolerance: float,
    most: int,
) -> tuple[FloatArray, FloatArray, int, bool]:
    """Cell forces, motions of the bodies, steps taken, and whether the tolerance was met.

    Polonsky and Keer's conjugate gradients on the touching cells, with linear constraints projected out.  While no
    cell comes or goes the residual is carried on; else it is computed anew.

    Args:
        target: Cells of the window that each sampled cell acts on, shape (shares, m).
        weight: Its shares, shape (shares, m) [-].
        soft: What each yields under its own force beyond that, shape (m,) [m/N].
        first: Stacked row matrices of the compliance, shape (terms * rows, rows).
        second: Stacked column matrices, shape (terms * cols, cols) [m/N].
        gap: Heights of the undeformed gap, shape (m,) [m].
        columns: What the forces are summed with, shape (m, k).
        wanted: What these sums must be, shape (k,).
        start: Where to start, shape (m,) [N].
        tolerance: Change of the forces in one step at which to stop [N].
        most: Most steps.
    """
    rows, cols = first.shape[1], second.shape[1]
    terms = first.shape[0] // rows
    shares, count, k = target.shape[0], gap.shape[0], columns.shape[1]
    scale = np.abs(wanted).max()

    def yields(forces: FloatArray) -> FloatArray:
        """Displacements of the sampled cells [m]."""
        window = np.bincount(target[0], weight[0] * forces, rows * cols)
        for s in range(1, shares):
            window += np.bincount(target[s], weight[s] * forces, rows * cols)
        half = np.dot(first, window.reshape(rows, cols)).reshape(terms, rows, cols)
        beside = np.ascontiguousarray(half.transpose(1, 0, 2)).reshape(rows, terms * cols)
        flat = np.dot(beside, second).ravel()
        moved = soft * forces
        for s in range(shares):
            moved += weight[s] * flat[target[s]]
        return moved

    def solved(matrix: FloatArray, side: FloatArray) -> FloatArray:
        """Solution of a small system, kept regular."""
        ridge = 1e-12 * np.trace(matrix) + 1e-300
        return np.linalg.solve(matrix + ridge * np.eye(k), side)

    forces, before, motion = start.copy(), start, np.zeros(k)
    overlap, direction = np.zeros(count), np.zeros(count)
    previous, conjugate, anew = 1.0, 0.0, True
    for step in range(most + 1):
        missed = np.inf
        for _ in range(_CORRECTIONS):
            miss = wanted - np.dot(forces, columns)
            missed = np.abs(miss).max()
            if missed <= 1e-9 * scale:
                break
            anew = True
            weighted = columns * forces.reshape(count, 1)
            factor = 1 + np.dot(columns, solved(np.dot(columns.T, weighted), miss))
            forces = forces * np.maximum(factor, _KEPT)
        if missed > 1e-3 * scale:
            return forces, motion, step, False
        if step > 0 and np.abs(forces - before).sum() < tolerance:
            return forces, motion, step, True
        active = (forces > 0).astype(np.float64)
        if anew:
            overlap = yields(forces) + gap
        masked = columns * active.reshape(count, 1)
        gram = np.dot(masked.T, columns)
        motion = solved(gram, np.dot(masked.T, overlap))
        residual = overlap - np.dot(columns, motion)
        came = (forces <= 0) & (residual < 0)
        energy = (residual * residual * active).sum()
        if energy <= 1e-20 * (overlap * overlap * active).sum() and not came.any():
            return forces, motion, step, True
        direction = active * (residual + conjugate * energy / previous * direction)
        image = yields(direction)
        reduced = image - np.dot(columns, solved(gram, np.dot(masked.T, image)))
        curvature = (reduced * direction).sum()
        if not curvature > 0:
            return forces, motion, step, True
        previous, conjugate = energy, 1.0
        length = (residual * direction).sum() / curvature
        before, forces = forces, forces - length * direction
        anew = (forces < 0).any() or came.any()
        if anew:
            forces = np.where(came, -length * residual, np.maximum(forces, 0.0))
        else:
            overlap = overlap - length * image
        if came.any():
            conjugate = 0.0
    return forces, motion, most, False
