"""The contact methods against the finite elements: a part of `benchmarks/fastmodel_scores.py` with its bounds."""

import importlib

import numpy as np
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def scores(benchmarks):
    return importlib.import_module("fastmodel_scores")


def column(rows, method, name="misplaced"):
    return np.array([row[name] for row in rows if row["method"] == method])


def within_bounds(rows, method, median=2):
    """The bounds that the default has to keep; the foundation has a larger median."""
    misplaced = column(rows, method)
    images = column(rows, method, "image_changed")
    return np.median(misplaced) <= median and misplaced.max() <= 5 and images.mean() <= 0.5


def test_default_keeps_its_bounds_on_two_shapes_and_the_reports_method_does_not(scores, wts_derivation, monkeypatch):
    """On the catalogue's cover, which is derived for other tests anyway and is the one of the benchmark by value."""
    monkeypatch.setattr(scores, "parameters", lambda _: wts_derivation.parameters)
    monkeypatch.setattr(scores, "make_cover", lambda *_: wts_derivation.sensor.cover)
    monkeypatch.setattr(scores, "METHODS", {"cover": "cover", "boxes": "boxes"})
    rows = list(scores.single(0.49, ("small square", "nut"), scores.LOADS[1:], (np.pi / 4,), scores.PLACES[3:]))
    assert len(rows) == 4
    assert within_bounds(rows, "cover")
    assert not within_bounds(rows, "boxes")
    assert column(rows, "cover", "balance").max() < 1e-3


@pytest.mark.parametrize("ratio", [0.3])
def test_default_keeps_its_bounds_on_every_shape(scores, ratio, monkeypatch):
    """Turned about the axes of the array, over a corner of a texel and off the grid."""
    monkeypatch.setattr(scores, "METHODS", {each: each for each in ("cover", "foundation", "boxes")})
    turns, places = scores.YAWS[:2], scores.PLACES[2:]
    rows = list(scores.single(ratio, loads=scores.LOADS[1:], yaws=turns, places=places))
    assert len(rows) == 7 * 2 * 2 * len(scores.METHODS)
    assert within_bounds(rows, "cover")
    assert within_bounds(rows, "foundation", median=3)
    assert not within_bounds(rows, "boxes")
    order = [np.median(column(rows, method)) for method in ("cover", "foundation", "boxes")]
    assert order == sorted(order)
    assert column(rows, "cover", "balance").max() < 1e-3


@pytest.mark.parametrize("ratio", [0.49])
def test_two_squares_at_once_and_a_tilting_block(scores, ratio):
    for cases in (scores.two_squares, scores.tilting_block):
        rows = list(cases(ratio, places=scores.PLACES[2:]))
        assert column(rows, "cover").max() < 5
        assert column(rows, "boxes").max() > 5
