"""A Gaussian point spread in surface coordinates, fitted to the responses of the texels of a curved cover.

It describes a cover in two numbers for a report; the contact method `curved` does not use it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from fastmodel.errors import ShapeError
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.solids.texels import tangent_axes

#: Smallest and largest sigma in the search, over the texel pitch [-].
_RANGE = (0.05, 20.0)


@dataclass(frozen=True, kw_only=True)
class SurfaceGaussian:
    """Gaussian along the two tangent axes of the loaded texel, by unweighted least squares over all pairs of texels.

    Attributes:
        sigma: Standard deviations along the first and the second tangent axis, on the base [m].
        residual: Half the sum of absolute differences between response and Gaussian over the load, mean over the loaded
            texels [-].
    """

    sigma: tuple[float, float]
    residual: float


def fit_surface_gaussian(array: TexelArray, response: FloatArray) -> SurfaceGaussian:
    """Fit a Gaussian to the responses of n texels.

    Args:
        array: The texels on the base.
        response: Force on each texel (column) per unit force over each texel (row), shape (n, n) [-].

    Raises:
        ShapeError: If the response is for another number of texels.
    """
    if response.shape != (array.count, array.count):
        raise ShapeError(f"a response of {array.count} texels has shape {(array.count,) * 2}, not {response.shape}")
    place = unroll(array)
    pairs = np.ix_(array.active, array.active)
    place, wanted = place[pairs], response[pairs]

    def differ(logarithm: FloatArray) -> FloatArray:
        return np.asarray(_integrate(place, np.exp(logarithm), array.texel_size) - wanted).ravel()

    bounds = np.log(np.outer(_RANGE, array.pitch))
    found = least_squares(differ, np.log(0.5 * np.array(array.pitch)), bounds=bounds)
    sigma = np.exp(found.x)
    rest = np.abs(found.fun.reshape(wanted.shape)).sum(axis=1) / 2
    return SurfaceGaussian(sigma=(float(sigma[0]), float(sigma[1])), residual=float(rest.mean()))


def unroll(array: TexelArray) -> FloatArray:
    """Compute the places of all texels in the surface coordinates of each: arc lengths along its tangent axes.

    The arc between two texels counts as part of a circle that turns by the angle of their normals: exact on planes,
    cylinders about the y axis in x and y, and spheres.

    Returns:
        Places, shape (n from, n to, 2) [m].
    """
    apart = array.centres[None] - array.centres[:, None]
    flat = np.einsum("lad,ltd->lta", tangent_axes(array.normals), apart)
    turn = np.arccos(np.clip(array.normals @ array.normals.T, -1.0, 1.0))
    # np.sinc(x / pi) is sin(x) / x: a chord's projection on the tangent plane is R sin(turn), its arc R turn
    return np.asarray(flat / np.maximum(np.sinc(turn / np.pi), np.finfo(float).eps)[..., None])


def _integrate(place: FloatArray, sigma: FloatArray, size: tuple[float, float]) -> FloatArray:
    """Integrate the Gaussian over texels at places in surface coordinates, shape (n, n) [-]."""
    half = np.array(size) / 2
    return np.asarray((ndtr((place + half) / sigma) - ndtr((place - half) / sigma)).prod(axis=-1))
