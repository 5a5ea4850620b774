"""Which frames of a recording are averaged, and recordings whose loads or counts cannot be what the labels say."""

import dataclasses

import numpy as np
import pytest

from tests.support.laboratory import (
    ARRAY,
    STAMP_TEXT,
    make_curve,
    press,
    uniform_method,
    write,
    write_data_set,
)
from validation.calibration.model import Pose
from validation.data_sets.data_set import describe_files
from validation.data_sets.images import read_image, read_images
from validation.recordings.importing import save
from validation.recordings.recording import RecordingError
from validation.schema.data_set import CommonKeys

METHOD = uniform_method()
CREEP = 0.12
CURVE = dataclasses.replace(make_curve(np.ones(ARRAY.count), creep=CREEP), output_max=np.inf, dead_force=0.0)


def record(seconds=12.0, load=10.0, **options):
    return press(METHOD, CURVE, load, Pose(2e-3, -1e-3), noise=0.0, seconds=seconds, **options)


def read(recording, folder, **keys):
    path = folder / "one.mcap"
    path.unlink(missing_ok=True)
    save(recording, path)
    return read_image(describe_files([path], CommonKeys(**keys), ARRAY).files[0], ARRAY)[0]


@pytest.mark.parametrize(("seconds", "window"), [(12.0, (6, 9)), (8.5, (6, 7.4)), (7.5, (5.4, 6.4)), (4.5, (2.4, 3.4))])
def test_the_window_ends_with_the_load_and_the_image_is_read_at_its_age(seconds, window, tmp_path):
    """The counts are those that creep gives at the stated age, whenever the load ends."""
    found = read(record(seconds), tmp_path)
    assert found.age == pytest.approx(np.mean(window), abs=0.2)
    at_age = (1 + CREEP * np.log(found.age / 2)) / (1 + CREEP * np.log(7.5 / 2))
    assert found.counts.sum() == pytest.approx(at_age * read(record(), tmp_path).counts.sum(), rel=0.005)


def test_a_load_of_less_than_three_seconds_is_refused(tmp_path):
    with pytest.raises(RecordingError, match=r"load is on for 2.2 s; at least 3 s are needed for an average over 1 s"):
        read(record(3.5), tmp_path)
    assert read(record(3.5), tmp_path, window=[1, 2]).age == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("removal", [0.0, 0.4])
def test_a_load_that_is_lifted_ends_the_window(removal, tmp_path):
    """A tool that leaves within 0.4 s does not lower the mean."""
    made = record(10.0)
    share = np.clip((8.0 + removal - made.times) / max(removal, 1e-9), 0, 1)
    counts = np.rint(made.arrays[0].counts * share[:, None]).astype(np.int32)
    lifted = dataclasses.replace(made, arrays=(dataclasses.replace(made.arrays[0], counts=counts),))
    found, whole = read(lifted, tmp_path), read(record(10.0), tmp_path, window=[6, 7])
    assert found.age == pytest.approx(6.5, abs=0.2)
    assert found.counts.sum() == pytest.approx(whole.counts.sum(), rel=0.005)
    assert found.creep == pytest.approx(CREEP, abs=0.01)


def test_a_heavier_load_with_a_smaller_sum_is_told_and_repeats_are_not(tmp_path):
    for number, (label, load) in enumerate([(4.0, 4.0), (4.0, 3.3), (8.0, 8.0), (12.0, 2.0)]):
        made = record(load=load)
        write(dataclasses.replace(made, setup=dataclasses.replace(made.setup, load=label)), tmp_path / f"{number}.csv")
    text = f"indenter = '{STAMP_TEXT}'\n[[series]]\nname = 'a'\nfiles = '{{}}'\n"
    images, (line,) = read_images(write_data_set(tmp_path, text.format("*.csv")), ARRAY)
    assert len(images) == 4
    assert "3.csv (12 N) has a smaller sum of counts than" in line
    assert "and 2 more pairs" in line
    assert read_images(write_data_set(tmp_path, text.format("[012].csv")), ARRAY)[1] == []


