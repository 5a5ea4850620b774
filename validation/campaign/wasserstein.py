"""The Wasserstein-1 distance of two force maps, which needs scipy.

This file is part of two distributions, softcover and tactilebench, and imports only numpy and scipy.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def wasserstein(reference: FloatArray, forces: FloatArray, positions: FloatArray) -> float:
    """Return the Wasserstein-1 distance of two force maps, clipped at zero and scaled to unit mass [m].

    The result is NaN if one of the maps has no positive force.  Because the cost is a distance, mass that is common to
    both maps need not move (Kantorovich-Rubinstein duality).  The exact linear programme therefore only transports mass
    from texels with a surplus to texels with a deficit, and is much smaller.
    """
    from scipy.stats import wasserstein_distance_nd

    r, f = np.maximum(reference, 0.0), np.maximum(forces, 0.0)
    if r.sum() <= 0 or f.sum() <= 0:
        return math.nan
    difference = f / f.sum() - r / r.sum()
    surplus, deficit = difference > 0, difference < 0
    mass = float(difference[surplus].sum())
    if mass < np.finfo(float).eps * len(r):
        return 0.0
    distance = wasserstein_distance_nd(
        positions[surplus], positions[deficit], difference[surplus], -difference[deficit]
    )
    return mass * float(distance)
