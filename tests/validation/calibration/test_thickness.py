"""The thickness of the cover on made-up recordings: interval, one-sided bounds, and what it adds to other intervals."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.support.laboratory import draw_gains, make_curve, observe_presses, uniform_method
from validation.calibration import thickness
from validation.calibration.calibrate import Calibration, calibrate
from validation.calibration.forward_fit import Options, fit_forward
from validation.calibration.model import join_observations, make_reference_method
from validation.calibration.thickness import describe_thickness, profile_thickness, widen
from validation.calibration.uncertainty import Estimate
from validation.errors import InputError
from validation.json_values import json_text
from validation.sensor_file import load

#: Assumed thickness [mm].
ASSUMED = 2.5


@cache
def spread_by(factor, of=0.5):
    """A cover whose spread is proportional to its thickness, a factor times the assumed one."""
    made = uniform_method(sigma=of * factor)
    return replace(made, thickness=1e-3 * factor * ASSUMED, rescale=lambda again: spread_by(factor * again, of))


def observe(seed, true, curve=None, **options):
    random = np.random.default_rng(seed)
    made = make_curve(draw_gains(random), **(curve or {}))
    return observe_presses(random, made, method=spread_by(true), **options)[0]


def profile(seen, method=None):
    fit = fit_forward(method or spread_by(1.0), seen, Options())
    return profile_thickness(fit, str)[0]


@pytest.mark.parametrize("true", [1.5, pytest.param(0.8, marks=pytest.mark.slow)])
def test_a_thickness_other_than_the_assumed_one_is_found(true):
    found = profile(observe(1, true, places=2, known=True))
    assert found.low < true * ASSUMED < found.high
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.3 * true * ASSUMED
    assert not found.low < ASSUMED < found.high
    assert "does NOT AGREE" in describe_thickness(found, 1e-3 * ASSUMED)


def test_a_right_thickness_agrees():
    found = profile(observe(2, 1.0, places=2, known=True))
    assert found.low < ASSUMED < found.high
    assert "which agrees" in describe_thickness(found, 1e-3 * ASSUMED)


@pytest.mark.parametrize(
    ("true", "ends"), [pytest.param(5.0, (True, False), marks=pytest.mark.slow), (0.2, (False, True))]
)
def test_a_thickness_beyond_the_examined_ones_is_bounded_on_one_side(true, ends):
    found = profile(observe(3, true, places=2, known=True))
    assert (found.low > 0, np.isfinite(found.high)) == ends
    assert np.isnan(found.value)
    assert ("at least" if ends[0] else "at most") in describe_thickness(found, 1e-3 * ASSUMED)


@pytest.mark.parametrize(
    ("ends", "low", "value", "high"),
    [
        ((0.6, 1.1, 2.4), 1.5, 2.75, 6.0), ((thickness.FACTORS[0], 0.5, 1.7), 0.0, np.nan, 4.25),
        ((0.6, 1.7, thickness.FACTORS[-1]), 1.5, np.nan, np.inf),
        ((thickness.FACTORS[0], 1.1, thickness.FACTORS[-1]), 0.0, np.nan, np.inf),
    ],
)  # fmt: skip
def test_an_interval_that_reaches_an_end_of_the_fits_is_open_there_and_has_no_value(
    monkeypatch, ends, low, value, high
):
    """Factors on the assumed 2.5 mm."""
    monkeypatch.setattr(thickness, "_find_interval", lambda _fits: ends)
    monkeypatch.setattr(thickness, "fit_forward", lambda *_: fit)
    fit = fit_forward(spread_by(1.0), observe(5, 1.5, places=2, known=True), Options())
    found, _ = profile_thickness(fit, str)
    assert (found.low, found.value, found.high) == pytest.approx((low, value, high), nan_ok=True)
    assert found.unit == "mm"


def test_no_more_than_nine_covers_are_fitted(monkeypatch):
    """Also if the most likely thickness moves with every fit."""
    likely = iter((1.2, 0.8, 0.6, 2.4, 1.7))
    monkeypatch.setattr(thickness, "_find_interval", lambda _fits: (0.6, next(likely), 2.4))
    fit = fit_forward(spread_by(1.0), observe(5, 1.5, places=2, known=True), Options())
    assert len(profile_thickness(fit, str)[1]) <= 9


@pytest.mark.parametrize("shift", [None, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_one_stamp_in_one_place_determines_no_thickness(shift):
    """Nor does a stamp that is put down again less than half a pitch beside."""
    seen = observe(4, 1.5, places=1, known=True)
    if shift is not None:
        x, y = seen.placements[0].at
        again = tuple(replace(each, name="again", at=(x + shift, y)) for each in seen.placements)
        seen = join_observations([seen, replace(seen, placements=again, groups=tuple("abcd"))])
    found = profile(seen)
    assert (found.low, found.high) == (0, np.inf)
    assert np.isnan(found.value)
    assert "not determined (covers of 1.25..7.5 mm" in describe_thickness(found, 1e-3 * ASSUMED)


def test_a_cover_that_does_not_change_with_its_thickness_has_none():
    """A method that ignores the factor explains all thicknesses alike."""
    blind = replace(spread_by(1.0), rescale=lambda _factor: spread_by(1.0))
    found = profile(observe(1, 1.5, places=2, known=True), blind)
    assert (found.low, found.high) == (0, np.inf)


@pytest.mark.slow
def test_a_calibration_contains_the_range_of_thicknesses():
    """On a cover assumed too thin, the plain intervals of the line miss the truth; those with its thickness hold it."""
    curve = {"warm": -0.01, "dead_warm": 0.002}
    seen = observe(5, 1.5, curve, places=2, known=True, temperatures=(30.0, 40.0))
    said = []
    plain, found = (calibrate(seen, spread_by(1.0), profile=asked, progress=said.append) for asked in (False, True))
    assert sum("fit with a cover of" in line for line in said) >= 5
    assert "cover_thickness" not in plain.estimates
    assert any("assumed and not questioned" in note for note in plain.notes)
    assert describe_thickness(found.estimates["cover_thickness"], 1e-3 * ASSUMED) in found.notes
    for name, each in plain.estimates.items():
        wider = found.estimates[name]
        assert wider.value == each.value
        assert wider.low <= each.low
        assert wider.high >= each.high
    true = calibrate(seen, spread_by(1.5))
    for name in ("temperature", "sensitivity", "dead_force"):
        assert found.estimates[name].low <= true.estimates[name].value <= found.estimates[name].high, name
    assert plain.estimates["sensitivity"].high < true.estimates["sensitivity"].value
    assert Calibration.from_json(json.loads(json_text(found.as_json()))) == found


@pytest.mark.parametrize(("high", "factor"), [(2.0, 2.0), (np.inf, 3.0)])
def test_estimates_move_with_the_range_of_thicknesses_as_far_as_it_was_examined(high, factor):
    """Quantities that are the logarithm of the factor move from the assumed thickness to the end of the range."""
    others = {
        each: {name: Estimate.symmetric(sign * np.log(each), 0.1, "", "") for name, sign in (("a", 1), ("b", -1))}
        for each in (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
    }
    found = widen(others[1.0], others, (1.2, high))
    assert (found["a"].low, found["a"].high) == pytest.approx((-0.1, 0.1 + np.log(factor)))
    assert (found["b"].low, found["b"].high) == pytest.approx((-0.1 - np.log(factor), 0.1))


def test_other_contact_methods_are_refused():
    with pytest.raises(InputError, match="--method reference"):
        calibrate(observe(1, 1.0, places=1), uniform_method(), profile=True)


def test_finite_elements_scale_all_layers():
    sensor = load("wts-0614-34")
    method = make_reference_method(sensor.cover, sensor.array)
    assert method.thickness == sensor.cover.thickness
    assert method.rescale(1.4).thickness == pytest.approx(1.4 * sensor.cover.thickness)
    assert method.rescale(1.4).rescale(0.5).thickness == pytest.approx(0.7 * sensor.cover.thickness)


@pytest.mark.slow
def test_a_thicker_cover_by_finite_elements_spreads_more():
    """The share of the texel below the middle of a stamp decreases, and the thickness of a cover is found."""
    sensor = load("wts-0614-34")
    method = make_reference_method(sensor.cover, sensor.array)
    random = np.random.default_rng(6)
    curve = make_curve(draw_gains(random, count=sensor.array.count))
    seen, _ = observe_presses(random, curve, places=2, known=True, method=method.rescale(1.5))
    found = profile(seen, method)
    assert found.low < 1.5e3 * method.thickness < found.high
    assert found.low > 1e3 * method.thickness


@pytest.mark.slow
def test_intervals_of_the_thickness_cover_as_often_as_stated():
    """Uneven seats, errors of loads and fitted poses; the assumed thickness is off by half."""
    even = [profile(observe(seed, 1.5, places=2, known=True)) for seed in range(20)]
    uneven = [profile(observe(seed, 1.5, places=4, known=True, scatter=0.03, heights=1.0)) for seed in range(20)]
    fitted = [profile(observe(seed, 1.5, places=2)) for seed in range(10)]
    for found in (even, uneven, fitted):
        assert np.mean([each.low <= 1.5 * ASSUMED <= each.high for each in found]) >= 0.85
        assert np.mean([not each.low <= ASSUMED <= each.high for each in found]) >= 0.9
