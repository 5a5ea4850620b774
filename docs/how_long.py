"""Measure how long commands take, and write the table into docs/how-to/how-long.md.

Each command runs in an empty folder with an empty store of results and one thread.  The time is processor time of the
command, so that other work on the machine matters little.

    python docs/how_long.py                     prints the table
    python docs/how_long.py --write             writes it into docs/how-to/how-long.md
    python docs/how_long.py --limit 300         stops a command after 300 s and says so
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "how-to" / "how-long.md"
#: Lines of the page between which the table stands.
BEGIN, END = "<!-- times: begin -->", "<!-- times: end -->"
TOUCH = "--indenter sphere:radius=5mm --load 500g"
RUBBER = "press wts-0614-34 --material dragon-skin-30 --model fem"
#: What is done, and the command of softcover.
COMMANDS = (
    ("fast model, one press; the first time, numba compiles", f"press wts-0614-34 {TOUCH} --model fast"),
    ("the same again", f"press wts-0614-34 {TOUCH} --model fast"),
    ("spread of one linear layer", "derive wts-0614-34"),
    ("spread of one layer of rubber", "derive sensor.toml --layer 1:material=dragon-skin-30"),
    ("a ball at small strain", f"press wts-0614-34 {TOUCH} --model fem"),
    ("a ball at finite strain", f"{RUBBER} {TOUCH}"),
    ("a flat box at finite strain", f"{RUBBER} --indenter box:size=6mmx6mmx5mm --load 500g"),
    ("a ball with friction", f"press wts-0614-34 {TOUCH} --model fem --friction 0.4"),
    (
        "a flat box without slip",
        "press wts-0614-34 --indenter box:size=6mmx6mmx5mm --load 500g --model fem --friction no-slip",
    ),
    ("regression check of a folder of parameters", "regress parameters --update"),
    ("regression check of a built-in sensor", "regress wts-0614-34 --update"),
    ("report in five minutes at most", "validate wts-0614-34 --quick"),
    ("responses of a curved cover of 66 texels", "derive fingertip"),
)


def main() -> None:
    """Measure all commands, and print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the table into docs/how-to/how-long.md")
    parser.add_argument("--limit", type=float, default=3600.0, help="processor time after which a command ends [s]")
    options = parser.parse_args()
    lines = ["| what | command | processor time |", "|---|---|---|"]
    with tempfile.TemporaryDirectory() as cache:
        for what, command in COMMANDS:
            seconds = measure(command, Path(cache), options.limit)
            lines.append(f"| {what} | `softcover {command}` | {describe(seconds, options.limit)} |")
            print(lines[-1], flush=True)
    lines += ["", f"Measured on {name_machine()}, one thread, by `python docs/how_long.py --write`."]
    print(lines[-1])
    if options.write:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        table = "\n".join(lines)
        PAGE.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


def measure(command: str, cache: Path, limit: float) -> float | None:
    """Run a command in an empty folder with an empty store; return its processor time [s], None above the limit.

    Args:
        command: Words after `softcover`.
        cache: Folder in which numba keeps machine code from one command to the next.
        limit: Largest processor time [s].
    """
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(cache)}
    environment["PYTHONPATH"] = str(ROOT)
    program = [sys.executable, "-c", "from validation.cli import main; main()"]
    with tempfile.TemporaryDirectory() as folder:
        environment["SOFTCOVER_STORE"] = f"{folder}/store"
        for preparation in ("init", "export wts-0614-34 --out parameters"):
            subprocess.run(
                [*program, *shlex.split(preparation)], cwd=folder, env=environment, check=True, capture_output=True
            )
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            ["bash", "-c", f'ulimit -t {limit:.0f}; exec "$@"', "bash", *program, *shlex.split(command)],
            cwd=folder, env=environment, check=False, capture_output=True, text=True,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode < 0:
        return None
    if done.returncode not in {0, 1}:
        raise SystemExit(f"softcover {command} ended with {done.returncode}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def describe(seconds: float | None, limit: float) -> str:
    """Describe a processor time with two digits."""
    if seconds is None:
        return f"more than {limit:.0f} s"
    return f"{seconds:.2g} s" if seconds < 100 else f"{seconds:.0f} s"  # noqa: PLR2004 -- digits


def name_machine() -> str:
    """Name the processor, its number of cores and the operating system."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [
            line.partition(":")[2].strip() for line in information.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    return f"{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


if __name__ == "__main__":
    main()
