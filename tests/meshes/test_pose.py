"""Planar poses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from meshes.pose import Pose
from tests.support.rotated_poses import rotated_pose

LENGTHS = st.floats(-0.1, 0.1)
POSES = st.builds(Pose.planar, at=st.tuples(LENGTHS, LENGTHS), yaw=st.floats(-20, 20))
POINTS = st.lists(st.tuples(LENGTHS, LENGTHS), min_size=1, max_size=5).map(lambda points: np.array(points).T)


@given(pose=POSES, points=POINTS)
def test_each_transformation_is_the_inverse_of_the_other(pose, points):
    np.testing.assert_allclose(pose.to_indenter(*pose.to_array(*points)), points, atol=1e-15)
    np.testing.assert_allclose(pose.to_array(*pose.to_indenter(*points)), points, atol=1e-15)


@given(quarters=st.integers(-8, 8), points=POINTS)
def test_quarter_turns_are_exact(quarters, points):
    pose = Pose.planar(yaw=quarters * np.pi / 2)
    assert pose.is_aligned
    x, y = points
    assert np.array_equal(pose.to_array(x, y), ((x, y), (-y, x), (-x, -y), (y, -x))[quarters % 4])


def test_the_yaw_turns_counterclockwise_and_an_indenter_that_looks_down_has_the_axes_of_the_array():
    assert Pose.planar(yaw=np.pi / 6).to_array(1.0, 0.0) == pytest.approx((np.sqrt(3) / 2, 0.5))
    assert not Pose.planar(yaw=np.pi / 6).is_aligned
    pose = Pose.facing([1e-3, 2e-3, 3e-3], [0, 0, -2.0])
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    np.testing.assert_allclose(pose.points_to_indenter(np.array([1e-3, 3e-3, 5e-3])), [0, 1e-3, 2e-3])


@pytest.mark.parametrize("direction", [(1, 2, -3), (0, 1, 0), (0, -1, 0), (1, 0, 0)])
def test_an_indenter_looks_along_its_direction(direction):
    pose = Pose.facing([0, 0, 0], direction, spin=0.3)
    np.testing.assert_allclose(-pose.rotation[:, 2], np.array(direction) / np.linalg.norm(direction), atol=1e-15)
    np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(pose.vectors_to_indenter(pose.rotation[:, 0]), [1, 0, 0], atol=1e-15)


@pytest.mark.parametrize("direction", [(1, 2, -3), (0, -1, 0), (0, 0, -1)])
def test_a_rotation_is_given_back(direction):
    pose = Pose(point=(1e-3, 2e-3, 3e-3), direction=direction, yaw=0.4, tilt=(0.2, -0.1))
    same = rotated_pose(pose.point, pose.rotation)
    np.testing.assert_allclose(same.rotation, pose.rotation, atol=1e-14)
    assert same.tilt == (0.0, 0.0)


def test_tilt_is_a_rotation_vector_in_the_frame_of_the_indenter():
    pose = Pose.planar(yaw=0.7, tilt=(0.2, -0.1))
    wanted = Rotation.from_euler("z", 0.7) * Rotation.from_rotvec([0.2, -0.1, 0.0])
    np.testing.assert_allclose(pose.rotation, wanted.as_matrix(), atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Pose(point=(0, 0)), "3 finite"),
        (lambda: Pose(tilt=(0, np.nan)), "2 finite"),
        (lambda: Pose(yaw=np.inf), "finite"),
        (lambda: Pose(direction=(0, 0, 0)), "zero"),
    ],
)
def test_wrong_poses_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
