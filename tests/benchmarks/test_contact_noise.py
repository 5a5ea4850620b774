"""Noise of MuJoCo's contact force: none on a plate at rest, some on boxes under a flat face, a peak at a landing."""

import numpy as np
import pytest

import fastmodel
from benchmarks.contact_noise import HEIGHT, MASS, STEP, measure, record
from meshes.constants import STANDARD_GRAVITY


@pytest.mark.slow
def test_a_plate_at_rest_has_no_noise_and_boxes_have_some_below_an_exact_sum():
    parameters = fastmodel.load("wts-0614-34")
    plate, boxes = (record(parameters, f"{name}, recommended", "block", seconds=2.5) for name in ("cover", "boxes"))
    assert measure(plate.texels, 2000) < 1e-6
    assert measure(boxes.texels, 2000) > 1e-4
    assert measure(boxes.total, 2000) < 1e-4
    assert plate.total[-1] == pytest.approx(MASS * STANDARD_GRAVITY, rel=1e-4)


@pytest.mark.slow
def test_a_body_lands_after_the_time_of_its_fall_and_a_filter_lowers_its_peak():
    found = record(fastmodel.load("wts-0614-34"), "cover, recommended", "ball", height=HEIGHT, seconds=0.3)
    first = STEP * np.flatnonzero(found.total)[0]
    assert first == pytest.approx(np.sqrt(2 * HEIGHT / STANDARD_GRAVITY), abs=2.1e-3)
    assert found.filtered("order 2, 40 Hz").total.max() < 0.8 * found.total.max()
