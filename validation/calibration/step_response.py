"""What a step of the load tells about the filter of a sensor: order, cut-off and delay, or that it tells too little.

The sum of the counts after a step at a known instant is the step response of a Butterworth low-pass, delayed, between
two levels.  The upper level creeps as the transducer does (`fastmodel.signal.creep`).  Levels and creep are linear and
are solved within the least squares of cut-off and delay, for orders 1 to 4.  Orders whose sum of squares lies below the
bound of Fisher's F distribution are not excluded, and the intervals span them (D. M. Bates and D. G. Watts, Nonlinear
Regression Analysis, 1988, chapter 6).  If a jump lies below the bound too, only a lower bound of the cut-off is known.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fastmodel.signal.creep import MOST_CREEP, Creep
from meshes.array_types import BoolArray, FloatArray
from validation.calibration.uncertainty import Estimate
from validation.errors import InputError
from validation.recordings.recording import RecordedArray
from validation.results import Result, result_model

ComplexArray = npt.NDArray[np.complex128]

#: Orders that are tried [-].
_ORDERS = (1, 2, 3, 4)
#: Confidence of the intervals [-].
_LEVEL = 0.95
#: Time before and after the step that is used [s].
_BEFORE, _AFTER = 0.5, 1.0
#: Lowest cut-off [Hz], and the highest over the frame rate [-], which no frame tells from a jump.
_LOWEST, _HIGHEST = 0.2, 4.0
#: Number of cut-offs and delays from which a fit may start [-] [s], and of those from which it does.
_STARTS, _DELAYS, _TRIED = 15, (0.0, 2e-3, 5e-3, 0.01, 0.03), 2
#: Half width of the interval of the cut-off's logarithm from which it is not linear, and cut-offs of the grid then [-].
_WIDE, _GRID = 0.4, 60
#: Number of fitted parameters: two levels, creep, cut-off and delay [-].
_PARAMETERS = 5
#: Rate of the decay of a step [-].
_STEADY = np.zeros(1)
#: Largest delay [s].
_LATEST = 0.2
#: Share of the largest change of a texel from which a texel is used [-].
_PRESSED = 0.3
#: Smallest number of frames before and after the step [-].
_FEWEST = 5
#: Time before the named instant at which the step may have been [s].
_UNCERTAIN = 0.1
#: Residual over the noise at rest above which no filter describes a step [-], and least noise, of rounding [counts].
_WORSE, _ROUNDED = 3.0, 1.0
#: Change of the sum over its noise below which there is no step [-].
_STEP = 10.0


@result_model
class StepResponse(Result):
    """Filter of a sensor, from one step of the load.

    Attributes:
        orders: Orders that the recording does not exclude, most likely first [-].
        cutoff: Cut-off; only a lower bound if the frames do not tell the filter from none [Hz].
        delay: Delay of the sensor besides that of the filter [s].
        noise: Standard deviation of the sum of the counts about the fit [-].
        frames: Number of frames that were used [-].
        reason: Why the filter is not identifiable, and which recording would settle it; empty if it is.
    """

    orders: tuple[int, ...]
    cutoff: Estimate
    delay: Estimate
    noise: float
    frames: int
    reason: str


class _Fit(NamedTuple):
    """A filter of one order, its sum of squares [-], and the widths of log cut-off and delay for a noise of one."""

    order: int
    cutoff: float
    delay: float
    squares: float
    width: float
    delay_width: float


@functools.cache
def _find_poles(order: int) -> tuple[ComplexArray, ComplexArray]:
    """Return the poles of a Butterworth low-pass of angular cut-off 1, and the residues of its impulse response."""
    from scipy.signal import buttap

    poles = np.asarray(buttap(order)[1])
    # The transfer function is 1 / prod(s - p), whose gain at frequency zero is 1.
    return poles, np.array([1 / np.prod(pole - np.delete(poles, k)) for k, pole in enumerate(poles)])


def respond(order: int, phase: FloatArray, rates: FloatArray = _STEADY) -> FloatArray:
    """Return the response of an analogue Butterworth low-pass of unit gain to a load that decays [-].

    The load is the sum of exp(-r t) over the rates r; the default is a step.

    Args:
        order: Number of poles [-].
        phase: Time after the step times the angular cut-off; before the step it is negative, shape (k,) [-].
        rates: Rates of the decay over the angular cut-off, shape (m,) [-].
    """
    poles, residues = _find_poles(order)
    after = np.clip(phase, 0, None)[:, None]
    shares = residues[:, None] / (poles[:, None] + rates)
    response = np.exp(poles * after) @ shares.sum(axis=1) - np.exp(-rates * after) @ shares.sum(axis=0)
    return np.asarray(response.real * (phase > 0))


def sum_pressed(array: RecordedArray, times: FloatArray, at: float) -> tuple[FloatArray, FloatArray]:
    """Sum the counts of the texels that the step changes most, without frames in which one of them reads zero.

    A reading of zero may hide what lies below a threshold, so that it is no point of the step response.

    Args:
        array: The array with its counts in k frames.
        times: Instants of the frames, shape (k,) [s].
        at: Instant of the step [s].

    Returns:
        Instants of the kept frames [s] and their sums [-].

    Raises:
        InputError: If no texel measures, or one side of the step reads zero.
    """
    counts = array.counts[:, array.enabled & array.texels.active].astype(np.float64)
    near = np.abs(times - at) < _BEFORE
    after, before = near & (times > at), near & (times < at)
    if not counts.size:
        raise InputError("--step: every texel of the array is switched off")
    if not after.any() or not before.any():
        return times, counts.sum(axis=1)
    change = np.abs(np.median(counts[after], axis=0) - np.median(counts[before], axis=0))
    chosen = counts[:, change >= _PRESSED * change.max()]
    kept: BoolArray = np.asarray((chosen > 0).all(axis=1))
    if min((kept & after).sum(), (kept & before).sum()) < _FEWEST:
        raise InputError(
            "--step: the counts are zero on one side of the step, where a threshold hides the filter; step from a "
            "preload to a load"
        )
    return times[kept], chosen[kept].sum(axis=1)


def fit_step(times: FloatArray, sums: FloatArray, at: float) -> StepResponse:
    """Fit a filter to a step of known time.

    Args:
        times: Instants of the k frames, shape (k,) [s].
        sums: Sum of the counts of the pressed texels, shape (k,) [-].
        at: Instant of the step [s].

    Raises:
        InputError: If the step lies outside the recording, nothing changes there, or no filter describes it.
    """
    from scipy.stats import f as fisher
    from scipy.stats import t as student

    if not times[0] < at < times[-1]:
        raise InputError(f"--step: {at:g} s lies outside the recording, {times[0]:.4g} s to {times[-1]:.4g} s")
    used = (times > at - _BEFORE) & (times < at + _AFTER)
    times, sums = times[used] - at, sums[used]
    if min((times < 0).sum(), (times > 0).sum()) < _FEWEST:
        raise InputError(f"--step: fewer than {_FEWEST} frames before or after {at:g} s; name the instant of the step")
    rest = sums[times < 0]
    soon = (times > 0) & (times < 2 * _LATEST)
    # The noise is that well before the named instant, because a step a little before it must not pass for noise.
    early = rest[times[times < 0] < -_UNCERTAIN]
    change, noise = abs(float(np.median(sums[soon]) - np.median(rest))), float((early if len(early) else rest).std())
    if change == 0 or change < _STEP * noise / math.sqrt(len(rest)):
        raise InputError(f"--step: the counts do not change at {at:g} s")
    interval = float(np.median(np.diff(times)))
    fits = [_fit_order(order, times, sums, interval) for order in _ORDERS]
    best = min(fits, key=lambda fit: fit.squares)
    free = len(times) - _PARAMETERS
    bound = best.squares * (1 + float(fisher.ppf(_LEVEL, 1, free)) / free)
    left = math.sqrt(best.squares / free)
    if left > _WORSE * max(noise, _ROUNDED):
        raise InputError(
            f"--step: no filter describes the counts about {at:g} s (residual {left:.3g} counts, at rest {noise:.3g}); "
            "name the exact instant, hold the load for 1 s, and stay below saturation"
        )
    region = sorted((fit for fit in fits if fit.squares <= bound), key=lambda fit: fit.squares)
    spread = float(student.ppf(0.5 + 0.5 * _LEVEL, free)) * left
    if spread * max(fit.width for fit in region) > _WIDE:
        about = [fit.delay for fit in region]
        cutoffs, delays = _list_accepted(times, sums, interval, bound, about)
    else:
        cutoffs = [fit.cutoff * math.exp(sign * spread * fit.width) for fit in region for sign in (-1, 1)]
        delays = [max(0.0, fit.delay + sign * spread * fit.delay_width) for fit in region for sign in (-1, 1)]
    highest, what = _HIGHEST / interval, f"{len(times)} frames about the step"
    is_known = max(cutoffs) < highest * (1 - 1e-9)
    return StepResponse(
        orders=tuple(fit.order for fit in region),
        cutoff=Estimate(
            value=best.cutoff if is_known else math.nan,
            low=min(cutoffs),
            high=max(cutoffs) if is_known else math.inf,
            unit="Hz",
            fitted_on=what,
        ),
        delay=Estimate(value=max(0.0, best.delay), low=min(delays), high=max(delays), unit="s", fitted_on=what),
        noise=left,
        frames=len(times),
        reason=""
        if is_known
        else f"frames every {1e3 * interval:.3g} ms do not tell the filter from a jump; more frames per second or a "
        "larger step over the noise would",
    )


def _list_accepted(
    times: FloatArray, sums: FloatArray, interval: float, bound: float, about: Sequence[float]
) -> tuple[list[float], list[float]]:
    """List cut-offs [Hz] and delays [s] of a grid whose sum of squares lies below the bound, for any order.

    Delays of the grid lie within two frames of the fitted ones, `about`.  The lists end with the next values of the
    grid on both sides, because the region may end between two values.
    """
    cutoffs = np.geomspace(_LOWEST, _HIGHEST / interval, _GRID)
    delays = np.arange(max(0.0, min(about) - 2 * interval), max(about) + 2 * interval, interval / 8)
    accepted = np.array(
        [
            [
                any(float((each := _measure(order, cutoff, delay, times, sums)) @ each) <= bound for order in _ORDERS)
                for delay in delays.tolist()
            ]
            for cutoff in cutoffs.tolist()
        ]
    )

    def widen(values: FloatArray, kept: BoolArray) -> list[float]:
        found = np.flatnonzero(kept)
        first, last = (found[0], found[-1]) if len(found) else (0, len(values) - 1)
        return [float(values[max(first - 1, 0)]), float(values[min(last + 1, len(values) - 1)])]

    return widen(cutoffs, np.asarray(accepted.any(axis=1))), widen(delays, np.asarray(accepted.any(axis=0)))


def _fit_order(order: int, times: FloatArray, sums: FloatArray, interval: float) -> _Fit:
    """Fit cut-off and delay of a filter of one order; levels and creep are solved within."""
    from scipy.optimize import least_squares

    def measure(parameters: FloatArray) -> FloatArray:
        return _measure(order, math.exp(parameters[0]), float(parameters[1]), times, sums)

    low, high = np.array([math.log(_LOWEST), 0.0]), np.array([math.log(_HIGHEST / interval), _LATEST])
    starts = [np.array([cutoff, delay]) for cutoff in np.linspace(low[0], high[0], _STARTS) for delay in _DELAYS]
    first = sorted(starts, key=lambda start: float(measure(start) @ measure(start)))[:_TRIED]
    found = min(
        (least_squares(measure, start, bounds=(low - 1e-9, high), x_scale=(0.1, interval)) for start in first),
        key=lambda each: each.cost,
    )
    slopes = np.asarray(found.jac)
    width, delay_width = np.sqrt(np.diag(np.linalg.pinv(slopes.T @ slopes))).tolist()
    return _Fit(order, math.exp(found.x[0]), float(found.x[1]), 2 * float(found.cost), width, delay_width)


def _measure(order: int, cutoff: float, delay: float, times: FloatArray, sums: FloatArray) -> FloatArray:
    """Return the residuals of a filter, with the two levels and the creep that fit best, shape (k,) [-]."""
    angular = 2 * np.pi * cutoff
    phase = angular * (times - delay)
    # A step that creeps is a step less its states of creep, which decay.
    decay = respond(order, phase, 1 / (angular * Creep(MOST_CREEP).times))
    columns = np.stack([np.ones_like(times), respond(order, phase), decay], axis=1)
    solution, *_ = np.linalg.lstsq(columns, sums, rcond=None)
    return np.asarray(sums - columns @ solution)
