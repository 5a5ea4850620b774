"""Properties of an indenter, found by sampling its gap."""

from __future__ import annotations

import numpy as np


def is_flat_where_sampled(indenter):
    """Whether the gap is zero or infinite at the points of a grid over the footprint."""
    x, y = np.meshgrid(*(np.linspace(-half, half, 41) for half in indenter.footprint))
    gap = indenter.gap(x, y)
    return bool((gap[np.isfinite(gap)] == 0).all())


def is_symmetric_where_sampled(indenter):
    """Whether the gap equals its mirror images at random points, but for a few beside outlines, where it jumps."""
    x, y = (np.random.default_rng(7).uniform(-1, 1, (4000, 2)) * indenter.footprint).T
    gap = np.nan_to_num(indenter.gap(x, y), posinf=-1.0)
    images = (np.nan_to_num(indenter.gap(s * x, -s * y), posinf=-1.0) for s in (-1, 1))
    return tuple(bool(np.mean(np.abs(gap - image) > 1e-7) < 2e-3) for image in images)
