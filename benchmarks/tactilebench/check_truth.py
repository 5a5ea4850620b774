"""Recompute a part of the shipped cases of tactilebench by a second discretisation, and print how the intervals agree.

    python benchmarks/tactilebench/check_truth.py [--truth FILE] [--tier TIER ...] [--share 0.12]
        [--peer PYTHON]

The second solution shares no code with the first one on flat linear covers (`benchmarks/coverage_truth.py`): closed
forms of bodies of revolution, ring elements with friction, boundary elements of flat faces and rollers, here also of
two bodies at once.  Presses on the flat pad of the curved tier, which is solved on meshes of any shape, are compared
with solid elements whose nodes under a box are prescribed, and else with the solver of flat layers; balls at finite
strain with FElupe if a Python with it is given.  Two kinds of checks are not independent and listed apart: other bodies
at finite strain on the finest grids of the same code, and curved covers on a finer mesh.  Forces of a second solution
at the depth of the first one are scaled to the load of the case.

    python benchmarks/tactilebench/check_truth.py --rebuilt FILE

compares the cases with those of another file of truth, such as one that is built from an empty store.
"""

# ruff: noqa: E402 -- the folders of the second solutions must be found first

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path[:0] = [str(Path(__file__).resolve().parents[2]), str(Path(__file__).resolve().parents[1])]

import numpy as np
from coverage_truth import SAME_CODE, solve_truth
from scipy.interpolate import CubicSpline

from cases_as_softcover import COUNTED, make_array, make_cover, make_indenter, make_layers, make_pose
from fem_reference import press
from fem_reference.curved_cover.press import press_small
from fem_reference.grid_convergence import pool_errors
from fem_reference.indentation.result import PressProblem
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Box, Cover, Cylinder, Indenter, SolidCover, Sphere, TexelArray, TriangleMesh
from meshes.array_types import FloatArray
from meshes.pose import Pose
from tactilebench import Case, load_truth
from tactilebench.case import DATA
from tactilebench.draw import TIERS
from tests.exact.boundary import PressedCells, measure_areas, tabulate_excess
from tests.exact.outline import assemble_compliance, split_face

#: Cells between two edges of each of two bodies, on successive grids [-].
PAIR_CELLS = (6, 9, 13)
#: Quadrangles around a round body per cell between its edges [-].
AROUND = 4
#: Radius of the cells under a ball over the square root of diameter and depth [-].
WINDOW = 1.1
#: Elements through the layer on two meshes of FElupe, penalty over the shear modulus per thickness, and largest step
#: over the thickness [-].
BALL_ELEMENTS, PENALTY, STEP = (8, 12), 3000.0, 0.02
#: Gauss points along an edge of a texel [-].
GAUSS = 16
#: Edge lengths of the flat pad of the curved tier [m].
PAD = (20e-3, 20e-3)
#: Finer mesh of curved covers: least relative error of the second solution [-].
LEAST = 3e-3
#: Source of a check of a curved cover on a finer mesh.
FINER = "finer mesh of the same code"
#: Source of a check of the flat pad by the other solver of softcover: boundary cells, and adjoint solutions on a grid.
LAYERS = "solver of flat layers"
#: Sources that are no second discretisation.
SAME = (SAME_CODE, FINER)

#: Forces on n texels, their errors [N], and the source.
Second = tuple[FloatArray, FloatArray, str]


