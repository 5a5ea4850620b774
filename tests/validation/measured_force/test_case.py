"""Files of measured forces: what is read, and one line per fault."""

import numpy as np
import pytest

from meshes import Sphere
from meshes.bounded_file import parse_toml
from validation import schema
from validation.errors import InputError
from validation.measured_force.comparison import BUILT_IN, read_measured_force, replace_dome, shift_poisson_ratio
from validation.schema.measured_force import Measurement

TEXT = """
name = "pad"
indenter = "sphere:radius=5mm"
[[cover.layer]]
thickness = "2 mm"
material = { model = "neo-hookean", shear_modulus = "0.1 MPa", poisson_ratio = 0.48, poisson_spread = 0.03 }
[[point]]
depth = "0.4 mm"
force = "2 N"
use = "score"
[[point]]
depth = "0.2 mm"
force = "50 g"
use = "fit"
"""


def parse(text):
    return schema.parse(parse_toml(text), Measurement, source="pad.toml")


def test_points_are_sorted_and_in_si_units():
    read = parse(TEXT)
    np.testing.assert_allclose(read.depth, [0.2e-3, 0.4e-3])
    np.testing.assert_allclose(read.force, [0.05 * 9.80665, 2.0])
    assert read.fitted.tolist() == [True, False]
    assert (read.uncertainty.force, read.uncertainty.zero, read.source) == (None, None, "given by the user")


def shift(text):
    return [shift_poisson_ratio(parse(text).cover, sign).layers[0].material for sign in (-1, 1)]


def test_poisson_ratio_moves_at_equal_shear_modulus_up_to_incompressible():
    low, high = shift(TEXT)
    assert (low.poisson_ratio, high.poisson_ratio) == (pytest.approx(0.45), 0.5)
    linear = TEXT.replace('"neo-hookean", shear_modulus', '"linear-elastic", youngs_modulus')
    wanted = parse(linear).cover.layers[0].material.shear_modulus
    assert [each.shear_modulus for each in shift(linear)] == pytest.approx([wanted] * 2)


def test_the_ball_on_a_dome_has_the_gap_of_the_given_ball():
    domed = parse('top_radius = "60 mm"\n' + TEXT)
    x = np.array([0.3e-3])
    fall = x**2 / (2 * 60e-3)
    assert replace_dome(domed).gap(x, 0 * x) == pytest.approx(domed.indenter.gap(x, 0 * x) + fall, rel=1e-3)
    assert replace_dome(parse(TEXT)) == Sphere(radius=5e-3)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_measurements_are_read(name):
    read = read_measured_force(name)
    assert read.fitted.any()
    assert not read.fitted.all()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"0.4 mm"', '"0.4"', "point[0].depth: '0.4' has no unit"),
        ('force = "2 N"', 'forse = "2 N"', "point[0].forse: unknown key; did you mean 'force'"),
        ('force = "2 N"\n', "", "point[0].force: is missing; write for example force ="),
        ('"2 N"', '"-2 N"', "point[0].force: must be positive"),
        ('use = "score"', 'use = "check"', "point[0].use: 'check' is unknown; accepted: fit, score"),
        ('use = "score"', 'use = "fit"', 'at least one with use = "fit" and one with use = "score"'),
        ('"0.4 mm"', '"0.2 mm"', "takes points at two depths"),
        ('"0.4 mm"', '"2 mm"', "point[0].depth: 2 mm pierces the cover; accepted: less than its 2 mm"),
        ("sphere:radius=5mm", "box:size=5mmx5mmx5mm", "indenter: takes a body of revolution"),
        ("sphere:radius=5mm", "bowl:radius=5mm", "indenter: unknown indenter 'bowl'"),
        ('name = "pad"', 'name = "pad"\nuncertainty = { zero = "0.3 mm" }', "uncertainty.zero: must be less than"),
        ('name = "pad"', 'name = "pad"\nuncertainty = { zero = "0.3" }', "uncertainty.zero: '0.3' has no unit"),
        ('name = "pad"', 'name = "pad"\nuncertainty = { depth = "1 mm" }', "uncertainty.depth: unknown key"),
        ('name = "pad"', "", "name: is missing"),
        ("sphere:radius=5mm", "cylinder:radius=5mm", None),
        ('indenter = "sphere', 'top_radius = "9 mm"\nindenter = "tip', "top_radius: takes a sphere"),
    ],
)
def test_a_fault_is_one_line_with_its_place(old, new, words):
    if words is None:
        assert parse(TEXT.replace(old, new)).indenter.is_flat
        return
    with pytest.raises(InputError) as caught:
        parse(TEXT.replace(old, new))
    assert words in str(caught.value)
    assert all(line.startswith("pad.toml: ") for line in caught.value.faults)


def test_an_empty_file_names_what_is_missing():
    with pytest.raises(InputError) as caught:
        parse("")
    assert {fault.split(": ")[1] for fault in caught.value.faults} == {"name", "indenter", "cover", "point"}
