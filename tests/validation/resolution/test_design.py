"""Designs against `limits`, closed forms, scaling, recomputed bands and refusals."""

import dataclasses
import json
import math

import numpy as np
import pytest
from scipy.special import j0

import fastmodel
import validation
from fem_reference.closed_form.contact import indent
from fem_reference.closed_form.layer import tabulate_texel_response, transfer
from fem_reference.indentation.ball_path import press_ball as press_finite
from meshes import Cover, Layer, Material, Sphere
from meshes.hardness import modulus_from_hardness
from meshes.layer import scale_layers
from validation.errors import InputError
from validation.resolution import ball
from validation.resolution.design import find_designs

WTS = validation.load("wts-0614-34")
NOISE = 5e-3


def ask(**options):
    return validation.design("wts-0614-34", noise="5 mN", **options)


def by_thickness(found, name):
    return np.array([each.numbers[name] for each in found.line("thickness")])


def check_limits(thickness, load, touch):
    """Compare one design with `limits` of a sensor with this cover and the electronics of the built-in sensor."""
    design = ask(thickness=f"{thickness} m", load=load, radius=touch).designs[0]
    cover = dataclasses.replace(WTS.cover, layers=scale_layers(WTS.cover.layers, thickness))
    sensor = dataclasses.replace(WTS, cover=cover, electronics=fastmodel.load("wts-0614-34").electronics)
    found = {each.name: each.value for each in validation.limits(sensor, load=load, noise="5 mN", radius=touch).counted}
    error = math.hypot(*(found[f"place {axis}, force known"] for axis in "xy")) / math.sqrt(2)
    assert design.numbers["error_m"] == pytest.approx(error, rel=1e-6)
    assert design.numbers["least_N"] == pytest.approx(found["least force, worst place"], rel=1e-6)


def test_error_and_least_force_are_those_of_limits():
    check_limits(2.7e-3, "0.7 N", "1.2 mm")


@pytest.mark.slow
def test_ten_random_designs_are_those_of_limits():
    rng = np.random.default_rng(7)
    for _ in range(10):
        check_limits(rng.uniform(0.8e-3, 6e-3), f"{rng.uniform(0.3, 3):.3f} N", f"{rng.uniform(0, 2):.2f} mm")


def test_the_spread_of_one_layer_is_its_thickness_times_a_constant():
    found = ask(thickness="1mm:6mm:6", load="2 N")
    ratio = by_thickness(found, "spread_m") / [each.thickness for each in found.designs]
    assert ratio == pytest.approx(ratio[0], rel=1e-9)
    k, weight = (part.ravel() for part in np.polynomial.legendre.leggauss(400))
    waves = 30e3 * (k + 1) / 2 / 2  # 1/m on 2 mm
    base = transfer(WTS.cover, waves).base * waves * weight
    half = ratio[0] * 2e-3 / 2
    assert j0(waves * half) @ base == pytest.approx(base.sum() / 2, rel=1e-4)


def test_hardness_of_one_layer_moves_neither_error_nor_spread_of_points_but_touch_depth_and_range():
    found = ask(thickness="2mm", hardness="25A:60A:3", load="0.6 N")
    assert {name for name in found.designs[0].numbers if found.varies(name)} == {"touch_m", "depth_m"}
    assert "its hardness changes neither the spread nor the error" in " ".join(found.explain())
    for name in ("touch_m", "depth_m"):
        assert (np.diff([each.numbers[name] for each in found.designs]) < 0).all()


def test_least_force_without_a_threshold_is_the_closed_form(tmp_path):
    text = """name = "line"
[array]
rows = 9
columns = 9
pitch = "3 mm"
[[cover.layer]]
thickness = "2 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.45 }
[electronics]
sensitivity = "100 1/N"
offset = 100.0
output_max = 4000
bits = 12
"""
    (tmp_path / "line.toml").write_text(text)
    found = validation.design(tmp_path / "line.toml", thickness="2mm", noise="20 mN", load="5 N")
    array, cover = (getattr(validation.load(tmp_path / "line.toml"), name) for name in ("array", "cover"))
    apart = array.centres[:, :2] - array.centres[40, :2] - np.array(array.pitch) / 2
    shares = tabulate_texel_response(cover, array.texel_size)(apart[:, 0], apart[:, 1])
    spread = math.hypot(20e-3, 10e-3 / math.sqrt(12))
    assert found.designs[0].numbers["least_N"] == pytest.approx(4.372014 * spread / np.linalg.norm(shares), rel=1e-4)