def solve_again(case: Case, peer: str) -> Second:
    """Compute a case by another method; forces and errors in the shape of the case [N].

    Args:
        case: The case.
        peer: Python with FElupe; empty for none.

    Raises:
        ValueError: If there is none for the case.
        RuntimeError: If the other method does not converge.
    """
    if len(case.bodies) > 1:
        return press_pair(case)
    array, (body,) = make_array(case), case.bodies
    indenter, cover = reduce_face(make_indenter(body)), make_cover(case)
    if isinstance(cover, SolidCover):
        flat = case.cover.geometry == "flat-pad" and body.direction[2] == -1
        if not flat:
            return press_finer(case, cover, array, indenter)
        cover = Cover(layers=make_layers(case), size=PAD)
        if not isinstance(indenter, Box):
            found = press(cover, array, indenter, Pose.planar(at=body.at[:2], yaw=body.yaw), load=body.load)
            return found.texel_forces, np.asarray(found.texel_errors), LAYERS
    if case.tier == "finite_strain" and isinstance(indenter, Sphere) and peer:
        return press_ball(case, cover, array, indenter, peer)
    rows = []
    for at, load in zip(case.motion.at if case.motion else (body.at,), case.loads, strict=True):
        pose = make_pose(body, at)
        given = Pose.planar(at=pose.at, yaw=pose.yaw, tilt=pose.tilt)
        depth = cover.thickness / 100  # any depth does where forces are proportional to it
        if not indenter.is_flat or any(pose.tilt) or not cover.small_strain_only:
            depth = press(cover, array, indenter, given, load=load, friction=case.cover.friction).depth
        found = solve_truth(
            cover, array, indenter, depth, pose=replace(given, tilt=(0.0, 0.0)), friction=case.cover.friction,
            tilt=pose.tilt,
        )  # fmt: skip
        scale = load / found.values["total_force"]
        rows.append((scale * found.texel_forces, scale * found.texel_errors, found.source))
    forces, errors = (np.array([row[k] for row in rows]) for k in (0, 1))
    return (forces, errors, rows[0][2]) if case.motion else rows[0]


def reduce_face(indenter: Indenter) -> Indenter:
    """Return the box with the lower face of a block of triangles; other bodies as they are."""
    if not isinstance(indenter, TriangleMesh):
        return indenter
    corners = indenter.triangles.reshape(-1, 3)
    face = corners[corners[:, 2] == 0]
    if not np.ptp(face, axis=0)[:2].all():
        return indenter  # a pyramid
    x, y = np.ptp(face[:, :2], axis=0)
    return Box(size=(float(x), float(y), 1e-3))


def press_finer(case: Case, cover: SolidCover, array: TexelArray, indenter: Indenter) -> Second:
    """Press on one mesh that is finer than those of the first solution; its error is that of the smallest estimate."""
    assert cover.refine is not None
    body = case.bodies[0]
    mesh = cover.refine(cover.thicknesses)
    problem = PressProblem(
        array=array, indenter=indenter, pose=make_pose(body), targets=(body.load,), control="load"
    )  # fmt: skip
    forces = press_small((mesh,), cover.layers, problem, body.load).texel_forces
    return forces, LEAST * np.abs(forces), FINER


def press_ball(case: Case, cover: Cover, array: TexelArray, ball: Sphere, peer: str) -> Second:
    """Press a ball into rubber with FElupe on two meshes; the error is the change between them.

    Raises:
        RuntimeError: If FElupe does not converge.
    """
    body, h, nu = case.bodies[0], cover.thickness, case.cover.layers[0].poisson_ratio
    depth = press(cover, array, ball, make_pose(body), load=body.load).depth / h
    wide = max(2.0, 1.3 * math.sqrt(2 * ball.radius / h * depth))
    table = []
    for through in BALL_ELEMENTS:
        near = np.linspace(0, wide, math.ceil(wide * through) + 1)
        radii = [*near[:-1], *(wide + 8 * np.linspace(0, 1, 2 * through) ** 1.7)]
        task = {
            "shape": "ball", "fields": "two", "radius": radii[-1], "through": through, "across": len(radii) - 1,
            "radii": radii, "ball": ball.radius / h, "penalty": PENALTY, "bulk": 2 * (1 + nu) / (3 * (1 - 2 * nu)),
            "travels": np.linspace(0, depth, math.ceil(depth / STEP) + 1)[1:].tolist(),
        }  # fmt: skip
        script = Path(__file__).with_name("balls_felupe.py")
        done = subprocess.run([peer, str(script)], input=json.dumps(task), capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"FElupe: {done.stderr.splitlines()[-1]}")
        found = json.loads(done.stdout)
        shares = spread_over_texels(np.array(found["radii"]) * h, np.array(found["nodal"]), array, body.at[:2])
        table.append(shares / found["force"] * body.load)
    changes = np.abs(table[1] - table[0])
    return table[1], pool_errors(changes, table[1]), "FElupe"


