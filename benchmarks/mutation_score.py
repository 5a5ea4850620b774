"""Mutation score of the default tests: the share of small changes of the code that a test notices.

    python benchmarks/mutation_score.py --cases 300 --seed 12 --out benchmarks/mutation_score.md
    python benchmarks/mutation_score.py --planted

A seeded sample is drawn from all mutants (`mutants.py`) of the four packages, so each package takes part in proportion
to its size.  For each mutant, the tests that run its line (`coverage_by_test.py`) run in a copy of the repository
(`isolated_tests.py`) up to the first failure: those of its package first, and each kind fastest first.  Lines that
coverage does not see, in compiled kernels and outside functions, are found through the lines that use their names.  A
mutant whose tests need more than about ten times their processor time counts as killed.

Neither mutmut nor cosmic-ray fits: mutmut 3 leaves decorated functions out and chooses among its mutants inside the
process, where numba has compiled one; cosmic-ray changes the files of the tree itself and runs one fixed command.

After changes of tests alone, `--survivors` runs only the mutants that no test has noticed yet.

`--planted` plants the defects of `planted_defects.toml` instead, each of which its tests must notice.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
import tomllib
from argparse import Namespace
from functools import cache, partial
from pathlib import Path
from typing import Any

from coverage_by_test import TEST_FILES, measure_file
from isolated_tests import PACKAGES, ROOT, copied_tree, run_tests
from mutants import Mutant, find_mutants
from resumable import Record, hash_code, read_options, read_records, run_cases, state_code

HERE = Path(__file__).resolve().parent
#: Tests that run against one mutant take at most this processor time without it [s].
BUDGET = 30.0
#: Tests are collected in batches; limits between them [s].
BATCHES = (2.0, 10.0)
#: Processor time that a test may take besides, to compile changed kernels, or to compute finite-element results anew:
#: kept results are those of unchanged `meshes` and `fem_reference` [s].
RENEWAL = 120.0
#: Number of steps from a name to the names of the functions that use it.
STEPS = 4


@cache
def list_mutants(seed: int) -> list[Mutant]:
    """List all mutants in an order drawn with a seed."""
    found = find_mutants(ROOT, PACKAGES)
    random.Random(seed).shuffle(found)  # noqa: S311 -- no secret
    return found


@cache
def _read_sources() -> dict[str, str]:
    files = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return {file.relative_to(ROOT).as_posix(): file.read_text() for file in files}


class Chooser:
    """Chooses tests for a mutant, from the records of `coverage_by_test.measure_file`.

    Attributes:
        seconds: Processor time of each test [s].
    """

    def __init__(self, records: list[Record]) -> None:
        tests = {name: found for record in records for name, found in record["tests"].items()}
        self.seconds: dict[str, float] = {name: seconds for name, (seconds, _) in tests.items()}
        self._lines: dict[str, list[tuple[str, int]]] = {}
        for name, (_, files) in tests.items():
            for path, bits in files.items():
                self._lines.setdefault(path, []).append((name, int(bits, 16)))

    def _covering(self, path: str, bits: int) -> set[str]:
        return {name for name, lines in self._lines.get(path, ()) if lines & bits}

    def choose(self, mutant: Mutant) -> list[str]:
        """Return tests that may notice a mutant within the budget: its package's first, each kind fastest first."""
        found: set[str] = set()
        if mutant.runs:
            found = self._covering(mutant.path, sum(1 << line for line in mutant.lines))
        if not found or is_compiled(mutant.path):
            found |= self._find_users(mutant)
        chosen, used = [], 0.0
        near = (f"tests/{mutant.path.split('/')[0]}/", "tests/verification/")
        for name in sorted(found, key=lambda name: (not name.startswith(near), self.seconds[name], name)):
            used += self.seconds[name]
            if used <= BUDGET or not chosen:
                chosen.append(name)
        return chosen

    def _find_users(self, mutant: Mutant) -> set[str]:
        """Find tests of lines that use the function, class or constant, directly or through what no test covers."""
        found: set[str] = set()
        names, seen = {mutant.owner}, {"", "__init__", "__post_init__"}
        for _ in range(STEPS):
            further: set[str] = set()
            for name in names - seen:
                for path, line, function in _find_uses(name):
                    tests = self._covering(path, 1 << line)
                    found |= tests
                    # Tests that run a kernel as Python may be few, and compare it with itself.
                    further |= set() if tests and not is_compiled(path) else {function}
            seen |= names
            names = further
        return found

    def batches(self, tests: list[str]) -> list[list[str]]:
        """Divide tests into batches by the sum of their times."""
        batches: list[list[str]] = [[] for _ in range(len(BATCHES) + 1)]
        used = 0.0
        for name in tests:
            used += self.seconds[name]
            batches[sum(used > limit for limit in BATCHES)].append(name)
        return [batch for batch in batches if batch]


