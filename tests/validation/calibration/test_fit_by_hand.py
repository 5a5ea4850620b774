"""A fit against plain formulas: weights, residuals, derivatives, the optimum, the spread of sessions, and the start."""

from dataclasses import replace

import numpy as np
import pytest

from meshes import Box, Sphere, TexelArray
from validation.calibration.forward_fit import Options, compute_forces, fit_forward
from validation.calibration.model import ContactMethod, CountCurve, Observations, Placement, Pose

ARRAY = TexelArray.grid(2, 3, pitch=(4e-3, 3e-3))
BLOCK, BALL = Box(size=(6e-3, 4e-3, 5e-3)), Sphere(radius=4e-3)
FREE = Placement(name="free", indenter=BLOCK, tilt=None)
ROUND = Placement(name="round", indenter=BALL, yaw=0.3, tilt=(0.004, -0.007))
KNOWN = Placement(name="known", indenter=BLOCK, at=(1e-3, -0.5e-3), yaw=0.2)
OTHER = Placement(name="other", indenter=BALL, at=(-1.4e-3, 0.8e-3), yaw=0.0)
TRUE = {"free": Pose(0.7e-3, 0.4e-3, 0.15, 0.006, -0.004), "round": Pose(-0.9e-3, 0.3e-3, 0.3, 0.004, -0.007)}
GAINS = np.array([0.8, 1.3, 1.1, 0.9, 1.2, 0.7])
CURVE = CountCurve(
    sensitivity=700.0, dead_force=0.03, gain_temperature=0.008, dead_temperature=0.002, reference_temperature=25.0,
    creep=0.1, output_max=np.inf, saturation_band=0.0, gains=GAINS, heights=np.zeros(6),
)  # fmt: skip


def solve(_indenter, load, pose):
    """An oblong bell of pressure that turns with the yaw and moves to one side by tilts and under heavy loads."""
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    x, y = ((ARRAY.centres[:, :2] - (pose.x, pose.y)) @ np.array([[cos, -sin], [sin, cos]])).T
    side = 4e3 * (pose.tilt_x * y - pose.tilt_y * x) + 5 * load * x
    raw = np.exp(-((x / 6e-3) ** 2) - (y / 4e-3) ** 2 + side)
    return load * raw / raw.sum()


METHOD = ContactMethod(name="bell", about="", array=ARRAY, solve=solve)


def observe(rows, *, curve=CURVE, noise=0.0, spreads=None, **changes):
    """Images of rows of placement, load, temperature and age; `spreads` are changes of ln(gain) by the placement."""
    placements, loads, warm, ages = (list(each) for each in zip(*rows, strict=True))
    nothing = np.zeros((len(rows), 6))
    seen = Observations(
        loads=np.array(loads), counts=nothing, measured=nothing == 0, placements=tuple(placements),
        groups=tuple(f"r{k}" for k in range(len(rows))), temperatures=np.array(warm), ages=np.array(ages),
        thresholds=np.full(len(rows), 12.0),
    )  # fmt: skip
    forces = compute_forces(METHOD, seen, TRUE)
    own = [replace(curve, gains=curve.gains * np.exp((spreads or {}).get(each.name, 0.0))) for each in placements]
    state = zip(seen.temperatures, seen.ages, seen.thresholds, strict=True)
    counts = np.vstack([
        line.predict(force[None], temperatures=np.array([t]), ages=np.array([age]), thresholds=np.array([cut]))
        for line, force, (t, age, cut) in zip(own, forces, state, strict=True)
    ])  # fmt: skip
    wobble = noise * np.cos(1.7 + np.arange(counts.size) ** 2).reshape(counts.shape)
    return replace(seen, counts=counts + wobble * (counts > 0), **changes)


ROWS = [(FREE, 2.0, 20.0, 3.0), (FREE, 4.0, 31.0, 9.0), (FREE, 6.5, 24.0, 5.0), (FREE, 0.2, 26.0, 4.0),
        (ROUND, 1.5, 25.0, 6.0), (ROUND, 5.0, 23.0, 2.5), (ROUND, 3.0, 29.0, 8.0)]  # fmt: skip
