"""Messages of the sensor, its driver and its emulation, byte by byte, with a value of its own in every field."""

import struct
import threading
import time
from random import Random

import numpy as np
import pytest
import serial

from validation.weiss import protocol, virtual
from validation.weiss.inquiry import UNCONFIRMED, inquire
from validation.weiss.protocol import Command, MatrixInfo, Message, Parser, Reading, Status, decode_frame, encode_frame
from validation.weiss.sensor import BUFFER_BYTES, Chunk, Link, NoAnswerError, PortError, Sensor, SensorError
from validation.weiss.virtual import FAULTS, Misbehaviour, VirtualSensor


def check(data):
    """The checksum, bit by bit: the table of the plain CRC, with the shift of the reflected one."""
    state = 0xFFFF
    for byte in data:
        entry = ((state ^ byte) & 0xFF) << 8
        for _ in range(8):
            entry = (entry << 1 ^ (0x1021 if entry & 0x8000 else 0)) & 0xFFFF
        state = entry ^ state >> 8
    return state


def send(identifier, payload=b""):
    head = b"\xaa\xaa\xaa" + struct.pack("<BH", identifier, len(payload)) + payload
    return head + struct.pack("<H", check(head))


#: Identifier of each command, and the status of each answer, as the manual lists them.
COMMANDS = {
    "LOOP": 0x06, "READ_SINGLE_FRAME": 0x20, "START_PERIODIC_FRAMES": 0x21, "STOP_PERIODIC_FRAMES": 0x22, "TARE": 0x23,
    "MATRIX_INFO": 0x30, "SET_MASK_WINDOW": 0x31, "SET_ADVANCED_MASK": 0x32, "GET_MASK": 0x33, "SET_THRESHOLD": 0x34,
    "GET_THRESHOLD": 0x35, "SET_GAIN": 0x36, "GET_GAIN": 0x37, "SENSOR_TYPE": 0x38, "TEMPERATURE": 0x46,
    "SYSTEM_INFO": 0x50, "SET_TAG": 0x51, "GET_TAG": 0x52,
}  # fmt: skip
STATUSES = [
    "success", "not available", "no sensor", "not initialized", "already running",
    "feature not supported", "inconsistent data", "timeout", "read error", "write error",
    "insufficient resources", "checksum error", "no parameter expected", "not enough parameters", "command unknown",
    "command format error", "access denied", "already open", "command failed", "command aborted",
    "invalid handle", "not found", "not open", "input output error", "invalid parameter",
    "index out of bounds", "command pending", "overrun", "range error", "axis blocked",
    "file exists",
]  # fmt: skip


def test_commands_and_statuses_have_the_numbers_of_the_manual():
    assert {each.name: each.value for each in Command} == COMMANDS
    assert [protocol.describe_status(number) for number in range(31)] == [
        f"{name} ({number})" for number, name in enumerate(STATUSES)
    ]
    assert protocol.describe_status(31) == "unknown status (31)"


@pytest.mark.parametrize(
    ("command", "asked", "request_bytes", "answered", "answer_bytes"),
    [
        ("START_PERIODIC_FRAMES", (1, 0x0203), "01 03 02", (), ""),
        ("READ_SINGLE_FRAME", (1,), "01", (b"\x09\x08",), "09 08"),
        ("TARE", (1,), "01", (), ""),
        ("SET_THRESHOLD", (0x0102,), "02 01", (), ""),
        ("GET_THRESHOLD", (), "", (0x0506,), "06 05"),
        ("SET_GAIN", (7,), "07", (), ""),
        ("GET_GAIN", (), "", (8,), "08"),
        ("TEMPERATURE", (), "", (-2,), "fe ff"),
        ("SYSTEM_INFO", (), "", (1, 2, 0x0304, 0x05060708), "01 02 04 03 08 07 06 05"),
        ("MATRIX_INFO", (), "", (1, 2, 3, 4, 0x0506), "01 00 02 00 03 00 04 00 06 05"),
        ("SET_TAG", (b"ab",), "61 62", (), ""),
        ("SENSOR_TYPE", (), "", (b"cd",), "63 64"),
    ],
)
def test_values_have_their_places_in_requests_and_answers(command, asked, request_bytes, answered, answer_bytes):
    command = Command[command]
    sent = bytes.fromhex(request_bytes)
    assert protocol.encode_request(command, *asked) == send(command, sent)
    assert protocol.decode_request(command, sent) == asked
    payload = b"\0\0" + bytes.fromhex(answer_bytes)
    assert protocol.encode_answer(command, Status.SUCCESS, *answered) == send(command, payload)
    assert protocol.decode_answer(command, payload) == (0, answered)
    assert protocol.encode_answer(command, Status.OVERRUN, *answered) == send(command, b"\x1b\0")
    assert protocol.decode_answer(command, b"\x1b\x01anything") == (0x011B, ())


