"""A Shadow hand with nine tactile arrays (132 texels) grasps a grip and turns over.

    python -m pip install -e '.[report,device]' gymnasium-robotics  # in a clone of softcover
    python examples/shadow_hand.py --out shadow-hand

The example shows how to attach several arrays to the moving bodies of one MuJoCo model.  It writes every frame of
every array to `hand.mcap` (show it with `softcover replay hand.mcap --array 8`), draws four moments in `hand.png`, and
prints the largest force on each array and the ratio of simulated to computing time.

The model of the hand is that of the package `gymnasium-robotics`.  In the frame of each link, z points to the fingertip
and -y points out of the palm.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if not os.environ.get("DISPLAY"):
    # MuJoCo reads this when it is imported.  Without a display it can render through EGL only.
    os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
import numpy.typing as npt

import fastmodel
from meshes import TexelArray

if TYPE_CHECKING:
    from shadow_hand_picture import Moment

    from validation.recordings.recording import RecordedArray

#: Physics time step and length of the run [s].
TIMESTEP, SECONDS = 1e-3, 4.0
#: Frames per second of each array.  The nine arrays share one serial line, so it is below the 271 Hz of a single one.
RATE_HZ = 100.0
#: Start and end of three motions: the fingers close, the fingers curl, the forearm turns by 180 degrees [s].
CLOSE, CURL, TURN = (0.3, 0.9), (0.7, 1.3), (1.8, 3.0)
#: Largest height and width of a rendered picture [pixels].
PICTURE_SIZE = (440, 520)

#: Prefix of every name in the model of the hand.
PREFIX = "robot0:"
#: The first, middle, ring and little finger.
FINGERS = ("ff", "mf", "rf", "lf")
#: Orientation of each array in its link's frame (quaternion): x across the hand, y to the fingertip, z out of the palm.
PALMAR = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
#: Joint angles at the start and in the grasp [rad].  `FJ...` stands for that joint of all four fingers.
OPEN = {"FJ2": 1.03, "FJ1": 0.25, "THJ4": 0.91, "THJ3": 0.21}
GRASP = {"FJ2": 1.56, "FJ1": 0.86, "THJ4": 0.91, "THJ3": 0.18, "THJ2": 0.2, "THJ1": 0.17, "THJ0": -1.2}

#: The grip has one rounded rib per finger, the little finger's first: position along the grip and radius [m].
RIB_POSITIONS, RIB_RADII = (-0.033, -0.011, 0.011, 0.033), (0.0236, 0.025, 0.0265, 0.0236)
#: Half the width of a rib [m]; mass of the grip [kg].
RIB_HALF_WIDTH, GRIP_MASS = 0.0125, 0.2
#: Centre of the grip in the palm's frame at the start [m].  There the grip rests on the palm's array.
GRIP_START = (0.0009, -0.0385, 0.0601)


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where one array is mounted.

    Attributes:
        link: Name of the link without the prefix; the array has the same name.
        rows: Texels along the finger.
        columns: Texels across the finger.
        position: Centre of the cover's top surface in the link's frame [m].
    """

    link: str
    rows: int
    columns: int
    position: tuple[float, float, float]


#: The nine arrays.  The palm's array leaves room for the thumb and the knuckles.
MOUNTS = (
    *(Mount(link=f"{finger}middle", rows=4, columns=1, position=(0.0, -0.011, 0.0125)) for finger in FINGERS),
    *(Mount(link=f"{finger}proximal", rows=4, columns=2, position=(0.0, -0.012, 0.031)) for finger in FINGERS),
    Mount(link="palm", rows=14, columns=6, position=(-0.008, -0.0131, 0.050)),
)