def spread_over_texels(radii: FloatArray, nodal: FloatArray, array: TexelArray, at: tuple[float, float]) -> FloatArray:
    """Find the base pressure whose consistent nodal forces on quadratic rings are given, and integrate it over texels.

    Args:
        radii: Radii of m nodes, those between the ends of the rings included, shape (m,) [m].
        nodal: Forces on the nodes, shape (m,), in any unit.
        array: Array with n texels.
        at: Axis in the frame of the array [m].

    Returns:
        Forces on the texels in the same unit, shape (n,).
    """
    nodes, weights = np.polynomial.legendre.leggauss(5)
    t = (nodes + 1) / 2
    shape = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=-1)
    matrix = np.zeros((len(radii), len(radii)))
    for k in range(0, len(radii) - 2, 2):
        r = shape @ radii[k : k + 3]
        ring = np.pi * weights * r * (radii[k + 2] - radii[k])
        matrix[k : k + 3, k : k + 3] += np.einsum("q,qa,qb->ab", ring, shape, shape)
    pressure = np.linalg.solve(matrix, nodal)
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    x, y = (points[:, None] * array.texel_size / 2).T
    places = array.centres[:, None, None, :2] + np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1) - np.array(at)
    values = CubicSpline(radii, pressure)(np.minimum(np.linalg.norm(places, axis=-1), radii[-1]))
    return np.asarray((values * np.outer(weights, weights)).sum(axis=(1, 2)) * np.prod(array.texel_size) / 4)


def press_pair(case: Case) -> Second:
    """Press two bodies at once by boundary elements; the error is the change between the two finest grids."""
    cover, array = make_cover(case), make_array(case)
    assert isinstance(cover, Cover)
    indenters = [make_indenter(body) for body in case.bodies]
    given = [
        Body(indenter=each, load=body.load, at=body.at[:2], yaw=body.yaw)
        for each, body in zip(indenters, case.bodies, strict=True)
    ]
    depths = press_together(cover, array, given).depths
    table = []
    for cells in PAIR_CELLS:
        faces = [split_body(*each, cells) for each in zip(indenters, depths, strict=True)]
        gaps = [
            np.zeros(len(face)) if each.is_flat else each.gap(*face.mean(axis=1).T)
            for each, face in zip(indenters, faces, strict=True)
        ]
        owner = np.repeat([0, 1], [len(face) for face in faces])
        placed = [
            np.stack(make_pose(body).to_array(*np.moveaxis(face, -1, 0)), axis=-1)
            for body, face in zip(case.bodies, faces, strict=True)
        ]
        corners = np.concatenate(placed)
        pressure = solve_pair(
            assemble_compliance(tabulate_excess(cover), corners), np.concatenate(gaps), owner, measure_areas(corners),
            np.array([body.load for body in case.bodies]),
        )  # fmt: skip
        hit = pressure > 0
        solved = PressedCells(cover=cover, depth=0.0, corners=corners[hit], pressure=pressure[hit], contact_area=0.0)
        table.append(solved.texel_forces(array))
    changes = np.abs(table[-1] - table[-2])
    return table[-1], pool_errors(changes, table[-1]), "boundary elements"


