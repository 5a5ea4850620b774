import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fastmodel.pose import Mount, make_quaternions, make_z_rotation, multiply, rotate


def test_rotations_equal_scipys():
    turns = Rotation.random(20, rng=np.random.default_rng(0))
    ours = turns.as_quat(scalar_first=True)
    again = make_quaternions(turns.as_matrix())
    assert np.allclose(np.abs(np.sum(ours * again, axis=1)), 1)
    vectors = np.random.default_rng(1).normal(size=(7, 3))
    assert np.allclose(rotate(ours[3], vectors), turns[3].apply(vectors))
    product = multiply(ours[3], ours)
    assert np.allclose(rotate(product[5], vectors), (turns[3] * turns[5]).apply(vectors))
    assert np.allclose(rotate(make_z_rotation(0.3), vectors), Rotation.from_euler("z", 0.3).apply(vectors))


def test_poses_are_normalised_and_checked():
    assert Mount.of([0, 0, 0], [2, 0, 0, 0]).quaternion.tolist() == [1, 0, 0, 0]
    with pytest.raises(ValueError, match="3 and 4 numbers"):
        Mount.of([0, 0], [1, 0, 0, 0])
    with pytest.raises(ValueError, match="finite"):
        Mount.of([0, 0, np.nan], [1, 0, 0, 0])


components = st.floats(-1, 1)
vectors = st.tuples(components, components, components).map(np.array)


@st.composite
def quaternions_of_unit_length(draw):
    values = np.array(draw(st.tuples(components, components, components, components)))
    assume(np.linalg.norm(values) > 0.1)
    return values / np.linalg.norm(values)


@given(quaternions_of_unit_length(), vectors, vectors)
def test_rotation_preserves_lengths_and_angles(quaternion, one, other):
    turned = rotate(quaternion, np.array([one, other]))
    assert np.linalg.norm(turned, axis=1) == pytest.approx(np.linalg.norm([one, other], axis=1), abs=1e-12)
    assert turned[0] @ turned[1] == pytest.approx(one @ other, abs=1e-12)


@given(quaternions_of_unit_length(), quaternions_of_unit_length(), vectors)
def test_the_product_rotates_by_the_second_factor_first(first, second, vector):
    both = rotate(multiply(first, second), vector[None])
    assert both == pytest.approx(rotate(first, rotate(second, vector[None])), abs=1e-12)


@given(quaternions_of_unit_length(), vectors)
def test_the_conjugate_undoes_a_rotation(quaternion, vector):
    conjugate = quaternion * [1, -1, -1, -1]
    assert rotate(conjugate, rotate(quaternion, vector[None]))[0] == pytest.approx(vector, abs=1e-12)
