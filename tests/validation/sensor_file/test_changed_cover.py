"""Changes of a cover by `--material`, `--thickness` and `--layer`."""

import pytest

from meshes import Cover, Layer
from meshes.catalogue import MATERIALS
from validation.errors import InputError
from validation.sensor_file import load
from validation.sensor_file.changed_cover import change_cover

TWO = Cover(
    layers=(
        Layer(thickness=1.5e-3, material=MATERIALS["ecoflex-00-30"]),
        Layer(thickness=0.1e-3, material=MATERIALS["pet"]),
    ),
    assumed=True,
)


def change(*layers, cover=TWO):
    return change_cover(cover, layers=layers)


def test_only_the_named_layer_changes_and_only_in_what_is_given():
    changed = change("2:thickness=50um,youngs_modulus=3GPa")
    assert changed.layers[0] == TWO.layers[0]
    assert changed.layers[1].thickness == pytest.approx(50e-6)
    material = changed.layers[1].material
    assert (material.youngs_modulus, material.poisson_ratio) == (3e9, 0.38)
    assert material.modulus_range == (3e9, 3e9)
    assert material.name == "pet, changed"
    assert material.source.startswith("youngs_modulus given by the user; else typical value")


def test_a_thickness_alone_keeps_the_material_itself():
    assert change("1:thickness=2mm").layers[0].material is TWO.layers[0].material


@pytest.mark.parametrize("name", ["dragon-skin-30", "dragon-skin-30-yeoh", "dragon-skin-30-ogden"])
def test_youngs_modulus_scales_the_curve_of_a_rubber(name):
    before = MATERIALS[name]
    (layer,) = change("1:youngs_modulus=1.2MPa", cover=Cover(layers=(Layer(thickness=1e-3, material=before),))).layers
    after, factor = layer.material, 1.2e6 / before.youngs_modulus
    assert after.youngs_modulus == pytest.approx(1.2e6)
    for parameter in before.parameters:
        scale = 1.0 if parameter == "alpha" else factor
        assert after.terms(parameter) == pytest.approx([scale * value for value in before.terms(parameter)])


def test_several_changes_of_several_layers():
    changed = change("1:material=Latex", "2:material=polyimide", "1:thickness=1mm,poisson_ratio=0.49")
    assert [layer.material.youngs_modulus for layer in changed.layers] == pytest.approx([1.2e6, 2.5e9])
    assert changed.layers[0].material.poisson_ratio == 0.49
    assert changed.layers[0].material.modulus_range == MATERIALS["latex"].modulus_range
    assert [layer.thickness for layer in changed.layers] == pytest.approx([1e-3, 0.1e-3])


def test_a_new_model_or_hardness_replaces_the_parameters():
    first = change("1:model=linear-elastic,youngs_modulus=200kPa").layers[0].material
    assert (first.model, first.youngs_modulus, first.poisson_ratio) == ("linear-elastic", 200e3, 0.5)
    second = change("1:model=ogden,mu=150kPa/40kPa,alpha=1.5/4").layers[0].material
    assert second.parameters == {"mu": (150e3, 40e3), "alpha": (1.5, 4.0)}
    third = change("1:hardness=30 shore-a").layers[0].material
    assert third.youngs_modulus == pytest.approx(1.1515e6, rel=1e-3)
    assert third.spread == 0.5


def test_a_cover_stays_assumed_until_every_layer_is_known():
    known = "thickness=1mm,material=latex"
    assert change(f"1:{known}").assumed
    assert change("1:thickness=1mm", "2:thickness=1mm").assumed
    assert not change(f"1:{known}", "2:thickness=1mm,youngs_modulus=1MPa,poisson_ratio=0.4").assumed


def test_a_layer_of_a_replaced_cover_can_be_changed():
    cover = load("wts-0614-34", material="sylgard 184", thickness="2mm", layers=["1:youngs_modulus=1.3MPa"]).cover
    assert cover.layers[0].material.youngs_modulus == pytest.approx(1.3e6)
    assert not cover.assumed


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4:thickness=1mm", "no layer 4, layers 1 (bottom) to 2 (top); a new one on top has the number 3"),
        ("thickness=1mm", "is not a layer's number"),
        ("²:thickness=1mm", "is not a layer's number"),
        ("1:", '"": unknown key'),
        ("1:nu=0.4", "did you mean 'poisson_ratio'"),
        ("1:thickness", "thickness has no value"),
        ("1:thickness=1mm,thickness=2mm", "thickness is given twice"),
        ("1:thickness=1", "--layer 1: thickness: '1' has no unit"),
        ("1:thickness=0mm", "--layer 1: thickness: must be positive"),
        ("1:youngs_modulus=-1MPa", "youngs_modulus: must be positive"),
        ("1:poisson_ratio=0.6", "poisson_ratio: must lie in 0..0.5"),
        ("1:poisson_ratio=soft", "must be a number in 0..0.5"),
        ("1:material=ecoflx", "unknown material 'ecoflx'; did you mean"),
        ("1:c1=3kPa", "neo-hookean takes shear_modulus [Pa]"),
        ("1:hardness=30 shore-a,shear_modulus=1kPa", "not both"),
        (f"1:thickness={'1' * 600}mm", "is not a layer's number"),
    ],
)
def test_bad_changes_are_one_line_each_that_names_the_option(text, expected):
    with pytest.raises(InputError) as caught:
        change(text)
    (fault,) = caught.value.faults
    assert fault.startswith("--layer")
    assert expected in fault


def test_all_faults_of_all_changes_are_listed():
    with pytest.raises(InputError) as caught:
        change("1:thickness=1,poisson_ratio=2", "5:thickness=1mm", "2:thickness=0mm,material=steel")
    assert len(caught.value.faults) == 5
