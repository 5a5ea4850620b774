"""Presses with friction on few cells: rings of exact compliance, scaling, grids, floors of estimates, and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import result_store
from fem_reference.errors import UnsupportedError
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import rubbing, small_strain
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import decay_length, membrane_length
from meshes import Box, Cylinder, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.exact.rings import press_with_friction
from tests.support.rubber import stack_layers

ONE = stack_layers((2e-3, 1e6, 0.3))
TWO = stack_layers((1.2e-3, 3e5, 0.4), (0.8e-3, 2e6, 0.2))
BALL, PIN = Sphere(radius=5e-3), Cylinder(radius=1.2e-3)
GRIDS, CELLS = (16, 16, 32), (16, 24, 32, 48)


class PassedError(Exception):
    """The check before the solution has passed."""


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Few cells, and no response of the base: contacts are the same for any."""
    monkeypatch.setattr(rubbing, "GRIDS", GRIDS)
    monkeypatch.setattr(small_strain, "CELLS", CELLS)
    monkeypatch.setattr(small_strain, "respond", lambda *_: None)


def study(cover, indenter, friction, *targets, control="depth", refinement=0):
    path = LoadingPath(cover=cover, indenter=indenter, targets=targets, control=control, friction=friction)
    return rubbing.study_path(path, None, None, refinement)


@pytest.mark.slow
@pytest.mark.parametrize(("cover", "friction"), [(ONE, 0.15), (TWO, 0.4)])
def test_a_ball_rubs_as_rings_say_at_a_depth_and_under_its_load(cover, friction):
    known = press_with_friction(cover, BALL, 0.15e-3, friction, rings=24)
    found = study(cover, BALL, friction, 0.15e-3)
    for each in found.solutions[0]:
        assert each.depth == pytest.approx(0.15e-3, rel=1e-6)
        assert each.total_force == pytest.approx(known.force, rel=0.01)
        assert each.area == pytest.approx(np.pi * known.contact_radius**2, rel=0.05)
        pressure, shear = each.contact[:, 2], np.hypot(*each.shear.T)
        assert (shear <= friction * (pressure + 2e-3 * pressure.max())).all()
        # Shear opposes the slip of the cover towards the middle, evenly on all sides.
        assert (np.sum(each.shear * each.contact[:, :2], axis=1)[shear > 0.1 * shear.max()] > 0).all()
        assert np.abs(each.shear.sum(axis=0)).max() < 1e-3 * shear.sum()
        # A ball on a half space stores 0.4 of the force times the depth, on one layer less, under a plate more.
        assert 0.36 < each.energy / (each.total_force * each.depth) < 0.42
    if cover is ONE:
        by_load = study(cover, BALL, friction, known.force, control="load").solutions[0]
        assert [each.total_force for each in by_load] == pytest.approx([known.force] * 3, rel=1e-4)
        assert [each.depth for each in by_load] == pytest.approx([0.15e-3] * 3, rel=0.01)


@pytest.mark.parametrize(("control", "target"), [("depth", 0.13e-3), ("load", 0.25)])
def test_a_path_of_a_ball_ends_at_its_depth_or_load_and_friction_stiffens_it(control, target, monkeypatch):
    monkeypatch.setattr(rubbing, "GRIDS", (16, 16, 16))
    monkeypatch.setattr(small_strain, "CELLS", (16,) * 4)
    found = study(ONE, BALL, 0.4, target, control=control)
    rubbed, smooth = found.solutions[0][-1], found.accurate.solutions[0][-1]
    for each in (rubbed, smooth):
        assert {"depth": each.depth, "load": each.total_force}[control] == pytest.approx(target, rel=1e-4)
    assert 1.005 < rubbed.total_force / rubbed.depth / (smooth.total_force / smooth.depth) < 1.1


@pytest.mark.parametrize(("friction", "steps"), [(0.3, 0.5), (np.inf, 1.0)])
@pytest.mark.parametrize("refinement", [0, 1])
def test_grids_are_refined_from_the_coarse_end_to_the_fine_end(friction, steps, refinement, monkeypatch):
    patch = small_strain.press_cells(
        LoadingPath(cover=ONE, indenter=BALL, targets=(0.1e-3,), control="depth"), None, None, 16
    )
    seen, grids = [], (16, 32, 48, 64)
    monkeypatch.setattr(rubbing, "GRIDS", grids)
    monkeypatch.setattr(
        rubbing, "_press", lambda _path, _place, _progress, grid, _smooth: seen.append(grid) or [patch] * 2
    )
    found = study(ONE, BALL, friction, 0.1e-3, refinement=refinement)
    kept = grids[refinement : refinement + 3]
    assert seen == [(cells, int(cells * steps)) for cells in kept]
    assert (found.least_error, found.least_area_error) == (5e-4, 1 / kept[2])
    smooth = found.accurate.solutions[0][-1]
    # friction that changes nothing leaves the accurate solution as it is, on every grid
    for name in ("total_force", "depth", "area"):
        values = [getattr(each, name) for each in found.solutions[0]]
        assert values == pytest.approx([getattr(smooth, name)] * 3)
    assert not found.extrapolate


