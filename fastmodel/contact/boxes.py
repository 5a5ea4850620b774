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
from fastmodel.contact.bodies import Bodies
from fastmodel.contact.force_kernels import has_pyramids, imitate_contacts, press_boxes, read_contacts
from fastmodel.contact.geoms import EVERY, check_box, describe_box, find_geoms
from fastmodel.contact.interface import Reading
from fastmodel.contact.net_force import NetForceReader
from fastmodel.pose import Mount, make_quaternions, multiply, rotate
from fastmodel.signal.point_spread import find_tangents
from fastmodel.state import State
from fastmodel.surface import Surface
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Colour of masked texels: red, green, blue, opacity [-].
_MASKED_COLOUR = (0.5, 0.5, 0.5, 0.4)


@dataclass(frozen=True, kw_only=True)
class BoxTexels:
    """Contact method with one rigid box per texel, whose outer face is the texel.

    The boxes are as wide as the texel pitch, so that no gaps remain between the boxes.  They have no mass.  Masked
    texels have boxes too, because the cover carries load there although the sensor does not measure this load.

    Attributes:
        height: Height of a box, inwards from its outer face [m].
        contype: Collision mask of the boxes, 31 bits.  With all bits, the default, the boxes meet every geom that
            collides with anything, other arrays included [-].
        conaffinity: Mask of the geoms that the boxes meet, 31 bits [-].
    """

    height: float = 2e-3
    contype: int = EVERY
    conaffinity: int = EVERY

    costly: ClassVar[bool] = False
    computes_spread: ClassVar[bool] = False
    takes_overlaps: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive or a mask not of 31 bits.
        """
        check_box(self.height, self.contype, self.conaffinity)

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Mount, name: str) -> None:
        """Add one box geom per texel to a body of the spec; see `TexelContact.attach`."""
        axis_x, axis_y = find_tangents(array)
        turns = multiply(pose.quaternion, make_quaternions(np.stack([axis_x, axis_y, array.normals], axis=-1)))
        middles = array.centres - 0.5 * self.height * array.normals
        places = pose.position + rotate(pose.quaternion, middles)
        half = (array.pitch[0] / 2, array.pitch[1] / 2, self.height / 2)
        box = describe_box(half, self.contype, self.conaffinity)
        for index, active in enumerate(array.active):
            geom = body.add_geom(name=geom_name(name, index), pos=places[index], quat=turns[index], **box)
            if not active:
                geom.rgba[:] = _MASKED_COLOUR

    def adapt(self, surface: Surface | None) -> BoxTexels:  # noqa: ARG002
        """Return the method as it is: boxes suit every cover."""
        return self

    def bind(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        surface: Surface | None = None,  # noqa: ARG002
    ) -> BoxReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`.  The cover is not used.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        return BoxReader(model, find_boxes(model, array, name), array, name)


class BoxReader:
    """Reader that sums MuJoCo's contact forces on each box; a contact belongs to a box by its geom id."""

    def __init__(self, model: mujoco.MjModel, geoms: IntArray, array: TexelArray, name: str) -> None:
        """Tabulate the texel of each geom.

        Args:
            model: The compiled model.
            geoms: Geom id of each texel, shape (n,) [-].
            array: The texels.
            name: Name of the sensor, for error messages.
        """
        self._count, self._model = len(geoms), model
        self._bodies = Bodies(model, geoms, name)
        axes = np.stack([*(each[0] for each in find_tangents(array)), array.normals[0]], axis=-1)
        middle = array.centres[0] - model.geom_size[geoms[0], 2] * array.normals[0]
        neighbours, self._press_boxes = _find_neighbours(array), compile_kernel(press_boxes)
        self._net_force = NetForceReader(model, array, geoms, axes=axes, middle=middle, neighbours=neighbours)

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile the kernel; see `ContactReader.compile_kernels`."""
        for contacts in imitate_contacts(data, pyramidal=has_pyramids(self._model)):
            self._press_boxes(contacts, data.geom_xmat, data.geom_xpos, self._net_force.parts)

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of the last simulation step; see `ContactReader.read`.

        Each contact force is projected on the box's normal, because the contact normal differs from the box's normal
        where an indenter touches the edge of a box.  Forces at the backs and free sides of boxes count in the total
        only.  An indenter that hooks on the side of a box inside the array can pull it upwards by friction.  The force
        on such a box is set to zero, and the other forces are scaled to keep their sum.

        Raises:
            LifeCycleError: If the size of the boxes has changed.
        """
        self._bodies.check_size()
        contacts = read_contacts(data, pyramidal=has_pyramids(self._model))
        forces, carried, sums = self._press_boxes(contacts, data.geom_xmat, data.geom_xpos, self._net_force.parts)
        return self._net_force.add(Reading(self._share(data, sums[0], forces), None, carried), sums)

    def get_state(self) -> State:
        """Return no arrays, because readings do not depend on earlier ones; see `ContactReader.get_state`."""
        return {}

    def set_state(self, state: State) -> None:
        """Do nothing; see `ContactReader.set_state`."""

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, shape (n,) [N]; see `ContactReader.at_rest`."""
        return self._net_force.add_at_rest(Reading(contact_forces, None, float(contact_forces.sum())))

    def _share(self, data: mujoco.MjData, pressed: FloatArray, total: FloatArray) -> FloatArray:  # noqa: ARG002
        """Share the forces of a state among the texels: here each box keeps its own, shape (n,) [N].

        Args:
            data: The state.
            pressed: Force on both geoms of each of k contacts, see `sum_contacts`, shape (k, 2) [N].
            total: Force on each box, not negative, shape (n,) [N].
        """
        return total


def _find_neighbours(array: TexelArray) -> BoolArray:
    """Find whether each of n texels has a neighbour at its sides -x, +x, -y, +y, shape (n, 4)."""
    from scipy.spatial import cKDTree

    tree, found = cKDTree(array.centres), np.zeros((array.count, 4), dtype=bool)
    for axis, tangent in enumerate(find_tangents(array)):
        for side, sign in enumerate((-1.0, 1.0)):
            beyond = array.centres + sign * array.pitch[axis] * tangent
            distance, _ = tree.query(beyond)
            found[:, 2 * axis + side] = np.asarray(distance) < min(array.pitch) / 2
    return found


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
