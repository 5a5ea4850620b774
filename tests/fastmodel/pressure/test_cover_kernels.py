import dataclasses

import numpy as np
import pytest

from meshes import TexelArray
from tests.support.cover_data import cells

CELLS = cells()


def test_foundation_modulus_is_that_of_a_square_patch():
    """A foundation of this modulus yields under uniform pressure by the mean displacement of the patch."""
    n = 9  # 4 thicknesses of 2 mm in cells of 0.85 mm
    rows, columns = np.divmod(np.arange(n * n), n)
    matrix = CELLS.compliance[np.abs(np.subtract.outer(rows, rows)), np.abs(np.subtract.outer(columns, columns))]
    assert CELLS.foundation_modulus() == pytest.approx(1 / matrix.sum(axis=1).mean(), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"influence": np.zeros((4, 5))}, "influence has shape"),
        ({"compliance": np.full((3, 3), np.nan)}, "finite"),
        ({"top_compliance": 0.0}, "top_compliance must be positive"),
        ({"thickness": -1.0}, "thickness"),
        ({}, "pitch"),
    ],
)
def test_bad_kernels_and_cells_that_do_not_divide_the_pitch_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(CELLS, **change).check(TexelArray.grid(4, 4, 3.0e-3))
