"""An elastic foundation under rigid bodies: every cell yields by its own pressure only (Winkler).

Cell forces are k a max(0, d + s x + t y - gap) with one approach d and, where a body is free to tilt, two slopes s, t
per body, such that force and moments are the engine's.  They minimise a convex, piecewise quadratic function, so
Newton's method with halved steps finds them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fastmodel.sampling import Load, Samples

FloatArray = npt.NDArray[np.float64]

_STEPS = 60


def foundation_forces(samples: Samples, loads: Sequence[Load], stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force on each cell, shape (m,) [N], and height of each over which its spring would stand free, shape (m,) [m].

    Args:
        samples: Cells under each body.
        loads: What each body presses with.
        stiffness: Force per depth of each cell, shape (m,) [N/m].
    """
    forces, levels = np.zeros(samples.count), np.zeros(samples.count)
    for body, load in enumerate(loads):
        mine = (samples.body == body).nonzero()[0]
        if len(mine):
            forces[mine], levels[mine] = _one_body(samples, mine, load, stiffness[mine])
    return forces, levels


def _one_body(
    samples: Samples, mine: npt.NDArray[np.int64], load: Load, stiffness: FloatArray
) -> tuple[FloatArray, FloatArray]:
    gap = samples.gap[mine]
    for each in (load, load.upright()) if load.tilts else (load,):
        columns, target = each.constraints(samples, mine)
        found = _matched(columns, gap, stiffness, target)
        if found is not None:
            return found
    return np.full(len(mine), target[0] / columns[:, 0].sum()), gap


def _matched(
    columns: FloatArray, gap: FloatArray, stiffness: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Forces whose products with the columns are the target, and levels; None where no pressure gives them."""
    motion = np.zeros(len(target))
    motion[0] = gap.min() + target[0] / stiffness.sum()

    def energy(at: FloatArray) -> float:
        return float(0.5 * stiffness @ np.maximum(columns @ at - gap, 0.0) ** 2 - at @ target)

    value = energy(motion)
    for _ in range(_STEPS):
        depth = np.maximum(columns @ motion - gap, 0.0)
        forces = stiffness * depth
        miss = target - forces @ columns
        if np.abs(miss).max() <= 1e-9 * target[0]:
            return forces * (target[0] / (forces @ columns[:, 0])), columns @ motion
        touching = depth > 0
        weighted = columns[touching] * stiffness[touching, None]
        tangent = columns[touching].T @ weighted
        tangent[np.diag_indices_from(tangent)] += 1e-9 * stiffness.sum()
        step = np.linalg.solve(tangent, miss)
        share = 1.0
        while (fresh := energy(motion + share * step)) > value and share > 1e-6:  # noqa: PLR2004 -- nothing is left
            share /= 2
        motion, value = motion + share * step, fresh
    return None
