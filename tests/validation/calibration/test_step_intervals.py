"""Intervals of a filter from a step, against the covariance of all parameters by another least squares."""

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import t as student

from fastmodel.signal.creep import MOST_CREEP, Creep
from tests.validation.calibration.test_step_response import record
from validation.calibration.step_response import fit_step, respond
from validation.errors import InputError


@pytest.fixture(autouse=True)
def _few_starts(monkeypatch):
    """Starts near the solution are enough, and take less time."""
    monkeypatch.setattr("validation.calibration.step_response._STARTS", 5)
    monkeypatch.setattr("validation.calibration.step_response._DELAYS", (0.0, 5e-3))


def fit_all(order, times, sums, cutoff):
    """Log cut-off and delay with half widths of their intervals, from all five parameters, and the residual."""

    def model(time, log, delay, *levels):
        angular = 2 * np.pi * np.exp(log)
        creep = respond(order, angular * (time - delay), 1 / (angular * Creep(MOST_CREEP).times))
        return levels[0] + levels[1] * respond(order, angular * (time - delay)) + levels[2] * creep

    start = [np.log(cutoff), 4e-3, 500, 2000, 100]
    found, covariance = curve_fit(model, times, sums, start, method="trf", x_scale=[0.1, 1e-3, 10, 10, 10])
    free = len(times) - 5
    half = student.ppf(0.975, free) * np.sqrt(np.diag(covariance))
    squares = ((model(times, *found) - sums) ** 2).sum()
    return found[:2], half[:2], np.sqrt(squares / free)


@pytest.mark.parametrize(("rate", "cutoff", "noise", "orders"), [(60.0, 5.0, 20.0, (2,)), (50.0, 6.0, 60.0, (2, 3))])
def test_the_interval_is_that_of_the_covariance_of_all_parameters(rate, cutoff, noise, orders):
    times, sums, at = record(2, cutoff, rate, 2, noise=noise)
    found = fit_step(times, sums, at)
    used = (times > at - 0.5) & (times < at + 1.0)
    (log, delay), (wide, late), residual = fit_all(2, times[used] - at, sums[used], cutoff)
    assert found.orders == orders
    assert found.cutoff.value == pytest.approx(np.exp(log), rel=1e-4)
    assert found.delay.value == pytest.approx(delay, rel=1e-3)
    assert found.noise == pytest.approx(residual, rel=1e-6)
    assert found.cutoff.low == pytest.approx(np.exp(log - wide), rel=1e-3)
    assert found.delay.high == pytest.approx(delay + late, rel=1e-3)
    assert found.delay.low == pytest.approx(max(0.0, delay - late), abs=1e-6)
    if orders == (2,):
        assert found.cutoff.high == pytest.approx(np.exp(log + wide), rel=1e-3)
    else:  # the interval spans that of the other order that is not excluded
        assert found.cutoff.high > np.exp(log + wide)
    assert found.frames == used.sum()
    assert found.cutoff.fitted_on == found.delay.fitted_on == f"{used.sum()} frames about the step"
    assert (found.cutoff.unit, found.delay.unit, found.reason) == ("Hz", "s", "")


@pytest.mark.parametrize(("ripple", "refused"), [(90.0, True), (45.0, False)])
def test_a_residual_of_three_times_the_noise_at_rest_is_refused(ripple, refused):
    """After the step the counts swing to both sides from frame to frame, as no filter does."""
    times, sums, at = record(1, 4.0, 60.0, 4, noise=20.0)
    swing = ripple * (-1.0) ** np.arange(len(times)) * (times > at)
    if refused:
        with pytest.raises(InputError, match="no filter describes the counts"):
            fit_step(times, sums + swing, at)
    else:
        assert fit_step(times, sums + swing, at).noise > 30


def test_less_than_ten_standard_errors_of_the_rest_is_no_step():
    """30 frames at rest with a noise of 20 counts: ten standard errors are 36 counts."""
    times, sums, at = record(2, 8.0, 60.0, 3, noise=0.0, creep=0.0)
    noise = 20 * (-1.0) ** np.arange(len(times))
    with pytest.raises(InputError, match="do not change"):
        fit_step(times, 500 + (sums - 500) * 32 / 2000 + noise, at)
