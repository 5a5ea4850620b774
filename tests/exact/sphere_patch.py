"""Patches of a sphere: the areas of texels, between two circles of latitude and two meridians of any pole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.closed_form.layer import place_gauss_points
from meshes.array_types import FloatArray

Direction = tuple[float, float, float]

#: Smallest length of the mean normal of a patch, over 1, that counts as a normal [-].
_CLOSED = 1e-6


@dataclass(frozen=True, kw_only=True)
class SpherePatch:
    """A part of a sphere between two angles from a pole and two longitudes about it.

    `cap` and `rectangle` make the usual ones.

    Attributes:
        pole: Direction from which the colatitude counts, of any length, shape (3,) [-].
        meridian: Direction toward which longitude 0 lies; its part along the pole does not count, shape (3,) [-].
        colatitudes: First and last angle from the pole, in 0..pi [rad].
        longitudes: First and last longitude, at most a turn apart [rad].
        normal: Direction of the texel's normal; the mean normal of the patch if None, shape (3,) [-].
    """

    pole: Direction
    meridian: Direction
    colatitudes: tuple[float, float]
    longitudes: tuple[float, float]
    normal: Direction | None = None

    def __post_init__(self) -> None:
        """Check the angles and directions.

        Raises:
            ValueError: If an angle is out of range, or meridian and pole are parallel.
        """
        (top, bottom), (start, end) = self.colatitudes, self.longitudes
        if not (0 <= top < bottom <= np.pi * (1 + 1e-12) and 0 < end - start <= 2 * np.pi * (1 + 1e-12)):
            raise ValueError(f"no patch has colatitudes {self.colatitudes} rad and longitudes {self.longitudes} rad")
        normalise(np.cross(self.pole, self.meridian))

    @classmethod
    def cap(cls, direction: Direction, half_angle: float) -> SpherePatch:
        """Make the round patch within an angle [rad] of a direction."""
        aside = np.eye(3)[np.argmin(np.abs(direction))]
        return cls(
            pole=direction,
            meridian=(float(aside[0]), float(aside[1]), float(aside[2])),
            colatitudes=(0.0, half_angle),
            longitudes=(0.0, 2 * np.pi),
        )

    @classmethod
    def rectangle(cls, direction: Direction, up: Direction, width: float, height: float) -> SpherePatch:
        """Make a nearly rectangular patch around a direction.

        Args:
            direction: Direction of the middle, shape (3,) [-].
            up: Direction along which the height counts; its part along `direction` does not count, shape (3,) [-].
            width: Angle about the pole of the patch, which lies a right angle above the middle [rad].
            height: Angle along the middle meridian [rad].
        """
        middle = normalise(direction)
        pole = normalise(np.asarray(up, dtype=float) - np.dot(up, middle) * middle)
        return cls(
            pole=(float(pole[0]), float(pole[1]), float(pole[2])),
            meridian=direction,
            colatitudes=((np.pi - height) / 2, (np.pi + height) / 2),
            longitudes=(-width / 2, width / 2),
        )

    @property
    def solid_angle(self) -> float:
        """Area of the patch on the unit sphere [-]."""
        (top, bottom), (start, end) = self.colatitudes, self.longitudes
        return float((np.cos(top) - np.cos(bottom)) * (end - start))

    @property
    def texel_normal(self) -> FloatArray:
        """Unit normal of the texel, shape (3,) [-].

        Raises:
            ValueError: If the mean normal of the patch vanishes, as of a whole sphere, and none was given.
        """
        if self.normal is not None:
            return normalise(self.normal)
        points, weights = self.place_points(1.0)
        mean = weights @ points
        if np.linalg.norm(mean) < _CLOSED * weights.sum():
            raise ValueError("the patch goes all round and has no mean normal: give one")
        return normalise(mean)

    def place_points(self, panel: float) -> tuple[FloatArray, FloatArray]:
        """Place Gauss points on the patch.

        Args:
            panel: Angle in which the integrand is a polynomial of degree 23, to rounding [rad].

        Returns:
            Directions of the points, shape (n, 3) [-], and areas on the unit sphere, shape (n,) [-].
        """
        widest = np.pi / 2 if self.colatitudes[0] <= np.pi / 2 <= self.colatitudes[1] else max(self.colatitudes)
        theta, theta_weight = _place_panels(*self.colatitudes, panel)
        phi, phi_weight = _place_panels(*self.longitudes, panel / np.sin(min(widest, np.pi / 2)))
        z = normalise(self.pole)
        x = normalise(np.asarray(self.meridian, dtype=float) - np.dot(self.meridian, z) * z)
        across = np.outer(np.cos(phi), x) + np.outer(np.sin(phi), np.cross(z, x))
        points = np.sin(theta)[:, None, None] * across + np.cos(theta)[:, None, None] * z
        return points.reshape(-1, 3), np.outer(theta_weight * np.sin(theta), phi_weight).ravel()


def normalise(direction: npt.ArrayLike) -> FloatArray:
    """Return directions with length 1, shape (..., 3).

    Raises:
        ValueError: If a length is zero, or the last axis does not have three components.
    """
    out = np.asarray(direction, dtype=float)
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    if out.shape[-1:] != (3,) or not (length > 0).all():
        raise ValueError("a direction must have three components that are not all zero")
    return np.asarray(out / length)


def _place_panels(start: float, end: float, panel: float) -> tuple[FloatArray, FloatArray]:
    """Place 12 Gauss points in each of several panels not longer than `panel` [rad]."""
    return place_gauss_points(np.linspace(start, end, int(np.ceil((end - start) / panel)) + 1), 12)
