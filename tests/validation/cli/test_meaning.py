"""The sentences at the end of a command's output follow the numbers."""

from __future__ import annotations

import numpy as np
import pytest

from meshes import Sphere
from validation.campaign.case import Case
from validation.campaign.comparison import Comparison
from validation.cli.meaning import explain_comparison, explain_verdict
from validation.metrics import score
from validation.sensor_file import BUILT_IN

SENSOR = BUILT_IN["wts-0614-34"]


@pytest.mark.parametrize(("misplaced", "sentences"), [(0.01, 1), (0.03, 2), (0.2, 2)])
def test_a_bad_share_comes_with_what_to_do(misplaced, sentences):
    true, other = np.zeros(84), np.zeros(84)
    true[39], other[39], other[40] = 1.0, 1.0 - misplaced, misplaced
    comparison = Comparison(
        sensor=SENSOR,
        case=Case(name="press", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm", load=1.0),
        fem=None,
        fast=None,
        score=score(true, other, array=SENSOR.array, load=1.0),
        models=("fem", "fast"),
        wanted={"load": 1.0},
    )
    lines = list(explain_comparison(comparison))
    assert f"{100 * misplaced:.1f} % of the force on wrong texels" in lines[0]
    assert len(lines) == sentences


def test_a_verdict_names_the_largest_change_or_the_groups_that_moved():
    assert explain_verdict({}) == "All 0 quantities are within their tolerances."
    assert explain_verdict({"a: x": 0.25, "b: y": 1.0, "b: z": 0.5}) == (
        "All 3 quantities are within their tolerances; the largest change is 1 of its tolerance (b: y)."
    )
    moved = explain_verdict({"b: y": 1.5, "a: x": 0.5, "c: z": float("nan"), "b: w": float("inf")})
    assert moved.startswith("3 of 4 quantities left their tolerances, in: b, c. ")
