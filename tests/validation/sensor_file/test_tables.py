"""Materials in sensor files."""

import pytest

from meshes.catalogue import MATERIALS
from meshes.hardness import modulus_from_hardness
from validation.errors import InputError
from validation.sensor_file import load

SENSOR = """
[array]
rows = 3
columns = 2
pitch = "3.4 mm"

[[cover.layer]]
thickness = "2 mm"
material = {}

[electronics]
rate = "271 Hz"
sensitivity = "2665.7 1/N"
"""


@pytest.fixture
def material(tmp_path):
    """The material that a sensor file's text stands for."""

    def read(text):
        path = tmp_path / "sensor.toml"
        path.write_text(SENSOR.replace("{}", text))
        return load(path).cover.layers[0].material

    return read


def test_ogden_of_several_terms(material):
    found = material('{ model = "ogden", mu = ["150 kPa", "0.04 MPa"], alpha = [1.5, -4] }')
    assert found.terms("mu") == pytest.approx((150e3, 40e3))
    assert found.terms("alpha") == (1.5, -4.0)
    assert found.shear_modulus == pytest.approx(190e3)
    assert found.poisson_ratio == 0.5


@pytest.mark.parametrize("name", MATERIALS)
def test_every_name_of_the_library(material, name):
    assert material(f'"{name}"') == MATERIALS[name]


def test_hardness_stands_for_the_modulus_with_its_spread_and_source(material):
    expected = modulus_from_hardness(30).youngs_modulus
    elastic = material('{ model = "linear-elastic", hardness = "30 shore-a", poisson_ratio = 0.49 }')
    assert elastic.youngs_modulus == pytest.approx(expected)
    assert (elastic.spread, elastic.poisson_ratio) == (0.5, 0.49)
    assert "Gent 1958" in elastic.source
    assert "30 Shore A" in elastic.name
    rubber = material('{ model = "neo-hookean", hardness = "30 A", name = "pad", spread = 0.2, source = "mine" }')
    assert rubber.youngs_modulus == pytest.approx(expected)
    assert (rubber.name, rubber.spread, rubber.source, rubber.poisson_ratio) == ("pad", 0.2, "mine", 0.5)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{ model = "ogden", mu = ["150 kPa", "3"], alpha = [1.5, 4.0] }', "material.mu: '3' has no unit"),
        ('{ model = "ogden", mu = ["150 kPa", "3 kPa"], alpha = [1.5] }', "material: ogden takes as many numbers"),
        ('{ model = "ogden", mu = "150 kPa", alpha = [0] }', "material.alpha: must be a number other than 0"),
        ('{ model = "ogden", mu = "150 kPa", alpha = "3" }', "material.alpha: must be a number other than 0"),
        ('{ model = "ogden", mu = "150 kPa" }', "ogden takes mu [Pa], alpha [-] (one number, or a list"),
        ('{ model = "ogden", mu = ["1 kPa", "-2 kPa"], alpha = [1, 2] }', "shear modulus must be positive"),
        ('{ model = "yeoh", hardness = "30 shore-a" }', "goes with linear-elastic or neo-hookean, not with yeoh"),
        ('{ model = "neo-hookean", hardness = "30 shore-a", shear_modulus = "1 MPa" }', "not both"),
        ('{ model = "neo-hookean", hardness = "30" }', "material.hardness: '30' has no scale; write for example"),
        ('{ model = "neo-hookean", hardness = 30 }', "material.hardness: 30 has no scale"),
        ('{ model = "neo-hookean", hardness = "10 shore-a" }', "material.hardness: the relations hold for 20..80"),
        (
            '{ model = "neo-hookean", hardness = "50 shore-d" }',
            "is not on one of the scales that are supported, Shore A and Shore 00",
        ),
        ('{ model = "neo-hookean", hardness = "soft" }', "is not a hardness; write for example '30 shore-a'"),
        ('{ model = "linear-elastic", hardness = "30 shore-a" }', "poisson_ratio is missing"),
    ],
)
def test_faults_say_where_and_what(material, text, expected):
    with pytest.raises(InputError) as caught:
        material(text)
    (fault,) = caught.value.faults
    assert "cover.layer[0].material" in fault
    assert expected in fault
