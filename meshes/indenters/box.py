"""Indenter in the shape of a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.indenters.indenter import (
    FlatPunch,
    FloatArray,
    Primitive,
    quantity_field,
    require_positive,
    require_remainder,
)


@dataclass(frozen=True, kw_only=True)
class Box(FlatPunch):
    """A box with a flat, sharp-edged lower face.

    Attributes:
        size: Edge lengths along x, y and z [m].
    """

    size: tuple[float, float, float] = quantity_field("length")

    def __post_init__(self) -> None:
        """Check the edges.

        Raises:
            ValueError: If the size is not three positive edge lengths.
        """
        if np.shape(self.size) != (3,):
            raise ValueError(f"Box needs three edge lengths, not {self.size}")
        require_positive(self, *self.size)

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Symmetry about the planes x = 0 and y = 0: always true."""
        return (True, True)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half the edge lengths of the box along x and y [m]."""
        return (self.size[0] / 2, self.size[1] / 2)

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the rectangular outline, positive inside and negative outside [m]."""
        dx, dy = np.abs(x) - self.size[0] / 2, np.abs(y) - self.size[1] / 2
        outside = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
        return np.asarray(-outside - np.minimum(np.maximum(dx, dy), 0))

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the rectangle that is smaller by the inset on each side.

        Returns:
            Distances, zero inside the smaller rectangle, shape of `x` and `y` [m].

        Raises:
            ValueError: If the inset is not smaller than half the shorter edge.
        """
        require_remainder(inset, min(self.footprint))
        dx, dy = np.abs(x) - self.size[0] / 2 + inset, np.abs(y) - self.size[1] / 2 + inset
        return np.asarray(np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one box."""
        half = (self.size[0] / 2, self.size[1] / 2, self.size[2] / 2)
        return (Primitive(kind="box", size=half, position=(0, 0, half[2])),)