GIVEN = [({"free": KNOWN, "round": OTHER}[place.name], *state) for place, *state in ROWS]
BENT = replace(CURVE, output_max=1100.0, saturation_band=300.0)
WHOLE = Options(temperature=True, creep=0.1, output_max=1100.0, sessions=True, load_power=0.7)
SEATED = Options(heights=True, temperature=True, creep=0.1, output_max=None, load_power=0.7)


@pytest.fixture(scope="module", params=[WHOLE, SEATED], ids=["sessions", "heights"])
def whole(request):
    """A fit to images with errors, one of them badly seated, and one texel not measured in one image."""
    seen = observe(ROWS, curve=BENT, noise=8.0)
    seen.counts[1] = 0.6 * seen.counts[1][::-1]
    seen.measured[2, 4] = False
    return fit_forward(METHOD, seen, request.param)


def predict(fit, vector):
    """Counts of the fitted images for other parameters."""
    layout, seen = fit.layout, fit.observations
    forces = compute_forces(METHOD, seen, layout.poses(vector))
    curves = layout.session_curves(vector)
    return np.vstack([
        curves.get(seen.placements[k].name, layout.curve(vector)).predict(
            forces[[k]], temperatures=seen.temperatures[[k]], ages=seen.ages[[k]], thresholds=seen.thresholds[[k]]
        )
        for k in range(len(seen.loads))
    ])  # fmt: skip


def compare(rms, loads, power):
    """Emphasis by the load, and the loss of weight beyond three medians, of residuals or of residuals over loads."""
    part = loads / loads.max()
    share = rms / np.maximum(part, 0.05)
    ratio = np.minimum(rms / max(np.median(rms), 0.5), share / max(np.median(share), 0.5))
    return np.maximum(part, 0.05) ** power, np.minimum(1, 3 / ratio)


def check_weights(whole):
    seen, lit = whole.observations, whole.observations.measured
    misfit = predict(whole, whole.vector) - seen.counts
    assert whole.predict(seen) - seen.counts == pytest.approx(misfit)
    rms = np.array([np.sqrt(np.mean(row[on] ** 2)) for row, on in zip(misfit, lit, strict=True)])
    emphasis, robust = compare(rms, seen.loads, 0.7)
    assert whole.robust == pytest.approx(robust)
    assert whole.weights == pytest.approx(emphasis * robust)
    scale = np.sqrt((whole.weights**2 * rms**2).sum() / (whole.weights**2).sum())
    assert whole.scale == pytest.approx(scale)
    assert whole.residual == pytest.approx((misfit * whole.weights[:, None] / scale)[lit])
    assert whole.index.tolist() == np.nonzero(lit)[0].tolist()
    assert whole.rms == pytest.approx(np.sqrt(np.mean(misfit[lit] ** 2)))


def test_weights_scale_and_residuals_follow_from_the_misfit(whole):
    check_weights(whole)


@pytest.mark.parametrize(("light", "bad"), [(3, 3), (1, 5), (6, 1)])
def test_a_bad_image_loses_weight_beyond_three_medians(light, bad):
    """Its residual exceeds three medians, and three medians of the residual over the load, which is at least 5 %."""
    seen = observe(GIVEN * 2, noise=3.0)
    seen.counts[bad] *= {3: 2.5, 1: 0.8, 5: 0.4}[bad]
    seen.loads[light] *= 0.9
    found = fit_forward(METHOD, seen, replace(WHOLE, sessions=False, output_max=np.inf))
    check_weights(found)
    assert np.argmin(found.robust) == bad
    assert 0.01 < found.robust[bad] < 0.9
    assert np.sort(found.robust)[2] == 1


