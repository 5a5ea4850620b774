"""Damaged files of strangers, read in worker processes: `python benchmarks/fuzz_inputs.py --files 10000`.

Each file is a good sensor file, parameters folder, MCAP or CSV recording, bag of another program, npz file, or STL file
that was damaged at random: flipped bits, cut ends, repeated or removed parts, and extreme numbers, names and brackets
in the place of words.  A file passes if it is read, or refused by a documented error, within 2 s of processor time and
500 MB above the memory of the process at its start, and if nothing is written outside the output folder.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import multiprocessing
import re
import resource
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from random import Random

#: Largest processor time [s], and memory above that at the start [bytes], that one file may take.
MOST_SECONDS, MOST_BYTES = 2.0, 500e6
#: Wall time after which a worker counts as hanging [s].
HANGING = 60.0
#: Words that replace words of a text.
WORDS = (
    "0", "-1", "1e300", "-1e300", "nan", "inf", "1e-300", "99999999999", "0xffffffffffffffffffff", "9" * 5000, '""',
    "[]", "{}", "[" * 2000, "{a=" * 200, "true", '"../../escaped"', '"/tmp/escaped"', '"/etc/passwd"', '"\\u001b[2J"',
    "\x00", "\x1b[2J", "\ufeff", "2 mm*9**9**9", '"1e400 mm"', '"1e-400 mm"', '"1 kg"', "a." * 3000, "#", "=", ",",
    "\n", "\r", '"' * 3, " " * 5000, "100000", "2147483648",
)  # fmt: skip
SENSOR = """
name = "own"
[array]
rows = 3
columns = 2
pitch = ["3.4 mm", "3 mm"]
texel_size = "2.5 mm"
mask = ["10", "11", "11"]
[[cover.layer]]
thickness = "2 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49, name = "x" }
[[cover.layer]]
thickness = "0.5 mm"
material = { model = "ogden", mu = ["150 kPa", "40 kPa"], alpha = [1.5, 4.0], poisson_ratio = 0.5 }
[cover]
base = "bonded"
size = ["24 mm", "51 mm"]
[electronics]
rate = "271 Hz"
characteristic = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
gains = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
bits = 12
noise = "1 mN"
calibrated = "through the cover, tip 1 mm"
[filter]
cutoff = "40 Hz"
order = 2
[spread]
sigma_x = 0.5
sigma_y = 0.5
ksize_x = 5
ksize_y = 5
"""


@cache
def make_good_files() -> dict[str, dict[str, bytes]]:
    """Make one good input of each kind: the bytes of its files by name."""
    import numpy as np

    import fastmodel
    from validation.recordings.importing import save
    from validation.recordings.recording import Recording, make_array

    counts = np.random.default_rng(0).integers(0, 4000, (20, 6)).astype(np.int32)
    recording = Recording(
        path=Path("x"), sha256="", started=datetime(2020, 1, 1, tzinfo=UTC), times=np.arange(20) * 0.01,
        arrays=(make_array(3, 2, counts),), forces=np.arange(5.0), force_times=np.arange(5.0),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fastmodel.load("wts-0614-34").save(folder)
        save(recording, folder / "a.mcap")
        toml, npz, mcap = ((folder / file).read_bytes() for file in ("parameters.toml", "cover.npz", "a.mcap"))
    lines = "".join(f"{k * 0.01},{','.join(map(str, row))}\n" for k, row in enumerate(counts))
    csv = f"# rows = 3\n# columns = 2\n# load = 1\n# note = x\ntime,{','.join('abcdef')}\n{lines}".encode()
    positioned = re.sub(r"mask.*|gains.*", "", SENSOR.replace("rows = 3\ncolumns = 2", 'positions = "p.csv"'))
    pair = {"parameters.toml": toml, "cover.npz": npz}
    return {
        "sensor file": {"s.toml": SENSOR.encode()},
        "positions": {"s.toml": positioned.encode(), "p.csv": b"x,y,z\n0,0,0\n0.01,0,0\n"},
        "parameters": pair,
        "npz": pair,
        "mcap": {"a.mcap": mcap},
        "csv": {"a.csv": csv},
        "binary stl": {"a.stl": make_stl(binary=True)},
        "ascii stl": {"a.stl": make_stl(binary=False)},
        **make_bags(),
    }  # fmt: skip


def make_bags() -> dict[str, dict[str, bytes]]:
    """Make recordings of 14 x 6 texels as other programs write them: a ROS 1 file, a ROS 2 folder and an MCAP file."""
    from rosbags.rosbag2 import StoragePlugin

    from tests.support.ros_bags import write_bag

    kinds = {"/pad": "std_msgs/msg/UInt8MultiArray"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_bag(folder / "a.bag", kinds, first=True, compressed=True)
        for plugin in (StoragePlugin.SQLITE3, StoragePlugin.MCAP):
            write_bag(folder / plugin.name, kinds, first=False, plugin=plugin)
        files = {file.name: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
        metadata = (folder / "SQLITE3" / "metadata.yaml").read_bytes()
    return {
        "ros1 bag": {"a.bag": files["a.bag"]},
        "ros2 folder": {"SQLITE3.db3": files["SQLITE3.db3"], "metadata.yaml": metadata},
        "ros2 mcap": {"b.mcap": files["MCAP.mcap"]},
    }


def make_stl(*, binary: bool) -> bytes:
    """Make the STL file of a pyramid of 10 x 10 x 5 mm."""
    import trimesh

    points = [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0), (5, 5, 5)]
    faces = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    made = trimesh.Trimesh(points, faces, process=False).export(file_type="stl" if binary else "stl_ascii")
    return made if isinstance(made, bytes) else made.encode()


#: Kinds of damage to texts and to other files; those that are listed more than once are more frequent.
ON_TEXT = ("word", "word", "word", "flip", "cut", "repeat", "remove")
ON_BYTES = ("flip", "flip", "fill", "cut", "repeat", "remove")


def damage(content: bytes, random: Random, *, text: bool) -> bytes:
    """Damage the bytes of a file in one to four places."""
    for _ in range(random.randint(1, 4)):
        place, end = random.randrange(len(content) + 1), random.randrange(len(content) + 1)
        match random.choice(ON_TEXT if text else ON_BYTES):
            case "word":
                words = list(re.finditer(rb'"[^"\n]*"|[\w.+-]+', content))
                spot = random.choice(words).span() if words else (place, place)
                content = content[: spot[0]] + random.choice(WORDS).encode() + content[spot[1] :]
            case "flip" if content:
                changed = bytearray(content)
                changed[place % len(content)] ^= 1 << random.randrange(8)
                content = bytes(changed)
            case "fill":
                content = content[:place] + random.choice((b"\xff", b"\0", b"\x7f")) * 8 + content[place + 8 :]
            case "cut":
                content = content[:place]
            case "repeat":
                content += content[min(place, end) : max(place, end)] * random.choice((1, 1, 20))
            case "remove":
                content = content[: min(place, end)] + content[min(max(place, end), place + 40) :]
    return content


def write_damaged(kind: str, random: Random, folder: Path) -> Path:
    """Write a damaged input of a kind; return the path that a command names."""
    files = dict(make_good_files()[kind])
    name = "cover.npz" if kind == "npz" else random.choice([each for each in files if each != "cover.npz"])
    files[name] = damage(files[name], random, text=name.endswith((".toml", ".csv", ".yaml")) or kind == "ascii stl")
    if kind == "npz":  # with the right hash, so that the content is read
        stated = f'sha256 = "{hashlib.sha256(files[name]).hexdigest()}"'.encode()
        files["parameters.toml"] = re.sub(rb'sha256 = ".*"', stated, files["parameters.toml"])
    for each, content in files.items():
        (folder / each).write_bytes(content)
    return find_input(files, folder)


def find_input(files: dict[str, bytes], folder: Path) -> Path:
    """Return the path that a command names: the folder, if the files are one input together, else the first file."""
    return folder if files.keys() & {"parameters.toml", "metadata.yaml"} else folder / next(iter(files))


def read_damaged(kind: str, path: Path, out: Path) -> str:
    """Read an input as the command line does; return what became of it, or raise an error that is not documented."""
    from validation.cli import main
    from validation.errors import InputError
    from validation.sensor_file import load
    from validation.text.indenter import read_indenter

    if kind in ("parameters", "npz"):
        return run(main, ["export", str(path), "--format", "gazebo", "--out", str(out)])
    if kind in ("mcap", "csv") or kind.startswith("ros"):
        out.mkdir()
        return run(main, ["import", str(path), "--out", str(out / "a.mcap"), "--json"])
    try:
        load(path) if kind in ("sensor file", "positions") else read_indenter(f"mesh:path={path}")
    except InputError:
        return "refused"
    return "read"


def run(main: Callable[[list[str]], None], words: list[str]) -> str:
    """Run a command; return what became of it, or raise an error if its status or message is not a documented one."""
    messages = io.StringIO()
    try:
        with contextlib.redirect_stderr(messages), contextlib.redirect_stdout(messages):
            main(words)
    except SystemExit as left:
        text = messages.getvalue()
        if left.code not in (0, 2) or not text.replace("\n", "").isprintable():
            raise RuntimeError(f"status {left.code}: {text[:500]!r}") from None
        return "read" if left.code == 0 else "refused"
    raise RuntimeError("no status")


def measure_peak() -> float:
    """Return the largest memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0


