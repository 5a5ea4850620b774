"""Check whether the error estimates of `press` cover the true errors, on seeded random cases with independent truths.

Each case is drawn from its number and the seed: layers, shape, depth, control, friction, base, size of the cover, array
and position.  The truth (`coverage_truth.py`) is computed at the drawn depth; under load control `press` gets the true
force.  Cases whose truth has an error above a third of an estimate are left out for that quantity, and counted.

    python benchmarks/estimate_coverage.py [--study hard] [--cases 400] [--seed 12] [--processes 2] [--out TABLE.md]

Finished cases are kept in a file of JSON lines, and a second run goes on from there.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from coverage_truth import QUANTITIES, SAME_CODE, solve_truth
from scipy.stats import beta

from fem_reference import press
from meshes import (
    Box,
    Cone,
    Cover,
    Cylinder,
    Indenter,
    Layer,
    LetterH,
    Material,
    Nut,
    Prism,
    Roller,
    RoundedTip,
    Sphere,
    TexelArray,
)
from meshes.pose import Pose

#: Processor time after which a truth or a press is given up and counted as failed [s].
LIMIT = 120
#: Relative difference from the truth below which a value, the area of a flat face, is exact and has no error [-].
EXACT = 1e-9
#: Coefficient of the cases with friction [-].
COULOMB = 0.4
#: Largest tilt of a box [rad].
MOST_SLOPE = 3e-3
#: Largest tilt of a face that may lift [rad].
MOST_LIFTED = 1.5e-2
#: Poisson ratios that are drawn in half of the layers; the others are even in 0..0.5 [-].
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.499, 0.5)
#: Outlines on a grid of unit squares: corners of the L, the T, the U and a bracket.
OUTLINES = {
    "L": ((0, 0), (8, 0), (8, 3), (2, 3), (2, 9), (0, 9)),
    "T": ((0, 6), (3, 6), (3, 0), (6, 0), (6, 6), (9, 6), (9, 9), (0, 9)),
    "U": ((0, 0), (9, 0), (9, 8), (7, 8), (7, 2), (2, 2), (2, 8), (0, 8)),
    "bracket": ((0, 0), (6, 0), (6, 1.5), (1.5, 1.5), (1.5, 8.5), (6, 8.5), (6, 10), (0, 10)),
}
#: Share of the cases that each kind has.  On wide covers: bodies of revolution, flat faces, slightly tilted boxes and
#: rollers without friction; bodies of revolution without slip and with friction.  On covers of limited size, which are
#: solved in three dimensions: bodies of revolution with all three, far from the sides; pads under wider plates, where
#: the contact ends at the sides.  At finite strain: balls on a neo-Hookean layer [-].
KINDS = ("round", "face", "tilted", "roller", "no-slip", "friction", "limited", "plate", "finite", "lifted", "side")
#: Shares by study.  The second study has the cases that are hardest to check: friction, no slip, tilts of which a part
#: may lift, and faces, prisms and nuts near the free sides of pads, with and without slip [-].
SHARES = {
    "all": (0.34, 0.2, 0.05, 0.1, 0.1, 0.1, 0.06, 0.03, 0.02, 0.0, 0.0),
    "hard": (0.0, 0.0, 0.08, 0.0, 0.18, 0.2, 0.1, 0.06, 0.0, 0.18, 0.2),
}


@dataclass(frozen=True, eq=False)
class Case:
    """A random press: cover, array, indenter, depth or load, pose, tilt, friction and a description."""

    cover: Cover
    array: TexelArray
    indenter: Indenter
    depth: float
    by_load: bool
    pose: Pose
    tilt: tuple[float, float]
    friction: float
    kind: str
    text: str


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is even between those of two limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_cover(rng: np.random.Generator) -> Cover:
    """Draw a wide cover of one to three layers."""
    count = int(rng.choice([1, 1, 2, 3]))
    thickness = log_uniform(rng, 0.5e-3, 10e-3)
    share = rng.dirichlet(np.full(count, 2.0)) * (1 - 0.12 * count) + 0.12
    first = log_uniform(rng, 1e4, 1e7)
    layers: list[Layer] = []
    for part in share:
        nu = float(rng.choice(RATIOS)) if rng.random() < 0.5 else float(rng.uniform(0, 0.5))
        modulus = first if not layers else first * log_uniform(rng, 1 / math.sqrt(1e3), math.sqrt(1e3))
        material = Material(
            name="random", model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=round(nu, 4)
        )
        layers.append(Layer(thickness=float(part * thickness), material=material))
    return Cover(layers=tuple(layers), base="bonded" if rng.random() < 0.7 else "sliding")


def draw_round(rng: np.random.Generator, thickness: float, depth: float) -> Indenter:
    """Draw a body of revolution whose contact measures 0.1 to 4 thicknesses or so."""
    contact = log_uniform(rng, 0.1, 4.0) * thickness
    match rng.choice(["sphere", "sphere", "cone", "tip", "cylinder"]):
        case "cylinder":
            return Cylinder(radius=contact)
        case "cone":
            half_angle = np.clip(np.arctan(contact / depth), np.radians(20), np.radians(85))
            return Cone(angle=float(2 * half_angle), radius=20 * contact + 20 * thickness)
        case "tip":
            return RoundedTip(radius=max(contact**2 / depth, 3 * depth))
        case _:
            return Sphere(radius=max(contact**2 / depth, 3 * depth))


def draw_face(rng: np.random.Generator, thickness: float, most: float = 8.0) -> Indenter:
    """Draw a flat face that measures 0.3 to `most` thicknesses."""
    size = log_uniform(rng, 0.3, most) * thickness
    name = str(rng.choice(["box", "box", "L", "T", "U", "bracket", "nut", "H"]))
    if name == "box":
        return Box(size=(size, size / log_uniform(rng, 1, 12), size))
    if name == "nut":
        return Nut(across=size, bore=size * float(rng.uniform(0.4, 0.85)))
    if name == "H":
        return LetterH(size=(size, size), bar=size * float(rng.uniform(0.12, 0.3)))
    points = (np.array(OUTLINES[name]) / 10 - [0.45, 0.45]) * size
    return Prism(points=tuple((float(x), float(y)) for x, y in points))


def draw_indenter(rng: np.random.Generator, kind: str, thickness: float, depth: float) -> Indenter:
    """Draw the indenter of a kind of case."""
    match kind:
        case "face":
            return draw_face(rng, thickness)
        case "lifted" | "side":
            return draw_face(rng, thickness, most=3.0)
        case "tilted":
            size = log_uniform(rng, 0.5, 6.0) * thickness
            return Box(size=(size, size / log_uniform(rng, 1, 4), size))
        case "roller":
            radius = max(log_uniform(rng, 0.3, 3.0) ** 2 * thickness**2 / depth, 2 * depth)
            return Roller(radius=radius, length=log_uniform(rng, 0.5, 10) * thickness)
        case "finite":
            return Sphere(radius=thickness * log_uniform(rng, 1.0, 5.0))
    return draw_round(rng, thickness, depth)


def draw_case(study: str, seed: int, number: int) -> Case:
    """Draw the case of a number in a study."""
    rng = np.random.default_rng([seed, number])
    kind = str(rng.choice(KINDS, p=SHARES[study]))
    cover = draw_cover(rng)
    thickness = cover.thickness
    depth = log_uniform(rng, 0.005, 0.25) * thickness
    friction = {"no-slip": math.inf, "friction": COULOMB}.get(kind, 0.0)
    if kind == "side":
        friction = float(rng.choice([0.0, math.inf]))  # kept under boxes, whose solid elements take seconds
    if kind in {"limited", "plate"}:
        friction = float(rng.choice([0.0, 0.0, 0.0, COULOMB, math.inf]))
    indenter = draw_indenter(rng, kind, thickness, depth)
    pitch = log_uniform(rng, 0.3, 4.0) * thickness
    count = int(np.clip(np.ceil(2 * (4 * thickness + 3 * thickness) / pitch), 3, 15))
    array = TexelArray.grid(count, count, (pitch, pitch * float(rng.uniform(0.7, 1.4))))
    at = (float(rng.uniform(-0.5, 0.5)) * array.pitch[0], float(rng.uniform(-0.5, 0.5)) * array.pitch[1])
    tilt, yaw = (0.0, 0.0), 0.0
    match kind:
        case "face" | "roller" | "tilted" | "lifted" if rng.random() < 0.5:
            yaw = float(rng.uniform(-math.pi, math.pi))
        case "limited":
            cover, at = limit_size(rng, cover, indenter, depth), (0.0, 0.0)
        case "side":
            half = indenter.footprint[0] + thickness * float(rng.uniform(0.1, 1.5))
            layer = Layer(thickness=thickness, material=cover.layers[0].material)
            cover, at = Cover(layers=(layer,), size=(2 * half, 2 * half)), (0.0, 0.0)
            friction = friction if isinstance(indenter, Box) else 0.0
        case "plate":
            cover, friction = draw_pad(rng, cover, array, friction)
            at, indenter = (0.0, 0.0), Box(size=(1.2 * max(cover.size or ()), 1.3 * max(cover.size or ()), thickness))
        case "finite":
            cover = make_rubber(rng, thickness)
    if kind == "lifted":
        angle = float(rng.uniform(0, 2 * math.pi))
        slope = min(float(rng.uniform(0.2, 2.0)) * depth / max(indenter.footprint), MOST_LIFTED)
        tilt = (slope * math.cos(angle), slope * math.sin(angle))
    if kind == "tilted":
        angle = float(rng.uniform(0, 2 * math.pi))
        slope = min(float(rng.uniform(0.02, 0.2)) * depth / indenter.footprint[0], MOST_SLOPE)
        tilt = (slope * math.cos(angle), slope * math.sin(angle))
    by_load = bool(rng.random() < 0.5)
    text = describe(cover, indenter, depth, by_load=by_load, pitch=array.pitch, friction=friction)
    text += (f"; yaw {math.degrees(yaw):.0f} deg" if yaw else "") + ("; tilted" if any(tilt) else "")
    pose = Pose.planar(at=at, yaw=yaw, tilt=tilt)
    return Case(cover, array, indenter, depth, by_load, pose, tilt, friction, kind, text)


def draw_pad(rng: np.random.Generator, cover: Cover, array: TexelArray, friction: float) -> tuple[Cover, float]:
    """Cut a cover to a pad that ends within the array, and whose stress under a wide plate is uniaxial.

    Returns:
        The pad, and the friction, which is only kept at Poisson ratio 0.
    """
    material = cover.layers[0].material
    if rng.random() < 0.5:
        material, base = replace(material, poisson_ratio=0.0), cover.base
    else:
        base, friction = "sliding", 0.0
    size = [float(rng.uniform(1.0, 3.0)) * pitch for pitch in array.pitch]
    layer = Layer(thickness=max(cover.thickness, max(size) / 8), material=material)
    return Cover(layers=(layer,), base=base, size=(size[0], size[1])), friction


def make_rubber(rng: np.random.Generator, thickness: float) -> Cover:
    """Make a wide neo-Hookean cover of one layer."""
    parameters = {"shear_modulus": log_uniform(rng, 1e4, 1e6)}
    nu = float(rng.choice([0.45, 0.49, 0.5]))
    material = Material(name="random", model="neo-hookean", parameters=parameters, poisson_ratio=nu)
    return Cover(layers=(Layer(thickness=thickness, material=material),))


def limit_size(rng: np.random.Generator, cover: Cover, indenter: Indenter, depth: float) -> Cover:
    """Cut a cover so far from the contact that its free sides have no effect: the truth is that of a wide cover."""
    contact = indenter.footprint[0]
    if not indenter.is_flat:
        contact = min(contact, 1.3 * math.sqrt(3 * depth * max(contact, depth)))
    half = contact + cover.thickness * float(rng.uniform(4, 6))
    layer = Layer(thickness=cover.thickness, material=cover.layers[0].material)
    return Cover(layers=(layer,), base="bonded", size=(2 * half, 2 * half))


def describe(
    cover: Cover, indenter: Indenter, depth: float, *, by_load: bool, pitch: tuple[float, float], friction: float
) -> str:
    """Describe a case in one line."""
    layers = " + ".join(
        f"{1e3 * e.thickness:.3g}mm E{e.material.youngs_modulus:.3g} nu{e.material.poisson_ratio:g}"
        for e in cover.layers
    )
    shape = type(indenter).__name__ + " " + ",".join(f"{1e3 * each:.3g}" for each in indenter.footprint)
    control = "load" if by_load else "depth"
    return (
        f"{layers} {cover.base}; {shape} mm; {control} at {depth / cover.thickness:.3g} h; "
        f"pitch {1e3 * pitch[0]:.3g} mm"
        + (f"; friction {friction:g}" if friction else "")
        + ("; limited" if cover.size else "")
    )


def score_case(study: str, seed: int, number: int) -> dict[str, Any]:
    """Press a case and compare it with its truth."""
    case = draw_case(study, seed, number)
    record: dict[str, Any] = {"number": number, "kind": case.kind, "text": case.text}
    signal.signal(signal.SIGPROF, _give_up)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    started = time.process_time()
    given: dict[str, Any] = {"friction": case.friction}
    try:
        flat = replace(case.pose, tilt=(0.0, 0.0))
        truth = solve_truth(case.cover, case.array, case.indenter, case.depth, pose=flat, tilt=case.tilt, **given)
        record |= {"truth": truth.source, "truth_seconds": time.process_time() - started}
    except Exception as error:  # noqa: BLE001 -- counted
        signal.setitimer(signal.ITIMER_PROF, 0)
        return record | {"status": "no truth", "why": f"{type(error).__name__}: {error}"}
    started = time.process_time()
    try:
        given |= {"load": truth.values["total_force"]} if case.by_load else {"depth": case.depth}
        found = press(case.cover, case.array, case.indenter, pose=case.pose, **given)
    except Exception as error:  # noqa: BLE001 -- every failure is a result of the study
        place = traceback.extract_tb(error.__traceback__)[-1]
        why = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        return record | {"status": "failed", "why": why, "seconds": time.process_time() - started}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    peak = int(np.argmax(np.abs(found.texel_forces)))
    pairs = {name: (float(getattr(found, name)), exact) for name, exact in truth.values.items()}
    pairs["peak_texel"] = float(found.texel_forces[peak]), float(truth.texel_forces[peak])
    record["scores"] = {
        name: {
            "error": value / exact - 1,
            "estimate": float(found.error_estimate.get(name, math.nan)),
            "truth_error": truth.error[name],
        }
        for name, (value, exact) in pairs.items()
        if name != ("total_force" if case.by_load else "depth") and abs(value / exact - 1) > EXACT
    }
    return record | {
        "status": "scored",
        "seconds": time.process_time() - started,
        "balance": float(getattr(found, "balance", math.nan)),
    }


def _give_up(*_: object) -> None:
    raise TimeoutError(f"no result within {LIMIT} s of processor time")


def summarise(records: list[dict[str, Any]]) -> list[list[str]]:
    """Make the rows of the table: share covered, lower bound and median ratio of each quantity."""
    rows = []
    for name in QUANTITIES:
        scores = [r["scores"][name] for r in records if r["status"] == "scored" and name in r["scores"]]
        good = [s for s in scores if s["truth_error"] <= s["estimate"] / 3 or is_missed(s)]
        hits = [s for s in good if abs(s["error"]) <= s["estimate"]]
        ratio = np.median([s["estimate"] / max(abs(s["error"]), 1e-12) for s in good]) if good else math.nan
        count, median = max(len(good), 1), np.median([s["estimate"] for s in good]) if good else math.nan
        # The bound is of 95 % confidence (Clopper and Pearson 1934).
        bound = beta.ppf(0.05, len(hits), count - len(hits) + 1) if hits else 0.0
        shares = [f"{100 * len(hits) / count:.1f} %", f"{100 * bound:.1f} %"]
        rows.append(
            [name, f"{len(good)}", f"{len(scores) - len(good)}", *shares, f"{ratio:.1f}", f"{100 * median:.3f} %"]
        )
    return rows


def is_missed(score: dict[str, float]) -> bool:
    """Return whether a true error exceeds its estimate by more than the error of the truth, so that it is a miss."""
    return not abs(score["error"]) - score["truth_error"] <= score["estimate"]


def list_misses(records: list[dict[str, Any]]) -> list[str]:
    """List cases that failed or whose estimates do not cover."""
    out = []
    for record in records:
        head = f"{record['number']} ({record['kind']}): {record['text']}"
        if record["status"] == "failed":
            out.append(f"{head}: **failed** {record['why']}")
            continue
        for name, score in record.get("scores", {}).items():
            error, estimate, truth = (100 * score[key] for key in ("error", "estimate", "truth_error"))
            if abs(error) > estimate and (truth <= estimate / 3 or is_missed(score)):
                out.append(f"{head}: {name} {error:+.4f} %, estimate {estimate:.4f} %, truth {truth:.4f} %")
    return out


def write_table(records: list[dict[str, Any]], command: str) -> str:
    """Write the report in Markdown."""
    head = ["quantity", "cases", "left out", "covered", "lower 95 % bound", "median ratio", "median estimate"]
    lines = ["# Do the error estimates of `press` hold?", "", f"`{command}`", ""]
    counts = Counter(f"{record['kind']}, {record['status']}" for record in records)
    lines += ["; ".join(f"{number} {name}" for name, number in sorted(counts.items())) + ".", ""]
    lines += [
        "Covered: the true error is at most the estimate.  Left out: the error of the truth exceeds a third of the",
        "estimate, unless the true error exceeds the sum of both, which is a miss.  Ratio: estimate over true error.",
        "",
    ]
    independent = [record for record in records if record.get("truth") != SAME_CODE]
    groups = {"all with an independent truth": independent}
    for kind in dict.fromkeys(record["kind"] for record in records):
        group = [record for record in records if record["kind"] == kind]
        same = any(record.get("truth") == SAME_CODE for record in group)
        seconds = [record.get("truth_seconds", 0.0) + record.get("seconds", 0.0) for record in group]
        groups[f"{kind}{', by a finer grid of the same code' if same else ''}, {np.mean(seconds):.0f} s a case"] = group
    for name, group in groups.items():
        lines += [f"## {name}", "", "| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
        lines += ["| " + " | ".join(row) + " |" for row in summarise(group)] + [""]
    misses = list_misses(records)
    return "\n".join([*lines, f"## Misses ({len(misses)})", "", *(f"- {miss}" for miss in misses)]) + "\n"


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--study", choices=sorted(SHARES), default="all")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, help="file for the table")
    given = parser.parse_args()
    root = Path(__file__).resolve().parents[1]
    sources = sorted(path for name in ("fem_reference", "meshes") for path in (root / name).rglob("*.py"))
    code = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:10]
    kept = Path(tempfile.gettempdir()) / f"softcover-coverage-{given.study}-{given.seed}-{code}.jsonl"
    records = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    left = sorted(set(range(given.cases)) - {record["number"] for record in records})
    with (
        multiprocessing.get_context("spawn").Pool(given.processes, maxtasksperchild=20) as pool,
        kept.open("a") as file,
    ):
        for record in pool.imap_unordered(partial(score_case, given.study, given.seed), left):
            file.write(json.dumps(record) + "\n")
            file.flush()
            records.append(record)
            print(f"{len(records)} of {given.cases} cases", file=sys.stderr)
    records = sorted((record for record in records if record["number"] < given.cases), key=lambda each: each["number"])
    options = f"--study {given.study} --cases {given.cases} --seed {given.seed}"
    text = write_table(records, f"python benchmarks/estimate_coverage.py {options}")
    print(text)
    if given.out:
        given.out.write_text(text)


if __name__ == "__main__":
    main()
