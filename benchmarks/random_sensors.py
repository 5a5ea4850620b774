"""Run random sensors through `softcover derive` and `softcover press`, each as a user would, and count what goes wrong.

Wrong are: a traceback, an output that is not a number, a command of more than a minute whose progress lines do not say
how long it takes or how far it is, and a refusal that does not name what to change or what would be accepted.

    python benchmarks/random_sensors.py [--sensors 300] [--seed 12] [--processes 2] [--out benchmarks/random_sensors.md]

Finished sensors are kept in a file of JSON lines, and a second run goes on from there.  Each sensor has a result store
of its own.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

#: Seconds after which a command is ended.
LIMIT = 400
#: Seconds beyond which a command must have said on standard error how far it is.
PATIENCE = 60
#: Shares of presses in three dimensions (a cover of limited size, or a shape that is not round on rubber), of
#: those with friction, of sensors with rubber, and of covers on a sliding base [-].
SOLID, FRICTION, RUBBER, SLIDING, HALF = 0.07, 0.08, 0.25, 0.2, 0.5
#: Words of which a refusal contains one: it says what would be accepted or what to do instead.
ADVICE = re.compile(
    r"must|needs?\b|use |give |at least|at most|between|\.\.|or |known|choose|less|more|wider|instead|limit|only|up to"
)
#: Words of which a refusal contains one: it names an option, a key of the file or a quantity.
NAMES = re.compile(
    r"--\w|thickness|material|modulus|poisson|pitch|size|depth|load|indenter|radius|layer|rows|columns|friction|cover|range"
)

RUBBERS = ("ecoflex-00-30", "dragon-skin-10", "dragon-skin-30", "rtv615-yeoh", "ecoflex-00-50-ogden", "neoprene")


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is even between those of two limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_sensor(rng: np.random.Generator, *, solid: bool) -> tuple[str, bool]:
    """Draw the text of a sensor file, and whether its cover has a limited size.

    Args:
        rng: Source of random numbers.
        solid: Whether the press is one in three dimensions; half of these have a cover of limited size.
    """
    pitch = log_uniform(rng, 0.5, 20)
    count = int(rng.choice([1, 1, 2, 3]))
    thickness = log_uniform(rng, 0.1, 20)
    share = rng.dirichlet(np.full(count, 2.0)) * (1 - 0.05 * count) + 0.05
    rows, columns = (int(rng.integers(2, 13)) for _ in range(2))
    limited = solid and bool(rng.random() < HALF)
    rubber = bool(rng.random() < RUBBER) or (solid and not limited)
    lines = ["[array]", f"rows = {rows}", f"columns = {columns}", f'pitch = "{pitch:.4g} mm"', ""]
    for part in share:
        lines += [
            "[[cover.layer]]",
            f'thickness = "{part * thickness:.4g} mm"',
            f"material = {draw_material(rng, rubber)}",
        ]
    if limited:
        lines += ["", "[cover]", f'size = ["{columns * pitch + 2:.4g} mm", "{rows * pitch + 2:.4g} mm"]']
    elif rng.random() < SLIDING:
        lines += ["", "[cover]", 'base = "sliding"']
    lines += ["", "[electronics]", 'rate = "271 Hz"', 'sensitivity = "2665.7 1/N"']
    return "\n".join(lines) + "\n", limited or rubber


def draw_material(rng: np.random.Generator, rubber: bool) -> str:
    """Draw a material as text of a sensor file: linear elastic, or a rubber with a stored energy."""
    nu = float(rng.choice([0.0, 0.3, 0.45, 0.49, 0.499, 0.5, round(float(rng.uniform(0, 0.5)), 3)]))
    if not rubber:
        modulus = log_uniform(rng, 1e3, 1e10)
        return f'{{ model = "linear-elastic", youngs_modulus = "{modulus:.4g} Pa", poisson_ratio = {nu} }}'
    if rng.random() < HALF:
        return f'"{rng.choice(RUBBERS)}"'
    shear = log_uniform(rng, 1e3, 1e7)
    return f'{{ model = "neo-hookean", shear_modulus = "{shear:.4g} Pa", poisson_ratio = {nu} }}'


def draw_press(rng: np.random.Generator, *, solid: bool, round_only: bool) -> list[str]:
    """Draw the options of `softcover press`.

    Args:
        rng: Source of random numbers.
        solid: Whether the press is one in three dimensions: then friction is as likely as anywhere.
        round_only: Whether any other shape than one of revolution would need three dimensions.
    """
    a, b = log_uniform(rng, 0.5, 20), log_uniform(rng, 0.5, 20)
    round_shapes = [
        f"sphere:radius={a:.3g}mm",
        f"cylinder:radius={a:.3g}mm",
        f"cone:angle={rng.uniform(60, 170):.0f}deg,radius={a:.3g}mm",
        f"tip:radius={a:.3g}mm",
    ]
    others = [
        f"box:size={a:.3g}mmx{b:.3g}mmx5mm",
        f"roller:radius={a:.3g}mm,length={b:.3g}mm",
        f"nut:across={a:.3g}mm,bore={0.6 * a:.3g}mm",
    ]
    friction = bool(rng.random() < FRICTION)
    of_revolution = not solid and (friction or round_only or rng.random() < HALF)
    shape = str(rng.choice(round_shapes if of_revolution else others))
    options = ["--indenter", shape, "--load", f"{log_uniform(rng, 1e-3, 1e3):.4g}N"]
    if friction:
        options += ["--friction", str(rng.choice(["0.4", "no-slip"]))]
    return options


def run_command(arguments: list[str], store: Path) -> dict[str, Any]:
    """Run a command of softcover and record what it printed, its status and its time."""
    environment = os.environ | {"SOFTCOVER_STORE": str(store), "OMP_NUM_THREADS": "1"}
    started = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-c", "from validation.cli import main; main()", *arguments],
            capture_output=True,
            text=True,
            timeout=LIMIT,
            env=environment,
            check=False,
        )
        status, out, err = done.returncode, done.stdout, done.stderr
    except subprocess.TimeoutExpired as error:
        status, out, err = None, "", (error.stderr or b"").decode() if isinstance(error.stderr, bytes) else ""
    return {
        "command": "softcover " + " ".join(arguments),
        "seconds": round(time.perf_counter() - started, 1),
        "status": status,
        "faults": find_faults(status, out, err, time.perf_counter() - started),
        "error": err[-1500:],
    }


def find_faults(status: int | None, out: str, err: str, seconds: float) -> list[str]:
    """List what is wrong with the answer of a command."""
    faults = []
    if "Traceback" in err or "Error:" in err.partition("\n")[0]:
        faults.append("traceback")
    if status is None:
        faults.append(f"not finished in {LIMIT} s")
    if seconds > PATIENCE and not re.search(r"\d+ ?(s|min|%)|\d+/\d+|\d+ of \d+", err):
        faults.append(f"over {PATIENCE} s without a line that says so")
    if status == 0:
        try:
            numbers = list(find_numbers(json.loads(out)))
        except ValueError:
            faults.append("output is not JSON")
        else:
            if not all(math.isfinite(number) for number in numbers):
                faults.append("not a number")
    elif status is not None:
        last = " ".join(err.strip().splitlines()[-3:])
        if not (ADVICE.search(last) and NAMES.search(last)):
            faults.append("refusal without advice")
    return faults


def find_numbers(value: Any) -> Any:  # noqa: ANN401 -- any JSON value
    """Yield all numbers in a JSON value; the texts nan and inf count as numbers."""
    if isinstance(value, dict):
        for each in value.values():
            yield from find_numbers(each)
    elif isinstance(value, list):
        for each in value:
            yield from find_numbers(each)
    elif isinstance(value, float):
        yield value
    elif isinstance(value, str) and value.lower() in {"nan", "inf", "-inf", "infinity"}:
        yield math.nan


def try_sensor(seed: int, number: int) -> dict[str, Any]:
    """Derive and press one random sensor."""
    rng = np.random.default_rng([seed, number])
    solid = bool(rng.random() < SOLID)
    text, round_only = draw_sensor(rng, solid=solid)
    options = draw_press(rng, solid=solid, round_only=round_only)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sensor.toml"
        path.write_text(text)
        commands = [["derive", str(path), "--json"], ["press", str(path), *options, "--json"]]
        runs = [run_command(each, Path(folder) / "store") for each in commands]
    return {"seed": seed, "number": number, "solid": solid, "sensor": text, "runs": runs}


def write_table(records: list[dict[str, Any]], command: str) -> str:
    """Write the report in Markdown."""
    counts: dict[str, int] = {}
    lines = []
    for record in records:
        for run in record["runs"]:
            verb = run["command"].split()[1]
            ending = {0: "done", None: "not finished"}.get(run["status"], f"status {run['status']}")
            counts[f"{verb}: {ending}"] = counts.get(f"{verb}: {ending}", 0) + 1
            for fault in run["faults"]:
                counts[f"fault: {fault}"] = counts.get(f"fault: {fault}", 0) + 1
            if run["faults"]:
                told = " / ".join(run["error"].strip().splitlines()[-2:])
                lines.append(
                    f"- {record['number']} {verb} {', '.join(run['faults'])} ({run['seconds']} s): "
                    f"`{run['command'].partition('--indenter')[2] or run['command']}`: {told[:300]}"
                )
    seconds = [run["seconds"] for record in records for run in record["runs"]] or [0.0]
    head = [
        "# Random sensors through `derive` and `press`",
        "",
        f"`{command}`",
        "",
        f"{len(records)} sensors, {sum(record['solid'] for record in records)} pressed in three dimensions.",
        f"{sum(seconds) / 60:.0f} min of commands, longest {max(seconds):.0f} s.",
        "",
        "| outcome | count |",
        "| --- | --- |",
        *(f"| {name} | {count} |" for name, count in sorted(counts.items())),
        "",
        f"## Faults ({len(lines)})",
        "",
    ]
    return "\n".join([*head, *lines]) + "\n"


def main() -> None:
    """Run the sensors and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sensors", type=int, default=300)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--first", type=int, default=0, help="number of the first sensor")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=55, help="start no sensor after this time")
    parser.add_argument("--lines", type=Path, help="file of JSON lines; a temporary one by default")
    parser.add_argument("--out", type=Path, help="file for the table")
    given = parser.parse_args()
    lines = given.lines or Path(tempfile.gettempdir()) / f"softcover-random-sensors-{given.seed}.jsonl"
    wanted = range(given.first, given.first + given.sensors)
    records = [json.loads(line) for line in lines.read_text().splitlines()] if lines.exists() else []
    left = [number for number in wanted if number not in {record["number"] for record in records}]
    with ThreadPoolExecutor(given.processes) as pool, lines.open("a") as file:
        deadline = time.time() + 60 * given.minutes
        tried = pool.map(lambda number: try_sensor(given.seed, number) if time.time() < deadline else None, left)
        for done, record in enumerate(tried, start=1):
            if record is None:
                break
            records.append(record)
            file.write(json.dumps(record) + "\n")
            file.flush()
            print(f"{done} of {len(left)} sensors", file=sys.stderr)
    records = sorted((record for record in records if record["number"] in wanted), key=lambda r: r["number"])
    text = write_table(records, f"python benchmarks/random_sensors.py --sensors {given.sensors} --seed {given.seed}")
    print(text)
    if given.out:
        given.out.write_text(text)


if __name__ == "__main__":
    main()
