"""Presses in time on relaxing covers whose elastic presses are a closed form: a ball on a half-space after Hertz."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.errors import PiercedError, UnsupportedError
from fem_reference.indentation import relaxing
from fem_reference.indentation.relaxing import ElasticCurve, follow_press
from meshes import Cover, Layer, Material, Pose, Sphere, TexelArray
from meshes.relaxation import Relaxation

BALL, ARRAY = Sphere(radius=4e-3), TexelArray.grid(1, 2, 3e-3)
CREEP = Relaxation(g=(0.25,), tau=(3.0,))


def make_cover(relaxation, ratio=0.4, model="linear-elastic"):
    parameters = {"youngs_modulus": 8e5} if model == "linear-elastic" else {"shear_modulus": 3e5}
    material = Material(name="x", model=model, parameters=parameters, poisson_ratio=ratio, relaxation=relaxation)
    return Cover(layers=(Layer(thickness=3e-3, material=material),))


def press_hertz(stiffness, depth):
    return 4 / 3 * stiffness * np.sqrt(4e-3) * depth**1.5


@pytest.fixture
def hertz(monkeypatch):
    """Press as Hertz, with the texels bearing 0.5 and 0.3 of the force; the requests are kept."""
    asked = []

    def press_path(cover, array, indenter, pose, *, loads=None, depths=None, progress=None):
        material = cover.layers[0].material
        assert material.relaxation is None
        stiffness = material.youngs_modulus / (1 - material.poisson_ratio**2)
        asked.append((material, loads, depths))
        if loads and loads[0] > 5.0:
            error = PiercedError("too deep", "load")
            error.largest = 5.0
            raise error
        depths = depths or [(3 * load / (4 * stiffness * np.sqrt(4e-3))) ** (2 / 3) for load in loads]
        forces = [press_hertz(stiffness, depth) for depth in depths]
        return [
            SimpleNamespace(
                total_force=force, depth=depth, texel_forces=np.array([0.5, 0.3]) * force, outside=0.2 * force,
                error_estimate={"total_force": 0.01, "depth": 0.0}, warnings=(f"{len(depths)} points",),
            )
            for force, depth in zip(forces, depths, strict=True)
        ]  # fmt: skip

    monkeypatch.setattr(relaxing, "press_path", press_path)
    return asked


def test_a_load_presses_deeper_as_the_compliance_grows(hertz):
    """One term: J(t) = 1 + g / (1 - g) (1 - exp(-(1 - g) t / tau)), the load times it is Hertz's force at the depth."""
    found = follow_press(make_cover(CREEP), ARRAY, BALL, Pose(), times=[0.0, 2.0, 12.0], loads=[0.6, 0.6, 0.6])
    creep = 1 + (1 - np.exp(-0.75 * found.times / 3.0)) / 3
    stiffness = 8e5 / (1 - 0.16)
    assert press_hertz(stiffness, found.depths) == pytest.approx(0.6 * creep, rel=2e-4)
    assert found.texel_forces == pytest.approx(np.tile([0.3, 0.18], (len(found.times), 1)), rel=1e-6)
    assert found.outside == pytest.approx(0.12, rel=1e-6)
    assert found.fast == pytest.approx(np.tile([0.3, 0.18, 0.12], (len(found.times), 1)), rel=1e-6)
    assert found.error_estimate["presses"] == pytest.approx(0.01)
    assert found.error_estimate["moduli"] == 0
    assert found.warnings[0] == "10 points"
    (_, loads, _), (_, _, depths) = hertz
    assert loads[0] == pytest.approx(0.6 * creep[-1], rel=1e-3)
    assert depths == pytest.approx([depths[-1] * (k / 10) ** 2 for k in range(1, 11)])


def test_a_depth_is_pressed_as_given(hertz):
    found = follow_press(make_cover(CREEP), ARRAY, BALL, Pose(), times=[0.0, 9.0], depths=[2e-4, 2e-4])
    wanted = press_hertz(8e5 / 0.84, 2e-4) * (0.75 + 0.25 * np.exp(-found.times / 3))
    assert found.forces == pytest.approx(wanted, rel=1e-4)
    assert [depths[-1] for _, _, depths in hertz] == [2e-4]


