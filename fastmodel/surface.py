"""Linear response of a cover at its surface: on cells of a plate, or at points of a curved top.

The contact methods use two quantities: the compliance, which is displacement per force, and the influence, which is
force on a texel per force on the surface.  The response of a laterally wide flat cover depends only on distances, so
that two small tables over distances, the kernels of a convolution, describe it for arrays of any size (`CoverCells`).
Cells divide each texel pitch evenly.  Cell `[i, j]` of a texel
lies i rows and j columns from the lowest, leftmost cell of that texel.  Near the free side edges of a cover the force
at the base also depends on the position of the cell.  A table over all cells and texels then replaces the kernel of the
influence.  A cover with a stiff foil becomes stiffer under load, because the foil stretches.  It has further
compliances and influences, one of each for some loads.  The response of a cover of any shape is that of a flat layer
plus a smooth remainder, which is tabulated between loads on its top (`CoverPoints`).

Kernels are smooth beyond one cell, so that a sum of few terms, K[i, j] = sum over r of u_r[i] v_r[j] from the singular
value decomposition, approximates them well.  Each term acts along rows and columns separately.  For windows
(rectangles of cells) of the size of a contact, two matrix products over all terms are faster than a fast Fourier
transform, and the matrices do not depend on the position of the window.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.spatial import cKDTree

from fastmodel.errors import FastModelError
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.solids.facets import facet_shape, node_places, split_triangles

#: Largest number of sizes of windows whose matrices are kept in memory [-].
_KEPT = 32


def factorise(kernel: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Compute a low-rank factorisation of a kernel by its singular value decomposition.

    Args:
        kernel: The kernel, shape (rows, columns) [any unit].
        tolerance: Singular values up to this share of the largest singular value are omitted [-].

    Returns:
        Row factors, shape (terms, rows) [unit of the kernel], and column factors, shape (terms, columns) [-].  The sum
        of their products over the terms approximates the kernel.
    """
    rows, values, columns = np.linalg.svd(kernel)
    kept = int((values > tolerance * values[0]).sum())
    return (rows[:, :kept] * values[:kept]).T.copy(), columns[:kept].copy()


class SymmetricConvolution:
    """Convolution with a kernel that depends only on the absolute distances along rows and along columns."""

    def __init__(self, quarter: FloatArray, tolerance: float = 3e-5) -> None:
        """Factorise the kernel.

        Args:
            quarter: Kernel at distances of i rows and j columns, entry `[i, j]`; zero at larger distances, shape (rows,
                columns) [any unit].
            tolerance: Tolerance of the low-rank factorisation, see `factorise` [-].
        """
        mirrored = np.concatenate([quarter[:0:-1], quarter])
        full = np.concatenate([mirrored[:, :0:-1], mirrored], axis=1)
        along, across = factorise(full, tolerance)
        self._along, self._across = along[:, len(quarter) - 1 :], across[:, quarter.shape[1] - 1 :]
        self._matrices: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}

    def matrices(self, rows: int, columns: int) -> tuple[FloatArray, FloatArray]:
        """Build the matrices that convolve a window of the given numbers of rows and columns.

        The convolution of a window q is the sum over the terms of first[term] @ q @ second[term].

        Returns:
            Stacked Toeplitz matrices `first`, shape (terms * rows, rows), and `second`, shape (terms * columns,
            columns).
        """
        key = (rows, columns)
        if key not in self._matrices:
            if len(self._matrices) >= _KEPT:
                self._matrices.clear()
            self._matrices[key] = (_build_toeplitz(self._along, rows), _build_toeplitz(self._across, columns))
        return self._matrices[key]


def _build_toeplitz(factor: FloatArray, size: int) -> FloatArray:
    """Build the symmetric Toeplitz matrices of the factors of all terms, stacked, shape (terms * size, size)."""
    padded = np.zeros((len(factor), max(size, factor.shape[1])))
    padded[:, : factor.shape[1]] = factor
    distance = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.ascontiguousarray(padded[:, distance].reshape(-1, size))


def find_largest_stiffness(kernel: FloatArray) -> float:
    """Return force over displacement of cells under a chequered pattern of alternating forces [N/m].

    The compliance of a cover decreases with the wave number, so that this is the stiffest pattern.
    """
    signs = np.where(np.arange(max(kernel.shape)) % 2, -2.0, 2.0)
    signs[0] = 1.0
    return float(1 / (signs[: len(kernel)] @ kernel @ signs[: kernel.shape[1]]))