def test_a_frame_is_ticks_flags_and_counts():
    head = bytes.fromhex("04 03 02 01")
    counts = [5, 5, 4095, 0, 0, 0] + [7] * 17
    raw = encode_frame(0x01020304, counts)
    assert raw == head + b"\0" + struct.pack("<23H", *counts)
    units = [2 << 12 | 5, 1 << 12 | 4095, 3 << 12, 15 << 12 | 7, 2 << 12 | 7]
    packed = encode_frame(0x01020304, counts, run_length=True)
    assert packed == head + b"\1" + struct.pack("<5H", *units)
    for data, run_length in ((raw, False), (packed, True)):
        found = decode_frame(data, texels=23, host_time=99)
        assert (found.counts.tolist(), found.counts.dtype) == (counts, np.uint16)
        assert (found.ticks, found.host_time, found.run_length) == (0x01020304, 99, run_length)
        assert found.time == pytest.approx(0x01020304 * 1e-3)
    assert encode_frame(2**32 + 5, []) == b"\5\0\0\0\0"
    assert encode_frame(5, [[1, 2], [3, 4]], run_length=True)[5:] == struct.pack(
        "<4H", *[1 << 12 | n for n in (1, 2, 3, 4)]
    )
    assert decode_frame(b"\5\0\0\0\0").counts.size == decode_frame(b"\5\0\0\0\1").counts.size == 0


def test_a_matrix_is_stated_in_hundredths_of_a_millimetre():
    matrix = MatrixInfo.from_values((6, 14, 340, 255, 900))
    assert matrix == MatrixInfo(columns=6, rows=14, cell_width=3.4e-3, cell_height=2.55e-3, full_scale=900)
    assert (matrix.texels, matrix.values) == (84, (6, 14, 340, 255, 900))


@pytest.mark.parametrize(
    ("texels", "size", "kept"),
    [(None, 2 + 5 + 1024, True), (None, 2 + 5 + 1025, False), (40, 2 + 5 + 80, True), (40, 2 + 5 + 81, False),
     (1, 2 + 64, True), (1, 2 + 65, False)],
)  # fmt: skip
def test_a_payload_is_as_large_as_a_frame_or_a_text(texels, size, kept):
    message = send(0x06, bytes(size))
    parser = Parser(texels=texels)
    assert parser.largest_payload == (size if kept else size - 1)
    assert parser.feed(message) == ([Message(6, bytes(size))] if kept else [])
    assert parser.bytes_seen == len(message)
    assert parser.bytes_skipped == (0 if kept else len(message))


@pytest.mark.parametrize(
    ("noise", "skipped"),
    [(b"", 0), (b"\x01\xaa", 2), (b"\xaa", 1), (send(6, b"x")[:-1] + b"\0", 9), (b"\xaa\xaa\x01", 3)],
)
def test_bytes_that_are_no_message_are_counted_before_the_next_one(noise, skipped):
    parser = Parser()
    first = parser.feed(noise + send(0x22, b"\0\0") + b"\x09\x08")
    assert [(each.identifier, each.payload, each.skipped) for each in first] == [(0x22, b"\0\0", skipped)]
    second = parser.feed(send(0x30))
    assert [(each.identifier, each.skipped) for each in second] == [(0x30, 2)]
    assert parser.bytes_skipped == skipped + 2
    assert parser.bytes_seen == len(noise) + 10 + 2 + 8


