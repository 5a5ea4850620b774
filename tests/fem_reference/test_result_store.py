import dataclasses
import hashlib
import json
import shutil
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from fem_reference import result_store
from meshes import Box, Sphere


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    return tmp_path / "store"


def counted(results):
    calls = []

    def compute():
        calls.append(1)
        return results

    return compute, calls


def test_second_fetch_reads_what_the_first_computed():
    ball = Sphere(radius=2e-3)
    tree = {"a": np.arange(5.0), "file": [np.array([True, False]), (ball, None, "text")], "b": np.float64(2.5)}
    compute, calls = counted(tree)
    for _ in range(2):
        found = result_store.fetch("test", {"x": 1.0}, compute)
        assert list(found) == list(tree)
        np.testing.assert_array_equal(found["a"], tree["a"])
        assert found["file"][0].dtype == bool
        assert found["file"][1] == (ball, None, "text")
        assert found["b"] == 2.5
    assert len(calls) == 1


def test_other_inputs_are_other_entries():
    compute, calls = counted({"a": 1.0})
    for inputs in ({"x": 1.0}, {"x": 2.0}, {"x": Sphere(radius=1.0)}, {"x": Sphere(radius=2.0)}, {"y": 1.0}):
        result_store.fetch("test", inputs, compute)
    result_store.fetch("other", {"x": 1.0}, compute)
    assert len(calls) == 6


def test_other_code_is_another_entry(monkeypatch):
    compute, calls = counted({"a": 1.0})
    result_store.fetch("test", {}, compute)
    for name in ("code_version", "hash_sources"):
        monkeypatch.setattr(result_store, name, lambda: "0123456789abcdef")
    result_store.fetch("test", {}, compute)
    assert len(calls) == 2


def test_code_version_covers_every_source(monkeypatch, tmp_path):
    for package in ("fem_reference", "meshes"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "one.py").write_text("pass")
    monkeypatch.setattr(result_store, "__file__", str(tmp_path / "fem_reference" / "result_store.py"))
    versions = {result_store.hash_sources()}
    (tmp_path / "meshes" / "one.py").write_text("pass # changed")
    versions.add(result_store.hash_sources())
    (tmp_path / "meshes" / "one.py").rename(tmp_path / "meshes" / "two.py")
    versions.add(result_store.hash_sources())
    (tmp_path / "fem_reference" / "materials").mkdir()
    (tmp_path / "fem_reference" / "materials" / "one.py").write_text("")
    versions.add(result_store.hash_sources())
    monkeypatch.setattr(result_store, "_version", lambda library: f"another {library}")
    versions.add(result_store.hash_sources())
    assert len(versions) == 5


def test_sources_that_change_meanwhile_keep_the_result_out(folder, monkeypatch, caplog):
    compute, _ = counted({"a": 1.0})
    result_store.code_version()
    monkeypatch.setattr(result_store, "hash_sources", lambda: "0123456789abcdef")
    assert result_store.fetch("test", {}, compute)["a"] == 1.0
    assert "sources changed" in caplog.text
    assert not folder.exists()


def flip(place):
    return lambda content: bytes(byte ^ (at == place % len(content)) for at, byte in enumerate(content))


@pytest.mark.parametrize(
    "damage",
    [
        *(flip(place) for place in (0, 30, 60, 110, 200, -1)),
        *(lambda content, length=length: content[:length] for length in (0, 1, 50, 105, 300)),
    ],
)
def test_a_flipped_bit_or_a_cut_is_found_and_computed_again(folder, damage, caplog):
    compute, calls = counted({"a": np.arange(100.0)})
    result_store.fetch("test", {}, compute)
    (entry,) = folder.iterdir()
    entry.write_bytes(damage(entry.read_bytes()))
    (found,) = result_store.verify()
    assert found.problem
    assert len(result_store.entries()) == 1
    assert (result_store.fetch("test", {}, compute)["a"] == np.arange(100.0)).all()
    assert len(calls) == 2
    assert "computed again" in caplog.text
    assert [entry.problem for entry in result_store.verify()] == [""]


@pytest.mark.parametrize(
    "manifest",
    [[], "text", None, {}, {"arrays": None}, {"arrays": []}, {"arrays": ["a"]}, {"arrays": ["a", "b", "c"]}],
)
def test_an_entry_whose_manifest_does_not_list_its_arrays_is_computed_again(folder, manifest, caplog):
    """Its sha256 holds, as for an entry that another program wrote."""
    compute, calls = counted({"a": 1.0, "b": 2.0})
    result_store.fetch("test", {}, compute)
    (entry,) = folder.iterdir()
    written, _, arrays = entry.read_bytes().partition(b"\n")[2].partition(b"\n")
    other = {**json.loads(written), "arrays": None, **manifest} if isinstance(manifest, dict) else manifest
    body = json.dumps(other).encode() + b"\n" + arrays
    header = f"softcover-entry 1 sha256={hashlib.sha256(body).hexdigest()} bytes={len(body):016d}\n"
    entry.write_bytes(header.encode() + body)
    assert [found.problem for found in result_store.verify()] == [
        "has bad content: its manifest does not list its arrays"
    ]
    assert result_store.fetch("test", {}, compute)["b"] == 2.0
    assert len(calls) == 2
    assert "does not list its arrays; it is computed again" in caplog.text


