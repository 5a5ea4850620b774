"""Solve an elastic layer bonded to a rigid cylinder under any traction on its top, exactly, in plane strain.

The traction is a Fourier series.  Angles theta count from the x axis toward the y axis [rad].  Forces are per length of
the cylinder [N/m].  Components of vectors are (outward, tangential), the tangential one toward larger theta.

The force on a texel of a curved base is the resultant of the traction on its patch along the texel's own normal, shear
included.  The normal of the base rotates over the patch, so that the shear has a component along the normal of the
texel.  The integral of the normal stress alone is smaller: by 5 to 9 % for a texel of 3.4 mm on a core of 6 mm, under a
load above its middle and covers of 1 to 3 mm.  The sum of the texel forces is not the load, because the normals of the
texels differ.  Force and moment vectors balance: those of the traction on the whole core equal those of the load.

Each harmonic of the traction is solved separately.  On a cylinder the harmonics are exp(i m theta), on a sphere
Legendre polynomials P_n(cos theta).  The state y of one harmonic holds the displacements u_r and u_t and the stresses r
sigma_rr and r sigma_rt.  With s = ln(r / core radius), the field equations become dy/ds = A y, where A does not depend
on s (Euler's equation).  So y at the top is expm(A S) times y at the core, with S = ln(outer radius / core radius).  A
holds (1 - 2 nu) / (1 - nu) and nu / (1 - nu), but never 1 / (1 - 2 nu).  An incompressible layer therefore needs no
special case.  After subtraction of its mean, A has the eigenvalues +-(k + 1) and +-(k - 1), where k = m on a cylinder
and n + 1/2 on a sphere.  For large k S the exponential is written with the projectors P on the growing and on the
decaying solutions, on which (A -+ k)^2 = 1:

    exp(-k S) expm(A S) = P (cosh S + (A - k) sinh S) + exp(-2 k S) (1 - P) (cosh S + (A + k) sinh S)

This form does not overflow, and thin layers lose no digits.

Tractions on an interval of angles are integrated by Gauss points, whose number suits the highest harmonic.  The number
of terms follows from a tolerance.  The traction on the base converges exponentially.  The displacement of the top
converges like a power of the number of terms, because its terms decrease like those of the load divided by their order.
A smooth taper of the last half of the terms makes the error small, except where the load has a jump or a kink.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.special import expit

from fem_reference.closed_form.layer import place_gauss_points
from meshes import Material
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class SeriesSettings:
    """Constants of the Fourier series of loads on round layers, and of the quadrature for their coefficients."""

    #: Gauss points in each panel of the quadrature over a loaded interval of angles [-].
    points: int = 16
    #: Largest change of the phase of the highest harmonic within a panel [rad].
    phase: float = 8.0
    #: Smallest number of panels in each half of a loaded interval of angles [-].
    panels: int = 2
    #: Largest change of a harmonic when the number of panels is doubled, over the sum of the absolute forces [-].
    settled: float = 1e-9
    #: Smallest number of terms of the series of the traction on the base [-].
    first: int = 64
    #: Largest number of terms of the traction on the base [-].
    most_terms: int = 2**17
    #: First number of terms of the displacement of the top [-].
    first_top: int = 2**8
    #: Largest number of terms of the displacement of the top [-].
    most_top: int = 2**13
    #: Relative rounding error of a sum [-].
    rounding: float = 1e-14
    #: Product of order and logarithm of outer over core radius above which a harmonic does not reach the base, because
    #: its amplitude there is below exp(-60) = 1e-26 [-].
    deep: float = 60.0


_SERIES = SeriesSettings()


#: Traction: a constant [Pa], or a function from angles, shape (n,) [rad], to values, shape (n,) [Pa].
Traction = float | Callable[[FloatArray], FloatArray]


def place_points(start: float, end: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
    """Place Gauss points on an interval for tractions that end like a square root at either end.

    The substitution is angle = middle + half width sin(t), with panels of equal length in t.  It makes a traction with
    such ends, for example a Hertzian pressure, an analytic function of t.

    The middle of the interval is an end of two panels, so that each half of the points integrates its own half.

    Args:
        start: Lower end of the interval [rad].
        end: Upper end [rad].
        highest: Highest harmonic that will be integrated [-].
        refinement: Factor on the number of panels [-].

    Returns:
        Angles, shape (n,) [rad], and weights, shape (n,) [rad].
    """
    half = (end - start) / 2
    panels = 2 * refinement * max(_SERIES.panels, int(np.ceil(np.pi * highest * half / (2 * _SERIES.phase))))
    t, weight = place_gauss_points(np.linspace(-np.pi / 2, np.pi / 2, panels + 1), _SERIES.points)
    return (start + end) / 2 + half * np.sin(t), weight * half * np.cos(t)


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
    if np.abs(fine - coarse).max(initial=0.0) > _SERIES.settled * size:
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
    count = int(np.ceil(_SERIES.deep / span)) + _SERIES.first
    if count > _SERIES.most_terms:
        raise ValueError(f"the layer is too thin for its radius: its series needs more than {_SERIES.most_terms} terms")
    norms = np.linalg.norm(transfer(np.arange(float(count))), axis=(1, 2)) * np.arange(1, count + 1)
    left_out = np.cumsum(norms[::-1])[::-1]
    return int(np.argmax(left_out <= max(tolerance, _SERIES.rounding) * left_out[0]))


def converge_top(evaluate: Callable[[int], FloatArray], tolerance: float) -> FloatArray:
    """Double the number of terms of a tapered series until its values settle.

    Args:
        evaluate: Function that sums a number of terms at some points, any shape.
        tolerance: Largest change by the last doubling, over the largest value [-].

    Raises:
        ValueError: If the values do not settle, as at a concentrated load, where they are infinite.
    """
    count = _SERIES.first_top
    before = evaluate(count)
    while count < _SERIES.most_top:
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


#: Product k S above which the matrix exponential is split into growing and decaying parts, to avoid overflow [-].
_LARGE = 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
class HarmonicTransfer:
    """Response of a layer to n harmonics of the traction on its top; the components are (outward, tangential).

    Attributes:
        base: Traction that the layer exerts on the core, per traction on its top, shape (n, 2, 2) [-].
        compliance: Displacement of the top per traction on the top, shape (n, 2, 2) [m/Pa].
    """

    base: FloatArray
    compliance: FloatArray


def transfer_cylinder(orders: FloatArray, core: float, outer: float, material: Material) -> HarmonicTransfer:
    """Compute the response of a layer on a rigid cylinder to tractions exp(i m theta), in plane strain.

    The outward components are proportional to exp(i m theta), the tangential ones to -i exp(i m theta): to cos(m theta)
    and sin(m theta) if the amplitudes are real.

    Args:
        orders: Orders m >= 0, shape (n,) [-].
        core: Radius of the core [m].
        outer: Radius of the top of the layer [m].
        material: Material, with its linear elastic properties at zero load.
    """
    m = np.asarray(orders, dtype=float)
    nu = material.poisson_ratio
    c, b, d = nu / (1 - nu), (1 - 2 * nu) / (2 * (1 - nu)), 2 / (1 - nu)
    one, scale = np.ones_like(m), np.maximum(m, 1.0)
    # Displacements are in units of core radius / (mu * scale), where mu is the shear modulus and scale = max(m, 1) for
    # the circumferential wave number m, so that all entries are of the same size at large m.
    matrix = stack_rows(
        [
            [-c * one, -c * m, b * scale, 0 * one],
            [m, one, 0 * one, scale],
            [d / scale, d * m / scale, c * one, -m],
            [d * m / scale, d * m**2 / scale, c * m, -one],
        ]
    )
    return cross_layer(matrix, m, 0.0, (core, outer), material.shear_modulus * scale)


def stack_rows(rows: list[list[FloatArray]]) -> FloatArray:
    """Build n matrices of shape (4, 4) from rows of entries, each entry of shape (n,)."""
    return np.moveaxis(np.array(rows), 2, 0)


def cross_layer(
    matrix: FloatArray, k: FloatArray, mean: float, radii: tuple[float, float], stiffness: FloatArray
) -> HarmonicTransfer:
    """Solve the layer between a core that does not move and a top with given tractions.

    Args:
        matrix: Matrices A, shape (n, 4, 4).
        k: Half the difference between the means of the growing and of the decaying exponents, shape (n,) [-].
        mean: Mean of the eigenvalues of A [-].
        radii: Radius of the core and of the top [m].
        stiffness: Unit of r sigma / u, shape (n,) [Pa].
    """
    core, outer = radii
    span = np.log(outer / core)
    crossing, exponent = _exponentiate(matrix - mean * np.eye(4), k, span)
    # The displacements of the core are zero, so that only the columns of its tractions are needed.
    moved, stressed = crossing[:, :2, 2:], crossing[:, 2:, 2:]
    inverse = np.linalg.inv(stressed)
    decay = np.exp(-exponent - mean * span) * outer / core
    return HarmonicTransfer(
        base=decay[:, None, None] * inverse,
        compliance=(outer / stiffness)[:, None, None] * (moved @ inverse),
    )


def _exponentiate(matrix: FloatArray, k: FloatArray, span: float) -> tuple[FloatArray, FloatArray]:
    """Compute expm(A S) as a matrix and the exponent of a scalar factor, to avoid overflow.

    Args:
        matrix: Matrices A with eigenvalues +-(k + 1) and +-(k - 1), shape (n, 4, 4).
        k: Constants k of the eigenvalues, shape (n,) [-].
        span: Logarithm S of the ratio of the radii [-].

    Returns:
        Matrices, shape (n, 4, 4), and exponents, shape (n,): expm(A S) = exp(exponent) matrix.
    """
    large = (k * span > _LARGE) & (k >= 1.5)  # noqa: PLR2004 -- smaller k may have k - 1 <= 0, which does not grow
    out, exponent = np.empty_like(matrix), np.where(large, k * span, 0.0)
    out[~large] = expm(matrix[~large] * span)
    a, k = matrix[large], k[large][:, None, None]
    eye = np.eye(4)
    growing = np.linalg.solve(4 * k * a, (a + k * eye) @ (a + k * eye) - eye)
    up = np.cosh(span) * eye + np.sinh(span) * (a - k * eye)
    down = np.cosh(span) * eye + np.sinh(span) * (a + k * eye)
    out[large] = growing @ up + np.exp(-2 * k * span) * ((eye - growing) @ down)
    return out, exponent


ComplexArray = npt.NDArray[np.complex128]

#: Number of harmonics whose exponentials are computed directly [-]; those of the others are products of them.
_BLOCK = 64
#: Number of angles whose exponentials are held at once, to limit the memory [-].
_ANGLES = 4096


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

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
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

    def __post_init__(self) -> None:
        """Check that the half width of the arc lies in 0..pi.

        Raises:
            ValueError: If the half width is not in 0..pi.
        """
        if not 0 < self.half_width <= np.pi:
            raise ValueError(f"half_width must lie in 0..pi, not {self.half_width} rad")

    def place(self, radius: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
        """Replace the load by forces at points, for the integration of harmonics.

        Args:
            radius: Radius of the top [m].
            highest: Highest order that will be integrated [-].
            refinement: Factor on the number of points [-].

        Returns:
            Angles, shape (n,) [rad], and forces (outward, tangential), shape (n, 2) [N/m].
        """
        at, weight = place_points(-self.half_width, self.half_width, highest, refinement)
        values = np.stack([-sample(self.pressure, at), sample(self.shear, at)], axis=1)
        return self.angle + at, radius * values * weight[:, None]


CylinderLoad = LineLoad | ArcLoad


@dataclass(frozen=True, kw_only=True)
class CylinderLayer:
    """An elastic layer, bonded to a rigid cylinder, of infinite length, in plane strain.

    Attributes:
        core_radius: Radius of the rigid cylinder [m].
        thickness: Thickness of the layer [m].
        material: Material, with its linear elastic properties at zero load; Poisson ratios of 0 to 0.5.
    """

    core_radius: float
    thickness: float
    material: Material

    def __post_init__(self) -> None:
        """Check that radius and thickness of the layer are positive.

        Raises:
            ValueError: If a dimension is not positive.
        """
        if not (self.core_radius > 0 and self.thickness > 0):
            raise ValueError(f"radius {self.core_radius} m and thickness {self.thickness} m must be positive")

    @property
    def outer_radius(self) -> float:
        """Radius of the top of the layer [m]."""
        return self.core_radius + self.thickness

    def transfer(self, orders: npt.ArrayLike) -> HarmonicTransfer:
        """Compute the response to tractions of orders m >= 0, shape (n,): see `transfer_cylinder`."""
        m = np.asarray(orders, dtype=float)
        return transfer_cylinder(m, self.core_radius, self.outer_radius, self.material)

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
            return _sum_series(_turn(np.einsum("nij,nj->ni", response, self._expand(count)), -1), at)

        return converge_top(evaluate, tolerance)

    def resultants(self, patches: npt.ArrayLike) -> FloatArray:
        """Integrate the traction on the core over patches, exactly.

        Args:
            patches: First and last angle of each patch, shape (n, 2) [rad].

        Returns:
            Force of the layer on each patch along x and y, shape (n, 2) [N/m].
        """
        start, end = _read_patches(patches).T
        m = np.arange(self.terms)
        total = np.zeros(len(start), dtype=complex)
        # The traction vector, written as a complex number x + i y, is (outward + i tangential) exp(i theta).  The real
        # parts of the amplitudes are written as Re z = (z + conj z) / 2.
        radial, tangential = self._base.T
        for values, turn in ((radial + 1j * tangential, m + 1), (np.conj(radial - 1j * tangential), 1 - m)):
            middle, half = (start + end) / 2, (end - start) / 2
            waves = np.exp(1j * np.outer(middle, turn)) * np.sinc(np.outer(half, turn) / np.pi)
            total += half * (waves @ values)
        return self.layer.core_radius * np.stack([total.real, total.imag], axis=1)

    def texel_forces(self, patches: npt.ArrayLike, normals: npt.ArrayLike | None = None) -> FloatArray:
        """Compute texel forces: the resultant of the traction on each patch, shear included, against its normal.

        Args:
            patches: First and last angle of each patch, shape (n, 2) [rad].
            normals: Angle of each texel's outward normal, shape (n,) [rad]; the angle of the patch's middle if None.

        Returns:
            Force of each texel, positive under pressure, shape (n,) [N/m].
        """
        at = _read_patches(patches).mean(axis=1) if normals is None else np.asarray(normals, dtype=float)
        normal = np.stack([np.cos(at), np.sin(at)], axis=1)
        return -np.asarray(np.einsum("ni,ni->n", self.resultants(patches), normal))

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
        return float(2 * np.pi * self.layer.core_radius**2 * self._base[0, 1].real)

    @cached_property
    def _base(self) -> ComplexArray:
        """Amplitudes of the traction on the core, Re (amplitude exp(i m theta)), shape (terms, 2) [Pa]."""
        response = self.layer.transfer(np.arange(self.terms)).base
        return _turn(np.einsum("nij,nj->ni", response, self._expand(self.terms)), -1)

    def _expand(self, count: int) -> ComplexArray:
        """Compute the Fourier coefficients of the loads on the top, with the phases of `transfer_cylinder`.

        Returns:
            Coefficients of the outward and the tangential traction, shape (count, 2) [Pa].
        """
        total = np.zeros((count, 2), dtype=complex)
        radius = self.layer.outer_radius
        for load in self.loads:
            angles, forces = load.place(radius, count)
            coarse = _integrate_waves(angles, forces, count)
            fine = _integrate_waves(*load.place(radius, count, 2), count)
            check_resolved(coarse, fine, float(np.abs(forces).sum()))
            total += fine / (np.pi * radius)
        total[0] /= 2
        return _turn(total, 1)

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


def _read_patches(patches: npt.ArrayLike) -> FloatArray:
    """Convert the first and last angles of n patches of the base to an array of shape (n, 2) [rad], and check them.

    Raises:
        ValueError: If the shape is wrong, or a patch ends before it starts or is longer than the circumference.
    """
    out = np.asarray(patches, dtype=float)
    if out.ndim != 2 or out.shape[1] != 2:  # noqa: PLR2004 -- first and last angle
        raise ValueError(f"patches must have shape (n, 2), not {out.shape}")
    width = out[:, 1] - out[:, 0]
    if not ((width > 0) & (width <= 2 * np.pi * (1 + 1e-12))).all():
        raise ValueError("each patch must end at a larger angle than it starts, less than a turn away")
    return out


def _turn(amplitudes: ComplexArray, sign: int) -> ComplexArray:
    """Multiply the tangential Fourier amplitudes by +i or -i, according to `sign`.

    A radial traction cos(m theta) belongs to a tangential traction sin(m theta).
    """
    return np.asarray(amplitudes * np.array([1.0, sign * 1j]))


def _integrate_waves(angles: FloatArray, values: FloatArray, count: int) -> ComplexArray:
    """Sum values times exp(-i m angle) over the angles for m = 0..count - 1, shape (count, values.shape[1])."""
    starts = np.arange(0, count, _BLOCK)
    total = np.zeros((values.shape[1], _BLOCK, len(starts)), dtype=complex)
    for start in range(0, len(angles), _ANGLES):
        part = slice(start, start + _ANGLES)
        first = np.exp(-1j * np.outer(np.arange(_BLOCK), angles[part]))
        steps = np.exp(-1j * np.outer(angles[part], starts))
        for i, weight in enumerate(values[part].T):
            total[i] += first @ (steps * weight[:, None])
    return total.transpose(2, 1, 0).reshape(-1, values.shape[1])[:count]


def _sum_series(amplitudes: ComplexArray, angles: FloatArray) -> FloatArray:
    """Sum the Fourier series Re (amplitude exp(i m angle)) over the orders m.

    Args:
        amplitudes: Outward and tangential amplitudes of n orders, shape (n, 2).
        angles: k angles, shape (k,) [rad].

    Returns:
        Sums, shape (k, 2).
    """
    m = np.arange(len(amplitudes))
    pieces = np.array_split(angles, len(angles) * len(m) // 10**6 + 1)
    return np.concatenate([(np.exp(1j * np.outer(piece, m)) @ amplitudes).real for piece in pieces])
