"""Recording: from a virtual sensor on a port to a file that every tool reads, whatever happens meanwhile."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from random import Random

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")

from validation.recordings import capture, mcap_reader
from validation.recordings.importing import save
from validation.recordings.mcap_writer import RecordingWriter
from validation.recordings.recording import Setup
from validation.weiss.parser import Parser
from validation.weiss.sensor import Reading, Sensor
from validation.weiss.serve import PseudoTerminal, serve
from validation.weiss.virtual import WTS_0614_34, Misbehaviour, VirtualSensor, pattern

#: Recorders that are killed at the same time in the long test.
_AT_ONCE = 2
SETUP = Setup(indenter="sphere:radius=5mm", load=4.9, note="left palm, 3rd trial")


@pytest.fixture
def port():
    """A port with a sensor whose every frame differs."""
    with _running(VirtualSensor(pattern("ramp"))) as name:
        yield name


class _running:  # noqa: N801 -- reads as a verb
    def __init__(self, sensor):
        self.end, self.stop = PseudoTerminal(), threading.Event()
        # a device leaves out frames that nobody reads for 0.2 s; on a busy machine tests would lose some by chance
        options = {"stop": self.stop, "backlog_bytes": 2**20}
        self.thread = threading.Thread(target=serve, args=(sensor, self.end), kwargs=options)

    def __enter__(self):
        self.thread.start()
        return self.end.name

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()
        self.end.close()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of half a second, with the readings that the recorder saw."""
    path = tmp_path_factory.mktemp("recorded") / "touch.mcap"
    seen = []
    with _running(VirtualSensor(pattern("ramp"))) as name, Sensor(name) as sensor:
        sensor.set_threshold(11)
        done = capture.record(sensor, path, setup=SETUP, seconds=0.5, on_event=seen.append)
    return path, [event for event in seen if isinstance(event, Reading)], done


def test_what_was_recorded_comes_back(recorded):
    path, readings, done = recorded
    recording = mcap_reader.read(path)
    assert recording.complete
    assert recording.gaps == ()
    assert done.frames == len(recording.times) == len(readings) > 20  # 135 where nothing else runs
    assert done.rate == pytest.approx((done.frames - 1) / np.ptp(recording.times), rel=0.02)
    (array,) = recording.arrays
    assert (array.counts == [reading.counts for reading in readings]).all()
    assert recording.ticks.tolist() == [reading.ticks for reading in readings]
    assert recording.host_monotonic.tolist() == [reading.host_time for reading in readings]
    assert np.allclose(recording.times, (recording.host_monotonic - recording.host_monotonic[0]) * 1e-9)
    assert (array.texels.rows, array.texels.columns, array.texels.pitch) == (14, 6, (3.4e-3, 3.4e-3))
    assert recording.temperatures.shape == (2, 1)


def test_the_setup_is_in_the_file(recorded):
    setup = mcap_reader.read(recorded[0]).setup
    assert (setup.indenter, setup.load, setup.note) == (SETUP.indenter, SETUP.load, SETUP.note)
    assert setup.device["threshold"] == 11
    assert setup.device["type"] == "WTS 0614-34"
    assert {"gain", "temperature", "serial", "firmware"} <= set(setup.device)


def test_raw_bytes_hold_the_same_frames(recorded):
    path, readings, _ = recorded
    parser = Parser(texels=84)
    with AnyReader([path]) as reader:
        raw = [connection for connection in reader.connections if connection.topic == "/raw"]
        pieces = [bytes(reader.deserialize(data, c.msgtype).data) for c, _, data in reader.messages(raw)]
    messages = [message for piece in pieces for message in parser.feed(piece) if message.identifier == 0]
    assert len(messages) >= len(readings)
    assert parser.counters.skipped == 0
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


