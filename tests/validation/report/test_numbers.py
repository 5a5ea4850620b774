"""The page prints the numbers of the evaluation in the rows and columns that name them."""

import dataclasses

import numpy as np
import pytest

from tests.support.report_page import Page, is_printed
from validation.campaign.case import Case
from validation.campaign.results import MODELS
from validation.data_sets.results import CountScore, RecordingExample, RecordingRow, RecordingScores
from validation.metrics import TABULATED
from validation.pooling import Pooled
from validation.report import write_report
from validation.results import Column, columns
from validation.sensor_file import load

RANDOM = np.random.default_rng(7)
#: Rows of the table of recordings: model, and whether a gain per texel was fitted.
ROWS = (("zeros", False), ("line per texel", False), ("fast model", False), ("fast model", True))
BODIES = {
    "sphere": "ball, radius 5 mm, 4.9 N at (1.7, 1.7) mm, 0°",
    "box": "box, 6 mm \u00d7 10 mm \u00d7 5 mm, 0.981 N at (0.7, -1.1) mm, 45° and "
    "ball, radius 3 mm, 2 N at (0, 9) mm, 0°",
}
ESTIMATES = {"total_force": 0.0011, "depth": 0.0022, "peak_texel": 0.0033, "contact_area": 0.0044}


def draw_pooled():
    low, mean, high = np.sort(RANDOM.uniform(0.01, 0.9, 3)).tolist()
    return Pooled(mean=mean, low=low, high=high, level=0.95, cases=2)


def draw_row(split, model, gains):
    names = [field.name for field in dataclasses.fields(CountScore)]
    return RecordingRow(
        split=split, model=model, kind="model" if model == "fast model" else "null", texel_gains=gains,
        fitted=(f"{split} A1", f"{split} B1"), parameters={"rms_counts": 3.0}, electronics=None,
        per_case={"room C": CountScore(**dict.fromkeys(names, 0.5))}, pooled={name: draw_pooled() for name in names},
        skill={"zeros": draw_pooled(), "line per texel": draw_pooled()} if model == "fast model" else {},
    )  # fmt: skip


