"""The 2015 report's static campaign at finite strain: does every case converge, how well, and how long does it take?

    python benchmarks/campaign.py
    python benchmarks/campaign.py "small square" circle
    python benchmarks/campaign.py covers            quick validations of ten covers drawn at random
    python benchmarks/campaign.py covers 0 3 17     of three of any number of them

Shapes, loads and turns of the report, sizes and cover fixed here: 2 mm neo-Hookean, E = 1 MPa, nu = 0.49, frictionless,
wide.  The campaign runs twice, each time in a process of its own: with an empty store, and from the store.
"""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from fem_reference.indentation.press import press, press_path
from fem_reference.indentation.result import Indentation
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Box, Cylinder, Indenter, LetterH, Nut, Pose, TexelArray
from meshes.constants import STANDARD_GRAVITY
from tests.support.rubber import make_cover

LOADS = (0.1 * STANDARD_GRAVITY, 0.5 * STANDARD_GRAVITY)
SHAPES: dict[str, Indenter] = {
    "small square": Box(size=(6e-3, 6e-3, 10e-3)),
    "big square": Box(size=(12e-3, 12e-3, 10e-3)),
    "circle": Cylinder(radius=5e-3),
    "big rectangle": Box(size=(6e-3, 18e-3, 10e-3)),
    "small rectangle": Box(size=(4e-3, 10e-3, 10e-3)),
    "nut": Nut(across=13e-3, bore=8e-3),
    "H": LetterH(size=(12e-3, 16e-3), bar=4e-3),
}
#: Turns that tell a shape from itself, where there are fewer than `ALL_TURNS` [deg].
TURNS, ALL_TURNS = {"small square": (0, 45), "big square": (0, 45), "circle": (0,)}, (0, 45, 90)


def row(name: str, load: float, turn: float, found: Indentation) -> dict[str, object]:
    """What is reported of a case."""
    return {
        "case": f"{name}, {load:.3g} N, {turn} deg",
        "depth": found.depth,
        "peak": float(found.texel_forces.max()),
        "peak_error": found.error_estimate["peak_texel"],
        "force_error": found.error_estimate["total_force"],
    }


def two_squares(array: TexelArray) -> dict[str, object]:
    """Both at once: each alone at finite strain, and what the other changes at small strain."""
    bodies = [
        Body(indenter=SHAPES[name], load=load, at=(0.0, y))
        for name, load, y in (("big square", LOADS[1], -8e-3), ("small square", LOADS[0], 8e-3))
    ]
    finite, small = make_cover(), make_cover(model="linear-elastic")
    alone = [press_path(finite, array, body.indenter, loads=LOADS, pose=Pose.planar(at=body.at)) for body in bodies]
    deep = [path[LOADS.index(body.load)] for path, body in zip(alone, bodies, strict=True)]
    flat = [press(small, array, body.indenter, load=body.load, pose=Pose.planar(at=body.at)) for body in bodies]
    both = press_together(small, array, bodies)
    forces = both.texel_forces + sum(d.texel_forces - f.texel_forces for d, f in zip(deep, flat, strict=True))
    peak = int(np.argmax(forces))
    return {
        "case": "two squares, 4.9 and 0.981 N",
        "depth": float(both.depths[0]),
        "peak": float(forces[peak]),
        "peak_error": deep[0].error_estimate["peak_texel"] + both.error_estimate["misplaced"],
        "force_error": deep[0].error_estimate["total_force"],
    }


def work(names: list[str]) -> None:
    """Run the campaign in this process and print it as JSON; what is done goes to stderr as it comes."""
    array = TexelArray.grid(14, 6, pitch=3.4e-3)
    rows, seconds = [], {}
    for name in names:
        clock, started = time.perf_counter(), time.process_time()
        for turn in TURNS.get(name, ALL_TURNS):
            pose = Pose.planar(yaw=float(np.radians(turn)))
            path = press_path(make_cover(), array, SHAPES[name], loads=LOADS, pose=pose)
            rows += [row(name, load, turn, found) for load, found in zip(LOADS, path, strict=True)]
        seconds[name] = time.perf_counter() - clock, time.process_time() - started
        print(f"{name}: {seconds[name][0]:.1f} s, {seconds[name][1]:.1f} s of CPU, {rows[-1]}", file=sys.stderr)
    if {"big square", "small square"} <= set(names):
        rows.append(two_squares(array))
    usage = resource.getrusage(resource.RUSAGE_SELF)
    print(
        json.dumps({"rows": rows, "seconds": seconds, "cpu": usage.ru_utime + usage.ru_stime, "kib": usage.ru_maxrss})
    )


def run(store: str, names: list[str]) -> tuple[dict, float]:
    """The campaign in a process of its own, and its wall time."""
    started = time.perf_counter()
    environment = {**os.environ, "SOFTCOVER_STORE": store}
    done = subprocess.run(
        [sys.executable, __file__, "--work", *names], env=environment, stdout=subprocess.PIPE, check=True, text=True
    )
    return json.loads(done.stdout), time.perf_counter() - started


#: Kinds of the ten drawn covers.
KINDS = ("soft", "foil", "limited", "thick", "curved")
#: Processor time that a quick validation may take [s].
MOST = 480.0


