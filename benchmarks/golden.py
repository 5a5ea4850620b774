"""Golden runs: commands whose exit status, files and numbers are recorded once and compared after every change.

    python benchmarks/golden.py record tests/golden               # from an empty store, after checking a warm one
    python benchmarks/golden.py compare tests/golden --only press-flat
    python benchmarks/golden.py compare tests/golden --tier ten

`golden_runs.toml` lists the runs, and `golden.md` says what they notice.  Each run has a folder of its own and a result
store that is empty at first; a second pass starts from the store that the first pass left, and must agree.  Keys may be
added and not lost.  `CHANGED` lists keys whose values were changed on purpose.  Runs on recordings need the environment
variable SOFTCOVER_RECORDINGS.
"""

from __future__ import annotations

import argparse
import csv
import fnmatch
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
#: Keys whose values were changed on purpose: a pattern of "RUN KEY", and the reason.
CHANGED: tuple[tuple[str, str], ...] = (
    ("* files.*.svg", "pictures come in one format, PNG; the report keeps SVG inside its page"),
    ("* files.*plotly.min.js", "the figures of a report are SVG in its page"),
    ("doctor *plotly*", "the figures of a report are drawn by matplotlib"),
    ("* *.comparison_models*.parameters.*", "of a range of parameters with the same score the smallest counts"),
    ("* contents.*/contact.csv.*", "contact.csv has points in space and force vectors for covers of every kind"),
    ("* files.*texels.csv", "press --out writes the forces of the texels for covers of every kind"),
    ("* files.*scores.csv", "a report holds its scores as CSV too"),
    ("* *.comparison_models*.not_built", "terms in time of published models are applied in cases that change in time"),
    ("* *.solution_verification*.unit", "units are written in one way"),
    ("* *resolution_on_array*", "two points are separated by the Rayleigh criterion, without steps of a texel"),
    ("* *two-point separation *texel*", "the same in tables"),
    ("datasheet *spatial?resolution*", "the same in the data sheet"),
    ("curved-* *.texel_forces*", "texel forces of curved sensors are images of rows and columns"),
)
#: Keys that differ from run to run or from machine to machine: times, versions, paths, digests.
IGNORED = re.compile(
    r"(^|[._ /])(seconds|seconds_\w+|\w*_seconds|time|times|started|finished|version|versions|path|folder|file|files"
    r"|wrote|sha256|digest|hash|key|age|created|date|host|machine|python|platform|bytes|size_bytes|arrival_delays|software|code"
    r"|cpu_\w+|duration\w*|provenance|start|command|source_hash|store)(\[\d+\])*($|[.\[])"
)
#: Share of the largest number of an array by which its numbers may differ, by kind of run, and a difference below which
#: any two numbers are equal [SI units]; cells of HTML tables are rounded to a few digits.
TOLERANCE = {"flat": 1e-9, "threads": 1e-6, "curved": 1e-2}
ABSOLUTE = 1e-11
#: Numbers of an array that are kept one by one [-]; of a longer one its number, sum, sum of squares and range.
MOST_NUMBERS = 1200
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
DIGEST = re.compile(r"[0-9a-f]{64}")
COMMAND = (sys.executable, "-c", "from validation.cli import main; main()")


@dataclass(frozen=True, kw_only=True)
class Run:
    """A golden run.

    Attributes:
        name: Unique name.
        argv: Arguments of `softcover`; several commands run one after the other in one folder.
        files: Texts of the files that are written before, by name.
        kind: `flat`, `threads` or `curved`: which tolerance holds.
        names: What the message of a refused input has to name.
        loose: Patterns of keys that are not compared.
        laboratory: Whether made-up recordings are written before.
        emulate: Whether an emulated sensor is on the port `port`.
        ten: Whether the run stays in the tests.
    """

    name: str
    argv: list[str]
    files: dict[str, str]
    kind: str = "flat"
    names: str = ""
    loose: tuple[str, ...] = ()
    laboratory: bool = False
    emulate: bool = False
    ten: bool = False


