"""Compute the exact response of bonded elastic layers on a rigid base to pressure, for waves, points and texels.

For a surface pressure cos(k x) each layer has Papkovich-Neuber potentials Phi and Psi proportional to exp(+-k z).
Boundary and interface conditions give one small linear system per wave number.  Every exponential is written so that it
decays from one face of the layer, to avoid overflow.  The response of an isotropic layer does not depend on the
horizontal direction.  The response to axisymmetric loads therefore follows by a Hankel transform, and the force on a
rectangular texel by a two-dimensional Fourier transform.

The displacement u follows from 2 mu u = 4 (1 - nu) Psi e_z - grad(Phi + z Psi), where Phi and Psi are harmonic (Barber,
Elasticity, chapter 15, with zero x and y components of the vector potential).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.fft import dctn
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.special import j0, spherical_jn

from meshes import Cover, Layer, Material
from meshes.array_types import FloatArray
from meshes.cover import Base


@dataclass(frozen=True, kw_only=True)
class LayerSettings:
    """Constants of the exact response of layers to waves, and of its integrals over the wave number."""

    #: Product of wave number k and cover thickness below which the response is interpolated [-].  The interpolation is
    #: a parabola in k that ends at the exact limit for k = 0, because the linear systems are ill-conditioned at small
    #: k.
    small: float = 2e-3
    #: Product of wave number and cover thickness at which the integrals end [-].  The base pressure is negligible
    #: beyond: exp(-60) = 1e-26.
    large: float = 60.0
    #: Smallest number of panels of a Hankel transform [-].
    panels: float = 64.0
    #: Gauss points in each panel of a Hankel transform [-].
    panel_points: int = 10
    #: Number of distances for which Bessel functions are computed at once, to limit the memory [-].
    block: int = 512


_SETTINGS = LayerSettings()


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """Response of a cover to the surface pressure cos(k x) at m wave numbers k.

    Attributes:
        compliance: Downward displacement of the top per pressure on the top, shape (m,) [m/Pa].
        base: Pressure on the base per pressure on the top, shape (m,) [-].
    """

    compliance: FloatArray
    base: FloatArray


def transfer(cover: Cover, wave_number: npt.ArrayLike) -> Transfer:
    """Compute the exact transfer functions of a laterally wide cover under frictionless normal pressure.

    Rounding grows toward small wave numbers.  The compliance of one incompressible layer is off by 5e-14 at k h = 0.1,
    by 4e-9 at 0.003 and by 7e-6 below 0.002, relative to itself, and by at most 4e-15 of that of a half space.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        wave_number: Wave numbers k >= 0, shape (m,) [1/m].

    Raises:
        ValueError: If a wave number is negative.
    """
    k = np.atleast_1d(np.asarray(wave_number, dtype=float))
    if (k < 0).any():
        raise ValueError("wave numbers must not be negative")
    small = k * cover.thickness < _SETTINGS.small
    solved = _solve(cover, np.where(small, _SETTINGS.small / cover.thickness, k))
    limit_compliance, limit_base = _compute_uniform_limit(cover)
    # Small k: interpolate linearly in k^2 from the limit k = 0, because the response is an even function of k.
    fraction = np.where(small, (k * cover.thickness / _SETTINGS.small) ** 2, 1.0)
    return Transfer(
        compliance=limit_compliance + fraction * (solved.compliance - limit_compliance),
        base=limit_base + fraction * (solved.base - limit_base),
    )


def half_space_compliance(layer: Layer, wave_number: FloatArray) -> FloatArray:
    """Compute the compliance of a half space under pressure cos(k x), (1 - nu) / (mu k) (Johnson 1985, eq. 2.61).

    The compliance of a cover tends to that of a half space of its top layer's material as k increases.

    Args:
        layer: Layer whose material fills the half space; its thickness is not used.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].

    Returns:
        Downward displacement of the surface per pressure, shape (m,) [m/Pa].
    """
    material = layer.material
    return (1 - material.poisson_ratio) / (material.shear_modulus * wave_number)


def point_response(cover: Cover, radius: npt.ArrayLike) -> FloatArray:
    """Compute the pressure on the base per unit point load on the top of a wide cover.

    (1 / 2 pi) int base(k) J0(k r) k dk is integrated by Gauss-Legendre panels shorter than half a period of J0(k r).

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Horizontal distances r from the load, any shape [m].

    Returns:
        Pressure per force at each distance, shape of `radius` [1/m2].
    """
    r = np.asarray(radius, dtype=float)
    k, weight = hankel_nodes(cover, float(r.max(initial=0.0)))
    density = transfer(cover, k).base * k * weight / (2 * np.pi)
    flat = r.ravel()
    out = np.empty_like(flat)
    for start in range(0, flat.size, _SETTINGS.block):
        block = flat[start : start + _SETTINGS.block]
        out[start : start + _SETTINGS.block] = j0(block[:, None] * k) @ density
    return out.reshape(r.shape)


def hankel_nodes(cover: Cover, reach: float) -> tuple[FloatArray, FloatArray]:
    """Compute nodes and weights of a Hankel transform in the wave number k, fine enough for J0(k r) up to r = `reach`.

    Args:
        cover: Cover; its thickness determines the largest wave number.
        reach: Largest distance r from the load [m].

    Returns:
        Gauss-Legendre nodes and weights, shape (m,) each [1/m].
    """
    top = _SETTINGS.large / cover.thickness
    panels = int(np.ceil(max(_SETTINGS.panels, top * reach / np.pi)))
    return place_gauss_points(np.linspace(0, top, panels + 1), _SETTINGS.panel_points)


def place_gauss_points(edges: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Place Gauss-Legendre points in panels that follow one another.

    Args:
        edges: Edges of the panels, ascending, shape (panels + 1,).
        count: Number of points in each panel [-].

    Returns:
        Points and weights of the integral over all panels, shape (panels * count,) each.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()


def _compute_uniform_limit(cover: Cover) -> tuple[float, float]:
    """Compute the compliance of the top [m/Pa] and the base pressure [-] under an even pressure, the wave number k = 0.

    On a bonded base the layers have no lateral strain.  On a sliding base they extend together along the wave, so that
    the lateral forces of all layers, sum of h (2 mu strain - nu pressure) / (1 - nu), vanish.
    """
    confined = ratio = stiffness = 0.0
    for layer in cover.layers:
        h, nu, mu = layer.thickness, layer.material.poisson_ratio, layer.material.shear_modulus
        confined += h * (1 - 2 * nu) / (2 * mu * (1 - nu))
        ratio += h * nu / (1 - nu)
        stiffness += 2 * mu * h / (1 - nu)
    return confined + (ratio**2 / stiffness if cover.base == "sliding" else 0.0), 1.0


def _evaluate_face(layer: Layer, k: FloatArray, z: float, scale: float) -> FloatArray:
    """Evaluate displacements and stresses that belong to the four unknown coefficients of a layer's potentials.

    Args:
        layer: The layer.
        k: Wave numbers, shape (m,) [1/m].
        z: Height above the bottom of the layer [m].
        scale: Stress by which all stresses are divided [Pa].

    Returns:
        Matrix for each wave number: rows are horizontal and vertical displacement, normal stress / k and shear
        stress / k, columns are the unknowns, shape (m, 4, 4).
    """
    nu, h = layer.material.poisson_ratio, layer.thickness
    compliance = scale / (2 * layer.material.shear_modulus)
    rows = np.empty((k.size, 4, 4))
    # Columns 0 and 1 belong to potentials that decay from the bottom of the layer, columns 2 and 3 to those that decay
    # from its top.
    for column, sign, s in ((0, -1.0, z), (2, 1.0, z - h)):
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
    """Compute the response of a cover to the surface pressure cos(k x) for m wave numbers k > 0, shape (m,) [1/m]."""
    displacement, base = solve_tractions(cover, k)
    return Transfer(compliance=displacement[:, 0, 0], base=base[:, 0])


def solve_tractions(cover: Cover, k: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Assemble and solve, for every wave number, the linear system of 4 unknown coefficients per layer.

    The loads are the surface pressure cos(k x) and the shear traction sin(k x) along +x on the top.

    Returns:
        Displacements of the top, downwards times cos(k x) and along +x times sin(k x) (rows), per load (columns), shape
        (m, 2, 2) [m/Pa], and base pressure per load, shape (m, 2) [-].
    """
    layers = cover.layers
    scale = 2 * layers[-1].material.shear_modulus
    n = len(layers)
    matrix = np.zeros((k.size, 4 * n, 4 * n))
    right = np.zeros((k.size, 4 * n, 2))
    bottom = _evaluate_face(layers[0], k, 0.0, scale)
    matrix[:, 0, :4] = bottom[:, 1]
    matrix[:, 1, :4] = bottom[:, 0] if cover.base == "bonded" else bottom[:, 3]
    for i in range(n - 1):
        rows = slice(2 + 4 * i, 6 + 4 * i)
        matrix[:, rows, 4 * i : 4 * i + 4] = _evaluate_face(layers[i], k, layers[i].thickness, scale)
        matrix[:, rows, 4 * i + 4 : 4 * i + 8] = -_evaluate_face(layers[i + 1], k, 0.0, scale)
    top = _evaluate_face(layers[-1], k, layers[-1].thickness, scale)
    matrix[:, -2:, -4:] = top[:, 2:]
    right[:, -2, 0], right[:, -1, 1] = -1.0, 1.0
    unknown = np.linalg.solve(matrix, right)
    horizontal, vertical = (np.einsum("mi,mij->mj", top[:, row], unknown[:, -4:]) for row in (0, 1))
    displacement = np.stack([-vertical, horizontal], axis=1) / (k * scale)[:, None, None]
    return displacement, -np.einsum("mi,mij->mj", bottom[:, 2], unknown[:, :4])


