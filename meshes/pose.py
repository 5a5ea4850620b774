"""Pose of an indenter over an array, in the plane of the array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.array import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Largest difference between a yaw and a multiple of 90 degrees that counts as rounding, over 90 degrees [-].
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class PlanarPose:
    """Position of an indenter's vertical axis in the array's frame, and rotation of the indenter about this axis.

    Attributes:
        at: Position (x, y) of the indenter's axis in the array's frame [m].
        yaw: Rotation of the indenter about its axis, counterclockwise as seen from above [rad].
    """

    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0

    @property
    def is_aligned(self) -> bool:
        """Whether the indenter's axes are parallel to those of the array: the yaw is a multiple of 90 degrees."""
        quarters = 2 * self.yaw / np.pi
        return abs(quarters - round(quarters)) < _ROUNDING

    @property
    def direction(self) -> tuple[float, float]:
        """Direction of the indenter's x axis in the array's frame: cosine and sine of the yaw [-].

        For multiples of 90 degrees the values are exact, so that mirrored poses remain mirror images.
        """
        if self.is_aligned:
            return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(2 * self.yaw / np.pi) % 4]
        return float(np.cos(self.yaw)), float(np.sin(self.yaw))

    def to_array(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform points from the indenter's frame to the array's frame.

        Args:
            x: x coordinates in the indenter's frame, any shape [m].
            y: y coordinates in the indenter's frame, same shape [m].

        Returns:
            x and y coordinates in the array's frame, each of the same shape [m].
        """
        c, s = self.direction
        return self.at[0] + c * x - s * y, self.at[1] + s * x + c * y

    def to_indenter(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform points from the array's frame to the indenter's frame; the inverse of `to_array`.

        Args:
            x: x coordinates in the array's frame, any shape [m].
            y: y coordinates in the array's frame, same shape [m].

        Returns:
            x and y coordinates in the indenter's frame, each of the same shape [m].
        """
        c, s = self.direction
        x, y = x - self.at[0], y - self.at[1]
        return c * x + s * y, c * y - s * x


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A texel array and the pose of an indenter over the array.

    Attributes:
        array: The texel array.
        pose: Pose of the indenter in the array's frame.
    """

    array: TexelArray
    pose: PlanarPose
