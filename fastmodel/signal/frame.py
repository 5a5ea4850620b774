"""One frame of a tactile array, simulated or real."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """The values that a tactile array delivers at one instant.

    Attributes:
        time: Time at which the values were sampled: simulation time, or the real sensor's own clock [s].
        counts: Output of the sensor, shape (n,), row-major, x fastest [-].
        image: The counts as grey levels, shape (rows, columns), uint8, row 0 at the smallest y [-].
        texel_forces: Filtered and spread texel forces before the electronics, shape (n,) [N]; None if only counts are
            known, as for a real sensor.  A texel force may be slightly negative, because the pressure under a nearly
            incompressible cover is negative around the load.  Counts are never negative.
        texel_area: Sensitive area of a texel; None for a real sensor [m2].
        net_force: Force that all contacts exert on the array, including its sides and back, in the frame of the array,
            shape (3,) [N].  A pressing force has a negative z component.  It is filtered as the texel forces are,
            without spread, noise or electronics.  None for a real sensor.
        net_torque: Torque of all contacts about the origin of the array's frame, filtered, shape (3,) [N m]; None for a
            real sensor.
        pressure_torque: Torque of the computed pressure about the origin of the array's frame, filtered, shape (3,)
            [N m].  On bent arrays it leaves out point forces of bodies without a known shape.
            None for contact methods that compute no pressure, and for a real sensor.
        missed_torque: What `pressure_torque` lacks of the torque with which bodies that are free to tilt press in
            MuJoCo, filtered, shape (3,) [N m].  Where MuJoCo's contact points lie at the rim of a body, no pressure on
            the cells of the cover has exactly their torque.  None as above.
        tangential: Tangential force that contacts exert on each texel, along x and y of a flat array or else along the
            texel's tangents (`fastmodel.signal.point_spread.find_tangents`), shape (n, 2) [N].  It is filtered, without
            spread, and zero on masked texels.  None for a real sensor.
        outside: Part of the filtered contact force that no texel measures [N]; None for a real sensor.
        tangential_source: Method of the tangential forces.  It is "contacts of each texel" for the contact methods
            `boxes`, and "net shear, shared in proportion to pressure" for `cover` and `foundation`.  With
            the second method only the sum of the tangential forces is meaningful, not their distribution.
    """

    time: float
    counts: IntArray
    image: npt.NDArray[np.uint8]
    texel_forces: FloatArray | None = None
    texel_area: float | None = None
    net_force: FloatArray | None = None
    net_torque: FloatArray | None = None
    pressure_torque: FloatArray | None = None
    missed_torque: FloatArray | None = None
    tangential: FloatArray | None = None
    outside: float | None = None
    tangential_source: str = ""

    @property
    def pressures(self) -> FloatArray | None:
        """Mean pressure on each texel, force over sensitive area, shape (n,); None for a real sensor [Pa]."""
        if self.texel_forces is None or self.texel_area is None:
            return None
        return self.texel_forces / self.texel_area

    def __post_init__(self) -> None:
        """Make the arrays of the frame read-only."""
        for values in vars(self).values():
            if isinstance(values, np.ndarray):
                values.setflags(write=False)
