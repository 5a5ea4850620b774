"""Compute the exact response of an elastic layer, bonded to a rigid core, to one harmonic of the traction on its top.

On a cylinder (plane strain) the harmonics are exp(i m theta), on a sphere Legendre polynomials P_n(cos theta).  The
state y of one harmonic holds the displacements u_r and u_t and the stresses r sigma_rr and r sigma_rt.  With the
logarithm of the radius, s = ln(r / core radius), the field equations become dy/ds = A y, where A does not depend on s
(Euler's equation).  So y at the top is expm(A S) times y at the core, with S = ln(outer radius / core radius).  A holds
(1 - 2 nu) / (1 - nu) and nu / (1 - nu), but never 1 / (1 - 2 nu): an incompressible layer is an ordinary case.

Shifted by its mean, A has the eigenvalues +-(k + 1) and +-(k - 1), where k = m on a cylinder and n + 1/2 on a sphere.
For large k S the exponential is written with the projectors P on the growing and on the decaying solutions, on which
(A -+ k)^2 = 1:

    exp(-k S) expm(A S) = P (cosh S + (A - k) sinh S) + exp(-2 k S) (1 - P) (cosh S + (A + k) sinh S)

so that nothing overflows, and thin layers lose no digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from meshes import Material
from meshes.array_types import FloatArray

#: Product k S above which the exponential is written with projectors [-].
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
    # Displacements are in units of (core radius / (mu scale)), so that all entries are of the same size at large m.
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
    """Stack the entries of a matrix, each of shape (n,), to shape (n, 4, 4)."""
    return np.moveaxis(np.array(rows), 2, 0)


def cross_layer(
    matrix: FloatArray, k: FloatArray, mean: float, radii: tuple[float, float], stiffness: FloatArray
) -> HarmonicTransfer:
    """Solve the layer between a core that does not move and a top with given tractions.

    Args:
        matrix: Matrices A, shape (n, 4, 4).
        k: Half the distance between the means of the growing and of the decaying exponents, shape (n,) [-].
        mean: Mean of the eigenvalues of A [-].
        radii: Radius of the core and of the top [m].
        stiffness: Unit of r sigma / u, shape (n,) [Pa].
    """
    core, outer = radii
    span = np.log(outer / core)
    crossing, exponent = _exponentiate(matrix - mean * np.eye(4), k, span)
    # Rows u and r sigma of the columns that belong to tractions on the core; displacements vanish there.
    moved, stressed = crossing[:, :2, 2:], crossing[:, 2:, 2:]
    inverse = np.linalg.inv(stressed)
    decay = np.exp(-exponent - mean * span) * outer / core
    return HarmonicTransfer(
        base=decay[:, None, None] * inverse,
        compliance=(outer / stiffness)[:, None, None] * (moved @ inverse),
    )


def _exponentiate(matrix: FloatArray, k: FloatArray, span: float) -> tuple[FloatArray, FloatArray]:
    """Compute expm(A S), as a matrix and the exponent of a factor of it that would overflow.

    Args:
        matrix: Matrices A with eigenvalues +-(k + 1) and +-(k - 1), shape (n, 4, 4).
        k: Numbers k, shape (n,) [-].
        span: S [-].

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