def try_file(kind: str, seed: int) -> tuple[str, str, float, float]:
    """Damage one file and read it: its kind, outcome or fault, processor time [s], growth of memory [bytes]."""
    with tempfile.TemporaryDirectory() as name:
        around = Path(name) / "around"
        (around / "in").mkdir(parents=True)
        path = write_damaged(kind, Random(seed), around / "in")  # noqa: S311 -- reproducible, no secret
        before = {each: each.stat().st_mtime_ns for each in Path(name).rglob("*") if each.is_file()}
        peak, started = measure_peak(), time.process_time()
        try:
            outcome = read_damaged(kind, path, around / "out")
        except BaseException:  # noqa: BLE001 -- every error here is a finding
            outcome = f"{kind} {seed}: {traceback.format_exc()[-1500:]}"
        seconds, growth = time.process_time() - started, measure_peak() - peak
        after = {
            each for each in Path(name).rglob("*") if each.is_file() and around / "out" not in (each, *each.parents)
        }
        if after != set(before) or any(each.stat().st_mtime_ns != before[each] for each in after):
            outcome = f"{kind} {seed}: wrote outside the output folder"
        return kind, outcome, seconds, growth


def warm_up() -> None:
    """Read one good file of each kind, so that imports do not count."""
    for kind, files in make_good_files().items():
        with tempfile.TemporaryDirectory() as name, tempfile.TemporaryDirectory() as out:
            for each, content in files.items():
                (Path(name) / each).write_bytes(content)
            outcome = read_damaged(kind, find_input(files, Path(name)), Path(out) / "out")
            if outcome != "read":
                raise RuntimeError(f"the good {kind} is {outcome}")