class Hand:
    """The hand, its arrays and the grip.

    Args:
        parameters: A sensor; every array here has its pitch, cover and electronics.
        method: Contact method by name.
        rate: Frames per second of each array [Hz].
        timestep: Time step of the physics [s].

    Attributes:
        model: The compiled model.
        data: The state of the simulation.
        sensors: The sensors by the name of their link, in the order of `MOUNTS`.
    """

    def __init__(
        self,
        parameters: fastmodel.Parameters,
        *,
        method: str = "default",
        rate: float = RATE_HZ,
        timestep: float = TIMESTEP,
    ) -> None:
        spec = load_hand()
        fastmodel.recommend_options(spec)
        spec.option.timestep = timestep
        spec.visual.global_.offheight, spec.visual.global_.offwidth = PICTURE_SIZE
        add_forearm_joint(spec)
        add_grip(spec)
        self.sensors = {
            mount.link: fastmodel.attach(
                spec,
                PREFIX + mount.link,
                resize(parameters, mount, rate),
                name=mount.link,
                position=mount.position,
                quaternion=PALMAR,
                contact=method,
            )
            for mount in MOUNTS
        }
        self.model: mujoco.MjModel = spec.compile()
        self.data = mujoco.MjData(self.model)
        for sensor in self.sensors.values():
            sensor.bind(self.model)
        start, grasp = expand_fingers(OPEN), expand_fingers(GRASP)
        self._actuators = [self.model.actuator(f"{PREFIX}A_{joint}").id for joint in grasp]
        self._is_knuckle = np.array([joint.endswith("J2") for joint in grasp])
        self._open = np.array([start.get(joint, 0.0) for joint in grasp])
        self._grasp = np.array(list(grasp.values()))
        self._set_initial_pose()

    def run(self, seconds: float = SECONDS) -> Iterator[float]:
        """Simulate and yield the time of each new frame [s]; all arrays deliver their frames together."""
        while self.data.time < seconds:
            self._set_controls()
            mujoco.mj_step(self.model, self.data)
            is_new = [sensor.step(self.data) for sensor in self.sensors.values()]
            if all(is_new):
                yield self.sensors["palm"].frame().time

    def _set_initial_pose(self) -> None:
        """Put the fingers half open and the grip on the palm."""
        for joint, angle in expand_fingers(OPEN).items():
            self.data.joint(PREFIX + joint).qpos[0] = angle
        mujoco.mj_forward(self.model, self.data)
        palm = self.data.body(PREFIX + "palm")
        across = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
        position = palm.xpos + palm.xmat.reshape(3, 3) @ GRIP_START
        self.data.joint("grip").qpos[:3] = position
        mujoco.mju_mulQuat(self.data.joint("grip").qpos[3:], palm.xquat, across)
        self._set_controls()

    def _set_controls(self) -> None:
        now = self.data.time
        progress = np.where(self._is_knuckle, smooth_step(now, *CLOSE), smooth_step(now, *CURL))
        self.data.ctrl[self._actuators] = self._open + progress * (self._grasp - self._open)
        self.data.ctrl[-1] = np.pi * smooth_step(now, *TURN)


def load_hand() -> mujoco.MjSpec:
    """Load the model of the hand, palm up, without the scenes of its package."""
    package = importlib.util.find_spec("gymnasium_robotics")
    if package is None or not package.submodule_search_locations:
        raise SystemExit("gymnasium_robotics is not installed; run: python -m pip install gymnasium-robotics")
    assets = Path(package.submodule_search_locations[0]) / "envs" / "assets"
    parts = assets / "hand"
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco model="hand">
        <compiler angle="radian" meshdir="{assets / "stls" / "hand"}"/>
        <include file="{parts / "shared.xml"}"/>
        <asset><include file="{parts / "shared_asset.xml"}"/></asset>
        <worldbody><include file="{parts / "robot.xml"}"/></worldbody>
        </mujoco>"""
    )
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.45] * 3, [0.6] * 3
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1 = texture.rgb2 = [1.0, 1.0, 1.0]
    return spec


def add_forearm_joint(spec: mujoco.MjSpec) -> None:
    """Add a driven joint that turns the forearm about its own axis."""
    mount = spec.body(PREFIX + "hand mount")
    joint = mount.add_joint(name="turn", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], armature=0.05)
    # Newer versions of MuJoCo take the coefficients of a polynomial here, older ones a single number.
    joint.damping = [2.0, 0.0, 0.0] if np.ndim(joint.damping) else 2.0
    actuator = spec.add_actuator(name="turn", target="turn", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(kp=100, kv=10)


def add_grip(spec: mujoco.MjSpec) -> None:
    """Add a free handle with one rounded rib per finger."""
    body = spec.worldbody.add_body(name="grip")
    body.add_freejoint(name="grip")
    for position, radius in zip(RIB_POSITIONS, RIB_RADII, strict=True):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[radius, radius, RIB_HALF_WIDTH],
            pos=[0.0, 0.0, position],
            mass=GRIP_MASS / len(RIB_POSITIONS),
            condim=4,
            rgba=[0.85, 0.45, 0.2, 1.0],
        )


def resize(parameters: fastmodel.Parameters, mount: Mount, rate: float) -> fastmodel.Parameters:
    """Give the same cover and electronics an array of another size.  The pitch must stay the same."""
    pitch, size = parameters.array.pitch, parameters.array.texel_size
    array = TexelArray.grid(mount.rows, mount.columns, pitch, texel_size=size, name=mount.link)
    electronics = dataclasses.replace(parameters.electronics, rate_hz=rate)
    return dataclasses.replace(parameters, array=array, electronics=electronics, tables={})


def expand_fingers(angles: Mapping[str, float]) -> dict[str, float]:
    """Replace each joint `FJ...` by the joints of the four fingers."""
    return {
        name: angle
        for joint, angle in angles.items()
        for name in ([f"{finger[0].upper()}{joint}" for finger in FINGERS] if joint.startswith("F") else [joint])
    }


def smooth_step(now: float, start: float, end: float) -> float:
    """Rise from 0 at `start` to 1 at `end` with zero slope at both."""
    share = min(max((now - start) / (end - start), 0.0), 1.0)
    return share * share * (3 - 2 * share)


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Result of one run.

    Attributes:
        times: Time of each frame, shape (frames,) [s].
        forces: Force on each array and its margin, shape (frames, arrays) [N].
        moments: The moments to draw, as `shadow_hand_picture.Moment`.
        seconds: Wall time of physics and sensors [s].
    """

    times: npt.NDArray[np.float64]
    forces: npt.NDArray[np.float64]
    moments: list[Moment]
    seconds: float


