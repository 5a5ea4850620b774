from __future__ import annotations

import numpy as np
import pytest

from fem_reference import store
from fem_reference.error import grid_convergence
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
    compute, calls = counted({"a": np.arange(5.0), "b": 2.5})
    first = store.fetch("test", {"x": 1.0}, compute)
    second = store.fetch("test", {"x": 1.0}, compute)
    assert len(calls) == 1
    assert (first["a"] == second["a"]).all()
    assert second["b"] == 2.5


def test_other_inputs_are_other_entries():
    compute, calls = counted({"a": 1.0})
    for inputs in ({"x": 1.0}, {"x": 2.0}, {"x": Sphere(radius=1.0)}, {"x": Sphere(radius=2.0)}, {"y": 1.0}):
        store.fetch("test", inputs, compute)
    store.fetch("other", {"x": 1.0}, compute)
    assert len(calls) == 6


def test_a_damaged_entry_is_computed_again(folder):
    compute, calls = counted({"a": np.arange(100.0)})
    store.fetch("test", {}, compute)
    blob = next(folder.glob("*.npz"))
    content = bytearray(blob.read_bytes())
    content[len(content) // 2] ^= 1
    blob.write_bytes(content)
    assert (store.fetch("test", {}, compute)["a"] == np.arange(100.0)).all()
    assert len(calls) == 2


def test_half_an_entry_is_no_entry(folder):
    compute, calls = counted({"a": 1.0})
    store.fetch("test", {}, compute)
    next(folder.glob("*.json")).unlink()
    store.fetch("test", {}, compute)
    assert len(calls) == 2


def test_results_come_back_even_where_nothing_can_be_kept(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "file"))
    compute, _ = counted({"a": 1.0})
    assert store.fetch("test", {}, compute)["a"] == 1.0
    assert "cannot be written" in caplog.text


def test_a_failed_write_leaves_nothing_behind(folder, monkeypatch):
    folder.mkdir(parents=True)

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(OSError, match="No space"):
        store.write("key", {"a": np.arange(3)}, {})
    assert list(folder.iterdir()) == []


def test_equal_inputs_are_described_equally():
    assert store.describe(Box(size=(1, 2, 3))) == store.describe(Box(size=(1.0, 2.0, 3.0)))
    assert store.describe(np.arange(3)) != store.describe(np.arange(4))
    with pytest.raises(TypeError, match="store key"):
        store.describe(object())


def test_grid_convergence_of_a_second_order_sequence():
    sizes = [1.0, 0.5, 0.25]
    values = [3 + 0.4 * h**2 for h in sizes]
    estimate = grid_convergence(values, sizes)
    assert estimate == pytest.approx(1.25 * 0.4 * 0.25**2)
    assert estimate > abs(values[-1] - 3)


def test_grid_convergence_is_careful_where_values_wander():
    wander = grid_convergence([1.0, 1.1, 1.05], [3, 2, 1])
    assert wander >= 3 * 0.05 / (2**4 - 1)
    with pytest.raises(ValueError, match="three values"):
        grid_convergence([1.0, 2.0], [2, 1])
