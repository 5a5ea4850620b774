from __future__ import annotations

import numpy as np
import pytest

from meshes.catalogue import MATERIALS
from meshes.hardness import RANGE, modulus_by_gent, modulus_by_qi, modulus_from_hardness


def test_relations_at_hardnesses_worked_by_hand():
    assert modulus_by_gent(30) == pytest.approx(1.1424e6, rel=1e-4)
    assert modulus_by_gent(70) == pytest.approx(5.5206e6, rel=1e-4)
    assert modulus_by_qi(30) == pytest.approx(1.1606e6, rel=1e-4)
    assert modulus_by_qi(70) == pytest.approx(10.1088e6, rel=1e-4)


def test_band_holds_both_relations_everywhere():
    for shore_a in np.linspace(*RANGE, 121):
        found = modulus_from_hardness(shore_a)
        for value in found.by_relation.values():
            assert found.low < value < found.high
        assert found.spread == 0.5


def test_a_narrower_band_would_not_hold_them():
    """The check above can fail: +-25 % is too little near 70 Shore A, and so is +-50 % about Gent's value alone."""
    found = modulus_from_hardness(70)
    assert max(found.by_relation.values()) > 1.25 * found.youngs_modulus
    assert max(found.by_relation.values()) > 1.5 * found.by_relation["gent-1958"]


@pytest.mark.parametrize("hardness", [30, 40, 50, 60, 70])
def test_band_holds_the_measured_moduli_of_natural_rubber(hardness):
    found = modulus_from_hardness(hardness)
    assert found.low < MATERIALS[f"natural-rubber-{hardness}"].youngs_modulus < found.high


def test_castable_silicones_are_softer_than_their_hardness_says():
    for name, hardness in (("dragon-skin-20", 20), ("dragon-skin-30", 30)):
        assert 1.4 < modulus_from_hardness(hardness).youngs_modulus / MATERIALS[name].youngs_modulus < 2.5


def test_modulus_grows_with_hardness():
    moduli = [modulus_from_hardness(shore_a).youngs_modulus for shore_a in np.linspace(*RANGE, 61)]
    assert (np.diff(moduli) > 0).all()


@pytest.mark.parametrize("shore_a", [-1.0, 0.0, 19.9, 80.1, 100.0, float("nan"), float("inf")])
def test_outside_the_range_is_refused(shore_a):
    with pytest.raises(ValueError, match=r"20\.\.80 Shore A"):
        modulus_from_hardness(shore_a)
