"""Planted changes of what varies in time make the check red, and the quantity is named."""

import functools

import pytest

from fastmodel.signal.creep import Creep
from validation.calibration import step_response
from validation.moving import run
from validation.published import in_time
from validation.published.rules import PUBLISHED
from validation.regression.baseline import compare, make_baseline
from validation.regression.in_time import measure_time


@functools.cache
def healthy():
    return make_baseline("sensor", measure_time(None))


def change(target, name, factor):
    """A plant that multiplies what a function returns."""

    def plant(monkeypatch):
        whole = getattr(target, name)
        changed = property(lambda self: factor * whole.fget(self)) if isinstance(whole, property) else None
        monkeypatch.setattr(target, name, changed or (lambda *each, **options: factor * whole(*each, **options)))

    return plant


def slow_down(monkeypatch):
    monkeypatch.setitem(PUBLISHED["tegin-2005"].terms, "y = 0.1 f + 0.9 y every 2.5 ms", in_time.recursion(0.1, 3e-3))


PLANTS = {
    "creep 5 % too small": (change(Creep, "weight", 0.95), "creep of a held load"),
    "a filter that is computed more rarely": (slow_down, "step through published filters, after 6 and 20 ms"),
    "misplaced force halved": (change(run, "measure_misplaced", 0.5), "scores of a moving case"),
    "error by one percent of itself": (change(run, "measure_error", 1.01), "scores of a moving case"),
    "latency 2 % longer": (change(run, "find_latency", 1.02), "delay and latency of a moving case"),
    "frames held for the last sample": (change(run, "hold", 0.995), "scores of a moving case"),
    "loads interpolated 1 % too high": (change(run, "interpolate", 1.01), "force on the texels of a moving case"),
}


@pytest.mark.parametrize("name", PLANTS)
def test_a_change_is_red_and_names_the_quantity(name, monkeypatch):
    stored = healthy()
    plant, title = PLANTS[name]
    plant(monkeypatch)
    assert title in {each.quantity for each in compare(stored, make_baseline("sensor", measure_time(None)), {})}


def test_unchanged_results_are_green():
    assert compare(healthy(), make_baseline("sensor", measure_time(None)), {}) == []


def test_a_cut_off_that_is_misread_is_red(monkeypatch):
    stored = healthy()
    whole = step_response.respond
    monkeypatch.setattr(step_response, "respond", lambda order, phase: whole(order, 1.02 * phase))
    changed = {each.quantity for each in compare(stored, make_baseline("sensor", measure_time(None)), {})}
    assert changed == {"filter of a step"}
