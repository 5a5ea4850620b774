"""MCAP recordings byte for byte: every field of every message, written and read by its public specification."""

import json
import os
import time
from dataclasses import replace

import numpy as np
import pytest

from fastmodel.signal.frame import Frame
from meshes import TexelArray
from tests.support.mcap_bytes import encode_cdr, encode_header, take_apart
from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
from validation.recordings.recording import RecordedArray, Setup, make_array

SECOND = 10**9
PAD = RecordedArray(
    texels=TexelArray.grid(2, 3, (4e-3, 3e-3), texel_size=(3.5e-3, 2.5e-3), active=np.arange(6) != 4, name="left"),
    enabled=np.arange(6) != 1, counts=np.empty((0, 6), dtype=np.int32), full_scale=900, offset=7, unit="mV",
    centre=(0.01, -0.02, 0.03), rotation=(0.1, 0.2, -0.3),
)  # fmt: skip
SMALL = make_array(1, 2, name="right", pitch=(2e-3, 5e-3), full_scale=50)
SETUP = Setup(indenter="sphere:radius=5mm", load=1.5, note="a note", source="/dev/x", source_sha256="ab",
              device={"gain": 3}, other={"mass": "5"})  # fmt: skip
LABELS = {
    "format": "softcover-recording/1",
    "serial": "S7",
    "arrays": [
        {"name": "left", "rows": 2, "columns": 3, "pitch_m": [4e-3, 3e-3], "texel_size_m": [3.5e-3, 2.5e-3],
         "active": "111101", "enabled": "101111", "full_scale": 900, "offset": 7, "unit": "mV",
         "centre_m": [0.01, -0.02, 0.03], "rotation_rad": [0.1, 0.2, -0.3]},
        {"name": "right", "rows": 1, "columns": 2, "pitch_m": [2e-3, 5e-3], "texel_size_m": [2e-3, 5e-3],
         "active": "11", "enabled": "11", "full_scale": 50, "offset": 0, "unit": "counts",
         "centre_m": [0, 0, 0], "rotation_rad": [0, 0, 0]},
    ],
    "clock": {"start_ns": 5 * SECOND, "monotonic_ns": 0},
    "setup": {"indenter": "sphere:radius=5mm", "load": 1.5, "note": "a note", "source": "/dev/x",
              "source_sha256": "ab", "device": {"gain": 3}, "other": {"mass": "5"}},
}  # fmt: skip


def numbers(label, sides, values):
    """Fields of a multi-array of numbers, whose sizes and strides are given."""
    strides = [int(np.prod(sides[place:])) for place in range(len(sides))]
    dims = [
        part
        for place, (size, stride) in enumerate(zip(sides, strides, strict=True))
        for part in (("s", label if place == 0 else ""), ("I", size), ("I", stride))
    ]
    return ("I", len(sides)), *dims, ("I", 0), ("d*", values)


def write(path):
    """One frame of a real array, one of a simulated array, and one reading of each other kind."""
    frame = Frame(time=6.0, counts=np.array([8, 9]), image=np.zeros((1, 2), dtype=np.uint8),
                  texel_area=2e-6, texel_forces=np.array([0.5, 0.25]), net_force=np.array([1.0, 2.0, 3.0]),
                  net_torque=np.array([4.0, 5.0, 6.0]), tangential=np.array([[7.0, 8.0], [9.0, 10.0]]),
                  tangential_source="by hand")  # fmt: skip
    with RecordingWriter(path, arrays=[PAD, SMALL], setup=SETUP, serial="S7", start=5 * SECOND) as writer:
        writer.add_raw(5 * SECOND + 1, b"\x01\xfe")
        writer.add_gap(5 * SECOND + 2, "two frames")
        writer.add_temperatures(5 * SECOND + 3, [20.5, -3.25])
        writer.add_force(5 * SECOND + 4, -1.75)
        counts = np.array([-7, 0, 1, 300, 4, 65528])
        writer.add_frame(0, Clocks(6 * SECOND + 5, 11, 12, arrival=6 * SECOND + 9), counts)
        writer.add_simulated_frame(1, Clocks(7 * SECOND + 6, 13, 14), frame)
        writer.add_frame(0, Clocks(8 * SECOND, 15, 16), counts)
        assert writer.frames == 2
    return take_apart(path.read_bytes())


