"""Kills and interrupts commands at random instants, and checks that no output is lost or torn.

    python benchmarks/kills.py --kills 300 --interrupts 30 --seed 1

Each command has two variants with different output.  A trial starts one of them over the complete output of either, and
ends it with SIGKILL or SIGINT at a random instant of its duration.  The output must then be complete: that of one of
the two variants.  An interrupt must end with the documented status, and leave nothing else in the folder.  At last each
command runs to its end once more, over what was left and with the store that the killed runs shared.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

#: Commands with the place of a value, its two variants, and the output.
COMMANDS = (
    ("export wts-0614-34 --format urdf --mass {} --out out", ("20g", "30g")),
    ("press wts-0614-34 --indenter sphere:radius=5mm --load {} --model fem --out out", ("300g", "500g")),
    ("derive wts-0614-34 --thickness {} --out out", ("2mm", "2.5mm")),
    ("calibrate --sensor wts-0614-34 --noise {} --next 3 --plan out", ("4mN", "5mN")),
    ("init {} --force --out out", ("", "")),
)
#: Documented status of a run that was interrupted; while Python starts, the signal itself ends it.
INTERRUPTED = 130
#: Name of the file with the hashes of all others in an output folder.
MANIFEST = ".softcover-output"


def run(command: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start a command in a folder with a store of its own."""
    code = "from validation.cli import main; main()"
    environment = os.environ | {"SOFTCOVER_STORE": str(folder.parent / "store"), "COLUMNS": "80"}
    quiet = subprocess.DEVNULL
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets its background jobs ignore it
    return subprocess.Popen([sys.executable, "-c", code, *command.split()], cwd=folder, env=environment, stdout=quiet,
                            stderr=quiet, start_new_session=True)  # fmt: skip


def digest(path: Path) -> str:
    """Return the names of a folder whose files have the hashes of its manifest, or the hash of a file; empty if none.

    Folders that hold the date or the duration of a run differ from run to run, so that names must do.
    """
    if not path.exists():
        return ""
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    listed = json.loads((path / MANIFEST).read_text())
    listed = listed.get("files", listed)
    found = {
        each.relative_to(path).as_posix(): hashlib.sha256(each.read_bytes()).hexdigest()
        for each in path.rglob("*")
        if each.is_file() and each.name != MANIFEST
    }
    return " ".join(sorted(found)) if found == listed else f"torn: {sorted(found)}"


def find_output(text: str, folder: Path) -> Path:
    """Return the file or folder that a command writes: its last word."""
    return folder / text.rsplit(maxsplit=1)[-1]


def prepare(text: str, variants: tuple[str, str], folder: Path) -> tuple[float, set[str]]:
    """Run both variants and the first one again; return the duration of the last run [s] and all outputs."""
    folder.mkdir()
    outputs, seconds = set(), 0.0
    for variant in (*variants, variants[0]):
        start = time.monotonic()
        if status := run(text.format(variant), folder).wait():
            raise SystemExit(f"{text.format(variant)}: ends with {status}")
        seconds = time.monotonic() - start
        outputs.add(digest(find_output(text, folder)))
    print(f"{seconds:5.1f} s, {len(outputs)} outputs: {text}", flush=True)
    return seconds, outputs


def stop(command: str, folder: Path, seconds: float, kind: signal.Signals) -> tuple[int, str]:
    """Start a command, end it after a time, and return its status and what is wrong in its folder, if anything is."""
    earlier = {each.name for each in folder.iterdir()}
    process = run(command, folder)
    time.sleep(seconds)
    if process.poll() is None:
        os.killpg(process.pid, kind)
    status, names = process.wait(), {each.name for each in folder.iterdir()}
    new = {each for each in names - earlier if kind == signal.SIGINT or not each.startswith(".")}
    wrong = kind == signal.SIGINT and status not in {0, INTERRUPTED, -signal.SIGINT}
    return status, f"status {status}, new {sorted(new)}" if wrong or new else ""


def main() -> None:
    """Run the trials and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, default in (("--kills", 300), ("--interrupts", 30), ("--seed", 1)):
        parser.add_argument(name, type=int, default=default)
    given = parser.parse_args()
    chance = random.Random(given.seed)  # noqa: S311 -- no secret
    kinds = [signal.SIGKILL] * given.kills + [signal.SIGINT] * given.interrupts
    chance.shuffle(kinds)
    faults, ends = [], Counter()
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch) / str(number) for number in range(len(COMMANDS))]
        known = [prepare(*each, folder) for each, folder in zip(COMMANDS, folders, strict=True)]
        for kind in kinds:
            number = chance.randrange(len(COMMANDS))
            (text, variants), (seconds, outputs) = COMMANDS[number], known[number]
            command = text.format(chance.choice(variants))
            status, wrong = stop(command, folders[number], chance.uniform(0, 1.1 * seconds), kind)
            ends[kind.name, status] += 1
            if wrong or digest(find_output(text, folders[number])) not in outputs:
                faults.append(f"{kind.name}: {command}: {wrong or 'another output'}")
        for (text, variants), folder, (_, outputs) in zip(COMMANDS, folders, known, strict=True):
            status = run(text.format(variants[0]), folder).wait()
            if status or digest(find_output(text, folder)) not in outputs:
                faults.append(f"{text}: ends with {status} at last, or with another output")
    for (name, status), count in sorted(ends.items()):
        print(f"{name}: status {status}: {count}")
    print(*faults or [f"no output lost or torn in {len(kinds)} trials"], sep="\n")
    raise SystemExit(bool(faults))


if __name__ == "__main__":
    main()
