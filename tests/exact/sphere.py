"""Solve an elastic layer bonded to a rigid sphere under axisymmetric tractions about any axes, exactly.

Each load is a Legendre series about its own axis; `harmonic` gives the response to each term.  Loads about different
axes add up, so a point force or a round pressure may stand anywhere.  Vectors have Cartesian components; points of the
base and of the top are given by their directions from the centre.

A texel measures the resultant of the traction on its patch along its own normal, shear included: over the patch the
normal of the base turns, so the shear has a component along the normal of the texel.  The integral of the normal stress
alone is smaller: by 9 to 16 % for a texel of 3.4 mm on a core of 6 mm, under a load above its middle and covers of 1
to 3 mm.  Neither sums to the load, because the normals of the texels differ.  What balances is the vector: the force of
the traction on the whole core equals that of the load.  Axisymmetric loads have no moment about the centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from fem_reference.closed_form.cylinder import HarmonicTransfer, cross_layer, place_points, stack_rows
from meshes import Material
from meshes.array_types import FloatArray
from tests.exact.cylinder import Traction, check_resolved, converge_top, count_base_terms, sample, taper
from tests.exact.sphere_patch import Direction, SpherePatch, normalise

#: Number of points at which Legendre series are summed at once, to limit the memory [-].
_CHUNK = 2**16
#: Angle over which the traction on the base is a polynomial of degree 23 to rounding, over thickness / radius [-].
_PANEL = 1.3


@dataclass(frozen=True, kw_only=True)
class PointLoad:
    """A force on one point of the top, toward the centre.

    Attributes:
        force: The force [N].
        direction: Direction of the point from the centre, of any length, shape (3,) [-].
    """

    force: float
    direction: Direction = (0.0, 0.0, 1.0)

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return the angle from the axis and the force (outward, along the angle) there, as `CapLoad.place` does."""
        return np.zeros(1), np.array([[-self.force, 0.0]])


