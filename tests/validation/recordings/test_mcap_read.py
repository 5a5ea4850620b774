"""MCAP recordings written byte by byte: every field that is read, files that end early, and damage by its name."""

import hashlib
import json
import zlib

import numpy as np
import pytest

from tests.support.mcap_bytes import (
    MAGIC,
    encode_cdr,
    encode_channel,
    encode_chunk,
    encode_file,
    encode_header,
    encode_message,
    encode_record,
    encode_schema,
    take_apart,
)
from validation.recordings import RecordingError
from validation.recordings.mcap_reader import is_complete, is_own_recording, read, recover
from validation.recordings.mcap_writer import encode_labels
from validation.recordings.recording import Setup, make_array

SECOND = 10**9
TYPES = ["std_msgs/msg/String", "softcover_msgs/msg/TactileFrame", "std_msgs/msg/Float64MultiArray",
         "geometry_msgs/msg/WrenchStamped", "diagnostic_msgs/msg/DiagnosticArray", "sensor_msgs/msg/Image",
         "std_msgs/msg/UInt8MultiArray"]  # fmt: skip
TOPICS = {
    "/setup": 0, "/tactile_0/frame": 1, "/tactile_1/frame": 1, "/temperatures": 2, "/force": 3, "/diagnostics": 4,
    "/tactile_1/pressures": 2, "/tactile_1/wrench": 3, "/tactile_1/tangential": 2, "/tactile/frame": 1,
    "/tactile_0/image": 5, "/raw": 6, "/else": 0,
}  # fmt: skip
HEAD = [encode_schema(number + 1, name) for number, name in enumerate(TYPES)]
HEAD += [encode_channel(10 + number, TOPICS[topic] + 1, topic) for number, topic in enumerate(TOPICS)]
ARRAYS = (make_array(1, 2, full_scale=900), make_array(2, 1, full_scale=70, name="right"))


def send(topic, data, *, number=0, logged=5 * SECOND, published=None):
    published = logged if published is None else published
    return encode_message(10 + list(TOPICS).index(topic), number, logged, published, data)


def label(arrays=ARRAYS):
    text = encode_labels(Setup(load=2.5), arrays, serial="S9", start=4 * SECOND, monotonic=3)
    return send("/setup", encode_cdr(("s", text)), logged=4 * SECOND)


