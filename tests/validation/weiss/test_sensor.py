"""The driver against a virtual sensor on a pseudo-terminal."""

import errno
from itertools import islice, pairwise

import numpy as np
import pytest
import serial

from tests.support.virtual_port import answer_always, is_ramp, take, wait_until
from validation.weiss.inquiry import inquire
from validation.weiss.protocol import Command, Reading, Status, encode_message, encode_request
from validation.weiss.sensor import LinkLostError, NoAnswerError, PortError, Sensor, SensorError
from validation.weiss.stream import Gap
from validation.weiss.virtual import WTS_0614_34, Misbehaviour, show_pattern

#: Time for an answer on a machine that is busy with other tests [s].
_LONG = 30.0


def test_everything_that_can_be_asked(plug_in):
    with Sensor(plug_in().name) as sensor:
        assert sensor.read_matrix() == WTS_0614_34
        assert sensor.read_info().kind == 1
        assert sensor.read_type() == "WTS 0614-34"
        assert 25 <= sensor.read_temperature() < 35
        sensor.set_threshold(123)
        sensor.set_gain(45)
        sensor.set_tag("left palm")
        assert (sensor.read_threshold(), sensor.read_gain(), sensor.read_tag()) == (123, 45, "left palm")
        assert sensor.ask(Command.LOOP, b"hello") == (b"hello",)


def test_single_frames_raw_and_run_length_encoded(plug_in):
    with Sensor(plug_in(show_pattern("corner")).name) as sensor:
        raw, packed = sensor.read_frame(), sensor.read_frame(run_length=True)
        assert (raw.run_length, packed.run_length) == (False, True)
        assert raw.counts.tolist() == packed.counts.tolist() == [2000] + 83 * [0]
        sensor.tare()
        assert not sensor.read_frame().counts.any()
        sensor.untare()
        sensor.set_threshold(500)
        assert sensor.read_frame().counts[0] == 1500


