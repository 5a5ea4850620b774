"""Calibration of a made-up sensor: what was put in is found again, inside intervals that cover as often as they say."""

import json
from dataclasses import replace

import numpy as np
import pytest

import fastmodel
from fastmodel import ChainFunctions, Electronics
from meshes import Box, Sphere, TexelArray
from tests.support.laboratory import draw_gains, make_curve, observe_presses, uniform_method
from validation.calibration.calibrate import Calibration, calibrate, fit_characteristic, score_hold_out, write_sensor
from validation.calibration.forward_fit import Options, lay_out
from validation.calibration.model import Observations, Placement, Pose, join_observations
from validation.calibration.uncertainty import Estimate, predict_mean
from validation.errors import InputError
from validation.json_values import json_text
from validation.sensor_file import load as load_sensor

METHOD = uniform_method()


def observe(seed, curve=None, **options):
    """Images of a made-up sensor, its gains, and the true poses."""
    random = np.random.default_rng(seed)
    gains = draw_gains(random)
    seen, poses = observe_presses(random, make_curve(gains, **(curve or {})), **options)
    return seen, gains, poses


@pytest.fixture(scope="module")
def known():
    """Images with known poses, their calibration, and the true gains."""
    seen, gains, _ = observe(3, known=True, scatter=0.002)
    return seen, calibrate(seen, METHOD, noise=[2.0, 3.0, 4.0]), gains


def test_sensitivity_and_gains_are_those_of_the_sensor(known):
    _, found, gains = known
    mean = gains[found.texels].mean()
    assert found.estimates["sensitivity"].value == pytest.approx(917 * mean, rel=0.01)
    assert found.gains[found.texels] == pytest.approx(gains[found.texels] / mean, rel=0.02)
    assert len(found.texels) > 50
    assert found.gains[found.texels].mean() == pytest.approx(1)
    outside = np.setdiff1d(np.arange(len(gains)), found.texels)
    assert (found.gains[outside] == 1).all()
    assert np.isnan(found.gain_half_widths[outside]).all()
    assert found.estimates["dead_force"].value == pytest.approx(0.02, abs=0.005)
    assert found.estimates["noise"].value == 3.0
    assert Calibration.from_json(json.loads(json_text(found.as_json()))) == found


def test_left_out_recordings_are_predicted_without_taking_part(known):
    """Every place keeps recordings, and all loads are left out somewhere; a line per texel is as good here."""
    seen, found, _ = known
    left_out = found.hold_out
    assert len(left_out.recordings) == 8
    assert {name[0] for name in left_out.recordings} == set("012345")
    assert len(set(left_out.loads)) == 4
    assert max(left_out.image_changed_percent, left_out.line_per_texel_percent) < 0.1
    assert np.abs(left_out.predicted - left_out.recorded).max() < 0.02 * left_out.recorded.max()
    counts = seen.counts.copy()
    counts[[group in left_out.recordings for group in seen.groups]] *= 0.5
    fit = fit_characteristic(METHOD, seen, Options())
    plain, other = (
        score_hold_out(replace(fit, observations=each), 4095.0) for each in (seen, replace(seen, counts=counts))
    )
    np.testing.assert_array_equal(other.predicted, plain.predicted)
    assert other.image_changed_percent > 10 * plain.image_changed_percent


def test_every_fit_of_a_calibration_is_announced():
    said = []
    calibrate(observe(2, places=2, known=True)[0], METHOD, progress=said.append)
    assert said == [
        "fit of a line to 8 images: uniform",
        "fit with saturation",
        "intervals, and a fit without every third recording",
    ]


def test_poses_that_are_not_given_are_fitted():
    seen, _, poses = observe(1, places=4, scatter=0.002)
    found = calibrate(seen, METHOD)
    for name, pose in poses.items():
        values = found.poses[name]
        for part, true in (("x_m", pose.x), ("y_m", pose.y)):
            assert values[part][0] == pytest.approx(true, abs=0.15e-3)
            assert 0 < values[part][1] < 0.3e-3
        assert [values[part][1] for part in ("yaw_rad", "tilt_x_rad", "tilt_y_rad")] == [0, 0, 0]


