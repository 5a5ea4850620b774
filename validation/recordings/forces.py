"""A force sensor's readings from a file of their own, put beside a tactile recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from validation.recordings import bags, tables
from validation.recordings.labels import LabelledRecording
from validation.recordings.recording import RecordingError

FloatArray = npt.NDArray[np.float64]

#: Times below this are taken as counted from the first frame, above it as seconds since 1970 [s].
_EPOCH = 1e8
#: Frames at the ends that may lie outside the readings [s].
_SLACK = 0.5


def with_forces(recording: LabelledRecording, path: str | Path, *, delay: float = 0.0) -> LabelledRecording:
    """Add a force sensor's readings to a recording.

    Args:
        recording: The frames.
        path: CSV with the columns `time` [s] and `force` [N], or a bag with wrenches, whose z component counts.  Times
            are seconds since 1970 by the same clock, or seconds after the first frame.
        delay: How much later the force sensor's clock shows the same instant [s].

    Raises:
        RecordingError: If the file cannot be read, or does not cover the frames.
    """
    place = Path(path)
    read = tables.read_forces if place.suffix.lower() == ".csv" else bags.read_forces
    times, forces = read(place)
    if times[0] > _EPOCH:
        times = times - recording.started.timestamp()
    times = times - delay
    if times[0] > _SLACK or times[-1] < recording.seconds - _SLACK:
        raise RecordingError(
            f"{place}: forces from {times[0]:.2f} s to {times[-1]:.2f} s do not cover the frames, "
            f"0 s to {recording.seconds:.2f} s after the first one"
        )
    return replace(recording, forces=forces, force_times=times)