@pytest.mark.parametrize(
    ("identifier", "payload", "texels", "kept"),
    [
        (0x00, encode_frame(1, [1, 2]), None, True),
        (0x00, encode_frame(1, [1, 2]), 2, True),
        (0x00, encode_frame(1, [1, 2]), 3, False),
        (0x00, encode_frame(1, [1, 2])[:-1], None, False),
        (0x20, b"\0\0" + encode_frame(1, [1, 2]), 2, True),
        (0x20, b"\0\0" + encode_frame(1, [1, 2]), 3, False),
        (0x20, b"\2\0", 2, True),
        (0x20, b"\2\0 no frame", 2, True),
        (0x21, b"\0\0 no frame", 2, True),
    ],
)
def test_frames_with_an_impossible_content_are_refused(identifier, payload, texels, kept):
    found = Parser(texels=texels).feed(send(identifier, payload) + send(0x22, b"\0\0"))
    assert [each.identifier for each in found] == [*([identifier] if kept else []), 0x22]


class Port:
    """A serial port whose device answers with given payloads by the identifier of the request."""

    def __init__(self, answers, events=b""):
        self.answers, self.events, self.sent, self.waiting = answers, events, [], bytearray()
        self.changed = threading.Condition()
        self.is_open, self.resets, self.is_stored = True, 0, True

    def reset_input_buffer(self):
        self.waiting.clear()
        self.resets += 1

    def write(self, data):
        (request,) = Parser().feed(bytes(data))
        self.sent.append(bytes(data))
        answer = self.answers.get(request.identifier)
        if answer is not None:
            self.give(answer(request.payload) if callable(answer) else answer)

    def give(self, data):
        """Wait until the bytes are stored: a read that finds none of them begins after the others were stored."""
        with self.changed:
            self.waiting += data
            self.is_stored = False
            self.changed.notify_all()
            assert self.changed.wait_for(lambda: self.is_stored, 10.0)

    @property
    def in_waiting(self):
        return len(self.waiting)

    def read(self, size):
        with self.changed:
            if not self.waiting:
                self.is_stored = True
                self.changed.notify_all()
            self.changed.wait_for(lambda: self.waiting, 0.005)
            data = bytes(self.waiting[:size])
            del self.waiting[:size]
        return data

    def close(self):
        self.is_open = False


def answer(identifier, payload=b"", status=0):
    return send(identifier, struct.pack("<H", status) + payload)


ANSWERS = {
    0x22: answer(0x22), 0x50: answer(0x50, struct.pack("<BBHI", 1, 3, 0x4567, 89)),
    0x30: answer(0x30, struct.pack("<5H", 3, 2, 340, 255, 900)), 0x33: answer(0x33, b"\x2d"),
    0x38: answer(0x38, b"WTS \xff"), 0x52: answer(0x52, b"palm"), 0x46: answer(0x46, struct.pack("<h", -125)),
    0x35: answer(0x35, struct.pack("<H", 300)), 0x37: answer(0x37, b"\xc8"), 0x23: answer(0x23), 0x34: answer(0x34),
    0x36: answer(0x36), 0x51: answer(0x51), 0x06: lambda sent: answer(0x06, sent), 0x21: answer(0x21),
    0x20: answer(0x20, encode_frame(5, [1, 2, 3, 4, 5, 900])),
}  # fmt: skip


@pytest.fixture
def open_port(monkeypatch):
    """Open a port with answers; the options of the port are kept."""

    def start(changes=None, **options):
        port = Port({**ANSWERS, **(changes or {})})

        def make(name, **given):
            port.name, port.options = name, given
            return port

        monkeypatch.setattr(serial, "serial_for_url", make)
        return port, Sensor("/dev/x", **{"timeout": 5.0, **options})

    return start


