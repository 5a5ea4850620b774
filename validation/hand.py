"""A Shadow hand with nine tactile arrays grasps a grip and turns over: many arrays on moving bodies, in one model.

The hand is that of the package `gymnasium-robotics`, loaded as it is.  Each array is attached to one body of it, in
that body's own frame: in every link of this hand z points to the fingertip and -y out of the palm.
"""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fastmodel import Parameters, Sensor, attach, recommend_options
from fastmodel.contact.boxes import TexelContact
from fastmodel.pose import multiply
from meshes import TexelArray
from validation.errors import MissingExtraError

#: Step of the physics [s]; whole run [s].
TIMESTEP, SECONDS = 1e-3, 4.0
#: Frames per second of nine arrays that share one line.
RATE = 100.0
#: When the fingers close, curl, and the hand turns over: from, to [s].
_CLOSE, _CURL, _TURN = (0.3, 0.9), (0.7, 1.3), (1.8, 3.0)

#: Height and width of pictures that can be rendered [pixels].
PICTURE_SIZE = (440, 520)

_PREFIX = "robot0:"
_FINGERS = ("ff", "mf", "rf", "lf")
#: Array frame in a link's: x across the hand, y to the fingertip, z out of the palm.
_PALMAR = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
#: Joint angles at the start and in the grasp [rad]; a finger's joints of all four fingers.
_OPEN = {"FJ2": 1.03, "FJ1": 0.25, "THJ4": 0.91, "THJ3": 0.21}
_GRASP = {"FJ2": 1.56, "FJ1": 0.86, "THJ4": 0.91, "THJ3": 0.18, "THJ2": 0.2, "THJ1": 0.17, "THJ0": -1.2}
#: The grip's ribs, little finger first: where they are along it, their radii, half their width [m]; its mass [kg].
RIBS = (-0.033, -0.011, 0.011, 0.033)
RADII = (0.0236, 0.025, 0.0265, 0.0236)
RIB, MASS = 0.0125, 0.2
#: Its middle in the palm's frame at the start, lying on the array [m].
_ABOVE_PALM = (0.0009, -0.0385, 0.0601)


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where an array sits on the hand.

    Attributes:
        body: Its link, without the hand's prefix; the array is called so too.
        rows: Texels along the finger.
        columns: Texels across.
        position: Middle of the cover's top in the link's frame [m].
    """

    body: str
    rows: int
    columns: int
    position: tuple[float, float, float]


#: 132 texels.  The cover lies on a link's outermost surface; the palm's array keeps clear of thumb and knuckles.
PLACES = (
    *(Place(body=f"{finger}middle", rows=4, columns=1, position=(0.0, -0.011, 0.0125)) for finger in _FINGERS),
    *(Place(body=f"{finger}proximal", rows=4, columns=2, position=(0.0, -0.012, 0.031)) for finger in _FINGERS),
    Place(body="palm", rows=14, columns=6, position=(-0.008, -0.0131, 0.050)),
)


class Hand:
    """The scene: the hand, its arrays, a grip, and their simulation.

    Args:
        parameters: A flat array's; every array here has its pitch, cover and electronics.
        method: Contact method, by name or as settings.

    Attributes:
        model: The compiled `mujoco.MjModel`.
        data: Its `mujoco.MjData`.
        sensors: The bound sensors by the name of their link, in the order of `PLACES`.

    Raises:
        MissingExtraError: If the hand is not installed.
        FastModelError: If the contact method does not go with the parameters.
    """

    def __init__(self, parameters: Parameters, *, method: str | TexelContact = "default") -> None:
        spec = _load()
        recommend_options(spec)
        spec.option.timestep = TIMESTEP
        spec.visual.global_.offheight, spec.visual.global_.offwidth = PICTURE_SIZE
        _let_turn(spec)
        _add_grip(spec)
        self.sensors: Mapping[str, Sensor] = {
            place.body: attach(
                spec,
                _PREFIX + place.body,
                _of_size(parameters, place),
                name=place.body,
                position=place.position,
                quaternion=_PALMAR,
                contact=method,
            )
            for place in PLACES
        }
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        for sensor in self.sensors.values():
            sensor.bind(self.model)
        start, grasp = _every_finger(_OPEN), _every_finger(_GRASP)
        self._actuators = [self.model.actuator(f"{_PREFIX}A_{joint}").id for joint in grasp]
        self._closing = np.array([joint.endswith("J2") for joint in grasp])
        self._open = np.array([start.get(joint, 0.0) for joint in grasp])
        self._grasp = np.array(list(grasp.values()))
        self._start()

    def step(self) -> bool:
        """One physics step; whether new frames are there, of all arrays alike."""
        self._control()
        mujoco.mj_step(self.model, self.data)
        due = [sensor.step(self.data) for sensor in self.sensors.values()]
        return all(due)

    def run(self, seconds: float = SECONDS) -> Iterator[float]:
        """Simulate; the time of each new frame [s].

        Args:
            seconds: How long [s].
        """
        palm = self.sensors["palm"]
        while self.data.time < seconds:
            if self.step():
                yield palm.frame().time

    def on_open_hand(self, place: Place) -> tuple[float, float]:
        """Where an array's middle lies on the open hand seen from the palm's side, from the palm's origin [m]."""
        body, palm = self.model.body(_PREFIX + place.body).id, self.model.body(_PREFIX + "palm").id
        at = np.array(place.position)
        while body != palm:
            at = at + self.model.body_pos[body]
            body = self.model.body_parentid[body]
        return float(at[0]), float(at[2])

    def _start(self) -> None:
        """Fingers half open, the grip on the palm."""
        for joint, angle in _every_finger(_OPEN).items():
            self.data.joint(_PREFIX + joint).qpos[0] = angle
        mujoco.mj_forward(self.model, self.data)
        palm = self.data.body(_PREFIX + "palm")
        across = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
        place = palm.xpos + palm.xmat.reshape(3, 3) @ _ABOVE_PALM
        self.data.joint("grip").qpos[:] = [*place, *multiply(palm.xquat, across)]
        self._control()

    def _control(self) -> None:
        time = self.data.time
        close, curl = _share(time, *_CLOSE), _share(time, *_CURL)
        share = np.where(self._closing, close, curl)
        self.data.ctrl[self._actuators] = self._open + share * (self._grasp - self._open)
        self.data.ctrl[-1] = np.pi * _share(time, *_TURN)


