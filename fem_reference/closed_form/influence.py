"""Tabulate the exact response of a wide layered cover to a point load on its top.

The force on a rectangular texel follows from the transfer functions of `layer` by a two-dimensional Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline

from fem_reference.closed_form.layer import point_response, transfer
from meshes import Cover
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class InfluenceSettings:
    """Numbers of the table of texel responses."""

    #: Points per cover thickness of the table of texel responses [-].
    resolution: int = 12
    #: Largest number of points along a side of the table [-].
    most_points: int = 3072
    #: Base pressure, over its largest value, below which it is taken for zero beyond some distance [-].
    negligible: float = 1e-7


_SETTINGS = InfluenceSettings()
#: Distances from the load that are searched, over the cover thickness [-].
_DISTANCES = np.linspace(6.0, 60.0, 109)


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
