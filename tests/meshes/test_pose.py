"""Planar poses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.pose import PlanarPose

LENGTHS = st.floats(-0.1, 0.1)
POSES = st.builds(PlanarPose, at=st.tuples(LENGTHS, LENGTHS), yaw=st.floats(-20, 20))
POINTS = st.lists(st.tuples(LENGTHS, LENGTHS), min_size=1, max_size=5).map(lambda points: np.array(points).T)


@given(pose=POSES, points=POINTS)
def test_each_transformation_is_the_inverse_of_the_other(pose, points):
    np.testing.assert_allclose(pose.to_indenter(*pose.to_array(*points)), points, atol=1e-15)
    np.testing.assert_allclose(pose.to_array(*pose.to_indenter(*points)), points, atol=1e-15)


@given(pose=POSES, points=POINTS)
def test_distances_are_kept_and_the_axis_is_at_its_position(pose, points):
    moved = np.array(pose.to_array(*points))
    before = np.hypot(*(points - points[:, :1]))
    assert np.hypot(*(moved - moved[:, :1])) == pytest.approx(before, abs=1e-15)
    assert pose.to_array(0.0, 0.0) == pose.at


@given(pose=POSES, points=POINTS)
def test_a_mirrored_pose_moves_mirrored_points_to_the_mirror_image(pose, points):
    mirrored = PlanarPose(at=(-pose.at[0], pose.at[1]), yaw=-pose.yaw)
    x, y = pose.to_array(*points)
    np.testing.assert_allclose(mirrored.to_array(-points[0], points[1]), (-x, y), atol=1e-15)


@given(quarters=st.integers(-8, 8), points=POINTS)
def test_quarter_turns_are_exact(quarters, points):
    pose = PlanarPose(yaw=quarters * np.pi / 2)
    assert pose.is_aligned
    x, y = points
    assert np.array_equal(pose.to_array(x, y), ((x, y), (-y, x), (-x, -y), (y, -x))[quarters % 4])


def test_the_yaw_turns_counterclockwise():
    assert PlanarPose(yaw=np.pi / 6).to_array(1.0, 0.0) == pytest.approx((np.sqrt(3) / 2, 0.5))
    assert not PlanarPose(yaw=np.pi / 6).is_aligned
