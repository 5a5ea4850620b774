"""Rates, delays, limits, clocks and layouts of recordings, computed by hand at and beside each bound."""

import signal
import threading
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from validation.errors import InputError
from validation.recordings import RecordingError, mcap_reader, tables
from validation.recordings import recording as recordings
from validation.recordings.importing import add_forces, list_modules, open_recording, save
from validation.recordings.mcap_writer import Clocks, RecordingWriter, find_kind, name_topics
from validation.recordings.recording import (
    Budget,
    Limits,
    Recording,
    Setup,
    choose_array,
    convert_to_utc,
    count_seconds,
    find_pressed_array,
    limit_time,
    make_array,
)


def make(times=(0.0,), counts=None, **options):
    counts = np.zeros((len(times), 2)) if counts is None else np.array(counts)
    return Recording(
        path=Path("made"), sha256="", times=np.array(times, dtype=float),
        **{"arrays": (make_array(1, 2, counts.astype(np.int32)),), "started": datetime(2026, 1, 1, tzinfo=UTC)}
        | options,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("times", "seconds", "rate"),
    [((), 0, np.nan), ((0,), 0, np.nan), ((0, 0), 0, np.nan), ((0, 0.5), 0.5, 2), ((1, 1.2, 2), 2, 2),
     ((0, 1, 8), 8, 0.25)],
)  # fmt: skip
def test_the_rate_is_that_of_the_steps_between_frames(times, seconds, rate):
    made = make(times)
    assert (made.seconds, made.frame_rate) == pytest.approx((seconds, rate), nan_ok=True)


def test_delays_are_arrivals_beyond_the_stamps_without_the_common_part():
    arrivals = np.array([5_000_000_000, 5_130_000_000, 5_190_000_000])
    assert make((0, 0.1, 0.2), host_monotonic=arrivals).arrival_delays == pytest.approx([0.01, 0.04, 0.0])
    assert make((0, 0.1, 0.2), host_monotonic=arrivals * [1, 0, 1]).arrival_delays.shape == (0,)
    assert make((0, 0.1, 0.2)).arrival_delays.shape == (0,)


def test_times_since_1970_become_dates_and_seconds():
    assert convert_to_utc(1_500_000_123_456_789).isoformat() == "1970-01-18T08:40:00.123456+00:00"
    assert count_seconds([5_000_000_000, 4_000_000_001], 4_000_000_000) == pytest.approx([1.0, 1e-9], rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "scales", "pressed"),  # largest change and full scale of each array
    [
        ((30, 20), (1000, 1000), 0),
        ((30, 20), (1000, 200), 1),  # in shares of the full scale
        ((20, 10), (1000, 1000), 1),  # 2 % is no press: the array whose one texel is farthest above the others
        ((21, 10), (1000, 1000), 0),
    ],
)
def test_the_pressed_array_changes_by_more_than_two_percent_of_its_range(changes, scales, pressed):
    arrays = []
    for number, (change, scale) in enumerate(zip(changes, scales, strict=True)):
        counts = np.zeros((4, 6), dtype=np.int32)
        counts[2:, 3] = change
        counts[:, 0] = 500 * number
        arrays.append(replace(make_array(2, 3, counts), full_scale=scale))
    made = make(range(4), arrays=tuple(arrays))
    assert find_pressed_array(made) == choose_array(made, None) == pressed
    assert [choose_array(made, index) for index in (0, 1)] == [0, 1]
    for index in (-1, 2):
        with pytest.raises(InputError, match=rf"has 2 arrays; accepted: 0\.\.1, not {index}"):
            choose_array(made, index)


