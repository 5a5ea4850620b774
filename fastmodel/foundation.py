"""An elastic foundation under rigid bodies: every cell yields by its own pressure only (Winkler).

Cell forces are k a max(0, d + s x + t y - gap) with one approach d and, where a body is free to tilt, two slopes s, t
per body, such that force and moments are the engine's.  They minimise a convex, piecewise quadratic function, so
Newton's method with halved steps finds them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fastmodel.native import Kernel, called_by_kernels, choose_kernel
from fastmodel.sampling import Load, Samples
from fastmodel.small_systems import eliminate, gram, project

FloatArray = npt.NDArray[np.float64]

_STEPS = 60


def foundation_forces(
    samples: Samples, loads: Sequence[Load], stiffness: FloatArray, *, native: bool | None = False
) -> tuple[FloatArray, FloatArray]:
    """Force on each cell, shape (m,) [N], and height of each over which its spring would stand free, shape (m,) [m].

    Args:
        samples: Cells under each body.
        loads: What each body presses with.
        stiffness: Force per depth of each cell, shape (m,) [N/m].
        native: True for compiled loops, False for numpy, None for whichever is there.
    """
    match = choose_kernel(match_springs_loops, match_springs, native=native)
    if len(loads) == 1:
        return _one_body(match, samples, np.arange(samples.count), loads[0], stiffness)
    forces, levels = np.zeros(samples.count), np.zeros(samples.count)
    for body, load in enumerate(loads):
        mine = (samples.body == body).nonzero()[0]
        if len(mine):
            forces[mine], levels[mine] = _one_body(match, samples, mine, load, stiffness[mine])
    return forces, levels


def _one_body(
    match: Kernel, samples: Samples, mine: npt.NDArray[np.int64], load: Load, stiffness: FloatArray
) -> tuple[FloatArray, FloatArray]:
    gap = samples.gap[mine]
    for each in (load, load.upright()) if load.tilts else (load,):
        columns, target = each.constraints(samples, mine)
        forces, levels, found = match(columns, gap, stiffness, target)
        if found:
            return forces, levels
    return np.full(len(mine), target[0] / columns[:, 0].sum()), gap


def match_springs(
    columns: FloatArray, gap: FloatArray, stiffness: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """Forces whose products with the columns are the target, levels, and whether any pressure gives them."""
    motion = np.zeros(len(target))
    motion[0] = gap.min() + target[0] / stiffness.sum()
    level = np.dot(columns, motion)
    depth = np.maximum(level - gap, 0.0)
    forces = stiffness * depth
    value = 0.5 * np.dot(forces, depth) - np.dot(motion, target)
    for _ in range(_STEPS):
        miss = target - np.dot(forces, columns)
        if np.abs(miss).max() <= 1e-9 * target[0]:
            return forces * (target[0] / np.dot(forces, columns)[0]), level, True
        weighted = columns * (stiffness * (depth > 0)).reshape(len(gap), 1)
        tangent = np.dot(np.ascontiguousarray(weighted.T), columns) + 1e-9 * stiffness.sum() * np.eye(len(target))
        step, share = np.linalg.solve(tangent, miss), 1.0
        before = value
        while True:
            level = np.dot(columns, motion + share * step)
            depth = np.maximum(level - gap, 0.0)
            forces = stiffness * depth
            value = 0.5 * np.dot(forces, depth) - np.dot(motion + share * step, target)
            if value <= before or share <= 1e-6:  # noqa: PLR2004 -- nothing is left
                break
            share /= 2
        motion = motion + share * step
    return forces, level, False


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
    project(forces, columns, room[0])
    most = 0.0
    for a in range(len(target)):
        room[1, a] = target[a] - room[0, a]
        most = max(most, abs(room[1, a]))
    return most


@called_by_kernels()
def _newton(  # noqa: PLR0917 -- numba kernels take positions
    columns: FloatArray, active: FloatArray, ridge: float, miss: FloatArray, matrix: FloatArray, step: FloatArray
) -> None:
    """The step that would close the miss if no spring came or went."""
    gram(columns, active, matrix)
    eliminate(matrix, ridge, miss, step)


def match_springs_loops(
    columns: FloatArray, gap: FloatArray, stiffness: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """The same as loops, for numba."""
    count, k = columns.shape
    forces, level, active = np.empty(count), np.empty(count), np.empty(count)
    motion, tried, step, room, matrix = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros((2, k)), np.zeros((k, k))
    total = _first_motion(gap, stiffness, target, motion)
    value = _press((columns, gap, stiffness, target), motion, active, forces, level)
    for _ in range(_STEPS):
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
