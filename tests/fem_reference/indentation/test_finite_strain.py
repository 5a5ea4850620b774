"""Coarse grids at finite strain against fine ones, and base forces of blocks against integrals by hand."""

import time

import numpy as np
import pytest

from fem_reference import press_path
from fem_reference.indentation import finite_strain
from fem_reference.indentation.finite_strain import integrate_spline
from meshes import Cylinder, TexelArray
from meshes.pose import Pose
from tests.support.rubber import make_cover

ARRAY = TexelArray.grid(2, 3, (4e-3, 5e-3), active=np.arange(6) != 4, texel_size=(3e-3, 4.4e-3))


def pressure(x, y):
    return 1e3 * (2 + 100 * x - 50 * y + 2e4 * x * y + 3e4 * x**2)


@pytest.mark.parametrize("pose", [Pose.planar(at=(0.3e-3, -0.2e-3), yaw=0.3), Pose.planar(at=(5e-3, 0.0))])
def test_a_polynomial_pressure_is_integrated_over_oblong_texels_and_the_rest(pose):
    grid = np.linspace(-8e-3, 8e-3, 21), np.linspace(-7e-3, 7e-3, 15)
    felt = integrate_spline((*grid, pressure(*np.meshgrid(*grid, indexing="ij"))), ARRAY, pose)
    assert felt.shape == (7,)
    steps = [((np.arange(200) + 0.5) / 200 - 0.5) * edge for edge in ARRAY.texel_size]
    for force, centre, active in zip(felt, ARRAY.centres, ARRAY.active, strict=False):
        x, y = pose.to_indenter(*np.meshgrid(centre[0] + steps[0], centre[1] + steps[1]))
        inside = (np.abs(x) < 8e-3) & (np.abs(y) < 7e-3)
        expected = np.where(inside, pressure(x, y), 0.0).mean() * np.prod(ARRAY.texel_size)
        assert force == pytest.approx(expected if active else 0.0, rel=1e-4 if inside.all() else 0.08)
    whole = 1e3 * (2 * 16e-3 * 14e-3 + 3e4 * 14e-3 * 2 * (8e-3) ** 3 / 3)
    assert felt.sum() == pytest.approx(whole)


@pytest.mark.slow
def test_coarse_grids_correct_a_flat_face_like_fine_ones(monkeypatch):
    """The usual grids (6, 9, 13) give 4.8035 N, and 2.4518 N on the middle texel, at 0.3 mm on 2 mm of rubber."""
    monkeypatch.setattr(finite_strain, "GRIDS", (2, 3, 4))
    array, started = TexelArray.grid(3, 3, pitch=3.4e-3), time.perf_counter()
    shallow, deep = press_path(make_cover(0.45), array, Cylinder(radius=2e-3), depths=[0.1e-3, 0.3e-3], fields=True)
    assert 0 < shallow.seconds + deep.seconds < time.perf_counter() - started
    assert deep.total_force == pytest.approx(4.8035, rel=1e-3)
    assert deep.texel_forces[4] == pytest.approx(2.4518, rel=1e-3)
    assert 3 < deep.total_force / shallow.total_force < 3.6  # it stiffens
    for found, depth in ((shallow, 0.1e-3), (deep, 0.3e-3)):
        assert found.depth == pytest.approx(depth)
        assert found.texel_forces.sum() + found.outside == pytest.approx(found.total_force, rel=5e-3)
        assert -found.contact_forces[:, 2].sum() == pytest.approx(found.total_force, rel=1e-6)
        assert found.contact_area == pytest.approx(np.pi * 4e-6, rel=1e-5)
        fields = found.fields
        under = (fields.position[:, 2] > 2e-3 - 1e-9) & (fields.position[:, 0] < 1.7e-3)
        assert under.sum() > 3
        np.testing.assert_allclose(fields.displacement[under, 2], -depth, rtol=0.02)
