"""From a recording to a case: which array was pressed, and its steady mean frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from validation.recordings import RecordedArray, Recording, RecordingError, dsa
from validation.recordings.series import StampFile

FloatArray = npt.NDArray[np.float64]

#: The mean frame is taken this long after the load came on [s].  Counts drift under a constant weight (about a
#: fifth between 2 s and 12 s), so every recording is read at the same age; all of them reach the end of it.
WINDOW = (6.0, 9.0)
#: The load counts as on when the sum of counts passes this share of its final value for good [-].
_ON = 0.5
#: The final value is the median over this last part of the recording [s].
_LAST = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class StampCase:
    """One recording as it is fitted or scored.

    Attributes:
        file: Which file, and with it the load.
        counts: Steady mean counts of the pressed array, shape (n,) [-].
        noise: Standard deviation of a texel's counts in the window after a straight trend is removed, root mean
            square over texels that read anything [-].
        full_scale: Declared full scale [-].
        onset: When the load came on, after the first frame [s].
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
        RecordingError: If the file is damaged, another array was pressed, or the load was not on long enough.
    """
    recording = dsa.read(file.path)
    pressed = _pressed(recording, array)
    onset, frames = _window(recording, pressed)
    return StampCase(
        file=file,
        counts=frames.mean(axis=0),
        noise=_noise(frames),
        full_scale=pressed.full_scale,
        onset=onset,
        sha256=recording.sha256,
    )


def _pressed(recording: Recording, array: TexelArray) -> RecordedArray:
    """The array with most counts, if it is the sensor's."""
    sums = [int(each.counts.sum()) for each in recording.arrays]
    index = int(np.argmax(sums))
    pressed = recording.arrays[index]
    if not sums[index]:
        raise RecordingError(f"{recording.path}: no array was pressed; expected a weight on {array.name}")
    if not pressed.has_layout_of(array):
        raise RecordingError(
            f"{recording.path}: the pressed array (number {index}: {_layout(pressed.texels)}) is not {array.name} "
            f"({_layout(array)}); expected a sensor with the recording's array, such as sdh2-distal"
        )
    return pressed


def _layout(array: TexelArray) -> str:
    pitch = " x ".join(f"{step * 1e3:g}" for step in array.pitch)
    return f"{array.columns} x {array.rows}, {int(array.active.sum())} active, pitch {pitch} mm"


def _window(recording: Recording, pressed: RecordedArray) -> tuple[float, FloatArray]:
    """When the load came on and the frames of the window, shape (k, n)."""
    times, total = recording.times, pressed.counts.sum(axis=1)
    final = float(np.median(total[times >= times[-1] - _LAST]))
    below = np.flatnonzero(total < _ON * final)
    if not final > 0 or (below.size and below[-1] == len(times) - 1):
        raise RecordingError(f"{recording.path}: not under load at its end; expected a weight that stays on")
    onset = float(times[below[-1] + 1]) if below.size else float(times[0])
    inside = (times >= onset + WINDOW[0]) & (times < onset + WINDOW[1])
    if times[-1] < onset + WINDOW[1]:
        raise RecordingError(
            f"{recording.path}: the load is on for {times[-1] - onset:.1f} s; expected at least {WINDOW[1]:g} s"
        )
    return onset, pressed.counts[inside].astype(np.float64)


def _noise(frames: FloatArray) -> float:
    lit = frames[:, frames.min(axis=0) > 0]
    if len(lit) < 3 or not lit.shape[1]:  # noqa: PLR2004 -- a trend needs three frames to leave a residual
        return 0.0
    time = np.linspace(-1, 1, len(lit))
    fit = np.polynomial.polynomial.polyfit(time, lit, 1)
    rest = lit - np.polynomial.polynomial.polyval(time, fit).T
    return float(np.sqrt((rest**2).sum() / (rest.size - 2 * lit.shape[1])))