def record(hand: Hand, path: Path, *, note: str) -> Run:
    """Run the hand and write every frame of every array to an MCAP file.

    Args:
        hand: The scene at its start.
        path: The file to write; it must not exist.
        note: Text to keep in the file.
    """
    from shadow_hand_picture import MOMENTS, Camera, capture_moment

    from validation.recordings.mcap_writer import Clocks, RecordingWriter
    from validation.recordings.recording import Setup

    camera, begun, setup = Camera(hand), time.time_ns(), Setup(note=note, source="simulation")
    times, forces, seconds = [], [], 0.0
    moments: list[Moment] = []
    with RecordingWriter(path, arrays=describe_arrays(hand), setup=setup, start=begun) as file:
        resumed = time.perf_counter()
        for now in hand.run():
            seconds += time.perf_counter() - resumed
            for index, sensor in enumerate(hand.sensors.values()):
                frame = sensor.frame()
                file.add_simulated_frame(index, Clocks(begun + round(1e9 * now)), frame)
            times.append(now)
            forces.append([sensor.carried() for sensor in hand.sensors.values()])
            if len(moments) < len(MOMENTS) and now >= MOMENTS[len(moments)][1]:
                moments.append(capture_moment(hand, MOMENTS[len(moments)][0], now, camera))
            resumed = time.perf_counter()
    camera.close()
    return Run(times=np.array(times), forces=np.array(forces), moments=moments, seconds=seconds)


def describe_arrays(hand: Hand) -> list[RecordedArray]:
    """Describe the arrays for the head of the recording."""
    from validation.recordings.recording import make_array

    described = []
    for mount in MOUNTS:
        parameters = hand.sensors[mount.link].parameters
        array = make_array(
            mount.rows,
            mount.columns,
            np.empty((0, parameters.array.count), dtype=np.int32),
            pitch=parameters.array.pitch,
            full_scale=parameters.electronics.output_max,
            name=mount.link,
        )
        described.append(dataclasses.replace(array, centre=mount.position))
    return described


def main() -> None:
    """Run the example."""
    from shadow_hand_picture import draw

    from validation.output_folder import new_folder

    parser = argparse.ArgumentParser(description="A Shadow hand with nine tactile arrays grasps and turns over.")
    parser.add_argument("--out", type=Path, default=Path("shadow-hand"), help="folder for the recording and picture")
    parser.add_argument("--method", default="default", choices=["default", *fastmodel.METHODS], help="contact method")
    options = parser.parse_args()

    parameters = fastmodel.load("wts-0614-34")
    # Run a tenth of a second first: numba compiles the contact solver then, which would spoil the measured time.
    for _ in Hand(parameters, method=options.method).run(0.1):
        pass
    hand = Hand(parameters, method=options.method)
    with new_folder(options.out) as folder:
        run = record(hand, folder / "hand.mcap", note=f"shadow_hand.py --method {options.method}")
        draw(hand, run, folder / "hand.png")

    print(f"{sum(mount.rows * mount.columns for mount in MOUNTS)} texels, {len(run.times)} frames")
    for mount, force in zip(MOUNTS, run.forces.max(axis=0), strict=True):
        print(f"largest force on {mount.link}: {force:.1f} N")
    print(f"{SECONDS:g} s simulated in {run.seconds:.1f} s: {SECONDS / run.seconds:.1f} times real time")
    if run.moments[0].picture is None:
        print("the scene is not rendered: MuJoCo found no OpenGL (apt install libegl1)")
    print(f"wrote hand.mcap and hand.png to {options.out}")


if __name__ == "__main__":
    main()
