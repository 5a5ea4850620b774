"""Tables of Gaussian touches, and least squares and likelihood on them, against closed forms and plain sums."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtr

from tests.support.gaussian_touches import CENTRES, MIDDLE, TOUCHES, share
from validation.resolution.chart import make_chart
from validation.resolution.kernel import fit_touches, share_points

LOW, HIGH = np.array([-1.3e-3, -1.0e-3]), np.array([1.9e-3, 2.9e-3])
POINTS = make_chart(TOUCHES, MIDDLE, LOW, HIGH, (0.0, 0.0))
ROUND = make_chart(TOUCHES, MIDDLE, LOW, HIGH, (0.5e-3, 2.9e-3))


def test_a_chart_of_points_has_ten_steps_in_a_pitch_and_its_texels_by_their_largest_share():
    assert (POINTS.texel, POINTS.count) == (MIDDLE, 15)
    assert (POINTS.low.tolist(), POINTS.high.tolist()) == (LOW.tolist(), HIGH.tolist())
    # 3.2 mm and 3.9 mm in steps of at most 0.2 mm and 0.3 mm
    assert POINTS.step == pytest.approx([0.2e-3, 0.3e-3])
    assert POINTS.radii.tolist() == [0.0]
    # three further steps on both sides
    assert POINTS.table.shape == (1, 16 + 7, 13 + 7, 15)
    assert [each is other for each, other in zip(
        POINTS.arrays, (POINTS.low, POINTS.step, POINTS.radii, POINTS.table), strict=True
    )] == [True] * 4  # fmt: skip
    lines = [low + step * np.arange(-3, count + 4) for low, step, count in zip(LOW, POINTS.step, (16, 13), strict=True)]
    places = np.array(np.meshgrid(*lines, indexing="ij")).reshape(2, -1).T
    peaks = share(places)[..., 2].max(axis=0)
    assert (np.diff(POINTS.peaks) <= 0).all()
    # coefficients of splines exceed a force that still rises at the end of the lattice
    assert (POINTS.peaks > 0.98 * peaks[POINTS.order]).all()
    assert (POINTS.peaks < 1.2 * peaks[POINTS.order]).all()
    assert POINTS.columns[POINTS.order].tolist() == list(range(15))


def test_a_box_that_is_no_multiple_of_the_step_has_finer_steps():
    chart = make_chart(TOUCHES, MIDDLE, np.zeros(2), np.array([0.41e-3, 0.3e-3]), (0.0, 0.0))
    assert chart.step == pytest.approx([0.41e-3 / 3, 0.3e-3])


def test_texels_out_of_reach_are_left_out():
    """From a corner the farthest texels take less than 1e-5 of a force: 0.4 exp(-r^2 / 5.12 mm^2), r above 7.36 mm."""
    low, high = np.array([-0.2e-3, -0.3e-3]), np.zeros(2)
    chart = make_chart(TOUCHES, 0, low, high, (0.0, 0.0))
    nearest = CENTRES - CENTRES[0] - (high + 3 * np.array([0.2e-3, 0.3e-3]))
    reached = np.flatnonzero(0.4 * np.exp(-(np.maximum(nearest, 0) ** 2).sum(axis=1) / (2 * 1.6e-3**2)) > 1e-5)
    assert 0 < len(reached) < 15
    assert sorted(chart.order) == reached.tolist()
    assert [chart.columns[k] for k in range(15) if k not in reached] == [-1] * (15 - len(reached))


PLACES = np.random.default_rng(3).uniform(LOW, HIGH, (30, 2))


def test_a_chart_of_points_gives_the_exact_force_at_any_place_and_no_ellipticity():
    found = share_points(POINTS.arrays, PLACES, np.zeros(30), 15)
    assert found[:, 0] == pytest.approx(share(PLACES)[..., 2][:, POINTS.order], abs=2e-4)
    assert (found[:, 1:] == 0).all()
    assert share_points(POINTS.arrays, PLACES, np.zeros(30), 4)[:, 0] == pytest.approx(found[:, 0, :4], abs=1e-15)


@pytest.mark.parametrize("number", [0, 5, 12])
def test_a_round_touch_is_the_mean_of_points_under_a_pressure_of_hertz(number):
    """Thirteen radii at equal distances; rings of equal force by r = a sqrt(1 - (1 - w)^(2/3))."""
    radius = 0.5e-3 + number * 0.2e-3
    assert ROUND.radii == pytest.approx(0.5e-3 + 0.2e-3 * np.arange(13))
    w, turn = (np.arange(200) + 0.5) / 200, 2 * np.pi * np.arange(24) / 24
    r = radius * np.sqrt(1 - (1 - w) ** (2 / 3))
    spots = np.stack([np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn))], axis=-1).reshape(-1, 2)
    exact = np.array([share(place + spots)[..., 2].mean(axis=0) for place in PLACES[:6]])
    found = share_points(ROUND.arrays, PLACES[:6], np.full(6, radius), 15)[:, 0]
    assert found == pytest.approx(exact[:, ROUND.order], abs=3e-4)


@pytest.mark.parametrize(("radius", "below"), [(0.62e-3, 0), (1.55e-3, 5), (2.89e-3, 11)])
def test_between_two_radii_forces_are_linear_in_the_square_of_the_radius(radius, below):
    one, two = ROUND.radii[[below, below + 1]]
    part = (radius**2 - one**2) / (two**2 - one**2)
    at_one, at_two, found = (
        share_points(ROUND.arrays, PLACES, np.full(30, each), 15)[:, 0] for each in (one, two, radius)
    )
    assert found == pytest.approx((1 - part) * at_one + part * at_two, abs=1e-14)


def test_ellipticities_are_second_differences_of_the_round_touch():
    """a^2 / 10 of the difference of the curvatures along x and y, and a^2 / 5 of the mixed one."""
    radius, h = 2.1e-3, 2e-5
    place = np.array([0.31e-3, 0.87e-3])

    def at(x, y):
        return share_points(ROUND.arrays, (place + np.array([x, y]))[None], np.array([radius]), 15)[0, 0]

    along_x = (at(h, 0) - 2 * at(0, 0) + at(-h, 0)) / h**2
    along_y = (at(0, h) - 2 * at(0, 0) + at(0, -h)) / h**2
    mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4 * h**2)
    _, oval, turned = share_points(ROUND.arrays, place[None], np.array([radius]), 15)[0]
    assert np.abs(oval).max() > 0.01
    assert oval == pytest.approx(radius**2 / 10 * (along_x - along_y), abs=2e-5)
    assert turned == pytest.approx(radius**2 / 5 * mixed, abs=2e-5)


PLACE, NOISE, MOST = np.array([[0.4e-3, 0.7e-3]]), 5e-3, 1.7


def fit(chart, texels, *, noise=NOISE, most=MOST, power=1.0, more=(0.0, 0.0, 0.0), radius=1.3e-3):
    """Fit one touch; return its linear parameters, two logarithms, deviations and forces."""
    radii = np.array([radius if len(chart.radii) > 1 else 0.0])
    found = fit_touches(chart.arrays, texels, noise, most, power, PLACE, radii, np.array([more]))
    return [each[0] for each in found]


def make_texels(target, weight, sign=1.0, half=0.0):
    return np.array([np.broadcast_to(each, np.shape(target)) for each in (target, weight, sign, half)], dtype=float)


@pytest.mark.parametrize(("power", "more"), [(1.0, 0.0), (0.3, 0.0), (0.6, 1.7), (1.0, -0.8)])
def test_a_force_of_vague_texels_is_the_mean_of_texels_and_prior(power, more):
    """A uniform prior of 0 to F counts as a normal one of mean F / 2 and variance F^2 / 12."""
    shares, most = share(PLACE)[0, POINTS.order, 2], 1.7
    target, weight = 0.9 * shares + np.linspace(-0.1, 0.2, 15), 1 / np.linspace(0.3, 0.8, 15) ** 2
    precision = 12 / most**2 + power * (weight * shares**2).sum()
    expected = (6 / most + power * (weight * shares * target).sum()) / precision + more / math.sqrt(precision)
    linear, logs, residual, forces = fit(
        POINTS, make_texels(target, weight), most=most, power=power, more=(more, 0.0, 0.0)
    )
    assert linear == pytest.approx([expected, 0.0, 0.0], rel=1e-4)
    assert forces == pytest.approx(expected * shares, rel=1e-3, abs=1e-5)
    # deviations are those of the least squares, the likelihood is that of the drawn force
    middle = expected - more / math.sqrt(precision)
    assert residual == pytest.approx(np.sqrt(weight) * (middle * shares - target), abs=1e-4)
    assert logs == pytest.approx(
        [-math.log(precision) / 2, -(weight * (expected * shares - target) ** 2).sum() / 2], rel=1e-3
    )


@pytest.mark.parametrize(("true", "expected"), [(-0.4, 0.0), (2.5, 1.7)])
def test_a_force_stays_between_zero_and_the_largest_one(true, expected):
    shares = share(PLACE)[0, POINTS.order, 2]
    assert fit(POINTS, make_texels(true * shares, 1e6))[0].tolist() == [expected, 0.0, 0.0]


def find_normal(shares, target, weight, oval, power=1.0):
    precision = power * (weight * shares) @ shares.T + np.diag([12 / MOST**2, oval, oval])
    right = power * (weight * shares) @ target + [6 / MOST, 0.0, 0.0]
    return np.linalg.solve(precision, right), precision


@pytest.mark.parametrize("power", [1.0, 0.4])
def test_ellipticities_of_vague_texels_are_drawn_to_a_round_touch(power):
    """Their standard deviation is half the force of the pass before, from half the largest one on, in three passes."""
    shares = share_points(ROUND.arrays, PLACE, np.array([1.3e-3]), 15)[0]
    target, weight = np.array([1.1, 0.5, -0.35]) @ shares, np.full(15, 0.03**-2)
    force = MOST / 2
    for _ in range(3):
        expected, precision = find_normal(shares, target, weight, (0.5 * force) ** -2, power)
        force = expected[0]
    assert 0.03 < math.hypot(*expected[1:]) < 0.6
    linear, logs, *_ = fit(ROUND, make_texels(target, weight), power=power)
    assert linear == pytest.approx(expected, rel=1e-9)
    volume = -0.5 * np.linalg.slogdet(precision)[1]
    density = -2 * math.log(force) - (expected[1:] ** 2).sum() / (2 * (0.5 * force) ** 2)
    assert logs[0] == pytest.approx(volume + density, rel=1e-9)


def test_ellipticities_beyond_a_line_are_shortened_by_a_growing_precision():
    shares = share_points(ROUND.arrays, PLACE, np.array([1.3e-3]), 15)[0]
    target, weight = np.array([0.8, 1.1, -0.7]) @ shares, np.full(15, 0.002**-2)

    def exceed(logarithm):
        found, _ = find_normal(shares, target, weight, math.exp(logarithm))
        return math.hypot(*found[1:]) - found[0]

    expected, _ = find_normal(shares, target, weight, math.exp(brentq(exceed, 0, 20)))
    linear = fit(ROUND, make_texels(target, weight))[0]
    assert linear == pytest.approx(expected, abs=0.02)
    assert math.hypot(*linear[1:]) <= linear[0] * (1 + 1e-9)


def test_a_texel_that_tells_an_edge_joins_where_the_touch_contradicts_it():
    """One texel is dark and one is full; each weighs as one of the noise if the force is beyond its edge."""
    shares = share(PLACE)[0, POINTS.order, 2]
    weight = np.full(15, 0.02**-2)
    weight[[1, 2]] = 0.0
    for edges, joins in (((1.2, 0.8), (0, 0)), ((0.7, 0.8), (1, 0)), ((1.2, 1.5), (0, 1)), ((0.7, 1.5), (1, 1))):
        target, sign = 1.0 * shares, np.ones(15)
        target[[1, 2]], sign[2] = shares[[1, 2]] * edges, -1.0
        heavy = weight.copy()
        heavy[[1, 2]] = np.array(joins) / NOISE**2
        expected = (6 / 1.7 + (heavy * shares * target).sum()) / (12 / 1.7**2 + (heavy * shares**2).sum())
        linear, _, residual, forces = fit(POINTS, make_texels(target, weight, sign))
        assert linear[0] == pytest.approx(expected, rel=1e-3)
        assert residual == pytest.approx(np.sqrt(heavy) * (forces - target), abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("u", [-60.0, -36.0, -34.0, -3.0, 0.5, 7.5, 9.0])
def test_the_likelihood_of_an_edge_is_a_normal_probability(sign, u):
    """Texels of much weight hold the force; one more tells that it lies u deviations within its edge."""
    shares = share(PLACE)[0, POINTS.order, 2]
    weight, target, signs = np.full(15, 1e14), shares.copy(), np.ones(15)
    held = fit(POINTS, make_texels(target, weight))
    weight[3], signs[3], target[3] = 0.0, sign, held[3][3] + sign * u * NOISE
    rest = np.delete(np.arange(15), 3)
    _, logs, _, forces = fit(POINTS, make_texels(target, weight, signs))
    other = (weight[rest] * (forces[rest] - target[rest]) ** 2).sum() / 2
    within = sign * (target[3] - forces[3]) / NOISE
    assert within == pytest.approx(u, abs=1e-3)
    assert logs[1] == pytest.approx(log_ndtr(within) - other, rel=1e-9, abs=2e-5 if u < -35 else 1e-9)


@pytest.mark.parametrize("u", [0.0, 2.5, -2.5, 6.0])
def test_the_likelihood_of_a_wide_count_is_the_probability_between_its_ends(u):
    shares, half = share(PLACE)[0, POINTS.order, 2], 0.013
    weight, target, wide = np.full(15, 1e14), shares.copy(), np.zeros(15)
    held = fit(POINTS, make_texels(target, weight))
    weight[3], wide[3], target[3] = 1.0, half, held[3][3] + u * NOISE
    _, logs, _, forces = fit(POINTS, make_texels(target, weight, 1.0, wide))
    rest = np.delete(np.arange(15), 3)
    other = (weight[rest] * (forces[rest] - target[rest]) ** 2).sum() / 2
    ends = [(target[3] + each * half - forces[3]) / NOISE for each in (1, -1)]
    assert logs[1] == pytest.approx(math.log(ndtr(ends[0]) - ndtr(ends[1])) - other, rel=1e-9)
    target[3] += 1.0  # no probability is left, and its logarithm stays finite
    assert fit(POINTS, make_texels(target, weight, 1.0, wide))[1][1] == pytest.approx(
        math.log(1e-300) - other, rel=1e-3
    )
