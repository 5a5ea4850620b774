"""Reads `.dsa` files: frames of the Weiss arrays in a SCHUNK SDH-2 hand.

The format is bzip2-compressed XML, as defined by Peter Kiechle (tactile-sensors, University of Innsbruck, 2015); the
Weiss DSA-Explorer uses another format.  A frame is hexadecimal text of eight digits per token.  A token t is an
IEEE-754 single-precision number, most significant digit first: t >= 0 is the count of one texel, t < 0 stands for |t|
consecutive texels that read zero.  The texels of all arrays of the hand follow one another, x fastest, then y, then
array.

The reader checks the checksums of bzip2, the XML schema, the stated numbers of elements, the number of texels in each
frame, ranges of values, masks and the order of time stamps.  It refuses a file that fails a check, with the place in
the error message.  The file is read as a stream, and limits bound the memory for any content.  Document type
declarations are refused, because entities in them can expand without bound.
"""

from __future__ import annotations

import bz2
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings.recording import (
    BoolArray,
    RecordedArray,
    Recording,
    RecordingError,
    Setup,
    convert_to_utc,
    hash_contents,
    open_recorded,
)

FrameArray = npt.NDArray[np.int16]
#: Function that raises a `RecordingError`: path of the file, place in the file and the given text.
Fail = Callable[[str], NoReturn]

