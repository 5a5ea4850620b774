"""Compute the point spread function of a laterally wide cover: texel forces per unit point load on the top.

A wide cover is so large that its edges have no effect, so the base pressure around a point load is axisymmetric.  The
pressure is solved on three grids, and the differences between the grids give the error estimate.  Texel forces are
integrals of the base pressure over rectangles, interpolated in a table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from fem_reference import result_store
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.axisymmetric import solve_point_load
from fem_reference.linear_response.radial_pressure import RadialPressure
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray

#: Number of elements through the cover on the three grids; the result is that of the finest grid [-].
GRIDS = (8, 12, 18)
#: Distance of the outer boundary from the load, over the decay length of the cover's response; the slowest mode of the
#: response has decayed to 1e-5 at this distance [-].
_REACH = 16.0
#: Number of Gauss points along a side of a texel per cover thickness, for uniform pressure on the texel, and smallest
#: number of these points [-].
_TEXEL_POINTS, _LEAST_POINTS = 6, 8


class TexelInfluence(Protocol):
    """Interface of a solution that gives the texel forces due to point loads anywhere on a cover."""

    @property
    def thickness(self) -> float:
        """Thickness of the cover [m]."""

    @property
    def on_grids(self) -> Sequence[TexelInfluence]:
        """The solutions on three grids, coarsest first; the last is this solution."""

    @property
    def sizes(self) -> Sequence[float]:
        """Element sizes of the three grids, coarsest first; only their ratios are used [-]."""

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the force on each of n texels per unit point load at each of k positions, shape (k, n) [-]."""

    def base_forces(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Compute the forces on n texels and outside them under loads on a grid of points, shape (n + 1,) [N]."""


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

    @classmethod
    def unpack(cls, data: Mapping[str, Any], key: str, *, thickness: float, force: float = 1.0) -> PointSpread:
        """Build the base pressure per unit load from arrays that `BaseResponse.pack` returned.

        Args:
            data: Arrays by name.
            key: Suffix of their names.
            thickness: Thickness of the cover [m].
            force: Force under which the stored pressure was computed [N]; 1 if it is per unit load [-].
        """
        return cls(
            radius=data[f"radius_{key}"],
            pressure_per_force=data[f"pressure_{key}"] / force,
            reaction=float(data[f"reaction_{key}"]) / force,
            thickness=thickness,
        )

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
        return self._base.on_texels(array, np.atleast_2d(np.asarray(positions, dtype=float)))

    def base_forces(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Compute the forces on the base under point loads on a grid of positions.

        Args:
            array: Planar array with n texels; inactive texels get 0.
            x: Positions of the loads along x in the frame of the array, shape (m,) [m].
            y: Positions of the loads along y, shape (p,) [m].
            loads: Load at each position, shape (m, p) [N].

        Returns:
            Force on each texel, then the force outside the active texels, shape (n + 1,) [N].
        """
        return self._base.sum_loads(array, x, y, loads)

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
        return self._base.outside(array, np.atleast_2d(np.asarray(positions, dtype=float)))

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
            "total_force": abs(self._base.integral - 1),
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
    def _base(self) -> RadialPressure:
        """Integrals of the base pressure per unit load over texels."""
        return RadialPressure(
            pressure=self.pressure, radius=self.radius, thickness=self.thickness, reaction=self.reaction
        )


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
            out |= response.pack(f"{n}", reach)
        return out

    data = result_store.fetch("point-spread", {"cover": cover, "reach": reach, "grids": GRIDS}, compute)
    *coarse, finest = (PointSpread.unpack(data, f"{n}", thickness=cover.thickness) for n in GRIDS)
    return replace(finest, coarse=tuple(coarse))


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
    nodes, weights = np.zeros(1), np.full(1, 2.0)
    if load == "uniform":
        count = max(_LEAST_POINTS, int(points_per_thickness * max(array.texel_size) / source.thickness))
        nodes, weights = np.polynomial.legendre.leggauss(count)
    x, y = centre[:, None] + nodes * np.array(array.texel_size)[:, None] / 2
    return source.base_forces(array, x, y, np.outer(weights, weights) / 4)[:-1]
