"""The page prints the numbers of the evaluation in the rows, columns and tiles that name them."""

import dataclasses

import numpy as np
import pytest

from meshes.catalogue import ARRAYS
from tests.support.indentations import make_indentation
from tests.support.report_page import Page, is_printed
from validation.campaign.campaign_file import read_campaign
from validation.campaign.results import MODELS, CampaignResult, CaseResult, Pooled, Prediction, judge
from validation.data_sets.results import CountScore, RecordingExample, RecordingRow, RecordingScores
from validation.metrics import TABULATED, Score
from validation.places import FlatPlaces
from validation.report import write_report
from validation.sensor_file import load

FACTORS = {"misplaced_force": 100, "relative_l2": 100, "total_force_error": 100, "peak_error": 100}
FACTORS |= {"centre_of_pressure_m": 1e3, "wasserstein_m": 1e3}
STAMP_METRICS = [field.name for field in dataclasses.fields(CountScore)]
STAMP_COLUMNS = {"image_changed_percent": 1, "relative_l2": 100, "total_counts_error": 100}
STAMP_COLUMNS |= {"centre_of_pressure_m": 1e3, "wasserstein_m": 1e3, "active_area_iou": 1}
STAMP_MODELS = (("zeros", False), ("line per texel", False), ("fast model", False), ("fast model", True))
RANDOM = np.random.default_rng(7)


def draw_pooled():
    low, mean, high = np.sort(RANDOM.uniform(0.01, 0.9, 3)).tolist()
    return Pooled(mean=mean, low=low, high=high, level=0.95, cases=2)


def draw_score():
    values = {field.name: float(RANDOM.uniform(0.01, 0.9)) for field in dataclasses.fields(Score)}
    counts = {name: int(RANDOM.integers(1, 84)) for name in values if name.startswith("pixels")}
    return Score(**values | counts)


def draw_estimates():
    names = ("total_force", "depth", "peak_texel", "contact_area")
    return dict(zip(names, RANDOM.uniform(0.001, 0.05, 4).tolist(), strict=True))


def draw_row(split, model, *, gains):
    nulls = {"zeros": draw_pooled(), "line per texel": draw_pooled()} if model == "fast model" else {}
    return RecordingRow(
        split=split,
        model=model,
        kind="model" if model == "fast model" else "null",
        texel_gains=gains,
        fitted=(f"{split} A1", f"{split} B1"),
        parameters={"rms_counts": float(RANDOM.uniform(1, 9))},
        per_case={"room C": CountScore(**dict.fromkeys(STAMP_METRICS, 0.5))},
        pooled={name: draw_pooled() for name in STAMP_METRICS},
        skill=nulls,
        electronics=None,
    )


@pytest.fixture(scope="module")
def recordings():
    splits = ("between", "heavier")
    return RecordingScores(
        name="made up",
        rows=tuple(draw_row(split, model, gains=gains) for split in splits for model, gains in STAMP_MODELS),
        examples=tuple(
            RecordingExample(
                split=split,
                case="room H1",
                load=8.8,
                recorded=RANDOM.integers(0, 255, (13, 6)).astype(np.uint8),
                predicted={"fast model": RANDOM.integers(0, 255, (13, 6)).astype(np.uint8)},
            )
            for split in splits
        ),
        about=dict.fromkeys((*splits, "fast model"), "some words"),
        files={},
        notes=dict.fromkeys(splits, ("a note",)),
        problems=("a file is damaged",),
        noise=9.0,
        source="nowhere",
    )


