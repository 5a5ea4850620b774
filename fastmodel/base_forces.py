"""From forces on cells of the top to forces on texels at the base: one convolution, taken at the texels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import fft

from fastmodel.cover_cells import CoverCells
from fastmodel.sampling import CellGrid
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

_SPECTRA = 64


class BaseForces:
    """The influence of cells on the texels of one array, over windows of cells."""

    def __init__(self, cells: CoverCells, grid: CellGrid, array: TexelArray) -> None:
        """Prepare the kernel."""
        self._cells, self._grid, self._array = cells, grid, array
        self._reach = cells.reach
        self._flipped = cells.influence[::-1, ::-1]
        self._spectra: dict[tuple[int, int], npt.NDArray[np.complex128]] = {}

    def of_window(self, forces: FloatArray, origin: tuple[int, int]) -> FloatArray:
        """Force on each texel, masked ones zero, shape (n,) [N].

        Args:
            forces: On a window of cells, shape (rows, columns) [N].
            origin: Row and column of the window's first cell in the grid.
        """
        s, size = self._cells.per_texel, len(self._flipped)
        rows, columns = (n + size - 1 for n in forces.shape)
        padded = (fft.next_fast_len(rows, real=True), fft.next_fast_len(columns, real=True))
        if padded not in self._spectra:
            if len(self._spectra) >= _SPECTRA:
                self._spectra.clear()
            self._spectra[padded] = fft.rfft2(self._flipped, padded)
        full = fft.irfft2(fft.rfft2(forces, padded) * self._spectra[padded], padded)[:rows, :columns]
        # full[k, l] is the force on a texel whose first cell is k, l cells beyond the window's first one, less `shift`
        shift = s + self._reach - 1
        texels = np.zeros((self._array.rows, self._array.columns))
        spans = []
        for start, length, count in zip(origin, (rows, columns), texels.shape, strict=True):
            first = self._grid.margin - start + shift  # where texel 0 stands in `full`
            low = max(0, -(first // s))
            high = min(count, (length - 1 - first) // s + 1)
            spans.append((low, high, first + low * s))
        (r0, r1, i), (c0, c1, j) = spans
        if r0 < r1 and c0 < c1:
            texels[r0:r1, c0:c1] = full[i : i + (r1 - r0 - 1) * s + 1 : s, j : j + (c1 - c0 - 1) * s + 1 : s]
        return np.where(self._array.active, texels.ravel(), 0.0)

    def of_texels(self, contact_forces: FloatArray) -> FloatArray:
        """The same for forces spread evenly over each texel's cells, shape (n,) to (n,) [N]."""
        s = self._cells.per_texel
        image = contact_forces.reshape(self._array.rows, self._array.columns)
        even = np.kron(image, np.full((s, s), 1 / s**2))
        return self.of_window(even, (self._grid.margin, self._grid.margin))
