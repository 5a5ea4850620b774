import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel.pose import Pose, about_z, multiply, quaternions, rotate


def test_scipy_agrees():
    turns = Rotation.random(20, rng=np.random.default_rng(0))
    ours = turns.as_quat(scalar_first=True)
    again = quaternions(turns.as_matrix())
    assert np.allclose(np.abs(np.sum(ours * again, axis=1)), 1)
    vectors = np.random.default_rng(1).normal(size=(7, 3))
    assert np.allclose(rotate(ours[3], vectors), turns[3].apply(vectors))
    product = multiply(ours[3], ours)
    assert np.allclose(rotate(product[5], vectors), (turns[3] * turns[5]).apply(vectors))
    assert np.allclose(rotate(about_z(0.3), vectors), Rotation.from_euler("z", 0.3).apply(vectors))


def test_poses_are_checked():
    assert Pose.of([0, 0, 0], [2, 0, 0, 0]).quaternion.tolist() == [1, 0, 0, 0]
    with pytest.raises(ValueError, match="3 and 4 numbers"):
        Pose.of([0, 0], [1, 0, 0, 0])
    with pytest.raises(ValueError, match="finite"):
        Pose.of([0, 0, np.nan], [1, 0, 0, 0])
