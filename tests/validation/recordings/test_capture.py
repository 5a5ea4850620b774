"""Recording from a virtual sensor on a port to a file that every tool reads, whatever happens meanwhile."""

import json
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from random import Random

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")

from tests.support.virtual_port import VirtualPort, is_ramp
from validation.recordings import capture, mcap_reader
from validation.recordings.recording import Setup
from validation.weiss.protocol import Parser, Reading
from validation.weiss.sensor import LinkLostError, NoAnswerError, Sensor, SensorError
from validation.weiss.virtual import Misbehaviour, show_pattern

#: Recorders that are killed at the same time in the long test.
_AT_ONCE = 2
#: Time for an answer on a machine that is busy with other tests [s].
_LONG = 30.0
SETUP = Setup(indenter="sphere:radius=5mm", load=4.9, note="left palm, 3rd trial")


@contextmanager
def _running(**options):
    port = VirtualPort(**options)
    try:
        yield port
    finally:
        port.unplug()


class _Stop:
    """Collects events and interrupts the recorder, as Ctrl-C does, after that many."""

    def __init__(self, after):
        self.events = []
        self._after = after

    def __call__(self, event):
        self.events.append(event)
        if len(self.events) == self._after:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of 130 frames, with the readings that the recorder saw."""
    path, stop = tmp_path_factory.mktemp("recorded") / "touch.mcap", _Stop(130)
    with _running() as port, Sensor(port.name, timeout=_LONG) as sensor:
        sensor.set_threshold(11)
        done = capture.record(sensor, path, setup=SETUP, on_event=stop)
    return path, [event for event in stop.events if isinstance(event, Reading)], done


def test_frames_and_clocks_come_back(recorded):
    path, readings, done = recorded
    recording = mcap_reader.read(path)
    assert recording.complete
    assert recording.gaps == ()
    assert done.frames == len(recording.times) == len(readings) == 130
    late = done.residual.largest / done.seconds  # on a busy machine frames arrive late
    assert done.rate == pytest.approx((done.frames - 1) / np.ptp(recording.times), rel=0.02 + late)
    assert done.rate * np.ptp(recording.host_monotonic) * 1e-9 == pytest.approx(129, rel=1e-9)  # times between frames
    (array,) = recording.arrays
    assert (array.counts == [reading.counts for reading in readings]).all()
    assert recording.ticks.tolist() == [reading.ticks for reading in readings]
    assert recording.host_monotonic.tolist() == [reading.host_time for reading in readings]
    errors = recording.times - (recording.ticks - recording.ticks[0]) * 1e-3
    # On a busy machine frames arrive late, which the recording states.
    assert np.quantile(np.abs(errors - np.median(errors)), 0.95) < max(2e-3, done.residual.p95)
    delays = recording.arrival_delays
    assert np.allclose(np.diff(recording.times + delays), np.diff(recording.host_monotonic) * 1e-9)
    assert done.residual.largest >= delays.max() - 1e-4
    assert (array.texels.rows, array.texels.columns, array.texels.pitch) == (14, 6, (3.4e-3, 3.4e-3))
    assert recording.temperatures.shape == (2, 1)


def test_the_setup_and_the_properties_of_the_device_come_back(recorded):
    setup = mcap_reader.read(recorded[0]).setup
    assert (setup.indenter, setup.load, setup.note) == (SETUP.indenter, SETUP.load, SETUP.note)
    assert setup.device["threshold"] == 11
    assert setup.device["type"] == "WTS 0614-34"
    assert {"gain", "temperature", "serial", "firmware"} <= set(setup.device)


def test_the_raw_bytes_in_the_file_hold_the_same_frames(recorded):
    path, readings, _ = recorded
    parser = Parser(texels=84)
    with AnyReader([path]) as reader:
        raw = [connection for connection in reader.connections if connection.topic == "/raw"]
        pieces = [bytes(reader.deserialize(data, c.msgtype).data) for c, _, data in reader.messages(raw)]
    messages = [message for piece in pieces for message in parser.feed(piece) if message.identifier == 0]
    assert len(messages) >= len(readings)
    assert parser.bytes_skipped == 0
    first = messages[0].payload
    assert first[5:] == readings[0].counts.astype("<u2").tobytes()


def test_mcap_and_its_ros_2_decoder_read_it(recorded):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    path, readings, _ = recorded
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        (metadata,) = reader.iter_metadata()
        assert json.loads(metadata.metadata["labels"])["setup"]["load"] == 4.9
        images = [message for *_, message in reader.iter_decoded_messages(topics="/tactile/image")]
    assert len(images) == len(readings)
    picture = images[-1]
    assert (picture.encoding, picture.height, picture.width, picture.step) == ("mono16", 14, 6, 12)
    assert np.frombuffer(bytes(picture.data), "<u2").tolist() == readings[-1].counts.tolist()


def test_a_recording_ends_after_its_time_and_needs_no_answers_to_optional_questions(tmp_path, monkeypatch):
    def stay_silent(_):
        raise NoAnswerError("no answer")

    with _running() as port, Sensor(port.name) as sensor:
        for question in ("read_temperature", "read_tag", "read_mask"):
            monkeypatch.setattr(Sensor, question, stay_silent)
        events, start = [], time.monotonic_ns()
        done = capture.record(sensor, tmp_path / "a.mcap", seconds=0.1, on_event=events.append)
    recording = mcap_reader.read(done.path)
    assert done.ended == "done"
    assert len(recording.times) == done.frames > 0
    assert events[-1].host_time - start >= 0.1e9
    assert not recording.temperatures.size
    assert not {"temperature", "tag"} & set(recording.setup.device)
    assert {"tag", "mask", "temperature before the frames", "temperature after the frames"} <= set(done.unknown)


@pytest.mark.parametrize(
    "error",
    [
        NoAnswerError,
        pytest.param(SensorError, marks=pytest.mark.slow),
        pytest.param(LinkLostError, marks=pytest.mark.slow),
    ],
)
def test_a_question_after_the_frames_without_an_answer_ends_nothing(tmp_path, monkeypatch, error):
    with _running() as port, Sensor(port.name) as sensor:
        first = [30.0, 30.5]  # as a property, and before the frames

        def answer(_):
            if first:
                return first.pop()
            raise error("check the cable")

        monkeypatch.setattr(Sensor, "read_temperature", answer)
        done = capture.record(sensor, tmp_path / "a.mcap", seconds=0.1)
    recording = mcap_reader.read(done.path)
    assert done.unknown == ("temperature after the frames",)
    assert len(recording.times) == done.frames > 0
    assert recording.temperatures.tolist() == [[30.0]]
    assert recording.complete


def _check_gaps(recording):
    """Check that every jump of the device's clock has its gap in the file; return the number of jumps."""
    jumps = np.flatnonzero(np.diff(recording.ticks) > 5)
    for place in jumps:
        assert any(f"after tick {recording.ticks[place]}," in gap for gap in recording.gaps)
    return len(jumps)


