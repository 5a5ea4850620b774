import tomllib

import numpy as np
import pytest

from validation.errors import InputError
from validation.sensor_file import BUILT_IN, load, read_template

GOOD = """
[array]
rows = 3
columns = 2
pitch = "3.4 mm"

[[cover.layer]]
thickness = "2 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 }

[electronics]
rate = "271 Hz"
sensitivity = "2665.7 1/N"
"""


@pytest.fixture
def sensor(tmp_path):
    def write(text):
        path = tmp_path / "sensor.toml"
        path.write_text(text)
        return path

    return write


def faults(path):
    with pytest.raises(InputError) as caught:
        load(path)
    return [fault.removeprefix(f"{path}: ") for fault in caught.value.faults]


def test_everything_is_si(sensor):
    description = load(sensor(GOOD + '[filter]\ncutoff = "40 Hz"\norder = 3\n'))
    assert description.array.pitch == pytest.approx((3.4e-3, 3.4e-3))
    assert description.cover.thickness == pytest.approx(2e-3)
    assert description.cover.layers[0].material.youngs_modulus == pytest.approx(1e6)
    assert description.electronics.sensitivity == 2665.7
    assert (description.filter.cutoff_hz, description.filter.order) == (40, 3)
    assert description.cover.assumed is False


def test_every_fault_is_listed_once_with_its_path(sensor):
    path = sensor(
        """
[array]
rows = 14
colums = 6
pitch = 3.4

[[cover.layer]]
thickness = "-2 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.51 }

[[cover.layer]]
thickness = "2 N"
material = "dragonskin-30"

[electronic]
rate = "271 Hz"

[electronics]
rate = "271"
sensitivity = "2665.7 1/N"

[contact]
friction = 0.3
"""
    )
    listed = dict(fault.split(": ", 1) for fault in faults(path))
    assert listed.keys() == {
        "array.columns",
        "array.colums",
        "array.pitch",
        "cover.layer[0].thickness",
        "cover.layer[0].material.poisson_ratio",
        "cover.layer[1].thickness",
        "cover.layer[1].material",
        "electronic",
        "electronics.rate",
        "contact.friction",
    }
    assert "did you mean 'columns'" in listed["array.colums"]
    assert "3.4 has no unit; write for example '2 mm'" in listed["array.pitch"]
    assert "must be positive" in listed["cover.layer[0].thickness"]
    assert "must lie in 0..0.5" in listed["cover.layer[0].material.poisson_ratio"]
    assert "is not a unit of length" in listed["cover.layer[1].thickness"]
    assert "did you mean 'dragon-skin-30'" in listed["cover.layer[1].material"]
    assert "did you mean 'electronics'" in listed["electronic"]
    assert "has no unit" in listed["electronics.rate"]
    assert "friction is not yet supported" in listed["contact.friction"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('thickness = "2 mm"', 'thickness = "2"', "cover.layer[0].thickness: '2' has no unit"),
        ("poisson_ratio = 0.49", "nu = 0.49", "did you mean 'poisson_ratio'?"),
        ('model = "linear-elastic"', 'model = "lineer"', "did you mean 'linear-elastic'?"),
        ('youngs_modulus = "1 MPa"', 'shear_modulus = "1 MPa"', "linear-elastic takes youngs_modulus [Pa]"),
        ("rows = 3", "rows = -1", "array.rows: must lie in 1.."),
        ("rows = 3", 'rows = "3"', "array.rows: "),
        ("rows = 3", "rows = 3\nmask = ['01']", "array.mask: must have 3 rows of 2 entries"),
        ("rows = 3", "rows = 3\npositions = 'no.csv'", "array.positions: no such file"),
        ("rows = 3", "rows = 3\ntexel_size = '9 mm'", "array: texels 0 and 1 overlap"),
        ("rows = 3", "rows = 5001", "are too many; at most 10000 texels"),
        ('sensitivity = "2665.7 1/N"', "", "give either sensitivity"),
        ('rate = "271 Hz"', 'rate = "271 Hz"\noutput_max = 5000', "does not fit 12 bits; accepted: 1..4095"),
        ('rate = "271 Hz"', 'rate = "271 Hz"\ngains = [1.0]', "takes one number per texel (6)"),
        ('rate = "271 Hz"', 'rate = "271 Hz"\nnoise = 3', "electronics.noise: 3 has no unit"),
        ("[electronics]", "[cover]\nsize = ['6.7 mm', '30 mm']\n[electronics]", "leaves 6 texels uncovered in part"),
        ("[electronics]", "[cover]\nsize = ['30 mm', '5 mm']\n[electronics]", "the texels need 6.8 mm x 10.2 mm"),
        ("[electronics]", "[cover]\nsize = '30'\n[electronics]", "cover.size: '30' has no unit"),
        ("[electronics]", "[cover]\nsize = ['1 mm']\n[electronics]", "cover.size: must be one length or [x, y]"),
        ("[electronics]", "[cover]\nsize = '0 mm'\n[electronics]", "cover.size: must be positive"),
        ("[electronics]", "[cover]\nsize = '24 km'\n[electronics]", "cover.size: must be at most 1 m, not '24 km'"),
        ("[electronics]", "[cover]\nfree_edges = true\n[electronics]", "a cover with a size has free side edges"),
        (
            "[electronics]",
            "[spread]\nsigma_x=1.0\nsigma_y=1.0\nksize_x=4\nksize_y=3\n[electronics]",
            "must be odd, not 4",
        ),
        ("[array]", "[array", "not a TOML file"),
    ],
)
def test_fault_says_what_is_wrong(sensor, old, new, expected):
    assert old in GOOD
    (only, *more) = faults(sensor(GOOD.replace(old, new)))
    assert expected in " ".join([only, *more])
    assert all("\n" not in fault for fault in (only, *more))


