"""Parts that all readers of recordings share: arrays, frames, hashes, files, and the limits on what they hold."""

import hashlib
import os
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from validation.errors import InputError
from validation.recordings import RecordingError
from validation.recordings import recording as recordings
from validation.recordings.live_frames import replay_frames, stream_frames
from validation.recordings.recording import (
    Limits,
    RecordedArray,
    Recording,
    Setup,
    SimulatedForces,
    convert_to_utc,
    find_pressed_array,
    hash_contents,
    limit_time,
    make_array,
    open_recorded,
)
from validation.weiss.protocol import MatrixInfo, Reading
from validation.weiss.stream import Gap


def test_an_array_that_states_nothing_is_one_of_weiss():
    plain = make_array(2, 3)
    assert (plain.texels.pitch, plain.full_scale, plain.texels.name) == ((3.4e-3, 3.4e-3), 4095, "tactile")
    assert (plain.counts.shape, plain.counts.dtype) == ((0, 6), np.int32)
    assert plain.enabled.tolist() == plain.texels.active.tolist() == [True] * 6
    assert (plain.offset, plain.unit, plain.centre, plain.rotation) == (0, "counts", (0, 0, 0), (0, 0, 0))
    active = np.arange(6) != 2
    made = make_array(2, 3, np.ones((4, 6), dtype=np.int32), pitch=(4e-3, 5e-3), full_scale=9, active=active, name="x")
    assert (made.texels.pitch, made.full_scale, made.texels.name) == ((4e-3, 5e-3), 9, "x")
    assert (made.counts.sum(), made.texels.active.tolist()) == (24, active.tolist())
    assert made.texels.centres.mean(axis=0) == pytest.approx(0, abs=1e-12)


def test_a_recording_that_states_nothing_has_these_values():
    made = Recording(path=Path("x"), sha256="", started=datetime(2020, 1, 1, tzinfo=UTC), times=np.zeros(0), arrays=())
    assert (made.serial, made.gaps, made.complete, made.setup) == ("", (), True, Setup())
    assert (made.temperatures.shape, made.temperature_times.shape) == ((0, 0), (0,))
    assert (made.forces.shape, made.force_times.shape, made.host_monotonic.shape, made.ticks.shape) == ((0,),) * 4
    assert made.host_monotonic.dtype == made.ticks.dtype == np.int64


@pytest.mark.parametrize("load", [-0.1, np.nan, np.inf])
def test_a_load_is_a_force_of_zero_or_more(load):
    assert Setup(load=0.0).load == 0.0
    with pytest.raises(ValueError, match=f"a load is a force of 0 N or more, not {load}"):
        Setup(load=load)


def test_conditions_are_read_from_text():
    found = Setup.read("sphere:radius=5mm", "500 g", "my note")
    assert (found.indenter, found.note) == ("sphere:radius=5mm", "my note")
    assert found.load == pytest.approx(0.5 * 9.80665)
    assert Setup.read("", None, "") == Setup()
    for indenter, load in (("ball:x=1", None), ("", "heavy")):
        with pytest.raises(InputError):
            Setup.read(indenter, load, "")


FORCES = SimulatedForces(
    texel_forces=np.array([[1.0, 2.0], [3.0, np.nan]]), pressures=np.array([[5.0, 6.0], [7.0, 8.0]]),
    net_force=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), net_torque=np.array([[np.nan] * 3, [7.0, 8.0, 9.0]]),
    tangential=np.arange(8.0).reshape(2, 2, 2), tangential_source="t",
)  # fmt: skip


def test_a_simulated_frame_has_the_forces_that_are_known():
    first, second = FORCES.select(0), FORCES.select(1)
    assert sorted(first) == ["net_force", "tangential", "tangential_source", "texel_forces"]
    assert sorted(second) == ["net_force", "net_torque", "tangential", "tangential_source"]
    assert (first["texel_forces"].tolist(), first["net_force"].tolist()) == ([1, 2], [1, 2, 3])
    assert (second["net_torque"].tolist(), second["tangential"].tolist()) == ([7, 8, 9], [[4, 5], [6, 7]])
    first["net_force"][0] = 99
    assert FORCES.net_force[0, 0] == 1  # a copy
    assert SimulatedForces(**{**vars(FORCES), "tangential_source": ""}).select(0)["tangential_source"] == ""