def test_a_constant_bulk_modulus_is_pressed_at_five_moduli_that_keep_it(hertz):
    """On a half-space the force follows E / (1 - nu^2) = 4 G (3 K + G) / (3 K + 4 G) of the relaxed moduli."""
    relaxation = Relaxation(g=(0.25,), tau=(0.5,), bulk="constant")
    found = follow_press(make_cover(relaxation), ARRAY, BALL, Pose(), times=[0.0, 20.0], depths=[2e-4, 2e-4])
    bulk, shear = 8e5 / (3 * 0.2), 8e5 / 2.8
    assert len(hertz) == 5
    assert [each.bulk_modulus for each, *_ in hertz] == pytest.approx([bulk] * 5)
    shares = [each.shear_modulus / shear for each, *_ in hertz]
    assert shares == pytest.approx([0.875 + 0.125 * np.cos(np.pi * k / 4) for k in range(5)])

    def stiffness(g):
        return 4 * g * (3 * bulk + g) / (3 * bulk + 4 * g)

    assert found.forces[0] == pytest.approx(press_hertz(stiffness(shear), 2e-4), rel=1e-3)
    assert found.forces[-1] == pytest.approx(press_hertz(stiffness(0.75 * shear), 2e-4), rel=1e-3)
    assert found.error_estimate["moduli"] < 1e-3


def test_an_incompressible_cover_needs_no_further_moduli(hertz):
    relaxation = Relaxation(g=(0.25,), tau=(0.5,), bulk="constant")
    follow_press(make_cover(relaxation, ratio=0.5), ARRAY, BALL, Pose(), times=[0.0, 20.0], depths=[2e-4, 2e-4])
    assert len(hertz) == 1


def test_a_load_that_would_pierce_names_a_load_that_the_cover_bears(hertz):
    """4.5 N grow to 6 N at the relaxed modulus; 5 N are borne, and 3.75 N grow to them."""
    with pytest.raises(PiercedError, match=r"4.5 N within 1000 s would pierce .* use at most 3.75 N") as caught:
        follow_press(make_cover(CREEP), ARRAY, BALL, Pose(), times=[0.0, 1000.0], loads=[4.5, 4.5])
    assert caught.value.control == "load"


@pytest.mark.parametrize(
    ("cover", "fault"),
    [
        (make_cover(None), "every layer needs a relaxation, the same in all"),
        (make_cover(None, model="neo-hookean"), "histories need linear-elastic layers"),
        (Cover(layers=(*make_cover(CREEP).layers, *make_cover(None).layers)), "every layer needs a relaxation"),
        (make_cover(Relaxation(exponent=0.9, tau=(1e-6,), bulk="constant")), "falls to 0.0004 % of its start"),
    ],
)
def test_covers_that_are_not_followed_are_refused_before_a_press(hertz, cover, fault):
    with pytest.raises(UnsupportedError, match=fault):
        follow_press(cover, ARRAY, BALL, Pose(), times=[0.0, 1.0], loads=[0.1, 0.1])
    assert not hertz


@pytest.mark.parametrize("power", [1.0, 1.5, 2.3])
def test_an_elastic_curve_is_a_power_inside_and_outside_its_points(power):
    depths = np.array([1e-5, 3e-5, 1e-4, 2e-4])
    force = 3e3 * depths**power
    curve = ElasticCurve(depths=depths, values=np.outer(force, [1.0, 0.7, 0.3]))
    asked = np.array([0.0, 1e-6, 2e-5, 2e-4, 9e-4])
    assert curve.force(asked) == pytest.approx(3e3 * asked**power, rel=1e-9)
    assert curve.depth(3e3 * asked**power) == pytest.approx(asked, rel=1e-9)
    assert curve.forces(asked)[:, 1] == pytest.approx(0.7 * 3e3 * asked**power, rel=1e-9)
    assert curve.error < 1e-9


def test_the_error_of_a_curve_is_an_eighth_of_that_with_half_of_the_points():
    """Points 0, 2 and 4 of five of a parabola in the logarithms pass it exactly; a kink does not."""
    x = np.linspace(0, 2, 5)
    straight, bent = x, x + np.array([0.0, 0.08, 0.0, 0.0, 0.0])
    errors = [
        ElasticCurve(depths=np.exp(x), values=np.outer(np.exp(y), [1.0, 1.0, 0.0])).error for y in (straight, bent)
    ]
    assert errors == pytest.approx([0.0, 0.01], abs=1e-12)
    few = ElasticCurve(depths=np.exp(x[:3]), values=np.outer(np.exp(bent[:3]), [1.0, 1.0, 0.0]))
    assert few.error == 0.0
