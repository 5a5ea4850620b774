"""The interface of all contact methods: from contacts of MuJoCo to forces on texels.

A contact method (`TexelContact`) adds geoms to a spec before it is compiled.  Bound to the compiled model it becomes a
`ContactReader`, which makes a `Reading` of each simulation step.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, Protocol

import mujoco

from fastmodel.pose import Pose
from fastmodel.pressure.cover_kernels import CoverCells
from meshes import TexelArray
from meshes.array_types import FloatArray


class Reading(NamedTuple):
    """The contact forces of one simulation step.

    Attributes:
        contact_forces: Force that presses on each texel along its normal, before spread, shape (n,) [N].
        texel_forces: Force on each texel after spread, shape (n,) [N]; None if the method does not model the cover.
        carried: Total force that presses on the array and its margin [N].
        approach: Approach of each touching body since its first touch of the undeformed cover, shape (bodies,) [m];
            None if the method does not compute it.
    """

    contact_forces: FloatArray
    texel_forces: FloatArray | None
    carried: float
    approach: FloatArray | None = None


class TexelContact(Protocol):
    """A contact method and its settings, chosen before the model is compiled.

    Attributes:
        costly: Whether reading is so slow that it should happen no more often than frames and filter need.
    """

    costly: ClassVar[bool]

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Pose, name: str) -> None:
        """Add the geoms that the method needs.

        Args:
            body: The body of a `mujoco.MjSpec` that carries the array.
            array: The texels, in the array's frame.
            pose: The array's frame in the body's.
            name: Prefix of the geoms' names.
        """

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, cells: CoverCells | None = None
    ) -> ContactReader:
        """Find the geoms in the compiled model.

        Args:
            model: The compiled model.
            array: The array that was attached.
            name: The prefix that it was attached with.
            cells: The cover between sub-texel cells, for methods that model the cover.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If the method needs cover data that are not given.
        """


class ContactReader(Protocol):
    """A contact method bound to a compiled model."""

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile every kernel that `read` calls, so that the first touch takes no longer than others.

        Args:
            data: A state of the model without contacts.
        """

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of the last simulation step.

        Raises:
            StateError: If a contact force is not finite.
        """

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading of given contact forces, shape (n,) [N], and discard the state of earlier steps."""