def test_a_driver_sends_and_reads_these_bytes(open_port):
    port, sensor = open_port()
    with sensor:
        assert port.sent == [send(0x22), send(0x50), send(0x30)]
        port.sent.clear()
        info = sensor.read_info()
        assert (info.kind, info.hardware_revision, info.firmware, info.serial_number) == (1, 3, "4.5.6.7", 89)
        assert sensor.read_matrix() == MatrixInfo(3, 2, 3.4e-3, 2.55e-3, 900)
        assert sensor.read_mask().tolist() == [True, False, True, True, False, True]
        assert (sensor.read_type(), sensor.read_tag()) == ("WTS \ufffd", "palm")
        assert (sensor.read_temperature(), sensor.read_threshold(), sensor.read_gain()) == (-12.5, 300, 200)
        port.sent.clear()
        sensor.set_tag("left")
        sensor.set_threshold(0x0123)
        sensor.set_gain(9)
        sensor.tare()
        sensor.untare()
        frame = sensor.read_frame()
        sensor.read_frame(run_length=True)
        assert (frame.counts.tolist(), frame.ticks) == ([1, 2, 3, 4, 5, 900], 5)
        assert frame.host_time > 0
        assert sensor.ask(Command.LOOP, b"a", b"b") == (b"ab",)
        assert port.sent == [
            send(0x51, b"left"), send(0x34, b"\x23\x01"), send(0x36, b"\x09"), send(0x23, b"\1"), send(0x23, b"\0"),
            send(0x20, b"\0"), send(0x20, b"\1"), send(0x06, b"ab"),
        ]  # fmt: skip
        assert (port.name, sensor.port, sensor.parser.texels) == ("/dev/x", "/dev/x", 6)
        assert port.options == {"baudrate": 115_200, "write_timeout": 1.0, "timeout": 0.05, "exclusive": True}
        port.sent.clear()
    assert port.sent == []  # no stream to stop
    assert not port.is_open


def test_a_stream_asks_for_its_flags_and_interval_and_is_stopped(open_port):
    frames = b"".join(send(0, encode_frame(ticks, [ticks] * 6)) for ticks in (10, 20))
    port, sensor = open_port({0x21: answer(0x21) + frames}, baud_rate=9600)
    tapped = []
    with sensor:
        sensor.tap = tapped.append
        port.sent.clear()
        stream = sensor.stream(run_length=True, interval_ms=0x0102)
        found = [next(stream), next(stream)]
        assert [(each.ticks, each.counts.tolist()) for each in found] == [(10, [10] * 6), (20, [20] * 6)]
        assert b"".join(each.data for each in tapped) == answer(0x21) + frames
        assert found[1].host_time == tapped[-1].host_time
        stream.close()
        assert port.sent == [send(0x21, b"\1\2\1"), send(0x22)]
        assert (port.options["baudrate"], sensor.take_last_gaps()) == (9600, [])


@pytest.mark.parametrize("status", [0, 4])
def test_a_silent_stream_is_told_and_started_again(open_port, status):
    """Twice the time of an answer, or three intervals, pass without a frame."""
    port, sensor = open_port({0x21: answer(0x21, status=status)})
    with sensor:
        sensor.timeout = 0.03
        for interval, silence in ((0, 0.06), (24, 0.072)):
            port.sent.clear()
            stream = sensor.stream(interval_ms=interval)
            gap = next(stream)
            assert (gap.kind, gap.seconds) == ("silence", pytest.approx(silence))
            assert set(port.sent) == {send(0x21, struct.pack("<BH", 0, interval))}
            assert len(port.sent) >= 2  # more if the computer was so slow that a command was sent again
            stream.close()


@pytest.mark.parametrize(
    ("changes", "ask", "kind", "words"),
    [
        ({0x46: answer(0x46, status=2)}, "read_temperature", SensorError,
         "/dev/x: the sensor refused `temperature`: no sensor (2)"),
        ({0x35: answer(0x35, b"\1")}, "read_threshold", SensorError,
         "/dev/x: the answer to `get threshold` is not as assumed: GET_THRESHOLD: 1 bytes do not fit"),
        ({0x33: answer(0x33, b"\x2d\0")}, "read_mask", SensorError, "2 bytes 2d00 are no mask of 6 texels"),
        ({0x33: answer(0x33, b"\x7f")}, "read_mask", SensorError, "1 bytes 7f are no mask of 6 texels"),
        ({0x33: answer(0x33, b"\0")}, "read_mask", SensorError, "1 bytes 00 are no mask of 6 texels"),
        ({0x37: None}, "read_gain", NoAnswerError, "/dev/x: no answer to `get gain` in 0.03 s; check the cable"),
    ],
)  # fmt: skip
def test_an_answer_that_is_refused_wrong_or_missing_is_told(open_port, changes, ask, kind, words):
    port, sensor = open_port(changes)
    with sensor:
        if kind is NoAnswerError:
            sensor.timeout = 0.01
        port.sent.clear()
        with pytest.raises(kind) as caught:
            getattr(sensor, ask)()
        assert words in str(caught.value)
        assert len(port.sent) - (ask == "read_mask") == (3 if kind is NoAnswerError else 1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({0x50: None}, "[1-3]0 bytes came"),  # the answer to the first command, which is sent up to three times
        ({0x50: None, 0x22: None}, "nothing came back"),
    ],
)
def test_a_port_without_a_sensor_is_told_and_closed(open_port, monkeypatch, changes, words):
    ports = []
    monkeypatch.setattr(Port, "close", lambda self: ports.append(self.name))
    with pytest.raises(NoAnswerError, match=f"/dev/x: no Weiss WTS sensor answers here: ({words})"):
        open_port(changes, timeout=0.03)
    assert ports == ["/dev/x"]


