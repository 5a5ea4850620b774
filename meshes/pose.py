"""Where an indenter stands over the array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Pose:
    """The indenter's axis and its turn about it.

    Attributes:
        at: Where the axis stands in the array's frame [m].
        yaw: Turn about the axis [rad].
    """

    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0

    @property
    def square(self) -> bool:
        """Whether the indenter's axes lie along the array's."""
        quarters = 2 * self.yaw / np.pi
        return abs(quarters - round(quarters)) < 1e-9  # noqa: PLR2004 -- rounding of an angle

    @property
    def direction(self) -> tuple[float, float]:
        """Cosine and sine of the turn; exact for quarter turns, so that mirrored poses stay mirror images."""
        if self.square:
            return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(2 * self.yaw / np.pi) % 4]
        return float(np.cos(self.yaw)), float(np.sin(self.yaw))

    def placed(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points of the indenter's frame in the array's [m]."""
        c, s = self.direction
        return self.at[0] + c * x - s * y, self.at[1] + s * x + c * y

    def local(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points of the array's frame in the indenter's [m]."""
        c, s = self.direction
        x, y = x - self.at[0], y - self.at[1]
        return c * x + s * y, c * y - s * x


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """Where an indentation happens; on a cover of limited size no two places are alike.

    Attributes:
        array: The texels.
        pose: The indenter over them.
    """

    array: TexelArray
    pose: Pose
