"""Solve an elastic layer bonded to a rigid cylinder under any loads, exactly, in plane strain.

The conventions and the solution of each harmonic are those of `fem_reference.closed_form.cylinder`, which computes the
texel forces under a pressure.  Here are also concentrated forces, shear, the traction on the base, the displacement of
the top, and the balance of force and moment.

The number of terms follows from a tolerance.  The traction on the base converges exponentially.  The displacement of
the top converges like a power of the number of terms, because its terms decrease like those of the load divided by
their order.  A smooth taper of the last half of the terms makes the error small, except where the load has a jump or a
kink.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import expit

from fem_reference import closed_form
from fem_reference.closed_form.cylinder import count_terms, expand_load, place_points, sum_patches
from meshes.array_types import FloatArray

ComplexArray = npt.NDArray[np.complex128]

#: Traction: a constant [Pa], or a function from angles, shape (n,) [rad], to values, shape (n,) [Pa].
Traction = float | Callable[[FloatArray], FloatArray]

#: First and largest number of terms of the displacement of the top [-].
_FIRST_TOP, _MOST_TOP = 2**8, 2**13
#: Relative rounding error of a sum [-].
_ROUNDING = 1e-14
#: A radial traction cos(m theta) belongs to a tangential traction sin(m theta).
_PHASES = np.array([1.0, -1j])


def sample(traction: Traction, angles: FloatArray) -> FloatArray:
    """Evaluate a traction at angles, shape (n,) [Pa].

    Raises:
        ValueError: If a value is not finite, or the values do not have the shape of the angles.
    """
    values = np.asarray(traction(angles) if callable(traction) else traction, dtype=float)
    if values.shape not in {(), angles.shape}:
        raise ValueError(f"the traction returns shape {values.shape} for angles of shape {angles.shape}")
    if not np.isfinite(values).all():
        raise ValueError("the traction is not finite everywhere on its interval")
    return np.broadcast_to(values, angles.shape)


def check_resolved(coarse: npt.NDArray[Any], fine: npt.NDArray[Any], size: float) -> None:
    """Compare the harmonics from two sets of panels.

    Args:
        coarse: Harmonics, any shape.
        fine: Harmonics from twice the number of panels, same shape.
        size: Sum of the moduli of the forces, in the unit of the harmonics.

    Raises:
        ValueError: If coarse and fine harmonics differ by more than 1e-9 of `size`.
    """
    if np.abs(fine - coarse).max(initial=0.0) > 1e-9 * size:
        raise ValueError("the traction is not smooth inside its interval; split it into several loads where it jumps")


def count_base_terms(transfer: Callable[[FloatArray], FloatArray], span: float, tolerance: float) -> int:
    """Count the terms that the traction on the base needs.

    The transfer to the base decays exponentially.  No harmonic of a load is larger than that of the same load
    concentrated in one place, which grows at most in proportion to the order.  The sum of the norms of the transfer
    times order + 1, over the omitted terms, is therefore a bound of the truncation error of any load.

    Args:
        transfer: Function that computes the transfer to the base for orders, shape (n,), with shape (n, 2, 2) [-].
        span: Logarithm of the outer radius over that of the core [-].
        tolerance: Largest sum of the norms of the omitted terms, over the sum of all norms [-].

    Raises:
        ValueError: If more than 131072 terms are needed, as in a layer thinner than about 0.0005 radii.
    """
    count = count_terms(span)
    norms = np.linalg.norm(transfer(np.arange(float(count))), axis=(1, 2)) * np.arange(1, count + 1)
    left_out = np.cumsum(norms[::-1])[::-1]
    return int(np.argmax(left_out <= max(tolerance, _ROUNDING) * left_out[0]))


def converge_top(evaluate: Callable[[int], FloatArray], tolerance: float) -> FloatArray:
    """Double the number of terms of a tapered series until its values settle.

    Args:
        evaluate: Function that sums a number of terms at some points, any shape.
        tolerance: Largest change by the last doubling, over the largest value [-].

    Raises:
        ValueError: If the values do not settle, as at a concentrated load, where they are infinite.
    """
    count = _FIRST_TOP
    before = evaluate(count)
    while count < _MOST_TOP:
        count *= 2
        now = evaluate(count)
        change, size = np.abs(now - before).max(initial=0.0), np.abs(now).max(initial=0.0)
        if change <= tolerance * size:
            return now
        before = now
    raise ValueError(
        f"the displacement changes by {change / size:.1g} of its largest value between {count // 2} and {count} terms: "
        "it is infinite at a concentrated load, and the series converges slowly where a traction jumps"
    )


def taper(count: int) -> FloatArray:
    """Return factors of the terms of a series: 1 in the first half, then falling smoothly to 0, shape (count,) [-]."""
    x = np.clip(2 * np.arange(count) / count - 1, 1e-3, 1 - 1e-3)
    return np.asarray(expit(1 / x - 1 / (1 - x)))


@dataclass(frozen=True, kw_only=True)
class LineLoad:
    """A force along a line of the top, parallel to the axis.

    Attributes:
        force: Force toward the axis [N/m].
        shear_force: Force toward larger theta [N/m].
        angle: Angle of the line [rad].
    """

    force: float
    shear_force: float = 0.0
    angle: float = 0.0

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return the angle of the line and the force (outward, tangential) on it; see `ArcLoad.place`."""
        return np.array([self.angle]), np.array([[-self.force, self.shear_force]])


