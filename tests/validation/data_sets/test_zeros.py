"""Zeros that differ, drift or fall leave images and calibration as they are without; what is unclear is refused."""

import dataclasses

import numpy as np
import pytest

from tests.support.laboratory import (
    ARRAY,
    STAMP_TEXT,
    draw_gains,
    make_curve,
    press,
    uniform_method,
    write,
    write_data_set,
)
from validation.calibration.calibrate import calibrate
from validation.calibration.model import Pose
from validation.data_sets.data_set import describe_files
from validation.data_sets.images import observe, read_image, read_images
from validation.data_sets.zeros import find_rest, find_unloaded_by_force
from validation.recordings.recording import RecordingError
from validation.schema.data_set import CommonKeys

METHOD = uniform_method()
GAINS = draw_gains(np.random.default_rng(1))
CURVE = dataclasses.replace(make_curve(GAINS), output_max=np.inf)
POSE = Pose(2e-3, -1e-3)
KEYS = CommonKeys(window=[2, 4])
N = ARRAY.count
#: Zero of each texel of a raw magnetic skin [counts], and its drift [counts/s].
OFFSETS = np.random.default_rng(2).uniform(24000, 26000, N)
DRIFTS = np.random.default_rng(3).uniform(-8, 8, N) + 4


def record(change=lambda counts, _times: counts, load=10.0, *, lift=False, noise=3.0, pose=POSE, seed=0, **options):
    """A weight that is put on after a second, and may be lifted for the last three, with changed counts."""
    made = press(METHOD, CURVE, load, pose, noise=0.0, **options)
    random = np.random.default_rng(seed)
    counts = made.arrays[0].counts * ~(lift & (made.times > made.times[-1] - 3.0))[:, None]
    counts = change(counts + noise * random.standard_normal(counts.shape), made.times)
    array = dataclasses.replace(made.arrays[0], counts=np.rint(counts).astype(np.int32), full_scale=2**20)
    return dataclasses.replace(made, arrays=(array,))


def read(recording, folder, keys=KEYS, name="one.csv", **changes):
    file = describe_files([write(recording, folder / name)], keys, ARRAY).files[0]
    return read_image(dataclasses.replace(file, **changes), ARRAY)[0]


def offset(counts, _times):
    return OFFSETS + counts


def fall(counts, _times):
    return OFFSETS - counts


def drift(counts, times):
    return OFFSETS + counts + DRIFTS * times[:, None]


def small(counts, _times):
    return 820 + counts


def clip(counts, _times):
    return np.maximum(counts, 0)


CHANGES = {
    "offset": (offset, False),
    "lifted": (offset, True),
    "falls": (fall, False),
    "falls, lifted": (fall, True),
    "drifts": (drift, True),
    "small": (small, False),
    "small, lifted": (small, True),
    "clipped": (clip, True),
}


