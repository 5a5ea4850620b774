"""Base forces of blocks at finite strain: a spline of the pressure, integrated over texels at any pose."""

import numpy as np
import pytest

from fem_reference.indentation.finite_strain import integrate_spline
from meshes import TexelArray
from meshes.pose import PlanarPose

ARRAY = TexelArray.grid(2, 3, (4e-3, 5e-3), active=np.arange(6) != 4, texel_size=(3e-3, 4.4e-3))


def pressure(x, y):
    return 1e3 * (2 + 100 * x - 50 * y + 2e4 * x * y + 3e4 * x**2)


@pytest.mark.parametrize("pose", [PlanarPose(at=(0.3e-3, -0.2e-3), yaw=0.3), PlanarPose(at=(5e-3, 0.0))])
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