@dataclass(frozen=True, kw_only=True)
class ArcLoad:
    """A pressure and a shear traction on an arc of the top.

    Attributes:
        pressure: Pressure, a number or a function of the angle from the middle of the arc, shape (n,) [Pa].  It must be
            smooth inside the arc; at the ends it may jump, or go like a square root.
        shear: Shear traction toward larger theta, a number or a function as for `pressure` [Pa].
        angle: Middle of the arc [rad].
        half_width: Half of the angle of the arc, at most pi [rad].
    """

    pressure: Traction
    half_width: float
    shear: Traction = 0.0
    angle: float = 0.0

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Replace the load by forces at points, for the integration of harmonics.

        Args:
            radius: Radius of the top [m].
            highest: Highest order that will be integrated [-].
            refinement: Factor on the number of points [-].

        Returns:
            Angles, shape (n,) [rad], and forces (outward, tangential), shape (n, 2) [N/m].
        """
        at, weight = place_points(self.half_width, highest, refinement)
        values = np.stack([-sample(self.pressure, at), sample(self.shear, at)], axis=1)
        return self.angle + at, radius * values * weight[:, None]


CylinderLoad = LineLoad | ArcLoad


@dataclass(frozen=True, kw_only=True)
class CylinderLayer(closed_form.CylinderLayer):
    """The layer of `fem_reference.closed_form.CylinderLayer` under any loads."""

    def respond(self, *loads: CylinderLoad, tolerance: float = 1e-12) -> CylinderResponse:
        """Solve the layer under the sum of some loads.

        Args:
            loads: Loads on the top.
            tolerance: Largest truncation error of the traction on the base, relative to its largest value if each load
                were concentrated on a line [-].

        Raises:
            ValueError: If a traction is not smooth inside its arc, or the tolerance needs too many terms.
        """
        span = np.log(self.outer_radius / self.core_radius)
        terms = count_base_terms(lambda m: self.transfer(m).base, span, tolerance)
        return CylinderResponse(layer=self, loads=loads, terms=terms)

    def texel_forces(self, patches: npt.ArrayLike, *loads: CylinderLoad) -> FloatArray:
        """Compute texel forces under some loads: see `CylinderResponse.texel_forces`."""
        return self.respond(*loads).texel_forces(patches)


@dataclass(frozen=True, kw_only=True, eq=False)
class CylinderResponse:
    """Solved layer on a cylinder.

    Attributes:
        layer: Layer on the cylinder.
        loads: Loads on the top of the layer.
        terms: Number of terms of the series of the traction on the base [-].
    """

    layer: CylinderLayer
    loads: tuple[CylinderLoad, ...]
    terms: int

    def base_traction(self, angles: npt.ArrayLike) -> FloatArray:
        """Compute the traction (outward, tangential) that the layer exerts on the core.

        Under a pressed place the outward component is negative and equals minus the pressure on the base.

        Args:
            angles: Angles, shape (n,) [rad].

        Returns:
            Tractions, shape (n, 2) [Pa].
        """
        return _sum_series(self._base, np.asarray(angles, dtype=float))

    def top_displacement(self, angles: npt.ArrayLike, tolerance: float = 1e-4) -> FloatArray:
        """Compute the displacement (outward, tangential) of the top.

        The series converges slowly where a traction jumps.  At the end of a uniform pressure the tolerance is often not
        reached.

        Args:
            angles: Angles, shape (n,) [rad].
            tolerance: Largest change of a displacement when the number of terms is doubled, over the largest
                displacement [-].

        Returns:
            Displacements, shape (n, 2) [m].

        Raises:
            ValueError: If 8192 terms do not reach the tolerance, or a point lies under a concentrated load, where the
                displacement is infinite.
        """
        at = np.asarray(angles, dtype=float)

        def evaluate(count: int) -> FloatArray:
            response = self.layer.transfer(np.arange(count)).compliance * taper(count)[:, None, None]
            return _sum_series(np.einsum("nij,nj->ni", response, self._expand(count)), at)

        return converge_top(evaluate, tolerance)

    def resultants(self, patches: npt.ArrayLike) -> FloatArray:
        """Integrate the traction on the core over patches, see `sum_patches`."""
        return sum_patches(self._base, self.layer.core_radius, patches)

    def texel_forces(self, patches: npt.ArrayLike, normals: npt.ArrayLike | None = None) -> FloatArray:
        """Compute texel forces: the resultant of the traction on each patch, shear included, against its normal.

        Args:
            patches: First and last angle of each patch, shape (n, 2) [rad].
            normals: Angle of each texel's outward normal, shape (n,) [rad]; the angle of the patch's middle if None.

        Returns:
            Force of each texel, positive under pressure, shape (n,) [N/m].
        """
        force = self.resultants(patches)
        at = np.asarray(patches, dtype=float).mean(axis=1) if normals is None else np.asarray(normals, dtype=float)
        return -np.einsum("ni,ni->n", force, np.stack([np.cos(at), np.sin(at)], axis=1))

    @property
    def load_force(self) -> FloatArray:
        """Force of the loads along x and y, from their tractions, shape (2,) [N/m]."""
        return np.array(self._sum_loads()[:2])

    @property
    def load_moment(self) -> float:
        """Moment of the loads about the axis, from their tractions [N]."""
        return self._sum_loads()[2]

    @property
    def base_force(self) -> FloatArray:
        """Force of the layer on the core along x and y, shape (2,) [N/m]."""
        return np.asarray(self.resultants([[0.0, 2 * np.pi]])[0])

    @property
    def base_moment(self) -> float:
        """Moment of the layer on the core about the axis [N]."""
        return float(2 * np.pi * self.layer.core_radius**2 * (self._base[0] * _PHASES)[1].real)

    @cached_property
    def _base(self) -> ComplexArray:
        """Amplitudes of the traction on the core, with the phases of `transfer_cylinder`, shape (terms, 2) [Pa]."""
        response = self.layer.transfer(np.arange(self.terms)).base
        return np.einsum("nij,nj->ni", response, self._expand(self.terms))

    def _expand(self, count: int) -> ComplexArray:
        """Compute the Fourier coefficients of the loads on the top, see `expand_load`."""
        radius = self.layer.outer_radius
        return sum(expand_load(partial(load.place, radius, count), radius, count) for load in self.loads)

    def _sum_loads(self) -> tuple[float, float, float]:
        """Sum force along x and y [N/m] and moment [N] of the loads."""
        total = np.zeros(3)
        for load in self.loads:
            angles, forces = load.place(self.layer.outer_radius, 1)
            radial, tangential = forces.T
            c, s = np.cos(angles), np.sin(angles)
            moment = self.layer.outer_radius * tangential.sum()
            total += [radial @ c - tangential @ s, radial @ s + tangential @ c, moment]
        return float(total[0]), float(total[1]), float(total[2])


def _sum_series(amplitudes: ComplexArray, angles: FloatArray) -> FloatArray:
    """Sum the Fourier series Re (phase amplitude exp(i m angle)) over the orders m.

    Args:
        amplitudes: Outward and tangential amplitudes of n orders, shape (n, 2).
        angles: k angles, shape (k,) [rad].

    Returns:
        Sums, shape (k, 2).
    """
    m, amplitudes = np.arange(len(amplitudes)), amplitudes * _PHASES
    pieces = np.array_split(angles, len(angles) * len(m) // 10**6 + 1)
    return np.concatenate([(np.exp(1j * np.outer(piece, m)) @ amplitudes).real for piece in pieces])
