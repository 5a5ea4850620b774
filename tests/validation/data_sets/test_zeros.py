"""Recordings whose counts are not zero at rest, or fall under load, are refused; others are read as before."""

import dataclasses

import numpy as np
import pytest

from tests.support.laboratory import ARRAY, draw_gains, make_curve, press, uniform_method, write
from validation.calibration.model import Pose
from validation.data_sets.data_set import describe_files
from validation.data_sets.images import find_rest, read_image
from validation.recordings.recording import RecordingError
from validation.schema.data_set import CommonKeys

METHOD = uniform_method()
CURVE = make_curve(draw_gains(np.random.default_rng(1)))
POSE = Pose(2e-3, -1e-3)
KEYS = CommonKeys(window=[2, 4])


def record(change=lambda counts, _times: counts, load=10.0, **options):
    """A weight that is put on after one second, with changed counts."""
    made = press(METHOD, CURVE, load, POSE, **options)
    counts = change(made.arrays[0].counts.astype(float), made.times)
    array = dataclasses.replace(made.arrays[0], counts=np.rint(counts).astype(np.int32), full_scale=2**20)
    return dataclasses.replace(made, arrays=(array,))


def read(recording, folder):
    path = write(recording, folder / "one.csv")
    return read_image(describe_files([path], KEYS, ARRAY).files[0], ARRAY)[0]


def offset(level, noise, sign=1.0):
    """Add a level and noise to the counts of every texel; the load subtracts counts if the sign is negative."""
    random = np.random.default_rng(3)
    return lambda counts, _times: level + sign * counts + noise * random.standard_normal(counts.shape)


def lift(counts, times):
    """Take the weight off for the last two seconds, over an offset."""
    return (
        820 + np.where(times[:, None] > times[-1] - 2.5, 0, counts) + 30 * np.random.default_rng(4).random(counts.shape)
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (offset(25000, 0), "80 texels have 25000 counts at rest .* subtract"),
        (offset(25000, 40), "counts at rest .* subtract"),
        (offset(820, 30), "counts at rest .* subtract"),
        (offset(40, 3), "counts at rest .* subtract"),
        (offset(4000, 0, sign=-1.0), "the counts fall by .* while the load is on"),
        (offset(4000, 20, sign=-1.0), "the counts fall by .* while the load is on"),
        (lift, "counts at rest .* subtract"),
    ],
)
@pytest.mark.parametrize("load", [2.0, 20.0])
def test_a_zero_that_is_not_zero_is_refused(change, words, load, tmp_path):
    with pytest.raises(RecordingError, match=words) as error:
        read(record(change, load=load), tmp_path)
    assert "one.csv" in str(error.value)


def stuck(counts, _times):
    """One texel that always reads five counts."""
    return np.where(np.arange(counts.shape[1]) == 7, np.maximum(counts, 5), counts)


def flicker(counts, _times):
    """Texels that read zero or one count at rest."""
    return np.maximum(counts, np.random.default_rng(5).integers(0, 2, counts.shape))


@pytest.mark.parametrize("change", [lambda counts, _times: counts, stuck, flicker])
@pytest.mark.parametrize("load", [2.0, 20.0])
def test_zeros_that_are_zero_change_nothing(change, load, tmp_path):
    plain = read(record(load=load), tmp_path)
    found = read(record(change, load=load), tmp_path)
    assert found.counts.sum() == pytest.approx(plain.counts.sum(), rel=0.03)


def test_a_recording_that_begins_under_load_has_no_rest(tmp_path):
    made = record(seconds=20.0, rate=20.0)
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
