"""The covariance of fitted parameters against plain matrices, and variances against the mean squares of a layout."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from meshes import Box
from validation.calibration.forward_fit import Layout, Unknown
from validation.calibration.model import Observations, Placement
from validation.calibration.uncertainty import (
    Estimate,
    Uncertainty,
    describe_fit,
    estimate_components,
    estimate_mean,
    estimate_uncertainty,
    find_directions,
    measure_scatter,
    predict_mean,
)

NAN = np.nan
FACE = Box(size=(0.01, 0.01, 0.01))


def see(loads, *, places=None, groups=None, counts=None, creep=None):
    m, texels = len(loads), 3
    counts = np.ones((m, texels)) if counts is None else np.array(counts, dtype=float)
    return Observations(
        loads=np.array(loads, dtype=float), counts=counts, measured=np.ones(counts.shape, dtype=bool),
        placements=tuple(Placement(name=name, indenter=FACE) for name in places or "a" * m),
        groups=tuple(groups or map(str, range(m))), temperatures=np.full(m, NAN), ages=np.full(m, NAN),
        thresholds=np.zeros(m), creep=np.full(m, NAN) if creep is None else np.array(creep),
    )  # fmt: skip


def make_fit(*, spreads=(np.inf, 0.4, 0.7), dark=()):
    """Six images of three texels, with three parameters, weights, and residuals of all three kinds of errors."""
    random = np.random.default_rng(5)
    seen = see([2, 5, 9, 3, 6, 10], places="aaabbb", groups=["p", "p", "q", "r", "s", "t"],
               counts=200 + 100 * random.uniform(size=(6, 3)))  # fmt: skip
    weights, scale = np.array([0.5, 1.0, 2.0, 0.7, 1.1, 1.6]), 3.0
    factor = np.repeat(weights / scale, 3)
    image = np.repeat(np.arange(6), 3)
    own = seen.counts.ravel() * np.array([0.02, 0.02, -0.03, 0.04, -0.01, 0.015])[image]
    own += 40 * np.tile([1.0, -0.5, 0.3], 6) / seen.loads[image] + 2 * random.standard_normal(18)
    jacobian = random.standard_normal((18, 3)) * [30.0, 200.0, 150.0] * factor[:, None]
    jacobian[list(dark)] = 0.0
    unknowns = tuple(
        Unknown(name=f"u{k}", start=0.0, scale=1.0, spread=spread, texel=k, is_gain=k > 0)
        for k, spread in enumerate(spreads)
    )
    layout = Layout(unknowns=unknowns, guesses={}, fixed=SimpleNamespace())
    return SimpleNamespace(observations=seen, weights=weights, scale=scale, index=image, jacobian=jacobian,
                           residual=own * factor, layout=layout)  # fmt: skip


def column(values, keys):
    names = list(dict.fromkeys(keys))
    return np.array([[value * (key == name) for name in names] for value, key in zip(values, keys, strict=True)])


@pytest.mark.parametrize("dark", [(), (2, 7)])
def test_the_covariance_is_that_of_a_weighted_fit_under_errors_of_three_kinds(dark):
    fit = make_fit(dark=dark)
    seen, lit = fit.observations, np.setdiff1d(np.arange(18), dark)
    factor = (fit.weights / fit.scale)[fit.index[lit]]
    residual, design = fit.residual[lit] / factor, fit.jacobian[lit] / factor[:, None]
    predicted = (seen.counts.ravel() + fit.residual / (fit.weights / fit.scale)[fit.index])[lit]
    image, texel = fit.index[lit], np.tile(np.arange(3), 6)[lit]
    recordings = column(predicted, [seen.groups[k] for k in image])
    seats = column(predicted / seen.loads[image], [("ab"[k // 3], t) for k, t in zip(image, texel, strict=True)])
    variances, spread = estimate_components(residual, design, (recordings, seats), least=1 / 12)
    prior = np.diag([0.0, 0.4**-2, 0.7**-2])
    inverse = np.linalg.inv(design.T @ np.diag(factor**2) @ design + prior)
    from_counts = inverse @ design.T @ np.diag(factor**2)
    found = estimate_uncertainty(fit)
    assert found.variances == pytest.approx([*variances, 1.0])
    expected = [from_counts @ each @ each.T @ from_counts.T for each in (recordings, seats, np.eye(len(lit)))]
    np.testing.assert_allclose(found.parts, [*expected, inverse @ prior @ inverse], rtol=1e-9, atol=1e-20)
    wide = np.zeros((4, 4))
    wide[:3, :3] = spread
    np.testing.assert_allclose(found.spread, wide)


def test_a_half_width_of_one_kind_is_that_of_least_squares():
    random = np.random.default_rng(2)
    design, noise = random.standard_normal((12, 2)), 0.3 * random.standard_normal(12)
    left = noise - design @ np.linalg.lstsq(design, noise, rcond=None)[0]
    variance = left @ left / 10
    variances, spread = np.array([variance]), np.array([[2 * variance**2 / 10]])
    inverse = np.linalg.inv(design.T @ design)
    found = Uncertainty(parts=inverse[None], variances=variances, spread=spread)
    gradient = np.array([0.4, -1.3])
    expected = stats.t.ppf(0.975, 10) * np.sqrt(variance * gradient @ inverse @ gradient)
    assert found.half_width(gradient) == pytest.approx(expected)
    none = Uncertainty(parts=inverse[None], variances=np.zeros(1), spread=np.zeros((1, 1)))
    assert none.half_width(gradient) == 0


def test_two_crossed_factors_have_the_mean_squares_of_the_table():
    """Rows, columns and the rest of a 5 x 4 table: (A - E) / 4, (B - E) / 5 and E, where all are positive."""
    random = np.random.default_rng(8)
    rows, columns = 3 * random.standard_normal(5), 2 * random.standard_normal(4)
    table = 7 + rows[:, None] + columns + 0.5 * random.standard_normal((5, 4))
    by_row, by_column = np.kron(np.eye(5), np.ones((4, 1))), np.tile(np.eye(4), (5, 1))
    found, spread = estimate_components(table.ravel(), np.ones((20, 1)), (by_row, by_column), least=1e-9)
    rest = table - table.mean(axis=1)[:, None] - table.mean(axis=0) + table.mean()
    error = (rest**2).sum() / 12
    a, b = 4 * table.mean(axis=1).var(ddof=1), 5 * table.mean(axis=0).var(ddof=1)
    assert found == pytest.approx([(a - error) / 4, (b - error) / 5, error], rel=1e-4)
    own = 2 * error**2 / 12
    expected = [[(2 * a**2 / 4 + own) / 16, own / 20, -own / 4], [own / 20, (2 * b**2 / 3 + own) / 25, -own / 5],
                [-own / 4, -own / 5, own]]  # fmt: skip
    np.testing.assert_allclose(spread, expected, rtol=1e-3)


def test_a_factor_that_is_estimated_as_zero_has_no_covariance():
    """Groups whose means differ less than chance: the rest has all degrees of freedom."""
    values = np.array([1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 1.5, -1.5])
    found, spread = estimate_components(values, np.ones((8, 1)), (np.kron(np.eye(4), np.ones((2, 1))),), least=1e-6)
    assert found == pytest.approx([0, (values**2).sum() / 7])
    assert spread[0].tolist() == [0, 0]
    assert spread[1, 1] == pytest.approx(2 * found[1] ** 2 / 7, rel=1e-6)
    assert spread[1, 0] == 0


@pytest.mark.parametrize(("remains", "known"), [(0.03, True), (0.01, False)])
def test_an_error_of_which_the_parameters_leave_less_than_two_percent_is_unknown(remains, known):
    """A column at a small angle to the design keeps a share of its length."""
    design = np.zeros((30, 1))
    design[0] = 1.0
    factor = np.zeros((30, 1))
    factor[0], factor[1] = 1.0, remains / np.sqrt(1 - remains**2)
    values = np.cos(np.arange(30.0) ** 2)
    values[1] = 9.0
    found, _ = estimate_components(values, design, (factor,), least=1e-6)
    assert (found[0] > 0) == known


@pytest.mark.parametrize(("size", "rank"), [(2e-6, 2), (0.5e-6, 1), (0.0, 1)])
def test_directions_below_a_millionth_of_the_largest_do_not_count(size, rank):
    matrix = np.array([[3.0, 0.0], [0.0, 3.0 * size], [4.0, 0.0], [0.0, 4 * size]])
    found = find_directions(matrix)
    assert found.shape == (4, rank)
    assert found.T @ found == pytest.approx(np.eye(rank))
    assert found @ found.T @ matrix[:, 0] == pytest.approx(matrix[:, 0])
    assert find_directions(np.zeros((4, 2))).shape == (4, 0)


@pytest.mark.parametrize(
    ("values", "groups", "on"),
    [
        ([1.0, 2.0, 4.0], [1, 1, 2], "3 recordings"),
        ([1.0, 2.0, 4.0, NAN], [1, 1, 2, 3], "3 recordings"),
        ([1.0, 2.0, 4.0, 5.0], [1, 1, 2, 3], "another load, by 3 loads"),
        ([1.0, 2.0, NAN], [1, 2, 3], None),
    ],
)
def test_a_mean_is_predicted_for_another_load_from_three_loads_on(values, groups, on):
    found = predict_mean(np.array(values), np.array(groups), "x")
    assert (found and found.fitted_on) == on
    if on:
        assert found.value == pytest.approx(np.nanmean(values))
        assert found.unit == "x"


def test_a_mean_needs_three_values():
    assert estimate_mean([1.0, 2.0], "") is None
    found = estimate_mean([1.0, 2.0, 6.0], "mm")
    half = 4.30265273 * 7**0.5 / 3**0.5
    assert (found.value, found.low, found.high) == pytest.approx((3, 3 - half, 3 + half))
    assert found.unit == "mm"


def test_an_interval_about_a_value_is_symmetric():
    found = Estimate.symmetric(12.3456789, 0.5, "N", "data")
    assert (found.value, found.low, found.high) == pytest.approx((12.3456789, 11.8456789, 12.8456789))
    assert str(found) == "12.346 [11.846, 12.846] N"


def test_noise_and_creep_are_estimated_from_three_recordings_on():
    seen = see([1, 2, 3, 4], creep=[0.1, 0.2, 0.4, NAN])
    fit = SimpleNamespace(observations=seen, predict=lambda each: each.counts)
    found = measure_scatter(fit, [2.0, 3.0, 7.0])
    assert set(found) == {"noise", "creep"}
    assert (found["noise"].value, found["noise"].unit) == (pytest.approx(4.0), "counts")
    assert (found["creep"].value, found["creep"].unit) == (pytest.approx(0.7 / 3), "per ln(time)")
    half = 4.30265273 * np.std([0.1, 0.2, 0.4], ddof=1) * (4 / 3) ** 0.5
    assert found["creep"].high - found["creep"].value == pytest.approx(half)
    assert measure_scatter(fit, [2.0, 3.0]).keys() == {"creep"}


def test_repeats_are_those_of_one_load_in_one_place():
    """Ratios of 1.1 and 0.9, and of 1.3 and 1.0 in another place; no repeat elsewhere."""
    counts = np.outer([110.0, 90.0, 130.0, 100.0, 80.0, 0.0, 70.0], [0.5, 0.3, 0.2])
    seen = see([4, 4, 4, 4, 5, 4, 4], places="aabbaab", counts=counts)
    predicted = np.full((7, 3), 100.0 / 3)
    predicted[6] = 0.0
    found = measure_scatter(SimpleNamespace(observations=seen, predict=lambda _: predicted), [])["hysteresis"]
    square = 2 * 0.1**2 + 2 * (0.15 / 1.15) ** 2
    assert found.value == pytest.approx((square / 2) ** 0.5)
    ends = [(square / stats.chi2.ppf(part, 2)) ** 0.5 for part in (0.975, 0.025)]
    assert (found.low, found.high) == pytest.approx(ends)
    assert (found.fitted_on, found.unit) == ("2 loads with 4 recordings", "share")


def describe(*, places="ab", creep=None, warm=None, outliers=(), positions=()):
    seen = see([1, 2, 3], places=[places[0], places[0], places[-1]], creep=creep)
    if warm:
        seen = replace(seen, temperatures=np.array(warm))
    unknowns = [Unknown(name=f"p{k}", start=0.0, scale=1.0, placement="p", part=k) for k in positions]
    unknowns += [Unknown(name="gain0", start=0.0, scale=1.0, spread=0.5, texel=0, is_gain=True)]
    layout = Layout(unknowns=tuple(unknowns), guesses={}, fixed=SimpleNamespace())
    curve = SimpleNamespace(gain_temperature=-0.0234, dead_temperature=0.0071)
    # a position in mm whose slope is shared with the gain: correlation 0.95, standard error 1 / sqrt(1 - 0.95^2)
    root = np.linalg.cholesky(np.array([[1e6, 950.0], [950.0, 1.0]])).T if positions else np.eye(1)
    return list(describe_fit(SimpleNamespace(observations=seen, layout=layout, jacobian=root, curve=curve,
                                             outliers=list(outliers))))  # fmt: skip


def test_what_a_fit_determines_is_said_in_this_order():
    said = describe(warm=[20, 30, 20], creep=[0.1, NAN, 0.2], outliers=["x", "y"])
    assert said[0] == "gains: 0 of 1 lit texels are determined by the recordings, the others by the prior near 1"
    assert said[1] == "temperature: gain -2.34 %/K, dead force +0.0071 N/K"
    assert "c = 0.150 (0.100..0.200 in 2 recordings, from 2 s after loading on)" in said[2]
    assert said[3] == "little weight, because their residual is large: x, y"
    assert said[4].startswith("the filter's cut-off was not examined")
    assert len(said) == 5
    assert len(describe()) == 3
    assert describe()[1] == (
        "temperature coefficients are not identifiable: the temperature is not known in every recording"
    )
    assert len(describe(places="a")) == 5


@pytest.mark.parametrize(("part", "axis"), [(0, "x"), (1, "y"), (2, None)])
def test_a_position_that_gains_take_up_is_said_with_its_error(part, axis):
    """A prior of 0.5 on the gain adds 4 to its information of 1 and tells the two apart; one of 100 does not."""
    assert not any("of the indenter in" in each for each in describe(positions=(part,)))
    loose = describe_loose(part)
    assert len(loose) == (axis is not None)
    if axis:
        error = 1 / np.sqrt(1 - 0.95**2 / (1 + 1e-4))
        assert loose[0] == (
            f"{axis} of the indenter in 'p' is known to {error:.2g} mm, {error:.0f} times worse than without gains: "
            "gains take up a shift"
        )


def describe_loose(part):
    unknowns = (
        Unknown(name="p", start=0.0, scale=1.0, placement="p", part=part),
        Unknown(name="gain0", start=0.0, scale=1.0, spread=100.0, texel=0, is_gain=True),
    )
    root = np.linalg.cholesky(np.array([[1e6, 950.0], [950.0, 1.0]])).T
    fit = SimpleNamespace(observations=see([1, 2, 3]), jacobian=root, outliers=[], curve=None,
                          layout=Layout(unknowns=unknowns, guesses={}, fixed=SimpleNamespace()))  # fmt: skip
    return [each for each in describe_fit(fit) if "of the indenter in" in each]
