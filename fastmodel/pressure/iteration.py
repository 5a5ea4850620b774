# ruff: noqa: PLR0917 -- as the numba kernel takes them
"""The inner loop of `cover_solver`, in numpy; `contact_loops` is the same for numba.

Polonsky and Keer's conjugate gradients on the touching cells, with linear constraints projected out.  While no cell
comes or goes the residual is carried on; else it is computed anew.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
#: Cells of the window that each sampled cell acts on and its shares [-], both of shape (shares, m); what each yields
#: under its own force beyond that, shape (m,) [m/N]; stacked row matrices of the compliance, shape (terms * rows,
#: rows), and column matrices, shape (terms * cols, cols) [m/N].
Cover = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]
#: A cover; heights of the undeformed gap, shape (m,) [m]; what the forces are summed with, shape (m, k); what these
#: sums must be, shape (k,).
Contact = tuple[Cover, FloatArray, FloatArray, FloatArray]

#: Least share of a cell's force that one correction of the balance leaves, so that none changes its sign [-].
KEPT = 0.2
#: Most corrections of the balance in one step.
CORRECTIONS = 40


def _yields(
    target: IntArray, weight: FloatArray, soft: FloatArray, first: FloatArray, second: FloatArray, forces: FloatArray
) -> FloatArray:
    """Displacements of the sampled cells, shape (m,) [m]."""
    rows, cols = first.shape[1], second.shape[1]
    window = np.bincount(target.ravel(), (weight * forces).ravel(), rows * cols)
    half = np.dot(first, window.reshape(rows, cols)).reshape(-1, rows, cols)
    flat = np.dot(half.transpose(1, 0, 2).reshape(rows, -1), second).ravel()
    return np.asarray(soft * forces + np.einsum("sm,sm->m", weight, flat.take(target)))


def _inverse(matrix: FloatArray) -> FloatArray:
    """Inverse of a small matrix, kept regular."""
    ridge = 1e-12 * np.trace(matrix) + 1e-300
    return np.linalg.inv(matrix + ridge * np.eye(len(matrix)))


def _balanced(forces: FloatArray, columns: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float, bool]:
    """Forces scaled until they add up to what is wanted, what they still miss, and whether they were changed."""
    scale, changed, missed = np.abs(wanted).max(), False, np.inf
    for _ in range(CORRECTIONS):
        miss = wanted - np.dot(forces, columns)
        missed = np.abs(miss).max()
        if missed <= 1e-9 * scale:
            break
        changed = True
        weighted = columns * forces.reshape(len(forces), 1)
        factor = 1 + np.dot(columns, np.dot(_inverse(np.dot(np.ascontiguousarray(columns.T), weighted)), miss))
        forces = forces * np.maximum(factor, KEPT)
    return forces, missed, changed


def iterate(
    contact: Contact, start: FloatArray, tolerance: float, most: int
) -> tuple[FloatArray, FloatArray, int, bool]:
    """Cell forces, motions of the bodies, steps taken, and whether the tolerance was met.

    Args:
        contact: What is to be solved.
        start: Where to start, shape (m,) [N].
        tolerance: Change of the forces in one step at which to stop [N].
        most: Most steps.
    """
    cover, gap, columns, wanted = contact
    count, k = columns.shape
    scale = np.abs(wanted).max()
    forces, before, motion = start.copy(), start, np.zeros(k)
    overlap, direction, masked, inverse = np.zeros(count), np.zeros(count), columns, np.zeros((k, k))
    previous, conjugate, anew = 1.0, 0.0, True
    for step in range(most + 1):
        forces, missed, corrected = _balanced(forces, columns, wanted)
        if missed > 1e-3 * scale:
            return forces, motion, step, False
        if step > 0 and np.abs(forces - before).sum() < tolerance:
            return forces, motion, step, True
        if anew or corrected:
            overlap = _yields(*cover, forces) + gap
            masked = columns * (forces > 0).reshape(count, 1)
            inverse = _inverse(np.dot(np.ascontiguousarray(masked.T), columns))
        active = forces > 0
        motion = np.dot(inverse, np.dot(overlap, masked))
        residual = overlap - np.dot(columns, motion)
        came = ~active & (residual < 0)
        energy = (residual * residual * active).sum()
        if energy <= 1e-20 * (overlap * overlap * active).sum() and not came.any():
            return forces, motion, step, True
        direction = active * (residual + conjugate * energy / previous * direction)
        image = _yields(*cover, direction)
        shifts = np.dot(inverse, np.dot(direction, columns))
        curvature = np.dot(image, direction) - np.dot(np.dot(image, masked), shifts)
        if not curvature > 0:
            return forces, motion, step, True
        previous, conjugate = energy, 0.0 if came.any() else 1.0
        length = np.dot(residual, direction) / curvature
        before, forces = forces, forces - length * direction
        anew = (forces < 0).any() or came.any()
        if anew:
            forces = np.where(came, -length * residual, np.maximum(forces, 0.0))
        else:
            overlap = overlap - length * image
    return forces, motion, most, False
