"""Materials in sensor files and on the command line."""

import json

import pytest

from meshes.catalogue import MATERIALS
from meshes.hardness import modulus_from_hardness
from validation.cli import main
from validation.errors import InputError
from validation.sensor_file import load
from validation.text.hardness import read_hardness

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


@pytest.fixture
def softcover(capsys):
    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main(list(arguments))
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return run


def test_ogden_of_several_terms(material):
    found = material('{ model = "ogden", mu = ["150 kPa", "0.04 MPa"], alpha = [1.5, -4] }')
    assert found.terms("mu") == pytest.approx((150e3, 40e3))
    assert found.terms("alpha") == (1.5, -4.0)
    assert found.shear_modulus == pytest.approx(190e3)
    assert found.poisson_ratio == 0.5


def test_ogden_of_one_term_needs_no_list(material):
    found = material('{ model = "ogden", mu = "150 kPa", alpha = 3, poisson_ratio = 0.49 }')
    assert (found.terms("mu"), found.terms("alpha"), found.poisson_ratio) == ((150e3,), (3.0,), 0.49)


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
        ('{ model = "neo-hookean", hardness = "50 shore-00" }', "is not on the Shore A scale"),
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


@pytest.mark.parametrize("text", ["30", "30 A", "30a", "30 shore-a", "30 Shore A", "30.0 shore a", 30, 30.0])
def test_hardness_is_read_as_people_write_it(text):
    assert read_hardness(text, bare=True).shore_a == 30


@pytest.mark.parametrize(
    "text", ["", "A", "-30", "30 mm", "shore-a 30", "30 shore-d", "50 00", True, None, "1e9", "nan"]
)
def test_what_is_no_hardness_is_refused(text):
    with pytest.raises(InputError, match="--hardness: "):
        read_hardness(text, place="--hardness", bare=True)


def test_all_materials_with_source_and_spread(softcover):
    status, out, _ = softcover("materials")
    assert status == 0
    for name in MATERIALS:
        assert f"{name} " in out
    assert "Marechal" in out
    assert "±50 %" in out
    assert "drops out" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 80


def test_one_material(softcover):
    status, out, _ = softcover("materials", "dragon-skin-30-ogden")
    flat = " ".join(out.replace("│", " ").split())
    assert status == 0
    assert "mu 197 kPa" in flat
    assert "alpha 2.72" in flat
    assert "591 kPa at small strain, ±50 %" in flat
    assert "Marechal" in flat
    assert "drops out of the point spread function" in flat
    found = json.loads(softcover("materials", "dragon-skin-30-ogden", "--json")[1])
    assert found["parameters"] == {"mu": 197e3, "alpha": 2.72}
    assert found["bulk_modulus"] is None
    assert found["psf_deviation_per_thickness"] == pytest.approx(1.0)


def test_foam_shows_what_its_poisson_ratio_does(softcover):
    out = " ".join(softcover("materials", "silicone-foam")[1].replace("│", " ").split())
    assert "0.15 ±0.15" in out
    assert "0.00 to 0.65" in out


def test_modulus_from_a_hardness(softcover):
    status, out, _ = softcover("materials", "--hardness", "30")
    assert status == 0
    assert "1.151 MPa" in out
    assert "gent-1958" in out
    found = json.loads(softcover("materials", "--hardness", "30 shore-a", "--json")[1])
    assert found["youngs_modulus"] == pytest.approx(1.1515e6, rel=1e-3)
    assert found["by_relation"]["gent-1958"] == pytest.approx(1.1424e6, rel=1e-4)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["dragonskin-30"], "did you mean 'dragon-skin-30'"),
        (["--hardness", "90"], "--hardness: the relations hold for 20..80 Shore A"),
        (["--hardness", "soft"], "--hardness: 'soft' is not a hardness"),
        (["rtv615", "--hardness", "30"], "leave out the name"),
    ],
)
def test_bad_words(softcover, words, expected):
    status, out, err = softcover("materials", *words)
    assert (status, out) == (2, "")
    assert expected in err
