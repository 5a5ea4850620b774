"""Recordings of strangers: limits before memory is claimed, and one line about every fault."""

import json
import os
import tracemalloc
import zlib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Chunk
from mcap.stream_reader import lz4, zstandard
from mcap.writer import CompressionType, Writer

from tests.support.bounded import bounded
from tests.support.ros_bags import write_bag
from validation.recordings import recording
from validation.recordings.importing import open_recording, save
from validation.recordings.mcap_reader import MOST_CHUNK_BYTES, unpack_records
from validation.recordings.mcap_writer import (
    FORCE_TOPIC,
    FRAME,
    GAP_TOPIC,
    KINDS,
    SETUP_TOPIC,
    TEMPERATURE_TOPIC,
    encode,
    encode_labels,
    load_types,
)
from validation.recordings.recording import Budget, Recording, RecordingError, make_array

TEXT = KINDS[SETUP_TOPIC]
DEFINITION = load_types().generate_msgdef(TEXT, ros_version=2)[0].encode()


def encode_text(text):
    return encode(TEXT, data=text)


def simple_recording(frames=1):
    """A recording of 3 x 2 texels."""
    counts = np.arange(6 * frames, dtype=np.int32).reshape(frames, 6)
    times, started = np.arange(frames) * 1e-3, datetime(2020, 1, 1, tzinfo=UTC)
    return Recording(path=Path("x"), sha256="", started=started, times=times, arrays=(make_array(3, 2, counts),))


BUDGET = Budget(Path("x"), 2**32)
HEAD = "# rows = 1\n# columns = 2\n"


def refuse(path, message, **options):
    with bounded(400, memory=200e6), pytest.raises(RecordingError, match=message) as caught:
        open_recording(path, **options)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEAD}time,a,b\n0,1,2147483648\n", "2147483648 exceeds the full scale of 4095"),
        (f"{HEAD}time,a,b\n0,1,1e300\n", "exceeds the full scale"),
        (f"{HEAD}# full_scale = 1e300\ntime,a,b\n0,1,1\n", "full_scale = 1e300: expected a whole number"),
        (f"{HEAD}# pitch = 1e300\ntime,a,b\n0,1,1\n", "pitch"),
        ("# rows = 1e300\ntime,a,b\n0,1,1\n", "rows = 1e300"),
        (f"{HEAD}time,a,b\n1e300,1,1\n", "must lie within"),
        (f"{HEAD}time,a,b\nnan,1,1\n", "finite"),
        (f"{HEAD}time,a,b\n0,1,{'9' * 300_000}\n", "characters accepted in a line"),
        (f'{HEAD}time,a,b\n0,1,"{"x" * 140_000}"\n', "field larger than field limit"),
        (f"{HEAD}time,a,b\n0,1,{'x' * 100_000}\n", "not a number"),
        ("time," + ",".join(f"t{k}" for k in range(10_001)) + "\n0" + ",1" * 10_001 + "\n", "10001 texels"),
        (f"{HEAD}time,a,b\n" + '"' * 100_000 + "\n", "columns; expected 3|not a number|expected numbers"),
        ("x" * 2**19, "characters accepted in a line"),
        ("\0", "1 columns between commas"),
    ],
    ids=lambda text: text[-30:],
)
def test_hostile_csv_files_are_refused_at_once(tmp_path, text, message):
    path = tmp_path / "a.csv"
    path.write_text(text)
    refuse(path, message)


def test_a_csv_file_of_too_many_numbers_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("validation.recordings.tables.MOST_VALUES", 300)
    (tmp_path / "a.csv").write_text(f"{HEAD}time,a,b\n" + "".join(f"{k},1,1\n" for k in range(101)))
    refuse(tmp_path / "a.csv", "more than the 300 numbers accepted")


