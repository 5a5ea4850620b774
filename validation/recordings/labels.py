"""Converts the labels of a recording (set-up, arrays, serial number, clocks) to and from a JSON object in its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshes import TexelArray
from validation.recordings.recording import BoolArray, RecordedArray, RecordingError, Setup

#: Name and version of the format of the labels; files with another name or version are refused.
FORMAT = "softcover-recording/1"


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
            "setup": {**vars(labels.setup), "device": dict(labels.setup.device)},
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
    try:
        entries = json.loads(text)
        _check_format(entries["format"], path)
        return Labels(
            setup=Setup(**entries["setup"]),
            arrays=tuple(_decode_array(entry) for entry in entries["arrays"]),
            serial=str(entries["serial"]),
            start=int(entries["clock"]["start_ns"]),
            monotonic=int(entries["clock"]["monotonic_ns"]),
        )
    except RecordingError:
        raise
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: its labels cannot be read: {error}; expected {FORMAT!r}") from error


def _check_format(name: object, path: Path) -> None:
    if name != FORMAT:
        raise RecordingError(f"{path}: its labels have the format {name!r}; accepted: {FORMAT!r}")


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
        "unit": array.unit,
        "centre_m": list(array.centre),
        "rotation_rad": list(array.rotation),
    }


def _decode_array(entry: Mapping[str, Any]) -> RecordedArray:
    (pitch_x, pitch_y), (width, height) = entry["pitch_m"], entry["texel_size_m"]
    x, y, z = (float(value) for value in entry["centre_m"])
    about_x, about_y, about_z = (float(value) for value in entry["rotation_rad"])
    texels = TexelArray.grid(
        int(entry["rows"]),
        int(entry["columns"]),
        (float(pitch_x), float(pitch_y)),
        texel_size=(float(width), float(height)),
        active=_decode_mask(entry["active"]),
        name=str(entry["name"]),
    )
    return RecordedArray(
        texels=texels,
        enabled=_decode_mask(entry["enabled"]),
        counts=np.empty((0, texels.count), dtype=np.int32),
        full_scale=int(entry["full_scale"]),
        unit=str(entry["unit"]),
        centre=(x, y, z),
        rotation=(about_x, about_y, about_z),
    )


def _decode_mask(text: str) -> BoolArray:
    return np.array([digit == "1" for digit in text])
