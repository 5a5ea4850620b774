"""Laterally wide covers, wave number by wave number: finite elements through the thickness, Fourier along it.

A surface pressure cos(k x) moves an isotropic layered cover as (U(z) sin k x, W(z) cos k x) with mean pressure
P(z) cos k x, so one small one-dimensional mixed problem per wave number (quadratic U, W, linear P, free to jump where
materials meet) gives how the top yields.  A pressure of any shape follows by superposition, which is how contacts of
shapes without an axis are solved on a wide cover.  The method is the semi-analytical finite-element method; with the
axisymmetric solve it is a second discretisation of the same cover.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.special import j0

from fem_reference.linear_response.axisymmetric import edge_shape
from fem_reference.materials import bulk_compliance
from meshes import Cover, Layer

FloatArray = npt.NDArray[np.float64]

#: exp(-2 x) falls below 1e-11 here: the top layer no longer feels what is under it.
_BLIND = 13.0


@dataclass(frozen=True, kw_only=True)
class SlabTransfer:
    """Answer to a unit surface pressure cos(k x).

    Attributes:
        compliance: Downward displacement of the top per pressure, shape (m,) [m/Pa].
        base: Pressure on the base per pressure on the top, from the reaction, shape (m,) [-].
    """

    compliance: FloatArray
    base: FloatArray


def slab_transfer(cover: Cover, wave_number: FloatArray, *, elements_per_layer: int = 16) -> SlabTransfer:
    """Solve the through-thickness problem of every wave number.

    Args:
        cover: Layers; linear elastic at zero load.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].
        elements_per_layer: Quadratic elements in each layer [-].
    """
    constant, linear, square, top, base = _matrices(cover, elements_per_layer)
    held = base if cover.base == "bonded" else base[1:]  # base lists U, W of the base node
    free = np.setdiff1d(np.arange(len(constant)), held)
    load = np.zeros((len(free), 1))
    load[np.searchsorted(free, top)] = -1.0
    compliance, reaction = np.empty_like(wave_number), np.empty_like(wave_number)
    for i, k in enumerate(wave_number):
        matrix = constant + k * linear + k**2 * square
        solution = np.linalg.solve(matrix[np.ix_(free, free)], load)[:, 0]
        compliance[i] = -solution[np.searchsorted(free, top)]
        reaction[i] = matrix[base[1], free] @ solution
    return SlabTransfer(compliance=compliance, base=reaction)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceCompliance:
    """How the top of a wide cover yields to a pressure elsewhere on the top.

    The displacement under a point load is that of a half space of the top layer's material (closed form, singular)
    plus a regular part that the layers below and the base add, tabulated from the elements.

    Attributes:
        half_space: (1 - nu) / (2 pi mu) of the top layer: displacement is this over the distance [m2/N].
        regular: What the finite thickness adds, as a function of distance [m/N].
        reach: Largest distance of the table [m].
        thickness: Thickness of the cover [m].
    """

    half_space: float
    regular: CubicSpline
    reach: float
    thickness: float

    def of_rectangle(self, x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
        """Displacement at (x, y) under unit pressure on a small rectangle around the origin [m/Pa].

        The half-space part is exact (Love 1929; Johnson 1985, eq. 3.25); the regular part is smooth on the scale of
        the thickness and is taken at the distance between the centres.
        """
        near = self.half_space * _love(x, y, width / 2, height / 2)
        return near + width * height * self.regular(np.minimum(np.hypot(x, y), self.reach))


def surface_compliance(cover: Cover, reach: float, *, elements_per_layer: int = 16) -> SurfaceCompliance:
    """Tabulate the compliance of a wide cover's top up to a distance `reach` [m]."""
    top = cover.layers[-1]
    k, weight = _nodes(cover, reach)
    solved = slab_transfer(cover, k, elements_per_layer=elements_per_layer).compliance
    excess = (solved - _half_space(top, k)) * k * weight / (2 * np.pi)
    step = min(layer.thickness for layer in cover.layers) / 10
    radius = np.linspace(0, reach, int(min(max(reach / step, 200), 2000)))
    table = np.concatenate([j0(np.outer(block, k)) @ excess for block in np.array_split(radius, 8)])
    return SurfaceCompliance(
        half_space=(1 - top.material.poisson_ratio) / (2 * np.pi * top.material.shear_modulus),
        regular=CubicSpline(radius, table, bc_type="clamped"),
        reach=reach,
        thickness=cover.thickness,
    )


