"""Compliance and influence of a cover on the cells of the contact grid.

The compliance is the displacement of the cover's top per pressure on a cell.  The influence is the force on a texel at
the cover's base per force on a cell.  The response of a laterally wide cover depends on distances only, so two small
kernels (tables over distances) describe compliance and influence for arrays of any size.  Cells divide every texel
pitch evenly; cell `[i, j]` of a texel lies i rows and j columns from the lowest, leftmost cell of that texel.  Near the
free side edges of a cover the force at the base also depends on the position of the cell.  For such a cover a table
over all cells and texels replaces the kernel of the influence.

A cover with a stiff foil becomes stiffer under load, because the foil stretches.  Such a cover has further compliances
and influences, one of each for some loads.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastmodel.errors import FastModelError
from fastmodel.pressure.separable_convolution import SymmetricConvolution, factorise
from meshes import TexelArray
from meshes.array_types import FloatArray

#: Tolerance of the low-rank factorisation of the influence (force on a texel per force on a cell): singular values
#: below this share of the largest are omitted [-].  The error is far below the discretisation error of the cells.
_INFLUENCE_TOLERANCE = 1e-7
#: Edge of the square patch on which the modulus of the elastic foundation is matched to the cover, over the thickness
#: of the cover [-].
_PATCH = 4
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
        load_depths: Depth in this model of the ball that the tables were fitted to, at each of these loads, shape (m,);
            None if unknown.  A body that sinks less stretches the cover less, so that smaller loads apply to it [m].
        loaded_compliance: `compliance` at each of these loads, shape (m, p, q) [m/Pa].
        loaded_influence: `influence` at each of these loads, shape (m, per_texel + 2 reach, per_texel + 2 reach) [-].
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
            raise FastModelError(
                f"{count} loads need tables under load of shapes {wanted}, and no table by cell and texel"
            )
        if not count or not (np.diff(self.loads, prepend=0.0) > 0).all():
            raise ValueError("loads must be positive and ascend")
        if self.load_depths is not None and self.load_depths.shape != self.loads.shape:
            raise FastModelError(
                f"load_depths has shape {self.load_depths.shape}; {count} loads need {self.loads.shape}"
            )

    @cached_property
    def under_loads(self) -> tuple[CoverCells, ...]:
        """The cover without load, then at each of `loads`, as covers whose response does not depend on the load."""
        if self.loads is None or self.loaded_compliance is None or self.loaded_influence is None:
            return (self,)
        plain = dataclasses.replace(self, loads=None, load_depths=None, loaded_compliance=None, loaded_influence=None)
        pairs = zip(self.loaded_compliance, self.loaded_influence, strict=True)
        return (plain, *(dataclasses.replace(plain, compliance=c, influence=i) for c, i in pairs))

    def position_among_loads(self, load: float) -> float:
        """Return where a load lies among zero load (0.0), the first of `loads` (1.0) and so on; at most their number.

        Args:
            load: Force of a body on the cover [N].
        """
        if self.loads is None:
            return 0.0
        return float(np.interp(load, np.append(0.0, self.loads), np.arange(len(self.loads) + 1)))

    def load_at_depth(self, depth: float) -> float:
        """Return the load under which the ball of `load_depths` is as deep as given, at least a hundredth of the first.

        Without `load_depths` and beyond the largest of them the load is infinite.

        Args:
            depth: Approach of a body [m].
        """
        if self.loads is None or self.load_depths is None or depth >= self.load_depths[-1]:
            return np.inf
        load = np.interp(depth, np.append(0.0, self.load_depths), np.append(0.0, self.loads))
        return max(float(load), 0.01 * float(self.loads[0]))

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
        """Check that the cells divide the pitch of an array and that the table, if there is one, fits the array.

        Raises:
            FastModelError: If the cells do not divide the pitch, or the table is for another array or an irregular one.
        """
        edges = [pitch / self.per_texel for pitch in array.pitch]
        if not np.allclose(edges, self.cell, rtol=1e-6, atol=0):
            raise FastModelError(
                f"the cover's cells measure {self.cell} m but array {array.name!r} has a pitch of {array.pitch} m: "
                f"{self.per_texel} cells a pitch take {tuple(edges)} m"
            )
        if self.table is not None and not array.regular:
            raise FastModelError(
                f"array {array.name!r} is not a flat, regular grid, which the table of a cover with free side edges "
                f"needs; leave the cells out and use 'boxes', 'area' or Foundation(modulus=...), which take any layout"
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
        # number of pairs of cells within the patch that lie i rows (or j columns) apart
        pairs = [
            np.where(np.arange(n) == 0, count, 2.0 * np.maximum(count - np.arange(n), 0))
            for n, count in zip(self.compliance.shape, (ny, nx), strict=True)
        ]
        return float(nx * ny / (pairs[0] @ self.compliance @ pairs[1]))
