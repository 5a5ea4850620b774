"""Tabulate the exact response of a wide layered cover to a point load on its top.

Two tables serve the boundary elements: the displacement of the top beyond that of a half space, and the force on a
rectangular texel.  Both follow from the transfer functions of `layer`, by a Hankel transform on logarithmic grids
(Hamilton 2000, MNRAS 312, appendix B: `scipy.fft.fht`) and by a two-dimensional Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import fht, fhtoffset
from scipy.interpolate import CubicSpline, RectBivariateSpline

from fem_reference.closed_form.layer import point_response, transfer
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class InfluenceSettings:
    """Numbers of the Hankel transform and of the table of texel responses."""

    #: Exponent of the power law that weights the integrand of the Hankel transform, so that it vanishes at both ends
    #: [-].
    bias: float = -0.5
    #: Product of wave number and thickness of the top layer beyond which the cover responds like a half space: exp(-2
    #: x 30) = 1e-26 [-].
    deep: float = 30.0
    #: Points per cover thickness of the table of texel responses [-].
    resolution: int = 12
    #: Largest number of points along a side of the table [-].
    most_points: int = 3072
    #: Base pressure, over its largest value, below which it is taken for zero beyond some distance [-].
    negligible: float = 1e-7


_SETTINGS = InfluenceSettings()
#: Distances from the load that are searched, over the cover thickness [-].
_DISTANCES = np.linspace(6.0, 60.0, 109)


#: Points of the logarithmic grids, and natural logarithm of their largest over their middle value [-].
LOGARITHMIC_POINTS, LOGARITHMIC_HALF_WIDTH = 8192, 20.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Excess:
    """Displacement of the top of a cover under a unit point load, less that of a half space of the top layer.

    Attributes:
        half_space: Displacement times distance on the half space, (1 - nu) / (2 pi mu) [m2/N].
        table: Excess over the logarithm of the distance from the load [m/N].
    """

    half_space: float
    table: CubicSpline

    def __call__(self, distance: FloatArray) -> FloatArray:
        """Evaluate the excess at distances r >= 0 from the load, any shape [m/N]."""
        logarithm = np.log(np.maximum(distance, np.exp(self.table.x[0])))
        return np.asarray(self.table(np.minimum(logarithm, self.table.x[-1])))


def tabulate_excess(cover: Cover) -> Excess:
    """Tabulate the displacement of a wide cover's top under a unit point load, beyond that of a half space.

    (1 / 2 pi) int (C(k) - c / k) J0(k r) k dk, with the compliance C of the cover and c = (1 - nu) / mu of its top
    layer.  The integrand is -c at k = 0; the transform -c / sqrt(r^2 + b^2) of -c exp(-b k) is separated to make it
    vanish there.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
    """
    top = cover.layers[-1]
    plane = (1 - top.material.poisson_ratio) / top.material.shear_modulus
    step = 2 * LOGARITHMIC_HALF_WIDTH / LOGARITHMIC_POINTS
    middle = 1 / np.sqrt(top.thickness * cover.thickness)
    k = middle * np.exp(step * (np.arange(LOGARITHMIC_POINTS) + 0.5) - LOGARITHMIC_HALF_WIDTH)
    deep = k * top.thickness > _SETTINGS.deep
    known = transfer(cover, np.where(deep, _SETTINGS.deep / top.thickness, k)).compliance
    excess = np.where(deep, 0.0, known * k - plane)
    offset = fhtoffset(step, 0.0, bias=_SETTINGS.bias)
    shifted = fht(excess + plane * np.exp(-k * cover.thickness), step, 0.0, offset=offset, bias=_SETTINGS.bias)
    r = np.exp(offset) / k[::-1]
    value = (shifted / r - plane / np.hypot(r, cover.thickness)) / (2 * np.pi)
    inside = (r > 1e-4 * top.thickness) & (r < 1e4 * cover.thickness)
    return Excess(half_space=plane / (2 * np.pi), table=CubicSpline(np.log(r[inside]), value[inside]))


def find_reach(cover: Cover) -> float:
    """Find the distance from a point load beyond which the pressure on the base is negligible [m]."""
    pressure = np.abs(point_response(cover, cover.thickness * _DISTANCES))
    largest = abs(float(point_response(cover, 0.0)))
    left = np.flatnonzero(pressure > _SETTINGS.negligible * largest)
    return float(
        cover.thickness * _DISTANCES[min(left[-1] + 1, len(_DISTANCES) - 1)] if len(left) else 6 * cover.thickness
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelResponse:
    """Share of a unit point load on the top of a wide cover that a rectangular texel receives.

    Attributes:
        half: Largest distance of the load from the texel's centre in the table, along x and y [m].
        table: Share over the distance of the load along x and y [-].
    """

    half: tuple[float, float]
    table: RectBivariateSpline

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Evaluate the share for loads at (x, y) from the texel's centre, arrays of one shape [-]."""
        x, y = np.abs(x), np.abs(y)
        near = (x <= self.half[0]) & (y <= self.half[1])
        out = np.zeros(near.shape)
        out[near] = self.table.ev(x[near], y[near])
        return out


