"""The force at which counts reach a level."""

import numpy as np
import pytest

from validation.regression.experiments import _find_force


@pytest.mark.parametrize("level", [1, 37, 2000])
def test_the_smallest_force_that_reaches_a_level_is_found(level):
    found = _find_force(lambda force: np.floor(1000 * force), level)
    assert found == pytest.approx(level / 1000, rel=1e-9)
    assert np.floor(1000 * found) >= level
