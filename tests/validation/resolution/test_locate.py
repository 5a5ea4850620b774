"""Touches located in frames: closed forms, symmetry, scaling, coverage with frames of the channel, and bad input."""

import dataclasses
import json
import re

import numpy as np
import pytest

import fastmodel
import validation
from fem_reference.closed_form.layer import tabulate_texel_response
from validation.errors import InputError
from validation.render.figure import OUTLINE
from validation.resolution.channel import Channel, make_channel
from validation.resolution.chart import make_chart
from validation.resolution.frames import Frames
from validation.resolution.kernel import fit_touches, share_points
from validation.resolution.limits import Study
from validation.resolution.locate import Locator, locate_frames, make_locator
from validation.resolution.touches import find_touches

WTS = validation.load("wts-0614-34")
COUNTS = fastmodel.load("wts-0614-34").electronics
NOISE = 5e-3
PITCH = np.array(WTS.array.pitch)
MIDDLE = 38


@pytest.fixture(scope="module")
def touches():
    return find_touches(WTS.cover, WTS)


@pytest.fixture(scope="module")
def points(touches):
    """Locator of point touches, of forces with noise alone."""
    return Locator(touches=touches, channel=Channel(noise=NOISE), centres=WTS.array.centres, radii=(0.0, 0.0))


@pytest.fixture(scope="module")
def counted(touches):
    """Locator of point touches in counts of the WTS."""
    channel = make_channel(COUNTS, NOISE, WTS.array.active)[0]
    return Locator(touches=touches, channel=channel, centres=WTS.array.centres, radii=(0.0, 0.0))


@pytest.fixture(scope="module")
def chart(touches):
    """Texel forces of touches of a radius of up to a pitch, within three pitches."""
    return make_chart(touches, MIDDLE, -1.5 * PITCH, 1.5 * PITCH, (0.0, PITCH[0]))


def find(locator, forces, seed=None, count=1):
    """Locate touches in texel forces, with noise of a seed or without."""
    shape = (1, len(forces))
    normal = np.zeros(shape) if seed is None else np.random.default_rng(seed).standard_normal(shape)
    return locator.find(locator.channel.read(np.asarray(forces)[None], normal), count)


def press(touches, place, load=1.0, texel=MIDDLE, radius=0.0):
    """Compute exact texel forces of a touch, and its place in the array's frame."""
    at = np.asarray(place, float)
    return load * touches.forces(texel, at[None], radius)[0], touches.origins[texel][:2] + at


def middle(frame):
    touch = frame.touches[0]
    return np.array([touch.x.value, touch.y.value, touch.force.value])


def width(frame):
    touch = frame.touches[0]
    return np.array([each.high - each.low for each in (touch.x, touch.y, touch.force)])


def test_a_chart_has_the_exact_response_of_round_touches(touches, chart):
    places = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 2)) * PITCH
    apart = touches.origins[MIDDLE, :2] + places[:, None] - WTS.array.centres[:, :2]
    for radius in (0.0, 0.8e-3, 2.7e-3):
        exact = tabulate_texel_response(WTS.cover, WTS.array.texel_size, radius)(apart[..., 0], apart[..., 1])
        found = share_points(chart.arrays, places, np.full(len(places), radius), len(chart.order))[:, 0]
        assert found == pytest.approx(exact[:, chart.order], abs=1.5e-3)


def test_a_chart_has_the_response_of_an_oval_touch(touches, chart):
    """Pairs of touches on two axes differ by the moments that the second and third row of a chart stand for."""
    radius, apart = 1e-3, 0.15e-3
    place = np.array([[0.4e-3, 0.7e-3]])
    _, oval, turned = share_points(chart.arrays, place, np.array([radius]), len(chart.order))[0]
    for found, first, second in ((oval, [apart, 0.0], [0.0, apart]), (turned, [apart, apart], [apart, -apart])):
        along, across = (
            touches.forces(MIDDLE, place + np.outer([-1, 1], each), radius, chart.order).mean(axis=0)
            for each in (first, second)
        )
        assert found == pytest.approx((along - across) * radius**2 / (5 * np.dot(first, first)), abs=5e-4)


