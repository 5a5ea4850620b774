"""Errors that a user can correct."""

import pytest

from meshes.catalogue import COMMON_NAMES, MATERIALS
from validation.errors import InputError, nearest
from validation.schema.types import read_material_name

NAMES = ["sphere", "cylinder", "box"]


def test_every_fault_is_a_line_of_the_message():
    error = InputError("one", "two")
    assert error.faults == ("one", "two")
    assert str(error) == "one\ntwo"


def test_a_misspelt_name_gets_a_hint():
    assert nearest("spere", NAMES) == "did you mean 'sphere'? accepted: sphere, cylinder, box"
    assert nearest("k", ["mu", "K"]) == "did you mean 'K'? accepted: mu, K"


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("PU", "'tpu' or 'polyurethane-foam'"),
        ("Polyurethane", "'tpu' or 'polyurethane-foam'"),
        ("PDMS", "'sylgard-184'"),
        ("Kapton", "'polyimide'"),
        ("neopren", "'neoprene'"),
    ],
)
def test_materials_are_suggested_by_their_common_names(word, named):
    with pytest.raises(ValueError, match=rf"unknown material '{word}'; did you mean {named}\? accepted: "):
        read_material_name(word)


def test_common_names_stand_for_materials_and_are_none():
    assert {each for meant in COMMON_NAMES.values() for each in meant} <= set(MATERIALS)
    assert not set(COMMON_NAMES) & set(MATERIALS)
