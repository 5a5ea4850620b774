"""Terms of published models that act on a signal in time: low-pass filters and running means.

A term is a function of the texel forces at equal intervals and of the interval, and returns forces at the same
instants.  It begins in the steady state of the first sample.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastmodel import Butterworth
from meshes.array_types import FloatArray

#: Function of forces at equal intervals, shape (k, ...) [N], and of the interval [s].
Term = Callable[[FloatArray, float], FloatArray]


def recursion(share: float, interval: float) -> Term:
    """Return the filter y = share f + (1 - share) y, computed at intervals and held between them.

    Args:
        share: Share of the new sample [-].
        interval: Time between two computations [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        from scipy.signal import lfilter

        rounds = np.floor(np.arange(len(forces)) * step / interval + 1e-9).astype(int)
        at = np.minimum(np.ceil(np.arange(rounds[-1] + 1) * interval / step - 1e-9).astype(int), len(forces) - 1)
        start = (1 - share) * forces[:1]
        found, _ = lfilter([share], [1, share - 1], forces[at], axis=0, zi=start)
        return np.asarray(np.asarray(found)[rounds])

    return apply


def mean_of(samples: int, interval: float) -> Term:
    """Return the mean of the latest samples.

    Args:
        samples: Number of samples [-].
        interval: Time between two samples [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        count = max(1, round(samples * interval / step))
        padded = np.concatenate([np.repeat(forces[:1], count, axis=0), forces])
        sums = np.cumsum(padded, axis=0)
        return np.asarray((sums[count:] - sums[:-count]) / count)

    return apply


def butterworth(order: int, cutoff_hz: float) -> Term:
    """Return a Butterworth low-pass filter.

    Args:
        order: Number of poles [-].
        cutoff_hz: Frequency at which the gain is -3 dB [Hz].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        from scipy.signal import sosfilt, sosfilt_zi

        sections = Butterworth(order=order, cutoff_hz=cutoff_hz).sections(1 / step)
        start = sosfilt_zi(sections).reshape(len(sections), 2, *(1,) * (forces.ndim - 1)) * forces[0]
        found, _ = sosfilt(sections, forces, axis=0, zi=start)
        return np.asarray(found)

    return apply
