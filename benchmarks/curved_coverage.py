"""Check on random presses of curved covers whether error estimates cover the true errors.

    python -m benchmarks.curved_coverage [--cases 100] [--seed 1] [--processes 2] [--out RECORDS.jsonl]

A ball is pressed to a depth, or to the exact load, into covers of hexahedra and of tetrahedra.  Covers on spheres and
cylinders have exact solutions (`tests/exact`).  Flat pads have the planar solution: that of an infinite layer far from
their edges, and that with free edges, which is less sure, elsewhere.  The radius of the contact is 0.1 to 1 texel.
Cases of one group share cover and material.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import time
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import fem_reference.curved_cover.press as solver
from fem_reference import press
from fem_reference.closed_form.cylinder import CylinderLayer
from meshes import Cover, Layer, Material, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose
from meshes.solids.covers import take_meshes
from meshes.solids.solid_mesh import EDGES, SolidMesh
from meshes.solids.swept import BaseSurface, cylinder_surface, flat_surface, join_grids, sweep
from meshes.solids.tetrahedra import refine
from meshes.solids.texels import tangent_axes
from tests.exact import cylinder_contact, sphere_contact
from tests.exact.sphere import SphereLayer
from tests.exact.spots import SpotLoad, touch_cylinder

#: Kinds of covers; the elements alternate between the groups of a kind.
KINDS = ("sphere", "cylinder", "flat")
#: Presses that share a cover and a material.
GROUP = 5
#: Element sizes over the thickness and numbers of layers: those of swept covers, and of tetrahedra before they are
#: divided in eight, whose cubes of six tetrahedra have the volume of the mesher's tetrahedra of 0.7 thicknesses.
HEXAHEDRA, TETRAHEDRA = ((0.48, 3), (0.38, 3), (0.3, 4)), (0.5, 2)
#: Corners of the six tetrahedra of a cube, in the binary order of its corners (Kuhn), and of the halves of a square.
KUHN = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
HALVES = ((0, 1, 3), (0, 3, 2))
#: Distance from the edges of a pad beyond which they have no effect, over the thickness [-].
FAR = 3.0
#: Smallest radius of a ball over that of the contact: with steeper flanks the exact area is not known to 1 % [-].
STEEPEST = 2.0
#: Quantities whose estimates are checked.
QUANTITIES = ("total_force", "depth", "contact_area", "peak_texel", "texel_sum", "misplaced_force")


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """Exact load [N], contact area [m2] and texel forces [N] at a depth, and their relative errors [-]."""

    load: float
    area: float
    texel_forces: FloatArray
    error: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Cover of one group of presses: kind, curvature radius of the base [m], thickness [m], material and texels."""

    kind: str
    radius: float
    thickness: float
    material: Material
    texels: TexelArray
    tetrahedra: bool
    size: float


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is even between those of two limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_group(seed: int, number: int) -> Group:
    """Draw the cover of a group."""
    rng = np.random.default_rng([seed, number, 7])
    kind, thickness = KINDS[number % len(KINDS)], 2e-3
    ratio = float(rng.choice([0.3, 0.45, 0.49, 0.5]))
    material = Material(
        name="random", model="linear-elastic", parameters={"youngs_modulus": log_uniform(rng, 1e5, 3e6)},
        poisson_ratio=ratio,
    )  # fmt: skip
    radius = thickness * float(rng.uniform(3.5, 5.5) if kind == "sphere" else rng.uniform(3, 5))
    width = float(rng.uniform(1e-3, 2.4e-3))
    pitch = 1.1 * width
    grid = TexelArray.grid(3, 3, (pitch, pitch))
    x, y = grid.centres[:, 0], grid.centres[:, 1]
    if kind == "sphere":
        normals = np.stack([x / radius, y / radius, np.sqrt(1 - (x**2 + y**2) / radius**2)], axis=1)
        centres = radius * normals
    elif kind == "cylinder":
        normals = np.stack([np.sin(x / radius), 0 * x, np.cos(x / radius)], axis=1)
        centres = radius * normals + np.outer(y, [0, 1.0, 0])
    else:
        normals, centres = grid.normals, grid.centres
    texels = replace(grid, centres=centres, normals=normals, texel_size=(width, width))
    return Group(
        kind=kind, radius=radius, thickness=thickness, material=material, texels=texels,
        tetrahedra=number // len(KINDS) % 2 == 1, size=float(rng.uniform(16e-3, 18e-3)),
    )  # fmt: skip


