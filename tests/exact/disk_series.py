"""Compute the apparent modulus of an incompressible disk bonded between two rigid plates, at small strain.

The apparent modulus is the mean compressive stress over the compressive strain of the disk.  By symmetry the upper half
of the disk is solved.  Lengths are in units of half the height; the plate at z = 1 moves by -1.  The squeeze film
u_z = f(z), u_r = -r f' / 2 with f = -(3 z - z^3) / 2 satisfies the field equations and the conditions on the plates,
and leaves tractions on the free edge of the disk.  Fields that vanish on the plates remove these tractions:
u_z = k I0(k r) phi(z), u_r = -I1(k r) phi'(z) with phi = sin k z - tan k z cos k z and sin 2 k = 2 k (Papkovich-Fadle
functions: Spence 1983, IMA J. Appl. Math. 30).  The coefficients of the fields' real and imaginary parts follow from
minimum energy, which gives an upper bound of the modulus.  Where plate and free edge meet, displacements are
proportional to distance^s with cos(pi s / 2) = s (Williams 1952).  The error of the bound is therefore proportional to
terms^(-2 s), and the bound is extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import ive

from meshes.array_types import FloatArray

ComplexArray = npt.NDArray[np.complex128]

#: Number of Newton steps for the roots of sin 2 k = 2 k; far fewer steps reach the level of rounding [-].
_NEWTON_STEPS = 30


@dataclass(frozen=True, kw_only=True)
class DiskModulus:
    """Apparent modulus of a bonded disk over its Young's modulus [-], and its estimated relative error [-]."""

    value: float
    error: float


def bonded_disk(shape_factor: float, *, terms: int = 40) -> DiskModulus:
    """Compute the apparent modulus of an incompressible disk bonded to two rigid plates, over its Young's modulus.

    Args:
        shape_factor: Loaded area over free area of the disk, radius / (2 height) [-].
        terms: Number of pairs of series terms; the limit is extrapolated from this number and half of it [-].

    Returns:
        Apparent modulus, with the change from half as many terms as its error.

    Raises:
        ValueError: If the shape factor is not positive.
    """
    if not shape_factor > 0:
        raise ValueError(f"the shape factor must be positive, not {shape_factor}")
    bounds = np.array([_bound_modulus(4 * shape_factor, n) for n in (terms // 4, terms // 2, terms)])
    singularity = brentq(lambda s: np.cos(np.pi * s / 2) - s, 0.1, 0.9)
    coarse, fine = bounds[1:] + np.diff(bounds) / (2 ** (2 * singularity) - 1)
    return DiskModulus(value=float(fine), error=abs(float(coarse / fine - 1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Edge:
    """Displacements and tractions of several fields at points of the disk's free edge.

    Attributes:
        u_r: Displacements along r, shape (points, fields) [half heights].
        u_z: Displacements along z, shape (points, fields) [half heights].
        t_r: Tractions along r, shape (points, fields) [shear moduli].
        t_z: Tractions along z, shape (points, fields) [shear moduli].
    """

    u_r: FloatArray
    u_z: FloatArray
    t_r: FloatArray
    t_z: FloatArray

    def work(self, other: _Edge, weight: FloatArray) -> FloatArray:
        """Compute the work of the tractions of these fields on the displacements of other fields on the free edge.

        Args:
            other: Displacements at the same points of the edge.
            weight: Weights of the integral over the edge, shape (points,).

        Returns:
            Work of each of these fields (row) on each of the other fields (column).
        """
        return (self.t_r * weight[:, None]).T @ other.u_r + (self.t_z * weight[:, None]).T @ other.u_z


def _bound_modulus(radius: float, terms: int) -> float:
    """Compute an upper bound of the apparent modulus over Young's modulus: twice the least energy over the disk's area.

    Args:
        radius: Radius of the disk over half its height [-].
        terms: Number of pairs of series terms [-].
    """
    points, weights = np.polynomial.legendre.leggauss(4 * terms + 40)
    angle = np.pi / 4 * (points + 1)
    z, weight = np.sin(angle), 2 * np.pi * radius * weights * np.pi / 4 * np.cos(angle)
    film, fields = _evaluate_squeeze_film(radius, z), _evaluate_edge_fields(radius, z, terms)
    load = film.work(fields, weight)[0]
    gained = float(load @ np.linalg.lstsq(fields.work(fields, weight), load, rcond=1e-14)[0])
    return (3.6 + 3 * radius**2 / 8 - gained / (np.pi * radius**2)) / 3


def _evaluate_squeeze_film(radius: float, z: FloatArray) -> _Edge:
    """Evaluate the squeeze film at heights z of the free edge, for shear modulus 1."""
    slope, curve = -(3 - 3 * z**2) / 2, 3 * z
    t_r = -2 * slope + 3 * radius**2 / 4
    columns = [-radius * slope / 2, -(3 * z - z**3) / 2, t_r, -radius * curve / 2]
    u_r, u_z, t_r, t_z = (column[:, None] for column in columns)
    return _Edge(u_r=u_r, u_z=u_z, t_r=t_r, t_z=t_z)


def _evaluate_edge_fields(radius: float, z: FloatArray, terms: int) -> _Edge:
    """Evaluate the Papkovich-Fadle fields, which vanish on the plates, at heights z of the free edge.

    Returns:
        Real parts, then imaginary parts of the fields, each scaled to a root mean square displacement of 1.
    """
    k = _find_wave_numbers(terms)
    s, c, t = np.sin(np.outer(z, k)), np.cos(np.outer(z, k)), np.tan(k)
    zk = np.outer(z, k)
    scale = np.exp(-np.abs(k.imag))
    phi = (s - t * z[:, None] * c) * scale
    first = (k * c - t * (c - zk * s)) * scale
    second = (-(k**2) * s + t * k * (2 * s + zk * c)) * scale
    third = (-(k**3) * c + t * k**2 * (3 * c - zk * s)) * scale
    zero, one = ive(0, k * radius), ive(1, k * radius)
    pressure = -(zero / k) * (k**2 * first + third)
    columns = {
        "u_r": -one * first,
        "u_z": k * zero * phi,
        "t_r": -pressure - 2 * (k * zero - one / radius) * first,
        "t_z": -one * second + k**2 * one * phi,
    }
    size = np.sqrt((np.abs(columns["u_r"]) ** 2 + np.abs(columns["u_z"]) ** 2).mean(axis=0))
    return _Edge(**{name: np.hstack([(v / size).real, (v / size).imag]) for name, v in columns.items()})


def _find_wave_numbers(terms: int) -> ComplexArray:
    """Find the first roots of sin 2 k = 2 k in the first quadrant, by Newton's method from their asymptotes."""
    turn = (2 * np.arange(1, terms + 1) + 0.5) * np.pi
    k = (turn + 1j * np.log(2 * turn)) / 2
    for _ in range(_NEWTON_STEPS):
        k = k - (np.sin(2 * k) - 2 * k) / (2 * np.cos(2 * k) - 2)
    return np.asarray(k)
