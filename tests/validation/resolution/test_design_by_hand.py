"""Designs by hand: load ranges, sentences, which cover a ball is pressed on, and bands."""

import dataclasses
import math

import pytest
from scipy.optimize import brentq

import validation
from fastmodel import Electronics
from fem_reference.closed_form.contact import indent
from fem_reference.closed_form.layer import point_response
from meshes import Cover, Layer, Material, Sphere, TexelArray
from meshes.hardness import modulus_from_hardness
from validation.resolution.ball import estimate_errors, press_ball
from validation.resolution.design import Design, Designs, find_designs

NONE = dict.fromkeys(("error_m", "spread_m", "least_N", "most_N", "touch_m", "depth_m"))


def make_design(thickness=2e-3, hardness=None, pitch=3e-3, *, ends="saturation", **numbers):
    return Design(
        thickness=thickness, hardness=hardness, pitch=pitch, modulus=1e6, numbers=NONE | numbers,
        bands=dict.fromkeys(NONE), ends=ends,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("numbers", "load", "held"),
    [
        ({"error_m": 1e-5, "least_N": 0.2, "most_N": 3.0}, 0.2, True),
        ({"error_m": 1e-5, "least_N": 0.2, "most_N": 3.0}, 0.1999, False),
        ({"error_m": 1e-5, "least_N": 0.2, "most_N": 3.0}, 3.0, True),
        ({"error_m": 1e-5, "least_N": 0.2, "most_N": 3.0}, 3.001, False),
        ({"error_m": 1e-5, "least_N": 0.2}, 900.0, True), ({"error_m": 1e-5, "most_N": 3.0}, 1.0, False),
        ({"least_N": 0.2, "most_N": 3.0}, 1.0, False),
    ],
)  # fmt: skip
def test_a_load_lies_within_a_range_with_its_ends(numbers, load, held):
    design = make_design(**numbers)
    assert design.holds(load) == held
    assert design.error == numbers.get("error_m", math.inf)


def make_designs(designs, **options):
    given = {
        "sensor": "pad", "load": 0.7, "noise": 4e-3, "noise_assumed": False, "radius": 0.0, "ball": 4e-3, "layers": 2,
        "scale": "", "tolerance": None, "finite_error": 0.0123, "designs": tuple(designs), "best": 0, "flat": None,
    }  # fmt: skip
    return Designs(**given | options)


FOUR = [
    make_design(t, h, error_m=1e-5 * (1 + k), spread_m=4e-3 if t > 2e-3 else 3e-3, least_N=0.05)
    for k, (t, h) in enumerate([(2e-3, 30.0), (2e-3, 40.0), (3e-3, 30.0), (3e-3, 40.0)])
]


def test_designs_know_their_axes_and_lines():
    found = make_designs(FOUR, best=2, scale="a")
    assert (found.values("thickness"), found.values("hardness"), found.values("pitch")) == (
        [2e-3, 3e-3], [30.0, 40.0], [3e-3],
    )  # fmt: skip
    assert found.varied == ["thickness", "hardness"]
    assert [FOUR.index(each) for each in found.line("hardness")] == [2, 3]
    assert [FOUR.index(each) for each in found.line("thickness")] == [0, 2]
    assert (found.varies("error_m"), found.varies("spread_m"), found.varies("least_N")) == (
        ["thickness", "hardness"], ["thickness"], [],
    )  # fmt: skip
    assert found.middle is FOUR[2]
    least = make_designs([make_design(), *FOUR[::-1]], best=None)
    assert least.middle is FOUR[0]


def test_sentences_about_the_best_design():
    design = make_design(
        1.25e-3, 37.5, 2.5e-3, error_m=1.26e-5, spread_m=3e-3, least_N=0.052, most_N=8.0, touch_m=1e-3, depth_m=1e-4
    )
    (best, shape, reach, last) = make_designs([design], scale="d").explain()
    assert best.startswith("Best: 1.25 mm thick, 37.5 Shore D, pitch 2.5 mm: error of place 12.6 um, ")
    assert "width of the spread 3.00 mm, least force 52.0 mN, largest load 8.00 N" in best
    assert "touch radius" not in best
    assert "depth" not in best
    assert shape.startswith("For point touches of 0.7 N, and noise of 4 mN")
    assert "one count" not in shape
    assert reach == (
        "Load range: up to saturation. Touch radius, depth and load at 30 % of the thickness are those of a ball of "
        "4 mm radius. Loads at 30 % of the thickness come from a table at finite strain, good to 1.2 %."
    )
    assert last.endswith("softcover sweep.")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"radius": 1.5e-3}, "For round touches of 1.5 mm of 0.7 N"),
        ({"radius": None}, "For touches of a ball of 4 mm radius of 0.7 N"),
        ({"noise_assumed": True}, "For point touches of 0.7 N, and noise of 4 mN: one count"),
        ({"flat": (1.5e-3, 3.25e-3)}, "Within 10 % of the best error: 1.5 mm to 3.25 mm thick, on this grid."),
        ({"layers": 1}, "One layer: its hardness changes neither the spread nor the error"),
    ],
)
def test_a_sentence_for_each_option(options, sentence):
    plain, found = ([*make_designs(FOUR, **each).explain()] for each in ({}, options))
    assert [each.startswith(sentence) for each in found].count(True) == 1
    assert not any(each.startswith(sentence) for each in plain)


