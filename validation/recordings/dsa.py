"""Reader of `.dsa` files: frames of the Weiss arrays in a SCHUNK SDH-2 hand.

The format is Peter Kiechle's (tactile-sensors, University of Innsbruck, 2015), not the Weiss DSA-Explorer's:
bzip2-compressed XML.  A frame is hexadecimal text, eight digits per token, each token one IEEE-754 single
printed most significant digit first: t >= 0 is one texel's value, t < 0 stands for |t| texels that read zero.
Texels run x fastest, then y, then array, over all arrays of the hand.

Nothing is taken on trust.  bzip2's checksums, the schema below, announced against found numbers of elements,
token sums, value ranges, masks and time stamps all have to agree, or the file is refused with the place of
the fault.  The file is streamed: memory is bounded by the limits below whatever the file claims, and document
type declarations, the door to entity attacks, are refused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

import numpy as np

from validation.recordings.bzip2 import unpacked
from validation.recordings.dsa_fields import MATRIX_FIELDS, CountArray, Matrix, decode, matrix, number, whole
from validation.recordings.recording import Recording, RecordingError

#: Most bytes of XML that a file may unpack to.
MAX_XML_BYTES = 512 * 2**20
#: Most texel values of a file, frames times texels: an hour of a hand's 486 texels at 34 frames/s.
MAX_VALUES = 60_000_000
#: Most temperature channels, and readings of them.
MAX_CHANNELS, MAX_READINGS = 64, 100_000
#: Most bytes of XML without a tag or text, which is what the parser may have to hold back.
MAX_MARKUP_BYTES = 2**20
#: Most characters of one element's text; a frame without a single zero takes 5 000.
MAX_TEXT = 2**16
_MAX_MATRICES = 16
_MILLISECOND = 1e-3

_SENSOR_FIELDS = ("generated_by", "hw_revision", "serial_nr", "num_matrices", "converter_resolution")
#: What must stand in which element.  Those in `_NUMBERED` come any number of times, the others once.
_SCHEMA: Mapping[str, tuple[str, ...]] = {
    "": ("root",),
    "root": ("sensor", "data"),
    "root/sensor": (*_SENSOR_FIELDS, "matrix"),
    "root/sensor/matrix": MATRIX_FIELDS,
    "root/data": ("frame_count", "frame"),
    "root/data/frame": ("time_stamp", "frame_data"),
    "root/temperatures": ("temp_count", "temp"),
    "root/temperatures/temp": ("time_stamp", "temp_data"),
    "root/joint_angles": ("angle_count", "angle"),
    "root/joint_angles/angle": ("time_stamp", "angle_data"),
}
_OPTIONAL: Mapping[str, tuple[str, ...]] = {"root": ("temperatures", "joint_angles")}
#: Repeated elements, each with a running number, and the element that announces how many there are.
_NUMBERED: Mapping[str, str] = {
    "matrix": "num_matrices",
    "frame": "frame_count",
    "temp": "temp_count",
    "angle": "angle_count",
}


def read(path: str | Path) -> Recording:
    """Read a whole `.dsa` file.

    Args:
        path: The file.

    Raises:
        RecordingError: If the file is missing, damaged, of another format or beyond the limits; of a damaged
            file nothing is returned.
    """
    file = Path(path)
    digest = hashlib.sha256()
    contents = _Contents(file)
    _Parser(contents).parse(unpacked(file, limit=MAX_XML_BYTES, seen=digest.update))
    return contents.recording(digest.hexdigest())


class _Contents:
    """Collects what the elements say, in the order in which they end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.place = "start of the file"
        self.matrices: list[Matrix] = []
        self.serial = ""
        self.limits: CountArray | None = None
        self.frames: list[CountArray] = []
        self.stamps: list[int] = []
        self.temperatures: list[list[float]] = []
        self.temperature_stamps: list[int] = []

    def take(self, place: str, fields: Mapping[str, str]) -> None:
        """Note one element that ended; its schema has been checked."""
        match place:
            case "root/sensor/matrix":
                name = f"array {len(self.matrices)}"
                if len(self.matrices) == _MAX_MATRICES or self.limits is not None:
                    self.fail(f"unexpected {name}; expected at most {_MAX_MATRICES}, before the frames")
                self.matrices.append(matrix(fields, name, self.fail))
            case "root/sensor":
                self.serial = fields["serial_nr"].strip()
                self.limits = np.concatenate([each.limits for each in self.matrices])
            case "root/data/frame":
                self._frame(fields)
            case "root/temperatures/temp":
                self._temperature(fields)

    def _frame(self, fields: Mapping[str, str]) -> None:
        if self.limits is None:
            self.fail("a frame before the description of the sensor")
        if (len(self.frames) + 1) * len(self.limits) > MAX_VALUES:
            self.fail(f"more than the {MAX_VALUES} values accepted, frames times texels")
        self.stamps.append(self._stamp(fields, self.stamps))
        self.frames.append(decode(fields["frame_data"], self.limits, self.fail))

    def _temperature(self, fields: Mapping[str, str]) -> None:
        readings = [number(part, "temp_data", self.fail) for part in fields["temp_data"].split(",")]
        if self.temperatures and len(readings) != len(self.temperatures[0]):
            self.fail(f"{len(readings)} temperatures; expected {len(self.temperatures[0])} as before")
        if len(readings) > MAX_CHANNELS or len(self.temperatures) == MAX_READINGS:
            self.fail(f"more temperatures than {MAX_READINGS} readings of {MAX_CHANNELS} channels")
        self.temperature_stamps.append(self._stamp(fields, self.temperature_stamps))
        self.temperatures.append(readings)

    def _stamp(self, fields: Mapping[str, str], before: list[int]) -> int:
        stamp = whole(fields["time_stamp"], "time_stamp", self.fail)
        if before and stamp < before[-1]:
            self.fail(f"time stamp {stamp} ms; expected {before[-1]} ms, the one before, or later")
        return stamp

    def recording(self, sha256: str) -> Recording:
        """All that was collected."""
        if not self.frames:
            self.fail("no frames; expected at least one")
        first = self.stamps[0]
        ends = np.cumsum([each.texels.count for each in self.matrices])
        frames = np.split(np.stack(self.frames), ends[:-1], axis=1)
        return Recording(
            path=self.path,
            sha256=sha256,
            serial=self.serial,
            started=self._moment(first),
            times=(np.array(self.stamps) - first) * _MILLISECOND,
            arrays=tuple(each.with_frames(part) for each, part in zip(self.matrices, frames, strict=True)),
            temperatures=np.array(self.temperatures or np.empty((0, 0)), dtype=float),
            temperature_times=(np.array(self.temperature_stamps, dtype=float) - first) * _MILLISECOND,
        )

    def _moment(self, stamp: int) -> datetime:
        try:
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=stamp)
        except OverflowError:
            self.fail(f"time stamp {stamp} ms; expected milliseconds since 1970")

    def fail(self, what: str) -> NoReturn:
        """Refuse the file."""
        raise RecordingError(f"{self.path}: {self.place}: {what}")


