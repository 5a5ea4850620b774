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

from fastmodel.errors import LifeCycleError, UnknownNameError
from fastmodel.pose import Pose, multiply, quaternions, rotate
from fastmodel.spread import tangent_axes
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class TexelContact(Protocol):
    """A way to feel contacts, chosen before the model is compiled."""

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add to the spec what the method needs."""

    def bind(self, model: Any, array: TexelArray, name: str) -> ContactReader:  # noqa: ANN401 -- MjModel
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

    def bind(self, model: Any, array: TexelArray, name: str) -> ContactReader:  # noqa: ANN401
        """Find the boxes in the compiled model.

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
        return BoxReader(model, np.array(ids))


class BoxReader:
    """Sums contact forces per box by geom id, all contacts at once."""

    def __init__(self, model: Any, geoms: IntArray) -> None:  # noqa: ANN401
        """Remember which geom is which texel.

        Args:
            model: The compiled model.
            geoms: Geom id of each texel, shape (n,).
        """
        self._geoms = geoms
        self._count = len(geoms)
        self._texel = np.full(model.ngeom + 1, -1)  # one more, so that geom -1 (no geom) is no texel
        self._texel[geoms] = np.arange(len(geoms))
        self._pyramidal = model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL

    def forces(self, data: Any) -> FloatArray:  # noqa: ANN401
        """Component of each box's contact force against its outward normal, shape (n,) [N].

        The component along the normal is summed, not the length of the contact's normal force: on the edge of
        a box the contact leans.  A sum below zero (friction lifting a box by its side) is no touch and reads
        zero.
        """
        contact = data.contact
        texels = self._texel[contact.geom]
        hit = np.flatnonzero((texels >= 0).any(axis=1) & (contact.efc_address >= 0))
        if len(hit) == 0:
            return np.zeros(self._count)
        world = contact_forces(contact, data.efc_force, hit, pyramidal=self._pyramidal)
        total = np.zeros(self._count)
        normals = data.geom_xmat[self._geoms][:, 2::3]
        for side, sign in ((0, 1.0), (1, -1.0)):  # MuJoCo pushes the second geom along +, the first along -
            texel = texels[hit, side]
            pressed = sign * np.einsum("ij,ij->i", world, normals[texel])
            total += np.bincount(texel + 1, np.where(texel >= 0, pressed, 0.0), self._count + 1)[1:]
        return np.maximum(total, 0.0)


def contact_forces(contact: Any, efc_force: FloatArray, hit: IntArray, *, pyramidal: bool) -> FloatArray:  # noqa: ANN401
    """Forces of chosen contacts on their second geom in the world frame, shape (k, 3) [N].

    Elliptic cones store normal and tangential forces.  Pyramidal cones store edge forces f: the normal force
    is their sum, the i-th tangential force mu_i (f_2i - f_2i+1).

    Args:
        contact: `data.contact`.
        efc_force: `data.efc_force`, shape (nefc,) [N].
        hit: Indices of the contacts, shape (k,).
        pyramidal: Whether the model's friction cone is pyramidal.
    """
    first, dim = contact.efc_address[hit], contact.dim[hit]
    frames = contact.frame[hit].reshape(-1, 3, 3)
    local = np.zeros((len(hit), 3))
    edged = pyramidal & (dim > 1)
    rows = np.where(edged, 2 * (dim - 1), dim)
    reach = np.arange(int(rows.max()))
    stored = efc_force[np.minimum(first[:, None] + reach, len(efc_force) - 1)] * (reach < rows[:, None])
    local[:, 0] = np.where(edged, stored.sum(axis=1), stored[:, 0])
    friction = contact.friction[hit]
    for axis in range(2):
        has = dim > axis + 1
        pair = 2 * axis
        if pyramidal and stored.shape[1] > pair + 1:
            edges = friction[:, axis] * (stored[:, pair] - stored[:, pair + 1])
            local[:, axis + 1] = np.where(has, edges, 0.0)
        elif not pyramidal and stored.shape[1] > axis + 1:
            local[:, axis + 1] = np.where(has, stored[:, axis + 1], 0.0)
    return np.asarray(np.einsum("ki,kij->kj", local, frames))


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
