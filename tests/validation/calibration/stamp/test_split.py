"""No split scores a recording that it fits."""

import numpy as np
import pytest

from tests.support.stamp import case_of
from validation.calibration.stamp.split import SPLITS, Split
from validation.recordings import RecordingError


def test_no_split_scores_what_it_fitted():
    for split in SPLITS:
        cases = [case_of(c, np.ones(78), condition=t) for t in ("room", "operating") for c in "ABCDEFGH"]
        fitted, scored = split.divide(cases)
        assert fitted
        assert scored
        assert not {case.file.name for case in fitted} & {case.file.name for case in scored}
    with pytest.raises(ValueError, match=r"scores fitted weights: room \['B'\]"):
        Split(name="leaky", about="", fitted=("room", "AB"), scored=("room", "BC"))


def test_a_missing_weight_is_an_error_and_a_missing_condition_is_none():
    between, _, warmer = SPLITS
    cases = [case_of(letter, np.ones(78)) for letter in "ABCDEFG"]
    with pytest.raises(RecordingError, match=r"room: H1\.dsa missing"):
        between.divide(cases)
    assert warmer.divide(cases) == ([], [])
