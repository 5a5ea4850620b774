"""Compute the displacement vectors of the top of a wide cover under pressure and shear.

The components are downwards, along x and along y.  As in `surface_compliance`, the displacement is that of a half space
of the top layer's material (Cerruti 1882; Johnson, Contact Mechanics, 1985, section 3.6) plus a regular part that is
tabulated from a finite-element solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import (
    SurfaceCompliance,
    Waves,
    cut_triangular,
    decay_length,
    difference_twice,
    membrane_length,
    surface_compliance,
)
from meshes import Cover
from meshes.array_types import FloatArray

#: Distance at which the base pressure under a shear counts as zero, over the distance over which it decays [-].
_REACH = 16.0
#: Distance added to avoid a division by zero [m].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class VectorCompliance:
    """Displacement vectors of the top of a wide cover per force vector, over the distance.

    Attributes:
        normal: Downward displacement due to a pressure.
        poisson_ratio: Poisson ratio of the top layer [-].
        per_force: 1 / (4 pi mu) of the top layer, times the distance from a point force [m2/N].
        mean: Regular part of the mean of the displacements along a shear force at points along and across it [m/N].
        turning: Half the difference of these displacements, regular part [m/N].
        coupling: Displacement away from a downward force, regular part [m/N].
        reach: Largest distance of these tables [m].
        floats: Whether shear moves the cover along its base, so that displacements do not decay.
    """

    normal: SurfaceCompliance
    poisson_ratio: float
    per_force: float
    mean: CubicSpline
    turning: CubicSpline
    coupling: CubicSpline
    reach: float
    floats: bool

    @classmethod
    def tabulate(cls, cover: Cover, reach: float) -> VectorCompliance:
        """Tabulate the compliance of a cover to a distance [m].

        A cover that slides on its base bears no resultant shear.  Its displacement as a whole is large, not infinite.
        """
        material, floats = cover.layers[-1].material, cover.base == "sliding"
        waves = Waves(cover, reach, floats=floats)
        ratio, mu = material.poisson_ratio, material.shear_modulus
        along, across = (waves.invert(name, value / mu) for name, value in (("along", 1 - ratio), ("across", 1.0)))
        along_2, across_2 = (
            waves.invert(name, value / mu, _bessel_2) for name, value in (("along", 1 - ratio), ("across", 1.0))
        )
        return cls(
            normal=surface_compliance(cover, reach),
            poisson_ratio=ratio,
            per_force=1 / (4 * np.pi * mu),
            mean=CubicSpline(along.x, (along(along.x) + across(along.x)) / 2),
            turning=CubicSpline(along.x, (across_2(along.x) - along_2(along.x)) / 2),
            coupling=waves.invert("coupling", -(1 - 2 * ratio) / (2 * mu), j1),
            reach=waves.reach,
            floats=floats,
        )

    def average_over_cells(self, x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
        """Compute the mean displacements of a cell per uniform traction on an equal cell around the origin.

        Args:
            x: x coordinates of the middle of the displaced cell, any shape [m].
            y: y coordinates of the middle of the displaced cell, same shape [m].
            width: Size of both cells along x [m].
            height: Size of both cells along y [m].

        Returns:
            Component of the displacement (first axis) per component of the traction (second axis), shape (3, 3, ...)
            [m/Pa].
        """
        out = np.zeros((3, 3, *x.shape))
        out[0, 0] = self.normal.average_over_cells(x, y, width, height)
        ratio, area = self.poisson_ratio, width * height
        near: dict[Callable[[FloatArray, FloatArray], FloatArray], FloatArray] = {
            each: self.per_force * difference_twice(each, x, y, width, height) / area
            for each in (_squares, _products, _gradients)
        }
        squares = self.per_force * difference_twice(_squares, y, x, height, width) / area
        out[1, 1] = 2 * (near[_squares] + (1 - ratio) * squares)
        out[2, 2] = 2 * (squares + (1 - ratio) * near[_squares])
        out[1, 2] = 2 * ratio * near[_products]
        out[1, 0] = -(1 - 2 * ratio) * near[_gradients]
        out[2, 0] = -(1 - 2 * ratio) * self.per_force * difference_twice(_gradients, y, x, height, width) / area
        rules = [cut_triangular(size, self.normal.scale) for size in (width, height)]
        for move, share in zip(*rules[0], strict=True):
            for rise, part in zip(*rules[1], strict=True):
                distance = np.hypot(x + move, y + rise) + _TINY
                c, s = (x + move) / distance, (y + rise) / distance
                within = np.minimum(distance, self.reach)
                mean, turn, away = (
                    area * share * part * each(within) for each in (self.mean, self.turning, self.coupling)
                )
                out[1, 1] += mean + turn * (c**2 - s**2)
                out[2, 2] += mean - turn * (c**2 - s**2)
                out[1, 2] += 2 * turn * c * s
                out[1, 0] += away * c
                out[2, 0] += away * s
        out[2, 1], out[0, 1:] = out[1, 2], -out[1:, 0]
        if self.normal.decayed and not self.floats:
            out[:, :, np.hypot(x, y) > self.reach] = 0.0
        return out


def spread_shear(cover: Cover) -> PointSpread:
    """Tabulate the potential of the base pressure under a point shear on a wide cover, over the distance.

    The base pressure is the divergence of the shear force times the potential, whose unit is 1/m.  It stands in the
    attribute `pressure_per_force` of the result.

    Args:
        cover: Laterally wide cover; hyperelastic materials are linearised at zero load.
    """
    waves = Waves(cover, _REACH * max(decay_length(cover), membrane_length(cover)))
    table = waves.invert("tilting", 0.0)
    return PointSpread(radius=table.x, pressure_per_force=table(table.x), reaction=0.0, thickness=cover.thickness)


def _bessel_2(values: FloatArray) -> FloatArray:
    """Evaluate the Bessel function J2 by its recursion, whose absolute error is that of rounding."""
    values = np.maximum(values, _TINY)
    return np.asarray(2 * j1(values) / values - j0(values))


def _squares(u: FloatArray, v: FloatArray) -> FloatArray:
    """Evaluate the function whose fourth derivative, twice along u and v, is u^2 / (u^2 + v^2)^(3/2) [m3]."""
    u, v = np.abs(u) + _TINY, np.abs(v) + _TINY
    distance = np.hypot(u, v)
    return v**2 * u / 2 * np.arcsinh(u / v) + u**2 * distance / 2 - distance**3 / 3


def _products(u: FloatArray, v: FloatArray) -> FloatArray:
    """Evaluate the function whose fourth derivative, twice along u and v, is u v / (u^2 + v^2)^(3/2) [m3]."""
    sign = np.sign(u) * np.sign(v)
    u, v = np.abs(u) + _TINY, np.abs(v) + _TINY
    return -sign * (2 * u * v * np.hypot(u, v) + v**3 * np.arcsinh(u / v) + u**3 * np.arcsinh(v / u)) / 6


def _gradients(u: FloatArray, v: FloatArray) -> FloatArray:
    """Evaluate the function whose fourth derivative, twice along u and v, is u / (u^2 + v^2) [m3]."""
    sign, u, v = np.sign(u), np.abs(u) + _TINY, np.abs(v) + _TINY
    turn = np.arctan2(u, v)
    away = (v**2 * u / 2 - u**3 / 6) * np.log(np.hypot(u, v))
    return sign * (away + v**3 * turn / 6 + u**2 * v / 2 * (np.pi / 2 - turn))
