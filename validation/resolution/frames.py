"""Frames for `locate`: counts of a recording, or an array of counts or forces, checked against the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes.array_types import BoolArray, FloatArray
from validation.errors import InputError
from validation.extras import require
from validation.recordings.importing import list_modules, open_recording
from validation.recordings.recording import choose_array
from validation.sensor_file import SensorDescription

#: Share of the largest count below zero that passes as noise around a subtracted zero [-].
BELOW_ZERO = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """Frames of the active texels of a sensor.

    Attributes:
        values: Counts [-] or forces [N], shape (frames, n).
        times: Time of each frame, shape (frames,) [s].
        forces: Whether they are forces.
        measured: Whether each texel was switched on, shape (n,).
    """

    values: FloatArray
    times: FloatArray
    forces: bool
    measured: BoolArray


def read_frames(
    sensor: SensorDescription, frames: npt.ArrayLike | str | Path, *, forces: bool = False, index: int | None = None,
    topic: str | None = None,
) -> Frames:  # fmt: skip
    """Read frames.

    Args:
        sensor: Sensor that made them.
        frames: A recording, or numbers of shape (n,) or (frames, n) for all n texels.
        forces: Whether the numbers are forces [N].
        index: Index of the array in the recording; None for the one that is pressed most.
        topic: Topic of the frames in bags of other programs.

    Raises:
        InputError: If they do not fit the sensor, are no counts, or are not finite.
        RecordingError: If the recording cannot be read.
    """
    array, measured = sensor.array, np.ones(sensor.array.count, dtype=bool)
    if isinstance(frames, str | Path):
        require(*list_modules([frames]))
        recording = open_recording(frames, topic=topic, sensor=array)
        recorded = recording.arrays[choose_array(recording, index)]
        shape = recorded.texels.rows, recorded.texels.columns
        if shape != (array.rows, array.columns):
            raise InputError(
                f"{frames}: {shape[0]} rows x {shape[1]} columns, but {sensor.name} has {array.rows} x "
                f"{array.columns}; name the sensor that made the recording, or another array with --array"
            )
        values, times, measured = recorded.counts.astype(float), recording.times, recorded.enabled
        place = str(frames)
    else:
        place = "frames"
        try:
            values = np.atleast_2d(np.asarray(frames, dtype=float))
        except (TypeError, ValueError):
            raise InputError(f"{place}: must be numbers of shape (frames, {array.count})") from None
        times = np.arange(len(values), dtype=float)
    if values.ndim != 2 or values.shape[1] != array.count:  # noqa: PLR2004 -- frames and texels
        raise InputError(f"{place}: shape {values.shape}; {sensor.name} takes (frames, {array.count}), row by row")
    if not len(values):
        raise InputError(f"{place}: holds no frame; at least one is needed")
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise InputError(f"{place}: frame {bad[0, 0]}, texel {bad[0, 1]} is not finite; leave the frame out")
    if not forces and (values != np.rint(values)).any():
        raise InputError(f"{place}: counts must be whole numbers; pass forces=True for forces in newtons")
    most = sensor.electronics.output_max
    if not forces and values.max() > most:
        raise InputError(
            f"{place}: counts up to {values.max():.0f}, but those of {sensor.name} end at {most}; name the sensor that "
            "made them"
        )
    return Frames(values=values[:, array.active], times=times, forces=forces, measured=measured[array.active])
