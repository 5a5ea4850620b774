"""Check `press`: flat outlines and rollers against boundary elements, and how deep balls go at finite strain.

    python benchmarks/reference_checks.py outlines [--truths L nut blade ...]
    python benchmarks/reference_checks.py rollers
    python benchmarks/reference_checks.py reach [--ratios 2 5 10 50] [--poisson 0.3 0.49 0.5]

Outlines: the array is so wide that the force outside its texels is zero, so the texels must add up to the load.
Peak texel: the largest of the result, against boundary elements on three grids, extrapolated with order 2.
Reach: how deep balls come on neo-Hookean covers at finite strain, of 80 % of the thickness (75 % at Poisson ratio 0.5).
Rollers: the depth under the load, the contact area and the peak texel, against boundary elements on two grids.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from coverage_truth import find_root

from fem_reference import press
from fem_reference.errors import IncompletePathError
from meshes import Box, Cover, Indenter, Layer, Material, Nut, Prism, Roller, Sphere, TexelArray
from meshes.pose import Pose
from tests.exact.boundary import PressedCells, pressed_shape
from tests.exact.outline import press_face

PITCH = 3.4e-3
#: Depth of the balls over the thickness: compressible, and incompressible [-].
REACH = (0.8, 0.75)
ARRAY = TexelArray.grid(41, 41, PITCH, name="139 mm")
TEXEL = TexelArray.grid(1, 1, PITCH)
RUBBER = Material(
    name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49, source="assumed"
)
COVER = Cover(layers=(Layer(thickness=2e-3, material=RUBBER),))
#: Depth of the outlines [m], and load [N].
DEPTH, LOAD = 0.1e-3, 2.0
#: Cells of the boundary elements between two edges, and cells along a side of a roller's quarter: for the search of the
#: depth, and for the result [-].
FACE_CELLS, SEARCH_CELLS, ROLLER_CELLS = (8, 12, 18), 8, (12, 18)


def make_prism(*corners: tuple[float, float]) -> Prism:
    """Make a prism from corners in millimetres, with the axis in the middle of their bounding rectangle."""
    points = np.array(corners) * 1e-3
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    return Prism(points=tuple((float(x), float(y)) for x, y in points))


def make_box(x: float, y: float) -> Box:
    """Make a box from its edges in millimetres."""
    return Box(size=(x * 1e-3, y * 1e-3, 5e-3))


OUTLINES: dict[str, Indenter] = {
    "L": make_prism((0, 0), (8, 0), (8, 3), (2, 3), (2, 9), (0, 9)),
    "T": make_prism((0, 7), (4, 7), (4, 0), (6.5, 0), (6.5, 7), (11, 7), (11, 9), (0, 9)),
    "U": make_prism((0, 0), (9, 0), (9, 8), (7.1, 8), (7.1, 2.3), (1.9, 2.3), (1.9, 8), (0, 8)),
    "nut": Nut(across=13e-3, bore=11e-3),
    "bracket": make_prism((0, 0), (7, 0), (7, 1.3), (1.3, 1.3), (1.3, 10.7), (7, 10.7), (7, 12), (0, 12)),
    "blade": make_box(60, 1),
    "1 : 1": make_box(7, 7),
    "2 : 1": make_box(8, 4),
    "5 : 1": make_box(12, 2.4),
    "9 : 1": make_box(10, 1.1),
    "20 : 1": make_box(40, 2),
    "30 : 1": make_box(24, 0.8),
}
#: Radius and length [mm] and load [N] of the rollers.
ROLLERS = (
    (2, 8, 0.5), (2, 8, 5), (2, 60, 20), (10, 8, 2), (10, 30, 20), (33, 60, 2), (33, 60, 20),
    (33, 120, 2), (100, 8, 20), (100, 60, 0.5), (200, 8, 1), (200, 120, 20),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Exact:
    """Force [N], area [m2] and force on one texel [N] by boundary elements, with the relative change by refinement."""

    force: float
    area: float
    texel: float
    error: float


def refine(solve: Callable[[int], PressedCells], cells: tuple[int, ...], centre: tuple[float, float]) -> Exact:
    """Extrapolate with order 2 the force and the force on the texel at a centre; the area is that of the last grid."""
    pose = Pose.planar(at=(-centre[0], -centre[1]))
    solved = [solve(count) for count in cells]
    table = np.array([[each.total_force, each.texel_forces(TEXEL, pose)[0]] for each in solved])
    ratio = np.array(cells[1:]) / np.array(cells[:-1])
    refined = table[1:] + (table[1:] - table[:-1]) / (ratio**2 - 1)[:, None]
    before = refined[-2] if len(refined) > 1 else table[-1]
    error = float(np.abs(refined[-1] / before - 1).max())
    return Exact(force=float(refined[-1, 0]), area=solved[-1].contact_area, texel=float(refined[-1, 1]), error=error)


def solve_face(indenter: Indenter, count: int) -> PressedCells:
    """Press a flat face by boundary elements, with a number of cells between two edges."""
    return press_face(COVER, indenter, DEPTH, cells=count)


def check_outlines(truths: list[str]) -> None:
    """Print the table of outlines; those in `truths` are compared with boundary elements."""
    print("| outline | control | texels / total - 1 | estimate | estimate, peak | force | peak | truth | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, indenter in OUTLINES.items():
        exact = None
        for control in ("depth", "load"):
            started = time.perf_counter()
            target = {"depth": DEPTH} if control == "depth" else {"load": LOAD}
            found = press(COVER, ARRAY, indenter, **target)
            seconds = time.perf_counter() - started
            peak = int(np.argmax(found.texel_forces))
            if exact is None and (not truths or name in truths):
                x, y = ARRAY.centres[peak, :2]
                exact = refine(partial(solve_face, indenter), FACE_CELLS, (x, y))
            compared = ["", "", ""]
            if exact is not None:
                scale = found.depth / DEPTH  # a flat face is linear
                compared = [
                    f"{100 * (found.total_force / (exact.force * scale) - 1):+.3f} %",
                    f"{100 * (found.texel_forces[peak] / (exact.texel * scale) - 1):+.3f} %",
                    f"{100 * exact.error:.3f} %",
                ]
                if control == "load":  # at the true depth the force is the load
                    compared[1] = f"{100 * (found.texel_forces[peak] / (exact.texel * LOAD / exact.force) - 1):+.3f} %"
            estimate = found.error_estimate
            row = [
                name,
                control,
                f"{100 * (found.texel_forces.sum() / found.total_force - 1):+.4f} %",
                f"{100 * max(estimate['total_force'], estimate.get('depth', 0)):.3f} %",
                f"{100 * estimate['peak_texel']:.3f} %",
                *compared,
                f"{seconds:.1f}",
            ]
            print("| " + " | ".join(row) + " |", flush=True)


def check_rollers() -> None:
    """Print the table of rollers under loads."""
    print("| R, mm | L, mm | load, N | depth | estimate | area | estimate | peak texel | estimate | truth | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for radius, length, load in ROLLERS:
        roller = Roller(radius=radius * 1e-3, length=length * 1e-3)
        started = time.perf_counter()
        try:
            found = press(COVER, ARRAY, roller, load=load)
        except (ValueError, RuntimeError) as error:
            print(f"| {radius} | {length} | {load:g} | **{error}** |", flush=True)
            continue
        seconds = time.perf_counter() - started
        peak = int(np.argmax(found.texel_forces))

        def solve(count: int, at: float, roller: Roller = roller) -> PressedCells:
            return pressed_shape(COVER, roller, at, cells=count)

        depth = find_root(lambda d, load=load: solve(SEARCH_CELLS, d).total_force / load, found.depth)
        exact = refine(partial(solve, at=depth), ROLLER_CELLS, tuple(ARRAY.centres[peak, :2]))
        # The force at this depth differs little from the load: correct depth, area and texel to first order.
        step = [solve(SEARCH_CELLS, factor * depth) for factor in (0.99, 1.01)]
        slope = np.log(step[1].total_force / step[0].total_force)
        short = float(np.log(load / exact.force))
        truth = {
            "depth": depth * np.exp(short * np.log(1.01 / 0.99) / slope),
            "area": exact.area * np.exp(short * np.log(step[1].contact_area / step[0].contact_area) / slope),
            "texel": exact.texel * np.exp(short),
        }
        estimate = found.error_estimate
        row = [
            f"{radius}",
            f"{length}",
            f"{load:g}",
            f"{100 * (found.depth / truth['depth'] - 1):+.2f} %",
            f"{100 * estimate.get('depth', np.nan):.2f} %",
            f"{100 * (found.contact_area / truth['area'] - 1):+.2f} %",
            f"{100 * estimate['contact_area']:.2f} %",
            f"{100 * (found.texel_forces[peak] / truth['texel'] - 1):+.2f} %",
            f"{100 * estimate['peak_texel']:.2f} %",
            f"{100 * exact.error:.2f} %",
            f"{seconds:.1f}",
        ]
        print("| " + " | ".join(row) + " |", flush=True)


def check_reach(ratios: list[float], poisson: list[float]) -> None:
    """Print how deep balls come in neo-Hookean covers of 2 mm and shear modulus 0.3 MPa."""
    print("| radius / thickness | Poisson ratio | asked | reached | force [N] | estimates: force, texel, area | s |")
    print("|---|---|---|---|---|---|---|")
    for ratio, nu in ((ratio, nu) for nu in poisson for ratio in ratios):
        rubber = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 3e5}, poisson_ratio=nu)
        cover = Cover(layers=(Layer(thickness=2e-3, material=rubber),))
        share = REACH[nu == 0.5]
        started = time.perf_counter()
        try:
            found = [press(cover, ARRAY, Sphere(radius=ratio * 2e-3), depth=share * 2e-3)]
        except IncompletePathError as error:
            found = error.reached
        seconds = f"{time.perf_counter() - started:.0f}"
        row = ["0", "", ""]
        if found:
            last = found[-1]
            names = ("total_force", "peak_texel", "contact_area")
            each = ", ".join(f"{100 * last.error_estimate[name]:.2g} %" for name in names)
            row = [f"{last.depth / 2e-3:.2f}", f"{last.total_force:.4g}", each]
        print("| " + " | ".join([f"{ratio:g}", f"{nu:g}", f"{share:g}", *row, seconds]) + " |", flush=True)


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("table", choices=["outlines", "rollers", "reach"])
    parser.add_argument(
        "--truths", nargs="*", default=[], help="outlines to compare with boundary elements; all if none"
    )
    parser.add_argument("--ratios", nargs="*", type=float, default=[2.0, 5.0, 10.0, 50.0], help="radii over thickness")
    parser.add_argument("--poisson", nargs="*", type=float, default=[0.3, 0.49, 0.5], help="Poisson ratios")
    given = parser.parse_args()
    if given.table == "outlines":
        check_outlines(given.truths)
    elif given.table == "reach":
        check_reach(given.ratios, given.poisson)
    else:
        check_rollers()


if __name__ == "__main__":
    main()