@pytest.mark.parametrize("run_length", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_stream_is_complete_and_has_the_rate_of_the_device(plug_in, run_length):
    port = plug_in()
    with Sensor(port.name, timeout=_LONG) as sensor:
        readings, gaps = take(sensor, 60, run_length=run_length)
    assert gaps == []
    assert all(is_ramp(reading.counts) and reading.run_length == run_length for reading in readings)
    span = readings[-1].time - readings[0].time
    assert 59 / span == pytest.approx(271, rel=0.02)
    assert readings[-1].host_time > readings[0].host_time
    assert sensor.parser.bytes_skipped == 0
    assert port.sensor.next_due == np.inf


def test_commands_between_frames_lose_nothing(plug_in):
    with Sensor(plug_in().name, timeout=_LONG) as sensor:
        stream = sensor.stream()
        first = list(islice(stream, 10))
        assert sensor.read_temperature() > 20
        rest = list(islice(stream, 50))
        stream.close()
    assert all(isinstance(event, Reading) for event in first + rest)
    assert np.diff([event.ticks for event in first + rest]).max() <= 4


def test_damage_on_the_line_becomes_gaps_and_never_wrong_values(plug_in):
    wrong = Misbehaviour(rates={"change-bytes": 0.05, "lose": 0.05, "insert-noise": 0.03}, seed=3)
    with Sensor(plug_in(misbehaviour=wrong).name, timeout=0.1) as sensor:
        readings, gaps = take(sensor, 120)
    assert all(is_ramp(reading.counts) for reading in readings)
    marked = {gap.after for gap in gaps}
    steps = [(a, b) for a, b in pairwise(readings) if b.ticks - a.ticks > 5]
    assert len(steps) > 4
    assert all(a.ticks in marked for a, b in steps)


@pytest.mark.slow
def test_a_command_is_repeated_when_its_answer_is_lost(plug_in):
    wrong = Misbehaviour(rates={"lose": 0.3}, seed=1)
    with Sensor(plug_in(misbehaviour=wrong).name, timeout=0.05) as sensor:
        assert [sensor.read_threshold() for _ in range(5)] == [0] * 5


@pytest.mark.slow
def test_a_pause_of_the_device_becomes_gaps_and_the_stream_goes_on(plug_in):
    """However late the stream starts, 70 frames do not fit between two pauses."""
    wrong = Misbehaviour(pauses=tuple((start, start + 0.3) for start in np.arange(0.2, 30, 0.5)))
    with Sensor(plug_in(misbehaviour=wrong).name, timeout=0.05) as sensor:
        readings, gaps = take(sensor, 70)
    assert max(after.ticks - before.ticks for before, after in pairwise(readings)) >= 300
    assert {"silence", "frames missing"} <= {gap.kind for gap in gaps}


def test_a_stream_that_another_client_left_running_is_stopped(plug_in):
    port = plug_in()
    with serial.Serial(port.name) as other:
        other.write(encode_request(Command.START_PERIODIC_FRAMES, 0, 0))
        wait_until(lambda: port.sensor.frames_sent > 10)
    with Sensor(port.name, timeout=_LONG) as sensor:
        assert port.sensor.next_due == np.inf
        assert take(sensor, 20)[1] == []


@pytest.mark.slow
def test_a_port_that_comes_back_is_opened_again_with_the_settings_made(plug_in, tmp_path):
    link = tmp_path / "sensor"
    first, attempts = plug_in(link=link), iter(range(100))
    with Sensor(str(link)) as sensor:
        open_link = sensor._open_link

        def open_later():
            """Fail twice, as a port that is still away does."""
            if next(attempts) == 2:
                plug_in(link=link)
            return open_link()

        sensor._open_link = open_later
        sensor.set_threshold(7)
        stream = sensor.stream(reconnect=_LONG)
        list(islice(stream, 30))
        first.unplug()
        events = list(islice(stream, 60))
        stream.close()
        assert sensor.read_threshold() == 7
    (lost,) = [event for event in events if isinstance(event, Gap) and event.kind == "link lost"]
    assert 0 < lost.seconds < _LONG
    assert next(attempts) >= 3
    assert isinstance(events[-1], Reading)


def test_a_port_that_stays_away_ends_the_stream(plug_in):
    port = plug_in()
    with Sensor(port.name) as sensor:
        stream = sensor.stream()
        list(islice(stream, 3))
        port.unplug()
        with pytest.raises(LinkLostError, match="unplugged"):
            list(stream)


@pytest.mark.parametrize(
    ("sent", "fault"),
    [pytest.param(bytes(range(64)), "bytes came and none", marks=pytest.mark.slow), (b"", "nothing came back")],
)
def test_errors_distinguish_another_device_on_the_port_from_none(sent, fault):
    pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")
    with answer_always(sent) as port, pytest.raises(NoAnswerError, match=fault):
        Sensor(port, timeout=0.1)


def test_a_refused_command_is_named_with_its_status(plug_in):
    wrong = Misbehaviour(refused={Command.TEMPERATURE: Status.NO_SENSOR})
    with Sensor(plug_in(misbehaviour=wrong).name) as sensor:
        with pytest.raises(SensorError, match=r"refused `temperature`: no sensor \(2\)"):
            sensor.read_temperature()
        with pytest.raises(SensorError, match=r"set threshold.*range error \(28\)"):
            sensor.set_threshold(5000)
        with pytest.raises(SensorError, match=r"not supported \(5\)"):
            sensor.ask(Command.SET_MASK_WINDOW)


@pytest.mark.parametrize(
    ("command", "data", "fault"),
    [
        (Command.GET_GAIN, b"\1\2\3", r"answer to `get gain` is not as assumed: .* 3 bytes"),
        *[(Command.GET_MASK, data, "no mask of 84 texels") for data in (b"", bytes(11), b"\xff" * 11, b"\1" * 12)],
    ],
)
def test_an_answer_in_another_form_fails_that_question_alone(plug_in, monkeypatch, command, data, fault):
    """Some forms are assumed; a device that differs must still be recorded."""
    port = plug_in()
    answer, other = port.sensor._answer, encode_message(command, b"\0\0" + data)
    with Sensor(port.name) as sensor:
        monkeypatch.setattr(
            port.sensor, "_answer", lambda asked, now: other if asked.identifier == command else answer(asked, now)
        )
        with pytest.raises(SensorError, match=fault):
            sensor.read_gain() if command == Command.GET_GAIN else sensor.read_mask()
        assert sensor.read_threshold() == 0


def test_control_c_stops_the_device(plug_in):
    port = plug_in()

    def run():
        with Sensor(port.name, timeout=_LONG) as sensor:
            stream = sensor.stream()
            next(stream)
            assert port.sensor.next_due < np.inf
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run()
    assert port.sensor.next_due == np.inf


@pytest.mark.slow
def test_a_slow_consumer_loses_frames_and_sees_the_gap(plug_in):
    with Sensor(plug_in().name, buffer_bytes=4000) as sensor:
        stream = sensor.stream()
        next(stream)
        wait_until(lambda: sensor._link._lost > 2000)
        events = [next(stream) for _ in range(160)]  # gaps are known once the period of the device is
        stream.close()
    assert {"overflow", "frames missing"} <= {event.kind for event in events if isinstance(event, Gap)}
    assert all(is_ramp(event.counts) for event in events if isinstance(event, Reading))


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("/dev/ttyNONE9", "no such port; ports on this machine"),
        (__file__, "not a serial port"),
        ("nonsense://x", "cannot be opened"),
    ],
)
def test_a_name_that_is_no_port_is_refused_in_one_line(name, fault):
    with pytest.raises(PortError, match=fault) as caught:
        Sensor(name)
    assert "\n" not in str(caught.value)


def test_permission_denied_names_the_group(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortError, match=f"no permission to open it.*usermod -aG {tmp_path.group()}"):
        Sensor(str(tmp_path))


@pytest.mark.slow
def test_open_questions_are_answered_and_one_without_an_answer_does_not_end_the_others(plug_in, monkeypatch):
    monkeypatch.setattr("validation.weiss.inquiry._CLOCK_FRAMES", 60)
    wrong = Misbehaviour(refused={Command.GET_GAIN: Status.COMMAND_UNKNOWN})
    port = plug_in(show_pattern("corner"), misbehaviour=wrong)
    answer = port.sensor._answer
    monkeypatch.setattr(
        port.sensor, "_answer", lambda asked, now: b"" if asked.identifier == Command.GET_TAG else answer(asked, now)
    )
    with Sensor(port.name, timeout=0.1) as sensor:
        answers = inquire(sensor)
    assert answers["loop (0x06)"] == "answers with the bytes it was sent"
    assert "(assumed 1 ms)" in answers["clock"]
    assert "at most 0 counts" in answers["run length"]
    assert "texel 0, read as row 0, column 0" in answers["texel order"]
    assert "not as assumed" in answers["gain (0x37)"]
    assert "no answer to `get tag`" in answers["device tag (0x52)"]
