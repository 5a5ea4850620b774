"""Named materials, covers and arrays."""

from __future__ import annotations

import itertools
import re

import pytest

from meshes.catalogue import ARRAYS, MATERIALS


def test_sdh2_distal_has_68_active_texels():
    array = ARRAYS["sdh2-distal"]
    assert array.active.sum() == 68
    assert not array.image(array.active)[:5, [0, 5]].any()
    assert array.image(array.active)[5:].all()


def test_named_arrays_are_regular_and_bear_their_names():
    for name, array in ARRAYS.items():
        assert array.name == name
        assert array.regular
        assert array.pitch == (3.4e-3, 3.4e-3)


def test_all_fits_of_one_silicone_agree_within_its_spread():
    """Fits of the same curves over different ranges have different moduli at small strain, but within the spread."""
    plain = [name for name, material in MATERIALS.items() if material.model == "neo-hookean"]
    assert len(plain) == 7
    for name in plain:
        for fit in ("yeoh", "ogden"):
            other = MATERIALS[f"{name}-{fit}"]
            assert other.model == fit
            assert other.shear_modulus == pytest.approx(MATERIALS[name].shear_modulus, rel=MATERIALS[name].spread)


def test_moduli_of_silicones_and_rubbers_increase_with_their_grades():
    for family in (("ecoflex-00-10", "ecoflex-00-30", "ecoflex-00-50"), ("dragon-skin-10", "dragon-skin-30")):
        for fit in ("", "-yeoh", "-ogden"):
            moduli = [MATERIALS[f"{name}{fit}"].youngs_modulus for name in family]
            assert moduli == sorted(moduli)
    rubbers = [MATERIALS[f"natural-rubber-{hardness}"] for hardness in (30, 40, 50, 60, 70)]
    for softer, harder in itertools.pairwise(rubbers):
        assert softer.youngs_modulus < harder.youngs_modulus
        assert softer.poisson_ratio > harder.poisson_ratio
    for rubber in rubbers:
        assert rubber.bulk_modulus == pytest.approx(1e9, rel=0.25)


@pytest.mark.parametrize("name", MATERIALS)
def test_ranges_of_moduli_hold_the_modulus_and_are_those_of_the_source(name):
    material = MATERIALS[name]
    low, high = material.modulus_range
    modulus, ratio, half = material.youngs_modulus, material.poisson_ratio, material.poisson_spread
    assert material.name == name
    assert len(material.source) > 5
    assert 0 < material.spread < 1
    assert 0 <= ratio - half <= ratio + half <= 0.5
    assert 0 < low < modulus < high or (low < modulus == high)
    if percent := re.search(r"\+-(\d+) %", material.source):
        assert (low, high) == pytest.approx([(1 + sign * int(percent[1]) / 100) * modulus for sign in (-1, 1)])
    if factor := re.search(r"a factor of (\d+)", material.source):
        assert (low, high) == pytest.approx((modulus / int(factor[1]), modulus * int(factor[1])))
    if ends := re.search(r"(\d[\d.]*)\.\.(\d[\d.]*) (MPa|kPa)", material.source):
        unit = {"MPa": 1e6, "kPa": 1e3}[ends[3]]
        assert (low, high) == pytest.approx((float(ends[1]) * unit, float(ends[2]) * unit))
    if ratios := re.search(r"nu (\d[\d.]*)\.\.(\d[\d.]*)", material.source):
        assert (ratio - half, ratio + half) == pytest.approx((float(ratios[1]), float(ratios[2])))
    if material.name.startswith("natural-rubber"):
        assert (low, high) == pytest.approx((0.85 * modulus, 1.15 * modulus))
        assert material.poisson_ratio == pytest.approx(0.5 - modulus / 6e9, abs=1e-4)
