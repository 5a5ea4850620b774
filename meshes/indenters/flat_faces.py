"""Shapes that stand on a flat face of any outline."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.indenters.indenter import Primitive, length, require_positive
from meshes.indenters.outline import Loop, beyond_loops, flats_of_circle, hexagon, inside_loops, within_loops

FloatArray = npt.NDArray[np.float64]


class Outlined(ABC):
    """A shape whose flat, sharp-edged face lies inside an odd number of polygons."""

    axisymmetric = False

    @property
    @abstractmethod
    def loops(self) -> Sequence[Loop]:
        """The polygons [m]."""

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the outline [m]."""
        return np.where(within_loops(self.loops, x, y), 0.0, np.inf)

    def inside(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the outline, positive inside [m]."""
        return inside_loops(self.loops, x, y)

    def beyond(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance outside of what an inset leaves of the face [m].

        Raises:
            ValueError: If the inset leaves nothing.
        """
        return beyond_loops(self.loops, inset, x, y)


@dataclass(frozen=True, kw_only=True)
class Nut(Outlined):
    """A hexagonal nut lying flat, two of its flats facing along x.

    Its bore is a hexagon too, of the area of the round bore: so six convex prisms make the nut exactly.

    Attributes:
        across: Width across flats [m].
        bore: Diameter of the round bore [m].
    """

    across: float = length()
    bore: float = length()

    def __post_init__(self) -> None:
        """Check that the bore fits."""
        require_positive(self, self.across, self.bore)
        if not flats_of_circle(self.bore) < self.across:
            raise ValueError(f"Nut needs a bore that leaves a wall, not {self.bore} m in {self.across} m")

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.across / 2, self.across / np.sqrt(3))

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The outer hexagon and that of the bore [m]."""
        return (hexagon(self.across), hexagon(flats_of_circle(self.bore)))

    def primitives(self) -> tuple[Primitive, ...]:
        """Six prisms, as tall as 0.8 of the width across flats."""
        outer, inner = self.loops
        corners = [(outer[k], outer[k - 1], inner[k], inner[k - 1]) for k in range(6)]
        return tuple(
            Primitive(kind="hull", vertices=tuple((x, y, z) for z in (0.0, 0.8 * self.across) for x, y in each))
            for each in corners
        )


@dataclass(frozen=True, kw_only=True)
class LetterH(Outlined):
    """A block in the shape of the letter H, its legs along y.

    Attributes:
        size: Edge lengths along x and y [m].
        bar: Width of the legs and of the bar between them [m].
    """

    size: tuple[float, float] = length()
    bar: float = length()

    def __post_init__(self) -> None:
        """Check that the bars fit."""
        require_positive(self, *self.size, self.bar)
        if not (2 * self.bar < self.size[0] and self.bar < self.size[1]):
            raise ValueError(
                f"LetterH needs a bar that leaves room between the legs, not {self.bar} m in {self.size} m"
            )

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        return (self.size[0] / 2, self.size[1] / 2)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The letter's outline [m]."""
        half_x, half_y = self.footprint
        leg, bar = half_x - self.bar, self.bar / 2
        quarter = [(half_x, half_y), (leg, half_y), (leg, bar)]
        half = quarter + [(-a, b) for a, b in reversed(quarter)]
        return (half + [(-a, -b) for a, b in half],)

    def primitives(self) -> tuple[Primitive, ...]:
        """Three boxes, as tall as the legs are long."""
        half_x, half_y = self.footprint
        bar = self.bar / 2
        parts = ((bar, half_y, half_x - bar), (bar, half_y, bar - half_x), (half_x - self.bar, bar, 0.0))
        return tuple(Primitive(kind="box", size=(a, b, half_y), position=(x, 0, half_y)) for a, b, x in parts)
