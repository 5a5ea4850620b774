"""The posterior of a touch with Gaussian texel forces, against sums over a grid of places and forces."""

import math

import numpy as np
import pytest
from scipy.special import log_ndtr, ndtr

from fastmodel import Electronics
from tests.support.gaussian_touches import MIDDLE, PITCH, TOUCHES, share
from validation.resolution.channel import Channel, Reading, make_channel
from validation.resolution.chart import make_chart
from validation.resolution.posterior import Posterior, Search, pool

NOISE = 4e-3
POINTS = make_chart(TOUCHES, MIDDLE, -0.7 * PITCH, 0.8 * PITCH, (0.0, 0.0))
ROUND = make_chart(TOUCHES, MIDDLE, -0.7 * PITCH, 0.8 * PITCH, (0.2e-3, 3e-3))
ALL = np.arange(15)


def make_posterior(weights, start=0.0):
    count = len(weights)
    numbers = start + np.arange(count, dtype=float)
    return Posterior(
        np.column_stack([numbers, numbers + 100]), numbers + 200, numbers + 300, numbers[:, None] + [400.0, 500.0],
        np.array(weights),
    )  # fmt: skip


def test_quantiles_lie_between_points_in_their_order_by_the_middles_of_their_weights():
    """Forty points of equal weight: 2.5 % is half-way from the first to the second, 97.5 % to the last."""
    order = np.random.default_rng(1).permutation(40)
    values = np.column_stack([order.astype(float) ** 2, -3.0 * order])
    mean, low, high = make_posterior([1 / 40] * 40).summarise(values)
    assert mean == pytest.approx([sum(k**2 for k in range(40)) / 40, -3.0 * 19.5])
    assert low == pytest.approx([0.5, -3.0 * 38.5])
    assert high == pytest.approx([(38**2 + 39**2) / 2, -1.5])


def test_quantiles_follow_the_weights():
    """Middles of the weights lie at 0.01, 0.04, 0.255, 0.705, 0.96 and 0.99."""
    values = np.array([[1.0], [2.0], [4.0], [8.0], [16.0], [32.0]])
    mean, low, high = make_posterior([0.02, 0.04, 0.39, 0.51, 0.0, 0.04]).summarise(values)
    assert mean == pytest.approx([0.02 + 0.08 + 1.56 + 4.08 + 1.28])
    assert low == pytest.approx([1.0 + (0.025 - 0.01) / 0.03])
    assert high == pytest.approx([16.0 + 16.0 * (0.975 - 0.96) / 0.02])


def test_several_posteriors_are_one_with_equal_parts():
    found = pool([make_posterior([0.25, 0.75]), make_posterior([0.5, 0.3, 0.2], 10.0)])
    assert found.weights == pytest.approx([0.125, 0.375, 0.25, 0.15, 0.1])
    assert found.radii.tolist() == [200.0, 201.0, 210.0, 211.0, 212.0]
    assert found.forces.tolist() == [300.0, 301.0, 310.0, 311.0, 312.0]
    assert found.places[2].tolist() == [10.0, 110.0]
    assert found.texels[4].tolist() == [412.0, 512.0]


def search(channel, forces, normal=None, *, chart=POINTS, most=0.5, others=None, seen=ALL):
    reading = channel.read(np.asarray(forces)[None], np.zeros((1, 15)) if normal is None else normal[None])
    others = np.zeros(15) if others is None else others
    counting = chart.order[np.isin(chart.order, seen)]
    return Search(chart=chart, channel=channel, reading=reading, seen=counting, most=most, others=others)


def sum_over_grid(channel, reading, most, others=0.0, *, count=31, forces=61, span=None, power=1.0):
    """Mean and standard deviation of x, y and force of the posterior with a uniform prior in the box of the chart."""
    low, high = (reading.low[0], reading.high[0])
    line, (least, largest) = (np.arange(count) + 0.5) / count, span or (0.0, most)
    f = least + (largest - least) * (np.arange(forces) + 0.5) / forces
    x, y = (PITCH[k] * (-0.7 + 1.5 * line) for k in (0, 1))
    values = np.array(np.meshgrid(x, y, f, indexing="ij")).reshape(3, -1).T
    places = np.array(np.meshgrid(x, y, indexing="ij")).reshape(2, -1).T
    cases = (share(places)[:, None, :, 2] * f[:, None]).reshape(-1, 15) + others
    odds = np.zeros(len(cases))
    for k in range(15):
        width, noise = high[k] - low[k], channel.noise
        if np.isneginf(low[k]):
            odds += log_ndtr((high[k] - cases[:, k]) / noise)
        elif np.isposinf(high[k]):
            odds += log_ndtr((cases[:, k] - low[k]) / noise)
        elif width <= 2 * noise:
            odds -= (cases[:, k] - low[k] - width / 2) ** 2 / (noise**2 + width**2 / 12) / 2
        else:
            above, below = ((each[k] - cases[:, k]) / noise for each in (high, low))
            odds += np.log(np.maximum(ndtr(above) - ndtr(below), 1e-300))
    weights = np.exp(power * (odds - odds.max()))
    weights /= weights.sum()
    mean = weights @ values
    return mean, np.sqrt(weights @ (values - mean) ** 2)


