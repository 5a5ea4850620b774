"""The report's table of comparison models shows each row's own numbers."""

import re

import pytest

from tests.support.report_page import Page
from validation.campaign.results import MODELS
from validation.metrics import METRICS
from validation.report.page import describe_comparison

pytestmark = pytest.mark.slow

#: Metrics in the order of the table's columns, which begin after two columns of text.
SHOWN = ("misplaced_force", "image_changed_percent", "image_changed_line_percent", "centre_of_pressure_m")


def test_every_row_shows_the_means_of_its_own_model(solved_folder, solved):
    page = Page()
    page.feed((solved_folder / "index.html").read_text())
    _, *rows = page.tables["comparison-table"]
    campaign = solved.campaign
    own = [(name, "", campaign.pooled[name]) for name in MODELS]
    published = [(each.title, each.variant, each.pooled) for each in campaign.published]
    assert len({row[0][1][0] for row in rows}) == len(rows)  # no two rows have one name
    for row, (title, variant, pooled) in zip(rows, own + published, strict=True):
        assert row[0][1][0].startswith(title)
        assert variant in row[0][1][0]
        for (_, (text, *_)), name in zip(row[2:], SHOWN, strict=True):
            assert text == METRICS[name].text(pooled[name].mean)


def test_fitted_rows_name_their_presses_and_unread_papers_say_so(solved_folder, solved):
    page = re.sub(r"\s+", " ", (solved_folder / "index.html").read_text())
    for press in ("sphere:radius=6mm, 3 N", "cylinder:radius=3.5mm, 2 N", "sphere:radius=10mm, 1 N"):
        assert press in page
    assert "stiffness, on 3 presses" in page
    for row in solved.campaign.published:
        unread = any(name in row.title for name in ("Tegin", "Pezzementi", "Shimojo", "RobWorkSim 2010"))
        assert ("not read" in row.certainty) == unread


def test_models_that_are_as_good_are_named(solved):
    found = describe_comparison(solved.campaign)["as_good"]
    for metric, name in (("misplaced_force", "misplaced force"), ("image_changed_percent", "image changed")):
        for scores in solved.campaign.published:
            named = f"{scores.title} {scores.variant} (" in " ".join(found[name])
            assert named == (scores.skill[metric].few or scores.skill[metric].low <= 0)


def test_command_line_prints_the_verdict_in_words_and_ten_models(solved, capsys):
    from validation.cli.commands.validate import SHOWN, _print

    _print(solved)
    text = capsys.readouterr().out
    lines = text.splitlines()
    assert max(map(len, lines)) <= 80
    best = sorted(solved.campaign.published, key=lambda each: each.pooled["misplaced_force"].mean)
    for scores in best[:5]:
        (line,) = (line for line in lines if f" {scores.title}, {scores.variant} " in line)
        means = [METRICS[name].text(scores.pooled[name].mean) for name in SHOWN]
        assert re.findall(r"(?<=[│┃])\s*([\d.]+) ", line) == means
    words = ("Intended use: ", solved.verdict.sentence, solved.verdict.reasons[0], "Means over ")
    places = [" ".join(text.split()).index(word) for word in words]
    assert places == sorted(places)
