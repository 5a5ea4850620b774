"""Mutation score of the default tests: the share of small changes of the code that a test notices.

    python benchmarks/mutation_score.py --cases 150 --seed 21
    python benchmarks/mutation_score.py --cases 150 --seed 21 --paths fem_reference fastmodel validation/metrics.py
    python benchmarks/mutation_score.py --parts --cases 40

A seeded sample is drawn from all mutants (`mutants.py`) of the named folders and files.  First the default tests run
once under coverage.py, whose contexts are the tests.  Then each mutant is planted in a copy of the repository, and the
tests that run its line run there up to the first failure: those of its package first, each kind fastest first, up to a
budget of time.  Lines that coverage does not see, in compiled kernels and outside functions, are found through the
lines that use their names.  A run that exceeds its time limit counts as noticed.  Finished mutants are kept in a file
of JSON lines, and a second run of the same code goes on from there.

With `--parts` each of nine parts of the product is sampled.  The default seed is the first eight hexadecimal digits of
the commit: nobody chooses it, and a commit has one score.

Neither mutmut nor cosmic-ray fits: mutmut 3 leaves decorated functions out and chooses among its mutants inside the
process, where numba has compiled one; cosmic-ray changes the files of the tree itself and runs one fixed command.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from keyword import iskeyword
from pathlib import Path
from queue import Queue
from typing import Any

import coverage
import pytest
from mutants import Mutant, find_mutants

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation", "benchmarks/tactilebench/tactilebench")
#: Parts of the product that are scored one by one, and the folders and files of each.
PARTS = {
    "reference, flat": (
        "fem_reference/closed_form", "fem_reference/elements", "fem_reference/fields", "fem_reference/finite_strain",
        "fem_reference/indentation", "fem_reference/linear_response", "fem_reference/small_strain_contact",
    ),
    "reference, curved": (
        "fem_reference/curved_cover", "meshes/solids", "meshes/surfaces", "validation/cover_meshes.py",
    ),
    "fast model": ("fastmodel/contact", "fastmodel/pressure", "fastmodel/fitting", "fastmodel/attachment.py"),
    "signal": ("fastmodel/signal", "fastmodel/sensors", "fastmodel/parameters.py", "fastmodel/sensor.py"),
    "calibration, recordings": (
        "validation/calibration", "validation/recordings", "validation/data_sets", "validation/weiss",
        "validation/measured_force",
    ),
    "campaign, verdict": (
        "validation/campaign", "validation/credibility", "validation/verdict.py", "validation/resolution",
    ),
    "published models": ("validation/published", "validation/regression", "validation/sweeps"),
    "exports, data sheet": (
        "validation/simulator_models.py", "validation/simulator_values", "validation/data_sheet.py",
        "validation/press_files.py", "fastmodel/adapters", "benchmarks/tactilebench/tactilebench",
    ),
    "report": ("validation/report", "validation/render", "validation/scene", "validation/text"),
}  # fmt: skip
#: Files of tests that read the sources as text, so that they notice changes that change no behaviour.
READERS = ("test_house.py", "test_imports.py", "test_dependencies.py", "test_documents.py", "test_base_install.py")
#: Tests that run against one mutant take at most this processor time without it [s].
BUDGET = 30.0
#: A run may take this many times as long as its tests without a mutant, plus a constant for imports and kernels [s].
FACTOR, CONSTANT = 10.0, 180.0
#: Number of steps from a name to the names of the functions that use it.
STEPS = 4
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "CI": "1"}


@cache
def read_sources() -> dict[str, str]:
    """Read the sources of the packages by their path."""
    files = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return {file.relative_to(ROOT).as_posix(): file.read_text() for file in files}


def copy_tree(folder: Path) -> Path:
    """Copy the repository without what only stands in the way."""
    skip = shutil.ignore_patterns(".git", ".venv", ".hypothesis", ".*_cache", "build", "dist")
    return Path(shutil.copytree(ROOT, folder / "tree", ignore=skip))


def prepare_tree(folder: Path) -> Path:
    """Return a copy of the repository that is kept in a folder, with the kernels compiled in it, as it was copied."""
    tree = folder / "tree"
    if not tree.exists():
        shutil.rmtree(folder / "new", ignore_errors=True)  # A run that was stopped may have left a part of a copy.
        copy_tree(folder / "new").rename(tree)
    for path, text in read_sources().items():
        if (tree / path).read_text() != text:
            (tree / path).write_text(text)
    return tree


def run_python(tree: Path, arguments: list[str], seconds: float | None = None) -> int:
    """Run Python in a copy of the repository; raises `subprocess.TimeoutExpired` after a time."""
    environment = os.environ | ONE_THREAD | {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(tree.parent / "kernels")}
    command, quiet = [sys.executable, *arguments], subprocess.DEVNULL
    done = subprocess.run(command, cwd=tree, env=environment, check=False, timeout=seconds, stdout=quiet, stderr=quiet)
    return done.returncode


class _Contexts:
    """Pytest plug-in: one context of coverage.py per test and per shared fixture, and the time of each test.

    The time is that of the processor, so that other programs do not change which tests fit into the budget.
    """

    def __init__(self, measured: coverage.Coverage) -> None:
        self._measured, self._names = measured, [""]
        self.tests: dict[str, dict[str, Any]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._names = [item.nodeid]
        self._measured.switch_context(item.nodeid)
        started = sum(os.times()[:4])
        result = yield
        found = self.tests.setdefault(item.nodeid, {"passed": False})
        found |= {"seconds": sum(os.times()[:4]) - started, "fixtures": list(getattr(item, "fixturenames", ()))}
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Iterator[None]:
        self._names.append(self._names[-1] if fixturedef.scope == "function" else f"fixture {fixturedef.argname}")
        self._measured.switch_context(self._names[-1])
        try:
            return (yield)
        finally:
            self._names.pop()
            self._measured.switch_context(self._names[-1])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            self.tests[report.nodeid] = {"passed": report.passed}


def measure(folder: Path, tests: list[str]) -> None:
    """Run tests under coverage.py in this process, and write what runs which lines into a folder."""
    measured = coverage.Coverage(data_file=str(folder / "coverage"), source=list(PACKAGES), config_file=False)
    measured.start()
    contexts = _Contexts(measured)
    options = ["-q", "-n", "0", "-p", "no:cacheprovider", *[f"--ignore=tests/{name}" for name in READERS]]
    pytest.main([*options, *tests], plugins=[contexts])
    measured.stop()
    measured.save()
    passed = {name: found for name, found in contexts.tests.items() if found["passed"] and "seconds" in found}
    (folder / "tests.json").write_text(json.dumps({"root": str(ROOT), "tests": passed}))


class Coverage:
    """Which tests run which lines, and how long they take.

    Attributes:
        seconds: Time of each test [s].
    """

    def __init__(self, folder: Path, tests: list[str]) -> None:
        """Run the tests under coverage in a folder, unless it holds the record of an earlier run."""
        if not (folder / "tests.json").exists():
            with tempfile.TemporaryDirectory() as place:
                tree = copy_tree(Path(place))
                run_python(tree, [f"{tree}/benchmarks/mutation_score.py", "--measure", str(folder), "--tests", *tests])
        known = json.loads((folder / "tests.json").read_text())
        self._root, self._tests = known["root"], known["tests"]
        self._data = coverage.CoverageData(str(folder / "coverage"))
        self._data.read()
        self.seconds = {name: found["seconds"] for name, found in self._tests.items()}
        self._lines: dict[str, dict[int, list[str]]] = {}

    def cover(self, path: str, lines: tuple[int, ...]) -> set[str]:
        """Return the tests that run any of some lines of a file, themselves or by a fixture that they share."""
        if path not in self._lines:
            self._lines[path] = self._data.contexts_by_lineno(f"{self._root}/{path}")
        names = {name for line in lines for name in self._lines[path].get(line, ())}
        shared = {name.removeprefix("fixture ") for name in names if name.startswith("fixture ")}
        users = {name for name, found in self._tests.items() if shared & set(found["fixtures"])} if shared else set()
        return users | names & set(self.seconds)

    def choose(self, mutant: Mutant) -> list[str]:
        """Return tests that may notice a mutant within the budget: its package's first, each kind fastest first."""
        found = self.cover(mutant.path, mutant.lines) if mutant.runs else set()
        if not found or is_compiled(mutant.path):
            found |= self._find_users(mutant.owner)
        chosen, used = [], 0.0
        near = (f"tests/{mutant.path.split('/', maxsplit=1)[0]}/", "tests/verification/")
        for name in sorted(found, key=lambda name: (not name.startswith(near), self.seconds[name], name)):
            used += self.seconds[name]
            if used <= BUDGET or not chosen:
                chosen.append(name)
        return chosen

    def _find_users(self, owner: str) -> set[str]:
        """Find tests of lines that use a function, class or constant, directly or through what no test covers."""
        found: set[str] = set()
        names, seen = {owner}, {"", "__init__", "__post_init__"}
        for _ in range(STEPS):
            further: set[str] = set()
            for name in names - seen:
                for path, line, user, runs in find_uses(name):
                    # A line outside functions runs in whichever test loads the file first.
                    tests = self.cover(path, (line,)) if runs else set()
                    found |= tests
                    # Tests that run a kernel as Python may be few, and compare it with itself.
                    further |= set() if tests and not is_compiled(path) else {user}
            seen |= names
            names = further
        return found