def test_the_likelihood_of_a_fit_is_that_of_the_counts(touches, chart, counted):
    """Compiled least squares and likelihood, against those of numpy and the channel, with dark and saturated texels."""
    forces, _ = press(touches, [0.5e-3, 0.3e-3], 5.0)
    reading, seen, noise, most = counted.channel.read(forces[None], np.zeros((1, 84))), chart.order[:30], NOISE, 20.0
    low, high = reading.low[0, seen], reading.high[0, seen]
    lit, full = np.isfinite(high - low), np.isposinf(high)
    assert all(each.any() for each in (lit, full, ~lit & ~full))
    width = np.where(lit, high - low, 0.0)
    target, weight = np.where(full, low, high) - width / 2, np.where(lit, 1 / (noise**2 + width**2 / 12), 0.0)
    texels, rng = np.array([target, weight, np.where(full, -1.0, 1.0), np.zeros(30)]), np.random.default_rng(2)
    places, radii = rng.uniform(-0.5, 0.5, (6, 2)) * PITCH, rng.uniform(0, PITCH[0], 6)
    linear, logs, residual, found = fit_touches(chart.arrays, texels, noise, most, 1.0, places, radii, np.zeros((6, 3)))
    shares = share_points(chart.arrays, places, radii, 30)
    assert found == pytest.approx((linear[:, None] @ shares)[:, 0], abs=1e-12)
    assert logs[:, 1] == pytest.approx(counted.channel.log_likelihood(reading, found, seen)[0], rel=1e-9)
    apart = found - target
    heavy = np.where(lit, weight, (texels[2] * apart > 0) / noise**2)
    assert residual == pytest.approx(np.sqrt(heavy) * apart, rel=1e-9, abs=1e-9)
    moved = [
        fit_touches(chart.arrays, texels, noise, most, 1.0, places, radii, np.tile(axis, (6, 1)))[0] - linear
        for axis in np.eye(3)
    ]
    volume = np.log(np.abs(np.linalg.det(np.stack(moved, axis=-1))))
    force = np.maximum(linear[:, 0], 1e-12)
    density = -((linear[:, 1:] ** 2).sum(axis=1)) / (0.5 * force) ** 2 / 2 - 2 * np.log(force)
    assert logs[:, 0] == pytest.approx(volume + density, rel=1e-6)


def test_force_and_ellipticities_of_exact_texels_are_given_back_with_the_covariance_of_least_squares(chart):
    """The prior beside the texels: a uniform force of 0 to the largest one, and ellipticities of 0.5 of the force."""
    rng, true, noise, most, power = np.random.default_rng(5), np.array([1.5, 0.4, -0.3]), 1e-4, 20.0, 0.7
    places, radii = rng.uniform(-0.8, 0.8, (5, 2)) * PITCH, rng.uniform(0.5, 1.0, 5) * PITCH[0]
    spread = noise * rng.uniform(0.5, 2.0, 30)
    for place, radius in zip(places, radii, strict=True):
        at = (place[None], np.array([radius]))
        shares = share_points(chart.arrays, *at, 30)[0]
        texels = np.array([true @ shares, spread**-2, np.ones(30), np.zeros(30)])
        found, *_ = fit_touches(chart.arrays, texels, noise, most, power, *at, np.zeros((1, 3)))
        assert found[0] == pytest.approx(true, abs=2e-3)
        moved = [
            (fit_touches(chart.arrays, texels, noise, most, power, *at, axis[None].copy())[0] - found)[0]
            for axis in np.eye(3)
        ]
        precision = power * (shares / spread**2) @ shares.T + np.diag([12 / most**2, *2 * [(0.5 * true[0]) ** -2]])
        assert np.transpose(moved) @ moved @ precision == pytest.approx(np.eye(3), abs=1e-3)


def test_a_frame_without_noise_gives_its_touch_back(touches, points):
    for place in ([0.3e-3, -1.1e-3], [1.6e-3, 0.2e-3]):
        forces, at = press(touches, place, 0.7)
        assert middle(find(points, forces)) == pytest.approx([*at, 0.7], abs=5e-4)


