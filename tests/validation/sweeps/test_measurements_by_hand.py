"""Quantities of sweeps: values, ends of their errors and units of commands whose results are written down."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from validation.errors import InputError
from validation.metrics import METRICS, Score
from validation.regression import quantities
from validation.regression.reading import read
from validation.results.derivation import Kernel, Responses, SurfaceKernel
from validation.sensor_file import BUILT_IN
from validation.sweeps import measurements
from validation.sweeps.measurements import NAMES, Measurement, Subject, read_measurement

SENSOR = BUILT_IN["wts-0614-34"]
INF = math.inf


def run(command, **options):
    return Measurement(command=command, options=options).run(Subject(sensor=SENSOR))


def make_responses(**changes):
    kernel = Kernel(
        sigma_x=0.6, sigma_y=0.5, ksize_x=5, ksize_y=7, residual=0.02, outside_kernel=0.01, estimator="fit",
        estimates={"fit": (0.6, 0.5)},
    )  # fmt: skip
    known = {
        "sensor": "pad", "cover": {}, "texel_response": np.eye(2), "texel_response_uniform": np.eye(2), "psf": kernel,
        "resolution": 4e-3, "sigma_range": (0.55, 0.65), "depth": {"foundation": {"modulus": 3e9}},
        "sensitivity": {"thickness": 200.0, "poisson_ratio": -0.4},
        "validity": {"load_2_percent": 3.0, "load_5_percent": 8.0, "largest_load": 8.0}, "calibration": {},
        "error_estimate": {"depth": 0.02, "peak": 0.03, "unknown": math.nan}, "assumed_electronics": (), "seconds": 1.0,
    }  # fmt: skip
    return Responses(**{**known, **changes})


def derive(monkeypatch, **changes):
    result = make_responses(**changes)
    made = SimpleNamespace(result=result, error_estimate=result.error_estimate, parameters="parameters")
    monkeypatch.setattr(measurements.api, "derive", lambda sensor: made if sensor is SENSOR else None)
    return run("derive")


def test_a_derivation_has_the_largest_estimated_error_or_the_own_coarse_one(monkeypatch):
    found = derive(monkeypatch)
    expected = {
        "sigma_x": (0.6, 0.03, "pitches"), "ksize_y": (7, 0.03, "texels"), "residual": (2.0, 0.03, "%"),
        "resolution": (4.0, 0.03, "mm"), "sigma_range_1": (0.55, 0.03, "pitches"),
        "sigma_range_2": (0.65, 0.03, "pitches"), "foundation_modulus": (3.0, 0.03, "N/mm3"),
        "load_2_percent": (3.0, 0.05, "N"), "sigma_by_thickness": (0.2, 0.03, "pitches per mm"),
        "sigma_by_poisson_ratio": (-0.004, 0.03, "pitches per 0.01"), "width_x": (3.4 * 0.6, 0.03, "mm"),
        "width_y": (3.4 * 0.5, 0.03, "mm"),
    }  # fmt: skip
    for name, (value, share, unit) in expected.items():
        ends = value - share * abs(value), value + share * abs(value)
        assert found[name] == (pytest.approx(value), *map(pytest.approx, ends), unit), name
    assert found["load_5_percent"] == (8.0, pytest.approx(7.6), INF, "N")  # compared up to there only
    assert found["resolution_on_array"] == (pytest.approx(math.nan, nan_ok=True), -INF, INF, "mm")
    assert not {"estimator", "estimates", "error_estimate"} & set(found)
    assert {name.rstrip("_12") for name in found} <= NAMES["derive"]({})


@pytest.mark.parametrize(
    ("estimates", "share", "coarse"),
    [({"depth": 0.001}, 0.005, 0.01), ({}, 0.005, 0.01), ({"depth": 0.06}, 0.06, 0.06), ({"x": INF}, 0.005, 0.01)],
)
def test_errors_are_no_smaller_than_half_a_percent(monkeypatch, estimates, share, coarse):
    found = derive(monkeypatch, error_estimate=estimates)
    assert found["sigma_y"][1:3] == (pytest.approx(0.5 * (1 - share)), pytest.approx(0.5 * (1 + share)))
    assert found["width_y"][1:3] == (pytest.approx(1.7 * (1 - share)), pytest.approx(1.7 * (1 + share)))
    assert found["foundation_modulus"][1:3] == (pytest.approx(3 * (1 - coarse)), pytest.approx(3 * (1 + coarse)))
    assert found["load_2_percent"].low == pytest.approx(3 * (1 - max(0.05, share)))


def test_a_derivation_without_a_kernel_or_validity_lacks_widths_and_loads(monkeypatch):
    surface = SurfaceKernel(sigma_m=(1.5e-3, 1.8e-3), residual=0.03)
    found = derive(monkeypatch, psf=None, gaussian=surface, validity="not stated", sensitivity=None)
    assert "width_x" not in found
    assert found["sigma_m_1"] == (pytest.approx(1.5), pytest.approx(1.455), pytest.approx(1.545), "mm")
    assert found["sigma_m_2"].value == pytest.approx(1.8)
    for name in ("load_2_percent", "load_5_percent"):
        assert math.isnan(found[name].value)
        assert found[name][1:3] == (-INF, INF)
    early = derive(monkeypatch, validity={"load_2_percent": 5.0, "load_5_percent": 9.0, "largest_load": 5.0})
    assert (early["load_2_percent"].high, early["load_5_percent"].high) == (INF, INF)


def test_limits_are_bounds_within_one_percent_or_means_of_frames_within_ten(monkeypatch):
    def limit(name, unit, value, posterior, counts):
        return SimpleNamespace(name=name, unit=unit, value=value, posterior=posterior, counts=counts)

    asked = []
    counted = [
        limit("force", "N", 2e-3, None, "bound"), limit("place x, force known", "m", 3e-5, 2e-5, "posterior"),
        limit("place y, force known", "m", 4e-5, 3e-5, "bound"), limit("radius", "m", None, None, "singular"),
    ]  # fmt: skip
    monkeypatch.setattr(
        measurements,
        "limits",
        lambda sensor, **given: asked.append((sensor, given)) or SimpleNamespace(counted=counted),
    )
    found = run("limits", noise="5 mN")
    assert asked == [(SENSOR, {"noise": "5 mN"})]
    assert found == {
        "force": (pytest.approx(2), pytest.approx(1.98), pytest.approx(2.02), "mN"),
        "place_x_force_known": (pytest.approx(30), pytest.approx(27), pytest.approx(33), "um"),
        "place_y_force_known": (pytest.approx(40), pytest.approx(39.6), pytest.approx(40.4), "um"),
        "radius": (INF, INF, INF, "um"),
    }


def make_score(**changes):
    numbers = {name: (k + 1) * 0.01 if not name.startswith("pixels") else k for k, name in enumerate(METRICS)}
    return Score(**{**numbers, **changes})


def test_a_press_has_the_error_of_the_finite_elements(monkeypatch):
    asked = []
    fem = SimpleNamespace(
        total_force=4.0, depth=2e-4, contact_area=5e-6, outside=-0.5, texel_forces=np.array([0.25, 0.75, 0.5]),
        error_estimate={"depth": 0.02, "total_force": math.nan, "peak": 0.01},
    )  # fmt: skip
    made = SimpleNamespace(fem=fem, score=make_score(misplaced_force=0.03))
    monkeypatch.setattr(measurements.api, "press", lambda *given, **options: asked.append((given, options)) or made)
    found = run("press", indenter="sphere:radius=5mm", load="4 N")
    assert asked == [((SENSOR, "sphere:radius=5mm"), {"load": "4 N"})]
    expected = {"total_force": (4.0, "N"), "depth": (2e-4, "m"), "contact_area": (5e-6, "m2"), "outside": (-0.5, "N")}
    expected |= {"largest_texel": (0.75, "N"), "misplaced_force": (3.0, METRICS["misplaced_force"].unit)}
    for name, (value, unit) in expected.items():
        ends = value - 0.02 * abs(value), value + 0.02 * abs(value)
        assert found[name] == (pytest.approx(value), *map(pytest.approx, ends), unit), name
    assert set(found) == NAMES["press"]({})


def test_means_of_a_campaign_have_their_intervals_where_these_are_known(monkeypatch):
    pooled = {
        "misplaced_force": SimpleNamespace(mean=0.03, low=0.02, high=0.05),
        "centre_of_pressure_m": SimpleNamespace(mean=1e-4, low=math.nan, high=math.nan),
        "relative_l2": SimpleNamespace(mean=0.2, low=0.1, high=INF),
    }
    campaign = SimpleNamespace(pooled={"fast": pooled, "boxes": {}})
    asked = []
    monkeypatch.setattr(
        measurements.api,
        "validate",
        lambda sensor, **given: asked.append((sensor, given)) or SimpleNamespace(campaign=campaign),
    )
    found = run("validate", quick=True)
    assert asked == [(SENSOR, {"quick": True})]
    assert found["mean_misplaced_force"] == (pytest.approx(3), pytest.approx(2), pytest.approx(5), "%")
    length = METRICS["centre_of_pressure_m"]
    assert found["mean_centre_of_pressure_m"] == (pytest.approx(1e-4 * length.factor), -INF, INF, length.unit)
    assert found["mean_relative_l2"] == (pytest.approx(20), -INF, INF, "%")
    assert NAMES["validate"]({}) == {f"mean_{name}" for name in METRICS}


def test_guarded_numbers_have_their_tolerances(monkeypatch):
    derivation = SimpleNamespace(parameters="parameters")
    monkeypatch.setattr(measurements.api, "derive", lambda sensor: derivation)
    asked = []

    def experiment(subject):
        asked.append((subject.parameters, subject.derivation))
        return {
            "Force of (all) texels": read({"row 0": [0.5, -0.25], "one": 0.75}, "N", 0.125),
            "share": read(-0.4, "%", "5 % of each"), "none": None,
        }  # fmt: skip

    def refuse(_):
        raise ValueError("no contact")

    groups = {"H": experiment, "refused": refuse}
    monkeypatch.setattr(quantities, "EXPERIMENTS", groups)
    found = run("regress", group="H")
    assert asked == [("parameters", derivation)]
    assert found == {
        "force_of_all_texels_row_0_0": (0.5, 0.375, 0.625, "N"),
        "force_of_all_texels_row_0_1": (-0.25, -0.375, -0.125, "N"),
        "force_of_all_texels_one": (0.75, 0.625, 0.875, "N"),
        "share": (-40, pytest.approx(-42), pytest.approx(-38), "%"),
    }  # fmt: skip
    with pytest.raises(InputError, match="no contact"):
        run("regress", group="refused")
    assert NAMES["regress"]({"group": "H"}) == set()


@pytest.mark.parametrize(
    ("text", "command", "options"),
    [
        ("derive", "derive", {}), ("limits --noise '5 mN' --two 3mm", "limits", {"noise": "5 mN", "two": "3mm"}),
        ("limits --prior between", "limits", {"prior": "between"}), ("validate --quick", "validate", {"quick": True}),
        ("press --indenter sphere:radius=5mm --load 2N --strain finite", "press",
         {"indenter": "sphere:radius=5mm", "load": "2N", "strain": "finite"}),
        ("validate --only-recordings --budget 1h", "validate", {"only_recordings": True, "budget": "1h"}),
        ("regress data sheet", "regress", {"group": "data sheet"}),
    ],
)  # fmt: skip
def test_a_command_is_read_with_its_options(text, command, options):
    found = read_measurement(text)
    assert (found.command, dict(found.options)) == (command, options)
    assert found.names == NAMES[command](options)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("limits '--noise", "is no command; write for example 'limits --noise 5mN'"),
        ("press --models fast", "--models"),
        ("derive --progress x", "--progress"), ("press --strain fine", "unknown value 'fine'"),
        ("press --strain", "press --strain: needs a value"),
    ],
)  # fmt: skip
def test_what_is_no_command_is_refused(text, words):
    with pytest.raises(InputError) as refused:
        read_measurement(text)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("options", "names"),
    [({}, set()), ({"radius": "1 mm"}, {"radius"}), ({"two": "3 mm", "radius": "1 mm"}, {"radius", "separation"})],
)
def test_limits_of_radius_and_separation_exist_where_they_are_asked_for(options, names):
    always = {"force", "least_force_over_the_texel", "least_force_worst_place"}
    always |= {f"place_{axis}_force_{known}" for axis in "xy" for known in ("known", "unknown")}
    assert NAMES["limits"](options) == always | names


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("limits --prior between --noise 5mN", None),
        ("press --indenter sphere:radius=5mm --load 1N --at 1mm,2mm", None),
        ("press --load 1N", "--indenter"), ("press --indenter sphere:radius=5mm --load 1N --yaw 5mm", "--yaw"),
        ("limits --load 2mm", "measure: limits: --load"), ("derive", None),
    ],
)  # fmt: skip
def test_options_are_checked_before_anything_is_computed(text, words):
    measurement = read_measurement(text)
    if words is None:
        measurement.check(SENSOR)
        return
    with pytest.raises(InputError) as refused:
        measurement.check(SENSOR)
    assert words in str(refused.value)
