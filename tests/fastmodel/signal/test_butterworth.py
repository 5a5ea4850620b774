import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt, sosfreqz

from fastmodel.errors import FastModelError
from fastmodel.signal.butterworth import Butterworth, FilterBank

ORDERS = range(1, 9)
RATE = 1000.0


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", [0.5, 30.0, 271.0, 499.0])
def test_minus_three_decibel_at_the_cutoff_and_unit_gain_at_rest(order, cutoff):
    gain = Butterworth(cutoff_hz=cutoff, order=order).gain([0.0, cutoff], RATE)
    assert gain[0] == pytest.approx(1, abs=1e-9)
    assert gain[1] == pytest.approx(np.sqrt(0.5), rel=1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_a_sine_at_the_cutoff_leaves_the_running_filter_3_db_smaller(order):
    """The measured amplitude, not the coefficients: -3 dB within 0.5 %."""
    cutoff = 25.0
    time = np.arange(4000) / RATE
    bank = FilterBank(Butterworth(cutoff_hz=cutoff, order=order), RATE, 2)
    sine = np.sin(2 * np.pi * cutoff * time)
    out = np.array([bank.step([value, 1.0]) for value in sine])[2000:]
    amplitude = np.hypot(*(2 * np.mean(out[:, 0] * f(2 * np.pi * cutoff * time[2000:])) for f in (np.sin, np.cos)))
    assert amplitude == pytest.approx(np.sqrt(0.5), rel=5e-3)
    assert out[-1, 1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", [2.0, 50.0, 400.0])
def test_filter_and_gain_equal_scipys(order, cutoff):
    samples = np.random.default_rng(order).normal(size=(600, 5))
    bank = FilterBank(Butterworth(cutoff_hz=cutoff, order=order), RATE, 5)
    ours = np.array([bank.step(row) for row in samples])
    sections = butter(order, cutoff, fs=RATE, output="sos")
    assert np.allclose(ours, sosfilt(sections, samples, axis=0), rtol=1e-9, atol=1e-12)
    frequency = np.linspace(0, RATE / 2, 50)
    theirs = np.abs(sosfreqz(sections, frequency, fs=RATE)[1])
    assert np.allclose(Butterworth(cutoff_hz=cutoff, order=order).gain(frequency, RATE), theirs, atol=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_a_settled_filter_returns_its_constant_input(order):
    bank = FilterBank(Butterworth(cutoff_hz=1.0, order=order), RATE, 3)
    bank.settle([1.0, -2.0, 0.5])
    for _ in range(2000):
        out = bank.step([1.0, -2.0, 0.5])
    assert np.allclose(out, [1.0, -2.0, 0.5], atol=1e-9)


def test_order_eight_stays_stable():
    bank = FilterBank(Butterworth(cutoff_hz=0.5, order=8), RATE, 1)
    out = [bank.step([1.0])[0] for _ in range(20_000)]
    assert max(out) < 1.3
    assert out[-1] == pytest.approx(1, abs=1e-5)


def test_bad_filters_are_refused():
    with pytest.raises(FastModelError, match="half the sampling rate of 271"):
        Butterworth(cutoff_hz=136.0, order=2).sections(271.0)
    with pytest.raises(FastModelError, match="cutoff_hz"):
        Butterworth(cutoff_hz=-1.0)
    with pytest.raises(FastModelError, match="order"):
        Butterworth(cutoff_hz=1.0, order=0)
    with pytest.raises(FastModelError, match="samples of shape"):
        FilterBank(Butterworth(cutoff_hz=1.0), RATE, 4).step(np.zeros(5))


designs = st.builds(Butterworth, cutoff_hz=st.floats(1.0, 450.0), order=st.integers(1, 8))


def filtered(design, samples):
    bank = FilterBank(design, RATE, samples.shape[1])
    return np.array([bank.step(row) for row in samples])


@settings(max_examples=40, deadline=None)
@given(designs, st.lists(st.floats(-100, 100), min_size=1, max_size=4))
def test_a_constant_input_passes_unchanged(design, values):
    bank = FilterBank(design, RATE, len(values))
    bank.settle(values)
    for _ in range(50):
        np.testing.assert_allclose(bank.step(values), values, atol=1e-8)


@settings(max_examples=40, deadline=None)
@given(designs, st.floats(-5, 5), st.floats(-5, 5), st.integers(0, 1000))
def test_the_filter_is_linear(design, a, b, seed):
    x, y = np.random.default_rng(seed).normal(size=(2, 40, 3))
    np.testing.assert_allclose(
        filtered(design, a * x + b * y), a * filtered(design, x) + b * filtered(design, y), atol=1e-10
    )


@settings(max_examples=40, deadline=None)
@given(designs, st.integers(1, 20), st.integers(0, 1000))
def test_a_delayed_input_gives_the_delayed_output(design, delay, seed):
    samples = np.random.default_rng(seed).normal(size=(40, 3))
    late = filtered(design, np.concatenate([np.zeros((delay, 3)), samples]))
    assert np.all(late[:delay] == 0)
    np.testing.assert_allclose(late[delay:], filtered(design, samples), atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(designs, st.integers(1, 39), st.integers(0, 1000))
def test_a_copied_filter_continues_like_the_original(design, cut, seed):
    samples = np.random.default_rng(seed).normal(size=(40, 3))
    bank = FilterBank(design, RATE, 3)
    for row in samples[:cut]:
        bank.step(row)
    twin = copy.deepcopy(bank)
    rest = np.array([bank.step(row) for row in samples[cut:]])
    np.testing.assert_array_equal(np.array([twin.step(row) for row in samples[cut:]]), rest)
    np.testing.assert_array_equal(rest, filtered(design, samples)[cut:])


@settings(max_examples=40, deadline=None)
@given(designs, st.integers(0, 1000))
def test_signals_do_not_influence_one_another(design, seed):
    samples = np.random.default_rng(seed).normal(size=(30, 3))
    alone = np.column_stack([filtered(design, samples[:, k : k + 1]) for k in range(3)])
    np.testing.assert_allclose(filtered(design, samples), alone, atol=1e-12)
