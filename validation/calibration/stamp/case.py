"""One recording of the stamp series: the array that was pressed, and its steady mean frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from meshes.array import FloatArray, TexelArray
from validation.calibration.noise_and_drift import find_load_onset
from validation.recordings import RecordedArray, Recording, RecordingError, dsa
from validation.recordings.series import StampFile

#: Times after the load was applied between which frames are averaged [s].  Counts drift under a constant weight (about
#: a fifth between 2 s and 12 s), so the same window is used for every recording; every recording lasts to its end.
WINDOW = (6.0, 9.0)
#: Fewest frames of which the noise about a straight trend can be estimated [-].
_FEWEST_FRAMES = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class StampCase:
    """One recording as it is fitted or scored.

    Attributes:
        file: The file, which gives the load.
        counts: Steady mean counts of the pressed array, shape (n,) [-].
        noise: Standard deviation of a texel's counts in the window after a straight trend is removed; root mean square
            over texels that are not zero [-].
        full_scale: Declared full scale [-].
        onset: Time at which the load was applied [s].
        sha256: Hash of the file.
    """

    file: StampFile
    counts: FloatArray
    noise: float
    full_scale: int
    onset: float
    sha256: str


def read_case(file: StampFile, array: TexelArray) -> StampCase:
    """Read one recording of a weight series.

    Args:
        file: The file.
        array: The sensor's array, which must be the one that was pressed.

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
    """The array with the largest sum of counts; it must have the sensor's layout."""
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
    pitch = " x ".join(f"{step * 1e3:g}" for step in array.pitch)
    return f"{array.columns} x {array.rows}, {int(array.active.sum())} active, pitch {pitch} mm"


def _steady_frames(recording: Recording, pressed: RecordedArray) -> tuple[float, FloatArray]:
    """Time of the load's onset [s], and the frames of the window, shape (k, n) [-]."""
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
    """Standard deviation about a straight trend, over texels that are never zero; 0 if it cannot be estimated [-]."""
    lit = frames[:, frames.min(axis=0) > 0]
    if len(lit) < _FEWEST_FRAMES or not lit.shape[1]:
        return 0.0
    rest = detrend(lit, axis=0)
    return float(np.sqrt((rest**2).sum() / (rest.size - 2 * lit.shape[1])))
