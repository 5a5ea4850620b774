"""Choose the number of terms of the series on curved layers from a tolerance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from meshes.array_types import FloatArray

#: Smallest number of terms [-].
_FIRST = 64
#: Largest number of terms of the traction on the base [-].
_MOST_TERMS = 2**17
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