def draw_cover(number: int) -> str:
    """Draw a sensor file at random: an array, and a cover of one of `KINDS`."""
    draw, kind = np.random.default_rng([2026, number]), KINDS[number % len(KINDS)]
    pitch, rows, columns = draw.choice([2.5, 3.4, 4.0, 5.0]), draw.integers(6, 13), draw.integers(5, 9)
    rubber = draw.choice(["ecoflex-00-30", "ecoflex-00-50", "dragon-skin-10", "dragon-skin-30"])
    thickness = draw.uniform(5, 9) if kind == "thick" else draw.uniform(1.5, 3.5)
    layers = [f'{{ thickness = "{thickness:.2f}mm", material = "{rubber}" }}']
    if kind == "foil":
        film = draw.choice(["tpu", "sylgard-184", "polyimide", "pet"])
        layers.append(f'{{ thickness = "{1e3 * draw.choice([0.025, 0.05, 0.1]):.0f}um", material = "{film}" }}')
    array = f'[array]\nrows = {rows}\ncolumns = {columns}\npitch = "{pitch}mm"\n'
    if kind == "curved":
        shape = ("fingertip", "phalanx")[number // len(KINDS) % 2]
        return f"{shape} --thickness {draw.uniform(1.5, 2.5):.2f}mm"
    size = "" if kind != "limited" else f'size = ["{columns * pitch + 3:.1f}mm", "{rows * pitch + 3:.1f}mm"]\n'
    return f"{array}[cover]\n{size}layer = [ {', '.join(layers)} ]\n"


def validate_covers(numbers: list[int]) -> None:
    """Validate drawn covers quickly, each in a process of its own with an empty store, and print what it took."""
    print(
        "| cover | announced [s] | CPU [s] | ratio | verdict | cases, shapes, loads | |\n|---|---|---|---|---|---|---|"
    )
    for number in numbers:
        text, before = draw_cover(number), resource.getrusage(resource.RUSAGE_CHILDREN)
        with tempfile.TemporaryDirectory() as folder:
            sensor = text.split()
            if "[array]" in text:
                sensor = ["sensor.toml"]
                Path(folder, "sensor.toml").write_text(text, encoding="utf-8")
            program = [sys.executable, "-c", "from validation.cli import main; main()", "validate", *sensor]
            environment = {**os.environ, "SOFTCOVER_STORE": f"{folder}/store", "OMP_NUM_THREADS": "1"}
            environment["PYTHONPATH"] = str(Path(__file__).resolve().parents[1])
            done = subprocess.run(
                [*program, "--quick", "--json"],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        told = re.search(r"; about (\d+) (s|min)\n", done.stderr)
        announced = int(told[1]) * (60 if told[2] == "min" else 1) if told else float("nan")
        name = f"{number}, {KINDS[number % len(KINDS)]}: {' '.join(text.split('[cover]')[-1].split())}"
        if not done.stdout:
            print(
                f"| {name} | {announced:.0f} | {busy:.0f} | | {done.returncode} | | {done.stderr[-400:]} |", flush=True
            )
            continue
        found = json.loads(done.stdout)
        cases, verdict = found["campaign"]["cases"], found["verdict"]
        shapes, loads = {each["indenter"].split(":")[0] for each in cases}, {each["load"] for each in cases}
        print(
            f"| {name} | {announced:.0f} | {busy:.0f}{' MISSED' * (busy > MOST)} | {announced / busy:.2f} "
            f"| {verdict['verdict']} | {len(cases)}, {len(shapes)}, {len(loads)} "
            f"| {'; '.join(verdict['reasons'][:2])} |", flush=True,
        )  # fmt: skip


def main(names: list[str]) -> None:
    """Run twice and print."""
    with tempfile.TemporaryDirectory() as store:
        cold, wall = run(store, names)
        warm, again = run(store, names)
    print("| case | depth [mm] | peak texel [N] | its estimated error [%] | of the force [%] |")
    print("|---|---|---|---|---|")
    for each in cold["rows"]:
        print(
            f"| {each['case']} | {1e3 * each['depth']:.4f} | {each['peak']:.4f} "
            f"| {100 * each['peak_error']:.2f} | {100 * each['force_error']:.2f} |"
        )
    print("\n| shape, all loads and turns | wall [s] | CPU [s] |")
    print("|---|---|---|")
    for name, (elapsed, busy) in cold["seconds"].items():
        print(f"| {name} | {elapsed:.0f} | {busy:.0f} |")
    errors = [each["peak_error"] for each in cold["rows"]]
    print(f"\n{len(errors)} cases; peak texel: estimated error {100 * max(errors):.2f} % at most")
    print(f"empty store: {wall:.0f} s wall, {cold['cpu']:.0f} s of CPU, {cold['kib'] / 2**20:.2f} GiB")
    print(f"from the store: {again:.1f} s wall; same answers: {cold['rows'] == warm['rows']}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["covers"]:
        validate_covers([int(each) for each in sys.argv[2:]] or list(range(2 * len(KINDS))))
        raise SystemExit
    wanted = [name for name in sys.argv[1:] if name in SHAPES] or list(SHAPES)
    work(wanted) if "--work" in sys.argv else main(wanted)
