"""The truth of tactilebench: cases mean the same to softcover, and closed forms lie in the shipped intervals."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.tactilebench import cases_as_softcover, truth
from fem_reference import closed_form
from meshes import Cover
from tactilebench import BenchError, cases
from tactilebench.draw import TIERS, draw

SHIPPED = {case.name: case for case in cases()}
FIRST = [next(case for case in draw("2026.1") if case.tier == tier) for tier in TIERS]


@pytest.mark.parametrize("case", FIRST, ids=lambda case: case.tier)
def test_a_case_has_the_axes_texels_and_thickness_of_softcover(case):
    for body in case.bodies:
        pose = cases_as_softcover.make_pose(body)
        assert pose.rotation == pytest.approx(body.rotation, abs=1e-9)
        cases_as_softcover.make_indenter(body)
    array, cover = cases_as_softcover.make_array(case), cases_as_softcover.make_cover(case)
    assert array.normals == pytest.approx(case.normals, abs=1e-9)
    assert cover.thickness == pytest.approx(case.cover.thickness)


def is_round(case):
    body = case.bodies[0]
    return not case.cover.size and body.shape["shape"] in {"sphere", "cylinder"} and not any(body.tilt)


@pytest.mark.slow
def test_shipped_intervals_hold_closed_forms():
    """All balls and disks on wide linear layers of a few tiers, which the closed forms solve."""
    chosen = [case for case in SHIPPED.values() if case.tier in {"linear", "layered"} and is_round(case)][:12]
    held = []
    for case in chosen:
        cover, array = cases_as_softcover.make_cover(case), cases_as_softcover.make_array(case)
        assert isinstance(cover, Cover)
        (body,) = case.bodies
        exact = closed_form.indent(cover, cases_as_softcover.make_indenter(body), load=body.load)
        apart = np.abs(exact.texel_forces(array, body.at[:2]) - case.truth.forces)
        held.extend((apart <= case.truth.half_width)[case.truth.forces > 0.01 * body.load])
    assert len(held) > 50
    assert np.mean(held) >= 0.95


@pytest.mark.slow
def test_a_case_computed_anew_is_within_its_intervals():
    case = next(case for case in SHIPPED.values() if case.tier == "layered")
    again = case.with_truth(*truth.solve(case), command="")
    assert (np.abs(again.truth.forces - case.truth.forces) <= case.truth.half_width).all()


def test_a_case_whose_intervals_are_wide_is_not_shipped():
    case = FIRST[0]
    forces = np.full(case.shape, 0.02 * case.load)
    assert cases_as_softcover.measure_width(case, forces, 0.1 * forces) == pytest.approx(2e-3)
    assert cases_as_softcover.find_limit(case) == 3e-3
    assert (
        max(
            cases_as_softcover.measure_width(each, each.truth.forces, each.truth.half_width)
            for each in SHIPPED.values()
        )
        <= 1e-2
    )


def test_unknown_names_are_refused(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["truth.py", "--name", "nothing-000"])
    assert truth.main() == 2
    assert "nothing-000" in capsys.readouterr().err


def test_a_place_that_cannot_hold_the_truth_is_refused_before_hours_of_work(tmp_path):
    other = truth.Build("2026.1", 7, tmp_path / "other.npz")
    name = next(iter(other.drawn))
    shape = other.drawn[name].shape
    other.add(name, [np.ones(shape), np.zeros(shape), np.zeros(shape[:-1]), np.zeros(shape[:-1])])
    other.write()
    assert list(truth.Build("2026.1", 7, tmp_path / "other.npz").solved) == [name]
    with pytest.raises(BenchError, match=f"{name}, a case of another seed"):
        truth.Build("2026.1", 8, tmp_path / "other.npz")
    with pytest.raises(BenchError, match="is no folder"):
        truth.Build("2026.1", 8, tmp_path / "none" / "truth.npz")