def load_runs() -> list[Run]:
    """Read the list of runs."""
    tables = tomllib.loads((HERE / "golden_runs.toml").read_text())
    runs = [
        Run(
            name=name,
            argv=argv,
            files={file: text for file, text in tables["file"].items() if any(file in line.split() for line in argv)},
            kind=next((kind for kind in ("threads", "curved") if name in tables[kind]), "flat"),
            loose=tuple(tables["loose"].get(name, ())),
            **{mark: name in tables[mark] for mark in ("laboratory", "emulate", "ten")},
        )
        for name, argv in tables["run"].items()
    ]
    for number, (argv, names, *texts) in enumerate(tables["hostile"]["cases"]):
        file = f"hostile-{number}.toml"
        files = dict.fromkeys((file,), texts[0]) if texts else {}
        runs.append(Run(name=f"hostile-{number:02d}", argv=[argv.replace("FILE", file)], files=files, names=names))
    return runs


def write_laboratory(folder: Path) -> None:
    """Write recordings of a made-up array of 8 x 10 texels: stamps of known loads, places and temperatures, as CSV.

    Counts are 900 per newton of a uniform pressure that is blurred by half a pitch; gains, noise and temperature
    (1 % per kelvin) are drawn once, from a fixed seed.
    """
    random = np.random.default_rng(7)
    x, y = (5e-3 * (np.arange(n) - (n - 1) / 2) for n in (10, 8))
    gains = np.exp(random.normal(0, 0.15, 80))
    erf = np.vectorize(math.erf)
    times = np.arange(0, 10, 0.5)

    def share(centres: Any, at: float, half: float) -> Any:
        return (erf((centres - at + half) / 2.5e-3) - erf((centres - at - half) / 2.5e-3)) / 2

    home, moved = (1e-3, -2e-3), (6e-3, 1e-3)
    for series, place, degrees in (("home", home, 25.0), ("warm", home, 34.0), ("moved", moved, 25.0)):
        (folder / series).mkdir()
        for newtons in (4, 7, 10, 14):
            image = np.outer(share(y, place[1], 6e-3), share(x, place[0], 8e-3)).ravel()
            image *= 900 * newtons / image.sum() * gains * (1 + 0.01 * (degrees - 30)) * (1 + 0.005 * random.normal())
            lines = [
                "# rows = 8", "# columns = 10", "# pitch = 0.005", "# full_scale = 4095",
                "# indenter = box:size=16mmx12mmx5mm", f"# load = {newtons}",
                ",".join(["time", "temperature", *(f"texel_{n}" for n in range(80))]),
            ]  # fmt: skip
            for at in times:
                counts = np.maximum(image * (at > 1) + 3 * random.normal(size=80) * (image > 20) * (at > 1), 0)
                lines.append(",".join([f"{at:.3f}", f"{degrees:.2f}", *(f"{n:.0f}" for n in counts)]))
            (folder / series / f"{newtons}.csv").write_text("\n".join(lines) + "\n")


def read_tables(page: str) -> dict[str, list[list[str]]]:
    """Read the cells of all tables of a page, by the text of the first cell of their row."""
    rows: dict[str, list[list[str]]] = {}
    for row in re.findall(r"<tr\b.*?(?=<tr\b|</table>)", page, flags=re.DOTALL):
        cells = re.findall(r"<t[dh]\b[^>]*>(.*?)</t[dh]>", row, flags=re.DOTALL)
        first, *others = [" ".join(unescape(re.sub(r"<[^>]*>", "", cell)).split()) for cell in cells] or [""]
        if others:
            rows.setdefault(first, []).append(others)
    return rows


def read_result(path: Path) -> Any:
    """Read what is compared of a file: JSON values, columns, tables of a page, words and numbers; None of pictures."""
    if path.suffix == ".json":
        return json.loads(path.read_text())
    if path.suffix == ".csv":
        with path.open() as lines:
            headings, *rows = csv.reader(lines)
            return {name: [to_number(row[n]) for row in rows if n < len(row)] for n, name in enumerate(headings)}
    if path.suffix == ".html":
        return read_tables(path.read_text())
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name].tolist() for name in arrays.files}
    if path.suffix in {".toml", ".xml", ".urdf", ".sdf", ".world", ".md", ".txt"}:
        text = re.sub(r'(time|timestamp)="[^"]*"', "", path.read_text())
        return [[to_number(word) for word in re.split(r"[\s\"<>=,\[\]{}]+", line)] for line in text.split("\n")]
    return None


def to_number(text: str) -> float | str:
    """Return a text as a number if it is one."""
    return float(text) if NUMBER.fullmatch(text.strip()) else text


