"""Scenes for `grippers.py`: grippers with two arrays, a post, and something to grasp; and bodies free on one array.

The models of the Panda, Rethink and Fetch grippers come from the packages robosuite and gymnasium-robotics.  Nothing of
robosuite is imported but its files.  A turned object floats, without a post, until it is grasped.
"""

from __future__ import annotations

import importlib.util
import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import Parameters
from fastmodel.contact.interface import TexelContact
from fem_reference import point_spread
from meshes import TexelArray
from tests.support.rubber import make_cover
from validation.derivation.kernel import cover_cells

FloatArray = npt.NDArray[np.float64]

TIMESTEP = 2e-3
ROWS, COLUMNS = 12, 10
#: Height of the gripper's frame above the floor at the start [m].
HEIGHT = 0.3
#: Half the length of objects between the fingers, half their size across, height of their centre [m]; their mass [kg].
HALF, ACROSS, CENTRE, MASS = 15e-3, 10e-3, 25e-3, 0.15
#: Largest force with which a drive opens [N].
OPENING = 12.0
#: Free distance between each finger and the object at the start [m].
CLEARANCE = 4e-3


@dataclass(frozen=True, kw_only=True)
class Gripper:
    """A gripper with two fingers, the second of which is the first turned by half a turn.

    Attributes:
        package: Package that the model comes from.
        file: File of the model in the package.
        body: Root body of the gripper in this file.
        turn: Orientation in which the fingers point down, a quaternion.
        pitch: Pitch of the texels that fits the pads [m].
        slipping: Force of each drive under which objects slip [N].  Friction holds the Panda's fingers up to 1 N.
        sides: What takes the place of `{}` in the names of each finger.
        names: Names of a finger's body, joint and actuator, and of the geom that the array takes the place of.
        opens: Sign of the motion of each joint that opens the gripper [-].
        position: Centre of the first array in the frame of its body [m].
        axes: Axes x, y, z of the first array in the frame of its body, as columns.
        points: Axis of the body along which a finger points.
    """

    package: str
    file: str
    body: str
    turn: tuple[float, float, float, float]
    pitch: float
    slipping: float
    sides: tuple[str, str]
    names: tuple[str, str, str, str]
    opens: tuple[float, float]
    position: tuple[float, float, float]
    axes: tuple[tuple[float, float, float], ...]
    points: int

    def list_fingers(self) -> list[Finger]:
        """Return the two fingers."""
        half_turn = -np.ones(3)
        half_turn[self.points] = 1
        return [
            Finger(
                *(name.format(side) for name in self.names),
                opens,
                tuple(turn * self.position),
                turn[:, None] * self.axes,
            )
            for side, opens, turn in zip(self.sides, self.opens, (np.ones(3), half_turn), strict=True)
        ]


class Finger(NamedTuple):
    """A finger of a gripper, as `Gripper` describes it."""

    body: str
    joint: str
    actuator: str
    replaces: str
    opens: float
    position: tuple[float, ...]
    axes: FloatArray


