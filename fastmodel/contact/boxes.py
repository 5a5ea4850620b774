"""Contact method with one rigid box geom per texel, as in the 2015 report.

The forces on all boxes add up to the weight, but MuJoCo divides the force of a flat face among the boxes by the *number
of contact points* per box instead of by area.  This is the known error of the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.contact.force_kernels import imitate_contacts, press_boxes, read_contacts
from fastmodel.contact.geoms import check_box, describe_box, find_geoms
from fastmodel.contact.interface import Reading
from fastmodel.pose import Pose, make_quaternions, multiply, rotate
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.signal.point_spread import find_tangents
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: Colour of masked texels: red, green, blue, opacity [-].
_MASKED_COLOUR = (0.5, 0.5, 0.5, 0.4)


@dataclass(frozen=True, kw_only=True)
class BoxTexels:
    """Contact method with one rigid box per texel, whose outer face is the texel.

    The boxes are as wide as the texel pitch, so that no gaps remain between the boxes.  They have no mass.  Masked
    texels have boxes too, because the cover carries load there although the sensor does not measure this load.

    Attributes:
        height: Height of a box, inwards from its outer face [m].
        contact_bit: Index of the collision bit of the boxes, 0..30.  The boxes collide with every geom with a non-zero
            contype, except geoms of other arrays with the same collision bit [-].
    """

    height: float = 2e-3
    contact_bit: int = 30

    costly: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive or the bit not 0..30.
        """
        check_box(self.height, self.contact_bit)

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Pose, name: str) -> None:
        """Add one box geom per texel to a body of the spec; see `TexelContact.attach`."""
        axis_x, axis_y = find_tangents(array)
        turns = multiply(pose.quaternion, make_quaternions(np.stack([axis_x, axis_y, array.normals], axis=-1)))
        middles = array.centres - 0.5 * self.height * array.normals
        places = pose.position + rotate(pose.quaternion, middles)
        half = (array.pitch[0] / 2, array.pitch[1] / 2, self.height / 2)
        box = describe_box(half, self.contact_bit)
        for index, active in enumerate(array.active):
            geom = body.add_geom(name=geom_name(name, index), pos=places[index], quat=turns[index], **box)
            if not active:
                geom.rgba = _MASKED_COLOUR

    def bind(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,  # noqa: ARG002
    ) -> BoxReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`.  The cover data in `cells` are not used.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        return BoxReader(model, find_boxes(model, array, name))


class BoxReader:
    """Reader that sums MuJoCo's contact forces on each box; a contact belongs to a box by its geom id."""

    def __init__(self, model: mujoco.MjModel, geoms: IntArray) -> None:
        """Tabulate the texel of each geom.

        Args:
            model: The compiled model.
            geoms: Geom id of each texel, shape (n,) [-].
        """
        self._count = len(geoms)
        # The last entry is for geom id -1, which MuJoCo writes for contacts of flexes, so that it belongs to no texel.
        self._texel_of = np.full(model.ngeom + 1, -1)
        self._texel_of[geoms] = np.arange(len(geoms))
        self._pyramidal = bool(model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL)
        self._press_boxes = compile_kernel(press_boxes)

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile the kernel; see `ContactReader.compile_kernels`."""
        for contacts in imitate_contacts(data, pyramidal=self._pyramidal):
            self._press_boxes(contacts, data.geom_xmat, self._texel_of, self._count)

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of the last simulation step; see `ContactReader.read`."""
        return self.at_rest(self.forces(data))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, shape (n,) [N]; see `ContactReader.at_rest`."""
        return Reading(contact_forces, None, float(contact_forces.sum()))

    def forces(self, data: mujoco.MjData) -> FloatArray:
        """Sum the contact forces against each box's outward normal, shape (n,) [N].

        Each contact force is projected on the box's normal, because the contact normal differs from the box's normal
        where an indenter touches the edge of a box.  An indenter that hooks on the side of a box can pull it upwards by
        friction.  The force on such a box is set to zero, and the other forces are scaled to keep the total.
        """
        _, total = self._press(data)
        return _remove_lift(total) if total.min() < 0 else total

    def _press(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Compute the forces against the boxes' outward normals, for k contacts and n texels; see `press_boxes`."""
        contacts = read_contacts(data, pyramidal=self._pyramidal)
        pressed, total = self._press_boxes(contacts, data.geom_xmat, self._texel_of, self._count)
        return pressed, total


def _remove_lift(total: FloatArray) -> FloatArray:
    """Set negative texel forces to zero, and scale the others to keep the sum, or to zero if the sum is negative.

    Args:
        total: Force on each texel, shape (n,) [N].
    """
    pressed = np.maximum(total, 0.0)
    positive = pressed.sum()
    return pressed * (max(float(total.sum()), 0.0) / positive) if positive > 0 else pressed


def find_boxes(model: mujoco.MjModel, array: TexelArray, name: str) -> IntArray:
    """Find the geom id of the box of each of n texels, shape (n,) [-].

    Args:
        model: The compiled model.
        array: The array that was attached.
        name: Name of the sensor, as given to `attach`.

    Raises:
        LifeCycleError: If a box is not in the model.
    """
    return find_geoms(model, [geom_name(name, index) for index in range(array.count)], name)


def geom_name(name: str, index: int) -> str:
    """Return the name of a texel's geom, made of the sensor's name and the texel's index."""
    return f"{name}/texel{index}"
