"""Young's modulus from hardness."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from meshes.catalogue import MATERIALS
from meshes.hardness import SCALES, modulus_by_ball, modulus_by_gent, modulus_by_qi, modulus_from_hardness

HARDNESSES = st.floats(*SCALES["a"].range)


def test_relations_give_values_worked_by_hand():
    assert modulus_by_gent(30) == pytest.approx(1.1424e6, rel=1e-4)
    assert modulus_by_gent(70) == pytest.approx(5.5206e6, rel=1e-4)
    assert modulus_by_qi(30) == pytest.approx(1.1606e6, rel=1e-4)
    assert modulus_by_qi(70) == pytest.approx(10.1088e6, rel=1e-4)


@given(shore_a=HARDNESSES)
def test_the_band_contains_both_relations_and_the_estimate_is_their_geometric_mean(shore_a):
    found = modulus_from_hardness(shore_a)
    gent, qi = found.by_relation.values()
    assert found.low < min(gent, qi)
    assert max(gent, qi) < found.high
    assert found.youngs_modulus**2 == pytest.approx(gent * qi)
    assert found.spread == 0.5


@pytest.mark.parametrize("hardness", [30, 40, 50, 60, 70])
def test_the_band_contains_the_measured_moduli_of_natural_rubber(hardness):
    found = modulus_from_hardness(hardness)
    assert found.low < MATERIALS[f"natural-rubber-{hardness}"].youngs_modulus < found.high


@given(hardnesses=st.tuples(HARDNESSES, HARDNESSES))
def test_every_relation_increases_with_hardness(hardnesses):
    soft, hard = sorted(hardnesses)
    assume(hard - soft > 1e-6)
    soft, hard = modulus_from_hardness(soft), modulus_from_hardness(hard)
    assert soft.youngs_modulus < hard.youngs_modulus
    for relation, modulus in soft.by_relation.items():
        assert modulus < hard.by_relation[relation]


def test_castable_silicones_are_softer_than_shore_00_says_and_lie_in_its_band():
    for name, hardness in (("ecoflex-00-30", 30), ("ecoflex-00-50", 50)):
        found, catalogue = modulus_from_hardness(hardness, "00"), MATERIALS[name].youngs_modulus
        assert 2.4 < found.youngs_modulus / catalogue < 4.2
        assert found.low < catalogue < found.high


def test_the_ball_of_the_durometer_is_hertzian_at_small_depth_and_bears_its_force_at_a_large_one():
    """Sneddon: depth a int f'/sqrt(a^2 - r^2) dr, force 2 E/(1 - nu^2) int r^2 f'/sqrt(a^2 - r^2) dr, r = a sin t."""
    radius, depth = 1.19e-3, 2.5e-3
    hertz = 3 * (0.203 + 0.00908 * 99.9) / (4 * np.sqrt(radius * (1e-3 * depth) ** 3)) * 0.75
    assert modulus_by_ball(99.9) == pytest.approx(hertz, rel=2e-3)

    def integrate(a, power):
        """Integral of r^power f' over t, with f' = r / sqrt(radius^2 - r^2)."""

        def evaluate(t):
            r = a * np.sin(t)
            return r ** (power + 1) / np.sqrt(radius**2 - r**2)

        return quad(evaluate, 0, np.pi / 2)[0]

    edge = brentq(lambda a: a * integrate(a, 0) - 0.7 * depth, 1e-2 * radius, 0.99999 * radius)
    assert 2 * modulus_by_ball(30) / 0.75 * integrate(edge, 2) == pytest.approx(0.203 + 0.00908 * 30, rel=1e-6)


@pytest.mark.parametrize(
    ("scale", "hardness", "message"),
    [
        *(("a", each, r"20\.\.80 Shore A") for each in (-1.0, 19.9, 80.1, 100.0, float("nan"), float("inf"))),
        *(("00", each, r"20\.\.90 Shore 00") for each in (19.9, 90.1, float("nan"))),
        *((scale, 30, "the scale must be one of a, 00") for scale in ("d", "")),
    ],
)
def test_other_scales_and_readings_are_refused(scale, hardness, message):
    with pytest.raises(ValueError, match=message):
        modulus_from_hardness(hardness, scale)
