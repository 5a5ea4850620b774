"""Coarse grids at finite strain against fine ones, a ball on one grid, and covers that could slide away."""

import time

import numpy as np
import pytest

from fem_reference import press, press_path
from fem_reference.indentation import finite_strain
from fem_reference.indentation.ball_path import press_ball
from meshes import Cylinder, Sphere, TexelArray
from meshes.pose import Pose
from tests.support.rubber import make_cover


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


def test_one_coarse_grid_gives_loads_contacts_and_base_pressures():
    """Hertz on a thick cover; `press` on its usual grids gives 1.1677 N at 0.3 mm on 2 mm of rubber."""
    ball, depth = 4e-3, 0.05e-3
    path = press_ball(make_cover(0.45, thickness=20e-3), ball, [depth])
    assert path.load[0] == pytest.approx(4 / 3 * 1e6 / (1 - 0.45**2) * np.sqrt(ball) * depth**1.5, rel=0.05)
    assert path.contact_radius[0] == pytest.approx(np.sqrt(ball * depth), rel=0.05)
    path = press_ball(make_cover(0.45), ball, [0.1e-3, 0.3e-3])
    assert path.load[1] == pytest.approx(1.1677, rel=2e-3)
    for base in path.base:
        r = np.linspace(0, 14e-3, 4000)
        assert np.trapezoid(2 * np.pi * r * base.pressure(r), r) == pytest.approx(1, abs=0.01)


def test_sliding_cover_that_would_slip_away_is_refused():
    with pytest.raises(ValueError, match="slides on its base stays where it is only under a shape that mirrors"):
        press(
            make_cover(0.45, thickness=4e-3, size=(8e-3, 6e-3), base="sliding"),
            TexelArray.grid(1, 2, 3e-3),
            Sphere(radius=4e-3),
            load=1.0,
            pose=Pose.planar(at=(1e-3, 0.0)),
        )
