"""Calibration on synthetic sensors with known parameters, and on the weight series."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes import Box, Sphere, TexelArray
from tests.support.calibration import SHARES, make_recording
from validation.calibration.calibrate import calibrate, flat_shares
from validation.recordings.recording import RecordingError, Setup, make_array


def test_the_effect_of_temperature_is_found():
    recordings = [
        make_recording(f"{load}-{warm}", load, temperature=warm, slope=-0.01)
        for load in (2, 3, 4, 5)
        for warm in (30, 40)
    ]
    estimate = calibrate(recordings, shares=SHARES).estimates["temperature"]
    assert estimate.value == pytest.approx(-0.01, abs=5e-4)


def test_a_force_sensor_beside_the_frames_gives_the_loads():
    def ramp(times):
        return 4 + 3 * np.sin(times)

    found = calibrate([make_recording(0, None, forces=ramp, random=np.random.default_rng(1))], shares=SHARES)
    sensitivity = found.estimates["sensitivity"]
    assert sensitivity.low <= 2600 <= sensitivity.high
    assert sensitivity.high - sensitivity.low < 100


def test_shares_under_a_flat_face():
    array = TexelArray.grid(4, 4, 3.4e-3)
    whole = flat_shares(array, Box(size=(13.6e-3, 13.6e-3, 5e-3)))
    assert np.allclose(whole, 1 / 16)
    half = flat_shares(array, Box(size=(3.4e-3, 3.4e-3, 5e-3)), at=(0.0, 1.7e-3))
    assert half.sum() == pytest.approx(1)
    assert np.count_nonzero(half) == 2
    with pytest.raises(ValueError, match="no flat face"):
        flat_shares(array, Sphere(radius=1e-3), at=(50e-3, 0))


def test_recordings_that_cannot_be_calibrated_are_refused():
    with pytest.raises(RecordingError, match="its load is not known"):
        calibrate([replace(make_recording(0, 2.0), setup=Setup())], shares=SHARES)
    with pytest.raises(ValueError, match="at least 3 recordings"):
        calibrate([make_recording(0, 2.0), make_recording(1, 3.0)], shares=SHARES)
    with pytest.raises(ValueError, match="no recordings"):
        calibrate([], shares=SHARES)
    with pytest.raises(RecordingError, match="expected 5"):
        calibrate([make_recording(0, 2.0)], shares=np.full(5, 0.2))
    other = replace(make_recording(1, 3.0), setup=Setup(load=3.0, device={"threshold": 9}))
    wide = replace(make_recording(2, 3.0), arrays=(make_array(1, 4, np.zeros((300, 4), dtype=np.int32)),))
    with pytest.raises(RecordingError, match=r"2\.mcap: array 0 is not laid out as that of 0\.mcap"):
        calibrate([make_recording(0, 2.0), wide], shares=SHARES)
    empty = replace(make_recording(2, 3.0), times=np.empty(0))
    with pytest.raises(RecordingError, match=r"2\.mcap: holds no frames"):
        calibrate([make_recording(0, 2.0), empty], shares=SHARES)
    with pytest.raises(RecordingError, match="several thresholds"):
        calibrate([make_recording(0, 2.0), other], shares=SHARES)


@given(st.floats(3e-3, 12e-3), st.floats(-2e-3, 2e-3), st.floats(-2e-3, 2e-3))
def test_shares_are_a_whole_load_and_follow_a_mirrored_tool(edge, x, y):
    array, tool = TexelArray.grid(6, 6, 3.4e-3), Box(size=(edge, edge, 5e-3))
    shares = flat_shares(array, tool, at=(x, y))
    assert shares.min() >= 0
    assert shares.sum() == pytest.approx(1)
    mirrored = flat_shares(array, tool, at=(-x, -y))
    assert mirrored == pytest.approx(shares[::-1], abs=2e-2)
