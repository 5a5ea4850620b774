"""The driver against a virtual sensor on a pseudo-terminal."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from itertools import islice, pairwise

import numpy as np
import pytest
import serial

from validation.weiss.commands import Command, Status, request
from validation.weiss.continuity import Gap
from validation.weiss.inquiry import inquire
from validation.weiss.link import LinkLostError, PortError
from validation.weiss.messages import checksum, encode
from validation.weiss.sensor import NoAnswerError, Reading, Sensor, SensorError
from validation.weiss.serve import BACKLOG, PseudoTerminal, serve
from validation.weiss.virtual import WTS_0614_34, Misbehaviour, VirtualSensor, from_frames, pattern, playback


def _take(sensor, frames, **options):
    """That many readings, and the gaps between them."""
    readings, gaps = [], []
    stream = sensor.stream(**options)
    for event in stream:
        (gaps if isinstance(event, Gap) else readings).append(event)
        if len(readings) == frames:
            break
    stream.close()
    return readings, gaps


def _is_ramp(reading):
    """Texels of the ramp differ by 40 counts from one to the next, modulo 4096."""
    return bool((np.diff(reading.counts.astype(int)) % 4096 == 40).all())


def test_everything_that_can_be_asked(plug_in):
    with Sensor(plug_in().port) as sensor:
        assert sensor.matrix() == WTS_0614_34
        assert sensor.info().kind == 1
        assert sensor.sensor_type() == "WTS 0614-34"
        assert sensor.temperature() == pytest.approx(25, abs=0.2)
        sensor.set_threshold(123)
        sensor.set_gain(45)
        sensor.set_tag("left palm")
        assert (sensor.threshold(), sensor.gain(), sensor.tag()) == (123, 45, "left palm")
        assert sensor.ask(Command.LOOP, b"hello") == (b"hello",)
        with pytest.raises(SensorError, match=r"set threshold.*range error \(28\)"):
            sensor.set_threshold(5000)


def test_single_frames_raw_and_run_length_encoded(plug_in):
    with Sensor(plug_in(pattern("corner")).port) as sensor:
        raw, packed = sensor.single(), sensor.single(run_length=True)
        assert (raw.run_length, packed.run_length) == (False, True)
        assert raw.counts.tolist() == packed.counts.tolist() == [2000] + 83 * [0]
        sensor.tare()
        assert not sensor.single().counts.any()
        sensor.untare()
        sensor.set_threshold(500)
        assert sensor.single().counts[0] == 1500


@pytest.mark.parametrize("run_length", [False, True])
def test_frames_come_whole_and_at_their_rate(plug_in, run_length):
    bench = plug_in()
    with Sensor(bench.port) as sensor:
        readings, gaps = _take(sensor, 60, run_length=run_length)
    assert gaps == []
    assert all(_is_ramp(reading) and reading.run_length == run_length for reading in readings)
    span = readings[-1].time - readings[0].time
    assert 59 / span == pytest.approx(271, rel=0.02)
    assert readings[-1].host_time > readings[0].host_time
    assert sensor.counters.skipped == 0
    assert bench.sensor.next_due is None


def test_interval(plug_in):
    with Sensor(plug_in().port) as sensor:
        readings, gaps = _take(sensor, 11, interval_ms=10)
    assert gaps == []
    assert readings[-1].ticks - readings[0].ticks == pytest.approx(100, abs=1)


def test_commands_between_frames_lose_nothing(plug_in):
    with Sensor(plug_in().port) as sensor:
        stream = sensor.stream()
        first = list(islice(stream, 10))
        assert sensor.temperature() > 20
        rest = list(islice(stream, 50))
        stream.close()
    assert all(isinstance(event, Reading) for event in first + rest)
    assert np.diff([event.ticks for event in first + rest]).max() <= 4


def test_damage_on_the_line_shows_as_gaps_and_never_as_wrong_values(plug_in):
    wrong = Misbehaviour(rates={"change-bytes": 0.05, "lose": 0.05, "insert-noise": 0.03}, seed=3)
    with Sensor(plug_in(misbehaviour=wrong).port, timeout=0.1) as sensor:
        readings, gaps = _take(sensor, 120)
    assert all(_is_ramp(reading) for reading in readings)
    marked = {gap.after for gap in gaps}
    steps = [(a, b) for a, b in pairwise(readings) if b.ticks - a.ticks > 5]
    assert len(steps) > 4
    assert all(a.ticks in marked for a, b in steps)


def test_lost_answers_are_asked_for_again(plug_in):
    wrong = Misbehaviour(rates={"lose": 0.3}, seed=1)
    with Sensor(plug_in(misbehaviour=wrong).port, timeout=0.05) as sensor:
        assert [sensor.threshold() for _ in range(5)] == [0] * 5


def test_a_pause_is_a_gap_and_frames_go_on(plug_in):
    """However late the stream starts, 60 frames do not fit between two pauses."""
    wrong = Misbehaviour(pauses=tuple((start, start + 0.3) for start in np.arange(0.2, 20, 0.5)))
    with Sensor(plug_in(misbehaviour=wrong).port, timeout=0.1) as sensor:
        readings, gaps = _take(sensor, 60)
    assert max(after.ticks - before.ticks for before, after in pairwise(readings)) >= 300
    assert {"silence", "frames missing"} <= {gap.kind for gap in gaps}


def test_a_device_left_streaming_is_silenced_first(plug_in):
    bench = plug_in()
    with serial.Serial(bench.port) as other:
        other.write(request(Command.START_PERIODIC_FRAMES, 0, 0))
        time.sleep(0.1)
    with Sensor(bench.port) as sensor:
        assert bench.sensor.next_due is None
        assert _take(sensor, 20)[1] == []


def test_unplugged_and_plugged_in_again(plug_in, tmp_path):
    link = tmp_path / "sensor"
    first = plug_in(link=link)
    with Sensor(str(link)) as sensor:
        sensor.set_threshold(7)
        stream = sensor.stream(reconnect=5)
        list(islice(stream, 30))
        first.unplug()
        second = []
        threading.Timer(0.15, lambda: second.append(plug_in(link=link))).start()
        events = list(islice(stream, 60))
        (lost,) = [event for event in events if isinstance(event, Gap) and event.kind == "link lost"]
        assert 0.1 < lost.seconds < 5
        assert isinstance(events[-1], Reading)
        stream.close()
        assert sensor.threshold() == 7
        stream = sensor.stream()
        list(islice(stream, 3))
        second[0].unplug()
        with pytest.raises(LinkLostError, match="unplugged"):
            list(stream)


def test_a_consumer_that_sleeps_loses_frames_visibly(plug_in):
    with Sensor(plug_in().port, buffer_bytes=4000) as sensor:
        stream = sensor.stream()
        list(islice(stream, 10))
        time.sleep(0.2)
        events = list(islice(stream, 60))
        stream.close()
    assert {"overflow", "frames missing"} <= {event.kind for event in events if isinstance(event, Gap)}
    assert all(_is_ramp(event) for event in events if isinstance(event, Reading))


def test_a_client_that_does_not_read_makes_the_device_leave_out_whole_frames(plug_in):
    bench = plug_in(backlog=BACKLOG, rate=1000.0)
    with serial.Serial(bench.port) as client:
        client.write(request(Command.START_PERIODIC_FRAMES, 0, 0))
        time.sleep(0.4)
        bench.unplug()
    assert bench.left_out > 10


def test_a_second_client_is_turned_away(plug_in):
    bench = plug_in()
    with Sensor(bench.port), pytest.raises(PortError, match=r"another program has it open.*one client"):
        Sensor(bench.port)


def test_no_such_port_and_no_port_at_all(tmp_path):
    with pytest.raises(PortError, match="no such port; ports on this machine"):
        Sensor("/dev/ttyNONE9")
    plain = tmp_path / "file"
    plain.write_text("hello")
    with pytest.raises(PortError, match="not a serial port"):
        Sensor(str(plain))
    with pytest.raises(PortError, match="cannot be opened"):
        Sensor("nonsense://x")
    for name in (str(plain), "/dev/ttyNONE9", "nonsense://x"):
        with pytest.raises(PortError) as caught:
            Sensor(name)
        assert "\n" not in str(caught.value)


def test_something_else_on_the_port(answering):
    with answering(os.urandom(64)) as port, pytest.raises(NoAnswerError, match=r"bytes came and none"):
        Sensor(port, timeout=0.05)
    with answering(b"") as port, pytest.raises(NoAnswerError, match="nothing came back"):
        Sensor(port, timeout=0.05)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="changes the user, which needs root")
def test_permission_denied_names_the_group(plug_in):
    grp = pytest.importorskip("grp")
    port = plug_in().port
    os.chmod(port, 0o600)  # noqa: PTH101 -- a device
    group = grp.getgrgid(os.stat(port).st_gid).gr_name  # noqa: PTH116 -- a device
    os.seteuid(65534)
    try:
        with pytest.raises(PortError, match=f"no permission to open it.*usermod -aG {group}"):
            Sensor(port)
    finally:
        os.seteuid(0)


def test_a_public_script_that_reads_183_bytes_blindly_cannot_tell_the_difference(plug_in):
    with serial.Serial(plug_in(pattern("corner")).port, 115200, timeout=1) as client:
        for _ in range(3):
            client.write(bytes.fromhex("AAAAAA200100008F83"))
            answer = client.read(183)
            assert answer[:8] == bytes.fromhex("AAAAAA20AF000000")
            assert int.from_bytes(answer[13:15], "little") == 2000
            assert checksum(answer) == 0
        assert client.in_waiting == 0


class _TcpEnd:
    """The device's end of a TCP connection, as a serial server in the network has it."""

    def __init__(self):
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(5)
        self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self._peer = None

    def send(self, data):
        return self._peer.send(data)

    def receive(self, wait):
        if self._peer is None:
            self._peer, _ = self._listener.accept()
        self._peer.settimeout(max(wait, 1e-4))
        try:
            return self._peer.recv(4096)
        except TimeoutError:
            return b""

    def close(self):
        for each in (self._peer, self._listener):
            if each is not None:
                each.close()


