"""Three grippers grasp, lift, let slip and drop six objects; their arrays of 120 texels against MuJoCo's own forces.

No gripper is used by an example: a Panda and a Rethink gripper (robosuite) and a Fetch gripper (gymnasium-robotics).
Two arrays of 12 x 10 texels stand on their fingers, in place of the pads; physics steps of 2 ms, contact method
`cover`, a reading after every step.  With `--turned`, objects are turned by up to 45 degrees about a random axis; with
`--free`, bodies of eight shapes press on one array in random poses under a force and a torque that wobbles.  Printed
for each gripper and object:

- net: largest difference between the force that an array reads and the sum of `mj_contactForce` along its normal, over
  the latter; at least over `LIGHT`, the force below which rounding counts;
- change: largest and 99th percentile of the change of the image from one step to the next.  Both images are divided by
  their sums, the earlier one is moved by the motion of the centre of pressure, and half the sum of the absolute
  differences is taken.  Steps within `SETTLING` of the first touch and of the release of an array are left out;
- jumps: steps in which the image changes by more than 5 % and MuJoCo's own force and torque by less;
- off: share of the steps in which the centre of pressure lies more than a cell from that of MuJoCo's contact points,
  and the largest distance;
- cells: number of pressed cells under a body, in the median;
- speed: simulated over processor time of physics and sensors in the grasp, while it is lifted and held.

    python -m pip install --no-deps --target /tmp/robosuite robosuite
    PYTHONPATH=/tmp/robosuite python -W ignore benchmarks/grippers.py [--repeat 3] [--gripper fetch] [--object box]
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from gripper_scenes import CLEARANCE, FREE, GRIPPERS, OBJECTS, TIMESTEP, FreeScene, Scene, find_package
from scipy.ndimage import shift
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]

#: Largest force of the drives in the grasp [N].
GRIP = 12.0
#: Distance by which each finger is told to close beyond the object's surface [m]; height of the lift [m].
SQUEEZE, LIFT = 8e-3, 50e-3
#: Seconds of closing, lifting, holding, slipping (the force falls in the first half) and dropping.
SECONDS = {"close": 0.6, "lift": 0.5, "hold": 0.3, "slip": 1.0, "drop": 0.3}
#: Force of an array below which it counts as untouched, for the change of images [N].
LIGHT = 0.1
#: Edge of a cell of an array of pitch 3.4 mm, the accepted distance of centres of pressure [m].
CELL = 0.85e-3
#: Pitch by which radii of images are measured, about that of all arrays [m].
PITCH = 2e-3
#: Steps after the first touch and before the release that are left out of the change of images [-].
SETTLING = 10


@dataclass
class Record:
    """What one array read at every step.

    Attributes:
        carried: Force that the array read [N].
        expected: Sum of MuJoCo's contact forces along the normal [N].
        images: Texel forces, shape (rows, columns) each [N].
        centres: Centre of pressure, shape (2,) each [m].
        wanted: Centre of MuJoCo's contact forces on the front, shape (2,) each [m].
        cells: Number of cells under pressure [-].
    """

    carried: list[float] = field(default_factory=list)
    expected: list[float] = field(default_factory=list)
    images: list[FloatArray] = field(default_factory=list)
    centres: list[FloatArray] = field(default_factory=list)
    wanted: list[FloatArray] = field(default_factory=list)
    cells: list[int] = field(default_factory=list)

    def radius(self, step: int) -> float:
        """Root mean square distance of the force from its centre, in an image [m]."""
        image = np.maximum(self.images[step], 0) / np.maximum(self.images[step], 0).sum()
        rows, columns = np.indices(image.shape)
        middle = find_centre(image)
        return PITCH * math.sqrt((image * ((rows - middle[0]) ** 2 + (columns - middle[1]) ** 2)).sum())


def command(scene: Scene, phase: str, progress: float, *, lift: float = LIFT) -> None:
    """Command fingers and carriage at a moment of a phase, from 0 to 1."""
    closed = CLEARANCE + SQUEEZE
    match phase:
        case "close":
            scene.drive(progress * closed, GRIP, 0.0)
        case "lift":
            scene.drive(closed, GRIP, lift * progress)
        case "hold":
            scene.drive(closed, GRIP, lift)
        case "slip":
            falling = max(1 - 2 * progress, 0.0) ** 2
            scene.drive(closed, GRIP * falling + scene.gripper.slipping * (1 - falling), lift)
        case "drop":
            scene.drive((1 - 2 * progress) * CLEARANCE, GRIP, lift)


def contact_force(scene: Scene | FreeScene, plate: str) -> tuple[float, FloatArray]:
    """Sum of MuJoCo's contact forces on a plate, against its normal [N], and their centre on the plate, shape (2,) [m].

    The centre counts the contacts with the front alone.
    """
    geom, found, total = scene.model.geom(plate).id, np.zeros(6), 0.0
    axes, place, front = scene.data.geom(plate).xmat.reshape(3, 3), scene.data.geom(plate).xpos, np.zeros(3)
    for index, contact in enumerate(scene.data.contact):
        if geom in contact.geom:
            mujoco.mj_contactForce(scene.model, scene.data, index, found)
            on_second = contact.frame.reshape(3, 3).T @ found[:3]
            force = -axes[:, 2] @ on_second * (1.0 if contact.geom[1] == geom else -1.0)
            total += force
            if abs(axes[:, 2] @ contact.frame[:3]) > 0.7:
                front += force * np.append((contact.pos - place) @ axes[:, :2], 1.0)
    return float(total), front[:2] / front[2] if front[2] else np.full(2, np.nan)


def note(scene: Scene | FreeScene, records: list[Record]) -> None:
    """Write down what every array reads."""
    for record, sensor in zip(records, scene.sensors, strict=True):
        force, wanted = contact_force(scene, f"{sensor.name}/plate")
        frame = sensor.frame()
        x, y, _ = frame.pressure_torque
        record.carried.append(sensor.carried())
        record.expected.append(force)
        record.images.append(sensor.parameters.array.image(frame.texel_forces))
        record.centres.append(np.array([y, -x]) / max(sensor.carried(), 1e-9))
        record.wanted.append(wanted)
        record.cells.append(sensor._reading.fewest_cells or 0)  # noqa: SLF001


def run_free(scene: FreeScene, seconds: float) -> tuple[list[Record], float]:
    """Run a scene with a free body; return the records and the real-time factor while the array is touched."""
    records, taken, simulated = [Record() for _ in scene.sensors], 0.0, 0.0
    for _ in range(round(seconds / TIMESTEP)):
        start = time.process_time()
        scene.step()
        if scene.sensors[0].carried():
            taken += time.process_time() - start
            simulated += TIMESTEP
        note(scene, records)
    return records, simulated / max(taken, 1e-9)


def run(scene: Scene, share: float = 1.0) -> tuple[list[Record], float]:
    """Run all phases, each for a share of its time; return the records and the real-time factor."""
    records = [Record() for _ in scene.sensors]
    taken, simulated = 0.0, 0.0
    for phase, seconds in SECONDS.items():
        steps = round(share * seconds / TIMESTEP)
        if phase == "lift":
            scene.let_go()
        for step in range(steps):
            command(scene, phase, (step + 1) / steps)
            start = time.process_time()
            scene.step()
            if phase in {"lift", "hold"}:
                taken += time.process_time() - start
                simulated += TIMESTEP
            note(scene, records)
    return records, simulated / taken


def change(before: FloatArray, after: FloatArray) -> float:
    """Change of an image, after scaling to its sum and moving to its centre of pressure [-]."""
    first, second = before / before.sum(), after / after.sum()
    moved = shift(first, find_centre(second) - find_centre(first), order=3, mode="nearest")
    return float(np.abs(moved / moved.sum() - second).sum() / 2)


def find_centre(image: FloatArray) -> FloatArray:
    """Centre of pressure of an image whose sum is one, row and column [texels]."""
    rows, columns = np.indices(image.shape)
    return np.array([(image * rows).sum(), (image * columns).sum()])


def changes(record: Record) -> FloatArray:
    """Change of the image, and of MuJoCo's force and torque, at every step that counts, shape (steps, 2) [-].

    The change of the torque is that of the centre of pressure over the radius of the image.
    """
    touched = np.array(record.carried) > LIGHT
    counts = touched.copy()
    for step in range(-SETTLING, SETTLING + 1):
        counts &= np.roll(touched, step)
    found = []
    for k in counts.nonzero()[0]:
        if counts[k - 1]:
            shifted = np.linalg.norm(record.wanted[k] - record.wanted[k - 1]) / record.radius(k)
            forced = abs(record.expected[k] / record.expected[k - 1] - 1)
            found.append((change(record.images[k - 1], record.images[k]), max(forced, shifted)))
    return np.array(found).reshape(-1, 2)


def distances(record: Record) -> FloatArray:
    """Distance of the centre of pressure from that of MuJoCo's contact points, at every touched step [m]."""
    touched = np.array(record.carried) > LIGHT
    apart = np.linalg.norm(np.array(record.centres) - np.array(record.wanted), axis=1)[touched]
    return np.asarray(apart[np.isfinite(apart)])