@pytest.fixture(scope="module")
def recordings():
    splits = ("between", "heavier")
    image = RANDOM.integers(0, 255, (13, 6)).astype(np.uint8)
    return RecordingScores(
        name="made up", files={}, problems=("a file is damaged",), noise=9.0, source="nowhere",
        rows=tuple(draw_row(split, *row) for split in splits for row in ROWS),
        examples=tuple(
            RecordingExample(split=split, case="room H1", load=8.8, recorded=image, predicted={"fast model": image})
            for split in splits
        ),
        about=dict.fromkeys((*splits, "fast model"), "some words"), notes=dict.fromkeys(splits, ("a note",)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def evaluation(evaluation, recordings):
    """An evaluation whose means all differ, with scores on recordings, and with a further body in the second case."""
    one, two = evaluation.campaign.cases
    further = Case.read("b", "sphere:radius=3mm", "2 N", at="0mm,9mm")
    both = dataclasses.replace(two.case, load=two.case.load + further.load, others=(further,))
    campaign = dataclasses.replace(
        evaluation.campaign,
        cases=(one, dataclasses.replace(two, case=both)),
        pooled={model: {metric: draw_pooled() for metric in TABULATED} for model in MODELS},
        skill={model: draw_pooled() for model in MODELS if model != "fast"},
        noise_floor=ESTIMATES,
    )
    verification = {"radial_profile": 0.00123, "texel_response": 0.00234}
    return dataclasses.replace(
        evaluation, campaign=campaign, verification=verification, recordings=recordings, recorded=load("sdh2-distal")
    )


@pytest.fixture(scope="module")
def page(evaluation, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(evaluation, folder)
    page = Page()
    page.feed((folder / "index.html").read_text())
    return page


def check_pooled(cells, pooled, shown):
    """Cells hold the means of the shown metrics, and print them with their intervals."""
    for (number, (mean, *interval)), (metric, column) in zip(cells, shown.items(), strict=True):
        assert float(number) == pooled[metric].mean
        ends = interval[0].split(" to ")
        for text, name in zip((mean, *ends), ("mean", "low", "high"), strict=True):
            assert is_printed(text, column.factor * getattr(pooled[metric], name))


def test_the_table_of_models_prints_the_pooled_scores_of_each(page, evaluation):
    _, *rows = page.tables["pooled"]
    assert [row[0][1][0] for row in rows] == list(MODELS)
    for (_, *cells), pooled in zip(rows, evaluation.campaign.pooled.values(), strict=True):
        check_pooled(cells, pooled, TABULATED)


def test_the_table_of_cases_prints_the_fast_model_and_the_reference(page, evaluation):
    _, *rows = page.tables["case-table"]
    for row, result in zip(rows, evaluation.campaign.cases, strict=True):
        fast, bare = result.predictions["fast"].score, result.predictions["no-spread"].score
        assert row[0][1] == [result.case.name, BODIES[result.case.name]]
        expected = [getattr(fast, metric) for metric in TABULATED]
        expected += [bare.misplaced_force, fast.pixels_lit_line, result.reference.depth]
        expected += [result.reference.error_estimate["peak_texel"]]
        assert [float(number) for number, _ in row[1:]] == [result.case.load, *expected]
        factors = [1, *(column.factor for column in TABULATED.values()), 100, 1, 1e3, 100]
        for (_, (text, *_)), factor, value in zip(row[1:], factors, [result.case.load, *expected], strict=True):
            assert is_printed(text, factor * value)


def test_the_picture_of_a_case_names_every_body_with_its_load(page):
    text = " ".join(page.text.split())
    assert "mm, 0.981 N at (0.7, -1.1) mm, 45° and ball, radius 3 mm, 2 N at (0, 9) mm, 0°" in text
    assert text.count("with an outline around all bodies") >= 1


def test_the_table_of_requirements_prints_each_value_with_its_interval_and_unit(page, evaluation):
    _, *rows = page.tables["requirements"]
    for row, finding in zip(rows, evaluation.verdict.findings, strict=True):
        found, *interval = row[1][1]
        assert float(row[1][0]) == finding.value
        factor = 1e3 if finding.metric.endswith("_m") else 1 if finding.metric.endswith("_percent") else 100
        assert is_printed(found.split()[0], factor * finding.value)
        assert found.split()[1:] == row[2][1][0].split()[1:] == ["mm" if factor == 1e3 else "%"]
        for text in interval:
            low, _, high, _ = text.split()
            assert is_printed(low, factor * finding.low)
            assert is_printed(high, factor * finding.high)
        assert is_printed(row[2][1][0].split()[0], factor * finding.limit)


def test_the_section_on_verification_prints_each_estimate_in_percent(page, evaluation):
    errors = {**evaluation.derivation.error_estimate, **ESTIMATES, **evaluation.verification}
    for name, value in errors.items():
        before, printed = next((before, printed) for before, number, printed in page.spans if number == value)
        assert name.replace("_", " ") in before
        assert float(printed) == pytest.approx(100 * value, rel=0.05), name


def test_the_first_screen_prints_the_requirement_that_decides(page, evaluation):
    """Two cases decide nothing, so that the first undecided mean stands there, with the simplest model beside it."""
    finding = next(each for each in evaluation.verdict.findings if each.status == "open")
    ((value, words),) = page.keys
    assert evaluation.verdict.deciding == (finding,)
    assert is_printed(value.removesuffix(" %"), 100 * finding.value)
    bare = 100 * evaluation.campaign.pooled["no-spread"]["misplaced_force"].mean
    parts = (
        f"misplaced force, {finding.over};",
        f"at most {100 * finding.limit:.3g} % required",
        f"the mean is {bare:.3g} %",
        f"own error is {100 * ESTIMATES['peak_texel']:.2g} % of the peak texel",
    )
    assert [part for part in parts if part not in words] == []


def test_the_first_screen_lists_what_is_not_met_and_counts_the_rest(page, evaluation):
    _, *rows = page.tables["first"]
    findings = [each for each in evaluation.verdict.findings if each not in evaluation.verdict.deciding]
    assert [row[-1][1] for row in rows] == [["not decided"]] * 8
    assert [float(row[1][0]) for row in rows] == [each.value for each in findings[:8]]


def test_the_tables_of_recordings_print_the_row_that_they_name(page, recordings):
    for split in ("between", "heavier"):
        _, *rows = page.tables[f"recordings-{split}"]
        nulls = [recordings.row(split, name) for name in ("zeros", "line per texel")]
        best = min(nulls, key=lambda row: row.pooled["image_changed_percent"].mean).model
        for (model, gains), cells in zip(ROWS, rows, strict=True):
            row = recordings.row(split, model, texel_gains=gains)
            assert [cells[0][1], cells[1][1]] == [
                [model],
                ["with texel gains"] if gains else ["null"] if row.kind == "null" else [],
            ]
            check_pooled(cells[2:-1], row.pooled, columns(CountScore))
            assert cells[-1][1] == ([f"{row.skill[best].mean:.2f}"] if row.skill else ["\u2013"])


@pytest.mark.parametrize(
    ("value", "text"),
    [(2.3e-16, "0"), (-9e-16, "0"), (0.0, "0"), (-2.5e-8, "-2.50e-05"), (0.25, "250"), (np.inf, "inf")],
)
def test_rounding_errors_of_zero_are_printed_as_zero(value, text):
    assert Column(heading="place", unit="mm", factor=1e3).text(value) == text
