"""Point spread function of a planar cover: what a unit point load on the top puts on the texels below."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, RectBivariateSpline

from fem_reference import result_store
from fem_reference.elements.grading import growing_steps
from fem_reference.elements.line import gauss_points
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.axisymmetric import BaseResponse, point_load_response
from meshes import Cover, TexelArray

FloatArray = npt.NDArray[np.float64]

#: Elements through the thickness of the three grids; the last one is the answer.
GRIDS = (8, 12, 18)
#: The outer boundary stands at this many decay lengths; the slowest mode has fallen to 1e-5 of itself there.
_REACH = 16.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSpread:
    """Axisymmetric base pressure per unit point load on a laterally wide cover.

    Attributes:
        radius: Distances from the load along the base, from 0 to where nothing moves any more, shape (m,) [m].
        pressure_per_force: Base pressure there, per unit load, shape (m,) [1/m2].
        reaction: Sum of the base reactions per unit load; 1 up to the solver's rounding [-].
        thickness: Thickness of the cover [m].
        coarse: The same on the coarser grids, coarsest first.
    """

    radius: FloatArray
    pressure_per_force: FloatArray
    reaction: float
    thickness: float
    coarse: tuple[PointSpread, ...] = ()

    @property
    def reach(self) -> float:
        """Distance beyond which the response is zero [m]."""
        return float(self.radius[-1])

    def pressure(self, radius: npt.ArrayLike) -> FloatArray:
        """Base pressure per unit load at any distance, zero beyond `reach` [1/m2]."""
        r = np.asarray(radius, dtype=float)
        return np.where(r < self.reach, self._spline(np.minimum(r, self.reach)), 0.0)

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Force on every texel per unit point load at each position.

        Args:
            array: A planar array; masked texels get 0.
            positions: Places on the cover in the array's frame, shape (k, 2) [m].

        Returns:
            Shape (k, n) [-].

        Raises:
            ValueError: If the array is not planar.
        """
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        corners, index = _corners(array)
        volume = self._corner_integral(corners[:, 0] - place[:, :1], corners[:, 1] - place[:, 1:])
        low_low, high_low, low_high, high_high = (volume[:, index[:, i]] for i in range(4))
        return np.asarray(np.where(array.active, high_high - high_low - low_high + low_low, 0.0))

    def texel_response(
        self, array: TexelArray, load: Literal["point", "uniform"] = "point", texel: int | None = None
    ) -> FloatArray:
        """Force on every texel for a unit load over one texel.

        Args:
            array: A planar array.
            load: A point load over the texel's centre, or the same force as uniform pressure over the texel.
            texel: Which texel; `[rows // 2, columns // 2]` when not given.

        Returns:
            Shape (n,) [-].
        """
        centre = array.centres[array.middle if texel is None else texel, :2]
        if load == "point":
            return np.asarray(self.texel_influence(array, centre)[0])
        nodes, weights = np.polynomial.legendre.leggauss(max(8, int(6 * max(array.texel_size) / self.thickness)))
        x, y = np.meshgrid(nodes * array.texel_size[0] / 2, nodes * array.texel_size[1] / 2)
        share = np.outer(weights, weights).ravel() / 4
        return np.asarray(share @ self.texel_influence(array, centre + np.column_stack([x.ravel(), y.ravel()])))

    def outside(self, array: TexelArray, positions: npt.ArrayLike, *, angles: int = 360) -> FloatArray:
        """Share of a unit point load that no active texel feels, by quadrature over circles around the load.

        Independent of `texel_influence`: the two add up to 1 only if both are right.

        Args:
            array: A planar array.
            positions: Places on the cover in the array's frame, shape (k, 2) [m].
            angles: Points on each circle [-].

        Returns:
            Shape (k,) [-].
        """
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        radius, ring = self._rings
        turn = np.arange(radius.size)[:, None] * (np.sqrt(5) - 1) / 2  # each circle starts elsewhere, so errors cancel
        angle = 2 * np.pi * ((np.arange(angles) + turn) / angles)
        x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
        x_edges, y_edges, active = _membership(array)
        felt = [
            ring @ active[np.searchsorted(x_edges, x + place_x), np.searchsorted(y_edges, y + place_y)].mean(axis=1)
            for place_x, place_y in place
        ]
        return self.reaction - np.array(felt)

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated relative errors: `total_force`, `peak_texel` (one texel wide as the cover is thick), `sigma`."""
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
        """Distance at which the pressure has fallen to half its peak [m]."""
        radius = np.linspace(0, 4 * self.thickness, 4001)
        value = self.pressure(radius) / self.pressure(0.0)
        first = int(np.argmax(value < 0.5))  # noqa: PLR2004 -- half
        return float(np.interp(0.5, value[[first, first - 1]], radius[[first, first - 1]]))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.radius, self.pressure_per_force, bc_type="clamped")

    @cached_property
    def _rings(self) -> tuple[FloatArray, FloatArray]:
        """Gauss radii [m] and the share of the load on each ring [-].

        Panels are cut in four: the part of a circle on active texels has a kink wherever the circle touches an edge.
        """
        panels = _panels(self.thickness, self.reach)
        edges = np.interp(np.arange(4 * len(panels) - 3) / 4, np.arange(len(panels)), panels)
        radius, weight = gauss_points(edges, 6)
        return radius, weight * 2 * np.pi * radius * self.pressure(radius)

    def _corner_integral(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Integral of the pressure over the rectangle from the load to (x, y), odd in both [-]."""
        limit = self.reach
        value = self._cumulative.ev(np.minimum(np.abs(x), limit), np.minimum(np.abs(y), limit))
        return np.asarray(np.sign(x) * np.sign(y) * value)

    @cached_property
    def _cumulative(self) -> RectBivariateSpline:
        edges = _panels(self.thickness, self.reach)
        points, share = gauss_points(edges, 4)
        density = self.pressure(np.hypot(points[:, None], points)) * np.outer(share, share)
        cells = density.reshape(len(edges) - 1, 4, len(edges) - 1, 4).sum(axis=(1, 3))
        total = np.zeros((len(edges), len(edges)))
        total[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
        return RectBivariateSpline(edges, edges, total)


def point_spread(cover: Cover, *, progress: Callable[[str], None] | None = None) -> PointSpread:
    """Solve for the point spread function on three grids; results are kept in the store.

    Args:
        cover: A laterally wide cover; hyperelastic materials are linearised at zero load.
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
            response = point_load_response(cover, elements_per_thickness=n, reach=reach)
            for name, values in closed(response, reach).items():
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


def decay_length(cover: Cover) -> float:
    """Length over which a point load's answer dies away: the thickness, or a stiff layer's bending length [m].

    Layers above each interface bend as a plate of stiffness sum E t^3 / 12 (1 - nu^2) on springs of stiffness E / t in
    series (Timoshenko and Woinowsky-Krieger, section 57: characteristic length (D / k)^(1/4)).
    """
    lengths = [cover.thickness]
    for split in range(1, len(cover.layers)):
        below, above = cover.layers[:split], cover.layers[split:]
        springs = 1 / sum(layer.thickness / layer.material.youngs_modulus for layer in below)
        plate = sum(
            layer.material.youngs_modulus * layer.thickness**3 / (12 * (1 - layer.material.poisson_ratio**2))
            for layer in above
        )
        lengths.append((plate / springs) ** 0.25)
    return max(lengths)


def closed(response: BaseResponse, reach: float) -> dict[str, Any]:
    """Extend the response to the axis by symmetry and to zero at the outer boundary."""
    r, p = response.radius, response.pressure
    even = CubicSpline(np.r_[-r[3::-1], r[:4]], np.r_[p[3::-1], p[:4]])
    return {
        "radius": np.r_[0.0, r, reach],
        "pressure": np.r_[even(0.0), p, 0.0],
        "reaction": response.reaction,
    }


def _panels(thickness: float, reach: float) -> FloatArray:
    """Panel edges from 0 to `reach` that resolve the response: even to 4 thicknesses, then growing [m]."""
    step = thickness / 8
    even = np.arange(33) * step
    edges = np.append(even, even[-1] + np.cumsum(growing_steps(1.1 * step, reach - even[-1], lambda step: 1.1 * step)))
    edges[-1] = reach
    return edges


def _corners(array: TexelArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Distinct texel corners, shape (c, 2) [m], and the (low, low), (high, low), (low, high), (high, high) of each."""
    if not array.planar:
        raise ValueError("a planar cover needs a planar array: all texels at z = 0 looking along +z")
    half = np.array(array.texel_size) / 2
    signs = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])
    every = array.centres[:, None, :2] + signs * half
    grain = min(array.texel_size) * 1e-6
    _, first, inverse = np.unique(
        np.round(every.reshape(-1, 2) / grain), axis=0, return_index=True, return_inverse=True
    )
    return every.reshape(-1, 2)[first], inverse.reshape(-1, 4)


def _membership(array: TexelArray) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Every texel edge along x and along y [m], and whether each cell between them lies on an active texel.

    The cells are padded by one on each side, so that `searchsorted` of any place among the edges is its cell.
    """
    grain = min(array.texel_size) * 1e-6
    low = np.round((array.centres[array.active, :2] - np.array(array.texel_size) / 2) / grain)
    high = np.round((array.centres[array.active, :2] + np.array(array.texel_size) / 2) / grain)
    edges = [np.unique(np.r_[low[:, axis], high[:, axis]]) for axis in range(2)]
    first, last = (np.stack([np.searchsorted(edges[axis], side[:, axis]) for axis in range(2)]) for side in (low, high))
    cells = np.zeros((edges[0].size + 1, edges[1].size + 1), dtype=bool)
    for x_low, y_low, x_high, y_high in zip(*first, *last, strict=True):
        cells[x_low + 1 : x_high + 1, y_low + 1 : y_high + 1] = True
    return edges[0] * grain, edges[1] * grain, cells
