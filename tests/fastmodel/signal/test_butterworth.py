import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfreqz

from fastmodel.errors import FilterError, ShapeError
from fastmodel.signal.butterworth import Butterworth, FilterBank

ORDERS = range(1, 9)
RATE = 1000.0


@pytest.fixture(params=[False, True], ids=["numpy", "numba"])
def native(request):
    if request.param:
        pytest.importorskip("numba")
    return request.param


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", [0.5, 30.0, 271.0, 499.0])
def test_minus_three_decibel_at_the_cutoff_and_unit_gain_at_rest(order, cutoff):
    gain = Butterworth(cutoff_hz=cutoff, order=order).gain([0.0, cutoff], RATE)
    assert gain[0] == pytest.approx(1, abs=1e-9)
    assert gain[1] == pytest.approx(np.sqrt(0.5), rel=1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_measured_gain_of_the_running_filter(order, native):
    """A sine through the filter, amplitude and not coefficients: -3 dB within 0.5 %."""
    cutoff = 25.0
    time = np.arange(4000) / RATE
    bank = FilterBank(Butterworth(cutoff_hz=cutoff, order=order), RATE, 2, native=native)
    sine = np.sin(2 * np.pi * cutoff * time)
    out = np.array([bank.step([value, 1.0]) for value in sine])[2000:]
    amplitude = np.hypot(*(2 * np.mean(out[:, 0] * f(2 * np.pi * cutoff * time[2000:])) for f in (np.sin, np.cos)))
    assert amplitude == pytest.approx(np.sqrt(0.5), rel=5e-3)
    assert out[-1, 1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cutoff", [2.0, 50.0, 400.0])
def test_scipy_agrees(order, cutoff, native):
    samples = np.random.default_rng(order).normal(size=(600, 5))
    bank = FilterBank(Butterworth(cutoff_hz=cutoff, order=order), RATE, 5, native=native)
    ours = np.array([bank.step(row) for row in samples])
    sections = butter(order, cutoff, fs=RATE, output="sos")
    assert np.allclose(ours, sosfilt(sections, samples, axis=0), rtol=1e-9, atol=1e-12)
    frequency = np.linspace(0, RATE / 2, 50)
    theirs = np.abs(sosfreqz(sections, frequency, fs=RATE)[1])
    assert np.allclose(Butterworth(cutoff_hz=cutoff, order=order).gain(frequency, RATE), theirs, atol=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_settled_filter_stays_where_it_is(order, native):
    bank = FilterBank(Butterworth(cutoff_hz=1.0, order=order), RATE, 3, native=native)
    bank.settle([1.0, -2.0, 0.5])
    for _ in range(2000):
        out = bank.step([1.0, -2.0, 0.5])
    assert np.allclose(out, [1.0, -2.0, 0.5], atol=1e-9)


def test_both_paths_give_the_same_bits():
    pytest.importorskip("numba")
    samples = np.random.default_rng(0).normal(size=(300, 84))
    design = Butterworth(cutoff_hz=40.0, order=8)
    banks = [FilterBank(design, RATE, 84, native=native) for native in (False, True)]
    for row in samples:
        assert np.allclose(banks[0].step(row), banks[1].step(row), rtol=1e-12, atol=1e-14)


def test_order_eight_is_stable_for_long():
    bank = FilterBank(Butterworth(cutoff_hz=0.5, order=8), RATE, 1)
    out = [bank.step([1.0])[0] for _ in range(20_000)]
    assert max(out) < 1.3
    assert out[-1] == pytest.approx(1, abs=1e-5)


def test_bad_filters_are_refused():
    with pytest.raises(FilterError, match="half the sampling rate of 271"):
        Butterworth(cutoff_hz=136.0, order=2).sections(271.0)
    with pytest.raises(FilterError, match="cutoff_hz"):
        Butterworth(cutoff_hz=-1.0)
    with pytest.raises(FilterError, match="order"):
        Butterworth(cutoff_hz=1.0, order=0)
    with pytest.raises(ShapeError, match="runs over"):
        FilterBank(Butterworth(cutoff_hz=1.0), RATE, 4).step(np.zeros(5))