def frame(array, number, counts, *, at, forces=(), monotonic=0, ticks=0):
    """A frame taken at a time [s] that arrived half a second later."""
    topic = "/tactile/frame" if array is None else f"/tactile_{array}/frame"
    data = encode_cdr(*encode_header(99, 99, "x"), ("Q", monotonic), ("I", ticks), ("H*", counts), ("d*", forces))
    taken = round(at * SECOND)
    return send(topic, data, number=number, logged=taken + SECOND // 2, published=taken)


def numbers(topic, values, *, number=0, text=None, at=5.0):
    sides = () if text is None else (("s", text), ("I", 2), ("I", 1))
    return send(topic, encode_cdr(("I", len(sides) // 3), *sides, ("I", 0), ("d*", values)), number=number,
                logged=round(at * SECOND))  # fmt: skip


def wrench(topic, values, *, number=0, at=5.0):
    data = encode_cdr(*encode_header(99, 99, "x"), *[("d", each) for each in values])
    return send(topic, data, number=number, logged=round(at * SECOND))


GAP = encode_cdr(*encode_header(0, 0, ""), ("I", 2), *[
    part for text in ("first", "second") for part in (("B", 1), ("s", "gap"), ("s", text), ("s", ""), ("I", 0))
])  # fmt: skip
MESSAGES = [
    label(),
    numbers("/temperatures", [20.5, 30.25], at=5.5),
    frame(0, 0, [1, 900], at=6.5, monotonic=11, ticks=21),
    frame(1, 0, [3, 4], at=6.625, forces=[0.5, 0.25]),
    numbers("/tactile_1/pressures", [7.0, 8.0]),
    wrench("/tactile_1/wrench", [1, 2, 3, 4, 5, 6]),
    numbers("/tactile_1/tangential", [9.0, 10.0, 11.0, 12.0], text="tangential force x, y [N]: old"),
    frame(0, 1, [5, 6], at=8.75, monotonic=12, ticks=22),
    frame(1, 1, [7, 8], at=8.75),
    wrench("/tactile_1/wrench", [10, 20, 30, 40, 50, 60], number=1),
    numbers("/tactile_1/tangential", [1.0, 2.0, 3.0, 4.0], number=1, text="tangential force x, y [N]: by hand"),
    frame(0, 2, [70, 80], at=9.0, monotonic=13, ticks=23),  # the recorder ended before the other array
    numbers("/tactile_1/pressures", [70.0, 80.0], number=2),
    numbers("/temperatures", [21.5, 31.25], at=7.0),
    wrench("/force", [1, 2, -3.5, 4, 5, 6], at=6.0),
    wrench("/force", [1, 2, 4.5, 4, 5, 6], at=9.0),
    send("/diagnostics", GAP),
    send("/tactile_0/image", b"not read"),
    send("/raw", b"not read"),
    send("/else", b"not read"),
]


def check(found, path):
    first, second = found.arrays
    assert first.counts.tolist() == [[1, 900], [5, 6]]
    assert second.counts.tolist() == [[3, 4], [7, 8]]
    assert (first.simulated, first.full_scale, second.full_scale, second.texels.name) == (None, 900, 70, "right")
    assert (found.started.timestamp(), found.times.tolist()) == (6.5, [0, 2.25])
    assert (found.host_monotonic.tolist(), found.ticks.tolist()) == ([11, 12], [21, 22])
    assert (found.temperatures.tolist(), found.temperature_times.tolist()) == (
        [[20.5, 30.25], [21.5, 31.25]],
        [-1, 0.5],
    )
    assert (found.forces.tolist(), found.force_times.tolist()) == ([-3.5, 4.5], [-0.5, 2.5])
    assert (found.gaps, found.serial, found.setup.load) == (("first", "second"), "S9", 2.5)
    assert (found.path, found.sha256) == (path, hashlib.sha256(path.read_bytes()).hexdigest())
    forces = second.simulated
    assert np.array_equal(forces.texel_forces, [[0.5, 0.25], [np.nan] * 2], equal_nan=True)
    assert np.array_equal(forces.pressures, [[7, 8], [np.nan] * 2], equal_nan=True)
    assert (forces.net_force.tolist(), forces.net_torque.tolist()) == (
        [[1, 2, 3], [10, 20, 30]], [[4, 5, 6], [40, 50, 60]],
    )  # fmt: skip
    assert forces.tangential.tolist() == [[[9, 10], [11, 12]], [[1, 2], [3, 4]]]
    assert forces.tangential_source == "by hand"


@pytest.mark.parametrize("packed", [None, "", "zstd"])
def test_every_field_of_a_file_is_read(tmp_path, packed):
    records = b"".join(HEAD + MESSAGES)
    if packed is not None:
        half = len(b"".join(HEAD + MESSAGES[:9]))
        records = b"".join(
            encode_chunk(part, compression=packed, crc=zlib.crc32(part)) for part in (records[:half], records[half:])
        )
    path = tmp_path / "a.mcap"
    path.write_bytes(encode_file(records))
    found = read(str(path))
    check(found, path)
    assert (found.complete, is_complete(path), is_own_recording(path)) == (True, True, True)
    assert not recover(path)
    assert path.read_bytes() == encode_file(records)


@pytest.mark.parametrize("tail", [b"", b"\x05", b"\x05" + bytes([255, 0, 0, 0, 0, 0, 0, 0]), b"\x02" + bytes(8)])
def test_a_file_without_an_end_is_read_and_completed(tmp_path, tail):
    """It ends after a record, within the head of one, within its content, or with a footer but no last bytes."""
    path = tmp_path / "a.mcap"
    path.write_bytes(encode_file(*HEAD, *MESSAGES, complete=False) + tail)
    before = path.read_bytes()
    found = read(path)
    check(found, path)
    assert (found.complete, is_complete(path), is_own_recording(path)) == (False, False, True)
    assert recover(path)
    check(read(path), path)
    assert (read(path).complete, recover(path)) == (True, False)
    kept = take_apart(path.read_bytes())
    assert kept.header == ("ros2", "softcover")
    assert {topic: kind for topic, _, kind in kept.channels.values()} == {
        topic: TYPES[number] for topic, number in TOPICS.items()
    }
    assert {encoding for _, encoding, _ in kept.channels.values()} == {"cdr"}
    assert {each[1:] for each in kept.schemas.values()} == {("ros2msg", "string data")}
    assert kept.messages == take_apart(before[: len(before) - len(tail)] + MAGIC).messages


def test_metadata_are_kept_in_a_completed_file(tmp_path):
    path = tmp_path / "a.mcap"
    pair = b"\3\0\0\0key\5\0\0\0value"
    meta = encode_record(12, b"\4\0\0\0name" + len(pair).to_bytes(4, "little") + pair)
    path.write_bytes(encode_file(meta, *HEAD, *MESSAGES, complete=False))
    assert recover(path)
    assert take_apart(path.read_bytes()).metadata == {"name": {"key": "value"}}


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        (MESSAGES[1:], "an MCAP file without the labels of a softcover recording"),
        ([label(), frame(0, 1, [1, 2], at=5)], "damaged: frame 1 of /tactile_0/frame follows frame -1"),
        ([label(), *[frame(0, number, [1, 2], at=5) for number in (0, 1, 1)]], "frame 1 of /tactile_0/frame follows"),
        ([label(), frame(0, 0, [1], at=5), frame(1, 0, [1, 2], at=5)], "a frame has other texels than tactile"),
        ([label(), frame(0, 0, [1, 2], at=5), frame(1, 0, [1, 2, 3], at=5)], "a frame has other texels than right"),
        ([label(), numbers("/temperatures", [1.0]), numbers("/temperatures", [1.0, 2.0])],
         "the number of temperatures changes"),
        ([label(), numbers("/tactile_1/pressures", [1.0])], "/tactile_1/pressures has 1 values, not 2"),
        ([label(), numbers("/tactile_1/tangential", [1.0] * 3)], "/tactile_1/tangential has 3 values, not 4"),
        ([label(), frame(1, 0, [1, 2], at=5, forces=[1.0])], "/tactile_1/frame has 1 values, not 2"),
        ([label(), send("/force", b"\0\1\0\0\1")], "damaged: a message of /force cannot be read"),
        ([label(), encode_message(77, 0, 0, 0, b"")], "damaged: a message of an unknown channel"),
        ([label(), send("/else", b"", logged=2**63)], "a message of /else has no possible time"),
        ([label(), send("/else", b"", published=2**63)], "a message of /else has no possible time"),
    ],
)  # fmt: skip
def test_damage_is_named_with_file_and_topic(tmp_path, messages, words):
    path = tmp_path / "a.mcap"
    path.write_bytes(encode_file(*HEAD, *messages))
    with pytest.raises(RecordingError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89MCAP0\r", "not an MCAP file; expected one that"),
        (b"\x89MCAP1\r\n", "not an MCAP file"),
        (b"", "not an MCAP file"),
        (encode_file(encode_chunk(HEAD[0], crc=zlib.crc32(HEAD[0]) ^ 1)), "damaged near byte 145: a chunk fails"),
        (encode_file(encode_chunk(HEAD[0], size=3)), "near byte 145: a chunk does not unpack to the 3 bytes"),
        (encode_file(encode_chunk(HEAD[0][:-1])), "a chunk ends in the middle of a record"),
        (encode_file(encode_record(3, b"\1")), "damaged near byte"),
        (encode_file(encode_record(5, b"\1")), "a message of an unknown channel"),
        (encode_file(encode_chunk(HEAD[0], compression="none")), "a chunk of unknown compression; accepted: none"),
        (encode_file(encode_chunk(b"", size=2**26 + 1)), "a chunk of 64 MiB; at most 64 MiB are accepted"),
    ],
    ids=range(10),
)  # fmt: skip
def test_bytes_that_are_no_records_are_refused_near_their_place(tmp_path, content, words):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=f"a.mcap: .*{words}"):
        read(path)


