"""The page of a curved cover prints the numbers of `report.json`, and says what is left out."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from meshes.bounded_file import parse_toml
from meshes.solids.texels import cylinder_texels
from tests.support.coarse_cells import coarse_cells
from tests.support.report_page import Page
from validation.campaign.campaign_file import parse_campaign
from validation.campaign.evaluation import evaluate
from validation.credibility.verification import Check
from validation.places import find_places
from validation.render.image import Scale, tactile_image
from validation.report import write_report
from validation.scene.rendering import RenderingError

TEXT = """
[[case]]
name = "ball"
indenter = "sphere:radius=4mm"
load = "0.3 N"

[[case]]
name = "edge <b>"
indenter = "box:size=3mmx3mmx4mm"
load = "0.2 N"
at = "off grid"
direction = "oblique x"
tilt = "0deg,45deg"
"""
CHECK = Check(
    name="made up", exact="made up", sizes=(1.0, 0.5, 0.25), errors=(0.0401, 0.0123, 0.0031), result=0.0031,
    least_order=1.0, tolerance=0.01,
)  # fmt: skip


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _cells():
    with coarse_cells():
        yield


@pytest.fixture(scope="module")
def evaluation(small_pad):
    plan = parse_campaign(parse_toml(TEXT), find_places(small_pad.cover, small_pad), source="mine")
    with pytest.MonkeyPatch.context() as patch:
        # solved by a slow test of its own
        patch.setattr("validation.campaign.solid_bench.check_shell", lambda *_: CHECK)
        return evaluate(small_pad, campaign=plan)


@pytest.fixture(scope="module")
def folder(evaluation, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")

    def fail(*_):
        raise RenderingError("no library to draw with")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("validation.scene.draw.write_picture", fail)
        write_report(evaluation, folder)
    return folder


@pytest.fixture(scope="module")
def page(folder):
    page = Page()
    page.feed((folder / "index.html").read_text())
    return page


@pytest.fixture(scope="module")
def stored(folder):
    return json.loads((folder / "report.json").read_text())


def test_the_poses_are_those_of_the_campaign(stored):
    edge = stored["campaign"]["cases"][1]
    assert edge["direction"] == pytest.approx([0.5, 0, -np.cos(np.radians(30))])
    assert edge["tilt"] == pytest.approx([0, np.pi / 4])
    assert len(edge["at"]) == 3


def test_the_table_of_responses_holds_those_of_the_derivation(page, stored):
    _, *rows = page.tables["responses"]
    own, gaussian = np.diag(stored["derive"]["texel_response"]), stored["derive"]["gaussian"]
    expected = [*gaussian["sigma_m"], gaussian["residual"], own.min(), own.max()]
    assert [float(row[1][0]) for row in rows if row[1][0]] == pytest.approx(expected, rel=1e-12)


def test_verification_and_range_are_those_of_the_evidence(page, stored):
    ((_, *cells),) = page.tables["codes"][1:]
    assert [float(value) for value, _ in cells[:3]] == list(CHECK.errors)
    assert stored["evidence"]["code_verification"][0]["errors"] == list(CHECK.errors)
    ends = [[float(value) for value, _ in row[1:]] for row in page.tables["domain"][1:]]
    assert ends == list(stored["evidence"]["validated_domain"].values())


def test_the_page_says_what_is_left_out_and_why_there_are_no_pictures(folder, stored):
    text = re.sub(r"\s+", " ", (folder / "index.html").read_text())
    assert "no pictures in three dimensions: no library to draw with" in text
    assert "<img" not in text
    for line in stored["evidence"]["left_out"]:
        assert line in text
    assert "share their assumptions of contact" in text
    assert "edge &lt;b&gt;" in text
    assert "edge <b>" not in text.split('id="figures"')[0]


def test_pictures_are_drawn_where_this_machine_can(evaluation, tmp_path, monkeypatch):
    drawn = []

    def draw(scene, path):
        drawn.append(scene)
        Path(path).write_bytes(b"picture")

    monkeypatch.setattr("validation.scene.draw.write_picture", draw)
    write_report(evaluation, tmp_path)
    text = (tmp_path / "index.html").read_text()
    assert re.findall(r'<img class="picture" src="([^"]+)"', text) == ["case-01.png", "case-02.png"]
    forces = [each.reference.texel_forces for each in evaluation.campaign.cases]
    assert all((scene.texel_forces == force).all() for scene, force in zip(drawn, forces, strict=True))


def test_a_map_shows_every_active_texel_at_its_place():
    array = cylinder_texels(6e-3, rows=2, columns=5, pitch=(2e-3, 2e-3), size=(1.8e-3, 1.8e-3), name="patch")
    values = np.linspace(0.01, 0.1, 10)
    drawn = tactile_image(array, values, Scale(peak=0.1), name="<x>")
    assert "&lt;x&gt;: 10 texels; largest 100 mN in row 1, column 4" in drawn
    squares = re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"', drawn)
    places = np.array(squares, dtype=float)
    assert len(places) == 10
    assert (np.diff(places[:5, 0]) > places[0, 2]).all()  # no square covers its neighbour
    assert places[0, 1] > places[5, 1]  # y points up