def test_a_sensor_that_refuses_to_stop_a_stream_is_accepted(open_port):
    port, sensor = open_port({0x22: answer(0x22, status=9)})
    with sensor:
        assert port.is_open
        assert port.sent == [send(0x22), send(0x50), send(0x30)]
        assert sensor.parser.texels == 6


def test_a_sensor_without_a_matrix_accepts_frames_of_any_size(open_port):
    _, sensor = open_port({0x30: answer(0x30, status=5)})
    assert sensor.parser.texels is None
    sensor.close()


@pytest.mark.parametrize(
    ("number", "text", "words"),
    [
        (2, "x", "no such port; ports on this machine: "),
        (13, "x", "no permission to open it; ask the administrator"),
        (16, "x", "another program has it open; only one client can use a sensor"),
        (None, "Could not exclusively lock port", "another program has it open"),
        (25, "x", "not a serial port; accepted: a port such as /dev/ttyACM0, or a pyserial URL"),
        (21, "x", "not a serial port"),
        (None, "Could not configure port: x", "not a serial port"),
        (5, "two\n lines", "cannot be opened: [Errno 5] two lines; accepted: a port"),
    ],
)
def test_a_port_that_cannot_be_opened_is_explained(monkeypatch, number, text, words):
    def fail(*_, **__):
        raise serial.SerialException(number, text) if number else serial.SerialException(text)

    monkeypatch.setattr(serial, "serial_for_url", fail)
    with pytest.raises(PortError) as caught:
        Link("/dev/none")
    assert str(caught.value).startswith(f"/dev/none: {words}")


def test_bytes_beyond_the_buffer_are_counted(monkeypatch):
    port = Port({})
    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **options: setattr(port, "options", options) or port)
    link = Link("socket://a:1", buffer_bytes=8)
    assert port.options["timeout"] == 0.005
    assert "exclusive" not in port.options
    for piece in (b"12345678", b"9", b"10"):
        port.give(piece)
    assert [(each.data, each.lost) for each in link.read(1)] == [(b"12345678", 0)]
    port.give(b"ab")
    assert [(each.data, each.lost) for each in link.read(1)] == [(b"ab", 3)]
    assert link.read(0.0) == []
    link.close()
    assert not port.is_open


def test_bytes_lost_in_a_full_buffer_are_a_gap_before_the_next_frame(open_port):
    """Seventy bytes do not fit the sixty that are kept; what came before the port was opened is left out."""
    first, second = (send(0, encode_frame(ticks, [ticks] * 6)) for ticks in (10, 20))
    port, sensor = open_port({0x21: answer(0x21) + first}, buffer_bytes=60)
    assert port.resets == 1
    with sensor:
        stream = sensor.stream()
        assert next(stream).ticks == 10
        for piece in (bytes(70), second):
            port.give(piece)
        gap, reading = next(stream), next(stream)
        assert (gap.kind, gap.frames, gap.skipped in (69, 70)) == ("overflow", 0, True)  # one byte may be read alone
        assert 0 < gap.host_time <= reading.host_time
        assert reading.ticks == 20
        stream.close()


