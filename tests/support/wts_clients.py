"""Clients of a WTS sensor in the style of public ones, written from the description of the protocol.

They share no code with the product: they have their own checksum and read as their kind does.
"""

import struct
import time

import serial


def checksum(data):
    """Checksum of a message, bit by bit: the table of the plain polynomial 0x1021, shifted as if reflected."""
    state = 0xFFFF
    for byte in data:
        entry = ((state ^ byte) & 0xFF) << 8
        for _ in range(8):
            entry = (entry << 1) ^ (0x1021 if entry & 0x8000 else 0)
        state = (entry & 0xFFFF) ^ (state >> 8)
    return state


def make_message(identifier, payload=b""):
    body = b"\xaa\xaa\xaa" + struct.pack("<BH", identifier, len(payload)) + payload
    return body + struct.pack("<H", checksum(body))


class PollingClient:
    """Asks for single frames with a short time-out, reads a fixed number of bytes and never looks for a start."""

    def __init__(self, name, texels=84, timeout=0.05):
        self._port = serial.Serial(name, 115200, timeout=timeout)
        self._texels = texels

    def read(self):
        """Counts of a frame; None if it did not arrive in time as a whole."""
        self._port.reset_input_buffer()
        self._port.write(make_message(0x20, b"\0"))
        answer = self._port.read(15 + 2 * self._texels)
        if len(answer) < 15 + 2 * self._texels or checksum(answer) or answer[3] != 0x20 or answer[6:8] != b"\0\0":
            return None
        return struct.unpack_from(f"<{self._texels}H", answer, 13)

    def close(self):
        self._port.close()


class MessageClient:
    """Reads message by message from the head on; skips bytes until three AA in a row."""

    def __init__(self, name, timeout=5.0):
        self._port = serial.Serial(name, 115200, timeout=0.2)
        self._timeout = timeout

    def close(self):
        self._port.close()

    def send(self, identifier, payload=b""):
        self._port.write(make_message(identifier, payload))

    def receive(self, wanted):
        """Payload of the next message of an identifier; other messages are skipped."""
        deadline = time.monotonic() + self._timeout
        seen = 0
        while time.monotonic() < deadline:
            byte = self._port.read(1)
            seen = seen + 1 if byte == b"\xaa" else 0
            if seen < 3:
                continue
            seen = 0
            head = self._port.read(3)
            identifier, size = struct.unpack("<BH", head)
            rest = self._port.read(size + 2)
            if identifier == wanted and not checksum(b"\xaa\xaa\xaa" + head + rest):
                return rest[:-2]
        raise TimeoutError(f"no message {wanted:#04x}")

    def ask(self, identifier, payload=b""):
        """Data of the answer to a command, without its status."""
        self.send(identifier, payload)
        answer = self.receive(identifier)
        assert answer[:2] == b"\0\0", answer
        return answer[2:]


def wait_for_tag(client):
    """Start as a driver does that names itself after the device, which must have a tag."""
    tag = client.ask(0x52).decode("ascii")
    assert tag, "the device has no tag"
    columns, rows, width, height, full_scale = struct.unpack("<5H", client.ask(0x30))
    return tag, (columns, rows), (width, height), full_scale


def expand(units):
    """Counts of run-length units: low 12 bits the count, high 4 bits how often."""
    return [unit & 0xFFF for unit in units for _ in range(unit >> 12)]


def stream_run_length(client, frames):
    """Times [ms] and counts of that many frames that the device sends run-length encoded on its own."""
    client.ask(0x21, struct.pack("<BH", 1, 0))
    found = []
    while len(found) < frames:
        payload = client.receive(0x00)
        ticks, flags = struct.unpack_from("<IB", payload)
        assert flags == 1
        found.append((ticks, expand(struct.unpack(f"<{(len(payload) - 5) // 2}H", payload[5:]))))
    client.send(0x22)
    client.receive(0x22)
    return found