def test_sentences_that_do_not_apply_are_left_out():
    assert not any("Within" in each for each in make_designs(FOUR, flat=(2e-3, 2e-3)).explain())
    first, *_ = make_designs(FOUR, best=None, scale="a").explain()
    assert first.startswith("No design: 0.7 N lies outside the load range of each. The least error: 2 mm thick, 30 Sh")
    (swept,) = (e for e in make_designs([make_design(ends="x sweep")]).explain() if e.startswith("Load range"))
    assert "table" not in swept
    assert "up to x sweep." in swept


def test_a_hardness_that_does_not_change_the_error_says_so():
    same = [dataclasses.replace(each, numbers=NONE | {"error_m": each.thickness}) for each in FOUR]
    words = "(others have the same error)"
    assert words in make_designs(same).describe(same[0])
    assert words not in make_designs(FOUR).describe(FOUR[0])
    assert words not in make_designs(same[:1]).describe(same[0])
    assert make_designs([make_design()]).describe(make_design()).startswith("2 mm thick, pitch 3 mm: ")


def make_material(modulus, *, ratio=0.45, **options):
    return Material(
        name="x", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio, **options
    )


ONE = Cover(layers=(Layer(thickness=2e-3, material=make_material(1e6, spread=0.2, spread_above=0.5)),))
TWO = Cover(
    layers=(
        Layer(thickness=1.5e-3, material=make_material(4e6, ratio=0.4)),
        Layer(thickness=0.5e-3, material=make_material(1e6)),
    )
)
WTS = dataclasses.replace(
    validation.load("wts-0614-34"),
    array=TexelArray.grid(3, 5, 3.4e-3),
    electronics=Electronics(rate_hz=100.0, sensitivity=50.0, output_max=200),
)


def ask(cover, **options):
    given = {"load": 0.7, "thicknesses": (3e-3,), "pitches": (3.4e-3,), "noise": 5e-3}
    return find_designs(WTS, cover, **given | options)


def test_the_modulus_of_the_sensor_has_the_band_of_its_range():
    """Moduli of 0.8, 1 and 1.5 MPa; points feel neither, depth and touch radius do."""
    lines = []
    found = ask(ONE, progress=lines.append, ball=6e-3)
    (design,) = found.designs
    assert (design.hardness, design.modulus, found.layers, found.ball) == (None, 1e6, 1, 6e-3)
    assert (found.load, found.noise, found.noise_assumed, found.radius) == (0.7, 5e-3, False, 0.0)
    assert found.finite_error == estimate_errors()[2]
    pressed = [press_ball(Layer(thickness=3e-3, material=make_material(each)), 6e-3, 0.7) for each in (8e5, 1e6, 1.5e6)]
    assert design.numbers["touch_m"] == pytest.approx(pressed[1].contact)
    assert design.bands["touch_m"] == pytest.approx((pressed[2].contact, pressed[0].contact))
    assert design.bands["depth_m"] == pytest.approx((pressed[2].depth, pressed[0].depth))
    assert design.bands["error_m"] == (design.numbers["error_m"],) * 2
    assert [each for each in lines if each.startswith("design")] == ["design 1 of 1"]
    assert ask(ONE).ball == 5e-3


def test_designs_are_ordered_by_thickness_then_hardness_then_pitch():
    lines = []
    options = {"hardnesses": (30.0, 50.0), "scale": "a", "tolerance": 4.0, "progress": lines.append}
    found = ask(ONE, thicknesses=(2e-3, 4e-3), pitches=(3e-3, 5e-3), **options)
    axes = [(each.thickness, each.hardness, each.pitch) for each in found.designs]
    assert axes == [(t, h, p) for t in (2e-3, 4e-3) for h in (30.0, 50.0) for p in (3e-3, 5e-3)]
    assert [each for each in lines if each.startswith("design")] == [f"design {k} of 8" for k in range(1, 9)]
    assert (found.scale, found.tolerance, found.sensor) == ("a", 4.0, WTS.name)
    moduli = [modulus_from_hardness(each, "a").youngs_modulus for each in (26, 30, 34)]
    assert found.designs[0].modulus == pytest.approx(moduli[1])
    depths = [press_ball(Layer(thickness=2e-3, material=make_material(each)), 5e-3, 0.7).depth for each in moduli]
    assert found.designs[0].numbers["depth_m"] == pytest.approx(depths[1])
    assert found.designs[0].bands["depth_m"] == pytest.approx((depths[2], depths[0]))


