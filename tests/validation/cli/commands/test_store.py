import json
import os

import numpy as np
import pytest

from fem_reference import result_store
from meshes.catalogue import ASSUMED_COVER

CODES = ("other-code", None, "other-code", None, None)
DAY = 86_400


@pytest.fixture
def empty(softcover, tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    return softcover


@pytest.fixture
def filled(empty, monkeypatch):
    """Entries 0 (newest), 1, 2 ... each a day older than the one before; some of another code."""
    now = result_store.time.time()
    for number, code in enumerate(CODES):
        with monkeypatch.context() as patch:
            patch.setattr(result_store.time, "time", lambda number=number: now - (number + 0.5) * DAY)
            about = {"kind": "point-spread", "code": code or result_store.code_version()}
            cover = result_store.describe({"cover": ASSUMED_COVER})
            result_store.write(
                f"{number:064x}", {"a": np.random.default_rng(number).random(100)}, {**about, "inputs": cover}
            )
    return empty


def numbers(entries):
    return [int(entry["key"], 16) for entry in entries]


def stored():
    return [int(entry.key, 16) for entry in result_store.entries()]


def damage(number):
    path = result_store.folder() / f"{number:064x}.entry"
    os.truncate(path, path.stat().st_size - 7)
    return path


def test_the_list_of_an_empty_store_names_its_folder(empty):
    assert empty("store", "list") == (0, f"0 entries, 0 bytes in {result_store.folder()}\n", "")
    result = json.loads(empty("store", "list", "--json")[1])
    assert (result["entries"], result["bytes"]) == ([], 0)


def test_the_list_has_an_entry_each_newest_first(filled):
    status, out, err = filled("store", "list")
    lines = out.splitlines()
    assert (status, len(lines)) == (0, 6)
    assert lines[0].split()[0] == "0" * 12
    assert "point spread: 2 mm assumed elastomer, bonded" in lines[0]
    assert " 12 h " in lines[0]
    assert [("other code" in line) for line in lines[:5]] == [code is not None for code in CODES]
    assert lines[5].startswith("5 entries, ")
    assert "2 of them cannot be used" in err
    result = json.loads(filled("store", "list", "--json")[1])
    assert numbers(result["entries"]) == [0, 1, 2, 3, 4]
    assert [entry["usable"] for entry in result["entries"]] == [code is None for code in CODES]
    assert result["bytes"] == sum(path.stat().st_size for path in result_store.folder().iterdir())


@pytest.mark.slow
def test_an_indentation_is_described_in_the_words_of_the_command_line(softcover):
    """Uses the store that all tests share, so that the indentation is solved once for all of them."""
    press = ("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "500g", "--model", "fem", "--json")
    assert softcover(*press)[0] == 0
    balls = [line for line in softcover("store", "list")[1].splitlines() if "sphere:radius=5mm" in line]
    assert any("4.903 N" in line for line in balls)
    assert softcover("store", "verify")[0] == 0


def test_verify_names_the_damaged_entry(filled):
    assert filled("store", "verify")[0] == 0
    assert json.loads(filled("store", "verify", "--json")[1])["damaged"] == []
    path = damage(3)
    status, out, err = filled("store", "verify")
    assert status == 1
    assert out.splitlines()[0].startswith(f"{path}: has ")
    assert out.endswith(" checked, 1 damaged\n")
    assert "removed by `softcover store prune`" in err
    status, out, err = filled("store", "verify", "--json")
    assert (status, err) == (1, "")
    assert [entry["path"] for entry in json.loads(out)["damaged"]] == [str(path)]


@pytest.mark.parametrize(
    ("options", "left"),
    [
        ([], [1, 3, 4]),
        (["--older-than", "2d"], [0, 1]),
        (["--older-than", "2d", "--other-code"], [0, 1, 3, 4]),
        (["--keep-latest", "3"], [0, 1, 2]),
        (["--keep-latest", "0"], []),
        (["--all"], []),
    ],
)
def test_prune_removes_what_the_options_choose_and_says_so(filled, options, left):
    gone = [number for number in range(5) if number not in left]
    dry = json.loads(filled("store", "prune", *options, "--dry-run", "--json")[1])
    assert (dry["dry_run"], numbers(dry["removed"]), stored()) == (True, gone, [0, 1, 2, 3, 4])
    status, out, _ = filled("store", "prune", *options)
    assert status == 0
    assert stored() == left
    assert [int(line.split()[0], 16) for line in out.splitlines()[:-1]] == [0] * len(gone)
    assert f"{len(gone)} entr" in out.splitlines()[-1]
    assert f"{len(left)} kept" in out.splitlines()[-1]


def test_prune_always_removes_damaged_entries_and_unfinished_files(filled):
    damage(0)
    (result_store.folder() / ".softcover-partial-left").touch()
    (result_store.folder() / "notes.txt").write_text("mine")
    out = filled("store", "prune", "--older-than", "30d")[1]
    assert stored() == [1, 2, 3, 4]
    assert "damaged" in out
    assert "1 unfinished file" in out
    assert (result_store.folder() / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("action", ["list", "verify", "prune"])
def test_a_file_in_place_of_the_store_is_refused(softcover, tmp_path, monkeypatch, action):
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setenv("SOFTCOVER_STORE", str(file))
    status, out, err = softcover("store", action)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert err.startswith(f"softcover: {file}: Not a directory; a file stands where a folder is needed")
