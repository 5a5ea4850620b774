"""Small strain: flat faces scale with the load, poses share a solution, limited covers need a place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.grid_convergence import grid_convergence
from fem_reference.indentation import small_strain
from fem_reference.indentation.small_strain import study_path
from fem_reference.linear_response.point_spread import superpose
from fem_reference.small_strain_contact.frictionless import ContactPatch
from meshes import Cylinder, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import make_cover

ARRAY = TexelArray.grid(6, 6, pitch=3.4e-3)
POSE = Pose.planar(at=(1e-3, 0.0))
COVER = make_cover(0.45, "linear-elastic")


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Few cells: scaling and symmetry hold on every grid."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(small_strain, "CELLS", (16, 32, 48))
        yield


@pytest.mark.parametrize(
    "control", [pytest.param("load", marks=pytest.mark.slow), pytest.param("depth", marks=pytest.mark.slow)]
)
def test_a_flat_face_at_another_load_is_the_first_solution_scaled(control):
    targets = (1.0, 2.5) if control == "load" else (0.1e-3, 0.25e-3)
    path = LoadingPath(cover=COVER, indenter=Cylinder(radius=2e-3), targets=targets, control=control)
    both = study_path(path, None, None).solutions
    alone = study_path(replace(path, targets=targets[1:]), None, None).solutions
    for scaled, solved in zip(both[1], alone[0], strict=True):
        for name in ("total_force", "depth", "area"):
            assert getattr(scaled, name) == pytest.approx(getattr(solved, name), rel=1e-6)
        assert scaled.contact == pytest.approx(solved.contact, rel=1e-6)
        forces = scaled.base.forces(ARRAY, POSE)
        assert forces == pytest.approx(solved.base.forces(ARRAY, POSE), rel=1e-6)
        assert forces.sum() == pytest.approx(scaled.total_force, rel=1e-4)


@pytest.fixture(scope="module")
def ball():
    path = LoadingPath(cover=COVER, indenter=Sphere(radius=4e-3), targets=(0.2e-3,), control="depth")
    return path, study_path(path, None, None).solutions[0]


@settings(max_examples=15, deadline=None)
@given(x=st.floats(-8e-3, 8e-3), y=st.floats(-8e-3, 8e-3))
def test_a_mirrored_pose_mirrors_the_base_forces(ball, x, y):
    finest = ball[1][-1]
    here = ARRAY.image(finest.base.forces(ARRAY, Pose.planar(at=(x, y)))[:-1])
    there = ARRAY.image(finest.base.forces(ARRAY, Pose.planar(at=(-x, -y)))[:-1])
    assert there[::-1, ::-1] == pytest.approx(here, abs=1e-4 * finest.total_force)


def test_a_cover_of_limited_size_needs_a_place():
    path = LoadingPath(
        cover=replace(COVER, size=(8e-3, 8e-3)), indenter=Sphere(radius=4e-3), targets=(1.0,), control="load"
    )
    with pytest.raises(ValueError, match="depends on the place"):
        study_path(path, None, None)


def test_the_error_of_a_texel_is_relative_to_its_force(ball):
    """A texel at the rim, with a hundredth of the force, has the absolute change between grids over its own force."""
    base = ball[1][-1].base
    place = Place(array=ARRAY, pose=POSE)
    for texel in (int(np.argmax(base.forces(ARRAY, POSE)[:-1])), 0):
        on_grids = [
            superpose(base.contact, each, ARRAY, POSE)[texel] / base.contact[:, 2].sum()
            for each in base.response.on_grids
        ]
        share = on_grids[-1]
        wanted = grid_convergence(on_grids, base.response.sizes) / share
        assert base.estimate_error(place, texel, share) == pytest.approx(wanted, rel=1e-6)
        assert base.estimate_error(place, texel, 0.0) == 0.0


@pytest.mark.parametrize(("size", "least"), [(None, 1e-4), ((8e-3, 8e-3), 1.5e-3)])
@pytest.mark.parametrize(("indenter", "refinement"), [(Sphere(radius=4e-3), 1), (Cylinder(radius=2e-3), 0)])
def test_each_load_is_solved_on_three_grids_and_a_face_once(size, least, indenter, refinement, monkeypatch):
    """A face sinks to the thickness and is scaled; the smallest error that is stated is larger near free sides."""
    asked = []

    def press(path, place, _, cells):
        asked.append((path.targets, path.control, place, cells))
        return cells

    monkeypatch.setattr(small_strain, "CELLS", (16, 24, 32, 48))
    monkeypatch.setattr(small_strain, "respond", lambda cover, place, _: (cover.size, place))
    monkeypatch.setattr(small_strain, "press_cells", press)
    monkeypatch.setattr(small_strain, "build_solution", lambda *given: given)
    monkeypatch.setattr(small_strain, "scale_to_target", lambda *given: given)
    cover, place = replace(COVER, size=size), Place(array=ARRAY, pose=POSE)
    path = LoadingPath(cover=cover, indenter=indenter, targets=(0.5, 2.0), control="load")
    found = study_path(path, place, None, refinement)
    grids, flat = (16, 24, 32, 48)[refinement : refinement + 3], indenter.is_flat
    solved = [(cells, indenter, (size, place)) for cells in grids]
    if flat:
        assert asked == [((cover.thickness,), "depth", place, cells) for cells in grids]
        assert found.solutions == [[(each, target, "load") for each in solved] for target in (0.5, 2.0)]
    else:
        assert asked == [((target,), "load", place, cells) for target in (0.5, 2.0) for cells in grids]
        assert found.solutions == [solved, solved]
    assert (found.least_error, found.most_order, found.extrapolate) == (least, 1.0, flat)


class Touches:
    """Contacts whose half widths are given, over those of the rectangle of cells or in metres."""

    cell = (0.1e-3, 0.06e-3)

    def __init__(self, *extents):
        self.extents, self.asked = list(extents), []

    def __call__(self, _surface, _indenter, *, cells, load=None, depth=None, sides=None):
        half = None if sides is None else sides.half
        self.asked.append((cells, load, depth, half))
        ends = np.array(self.extents.pop(0)) * (1.0 if half is None else half) - np.array(self.cell) / 2
        x, y = np.array([[-0.5, 1.0], [1.0, -0.5]]) * ends[:, None]
        return ContactPatch(x=x, y=y, force=np.ones(2), cell=self.cell, depth=1e-4, area=1e-6)


@pytest.mark.parametrize(
    ("shares", "halves"),
    [
        ([(0.97, 0.97)], [1.0]),
        ([(0.99, 0.5), (0.97, 0.5)], [1.0, 1.35]),
        ([(0.5, 0.99), (0.99, 0.99), (0.9, 0.9)], [1.0, 1.35, 1.35**2]),
    ],
)
@pytest.mark.parametrize("control", ["load", "depth"])
def test_the_cells_beside_sides_are_widened_until_they_span_the_contact(shares, halves, control, monkeypatch, tmp_path):
    """From 1.35 times the contact on a wide cover on; the middles of cells are moved onto the cover."""
    touches = Touches((0.5e-3, 0.4e-3), *shares)
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    monkeypatch.setattr(small_strain, "solve_contact", touches)
    cover = replace(COVER, size=(4e-3, 3e-3))
    path = LoadingPath(cover=cover, indenter=Sphere(radius=9e-3), targets=(0.3,), control=control)
    place = Place(array=ARRAY, pose=Pose.planar(at=(1.5e-3, 0.0)))
    found = small_strain.press_cells(path, place, None, 96)
    given = (0.3, None) if control == "load" else (None, 0.3)
    assert [each[:3] for each in touches.asked] == [(small_strain.CELLS[0], *given), *[(96, *given)] * len(halves)]
    for (*_, half), factor in zip(touches.asked[1:], halves, strict=True):
        assert half == pytest.approx(1.35 * factor * np.array([0.5e-3, 0.4e-3]))
    # The side of the cover is 0.5 mm beside the axis.
    assert found.x.max() <= 0.5e-3
    assert found.force.tolist() == [1.0, 1.0]


def test_no_cells_reach_beyond_what_an_indenter_can_touch(monkeypatch, tmp_path):
    """A ball of 1 mm touches no farther than its radius, however large its contact; a face has its own size."""
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    cover, place = replace(COVER, size=(8e-3, 8e-3)), Place(array=ARRAY, pose=Pose())
    path = LoadingPath(cover=cover, indenter=Sphere(radius=1e-3), targets=(0.3,), control="load")
    touches = Touches((0.9e-3, 0.5e-3), (1.0, 0.99), (1.0, 0.9))
    monkeypatch.setattr(small_strain, "solve_contact", touches)
    small_strain.press_cells(path, place, None, 96)
    assert [each[3] for each in touches.asked[1:]] == [
        pytest.approx([1e-3, 1.35 * 0.5e-3]), pytest.approx([1e-3, 1.35**2 * 0.5e-3]),
    ]  # fmt: skip
    touches = Touches((1.0, 1.0))
    monkeypatch.setattr(small_strain, "solve_contact", touches)
    small_strain.press_cells(replace(path, indenter=Cylinder(radius=2e-3)), place, None, 96)
    assert [each[3] for each in touches.asked] == [pytest.approx([2e-3, 2e-3])]