def test_open_questions_are_answered_by_their_values(open_port, monkeypatch):
    """Twelve frames of 4 ticks, 2 ms apart: half a millisecond per tick."""
    frames = b"".join(send(0, encode_frame(4 * number, [1] * 6)) for number in range(300))
    packed = answer(0x20, encode_frame(5, [4, 2, 3, 4, 5, 900], run_length=True))
    single = lambda sent: packed if sent == b"\1" else ANSWERS[0x20]  # noqa: E731
    _, sensor = open_port({0x21: answer(0x21) + frames, 0x20: single, 0x37: answer(0x37, status=5)})
    read = Reading.__init__
    monkeypatch.setattr(
        Reading,
        "__init__",
        lambda self, **given: read(self, **{**given, "host_time": 10**9 + 5 * 10**5 * given["ticks"]}),
    )
    with sensor:
        found = inquire(sensor)
    assert found["mask (0x33)"] == "4 of 6 texels exist, read as one bit per texel"
    assert found["clock"] == "0.5000 ms per tick (assumed 1 ms), 500.0 frames/s free-running"
    assert found["run length"] == "decodes to 6 texels in 12 bytes, at most 3 counts from the raw frame before it"
    assert found["texel order"] == "largest is texel 5, read as row 1, column 2: press a corner to check"
    assert found["loop (0x06)"] == "answers with the bytes it was sent"
    assert found["threshold (0x35)"] == "300, read as an unsigned 16 bit number"
    assert found["gain (0x37)"] == "not as assumed: /dev/x: the sensor refused `get gain`: feature not supported (5)"
    assert (found["device tag (0x52)"], len(found), len(UNCONFIRMED)) == ("'palm'", 11, 8)


@pytest.mark.parametrize("step", [1, 0])
def test_a_clock_that_stands_and_other_unexpected_answers_are_told(open_port, step):
    """Frames that come all at once, or with one time; raw ones although packed ones were asked for; a changed loop."""
    frames = b"".join(send(0, encode_frame(step * number, [1] * 6)) for number in range(300))
    _, sensor = open_port({0x06: answer(0x06, b"else"), 0x21: answer(0x21) + frames})
    with sensor:
        found = inquire(sensor)
    told = "not as assumed: 300 frames of 300 events have one time; expected a clock that runs"
    assert found["clock"] == told
    assert found["loop (0x06)"] == "answers b'else' to b'softcover'"
    assert found["run length"] == "asked for, but the frame came raw"


# The emulated sensor.

SHOWN = np.array([0, 10, 20, 4000, 5000, -3])
MATRIX = MatrixInfo(columns=3, rows=2, cell_width=4e-3, cell_height=3e-3, full_scale=4090)


def ask(sensor, identifier, payload=b"", now=2.5):
    (message,) = Parser().feed(sensor.receive(send(identifier, payload), now))
    assert message.identifier == identifier
    return message.payload


def counts_of(sensor, now=2.5, flags=0):
    return decode_frame(ask(sensor, 0x20, bytes([flags]), now)[2:])


def test_an_emulated_sensor_answers_these_bytes():
    sensor = VirtualSensor(lambda _: SHOWN, matrix=MATRIX, active=[1, 1, 0, 1, 1, 1], tag="me")
    for identifier, payload, expected in (
        (0x06, b"xy", b"xy"), (0x30, b"", struct.pack("<5H", 3, 2, 400, 300, 4090)), (0x33, b"", b"\x3b"),
        (0x38, b"", b"WTS 0302-40x30"), (0x52, b"", b"me"), (0x35, b"", b"\0\0"), (0x37, b"", b"\0"),
        (0x50, b"", struct.pack("<BBHI", 1, 1, 0x1000, 1)),
    ):  # fmt: skip
        assert ask(sensor, identifier, payload) == b"\0\0" + expected
    for identifier, payload, status in (
        (0x99, b"", 14), (0x34, b"", 13), (0x34, b"\1", 15), (0x31, b"x", 5), (0x34, struct.pack("<H", 4096), 28),
        (0x51, b"x" * 65, 28), (0x22, b"", 0), (0x34, struct.pack("<H", 4095), 0), (0x51, b"x" * 64, 0),
    ):  # fmt: skip
        assert ask(sensor, identifier, payload) == struct.pack("<H", status)
    assert ask(sensor, 0x35) == b"\0\0\xff\x0f"
    assert ask(sensor, 0x52) == b"\0\0" + b"x" * 64


