"""Messages: published examples, and damage that the checksum detects."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.commands import Command, encode_request
from validation.weiss.messages import PREAMBLE, compute_checksum, encode_message
from validation.weiss.parser import Parser

PUBLISHED = {
    "AA AA AA 01 02 00 12 34 6D 66": encode_message(0x01, b"\x12\x34"),
    "AA AA AA 01 00 00 E8 10": encode_message(0x01),
    "AA AA AA 06 00 00 97 26": encode_request(Command.LOOP),
    "AA AA AA 20 01 00 00 8F 83": encode_request(Command.READ_SINGLE_FRAME, 0),
    "AA AA AA 20 01 00 01 AE 93": encode_request(Command.READ_SINGLE_FRAME, 1),
    "AA AA AA 21 03 00 00 00 00 F5 5C": encode_request(Command.START_PERIODIC_FRAMES, 0, 0),
    "AA AA AA 21 03 00 01 00 00 57 36": encode_request(Command.START_PERIODIC_FRAMES, 1, 0),
    "AA AA AA 22 00 00 0E 76": encode_request(Command.STOP_PERIODIC_FRAMES),
    "AA AA AA 30 00 00 CA CF": encode_request(Command.MATRIX_INFO),
    "AA AA AA 38 00 00 EA CF": encode_request(Command.SENSOR_TYPE),
    "AA AA AA 46 00 00 86 B7": encode_request(Command.TEMPERATURE),
    "AA AA AA 50 00 00 DB 87": encode_request(Command.SYSTEM_INFO),
    "AA AA AA 52 00 00 9F 52": encode_request(Command.GET_TAG),
    "AA AA AA 35 00 00 F1 2C": encode_request(Command.GET_THRESHOLD),
    "AA AA AA 37 00 00 B5 F9": encode_request(Command.GET_GAIN),
}
#: Identifiers of messages that hold no frame: of these a parser accepts any payload.
IDENTIFIERS = st.integers(0, 255).filter(lambda identifier: identifier not in (0x00, 0x20, 0xAA))


def _find_messages(data):
    parser = Parser()
    return parser.feed(data) + parser.finish()


@pytest.mark.parametrize(("expected", "made"), PUBLISHED.items())
def test_messages_equal_the_published_examples(expected, made):
    assert made == bytes.fromhex(expected)
    assert compute_checksum(made) == 0


def test_checksums_equal_the_published_values():
    assert compute_checksum(PREAMBLE) == 0x50F5
    assert compute_checksum(b"123456789") == 0x6EB4


@given(st.binary(max_size=60), st.integers(0, 60))
def test_a_checksum_can_be_continued_from_the_bytes_before(data, cut):
    assert compute_checksum(data[cut:], compute_checksum(data[:cut])) == compute_checksum(data)


@given(st.binary(max_size=200), IDENTIFIERS)
def test_encoded_messages_are_found_again(payload, identifier):
    (message,) = _find_messages(encode_message(identifier, payload))
    assert (message.identifier, message.payload, message.skipped) == (identifier, payload, 0)


@given(st.binary(max_size=40), IDENTIFIERS, st.data())
def test_any_damage_within_one_byte_is_detected(payload, identifier, data):
    message = bytearray(encode_message(identifier, payload))
    place = data.draw(st.integers(0, len(message) - 1))
    message[place] ^= data.draw(st.integers(1, 255))
    assert compute_checksum(bytes(message)) != 0
    assert all(found.payload != payload for found in _find_messages(bytes(message)))


def test_some_damage_of_two_bytes_keeps_the_checksum():
    """The reason why the parser checks the content of frames as well."""
    good = encode_message(0x06, b"\x00\x00\x00\x00")
    damaged = bytearray(good)
    damaged[7] ^= 0x89
    damaged[8] ^= 0xA1
    assert bytes(damaged) != good
    assert compute_checksum(bytes(damaged)) == 0


def test_impossible_messages_are_refused():
    for identifier in (0xAA, -1, 256):
        with pytest.raises(ValueError, match=r"0\.\.255 and not 0xAA"):
            encode_message(identifier)
    with pytest.raises(ValueError, match="at most 65535 bytes, not 65536"):
        encode_message(1, bytes(65536))
