"""Linear response of a wide cover whose stiff top layer is under membrane tension.

A foil on a soft layer stretches under an indenter.  Its tension T, a force per length, resists further deflection w
with the pressure -T w'' (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, section 78).  C(k) is the
compliance of the cover's top for the pressure cos(k x).  The pressure on the layers below, and with it the response to
a load, is then divided by 1 + T k^2 C(k).  A uniform T represents the tension near the contact.

The stretched foil also displaces the soft layer in the plane, which widens the base pressure far from the contact.  The
empirical term (k l)^2 with a length l represents this effect: the response is divided by 1 + T k^2 C(k) + (k l)^2.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

from fem_reference.elements.line import gauss_points
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, WaveResponse, solve_waves
from meshes import Cover
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class TensionSettings:
    """Constants of the Hankel transforms (integrals over the wave number) of a cover whose top is stretched."""

    #: Product of wave number and cover thickness at which the integrals end [-].
    last_wave: float = 60.0
    #: Smallest number of panels of the integrals over the wave number [-].
    panels: float = 64.0
    #: Gauss points in each panel of the integrals over the wave number [-].
    panel_points: int = 10
    #: Distances for which Bessel functions are computed at once, to limit the memory [-].
    block: int = 256
    #: Smallest product of wave number and contact radius for which the Hankel transform of Hertz's pressure is
    #: evaluated [-].  At smaller products its terms cancel.
    small_wave: float = 1e-3


_SETTINGS = TensionSettings()


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Stretch of the top of a cover under a load.

    Attributes:
        tension: Membrane tension T [N/m].
        length: Length l of the term (k l)^2 [m].
    """

    tension: float
    length: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StretchedResponse:
    """Changes of a cover's response to a unit point load under stretch, at m distances from the load.

    Attributes:
        radius: Distances from the load, shape (m,) [m].
        wave_number: Wave numbers of the Hankel transform, shape (n,) [1/m].
        waves: Compliance [m/Pa] and base pressure [-] of the cover without tension at the n wave numbers.
        hankel: Matrix of the Hankel transform: integration weights of the n wave numbers (columns) for each of the m
            distances (rows), shape (m, n) [1/m2].
    """

    radius: FloatArray
    wave_number: FloatArray
    waves: WaveResponse
    hankel: FloatArray

    @classmethod
    def prepare(cls, cover: Cover, radius: FloatArray) -> StretchedResponse:
        """Compute the base pressure of a wide cover under pressure that varies as a plane wave along its top.

        The result also holds the Hankel transform from wave numbers to the distances `radius`, shape (m,) [m].
        """
        end = _SETTINGS.last_wave / cover.thickness
        panels = int(np.ceil(max(_SETTINGS.panels, end * float(radius.max()) / np.pi)))
        k, weight = gauss_points(np.linspace(0, end, panels + 1), _SETTINGS.panel_points)
        blocks = (radius[start : start + _SETTINGS.block] for start in range(0, len(radius), _SETTINGS.block))
        bessel = np.concatenate([j0(np.outer(block, k)) for block in blocks])
        return cls(
            radius=radius, wave_number=k, waves=solve_waves(cover, k), hankel=bessel * (k * weight / (2 * np.pi))
        )

    def remove_contact(self, pressed: PointSpread, contact_radius: float, stretch: Stretch) -> PointSpread:
        """Compute the point spread function from the base pressure under a ball, by removing the size of the contact.

        The difference between a point load and Hertz's pressure on the contact is that of the stretched cover.

        Args:
            pressed: Base pressure per force under the ball.
            contact_radius: Radius of the contact [m].
            stretch: Stretch of the top that was fitted to `pressed`.
        """
        change = self.spread_over_contact(stretch, 0.0) - self.spread_over_contact(stretch, contact_radius)
        pressure = pressed.pressure(self.radius) + change
        return dataclasses.replace(pressed, radius=self.radius, pressure_per_force=pressure)

    def stretch_compliance(self, surface: SurfaceCompliance, stretch: Stretch) -> SurfaceCompliance:
        """Compute the compliance of the top under stretch.

        Args:
            surface: The compliance of the top without stretch, tabulated at the prepared distances.
            stretch: Stretch of the top.
        """
        change = -self.hankel @ (self.waves.compliance * self._reduce(stretch))
        regular = CubicSpline(self.radius, surface.regular(self.radius) + change, bc_type=("clamped", "not-a-knot"))
        return dataclasses.replace(surface, regular=regular)

    def spread_over_contact(self, stretch: Stretch, contact_radius: float) -> FloatArray:
        """Compute the base pressure per force under Hertz's pressure on a circle, at the distances, shape (m,) [1/m2].

        The Hankel transform of Hertz's pressure per force is 3 (sin x - x cos x) / x^3 with x the product of wave
        number and radius of the circle.
        """
        x = np.maximum(self.wave_number * contact_radius, _SETTINGS.small_wave)
        load = 3 * (np.sin(x) - x * np.cos(x)) / x**3
        return np.asarray(self.hankel @ (load * self.waves.base * (1 - self._reduce(stretch))))

    def _reduce(self, stretch: Stretch) -> FloatArray:
        """Compute the relative reduction of the response by the stretch at each of n wave numbers, shape (n,) [-]."""
        k = self.wave_number
        resistance = stretch.tension * k**2 * self.waves.compliance + (k * stretch.length) ** 2
        return resistance / (1 + resistance)
