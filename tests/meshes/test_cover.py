"""Covers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from meshes import Box, Cover, Layer, LetterH, Material, Nut, SolidCover, Sphere, TexelArray

RUBBER = Material(
    name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49, source="test"
)
LAYER = Layer(thickness=2e-3, material=RUBBER)
SILICONE = Material(name="silicone", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.5)


def test_the_thickness_is_that_of_all_layers():
    layers = tuple(Layer(thickness=thickness, material=RUBBER) for thickness in (1e-3, 0.5e-3, 2e-3))
    assert Cover(layers=layers).thickness == pytest.approx(3.5e-3)


def test_a_solid_of_given_thickness_keeps_it_and_its_meshes():
    """The meshes depend on the shape alone, so another material takes the same ones."""
    made = []
    solid = SolidCover(
        layers=(LAYER,), source="a pad", make=lambda thickness, _: made.append(thickness) or (), given=(2e-3,)
    )
    soft = dataclasses.replace(solid, layers=(Layer(thickness=2e-3, material=SILICONE),))
    assert solid.meshes() == soft.meshes() == ()
    assert made == [(2e-3,)]
    assert not soft.small_strain_only
    with pytest.raises(ValueError, match="the thickness follows from a pad; leave it out"):
        dataclasses.replace(solid, layers=(Layer(thickness=1e-3, material=RUBBER),))
    with pytest.raises(ValueError, match="a pad has 1 layer, not 2: several layers need a mesh of hexahedra swept"):
        dataclasses.replace(solid, layers=(LAYER, LAYER))


def test_one_layer_with_a_stored_energy_allows_finite_strain():
    soft, stiff = Layer(thickness=1e-3, material=SILICONE), Layer(thickness=1e-3, material=RUBBER)
    assert Cover(layers=(stiff, stiff)).small_strain_only
    assert not Cover(layers=(stiff, soft)).small_strain_only


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Cover(layers=(LAYER,), base="slidding"), "unknown base 'slidding'; accepted: bonded, sliding"),
        (lambda: Cover(layers=(LAYER,), size=(1e-2, float("nan"))), "cover size must be positive edge lengths"),
        (lambda: Cover(layers=(LAYER,), size=(1e-2, 1e-2, 1e-2)), "cover size must be positive edge lengths"),
        (lambda: Cover(layers=(LAYER,), size=(1e-2, 0.0)), "size must be positive"),
        (lambda: Cover(layers=()), "at least one layer"),
        (lambda: Cover(layers=LAYER), "layers must be a tuple of Layer"),
        (lambda: Cover(layers=(2e-3,)), "layers must be a tuple of Layer"),
        (lambda: Layer(thickness=2e-3, material="tpu"), r"material must be a Material, for example MATERIALS\['tpu'\]"),
        (lambda: Layer(thickness=0.0, material=RUBBER), "thickness must be positive, not 0"),
        (lambda: Layer(thickness=math.nan, material=RUBBER), "thickness must be positive, not nan"),
        (lambda: Layer(thickness=math.inf, material=RUBBER), "thickness must be positive, not inf"),
        (lambda: Layer(thickness="2 mm", material=RUBBER), "thickness must be positive, not 2 mm"),
        (lambda: Box(size=(1e-2, 1e-2)), "Box needs three edge lengths"),
        (lambda: Box(size=()), "Box needs three edge lengths"),
        (lambda: Sphere(radius=None), "Sphere needs positive lengths"),
        (lambda: Sphere(radius=-5e-3), "Sphere needs positive lengths, not -5 mm"),
        (lambda: Box(size=(4e-3, 2e-3, -1e-3)), "not 4 mm, 2 mm, -1 mm"),
        (lambda: LetterH(size=(8e-3, 6e-3), bar=5e-3), "not 5 mm in 8 mm, 6 mm"),
        (lambda: Nut(across=8e-3, bore=9e-3), "not 9 mm in 8 mm"),
        (lambda: Sphere(radius=True), "Sphere needs positive lengths"),
        (lambda: Sphere(radius=np.ones((1, 1))), "Sphere needs positive lengths"),
        (lambda: TexelArray.grid(rows=2, columns=2, pitch=(math.nan, 1e-3)), "must be positive|must be finite"),
    ],
)
def test_a_wrong_value_of_a_public_name_is_refused_where_it_is_given(make, message):
    """A misspelt base would be computed as bonded, a size that is no number as an infinite cover."""
    with pytest.raises((ValueError, TypeError), match=message):
        make()