def test_a_sensor_behind_a_network_port():
    end, stop = _TcpEnd(), threading.Event()
    thread = threading.Thread(target=serve, args=(VirtualSensor(pattern("ramp")), end), kwargs={"stop": stop})
    thread.start()
    try:
        with Sensor(end.url) as sensor:
            readings, gaps = _take(sensor, 40)
    finally:
        stop.set()
        thread.join()
        end.close()
    assert gaps == []
    assert all(_is_ramp(reading) for reading in readings)


def test_open_questions_are_answered(plug_in, monkeypatch):
    monkeypatch.setattr("validation.weiss.inquiry._FRAMES", 60)
    with Sensor(plug_in(pattern("corner")).port) as sensor:
        answers = inquire(sensor)
    assert answers["loop (0x06)"] == "answers with the bytes it was sent"
    assert "(assumed 1 ms)" in answers["clock"]
    assert 0.5 < float(answers["clock"].split()[0]) < 2
    assert "at most 0 counts" in answers["run length"]
    assert "texel 0, read as row 0, column 0" in answers["texel order"]
    wrong = Misbehaviour(refused={Command.GET_GAIN: Status.COMMAND_UNKNOWN})
    with Sensor(plug_in(misbehaviour=wrong).port) as sensor:
        assert "not as assumed" in inquire(sensor)["gain (0x37)"]