#: Arrays on faces whose normal is -y or +y, rows along z (Panda) or x (Fetch).
PANDA = Gripper(
    package="robosuite",
    file="models/assets/grippers/panda_gripper.xml",
    body="right_gripper",
    turn=(0.0, 1.0, 0.0, 0.0),
    pitch=1.7e-3,
    slipping=-0.5,
    sides=("1", "2"),
    names=("finger_joint{}_tip", "finger_joint{}", "gripper_finger_joint{}", "finger{}_pad_collision"),
    opens=(1.0, -1.0),
    position=(0.0, -10.5e-3, -15e-3),
    axes=((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    points=2,
)
FETCH = Gripper(
    package="gymnasium_robotics",
    file="envs/assets/fetch/pick_and_place.xml",
    body="robot0:gripper_link",
    turn=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0),
    pitch=2.2e-3,
    slipping=0.65,
    sides=("robot0:r_gripper_finger", "robot0:l_gripper_finger"),
    names=("{}_link", "{}_joint", "{}_joint", "{}_link"),
    opens=(1.0, 1.0),
    position=(0.02, -15e-3, 0.0),
    axes=((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    points=0,
)
RETHINK = replace(
    PANDA,
    file="models/assets/grippers/rethink_gripper.xml",
    body="gripper_base",
    pitch=1.5e-3,
    sides=("l", "r"),
    names=("{}_finger_tip", "{}_finger_joint", "gripper_{}_finger_joint", "{}_fingerpad_g0"),
    position=(0.0, -10.5e-3, -17e-3),
)
GRIPPERS = {"panda": PANDA, "fetch": FETCH, "rethink": RETHINK}
OBJECTS = ("box", "sphere", "cylinder", "capsule", "mug", "flex")


def find_package(name: str) -> Path | None:
    """Folder of an installed package, without importing it."""
    found = importlib.util.find_spec(name)
    return Path(found.submodule_search_locations[0]) if found and found.submodule_search_locations else None


def parameters(pitch: float) -> Parameters:
    """An array of 120 texels under 2 mm of rubber, without noise and filter, so that frames show the contact."""
    array = TexelArray.grid(ROWS, COLUMNS, (pitch, pitch), name="pad")
    electronics = fastmodel.Electronics(rate_hz=1 / TIMESTEP, sensitivity=2665.7, offset=0.0, output_max=4095)
    cover = make_cover(model="linear-elastic")
    cells, spread = cover_cells(cover, array, point_spread(cover)), fastmodel.Gaussian.from_sigma(0.7)
    return Parameters(array=array, spread=spread, electronics=electronics, surface=cells)


class Scene:
    """A gripper above a table with an object, and its two sensors."""

    def __init__(
        self, gripper: Gripper, thing: str, turn: Rotation | None = None, method: str | TexelContact | None = None
    ) -> None:
        """Build and bind the scene; the object may be turned; see `mount` about the method."""
        self.gripper, self._fingers = gripper, gripper.list_fingers()
        alone = mujoco.MjSpec()
        mount(alone, gripper)
        middle = self._find_middle(mujoco.MjData(alone.compile()))
        spec = start_spec(thing, middle)
        self.sensors = mount(spec, gripper, method)
        add_object(spec, thing, middle, turn)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for sensor in self.sensors:
                sensor.bind(self.model)
        self.covers = self.sensors[::2] if method else []
        if method:  # The plates of the covers, which their readers know already, touch nothing from here on.
            self.sensors = self.sensors[1::2]
            for cover in self.covers:
                plate = self.model.geom(f"{cover.name}/plate")
                plate.contype = plate.conaffinity = 0
        self.warned = sorted({str(each.message) for each in caught})
        self._joints = [self.data.joint(finger.joint) for finger in self._fingers]
        self._actuators = [self.model.actuator(finger.actuator) for finger in self._fingers]
        self._open(middle, find_half(thing, turn) + CLEARANCE)

    def _find_middle(self, data: mujoco.MjData) -> FloatArray:
        """Find the middle between the two arrays."""
        mujoco.mj_forward(data.model, data)
        return np.mean([data.geom(f"{finger.joint}/plate").xpos for finger in self._fingers], axis=0)

    def _open(self, middle: FloatArray, distance: float) -> None:
        """Open the fingers to a distance from the middle [m]."""
        mujoco.mj_forward(self.model, self.data)
        for finger, joint in zip(self._fingers, self._joints, strict=True):
            plate = self.data.geom(f"{finger.joint}/plate")
            inside = plate.xpos + plate.xmat.reshape(3, 3)[:, 2] * self.model.geom(f"{finger.joint}/plate").size[2]
            joint.qpos[0] += finger.opens * (distance - abs(inside - middle)[1])
        mujoco.mj_forward(self.model, self.data)
        self._start = [float(joint.qpos[0]) for joint in self._joints]
        self.data.ctrl[:] = 0
        self.drive(0.0, 0.0, 0.0)

    def drive(self, travel: float, force: float, lift: float) -> None:
        """Command the fingers and the carriage.

        The position actuators of the fingers act as drives with a limit of force.

        Args:
            travel: Distance by which each finger shall close [m].
            force: Largest force with which a drive closes; negative if it opens all the same [N].
            lift: Height of the carriage above the start [m].
        """
        drives = zip(self._fingers, self._joints, self._start, self._actuators, strict=True)
        for finger, joint, start, actuator in drives:
            stiffness, position = float(actuator.gainprm[0]), float(joint.qpos[0])
            missing = finger.opens * (position - start) + travel
            closing = min(max(missing, -OPENING / stiffness), force / stiffness)
            self.data.ctrl[actuator.id] = position - finger.opens * closing
        self.data.ctrl[self.model.actuator("lift").id] = lift

    def let_go(self) -> None:
        """Let gravity act on a turned object."""
        thing = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, "thing")
        if thing >= 0:
            self.model.body_gravcomp[thing] = 0.0

    def step(self) -> None:
        """One step of the physics and of the sensors."""
        mujoco.mj_step(self.model, self.data)
        for sensor in self.sensors:
            sensor.step(self.data)


def start_spec(thing: str, middle: FloatArray) -> mujoco.MjSpec:
    """Start a spec; a soft cube is part of it, because a flex can be described as text only.

    The soft cube of 30 mm needs the integrator `discrete`, which alone integrates its elasticity implicitly.
    """
    spec = mujoco.MjSpec()
    if thing == "flex":
        edge, count = 2 * HALF, 5
        spacing = " ".join([str(edge / (count - 1))] * 3)
        spec = mujoco.MjSpec.from_string(f"""<mujoco>
          <option integrator="discrete"/>
          <worldbody>
            <flexcomp name="thing" type="grid" dim="3" count="{count} {count} {count}" spacing="{spacing}"
              pos="{middle[0]} {middle[1]} {middle[2] + 1e-3}" mass="{MASS}" radius="5e-4" dof="trilinear">
              <contact selfcollide="none" condim="4" friction="1 0.01 0.0001"/>
              <elasticity young="1e5" poisson="0.3" damping="2e-3"/>
            </flexcomp>
          </worldbody>
        </mujoco>""")
    fastmodel.recommend_options(spec)
    spec.option.timestep = TIMESTEP
    return spec


def mount(spec: mujoco.MjSpec, gripper: Gripper, method: str | TexelContact | None = None) -> list[fastmodel.Sensor]:
    """Hang a gripper, fingers down, on a carriage that moves up and down, with an array on each finger.

    With a contact method, each finger has a second sensor with this method.
    """
    first = len(spec.bodies)
    carriage = spec.worldbody.add_body(name="carriage", pos=[0, 0, HEIGHT])
    carriage.add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], armature=5.0)
    carriage.mass, carriage.explicitinertial, carriage.inertia = 1.0, True, [1e-2] * 3
    lift = spec.add_actuator(name="lift", target="lift", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    lift.set_to_position(kp=3e4, kv=2e3)
    package = find_package(gripper.package)
    if package is None:
        raise SystemExit(f"{gripper.package} is not installed")
    source = mujoco.MjSpec.from_file(str(package / gripper.file))
    carriage.add_frame(quat=gripper.turn).attach_body(source.body(gripper.body), "", "")
    for body in spec.bodies[first:]:
        body.gravcomp = 1.0
    settings, sensors = parameters(gripper.pitch), []
    for finger in gripper.list_fingers():
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, finger.axes.ravel())
        place = {"position": finger.position, "quaternion": quaternion, "replaces": finger.replaces}
        sensors.append(fastmodel.attach(spec, finger.body, settings, name=finger.joint, contact="cover", **place))
        if method:
            name = f"{finger.joint}_compared"
            sensors.append(fastmodel.attach(spec, finger.body, settings, name=name, contact=method, every=1, **place))
    return sensors


