"""Steady mean frames of stamp recordings, and recordings that are refused."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes.catalogue import ARRAYS
from tests.support.stamp import ARRAY, file_of
from validation.calibration.stamp import case as case_module
from validation.calibration.stamp.case import read_case
from validation.recordings import RecordedArray, Recording, RecordingError


def recording_of(*per_array, rate=30.0):
    """A recording of arrays with given counts, each (layout name, counts of shape (frames, n))."""
    arrays = tuple(
        RecordedArray(
            texels=ARRAYS[name],
            enabled=np.ones(ARRAYS[name].count, dtype=bool),
            counts=np.asarray(counts, dtype=np.int32),
            full_scale=4095,
            unit="mV",
            centre=(0, 0, 0),
            rotation=(0, 0, 0),
        )
        for name, counts in per_array
    )
    frames = len(arrays[0].counts)
    return Recording(
        path=Path("room/A1.dsa"),
        sha256="",
        serial="x",
        started=datetime(2014, 9, 10, tzinfo=UTC),
        times=np.arange(frames) / rate,
        arrays=arrays,
        temperatures=np.empty((0, 0)),
        temperature_times=np.empty(0),
    )


def pressed_counts(frames=450, on=60, texel=50, drift=10.0, rate=30.0):
    counts = np.zeros((frames, 78))
    time = (np.arange(frames) - on) / rate
    counts[on:, texel] = 1000 + drift * time[on:]
    return counts


def read(monkeypatch, recording, array=ARRAY):
    monkeypatch.setattr(case_module.dsa, "read", lambda _path: recording)
    return read_case(file_of("A"), array)


def test_the_steady_frame_is_the_mean_of_the_stated_window(monkeypatch):
    idle = ("wts-0614-34", np.zeros((450, 84)))
    case = read(monkeypatch, recording_of(idle, ("sdh2-distal", pressed_counts())))
    assert case.onset == pytest.approx(2.0)
    assert case.counts[50] == pytest.approx(1000 + 10 * 7.5, abs=0.7)
    assert case.counts.sum() == case.counts[50]


def test_a_short_press_before_the_load_does_not_count_as_its_onset(monkeypatch):
    counts = pressed_counts()
    counts[10:20, 50] = 900
    assert read(monkeypatch, recording_of(("sdh2-distal", counts))).onset == pytest.approx(2.0)


def test_noise_is_measured_without_the_drift(monkeypatch):
    rng = np.random.default_rng(0)
    counts = pressed_counts(drift=40.0)
    counts[60:, 50] += rng.normal(0, 12, 390)
    assert read(monkeypatch, recording_of(("sdh2-distal", counts))).noise == pytest.approx(12, rel=0.2)


def test_unusable_recordings_say_why(monkeypatch):
    distal = ("sdh2-distal", pressed_counts())
    with pytest.raises(RecordingError, match=r"number 0: 6 x 13, 68 active.*is not wts-0614-34 \(6 x 14"):
        read(monkeypatch, recording_of(distal), ARRAYS["wts-0614-34"])
    with pytest.raises(RecordingError, match="no array was pressed"):
        read(monkeypatch, recording_of(("sdh2-distal", np.zeros((450, 78)))))
    with pytest.raises(RecordingError, match=r"on for 5\.0 s; expected at least 9 s"):
        read(monkeypatch, recording_of(("sdh2-distal", pressed_counts(frames=211))))
    lifted = pressed_counts()
    for last in (440, 200):
        lifted[last:] = 0
        with pytest.raises(RecordingError, match="not under load at its end"):
            read(monkeypatch, recording_of(("sdh2-distal", lifted)))
