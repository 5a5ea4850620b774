"""The load curve equals the electronics of the fast model."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.stamp import CURVE, OUTPUT_MAX
from validation.calibration.stamp.load_curve import LoadCurve


def test_the_load_curve_is_that_of_the_fast_models_electronics():
    forces = np.linspace(0, 2, 78)
    gains = np.linspace(0.5, 1.5, 78)
    for gain in (None, gains):
        whole = CURVE.electronics(31.25, gain).counts(forces)
        assert np.abs(CURVE.counts(forces, 1.0 if gain is None else gain) - whole).max() <= 0.5 + 1e-9
    assert CURVE.counts(np.array([0.0, 0.0499]))[1] == 0
    assert CURVE.counts(np.array([0.06]))[0] == pytest.approx(60)
    assert CURVE.counts(np.array([100.0]))[0] == pytest.approx(OUTPUT_MAX)


CURVES = st.builds(
    LoadCurve,
    sensitivity=st.floats(200, 5e4),
    dead_force=st.floats(1e-4, 0.5),
    saturation_band=st.floats(10, 3000),
    output_max=st.just(OUTPUT_MAX),
)


@given(CURVES, st.lists(st.floats(0, 20), min_size=2, max_size=10))
def test_counts_rise_with_force_from_zero_to_the_largest_count(curve, forces):
    counts = curve.counts(np.sort(np.array(forces)))
    assert (np.diff(counts) >= -1e-9).all()
    assert counts.min() >= 0
    assert counts.max() <= OUTPUT_MAX + 1e-9
    assert curve.counts(np.array([0.999 * curve.dead_force]))[0] == 0


@given(CURVES)
def test_curve_comes_back_from_the_vector_of_the_fit(curve):
    again = LoadCurve.from_vector(curve.vector, OUTPUT_MAX)
    assert dataclasses.astuple(again) == pytest.approx(dataclasses.astuple(curve))
