"""Two grippers grasp, lift, let slip and drop six objects; their arrays of 120 texels against MuJoCo's own forces.

Neither gripper is used by an example: a Panda gripper (robosuite) and a Fetch gripper (gymnasium-robotics).  Two arrays
of 12 x 10 texels stand on their fingers, in place of the pads; physics steps of 2 ms, contact method `cover`, a reading
after every step.  Printed for each gripper and object:

- net: largest difference between the force that an array reads and the sum of `mj_contactForce` along its normal, over
  the latter; at least over `LIGHT`, the force below which rounding counts;
- change: largest and 99th percentile of the change of the image from one step to the next.  Both images are divided by
  their sums, the earlier one is moved by the motion of the centre of pressure, and half the sum of the absolute
  differences is taken.  Steps within `SETTLING` of the first touch and of the release of an array are left out;
- speed: simulated over processor time of physics and sensors in the grasp, while it is lifted and held.

    python -m pip install --no-deps --target /tmp/robosuite robosuite
    PYTHONPATH=/tmp/robosuite python -W ignore benchmarks/grippers.py [--repeat 3] [--gripper fetch] [--object box]
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from gripper_scenes import CLEARANCE, GRIPPERS, OBJECTS, TIMESTEP, Scene, find_package
from scipy.ndimage import shift

FloatArray = npt.NDArray[np.float64]

#: Largest force of the drives in the grasp [N].
GRIP = 12.0
#: Distance by which each finger is told to close beyond the object's surface [m]; height of the lift [m].
SQUEEZE, LIFT = 8e-3, 50e-3
#: Seconds of closing, lifting, holding, slipping (the force falls in the first half) and dropping.
SECONDS = {"close": 0.6, "lift": 0.5, "hold": 0.3, "slip": 1.0, "drop": 0.3}
#: Force of an array below which it counts as untouched, for the change of images [N].
LIGHT = 0.1
#: Steps after the first touch and before the release that are left out of the change of images [-].
SETTLING = 10


@dataclass
class Record:
    """What one array read at every step.

    Attributes:
        carried: Force that the array read [N].
        expected: Sum of MuJoCo's contact forces along the normal [N].
        images: Texel forces, shape (rows, columns) each [N].
    """

    carried: list[float] = field(default_factory=list)
    expected: list[float] = field(default_factory=list)
    images: list[FloatArray] = field(default_factory=list)


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


def contact_force(scene: Scene, plate: str) -> float:
    """Sum of MuJoCo's contact forces on a plate, against its normal [N]."""
    geom, found, total = scene.model.geom(plate).id, np.zeros(6), 0.0
    normal = scene.data.geom(plate).xmat.reshape(3, 3)[:, 2]
    for index, contact in enumerate(scene.data.contact):
        if geom in contact.geom:
            mujoco.mj_contactForce(scene.model, scene.data, index, found)
            on_second = contact.frame.reshape(3, 3).T @ found[:3]
            total -= normal @ on_second * (1.0 if contact.geom[1] == geom else -1.0)
    return float(total)


def run(scene: Scene, share: float = 1.0) -> tuple[list[Record], float]:
    """Run all phases, each for a share of its time; return the records and the real-time factor."""
    records = [Record() for _ in scene.sensors]
    taken, simulated = 0.0, 0.0
    for phase, seconds in SECONDS.items():
        steps = round(share * seconds / TIMESTEP)
        for step in range(steps):
            command(scene, phase, (step + 1) / steps)
            start = time.process_time()
            scene.step()
            if phase in {"lift", "hold"}:
                taken += time.process_time() - start
                simulated += TIMESTEP
            for record, sensor in zip(records, scene.sensors, strict=True):
                record.carried.append(sensor.carried())
                record.expected.append(contact_force(scene, f"{sensor.name}/plate"))
                record.images.append(sensor.parameters.array.image(sensor.frame().texel_forces))
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
    """Change of the image at every step that counts."""
    touched = np.array(record.carried) > LIGHT
    counts = touched.copy()
    for step in range(-SETTLING, SETTLING + 1):
        counts &= np.roll(touched, step)
    return np.array([change(record.images[k - 1], record.images[k]) for k in counts.nonzero()[0] if counts[k - 1]])


def measure(records: list[Record], speed: float) -> dict[str, Any]:
    """Figures of one run."""
    carried, expected = (np.array([getattr(each, name) for each in records]) for name in ("carried", "expected"))
    change = np.concatenate([changes(each) for each in records])
    return {
        "grip": float(expected.max()),
        "net": float((np.abs(carried - expected) / np.maximum(np.abs(expected), LIGHT)).max()),
        "change": float(change.max()),
        "change_99": float(np.percentile(change, 99)),
        "steps": len(change),
        "above_5_percent": int((change > 0.05).sum()),
        "speed": speed,
    }


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gripper", choices=GRIPPERS, action="append")
    parser.add_argument("--object", choices=OBJECTS, action="append")
    parser.add_argument("--repeat", type=int, default=1, help="runs of which the fastest gives the speed")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for name in options.gripper or GRIPPERS:
        if find_package(GRIPPERS[name].package) is None:
            print(f"{name}: {GRIPPERS[name].package} is not installed")
            continue
        for thing in options.object or OBJECTS:
            found = []
            for _ in range(options.repeat):
                scene = Scene(GRIPPERS[name], thing)
                found.append(measure(*run(scene)))
            figures = found[0] | {"speed": max(each["speed"] for each in found)}
            rows.append({"gripper": name, "object": thing, **figures, "warnings": scene.warned})
            print(
                f"{name:6} {thing:9} grip {figures['grip']:5.1f} N   net {figures['net']:.1e}   change at most "
                f"{100 * figures['change']:6.2f} %, 99th percentile {100 * figures['change_99']:6.2f} %   "
                f"{figures['speed']:.1f} times real time"
            )
        for line in sorted({line for row in rows if row["gripper"] == name for line in row["warnings"]}):
            print(f"{name}: {line}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
