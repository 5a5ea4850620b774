"""How the cover spreads force over texels: a constant linear operator.

Whatever the cover does (Gaussian, tabulated from finite elements, edge-aware), at run time it is one matrix
`[texel, loaded texel]`.  A column need not sum to one: what it lacks left the array or fell on a masked
texel, and is booked as `outside`.  Nothing is reflected and nothing renormalised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fastmodel.errors import ShapeError
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Share of the Gaussian's own mass that the kernel has to hold [-].
KERNEL_MASS = 0.999
#: Texels up to which a dense operator is the fastest one.
DENSE_MOST = 500


class Spread(Protocol):
    """Anything that becomes a matrix on a given array."""

    def operator(self, array: TexelArray) -> FloatArray:
        """Matrix from forces on loaded texels to texel forces, shape (n, n) [-]."""


@dataclass(frozen=True, kw_only=True)
class Gaussian:
    """A Gaussian point spread function, sampled at texel centres, of unit sum over its kernel.

    The convention is OpenCV's `getGaussianKernel`, which the 2015 report used: weights
    exp(-i^2 / (2 sigma^2)) at whole texel offsets i, cut at ksize, divided by their sum; the axes multiply.

    Attributes:
        sigma_x: Standard deviation along the columns' axis [pitches].
        sigma_y: Standard deviation along the rows' axis [pitches].
        ksize_x: Width of the kernel along x, odd [texels].
        ksize_y: Width of the kernel along y, odd [texels].
    """

    sigma_x: float
    sigma_y: float
    ksize_x: int
    ksize_y: int

    def __post_init__(self) -> None:
        """Check the numbers.

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
        """Make a Gaussian with the smallest kernel that holds 99.9 % of its mass along each axis.

        Args:
            sigma_x: Standard deviation along x [pitches].
            sigma_y: Standard deviation along y; that along x when not given [pitches].
        """
        along_y = sigma_x if sigma_y is None else sigma_y
        return cls(
            sigma_x=sigma_x,
            sigma_y=along_y,
            ksize_x=smallest_kernel(sigma_x),
            ksize_y=smallest_kernel(along_y),
        )

    def kernel(self) -> FloatArray:
        """The kernel as an image, shape (ksize_y, ksize_x), unit sum [-]."""
        weights = [
            sampled_gaussian(np.arange(ksize) - ksize // 2, sigma, ksize)
            for sigma, ksize in ((self.sigma_x, self.ksize_x), (self.sigma_y, self.ksize_y))
        ]
        return np.outer(weights[1], weights[0])

    def operator(self, array: TexelArray) -> FloatArray:
        """Matrix `[texel, loaded texel]` on any layout, shape (n, n) [-].

        Offsets are taken in the tangent plane of the loaded texel, in pitches, so that a flat grid gives
        the kernel itself.  Masked texels are not felt (zero rows) but may be loaded: the cover carries on.
        Texels that look away from the loaded one feel nothing of it.  Where a curved layout crowds texels so
        that a column would exceed the load, it is scaled to the load.
        """
        offset_x, offset_y = tangential_offsets(array)
        matrix = sampled_gaussian(offset_x, self.sigma_x, self.ksize_x)
        matrix *= sampled_gaussian(offset_y, self.sigma_y, self.ksize_y)
        matrix[array.normals @ array.normals.T <= 0] = 0.0
        matrix[~array.active] = 0.0
        matrix /= np.maximum(matrix.sum(axis=0), 1.0)
        return matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Tabulated:
    """Any linear operator as a table: from finite elements, edge-aware, position-dependent.

    Attributes:
        matrix: Texel force per unit force on a loaded texel, `[texel, loaded texel]`, shape (n, n) [-].
        source: Where the numbers come from.
    """

    matrix: FloatArray
    source: str = "given by the user"

    def __post_init__(self) -> None:
        """Check and freeze the table.

        Raises:
            ShapeError: If it is not square.
            ValueError: If an entry is not finite.
        """
        if self.matrix.ndim != 2 or self.matrix.shape[0] != self.matrix.shape[1]:  # noqa: PLR2004 -- a matrix
            raise ShapeError(f"a spread operator has shape (n, n), not {self.matrix.shape}")
        if not np.isfinite(self.matrix).all():
            raise ValueError("a spread operator must be finite; this one holds nan or inf")
        self.matrix.setflags(write=False)

    def operator(self, array: TexelArray) -> FloatArray:
        """The table with masked texels silenced, shape (n, n) [-].

        Raises:
            ShapeError: If the table is for another number of texels.
        """
        if len(self.matrix) != array.count:
            raise ShapeError(
                f"the spread operator has shape {self.matrix.shape} but array {array.name!r} has "
                f"{array.count} texels; it must have shape {(array.count, array.count)}"
            )
        return np.where(array.active[:, None], self.matrix, 0.0)


def running_operator(spread: Spread, array: TexelArray) -> FloatArray | sp.csr_array:
    """The operator in the form that is cheapest to apply: dense for small arrays, sparse for large ones.

    Args:
        spread: The spread.
        array: The array.
    """
    if array.count <= DENSE_MOST:
        return spread.operator(array)
    if isinstance(spread, Gaussian) and array.regular:
        return _banded(spread, array)
    return sp.csr_array(spread.operator(array))


def _banded(spread: Gaussian, array: TexelArray) -> sp.csr_array:
    """A Gaussian on an even grid, made without the dense matrix."""
    axes = []
    for count, sigma, ksize in (
        (array.rows, spread.sigma_y, spread.ksize_y),
        (array.columns, spread.sigma_x, spread.ksize_x),
    ):
        reach = min(ksize // 2, count - 1)
        offsets = np.arange(-reach, reach + 1)
        values = sampled_gaussian(offsets, sigma, ksize)
        axes.append(sp.diags_array(values, offsets=offsets, shape=(count, count)))
    whole = sp.csr_array(sp.kron(axes[0], axes[1]))
    return sp.csr_array(sp.diags_array(array.active.astype(np.float64)) @ whole)


def smallest_kernel(sigma: float, mass: float = KERNEL_MASS) -> int:
    """Smallest odd width that holds `mass` of a Gaussian sampled at whole offsets [texels].

    Args:
        sigma: Standard deviation [pitches].
        mass: Share of the sampled Gaussian's sum [-].

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


def sampled_gaussian(offsets: npt.ArrayLike, sigma: float, ksize: int) -> FloatArray:
    """One axis of the kernel at any offsets, same shape as `offsets` [-].

    The value is exp(-d^2 / (2 sigma^2)) over its sum at the whole offsets inside the kernel, zero beyond half
    a texel past the outermost one.

    Args:
        offsets: Distances along the axis [pitches].
        sigma: Standard deviation [pitches].
        ksize: Odd width [texels].
    """
    distance = np.asarray(offsets, dtype=np.float64)
    lattice = np.arange(-(ksize // 2), ksize // 2 + 1)
    total = np.exp(-0.5 * (lattice / sigma) ** 2).sum()
    return np.where(np.abs(distance) < ksize / 2, np.exp(-0.5 * (distance / sigma) ** 2) / total, 0.0)


def tangential_offsets(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Offsets of every texel from every loaded one, in the loaded texel's tangent plane.

    Returns:
        Offsets along x and along y, each `[texel, loaded texel]` of shape (n, n) [pitches].
    """
    axis_x, axis_y = tangent_axes(array)
    offset_x = array.centres @ axis_x.T - np.einsum("ij,ij->i", array.centres, axis_x)
    offset_y = array.centres @ axis_y.T - np.einsum("ij,ij->i", array.centres, axis_y)
    return offset_x / array.pitch[0], offset_y / array.pitch[1]


def tangent_axes(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Unit tangents of every texel, both (n, 3): the array's x projected, and normal x tangent [-]."""
    axis_x = np.array([1.0, 0.0, 0.0]) - array.normals[:, :1] * array.normals
    length = np.linalg.norm(axis_x, axis=1)
    sideways = length < 1e-6  # noqa: PLR2004 -- the texel looks along x: any tangent serves, take the array's y
    axis_x[sideways] = [0.0, 1.0, 0.0]
    length[sideways] = 1.0
    axis_x /= length[:, None]
    return axis_x, np.cross(array.normals, axis_x)


def outside_share(operator: FloatArray) -> FloatArray:
    """Share of a force on each loaded texel that no texel feels, shape (n,): 1 - column sum [-]."""
    return np.asarray(1.0 - operator.sum(axis=0))