@pytest.mark.parametrize(("change", "lift"), CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("load", [2.0, 20.0])
def test_the_image_is_that_of_counts_without_an_offset(change, lift, load, tmp_path):
    plain = press(METHOD, CURVE, load, POSE, noise=0.0).arrays[0].counts[-1]
    found = read(record(change, load=load, lift=lift), tmp_path)
    assert np.abs(found.counts - plain).max() < 5  # five standard errors of the zero from ten frames
    assert found.sign == (-1 if change is fall else 1)
    lit = found.counts > found.floor
    assert lit[plain > 10].all()
    assert (change is clip) or not lit[plain == 0].any()
    assert found.age == pytest.approx(3.0, abs=0.1)


def calibrated(folder, change, *, lift, window="[2, 6]", noise=3.0):
    """Calibrate on five loads in two places."""
    for number, load in enumerate((4.0, 6.0, 8.0, 12.0, 16.0)):
        for name, pose in (("left", Pose(-6e-3, 1e-3)), ("right", Pose(6e-3, 0.5e-3))):
            made = record(change, load, lift=lift, noise=noise, pose=pose, seed=number)
            write(made, folder / name / f"{number}.csv")
    series = "[[series]]\nname = '{0}'\nfiles = '{0}/*.csv'\nyaw = '0 deg'\n"
    text = f"indenter = '{STAMP_TEXT}'\nwindow = {window}\n{series.format('left')}{series.format('right')}"
    images, problems = read_images(write_data_set(folder, text), ARRAY)
    assert len(images) == 10
    return calibrate(observe(images), METHOD), problems


@pytest.mark.slow
@pytest.mark.parametrize("name", ["offset", "falls, lifted", "drifts", "small, lifted"])
def test_the_calibration_is_that_of_counts_without_an_offset(name, tmp_path):
    change, lift = CHANGES[name]
    plain, none = calibrated(tmp_path / "plain", clip, lift=False)
    found, problems = calibrated(tmp_path / "changed", change, lift=lift)
    assert none == []
    assert problems == (["the counts fall under load in every recording; they are turned"] if "falls" in name else [])
    assert found.estimates["sensitivity"].value == pytest.approx(plain.estimates["sensitivity"].value, rel=0.01)
    both = np.intersect1d(plain.texels, found.texels)
    assert len(both) > 20
    assert found.gains[both] == pytest.approx(plain.gains[both], rel=0.02)
    for place, x in (("left", -6e-3), ("right", 6e-3)):
        assert found.poses[place]["x_m"][0] == pytest.approx(x, abs=0.1e-3)
        assert found.poses[place]["x_m"][0] == pytest.approx(plain.poses[place]["x_m"][0], abs=0.1e-3)


def test_one_of_three_axes_is_imported_and_calibrated(tmp_path, softcover):
    """Shear columns of the size of the signal stand beside the normal ones, and counts fall under load."""
    random = np.random.default_rng(6)
    for load in (4.0, 8.0, 16.0):
        made = record(fall, load=load, seed=int(load))
        lines = [f"# load = {load}", "# rows = 8", "# columns = 10", "# pitch = 0.005", "# full_scale = 65535"]
        lines.append(";".join(["time", *(f"{axis}{n}" for n in range(N) for axis in "xyz")]))
        shear = random.normal(9000, 900, (N, 2)).astype(int)
        for time, counts in zip(made.times, made.arrays[0].counts, strict=True):
            cells = np.column_stack([shear + 1000 * (time > 1.0), counts]).ravel()
            lines.append(";".join([f"{time:.3f}".replace(".", ","), *map(str, cells)]))
        path = tmp_path / f"{load:g}.csv"
        path.write_text("\n".join(lines))
        assert (
            softcover("import", path, "--axis", "z", "--out", tmp_path / "z" / path.with_suffix(".mcap").name)[0] == 0
        )
    text = f"indenter = '{STAMP_TEXT}'\nwindow = [2, 4]\n[[series]]\nname = 'skin'\nfiles = 'z/*.mcap'\n"
    images, _ = read_images(write_data_set(tmp_path, text), ARRAY)
    found = calibrate(observe(images), METHOD)
    mean = GAINS[found.texels].mean()
    assert found.estimates["sensitivity"].value == pytest.approx(CURVE.sensitivity * mean, rel=0.01)
    assert found.gains[found.texels] == pytest.approx(GAINS[found.texels] / mean, rel=0.03)


def test_texels_that_nothing_presses_have_no_gain(tmp_path):
    """Noise of 30 counts about a zero of 820 is no image."""
    found, _ = calibrated(tmp_path, small, lift=True, noise=30.0)
    touched = [
        press(METHOD, CURVE, 16.0, Pose(*at), noise=0.0).arrays[0].counts[-1] > 30
        for at in ((-6e-3, 1e-3), (6e-3, 0.5e-3))
    ]
    assert not set(found.texels) - set(np.flatnonzero(touched[0] | touched[1]))


def test_a_drift_on_one_side_only_is_stated(tmp_path):
    said = read(record(drift, seconds=8.0), tmp_path).note
    assert "drift by" in said
    assert "before and after the load" in said
    assert read(record(offset, seconds=8.0), tmp_path).note == ""


def test_rubber_that_recovers_is_no_drift(tmp_path):
    """Pressed texels keep a fifth of their counts when the load is lifted; the zero of all drifts."""

    def recover(counts, times):
        after = times > times[-1] - 3.0
        residue = 0.2 * counts[60] * after[:, None]
        return OFFSETS + counts + residue + 4 * times[:, None]

    plain = press(METHOD, CURVE, 10.0, POSE, noise=0.0).arrays[0].counts[-1]
    found = read(record(recover, lift=True), tmp_path)
    assert found.counts.sum() == pytest.approx(plain.sum(), rel=0.01)


@pytest.mark.parametrize("load", [2.0, 20.0])
def test_a_zero_that_is_not_known_is_refused(load, tmp_path):
    made = record(offset, load=load)
    late = made.times > 2.0
    array = dataclasses.replace(made.arrays[0], counts=made.arrays[0].counts[late])
    begun = dataclasses.replace(made, times=made.times[late] - 2.0, arrays=(array,))
    with pytest.raises(RecordingError, match=r"one.csv: 2\d{4} counts on texels that nothing presses.*zero = 'none'"):
        read(begun, tmp_path)
    rest = dataclasses.replace(made, arrays=(dataclasses.replace(array, counts=made.arrays[0].counts[:8]),))
    path = write(dataclasses.replace(rest, times=made.times[:8]), tmp_path / "rest.csv")
    found = read(begun, tmp_path, CommonKeys(window=[1, 3]), zero=path)
    assert found.counts.sum() == pytest.approx(read(made, tmp_path).counts.sum(), rel=0.01)
    assert read(begun, tmp_path, CommonKeys(window=[1, 3], zero="none")).counts.min() > 23000


def test_a_load_that_was_on_before_is_refused_where_the_others_read_zero(tmp_path):
    """A stamp that stands on the array already, below the weight that the label names."""

    def preload(counts, times):
        return np.maximum(counts, 0.1 * np.maximum(counts[-1], 0))

    made = record(preload, noise=0.0)
    with pytest.raises(RecordingError, match=r"texels have \d+ counts at rest, where others read 0.*zero = 'none'"):
        read(made, tmp_path)
    found = read(made, tmp_path, CommonKeys(window=[2, 4], zero="none"))
    assert found.counts.sum() == pytest.approx(made.arrays[0].counts[-1].sum(), rel=1e-3)


def test_a_recording_that_nobody_pressed_is_refused(tmp_path):
    made = record(load=10.0)
    random = np.random.default_rng(6)
    for level in (0, 820):
        counts = np.rint(level + 3 * random.standard_normal(made.arrays[0].counts.shape)).astype(np.int32)
        array = dataclasses.replace(made.arrays[0], counts=counts)
        with pytest.raises(RecordingError, match="press"):
            read(dataclasses.replace(made, arrays=(array,)), tmp_path)


def test_counts_that_rise_and_fall_in_one_data_set_are_told(tmp_path):
    for number, change in enumerate((offset, offset, fall)):
        write(record(change, load=5.0 + number), tmp_path / f"{number}.csv")
    text = f"indenter = '{STAMP_TEXT}'\nwindow = [2, 4]\n[[series]]\nname = 'a'\nfiles = '*.csv'\n"
    images, problems = read_images(write_data_set(tmp_path, text), ARRAY)
    assert [image.load for image in images] == [5.0, 6.0]
    (line,) = problems
    assert "2.csv: the counts fall under load, and rise in most recordings" in line


def stuck(counts, _times):
    """One texel that always reads five counts."""
    return np.where(np.arange(counts.shape[1]) == 7, np.maximum(counts, 5), np.maximum(counts, 0))


def flicker(counts, _times):
    """Texels that read zero or one count at rest."""
    return np.maximum(counts, np.random.default_rng(5).integers(0, 2, counts.shape))


@pytest.mark.parametrize("change", [clip, stuck, flicker])
@pytest.mark.parametrize("load", [2.0, 20.0])
def test_zeros_that_are_zero_change_nothing(change, load, tmp_path):
    plain = read(record(clip, load=load, noise=0.0), tmp_path)
    found = read(record(change, load=load, noise=0.0), tmp_path)
    assert found.counts.sum() == pytest.approx(plain.counts.sum(), rel=0.03)


def test_a_recording_that_begins_under_load_has_no_rest(tmp_path):
    made = record(clip, seconds=20.0, rate=20.0, noise=0.0)
    late = made.times > 1.5
    creeping = 1 + 0.03 * np.log(np.maximum(made.times[late] - 1.4, 0.05))
    counts = np.rint(made.arrays[0].counts[late] * creeping[:, None]).astype(np.int32)
    assert find_rest(made.times[late], counts) == 0
    array = dataclasses.replace(made.arrays[0], counts=counts)
    begun = dataclasses.replace(made, times=made.times[late] - made.times[late][0], arrays=(array,))
    assert read(begun, tmp_path).counts.sum() > 0


def test_rest_ends_where_the_load_begins():
    made = press(METHOD, CURVE, 5.0, POSE)
    rest = find_rest(made.times, made.arrays[0].counts)
    assert made.times[rest - 1] <= 1.0 < made.times[rest]


@pytest.mark.parametrize("slope", [-8.0, 0.0, 8.0])
def test_rest_may_drift(slope):
    """Four seconds of rest, in which every texel drifts by ten times its noise."""
    made = press(METHOD, CURVE, 10.0, POSE, noise=0.0)
    times = np.arange(0, 14, 0.125)
    loaded = np.interp(times - 3.0, made.times, np.arange(len(made.times))).round().astype(int)
    counts = OFFSETS + made.arrays[0].counts[loaded] + slope * times[:, None]
    rest = find_rest(times, counts + 3 * np.random.default_rng(1).standard_normal(counts.shape))
    assert times[rest - 1] == pytest.approx(4.0, abs=0.3)


def switch_off(recording, texels):
    array = dataclasses.replace(recording.arrays[0], enabled=~np.isin(np.arange(N), texels))
    return dataclasses.replace(recording, arrays=(array,))


MASKED = {
    "stuck low": ([0], lambda times: -30000 * (times[:, None] >= 0)),
    "flickers": ([0], lambda times: 4000 * (np.arange(len(times)) % 2)[:, None]),
    "stuck high": ([0, 5], lambda times: 40000 * (times[:, None] >= 0)),
}


@pytest.mark.parametrize(("texels", "values"), MASKED.values(), ids=MASKED)
@pytest.mark.parametrize(("change", "zero"), [(offset, "rest"), (clip, "rest"), (clip, "none")])
def test_texels_that_are_switched_off_change_nothing(texels, values, change, zero, tmp_path):
    def disturb(counts, times):
        counts = change(counts, times)
        counts[:, texels] = values(times)
        return counts

    keys = CommonKeys(window=[2, 4], zero=zero)
    plain = read(switch_off(record(change), texels), tmp_path, keys, "plain.mcap")
    found = read(switch_off(record(disturb), texels), tmp_path, keys, "found.mcap")
    assert not found.measured[texels].any()
    assert found.total == plain.total
    assert (found.age, found.creep, found.full_scale) == (plain.age, plain.creep, plain.full_scale)


def test_columns_of_missing_texels_do_not_make_counts_zeroed(tmp_path):
    """Zeros of a third of the texels, which are switched off, hide neither an offset nor its refusal."""
    missing = np.arange(0, N, 3)

    def lose(counts, times):
        counts = offset(counts, times)
        counts[:, missing] = 0
        return counts

    made = switch_off(record(lose, lift=True), missing)
    plain = switch_off(record(offset, lift=True), missing)
    assert read(made, tmp_path, name="made.mcap").total == read(plain, tmp_path, name="plain.mcap").total
    late = made.times > 2.0
    array = dataclasses.replace(made.arrays[0], counts=made.arrays[0].counts[late & (made.times < 8.0)])
    begun = dataclasses.replace(made, times=made.times[late & (made.times < 8.0)] - 2.0, arrays=(array,))
    with pytest.raises(RecordingError, match="counts on texels that nothing presses"):
        read(begun, tmp_path, name="begun.mcap")


@pytest.mark.parametrize(("until", "shift"), [(0.7, 0.0), (1.0, 0.07)])
def test_frames_at_rest_may_share_one_time_stamp(until, shift, tmp_path):
    """A clock that starts with the load, or shortly before it."""
    made = record(offset, rate=16.0)
    late = dataclasses.replace(made, times=np.where(made.times <= until, 0.0, made.times - shift))
    assert read(late, tmp_path).total == pytest.approx(read(made, tmp_path).total, rel=0.01)


@pytest.mark.parametrize("frames", [2, 3])
def test_the_floor_of_few_frames_at_rest_is_that_of_the_noise_of_the_image(frames, tmp_path):
    made = record(offset, noise=10.0)
    array = dataclasses.replace(made.arrays[0], counts=made.arrays[0].counts[:frames])
    path = write(dataclasses.replace(made, times=made.times[:frames], arrays=(array,)), tmp_path / "rest.csv")
    plain = press(METHOD, CURVE, 10.0, POSE, noise=0.0).arrays[0].counts[-1]
    found = read(made, tmp_path, CommonKeys(window=[2, 4]), zero=path)
    assert (found.counts > found.floor)[plain == 0].mean() < 0.02
    assert np.median(found.floor) == pytest.approx(5 * 10 * np.sqrt(1 / 16 + 1 / frames), rel=0.1)


def test_a_large_stamp_that_recovers_does_not_raise_the_zero_of_all(tmp_path):
    """Three quarters of the texels are pressed and keep a fifth of their counts when the load is lifted."""
    pressed = 1000 * (np.arange(N) % 4 > 0)

    def cover(_counts, times):
        on, after = (times > 1.0) & (times < 9.0), times >= 9.0
        return OFFSETS + (on[:, None] + 0.2 * after[:, None]) * pressed + 4 * times[:, None]

    assert read(record(cover), tmp_path).total == pytest.approx(pressed.sum(), rel=0.01)


def test_an_array_without_texels_that_are_switched_on_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="every texel of the pressed array is switched off"):
        read(switch_off(record(offset), np.arange(N)), tmp_path, name="off.mcap")


