"""Converts the labels of a recording (set-up, arrays, serial number, clocks) to and from a JSON object in its file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from meshes import TexelArray
from meshes.array import check_texel_count
from meshes.bounded_file import parse_json
from validation.recordings.recording import LATEST, BoolArray, RecordedArray, RecordingError, Setup

#: Name and version of the format of the labels; files with another name or version are refused.
FORMAT = "softcover-recording/1"
#: Largest accepted number of characters of the labels [-].
_MOST_CHARACTERS = 2**20
#: Largest accepted number of texel arrays in a recording [-].
MOST_ARRAYS = 64
#: Number of faults above which none of them is named [-].
_MOST_FAULTS = 1000
#: Largest full scale: counts are kept as signed numbers of 32 bits [-].
MOST_FULL_SCALE = 2**31 - 1

#: A length [m] or an angle [rad]; larger ones must have a wrong unit.
_Coordinate = Annotated[float, Field(ge=-1000.0, le=1000.0)]
_Pair = tuple[_Coordinate, _Coordinate]
_Triple = tuple[_Coordinate, _Coordinate, _Coordinate]
_Nanoseconds = Annotated[int, Field(ge=0, le=LATEST)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Labels:
    """Labels of a recording: the description of sensor and set-up that its file holds beside the frames.

    Attributes:
        setup: How the recording was made.
        arrays: The texel arrays, without frames.
        serial: Serial number of the sensor.
        start: Time at the start of the recording, UTC since 1970, by the clock of the host [ns].
        monotonic: Time at the start of the recording on the monotonic clock of the host [ns].
    """

    setup: Setup
    arrays: tuple[RecordedArray, ...]
    serial: str
    start: int
    monotonic: int


class _Entry(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class _ArrayEntry(_Entry):
    name: str
    rows: int
    columns: int
    pitch_m: _Pair
    texel_size_m: _Pair
    active: str
    enabled: str
    full_scale: int = Field(ge=1, le=MOST_FULL_SCALE)
    offset: int = Field(default=0, ge=0, le=0xFFFF)
    unit: str
    centre_m: _Triple
    rotation_rad: _Triple


class _ClockEntry(_Entry):
    start_ns: _Nanoseconds
    monotonic_ns: _Nanoseconds


class _SetupEntry(_Entry):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=True)

    indenter: str = ""
    load: float | None = None
    note: str = ""
    source: str = ""
    source_sha256: str = ""
    device: dict[str, str | bool | int | float] = Field(default_factory=dict)
    other: dict[str, str] = Field(default_factory=dict)


class _LabelsEntry(_Entry):
    format: str
    serial: str
    arrays: tuple[_ArrayEntry, ...]
    clock: _ClockEntry
    setup: _SetupEntry


def encode_labels(labels: Labels) -> str:
    """Return labels as the text of a JSON object, without the frames of the arrays."""
    setup = labels.setup
    entry = _LabelsEntry(
        format=FORMAT,
        serial=labels.serial,
        arrays=tuple(_encode_array(array) for array in labels.arrays),
        clock=_ClockEntry(start_ns=labels.start, monotonic_ns=labels.monotonic),
        setup=_SetupEntry(**{**vars(setup), "device": dict(setup.device), "other": dict(setup.other)}),
    )
    return json.dumps(entry.model_dump(mode="json", exclude=None if setup.other else {"setup": {"other"}}))


def decode_labels(text: str, path: Path) -> Labels:
    """Parse the text of the JSON object that `encode_labels` returns.

    Args:
        text: Text of the JSON object.
        path: The file that holds the text, for error messages.

    Raises:
        RecordingError: If the text does not hold labels of a recording.
    """
    if len(text) > _MOST_CHARACTERS:
        raise RecordingError(f"{path}: its labels have {len(text)} characters; at most {_MOST_CHARACTERS} are accepted")
    try:
        entries = parse_json(text)
        name = entries["format"]
        if len(entries["arrays"]) > MOST_ARRAYS:
            raise ValueError(f"{len(entries['arrays'])} arrays; at most {MOST_ARRAYS} are accepted")  # noqa: TRY301
        if name == FORMAT:
            entry = _LabelsEntry.model_validate_json(text)
            return Labels(
                setup=Setup(**entry.setup.model_dump()),
                arrays=tuple(_decode_array(array) for array in entry.arrays),
                serial=entry.serial,
                start=entry.clock.start_ns,
                monotonic=entry.clock.monotonic_ns,
            )
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False) if error.error_count() <= _MOST_FAULTS else []
        fault = f"{'.'.join(map(str, faults[0]['loc']))}: {faults[0]['msg']}" if faults else "faults everywhere"
        raise RecordingError(f"{path}: its labels cannot be read: {fault}; expected {FORMAT!r}") from error
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: its labels cannot be read: {error}; expected {FORMAT!r}") from error
    raise RecordingError(f"{path}: its labels have the format {str(name)[:40]!r}; accepted: {FORMAT!r}")


def _encode_array(array: RecordedArray) -> _ArrayEntry:
    texels = array.texels
    return _ArrayEntry(
        name=texels.name,
        rows=texels.rows,
        columns=texels.columns,
        pitch_m=texels.pitch,
        texel_size_m=texels.texel_size,
        active="".join("1" if active else "0" for active in texels.active),
        enabled="".join("1" if enabled else "0" for enabled in array.enabled),
        full_scale=array.full_scale,
        offset=array.offset,
        unit=array.unit,
        centre_m=array.centre,
        rotation_rad=array.rotation,
    )


def _decode_array(entry: _ArrayEntry) -> RecordedArray:
    check_texel_count(entry.rows, entry.columns)
    enabled = _decode_mask(entry.enabled)
    if len(enabled) != entry.rows * entry.columns:
        raise ValueError(f"a mask of {len(enabled)} texels; expected {entry.rows} x {entry.columns}")
    texels = TexelArray.grid(
        entry.rows,
        entry.columns,
        entry.pitch_m,
        texel_size=entry.texel_size_m,
        active=_decode_mask(entry.active),
        name=entry.name,
    )
    return RecordedArray(
        texels=texels,
        enabled=enabled,
        counts=np.empty((0, texels.count), dtype=np.int32),
        full_scale=entry.full_scale,
        offset=entry.offset,
        unit=entry.unit,
        centre=entry.centre_m,
        rotation=entry.rotation_rad,
    )


def _decode_mask(text: str) -> BoolArray:
    return np.array([digit == "1" for digit in text])