def fuzz(files: int, seed: int, processes: int = 2) -> dict[str, object]:
    """Damage and read files in worker processes; return counts of outcomes, the worst cost and the faults."""
    kinds = list(make_good_files())
    outcomes: Counter[str] = Counter()
    faults: list[str] = []
    slowest, largest = 0.0, 0.0
    with multiprocessing.get_context("spawn").Pool(processes, warm_up) as pool:
        tasks = [(kinds[k % len(kinds)], 1_000_003 * seed + k) for k in range(files)]
        pending = [pool.apply_async(try_file, task) for task in tasks]
        for task, each in zip(tasks, pending, strict=True):
            try:
                kind, outcome, seconds, growth = each.get(timeout=HANGING + 120 * (each is pending[0]))
            except multiprocessing.TimeoutError:
                faults.append(f"{task}: still busy after {HANGING:g} s")
                break
            slowest, largest = max(slowest, seconds), max(largest, growth)
            if outcome not in ("read", "refused"):
                faults.append(outcome)
            elif seconds > MOST_SECONDS or growth > MOST_BYTES:
                faults.append(f"{task}: {seconds:.2f} s, {growth / 1e6:.0f} MB")
            else:
                outcomes[f"{kind}: {outcome}"] += 1
    return {
        "outcomes": dict(sorted(outcomes.items())),
        "slowest_s": slowest,
        "largest_mb": largest / 1e6,
        "faults": faults,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    found = fuzz(options.files, options.seed, options.processes)
    print(json.dumps(found, indent=1))
    sys.exit(bool(found["faults"]))