def test_a_budget_grows_with_the_size_of_the_file(monkeypatch):
    monkeypatch.setattr(recordings, "LIMITS", Limits(kept=1000, ratio=10, records=5, message=100))
    for size, bytes_, records in ((0, 1000, 5), (7, 1070, 12)):
        Budget(Path("a"), size).spend(size=bytes_, records=records)
        for over in ({"size": bytes_ + 1}, {"records": records + 1}):
            with pytest.raises(RecordingError, match="far more messages than a recording of its size"):
                Budget(Path("a"), size).spend(**over)
    budget = Budget(Path("a"), 0)
    budget.spend_message("/a", 400, (0, 2**63 - 1))
    budget.spend_message("/a", 400, (1,))
    with pytest.raises(RecordingError, match="far more"):
        budget.spend_message("/a", 0, (1,))
    for times in ((-1, 5), (5, 2**63)):
        with pytest.raises(RecordingError, match="a message of /a has no possible time"):
            Budget(Path("a"), 0).spend_message("/a", 0, times)


def test_the_time_to_read_grows_with_the_size_of_the_file_and_its_folder(tmp_path, monkeypatch):
    """16 KiB are a second; in other threads there is no timer."""
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(bytes(2**15))
    for path, seconds in ((tmp_path / "a", 7), (tmp_path, 9), (tmp_path / "none", 5)):
        with limit_time(path):
            assert signal.getitimer(signal.ITIMER_PROF)[0] == pytest.approx(seconds, abs=0.2)
        assert signal.getitimer(signal.ITIMER_PROF)[0] == 0
    monkeypatch.setattr(recordings, "LIMITS", Limits(seconds=1.0, files=1))
    with limit_time(tmp_path):
        assert signal.getitimer(signal.ITIMER_PROF)[0] == pytest.approx(3, abs=0.2)
    told = []

    def read():
        with limit_time(tmp_path):
            told.append(signal.getitimer(signal.ITIMER_PROF)[0])

    thread = threading.Thread(target=read)
    thread.start()
    thread.join()
    assert told == [0.0]


def write_table(path, text, head="# rows = 1\n"):
    path.write_text(head + text)
    return path


@pytest.mark.parametrize(
    ("times", "delay", "found"),  # frames from 0 s to 2 s, begun at 1.7e9 s; readings may lack for half a second
    [
        ((0.5, 1.5), 0.0, (0.5, 1.5)),
        ((0.51, 2.0), 0.0, None),
        ((0.0, 1.49), 0.0, None),
        ((0.7, 1.7), 0.2, (0.5, 1.5)),
        ((1.7e9, 1.7e9 + 2), 0.0, (0.0, 2.0)),
        ((1.7e9 + 3, 1.7e9 + 5), 3.0, (0.0, 2.0)),
        ((-5.0, 1e8), 0.0, (-5.0, 1e8)),
    ],
)
def test_forces_cover_the_frames_but_for_half_a_second(tmp_path, times, delay, found):
    made = open_recording(write_table(tmp_path / "a.csv", "time,a,b\n1.7e9,1,2\n1700000002,3,4\n"))
    lines = "".join(f"{time!r},{number + 4}\n" for number, time in enumerate(times))
    path = write_table(tmp_path / "f.csv", "time,force\n" + lines, head="")
    if found is None:
        with pytest.raises(RecordingError, match=r"do not cover the frames, 0 s to 2\.00 s"):
            add_forces(made, path, delay=delay)
    else:
        added = add_forces(made, path, delay=delay)
        assert added.force_times == pytest.approx(found, abs=1e-6)
        assert added.forces.tolist() == [4.0, 5.0]


