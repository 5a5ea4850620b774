"""The sentences at the end of a command's output follow the numbers."""

from __future__ import annotations

from validation.cli.meaning import explain_verdict


def test_a_verdict_names_the_largest_change_or_the_groups_that_moved():
    assert explain_verdict({}) == "All 0 quantities are within their tolerances."
    assert explain_verdict({"a: x": 0.25, "b: y": 1.0, "b: z": 0.5}) == (
        "All 3 quantities are within their tolerances; the largest change is 1 of its tolerance (b: y)."
    )
    moved = explain_verdict({"b: y": 1.5, "a: x": 0.5, "c: z": float("nan"), "b: w": float("inf")})
    assert moved.startswith("3 of 4 quantities left their tolerances, in: b, c. ")