def test_a_label_that_contradicts_the_force_channel_is_refused(tmp_path):
    made = record()
    forces = np.where(made.times > 1.0, 10.5, 0.0)
    right = dataclasses.replace(made, forces=forces, force_times=made.times)
    assert read(right, tmp_path).load == 10.0
    wrong = dataclasses.replace(right, forces=2 * forces)
    with pytest.raises(RecordingError, match="said to be 10 N, and its force channel reads 21 N"):
        read(wrong, tmp_path)
    assert max(image.load for image in _pieces(wrong, tmp_path)) == pytest.approx(21.0)


def _pieces(recording, folder):
    (folder / "one.mcap").unlink(missing_ok=True)
    save(recording, folder / "one.mcap")
    return read_image(describe_files([folder / "one.mcap"], CommonKeys(load="force"), ARRAY).files[0], ARRAY)


def test_a_recording_in_saturation_is_refused_and_one_saturated_texel_is_not(tmp_path):
    made = record()
    for most, refused in ((1, True), (1000, False)):
        counts = np.where(made.arrays[0].counts > 0, np.minimum(made.arrays[0].counts, most), 0)
        array = dataclasses.replace(made.arrays[0], counts=counts.astype(np.int32), full_scale=most)
        changed = dataclasses.replace(made, arrays=(array,))
        if refused:
            with pytest.raises(
                RecordingError, match="pressed texels are at the end of the range at 10 N; use lighter loads"
            ):
                read(changed, tmp_path)
        else:
            assert read(changed, tmp_path).counts.max() == pytest.approx(most, abs=1)


def test_placements_of_one_series_stay_apart(tmp_path):
    for number in range(2):
        write(record(load=5.0 + number), tmp_path / f"{number}.csv")
    text = f"indenter = '{STAMP_TEXT}'\n[[series]]\nname = 'a'\n" + "".join(
        f"[[series.file]]\npath = '{n}.csv'\nplacement = 'place {n}'\n" for n in range(2)
    )
    images, problems = read_images(write_data_set(tmp_path, text), ARRAY)
    assert problems == []
    assert [image.file.placement.name for image in images] == ["place 0", "place 1"]


def test_a_force_channel_does_not_hide_saturation(tmp_path):
    made = record()
    counts = np.minimum(made.arrays[0].counts, 1).astype(np.int32)
    array = dataclasses.replace(made.arrays[0], counts=counts, full_scale=1)
    forces = np.where(made.times > 1.0, 10.0, 0.0)
    with pytest.raises(RecordingError, match="pressed texels are at the end of the range at 10 N"):
        _pieces(dataclasses.replace(made, arrays=(array,), forces=forces, force_times=made.times), tmp_path)


def test_two_arrays_and_two_windows_of_one_file_are_not_the_same_content(tmp_path):
    made, other = record(load=10.0), record(load=5.0)
    save(dataclasses.replace(made, arrays=(made.arrays[0], other.arrays[0])), tmp_path / "one.mcap")
    series = "[[series]]\nname = '{}'\nfiles = 'one.mcap'\nload = {}\narray = {}\nwindow = {}\n"
    rows = [
        ("a", "'10 N'", 0, [4, 5]),
        ("b", "'5 N'", 1, [4, 5]),
        ("c", "'10 N'", 0, [8, 10]),
        ("d", "'10 N'", 0, [4, 5]),
    ]
    text = f"indenter = '{STAMP_TEXT}'\n" + "".join(series.format(*row) for row in rows)
    images, problems = read_images(write_data_set(tmp_path, text), ARRAY)
    assert [image.file.series for image in images] == ["a", "b", "c"]
    assert images[1].total == pytest.approx(images[0].total / 2, rel=0.1)
    assert images[2].age == pytest.approx(9.0, abs=0.2)
    assert ["the same content is read once" in line for line in problems] == [True]
