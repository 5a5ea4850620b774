from __future__ import annotations

import pytest

from meshes import Cover, Layer, Material
from meshes.catalogue import ASSUMED_COVER, MATERIALS


def make(**change):
    good = {"name": "m", "model": "linear-elastic", "parameters": {"youngs_modulus": 3e6}, "poisson_ratio": 0.5}
    return Material(**{**good, **change})


def test_small_strain_moduli():
    assert make().shear_modulus == pytest.approx(1e6)
    assert make().youngs_modulus == pytest.approx(3e6)
    rivlin = make(model="mooney-rivlin", parameters={"c10": 1e5, "c01": 2e5})
    assert rivlin.shear_modulus == pytest.approx(6e5)
    assert make(model="yeoh", parameters={"c1": 1e5, "c2": 1.0, "c3": 0.0}).shear_modulus == pytest.approx(2e5)
    assert make(model="ogden", parameters={"mu": 2e5, "alpha": 2.5}).shear_modulus == pytest.approx(2e5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "rubber"}, "known models: linear-elastic"),
        ({"parameters": {"shear_modulus": 1.0}}, "takes"),
        ({"poisson_ratio": 0.51}, "0..0.5"),
        ({"poisson_ratio": -0.1}, "0..0.5"),
        ({"parameters": {"youngs_modulus": 0.0}}, "positive"),
    ],
)
def test_bad_materials_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        make(**change)


def test_covers_need_positive_layers():
    with pytest.raises(ValueError, match="thickness must be positive"):
        Layer(thickness=-1e-3, material=make())
    with pytest.raises(ValueError, match="at least one layer"):
        Cover(layers=())


def test_every_named_material_states_its_source():
    for name, material in MATERIALS.items():
        assert material.name == name
        assert len(material.source) > 5
        assert 0 < material.spread < 1
    assert ASSUMED_COVER.assumed
