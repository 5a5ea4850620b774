"""The virtual sensor: its clock, its answers and the values that it shows, and its service on a port."""

import dataclasses
import select
import socket
import threading
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.virtual_port import hit, is_ramp, take, wait_until
from validation.weiss import protocol, virtual
from validation.weiss.protocol import Command, MatrixInfo, decode_answer, decode_frame, encode_message, encode_request
from validation.weiss.sensor import PortError, Sensor
from validation.weiss.virtual import FAULTS, WTS_0614_34, Misbehaviour, PseudoTerminal, VirtualSensor, show_pattern

ZERO = show_pattern("zero")


def _parse(*pieces):
    parser = protocol.Parser(texels=84)
    return [message for piece in pieces for message in parser.feed(piece)]


def _ask(sensor, command, *values, now=0.0):
    (message,) = _parse(sensor.receive(encode_request(command, *values), now))
    return decode_answer(command, message.payload)[1]


def _stream(sensor, seconds, interval_ms=0):
    """Times of the frames from the start to this time, both included [ms]."""
    _ask(sensor, Command.START_PERIODIC_FRAMES, 0, interval_ms)
    return [decode_frame(message.payload).ticks for message in _parse(*sensor.take_due_frames(seconds + 1e-9))]


@pytest.mark.parametrize(("rate", "interval_ms", "frames"), [(271, 0, 272), (1, 0, 2), (1000, 0, 1001), (271, 100, 11)])
def test_frames_come_at_their_rate_or_interval(rate, interval_ms, frames):
    sensor = VirtualSensor(show_pattern("blob"), rate=rate)
    ticks = _stream(sensor, 1.0, interval_ms)
    assert len(ticks) == sensor.frames_sent == frames
    assert np.allclose(ticks, np.arange(frames) * (interval_ms or 1000 / rate), rtol=0, atol=1.001)


def test_no_frames_come_in_a_pause():
    ticks = _stream(VirtualSensor(ZERO, misbehaviour=Misbehaviour(pauses=((0.2, 0.7),))), 1.0)
    assert max(np.diff(ticks)) == pytest.approx(500, abs=5)
    assert not any(205 <= tick < 695 for tick in ticks)


@pytest.mark.parametrize(("now", "temperature"), [(0, 25), (1200 * np.log(2), 30), (1e6, 35)])
def test_the_pad_warms_up(now, temperature):
    assert _ask(VirtualSensor(ZERO), Command.TEMPERATURE, now=now) == (10 * temperature,)


@given(st.integers(0, 255).filter(lambda identifier: identifier != 0xAA), st.binary(max_size=20))
def test_any_request_gets_one_answer_of_its_own_identifier(identifier, payload):
    sensor = VirtualSensor(show_pattern("ramp"))
    request = encode_message(identifier, payload)
    requests, answers = _parse(request), _parse(sensor.receive(request, 0.0))
    assert [answer.identifier for answer in answers] == [found.identifier for found in requests]


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Misbehaviour(rates={"sabotage": 1}), "known faults: flip-bit"),
        (lambda: Misbehaviour(rates={"lose": 2}), r"0\.\.1"),
        (lambda: virtual.show_frames([]), "at least one"),
        (lambda: show_pattern("x"), "unknown pattern 'x'; known patterns: blob, ramp, corner, zero"),
        (lambda: virtual.show_recording([], np.zeros((0, 2))), "as many times as frames and at least one"),
        (lambda: virtual.show_recording([1.0], np.zeros((4, 2))), "as many times as frames and at least one"),
        (lambda: VirtualSensor(ZERO, rate=0), "rate"),
        (lambda: VirtualSensor(ZERO, active=[True] * 3), "84 texels, not 3"),
        (lambda: VirtualSensor(ZERO, tag="t" * 65), "at most 64 ASCII"),
        (lambda: VirtualSensor(ZERO, tag="größe"), "at most 64 ASCII"),
    ],
)
def test_bad_input_is_refused_with_what_is_known(make, reason):
    with pytest.raises(ValueError, match=reason):
        make()


@pytest.mark.parametrize(
    ("shape", "pitch", "name"),
    [
        ((6, 14), (3.4e-3, 3.4e-3), b"WTS 0614-34"),
        ((4, 8), (3.8e-3, 3.8e-3), b"WTS 0408-38"),
        ((16, 16), (0.9e-3, 2e-3), b"WTS 1616-09x20"),
    ],
)
def test_an_array_announces_itself(shape, pitch, name):
    matrix = MatrixInfo(*shape, *pitch, full_scale=4095)
    sensor = VirtualSensor(show_pattern("zero", matrix), matrix=matrix)
    assert _ask(sensor, Command.SENSOR_TYPE) == (name,)
    assert _ask(sensor, Command.MATRIX_INFO) == matrix.values


