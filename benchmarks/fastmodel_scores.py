"""Score every contact method of the fast model against the finite elements (small strain).

Eight shapes x 2 weights x 3 yaws x 4 positions on the WTS 0614-34, 2 mm of rubber at Poisson ratio 0.49 and 0.3; two
squares at once; a block loaded off its middle and free to tilt.  Takes a few minutes with an empty store.

    python benchmarks/fastmodel_scores.py [--json FILE]
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import fastmodel_costs
import gripper_scenes
import grippers
import mujoco
import numpy as np
from campaign import LOADS, SHAPES
from other_methods import METHODS, use_distance_fields
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import WTS_0614_34, Parameters, Placement
from fastmodel.contact.interface import TexelContact
from fastmodel.contact.reader import ArrayContact
from fastmodel.pressure.solvers import Load
from fastmodel.signal.electronics import grey_levels
from fem_reference import point_spread, press
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Box, Pose, TexelArray
from meshes.catalogue import ARRAYS
from tests.support.rubber import make_cover
from validation.derivation.kernel import cover_cells

ARRAY: TexelArray = ARRAYS["wts-0614-34"]
BLOCK = Box(size=(10e-3, 10e-3, 10e-3))
YAWS = (0.0, np.pi / 4, np.pi / 2)
#: Over a texel's centre, edge and corner, and off the grid.
PLACES = ((1.7e-3, 1.7e-3), (1.7e-3, 0.0), (0.0, 0.0), (0.7e-3, -1.1e-3))
RATIOS = (0.49, 0.3)
#: Objects of the grasps, and the force on an array above which its image is scored [N].
GRASPED, LEAST = ("box", "sphere", "cylinder", "capsule"), 0.5


def parameters(poisson_ratio: float) -> Parameters:
    """The fast model of that cover, with the Gaussian that fits it best."""
    cover = make_cover(poisson_ratio, "linear-elastic")
    spread = point_spread(cover)
    uniform = ARRAY.image(spread.texel_response(ARRAY, load="uniform"))
    fit = fastmodel.fit_gaussian(uniform, (ARRAY.rows // 2, ARRAY.columns // 2))
    cells = cover_cells(cover, ARRAY, spread)
    return Parameters(array=ARRAY, spread=fit.gaussian, electronics=WTS_0614_34, surface=cells)


def misplaced(reference, found, load: float) -> float:  # noqa: ANN001 -- any two results with texel forces
    """Share of the load on wrong texels [%]."""
    apart = np.abs(found.texel_forces - reference.texel_forces).sum() + abs(found.outside - reference.outside)
    return float(50 * apart / load)


def image_changed(reference, found) -> float:  # noqa: ANN001
    """The 2015 report's measure, grey levels scaled to the largest reference texel [%]."""
    white = reference.texel_forces.max()
    grey = [grey_levels(each.texel_forces, white).astype(int) for each in (reference, found)]
    return float(100 * np.abs(grey[0] - grey[1]).sum() / (255 * ARRAY.count))


