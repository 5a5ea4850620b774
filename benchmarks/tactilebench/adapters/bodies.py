"""What adapters share: convex parts of a case's body, forces at points on texels, files of forces and of scores.

A rigid body is a union of convex parts, each a primitive or the hull of corners, which every engine knows.  In the
adapters the top of the cover is the plane z = 0, and the body sinks along -z without turning.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tactilebench import BenchError, Body, Case, cases, load_truth, read_forces, score

FloatArray = npt.NDArray[np.float64]
#: Folder of the files of scores, and of the files of forces beside them, which git ignores.
RESULTS = Path(__file__).parents[1] / "results"
#: Height of shapes that state none [m].
HEIGHT = 8e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A convex part of a body.

    Attributes:
        kind: `sphere` (radius), `cylinder` (radius, half length along its own z), `box` (half edge lengths), or `hull`.
        size: Numbers of the kind [m].
        position: Position of the part's centre in the body's frame, shape (3,) [m].
        rotation: Matrix whose columns are the part's axes in the body's frame, shape (3, 3) [-].
        corners: Corners of a hull in the body's frame, shape (n, 3) [m].
    """

    kind: str
    size: tuple[float, ...] = ()
    position: FloatArray = field(default_factory=lambda: np.zeros(3))
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    corners: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


def make_parts(body: Body) -> list[Part]:
    """Return the convex parts of a body; see `tactilebench.Body` for the shapes."""
    shape, up = body.shape, np.array([0.0, 0.0, 1.0])
    kind, radius = shape["shape"], shape.get("radius", 0.0)
    if kind in {"sphere", "tip"}:
        rod = Part(kind="cylinder", size=(radius, HEIGHT / 2), position=(radius + HEIGHT / 2) * up)
        return [Part(kind="sphere", size=(radius,), position=radius * up), rod][: 1 + (kind == "tip")]
    if kind == "cylinder":
        return [Part(kind=kind, size=(radius, HEIGHT / 2), position=HEIGHT / 2 * up)]
    if kind == "roller":
        lies = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        return [Part(kind="cylinder", size=(radius, shape["length"] / 2), position=radius * up, rotation=lies)]
    if kind in {"box", "h"}:
        x, y, z = (each / 2 for each in (*shape["size"], HEIGHT)[:3])
        bar = shape.get("bar", 2 * x) / 2
        blocks = ((bar, y, x - bar), (bar, y, bar - x), (x - 2 * bar, bar, 0.0))[: 1 + 2 * (kind == "h")]
        return [Part(kind="box", size=(a, b, z), position=np.array([at, 0, z])) for a, b, at in blocks]
    hulls = [shape["vertices"]] if kind == "triangles" else list_walls(shape["across"], shape["bore"])
    return [Part(kind="hull", corners=np.array(each, dtype=np.float64)) for each in hulls]


def list_walls(across: float, bore: float) -> list[FloatArray]:
    """Return the corners of the six convex walls of a nut, shape (8, 3) each [m]."""
    width = bore * sqrt(pi / (2 * sqrt(3)))  # across flats, of a hexagon of the area of the circle
    angles = np.radians(30 + 60 * np.arange(7))
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1) / sqrt(3)
    walls = [np.vstack([width * around[k : k + 2], across * around[k : k + 2]]) for k in range(6)]
    return [np.vstack([np.column_stack([wall, np.full(4, z)]) for z in (0, HEIGHT)]) for wall in walls]


def find_bottom(parts: Sequence[Part], rotation: FloatArray) -> float:
    """Return the height of the lowest point of a rotated body over its origin [m]."""
    lowest = []
    for part in parts:
        down, centre = rotation[2] @ part.rotation, float(rotation[2] @ part.position)
        if part.kind == "sphere":
            lowest.append(centre - part.size[0])
        elif part.kind == "cylinder":
            lowest.append(centre - part.size[0] * float(np.hypot(*down[:2])) - part.size[1] * abs(down[2]))
        elif part.kind == "box":
            lowest.append(centre - float(np.abs(down) @ part.size))
        else:
            lowest.append(float((part.corners @ rotation[2]).min()))
    return min(lowest)


def find_reach(parts: Sequence[Part]) -> float:
    """Return a bound of the distance of a body's points from its axis [m]."""
    return max(float(np.linalg.norm([*part.position[:2]]) + np.linalg.norm(part.size)) if part.size else
               float(np.linalg.norm(part.corners[:, :2], axis=1).max()) for part in parts)  # fmt: skip


def sum_on_texels(case: Case, points: FloatArray, forces: FloatArray) -> FloatArray:
    """Add forces (m,) [N] at points (m, 2) [m] to the texels (n,) of a flat array on which they lie [N].

    A point on a border counts half on each side; a point between texels or beyond them is left out.
    """
    middles = case.centres[: case.columns, 0], case.centres[:: case.columns, 1]
    shares = []
    for at, middle, size in zip(points.T, middles, case.texel_size, strict=True):
        inside = np.abs(at[:, None] - middle) <= size / 2 + 1e-12
        shares.append(inside / np.maximum(inside.sum(axis=1, keepdims=True), 1))
    return np.asarray(((shares[1].T * forces) @ shares[0]).ravel())