#: Tolerance of the low-rank factorisation of the influence (force on a texel per force on a cell) [-]: singular values
#: below this share of the largest one are omitted.  The error is far below the discretisation error of the cells.
_INFLUENCE_TOLERANCE = 1e-7
#: Edge of the square patch on which the modulus of the elastic foundation is matched to the cover, over the thickness
#: of the cover [-].
_PATCH = 4
#: Parts of a cell along each side over which the compliance of the flat layer is averaged [-].
_PARTS = 8
#: Number of dimensions of a matrix.
_MATRIX = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverCells:
    """Compliance and influence of a cover on cells smaller than a texel, for the contact method `cover`.

    Attributes:
        per_texel: Number of cells along each texel pitch [-].
        cell: Edge lengths of a cell along x and y [m].
        compliance: Downward displacement of a cell's centre per uniform pressure on the cell that lies i rows and j
            columns away, entry `[i, j]`, shape (p, q); zero at larger distances [m/Pa].
        influence: Force on a texel per unit force distributed uniformly over cell `[i - reach, j - reach]` of the
            texel, entry `[i, j]`, shape (per_texel + 2 reach,) * 2; zero for cells farther away [-].
        top_compliance: (1 - nu) / (2 pi mu) of the top layer: near a point load, displacement times distance per unit
            force (Boussinesq) [m2/N].
        thickness: Thickness of the cover [m].
        source: Origin of the data.
        table: Force on each of n texels per unit force distributed uniformly over each cell of the array, shape (n,
            rows * per_texel, columns * per_texel).  The table replaces `influence` for a cover with free side edges;
            None for other covers [-].
        loads: Ascending loads at which the cover under tension is tabulated, shape (m,); None for a cover whose
            response does not depend on the load.  `compliance` and `influence` belong to zero load [N].
        load_depths: Depth, in this model, of the ball to which the tables were fitted, at each of `loads`, shape (m,)
            [m]; None if unknown.  A body with a smaller depth stretches the cover less, so that smaller loads apply to
            it.
        loaded_compliance: `compliance` at each of `loads`, shape (m, p, q) [m/Pa].
        loaded_influence: `influence` at each of `loads`, shape (m, per_texel + 2 reach, per_texel + 2 reach) [-].
    """

    per_texel: int
    cell: tuple[float, float]
    compliance: FloatArray
    influence: FloatArray
    top_compliance: float
    thickness: float
    source: str = "given by the user"
    table: FloatArray | None = None
    loads: FloatArray | None = None
    load_depths: FloatArray | None = None
    loaded_compliance: FloatArray | None = None
    loaded_influence: FloatArray | None = None

    #: Section of `parameters.toml` that holds the fields that are not arrays.
    section: ClassVar[str] = "cells"
    #: Type of the numbers of the arrays in the npz file.
    number: ClassVar[type] = np.float64
    #: Contact methods that accept an array under this cover, most accurate first.
    methods: ClassVar[tuple[str, ...]] = ("cover", "foundation", "boxes")

    def __post_init__(self) -> None:
        """Check shapes and values, and make the tables read-only.

        Raises:
            FastModelError: If a table has a wrong shape.
            ValueError: If a number is not finite or not positive.
        """
        s, size = self.per_texel, self.influence.shape
        if s < 1 or s != int(s):
            raise ValueError(f"per_texel must be a whole number from 1 on, not {s}")
        if self.compliance.ndim != _MATRIX or not self.compliance.size:
            raise FastModelError(f"compliance has shape (rows, columns), not {self.compliance.shape}")
        if len(size) != _MATRIX or size[0] != size[1] or size[0] < s or (size[0] - s) % 2:
            raise FastModelError(f"influence has shape ({s} + 2 reach, {s} + 2 reach), not {size}")
        self._check_loads()
        optional = (self.table, self.loads, self.load_depths, self.loaded_compliance, self.loaded_influence)
        tables = [self.compliance, self.influence, *(each for each in optional if each is not None)]
        if not all(np.isfinite(each).all() for each in tables):
            raise ValueError("compliance and influence must be finite; one holds nan or inf")
        for name, value in (("cell", min(self.cell)), ("top_compliance", self.top_compliance)):
            if not 0 < value < np.inf:
                raise ValueError(f"{name} must be positive, not {value}")
        if not 0 < self.thickness < np.inf or not self.compliance[0, 0] > 0:
            raise ValueError("thickness and the compliance of a cell under its own pressure must be positive")
        for each in tables:
            each.setflags(write=False)

    def _check_loads(self) -> None:
        """Check that the tables under load are complete and have the shapes of those without load."""
        given = (self.loads, self.load_depths, self.loaded_compliance, self.loaded_influence)
        if self.loads is None or self.loaded_compliance is None or self.loaded_influence is None:
            if any(each is not None for each in given):
                raise FastModelError("loads, loaded_compliance and loaded_influence belong together; one is missing")
            return
        count = len(self.loads)
        wanted = [(count, *self.compliance.shape), (count, *self.influence.shape)]
        if [self.loaded_compliance.shape, self.loaded_influence.shape] != wanted or self.table is not None:
            raise FastModelError(f"{count} loads need tables under load of shapes {wanted}, no table by cell and texel")
        if not count or not (np.diff(self.loads, prepend=0.0) > 0).all():
            raise ValueError("loads must be positive and ascend")
        if self.load_depths is not None and self.load_depths.shape != self.loads.shape:
            raise FastModelError(f"load_depths has shape {self.load_depths.shape}; the loads need {self.loads.shape}")

    @cached_property
    def under_loads(self) -> tuple[CoverCells, ...]:
        """Covers whose response does not depend on the load: this cover without load, then at each of `loads`."""
        if self.loads is None or self.loaded_compliance is None or self.loaded_influence is None:
            return (self,)
        plain = dataclasses.replace(self, loads=None, load_depths=None, loaded_compliance=None, loaded_influence=None)
        pairs = zip(self.loaded_compliance, self.loaded_influence, strict=True)
        return (plain, *(dataclasses.replace(plain, compliance=c, influence=i) for c, i in pairs))

    @property
    def near(self) -> FloatArray:
        """Compliance between cells that lie 0 or 1 rows and columns apart, shape (2, 2) [m/N]."""
        return np.pad(self.compliance / (self.cell[0] * self.cell[1]), ((0, 1), (0, 1)))[:2, :2].copy()

    @property
    def square_compliance(self) -> float:
        """Displacement at the centre of a cell on an elastic half space under uniform pressure of unit force [m/N]."""
        return 4 * float(np.arcsinh(1.0)) * self.top_compliance / float(np.sqrt(self.cell[0] * self.cell[1]))

    def position_among_loads(self, load: float) -> float:
        """Return the interpolated index of a load in the list of zero load and the tabulated `loads` [-].

        The index is 0.0 at zero load, 1.0 at the first tabulated load, and so on; beyond the last load it stays
        constant.

        Args:
            load: Force of a body on the cover [N].
        """
        if self.loads is None:
            return 0.0
        return float(np.interp(load, np.append(0.0, self.loads), np.arange(len(self.loads) + 1)))

    def load_at_depth(self, depth: float) -> float:
        """Return the load under which the ball that the tables were fitted to has a given depth [N].

        The load is at least a hundredth of the first tabulated load.  It is infinite if the depths of the ball are
        unknown, or if the given depth exceeds all of them.

        Args:
            depth: Approach of a body since its first touch of the cover [m].
        """
        if self.loads is None or self.load_depths is None or depth >= self.load_depths[-1]:
            return np.inf
        load = np.interp(depth, np.append(0.0, self.load_depths), np.append(0.0, self.loads))
        return max(float(load), 0.01 * float(self.loads[0]))

    @property
    def cells(self) -> CoverCells:
        """The cover itself, because it is described by cells; None for a cover that is described by points."""
        return self

    @property
    def margin(self) -> int | None:
        """Width by which a plate in MuJoCo extends beyond the texels, if the cover determines it [m].

        A cover with free side edges ends at the texels, so that the width is 0.  It is None for other covers.
        """
        return None if self.table is None else 0

    @property
    def reach(self) -> int:
        """Largest distance from a texel's edge at which force on a cell still reaches the texel, in cells [-]."""
        return (len(self.influence) - self.per_texel) // 2

    @cached_property
    def convolution(self) -> SymmetricConvolution:
        """Convolution from forces on cells [N] to downward displacements of the cells' centres [m]."""
        return SymmetricConvolution(self.compliance / (self.cell[0] * self.cell[1]))

    @cached_property
    def influence_factors(self) -> tuple[FloatArray, FloatArray]:
        """Row and column factors of the influence, each of shape (terms, per_texel + 2 reach) [-].

        The influence is the sum over terms of the products of row and column factors.
        """
        return factorise(self.influence, _INFLUENCE_TOLERANCE)

    def check(self, array: TexelArray) -> None:
        """Check that the cover fits an array: its cells divide the pitch, and a table has the right shape.

        Raises:
            FastModelError: If the cells do not divide the pitch, or the table is for another array or an irregular one.
        """
        edges = [pitch / self.per_texel for pitch in array.pitch]
        if not np.allclose(edges, self.cell, rtol=1e-6, atol=0):
            raise FastModelError(
                f"the cover's response belongs to a pitch of {tuple(self.per_texel * edge for edge in self.cell)} m, "
                f"and array {array.name!r} has one of {array.pitch} m; write a sensor file with this pitch "
                "(`softcover init`), run `softcover derive` and load its folder"
            )
        if self.table is not None and not array.regular:
            raise FastModelError(
                f"array {array.name!r} is not a flat, regular grid, which the table of a cover with free side edges "
                f"needs; leave the cells out and use 'foundation' or 'boxes', which take any layout"
            )
        wanted = (array.count, array.rows * self.per_texel, array.columns * self.per_texel)
        if self.table is not None and self.table.shape != wanted:
            raise FastModelError(
                f"the table of cells and texels has shape {self.table.shape}; array {array.name!r} takes {wanted}"
            )

    def foundation_modulus(self, width: float | None = None) -> float:
        """Compute the modulus of the elastic foundation that matches the cover under a square patch [Pa/m].

        The modulus is the uniform pressure on the patch over the mean displacement of the patch.  This ratio depends on
        the size of the patch, so the foundation is accurate for contacts of about the size of the patch only.

        Args:
            width: Edge length of the patch; by default four times the thickness of the cover [m].
        """
        side = _PATCH * self.thickness if width is None else width
        ny, nx = (max(1, round(side / edge)) for edge in self.cell[::-1])
        # Number of pairs of cells within the patch that lie i rows apart, and the same for columns.
        pairs = [
            np.where(np.arange(n) == 0, count, 2.0 * np.maximum(count - np.arange(n), 0))
            for n, count in zip(self.compliance.shape, (ny, nx), strict=True)
        ]
        return float(nx * ny / (pairs[0] @ self.compliance @ pairs[1]))