def test_cover_of_limited_size_holds_its_texels_and_keeps_its_size_under_another_material(sensor):
    path = sensor(GOOD.replace("[electronics]", "[cover]\nsize = ['6.8 mm', '10.2 mm']\n[electronics]"))
    assert load(path).cover.size == pytest.approx((6.8e-3, 10.2e-3))
    assert load(path, material="dragon-skin-30", thickness="1mm").cover.size == pytest.approx((6.8e-3, 10.2e-3))
    masked = GOOD.replace("rows = 3", "rows = 3\nmask = ['10', '10', '10']\ntexel_size = '3 mm'")
    with_mask = sensor(masked.replace("[electronics]", "[cover]\nsize = ['6.4 mm', '9.8 mm']\n[electronics]"))
    assert load(with_mask).cover.size == pytest.approx((6.4e-3, 9.8e-3))


def test_texels_anywhere_from_a_table(sensor, tmp_path):
    (tmp_path / "texels.csv").write_text("x,y,z\n" + "".join(f"{i * 1e-2},{i * 2e-3},0\n" for i in range(6)))
    description = load(sensor(GOOD.replace("rows = 3", "rows = 3\npositions = 'texels.csv'")))
    np.testing.assert_allclose(description.array.centres[:, 1], np.arange(6) * 2e-3)
    np.testing.assert_allclose(description.array.normals, np.tile([0, 0, 1], (6, 1)))


def test_positions_alone_make_a_list_of_texels_as_large_as_they_may_be(sensor, tmp_path):
    """Three texels of a honeycomb: their squares are as wide as rows stand apart."""
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,0\n4e-3,0,0\n2e-3,3.4641e-3,0\n")
    alone = (
        GOOD.replace("rows = 3", "positions = 'texels.csv'")
        .replace("columns = 2", "")
        .replace(GOOD.splitlines()[4], "")
    )
    array = load(sensor(alone)).array
    assert (array.rows, array.columns) == (1, 3)
    assert array.pitch == array.texel_size == pytest.approx((3.4641e-3, 3.4641e-3))
    for text, fault in (
        (
            alone.replace("positions = 'texels.csv'", "rows = 3\ncolumns = 2"),
            "array.pitch: is missing; write for example pitch",
        ),
        (alone.replace("[array]", "[array]\nrows = 3"), "array: give both rows and columns, or leave both out"),
        (alone.replace("[array]", "[array]\nmask = ['01']"), "array.mask: must have 1 rows of 3 entries"),
    ):
        assert faults(sensor(text))[0].startswith(fault)
    (tmp_path / "texels.csv").write_text("x,y,z\n0,0,0\n0,0,0\n")
    assert "same centre" in faults(sensor(alone))[0]


@pytest.mark.parametrize("text", ["", "a,b,c\n", "x,y,z\n1,2\n", "x,y,z\n1,2,nan\n", "x,y,z\n0,0,0\n"])
def test_bad_table_of_texels(sensor, tmp_path, text):
    (tmp_path / "texels.csv").write_text(text)
    (fault,) = faults(sensor(GOOD.replace("rows = 3", "rows = 3\npositions = 'texels.csv'")))
    assert fault.startswith("array.positions: ")


def test_mask_switches_texels_off(sensor):
    description = load(sensor(GOOD.replace("rows = 3", "rows = 3\nmask = ['01', '11', '11']")))
    assert description.array.active.tolist() == [False, True, True, True, True, True]


def test_template_describes_the_default_array(sensor):
    description = load(sensor(read_template()))
    assert tomllib.loads(read_template())["array"]["rows"] == 14
    np.testing.assert_allclose(description.array.centres, BUILT_IN["wts-0614-34"].array.centres)
    assert description.electronics == BUILT_IN["wts-0614-34"].electronics


def test_built_in_names():
    assert load("wts-0614-34").array.count == 84
    assert load("sdh2-distal").array.active.sum() == 68
    assert load("sdh2-distal").cover.assumed


def test_unknown_name_shows_the_nearest():
    with pytest.raises(InputError, match="did you mean 'sdh2-distal'"):
        load("sdh2")


def test_material_and_thickness_replace_the_cover():
    cover = load("wts-0614-34", material="dragon-skin-30", thickness="3mm").cover
    assert (cover.thickness, cover.layers[0].material.name, cover.assumed) == (3e-3, "dragon-skin-30", False)
    assert load("wts-0614-34", thickness="3mm").cover.assumed


def test_bad_replacement_lists_both_faults():
    with pytest.raises(InputError) as caught:
        load("wts-0614-34", material="dragon-skin-3", thickness="3")
    assert [fault.split(":")[0] for fault in caught.value.faults] == ["--material", "--thickness"]
