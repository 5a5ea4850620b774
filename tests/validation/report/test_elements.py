"""What each element of the page says: captions, columns, pictures, moving cases, and what is folded or missing."""

import dataclasses
import math
import re
from datetime import UTC, datetime, timedelta
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.report_page import Page
from validation.campaign.results import SkippedCase
from validation.credibility.uncertainty import ComparisonError
from validation.data_sets.results import CountScore, RecordingRow
from validation.moving.results import MovingResult, MovingScore
from validation.pooling import Pooled
from validation.report import page as page_module
from validation.report.figures import Pictures
from validation.report.page import contents, list_tables, render_page, tabulate_recordings, write_report
from validation.sensor_file import load

DASH = "\u2013"
#: Words of the caption of each table, some of its headings by their place, and its columns of words.
TABLES = {
    "requirements": ("Acceptance criterion", {0: "requirement", 1: "found (95 % interval)", 2: "at most", 3: "margin",
                                              4: "status"}, [4]),
    "pooled": ("over 2 cases", {0: "model", 1: "misplaced force [%]", 9: "pixels changed"}, []),
    "case-table": ("case by case", {0: "case", 1: "load [N]", 2: "misplaced force [%]", 11: "no spread, misplaced [%]",
                                    12: "texels lit after the WTS line", 13: "depth of the reference [mm]",
                                    14: "estimated error of the reference [% of the peak texel]"}, []),
    "comparison-table": ("Published models", {0: "model", 1: "parameters and fit", 2: "misplaced force [%]",
                                              5: "centre of pressure [mm]"}, [1]),
    "codes": ("Code verification", {0: "what", 5: "error of the result [%]"}, [6]),
    "solutions": ("three grids", {0: "case and quantity", 6: "estimated error [%]"}, []),
    "errors-table": ("E = S - D", {1: "S", 2: "D", 3: "E", 4: "u_num", 5: "u_input", 6: "u_D", 7: "u_val",
                                   8: "|E| > u_num: resolved here", 9: "|E| > u_val: resolved on a real cover"},
                     [8, 9]),
    "inputs": ("one standard uncertainty of each input", {0: "case", 6: "all, in quadrature"}, []),
    "stages": ("one part of the reference is replaced", {0: "stage", 1: "mean over the cases", 2: "largest"}, []),
    "groups": ("by load and pose", {0: "group", 1: "cases"}, []),
    "domain": ("validated domain ends", {0: "quantity", 1: "smallest", 2: "largest"}, []),
    "responses": ("Responses of the texels", {0: "quantity", 1: "value"}, []),
}  # fmt: skip


@pytest.fixture(scope="module")
def tables(evaluation):
    return list_tables(evaluation)


@pytest.mark.parametrize("name", TABLES)
def test_each_table_has_a_caption_headings_and_columns_of_words(tables, name):
    words, headings, texts = TABLES[name]
    table = tables[name]
    assert table.name == name
    assert words in table.caption
    assert {place: table.headings[place] for place in headings} == headings
    assert list(table.texts) == texts
    assert {len(row) for row in table.rows} == {len(table.headings)}


def test_the_tables_are_those_and_no_others(tables):
    assert set(tables) == set(TABLES)


def test_the_table_of_models_says_what_each_one_is(tables, evaluation):
    rows = [(row[0].text, row[0].small) for row in tables["pooled"].rows]
    assert rows == list(evaluation.campaign.models.items())
    assert [row[0].small for row in tables["comparison-table"].rows[:5]] == list(evaluation.campaign.models.values())


def test_the_status_of_a_requirement_is_emphasised_unless_it_is_met(tables, evaluation):
    for row, finding in zip(tables["requirements"].rows, evaluation.verdict.findings, strict=True):
        assert row[4].bold == (finding.status != "met")
        assert (row[1].value, row[2].value, row[3].value) == pytest.approx(
            (finding.value, finding.limit, finding.margin), nan_ok=True
        )


def show(evaluation, folder):
    """The HTML of the page of an evaluation, and its text."""
    write_report(evaluation, folder)
    html = (folder / "index.html").read_text(encoding="utf-8")
    return html, " ".join(unescape(re.sub(r"<[^>]+>", " ", html)).split())


def name_plot(plot):
    """The label of a plot along y, instead of its drawing, which takes long."""
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    plot(axes)
    return f"<svg>{axes.get_ylabel()}</svg>"