@cache
def find_uses(name: str) -> list[tuple[str, int, str, bool]]:
    """Find the lines that use a name: path, line, function, class or constant, and whether it is a function."""
    found = []
    for path, source in read_sources().items():
        owner, runs = "", False
        for number, line in enumerate(source.splitlines() if name in source else (), start=1):
            if start := re.match(r"\s*def (\w+)", line):
                owner, runs = start[1], True
            elif line and not line[0].isspace() and line[0] not in ")@":
                start = re.match(r"(?:class )?(\w+)\s*[:=(]", line)
                owner, runs = start[1] if start and not iskeyword(start[1]) else "", False
            if owner != name and re.search(rf"\b{name}\b", line):
                found.append((path, number, owner, runs))
    return found


@cache
def is_compiled(path: str) -> bool:
    """Whether numba compiles functions of a file, or of a file that imports it."""
    module = path.removesuffix(".py").replace("/", ".")
    compiled = [source for source in read_sources().values() if re.search(r"called_by_kernels|numba\.njit", source)]
    return read_sources()[path] in compiled or any(f"from {module} import" in source for source in compiled)


def try_mutant(mutant: Mutant, known: Coverage, tree: Path) -> dict[str, Any]:
    """Run the tests chosen for a mutant in a copy of the repository, and mend the copy."""
    source = read_sources()[mutant.path]
    changed = mutant.apply(source)
    before, after = (text.splitlines()[mutant.line - 1].strip() for text in (source, changed))
    record = {"path": mutant.path, "line": mutant.line, "before": before, "after": after, "outcome": "no test"}
    tests = known.choose(mutant)
    if tests:
        (tree / mutant.path).write_text(changed)
        try:
            limit = FACTOR * sum(known.seconds[name] for name in tests) + CONSTANT
            command = ["-m", "pytest", "-q", "-n", "0", "-x", "-p", "no:cacheprovider", *tests]
            record["outcome"] = "failed" if run_python(tree, command, limit) else "passed"
        except subprocess.TimeoutExpired:
            record["outcome"] = "time"
        finally:
            (tree / mutant.path).write_text(source)
    return record


