"""The benchmark of the protocol for recordings: its parts are those of the page, and it finds what it was given."""

import importlib
import re

import numpy as np
import pytest

from tests.support.pages import DOCS

PAGE = (DOCS / "how-to" / "record-a-data-set.md").read_text()


@pytest.fixture
def protocol(benchmarks):
    return importlib.import_module("recording_protocol")


def test_the_page_shows_its_places_and_its_rows(protocol):
    places = re.findall(r"\| [ABC][12] \| (-?[\d.]+) \| (-?[\d.]+) ", PAGE)
    assert 1e-3 * np.array(places, dtype=float) == pytest.approx(np.array(protocol.PLACES))
    rows = re.findall(r"^\| ([^|`]+) \| (\d+) \| \d+ \|(?: [^|]+ \|){5}$", PAGE, re.MULTILINE)
    assert rows == [(name, str(len(list(each.runs())))) for name, each in protocol.list_protocols().items()]


def test_a_thickness_is_the_minimum_of_the_residuals_or_unknown(protocol):
    logs = np.log(protocol.FACTORS)
    for true in (0.8, 1.0, 1.3):
        assert protocol.find_thickness(np.sqrt(9 + (logs - np.log(true)) ** 2)) == pytest.approx(np.log(true))
    assert np.isnan(protocol.find_thickness(np.sqrt(9 + (logs - np.log(2.5)) ** 2)))  # beyond the range
    assert np.isnan(protocol.find_thickness([1.0, 2.0, 1.0]))  # no minimum


@pytest.mark.slow
def test_without_errors_the_fit_finds_what_was_made_up(protocol, monkeypatch):
    """No errors of the bench: places, thickness and coefficient are exact, and so are the intervals small."""
    for name in ("SCATTER", "HEIGHTS"):
        monkeypatch.setattr(protocol, name, (0.0, 0.0))
    for name in ("CALLIPER", "AGAIN", "AGE_ERROR", "KELVIN", "NOISE"):
        monkeypatch.setattr(protocol, name, 0.0)
    methods = {factor: protocol.tabulate(factor, steps=3) for factor in protocol.FACTORS}
    _, found = protocol.study(protocol.list_protocols()["+ square turned, round stamp"], methods, 1)
    assert found["sensitivity"][0] < 1
    assert found["gains"][0] < 2
    assert found["position"][0] < 0.02
    assert found["temperature"][0] < 0.1
    assert found["thickness"][0] < 10
