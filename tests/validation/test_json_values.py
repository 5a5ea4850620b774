"""Results as JSON values."""

import json
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from validation.json_values import json_text, to_json_values

NUMBERS = st.floats() | st.integers(-(2**53), 2**53) | st.booleans() | st.none() | st.text(max_size=5)
VALUES = st.recursive(
    NUMBERS,
    lambda inner: st.lists(inner, max_size=3) | st.tuples(inner) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=10,
)


def without_infinities(value):
    if isinstance(value, dict):
        return {key: without_infinities(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [without_infinities(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@given(VALUES)
def test_json_text_holds_the_value_with_null_for_what_json_lacks(value):
    assert json.loads(json_text(value)) == without_infinities(value)


@given(arrays(float, (2, 3)))
def test_arrays_become_lists_of_numbers(values):
    assert to_json_values({"image": values}) == {"image": without_infinities(values.tolist())}
    assert to_json_values(np.float64(values[0, 0])) == without_infinities(float(values[0, 0]))