def test_an_emulated_frame_is_masked_clipped_tared_and_thresholded():
    sensor = VirtualSensor(lambda now: SHOWN + 100 * (now > 5), matrix=MATRIX, active=[1, 1, 0, 1, 1, 1])
    frame = counts_of(sensor, 2.5678)
    assert (frame.counts.tolist(), frame.ticks, frame.run_length) == ([0, 10, 0, 4000, 4090, 0], 2567, False)
    assert counts_of(sensor, flags=1).run_length
    ask(sensor, 0x34, struct.pack("<H", 7))
    assert counts_of(sensor).counts.tolist() == [0, 3, 0, 3993, 4083, 0]
    ask(sensor, 0x23, b"\1")
    assert counts_of(sensor, 6.0).counts.tolist() == [93, 93, 0, 83, 0, 90]
    ask(sensor, 0x23, b"\0")
    assert counts_of(sensor, 6.0).counts.tolist() == [93, 103, 0, 4083, 4083, 90]


@pytest.mark.parametrize(
    ("interval", "ticks"), [(0, [100, 300, 500, 700, 900]), (150, [100, 300, 500, 700, 900]), (400, [100, 500, 900])]
)
def test_emulated_frames_are_due_at_their_interval(interval, ticks):
    pauses = ((0.7, 0.8),) if interval == 150 else ()
    ticks = [each for each in ticks if not (pauses and each == 700)]
    sensor = VirtualSensor(lambda _: SHOWN, matrix=MATRIX, rate=5.0, misbehaviour=Misbehaviour(pauses=pauses))
    assert sensor.take_due_frames(9.0) == []
    assert ask(sensor, 0x21, struct.pack("<BH", 1, interval), now=0.1001) == b"\0\0"
    assert ask(sensor, 0x21, struct.pack("<BH", 0, 0), now=0.1) == b"\4\0"
    frames = [decode_frame(each[6:-2]) for each in sensor.take_due_frames(0.9002)]
    assert [each.ticks for each in frames] == ticks
    assert all(each.run_length for each in frames)
    assert sensor.frames_sent == len(ticks)
    assert sensor.next_due == pytest.approx(0.1001 + (1.2 if interval == 400 else 1.0))
    assert ask(sensor, 0x22) == b"\0\0"
    assert (sensor.take_due_frames(99.0), sensor.next_due) == ([], np.inf)