@pytest.mark.slow
def test_temperature_coefficients_are_found_where_temperature_and_load_vary_apart():
    seen, _, _ = observe(2, {"warm": -0.01, "dead_warm": 0.002}, places=2, temperatures=(30.0, 40.0), known=True)
    found = calibrate(seen, METHOD)
    # The coefficient of the gain holds for the reference temperature of the fit, the mean of 35 degC.
    for name, true in (("temperature", -0.01 / (1 - 0.05)), ("dead_force_temperature", 0.002)):
        estimate = found.estimates[name]
        assert estimate.low <= true <= estimate.high
        assert estimate.high - estimate.low < 0.3 * abs(true)
    confounded = calibrate(replace(seen, temperatures=30 + seen.loads), METHOD)
    assert "temperature" not in confounded.estimates
    assert any("temperature and load rise together" in note for note in confounded.notes)


@pytest.mark.parametrize("places", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_gains_from_one_placement_are_said_to_contain_its_seat(places):
    notes = calibrate(observe(5, places=places)[0], METHOD).notes
    assert sum("second placement" in note for note in notes) == (places == 1)


@pytest.mark.parametrize(
    ("loads", "reached"), [((10.0, 20.0, 30.0, 40.0, 50.0, 60.0), True), ((5.0, 8.0, 11.0), False)]
)
def test_a_saturation_is_found_only_if_the_loads_reach_it(loads, reached):
    """Whatever a texel reads that is switched off."""
    seen = observe(4, places=2, known=True, loads=loads)[0]
    counts, measured = seen.counts.copy(), seen.measured.copy()
    counts[:, 0], measured[:, 0] = 40_000, False
    found = calibrate(replace(seen, counts=counts, measured=measured), METHOD)
    assert ("output_max" in found.estimates) == reached
    assert not reached or found.estimates["output_max"].value == pytest.approx(4095, rel=0.01)


def test_an_unseated_weight_does_not_move_the_fit_and_is_named():
    seen, gains, _ = observe(6, places=4, known=True, scatter=0.002)
    counts = seen.counts.copy()
    counts[6] = np.roll(counts[6], 2)
    found = calibrate(replace(seen, counts=counts), METHOD)
    assert found.estimates["sensitivity"].value == pytest.approx(917 * gains[found.texels].mean(), rel=0.01)
    assert any("little weight" in note and seen.groups[6] in note for note in found.notes)


@pytest.mark.parametrize(("error", "told"), [pytest.param(0.0, 0, marks=pytest.mark.slow), (0.03, 1)])
def test_an_error_of_the_contact_method_that_the_intervals_leave_out_is_told(error, told):
    notes = calibrate(observe(8, places=2, known=True)[0], replace(METHOD, gain_error=error)).notes
    assert sum("leave out the error" in note and "3% of a single gain" in note for note in notes) == told


@pytest.mark.slow
def test_a_polynomial_needs_seven_loads():
    seen, _, _ = observe(7, places=2, known=True, loads=(2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0))
    found = calibrate(seen, METHOD)
    line = found.estimates["sensitivity"].value * 0.3 + found.estimates["offset"].value
    assert np.polynomial.polynomial.polyval(0.3, found.polynomial) == pytest.approx(line, rel=0.02)
    assert calibrate(seen.select(seen.loads < 14), METHOD).polynomial is None


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda seen: seen.select(seen.loads > 5), "at least 3 recordings"),
        (lambda seen: replace(seen, loads=np.full(3, 5.0)), "with 1 loads cannot determine a line"),
        (lambda seen: replace(seen, thresholds=np.array([0.0, 0.0, 9.0])), "several thresholds"),
    ],
)
def test_recordings_that_cannot_be_calibrated_are_refused(change, fault):
    with pytest.raises(ValueError, match=fault):
        calibrate(change(observe(0, places=1, loads=(5.0, 10.0, 20.0))[0]), METHOD)


def list_covered(seeds, **options):
    """Whether each interval holds the truth, by quantity, pooled over laboratories that fit all parameters."""
    covered = {"sensitivity": [], "dead_force": [], "gains": [], "poses": []}
    for seed in seeds:
        seen, gains, poses = observe(seed, **options)
        found = calibrate(seen, METHOD)
        mean = gains[found.texels].mean()
        for name, true in (("sensitivity", 917 * mean), ("dead_force", 0.02)):
            covered[name].append(found.estimates[name].low <= true <= found.estimates[name].high)
        covered["gains"].extend((np.abs(found.gains - gains / mean) <= found.gain_half_widths)[found.texels])
        for name, pose in poses.items():
            for part, true in (("x_m", pose.x), ("y_m", pose.y)):
                value, width = found.poses[name][part]
                covered["poses"].append(abs(value - true) <= width)
    return covered


