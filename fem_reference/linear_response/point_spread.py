"""Compute the point spread function of a laterally wide cover: texel forces per unit point load on the top.

A wide cover is so large that its edges have no effect, so the base pressure around a point load is axisymmetric
(`axisymmetric.point_spread` solves for it).  Texel forces are integrals of the base pressure over rectangles,
interpolated in a table.

The force on a texel is the sum of four values of a table: the integral of the pressure over the rectangle between the
axis and a corner of the texel.  The force on the union of all active texels follows from a second table, which is
computed independently: the divergence theorem turns it into integrals of Q(r) / r^2 along the outline of the union,
with Q(r) the integral of pressure times distance from 0 to r.  That both agree is a check of both.

Loads on a grid of points are summed without evaluating every point: the coefficients of a table's spline are factorised
by a singular value decomposition, which turns the sum into a few matrix products.

The base forces due to many contact forces are summed by `superpose`.  The response of the base varies smoothly with the
position of a force.  The contact forces are therefore replaced by forces on a regular grid of points that have the same
effect on every polynomial of the position up to degree 5.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.interpolate import BSpline, CubicSpline, RectBivariateSpline

from fem_reference.elements.grading import growing_steps
from fem_reference.elements.line import gauss_points
from fem_reference.grid_convergence import grid_convergence
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class PointSpreadSettings:
    """Constants of the point spread function, of its integrals over texels and of sums of many forces."""

    #: Smallest number of Gauss points along a side of a texel [-].
    least_points: int = 8
    #: Number of equal panels near the axis, in integrals of the base pressure over the distance from the axis [-].
    even_panels: int = 48
    #: Number of equal panels per cover thickness near the axis, in integrals over the distance from the axis [-].
    per_thickness: int = 12
    #: Ratio of the lengths of neighbouring panels farther from the axis [-].
    panel_growth: float = 1.1
    #: Largest distance in the table for integrals along the outline of the texels, over the reach of the pressure [-].
    farthest: float = 300.0
    #: Smallest singular value that is kept in the factorisation of a table of integrals, over the largest one [-].
    rank: float = 1e-11
    #: Distance between texel edges, over the smaller side of a texel, below which the edges count as one [-].
    same_edge: float = 1e-6
    #: Step of the grid to which contact forces are moved for the superposition, over the cover thickness [-].
    grid_step: float = 1 / 8
    #: Number of grid points along each axis to which one contact force is distributed [-].
    stencil: int = 6
    #: Half the distance between the two opposite loads that stand for a shear force, over the cover thickness [-].
    dipole: float = 1e-3


_SETTINGS = PointSpreadSettings()


#: Number of elements through the cover on the three grids; the result is that of the finest grid [-].
GRIDS = (8, 12, 18)


class TexelInfluence(ABC):
    """Solution that gives the texel forces due to point loads anywhere on a cover."""

    #: Gauss points of a uniform pressure on a texel, per cover thickness along the longer side of the texel [-].
    points_per_thickness: ClassVar[int]
    #: Largest order of convergence that explains values on three grids that do not converge monotonically [-].
    unsure_order: ClassVar[float] = 4.0
    #: Thickness of the cover [m].
    thickness: float

    @property
    @abstractmethod
    def on_grids(self) -> Sequence[TexelInfluence]:
        """The solutions on three grids, coarsest first; the last is this solution."""

    @property
    @abstractmethod
    def sizes(self) -> Sequence[float]:
        """Element sizes of the three grids, coarsest first; only their ratios are used [-]."""

    @abstractmethod
    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the force on each of n texels per unit point load at each of k positions, shape (k, n) [-]."""

    @abstractmethod
    def base_forces(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Compute the forces on the base under point loads on a grid of positions.

        Args:
            array: Planar array with n texels; inactive texels get 0.
            x: Positions of the loads along x in the frame of the array, shape (m,) [m].
            y: Positions of the loads along y, shape (p,) [m].
            loads: Load at each position, shape (m, p), or this load and the shear along x and y, shape (3, m, p) [N].

        Returns:
            Force on each texel, then the force outside the active texels, shape (n + 1,) [N].
        """

    def texel_response(
        self, array: TexelArray, load: Literal["point", "uniform"] = "point", texel: int | None = None
    ) -> FloatArray:
        """Compute the force on every texel for a unit load on the cover above one texel.

        Args:
            array: Planar array.
            load: Point load above the centre of the texel, or the same force as uniform pressure over the texel.
            texel: Index of the loaded texel; None for the texel in row `rows // 2`, column `columns // 2`.

        Returns:
            Force on each of n texels, shape (n,) [-].
        """
        centre = array.centres[array.middle if texel is None else texel, :2]
        nodes, weights = np.zeros(1), np.full(1, 2.0)
        if load == "uniform":
            count = int(self.points_per_thickness * max(array.texel_size) / self.thickness)
            nodes, weights = np.polynomial.legendre.leggauss(max(_SETTINGS.least_points, count))
        x, y = centre[:, None] + nodes * np.array(array.texel_size)[:, None] / 2
        return self.base_forces(array, x, y, np.outer(weights, weights) / 4)[:-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSpread(TexelInfluence):
    """Axisymmetric base pressure per unit point load on a laterally wide cover.

    Attributes:
        radius: Horizontal distances of m base points from the load, from 0 to the outer boundary, shape (m,) [m].
        pressure_per_force: Base pressure at these points per unit load, shape (m,) [1/m2].
        reaction: Sum of the base reactions per unit load, 1 except for rounding [-].
        thickness: Thickness of the cover [m].
        coarse: Point spread functions of the coarser grids, coarsest first, for the error estimate.
        shear: Potential of the base pressure under a shear (`vector_compliance.spread_shear`); None without shear.
    """

    radius: FloatArray
    pressure_per_force: FloatArray
    reaction: float
    thickness: float
    coarse: tuple[PointSpread, ...] = ()
    shear: PointSpread | None = None
    points_per_thickness: ClassVar[int] = 6

    @property
    def reach(self) -> float:
        """Distance from the load beyond which the base pressure is set to zero [m]."""
        return float(self.radius[-1])

    def pressure(self, radius: npt.ArrayLike) -> FloatArray:
        """Compute the base pressure per unit load at any distance from the load [m]; zero beyond `reach` [1/m2]."""
        r = np.asarray(radius, dtype=float)
        return np.where(r < self.reach, self._spline(np.minimum(r, self.reach)), 0.0)

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the force on every texel per unit point load at each position.

        Args:
            array: Planar array; inactive texels get 0.
            positions: k positions of the load on the cover, in the frame of the array, shape (k, 2) [m].

        Returns:
            Force on each of n texels per unit load at each position, shape (k, n) [-].

        Raises:
            ValueError: If the array is not planar.
        """
        x, y, texel = _find_edges(array)
        places = np.atleast_2d(np.asarray(positions, dtype=float))
        corner = self._corners.at(x[:, None] - places[:, :1, None], y - places[:, 1:, None])
        return np.where(array.active, _difference(corner, texel), 0.0)

    def base_forces(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Integrate the base pressure over the texels and along their outline, see `TexelInfluence.base_forces`.

        The pressure under a shear is the derivative of the potential, which two opposite loads give.
        """
        if loads.ndim > 2:  # noqa: PLR2004 -- with shear
            out, step = self.base_forces(array, x, y, loads[0]), _SETTINGS.dipole * self.thickness
            if self.shear is not None:
                for move, rise, force in ((step, 0.0, loads[1]), (0.0, step, loads[2])):
                    for sign in (-1, 1):
                        part = -sign * force / (2 * step)
                        out += self.shear.base_forces(array, x + sign * move, y + sign * rise, part)
            return out
        edges_x, edges_y, texel = _find_edges(array)
        corner = self._corners.sum_loads((edges_x, edges_y), (x, y, loads))
        texels = np.where(array.active, _difference(corner, texel), 0.0)
        edges_x, edges_y, vertical, level = _find_outline(array)
        beside = self._outlines.sum_loads((edges_x, edges_y), (x, y, loads))
        on_texels = (np.diff(beside, axis=1) * vertical).sum()
        beside = self._outlines.sum_loads((edges_y, edges_x), (y, x, loads.T)).T
        on_texels += (np.diff(beside, axis=0) * level).sum()
        return np.append(texels, self.reaction * loads.sum() - on_texels)

    def outside(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the part of a unit point load that no active texel measures, by integrals along the texels' outline.

        The integrals do not use `texel_influence`.  The sum of `texel_influence` over the active texels plus this part
        must be 1, which verifies both functions.

        Args:
            array: Planar array.
            positions: k points on the cover in the frame of the array, shape (k, 2) [m].

        Returns:
            Part of the load for each position, shape (k,) [-].
        """
        x, y, vertical, level = _find_outline(array)
        places = np.atleast_2d(np.asarray(positions, dtype=float))
        dx, dy = x[:, None] - places[:, :1, None], y - places[:, 1:, None]
        on_texels = (np.diff(self._outlines.at(dx, dy), axis=2) * vertical).sum(axis=(1, 2))
        on_texels += (np.diff(self._outlines.at(dy, dx), axis=1) * level).sum(axis=(1, 2))
        return np.asarray(self.reaction - on_texels)

    @property
    def on_grids(self) -> tuple[PointSpread, ...]:
        """The solutions on three grids, coarsest first; the last is this solution."""
        return (*self.coarse, self)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Element sizes of the three grids, coarsest first [thicknesses]."""
        return tuple(1 / n for n in GRIDS)

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated relative errors of the response: `total_force`, `peak_texel` and `sigma` [-].

        `peak_texel` is the error of the force on a square texel as wide as the cover is thick, under a point load.
        `sigma`, the width of the response, is represented by the half width of the base pressure.
        """
        grids, sizes = self.on_grids, self.sizes
        patch = TexelArray.grid(1, 1, self.thickness)
        peaks = [float(grid.texel_response(patch)[0]) for grid in grids]
        widths = [grid.half_width for grid in grids]
        return {
            "total_force": abs(float(2 * np.pi * self._within[-1]) - 1),
            "peak_texel": grid_convergence(peaks, sizes) / peaks[-1],
            "sigma": grid_convergence(widths, sizes) / widths[-1],
        }

    @cached_property
    def half_width(self) -> float:
        """Smallest distance from the load at which the base pressure is half that under the load [m].

        The distance is `reach` if the pressure does not fall to half.
        """
        crossings = self._spline.solve(float(self._spline(0.0)) / 2, extrapolate=False)
        return float(crossings.min()) if crossings.size else self.reach

    @cached_property
    def _spline(self) -> CubicSpline:
        """Spline of the base pressure per unit load over the distance from the load [1/m2]."""
        return CubicSpline(self.radius, self.pressure_per_force, bc_type="clamped")

    @cached_property
    def _corners(self) -> _OddTable:
        """Table of the integral of the base pressure over the rectangle from the load to (x, y), per unit load [-]."""
        edges = _cut_panels(self.thickness, float(self.radius[-1]))
        points, share = gauss_points(edges, 4)
        density = self.pressure(np.hypot(points[:, None], points)) * np.outer(share, share)
        cells = density.reshape(len(edges) - 1, 4, len(edges) - 1, 4).sum(axis=(1, 3))
        total = np.zeros((len(edges), len(edges)))
        total[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
        return _OddTable.tabulate(edges, total)

    @cached_property
    def _outlines(self) -> _OddTable:
        """Table of the base force on the triangle with the corners (0, 0), (x, 0) and (x, y), per unit load [-].

        The load is above (0, 0).  The force is x times the integral of Q / r^2 over the other coordinate from 0 to y,
        with Q(r) the integral of pressure times distance from 0 to r.
        """
        edges = _cut_panels(self.thickness, _SETTINGS.farthest * float(self.radius[-1]))
        points, share = gauss_points(edges, 6)
        distance = np.hypot(edges[:, None], points)
        r = np.minimum(distance, self.radius[-1])
        density = self._half_mean(r) * (r / np.maximum(distance, r)) ** 2 * share
        cells = density.reshape(len(edges), -1, 6).sum(axis=2)
        line = np.zeros((len(edges), len(edges)))
        line[:, 1:] = cells.cumsum(axis=1)
        return _OddTable.tabulate(edges, edges[:, None] * line)

    @cached_property
    def _within(self) -> FloatArray:
        """Integral of base pressure times distance from the load, from 0 to each of `radius`, shape (m,) [-]."""
        points, share = gauss_points(self.radius, 4)
        parts = (share * points * self.pressure(points)).reshape(-1, 4).sum(axis=1)
        return np.append(0.0, parts.cumsum())

    @cached_property
    def _half_mean(self) -> CubicSpline:
        """Spline of Q(r) / r^2, half the mean pressure within a circle of radius r, up to the reach of the pressure."""
        with np.errstate(invalid="ignore"):
            value = self._within / self.radius**2
        value[0] = float(self.pressure(np.zeros(1))[0]) / 2
        return CubicSpline(self.radius, value, bc_type=("clamped", "not-a-knot"))


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
        """Create the table of a function from its values on a square grid of positions x, y >= 0.

        The mirror images are part of the interpolation.  Without them it would be least accurate near the axis, where
        narrow texels have all their corners.

        Args:
            edges: Positions along x and along y, from 0, shape (n,) [m].
            values: Values at the grid points, shape (n, n).
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
        """Evaluate the factors of all terms of the factorised table along one axis.

        Args:
            axis: 0 for the factors along x, 1 for those along y.
            offset: Offsets of p points from m loads along the axis, shape (p, m) [m].

        Returns:
            Factors, shape (terms, p, m).
        """
        knots = self.spline.get_knots()[axis]
        value = BSpline(knots, self._factors[axis], 3)(np.minimum(np.abs(offset), self.limit))
        return np.moveaxis(np.sign(offset)[..., None] * value, -1, 0)

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray]:
        """Spline coefficients of the terms f(x) g(y) whose sum is the table, from a singular value decomposition.

        Returns:
            Coefficients of f and of g, shape (coefficients, terms) each.
        """
        knots = self.spline.get_knots()
        matrix = self.spline.get_coeffs().reshape(len(knots[0]) - 4, len(knots[1]) - 4)
        left, size, right = np.linalg.svd(matrix)
        kept = size > _SETTINGS.rank * size[0]
        root = np.sqrt(size[kept])
        return left[:, kept] * root, right[kept].T * root


def _cut_panels(thickness: float, reach: float) -> FloatArray:
    """Compute the edges of integration panels from 0 to `reach`, equal near the axis and growing away from it [m]."""
    step = thickness / _SETTINGS.per_thickness
    even = np.arange(_SETTINGS.even_panels + 1) * step
    steps = growing_steps(_SETTINGS.panel_growth * step, reach - even[-1], lambda step: _SETTINGS.panel_growth * step)
    edges = np.append(even, even[-1] + np.cumsum(steps))
    edges[-1] = reach
    return edges


def _difference(corner: FloatArray, texel: IntArray) -> FloatArray:
    """Compute integrals over texels from a table of integrals over rectangles between the axis and a corner.

    Args:
        corner: Values of the table at the crossings of all edges of texels, shape (..., x edges, y edges).
        texel: Indices of the low and high edge of n texels along x, then along y, shape (4, n).

    Returns:
        Integrals, shape (..., n).
    """
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
    array.require_planar()
    grain = min(array.texel_size) * _SETTINGS.same_edge
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


def superpose(contact: FloatArray, base_response: TexelInfluence, array: TexelArray, pose: Pose) -> FloatArray:
    """Compute the forces on n texels and then the force outside them due to all contact forces, shape (n + 1,) [N].

    Args:
        contact: Columns x, y in the frame of the indenter [m] and force [N] of m cells, shape (m, 3); with friction
            the shear along x and y as well, shape (m, 5).
        base_response: Base forces per unit point load.
        array: Array with n texels.
        pose: Pose of the indenter in the frame of the array.
    """
    x, y, force, *shear = contact.T
    step = base_response.thickness * _SETTINGS.grid_step
    (grid_x, along), (grid_y, across) = (_interpolate(each, step) for each in pose.to_array(x, y))
    forces = [force, *(replace(pose, point=(0.0, 0.0, 0.0)).to_array(*shear) if shear else ())]
    loads = np.array([(along.T @ sp.diags_array(each) @ across).toarray() for each in forces])
    return base_response.base_forces(array, grid_x, grid_y, loads if shear else loads[0])


def _interpolate(places: FloatArray, step: float) -> tuple[FloatArray, sp.csr_array]:
    """Choose a regular grid over m places and interpolate from it, with Lagrange polynomials of degree 5.

    Args:
        places: Positions, shape (m,) [m].
        step: Largest step of the grid [m].

    Returns:
        Points of the grid, shape (g,) [m], and the weight of every point at every place, shape (m, g) [-].
    """
    low, high = float(places.min()), float(places.max())
    count = max(_SETTINGS.stencil, int(np.ceil((high - low) / step)) + 1)
    if not high > low:
        return np.array([low]), sp.csr_array(np.ones((len(places), 1)))
    grid = np.linspace(low, high, count)
    offset = (places - low) / (high - low) * (count - 1)
    first = np.clip(np.floor(offset).astype(int) - _SETTINGS.stencil // 2 + 1, 0, count - _SETTINGS.stencil)
    node = np.arange(_SETTINGS.stencil)
    local = (offset - first)[:, None]
    weight = np.ones((len(places), _SETTINGS.stencil))
    for other in node:
        weight *= np.where(node == other, 1.0, (local - other) / np.where(node == other, 1, node - other))
    row = np.repeat(np.arange(len(places)), _SETTINGS.stencil)
    return grid, sp.csr_array((weight.ravel(), (row, (first[:, None] + node).ravel())), shape=(len(places), count))
