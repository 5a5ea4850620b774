"""Terms of published models that act on a signal in time: low-pass filters, means, springs with mass, relaxation.

A term is a function of the texel forces at equal intervals and of the interval, and returns forces at the same
instants.  It begins in the steady state of the first sample.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastmodel import Butterworth
from fastmodel.signal.butterworth import list_sections
from meshes.array_types import FloatArray

#: Function of forces at equal intervals, shape (k, ...) [N], and of the interval [s].
Term = Callable[[FloatArray, float], FloatArray]


def _run(above: FloatArray | list[float], below: FloatArray | list[float], forces: FloatArray) -> FloatArray:
    """Run the filter with these coefficients of the powers of the delay, settled at the first forces."""
    from scipy.signal import lfilter, lfilter_zi

    start = lfilter_zi(above, below).reshape(-1, *(1,) * (forces.ndim - 1)) * forces[:1]
    return np.asarray(lfilter(above, below, forces, axis=0, zi=start)[0])


def recursion(share: float, interval: float) -> Term:
    """Return the filter y = share f + (1 - share) y, computed at intervals and held between them.

    Args:
        share: Share of the new sample [-].
        interval: Time between two computations [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        rounds = np.floor(np.arange(len(forces)) * step / interval + 1e-9).astype(int)
        at = np.minimum(np.ceil(np.arange(rounds[-1] + 1) * interval / step - 1e-9).astype(int), len(forces) - 1)
        return np.asarray(_run([share], [1.0, share - 1], forces[at])[rounds])

    return apply


def mean_of(samples: int, interval: float) -> Term:
    """Return the mean of the latest samples.

    Args:
        samples: Number of samples [-].
        interval: Time between two samples [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        from scipy.ndimage import uniform_filter1d

        count = max(1, round(samples * interval / step))
        return np.asarray(uniform_filter1d(forces, count, axis=0, mode="nearest", origin=(count - 1) // 2))

    return apply


def mean_between(interval: float) -> Term:
    """Return the mean of all samples since the last read, held until the next read.

    Args:
        interval: Time between two reads [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        count = max(1, round(interval / step))
        reads = np.arange(len(forces)) // count * count
        return mean_of(count, step)(forces, step)[reads]

    return apply


def oscillator(stiffness: float, damping: float, mass: float) -> Term:
    """Return the force in a spring on which a mass with a damper rests: m x'' + c x' + k x = f, and k x is read.

    The equation is solved exactly for forces that are linear between two samples.

    Args:
        stiffness: Stiffness k of the spring [N/m].
        damping: Damping c [N s/m].
        mass: The mass m [kg].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        from scipy.signal import cont2discrete

        system = np.array([stiffness]), np.array([mass, damping, stiffness])
        above, below, _ = cont2discrete(system, step, method="foh")
        return _run(above[0], below, forces)

    return apply


def relaxation(strength: float, time: float) -> Term:
    """Return a signal that overshoots its changes and relaxes: f + s xi, xi = exp(-dt / tau) xi before + change of f.

    Args:
        strength: Share s of a change that relaxes [-].
        time: Time constant tau [s].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        return forces + strength * _run([1.0, -1.0], [1.0, -np.exp(-step / time)], forces)

    return apply


def butterworth(order: int, cutoff_hz: float) -> Term:
    """Return a Butterworth low-pass filter.

    Args:
        order: Number of poles [-].
        cutoff_hz: Frequency at which the gain is -3 dB [Hz].
    """
    return own_chain(Butterworth(order=order, cutoff_hz=cutoff_hz))


def own_chain(design: Butterworth | None, high_pass_hz: float | None = None) -> Term:
    """Return the filters of a sensor, settled at the first forces.

    Args:
        design: Low-pass filter; None for none.
        high_pass_hz: Cut-off of a first-order high-pass behind it; None for none [Hz].
    """

    def apply(forces: FloatArray, step: float) -> FloatArray:
        from scipy.signal import sosfilt, sosfilt_zi

        sections = list_sections(design, 1 / step, high_pass_hz)
        if not len(sections):
            return forces
        start = sosfilt_zi(sections).reshape(len(sections), 2, *(1,) * (forces.ndim - 1)) * forces[0]
        found, _ = sosfilt(sections, forces, axis=0, zi=start)
        return np.asarray(found)

    return apply
