"""The cover as data between cells: the displacement of its top, and the force that reaches each texel at its base.

The response of a laterally wide cover does not depend on the place, so two small kernels describe it for arrays of any
size.  Cells divide every pitch evenly; cell `[i, j]` lies i rows and j columns from the texel's lowest, leftmost cell.
Near the free side edges of a cover the force at the base depends on the place as well.  For such a cover a table of
every cell and texel replaces the second kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastmodel.errors import ShapeError
from fastmodel.pressure.separable_convolution import SymmetricConvolution, factorise
from meshes import TexelArray
from meshes.array_types import FloatArray

#: Relative error of the low-rank factorisation of the influence (force on a texel per force on a cell) [-].  It is far
#: below the discretisation error of the cells.
_INFLUENCE_TOLERANCE = 1e-7
#: Edge of the square patch on which the foundation modulus is matched, over the cover's thickness [-].
_PATCH = 4
#: Number of dimensions of a matrix.
_MATRIX = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverCells:
    """The data of a cover for the contact method `cover`.

    Attributes:
        per_texel: Cells along each edge of a pitch [-].
        cell: Edge lengths of a cell along x and y [m].
        compliance: Downward displacement of a cell's centre per uniform pressure on the cell that lies i rows and j
            columns away, entry `[i, j]`, shape (p, q); zero beyond [m/Pa].
        influence: Force on a texel per unit force spread uniformly over cell `[i - reach, j - reach]`, shape
            (per_texel + 2 reach,) * 2; zero beyond [-].
        top_compliance: (1 - nu) / (2 pi mu) of the top layer: near a point load, displacement times distance per unit
            force (Boussinesq) [m2/N].
        thickness: Thickness of the cover [m].
        source: Origin of the data.
        table: Force on each texel of one array per unit force spread uniformly over each of its cells, shape (n,
            rows * per_texel, columns * per_texel).  It replaces `influence` for a cover with free side edges; None for
            others [-].
    """

    per_texel: int
    cell: tuple[float, float]
    compliance: FloatArray
    influence: FloatArray
    top_compliance: float
    thickness: float
    source: str = "given by the user"
    table: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check shapes and values, and make the tables read-only.

        Raises:
            ShapeError: If a table has a wrong shape.
            ValueError: If a number is not finite or not positive.
        """
        s, size = self.per_texel, self.influence.shape
        if s < 1 or s != int(s):
            raise ValueError(f"per_texel must be a whole number from 1 on, not {s}")
        if self.compliance.ndim != _MATRIX or not self.compliance.size:
            raise ShapeError(f"compliance has shape (rows, columns), not {self.compliance.shape}")
        if len(size) != _MATRIX or size[0] != size[1] or size[0] < s or (size[0] - s) % 2:
            raise ShapeError(f"influence has shape ({s} + 2 reach, {s} + 2 reach), not {size}")
        tables = [each for each in (self.compliance, self.influence, self.table) if each is not None]
        if not all(np.isfinite(each).all() for each in tables):
            raise ValueError("compliance and influence must be finite; one holds nan or inf")
        for name, value in (("cell", min(self.cell)), ("top_compliance", self.top_compliance)):
            if not 0 < value < np.inf:
                raise ValueError(f"{name} must be positive, not {value}")
        if not 0 < self.thickness < np.inf or not self.compliance[0, 0] > 0:
            raise ValueError("thickness and the compliance of a cell under its own pressure must be positive")
        for each in tables:
            each.setflags(write=False)

    @property
    def reach(self) -> int:
        """Distance beyond a texel's edge from which force reaches it, in cells [-]."""
        return (len(self.influence) - self.per_texel) // 2

    @cached_property
    def convolution(self) -> SymmetricConvolution:
        """Convolution from forces on cells to displacements of their centres."""
        return SymmetricConvolution(self.compliance / (self.cell[0] * self.cell[1]))

    @cached_property
    def influence_factors(self) -> tuple[FloatArray, FloatArray]:
        """The influence as a sum of products of row and column factors, each of shape (terms, per_texel + 2 reach)."""
        return factorise(self.influence, _INFLUENCE_TOLERANCE)

    def check(self, array: TexelArray) -> None:
        """Check that the cells divide the pitch of an array, and that the table, if any, has its size.

        Raises:
            ShapeError: If one of these does not hold.
        """
        edges = [pitch / self.per_texel for pitch in array.pitch]
        if not np.allclose(edges, self.cell, rtol=1e-6, atol=0):
            raise ShapeError(
                f"the cover's cells measure {self.cell} m but array {array.name!r} has a pitch of {array.pitch} m: "
                f"{self.per_texel} cells a pitch take {tuple(edges)} m"
            )
        if self.table is not None and not array.regular:
            raise ShapeError(
                f"array {array.name!r} is not a flat, regular grid, which the table of a cover with free side edges "
                f"needs; leave the cells out and use 'boxes', 'area' or Foundation(modulus=...), which take any layout"
            )
        wanted = (array.count, array.rows * self.per_texel, array.columns * self.per_texel)
        if self.table is not None and self.table.shape != wanted:
            raise ShapeError(
                f"the table of cells and texels has shape {self.table.shape}; array {array.name!r} takes {wanted}"
            )

    def foundation_modulus(self, width: float | None = None) -> float:
        """Modulus of the elastic foundation that yields like the cover under a square patch [Pa/m].

        This is the uniform pressure on the patch over its mean displacement.  The ratio depends on the size of the
        patch, so the foundation is accurate for contacts of about that size only.

        Args:
            width: Edge length of the square; four times the thickness when not given [m].
        """
        side = _PATCH * self.thickness if width is None else width
        ny, nx = (max(1, round(side / edge)) for edge in self.cell[::-1])
        # how many pairs of cells within the patch lie i rows (or j columns) apart
        pairs = [
            np.where(np.arange(n) == 0, count, 2.0 * np.maximum(count - np.arange(n), 0))
            for n, count in zip(self.compliance.shape, (ny, nx), strict=True)
        ]
        return float(nx * ny / (pairs[0] @ self.compliance @ pairs[1]))
