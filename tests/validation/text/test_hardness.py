"""Hardness as people write it."""

import pytest

from tests.support.bounded import bounded
from validation.errors import InputError
from validation.text.hardness import read_hardness


@pytest.mark.parametrize(
    "text", ["30", "30 A", "30a", "30 shore-a", "30 Shore A", "30.0 shore a", "Shore A 30", "shore-a30", 30, 30.0]
)
def test_hardness_is_read_as_people_write_it(text):
    found = read_hardness(text, bare=True)
    assert (found.hardness, found.scale) == (30, "a")


@pytest.mark.parametrize(
    "text",
    ["30 shore-00", "30 Shore 00", "30 00", "30 shore-OO", "30 oo", "30.0 SHORE 00", "Shore 00-30", "shore OO 30"],
)
def test_shore_00_is_read_with_its_scale_only(text):
    found = read_hardness(text)
    assert (found.hardness, found.scale) == (30, "00")


@pytest.mark.parametrize("text", ["10 shore-00", "95 00", "19 A", "85 shore-a", "0 A", "100 oo"])
def test_hardness_outside_the_range_of_its_scale_is_refused_with_that_range(text):
    with pytest.raises(InputError, match=r"the relations hold for 20\.\.[89]0 Shore (A|00), not for"):
        read_hardness(text)


@pytest.mark.parametrize(
    "text",
    [
        "", "A", "-30", "30 mm", "shore-d 30", "30 shore-d", "shore-0030", "Shore A 30 A",
        "50 0", "50 000", "50 shore-a0", "00-30", "30 a 00",
        True, None, "1e9", "nan",
    ],
)  # fmt: skip
def test_what_is_no_hardness_is_refused(text):
    with pytest.raises(InputError, match="--hardness: "):
        read_hardness(text, place="--hardness", bare=True)


@pytest.mark.parametrize(
    "text", ["30" + " " * 60_000 + "x", "3" * 10**6, "30 shore" + "- " * 30_000, "30 " + "a" * 10**6]
)
def test_long_texts_are_refused_at_once(text):
    with bounded(25), pytest.raises(InputError) as caught:
        read_hardness(text)
    assert len(str(caught.value)) < 200
