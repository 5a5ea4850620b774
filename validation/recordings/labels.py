"""Labels of a recording: set-up, arrays, serial number and clocks, as a JSON object in its file."""

from __future__ import annotations

import json
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


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class ArrayLabels(_Table):
    """Description of one texel array; masks are texts of the digits 0 and 1."""

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

    def make(self) -> RecordedArray:
        """Make the array, without frames.

        Raises:
            ValueError: If a number is impossible, or a mask has another size than the array.
        """
        check_texel_count(self.rows, self.columns)
        enabled = _read_mask(self.enabled)
        if len(enabled) != self.rows * self.columns:
            raise ValueError(f"a mask of {len(enabled)} texels; expected {self.rows} x {self.columns}")
        active, size = _read_mask(self.active), self.texel_size_m
        return RecordedArray(
            texels=TexelArray.grid(
                self.rows, self.columns, self.pitch_m, texel_size=size, active=active, name=self.name
            ),
            enabled=enabled,
            counts=np.empty((0, len(enabled)), dtype=np.int32),
            full_scale=self.full_scale,
            offset=self.offset,
            unit=self.unit,
            centre=self.centre_m,
            rotation=self.rotation_rad,
        )


class ClockLabels(_Table):
    """Time at the start of the recording: UTC since 1970, and on the monotonic clock of the host [ns]."""

    start_ns: _Nanoseconds
    monotonic_ns: _Nanoseconds


class Labels(_Table):
    """All labels of a recording."""

    format: str
    serial: str
    arrays: tuple[ArrayLabels, ...]
    clock: ClockLabels
    setup: Setup


def encode_labels(
    setup: Setup, arrays: tuple[RecordedArray, ...], *, serial: str = "", start: int = 0, monotonic: int = 0
) -> str:
    """Return labels as the text of a JSON object.

    Args:
        setup: How the recording is made.
        arrays: The texel arrays; their frames are left out.
        serial: Serial number of the sensor.
        start: Time at the start of the recording, UTC since 1970 [ns].
        monotonic: The same time on the monotonic clock of the host [ns].
    """
    described = tuple(
        ArrayLabels(
            name=array.texels.name,
            rows=array.texels.rows,
            columns=array.texels.columns,
            pitch_m=array.texels.pitch,
            texel_size_m=array.texels.texel_size,
            active=_write_mask(array.texels.active),
            enabled=_write_mask(array.enabled),
            full_scale=array.full_scale,
            offset=array.offset,
            unit=array.unit,
            centre_m=array.centre,
            rotation_rad=array.rotation,
        )
        for array in arrays
    )
    clock = ClockLabels(start_ns=start, monotonic_ns=monotonic)
    labels = Labels(format=FORMAT, serial=serial, arrays=described, clock=clock, setup=setup)
    return json.dumps(labels.model_dump(mode="json", exclude=None if setup.other else {"setup": {"other"}}))


def decode_labels(text: str, path: Path) -> tuple[Labels, tuple[RecordedArray, ...]]:
    """Parse the text of the JSON object that `encode_labels` returns; return the labels and the arrays without frames.

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
            labels = Labels.model_validate_json(text)
            return labels, tuple(each.make() for each in labels.arrays)
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False) if error.error_count() <= _MOST_FAULTS else []
        fault = f"{'.'.join(map(str, faults[0]['loc']))}: {faults[0]['msg']}" if faults else "faults everywhere"
        raise RecordingError(f"{path}: its labels cannot be read: {fault}; expected {FORMAT!r}") from error
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: its labels cannot be read: {error}; expected {FORMAT!r}") from error
    raise RecordingError(f"{path}: its labels have the format {str(name)[:40]!r}; accepted: {FORMAT!r}")


def _write_mask(mask: BoolArray) -> str:
    return "".join("1" if each else "0" for each in mask)


def _read_mask(text: str) -> BoolArray:
    return np.array([digit == "1" for digit in text])
