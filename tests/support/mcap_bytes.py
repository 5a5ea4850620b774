"""MCAP files and CDR messages as bytes, written and taken apart by their public specifications."""

import struct
from dataclasses import dataclass, field

from mcap.stream_reader import zstandard

MAGIC = b"\x89MCAP0\r\n"


def encode_cdr(*fields):
    """Bytes of a message in little-endian CDR.

    A field is the letter of its type, as `struct` names it, and its value; `s` is a string, a star after the letter
    makes a sequence.  Numbers are aligned to their size.
    """
    out = bytearray()

    def put(kind, value):
        out.extend(bytes(-len(out) % struct.calcsize(f"<{kind}")))
        out.extend(struct.pack(f"<{kind}", value))

    for kind, value in fields:
        if kind == "s":
            put("I", len(value.encode()) + 1)
            out.extend(value.encode() + b"\0")
        elif kind.endswith("*"):
            put("I", len(value))
            for each in value:
                put(kind[0], each)
        else:
            put(kind, value)
    return b"\0\1\0\0" + bytes(out)


def encode_header(seconds, nanoseconds, frame):
    """Fields of the header of a ROS 2 message."""
    return ("i", seconds), ("I", nanoseconds), ("s", frame)


def encode_record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def encode_text(text):
    return struct.pack("<I", len(text.encode())) + text.encode()


def encode_schema(number, name, definition=b"string data"):
    content = struct.pack("<H", number) + encode_text(name) + encode_text("ros2msg")
    return encode_record(3, content + struct.pack("<I", len(definition)) + definition)


def encode_channel(number, schema, topic, encoding="cdr"):
    content = struct.pack("<HH", number, schema) + encode_text(topic) + encode_text(encoding)
    return encode_record(4, content + struct.pack("<I", 0))


def encode_message(channel, sequence, logged, published, data):
    return encode_record(5, struct.pack("<HIQQ", channel, sequence, logged, published) + data)


def encode_chunk(records, *, compression="", crc=0, size=None):
    packed = zstandard.compress(records) if compression == "zstd" else records
    content = struct.pack("<QQQI", 0, 1, len(records) if size is None else size, crc) + encode_text(compression)
    return encode_record(6, content + struct.pack("<Q", len(packed)) + packed)


def encode_file(*records, complete=True):
    """Bytes of an MCAP file of these records, with its footer unless it is not complete."""
    head = MAGIC + encode_record(1, encode_text("ros2") + encode_text("by hand")) + b"".join(records)
    return head + (encode_record(15, bytes(4)) + encode_record(2, bytes(20)) + MAGIC if complete else b"")


@dataclass
class Contents:
    """What an MCAP file holds.

    Messages are channel topic, sequence, time of logging, time of publishing and data.
    """

    header: tuple = ()
    schemas: dict = field(default_factory=dict)
    channels: dict = field(default_factory=dict)
    messages: list = field(default_factory=list)
    metadata: dict = field(default_factory=dict)


class _Piece:
    def __init__(self, data):
        self.data, self.place = data, 0

    def take(self, kinds):
        values = struct.unpack_from(f"<{kinds}", self.data, self.place)
        self.place += struct.calcsize(f"<{kinds}")
        return values

    def take_bytes(self, length="I"):
        (size,) = self.take(length)
        self.place += size
        return self.data[self.place - size : self.place]

    def take_text(self):
        return self.take_bytes().decode()


def _split_records(data):
    place = 0
    while place < len(data):
        kind, size = struct.unpack_from("<BQ", data, place)
        yield kind, _Piece(data[place + 9 : place + 9 + size])
        place += 9 + size


def take_apart(data):
    """The contents of the bytes of an MCAP file that ends properly."""
    assert data.startswith(MAGIC)
    assert data.endswith(MAGIC)
    found = Contents()
    _collect(data[len(MAGIC) : -len(MAGIC)], found)
    return found


def _collect(data, found):
    for kind, piece in _split_records(data):
        if kind == 1:
            found.header = piece.take_text(), piece.take_text()
        elif kind == 3:
            (number,) = piece.take("H")
            found.schemas[number] = piece.take_text(), piece.take_text(), piece.take_text()
        elif kind == 4:
            number, schema = piece.take("HH")
            found.channels[number] = piece.take_text(), piece.take_text(), found.schemas[schema][0]
        elif kind == 5:
            channel, sequence, logged, published = piece.take("HIQQ")
            found.messages.append((found.channels[channel][0], sequence, logged, published, piece.data[piece.place :]))
        elif kind == 6:
            _, _, size, _ = piece.take("QQQI")
            compression = piece.take_text()
            packed = piece.take_bytes("Q")
            _collect(zstandard.decompress(packed, size) if compression == "zstd" else packed, found)
        elif kind == 12:
            name = piece.take_text()
            piece.take("I")
            found.metadata[name] = {piece.take_text(): piece.take_text()}