@pytest.mark.parametrize(("friction", "floor"), [pytest.param(0.2, 5e-4, marks=pytest.mark.slow), (np.inf, 1e-4)])
def test_a_face_is_solved_once_and_scaled(friction, floor):
    found = study(ONE, PIN, friction, 0.05e-3, 0.2e-3)
    assert (found.least_error, found.least_area_error, found.extrapolate, found.most_order) == (floor, 0.0, True, 1.0)
    for one, other in zip(*found.solutions, strict=True):
        assert (one.depth, other.depth) == (pytest.approx(0.05e-3), pytest.approx(0.2e-3))
        assert other.total_force == pytest.approx(4 * one.total_force)
        np.testing.assert_allclose(other.shear, 4 * one.shear)
        assert one.area == pytest.approx(np.pi * PIN.radius**2, rel=0.01)
    if friction < np.inf:
        known = press_with_friction(ONE, PIN, 0.2e-3, friction, rings=24)
        forces = [each.total_force for each in found.solutions[1]]
        assert found.combine(found.solutions[1], lambda each: each.total_force) == pytest.approx(known.force, rel=4e-3)
        assert forces == pytest.approx([known.force] * 3, rel=0.03)
    by_load = study(ONE, PIN, friction, 0.3, control="load").solutions[0]
    assert [each.total_force for each in by_load] == pytest.approx([0.3] * 3)


def stiffen(length, over):
    """Two layers whose top is so stiff that its stretch decays over a length, relative to another one."""
    low, high = 1e5, 1e12
    for _ in range(60):
        middle = np.sqrt(low * high)
        cover = stack_layers((2e-3, 1e5, 0.45), (0.1e-3, middle, 0.4))
        low, high = (middle, high) if membrane_length(cover) < length * over(cover) else (low, middle)
    return cover


@pytest.mark.parametrize(("length", "is_foil"), [(3.9, False), (4.1, True)])
def test_a_face_on_a_stiff_foil_is_not_extrapolated(length, is_foil, monkeypatch):
    seen = []
    monkeypatch.setattr(rubbing, "_press", lambda _path, _place, _progress, grid: seen.append(grid) or [None])
    monkeypatch.setattr(small_strain, "build_solution", lambda *_, **__: None)
    monkeypatch.setattr(rubbing, "scale_to_target", lambda *_: None)
    found = study(stiffen(length, lambda cover: cover.thickness), PIN, 0.2, 0.1e-3)
    assert found.extrapolate is not is_foil
    assert seen == [(cells, 1) for cells in (GRIDS if is_foil else CELLS)[:3]]


@pytest.mark.slow
def test_cells_are_widened_until_they_span_the_contact(monkeypatch):
    monkeypatch.setattr(rubbing, "GRIDS", (16, 16, 16))
    wide = study(ONE, BALL, 0.5, 0.12e-3).solutions[0]
    monkeypatch.setattr(result_store, "fetch", lambda _kind, _inputs, compute: compute())
    monkeypatch.setattr(rubbing, "_MARGIN", 0.8)
    grown = study(ONE, BALL, 0.5, 0.12e-3).solutions[0]
    for one, other in zip(wide, grown, strict=True):
        assert other.total_force == pytest.approx(one.total_force, rel=0.01)
        assert other.area == pytest.approx(one.area, rel=0.05)


@pytest.mark.parametrize(
    ("cover", "indenter", "pose", "word"),
    [
        (replace(ONE, base="sliding", size=(9e-3, 9e-3)), BALL, Pose(), None),
        (replace(ONE, base="sliding", size=(9e-3, 9e-3)), BALL, Pose.planar(at=(1e-3, 0.0)), "slides on its base"),
        (replace(ONE, base="sliding", size=(9e-3, 9e-3)), BALL, Pose.planar(at=(0.0, 1e-3)), "slides on its base"),
        (replace(ONE, base="sliding", size=(9e-3, 9e-3)), Box(size=(2e-3,) * 3), Pose.planar(yaw=0.3), "slides"),
        (replace(ONE, base="sliding"), BALL, Pose.planar(at=(1e-3, 2e-3)), None),
        (replace(ONE, size=(9e-3, 9e-3)), BALL, Pose.planar(at=(1e-3, 2e-3)), None),
        (replace(stiffen(1.9, decay_length), size=(40e-3, 40e-3)), BALL, Pose(), None),
        (replace(stiffen(2.1, decay_length), size=(40e-3, 40e-3)), BALL, Pose(), "so stiff"),
        (stiffen(2.1, decay_length), BALL, Pose(), None),
    ],
)
def test_shear_that_is_not_resolved_is_refused(cover, indenter, pose, word, monkeypatch):
    def pass_on(*_):
        raise PassedError

    monkeypatch.setattr(small_strain, "respond", pass_on)
    path = LoadingPath(cover=cover, indenter=indenter, targets=(0.1,), control="load", friction=0.4)
    with pytest.raises(UnsupportedError if word else PassedError, match=word):
        rubbing.study_path(path, Place(array=TexelArray.grid(3, 3, 3e-3), pose=pose), None)


def test_the_response_of_the_base_has_its_shear_on_all_grids(monkeypatch):
    radius = np.linspace(0, 1e-2, 9)
    plain = PointSpread(radius=radius, pressure_per_force=np.ones(9), reaction=1.0, thickness=2e-3)
    finest = replace(plain, reaction=0.9, coarse=(plain, replace(plain, reaction=0.8)))
    monkeypatch.setattr(small_strain, "respond", lambda *_: finest)
    monkeypatch.setattr(rubbing, "spread_shear", lambda cover: ("shear of", cover))
    response = study(ONE, PIN, np.inf, 0.1e-3).solutions[0][0].base.parts[0][1].response
    assert [each.reaction for each in response.on_grids] == [1.0, 0.8, 0.9]
    assert [each.shear for each in response.on_grids] == [("shear of", ONE)] * 3
