"""Touches located with Gaussian texel forces: borders of the words of a frame, boxes, rotated sensors, and tables."""

import csv
import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import log_ndtr
from scipy.stats import chi2

import validation
from fastmodel import Electronics
from meshes import TexelArray
from tests.support.gaussian_touches import CENTRES, MIDDLE, PITCH, TOUCHES, share
from validation.resolution.channel import Channel, Reading, make_channel
from validation.resolution.frames import Frames
from validation.resolution.locate import Estimate, Located, LocatedFrame, LocatedTouch, Locator, locate_frames
from validation.resolution.touches import Touches

NOISE = 2.0**-8
PLACE = np.array([0.3e-3, -0.5e-3])
ONE = 1.0 * share([PLACE])[0, :, 2]


def make_locator(*, noise=NOISE, channel=None, radii=(0.0, 0.0), **changes):
    centres = np.column_stack([CENTRES, np.zeros(15)])
    options = {"touches": TOUCHES, "channel": channel or Channel(noise=noise), "centres": centres, "radii": radii}
    return Locator(**options | changes)


def find(locator, forces, count=1, time=0.0):
    return locator.find(locator.channel.read(np.asarray(forces, float)[None], np.zeros((1, 15))), count, time)


def single(texel, force):
    return np.where(np.arange(15) == texel, force, 0.0)


def values(frame):
    return [[(e.low, e.value, e.high) for e in (t.x, t.y, t.z, t.force)] for t in frame.touches]


@pytest.mark.parametrize(
    ("texel", "low", "high"),
    [
        (7, (-3.0, -4.5), (3.0, 4.5)), (0, (-1.0, -1.5), (3.0, 4.5)), (3, (-3.0, -1.5), (3.0, 4.5)),
        (4, (-3.0, -1.5), (1.0, 4.5)), (11, (-3.0, -4.5), (3.0, 1.5)),
    ],
)  # fmt: skip
def test_a_box_reaches_three_halves_of_a_pitch_and_half_a_pitch_beyond_the_array(texel, low, high):
    """The array has 5 x 3 texels of 2 mm x 3 mm."""
    locator = make_locator()
    chart = locator.chart(texel)
    assert (1e3 * chart.low, 1e3 * chart.high) == (pytest.approx(low), pytest.approx(high))
    assert locator.chart(texel) is chart
    assert chart.texel == texel


def test_a_box_reaches_texels_that_do_not_measure_and_has_the_radii_that_may_be():
    beyond = np.vstack([np.column_stack([CENTRES, np.zeros(15)]), [[6e-3, 4e-3, 0.0]]])
    chart = make_locator(centres=beyond, radii=(0.4e-3, 1.6e-3)).chart(14)
    assert 1e3 * chart.high == pytest.approx([3.0, 2.5])
    assert chart.radii[[0, -1]].tolist() == [0.4e-3, 1.6e-3]


@pytest.mark.parametrize(
    ("forces", "words"),
    [
        (single(3, -6 * NOISE), ("at rest",)), (single(3, -6.001 * NOISE), ("negative forces",)),
        (single(3, 3.999 * NOISE), ("at rest",)), (single(3, 4 * NOISE), ("0 texels lit",)),
        (single(3, 4.001 * NOISE), ("1 texel lit",)), (single(3, 9.0) + single(4, -6.1 * NOISE), ("negative forces",)),
    ],
)  # fmt: skip
def test_a_frame_shows_a_touch_from_four_deviations_on_and_no_pull_beyond_six(forces, words):
    """Noise of 1/256 N, so that its multiples are exact."""
    found = find(make_locator(), forces, time=2.5)
    assert (found.words[-1:], found.time) == (words, 2.5)
    assert bool(found.touches) == words[0].endswith("lit")


def count(sensitivity=200.0, offset=0.0, output_max=4095, noise=1e-3):
    electronics = Electronics(rate_hz=100.0, sensitivity=sensitivity, offset=offset, output_max=output_max)
    return make_channel(electronics, noise, np.ones(15, dtype=bool))[0]