#: Half length between the fingers of objects that differ from `HALF` [m].
HALF_OF = {"mug": 20e-3}
#: Half the height of each object [m].
HALF_HEIGHTS = {"box": CENTRE, "sphere": HALF, "cylinder": CENTRE, "capsule": 25e-3, "mug": CENTRE, "flex": HALF}


def find_half(thing: str, turn: Rotation | None) -> float:
    """Find the half extent of an object between the fingers [m]."""
    half, ball = {
        "box": ([ACROSS, HALF, CENTRE], 0.0),
        "sphere": ([0, 0, 0], HALF),
        "cylinder": ([0, 0, CENTRE], HALF),
        "capsule": ([0, 0, 10e-3], HALF),
        "mug": ([0, 0, CENTRE], HALF_OF["mug"]),
        "flex": ([0, HALF, 0], 0.0),
    }[thing]
    across = (turn or Rotation.identity()).as_matrix()[1]
    flat = math.hypot(*across[:2]) if thing in {"cylinder", "mug"} else 1.0
    return float(np.abs(across) @ half + flat * ball)


def add_object(spec: mujoco.MjSpec, thing: str, middle: FloatArray, turn: Rotation | None = None) -> None:
    """Add an object between the arrays, and below it a post, narrow enough for fingers beside it."""
    kinds = mujoco.mjtGeom
    if turn is None:
        below = [*middle[:2], middle[2] - HALF_HEIGHTS[thing] - 0.01]
        spec.worldbody.add_geom(name="post", type=kinds.mjGEOM_BOX, size=[8e-3, 8e-3, 10e-3], pos=below)
    if thing == "flex":  # part of the text that the scene starts from, see `start_spec`
        return
    body = spec.worldbody.add_body(name="thing", pos=middle)
    if turn is not None:
        body.quat, body.gravcomp = turn.as_quat(scalar_first=True), 1.0
    body.add_freejoint(name="thing")
    common = {"condim": 4, "friction": [1.0, 0.01, 1e-4], "rgba": [0.8, 0.5, 0.2, 1]}
    if thing == "mug":
        add_mug(spec, body, radius=HALF_OF[thing], common=common)
        return
    kind, size = {
        "box": (kinds.mjGEOM_BOX, [ACROSS, HALF, CENTRE]),
        "sphere": (kinds.mjGEOM_SPHERE, [HALF, 0, 0]),
        "cylinder": (kinds.mjGEOM_CYLINDER, [HALF, CENTRE, 0]),
        "capsule": (kinds.mjGEOM_CAPSULE, [HALF, 10e-3, 0]),
    }[thing]
    body.add_geom(type=kind, size=size, mass=MASS, **common)