def test_gaps_among_the_first_frames_are_in_the_file_too(tmp_path):
    """A recording that ends before the usual step is known; of five frames no more than three come in a row."""
    wrong, stop = Misbehaviour(pauses=tuple((start, start + 0.012) for start in np.arange(0, 30, 0.02))), _Stop(5)
    with _running(misbehaviour=wrong) as port, Sensor(port.name) as sensor:
        capture.record(sensor, tmp_path / "gaps.mcap", on_event=stop)
    recording = mcap_reader.read(tmp_path / "gaps.mcap")
    assert len(recording.times) == 5
    assert _check_gaps(recording) >= 1


def test_frames_received_before_the_port_went_away_are_kept(tmp_path):
    path, events = tmp_path / "cut.mcap", []
    with _running() as port:

        def unplug_later(event):
            events.append(event)
            if len(events) == 50:
                port.unplug()

        with Sensor(port.name) as sensor, pytest.raises(capture.RecordingStoppedError) as caught:
            capture.record(sensor, path, on_event=unplug_later)
    assert "unplugged" in str(caught.value)
    assert "\n" not in str(caught.value)
    recording = mcap_reader.read(path)
    assert recording.complete
    assert f"{len(recording.times)} frames are kept in {path}" in str(caught.value)
    assert len(recording.times) >= 50


#: A recorder that says `go` after its first frame, `on` after its hundredth, and how it ended.
_RECORD = """
import sys
from validation.recordings.capture import record
from validation.weiss.sensor import Sensor

count = 0

def show(event):
    global count
    count += 1
    if count in (1, 100):
        print("go" if count == 1 else "on", flush=True)

try:
    with Sensor(sys.argv[1], timeout=30.0) as sensor:
        done = record(sensor, sys.argv[2], on_event=show)
        print(done.frames, done.ended)
except OSError as error:
    sys.exit(f"error: {error}")
"""


def _start_recorder(port, path, **options):
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", _RECORD, port.name, str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def _check_killed(path):
    """Check what a killed recorder left."""
    recording = mcap_reader.read(path)
    assert not recording.complete
    _check_gaps(recording)
    assert is_ramp(recording.arrays[0].counts)
    return recording


