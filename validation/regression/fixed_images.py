"""Experiments on the metrics: scores of two fixed images, and pooled scores of fixed numbers."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.campaign.pooling import pool, skill
from validation.metrics import score, score_images
from validation.regression.subject import Subject, Values

#: Rows and columns, and pitch along x and y [m], of the two images.
_SHAPE, _PITCH = (7, 5), (3e-3, 4e-3)
#: Load [N], and force outside in reference and prediction [N].
_LOAD, _OUTSIDE = 4.0, (0.30, 0.42)
#: Errors of two models in five cases; the second has none in one case [-].
_ERRORS, _COMPARISON = (0.02, 0.05, 0.01, 0.08, 0.03), (0.10, 0.07, float("nan"), 0.21, 0.05)


def score_fixed_images(subject: Subject) -> Values:  # noqa: ARG001 -- every experiment takes the sensor
    """Score a fixed prediction against a fixed reference by every metric; one texel is masked."""
    active = np.ones(_SHAPE, dtype=bool)
    active[3, 1] = False
    array = TexelArray.grid(*_SHAPE, _PITCH, active=active)
    reference, forces = _make_bump(array, (0.8e-3, -1.7e-3), 3.0e-3), _make_bump(array, (1.5e-3, -0.4e-3), 3.4e-3)
    scores = score(
        reference, 0.95 * forces, reference_outside=_OUTSIDE[0], outside=_OUTSIDE[1], load=_LOAD, array=array
    )
    levels = np.arange(array.count)
    images = score_images(5 * levels, np.where(levels % 3, 5 * levels, 7 * levels), active=array.active)
    return {**asdict(scores), "fixed images": {name: float(value) for name, value in asdict(images).items()}}


def pool_fixed_scores(subject: Subject) -> Values:  # noqa: ARG001 -- every experiment takes the sensor
    """Pool fixed errors over cases, with their interval and the skill of one model against the other."""
    found = {"mean": pool(_COMPARISON), "skill": skill(_ERRORS, _COMPARISON)}
    return {
        name: {"value": each.mean, "low end": each.low, "high end": each.high, "cases": float(each.cases)}
        for name, each in found.items()
    }


def _make_bump(array: TexelArray, middle: tuple[float, float], width: float) -> FloatArray:
    """Make texel forces that fall off from a point like a Gaussian, with a sum near the load, shape (n,) [N]."""
    distance = array.centres[:, :2] - middle
    weights = np.exp(-0.5 * (distance**2).sum(axis=1) / width**2)
    return np.asarray((_LOAD - _OUTSIDE[0]) * weights / weights.sum())