def test_a_round_touch_of_unknown_radius_is_explained_although_a_full_step_goes_too_far(touches):
    radius = 2.8e-3
    locator = Locator(
        touches=touches, channel=Channel(noise=NOISE), centres=WTS.array.centres, radii=(0.0, float(PITCH[0]))
    )
    forces, at = press(touches, [-0.01, 0.39] * PITCH, 1.0, radius=radius)
    found = find(locator, forces, seed=12)
    assert found.words == ()
    assert found.unexplained < 0.01
    touch = found.touches[0]
    for value, true in ((touch.x, at[0]), (touch.y, at[1]), (touch.force, 1.0), (touch.radius, radius)):
        assert abs(value.value - true) < value.high - value.low
    assert touch.force.high - touch.force.low < 0.1


def test_a_symmetric_frame_gives_a_touch_on_its_line(touches, points, counted):
    for locator, load in ((points, 1.0), (counted, 2.0)):
        forces, at = press(touches, [PITCH[0] / 2, 0.0], load)  # between two texels
        found = find(locator, forces)
        assert abs(middle(found)[0] - at[0]) < 0.1 * width(found)[0]


def test_mirrored_and_shifted_frames_give_mirrored_and_shifted_touches(touches, counted):
    rows, columns = WTS.array.rows, WTS.array.columns
    forces, _ = press(touches, [0.6e-3, -0.9e-3], 2.0)
    image = forces.reshape(rows, columns)
    once = find(counted, forces)
    for axis, turn in ((1, [-1, 1, 1]), (0, [1, -1, 1])):
        mirrored = find(counted, np.flip(image, axis).ravel())
        assert (np.abs(middle(mirrored) - middle(once) * turn) < 0.1 * width(once)).all()
        assert width(mirrored) == pytest.approx(width(once), rel=0.25)
    shifted, _ = press(touches, [0.6e-3, -0.9e-3], 2.0, texel=MIDDLE + columns)
    assert (np.abs(middle(find(counted, shifted)) - middle(once) - [0, PITCH[1], 0]) < 0.02 * width(once)).all()


def test_intervals_are_proportional_to_the_noise_and_those_of_the_bound(touches):
    forces, _ = press(touches, [0.5e-3, 0.4e-3])
    widths = []
    for noise in (2e-3, 8e-3):
        locator = Locator(touches=touches, channel=Channel(noise=noise), centres=WTS.array.centres, radii=(0.0, 0.0))
        widths.append(width(find(locator, forces)))
        study = Study(touches=touches, channel=Channel(noise=noise), texel=MIDDLE, load=1.0)
        bound = np.sqrt(np.diagonal(study.bound(np.array([[0.5e-3, 0.4e-3]]), 3)[0][0]))
        assert widths[-1] / 3.92 == pytest.approx(bound, rel=0.1)
    assert widths[1] == pytest.approx(4 * widths[0], rel=0.1)


@pytest.mark.parametrize("most", [0.0, PITCH[0]], ids=["points", "unknown radius"])
@pytest.mark.parametrize("kind", ["forces", "counts"])
@pytest.mark.slow
def test_intervals_hold_the_truth_in_95_of_100_frames(touches, points, counted, kind, most):
    channel = (points if kind == "forces" else counted).channel
    locator = Locator(touches=touches, channel=channel, centres=WTS.array.centres, radii=(0.0, most))
    rng, held = np.random.default_rng(8), []
    for _ in range(120):
        place, load = rng.uniform(-0.5, 0.5, 2) * PITCH, rng.uniform(0.8, 2.5)
        forces, at = press(touches, place, load, radius=round(rng.uniform(0, most), 4))
        found = find(locator, forces, seed=rng.integers(1 << 30))
        told = found.touches[0]
        held.append([a.low <= b <= a.high for a, b in zip((told.x, told.y, told.force), (*at, load), strict=True)])
    assert 0.92 <= np.mean(held) <= 0.995