@pytest.mark.parametrize(
    ("records", "own"),
    [
        (HEAD, True),
        (HEAD[: len(TYPES)], False),
        ([encode_schema(1, TYPES[0]), encode_channel(1, 1, "/else"), encode_channel(2, 1, "/setup")], False),
        ([encode_schema(1, TYPES[0]), encode_channel(1, 1, "/setup", "json")], False),
        ([encode_chunk(HEAD[0] + HEAD[len(TYPES)])], True),
    ],
)
def test_own_files_begin_with_the_topic_of_the_labels(tmp_path, records, own):
    (tmp_path / "a.mcap").write_bytes(encode_file(*records))
    assert is_own_recording(str(tmp_path / "a.mcap")) is own


def test_a_file_without_frames_starts_with_its_labels(tmp_path):
    path = tmp_path / "a.mcap"
    messages = [label(), wrench("/force", [0, 0, 2, 0, 0, 0], at=6.25), frame(0, 0, [1, 2], at=7)]
    path.write_bytes(encode_file(*HEAD, *messages))
    found = read(path)
    assert (found.started.timestamp(), found.force_times.tolist(), found.forces.tolist()) == (4.0, [2.25], [2.0])
    assert [each.counts.shape for each in found.arrays] == [(0, 2), (0, 2)]
    assert (len(found.times), found.temperatures.shape, found.gaps) == (0, (0, 0), ())


def test_the_last_labels_hold_and_the_offset_is_subtracted(tmp_path):
    path = tmp_path / "a.mcap"
    text = json.loads(encode_labels(Setup(note="last"), (make_array(1, 2),), serial="S2"))
    text["arrays"][0]["offset"] = 7
    last = send("/setup", encode_cdr(("s", json.dumps(text))))
    path.write_bytes(encode_file(*HEAD, label(), frame(None, 0, [3, 65535], at=5), last))
    found = read(path)
    assert found.arrays[0].counts.tolist() == [[-4, 65528]]
    assert (found.serial, found.setup.note, found.arrays[0].offset) == ("S2", "last", 7)


@pytest.mark.parametrize("end", ["pressures", "wrench", "tangential"])
def test_one_kind_of_force_is_enough_for_a_simulated_array(tmp_path, end):
    path = tmp_path / "a.mcap"
    topic = f"/tactile_1/{end}"
    sent = wrench(topic, range(6)) if end == "wrench" else numbers(topic, [1.0] * (4 if end == "tangential" else 2))
    path.write_bytes(encode_file(*HEAD, label(), frame(0, 0, [1, 2], at=5), frame(1, 0, [1, 2], at=5), sent))
    first, second = read(path).arrays
    assert first.simulated is None
    known = {name: not np.isnan(getattr(second.simulated, name)).any() for name in ("pressures", "tangential")}
    assert known == {"pressures": end == "pressures", "tangential": end == "tangential"}
    assert np.isnan(second.simulated.net_force).any() != (end == "wrench")
    assert second.simulated.tangential_source == ""
