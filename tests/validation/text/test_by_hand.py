"""Quantities, hardness and indenters against values worked out by hand at the ends of their ranges."""

import math

import pytest

from meshes import Box, Cone, Cylinder, LetterH, Nut, Prism, Roller, RoundedTip, Sphere
from meshes.hardness import modulus_from_hardness
from validation.errors import InputError
from validation.text.friction import describe_friction, read_friction
from validation.text.hardness import material_from_hardness, read_hardness
from validation.text.indenter import (
    describe_indenter,
    read_angles,
    read_depth,
    read_indenter,
    read_load,
    read_position,
    read_tilt,
    read_yaw,
)
from validation.text.quantity import (
    LONGEST,
    find_factor,
    format_time,
    read_positive,
    read_quantities,
    read_quantity,
    split_quantity,
)


@pytest.mark.parametrize(
    ("text", "zero", "expected"),
    [
        ("2 mm", False, 2e-3), ("5 mm", False, 5e-3), ("0 mm", True, 0.0),
        ("5.001 mm", True, "at most 0.005 m, not '5.001 mm'"),
        ("0 mm", False, "must be positive, not '0 mm'"), ("-1 mm", False, "must be positive, not '-1 mm'"),
        ("-1 mm", True, "must not be negative, not '-1 mm'"), ("1 N", False, "'N' in '1 N' is not a unit of length"),
    ],
)  # fmt: skip
def test_a_positive_quantity_lies_within_its_range(text, zero, expected):
    if isinstance(expected, float):
        assert read_positive(text, "length", 5e-3, place="--size", zero=zero) == pytest.approx(expected, abs=0)
        return
    with pytest.raises(InputError) as caught:
        read_positive(text, "length", 5e-3, place="--size", zero=zero)
    assert str(caught.value).startswith("--size: ")
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("1 inch", "length", 25.4e-3), ("+3 um", "length", 3e-6), (".5 m", "length", 0.5), ("3. m", "length", 3.0),
        ("1 psi", "pressure", 6894.757293168361), ("2 bar", "pressure", 2e5), ("1 kHz", "frequency", 1e3),
        ("2 1/ms", "frequency", 2e3), ("1 lb", "force", 4.4482216152605), ("2 kgf", "force", 19.6133),
        ("90 \u00b0", "angle", math.pi / 2), ("200 mrad", "angle", 0.2), ("5 1/mN", "per force", 5e3),
        ("2 min", "time", 120.0), ("20 ms", "time", 0.02), ("3 lb", "mass", 1.36077711), ("500 g", "mass", 0.5),
        ("4 N mm^-1 mm^-1", "pressure", 4e6), ("1e-3 kN", "force", 1.0), ("5\u00b5m", "length", 5e-6),
    ],
)  # fmt: skip
def test_units_of_every_kind_become_si(text, kind, expected):
    assert read_quantity(text, kind) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "kind"),
    [("500 g", "pressure"), ("2 rad", "frequency"), ("2 N", "mass"), ("5 1/N", "angle"), ("2 s", "frequency"),
     ("2 g", "length")],
)  # fmt: skip
def test_units_of_another_kind_are_refused(text, kind):
    with pytest.raises(InputError, match="is not a unit of"):
        read_quantity(text, kind)


def test_a_fault_shows_the_example_that_was_asked_for_and_no_place_without_one():
    with pytest.raises(InputError) as caught:
        read_quantity("3", "length", example="0.7 mm")
    assert str(caught.value) == "'3' has no unit; write for example '0.7 mm'"
    with pytest.raises(InputError) as caught:
        read_quantities("1mm,2mm", "length", 3, joint="x")
    assert str(caught.value) == "'1mm,2mm' is not 3 values; write for example '2mmx2mmx2mm'"


def test_a_quantity_has_at_most_80_characters():
    text = "1" + " " * (LONGEST - 3) + "mm"
    assert len(text) == LONGEST == 80
    assert read_quantity(text, "length") == pytest.approx(1e-3)
    with pytest.raises(InputError, match="longer than the 80 characters accepted"):
        read_quantity(text + " ", "length")
    assert read_quantities(f"{text[:-1]}m,{text[:-1]}"[:160], "length", 2) == pytest.approx((1e-3, 1.0))
    with pytest.raises(InputError):
        read_quantities(f"{text},{text}", "length", 2)  # 161 characters


@pytest.mark.parametrize(
    ("text", "expected"),
    [("2.5 mm", (2.5, "mm")), ("  -3e2N/mm ", (-300.0, "N/mm")), ("7", (7.0, "")), ("mm", None), ("", None)],
)
def test_a_text_is_split_into_number_and_unit(text, expected):
    assert split_quantity(text) == expected


