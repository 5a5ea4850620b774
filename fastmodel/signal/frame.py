"""One frame of a tactile array, simulated or real."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """What a tactile array delivers at one instant.

    Attributes:
        time: When the values were latched: simulation time, or the real sensor's own clock [s].
        counts: The sensor's integers, shape (n,), row-major, x fastest [-].
        image: The same as grey levels, shape (rows, columns), uint8, row 0 at the smallest y [-].
        texel_forces: Filtered and spread texel forces before the electronics, shape (n,) [N]; None where
            only counts exist, as on a real sensor.  A texel force may be slightly negative (a nearly
            incompressible cover pulls around the load); counts never are.
    """

    time: float
    counts: npt.NDArray[np.int64]
    image: npt.NDArray[np.uint8]
    texel_forces: npt.NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays, so that a frame that was handed out never changes."""
        self.counts.setflags(write=False)
        self.image.setflags(write=False)
        if self.texel_forces is not None:
            self.texel_forces.setflags(write=False)
