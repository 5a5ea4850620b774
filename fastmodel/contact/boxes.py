"""The contact method with one rigid box geom per texel.

`BoxTexels` is the method of the 2015 report.  The forces on all boxes add up to the weight, but MuJoCo divides the
force of a flat face among the boxes by the *number of contact points* per box instead of by area.  This is the main
error of the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import EVERY, Bodies, check_box, describe_box, find_geoms
from fastmodel.contact.forces import NetForceReader, press_boxes, read_contacts
from fastmodel.contact.interface import Reading, TexelContact
from fastmodel.signal.point_spread import find_tangents
from fastmodel.state import State
from fastmodel.surface import Surface
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray

#: Colour of masked texels: red, green, blue, opacity [-].
_MASKED_COLOUR = (0.5, 0.5, 0.5, 0.4)


@dataclass(frozen=True, kw_only=True)
class BoxTexels(TexelContact):
    """Contact method with one rigid box per texel, whose outer face is the texel.

    The boxes are as wide as the texel pitch, so that no gaps remain between the boxes.  They have no mass.  Masked
    texels have boxes too, because the cover carries load there although the sensor does not measure this load.

    Attributes:
        height: Height of a box, inwards from its outer face [m].
        contype: Collision mask of the boxes, 31 bits [-].  With all bits, the default, the boxes collide with every
            geom that collides with anything, including other arrays.
        conaffinity: Mask of the geoms that the boxes collide with, 31 bits [-].
    """

    height: float = 2e-3
    contype: int = EVERY
    conaffinity: int = EVERY

    costly: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive or a mask not of 31 bits.
        """
        check_box(self.height, self.contype, self.conaffinity)

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add one box geom per texel; see `TexelContact.attach`."""
        axes = np.stack([*find_tangents(array), array.normals], axis=-1)
        turns = Rotation.from_matrix(axes).as_quat(scalar_first=True)
        places = array.centres - 0.5 * self.height * array.normals
        half = (array.pitch[0] / 2, array.pitch[1] / 2, self.height / 2)
        box = describe_box(half, self.contype, self.conaffinity)
        for index, active in enumerate(array.active):
            geom = frame.add_geom(name=f"{name}/texel{index}", pos=places[index], quat=turns[index], **box)
            if not active:
                geom.rgba[:] = _MASKED_COLOUR

    def bind(self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None) -> BoxReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`.  The argument `surface` is not used.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        del surface
        return BoxReader(model, array, name)


class BoxReader:
    """Reader that sums MuJoCo's contact forces on each box; a contact belongs to a box by its geom id."""

    def __init__(self, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the geoms of the n texels.

        Args:
            model: The compiled model.
            array: The texels.
            name: Name of the sensor, as given to `BoxTexels.attach`.
        """
        geoms = find_geoms(model, [f"{name}/texel{index}" for index in range(array.count)], name)
        self._count, self._model, self._first = len(geoms), model, int(geoms[0])
        self._bodies = Bodies(model, geoms, name)
        axes = np.stack([*(each[0] for each in find_tangents(array)), array.normals[0]], axis=-1)
        middle = array.centres[0] - model.geom_size[geoms[0], 2] * array.normals[0]
        neighbours, self._press_boxes = _find_neighbours(array), compile_kernel(press_boxes)
        self._net_force = NetForceReader(model, array, geoms, axes=axes, middle=middle, neighbours=neighbours)

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of the last simulation step; see `ContactReader.read`.

        Each contact force is projected on the normal of its box, because at an edge of the box the contact normal has
        another direction.  Forces on the backs and free sides of boxes count only towards the total.
        An indenter that hooks on the side of a box inside the array can pull it upwards by friction.  The force on such
        a box is set to zero, and the other forces are scaled to keep their sum.

        Raises:
            LifeCycleError: If the size of the boxes has changed.
        """
        self._bodies.check_size()
        contacts = read_contacts(self._model, data)
        forces, carried, sums = self._press_boxes(contacts, data.geom_xmat, data.geom_xpos, self._net_force.parts)
        return self._net_force.add(Reading(forces, None, carried), sums)

    def get_state(self) -> State:
        """Return no arrays, because a reading of this method does not depend on earlier readings."""
        return {}

    def set_state(self, state: State) -> None:
        """Do nothing, because a reading of this method does not depend on earlier readings."""

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, shape (n,) [N]; see `ContactReader.at_rest`."""
        return self._net_force.add(Reading(contact_forces, None, float(contact_forces.sum())), None)


def _find_neighbours(array: TexelArray) -> BoolArray:
    """Find whether each of n texels has a neighbour at its sides -x, +x, -y, +y, shape (n, 4)."""
    tree, found = cKDTree(array.centres), np.zeros((array.count, 4), dtype=bool)
    for axis, tangent in enumerate(find_tangents(array)):
        for side, sign in enumerate((-1.0, 1.0)):
            beyond = array.centres + sign * array.pitch[axis] * tangent
            distance, _ = tree.query(beyond)
            found[:, 2 * axis + side] = np.asarray(distance) < min(array.pitch) / 2
    return found
