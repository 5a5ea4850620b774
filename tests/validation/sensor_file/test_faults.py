"""Faults of a sensor file: one line each, with place and accepted values."""

import tomllib
from pathlib import Path

import pytest

from tests.support.sensor_text import GOOD
from validation.errors import InputError
from validation.sensor_file import parse


def test_every_fault_is_listed_once_with_its_path(sensor, faults):
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
material = "dragonskn-30"

[electronic]
rate = "271 Hz"

[electronics]
rate = "271"
sensitivity = "2665.7 1/N"

[contact]
friction = -0.3
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
    assert "did you mean 'electronics'" in listed["electronic"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('thickness = "2 mm"', 'thickness = "2"', "cover.layer[0].thickness: '2' has no unit"),
        ("poisson_ratio = 0.49", "nu = 0.49", "did you mean 'poisson_ratio'?"),
        ('model = "linear-elastic"', 'model = "lineer"', "did you mean 'linear-elastic'?"),
        ('youngs_modulus = "1 MPa"', 'shear_modulus = "1 MPa"', "linear-elastic takes youngs_modulus [Pa]"),
        ('thickness = "2 mm"', 'thickness = "-2 mm"', "cover.layer[0].thickness: must be positive"),
        ("rows = 3", 'rows = "3"', "array.rows: "),
        ("rows = 3", "rows = 3\nmask = ['01']", "array.mask: must have 3 rows of 2 entries"),
        ("rows = 3", "rows = 3\npositions = 'no.csv'", "array.positions: no such file"),
        ("rows = 3", "rows = 3\ntexel_size = '9 mm'", "array: texels 0 and 1 overlap"),
        ("rows = 3", "rows = 5001", "are too many; at most 10000 texels"),
        (
            'rate = "271 Hz"',
            "characteristic = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]",
            "give either sensitivity (a line, '2665.7 1/N') or",
        ),
        ('rate = "271 Hz"', 'rate = "271 Hz"\noutput_max = 5000', "does not fit 12 bits; accepted: 1..4095"),
        ('rate = "271 Hz"', 'rate = "271 Hz"\ngains = [1.0]', "takes one number per texel (6)"),
        ('rate = "271 Hz"', 'rate = "271 Hz"\nnoise = 3', "electronics.noise: 3 has no unit"),
        *(
            (
                "[electronics]",
                f"[electronics]\ncalibrated = {value}",
                "accepted: 'texel force' or 'through the cover, tip 1",
            )
            for value in (
                "'the texel'",
                "'through the cover, tip 1'",
                "'through the cover, tip -1 mm'",
                "'through the cover, tip 30 mm'",
                "'through the cover, tip 1 mm*9**9**9'",
                f"'through the cover, tip 1{' ' * 60_000}mm'",
                "1.0",
                "['texel force']",
            )
        ),
        ("[electronics]", "[electronics]\ncalibrated = '1 mm'", "electronics.calibrated: '1 mm' is not what"),
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
def test_fault_says_what_is_wrong(sensor, old, new, expected, faults):
    assert old in GOOD
    (only, *more) = faults(sensor(GOOD.replace(old, new)))
    assert expected in " ".join([only, *more])
    assert all("\n" not in fault for fault in (only, *more))


#: Keys of a sensor file that take a number between two limits: place, key, the other keys of its table, both limits.
LIMITED = [
    (("array",), "rows", {"columns": 1}, 1, 10_000),
    (("array",), "columns", {"rows": 1}, 1, 10_000),
    (("cover", "layer", 0, "material"), "poisson_ratio", {}, 0.0, 0.5),
    (("cover", "layer", 0, "material"), "spread", {}, 0.0, 10.0),
    (("cover", "layer", 0, "material"), "poisson_spread", {"poisson_ratio": 0.0}, 0.0, 0.5),
    (("electronics",), "bits", {}, 1, 32),
    (("electronics",), "output_max", {"bits": 32}, 1, 2**32 - 1),
    (("electronics",), "offset", {}, -1e12, 1e12),
    (("electronics",), "threshold", {}, 0.0, 1e9),
    (("electronics",), "saturation_band", {"bits": 32}, 0.0, 1e9),
    (("filter",), "order", {"cutoff": "40 Hz"}, 1, 20),
    *((("spread",), key, {"sigma_x": 1.0, "sigma_y": 1.0, "ksize_x": 3, "ksize_y": 3}, *limits)
      for key, limits in {"sigma_x": (1e-3, 100.0), "sigma_y": (1e-3, 100.0),
                          "ksize_x": (1, 9999), "ksize_y": (1, 9999)}.items()),
]  # fmt: skip


@pytest.mark.parametrize(("place", "key", "others", "lowest", "highest"), LIMITED)
def test_the_limits_of_a_number_are_accepted_and_numbers_beyond_them_named(place, key, others, lowest, highest):
    def read(value):
        table = tables = tomllib.loads(GOOD)
        for part in place:
            table = table[part] if isinstance(part, int) else table.setdefault(part, {})
        table.update(others | {key: value})
        return parse(tables, source=Path("sensor.toml"))

    step = 2 if "ksize" in key else 1 if isinstance(lowest, int) else 1e-6 * highest
    for value in (lowest, highest):
        read(value)
    for value in (lowest - step, highest + step):
        with pytest.raises(InputError) as caught:
            read(value)
        (fault,) = caught.value.faults
        assert f".{key}: " in fault
        assert f"{value:.10g}" in fault