@pytest.fixture(scope="module")
def evaluation(evaluation, recordings):
    """Random scores of the cases of a real evaluation: every number differs from every other."""
    array = ARRAYS["wts-0614-34"]
    results = []
    for case in (each.case for each in evaluation.campaign.cases):
        reference = dataclasses.replace(draw_reference(array, case.load), error_estimate=draw_estimates())
        predictions = {
            model: Prediction(texel_forces=RANDOM.uniform(0, 1, 84), outside=0.0, score=draw_score())
            for model in MODELS
        }
        results.append(CaseResult(case=case, reference=reference, predictions=predictions, warnings=()))
    campaign = CampaignResult(
        cases=results,
        skipped=(),
        pooled={model: {metric: draw_pooled() for metric in TABULATED} for model in MODELS},
        skill={model: draw_pooled() for model in MODELS if model != "fast"},
        noise_floor=draw_estimates(),
    )
    return dataclasses.replace(
        evaluation,
        verification={"radial_profile": 0.00123, "texel_response": 0.00234},
        plan=read_campaign(None, FlatPlaces(array=array)),
        campaign=campaign,
        verdict=judge(read_campaign(None, FlatPlaces(array=array)), campaign),
        recordings=recordings,
        recorded=load("sdh2-distal"),
        seconds={"campaign": 1.0},
        versions={"softcover": "0"},
    )