def test_derivatives_are_those_of_the_weighted_counts(whole):
    factor = (whole.weights[:, None] / whole.scale * np.ones(6))[whole.observations.measured]
    for number, each in enumerate(whole.layout.unknowns):
        step = np.zeros(len(whole.vector))
        step[number] = (1e-2 if each.placement else 1e-6) * each.scale
        ends = [predict(whole, whole.vector + sign * step)[whole.observations.measured] for sign in (1, -1)]
        slope = factor * (ends[0] - ends[1]) / (2 * step[number])
        off = np.linalg.norm(whole.jacobian[:, number] - slope)
        assert off <= 0.1 * np.linalg.norm(slope) + 1e-9, each.name


@pytest.mark.parametrize("sessions", [False, True])
def test_the_fit_minimises_residuals_and_priors_together(sessions):
    """At the optimum the slope of half the sum of squares is zero along each parameter that is not at a bound."""
    spreads = {"known": 0.2 * np.sin(np.arange(6)), "other": -0.1 * np.cos(np.arange(6))} if sessions else None
    seen = observe(GIVEN, noise=3.0, spreads=spreads)
    found = fit_forward(METHOD, seen, replace(WHOLE, sessions=sessions, output_max=np.inf))
    layout = found.layout
    assert ("ln level of known" in [each.name for each in layout.unknowns]) == sessions
    spread, mean, scale = (layout.list(name) for name in ("spread", "mean", "scale"))
    slope = found.jacobian.T @ found.residual + (found.vector - mean) / spread**2
    sizes = np.linalg.norm(found.jacobian, axis=0) + 1 / spread
    assert np.abs(slope / sizes).max() < 0.1  # of the noise of one count
    assert layout.prior == pytest.approx(spread**-2.0)
    assert np.abs((found.vector - mean) / spread).max() < 3
    assert np.isfinite(scale).all()


def test_the_spread_between_sessions_is_the_most_likely_one():
    """Of data with unit errors and Gaussian parameters; 40 spreads in even steps of the logarithm from 0.01 to 3."""
    spreads = {"known": 0.5 * np.sin(2 + np.arange(6)), "other": -0.4 * np.cos(np.arange(6))}
    options = replace(WHOLE, output_max=np.inf)
    found = fit_forward(METHOD, observe(GIVEN, noise=3.0, spreads=spreads), options)
    prior, mean = found.layout.list("spread").copy(), found.layout.list("mean")
    data = found.jacobian @ found.vector - found.residual - found.jacobian @ mean
    prior[np.isinf(prior)] = 1e4 * found.layout.list("scale")[np.isinf(prior)]
    chosen = [each.is_gain and bool(each.session) for each in found.layout.unknowns]
    costs, tried = [], 0.3 * np.geomspace(1 / 30, 10, 40)
    for spread in tried:
        prior[chosen] = spread
        covariance = np.eye(len(data)) + (found.jacobian * prior**2) @ found.jacobian.T
        cost = np.linalg.slogdet(covariance)[1] + data @ np.linalg.solve(covariance, data)
        costs.append(cost + (np.log(spread / 0.3) / 0.7) ** 2)
    assert found.session_spread == pytest.approx(tried[int(np.argmin(costs))])
    assert found.layout.list("spread")[chosen] == pytest.approx(found.session_spread)
    assert found.parameters()["session_gain_sd"] == found.session_spread


