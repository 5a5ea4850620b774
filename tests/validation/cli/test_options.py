import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.cli.options import check_range, read_time_span
from validation.errors import Faults, InputError

SECONDS = st.floats(0, 1e6, allow_nan=False)


@given(start=SECONDS, end=SECONDS)
def test_a_time_span_runs_forwards(start, end):
    text = f"{start!r}:{end!r}"
    if start < end:
        assert read_time_span("--pause", text, "2:3") == (start, end)
    else:
        with pytest.raises(InputError, match=r"--pause: .* for example 2:3"):
            read_time_span("--pause", text, "2:3")


@given(value=st.floats(allow_nan=True), most=st.floats(0, 1e9))
def test_a_range_accepts_exactly_the_numbers_in_it(value, most):
    faults = Faults()
    faults.read(check_range, "--seconds", value, most)
    assert bool(faults) == (not 0 <= value <= most)
