"""A ball pressed to ascending depths on one coarse grid: what is kept of a path that stops."""

import numpy as np
import pytest

from fem_reference.finite_strain.newton import PathConvergenceError
from fem_reference.indentation.ball_path import _keep_reached, press_ball
from tests.support.rubber import make_cover


@pytest.mark.parametrize(("reached", "kept"), [(2.5, [1.0, 2.0]), (3.0, [1.0, 2.0, 3.0]), (9.0, [1.0, 2.0, 3.0])])
def test_all_depths_that_a_stopped_path_reached_are_kept(reached, kept):
    error = PathConvergenceError("stopped", cause="too far", depth=reached)
    assert _keep_reached([1.0, 2.0, 3.0, 4.0], error) == kept


def test_a_path_that_reached_no_depth_fails():
    error = PathConvergenceError("stopped", cause="too far", depth=0.5)
    with pytest.raises(PathConvergenceError, match="stopped"):
        _keep_reached([1.0, 2.0], error)


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