def test_exact_counts_give_the_parameters_back():
    true = replace(CURVE, reference_temperature=178 / 7, reference_age=37.5 / 7)
    found = fit_forward(METHOD, observe(GIVEN, curve=true), Options(temperature=True, creep=0.1))
    mean = found.curve.gains.mean() / GAINS.mean()
    assert found.curve.gains == pytest.approx(GAINS * mean, rel=2e-3)
    assert mean == pytest.approx(1, abs=0.05)
    assert found.curve.reference_temperature == pytest.approx(178 / 7)
    assert found.curve.reference_age == pytest.approx(37.5 / 7)
    assert found.curve.sensitivity == pytest.approx(700 / mean, rel=5e-3)
    assert found.curve.gain_temperature == pytest.approx(0.008, rel=0.02)
    assert found.curve.dead_force == pytest.approx(0.03, abs=1e-3)
    assert found.curve.dead_temperature == pytest.approx(0.002, abs=1e-4)
    assert found.rms < 0.5
    assert found.scale == 0.5  # rounding to whole counts
    assert found.robust.tolist() == [1.0] * 7


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"yaw": 0.15, "tilt": (0.006, -0.004)}, [2, 3, 4]),
        ({"at": (0.7e-3, 0.4e-3), "tilt": (0.006, -0.004)}, [0, 1, 3, 4]),
        ({"at": (0.7e-3, 0.4e-3), "yaw": 0.15, "tilt": None}, [0, 1, 2]),
    ],
)
def test_exact_counts_give_back_the_parts_of_a_pose_that_are_not_given(given, kept):
    even = replace(CURVE, gains=np.ones(6), gain_temperature=0.0, dead_temperature=0.0)
    place = Placement(name="free", indenter=BLOCK, **given)
    seen = observe([(place, *state) for _, *state in ROWS], curve=even)
    found = fit_forward(METHOD, seen, Options(temperature=False, creep=0.1, gains=False))
    vector, true = found.poses["free"].vector, TRUE["free"].vector
    assert vector == pytest.approx(true, rel=0.02, abs=1e-5)
    assert vector[kept].tolist() == true[kept].tolist()
    assert found.curve.gains.tolist() == [1.0] * 6


def test_a_fit_starts_at_the_centre_of_the_counts_and_at_given_poses():
    rows = [*ROWS[:3], (KNOWN, 3.0, 20.0, 2.0)]
    seen = observe(rows, floors=np.full((4, 6), 30.0))
    seen.counts[1, 3] = 29.0  # at rest
    found = fit_forward(METHOD, seen, Options(temperature=False, output_max=800.0))
    start = {each.name: each.start for each in found.layout.unknowns}
    total = np.where(seen.counts > 30, seen.counts, 0.0)[:3].sum(axis=0)
    for part, axis in (("x", 0), ("y", 1)):
        assert start[f"free {part}"] == pytest.approx(total @ ARRAY.centres[:, axis] / total.sum())
    assert [start[f"free {part}"] for part in ("yaw", "tilt x", "tilt y")] == [0, 0, 0]
    assert not any(name.startswith("known") for name in start)
    assert found.poses["known"] == Pose(1e-3, -0.5e-3, 0.2)
    fixed = found.layout.fixed
    assert (fixed.output_max, fixed.saturation_band) == (800.0, pytest.approx(400.0))
    assert "output_max" not in start
    assert start["band_logit"] == pytest.approx(0.0)
    lit = np.where(seen.counts > 30, seen.counts + 12, 0.0).sum(axis=1)
    assert fixed.sensitivity == pytest.approx(np.median(lit / seen.loads))
    assert start["ln_sensitivity"] == pytest.approx(np.log(fixed.sensitivity))


@pytest.mark.parametrize(
    ("creep", "warm", "given", "expected"),
    [
        ([0.1, np.nan, 0.14, 0.4, np.nan, 0.2, 0.3], None, Options(), (0.2, True)),
        ([np.nan] * 7, None, Options(), (0.0, True)),
        ([0.1] * 7, None, Options(creep=0.03, temperature=False), (0.03, False)),
        ([0.1] * 7, np.full(7, 21.0), Options(), (0.1, False)),
        ([0.1] * 7, np.full(7, np.nan), Options(creep=0.0, temperature=False), (0.0, False)),
    ],
)
def test_creep_is_the_median_of_the_recordings_and_temperature_is_fitted_where_it_varies(creep, warm, given, expected):
    seen = observe(ROWS, creep=np.array(creep))
    if warm is not None:
        seen = replace(seen, temperatures=warm, ages=warm)
    found = fit_forward(METHOD, seen, given)
    assert (found.options.creep, found.options.temperature) == expected
    assert found.curve.creep == expected[0]
    assert bool(found.curve.gain_temperature) == expected[1]
    listed = found.parameters()
    assert ("gain_temperature_per_K" in listed) == ("dead_temperature_N_per_K" in listed) == expected[1]
    if warm is not None:
        assert found.curve.reference_temperature == pytest.approx(warm[0], nan_ok=True)
        assert found.curve.reference_age == (21.0 if np.isfinite(warm[0]) else 2.0)


