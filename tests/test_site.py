"""The documentation site builds without a warning, searches without a network, and loads nothing from one."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests.support.pages import DOCS, PAGES

pytest.importorskip("sphinx", reason="needs the extra docs")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", DOCS, folder]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert done.returncode == 0, done.stderr  # -W: a warning counts as a failure
    return folder


def test_every_page_is_built_and_found_by_the_search(site):
    index = (site / "searchindex.js").read_text()
    for page in PAGES:
        name = page.relative_to(DOCS).with_suffix("")
        assert (site / f"{name}.html").stat().st_size > 1000
        assert f'"{name}"' in index


def test_no_page_loads_from_a_network(site):
    for page in site.rglob("*.html"):
        assert re.findall(r"<(?:script|img|iframe)[^>]*src=\"https?:", page.read_text()) == []
        assert re.findall(r"<link rel=\"stylesheet\"[^>]*href=\"https?:", page.read_text()) == []


def test_every_heading_has_a_level_and_every_picture_a_text(site):
    for page in site.rglob("*.html"):
        text = page.read_text()
        assert re.findall(r"<(?![^>]*aria-level)[^>]*role=\"heading\"[^>]*>", text) == []
        assert re.findall(r"<img(?![^>]*alt=\"[^\"])[^>]*>", text) == []


def test_docstrings_stand_with_their_units(site):
    assert "Thickness of the layer [m]" in re.sub(r"<[^>]+>", "", (site / "api" / "meshes.html").read_text())
