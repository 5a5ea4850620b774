"""The load curve equals the electronics of the fast model."""

import numpy as np
import pytest

from tests.support.stamp import CURVE, OUTPUT_MAX


def test_the_load_curve_is_that_of_the_fast_models_electronics():
    forces = np.linspace(0, 2, 78)
    gains = np.linspace(0.5, 1.5, 78)
    for gain in (None, gains):
        whole = CURVE.electronics(31.25, gain).counts(forces)
        assert np.abs(CURVE.counts(forces, 1.0 if gain is None else gain) - whole).max() <= 0.5 + 1e-9
    assert CURVE.counts(np.array([0.0, 0.0499]))[1] == 0
    assert CURVE.counts(np.array([0.06]))[0] == pytest.approx(60)
    assert CURVE.counts(np.array([100.0]))[0] == pytest.approx(OUTPUT_MAX)
