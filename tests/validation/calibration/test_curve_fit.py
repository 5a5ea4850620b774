"""The curve fit finds known parameters, and its intervals cover them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.calibration import SENSOR, SHARES
from validation.calibration.curve_fit import CurveForm, Observations, fit_curve

FORM = CurveForm(degree=1, saturation=True, gains=True, temperature=False, threshold=0)
TRUTH = {
    "c0": -450,
    "c1": 2600,
    "output_max": 3700,
    "saturation_band": 500,
    "gain0": 1.1,
    "gain1": 0.95,
    "gain2": 1.03,
}


def _synthetic(seed, recordings=16):
    """What the fast model's own electronics deliver under six loads per recording."""
    random = np.random.default_rng(seed)
    loads = np.tile(np.linspace(1, 9, 6), recordings)
    counts = SENSOR.counts(np.outer(loads, SHARES), random)
    return Observations(
        loads=loads,
        counts=counts.astype(float),
        shares=SHARES,
        groups=tuple(str(number) for number in np.repeat(np.arange(recordings), 6)),
        temperatures=np.full(len(loads), np.nan),
    )


def _coverage(runs, *, shrink=1.0):
    """How often each interval holds the truth, and its median width."""
    hits, widths = [], []
    for seed in range(runs):
        fitted = fit_curve(_synthetic(seed), FORM)
        halves = np.array([fitted.interval(row) for row in np.eye(len(TRUTH))]) * shrink
        hits.append(np.abs(fitted.values - list(TRUTH.values())) <= halves)
        widths.append(2 * halves)
    return dict(zip(TRUTH, np.sum(hits, axis=0), strict=True)), dict(zip(TRUTH, np.median(widths, axis=0), strict=True))


def test_names_are_those_of_the_truth():
    assert FORM.names(4) == list(TRUTH)


def test_intervals_contain_the_truth_about_as_often_as_they_claim():
    hits, widths = _coverage(100)
    assert all(90 <= hit <= 99 for hit in hits.values()), hits
    assert widths["c1"] < 0.01 * TRUTH["c1"]
    assert widths["gain0"] < 0.01
    assert widths["output_max"] < 0.01 * TRUTH["output_max"]


def test_intervals_that_are_too_short_are_noticed():
    hits, _ = _coverage(30, shrink=0.4)
    assert max(hits.values()) < 27


def test_copies_of_the_frames_do_not_shorten_the_intervals():
    """Errors are shared within a recording, so ten copies of every observation add no evidence."""
    once = _synthetic(1)
    many = Observations(
        loads=np.tile(once.loads, 10),
        counts=np.tile(once.counts, (10, 1)),
        shares=SHARES,
        groups=once.groups * 10,
        temperatures=np.tile(once.temperatures, 10),
    )
    slope = np.eye(len(TRUTH))[1]
    single = fit_curve(once, FORM).interval(slope)
    assert fit_curve(many, FORM).interval(slope) == pytest.approx(single, rel=0.05)


def test_a_polynomial_of_degree_five_is_found():
    truth = (-300.0, 2000.0, 500.0, -200.0, 50.0, -5.0)
    sensor = replace(SENSOR, characteristic=truth, saturation_band=0.0, output_max=4095, noise=0.0)
    loads = np.tile(np.linspace(1, 5, 12), 4)
    counts = sensor.counts(np.outer(loads, SHARES)).astype(float)
    groups = tuple(str(number) for number in np.repeat(np.arange(4), 12))
    observations = Observations(
        loads=loads, counts=counts, shares=SHARES, groups=groups, temperatures=np.full(len(loads), np.nan)
    )
    fitted = fit_curve(observations, replace(FORM, degree=5, saturation=False))
    assert fitted.residual < 0.5
    force = np.linspace(0.3, 1.4, 20)
    found = np.polynomial.polynomial.polyval(force, fitted.values[:6])
    assert np.allclose(found, np.polynomial.polynomial.polyval(force, truth), atol=3)


@settings(max_examples=25, deadline=None)
@given(st.floats(500, 1e4), st.floats(-500, 500), st.floats(0, 50), st.permutations([1.2, 0.9, 1.1, 0.8]))
def test_any_line_comes_back_from_counts_without_noise(slope, offset, threshold, gains):
    loads = np.tile([2.0, 5.0, 9.0], 3)
    counts = np.array(gains) * (slope * np.outer(loads, SHARES) + offset) - threshold
    observations = Observations(
        loads=loads,
        counts=np.maximum(counts, 0.0),
        shares=SHARES,
        groups=tuple("aaabbbccc"),
        temperatures=np.full(9, np.nan),
    )
    form = replace(FORM, saturation=False, threshold=threshold)
    fitted = fit_curve(observations, form)
    if counts.min() > 0:
        assert fitted.value("c1") == pytest.approx(slope, rel=1e-6)
        assert fitted.value("c0") == pytest.approx(offset, abs=1e-3)
        assert fitted.values[2:] == pytest.approx(gains[:3], abs=1e-6)
    assert fitted.predict(observations).min() >= 0
