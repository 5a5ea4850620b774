"""A made-up laboratory with known coefficients, gains and poses: no null model is ahead of the forward model.

Counts scatter, so that two numbers per texel (a line) are worse known than one (a gain), and the texels have a dead
force, so that no image is another one times the ratio of the loads.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
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
from validation.calibration.model import Pose
from validation.campaign.campaign_file import read_campaign
from validation.campaign.evaluation import evaluate_recordings
from validation.data_sets import score
from validation.places import FlatPlaces
from validation.report import write_report
from validation.results.report import read_report
from validation.sensor_file import load

pytestmark = pytest.mark.slow

SENSOR = dataclasses.replace(load("wts-0614-34"), array=ARRAY)
WARM, DEAD_WARM = 0.012, -0.0008
HOME, MOVED = Pose(1e-3, -2e-3), Pose(2.6e-3, -0.9e-3)
#: Temperature [degC], pose and loads [N] of each series.
SERIES = {
    "cold": (22.0, HOME, (3.0, 5.0, 7.0, 9.0, 12.0, 15.0, 18.0, 21.0)),
    "warm": (34.0, HOME, (4.0, 8.0, 12.0, 16.0)),
    "hot": (43.0, HOME, (6.0, 10.0, 14.0, 18.0)),
    "moved": (22.0, MOVED, (6.0, 10.0, 14.0, 18.0)),
}
FILE = f"""
name = "made up"
indenter = "{STAMP_TEXT}"
window = [4, 8]
[[series]]
name = "cold"
files = "cold/*"
placement = "home"
[[series]]
name = "warm"
files = "warm/*"
placement = "home"
[[series]]
name = "hot"
files = "hot/*"
placement = "home"
[[series]]
name = "moved"
files = "moved/*"
[[split]]
name = "heavier"
fit = {{ series = "cold", most = "9 N" }}
score = {{ series = "cold", least = "12 N" }}
[[split]]
name = "third temperature"
fit = ["cold", "warm"]
score = "hot"
[[split]]
name = "moved stamp"
fit = ["cold", "warm"]
place = {{ series = "moved", least = "10 N", most = "10 N" }}
score = [{{ series = "moved", most = "6 N" }}, {{ series = "moved", least = "14 N" }}]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laboratory")
    random = np.random.default_rng(11)
    curve = dataclasses.replace(make_curve(draw_gains(random), warm=WARM, dead_warm=DEAD_WARM), dead_force=0.05)
    for name, (degrees, pose, loads) in SERIES.items():
        for number, newtons in enumerate(loads):
            degrees_now = degrees + random.normal(0, 0.3)
            options = {"temperature": degrees_now, "scatter": 0.005, "noise": 60.0, "seconds": 10.0, "rate": 3.0}
            recording = press(uniform_method(), curve, newtons, pose, random=random, **options)
            write(recording, folder / name / f"{number}.{'csv' if number % 2 else 'mcap'}")
    return folder


def score_file(monkeypatch, folder, text):
    """Score the splits of a data-set file by one forward model, of uniform pressure."""
    monkeypatch.setattr(score, "list_methods", lambda *_: {score.FAST: uniform_method()})
    return score.score_recordings(write_data_set(folder, text), SENSOR, fastmodel.load("wts-0614-34"))


def test_no_null_model_is_ahead_of_the_model(monkeypatch, folder):
    found = score_file(monkeypatch, folder, FILE)
    assert found.problems == ()
    for split in ("heavier", "third temperature", "moved stamp"):
        row = found.row(split, score.FAST, texel_gains=True)
        nulls = [each for each in found.rows if each.split == split and each.kind == "null"]
        assert len(nulls) == 8 + (split == "moved stamp")
        errors = {each.model: each.pooled["image_changed_percent"].mean for each in nulls}
        # At a third temperature, a line per texel with a temperature coefficient describes the counts nearly as well.
        bound = (1.05 if split == "third temperature" else 1.0) * min(errors.values())
        assert row.pooled["image_changed_percent"].mean < bound, (split, errors)
    parameters = found.row("third temperature", score.FAST, texel_gains=True).parameters
    middle = 1 + WARM * (26.0 - 30.0)  # mean temperature of the fitted recordings
    assert parameters["gain_temperature_per_K"] == pytest.approx(WARM / middle, abs=2e-3)
    moved = found.row("moved stamp", score.FAST, texel_gains=True).parameters
    shift = np.array([moved["moved x_m"] - moved["home x_m"], moved["moved y_m"] - moved["home y_m"]])
    assert shift == pytest.approx([MOVED.x - HOME.x, MOVED.y - HOME.y], abs=0.2e-3)


def test_a_split_that_cannot_be_scored_costs_a_line_and_the_rest_is_scored(monkeypatch, folder):
    """Faults of series and recordings are tested where they are read."""
    splits = """
[[split]]
name = "overlap"
fit = "cold"
score = { series = "cold", least = "12 N" }
[[split]]
name = "of nothing"
fit = "cold"
score = { series = "cold", least = "99 N" }
"""
    found = score_file(monkeypatch, folder, FILE.split('[[split]]\nname = "third', maxsplit=1)[0] + splits)
    overlap, nothing = found.problems
    assert "split 'overlap': cold 4.mcap, cold 5.csv, cold 6.mcap and others would be scored, and is fitted" in overlap
    assert "split 'of nothing': no usable recording to score" in nothing
    assert {row.split for row in found.rows} == {"heavier"}
    assert found.row("heavier", score.FAST, texel_gains=True).pooled["image_changed_percent"].mean < 1


