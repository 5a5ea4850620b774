"""Intervals, repeatability, temperatures, folds and what a fit says of itself, by hand-computed numbers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from meshes import Box, Sphere
from validation.calibration import cross_validation
from validation.calibration.cross_validation import POWERS, SEATS, choose_options, list_folds
from validation.calibration.forward_fit import Layout, Options, Unknown
from validation.calibration.model import Observations, Placement
from validation.calibration.temperatures import describe_confounding, find_warmth, settle_temperatures
from validation.calibration.uncertainty import (
    Estimate,
    Uncertainty,
    describe_fit,
    estimate_mean,
    list_errors,
    measure_scatter,
    predict_mean,
)

NAN = np.nan
FACE, BALL = Box(size=(0.01, 0.01, 0.01)), Sphere(radius=4e-3)


def see(loads, *, places="", counts=None, warm=None, creep=None, groups=None, measured=None, at=None):
    """Images of two texels under loads, in places named by one letter each."""
    m, names = len(loads), places or "a" * len(loads)
    counts = np.ones((m, 2)) if counts is None else np.array(counts, dtype=float)
    made = {name: Placement(name=name, indenter=FACE, at=at, yaw=0.0) for name in names}
    return Observations(
        loads=np.array(loads, dtype=float), counts=counts,
        measured=np.ones(counts.shape, dtype=bool) if measured is None else np.array(measured),
        placements=tuple(made[name] for name in names), groups=tuple(groups or map(str, range(m))),
        temperatures=np.full(m, NAN) if warm is None else np.array(warm, dtype=float),
        ages=np.full(m, NAN), thresholds=np.zeros(m), creep=np.full(m, NAN) if creep is None else np.array(creep),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        # Student's t(0.975; 2) = 4.30265273, t(0.975; 3) = 3.18244631
        ([1.0, 2.0, 3.0], (2.0, 4.30265273 / 3**0.5)),
        ([1.0, NAN, 2.0, 3.0, np.inf], (2.0, 4.30265273 / 3**0.5)),
        ([1.0, 1.0, 3.0, 3.0], (2.0, 3.18244631 * (4 / 3) ** 0.5 / 2)),
        ([1.0, 2.0, NAN], None),
        ([], None),
    ],
)
def test_the_interval_of_a_mean_is_that_of_student(values, expected):
    found = estimate_mean(values, "N")
    assert (found is None) == (expected is None)
    if expected is not None:
        value, half = expected
        assert (found.value, found.low, found.high) == pytest.approx((value, value - half, value + half), rel=1e-6)
        assert str(found) == f"{value:.5g} [{value - half:.5g}, {value + half:.5g}] N"
        finite = np.isfinite(values).sum()
        assert found.fitted_on == f"{finite} recordings"


def test_the_mean_of_another_load_has_the_spread_of_the_means_of_the_loads():
    """Means of 1, 2 and 6; t(0.975; 2) sqrt(7) sqrt(1 + 1/3).  An unknown value takes no part."""
    values, groups = np.array([0.5, 1.5, 2.0, 6.0, NAN]), np.array([5.0, 5.0, 6.0, 7.0, 8.0])
    found = predict_mean(values, groups, "-")
    half = 4.30265273 * 7**0.5 * (4 / 3) ** 0.5
    assert (found.value, found.low, found.high) == pytest.approx((2.5, 2.5 - half, 2.5 + half), rel=1e-6)
    assert found.fitted_on == "another load, by 3 loads"


def test_repeats_of_one_load_in_one_place_scatter_about_their_own_mean():
    """Sums over the predicted sums: 0.9, 1.1 and 1.0, 1.2, 1.4; a texel that was not measured counts nowhere.

    Alone stand another load, and two images of one recording; images without counts have no ratio.
    """
    sums = [90.0, 110.0, 100.0, 120.0, 140.0, 500.0, 70.0, 30.0, 0.0, 100.0]
    right = np.where(np.arange(10) % 2, 50.0, 100.0)  # as of two temperatures
    counts = np.column_stack([sums * right / 100, np.full(10, 999.0)])
    seen = see([1, 1, 2, 2, 2, 3, 4, 4, 1, 1], counts=counts, places="aaaaaaaaab",
               groups=["1", "2", "3", "4", "5", "6", "7", "7", "8", "9"],
               measured=np.tile([True, False], (10, 1)))  # fmt: skip
    fit = SimpleNamespace(observations=seen, predict=lambda each: np.outer(right[-len(each.loads) :], [1.0, 1.0]))
    found = measure_scatter(fit, [1.0, 2.0, 3.0])
    assert set(found) == {"noise", "hysteresis"}
    square = 2 * 0.1**2 + 2 * (0.2 / 1.2) ** 2
    hysteresis = found["hysteresis"]
    assert hysteresis.value == pytest.approx((square / 3) ** 0.5)
    low, high = ((square / stats.chi2.ppf(part, 3)) ** 0.5 for part in (0.975, 0.025))
    assert (hysteresis.low, hysteresis.high) == pytest.approx((low, high))
    assert hysteresis.fitted_on == "2 loads with 5 recordings"
    assert "hysteresis" not in measure_scatter(replace_seen(fit, seen.select(np.arange(10) > 4)), [])
    assert measure_scatter(replace_seen(fit, see([1, 2, 3], creep=[0.1, 0.2, 0.3])), [])[
        "creep"
    ].value == pytest.approx(0.2)


def replace_seen(fit, seen):
    return SimpleNamespace(**vars(fit) | {"observations": seen})


def test_a_half_width_has_the_degrees_of_freedom_of_satterthwaite():
    """Two kinds of errors with variances 4 and 9 that act on the first and second parameter with 1 and 0.5."""
    parts = np.array([np.diag([1.0, 0.0]), np.diag([0.0, 0.25])])
    found = Uncertainty(parts=parts, variances=np.array([4.0, 9.0]), spread=np.diag([8.0, 16.2]))
    for gradient, variance, freedom in (
        ((1.0, 0.0), 4.0, 2 * 16 / 8),
        ((0.0, 2.0), 9.0, 2 * 81 / 16.2),
        ((1.0, 2.0), 13.0, 2 * 169 / 24.2),
    ):
        expected = stats.t.ppf(0.975, freedom) * variance**0.5
        assert found.half_width(np.array(gradient)) == pytest.approx(expected)
    vague = Uncertainty(parts=parts, variances=np.array([4.0, 9.0]), spread=np.diag([800.0, 1.0]))
    assert vague.half_width(np.array([1.0, 0.0])) == pytest.approx(stats.t.ppf(0.975, 1) * 2)


def test_residuals_are_listed_without_weights_beside_what_they_depend_on():
    """Two images of one recording and one of another, of which one texel was not measured and one row is left out."""
    counts, measured = [[10, 20], [30, 40], [50, 60]], [[True, True], [True, False], [True, True]]
    seen = see([1, 2, 100], counts=counts, measured=measured, groups=["r", "r", "s"], places="pqp")
    weights, scale = np.array([0.5, 1.0, 2.0]), 4.0
    image = np.array([0, 0, 1, 2, 2])
    off = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    jacobian = np.arange(5.0)[:, None] + 1
    fit = SimpleNamespace(observations=seen, weights=weights, scale=scale, jacobian=jacobian,
                          residual=off * (weights / scale)[image])  # fmt: skip
    rows = np.array([True, True, True, True, False])
    residual, design, (recordings, seats) = list_errors(fit, rows)
    assert residual == pytest.approx(off[:4])
    assert design[:, 0] == pytest.approx(jacobian[:4, 0] / (weights / scale)[image[:4]])
    assert recordings == pytest.approx(np.array([[11, 0], [22, 0], [33, 0], [0, 54.0]]))
    # a seating height acts in inverse proportion to the load, at least 5 % of the largest: 5 N, 5 N and 100 N
    assert seats == pytest.approx(np.array([[11 / 5, 0, 0], [0, 22 / 5, 0], [0, 0, 33 / 5], [54 / 100, 0, 0]]))


def lay(spreads, *, position=True):
    """A position and gains of texels with priors of their own spread."""
    first = [Unknown(name="p x", start=0.0, scale=1.0, placement="p", part=0)] if position else []
    gains = [
        Unknown(name=f"gain{k}", start=0.0, scale=1.0, spread=spread, texel=k, is_gain=True)
        for k, spread in enumerate(spreads)
    ]
    return Layout(unknowns=(*first, *gains), guesses={}, fixed=SimpleNamespace())


def describe(jacobian, layout, seen, **more):
    curve = SimpleNamespace(gain_temperature=0.0123, dead_temperature=-0.0045)
    fit = SimpleNamespace(jacobian=np.array(jacobian), layout=layout, observations=seen, curve=curve, outliers=[])
    return "\n".join(describe_fit(SimpleNamespace(**vars(fit) | more)))


@pytest.mark.parametrize(
    ("errors", "spreads", "known"),
    [
        # a gain is known from half of the spread of its prior on: sqrt(3) for a prior of 1
        ((1.8**-1, 1.7**-1), (1.0, 1.0), 1),
        ((0.2, 0.2), (0.5, 0.2), 1),
        ((0.05, 0.05), (0.5, 0.2), 2),
        ((9.0, 9.0), (0.5, 0.2), 0),
    ],
)
def test_a_gain_is_determined_if_the_data_halve_its_prior_error(errors, spreads, known):
    """A measurement of standard error e and a prior of spread s leave an error of 1 / sqrt(1 / e^2 + 1 / s^2)."""
    said = describe(np.diag(1 / np.array(errors)), lay(spreads, position=False), see([1, 2, 3]))
    assert f"gains: {known} of 2 lit texels are determined" in said


@pytest.mark.parametrize(("cross", "told"), [(0.8, False), (0.9, True)])
def test_a_position_is_confounded_if_gains_double_its_error(cross, told):
    """With a correlation c the error of the position is 1 / sqrt(1 - c^2) times that without gains."""
    root = np.linalg.cholesky(np.array([[1e6, cross * 1e3], [cross * 1e3, 1.0]])).T
    said = describe(root, lay([1e6]), see([1, 2, 3]))
    assert ("x of the indenter in 'p' is known to" in said) == told
    assert not told or f"known to {(1 - cross**2) ** -0.5:.2g} mm, 2 times worse than without gains" in said


def test_a_fit_tells_coefficients_creep_places_and_outliers():
    seen = see([1, 2, 3], warm=[20, 30, 20], creep=[0.1, 0.12, 0.2])
    said = describe(np.eye(1), lay([1.0], position=False), seen, outliers=["heavy", "light"])
    assert "temperature: gain +1.23 %/K, dead force -0.0045 N/K" in said
    assert "c = 0.120 (0.100..0.200 in 3 recordings" in said
    assert "little weight, because their residual is large: heavy, light" in said
    assert "a second placement tells the two apart" in said
    assert "the width of the cover's spread cannot be told" in said
    two = see([1, 2, 3], places="aab")
    said = describe(np.eye(1), lay([1.0], position=False), two)
    assert "not identifiable: the temperature is not known in every recording" in said
    assert not any(word in said for word in ("creep", "little weight", "second placement", "cover's spread"))
    other = replace(seen, placements=(*seen.placements[:2], replace(seen.placements[0], indenter=BALL)))
    assert "cover's spread" not in describe(np.eye(1), lay([1.0], position=False), other)


@pytest.mark.parametrize(
    ("loads", "warm", "words"),
    [
        ([1, 2, 3], [20, 25, 20], ""),
        ([1, 2, 3], [20, 24.9, 20], "varies by 4.9 K only; 5 K are needed"),
        ([1, 2, 3], [20, NAN, 30], "not known in every recording"),
        ([1, 2, 3], [20, 25, 30], "rise together (squared correlation 1.00)"),
        ([1, 2, 3], [30, 25, 20], "rise together (squared correlation 1.00)"),
        # correlations of 0.9 and 0.882: squares of 0.81 and 0.778
        ([-1, 0, 1, 0, 0], [15.5, 20, 24.5, 20 + (2 * 4.5**2 * (1 / 0.81 - 1) / 2) ** 0.5,
                            20 - (2 * 4.5**2 * (1 / 0.81 - 1) / 2) ** 0.5], "squared correlation 0.81"),
        ([-1, 0, 1, 0, 0], [15.5, 20, 24.5, 20 + (2 * 4.5**2 * (1 / 0.778 - 1) / 2) ** 0.5,
                            20 - (2 * 4.5**2 * (1 / 0.778 - 1) / 2) ** 0.5], ""),
        ([2, 2, 2], [20, 25, 30], ""),
    ],
)  # fmt: skip
def test_temperature_and_load_are_told_apart_by_range_and_correlation(loads, warm, words):
    said = describe_confounding(see(loads, warm=warm))
    assert words in said
    assert bool(said) == bool(words)


def test_warmth_is_that_of_the_session_where_one_warms_with_its_load():
    loads, rising, level = [1, 2, 3], [20.0, 21.0, 22.0], [30.0, 31.0, 30.0]
    two = see(loads * 2, places="aaabbb", warm=[*rising, *level])
    assert find_warmth(two) == pytest.approx({"a": 21.0, "b": 91 / 3})
    assert find_warmth(see(loads * 2, places="aaabbb", warm=level * 2)) == {}
    assert find_warmth(see(loads, warm=rising)) == {}
    assert find_warmth(see([1] * 6, places="aaabbb", warm=[*rising, *level])) == {}
    assert find_warmth(see(loads * 2, places="aaabbb", warm=[20.0] * 3 + [30.0] * 3)) == {}
    new = see([1, 2, 1], places="acc", warm=[25.0, 40.0, 50.0])
    assert settle_temperatures(new, {"a": 21.0}).tolist() == [21.0, 45.0, 45.0]
    assert settle_temperatures(new, {}).tolist() == [25.0, 40.0, 50.0]
    assert new.temperatures.tolist() == [25.0, 40.0, 50.0]


@pytest.mark.parametrize(
    ("fitted", "scored", "left_out"),
    [
        # loads between fitted ones: at most three of those between, the outer two among them
        ((1, 2, 3, 4, 5, 6, 7), (3.5,), [[2], [4], [6]]),
        ((1, 2, 3, 4), (2.5,), [[2], [3]]),
        ((1, 2, 3), (2.0,), [[2]]),
        ((1, 2, 3), (0.5, 3.5), [[1], [3]]),
        ((1, 2, 3), (1.0, 3.0), []),  # the loads of the fitted images are neither between nor beyond
        ((1, 1, 2, 2), (3.0,), []),  # one load would remain
        ((1, 2, 3 * (1 - 1e-7), 3), (4.0,), [[3 * (1 - 1e-7), 3]]),
        ((1, 2, 3 * (1 - 1e-5), 3), (4.0,), [[3]]),
    ],
)
def test_the_loads_that_are_left_out_lie_as_the_scored_ones(fitted, scored, left_out):
    seen = see(fitted)
    found = list_folds(seen, np.array(scored, dtype=float), seen.distinct_placements)
    assert [seen.loads[out].tolist() for out in found] == [pytest.approx(each) for each in left_out]


def test_a_session_is_left_out_but_for_its_middle_load_if_it_can_be_placed():
    new = [Placement(name="c", indenter=FACE)]
    seen = see([1, 2, 3, 4, 7, 8, 9], places="aaaabbb")
    folds = list_folds(seen, np.array([2.0]), new)
    assert [seen.loads[out].tolist() for out in folds] == [[1, 2, 4], [7, 9]]
    # a session of one load is left with nothing to leave out; one session alone is no session
    one = see([1, 2, 3, 5], places="aaab")
    assert [one.loads[out].tolist() for out in list_folds(one, np.array([2.0]), new)] == [[1, 3]]
    assert [out.tolist() for out in list_folds(see([1, 2, 3]), np.array([2.0]), new)] == [[False, True, False]]
    for at, folds in ((None, 0), ((0.0, 0.0), 1)):  # the heaviest image alone determines its pose, if it is not known
        seen = see([1, 2, 3], places="aab", at=at)
        assert len(list_folds(seen, np.array([4.0]), seen.distinct_placements)) == folds


def test_the_options_with_the_smallest_error_of_left_out_images_are_chosen(monkeypatch):
    """Predictions are off by 3 counts, by 1 count with heights and the power 8; unmeasured texels count nowhere."""
    measured = [[True, False]] * 5
    seen = see([1, 2, 3, 4, 5], measured=measured)
    asked = []

    def fit(_method, kept, options):
        asked.append((options.heights, options.load_power, kept.loads.tolist()))
        off = 1.0 if (options.heights, options.load_power) == (True, POWERS[-1]) else 3.0
        return SimpleNamespace(predict=lambda each: each.counts + off * np.array([1.0, 99.0]))

    monkeypatch.setattr(cross_validation, "fit_forward", fit)
    scored = see([6, 7])
    given = Options(heights=True)
    chosen, errors = choose_options(None, seen, given, scored)
    assert (chosen.heights, chosen.load_power) == (True, POWERS[-1])
    assert errors == {SEATS[0]: (3.0, 3.0, 3.0), SEATS[1]: (3.0, 3.0, 1.0)}
    assert asked == [(heights, power, [1, 2, 3, 4]) for heights in (False, True) for power in POWERS]
    chosen, errors = choose_options(None, seen, replace(given, heights=False), scored)
    assert (chosen.heights, chosen.load_power) == (False, POWERS[0])
    assert errors == {SEATS[0]: (3.0, 3.0, 3.0)}
    assert choose_options(None, seen.select(seen.loads < 2), given, scored) == (given, {})


def test_an_estimate_without_a_finite_end_says_so():
    assert str(Estimate(value=NAN, low=1.0, high=np.inf, unit="Hz", fitted_on="")) == "nan [1, inf] Hz"
