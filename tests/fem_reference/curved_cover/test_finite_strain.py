from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from fem_reference.errors import ConvergenceError
from fem_reference.finite_strain.contact_problem import PathSettings
from meshes import Material, Sphere
from meshes.pose import Pose
from meshes.solids import phalanx
from meshes.solids.covers import take_meshes

NEO = Material(name="neo", model="neo-hookean", parameters={"shear_modulus": 3e5}, poisson_ratio=0.49)
BALL = Sphere(radius=4e-3)
DOWN = [0.0, 0, -1]
SMALL = phalanx(length=6e-3, rows=1, columns=1, pitch=2e-3)
MESHES = [SMALL.mesh(size, layers=2) for size in (3e-3, 2.4e-3)]


@pytest.mark.slow
def test_the_limit_of_small_loads_is_small_strain_and_the_base_bears_the_load():
    pose = Pose.facing([1e-3, 0.3e-3, 12e-3], [-0.1, 0, -1])
    small = press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, load=2e-3)
    found = press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, load=2e-3, strain="finite")
    assert found.depth == pytest.approx(small.depth, rel=5e-3)
    np.testing.assert_allclose(found.texel_forces, small.texel_forces, rtol=0.01)
    np.testing.assert_allclose(found.base_force, found.force, atol=1e-5 * found.total_force)
    np.testing.assert_allclose(found.base_moment, found.moment, atol=1e-5 * found.total_force * 8e-3)
    assert "finite" in found.assumptions["strain"]


@pytest.mark.slow
def test_a_deep_press_differs_from_small_strain():
    pose = Pose.facing([0, 0, 12e-3], DOWN)
    small = press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, depth=1.2e-3)
    found = press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, depth=1.2e-3, strain="finite")
    share, before = found.texel_forces[0] / found.total_force, small.texel_forces[0] / small.total_force
    assert share > 1.04 * before
    assert not any("strains are not small" in sentence for sentence in found.warnings)
    assert any("strains are not small" in sentence for sentence in small.warnings)
    assert found.contact_forces[:, 2].max() <= 0
    np.testing.assert_allclose(found.contact_forces.sum(axis=0), found.force, atol=1e-6 * found.total_force)
    again = press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, depth=1.2e-3, strain="finite")
    assert again.mesh is MESHES[0]  # finite strain was solved on the last mesh but one
    np.testing.assert_array_equal(again.contact_points, found.contact_points)


@pytest.mark.slow
def test_a_path_that_stops_early_names_how_far_it_came(monkeypatch):
    pose = Pose.facing([0, 0, 12e-3], DOWN)
    monkeypatch.setattr("fem_reference.finite_strain.contact_problem._SETTINGS", PathSettings(iterations=1))
    with pytest.raises(ConvergenceError, match=r"no convergence even at a depth of .* mm"):
        press(take_meshes(MESHES, NEO), SMALL.texels, BALL, pose, depth=1.1e-3, strain="finite")