def test_two_touches_are_found_together_and_one_is_not_taken_for_two(touches, points):
    first, at = press(touches, [0.4e-3, 0.2e-3], 1.0)
    second, there = press(touches, [-0.7e-3, 0.5e-3], 0.6, texel=MIDDLE + 8)
    found = find(points, first + second, seed=1, count=2)
    told = np.array(sorted((t.x.value, t.y.value, t.force.value) for t in found.touches))
    truth = np.array(sorted([(*at, 1.0), (*there, 0.6)]))
    assert told[:, 2] == pytest.approx(truth[:, 2], abs=0.05)
    assert told[:, :2] == pytest.approx(truth[:, :2], abs=2e-4)
    alone = find(points, first, seed=1, count=2)
    assert len(alone.touches) == 1
    assert alone.words == ("2 touches are not told apart",)


def test_what_a_frame_does_not_tell_is_said(touches, points, counted):
    nothing = np.zeros(WTS.array.count)
    assert find(points, nothing, seed=1).words == find(counted, nothing, seed=1).words == ("at rest",)
    assert find(points, np.where(np.arange(84) == 3, -0.2, 0.0)).words == ("negative forces",)
    assert "1 texel saturated" in find(counted, press(touches, [0, 0], 5.0)[0]).words
    assert "1 texel lit" in find(counted, press(touches, [0, 0], 0.3)[0]).words
    corners = sum(press(touches, [0, 0], 0.5, texel=MIDDLE + each)[0] for each in (-14, -10, 10, 14))
    assert "not explained by 1 touch" in find(points, corners, seed=2).words


@pytest.mark.parametrize(
    ("columns", "level"),
    [
        pytest.param((1, 4), 9.0, id="saturated, and dark between them"),
        pytest.param((1, 2, 3, 4), 9.0, id="saturated over more than a touch is wide"),
        pytest.param((1, 4), 0.4, id="dark between two lit ones"),
        pytest.param((1, 3), 0.4, id="one dark between two lit ones"),
        pytest.param((1, 3), 9.0, id="one dark between two saturated ones"),
    ],
)
def test_dark_and_saturated_texels_contradict_a_touch(touches, counted, columns, level):
    """A round touch, also the widest one, presses the texels between two that it lights, and few at the same force."""
    row = np.zeros((WTS.array.rows, WTS.array.columns))
    row[6, list(columns)] = level
    wide = Locator(touches=touches, channel=counted.channel, centres=WTS.array.centres, radii=(0.0, PITCH[0]))
    for locator in (counted, wide):
        found = find(locator, row.ravel())
        assert "not explained by 1 touch" in found.words
        assert found.unexplained > 0.1
    pair = find(counted, sum(press(touches, [0, 0], 3.0, texel=6 * 6 + each)[0] for each in (0, 5)), count=2)
    assert len(pair.touches) == 2
    assert not any("not explained" in each for each in pair.words)


@pytest.mark.parametrize("level", [0.2, 0.9])
def test_two_lit_texels_with_a_dark_one_between_are_two_touches(touches, counted, level):
    """An oval touch is no longer than a line, so that none reaches over a dark texel."""
    row = np.zeros((WTS.array.rows, WTS.array.columns))
    row[6, [1, 3]] = level
    wide = Locator(touches=touches, channel=counted.channel, centres=WTS.array.centres, radii=(0.0, PITCH[0]))
    found = find(wide, row.ravel(), count=2)
    assert found.words == ("2 texels lit",)
    places = np.array(sorted((touch.x.value, touch.y.value) for touch in found.touches))
    assert places == pytest.approx(WTS.array.centres[[37, 39], :2], abs=0.4 * PITCH[0])


def test_elongated_touches_are_told_from_round_ones(touches, points):
    line = sum(press(touches, [along, 0], 0.5)[0] for along in np.linspace(-2, 2, 9) * PITCH[0]) / 4
    round_one, _ = press(touches, [0.2e-3, 0.1e-3], 1.1)
    assert "not explained by 1 touch" in find(points, line, seed=4).words
    assert find(points, round_one, seed=4).words == ()


