"""The store under real processes: killed, out of space, several at once, without the right to write."""

import os
import random
import signal
import time

import numpy as np
import pytest

from fem_reference import result_store

resource = pytest.importorskip("resource", reason="needs a system with fork, signals and limits")

#: Large enough that a write takes a while.
_CONTENT = np.random.default_rng(0).random(60_000)
#: The real function, which other tests do without.
_FSYNC = os.fsync


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    monkeypatch.setattr(os, "fsync", _FSYNC)
    return tmp_path / "store"


def child(work):
    """Run `work` in another process; its number."""
    number = os.fork()
    if number:
        return number
    status = 1
    try:
        work()
        status = 0
    finally:
        os._exit(status)


def succeeded(number):
    return os.waitpid(number, 0)[1] == 0


def key(number):
    return f"{number:064x}"


def write_for_ever(first, finished):
    """Write entry after entry, and say through a pipe which ones are finished."""
    for number in range(first, first + 10_000):
        result_store.write(key(number), {"a": _CONTENT + number}, {"kind": "test"})
        os.write(finished, f"{number}\n".encode())


def await_new_file():
    """Return at the moment when a writer has begun a file."""
    before, given_up = set(result_store.folder().iterdir()), time.monotonic() + 1
    while not set(result_store.folder().iterdir()) - before and time.monotonic() < given_up:
        pass


def kill_writers(times):
    """Kill `times` writers at some time, when a file has begun, or after a finished one, in turn.

    Returns the finished entries and how many unfinished files were left.
    """
    result_store.folder().mkdir()
    random_delay = random.Random(0)  # noqa: S311 -- only spreads the kills
    finished, left = [], 0
    for turn in range(times):
        reader, writer = os.pipe()
        number = child(lambda turn=turn, writer=writer: write_for_ever(turn * 10_000, writer))
        os.close(writer)
        told = os.read(reader, 1 << 16) if turn % 3 == 2 else b""
        time.sleep(random_delay.uniform(0.002, 0.06))
        if turn % 3 == 1:
            await_new_file()
        os.kill(number, signal.SIGKILL)
        os.waitpid(number, 0)
        with os.fdopen(reader, "rb") as pipe:
            finished += [int(line) for line in (told + pipe.read()).split(b"\n")[:-1]]
        found = result_store.count_partial_files()
        left += found
        assert result_store.sweep_leftovers() == found
    return finished, left


def check_killed(times):
    finished, left = kill_writers(times)
    lost = [number for number in finished if result_store.read(key(number)) is None]
    torn = [entry.problem for entry in result_store.verify() if entry.problem]
    return finished, left, lost, torn


@pytest.mark.slow
@pytest.mark.parametrize("times", [12, pytest.param(80, marks=pytest.mark.bench)])
def test_killed_writers_tear_nothing_and_lose_nothing(folder, times):
    finished, left, lost, torn = check_killed(times)
    assert finished, "no writer got anything done: the test shows nothing"
    assert left >= times / 10, "hardly a kill hit a write: the test shows nothing"
    assert lost == []
    assert torn == []
    assert {path.suffix for path in folder.iterdir()} == {".entry"}


@pytest.mark.slow
def test_writers_at_once_never_show_a_reader_half_an_entry():
    """Three processes write the same entries with other contents while this one reads and sweeps."""

    def work(offset):
        for turn in range(20):
            for number in range(3):
                values = np.full(50_000, float(offset * 1000 + turn))
                result_store.write(key(number), {"a": values, "b": values + 1}, {"kind": "test"})

    for number in range(3):
        result_store.write(key(number), {"a": np.zeros(1), "b": np.ones(1)}, {"kind": "test"})
    running, status = {child(lambda offset=offset: work(offset)) for offset in range(3)}, []
    while running:
        for number in range(3):
            found = result_store.read(key(number))
            assert found is not None
            assert (found["a"] + 1 == found["b"]).all()
            assert np.ptp(found["a"]) == 0
        result_store.sweep_leftovers()  # may take a file before its writer has locked it, who then makes another
        for writer in list(running):
            ended, result = os.waitpid(writer, os.WNOHANG)
            if ended:
                running.remove(writer)
                status.append(result)
    assert status == [0, 0, 0]
    assert [entry.problem for entry in result_store.verify()] == [""] * 3


def test_two_processes_ask_for_the_same_result():
    def ask():
        found = result_store.fetch("test", {"x": 1.0}, lambda: {"a": np.arange(1000.0)})
        assert (found["a"] == np.arange(1000.0)).all()

    assert {succeeded(number) for number in [child(ask) for _ in range(4)]} == {True}
    assert len(result_store.verify()) == 1