@pytest.mark.parametrize(("shift", "noise"), [(0.0, 0.0), (0.3, 0.05), (-0.3, 0.05), (0.0, 0.2)])
@pytest.mark.parametrize("load", ["10 N", "force"])
def test_rest_by_force_has_the_noise_and_the_level_of_the_channel(load, shift, noise, tmp_path):
    """Rest before and after the load, with drifting zeros, is two groups whatever the force channel adds."""
    made = record(drift, lift=True)
    true = np.where((made.times > 1.0) & (made.times <= made.times[-1] - 3.0), 10.0, 0.0)
    forces = true + shift + noise * np.random.default_rng(4).standard_normal(len(true))
    made = dataclasses.replace(made, forces=forces, force_times=made.times)
    path = write(made, tmp_path / "one.mcap")
    images = read_image(describe_files([path], CommonKeys(window=[2, 4], load=load), ARRAY).files[0], ARRAY)
    plain = press(METHOD, CURVE, 10.0, POSE, noise=0.0).arrays[0].counts[-1]
    heaviest = max(images, key=lambda image: image.load)
    assert heaviest.load == pytest.approx(10.0, abs=0.15 + noise)
    assert heaviest.counts.sum() == pytest.approx(plain.sum(), rel=0.02)
    assert np.abs(heaviest.counts - plain).max() < 10


