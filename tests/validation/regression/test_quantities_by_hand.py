"""Quantities of results of finite elements: what is read, in which unit, from results with numbers written down."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
import fem_reference
from fem_reference.errors import UnsupportedError
from fem_reference.indentation import relaxing
from fem_reference.indentation.relaxing import find_relaxation
from meshes import Cover, Layer, Material, TexelArray
from meshes.relaxation import Relaxation
from validation.regression import quantities
from validation.regression.quantities import (
    compare_shipped,
    measure_comparison_models,
    measure_derivation,
    measure_friction,
    measure_reference,
    measure_relaxation,
    measure_uncertainty,
)
from validation.sensor_file import BUILT_IN

SENSOR = BUILT_IN["wts-0614-34"]
PARAMETERS = fastmodel.load("wts-0614-34")
NOTHING = SimpleNamespace(derivation=None, campaign=None, comparison=None, bench=None)


def flatten(reading):
    """Numbers of a reading by label, alone where there is one."""
    return {label: row[0] if len(row) == 1 else row for label, row in reading.numbers.items()}


def near(values):
    return {key: pytest.approx(value, rel=1e-4) for key, value in values.items()}


@pytest.mark.parametrize(
    "experiment",
    [
        measure_derivation, compare_shipped, measure_reference, measure_friction, measure_relaxation,
        measure_comparison_models, measure_uncertainty,
    ],
)  # fmt: skip
def test_parameters_alone_have_no_results_of_finite_elements(experiment):
    assert experiment(NOTHING) == {}


def make_result(**changes):
    kernel = SimpleNamespace(sigma_x=0.61, sigma_y=0.47, ksize_x=5, ksize_y=7, residual=0.021, outside_kernel=0.013)
    result = {
        "psf": kernel, "gaussian": None, "texel_response_outside": 0.11, "texel_response_uniform_outside": 0.14,
        "load_2_percent": 3.0, "load_5_percent": 8.0, "calibration": {"tip": {"share": 0.76}},
        "foundation_modulus": 4.5e9, "depth": {"depth": [1e-4, 3e-4]},
    }  # fmt: skip
    array = SimpleNamespace(pitch=(2e-3, 4e-3))
    return SimpleNamespace(
        derivation=SimpleNamespace(
            result=SimpleNamespace(**{**result, **changes}), sensor=SimpleNamespace(array=array), own_share=0.52,
            error_estimate={"peak": 0.004, "unknown": math.nan, "depth": 0.002},
        )
    )  # fmt: skip


def test_a_derivation_is_read_in_the_units_of_the_baseline():
    found = measure_derivation(make_result())
    assert {name: (each.unit, flatten(each)) for name, each in found.items()} == {
        "share on the loaded texel": ("%", {"": 52.0}), "share outside": ("%", {"point": 11.0, "uniform": 14.0}),
        "share of the calibration tip": ("%", {"": 76.0}), "foundation modulus": ("N/mm3", {"": 4.5}),
        "depth of a ball": ("mm", {"depths": (pytest.approx(0.1), pytest.approx(0.3))}),
        "range of the fast model": ("N", {"2 %": 3.0, "5 %": 8.0}),
        "estimated error": ("%", {"peak": pytest.approx(0.4), "depth": pytest.approx(0.2)}),
        "sigma": ("pitches", {"x": 0.61, "y": 0.47}), "ksize": ("texels", {"x": 5, "y": 7}),
        "residual": ("%", {"": pytest.approx(2.1)}), "outside the kernel": ("%", {"": pytest.approx(1.3)}),
    }  # fmt: skip
    assert {name: (each.tolerance, each.relative) for name, each in found.items() if not each.relative} == {
        "share on the loaded texel": (0.1, False), "share outside": (0.05, False), "ksize": (0.5, False),
        "share of the calibration tip": (0.3, False), "residual": (0.1, False), "outside the kernel": (0.1, False),
    }  # fmt: skip
    assert {name: each.tolerance for name, each in found.items() if each.relative} == {
        "foundation modulus": 0.01, "depth of a ball": 0.005, "range of the fast model": 0.05, "sigma": 0.005,
        "estimated error": 0.2,
    }  # fmt: skip


def test_a_gaussian_along_a_surface_is_read_in_pitches():
    surface = SimpleNamespace(sigma_m=(1.5e-3, 1.8e-3), residual=0.034)
    found = measure_derivation(make_result(psf=None, gaussian=surface))
    assert flatten(found["sigma"]) == near({"x": 0.75, "y": 0.45})
    assert flatten(found["residual"]) == near({"": 3.4})
    assert not {"ksize", "outside the kernel"} & set(found)


def test_parts_of_a_derivation_that_do_not_exist_are_not_read():
    absent = {
        "psf": None, "texel_response_outside": None, "texel_response_uniform_outside": None, "load_2_percent": None,
        "load_5_percent": None, "calibration": {"tip": None}, "foundation_modulus": None, "depth": None,
    }  # fmt: skip
    found = measure_derivation(make_result(**absent))
    assert {name for name, each in found.items() if each is not None} == {
        "share on the loaded texel",
        "estimated error",
    }
    half = measure_derivation(make_result(**{**absent, "load_5_percent": 8.0, "texel_response_outside": 0.0}))
    assert flatten(half["range of the fast model"]) == {"5 %": 8.0}
    assert flatten(half["share outside"]) == {"point": 0.0}


@pytest.mark.parametrize(
    ("change", "label", "percent"),
    [
        (lambda p: replace(p, electronics=replace(p.electronics, sensitivity=1.0)), "electronics", 100),
        (lambda p: replace(p, filter=fastmodel.Butterworth(cutoff_hz=7.0)), "filter", 100),
        (lambda p: replace(p, spread=replace(p.spread, sigma_x=1e-3, sigma_y=1e-3)), "spread", None),
        (lambda p: replace(p, surface=replace(p.surface, compliance=1.25 * p.surface.compliance)),
         "compliance of the cover", 20),
        (lambda p: replace(p, surface=replace(p.surface, influence=0.8 * p.surface.influence)),
         "influence of the cover", 25),
        (lambda p: replace(p, electronics=replace(p.electronics, tip_share=0.5 * p.electronics.tip_share)),
         "calibration tip", 100),
    ],
)  # fmt: skip
def test_shipped_and_derived_parameters_are_compared_part_by_part(change, label, percent):
    subject = SimpleNamespace(derivation=SimpleNamespace(sensor=SENSOR, parameters=change(PARAMETERS)))
    found = flatten(compare_shipped(subject)["difference"])
    assert set(found) == {
        "texels", "mask", "spread", "compliance of the cover", "influence of the cover", "calibration tip",
        "electronics", "filter",
    }  # fmt: skip
    assert {name for name, value in found.items() if value} == {label}
    if percent is not None:
        assert found[label] == pytest.approx(percent, rel=1e-3)


def test_shipped_parameters_of_another_grid_or_without_a_surface_are_compared_too():
    array = PARAMETERS.array
    other = replace(PARAMETERS, array=TexelArray.grid(array.rows - 1, array.columns, array.pitch), surface=None)
    subject = SimpleNamespace(derivation=SimpleNamespace(sensor=SENSOR, parameters=other))
    found = flatten(compare_shipped(subject)["difference"])
    assert (found["texels"], found["mask"]) == (100, 100)
    assert not any("cover" in name for name in found)
    named = replace(SENSOR, name="wts-0614-34")  # not the built-in one itself
    assert compare_shipped(SimpleNamespace(derivation=SimpleNamespace(sensor=named, parameters=other))) == {}


def test_results_of_all_cases_are_read_over_the_load():
    def make(name, k):
        reference = SimpleNamespace(
            total_force=2.0 + k, texel_forces=np.array([0.25, 0.75, 0.5]) + k, outside=0.3, depth=1e-4 * (1 + k),
            contact_area=(5 + k) * 1e-6, balance=None if k else 0.02,
        )  # fmt: skip
        return SimpleNamespace(case=SimpleNamespace(name=name, load=4.0 + k), reference=reference)

    floor = {"depth": 0.01, "total_force": 0.0, "peak": 0.03}
    campaign = SimpleNamespace(cases=(make("one", 0), make("two", 1)), noise_floor=floor)
    found = measure_reference(SimpleNamespace(campaign=campaign))
    assert {name: (each.unit, flatten(each)) for name, each in found.items()} == {
        "load": ("N", near({"one": 2.0, "two": 3.0})),
        "largest texel force": ("mN", near({"one": 750.0, "two": 1750.0})),
        "force outside": ("% of load", near({"one": 7.5, "two": 6.0})),
        "depth": ("mm", near({"one": 0.1, "two": 0.2})), "contact area": ("mm2", near({"one": 5.0, "two": 6.0})),
        "imbalance": ("% of load", near({"one": 2.0, "two": 0.0})),
        "estimated error": ("%", near({"depth": 1.0, "peak": 3.0})),
    }  # fmt: skip
    assert (found["force outside"].tolerance, found["imbalance"].tolerance) == (0.1, 0.02)


def make_cover(*, relaxation=None, model="linear-elastic"):
    """Two layers of 1 mm and 3 mm."""
    parameters = {"youngs_modulus": 8e5} if model == "linear-elastic" else {"shear_modulus": 3e5}
    rubber = Material(name="rubber", model=model, parameters=parameters, poisson_ratio=0.45, relaxation=relaxation)
    return Cover(layers=(Layer(thickness=1e-3, material=rubber), Layer(thickness=3e-3, material=rubber)))


def test_two_bodies_press_with_friction_and_the_shear_is_read_over_the_load(monkeypatch):
    asked = []

    def press(cover, array, shape, pose, *, depth, friction):
        asked.append((cover, array, shape, depth, friction))
        x, y, z = pose.position
        return SimpleNamespace(
            total_force=2.0, texel_forces=np.array([0.1, 0.4]),
            # Beside the axis along x and y, and below it: 0.3 N outwards, 0.4 N inwards, and 0.2 N around the axis.
            contact_points=np.array([[x + 2e-3, y, z - 1e-3], [x, y - 3e-3, z], [x, y + 1e-3, z], [x, y, z - 1e-3]]),
            contact_forces=np.array([[0.3, 0.0, -1.0], [0.0, 0.4, -0.5], [0.2, 0.0, -0.5], [0.0, 0.0, -3.0]]),
        )  # fmt: skip

    monkeypatch.setattr(fem_reference, "press", press)
    array = replace(SENSOR.array, centres=np.add(SENSOR.array.centres, [7e-3, -4e-3, 0.0]))
    sensor = replace(SENSOR, cover=make_cover(model="neo-hookean"), array=array)
    subject = SimpleNamespace(derivation=SimpleNamespace(sensor=sensor))
    found = measure_friction(subject)
    (_, given, ball, depth, friction), (_, _, face, other_depth, stuck) = asked
    assert all(layer.material.model == "linear-elastic" for layer in asked[0][0].layers)
    assert asked[0][0].thickness == pytest.approx(4e-3)
    assert given is array
    assert (ball.radius, face.radius) == (pytest.approx(80e-3), pytest.approx(4e-3))
    assert (type(ball).__name__, type(face).__name__) == ("Sphere", "Cylinder")
    assert (depth, other_depth) == (pytest.approx(0.08e-3), pytest.approx(0.08e-3))
    assert (friction, stuck) == (0.1, math.inf)
    both = "ball, coefficient 0.1", "face, no slip"
    assert flatten(found["load"]) == dict.fromkeys(both, 2.0)
    assert flatten(found["largest texel force"]) == near(dict.fromkeys(both, 400.0))
    assert flatten(found["shear"]) == near(dict.fromkeys(both, 45.0))
    assert flatten(found["shear outwards"]) == near(dict.fromkeys(both, -5.0))

    def refuse(*_, **__):
        raise UnsupportedError("side edges", argument="cover")

    monkeypatch.setattr(fem_reference, "press", refuse)
    assert measure_friction(subject) == {}


def test_a_cover_that_relaxes_is_followed_at_its_ages(monkeypatch):
    law = Relaxation(g=(0.3, 0.2), tau=(0.5, 10.0))
    sensor = replace(SENSOR, cover=make_cover(relaxation=law))
    subject = SimpleNamespace(derivation=SimpleNamespace(sensor=sensor))
    asked = []

    def follow(cover, array, face, pose, *, times, depths):
        asked.append((cover.thickness, array, face.radius, times, depths))
        return SimpleNamespace(times=np.array([0.0, 0.5, 1.0, 10.0, 60.0]), forces=np.array([9.0, 7.0, 5.0, 3.0, 2.0]))

    monkeypatch.setattr(relaxing, "follow_press", follow)
    found = measure_relaxation(subject)
    thickness, array, radius, times, depths = asked[0]
    assert (thickness, array, radius) == (pytest.approx(4e-3), SENSOR.array, pytest.approx(8e-3))
    assert (times, depths) == ((0.0, 1.0, 10.0, 60.0), [pytest.approx(8e-5)] * 4)
    assert flatten(found["force at a held depth"]) == {"1 s": 5.0, "10 s": 3.0, "60 s": 2.0}
    # A growing depth t / 60 s: the force is the convolution of the modulus with the rate of (t / 60 s)^1.5.
    grown, crept = (flatten(found[name]) for name in ("force of a growing contact", "depth under a held load"))
    moduli = find_relaxation(sensor.cover)
    assert tuple(moduli.g) == pytest.approx(law.g)
    for age in (10.0, 60.0):
        steps = np.linspace(0.0, age, 20001)
        middle, rise = (steps[1:] + steps[:-1]) / 2, np.diff((steps / 60) ** 1.5)
        left = 1 - sum(g * (1 - np.exp(-(age - middle) / tau)) for g, tau in zip(law.g, law.tau, strict=True))
        assert grown[f"{age:g} s"] == pytest.approx(float(left @ rise), rel=0.01)
    # Under a held load the force per modulus grows: at the end by the share that is left, as a power 2/3 of a depth.
    assert 0.1 ** (2 / 3) < crept["1 s"] < crept["10 s"] < crept["60 s"] < (0.1 / 0.5) ** (2 / 3)
    assert crept["60 s"] == pytest.approx((0.1 / 0.5) ** (2 / 3), rel=0.02)

    def refuse(*_, **__):
        raise UnsupportedError("finite strain", argument="cover")

    monkeypatch.setattr(relaxing, "follow_press", refuse)
    assert measure_relaxation(subject) == {}
    assert measure_relaxation(SimpleNamespace(derivation=SimpleNamespace(sensor=SENSOR))) == {}


def test_models_press_one_block_and_their_forces_and_moments_are_read():
    array = TexelArray.grid(4, 5, (2e-3, 3e-3))
    forces, x, y = np.zeros(20), array.centres[:, 0], array.centres[:, 1]
    forces[[6, 8, 16]] = 1.0, 2.0, 0.5
    asked = []

    def compute(case):
        asked.append(case)
        return SimpleNamespace(models={"fast": (forces, 0.25)}, published={"penalty": (2 * forces, -0.5)})

    subject = SimpleNamespace(
        comparison=SimpleNamespace(compute_models=compute), parameters=SimpleNamespace(array=array)
    )
    found = measure_comparison_models(subject)
    (case,) = asked
    load = 34e3 * 3.4e-3 * 6.9e-3
    assert (case.name, case.load) == ("block", pytest.approx(load))
    assert case.indenter.size == pytest.approx((3.4e-3, 6.9e-3, 3.4e-3))
    assert flatten(found["force on texels"]) == near({"fast": 3.5, "penalty": 7.0})
    assert flatten(found["force outside"]) == near({"fast": 25 / load, "penalty": -50 / load})
    assert flatten(found["largest texel force"]) == near({"fast": 2000.0, "penalty": 4000.0})
    at = np.array([x @ forces, y @ forces]) / 3.5
    assert flatten(found["centre"])["fast"] == pytest.approx((*1e3 * at, 0.0), abs=1e-4)
    width = np.sqrt([(x - at[0]) ** 2 @ forces / 3.5, (y - at[1]) ** 2 @ forces / 3.5])
    assert flatten(found["width"])["penalty"] == pytest.approx(1e3 * width, abs=1e-3)
    assert [found[name].tolerance for name in ("force outside", "centre", "width")] == [0.1, 0.01, 0.02]


def test_uncertainties_of_the_first_case_are_read(monkeypatch):
    asked = []

    def propagate(case, inputs):
        asked.append((case, inputs.friction))
        return SimpleNamespace(misplaced={"modulus": 0.01, "yaw": 0.002})

    def compare(array, result, inputs, data):
        asked.append((array, result, data))
        parts = {"peak": (0.1, 0.2, 0.3), "sum": (0.4, 0.5, 0.6)}
        return [
            SimpleNamespace(quantity=name, u_num=each[0], u_input=each[1], u_data=each[2])
            for name, each in parts.items()
        ]

    monkeypatch.setattr(quantities, "compare_quantities", compare)
    first = SimpleNamespace(case="first")
    subject = SimpleNamespace(
        bench=SimpleNamespace(propagate=propagate), campaign=SimpleNamespace(cases=(first, "second")),
        parameters=SimpleNamespace(array="array"),
    )  # fmt: skip
    found = measure_uncertainty(subject)
    assert asked == [("first", 0.0), ("array", first, 0.02)]
    assert flatten(found["of each quantity"]) == {"peak": (0.1, 0.2, 0.3), "sum": (0.4, 0.5, 0.6)}
    assert flatten(found["misplaced by each input"]) == near({"modulus": 1.0, "yaw": 0.2})
    assert found["misplaced by each input"].tolerance == 0.05
    for lacking in ({"bench": None}, {"campaign": None}, {"campaign": SimpleNamespace(cases=())}):
        assert measure_uncertainty(SimpleNamespace(**{**vars(subject), **lacking})) == {}