def shorten(value: Any) -> Any:
    """Round numbers to 12 digits, drop ignored keys, and replace long arrays by their number, sums and range."""
    if isinstance(value, dict):
        return {name: shorten(each) for name, each in value.items() if not IGNORED.search(name)}
    if isinstance(value, list):
        numbers = list(flatten_numbers(value))
        if len(numbers) > MOST_NUMBERS and not has_objects(value):
            array = np.array(numbers)
            array = array[np.isfinite(array)]
            return shorten({"count": len(numbers), "sum": float(array.sum()), "square": float((array**2).sum()),
                            "range": [float(array.min()), float(array.max())]})  # fmt: skip
        return [shorten(each) for each in value]
    if isinstance(value, float):
        return float(f"{value:.12g}") if math.isfinite(value) else str(value)
    return value


def has_objects(value: Any) -> bool:
    """Whether objects with named values are among nested lists; these are kept one by one."""
    return isinstance(value, dict) or (isinstance(value, list) and any(has_objects(each) for each in value[:3]))


def flatten_numbers(value: Any) -> Iterator[float]:
    """All numbers of nested lists and objects."""
    if isinstance(value, (list, dict)):
        for each in value.values() if isinstance(value, dict) else value:
            yield from flatten_numbers(each)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield float(value)


