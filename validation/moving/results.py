"""Results of moving cases: how far and how late the frames of each model follow the true texel forces."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from meshes.array_types import FloatArray
from validation.results import Array, Column, Number, Result, result_model

#: Name of the true forces in the series of a moving case.
TRUTH = "truth"
#: Mean square difference of a shift over the smallest one, up to which it is as close [-], and rounding of it [N2].
_AS_CLOSE, _ROUNDING = 1.5, 1e-15
#: Longest delay that is searched, and the longest advance [s].
_LATEST, _EARLIEST = 0.5, 0.01


@result_model
class MovingScore(Result):
    """Scores of one model in a moving case, over its whole duration.

    Attributes:
        case: Name of the moving case.
        model: Name of the model.
        chain: What the model does in time, in words.
        error: Root mean square over time of the difference from the true texel forces, over that of the true ones [-].
        misplaced: Share of the force on wrong texels, both forces scaled to their own sum, so that a delay of the sum
            does not count; mean over the instants at which both have at least 5 % of the largest true force, without
            those of `touching` and `sliding` [-]; NaN without such instants.
        misplaced_high: The same: 95 % of these instants have at most this share [-].
        touching: The same, mean over the instants within 20 ms of one at which contact is made or lost [-].
        sliding: The same, mean over the other instants at which the place changes [-].
        delay: Shift in time at which the frames are closest to the model's own forces without filter and frames [s];
            NaN for empty images.
        overshoot: Largest total force over the largest true one, minus 1 [-].
        latency: Time from first touch to the first frame with a count above zero, mean over the phase of the frames
            [s]; NaN if nothing is touched for the first time, or no count rises.
        latency_worst: The same at the worst phase: half a frame later [s].
    """

    case: Annotated[str, Column(heading="case")]
    model: Annotated[str, Column(heading="model", small="{0.chain}")]
    chain: str
    error: Annotated[Number, Column(heading="error", unit="%", factor=100, meaning="rms over time, of the true rms")]
    misplaced: Annotated[Number, Column(heading="misplaced", unit="%", factor=100, meaning="at equal sums")]
    misplaced_high: Annotated[Number, Column(heading="95 %", unit="%", factor=100, meaning="95 % of instants below")]
    touching: Annotated[Number, Column(heading="touching", unit="%", factor=100, meaning="contact made or lost")]
    sliding: Annotated[Number, Column(heading="sliding", unit="%", factor=100, meaning="misplaced in a slide")]
    delay: Annotated[Number, Column(heading="delay", unit="ms", factor=1e3, meaning="of filter and frames")]
    overshoot: Annotated[Number, Column(heading="overshoot", unit="%", factor=100, meaning="of the largest sum")]
    latency: Annotated[Number, Column(heading="latency", unit="ms", factor=1e3, meaning="touch to frame, mean")]
    latency_worst: Annotated[Number, Column(heading="worst", unit="ms", factor=1e3, meaning="at the worst phase")]


@result_model
class MovingResult(Result):
    """Results of one moving case.

    Attributes:
        name: Name of the case.
        indenter: The indenter as text.
        states: Number of static presses from which the forces are interpolated [-].
        interpolation_error: Estimated share of the load on wrong texels that the interpolation causes [-].
        fastest: Highest frequency of the history [Hz].
        resonance: First shear resonance of the cover; its inertia is negligible below a tenth of it [Hz].
        warnings: Sentences about reasons not to rely on the case.
        scores: Scores of all models.
        times: Instants of the series, at most 500 that are equally spaced, shape (k,) [s].
        totals: Total force on the texels over time by model, shape (k,) each [N]; `truth` is the reference.
    """

    name: str
    indenter: str
    states: int
    interpolation_error: Number
    fastest: Number
    resonance: Number
    warnings: tuple[str, ...]
    scores: tuple[MovingScore, ...]
    times: Array
    totals: dict[str, Array]


def measure_error(true: FloatArray, found: FloatArray) -> float:
    """Compute the root mean square of a difference over that of the truth [-].

    Args:
        true: True texel forces, shape (k, n) [N].
        found: Texel forces of a model at the same instants [N].
    """
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def measure_misplaced(true: FloatArray, found: FloatArray, faint: float = 0.05) -> FloatArray:
    """Compute the share of the force on wrong texels at each instant, both forces scaled to their sums, shape (k,) [-].

    Args:
        true: True forces on the texels and outside, shape (k, n + 1) [N].
        found: Forces of a model at the same instants [N].
        faint: Share of the largest true sum; the result is NaN where one of the sums is not above it [-].
    """
    sums = np.array([true.sum(axis=1), found.sum(axis=1)])
    strong = (sums > faint * sums[0].max()).all(axis=0)
    one, other = (each[strong] / total[strong, None] for each, total in zip((true, found), sums, strict=True))
    shares = np.full(len(true), np.nan)
    shares[strong] = 0.5 * np.abs(one - other).sum(axis=1)
    return shares


def average(shares: FloatArray, level: float | None = None) -> float:
    """Return the mean of the numbers that are not NaN, or their quantile at a level; NaN if there is none."""
    known = shares[np.isfinite(shares)]
    if not len(known):
        return float("nan")
    return float(known.mean() if level is None else np.quantile(known, level))


def measure_delay(given: FloatArray, found: FloatArray, step: float) -> float:
    """Find the shift in time at which the output of a chain is closest to its input [s].

    The mean square of the difference over the common instants is minimised over whole samples, and then by a parabola
    through three samples.  A minimum at an end of the search, and constant forces, have no delay (NaN).

    Args:
        given: Texel forces at the input, shape (k, n) [N].
        found: Texel forces at the output at the same instants [N].
        step: Time between two instants [s].
    """
    from scipy.signal import find_peaks

    if not np.ptp(found, axis=0).any():
        return float("nan")
    count = len(given)
    shifts = np.arange(-min(round(_EARLIEST / step), count // 2), min(round(_LATEST / step), count // 2) + 1)

    def differ(shift: int) -> float:
        late, early = found[max(shift, 0) : count + min(shift, 0)], given[max(-shift, 0) : count - max(shift, 0)]
        return float(((late - early) ** 2).mean())

    errors = np.array([differ(shift) for shift in shifts.tolist()])
    # A periodic signal is nearly as close after each period; the smallest of these shifts is the delay.
    dips = find_peaks(-errors, height=-_AS_CLOSE * errors.min() - _ROUNDING)[0].tolist()
    if not dips:
        return float("nan")
    best = min(dips, key=lambda k: abs(shifts[k]))
    before, least, after = errors[best - 1 : best + 2].tolist()
    bend = before - 2 * least + after
    return float(step * (shifts[best] + (0.5 * (before - after) / bend if bend > 0 else 0.0)))
