from __future__ import annotations

import copy
import dataclasses
import itertools
import math
import pickle

import pytest

from meshes import Cover, Layer, Material
from meshes.catalogue import ASSUMED_COVER, MATERIALS


def make(**change):
    good = {"name": "m", "model": "linear-elastic", "parameters": {"youngs_modulus": 3e6}, "poisson_ratio": 0.5}
    return Material(**{**good, **change})


def ogden(mu, alpha):
    return make(model="ogden", parameters={"mu": mu, "alpha": alpha})


def test_small_strain_moduli():
    assert make().shear_modulus == pytest.approx(1e6)
    assert make().youngs_modulus == pytest.approx(3e6)
    assert math.isinf(make().bulk_modulus)
    assert make(poisson_ratio=0.2).bulk_modulus == pytest.approx(3e6 / 1.8)
    rivlin = make(model="mooney-rivlin", parameters={"c10": 1e5, "c01": 2e5})
    assert rivlin.shear_modulus == pytest.approx(6e5)
    assert make(model="yeoh", parameters={"c1": 1e5, "c2": 1.0, "c3": 0.0}).shear_modulus == pytest.approx(2e5)
    assert ogden(2e5, 2.5).shear_modulus == pytest.approx(2e5)


def test_ogden_takes_any_number_of_terms():
    several = ogden([2e5, 1e5, -1e4], [1.3, 5.0, -2.0])
    assert several.shear_modulus == pytest.approx(2.9e5)
    assert several.terms("mu") == (2e5, 1e5, -1e4)
    assert several.terms("alpha") == (1.3, 5.0, -2.0)
    assert ogden([2e5], [2.5]) == ogden(2e5, 2.5)
    with pytest.raises(TypeError, match="has terms"):
        several.number("mu")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "rubber"}, "known models: linear-elastic"),
        ({"parameters": {"shear_modulus": 1.0}}, "takes"),
        ({"poisson_ratio": 0.51}, r"0\.\.0\.5"),
        ({"poisson_ratio": -0.1}, r"0\.\.0\.5"),
        ({"poisson_ratio": math.nan}, r"0\.\.0\.5"),
        ({"parameters": {"youngs_modulus": 0.0}}, "positive"),
        ({"parameters": {"youngs_modulus": math.nan}}, "must be a number"),
        ({"parameters": {"youngs_modulus": [1e6, 2e6]}}, "must be a number"),
        ({"parameters": {"youngs_modulus": "1 MPa"}}, "must be a number"),
        ({"model": "ogden", "parameters": {"mu": [1e5, 1e5], "alpha": 2.0}}, "2 of mu, 1 of alpha"),
        ({"model": "ogden", "parameters": {"mu": [], "alpha": []}}, "0 of mu, 0 of alpha"),
        ({"model": "ogden", "parameters": {"mu": 1e5, "alpha": 0.0}}, "no alpha of 0"),
        ({"model": "ogden", "parameters": {"mu": [1e5, -2e5], "alpha": [2.0, 3.0]}}, "positive"),
    ],
)
def test_bad_materials_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        make(**change)


def test_materials_are_frozen_hashable_and_travel():
    parameters = {"mu": [2e5, 1e5], "alpha": [1.3, 5.0]}
    material = make(model="ogden", parameters=parameters)
    parameters["mu"][0] = parameters["mu"] = 0.0
    assert material.terms("mu") == (2e5, 1e5)
    with pytest.raises(TypeError):
        material.parameters["mu"] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        material.name = "other"
    same = make(model="ogden", parameters={"mu": (2e5, 1e5), "alpha": (1.3, 5.0)})
    assert same == material
    assert hash(same) == hash(material)
    assert {material, same, ogden(2e5, 2.0)} == {material, ogden(2e5, 2.0)}
    for other in (pickle.loads(pickle.dumps(material)), copy.deepcopy(material), dataclasses.replace(material)):  # noqa: S301 -- our own
        assert other == material


def test_covers_need_positive_layers():
    with pytest.raises(ValueError, match="thickness must be positive"):
        Layer(thickness=-1e-3, material=make())
    with pytest.raises(ValueError, match="at least one layer"):
        Cover(layers=())


def test_every_named_material_states_its_source_and_spread():
    for name, material in MATERIALS.items():
        assert material.name == name
        assert len(material.source) > 5
        assert 0 < material.spread < 1
        assert material.poisson_ratio - material.poisson_spread >= 0
        assert material.poisson_ratio + material.poisson_spread <= 0.5
    assert ASSUMED_COVER.assumed


def test_fits_of_one_silicone_are_the_same_rubber():
    """Three fits of the same curves over other ranges: their small-strain moduli differ, but within the spread."""
    plain = [name for name, material in MATERIALS.items() if material.model == "neo-hookean"]
    assert len(plain) == 7
    for name in plain:
        for fit in ("yeoh", "ogden"):
            other = MATERIALS[f"{name}-{fit}"]
            assert other.model == fit
            assert other.shear_modulus == pytest.approx(MATERIALS[name].shear_modulus, rel=MATERIALS[name].spread)


def test_silicones_and_rubbers_are_ordered_as_their_grades():
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