@dataclass(frozen=True, kw_only=True)
class InfluenceSettings:
    """Constants of the table of the force on a texel over the position of a point load."""

    #: Points per cover thickness of the table of the force on a texel over the position of a point load [-].
    resolution: int = 12
    #: Largest number of points along a side of the table of the force on a texel, to limit the memory [-].
    most_points: int = 3072
    #: Base pressure over its largest value below which the response to a point load is neglected [-].
    negligible: float = 1e-7


_INFLUENCE = InfluenceSettings()
#: Distances from a point load, over the cover thickness, at which the search for a negligible base pressure looks [-].
_DISTANCES = np.linspace(6.0, 60.0, 109)


#: Nodes of the base pressure over the product of wave number and thickness [-].
_WAVES = np.linspace(0.0, _SETTINGS.large, 6000)


@lru_cache(maxsize=256)
def _solve_stack(layers: tuple[tuple[float, float, float], ...], base: Base) -> tuple[float, FloatArray]:
    """Compute what covers with layers of equal proportions have in common.

    Args:
        layers: Thickness over that of the cover, shear modulus over that of the top and Poisson ratio of each layer.
        base: Support of the bottom layer.

    Returns:
        Distance from a point load beyond which the pressure on the base is negligible, over the thickness [-], and
        pressure on the base per pressure on the top at `_WAVES`, shape (n,) [-].
    """
    made = [
        Layer(
            thickness=part,
            material=Material(
                name="", model="linear-elastic", parameters={"youngs_modulus": 2 * mu * (1 + nu)}, poisson_ratio=nu
            ),
        )
        for part, mu, nu in layers
    ]
    cover = Cover(layers=tuple(made), base=base)
    pressure = np.abs(point_response(cover, _DISTANCES))
    left = np.flatnonzero(pressure > _INFLUENCE.negligible * abs(float(point_response(cover, 0.0))))
    reach = float(_DISTANCES[min(left[-1] + 1, len(_DISTANCES) - 1)]) if len(left) else 6.0
    return reach, transfer(cover, _WAVES).base


