"""Units of computation."""

from __future__ import annotations

import pytest

from fem_reference.elements.scaling import Units
from meshes import Cover, Layer, Material


def test_a_cover_is_one_thick_and_loads_are_in_its_units():
    soft, stiff = (
        Material(name="m", model="neo-hookean", parameters={"shear_modulus": mu}, poisson_ratio=0.5)
        for mu in (1e5, 3e6)
    )
    cover = Cover(layers=(Layer(thickness=3e-3, material=soft), Layer(thickness=1e-3, material=stiff)))
    units = Units.of(cover)
    scaled = units.scale_cover(cover)
    assert [layer.thickness for layer in scaled.layers] == pytest.approx([0.75, 0.25])
    assert [layer.material for layer in scaled.layers] == [soft, stiff]
    assert units.scale_target(0.4e-3, "depth") == pytest.approx(0.1)
    assert units.scale_target(6.0, "load") == pytest.approx(6.0 / (3e6 * 4e-3**2))
