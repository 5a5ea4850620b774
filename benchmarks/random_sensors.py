"""Run random sensors through `softcover derive` and `softcover press`, each as a user would, and count what goes wrong.

Wrong are: a traceback; NaN, infinity or null in place of a number, in the output or in the files of the derived
sensor; a command of more than a minute of processor time that has not said within this minute that it takes long; and a
refusal that does not name the option and what would be accepted.

    python benchmarks/random_sensors.py [--cases 300] [--seed 12] [--processes 2] [--out benchmarks/random_sensors.md]

Finished sensors are kept in a file of JSON lines, and a second run goes on from there.  Each sensor has a result store
of its own.
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from resumable import hash_code, read_options, run_cases, state_code

#: Folder of the repository.
ROOT = Path(__file__).resolve().parents[1]
#: Processor time after which a command is ended [s], which a busy machine does not change, and address space [bytes].
LIMIT, MEMORY = 400, 8 * 2**30
#: Processor time beyond which a command must have said on standard error that it takes long [s].
PATIENCE = 60
#: Shares of presses in three dimensions (a cover of limited size, or a shape that is not round on rubber), of
#: those with friction, of sensors with rubber, and of covers on a sliding base [-].
SOLID, FRICTION, RUBBER, SLIDING, HALF = 0.07, 0.08, 0.25, 0.2, 0.5
#: Exit statuses of bad input and of a solver that stopped early (`docs/json.md`).
REFUSED, STOPPED = 2, 4
#: What a refusal says would be accepted, or what a stopped solver needs.
ADVICE = re.compile(
    r"\bmust\b|\baccepted|\buse |\bgive |\bpress less|at least|at most|\bbetween\b|\.\.|\bchoose |known:"
)
#: An option or a key of the file, which a refusal names.
NAMES = re.compile(r"--[a-z]+|\b(array|cover|electronics|contact)(\.|\[)\w")
#: How far a solver came that stopped early.
REACHED = re.compile(r"\d ?(N|mm)\b")
#: Words of a progress line that say that the command takes long.
LONG = re.compile(r"takes (long|minutes|about|up to)|min(utes)? left|\d+ of \d+")
#: Keys of JSON output whose null has a meaning (`docs/json.md`): no two loads are told apart, a table that covers with
#: free side edges lack, an estimator that fits nothing, a characteristic of the texel force, and a path that
#: did not stop early.
NULLS = {
    "cover.size_m",
    "resolution",
    "resolution_on_array",
    "point_response",
    "calibration.tip",
    "depth",
    "stopped",
    "models.fast.depth",
}

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


def run_command(arguments: list[str], folder: Path) -> dict[str, Any]:
    """Run a command of softcover and record what it printed and when, its status, its time and its memory."""
    environment = os.environ | {"SOFTCOVER_STORE": str(folder / "store"), "OMP_NUM_THREADS": "1"}
    started = time.perf_counter()
    with tempfile.TemporaryFile("w+") as output:
        program = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from validation.cli import main; main()"
        process = subprocess.Popen(
            [sys.executable, "-u", "-c", program, *arguments],
            stdout=output,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            preexec_fn=_set_limits,  # noqa: PLW1509 -- no threads run yet
        )
        lines = [(round(time.perf_counter() - started, 1), line.rstrip()) for line in process.stderr or ()]
        _, code, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - started
        output.seek(0)
        out = output.read()
    status = None if os.WIFSIGNALED(code) else os.WEXITSTATUS(code)
    cpu = usage.ru_utime + usage.ru_stime
    faults = find_faults(status, out, [(when * cpu / seconds, text) for when, text in lines], cpu)
    if status == 0:
        faults += [f"{path.name}: not a number" for path in sorted(folder.glob("derived/*")) if _has_no_number(path)]
    return {
        "command": "softcover " + " ".join(arguments),
        "seconds": round(seconds, 1),
        "cpu_seconds": round(cpu, 1),
        "gigabytes": round(usage.ru_maxrss / 1e6, 2),
        "status": status,
        "faults": faults,
        "error": "\n".join(text for _, text in lines)[-1500:],
    }


def _set_limits() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def find_faults(status: int | None, out: str, lines: list[tuple[float, str]], seconds: float) -> list[str]:
    """List what is wrong with the answer of a command.

    Args:
        status: Exit status; None if the command was ended.
        out: Standard output.
        lines: Processor time [s] and text of each line on standard error.
        seconds: Processor time that the command took.
    """
    faults = []
    err = "\n".join(text for _, text in lines)
    if "Traceback" in err or re.search(r"^\w*(Error|Exception)\b", err, re.MULTILINE):
        faults.append("traceback")
    if status is None:
        faults.append(f"not finished in {LIMIT} s")
    if seconds > PATIENCE and not any(when < PATIENCE and LONG.search(text) for when, text in lines):
        faults.append(f"over {PATIENCE} s without a line before that says so")
    return faults + _find_faults_of_ending(status, out, [text for _, text in lines])


def _find_faults_of_ending(status: int | None, out: str, lines: list[str]) -> list[str]:
    """List what is wrong with the result, the refusal or the early stop of a command."""
    if status == 0:
        try:
            return [f"not a number: {place}" for place in sorted(set(find_no_numbers(json.loads(out))))]
        except ValueError:
            return ["output is not JSON"]
    if status == REFUSED:
        refusals = [text for text in lines if text.startswith("softcover: ") and "warning" not in text]
        if not refusals or not all(NAMES.search(text) and ADVICE.search(text) for text in refusals):
            return ["refusal that does not name the option and what would be accepted"]
    elif status == STOPPED:
        if not (lines and REACHED.search(lines[-1]) and ADVICE.search(lines[-1])):
            return ["stopped without a line that says how far it came and what to do"]
    elif status is not None:
        return [f"status {status}"]
    return []


def find_no_numbers(value: Any, place: str = "") -> Iterator[str]:  # noqa: ANN401 -- any JSON value
    """Yield the places of a JSON value that hold NaN, infinity, or null where a number belongs."""
    if isinstance(value, dict):
        for name, each in value.items():
            yield from find_no_numbers(each, f"{place}.{name}" if place else name)
    elif isinstance(value, list):
        for each in value:
            yield from find_no_numbers(each, place)
    elif value is None:
        yield from [] if place in NULLS else [place]
    elif isinstance(value, str):
        yield from [place] if value.lower() in {"nan", "inf", "-inf", "infinity"} else []
    elif not math.isfinite(value):
        yield place


def _has_no_number(path: Path) -> bool:
    """Return whether a file of a derived sensor holds a value that is not a number."""
    match path.suffix:
        case ".toml":
            return bool(re.search(r"[=\[,]\s*[+-]?(nan|inf)\b", path.read_text()))
        case ".npz":
            with np.load(path) as arrays:
                tables = [arrays[name] for name in arrays.files]
            return not all(np.isfinite(each).all() for each in tables if each.dtype.kind == "f")
        case ".json":
            return any(True for _ in find_no_numbers(json.loads(path.read_text())))
    return False


def try_sensor(seed: int, number: int) -> dict[str, Any]:
    """Derive and press one random sensor."""
    rng = np.random.default_rng([seed, number])
    solid = bool(rng.random() < SOLID)
    text, round_only = draw_sensor(rng, solid=solid)
    options = draw_press(rng, solid=solid, round_only=round_only)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "sensor.toml"
        path.write_text(text)
        commands = [
            ["derive", str(path), "--out", str(folder / "derived"), "--json"],
            ["press", str(path), *options, "--json"],
        ]
        runs = [run_command(each, folder) for each in commands]
    return {"solid": solid, "sensor": text, "runs": runs}


def write_table(records: list[dict[str, Any]], command: str, code: str) -> str:
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
    runs = [run for record in records for run in record["runs"]]
    cpu, longest, memory = ([run[name] for run in runs] or [0.0] for name in ("cpu_seconds", "seconds", "gigabytes"))
    head = [
        "# Random sensors through `derive` and `press`",
        "",
        f"`{command}`",
        "",
        f"{code}  {sum(record['solid'] for record in records)} sensors are pressed in three dimensions.",
        f"{sum(cpu) / 60:.0f} min of processor time; longest command {max(longest):.0f} s, {max(memory):.1f} GB.",
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
    given = read_options((__doc__ or "").partition("\n")[0], name="random-sensors", cases=300)
    code = hash_code("fem_reference", "meshes", "fastmodel", "validation")
    records = run_cases(try_sensor, given, code)
    command = f"python benchmarks/random_sensors.py --cases {given.cases} --seed {given.seed}"
    text = write_table(records, command, state_code(records, code))
    print(text)
    if given.out:
        given.out.write_text(text)


if __name__ == "__main__":
    main()
