"""A replacement of a folder or a file that stops at any line leaves the earlier content or the new one."""

import dataclasses
import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fastmodel
from fastmodel import parameters
from meshes import atomic_file
from validation import output_folder
from validation.errors import InputError

#: Files whose lines are the steps, and a function of another file.
SOURCES = {output_folder.__file__, atomic_file.__file__}
PAIR = (parameters.__file__, "_replace_pair")
#: More lines than a replacement runs through.
MOST_STEPS = 1000


def write_folder(place, text):
    with output_folder.new_folder(place / "out") as folder:
        (folder / "a").write_text(text)
        (folder / "b").write_text(text)


def write_file(place, text):
    atomic_file.replace(place / "out", [text.encode()])


def write_pair(place, text):
    """Save parameters as two files, of which one states the hash of the other; both depend on the text."""
    given = fastmodel.load("wts-0614-34")
    electronics = dataclasses.replace(given.electronics, gains=np.full(given.array.count, float(sum(map(ord, text)))))
    array = dataclasses.replace(given.array, name=text)
    dataclasses.replace(given, array=array, electronics=electronics).save(place / "out")


def read(place):
    """Return the contents at the target; empty if there is none."""
    path = place / "out"
    if (path / "parameters.toml").exists():
        found = fastmodel.load(path)
        return {found.array.name} if set(found.electronics.gains) == {sum(map(ord, found.array.name))} else {"mixed"}
    return {path.read_text()} if path.is_file() else {path.joinpath(name).read_text() for name in "ab" if path.exists()}


def stop_at(step, action, write, place):
    """Replace the content and call `action` at the given line; return whether that line was reached."""
    count = itertools.count()
    reached = []

    def trace(frame, event, argument):
        del argument
        code = frame.f_code
        if code.co_filename not in SOURCES and (code.co_filename, code.co_name) != PAIR:
            return None
        if event == "line" and not reached and next(count) == step:
            reached.append(True)
            action()
        return trace

    earlier = sys.gettrace()
    sys.settrace(trace)
    try:
        write(place, "new")
    finally:
        sys.settrace(earlier)
    return bool(reached)


def fail(kind):
    raise kind("planted")


def end_child():
    os.kill(os.getpid(), signal.SIGKILL)


def kill_at(step, write, place):
    """Replace the content in a process that is killed at the given line; return whether that line was reached."""
    child = os.fork()
    if child == 0:
        try:
            stop_at(step, end_child, write, place)
        finally:
            os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


#: Ways to replace a folder, and to replace a file.
WAYS = [
    ("exchange", "write_folder"),
    ("two renames", "write_folder"),
    ("one rename", "write_file"),
    pytest.param("two files", "write_pair", marks=pytest.mark.slow),
]


@pytest.mark.parametrize("kind", [pytest.param(OSError, marks=pytest.mark.slow), KeyboardInterrupt])
@pytest.mark.parametrize(("way", "name"), WAYS)
def test_a_fault_at_any_step_keeps_the_earlier_or_the_new_content(way, name, kind, tmp_path, monkeypatch):
    if way == "two renames":
        monkeypatch.setattr(output_folder, "_exchange", lambda _one, _other: False)
    write = globals()[name]
    seen = set()
    for step in range(MOST_STEPS):
        place = tmp_path / str(step)
        place.mkdir()
        write(place, "old")
        try:
            if not stop_at(step, lambda: fail(kind), write, place):
                break
        except (kind, InputError):  # a manifest that cannot be read protects its folder
            pass
        assert read(place) in ({"old"}, {"new"}), (way, step)
        seen |= read(place)
    assert step > 20
    assert seen == {"old", "new"}


def check_kills(way, write, folder):
    """Kill a replacement at each of its lines, and look at what is there afterwards."""
    os.fsync = lambda _handle: None  # what only the loss of power needs takes most of the time
    if way == "two renames":
        output_folder._exchange = lambda _one, _other: False
    for step in range(MOST_STEPS):
        place = Path(folder) / str(step)
        place.mkdir()
        write(place, "old")
        if not kill_at(step, write, place):
            break
        if way == "two renames" and write is write_folder and not read(place):
            with pytest.raises(KeyboardInterrupt), output_folder.new_folder(place / "out"):
                raise KeyboardInterrupt  # the next run restores the earlier output before it computes
            assert read(place) == {"old"}
        assert read(place) in ({"old"}, {"new"}), (way, step)
        write(place, "last")
        assert read(place) == {"last"}
    assert step > 20


def check_all_kills(folder):
    exchange = output_folder._exchange
    for number, given in enumerate(WAYS):
        way, name = getattr(given, "values", given)
        output_folder._exchange = exchange
        place = Path(folder) / str(number)
        place.mkdir()
        check_kills(way, globals()[name], place)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a forked process")
def test_a_kill_at_any_step_keeps_the_earlier_or_the_new_content(tmp_path):
    """In a process of its own, because to fork the large one of the tests takes long."""
    code = f"import tests.test_replacement as t; t.check_all_kills({str(tmp_path)!r})"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[1])  # noqa: S603 -- ours


def test_an_earlier_output_that_cannot_be_put_back_is_not_deleted(tmp_path, monkeypatch):
    write_folder(tmp_path, "old")
    monkeypatch.setattr(output_folder, "_exchange", lambda _one, _other: False)
    rename = Path.rename

    def once(self, target):
        if Path(target).name == "out":
            raise OSError(5, "planted")
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", once)
        with pytest.raises(OSError, match="planted"):
            write_folder(tmp_path, "new")
    assert not read(tmp_path)
    with pytest.raises(KeyboardInterrupt), output_folder.new_folder(tmp_path / "out"):
        raise KeyboardInterrupt
    assert read(tmp_path) == {"old"}
