"""Exact response of bonded elastic layers on a rigid base to a normal load, wave number by wave number.

For a surface pressure cos(k x) each layer has Papkovich-Neuber potentials Phi and Psi proportional to exp(+-k z);
boundary and interface conditions give one small linear system per wave number.  Every exponential is written as a decay
from one face of its layer, so that none overflows.  Axisymmetric loads follow by a Hankel transform, because the
response of an isotropic layer does not depend on the horizontal direction.

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
from meshes.array_types import FloatArray

#: Product of wave number and thickness below which a parabola to the exact limit at k = 0 replaces the linear systems,
#: which lose digits there [-].
_SMALL = 2e-3
#: Product of wave number and thickness above which the base pressure is zero: exp(-60) = 1e-26 [-].
_LARGE = 60.0
#: Least number of panels of a Hankel transform, and Gauss points in each.
_PANELS, _PANEL_POINTS = 64.0, 10
#: Distances whose Bessel functions are computed at once; bounds the memory.
_BLOCK = 512


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """Response to a unit surface pressure cos(k x).

    Attributes:
        compliance: Downward displacement of the top per pressure, shape (m,) [m/Pa].
        base: Pressure on the base per pressure on the top, shape (m,) [-].
    """

    compliance: FloatArray
    base: FloatArray


def transfer(cover: Cover, wave_number: npt.ArrayLike) -> Transfer:
    """Compute the exact transfer functions of a laterally wide cover under frictionless normal pressure.

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
    limit_compliance, limit_base = _compute_uniform_limit(cover)
    # Below `_SMALL`, interpolate in k^2 from the uniform limit: compliance and base pressure are even functions of k.
    fraction = np.where(small, (k * cover.thickness / _SMALL) ** 2, 1.0)
    return Transfer(
        compliance=limit_compliance + fraction * (solved.compliance - limit_compliance),
        base=limit_base + fraction * (solved.base - limit_base),
    )


def half_space_compliance(layer: Layer, wave_number: FloatArray) -> FloatArray:
    """Compliance of a half space, (1 - nu) / (mu k), shape (m,) [m/Pa] (Johnson 1985, eq. 2.61).

    It is the limit of every cover for short waves, with the material of its top layer.

    Args:
        layer: Gives the material; its thickness is not used.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].
    """
    material = layer.material
    return (1 - material.poisson_ratio) / (material.shear_modulus * wave_number)


def one_layer_compliance(layer: Layer, wave_number: FloatArray) -> FloatArray:
    """Top compliance of one bonded layer for k > 0, shape (m,) [m/Pa].

    (1 - nu) / (mu k) * (2 q sinh 2x - 4x) / (2 q cosh 2x + 1 + q^2 + 4 x^2), q = 3 - 4 nu, x = k h
    (Vorovich, Aleksandrov and Babeshko 1974); computed with decaying exponentials.
    """
    q = 3 - 4 * layer.material.poisson_ratio
    x = wave_number * layer.thickness
    decay = np.exp(-2 * x)
    numerator = q * (1 - decay**2) - 4 * x * decay
    denominator = q * (1 + decay**2) + (1 + q**2 + 4 * x**2) * decay
    return half_space_compliance(layer, wave_number) * numerator / denominator


def point_response(cover: Cover, radius: npt.ArrayLike) -> FloatArray:
    """Base pressure per unit point load on the top, at each distance from the load, shape of `radius` [1/m2].

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
    for start in range(0, flat.size, _BLOCK):
        block = flat[start : start + _BLOCK]
        out[start : start + _BLOCK] = j0(block[:, None] * k) @ density
    return out.reshape(r.shape)


def point_response_spline(cover: Cover, reach: float, points: int = 1601) -> CubicSpline:
    """Tabulate `point_response` as a cubic spline, for many evaluations.

    Args:
        cover: Layers; linear elastic at zero load.
        reach: Largest distance [m].
        points: Points of the table, evenly spaced from 0 to `reach` [-].
    """
    radius = np.linspace(0.0, reach, points)
    return CubicSpline(radius, point_response(cover, radius), bc_type="clamped")


def hankel_nodes(cover: Cover, reach: float) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights in k that resolve J0(k r) up to r = `reach`, shape (m,) each [1/m].

    Args:
        cover: Gives the largest wave number that matters.
        reach: Largest distance [m].
    """
    top = _LARGE / cover.thickness
    panels = int(np.ceil(max(_PANELS, top * reach / np.pi)))
    nodes, weights = np.polynomial.legendre.leggauss(_PANEL_POINTS)
    edges = np.linspace(0, top, panels + 1)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()


def variance(layer: Layer) -> float:
    """Variance of the base pressure of one bonded layer along one axis, h^2 nu / (1 - nu) [m2]."""
    nu = layer.material.poisson_ratio
    return layer.thickness**2 * nu / (1 - nu)


def _compute_uniform_limit(cover: Cover) -> tuple[float, float]:
    """Compliance [m/Pa] and base pressure [-] under uniform pressure: layers are compressed without lateral strain."""
    total = 0.0
    for layer in cover.layers:
        nu, mu = layer.material.poisson_ratio, layer.material.shear_modulus
        total += layer.thickness * (1 - 2 * nu) / (2 * mu * (1 - nu))
    return total, 1.0


def _evaluate_face(layer: Layer, k: FloatArray, z: float, scale: float) -> FloatArray:
    """Evaluate the fields of the four unknowns of a layer at height z.

    Args:
        layer: The layer.
        k: Wave numbers, shape (m,) [1/m].
        z: Height above the bottom of the layer [m].
        scale: Unit of stress [Pa].

    Returns:
        Rows u, w, normal stress / k and shear stress / k, columns for the unknowns, shape (m, 4, 4).
    """
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
    """Assemble and solve the linear system of every wave number, of 4 unknowns per layer."""
    layers = cover.layers
    scale = 2 * layers[-1].material.shear_modulus
    n = len(layers)
    matrix = np.zeros((k.size, 4 * n, 4 * n))
    right = np.zeros((k.size, 4 * n, 1))
    bottom = _evaluate_face(layers[0], k, 0.0, scale)
    matrix[:, 0, :4] = bottom[:, 1]
    matrix[:, 1, :4] = bottom[:, 0] if cover.base == "bonded" else bottom[:, 3]
    for i in range(n - 1):
        rows = slice(2 + 4 * i, 6 + 4 * i)
        matrix[:, rows, 4 * i : 4 * i + 4] = _evaluate_face(layers[i], k, layers[i].thickness, scale)
        matrix[:, rows, 4 * i + 4 : 4 * i + 8] = -_evaluate_face(layers[i + 1], k, 0.0, scale)
    top = _evaluate_face(layers[-1], k, layers[-1].thickness, scale)
    matrix[:, -2:, -4:] = top[:, 2:]
    right[:, -2, 0] = -1.0
    unknown = np.linalg.solve(matrix, right)[..., 0]
    down = -np.einsum("mi,mi->m", top[:, 1], unknown[:, -4:]) / (k * scale)
    base = -np.einsum("mi,mi->m", bottom[:, 2], unknown[:, :4])
    return Transfer(compliance=down, base=base)
