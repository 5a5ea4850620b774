"""Covers."""

from __future__ import annotations

import pytest

from meshes import Cover, Layer, Material

RUBBER = Material(
    name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49, source="test"
)
SILICONE = Material(name="silicone", model="neo-hookean", parameters={"shear_modulus": 1e5}, poisson_ratio=0.5)


def test_the_thickness_is_that_of_all_layers():
    layers = tuple(Layer(thickness=thickness, material=RUBBER) for thickness in (1e-3, 0.5e-3, 2e-3))
    assert Cover(layers=layers).thickness == pytest.approx(3.5e-3)


def test_one_layer_with_a_stored_energy_allows_finite_strain():
    soft, stiff = Layer(thickness=1e-3, material=SILICONE), Layer(thickness=1e-3, material=RUBBER)
    assert Cover(layers=(stiff, stiff)).small_strain_only
    assert not Cover(layers=(stiff, soft)).small_strain_only


@pytest.mark.parametrize("thickness", [-1e-3, 0.0, float("nan")])
def test_a_layer_without_a_positive_thickness_is_refused(thickness):
    with pytest.raises(ValueError, match="thickness must be positive"):
        Layer(thickness=thickness, material=RUBBER)


def test_a_cover_without_layers_or_with_an_empty_size_is_refused():
    with pytest.raises(ValueError, match="at least one layer"):
        Cover(layers=())
    with pytest.raises(ValueError, match="size must be positive"):
        Cover(layers=(Layer(thickness=1e-3, material=RUBBER),), size=(1e-2, 0.0))