#: Tags of the XML elements that describe one texel array; all are required.
MATRIX_FIELDS = (
    *("cells_x", "cells_y", "texel_width", "texel_height", "static_mask", "dynamic_mask"),
    *("matrix_center_x", "matrix_center_y", "matrix_center_z", "theta_x", "theta_y", "theta_z"),
    *("output_unit", "fullscale", "hw_revision", "one_wire_uid"),
)


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a file may hold at most, several times what an SDH-2 hand sends in an hour.

    Attributes:
        cells: Number of rows, and of columns, of an array; the arrays of an SDH-2 hand have at most 14 [-].
        xml_bytes: Number of bytes of XML that a file may unpack to, a limit on memory and time.
        values: Number of counts, frames times texels: one hour of the 486 texels of a hand at 34 frames/s [-].
        channels: Number of temperature channels [-].
        readings: Number of readings of each temperature channel [-].
        markup_bytes: Number of consecutive bytes of XML without a tag or text, which the XML parser may have to hold in
            memory.
        text: Number of characters in one XML element; a frame of an SDH-2 hand in which no texel is zero takes 5 000
            [-].
        arrays: Number of texel arrays; an SDH-2 hand has 6 [-].
        piece_bytes: Number of bytes that are read from the file, or unpacked, at a time, which bounds the memory in
            use.
    """

    cells: int = 64
    xml_bytes: int = 512 * 2**20
    values: int = 60_000_000
    channels: int = 64
    readings: int = 100_000
    markup_bytes: int = 2**20
    text: int = 2**16
    arrays: int = 16
    piece_bytes: int = 2**16


LIMITS = Limits()

#: Largest accepted full scale of an array [counts]: counts are stored as signed 16 bit numbers.
_LARGEST_FULL_SCALE = int(np.iinfo(np.int16).max)
#: Number of hexadecimal digits of one token of a frame, an IEEE-754 single-precision number.
_TOKEN_DIGITS = 8
_METRES_PER_MILLIMETRE = 1e-3
#: Patterns of the accepted whole numbers and decimal numbers, which limit the number of digits.
_WHOLE_NUMBER = re.compile(r"[0-9]{1,15}")
_NUMBER = re.compile(r"[+-]?[0-9]{1,15}(\.[0-9]{0,15})?([eE][+-]?[0-9]{1,2})?")
_SECONDS_PER_MILLISECOND = 1e-3
_NANOSECONDS_PER_MILLISECOND = 1_000_000

#: Required child elements of each XML element, by the path of the parent.  Elements in `_COUNT_OF` may occur any number
#: of times, the others exactly once.
_SCHEMA: Mapping[str, tuple[str, ...]] = {
    "": ("root",),
    "root": ("sensor", "data"),
    "root/sensor": ("generated_by", "hw_revision", "serial_nr", "num_matrices", "converter_resolution", "matrix"),
    "root/sensor/matrix": MATRIX_FIELDS,
    "root/data": ("frame_count", "frame"),
    "root/data/frame": ("time_stamp", "frame_data"),
    "root/temperatures": ("temp_count", "temp"),
    "root/temperatures/temp": ("time_stamp", "temp_data"),
    "root/joint_angles": ("angle_count", "angle"),
    "root/joint_angles/angle": ("time_stamp", "angle_data"),
}
#: Optional child elements of XML elements, by the path of the parent.
_OPTIONAL: Mapping[str, tuple[str, ...]] = {"root": ("temperatures", "joint_angles")}
#: For each XML element that may be repeated, the element that states the number of repetitions.  Repeated elements
#: have an attribute `index`.
_COUNT_OF: Mapping[str, str] = {
    "matrix": "num_matrices",
    "frame": "frame_count",
    "temp": "temp_count",
    "angle": "angle_count",
}


def read(path: str | Path) -> Recording:
    """Read a recording of an SDH-2 hand from a `.dsa` file.

    Args:
        path: The file.

    Raises:
        RecordingError: If the file is missing, damaged, of another format, or larger than the limits of this module.
    """
    path = Path(path)
    collector = _Collector(path)
    _XmlReader(collector).read(unpack_bzip2(path, limit=LIMITS.xml_bytes))
    return collector.make_recording()


class _Collector:
    """Collects the content of the XML elements of one file, in the order in which the elements end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.place = "start of the file"
        self.arrays: list[RecordedArray] = []
        self.serial = ""
        #: Largest possible count of each of the n texels of all arrays, shape (n,); None before the end of `<sensor>`.
        self.limits: FrameArray | None = None
        self.frames: list[FrameArray] = []
        self.stamps: list[int] = []
        self.temperatures: list[list[float]] = []
        self.temperature_stamps: list[int] = []

    def add(self, element: str, fields: Mapping[str, str]) -> None:
        """Read the content of one XML element that agrees with the schema.

        Args:
            element: Path of the element, such as `root/data/frame`.
            fields: Texts of the child elements, by tag.
        """
        match element:
            case "root/sensor/matrix":
                name = f"array {len(self.arrays)}"
                if len(self.arrays) == LIMITS.arrays or self.limits is not None:
                    self.fail(f"unexpected {name}; expected at most {LIMITS.arrays}, before the frames")
                self.arrays.append(_read_array(fields, name, self.fail))
            case "root/sensor":
                self.serial = fields["serial_nr"].strip()
                self.limits = np.concatenate([_limit_counts(array) for array in self.arrays])
            case "root/data/frame":
                self._add_frame(fields)
            case "root/temperatures/temp":
                self._add_temperature(fields)

    def make_recording(self) -> Recording:
        """Make a recording from the content collected from the whole file."""
        if not self.frames:
            self.fail("no frames; expected at least one")
        first = self.stamps[0]
        try:
            started = convert_to_utc(first * _NANOSECONDS_PER_MILLISECOND)
        except OverflowError:
            self.fail(f"time stamp {first} ms; expected milliseconds since 1970")
        ends = np.cumsum([array.texels.count for array in self.arrays])
        parts = np.split(np.stack(self.frames), ends[:-1], axis=1)
        digest = hash_contents(self.path)
        return Recording(
            path=self.path,
            sha256=digest,
            serial=self.serial,
            started=started,
            times=(np.array(self.stamps) - first) * _SECONDS_PER_MILLISECOND,
            arrays=tuple(
                replace(array, counts=part.astype(np.int32)) for array, part in zip(self.arrays, parts, strict=True)
            ),
            temperatures=np.array(self.temperatures or np.empty((0, 0)), dtype=float),
            temperature_times=(np.array(self.temperature_stamps, dtype=float) - first) * _SECONDS_PER_MILLISECOND,
            setup=Setup(source=self.path.name, source_sha256=digest),
        )

    def fail(self, fault: str) -> NoReturn:
        """Raise a `RecordingError` with the path of the file, the place in the file and a description of the fault."""
        raise RecordingError(f"{self.path}: {self.place}: {fault}")

    def _add_frame(self, fields: Mapping[str, str]) -> None:
        if self.limits is None:
            self.fail("a frame before the description of the sensor; expected <sensor> first")
        if (len(self.frames) + 1) * len(self.limits) > LIMITS.values:
            self.fail(f"more than the {LIMITS.values} values accepted, frames times texels")
        self.stamps.append(self._read_stamp(fields, self.stamps))
        self.frames.append(decode_counts(fields["frame_data"], self.limits, self.fail))

    def _add_temperature(self, fields: Mapping[str, str]) -> None:
        readings = [_read_number(part, "temp_data", self.fail) for part in fields["temp_data"].split(",")]
        if self.temperatures and len(readings) != len(self.temperatures[0]):
            self.fail(f"{len(readings)} temperatures; expected {len(self.temperatures[0])} as before")
        if len(readings) > LIMITS.channels or len(self.temperatures) == LIMITS.readings:
            self.fail(f"more temperatures than the {LIMITS.readings} readings of {LIMITS.channels} channels accepted")
        self.temperature_stamps.append(self._read_stamp(fields, self.temperature_stamps))
        self.temperatures.append(readings)

    def _read_stamp(self, fields: Mapping[str, str], before: list[int]) -> int:
        """Read the time stamp of an element [ms], which must not be smaller than the last of the stamps in `before`."""
        stamp = _read_whole_number(fields["time_stamp"], "time_stamp", self.fail)
        if before and stamp < before[-1]:
            self.fail(f"time stamp {stamp} ms; expected {before[-1]} ms, the one before, or later")
        return stamp