def _scale_stack(cover: Cover) -> tuple[float, FloatArray]:
    """Return `_solve_stack` of a cover; covers that differ in scale and rounding alone have it in common."""
    top = cover.layers[-1].material.shear_modulus
    parts = ((each.thickness / cover.thickness, each.material.shear_modulus / top) for each in cover.layers)
    ratios = (each.material.poisson_ratio for each in cover.layers)
    return _solve_stack(
        tuple((round(h, 12), float(f"{mu:.12g}"), nu) for (h, mu), nu in zip(parts, ratios, strict=True)), cover.base
    )


#: Points of a grid over the scattered points that a spline evaluates in the same time [-].
_GRID = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class TexelResponse:
    """Share of a unit load on the top of a wide cover, at a point or round, that a rectangular texel receives.

    Attributes:
        half: Largest distance of the load from the texel's centre in the table, along x and y [m].
        table: Share over the distance of the load along x and y [-].
    """

    half: tuple[float, float]
    table: RectBivariateSpline

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Interpolate the share of a unit point load that the texel receives.

        Args:
            x: Distances of the load from the centre of the texel along x, any shape [m].
            y: Distances along y, same shape [m].

        Returns:
            Shares, same shape [-].
        """
        x, y = np.abs(x), np.abs(y)
        near = (x <= self.half[0]) & (y <= self.half[1])
        out = np.zeros(near.shape)
        out[near] = self.table.ev(x[near], y[near])
        return out

    def between(self, points: FloatArray, centres: FloatArray) -> FloatArray:
        """Interpolate the share of unit point loads that texels receive; fast where they lie on grids.

        Args:
            points: Positions of k loads, shape (k, 2) [m].
            centres: Centres of n texels, shape (n, 2) [m].

        Returns:
            Shares, shape (k, n) [-].
        """
        lines, places = [], []
        for axis in range(2):
            (at, point), (middle, texel) = (np.unique(e[:, axis], return_inverse=True) for e in (points, centres))
            apart = np.abs(at[:, None] - middle).ravel()
            order = np.argsort(apart)
            rank = np.empty_like(order)
            rank[order] = np.arange(len(order))
            lines.append(apart[order])
            places.append(rank.reshape(len(at), len(middle))[point[:, None], texel])
        if len(lines[0]) * len(lines[1]) > _GRID * len(points) * len(centres):
            apart = points[:, None] - centres
            return self(apart[..., 0], apart[..., 1])
        near = [line[line <= half] for line, half in zip(lines, self.half, strict=True)]
        found = np.zeros((len(lines[0]), len(lines[1])))
        found[: len(near[0]), : len(near[1])] = self.table(near[0], near[1])
        return np.asarray(found[places[0], places[1]])


def tabulate_texel_response(cover: Cover, size: tuple[float, float], radius: float = 0.0) -> TexelResponse:
    """Tabulate the share of a unit load that a texel receives, over the position of the load, within 1e-8.

    The pressure on the base times the texel's indicator function is one inverse Fourier transform of base(k)
    sinc(kx a) sinc(ky b) 4 a b, with half edge lengths a and b.  The load is a point force or the pressure of Hertz on
    a circle, whose transform is 3 j1(k radius) / (k radius).

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        size: Edge lengths of the texel along x and y [m].
        radius: Radius of the loaded circle, 0 for a point [m].
    """
    far, waves = _scale_stack(cover)
    half = tuple(edge / 2 + far * cover.thickness + radius for edge in size)
    count = [
        min(_INFLUENCE.most_points // 2, int(np.ceil(each * _INFLUENCE.resolution / cover.thickness))) for each in half
    ]
    spacing = [each / n for each, n in zip(half, count, strict=True)]
    kx, ky = (np.pi / each * np.arange(n + 1) for each, n in zip(half, count, strict=True))
    base = CubicSpline(_WAVES, waves * hertz_transform(_WAVES * radius / cover.thickness))
    spectrum = base(np.minimum(cover.thickness * np.hypot(kx[:, None], ky), _WAVES[-1])) * np.outer(
        np.sinc(kx * size[0] / (2 * np.pi)), np.sinc(ky * size[1] / (2 * np.pi))
    )
    # The share is even along x and y, so that cosine transforms of a quarter of the plane suffice.
    share = dctn(spectrum, type=1) * (size[0] * size[1] / (4 * half[0] * half[1]))
    # Keep some points beyond each axis of symmetry, so that the spline has no end on the axis.
    axes = [d * np.arange(-4, n + 1) for n, d in zip(count, spacing, strict=True)]
    index = [np.abs(np.arange(-4, n + 1)) for n in count]
    table = RectBivariateSpline(axes[0], axes[1], share[np.ix_(*index)], kx=5, ky=5)
    return TexelResponse(half=(float(axes[0][-1]), float(axes[1][-1])), table=table)


def hertz_transform(product: FloatArray) -> FloatArray:
    """Return the transform of the pressure of Hertz over its force, at wave number times radius, shape (m,) [-]."""
    return np.where(product > 0, 3 * spherical_jn(1, product) / np.where(product > 0, product, 1.0), 1.0)