@cache
def _find_uses(name: str) -> list[tuple[str, int, str]]:
    """Find path, line, and function or constant of the lines that use a name; the last is empty outside both."""
    found = []
    for path, source in _read_sources().items():
        if name not in source:
            continue
        function = ""
        for number, line in enumerate(source.splitlines(), start=1):
            if start := re.match(r"\s*def (\w+)", line):
                function = start[1]
            elif line and not line[0].isspace() and line[0] not in ")@":
                constant = re.match(r"(\w+)(:[^=]+)? = ", line)
                function = constant[1] if constant else ""
            if function != name and re.search(rf"\b{name}\b", line):
                found.append((path, number, function))
    return found


@cache
def is_compiled(path: str) -> bool:
    """Whether numba compiles functions of a file, or of a file that imports it."""
    sources = _read_sources()
    module = path.removesuffix(".py").replace("/", ".")
    return "called_by_kernels" in sources[path] or any(
        "called_by_kernels" in source and f"from {module} import" in source for source in sources.values()
    )


def try_change(path: str, source: str, batches: list[list[str]], seconds: dict[str, float]) -> dict[str, Any]:
    """Run tests in a copy of the repository in which one file has another source."""
    kernels = path.endswith(".py") and is_compiled(path)
    renewed = kernels or path.startswith(("meshes/", "fem_reference/"))
    with tempfile.TemporaryDirectory() as own, copied_tree(compiled=Path(own) if kernels else None) as tree:
        (tree / path).write_text(source)
        return run_tests(tree, batches, seconds, extra=RENEWAL if renewed else 0.0)


@cache
def _load_chooser(lines: Path, code: str) -> Chooser:
    records = read_records(lines)
    latest = {record["file"]: record for record in sorted(records, key=lambda record: record["code"] == code)}
    return Chooser([record for name, record in latest.items() if name in TEST_FILES])


def _describe(path: str, line: int, source: str, changed: str) -> dict[str, Any]:
    """Describe a change by its first different lines."""
    before, after = source.splitlines(), changed.splitlines()
    return {"path": path, "line": line, "before": before[line - 1].strip(), "after": after[line - 1].strip()}


def try_mutant(seed: int, number: int, *, lines: Path, coverage: Path, code: str) -> Record:
    """Run the tests chosen for one mutant; the test that killed it in an earlier run goes first."""
    mutant, chooser = list_mutants(seed)[number], _load_chooser(coverage, code)
    source = _read_sources()[mutant.path]
    changed = mutant.apply(source)
    record = _describe(mutant.path, mutant.line, source, changed)
    earlier = [old["test"] for old in read_records(lines)
               if old["outcome"] == "failed" and all(old[key] == record[key] for key in record)]  # fmt: skip
    tests = chooser.choose(mutant)
    batches = [[name] for name in earlier[-1:] if name in chooser.seconds] + chooser.batches(tests)
    record["sources"] = hash_code(*PACKAGES)
    if not batches:
        return record | {"outcome": "no test", "test": "", "text": "", "cpu": 0.0, "tests": 0}
    return record | try_change(mutant.path, changed, batches, chooser.seconds) | {"tests": len(tests)}


def read_planted() -> list[dict[str, Any]]:
    """Read the planted defects: `kind`, `path`, `before`, `after`, `tests`."""
    defects: list[dict[str, Any]] = tomllib.loads((HERE / "planted_defects.toml").read_text())["defect"]
    return defects