@pytest.mark.parametrize(
    ("first", "last", "fits"),
    [(2**31 - 2, 1.0, True), (2**31 - 2, 1.5, False), (0, 2**31 - 1, True), (0, 2**31, False)],
)  # fmt: skip
def test_times_up_to_19_january_2038_are_saved(tmp_path, first, last, fits):
    made = make((0.0, last), [[1, 2], [3, 4]], started=datetime.fromtimestamp(first, UTC))
    if fits:
        assert save(made, tmp_path / "a.mcap") == 2
        assert open_recording(tmp_path / "a.mcap").times == pytest.approx([0, last])
    else:
        with pytest.raises(RecordingError, match="do not fit an MCAP file, which ends at 2147483647 s"):
            save(made, tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("counts", "fits"),
    [((-7, 65528), True), ((-7, 65529), False), ((0, 65535), True), ((0, 65536), False), ((-9, -3), True)],
)  # fmt: skip
def test_counts_of_16_bits_are_saved_with_an_offset(tmp_path, counts, fits):
    made = make((0.0,), [counts])
    if not fits:
        with pytest.raises(RecordingError, match=f"counts from {counts[0]} to {counts[1]} do not fit"):
            save(made, tmp_path / "a.mcap")
        return
    save(made, tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap").arrays[0]
    assert back.counts.tolist() == [list(counts)]
    assert back.offset == max(0, -counts[0])
    # the image of the file shows black for what is negative
    shown = open_recording(tmp_path / "a.mcap", topic="/tactile/image").arrays[0]
    assert shown.counts.tolist() == [[max(each, 0) for each in counts]]


@pytest.mark.parametrize(
    ("head", "text", "words"),
    [
        ("# rows = 1\n# pitch = 1.1\n", "time,a\n0,1\n", "expected a number of 1e-06 to 1"),
        ("# rows = 1\n# pitch = 9e-7\n", "time,a\n0,1\n", "expected a number of 1e-06 to 1"),
        ("# rows = 1\n# full_scale = 2147483648\n", "time,a\n0,1\n", "of 1 to 2147483647"),
        ("# rows = 1\n# full_scale = 10.5\n", "time,a\n0,1\n", "expected a whole number"),
        ("# rows = 1\n# full_scale = 8\n", "time,a\n0,9\n", "a count of 9 exceeds the full scale of 8"),
        ("# rows = 1\n# load = -1\n", "time,a\n0,1\n", "expected a number of 0 to inf"),
        ("# rows = 1\n", "time,a\n1e11,1\n2e20,1\n", "must lie within 9e\\+09"),
        ("# rows = 1\n", "time,force,a\n0,9.1e9,1\n", "line 3: times, forces and temperatures must lie within"),
        ("# rows = 1\n", "time,a,b\n0,100,1.02\n0,98.9,0\n", None),
        ("# rows = 1\n", "time,a,b\n0,24,0.3\n", "rounding would change them by up to 0.3"),
        ("# rows = 1\n", "time,a\n", "no frames; expected at least one line"),
        ("", "", "empty; expected a line `time"),
        ("# rows = 1\n", "time,a,a\n0,1,2\n", "line 2: 3 columns between commas"),
        ("# rows = 2\n", "time,a,b,c\n0,1,2,3\n", "3 texels are not 2 rows x 1 columns"),
        ("# rows = 1\n", "time,a [kPa],b\n0,1,2\n", None),
        ("# rows = 1\n", "time,a [mV],b [mV],c [kPa]\n0,1,2,3\n", "the column 'c \\[kpa\\]' has another unit"),
        ("# rows = 1\n", "time,a [mV],b [mV]\n0,1,2\n", None),
    ],
)  # fmt: skip
def test_tables_at_and_beyond_their_bounds(tmp_path, head, text, words):
    path = write_table(tmp_path / "a.csv", text, head)
    if words is None:
        assert tables.read(path).arrays[0].counts.shape[1] == 2
        return
    with pytest.raises(RecordingError, match=words):
        tables.read(path)


def test_numbers_of_a_table_at_its_bounds_are_read(tmp_path):
    head = "# rows = 1\n# pitch = 1\n# full_scale = 2147483647\n# load = 0\n# note = a = b\n"
    found = tables.read(write_table(tmp_path / "a.csv", "time_s,a,b\n-3,2147483647,0\n-3,5,1\n", head))
    assert (found.arrays[0].texels.pitch, found.arrays[0].full_scale) == ((1.0, 1.0), 2**31 - 1)
    assert (found.setup.load, found.setup.note) == (0.0, "a = b")
    assert found.times.tolist() == [0.0, 0.0]
    assert found.started.timestamp() == 0.0  # times before 1970 count from the first frame


def test_a_history_begins_at_zero_and_has_one_of_its_sets_of_columns(tmp_path):
    kinds = ("load",), ("x", "depth")
    path = write_table(tmp_path / "a.csv", "time,Load_N\n0.5,1\n2,3\n", head="")
    found = tables.read_history(path, *kinds)
    assert {name: values.tolist() for name, values in found.items()} == {"time": [0.0, 1.5], "load": [1.0, 3.0]}
    found = tables.read_history(write_table(path, "time,depth_m,x_m\n0,1,2\n", head=""), *kinds)
    assert {name: values.tolist() for name, values in found.items()} == {"time": [0.0], "depth": [1.0], "x": [2.0]}
    for text in ("time,x\n0,1\n", "time,load\n", "time,load\n-0.1,1\n", "time,load,x\n0,1,2\n"):
        with pytest.raises(RecordingError, match=r"with `load`, or `x` and `depth`|begins at -0\.1 s"):
            tables.read_history(write_table(path, text, head=""), *kinds)


def test_modules_are_those_of_the_endings():
    paths = ["a.MCAP", "b.csv", "c.bag", "d.db3", "e.mcap", "f.dsa", "folder"]
    assert list_modules(paths) == ("mcap", "rosbags")


def test_topics_are_named_by_array_and_known_by_their_last_part():
    assert (name_topics(1), name_topics(3)) == (["tactile"], ["tactile_0", "tactile_1", "tactile_2"])
    assert find_kind("/tactile_0/image") == "sensor_msgs/msg/Image"
    assert find_kind("/force") == find_kind("/a/wrench") == "geometry_msgs/msg/WrenchStamped"
    assert find_kind("/other") is None


def test_readings_beside_the_frames_come_back_at_their_times(tmp_path):
    """Frames at 2.5 s and 3.5 s by publish time; arrival, temperatures, forces and gaps have times of their own."""
    arrays = [make_array(2, 3, full_scale=65535, pitch=(4e-3, 3e-3)), make_array(1, 6)]
    second = 10**9
    with RecordingWriter(tmp_path / "a.mcap", arrays=arrays, setup=Setup(load=2.0), serial="7", start=second) as writer:
        for number, at in enumerate((2.5, 3.5)):
            clocks = Clocks(round(at * second), 11 + number, 5 + number, arrival=round(at * second) + 7)
            writer.add_frame(0, clocks, np.array([0, 1, 2, 3, 4, 65535 * number]))
            writer.add_frame(1, clocks, np.arange(6) + number)
        writer.add_temperatures(3 * second, [20.5, 30.5])
        writer.add_force(2 * second, 1.25)
        writer.add_gap(2 * second, "three frames")
        assert writer.frames == 2
        for counts in ([0, 0, 0, 0, 0, 65536], [-1, 0, 0, 0, 0, 0]):
            with pytest.raises(ValueError, match=r"counts must lie in 0\.\.65535"):
                writer.add_frame(0, clocks, np.array(counts))
    back = mcap_reader.read(tmp_path / "a.mcap")
    assert [array.counts.tolist() for array in back.arrays] == [
        [[0, 1, 2, 3, 4, 0], [0, 1, 2, 3, 4, 65535]], [[0, 1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 6]]
    ]  # fmt: skip
    shapes = [(each.texels.rows, each.texels.columns, each.full_scale) for each in back.arrays]
    assert shapes == [(2, 3, 65535), (1, 6, 4095)]
    assert back.arrays[0].texels.pitch == (4e-3, 3e-3)
    assert back.started.timestamp() == 2.5
    assert back.times.tolist() == [0.0, 1.0]
    assert (back.temperatures.tolist(), back.temperature_times.tolist()) == ([[20.5, 30.5]], [0.5])
    assert (back.forces.tolist(), back.force_times.tolist()) == ([1.25], [-0.5])
    assert (back.gaps, back.serial, back.complete) == (("three frames",), "7", True)
    assert (back.host_monotonic.tolist(), back.ticks.tolist()) == ([11, 12], [5, 6])