def check(found, expected, *, shift=0.12, ratio=0.1):
    values = np.column_stack([found.places, found.forces])
    mean = found.weights @ values
    spread = np.sqrt(found.weights @ (values - mean) ** 2)
    assert found.weights.sum() == pytest.approx(1.0)
    assert np.abs(mean - expected[0]) / expected[1] == pytest.approx(np.zeros(3), abs=shift)
    assert spread / expected[1] == pytest.approx(np.ones(3), abs=ratio)
    assert (found.radii == 0).all()
    assert found.texels == pytest.approx(found.forces[:, None] * share(found.places)[..., 2], abs=1e-3)


TRUTH = np.array([[0.3e-3, -0.5e-3]])
EXACT = 0.1 * share(TRUTH)[0, :, 2]
DRAWN = np.random.default_rng(4).standard_normal(15)
BARE = Channel(noise=NOISE)


def test_forces_with_noise_alone():
    """All 15 texels are lit; they tell place and force within a sixth of the pitch and an eighth."""
    found = search(BARE, EXACT, DRAWN)
    assert (found.size, found.rows, found.free) == (3, 1, 12)
    assert found.ends == pytest.approx(np.array([-0.7 * PITCH, 0.8 * PITCH]))
    check(found.sample(), sum_over_grid(BARE, found.reading, 0.5, span=(0.05, 0.2)))


def test_the_force_of_other_touches_is_taken_off():
    others = 0.3 * share([[3e-3, 2e-3]])[0, :, 2]
    one, both = search(BARE, EXACT, DRAWN), search(BARE, EXACT + others, DRAWN, others=others)
    assert both.explained == pytest.approx(one.explained, abs=1e-6)
    assert both.misfit == pytest.approx(one.misfit, rel=1e-5)


def test_a_texel_that_does_not_count_has_no_say():
    """The texels that count are the first ones in the order of the chart, and the last one is left out."""
    last = POINTS.order[-1]
    spoilt = EXACT.copy()
    spoilt[last] += 1.0
    one, two = (search(BARE, each, seen=np.delete(ALL, last)) for each in (EXACT, spoilt))
    assert one.explained == pytest.approx(two.explained)
    assert one.explained == pytest.approx(np.where(last == ALL, 0.0, EXACT), abs=5e-4)
    assert (one.free, one.explained[last], one.sample().texels[:, last].max()) == (11, 0.0, 0.0)


def test_the_misfit_is_that_of_the_most_likely_touch():
    """A tenth of a standard deviation of noise, so that the prior counts for nothing."""
    from scipy.optimize import least_squares

    forces = 10 * EXACT + NOISE * DRAWN

    def differ(values):
        return (values[2] * share([values[:2] * 1e-3])[0, :, 2] - forces) / NOISE

    best = least_squares(differ, [0.0, 0.0, 1.0])
    found = search(BARE, forces, most=3.0)
    assert found.misfit == pytest.approx(2 * best.cost, rel=0.01)
    assert found.explained == pytest.approx(forces + NOISE * differ(best.x), abs=0.1 * NOISE)


@pytest.mark.parametrize("size", [0.5, 2.0, 4.0])
def test_a_misfit_beyond_the_noise_widens_the_posterior(size):
    """Variances grow by m / f (4 - 3 f / m), with the misfit m above the degrees of freedom f."""
    pattern = np.where(ALL % 2, size, -size)
    slopes = share(TRUTH)[0, :, :3]
    pattern = pattern - slopes @ np.linalg.lstsq(slopes, pattern, rcond=None)[0]
    found = search(BARE, 10 * EXACT + NOISE * pattern, most=3.0)
    misfit = (pattern**2).sum()
    assert found.misfit == pytest.approx(misfit, rel=0.03, abs=0.05)
    grown = max(1.0, misfit / 12) * (4 - 3 * min(1.0, 12 / misfit))
    covariance = np.linalg.inv(slopes.T @ slopes) * NOISE**2
    drawn = found.sample()
    values = np.column_stack([drawn.places, drawn.forces])
    spread = np.sqrt(drawn.weights @ (values - drawn.weights @ values) ** 2)
    assert spread == pytest.approx(np.sqrt(grown * np.diag(covariance)), rel=0.12)


