"""The cells that divide the pitches of an array and of a margin around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

if TYPE_CHECKING:
    from fastmodel.pressure.gap_sampling import Samples

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """Cells that divide the pitches of a flat grid and of a margin around it.

    Attributes:
        per_texel: Cells along each edge of a pitch [-].
        rows: Rows of cells, margin included [-].
        columns: Columns of cells, margin included [-].
        margin: Cells beyond the array on each side [-].
        edge: Edge lengths of a cell along x and y [m].
        low: Lowest corner in the array's frame, shape (2,) [m].
        texel_columns: Columns of the array [-].
    """

    per_texel: int
    rows: int
    columns: int
    margin: int
    edge: tuple[float, float]
    low: FloatArray
    texel_columns: int

    @classmethod
    def over(cls, array: TexelArray, per_texel: int, margin: int) -> CellGrid:
        """Cells over a planar grid and `margin` pitches around it."""
        edge = (array.pitch[0] / per_texel, array.pitch[1] / per_texel)
        beyond = margin * per_texel
        half_pitch = np.array(array.pitch) / 2
        return cls(
            per_texel=per_texel,
            rows=array.rows * per_texel + 2 * beyond,
            columns=array.columns * per_texel + 2 * beyond,
            margin=beyond,
            edge=edge,
            low=array.centres[0, :2] - half_pitch - beyond * np.array(edge),
            texel_columns=array.columns,
        )

    @property
    def texels(self) -> int:
        """Number of texels [-]."""
        return (self.rows - 2 * self.margin) * (self.columns - 2 * self.margin) // self.per_texel**2

    def on_texels(self, samples: Samples, forces: FloatArray) -> FloatArray:
        """Sums of cell forces (m,) over texels, those in the margin left out, shape (n,) [N]."""
        felt = self._felt.take(samples.row * self.columns + samples.column)
        return np.bincount(felt, forces, self.texels + 1)[1:].astype(np.float64, copy=False)

    def window_on_texels(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """The same for forces on a window of cells (rows, columns), which may reach beyond the grid where it is zero.

        Args:
            forces: On the window's cells [N].
            origin: Row and column of its first cell in the grid.
        """
        top, left = max(0, -origin[0]), max(0, -origin[1])
        inside = forces[top : max(0, self.rows - origin[0]), left : max(0, self.columns - origin[1])]
        row, column = origin[0] + top, origin[1] + left
        felt = self._felt.reshape(self.rows, self.columns)
        felt = felt[row : row + inside.shape[0], column : column + inside.shape[1]]
        return np.bincount(felt.ravel(), inside.ravel(), self.texels + 1)[1:].astype(np.float64, copy=False)

    @cached_property
    def _felt(self) -> IntArray:
        """One more than the texel of each cell, 0 in the margin, shape (rows * columns,)."""
        return self.texel(*np.divmod(np.arange(self.rows * self.columns), self.columns)) + 1

    def texel(self, row: IntArray, column: IntArray) -> IntArray:
        """Texel of each cell, -1 in the margin, same shape."""
        i, j = row - self.margin, column - self.margin
        inside = (i >= 0) & (j >= 0) & (i < self.rows - 2 * self.margin) & (j < self.columns - 2 * self.margin)
        return np.asarray(np.where(inside, i // self.per_texel * self.texel_columns + j // self.per_texel, -1))