@pytest.mark.parametrize(("counts", "rest"), [(1, True), (2, False)])
def test_rounding_counts_as_noise(counts, rest):
    """Counts of 5 mN: their 1.44 mN with a noise of 1.2 mN make 1.88 mN."""
    locator = make_locator(channel=count(noise=1.2e-3))
    found = locator.find(locator.channel.take(np.where(np.arange(15) == 6, counts, 0)[None]), 1)
    assert (found.words == ("at rest",)) == rest


def make_pattern():
    """Deviations of the seven brightest texels that no change of place and force makes."""
    slopes, bright = share([PLACE])[0, :, :3], np.argsort(-ONE)[:7]
    pattern = np.zeros(15)
    pattern[bright] = [0.05, -0.09, 0.02, 0.08, -0.05, 0.06, -0.07]
    pattern[bright] -= slopes[bright] @ np.linalg.lstsq(slopes[bright], pattern[bright], rcond=None)[0]
    return pattern, bright


@pytest.mark.parametrize(("over", "told"), [(0.096, False), (0.104, True)])
def test_deviations_above_a_tenth_of_the_forces_are_not_explained(over, told):
    pattern, _ = make_pattern()
    forces = ONE + over * pattern / np.linalg.norm(pattern) * np.linalg.norm(ONE)
    found = find(make_locator(noise=1e-4), forces)
    assert found.unexplained == pytest.approx(over * np.linalg.norm(ONE) / np.linalg.norm(forces), rel=0.02)
    assert ("not explained by 1 touch" in found.words) == told
    assert values(found)[0][3][1] == pytest.approx(1.0, abs=0.03)


def test_a_deviation_is_unexplained_if_noise_makes_it_in_one_of_a_hundred_frames_at_most():
    """The sum of squares over the variance, beside the quantile of chi squared for the lit texels less three."""
    pattern, bright = make_pattern()
    forces = np.where(np.isin(np.arange(15), bright), ONE, 0.0) + pattern
    best = least_squares(lambda at: at[2] * share([at[:2] * 1e-3])[0, :, 2] - forces, [0.3, -0.5, 1.0])
    told = {}
    for noise in np.geomspace(8e-3, 3e-2, 14):
        locator = make_locator(noise=noise)
        found = find(locator, forces)
        if found.unexplained <= 0.1:
            continue
        lit = forces > 4 * noise
        explained = best.fun + forces
        apart = np.where(lit | (explained > 4 * noise), best.fun, 0.0)
        ratio = (apart**2).sum() / noise**2 / chi2.isf(0.01, max((lit | (apart != 0)).sum() - 3, 1))
        told[round(ratio, 3)] = "not explained by 1 touch" in found.words
    assert told == {ratio: ratio > 1 for ratio in told}
    assert any(0.8 < ratio < 1 for ratio in told)
    assert any(1 < ratio < 1.25 for ratio in told)


@pytest.mark.parametrize(("apart", "close"), [(5.8e-3, True), (6.2e-3, False)])
def test_touches_closer_than_two_of_the_larger_pitch_may_be_one(apart, close):
    """Pitches of 2 mm and 3 mm: 6 mm."""
    forces = sum(load * share([[x, 0.1e-3]])[0, :, 2] for load, x in ((1.0, -2.9e-3), (0.7, -2.9e-3 + apart)))
    found = find(make_locator(noise=1e-4), forces, 2)
    assert sorted(each.force.value for each in found.touches) == pytest.approx([0.7, 1.0], abs=0.01)
    assert ("touches closer than two pitches" in found.words) == close


def test_as_many_touches_are_found_as_explain_a_frame_better():
    places = ([-3.9e-3, -2.5e-3], [0.2e-3, 2.4e-3], [3.8e-3, -2.2e-3])
    parts = [load * share([place])[0, :, 2] for load, place in zip((1.0, 0.8, 0.6), places, strict=True)]
    locator = make_locator(noise=1e-3)
    for number in (1, 2, 3):
        found = find(locator, sum(parts[:number]), 3)
        told = sorted((t.x.value, t.y.value, t.force.value) for t in found.touches)
        truth = sorted((*place, load) for place, load in zip(places[:number], (1.0, 0.8, 0.6), strict=False))
        assert np.array(told) == pytest.approx(np.array(truth), abs=0.02)
        assert np.array(told)[:, :2] == pytest.approx(np.array(truth)[:, :2], abs=1e-4)
        assert ("3 touches are not told apart" in found.words) == (number < 3)
    two = find(locator, sum(parts), 2)
    assert len(two.touches) == 2
    assert "not explained by 2 touches" in two.words


