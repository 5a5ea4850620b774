"""The interface of all contact methods, which compute forces on texels from MuJoCo's contacts.

A contact method (`TexelContact`) adds geoms to a spec before the spec is compiled.  Its `bind` returns a
`ContactReader` for the compiled model, which computes a `Reading`, the contact forces, at a simulation step.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Protocol

import mujoco
import numpy as np

from fastmodel.contact.bodies import sample_boxes
from fastmodel.state import State
from fastmodel.surface import CoverPoints, Surface
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray


class Reading(NamedTuple):
    """The contact forces of one simulation step.

    Attributes:
        contact_forces: Force that presses on each texel along its normal, before spread, shape (n,) [N].
        texel_forces: Force on each texel after spread, shape (n,) [N]; None if the contact
            method does not compute forces at the base of the cover.
        carried: Total force that presses on the array and its margin [N].
        approach: Approach of each touching body since its first touch of the undeformed cover, shape (bodies,) [m];
            None if the contact method does not compute the approach.
        fewest_cells: Smallest number of cells under pressure of any body [-]; None if the contact method has no cells.
        wrench: Force that all contacts exert on the array, including its sides and back, and their torque about its
            origin, in the array's frame, shape (6,) [N, N m]; None if the contact method does not compute them.
        torques: Torque of the pressure about the array's origin, and what it lacks of the torque of the contacts of
            bodies that are free to tilt, in the array's frame, shape (6,) [N m]; None if the contact method does not
            compute them.
        tangential: Tangential force on each texel along its two tangents (x and y of a flat array), before spread,
            shape (n, 2); None if the contact method does not compute it [N].
        tangential_source: Method by which the tangential forces were computed, see `Frame.tangential_source`.
        at_end: Share of the force on the outermost cells of a plate whose margin nobody states [-]: the contact may go
            on beyond the plate, and the force there is missing.
    """

    contact_forces: FloatArray
    texel_forces: FloatArray | None
    carried: float
    approach: FloatArray | None = None
    fewest_cells: int | None = None
    wrench: FloatArray | None = None
    torques: FloatArray | None = None
    tangential: FloatArray | None = None
    tangential_source: str = ""
    at_end: float = 0.0

    def change(self, values: FloatArray, torques: FloatArray) -> Reading:
        """Return the reading with changed values.

        Args:
            values: Changes of `contact_forces`, of `texel_forces` if there are any, and of `carried`, shape (n + 1,) or
                (2 n + 1,) [N].
            torques: Changes of `torques`, shape (6,) [N m].
        """
        count, texel_forces = len(self.contact_forces), self.texel_forces
        return self._replace(
            contact_forces=self.contact_forces + values[:count],
            texel_forces=None if texel_forces is None else texel_forces + values[count : 2 * count],
            carried=self.carried + float(values[-1]),
            torques=None if self.torques is None else self.torques + torques,
        )


class TexelContact(Protocol):
    """A contact method and its settings, chosen before the model is compiled.

    Attributes:
        costly: Whether the contact forces take so long to compute that they are sampled only as often as frame rate and
            filter require.
        computes_spread: Whether the readings hold the texel forces after spread, if the parameters hold a surface.
        takes_overlaps: Whether texels may overlap.
    """

    costly: ClassVar[bool] = True
    computes_spread: ClassVar[bool] = False
    takes_overlaps: ClassVar[bool] = False

    def adapt(self, surface: Surface | None) -> TexelContact:  # noqa: ARG002 -- some methods need it
        """Return this contact method with the settings that suit a cover; most methods need no change.

        Raises:
            FastModelError: If the method needs another cover.
        """
        return self

    def hold(self, array: TexelArray, reach: tuple[float, float]) -> TexelContact:  # noqa: ARG002 -- some methods need it
        """Return this contact method with a plate that holds bodies, if it has one and nobody states its margin.

        Args:
            array: The texels.
            reach: Largest distances of the bodies from the middle of the array, along x and y [m].
        """
        return self

    @property
    def pressed_points(self) -> CoverPoints | None:
        """Points of a cover on which `fastmodel.indent` presses without a simulation; None if there are none."""
        return None

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add the geoms of the contact method to a spec.

        Args:
            frame: The frame of the array, on the body that carries the array.
            array: The texels, in the array's frame.
            name: Name of the sensor, which is the prefix of the names of the geoms.
        """

    def find_start(self, array: TexelArray, at: tuple[float, float], reach: float) -> float:
        """Return a height from which a body can be lowered on an array without touching a texel at first [m].

        The height is 0 on a flat array.

        Args:
            array: The texels.
            at: Position x, y of the body in the array's frame [m].
            reach: Distance from this position within which the whole body lies [m].
        """
        under = np.hypot(*(array.centres[:, :2] - at).T) <= reach
        return float(array.centres[under, 2].max(initial=0.0)) + (not array.planar) * max(array.pitch)

    def sample_top(
        self, model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, array: TexelArray
    ) -> tuple[FloatArray, FloatArray]:
        """Place points on the top of an array, about half a pitch apart.

        `Sensor.check` searches at these points for other geoms that are flush with the top or above it.

        Args:
            model: The compiled model.
            data: A state with the poses of geoms.
            geoms: Ids of the array's geoms.
            array: The texels.

        Returns:
            The points in the world, shape (n, 3) [m], and the outward normals there, shape (n, 3) [-].
        """
        return sample_boxes(model, data, geoms, inset=0.0, spacing=0.5 * min(array.pitch))

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> ContactReader:
        """Find the geoms of the contact method in the compiled model.

        Args:
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor, as given to `attach`.
            surface: Compliance and influence of the cover, for contact methods that model the cover.

        Returns:
            The reader, which computes contact forces from states of the model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If the contact method needs cover data that are not given.
        """