def single(ratio: float, shapes=tuple(SHAPES), loads=LOADS, yaws=YAWS, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of guided shapes, one at a time."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for name, load, yaw, at in itertools.product(shapes, loads, yaws, places):
        shape = SHAPES[name]
        reference = press(cover, ARRAY, shape, load=load, pose=Pose.planar(at=at, yaw=yaw))
        for method, contact in METHODS.items():
            found = fastmodel.indent(fast, shape, load=load, at=at, yaw=yaw, contact=contact)
            yield _row(ratio, name, method, reference, found, load, at, yaw)


def two_squares(ratio: float, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of 12 and 6 mm squares, 16 mm apart along y, 500 and 100 g, each at its own depth."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for x, y in places:
        squares = [("big square", LOADS[1], (x, y - 6e-3)), ("small square", LOADS[0], (x, y + 10e-3))]
        bodies = [Body(indenter=SHAPES[name], load=load, at=at) for name, load, at in squares]
        reference = press_together(cover, ARRAY, bodies)
        placements = [Placement(indenter=SHAPES[name], load=load, at=at) for name, load, at in squares]
        for method, contact in METHODS.items():
            found = fastmodel.indent_together(fast, placements, contact=contact)
            yield _row(ratio, "two squares", method, reference, found, sum(LOADS), (x, y), 0.0)


def tilting_block(ratio: float, places=PLACES) -> Iterator[dict]:  # noqa: ANN001
    """Scores of a 10 mm block whose weight acts 2 mm off its middle, free to tilt."""
    fast, cover = parameters(ratio), make_cover(ratio, "linear-elastic")
    for at in places:
        settings = {"indenter": BLOCK, "load": LOADS[1], "at": at, "guided": False, "centre": (2e-3, 0.0)}
        reference = press_together(cover, ARRAY, [Body(**settings)])
        for method, contact in METHODS.items():
            found = fastmodel.indent_together(fast, [Placement(**settings)], contact=contact)
            yield _row(ratio, "tilting block", method, reference, found, LOADS[1], at, 0.0)


def grasps(contact: str | TexelContact, *, turned: bool, every: int = 20) -> Iterator[tuple[str, float]]:
    """Scores of a contact method in grasps, against `cover` under the same pose, force and moments.

    Args:
        contact: The method, whose geoms bear the object.
        turned: Whether the objects are turned by up to 45 degrees about a random axis.
        every: Number of physics steps from one scored state to the next [-].

    Yields:
        Name of gripper and object, and the force on wrong texels [%].
    """
    random = np.random.default_rng(0)
    for gripper, thing in itertools.product(gripper_scenes.GRIPPERS, GRASPED):
        turn = Rotation.from_rotvec(grippers.random_turn(random)) if turned else None
        scene = gripper_scenes.Scene(gripper_scenes.GRIPPERS[gripper], thing, turn, contact)
        for phase, seconds in grippers.SECONDS.items():
            steps = round(seconds / gripper_scenes.TIMESTEP)
            if phase == "lift":
                scene.let_go()
            for step in range(steps):
                grippers.command(scene, phase, (step + 1) / steps)
                scene.step()
                for cover, sensor in zip(scene.covers, scene.sensors, strict=True):
                    load = sensor.carried()
                    if step % every == 0 and load > LEAST and (pressed := find_contact(scene, cover, sensor)):
                        truth, found = cover._reader._solve(pressed).reading, sensor.frame().texel_forces  # noqa: SLF001
                        load = truth.carried
                        outside = load - truth.texel_forces.sum()
                        apart = np.abs(truth.texel_forces - found).sum() + abs(outside - (load - found.sum()))
                        yield f"{gripper}, {thing}", float(50 * apart / load)


def find_contact(scene: gripper_scenes.Scene, cover: fastmodel.Sensor, sensor: fastmodel.Sensor) -> ArrayContact | None:
    """The bodies that press on a sensor, with their loads and poses, as a reader of `cover` takes them."""
    reader, data, sums, force = cover._reader, scene.data, dict[int, np.ndarray](), np.zeros(6)  # noqa: SLF001
    frame = reader._find_frame(data)  # noqa: SLF001
    for k, contact in enumerate(data.contact):
        mine = [g >= 0 and scene.model.geom(int(g)).name.startswith(f"{sensor.name}/") for g in contact.geom]
        if contact.efc_address < 0 or not any(mine):
            continue
        side = mine.index(True)
        mujoco.mj_contactForce(scene.model, data, k, force)
        turn = contact.frame.reshape(3, 3) @ frame[:3] * (1.0 if side == 0 else -1.0)  # its first row points outwards
        x, y, _ = (contact.pos - frame[3]) @ frame[:3]
        body = int(reader._bodies.of_geom[contact.geom[1 - side]])  # noqa: SLF001
        sums[body] = sums.get(body, np.zeros(3)) + force[:3] @ turn[:, 2] * np.array([1.0, x, y])
    if min(sums, default=-1) < 0 or min(each[0] for each in sums.values()) <= 0:
        return None
    tilts = {body: reader._joints.let_tilt(data, body, frame[:3, 2]) for body in sums}  # noqa: SLF001
    return ArrayContact(
        bodies=tuple(sums),
        loads=tuple(Load.on_plate(each[0], each[1:], tilts=tilts[body]) for body, each in sums.items()),
        poses=tuple(reader._find_pose(data, body, frame, 1e-3) for body in sums),  # noqa: SLF001
        owner=np.arange(len(sums)),
        touches=np.array([[each[1] / each[0], each[2] / each[0], each[0]] for each in sums.values()]),
        points=np.zeros((0, 3)),
        beside=0.0,
    )


def _row(ratio, name, method, reference, found, load, at, yaw) -> dict:  # noqa: ANN001, PLR0917
    return {
        "poisson_ratio": ratio,
        "shape": name,
        "method": method,
        "load": load,
        "at": list(at),
        "yaw": yaw,
        "misplaced": misplaced(reference, found, load),
        "image_changed": image_changed(reference, found),
        "balance": abs(found.total_force / load - 1),
    }


def summary(rows: list[dict]) -> list[str]:
    """One line per method and group."""
    lines = [f"{'method':<20}{'cases':<16}{'misplaced [%]: median':>22}{'mean':>8}{'max':>8}{'image [%]':>12}"]
    groups = {"guided": set(SHAPES), "two squares": {"two squares"}, "tilting block": {"tilting block"}}
    for method, (group, names) in itertools.product(METHODS, groups.items()):
        mine = [row for row in rows if row["method"] == method and row["shape"] in names]
        if mine:
            values = np.array([[row["misplaced"], row["image_changed"]] for row in mine])
            m, image = values[:, 0], values[:, 1].mean()
            title = f"{group} ({len(mine)})"
            lines.append(f"{method:<20}{title:<16}{np.median(m):>22.2f}{m.mean():>8.2f}{m.max():>8.2f}{image:>12.3f}")
    return lines


def compare(rows: list[dict]) -> Iterator[str]:
    """Lines of a table of all methods: scores of the cases and in grasps, and cost of a step over that of a plate."""
    costs = fastmodel_costs.methods(fastmodel_costs.parameters(ARRAY), ("20 mm face", "sphere"))
    heads = ("method", "guided presses", "tilting block", "grasps", "turned grasps", "face, resting", "face, sliding")
    yield f"| {' | '.join(heads)} | ball, sliding |\n|{'---|' * 8}"
    for method, contact in METHODS.items():
        cells = []
        for names in (set(SHAPES), {"tilting block"}):
            values = [row["misplaced"] for row in rows if row["method"] == method and row["shape"] in names]
            cells.append(f"{np.median(values):.1f} / {max(values):.1f}")
        for turned in (False, True):
            values = [value for _, value in grasps(contact, turned=turned)]
            cells.append(f"{np.median(values):.1f} / {np.percentile(values, 95):.1f}" if method != "cover" else "")
        seconds = [row["seconds"] for row in costs if row["sliding"] or row["shape"] != "sphere"]
        cells += [f"x{each[method] / each['bare']:.1f}" for each in seconds]
        yield f"| {method} | {' | '.join(cells)} |"


def main() -> None:
    """Score all cases and print the table."""
    parser = argparse.ArgumentParser(description="score the contact methods against the finite elements")
    parser.add_argument("--json", type=Path, help="where to write every case")
    parser.add_argument("--table", action="store_true", help="print a table that also holds grasps and costs")
    options = parser.parse_args()
    target = options.json
    use_distance_fields()
    rows = []
    for ratio in RATIOS:
        rows += [*single(ratio), *two_squares(ratio), *tilting_block(ratio)]
    print("\n".join(summary(rows)))
    for name in SHAPES:
        means = [
            np.mean([row["misplaced"] for row in rows if (row["shape"], row["method"]) == (name, method)])
            for method in METHODS
        ]
        print(
            f"{name:<18}" + "".join(f"{method} {mean:6.2f} %   " for method, mean in zip(METHODS, means, strict=True))
        )
    if options.table:
        print(*compare(rows), sep="\n")
    if target is not None:
        target.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
