"""When a load was applied, and how its counts scatter and drift."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.calibration import SHARES, make_recording
from validation.calibration.calibrate import calibrate
from validation.calibration.noise_and_drift import find_load_onset

TIMES = np.arange(0, 15, 0.1)


@given(st.integers(1, 120), st.floats(1, 1e4), st.floats(0, 0.45), st.floats(-1e3, 1e3))
def test_onset_is_found_for_any_scale_offset_and_start(onset, counts, before, start):
    total = np.where(np.arange(len(TIMES)) < onset, before, 1.0) * counts
    frames = np.column_stack([0.25 * total, 0.75 * total])
    assert find_load_onset(TIMES + start, frames) == pytest.approx(TIMES[onset] + start)


def test_a_recording_that_ends_without_load_has_no_onset_before_its_end():
    counts = np.where((TIMES > 1) & (TIMES < 10), 100.0, 0.0)[:, None]
    assert find_load_onset(TIMES, counts) == TIMES[-1]


def test_drift_is_the_change_of_the_counts_between_two_ages():
    recordings = [make_recording(number, load, forces=None) for number, load in enumerate((2.0, 3.0, 4.0, 5.0))]
    for each in recordings:
        counts = each.arrays[0].counts
        counts[:] = np.rint(counts * (1 + 0.01 * each.times)[:, None])
    drift = calibrate(recordings, shares=SHARES).estimates["drift"]
    assert drift.value == pytest.approx(1.13 / 1.03 - 1, abs=2e-3)
    assert drift.low <= drift.value <= drift.high