def test_a_sensor_that_is_turned_has_its_touches_turned():
    """Axes x and y of the texels lie along z and x of the sensor, and the top a shift away from the middle plane."""
    axes, shift = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), np.array([0.3e-3, -0.7e-3, 0.2e-3])
    turned = Touches(
        origins=CENTRES @ axes, axes=np.tile(axes, (15, 1, 1)), pitch=TOUCHES.pitch, respond=TOUCHES.respond,
        project=lambda points: points + shift,
    )  # fmt: skip
    forces = share([[1.9e-3, -0.6e-3]])[0, :, 2]
    ((x, y, _, force),) = values(find(make_locator(), forces))
    ((*place, load),) = values(find(make_locator(touches=turned, centres=CENTRES @ axes), forces))
    assert x[1] == pytest.approx(1.9e-3, abs=5e-5)
    assert load == pytest.approx(force)
    for found, expected, by in zip(place, (y, (0.0,) * 3, x), shift, strict=True):
        assert found == pytest.approx(np.array(expected) + by, abs=1e-9)


def test_a_radius_is_told_if_it_is_not_given():
    radius = 1.1e-3
    spots = np.array([[math.cos(t), math.sin(t)] for t in np.arange(12) * math.pi / 6])
    w = (np.arange(40) + 0.5) / 40
    rings = radius * np.sqrt(1 - (1 - w) ** (2 / 3))
    forces = np.mean([share(PLACE + r * spots)[..., 2].mean(axis=0) for r in rings], axis=0)
    found = find(make_locator(noise=1e-4, radii=(0.0, 2e-3)), forces)
    assert found.touches[0].radius.low < radius < found.touches[0].radius.high
    assert found.words == ()
    assert find(make_locator(noise=1e-4, radii=(radius, radius)), forces).touches[0].radius is None


@pytest.mark.parametrize("size", [4.0, 8.0])
def test_a_misfit_that_is_not_noise_is_not_taken_for_a_further_touch(size):
    """The better fit of two touches counts beside the misfit per degree of freedom that is left."""
    pattern = np.random.default_rng(0).choice([-1.0, 1.0], 15) * size * NOISE
    slopes = share([PLACE])[0, :, :3]
    pattern -= slopes @ np.linalg.lstsq(slopes, pattern, rcond=None)[0]
    found = find(make_locator(), np.maximum(10 * ONE + pattern, -5 * NOISE), 2)
    assert "2 touches are not told apart" in found.words
    assert len(found.touches) == 1


@pytest.mark.parametrize("level", [0.085, 0.12])
def test_dark_texels_around_a_lit_one_bound_its_touch(level):
    """Sums over a grid of places and forces; texels are dark below 21 mN, with a noise of 5 mN."""
    channel = count(sensitivity=500.0, offset=-10.0, noise=5e-3)
    forces = np.where(np.arange(15) == MIDDLE, level, 0.0)
    locator = make_locator(channel=channel)
    reading = channel.read(forces[None], np.zeros((1, 15)))
    low, high = reading.low[0], reading.high[0]
    line = (np.arange(36) + 0.5) / 18 - 1
    places = np.array(list(itertools.product(PITCH[0] * line, PITCH[1] * line)))
    force = 1.2 * (np.arange(90) + 0.5) / 90
    odds = np.zeros((len(places), len(force)))
    for k in range(15):
        told = share(places)[:, k, 2][:, None] * force
        if k == MIDDLE:
            odds -= (told - (low[k] + high[k]) / 2) ** 2 / (channel.noise**2 + (high[k] - low[k]) ** 2 / 12) / 2
        else:
            odds += log_ndtr((high[k] - told) / channel.noise)
    weights = np.exp(odds - odds.max())
    weights /= weights.sum()
    (touch,) = locator.find(reading, 1).touches
    for found, axis, ends in ((touch.x, 0, places[:, 0]), (touch.y, 1, places[:, 1])):
        order = np.argsort(ends, kind="stable")
        reach = np.interp([0.025, 0.975], np.cumsum(weights.sum(axis=1)[order]), ends[order])
        assert (found.low, found.high) == pytest.approx(tuple(reach), abs=0.1 * PITCH[axis])
    assert touch.force.value == pytest.approx(weights.sum(axis=0) @ force, rel=0.08)