def make_row(name: str, records: list[dict[str, Any]]) -> str:
    """Make a row of the table: counts, score and its 95 % interval after Wilson."""
    from scipy.stats import binomtest

    counts = [sum(record["outcome"] == each for record in records) for each in ("failed", "time", "passed", "no test")]
    cells = [name, str(len(records)), *map(str, counts)]
    if not records:
        return f"| {' | '.join(cells)} | - | - |"
    noticed = counts[0] + counts[1]
    low, high = binomtest(noticed, len(records)).proportion_ci(0.95, method="wilson")
    score = f"{100 * noticed / len(records):.1f} % | {100 * low:.1f}..{100 * high:.1f} %"
    return f"| {' | '.join(cells)} | {score} |"


def write_score(records: list[dict[str, Any]], rows: dict[str, tuple[str, ...]]) -> str:
    """Write the table by package or part, and the survivors as differences: some may change nothing."""
    lines = ["| package | mutants | failed | time | survived | no test | score | 95 % interval |", "|---" * 8 + "|"]
    lines += [make_row(name, [r for r in records if r["path"].startswith(paths)]) for name, paths in rows.items()]
    lines += [make_row("all", records), ""]
    for record in records:
        if record["outcome"] in ("passed", "no test"):
            head = f"{record['path']}:{record['line']} ({record['outcome']})"
            lines += [head, f"    - {record['before']}", f"    + {record['after']}"]
    return "\n".join(lines)


