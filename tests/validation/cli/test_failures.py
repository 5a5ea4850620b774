"""Which errors are explained to the user, in which words and with which exit status."""

import errno

import pytest
from cyclopts import CycloptsError

from fastmodel.errors import FastModelError, ParametersError
from fem_reference.errors import ConvergenceError
from validation.cli.entry import explain
from validation.errors import InputError
from validation.extras import MissingExtraError

BEHIND = ImportError("cannot import the command")
BEHIND.__cause__ = ModuleNotFoundError("no mcap", name="mcap.reader")


@pytest.mark.parametrize(
    ("error", "status", "lines"),
    [
        *[(kind("no such part"), 2, ("no such part",)) for kind in (ValueError, FastModelError, ParametersError)],
        (InputError("one", "two"), 2, ("one", "two")),
        (CycloptsError(msg="one\n   two"), 2, ("one two",)),
        *[
            (OSError(code, "it failed", "a.toml"), 3, ("a.toml: it failed",))
            for code in (errno.ENOENT, errno.EACCES, errno.ENOSPC)
        ],
        (OSError(errno.ENAMETOOLONG, "too long", "a"), 2, ("a: too long; take a shorter name",)),
        (MemoryError(), 3, ("not enough memory for this input",)),
        (ConvergenceError("no\nway"), 4, ("no way",)),
        (BEHIND, 3, (str(MissingExtraError("mcap")),)),
    ],
    ids=repr,
)
def test_errors_are_told_in_lines(error, status, lines):
    explanation = explain(error)
    assert (explanation.status, explanation.lines) == (status, lines)


@pytest.mark.parametrize("error", [ImportError("ours"), TypeError("ours"), KeyError("ours"), AssertionError("ours")])
def test_programming_errors_are_not_explained(error):
    assert explain(error) is None