def make_recorded(counts, *, full_scale=510, simulated=None):
    texels = TexelArray.grid(1, 2, (4e-3, 3e-3), texel_size=(2e-3, 1.5e-3))
    return RecordedArray(texels=texels, enabled=np.ones(2, dtype=bool), counts=np.array(counts, dtype=np.int32),
                         full_scale=full_scale, simulated=simulated)  # fmt: skip


def test_a_frame_has_the_grey_levels_of_its_full_scale():
    """255 counts of 510 are a half: grey 127.5 is 128; pressure is force over 3 mm2."""
    frame = make_recorded([[0, 510], [255, -3]], simulated=FORCES).make_frame(1, 2.5)
    assert (frame.time, frame.counts.tolist(), frame.image.tolist()) == (2.5, [255, -3], [[128, 0]])
    assert frame.counts.dtype == np.int64
    assert (frame.texel_forces, frame.net_torque.tolist(), frame.tangential_source) == (None, [7, 8, 9], "t")
    first = make_recorded([[0, 510], [255, -3]], simulated=FORCES).make_frame(0, 2.0)
    assert first.pressures == pytest.approx(np.array([1.0, 2.0]) / 3e-6)
    bare = make_recorded([[0, 510]]).make_frame(0, 0.0)
    assert (bare.texel_forces, bare.net_force, bare.image.tolist()) == (None, None, [[0, 255]])


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True),
        ({"pitch": (4e-3 + 1.8e-6, 3e-3)}, True),  # centres move by 0.9 um
        ({"pitch": (4e-3 + 2.2e-6, 3e-3)}, False),
        ({"pitch": (4e-3, 3e-3 + 2.2e-6)}, False),
        ({"rows": 1, "columns": 4}, False),
        ({"active": np.arange(4) != 1}, False),
    ],
)
def test_a_layout_is_the_same_within_a_micrometre(changes, same):
    mine = make_array(2, 2, pitch=(4e-3, 3e-3))
    other = {"rows": 2, "columns": 2, "pitch": (4e-3, 3e-3), **changes}
    assert mine.has_layout_of(TexelArray.grid(**other)) is same


def gather(*arrays):
    return Recording(path=Path("x"), sha256="", started=datetime(2020, 1, 1, tzinfo=UTC), times=np.arange(3.0),
                     arrays=arrays)  # fmt: skip


def test_the_pressed_array_rises_most_of_those_that_measure_or_stands_above_its_median():
    quiet = make_array(1, 3, np.full((3, 3), 50, dtype=np.int32), full_scale=100)
    rises = make_array(1, 3, np.array([[0, 0, 0], [0, 9, 0], [0, 0, 0]], dtype=np.int32), full_scale=100)
    falls = make_array(1, 3, np.array([[0, 0, 0], [0, 0, -12], [0, 0, 0]], dtype=np.int32), full_scale=100)
    assert find_pressed_array(gather(quiet, rises, falls)) == 2
    assert find_pressed_array(gather(quiet, falls, rises)) == 1
    off = replace(falls, enabled=np.array([True, True, False]))
    assert find_pressed_array(gather(off, quiet, rises)) == 2
    masked = make_array(1, 3, falls.counts, full_scale=100, active=np.array([True, True, False]))
    assert find_pressed_array(gather(masked, rises, quiet)) == 1
    # nothing changes: the array with a texel 40 above its median, not that with all counts high
    rests = make_array(1, 3, np.tile(np.array([[5, 5, 45]], dtype=np.int32), (3, 1)), full_scale=100)
    assert find_pressed_array(gather(quiet, rests)) == 1
    assert find_pressed_array(gather(rests, quiet)) == 0
    assert find_pressed_array(gather(quiet, replace(rests, full_scale=1000), replace(rests, full_scale=200))) == 2
    assert find_pressed_array(gather(replace(quiet, enabled=np.zeros(3, dtype=bool)), quiet)) == 0
    empty = make_array(1, 3, full_scale=100)
    assert find_pressed_array(gather(empty, rests)) == 1


