"""Cost and accuracy of curved covers: `python benchmarks/curved_covers.py [PART ...]`.

responses  time, memory and error estimates of the responses of all texels of each built-in cover
estimates  error estimates against true errors: responses of a cylinder, and presses of flat pads
scores     40 presses of the fingertip: time of the reference, its error estimate, and what the fast model misplaces

Each part prints a table; `curved_covers.md` holds them.  `curved_coverage.py` checks estimates on random presses, and
`curved_bodies.py` presses bodies from CAD.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from fem_reference import press
from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.curved_cover import texel_responses
from meshes import Box, Cover, Cylinder, Indenter, Roller, SolidCover, Sphere, TexelArray
from meshes.pose import Pose
from meshes.solids import fingertip, flat_pad, phalanx
from meshes.solids.covers import take_meshes
from tests.exact.spots import SpotLoad, touch_cylinder
from tests.support.rotated_poses import rotated_pose
from tests.support.rubber import make_cover, make_rubber
from validation.derivation.cover_points import choose_mesh, derive_points

RUBBER = make_rubber(model="linear-elastic")
#: Shapes of the 40 presses, the angle about their y axis by which they are turned [rad], and the load [N].
SHAPES: dict[str, tuple[Indenter, float, float]] = {
    "ball 3 mm": (Sphere(radius=3e-3), 0.0, 0.25),
    "ball 8 mm": (Sphere(radius=8e-3), 0.0, 0.5),
    "box 4 x 3 mm": (Box(size=(4e-3, 3e-3, 6e-3)), 0.0, 0.3),
    "box 12 x 12 mm": (Box(size=(12e-3, 12e-3, 6e-3)), 0.0, 1.0),
    "edge of a box": (Box(size=(8e-3, 14e-3, 8e-3)), np.pi / 4, 0.15),
}
#: Presses of `estimates`: name, indenter, load [N], place [mm], yaw and tilts about x and y [deg].
FLAT: list[tuple[str, Indenter, float, tuple[float, float], float, tuple[float, float]]] = [
    (name, indenter, load, place, 0.0, (0.0, 0.0))
    for name, indenter, load in (
        ("ball 3 mm", Sphere(radius=3e-3), 0.3),
        ("ball 8 mm", Sphere(radius=8e-3), 0.5),
        ("box 4 x 3 mm", Box(size=(4e-3, 3e-3, 6e-3)), 0.5),
        ("box 6 x 6 mm", Box(size=(6e-3, 6e-3, 6e-3)), 1.0),
    )
    for place in ((0.0, 0.0), (0.2, 0.1), (0.5, 0.33), (1.3, -0.9), (4.5, 1.0))
] + [
    ("box 4 x 3 mm", Box(size=(4e-3, 3e-3, 6e-3)), 0.3, (0.4, 0.7), 30.0, (0.0, 0.0)),
    ("box 4 x 3 mm", Box(size=(4e-3, 3e-3, 6e-3)), 0.3, (2.1, -1.3), 70.0, (0.0, 0.0)),
    ("box 2.5 x 2.5 mm", Box(size=(2.5e-3, 2.5e-3, 6e-3)), 0.2, (0.0, 0.0), 0.0, (0.0, 0.0)),
    ("box 2.5 x 2.5 mm", Box(size=(2.5e-3, 2.5e-3, 6e-3)), 0.2, (0.35, 0.8), 20.0, (0.0, 0.0)),
    ("box 8 x 2 mm", Box(size=(8e-3, 2e-3, 6e-3)), 0.5, (0.3, 0.2), 0.0, (0.0, 0.0)),
    ("box 8 x 2 mm", Box(size=(8e-3, 2e-3, 6e-3)), 0.5, (-0.6, 0.45), 40.0, (0.0, 0.0)),
    ("box 12 x 12 mm", Box(size=(12e-3, 12e-3, 6e-3)), 1.0, (0.3, 0.2), 0.0, (0.0, 0.0)),
    ("box 12 x 12 mm", Box(size=(12e-3, 12e-3, 6e-3)), 1.0, (3.0, 2.0), 15.0, (0.0, 0.0)),
    ("cylinder 2 mm", Cylinder(radius=2e-3), 0.3, (0.3, 0.2), 0.0, (0.0, 0.0)),
    ("cylinder 3 mm", Cylinder(radius=3e-3), 0.5, (-1.0, 0.6), 0.0, (0.0, 0.0)),
    ("box 6 x 6 mm", Box(size=(6e-3, 6e-3, 6e-3)), 0.3, (0.2, 0.1), 0.0, (0.0, 9.0)),
    ("box 6 x 6 mm", Box(size=(6e-3, 6e-3, 6e-3)), 0.3, (-1.2, 0.7), 30.0, (0.0, 9.0)),
    ("box 6 x 6 mm", Box(size=(6e-3, 6e-3, 6e-3)), 0.3, (0.7, -0.4), 0.0, (7.0, 7.0)),
    ("box 4 x 3 mm", Box(size=(4e-3, 3e-3, 6e-3)), 0.2, (0.2, 0.1), 10.0, (0.0, 5.0)),
    ("box 8 x 14 mm", Box(size=(8e-3, 14e-3, 8e-3)), 0.3, (-3.0, 0.1), 0.0, (0.0, 9.9)),
    ("box 8 x 14 mm", Box(size=(8e-3, 14e-3, 8e-3)), 0.3, (-2.3, 0.1), 25.0, (0.0, 9.9)),
]  # fmt: skip
CUBE, PIN = Box(size=(6e-3, 6e-3, 6e-3)), Sphere(radius=3e-3)
#: Presses of flat pads whose contact is small or narrow beside the elements, as `FLAT`.
NARROW: list[tuple[str, Indenter, float, tuple[float, float], float, tuple[float, float]]] = [
    *(("ball 3 mm", PIN, 10.0**-n, place, 0.0, (0.0, 0.0)) for n in (1, 2, 3, 4) for place in ((0.0, 0.0), (0.2, 0.1))),
    *(("ball 1 mm", Sphere(radius=1e-3), load, (0.13, 0.21), 0.0, (0.0, 0.0)) for load in (0.1, 0.01)),
    ("roller 2 mm", Roller(radius=2e-3, length=6e-3), 0.2, (0.1, 0.25), 20.0, (0.0, 0.0)),
    ("roller 1 mm", Roller(radius=1e-3, length=6e-3), 0.05, (0.1, 0.25), 20.0, (0.0, 0.0)),
    ("roller 4 mm", Roller(radius=4e-3, length=6e-3), 0.01, (0.1, 0.25), 20.0, (0.0, 0.0)),
    *(
        ("box 6 x 6 mm", CUBE, load, (0.3, -0.25), 0.0, tilts)
        for tilts in ((0.0, 5.0), (0.0, 9.9), (3.0, 3.0), (8.0, 5.0))
        for load in (0.05, 0.2)
    ),
    ("box 1 x 1 mm", Box(size=(1e-3, 1e-3, 6e-3)), 0.05, (0.3, 0.1), 0.0, (0.0, 0.0)),
    ("box 6 x 0.5 mm", Box(size=(6e-3, 0.5e-3, 6e-3)), 0.1, (0.3, 0.1), 0.0, (0.0, 0.0)),
    ("box 6 x 0.5 mm", Box(size=(6e-3, 0.5e-3, 6e-3)), 0.1, (0.3, 0.1), 30.0, (0.0, 0.0)),
]
#: Quantities that `estimates` compares.
QUANTITIES = ("misplaced_force", "peak_texel", "depth", "contact_area")
#: A length [m] or relative error [-] that counts as zero.
SMALL = 1e-9
#: Places of the 40 presses: a point on the line of motion [mm], and the direction of motion.
PLACES = {
    "top": ((0, -7, 0), (0, 0, -1)),
    "top, off the centre": ((1.5, -4.3, 0), (0, 0, -1)),
    "top, near the end": ((0, -11.5, 0), (0, 0, -1)),
    "side": ((0, -6, 2.5), (-1, 0, -0.3)),
    "side, near the tip": ((0, -1.2, 3), (-1, 0, -0.6)),
    "tip": ((0, 0, 2.5), (0, -1, -0.4)),
    "tip, aside": ((1.2, 0, 2.2), (0.2, -1, -0.5)),
    "oblique": ((0, -3, 1), (-0.5, -0.5, -1)),
}


def measure_responses() -> None:
    """Measure time and memory of the responses of all texels."""
    print("| cover | texels | hexahedra, finest | CPU s | s | GiB, so far | estimate, peak texel [%] | any texel [%] |")
    print("|---|---|---|---|---|---|---|---|")
    for cover, size in ((flat_pad(), 1.0), (phalanx(), 1.0), (fingertip(), 1.0), (fingertip(), 0.7)):
        start, processor = time.perf_counter(), time.process_time()
        response = texel_responses(cover.meshes(size), cover.texels, RUBBER)
        spent = f"{time.process_time() - processor:.0f} | {time.perf_counter() - start:.0f}"
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        errors = response.error_estimate
        print(
            f"| {cover.texels.name} | {cover.texels.count} | {len(response.finest.mesh.cells)} | {spent} | "
            f"{memory:.2f} | {100 * errors['peak_texel']:.2g} | {100 * errors['any_texel']:.2g} |",
            flush=True,
        )


def compare_estimates() -> None:
    """Compare error estimates with true errors, of closed forms and of the planar solution with free edges."""
    cover, material, ratios = phalanx(), RUBBER, []
    response = texel_responses(cover.meshes(), cover.texels, material)
    # The texels of the middle column are three thicknesses away from the free sides.
    x, y, _ = np.abs(cover.texels.centres).T
    inner = np.flatnonzero((x < SMALL) & (y < 6e-3))
    half, edge = np.arcsin(cover.texels.texel_size[0] / 2 / 6e-3), cover.texels.texel_size[1] / 2
    layer = CylinderLayer(core_radius=6e-3, thickness=2e-3, material=material)
    known = touch_cylinder(layer, SpotLoad(force=1.0)).texel_forces([[-half, half, -edge, edge]])[0]
    error = np.abs(np.diag(response.matrix)[inner] - known).max() / np.diag(response.matrix).max()
    print(
        f"phalanx, {len(inner)} texels of the middle column under point forces: error {100 * error:.2f} %, estimate "
        f"{100 * response.error_estimate['peak_texel']:.2f} %\n"
    )
    print(
        "| shape | place [mm], yaw, tilts [deg] | misplaced force: error, estimate [%] | texel forces | depth | area |"
    )
    print("|---|---|---|---|---|---|")
    for number in range(len(FLAT + NARROW)):
        line, ratio = compare_press(number)
        ratios.append(ratio)
        print(line, flush=True)
    known = [column[np.isfinite(column)] for column in np.array(ratios).T]  # nan: not resolved
    covered, median = [100 * (each >= 1).mean() for each in known], [np.median(each) for each in known]
    print(
        "\nestimate at least the error where there is one, and median of estimate over error: "
        + "; ".join(f"{name} {a:.0f} %, {b:.1f}" for name, a, b in zip(QUANTITIES, covered, median, strict=True))
    )


@cache
def mesh_pad() -> tuple[SolidCover, TexelArray, Cover]:
    """Mesh a flat pad of 14 mm; return it, its texels, and the same pad for the planar solution."""
    pad = flat_pad(size=(14e-3, 14e-3), rows=3)
    return take_meshes(pad.meshes(), RUBBER), pad.texels, make_cover(model="linear-elastic", size=(14e-3, 14e-3))


def compare_press(number: int) -> tuple[str, list[float]]:
    """Compare a press of a flat pad with the planar solution; return a row of the table, and estimates over errors."""
    name, indenter, load, (x, y), yaw, tilts = (FLAT + NARROW)[number]
    cover, texels, planar = mesh_pad()
    about_x, about_y = np.radians(tilts).tolist()
    pose = Pose(point=(1e-3 * x, 1e-3 * y, 5e-3), yaw=float(np.radians(yaw)), tilt=(about_x, about_y))
    found = press(cover, texels, indenter, pose, load=load)
    exact = press(planar, texels, indenter, pose, load=load)
    difference = np.abs(found.texel_forces - exact.texel_forces)
    errors = (
        difference.sum() / (2 * load), difference.max() / exact.texel_forces.max(),
        abs(found.depth / exact.depth - 1), abs(found.contact_area / exact.contact_area - 1),
    )  # fmt: skip
    pairs = list(zip(QUANTITIES, errors, strict=True))
    cells = " | ".join(f"{100 * each:.2f}, {100 * found.error_estimate[key]:.2f}" for key, each in pairs)
    row = f"| {name}, {load:g} N | {x:g}, {y:g}; {yaw:g}; {tilts[0]:g}, {tilts[1]:g} | {cells} |"
    return row, [found.error_estimate[key] / max(error, SMALL) for key, error in pairs]


def list_presses() -> Iterator[tuple[str, str, Indenter, Pose, float]]:
    """Shape, place, indenter, pose and load of the 40 presses."""
    for shape, (indenter, tilt, load) in SHAPES.items():
        turn = Rotation.from_euler("y", tilt).as_matrix()
        for place, (at, direction) in PLACES.items():
            pose = Pose.facing(1e-3 * np.array(at) - 20e-3 * np.array(direction), direction)
            turned = rotated_pose(pose.position, pose.rotation @ turn, direction)
            yield shape, place, indenter, turned, load


def score_fast_model() -> None:
    """Score the fast model on the 40 presses, against the reference on all meshes and on its own mesh."""
    from fastmodel.contact.points import press_points as press_fast

    cover = fingertip()
    meshes = cover.meshes()
    start = time.process_time()
    own = choose_mesh(meshes)
    fast = derive_points(own, cover.texels, RUBBER)
    print(f"fast model with {len(fast.centres)} loads, derived in {time.process_time() - start:.0f} CPU s\n")
    texel_responses(meshes, cover.texels, RUBBER)
    print(
        "| shape | place | depth [mm] | reference [CPU s] | [s] | estimate [%] | fast [ms] | misplaced, same mesh [%] |"
    )
    print("|---|---|---|---|---|---|---|---|")
    scores, times = [], []
    for shape, place, indenter, pose, load in list_presses():
        processor, wall = time.process_time(), time.perf_counter()
        known = press(take_meshes(meshes, RUBBER), cover.texels, indenter, pose, load=load)
        times.append((time.process_time() - processor, time.perf_counter() - wall))
        processor = time.process_time()
        found = press_fast(fast, indenter, pose, load=load)
        quick = 1e3 * (time.process_time() - processor)
        same = press(take_meshes([own], RUBBER), cover.texels, indenter, pose, load=load)
        scores.append(
            [100 * np.abs(found.texel_forces - each.texel_forces).sum() / (2 * load) for each in (known, same)]
        )
        print(
            f"| {shape} | {place} | {1e3 * known.depth:.2f} | {times[-1][0]:.1f} | {times[-1][1]:.1f} | "
            f"{100 * known.error_estimate['misplaced_force']:.1f} | {quick:.0f} | "
            f"{scores[-1][0]:.2f}, {scores[-1][1]:.2f} |",
            flush=True,
        )
    processor, wall = np.max(times[1:], axis=0)
    median, most = np.median(scores, axis=0), np.max(scores, axis=0)
    print(
        f"\nmisplaced force: median {median[0]:.2f}, {median[1]:.2f} %, at most {most[0]:.2f}, {most[1]:.2f} %; "
        f"reference after the first press: at most {processor:.1f} CPU s, {wall:.1f} s"
    )


PARTS = {
    "responses": measure_responses,
    "estimates": compare_estimates,
    "scores": score_fast_model,
}

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as store:
        os.environ["SOFTCOVER_STORE"] = store
        for each in sys.argv[1:] or PARTS:
            print(f"\n## {each}\n")
            PARTS[each]()