def add_mug(spec: mujoco.MjSpec, body: mujoco.MjsBody, *, radius: float, common: dict[str, object]) -> None:
    """Add the wall, bottom and handle of a mug, as meshes that are convex each and a concave body together."""
    sectors, wall, half = 24, 3e-3, CENTRE
    parts = []
    for k in range(sectors):
        angles = 2 * np.pi * (k + np.array([-0.5, 0.5])) / sectors
        outer, inner = radius, radius - wall
        ring = [(r * np.cos(a), r * np.sin(a)) for r in (inner, outer) for a in angles]
        parts.append(np.array([(x, y, z) for x, y in ring for z in (-half, half)]))
    for number, vertices in enumerate(parts):
        spec.add_mesh(name=f"wall{number}", uservert=vertices.ravel())
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"wall{number}", mass=MASS / sectors, **common)
    bottom = [radius - wall, 1.5e-3, 0]
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=bottom, pos=[0, 0, 1.5e-3 - half], mass=0.02, **common)
    handle = (([6e-3, 3e-3, 2e-3], 6e-3, -12e-3), ([6e-3, 3e-3, 2e-3], 6e-3, 12e-3), ([2e-3, 3e-3, 14e-3], 11e-3, 0))
    for size, out, z in handle:
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=[radius + out, 0, z], mass=5e-3, **common)


#: Bodies that press on one array by a force with a wobbling torque: geoms as type, size [mm] and position [mm].
FREE = {
    "ball": [("sphere", (9, 0, 0), (0, 0, 0))],
    "ellipsoid": [("ellipsoid", (12, 7, 5), (0, 0, 0))],
    "box": [("box", (8, 6, 5), (0, 0, 0))],
    "blade": [("box", (9, 1, 6), (0, 0, 0))],
    "bar": [("box", (20, 4, 4), (0, 0, 0))],
    "cylinder": [("cylinder", (6, 8, 0), (0, 0, 0))],
    "capsule": [("capsule", (4, 8, 0), (0, 0, 0))],
    "cross": [("box", (10, 3, 3), (0, 0, 0)), ("box", (3, 10, 3), (0, 0, 0))],
}


class FreeScene:
    """A body free to move on one array, in a random pose, under a force and a torque that wobbles."""

    def __init__(self, thing: str, random: np.random.Generator) -> None:
        """Build and bind the scene."""
        spec = mujoco.MjSpec()
        fastmodel.recommend_options(spec)
        spec.option.timestep = TIMESTEP
        base = spec.worldbody.add_body(name="base")
        base.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.03, 0.03, 5e-3], pos=[0, 0, -0.02])
        self.sensors = [fastmodel.attach(spec, "base", parameters(3.4e-3), name="pad", contact="cover")]
        height = 25e-3
        body = spec.worldbody.add_body(name="thing", pos=[*random.uniform(-8e-3, 8e-3, 2), height])
        body.add_freejoint(name="thing")
        body.quat = Rotation.random(rng=random).as_quat(scalar_first=True)
        for kind, size, place in FREE[thing]:
            geom = body.add_geom(type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), mass=0.05)
            geom.size, geom.pos = 1e-3 * np.array(size), 1e-3 * np.array(place)
            geom.condim, geom.friction[:] = 4, [0.8, 0.01, 1e-4]
        self.model = spec.compile()
        self.model.dof_damping[:3], self.model.dof_damping[3:] = 1.0, 2e-4
        self.data = mujoco.MjData(self.model)
        self.warned: list[str] = []
        for sensor in self.sensors:
            sensor.bind(self.model)
        self._load, self._torque = random.uniform(1, 8), random.normal(0, 1, (2, 3))
        self._rates = random.uniform(0.5, 4, 3)

    def step(self) -> None:
        """One step of the physics and of the sensor."""
        phase = 2 * np.pi * self._rates * self.data.time
        thing, torque = self.data.body("thing"), self._torque[0] * np.sin(phase) + self._torque[1] * np.cos(phase)
        thing.xfrc_applied[:] = [0, 0, -self._load * min(4 * self.data.time, 1.0), *(1.5e-3 * self._load * torque)]
        thing.xfrc_applied[:2] -= 40 * thing.xpos[:2]
        mujoco.mj_step(self.model, self.data)
        for sensor in self.sensors:
            sensor.step(self.data)
