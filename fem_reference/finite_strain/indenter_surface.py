"""Compute height, slope and curvature of the lower surface of a rigid indenter for contact at finite strain.

Sharp edges are rounded by a small fillet, because real edges have a fillet and a finite-strain solution under a
perfectly sharp edge does not converge as the mesh is refined.  Results state the radius of the fillet.  Curved shapes
without an axis of revolution are smoothed over the same length, see `SmoothedHeightmap`.  Where the slope exceeds
`STEEPEST`, the surface continues as a plane or cone of that slope, so that the height is finite everywhere.

The lower surface of an indenter of any shape is smoothed: facets and edges are rounded, and steep walls are replaced by
slopes.

The heights at the nodes of a square grid are the coefficients of a cubic B-spline.  The spline approximates the heights
and does not interpolate them.  It rounds facets and edges over about one cell of the grid and cannot overshoot.  It
preserves the curvature of a curved surface and raises the surface, in each direction, by one sixth of the curvature
times the squared cell size.  The lowest point is therefore moved back to height zero.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from meshes import FlatPunch, Indenter
from meshes.array_types import FloatArray
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class SurfaceSettings:
    """Constants of the smoothed lower surface of an indenter."""

    #: Height, over the cover thickness, at which smoothed surfaces are clipped [-].  A pressed cover never reaches it.
    highest: float = 2.0
    #: Step of the difference quotients for slope and curvature, over the radius of the fillet [-].
    step: float = 1 / 100
    #: Number of grid cells of the heightmap on each side outside the footprint of the indenter [-].
    margin: int = 5
    #: Largest number of grid cells of the heightmap along the longer half of the footprint, to limit the memory [-].
    most_cells: int = 500
    #: Radius of the cone with which one erosion of the heightmap limits its slope [cells].
    cone_radius: int = 3


_SETTINGS = SurfaceSettings()


#: Largest slope of the indenter's surface, 68 degrees [-].  Covers bend less around an edge: under disks 0.18 to 0.45
#: thicknesses deep the force is the same with 4 and larger by 0.1 to 0.3 % with 1.7, whose flank the cover touches.
STEEPEST = 2.5
#: Distance from the axis of a sphere, over its radius, at which the slope of the surface is `STEEPEST` [-].
_RIM = float(np.sin(np.arctan(STEEPEST)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfacePoints:
    """Height of an indenter's lower surface at some points, with its derivatives.

    Attributes:
        height: Height above the lowest point of the surface, shape (...) [units of length].
        slope: Derivatives of the height with respect to x and y, shape (..., 2) [-].
        curvature: Second derivatives of the height, shape (..., 2, 2) [1 / units of length].
    """

    height: FloatArray
    slope: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, kw_only=True)
class IndenterSurface:
    """Lower surface of an indenter with rounded edges.

    Attributes:
        indenter: Indenter with its shape.
        fillet: Radius of rounded edges [units of length].
        unit: Unit of length of positions and heights [m].
        load_scale: Factor on all heights, see `LoadingPath` [-].
        pose: Pose of the indenter in the frame in which positions are given.
    """

    indenter: Indenter
    fillet: float
    unit: float = 1.0
    load_scale: float = 1.0
    pose: Pose = field(default_factory=Pose)

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the height of the surface above its lowest point.

        Args:
            x: x coordinates of the points, any shape [units of length].
            y: y coordinates of the points, same shape [units of length].

        Returns:
            Heights, shape of `x` [units of length].
        """
        return self._local_height(*self._to_local(x, y))

    def evaluate(self, x: FloatArray, y: FloatArray) -> SurfacePoints:
        """Compute the height of the surface, and its derivatives by central differences.

        Args:
            x: x coordinates of the points, any shape [units of length].
            y: y coordinates of the points, same shape [units of length].
        """
        x, y = self._to_local(x, y)
        h = self.fillet * _SETTINGS.step
        height = self._local_height(x, y)
        east, west = self._local_height(x + h, y), self._local_height(x - h, y)
        north, south = self._local_height(x, y + h), self._local_height(x, y - h)
        mixed = self._local_height(x + h, y + h) - self._local_height(x + h, y - h)
        mixed = (mixed - self._local_height(x - h, y + h) + self._local_height(x - h, y - h)) / (4 * h**2)
        slope = np.stack([east - west, north - south], axis=-1) / (2 * h)
        rows = [
            np.stack([(east - 2 * height + west) / h**2, mixed], axis=-1),
            np.stack([mixed, (north - 2 * height + south) / h**2], axis=-1),
        ]
        c, s = self.pose.cosines
        turn = np.array([[c, -s], [s, c]])
        curvature = np.einsum("ik,...kl,jl->...ij", turn, np.stack(rows, axis=-2), turn)
        return SurfacePoints(height=height, slope=slope @ turn.T, curvature=curvature)

    def _to_local(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Transform positions to the frame of the indenter, in units of length."""
        at_x, at_y = self.pose.at
        return replace(self.pose, point=(at_x / self.unit, at_y / self.unit, 0.0)).to_indenter(x, y)

    def _local_height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the height of the surface at positions in the frame of the indenter, in units of length."""
        if isinstance(self.indenter, FlatPunch):
            beyond = (
                self.indenter.distance_from_inset(self.fillet * self.unit, x * self.unit, y * self.unit) / self.unit
            )
            return self.load_scale * _round_edge(beyond, self.fillet)
        if self.indenter.axisymmetric:
            return self.load_scale * self._extend_round_shape(x, y)
        return self.load_scale * self._heightmap.height(x, y)

    @cached_property
    def _heightmap(self) -> SmoothedHeightmap:
        """Smoothed lower surface of the indenter, used for curved shapes without an axis of revolution."""
        return SmoothedHeightmap(
            self.indenter, cell=self.fillet / 2, steepest=STEEPEST, highest=_SETTINGS.highest, unit=self.unit
        )

    def _extend_round_shape(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the height of a curved shape of revolution, extended by a cone outside a fraction of its radius."""
        radius = self.indenter.footprint[0] / self.unit
        shrink = 1 / np.maximum(1.0, np.hypot(x, y) / radius / _RIM)
        beyond = np.hypot(x - x * shrink, y - y * shrink)
        return np.asarray(
            self.indenter.gap(x * shrink * self.unit, y * shrink * self.unit) / self.unit + STEEPEST * beyond
        )


def _round_edge(beyond: FloatArray, radius: float) -> FloatArray:
    """Compute the height of a flat face with a rounded edge.

    The curvature grows from zero to 1 / radius over half a radius and is then constant.  With a jump of the curvature,
    points that move from one side of the jump to the other would make Newton's method cycle.

    Args:
        beyond: Distance of each point outside the flat part of the face, any shape [units of length].
        radius: Radius of the rounded edge [units of length].

    Returns:
        Heights above the face, shape of `beyond` [units of length].
    """
    ramp = radius / 2
    steep = ramp / 2 + STEEPEST * radius
    arc = np.clip(beyond, ramp, steep) - ramp
    bend = np.minimum(beyond, ramp) ** 3 / (6 * radius * ramp)
    return np.asarray(bend + (ramp * arc + arc**2) / (2 * radius) + STEEPEST * np.maximum(beyond - steep, 0))


class SmoothedHeightmap:
    """Twice continuously differentiable approximation of an indenter's lower surface, in units of length.

    Args:
        indenter: Indenter with its shape.
        cell: Edge length of a grid cell; increased if the grid would have too many cells [units of length].
        steepest: Slope that replaces steeper walls [-].
        highest: Height at which the surface is clipped, and the height beside the indenter [units of length].
        unit: Unit of length [m].
    """

    def __init__(self, indenter: Indenter, *, cell: float, steepest: float, highest: float, unit: float) -> None:
        half = np.array(indenter.footprint) / unit
        self._cell, self._steepest = max(cell, float(half.max()) / _SETTINGS.most_cells), steepest
        self._extent = np.ceil(half / self._cell).astype(int) + _SETTINGS.margin
        x, y = np.meshgrid(*(np.arange(-n, n + 1) * self._cell for n in self._extent), indexing="ij")
        heights = np.minimum(indenter.gap(x * unit, y * unit) / unit, highest)
        self._heights = _limit_slope(heights, steepest * self._cell)
        half_cells = np.meshgrid(*(np.arange(4 * n + 1) / 2 for n in self._extent), indexing="ij")
        self._lowest = float(self._evaluate_spline(np.array(half_cells)).min())

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the height of the surface above its lowest point; outside the grid the surface extends as a cone.

        Args:
            x: x coordinates of the points, any shape [units of length].
            y: y coordinates of the points, same shape [units of length].

        Returns:
            Heights, shape of `x` [units of length].
        """
        position = np.stack(np.broadcast_arrays(x, y))
        end = (self._extent * self._cell).reshape(-1, *[1] * (position.ndim - 1))
        within = np.clip(position, -end, end)
        beyond = np.hypot(*(position - within))
        spline = self._evaluate_spline((within + end) / self._cell)
        return np.asarray(spline - self._lowest + self._steepest * beyond)

    def _evaluate_spline(self, position: FloatArray) -> FloatArray:
        """Evaluate the spline at positions in cells from the first node of the grid, shape (2, ...)."""
        return np.asarray(ndimage.map_coordinates(self._heights, position, order=3, mode="nearest", prefilter=False))


def _limit_slope(heights: FloatArray, step: float) -> FloatArray:
    """Compute the largest heights, nowhere above the given heights, that change by at most about `step` per cell.

    Each pass takes the minimum over all upward cones of this slope with their tips on the surface (a grey erosion).
    """
    offset = np.arange(-_SETTINGS.cone_radius, _SETTINGS.cone_radius + 1)
    cone = step * np.hypot(*np.meshgrid(offset, offset))
    while True:
        lower = np.asarray(ndimage.grey_erosion(heights, structure=-cone, mode="nearest"))  # type: ignore[call-overload]
        if np.array_equal(lower, heights):
            return heights
        heights = lower
