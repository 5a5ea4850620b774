"""How a touch becomes forces on texels.

Every method edits a spec before it is compiled and afterwards reads the forces of one simulation step.  So far
there is one: `BoxTexels`, the rigid boxes of the 2015 report.  MuJoCo carries the weight on them exactly but
shares it by the *number of contact points* per box, not by area; that is the method's known error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.box_forces import press_loops, press_numpy
from fastmodel.errors import LifeCycleError, UnknownNameError
from fastmodel.native import choose_kernel
from fastmodel.pose import Pose, multiply, quaternions, rotate
from fastmodel.spread import tangent_axes
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class TexelContact(Protocol):
    """A way to feel contacts, chosen before the model is compiled."""

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add to the spec what the method needs."""

    def bind(self, model: Any, array: TexelArray, name: str, *, native: bool | None = None) -> ContactReader:  # noqa: ANN401
        """Resolve names to index arrays, once."""


class ContactReader(Protocol):
    """The bound method."""

    def forces(self, data: Any) -> FloatArray:  # noqa: ANN401 -- MjData
        """Force that presses on each texel along its normal in the last step, shape (n,) [N]."""


@dataclass(frozen=True, kw_only=True)
class BoxTexels:
    """One rigid box per texel, its upper face the texel's, its height inward.

    Boxes are as wide as the pitch, so that they tile the cover, and have no mass.  Masked texels have boxes
    too: the cover carries there, only nothing is measured.

    Attributes:
        height: Height of a box [m].
        contact_bit: The boxes' own collision bit, 0..30.  They touch every geom that collides with anything,
            but never another array on the same bit [-].
    """

    height: float = 2e-3
    contact_bit: int = 30

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive or the bit not 0..30.
        """
        if not 0 < self.height < np.inf:
            raise ValueError(f"height must be positive, not {self.height} m")
        if not 0 <= self.contact_bit <= 30:  # noqa: PLR2004 -- MuJoCo's collision masks are signed 32-bit
            raise ValueError(f"contact_bit must lie in 0..30, not {self.contact_bit}")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401
        """Add one box geom per texel to a body of the spec.

        Args:
            body: The body of an `mujoco.MjSpec`.
            array: Where the texels are, in the array's frame.
            pose: The array's frame in the body's.
            name: Prefix of the geoms' names.
        """
        axis_x, axis_y = tangent_axes(array)
        turns = multiply(pose.quaternion, quaternions(np.stack([axis_x, axis_y, array.normals], axis=-1)))
        middles = array.centres - 0.5 * self.height * array.normals
        places = pose.position + rotate(pose.quaternion, middles)
        bit = 1 << self.contact_bit
        for index in range(array.count):
            body.add_geom(
                name=geom_name(name, index),
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[array.pitch[0] / 2, array.pitch[1] / 2, self.height / 2],
                pos=places[index],
                quat=turns[index],
                mass=0.0,
                contype=bit,
                conaffinity=0x7FFFFFFF & ~bit,
                rgba=[0.25, 0.27, 0.3, 1.0] if array.active[index] else [0.5, 0.5, 0.5, 0.4],
            )

    def bind(self, model: Any, array: TexelArray, name: str, *, native: bool | None = None) -> ContactReader:  # noqa: ANN401
        """Find the boxes in the compiled model.

        Args:
            model: The compiled model.
            array: The array that was attached.
            name: The prefix it was attached with.
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        names = [geom_name(name, index) for index in range(array.count)]
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom) for geom in names]
        if min(ids) < 0:
            raise LifeCycleError(
                f"geom {names[ids.index(min(ids))]!r} is not in this model; bind a model compiled from the spec "
                f"that sensor {name!r} was attached to"
            )
        return BoxReader(model, np.array(ids), native=native)


class BoxReader:
    """Sums contact forces per box by geom id, all contacts at once."""

    def __init__(self, model: Any, geoms: IntArray, *, native: bool | None = None) -> None:  # noqa: ANN401
        """Remember which geom is which texel.

        Args:
            model: The compiled model.
            geoms: Geom id of each texel, shape (n,).
            native: True for the numba kernel, False for numpy, None for whichever is there.
        """
        self._count = len(geoms)
        self._texel_of = np.full(model.ngeom + 1, -1)  # one more, so that geom -1 (no geom) is no texel
        self._texel_of[geoms] = np.arange(len(geoms))
        self._pyramidal = bool(model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL)
        self._press = choose_kernel(press_loops, press_numpy, native=native)

    def forces(self, data: Any) -> FloatArray:  # noqa: ANN401
        """Component of each box's contact force against its outward normal, shape (n,) [N].

        The component along the normal is summed, not the length of the contact's normal force: on the edge of
        a box the contact leans.  An edge that hooks on a box's side can lift it by friction: such a box reads
        zero, and the others are scaled so that their sum stays what the array as a whole carries.
        """
        total = np.zeros(self._count)
        contact = data.contact
        if data.nefc:
            self._press(
                contact.geom,
                contact.efc_address,
                contact.dim,
                contact.frame,
                contact.friction,
                data.efc_force,
                data.geom_xmat,
                self._texel_of,
                self._pyramidal,
                total,
            )
        return total if total.min() >= 0 else _without_lift(total)


def _without_lift(total: FloatArray) -> FloatArray:
    """Forces without negative entries and with the same sum (zero at least), shape (n,) [N]."""
    pressed = np.maximum(total, 0.0)
    positive = pressed.sum()
    return pressed * (max(float(total.sum()), 0.0) / positive) if positive > 0 else pressed


#: Contact methods by name.
METHODS: Mapping[str, TexelContact] = MappingProxyType({"boxes": BoxTexels()})


def choose(method: str | TexelContact) -> TexelContact:
    """A contact method by name, or the one given.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    if not isinstance(method, str):
        return method
    if method not in METHODS:
        raise UnknownNameError("contact method", method, METHODS)
    return METHODS[method]


def geom_name(name: str, index: int) -> str:
    """Name of a texel's geom: the sensor's name, then the texel's index."""
    return f"{name}/texel{index}"