@pytest.mark.parametrize("name", ["a.csv", "a.mcap", "a.dsa", "a.bag", "a.db3"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    refuse(tmp_path / name, "is no regular file|no such file")


def write_mcap(path, messages, *, times=None, **options):
    """Write an MCAP file with messages on topics: (topic, bytes)."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema(TEXT, "ros2msg", DEFINITION)
        channels = {topic: writer.register_channel(topic, "cdr", schema) for topic, _ in messages}
        for (topic, data), time in zip(messages, times or range(len(messages)), strict=True):
            writer.add_message(channels[topic], log_time=time, data=data, publish_time=0, sequence=0)
        writer.finish()


def good_labels(**changes):
    """The labels of a small recording as a JSON object, with changes."""
    recording = simple_recording()
    return {**json.loads(encode_labels(recording.setup, recording.arrays)), **changes}


def change_array(**changes):
    return good_labels(arrays=[{**good_labels()["arrays"][0], **changes}])


BAD_LABELS = {
    "deep": "[" * 100_000,
    "40 000 arrays": '{"format": "softcover-recording/1", "arrays": [' + "[]," * 40_000 + "[]]}",
    "many arrays": good_labels(arrays=[good_labels()["arrays"][0]] * 65),
    "no object": "[1]",
    "a long number": '{"format": ' + "9" * 5000 + "}",
    "array no object": good_labels(arrays=[1]),
    "rows of a text": change_array(rows="3"),
    "many rows": change_array(rows=100_000, columns=100_000),
    "a wrong mask": change_array(enabled="1"),
    "a mask of a number": change_array(active=7),
    "pitch of a text": change_array(pitch_m="ab"),
    "infinite pitch": change_array(pitch_m=[1e300, 1e300]),
    "name of a list": change_array(name=[1]),
    "full scale": change_array(full_scale=2**40),
    "full scale of 0": change_array(full_scale=0),
    "load of a text": good_labels(setup={"load": "x"}),
    "load of a list": good_labels(setup={"load": [1]}),
    "note of a list": good_labels(setup={"note": [1]}),
    "device of a text": good_labels(setup={"device": "x"}),
    "unknown key": good_labels(setup={"x": 1}),
    "late": good_labels(clock={"start_ns": 2**63, "monotonic_ns": 0}),
    "time of a text": good_labels(clock={"start_ns": "1", "monotonic_ns": 0}),
    "negative time": good_labels(clock={"start_ns": -1, "monotonic_ns": 0}),
}


@pytest.mark.parametrize("case", BAD_LABELS)
def test_labels_of_wrong_type_or_size_are_refused(tmp_path, case):
    given = BAD_LABELS[case]
    text = given if isinstance(given, str) else json.dumps(given)
    write_mcap(tmp_path / "a.mcap", [(SETUP_TOPIC, encode_text(text))])
    refuse(tmp_path / "a.mcap", "labels")


@pytest.mark.parametrize("topic", ["/tactile_0/frame", GAP_TOPIC, TEMPERATURE_TOPIC, FORCE_TOPIC, "/tactile_0/wrench"])
@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 40], ids=["empty", "short", "claims"])
def test_truncated_messages_are_told_in_a_line(tmp_path, topic, data):
    messages = [(SETUP_TOPIC, encode_text(json.dumps(good_labels()))), (topic, data)]
    write_mcap(tmp_path / "a.mcap", messages)
    refuse(tmp_path / "a.mcap", "damaged")


def chunk(data, *, size, crc=0, **options):
    return Chunk(
        data=data, uncompressed_size=size, uncompressed_crc=crc, message_start_time=0, message_end_time=0, **options
    )


BOMB = bytes(2**28)
BOMBS = {
    "zstd": lambda: zstandard.compress(BOMB),
    "lz4": lambda: lz4.compress(BOMB),
}


@pytest.mark.parametrize("compression", BOMBS)
@pytest.mark.parametrize("stated", [2**31, 2**28, 1000])
def test_a_chunk_never_unpacks_to_more_than_it_states_or_is_accepted(compression, stated):
    packed = BOMBS[compression]()
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match="a chunk"):
            list(unpack_records(chunk(packed, size=stated, compression=compression), BUDGET))
        assert tracemalloc.get_traced_memory()[1] < MOST_CHUNK_BYTES + 2**20
    finally:
        tracemalloc.stop()


RECORD = b"\x99" + (3).to_bytes(8, "little") + b"abc"


@pytest.mark.parametrize(
    ("data", "options", "message"),
    [
        (RECORD[:-1], {"size": 11, "compression": ""}, "middle of a record"),
        (b"\x05", {"size": 1, "compression": ""}, "middle of a record"),
        (RECORD, {"size": 12, "compression": "", "crc": zlib.crc32(RECORD) ^ 1}, "checksum"),
        (RECORD, {"size": 13, "compression": ""}, "does not unpack to the 13 bytes"),
        (RECORD, {"size": 12, "compression": "bz2"}, "unknown compression"),
    ],
)
def test_damaged_chunks_are_refused(data, options, message):
    with pytest.raises(RecordingError, match=message):
        list(unpack_records(chunk(data, **options), BUDGET))
    assert list(unpack_records(chunk(RECORD, size=12, compression="", crc=zlib.crc32(RECORD)), BUDGET)) == []


@pytest.mark.slow
def test_a_small_file_with_a_large_chunk_is_refused(tmp_path):
    """A chunk of 256 MiB in a file of some kilobytes, as a message of zeros makes it."""
    setup = encode_text(json.dumps(good_labels()))
    write_mcap(tmp_path / "a.mcap", [(SETUP_TOPIC, setup), ("/x", BOMB)], chunk_size=2**40)
    assert (tmp_path / "a.mcap").stat().st_size < 100_000
    refuse(tmp_path / "a.mcap", "a chunk of 256 MiB; at most 64 MiB")


def test_more_messages_than_a_file_of_its_size_can_hold_are_refused(tmp_path, monkeypatch):
    save(simple_recording(frames=100), tmp_path / "a.mcap")
    bag = write_bag(tmp_path / "a.bag", {"/pad": "wts_driver/msg/Frame"}, first=True)
    monkeypatch.setattr(recording, "LIMITS", recording.Limits(kept=1000, ratio=0))
    for path in (tmp_path / "a.mcap", bag):
        refuse(path, "far more messages than a recording of its size")


def test_a_frame_of_another_size_is_refused(tmp_path):
    recording = simple_recording(frames=3)
    save(recording, tmp_path / "a.mcap")
    back = open_recording(tmp_path / "a.mcap")
    assert np.array_equal(back.arrays[0].counts, recording.arrays[0].counts)
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "x"}
    values = {"counts": np.zeros(5, dtype=np.uint16), "texel_forces": np.zeros(0)}
    short = encode(FRAME, header=header, host_monotonic=0, device_ticks=0, **values)
    messages = [(SETUP_TOPIC, encode_text(json.dumps(good_labels()))), ("/tactile/frame", short)]
    write_mcap(tmp_path / "b.mcap", messages)
    refuse(tmp_path / "b.mcap", "a frame has other texels")


@pytest.mark.parametrize("topic", [SETUP_TOPIC, FORCE_TOPIC, TEMPERATURE_TOPIC])
def test_a_time_beyond_64_bits_is_refused(tmp_path, topic):
    data = encode_text(json.dumps(good_labels()))
    write_mcap(tmp_path / "a.mcap", [(SETUP_TOPIC, data), (topic, data)], times=(0, 2**64 - 1))
    refuse(tmp_path / "a.mcap", "no possible time")


@pytest.mark.parametrize("chunks", [1, 5])
def test_many_records_in_a_small_file_are_refused_in_total(tmp_path, chunks, monkeypatch):
    """Chunks of empty records: each keeps the limits of a chunk, all of them together exceed those of the file."""
    monkeypatch.setattr(recording, "LIMITS", recording.Limits(records=2**12))
    data = b"\x99" + bytes(8)
    with (tmp_path / "a.mcap").open("wb") as file:
        file.write(b"\x89MCAP0\r\n\x01" + (8).to_bytes(8, "little") + bytes(8))
        for _ in range(chunks):
            count = 2**13 // chunks
            packed = zstandard.compress(data * count)
            content = (
                bytes(16)
                + (len(data) * count).to_bytes(8, "little")
                + bytes(4)
                + (4).to_bytes(4, "little")
                + b"zstd"
                + len(packed).to_bytes(8, "little")
                + packed
            )
            file.write(b"\x06" + len(content).to_bytes(8, "little") + content)
    assert (tmp_path / "a.mcap").stat().st_size < 2000
    refuse(tmp_path / "a.mcap", "far more messages than a recording of its size")
