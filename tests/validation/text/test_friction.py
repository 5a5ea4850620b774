"""Friction coefficients in sensor files and on the command line."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.errors import InputError
from validation.text.friction import describe_friction, read_friction


@given(value=st.floats(0, 1e6))
def test_numbers_and_texts_of_numbers_read_back_as_written(value):
    assert read_friction(value) == read_friction(repr(value)) == value


def test_no_slip_is_an_infinite_coefficient():
    assert math.isinf(read_friction("no-slip"))
    assert describe_friction(math.inf) == "no-slip"
    assert read_friction(describe_friction(0.25)) == 0.25


@pytest.mark.parametrize(
    "value",
    [
        "inf", math.inf, math.nan, "nan", -0.1, "-1", "1e999", 10**400, True, None, [0.4], {}, "slip", "", "0.4 N",
        "9" * 10**6,
    ],
)  # fmt: skip
def test_everything_else_is_refused_in_one_short_line(value):
    with pytest.raises(InputError, match="is not zero, a positive number or no-slip") as caught:
        read_friction(value, place="contact.friction")
    assert len(str(caught.value)) < 200
