from __future__ import annotations

import numpy as np
import pytest

from meshes.spatial_pose import SpatialPose


def test_an_indenter_that_looks_down_has_the_axes_of_the_array():
    pose = SpatialPose.facing([1e-3, 2e-3, 3e-3], [0, 0, -2.0])
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    np.testing.assert_allclose(pose.to_indenter(np.array([1e-3, 3e-3, 5e-3])), [0, 1e-3, 2e-3])


@pytest.mark.parametrize("direction", [(1, 2, -3), (0, 1, 0), (0, -1, 0), (1, 0, 0)])
def test_an_indenter_looks_along_its_direction(direction):
    pose = SpatialPose.facing([0, 0, 0], direction, spin=0.3)
    np.testing.assert_allclose(-pose.rotation[:, 2], np.array(direction) / np.linalg.norm(direction), atol=1e-15)
    np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(pose.turn_to_indenter(pose.rotation[:, 0]), [1, 0, 0], atol=1e-15)


def test_spin_turns_from_x_towards_y():
    pose = SpatialPose.facing([0, 0, 0], [0, 0, -1], spin=np.pi / 2)
    np.testing.assert_allclose(pose.rotation[:, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("rotation", "message"),
    [(np.diag([1.0, 1, -1]), "right-handed"), (2 * np.eye(3), "orthogonal"), (np.eye(2), "3 x 3")],
)
def test_a_matrix_that_is_no_rotation_is_refused(rotation, message):
    with pytest.raises(ValueError, match=message):
        SpatialPose(position=np.zeros(3), rotation=rotation)
    with pytest.raises(ValueError, match="must not be zero"):
        SpatialPose.facing([0, 0, 0], [0, 0, 0])