def make_meshes(group: Group) -> list[SolidMesh]:
    """Mesh the cover of a group."""

    def surface(size: float) -> BaseSurface:
        if group.kind == "flat":
            return flat_surface((group.size, group.size), size)
        if group.kind == "cylinder":
            return cylinder_surface(group.radius, 2.4, group.size + 2e-3, size)
        turn = np.linspace(-np.pi / 4, np.pi / 4, 2 * int(np.ceil(group.radius * np.pi / 2 / size)) + 1)
        first, second = np.meshgrid(np.tan(turn), np.tan(turn))
        out = np.stack([first, second, np.ones_like(first)], axis=-1)
        out /= np.linalg.norm(out, axis=-1, keepdims=True)
        return join_grids([(group.radius * out, out)], "sphere")

    if not group.tetrahedra:
        return [sweep(surface(size * group.thickness), group.thickness, layers=layers) for size, layers in HEXAHEDRA]
    coarse = split_hexahedra(sweep(surface(TETRAHEDRA[0] * group.thickness), group.thickness, layers=TETRAHEDRA[1]))
    return [coarse, refine(coarse)]


def split_hexahedra(mesh: SolidMesh) -> SolidMesh:
    """Divide every hexahedron of a structured mesh into six tetrahedra of 10 nodes with the same nodes."""

    def split(parts: tuple[tuple[int, ...], ...], sides: list[list[int]], given: np.ndarray, axes: int) -> np.ndarray:
        steps = 3 ** np.arange(axes)
        corner = np.array([[n >> k & 1 for k in range(axes)] for n in range(2**axes)]) * 2
        places = corner[np.array(parts)]
        middles = (places[:, [a for a, _ in sides]] + places[:, [b for _, b in sides]]) // 2
        return given[:, np.concatenate([places, middles], axis=1) @ steps].reshape(-1, len(parts[0]) + len(sides))

    cells = split(KUHN, EDGES.tolist(), mesh.cells, 3)
    corner = mesh.nodes[cells[:, :4]]
    if (np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0).all():
        cells = cells[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    facets = {
        name: split(HALVES, [[0, 1], [1, 2], [2, 0]], getattr(mesh, name), 2) for name in ("base", "top", "left_out")
    }
    return replace(mesh, cells=cells, **facets)


def solve(group: Group, radius: float, depth: float, x: float, y: float) -> Truth:
    """Solve a press exactly; x and y are angles on spheres and cylinders [rad], except y there and on pads [m]."""
    layer = {"core_radius": group.radius, "thickness": group.thickness, "material": group.material}
    size = group.texels.texel_size[0]
    if group.kind == "sphere":
        cover = SphereLayer(**layer)
        outer = cover.outer_radius
        overlap = math.sqrt(2 * depth * radius * outer / (radius + outer)) / outer
        coarse, found = (
            sphere_contact.press_ball(cover, radius, depth, rings=rings, degrees=int(8 * rings / overlap))
            for rings in (64, 96)
        )
        area = 3 * found.area - 2 * coarse.area  # the error is proportional to the width of the rings
        forces = integrate_sphere(cover, replace(found.load, direction=(x, y, 1.0)), group.texels, size)
        error = dict.fromkeys(QUANTITIES, 2e-4) | {"contact_area": abs(area / found.area - 1) / 2 + 5e-4}
        return Truth(load=found.force, area=area, texel_forces=forces, error=error)
    if group.kind == "cylinder":
        cylinder = CylinderLayer(**layer)
        counts = np.array([14, 19, 24])
        *coarse, found = (cylinder_contact.press_ball(cylinder, radius, depth, cells=cells) for cells in counts)
        texels = np.arcsin(group.texels.normals[:, 0])
        half = np.arcsin(size / 2 / group.radius)
        places = np.stack([texels - half, texels + half, *(group.texels.centres[:, 1] + s * size / 2 for s in (-1, 1))])
        response = touch_cylinder(
            cylinder, *(SpotLoad(force=f, angle=x + a, height=y + z) for f, a, z in gather(found, cells=6))
        )
        error = dict.fromkeys(QUANTITIES, max(abs(coarse[-1].force / found.force - 1), 1e-4))
        areas = np.array([each.area for each in (*coarse, found)])
        slope, area = np.polyfit(1 / counts, areas, 1)  # the error is proportional to the size of the rectangles
        error["contact_area"] = (
            float(np.abs(area + slope / counts - areas).max() / area) + abs(areas[-1] / area - 1) / 2
        )
        return Truth(load=found.force, area=float(area), texel_forces=response.texel_forces(places.T), error=error)
    far = group.size / 2 - max(abs(x), abs(y)) > FAR * group.thickness
    planar = Cover(
        layers=(Layer(thickness=group.thickness, material=group.material),),
        size=None if far else (group.size, group.size),
    )
    result = press(planar, group.texels, Sphere(radius=radius), Pose.planar(at=(x, y)), depth=depth)
    return Truth(
        load=result.total_force, area=result.contact_area, texel_forces=result.texel_forces,
        error=dict.fromkeys(QUANTITIES, result.error_estimate["peak_texel"]) | result.error_estimate
        | {"depth": result.error_estimate["total_force"]},
    )  # fmt: skip


def integrate_sphere(cover: SphereLayer, load: sphere_contact.RingLoad, texels: TexelArray, size: float) -> FloatArray:
    """Integrate the traction on squares that are projected along the normals of the texels, shape (n,) [N]."""
    points, weights = np.polynomial.legendre.leggauss(14)
    x, y = (each.ravel() * size / 2 for each in np.meshgrid(points, points))
    z = np.sqrt(cover.core_radius**2 - x**2 - y**2)
    area = np.outer(weights, weights).ravel() * size**2 / 4 * cover.core_radius / z
    solved, out = cover.respond(load), []
    for normal, (first, second) in zip(texels.normals, tangent_axes(texels.normals), strict=True):
        places = np.outer(x, first) + np.outer(y, second) + np.outer(z, normal)
        out.append(-area @ solved.base_traction(places) @ normal)
    return np.array(out)


def gather(found: cylinder_contact.CylinderContact, cells: int) -> list[tuple[float, float, float]]:
    """Gather the forces on rectangles to fewer points: force [N], angle [rad] and height [m] of each."""
    place = np.stack([found.angles, found.heights])
    box = np.floor((place / np.abs(place).max(axis=1, keepdims=True) * 0.999 + 1) / 2 * cells).astype(int)
    index = box[0] * cells + box[1]
    force = np.bincount(index, found.forces, cells**2)
    middle = [np.bincount(index, found.forces * each, cells**2) for each in place]
    return [(f, a / f, z / f) for f, a, z in zip(force, *middle, strict=True) if f > 0]


def score_group(seed: int, cases: int, number: int) -> list[dict[str, Any]]:
    """Press all balls of a group and compare them with the truth."""
    group, records = draw_group(seed, number), []
    started = time.process_time()
    cover = take_meshes(make_meshes(group), group.material)
    for case in range(number * GROUP, min((number + 1) * GROUP, cases)):
        rng = np.random.default_rng([seed, case])
        contact = log_uniform(rng, 0.1, 1.0) * group.texels.texel_size[0]
        depth = log_uniform(rng, 0.01, 0.15) * group.thickness
        radius = float(np.clip(contact**2 / 1.4 / depth, STEEPEST * contact, 40e-3))
        spread = rng.uniform(-1, 1, 2)
        if group.kind == "flat":
            far = rng.random() < 0.75  # from the edges
            x, y = spread * (2e-3 if far else group.size / 2 - contact - 0.4 * group.thickness)
            pose = Pose.facing([x, y, 10e-3], [0, 0, -1])
        elif group.kind == "cylinder":
            x, y = spread * [0.25, 2e-3]
            out = np.array([math.sin(x), 0, math.cos(x)])
            pose = Pose.facing(30e-3 * out + [0, y, 0], -out)
        else:
            x, y = 0.1 * spread
            out = np.array([x, y, 1.0]) / math.sqrt(x**2 + y**2 + 1)
            pose = Pose.facing(30e-3 * out, -out)
        by_load = bool(rng.random() < 0.5)
        record = {
            "number": case, "kind": group.kind, "tetrahedra": group.tetrahedra, "ratio": group.material.poisson_ratio,
            "texel": group.texels.texel_size[0], "ball": radius, "given": "load" if by_load else "depth",
            "depth": depth, "place": [x, y], "size": group.size,
        }  # fmt: skip
        try:
            before = time.process_time()
            truth = solve(group, radius, depth, x, y)
            record["truth_seconds"] = time.process_time() - before
            before = time.process_time()
            given = {"load": truth.load} if by_load else {"depth": depth}
            estimate = solver._estimate  # noqa: SLF001 -- its arguments are kept to fit factors
            with mock.patch.object(solver, "_estimate", wraps=estimate) as estimated:
                found = press(cover, group.texels, Sphere(radius=radius), pose, **given)
            record["seconds"] = time.process_time() - before
        except Exception as error:  # noqa: BLE001 -- counted
            records.append(record | {"status": "failed", "why": f"{type(error).__name__}: {error}"})
            continue
        texels, exact = found.texel_forces, truth.texel_forces
        peak = float(np.abs(exact).max())
        errors = {
            "total_force": found.total_force / truth.load - 1, "depth": found.depth / depth - 1,
            "contact_area": found.contact_area / truth.area - 1,
            "peak_texel": float(np.abs(texels - exact).max()) / peak,
            "texel_sum": texels.sum() / exact.sum() - 1,
            "misplaced_force": np.abs(texels - exact).sum() / 2 / truth.load,
        }  # fmt: skip
        errors.pop("total_force" if by_load else "depth")
        last = estimated.call_args.args
        records.append(record | {
            "status": "scored", "contact": math.sqrt(truth.area / math.pi),
            "scores": {
                name: {"error": float(error), "estimate": found.error_estimate[name], "truth": truth.error[name]}
                for name, error in errors.items()
            },
            "meshes": {
                "peak": [float(e) for e in np.abs(np.array(last[0]) - exact).max(axis=1) / peak],
                "sum": [float(e) for e in np.array(last[0]).sum(axis=1) / exact.sum() - 1],
                "load": [e.load / truth.load - 1 for e in last[1]], "area": [e.area / truth.area - 1 for e in last[1]],
                "depth": [float(e) / depth - 1 for e in last[2]], "size": [e.size for e in last[1]],
                "border": last[1][-1].at_border,
                "change": [float(e) for e in np.abs(np.diff(last[0], axis=0)).max(axis=1) / peak],
            },
        })  # fmt: skip
    if records:
        records[-1]["all_seconds"] = time.process_time() - started
    return records


def summarise(records: list[dict[str, Any]]) -> str:
    """Write the table: quantity, cases, share covered, median of estimate over error, errors."""
    lines = [
        "| covers | quantity | cases | covered | median estimate / error | median, largest error [%] |",
        "|---" * 6 + "|",
    ]
    scored = [each for each in records if each["status"] == "scored"]
    for kind, tetrahedra in (("all", None), *product(KINDS, (False, True))):
        chosen = [e for e in scored if kind == "all" or (e["kind"], e["tetrahedra"]) == (kind, tetrahedra)]
        for name in QUANTITIES:
            scores = [e["scores"][name] for e in chosen if name in e["scores"]]
            # Left out: the error of the truth exceeds a third of the estimate, and the difference is no certain miss.
            good = [
                s for s in scores if s["truth"] <= s["estimate"] / 3 or abs(s["error"]) > s["estimate"] + s["truth"]
            ]
            if not good:
                continue
            error = np.abs([s["error"] for s in good])
            ratio = np.array([s["estimate"] for s in good]) / np.maximum(error, 1e-12)
            label = kind if kind == "all" else f"{kind}, {'tetrahedra' if tetrahedra else 'hexahedra'}"
            lines.append(
                f"| {label} | {name} | {len(good)} of {len(scores)} | {100 * (ratio >= 1).mean():.0f} % | "
                f"{np.median(ratio):.1f} | {100 * np.median(error):.2f}, {100 * error.max():.2f} |"
            )
    failed = [e for e in records if e["status"] == "failed"]
    lines += [f"\n{len(failed)} failed", *(f"- {e['number']} {e['kind']}: {e['why']}" for e in failed), "\nMisses:"]
    for each in scored:
        for name, s in each["scores"].items():
            if abs(s["error"]) > s["estimate"] + s["truth"]:
                lines.append(
                    f"- {each['number']} {each['kind']} {'tet' if each['tetrahedra'] else 'hex'} {each['given']} nu "
                    f"{each['ratio']} a/texel {each['contact'] / each['texel']:.2f}: {name} {100 * s['error']:+.2f}, "
                    f"estimate {100 * s['estimate']:.2f} %"
                )
    return "\n".join(lines)


def main() -> None:
    """Run the presses and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    records: list[dict[str, Any]] = []
    groups = range(-(-given.cases // GROUP))
    with multiprocessing.get_context("spawn").Pool(given.processes, maxtasksperchild=1) as pool:
        for some in pool.imap_unordered(partial(score_group, given.seed, given.cases), groups, chunksize=1):
            records += some
            if given.out:
                given.out.write_text("".join(json.dumps(e) + "\n" for e in records))
    print(summarise(records))


if __name__ == "__main__":
    main()
