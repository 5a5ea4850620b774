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
    """

    time: float
    counts: IntArray
    image: npt.NDArray[np.uint8]
    texel_forces: FloatArray | None = None

    def __post_init__(self) -> None:
        """Make the arrays of the frame read-only."""
        self.counts.setflags(write=False)
        self.image.setflags(write=False)
        if self.texel_forces is not None:
            self.texel_forces.setflags(write=False)