def test_a_folder_is_hashed_over_its_files_in_the_order_of_their_paths(tmp_path):
    (tmp_path / "b").write_bytes(b"two")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "z").write_bytes(b"one")
    (tmp_path / "c").write_bytes(b"three")
    assert hash_contents(tmp_path) == hashlib.sha256(b"onetwothree").hexdigest()
    assert hash_contents(tmp_path / "c") == hashlib.sha256(b"three").hexdigest()


@pytest.mark.parametrize("expected", [None, "a bag"])
def test_a_file_that_cannot_be_opened_is_named_with_what_is_expected(tmp_path, expected):
    words = () if expected is None else (expected,)
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(RecordingError) as caught:
            open_recorded(path, *words)
        assert str(caught.value) == f"{path}: no such file; expected {expected or 'a recording'}"
    (tmp_path / "a").write_bytes(b"x")
    with pytest.raises(RecordingError) as caught:
        open_recorded(tmp_path / "a" / "b", *words)
    assert str(caught.value) == f"{tmp_path / 'a' / 'b'}: Not a directory; expected {expected or 'a recording'}"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RecordingError, match=r"pipe: is no regular file; accepted: a file, no pipe or device"):
        open_recorded(tmp_path / "pipe")
    with open_recorded(tmp_path / "a") as file:
        assert file.read() == b"x"


def test_reading_is_stopped_at_its_time(monkeypatch):
    def read():
        with limit_time(Path("none")):
            deadline = time.process_time() + 5
            while time.process_time() < deadline:
                pass

    monkeypatch.setattr(recordings, "LIMITS", Limits(seconds=0.02))
    started = time.process_time()
    with pytest.raises(RecordingError, match="none: takes more than the 0 s of processor time accepted for its size"):
        read()
    assert time.process_time() - started < 1


def test_the_limits_are_those_stated():
    limits = Limits()
    assert (limits.kept, limits.ratio, limits.records, limits.message) == (2**28, 64, 2**17, 300)
    assert (limits.files, limits.seconds, limits.rate) == (1000, 5.0, 2**14)
    assert (recordings.MOST_ARRAYS, recordings.MOST_FULL_SCALE, recordings.LATEST) == (64, 2**31 - 1, 2**63 - 1)
    with pytest.raises(OverflowError):
        convert_to_utc(2**63 * 10**3)


class Streaming:
    """A sensor of two columns that sends two readings and a gap between them."""

    def __init__(self):
        self.asked = None

    def read_matrix(self):
        return MatrixInfo(columns=2, rows=1, cell_width=4e-3, cell_height=3e-3, full_scale=510)

    def stream(self, **options):
        self.asked = options
        for ticks in (1500, 1504):
            yield Reading(counts=np.array([255, ticks - 1400], dtype=np.uint16), ticks=ticks)
            yield Gap(kind="silence", host_time=0)


def test_frames_of_a_sensor_have_grey_levels_and_the_time_of_its_clock():
    sensor = Streaming()
    frames = list(stream_frames(sensor, reconnect=3.0))
    assert sensor.asked == {"reconnect": 3.0}
    assert [frame.time for frame in frames] == [1.5, 1.504]
    assert [frame.counts.tolist() for frame in frames] == [[255, 100], [255, 104]]
    assert [frame.image.tolist() for frame in frames] == [[[128, 50]], [[128, 52]]]
    assert list(stream_frames(sensor))
    assert sensor.asked == {"reconnect": 0.0}


def test_a_replay_shows_the_array_that_is_named_or_pressed():
    first, second = make_recorded([[1, 2], [3, 4], [5, 6]]), make_recorded([[0, 10], [0, 500], [0, 20]])
    made = gather(first, second)
    assert [frame.counts.tolist() for frame in replay_frames(made)] == [[0, 10], [0, 500], [0, 20]]
    assert [frame.counts.tolist() for frame in replay_frames(made, array=0)] == [[1, 2], [3, 4], [5, 6]]
    assert [frame.time for frame in replay_frames(made, array=0)] == [0, 1, 2]
