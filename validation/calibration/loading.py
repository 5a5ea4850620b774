"""Finds when a recording's load was applied, and how the counts creep after it."""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Sum of counts over its final value [-]: the load counts as applied from the time after which the sum of counts stays
#: above this share.
_APPLIED_SHARE = 0.5
#: Length of the part at the end of a recording whose median sum of counts is the final value [s].
_FINAL_PERIOD = 2.0
#: Time after loading at which the creep factor 1 + c ln(t / t0) is one, and from which it is fitted [s].
CREEP_START = 2.0
#: Fewest frames of a part at rest [-].
_FLAT_FRAMES = 4
#: Least change of the image by a load over its noise [-].
_STEP_OVER_NOISE = 6.0
#: Quantile of the change over time that counts as the whole of it [-].
_WHOLE = 0.95
#: Steps of the power iteration for the principal component; the change by a load dominates all others [-].
_POWERS = 10
#: Longest time in which half of the change happens [s].
_STEP_TIME = 1.0
#: Smallest ratio of last to first time of a fit of creep [-].
_SHORTEST_CREEP = 2.0


def find_rest(times: FloatArray, counts: FloatArray) -> int:
    """Count the frames at the start of a recording that show the sensor at rest, before a load is put on or removed.

    The largest change of the image over time (first principal component) must stay within its noise and then exceed it
    by a factor, and reach half of its size within one second.  A recording that begins under load creeps: it changes
    fastest at its start, and has no such part.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].

    Returns:
        Number of frames at rest, 0 if the recording does not begin at rest.
    """
    if len(times) < 2 * _FLAT_FRAMES:
        return 0
    centred = counts - np.median(counts, axis=0)
    image = centred[np.argmax(np.abs(centred).sum(axis=1))]  # the frame that differs most from the median
    for _ in range(_POWERS):
        image = centred.T @ (centred @ image)
        image = image / max(float(np.linalg.norm(image)), np.finfo(float).tiny)
    main = centred @ image
    moved = np.abs(main - np.median(main[:_FLAT_FRAMES]))
    # The standard deviation of one frame, from the median of the differences between successive ones.
    noise = max(1.4826 * float(np.median(np.abs(np.diff(main)))) / np.sqrt(2), 1.0)
    beyond = moved > _STEP_OVER_NOISE * noise
    if not beyond.any() or beyond[:_FLAT_FRAMES].any():
        return 0
    still = int(np.flatnonzero(moved[: np.argmax(beyond)] <= 3 * noise)[-1])
    half = int(np.argmax(moved >= _APPLIED_SHARE * np.quantile(moved, _WHOLE)))
    return still + 1 if times[half] - times[still] <= _STEP_TIME else 0


def find_load_onset(times: FloatArray, counts: FloatArray) -> float:
    """Find the time from which the sum of counts stays above half its final value.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].

    Returns:
        Time at which the load was applied; the time of the last frame if the recording ends without load [s].
    """
    total = counts.sum(axis=1)
    final = float(np.median(total[times >= times[-1] - _FINAL_PERIOD]))
    below = np.flatnonzero((total < _APPLIED_SHARE * final) | (final <= 0))
    return float(times[min(below[-1] + 1, len(times) - 1)]) if len(below) else float(times[0])


def find_creep(age: FloatArray, counts: FloatArray, threshold: float) -> float:
    """Fit the creep coefficient c of counts + threshold = s (1 + c ln(t / 2 s)) from 2 s after loading to the end.

    The sum over the texels that are lit throughout is fitted by least squares; saturation is not taken into account.

    Args:
        age: Time since loading of each frame, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].
        threshold: Counts that the firmware subtracted from each texel [-].

    Returns:
        The coefficient; NaN if the recording is shorter than twice 2 s under load, or no texel is lit [-].
    """
    late = age >= CREEP_START
    lit = counts[late]
    lit = lit[:, (lit > 0).all(axis=0)] if len(lit) else lit
    if not lit.size or age[-1] < _SHORTEST_CREEP * CREEP_START:
        return float("nan")
    slope, start = np.polyfit(np.log(age[late] / CREEP_START), (lit + threshold).sum(axis=1), 1)
    return float(slope / start)