def test_a_band_with_an_end_without_a_value_is_unknown():
    """A ball presses the softer end of the range deeper than 30 % of the thickness, and not the modulus itself."""
    most = press_ball(Layer(thickness=3e-3, material=make_material(1e6)), 5e-3, 1.0).most
    (design,) = ask(ONE, load=0.9 * most).designs
    assert design.numbers["depth_m"] < 0.9e-3
    assert (design.bands["depth_m"], design.bands["touch_m"]) == (None, None)
    assert design.bands["spread_m"] is not None


def test_a_ball_on_a_cover_outside_the_table_is_pressed_in_its_linear_solution():
    """The depth of a ball is told if its touches are asked for; the load at 30 % of the thickness is not known."""
    layer = Layer(thickness=3e-3, material=make_material(1e6))
    found = ask(Cover(layers=(layer,), base="sliding"), radius=None, ball=4e-3)
    (design,) = found.designs
    exact = indent(Cover(layers=(layer,), base="sliding"), Sphere(radius=4e-3), load=0.7)
    assert design.numbers["touch_m"] == pytest.approx(exact.contact_radius)
    assert design.numbers["depth_m"] == pytest.approx(exact.depth)
    assert design.ends == "saturation, or less: the load at 30 % of the thickness needs sweep"
    assert (found.layers, design.modulus, found.radius) == (1, 1e6, None)


@pytest.mark.parametrize(("cover", "layers"), [(dataclasses.replace(ONE, base="sliding"), 1), (TWO, 2)])
def test_the_table_of_balls_holds_for_one_bonded_layer_alone(cover, layers):
    found = ask(cover, radius=0.6e-3)
    (design,) = found.designs
    assert (design.numbers["touch_m"], design.numbers["depth_m"]) == (None, None)
    assert math.isfinite(design.error)
    # the upper layer of the two is the softer one
    assert (found.layers, design.modulus) == (layers, 1e6)
    assert "needs sweep" in design.ends


def find_width(cover):
    """Full width at half maximum of the base pressure under a point load."""
    peak = float(point_response(cover, [0.0])[0])
    return 2 * brentq(lambda r: float(point_response(cover, [r])[0]) / peak - 0.5, 0.0, 3 * cover.thickness)


def test_a_hardness_belongs_to_the_softest_layer_and_layers_keep_their_proportions():
    """Layers of 4.5 mm and 1.5 mm at 6 mm: the upper one has the moduli of 30 A and 60 A, and its ratio of 0.45."""
    found = ask(TWO, hardnesses=(30.0, 60.0), scale="a", tolerance=0.0, thicknesses=(6e-3,))
    for hardness, design in zip((30.0, 60.0), found.designs, strict=True):
        modulus = modulus_from_hardness(hardness, "a").youngs_modulus
        layers = (
            Layer(thickness=4.5e-3, material=make_material(4e6, ratio=0.4)),
            Layer(thickness=1.5e-3, material=make_material(modulus)),
        )
        assert design.modulus == modulus
        assert design.numbers["spread_m"] == pytest.approx(find_width(Cover(layers=layers)), rel=1e-3)
    assert found.varies("spread_m") == ["hardness"]


def test_an_array_is_scaled_to_its_smaller_pitch_with_its_texels():
    """A cover that is scaled with the array: lengths of place and width are, the least force is not."""
    array = TexelArray.grid(3, 5, (3e-3, 4.5e-3), texel_size=(2e-3, 4e-3))
    sensor = dataclasses.replace(WTS, array=array)
    options = {"load": 0.7, "noise": 5e-3}
    one, two = (
        find_designs(sensor, ONE, thicknesses=(2e-3 * by,), pitches=(3e-3 * by,), **options).designs[0]
        for by in (1.0, 1.4)
    )
    for name, power in (("error_m", 1), ("spread_m", 1), ("least_N", 0)):
        assert two.numbers[name] == pytest.approx(1.4**power * one.numbers[name], rel=1e-6), name
    assert one.pitch == 3e-3