class _XmlReader:
    """Reads the XML as a stream, checks it against the schema and passes each complete element to a collector."""

    def __init__(self, collector: _Collector) -> None:
        self._collector = collector
        #: Path of each open XML element, outermost first.
        self._paths = [""]
        #: Texts of the child elements of each open element, by tag.
        self._fields: list[dict[str, str]] = [{}]
        #: Numbers of the repeated child elements of each open element, by tag.
        self._counts: list[dict[str, int]] = [{}]
        #: Text since the last tag.
        self._text = ""
        #: Number of bytes since the last tag or text.
        self._markup_bytes = 0
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler = self._start_element
        self._expat.EndElementHandler = self._end_element
        self._expat.CharacterDataHandler = self._add_text
        self._expat.StartDoctypeDeclHandler = self._refuse_declaration
        self._expat.ProcessingInstructionHandler = self._refuse_declaration

    def read(self, pieces: Iterable[bytes]) -> None:
        """Read a complete XML document, given as pieces of bytes."""
        for piece in pieces:
            self._markup_bytes += len(piece)
            self._parse(piece, final=False)
            if self._markup_bytes > LIMITS.markup_bytes:
                self._fail(f"more than {LIMITS.markup_bytes} bytes of XML without a tag or text")
        self._parse(b"", final=True)

    def _parse(self, piece: bytes, *, final: bool) -> None:
        try:
            self._expat.Parse(piece, final)
        except expat.ExpatError as error:
            self._fail(f"no well-formed XML: {expat.errors.messages[error.code]}")

    def _refuse_declaration(self, *_: object) -> None:
        self._fail("a declaration or processing instruction; expected none")

    def _add_text(self, text: str) -> None:
        self._markup_bytes = 0
        self._text += text
        if len(self._text) > LIMITS.text:
            self._fail(f"more than the {LIMITS.text} characters accepted in one element")

    def _start_element(self, tag: str, attributes: dict[str, str]) -> None:
        self._markup_bytes = 0
        path = self._paths[-1]
        known = (*_SCHEMA.get(path, ()), *_OPTIONAL.get(path, ()))
        if tag not in known:
            parent = path.rpartition("/")[2] or "document"
            self._fail(f"<{tag}> in <{parent}>; expected {', '.join(known) or 'text only'}")
        self._check_no_text()
        if tag in _COUNT_OF:
            self._check_index(tag, attributes.get("index"))
        self._paths.append(f"{path}/{tag}" if path else tag)
        self._fields.append({})
        self._counts.append({})

    def _end_element(self, tag: str) -> None:
        self._markup_bytes = 0
        path, fields, counts = self._paths.pop(), self._fields.pop(), self._counts.pop()
        if path in _SCHEMA:
            self._check_no_text()
            self._check_complete(path, fields, counts)
            self._collector.place = f"line {self._expat.CurrentLineNumber}"
            self._collector.add(path, fields)
        if tag in _COUNT_OF:
            return
        if tag in self._fields[-1]:
            self._fail(f"<{tag}> for the second time; expected one")
        self._fields[-1][tag], self._text = self._text, ""

    def _check_index(self, tag: str, index: str | None) -> None:
        """Check that the index of a repeated element is the number of elements before it, and count the element."""
        expected = self._counts[-1].get(tag, 0)
        if index != str(expected):
            self._fail(f"<{tag}> has index {index!r}; expected '{expected}'")
        self._counts[-1][tag] = expected + 1

    def _check_complete(self, path: str, fields: Mapping[str, str], counts: Mapping[str, int]) -> None:
        """Check that no required child element is missing and that repeated ones have the stated number.

        Args:
            path: Path of the parent element.
            fields: Texts of the child elements, by tag.
            counts: Numbers of the repeated child elements, by tag.
        """
        missing = [name for name in _SCHEMA[path] if name not in fields and name not in _COUNT_OF]
        if missing:
            self._fail(f"<{path.rpartition('/')[2]}> lacks {', '.join(missing)}")
        for tag in set(_SCHEMA[path]) & set(_COUNT_OF):
            announced = _read_whole_number(fields[_COUNT_OF[tag]], _COUNT_OF[tag], self._fail)
            if announced != counts.get(tag, 0):
                self._fail(f"{_COUNT_OF[tag]} is {announced}, found {counts.get(tag, 0)}")

    def _check_no_text(self) -> None:
        """Refuse text between two tags where the schema expects elements only; white space is accepted."""
        if self._text.strip():
            self._fail("text between elements; expected none")
        self._text = ""

    def _fail(self, fault: str) -> NoReturn:
        self._collector.place = f"line {self._expat.CurrentLineNumber}"
        self._collector.fail(fault)


