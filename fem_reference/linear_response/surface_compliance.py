"""Compute the compliance of the top of a laterally wide cover by finite elements in z and Fourier functions in x and y.

A surface pressure cos(k x) displaces an isotropic layered cover by (U(z) sin k x, W(z) cos k x) with mean pressure
P(z) cos k x.  For each wave number k, one small one-dimensional mixed problem is solved (quadratic U and W, linear P
that may jump where materials meet).  The surface displacement under any pressure distribution follows by
superposition.  Contacts of indenters at small strain are solved in this way.  The method is the semi-analytical
finite-element method, a discretisation that is independent of the axisymmetric elements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

from fem_reference.elements.grading import layer_heights
from fem_reference.elements.line import Line, gauss_points, line_matrix
from meshes import Cover
from meshes.array_types import FloatArray

#: Product x of wave number and thickness of the top layer above which the layers below have no effect, because
#: exp(-2 x) is below 1e-11 [-].
_SHORT_WAVES = 13.0
#: Number of quadratic elements through each layer [-].
_ELEMENTS = 16
#: Panels of the integral over the wave number k: largest length in half periods of J0(k reach), length at k = 0 times
#: the cover thickness, and length over k at larger k [-].
_PANEL_PERIODS, _FIRST_PANEL, _PANEL_RATIO = 4.0, 0.25, 0.3
#: Number of Gauss points in each panel [-].
_PANEL_POINTS = 8
#: Number of points of the compliance table per thickness of the thinnest layer, and smallest and largest number of
#: points [-].
_TABLE_POINTS, _LEAST_POINTS, _MOST_POINTS = 10, 200, 2000
#: Number of parts in which the compliance table is computed, to limit the memory of the Bessel functions [-].
_BLOCKS = 8
#: Number added to distances to avoid division by zero at the corners of a rectangle [m].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class WaveResponse:
    """Response of a cover to the surface pressure cos(k x) at m wave numbers k.

    Attributes:
        compliance: Downward displacement of the top per pressure on the top, shape (m,) [m/Pa].
        base: Pressure on the base, from the reaction, per pressure on the top, shape (m,) [-].
    """

    compliance: FloatArray
    base: FloatArray


def decay_length(cover: Cover) -> float:
    """Estimate the distance over which the response to a point load decays: thickness or bending length of layers [m].

    For each interface, the layers above are modelled as a plate of bending stiffness D = sum E t^3 / 12 (1 - nu^2) and
    the layers below as an elastic foundation of stiffness k with 1 / k = sum t / E (modulus E, thickness t).  The
    bending length is (D / k)^(1/4) (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, section 57).
    """
    lengths = [cover.thickness]
    for split in range(1, len(cover.layers)):
        below, above = cover.layers[:split], cover.layers[split:]
        springs = 1 / sum(layer.thickness / layer.material.youngs_modulus for layer in below)
        plate = sum(
            layer.material.youngs_modulus * layer.thickness**3 / (12 * (1 - layer.material.poisson_ratio**2))
            for layer in above
        )
        lengths.append((plate / springs) ** 0.25)
    return max(lengths)


def solve_waves(cover: Cover, wave_number: FloatArray, *, elements_per_layer: int = _ELEMENTS) -> WaveResponse:
    """Solve the one-dimensional problem through the thickness of a cover for every wave number.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].
        elements_per_layer: Number of quadratic elements through each layer [-].
    """
    constant, linear, square = _assemble(cover, elements_per_layer)
    nodes = 2 * elements_per_layer * len(cover.layers) + 1
    base, top = np.array([0, nodes]), 2 * nodes - 1  # U and W at the base, W at the top
    constrained = base if cover.base == "bonded" else base[1:]
    free = np.setdiff1d(np.arange(len(constant)), constrained)
    load = np.zeros((len(free), 1))
    load[np.searchsorted(free, top)] = -1.0
    compliance, reaction = np.empty_like(wave_number), np.empty_like(wave_number)
    for i, k in enumerate(wave_number):
        matrix = constant + k * linear + k**2 * square
        solution = np.linalg.solve(matrix[np.ix_(free, free)], load)[:, 0]
        compliance[i] = -solution[np.searchsorted(free, top)]
        reaction[i] = matrix[base[1], free] @ solution
    return WaveResponse(compliance=compliance, base=reaction)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceCompliance:
    """Displacement of the top of a wide cover due to a normal load on the top, over the distance from the load.

    The displacement is that of a half space of the top layer's material (closed form, singular) plus a regular part due
    to the finite thickness and the other layers, tabulated from a finite-element solution.

    Attributes:
        half_space: (1 - nu) / (2 pi mu) of the top layer; displacement of the half space per force, times the distance
            from a point load [m2/N].
        regular: Regular part of the displacement per force as a function of the distance [m/N].
        reach: Largest distance of the table [m].
        thickness: Thickness of the cover [m].
    """

    half_space: float
    regular: CubicSpline
    reach: float
    thickness: float

    def of_rectangle(self, x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
        """Compute the downward displacement at (x, y) per pressure on a small rectangle around the origin [m/Pa].

        The half-space part is exact (Love 1929; Johnson, Contact Mechanics, 1985, eq. 3.25).  The regular part varies
        over distances of the order of the cover thickness; its value at the distance from the centre is used.

        Args:
            x: x coordinates of the points, any shape [m].
            y: y coordinates of the points, same shape [m].
            width: Size of the rectangle along x [m].
            height: Size of the rectangle along y [m].
        """
        near = self.half_space * _integrate_distance(x, y, width / 2, height / 2)
        return near + width * height * self.regular(np.minimum(np.hypot(x, y), self.reach))


def surface_compliance(cover: Cover, reach: float, *, elements_per_layer: int = _ELEMENTS) -> SurfaceCompliance:
    """Tabulate the compliance of the top of a wide cover over the distance from a point load.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        reach: Largest distance of the table [m].
        elements_per_layer: Number of quadratic elements through each layer [-].
    """
    top = cover.layers[-1]
    k, weight = _wave_numbers(cover, reach)
    solved = solve_waves(cover, k, elements_per_layer=elements_per_layer).compliance
    half_space = (1 - top.material.poisson_ratio) / (top.material.shear_modulus * k)  # Johnson 1985, eq. 2.61
    excess = (solved - half_space) * k * weight / (2 * np.pi)
    step = min(layer.thickness for layer in cover.layers) / _TABLE_POINTS
    radius = np.linspace(0, reach, int(min(max(reach / step, _LEAST_POINTS), _MOST_POINTS)))
    table = np.concatenate([j0(np.outer(block, k)) @ excess for block in np.array_split(radius, _BLOCKS)])
    return SurfaceCompliance(
        half_space=(1 - top.material.poisson_ratio) / (2 * np.pi * top.material.shear_modulus),
        regular=CubicSpline(radius, table, bc_type="clamped"),
        reach=reach,
        thickness=cover.thickness,
    )


def _wave_numbers(cover: Cover, reach: float) -> tuple[FloatArray, FloatArray]:
    """Compute Gauss points and weights in the wave number k, fine enough for J0(k r) up to r = `reach` [1/m]."""
    end = _SHORT_WAVES / cover.layers[-1].thickness
    longest = np.pi / reach * _PANEL_PERIODS
    edges = [0.0]
    while edges[-1] < end:
        edges.append(edges[-1] + min(longest, max(_FIRST_PANEL / cover.thickness, _PANEL_RATIO * edges[-1])))
    return gauss_points(np.array(edges), _PANEL_POINTS)


def _assemble(cover: Cover, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Assemble the matrices of k^0, k^1 and k^2 of the problem through the thickness of a cover.

    The energy density per wave is mu (2 exx^2 + 2 ezz^2 + gxz^2 - 2/3 div^2) / 2 - p div - p^2 / 2K with exx = k U,
    ezz = W', gxz = U' - k W, div = k U + W'.

    Returns:
        Matrices over the nodal values of U, then W, then P, with n values in all, shape (n, n) each.
    """
    layers = cover.layers
    edges, layer = layer_heights([each.thickness for each in layers], [count] * len(layers))
    u = Line(edges=edges, order=2)
    p = Line(edges=edges, order=1, jumps=tuple(range(count, len(layer), count)))
    mu = np.array([each.material.shear_modulus for each in layers])[layer]
    bulk_compliance = np.array([1 / each.material.bulk_modulus for each in layers])[layer]
    mass, stiffness, mixed = (line_matrix(u, u, each, mu).toarray() for each in ((0, 0), (1, 1), (1, 0)))
    value, slope = (line_matrix(u, p, each).toarray() for each in ((0, 0), (1, 0)))
    volume = line_matrix(p, p, weight=bulk_compliance).toarray()
    shear = mixed + 2 / 3 * mixed.T
    zero, empty = np.zeros_like(mass), np.zeros_like(value)
    constant = [[stiffness, zero, empty], [zero, 4 / 3 * stiffness, -slope], [empty.T, -slope.T, -volume]]
    linear = [[zero, -shear, -value], [-shear.T, zero, empty], [-value.T, empty.T, 0 * volume]]
    square = [[4 / 3 * mass, zero, empty], [zero, mass, empty], [empty.T, empty.T, 0 * volume]]
    return np.block(constant), np.block(linear), np.block(square)


def _integrate_distance(x: FloatArray, y: FloatArray, a: float, b: float) -> FloatArray:
    """Integrate 1 / distance from (x, y) over the rectangle with half sides a and b around the origin [m]."""

    def antiderivative(u: FloatArray, v: FloatArray) -> FloatArray:
        """Evaluate the antiderivative of 1 / sqrt(u^2 + v^2) with respect to u and v [m]."""
        return u * np.arcsinh(v / (np.abs(u) + _TINY)) + v * np.arcsinh(u / (np.abs(v) + _TINY))

    return (
        antiderivative(x + a, y + b)
        - antiderivative(x - a, y + b)
        - antiderivative(x + a, y - b)
        + antiderivative(x - a, y - b)
    )
