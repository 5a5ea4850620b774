"""Net force and torque on an array, and the tangential force on every texel, from MuJoCo's contacts.

The net force is the sum over all contacts of all boxes or plates of the array, at sides and back too.  With one box per
texel, the tangential force on a texel is that of its own contacts.  With plates, MuJoCo's contact points say nothing
about single texels: the net shear on the front is shared among texels in proportion to their pressure, and the part of
the pressure that acts on the margin takes its share with it.
"""

from __future__ import annotations

import mujoco
import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.contact.force_kernels import (
    Contacts,
    Parts,
    Sums,
    has_pyramids,
    imitate_contacts,
    share_shear,
    sum_contacts,
)
from fastmodel.contact.interface import Reading
from fastmodel.pose import rotate
from fastmodel.signal.point_spread import find_tangents
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Values of `Reading.tangential_source` and `Frame.tangential_source`.
BY_GEOM = "contacts of each texel"
SHARED = "net shear, shared in proportion to pressure"


class NetForceReader:
    """Reader of net force, net torque and tangential forces of one array of n texels.

    Attributes:
        parts: The boxes or plates, as kernels take them.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        geoms: IntArray,
        *,
        axes: FloatArray,
        middle: FloatArray,
        neighbours: BoolArray | None = None,
    ) -> None:
        """Tabulate the geoms of the array.

        Args:
            model: The compiled model.
            array: The array.
            geoms: Ids of its m geoms, boxes or plates, shape (m,).
            axes: Axes of the first geom in the frame of the array, as columns, shape (3, 3) [-].
            middle: Centre of the first geom in the frame of the array, shape (3,) [m].
            neighbours: For one box per texel, see `Parts`, shape (n, 4); None for plates.
        """
        self._model, self._array, self._by_geom = model, array, neighbours is not None
        # The last entry is for geom id -1, which MuJoCo writes for contacts of flexes, so that it belongs to no part.
        part_of = np.full(model.ngeom + 1, -1)
        part_of[geoms] = np.arange(len(geoms))
        sides = np.zeros((len(geoms), 4), dtype=bool) if neighbours is None else neighbours
        self.parts: Parts = (part_of, sides, int(geoms[0]), np.ascontiguousarray(axes), middle)
        # axes of the geoms, from the frame of their body to that of the first geom, to that of the array
        first, *_ = turns = np.array([rotate(turn, np.eye(3)) for turn in model.geom_quat[geoms]])
        self._axes = np.ascontiguousarray(np.swapaxes(turns @ first.T @ axes.T, 1, 2))
        # masked texels measure nothing
        self._masked = None if array.active.all() else ~array.active
        self._tangents = np.stack(find_tangents(array), axis=1) * array.active[:, None, None]
        self._no_shear = np.zeros((array.count, 2))
        self._sum_contacts, self._share_shear = compile_kernel(sum_contacts), compile_kernel(share_shear)

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile the kernels; see `ContactReader.compile_kernels`."""
        for contacts in imitate_contacts(data, pyramidal=has_pyramids(self._model)):
            _, fronts, _, _ = self.sum_contacts(contacts, data)
        self._share_shear(fronts, self._axes, np.zeros(self._array.count), self._tangents)

    def sum_contacts(self, contacts: Contacts, data: mujoco.MjData) -> Sums:
        """Sum the contact forces of a state on the array, see `force_kernels.sum_contacts`."""
        found: Sums = self._sum_contacts(contacts, data.geom_xmat, data.geom_xpos, self.parts)
        return found

    def add(self, reading: Reading, sums: Sums) -> Reading:
        """Return a reading with net force, net torque and tangential forces from the sums of its contact forces."""
        _, fronts, wrench, _ = sums
        if not self._by_geom:
            shared = self._share_shear(fronts, self._axes, reading.contact_forces, self._tangents)
            return self._fill(reading, wrench, shared)
        tangential = fronts[:, :2]  # the axes of a box are the tangents of its texel
        if self._masked is not None:
            tangential[self._masked] = 0.0
        return self._fill(reading, wrench, tangential)

    def add_at_rest(self, reading: Reading) -> Reading:
        """Return a reading of given contact forces with their net force and torque, and without shear."""
        forces = -reading.contact_forces[:, None] * self._array.normals
        torque = np.cross(self._array.centres, forces).sum(axis=0)
        return self._fill(reading, np.append(forces.sum(axis=0), torque), self._no_shear)

    def _fill(self, reading: Reading, wrench: FloatArray, tangential: FloatArray) -> Reading:
        """Return a reading with the values."""
        source = BY_GEOM if self._by_geom else SHARED
        return reading._replace(wrench=wrench, tangential=tangential, tangential_source=source)
