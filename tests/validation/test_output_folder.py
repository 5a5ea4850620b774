import os
import time

import pytest

from validation.errors import InputError
from validation.output_folder import new_folder, write_text


def test_folder_appears_only_when_finished(tmp_path):
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "out").exists()
    assert (tmp_path / "out" / "a").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def fail_halfway(target):
    with new_folder(target) as folder:
        (folder / "a").write_text("2")
        {}["worker"]


def test_failure_leaves_the_earlier_result_and_nothing_else(tmp_path):
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
    with pytest.raises(KeyError):
        fail_halfway(tmp_path / "out")
    assert (tmp_path / "out" / "a").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_earlier_result_is_replaced_whole(tmp_path):
    for name in ("a", "b"):
        with new_folder(tmp_path / "out") as folder:
            (folder / name).write_text("1")
    assert not (tmp_path / "out" / "a").exists()
    assert (tmp_path / "out" / "b").exists()


def test_folder_with_other_files_is_never_touched(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds files that softcover did not write"), new_folder(tmp_path):
        pass
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_file_is_no_folder(tmp_path):
    (tmp_path / "out").write_text("x")
    with pytest.raises(InputError, match="is a file"), new_folder(tmp_path / "out"):
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
