import os
import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.errors import InputError
from validation.output_folder import make_file_name, new_folder, write_text


def fail_halfway(target):
    with new_folder(target) as folder:
        (folder / "a").write_text("2")
        {}["worker"]


def test_a_folder_appears_when_finished_and_a_failure_leaves_the_earlier_result_and_nothing_else(tmp_path):
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "out").exists()
    with pytest.raises(KeyError):
        fail_halfway(tmp_path / "out")
    assert (tmp_path / "out" / "a").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_file_or_a_link_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path)
    for name in ("file", "link"):
        with pytest.raises(InputError, match=f"is a {name}"), new_folder(tmp_path / name):
            pass


def test_text_is_whole_or_absent(tmp_path):
    write_text(tmp_path / "a.txt", "whole")
    assert (tmp_path / "a.txt").read_text() == "whole"
    (tmp_path / "d").mkdir()
    with pytest.raises(OSError, match="d"):
        write_text(tmp_path / "d", "a folder stands in the way")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "d"]


def test_leftovers_of_a_killed_run_are_swept_and_nothing_else(tmp_path):
    for name, age, marked in (("old", 2, True), ("young", 0, True), ("foreign", 2, False)):
        left = tmp_path / f".out-{name}"
        (left / "out").mkdir(parents=True)
        if marked:
            (left / "out" / ".softcover-output").touch()
        os.utime(left, (time.time() - age * 86400,) * 2)
    with new_folder(tmp_path / "out"):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == [".out-foreign", ".out-young", "out"]


def write_result(target):
    with new_folder(target) as folder:
        (folder / "sub").mkdir()
        (folder / "sub" / "a").write_text("1")


def add_file(out):
    (out / "thesis.tex").write_text("mine")


def add_folder(out):
    (out / "mine").mkdir()


def change(out):
    (out / "sub" / "a").write_text("2")


def link(out):
    (out / "sub" / "a").unlink()
    (out / "sub" / "a").symlink_to("/etc/hostname")


def forget(out):
    (out / ".softcover-output").write_text("")


def spoil(out):
    (out / ".softcover-output").write_text("[" * 100_000)


@pytest.mark.parametrize("meddle", [add_file, add_folder, change, link, forget, spoil])
def test_a_folder_that_somebody_touched_is_not_replaced(tmp_path, meddle):
    out = tmp_path / "out"
    write_result(out)
    meddle(out)
    before = sorted(out.rglob("*"))
    with pytest.raises(InputError, match=r"--out: .*name a new or an empty folder"):
        write_result(out)
    assert sorted(out.rglob("*")) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_files_added_during_the_computation_stay(tmp_path):
    write_result(tmp_path / "out")
    with pytest.raises(InputError, match=r"thesis\.tex"), new_folder(tmp_path / "out"):
        add_file(tmp_path / "out")
    assert (tmp_path / "out" / "thesis.tex").read_text() == "mine"


def test_a_result_is_replaced_after_the_user_removed_parts_of_it(tmp_path):
    write_result(tmp_path / "out")
    (tmp_path / "out" / "sub" / "a").unlink()
    (tmp_path / "out" / "sub").rmdir()
    write_result(tmp_path / "out")
    assert (tmp_path / "out" / "sub" / "a").read_text() == "1"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("wts-0614-34", "wts-0614-34.xml"),
        ("../../escaped", "escaped.xml"),
        ("/etc/passwd", "etc-passwd.xml"),
        ("a\\b:c\n\x1b[31md\0e", "a-b-c-31md-e.xml"),
        ("..", "sensor.xml"),
        ("NUL.tar", "sensor-NUL.tar.xml"),
        ("\u0444\u0438\u043d\u0433\u0435\u0440", "sensor.xml"),
    ],
)
def test_file_names_are_made_by_a_strict_rule(name, expected):
    assert make_file_name(name, suffix=".xml") == expected


@given(name=st.text())
def test_no_name_leads_out_of_the_folder(name):
    assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,80}\.xml", make_file_name(name, suffix=".xml"))


def test_a_large_folder_of_the_user_is_refused_at_its_first_file(tmp_path, monkeypatch):
    """`--out /` names a file in it at once, before folders that cannot be read."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "deep").touch()
    (tmp_path / "z").write_text("mine")
    listed = []
    original = os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: listed.append(path) or original(path))
    with pytest.raises(InputError, match="holds z, which softcover did not write"), new_folder(tmp_path):
        pass
    assert len(listed) == 1
