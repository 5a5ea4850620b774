import numpy as np
from scipy.spatial.transform import Rotation

from fastmodel.pose import make_quaternions, rotate


def test_rotations_equal_scipys():
    turns = Rotation.random(20, rng=np.random.default_rng(0))
    ours = turns.as_quat(scalar_first=True)
    again = make_quaternions(turns.as_matrix())
    assert np.allclose(np.abs(np.sum(ours * again, axis=1)), 1)
    vectors = np.random.default_rng(1).normal(size=(7, 3))
    assert np.allclose(rotate(ours[3], vectors), turns[3].apply(vectors))
