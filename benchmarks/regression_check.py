"""Runs `softcover regress` many times without any change: it must stay green, and how much of each tolerance is used.

Every run has another seed, and in turn another number of threads.  The first runs can start with an empty result store,
so that the finite elements run with that number of threads too.  Prints for each quantity the largest deviation from
the baseline over its tolerance, and the processor time of a run.

    python benchmarks/regression_check.py --runs 50
    python benchmarks/regression_check.py --runs 3 --cold 3 --baseline .ci/wts-0614-34.json
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

#: Numbers of threads of one run after the other [-].
THREADS = (1, 2, 4)
#: Settings with which idle threads sleep; on a busy machine, threads that spin would triple the processor time.
_PASSIVE = {"OMP_WAIT_POLICY": "PASSIVE", "KMP_BLOCKTIME": "0"}
_COMMAND = (sys.executable, "-c", "from validation.cli import main; main()", "regress")


def run(sensor: str, baseline: Path, *words: str, **environment: str) -> tuple[int, dict, float]:
    """Run the command; return exit status, the object that it prints, and its processor time [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [*_COMMAND, sensor, "--baseline", str(baseline), "--json", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **environment})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in {0, 1}:
        sys.exit(done.stderr)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.returncode, json.loads(done.stdout), seconds


def list_numbers(entry: dict) -> list[float]:
    """List all numbers of a quantity."""
    value = entry["value"]
    rows = value.values() if isinstance(value, dict) else [value]
    return [number for row in rows for number in (row if isinstance(row, list) else [row])]


def measure_use(stored: dict, now: dict) -> dict[str, float]:
    """Return by quantity the largest deviation from the baseline over the tolerance [-]."""
    used = {}
    for title, entry in stored.items():
        tolerance = entry["tolerance"]
        share = float(tolerance.split()[0]) / 100 if isinstance(tolerance, str) else None
        pairs = zip(list_numbers(entry), list_numbers(now[title]), strict=True)
        allowed = [(abs(a - b), tolerance if share is None else share * abs(a)) for a, b in pairs]
        used[title] = max(difference / (limit or 1e-9) for difference, limit in allowed)
    return used


def main() -> None:
    """Run the command with every seed and number of threads in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sensor", default="wts-0614-34")
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--cold", type=int, default=0, help="number of runs that start with an empty result store")
    parser.add_argument("--baseline", type=Path, help="an existing baseline; by default one is made first")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        baseline = options.baseline or Path(scratch) / "baseline.json"
        if options.baseline is None:
            run(options.sensor, baseline, "--update")
        stored = json.loads(baseline.read_text())["quantities"]
        largest, red = dict.fromkeys(stored, 0.0), 0
        for number in range(options.first, options.first + options.runs):
            threads = str(THREADS[number % len(THREADS)])
            names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
            environment = dict.fromkeys(names, threads) | {"PYTHONHASHSEED": str(number), **_PASSIVE}
            if number - options.first < options.cold:
                environment["SOFTCOVER_STORE"] = str(Path(scratch) / f"store{number}")
            status, found, seconds = run(options.sensor, baseline, "--seed", str(number), **environment)
            red += status
            for title, share in measure_use(stored, found["quantities"]).items():
                largest[title] = max(largest[title], share)
            kind = "cold" if number - options.first < options.cold else "from the store"
            verdict = "RED: " + "; ".join(each["quantity"] for each in found["changes"]) if status else "green"
            print(f"run {number}: seed {number}, {threads} threads, {kind}, {seconds:.1f} s CPU: {verdict}", flush=True)
        for title, share in sorted(largest.items(), key=lambda item: -item[1]):
            if share > 0:
                print(f"{100 * share:7.2f} % of tolerance  {title}")
        print(f"{options.runs - red} of {options.runs} runs are green")
        sys.exit(bool(red))


if __name__ == "__main__":
    main()
