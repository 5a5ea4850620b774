"""A prism of any outline, standing on its flat, sharp-edged face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from meshes.indenters.flat_faces import Outlined
from meshes.indenters.indenter import Primitive
from meshes.indenters.outline import check_loop, convex_parts

FloatArray = npt.NDArray[np.float64]
Outline = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Prism(Outlined):
    """A prism; its axis goes through the origin of its corners.

    Attributes:
        points: Corners of the face along its outline, in either order, shape (n, 2) [m].
        holes: Further outlines inside the face, or beside it for a face in several pieces: what lies inside an odd
            number of outlines is solid [m].
    """

    points: Outline = field(metadata={"quantity": "points"})
    holes: tuple[Outline, ...] = ()

    def __post_init__(self) -> None:
        """Check the outlines.

        Raises:
            ValueError: If one is no simple polygon, or the axis lies beside the shape.
        """
        object.__setattr__(self, "points", _plain(self.points))
        object.__setattr__(self, "holes", tuple(_plain(hole) for hole in self.holes))
        for loop in self.loops:
            check_loop(loop)
        corners = np.concatenate([np.array(loop) for loop in self.loops])
        require_axis(corners)

    @property
    def loops(self) -> tuple[Outline, ...]:
        """All outlines [m]."""
        return (self.points, *self.holes)

    @property
    def footprint(self) -> tuple[float, float]:
        """Half widths along x and y [m]."""
        reach = np.abs(np.concatenate([np.array(loop) for loop in self.loops])).max(axis=0)
        return (float(reach[0]), float(reach[1]))

    def primitives(self) -> tuple[Primitive, ...]:
        """Convex prisms that tile it, as tall as its larger half width."""
        height = max(self.footprint)
        return tuple(
            Primitive(kind="hull", vertices=tuple((float(x), float(y), z) for z in (0.0, height) for x, y in part))
            for part in convex_parts(self.loops)
        )


def require_axis(points: FloatArray) -> None:
    """Check that the axis, at the origin, stands within the rectangle around some points (n, 2).

    Raises:
        ValueError: If it does not.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if (low > 0).any() or (high < 0).any():
        (a, b), (c, d) = 1e3 * low, 1e3 * high
        raise ValueError(
            f"the axis, at (0, 0), must stand within the shape's extent, x {a:.4g}..{c:.4g} mm, y {b:.4g}..{d:.4g} mm; "
            "move the shape"
        )


def _plain(loop: Outline) -> Outline:
    return tuple((float(x), float(y)) for x, y in loop)