@pytest.mark.slow
def test_intervals_cover_in_90_to_99_percent():
    """Poses, sensitivity, dead force and gains are all fitted; the shares are pooled over 50 laboratories."""
    shares = {name: np.mean(values) for name, values in list_covered(range(50), places=4).items()}
    assert all(0.9 <= share <= 0.99 for share in shares.values()), shares


@pytest.mark.bench  # the slow tests have an even seat
@pytest.mark.slow
def test_intervals_cover_where_the_stamp_sits_unevenly():
    """All recordings of a place share most of the seating heights; with independent errors only, 80 % are covered."""
    shares = {}
    for places in (2, 4):
        found = list_covered(range(500, 525), places=places, scatter=0.03, heights=1.0)
        shares |= {(places, name): np.mean(found[name]) for name in ("gains", "poses")}
    assert all(share >= 0.9 for share in shares.values()), shares


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


# Where a fit starts and what it expects: starts, bounds and Gaussian priors, by hand.

ARRAY = TexelArray.grid(2, 3, pitch=(4e-3, 3e-3))
BLOCK = Placement(name="block", indenter=Box(size=(6e-3, 4e-3, 5e-3)), tilt=None)
BALL = Placement(name="ball", indenter=Sphere(radius=4e-3), at=(1e-3, 0.0))


def lay(**options):
    """Two images: slopes of 110 and 95 counts/N with the thresholds added; one texel was not measured, one is dark."""
    counts = np.array([[10.0, 20, 30, 40, 0, 999], [30, 40, 50, 60, 0, 999]])
    seen = Observations(
        loads=np.array([1.0, 2.0]), counts=counts, measured=counts < 900, placements=(BLOCK, BALL), groups=("1", "2"),
        temperatures=np.array([20.0, 24.0]), ages=np.array([np.nan, 30.0]), thresholds=np.array([2.5, 2.5]),
    )  # fmt: skip
    guesses = {BLOCK: Pose(1e-3, 2e-3, 0.4, 0.01, 0.0), BALL: Pose(1e-3, 0.0)}
    return lay_out(seen, Options(**{"temperature": False} | options), ARRAY, guesses)


def test_poses_stay_near_the_array_turns_are_expected_small_and_gains_near_one():
    layout = lay()
    rows = {each.name: (each.start, each.scale, each.upper, each.mean, each.spread) for each in layout.unknowns}
    half_turn, none = np.pi / 2, np.inf
    assert {name: row for name, row in rows.items() if not name.startswith("gain")} == {
        "block x": pytest.approx((1e-3, 4e-3, 4e-3 + 4e-3, 0, none)),
        "block y": pytest.approx((2e-3, 3e-3, 1.5e-3 + 3e-3, 0, none)),
        "block yaw": pytest.approx((0.4, 0.1, half_turn, 0, 0.3)),
        "block tilt x": pytest.approx((0.01, 0.01, 0.1, 0, 0.02)),
        "block tilt y": pytest.approx((0.0, 0.01, 0.1, 0, 0.02)),
        "ln_sensitivity": pytest.approx((np.log(102.5), 0.3, none, 0, none)),
        "dead_force": pytest.approx((0, 0.3 * 1.5 / 4, none, 0, none)),
    }
    assert (layout.list("lower") == -layout.list("upper")).all()
    assert {name: row for name, row in rows.items() if name.startswith("gain")} == {
        f"gain{texel}": (0, 1.0, none, 0, 0.5) for texel in range(4)
    }


def test_the_first_curve_is_a_line_through_the_sums_without_saturation():
    curve = lay().fixed
    assert curve.sensitivity == pytest.approx((110 + 95) / 2)
    assert (curve.dead_force, curve.gain_temperature, curve.dead_temperature, curve.creep) == (0, 0, 0, 0)
    assert (curve.reference_temperature, curve.reference_age) == (22, 30)
    assert (curve.output_max, curve.saturation_band) == (np.inf, 0)
    assert (curve.gains == 1).all()
    assert (curve.heights == 0).all()
    assert lay(output_max=None).fixed.output_max == pytest.approx(1.05 * 60)