def tabulate_texel_response(cover: Cover, size: tuple[float, float]) -> TexelResponse:
    """Tabulate the share of a unit point load that a texel receives, over the position of the load.

    The pressure on the base times the texel's indicator function is one inverse Fourier transform of base(k)
    sinc(kx a) sinc(ky b) 4 a b, with half edge lengths a and b.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        size: Edge lengths of the texel along x and y [m].
    """
    reach = find_reach(cover)
    half = tuple(edge / 2 + reach for edge in size)
    count = [
        min(_SETTINGS.most_points, 2 * int(np.ceil(each * _SETTINGS.resolution / cover.thickness))) for each in half
    ]
    spacing = [2 * each / n for each, n in zip(half, count, strict=True)]
    kx, ky = (2 * np.pi * np.fft.fftfreq(n, d) for n, d in zip(count, spacing, strict=True))
    ky = np.abs(ky[: count[1] // 2 + 1])
    radial = np.linspace(0.0, float(np.hypot(np.abs(kx).max(), ky.max())), 6000)
    base = CubicSpline(radial, transfer(cover, np.minimum(radial, 60.0 / cover.thickness)).base)
    spectrum = base(np.hypot(kx[:, None], ky)) * np.outer(
        size[0] * np.sinc(kx * size[0] / (2 * np.pi)), size[1] * np.sinc(ky * size[1] / (2 * np.pi))
    )
    share = np.fft.irfft2(spectrum, s=count) / (spacing[0] * spacing[1])
    # Keep some points on the other side of each axis of symmetry, where the spline then has no end.
    axes = [d * np.arange(-4, n // 2 + 1) for n, d in zip(count, spacing, strict=True)]
    index = [np.arange(-4, n // 2 + 1) % n for n in count]
    table = RectBivariateSpline(axes[0], axes[1], share[np.ix_(*index)], kx=5, ky=5)
    return TexelResponse(half=(float(axes[0][-1]), float(axes[1][-1])), table=table)


def superpose(cover: Cover, array: TexelArray, x: FloatArray, y: FloatArray, force: FloatArray) -> FloatArray:
    """Compute the forces on the n texels of an array under point loads on a wide cover, shape (n,) [N].

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        array: Array with the texels.
        x: x coordinates of the m loads in the frame of the array, shape (m,) [m].
        y: y coordinates of the loads, shape (m,) [m].
        force: Loads, shape (m,) [N].
    """
    response = tabulate_texel_response(cover, array.texel_size)
    out = np.array([response(x - cx, y - cy) @ force for cx, cy in array.centres[:, :2]])
    return np.where(array.active, out, 0.0)
