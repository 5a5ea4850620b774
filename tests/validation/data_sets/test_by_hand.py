"""Zeros, ages, creep, ranges and null models of a few texels, computed by hand."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes import Box, TexelArray
from validation.calibration.model import Observations, Placement
from validation.data_sets.data_set import DataFile, DataSet
from validation.data_sets.images import describe_layout, find_creep, find_load, observe, read_image, read_images
from validation.data_sets.nulls import NULLS, fit_pattern, fit_polynomials, fit_ratio, fit_zeros
from validation.data_sets.zeros import find_rest, find_unloaded, find_unloaded_by_force, subtract_zero
from validation.recordings.importing import save
from validation.recordings.recording import Recording, RecordingError, Setup, make_array

FACE = Box(size=(0.01, 0.01, 0.01))
HERE = Placement(name="here", indenter=FACE, at=(0.0, 0.0), yaw=0.0)
PITCH = (4e-3, 3e-3)
ARRAY = TexelArray.grid(2, 3, PITCH, name="pad")
NAN = np.nan


def repeat(*values_and_times):
    """A series of values, each a number of times."""
    return np.concatenate([np.full(times, float(value)) for value, times in values_and_times])


@pytest.mark.parametrize(
    ("total", "onset", "last"),  # frames every 0.5 s
    [
        (repeat((0, 4), (10, 8)), 2.0, 11),
        (repeat((10, 12)), 0.0, 11),
        (repeat((0, 12)), 5.5, 11),  # it never rises
        (repeat((0, 4), (10, 6), (0, 2)), 2.0, 9),
        # removal: 9.4 lies below 95 % of the final value, 9.6 does not
        (repeat((0, 4), (10, 5), (9.4, 1), (0, 2)), 2.0, 8),
        (repeat((0, 4), (10, 5), (9.6, 1), (0, 2)), 2.0, 9),
        # a touch of less than half of the final value is no load, one of half is
        (repeat((0, 2), (4.9, 2), (10, 8)), 2.0, 11),
        (repeat((0, 2), (5.0, 2), (10, 8)), 1.0, 11),
        # the final value is that of the last 2 s: 10, of which 4 is less than half
        (repeat((0, 1), (20, 2), (4, 2), (10, 7)), 2.5, 11),
        # the load ends where the sum falls below half of its upper tenth
        (repeat((0, 3), (12, 6), (5, 3)), 1.5, 8),
    ],
)
def test_a_load_lasts_from_half_of_its_final_sum_to_its_removal(total, onset, last):
    assert find_load(np.arange(len(total)) / 2, total) == (onset, last)


@pytest.mark.parametrize(("threshold", "creep"), [(0.0, 0.12), (50.0, 0.12), (0.0, -0.05)])
def test_creep_is_the_slope_over_the_logarithm_of_time_over_the_value_at_two_seconds(threshold, creep):
    age = np.linspace(-1, 12, 131)
    grown = 1 + creep * np.log(np.maximum(age, 0.5) / 2)
    counts = np.outer(grown, [300.0, 600.0]) - threshold
    dark = np.where(np.arange(131) == 60, 0.0, 900.0)  # a texel that reads zero once takes no part
    assert find_creep(age, np.column_stack([counts, dark]), threshold) == pytest.approx(creep)
    counts[age < 2] = 7  # nor do earlier frames
    assert find_creep(age, counts, threshold) == pytest.approx(creep)


@pytest.mark.parametrize(("until", "known"), [(4.0, True), (3.9, False), (1.0, False)])
def test_creep_needs_four_seconds_and_a_lit_texel(until, known):
    age = np.arange(0, until + 0.05, 0.1)
    assert np.isfinite(find_creep(age, np.full((len(age), 1), 9.0), 0.0)) == known
    assert np.isnan(find_creep(age, np.zeros((len(age), 1)), 0.0))


# Zeros: frames at 1 Hz of texels that read 10 and 20 at rest and rise by 100 and 50 under load.

ZERO, RISE = np.array([10.0, 20.0, 30.0]), np.array([100.0, 50.0, 0.0])
ON = repeat((0, 6), (1, 8), (0, 6)).astype(bool)
TIMES = np.arange(20.0)
ALL = np.ones(3, dtype=bool)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_zero_of_a_texel_is_interpolated_between_groups_at_rest_and_counts_that_fall_are_turned(sign):
    """Drifts of the three texels between mean times 2.5 s and 16.5 s."""
    slope = np.array([0.5, 0.5, 0.5])
    counts = ZERO + sign * np.outer(ON, RISE) + np.outer(TIMES, slope)
    found = subtract_zero(TIMES, counts, ALL, ~ON)
    assert found.sign == sign
    assert found.counts[ON] == pytest.approx(np.tile(RISE, (8, 1)))
    assert found.at_rest == 12
    assert found.zero == pytest.approx(ZERO + 0.5 * np.clip(TIMES, 2.5, 16.5).mean())
    assert found.noise == pytest.approx(np.zeros(3), abs=1e-9)
    assert found.rest == pytest.approx(np.zeros(3))
    assert found.rest_time == pytest.approx((2.5 + 16.5) / 2)
    assert found.drift == (0.0, np.inf)  # rest is known at two times
    once = subtract_zero(TIMES[:14], counts[:14], ALL, ~ON[:14])
    assert once.drift[0] == pytest.approx(sign * 1.5)
    assert (once.rest_time, once.at_rest) == (2.5, 6)


def test_rubber_that_was_pressed_recovers_and_takes_the_drift_of_the_others():
    counts = ZERO + np.outer(ON, RISE) + np.outer(TIMES >= 14, [8.0, 3.0, 3.0])
    found = subtract_zero(TIMES, counts, ALL, ~ON)
    middle = 3.0 * (np.arange(6, 14) - 2.5) / 14
    assert found.counts[ON] == pytest.approx(RISE - middle[:, None])


@pytest.mark.parametrize(("stands", "kept"), [(3.0, True), (12.0, False)])
def test_a_texel_recovers_if_it_stands_above_three_spreads_of_the_others(stands, kept):
    """The untouched ones drift by 2, 3 and 4 counts: a spread of 1.4826, and 3 + 3 x 1.4826 = 7.4."""
    rises = np.array([100.0, 0.0, 0.0, 0.0])
    after = np.array([stands + 3.0, 2.0, 3.0, 4.0])
    counts = 50 + np.outer(ON, rises) + np.outer(TIMES >= 14, after)
    found = subtract_zero(TIMES, counts, np.ones(4, dtype=bool), ~ON)
    middle = (stands + 3.0 if kept else 3.0) * (np.arange(6, 14) - 2.5) / 14
    assert found.counts[ON][:, 0] == pytest.approx(100 - middle)


def test_texels_that_a_firmware_clips_keep_their_counts():
    """The outer two read zero in half of the frames at rest; the floor is five standard errors."""
    noise = np.tile([0.0, 4.0], 10)
    counts = np.column_stack([noise, 1 + noise, noise + 100 * ON])
    found = subtract_zero(TIMES, counts, ALL, ~ON)
    assert found.counts[:, 0] == pytest.approx(noise)
    assert found.counts[:, 1] == pytest.approx(noise - 2.0)
    assert found.rest == pytest.approx([2.0, 0.0, 2.0])
    assert found.counts[ON][:, 2] == pytest.approx(noise[ON] + 100)
    group = np.array([0.0, 4.0, 0.0, 4.0, 0.0, 4.0])
    residual = group - np.polyval(np.polyfit(np.arange(6), group, 1), np.arange(6))
    sd = np.sqrt((residual**2).sum() / 4)
    assert found.noise == pytest.approx([sd] * 3)
    floor = found.find_floor(ON)
    assert floor == pytest.approx(np.array([2.0, 0.0, 2.0]) + 5 * sd * np.sqrt(1 / 8 + 1 / 12))


def test_noise_of_groups_is_pooled_by_their_frames_and_short_ones_leave_it_to_the_image():
    at_rest = np.zeros(20, dtype=bool)
    at_rest[:4], at_rest[12:20] = True, True
    wave = np.array([1.0, -1.0, -1.0, 1.0])  # no trend; standard deviation about it sqrt(4 / 2)
    counts = np.full((20, 1), 50.0)
    counts[4:12] += 200
    counts[:4, 0] += wave
    counts[12:20, 0] += 3 * np.tile(wave, 2)
    found = subtract_zero(TIMES, counts, ALL[:1], at_rest)
    assert found.noise == pytest.approx([np.sqrt((2 * 4 + 72 / 6 * 8) / 12)], rel=0.02)
    at_rest[3] = False  # three frames tell no deviation about a trend; the long group alone does
    assert subtract_zero(TIMES, counts, ALL[:1], at_rest).noise == pytest.approx([np.sqrt(72 / 6)], rel=0.02)
    few = subtract_zero(TIMES, counts, ALL[:1], TIMES < 3)
    assert np.isnan(few.noise).all()
    image = np.zeros(20, dtype=bool)
    image[12:20] = True
    assert few.find_floor(image) == pytest.approx(5 * np.sqrt(72 / 6) * np.sqrt(1 / 8 + 1 / 3), rel=0.02)


@pytest.mark.parametrize(
    ("slope", "time", "total", "words"),
    [
        (1.0, 12.5, 500.0, "1 +- 0.1 1/s in all, +2 % of the image"),
        (-1.0, 12.5, 100.0, "-10 % of the image"),
        (1.0, 12.5, 1000.0, ""),  # just 1 %
        (0.3, 12.5, 100.0, ""),  # three standard errors
        (0.31, 12.5, 100.0, "0.31 +- 0.1"),
    ],
)
def test_a_drift_is_stated_beyond_three_errors_and_one_percent(slope, time, total, words):
    found = replace(subtract_zero(TIMES, ZERO + np.outer(ON, RISE), ALL, ~ON), drift=(slope, 0.1), rest_time=2.5)
    said = found.describe_drift(time, total)
    assert words in said
    assert bool(said) == bool(words)


def test_a_drift_has_the_slope_and_error_of_the_line_through_the_sums_at_rest():
    wave = np.array([1.0, -1.0, 0.0, -1.0, 1.0, 0.0])
    counts = 500 + np.zeros((12, 2))
    counts[:6] += (0.5 * np.arange(6) + wave)[:, None]
    counts[6:] += 300
    found = subtract_zero(TIMES[:12] / 4, counts, ALL[:2], TIMES[:12] < 6)
    (slope, _), covariance = np.polyfit(TIMES[:6] / 4, counts[:6].sum(axis=1), 1, cov=True)
    assert found.drift == pytest.approx((slope, covariance[0, 0] ** 0.5))


@pytest.mark.parametrize(
    ("untouched", "peak", "refused"),
    [(0.0, 500.0, False), (1.0, 500.0, False), (3.0, 500.0, True), (3.0, 1300.0, False), (500.0, 500.0, True)],
)
def test_counts_without_rest_are_zeroed_if_untouched_texels_read_noise_or_a_percent_of_all(untouched, peak, refused):
    """Four texels, of which one is pressed; 4 x 3 counts are one percent of 1200."""
    counts = np.tile([untouched, untouched, untouched, peak], (10, 1))
    never = np.zeros(10, dtype=bool)
    if refused:
        with pytest.raises(RecordingError, match="counts on texels that nothing presses, and no frames at rest"):
            subtract_zero(TIMES[:10], counts, np.ones(4, dtype=bool), never)
    else:
        found = subtract_zero(TIMES[:10], counts, np.ones(4, dtype=bool), never)
        assert found.counts == pytest.approx(counts)
        assert (found.at_rest, found.rest_time) == (0, 0.0)
        assert found.drift == (0.0, np.inf)


def test_a_floor_without_enough_frames_is_that_of_the_steps_of_each_texel():
    """Three frames at rest and three of an image; steps of 2 and 10 counts from frame to frame under load."""
    wave = np.resize([1.0, -1.0], 20)
    counts = 50 + np.outer(ON, [200, 300]) + np.outer(wave, [1.0, 5.0])
    found = subtract_zero(TIMES, counts, ALL[:2], TIMES < 3)
    floor = found.find_floor((TIMES > 7) & (TIMES < 11))
    assert floor == pytest.approx(5 * 1.4826 * np.array([2, 10]) / 2**0.5 * np.sqrt(1 / 3 + 1 / 3))
    one = subtract_zero(TIMES[7:8], counts[7:8], ALL[:2], np.zeros(1, dtype=bool), rest=np.empty((0, 2)))
    assert one.find_floor(np.ones(1, dtype=bool)).tolist() == [0.0, 0.0]


def step(rest, rise=0, load=30, *, rate=4.0, noise=1.0, size=100.0, drift=0.0):
    """Times and counts of four texels: rest, a linear rise and a load; two texels are pressed."""
    shape = np.concatenate([np.zeros(rest), np.arange(1, rise + 1) / (rise + 1), np.ones(load)])
    times = np.arange(len(shape)) / rate
    wave = noise * np.resize([1, -1, 1, 1, -1, -1, 1, -1], len(shape))
    return times, 200 + np.outer(shape, [size, size, 0, 0]) + (wave + drift * times)[:, None]


@pytest.mark.parametrize(
    ("options", "frames"),
    [
        ({"rest": 8}, 8),
        ({"rest": 8, "noise": 0.0, "size": 4.0}, 0),  # 5.7 counts along the pressed texels, below six times one count
        ({"rest": 8, "noise": 0.0, "size": 5.0}, 8),
        ({"rest": 3}, 0),  # less than four frames
        ({"rest": 4}, 4),
        ({"rest": 8, "load": 0}, 0),
        ({"rest": 8, "rise": 6}, 8),  # half of the load is reached after 1 s
        ({"rest": 8, "rise": 9}, 0),
        ({"rest": 4, "load": 3}, 0),  # seven frames in all
        ({"rest": 20, "drift": 2.0}, 20),
    ],
)
def test_rest_is_followed_by_a_step_within_a_second(options, frames):
    times, counts = step(**options)
    assert find_rest(times, counts) == frames


def test_rest_is_at_the_start_or_the_end_and_ends_half_a_second_or_more_after_the_load():
    times, counts = step(8)
    assert np.flatnonzero(find_unloaded(times, counts)).tolist() == list(range(8))
    back = find_unloaded(times, counts[::-1])
    assert np.flatnonzero(back).tolist() == list(range(30))  # of two levels the first is rest
    # rest again after the load: a second after its last frame, or the second half of what is left
    there = np.vstack([counts, np.tile(counts[:4], (3, 1))])
    found = find_unloaded(np.arange(50) / 4.0, there)
    assert np.flatnonzero(found).tolist() == [*range(8), *range(42, 50)]
    short = find_unloaded(np.arange(42) / 4.0, np.vstack([counts, counts[:4]]))
    assert np.flatnonzero(short).tolist() == [*range(8), 40, 41]
    # counts that begin under load and end at zero are at rest at the end
    zeroed = find_unloaded(times, counts[::-1] - 200)
    assert np.flatnonzero(zeroed).tolist() == list(range(30, 38))


@pytest.mark.parametrize(
    ("forces", "at_rest"),
    [
        (repeat((0, 6), (10, 10), (0, 5)), [*range(6), *range(16, 21)]),
        (repeat((0, 6), (10, 10), (0, 3)), [*range(6)]),  # fewer than four frames
        (repeat((0.4, 6), (10, 10)), [*range(6)]),  # an offset of 4 %
        (repeat((0.6, 6), (10, 10)), []),  # 6 % of the largest force may be a load
        (repeat((-0.4, 6), (10, 10)), [*range(6)]),
        (repeat((0, 6), (0.04, 4), (10, 10)), [*range(10)]),
        (repeat((0, 6), (0.06, 4), (10, 10)), [*range(6)]),
        # the reach is a share of the range, so that an offset of the channel does not change it
        (repeat((0.4, 6), (0.449, 4), (10.4, 10)), [*range(10)]),
        (repeat((0.4, 6), (0.451, 4), (10.4, 10)), [*range(6)]),
        (repeat((-0.4, 6), (-0.351, 4), (9.6, 10)), [*range(10)]),
        (repeat((-0.4, 6), (-0.349, 4), (9.6, 10)), [*range(6)]),
        (repeat((0, 3)), []),
        (repeat((3, 9)), []),
    ],
)
def test_rest_by_force_is_a_level_of_four_frames_near_zero(forces, at_rest):
    assert np.flatnonzero(find_unloaded_by_force(forces)).tolist() == at_rest


# A recording of six texels: counts of 10 at rest, 510 and 310 on two texels under 5 N from 2 s on.

FRAMES = np.arange(0, 15, 0.25)
PRESSED = np.array([0.0, 500.0, 300.0, 0.0, 0.0, 0.0])


def record(folder, *, counts=None, forces=None, load=5.0, device=None, full_scale=1000, warm=((20.0, 30.0),) * 2):
    counts = 10 + np.outer(FRAMES >= 2, PRESSED) if counts is None else counts
    made = Recording(
        path=Path("made"), sha256="", started=datetime(2026, 1, 1, tzinfo=UTC), times=FRAMES,
        arrays=(make_array(2, 3, np.rint(counts).astype(np.int32), pitch=PITCH, full_scale=full_scale),),
        temperatures=np.array(warm, dtype=float), temperature_times=np.array([0.0, 10.0])[: len(warm)],
        setup=Setup(load=load, device=device or {}), forces=np.empty(0) if forces is None else forces,
        force_times=np.empty(0) if forces is None else FRAMES,
    )  # fmt: skip
    path = folder / "made.mcap"
    path.unlink(missing_ok=True)
    save(made, path)
    return path


def read(path, **options):
    return read_image(DataFile(path=path, name="made", series="s", placement=HERE, **options), ARRAY)


def test_an_image_has_the_mean_time_temperature_and_range_of_its_frames(tmp_path):
    path = record(tmp_path, warm=[(20.0, 30.0), (40.0, 50.0)], device={"threshold": 7})
    (image,) = read(path, window=(4.0, 6.0))
    assert image.counts == pytest.approx(PRESSED)
    assert image.age == pytest.approx(4.875)  # frames at 4, 4.25 ... 5.75 s
    assert image.temperature == pytest.approx(30 + 2 * 6.875)
    assert (image.load, image.threshold, image.full_scale) == (5.0, 7.0, 990)
    assert (image.total, image.case, image.sign) == (800.0, "here 5 N", 1)
    (other,) = read(path, window=(4.0, 6.0), temperature_channel=0, threshold=3.0, load=2.0)
    assert (other.temperature, other.threshold, other.case) == (pytest.approx(20 + 2 * 6.875), 3.0, "here 2 N")
    assert read(path, window=(4.0, 6.0), temperature=21.5)[0].temperature == 21.5
    assert np.isnan(read(record(tmp_path, warm=[]), window=(4.0, 6.0))[0].temperature)
    falling = record(tmp_path, counts=800 - np.outer(FRAMES >= 2, PRESSED))
    assert (read(falling)[0].full_scale, read(falling)[0].sign) == (800, -1)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({}, {"temperature_channel": 2}, "has 2 temperature channels; temperature_channel = 2 is none of them"),
        ({}, {"temperature_channel": -3}, "temperature_channel = -3 is none of them"),
        ({}, {"array": 1}, "has 1 arrays; array = 1 is none of them"),
        ({"counts": np.zeros((60, 6))}, {}, "no array was pressed; expected a load on pad"),
        ({"load": None}, {}, "its load is not known; write `# load = 4.9`"),
        ({}, {"load": "force", "zero": "none"}, "has no force channel"),
        ({"forces": np.where(FRAMES >= 2, 3.9, 0.0)}, {}, "said to be 5 N, and its force channel reads 3.9 N"),
        ({"forces": np.where(FRAMES >= 2, 6.1, 0.0)}, {}, "force channel reads 6.1 N"),
        ({"full_scale": 510, "counts": 10 + np.outer(FRAMES >= 2, [0] + [500] * 5)}, {}, "5 pressed texels are at"),
    ],
)  # fmt: skip
def test_a_recording_that_contradicts_itself_is_refused(tmp_path, change, options, words):
    path = record(tmp_path, **change)
    with pytest.raises(RecordingError, match=words):
        read(path, **options)


def test_a_window_after_the_load_takes_its_last_second(tmp_path):
    """The load is on for 12.75 s."""
    (image,) = read(record(tmp_path), window=(20.0, 30.0))
    assert image.age == pytest.approx(12.25, abs=0.13)  # half a frame


@pytest.mark.parametrize("force", [4.1, 5.9])
def test_a_force_within_a_fifth_of_the_label_agrees(tmp_path, force):
    path = record(tmp_path, forces=np.where(FRAMES >= 2, force, 0.0))
    assert read(path)[0].load == 5.0
    images = read(path, load="force")
    # 60 frames in 24 parts; those wholly at rest, the first 8 frames, make no image
    assert len(images) == 24 - 2
    assert [image.load for image in images[1:]] == pytest.approx([force] * 21)
    assert all(np.isnan(image.age) for image in images)


def test_a_force_channel_that_is_never_at_rest_keeps_its_values(tmp_path):
    path = record(tmp_path, forces=np.full(60, 4.0) + 0.5 * np.sin(FRAMES), load=None)
    images = read(path, load="force", zero="none")
    assert len(images) == 24
    assert np.mean([image.load for image in images]) == pytest.approx(4.0, abs=0.1)
    assert images[3].counts == pytest.approx(10 + PRESSED * np.mean(FRAMES[9:12] >= 2))


def test_the_noise_of_an_image_is_that_of_texels_that_are_never_zero(tmp_path):
    """Noise of 4 and 8 counts about a zero that a firmware clips, and a texel that reads zero now and then."""
    wave = np.resize([1.0, -1.0, -1.0, 1.0], 60)
    counts = np.outer(FRAMES >= 2, PRESSED) + np.outer(wave * (FRAMES >= 2), [0, 4, 8, 0, 0, 0])
    counts[:, 5] = 1000 * (np.arange(60) % 3 == 0) * (FRAMES >= 2)
    (image,) = read(record(tmp_path, counts=counts), window=(4.0, 6.0))
    assert image.noise == pytest.approx(((4**2 + 8**2) / 2 * 8 / 6) ** 0.5, rel=1e-6)


def test_observations_hold_what_their_images_hold(tmp_path):
    first = read(record(tmp_path), window=(4.0, 6.0))[0]
    second = replace(first, load=7.0, temperature=33.0, creep=0.1, threshold=4.0, floor=first.floor + 1, age=9.0,
                     file=replace(first.file, name="other"), measured=np.arange(6) > 1)  # fmt: skip
    seen = observe([first, second])
    assert seen.loads.tolist() == [5.0, 7.0]
    assert seen.temperatures.tolist() == [30.0, 33.0]
    assert seen.ages.tolist() == [first.age, 9.0]
    assert seen.thresholds.tolist() == [0.0, 4.0]
    assert seen.creep[1] == 0.1
    assert seen.floors.tolist() == [first.floor.tolist(), (first.floor + 1).tolist()]
    assert seen.counts.tolist() == [first.counts.tolist()] * 2
    assert seen.measured.tolist() == [[True] * 6, [False] * 2 + [True] * 4]
    assert (seen.groups, seen.placements) == (("made", "other"), (HERE, HERE))


@pytest.mark.parametrize(
    ("signs", "kept", "words"),
    [
        ((1, 1), [0, 1], ()),
        ((-1, -1), [0, 1], ("fall under load in every recording",)),
        ((-1, 1, -1), [0, 2], ("1.mcap: the counts rise under load, and fall in most",)),
        ((-1, 1, 1), [1, 2], ("0.mcap: the counts fall under load, and rise in most",)),
        ((-1, 1), [1], ("0.mcap: the counts fall under load, and rise in most",)),
    ],
)
def test_counts_change_as_in_most_recordings(tmp_path, signs, kept, words):
    files = []
    for number, sign in enumerate(signs):
        counts = 600 + sign * np.outer(FRAMES >= 2, PRESSED + number)
        path = record(tmp_path, counts=counts, full_scale=2000).rename(tmp_path / f"{number}.mcap")
        files.append(DataFile(path=path, name=str(number), series="s", placement=HERE))
    images, problems = read_images(DataSet(name="", folder=tmp_path, files=tuple(files), problems=()), ARRAY)
    assert [int(image.file.name) for image in images] == kept
    assert [word in line for word, line in zip(words, problems, strict=True)] == [True] * len(words)


def test_a_layout_is_described_by_columns_rows_texels_and_pitch():
    array = TexelArray.grid(2, 3, PITCH, active=np.arange(6) > 0)
    assert describe_layout(array) == "3 columns x 2 rows, 5 active, pitch 4 x 3 mm"


# Null models.

LOADS = np.array([1.0, 2.0, 4.0])


def test_shapes_of_null_models_are_those_of_their_names():
    warm, pattern = np.zeros(3), np.array([1.0, 3.0])
    line = np.outer(2 + 5 * LOADS, pattern)
    new = np.array([3.0, 8.0])
    expected = np.outer(2 + 5 * new, pattern)
    assert fit_polynomials(LOADS, warm, line, degree=1)(new, warm[:2]) == pytest.approx(expected)
    assert fit_pattern(LOADS, warm, line)(new, warm[:2]) == pytest.approx(expected)
    bent = np.outer(2 + 5 * LOADS + LOADS**2, pattern)
    expected = np.outer(2 + 5 * new + new**2, pattern)
    assert fit_pattern(LOADS, warm, bent)(new, warm[:2]) == pytest.approx(expected)
    assert fit_polynomials(LOADS, warm, bent, degree=2)(new, warm[:2]) == pytest.approx(expected)
    assert fit_pattern(LOADS[:1], warm[:1], line[:1])(new, warm[:2]) == pytest.approx(line[[0, 0]])
    twice = np.array([1.0, 4.0, 4.0])
    assert fit_ratio(twice, warm, line)(new, warm[:2]) == pytest.approx(np.outer(new / 4, line[1:].mean(axis=0)))
    assert not fit_zeros(LOADS, warm, line)(new, warm[:2]).any()


def see(counts, loads=LOADS, *, warm=NAN, ages=NAN, thresholds=0.0, creep=NAN):
    m = len(loads)
    counts = np.array(counts, dtype=float)
    return Observations(
        loads=np.array(loads, dtype=float), counts=counts, measured=np.ones(counts.shape, dtype=bool),
        placements=(HERE,) * m, groups=tuple(map(str, range(m))), temperatures=np.broadcast_to(warm, m).astype(float),
        ages=np.broadcast_to(ages, m).astype(float), thresholds=np.full(m, thresholds), creep=np.full(m, creep),
    )  # fmt: skip


def test_a_new_session_scales_the_line_as_its_model_states():
    """The line is 100 and 50 counts/N; the placing image under 2 N reads 260 and 80 counts, in all 340 for 300."""
    fitted = see(np.outer(LOADS, [100.0, 50.0]))
    placed, new = see([[260.0, 80.0]], [2.0]), see([[0.0, 0.0]], [3.0])
    level = (260 * 200 + 80 * 100) / (200**2 + 100**2)
    for name, expected in (
        ("line per texel", (300 * level, 150 * level)),
        ("line per texel, each scaled to the placing image", (390.0, 120.0)),
        ("mean pattern x load curve", (390.0, 120.0)),
        ("heaviest image x load ratio", (390.0, 120.0)),
        ("zeros", (0.0, 0.0)),
    ):
        assert NULLS[name].fit(fitted, placed, 350.0)(new)[0] == pytest.approx(np.minimum(expected, 350.0)), name
    assert NULLS["line per texel"].fit(fitted, None, np.inf)(new)[0] == pytest.approx((300, 150))
    # a texel that reads zero where its signal is clipped has no factor of its own, and takes the common level
    dark = see([[260.0, 0.0]], [2.0])
    found = NULLS["line per texel, each scaled to the placing image"].fit(fitted, dark, np.inf)(new)[0]
    assert found == pytest.approx((390.0, 150 * 1.3))


def test_creep_and_the_threshold_enter_a_null_model_by_their_formulas():
    """Mean age 8 s; the prediction at 2 s, with a threshold of 30, and at an unknown age."""
    signal = np.outer(LOADS, [100.0, 50.0])
    fitted = see(signal - 30, ages=8.0, thresholds=30.0, creep=0.1)
    grown = 1 + 0.1 * np.log(4)
    for age, factor in ((2.0, 1 / grown), (8.0, 1.0), (NAN, 1.0), (32.0, (1 + 0.1 * np.log(16)) / grown)):
        new = see([[0.0, 0.0]], [3.0], ages=age, thresholds=30.0)
        found = NULLS["line per texel"].fit(fitted, None, np.inf)(new)[0]
        assert found == pytest.approx(factor * np.array([300, 150]) - 30)
        ratio = NULLS["heaviest image x load ratio"].fit(fitted, None, np.inf)(new)[0]  # knows no threshold
        assert ratio == pytest.approx(factor * 0.75 * np.array([370, 170]))


@pytest.mark.parametrize(
    ("warm", "applies"),
    [((20.0, 30.0, 30.0), True), ((20.0, 20.0, 20.0), False), ((20.0, 30.0, NAN), False), ((NAN,) * 3, False)],
)
def test_a_temperature_per_texel_needs_two_known_ones_and_a_factor_per_texel_a_placing_image(warm, applies):
    seen = see(np.outer(LOADS, [100.0, 50.0]), warm=warm)
    for name, model in NULLS.items():
        assert model.applies(seen, seen) == (applies or "temperature" not in name), name
        assert model.applies(seen, None) == ((applies or "temperature" not in name) and "each scaled" not in name), name


@pytest.mark.parametrize("band", [300.0, 900.0])
def test_the_band_of_a_soft_saturation_is_found_between_zero_and_the_largest_count(band):
    """Counts of a line through a known band are predicted under other loads, whatever the band."""

    def bend(signal):
        knee = 1000.0 - band
        return np.where(signal > knee, 1000 - band * np.exp(-(np.maximum(signal, knee) - knee) / band), signal)

    loads = np.linspace(0.5, 9.0, 12)
    slopes = np.array([60.0, 110.0, 190.0])
    fitted = see(bend(np.outer(loads, slopes)), loads)
    new = np.array([0.7, 2.2, 5.1, 8.3])
    found = NULLS["line per texel, saturating"].fit(fitted, None, 1000.0)(see(np.zeros((4, 3)), new))
    assert found == pytest.approx(bend(np.outer(new, slopes)), abs=4)
