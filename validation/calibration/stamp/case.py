"""Reads one recording of the stamp under a known weight and averages the steady frames of the pressed array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from meshes.array import FloatArray, TexelArray
from validation.calibration.loading import find_load_onset
from validation.recordings import RecordedArray, Recording, RecordingError, dsa
from validation.recordings.series import StampFile

#: First and last time after the load was applied between which frames are averaged [s].  Counts drift under a constant
#: weight (by about a fifth between 2 s and 12 s), so all recordings are averaged over the same interval.  Every
#: recording lasts at least until the end of the interval.
WINDOW = (6.0, 9.0)
#: Smallest number of frames from which the noise about a straight trend can be estimated [-].
_FEWEST_FRAMES = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class StampCase:
    """One recording of the stamp, reduced to a mean image that models are fitted to or scored against.

    Attributes:
        file: The file of the recording; its name gives the load.
        counts: Mean counts of the n texels of the pressed array over `WINDOW`, shape (n,) [-].
        noise: Standard deviation of a texel's counts over `WINDOW` after a straight trend is removed; root mean square
            over the texels that are not zero [counts].
        full_scale: Largest count of the array, as stated in the file [-].
        onset: Time at which the load was applied, from the first frame [s].
        sha256: SHA-256 hash of the file.
    """

    file: StampFile
    counts: FloatArray
    noise: float
    full_scale: int
    onset: float
    sha256: str


def read_case(file: StampFile, array: TexelArray) -> StampCase:
    """Read one recording of a series of weights on the stamp.

    Args:
        file: The file of the recording.
        array: The array of the sensor; the pressed array of the recording must have the same layout.

    Raises:
        RecordingError: If the file is damaged, another array was pressed, or the load was applied for too short a time.
    """
    recording = dsa.read(file.path)
    pressed = _pressed_array(recording, array)
    onset, frames = _steady_frames(recording, pressed)
    return StampCase(
        file=file,
        counts=frames.mean(axis=0),
        noise=_noise(frames),
        full_scale=pressed.full_scale,
        onset=onset,
        sha256=recording.sha256,
    )


def _pressed_array(recording: Recording, array: TexelArray) -> RecordedArray:
    """Return the array of the recording with the largest sum of counts; it must have the layout of `array`."""
    sums = [int(each.counts.sum()) for each in recording.arrays]
    index = int(np.argmax(sums))
    pressed = recording.arrays[index]
    if not sums[index]:
        raise RecordingError(f"{recording.path}: no array was pressed; expected a weight on {array.name}")
    if not pressed.has_layout_of(array):
        raise RecordingError(
            f"{recording.path}: the pressed array (number {index}: {_describe_layout(pressed.texels)}) is not "
            f"{array.name} ({_describe_layout(array)}); expected the sensor of the recording, such as sdh2-distal"
        )
    return pressed


def _describe_layout(array: TexelArray) -> str:
    """Describe columns, rows, number of active texels and pitch of an array, for error messages."""
    pitch = " x ".join(f"{step * 1e3:g}" for step in array.pitch)
    return f"{array.columns} x {array.rows}, {int(array.active.sum())} active, pitch {pitch} mm"


def _steady_frames(recording: Recording, pressed: RecordedArray) -> tuple[float, FloatArray]:
    """Return the time at which the load was applied [s], and the k frames in `WINDOW` after it, shape (k, n) [-]."""
    times, counts = recording.times, pressed.counts.astype(np.float64)
    onset = find_load_onset(times, counts)
    if onset >= times[-1]:
        raise RecordingError(f"{recording.path}: not under load at its end; expected a weight that stays on")
    if times[-1] < onset + WINDOW[1]:
        raise RecordingError(
            f"{recording.path}: the load is on for {times[-1] - onset:.1f} s; expected at least {WINDOW[1]:g} s"
        )
    return onset, counts[(times >= onset + WINDOW[0]) & (times < onset + WINDOW[1])]


def _noise(frames: FloatArray) -> float:
    """Return the standard deviation of counts about a straight trend in time, over texels that are never zero [counts].

    The result is 0 if there are too few frames or no such texels.
    """
    lit = frames[:, frames.min(axis=0) > 0]
    if len(lit) < _FEWEST_FRAMES or not lit.shape[1]:
        return 0.0
    rest = detrend(lit, axis=0)
    return float(np.sqrt((rest**2).sum() / (rest.size - 2 * lit.shape[1])))