def split_body(indenter: Indenter, depth: float, cells: int) -> FloatArray:
    """Split the face of a box or a cylinder, or the surroundings of a ball's contact, shape (m, 4, 2) [m]."""
    if isinstance(indenter, Box):
        return split_face(indenter, cells, max(indenter.footprint))
    radius = (
        indenter.footprint[0] if isinstance(indenter, Cylinder) else WINDOW * np.sqrt(2 * indenter.footprint[0] * depth)
    )
    count = AROUND * cells
    radius *= np.sqrt(2 * np.pi / count / np.sin(2 * np.pi / count))  # the polygon has the area of the circle
    rings = radius * np.sin(np.linspace(0, np.pi / 2, 2 * cells + 1))
    angles = np.linspace(0, 2 * np.pi, count + 1)
    grid = rings[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    return np.asarray(quads.reshape(-1, 4, 2))


def solve_pair(
    matrix: FloatArray, gap: FloatArray, owner: FloatArray, areas: FloatArray, loads: FloatArray
) -> FloatArray:
    """Find the pressures under two bodies of given loads, without tension and without overlap, shape (m,) [Pa].

    Args:
        matrix: Displacement of each of m elements per pressure on each, shape (m, m) [m/Pa].
        gap: Height of the body above each element, shape (m,) [m].
        owner: Body above each element, 0 or 1, shape (m,).
        areas: Areas of the elements, shape (m,) [m2].
        loads: Loads of the bodies, shape (2,) [N].

    Raises:
        RuntimeError: If the contact does not settle.
    """
    bodies = (owner[:, None] == [0, 1]).astype(float)
    touching = np.ones(len(gap), dtype=bool)
    for _ in range(100):
        part, scale = bodies[touching], matrix.diagonal().mean()
        weighted = part * areas[touching, None]
        system = np.block([[matrix[np.ix_(touching, touching)] / scale, -part], [weighted.T, np.zeros((2, 2))]])
        found = np.linalg.solve(system, np.concatenate([-gap[touching] / scale, loads]))
        pressure = np.zeros(len(gap))
        pressure[touching], depths = found[:-2], found[-2:] * scale
        pulls = touching & (pressure < 0)
        overlaps = ~touching & (matrix @ pressure < bodies @ depths - gap - 1e-9 * np.abs(depths).max())
        if not (pulls | overlaps).any():
            return pressure
        touching = touching ^ (pulls | overlaps)
    raise RuntimeError("the contact of two bodies did not settle")


def compare(case: Case, second: Second) -> dict[str, float | str]:
    """Compare the shipped forces of a case with a second solution, over texels above `COUNTED` of the load."""
    truth, (forces, errors, source) = case.require_truth(), second
    loads = np.reshape(case.loads, (-1, 1)) if case.motion else case.load
    counted = np.abs(truth.forces) > COUNTED * loads
    apart = np.abs(truth.forces - forces)
    share = (np.broadcast_to(1 / np.asarray(loads), forces.shape) * truth.half_width)[counted]
    return {
        "name": case.name, "tier": case.tier, "source": source, "texels": int(counted.sum()),
        "overlap": int((apart <= truth.half_width + errors)[counted].sum()),
        "covered": int((apart <= truth.half_width)[counted].sum()),
        "half_width": float(np.median(share)),
        "worst": float((apart / (truth.half_width + errors))[counted].max()),
        "apart": float((apart / loads)[counted].max()),
    }  # fmt: skip


def choose(cases: list[Case], share: float) -> tuple[list[Case], int]:
    """Order the cases of a tier so that the first ones are spread over it; return them and how many are wanted."""
    wanted = int(np.ceil(share * len(cases)))
    step = max(1, len(cases) // max(wanted, 1))
    order = sorted(range(len(cases)), key=lambda k: (k % step, k))
    return [cases[k] for k in order], wanted


def check_tier(
    cases: list[Case], share: float, keep: Callable[[dict[str, float | str]], None], done: set[str], peer: str
) -> None:
    """Check cases of a tier until the wanted number is reached."""
    ordered, wanted = choose(cases, share)
    ordered.sort(key=lambda case: case.cover.geometry not in {"", "flat-pad"})  # the flat pad has a second solution
    count = sum(case.name in done for case in ordered)
    for case in ordered:
        if count >= wanted:
            return
        if case.name in done:
            continue
        started = time.process_time()
        try:
            found = compare(case, solve_again(case, peer))
        except (ValueError, RuntimeError, TypeError) as error:
            print(f"{case.name}: no second solution: {error}", flush=True)
            continue
        count += 1
        keep(found)
        seconds = time.process_time() - started
        print(f"{case.name}: {found['overlap']} of {found['texels']}, {found['source']}, {seconds:.0f} s", flush=True)


def tabulate(records: list[dict[str, float | str]], shipped: dict[str, int]) -> str:
    """Write the table in Markdown."""
    lines = [
        "| tier | shipped | checked by | cases | texels | overlap | covered | median half width | largest difference |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for tier in TIERS:
        for source in dict.fromkeys(str(each["source"]) for each in records if each["tier"] == tier):
            rows = [each for each in records if each["tier"] == tier and each["source"] == source]
            texels, overlap, covered = (
                sum(int(each[key]) for each in rows) for key in ("texels", "overlap", "covered")
            )
            width, apart = np.median([each["half_width"] for each in rows]), max(float(each["apart"]) for each in rows)
            star = " (no second discretisation)" if source in SAME else ""
            lines.append(
                f"| {tier} | {shipped[tier]} | {source}{star} | {len(rows)} | {texels} | {overlap / texels:.1%} | "
                f"{covered / texels:.1%} | {width:.3%} | {apart:.3%} |"
            )
    return "\n".join(lines)


def compare_rebuilt(cases: tuple[Case, ...], rebuilt: Path) -> str:
    """Say how far cases are from those of another file of truth, over the half widths of their intervals."""
    known, ratios, equal = {case.name: case.require_truth() for case in cases}, [0.0], 0
    others = [case for case in load_truth(rebuilt) if case.name in known]
    for case in others:
        first, second = known[case.name], case.require_truth()
        apart = np.abs(first.forces - second.forces)
        ratios.append(float((apart / np.maximum(first.half_width, 1e-300))[apart > 0].max(initial=0.0)))
        equal += np.array_equal(first.forces, second.forces)
    return f"{len(others)} cases, {equal} equal to the last bit, largest difference {max(ratios):.2g} half widths"


def main() -> int:
    """Check, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--truth", type=Path, default=DATA / "2026.1.npz")
    parser.add_argument("--tier", action="append", choices=sorted(TIERS))
    parser.add_argument("--share", type=float, default=0.12)
    parser.add_argument("--rebuilt", type=Path, help="only compare with this file of truth")
    parser.add_argument("--peer", default="", help="Python in whose environment FElupe is installed")
    given = parser.parse_args()
    cases = load_truth(given.truth)
    if given.rebuilt:
        print(compare_rebuilt(cases, given.rebuilt))
        return 0
    digests = {case.name: case.require_truth().digest for case in cases}
    kept = Path(tempfile.gettempdir()) / "softcover-tactilebench-check.jsonl"
    records = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    records = [each for each in records if digests.get(each["name"]) == each["digest"]]
    with kept.open("a") as file:

        def keep(record: dict[str, float | str]) -> None:
            record["digest"] = digests[str(record["name"])]
            file.write(json.dumps(record) + "\n")
            file.flush()
            records.append(record)

        for tier in given.tier or TIERS:
            group = [case for case in cases if case.tier == tier]
            check_tier(group, given.share, keep, {each["name"] for each in records}, given.peer)
    print(tabulate(records, {tier: sum(case.tier == tier for case in cases) for tier in TIERS}))
    misses = [each for each in records if each["overlap"] < each["texels"]]
    for each in misses:
        print(f"{each['name']}: {each['overlap']} of {each['texels']}, worst {each['worst']:.2f}, {each['source']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
