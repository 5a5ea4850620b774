"""Integrate an axisymmetric base pressure over the texels of an array and over the base outside the texels.

The force on a texel is the sum of four values of a table: the integral of the pressure over the rectangle between the
axis and a corner of the texel.  The force on the union of all active texels follows from a second table, which is
computed independently: the divergence theorem turns it into integrals of Q(r) / r^2 along the outline of the union,
with Q(r) the integral of pressure times distance from 0 to r.  That both agree is a check of both.

Loads on a grid of points are summed without evaluating every point: the coefficients of a table's spline are factorised
by a singular value decomposition, which turns the sum into a few matrix products.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, RectBivariateSpline

from fem_reference.elements.grading import growing_steps
from fem_reference.elements.line import gauss_points
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Panels for integrals of the base pressure over the distance from the axis: number of equal panels near the axis,
#: number of these per cover thickness, and ratio of neighbouring panels farther away [-].
_EVEN_PANELS, _PER_THICKNESS, _PANEL_GROWTH = 48, 12, 1.1
#: Largest distance in the table of outlines over the reach of the pressure [-].
_FARTHEST = 300.0
#: Smallest singular value of a table that is kept, over the largest [-].
_RANK = 1e-11
#: Distance between texel edges, over the smaller side of a texel, below which the edges count as one [-].
_SAME_EDGE = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class _OddTable:
    """Function of x and y that is odd in both, as a bicubic spline; constant beyond the largest positions.

    Attributes:
        spline: The function for x and y from 0 to `limit`.
        limit: Largest position of the table [m].
    """

    spline: RectBivariateSpline
    limit: float

    @classmethod
    def tabulate(cls, edges: FloatArray, values: FloatArray) -> _OddTable:
        """Interpolate values at the grid of positions (edges, edges), the first of which is 0.

        The mirror images are part of the interpolation: without them it is least accurate near the axis, where narrow
        texels have all their corners.
        """
        both = np.append(-edges[:0:-1], edges)
        right = np.vstack([-values[:0:-1], values])
        mirrored = np.hstack([-right[:, :0:-1], right])
        return cls(spline=RectBivariateSpline(both, both, mirrored), limit=float(edges[-1]))

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Evaluate the function at points (x, y) [m]."""
        value = self.spline.ev(np.minimum(np.abs(x), self.limit), np.minimum(np.abs(y), self.limit))
        return np.asarray(np.sign(x) * np.sign(y) * value)

    def sum_loads(
        self, points: tuple[FloatArray, FloatArray], grid: tuple[FloatArray, FloatArray, FloatArray]
    ) -> FloatArray:
        """Sum the function over loads on a grid, at the offsets of points from the loads.

        Args:
            points: Positions along x, shape (p,), and along y, shape (q,) [m].
            grid: Positions of the loads along x, shape (m,), and along y, shape (n,) [m], and the loads, shape (m, n).

        Returns:
            Sum of load times value at every point (x, y), shape (p, q).
        """
        x, y, loads = grid
        along = self._factor(0, points[0][:, None] - x)
        across = self._factor(1, points[1][:, None] - y)
        return np.asarray(sum(a @ loads @ b.T for a, b in zip(along, across, strict=True)))

    def _factor(self, axis: int, offset: FloatArray) -> FloatArray:
        """Evaluate the factors of all terms along one axis at offsets of shape (p, m), shape (terms, p, m)."""
        knots = self.spline.get_knots()[axis]
        value = BSpline(knots, self._factors[axis], 3)(np.minimum(np.abs(offset), self.limit))
        return np.moveaxis(np.sign(offset)[..., None] * value, -1, 0)

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray]:
        """Spline coefficients of the factors along x and along y, shapes (coefficients, terms)."""
        knots = self.spline.get_knots()
        matrix = self.spline.get_coeffs().reshape(len(knots[0]) - 4, len(knots[1]) - 4)
        left, size, right = np.linalg.svd(matrix)
        kept = size > _RANK * size[0]
        root = np.sqrt(size[kept])
        return left[:, kept] * root, right[kept].T * root


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialPressure:
    """Axisymmetric base pressure around a vertical axis.

    Attributes:
        pressure: Function from the distance from the axis [m] to the base pressure.
        radius: Distances from the axis between which the pressure is smooth, from 0 to its reach, shape (m,) [m].
        thickness: Thickness of the cover, over which the pressure varies [m].
        reaction: Force on the whole base.
    """

    pressure: Callable[[FloatArray], FloatArray]
    radius: FloatArray
    thickness: float
    reaction: float

    @property
    def integral(self) -> float:
        """Integral of the pressure over the whole base."""
        return float(2 * np.pi * self._total)

    def on_texels(self, array: TexelArray, places: FloatArray) -> FloatArray:
        """Compute the force on every texel for each position of the axis.

        Args:
            array: Planar array; inactive texels get 0.
            places: k positions of the axis in the frame of the array, shape (k, 2) [m].

        Returns:
            Force on each of n texels, shape (k, n).

        Raises:
            ValueError: If the array is not planar.
        """
        x, y, texel = _find_edges(array)
        corner = self._corners.at(x[:, None] - places[:, :1, None], y - places[:, 1:, None])
        return np.where(array.active, _difference(corner, texel), 0.0)

    def outside(self, array: TexelArray, places: FloatArray) -> FloatArray:
        """Compute the force outside the active texels for each position of the axis, independently of `on_texels`.

        Args:
            array: Planar array.
            places: k positions of the axis in the frame of the array, shape (k, 2) [m].

        Returns:
            Force outside the active texels, shape (k,).
        """
        x, y, vertical, level = _find_outline(array)
        dx, dy = x[:, None] - places[:, :1, None], y - places[:, 1:, None]
        on_texels = (np.diff(self._outlines.at(dx, dy), axis=2) * vertical).sum(axis=(1, 2))
        on_texels += (np.diff(self._outlines.at(dy, dx), axis=1) * level).sum(axis=(1, 2))
        return np.asarray(self.reaction - on_texels)

    def sum_loads(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Sum the base forces over a grid of axes.

        Args:
            array: Planar array with n texels.
            x: Positions of the axes along x in the frame of the array, shape (m,) [m].
            y: Positions of the axes along y, shape (p,) [m].
            loads: Factor on the pressure around each axis, shape (m, p).

        Returns:
            Force on each texel, then the force outside the active texels, shape (n + 1,).
        """
        edges_x, edges_y, texel = _find_edges(array)
        corner = self._corners.sum_loads((edges_x, edges_y), (x, y, loads))
        texels = np.where(array.active, _difference(corner, texel), 0.0)
        edges_x, edges_y, vertical, level = _find_outline(array)
        beside = self._outlines.sum_loads((edges_x, edges_y), (x, y, loads))
        on_texels = (np.diff(beside, axis=1) * vertical).sum()
        beside = self._outlines.sum_loads((edges_y, edges_x), (y, x, loads.T)).T
        on_texels += (np.diff(beside, axis=0) * level).sum()
        return np.append(texels, self.reaction * loads.sum() - on_texels)

    @cached_property
    def _corners(self) -> _OddTable:
        """Integral of the pressure over the rectangle from the axis to (x, y)."""
        edges = _cut_panels(self.thickness, float(self.radius[-1]))
        points, share = gauss_points(edges, 4)
        density = self.pressure(np.hypot(points[:, None], points)) * np.outer(share, share)
        cells = density.reshape(len(edges) - 1, 4, len(edges) - 1, 4).sum(axis=(1, 3))
        total = np.zeros((len(edges), len(edges)))
        total[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
        return _OddTable.tabulate(edges, total)

    @cached_property
    def _outlines(self) -> _OddTable:
        """Force on the triangle of the axis, (x, 0) and (x, y): x times the integral of Q / r^2 from 0 to y."""
        edges = _cut_panels(self.thickness, _FARTHEST * float(self.radius[-1]))
        points, share = gauss_points(edges, 6)
        density = self._enclosed(np.hypot(edges[:, None], points)) * share
        cells = density.reshape(len(edges), -1, 6).sum(axis=2)
        line = np.zeros((len(edges), len(edges)))
        line[:, 1:] = cells.cumsum(axis=1)
        return _OddTable.tabulate(edges, edges[:, None] * line)

    @cached_property
    def _total(self) -> float:
        """Integral of pressure times distance over all distances from the axis."""
        return float(self._within[-1])

    @cached_property
    def _within(self) -> FloatArray:
        """Integral of pressure times distance from the axis to each of `radius`, shape (m,)."""
        points, share = gauss_points(self.radius, 4)
        parts = (share * points * self.pressure(points)).reshape(-1, 4).sum(axis=1)
        return np.append(0.0, parts.cumsum())

    def _enclosed(self, distance: FloatArray) -> FloatArray:
        """Evaluate Q(r) / r^2, half the mean pressure within a circle of radius r."""
        r = np.minimum(distance, self.radius[-1])
        return np.asarray(self._half_mean(r) * (r / np.maximum(distance, r)) ** 2) if distance.size else distance

    @cached_property
    def _half_mean(self) -> CubicSpline:
        """Spline of Q(r) / r^2 from the axis to the reach of the pressure."""
        with np.errstate(invalid="ignore"):
            value = self._within / self.radius**2
        value[0] = float(self.pressure(np.zeros(1))[0]) / 2
        return CubicSpline(self.radius, value, bc_type=("clamped", "not-a-knot"))


def _cut_panels(thickness: float, reach: float) -> FloatArray:
    """Compute the edges of integration panels from 0 to `reach`, equal near the axis and growing away from it [m]."""
    step = thickness / _PER_THICKNESS
    even = np.arange(_EVEN_PANELS + 1) * step
    steps = growing_steps(_PANEL_GROWTH * step, reach - even[-1], lambda step: _PANEL_GROWTH * step)
    edges = np.append(even, even[-1] + np.cumsum(steps))
    edges[-1] = reach
    return edges


def _difference(corner: FloatArray, texel: IntArray) -> FloatArray:
    """Compute integrals over texels from values at the crossings of all edges, shape (..., x edges, y edges)."""
    low_x, high_x, low_y, high_y = texel
    return np.asarray(
        (corner[..., high_x, high_y] - corner[..., low_x, high_y])
        - (corner[..., high_x, low_y] - corner[..., low_x, low_y])
    )


def _find_edges(array: TexelArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Find the distinct positions of the edges of all texels along x and along y.

    Returns:
        Positions along x [m], positions along y [m], and for each of n texels the indices of its low and high edge
        along x, then along y, shape (4, n).

    Raises:
        ValueError: If the array is not planar.
    """
    if not array.planar:
        raise ValueError("a planar cover needs a planar array: all texels at z = 0 looking along +z")
    grain = min(array.texel_size) * _SAME_EDGE
    positions, indices = [], []
    for axis in range(2):
        half = array.texel_size[axis] / 2
        ends = np.concatenate([array.centres[:, axis] - half, array.centres[:, axis] + half])
        _, first, index = np.unique(np.round(ends / grain), return_index=True, return_inverse=True)
        positions.append(ends[first])
        indices += [index[: array.count], index[array.count :]]
    return positions[0], positions[1], np.array(indices)


def _find_outline(array: TexelArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Find the outline of the union of all active texels.

    Returns:
        Positions of the p edges along x and of the q edges along y [m]; and the direction, 1, 0 or -1, in which the
        outline passes each vertical piece between neighbouring crossings, shape (p, q - 1), and each level piece,
        shape (p - 1, q).
    """
    x, y, texel = _find_edges(array)
    covered: BoolArray = np.zeros((len(x) + 1, len(y) + 1), dtype=bool)
    for low_x, high_x, low_y, high_y in texel[:, array.active].T:
        covered[low_x + 1 : high_x + 1, low_y + 1 : high_y + 1] = True
    inside = covered.astype(float)
    vertical = inside[:-1, 1:-1] - inside[1:, 1:-1]
    level = inside[1:-1, :-1] - inside[1:-1, 1:]
    return x, y, vertical, level