def test_touches_closer_than_two_pitches_may_be_one(touches, points):
    first, _ = press(touches, [0.1e-3, 0.2e-3], 1.0)
    for columns, close in ((1, True), (3, False)):
        second, _ = press(touches, [0.1e-3, 0.2e-3], 1.0, texel=MIDDLE + columns)
        found = find(points, first + second, seed=1, count=2)
        assert len(found.touches) == 2
        assert ("touches closer than two pitches" in found.words) == close


def test_a_touch_lies_on_the_top_of_the_cover(touches, points):
    touch = find(points, press(touches, [0.4e-3, 0.2e-3])[0]).touches[0]
    assert touch.z.low == touch.z.value == touch.z.high == WTS.cover.thickness


def test_the_sentences_name_the_touches_that_are_assumed():
    counts = np.zeros((1, WTS.array.count), dtype=int)
    for radius, words in (("0 mm", "Point touches;"), ("1 mm", "Round touches of radius 1 mm;"), (None, "Round or sl")):
        assert next(WTS.locate(counts, noise="5 mN", radius=radius).explain()).startswith(words)


def test_a_sensor_locates_touches_in_its_counts(touches):
    forces, at = press(touches, [0.7e-3, 0.2e-3], 2.0)
    found = WTS.locate(COUNTS.counts(forces), noise="5 mN", radius="0 mm").frames[0]
    truth = zip((found.touches[0].x, found.touches[0].y, found.touches[0].force), (*at, 2.0), strict=True)
    assert all(each.low < value < each.high for each, value in truth)


@pytest.mark.parametrize(
    ("frames", "options", "words"),
    [
        (np.zeros((2, 7)), {}, r"shape \(2, 7\); wts-0614-34 takes \(frames, 84\)"),
        (np.full(84, np.nan), {}, "frame 0, texel 0 is not finite"),
        (np.full(84, 0.5), {}, "pass forces=True"),
        (np.zeros((0, 84)), {}, "holds no frame"),
        (np.zeros(84), {"touches": 0}, "--touches: accepted: 1..4, not 0"),
        (np.zeros(84), {"noise": "-1 mN"}, "--noise: must be positive"),
        (np.zeros(84), {"radius": "2mm:1mm"}, "--radius: '2mm:1mm' must not fall"),
        (np.zeros(84), {"picture": "a.gif"}, "neither .png nor .svg"),
    ],
)
def test_bad_input_names_place_and_remedy(frames, options, words):
    with pytest.raises(InputError, match=words):
        validation.locate(WTS, frames, **options)


def test_the_command_and_the_function_agree(softcover, tmp_path, touches):
    counts = COUNTS.counts(press(touches, [0.3e-3, 0.5e-3], 1.5)[0])
    head = ",".join(["time", *(f"texel_{each}" for each in range(84))])
    (tmp_path / "touch.csv").write_text(f"{head}\n0.0,{','.join(map(str, counts))}\n")
    status, out, _ = softcover(
        *["locate", "wts-0614-34", "touch.csv", "--noise", "5mN", "--radius", "0mm", "--out", "all.csv", "--json"]
    )
    assert status == 0
    found = validation.locate("wts-0614-34", counts, noise="5 mN", radius="0 mm")
    assert json.loads(out) == found.as_json()
    rows = (tmp_path / "all.csv").read_text().splitlines()
    assert float(rows[1].split(",")[3]) == pytest.approx(found.frames[0].touches[0].x.value)
    (tmp_path / "other.csv").write_text("# rows = 2\n# columns = 2\ntime,a,b,c,d\n0,1,2,3,4\n")
    status, _, error = softcover("locate", "wts-0614-34", "other.csv")
    assert status == 2
    assert "name the sensor that made the recording" in error


