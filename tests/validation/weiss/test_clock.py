"""Stamps that follow the clock of the device, with arrivals that are late at random."""

import numpy as np
import pytest

from validation.weiss.clock import DeviceClock

_RATE = 271.0
_BASE = 5_000_000_000_000


def _arrive(rng, seconds, *, drift, start=0, pauses=()):
    """Times at which frames are taken [s], their ticks, and their arrival [ns].

    Delays are exponential with mean 2 ms, with stops of the host of up to 0.3 s in which frames wait.
    """
    taken = np.arange(0, seconds, 1 / _RATE)
    for first, last in pauses:
        taken = taken[(taken < first) | (taken >= last)]
    ticks = (start + np.floor(taken * (1 + drift) * 1000).astype(np.int64)) % 2**32
    arrival = taken + 3e-4 + rng.exponential(2e-3, taken.size)
    for stop in np.arange(2.5, seconds, 7.0):
        late = (arrival > stop) & (arrival < stop + rng.uniform(0.05, 0.3))
        if late.any():
            arrival[late] = arrival[late].max()
    return taken, ticks, _BASE + np.round(np.maximum.accumulate(arrival) * 1e9).astype(np.int64)


def _find_errors(clock, taken, ticks, arrival):
    """Errors of the stamps [s], without the constant part of the delay, which no fit can find."""
    stamps = np.array([clock.stamp(*each) for each in zip(ticks.tolist(), arrival.tolist(), strict=True)])
    assert (np.diff(stamps) > 0).all()
    errors = (stamps - _BASE) * 1e-9 - taken
    return errors - np.median(errors)


@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4, 3e-3, -3e-3])
def test_stamps_follow_the_device_within_two_milliseconds(drift):
    rng = np.random.default_rng(1)
    clock = DeviceClock()
    taken, ticks, arrival = _arrive(rng, 60, drift=drift, start=2**32 - 20_000, pauses=[(20, 23)])
    errors = _find_errors(clock, taken, ticks, arrival)
    assert np.quantile(np.abs(errors), 0.95) < 2e-3
    late = (arrival - _BASE) * 1e-9 - taken
    assert np.quantile(np.abs(late - np.median(late)), 0.95) > 5e-3  # the arrivals alone are far worse
    residual = clock.residual
    assert residual.unfitted == residual.restarts == 0
    assert residual.p95 == pytest.approx(np.quantile(late, 0.95), abs=1.5e-3)
    assert residual.largest == pytest.approx(late.max(), abs=5e-3)
    assert residual.tick == pytest.approx(1e-3 / (1 + drift), rel=5e-5)
    assert "which follow the device's clock" in str(residual)


def test_a_wrong_device_time_changes_one_stamp_only():
    rng = np.random.default_rng(2)
    taken, ticks, arrival = _arrive(rng, 10, drift=0)
    ticks[[900, 1800, 1801]] = [7, 2**31, 4_000_000]
    clock = DeviceClock()
    errors = _find_errors(clock, taken, ticks, arrival)
    assert np.quantile(np.abs(errors), 0.95) < 2e-3
    assert (clock.residual.unfitted, clock.residual.restarts) == (3, 0)
    assert "3 frames did not fit" in str(clock.residual)


def test_a_device_that_starts_again_is_followed_again():
    rng = np.random.default_rng(3)
    taken, ticks, arrival = _arrive(rng, 20, drift=1e-4)
    half = len(ticks) // 2
    ticks[half:] -= ticks[half]
    clock = DeviceClock()
    errors = _find_errors(clock, taken, ticks, arrival)
    assert np.quantile(np.abs(errors), 0.95) < 2e-3
    assert clock.residual.restarts == 1
    assert "set anew 1 times" in str(clock.residual)


def test_a_clock_with_another_tick_is_told():
    """The unit of the clock is assumed: 1 ms.  Stamps must stay near the arrivals if it is another one."""
    arrival = _BASE + np.arange(2000) * 3_690_000
    for factor in (0.1, 10.0):
        clock = DeviceClock()
        stamps = [clock.stamp(int(n * 3.69 * factor), each) for n, each in enumerate(arrival.tolist())]
        assert np.abs(np.array(stamps) - arrival).max() < 2.1e9
        assert f"a tick of the device lasts {1 / factor:.3g} ms, not 1 ms" in str(clock.residual)


def test_frames_with_a_clock_that_stands_are_stamped():
    clock = DeviceClock()
    stamps = [clock.stamp(5, _BASE + n * 1_000_000_000) for n in range(20)]
    assert (np.diff(stamps) > 0).all()


def test_no_frames_have_no_residual():
    assert np.isnan(DeviceClock().residual.p95)