def execute(run: Run, store: Path) -> dict[str, Any]:
    """Run a golden run in a folder of its own; return what is compared."""
    environment = {name: value for name, value in os.environ.items() if name != "SOFTCOVER_RECORDINGS"}
    environment |= {"SOFTCOVER_STORE": str(store), "PYTHONPATH": str(ROOT), "COLUMNS": "120", "NO_COLOR": "1"}
    # The same sums on every machine: pardiso, and several threads, differ in the ninth digit.
    environment |= {"SOFTCOVER_SOLVER": "metis", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    recordings = os.environ.get("SOFTCOVER_RECORDINGS", "")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in run.files.items():
            (folder / name).write_text(text)
        if run.laboratory:
            write_laboratory(folder)
        emulator = None
        if run.emulate:
            words = ("emulate", "port", "--show", "ramp", "--rate", "100", "--seconds", "60")
            emulator = subprocess.Popen([*COMMAND, *words], cwd=folder, env=environment, stderr=subprocess.DEVNULL)
            deadline = time.monotonic() + 30
            while not (folder / "port").exists() and time.monotonic() < deadline:
                time.sleep(0.05)
        steps = []
        for line in run.argv:
            words = shlex.split(line.replace("RECORDINGS", recordings))
            options = {"cwd": folder, "env": environment, "capture_output": True, "text": True, "check": False}
            done = subprocess.run([*COMMAND, *words], **options)  # noqa: PLW1510 (among the options)
            kinds = {
                found.lower() for found in re.findall(r"(?mi)^(warning|traceback|.*RuntimeWarning)\b", done.stderr)
            }
            step: dict[str, Any] = {"status": done.returncode, "kinds": sorted(kinds)}
            if "--json" in words and done.stdout.strip():
                step["json"] = shorten(json.loads(done.stdout))
            if run.names:
                step["named"] = re.search(run.names, done.stderr) is not None
                step["message"] = done.stderr.strip()[-300:]
            steps.append(step)
        if emulator is not None:
            emulator.terminate()
            emulator.wait()
        ours = {path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()}
        made = {str(path.relative_to(folder)): path for path in sorted(ours)}
        own = re.compile(r"(home|warm|moved)/\d+\.csv")
        made = {name: path for name, path in made.items() if name not in run.files and not own.fullmatch(name)}
        contents = {name: shorten(read_result(path)) for name, path in made.items()}
        printed = [step["json"] for step in steps if "json" in step]
        for name in [name for name, content in contents.items() if content in printed]:
            contents[name] = f"the same as object {printed.index(contents[name])} on standard output"
        return {"steps": steps, "files": sorted(made), "contents": {k: v for k, v in contents.items() if v is not None}}


def flatten(value: Any, key: str = "") -> Iterator[tuple[str, Any, float]]:
    """Keys, values and scales, where a scale is the largest number of the array that a number belongs to."""
    if isinstance(value, dict):
        for name, each in value.items():
            yield from flatten(each, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list):
        largest = max((abs(each) for each in flatten_numbers(value)), default=0.0)
        for number, each in enumerate(value):
            for name, found, _ in flatten(each, f"{key}[{number}]"):
                single = abs(found) if isinstance(found, (int, float)) else 0.0
                yield name, found, single if "." in name[len(key) :] else largest
    else:
        yield key, value, abs(value) if isinstance(value, (int, float)) else 0.0


def is_changed(run: Run, key: str) -> bool:
    """Whether the value of a key was changed on purpose."""
    return any(fnmatch.fnmatch(f"{run.name} {key}", pattern) for pattern, _ in CHANGED)


def find_differences(run: Run, stored: dict[str, Any], found: dict[str, Any], least: float = 0.0) -> list[str]:
    """Say what differs: keys that are lost, values beyond the tolerance, other exit statuses, files or messages."""
    tolerance = max(TOLERANCE[run.kind], least)
    now = {name: value for name, value, _ in flatten(found)}
    differences = []
    on_one_side = set(stored["files"]) ^ set(found["files"])
    if lost := sorted(name for name in on_one_side if not is_changed(run, f"files.{name}")):
        differences.append(f"files: {lost} on one side only")
    for name, value, scale in flatten({"steps": stored["steps"], "contents": stored["contents"]}):
        loose = any(fnmatch.fnmatch(name, each) for each in (*run.loose, "*.message"))
        if loose or IGNORED.search(name) or is_changed(run, name):
            continue
        if name not in now:
            differences.append(f"{name}: lost (was {value!r})")
        elif "parameters.toml" in name and all(DIGEST.fullmatch(str(each)) for each in (value, now[name])):
            continue  # The digest of cover.npz differs with the last bit of a sum.
        elif not agree(value, now[name], tolerance, scale):
            differences.append(f"{name}: {value!r} -> {now[name]!r}")
    return differences


def agree(stored: Any, found: Any, tolerance: float, scale: float) -> bool:
    """Whether two values agree; of texts the words, and the numbers to three digits or the tolerance."""
    if isinstance(stored, bool) or stored is None or isinstance(found, bool) or found is None:
        return stored is found or (stored == found)
    if isinstance(stored, (int, float)) and isinstance(found, (int, float)):
        return bool(abs(stored - found) <= max(tolerance * scale, ABSOLUTE))
    a, b = str(stored), str(found)
    if a == b:
        return True
    numbers, others = NUMBER.findall(a), NUMBER.findall(b)
    if NUMBER.sub("#", a) != NUMBER.sub("#", b) or len(numbers) != len(others):
        return False
    share = max(tolerance, 1e-3)
    pairs = zip(numbers, others, strict=True)
    return all(abs(float(x) - float(y)) <= share * abs(float(x)) + 1e-12 for x, y in pairs)


def main() -> None:
    """Record or compare the runs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=("record", "compare"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", action="append", help="a run, or a pattern of runs; may be repeated")
    parser.add_argument("--tier", choices=("ten",), help="only the runs that stay in the tests")
    parser.add_argument("--cold", action="store_true", help="leave the second pass, from the warm store, out")
    parser.add_argument(
        "--tolerance", type=float, default=0.0, help="least share, for another machine than the recorder's"
    )
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    red = 0
    for run in load_runs():
        path = options.folder / f"{run.name}.json"
        if options.only and not any(fnmatch.fnmatch(run.name, each) for each in options.only):
            continue
        if (options.tier and not run.ten) or (
            "RECORDINGS" in run.argv[0] and not os.environ.get("SOFTCOVER_RECORDINGS")
        ):
            continue
        if options.action == "compare" and not path.exists():
            print(f"{run.name}: not recorded", flush=True)
            continue
        before, store = os.times(), Path(tempfile.mkdtemp())
        try:
            found = execute(run, store)
            if options.action == "record":
                path.write_text(json.dumps(found, separators=(",", ":"), ensure_ascii=False) + "\n")
            differences = find_differences(run, json.loads(path.read_text()), found, options.tolerance)
            if not options.cold and not run.names:
                again = find_differences(run, json.loads(path.read_text()), execute(run, store), options.tolerance)
                differences += [f"from the store: {each}" for each in again]
        finally:
            shutil.rmtree(store)
        differences += [
            f"the message does not name {run.names}" for step in found["steps"] if not step.get("named", True)
        ]
        cpu = sum(os.times()[2:4]) - sum(before[2:4])
        red += bool(differences)
        print(
            f"{run.name}: {'RED' if differences else 'green'}, {cpu:.1f} s CPU",
            *differences[:8],
            sep="\n  ",
            flush=True,
        )
    sys.exit(bool(red))


if __name__ == "__main__":
    main()