def test_masked_texels_read_zero_and_the_mask_is_told():
    active = np.arange(84) % 5 != 2
    sensor = VirtualSensor(lambda _: np.full(84, 700), active=active)
    (frame,) = _ask(sensor, Command.READ_SINGLE_FRAME, 0)
    assert np.array_equal(decode_frame(frame).counts, np.where(active, 700, 0))
    (data,) = _ask(sensor, Command.GET_MASK)
    assert data[0] == 0b01111011
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
    assert np.array_equal(bits, np.append(active, [0] * 4))


def test_patterns_are_what_they_are_called():
    matrix = dataclasses.replace(WTS_0614_34, columns=3, rows=4)
    order = np.arange(12)
    for time in (0.0, 0.7, 2.345):
        assert np.array_equal(show_pattern("zero", matrix)(time), 0 * order)
        assert np.array_equal(show_pattern("corner", matrix)(time), [2000] + [0] * 11)
        assert np.array_equal(show_pattern("ramp", matrix)(time), (40 * order + round(1000 * time)) % 4096)
        x, y = 1 + np.sin(2 * time), 1.5 * (1 + np.sin(time))
        blob = 3000 * np.exp(-((order % 3 - x) ** 2 + (order // 3 - y) ** 2) / 4)
        assert np.array_equal(show_pattern("blob", matrix)(time), np.rint(blob))


def test_a_playback_shows_each_frame_until_the_next_and_starts_again_after_the_last():
    times, counts = [10.0, 10.5, 11.5, 12.0], np.arange(8).reshape(4, 2)
    show, duration = virtual.show_recording(times, counts), 2.0 * 4 / 3  # the last one is shown for the mean step
    shown = [0.0, 0.49, 0.5, 1.49, 1.5, 1.99, 2.0, 2.6, duration + 0.01, 3 * duration + 0.6]
    assert np.array_equal([show(time) for time in shown], counts[[0, 0, 1, 1, 2, 2, 3, 3, 0, 1]])
    assert np.array_equal(virtual.show_recording([5.0], counts[:1])(3.0), counts[0])


@pytest.mark.parametrize("name", FAULTS)
@settings(max_examples=10)
@given(payload=st.binary(max_size=100), random=st.randoms(use_true_random=False))
def test_a_fault_changes_the_message_within_its_bounds(name, payload, random):
    message = encode_message(0x01, payload)
    damaged = hit(name, message, random)
    assert abs(len(damaged) - len(message)) <= max(40, len(message))
    if name not in {"change-bytes", "drop-bytes", "repeat-bytes", "wrong-size"}:  # these may leave it as it was
        assert damaged != message
    if name in {"extra-preamble", "false-head", "boot-text", "repeat"}:
        assert damaged.endswith(message)


def test_complete_frames_are_left_out_for_a_client_that_does_not_read(plug_in):
    port = plug_in(backlog_bytes=virtual.BACKLOG_BYTES, rate=5000.0)
    with serial.Serial(port.name) as client:
        client.write(encode_request(Command.START_PERIODIC_FRAMES, 0, 0))
        wait_until(lambda: port.sensor.frames_sent > 1000)
        port.unplug()
    assert port.left_out > 10


@pytest.mark.slow
def test_a_sensor_behind_a_network_port():
    stop = threading.Event()

    def run():
        peer, _ = server.accept()
        with peer:
            end = SimpleNamespace(
                send=peer.send, receive=lambda wait: peer.recv(4096) if select.select([peer], [], [], wait)[0] else b""
            )
            virtual.serve(VirtualSensor(show_pattern("ramp")), end, stop=stop)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=run)
        thread.start()
        try:
            with Sensor(f"socket://127.0.0.1:{server.getsockname()[1]}") as sensor:
                readings, gaps = take(sensor, 40)
        finally:
            stop.set()
            thread.join()
    assert gaps == []
    assert all(is_ramp(reading.counts) for reading in readings)


def test_a_sensor_on_an_existing_port():
    with closing(PseudoTerminal()) as cable, closing(virtual.SerialEnd(cable.name)) as end:
        cable.send(encode_request(Command.SENSOR_TYPE))
        virtual.serve(VirtualSensor(ZERO), end, seconds=0.3)
        (message,) = _parse(cable.receive(0))
    assert decode_answer(Command.SENSOR_TYPE, message.payload) == (0, (b"WTS 0614-34",))


def test_a_link_that_another_port_replaced_is_left_alone(tmp_path):
    link = tmp_path / "sensor"
    first = PseudoTerminal(link)
    with closing(PseudoTerminal(link)) as second:
        first.close()
        assert str(link.readlink()) == second.port
    assert not link.is_symlink()


def test_a_link_that_cannot_be_created_is_refused(tmp_path):
    with pytest.raises(PortError, match="cannot create a link to the port here: No such file"):
        PseudoTerminal(tmp_path / "nowhere" / "sensor")
