"""Calibration of one texel with a rounded tip, from made-up trials with known slopes."""

import numpy as np
import pytest

from validation.calibration.observations import Observations, Placement
from validation.calibration.point_load import calibrate_point_load
from validation.sensor_file import load
from validation.text.indenter import read_indenter

SENSOR = load("wts-0614-34")
TEXEL = 39
LOADS = np.linspace(0.1, 1.5, 15)


def make_trials(slopes, *, top=np.inf):
    """One image per load and trial, of a texel that reads slope x load - 50 counts, at most `top`."""
    rows = [(slope, newtons) for slope in slopes for newtons in LOADS]
    counts = np.zeros((len(rows), SENSOR.array.count))
    counts[:, TEXEL] = [np.clip(slope * newtons - 50, 0, top) for slope, newtons in rows]
    tip = Placement(name="tip", indenter=read_indenter("tip:radius=1mm", place=""), at=(0.0, 0.0), yaw=0.0)
    nothing = np.full(len(rows), np.nan)
    seen = Observations(
        loads=np.array([newtons for _, newtons in rows]),
        counts=counts,
        measured=np.ones(counts.shape, dtype=bool),
        placements=(tip,) * len(rows),
        groups=tuple(f"trial {slope}" for slope, _ in rows),
        temperatures=nothing,
        ages=nothing,
        thresholds=np.zeros(len(rows)),
        creep=nothing,
    )
    return seen, seen.groups


@pytest.mark.slow
def test_the_slope_of_each_trial_is_found_and_divided_by_the_share_of_the_cover():
    slopes = (2000.0, 2100.0, 2300.0)
    found = calibrate_point_load(*make_trials(slopes), SENSOR, radius=1e-3, texel=TEXEL)
    assert found.slopes == pytest.approx(slopes)
    assert found.offsets == pytest.approx([-50] * 3)
    assert np.isnan(found.saturation_forces).all()
    # The share of a tip of 1 mm above the middle of a texel of 3.4 mm under 2 mm of rubber, at the largest load.
    assert found.share.share == pytest.approx(0.77, abs=0.03)
    assert found.share.lightest > found.share.share
    applied, texel = (found.estimates[name] for name in ("sensitivity_applied", "sensitivity"))
    assert applied.value == pytest.approx(np.mean(slopes))
    # Student's interval of three values.
    assert applied.high - applied.value == pytest.approx(4.3027 * np.std(slopes, ddof=1) / 3**0.5, rel=1e-4)
    assert texel.value == pytest.approx(applied.value / found.share.share)


@pytest.mark.slow
def test_images_near_saturation_do_not_bend_the_line():
    found = calibrate_point_load(*make_trials((3000.0,), top=3000.0), SENSOR, radius=1e-3, texel=TEXEL)
    assert found.slopes == pytest.approx([3000])
    assert found.saturation_forces == pytest.approx([3050 / 3000])
    assert found.estimates == {}


def test_a_texel_that_was_not_pressed_is_refused():
    with pytest.raises(ValueError, match="lit below saturation under fewer than two loads"):
        calibrate_point_load(*make_trials((3000.0,)), SENSOR, radius=1e-3, texel=3)
    with pytest.raises(ValueError, match=r"texel 84 is not an active texel of wts-0614-34; accepted: 0\.\.83"):
        calibrate_point_load(*make_trials((3000.0,)), SENSOR, radius=1e-3, texel=84)