def test_spreads_of_temperature_saturation_and_heights_follow_the_loads_and_counts():
    """A mean load of 1.5 N on four lit texels is 0.375 N on a texel; the largest count is 60."""
    observed = lay(output_max=None, heights=True, gains=False, temperature=True)
    rows = {each.name: (each.start, each.scale, each.lower, each.upper, each.mean, each.spread)
            for each in observed.unknowns if not each.placement}  # fmt: skip
    none = np.inf
    assert rows == {
        "ln_sensitivity": pytest.approx((np.log(102.5), 0.3, -none, none, 0, none)),
        "dead_force": pytest.approx((0, 0.1125, -none, none, 0, none)),
        "gain_temperature": pytest.approx((0, 0.01, -none, none, 0, 0.02)),
        "dead_temperature": pytest.approx((0, 0.1 * 0.00375, -none, none, 0, 0.00375)),
        "output_max": pytest.approx((63, 6, 54, 60e3, 0, none)),
        "band_logit": pytest.approx((0, 1, -6, 6, 0, 1)),
    } | {f"height{texel}": pytest.approx((0, 0.45, -none, none, 0, 0.45)) for texel in range(4)}
    vector = np.array([each.start for each in observed.unknowns])
    names = [each.name for each in observed.unknowns]
    for name, value in (("output_max", 80.0), ("band_logit", np.log(3)), ("height2", 0.7), ("dead_force", 0.2)):
        vector[names.index(name)] = value
    curve = observed.curve(vector)
    assert (curve.output_max, curve.dead_force) == (80.0, 0.2)
    assert curve.saturation_band == pytest.approx(60.0)
    assert curve.heights.tolist() == [0, 0, 0.7, 0, 0, 0]


def test_a_session_has_the_common_curve_times_its_level_and_gains():
    layout = lay(sessions=True)
    vector = np.zeros(len(layout.unknowns))
    names = [each.name for each in layout.unknowns]
    values = {"ln_sensitivity": 500.0, "gain1": 2.0, "gain1 of ball": 3.0, "gain2 of block": 5.0}
    values["ln level of ball"] = 1.5
    for name, value in values.items():
        vector[names.index(name)] = np.log(value)
    common, sessions = layout.curve(vector), layout.session_curves(vector)
    assert (common.sensitivity, common.gains.tolist()) == (pytest.approx(500), pytest.approx([1, 2, 1, 1, 1, 1]))
    assert sessions["ball"].sensitivity == pytest.approx(750)
    assert sessions["ball"].gains == pytest.approx([1, 6, 1, 1, 1, 1])
    assert sessions["block"].sensitivity == pytest.approx(500)
    assert sessions["block"].gains == pytest.approx([1, 2, 5, 1, 1, 1])


def test_each_session_has_a_level_and_changes_of_the_gains():
    rows = {each.name: (each.start, each.mean, each.spread) for each in lay(sessions=True).unknowns if each.session}
    expected = {f"gain{texel} of {name}": (0, 0, 0.3) for texel in range(4) for name in ("block", "ball")}
    assert rows == expected | {f"ln level of {name}": (0, 0, 0.05) for name in ("block", "ball")}


# From a calibration to a sensor file.

SOURCE = """
[array]
rows = 8
columns = 10
pitch = "5 mm"
[[cover.layer]]
thickness = "2 mm"
material = "dragon-skin-30"
[electronics]
rate = "271 Hz"
sensitivity = "1 1/N"
calibrated = "through the cover, tip 1 mm"
"""


