"""Presses on few cells: a face as wide as a column, a ball beside the sides of a cover, and one that rubs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import rubbing, small_strain
from fem_reference.small_strain_contact import free_edges
from meshes import Box, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.exact.rings import press_with_friction
from tests.support.rubber import stack_layers

H, YOUNG = 2e-3, 1e6
BALL = Sphere(radius=5e-3)
ONE = stack_layers((H, YOUNG, 0.3))
ARRAY = TexelArray.grid(2, 2, 2e-3)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Sixteen cells on all grids, coarse meshes of the sides, and no response of the base."""
    monkeypatch.setattr(rubbing, "GRIDS", (16, 16, 16))
    monkeypatch.setattr(small_strain, "CELLS", (16, 16, 16))
    monkeypatch.setattr(small_strain, "respond", lambda *_: None)
    monkeypatch.setattr(free_edges, "_SETTINGS", replace(free_edges.SideSettings(), parts=1))


def press(cover, indenter, target, friction=0.0, *, control="depth", pose=None):
    path = LoadingPath(cover=cover, indenter=indenter, targets=(target,), control=control, friction=friction)
    place = Place(array=ARRAY, pose=pose or Pose())
    study = rubbing.study_path if friction else small_strain.study_path
    return study(path, place, None).solutions[0][-1]


def test_a_face_wider_than_a_column_compresses_it_evenly():
    """Without transverse strain there is nothing to rub: force = E A depth / H, at half of force times depth."""
    friction = 0.3
    pose = Pose.planar(at=(0.1e-3, 0.0))
    column = stack_layers((H, YOUNG, 0.0), size=(1.2e-3, 1.6e-3))
    found = press(column, Box(size=(4e-3, 4e-3, 1e-3)), 0.1e-3, friction, pose=pose)
    exact = YOUNG * 1.2e-3 * 1.6e-3 * 0.1e-3 / H
    assert found.total_force == pytest.approx(exact, rel=0.05)
    assert found.area == pytest.approx(1.2e-3 * 1.6e-3, rel=1e-3)
    assert found.energy == pytest.approx(found.total_force * 0.05e-3, rel=1e-3)
    pressed = found.contact
    # The resultant acts in the middle of the column, in the frame of the face.
    assert pressed[:, 2] @ pressed[:, :2] / found.total_force == pytest.approx(-np.array(pose.at), abs=2e-5)
    x, y = pose.to_array(*pressed[:, :2].T)
    assert max(np.abs(x).max() / 0.6e-3, np.abs(y).max() / 0.8e-3) < 1
    assert np.abs(found.shear).sum() < 0.2 * exact


def test_a_ball_beside_a_side_meets_less_resistance_and_mirrors():
    cover = replace(ONE, size=(5e-3, 9e-3))
    inside = press(ONE, BALL, 0.12e-3)
    one, other = (press(cover, BALL, 0.12e-3, pose=Pose.planar(at=(x, 0.0))) for x in (1.9e-3, -1.9e-3))
    assert one.total_force < 0.97 * inside.total_force
    assert other.total_force == pytest.approx(one.total_force, rel=1e-6)
    assert other.contact[:, 2] @ other.contact[:, 0] == pytest.approx(-one.contact[:, 2] @ one.contact[:, 0], rel=1e-4)
    # The contact ends at the side, 0.6 mm from the axis, where nothing else is cut.
    assert one.contact[:, 0].max() <= 0.6e-3 < -one.contact[:, 0].min()
    assert one.energy < inside.energy


def test_a_ball_with_friction_presses_as_the_solution_on_rings():
    friction = 0.15
    known = press_with_friction(ONE, BALL, 0.12e-3, friction, rings=8)
    found = press(ONE, BALL, 0.12e-3, friction)
    assert found.total_force == pytest.approx(known.force, rel=0.01)
    assert found.area == pytest.approx(np.pi * known.contact_radius**2, rel=0.08)
    pressure, shear = found.contact[:, 2], np.hypot(*found.shear.T)
    assert (shear <= friction * (pressure + 2e-3 * pressure.max())).all()
    assert shear.max() > 0.9 * friction * np.median(pressure)
    assert (np.sum(found.shear * found.contact[:, :2], axis=1)[shear > 0.1 * shear.max()] > 0).all()
    assert np.abs(found.shear.sum(axis=0)).max() < 1e-3 * shear.sum()
    assert 0.36 < found.energy / (found.total_force * found.depth) < 0.42
