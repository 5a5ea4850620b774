"""Forward models of the stamp: balance, symmetry and known defects."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.stamp import ARRAY, by_name
from validation.calibration.stamp.forward_models import overlap
from validation.recordings.series import STAMP_EDGE


def test_overlap_is_the_shared_area():
    share = overlap(ARRAY, 0.4e-3, 11e-3, 0.0)
    assert share.sum() == pytest.approx(1)
    low, high = ARRAY.centres[:, :2] - 1.7e-3, ARRAY.centres[:, :2] + 1.7e-3
    middle = np.array([0.4e-3, 11e-3])
    sides = np.clip(np.minimum(high, middle + STAMP_EDGE / 2) - np.maximum(low, middle - STAMP_EDGE / 2), 0, None)
    assert share == pytest.approx(sides.prod(axis=1) / STAMP_EDGE**2, abs=1e-12)


def test_overlap_turns_the_right_way_and_is_continuous():
    turned = overlap(ARRAY, 0.0, 0.0, np.pi / 4)
    assert turned == pytest.approx(overlap(ARRAY, 0.0, 0.0, -np.pi / 4), abs=1e-12)
    a, b = overlap(ARRAY, 1e-3, 2e-3, 0.2), overlap(ARRAY, 1e-3, 2e-3, -0.2)
    mirrored = overlap(ARRAY, -1e-3, 2e-3, -0.2).reshape(13, 6)[:, ::-1].ravel()
    assert a == pytest.approx(mirrored, abs=1e-12)
    assert np.abs(a - b).max() > 1e-3
    assert np.abs(overlap(ARRAY, 1e-3 + 1e-9, 2e-3, 0.2) - a).max() < 1e-5


@pytest.mark.parametrize("name", ["fast model", "uniform pressure", "reference", "edge-loaded punch"])
def test_forward_models_put_the_weight_on_the_array(name):
    """In the array's middle nearly all of a stamp's weight is felt; a thick cover loses a little at the sides."""
    for candidate in by_name(name).candidates((0.0, 8e-3)):
        thin = candidate.start.copy()
        thin[-1] = np.log(1e-3 if name in {"reference", "edge-loaded punch"} else 0.3)
        forces = candidate.texel_forces(thin)
        assert forces.sum() == pytest.approx(1, abs=5e-3)
        assert (forces[~ARRAY.active] == 0).all()
        assert set(candidate.describe(thin)) >= {"x_m", "y_m", "yaw_rad"}


def test_a_rigid_punch_loads_its_edges_more_than_uniform_pressure_does():
    def edge_share(name, log_width):
        candidate = by_name(name).candidates((0.0, 0.0))[0]
        shape = candidate.start.copy()
        shape[-1] = log_width
        image = candidate.texel_forces(shape).reshape(13, 6)
        return 1 - image[5:8, 2:4].sum()

    assert edge_share("edge-loaded punch", np.log(2e-3)) > edge_share("reference", np.log(2e-3))


def test_box_texels_split_the_load_by_contact_points_at_any_place():
    """The known defect of the fast model: sixteen touched texels share alike, and a millimetre changes nothing."""
    candidates = by_name("fast model").candidates((0.0, 8e-3))
    shape = np.array([np.log(0.15)])
    patterns = [candidate.texel_forces(shape) for candidate in candidates]
    alike = [p for p in patterns if np.count_nonzero(p > 0.01) == 16 and np.ptp(p[p > 0.01]) < 1e-3]
    assert alike
    undetermined = [c.describe(shape)["x_undetermined_m"] for c in candidates]
    assert max(undetermined) > 0.5e-3


@given(st.floats(-2.7e-3, 2.7e-3), st.floats(-10e-3, 10e-3), st.floats(-np.pi / 4, np.pi / 4))
def test_overlap_of_a_stamp_on_the_array_is_whole_and_keeps_its_centre(x, y, yaw):
    share = overlap(ARRAY, x, y, yaw)
    assert share.min() >= 0
    assert share.sum() == pytest.approx(1)
    assert share @ ARRAY.centres[:, :2] == pytest.approx((x, y), abs=0.5e-3)
    turned = overlap(ARRAY, -x, -y, yaw)
    assert turned == pytest.approx(share[::-1], abs=1e-12)
