import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from fastmodel.errors import FastModelError
from fastmodel.signal.butterworth import Butterworth, LowPass

ORDERS = (1, 2, 3, 5, 8)
RATE = 1000.0


def filtered(design, samples, start=0.0):
    """Filtered samples, shape (steps, signals), of a filter that was settled at `start`."""
    low_pass = LowPass(design, RATE)
    states, out = low_pass.settle(np.full(samples.shape[1], start)), []
    for sample in samples:
        states = low_pass.step(states, sample)
        out.append(states[-1])
    return np.array(out)


@pytest.mark.parametrize("order", ORDERS)
def test_a_sine_at_the_cutoff_leaves_the_running_filter_3_db_smaller(order):
    """The measured amplitude, not the coefficients: -3 dB within 0.5 %, and unit gain at rest."""
    cutoff, time = 25.0, np.arange(4000) / RATE
    sine = np.column_stack([np.sin(2 * np.pi * cutoff * time), np.ones(4000)])
    out = filtered(Butterworth(cutoff_hz=cutoff, order=order), sine)[2000:]
    amplitude = np.hypot(*(2 * np.mean(out[:, 0] * f(2 * np.pi * cutoff * time[2000:])) for f in (np.sin, np.cos)))
    assert amplitude == pytest.approx(np.sqrt(0.5), rel=5e-3)
    assert out[-1, 1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("cutoff", "steps"), [(0.5, 8000), (50.0, 600), (400.0, 600)])
def test_the_filter_equals_scipys(order, cutoff, steps):
    """Eight seconds suffice for a filter of 0.5 Hz to become unstable, if it were."""
    samples = 1.0 + np.random.default_rng(order).normal(size=(steps, 5))
    ours = filtered(Butterworth(cutoff_hz=cutoff, order=order), samples)
    theirs = sosfilt(butter(order, cutoff, fs=RATE, output="sos"), samples, axis=0)
    looser = 10 if cutoff == 0.5 else 1  # Rounding adds up over 8000 samples.
    np.testing.assert_allclose(ours, theirs, rtol=looser * 1e-9, atol=looser * 1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_a_settled_filter_returns_its_constant_input(order):
    out = filtered(Butterworth(cutoff_hz=1.0, order=order), np.full((2000, 2), -2.0), -2.0)
    np.testing.assert_allclose(out, -2.0, atol=1e-8)


@pytest.mark.parametrize(
    ("cutoff", "order", "message"),
    [(136.0, 2, "half the sampling rate of 271"), (-1.0, 2, "cutoff_hz"), (1.0, 0, "order")],
)
def test_bad_filters_are_refused(cutoff, order, message):
    with pytest.raises(FastModelError, match=message):
        Butterworth(cutoff_hz=cutoff, order=order).sections(271.0)


@pytest.mark.parametrize("design", [None, Butterworth(cutoff_hz=50.0, order=2)])
def test_the_high_pass_equals_scipys_and_a_held_load_reads_zero(design):
    samples = 1.0 + np.random.default_rng(3).normal(size=(600, 4))
    low_pass = LowPass(design, RATE, 2.0)
    states, out = low_pass.settle(np.zeros(4)), []
    for sample in samples:
        states = low_pass.step(states, sample)
        out.append(states[-1])
    theirs = samples if design is None else sosfilt(butter(2, 50.0, fs=RATE, output="sos"), samples, axis=0)
    theirs = sosfilt(butter(1, 2.0, "highpass", fs=RATE, output="sos"), theirs, axis=0)
    assert np.array(out) == pytest.approx(theirs, abs=1e-12)
    held = low_pass.settle(np.full(4, 3.0))
    assert held[-1] == pytest.approx(0.0)
    assert low_pass.step(held, np.full(4, 3.0)) == pytest.approx(held, abs=1e-12)
    with pytest.raises(FastModelError, match="below half the sampling rate"):
        LowPass(design, RATE, 600.0)
