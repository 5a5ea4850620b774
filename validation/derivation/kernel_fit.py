"""Fit of the fast model's Gaussian kernel to texel responses of the finite elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from fastmodel.fitting.gaussian import Fit, fit_gaussian
from meshes import TexelArray

if TYPE_CHECKING:
    from fem_reference.linear_response.finite_cover import SolidInfluence
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]
#: The reference's response to loads on the cover.  That of a wide cover is one radial profile; that of a cover with
#: free side edges is a separate solution for each texel.
Influence: TypeAlias = "PointSpread | SolidInfluence"

#: Rows and columns of the grid on which the kernel is fitted if the array itself is no grid: wider than any kernel [-].
_GRID_SIZE = 15


def radial_profile(influence: Influence) -> PointSpread | None:
    """The response as a radial profile; None for a cover with free side edges, which has no single profile."""
    from fem_reference.linear_response.point_spread import PointSpread

    return influence if isinstance(influence, PointSpread) else None


def fit_kernel(influence: Influence, array: TexelArray) -> Fit:
    """Fit the Gaussian kernel to the response to uniform pressure over one texel.

    Args:
        influence: The reference's response.
        array: The sensor's texels.  If they form no regular grid, the fit uses a grid of the same pitch.
    """
    grid = fitting_grid(array)
    profile = radial_profile(influence)
    return fit_gaussian(
        _middle_response(influence, grid, "uniform"),
        (grid.rows // 2, grid.columns // 2),
        active=grid.image(grid.active),
        point_response=_middle_response(influence, grid, "point"),
        radius=None if profile is None else profile.radius,
        pressure_per_force=None if profile is None else profile.pressure_per_force,
        pitch=grid.pitch,
    )


def uncut_sigma(influence: Influence, grid: TexelArray) -> float:
    """Sigma along x of the Gaussian without a kernel width, fitted to the uniform response [pitches].

    It is a smooth function of the cover.  The sigma of the cut kernel is not: it jumps where ksize jumps.

    Args:
        influence: The reference's response.
        grid: Texels on a regular grid.
    """
    return fit_kernel(influence, grid).estimates["least-squares-uniform-uncut"][0]


def fitting_grid(array: TexelArray) -> TexelArray:
    """The array itself if its texels form a regular grid, else a grid of its pitch and texel size."""
    if array.regular:
        return array
    return TexelArray.grid(_GRID_SIZE, _GRID_SIZE, array.pitch, texel_size=array.texel_size)


def _middle_response(influence: Influence, grid: TexelArray, load: Literal["point", "uniform"]) -> FloatArray:
    """Response to unit force on the middle texel as an image, shape (rows, columns) [-]."""
    return np.asarray(grid.image(influence.texel_response(grid, load=load)), dtype=np.float64)