def respond_alone(points, axes, radius, among):
    """Force on one texel, and none on another one that no touch in the box of the first one reaches."""
    found = TOUCHES.respond(points, axes, radius, np.array([MIDDLE]))
    return np.column_stack([found, 0 * found])[:, among]


LONE = Touches(
    origins=np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]]), axes=np.tile(np.eye(3)[:2], (2, 1, 1)), pitch=TOUCHES.pitch,
    respond=respond_alone,
)  # fmt: skip


@pytest.mark.parametrize("saturated", [False, True])
def test_a_single_texel_leaves_place_and_force_to_their_prior(saturated):
    """Uniform up to ten times the sum of the texels; three times the force that saturates a texel from its best place.

    Sums over a grid of places within three halves of a pitch, and of forces.
    """
    electronics = Electronics(rate_hz=100.0, sensitivity=100.0, output_max=50)
    channel = make_channel(electronics, 5e-3, np.ones(2, dtype=bool))[0] if saturated else Channel(noise=0.02)
    locator = make_locator(touches=LONE, channel=channel)
    forces = np.array([[0.9, 0.0] if saturated else [0.2, 0.15]])
    found = locator.find(channel.read(forces, np.zeros((1, 2))), 1)
    edge = float(channel.edges[-2].max())
    most = 3 * edge / 0.4 if saturated else 10 * 0.2
    line = (np.arange(60) + 0.5) / 30 - 1
    places = np.array(list(itertools.product(1.5 * PITCH[0] * line, 1.5 * PITCH[1] * line)))
    force = most * (np.arange(600) + 0.5) / 600
    told = share(places)[:, MIDDLE, 2][:, None] * force
    odds = told > edge if saturated else np.exp(-((told - 0.2) ** 2) / (2 * 0.02**2))
    weights = odds.sum(axis=0) / odds.sum()
    (touch,) = found.touches
    assert touch.force.value == pytest.approx(weights @ force, rel=0.1)
    ends = np.interp([0.025, 0.975], np.cumsum(weights), force)
    assert (touch.force.low, touch.force.high) == (pytest.approx(ends[0], rel=0.08), pytest.approx(ends[1], rel=0.05))
    assert found.words == (
        ("1 texel saturated", "0 texels lit") if saturated else ("not explained by 1 touch", "2 texels lit")
    )


def make_frame(values, **options):
    parts = [Estimate(value=value, low=value - 1, high=value + 2) for value in values]
    names = ("x", "y", "z", "force", "radius")
    return LocatedTouch(**dict(zip(names, parts, strict=False)), **options)


FRAMES = (
    LocatedFrame(time=0.5, touches=(make_frame([10, 20, 30, 40]), make_frame([11, 21, 31, 41, 51])), unexplained=0.25),
    LocatedFrame(time=0.75, words=("at rest",)),
    LocatedFrame(time=1.0, touches=(make_frame([12, 22, 32, 42]),), words=("2 texels lit", "1 texel saturated")),
)
LOCATED = Located(sensor="pad", radii=(0.0, 2.5e-3), noise=4e-3, noise_assumed=False, frames=FRAMES)