def find_assets() -> Path:
    """Folder with the hand's description and meshes.

    Raises:
        MissingExtraError: If they are not installed.
    """
    package = importlib.util.find_spec("gymnasium_robotics")
    if package is None or not package.submodule_search_locations:
        raise MissingExtraError("hand", "gymnasium_robotics")
    return Path(package.submodule_search_locations[0]) / "envs" / "assets"


def _load() -> Any:  # noqa: ANN401 -- MjSpec
    """The hand alone, palm up, as the package has it."""
    assets = find_assets()
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


def _let_turn(spec: Any) -> None:  # noqa: ANN401 -- MjSpec
    """Turn the forearm about its axis by an actuator."""
    mount = spec.body(_PREFIX + "hand mount")
    joint = mount.add_joint(name="turn", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], armature=0.05)
    # Newer versions of MuJoCo take a polynomial of the speed.
    joint.damping = [2.0, 0.0, 0.0] if np.ndim(joint.damping) else 2.0
    actuator = spec.add_actuator(name="turn", target="turn", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(kp=100, kv=10)


def _add_grip(spec: Any) -> None:  # noqa: ANN401 -- MjSpec
    """A handle with a rounded rib for each finger, free to move."""
    body = spec.worldbody.add_body(name="grip")
    body.add_freejoint(name="grip")
    for rib, radius in zip(RIBS, RADII, strict=True):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[radius, radius, RIB],
            pos=[0.0, 0.0, rib],
            mass=MASS / len(RIBS),
            condim=4,
            rgba=[0.85, 0.45, 0.2, 1.0],
        )


def _of_size(parameters: Parameters, place: Place) -> Parameters:
    """The same cover and electronics on an array of another size."""
    array = TexelArray.grid(
        place.rows,
        place.columns,
        parameters.array.pitch,
        texel_size=parameters.array.texel_size,
        name=place.body,
    )
    electronics = dataclasses.replace(parameters.electronics, rate_hz=RATE)
    return dataclasses.replace(parameters, array=array, electronics=electronics, tables={})


def _every_finger(angles: Mapping[str, float]) -> dict[str, float]:
    """Angles by joint; those of `FJ...` for all four fingers."""
    return {
        name: angle
        for joint, angle in angles.items()
        for name in ([f"{finger[0].upper()}{joint}" for finger in _FINGERS] if joint.startswith("F") else [joint])
    }


def _share(time: float, start: float, end: float) -> float:
    """From 0 at the start to 1 at the end, smoothly."""
    share = min(max((time - start) / (end - start), 0.0), 1.0)
    return share * share * (3 - 2 * share)
