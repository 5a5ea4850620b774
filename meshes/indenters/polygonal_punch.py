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

#: Largest distance between an outline and its mirror image for the shape to count as symmetric: what the single
#: precision of STL files leaves, over the larger half width [-], and rounding in double precision [m].
_RELATIVE_TOLERANCE, _TOLERANCE = 1e-6, 1e-9


class PolygonalPunch(FlatPunch):
    """A flat punch whose face is the set of points inside an odd number of polygons."""

    @property
    @abstractmethod
    def polygons(self) -> Sequence[Polygon]:
        """Closed polygons, each a sequence of corners (x, y) [m]."""

    @property
    def footprint(self) -> tuple[float, float]:
        """Largest distances of a corner from the axis, along x and y [m]."""
        half = np.abs(np.concatenate([np.array(polygon) for polygon in self.polygons])).max(axis=0)
        return (float(half[0]), float(half[1]))

    @property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether mirror images of all corners, and of the middles of all sides, lie on the outline."""
        ends = list_sides(self.polygons)
        points = np.concatenate([ends[:, 0], ends.mean(axis=1)])
        tolerance = _TOLERANCE + _RELATIVE_TOLERANCE * max(self.footprint)
        in_x, in_y = (
            bool(np.abs(self.signed_distance(*(points * signs).T)).max() < tolerance) for signs in ((-1, 1), (1, -1))
        )
        return (in_x, in_y)

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Zero inside the outline and on it, inf outside [m]."""
        return np.where(find_inside(self.polygons, x, y), 0.0, np.inf)

    def signed_distance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the outline, positive inside [m]."""
        return compute_signed_distance(self.polygons, x, y)

    def distance_from_inset(self, inset: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Distance from the points of the face that lie deeper inside the outline than the inset; zero on them [m].

        Raises:
            ValueError: If no point lies that deep inside.
            ModuleNotFoundError: If manifold3d is not installed.
        """
        return compute_distance_from_inset(self.polygons, inset, x, y)