def integrate(corners: FloatArray, pressure: FloatArray, edge: float) -> tuple[FloatArray, FloatArray]:
    """Divide triangles with linear pressure until they are small, and return points and forces along z.

    Args:
        corners: Corners of m triangles, shape (m, 3, 3) [m].
        pressure: Pressure at the corners, shape (m, 3) [Pa].
        edge: Longest edge of the small triangles [m].

    Returns:
        Centroids of the small triangles, shape (k, 2) [m], and the vertical parts of their forces, shape (k,) [N].
    """
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    counts = np.maximum(np.ceil(longest / edge).astype(int), 1)
    a, b = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    points, forces = [np.zeros((0, 2))], [np.zeros(0)]
    for n in np.unique(counts):
        i, j = (each.ravel() for each in np.meshgrid(np.arange(n), np.arange(n)))
        low, high = i + j < n, i + j < n - 1
        u = np.concatenate([i[low] + 1 / 3, i[high] + 2 / 3]) / n
        v = np.concatenate([j[low] + 1 / 3, j[high] + 2 / 3]) / n
        weights = np.stack([1 - u - v, u, v])
        mine = counts == n
        points.append(np.einsum("ck,mcd->mkd", weights, corners[mine, :, :2]).reshape(-1, 2))
        forces.append((pressure[mine] @ weights * flat[mine, None] / n**2).ravel())
    return np.concatenate(points), np.concatenate(forces)


def choose_cases(options: argparse.Namespace) -> list[Case]:
    """Return the static cases of one body on wide flat layers without friction that the options ask for."""
    known = load_truth(options.truth) if options.truth else cases()
    found = [
        case for case in known
        if case.tier == options.tier and len(case.bodies) == 1 and not (case.motion or case.cover.size)
        and not (case.cover.geometry or case.cover.friction)
    ]  # fmt: skip
    if not found[: options.cases]:
        raise BenchError(
            f"--tier {options.tier}: no case of one body at rest on wide flat layers without friction is known here"
        )
    return found[: options.cases]


def make_parser(text: str | None) -> argparse.ArgumentParser:
    """Make the parser of an adapter, with the options that all adapters share."""
    parser = argparse.ArgumentParser(description=(text or "").partition("\n")[0])
    parser.add_argument("--tier", default="linear", help="tier of the cases")
    parser.add_argument("--cases", type=int, help="only the first cases")
    parser.add_argument("--truth", help="truth of fresh cases, a file of truth.py; their scores are added")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the files")
    return parser


def write_forces(path: Path, forces: dict[str, FloatArray]) -> str:
    """Write a file of forces with six digits, and return its SHA-256."""
    path.write_text("".join(["case,texel,force_n\n", *_list_rows(forces)]))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _list_rows(forces: dict[str, FloatArray]) -> Iterator[str]:
    for name, values in forces.items():
        yield from (f"{name},{texel},{value:.6g}\n" for texel, value in enumerate(values))


def run(
    options: argparse.Namespace, name: str, simulator: str, press: Callable[[Case], FloatArray], *, package: str
) -> int:
    """Press the cases, write forces and scores, and return the exit status: 2 after a line about bad input, else 0.

    Args:
        options: Options of `make_parser`.
        name: Name of the files.
        simulator: What is scored, in words.
        press: Function from a case to the forces on its texels, shape (n,) [N].
        package: Distribution whose version is stated.
    """
    try:
        known = choose_cases(options)
        options.out.mkdir(parents=True, exist_ok=True)
        started = time.process_time()
        forces = {case.name: press(case) for case in known}
        kind = "fresh" if options.truth else "shipped"
        path = options.out / f"{name}-{kind}.csv"
        found = {
            "command": _describe_command(),
            "forces_sha256": write_forces(path, forces),
            "seconds": round(time.process_time() - started, 1),
            "scores": _round(score(read_forces(path, known)[0], known)),
        }
    except BenchError as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        return 2
    target = options.out / f"{name}.json"
    before = json.loads(target.read_text()) if target.exists() else {}
    about = {"simulator": simulator, "package": package, "version": version(package)}
    target.write_text(json.dumps({**before, **about, kind: found}, separators=(",", ":")) + "\n")
    misplaced = found["scores"]["overall"]["misplaced_force"]
    print(f"{name}, {kind}, {len(known)} cases: misplaced {100 * misplaced['value']:.1f} % "
          f"({100 * misplaced['low']:.1f}..{100 * misplaced['high']:.1f})")  # fmt: skip
    return 0


def _describe_command() -> str:
    """Return the command that runs, without folders of this machine."""
    words = [Path(word).name for word in sys.argv[1:]]
    if "--out" in words:
        at = words.index("--out")
        del words[at : at + 2]
    return " ".join(["python", f"benchmarks/tactilebench/adapters/{Path(sys.argv[0]).name}", *words])


def _round(value: Any) -> Any:  # noqa: ANN401 -- values of JSON
    """Round all numbers of a value of JSON to four digits."""
    if isinstance(value, dict):
        return {key: _round(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_round(each) for each in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