def _half_space(layer: Layer, k: FloatArray) -> FloatArray:
    return (1 - layer.material.poisson_ratio) / (layer.material.shear_modulus * k)


def _nodes(cover: Cover, reach: float) -> tuple[FloatArray, FloatArray]:
    """Gauss nodes in k [1/m]: panels of half a period of J0(k reach), graded where layers differ in thickness."""
    top = _BLIND / cover.layers[-1].thickness
    widest = np.pi / reach * 4
    edges = [0.0]
    while edges[-1] < top:
        edges.append(edges[-1] + min(widest, max(0.25 / cover.thickness, 0.3 * edges[-1])))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    cut = np.array(edges)
    half = np.diff(cut)[:, None] / 2
    return (cut[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()


def _matrices(cover: Cover, count: int) -> tuple[FloatArray, FloatArray, FloatArray, int, npt.NDArray[np.int64]]:
    """Matrices of k^0, k^1, k^2, the index of W at the top, and the indices of U, W at the base.

    Energy density per wave: mu (2 exx^2 + 2 ezz^2 + gxz^2 - 2/3 div^2) / 2 - p div - p^2 / 2K with exx = k U,
    ezz = W', gxz = U' - k W, div = k U + W'.
    """
    nodes = len(cover.layers) * 2 * count + 1
    pressures = len(cover.layers) * (count + 1)
    size = 2 * nodes + pressures
    out = np.zeros((3, size, size))
    for index, layer in enumerate(cover.layers):
        local = _element(layer, layer.thickness / count)
        for e in range(count):
            node = 2 * (index * count + e) + np.arange(3)
            pressure = 2 * nodes + index * (count + 1) + e + np.arange(2)
            place = np.concatenate([2 * node, 2 * node + 1, pressure])
            out[:, place[:, None], place] += local
    return out[0], out[1], out[2], 2 * (nodes - 1) + 1, np.array([0, 1])


def _element(layer: Layer, length: float) -> FloatArray:
    """Element matrices of k^0, k^1, k^2 over (U x 3, W x 3, P x 2), shape (3, 8, 8)."""
    points, weights = np.polynomial.legendre.leggauss(4)
    t = (points + 1) / 2
    weight = weights / 2
    shape = edge_shape(t).T
    slope = np.stack([4 * t - 3, 4 - 8 * t, 4 * t - 1], axis=1)
    hat = np.stack([1 - t, t], axis=1)
    mu = layer.material.shear_modulus
    n, d = shape, slope / length
    zero, none = np.zeros_like(n), np.zeros_like(hat)
    # each strain as (part without k, part with k) over the eight unknowns
    exx = (np.hstack([zero, zero, none]), np.hstack([n, zero, none]))
    ezz = (np.hstack([zero, d, none]), np.hstack([zero, zero, none]))
    gxz = (np.hstack([d, zero, none]), np.hstack([zero, -n, none]))
    div = (exx[0] + ezz[0], exx[1] + ezz[1])
    p = (np.hstack([zero, zero, hat]), np.hstack([zero, zero, none]))
    terms = [(2 * mu, exx, exx), (2 * mu, ezz, ezz), (mu, gxz, gxz), (-2 * mu / 3, div, div)]
    terms += [(-1.0, p, div), (-1.0, div, p), (-bulk_compliance(layer.material), p, p)]
    out = np.zeros((3, 8, 8))
    for factor, left, right in terms:
        for i in range(2):
            for j in range(2):
                out[i + j] += factor * length * np.einsum("qa,qb,q->ab", left[i], right[j], weight)
    return out


def _love(x: FloatArray, y: FloatArray, a: float, b: float) -> FloatArray:
    """Integral of 1 / distance over the rectangle |x'| < a, |y'| < b, at (x, y) [m]."""

    def corner(u: FloatArray, v: FloatArray) -> FloatArray:
        """Antiderivative of 1 / sqrt(u^2 + v^2) in u and v."""
        tiny = 1e-300
        return u * np.arcsinh(v / (np.abs(u) + tiny)) + v * np.arcsinh(u / (np.abs(v) + tiny))

    return corner(x + a, y + b) - corner(x - a, y + b) - corner(x + a, y - b) + corner(x - a, y - b)