def measure(records: list[Record], speed: float) -> dict[str, Any]:
    """Figures of one run."""
    carried, expected = (np.array([getattr(each, name) for each in records]) for name in ("carried", "expected"))
    apart = np.concatenate([distances(each) for each in records] + [np.zeros(1)])
    change, forced = np.concatenate([changes(each) for each in records] + [np.zeros((1, 2))]).T
    return {
        "off": float((apart > CELL).mean()),
        "farthest": float(apart.max()),
        "touched": len(apart),
        "cells": float(np.median([n for each in records for n in each.cells if n] or [0])),
        "jumps": int(((change > 0.05) & (forced < change)).sum()),
        "change_999": float(np.percentile(change, 99.9)),
        "grip": float(expected.max()),
        "net": float((np.abs(carried - expected) / np.maximum(np.abs(expected), LIGHT)).max()),
        "change": float(change.max()),
        "change_99": float(np.percentile(change, 99)),
        "steps": len(change),
        "above_5_percent": int((change > 0.05).sum()),
        "speed": speed,
    }


def random_turn(random: np.random.Generator) -> FloatArray:
    """Draw a rotation vector about a random axis by up to 45 degrees, shape (3,) [rad]."""
    axis = random.normal(size=3)
    return np.asarray(axis / np.linalg.norm(axis) * random.uniform(0, np.pi / 4))