def read_seed() -> int:
    """Return the first eight hexadecimal digits of the commit as a number."""
    command = ["git", "rev-parse", "--short=8", "HEAD"]
    return int(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout[:8], 16)


def score(known: Coverage, folder: Path, paths: tuple[str, ...], given: argparse.Namespace) -> list[dict[str, Any]]:
    """Try a sample of the mutants of some paths, or go on with it, and return the records in the order drawn."""
    mutants = [each for each in find_mutants(ROOT, PACKAGES) if each.path.startswith(paths)]
    random.Random(given.seed).shuffle(mutants)  # noqa: S311 -- no secret
    kept = folder / f"{given.seed}-{hashlib.sha256(' '.join(paths).encode()).hexdigest()[:6]}.jsonl"
    records = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = {record["number"] for record in records}
    left = [number for number in range(min(given.cases, len(mutants))) if number not in done]
    with kept.open("a") as file, ThreadPoolExecutor(given.processes) as pool:
        trees: Queue[Path] = Queue()
        for number in range(given.processes):
            trees.put(prepare_tree(folder / str(number)))

        def work(number: int) -> dict[str, Any]:
            tree = trees.get()
            try:
                return {"number": number} | try_mutant(mutants[number], known, tree)
            finally:
                trees.put(tree)

        for record in pool.map(work, left):
            file.write(json.dumps(record) + "\n")
            file.flush()
            records.append(record)
            print(f"{len(records)}: {record['path']}:{record['line']} {record['outcome']}", file=sys.stderr)
    return sorted(records, key=lambda record: record["number"])[: given.cases]


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=150, help="mutants, with --parts of each part")
    parser.add_argument("--seed", type=int, help="default: the first eight hexadecimal digits of the commit")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--paths", nargs="*", default=list(PACKAGES), help="folders and files to change")
    parser.add_argument("--parts", action="store_true", help="score each of the nine parts of the product")
    parser.add_argument("--tests", nargs="*", default=["tests"], help="tests that may notice")
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        measure(given.measure, given.tests)
        return
    given.seed = read_seed() if given.seed is None else given.seed
    texts = [path.read_bytes() for path in sorted((ROOT / "tests").rglob("*.py"))]
    code = hashlib.sha256("".join([*read_sources().values(), *given.tests]).encode() + b"".join(texts)).hexdigest()
    folder = Path(tempfile.gettempdir()) / f"softcover-mutants-{code[:10]}"
    folder.mkdir(exist_ok=True)
    known = Coverage(folder, given.tests)
    rows = PARTS if given.parts else {name: (name,) for name in PACKAGES}
    groups = rows.values() if given.parts else [tuple(given.paths)]
    records = [each for paths in groups for each in score(known, folder, paths, given)]
    print(f"seed {given.seed}\n{write_score(records, rows)}")


if __name__ == "__main__":
    main()
