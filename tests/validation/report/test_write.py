"""The report folder is complete, offline and labelled."""

import csv
import dataclasses
import json
import re
from html.parser import HTMLParser

import pytest

import fastmodel
from validation.metrics import METRICS
from validation.report import write_report
from validation.sensor_file import load


class References(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found, self.ids = [], []

    def handle_starttag(self, tag, attrs):
        self.found += [value for key, value in attrs if key in {"src", "href"}]
        self.ids += [value for key, value in attrs if key == "id"]


def test_folder_is_complete_and_needs_no_network(folder):
    page = References()
    page.feed((folder / "index.html").read_text())
    for reference in page.found:
        assert not re.match(r"(https?:)?//", reference)
        if reference.startswith("#"):
            assert reference[1:] in page.ids
        elif not reference.startswith("data:"):
            assert (folder / reference).is_file(), reference


def test_numbers_beside_the_page_are_those_of_the_evaluation(folder, evaluation):
    mean = evaluation.campaign.pooled["fast"]["misplaced_force"].mean
    assert f"{100 * mean:.1f}" in (folder / "index.html").read_text()
    assert json.loads((folder / "report.json").read_text()) == evaluation.report.as_json()
    scores = [(case, model) for case in evaluation.campaign.cases for model in case.predictions]
    for row, (case, model) in zip(csv.DictReader((folder / "scores.csv").open()), scores, strict=True):
        assert (row["case"], float(row["load"]), row["model"]) == (case.case.name, case.case.load, model)
        score = case.predictions[model].score
        assert {name: float(row[name]) for name in METRICS} == pytest.approx(
            {name: getattr(score, name) for name in METRICS}, nan_ok=True
        )


def test_the_page_shows_words_and_no_code(folder, evaluation):
    text = (folder / "index.html").read_text()
    assert "Pose(" not in text
    for case in evaluation.campaign.cases:
        assert f"N at {case.case.place};" in text


@pytest.mark.slow
def test_assumed_cover_is_labelled_and_a_known_one_is_not(folder, evaluation, tmp_path):
    assert "assumed cover" in (folder / "index.html").read_text()
    known = load("wts-0614-34", material="neoprene", thickness="2mm")
    assert not known.cover.assumed
    derivation = dataclasses.replace(evaluation.derivation, sensor=known)
    write_report(dataclasses.replace(evaluation, derivation=derivation), tmp_path)
    assert "assumed" not in (tmp_path / "index.html").read_text()


def test_parameters_beside_the_page_load(folder, evaluation):
    assert fastmodel.load(folder).spread == evaluation.derivation.parameters.spread
