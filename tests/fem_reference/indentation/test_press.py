"""Requests that `press` refuses, and what a result states."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press, press_path
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import small_strain
from fem_reference.indentation.layered import is_far_from_sides
from fem_reference.linear_response.finite_cover import GRIDS, choose_grids
from meshes import Box, Cylinder, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import make_cover


@pytest.fixture
def coarse(monkeypatch):
    """Few cells: what these tests check does not depend on the grids."""
    monkeypatch.setattr(small_strain, "CELLS", (16, 32, 48))


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ({}, "either a load or a depth"),
        ({"loads": [1.0], "depths": [1e-4]}, "either a load or a depth"),
        ({"loads": []}, "give at least one load"),
        ({"loads": [-1.0]}, "load must be positive"),
        ({"loads": [np.nan]}, "load must be positive"),
        ({"depths": [3e-3]}, "pierce"),
        pytest.param({"loads": [5000.0]}, r"pierce the cover .* use at most \d+", marks=pytest.mark.slow),
        ({"loads": [2.0, 1.0]}, "must ascend"),
        ({"depths": [2e-4, 1e-4]}, "must ascend"),
        ({"loads": [1.0], "friction": -0.1}, "friction coefficient"),
        ({"loads": [1.0], "friction": np.nan}, "friction coefficient"),
    ],
)
@pytest.mark.usefixtures("coarse")
def test_bad_requests_are_refused_in_words(bonded, wts, request_, message):
    with pytest.raises(ValueError, match=message):
        press_path(bonded(0.3), wts, Sphere(radius=5e-3), **request_)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, np.inf])
def test_a_face_that_hardly_presses_rubber_has_the_solution_of_small_strain(wts, friction):
    rubber, linear = (
        press(make_cover(0.45, model), wts, Cylinder(radius=2e-3), depth=5e-9, friction=friction)
        for model in ("neo-hookean", "linear-elastic")
    )
    assert rubber.total_force == pytest.approx(linear.total_force, rel=1e-12)
    assert rubber.texel_forces == pytest.approx(linear.texel_forces, rel=1e-9, abs=1e-15)
    assert "negligible" in rubber.assumptions["strain"]


def test_results_name_their_assumptions(bonded, wts):
    found = press(bonded(0.3), wts, Cylinder(radius=5e-3), load=0.5)
    assert found.assumptions == {"strain": "small", "friction": "frictionless", "base": "bonded"}
    assert set(found.error_estimate) == {"total_force", "depth", "peak_texel", "contact_area"}


def test_axis_beside_the_cover_is_refused(bonded):
    with pytest.raises(ValueError, match=r"axis at \(4.1, 0\) mm stands beside the cover, which measures 8 x 6 mm"):
        press(
            bonded(0.45, thickness=4e-3, size=(8e-3, 6e-3)),
            TexelArray.grid(1, 2, 3e-3),
            Sphere(radius=4e-3),
            load=1.0,
            pose=Pose.planar(at=(4.1e-3, 0.0)),
        )


def test_a_cover_too_wide_for_the_memory_is_solved_on_coarser_grids_or_refused(bonded):
    array = TexelArray.grid(9, 9, 20e-3)
    assert choose_grids(bonded(0.3, size=(30e-3, 30e-3)), array) == GRIDS
    wide = choose_grids(bonded(0.3, size=(0.2, 0.2)), array)
    assert 0.4 * GRIDS[-1].across <= wide[-1].across < GRIDS[-1].across
    with pytest.raises(ValueError, match=r"cover.size: 3000 x 3000 mm .* use a size of at most"):
        choose_grids(bonded(0.3, size=(3.0, 3.0)), TexelArray.grid(150, 150, 20e-3))


@pytest.mark.parametrize(("at", "far"), [((0, 0), True), ((0, -5e-3), True), ((18e-3, 0), False), ((0, -13e-3), False)])
@pytest.mark.parametrize(
    ("model", "indenter", "friction"),
    [
        ("linear-elastic", Sphere(radius=4e-3), 0.3),
        ("neo-hookean", Sphere(radius=4e-3), 0.0),
        ("neo-hookean", Box(size=(1e-3, 2e-3, 3e-3)), np.inf),
    ],
)
def test_a_contact_near_any_side_is_not_taken_for_one_on_a_wide_cover(at, far, model, indenter, friction):
    cover = make_cover(0.45, model, size=(40e-3, 30e-3))
    path = LoadingPath(cover=cover, indenter=indenter, targets=(1e-4,), control="depth", friction=friction)
    place = Place(array=TexelArray.grid(2, 2, pitch=3e-3), pose=Pose.planar(at=at))
    assert is_far_from_sides(path, place) is far


def test_fields_are_computed_up_to_the_sides():
    cover = make_cover(0.45, size=(40e-3, 30e-3))
    path = LoadingPath(cover=cover, indenter=Sphere(radius=4e-3), targets=(1e-4,), control="depth", fields=True)
    place = Place(array=TexelArray.grid(2, 2, pitch=3e-3), pose=Pose())
    assert not is_far_from_sides(path, place)
