"""Arrays packed as npz."""

from __future__ import annotations

import io
import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from meshes.bounded_file import pack_npz

NAMES = st.text("abcdefgh_", min_size=1, max_size=8)
VALUES = arrays.arrays(
    st.sampled_from([np.dtype(kind) for kind in ("float64", "int64", "uint8", "bool", "<U5")]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


@given(tables=st.dictionaries(NAMES, VALUES, max_size=4))
def test_packed_arrays_come_back_and_equal_arrays_give_equal_bytes_in_any_order_of_names_and_memory(tables):
    packed = pack_npz(tables)
    with np.load(io.BytesIO(packed), allow_pickle=False) as read:
        assert set(read.files) == set(tables)
        for name, values in tables.items():
            assert read[name].dtype == values.dtype
            np.testing.assert_array_equal(read[name], values, strict=True)
    other = {name: np.array(values, order="F") for name, values in reversed(tables.items())}
    assert pack_npz(other) == packed


def test_the_bytes_do_not_depend_on_the_time(monkeypatch):
    before = pack_npz({"a": np.arange(3)})
    monkeypatch.setattr(time, "time", lambda: 2e9)
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2_000_000_000))
    assert pack_npz({"a": np.arange(3)}) == before
    assert pack_npz({"a": np.arange(4)}) != before
