import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.cli.options import check_choice, check_range, read_time_span
from validation.errors import Faults, InputError

SECONDS = st.floats(0, 1e6, allow_nan=False)


@given(start=SECONDS, length=st.floats(1e-3, 1e6))
def test_a_time_span_reads_back_as_written(start, length):
    end = start + length
    assert read_time_span("--window", f"{start!r}:{end!r}", "6:9") == (start, end)


@given(start=SECONDS, end=SECONDS)
def test_a_time_span_runs_forwards(start, end):
    text = f"{start!r}:{end!r}"
    if start < end:
        assert read_time_span("--pause", text, "2:3") == (start, end)
    else:
        with pytest.raises(InputError, match=r"--pause: .* for example 2:3"):
            read_time_span("--pause", text, "2:3")


@given(text=st.text(st.characters(exclude_categories=("N",)), max_size=12))
def test_a_text_without_digits_is_no_time_span(text):
    with pytest.raises(InputError, match="is not a time span"):
        read_time_span("--window", text, "6:9")


@given(value=st.floats(allow_nan=True), most=st.floats(0, 1e9))
def test_a_range_accepts_exactly_the_numbers_in_it(value, most):
    faults = Faults()
    faults.read(check_range, "--seconds", value, most)
    assert bool(faults) == (not 0 <= value <= most)


@given(word=st.text(max_size=8), choices=st.lists(st.text(min_size=1, max_size=8), min_size=1, unique=True).map(tuple))
def test_a_choice_accepts_exactly_the_words_that_it_lists(word, choices):
    if word in choices:
        check_choice("--method", "contact method", word, choices)
    else:
        with pytest.raises(InputError) as raised:
            check_choice("--method", "contact method", word, choices)
        assert str(raised.value).startswith(f"--method: unknown contact method {word!r}")
        assert str(raised.value).endswith(f"accepted: {', '.join(choices)}")
