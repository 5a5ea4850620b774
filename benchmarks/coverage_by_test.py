"""Which test of the default tier runs which lines, and how long it takes.

Each file of tests runs in a process of its own with coverage.py, whose context is the test.  Lines of fixtures that
several tests share count for each of them.  Lines in compiled kernels are not seen.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import coverage
import pytest
from isolated_tests import PACKAGES, PYTEST, ROOT, KeptStore, copied_tree, preload, run_isolated
from resumable import Record, hash_code, read_records

#: Files whose tests read the sources as text, so that they notice changes that change no behaviour.
_READERS = ("test_house.py", "test_imports.py", "test_dependencies.py", "test_documents.py", "test_base_install.py")
TEST_FILES = tuple(
    file.relative_to(ROOT).as_posix()
    for file in sorted((ROOT / "tests").rglob("test_*.py"))
    if file.name not in _READERS
)


class _Contexts:
    """Pytest plug-in: one context per test and per shared fixture, and the processor time of each test."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self._measured, self._names = measured, [""]
        self.tests: dict[str, dict[str, Any]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._names = [item.nodeid]
        self._measured.switch_context(item.nodeid)
        started = sum(os.times()[:4])
        result = yield
        used = sum(os.times()[:4]) - started
        found = self.tests.setdefault(item.nodeid, {"passed": False})
        found |= {"seconds": round(used, 2), "fixtures": list(getattr(item, "fixturenames", ()))}
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        self._names.append(f"fixture {fixturedef.argname}")
        self._measured.switch_context(self._names[-1])
        try:
            return (yield)
        finally:
            self._names.pop()
            self._measured.switch_context(self._names[-1])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            self.tests[report.nodeid] = {"passed": report.passed}


def _measure(file: str, tree: Path, write: Callable[[dict[str, Any]], None]) -> None:
    """Run one file of tests, and hand back its tests with the lines that they run as bits of a number."""
    measured = coverage.Coverage(data_file=None, source=[str(tree / name) for name in PACKAGES], config_file=False)
    measured.start()
    contexts = _Contexts(measured)
    pytest.main([*PYTEST, file], plugins=[contexts, KeptStore(tree)])
    measured.stop()
    data = measured.get_data()
    shared: dict[str, dict[str, int]] = {}
    for path in data.measured_files():
        name = Path(path).relative_to(tree).as_posix()
        for line, tests in data.contexts_by_lineno(path).items():
            for test in tests:
                lines = shared.setdefault(test, {})
                lines[name] = lines.get(name, 0) | 1 << line
    tests = {}
    for test, found in contexts.tests.items():
        if found.get("passed") and "seconds" in found:
            lines = dict(shared.get(test, {}))
            for fixture in found["fixtures"]:
                for name, bits in shared.get(f"fixture {fixture}", {}).items():
                    lines[name] = lines.get(name, 0) | bits
            tests[test] = [found["seconds"], {name: f"{bits:x}" for name, bits in lines.items()}]
    write({"tests": tests, "left_out": [test for test, found in contexts.tests.items() if not found.get("passed")]})


@cache
def hash_tests(file: str) -> str:
    """Hash a file of tests together with what all tests share."""
    tests = ROOT / "tests"
    shared = [*tests.rglob("conftest.py"), *(tests / "support").rglob("*.py"), ROOT / file]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(shared))).hexdigest()[:10]


def measure_file(_seed: int, number: int, *, lines: Path) -> Record:
    """Measure the tests of one file, unless a record of the same sources exists; see `resumable.run_cases`.

    Args:
        number: Number of the file in `TEST_FILES`.
        lines: File of JSON lines that may hold such a record.
    """
    file = TEST_FILES[number]
    key = hash_code(*PACKAGES) + hash_tests(file)
    for record in read_records(lines):
        if record["key"] == key:
            return {name: record[name] for name in ("file", "key", "cpu", "tests", "left_out")}
    preload()
    with copied_tree() as tree:
        found, status, cpu = run_isolated(tree, partial(_measure, file, tree))
    record = found[-1] if found else {"tests": {}, "left_out": [f"the whole file: exit status {status}"]}
    return {"file": file, "key": key, "cpu": round(cpu, 1)} | record
