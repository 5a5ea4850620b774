"""Calibration of a made-up sensor: what was put in is found again, inside intervals that cover as often as they say."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Sphere
from tests.support.laboratory import draw_gains, make_curve, observe_presses, uniform_method
from validation.calibration import calibrate as module
from validation.calibration.calibrate import calibrate
from validation.calibration.hold_out import score_hold_out
from validation.calibration.observations import Observations, Placement, join_observations
from validation.calibration.parameters import Options
from validation.json_values import json_text


@pytest.fixture(scope="module")
def known():
    """A calibration with known poses, and the true gains."""
    random = np.random.default_rng(3)
    gains = draw_gains(random)
    seen, _ = observe_presses(random, make_curve(gains), known=True, scatter=0.002)
    return calibrate(seen, uniform_method(), noise=[2.0, 3.0, 4.0]), gains


def test_sensitivity_and_gains_are_those_of_the_sensor(known):
    found, gains = known
    mean = gains[found.texels].mean()
    assert found.estimates["sensitivity"].value == pytest.approx(917 * mean, rel=0.01)
    assert found.gains[found.texels] == pytest.approx(gains[found.texels] / mean, rel=0.02)
    assert len(found.texels) > 50
    assert found.gains[found.texels].mean() == pytest.approx(1)
    outside = np.setdiff1d(np.arange(len(gains)), found.texels)
    assert (found.gains[outside] == 1).all()
    assert np.isnan(found.gain_intervals[outside]).all()
    assert found.estimates["dead_force"].value == pytest.approx(0.02, abs=0.005)
    assert found.estimates["noise"].value == 3.0
    assert json_text(found.as_json())


def test_left_out_recordings_are_predicted(known):
    """Every place keeps recordings, and all loads are left out somewhere; a line per texel is as good here."""
    left_out = known[0].hold_out
    assert len(left_out.names) == 8
    assert {name[0] for name in left_out.names} == set("012345")
    assert len(set(left_out.loads)) == 4
    assert left_out.image_changed_percent < 0.1
    assert left_out.line_percent < 0.1
    assert np.abs(left_out.predicted - left_out.recorded).max() < 0.02 * left_out.recorded.max()


def test_left_out_recordings_do_not_take_part_in_their_prediction(known):
    fit = known[0].fit
    plain = score_hold_out(fit, 4095.0)
    counts = fit.observations.counts.copy()
    counts[[group in plain.names for group in fit.observations.groups]] *= 0.5
    other = score_hold_out(replace(fit, observations=replace(fit.observations, counts=counts)), 4095.0)
    assert other.names == plain.names
    np.testing.assert_array_equal(other.predicted, plain.predicted)
    assert other.image_changed_percent > 10 * plain.image_changed_percent


def test_poses_that_are_not_given_are_fitted():
    random = np.random.default_rng(1)
    seen, poses = observe_presses(random, make_curve(draw_gains(random)), places=4, scatter=0.002)
    found = calibrate(seen, uniform_method())
    for name, pose in poses.items():
        values, widths = found.poses[name]
        assert values[:2] == pytest.approx([pose.x, pose.y], abs=0.15e-3)
        assert (widths[:2] > 0).all()
        assert (widths[:2] < 0.3e-3).all()
        assert (widths[2:] == 0).all()


def test_temperature_coefficients_are_found_where_temperature_and_load_vary_apart():
    random = np.random.default_rng(2)
    curve = make_curve(draw_gains(random), warm=-0.01, dead_warm=0.002)
    seen, _ = observe_presses(random, curve, places=2, temperatures=(30.0, 40.0), known=True)
    found = calibrate(seen, uniform_method())
    # The coefficient of the gain holds for the reference temperature of the fit, the mean of 35 degC.
    for name, true in (("temperature", -0.01 / (1 - 0.05)), ("dead_force_temperature", 0.002)):
        estimate = found.estimates[name]
        assert estimate.low <= true <= estimate.high
        assert estimate.high - estimate.low < 0.3 * abs(true)
    rising = replace(seen, temperatures=30 + seen.loads)
    confounded = calibrate(rising, uniform_method())
    assert "temperature" not in confounded.estimates
    assert any("temperature and load rise together" in note for note in confounded.notes)


def test_a_saturation_is_found_only_if_the_loads_reach_it():
    random = np.random.default_rng(4)
    curve = make_curve(draw_gains(random))
    options = {"places": 2, "known": True}
    heavy, _ = observe_presses(random, curve, loads=(10.0, 20.0, 30.0, 40.0, 50.0, 60.0), **options)
    found = calibrate(heavy, uniform_method())
    assert found.estimates["output_max"].value == pytest.approx(4095, rel=0.01)
    light, _ = observe_presses(random, curve, loads=(5.0, 8.0, 11.0), **options)
    assert "output_max" not in calibrate(light, uniform_method()).estimates


def test_an_unseated_weight_does_not_move_the_fit_and_is_named():
    random = np.random.default_rng(6)
    gains = draw_gains(random)
    seen, _ = observe_presses(random, make_curve(gains), places=4, known=True, scatter=0.002)
    counts = seen.counts.copy()
    counts[6] = np.roll(counts[6], 2)
    found = calibrate(replace(seen, counts=counts), uniform_method())
    mean = gains[found.texels].mean()
    assert found.estimates["sensitivity"].value == pytest.approx(917 * mean, rel=0.01)
    assert any("little weight" in note and seen.groups[6] in note for note in found.notes)


def test_an_error_of_the_contact_method_that_the_intervals_leave_out_is_told():
    random = np.random.default_rng(8)
    seen, _ = observe_presses(random, make_curve(draw_gains(random)), places=2, known=True)
    exact, wrong = uniform_method(), replace(uniform_method(), gain_error=0.03)
    told = [[note for note in calibrate(seen, each).notes if "leave out the error" in note] for each in (exact, wrong)]
    assert told[0] == []
    assert "3% of a single gain" in told[1][0]


def test_a_polynomial_needs_seven_loads():
    random = np.random.default_rng(7)
    curve = make_curve(draw_gains(random))
    seen, _ = observe_presses(random, curve, places=2, known=True, loads=(2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0))
    found = calibrate(seen, uniform_method())
    force = 0.3
    line = found.estimates["sensitivity"].value * force + found.estimates["offset"].value
    assert np.polynomial.polynomial.polyval(force, found.polynomial) == pytest.approx(line, rel=0.02)
    assert calibrate(seen.select(seen.loads < 14), uniform_method()).polynomial is None


def test_recordings_that_cannot_be_calibrated_are_refused():
    random = np.random.default_rng(0)
    seen, _ = observe_presses(random, make_curve(draw_gains(random)), places=1, loads=(5.0, 10.0, 20.0))
    with pytest.raises(ValueError, match="at least 3 recordings"):
        calibrate(seen.select(seen.loads > 5), uniform_method())
    with pytest.raises(ValueError, match="with 1 loads cannot determine a line"):
        calibrate(replace(seen, loads=np.full(3, 5.0)), uniform_method())
    with pytest.raises(ValueError, match="several thresholds"):
        calibrate(replace(seen, thresholds=np.array([0.0, 0.0, 9.0])), uniform_method())


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"scatter": 0.01}, {"scatter": 0.0, "noise": 5.0}])
def test_intervals_cover_in_90_to_99_of_100(options):
    """Poses, sensitivity, dead force and gains are all fitted; the shares are pooled over 100 laboratories."""
    covered = {"sensitivity": [], "dead_force": [], "gains": [], "poses": []}
    for seed in range(100):
        random = np.random.default_rng(seed)
        gains = draw_gains(random)
        seen, poses = observe_presses(random, make_curve(gains), places=4, **options)
        found = calibrate(seen, uniform_method())
        mean = gains[found.texels].mean()
        for name, true in (("sensitivity", 917 * mean), ("dead_force", 0.02)):
            covered[name].append(found.estimates[name].low <= true <= found.estimates[name].high)
        errors = found.gains - gains / mean
        covered["gains"].extend((np.abs(errors) <= found.gain_intervals)[found.texels])
        for name, pose in poses.items():
            values, widths = found.poses[name]
            covered["poses"].extend(np.abs(values[:2] - [pose.x, pose.y]) <= widths[:2])
    shares = {name: np.mean(values) for name, values in covered.items()}
    assert all(0.9 <= share <= 0.99 for share in shares.values()), shares


@pytest.mark.parametrize("creep", [np.arange(4.0), np.empty(0)], ids=["creep", "without creep"])
def test_chosen_images_keep_all_that_belongs_to_them(creep):
    rows = np.arange(4.0)
    seen = Observations(
        loads=1 + rows, counts=rows[:, None] + [10, 20], measured=rows[:, None] > [0, 2],
        placements=tuple(Placement(name=str(k), indenter=Sphere(radius=1e-3)) for k in range(4)), groups=tuple("abcd"),
        temperatures=20 + rows, ages=30 + rows, thresholds=40 + rows, creep=creep,
    )  # fmt: skip
    chosen = np.array([False, True, False, True])
    some, others = seen.select(chosen), seen.select(~chosen)
    back = join_observations([others, some])
    for name, values in vars(seen).items():
        assert np.array_equal(getattr(some, name), values[1::2]), name
        assert np.array_equal(getattr(back, name), [*values[::2], *values[1::2]]), name
    with pytest.raises(ValueError, match="no recordings"):
        join_observations([])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
@pytest.mark.parametrize(("ratio", "top", "bends"), [(1.05, 1.2, True), (1.01, 1.2, False), (1.05, 1.4, False)])
def test_saturation_is_fitted_where_it_is_far_more_likely(monkeypatch, scale, ratio, top, bends):
    """2 n ln(ratio of residuals) above 10 + 2 ln n, and an end below 1.3 times the largest count."""
    seen = SimpleNamespace(measured=np.ones((10, 40), dtype=bool), counts=np.array([[1000.0, 10.0]]))
    assert (800 * np.log(ratio) > 10 + 2 * np.log(400)) == (ratio > 1.02)
    straight = SimpleNamespace(rms=ratio * scale)
    bent = SimpleNamespace(rms=scale, curve=SimpleNamespace(output_max=1000 * top))
    fits = {True: bent, False: straight}
    monkeypatch.setattr(module, "fit_forward", lambda _method, _seen, options, **_: fits[options.output_max is None])
    assert module._choose_fit(None, seen, Options(output_max=4095.0)) is (bent if bends else straight)