def _read_array(fields: Mapping[str, str], name: str, fail: Fail) -> RecordedArray:
    """Read the description of one texel array from a `<matrix>` element.

    Args:
        fields: Text of each child element in `MATRIX_FIELDS`, by tag.
        name: Name that the array gets.
        fail: Function that raises the error for a faulty file.

    Returns:
        The array, without frames.
    """
    columns, rows = (_read_bounded(fields, cells, LIMITS.cells, fail) for cells in ("cells_x", "cells_y"))
    width, height = (_read_length(fields, edge, fail) for edge in ("texel_width", "texel_height"))
    active = _read_mask(fields, "static_mask", rows, columns, fail)
    if not active.any():
        fail("static_mask leaves no texel; expected at least one")
    x, y, z = (_read_number(fields[f"matrix_center_{axis}"], "matrix_center", fail) for axis in "xyz")
    about_x, about_y, about_z = (math.radians(_read_number(fields[f"theta_{axis}"], "theta", fail)) for axis in "xyz")
    return RecordedArray(
        texels=TexelArray.grid(rows, columns, (width, height), active=active, name=name),
        enabled=_read_mask(fields, "dynamic_mask", rows, columns, fail),
        counts=np.empty((0, rows * columns), dtype=np.int32),
        full_scale=_read_bounded(fields, "fullscale", _LARGEST_FULL_SCALE, fail),
        unit=fields["output_unit"].strip(),
        centre=(x * _METRES_PER_MILLIMETRE, y * _METRES_PER_MILLIMETRE, z * _METRES_PER_MILLIMETRE),
        rotation=(about_x, about_y, about_z),
    )


def _limit_counts(array: RecordedArray) -> FrameArray:
    """Return the largest possible count of each texel, shape (n,) [-]: the full scale, or 0 for a masked texel."""
    return np.where(array.texels.active & array.enabled, array.full_scale, 0).astype(np.int16)


