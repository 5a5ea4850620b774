"""Exact response of bonded elastic layers on a rigid base to a normal load, wave number by wave number.

For a surface pressure cos(k x) each layer carries Papkovich-Neuber potentials Phi, Psi proportional to exp(+-k z);
boundary and interface conditions make one small linear system per wave number.  Every exponential is written as a
decay from one face of its layer, so nothing grows.  Axisymmetric loads follow by a Hankel transform, since an
isotropic layer answers every horizontal direction alike.

2 mu u = 4 (1 - nu) Psi e_z - grad(Phi + z Psi), both potentials harmonic (Barber, Elasticity, chapter 15, with
x and y components of the vector potential zero).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.special import j0

from meshes import Cover, Layer

FloatArray = npt.NDArray[np.float64]

#: Below this k h the exact series start is used; the linear systems lose digits there.
_SMALL = 2e-3
#: Beyond this k h of the whole cover nothing reaches the base (exp(-60) = 1e-26).
_LARGE = 60.0


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """Answer to a unit surface pressure cos(k x).

    Attributes:
        compliance: Downward displacement of the top per pressure, shape (m,) [m/Pa].
        base: Pressure on the base per pressure on the top, shape (m,) [-].
    """

    compliance: FloatArray
    base: FloatArray


def transfer(cover: Cover, wave_number: npt.ArrayLike) -> Transfer:
    """Exact transfer functions of a laterally wide cover under frictionless normal pressure.

    Args:
        cover: Layers; linear elastic at zero load.
        wave_number: Wave numbers k >= 0, shape (m,) [1/m].

    Raises:
        ValueError: If a wave number is negative.
    """
    k = np.atleast_1d(np.asarray(wave_number, dtype=float))
    if (k < 0).any():
        raise ValueError("wave numbers must not be negative")
    small = k * cover.thickness < _SMALL
    solved = _solve(cover, np.where(small, _SMALL / cover.thickness, k))
    limit_compliance, limit_base = _uniform_limit(cover)
    fraction = np.where(small, (k * cover.thickness / _SMALL) ** 2, 1.0)  # both are even in k
    return Transfer(
        compliance=limit_compliance + fraction * (solved.compliance - limit_compliance),
        base=limit_base + fraction * (solved.base - limit_base),
    )


def half_space_compliance(layer: Layer, wave_number: FloatArray) -> FloatArray:
    """(1 - nu) / (mu k): the limit of every cover for short waves (Johnson 1985, eq. 2.61) [m/Pa]."""
    material = layer.material
    return (1 - material.poisson_ratio) / (material.shear_modulus * wave_number)


def one_layer_compliance(layer: Layer, wave_number: FloatArray) -> FloatArray:
    """Top compliance of one bonded layer in one line, for k > 0, shape (m,) [m/Pa].

    (1 - nu) / (mu k) * (2 q sinh 2x - 4x) / (2 q cosh 2x + 1 + q^2 + 4 x^2), q = 3 - 4 nu, x = k h
    (Vorovich, Aleksandrov and Babeshko 1974); written with decaying exponentials.
    """
    q = 3 - 4 * layer.material.poisson_ratio
    x = wave_number * layer.thickness
    decay = np.exp(-2 * x)
    numerator = q * (1 - decay**2) - 4 * x * decay
    denominator = q * (1 + decay**2) + (1 + q**2 + 4 * x**2) * decay
    return half_space_compliance(layer, wave_number) * numerator / denominator


def point_response(cover: Cover, radius: npt.ArrayLike) -> FloatArray:
    """Base pressure per unit point load on the top, at each distance from the load, [1/m2].

    (1 / 2 pi) int base(k) J0(k r) k dk by Gauss-Legendre panels shorter than half a period.

    Args:
        cover: Layers; linear elastic at zero load.
        radius: Distances along the base, any shape [m].
    """
    r = np.asarray(radius, dtype=float)
    k, weight = hankel_nodes(cover, float(r.max(initial=0.0)))
    density = transfer(cover, k).base * k * weight / (2 * np.pi)
    flat = r.ravel()
    out = np.empty_like(flat)
    for start in range(0, flat.size, 512):  # bounds the memory of the Bessel table
        block = flat[start : start + 512]
        out[start : start + 512] = j0(block[:, None] * k) @ density
    return out.reshape(r.shape)


def point_response_spline(cover: Cover, reach: float, points: int = 1601) -> CubicSpline:
    """`point_response` on an even grid from 0 to `reach` [m] as a cubic spline, for many evaluations."""
    radius = np.linspace(0.0, reach, points)
    return CubicSpline(radius, point_response(cover, radius), bc_type="clamped")


def hankel_nodes(cover: Cover, reach: float) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights in k [1/m] that resolve J0(k r) for every r up to `reach` [m]."""
    top = _LARGE / cover.thickness
    panels = int(np.ceil(max(64.0, top * reach / np.pi)))
    nodes, weights = np.polynomial.legendre.leggauss(10)
    edges = np.linspace(0, top, panels + 1)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()


