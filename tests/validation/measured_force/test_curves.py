"""Curves of forces: which indentations are solved, and what is multiplied with what."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Cover, Layer, Material
from tests.support.measured_force import make_measurement
from validation.measured_force.comparison import replace_dome, shift_poisson_ratio, solve_curves

DEPTH = np.array([0.2e-3, 0.2e-3, 0.5e-3, 0.9e-3])


def make(**options):
    gel = Material(name="gel", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.48, **options)
    cover = Cover(layers=(Layer(thickness=4e-3, material=gel),), size=(20e-3, 30e-3))
    return make_measurement(DEPTH, DEPTH, DEPTH < 0.3e-3, cover=cover, uncertainty={}, top_radius=14e-3)


def compute(cover, indenter, depth, friction):
    """A force that tells every input apart, and its error."""
    (layer,) = cover.layers
    stiffness = 1e4 * layer.material.poisson_ratio * math.sqrt(indenter.radius)
    return stiffness * depth**1.5 * (1.7 if friction else 1.0) * (1 if cover.size is None else 0.8 + 50 * depth)


def find_error(cover, friction):
    return 0.01 * (2 if friction else 1) + (0 if cover.size is None else 0.03)


@pytest.fixture(autouse=True)
def solved(monkeypatch):
    """The indentations that were solved: cover, indenter, friction."""
    found = []

    def press_path(cover, array, indenter, *, depths, friction):
        assert array.count == 1
        assert depths == [0.2e-3, 0.5e-3, 0.9e-3]
        found.append((cover, indenter, friction))
        return [
            SimpleNamespace(
                total_force=compute(cover, indenter, depth, friction),
                error_estimate={"total_force": find_error(cover, friction)},
            )
            for depth in depths
        ]

    monkeypatch.setattr("fem_reference.indentation.press.press_path", press_path)
    return found


def test_the_force_is_multiplied_by_the_effect_of_the_sides_and_varied_by_each_input():
    given, told = make(poisson_spread=0.05), []
    curves = solve_curves(given, told.append)
    assert told == [
        "free sides", "wide cover",
        "frictionless", "frictionless, low Poisson ratio", "frictionless, high Poisson ratio", "frictionless, flat top",
        "no slip", "no slip, low Poisson ratio", "no slip, high Poisson ratio", "no slip, flat top",
    ]  # fmt: skip
    wide, ball, flat = replace(given.cover, size=None), replace_dome(given), given.indenter
    assert ball.radius == pytest.approx(7e-3 * 14 / 21)
    low, high = (shift_poisson_ratio(wide, sign) for sign in (-1, 1))
    sides = np.array([compute(given.cover, flat, d, 0.0) / compute(wide, flat, d, 0.0) for d in DEPTH])
    for name, friction in (("frictionless", 0.0), ("no slip", math.inf)):
        force, at_low, at_high = (
            np.array([compute(cover, ball, d, friction) for d in DEPTH]) for cover in (wide, low, high)
        )
        on_flat = np.array([compute(wide, flat, d, friction) for d in DEPTH])
        curve = curves[name]
        np.testing.assert_allclose(curve.force, sides * force)
        expected = np.hypot(find_error(wide, friction), find_error(given.cover, 0.0))
        np.testing.assert_allclose(curve.error, [expected] * 4)
        varied = {
            "Poisson ratio": (sides * at_low, sides * at_high, 2 * math.sqrt(3)),
            "dome": (sides * force, sides * on_flat, math.sqrt(3)),
            "sides": (sides * force, force, math.sqrt(3)),
        }
        assert set(curve.varied) == set(varied)
        for key, (one, other, width) in varied.items():
            np.testing.assert_allclose(curve.varied[key].one, one)
            np.testing.assert_allclose(curve.varied[key].other, other)
            assert curve.varied[key].width == pytest.approx(width)


def test_a_wide_flat_cover_of_known_poisson_ratio_has_two_indentations(solved):
    plain = make()
    given = plain.model_copy(update={"cover": replace(plain.cover, size=None), "top_radius": None})
    curves = solve_curves(given)
    assert solved == [(given.cover, given.indenter, 0.0), (given.cover, given.indenter, math.inf)]
    for curve, friction in zip(curves.values(), (0.0, math.inf), strict=True):
        np.testing.assert_allclose(curve.force, [compute(given.cover, given.indenter, d, friction) for d in DEPTH])
        np.testing.assert_allclose(curve.error, find_error(given.cover, friction))
        assert curve.varied == {}
