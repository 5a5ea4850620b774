"""Scores of counts show planted defects and ignore masked texels."""

import dataclasses

import numpy as np
import pytest

from tests.support.stamp import ARRAY, synthetic
from validation.calibration.stamp import score_counts


def test_count_scores_see_planted_defects_and_ignore_masked_texels():
    counts = synthetic((-0.5e-3, 11.3e-3, 0.0, np.log(0.7)), "H")[0].counts
    same = score_counts(counts, counts.copy(), full_scale=4095, array=ARRAY)
    assert dataclasses.astuple(same) == (0, 0, 0, 0, 0, 0, 1)
    on_mask = counts.copy()
    on_mask[0] = 4000
    assert score_counts(counts, on_mask, full_scale=4095, array=ARRAY) == same
    shifted = score_counts(counts, np.roll(counts, 1), full_scale=4095, array=ARRAY)
    assert shifted.centre_of_pressure_m > 1e-3
    assert shifted.wasserstein_m > 1e-3
    assert shifted.active_area_iou < 1
    louder = score_counts(counts, 1.1 * counts, full_scale=4095, array=ARRAY)
    assert louder.total_counts_error == pytest.approx(0.1)
    assert louder.relative_l2 == pytest.approx(0.1)
    white = score_counts(np.where(np.arange(78) == 50, 4095, 0), np.full(78, 4095.0), full_scale=4095, array=ARRAY)
    assert white.image_changed_percent == pytest.approx(100 * 67 / 68)
    assert white.pixels_changed == 67
