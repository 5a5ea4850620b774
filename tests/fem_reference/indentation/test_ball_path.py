"""A ball pressed to ascending depths on one coarse grid: what is kept of a path that stops."""

import pytest

from fem_reference.finite_strain.newton import PathConvergenceError
from fem_reference.indentation.ball_path import _keep_reached


@pytest.mark.parametrize(("reached", "kept"), [(2.5, [1.0, 2.0]), (3.0, [1.0, 2.0, 3.0]), (9.0, [1.0, 2.0, 3.0])])
def test_all_depths_that_a_stopped_path_reached_are_kept(reached, kept):
    error = PathConvergenceError("stopped", cause="too far", depth=reached)
    assert _keep_reached([1.0, 2.0, 3.0, 4.0], error) == kept


def test_a_path_that_reached_no_depth_fails():
    error = PathConvergenceError("stopped", cause="too far", depth=0.5)
    with pytest.raises(PathConvergenceError, match="stopped"):
        _keep_reached([1.0, 2.0], error)