def test_rosbags_reads_it_knowing_no_type_beforehand(recorded):
    path, readings, _ = recorded
    with AnyReader([path]) as reader:
        wanted = [c for c in reader.connections if c.topic in {"/tactile/image", "/tactile/frame"}]
        found = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages(wanted)}
    assert found["/tactile/image"].data.view("<u2").tolist() == readings[-1].counts.tolist()
    assert found["/tactile/frame"].counts.tolist() == readings[-1].counts.tolist()
    assert found["/tactile/frame"].device_ticks == readings[-1].ticks


def test_gaps_are_in_the_file(tmp_path):
    wrong = Misbehaviour(rates={"lose": 0.1}, seed=2)
    with _running(VirtualSensor(pattern("ramp"), misbehaviour=wrong)) as name, Sensor(name, timeout=0.1) as sensor:
        done = capture.record(sensor, tmp_path / "gaps.mcap", seconds=0.35)
    recording = mcap_reader.read(tmp_path / "gaps.mcap")
    assert done.gaps == len(recording.gaps) >= _assert_jumps_are_marked(recording) >= 1


def _assert_jumps_are_marked(recording):
    """Every jump of the device's clock, a lost frame or a busy machine's, has its gap in the file."""
    jumps = np.flatnonzero(np.diff(recording.ticks) > 5)
    for place in jumps:
        assert any(f"after tick {recording.ticks[place]}," in gap for gap in recording.gaps)
    return len(jumps)


def test_gaps_among_the_first_frames_are_in_the_file_too(tmp_path):
    """A recording that ends before the usual step is known; of five frames no more than three come in a row."""
    wrong = Misbehaviour(pauses=tuple((start, start + 0.012) for start in np.arange(0, 10, 0.02)))
    path, events = tmp_path / "gaps.mcap", []

    def stop_early(event):
        events.append(event)
        if len(events) == 5:
            raise KeyboardInterrupt

    with _running(VirtualSensor(pattern("ramp"), misbehaviour=wrong)) as name, Sensor(name) as sensor:
        capture.record(sensor, path, on_event=stop_early)
    recording = mcap_reader.read(path)
    assert len(recording.times) == 5
    assert _assert_jumps_are_marked(recording) >= 1


def test_unplugged_while_recording(tmp_path):
    path = tmp_path / "cut.mcap"
    running = _running(VirtualSensor(pattern("ramp")))
    name = running.__enter__()
    threading.Timer(0.35, running.__exit__).start()
    with Sensor(name) as sensor, pytest.raises(capture.RecordingStoppedError) as caught:
        capture.record(sensor, path)
    assert "unplugged" in str(caught.value)
    assert "\n" not in str(caught.value)
    recording = mcap_reader.read(path)
    assert recording.complete
    assert f"{len(recording.times)} frames are kept in {path}" in str(caught.value)
    assert len(recording.times) > 5


_RECORD = (
    "import sys\nfrom validation.weiss.sensor import Sensor\nfrom validation.recordings.capture import record\n"
    "try:\n"
    "    with Sensor(sys.argv[1]) as sensor:\n"
    "        shown = [0]\n"
    "        def show(event):\n"
    "            shown[0] += 1\n"
    "            if shown[0] == 1: print('go', flush=True)\n"
    "        done = record(sensor, sys.argv[2], on_event=show)\n"
    "        print(done.frames, done.ended)\n"
    "except OSError as error:\n"
    "    sys.exit(f'error: {error}')\n"
)


def _recorder(port, path, **options):
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", _RECORD, port, str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def _killed(port, path, after):
    """Kill a recorder so long after its first frame; return when, on the clock that frames carry [ns]."""
    run = _recorder(port, path)
    assert run.stdout.readline() == "go\n"
    time.sleep(after)
    run.kill()
    killed = time.monotonic_ns()
    run.communicate()
    return killed


def _check_killed(path, killed):
    """Check what a killed recorder left; return how much of its end is missing [s]."""
    recording = mcap_reader.read(path)
    assert not recording.complete
    _assert_jumps_are_marked(recording)
    assert (np.diff(recording.arrays[0].counts, axis=1) % 4096 == 40).all()
    return (killed - recording.host_monotonic[-1]) * 1e-9


