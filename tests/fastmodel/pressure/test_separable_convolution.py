import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import convolve2d

from fastmodel.surface import SymmetricConvolution, factorise
from tests.support.cover_data import cells


@settings(max_examples=20, deadline=None)
@given(rows=st.integers(2, 24), columns=st.integers(2, 24), seed=st.integers(0, 1000))
def test_separable_convolution_equals_the_dense_one(rows, columns, seed):
    quarter = cells().compliance
    mirrored = np.concatenate([quarter[:0:-1], quarter])
    full = np.concatenate([mirrored[:, :0:-1], mirrored], axis=1)
    window = np.random.default_rng(seed).uniform(-1, 1, (rows, columns))
    first, second = SymmetricConvolution(quarter).matrices(rows, columns)
    terms = zip(first.reshape(-1, rows, rows), second.reshape(-1, columns, columns), strict=True)
    found = sum(a @ window @ b for a, b in terms)
    middle = len(quarter) - 1, quarter.shape[1] - 1
    dense = convolve2d(window, full)[middle[0] : middle[0] + rows, middle[1] : middle[1] + columns]
    np.testing.assert_allclose(found, dense, atol=1e-4 * np.abs(dense).max())


def test_factors_of_a_product_are_one_term():
    kernel = np.outer([1.0, 2.0, 0.5], [0.3, -0.2])
    along, across = factorise(kernel, 1e-9)
    assert along.shape == (1, 3)
    np.testing.assert_allclose(along.T @ across, kernel, atol=1e-15)
