import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.bounded import bounded
from validation.errors import InputError
from validation.text.quantity import read_quantities, read_quantity


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("2 mm", "length", 2e-3),
        ("-1.1mm", "length", -1.1e-3),
        ("1 MPa", "pressure", 1e6),
        ("271 Hz", "frequency", 271),
        ("2665.7 1/N", "per force", 2665.7),
        ("45deg", "angle", math.pi / 4),
        ("500 g", "force", 0.5 * 9.80665),
        ("0.5 kg", "force", 0.5 * 9.80665),
        ("1.5e1 kPa", "pressure", 15e3),
        ("2 N/mm^2", "pressure", 2e6),
        ("2 N / mm\u00b2", "pressure", 2e6),
    ],
)
def test_units_become_si(text, kind, expected):
    assert read_quantity(text, kind) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("value", "kind", "fragment"),
    [
        ("3.4", "length", "has no unit"),
        (3.4, "length", "has no unit"),
        ("2 N", "length", "'N' in '2 N' is not a unit of length"),
        ("2 mmm", "length", "'mmm' in '2 mmm' is not a unit of length"),
        ("2 mm", "force", "is not a unit of force"),
        ("2 mm + 3 mm", "length", "is not a unit"),
        ("10 rpm", "frequency", "is not a unit of frequency"),
        ("5 1/s", "angle", "is not a unit of angle"),
        ("mm", "length", "is not a length"),
        (True, "length", "is not a length"),
        ([1], "length", "is not a length"),
        ("1e999 mm", "length", "too large"),
    ],
)
def test_fault_names_place_and_an_accepted_example(value, kind, fragment):
    with pytest.raises(InputError) as caught:
        read_quantity(value, kind, place="cover.layer[0].thickness")
    message = str(caught.value)
    assert message.startswith("cover.layer[0].thickness: ")
    assert fragment in message
    example = message.rsplit("write for example ", 1)[1].strip("'")
    assert math.isfinite(read_quantity(example, kind))


def test_wrong_count_shows_how_many_are_wanted():
    with pytest.raises(match=r"--at: '1mm' is not 2 values; write for example '2mm,2mm'"):
        read_quantities("1mm", "length", 2, place="--at")


UNITS = [
    ("length", "m", 1.0),
    ("length", "mm", 1e-3),
    ("pressure", "kPa", 1e3),
    ("frequency", "Hz", 1.0),
    ("force", "mN", 1e-3),
    ("force", "g", 9.80665e-3),
    ("angle", "rad", 1.0),
    ("time", "ms", 1e-3),
]


@given(st.sampled_from(UNITS), st.floats(-1e12, 1e12), st.sampled_from(["", " ", "  "]))
def test_every_number_comes_back_from_its_text(unit, number, gap):
    kind, name, factor = unit
    assert read_quantity(f"{number!r}{gap}{name}", kind) == pytest.approx(number * factor, rel=1e-12)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4), st.sampled_from(["x", ",", " x ", ", "]))
def test_every_vector_comes_back_from_its_text(numbers, joint):
    text = joint.join(f"{number!r}mm" for number in numbers)
    assert read_quantities(text, "length", len(numbers)) == pytest.approx([1e-3 * number for number in numbers])


@settings(deadline=None)
@given(st.text(alphabet="0123456789.+-e xm/N,°kgPa*", max_size=12) | st.text(max_size=8), st.sampled_from(UNITS))
def test_any_text_is_a_finite_number_or_bad_input(text, unit):
    number, faults = 0.0, ("write for example",)
    try:
        number = read_quantity(text, unit[0])
    except InputError as error:
        faults = error.faults
    assert math.isfinite(number)
    assert len(faults) == 1
    assert "write for example" in faults[0]


#: Texts that pint would evaluate, or that a careless pattern would need hours to refuse.
HOSTILE = [
    "2 mm**9**9**9",
    "2 (mm)",
    "2 mm*3",
    "0x10 mm",
    "\u0663 mm",
    "2 __import__('os')",
    "2" + " " * 60_000 + "mm",
    "2 " + "mm*" * 20_000 + "mm",
    "1e" + "9" * 100_000 + " mm",
    "2mm," * 500_000,
]


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: text[:20])
def test_a_quantity_is_a_number_and_a_unit_and_nothing_else(text):
    for read in (read_quantity, lambda value, kind: read_quantities(value, kind, 2)):
        with bounded(25), pytest.raises(InputError) as caught:
            read(text, "length")
        assert len(str(caught.value)) < 500
