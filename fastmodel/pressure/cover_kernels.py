"""The cover as data between sub-texel cells: how the top yields, and what of a force arrives on a texel.

A laterally wide cover answers everywhere alike, so two small kernels hold it for arrays of any size.  Cells divide
every pitch evenly; cell `[i, j]` lies i rows and j columns from the texel's lowest, leftmost cell.  A cover with free
side edges passes force on differently near them: a table of every cell and texel stands in for the second kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fastmodel.errors import ShapeError
from fastmodel.pressure.separable_convolution import SymmetricConvolution, factors
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverCells:
    """What the contact method `cover` needs to know of a cover.

    Attributes:
        per_texel: Cells along each edge of a pitch [-].
        cell: Edge lengths of a cell along x and y [m].
        compliance: Downward displacement of a cell's centre per uniform pressure on a cell `[i, j]` rows and columns
            away, shape (p, q); zero beyond [m/Pa].
        influence: Force on a texel per unit force spread evenly over cell `[i - reach, j - reach]`, shape
            (per_texel + 2 reach,) * 2; zero beyond [-].
        top_compliance: (1 - nu) / (2 pi mu) of the top layer: what a point load does nearby, over the distance [m2/N].
        thickness: Of the cover [m].
        source: Where the numbers come from.
        table: Of a cover with free side edges: force on each texel of one array per unit force spread evenly over each
            of its cells, shape (n, rows * per_texel, columns * per_texel), instead of `influence`; None elsewhere [-].
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
        """Check shapes and values, and freeze the tables.

        Raises:
            ShapeError: If a table has no shape that fits.
            ValueError: If a number is not finite or not positive.
        """
        s, size = self.per_texel, self.influence.shape
        if s < 1 or s != int(s):
            raise ValueError(f"per_texel must be a whole number from 1 on, not {s}")
        if self.compliance.ndim != 2 or not self.compliance.size:  # noqa: PLR2004 -- a matrix
            raise ShapeError(f"compliance has shape (rows, columns), not {self.compliance.shape}")
        if len(size) != 2 or size[0] != size[1] or size[0] < s or (size[0] - s) % 2:  # noqa: PLR2004 -- a matrix
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
        """Cells beside a texel from which force arrives on it [-]."""
        return (len(self.influence) - self.per_texel) // 2

    @cached_property
    def convolution(self) -> SymmetricConvolution:
        """Forces on cells to displacements of their centres."""
        return SymmetricConvolution(self.compliance / (self.cell[0] * self.cell[1]))

    @cached_property
    def influence_factors(self) -> tuple[FloatArray, FloatArray]:
        """The influence as products of row and column factors."""
        return factors(self.influence, 1e-7)

    def check(self, array: TexelArray) -> None:
        """Check that the cells divide an array's pitch, and that a table is of its size.

        Raises:
            ShapeError: If they do not.
        """
        edges = [pitch / self.per_texel for pitch in array.pitch]
        if not np.allclose(edges, self.cell, rtol=1e-6, atol=0):
            raise ShapeError(
                f"the cover's cells measure {self.cell} m but array {array.name!r} has a pitch of {array.pitch} m: "
                f"{self.per_texel} cells a pitch take {tuple(edges)} m"
            )
        if self.table is not None and not array.regular:
            raise ShapeError(
                f"array {array.name!r} is not a flat, even grid, and the table of a cover with free side edges is for "
                f"one; leave the cells out and use 'boxes', 'area' or Foundation(modulus=...), which take any layout"
            )
        wanted = (array.count, array.rows * self.per_texel, array.columns * self.per_texel)
        if self.table is not None and self.table.shape != wanted:
            raise ShapeError(
                f"the table of cells and texels has shape {self.table.shape}; array {array.name!r} takes {wanted}"
            )

    def foundation_modulus(self, width: float | None = None) -> float:
        """Pressure per depth of the elastic foundation that yields like the cover under one square patch [Pa/m].

        The mean displacement under uniform pressure on a square; an elastic foundation has no such width, so it is
        right for contacts of about that size only.

        Args:
            width: Edge length of the square; four times the thickness when not given [m].
        """
        side = 4 * self.thickness if width is None else width
        ny, nx = (max(1, round(side / edge)) for edge in self.cell[::-1])
        rows, columns = self.compliance.shape
        share = [
            np.where(np.arange(n) == 0, count, 2.0 * np.maximum(count - np.arange(n), 0))
            for n, count in ((rows, ny), (columns, nx))
        ]
        return float(nx * ny / (share[0] @ self.compliance @ share[1]))
