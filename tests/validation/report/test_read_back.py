"""Results are written as JSON and read back as the objects that wrote it."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation import read_report
from validation.credibility.uncertainty import InputUncertainty
from validation.errors import InputError
from validation.json_values import json_text
from validation.metrics import METRICS, Score
from validation.pooling import Pooled
from validation.results.report import Report

NUMBERS = st.floats(allow_nan=True, allow_infinity=False)


@pytest.mark.slow
def test_a_report_reads_back_as_the_object_that_wrote_it(solved, tmp_path):
    report = solved.report
    (tmp_path / "report.json").write_text(json_text(report))
    again = read_report(tmp_path / "report.json")
    assert again == report
    assert json_text(again) == json_text(report)
    for mine, other in zip(again.campaign.cases, solved.campaign.cases, strict=True):
        assert mine.case == other.case
        np.testing.assert_array_equal(mine.reference.texel_forces, other.reference.texel_forces)
        assert mine.predictions["fast"].score == other.predictions["fast"].score
    assert again.verdict.sentence == solved.verdict.sentence
    other = dataclasses.replace(report, campaign=dataclasses.replace(report.campaign, interrupted=True))
    assert other != again


SCORES = st.builds(Score, **{name: st.integers(0, 84) if name.startswith("pixels") else NUMBERS for name in METRICS})
POOLED = st.builds(Pooled, mean=NUMBERS, low=NUMBERS, high=NUMBERS, level=st.just(0.95), cases=st.integers(0, 99))


@given(SCORES | POOLED)
def test_scores_and_means_read_back_with_their_missing_numbers(result):
    assert type(result).from_json(json.loads(json_text(result))) == result


def test_a_bound_that_is_infinite_reads_back_as_such():
    inputs = InputUncertainty(load=1.0, uncertainties={"friction": math.inf}, image=np.ones(2), effects={})
    again = InputUncertainty.from_json(json.loads(json_text(inputs)))
    assert again.uncertainties["friction"] == math.inf


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("{", "report.json"),
        ("{}", "verdict: Field required"),
        ('{"verdict": 3}', "verdict"),
    ],
)
def test_a_file_that_is_no_report_is_refused_with_the_place(tmp_path, text, fault):
    (tmp_path / "report.json").write_text(text)
    with pytest.raises(InputError) as caught:
        read_report(tmp_path / "report.json")
    assert any(fault in line for line in caught.value.faults)


def test_a_report_of_another_version_is_read_without_its_new_keys(evaluation):
    values = json.loads(json_text(evaluation.report)) | {"new": 1}
    assert Report.from_json(values) == evaluation.report