def test_killed_at_any_moment(port, tmp_path):
    random = Random(4)  # noqa: S311 -- reproducible, no secret
    path = tmp_path / "killed.mcap"
    assert _check_killed(path, _killed(port, path, random.uniform(0.3, 0.9))) < 1.0
    assert mcap_reader.recover(path)
    before = mcap_reader.read(path)
    assert before.complete
    assert not mcap_reader.recover(path)
    with AnyReader([path]) as reader:
        wanted = [c for c in reader.connections if c.topic == "/tactile/image"]
        assert sum(1 for _ in reader.messages(wanted)) == len(before.times)


@pytest.mark.slow
def test_killed_two_hundred_times(tmp_path):
    """All but the last 0.5 s is there, save where a busy machine let the sensor itself or its recorder wait.

    Sensors and recorders share the machine with other tests, so two of two hundred may wait longer, none by 2 s.
    """
    random = Random(5)  # noqa: S311 -- reproducible, no secret
    moments = [random.uniform(0.25, 1.0) for _ in range(200)]
    missing = []

    def kill_some(number):
        path = tmp_path / f"{number}.mcap"
        with _running(VirtualSensor(pattern("ramp"))) as port:
            for after in moments[number::_AT_ONCE]:
                missing.append(_check_killed(path, _killed(port, path, after)))
                path.unlink()

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        list(pool.map(kill_some, range(_AT_ONCE)))
    missing.sort()
    assert len(missing) == len(moments)
    assert missing[-3] < 0.5
    assert missing[-1] < 2.0


def test_killed_before_the_first_frame(tmp_path, monkeypatch):
    """There is no file before all of its set-up; then there is a recording without frames."""
    path, before = tmp_path / "early.mcap", []
    write = os.write
    monkeypatch.setattr(os, "open", lambda *words, open_=os.open: before.append(path.exists()) or open_(*words))
    monkeypatch.setattr(os, "write", lambda *words: before.append(path.stat().st_size) or write(*words))
    writer = RecordingWriter(path, arrays=[capture.make_device_array(WTS_0614_34)], setup=SETUP, serial="7")
    assert before == [False, 0]
    monkeypatch.undo()
    left = path.read_bytes()
    writer.close()
    path.write_bytes(left)
    recording = mcap_reader.read(path)
    assert (recording.setup, recording.serial) == (SETUP, "7")
    assert not recording.complete
    assert (len(recording.times), recording.seconds) == (0, 0.0)
    assert recording.arrays[0].counts.shape == (0, 84)
    assert recording.arrays[0].texels.rows == 14
    assert abs(recording.started.timestamp() - time.time()) < 60
    assert mcap_reader.recover(path)
    assert mcap_reader.read(path).complete
    assert save(recording, tmp_path / "again.mcap") == 0
    assert mcap_reader.read(tmp_path / "again.mcap").setup == SETUP


def test_control_c_ends_a_recording_properly(port, tmp_path):
    run = _recorder(port, tmp_path / "c.mcap")
    assert run.stdout.readline() == "go\n"
    time.sleep(0.3)
    run.send_signal(signal.SIGINT)
    out, errors = run.communicate(timeout=10)
    recording = mcap_reader.read(tmp_path / "c.mcap")
    assert (out, errors) == (f"{len(recording.times)} interrupted\n", "")
    assert recording.complete


def test_a_full_disk_ends_in_one_line_and_keeps_what_came(port, tmp_path):
    """The limit on a file's size makes the system refuse writes just as a full disk does."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (25_000, 25_000))

    path = tmp_path / "full.mcap"
    run = _recorder(port, path, preexec_fn=limit)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 1
    assert len(errors.splitlines()) == 1
    assert f"{path}: the disk takes no more (File too large)" in errors
    recording = mcap_reader.read(path)
    assert not recording.complete
    assert len(recording.times) > 30
    frames = int(errors.split(" frames had come")[0].rsplit(" ", 1)[1])
    assert frames - len(recording.times) < 271 / 2