def draw_reference(array, load):
    points = np.abs(RANDOM.uniform(-1e-3, 1e-3, (9, 3)))
    return make_indentation(
        RANDOM.uniform(0, 1, array.count), total_force=load, depth=float(RANDOM.uniform(1e-4, 1e-3)),
        contact_points=points, contact_forces=np.tile([0.0, 0.0, -load / 9], (9, 1)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def page(evaluation, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(evaluation, folder)
    page = Page()
    page.feed((folder / "index.html").read_text())
    return page


def read_numbers(text):
    return [float(part) for part in text.replace("\u2026", " ").split()]


def test_the_table_of_models_prints_the_pooled_scores_of_each(page, evaluation):
    head, *rows = page.tables["pooled"]
    assert len(head) == 1 + len(TABULATED)
    assert [row[0][1][0] for row in rows] == list(MODELS)
    for (_, *cells), pooled in zip(rows, evaluation.campaign.pooled.values(), strict=True):
        for (number, (mean, interval)), metric in zip(cells, TABULATED, strict=True):
            expected, factor = pooled[metric], FACTORS.get(metric, 1)
            assert float(number) == expected.mean
            assert is_printed(mean, factor * expected.mean)
            low, high = interval.split(" to ")
            assert is_printed(low, factor * expected.low)
            assert is_printed(high, factor * expected.high)


def test_the_table_of_cases_prints_the_fast_model_and_the_reference(page, evaluation):
    _, *rows = page.tables["case-table"]
    for row, result in zip(rows, evaluation.campaign.cases, strict=True):
        fast, bare = result.predictions["fast"].score, result.predictions["no-spread"].score
        assert row[0][1] == [result.case.name, f"{result.case.shape} at {result.case.place}"]
        assert is_printed(row[1][1][0], result.case.load)
        expected = [getattr(fast, metric) for metric in TABULATED]
        assert [float(number) for number, _ in row[2:11]] == expected
        for (_, texts), value, metric in zip(row[2:11], expected, TABULATED, strict=True):
            assert is_printed(texts[0], FACTORS.get(metric, 1) * value)
        assert float(row[11][0]) == bare.misplaced_force
        assert is_printed(row[11][1][0], 100 * bare.misplaced_force)
        assert row[12][1] == [str(fast.pixels_lit_line)]
        assert float(row[13][0]) == result.reference.depth
        assert is_printed(row[13][1][0], 1e3 * result.reference.depth)
        assert float(row[14][0]) == result.reference.error_estimate["peak_texel"]
        assert float(row[14][1][0]) == pytest.approx(100 * result.reference.error_estimate["peak_texel"], rel=0.05)


def test_the_table_of_requirements_prints_each_value_with_its_interval_and_unit(page, evaluation):
    _, *rows = page.tables["requirements"]
    for row, finding in zip(rows, evaluation.verdict.findings, strict=True):
        factor = 1e3 if finding.metric.endswith("_m") else FACTORS.get(finding.metric, 1)
        found, *interval = row[1][1]
        number, *unit = found.split()
        assert float(row[1][0]) == finding.value
        assert is_printed(number, factor * finding.value)
        assert unit == (["%"] if factor == 100 else row[2][1][0].split()[1:])
        for text in interval:
            low, _, high, *other = text.split()
            assert is_printed(low, factor * finding.low)
            assert is_printed(high, factor * finding.high)
            assert other == unit
        assert is_printed(row[2][1][0].split()[0], factor * finding.limit)


def test_the_section_on_verification_prints_each_estimate_in_percent(page, evaluation):
    errors = [*evaluation.derivation.error_estimate.items(), *evaluation.campaign.noise_floor.items()]
    errors = [(name.replace("_", " "), value) for name, value in errors]
    errors += [("radial profile", evaluation.verification["radial_profile"])]
    errors += [("texel response", evaluation.verification["texel_response"])]
    assert len(errors) == len(page.spans)
    for name, value in errors:
        before, printed = next((before, printed) for before, number, printed in page.spans if number == value)
        assert name in before
        assert float(printed) == pytest.approx(100 * value, rel=0.05), name


def test_tiles_print_the_quantities_that_they_name(page, evaluation, recordings):
    campaign, gaussian = evaluation.campaign, evaluation.derivation.fit.gaussian
    fast, heavier = campaign.pooled["fast"], recordings.row("heavier", "fast model").pooled["image_changed_percent"]
    null = min(
        (recordings.row("heavier", name) for name in ("zeros", "line per texel")),
        key=lambda row: row.pooled["image_changed_percent"].mean,
    )
    empty, skill = campaign.pooled["zeros"]["image_changed_percent"], campaign.skill["no-spread"]
    best = null.pooled["image_changed_percent"].mean
    expected = {
        "of the load misplaced": (100 * fast["misplaced_force"].mean, f"{100 * fast['misplaced_force'].low:.3g}"),
        "image changed": (fast["image_changed_percent"].mean, f"an empty image has {empty.mean:.3g} %"),
        "better than no spread": (100 * skill.mean, f"{100 * skill.high:.2g}"),
        "sigma [mm]": (3.4 * gaussian.sigma_x, "uniform texel load"),
        "reference error": (100 * campaign.noise_floor["peak_texel"], "peak texel"),
        "image changed, recordings": (heavier.mean, f"({null.model}) has {best:.3g} %"),
    }
    assert {name for _, name, _ in page.tiles} == set(expected)
    for value, name, small in page.tiles:
        assert float(value.removesuffix("%")) == pytest.approx(expected[name][0], rel=0.05), name
        assert expected[name][1] in small, name


def test_the_tables_of_recordings_print_the_row_that_they_name(page, recordings):
    tables = [rows for rows in page.tables.values() if rows and rows[0][-1][1] == ["skill"]]
    for split, (_, *rows) in zip(("between", "heavier"), tables, strict=True):
        null = min(
            (recordings.row(split, name) for name in ("zeros", "line per texel")),
            key=lambda row: row.pooled["image_changed_percent"].mean,
        ).model
        for (model, gains), cells in zip(STAMP_MODELS, rows, strict=True):
            row = recordings.row(split, model, texel_gains=gains)
            kind = ["with texel gains"] if gains else ["null"] if row.kind == "null" else []
            assert [cells[0][1], cells[1][1]] == [[model], kind]
            for (number, (mean, interval)), (metric, factor) in zip(cells[2:8], STAMP_COLUMNS.items(), strict=True):
                pooled = row.pooled[metric]
                assert float(number) == pooled.mean
                assert is_printed(mean, factor * pooled.mean)
                low, high = interval.split(" to ")
                assert is_printed(low, factor * pooled.low)
                assert is_printed(high, factor * pooled.high)
            if row.skill:
                assert cells[8][1] == [f"{row.skill[null].mean:.2f}"]
