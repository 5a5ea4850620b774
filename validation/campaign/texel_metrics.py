"""Metrics between predicted and reference texel forces that need numpy alone: functions from arrays to numbers.

This file is part of two distributions, softcover and tactilebench, and imports nothing else.  The arguments `reference`
and `forces` hold the forces on n texels, shape (n,) [N].  Errors are fractions.  Lengths are in metres.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Threshold of the areas that `active_area_iou` compares: force over the largest texel force of the reference [-].
AREA_THRESHOLD = 0.1


def total_force_error(reference: FloatArray, forces: FloatArray, *, load: float) -> float:
    """Return |sum f - sum r| / load, the error of the total force f against the reference r [-]."""
    return float(abs(forces.sum() - reference.sum()) / check_load(load))


def misplaced_force(
    reference: FloatArray, forces: FloatArray, *, reference_outside: float, outside: float, load: float
) -> float:
    """Return (sum |f - r| + |outside_f - outside_r|) / (2 load): the share of the load on a wrong texel [-].

    The texel forces are f, the reference texel forces r.  A newton that moves from one texel to another changes two of
    the differences; the sum is therefore divided by 2.
    """
    moved = np.abs(forces - reference).sum() + abs(outside - reference_outside)
    return float(moved / (2 * check_load(load)))


def peak_error(reference: FloatArray, forces: FloatArray) -> float:
    """Return |max f - max r| / max r for forces f and reference r; NaN if no reference force is positive [-]."""
    peak = float(reference.max())
    return abs(float(forces.max()) - peak) / peak if peak > 0 else math.nan


def centre_of_pressure(forces: FloatArray, positions: FloatArray) -> FloatArray:
    """Return the force-weighted mean of the texel centres, shape (d,) for d coordinates [m].

    The coordinates are NaN if the sum of the forces is not positive.
    """
    total = float(forces.sum())
    if total <= 0:
        return np.full(positions.shape[1], np.nan)
    return np.asarray(forces @ positions / total, dtype=np.float64)


def centre_of_pressure_error(reference: FloatArray, forces: FloatArray, positions: FloatArray) -> float:
    """Return the distance between the centres of pressure of forces and reference [m]; NaN if either is undefined."""
    apart = centre_of_pressure(forces, positions) - centre_of_pressure(reference, positions)
    return float(np.linalg.norm(apart))


def second_moments(forces: FloatArray, positions: FloatArray) -> tuple[float, float]:
    """Return the root second central moments of the force distribution along x and y [m].

    A moment is NaN if the sum of the forces is not positive.  It is zero where negative forces around one texel would
    make its square negative.
    """
    total = float(forces.sum())
    if total <= 0:
        return (math.nan, math.nan)
    apart = positions[:, :2] - centre_of_pressure(forces, positions)[:2]
    x, y = (math.sqrt(max(value, 0.0)) for value in (forces @ apart**2 / total).tolist())
    return (x, y)


def active_area_iou(reference: FloatArray, forces: FloatArray, *, threshold: float) -> float:
    """Return the intersection over union of the two sets of texels with a force above a threshold [-].

    Args:
        reference: Reference texel forces, shape (n,) [N].
        forces: Predicted texel forces, shape (n,) [N].
        threshold: Force above which a texel belongs to the set [N].

    Returns:
        Number of texels in both sets over number of texels in at least one set; 1 if both sets are empty [-].
    """
    r, f = reference > threshold, forces > threshold
    either = np.count_nonzero(r | f)
    return float(np.count_nonzero(r & f) / either) if either else 1.0


def check_load(load: float) -> float:
    """Return a load; raise a ValueError if it is not positive and finite."""
    if not (math.isfinite(load) and load > 0):
        raise ValueError(f"the load must be positive, not {load} N")
    return load
