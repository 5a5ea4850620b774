"""Values, intervals and predictions of a calibration against plain formulas, and what is chosen, left out and drawn."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
from fastmodel import Gaussian
from meshes import Sphere, TexelArray
from tests.support.laboratory import STAMP, make_curve, uniform_method
from validation.calibration import calibrate as calibration
from validation.calibration.calibrate import (
    Calibration,
    HoldOut,
    calibrate,
    calibrate_recordings,
    choose_method,
    draw_hold_out,
    fit_characteristic,
    score_hold_out,
    write_sensor,
)
from validation.calibration.forward_fit import Options, compute_forces, fit_forward
from validation.calibration.model import Observations, Placement
from validation.calibration.uncertainty import Estimate, estimate_uncertainty
from validation.errors import InputError
from validation.schema.data_set import CommonKeys
from validation.sensor_file import load

ARRAY = TexelArray.grid(4, 5, 5e-3)
METHOD = uniform_method(ARRAY)
GAINS = 1 + 0.3 * np.sin(1 + np.arange(20) ** 2)
WTS = load("wts-0614-34")


def observe(rows, *, sensitivity=917.0, known=True, noise=2.0, repeats=None):
    """Images of rows of place, x [m], load [N] and temperature [degC], with a threshold of 20 counts."""
    places = {
        name: Placement(name=name, indenter=STAMP, at=(x, 1e-3) if known else None, yaw=0.0) for name, x, *_ in rows
    }
    loads, warm = (np.array([row[k] for row in rows], dtype=float) for k in (2, 3))
    nothing = np.zeros((len(rows), 20))
    seen = Observations(
        loads=loads, counts=nothing, measured=nothing == 0, placements=tuple(places[row[0]] for row in rows),
        groups=tuple(repeats or (f"{name}{k}" for k, (name, *_) in enumerate(rows))), temperatures=warm,
        ages=np.full(len(rows), 3.5), thresholds=np.full(len(rows), 20.0), creep=np.full(len(rows), 0.06),
    )  # fmt: skip
    curve = make_curve(GAINS, sensitivity=sensitivity, warm=0.004, dead_warm=0.001, creep=0.06)
    forces = np.vstack([
        METHOD.texel_forces(STAMP, np.array([newtons]), places[name].pose or replace(places[name], at=(x, 1e-3)).pose)
        for name, x, newtons, _ in rows
    ])  # fmt: skip
    counts = curve.predict(forces, temperatures=warm, ages=seen.ages, thresholds=seen.thresholds)
    wobble = noise * np.cos(np.arange(counts.size) ** 2).reshape(counts.shape)
    return replace(seen, counts=np.where(counts > 60, counts + wobble, 0.0))


ROWS = [("a", -3e-3, 5.0, 24.0), ("a", -3e-3, 11.0, 33.0), ("a", -3e-3, 16.0, 25.0), ("a", -3e-3, 21.0, 31.0),
        ("b", 4e-3, 6.0, 32.0), ("b", 4e-3, 12.0, 26.0), ("b", 4e-3, 15.0, 30.0), ("b", 4e-3, 20.0, 27.0)]  # fmt: skip


@pytest.fixture(scope="module", params=["line", "saturated", "poses", "one temperature"])
def found(request):
    """Images, their calibration, the fit and its uncertainty."""
    rows = [(*row[:3], 25.0) for row in ROWS] if request.param == "one temperature" else ROWS
    scale = 2400.0 if request.param == "saturated" else 917.0
    seen = observe(rows, sensitivity=scale, known=request.param != "poses")
    fit = fit_characteristic(METHOD, seen, Options())
    assert np.isfinite(fit.curve.output_max) == (request.param == "saturated")
    return seen, calibrate(seen, METHOD), fit, estimate_uncertainty(fit)


def find_pressed(fit):
    forces = compute_forces(METHOD, fit.observations, fit.poses)
    return np.flatnonzero((forces > 0.15 * forces.max(axis=1)[:, None]).any(axis=0))


def list_functions(fit):
    """Each estimate as a function of the fitted parameters."""
    texels = find_pressed(fit)

    def make(function):
        def apply(vector):
            curve = fit.layout.curve(vector)
            return function(curve, curve.gains[texels].mean())

        return apply

    functions = {
        "sensitivity": (lambda curve, mean: curve.sensitivity * mean, "counts/N"),
        "offset": (lambda curve, mean: mean * (20 - curve.sensitivity * curve.dead_force), "counts"),
        "dead_force": (
            lambda curve, mean: 20 / (curve.sensitivity * mean) - 20 / curve.sensitivity + curve.dead_force, "N"
        ),
    }  # fmt: skip
    if fit.options.temperature:
        functions["temperature"] = (lambda curve, _: curve.gain_temperature, "1/K")
        functions["dead_force_temperature"] = (lambda curve, _: curve.dead_temperature, "N/K")
    if np.isfinite(fit.curve.output_max):
        functions["output_max"] = (lambda curve, _: curve.output_max, "counts")
        functions["saturation_band"] = (lambda curve, _: curve.saturation_band, "counts")
    for texel in texels:
        functions[f"gain{texel}"] = (lambda curve, mean, k=texel: curve.gains[k] / mean, "-")
    return {name: (make(function), unit) for name, (function, unit) in functions.items()}


def differentiate(function, vector, scales):
    steps = 1e-5 * np.diag(scales)
    return np.array([(function(vector + by) - function(vector - by)) / (2 * by.max()) for by in steps])


def test_values_and_half_widths_follow_from_the_fitted_parameters(found):
    _, calibrated, fit, uncertainty = found
    scales = fit.layout.list("scale")
    for name, (function, unit) in list_functions(fit).items():
        value = function(fit.vector)
        half = uncertainty.half_width(differentiate(function, fit.vector, scales))
        if name.startswith("gain"):
            texel = int(name[4:])
            assert calibrated.gains[texel] == pytest.approx(value)
            assert calibrated.gain_half_widths[texel] == pytest.approx(half, rel=1e-3)
            continue
        estimate = calibrated.estimates[name]
        assert estimate.value == pytest.approx(value, rel=1e-6, abs=1e-9), name
        assert (estimate.high - value, value - estimate.low) == pytest.approx((half, half), rel=1e-3), name
        assert (estimate.unit, estimate.fitted_on) == (unit, "8 recordings, 5..21 N")
    assert set(calibrated.estimates) - {"creep"} == {
        each for each in list_functions(fit) if not each.startswith("gain")
    }
    assert calibrated.texels.tolist() == find_pressed(fit).tolist()


def test_the_rest_of_a_calibration_is_that_of_the_fit(found):
    seen, calibrated, fit, uncertainty = found
    for name, pose in fit.poses.items():
        for part, (key, value) in enumerate(pose.named().items()):
            row = [k for k, each in enumerate(fit.layout.unknowns) if (each.placement, each.part) == (name, part)]
            half = uncertainty.half_width(np.eye(len(fit.vector))[row[0]]) if row else 0.0
            assert calibrated.poses[name][key] == pytest.approx((value, half))
    assert (calibrated.confidence, calibrated.method, calibrated.threshold) == (0.95, "uniform", 20.0)
    assert (calibrated.reference_age, calibrated.residual_rms_counts) == (pytest.approx(3.5), pytest.approx(fit.rms))
    radius = math.sqrt(16e-3 * 12e-3 / math.pi)  # a circle as large as the face
    where = [fit.poses[each.name] for each in seen.placements]
    expected = [[pose.x, pose.y, newtons, radius] for pose, newtons in zip(where, seen.loads, strict=True)]
    np.testing.assert_allclose(calibrated.touches, expected)
    outside = np.setdiff1d(np.arange(20), calibrated.texels)
    assert (calibrated.gains[outside] == 1).all()
    assert np.isnan(calibrated.gain_half_widths[outside]).all()


def test_a_polynomial_of_degree_five_goes_through_the_lit_counts_below_saturation():
    loads = (3.0, 5.0, 8.0, 11.0, 14.0, 17.0, 20.0)
    seen = observe([("a", -1e-3, each, 25.0) for each in loads], noise=5.0)
    seen.counts[2, 7] = 35.0
    seen = replace(seen, floors=np.full(seen.counts.shape, 40.0))
    calibrated, fit = calibrate(seen, METHOD), fit_characteristic(METHOD, seen, Options())
    assert not np.isfinite(fit.curve.output_max)
    mean = fit.curve.gains[find_pressed(fit)].mean()
    forces, lit = compute_forces(METHOD, seen, fit.poses), seen.counts > 40
    signal = (seen.counts + 20) * mean / fit.curve.gains
    expected = np.polyfit(forces[lit], signal[lit], 5)[::-1]
    places = np.linspace(0.1, forces.max(), 7)
    assert np.polyval(calibrated.polynomial[::-1], places) == pytest.approx(
        np.polyval(expected[::-1], places), rel=1e-6
    )
    assert calibrated.polynomial.shape == (6,)
    assert calibrate(seen.select(seen.loads < 19), METHOD).polynomial is None


def test_a_touch_with_a_ball_has_no_radius_and_a_given_pose_is_kept():
    seen = observe(ROWS[:4])
    ball = replace(seen.placements[0], indenter=Sphere(radius=4e-3))
    method = replace(METHOD, solve=lambda _ball, load, pose: METHOD.solve(STAMP, load, pose))
    touches = calibrate(replace(seen, placements=(ball,) * 4), method).touches
    np.testing.assert_allclose(touches[:, :3], [[-3e-3, 1e-3, each] for each in seen.loads])
    assert np.isnan(touches[:, 3]).all()


# Which recordings are left out.


def name_rows(*series, x=1e-3):
    """Rows and names of recordings of series of loads, each in a place of its own."""
    rows, names = [], []
    for place, loads in zip("abcd", series, strict=False):
        rows += [(place, x, float(each), 25.0) for each in loads]
        names += [f"{place}{each:g}" for each in loads]
    return rows, names


@pytest.mark.parametrize(
    ("series", "known", "left_out"),
    [
        (((5, 8, 11, 14, 17, 20),), False, {"a8", "a17"}),
        (((20, 14, 5, 17, 8, 11),), False, {"a8", "a17"}),
        (((5, 8, 11), (6, 9, 12, 15, 18, 21)), False, {"a8", "b12", "b21"}),
        (((5, 8), (6, 9), (7, 10), (11, 13)), False, {"a8", "b6", "c10", "d11"}),
        (((5, 8, 11), (6,), (7, 10, 13, 16)), False, {"a8", "c7", "c16"}),
        (((5, 8, 11), (6,), (7, 10, 13, 16)), True, {"a8", "c7", "c16"}),
        (((5,), (8,), (11,), (14,)), True, {"b8"}),  # places of one recording each with a given pose count as one
        (((5,), (8,), (11,), (14,)), False, None),
        (((5, 8, 11),), False, None),  # two recordings remain
        (((5, 8, 11, 14),), False, {"a8"}),
    ],
)
def test_every_third_recording_of_a_place_is_left_out_in_the_order_of_loads(series, known, left_out):
    rows, names = name_rows(*series)
    seen = observe(rows, known=known, repeats=names)
    fit = fit_forward(METHOD, seen, Options(gains=False, temperature=False))
    found = score_hold_out(fit, 4095.0)
    assert (found and set(found.recordings)) == left_out


def test_images_of_one_recording_are_left_out_together_at_its_largest_load():
    rows = [("a", 0.0, each, 25.0) for each in (5.0, 18.0, 9.0, 12.0, 10.0, 14.0)]
    seen = observe(rows, repeats=["p", "p", "q", "r", "s", "t"])  # in the order of loads q, s, r, t, p
    found = score_hold_out(fit_forward(METHOD, seen, Options(gains=False, temperature=False)), 4095.0)
    assert set(found.recordings) == {"s", "p"}
    assert found.loads.tolist() == [5.0, 18.0, 10.0]


@pytest.mark.parametrize(("loads", "scored"), [((5, 5, 5, 5, 9), None), ((5, 5, 5, 9, 9), {"a1", "a4"})])
def test_two_loads_must_remain(loads, scored):
    seen = observe([("a", 0.0, float(each), 25.0) for each in loads])
    fit = fit_forward(METHOD, seen, Options(gains=False, temperature=False))
    found = score_hold_out(fit, 4095.0)
    assert (found and set(found.recordings)) == scored


def test_predictions_are_scored_in_grey_levels_over_measured_texels():
    rows, names = name_rows((5, 8, 11, 14), (6, 9, 12, 15, 18))
    seen = observe(rows, repeats=names, noise=9.0)
    lit = (seen.counts > 0).all(axis=0) & (np.arange(20) != 8)
    assert lit.sum() > 8
    assert seen.counts[:, 8].all()
    seen.measured[:] = lit
    options = Options(temperature=False)
    found = score_hold_out(fit_forward(METHOD, seen, options), 3000.0)
    out = np.isin(seen.groups, found.recordings)
    kept, held = seen.select(~out), seen.select(out)
    predicted = fit_forward(METHOD, kept, options).predict(held)
    assert found.predicted == pytest.approx(predicted)
    assert found.recorded == pytest.approx(held.counts)
    assert found.loads.tolist() == held.loads.tolist()
    lines = np.zeros_like(held.counts)
    for row, (newtons, place) in enumerate(zip(held.loads, held.placements, strict=True)):
        near = np.array([each.name == place.name for each in kept.placements])
        for texel in range(20):
            slope, offset = np.polyfit(kept.loads[near], kept.counts[near, texel], 1)
            lines[row, texel] = slope * newtons + offset

    def score(counts):
        grey = [np.clip(np.round(255 * each / 3000), 0, 255) for each in (held.counts, counts)]
        return 100 * np.abs(grey[0] - grey[1])[:, lit].mean() / 255

    assert found.image_changed_percent == pytest.approx(score(predicted))
    assert found.line_per_texel_percent == pytest.approx(score(lines))
    assert found.line_per_texel_percent > 0


def test_places_with_one_remaining_load_have_no_line_per_texel():
    rows, names = name_rows((5, 8, 11, 14), (6, 9))
    found = score_hold_out(
        fit_forward(METHOD, observe(rows, repeats=names), Options(gains=False, temperature=False)), 4095.0
    )
    assert found.line_per_texel_percent is None
    assert str(found) == f"image changed {found.image_changed_percent:.2f} %"
    both = HoldOut(recordings=("a",), image_changed_percent=1.234, line_per_texel_percent=5.678)
    assert str(both) == "image changed 1.23 %, line per texel 5.68 %"


@pytest.mark.parametrize(
    ("ratio", "largest", "bent"),
    [
        # twice the gain of the log likelihood of 100 counts, 200 ln(ratio), must exceed 10 + 2 ln(100) = 19.21
        (math.exp(19.22 / 200), 1299.0, True),
        (math.exp(19.20 / 200), 1299.0, False),
        (2.0, 1300.0, False),
        (1 / 2.0, 1299.0, False),
    ],
)
def test_a_saturation_must_be_much_more_likely_and_near_the_largest_count(monkeypatch, ratio, largest, bent):
    """The largest measured count is 1000; 1.3 times it is the largest credible saturation."""
    counts = np.tile(np.linspace(100, 1000, 5), (24, 1))
    measured = np.ones(counts.shape, dtype=bool)
    counts[:20, 4], measured[:20, 4] = 9000.0, False
    seen = SimpleNamespace(loads=np.ones(24), measured=measured, counts=counts, largest_count=1000.0)
    fits = {
        np.inf: SimpleNamespace(rms=ratio * 7.0, curve=SimpleNamespace(output_max=np.inf)),
        None: SimpleNamespace(rms=7.0, curve=SimpleNamespace(output_max=largest)),
    }
    monkeypatch.setattr(calibration, "fit_forward", lambda _method, _seen, options: fits[options.output_max])
    said = []
    found = fit_characteristic(METHOD, seen, Options(), said.append)
    assert found is fits[None if bent else np.inf]
    assert said == ["fit of a line to 24 images: uniform", "fit with saturation"]


# What a calibration writes.


def make(**options):
    values = {"sensitivity": 912.3456789, "offset": -31.23456, "noise": 3.3, "creep": 0.1234567, "output_max": 3987.6,
              "saturation_band": 123.456}  # fmt: skip
    values |= options.pop("values", {})
    estimates = {
        name: Estimate(value=value, low=value - 1, high=value + 2, unit="u", fitted_on=f"{name} data")
        for name, value in values.items()
        if value is not None
    }
    return Calibration(**{
        "confidence": 0.95, "method": "cover", "threshold": 17.5, "estimates": estimates, "texels": np.arange(2),
        "gains": np.array([1.0123456, 0.9876543]), "gain_half_widths": np.zeros(2), "poses": {}, "hold_out": None,
        "residual_rms_counts": 1.0, "polynomial": np.array([-31.0, 912.0, -40.0, 3.0, 0.5, 0.1]), "notes": (),
        "reference_age": 5.0,
    } | options)  # fmt: skip


def test_the_table_of_electronics_has_rounded_values_at_two_seconds():
    creep = 0.1235
    grown = 1 + creep * math.log(2.5)
    table = make().electronics()
    slope = 912.3456789 / grown
    assert table == {
        "threshold": 17.5, "gains": [1.01235, 0.98765], "calibrated": "texel force",
        "sensitivity": f"{slope:.6g} 1/N", "offset": -31.235, "output_max": 3988, "saturation_band": 123.5,
        "noise": f"{3.3 / slope:.4g} N", "creep": creep,
    }  # fmt: skip
    bent = make().electronics(polynomial=True)
    coefficients = [-31.0, 912.0, -40.0, 3.0, 0.5, 0.1]
    assert bent.pop("characteristic") == pytest.approx([c / grown**k for k, c in enumerate(coefficients)])
    assert bent == {key: value for key, value in table.items() if key not in ("sensitivity", "offset")}


@pytest.mark.parametrize(("creep", "written"), [(None, None), (0.0, None), (-0.2, None), (0.3, 0.3), (9.0, 0.5)])
def test_creep_is_written_within_what_a_simulated_sensor_can_do(creep, written):
    from fastmodel.signal.creep import MOST_CREEP

    written = min(MOST_CREEP, written) if written else None
    none = {"noise": None, "output_max": None}
    table = make(values={"creep": creep} | none).electronics()
    assert table.get("creep") == written
    assert float(table["sensitivity"].split()[0]) == pytest.approx(
        912.3456789 / (1 + (written or 0) * math.log(2.5)), rel=1e-5
    )
    assert not {"noise", "output_max", "saturation_band"} & set(table)


def test_a_written_sensor_says_what_its_values_come_from(tmp_path):
    source, target = tmp_path / "a.toml", tmp_path / "new.toml"
    source.write_text(
        '[array]\nrows = 1\ncolumns = 2\npitch = "5 mm"\n[[cover.layer]]\nthickness = "2 mm"\nmaterial = "tpu"\n'
        '[electronics]\nrate = "33 Hz"\nsensitivity = "1 1/N"\noffset = 5.0\n'
    )
    assert write_sensor(make(values={"noise": None}), str(source), target) == target
    lines = target.read_text().splitlines()
    assert lines[0] == "# electronics calibrated; 95% intervals:"
    assert lines[1] == "# sensitivity 912.35 [911.35, 914.35] u, from sensitivity data"
    assert sum(line.startswith("#") for line in lines) == 6
    written = load(target).electronics
    assert (written.rate_hz, written.threshold, written.offset) == (33.0, 17.5, -31.235)
    bent = load(write_sensor(make(), source, target, polynomial=True)).electronics
    assert len(bent.characteristic) == 6
    assert "offset" not in target.read_text().split("[electronics]")[1]


def test_files_are_written_only_where_named(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(calibration, "write_sensor", lambda *given, **more: asked.append((given[1:], more)))
    monkeypatch.setattr(calibration, "draw_hold_out", lambda *given: asked.append(given))
    left = HoldOut(recordings=("a",), image_changed_percent=1.0, line_per_texel_percent=None)
    make(hold_out=left).write_files(WTS, out=None, picture=None, polynomial=False)
    make().write_files(WTS, out=None, picture="p.png", polynomial=False)
    assert asked == []
    made = make(hold_out=left)
    made.write_files(WTS, out="x.toml", picture=tmp_path / "p.png", polynomial=True)
    assert asked == [((WTS.source, "x.toml"), {"polynomial": True}), (left, WTS.array, tmp_path / "p.png")]


@pytest.mark.parametrize(
    ("count", "chosen"), [(1, [0]), (3, [0, 1, 2]), (4, [0, 1, 2, 3]), (6, [0, 1, 3, 5]), (10, [0, 3, 6, 9])]
)
def test_left_out_images_are_drawn_beside_their_predictions_in_the_order_of_loads(monkeypatch, tmp_path, count, chosen):
    pytest.importorskip("matplotlib")
    drawn = []
    monkeypatch.setattr(
        "matplotlib.figure.Figure.savefig", lambda figure, file, **_: drawn.append(figure) or file.write(b"p")
    )
    loads = 3.0 + 1.5 * np.arange(count)[::-1]
    recorded = 10.0 * loads[:, None] + np.arange(6.0)
    predicted = recorded - 7.0 + 3.0 * (np.arange(6) == 2)
    left = HoldOut(recordings=("a",), image_changed_percent=2.5, line_per_texel_percent=None, loads=loads,
                   recorded=recorded, predicted=predicted)  # fmt: skip
    assert draw_hold_out(left, TexelArray.grid(2, 3, 5e-3), tmp_path / "p.png") == tmp_path / "p.png"
    (figure,) = drawn
    images = [axes for axes in figure.axes if axes.images]
    expected = np.sort(loads)[chosen]
    names = [f"{name}, {each:.3g} N" for name in ("recorded", "predicted", "difference") for each in expected]
    assert [axes.get_title() for axes in images] == names
    rows = [loads.tolist().index(each) for each in expected]
    values = [axes.images[0].get_array().ravel() for axes in images]
    shown = [*recorded[rows], *predicted[rows], *(predicted - recorded)[rows]]
    np.testing.assert_allclose(np.array(values), shown)
    peak = recorded[rows].max()
    limits = [axes.images[0].get_clim() for axes in images]
    assert limits == [(0.0, peak)] * (2 * len(rows)) + [(-7.0, 7.0)] * len(rows)
    bars = [axes.get_ylabel() for axes in figure.axes if not axes.images]
    assert bars == ["counts", "counts", "difference [counts]"]
    assert figure.get_suptitle() == "left out: image changed 2.50 %"
    assert figure.get_size_inches().tolist() == [7.2 if count > 1 else 3.5, 6.5]


# Recordings, options and contact methods.


@pytest.mark.parametrize(
    ("keys", "options", "said"),
    [
        ({"threshold": -0.5}, {}, "--threshold: must be 0 or more, not -0.5"),
        ({}, {"method": "springs"}, "--method: "),
        ({}, {"tip": 1e-3}, "--tip, --texel: give both"),
        ({}, {"texel": 0}, "--tip, --texel: give both"),
        ({"threshold": 0.0}, {}, "no recording can be used"),
        ({}, {"tip": 1e-3, "texel": 0}, "no recording can be used"),
    ],
)
def test_wrong_options_of_a_calibration_are_refused(tmp_path, keys, options, said):
    (tmp_path / "a.csv").write_text("time,texel0\n0,1\n")
    with pytest.raises(InputError) as caught:
        calibrate_recordings(
            [tmp_path / "a.csv"], WTS, CommonKeys.model_construct(**{"indenter": "sphere:radius=5mm"} | keys), **options
        )
    assert said in str(caught.value)


def image(**options):
    tilt = options.pop("tilt", (0.0, 0.0))
    place = Placement(name="a", indenter=Sphere(radius=5e-3), tilt=tilt)
    return SimpleNamespace(file=SimpleNamespace(placement=place, name="a", **options))


SPREAD = replace(WTS, spread=Gaussian.from_sigma(1e-3))
SIZED = replace(WTS, cover=replace(WTS.cover, size=(60e-3, 80e-3)))


@pytest.mark.parametrize(
    ("sensor", "given", "surface", "expected"),
    [
        (WTS, ("default", (0.0, 0.0), (0.1, 0.0)), True, "reference"),
        (WTS, ("default", (0.0, 0.0), None), True, "fast model, cover"),
        (SPREAD, ("default", (0.0, 0.0)), True, "fast model, cover"),
        (SPREAD, ("default", (0.0, 0.0)), False, "fast model, foundation"),
        (SIZED, ("default", (0.0, 0.0)), True, "fast model, cover"),
        (SIZED, ("reference", None), True, "reference"),
        (WTS, ("boxes", (0.0, 0.0)), True, "fast model, boxes"),
        (WTS, ("cover", (0.0, 0.0)), True, "fast model, cover"),
    ],
)
def test_the_default_method_is_finite_elements_where_they_are_fast(monkeypatch, sensor, given, surface, expected):
    method, *tilts = given
    parameters, asked = fastmodel.load("wts-0614-34"), []
    if not surface:
        parameters = replace(parameters, surface=None)
    monkeypatch.setattr(calibration, "find_parameters", lambda *given: asked.append(given) or parameters)
    found = choose_method(sensor, method, [image(tilt=each) for each in tilts], str)
    assert found.name == expected
    assert asked == ([] if expected == "reference" else [(sensor, str)])
    assert expected != "reference" or found.thickness == sensor.cover.thickness


def test_recordings_are_passed_on_with_their_noise_and_full_scale(monkeypatch):
    """Those that may be fitted; one tip makes a trial of each recording with several images, or of all together."""
    asked = []
    made = [image(uses=uses) for uses in (("fit", "score"), ("score",), ("fit",))]
    for each, (name, noise, full) in zip(made, (("a", 2.0, 4000), ("b", 9.0, 9000), ("c", 3.0, 4095)), strict=True):
        each.noise, each.full_scale, each.file.name = noise, full, name
    read = SimpleNamespace(files=(), problems=("x: left out",))
    monkeypatch.setattr(calibration, "describe_files", lambda *given, moved: asked.append((given, moved)) or read)
    monkeypatch.setattr(calibration, "read_images", lambda *_: (made, ("y: drifts",)))
    monkeypatch.setattr(calibration, "observe", lambda images: [each.file.name for each in images])
    monkeypatch.setattr(calibration, "choose_method", lambda *given: given[1])
    monkeypatch.setattr(calibration, "calibrate", lambda *given, **more: asked.append((given, more)) or make())
    monkeypatch.setattr(
        calibration, "calibrate_point_load", lambda *given, **more: asked.append((given, more)) or make()
    )
    keys, said = CommonKeys.model_construct(), []
    found = calibrate_recordings([], WTS, keys, method="boxes", heights=True, progress=said.append)
    assert found.left_out == ("x: left out", "y: drifts")
    assert asked[0] == (([], keys, WTS.array), False)
    assert asked[1][0] == (["a", "c"], "boxes")
    assert asked[1][1] == {"noise": [2.0, 3.0], "full_scale": 4095, "heights": True, "profile": False,
                           "progress": said.append}  # fmt: skip
    assert said == ["reading recordings"]
    calibrate_recordings([], WTS, keys, moved=True, profile=True)
    assert asked[2][1]
    assert asked[3][0] == (["a", "c"], "default")
    assert (asked[3][1]["heights"], asked[3][1]["profile"], asked[3][1]["progress"]) == (False, True, None)
    calibrate_recordings([], WTS, keys, tip=2e-3, texel=5)
    assert asked[5] == ((["a", "c"], ["all recordings"] * 2, WTS), {"radius": 2e-3, "texel": 5})
    made[2].file.name = "a"
    calibrate_recordings([], WTS, keys, tip=2e-3, texel=0)
    assert asked[7] == ((["a", "a"], ["a", "a"], WTS), {"radius": 2e-3, "texel": 0})
    made[0].file.uses = made[2].file.uses = ("score",)
    with pytest.raises(InputError) as caught:
        calibrate_recordings([], WTS, keys)
    assert str(caught.value).splitlines()[-1].endswith("no recording can be used")
    assert "x: left out" in str(caught.value)


@pytest.mark.parametrize(
    ("sensor", "options", "asked"),
    [
        (WTS, {}, (("reader",), ("skfem",))),
        (WTS, {"method": "boxes"}, (("reader",), ())),
        (WTS, {"method": "reference"}, (("reader",), ("skfem",))),
        (WTS, {"draws": True}, (("reader", "matplotlib"), ("skfem",))),
        (WTS, {"tip": 1e-3, "texel": 3}, (("reader", "skfem"), ())),
        (SPREAD, {"method": "boxes", "draws": True}, (("reader", "matplotlib", "skfem"), ())),
    ],
)
@pytest.mark.parametrize("path", ["a.csv", "set.toml"])
def test_packages_are_required_before_recordings_are_read(monkeypatch, sensor, options, asked, path):
    """Recordings before they are opened, and those of a data-set file as soon as it names them."""
    found = []
    monkeypatch.setattr(calibration, "require", lambda *given, useful=(): found.append((given, tuple(useful))))
    monkeypatch.setattr(calibration, "list_modules", lambda _files: ["reader"])
    monkeypatch.setattr(calibration, "describe_files", lambda *_, **__: SimpleNamespace(files=(), problems=("none",)))
    monkeypatch.setattr(calibration, "read_images", lambda *_: ([], ()))
    with pytest.raises(InputError, match="no recording can be used"):
        calibrate_recordings([Path(path)], sensor, CommonKeys.model_construct(), **options)
    assert found == [asked] * (1 if path == "set.toml" else 2)
