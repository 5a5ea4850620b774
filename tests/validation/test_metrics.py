"""Every metric by its definition, by a planted defect, and at its edges."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import wasserstein_distance_nd

from fastmodel import WTS_0614_34, Electronics
from meshes import TexelArray
from meshes.catalogue import ARRAYS
from validation import metrics

REPORT = """
0.4155 1.9561 2.1008 4.4211 5.1961 2.507 7.1055 2.1055 4.8926 3.324 7.4463 1.4706 8.4921 4.5565 1.0831 2.0215
1.3585 9.3324 2.9272 1.2885 7.6611 12.5677 1.9888 2.9038 2.5397 7.1102 1.0924 6.704 0.74697 0.97572 12.6424
8.3707 13.4594 5.6022
"""
PUBLISHED_TEXT = REPORT.split()
PUBLISHED = np.array(PUBLISHED_TEXT, dtype=float)
ROUNDING = np.array([0.5 * 10.0 ** -max(4, len(text.split(".")[1])) for text in PUBLISHED_TEXT])
ARRAY = TexelArray.grid(14, 6, 3.4e-3)
WHOLE_IMAGE = ARRAY.count * metrics.WHITE


def blob(array=ARRAY, x=1e-3, y=-2e-3, sigma=4e-3):
    d = array.centres[:, :2] - [x, y]
    return np.exp(-(d**2).sum(axis=1) / (2 * sigma**2)) * array.active


def levels_off(denominator):
    """How far each published value is from a whole number of grey levels, over what its rounding allows."""
    grey_levels = PUBLISHED / 100 * denominator
    return np.abs(grey_levels - np.rint(grey_levels)) / (ROUNDING / 100 * denominator)


def test_every_published_value_is_a_whole_number_of_grey_levels():
    assert len(PUBLISHED) == 34
    assert levels_off(WHOLE_IMAGE).max() <= 1.0
    assert PUBLISHED.mean() == pytest.approx(4.658, abs=5e-4)
    assert np.median(PUBLISHED) == pytest.approx(3.126, abs=5e-4)


@pytest.mark.parametrize("denominator", [255 * 83, 255 * 85, 256 * 84, 255 * 78, 255 * 68, 254 * 84, 3895 * 84])
def test_no_other_denominator_explains_the_published_values(denominator):
    assert levels_off(denominator).max() > 1.5


def test_the_published_values_come_back_from_images_with_that_many_grey_levels():
    for value in PUBLISHED:
        levels = round(value / 100 * WHOLE_IMAGE)
        image = np.full(84, levels // 84)
        image[: levels % 84] += 1
        got = metrics.score_images(np.zeros(84), image).image_changed_percent
        assert got == pytest.approx(value, abs=1e-4 * 0.51)


def test_identical_forces_score_perfectly():
    forces = blob()
    score = metrics.score(forces, forces.copy(), reference_outside=0.1, outside=0.1, load=5.0, array=ARRAY)
    assert score.active_area_iou == 1
    assert 0 < score.pixels_lit_line <= 84
    errors = {k: v for k, v in score.as_json().items() if k not in {"active_area_iou", "pixels_lit_line"}}
    assert set(errors.values()) == {0}


def test_definitions_on_numbers_small_enough_to_check_by_hand():
    array = TexelArray.grid(1, 3, 2e-3)
    score = metrics.score([4, 0, 0], [1, 2, 0], reference_outside=1.0, outside=1.5, load=5.0, array=array)
    assert score.total_force_error == pytest.approx(1 / 5)
    assert score.misplaced_force == pytest.approx((3 + 2 + 0.5) / 10)
    assert score.relative_l2 == pytest.approx(math.sqrt(13) / 4)
    assert score.centre_of_pressure_m == pytest.approx(2e-3 * 2 / 3)
    assert score.image_changed_percent == pytest.approx(100 * ((255 - 64) + 128) / (3 * 255))
    assert score.pixels_changed == 2
    assert score.wasserstein_m == pytest.approx(2 / 3 * 2e-3)
    assert score.active_area_iou == pytest.approx(1 / 2)
    assert score.peak_error == pytest.approx(0.5)
    assert score.width_error_x_m == pytest.approx(2e-3 * math.sqrt(2) / 3)
    assert score.width_error_y_m == 0


@pytest.mark.parametrize(
    ("defect", "metric"),
    [
        (lambda f: 1.05 * f, "total_force_error"),
        (lambda f: f.reshape(14, 6)[:, ::-1].ravel(), "misplaced_force"),
        (lambda f: f.reshape(14, 6)[:, ::-1].ravel(), "relative_l2"),
        (lambda f: np.roll(f, 1), "centre_of_pressure_m"),
        (lambda f: np.roll(f, 6), "wasserstein_m"),
        (lambda f: np.where(f == f.max(), 0.9 * f, f), "peak_error"),
        (lambda f: f**2, "width_error_x_m"),
        (lambda f: f**2, "width_error_y_m"),
        (lambda f: np.where(f == f.max(), f * (1 - 2 / 255), f), "image_changed_percent"),
        (lambda f: np.where(f == f.max(), f * (1 - 2 / 255), f), "pixels_changed"),
        (lambda f: f + 1.0, "image_changed_line_percent"),
        (lambda f: f + 1.0, "pixels_changed_line"),
    ],
)
def test_a_planted_defect_shows(defect, metric):
    good = metrics.score(blob(), blob(), load=5.0, array=ARRAY)
    bad = metrics.score(blob(), defect(blob()), load=5.0, array=ARRAY)
    assert getattr(good, metric) == 0
    assert getattr(bad, metric) > 0


def test_masked_texels_count_as_outside_and_not_as_pixels():
    array = ARRAYS["sdh2-distal"]
    forces = blob(array)
    on_mask = forces.copy()
    on_mask[0] = 0.3
    score = metrics.score(forces, on_mask, reference_outside=0.3, load=1.0, array=array)
    assert score.misplaced_force == 0
    assert score.pixels_changed == 0
    black_to_white = metrics.score_images(np.zeros(array.count), np.where(array.active, 255, 0), active=array.active)
    assert black_to_white.image_changed_percent == 100
    assert black_to_white.pixels_changed == 68
    leaky = metrics.score_images(np.zeros(array.count), np.full(array.count, 255), active=array.active)
    assert leaky == black_to_white


def test_undefined_quantities_are_null_and_defined_ones_stay():
    score = metrics.score(blob(), np.zeros(84), load=5.0, array=ARRAY)
    assert score.as_json()["centre_of_pressure_m"] is None
    assert score.as_json()["wasserstein_m"] is None
    assert score.relative_l2 == 1
    empty = metrics.score(np.zeros(84), blob(), load=5.0, array=ARRAY)
    assert empty.as_json()["relative_l2"] is None
    assert empty.as_json()["peak_error"] is None
    assert empty.misplaced_force > 0


@pytest.mark.parametrize("load", [0.0, -1.0, math.nan, math.inf])
def test_a_load_that_is_no_load_is_refused(load):
    with pytest.raises(ValueError, match="load must be positive"):
        metrics.score(blob(), blob(), load=load, array=ARRAY)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_non_finite_forces_are_refused_with_their_place(value):
    bad = blob()
    bad[17] = value
    with pytest.raises(ValueError, match="texel 17"):
        metrics.score(blob(), bad, load=1.0, array=ARRAY)
    with pytest.raises(ValueError, match="outside must be finite"):
        metrics.score(blob(), blob(), outside=value, load=1.0, array=ARRAY)


def test_wrong_sizes_are_refused():
    with pytest.raises(ValueError, match="83 values"):
        metrics.score(blob(), blob()[:-1], load=1.0, array=ARRAY)
    with pytest.raises(ValueError, match="differ in size"):
        metrics.score_images(np.zeros(4), np.zeros(5))
    with pytest.raises(ValueError, match="whole grey levels"):
        metrics.score_images([0.5], [0])
    with pytest.raises(ValueError, match="whole grey levels"):
        metrics.score_images([256], [0])


def test_grey_levels_after_the_published_line():
    assert metrics.grey_by_line([0, 0.185, 0.19, 1.646, 3]).tolist() == [0, 0, 1, 255, 255]
    line = metrics.published_line(dataclasses.replace(WTS_0614_34, tip_share=0.5))
    assert metrics.grey_by_line([0, 0.0925, 0.095, 0.823, 3], line).tolist() == [0, 0, 1, 255, 255]
    # the share of another tip, or none, says nothing about the published line
    other = Electronics(rate_hz=1, sensitivity=1, calibrated="through the cover, tip 3 mm", tip_share=0.5)
    assert metrics.published_line(other) == metrics.published_line(Electronics(rate_hz=1, sensitivity=1)) == WTS_0614_34


def test_scores_on_the_second_grey_scale_follow_the_share_of_the_tip():
    light = 0.15 * blob() / blob().max()
    assert metrics.score(light, light, load=5.0, array=ARRAY).pixels_lit_line == 0
    known = dataclasses.replace(WTS_0614_34, tip_share=0.5)
    assert metrics.score(light, light, load=5.0, array=ARRAY, line=known).pixels_lit_line > 0


@given(arrays(float, 12, elements=st.floats(0, 1)), arrays(float, 12, elements=st.floats(0, 1)))
def test_wasserstein_of_the_difference_equals_that_of_the_maps(a, b):
    positions = TexelArray.grid(4, 3, 1e-3).centres
    a, b = a + 0.01, b + 0.01
    # On the whole maps the linear programme itself meets masses within 1e-7 only, over some millimetres.
    whole = wasserstein_distance_nd(positions, positions, a, b)
    assert metrics.wasserstein(a, b, positions) == pytest.approx(whole, abs=1e-9)


def test_wasserstein_of_maps_that_hardly_differ_is_exact():
    """All mass that moves comes from one texel: what each other gains, times its way."""
    positions = TexelArray.grid(4, 3, 1e-3).centres
    a, b = np.full(12, 0.01), np.full(12, 0.01 + 2e-8)
    b[2] = 0.01
    way = np.linalg.norm(positions - positions[2], axis=1)
    assert metrics.wasserstein(a, b, positions) == pytest.approx((b / b.sum() - a / a.sum()) @ way, rel=1e-6)


@given(arrays(float, 84, elements=st.floats(-0.1, 1)), arrays(float, 84, elements=st.floats(-0.1, 1)))
def test_misplaced_force_is_symmetric_and_bounds_the_total(a, b):
    there = metrics.misplaced_force(a, b, reference_outside=0.1, outside=0.3, load=2.0)
    back = metrics.misplaced_force(b, a, reference_outside=0.3, outside=0.1, load=2.0)
    assert there == pytest.approx(back)
    assert 2 * there >= metrics.total_force_error(a, b, load=2.0) - 1e-12


FORCES = arrays(float, ARRAY.count, elements=st.floats(0, 1, allow_subnormal=False))


@settings(max_examples=25, deadline=None)
@given(FORCES, FORCES, st.floats(1e-3, 1e3))
def test_relative_metrics_do_not_depend_on_the_unit_of_force(reference, forces, factor):
    reference, forces = reference + 1e-3, forces + 1e-3
    one = metrics.score(reference, forces, load=2.0, array=ARRAY)
    other = metrics.score(factor * reference, factor * forces, load=2.0 * factor, array=ARRAY)
    for name in ("total_force_error", "misplaced_force", "relative_l2", "peak_error", "centre_of_pressure_m"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-6, abs=1e-12), name
    assert other.wasserstein_m == pytest.approx(one.wasserstein_m, abs=1e-9)


@given(FORCES, FORCES, st.floats(0, 1), st.floats(0, 1))
def test_misplaced_force_of_a_conserved_load_is_the_force_that_must_move(reference, forces, reference_out, out):
    """With the same total, texels and outside lose in all what the others gain: a share of the load from 0 to 1."""
    load = 2.0
    reference, forces = np.append(reference, reference_out + 0.01), np.append(forces, out + 0.01)
    reference, forces = load * reference / reference.sum(), load * forces / forces.sum()
    found = metrics.misplaced_force(
        reference[:-1], forces[:-1], reference_outside=reference[-1], outside=forces[-1], load=load
    )
    moved = np.maximum(reference - forces, 0).sum() / load
    assert found == pytest.approx(moved, abs=1e-12)
    assert -1e-12 <= found <= 1 + 1e-12


@settings(max_examples=25, deadline=None)
@given(arrays(float, 9, elements=st.floats(0, 1)), arrays(float, 9, elements=st.floats(0, 1)))
def test_transport_along_a_row_is_the_area_between_the_cumulative_forces(a, b):
    """In one dimension the Wasserstein distance has a closed form, and misplaced force times a pitch bounds it."""
    row = TexelArray.grid(1, 9, 2e-3)
    a, b = (each + 0.01 for each in (a, b))
    a, b = a / a.sum(), b / b.sum()
    found = metrics.wasserstein(a, b, row.centres)
    assert found == pytest.approx(2e-3 * np.abs(np.cumsum(a - b)).sum(), abs=1e-9)
    misplaced = metrics.misplaced_force(a, b, reference_outside=0.0, outside=0.0, load=1.0)
    assert 2e-3 * misplaced - 1e-9 <= found <= 8 * 2e-3 * misplaced + 1e-9


@settings(max_examples=25, deadline=None)
@given(arrays(float, (5, 3), elements=st.floats(0, 1)), st.integers(0, 5), st.integers(0, 3))
def test_shifted_forces_move_the_centre_of_pressure_by_the_shift(patch, down, right):
    array = TexelArray.grid(10, 6, (3e-3, 2e-3))
    image, moved = np.zeros((10, 6)), np.zeros((10, 6))
    image[:5, :3] = moved[down : down + 5, right : right + 3] = patch + 0.01
    score = metrics.score(image, moved, load=1.0, array=array)
    shift = math.hypot(3e-3 * right, 2e-3 * down)
    assert score.centre_of_pressure_m == pytest.approx(shift, abs=1e-12)
    assert score.wasserstein_m == pytest.approx(shift, abs=1e-8)
    assert score.width_error_x_m == pytest.approx(0, abs=1e-8)
    assert (score.peak_error, score.total_force_error) == pytest.approx((0, 0), abs=1e-12)


def test_the_width_of_one_texel_among_negative_ones_is_zero():
    forces = np.zeros((3, 3))
    forces[1] = [-1e-3, 1.0, -1e-3]
    positions = TexelArray.grid(3, 3, 2e-3).centres
    assert metrics.second_moments(forces.ravel(), positions) == (0.0, 0.0)
