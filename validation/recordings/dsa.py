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
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings import recording
from validation.recordings.recording import RecordedArray, Recording, RecordingError, Setup

FrameArray = npt.NDArray[np.int16]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on the content of a file, several times what an SDH-2 hand sends in an hour.

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

#: Largest accepted full scale of an array [counts].  Counts are stored as signed 16-bit numbers.
_LARGEST_FULL_SCALE = int(np.iinfo(np.int16).max)
#: Number of hexadecimal digits of one token of a frame, an IEEE-754 single-precision number.
_TOKEN_DIGITS = 8
#: Pattern of the accepted whole numbers, which limits the number of digits.
_WHOLE_NUMBER = re.compile(r"[0-9]{1,15}")
#: Pattern of the accepted decimal numbers, which limits the number of digits.
_NUMBER = re.compile(r"[+-]?[0-9]{1,15}(\.[0-9]{0,15})?([eE][+-]?[0-9]{1,2})?")
#: Length of a millimetre [m].
_MILLIMETRE = 1e-3
#: Duration of a millisecond [s].
_MILLISECOND = 1e-3

#: Child elements of each XML element, by the path of the parent.  All are required except those in `_OPTIONAL`.
#: Elements in `_COUNT_OF` may occur any number of times, the others exactly once.
_SCHEMA: Mapping[str, tuple[str, ...]] = {
    "": ("root",),
    "root": ("sensor", "data", "temperatures", "joint_angles"),
    "root/sensor": ("generated_by", "hw_revision", "serial_nr", "num_matrices", "converter_resolution", "matrix"),
    "root/sensor/matrix": (
        *("cells_x", "cells_y", "texel_width", "texel_height", "static_mask", "dynamic_mask"),
        *("matrix_center_x", "matrix_center_y", "matrix_center_z", "theta_x", "theta_y", "theta_z"),
        *("output_unit", "fullscale", "hw_revision", "one_wire_uid"),
    ),
    "root/data": ("frame_count", "frame"),
    "root/data/frame": ("time_stamp", "frame_data"),
    "root/temperatures": ("temp_count", "temp"),
    "root/temperatures/temp": ("time_stamp", "temp_data"),
    "root/joint_angles": ("angle_count", "angle"),
    "root/joint_angles/angle": ("time_stamp", "angle_data"),
}
#: Elements that a file may leave out.
_OPTIONAL = ("temperatures", "joint_angles")
#: For each XML element that may be repeated, the element that states the number of repetitions.  Repeated elements
#: have an attribute `index`.
_COUNT_OF = {"matrix": "num_matrices", "frame": "frame_count", "temp": "temp_count", "angle": "angle_count"}


def read(path: str | Path) -> Recording:
    """Read a recording of an SDH-2 hand from a `.dsa` file.

    Args:
        path: The file.

    Raises:
        RecordingError: If the file is missing, damaged, of another format, or larger than the limits of this module.
    """
    return _Reader(Path(path)).read()


@dataclass(frozen=True)
class _Element:
    """An XML element whose end tag has not been read yet.

    Attributes:
        path: Tags from the outermost element to this one, such as `root/data/frame`.
        fields: Texts of its child elements, by tag.
        counts: Numbers of its repeated child elements, by tag.
    """

    path: str
    fields: dict[str, str] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)