#: The made-up laboratory for verdicts: stamp positions measured by hand, five scored loads in each split.
VERDICT = f"""
name = "made up"
indenter = "{STAMP_TEXT}"
window = [4, 8]
[[series]]
name = "home"
files = "home/*"
at = ["1 mm", "-2 mm"]
[[series]]
name = "moved"
files = "moved/*"
at = ["2.6 mm", "-0.9 mm"]
[[split]]
name = "heavier"
fit = {{ series = "home", most = "9 N" }}
score = {{ series = "home", least = "10 N" }}
[[split]]
name = "moved stamp"
fit = "home"
score = "moved"
"""
LOADS = {"home": (3.0, 4.5, 6.0, 7.5, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0), "moved": (6.0, 9.0, 12.0, 15.0, 18.0)}


def record_laboratory(folder, *, loads=LOADS, other_gains=False, method=None):
    """Record both series; with `other_gains` the moved stamp is seen by a sensor with another table of gains."""
    random = np.random.default_rng(12)
    method = method or uniform_method()
    curves = [dataclasses.replace(make_curve(draw_gains(random)), dead_force=0.05) for _ in range(2)]
    for name, pose in (("home", HOME), ("moved", MOVED)):
        curve = curves[other_gains and name == "moved"]
        for newtons in loads[name]:
            recording = press(
                method, curve, newtons, pose, random=random, scatter=0.004, noise=20.0, seconds=10.0, rate=3.0
            )
            write(recording, folder / name / f"{newtons:g}.csv")


def judge_recordings(monkeypatch, folder, text=VERDICT, *, method=None):
    """Judge the recordings alone by a forward model of uniform pressure; return the evaluation."""
    monkeypatch.setattr(score, "list_methods", lambda *_: {score.FAST: method or uniform_method()})
    data_set = write_data_set(folder, text)
    plan = read_campaign(None, FlatPlaces(array=ARRAY))
    derived = SimpleNamespace(parameters=fastmodel.load("wts-0614-34"))
    monkeypatch.setattr("validation.campaign.evaluation.derive", lambda *_, **__: derived)
    return evaluate_recordings(SENSOR, data_set, campaign=plan)


def test_right_recordings_are_accepted_and_the_headline_names_them(monkeypatch, tmp_path):
    record_laboratory(tmp_path)
    found = judge_recordings(monkeypatch, tmp_path)
    assert found.verdict.word == "accepted", found.verdict.reasons
    assert "against recordings (made up, 10 loads)" in found.verdict.sentence
    assert {each.metric for each in found.verdict.findings} == {
        "image_changed_percent",
        "relative_l2",
        "behind_null_percent",
    }
    assert {each.cases for each in found.verdict.findings} == {5}
    report = found.report.as_json()
    assert "campaign" not in report
    assert len(report["recordings"]["errors"]["moved stamp"]) == 4 * 5
    (tmp_path / "out").mkdir()
    write_report(found, tmp_path / "out")
    assert {each.name for each in (tmp_path / "out").iterdir()} == {
        "index.html",
        "report.css",
        "report.js",
        "report.json",
    }
    assert read_report(tmp_path / "out") == found.report
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert found.verdict.sentence in page
    assert "E + 2 u_val" in page
    assert 'id="campaign"' not in page
    assert all(each["margin"] == pytest.approx(each["limit"] - each["high"]) for each in report["verdict"]["findings"])


@pytest.mark.parametrize("defect", ["gains", "pose", "cover", "limit"])
def test_planted_defects_turn_the_verdict(monkeypatch, tmp_path, defect):
    """Other gains, a wrong stated pose, a cover with twice the spread, or a limit below the noise."""
    record_laboratory(tmp_path, other_gains=defect == "gains")
    text = VERDICT.replace('"2.6 mm", "-0.9 mm"', '"4.6 mm", "-0.9 mm"') if defect == "pose" else VERDICT
    if defect == "limit":
        text = text.replace("[[series]]", '[required]\nimage_changed_percent = "0.01 %"\n[[series]]', 1)
    method = uniform_method(sigma=1.0) if defect == "cover" else None
    found = judge_recordings(monkeypatch, tmp_path, text, method=method)
    assert found.verdict.word == "not accepted", (defect, found.verdict.findings)
    assert found.verdict.short.startswith("verdict: NOT ACCEPTED; fast model against recordings, made up, 10 loads: ")


@pytest.mark.parametrize("count", [1, 4])
def test_fewer_than_five_loads_decide_nothing(monkeypatch, tmp_path, count):
    record_laboratory(tmp_path, loads={"home": LOADS["home"], "moved": LOADS["moved"][:count]})
    found = judge_recordings(monkeypatch, tmp_path)
    assert found.verdict.word == "not decided"
    note = found.recordings.notes["moved stamp"][0]
    assert "too few cases to tell" in note
    assert ("no interval" in note) == (count < 3)
