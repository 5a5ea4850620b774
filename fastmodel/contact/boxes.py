"""How a touch becomes forces on texels: what every contact method offers, and the boxes of the 2015 report.

Every method edits a spec before it is compiled and afterwards reads the forces of one simulation step.  `BoxTexels` are
the rigid boxes of the report.  MuJoCo carries the weight on them exactly but shares it by the *number of contact
points* per box, not by area; that is the method's known error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple, Protocol

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.compiled import choose_kernel
from fastmodel.contact.box_forces import press_loops, press_numpy
from fastmodel.errors import LifeCycleError
from fastmodel.pose import Pose, multiply, quaternions, rotate
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.signal.point_spread import tangent_axes
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Stands for the friction of contacts where none is asked for; strided as MuJoCo's, for which kernels are compiled.
NO_FRICTION = np.zeros((2, 10))[:, ::2]


class Reading(NamedTuple):
    """What a method makes of one step; a tuple, because one is made on every step.

    Attributes:
        contact_forces: Force that presses on each texel along its normal, before spread, shape (n,) [N].
        texel_forces: The same after spread, where the method knows the cover itself; else None, shape (n,) [N].
        carried: All force that presses on the array and its margin [N].
        approach: How far each touching body has come from its first touch of the undeformed cover, where the method
            knows, shape (bodies,) [m].
    """

    contact_forces: FloatArray
    texel_forces: FloatArray | None
    carried: float
    approach: FloatArray | None = None

    def fill(self, signals: FloatArray) -> float:
        """Put what is filtered into an array, and return the sum of everything [N].

        Args:
            signals: Force on each texel, spread where the method knows how, and the sum, shape (n + 1,) [N].
        """
        signals[:-1] = self.contact_forces if self.texel_forces is None else self.texel_forces
        signals[-1] = self.carried
        return self.carried


class TexelContact(Protocol):
    """A way to feel contacts, chosen before the model is compiled.

    Attributes:
        costly: Whether reading costs so much that it should happen no more often than frames need it.
        honours: Which of Fz, Mx, My of a body that is free to tilt the texel forces add up to.  A guided body's
            moments are the guide's affair: there it is Fz only.
    """

    costly: ClassVar[bool]
    honours: ClassVar[tuple[str, ...]]

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add to the spec what the method needs."""

    def bind(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,
        native: bool | None = None,
    ) -> ContactReader:
        """Resolve names to index arrays, once."""


class ContactReader(Protocol):
    """The bound method."""

    @property
    def latest(self) -> Reading:
        """The reading of what was sampled last; it may refer to the array that was filled then."""

    def sample(self, data: Any, signals: FloatArray) -> float:  # noqa: ANN401 -- MjData
        """Read the forces of the last step into what is filtered, see `Reading.fill`."""

    def read(self, data: Any) -> Reading:  # noqa: ANN401 -- MjData
        """Forces of the last step."""

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """The reading that belongs to given contact forces, shape (n,) [N]; forgets what was read before."""


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

    costly: ClassVar[bool] = False
    honours: ClassVar[tuple[str, ...]] = ("Fz", "Mx", "My")

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

    def bind(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,  # noqa: ARG002 -- boxes know no cover
        native: bool | None = None,
    ) -> BoxReader:
        """Find the boxes in the compiled model.

        Args:
            model: The compiled model.
            array: The array that was attached.
            name: The prefix it was attached with.
            cells: Not used.
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        return BoxReader(model, find_boxes(model, array, name), native=native)


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
        self._data: Any = None
        self._geom_xmat = np.zeros((0, 9))
        self._press = choose_kernel(press_loops, press_numpy, native=native)
        if self._press is press_numpy and _parallel(model, geoms):
            self._press = partial(press_numpy, flat=int(geoms[0]))

    def __getstate__(self) -> dict[str, Any]:
        """All but what looks at the data: a copy is to look at its own."""
        return vars(self) | {"_data": None, "_geom_xmat": np.zeros((0, 9))}

    def forces(self, data: Any) -> FloatArray:  # noqa: ANN401
        """Component of each box's contact force against its outward normal, shape (n,) [N].

        The component along the normal is summed, not the length of the contact's normal force: on the edge of
        a box the contact leans.  An edge that hooks on a box's side can lift it by friction: such a box reads
        zero, and the others are scaled so that their sum stays what the array as a whole carries.
        """
        signals = np.empty(self._count + 1)
        self._fill(data, signals)
        return signals[:-1]

    @property
    def latest(self) -> Reading:
        """The reading of what was sampled last."""
        return Reading(self._signals[:-1], None, self._signals.item(-1))

    def sample(self, data: Any, signals: FloatArray) -> float:  # noqa: ANN401
        """Read the forces of the last step into what is filtered."""
        self._signals = signals
        self._fill(data, signals)
        return signals.item(-1)

    def read(self, data: Any) -> Reading:  # noqa: ANN401
        """Forces of the last step."""
        self.sample(data, np.empty(self._count + 1))
        return self.latest

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """The reading that belongs to given contact forces, shape (n,) [N]."""
        return Reading(contact_forces=contact_forces, texel_forces=None, carried=float(contact_forces.sum()))

    def _fill(self, data: Any, signals: FloatArray) -> None:  # noqa: ANN401
        """Force on each box and their sum into `signals`, shape (n + 1,) [N]."""
        if data is not self._data:
            # this one stays where it is as long as the data do
            self._data, self._geom_xmat = data, data.geom_xmat
        contact = data.contact
        geom = contact.geom
        if not len(geom):
            signals[:] = 0.0
            return
        lowest = self._press(
            geom,
            contact.efc_address,
            contact.dim,
            contact.frame,
            contact.friction if self._pyramidal else NO_FRICTION,
            data.efc_force,
            self._geom_xmat,
            self._texel_of,
            self._pyramidal,
            signals,
        )
        if lowest < 0:
            signals[:-1] = _without_lift(signals[:-1])
            signals[-1] = signals[:-1].sum()


def _parallel(model: Any, geoms: IntArray) -> bool:  # noqa: ANN401
    """Whether the boxes can never turn against each other: one body, one orientation in it."""
    same_body = model.geom_bodyid[geoms] == model.geom_bodyid[geoms[0]]
    return bool(same_body.all() and (model.geom_quat[geoms] == model.geom_quat[geoms[0]]).all())


def _without_lift(total: FloatArray) -> FloatArray:
    """Forces without negative entries and with the same sum (zero at least), shape (n,) [N]."""
    pressed = np.maximum(total, 0.0)
    positive = pressed.sum()
    return pressed * (max(float(total.sum()), 0.0) / positive) if positive > 0 else pressed


def find_boxes(model: Any, array: TexelArray, name: str) -> IntArray:  # noqa: ANN401
    """Geom id of each texel's box, shape (n,).

    Raises:
        LifeCycleError: If one is not in the model.
    """
    names = [geom_name(name, index) for index in range(array.count)]
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom) for geom in names]
    if min(ids) < 0:
        raise LifeCycleError(
            f"geom {names[ids.index(min(ids))]!r} is not in this model; bind a model compiled from the spec "
            f"that sensor {name!r} was attached to"
        )
    return np.array(ids)


def geom_name(name: str, index: int) -> str:
    """Name of a texel's geom: the sensor's name, then the texel's index."""
    return f"{name}/texel{index}"
