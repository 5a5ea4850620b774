"""What a count tells about a force, against probabilities of counts that are summed directly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from fastmodel.signal.electronics import TEXEL_FORCE, Electronics
from validation.errors import InputError
from validation.resolution.channel import Channel, make_channel, say_noise

#: 20 counts at zero force, 50 counts per newton, saturated at 60 counts; no count below a force of -0.4 N + 0.02 N k.
COUNTS = Electronics(rate_hz=100.0, sensitivity=50.0, offset=20.0, output_max=60, bits=8, calibrated=TEXEL_FORCE)
GAINS = replace(COUNTS, gains=(1.0, 0.5, 2.0))


def find_edges(electronics, gain=1.0):
    """Smallest force of each count by the definition of the electronics, from a fine list of forces."""
    forces = np.arange(-200_000, 300_000) * 1e-5
    single = replace(electronics, gains=(gain,))
    counts = single.counts(forces[:, None])[:, 0]
    return np.array([forces[np.argmax(counts >= level)] for level in range(1, electronics.output_max + 1)])


def test_the_edges_are_the_least_forces_of_the_counts():
    channel = Channel(noise=0.3, electronics=GAINS)
    assert channel.edges.shape == (62, 3)
    assert np.isneginf(channel.edges[0]).all()
    assert np.isposinf(channel.edges[-1]).all()
    for column, gain in enumerate(GAINS.gains):
        expected = find_edges(COUNTS, gain)
        inner = channel.edges[1:-1, column]
        known = np.isfinite(inner)
        np.testing.assert_allclose(inner[known], expected[known], atol=1.1e-5)
        assert (expected[~known] < -10 * 0.3 + 1e-3).all()
    assert channel.usual_step == pytest.approx(np.median(np.diff(channel.edges[1:-1], axis=0)))
    single = Channel(noise=0.3, electronics=COUNTS)
    assert single.usual_step == pytest.approx(0.02)
    assert single.spread == pytest.approx(math.hypot(0.3, 0.02 / math.sqrt(12)))


def probabilities(channel, force):
    """Probability of each count at a force, by the normal distribution between its edges."""
    ends = norm.cdf((channel.edges[:, 0] - force) / channel.noise)
    return np.diff(ends)


@pytest.mark.parametrize("noise", [0.002, 0.008, 0.05, 0.2])
def test_the_information_is_the_sum_over_all_counts(noise):
    """Exact where the noise is below half a count; else rounding acts as further noise, within 3 %."""
    channel = Channel(noise=noise, electronics=COUNTS)
    forces = np.array([0.0031, 0.2, 0.4123, 0.79])
    found = channel.information(forces[:, None])[:, 0]
    for force, value in zip(forces, found, strict=True):
        step = 1e-4 * noise
        low, middle, high = (probabilities(channel, force + sign * step) for sign in (-1, 0, 1))
        seen = middle > 1e-12
        exact = (((high - low)[seen] / (2 * step)) ** 2 / middle[seen]).sum()
        assert value == pytest.approx(exact, rel=2e-3 if noise < 0.01 else 0.03)
    assert Channel(noise=noise).information(forces) == pytest.approx(np.full(4, noise**-2))


@pytest.mark.parametrize("noise", [0.004, 0.08])
def test_the_likelihood_of_a_reading_is_that_of_its_counts(noise):
    channel = Channel(noise=noise, electronics=GAINS)
    cases = np.array([[0.0, 0.1, 0.2], [0.02, 0.12, 0.21], [-0.01, 0.3, 0.5]])
    least = -10 * noise  # smaller forces are not expected
    frames = GAINS.counts(np.array([[0.003, 0.11, 0.2], [0.9, 0.1, max(-0.3, least)], [0.0, max(-1.0, least), 0.22]]))
    reading = channel.take(frames)
    seen = np.array([0, 1, 2])
    found = channel.log_likelihood(reading, cases, seen)
    for row, frame in enumerate(frames):
        expected = np.zeros(3)
        for texel, count in enumerate(frame):
            low, high = channel.edges[count, texel], channel.edges[count + 1, texel]
            upper, lower = ((end - cases[:, texel]) / noise for end in (high, low))
            if np.isneginf(low):
                expected += norm.logcdf(upper)
            elif np.isposinf(high):
                expected += norm.logsf(lower)
            else:
                turned = lower > 0
                share = np.where(turned, norm.sf(lower) - norm.sf(upper), norm.cdf(upper) - norm.cdf(lower))
                expected += np.log(np.maximum(share, 1e-300))
        apart = found[row] - found[row, 0] - (expected - expected[0])
        assert np.abs(apart).max() < 0.02 * max(1, np.abs(expected - expected[0]).max())
    # a texel alone, by its place among the three
    alone = channel.log_likelihood(reading, cases[:, [1]], np.array([1]))
    rest = channel.log_likelihood(reading, cases[:, [0, 2]], np.array([0, 2]))
    np.testing.assert_allclose(alone + rest, found, rtol=1e-9, atol=1e-9)


def test_frames_are_limited_to_the_counts_that_there_are():
    channel = Channel(noise=0.01, electronics=COUNTS)
    reading = channel.take(np.array([[-3, 0, 5, 60, 99]]))
    np.testing.assert_allclose(reading.low[0], channel.edges[[0, 0, 5, 60, 60], 0])
    np.testing.assert_allclose(reading.high[0], channel.edges[[1, 1, 6, 61, 61], 0])
    bare = Channel(noise=0.01).take(np.array([[1, 2]]))
    np.testing.assert_array_equal(bare.low, bare.high)
    drawn = Channel(noise=0.5).read(np.array([[1.0, 2.0]]), np.array([[0.2, -1.0]]))
    np.testing.assert_allclose(drawn.low, [[1.1, 1.5]])
    counted = channel.read(np.array([[0.105, 0.4]]), np.array([[0.3, -0.8]]))
    noisy = np.array([[0.108, 0.392]])
    assert (counted.low <= noisy).all()
    assert (counted.high > noisy).all()
    np.testing.assert_allclose(counted.high - counted.low, 0.02)


def test_the_lowest_count_within_ten_noises_tells_that_the_force_lies_below_its_upper_edge():
    channel = Channel(noise=0.004, electronics=COUNTS)
    lowest = int(COUNTS.counts(np.array([[-0.04]]))[0, 0])
    assert lowest > 0
    cases = np.array([[0.0], [-0.02], [0.05]])
    found = channel.log_likelihood(channel.take(np.array([[lowest]])), cases, np.array([0]))
    expected = norm.logcdf((channel.edges[lowest + 1] - cases[:, 0]) / 0.004)
    np.testing.assert_allclose(found[0], expected, rtol=1e-9)


def test_a_count_that_no_force_gives_tells_nothing():
    """A texel reads 0 where 20 counts are at zero force, with a noise of a fifth of a count."""
    channel = Channel(noise=0.004, electronics=COUNTS)
    reading = channel.take(np.array([[22, 0]]))
    cases = np.array([[0.03, 0.0], [0.05, 0.2]])
    found = channel.log_likelihood(reading, cases, np.array([0, 1]))
    alone = channel.log_likelihood(reading, cases[:, [0]], np.array([0]))
    np.testing.assert_allclose(found, alone)
    assert np.isfinite(found).all()


def test_a_lit_texel_lies_three_noises_above_the_threshold_and_below_saturation():
    dead = replace(COUNTS, offset=-5.0)  # the first count begins at 0.11 or 0.12 N
    channel = Channel(noise=0.01, electronics=replace(dead, gains=(1.0, 0.5)))
    first, last = channel.edges[1], channel.edges[-2]
    assert channel.is_lit(first + 0.0301).all()
    assert not channel.is_lit(first + 0.0299).any()
    assert channel.is_lit(last - 1e-6).all()
    assert not channel.is_lit(last + 1e-6).any()
    assert channel.is_lit(first[[1]] + 0.0301, np.array([1])).all()
    assert not channel.is_lit(first[[0]] + 0.0301, np.array([1])).any()
    assert channel.is_shown(first - 0.0999).all()
    assert not channel.is_shown(first - 0.1001).any()
    bare = Channel(noise=0.01)
    assert bare.is_shown(np.array([2.01e-4, 1.99e-4])).tolist() == [True, False]


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_the_least_force_is_found_in_ninety_percent_of_frames(noise):
    """A texel behind a dead zone is reported from the least count that rest exceeds in one frame of a thousand."""
    electronics = replace(COUNTS, offset=-5.0)
    channel, shares = Channel(noise=noise, electronics=electronics), np.array([0.5, 0.2, 0.05])
    edges = channel.edges[1:-1, 0]
    level = edges[np.argmax(norm.cdf(edges / noise) ** 3 >= 0.999)]

    def miss(force):
        return norm.cdf((level - force * shares) / noise).prod() - 0.1

    assert channel.find_least_force(shares) == pytest.approx(brentq(miss, 0, 10), rel=1e-6)


def test_without_a_dead_zone_the_frame_is_weighted_with_the_known_image():
    shares, noise = np.array([0.5, 0.2, 0.05]), 0.05
    quantiles = norm.ppf(0.999) + norm.ppf(0.9)
    assert Channel(noise=noise).find_least_force(shares) == pytest.approx(quantiles * noise / np.linalg.norm(shares))
    found = Channel(noise=noise, electronics=COUNTS).find_least_force(shares)
    assert found == pytest.approx(
        quantiles * math.hypot(noise, 0.02 / math.sqrt(12)) / np.linalg.norm(shares), rel=1e-6
    )
    # of one count, which noise alone exceeds in more than one frame of a thousand: no touch is ever reported
    blind = replace(COUNTS, offset=-5.0, output_max=1)
    assert Channel(noise=0.2, electronics=blind).find_least_force(shares) == math.inf


@pytest.mark.parametrize("force", [2e-3, 0.7, 90.0, 9e3, 1.9e4, 1e5, math.inf])
def test_one_texel_shows_a_touch_at_the_level_and_the_quantile_of_the_noise_unless_no_force_suffices(force):
    """The level and 1.28 standard deviations reach the texel at the force, if that lies below about 1e4 N."""
    channel = Channel(noise=0.1, electronics=replace(COUNTS, offset=-5.0))
    edges = channel.edges[1:-1, 0]
    level = edges[np.argmax(norm.cdf(edges / 0.1) >= 0.999)]
    found = channel.find_least_force(np.array([(level - 0.1 * norm.ppf(0.1)) / force]))
    assert found == pytest.approx(force if force < 1e4 else math.inf, rel=1e-6)


def test_the_noise_of_a_channel_is_stated_of_the_electronics_or_one_count():
    active = np.array([True, False, True])
    channel, assumed = make_channel(GAINS, None, active)
    assert (channel.electronics.gains, channel.electronics.noise, assumed) == ((1.0, 2.0), 0.0, True)
    assert channel.noise == pytest.approx(channel.usual_step, rel=1e-3)
    noisy = replace(COUNTS, noise=0.03)
    channel, assumed = make_channel(noisy, None, active)
    assert (channel.noise, assumed, channel.electronics.gains) == (pytest.approx(0.03), False, None)
    warm = replace(noisy, temperature_coefficient=0.01, temperature_excess=25.0)
    assert make_channel(warm, 0.05, active)[0].noise == pytest.approx(0.05 / warm.temperature_gain)
    with pytest.raises(InputError, match="one count has no size"):
        make_channel(replace(COUNTS, output_max=1), None, active)
    assert say_noise(0.0123, assumed=False) == "noise of 12.3 mN"
    assert say_noise(0.0123, assumed=True).startswith("noise of 12.3 mN: one count")
