"""The interval of the thickness against plain matrices, and what is said and widened."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.linalg import null_space
from scipy.stats import f as fisher

from meshes import Box
from tests.support.laboratory import STAMP, draw_gains, make_curve, observe_presses, uniform_method
from validation.calibration.forward_fit import Options, fit_forward
from validation.calibration.model import join_observations
from validation.calibration.thickness import FACTORS, describe_thickness, profile_thickness, widen
from validation.calibration.uncertainty import Estimate, estimate_components, list_errors

#: Assumed thickness [mm].
ASSUMED = 1.8


@cache
def spread_by(factor):
    """A cover whose spread is in proportion to its thickness."""
    made = uniform_method(sigma=0.5 * factor)
    return replace(made, thickness=1e-3 * factor * ASSUMED, rescale=lambda again: spread_by(factor * again))


def observe(seed, true, **options):
    random = np.random.default_rng(seed)
    return observe_presses(random, make_curve(draw_gains(random)), method=spread_by(true), known=True, **options)[0]


def find_interval(fits):
    """Thicknesses over the assumed one whose generalised sum of squares is not much larger than the smallest one."""
    logs, best = np.log(list(fits)), min(fits.values(), key=lambda fit: fit.rms)
    seen = best.observations
    rows = (seen.counts > 0)[seen.measured] & best.jacobian.any(axis=1)
    residual, design, factors = list_errors(best, rows)
    variances, spread = estimate_components(residual, design, factors, least=1 / 12)
    free = null_space(design.T)  # directions that no parameter can describe
    parts = [free.T @ each @ each.T @ free for each in factors] + [np.eye(free.shape[1])]
    inverse = np.linalg.inv(sum(v * part for v, part in zip(variances, parts, strict=True)))
    off = np.array([free.T @ list_errors(fit, rows)[0] for fit in fits.values()])
    at = CubicSpline(logs, off)
    places = np.linspace(logs[0], logs[-1], 4001)
    values = at(places)
    squares = np.einsum("ti,ij,tj->t", values, inverse, values)
    likely = places[np.argmin(squares)]
    pull = inverse @ at(likely, 1)
    shares = np.array([pull @ part @ pull for part in parts])
    freedom = max(1.0, 2 * (at(likely, 1) @ pull) ** 2 / (shares @ spread @ shares))
    agree = np.exp(places[squares <= squares.min() + fisher.ppf(0.95, 1, freedom)])
    return ASSUMED * agree[0], ASSUMED * np.exp(likely), ASSUMED * agree[-1]


def test_the_interval_is_that_of_generalised_least_squares():
    said = []
    fit = fit_forward(spread_by(1.0), observe(4, 1.6, places=2, loads=(6.0, 13.0, 19.0)), Options())
    found, fits = profile_thickness(fit, said.append)
    low, likely, high = find_interval(fits)
    assert (found.low, found.value, found.high) == pytest.approx((low, likely, high), rel=1e-3)
    assert list(fits) == sorted(fits)
    assert set(FACTORS) <= set(fits)
    assert fits[1.0] is fit
    added = sorted(set(fits) - set(FACTORS))
    assert len(fits) <= 9
    assert added[0] * 1.02 == pytest.approx(added[1] / 1.02)  # they enclose a likely thickness
    assert said[:5] == [f"fit with a cover of {each * ASSUMED:.3g} mm" for each in (0.5, 0.7, 1.4, 2.0, 3.0)]
    assert len(said) == len(fits) - 1
    assert found.unit == "mm"
    assert found.fitted_on == "covers of 0.9..5.4 mm; 1.8 mm assumed"


def test_a_likely_thickness_next_to_a_fitted_one_needs_no_further_fits():
    """The true one is 0.7 times the assumed one, and is found within 3 %."""
    seen = observe(2, 0.7, places=2, loads=(6.0, 13.0, 19.0), scatter=0.0, noise=0.5)
    found, fits = profile_thickness(fit_forward(spread_by(1.0), seen, Options()), str)
    assert found.value == pytest.approx(0.7 * ASSUMED, rel=0.02)
    assert list(fits) == list(FACTORS)


@pytest.mark.parametrize(
    ("shift", "other", "determined"),
    [((2.4e-3, 0.0), None, False), ((0.0, 2.6e-3), None, True), ((0.0, 0.0), (10e-3, 22e-3), True)],
)
def test_places_within_half_a_pitch_determine_no_thickness_with_one_indenter(shift, other, determined):
    """The pitch is 5 mm."""
    seen = observe(4, 1.4, places=1, loads=(6.0, 13.0, 19.0))
    (place,) = seen.distinct_placements
    indenter = Box(size=(*other, 5e-3)) if other else STAMP
    moved = replace(place, name="b", at=(place.at[0] + shift[0], place.at[1] + shift[1]), indenter=indenter)
    curve = make_curve(draw_gains(np.random.default_rng(4)))
    forces = spread_by(1.4).texel_forces(indenter, seen.loads, moved.pose)
    counts = curve.predict(forces, temperatures=seen.temperatures, ages=seen.ages, thresholds=seen.thresholds)
    again = replace(seen, placements=(moved,) * 3, groups=tuple("xyz"), counts=counts)
    fit = fit_forward(spread_by(1.0), join_observations([seen, again]), Options())
    found, fits = profile_thickness(fit, str)
    assert (found.low > 0 or np.isfinite(found.high)) == determined
    if not determined:
        assert list(fits) == list(FACTORS)
        assert np.isnan(found.value)


@pytest.mark.parametrize(
    ("low", "high", "assumed", "said"),
    [
        (1.23456, 3.21, 2e-3, "at least 1.23 mm, at most 3.21 mm (data, which agrees)"),
        (2.0, 3.0, 2e-3, "at least 2 mm, at most 3 mm (data, which agrees)"),
        (1.0, 2.0, 2e-3, "at least 1 mm, at most 2 mm (data, which agrees)"),
        (1.0, 1.999, 2e-3, "at least 1 mm, at most 2 mm (data, which does NOT AGREE)"),
        (2.001, 3.0, 2e-3, "at least 2 mm, at most 3 mm (data, which does NOT AGREE)"),
        (0.0, 3.0, 1e-3, "at most 3 mm (data, which agrees)"),
        (1.5, np.inf, 4e-3, "at least 1.5 mm (data, which agrees)"),
        (0.0, np.inf, 4e-3, "not determined (data, which agrees)"),
    ],
)
def test_a_thickness_is_said_with_its_bounds_and_the_assumed_one(low, high, assumed, said):
    found = Estimate(value=np.nan, low=low, high=high, unit="mm", fitted_on="data")
    assert describe_thickness(found, assumed) == (
        f"thickness of the cover: {said}; the other intervals contain this range"
    )


@pytest.mark.parametrize("ends", [(0.6, 1.7), (1.2, 2.5), (0.1, 0.9), (0.55, 9.0)])
def test_intervals_widen_by_the_largest_and_smallest_move_within_the_range(ends):
    """Two quantities that are interpolated in the logarithm of the thickness; the assumed one is always inside."""
    factors = (0.5, 0.8, 1.0, 1.5, 2.0, 3.0)
    values = {"a": (5.0, 6.0, 6.2, 6.1, 7.0, 9.0), "b": (1.0, 0.7, 0.65, 0.4, 0.45, 0.3)}
    others = {
        factor: {name: Estimate.symmetric(row[k], 0.25, "u", "f") for name, row in values.items()}
        for k, factor in enumerate(factors)
    }
    found = widen(others[1.0], others, ends)
    for name, row in values.items():
        between = PchipInterpolator(np.log(factors), row)
        inside = np.linspace(np.log(max(ends[0], 0.5)), np.log(min(ends[1], 3.0)), 20001)
        moved = np.append(between(inside), row[2]) - row[2]
        assert found[name].low == pytest.approx(row[2] - 0.25 + moved.min())
        assert found[name].high == pytest.approx(row[2] + 0.25 + moved.max())
        assert (found[name].value, found[name].unit, found[name].fitted_on) == (row[2], "u", "f")