@pytest.mark.parametrize(
    ("unit", "wanted", "expected"),
    [("mm", "m", 1e-3), ("kPa", "N/mm^2", 1e-3), ("things", "things", 1.0), ("mm", "N", None), ("things", "m", None),
     ("2 mm", "m", None), ("mm", "m*2", None), ("h", "s", 3600.0)],
)  # fmt: skip
def test_a_factor_between_units_exists_within_a_kind(unit, wanted, expected):
    assert find_factor(unit, wanted) == (None if expected is None else pytest.approx(expected))


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "1 s"), (1.4, "1 s"), (2.6, "3 s"), (99.4, "99 s"), (100.0, "2 min"), (150.1, "3 min"), (3600.0, "60 min")],
)
def test_a_time_is_printed_in_seconds_or_minutes(seconds, text):
    assert format_time(seconds) == text


SHAPES = (
    ("ball:radius=5mm", Sphere(radius=5e-3), "ball, radius 5 mm"),
    ("sphere:radius=0.5cm", Sphere(radius=5e-3), "ball, radius 0.5 cm"),
    ("cylinder:radius=4mm", Cylinder(radius=4e-3), "cylinder, radius 4 mm"),
    ("box:size=10mmx8mmx5mm", Box(size=(10e-3, 8e-3, 5e-3)), "box, 10 mm \u00d7 8 mm \u00d7 5 mm"),
    ("tip:radius=1mm", RoundedTip(radius=1e-3), "rounded tip, radius 1 mm"),
    ("roller:radius=4mm,length=12mm", Roller(radius=4e-3, length=12e-3), "roller, radius 4 mm, length 12 mm"),
    ("cone:angle=120deg,radius=4mm", Cone(angle=2 * math.pi / 3, radius=4e-3), "cone, angle 120 deg, radius 4 mm"),
    ("nut:across=13mm,bore=8mm", Nut(across=13e-3, bore=8e-3), "nut, across 13 mm, bore 8 mm"),
    ("h:size=12mmx16mm,bar=4mm", LetterH(size=(12e-3, 16e-3), bar=4e-3), "letter H, 12 mm \u00d7 16 mm, bar 4 mm"),
    ("prism:points=-5mm,-3mm/5mm,-3mm/0,6mm", Prism(points=((-5e-3, -3e-3), (5e-3, -3e-3), (0.0, 6e-3))),
     "prism, 3 corners"),
)  # fmt: skip


@pytest.mark.parametrize(("text", "made", "words"), SHAPES)
def test_a_text_of_an_indenter_is_its_body_and_its_words(text, made, words):
    found = read_indenter(text)
    assert type(found) is type(made)
    assert found.footprint == pytest.approx(made.footprint)
    for part, other in zip(found.primitives(), made.primitives(), strict=True):
        assert part.size == pytest.approx(other.size)
        assert part.position == pytest.approx(other.position)
    assert describe_indenter(text) == words


def test_a_body_of_a_file_is_named_by_its_file():
    assert describe_indenter("mesh:path=part.stl,unit=mm") == "body, part.stl, mm"


@pytest.mark.parametrize(
    ("text", "accepted"),
    [("sphere:radius=0.0101mm", True), ("sphere:radius=0.0099mm", False), ("sphere:radius=499mm", True),
     ("sphere:radius=501mm", False), ("box:size=0.01mmx5mmx5mm", True), ("box:size=5mmx0.01mmx5mm", True),
     ("box:size=5mmx1001mmx5mm", False), ("box:size=1001mmx5mmx5mm", False)],
)  # fmt: skip
def test_a_body_is_from_a_fiftieth_of_a_millimetre_to_a_metre_wide(text, accepted):
    if accepted:
        assert read_indenter(text).footprint[0] > 0
    else:
        with pytest.raises(InputError, match=r"is not a possible width; accepted: 0\.02\.\.1000 mm"):
            read_indenter(text)


def test_a_text_of_an_indenter_has_at_most_20000_characters():
    text = "sphere:radius=5mm"
    assert read_indenter(text + " " * (20_000 - len(text))) == Sphere(radius=5e-3)
    with pytest.raises(InputError, match="has 20001 characters; at most 20000"):
        read_indenter(text + " " * (20_001 - len(text)))


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("spere:radius=5mm", ["unknown indenter 'spere'; did you mean 'sphere'"]),
        ("sphere:radius", ["sphere has no parameter 'radius'"]),
        ("roller:radius=5mm", ["roller needs length"]),
        ("roller:", ["roller needs radius", "roller needs length"]),
        ("box:size=1mmx1mm", ["box.size: '1mmx1mm' is not 3 values; write for example '2mmx2mmx2mm'"]),
        ("h:size=9mm,bar=1mm", ["h.size: '9mm' is not 2 values; write for example '2mmx2mm'"]),
        ("mesh:path=x.stl,axis=1mm", ["mesh.axis: '1mm' is not 2 values; write for example '2mm,2mm'"]),
        ("cone:angle=2mm,radius=4mm", ["cone.angle: 'mm' in '2mm' is not a unit of angle"]),
        ("sphere:radius=0mm", ["write for example sphere:radius=5mm"]),
    ],
)
def test_each_fault_of_an_indenter_has_a_line(text, faults):
    with pytest.raises(InputError) as caught:
        read_indenter(text, place="case.indenter")
    found = caught.value.faults
    assert all(line.startswith("case.indenter: ") for line in found)
    for part in faults:
        assert any(part in line for line in found), (part, found)


