"""Young's modulus from hardness."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from meshes.catalogue import MATERIALS
from meshes.hardness import RANGE, modulus_by_gent, modulus_by_qi, modulus_from_hardness

HARDNESSES = st.floats(*RANGE)


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


def test_a_narrower_band_would_not_contain_them():
    """The test above can fail: near 70 Shore A, +-25 % is too little, and so is +-50 % about Gent's value alone."""
    found = modulus_from_hardness(70)
    assert max(found.by_relation.values()) > 1.25 * found.youngs_modulus
    assert max(found.by_relation.values()) > 1.5 * found.by_relation["gent-1958"]


@pytest.mark.parametrize("hardness", [30, 40, 50, 60, 70])
def test_the_band_contains_the_measured_moduli_of_natural_rubber(hardness):
    found = modulus_from_hardness(hardness)
    assert found.low < MATERIALS[f"natural-rubber-{hardness}"].youngs_modulus < found.high


def test_castable_silicones_are_softer_than_their_hardness_says():
    for name, hardness in (("dragon-skin-20", 20), ("dragon-skin-30", 30)):
        assert 1.4 < modulus_from_hardness(hardness).youngs_modulus / MATERIALS[name].youngs_modulus < 2.5


@given(hardnesses=st.tuples(HARDNESSES, HARDNESSES))
def test_every_relation_increases_with_hardness(hardnesses):
    soft, hard = sorted(hardnesses)
    assume(hard - soft > 1e-6)
    soft, hard = modulus_from_hardness(soft), modulus_from_hardness(hard)
    assert soft.youngs_modulus < hard.youngs_modulus
    for relation, modulus in soft.by_relation.items():
        assert modulus < hard.by_relation[relation]


@pytest.mark.parametrize("shore_a", [-1.0, 0.0, 19.9, 80.1, 100.0, float("nan"), float("inf")])
def test_a_hardness_outside_the_range_is_refused(shore_a):
    with pytest.raises(ValueError, match=r"20\.\.80 Shore A"):
        modulus_from_hardness(shore_a)