def test_a_table_has_a_row_for_each_touch_and_each_frame_without_one(tmp_path):
    head, rows = LOCATED.table()
    assert head == [
        "frame", "time", "touch", "x", "x_low", "x_high", "y", "y_low", "y_high", "z", "z_low", "z_high", "force",
        "force_low", "force_high", "radius", "radius_low", "radius_high", "unexplained", "words",
    ]  # fmt: skip
    assert rows == [
        [0, 0.5, 0, 10, 9, 12, 20, 19, 22, 30, 29, 32, 40, 39, 42, "", "", "", 0.25, ""],
        [0, 0.5, 1, 11, 10, 13, 21, 20, 23, 31, 30, 33, 41, 40, 43, 51, 50, 53, 0.25, ""],
        [1, 0.75, "", *[""] * 15, 0.0, "at rest"],
        [2, 1.0, 0, 12, 11, 14, 22, 21, 24, 32, 31, 34, 42, 41, 44, "", "", "", 0.0, "2 texels lit; 1 texel saturated"],
    ]
    LOCATED.write(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [[str(each) for each in row] for row in (head, *rows)]


@pytest.mark.parametrize(
    ("radii", "words"),
    [
        ((0.0, 2.5e-3), "Round or slightly oval touches of an unknown radius from 0 mm to 2.5 mm; noise of 4 mN"),
        ((1.5e-3, 1.5e-3), "Round touches of radius 1.5 mm; noise of 4 mN"), ((0.0, 0.0), "Point touches; noise"),
    ],
)  # fmt: skip
def test_sentences_explain_the_words_that_occur(radii, words):
    first, *others = dataclasses.replace(LOCATED, radii=radii).explain()
    assert first.startswith(words)
    assert first.endswith("Intervals hold 95 %.")
    assert [each.split(":")[0] for each in others] == ["at rest", "lit", "saturated"]
    assumed = next(dataclasses.replace(LOCATED, noise_assumed=True, frames=()).explain())
    assert "one count, because the sensor states none" in assumed


WTS = dataclasses.replace(
    validation.load("wts-0614-34"),
    electronics=Electronics(rate_hz=100.0, sensitivity=20.0, offset=-1.0, output_max=250),
)


def make_frames(*rows, forces=False):
    frames = np.zeros((len(rows), 84))
    frames[:, 40] = rows
    return Frames(values=frames, times=0.5 + np.arange(len(rows)), forces=forces, measured=np.ones(84, dtype=bool))


def test_counts_below_zero_by_more_than_a_fiftieth_of_the_largest_are_negative():
    """2 % of 250 counts are 5."""
    lines = []
    found = locate_frames(WTS, make_frames(0, -6, -5), noise=7e-3, progress=lines.append)
    assert [(each.time, each.words) for each in found.frames] == [
        (0.5, ("at rest",)), (1.5, ("negative forces",)), (2.5, ("at rest",)),
    ]  # fmt: skip
    assert [each for each in lines if each.startswith("frame")] == [f"frame {k} of 3" for k in (1, 2, 3)]
    pulled = locate_frames(WTS, make_frames(0, -0.06, forces=True), noise=7e-3)
    assert [each.words for each in pulled.frames] == [("at rest",), ("negative forces",)]


def test_what_is_asked_with_other_options_is_prepared_anew():
    """More sensors and options in turn than are kept, twice; one count is 50 mN."""
    other = dataclasses.replace(WTS, name="other")
    asked = [
        (WTS, 5e-3, None, False), (WTS, 6e-3, None, False), (WTS, 5e-3, (0.0, 0.0), False), (WTS, 5e-3, None, True),
        (other, 5e-3, None, False), (WTS, None, (1e-3, 2e-3), False),
    ]  # fmt: skip
    for sensor, noise, radii, forces in 2 * asked:
        found = locate_frames(sensor, make_frames(0, forces=forces), noise=noise, radii=radii)
        assert (found.sensor, found.radii) == (sensor.name, radii or (0.0, pytest.approx(3.4e-3)))
        assert found.noise_assumed == (noise is None)
        assert found.noise == pytest.approx(0.05 if noise is None else noise)


def test_a_touch_is_up_to_the_larger_pitch_wide_if_no_radius_is_given():
    sensor = dataclasses.replace(WTS, array=TexelArray.grid(3, 5, (3e-3, 4e-3)))
    frames = Frames(values=np.zeros((1, 15)), times=np.array([1.5]), forces=True, measured=np.ones(15, dtype=bool))
    found = locate_frames(sensor, frames, noise=5e-3)
    assert found.radii == pytest.approx((0.0, 4e-3))
    assert (found.frames[0].time, found.frames[0].words) == (1.5, ("at rest",))
    reading = Reading(np.zeros((1, 15)), np.zeros((1, 15)))
    assert make_locator().find(reading, 1) == LocatedFrame(time=0.0, words=("at rest",))