def variance(layer: Layer) -> float:
    """Variance of one bonded layer's base response along one axis, h^2 nu / (1 - nu) [m2]."""
    nu = layer.material.poisson_ratio
    return layer.thickness**2 * nu / (1 - nu)


def _uniform_limit(cover: Cover) -> tuple[float, float]:
    """Uniform pressure: every layer is compressed without lateral strain, the base carries all of it."""
    total = 0.0
    for layer in cover.layers:
        nu, mu = layer.material.poisson_ratio, layer.material.shear_modulus
        total += layer.thickness * (1 - 2 * nu) / (2 * mu * (1 - nu))
    return total, 1.0


def _face(layer: Layer, k: FloatArray, z: float, scale: float) -> FloatArray:
    """Rows (u, w, normal stress / k, shear stress / k) of the four unknowns at height z, shape (m, 4, 4)."""
    nu, h = layer.material.poisson_ratio, layer.thickness
    compliance = scale / (2 * layer.material.shear_modulus)
    rows = np.empty((k.size, 4, 4))
    for column, sign, s in ((0, -1.0, z), (2, 1.0, z - h)):  # decay from the bottom, decay from the top
        e = np.exp(sign * k * s)
        ks = k * s
        one = np.ones_like(k)
        phi = np.stack([one * compliance, -sign * one * compliance, -one, sign * one], axis=1)
        psi = np.stack(
            [
                ks * compliance,
                ((3 - 4 * nu) - sign * ks) * compliance,
                2 * (1 - nu) * sign - ks,
                -((1 - 2 * nu) - sign * ks),
            ],
            axis=1,
        )
        rows[:, :, column] = phi * e[:, None]
        rows[:, :, column + 1] = psi * e[:, None]
    return rows


def _solve(cover: Cover, k: FloatArray) -> Transfer:
    """Assemble and solve the 4 N x 4 N system of every wave number."""
    layers = cover.layers
    scale = 2 * layers[-1].material.shear_modulus
    n = len(layers)
    matrix = np.zeros((k.size, 4 * n, 4 * n))
    right = np.zeros((k.size, 4 * n, 1))
    bottom = _face(layers[0], k, 0.0, scale)
    matrix[:, 0, :4] = bottom[:, 1]
    matrix[:, 1, :4] = bottom[:, 0] if cover.base == "bonded" else bottom[:, 3]
    for i in range(n - 1):
        rows = slice(2 + 4 * i, 6 + 4 * i)
        matrix[:, rows, 4 * i : 4 * i + 4] = _face(layers[i], k, layers[i].thickness, scale)
        matrix[:, rows, 4 * i + 4 : 4 * i + 8] = -_face(layers[i + 1], k, 0.0, scale)
    top = _face(layers[-1], k, layers[-1].thickness, scale)
    matrix[:, -2:, -4:] = top[:, 2:]
    right[:, -2, 0] = -1.0
    unknown = np.linalg.solve(matrix, right)[..., 0]
    down = -np.einsum("mi,mi->m", top[:, 1], unknown[:, -4:]) / (k * scale)
    base = -np.einsum("mi,mi->m", bottom[:, 2], unknown[:, :4])
    return Transfer(compliance=down, base=base)