def decode_counts(text: str, limits: FrameArray, fail: Fail) -> FrameArray:
    """Expand the hexadecimal tokens of one frame to one count per texel.

    Args:
        text: The tokens, eight digits each, with spaces and line breaks anywhere.
        limits: Largest possible count of each of the n texels, shape (n,) [-].
        fail: Function that raises the error for a faulty file.

    Returns:
        Counts of the texels, shape (n,) [-].
    """
    digits = "".join(text.split())
    try:
        with np.errstate(invalid="ignore"):  # converting a signalling NaN warns
            tokens = np.frombuffer(bytes.fromhex(digits), dtype=">f4").astype(np.float64)
    except ValueError:
        fail(f"frame_data is not hexadecimal tokens of {_TOKEN_DIGITS} digits")
    # NaN and infinity fail these comparisons.  The number of texels is checked before runs of zeros are expanded, so
    # that a damaged token cannot claim much memory.
    if not (np.abs(tokens) <= _LARGEST_FULL_SCALE).all() or (tokens != np.rint(tokens)).any():
        fail("a token is not a whole number of counts or zeros")
    runs = np.where(tokens < 0, -tokens, 1).astype(np.int64)
    if runs.sum() != len(limits):
        fail(f"tokens add up to {runs.sum()} texels; expected {len(limits)}")
    counts = np.repeat(np.maximum(tokens, 0), runs).astype(np.int16)
    above = np.flatnonzero(counts > limits)
    if above.size:
        fail(f"texel {above[0]} reads {counts[above[0]]}; expected at most {limits[above[0]]} (0 is masked)")
    return counts


def _read_whole_number(text: str, name: str, fail: Fail) -> int:
    """Parse a whole number of 0 or more; `name` is the tag of the element, for the error message."""
    if not _WHOLE_NUMBER.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a whole number")
    return int(text)


def _read_number(text: str, name: str, fail: Fail) -> float:
    """Parse a finite decimal number; `name` is the tag of the element, for the error message."""
    if not _NUMBER.fullmatch(text.strip()):
        fail(f"{name} is {text.strip()[:40]!r}; expected a number")
    return float(text)


def _read_bounded(fields: Mapping[str, str], name: str, largest: int, fail: Fail) -> int:
    """Parse the element `name` as a whole number from 1 to `largest`."""
    value = _read_whole_number(fields[name], name, fail)
    if not 1 <= value <= largest:
        fail(f"{name} is {value}; expected 1..{largest}")
    return value


def _read_length(fields: Mapping[str, str], name: str, fail: Fail) -> float:
    """Parse the element `name` as a positive length in millimetres; return the length [m]."""
    value = _read_number(fields[name], name, fail)
    if value <= 0:
        fail(f"{name} is {value} mm; expected a positive length")
    return value * _METRES_PER_MILLIMETRE


def _read_mask(fields: Mapping[str, str], name: str, rows: int, columns: int, fail: Fail) -> BoolArray:
    """Parse the element `name` as lines of digits 0 or 1; return the digits as booleans, shape (rows * columns,)."""
    lines = fields[name].split()
    if len(lines) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in lines):
        fail(f"{name} is not {rows} lines of {columns} digits 0 or 1")
    return np.array([digit == "1" for line in lines for digit in line])


def unpack_bzip2(path: Path, *, limit: int) -> Iterator[bytes]:
    """Yield the unpacked bytes of a file in pieces of at most `LIMITS.piece_bytes`.

    Args:
        path: The bzip2 file.
        limit: Largest number of unpacked bytes that is accepted; a larger file is refused.

    Raises:
        RecordingError: If the file is missing, is not a bzip2 file, is damaged, truncated or too large, or if other
            bytes follow the bzip2 stream.
    """
    decompressor = bz2.BZ2Decompressor()
    total = 0
    with open_recorded(path) as file:
        while packed := file.read(LIMITS.piece_bytes):
            if decompressor.eof:
                raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")
            for piece in _decompress(decompressor, packed, path):
                total += len(piece)
                if total > limit:
                    raise RecordingError(f"{path}: unpacks to more than the {limit} bytes accepted")
                yield piece
    if not decompressor.eof:
        raise RecordingError(
            f"{path}: truncated: the bzip2 stream stops after {total} unpacked bytes; expected a complete file"
        )
    if decompressor.unused_data:
        raise RecordingError(f"{path}: bytes follow the end of the bzip2 stream; expected none")


def _decompress(decompressor: bz2.BZ2Decompressor, packed: bytes, path: Path) -> Iterator[bytes]:
    while True:
        try:
            piece = decompressor.decompress(packed, max_length=LIMITS.piece_bytes)
        except OSError as error:
            raise RecordingError(f"{path}: damaged, or no bzip2 file; expected an intact one") from error
        if piece:
            yield piece
        if decompressor.eof or decompressor.needs_input:
            return
        packed = b""
