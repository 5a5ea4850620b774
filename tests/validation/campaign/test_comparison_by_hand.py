"""A comparison of made-up results as it is printed."""

from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel import FastIndentation
from tests.support.made_up_evaluation import make_score
from validation.campaign.case import Case
from validation.campaign.comparison import Comparison
from validation.campaign.results import Reference
from validation.sensor_file import load

SENSOR = load("wts-0614-34")
CASE = Case.read("a", "sphere:radius=5mm", "2 N", at="1mm,-2mm", yaw="30deg")
FORCES = np.arange(84.0)


def make_fast(**changes):
    values = {
        "contact_forces": 2 * FORCES, "texel_forces": 3 * FORCES, "outside": 0.4, "total_force": 1.9, "chatter": 0.0,
        "depth": 3e-4, "method": "cover", "fewest_cells": 9, "warnings": ("fast",), "seconds": 0.25,
    }  # fmt: skip
    return FastIndentation(**(values | changes))


def make_fem(**changes):
    values = {
        "texel_forces": FORCES, "total_force": 2.0, "depth": 2e-4, "contact_area": 3e-6,
        "error_estimate": {"depth": 0.1}, "assumptions": {}, "outside": 0.1, "warnings": ("fem",),
        "texel_errors": 0.5 * FORCES,
    }  # fmt: skip
    return SimpleNamespace(mesh=None, **(values | changes))


def compare(fem, fast, models=("fem", "fast"), **changes):
    score = make_score(0.03) if fem and fast else None
    return Comparison(
        sensor=changes.pop("sensor", SENSOR), case=CASE, fem=fem, fast=fast, score=score, models=models,
        wanted={"load": 2.0}, **changes,
    )  # fmt: skip


def test_results_are_printed_as_images_with_what_was_asked_for():
    found = compare(make_fem(), make_fast(), stopped="at 1 N")
    assert found.warnings == ("fem", "fast")
    shown = found.as_json()
    fem, fast = shown["models"]["fem"], shown["models"]["fast"]
    image = SENSOR.array.image
    assert np.array_equal(fem["texel_forces"], image(FORCES))
    assert np.array_equal(fem["texel_errors"], image(0.5 * FORCES))
    assert (fem["mesh"], fem["outside"], fem["depth"]) == (None, 0.1, 2e-4)
    assert np.array_equal(fast["texel_forces"], image(3 * FORCES))
    assert np.array_equal(fast["contact_forces"], image(2 * FORCES))
    assert (fast["outside"], fast["total_force"], fast["method"]) == (0.4, 1.9, "cover")
    assert (fast["depth"], fast["seconds"], fast["warnings"]) == (3e-4, 0.25, ["fast"])
    assert fast["force"] == pytest.approx([0.0, 0.0, -1.9])
    assert fast["misplaced_force"] == found.score.misplaced_force
    assert (shown["sensor"], shown["cover"]) == (SENSOR.array.name, SENSOR.describe_cover())
    assert (shown["indenter"], shown["load"], shown["wanted"]) == ("sphere:radius=5mm", 2.0, {"load": 2.0})
    assert (shown["at"][:2], shown["yaw"], shown["stopped"]) == ([1e-3, -2e-3], pytest.approx(np.pi / 6), "at 1 N")
    assert shown["scores"] == found.score.as_json()


def test_results_that_are_missing_or_not_asked_for_are_left_out():
    fast = compare(make_fem(texel_errors=None), make_fast(force=np.array([0.1, 0.2, -1.0])), models=("fast",)).as_json()
    assert fast["models"].keys() == {"fast"}
    assert list(fast["models"]["fast"]["force"]) == [0.1, 0.2, -1.0]
    assert fast["stopped"] is None
    fem = compare(make_fem(texel_errors=None), None, models=("fem",))
    assert fem.as_json()["models"].keys() == {"fem"}
    assert fem.as_json()["models"]["fem"]["texel_errors"] is None
    assert fem.as_json()["scores"] is None
    assert len(fem.indentations) == 1
    alone = compare(None, make_fast(), sensor=SimpleNamespace(array=SENSOR.array))
    assert (alone.as_json()["cover"], alone.as_json()["models"]["fast"]["misplaced_force"]) == (None, None)
    assert (alone.indentations, alone.warnings) == ((), ("fast",))


def test_a_reference_is_a_result_without_what_it_does_not_keep():
    reference = Reference.of(make_fem())
    assert (reference.total_force, reference.contact_area, reference.energy) == (2.0, 3e-6, None)