def test_a_force_channel_that_is_never_at_rest_gives_no_rest():
    times = np.arange(0, 20, 0.1)
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(times))
    for forces in (10 + noise, 10 + 5 * np.sin(times) + noise, noise, np.array([0.0, 10.0])):
        assert not find_unloaded_by_force(forces).any()
    triangle = np.maximum(10 * np.abs(times % 10 - 5) - 20, 0) / 3
    found = find_unloaded_by_force(triangle + noise)
    assert (triangle[found] < 0.3).all()
    assert found[triangle == 0].mean() > 0.95


@pytest.mark.parametrize("load", [None, "force"])
def test_the_lightest_of_several_loads_is_no_rest(load, tmp_path):
    """2 N, 10 N, then 5 N: the counts alone would take both ends for frames without load."""
    made = record()
    forces = np.select([made.times <= 3.0, made.times <= 8.0], [2.0, 10.0], 5.0)
    counts = np.rint(OFFSETS + forces[:, None] * 100 * (np.arange(N) < 30))
    array = dataclasses.replace(made.arrays[0], counts=counts.astype(np.int32))
    setup = dataclasses.replace(made.setup, load=None)
    made = dataclasses.replace(made, arrays=(array,), setup=setup, forces=forces, force_times=made.times)
    path = write(made, tmp_path / "one.mcap")
    with pytest.raises(RecordingError, match="no frames at rest"):
        read_image(describe_files([path], CommonKeys(window=[2, 4], load=load), ARRAY).files[0], ARRAY)
