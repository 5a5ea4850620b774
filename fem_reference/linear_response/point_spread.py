"""Compute the point spread function of a laterally wide cover: texel forces per unit point load on the top.

A wide cover is so large that its edges have no effect, so the base pressure around a point load is axisymmetric.  The
pressure is solved on three grids, and the differences between the grids give the error estimate.  Texel forces are
integrals of the base pressure over rectangles, interpolated in a table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, RectBivariateSpline

from fem_reference import result_store
from fem_reference.elements.grading import growing_steps
from fem_reference.elements.line import gauss_points
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.axisymmetric import solve_point_load
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Cover, TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Number of elements through the cover on the three grids; the result is that of the finest grid [-].
GRIDS = (8, 12, 18)
#: Distance of the outer boundary from the load, over the decay length of the cover's response; the slowest mode of the
#: response has decayed to 1e-5 at this distance [-].
_REACH = 16.0
#: Panels for integrals of the base pressure over the distance from the load: number of equal panels near the load,
#: number of these per cover thickness, and ratio of neighbouring panels farther away [-].
_EVEN_PANELS, _PER_THICKNESS, _PANEL_GROWTH = 32, 8, 1.1
#: Number of parts into which each panel is divided for integrals over circles.  The part of a circle on active texels
#: has a kink, as a function of the radius, wherever the circle touches a texel edge [-].
_CUTS = 4
#: Number of Gauss points along a side of a texel per cover thickness, for uniform pressure on the texel, and smallest
#: number of these points [-].
_TEXEL_POINTS, _LEAST_POINTS = 6, 8
#: Distance between texel corners, over the smaller side of a texel, below which the corners count as one point [-].
_SAME_CORNER = 1e-6


class TexelInfluence(Protocol):
    """Interface of a solution that gives the texel forces due to point loads anywhere on a cover."""

    @property
    def thickness(self) -> float:
        """Thickness of the cover [m]."""

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the force on each of n texels per unit point load at each of k positions, shape (k, n) [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSpread:
    """Axisymmetric base pressure per unit point load on a laterally wide cover.

    Attributes:
        radius: Horizontal distances of m base points from the load, from 0 to the outer boundary, shape (m,) [m].
        pressure_per_force: Base pressure at these points per unit load, shape (m,) [1/m2].
        reaction: Sum of the base reactions per unit load, 1 except for rounding [-].
        thickness: Thickness of the cover [m].
        coarse: Point spread functions of the coarser grids, coarsest first, for the error estimate.
    """

    radius: FloatArray
    pressure_per_force: FloatArray
    reaction: float
    thickness: float
    coarse: tuple[PointSpread, ...] = ()

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
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        corners, index = _find_corners(array)
        volume = self._integrate_corner(corners[:, 0] - place[:, :1], corners[:, 1] - place[:, 1:])
        low_low, high_low, low_high, high_high = (volume[:, index[:, i]] for i in range(4))
        return np.asarray(np.where(array.active, high_high - high_low - low_high + low_low, 0.0))

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
        return load_texel(self, array, load, texel, points_per_thickness=_TEXEL_POINTS)

    def outside(self, array: TexelArray, positions: npt.ArrayLike, *, angles: int = 360) -> FloatArray:
        """Compute the part of a unit point load that no active texel measures, by quadrature over circles.

        The circles are centred on the load.  The quadrature does not use `texel_influence`.  The sum of
        `texel_influence` over the active texels plus this part must be 1, which verifies both functions.

        Args:
            array: Planar array.
            positions: k points on the cover in the frame of the array, shape (k, 2) [m].
            angles: Number of points on each circle [-].

        Returns:
            Part of the load for each position, shape (k,) [-].
        """
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        radius, ring = self._rings
        # A different first angle on each circle makes the quadrature errors of the circles cancel.
        turn = np.arange(radius.size)[:, None] * (np.sqrt(5) - 1) / 2
        angle = 2 * np.pi * ((np.arange(angles) + turn) / angles)
        x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
        x_edges, y_edges, active = _map_active_cells(array)
        on_texels = [
            ring @ active[np.searchsorted(x_edges, x + place_x), np.searchsorted(y_edges, y + place_y)].mean(axis=1)
            for place_x, place_y in place
        ]
        return self.reaction - np.array(on_texels)

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated relative errors of the response: `total_force`, `peak_texel` and `sigma` [-].

        `peak_texel` is the error of the force on a square texel as wide as the cover is thick, under a point load.
        `sigma`, the width of the response, is represented by the half width of the base pressure.
        """
        grids = (*self.coarse, self)
        sizes = [1 / n for n in GRIDS]
        patch = TexelArray.grid(1, 1, self.thickness)
        peaks = [float(grid.texel_response(patch)[0]) for grid in grids]
        widths = [grid.half_width for grid in grids]
        return {
            "total_force": abs(float(self._rings[1].sum()) - 1),
            "peak_texel": grid_convergence(peaks, sizes) / peaks[-1],
            "sigma": grid_convergence(widths, sizes) / widths[-1],
        }

    @cached_property
    def half_width(self) -> float:
        """Distance from the load at which the base pressure is half its peak [m]."""
        radius = np.linspace(0, 4 * self.thickness, 4001)
        value = self.pressure(radius) / self.pressure(0.0)
        first = int(np.argmax(value < 0.5))  # noqa: PLR2004 -- half
        return float(np.interp(0.5, value[[first, first - 1]], radius[[first, first - 1]]))

    @cached_property
    def _spline(self) -> CubicSpline:
        """Spline of the base pressure per unit load over the distance from the load [1/m2]."""
        return CubicSpline(self.radius, self.pressure_per_force, bc_type="clamped")

    @cached_property
    def _rings(self) -> tuple[FloatArray, FloatArray]:
        """Radii of the circles of a quadrature around the load [m], and the part of the load on each circle [-]."""
        panels = _cut_panels(self.thickness, self.reach)
        count = _CUTS * (len(panels) - 1) + 1
        edges = np.interp(np.arange(count) / _CUTS, np.arange(len(panels)), panels)
        radius, weight = gauss_points(edges, 6)
        return radius, weight * 2 * np.pi * radius * self.pressure(radius)

    def _integrate_corner(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Integrate the base pressure over the rectangle from the load to (x, y); the result is odd in x and y [-]."""
        limit = self.reach
        value = self._cumulative.ev(np.minimum(np.abs(x), limit), np.minimum(np.abs(y), limit))
        return np.asarray(np.sign(x) * np.sign(y) * value)

    @cached_property
    def _cumulative(self) -> RectBivariateSpline:
        """Spline of the integral of the base pressure over the rectangle from the load to (x, y), x and y >= 0 [-]."""
        edges = _cut_panels(self.thickness, self.reach)
        points, share = gauss_points(edges, 4)
        density = self.pressure(np.hypot(points[:, None], points)) * np.outer(share, share)
        cells = density.reshape(len(edges) - 1, 4, len(edges) - 1, 4).sum(axis=(1, 3))
        total = np.zeros((len(edges), len(edges)))
        total[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
        return RectBivariateSpline(edges, edges, total)


def point_spread(cover: Cover, *, progress: Callable[[str], None] | None = None) -> PointSpread:
    """Solve for the point spread function of a cover on three grids, or read it from the result store.

    Args:
        cover: Laterally wide cover; hyperelastic materials are linearised at zero load.
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If the cover has free side edges.
    """
    if cover.size is not None:
        raise ValueError("free side edges are not supported by the axisymmetric solve; leave out cover.size")
    reach = _REACH * decay_length(cover)

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        for n in GRIDS:
            if progress is not None:
                progress(f"axisymmetric solve, {n} elements through the cover")
            response = solve_point_load(cover, elements_per_thickness=n, reach=reach)
            for name, values in response.extend(reach).items():
                out[f"{name}_{n}"] = values
        return out

    data = result_store.fetch("point-spread", {"cover": cover, "reach": reach, "grids": GRIDS}, compute)
    grids: list[PointSpread] = []
    for n in GRIDS:
        grids.append(
            PointSpread(
                radius=data[f"radius_{n}"],
                pressure_per_force=data[f"pressure_{n}"],
                reaction=float(data[f"reaction_{n}"]),
                thickness=cover.thickness,
                coarse=tuple(grids) if n == GRIDS[-1] else (),
            )
        )
    return grids[-1]


def load_texel(
    source: TexelInfluence,
    array: TexelArray,
    load: Literal["point", "uniform"],
    texel: int | None,
    *,
    points_per_thickness: int,
) -> FloatArray:
    """Compute the force on every texel for a unit load on the cover above one texel.

    Args:
        source: Solution that gives the texel forces due to point loads.
        array: Planar array.
        load: Point load above the centre of the texel, or the same force as uniform pressure over the texel.
        texel: Index of the loaded texel; None for the texel in row `rows // 2`, column `columns // 2`.
        points_per_thickness: Number of Gauss points of the uniform pressure, per cover thickness along the longer side
            of the texel [-].

    Returns:
        Force on each of n texels, shape (n,) [-].
    """
    centre = array.centres[array.middle if texel is None else texel, :2]
    if load == "point":
        return np.asarray(source.texel_influence(array, centre)[0])
    count = max(_LEAST_POINTS, int(points_per_thickness * max(array.texel_size) / source.thickness))
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x, y = np.meshgrid(nodes * array.texel_size[0] / 2, nodes * array.texel_size[1] / 2)
    share = np.outer(weights, weights).ravel() / 4
    return np.asarray(share @ source.texel_influence(array, centre + np.column_stack([x.ravel(), y.ravel()])))


def _cut_panels(thickness: float, reach: float) -> FloatArray:
    """Compute the edges of integration panels from 0 to `reach`, equal near the load and growing away from it [m]."""
    step = thickness / _PER_THICKNESS
    even = np.arange(_EVEN_PANELS + 1) * step
    steps = growing_steps(_PANEL_GROWTH * step, reach - even[-1], lambda step: _PANEL_GROWTH * step)
    edges = np.append(even, even[-1] + np.cumsum(steps))
    edges[-1] = reach
    return edges


def _find_corners(array: TexelArray) -> tuple[FloatArray, IntArray]:
    """Find the c distinct corners of the n texels of an array.

    Returns:
        Positions of the corners, shape (c, 2) [m], and indices of the four corners of each texel, shape (n, 4), in the
        order low x and low y, high x and low y, low x and high y, high x and high y.
    """
    if not array.planar:
        raise ValueError("a planar cover needs a planar array: all texels at z = 0 looking along +z")
    half = np.array(array.texel_size) / 2
    signs = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])
    every = array.centres[:, None, :2] + signs * half
    grain = min(array.texel_size) * _SAME_CORNER
    _, first, inverse = np.unique(
        np.round(every.reshape(-1, 2) / grain), axis=0, return_index=True, return_inverse=True
    )
    return every.reshape(-1, 2)[first], inverse.reshape(-1, 4)


def _map_active_cells(array: TexelArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Divide the plane of an array by all edges of active texels into rectangles, and mark those on active texels.

    Returns:
        Edges along x [m], edges along y [m], and whether each rectangle between them lies on an active texel, with one
        more row and column on each side, so that `searchsorted` of a position gives the index of its rectangle.
    """
    grain = min(array.texel_size) * _SAME_CORNER
    low = np.round((array.centres[array.active, :2] - np.array(array.texel_size) / 2) / grain)
    high = np.round((array.centres[array.active, :2] + np.array(array.texel_size) / 2) / grain)
    edges = [np.unique(np.r_[low[:, axis], high[:, axis]]) for axis in range(2)]
    first, last = (np.stack([np.searchsorted(edges[axis], side[:, axis]) for axis in range(2)]) for side in (low, high))
    cells = np.zeros((edges[0].size + 1, edges[1].size + 1), dtype=bool)
    for x_low, y_low, x_high, y_high in zip(*first, *last, strict=True):
        cells[x_low + 1 : x_high + 1, y_low + 1 : y_high + 1] = True
    return edges[0] * grain, edges[1] * grain, cells
