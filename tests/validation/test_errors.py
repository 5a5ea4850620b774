"""Errors that a user can correct."""

from validation.errors import InputError, nearest

NAMES = ["sphere", "cylinder", "box"]


def test_every_fault_is_a_line_of_the_message():
    error = InputError("one", "two")
    assert error.faults == ("one", "two")
    assert str(error) == "one\ntwo"


def test_a_misspelt_name_gets_a_hint():
    assert nearest("spere", NAMES) == "did you mean 'sphere'? accepted: sphere, cylinder, box"
    assert nearest("k", ["mu", "K"]) == "did you mean 'K'? accepted: mu, K"