def test_refused_commands_and_faults_are_those_that_are_asked_for():
    wrong = Misbehaviour(refused={Command.GET_GAIN: Status.AXIS_BLOCKED}, rates={"boot-text": 1.0, "lose": 0.0})
    sensor = VirtualSensor(lambda _: SHOWN, matrix=MATRIX, misbehaviour=wrong)
    assert sensor.receive(send(0x37), 0.0) == b"\x1b[5n" * 3 + send(0x37, b"\x1d\0")
    assert VirtualSensor(lambda _: SHOWN, matrix=MATRIX, misbehaviour=Misbehaviour(rates={"lose": 1})).receive(
        send(0x37), 0.0
    ) == b""  # fmt: skip
    half = VirtualSensor(lambda _: SHOWN, matrix=MATRIX, misbehaviour=Misbehaviour(rates={"repeat": 0.25}, seed=3))
    came = [len(half.receive(send(0x37), 0.0)) // 11 for _ in range(400)]
    assert 70 < came.count(2) < 130
    assert came.count(1) == 400 - came.count(2)
    for rate in (-0.01, 1.01):
        with pytest.raises(ValueError, match=rf"the rate of lose must lie in 0\.\.1, not {rate}"):
            Misbehaviour(rates={"lose": rate})
    for rate in (0, np.inf, -1):
        with pytest.raises(ValueError, match=f"rate must be positive, not {rate} Hz"):
            VirtualSensor(lambda _: SHOWN, rate=rate)


@pytest.mark.parametrize(
    ("name", "shortest", "longest"),  # change of the length of a message of 108 bytes at its byte 50
    [("flip-bit", 0, 0), ("change-bytes", 0, 0), ("drop-bytes", -16, -1), ("repeat-bytes", 1, 16),
     ("insert-noise", 1, 40), ("cut", -58, -58), ("extra-preamble", 1, 5), ("false-head", 6, 6), ("lose", -108, -108),
     ("repeat", 108, 108), ("boot-text", 12, 12), ("wrong-size", 0, 0)],
)  # fmt: skip
def test_faults_change_a_message_by_all_lengths_within_their_bounds(name, shortest, longest):
    message = send(0x06, bytes(range(100)))
    random = Random(4)  # noqa: S311 -- reproducible, no secret
    damaged = [FAULTS[name](message, 50, random) for _ in range(600)]
    assert {len(each) - len(message) for each in damaged} == set(range(shortest, longest + 1))
    changed = [sum(a != b for a, b in zip(each, message, strict=False)) for each in damaged]
    if name == "flip-bit":
        flips = {each[50] ^ message[50] for each in damaged}
        assert (set(changed), flips) == ({1}, {1 << bit for bit in range(8)})
    if name == "change-bytes":
        assert max(changed) == 8
        assert all(each[:50] == message[:50] and each[58:] == message[58:] for each in damaged)
    if name == "wrong-size":
        assert all(each[:4] + message[4:6] + each[6:] == message for each in damaged)
        assert len({each[4:6] for each in damaged}) > 500
    if name == "false-head":
        assert {each[3] for each in damaged} == {0x00, 0x20}
        assert {each[5] for each in damaged} == {0}
        assert len({each[4] for each in damaged}) > 200
    if name in ("insert-noise", "drop-bytes", "repeat-bytes"):
        assert all(each.startswith(message[:50]) and each.endswith(message[66:]) for each in damaged)
    if name == "cut":
        assert (damaged[0], FAULTS["cut"](message, 0, random)) == (message[:50], message[:1])


class End:
    """The device's end of a line: its client asks for frames, takes few bytes at once, and stops when it has enough."""

    def __init__(self, takes, has_enough):
        self.takes, self.asked, self.sent, self.waits = takes, send(0x21, b"\0\0\0"), b"", []
        self.has_enough, self.stop = has_enough, threading.Event()

    def send(self, data):
        taken = data[: self.takes]
        self.sent += taken
        return len(taken)

    def receive(self, wait):
        self.waits.append(wait)
        asked, self.asked = self.asked, b""
        if self.has_enough(self):
            self.stop.set()
        return asked


def serve(sensor, end, **options):
    return virtual.serve(sensor, end, stop=end.stop, seconds=20.0, **options)


@pytest.mark.parametrize(("room", "kept"), [(11, 1), (10 + 29, 1), (10 + 29 + 1, 2)])
def test_frames_beyond_the_room_for_a_client_are_left_out_as_a_whole(room, kept):
    """The answer has 10 bytes and a frame of 8 texels 29; nothing is taken."""
    matrix = MatrixInfo(columns=4, rows=2, cell_width=4e-3, cell_height=3e-3, full_scale=4090)
    sensor = VirtualSensor(lambda _: np.arange(8), matrix=matrix, rate=400.0)
    end = End(0, lambda _: sensor.frames_sent > 5)
    left_out = serve(sensor, end, backlog_bytes=room)
    assert sensor.frames_sent > 5
    assert left_out == sensor.frames_sent - kept
    assert all(0 <= wait <= 0.05 for wait in end.waits)


def test_a_client_that_takes_few_bytes_at_a_time_gets_every_byte():
    end, parser = End(7, lambda end: len(end.sent) > 10 + 2 * 181), Parser(texels=84)
    assert serve(VirtualSensor(lambda _: np.arange(84), rate=1000.0), end, backlog_bytes=10**6) == 0
    assert [each.identifier for each in parser.feed(end.sent)[:3]] == [0x21, 0x00, 0x00]
    assert parser.bytes_skipped == 0


def test_a_sensor_waits_for_its_next_frame():
    end = End(10**6, lambda end: len(end.sent) >= 10 + 181 and max(end.waits) > 0.005)
    assert serve(VirtualSensor(lambda _: np.arange(84), rate=100.0), end) == 0
    assert [each.identifier for each in Parser(texels=84).feed(end.sent)[:2]] == [0x21, 0x00]
    assert 0.005 < max(end.waits) <= 0.05


def test_a_run_ends_after_its_time_or_when_it_is_stopped():
    sensor, end, start = VirtualSensor(lambda _: np.arange(84)), End(10**6, lambda _: False), time.monotonic()
    assert virtual.serve(sensor, end, seconds=0.03) == 0
    assert time.monotonic() - start >= 0.03
    end.waits.clear()
    end.stop.set()
    assert virtual.serve(sensor, end, stop=end.stop) == 0
    assert end.waits == []
    assert (virtual.BACKLOG_BYTES, BUFFER_BYTES, Chunk(1, b"").lost) == (4096, 2**18, 0)
