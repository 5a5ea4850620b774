"""Covers with free side edges in three dimensions: what a load anywhere on top puts on every texel.

The dual problem is solved: lift the base under one texel by a unit and let the top move freely; by reciprocity (Betti)
the lift of the top at a place is the force on that texel per unit normal load at that place.  One solution per texel so
serves every load.  The texel's indicator is lifted as its L2 projection onto the base functions, which is the same as
recovering a continuous base pressure from the reactions and integrating it over the texel; all texels and the rest of
the base then add up to the load to rounding.

A rectangular cover is its own mirror image, so only a quarter is solved, once for each of the four parities of the
answer in x and y; a texel and its mirror images share a solution, and a square cover solves two mixed parities as one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference import result_store
from fem_reference.elements.line import Line, line_matrix
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.mirror_symmetry import (
    PARITIES,
    MirroredTexels,
    Resolution,
    mirror_held,
    quarter_solid,
)
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Cover, TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: The three grids; the last one is the answer.
GRIDS = (
    Resolution(across=1.5, through=2),
    Resolution(across=2.25, through=3),
    Resolution(across=3.4, through=4),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelLifts:
    """Lift of the top of a quarter of the cover, of one grid.

    Attributes:
        x: Functions along x, from the middle to the side [thicknesses].
        y: Functions along y.
        lift: For each parity and each pair of texel columns and rows, at every top node, shape (4, k, x, y) [-].
        whole: The same when the whole base is lifted, 1 up to rounding, shape (x, y) [-].
        unknowns: Unknowns of the quarter [-].
    """

    x: Line
    y: Line
    lift: FloatArray
    whole: FloatArray
    unknowns: int


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidInfluence:
    """Forces on the texels of one array per unit load on its cover.

    Attributes:
        cover: The cover.
        array: The array that was solved for; others with the same texels may be asked about.
        grids: The solutions, coarsest first; the last one is the answer.
    """

    cover: Cover
    array: TexelArray
    grids: tuple[TexelLifts, ...]

    @property
    def thickness(self) -> float:
        """Thickness of the cover [m]."""
        return self.cover.thickness

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Force on every texel per unit point load at each position.

        Args:
            array: The array that was solved for; its mask may differ, and masked texels get 0.
            positions: Places on the cover in the array's frame, shape (k, 2) [m].

        Returns:
            Shape (k, n) [-].

        Raises:
            ValueError: If the array has other texels or a position is not on the cover.
        """
        self._check(array)
        return np.where(array.active, self._influence(self.grids[-1], self._places(positions)), 0.0)

    def texel_response(
        self, array: TexelArray, load: Literal["point", "uniform"] = "point", texel: int | None = None
    ) -> FloatArray:
        """Force on every texel for a unit load over one texel.

        Args:
            array: The array that was solved for; its mask may differ, and masked texels get 0.
            load: A point load over the texel's centre, or the same force as uniform pressure over the texel.
            texel: Which texel; `[rows // 2, columns // 2]` when not given.

        Returns:
            Shape (n,) [-].
        """
        centre = array.centres[array.middle if texel is None else texel, :2]
        if load == "point":
            return np.asarray(self.texel_influence(array, centre)[0])
        self._check(array)
        nodes, weights = np.polynomial.legendre.leggauss(max(8, int(12 * max(array.texel_size) / self.thickness)))
        x, y = np.meshgrid(nodes * array.texel_size[0] / 2, nodes * array.texel_size[1] / 2)
        share = np.outer(weights, weights).ravel() / 4
        return np.asarray(share @ self.texel_influence(array, centre + np.column_stack([x.ravel(), y.ravel()])))

    def outside(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Share of a unit point load that no active texel feels: the answer of the whole base less that of the texels.

        Args:
            array: The array that was solved for; its mask may differ.
            positions: Places on the cover in the array's frame, shape (k, 2) [m].

        Returns:
            Shape (k,) [-].
        """
        places = self._places(positions)
        grid = self.grids[-1]
        x, y = np.abs(places / self.thickness).T
        whole = np.einsum("kx,ky,xy->k", grid.x.at(x), grid.y.at(y), grid.whole, optimize=True)
        return np.asarray(whole - self.texel_influence(array, places).sum(axis=1))

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated relative errors: `total_force`, `peak_texel` (of every texel under its own centre), `sigma`."""
        sizes = [1 / resolution.across for resolution in GRIDS]
        centres = self.array.centres[:, :2]
        own = np.array([np.diag(self._influence(grid, centres)) for grid in self.grids])
        widths = [self._half_width(grid) for grid in self.grids]
        errors = [grid_convergence(list(values), sizes) for values in own.T]
        return {
            "total_force": float(np.abs(self.grids[-1].whole - 1).max()),
            "peak_texel": max(errors) / float(own[-1].max()),
            "sigma": grid_convergence(widths, sizes) / widths[-1],
        }

    def _half_width(self, grid: TexelLifts) -> float:
        """Distance along x at which the middle texel's influence has fallen to half of that at its centre [m]."""
        centre = self.array.centres[self.array.middle, :2]
        reach = np.linspace(0, self.array.texel_size[0] / 2 + 2 * self.thickness, 400)
        side = -np.sign(centre[0]) or 1.0  # towards the middle of the cover
        places = centre + np.column_stack([side * reach, np.zeros(len(reach))])
        places = places[np.abs(places[:, 0]) <= grid.x.edges[-1] * self.thickness]
        value = self._influence(grid, places)[:, self.array.middle]
        first = int(np.argmax(value < value[0] / 2))
        return float(np.interp(-value[0] / 2, -value[[first - 1, first]], reach[[first - 1, first]]))

    def _influence(self, grid: TexelLifts, places: FloatArray) -> FloatArray:
        """All texels, masked or not, shape (k, n) [-]."""
        texels = MirroredTexels.of(self.array, self.thickness)
        x, y = grid.x.at(np.abs(places[:, 0]) / self.thickness), grid.y.at(np.abs(places[:, 1]) / self.thickness)
        side = np.where(places < 0, -1.0, 1.0)
        out = np.zeros((len(places), self.array.count))
        for parity, lift in zip(PARITIES, grid.lift, strict=True):
            value = np.einsum("kx,ky,pxy->kp", x, y, lift, optimize=["einsum_path", (0, 2), (0, 1)])
            sign = (side**parity).prod(axis=1)[:, None] * (texels.side**parity).prod(axis=1)
            out += sign * value[:, texels.pair]
        return out

    def _places(self, positions: npt.ArrayLike) -> FloatArray:
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        half = np.array([self.grids[-1].x.edges[-1], self.grids[-1].y.edges[-1]]) * self.thickness
        if (np.abs(place) > half * (1 + 1e-9)).any():
            width, height = 2e3 * half
            raise ValueError(f"a position lies beyond the cover, which is {width:.4g} x {height:.4g} mm")
        return place

    def _check(self, array: TexelArray) -> None:
        mine = self.array
        if array is mine:
            return
        same = array.centres.shape == mine.centres.shape and np.allclose(array.centres, mine.centres, atol=1e-9)
        if not same or not np.allclose(array.texel_size, mine.texel_size):
            raise ValueError("this solution is of another array; solve for this one with solid_influence(cover, array)")


def solid_influence(
    cover: Cover, array: TexelArray, *, progress: Callable[[str], None] | None = None
) -> SolidInfluence:
    """Solve for the influence of loads anywhere on every texel on three grids; results are kept in the store.

    Args:
        cover: Layers, bonded or sliding, with free side edges at `size`, its middle over the array's origin.  A wide
            cover is cut far beyond the array.  Hyperelastic materials are linearised at zero load.
        array: A planar array.  Parts of texels that the cover does not cover feel nothing.
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If the array is not planar.
    """
    if not array.planar:
        raise ValueError("a planar cover needs a planar array: all texels at z = 0 looking along +z")

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        for number, resolution in enumerate(GRIDS):
            if progress is not None:
                progress(f"solid, {resolution.through} elements through the cover")
            found = texel_lifts(cover, array, resolution)
            out |= {f"lift_{number}": found.lift, f"whole_{number}": found.whole, f"unknowns_{number}": found.unknowns}
        return out

    texels = {"centres": array.centres, "texel_size": array.texel_size}
    grids = [(r.across, r.through, r.order) for r in GRIDS]
    data = result_store.fetch("solid-influence", {"cover": cover, "texels": texels, "grids": grids}, compute)
    found = []
    for number, resolution in enumerate(GRIDS):
        x, y, _ = quarter_solid(cover, array, resolution).lines
        lift, whole = data[f"lift_{number}"], data[f"whole_{number}"]
        found.append(TexelLifts(x=x, y=y, lift=lift, whole=whole, unknowns=int(data[f"unknowns_{number}"])))
    return SolidInfluence(cover=cover, array=array, grids=tuple(found))


def texel_lifts(cover: Cover, array: TexelArray, resolution: Resolution) -> TexelLifts:
    """Solve on one grid.

    Args:
        cover: Layers with or without free side edges.
        array: A planar array.
        resolution: How fine the grid is.
    """
    solid = quarter_solid(cover, array, resolution)
    texels = MirroredTexels.of(array, cover.thickness)
    x, y, _ = solid.lines
    swapped = texels.swapped if np.array_equal(x.edges, y.edges) else None
    upper = solid.upper()
    factors: SymmetricFactors | None = None
    lift = np.zeros((len(PARITIES), len(texels.pairs), x.count, y.count))
    whole = np.ones((x.count, y.count))
    for number, parity in enumerate(PARITIES):
        if parity == (1, 0) and swapped is not None:
            lift[number] = lift[PARITIES.index((0, 1))][swapped].transpose(0, 2, 1)
            continue
        base = [_projected(line, texels.spans[axis], parity[axis]) for axis, line in enumerate((x, y))]
        chosen = np.arange(len(texels.pairs))
        if swapped is not None and parity[0] == parity[1]:
            chosen = chosen[swapped >= chosen]
        lifted = [base[axis][texels.pairs[chosen, axis]] for axis in (0, 1)]
        if parity == (0, 0):
            lifted = [np.vstack([part, np.ones(part.shape[1])]) for part in lifted]
        if not all(part.any() for part in lifted):
            continue  # one row or column in the middle: nothing is odd
        values, held = mirror_held(solid, upper, parity, sliding=cover.base == "sliding")
        if factors is None:
            factors = SymmetricFactors(sp.csr_matrix((values, upper.indices, upper.indptr), shape=upper.shape))
        else:
            factors.refactor(values)
        load = -solid.lifted(*lifted)
        load[held] = 0.0
        top = _top(solid, factors.solve(load))
        if parity == (0, 0):
            whole = top[-1]
        lift[number, chosen] = top[: len(chosen)]
        if swapped is not None and parity[0] == parity[1]:
            lift[number, swapped[chosen]] = top[: len(chosen)].transpose(0, 2, 1)
    return TexelLifts(x=x, y=y, lift=lift, whole=whole, unknowns=upper.shape[0])


def _projected(line: Line, spans: FloatArray, odd: int) -> FloatArray:
    """Nodal values of the L2 projections of the even or odd parts of indicators of spans, shape (m, nodes)."""
    mirror = -1.0 if odd else 1.0
    load = np.array([line.integral(low, high) + mirror * line.integral(-high, -low) for low, high in spans]) / 2
    mass = line_matrix(line, line).toarray()
    out = np.zeros_like(load)
    out[:, odd:] = np.linalg.solve(mass[odd:, odd:], load[:, odd:].T).T
    return out


def _top(solid: TensorSolid, solution: FloatArray) -> FloatArray:
    """Displacement along z of the top nodes, shape (k, x, y)."""
    normal = solution[solid.offsets[2] : solid.offsets[3]].reshape(*solid.field_shape(2), -1)
    return np.ascontiguousarray(normal[:, :, -1].transpose(2, 0, 1))