def test_a_sensor_file_holds_the_calibrated_electronics(tmp_path):
    seen, _, poses = observe(0, places=2, loads=(5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0), known=True)
    found = calibrate(seen, METHOD, noise=[4.0, 5.0, 6.0])
    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    source.write_text(SOURCE)
    written = load_sensor(write_sensor(found, source, target)).electronics
    estimates = found.estimates
    assert written.sensitivity == pytest.approx(estimates["sensitivity"].value, rel=1e-5)
    assert written.offset == pytest.approx(estimates["offset"].value, abs=1e-3)
    assert written.output_max == pytest.approx(4095, rel=0.01)
    assert written.gains == pytest.approx(found.gains, abs=1e-5)
    assert written.noise == pytest.approx(5 / estimates["sensitivity"].value, rel=1e-3)
    assert written.calibrated == "texel force"  # the fit is one of texel forces
    assert f"from {14} recordings" in target.read_text()
    # The written electronics predict what was recorded, without gains that the data do not determine.
    row = int(np.argmax(seen.loads == 30.0))
    placement = seen.placements[row]
    forces = METHOD.texel_forces(placement.indenter, np.array([30.0]), poses[placement.name])[0]
    lit = np.isin(np.arange(80), found.texels) & (seen.counts[row] > 100)
    assert written.counts(forces)[lit] == pytest.approx(seen.counts[row][lit], rel=0.03)
    assert load_sensor(write_sensor(found, source, target, polynomial=True)).electronics.characteristic is not None


@pytest.mark.parametrize(
    ("text", "options", "fault"),
    [
        (None, {}, "softcover init"),
        (SOURCE.replace("rows = 8", "rows = 9"), {}, r"gains: takes one number per texel \(90\), not 80"),
        (SOURCE, {"polynomial": True}, "at least 7 loads"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, known, text, options, fault):
    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    if text:
        source.write_text(text)
    with pytest.raises(InputError, match=fault):
        write_sensor(known[1], source, target, **options)
    assert not target.exists()


def test_a_calibrated_sensor_reads_the_fitted_line_at_the_age_of_the_images():
    """A line at 7.5 s and 12 % of creep in a factor e of time: held to 7.5 s, the written line is that line again."""
    estimates = {
        name: Estimate(value=value, low=value, high=value, unit="", fitted_on="")
        for name, value in (("sensitivity", 900.0), ("offset", -20.0), ("creep", 0.12))
    }
    made = Calibration(
        confidence=0.95, method="cover", threshold=0.0, estimates=estimates, gains=np.ones(84),
        gain_half_widths=np.zeros(84), texels=np.arange(84), poses={}, residual_rms_counts=1.0,
        polynomial=np.array([-20.0, 900.0, -40.0, 3.0, 0.0, 0.0]), hold_out=None, notes=(), reference_age=7.5,
    )  # fmt: skip
    for polynomial in (False, True):
        table = made.electronics(polynomial=polynomial)
        line = {"offset": table.get("offset", 0.0), "sensitivity": 1.0}
        if polynomial:
            line["characteristic"] = tuple(table["characteristic"])
        else:
            line["sensitivity"] = float(table["sensitivity"].removesuffix(" 1/N"))
        electronics = Electronics(rate_hz=100.0, creep=table["creep"], **line)
        functions = ChainFunctions(replace(fastmodel.load("wts-0614-34"), electronics=electronics), 1000.0)
        forces = np.full(84, 0.5)
        state = functions.take(functions.settle(np.zeros(84)), forces)
        _, output = functions.frame(state, frames=750)
        felt = output.texel_forces
        exact = np.polyval([3.0, -40.0, 900.0, -20.0], felt) if polynomial else 900 * felt - 20
        assert output.counts == pytest.approx(exact, rel=2e-3, abs=1)


@pytest.mark.slow
def test_the_interval_of_creep_covers_another_load():
    """Loads whose creep scatters by 10 % and recordings by 3 %: 95 of 100 further loads, by Student's t."""
    rng, held = np.random.default_rng(3), 0
    loads = np.repeat(np.arange(4.0), 3)
    for _ in range(2000):
        of_load = 0.12 * (1 + 0.1 * rng.standard_normal(5))
        values = of_load[np.repeat(np.arange(4), 3)] * (1 + 0.03 * rng.standard_normal(12))
        another = of_load[4] * (1 + 0.03 * rng.standard_normal(3)).mean()
        found = predict_mean(values, loads, "-")
        held += found.low <= another <= found.high
    assert 0.935 < held / 2000 < 0.965
    assert predict_mean(np.array([0.1, np.nan]), np.zeros(2), "-") is None
    assert predict_mean(np.array([0.1, 0.12, 0.11]), np.zeros(3), "-").high == pytest.approx(
        0.11 + 4.302653 * 0.01 / 3**0.5
    )