def make_moving(name, errors):
    numbers = {"misplaced": 0.02, "misplaced_high": 0.06, "touching": 0.1, "sliding": math.nan, "delay": 0.0125,
               "overshoot": 0.05, "latency": 0.004, "latency_worst": 0.009}  # fmt: skip
    scores = tuple(
        MovingScore(case=name, model=f"model {k}", chain=f"filter {k}", error=each, **numbers)
        for k, each in enumerate(errors)
    )
    totals = {model: np.array([0.0, 1.0, 2.0]) for model in ("truth", "fast", *(each.model for each in scores))}
    return MovingResult(
        name=name, indenter="a ball", states=7, interpolation_error=0.0025, fastest=30.0, resonance=950.0,
        warnings=("too fast",), scores=scores, times=np.array([0.0, 0.1, 0.2]), totals=totals,
    )  # fmt: skip


@pytest.fixture(scope="module")
def rich(evaluation, tmp_path_factory):
    """A page with moving cases, one without scores, pictures of one case, and a case whose error is not known."""
    one, two = evaluation.campaign.cases
    unknown = dataclasses.replace(one.predictions["fast"].score, misplaced_force=math.nan)
    fast = dataclasses.replace(one.predictions["fast"], score=unknown)
    first = dataclasses.replace(one, predictions={**one.predictions, "fast": fast})
    campaign = dataclasses.replace(evaluation.campaign, cases=(first, two))
    sensor = dataclasses.replace(evaluation.sensor, name="<i>\u00b5 pad")
    given = dataclasses.replace(
        evaluation, campaign=campaign, moving=(make_moving("slide <i>", (0.1, 0.25)), make_moving("tap", (0.3,))),
        not_moved=(SkippedCase(name="roll", indenter="", load=1.0, reason="it rolls away", converged=True),),
        derivation=dataclasses.replace(evaluation.derivation, sensor=sensor),
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("rich")
    with pytest.MonkeyPatch.context() as patch:
        pictures = Pictures(files={"box": "case-02.png"}, missing="1 further case is not drawn")
        patch.setattr(page_module, "draw_cases", lambda *_: pictures)
        patch.setattr(page_module, "plot_responses", lambda _: {})  # these two are tested on their own
        patch.setattr(page_module, "_draw_maps", lambda _: {"images": [], "bars": ""})
        patch.setattr(page_module, "render_svg", name_plot)
        return show(given, folder)


def test_a_moving_case_has_a_table_of_all_scores_but_the_name_of_the_case(rich):
    html, text = rich
    page = Page()
    page.feed(html)
    headings, first, second = page.tables["moving-0"]
    assert [" ".join(words) for _, words in headings] == [
        "model", "error [%]", "misplaced [%]", "95 % [%]", "touching [%]", "sliding [%]", "delay [ms]", "overshoot [%]",
        "latency [ms]", "worst [ms]",
    ]  # fmt: skip
    assert first[0][1] == ["model 0", "filter 0"]
    assert [words for _, words in second[1:]] == [
        ["25.0"], ["2.00"], ["6.00"], ["10.0"], [DASH], ["12.5"], ["5.00"], ["4.00"], ["9.00"],
    ]  # fmt: skip
    assert len(page.tables["moving-1"]) == 2
    assert re.findall(r'id="moving-\d">\s*<caption>([^<]*)', html) == ["slide &lt;i&gt;", "tap"]
    for words in ("2 that change in time", "a ball; 7 static presses, interpolated within 0.25 %", "up to 30 Hz",
                  "resonance is 950 Hz", "too fast", "roll: it rolls away"):  # fmt: skip
        assert words in text
    drawn = re.findall(r'aria-label="Total force on the texels over time in ([^"]+)"', html)
    assert drawn == ["slide &lt;i&gt;", "tap"]
    assert html.count("force on the texels [N]") == 2


def test_names_from_files_are_text_on_the_page(rich):
    html, text = rich
    assert "<h1>&lt;i&gt;\u00b5 pad</h1>" in html
    assert "<i>" not in html
    assert "<i>\u00b5 pad: softcover report" in text


def test_a_case_whose_error_is_not_known_is_not_the_largest_error(rich):
    _, text = rich
    assert "The largest error of 2 cases: box (" in text
    assert f"misplaced {DASH} %" in text  # in the card of the other case


def test_only_cases_with_a_picture_link_to_it_and_the_page_says_what_is_missing(rich):
    html, text = rich
    assert re.findall(r'<a href="(case[^"]+)"><img class="picture" src="([^"]+)"', html) == [
        ("case-02.png", "case-02.png")
    ]
    assert re.findall(r"<h3>(.*?)</h3>", html.split("<img")[0])[-1] == "box"  # the card of the picture
    assert re.findall(r'<img class="picture"[^>]* alt="([^:]+):', html) == ["box"]
    assert "1 further case is not drawn." in text


def find_sections(html):
    """Summary of each folded section, by its id; none is open before a reader opens it."""
    found = re.findall(r"<details([^>]*)>\s*<summary>(.*?)</summary>", html, re.DOTALL)
    assert all(re.fullmatch(r' id="[^"]+"', attributes) for attributes, _ in found)
    texts = (" ".join(unescape(re.sub(r"<[^>]+>", " ", summary)).split()) for _, summary in found)
    return dict(zip((attributes[5:-1] for attributes, _ in found), texts, strict=True))


def test_each_folded_section_says_what_it_finds(rich, evaluation, tmp_path, monkeypatch):
    monkeypatch.setattr(page_module, "render_svg", lambda *_: "<svg></svg>")
    monkeypatch.setattr(page_module, "_draw_maps", lambda _: {"images": [], "bars": ""})
    sections = find_sections(rich[0])
    findings = evaluation.verdict.findings
    met = sum(each.status == "met" for each in findings)
    assert sections["criterion"] == f"Acceptance criterion {met} of {len(findings)} requirements met"
    expected = {
        "campaign": "fast model 2.5 % of the load misplaced, no spread 5.5 %", "comparison": "3 published models",
        "cases": "2 presses, each by both models", "uncertainty": "1 of 3 errors would show on a real cover",
        "verification": "1 of 2 checks passed", "limiting": "spread, 1.9 % of the load",
        "domain": "0.98 N to 4.9 N", "recordings": "none scored", "left-out": "2 lines",
        "responses-of-texels": f"sigma {1e3 * evaluation.derivation.sigma:.3g} mm",
    }  # fmt: skip
    assert [name for name, words in expected.items() if words not in sections[name]] == []
    bare = dataclasses.replace(evaluation.evidence, errors=(), stages=None, failed=(), left_out=(), checks=(), notes={})
    campaign = dataclasses.replace(evaluation.campaign, published=())
    html, text = show(dataclasses.replace(evaluation, evidence=bare, campaign=campaign), tmp_path)
    sections = find_sections(html)
    assert "moving" not in sections
    assert sections["left-out"].endswith("nothing")
    assert sections["uncertainty"].endswith("not computed")
    assert sections["limiting"].endswith("not computed")
    assert sections["comparison"].endswith("none scored")
    assert "The stages are not scored" in text
    assert "No inputs were propagated" in text
    page = Page()
    page.feed(html)
    assert {"errors-table", "stages", "codes", "comparison-table"}.isdisjoint(page.tables)
    assert {"groups", "domain", "requirements", "pooled"} <= set(page.tables)


def test_the_page_says_when_it_was_made(evaluation):
    made = datetime.strptime(contents(evaluation)["made"], "%Y-%m-%d %H:%M UTC").replace(tzinfo=UTC)
    assert abs(datetime.now(UTC) - made) < timedelta(minutes=2)


def test_a_page_that_lacks_a_value_is_not_written(tmp_path):
    with pytest.raises(Exception, match="is undefined"):
        render_page("sweep.html.j2", {}, tmp_path)


def test_micrometres_have_their_letter_on_the_page_and_its_files_stand_beside_it(tmp_path):
    shown = {
        "sensor": "s",
        "versions": {"softcover": "1"},
        "sentences": ["an error of 3 um"],
        "table": None,
        "maps": [],
    }
    render_page("sweep.html.j2", shown, tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "an error of 3 \u00b5m" in text
    assert {each.name for each in tmp_path.iterdir()} == {"index.html", "report.css", "report.js"}
    assert "details" in (tmp_path / "report.css").read_text()
    assert "sortable" in (tmp_path / "report.js").read_text()


def make_row(model, kind, mean, *, gains=False, skill=None):
    names = [field.name for field in dataclasses.fields(CountScore)]
    pooled = {name: Pooled(mean=mean * (k + 1), low=math.nan, high=math.nan, level=0.95, cases=1)
              for k, name in enumerate(names)}  # fmt: skip
    return RecordingRow(
        split="near by", model=model, kind=kind, texel_gains=gains, fitted=(), parameters={}, electronics=None,
        per_case={}, pooled=pooled,
        skill={} if skill is None else {"zeros": Pooled(mean=skill, low=0, high=1, level=0.95, cases=6)},
    )  # fmt: skip


def test_the_table_of_a_split_says_what_kind_each_model_is_and_its_skill():
    rows = [make_row("zeros", "null", 0.1), make_row("repeats", "floor", 0.2),
            make_row("fast model", "model", 0.3, skill=0.456),
            make_row("fast model", "model", 0.4, gains=True, skill=0.2)]  # fmt: skip
    pooled = rows[0].pooled
    table = tabulate_recordings("near by", rows, "zeros")
    assert (table.name, list(table.texts)) == ("recordings-near-by", [1])
    assert "not fitted" in table.caption
    assert list(table.headings) == [
        "model", "kind", "image changed [%]", "relative L2 [%]", "total counts [%]", "centre of counts [mm]",
        "Wasserstein-1 [mm]", "active-area IoU", "skill",
    ]  # fmt: skip
    assert [row[1].text for row in table.rows] == ["null", "repeatability", "", "with texel gains"]
    assert [row[-1].text for row in table.rows] == [DASH, DASH, "0.46", "0.20"]
    assert [row[-1].text for row in tabulate_recordings("near by", rows, "mean").rows] == [DASH] * 4
    assert [cell.value for cell in table.rows[0][2:4]] == pytest.approx(
        [pooled["image_changed_percent"].mean, pooled["relative_l2"].mean]
    )
    assert table.rows[2][2].small == "1 case, no interval"


def test_comparison_errors_of_a_split_have_their_own_table(evaluation):
    from tests.validation.report.test_by_hand import FINDINGS, judge_by_hand, make_recordings
    from validation.campaign.evaluation import RecordingEvaluation

    error = ComparisonError(case="far away A", quantity="largest texel [counts]", factor=1.0, fast=150.0,
                            reference=100.0, u_num=1.0, u_input=12.0, u_data=5.0)  # fmt: skip
    recordings = dataclasses.replace(make_recordings(), errors={"far away": (error,)})
    recorded = RecordingEvaluation(
        verdict=judge_by_hand(FINDINGS[0]), recordings=recordings, recorded=load("sdh2-distal"), seconds={}, versions={}
    )
    near, far = contents(recorded)["splits"]
    assert near["errors"].rows == []
    table = far["errors"]
    assert table.name == "errors-far-away"
    assert "with texel gains S against recorded counts D" in table.caption
    assert [each.partition(" [")[0] for each in table.headings] == [
        "case and quantity", "S", "D", "E", "u_num", "u_input", "u_D", "u_val", "E - 2 u_val", "E + 2 u_val",
        "|E| > u_val: resolved on a real cover",
    ]  # fmt: skip
    (row,) = table.rows
    both = math.sqrt(1 + 144 + 25)
    values = [150, 100, 50, 1, 12, 5, both, 50 - 2 * both, 50 + 2 * both]
    assert [cell.value for cell in row[1:-1]] == pytest.approx(values)
    assert row[-1].text == "yes"
    assert (near["notes"], far["notes"]) == (("a note",), ())
    assert [each["name"] for each in (near, far)] == ["near", "far away"]


def test_evidence_without_inputs_or_stages_has_no_such_tables(evaluation):
    bare = dataclasses.replace(evaluation.evidence, inputs={}, stages=None, domain={})
    assert {"inputs", "stages", "domain"}.isdisjoint(list_tables(dataclasses.replace(evaluation, evidence=bare)))


def test_the_floor_of_the_reference_names_the_misplaced_force_where_it_is_known(evaluation):
    floor = {"misplaced_force": 0.0123, "peak_texel": 0.5}
    cases = tuple(
        dataclasses.replace(each, reference=dataclasses.replace(each.reference, error_estimate=floor))
        for each in evaluation.campaign.cases
    )
    campaign = dataclasses.replace(evaluation.campaign, noise_floor=floor, cases=cases)
    table = list_tables(dataclasses.replace(evaluation, campaign=campaign))["case-table"]
    assert table.headings[-1] == "estimated error of the reference [% of the load, on wrong texels]"
    assert [(row[-1].text, row[-1].value) for row in table.rows] == [("1.2", 0.0123)] * 2
    for row, each in zip(table.rows, cases, strict=True):
        lit = each.predictions["fast"].score.pixels_lit_line
        assert (row[12].text, row[12].value) == (str(lit), lit)
        assert row[0].text == each.case.name
        assert row[13].value == each.reference.depth
        assert float(row[13].text) == pytest.approx(1e3 * each.reference.depth, rel=0.01)


def test_a_map_of_responses_is_drawn_for_each_load_and_for_the_error_of_the_kernel(evaluation):
    array = evaluation.sensor.array
    uniform, kernel = np.zeros(84), np.zeros(84)
    uniform[45], kernel[45], kernel[46] = 0.5, 0.44, 0.02
    maps = {"point": 2 * uniform, "uniform": uniform, "kernel": kernel}
    found = page_module._draw_maps(SimpleNamespace(sensor=SimpleNamespace(array=array), maps=maps))
    assert [name for name, _ in found["images"]] == ["point", "uniform", "kernel", "kernel \u2212 reference"]
    labels = [unescape(re.search(r'aria-label="([^"]+)"', svg)[1]) for _, svg in found["images"]]
    assert labels == [
        "point: 84 texels; largest 100 % of the load in row 7, column 3",
        "uniform: 84 texels; largest 50 % of the load in row 7, column 3",
        "kernel: 84 texels; largest 44 % of the load in row 7, column 3",
        "kernel \u2212 reference: 84 texels; largest -6 % of the load in row 7, column 3",
    ]
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', found["bars"])
    assert ends == [("0", "50 % of the load"), ("\u22126", "6 % of the load")]
