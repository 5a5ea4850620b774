"""Materials."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes import Material, material
from meshes.material import Model, Parameter


def make(**change):
    good = {"name": "m", "model": "linear-elastic", "parameters": {"youngs_modulus": 3e6}, "poisson_ratio": 0.5}
    return Material(**{**good, **change})


def ogden(mu, alpha):
    return make(model="ogden", parameters={"mu": mu, "alpha": alpha})


def test_small_strain_moduli():
    assert make().shear_modulus == pytest.approx(1e6)
    assert math.isinf(make().bulk_modulus)
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


def test_materials_cannot_be_changed_and_can_be_hashed_copied_and_pickled():
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


POSITIVE = st.floats(1e2, 1e8)


@given(youngs_modulus=POSITIVE, poisson_ratio=st.floats(0, 0.4999))
def test_moduli_of_a_linear_material_satisfy_the_relations_of_isotropic_elasticity(youngs_modulus, poisson_ratio):
    material = make(parameters={"youngs_modulus": youngs_modulus}, poisson_ratio=poisson_ratio)
    bulk, shear = material.bulk_modulus, material.shear_modulus
    assert material.youngs_modulus == pytest.approx(youngs_modulus)
    assert 9 * bulk * shear / (3 * bulk + shear) == pytest.approx(youngs_modulus, rel=1e-9)
    assert (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)) == pytest.approx(poisson_ratio, abs=1e-9)


def test_a_model_may_determine_the_poisson_ratio(monkeypatch):
    """A foam whose compressibility beta stands for it: nu = beta / (1 + 2 beta)."""
    foam = Model(
        parameters={"shear_modulus": Parameter(meaning="shear modulus"), "beta": Parameter(unit="-", meaning="beta")},
        shear_modulus=lambda each: each.number("shear_modulus"),
        poisson_ratio=lambda each: each.number("beta") / (1 + 2 * each.number("beta")),
        at_poisson_ratio=lambda each, ratio: {**each.parameters, "beta": ratio / (1 - 2 * ratio)},
    )
    monkeypatch.setattr(material, "MODELS", {**material.MODELS, "foam": foam})
    made = Material(name="foam", model="foam", parameters={"shear_modulus": 1e5, "beta": 1.0})
    assert made.poisson_ratio == pytest.approx(1 / 3)
    assert made.youngs_modulus == pytest.approx(2e5 * 4 / 3)
    moved = made.with_poisson_ratio(0.4)
    assert (moved.model, moved.poisson_ratio, moved.shear_modulus) == ("foam", pytest.approx(0.4), 1e5)
    with pytest.raises(ValueError, match=r"determine poisson_ratio, 0.333333; leave it out"):
        dataclasses.replace(made, poisson_ratio=0.4)
    with pytest.raises(ValueError, match="poisson_ratio must lie in"):
        Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 1e5})