def test_parameters_are_listed_with_units(whole):
    named = whole.parameters()
    curve = whole.curve
    sessions = whole.layout.session_curves(whole.vector)
    expected = {
        f"{name} {part}": value for name, pose in whole.poses.items() for part, value in pose.named().items() if value
    } | {
        "sensitivity_per_N": curve.sensitivity, "dead_force_N": curve.dead_force, "creep": 0.1,
        "gain_temperature_per_K": curve.gain_temperature, "dead_temperature_N_per_K": curve.dead_temperature,
        "saturation_band_counts": curve.saturation_band, "gain_sd": np.std(curve.gains), "rms_counts": whole.rms,
    }  # fmt: skip
    if whole.options.sessions:
        for name in ("free", "round"):
            expected[f"level of {name}"] = sessions[name].sensitivity / curve.sensitivity
        expected["session_gain_sd"] = whole.session_spread
    else:
        expected["height_sd_N"] = np.std(curve.heights)
    assert named == pytest.approx(expected)
    plain = fit_forward(METHOD, observe(ROWS), Options(temperature=False, creep=0.1, gains=False)).parameters()
    assert [name for name in plain if " " not in name] == ["sensitivity_per_N", "dead_force_N", "creep", "rms_counts"]
    assert not any(name.startswith("level") for name in plain)


def test_outliers_are_recordings_that_lose_more_than_half_of_their_weight(whole):
    robust = np.array([0.49, 0.5, 1.0, 0.2, 0.51, 0.3, 1.0])
    seen = replace(whole.observations, groups=("b", "c", "d", "a", "e", "b", "f"))
    assert replace(whole, robust=robust, observations=seen).outliers == ["b", "a"]


def test_images_of_a_warm_session_are_predicted_at_its_temperature(whole):
    seen = replace(whole.observations, temperatures=whole.observations.temperatures + 5)
    settled = replace(seen, temperatures=np.array([33.0] * 4 + [np.mean([30.0, 28.0, 34.0])] * 3))
    assert replace(whole, warmth={"free": 33.0}).predict(seen) == pytest.approx(whole.predict(settled))
    assert np.abs(whole.predict(seen) - whole.predict(settled)).max() > 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda seen: replace(seen, counts=-seen.counts), "r0, r1, r2, r3, r4, and 2 more: show no load"),
        (lambda seen: replace(seen, counts=0 * seen.counts, groups=tuple("aabcdee")), "a, b, c, d, e: show no load"),
        (lambda seen: replace(seen, measured=np.zeros_like(seen.measured)), "r0, r1, r2"),
        (lambda seen: seen.select(seen.loads > 9), "the recordings to fit: show no load"),
    ],
)
def test_images_without_a_load_are_refused_by_name(change, said):
    with pytest.raises(ValueError, match=r"counts do not rise") as caught:
        fit_forward(METHOD, change(observe(ROWS)), Options())
    assert str(caught.value).startswith(said)


def test_forces_need_a_pose_of_each_placement():
    seen = observe([*ROWS[:2], (KNOWN, 3.0, 20.0, 2.0)])
    with pytest.raises(KeyError, match="free"):
        compute_forces(METHOD, seen, {"round": TRUE["round"]})
    moved = {"free": TRUE["free"], "known": Pose(2e-3, 0.0)}
    assert compute_forces(METHOD, seen, moved)[2] == pytest.approx(solve(BLOCK, 1.0, moved["known"]) * 3)
    assert compute_forces(METHOD, seen, TRUE)[2] == pytest.approx(3 * solve(BLOCK, 1.0, KNOWN.pose))