@dataclass(frozen=True, kw_only=True)
class CapLoad:
    """A pressure and a shear traction on a round part of the top, axisymmetric about the part's middle.

    Attributes:
        pressure: Pressure, a number or a function of the angle from the middle, shape (n,) [Pa].  It must be smooth
            inside the cap; at the rim it may jump, or go like a square root.
        half_angle: Angle between the middle and the rim, at most pi, the whole sphere [rad].
        shear: Shear traction away from the middle, likewise [Pa].
        direction: Direction of the middle from the centre, of any length, shape (3,) [-].
    """

    pressure: Traction
    half_angle: float
    shear: Traction = 0.0
    direction: Direction = (0.0, 0.0, 1.0)

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Replace the load by forces on rings, with which harmonics are integrated.

        Args:
            radius: Radius of the top [m].
            highest: Highest degree that will be integrated [-].
            refinement: Factor on the number of rings [-].

        Returns:
            Angles from the axis, shape (n,) [rad], and forces (outward, along the angle), shape (n, 2) [N].
        """
        at, weight = place_points(self.half_angle, highest, refinement)
        at, weight = at[len(at) // 2 :], weight[len(at) // 2 :]
        values = np.stack([-sample(self.pressure, at), sample(self.shear, at)], axis=1)
        return at, values * (2 * np.pi * radius**2 * np.sin(at) * weight)[:, None]


SphereLoad = PointLoad | CapLoad


@dataclass(frozen=True, kw_only=True)
class SphereLayer:
    """An elastic layer, bonded all round to a rigid sphere.

    Attributes:
        core_radius: Radius of the rigid sphere [m].
        thickness: Thickness of the layer [m].
        material: Material, with its linear elastic properties at zero load; Poisson ratios of 0 to 0.5.
    """

    core_radius: float
    thickness: float
    material: Material

    def __post_init__(self) -> None:
        """Check the dimensions.

        Raises:
            ValueError: If a dimension is not positive.
        """
        if not (self.core_radius > 0 and self.thickness > 0):
            raise ValueError(f"radius {self.core_radius} m and thickness {self.thickness} m must be positive")

    @property
    def outer_radius(self) -> float:
        """Radius of the top of the layer [m]."""
        return self.core_radius + self.thickness

    def transfer(self, degrees: npt.ArrayLike) -> HarmonicTransfer:
        """Compute the response to tractions of degrees n >= 0, shape (n,): see `transfer_sphere`."""
        n = np.asarray(degrees, dtype=float)
        return transfer_sphere(n, self.core_radius, self.outer_radius, self.material)

    def respond(self, *loads: SphereLoad, tolerance: float = 1e-12) -> SphereResponse:
        """Solve the layer under the sum of some loads.

        Args:
            loads: The loads.
            tolerance: Largest truncation error of the traction on the base, over the largest traction on the base that
                the loads' forces would cause if each were concentrated in a point [-].

        Raises:
            ValueError: If a traction is not smooth inside its cap, or the tolerance needs too many terms.
        """
        span = np.log(self.outer_radius / self.core_radius)
        terms = count_base_terms(lambda n: self.transfer(n).base, span, tolerance)
        return SphereResponse(layer=self, loads=loads, terms=terms)

    def texel_forces(self, patches: Sequence[SpherePatch], *loads: SphereLoad) -> FloatArray:
        """Compute texel forces under some loads: see `SphereResponse.texel_forces`."""
        return self.respond(*loads).texel_forces(patches)


@dataclass(frozen=True, kw_only=True, eq=False)
class SphereResponse:
    """Solved layer on a sphere.

    Attributes:
        layer: The layer.
        loads: The loads on its top.
        terms: Number of terms of the series of the traction on the base [-].
    """

    layer: SphereLayer
    loads: tuple[SphereLoad, ...]
    terms: int

    def base_traction(self, directions: npt.ArrayLike) -> FloatArray:
        """Compute the traction that the layer exerts on the core; its component along a direction is -(base pressure).

        Args:
            directions: Directions of points of the base, of any length, shape (n, 3) [-].

        Returns:
            Tractions along x, y and z, shape (n, 3) [Pa].
        """
        points = normalise(directions)
        total = np.zeros_like(points)
        for load, series in zip(self.loads, self._base, strict=True):
            total += _evaluate(series, normalise(load.direction), points)
        return total

    def top_displacement(self, directions: npt.ArrayLike, tolerance: float = 1e-4) -> FloatArray:
        """Compute the displacement of the top.

        The series is slow where a traction jumps: the tolerance is often out of reach at the end of a uniform pressure.

        Args:
            directions: Directions of points of the top, of any length, shape (n, 3) [-].
            tolerance: Largest change of a displacement when the number of terms is doubled, over the largest
                displacement [-].

        Returns:
            Displacements along x, y and z, shape (n, 3) [m].

        Raises:
            ValueError: If 8192 terms do not reach the tolerance, or a point lies under a concentrated load, where the
                displacement is infinite.
        """
        points = normalise(directions)

        def evaluate(count: int) -> FloatArray:
            response = self.layer.transfer(np.arange(count)).compliance * taper(count)[:, None, None]
            total = np.zeros_like(points)
            for load in self.loads:
                total += _evaluate(_apply(response, self._expand(load, count)), normalise(load.direction), points)
            return total

        return converge_top(evaluate, tolerance)

    def resultants(self, patches: Sequence[SpherePatch]) -> FloatArray:
        """Integrate the traction on the core over patches.

        Returns:
            Force of the layer on each patch along x, y and z, shape (n, 3) [N].
        """
        panel = _PANEL * self.layer.thickness / self.layer.core_radius
        placed = [patch.place_points(min(panel, 1.0)) for patch in patches]
        traction = self.base_traction(np.concatenate([points for points, _ in placed]))
        parts = np.split(traction, np.cumsum([len(weights) for _, weights in placed])[:-1])
        sums = [weights @ part for part, (_, weights) in zip(parts, placed, strict=True)]
        return np.array(sums) * self.layer.core_radius**2

    def texel_forces(self, patches: Sequence[SpherePatch]) -> FloatArray:
        """Compute texel forces: the resultant of the traction on each patch, shear included, against its normal.

        Returns:
            Force of each texel, positive under pressure, shape (n,) [N].
        """
        normals = np.array([patch.texel_normal for patch in patches])
        return -np.asarray(np.einsum("ni,ni->n", self.resultants(patches), normals))

    @property
    def load_force(self) -> FloatArray:
        """Force of the loads, from their tractions, shape (3,) [N]; their moment about the centre is zero."""
        total = np.zeros(3)
        for load in self.loads:
            angles, forces = load.place(self.layer.outer_radius, 1)
            along = np.sum(forces[:, 0] * np.cos(angles) - forces[:, 1] * np.sin(angles))
            total += along * normalise(load.direction)
        return total

    @property
    def base_force(self) -> FloatArray:
        """Force of the layer on the core, from the terms of degree 1, shape (3,) [N]."""
        total = np.zeros(3)
        for load, series in zip(self.loads, self._base, strict=True):
            total += 4 * np.pi / 3 * self.layer.core_radius**2 * (series[1] @ [1.0, 4 / 3]) * normalise(load.direction)
        return total

    @cached_property
    def _base(self) -> list[FloatArray]:
        """Amplitudes of the traction on the core, as of `transfer_sphere`, of each load, (terms, 2) [Pa]."""
        response = self.layer.transfer(np.arange(self.terms)).base
        return [_apply(response, self._expand(load, self.terms)) for load in self.loads]

    def _expand(self, load: SphereLoad, count: int) -> FloatArray:
        """Expand a load into terms of degree 0..count - 1, shape (count, 2) [Pa]."""
        radius = self.layer.outer_radius
        angles, forces = load.place(radius, count)
        coarse = _integrate_legendre(angles, forces, count)
        fine = _integrate_legendre(*load.place(radius, count, 2), count)
        check_resolved(coarse, fine, float(np.abs(forces).sum()))
        n = np.arange(count)
        fine[:, 0] *= (2 * n + 1) / (4 * np.pi * radius**2)
        fine[1:, 1] *= ((2 * n + 1) * (n + 0.5) ** 2)[1:] / (n * (n + 1) * 4 * np.pi * radius**2)[1:]
        return fine


def _apply(response: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """Multiply amplitudes, shape (n, 2), by the response to each, shape (n, 2, 2)."""
    return np.asarray(np.einsum("nij,nj->ni", response, amplitudes))


def _integrate_legendre(angles: FloatArray, forces: FloatArray, count: int) -> FloatArray:
    """Sum forces times the functions of `transfer_sphere` over angles, shape (count, 2).

    P_n follows from the recurrence (n + 1) P_(n+1) = (2 n + 1) x P_n - n P_(n-1), its derivative by theta from
    sin theta dP_n/dtheta = n (x P_n - P_(n-1)).
    """
    x, s = np.cos(angles), np.sin(angles)
    over = np.divide(1.0, s, out=np.zeros_like(s), where=s > 0)
    out = np.zeros((count, 2))
    before, now = np.zeros_like(x), np.ones_like(x)
    for n in range(count):
        slope = n * (x * now - before) * over
        out[n] = forces[:, 0] @ now, forces[:, 1] @ slope / (n + 0.5)
        before, now = now, ((2 * n + 1) * x * now - n * before) / (n + 1)
    return out


def _evaluate(series: FloatArray, axis: FloatArray, points: FloatArray) -> FloatArray:
    """Evaluate an axisymmetric vector field, outward sum a P_n, along theta sum b (dP_n/dtheta) / (n + 1/2).

    Args:
        series: Amplitudes a and b, shape (terms, 2).
        axis: Axis, shape (3,).
        points: Unit directions, shape (n, 3).

    Returns:
        Cartesian components, shape (n, 3).
    """
    x = points @ axis
    slope = np.polynomial.legendre.legder(series[:, 1] / (np.arange(len(series)) + 0.5))
    coefficients = np.zeros((len(series), 2))
    coefficients[:, 0] = series[:, 0]
    coefficients[: len(slope), 1] = slope
    pieces = np.array_split(x, len(x) // _CHUNK + 1)
    radial, along = np.concatenate([np.polynomial.legendre.legval(piece, coefficients) for piece in pieces], axis=1)
    # dP_n/dtheta e_theta = -sin(theta) P_n'(x) e_theta, and sin(theta) e_theta = x r - axis.
    return np.asarray(radial[:, None] * points - along[:, None] * (x[:, None] * points - axis))


def transfer_sphere(degrees: FloatArray, core: float, outer: float, material: Material) -> HarmonicTransfer:
    """Compute the response of a layer on a rigid sphere to axisymmetric tractions of degree n.

    The outward components are proportional to P_n(cos theta), the tangential ones, along theta, to its derivative by
    theta, over n + 1/2.

    Args:
        degrees: Degrees n >= 0, shape (n,) [-].
        core: Radius of the core [m].
        outer: Radius of the top of the layer [m].
        material: Material, with its linear elastic properties at zero load.
    """
    n = np.asarray(degrees, dtype=float)
    k = n + 0.5
    return cross_layer(state_matrix(n, material), k, -0.5, (core, outer), material.shear_modulus * k)


def state_matrix(n: FloatArray, material: Material) -> FloatArray:
    """Return the matrices A of the state (u, r sigma / (mu (n + 1/2))): dy / d(log r) = A y, shape (n, 4, 4) [-]."""
    nu = material.poisson_ratio
    c, b, g = nu / (1 - nu), (1 - 2 * nu) / (2 * (1 - nu)), 2 * (1 + nu) / (1 - nu)
    k, q, one = n + 0.5, n * (n + 1), np.ones_like(n)
    return stack_rows(
        [
            [-2 * c * one, c * q / k, b * k, 0 * one],
            [-k, one, 0 * one, k],
            [2 * g / k, -g * q / k**2, (2 * c - 1) * one, q / k],
            [-2 * (2 * c + 1) * one, 2 * ((c + 1) * q - 1) / k, -c * k, -2 * one],
        ]
    )


@dataclass(frozen=True, kw_only=True)
class SphereLayers(SphereLayer):
    """Two layers on a rigid sphere; `material` is that of the upper one.

    Attributes:
        below: Material of the lower layer.
        interface: Radius of the interface [m].
    """

    below: Material
    interface: float

    def transfer(self, degrees: npt.ArrayLike) -> HarmonicTransfer:
        """Compute the response as the product of the crossings of both layers, or of the upper one for high degrees."""
        n = np.asarray(degrees, dtype=float)
        inner, outer = np.log(self.interface / self.core_radius), np.log(self.outer_radius / self.interface)
        high = transfer_sphere(n, self.interface, self.outer_radius, self.material)
        low = n * (inner + outer) < 300  # above, products overflow, and the core moves the top by exp(-2 n outer)
        k, radius = n[low] + 0.5, self.outer_radius
        lower, upper = self.below.shear_modulus, self.material.shear_modulus
        crossing = expm(state_matrix(n[low], self.below) * inner)
        crossing[:, 2:] *= lower / upper
        crossing = expm(state_matrix(n[low], self.material) * outer) @ crossing
        inverse = np.linalg.inv(crossing[:, 2:, 2:])
        base, compliance = np.zeros_like(high.base), high.compliance.copy()
        base[low] = lower / upper * radius / self.core_radius * inverse
        compliance[low] = (radius / (upper * k))[:, None, None] * (crossing[:, :2, 2:] @ inverse)
        return HarmonicTransfer(base=base, compliance=compliance)
