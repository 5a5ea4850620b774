"""Compute the texel forces per unit load anywhere on a cover with free side edges, in three dimensions.

The adjoint problem is solved: the base under one texel is displaced upwards by a unit while the top is free.  By
reciprocity (Betti) the upward displacement of a point of the top is the force on this texel per unit normal load on
this point, and the displacement against x or y that per unit shear along x or y.  One solution per texel is therefore
sufficient for all loads.  The prescribed displacement is the L2
projection of the indicator function of the texel (1 on the texel, 0 elsewhere) onto the shape functions of the base;
the result equals the integral, over the texel, of the continuous base pressure recovered from the reactions.  The
forces on all texels and on the rest of the base add up to the load except for rounding.

A rectangular cover is symmetric about its planes x = 0 and y = 0, so only a quarter is solved, once for each of the
four parities of the displacement in x and y (even or odd).  A texel and its mirror images share a solution.  On a
square cover with a square array, the solutions of the two mixed parities are equal after exchange of x and y.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fem_reference import result_store
from fem_reference.elements.grading import fill_by_spacing, layer_heights
from fem_reference.elements.line import Line, interpolation_matrix, line_matrix
from fem_reference.elements.tensor_product import TensorSolid
from fem_reference.finite_strain.loading_path import Progress, Units, report
from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.point_spread import TexelInfluence
from fem_reference.linear_response.surface_compliance import decay_length
from fem_reference.sparse_solver import SymmetricFactors
from meshes import Cover, TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class FiniteCoverSettings:
    """Constants of the meshes of a quarter of a cover, and of the evaluation of its response."""

    #: Distance of the boundary of a wide cover from the array, over the decay length of the cover's response [-].
    margin: float = 12.0
    #: Distance from texel edges and side edges, over the cover thickness, within which elements have the smallest size
    #: [-].
    near: float = 2.0
    #: Increase of the element size per distance beyond `near` from texel edges and side edges [-].
    growth: float = 0.35
    #: Distance between two texel edges, over the element size, below which both share one element edge [-].
    sliver: float = 0.05
    #: Samples of the element size between two texel edges [-].
    samples: int = 401
    #: Exponent of the heights of the element edges in the bottom layer; above 1 the elements are small at the base,
    #: where the texel edges are [-].
    crowding: float = 1.5
    #: Points in the search for the half width of a texel's response [-].
    width_points: int = 400
    #: Largest distance from the edge of the texel in the search for the half width, over the cover thickness [-].
    width_reach: float = 2.0
    #: Unknowns above which a progress line warns that the solution takes minutes [-].
    many: int = 300_000
    #: Unknowns of the finest grid above which grids are coarsened: about 4.5 GB and two minutes [-].
    most: int = 450_000
    #: Smallest number of elements per thickness on coarsened grids, over that of `GRIDS` [-].
    coarsest: float = 0.4
    #: Number of point loads that are evaluated at once, to limit the memory [-].
    block: int = 4000
    #: Number of texels that are solved at once, to limit the memory [-].
    columns: int = 64


_SETTINGS = FiniteCoverSettings()


#: Parities in x and y of the four parts of a load: 0 for even, 1 for odd.
PARITIES = ((0, 0), (0, 1), (1, 0), (1, 1))


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """Element sizes of a three-dimensional grid.

    Attributes:
        across: Number of elements per cover thickness along x and y, near texel edges and side edges [-].
        through: Number of elements through the cover; every layer gets at least one [-].
        order: Polynomial order of the displacement [-].
    """

    across: float
    through: int
    order: int = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class MirroredTexels:
    """Groups of texels that are mirror images of one another, with lengths in units of the cover thickness.

    The span of a texel along x is the interval between its edges after its centre is mirrored to x >= 0.  Texels with
    equal spans along x and along y are mirror images of one another and share one solution.

    Attributes:
        spans: Lower and upper ends of the m distinct spans along x, and of those along y, shape (m, 2) each.
        pairs: Index of the x span and of the y span of each of the k groups of texels, shape (k, 2).
        pair: Index of the group of each of n texels, shape (n,).
        side: Signs of x and y of the centre of each texel, 1 in the middle, shape (n, 2).
    """

    spans: tuple[FloatArray, FloatArray]
    pairs: IntArray
    pair: IntArray
    side: FloatArray

    @classmethod
    def group(cls, array: TexelArray, thickness: float) -> MirroredTexels:
        """Group the texels of a planar array that are mirror images of one another.

        Args:
            array: Planar array.
            thickness: Thickness of the cover, the unit of length of the result [m].
        """
        centres = np.round(array.centres[:, :2] / thickness, 9)
        spans, numbers = [], []
        for axis in (0, 1):
            distinct, number = np.unique(np.abs(centres[:, axis]), return_inverse=True)
            half = array.texel_size[axis] / thickness / 2
            spans.append(np.column_stack([distinct - half, distinct + half]))
            numbers.append(number)
        pairs, pair = np.unique(np.column_stack(numbers), axis=0, return_inverse=True)
        side = np.where(centres < 0, -1.0, 1.0)
        return cls(spans=(spans[0], spans[1]), pairs=pairs, pair=pair, side=side)

    @property
    def swapped(self) -> IntArray | None:
        """Index of the group that results from exchange of x and y, for each group of texels; None if there is none."""
        if self.spans[0].shape != self.spans[1].shape or not np.allclose(*self.spans, atol=1e-9):
            return None
        numbers = {tuple(pair): number for number, pair in enumerate(self.pairs.tolist())}
        found = [numbers.get((pair[1], pair[0]), -1) for pair in self.pairs.tolist()]
        return None if -1 in found else np.array(found)


def mesh_quarter(cover: Cover, array: TexelArray, resolution: Resolution) -> TensorSolid:
    """Mesh the quarter x, y >= 0 of a cover, in units of the cover thickness and of the top layer's shear modulus.

    Args:
        cover: Cover with free side edges at `size`; a wide cover gets a boundary far outside the array.
        array: Planar array; texel edges are also element edges.
        resolution: Element sizes of the grid.
    """
    x, y = (_grade_side(cover, array, axis, resolution.across) for axis in (0, 1))
    thicknesses = [layer.thickness for layer in cover.layers]
    counts = [max(1, round(resolution.through * each / cover.thickness)) for each in thicknesses]
    heights, layer = layer_heights(thicknesses, counts, crowd_base=_SETTINGS.crowding)
    return build_solid(cover, (x, y, heights / cover.thickness), layer, resolution.order)


def build_solid(
    cover: Cover,
    edges: tuple[FloatArray, FloatArray, FloatArray],
    layer: IntArray,
    order: int = 2,
    breaks: tuple[tuple[int, ...], tuple[int, ...]] = ((), ()),
) -> TensorSolid:
    """Build a block with the materials of a cover, in units of cover thickness and of the top layer's shear modulus.

    Args:
        cover: Cover, bonded or sliding.
        edges: Element edges along x, y and z [thicknesses].
        layer: Index of the layer of each of the e elements along z, shape (e,).
        order: Polynomial order of the displacement [-].
        breaks: Indices of elements along x and along y at whose lower edge the pressure may jump.
    """
    sideways = 1 if cover.base == "bonded" else 0
    shear, compliance = Units.of(cover).scale_moduli(cover)
    return TensorSolid(
        edges=edges,
        layer=layer,
        shear_modulus=shear,
        bulk_compliance=compliance,
        order=order,
        first=(sideways, sideways, 1),
        breaks=breaks,
    )


def constrain_parity(
    solid: TensorSolid, upper: sp.csr_matrix, parity: tuple[int, int], *, sliding: bool
) -> tuple[sp.csr_matrix, BoolArray]:
    """Constrain the unknowns that vanish on the planes of symmetry, without a change of the sparsity pattern.

    For a load even in x, the displacement along x is odd in x and vanishes at x = 0.  For a load odd in x, the other
    displacement components and the pressure vanish at x = 0.  A block on a sliding base may also move or rotate as a
    rigid body without force.  One more constrained unknown prevents this motion.

    Args:
        solid: Quarter x, y >= 0 of a block, with n unknowns.
        upper: Upper triangle of the stiffness matrix of the quarter, shape (n, n).
        parity: Parity of the load in x and in y: 0 for even, 1 for odd.
        sliding: Whether the base slides.

    Returns:
        The upper triangle with unit rows and columns for the constrained unknowns, and whether each unknown is
        constrained, shape (n,).
    """
    constrained = np.zeros(upper.shape[0], dtype=bool)
    for field in range(4):
        view = constrained[solid.offsets[field] : solid.offsets[field + 1]].reshape(solid.field_shape(field))
        view[0] |= (field == 0) != bool(parity[0])
        view[:, 0] |= (field == 1) != bool(parity[1])
        if sliding and ((field == 0 and parity[0] == 1) or (field == 1 and parity == (0, 1))):
            view[0, -1 if parity == (1, 1) else 0, 0] = True
    row = np.repeat(np.arange(len(constrained)), np.diff(upper.indptr))
    values = np.where(constrained[row] | constrained[upper.indices], 0.0, upper.data)
    # The diagonal is the first entry of each row of an upper triangle.
    values[upper.indptr[:-1][constrained]] = 1.0
    return sp.csr_matrix((values, upper.indices, upper.indptr), shape=upper.shape), constrained


def turn_parity(parity: tuple[int, int], component: int) -> tuple[int, int]:
    """Return the parity of a component of a displacement: 0 along z, 1 along x, 2 along y; that along z is given."""
    return parity[0] ^ (component == 1), parity[1] ^ (component == 2)  # noqa: PLR2004 -- number of the component


def _grade_side(cover: Cover, array: TexelArray, axis: int, across: float) -> FloatArray:
    """Place element edges from the middle of the cover to its side; elements are small near texel edges [thicknesses].

    Texel edges are also element edges.
    """
    unit = cover.thickness
    centres, half = array.centres[:, axis], array.texel_size[axis] / 2
    texel_edges = np.unique(np.round(np.abs(np.concatenate([centres - half, centres + half])) / unit, 9))
    if cover.size is None:
        end = float(texel_edges[-1]) + _SETTINGS.margin * decay_length(cover) / unit
    else:
        end = cover.size[axis] / 2 / unit
    marks = [0.0]
    for mark in texel_edges:
        if mark - marks[-1] > _SETTINGS.sliver / across and end - mark > _SETTINGS.sliver / across:
            marks.append(float(mark))
    sharp = [texel_edges[0] == 0.0, *[True] * (len(marks) - 1), True]
    marks.append(end)
    edges = [np.zeros(1)]
    for low, high in pairwise(zip(marks, sharp, strict=True)):
        x = np.linspace(low[0], high[0], _SETTINGS.samples)
        # Elements are small near texel edges and the side of the cover.  The first mark, the middle of the cover,
        # counts only if a texel edge lies there.
        distance = np.minimum(x - low[0] if low[1] else np.inf, high[0] - x)
        spacing = (1 + _SETTINGS.growth * np.maximum(distance - _SETTINGS.near, 0)) / across
        edges.append(fill_by_spacing(x, spacing)[1:])
    return np.concatenate(edges)


#: Element sizes of the three grids; the result is that of the finest grid.
GRIDS = (
    Resolution(across=1.5, through=2),
    Resolution(across=2.25, through=3),
    Resolution(across=3.4, through=4),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjointSolution:
    """Upward displacement of the top of a quarter of a cover due to a unit displacement of the base under a texel.

    Attributes:
        x: Line elements along x, from the middle of the cover to its side [thicknesses].
        y: Line elements along y, from the middle of the cover to its side [thicknesses].
        texels: Displacement at every top node, upwards and against x and y, for each of the 4 parities and each of k
            groups of texels that are mirror images of one another, shape (3, 4, k, nodes along x, nodes along y) [-].
        whole: Displacement at every top node when the whole base is displaced, 1 except for rounding, shape (nodes
            along x, nodes along y) [-].
    """

    x: Line
    y: Line
    texels: FloatArray
    whole: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidInfluence(TexelInfluence):
    """Forces on the texels of one array per unit load on a cover of limited size.

    Attributes:
        cover: Cover with free side edges.
        array: Array that was solved for; methods accept arrays with the same texels and another mask.
        grids: Solutions on the three grids, coarsest first; results are those of the finest grid.
    """

    cover: Cover
    array: TexelArray
    grids: tuple[AdjointSolution, ...]
    points_per_thickness: ClassVar[int] = 12
    unsure_order: ClassVar[float] = 2.0

    @property
    def thickness(self) -> float:  # type: ignore[override]
        """Thickness of the cover of limited size [m]."""
        return self.cover.thickness

    def texel_influence(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the force on every texel per unit point load at each position.

        Args:
            array: Array that was solved for; its mask may differ, and inactive texels get 0.
            positions: k points on the cover in the frame of the array, shape (k, 2) [m].

        Returns:
            Force on each of n texels per unit load at each position, shape (k, n) [-].

        Raises:
            ValueError: If the array has other texels or a position is not on the cover.
        """
        self._check_array(array)
        return np.where(array.active, self._evaluate(self.grids[-1], self._check_positions(positions)), 0.0)

    def outside(self, array: TexelArray, positions: npt.ArrayLike) -> FloatArray:
        """Compute the part of a unit point load that no active texel measures: force on the base less texel forces.

        Args:
            array: Array that was solved for; its mask may differ.
            positions: k points on the cover in the frame of the array, shape (k, 2) [m].

        Returns:
            Part of the load for each position, shape (k,) [-].
        """
        places = self._check_positions(positions)
        grid = self.grids[-1]
        whole = interpolation_matrix(grid.x, grid.y, *np.abs(places / self.thickness).T) @ grid.whole.ravel()
        return np.asarray(whole - self.texel_influence(array, places).sum(axis=1))

    def base_forces(self, array: TexelArray, x: FloatArray, y: FloatArray, loads: FloatArray) -> FloatArray:
        """Sum the influences of the loads, see `TexelInfluence.base_forces`.

        The texels of `array` are those that were solved for; its mask may differ.
        """
        self._check_array(array)
        loads = loads.reshape(-1, *loads.shape[-2:])
        rows, columns = np.nonzero(loads.any(axis=0))
        places, grid = self._check_positions(np.column_stack([x[rows], y[columns]])), self.grids[-1]
        blocks = np.array_split(np.arange(len(rows)), max(1, len(rows) // _SETTINGS.block))
        texels = np.where(array.active, sum(
            force[rows[block], columns[block]] @ self._evaluate(grid, places[block], component)
            for block in blocks for component, force in enumerate(loads)
        ), 0.0)  # fmt: skip
        at_x, at_y = (line.at(np.abs(each) / self.thickness) for line, each in ((grid.x, x), (grid.y, y)))
        whole = np.einsum("ax,by,ab,xy->", at_x, at_y, loads[0], grid.whole, optimize=True)
        return np.append(texels, whole - np.sum(texels))

    @property
    def on_grids(self) -> tuple[SolidInfluence, ...]:
        """The solutions on three grids, coarsest first; the last is this solution."""
        return tuple(replace(self, grids=(each,)) for each in self.grids)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Element sizes of the three grids, coarsest first; only their ratios are used [-]."""
        return tuple(1 / resolution.across for resolution in GRIDS)

    @cached_property
    def error_estimate(self) -> dict[str, float]:
        """Estimated relative errors of the response: `total_force`, `peak_texel` and `sigma` [-].

        `peak_texel` is the largest error, over all texels, of the force on a texel under a load above its centre.
        `sigma`, the width of the response, is represented by the half width of the middle texel's response.
        """
        sizes = self.sizes
        centres = self.array.centres[:, :2]
        own = np.array([np.diag(self._evaluate(grid, centres)) for grid in self.grids])
        widths = [self._find_half_width(grid) for grid in self.grids]
        errors = [grid_convergence(list(values), sizes) for values in own.T]
        return {
            "total_force": float(np.abs(self.grids[-1].whole - 1).max()),
            "peak_texel": max(errors) / float(own[-1].max()),
            "sigma": grid_convergence(widths, sizes) / widths[-1],
        }

    def _find_half_width(self, grid: AdjointSolution) -> float:
        """Find the distance of a load along x at which the force on the middle texel is half its largest value [m]."""
        centre = self.array.centres[self.array.middle, :2]
        distance = np.linspace(
            0, self.array.texel_size[0] / 2 + _SETTINGS.width_reach * self.thickness, _SETTINGS.width_points
        )
        # The load moves towards the middle of the cover.
        side = -np.sign(centre[0]) or 1.0
        places = centre + np.column_stack([side * distance, np.zeros(len(distance))])
        places = places[np.abs(places[:, 0]) <= grid.x.edges[-1] * self.thickness]
        value = self._evaluate(grid, places)[:, self.array.middle]
        first = int(np.argmax(value < value[0] / 2))
        return float(np.interp(-value[0] / 2, -value[[first - 1, first]], distance[[first - 1, first]]))

    def _evaluate(self, grid: AdjointSolution, places: FloatArray, component: int = 0) -> FloatArray:
        """Compute the force on each of n texels, active or not, per unit load at k positions [m], shape (k, n) [-].

        The load is normal (component 0), or a shear along x (1) or y (2).
        """
        texels = MirroredTexels.group(self.array, self.thickness)
        at_places = interpolation_matrix(grid.x, grid.y, *np.abs(places / self.thickness).T)
        side = np.where(places < 0, -1.0, 1.0)
        out = np.zeros((len(places), self.array.count))
        for parity, solution in zip(PARITIES, grid.texels[component], strict=True):
            value = at_places @ solution.reshape(len(solution), -1).T
            own = turn_parity(parity, component)
            sign = (side**own).prod(axis=1)[:, None] * (texels.side**parity).prod(axis=1)
            out += sign * value[:, texels.pair]
        return out

    def _check_positions(self, positions: npt.ArrayLike) -> FloatArray:
        """Convert positions to an array of shape (k, 2) [m]; raise a ValueError if a position is beside the cover."""
        place = np.atleast_2d(np.asarray(positions, dtype=float))
        half = np.array([self.grids[-1].x.edges[-1], self.grids[-1].y.edges[-1]]) * self.thickness
        if (np.abs(place) > half * (1 + 1e-9)).any():
            width, height = 2e3 * half
            raise ValueError(f"a position lies beyond the cover, which is {width:.4g} x {height:.4g} mm")
        return place

    def _check_array(self, array: TexelArray) -> None:
        """Raise a ValueError if the array has other texels than the array that was solved for; masks may differ."""
        own = self.array
        if array is own:
            return
        same = array.centres.shape == own.centres.shape and np.allclose(array.centres, own.centres, atol=1e-9)
        if not same or not np.allclose(array.texel_size, own.texel_size):
            raise ValueError("this solution is of another array; solve for this one with solid_influence(cover, array)")


def solid_influence(cover: Cover, array: TexelArray, *, progress: Progress = None) -> SolidInfluence:
    """Solve for the force on every texel per unit load anywhere on a cover, on three grids, or read it from the store.

    Args:
        cover: Cover, bonded or sliding, with free side edges at `size` and its middle above the origin of the array.  A
            wide cover gets a boundary far outside the array.  Hyperelastic materials are linearised at zero load.
        array: Planar array.  Parts of texels beside the cover carry no force.
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If the array is not planar, or if the cover is too wide for the memory.
    """
    array.require_planar()

    resolutions = choose_grids(cover, array)

    def compute() -> list[AdjointSolution]:
        out = []
        for resolution in resolutions:
            unknowns = _count_unknowns(cover, array, resolution)
            patience = "; this takes minutes" if unknowns > _SETTINGS.many else ""
            report(progress, f"solid, {resolution.through} elements through the cover, {unknowns} unknowns{patience}")
            out.append(solve_adjoint(cover, array, resolution))
        return out

    inputs = {"cover": cover, "centres": array.centres, "texel_size": array.texel_size, "grids": resolutions}
    grids = result_store.fetch("solid-influence", {**inputs, "settings": _SETTINGS}, compute)
    return SolidInfluence(cover=cover, array=array, grids=tuple(grids))


def _count_unknowns(cover: Cover, array: TexelArray, resolution: Resolution) -> int:
    """Count the displacement unknowns of a quarter of the cover on one grid."""
    return int(3 * np.prod([line.count for line in mesh_quarter(cover, array, resolution).lines]))


def choose_grids(cover: Cover, array: TexelArray) -> tuple[Resolution, ...]:
    """Choose the three grids: those of `GRIDS`, coarser along the cover where the memory would not suffice.

    Raises:
        ValueError: If even the coarsest grids have too many unknowns.
    """
    for share in np.arange(1.0, _SETTINGS.coarsest - 0.01, -0.1):
        grids = tuple(replace(each, across=each.across * float(share)) for each in GRIDS)
        unknowns = _count_unknowns(cover, array, grids[-1])
        if unknowns <= _SETTINGS.most:
            return grids
    if cover.size is None:
        raise ValueError(f"the array is too large for the three-dimensional solution: {unknowns} unknowns")
    width, height = 1e3 * np.array(cover.size)
    most = _SETTINGS.most
    accepted = np.sqrt(most / unknowns)
    raise ValueError(
        f"cover.size: {width:.4g} x {height:.4g} mm is {max(cover.size) / cover.thickness:.0f} times the thickness and "
        f"needs {unknowns / 1e6:.1f} million unknowns in three dimensions, where at most {most / 1e6:.2g} million are "
        f"accepted; use a size of at most {width * accepted:.3g} x {height * accepted:.3g} mm, or leave `size` out: "
        "sides farther than about 4 thicknesses from the contact have no effect"
    )


def solve_adjoint(cover: Cover, array: TexelArray, resolution: Resolution) -> AdjointSolution:
    """Solve the adjoint problem of every texel on one grid: unit displacement of the base under the texel.

    Args:
        cover: Cover with or without free side edges.
        array: Planar array.
        resolution: Element sizes of the grid.
    """
    solid = mesh_quarter(cover, array, resolution)
    texels = MirroredTexels.group(array, cover.thickness)
    x, y, _ = solid.lines
    swapped = texels.swapped if np.array_equal(x.edges, y.edges) else None
    upper = solid.assemble_upper()
    factors = SymmetricFactors()
    out = np.zeros((3, len(PARITIES), len(texels.pairs), x.count, y.count))
    whole = np.ones((x.count, y.count))
    for number, parity in enumerate(PARITIES):
        if parity == (1, 0) and swapped is not None:
            out[:, number] = out[[0, 2, 1], PARITIES.index((0, 1))][:, swapped].transpose(0, 1, 3, 2)
            continue
        base = [_project_indicators(line, texels.spans[axis], parity[axis]) for axis, line in enumerate((x, y))]
        chosen = np.arange(len(texels.pairs))
        if swapped is not None and parity[0] == parity[1]:
            chosen = chosen[swapped >= chosen]
        displaced = [base[axis][texels.pairs[chosen, axis]] for axis in (0, 1)]
        if parity == (0, 0):
            # The last displacement is that of the whole base.
            displaced = [np.vstack([part, np.ones(part.shape[1])]) for part in displaced]
        if not all(part.any() for part in displaced):
            continue  # The indicator function of a single row or column in the middle has no odd part.
        matrix, constrained = constrain_parity(solid, upper, parity, sliding=cover.base == "sliding")
        factors.factorise(matrix)
        tops = []
        for start in range(0, len(displaced[0]), _SETTINGS.columns):
            load = -solid.compute_base_forces(*(part[start : start + _SETTINGS.columns] for part in displaced))
            load[constrained] = 0.0
            moved = factors.solve(load)
            fields = [
                moved[solid.offsets[axis] : solid.offsets[axis + 1]].reshape(*solid.field_shape(axis), -1)[:, :, -1]
                for axis in (2, 0, 1)
            ]
            tops.append(np.array([[[1.0]], [[-1.0]], [[-1.0]]])[..., None] * np.moveaxis(np.array(fields), -1, 1))
        top = np.concatenate(tops, axis=1)
        if parity == (0, 0):
            whole = top[0, -1]
        out[:, number, chosen] = top[:, : len(chosen)]
        if swapped is not None and parity[0] == parity[1]:
            out[:, number, swapped[chosen]] = top[[0, 2, 1], : len(chosen)].transpose(0, 1, 3, 2)
    return AdjointSolution(x=x, y=y, texels=out, whole=whole)


def _project_indicators(line: Line, spans: FloatArray, odd: int) -> FloatArray:
    """Compute L2 projections of the even or odd parts of the indicator functions of intervals on line elements.

    Args:
        line: Line elements from the plane of symmetry outwards.
        spans: Lower and upper ends of m intervals, shape (m, 2).
        odd: 1 for the odd part of each indicator function, 0 for the even part.

    Returns:
        Nodal values, shape (m, nodes).
    """
    mirror = -1.0 if odd else 1.0
    load = np.array([line.integral(low, high) + mirror * line.integral(-high, -low) for low, high in spans]) / 2
    mass = line_matrix(line, line).toarray()
    out = np.zeros_like(load)
    out[:, odd:] = np.linalg.solve(mass[odd:, odd:], load[:, odd:].T).T
    return out
