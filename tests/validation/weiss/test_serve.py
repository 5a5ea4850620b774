"""A virtual sensor on a pseudo-terminal or behind a network port."""

import socket
import threading

import pytest
import serial

from tests.support.virtual_port import is_ramp, take, wait_until
from validation.weiss.link import PortError
from validation.weiss.protocol import Command, compute_checksum, encode_request
from validation.weiss.sensor import Sensor
from validation.weiss.serve import BACKLOG_BYTES, PseudoTerminal, serve
from validation.weiss.virtual import VirtualSensor, show_pattern

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")


def test_complete_frames_are_left_out_for_a_client_that_does_not_read(plug_in):
    port = plug_in(backlog_bytes=BACKLOG_BYTES, rate=5000.0)
    with serial.Serial(port.name) as client:
        client.write(encode_request(Command.START_PERIODIC_FRAMES, 0, 0))
        wait_until(lambda: port.sensor.frames_sent > 1000)
        port.unplug()
    assert port.left_out > 10


def test_a_public_script_that_reads_183_bytes_at_a_time_works(plug_in):
    with serial.Serial(plug_in(show_pattern("corner")).name, 115200, timeout=30) as client:
        for _ in range(3):
            client.write(bytes.fromhex("AAAAAA200100008F83"))
            answer = client.read(183)
            assert answer[:8] == bytes.fromhex("AAAAAA20AF000000")
            assert int.from_bytes(answer[13:15], "little") == 2000
            assert compute_checksum(answer) == 0
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
    thread = threading.Thread(target=serve, args=(VirtualSensor(show_pattern("ramp")), end), kwargs={"stop": stop})
    thread.start()
    try:
        with Sensor(end.url) as sensor:
            readings, gaps = take(sensor, 40)
    finally:
        stop.set()
        thread.join()
        end.close()
    assert gaps == []
    assert all(is_ramp(reading.counts) for reading in readings)


def test_a_link_that_another_port_replaced_is_left_alone(tmp_path):
    link = tmp_path / "sensor"
    first = PseudoTerminal(link)
    with PseudoTerminal(link) as second:
        first.close()
        assert str(link.readlink()) == second.port
    assert not link.is_symlink()


def test_a_link_that_cannot_be_created_is_refused(tmp_path):
    with pytest.raises(PortError, match="cannot create a link to the port here: No such file"):
        PseudoTerminal(tmp_path / "nowhere" / "sensor")


def test_the_run_ends_after_its_time():
    with PseudoTerminal() as end:
        assert serve(VirtualSensor(show_pattern("zero")), end, seconds=0.0) == 0