#: Largest accepted difference between the compliance and its transpose, over the largest compliance [-].  Rounding to
#: four-byte numbers and the error of a direct solver are smaller.
_SYMMETRIC = 1e-5


#: Number of points of a flat triangle.
_TRIANGLE = 3
#: Number of cell edges per factor 2 [-].
_PER_OCTAVE = 2


def choose_edge(length: float) -> int:
    """Return the number of the largest edge of a cell up to a length, over the thickness of the cover [-]."""
    return int(np.floor(_PER_OCTAVE * np.log2(length)))


def cell_edge(number: int) -> float:
    """Return the edge of a cell, over the thickness of the cover, by its number, see `choose_edge` [-]."""
    return float(2.0 ** (number / _PER_OCTAVE))


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverPoints:
    """Linear response of a cover of any shape at its top, over n texels.

    The displacement of a point under a force on another is that of a flat layer at their distance, plus a remainder.
    The remainder is smooth, and tabulated between m loads.  A force on a point is distributed among loads near it with
    the same moments, and the displacement is interpolated with the same shares.

    Attributes:
        points: Positions of p points of the undeformed top, in the array's frame, shape (p, 3) [m].
        normals: Unit normals of the top at the points, outwards, shape (p, 3) [-].
        facets: Indices of the points of each facet of the top, quadratic quadrilaterals, quadratic triangles (see
            `meshes.solids.facets`) or flat triangles, counterclockwise from outside, shape (f, 9), (f, 6) or (f, 3).
        centres: Centres of the m loads, shape (m, 3) [m].
        shared: Indices of q loads for each point, shape (p, q).
        shares: Parts of a force on the point that these loads take, shape (p, q) [-].
        influence: Force on each texel, along the texel's normal, per unit force on each point against its normal,
            shape (n, p) [-].
        remainder: Displacement averaged over a load per unit of each load, less that of the flat layer, symmetric,
            shape (m, m) [m/N].
        layer: Compliance of a flat layer of thickness `thickness` less that of a half space at the distances 0,
            `layer_step`, 2 `layer_step` ..., shape (k,); the layer does not yield farther away [m/N].
        layer_step: Distance between entries of `layer` [m].
        top_compliance: Displacement times distance per unit force on a half space, see `CoverCells` [m2/N].
        heights: Thickness of the flat layer at each point: that of the cover there, shape (p,) [m].
        thickness: Mean thickness of the cover, for which `layer` holds [m].
    """

    points: FloatArray
    normals: FloatArray
    facets: IntArray
    centres: FloatArray
    shared: IntArray
    shares: FloatArray
    influence: FloatArray
    remainder: FloatArray
    layer: FloatArray
    layer_step: float
    top_compliance: float
    heights: FloatArray
    thickness: float

    #: Section of `parameters.toml` that holds the fields that are not arrays.
    section: ClassVar[str] = "curved"
    #: Type of the numbers of the arrays in the npz file.  Numbers of four instead of eight bytes halve the size of the
    #: remainder, with a relative error of 1e-7.
    number: ClassVar[type] = np.float32
    #: Contact methods that accept an array under this cover.  Plates and boxes do not follow a curved top.
    methods: ClassVar[tuple[str, ...]] = ("curved",)
    margin: ClassVar[int | None] = None
    cells: ClassVar[None] = None

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            FastModelError: If shapes do not fit, or a facet or a share refers to no point or load.
            ValueError: If a value is not finite, a normal is no unit vector, the shares of a point do not sum to 1, the
                remainder is not symmetric, or a length or compliance is not positive.
        """
        self._check_shapes()
        for name in ("points", "normals", "centres", "shares", "influence", "remainder", "layer", "heights"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} of a cover has a value that is not finite")
        if np.abs(np.linalg.norm(self.normals, axis=1) - 1).max(initial=0.0) > _SYMMETRIC:
            raise ValueError("normals of a cover must be unit vectors")
        if np.abs(self.shares.sum(axis=1) - 1).max() > _SYMMETRIC:
            raise ValueError("the shares of each point of a cover must sum to 1")
        if np.abs(self.remainder - self.remainder.T).max() > _SYMMETRIC * np.abs(self.remainder).max():
            raise ValueError("the remainder of the compliance of a cover must be symmetric")
        for name in ("heights", "thickness", "layer_step", "top_compliance"):
            if not np.min(getattr(self, name)) > 0:
                raise ValueError(f"{name} of a cover must be positive, not {np.min(getattr(self, name))}")

    def _check_shapes(self) -> None:
        """Check shapes and indices of the arrays."""
        points, loads = len(self.points), len(self.centres)
        for name in ("facets", "shared"):  # files hold all numbers as floating-point numbers
            object.__setattr__(self, name, np.asarray(getattr(self, name)).astype(np.int64))
        shapes = {
            "points": (points, 3), "normals": (points, 3), "facets": (len(self.facets), self.facets.shape[-1]),
            "shares": self.shared.shape, "shared": (points, *self.shared.shape[1:2]), "remainder": (loads, loads),
            "centres": (loads, 3), "influence": (len(self.influence), points), "heights": (points,),
            "layer": (self.layer.size,),
        }  # fmt: skip
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise FastModelError(f"{name} of a cover has shape {getattr(self, name).shape}, not {shape}")
        for name, most in (("facets", points), ("shared", loads)):
            index = getattr(self, name)
            if not index.size or index.min() < 0 or index.max() >= most:
                raise FastModelError(f"{name} of a cover must hold indices from 0 to {most - 1}")

    def check(self, array: TexelArray) -> None:
        """Check that the cover is for the number of texels of an array.

        Raises:
            FastModelError: If the numbers of texels differ.
        """
        if len(self.influence) != array.count:
            raise FastModelError(f"the cover is for {len(self.influence)} texels; the array has {array.count}")

    @cached_property
    def spacing(self) -> float:
        """Mean distance of a point to the nearest other point [m]."""
        return float(np.asarray(cKDTree(self.points).query(self.points, 2)[0])[:, 1].mean())

    @cached_property
    def triangles(self) -> IntArray:
        """Indices of the points of the flat triangles between the points, those of a facet in a row, shape (t, 3)."""
        return self.facets if self.facets.shape[1] == _TRIANGLE else split_triangles(self.facets)

    def interpolate(self, triangles: IntArray, parts: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find the points from which values at places on the top are interpolated.

        Args:
            triangles: Index of the triangle of each of k places, shape (k,).
            parts: Weights of the corners of the triangle, shape (k, 3) [-].

        Returns:
            Indices of the a points of the facets, and their weights, shape (k, a) each [-].
        """
        count = self.facets.shape[1]
        if count == _TRIANGLE:
            return self.facets[triangles], parts
        within = split_triangles(np.arange(count)[None])
        facet, part = np.divmod(triangles, len(within))
        place = np.einsum("kc,kcd->kd", parts, node_places(count)[within[part]])
        return self.facets[facet], facet_shape(count, place)

    def move_layer(self, distance: FloatArray) -> FloatArray:
        """Compute the displacement of the flat layer at distances from a unit force, any shape [m/N]."""
        radius = self.layer_step * np.arange(len(self.layer))
        away = np.maximum(distance, 1e-3 * self.layer_step)
        moved = np.interp(away, radius, self.layer) + self.top_compliance / away
        return np.asarray(np.where(away < radius[-1], moved, 0.0))

    def cells_of(self, numbers: tuple[int, int], size: int) -> LayerCells:
        """Return the compliance of the flat layer on cells, for windows of up to `size` cells along each side.

        Args:
            numbers: Numbers of the edges of the cells along x and y, see `cell_edge`.
            size: Number of cells.
        """
        key = (*numbers, size)
        if key not in self._layers:
            if len(self._layers) >= _KEPT:
                self._layers.clear()
            width, height = (self.thickness * cell_edge(each) for each in numbers)
            self._layers[key] = self._build_cells(width, height, size)
        return self._layers[key]

    @cached_property
    def _layers(self) -> dict[tuple[int, int, int], LayerCells]:
        """Compliances of the flat layer on cells that were used."""
        return {}

    def _build_cells(self, width: float, height: float, size: int) -> LayerCells:
        """Compute the compliance of the flat layer on cells with the given edges [m]."""
        x, y = np.meshgrid(width * np.arange(size), height * np.arange(size))
        a, b = width / 2, height / 2
        # Displacement of a half space under a pressure on a rectangle (Love, Phil. Trans. R. Soc. A 228, 1929).
        corners = [(x + a, y + b, 1), (x - a, y + b, -1), (x + a, y - b, -1), (x - a, y - b, 1)]
        near = sum(sign * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v))) for u, v, sign in corners)
        # Cells may be wider than the top layer is thick.
        part = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
        away = np.hypot(x[..., None, None] + width * part, y[..., None, None] + height * part[:, None])
        radius = self.layer_step * np.arange(len(self.layer))
        within = np.interp(away, radius, self.layer)
        smooth = np.where(away < radius[-1], within, -self.top_compliance / away).mean(axis=(2, 3))
        square = 4 * float(np.arcsinh(1.0)) * self.top_compliance / np.sqrt(width * height)
        # A patch of the layer as wide as a few thicknesses, whose displacement in the middle is nearly even.
        inside = radius <= _PATCH / 2 * self.thickness
        moved = 2 * np.pi * (radius * self.layer + self.top_compliance)
        return LayerCells(
            kernel=self.top_compliance * near / (width * height) + smooth,
            square=square,
            stiffness=width * height / float(np.trapezoid(moved[inside], radius[inside])),
        )

    def find_texels(self, array: TexelArray) -> IntArray:
        """Find for each of p points the texel below it, shape (p,) [-].

        It is the texel whose centre, moved outwards by the thickness of the cover, is nearest to the point.
        """
        return np.asarray(cKDTree(array.centres + self.thickness * array.normals).query(self.points)[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerCells:
    """Compliance of a flat layer on equal cells.

    Attributes:
        kernel: Displacement of a cell's centre per unit force distributed evenly over the cell that lies i rows and j
            columns away, entry `[i, j]`, shape (size, size) [m/N].
        square: Displacement at the centre of a cell on a half space under unit force on the cell [m/N].
        stiffness: Stiffness of a cell of the elastic foundation with which the search for the pressure starts [N/m].
    """

    kernel: FloatArray
    square: float
    stiffness: float

    @cached_property
    def stiffest(self) -> float:
        """Largest stiffness of the cells, see `find_largest_stiffness` [N/m]."""
        return find_largest_stiffness(self.kernel)

    @cached_property
    def convolution(self) -> SymmetricConvolution:
        """Convolution from forces on cells to displacements of their centres."""
        return SymmetricConvolution(self.kernel)


#: Response of a cover at its surface, for the contact methods that compute the cover.
Surface = CoverCells | CoverPoints