def test_a_cover_that_scales_with_its_array_tells_the_same_share_of_the_pitch():
    found = ask(thickness="1.5mm:3mm:2", pitch="3mm:6mm:2", load="1 N")
    small, large = (
        next(d for d in found.designs if (d.thickness, d.pitch) == at) for at in ((1.5e-3, 3e-3), (3e-3, 6e-3))
    )
    for name, factor in (("error_m", 2), ("spread_m", 2), ("least_N", 1)):
        assert large.numbers[name] == pytest.approx(factor * small.numbers[name], rel=1e-6)


def test_larger_loads_are_told_better_and_thicker_covers_hide_more():
    errors = [ask(thickness="3mm", load=f"{load} N").designs[0].numbers["error_m"] for load in (0.5, 1, 2)]
    assert errors == sorted(errors, reverse=True)
    least = by_thickness(ask(thickness="2mm:6mm:4"), "least_N")
    assert (np.diff(least) > 0).all()


def test_bands_hold_what_the_ends_of_the_tolerance_give():
    found = ask(thickness="2mm", hardness="40A", tolerance=6.0, ball="4 mm", load="1.5 N").designs[0]
    for hardness in (34, 46):
        end = ask(thickness="2mm", hardness=f"{hardness}A", tolerance=0.0, ball="4 mm", load="1.5 N").designs[0]
        for name, (low, high) in found.bands.items():
            assert low <= end.numbers[name] <= high
            assert end.numbers[name] == pytest.approx(
                low if abs(low - end.numbers[name]) < abs(high - end.numbers[name]) else high
            )


def test_the_touch_of_a_ball_is_the_exact_contact():
    found = ask(thickness="2.3mm", hardness="37A", ball="4.1 mm", load="0.7 N").designs[0]
    material = Material(
        name="soft",
        model="linear-elastic",
        parameters={"youngs_modulus": modulus_from_hardness(37).youngs_modulus},
        poisson_ratio=0.49,
    )
    cover = Cover(layers=(Layer(thickness=2.3e-3, material=material),))
    exact = indent(cover, Sphere(radius=4.1e-3), load=0.7)
    assert found.numbers["touch_m"] == pytest.approx(exact.contact_radius, rel=2e-3)
    assert found.numbers["depth_m"] == pytest.approx(exact.depth, rel=0.05)


def test_the_table_of_finite_strain_states_its_error_and_meets_a_press_between_its_nodes():
    errors = ball.estimate_errors()
    assert errors[:2].max() < 5e-3
    assert errors[2] < 0.03
    material = Material(name="soft", model="neo-hookean", parameters={"shear_modulus": 2e5}, poisson_ratio=0.482)
    layer = Layer(thickness=1.7e-3, material=material)
    found = ball.press_ball(layer, 4.3e-3, 0.1)
    truth = press_finite(Cover(layers=(layer,)), 4.3e-3, [0.15 * 1.7e-3, 0.3 * 1.7e-3])
    assert found.most == pytest.approx(truth.load[-1], rel=errors[2])
    assert ball.press_ball(layer, 4.3e-3, float(truth.load[0])).depth == pytest.approx(truth.depth[0], rel=errors[2])


TWO = """name = "two"
[array]
rows = 5
columns = 5
pitch = "3 mm"
[cover]
layer = [
  { thickness = "2 mm", material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 } },
  { thickness = "0.1 mm", material = { model = "linear-elastic", youngs_modulus = "1 GPa", poisson_ratio = 0.4 } },
]
"""


@pytest.mark.slow
def test_outside_the_table_the_load_range_needs_sweep(tmp_path):
    (tmp_path / "two.toml").write_text(TWO)
    found = validation.design(tmp_path / "two.toml", thickness="2mm", hardness="30A:50A:2", noise="5 mN")
    assert "needs sweep" in found.designs[0].ends
    assert found.designs[0].numbers["depth_m"] is None
    spreads = [each.numbers["spread_m"] for each in found.designs]
    assert spreads[0] > 1.02 * spreads[1]  # a foil spreads more on a softer layer
    assert "softcover sweep" in " ".join(found.explain())
    touched = validation.design(
        tmp_path / "two.toml", thickness="2mm", ball="5 mm", noise="5 mN", load="0.5 N"
    ).designs[0]
    assert 0.1e-3 < touched.numbers["touch_m"] < 3e-3


