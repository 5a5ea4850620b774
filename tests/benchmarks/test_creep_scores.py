"""Creep on weights that were not fitted, through the chain of the fast model."""

import pytest

import fastmodel
from benchmarks.creep_scores import SPLITS, read_pairs, score
from tests.support.recordings import RECORDINGS
from validation.data_sets.data_set import find_data_set


@pytest.fixture(scope="module")
def recorded():
    data_set = find_data_set(RECORDINGS)
    return fastmodel.load(data_set.sensor), read_pairs(data_set)


@pytest.mark.slow
@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
@pytest.mark.parametrize("letters", SPLITS.values(), ids=SPLITS)
def test_creep_predicts_the_late_image_of_other_weights(recorded, letters):
    """At most 0.4 % of the image, 2.5 % of the sum in the mean and 5 % at most; the interval covers each weight."""
    found = score(*recorded, letters)
    image, plain = found.images.mean(axis=0)
    assert image < 0.4
    assert plain > 2.5 * image
    assert found.sums[:, 0].mean() < 0.025
    assert found.sums[:, 0].max() < 0.05
    assert found.sums[:, 1].mean() > 0.11
    assert found.creep.low < found.others[0]
    assert found.others[1] < found.creep.high
