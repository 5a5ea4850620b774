"""Comparison errors at their borders, which results are kept apart, and faces and centres without a value, by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import TexelArray
from tests.support.rubber import make_cover
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.credibility import uncertainty
from validation.credibility.uncertainty import ComparisonError, InputUncertainty, compare_quantities, propagate_inputs


def make_error(**changes):
    given = {"case": "a", "quantity": "b", "factor": 1e3, "fast": 4.5, "reference": 4.0}
    return ComparisonError(**given | {"u_num": 0.5, "u_input": 0.0, "u_data": 0.0} | changes)


@pytest.mark.parametrize(("fast", "resolved"), [(4.5, False), (4.5 + 1e-12, True), (3.5, False), (3.5 - 1e-12, True)])
def test_an_error_that_equals_its_uncertainty_is_not_resolved(fast, resolved):
    found = make_error(fast=fast)
    assert (found.resolved_here, found.resolved) == (resolved, resolved)


def test_the_interval_of_an_error_is_two_uncertainties_wide_on_both_sides():
    found = make_error(fast=5.25, u_num=0.3, u_input=0.4, u_data=1.2)
    assert found.u_val == pytest.approx(1.3)
    assert (found.least_error, found.largest_error) == pytest.approx((1.25 - 2.6, 1.25 + 2.6))
    unknown = make_error(u_input=math.nan)
    assert unknown.resolved is None
    assert unknown.resolved_here is False
    assert math.isnan(unknown.least_error)
    shown = found.as_json()
    assert (shown["E"], shown["u_val"]) == (pytest.approx(1.25), pytest.approx(1.3))
    assert (shown["resolved_with_shared_inputs"], shown["resolved"]) == (True, False)


def make_result(true, fast, load=5.0, error=0.023):
    reference = SimpleNamespace(texel_forces=np.array(true), error_estimate={"peak_texel": error})
    predictions = {"fast": SimpleNamespace(texel_forces=np.array(fast))}
    return SimpleNamespace(reference=reference, predictions=predictions, case=SimpleNamespace(load=load, name="a case"))


ARRAY = TexelArray.grid(1, 3, 2e-3)
INPUTS = InputUncertainty(load=5.0, uncertainties={}, image=np.array([1.0, 2.0, 1.0]), effects={})


@pytest.mark.parametrize(
    ("true", "fast", "image", "count"),
    [
        ([1.0, 3.0, 0.5], [1.0, 2.0, 0.5], [1.0, 2.0, 1.0], 4), ([1.0, 3.0, 0.5], [0.0] * 3, [1.0, 2.0, 1.0], 2),
        ([1.0, 3.0, -4.0], [1.0, 2.0, 0.5], [1.0, 2.0, 1.0], 2), ([1.0, 3.0, 0.5], [1.0, 2.0, 0.5], [0.0] * 3, 2),
    ],
)  # fmt: skip
def test_centres_are_compared_where_all_three_images_have_one(true, fast, image, count):
    inputs = dataclasses.replace(INPUTS, image=np.array(image))
    found = compare_quantities(ARRAY, make_result(true, fast), inputs, 0.2)
    assert len(found) == count
    assert {each.case for each in found} == {"a case"}
    peak, total = found[:2]
    # the texel is that of the largest force of the reference
    assert (peak.fast, peak.reference, peak.u_data) == pytest.approx((fast[1], 3.0, 0.6))
    assert (total.fast, total.reference) == pytest.approx((sum(fast), sum(true)))
    assert total.u_data == pytest.approx(0.2 * abs(sum(true)))
    assert peak.u_num == pytest.approx(math.hypot(0.02 * 3.0, 2e-4 * 5.0))
    assert {each.u_input for each in found} == {0.0}


BALL = Case.read("ball", "sphere:radius=5mm", "3 N", at="1mm,-2mm", yaw="10deg")
ONLY = Inputs(modulus=0.2, poisson_ratio=0.0, thickness=0.0, position=0.0, yaw=0.0, friction=0.0)


def make_image(_cover, array, case):
    """A made-up image that depends on all that a result is kept for."""
    return np.array([
        array.centres.sum() + 7 * array.active.sum(), 1e3 * array.texel_size[0], 1e4 * case.indenter.footprint[0],
        1e3 * case.pose.at[0], 1e3 * case.pose.at[1], case.pose.yaw, case.load,
    ])  # fmt: skip


GRID = TexelArray.grid(2, 3, 2e-3)
MOVED = dataclasses.replace(BALL, pose=dataclasses.replace(BALL.pose, point=(1e-3, 3e-3, 0.0)))


@pytest.mark.parametrize(
    ("array", "case"),
    [
        (dataclasses.replace(GRID, centres=GRID.centres + 1e-3), BALL),
        (dataclasses.replace(GRID, active=np.arange(6) > 0), BALL),
        (dataclasses.replace(GRID, texel_size=(1.1e-3, 1.3e-3)), BALL),
        (GRID, Case.read("ball", "sphere:radius=4mm", "3 N", at="1mm,-2mm", yaw="10deg")), (GRID, MOVED),
    ],
)  # fmt: skip
def test_a_result_is_kept_for_one_array_body_and_place(array, case, monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    monkeypatch.setattr(uncertainty, "simulate_image", make_image)
    cover = make_cover(0.4)
    first = propagate_inputs(cover, GRID, BALL, ONLY).image
    assert first == pytest.approx(make_image(cover, GRID, BALL))
    found = propagate_inputs(cover, array, case, ONLY).image
    assert found == pytest.approx(make_image(cover, array, case))
    assert np.abs(found - first).max() > 1e-3
    # what was kept is read again, and nothing is computed
    monkeypatch.setattr(uncertainty, "simulate_image", lambda *_: pytest.fail("computed again"))
    assert propagate_inputs(cover, GRID, BALL, ONLY).image == pytest.approx(first)
