"""Solve an elastic layer bonded to a rigid cylinder under a traction on its top, exactly, in plane strain.

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

Tractions on an interval of angles are integrated by Gauss points, whose number suits the highest harmonic.  The
traction on the base converges exponentially with the number of terms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

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
    #: Number of terms of the traction on the base, more than those that `deep` counts [-].
    first: int = 64
    #: Largest number of terms of the traction on the base [-].
    most_terms: int = 2**17
    #: Product of order and logarithm of outer over core radius above which a harmonic does not reach the base, because
    #: its amplitude there is below exp(-60) = 1e-26 [-].
    deep: float = 60.0


_SERIES = SeriesSettings()


def place_points(half_width: float, highest: int, refinement: int = 1) -> tuple[FloatArray, FloatArray]:
    """Place Gauss points on an interval around 0 for tractions that end like a square root at either end.

    The substitution is angle = half width sin(t), with panels of equal length in t.  It makes a traction with such
    ends, for example a Hertzian pressure, an analytic function of t.

    The middle of the interval is an end of two panels, so that each half of the points integrates its own half.

    Args:
        half_width: Half of the angle of the interval [rad].
        highest: Highest harmonic that will be integrated [-].
        refinement: Factor on the number of panels [-].

    Returns:
        Angles, shape (n,) [rad], and weights, shape (n,) [rad].

    Raises:
        ValueError: If the half width is not in 0..pi.
    """
    if not 0 < half_width <= np.pi:
        raise ValueError(f"half the angle of a load must lie in 0..pi, not {half_width} rad")
    panels = 2 * refinement * max(_SERIES.panels, int(np.ceil(np.pi * highest * half_width / (2 * _SERIES.phase))))
    t, weight = place_gauss_points(np.linspace(-np.pi / 2, np.pi / 2, panels + 1), _SERIES.points)
    return half_width * np.sin(t), weight * half_width * np.cos(t)


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

    def press(
        self, patches: npt.ArrayLike, pressure: Callable[[FloatArray], FloatArray], half_width: float
    ) -> FloatArray:
        """Compute texel forces under a pressure on an arc of the top, whose middle has the angle 0.

        Args:
            patches: First and last angle of each texel, shape (n, 2) [rad].
            pressure: Pressure [Pa] at n angles [rad], smooth inside the arc; at its ends it may jump, or go like a
                square root.
            half_width: Half of the angle of the arc, at most pi [rad].

        Returns:
            Force of each texel along the normal of its middle, positive under pressure, shape (n,) [N/m].

        Raises:
            ValueError: If the pressure is not smooth, an angle is out of range, or the layer is too thin.
        """
        terms = count_terms(np.log(self.outer_radius / self.core_radius))

        def place(refinement: int) -> tuple[FloatArray, FloatArray]:
            at, weight = place_points(half_width, terms, refinement)
            return at, np.outer(pressure(at) * weight * self.outer_radius, [-1.0, 0.0])

        load = expand_load(place, self.outer_radius, terms)
        base = np.einsum("nij,nj->ni", self.transfer(np.arange(terms)).base, load)
        force = sum_patches(base, self.core_radius, patches)
        at = np.asarray(patches, dtype=float).mean(axis=1)
        return np.asarray(-(force[:, 0] * np.cos(at) + force[:, 1] * np.sin(at)))


def count_terms(span: float) -> int:
    """Count the terms that reach the base of a layer; `span` is the logarithm of its outer radius over the core's.

    Raises:
        ValueError: If more than 131072 terms are needed, as in a layer thinner than about 0.0005 radii.
    """
    count = int(np.ceil(_SERIES.deep / span)) + _SERIES.first
    if count > _SERIES.most_terms:
        raise ValueError(f"the layer is too thin for its radius: its series needs more than {_SERIES.most_terms} terms")
    return count


def expand_load(place: Callable[[int], tuple[FloatArray, FloatArray]], radius: float, count: int) -> ComplexArray:
    """Compute the Fourier coefficients of a load on the top, with the phases of `transfer_cylinder`.

    Args:
        place: Function that replaces the load by forces at points, with a factor on their number: angles, shape (n,)
            [rad], and forces (outward, tangential), shape (n, 2) [N/m].
        radius: Radius of the top [m].
        count: Number of terms [-].

    Returns:
        Coefficients of the outward and the tangential traction, shape (count, 2) [Pa].

    Raises:
        ValueError: If the harmonics from twice the number of points differ by more than 1e-9 of the sum of the forces.
    """
    angles, forces = place(1)
    coarse, fine = _integrate_waves(angles, forces, count), _integrate_waves(*place(2), count)
    if not np.abs(fine - coarse).max() <= _SERIES.settled * np.abs(forces).sum():  # also if a value is not finite
        raise ValueError("the traction is not smooth inside its interval; split it into several loads where it jumps")
    fine[0] /= 2
    return np.asarray(fine / (np.pi * radius) * [1.0, 1j])


def sum_patches(amplitudes: ComplexArray, radius: float, patches: npt.ArrayLike) -> FloatArray:
    """Integrate a traction on the core over patches, exactly.

    Args:
        amplitudes: Outward and tangential amplitudes, with the phases of `transfer_cylinder`, shape (count, 2) [Pa].
        radius: Radius of the core [m].
        patches: First and last angle of each patch, shape (n, 2) [rad].

    Returns:
        Force on each patch along x and y, shape (n, 2) [N/m].

    Raises:
        ValueError: If the shape is wrong, or a patch ends before it starts or is longer than the circumference.
    """
    ends = np.asarray(patches, dtype=float)
    if ends.ndim != 2 or ends.shape[1] != 2:  # noqa: PLR2004 -- first and last angle
        raise ValueError(f"patches must have shape (n, 2), not {ends.shape}")
    middle, half = ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / 2
    if not ((half > 0) & (half <= np.pi * (1 + 1e-12))).all():
        raise ValueError("each patch must end at a larger angle than it starts, less than a turn away")
    m = np.arange(len(amplitudes))
    total = np.zeros(len(ends), dtype=complex)
    # The traction vector, written as a complex number x + i y, is (outward + i tangential) exp(i theta).  The real
    # parts of the amplitudes are written as Re z = (z + conj z) / 2.
    radial, tangential = (amplitudes * [1.0, -1j]).T
    for values, turn in ((radial + 1j * tangential, m + 1), (np.conj(radial - 1j * tangential), 1 - m)):
        waves = np.exp(1j * np.outer(middle, turn)) * np.sinc(np.outer(half, turn) / np.pi)
        total += half * (waves @ values)
    return radius * np.stack([total.real, total.imag], axis=1)


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
