"""Compute the displacements of the top of a wide cover between pairs of cells by direct integration, exactly.

The displacement vectors under a point force on a half space are those of Boussinesq and Cerruti (Johnson, Contact
Mechanics, 1985, sections 3.2 and 3.6).  Layers add a Hankel transform of their exact response to waves
(`tests.exact.tractions`), less that of the half space.  Waves across the direction of a shear only twist the layers, so
that their response has a closed form.  No code is shared with the finite elements.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from meshes import Cover
from meshes.array_types import FloatArray
from tests.exact.tractions import traction_compliance

#: Gauss points along each axis of a part of a cell, and in each panel of the integral over the wave number.
_POINTS, _PANEL = 24, 10
#: Largest wave number times the thickness of the top layer [-]; the layers below have no effect beyond.
_LARGEST = 15.0
#: Number of distances at which the Hankel transforms are tabulated.
_TABULATED = 250

#: Displacement of a point per force at the origin, components first, as a function of x and y [m/N].
Kernel = Callable[[FloatArray, FloatArray], FloatArray]


def twist_compliance(cover: Cover, k: FloatArray) -> FloatArray:
    """Compute the displacement along y of the top per shear cos(k x) along y, shape (m,) [m/Pa].

    The traction over the displacement at the top of a layer follows from that at its bottom.
    """
    stiffness = np.zeros_like(k) if cover.base == "sliding" else np.full_like(k, np.inf)
    for layer in cover.layers:
        own, slope = layer.material.shear_modulus * k, np.tanh(k * layer.thickness)
        held = np.isinf(stiffness)
        below = np.where(held, 1.0, stiffness)
        stiffness = own * np.where(held, 1 / slope, (below + own * slope) / (own + below * slope))
    return 1 / stiffness


def half_space_kernel(shear_modulus: float, ratio: float) -> Kernel:
    """Return the displacement vectors of a half space (downwards, along x, along y) under point forces."""

    def kernel(x: FloatArray, y: FloatArray) -> FloatArray:
        r = np.hypot(x, y)
        c, s, away = x / r, y / r, (1 - 2 * ratio) / 2
        rows = [
            [1 - ratio + 0 * r, away * c, away * s],
            [-away * c, 1 - ratio + ratio * c**2, ratio * c * s],
            [-away * s, ratio * c * s, 1 - ratio + ratio * s**2],
        ]
        return np.array(rows) / (2 * np.pi * shear_modulus * r)

    return kernel


def layers_kernel(cover: Cover, reach: float, least: float = 0.0) -> Kernel:
    """Return what layers on a rigid base add to the displacement vectors of a half space of the top's material.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        reach: Largest distance of interest [m].
        least: Smallest wave number, for covers that slide; longer waves move them as a whole [1/m].
    """
    top = cover.layers[-1]
    ratio, mu = top.material.poisson_ratio, top.material.shear_modulus
    end = _LARGEST / top.thickness
    width = min(2.0 / reach, 0.25 / top.thickness)
    start = least + np.geomspace(1e-4, 1.0, 12) * width
    edges = np.concatenate([[least], start, np.arange(start[-1] + width, end + width, width)])
    nodes, weights = np.polynomial.legendre.leggauss(_PANEL)
    half = np.diff(edges)[:, None] / 2
    k, weight = (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
    inside = traction_compliance(cover, k)
    normal = inside[:, 0, 0] - (1 - ratio) / (mu * k)
    away = inside[:, 1, 0] + (1 - 2 * ratio) / (2 * mu * k)
    along = inside[:, 1, 1] - (1 - ratio) / (mu * k)
    across = twist_compliance(cover, k) - 1 / (mu * k)
    density = k * weight / (2 * np.pi)
    radius = np.linspace(0.0, reach, _TABULATED)
    place = np.outer(radius, k)
    zero, one = j0(place), j1(place)
    two = np.divide(2 * one, place, out=np.ones_like(one), where=place > 0) - zero
    parts = ((zero, normal), (one, away), (zero, (along + across) / 2), (two, (across - along) / 2))
    tables = [CubicSpline(radius, wave @ (part * density)) for wave, part in parts]

    def kernel(x: FloatArray, y: FloatArray) -> FloatArray:
        r = np.hypot(x, y)
        c, s = x / r, y / r
        down, out, mean, turn = (each(r) for each in tables)
        rows = [
            [down, -out * c, -out * s],
            [out * c, mean + turn * (c**2 - s**2), 2 * turn * c * s],
            [out * s, 2 * turn * c * s, mean - turn * (c**2 - s**2)],
        ]
        return np.array(rows)

    return kernel


def average_pairs(
    kernel: Kernel, at: tuple[float, float], width: float, height: float, points: int = _POINTS
) -> FloatArray:
    """Average a kernel over the points of one cell, and integrate it over those of an equal cell around the origin.

    The difference of the positions in the two cells has a triangular distribution along each axis.  The integral is
    divided where that has a kink, and where the kernel is singular; there the distance is split off (Duffy).

    Args:
        kernel: Displacement per force.
        at: Middle of the displaced cell [m].
        width: Size of both cells along x [m].
        height: Size of both cells along y [m].
        points: Gauss points along each axis of each part.

    Returns:
        Displacement per traction on the cell, shape of the first axes of the kernel [m/Pa].
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    nodes, weights = (1 + nodes) / 2, weights / 2
    first, second = (a.ravel() for a in np.meshgrid(nodes, nodes, indexing="ij"))
    share = np.outer(weights, weights).ravel()
    (x, y), total = at, np.zeros(1)
    for low, high in _divide(x, width):
        for left, right in _divide(y, height):
            long, wide = high - low, right - left
            if 0 in (low, high) and 0 in (left, right):
                u0, u1, v0, v1 = (low, high, left, right)
                du, dv = (u1 if u0 == 0 else u0), (v1 if v0 == 0 else v0)
                u = np.concatenate([du * first, du * first * second])
                v = np.concatenate([dv * first * second, dv * first])
                part = np.tile(share * first, 2) * long * wide
            else:
                u, v, part = low + long * first, left + wide * second, share * long * wide
            dense = np.maximum(1 - np.abs(u - x) / width, 0) * np.maximum(1 - np.abs(v - y) / height, 0)
            total = total + kernel(u, v) @ (part * dense)
    return np.asarray(total)


def _divide(middle: float, size: float) -> list[tuple[float, float]]:
    """Divide the interval of all differences at its kink and at zero."""
    ends = {middle - size, middle, middle + size} | ({0.0} if abs(middle) < size else set())
    ordered = sorted(0.0 if abs(each) < 1e-9 * size else each for each in ends)
    return [(a, b) for a, b in itertools.pairwise(ordered) if b > a]
