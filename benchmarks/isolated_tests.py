"""Runs of some tests in a copy of the repository, each run in a forked process of its own.

The parent has imported the large packages that this repository depends on, but nothing of the repository, so a run
starts in a fraction of a second.  Time limits count processor time, so that a busy machine does not change results.
"""

from __future__ import annotations

import contextlib
import fcntl
import importlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation")
#: Packages that most tests need, loaded before the processes fork.
_LARGE = (
    *("numpy", "scipy.fft", "scipy.integrate", "scipy.interpolate", "scipy.ndimage", "scipy.optimize", "scipy.signal"),
    *("scipy.sparse.linalg", "scipy.spatial", "scipy.special", "scipy.stats", "skfem", "numba.extending", "mujoco"),
    *("pydantic", "pint", "cyclopts", "rich.console", "hypothesis.strategies", "tomli_w", "trimesh", "jinja2"),
    *("xdist", "coverage"),
)
#: A test may take this many times the processor time that it takes without a mutant, plus a constant [s].
FACTOR, CONSTANT = 10.0, 15.0
#: Further time for fixtures, which the test that comes first computes for all others [s].
SHARED = 60.0
#: Limit for a whole run, as it may also wait for something for ever [s, wall].
WALL = 300.0
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "CI": "1"}


@cache
def preload() -> None:
    """Import the large packages; `CI` makes Hypothesis try the same examples on every run."""
    os.environ.update(_ENVIRONMENT)
    for name in _LARGE:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


