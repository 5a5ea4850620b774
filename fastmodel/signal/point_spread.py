"""The point spread of the cover: a constant linear operator from contact forces on texels to measured texel forces.

Every model of the point spread (a Gaussian, a table from finite elements) is applied as one matrix `[texel, loaded
texel]`.  A column may sum to less than one: the difference is the force that leaves the array or acts on masked
texels, and counts as `outside`.  This force is neither reflected at the edges of the array nor distributed over the
other texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fastmodel.errors import FastModelError
from meshes import TexelArray
from meshes.array_types import FloatArray

#: Smallest share of the sum of a sampled Gaussian that its kernel must contain [-]; it determines the kernel's width.
KERNEL_MASS = 0.999
#: Largest number of texels for which the operator is a dense matrix [-]; for more texels, a sparse matrix is faster.
DENSE_MOST = 500
#: Length of the array's x axis, projected on a texel's plane, below which the texel's normal counts as parallel to the
#: x axis [-].
_PARALLEL = 1e-6


class Spread(Protocol):
    """A model of the point spread."""

    def operator(self, array: TexelArray) -> FloatArray:
        """Compute the matrix `[texel, loaded texel]` from contact forces to texel forces, shape (n, n) [-].

        Args:
            array: The array of n texels.
        """


@dataclass(frozen=True, kw_only=True)
class Gaussian:
    """A Gaussian point spread function, sampled at texel centres, with unit sum over its kernel.

    The weight at the whole texel offsets i and j is g(i, sigma_x) g(j, sigma_y), where g is exp(-i^2 / (2 sigma^2))
    divided by its sum over the kernel.
    Source: OpenCV's `getGaussianKernel`, which the 2015 report used.

    Attributes:
        sigma_x: Standard deviation along x [pitches].
        sigma_y: Standard deviation along y [pitches].
        ksize_x: Width of the kernel along x, odd [texels].
        ksize_y: Width of the kernel along y, odd [texels].
    """

    sigma_x: float
    sigma_y: float
    ksize_x: int
    ksize_y: int

    def __post_init__(self) -> None:
        """Check the standard deviations and the widths of the kernel.

        Raises:
            ValueError: If a sigma is not positive or a ksize not a positive odd number.
        """
        if not (0 < self.sigma_x < np.inf and 0 < self.sigma_y < np.inf):
            raise ValueError(f"sigma must be positive, not {self.sigma_x} and {self.sigma_y} pitches")
        for ksize in (self.ksize_x, self.ksize_y):
            if ksize < 1 or ksize % 2 != 1:
                raise ValueError(f"ksize must be a positive odd number of texels, not {ksize}")

    @classmethod
    def from_sigma(cls, sigma_x: float, sigma_y: float | None = None) -> Gaussian:
        """Make a Gaussian with the smallest kernel that contains 99.9 % of its sum along each axis.

        Args:
            sigma_x: Standard deviation along x [pitches].
            sigma_y: Standard deviation along y, by default equal to sigma_x [pitches].
        """
        along_y = sigma_x if sigma_y is None else sigma_y
        return cls(
            sigma_x=sigma_x,
            sigma_y=along_y,
            ksize_x=find_smallest_kernel(sigma_x),
            ksize_y=find_smallest_kernel(along_y),
        )

    def kernel(self) -> FloatArray:
        """Return the force on the texels around a loaded texel per unit force, shape (ksize_y, ksize_x) [-]."""
        weights = [
            sample_gaussian(np.arange(ksize) - ksize // 2, sigma, ksize)
            for sigma, ksize in ((self.sigma_x, self.ksize_x), (self.sigma_y, self.ksize_y))
        ]
        return np.outer(weights[1], weights[0])

    def operator(self, array: TexelArray) -> FloatArray:
        """Compute the matrix `[texel, loaded texel]` for n texels in any layout, shape (n, n) [-].

        Offsets between texels are measured in pitches in the tangent plane of the loaded texel, so that each column
        of a flat grid is the kernel itself.  Rows of masked texels are zero, but their columns are not: a load on a
        masked texel spreads to its neighbours.  Entries between texels whose normals are 90 degrees or more apart are
        zero.  Columns of a curved layout that sum to more than one are scaled to unit sum.

        Args:
            array: The array of n texels.
        """
        offset_x, offset_y = measure_offsets(array)
        matrix = sample_gaussian(offset_x, self.sigma_x, self.ksize_x)
        matrix *= sample_gaussian(offset_y, self.sigma_y, self.ksize_y)
        matrix[array.normals @ array.normals.T <= 0] = 0.0
        matrix[~array.active] = 0.0
        matrix /= np.maximum(matrix.sum(axis=0), 1.0)
        return matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Tabulated:
    """A point spread given as a matrix, for example from finite elements for a cover with free side edges.

    Attributes:
        matrix: Texel force per unit force on a loaded texel, `[texel, loaded texel]`, shape (n, n) [-].
        source: Origin of the numbers.
    """

    matrix: FloatArray
    source: str = "given by the user"

    def __post_init__(self) -> None:
        """Check the matrix and make it read-only.

        Raises:
            FastModelError: If the matrix is not square.
            ValueError: If an entry is not finite.
        """
        if self.matrix.ndim != 2 or self.matrix.shape[0] != self.matrix.shape[1]:  # noqa: PLR2004 -- a matrix
            raise FastModelError(f"a spread operator has shape (n, n), not {self.matrix.shape}")
        if not np.isfinite(self.matrix).all():
            raise ValueError("a spread operator must be finite; this one holds nan or inf")
        self.matrix.setflags(write=False)

    def operator(self, array: TexelArray) -> FloatArray:
        """Return the matrix with zero rows for masked texels, shape (n, n) [-].

        Args:
            array: The array of n texels.

        Raises:
            FastModelError: If the matrix is for another number of texels.
        """
        if len(self.matrix) != array.count:
            raise FastModelError(
                f"the spread operator has shape {self.matrix.shape} but array {array.name!r} has "
                f"{array.count} texels; it must have shape {(array.count, array.count)}"
            )
        return np.where(array.active[:, None], self.matrix, 0.0)


def build_operator(spread: Spread, array: TexelArray) -> FloatArray | sp.csr_array:
    """Build the spread operator as a dense or sparse matrix, whichever is faster to apply, shape (n, n) [-].

    Args:
        spread: The point spread.
        array: The array of n texels.
    """
    if array.count <= DENSE_MOST:
        return spread.operator(array)
    if isinstance(spread, Gaussian) and array.regular:
        return _build_banded(spread, array)
    return sp.csr_array(spread.operator(array))


def _build_banded(spread: Gaussian, array: TexelArray) -> sp.csr_array:
    """Build the sparse operator of a Gaussian on a flat, regular grid without a dense one, shape (n, n) [-]."""
    axes = []
    for count, sigma, ksize in (
        (array.rows, spread.sigma_y, spread.ksize_y),
        (array.columns, spread.sigma_x, spread.ksize_x),
    ):
        reach = min(ksize // 2, count - 1)
        offsets = np.arange(-reach, reach + 1)
        values = sample_gaussian(offsets, sigma, ksize)
        axes.append(sp.diags_array(values, offsets=offsets, shape=(count, count)))
    whole = sp.csr_array(sp.kron(axes[0], axes[1]))
    return sp.csr_array(sp.diags_array(array.active.astype(np.float64)) @ whole)


def find_smallest_kernel(sigma: float, mass: float = KERNEL_MASS) -> int:
    """Find the smallest odd width of a kernel that contains a given share of a sampled Gaussian [texels].

    The Gaussian is sampled at whole offsets in texels.

    Args:
        sigma: Standard deviation [pitches].
        mass: Share of the sum of the sampled Gaussian [-].

    Raises:
        ValueError: If sigma is not positive and finite.
    """
    if not 0 < sigma < np.inf:
        raise ValueError(f"sigma must be positive, not {sigma} pitches")
    reach = int(np.ceil(10 * sigma)) + 1
    weights = np.exp(-0.5 * (np.arange(reach + 1) / sigma) ** 2)
    weights[1:] *= 2
    held = np.cumsum(weights) / weights.sum()
    return 2 * int(np.argmax(held >= mass)) + 1


def sample_gaussian(offsets: npt.ArrayLike, sigma: float, ksize: int) -> FloatArray:
    """Evaluate the factor of a Gaussian kernel along one axis at given offsets, same shape as `offsets` [-].

    The value at offset d is exp(-d^2 / (2 sigma^2)) over the sum of this expression at the whole offsets inside the
    kernel.  The value is zero where |d| is at least ksize / 2.

    Args:
        offsets: Distances along the axis, any shape [pitches].
        sigma: Standard deviation [pitches].
        ksize: Width of the kernel, odd [texels].
    """
    distance = np.asarray(offsets, dtype=np.float64)
    lattice = np.arange(-(ksize // 2), ksize // 2 + 1)
    total = np.exp(-0.5 * (lattice / sigma) ** 2).sum()
    return np.where(np.abs(distance) < ksize / 2, np.exp(-0.5 * (distance / sigma) ** 2) / total, 0.0)


def measure_offsets(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Compute the offset of every texel from every loaded texel, in the tangent plane of the loaded texel.

    Args:
        array: The array of n texels.

    Returns:
        Offsets along x and along y, each `[texel, loaded texel]` of shape (n, n) [pitches].
    """
    axis_x, axis_y = find_tangents(array)
    offset_x = array.centres @ axis_x.T - np.einsum("ij,ij->i", array.centres, axis_x)
    offset_y = array.centres @ axis_y.T - np.einsum("ij,ij->i", array.centres, axis_y)
    return offset_x / array.pitch[0], offset_y / array.pitch[1]


def find_tangents(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Compute two unit tangents of each of n texels, each of shape (n, 3) [-].

    The first tangent is the array's x axis projected on the texel's plane, or the array's y axis if the projection
    vanishes.  The second tangent is the cross product of the texel's normal and the first tangent.

    Args:
        array: The array of n texels.
    """
    axis_x = np.array([1.0, 0.0, 0.0]) - array.normals[:, :1] * array.normals
    length = np.linalg.norm(axis_x, axis=1)
    sideways = length < _PARALLEL
    axis_x[sideways] = [0.0, 1.0, 0.0]
    length[sideways] = 1.0
    axis_x /= length[:, None]
    return axis_x, np.cross(array.normals, axis_x)
