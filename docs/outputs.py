"""Write what each command prints on a terminal of 80 columns into docs/outputs.md.

python docs/outputs.py                  runs all commands and writes the page
python docs/outputs.py derive press     runs these commands, and keeps what the page shows of the others

`tests/test_outputs.py` compares the page with what the commands print, with a tolerance for numbers.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import fastmodel
from meshes import Box, Sphere

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "outputs.md"
HEAD = """# What each command prints

On a terminal of 80 columns, in an empty folder, one after the other. The page is written
by `python docs/outputs.py`; the tests run the commands again and compare.
"""
#: Commands that need no finite elements, and those that need some; each may use the files of those above it.
QUICK = (
    "softcover init",
    "softcover materials",
    "softcover materials dragon-skin-30",
    "softcover materials --hardness 30",
    "softcover datasheet wts-0614-34",
    "softcover datasheet wts-0614-34 --compare sdh2-proximal takkstrip",
    "softcover limits wts-0614-34 --noise 5mN --two 3.4mm",
    'softcover sweep sweep.toml --wish "place_x_force_known < 400 um"',
    "softcover design wts-0614-34 --thickness 1mm:5mm:5 --hardness 30A:60A:2 --noise 5mN",
    "softcover export wts-0614-34 --format urdf --mass 20g --out urdf",
    "softcover export wts-0614-34 --out parameters",
    "softcover press wts-0614-34 --indenter sphere:radius=5mm --load 500g --model fast",
    "softcover view wts-0614-34 --indenter sphere:radius=5mm --load 500g --seconds 1",
    "softcover regress parameters --baseline sensor.json --update",
    "softcover regress parameters --baseline sensor.json",
    "softcover emulate wts --seconds 20",
    "softcover doctor --port wts",
    "softcover record wts --seconds 1 --out touch.mcap",
    "softcover replay touch.mcap",
    "softcover import touch.mcap --load 500g --out labelled.mcap",
    "softcover locate wts-0614-34 ball.csv --noise 5mN",
    "softcover calibrate 1N.csv 2N.csv 3N.csv 4N.csv --sensor wts-0614-34",
    "softcover calibrate --sensor wts-0614-34 --next 4 --noise 5mN --plan touches",
    "softcover store list",
    "softcover doctor",
)
SLOW = (
    "softcover derive sensor.toml --out derived",
    "softcover press wts-0614-34 --indenter sphere:radius=5mm --load 500g --at=0.7mm,-1.1mm",
    "softcover mesh flat-pad",
    "softcover validate wts-0614-34 --quick --out report",
)
#: Commands that take more than a minute of processor time.
LONG = ("softcover validate wts-0614-34 --measured gelsight-mini",)
ALL = (*QUICK, *SLOW, *LONG)
#: Commands whose output depends on the machine, on a live line or on what is in the store, and is not compared.
OF_THIS_MACHINE = (
    "softcover doctor",
    "softcover doctor --port wts",
    "softcover calibrate 1N.csv 2N.csv 3N.csv 4N.csv --sensor wts-0614-34",
    "softcover store list",
)
#: Commands that record in real time, whose number of frames depends on the load of the machine: words are compared.
IN_REAL_TIME = (
    "softcover emulate wts --seconds 20",
    "softcover record wts --seconds 1 --out touch.mcap",
    "softcover replay touch.mcap",
    "softcover import touch.mcap --load 500g --out labelled.mcap",
)
#: Lines of progress, which depend on the speed of the machine and on what is in the store.
_PROGRESS = re.compile(
    r"^\[ *[\d.]+ s\].*\n?|^\d+ cases?, .*\n?|^all reference solutions .*\n?|^the result store .*\n?|^.*ompil.*\n?"
    r"|^ *[\d.]+ s  \d+ frames.*\n?|^\d+ designs: .*\n?|^one design takes .*\n?",
    flags=re.MULTILINE,
)
#: Keys of stored results, which depend on the version of the code.
_KEY = re.compile(r"\b[0-9a-f]{12}\b")


def run_commands(commands: tuple[str, ...], folder: Path, store: Path | None = None) -> dict[str, str]:
    """Run commands in a folder; return what each writes to standard error and output, in this order.

    Args:
        commands: The commands.
        folder: Folder in which they run.
        store: Folder of kept finite-element results; an empty one in `folder` if None.
    """
    programs = Path(sys.executable).parent
    environment = {**os.environ, "COLUMNS": "80", "LINES": "60", "PATH": f"{programs}:{os.environ['PATH']}"}
    environment["PYTHONPATH"] = f"{ROOT}:{os.environ.get('PYTHONPATH', '')}"
    environment.pop("SOFTCOVER_RECORDINGS", None)
    environment["SOFTCOVER_STORE"] = str(store or folder / "store")
    write_recordings(folder)
    found, emulator = {}, None
    for command in commands:
        words = shlex.split(command)
        if words[1] == "emulate":
            emulator = subprocess.Popen(words, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)
            while not (folder / "wts").exists():
                time.sleep(0.1)
            continue
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        text = join_streams(done.stderr, done.stdout)
        found[command] = _KEY.sub("0" * 12, text.replace(str(folder), "FOLDER")).rstrip()
    if emulator is not None:
        (command,) = (each for each in commands if each.split()[1] == "emulate")
        found[command] = emulator.communicate()[1].rstrip()
    return found


def join_streams(error: str, output: str) -> str:
    """Return messages without progress, then the result, then the line that says what to do next."""
    lines = _PROGRESS.sub("", error).splitlines(keepends=True)
    messages, advice = ([line for line in lines if line.startswith("next: ") == last] for last in (False, True))
    return "".join((*messages, output, *advice))


def write_recordings(folder: Path) -> None:
    """Write a sweep file, and recordings of a built-in sensor with 1500 counts per newton under four known weights."""
    text = 'sensor = "wts-0614-34"\nmeasure = "limits"\n[designs]\n"cover.layer[0].thickness" = "1 mm : 3 mm : 3"\n'
    (folder / "sweep.toml").write_text(text)
    sensor = fastmodel.load("wts-0614-34")
    pressed = fastmodel.indent(sensor, Sphere(radius=5e-3), load=2.0, at=(0.7e-3, -1.1e-3))
    ball = sensor.electronics.counts(pressed.texel_forces)
    lines = [f"{time},{','.join(map(str, counts))}" for time, counts in ((0.0, 0 * ball), (0.1, ball))]
    head = "time," + ",".join(f"texel_{texel}" for texel in range(len(ball)))
    (folder / "ball.csv").write_text("\n".join([head, *lines]) + "\n")
    labels = "# rows = 14\n# columns = 6\n# pitch = 0.0034\n# full_scale = 4095\n# indenter = box:size=10mmx10mmx5mm\n"
    for newton in (1, 2, 3, 4):
        counts = 1500 * fastmodel.indent(sensor, Box(size=(10e-3, 10e-3, 5e-3)), load=newton).texel_forces
        lines = ["time," + ",".join(f"texel_{texel}" for texel in range(len(counts)))]
        for frame in range(500):
            ripple = [round(count + (frame * (texel + 3)) % 5 - 2) for texel, count in enumerate(counts.tolist())]
            lines.append(f"{0.02 * frame:.2f}," + ",".join(map(str, ripple)))
        (folder / f"{newton}N.csv").write_text(f"{labels}# load = {newton}\n" + "\n".join(lines) + "\n")


def read_page() -> dict[str, str]:
    """Read the outputs of the page by command."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    pattern = r"^```sh notest\n(.*?)\n```\n\n```text\n(.*?)\n```$"
    return dict(re.findall(pattern, text, flags=re.MULTILINE | re.DOTALL))


def main() -> None:
    """Run the commands and write the page."""
    wanted = set(sys.argv[1:])
    commands = tuple(command for command in ALL if not wanted or command.split()[1] in {"init", *wanted})
    with tempfile.TemporaryDirectory() as folder:
        outputs = {**read_page(), **run_commands(commands, Path(folder))}
    sections, seen = [HEAD], set()
    for command in ALL:
        name = command.split()[1]
        heading = "" if name in seen else f"## {name}\n\n"
        seen.add(name)
        body = "\n".join(line.rstrip() for line in outputs.get(command, "").splitlines())
        sections.append(f"{heading}```sh notest\n{command}\n```\n\n```text\n{body}\n```\n")
    PAGE.write_text("\n".join(sections), encoding="utf-8")


if __name__ == "__main__":
    main()
