"""Finds the frames of a recording without load, and subtracts the zero of each texel from its counts.

Frames at rest lie before the load, after it (the tool was lifted), between loads (force channel), or in a recording of
their own.  Between groups of such frames the zero of a texel is interpolated linearly in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import detrend
from scipy.stats import linregress

from meshes.array_types import FloatArray
from validation.recordings.recording import BoolArray, RecordingError

IntArray = npt.NDArray[np.intp]

#: Smallest number of frames at rest at the start of a recording, and for a deviation about a straight trend [-].
_FLAT_FRAMES = 4
#: Smallest change of the first principal component of the counts that indicates a change of the load, over the standard
#: deviation of its noise [-].
_STEP_OVER_NOISE = 6.0
#: Quantile, over the frames, of the change of the first principal component that counts as the whole change [-].
_WHOLE = 0.95
#: Share of the whole change above which the load counts as applied [-].
APPLIED_SHARE = 0.5
#: Number of steps of the power iteration for the first principal component [-].  Few steps suffice, because a change of
#: the load affects the counts far more than anything else.
_POWERS = 10
#: Longest time in which a load is applied or removed, from the last frame at rest to half of the whole change [s].
_STEP_TIME = 1.0
#: Largest drift within `_STEP_TIME` of the counts at rest, over the whole change [-].
_DRIFT_SHARE = 0.1
#: Largest deviation of the counts after the load from their level at rest, over the whole change [-].  Rubber recovers.
_RECOVERY_SHARE = 0.1
#: Quantile of the counts over the texels, below which counts are those of untouched texels [-].
_UNTOUCHED = 0.25
#: Sum of untouched counts, over the sum of all counts, above which the counts of a recording without frames at rest are
#: not zeroed [-]; also the smallest share of an image at which a drift is stated.
_ZERO_SHARE = 0.01
#: Number of parts of a recording of which the one with the largest counts is taken for loaded [-].
_PARTS = 10
#: Number of standard errors by which a count differs from rest [-].
_LIT_ERRORS = 5.0
#: Height above the level at rest of a force channel up to which a frame is at rest, over the largest force [-].
_UNLOADED_SHARE = 0.005
#: Largest force at rest of a force channel, over the largest force, that is taken for an offset of the channel [-].
_OFFSET_SHARE = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Zeroed:
    """Counts of n texels that are zero at rest and rise under load.

    Attributes:
        counts: Counts minus the zero, turned if they fall under load, shape (frames, n) [-].
        sign: 1 if the recorded counts rise under load, -1 if they fall.
        zero: Mean zero that was subtracted, shape (n,) [-].
        unloaded: Frames at rest, shape (frames,).
        rest: Mean of the counts at rest after subtraction, shape (n,) [-]; above 0 where a firmware clips noise.
        noise: Standard deviation of the counts at rest about a straight trend, shape (n,) [-]; NaN if not known.
        at_rest: Number of frames at rest [-].
        drift: Slope of the sum of counts at rest and its standard error, if rest is known at one time only [1/s].
        rest_time: Mean time of the frames at rest [s].
    """

    counts: FloatArray
    sign: int
    zero: FloatArray
    unloaded: BoolArray
    rest: FloatArray
    noise: FloatArray
    at_rest: int
    drift: tuple[float, float]
    rest_time: float

    def find_floor(self, frames: BoolArray) -> FloatArray:
        """Return the mean count of some frames up to which a texel does not differ from rest, shape (n,) [-]."""
        own = self.counts[frames]
        noise = self.noise
        for other in (deviate(own), _deviate_by_steps(self.counts)):
            noise = np.where(np.isfinite(noise), noise, other)
        error = noise * np.sqrt(1 / len(own) + (1 / self.at_rest if self.at_rest else 0.0))
        return np.asarray(self.rest + _LIT_ERRORS * error)

    def describe_drift(self, time: float, total: float) -> str:
        """State a drift at rest that would change an image with a sum of counts at a time [s]; empty if it does not."""
        slope, error = self.drift
        share = slope * (time - self.rest_time) / max(total, 1e-9)
        if abs(slope) <= 3 * error or abs(share) <= _ZERO_SHARE:
            return ""
        return (
            f"the counts at rest drift by {slope:.3g} +- {error:.2g} 1/s in all, {100 * share:+.0f} % of the image if "
            "it goes on; record the unloaded array before and after the load"
        )


def find_rest(times: FloatArray, counts: FloatArray, recovery: float = 0.0) -> int:
    """Count the frames at rest at the start of a recording, before a load is applied or removed.

    The largest change of the image over time (first principal component) must first stay within its noise about a
    constant or a slow straight drift, then exceed the noise by a factor, and reach half of its size within one second.
    A recording that begins under load creeps.  It changes fastest at its start and has no frames at rest.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].
        recovery: Accepted deviation, besides noise, over the whole change [-].

    Returns:
        Number of frames at rest, 0 if the recording does not begin at rest.
    """
    if len(times) < 2 * _FLAT_FRAMES:
        return 0
    main, noise = _project(counts)
    level, slope = float(np.median(main[:_FLAT_FRAMES])), 0.0
    moved = np.abs(main - level)
    whole = float(np.quantile(moved, _WHOLE))
    half = int(np.argmax(moved >= APPLIED_SHARE * whole))
    early = times < times[half] - _STEP_TIME
    if early.sum() >= 2 * _FLAT_FRAMES and np.ptp(times[early]) > 0:
        line = linregress(times[early], main[early])
        if abs(line.slope) > 3 * line.stderr:
            level, slope = float(line.intercept), float(line.slope)
    off = np.abs(main - level - slope * times)
    still_most, most = (max(factor * noise, recovery * whole) for factor in (3.0, _STEP_OVER_NOISE))
    beyond = off[: half + 1] > most
    if not beyond.any() or beyond[:_FLAT_FRAMES].any() or abs(slope) * _STEP_TIME > _DRIFT_SHARE * whole:
        return 0
    still = int(np.flatnonzero(off[: np.argmax(beyond)] <= still_most)[-1])
    return still + 1 if times[half] - times[still] <= _STEP_TIME else 0


def find_unloaded(times: FloatArray, counts: FloatArray) -> BoolArray:
    """Find the frames at rest at the start and the end of a recording under one load, shape (frames,).

    If the counts have one level at the start and another at the end, the start is at rest, unless the counts at the end
    are near zero and those at the start are not.
    """
    unloaded = np.zeros(len(times), dtype=bool)
    start = find_rest(times, counts)
    end = find_rest(times[-1] - times[::-1], counts[::-1], _RECOVERY_SHARE)
    if _is_zeroed(counts):
        top = APPLIED_SHARE * max(_measure(part) for part in np.array_split(counts, min(_PARTS, len(counts))))
        start = start if _measure(counts[:start]) < top else 0
        end = end if _measure(counts[len(counts) - end :]) < top else 0
    if start:
        main, _ = _project(counts)
        moved = np.abs(main - np.median(main[:start]))
        last = int(np.flatnonzero(moved >= APPLIED_SHARE * np.quantile(moved, _WHOLE))[-1])
        unloaded[:start] = True
        unloaded[last + 1 :] = times[last + 1 :] > times[last] + min(_STEP_TIME, (times[-1] - times[last]) / 2)
    elif end:
        unloaded[-end:] = True
    return unloaded


def find_unloaded_by_force(forces: FloatArray) -> BoolArray:
    """Find groups of successive frames in which a force channel stays at its own level at rest, shape (frames,).

    The level may differ from zero by a small share of the largest force.  The noise follows from second differences,
    which a load that rises steadily does not change: their standard deviation is sqrt(6) times that of the noise.

    Args:
        forces: Force at the time of each frame, shape (frames,) [N].
    """
    unloaded = np.zeros(len(forces), dtype=bool)
    if len(forces) < _FLAT_FRAMES:
        return unloaded
    noise = 1.4826 * float(np.median(np.abs(np.diff(forces, n=2)))) / np.sqrt(6)
    top, low = float(forces.max()), float(np.sort(forces)[_FLAT_FRAMES - 1])
    reach = max(_LIT_ERRORS * noise, _UNLOADED_SHARE * (top - low))
    level = float(np.median(forces[forces <= low + reach]))
    if abs(level) > _OFFSET_SHARE * top + _LIT_ERRORS * noise or reach > APPLIED_SHARE * (top - level):
        return unloaded
    still = forces <= level + reach
    for group in _list_groups(still):
        unloaded[group] = len(group) >= _FLAT_FRAMES
    return unloaded


def subtract_zero(
    times: FloatArray, counts: FloatArray, measured: BoolArray, unloaded: BoolArray, *, rest: FloatArray | None = None
) -> Zeroed:
    """Subtract the zero of each texel, and turn counts that fall under load.

    A texel that reads zero in at least half of the frames at rest keeps its counts: a firmware clips or subtracted
    them.  After a load rubber recovers, so that texels that were pressed stand above the drift of the others; they take
    the median drift of the others.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].
        measured: Whether each texel exists and was switched on, shape (n,).
        unloaded: Frames at rest, shape (frames,).
        rest: Frames of a recording at rest, which give the zero instead, shape (any, n) [-]; no frames for counts that
            are zeroed already.

    Raises:
        RecordingError: If no frame is at rest and the counts are not zero where nothing presses, or if some texels are
            pressed at rest; without the file.
    """
    groups = _list_groups(unloaded)
    parts = [counts[each] for each in groups] if rest is None else [rest]
    texels = counts.shape[1]
    if not any(map(len, parts)):
        if rest is None and not _is_zeroed(counts[:, measured]):
            raise RecordingError(
                f"{np.median(counts[:, measured]):.0f} counts on texels that nothing presses, and no frames at rest: "
                "expected a recording that begins before the load, or ends after it, and changes when the array is "
                "pressed; else write in a data-set file zero = 'rest.csv', a recording of the unloaded array, or "
                "zero = 'none' for counts that are zeroed already"
            )
        levels, frames = np.zeros((1, texels)), 0
        noise, mean, drift, at = np.full(texels, np.nan), np.zeros(texels), (0.0, np.inf), np.zeros(1)
    else:
        together = np.vstack(parts)
        frames, clipped = len(together), (together == 0).mean(axis=0) >= APPLIED_SHARE
        known = [part for part in parts if len(part) >= _FLAT_FRAMES] or parts
        noise = np.sqrt(sum(deviate(part) ** 2 * len(part) for part in known) / sum(map(len, known)))
        levels = np.where(clipped, 0.0, np.array([part.mean(axis=0) for part in parts]))
        at = np.array([times[each].mean() for each in groups]) if rest is None else np.zeros(1)
        drift = _find_drift(times, counts[:, measured & ~clipped], groups) if rest is None else (0.0, np.inf)
        mean = np.where(clipped, together.mean(axis=0), 0.0)
    above = counts - _interpolate(times, at, levels)
    image = np.where(measured, np.median(above[~unloaded] if not unloaded.all() else above, axis=0), 0.0)
    standing = measured & (np.abs(levels[0]) > 3 * np.nan_to_num(noise) + 1)
    clips = frames > 0 and rest is None and (levels[0] == 0)[measured].mean() >= APPLIED_SHARE
    if clips and np.abs(levels[0][standing]).sum() > _ZERO_SHARE * np.abs(image).sum():
        raise RecordingError(
            f"{standing.sum()} texels have {np.median(levels[0][standing]):.0f} counts at rest, where others read 0: "
            "expected an unloaded array; write in a data-set file zero = 'none' for a load that was on before, or "
            "zero = 'rest.csv', a recording of the unloaded array"
        )
    sign = -1 if image.sum() < 0 else 1
    zero = _interpolate(times, at, _remove_recovery(levels, noise, image, measured, sign))
    return Zeroed(
        counts=sign * (counts - zero), sign=sign, zero=zero.mean(axis=0), unloaded=unloaded, rest=np.abs(mean),
        noise=noise, at_rest=frames, drift=(sign * drift[0], drift[1]), rest_time=float(at.mean()),
    )  # fmt: skip


def _list_groups(chosen: BoolArray) -> list[IntArray]:
    """Return the indices of each group of successive frames that are chosen."""
    index = np.flatnonzero(chosen)
    return np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(index) else []


def _interpolate(times: FloatArray, at: FloatArray, levels: FloatArray) -> FloatArray:
    """Return the zeros at some times between those of the groups of frames at rest, shape (times, n) [-]."""
    return np.column_stack([np.interp(times, at, level) for level in levels.T])


def _remove_recovery(
    levels: FloatArray, noise: FloatArray, image: FloatArray, measured: BoolArray, sign: int
) -> FloatArray:
    """Return the zeros of groups of frames at rest, with the median drift where a pressed texel stands above the rest.

    Args:
        levels: Mean counts of each group, shape (groups, n) [-].
        noise: Standard deviation of the counts, shape (n,) [-].
        image: Change of the counts by the load, shape (n,) [-].
        measured: Whether each texel exists and was switched on, shape (n,).
        sign: Sign of the image.
    """
    change = sign * (levels - levels[0])
    pressed = sign * image > _LIT_ERRORS * np.nan_to_num(noise)
    others = change[:, measured & ~pressed] if (measured & ~pressed).any() else change[:, measured]
    typical = np.median(others, axis=1, keepdims=True)
    spread = 1.4826 * np.median(np.abs(others - typical), axis=1, keepdims=True)
    recovering = pressed & (change > typical + 3 * spread + np.nan_to_num(noise) / 2)
    return np.asarray(levels[0] + sign * np.where(recovering, typical, change))


def _find_drift(times: FloatArray, counts: FloatArray, groups: Sequence[IntArray]) -> tuple[float, float]:
    """Return the slope of the sum of counts in one group of frames at rest, and its error; no slope for several."""
    if len(groups) != 1 or len(groups[0]) < _FLAT_FRAMES or not counts.shape[1] or not np.ptp(times[groups[0]]):
        return 0.0, float("inf")
    line = linregress(times[groups[0]], counts[groups[0]].sum(axis=1))
    return float(line.slope), float(line.stderr)


def _is_zeroed(counts: FloatArray) -> bool:
    """Return whether untouched texels read about zero: their counts are below noise, or a small part of the image."""
    level = np.abs(np.median(counts, axis=0))
    low = float(np.quantile(level, _UNTOUCHED))
    noise = float(np.median(np.median(np.abs(np.diff(counts, axis=0)), axis=0))) if len(counts) > 1 else 0.0
    top = float(np.abs(counts).max(axis=0).sum())
    return low <= noise + 1 or low * counts.shape[1] <= _ZERO_SHARE * top


def _measure(counts: FloatArray) -> float:
    """Return the sum of the absolute mean counts of some frames; 0 without frames [-]."""
    return float(np.abs(counts.mean(axis=0)).sum()) if len(counts) else 0.0


def deviate(frames: FloatArray) -> FloatArray:
    """Return the standard deviation of each texel about a straight trend, shape (n,) [-]; NaN for few frames."""
    if len(frames) < _FLAT_FRAMES:
        return np.full(frames.shape[1], np.nan)
    return np.asarray(detrend(frames, axis=0).std(axis=0, ddof=2))


def _deviate_by_steps(frames: FloatArray) -> FloatArray:
    """Return the standard deviation of each texel from successive differences, shape (n,) [-]; 0 for one frame."""
    if len(frames) == 1:
        return np.zeros(frames.shape[1])
    return np.asarray(1.4826 * np.median(np.abs(np.diff(frames, axis=0)), axis=0) / np.sqrt(2))


def _project(counts: FloatArray) -> tuple[FloatArray, float]:
    """Return the first principal component of the counts, shape (frames,) [-], and the noise of one frame [-]."""
    centred = counts - np.median(counts, axis=0)
    # The power iteration starts from the frame that differs most from the median.
    image = centred[np.argmax(np.abs(centred).sum(axis=1))]
    for _ in range(_POWERS):
        image = centred.T @ (centred @ image)
        image = image / max(float(np.linalg.norm(image)), np.finfo(float).tiny)
    main = centred @ image
    # The standard deviation of one frame follows from the median of the differences between successive frames.
    return main, max(1.4826 * float(np.median(np.abs(np.diff(main)))) / np.sqrt(2), 1.0)