def test_an_entry_under_another_name_is_no_entry(folder):
    compute, calls = counted({"a": 1.0})
    result_store.fetch("test", {"x": 1.0}, compute)
    (entry,) = folder.iterdir()
    entry.rename(folder / f"{result_store.make_key('test', {'x': 2.0})}.entry")
    result_store.fetch("test", {"x": 2.0}, compute)
    assert len(calls) == 2


def test_entries_say_what_they_are(folder):
    compute, _ = counted({"a": 1.0})
    for radius in (1.0, 2.0):
        result_store.fetch("test", {"indenter": Sphere(radius=radius)}, compute)
        time.sleep(0.01)
    (folder / "notes.txt").write_text("mine")
    newest, oldest = result_store.entries()
    assert newest.created > oldest.created
    assert newest.inputs["indenter"]["radius"] == 2.0
    assert (newest.kind, newest.code, newest.problem) == ("test", result_store.code_version(), "")
    assert newest.size == newest.path.stat().st_size
    result_store.remove(newest)
    assert result_store.entries() == [oldest]


def test_a_store_that_is_not_there_is_empty():
    assert result_store.entries() == result_store.verify() == []
    assert result_store.sweep_leftovers() == result_store.count_partial_files() == 0


def test_results_come_back_even_where_nothing_can_be_kept(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "file"))
    compute, _ = counted({"a": 1.0})
    for number in range(3):
        assert result_store.fetch("test", {"number": number}, compute)["a"] == 1.0
    assert caplog.text.count("results are not kept") == 1


def test_objects_are_never_pickled(folder):
    with pytest.raises(ValueError, match="allow_pickle"):
        result_store.write("key", {"a": np.array([object()])}, {})
    assert not folder.exists()


def test_equal_inputs_are_described_equally():
    assert result_store.describe(Box(size=(1, 2, 3))) == result_store.describe(Box(size=(1.0, 2.0, 3.0)))
    assert result_store.describe({"b": 1, "a": np.float64(2)}) == result_store.describe({"a": 2.0, "b": 1})
    everything = np.arange(12.0).reshape(3, 4)
    assert result_store.describe(everything[:, ::2]) == result_store.describe(everything[:, ::2].copy())


@dataclasses.dataclass(frozen=True)
class Ball:
    radius: float


def test_different_inputs_are_described_differently():
    different = [
        np.arange(4.0),
        np.arange(4),
        np.arange(4.0).reshape(2, 2),
        np.arange(5.0),
        [0.0, 1.0, 2.0, 3.0],
        Ball(1.0),
        Sphere(radius=1.0),
        {"radius": 1.0},
        {"type": "Ball", "radius": 1.0},
        "1",
        1,
        1.5,
        None,
        True,
    ]
    texts = [json.dumps(result_store.describe(value), sort_keys=True) for value in different]
    assert len(set(texts)) == len(different)


@pytest.mark.parametrize("value", [object(), {1: 2.0}, {"@type": "Ball"}, np.array([object()]), {1.0, 2.0}, Ball])
def test_what_cannot_be_described_is_refused(value):
    with pytest.raises(TypeError, match="store key"):
        result_store.describe(value)


JSON_LIKE = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.floats(allow_nan=False) | st.text('a"\\é', max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", max_size=2), inner, max_size=3),
    max_leaves=6,
)


@given(one=JSON_LIKE, other=JSON_LIKE)
def test_keys_are_equal_exactly_where_inputs_are(one, other):
    keys = [result_store.make_key("test", result_store.describe({"x": value})) for value in (one, other)]
    assert (keys[0] == keys[1]) == (json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True))


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=arrays(
        st.sampled_from([np.float64, np.int64, np.bool_]), array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)
    )
)
def test_any_array_comes_back_as_it_was_written(folder, values):
    key = result_store.make_key("test", result_store.describe({"x": values}))
    result_store.write(key, {"values": values}, {"kind": "test"})
    found = result_store.read(key)["values"]
    assert found.dtype == values.dtype
    np.testing.assert_array_equal(found, values)
    assert not [entry.problem for entry in result_store.verify() if entry.problem]
    shutil.rmtree(folder)
