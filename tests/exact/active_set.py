"""Find the contact pressures of boundary elements without tension and without overlap."""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Largest number of iterations of the active-set method [-].
_EXCHANGES = 100
#: Overlap of cover and indenter at an element, over the largest displacement that contact requires, below which the
#: element counts as free of overlap; far above rounding errors [-].
_ROUNDING = 1e-9


def solve_active_set(matrix: FloatArray, wanted: FloatArray, rounding: float = _ROUNDING) -> FloatArray:
    """Find the contact pressures without tension and without overlap of cover and indenter.

    Args:
        matrix: Displacement of each of m elements per pressure on each, shape (m, m) [m/Pa].
        wanted: Displacement that contact requires at each element, -inf beside the indenter, shape (m,) [m].
        rounding: Overlap below which an element counts as free of it, over the largest `wanted` [-].

    Returns:
        Pressure on each element, 0 where cover and indenter do not touch, shape (m,) [Pa].

    Raises:
        RuntimeError: If the method does not converge.
    """
    touching = wanted > 0
    limit = rounding * float(wanted.max())
    for _ in range(_EXCHANGES):
        pressure = np.zeros(len(wanted))
        pressure[touching] = np.linalg.solve(matrix[np.ix_(touching, touching)], wanted[touching])
        under_tension = touching & (pressure < 0)
        overlapping = ~touching & (matrix @ pressure < wanted - limit)
        if not (under_tension | overlapping).any():
            return pressure
        touching = touching ^ (under_tension | overlapping)
    raise RuntimeError(f"the contact did not settle in {_EXCHANGES} exchanges on {len(wanted)} elements")
