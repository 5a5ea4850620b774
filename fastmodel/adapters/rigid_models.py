"""The rigid boxes that represent an array in a simulator, as an SDF model (Gazebo) or a URDF model (ROS and others).

The model is one link at the origin of the array's frame.  Its boxes are those that MuJoCo gets for the same contact
method: one plate per flat panel of the array, or one box per texel.  Each box is a collision shape and a visual shape.
Point spread, filter and electronics are not part of such a model: `fastmodel` computes them from the forces on the
boxes.

Both formats give orientations as roll, pitch and yaw about fixed axes [rad], R = Rz(yaw) Ry(pitch) Rx(roll)
(http://sdformat.org/tutorials?tut=specify_pose, https://wiki.ros.org/urdf/XML).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fastmodel.attachment import attach
from fastmodel.errors import FastModelError
from fastmodel.parameters import Parameters
from meshes.array_types import FloatArray

#: Version of the SDF format that is written.
SDF_VERSION = "1.9"
#: Size below which a number counts as zero, over the largest number of the same array [-]; above rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBox:
    """A rigid box of an array.

    Attributes:
        name: Name of the box, unique in the array: `plate`, `plate0`, `texel0` and so on.
        position: Centre of the box in the array's frame, shape (3,) [m].
        orientation: Orientation of the box in the array's frame.
        size: Edge lengths along the axes of the box, shape (3,) [m].
        colour: Red, green, blue and opacity, shape (4,) [-].
    """

    name: str
    position: FloatArray
    orientation: Rotation
    size: FloatArray
    colour: FloatArray


def list_boxes(parameters: Parameters, *, method: str = "default") -> tuple[RigidBox, ...]:
    """List the rigid boxes that a contact method uses for an array.

    Args:
        parameters: Parameters of the sensor.
        method: Name of the contact method.

    Raises:
        FastModelError: If the contact method needs data that the parameters lack, or uses other shapes than boxes.
    """
    spec = mujoco.MjSpec()
    attach(spec, "world", parameters, name="array", contact=method)
    model = spec.compile()
    if (model.geom_type != mujoco.mjtGeom.mjGEOM_BOX).any():
        raise FastModelError(
            "a curved cover is a mesh in MuJoCo, which a model of boxes cannot hold; export it for MuJoCo, as mjcf"
        )
    return tuple(
        RigidBox(
            name=model.geom(index).name.partition("/")[2],
            position=model.geom_pos[index].copy(),
            orientation=Rotation.from_quat(model.geom_quat[index], scalar_first=True),
            size=2 * model.geom_size[index],
            colour=np.round(model.geom_rgba[index].astype(np.float64), 6),
        )
        for index in range(model.ngeom)
    )


def write_sdf(boxes: Sequence[RigidBox], *, name: str, rate_hz: float, mass: float | None = None) -> str:
    """Write an array as an SDF model: a link with the boxes, and a contact sensor on each of them.

    Args:
        boxes: The boxes of the array.
        name: Name of the model, and first part of the topics of the contact sensors.
        rate_hz: Number of frames per second of the sensor [Hz].
        mass: Mass of the array [kg]; without it the model is static.
    """
    root = ET.Element("sdf", version=SDF_VERSION)
    model = ET.SubElement(root, "model", name=name)
    _add_texts(model, static="true" if mass is None else "false")
    link = ET.SubElement(model, "link", name="array")
    if mass is not None:
        centre, inertia = compute_inertia(boxes, mass)
        inertial = ET.SubElement(link, "inertial")
        _add_texts(inertial, pose=_format((*centre, 0, 0, 0)), mass=_format([mass]))
        _add_texts(ET.SubElement(inertial, "inertia"), **_list_entries(inertia))
    for box in boxes:
        for kind in ("collision", "visual"):
            shape = ET.SubElement(link, kind, name=f"{box.name}_{kind}")
            _add_texts(shape, pose=_format((*box.position, *compute_angles(box))))
            _add_texts(ET.SubElement(ET.SubElement(shape, "geometry"), "box"), size=_format(box.size))
        _add_texts(ET.SubElement(shape, "material"), ambient=_format(box.colour), diffuse=_format(box.colour))
        sensor = ET.SubElement(link, "sensor", name=f"{box.name}_contact", type="contact")
        _add_texts(sensor, update_rate=_format([rate_hz]))
        contact = ET.SubElement(sensor, "contact")
        _add_texts(contact, collision=f"{box.name}_collision", topic=f"{name}/{box.name}")
    return _to_text(root)


def write_urdf(boxes: Sequence[RigidBox], *, name: str, mass: float | None = None) -> str:
    """Write an array as a URDF model: one link with the boxes.

    Args:
        boxes: The boxes of the array.
        name: Name of the model and of its link.
        mass: Mass of the array [kg].  Without it the link has no inertia and must be attached to a link with inertia.
    """
    root = ET.Element("robot", name=name)
    link = ET.SubElement(root, "link", name=name)
    if mass is not None:
        centre, inertia = compute_inertia(boxes, mass)
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=_format(centre), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=_format([mass]))
        ET.SubElement(inertial, "inertia", _list_entries(inertia))
    colours: dict[str, str] = {}
    for box in boxes:
        for kind in ("visual", "collision"):
            shape = ET.SubElement(link, kind, name=f"{box.name}_{kind}")
            ET.SubElement(shape, "origin", xyz=_format(box.position), rpy=_format(compute_angles(box)))
            ET.SubElement(ET.SubElement(shape, "geometry"), "box", size=_format(box.size))
            if kind == "visual":
                colour = _format(box.colour)
                is_new = colour not in colours
                material = ET.SubElement(shape, "material", name=colours.setdefault(colour, f"colour{len(colours)}"))
                if is_new:
                    ET.SubElement(material, "color", rgba=colour)
    return _to_text(root)


def compute_angles(box: RigidBox) -> FloatArray:
    """Compute roll, pitch and yaw of a box about the fixed axes x, y, z, shape (3,) [rad]."""
    with warnings.catch_warnings():
        # At a pitch of 90 degrees roll and yaw are not unique. scipy then chooses a yaw of 0 and gives a warning.
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        return np.asarray(box.orientation.as_euler("xyz"))


def compute_inertia(boxes: Sequence[RigidBox], mass: float) -> tuple[FloatArray, FloatArray]:
    """Compute centre of mass and inertia of boxes of one density.

    The inertia of a box about its own axes is m/12 (b^2 + c^2), and cyclic permutations.  The inertias are added by the
    parallel-axis theorem.

    Args:
        boxes: The boxes.
        mass: Mass of all boxes together [kg].

    Returns:
        Centre of mass in the array's frame, shape (3,) [m], and inertia about it along the axes of the array's frame,
        shape (3, 3) [kg m2].
    """
    volumes = np.array([box.size.prod() for box in boxes])
    masses = mass * volumes / volumes.sum()
    centre = masses @ np.array([box.position for box in boxes]) / mass
    inertia = np.zeros((3, 3))
    for box, part in zip(boxes, masses, strict=True):
        squares, turn, arm = box.size**2, box.orientation.as_matrix(), box.position - centre
        own = part / 12 * np.diag(squares.sum() - squares)
        inertia += turn @ own @ turn.T + part * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return _drop_rounding(centre), _drop_rounding(inertia)


def _list_entries(inertia: FloatArray) -> dict[str, str]:
    """Return the six independent entries of an inertia as texts, by name."""
    return {f"i{'xyz'[i]}{'xyz'[j]}": _format([inertia[i, j]]) for i in range(3) for j in range(i, 3)}


def _drop_rounding(values: FloatArray) -> FloatArray:
    """Replace numbers by zero that are zero up to rounding, compared with the largest number of the array."""
    return np.where(np.abs(values) < _ROUNDING * np.abs(values).max(initial=0.0), 0.0, values)


def _add_texts(parent: ET.Element, **texts: str) -> None:
    """Add to an XML element one child for each keyword: the keyword is the tag, and its value the text of the child."""
    for tag, text in texts.items():
        ET.SubElement(parent, tag).text = text


def _format(values: Sequence[float] | FloatArray) -> str:
    """Format numbers, separated by blanks; 0.0 is added to write a negative zero as 0."""
    return " ".join(f"{value + 0.0:.12g}" for value in _drop_rounding(np.asarray(values, dtype=np.float64)).tolist())


def _to_text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'
