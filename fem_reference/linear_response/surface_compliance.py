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

from fem_reference.elements.grading import layer_heights
from fem_reference.elements.line import Line, gauss_points, line_matrix
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
    constant, linear, square = _matrices(cover, elements_per_layer)
    nodes = 2 * elements_per_layer * len(cover.layers) + 1
    base, top = np.array([0, nodes]), 2 * nodes - 1  # U and W at the base, W at the top
    held = base if cover.base == "bonded" else base[1:]
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
    return gauss_points(np.array(edges), 8)


def _matrices(cover: Cover, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Matrices of k^0, k^1, k^2 over the nodal values of U, then W, then P, shape (n, n) each.

    Energy density per wave: mu (2 exx^2 + 2 ezz^2 + gxz^2 - 2/3 div^2) / 2 - p div - p^2 / 2K with exx = k U,
    ezz = W', gxz = U' - k W, div = k U + W'.
    """
    layers = cover.layers
    edges, layer = layer_heights([each.thickness for each in layers], [count] * len(layers))
    u = Line(edges=edges, order=2)
    p = Line(edges=edges, order=1, jumps=tuple(range(count, len(layer), count)))
    mu = np.array([each.material.shear_modulus for each in layers])[layer]
    compliance = np.array([1 / each.material.bulk_modulus for each in layers])[layer]
    mass, stiffness, mixed = (line_matrix(u, u, each, mu).toarray() for each in ((0, 0), (1, 1), (1, 0)))
    value, slope = (line_matrix(u, p, each).toarray() for each in ((0, 0), (1, 0)))
    none, empty = np.zeros_like(mass), np.zeros_like(value)
    squeeze = line_matrix(p, p, weight=compliance).toarray()
    shear = mixed + 2 / 3 * mixed.T
    constant = [[stiffness, none, empty], [none, 4 / 3 * stiffness, -slope], [empty.T, -slope.T, -squeeze]]
    linear = [[none, -shear, -value], [-shear.T, none, empty], [-value.T, empty.T, 0 * squeeze]]
    square = [[4 / 3 * mass, none, empty], [none, mass, empty], [empty.T, empty.T, 0 * squeeze]]
    return np.block(constant), np.block(linear), np.block(square)


def _love(x: FloatArray, y: FloatArray, a: float, b: float) -> FloatArray:
    """Integral of 1 / distance over the rectangle |x'| < a, |y'| < b, at (x, y) [m]."""

    def corner(u: FloatArray, v: FloatArray) -> FloatArray:
        """Antiderivative of 1 / sqrt(u^2 + v^2) in u and v."""
        tiny = 1e-300
        return u * np.arcsinh(v / (np.abs(u) + tiny)) + v * np.arcsinh(u / (np.abs(v) + tiny))

    return corner(x + a, y + b) - corner(x - a, y + b) - corner(x + a, y - b) + corner(x - a, y - b)
