"""An elastic foundation under rigid bodies: every cell yields by its own pressure only (Winkler).

Cell forces are k a max(0, d + s x + t y - gap) with one approach d and, where a body is free to tilt, two slopes s, t
per body, such that force and moments are the engine's.  They minimise a convex, piecewise quadratic function, so
Newton's method with halved steps finds them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import Kernel, choose_kernel
from fastmodel.pressure.gap_sampling import Load, Samples
from fastmodel.pressure.kernels import SPRING_STEPS, match_springs_loops

FloatArray = npt.NDArray[np.float64]


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
    for _ in range(SPRING_STEPS):
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
