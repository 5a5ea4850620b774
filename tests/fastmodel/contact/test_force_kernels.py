"""Forces on box texels from the sums of their contacts."""

import numpy as np
import pytest

from fastmodel.contact import forces as kernels


@pytest.mark.parametrize(
    ("pushed", "expected"),
    [
        ([2.0, 1.0, 0.5], [2.0, 1.0, 0.5]),
        ([2.0, 1.0, -0.5], [2.0 * 2.5 / 3, 2.5 / 3, 0.0]),  # a pulled box reads 0, the others keep the sum
        ([1.0, -3.0], [0.0, 0.0]),
        ([-1.0, -3.0], [0.0, 0.0]),
        ([0.0, -3.0], [0.0, 0.0]),
        ([0.0, 0.0], [0.0, 0.0]),
    ],
)
def test_pulled_boxes_read_zero_and_the_sum_is_kept(monkeypatch, pushed, expected):
    fronts = np.zeros((len(pushed), 3))
    fronts[:, 2] = -np.array(pushed)
    sums = (None, fronts, None, 0.25)
    monkeypatch.setattr(kernels, "sum_contacts", lambda *_: sums)
    forces, total, found = kernels.press_boxes(None, np.zeros((0, 9)), np.zeros((0, 3)), None)
    np.testing.assert_allclose(forces, expected)
    assert total == pytest.approx(sum(pushed) + 0.25)
    assert found is sums
