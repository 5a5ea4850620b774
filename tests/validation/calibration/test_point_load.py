"""Calibration of one texel with a rounded tip, from made-up trials with known slopes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validation.calibration import point_load
from validation.calibration.model import Observations, Placement
from validation.calibration.point_load import calibrate_point_load
from validation.sensor_file import load
from validation.text.indenter import read_indenter

SENSOR = load("wts-0614-34")
TEXEL = 39
LOADS = np.linspace(0.1, 1.5, 15)


def make_trials(slopes, *, tops=None):
    """One image per load and trial, of a texel that reads slope x load - 50 counts, at most the trial's `tops`."""
    rows = [(slope, newtons) for slope in slopes for newtons in LOADS]
    counts = np.zeros((len(rows), SENSOR.array.count))
    counts[:, TEXEL] = [np.clip(slope * newtons - 50, 0, (tops or {}).get(slope)) for slope, newtons in rows]
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


def test_slopes_saturation_and_the_share_of_the_cover(monkeypatch):
    """Counts above 97 % of the largest count saturate from three images on; then 85 % ends the line."""
    asked = []
    share = SimpleNamespace(share=0.77, lightest=0.8, heaviest=0.75, radius=1e-3, largest_load=1.4)
    monkeypatch.setattr("fem_reference.point_spread", lambda cover: cover.thickness)
    monkeypatch.setattr(point_load, "compute_tip_share", lambda *given, **tip: asked.append((*given, tip)) or share)
    slopes = (2000.0, 2100.0, 2300.0, 3000.0, 3100.0)
    tops = {3000.0: 3000 * LOADS[-3] - 50, 3100.0: 3100 * LOADS[-2] - 50}
    seen, names = make_trials(slopes, tops=tops)
    found = calibrate_point_load(seen, names, SENSOR, radius=1e-3, texel=TEXEL)
    assert [trial.name for trial in found.trials] == [f"trial {slope}" for slope in slopes]
    bent, offset = np.polyfit(LOADS, np.minimum(3100 * LOADS - 50, tops[3100.0]), 1)
    assert [trial.slope for trial in found.trials] == pytest.approx([*slopes[:4], bent])
    assert [trial.offset for trial in found.trials] == pytest.approx([-50] * 4 + [offset])
    assert [trial.saturation_force for trial in found.trials] == [None] * 3 + [pytest.approx(LOADS[-3]), None]
    ((cover, array, influence, tip),) = asked
    assert (cover, array, influence) == (SENSOR.cover, SENSOR.array, SENSOR.cover.thickness)
    assert tip == {"radius": 1e-3, "saturation": pytest.approx(LOADS.max(), rel=1e-3)}
    assert (found.tip_share, found.tip_share_light, found.tip_share_heavy) == (0.77, 0.8, 0.75)
    assert (found.tip_radius, found.largest_load) == (1e-3, 1.4)
    applied, texel = (found.estimates[name] for name in ("sensitivity_applied", "sensitivity"))
    assert applied.value == pytest.approx(np.mean([*slopes[:4], bent]))
    # Student's interval of five values.
    assert applied.high - applied.value == pytest.approx(
        2.7764 * np.std([*slopes[:4], bent], ddof=1) / 5**0.5, rel=1e-4
    )
    assert texel.value == pytest.approx(applied.value / 0.77)
    assert texel.high == pytest.approx(applied.high / 0.77)
    assert [each.unit for each in (applied, texel)] == ["counts/N applied", "counts/N on the texel"]
    assert set(found.estimates) == {"sensitivity_applied", "sensitivity"}  # one trial alone has a saturation force


def test_a_texel_that_was_not_pressed_is_refused():
    with pytest.raises(ValueError, match="lit below saturation under fewer than two loads"):
        calibrate_point_load(*make_trials((3000.0,)), SENSOR, radius=1e-3, texel=3)
    with pytest.raises(ValueError, match=r"texel 84 is not an active texel of wts-0614-34; accepted: 0\.\.83"):
        calibrate_point_load(*make_trials((3000.0,)), SENSOR, radius=1e-3, texel=84)


def test_counts_at_rest_take_no_part_in_a_line(monkeypatch):
    """Noise of up to 150 counts below the floor of an image would tilt the line."""
    share = SimpleNamespace(share=1.0, lightest=1.0, heaviest=1.0, radius=1e-3, largest_load=1.4)
    monkeypatch.setattr("fem_reference.point_spread", lambda cover: cover.thickness)
    monkeypatch.setattr(point_load, "compute_tip_share", lambda *given, **tip: share)
    seen, names = make_trials((2000.0,))
    floors = np.full(seen.counts.shape, 160.0)
    seen.counts[seen.counts[:, TEXEL] < 400, TEXEL] = 150.0
    found = calibrate_point_load(replace(seen, floors=floors), names, SENSOR, radius=1e-3, texel=TEXEL)
    assert (found.trials[0].slope, found.trials[0].offset) == pytest.approx((2000, -50))