def plant(defect: dict[str, Any]) -> str:
    """Return the source of a file with a planted defect; the text that it replaces must occur once."""
    source = (ROOT / defect["path"]).read_text()
    if source.count(defect["before"]) != 1:
        message = f"{defect['path']}: {defect['before']!r} occurs {source.count(defect['before'])} times, not once"
        raise ValueError(message)
    return source.replace(defect["before"], defect["after"])


def try_planted(_seed: int, number: int) -> Record:
    """Run the tests of one planted defect."""
    defect = read_planted()[number]
    return {"kind": defect["kind"], "path": defect["path"]} | try_change(
        defect["path"], plant(defect), [defect["tests"]], {}
    )


def read_equivalent() -> list[dict[str, str]]:
    """Read the mutants that change no behaviour: `path`, `before`, `after`, `reason`."""
    mutants: list[dict[str, str]] = tomllib.loads((HERE / "equivalent_mutants.toml").read_text()).get("mutant", [])
    return mutants


def _make_row(name: str, records: list[Record]) -> str:
    """Make a row of the table: counts, score and its 95 % interval after Wilson."""
    from scipy.stats import binomtest

    counts = [sum(record["outcome"] == outcome for record in records)
              for outcome in ("failed", "time", "passed", "no test", "equivalent")]  # fmt: skip
    killed, tried = counts[0] + counts[1], len(records) - counts[4]
    cells = [name, str(len(records)), *map(str, counts)]
    if tried:
        low, high = binomtest(killed, tried).proportion_ci(0.95, method="wilson")
        return " | ".join(["", *cells, f"{100 * killed / tried:.1f} %", f"{100 * low:.1f}..{100 * high:.1f} %", ""])
    return " | ".join(["", *cells, "-", "-", ""])


def write_score(records: list[Record], code: str) -> str:
    """Write the table by package, and the survivors as differences."""
    known = {(entry["path"], entry["before"], entry["after"]) for entry in read_equivalent()}
    for record in records:
        if record["outcome"] == "passed" and (record["path"], record["before"], record["after"]) in known:
            record["outcome"] = "equivalent"
    lines = [
        state_code(records, code),
        "",
        "| package | mutants | failed | time | survived | no test | equivalent | score | 95 % interval |",
        "|---|---|---|---|---|---|---|---|---|",
        *(_make_row(name, [record for record in records if record["path"].startswith(name)]).strip()
          for name in PACKAGES),
        _make_row("all", records).strip(),
        "",
    ]  # fmt: skip
    for record in records:
        if record["outcome"] in ("passed", "no test"):
            lines += [f"{record['path']}:{record['line']} ({record['outcome']}, mutant {record['number']})"]
            lines += [f"    - {record['before']}", f"    + {record['after']}"]
    return "\n".join(lines)


def main() -> int:
    """Run the command line."""
    given = read_options(
        (__doc__ or "").split("\n\n")[0],
        name="mutation-score",
        cases=300,
        switches={
            "--survivors": "run no mutant again that tests noticed before the tests changed",
            "--planted": "plant the listed defects",
            "--known": "use the coverage of other code",
        },
    )
    code = hash_code(*PACKAGES, "tests")
    if given.planted:
        given.cases, given.lines = len(read_planted()), given.lines.with_name("softcover-planted.jsonl")
        records = run_cases(try_planted, given, code)
        survived = [record for record in records if record["outcome"] == "passed"]
        print(f"{len(records)} defects planted, {len(records) - len(survived)} noticed")
        print("\n".join(f"  {record['kind']}: {record['path']}" for record in survived))
        return int(bool(survived))
    coverage = given.lines.with_name("softcover-coverage-by-test.jsonl")
    if not given.known:
        wanted = {"first": 0, "cases": len(TEST_FILES), "lines": coverage}
        run_cases(partial(measure_file, lines=coverage), Namespace(**vars(given) | wanted), code)
    work = partial(try_mutant, lines=given.lines, coverage=coverage, code=code)

    def holds(record: Record) -> bool:
        noticed = record["outcome"] in ("failed", "time") and record.get("sources") == hash_code(*PACKAGES)
        return bool(given.survivors) and noticed

    text = write_score(run_cases(work, given, code, holds=holds), code)
    print(text)
    if given.out:
        given.out.write_text(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
