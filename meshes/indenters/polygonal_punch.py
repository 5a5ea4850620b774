"""Flat punches whose face is bounded by polygons."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from meshes.indenters.indenter import FlatPunch, FloatArray
from meshes.indenters.polygons import (
    Polygon,
    compute_distance_from_inset,
    compute_signed_distance,
    find_inside,
    list_sides,
)

#: Largest distance between an outline and its mirror image for the shape to count as symmetric, the sum of two parts:
#: rounding in STL files, which have single precision, over the larger half width of the shape [-], and rounding in
#: double precision [m].
_RELATIVE_TOLERANCE, _TOLERANCE = 1e-6, 1e-9


class PolygonalPunch(FlatPunch):
    """A flat punch whose face is the set of points inside an odd number of polygons."""

    @property
    @abstractmethod
    def polygons(self) -> Sequence[Polygon]:
        """Closed polygons that bound the face, each a sequence of corners (x, y) [m]."""

    @property
    def footprint(self) -> tuple[float, float]:
        """Largest distance of a corner from the axis along x, and the same along y [m]."""
        half = np.abs(np.concatenate([np.array(polygon) for polygon in self.polygons])).max(axis=0)
        return (float(half[0]), float(half[1]))

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the outline is symmetric about the plane x = 0, and whether about the plane y = 0.

        The outline counts as symmetric if the mirror images of all corners and of the middles of all sides lie on it.
        """
        ends = list_sides(self.polygons)
        points = np.concatenate([ends[:, 0], ends.mean(axis=1)])
        tolerance = _TOLERANCE + _RELATIVE_TOLERANCE * max(self.footprint)
        in_x, in_y = (
            bool(np.abs(self.signed_distance(*(points * signs).T)).max() < tolerance) for signs in ((-1, 1), (1, -1))
        )
        return (in_x, in_y)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lower surface: zero inside the outline and on it, inf outside [m]."""
        return np.where(find_inside(self.polygons, x, y), 0.0, np.inf)

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the outline, positive inside and negative outside [m]."""
        return compute_signed_distance(self.polygons, x, y)

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the distance of points from the part of the face that lies deeper inside the outline than the inset.

        Returns:
            Distances, zero inside that part, shape of `x` and `y` [m].

        Raises:
            ValueError: If no point lies deeper inside the outline than the inset.
            ModuleNotFoundError: If manifold3d is not installed.
        """
        return compute_distance_from_inset(self.polygons, inset, x, y)
