"""A Gaussian point spread in surface coordinates, fitted to the responses of the texels of a curved cover.

It describes a cover in two numbers for a report; the contact method `curved` does not use it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from fastmodel.errors import FastModelError
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

    def spread(self, array: TexelArray, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Compute the force on each texel per unit normal force on points of the surface.

        Args:
            array: n texels; inactive ones get no force.
            points: Points above the base or on it, shape (p, 3) [m].
            normals: Unit normals of the surface at these points, shape (p, 3) [-].

        Returns:
            Shares, shape (p, n) [-].
        """
        return _integrate(unroll_from(array, points, normals), np.array(self.sigma), array.texel_size) * array.active


def fit_surface_gaussian(array: TexelArray, response: FloatArray) -> SurfaceGaussian:
    """Fit a Gaussian to the responses of n texels.

    Args:
        array: The texels on the base.
        response: Force on each texel (column) per unit force over each texel (row), shape (n, n) [-].

    Raises:
        FastModelError: If the response is for another number of texels.
    """
    if response.shape != (array.count, array.count):
        raise FastModelError(f"a response of {array.count} texels has shape {(array.count,) * 2}, not {response.shape}")
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
    """Compute the places of all texels in the surface coordinates of each; see `unroll_from`.

    Returns:
        Places, shape (n from, n to, 2) [m].
    """
    return unroll_from(array, array.centres, array.normals)


def unroll_from(array: TexelArray, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Compute the places of all texels in the surface coordinates of points: arc lengths along tangent axes.

    The arc between a point and a texel counts as part of a circle that turns by the angle of their normals, in the
    direction in which the normal turns; lengths across it are as they are.  This is exact on planes, spheres, and
    cylinders.

    Args:
        array: n texels.
        points: Points of the surface, shape (p, 3) [m].
        normals: Unit normals of the surface at these points, shape (p, 3) [-].

    Returns:
        Places, shape (p, n, 2) [m].
    """
    apart = array.centres[None] - points[:, None]
    axes = tangent_axes(normals)
    flat = np.einsum("lad,ltd->lta", axes, apart)
    turn = np.arccos(np.clip(normals @ array.normals.T, -1.0, 1.0))
    towards = np.einsum("lad,td->lta", axes, array.normals)
    towards /= np.maximum(np.linalg.norm(towards, axis=2, keepdims=True), np.finfo(float).eps)
    # np.sinc(x / pi) is sin(x) / x: a chord's projection on the tangent plane is R sin(turn), its arc R turn
    longer = 1 / np.maximum(np.sinc(turn / np.pi), np.finfo(float).eps) - 1
    along = np.einsum("lta,lta->lt", flat, towards)
    return np.asarray(flat + (longer * along)[..., None] * towards)


def _integrate(place: FloatArray, sigma: FloatArray, size: tuple[float, float]) -> FloatArray:
    """Integrate the Gaussian over texels at places in surface coordinates, shape (n, n) [-]."""
    half = np.array(size) / 2
    return np.asarray((ndtr((place + half) / sigma) - ndtr((place - half) / sigma)).prod(axis=-1))