EXPECTED = {
    "/raw": [(0, 5 * SECOND + 1, 5 * SECOND + 1, encode_cdr(("I", 0), ("I", 0), ("B*", b"\x01\xfe")))],
    "/diagnostics": [(0, 5 * SECOND + 2, 5 * SECOND + 2, encode_cdr(
        *encode_header(5, 2, "gap"), ("I", 1), ("B", 1), ("s", "gap"), ("s", "two frames"), ("s", ""), ("I", 0)))],
    "/temperatures": [(0, 5 * SECOND + 3, 5 * SECOND + 3, encode_cdr(*numbers("", (), [20.5, -3.25])))],
    "/force": [(0, 5 * SECOND + 4, 5 * SECOND + 4, encode_cdr(
        *encode_header(5, 4, "force_sensor"), *[("d", each) for each in (0, 0, -1.75, 0, 0, 0)]))],
    "/tactile_0/image": [
        (number, logged, published, encode_cdr(
            *encode_header(published // SECOND, published % SECOND, "tactile_0"), ("I", 2), ("I", 3), ("s", "mono16"),
            ("B", 0), ("I", 6), ("B*", np.array([0, 0, 1, 300, 4, 65528], dtype="<u2").tobytes())))
        for number, logged, published in ((0, 6 * SECOND + 9, 6 * SECOND + 5), (1, 8 * SECOND, 8 * SECOND))
    ],
    "/tactile_0/frame": [
        (number, logged, published, encode_cdr(
            *encode_header(published // SECOND, published % SECOND, "tactile_0"), ("Q", 11 + 4 * number),
            ("I", 12 + 4 * number), ("H*", [0, 7, 8, 307, 11, 65535]), ("d*", [])))
        for number, logged, published in ((0, 6 * SECOND + 9, 6 * SECOND + 5), (1, 8 * SECOND, 8 * SECOND))
    ],
    "/tactile_1/frame": [(0, 7 * SECOND + 6, 7 * SECOND + 6, encode_cdr(
        *encode_header(7, 6, "tactile_1"), ("Q", 13), ("I", 14), ("H*", [8, 9]), ("d*", [0.5, 0.25])))],
    "/tactile_1/pressures": [(0, 7 * SECOND + 6, 7 * SECOND + 6, encode_cdr(
        *numbers("pressure [Pa]", (2,), [0.25e6, 0.125e6])))],
    "/tactile_1/wrench": [(0, 7 * SECOND + 6, 7 * SECOND + 6, encode_cdr(
        *encode_header(7, 6, "tactile_1"), *[("d", each) for each in (1, 2, 3, 4, 5, 6)]))],
    "/tactile_1/tangential": [(0, 7 * SECOND + 6, 7 * SECOND + 6, encode_cdr(
        *numbers("tangential force x, y [N]: by hand", (2, 2), [7, 8, 9, 10])))],
}  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write(tmp_path_factory.mktemp("bytes") / "a.mcap")


@pytest.mark.parametrize("topic", EXPECTED)
def test_messages_hold_these_bytes_and_times(written, topic):
    assert [each[1:] for each in written.messages if each[0] == topic] == EXPECTED[topic]


def test_labels_are_a_message_and_the_metadata(written):
    topic, sequence, logged, published, data = written.messages[0]
    assert (topic, sequence, logged, published) == ("/setup", 0, 5 * SECOND, 5 * SECOND)
    text = written.metadata["softcover"]["labels"]
    assert data == encode_cdr(("s", text))
    labels = json.loads(text)
    labels["clock"]["monotonic_ns"] = 0
    assert labels == LABELS
    assert "\n" not in text


def test_topics_have_public_types_with_their_definitions(written):
    assert written.header == ("ros2", "softcover")
    types = {topic: kind for topic, encoding, kind in written.channels.values() if encoding == "cdr"}
    assert types == {
        "/setup": "std_msgs/msg/String", "/raw": "std_msgs/msg/UInt8MultiArray",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray", "/temperatures": "std_msgs/msg/Float64MultiArray",
        "/force": "geometry_msgs/msg/WrenchStamped",
        **{f"/tactile_{number}/image": "sensor_msgs/msg/Image" for number in (0, 1)},
        **{f"/tactile_{number}/frame": "softcover_msgs/msg/TactileFrame" for number in (0, 1)},
        "/tactile_1/pressures": "std_msgs/msg/Float64MultiArray",
        "/tactile_1/wrench": "geometry_msgs/msg/WrenchStamped",
        "/tactile_1/tangential": "std_msgs/msg/Float64MultiArray",
    }  # fmt: skip
    assert {encoding for _, encoding, _ in written.schemas.values()} == {"ros2msg"}
    texts = {name: text for name, _, text in written.schemas.values()}
    assert len(texts) == len(written.schemas)  # each type is defined once
    for line in ("uint64 host_monotonic", "uint32 device_ticks", "uint16[] counts", "float64[] texel_forces"):
        assert line in texts["softcover_msgs/msg/TactileFrame"]


def test_a_recorder_without_a_start_begins_now_and_leaves_empty_labels_out(tmp_path):
    before, monotonic = time.time_ns(), time.monotonic_ns()
    with RecordingWriter(str(tmp_path / "a.mcap"), arrays=[SMALL], setup=Setup()):
        pass
    labels = json.loads(take_apart((tmp_path / "a.mcap").read_bytes()).metadata["softcover"]["labels"])
    assert before <= labels["clock"]["start_ns"] <= time.time_ns()
    assert monotonic <= labels["clock"]["monotonic_ns"] <= time.monotonic_ns()
    assert (labels["serial"], labels["setup"]["load"], "other" in labels["setup"]) == ("", None, False)


@pytest.mark.parametrize(
    ("offset", "counts", "limits"),
    [(7, [-7, 65528], None), (7, [-8, 0], r"-7\.\.65528, not -8\.\.0"), (7, [5, 65529], r"not 5\.\.65529"),
     (0, [0, 65535], None), (0, [-1, 3], r"0\.\.65535, not -1\.\.3"), (0, [2, 65536], r"not 2\.\.65536")],
)  # fmt: skip
def test_counts_fit_16_bits_with_their_offset(tmp_path, offset, counts, limits):
    with RecordingWriter(tmp_path / "a.mcap", arrays=[replace(SMALL, offset=offset)], setup=Setup()) as writer:
        if limits is None:
            writer.add_frame(0, Clocks(SECOND), np.array(counts))
        else:
            with pytest.raises(ValueError, match=limits):
                writer.add_frame(0, Clocks(SECOND), np.array(counts))
        assert writer.frames == (limits is None)


def test_what_came_is_written_to_the_file_before_it_is_closed(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap", arrays=[SMALL], setup=Setup()) as writer:
        size = (tmp_path / "a.mcap").stat().st_size
        writer.add_force(SECOND, 2.0)
        deadline = time.monotonic() + 20
        while (tmp_path / "a.mcap").stat().st_size == size and time.monotonic() < deadline:
            time.sleep(0.01)
        assert (tmp_path / "a.mcap").stat().st_size > size


@pytest.mark.parametrize("own", [True, False])
def test_an_error_of_the_block_comes_before_one_of_the_disk(tmp_path, monkeypatch, own):
    def fail(*_):
        raise OSError(5, "broken")

    def run():
        with RecordingWriter(tmp_path / "a.mcap", arrays=[SMALL], setup=Setup()):
            monkeypatch.setattr(os, "write", fail)
            if own:
                raise KeyError("mine")

    with pytest.raises(KeyError if own else StorageError) as caught:
        run()
    said = "a.mcap: the disk takes no more (broken); the file holds all but the last 0.4 s"
    assert ("mine" if own else said) in str(caught.value)


def test_nothing_is_written_after_a_failure_or_the_end(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "full")

    writer = RecordingWriter(tmp_path / "a.mcap", arrays=[SMALL], setup=Setup())
    monkeypatch.setattr(os, "write", fail)
    writer.add_force(SECOND, 2.0)
    with pytest.raises(StorageError, match="full"):
        writer.close()
    for _ in range(2):
        with pytest.raises(StorageError, match="full"):
            writer.add_force(SECOND, 2.0)
    writer.close()


def test_a_file_describes_its_topics_before_they_are_used(tmp_path):
    with RecordingWriter(tmp_path / "a.mcap", arrays=[SMALL], setup=Setup()):
        pass
    found = take_apart((tmp_path / "a.mcap").read_bytes())
    assert [topic for topic, _, _ in found.channels.values()] == [
        "/setup", "/raw", "/diagnostics", "/temperatures", "/force", "/tactile/image", "/tactile/frame",
    ]  # fmt: skip
    assert [each[0] for each in found.messages] == ["/setup"]


@pytest.mark.parametrize(
    ("forces", "ends"),
    [
        ({}, []),
        ({"net_force": np.ones(3)}, []),
        ({"net_torque": np.ones(3)}, []),
        ({"net_force": np.ones(3), "net_torque": np.ones(3)}, ["wrench"]),
        ({"texel_forces": np.ones(2)}, ["pressures"]),
        ({"tangential": np.ones((2, 2))}, ["tangential"]),
    ],
)
def test_a_simulated_frame_is_written_with_what_it_has(tmp_path, forces, ends):
    frame = Frame(time=0.0, counts=np.array([8, 9]), image=np.zeros((1, 2), dtype=np.uint8), texel_area=2e-6, **forces)
    with RecordingWriter(tmp_path / "a.mcap", arrays=[SMALL], setup=Setup()) as writer:
        writer.add_simulated_frame(0, Clocks(SECOND), frame)
    found = [each[0] for each in take_apart((tmp_path / "a.mcap").read_bytes()).messages]
    assert found == ["/setup", "/tactile/image", "/tactile/frame", *(f"/tactile/{end}" for end in ends)]