def count(sensitivity, *, offset=0.0, output_max=4095, noise=NOISE):
    electronics = Electronics(rate_hz=100.0, sensitivity=sensitivity, offset=offset, output_max=output_max)
    return make_channel(electronics, noise, np.ones(15, dtype=bool))[0]


@pytest.mark.parametrize(
    ("channel", "load"),
    [
        (count(500.0), 0.1),  # counts of 2 mN beside a noise of 4 mN
        (count(100.0, noise=3e-3), 0.1),  # counts of 10 mN are wide beside a noise of 3 mN
        (count(500.0, offset=-6.0), 0.1),  # dark up to 13 mN
        (count(500.0, output_max=14), 0.1),  # full from 27 mN on
    ],
)
def test_counts_narrow_and_wide_dark_and_full(channel, load):
    found = search(channel, load * share(TRUTH)[0, :, 2], DRAWN)
    low, high = found.reading.low[0], found.reading.high[0]
    assert found.free == (np.isfinite(low) & np.isfinite(high)).sum() - 3
    explained = min(1.0, found.free / found.misfit) if found.free > 0 else 1.0
    power = explained / (4 - 3 * explained)
    check(found.sample(), sum_over_grid(channel, found.reading, 0.5, power=power), shift=0.2, ratio=0.15)


def test_two_lit_texels_leave_a_wide_posterior():
    """Dark below 22 mN; fewer lit texels than parameters, so that the prior bounds what the texels leave open."""
    channel = count(500.0, offset=-10.5)
    found = search(channel, EXACT, most=0.3)
    assert found.free < 0
    check(found.sample(), sum_over_grid(channel, found.reading, 0.3), shift=0.2, ratio=0.15)


def test_as_many_lit_texels_as_parameters_leave_a_posterior_of_the_likelihood_itself():
    """Three texels with noise, and none of the others was measured."""
    lit = np.isin(ALL, [MIDDLE, MIDDLE - 1, MIDDLE + 5])
    reading = Reading(*(np.where(lit, EXACT, end)[None] for end in (-np.inf, np.inf)))
    found = Search(chart=POINTS, channel=BARE, reading=reading, seen=POINTS.order, most=0.5, others=np.zeros(15))
    assert (found.free, found.size) == (0, 3)
    mean, spread = sum_over_grid(BARE, reading, 0.5)
    drawn = found.sample()
    values = np.column_stack([drawn.places, drawn.forces])
    assert np.abs(drawn.weights @ values - mean) / spread == pytest.approx(np.zeros(3), abs=0.2)
    found_spread = np.sqrt(drawn.weights @ (values - drawn.weights @ values) ** 2)
    assert found_spread / spread == pytest.approx(np.ones(3), abs=0.15)


def test_a_radius_and_two_ellipticities_are_further_parameters():
    """A pressure of Hertz adds a fifth of the squared radius to the variance of the response along each axis."""
    radius, width = 2e-3, 1.6e-3
    forces = 2.0 * share(TRUTH, radius / math.sqrt(5))[0, :, 2] / (1 + radius**2 / 5 / width**2)
    found = search(Channel(noise=1e-3), forces, chart=ROUND, most=6.0)
    assert (found.size, found.rows, found.free) == (6, 3, 9)
    assert found.ends[:, 2] == pytest.approx([0.2e-3, 3e-3])
    assert found.ends[:, :2] == pytest.approx(np.array([-0.7 * PITCH, 0.8 * PITCH]))
    drawn = found.sample()
    values = np.column_stack([drawn.places, drawn.forces, drawn.radii])
    mean = drawn.weights @ values
    spread = np.sqrt(drawn.weights @ (values - mean) ** 2)
    assert mean[:2] == pytest.approx(TRUTH[0], abs=2e-5)
    assert mean[2:] == pytest.approx([2.0, 2e-3], rel=0.05)
    # noise alone leaves 6 um; the place of a pressure of unknown shape is unknown by 1.5 % of its radius
    assert spread[:2] == pytest.approx([0.015 * mean[3]] * 2, rel=0.1)
    assert ((drawn.radii >= 0.2e-3) & (drawn.radii <= 3e-3) & (drawn.forces > 0) & (drawn.forces <= 6.0)).all()