class _Parser:
    """Walks the XML, holds it against the schema and hands over each element that ends."""

    def __init__(self, contents: _Contents) -> None:
        self._contents = contents
        self._places = [""]
        self._fields: list[dict[str, str]] = [{}]
        self._numbers: list[dict[str, int]] = [{}]
        self._text: list[str] = []
        self._text_length = 0
        self._silent = 0
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler = self._start
        self._expat.EndElementHandler = self._end
        self._expat.CharacterDataHandler = self._characters
        self._expat.StartDoctypeDeclHandler = self._declaration
        self._expat.ProcessingInstructionHandler = self._declaration

    def parse(self, pieces: Iterable[bytes]) -> None:
        """Parse a whole document."""
        for piece in pieces:
            self._silent += len(piece)
            self._feed(piece, final=False)
            if self._silent > MAX_MARKUP_BYTES:
                self._fail(f"more than {MAX_MARKUP_BYTES} bytes of XML without a tag or text")
        self._feed(b"", final=True)

    def _feed(self, piece: bytes, *, final: bool) -> None:
        try:
            self._expat.Parse(piece, final)
        except expat.ExpatError as error:
            self._fail(f"no well-formed XML: {expat.errors.messages[error.code]}")

    def _declaration(self, *_: object) -> None:
        self._fail("a declaration or instruction, which .dsa files never hold")

    def _characters(self, text: str) -> None:
        self._silent = 0
        self._text_length += len(text)
        if self._text_length > MAX_TEXT:
            self._fail(f"more than the {MAX_TEXT} characters accepted in one element")
        self._text.append(text)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._silent = 0
        here = self._places[-1]
        known = (*_SCHEMA.get(here, ()), *_OPTIONAL.get(here, ()))
        if tag not in known:
            inside = here.rpartition("/")[2] or "document"
            self._fail(f"<{tag}> in <{inside}>; expected {', '.join(known) or 'text only'}")
        self._blank()
        if tag in _NUMBERED:
            self._count(tag, attributes.get("index"))
        self._places.append(f"{here}/{tag}" if here else tag)
        self._fields.append({})
        self._numbers.append({})

    def _count(self, tag: str, index: str | None) -> None:
        running = self._numbers[-1].get(tag, 0)
        if index != str(running):
            self._fail(f"<{tag}> has index {index!r}; expected '{running}'")
        self._numbers[-1][tag] = running + 1

    def _end(self, tag: str) -> None:
        self._silent = 0
        here, fields, numbers = self._places.pop(), self._fields.pop(), self._numbers.pop()
        if here in _SCHEMA:
            self._blank()
            self._complete(here, fields, numbers)
            self._contents.place = f"line {self._expat.CurrentLineNumber}"
            self._contents.take(here, fields)
        if tag in _NUMBERED:
            return
        if tag in self._fields[-1]:
            self._fail(f"<{tag}> for the second time; expected one")
        self._fields[-1][tag] = "".join(self._text)
        self._forget()

    def _complete(self, here: str, fields: Mapping[str, str], numbers: Mapping[str, int]) -> None:
        missing = [name for name in _SCHEMA[here] if name not in fields and name not in _NUMBERED]
        if missing:
            self._fail(f"<{here.rpartition('/')[2]}> lacks {', '.join(missing)}")
        for tag in set(_SCHEMA[here]) & set(_NUMBERED):
            announced = whole(fields[_NUMBERED[tag]], _NUMBERED[tag], self._fail)
            if announced != numbers.get(tag, 0):
                self._fail(f"{_NUMBERED[tag]} is {announced}, found {numbers.get(tag, 0)}")

    def _blank(self) -> None:
        if "".join(self._text).strip():
            self._fail("text between elements; expected none")
        self._forget()

    def _forget(self) -> None:
        self._text.clear()
        self._text_length = 0

    def _fail(self, what: str) -> NoReturn:
        self._contents.place = f"line {self._expat.CurrentLineNumber}"
        self._contents.fail(what)