def test_refusals_are_named(plug_in):
    wrong = Misbehaviour(refused={Command.TEMPERATURE: Status.NO_SENSOR})
    with Sensor(plug_in(misbehaviour=wrong).port) as sensor:
        with pytest.raises(SensorError, match=r"refused `temperature`: no sensor \(2\)"):
            sensor.temperature()
        with pytest.raises(SensorError, match=r"not supported \(5\)"):
            sensor.ask(Command.GET_MASK)


def test_an_answer_laid_out_otherwise_is_an_error_of_that_question_alone(plug_in, monkeypatch):
    """The layouts of threshold and gain are assumed; a device that differs must still be recorded."""
    bench = plug_in()
    with Sensor(bench.port) as sensor:
        monkeypatch.setitem(bench.sensor.__dict__, "_answer", lambda *_: encode(Command.GET_GAIN, b"\0\0\1\2\3"))
        with pytest.raises(SensorError, match=r"answer to `get gain` is not as assumed: .* 3 bytes"):
            sensor.gain()
        monkeypatch.undo()
        assert sensor.threshold() == 0


def test_the_name_of_a_port_is_left_to_who_took_it_over(tmp_path):
    link = tmp_path / "sensor"
    first = PseudoTerminal(link)
    with PseudoTerminal(link) as second:
        first.close()
        assert str(link.readlink()) == second.port
    assert not link.is_symlink()


def test_control_c_stops_the_device(plug_in):
    bench = plug_in()
    code = (
        "import sys\nfrom validation.weiss.sensor import Sensor\n"
        "with Sensor(sys.argv[1]) as s:\n"
        "    for n, _ in enumerate(s.stream()):\n"
        "        if n == 5: print('go', flush=True)\n"
    )
    run = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", code, bench.port], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert run.stdout.readline() == "go\n"
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=10)
    assert errors.rstrip().endswith("KeyboardInterrupt")
    assert bench.sensor.next_due is None


def test_what_is_shown(plug_in):
    counts = np.arange(3 * 84).reshape(3, 84)
    show = playback([10.0, 10.5, 11.0], counts)
    assert [int(np.asarray(show(t))[0]) for t in (0, 0.4, 0.5, 1.2, 1.6)] == [0, 0, 84, 168, 0]
    assert int(np.asarray(playback([0, 1], counts[:2], loop=False)(9))[0]) == 84
    frames = from_frames(Reading(counts=row, ticks=0, host_time=0, run_length=False) for row in counts)
    with Sensor(plug_in(frames).port) as sensor:
        first, second, third, fourth = (sensor.single().counts.tolist() for _ in range(4))
    assert [first, second, third] == [counts[1].tolist(), counts[2].tolist(), counts[2].tolist()]
    assert fourth == third


def test_bad_input_to_the_virtual_sensor():
    with pytest.raises(ValueError, match="known patterns: blob"):
        pattern("nothing")
    with pytest.raises(ValueError, match="known faults: flip-bit"):
        Misbehaviour(rates={"sabotage": 1})
    with pytest.raises(ValueError, match=r"0\.\.1"):
        Misbehaviour(rates={"lose": 2})
    with pytest.raises(ValueError, match="at least one"):
        playback([], [])
    with pytest.raises(ValueError, match="at least one"):
        from_frames([])
    with pytest.raises(ValueError, match="rate"):
        VirtualSensor(pattern("zero"), rate=0)