class ContactReader(Protocol):
    """A contact method bound to a compiled model."""

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute contact forces, net force and tangential forces from the state after a simulation step.

        Raises:
            FastModelError: If a contact force is not finite.
            LifeCycleError: If the size of the array's geoms has changed.
        """

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, and discard results of previous steps.

        Args:
            contact_forces: Force that presses on each of n texels, before spread, shape (n,) [N].
        """

    def get_state(self) -> State:
        """Return as arrays all stored values that affect the next readings, such as start values of a solver."""

    def set_state(self, state: State) -> None:
        """Restore a state returned by `get_state`, so that the next readings are equal bit for bit.

        Raises:
            FastModelError: If an array is missing.
        """


#: Combinations of contact method, kind of cover, regularity of the array, and friction cone whose kernels were compiled
#: in this process.
_COMPILED: set[tuple[Any, ...]] = set()


def compile_kernels(contact: TexelContact, array: TexelArray, surface: Surface | None, cone: int) -> None:
    """Compile every kernel of a contact method, so that nothing is compiled at the first contact.

    A ball and then a block fall on the array in a separate simulation.  Numba compiles a kernel once for each memory
    layout of its arguments, and MuJoCo's arrays for one contact have another layout than those for several contacts.

    Args:
        contact: The contact method.
        array: The array.
        surface: Compliance and influence of the cover.
        cone: MuJoCo's option for the friction cone.
    """
    key = (type(contact), type(surface), array.regular, int(cone))
    if key in _COMPILED:
        return
    spec, normal, size = mujoco.MjSpec(), array.normals[0], 0.5 * min(array.pitch)
    spec.option.cone, spec.option.timestep, spec.option.gravity[:] = cone, 1e-3, -10 * normal
    contact.attach(spec.worldbody.add_frame(), array, "array")
    upright, height = np.zeros(4), size + (0.0 if surface is None else surface.thickness)
    mujoco.mju_quatZ2Vec(upright, normal)
    for later, kind in enumerate((mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX)):
        body = spec.worldbody.add_body(pos=array.centres[0] + (height + 1e-3 * later) * normal, quat=upright.tolist())
        body.add_freejoint()
        body.add_geom(type=kind, size=[size] * 3, mass=0.1, conaffinity=0)
    model = spec.compile()
    data, reader, several = mujoco.MjData(model), contact.bind(model, array, "array", surface=surface), 0
    for _ in range(300):
        mujoco.mj_step(model, data)
        reader.read(data)
        several += data.ncon > 1
        if several > 1:
            data.ncon = 1  # where the hulls of a curved cover overlap, a ball always has several contacts
            reader.read(data)
            break
    _COMPILED.add(key)
