"""What a recording says of itself: the arrays and how they were loaded.  Kept as JSON inside the file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings.recording import FloatArray, RecordedArray, Recording, RecordingError

IntArray = npt.NDArray[np.int64]

FORMAT = "softcover-recording/1"


@dataclass(frozen=True, kw_only=True)
class Setup:
    """How a recording was made.

    Attributes:
        indenter: What pressed, in the words of the command line, e.g. `box:size=10.5mmx10.5mmx5mm`.
        load: Its weight or force [N]; None where unknown.
        note: Anything else.
        source: Port or file it came from.
        source_sha256: Hash of that file, hexadecimal; empty for a port.
        device: What the device said of itself: type, serial, firmware, threshold, gain, temperature.
    """

    indenter: str = ""
    load: float | None = None
    note: str = ""
    source: str = ""
    source_sha256: str = ""
    device: Mapping[str, str | int | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the load.

        Raises:
            ValueError: If it is negative or not finite.
        """
        if self.load is not None and not (np.isfinite(self.load) and self.load >= 0):
            raise ValueError(f"a load is a force of 0 N or more, not {self.load}")


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledRecording(Recording):
    """A recording with its labels: the one form into which every format is brought.

    Attributes:
        setup: How it was made.
        gaps: Where frames are missing, one line each, as they were noticed while recording.
        complete: Whether the file was closed properly; a killed recorder leaves all but the last half second.
        host_monotonic: Host's monotonic clock of each frame, shape (frames,); 0 where unknown [ns].
        ticks: Device's clock of each frame, shape (frames,); 0 where unknown.
        forces: A force sensor's readings beside the frames, shape (readings,) [N].
        force_times: When they were taken, after the first frame, shape (readings,) [s].
    """

    setup: Setup
    gaps: tuple[str, ...]
    complete: bool
    host_monotonic: IntArray
    ticks: IntArray
    forces: FloatArray = field(default_factory=lambda: np.empty(0))
    force_times: FloatArray = field(default_factory=lambda: np.empty(0))


def plain_array(
    rows: int,
    columns: int,
    counts: npt.NDArray[np.int32],
    *,
    pitch: tuple[float, float] = (3.4e-3, 3.4e-3),
    full_scale: int = 4095,
    name: str = "tactile",
) -> RecordedArray:
    """An array without masks, centred.

    Args:
        rows: Texels along y [-].
        columns: Texels along x [-].
        counts: Shape (frames, rows * columns).
        pitch: Distance between texels along x and y [m].
        full_scale: Largest count [-].
        name: What to call it.
    """
    return RecordedArray(
        texels=TexelArray.grid(rows, columns, pitch, name=name),
        enabled=np.ones(rows * columns, dtype=bool),
        counts=counts,
        full_scale=full_scale,
        unit="counts",
        centre=(0.0, 0.0, 0.0),
        rotation=(0.0, 0.0, 0.0),
    )


def label(recording: Recording, setup: Setup) -> LabelledRecording:
    """Add labels to a recording of another format; it has no clocks beside its times."""
    if isinstance(recording, LabelledRecording):
        return recording
    unknown = np.zeros(len(recording.times), dtype=np.int64)
    return LabelledRecording(
        **vars(recording), setup=setup, gaps=(), complete=True, host_monotonic=unknown, ticks=unknown
    )


def describe_array(array: RecordedArray) -> dict[str, Any]:
    """All of an array but its frames, as JSON values."""
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


def array_from(entry: Mapping[str, Any], frames: Sequence[npt.NDArray[np.uint16]]) -> RecordedArray:
    """The array that `describe_array` described, with its frames, each of shape (n,)."""
    texels = TexelArray.grid(
        int(entry["rows"]),
        int(entry["columns"]),
        _pair(entry["pitch_m"]),
        texel_size=_pair(entry["texel_size_m"]),
        active=_bits(entry["active"]),
        name=str(entry["name"]),
    )
    x, y, z = (float(value) for value in entry["centre_m"])
    a, b, c = (float(value) for value in entry["rotation_rad"])
    return RecordedArray(
        texels=texels,
        enabled=_bits(entry["enabled"]),
        counts=np.array(frames, dtype=np.int32).reshape(-1, texels.count),
        full_scale=int(entry["full_scale"]),
        unit=str(entry["unit"]),
        centre=(x, y, z),
        rotation=(a, b, c),
    )


def to_json(setup: Setup, *, arrays: list[dict[str, Any]], serial: str, clock: Mapping[str, int]) -> str:
    """The labels of a file as one JSON object.

    Args:
        setup: How it was made.
        arrays: From `describe_array`.
        serial: Serial number of the sensor.
        clock: `start_ns` (UTC) and `monotonic_ns` at the start.
    """
    labels = {"format": FORMAT, "serial": serial, "arrays": arrays, "clock": dict(clock)}
    return json.dumps({**labels, "setup": {**vars(setup), "device": dict(setup.device)}})


def from_json(text: str, place: str) -> tuple[Setup, dict[str, Any]]:
    """Setup and all labels of a file.

    Args:
        text: The JSON object.
        place: Name of the file, for messages.

    Raises:
        RecordingError: If it is not what `to_json` writes.
    """
    try:
        labels = json.loads(text)
        if labels["format"] != FORMAT:
            raise RecordingError(f"{place}: is a {labels['format']!r}; accepted: {FORMAT!r}")
        return Setup(**labels["setup"]), labels
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{place}: its labels cannot be read: {error}; expected {FORMAT!r}") from error


def _bits(text: str) -> npt.NDArray[np.bool_]:
    return np.array([digit == "1" for digit in text])


def _pair(values: list[float]) -> tuple[float, float]:
    return (float(values[0]), float(values[1]))
