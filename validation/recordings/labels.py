"""Converts the labels of a recording (set-up, arrays, serial number, clocks) to and from a JSON object in its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from meshes import TexelArray
from meshes.array import check_texel_count
from meshes.bounded_file import parse_json
from validation.recordings.recording import LATEST, BoolArray, RecordedArray, RecordingError, Setup

#: Name and version of the format of the labels; files with another name or version are refused.
FORMAT = "softcover-recording/1"


#: Largest accepted number of characters of the labels, and of texel arrays in them [-].
_MOST_CHARACTERS, MOST_ARRAYS = 2**20, 64
#: Largest accepted coordinate; larger ones must have a wrong unit [m].
_FARTHEST = 1000.0
#: Largest full scale: counts are kept as signed numbers of 32 bits [-].
MOST_FULL_SCALE = 2**31 - 1
#: Largest accepted number that is added to the counts of a file, 16 bits [-].
_LARGEST_OFFSET = 0xFFFF

T = TypeVar("T")


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


def encode_labels(labels: Labels) -> str:
    """Return labels as the text of a JSON object, without the frames of the arrays."""
    return json.dumps(
        {
            "format": FORMAT,
            "serial": labels.serial,
            "arrays": [_encode_array(array) for array in labels.arrays],
            "clock": {"start_ns": labels.start, "monotonic_ns": labels.monotonic},
            "setup": _encode_setup(labels.setup),
        }
    )


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
        _check_format(entries["format"], path)
        clocks = [_read(entries["clock"], key, int) for key in ("start_ns", "monotonic_ns")]
        if not all(0 <= clock <= LATEST for clock in clocks) or len(entries["arrays"]) > MOST_ARRAYS:
            raise ValueError(f"clocks are 0..{LATEST} ns, arrays at most {MOST_ARRAYS}")  # noqa: TRY301
        return Labels(
            setup=_decode_setup(entries["setup"]),
            arrays=tuple(_decode_array(entry) for entry in entries["arrays"]),
            serial=_read(entries, "serial", str),
            start=clocks[0],
            monotonic=clocks[1],
        )
    except RecordingError:
        raise
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: its labels cannot be read: {error}; expected {FORMAT!r}") from error


def _read(entries: Mapping[str, Any], key: str, kind: type[T]) -> T:
    """Return the value of a key; raise a `ValueError` if it is of another type."""
    value = entries[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ValueError(f"{key} is {str(value)[:40]!r}")  # noqa: TRY004 -- bad input like any other
    return value


def _decode_setup(entries: Mapping[str, Any]) -> Setup:
    load, device = entries.get("load"), entries.get("device", {})
    texts = {key: _read(entries, key, str) for key in ("indenter", "note", "source", "source_sha256") if key in entries}
    other = entries.get("other", {})
    known = {*texts, "load", "device", "other"}
    if set(entries) - known or not isinstance(load, float | int | None) or isinstance(load, bool):
        raise ValueError("setup has other keys or types than a softcover recording")
    if not isinstance(device, dict) or not all(isinstance(value, str | int | float) for value in device.values()):
        raise ValueError("setup.device is no table of texts and numbers")
    if not isinstance(other, dict) or not all(isinstance(value, str) for value in other.values()):
        raise ValueError("setup.other is no table of texts")
    return Setup(**texts, load=load, device=device, other=other)


def _check_format(name: object, path: Path) -> None:
    if name != FORMAT:
        raise RecordingError(f"{path}: its labels have the format {name!r}; accepted: {FORMAT!r}")


def _encode_setup(setup: Setup) -> dict[str, object]:
    entries = {**vars(setup), "device": dict(setup.device), "other": dict(setup.other)}
    return entries if setup.other else {key: value for key, value in entries.items() if key != "other"}


def _encode_array(array: RecordedArray) -> dict[str, object]:
    texels = array.texels
    return {
        "name": texels.name,
        "rows": texels.rows,
        "columns": texels.columns,
        "pitch_m": list(texels.pitch),
        "texel_size_m": list(texels.texel_size),
        "active": "".join("1" if active else "0" for active in texels.active),
        "enabled": "".join("1" if enabled else "0" for enabled in array.enabled),
        "full_scale": array.full_scale,
        "offset": array.offset,
        "unit": array.unit,
        "centre_m": list(array.centre),
        "rotation_rad": list(array.rotation),
    }


def _decode_array(entry: Mapping[str, Any]) -> RecordedArray:
    (pitch_x, pitch_y), (width, height) = entry["pitch_m"], entry["texel_size_m"]
    x, y, z = (_read_finite(value) for value in entry["centre_m"])
    about_x, about_y, about_z = (_read_finite(value) for value in entry["rotation_rad"])
    sizes = [_read_finite(value) for value in (pitch_x, pitch_y, width, height)]
    check_texel_count(entry["rows"], entry["columns"])
    full_scale, enabled = _read(entry, "full_scale", int), _decode_mask(entry["enabled"])
    if not 1 <= full_scale <= MOST_FULL_SCALE or len(enabled) != entry["rows"] * entry["columns"]:
        raise ValueError(f"full_scale is not 1..{MOST_FULL_SCALE}, or the mask is not that of the texels")
    offset = _read(entry, "offset", int) if "offset" in entry else 0
    if not 0 <= offset <= _LARGEST_OFFSET:
        raise ValueError(f"offset is not 0..{_LARGEST_OFFSET}")
    texels = TexelArray.grid(
        entry["rows"],
        entry["columns"],
        (sizes[0], sizes[1]),
        texel_size=(sizes[2], sizes[3]),
        active=_decode_mask(entry["active"]),
        name=_read(entry, "name", str),
    )
    return RecordedArray(
        texels=texels,
        enabled=enabled,
        counts=np.empty((0, texels.count), dtype=np.int32),
        full_scale=full_scale,
        offset=offset,
        unit=_read(entry, "unit", str),
        centre=(x, y, z),
        rotation=(about_x, about_y, about_z),
    )


def _read_finite(value: float) -> float:
    """Return a length or an angle as a float; raise a `ValueError` if it is not finite, or beyond a kilometre."""
    if not abs(value) <= _FARTHEST:
        raise ValueError(f"{value} is no length or angle")
    return float(value)


def _decode_mask(text: str) -> BoolArray:
    return np.array([digit == "1" for digit in text])