class _Reader:
    """Reads the XML of one file as a stream, checks it against the schema and collects complete elements."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._arrays: list[RecordedArray] = []
        self._serial = ""
        #: Largest possible count of each of the n texels of all arrays, shape (n,); None before the end of `<sensor>`.
        self._limits: FrameArray | None = None
        self._frames: list[FrameArray] = []
        self._temperatures: list[list[float]] = []
        #: Time stamps of the frames, and of the temperatures [ms].
        self._stamps: dict[str, list[int]] = {"frame": [], "temp": []}
        self._open = [_Element("")]
        #: Text since the last tag, and number of bytes of XML since the last tag or text.
        self._text, self._markup_bytes = "", 0
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler = self._start_element
        self._expat.EndElementHandler = self._end_element
        self._expat.CharacterDataHandler = self._add_text
        self._expat.StartDoctypeDeclHandler = self._expat.ProcessingInstructionHandler = self._refuse_declaration

    def read(self) -> Recording:
        """Read the whole `.dsa` file and make the recording."""
        try:
            for piece in self._unpack():
                self._markup_bytes += len(piece)
                self._expat.Parse(piece)
                if self._markup_bytes > LIMITS.markup_bytes:
                    self._fail(f"more than {LIMITS.markup_bytes} bytes of XML without a tag or text")
            self._expat.Parse(b"", True)  # noqa: FBT003 -- the end, by its place alone
        except expat.ExpatError as error:
            self._fail(f"no well-formed XML: {expat.errors.messages[error.code]}")
        if not self._frames:
            self._fail("no frames; expected at least one")
        first = self._stamps["frame"][0]
        try:
            started = recording.convert_to_utc(first * 1_000_000)
        except OverflowError:
            self._fail(f"time stamp {first} ms; expected milliseconds since 1970")
        frames, temperatures = ((np.array(stamps, dtype=float) - first) for stamps in self._stamps.values())
        ends = np.cumsum([array.texels.count for array in self._arrays])
        counts = np.split(np.stack(self._frames).astype(np.int32), ends[:-1], axis=1)
        digest = recording.hash_contents(self._path)
        return Recording(
            path=self._path,
            sha256=digest,
            serial=self._serial,
            started=started,
            times=frames * _MILLISECOND,
            arrays=tuple(replace(array, counts=part) for array, part in zip(self._arrays, counts, strict=True)),
            temperatures=np.array(self._temperatures or np.empty((0, 0)), dtype=float),
            temperature_times=temperatures * _MILLISECOND,
            setup=Setup(source=self._path.name, source_sha256=digest),
        )

    def _fail(self, fault: str) -> NoReturn:
        raise RecordingError(f"{self._path}: line {self._expat.CurrentLineNumber}: {fault}")

    def _unpack(self) -> Iterator[bytes]:
        """Yield the unpacked bytes of the bzip2 file in pieces of at most `LIMITS.piece_bytes`.

        Raises:
            RecordingError: If the file is missing, is not a bzip2 file, is damaged, truncated or too large, or if other
                bytes follow the bzip2 stream.
        """
        decompressor, total = bz2.BZ2Decompressor(), 0
        with recording.open_recorded(self._path) as file:
            while not decompressor.eof:
                packed = file.read(LIMITS.piece_bytes) if decompressor.needs_input else b""
                if decompressor.needs_input and not packed:
                    raise RecordingError(
                        f"{self._path}: truncated: the bzip2 stream stops after {total} unpacked bytes; expected a "
                        "complete file"
                    )
                try:
                    piece = decompressor.decompress(packed, max_length=LIMITS.piece_bytes)
                except OSError as error:
                    raise RecordingError(f"{self._path}: damaged, or no bzip2 file; expected an intact one") from error
                total += len(piece)
                if total > LIMITS.xml_bytes:
                    raise RecordingError(f"{self._path}: unpacks to more than the {LIMITS.xml_bytes} bytes accepted")
                if piece:
                    yield piece
            if decompressor.unused_data or file.read(1):
                raise RecordingError(f"{self._path}: bytes follow the end of the bzip2 stream; expected none")

    def _refuse_declaration(self, *_: object) -> None:
        self._fail("a declaration or processing instruction; expected none")

    def _add_text(self, text: str) -> None:
        self._markup_bytes = 0
        self._text += text
        if len(self._text) > LIMITS.text:
            self._fail(f"more than the {LIMITS.text} characters accepted in one element")

    def _check_no_text(self) -> None:
        """Refuse text between two tags where the schema expects elements only; white space is accepted."""
        if self._text.strip():
            self._fail("text between elements; expected none")
        self._text = ""

    def _start_element(self, tag: str, attributes: dict[str, str]) -> None:
        self._markup_bytes = 0
        parent = self._open[-1]
        known = _SCHEMA.get(parent.path, ())
        if tag not in known:
            within, required = parent.path.rpartition("/")[2], [name for name in known if name not in _OPTIONAL]
            self._fail(f"<{tag}> in <{within or 'document'}>; expected {', '.join(required) or 'text only'}")
        self._check_no_text()
        if tag in _COUNT_OF:
            if attributes.get("index") != str(parent.counts[tag]):
                self._fail(f"<{tag}> has index {attributes.get('index')!r}; expected '{parent.counts[tag]}'")
            parent.counts[tag] += 1
        self._open.append(_Element(f"{parent.path}/{tag}" if parent.path else tag))

    def _end_element(self, tag: str) -> None:
        self._markup_bytes = 0
        element, parent = self._open.pop(), self._open[-1]
        if element.path in _SCHEMA:
            self._check_no_text()
            self._check_complete(tag, element)
            self._collect(element.path, element.fields)
        if tag in _COUNT_OF:
            return
        if tag in parent.fields:
            self._fail(f"<{tag}> for the second time; expected one")
        parent.fields[tag], self._text = self._text, ""

    def _check_complete(self, tag: str, element: _Element) -> None:
        """Check that no required child element is missing and that repeated ones have the stated number."""
        children = _SCHEMA[element.path]
        missing = [name for name in children if name not in (*element.fields, *_COUNT_OF, *_OPTIONAL)]
        if missing:
            self._fail(f"<{tag}> lacks {', '.join(missing)}")
        for name in set(children) & set(_COUNT_OF):
            announced = self._read_whole(element.fields, _COUNT_OF[name])
            if announced != element.counts[name]:
                self._fail(f"{_COUNT_OF[name]} is {announced}, found {element.counts[name]}")

    def _collect(self, path: str, fields: Mapping[str, str]) -> None:
        """Store the content of a complete element, whose children agree with the schema."""
        match path:
            case "root/sensor/matrix":
                name = f"array {len(self._arrays)}"
                if len(self._arrays) == LIMITS.arrays or self._limits is not None:
                    self._fail(f"unexpected {name}; expected at most {LIMITS.arrays}, before the frames")
                self._arrays.append(self._read_array(fields, name))
            case "root/sensor":
                self._serial = fields["serial_nr"].strip()
                # The largest count of a texel is the full scale, or 0 for a masked texel.
                largest = [np.where(each.texels.active & each.enabled, each.full_scale, 0) for each in self._arrays]
                self._limits = np.concatenate(largest).astype(np.int16)
            case "root/data/frame":
                self._add_stamp("frame", fields)
                self._frames.append(self._decode_counts(fields["frame_data"]))
            case "root/temperatures/temp":
                self._add_stamp("temp", fields)
                readings = [self._read_number("temp_data", each) for each in fields["temp_data"].split(",")]
                self._temperatures.append(readings)
                if len(readings) != (expected := len(self._temperatures[0])):
                    self._fail(f"{len(readings)} temperatures; expected {expected} as before")
                if expected > LIMITS.channels or len(self._temperatures) > LIMITS.readings:
                    most = f"{LIMITS.readings} readings of {LIMITS.channels} channels"
                    self._fail(f"more temperatures than the {most} accepted")

    def _add_stamp(self, kind: str, fields: Mapping[str, str]) -> None:
        """Read the time stamp of an element [ms], which must not be smaller than the previous one."""
        stamp, before = self._read_whole(fields, "time_stamp"), self._stamps[kind]
        if before and stamp < before[-1]:
            self._fail(f"time stamp {stamp} ms; expected {before[-1]} ms, the one before, or later")
        before.append(stamp)

    def _read_array(self, fields: Mapping[str, str], name: str) -> RecordedArray:
        """Make a named array without frames from the texts of the child elements of a `<matrix>`."""
        columns, rows = (self._read_whole(fields, cells, LIMITS.cells) for cells in ("cells_x", "cells_y"))
        width, height = (
            _MILLIMETRE * self._read_number(edge, fields[edge]) for edge in ("texel_width", "texel_height")
        )
        if min(width, height) <= 0:
            self._fail("texel_width or texel_height is 0 mm or less; expected a positive length")
        masks = []
        for mask in ("static_mask", "dynamic_mask"):
            lines = fields[mask].split()
            if len(lines) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in lines):
                self._fail(f"{mask} is not {rows} lines of {columns} digits 0 or 1")
            masks.append(np.array([digit == "1" for line in lines for digit in line]))
        if not masks[0].any():
            self._fail("static_mask leaves no texel; expected at least one")
        x, y, z = (self._read_number("matrix_center", fields[f"matrix_center_{axis}"]) * _MILLIMETRE for axis in "xyz")
        turns = (math.radians(self._read_number("theta", fields[f"theta_{axis}"])) for axis in "xyz")
        about_x, about_y, about_z = turns
        return RecordedArray(
            texels=TexelArray.grid(rows, columns, (width, height), active=masks[0], name=name),
            enabled=masks[1],
            counts=np.empty((0, rows * columns), dtype=np.int32),
            full_scale=self._read_whole(fields, "fullscale", _LARGEST_FULL_SCALE),
            unit=fields["output_unit"].strip(),
            centre=(x, y, z),
            rotation=(about_x, about_y, about_z),
        )

    def _read_whole(self, fields: Mapping[str, str], name: str, largest: int | None = None) -> int:
        """Parse the text of an element as a whole number of 0 or more; with `largest`, from 1 to `largest`."""
        text = fields[name].strip()
        if not _WHOLE_NUMBER.fullmatch(text):
            self._fail(f"{name} is {text[:40]!r}; expected a whole number")
        if largest is not None and not 1 <= int(text) <= largest:
            self._fail(f"{name} is {int(text)}; expected 1..{largest}")
        return int(text)

    def _read_number(self, name: str, text: str) -> float:
        """Parse the text of an element as a finite decimal number; an error message names the tag `name`."""
        if not _NUMBER.fullmatch(text.strip()):
            self._fail(f"{name} is {text.strip()[:40]!r}; expected a number")
        return float(text)

    def _decode_counts(self, text: str) -> FrameArray:
        """Expand the hexadecimal tokens of one frame to the counts of the n texels of all arrays, shape (n,) [-]."""
        limits = self._limits
        if limits is None:
            self._fail("a frame before the description of the sensor; expected <sensor> first")
        if (len(self._frames) + 1) * len(limits) > LIMITS.values:
            self._fail(f"more than the {LIMITS.values} values accepted, frames times texels")
        try:
            with np.errstate(invalid="ignore"):  # Conversion of a signalling NaN gives a warning.
                tokens = np.frombuffer(bytes.fromhex("".join(text.split())), dtype=">f4").astype(np.float64)
        except ValueError:
            self._fail(f"frame_data is not hexadecimal tokens of {_TOKEN_DIGITS} digits")
        # NaN and infinity fail these comparisons.  The number of texels is checked before runs of zeros are expanded,
        # so that a damaged token cannot allocate much memory.
        if not (np.abs(tokens) <= _LARGEST_FULL_SCALE).all() or (tokens != np.rint(tokens)).any():
            self._fail("a token is not a whole number of counts or zeros")
        runs = np.where(tokens < 0, -tokens, 1).astype(np.int64)
        if runs.sum() != len(limits):
            self._fail(f"tokens add up to {runs.sum()} texels; expected {len(limits)}")
        counts = np.repeat(np.maximum(tokens, 0), runs).astype(np.int16)
        above = np.flatnonzero(counts > limits)
        if above.size:
            self._fail(f"texel {above[0]} reads {counts[above[0]]}; expected at most {limits[above[0]]} (0 is masked)")
        return counts