def test_frames_at_rest_do_not_hide_the_touches_of_a_long_recording(softcover, tmp_path, touches):
    counts = COUNTS.counts(press(touches, [0.3e-3, 0.5e-3], 1.5)[0])
    head = ",".join(["time", *(f"texel_{each}" for each in range(84))])
    lines = [f"{0.1 * k:.1f},{','.join(map(str, counts if k == 29 else 0 * counts))}" for k in range(30)]
    (tmp_path / "long.csv").write_text("\n".join([head, *lines]) + "\n")
    status, out, _ = softcover("locate", "wts-0614-34", "long.csv", "--noise", "5mN", "--radius", "0mm")
    assert status == 0
    assert " 2.90  " in out
    assert "29 at rest" in out


def read_picture(path):
    """Return words and numbers of a drawing, and whether a touch is drawn in it."""
    text = path.read_text()
    words = re.findall(r"<text[^>]*>([^<]*)</text>", text)
    return words, [float(each) for each in words if re.fullmatch(r"[0-9.]+", each)], OUTLINE in text


def test_a_picture_shows_touches_in_the_units_of_the_frames(touches, tmp_path):
    forces, _ = press(touches, [0.7e-3, 0.2e-3], 0.9)
    WTS.locate(forces, forces=True, noise="5 mN", picture=tmp_path / "flat.svg")
    words, numbers, drawn = read_picture(tmp_path / "flat.svg")
    assert {"force [N]", "row", "column"} <= set(words)
    assert any(0 < each <= forces.max() for each in numbers)
    assert max(numbers) <= WTS.array.rows
    assert drawn


@pytest.mark.slow
def test_a_picture_of_a_curved_array_is_unrolled(small_pad, tmp_path):
    row = dataclasses.replace(small_pad.array, rows=1, columns=9)
    sensor = dataclasses.replace(small_pad, array=row)
    forces, _ = press(find_touches(sensor.cover, sensor), [0.3e-3, -0.2e-3], 1.0, texel=4)
    sensor.locate(forces, forces=True, noise="2 mN", radius="0 mm", picture=tmp_path / "row.svg")
    words, _, drawn = read_picture(tmp_path / "row.svg")
    assert {"force [N]", "unrolled x [mm]", "unrolled y [mm]"} <= set(words)
    assert drawn


@pytest.mark.slow
def test_a_touch_on_a_curved_cover_is_found(small_pad):
    locator, _ = make_locator(small_pad, noise=2e-3, forces=True, radii=(0.0, 0.0))
    forces, at = press(locator.touches, [0.3e-3, -0.2e-3], 1.0, texel=4)
    found = find(locator, forces, seed=3)
    assert middle(found)[2] == pytest.approx(1.0, abs=0.03)
    assert middle(found)[:2] == pytest.approx(at, abs=1e-4)
    assert found.touches[0].z.value == pytest.approx(small_pad.cover.thickness, rel=1e-6)


def test_few_lit_texels_that_no_touch_explains_and_counts_of_another_sensor_are_told():
    sensor = validation.load("wts-0614-34")
    counts = np.zeros(84, dtype=int)
    counts[[37, 38, 43, 36, 49]] = 1000, 20, 900, 900, 20  # an L of six texels of six columns
    counts[42] = 20
    assert any("not explained" in each for each in sensor.locate(counts, noise="5 mN").frames[0].words)
    with pytest.raises(InputError, match="counts up to 60000, but those of wts-0614-34 end at"):
        sensor.locate(np.where(counts == 1000, 60000, counts))


def test_a_texel_that_was_switched_off_tells_nothing(touches):
    forces, off = press(touches, (0.5e-3, 0.3e-3), 2.0)[0], MIDDLE + 1
    values = np.array([forces, forces, forces])
    values[1:, off] = 0.0, 5.0
    measured = np.arange(WTS.array.count) != off
    frames = Frames(values=values, times=np.arange(3.0), forces=True, measured=measured)
    first, *others = locate_frames(WTS, frames, noise=NOISE, radii=(0.0, 0.0)).frames
    (touch,) = first.touches
    assert touch.x.low < touches.origins[MIDDLE, 0] + 0.5e-3 < touch.x.high
    for other in others:
        assert dataclasses.replace(other, time=0.0) == first
