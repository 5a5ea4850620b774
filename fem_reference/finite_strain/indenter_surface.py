"""A rigid indenter as a smooth obstacle over the cover: height, slope and curvature at any point.

Sharp edges get a small fillet (a printed or machined edge has one, and a finite-strain solution under a perfectly sharp
edge has no limit); the fillet's radius belongs to the result.  Curved shapes without an axis are smoothed over the same
length, see `relief`.  Where a surface turns steeper than `STEEPEST` it goes on as a plane, so that the height stays
finite everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fem_reference.finite_strain.smoothed_heightmap import Relief
from meshes import FlatPunch, Indenter

FloatArray = npt.NDArray[np.float64]

#: Slope at which a fillet or a ball goes on as a plane (60 degrees): a cover that leaves an edge is less steep [-].
STEEPEST = float(np.tan(np.radians(60)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Height:
    """Height of the obstacle over its lowest point.

    Attributes:
        value: Shape (...) [m].
        slope: Shape (..., 2) [-].
        curvature: Shape (..., 2, 2) [1/m].
    """

    value: FloatArray
    slope: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """An indenter, standing with its axis at the origin.

    Attributes:
        indenter: The shape.
        fillet: Radius of the rounding of sharp edges, in `unit`.
        unit: Length that positions and heights are counted in [m].
        load_scale: Factor on all heights.  Small-strain contact is homogeneous: a thousandth of the heights under a
            thousandth of the load gives the small-strain solution for the whole of both, divided by a thousand [-].
    """

    indenter: Indenter
    fillet: float
    unit: float = 1.0
    load_scale: float = 1.0

    def with_load_scale(self, load_scale: float) -> Obstacle:
        """The same shape with that factor on all heights [-]."""
        return replace(self, load_scale=load_scale)

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height over the lowest point, any shape [m]."""
        if isinstance(self.indenter, FlatPunch):
            x, y = x * self.unit, y * self.unit
            beyond = self.indenter.distance_from_inset(self.fillet * self.unit, x, y) / self.unit
            return self.load_scale * _rounded_edge(beyond, self.fillet)
        return self.load_scale * (self._extended(x, y) if self.indenter.axisymmetric else self._relief.height(x, y))

    def at(self, x: FloatArray, y: FloatArray) -> Height:
        """Height with its derivatives, by central differences over a hundredth of the fillet.

        Args:
            x: Positions [m].
            y: Positions of the same shape [m].
        """
        h = self.fillet / 100
        value = self.height(x, y)
        east, west = self.height(x + h, y), self.height(x - h, y)
        north, south = self.height(x, y + h), self.height(x, y - h)
        twist = self.height(x + h, y + h) - self.height(x + h, y - h)
        twist = (twist - self.height(x - h, y + h) + self.height(x - h, y - h)) / (4 * h**2)
        slope = np.stack([east - west, north - south], axis=-1) / (2 * h)
        rows = [
            np.stack([(east - 2 * value + west) / h**2, twist], axis=-1),
            np.stack([twist, (north - 2 * value + south) / h**2], axis=-1),
        ]
        return Height(value=value, slope=slope, curvature=np.stack(rows, axis=-2))

    @property
    def _footprint(self) -> FloatArray:
        return np.array(self.indenter.footprint) / self.unit

    @cached_property
    def _relief(self) -> Relief:
        return Relief(self.indenter, cell=self.fillet / 2, steepest=STEEPEST, highest=_HIGHEST, unit=self.unit)

    def _extended(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """A curved shape with an axis, continued outside its footprint by a steep cone."""
        shrink = 1 / np.maximum(1.0, np.hypot(x, y) / self._footprint[0] / _RIM)
        beyond = np.hypot(x - x * shrink, y - y * shrink)
        return np.asarray(
            self.indenter.gap(x * shrink * self.unit, y * shrink * self.unit) / self.unit + STEEPEST * beyond
        )


#: Height that a pressed cover never reaches, in units of its thickness [-].
_HIGHEST = 2.0
#: A ball is that steep at this fraction of its radius.
_RIM = float(np.sin(np.arctan(STEEPEST)))


def _rounded_edge(beyond: FloatArray, radius: float) -> FloatArray:
    """Height of a face with a rounded edge, from the distance outside its flat part.

    The curvature grows from zero to 1 / radius over half a radius and stays there: where it jumps, points that come to
    lie on one side and the other make Newton's method cycle.
    """
    ramp = radius / 2
    steep = ramp / 2 + STEEPEST * radius
    arc = np.clip(beyond, ramp, steep) - ramp
    bend = np.minimum(beyond, ramp) ** 3 / (6 * radius * ramp)
    return np.asarray(bend + (ramp * arc + arc**2) / (2 * radius) + STEEPEST * np.maximum(beyond - steep, 0))
