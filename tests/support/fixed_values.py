"""Check of data classes whose values are fixed and given by name."""

import dataclasses

import pytest


def check_fixed(part):
    """No attribute of the data class can be set, and its values must be given by name."""
    names = [each.name for each in dataclasses.fields(part)]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(part, names[0], getattr(part, names[0]))
    with pytest.raises(TypeError, match="positional"):
        type(part)(*(getattr(part, name) for name in names))
