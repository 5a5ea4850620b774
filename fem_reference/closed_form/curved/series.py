"""Choose the number of terms of the series on curved layers from a tolerance.

The traction on the base converges exponentially.  The displacement of the top converges like a power of the number of
terms, because its terms fall like those of the load over their order; a smooth taper of the last half of the terms
makes the error small except where the load itself has a jump or a kink.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import expit

from meshes.array_types import FloatArray

#: Smallest number of terms [-].
_FIRST = 64
#: Largest number of terms of the traction on the base [-].
_MOST_TERMS = 2**17
#: First and largest number of terms of the displacement of the top [-].
_FIRST_TOP, _MOST_TOP = 2**8, 2**13
#: Part of a sum that rounding leaves [-].
_ROUNDING = 1e-14
#: Order times span at which the transfer to the base is negligible: exp(-60) = 1e-26 [-].
_DEEP = 60.0


def count_base_terms(transfer: Callable[[FloatArray], FloatArray], span: float, tolerance: float) -> int:
    """Count the terms that the traction on the base needs.

    The transfer to the base decays exponentially, and no harmonic of a load is larger than that of the same load
    concentrated in one place, which grows no faster than the order.  So the sum of the norms of the transfer, times
    order + 1, over the terms that are left out bounds the truncation error of any load.

    Args:
        transfer: Function that computes the transfer to the base for orders, shape (n,), with shape (n, 2, 2) [-].
        span: Logarithm of the outer radius over that of the core [-].
        tolerance: Largest sum of the norms that are left out, over the sum of all norms [-].

    Raises:
        ValueError: If more than 131072 terms are needed, as in a layer thinner than about 0.0005 radii.
    """
    count = int(np.ceil(_DEEP / span)) + _FIRST
    if count > _MOST_TERMS:
        raise ValueError(f"the layer is too thin for its radius: its series needs more than {_MOST_TERMS} terms")
    norms = np.linalg.norm(transfer(np.arange(float(count))), axis=(1, 2)) * np.arange(1, count + 1)
    left_out = np.cumsum(norms[::-1])[::-1]
    return int(np.argmax(left_out <= max(tolerance, _ROUNDING) * left_out[0]))


def converge_top(evaluate: Callable[[int], FloatArray], tolerance: float) -> FloatArray:
    """Double the number of terms of a tapered series until its values settle.

    Args:
        evaluate: Function that sums a number of terms at some points, any shape.
        tolerance: Largest change by the last doubling, over the largest value [-].

    Raises:
        ValueError: If the values do not settle, as at a concentrated load, where they are infinite.
    """
    count = _FIRST_TOP
    before = evaluate(count)
    while count < _MOST_TOP:
        count *= 2
        now = evaluate(count)
        change, size = np.abs(now - before).max(initial=0.0), np.abs(now).max(initial=0.0)
        if change <= tolerance * size:
            return now
        before = now
    raise ValueError(
        f"the displacement changes by {change / size:.1g} of its largest value between {count // 2} and {count} terms: "
        "it is infinite at a concentrated load, and the series converges slowly where a traction jumps"
    )


def taper(count: int) -> FloatArray:
    """Return factors of the terms of a series: 1 in the first half, then falling smoothly to 0, shape (count,) [-]."""
    x = np.clip(2 * np.arange(count) / count - 1, 1e-3, 1 - 1e-3)
    return np.asarray(expit(1 / x - 1 / (1 - x)))
