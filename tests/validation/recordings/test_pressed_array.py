"""The array of a recording that is pressed, as `replay`, `emulate` and `replay_frames` choose it."""

import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from tests.support.virtual_port import wait_until
from validation.cli.entry import main
from validation.recordings import mcap_reader, tables
from validation.recordings.capture import record
from validation.recordings.importing import save
from validation.recordings.live_frames import replay_frames
from validation.recordings.recording import Recording, find_pressed_array, make_array
from validation.weiss.protocol import MatrixInfo
from validation.weiss.sensor import Sensor
from validation.weiss.virtual import show_recording

_FRAMES = 40


def _make_recording(*counts):
    return Recording(
        path=Path("made"),
        sha256="",
        started=datetime(2026, 1, 1, tzinfo=UTC),
        times=np.arange(_FRAMES) / 100,
        arrays=tuple(make_array(2, 3, np.asarray(each, dtype=np.int32), name=f"a{n}") for n, each in enumerate(counts)),
    )


def _press(texel, peak, rest=0):
    counts = np.full((_FRAMES, 6), rest)
    counts[10:30, texel] = rest + peak
    return counts


@pytest.mark.parametrize(
    ("counts", "pressed"),
    [
        ([_press(0, 0), _press(3, 900), _press(2, 500)], 1),
        ([_press(0, 0), _press(0, 0), _press(5, 100)], 2),
        ([_press(0, 0, rest=2000), _press(3, 900)], 1),  # counts at rest are no load
        ([_press(0, 20, rest=300), np.tile([0, 0, 0, 0, 900, 0], (_FRAMES, 1))], 1),  # a load from first to last
        ([_press(0, -700), _press(1, 100)], 0),  # tared under the load
        ([_press(0, 0), _press(0, 0)], 0),
    ],
)
def test_the_array_that_is_pressed_is_found_and_shown(tmp_path, capsys, counts, pressed):
    recording = _make_recording(*counts)
    assert find_pressed_array(recording) == pressed
    frames = list(replay_frames(recording))
    assert np.array_equal([frame.counts for frame in frames], counts[pressed])


@pytest.mark.parametrize("mask", ["enabled", "active"])
def test_a_texel_that_does_not_measure_is_no_load(mask):
    wild, pressed = _make_recording(_press(1, 4000), _press(3, 900)).arrays
    on = np.arange(6) != 1
    wild = make_array(2, 3, wild.counts, active=on) if mask == "active" else replace(wild, enabled=on)
    assert find_pressed_array(replace(_make_recording(), arrays=(wild, pressed))) == 1


def test_replay_shows_the_pressed_array_in_every_form(tmp_path, softcover):
    save(_make_recording(_press(0, 0), _press(0, 0), _press(4, 900)), tmp_path / "a.mcap")
    for words, shown in ([], 2), (["--array", "1"], 1):
        status, out, _ = softcover("replay", "a.mcap", "--json", "--csv", f"{shown}.csv", *words)
        told = json.loads(out)
        assert (status, told["shown"]) == (0, shown)
        assert tables.read(tmp_path / f"{shown}.csv").arrays[0].counts.max() == told["arrays"][shown]["largest"]
    errors = softcover("replay", "a.mcap")[2]
    assert "array 2 is shown" in errors
    assert "3 columns x 2 rows (largest 0), 3 columns x 2 rows (largest 0), 3 columns x 2 rows (largest 900)" in errors


@pytest.mark.parametrize(("rows", "columns"), [(13, 6), (14, 6), (3, 5)])
def test_a_masked_array_is_recorded_from_its_emulation_as_it_is(plug_in, tmp_path, rows, columns):
    active = np.arange(rows * columns) % 7 != 3
    array = make_array(rows, columns, np.where(active, 50, 0)[None].astype(np.int32), active=active)
    matrix = MatrixInfo(columns=columns, rows=rows, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=4095)
    port = plug_in(show_recording([0.0], array.counts), matrix=matrix, active=active)
    with Sensor(port.name) as sensor:
        record(sensor, tmp_path / "a.mcap", seconds=0.05)
    back = mcap_reader.read(tmp_path / "a.mcap")
    assert back.arrays[0].has_layout_of(array.texels)
    assert back.setup.device["type"] == back.arrays[0].texels.name == f"WTS {columns:02}{rows:02}-34"
    assert back.setup.device["tag"] == "softcover"
    assert np.array_equal(back.arrays[0].counts[0], array.counts[0])


def test_the_command_emulates_a_masked_recording(tmp_path, capsys):
    """Texels that were switched off during the recording are masked as well."""
    made = _make_recording(_press(0, 0), _press(4, 900))
    off = np.array([True, True, False, True, True, True])
    made = replace(made, arrays=tuple(replace(array, enabled=off) for array in made.arrays))
    save(made, tmp_path / "a.mcap")
    port = tmp_path / "port"

    def ask():
        wait_until(port.exists)
        with Sensor(str(port), timeout=5) as sensor:
            told = sensor.read_type(), sensor.read_tag(), sensor.read_mask().tolist()
        os.kill(os.getpid(), signal.SIGINT)  # the command runs in the main thread and ends as by Ctrl-C
        return told

    with ThreadPoolExecutor() as pool:
        answers = pool.submit(ask)
        with pytest.raises(SystemExit) as end:
            main(["emulate", str(port), "--show", str(tmp_path / "a.mcap"), "--seconds", "30", "--tag", "left"])
    assert answers.result() == ("WTS 0302-34", "left", off.tolist())
    assert end.value.code == 0


def test_counts_beyond_12_bits_cannot_be_emulated(tmp_path, softcover):
    (tmp_path / "a.csv").write_text("# rows = 1\n# full_scale = 60000\ntime,a,b\n0,1,50000\n")
    status, _, errors = softcover("emulate", "--show", "a.csv")
    assert status == 2
    assert "12 bits" in errors