@pytest.mark.slow
def test_a_killed_recorder_leaves_a_file_that_can_be_completed(tmp_path):
    path = tmp_path / "killed.mcap"
    with _running() as port:
        run = _start_recorder(port, path)
        assert [run.stdout.readline() for _ in range(2)] == ["go\n", "on\n"]
        run.kill()
        run.communicate()
    left = _check_killed(path)
    assert mcap_reader.recover(path)
    completed = mcap_reader.read(path)
    assert completed.complete
    assert np.array_equal(completed.arrays[0].counts, left.arrays[0].counts)
    assert not mcap_reader.recover(path)
    with AnyReader([path]) as reader:
        images = [connection for connection in reader.connections if connection.topic == "/tactile/image"]
        assert sum(1 for _ in reader.messages(images)) == len(completed.times)


@pytest.mark.slow
def test_a_killed_recorder_loses_at_most_half_a_second(tmp_path):
    """All but the last 0.5 s is there, except where a busy machine let the sensor itself or its recorder wait.

    Sensors and recorders share the machine with other tests, so one of twenty may wait longer, none by 2 s.
    """
    random = Random(5)  # noqa: S311 -- reproducible, no secret
    delays = [random.uniform(0.25, 1.0) for _ in range(20)]
    missing = []

    def kill_some(number):
        path = tmp_path / f"{number}.mcap"
        with _running() as port:
            for delay in delays[number::_AT_ONCE]:
                run = _start_recorder(port, path)
                assert run.stdout.readline() == "go\n", run.communicate()
                time.sleep(delay)
                run.kill()
                killed = time.monotonic_ns()
                run.communicate()
                missing.append((killed - _check_killed(path).host_monotonic[-1]) * 1e-9)
                path.unlink()

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        list(pool.map(kill_some, range(_AT_ONCE)))
    missing.sort()
    assert len(missing) == len(delays)
    assert missing[-2] < 0.5
    assert missing[-1] < 2.0


@pytest.mark.slow
def test_control_c_ends_a_recording_properly(tmp_path):
    with _running() as port:
        run = _start_recorder(port, tmp_path / "c.mcap")
        assert run.stdout.readline() == "go\n"
        run.send_signal(signal.SIGINT)
        out, errors = run.communicate(timeout=60)
    recording = mcap_reader.read(tmp_path / "c.mcap")
    assert (out.removeprefix("on\n"), errors) == (f"{len(recording.times)} interrupted\n", "")
    assert recording.complete


@pytest.mark.slow
def test_a_full_disk_ends_a_recording_in_one_line_and_loses_at_most_half_a_second(tmp_path):
    """Under a limit on the size of files the system refuses writes as a full disk does."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (25_000, 25_000))

    path = tmp_path / "full.mcap"
    with _running() as port:
        run = _start_recorder(port, path, preexec_fn=limit)
        _, errors = run.communicate(timeout=60)
    assert (run.returncode, len(errors.splitlines())) == (1, 1)
    assert f"{path}: the disk takes no more (File too large)" in errors
    recording, came = mcap_reader.read(path), int(errors.split(" frames had come")[0].rsplit(" ", 1)[1])
    assert not recording.complete
    assert is_ramp(recording.arrays[0].counts)
    assert 30 < len(recording.times) <= came < len(recording.times) + 271 / 2


@pytest.mark.slow
def test_header_stamps_follow_the_device_while_the_host_is_late(tmp_path, monkeypatch):
    """Bytes that arrive up to 150 ms late: header and publish time follow the device, log time is the arrival.

    If the first bytes are the latest ones, the stamps stand still for 150 ms, 3 % of this recording.
    """
    from validation.weiss.sensor import Chunk, Link

    random, receive = Random(1), Link.read  # noqa: S311 -- reproducible, no secret

    def delay(self, timeout):
        late = int(random.choice((0, 0, 0, 30, 150)) * 1e6)
        return [Chunk(each.host_time + late, each.data, each.lost) for each in receive(self, timeout)]

    with _running(source=show_pattern("zero")) as port, Sensor(port.name, timeout=_LONG) as sensor:
        monkeypatch.setattr(Link, "read", delay)
        done = capture.record(sensor, tmp_path / "a.mcap", seconds=5)
    recording = mcap_reader.read(tmp_path / "a.mcap")
    errors = recording.times - (recording.ticks - recording.ticks[0]) * 1e-3
    # On a busy machine frames arrive late, which the recording states.
    assert np.quantile(np.abs(errors - np.median(errors)), 0.95) < max(2e-3, done.residual.p95)
    assert done.residual.p95 > 0.1
    assert np.quantile(recording.arrival_delays, 0.95) > 0.1
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        stamps = [
            (message.header.stamp.sec * 10**9 + message.header.stamp.nanosec, logged)
            for connection, logged, data in reader.messages()
            if connection.topic == "/tactile/image"
            for message in [reader.deserialize(data, connection.msgtype)]
        ]
    assert len(stamps) == done.frames
    late = [logged - stamp for stamp, logged in sorted(stamps)]
    assert np.allclose(np.array(late) * 1e-9 - min(late) * 1e-9, recording.arrival_delays, atol=1e-6)
