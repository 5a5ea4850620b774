"""The rigid boxes of the 2015 report: one box geom per texel.

MuJoCo carries the weight on the boxes exactly, but divides it by the *number of contact points* per box instead of by
area.  This is the known error of the method.
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
    """One rigid box per texel; its upper face is the texel, and its height points inward.

    Boxes are as wide as the pitch, so that they cover the array without gaps.  They have no mass.  Masked texels have
    boxes too: the cover carries load there, but the sensor does not measure it.

    Attributes:
        height: Height of a box [m].
        contact_bit: Collision bit of the boxes, 0..30.  Boxes touch every geom with a non-zero contype, except those
            of other arrays on the same bit [-].
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
    """Sums contact forces per box; contacts are assigned by geom id."""

    def __init__(self, model: mujoco.MjModel, geoms: IntArray) -> None:
        """Make the table from geoms to texels.

        Args:
            model: The compiled model.
            geoms: Geom id of each texel, shape (n,) [-].
        """
        self._count = len(geoms)
        # The table has one more entry, so that geom -1, which MuJoCo writes for flexes, is no texel.
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
        """Make the reading of given contact forces, shape (n,) [N]."""
        return Reading(contact_forces, None, float(contact_forces.sum()))

    def forces(self, data: mujoco.MjData) -> FloatArray:
        """Sum the contact forces against each box's outward normal, shape (n,) [N].

        The sum takes the component along the box's normal, not the length of the contact's normal force: the contact
        normal is inclined where an indenter touches the edge of a box.  An indenter that hooks on the side of a box
        can lift it by friction.  Such a box reads zero, and the others are scaled so that the total stays the same.
        """
        _, total = self._press(data)
        return _remove_lift(total) if total.min() < 0 else total

    def _press(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Forces against the boxes' normals, by contact, shape (k, 2), and by texel, shape (n,) [N]."""
        contacts = read_contacts(data, pyramidal=self._pyramidal)
        pressed, total = self._press_boxes(contacts, data.geom_xmat, self._texel_of, self._count)
        return pressed, total


def _remove_lift(total: FloatArray) -> FloatArray:
    """Set negative forces to zero and scale the others so that the sum is unchanged, or zero if negative, (n,) [N]."""
    pressed = np.maximum(total, 0.0)
    positive = pressed.sum()
    return pressed * (max(float(total.sum()), 0.0) / positive) if positive > 0 else pressed


def find_boxes(model: mujoco.MjModel, array: TexelArray, name: str) -> IntArray:
    """Geom id of each texel's box, shape (n,) [-].

    Args:
        model: The compiled model.
        array: The array that was attached.
        name: The prefix that it was attached with.

    Raises:
        LifeCycleError: If a box is not in the model.
    """
    return find_geoms(model, [geom_name(name, index) for index in range(array.count)], name)


def geom_name(name: str, index: int) -> str:
    """Name of a texel's geom: the sensor's name, then the texel's index."""
    return f"{name}/texel{index}"
