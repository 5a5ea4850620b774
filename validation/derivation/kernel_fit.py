"""Fit of the fast model's Gaussian spread kernel to the forces on texels by finite elements."""

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
#: Finite-element response of the texels to loads on the cover.  For a wide cover it is one radial profile; for a cover
#: with free side edges it is a separate solution for each texel.
Influence: TypeAlias = "PointSpread | SolidInfluence"

#: Number of rows and of columns of the grid on which the kernel is fitted if the texels of the array do not form a
#: regular grid: more than any kernel has [-].
_GRID_SIZE = 15


def radial_profile(influence: Influence) -> PointSpread | None:
    """Return the response of a wide cover as a radial profile; None for a cover with free side edges."""
    from fem_reference.linear_response.point_spread import PointSpread

    return influence if isinstance(influence, PointSpread) else None


def fit_kernel(influence: Influence, array: TexelArray) -> Fit:
    """Fit the Gaussian spread kernel to the forces on texels under uniform pressure over the middle texel.

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        array: Texels of the sensor.  If they do not form a regular grid, the fit uses a grid of the same pitch.
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
    """Fit a Gaussian that is not truncated at a kernel width, and return its standard deviation along x [pitches].

    This sigma is a smooth function of the cover's thickness and materials.  The sigma of the truncated kernel is not:
    it jumps where the kernel's width `ksize`, a number of texels, jumps.

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        grid: Texels on a regular grid.
    """
    return fit_kernel(influence, grid).estimates["least-squares-uniform-uncut"][0]


def fitting_grid(array: TexelArray) -> TexelArray:
    """Return the array itself if its texels form a regular grid, else a grid with the array's pitch and texel size."""
    if array.regular:
        return array
    return TexelArray.grid(_GRID_SIZE, _GRID_SIZE, array.pitch, texel_size=array.texel_size)


def _middle_response(influence: Influence, grid: TexelArray, load: Literal["point", "uniform"]) -> FloatArray:
    """Return the forces on texels per unit force on the middle texel, as an image of shape (rows, columns) [-].

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        grid: Texels on a regular grid.
        load: Whether the force acts at the texel's centre or as uniform pressure over the texel.
    """
    return np.asarray(grid.image(influence.texel_response(grid, load=load)), dtype=np.float64)
