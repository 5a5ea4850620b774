import errno

import pytest
from cyclopts import CycloptsError
from hypothesis import given
from hypothesis import strategies as st

from fastmodel.errors import FastModelError, ParametersError
from fem_reference.errors import ConvergenceError
from validation.cli.entry import explain
from validation.errors import InputError
from validation.extras import MissingExtraError

LINE = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1)


@given(text=LINE, kind=st.sampled_from([ValueError, InputError, FastModelError, ParametersError]))
def test_every_error_about_input_is_status_2_with_its_own_text(text, kind):
    explanation = explain(kind(text))
    assert (explanation.status, explanation.lines) == (2, (text,))


@given(faults=st.lists(LINE, min_size=1, max_size=5))
def test_every_fault_has_a_line(faults):
    explanation = explain(InputError(*faults))
    assert (explanation.status, explanation.lines) == (2, tuple(faults))


@given(code=st.sampled_from([errno.ENOENT, errno.EACCES, errno.ENOSPC, errno.EIO]), name=LINE)
def test_errors_of_the_system_are_status_3_and_name_the_file(code, name):
    (line,) = (explanation := explain(OSError(code, "it failed", name))).lines
    assert (explanation.status, line) == (3, f"{name}: it failed")


@given(text=LINE)
def test_a_solver_that_does_not_converge_is_status_4(text):
    explanation = explain(ConvergenceError(text))
    assert (explanation.status, explanation.lines) == (4, (text,))


@given(words=st.lists(LINE, min_size=1, max_size=9))
def test_an_error_of_the_argument_parser_is_one_line_and_status_2(words):
    explanation = explain(CycloptsError(msg="\n   ".join(words)))
    assert (explanation.status, explanation.lines) == (2, (" ".join(words),))


def test_a_missing_extra_is_found_behind_the_import_that_failed():
    cause = ModuleNotFoundError("no mcap", name="mcap.reader")
    error = ImportError("cannot import the command")
    error.__cause__ = cause
    explanation = explain(error)
    assert explanation.status == 3
    assert explanation.lines == (str(MissingExtraError("mcap")),)


@pytest.mark.parametrize("error", [ImportError("ours"), TypeError("ours"), KeyError("ours"), AssertionError("ours")])
def test_programming_errors_are_not_explained(error):
    assert explain(error) is None
