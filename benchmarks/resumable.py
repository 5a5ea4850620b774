"""Runs of many numbered cases that can be interrupted.

Each finished case is kept as a JSON line with a hash of the code, and a second run goes on from there.  Records of
other code are not used, unless that is asked for.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

#: A finished case: at least its `number`, and the `code` it ran on.
Record = dict[str, Any]
#: Cases after which a process is replaced, so that its memory is freed.
CASES_PER_PROCESS = 20


@cache
def hash_code(*packages: str) -> str:
    """Hash the sources of packages of this repository, to tell results of different code apart."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(path for package in packages for path in (root / package).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:10]


def read_options(
    description: str, *, name: str, cases: int, switches: Mapping[str, str] | None = None
) -> argparse.Namespace:
    """Read the options of a run from the command line.

    Args:
        description: What the script does.
        name: Name of the file of JSON lines in the folder for temporary files.
        cases: Number of cases.
        switches: Further options without a value, and their help.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=60, help="start no case after this time")
    parser.add_argument("--lines", type=Path, help="file of JSON lines; one of temporary files by default")
    parser.add_argument("--out", type=Path, help="file for the table")
    parser.add_argument("--older", action="store_true", help="use records of other code for cases that lack one")
    for switch, text in (switches or {}).items():
        parser.add_argument(switch, action="store_true", help=text)
    given = parser.parse_args()
    given.lines = given.lines or Path(tempfile.gettempdir()) / f"softcover-{name}-{given.seed}.jsonl"
    return given


def run_cases(
    work: Callable[[int, int], Record],
    given: argparse.Namespace,
    code: str,
    *,
    holds: Callable[[Record], bool] = lambda _: False,
) -> list[Record]:
    """Work on the cases that have no record of this code yet, and return the records of all cases.

    Args:
        work: Function of seed and number that returns the record of a case; it runs in processes of its own.
        given: Options of `read_options`.
        code: Hash of the code.
        holds: Whether a record of other code still holds, so that its case need not run again.

    Returns:
        Records in the order of their numbers.
    """
    wanted = range(given.first, given.first + given.cases)

    def usable(record: Record) -> bool:
        return record.get("code") == code or holds(record)

    done = {record["number"] for record in read_records(given.lines) if usable(record)}
    left = [number for number in wanted if number not in done]
    deadline = time.time() + 60 * given.minutes
    spawn = multiprocessing.get_context("spawn")
    with spawn.Pool(given.processes, maxtasksperchild=CASES_PER_PROCESS) as pool, given.lines.open("a") as file:
        file.write("\n" * (file.tell() > 0))  # after a line that was not finished
        jobs = [(work, deadline, given.seed, number, code) for number in left]
        for count, record in enumerate(pool.imap_unordered(_work_before, jobs), start=1):
            if record is not None:
                file.write(json.dumps(record) + "\n")
                file.flush()
                print(f"{count} of {len(jobs)} cases", file=sys.stderr)
    chosen: dict[int, Record] = {}
    for record in read_records(given.lines):
        number, same = record["number"], usable(record)
        if number in wanted and (same or (given.older and chosen.get(number, {}).get("code") != code)):
            chosen[number] = record
    return [chosen[number] for number in sorted(chosen)]


def state_code(records: list[Record], code: str) -> str:
    """State in a sentence how many records come from which code."""
    counts = Counter(record.get("code", "unknown") for record in records)
    parts = [f"{count} of {name}" + (" (this code)" if name == code else "") for name, count in counts.most_common()]
    return f"{len(records)} cases by hash of the code: {', '.join(parts) or 'none'}."


def _work_before(job: tuple[Callable[[int, int], Record], float, int, int, str]) -> Record | None:
    """Work on a case, or return None after a point in time [s since 1970]."""
    work, deadline, seed, number, code = job
    if time.time() > deadline:
        return None
    started = time.perf_counter()
    record = work(seed, number)
    return {"seed": seed, "number": number, "code": code, "wall": round(time.perf_counter() - started, 1)} | record


def read_records(lines: Path) -> list[Record]:
    """Read the records of a file of JSON lines, none if it does not exist.

    A line that another process is just writing, or that it left behind when it was killed, counts as absent.
    """
    records = []
    for line in lines.read_text().splitlines() if lines.exists() else ():
        with contextlib.suppress(json.JSONDecodeError):
            records.append(json.loads(line))
    return records