def run_gripper(name: str, options: argparse.Namespace, random: np.random.Generator) -> list[dict[str, Any]]:
    """Run the scenes of one gripper, and print and return their figures."""
    if find_package(GRIPPERS[name].package) is None:
        print(f"{name}: {GRIPPERS[name].package} is not installed")
        return []
    rows = []
    things = [thing for thing in options.object or OBJECTS if not (options.turned and thing == "flex")]
    for thing in np.repeat(things, max(options.turned, 1)).tolist():
        turn, found = Rotation.from_rotvec(random_turn(random)) if options.turned else None, []
        for _ in range(options.repeat):
            scene = Scene(GRIPPERS[name], thing, turn)
            found.append(measure(*run(scene)))
        speed = max(each["speed"] for each in found)
        rows.append({"gripper": name, "object": thing, **found[0], "speed": speed, "warnings": scene.warned})
        print(describe(rows[-1]), flush=True)
    for line in sorted({line for row in rows for line in row["warnings"]}):
        print(f"{name}: {line}")
    return rows


def describe(figures: dict[str, Any]) -> str:
    """Describe the figures of a run in one line."""
    return (
        f"{figures['gripper']:7} {figures['object']:9} grip {figures['grip']:5.1f} N   net {figures['net']:.1e}   "
        f"change at most {100 * figures['change']:6.2f} %, 99th percentile {100 * figures['change_99']:6.2f} %, jumps "
        f"{figures['jumps']:3d} of {figures['steps']:4d}   off {100 * figures['off']:6.2f} %, at most "
        f"{1e3 * figures['farthest']:5.2f} mm   {figures['cells']:4.0f} cells, {figures['speed']:.1f} times real time"
    )


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gripper", choices=GRIPPERS, action="append", default=[])
    parser.add_argument("--object", choices=OBJECTS, action="append")
    parser.add_argument("--repeat", type=int, default=1, help="runs of which the fastest gives the speed")
    parser.add_argument("--turned", type=int, default=0, help="random turns of each object; 0 for upright objects")
    parser.add_argument("--free", type=int, default=0, help="random scenes with each free body")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    rows = [
        row
        for name in (options.gripper if options.gripper or options.free else GRIPPERS)
        for row in run_gripper(name, options, random)
    ]
    for thing in FREE:
        for _ in range(options.free):
            rows.append({"gripper": "free", "object": thing, **measure(*run_free(FreeScene(thing, random), 1.0))})
            print(describe(rows[-1]), flush=True)
    keys = ("touched", "steps", "off", "jumps", "farthest", "speed", "net")
    total = {key: np.array([row[key] for row in rows]) for key in keys}
    print(
        f"{total['touched'].sum()} touched steps: centre off in "
        f"{100 * total['off'] @ total['touched'] / total['touched'].sum():.3f} %, at most "
        f"{1e3 * total['farthest'].max():.2f} mm; jumps in {100 * total['jumps'].sum() / total['steps'].sum():.3f} %; "
        f"speed {np.median(total['speed']):.1f} in the median, {total['speed'].min():.1f} at least; largest net error "
        f"{total['net'].max():.1e}"
    )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
