"""The page, its tables and its images against numbers worked out by hand."""

import dataclasses
import math
import re

import numpy as np
import pytest

from tests.support.made_up_evaluation import PUBLISHED, make_row
from validation.campaign.evaluation import RecordingEvaluation
from validation.campaign.results import SkippedCase
from validation.credibility.stages import StageErrors
from validation.data_sets.results import CountScore, RecordingExample, RecordingRow, RecordingScores
from validation.pooling import Pooled, pool
from validation.report.page import contents, describe_comparison, list_inputs, list_tables, name_limits, write_report
from validation.sensor_file import load
from validation.verdict import Finding, Verdict

DASH = "\u2013"


@pytest.fixture(scope="module")
def tables(evaluation):
    return list_tables(evaluation)


@pytest.fixture(scope="module")
def text(folder):
    return " ".join(re.sub(r"<[^>]+>", " ", (folder / "index.html").read_text()).split())


def read(table):
    """Rows of printed texts; the second line of a cell stands behind a bar, and an emphasised text in stars."""
    return [
        [("*{}*" if cell.bold else "{}").format(cell.text) + (f"|{cell.small}" if cell.small else "") for cell in row]
        for row in table.rows
    ]


TABLES = {
    "codes": [
        ["waves|against: transfer matrices", "8.0", "2.0", "0.50", "2.0|at least 1.5", "0.31|limit 0.004", "passed"],
        ["disk|against: a series", "9.0", "6.0", "4.0", "0.58|at least 0.7", "2.5|limit 0.02", "*failed*"],
    ],
    "solutions": [
        ["sphere|depth [\u00b5m]", "310.00", "321.00", "323.40", "324.51", "2.1", "0.62"],
        ["box|peak texel [mN]", "490.00", "495.10", "501.23", DASH, DASH, "1.7"],
    ],
    "errors-table": [
        ["sphere|largest texel force [mN]", "1900", "2100", "-200", "150", "200", "600", "650", "yes", "no"],
        ["box|centre x [mm]", "0.8000", "0.7000", "0.10", "0.030", "0.040", "0", "0.050", "yes", "yes"],
        ["box|sum [N]", "0.8700", "0.8250", "0.045", "0.060", DASH, "0", DASH, "no", DASH],
    ],
    # The k-th input raises a texel by 0.01 k N and lowers another by less: 0.01 k over the load is misplaced.
    "inputs": [
        ["sphere", "0.20", "0.41", "0.61", "0.82", "1.0", "1.5"],
        ["box", "2.0", "4.1", "6.1", "8.2", "10", "15"],
    ],
    "stages": [
        ["cover|linear cover at zero load instead of finite strain", "0.2|2 cases, no interval", "0.30|box"],
        ["spread|tables from cells to texels instead of finite elements, under the reference's contact forces",
         "1.9|2 cases, no interval", "2.1|sphere"],
        ["contact|contact forces of the fast model instead of the reference's", "1.6|2 cases, no interval", "1.9|box"],
        ["electronics|counts instead of forces: rounding, threshold and saturation, without noise",
         "5.0|2 cases, no interval", "6.0|box"],
    ],
    "groups": [
        ["2 N and more|load", "3", "21.0|18.9 to 27.3", "0.22|0.20 to 0.29", "230.000|207.000 to 299.000"],
        ["below 2 N|load", "4", "31.0|27.9 to 40.3", "0.32|0.29 to 0.42", "330.000|297.000 to 429.000"],
        ["turned|pose", "3", "21.0|18.9 to 27.3", "0.22|0.20 to 0.29", "230.000|207.000 to 299.000"],
    ],
    "domain": [
        ["load [N]", "0.981", "4.90"],
        ["depth of the indenter over the thickness of the cover [%]", "4.50", "16.0"],
        ["contact area [mm\u00b2]", "21.0", "60.0"],
        ["angle between the motion and the normal of the cover [\u00b0]", "0", "30.0"],
        ["share of the load that acts outside the array [%]", "0", "12.0"],
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_table_of_evidence_prints_what_is_worked_out_by_hand(tables, name):
    assert read(tables[name]) == TABLES[name]
    assert tables[name].name == name
    assert all(len(row) == len(tables[name].headings) for row in tables[name].rows)


HEADINGS = {
    "inputs": ["case", "modulus", "Poisson ratio", "position x", "yaw", "friction", "all, in quadrature"],
    "groups": ["group", "cases", "misplaced force [%]", "image changed [%]", "centre of pressure [mm]"],
    "solutions": ["case and quantity", "coarse", "middle", "fine", "result", "observed order", "estimated error [%]"],
    "codes": ["what", "coarse [%]", "middle [%]", "fine [%]", "observed order", "error of the result [%]", ""],
}


@pytest.mark.parametrize("name", HEADINGS)
def test_the_headings_name_quantities_and_units(tables, name):
    assert list(tables[name].headings) == HEADINGS[name]


def test_the_table_of_comparison_models_names_parameters_units_and_fits(tables):
    rows = read(tables["comparison-table"])
    assert [row[0].split("|")[0] for row in rows] == [
        "fast (ours)", "foundation (ours)", "boxes (ours)", "no-spread (null model)", "zeros (null model)",
        "Cone, as fitted", "Grid, as shipped", "Wave, as fitted",
    ]  # fmt: skip
    assert rows[0][1] == f"{DASH}|fitted: by the derivation alone"
    assert [row[0].split("|")[1] for row in rows[5:7]] == [
        "points; a cone; sure of it: code", "points; a cone; sure of it: code; sum: a half of the load",
    ]  # fmt: skip
    assert [row[1] for row in rows[5:7]] == [
        "cone angle 0.524 rad, stiffness 1.2e+09 Pa/m|fitted: cone angle, stiffness, on 2 presses",
        f"{DASH}|fitted: nothing",
    ]
    # the means are (0.05 + 0.01 k) 4 of the k-th metric of the tables, from 0.9 to 1.3 times the mean
    assert rows[5][2:] == [
        "20.0|18.0 to 26.0", "0.44|0.40 to 0.57", "0.48|0.43 to 0.62", "360.000|324.000 to 468.000",
    ]  # fmt: skip


def test_without_published_models_their_table_is_left_out(evaluation):
    campaign = dataclasses.replace(evaluation.campaign, published=())
    assert "comparison-table" not in list_tables(dataclasses.replace(evaluation, campaign=campaign))


def test_a_model_is_as_good_unless_the_whole_interval_of_the_skill_is_positive(evaluation):
    edge = make_row("edge", ((0.0, 0.2, 6), (-0.2, 0.0, 6), (1e-9, 0.2, 6)), fitted_on=("another press",))
    campaign = dataclasses.replace(evaluation.campaign, published=(*PUBLISHED[1:], edge))
    assert describe_comparison(campaign) == {
        "as_good": {
            "misplaced force": [
                "Grid as shipped (better)", "Wave as fitted (not told apart)", "Edge as fitted (not told apart)",
            ],
            "image changed": [
                "Grid as shipped (not told apart)", "Wave as fitted (not told apart)",
                "Edge as fitted (not told apart)",
            ],
            "image changed, WTS line": [],
        },
        "presses": ("a ball, 3 N", "a punch, 2 N"),
        "not_built": {"Grid": "creep"},
    }  # fmt: skip


def test_inputs_are_named_with_their_units(evaluation):
    evidence = evaluation.evidence
    assert list_inputs(evidence) == [
        "modulus 12.3 %", "Poisson ratio 0.0045", "position x 0.15 mm", "yaw 2\u00b0",
        "friction uniform from none to a coefficient of 0.75",
    ]  # fmt: skip
    (case, first), *_ = evidence.inputs.items()
    endless = dataclasses.replace(first, uncertainties={"thickness [relative]": 0.517, "friction": math.inf})
    assert list_inputs(dataclasses.replace(evidence, inputs={case: endless})) == [
        "thickness 51.7 %", "friction uniform from none to no slip",
    ]  # fmt: skip
    assert list_inputs(dataclasses.replace(evidence, inputs={})) == []


def test_the_limiting_stage_is_that_of_the_largest_mean_besides_the_electronics(evaluation):
    found = name_limits(evaluation.evidence)
    assert found["stage"] == "spread"
    assert found["error"] == pytest.approx(1.9)
    assert found["hidden"] == pytest.approx(5.0)
    assert found["inputs"] == pytest.approx(100 * math.sqrt(55) * (0.01 / 4.903325 + 0.02 / 0.980665) / 2)
    pooled = {"cover": pool([]), "spread": pool([0.01]), "contact": pool([0.02]), "electronics": pool([0.3])}
    bare = dataclasses.replace(evaluation.evidence, stages=StageErrors(cases={}, pooled=pooled), inputs={})
    found = name_limits(bare)
    assert (found["stage"], found["error"]) == ("contact", pytest.approx(2.0))
    assert math.isnan(found["inputs"])
    assert name_limits(dataclasses.replace(bare, stages=None)) == {}


SENTENCES = (
    "84 texels in 6 columns \u00d7 14 rows, pitch 3.4 \u00d7 3.4 mm",
    "2 indentations, none of them used in the fit",
    "depth 0.2 %, texel forces 0.5 % of the peak texel",
    "Scored with 0.98 N to 4.9 N.",
    "fast model 2.5 % of the load misplaced, no spread 5.5 %",
    "2 of 3 errors exceed u_num",
    "1 of 3 exceed u_val",
    "1 of 3 errors would show on a real cover",
    "modulus 12.3 %, Poisson ratio 0.0045, position x 0.15 mm, yaw 2\u00b0",
    "1 of 2 checks passed",
    "Of the fast model's own stages, spread has the largest mean error, 1.9 % of the load",
    "the uncertain inputs change the image by 8.3 %",
    "The electronics hide 5 % of the load",
    "The largest error of 2 cases: box (",
    "0.981 N at (0.7, -1.1) mm, 45\u00b0), 4.0 % of 0.981 N misplaced",
    "3 published models and variants",
    "by misplaced force: Grid as shipped (better), Wave as fitted (not told apart); ",
    "The radial profile differs from the closed-form layer solution by 0.12 %",
    "friction: none, strain: small",
    "One section has no meaning",
    "Missing: a check did not converge.",
    "derive 4.5 s, campaign 31.2 s",
    "Fitted rows: least mean misplaced force on a ball, 3 N; a punch, 2 N;",
    "Grid: creep.",
    "2 presses, each by both models",
)


@pytest.mark.parametrize("sentence", SENTENCES)
def test_the_sentences_hold_the_numbers_of_the_results(text, sentence):
    assert sentence.lower() in text.replace(" ,", ",").replace(" .", ".").lower()


def test_the_images_of_a_case_share_a_scale_and_name_their_largest_texel(folder):
    page = (folder / "index.html").read_text()
    card = page.split("<h3>sphere</h3>")[1].split("<h3>box</h3>")[0]
    assert re.findall(r'aria-label="(sphere,[^"]+)"', card) == [
        "sphere, finite elements, forces: 84 texels; largest 2100 mN in row 2, column 3",
        "sphere, fast model, forces: 84 texels; largest 1900 mN in row 2, column 3",
        "sphere, difference, forces: 84 texels; largest -200 mN in row 2, column 3",
    ]
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', card)
    assert ends == [("0", "2100 mN"), ("\u2212200", "200 mN")]
    colours = [dict(re.findall(r'fill="(#\w+)"><title>\[2, ([34])\]', each)) for each in card.split("<svg")[1:]]
    # the largest of both images has the last colour in the first image only; the difference is lowest there
    assert colours[0]["#fdf3a1"] == "3"
    assert "#fdf3a1" not in colours[1]
    assert colours[2]["#0b4f8a"] == "3"
    box = page.split("<h3>box</h3>")[1].split("</div>\n</div>")[0]
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', box)
    assert ends[:2] == [("0", "560 mN"), ("\u221260", "60 mN")]
    assert "misplaced 1.0 %" in " ".join(card.split())


def test_the_outline_of_a_contact_is_its_hull_where_the_texels_are(folder, wts):
    page = (folder / "index.html").read_text()
    svg = next(each for each in page.split("<svg")[1:] if "sphere, finite elements" in each)
    points = re.search(r'<polygon points="([^"]+)"', svg)[1].split()
    drawn = np.array([point.split(",") for point in points], dtype=float)
    squares = {
        (int(row), int(column)): (float(x) + float(edge) / 2, float(y) + float(edge) / 2)
        for x, y, edge, row, column in re.findall(
            r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"[^>]*><title>\[(\d+), (\d+)\]', svg
        )
    }
    x0, y0 = squares[0, 0]
    per_metre = (squares[0, 5][0] - x0) / (5 * 3.4e-3)
    low = wts.centres[0]
    expected = [
        (x0 + per_metre * (x - low[0]), y0 - per_metre * (y - low[1]))
        for x, y in ((-1e-3, -2e-3), (3e-3, -2e-3), (3e-3, 4e-3), (-1e-3, 4e-3))
    ]
    assert len(drawn) == 4
    np.testing.assert_allclose(sorted(drawn.tolist()), sorted(expected), atol=0.15)


def test_the_responses_share_one_scale_and_their_difference_has_its_own(folder, wts_derivation):
    page = (folder / "index.html").read_text()
    card = page.split("Forces on the texels under a unit force over one of them")[1].split("Finest mesh")[0]
    *_, uniform, kernel = wts_derivation.maps.values()
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', card)
    apart = 100 * np.abs(kernel - uniform).max()
    assert ends[:2] == [
        ("0", f"{100 * uniform.max():.4g} % of the load"),
        (f"\u2212{apart:.4g}", f"{apart:.4g} % of the load"),
    ]
    captions = re.findall(r"<figcaption>([^<]+)</figcaption>", card)
    assert captions == [*wts_derivation.maps, f"{list(wts_derivation.maps)[-1]} \u2212 reference"]


def find(metric, status, value, limit, *, low=None, high=None, over="mean over the cases", cases=6):
    return Finding(
        metric=metric, over=over, value=value, low=value if low is None else low, high=value if high is None else high,
        limit=limit, status=status, cases=cases,
    )  # fmt: skip


FINDINGS = (
    find("misplaced_force", "met", 0.04, 0.06, low=0.03, high=0.045),
    find("peak_error", "met", 0.1, 0.3, over="ball", cases=1),
    find("centre_of_pressure_m", "missed", 1.25e-4, 1e-4, low=1.1e-4, high=1.4e-4),
    find("image_changed_percent", "open", 1.9, 2.0, low=1.5, high=2.3),
    find("wasserstein_m", "missed", 3.5e-4, 2e-4),
)


def judge_by_hand(*findings, reasons=()):
    return Verdict(
        word="not accepted", reasons=(*reasons, *(each.text for each in findings if each.status == "missed")),
        findings=findings, scored=6, cases=7, compared={"finite elements": "6 of 7 cases"},
    )  # fmt: skip


def show(*findings, **options):
    given = RecordingEvaluation(
        verdict=judge_by_hand(*findings, **options), recordings=None, recorded=load("wts-0614-34"), seconds={},
        versions={},
    )  # fmt: skip
    return contents(given)


def test_requirements_are_printed_in_the_units_of_their_metric():
    assert read(show(*FINDINGS)["tables"]["requirements"]) == [
        ["misplaced force|mean over the cases", "4.00 %|3 to 4.5 %", "6 %", "1.50 %", "met"],
        ["peak|ball", "10.0 %", "30 %", "20.0 %", "met"],
        ["centre of pressure|mean over the cases", "0.125 mm|0.11 to 0.14 mm", "0.1 mm", "-0.0400 mm", "*missed*"],
        ["image changed|mean over the cases", "1.90 %|1.5 to 2.3 %", "2 %", "-0.300 %", "*not decided*"],
        ["Wasserstein-1|mean over the cases", "0.350 mm", "0.2 mm", "-0.150 mm", "*missed*"],
    ]


def test_the_first_screen_lists_what_is_missed_before_what_is_open_and_met():
    shown = show(*FINDINGS, reasons=("something is missing",))
    assert [row[0].text for row in shown["first"].rows] == ["Wasserstein-1", "image changed", "misplaced force"]
    assert [cells[0].text for cells, _ in shown["keys"]] == ["centre of pressure"]
    assert shown["doubts"] == ["something is missing"]
    many = [find("peak_error", "open", 0.1 + 0.01 * k, 0.3, over=f"case {k}", cases=1) for k in range(11)]
    shown = show(FINDINGS[2], *many)
    assert [row[0].small for row in shown["first"].rows] == [f"case {k}" for k in range(8)]


@pytest.mark.parametrize(
    ("finding", "places"),  # of 300: the line ends 15 % beyond the largest of limit, value and interval
    [
        (FINDINGS[0], {"low": 150 / 1.15, "high": 225 / 1.15, "value": 200 / 1.15, "limit": 300 / 1.15}),
        (FINDINGS[2], {"low": 330 / 1.61, "high": 300 / 1.15, "value": 375 / 1.61, "limit": 300 / 1.61}),
        (find("peak_error", "open", 0.05, 0.02, low=math.nan, high=math.nan),
         {"low": 0, "high": 0, "value": 300 / 1.15, "limit": 120 / 1.15}),
        (find("peak_error", "met", 0.0, 0.0), {"low": 0, "high": 0, "value": 0, "limit": 0}),
        (find("peak_error", "open", 0.02, 0.04, low=-0.03, high=0.05),
         {"low": 0, "high": 300 / 1.15, "value": 120 / 1.15, "limit": 240 / 1.15}),
    ],
)  # fmt: skip
def test_a_requirement_is_drawn_to_scale(finding, places):
    ((_, line),) = show(finding)["keys"]
    low, high = re.search(r'class="interval" d="M([\d.]+) 9H([\d.]+)"', line).groups()
    value, limit = re.search(r'cx="([\d.]+)"', line)[1], re.search(r'class="end" d="M([\d.]+) ', line)[1]
    found = dict(zip(("low", "high", "value", "limit"), map(float, (low, high, value, limit)), strict=True))
    assert found == pytest.approx(places, abs=0.051)


def make_recordings():
    """Two splits of two loads; in the second one other null models are best, and the images are others."""

    def score(value):
        names = [field.name for field in dataclasses.fields(CountScore)]
        return CountScore(**dict.fromkeys(names, value))

    def row(split, model, value, *, kind="null", gains=False):
        per_case = {f"{split} 1 N": score(value), f"{split} 5 N": score(value + 1)}
        names = [field.name for field in dataclasses.fields(CountScore)]
        pooled = {name: pool([getattr(each, name) for each in per_case.values()]) for name in names}
        skill = {"zeros": Pooled(mean=0.75, low=0.7, high=0.8, level=0.95, cases=2),
                 "mean image": Pooled(mean=0.25, low=0.2, high=0.3, level=0.95, cases=2)}  # fmt: skip
        return RecordingRow(
            split=split, model=model, kind=kind, texel_gains=gains, fitted=() if kind == "null" else ("a", "b"),
            parameters={"x [mm]": value / 3}, per_case=per_case, pooled=pooled, skill=skill if kind == "model" else {},
            electronics=None,
        )  # fmt: skip

    def image(**values):
        out = np.zeros((13, 6), dtype=np.uint8)
        for place, value in values.items():
            out[int(place[1:-1], 10), int(place[-1])] = value
        return out

    rows = [
        [row(split, "zeros", zeros), row(split, "mean image", mean), row(split, "repeats", 0.1, kind="floor"),
         row(split, "fast model", 4.0, kind="model"), row(split, "fast model", own, kind="model", gains=True)]
        for split, zeros, mean, own in (("near", 9.0, 2.0, 3.0), ("far away", 1.0, 6.0, 5.0))
    ]  # fmt: skip
    predicted = {
        "fast model": image(r32=150, r43=30), "fast model, texel gains": image(r32=190), "other": image(r32=255),
        "mean image": image(r32=90, r53=220), "zeros": image(),
    }  # fmt: skip
    examples = [
        RecordingExample(split=split, case=f"{split} A", load=peak / 40, recorded=image(r32=peak), predicted=predicted)
        for split, peak in (("near", 200), ("far away", 80))
    ]
    return RecordingScores(
        name="made up", rows=tuple(rows[0] + rows[1]), examples=tuple(examples),
        about={"near": "a near one", "far away": "a far one", "zeros": "no force"}, notes={"near": ("a note",)},
        files={"a": "1", "b": "2", "c": "3"}, noise=2.345, source="nowhere", problems=("x: left out",),
        left_out={"far away": {"seat": (3.0, 2.0, 1.0)}},
    )  # fmt: skip


@pytest.fixture(scope="module")
def recorded():
    return RecordingEvaluation(
        verdict=judge_by_hand(FINDINGS[0]), recordings=make_recordings(), recorded=load("sdh2-distal"), seconds={},
        versions={"softcover": "1"},
    )  # fmt: skip


def test_each_split_names_its_best_null_model_and_its_skill(recorded):
    near, far = contents(recorded)["splits"]
    assert (near["null"], near["finding"]) == ("mean image", "image changed: fast model 3.5 %, best null model 2.5 %")
    assert (far["null"], far["finding"]) == ("zeros", "image changed: fast model 5.5 %, best null model 1.5 %")
    assert [row[0] + row[1] for row in read(near["table"])] == [
        "zerosnull", "mean imagenull", "repeatsrepeatability", "fast model", "fast modelwith texel gains",
    ]  # fmt: skip
    assert [row[-1] for row in read(near["table"])] == [DASH, DASH, DASH, "0.25", "0.25"]
    assert [row[-1] for row in read(far["table"])] == [DASH, DASH, DASH, "0.75", "0.75"]
    assert [row[2].split("|")[0] for row in read(far["table"])] == ["1.50", "6.50", "0.600", "4.50", "5.50"]
    assert (near["fitted"], near["scored"]) == ("a, b", "near 1 N, near 5 N")
    assert near["left_out"] == ""
    assert far["left_out"].startswith("<svg")
    assert 'width="288pt" height="158.4pt"' in far["left_out"]
    assert far["parameters"] == {
        "fast model": {"x [mm]": pytest.approx(4 / 3)}, "fast model, texel gains": {"x [mm]": pytest.approx(5 / 3)},
    }  # fmt: skip


def test_the_images_of_a_recording_share_a_scale_of_greys_and_differ_by_model_minus_recorded(recorded):
    near, far = contents(recorded)["splits"]
    images = near["images"]["images"]
    assert [name for name, _, _ in images] == ["recorded", "fast model", "fast model, texel gains", "mean image"]
    labels = [re.search(r'aria-label="([^"]+)"', svg)[1] for _, *both in images for svg in both if svg]
    assert [label.partition("; ")[2] for label in labels] == [
        "largest 200 grey in row 3, column 2",
        "largest 150 grey in row 3, column 2", "largest -50 grey in row 3, column 2",
        "largest 190 grey in row 3, column 2", "largest -10 grey in row 3, column 2",
        "largest 220 grey in row 5, column 3", "largest 220 grey in row 5, column 3",
    ]  # fmt: skip
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', near["images"]["bars"])
    assert ends == [("0", "220 grey"), ("\u2212220", "220 grey")]
    ends = re.findall(r'class="bar"><span>([^<]+)</span>.*?<span>([^<]+)</span></span>', far["images"]["bars"])
    assert ends == [("0", "190 grey"), ("\u2212110", "110 grey")]


def test_a_page_of_recordings_alone_shows_the_first_example_and_the_counts(recorded, tmp_path):
    write_report(recorded, tmp_path)
    text = " ".join(re.sub(r"<[^>]+>", " ", (tmp_path / "index.html").read_text()).split())
    shown = contents(recorded)["picture"]
    assert shown["title"] == "near A, 5.00 N"
    assert [name for name, _ in shown["images"]] == ["recorded", "fast model", "fast model \u2212 recorded"]
    for words in ("made up, 2 splits", "3 recordings; noise 2.3 counts", "68 active texels", "left out: x: left out",
                  "near A, 5.00 N: recorded", "far away A, 2.00 N: recorded", "x [mm] 1.333",
                  "zeros : no force"):  # fmt: skip
        assert words in text, words
    assert not (tmp_path / "scores.csv").exists()


def test_a_run_that_was_interrupted_says_how_many_cases_are_missing(evaluation, tmp_path):
    skipped = tuple(
        SkippedCase(name=name, indenter="", load=1.0, reason="interrupted", converged=True) for name in ("x", "y", "z")
    )
    campaign = dataclasses.replace(evaluation.campaign, interrupted=True, skipped=skipped)
    write_report(dataclasses.replace(evaluation, campaign=campaign), tmp_path)
    text = " ".join(re.sub(r"<[^>]+>", " ", (tmp_path / "index.html").read_text()).split())
    assert "The run was interrupted: 3 cases are missing." in text
    assert "x: interrupted; y: interrupted; z: interrupted" in text
