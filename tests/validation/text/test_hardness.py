"""Hardness as people write it."""

import time

import pytest

from validation.errors import InputError
from validation.text.hardness import read_hardness


@pytest.mark.parametrize("text", ["30", "30 A", "30a", "30 shore-a", "30 Shore A", "30.0 shore a", 30, 30.0])
def test_hardness_is_read_as_people_write_it(text):
    assert read_hardness(text, bare=True).shore_a == 30


@pytest.mark.parametrize(
    "text", ["", "A", "-30", "30 mm", "shore-a 30", "30 shore-d", "50 00", True, None, "1e9", "nan"]
)
def test_what_is_no_hardness_is_refused(text):
    with pytest.raises(InputError, match="--hardness: "):
        read_hardness(text, place="--hardness", bare=True)


@pytest.mark.parametrize(
    "text", ["30" + " " * 60_000 + "x", "3" * 10**6, "30 shore" + "- " * 30_000, "30 " + "a" * 10**6]
)
def test_long_texts_are_refused_at_once(text):
    started = time.process_time()
    with pytest.raises(InputError) as caught:
        read_hardness(text)
    assert time.process_time() - started < 0.5
    assert len(str(caught.value)) < 200
