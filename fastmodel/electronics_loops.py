# ruff: noqa: PLR0917 -- numba kernels take positions
"""From felt forces to counts and grey levels in one pass, for numba: the same as `Electronics.counts` and `image`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def convert_loops(
    felt: FloatArray,
    coefficients: FloatArray,
    gains: FloatArray,
    numbers: FloatArray,
    active: npt.NDArray[np.bool_],
    counts: IntArray,
    image: npt.NDArray[np.uint8],
) -> None:
    """Fill counts and grey levels.

    Args:
        felt: Force on each texel, hysteresis, temperature and noise included, shape (n,) [N].
        coefficients: Of the characteristic, lowest first [1/N^k].
        gains: Of each texel, shape (n,); or none, shape (0,) [-].
        numbers: Threshold, saturation band and largest count [-].
        active: Which texels measure, shape (n,).
        counts: Filled, shape (n,) [-].
        image: Filled, shape (n,) [-].
    """
    threshold, band, most = numbers[0], numbers[1], numbers[2]
    knee = most - band
    for i in range(len(felt)):
        signal = 0.0
        for k in range(len(coefficients) - 1, -1, -1):
            signal = signal * felt[i] + coefficients[k]
        if len(gains) > 0:
            signal *= gains[i]
        signal = max(signal - threshold, 0.0)
        if signal > knee:
            signal = most if band == 0.0 else knee - band * np.expm1((knee - signal) / band)
        level = np.rint(signal) if active[i] else 0.0
        counts[i] = int(level)
        image[i] = int(min(np.rint(255.0 * level / most), 255.0))