@pytest.mark.parametrize(
    ("read", "text", "expected"),
    [
        (read_load, "1 uN", 1e-6), (read_load, "1 MN", 1e6), (read_load, "200 g", 1.96133), (read_depth, "1 nm", 1e-9),
        (read_depth, "1 m", 1.0), (read_depth, "300 um", 3e-4), (read_yaw, "360deg", 2 * math.pi),
        (read_yaw, "-31deg", math.radians(-31)),
    ],
)  # fmt: skip
def test_loads_depths_and_turns_reach_to_the_ends_of_their_ranges(read, text, expected):
    assert read(text) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (read_load, "0 N", "--load: must be positive, not '0 N'"), (read_depth, "-1 mm", "--depth: must be positive"),
        (read_load, "0.9 uN", "9e-07 N is not possible"), (read_depth, "1.01 m", "1.01 m is not possible"),
        (read_yaw, "361deg", "more than one turn"), (read_yaw, "-361deg", "more than one turn"),
        (read_position, "1mm", "--at: '1mm' is not 2 values"), (read_tilt, "80deg,0deg", "--tilt: "),
        (read_tilt, "2deg", "is not two angles about x and y; write for example 2deg,0deg"),
    ],
)  # fmt: skip
def test_what_lies_outside_is_refused_with_its_option(read, text, said):
    with pytest.raises(InputError) as caught:
        read(text)
    assert said in str(caught.value)


def test_positions_and_angles_are_given_along_x_and_then_y():
    assert read_position("1.5mm,-2cm") == pytest.approx((1.5e-3, -2e-2))
    assert read_tilt("2deg,-0.5deg") == pytest.approx((math.radians(2), math.radians(-0.5)))
    assert read_angles("90deg,-45deg", place="p", example="e") == pytest.approx((math.pi / 2, -math.pi / 4))
    with pytest.raises(InputError, match=r"p: '1deg,2deg,3deg' is not two angles .*example e"):
        read_angles("1deg,2deg,3deg", place="p", example="e")


@pytest.mark.parametrize(
    ("model", "ratio", "name", "modulus"),
    [("linear-elastic", None, "youngs_modulus", 1.0), ("neo-hookean", None, "shear_modulus", 1 / 3),
     ("neo-hookean", 0.4, "shear_modulus", 1 / 2.8), ("linear-elastic", 0.3, "youngs_modulus", 1.0)],
)  # fmt: skip
def test_a_material_of_a_hardness_has_the_modulus_of_the_hardness(model, ratio, name, modulus):
    hardness = read_hardness("45 shore-a")
    found = material_from_hardness(hardness, model, poisson_ratio=ratio)
    assert found.parameters == {name: pytest.approx(modulus * modulus_from_hardness(45.0, "a").youngs_modulus)}
    assert found.poisson_ratio == (0.5 if ratio is None else ratio)
    assert found.youngs_modulus == pytest.approx(hardness.youngs_modulus)
    assert (found.model, found.source, found.spread) == (model, hardness.source, hardness.spread)
    assert found.name == f"{model} of {hardness}"
    assert material_from_hardness(hardness, model, name="my rubber").name == "my rubber"
    with pytest.raises(InputError, match="linear-elastic or neo-hookean, not with yeoh"):
        material_from_hardness(hardness, "yeoh")


@pytest.mark.parametrize(
    ("text", "bare", "said"),
    [("30", False, "'30' has no scale"), ("30 d", False, "is not on one of the scales"),
     ("x", True, "is not a hardness"),
     (True, True, "is not a hardness"), ("30" + " " * 37 + "a", True, None),
     ("30" + " " * 38 + "a", True, "is not a hardness"),
     ("95 a", False, "; take a named material")],
)  # fmt: skip
def test_a_hardness_needs_a_scale_that_is_known(text, bare, said):
    if said is None:
        assert read_hardness(text, bare=bare).hardness == 30
        return
    with pytest.raises(InputError) as caught:
        read_hardness(text, place="--hardness", bare=bare)
    assert str(caught.value).startswith("--hardness: ")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (0.25, "0.25"), (1 / 3, "0.333333"), (math.inf, "no-slip"), (2, "2")]
)
def test_a_friction_coefficient_is_described_and_read_again(value, text):
    assert describe_friction(value) == text
    assert read_friction(text) == pytest.approx(value, rel=1e-5)
    assert read_friction(f"  {text} ") == pytest.approx(value, rel=1e-5)


def test_a_refused_friction_coefficient_names_its_place_and_the_example():
    with pytest.raises(InputError) as caught:
        read_friction("x", place="--friction", example="0.7")
    assert str(caught.value) == "--friction: 'x' is not zero, a positive number or no-slip; for example 0.7"
    with pytest.raises(InputError) as caught:
        read_friction(-0.1)
    assert str(caught.value) == "-0.1 is not zero, a positive number or no-slip; for example 0.4"
    assert math.copysign(1, read_friction("-0")) == 1
    assert read_friction("0" * 39 + "1") == 1.0
    with pytest.raises(InputError):
        read_friction("0" * 40 + "1")