@contextlib.contextmanager
def copied_tree(*, compiled: Path | None = None) -> Iterator[Path]:
    """Copy the repository into a folder that no other process uses, and remove the copy at the end.

    The paths of copies repeat, because numba finds the kernels that it kept by the path of their source.

    Args:
        compiled: Folder for compiled kernels; one that all copies at this path share by default.
    """
    base = Path(tempfile.gettempdir()) / f"softcover-copies-{os.getuid()}"
    base.mkdir(exist_ok=True)
    for number in range(64):
        slot = base / str(number)
        slot.mkdir(exist_ok=True)
        with (slot / "lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            tree = slot / "tree"
            shutil.rmtree(tree, ignore_errors=True)
            skip = shutil.ignore_patterns(".git", ".venv", ".hypothesis", ".*_cache", "build", "dist")
            shutil.copytree(ROOT, tree, ignore=skip)
            for name in ("kernels", "store"):
                (slot / name).mkdir(exist_ok=True)
            os.environ["NUMBA_CACHE_DIR"] = str(compiled or slot / "kernels")
            try:
                yield tree
            finally:
                shutil.rmtree(tree, ignore_errors=True)
            return
    message = "all folders for copies are in use"
    raise RuntimeError(message)


class KeptStore:
    """Pytest plug-in: tests read finite-element results that earlier tests stored.

    Their keys hold a hash of the code, so no result of other code is read.  What tests write beside the store, such as
    the results of `tests/support/compute_once.py`, is removed with the copy: those would be results of other code.
    """

    def __init__(self, tree: Path) -> None:
        self._folder = tree / "temporary" / "kept" / "store"
        self._folder.parent.mkdir(exist_ok=True)
        if not self._folder.exists():
            self._folder.symlink_to(tree.parent / "store", target_is_directory=True)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Iterator[None]:
        """Set the folder of the store after the tests have chosen an empty one."""
        result = yield
        if fixturedef.argname == "_own_store":  # the fixture of tests/conftest.py that chooses an empty store
            os.environ["SOFTCOVER_STORE"] = str(self._folder)
        return result


class _Clock:
    """Pytest plug-in: reports each test as it starts and ends, and limits its processor time."""

    def __init__(self, write: Callable[[dict[str, Any]], None], seconds: dict[str, float], extra: float) -> None:
        self._write, self._seconds, self._extra = write, seconds, extra

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._write({"test": item.nodeid})
        signal.setitimer(signal.ITIMER_PROF, self._limit(item) + SHARED)
        result = yield
        signal.setitimer(signal.ITIMER_PROF, 0)
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        signal.setitimer(signal.ITIMER_PROF, self._limit(item))
        return (yield)

    def _limit(self, item: pytest.Item) -> float:
        """Return the longest processor time of a test without its fixtures [s]."""
        return FACTOR * self._seconds.get(item.nodeid, 10 * CONSTANT) + CONSTANT + self._extra

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._write({"failed": report.nodeid, "text": str(report.longrepr)[-2000:]})


def run_tests(
    tree: Path, batches: list[list[str]], seconds: dict[str, float], *, extra: float = 0.0
) -> dict[str, str | float]:
    """Run tests of a copy of the repository up to the first failure.

    Args:
        tree: The copy.
        batches: Identifiers of tests; each batch is collected only when those before have passed.
        seconds: Processor time of tests without a mutant [s].
        extra: Further processor time that a test may take, to compile kernels [s].

    Returns:
        `outcome` ("passed", "failed" or "time"), `test` that decided, end of its message as `text`, `cpu` time [s].
    """

    def work(write: Callable[[dict[str, Any]], None]) -> None:
        signal.setitimer(signal.ITIMER_PROF, 4 * CONSTANT + extra)  # importing and collecting
        store = KeptStore(tree)
        for batch in batches:
            clock = _Clock(write, seconds, extra)
            status = pytest.main([*PYTEST, "-x", *batch], plugins=[clock, store])
            if status == pytest.ExitCode.USAGE_ERROR:  # the mutant may have renamed a test: run the files
                status = pytest.main([*PYTEST, "-x", *dict.fromkeys(name.split("::")[0] for name in batch)],
                                     plugins=[clock, store])  # fmt: skip
            if status not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
                write({"status": int(status)})
                return
        write({"status": 0})

    lines, code, cpu = run_isolated(tree, work)
    current = next((line["test"] for line in reversed(lines) if "test" in line), "")
    failed = next((line for line in lines if "failed" in line), None)
    status = next((line["status"] for line in lines if "status" in line), None)
    found: dict[str, str | float] = {"test": current, "text": "", "cpu": round(cpu, 1)}
    if failed:
        return found | {"outcome": "failed", "test": failed["failed"], "text": failed["text"]}
    if status == 0:
        return found | {"outcome": "passed", "test": ""}
    return found | {"outcome": "time" if code in (-signal.SIGPROF, -signal.SIGKILL) else "failed"}


#: Options of every run of pytest.
PYTEST = ["-n", "0", "-q", "--no-header", "--no-summary", "--tb=short", "-p", "no:cacheprovider"]


def run_isolated(
    tree: Path, work: Callable[[Callable[[dict[str, Any]], None]], None]
) -> tuple[list[dict[str, Any]], int, float]:
    """Run a function in a forked process that finds the packages of the repository in a copy.

    Args:
        tree: The copy.
        work: The function; it is given a function that hands a JSON object back.

    Returns:
        Objects handed back, exit status (negative: the number of the signal) and processor time [s].
    """
    preload()
    results, log = tree.parent / "results", tree.parent / "log"
    results.write_text("")
    started = time.time()
    process = os.fork()
    if process == 0:
        status = 1
        try:
            os.setsid()
            _enter(tree, log)
            with results.open("a") as file:

                def write(found: dict[str, Any]) -> None:
                    file.write(json.dumps(found) + "\n")
                    file.flush()

                work(write)
            status = 0
        except BaseException:  # noqa: BLE001 -- nothing may pass into the code of the parent
            traceback.print_exc()
        finally:
            os._exit(status)
    while True:
        done, status, usage = os.wait4(process, os.WNOHANG)
        if done:
            break
        if time.time() - started > WALL:
            os.kill(process, signal.SIGKILL)
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):  # programs that tests left running
        os.killpg(process, signal.SIGKILL)
    lines = [json.loads(line) for line in results.read_text().splitlines() if line.endswith("}")]
    return lines, os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime


def _enter(tree: Path, log: Path) -> None:
    """Make the forked process work in a copy of the repository, and write its output to a file."""
    import numba

    output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.chdir(tree)
    os.environ["PYTHONPATH"] = str(tree)
    temporary = tree / "temporary"
    temporary.mkdir()
    os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
    numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
    here = Path(__file__).resolve().parent
    sys.path[:] = [str(tree), *(path for path in sys.path if path and Path(path).resolve() not in (ROOT, here))]
    assert not set(PACKAGES) & set(sys.modules), "the parent must not import the packages under test"