def test_loads_that_saturate_or_press_too_deep_end_the_range():
    found = ask(thickness="1mm", load="1.3 N").designs[0]
    assert found.ends == "saturation"
    response = tabulate_texel_response(
        Cover(layers=(Layer(thickness=1e-3, material=WTS.cover.layers[0].material),)), WTS.array.texel_size
    )
    share = float(response(np.zeros(1), np.zeros(1))[0])
    line = validation.load("wts-0614-34").electronics
    force = (line.output_max - line.offset) / line.sensitivity * 0.7646
    assert found.numbers["most_N"] == pytest.approx(force / share, rel=1e-3)
    deep = validation.design(
        WTS, thickness="6mm", hardness="20A", tolerance=0.0, noise="5 mN", ball="4 mm", load="60 N"
    )
    assert deep.designs[0].ends == "30 % of the thickness"
    assert deep.designs[0].numbers["error_m"] is None
    assert deep.best is None
    assert next(deep.explain()).startswith("No design")


def test_the_best_design_is_the_least_error_and_the_flat_range_holds_ten_percent():
    found = ask(thickness="1mm:6mm:11", load="1 N")
    errors = by_thickness(found, "error_m")
    best = found.designs[found.best]
    assert best.numbers["error_m"] == errors.min()
    inside = [d.numbers["error_m"] for d in found.designs if found.flat[0] <= d.thickness <= found.flat[1]]
    assert max(inside) <= 1.1 * errors.min()
    thicknesses = np.array([each.thickness for each in found.designs])
    for end, side in zip(found.flat, (-1, 1), strict=True):
        beyond = int(np.flatnonzero(thicknesses == end)[0]) + side
        assert beyond in (-1, 11) or errors[beyond] > 1.1 * errors.min()


def test_a_planted_threshold_moves_the_best_design():
    """Without a dead zone the best cover differs, so that a design that ignored the electronics would be noticed."""
    plain = dataclasses.replace(
        WTS, electronics=dataclasses.replace(WTS.electronics, offset=0.0, calibrated="texel force")
    )
    options = {"load": 0.5, "thicknesses": (1e-3, 2.5e-3, 5e-3), "pitches": (3.4e-3,), "noise": NOISE}
    free, dead = (find_designs(each, WTS.cover, **options) for each in (plain, WTS))
    assert free.middle.numbers["error_m"] < 0.2 * dead.middle.numbers["error_m"]


@pytest.mark.slow
def test_the_command_writes_a_page_with_every_design(softcover, tmp_path):
    words = "design wts-0614-34 --thickness 1mm:3mm:3 --hardness 30A:50A:2 --pitch 2mm:4mm:2 --noise 5mN --ball 5mm"
    status, out, error = softcover(*words.split(), "--out", "page", "--json")
    assert status == 0, error
    printed = json.loads(out)
    assert len(printed["designs"]) == 12
    assert json.loads((tmp_path / "page" / "design.json").read_text()) == printed
    page = (tmp_path / "page" / "index.html").read_text()
    assert page.count("<svg") == 9
    assert "Best: " in page
    assert (tmp_path / "page" / "maps.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_page_is_drawn_where_designs_have_no_numbers(tmp_path):
    """A heavy ball presses soft and thin covers too deep, so that maps have gaps, and one number is the same."""
    options = {"thickness": "1mm:3mm:2", "hardness": "25A:75A:2", "pitch": "3mm:4mm:2", "ball": "2 mm"}
    for load in ("2 N", "200 N"):
        found = ask(load=load, out=tmp_path / load[:-2], **options)
        assert any(each.numbers["error_m"] is None for each in found.designs)
        assert (tmp_path / load[:-2] / "index.html").is_file()


def test_more_designs_than_can_be_computed_are_refused_before_they_start(tmp_path):
    with pytest.raises(InputError, match=r"1000 x 1 x 1000 = 1000000 designs would take about 833 min; at most 5000"):
        ask(thickness="1mm:5mm:1000", pitch="2mm:5mm:1000", out=tmp_path / "page")
    assert not list(tmp_path.iterdir())
