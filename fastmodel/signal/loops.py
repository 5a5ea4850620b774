# ruff: noqa: PLR0917 -- numba kernels take positions
"""The signal chain as loops, for numba: filter, spread, and the way from felt forces to counts and grey levels.

All in one file: numba's cache notices changes in the file of a kernel only, not in those of what it calls.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import called_by_kernels

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@called_by_kernels()
def filter_loops(sections: FloatArray, memory: FloatArray, samples: FloatArray, filtered: FloatArray) -> None:
    """Samples through the cascade, one after the other and section by section.

    Args:
        sections: Coefficients b0 b1 b2 a0 a1 a2 of each, shape (s, 6) [-].
        memory: State of the transposed direct form II, two rows for each section, shape (2 s, n); moved on in place.
        samples: One after the other, shape (k, n).
        filtered: Filled with the last one filtered, shape (n,).
    """
    for k in range(samples.shape[0]):
        for i in range(samples.shape[1]):
            filtered[i] = samples[k, i]
        for s in range(sections.shape[0]):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            for i in range(samples.shape[1]):
                x = filtered[i]
                y = b0 * x + memory[2 * s, i]
                memory[2 * s, i] = b1 * x - a1 * y + memory[2 * s + 1, i]
                memory[2 * s + 1, i] = b2 * x - a2 * y
                filtered[i] = y


@called_by_kernels()
def convert_loops(
    felt: FloatArray,
    coefficients: FloatArray,
    gains: FloatArray,
    numbers: FloatArray,
    active: npt.NDArray[np.bool_],
    counts: IntArray,
    image: npt.NDArray[np.uint8],
) -> None:
    """Fill counts and grey levels: the same as `Electronics.counts` and `image`.

    Args:
        felt: Force on each texel, hysteresis, temperature and noise included, shape (n,) [N].
        coefficients: Of the characteristic, lowest first [1/N^k].
        gains: Of each texel, shape (n,); or none, shape (0,) [-].
        numbers: Threshold, saturation band and largest count [-].
        active: Which texels measure, shape (n,).
        counts: Filled, shape (n,) [-].
        image: Filled, shape (rows, columns) of n together [-].
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
        image[i // image.shape[1], i % image.shape[1]] = int(min(np.rint(255.0 * level / most), 255.0))


def chain_loops(
    sections: FloatArray,
    memory: FloatArray,
    samples: FloatArray,
    operator: FloatArray,
    coefficients: FloatArray,
    gains: FloatArray,
    numbers: FloatArray,
    active: npt.NDArray[np.bool_],
    filtered: FloatArray,
    texel_forces: FloatArray,
    counts: IntArray,
    image: npt.NDArray[np.uint8],
) -> float:
    """The whole chain of a frame, where neither hysteresis, temperature nor noise come between; what is outside [N].

    Args:
        sections: As `filter_loops` takes them, and the next three.
        memory: See there.
        samples: Force on each texel and the sum of everything, shape (k, n + 1) [N].
        operator: The spread, `[loaded texel, texel]`, shape (n, n); or none, shape (0, 0) [-].
        coefficients: As `convert_loops` takes them, and the next three.
        gains: See there.
        numbers: See there.
        active: See there.
        filtered: Filled with the last sample filtered, shape (n + 1,) [N].
        texel_forces: Filled, shape (n,) [N].
        counts: Filled, shape (n,) [-].
        image: Filled, shape (rows, columns) of n together [-].
    """
    filter_loops(sections, memory, samples, filtered)
    for i in range(len(texel_forces)):
        texel_forces[i] = 0.0 if len(operator) > 0 else filtered[i]
    for j in range(len(operator)):
        # row by row, so that the processor takes several texels at once; most texels bear nothing
        if filtered[j] != 0.0:
            for i in range(len(texel_forces)):
                texel_forces[i] += operator[j, i] * filtered[j]
    outside: float = filtered[len(texel_forces)]
    for i in range(len(texel_forces)):
        outside -= texel_forces[i]
    convert_loops(texel_forces, coefficients, gains, numbers, active, counts, image)
    return outside
