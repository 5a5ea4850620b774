"""Press a ball into an elastic layer bonded to a rigid cylinder, exactly: pressures on rectangles by waves.

The pressure is constant on each of many rectangles of angle and height.  Their compliance is that of a half space less
that of a half space at a distance, whose transfer is (1 - nu) / (G q) (1 - exp(-q d)) at the wave number q, plus waves
of the difference from the layer's exact transfer (`cylinder_waves`), which decays like 1 / (q^2 R).  Rectangles in
contact have no gap along the normals of the undeformed layer.  The contact is symmetric about two planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.closed_form.cylinder import CylinderLayer
from meshes.array_types import FloatArray
from tests.exact.active_set import solve_active_set
from tests.exact.cylinder_waves import transfer_cylinder_waves
from tests.exact.sphere_contact import find_end

#: Half widths of the region of rectangles, over those of the region in which undeformed surfaces overlap [-].
_MARGIN = 1.03
#: Largest wave number, times the smaller half width of the region, and at least times the thickness [-].
_FINEST, _LEAST = 24.0, 24.0
#: Period along the axis, over the thickness [-].
_PERIOD = 24.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CylinderContact:
    """Contact of a ball with a layer on a cylinder.

    Attributes:
        force: Force toward the axis [N].
        area: Area of the ellipse on whose half axes the pressure vanishes [m2].
        angles: Angles of the middles of k rectangles in contact, from the middle of the contact, shape (k,) [rad].
        heights: Their coordinates along the axis, shape (k,) [m].
        forces: Forces on them along the normals, shape (k,) [N].
    """

    force: float
    area: float
    angles: FloatArray
    heights: FloatArray
    forces: FloatArray


def press_ball(layer: CylinderLayer, radius: float, depth: float, *, cells: int = 32) -> CylinderContact:
    """Press a rigid ball into a layer on a cylinder along a line through the axis, without friction.

    Args:
        layer: The layer.
        radius: Radius of the ball [m].
        depth: Approach from first touch [m].
        cells: Number of rectangles along each axis in a quarter of the region.
    """
    outer, nu = layer.outer_radius, layer.material.poisson_ratio
    half = _MARGIN * np.sqrt(2 * depth * np.array([radius * outer / (radius + outer), radius]))
    size = half / cells
    x, y = ((np.arange(cells) + 0.5) * each for each in size)
    angle, height = (each.ravel() for each in np.meshgrid(x / outer, y, indexing="ij"))
    # Along the normal through a point of the top the ball begins at this distance from the axis.
    centre = outer + radius - depth
    inside = radius**2 - (centre * np.sin(angle)) ** 2 - height**2
    start = np.where(inside > 0, centre * np.cos(angle) - np.sqrt(np.maximum(inside, 0.0)), np.inf)
    half_space = (1 - nu) / (2 * np.pi * layer.material.shear_modulus)
    matrix = half_space * (_near(x, y, size, 0.0) - _near(x, y, size, layer.thickness))
    matrix = matrix + _far(layer, x, y, size, 2 * np.pi * half_space)
    pressure = solve_active_set(matrix, outer - start)
    force = pressure * size[0] * size[1]
    touching = pressure > 0
    signs = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    return CylinderContact(
        force=4 * float(force @ np.cos(angle)),
        area=float(np.pi * find_end(x, pressure[::cells]) * find_end(y, pressure[:cells])),
        angles=np.concatenate([s * angle[touching] for s, _ in signs]),
        heights=np.concatenate([s * height[touching] for _, s in signs]),
        forces=np.tile(force[touching], 4),
    )


def _near(x: FloatArray, y: FloatArray, size: FloatArray, below: float) -> FloatArray:
    """Integrate 1 / distance over rectangles and their images at points `below` [m] them, shape (n, n) [m]."""

    def primitive(a: FloatArray, b: FloatArray) -> FloatArray:
        r = np.sqrt(a**2 + b**2 + below**2)
        out = a * np.arcsinh(b / np.hypot(a, below)) + b * np.arcsinh(a / np.hypot(b, below))
        return np.asarray(out - (below * np.arctan(a * b / (below * r)) if below else 0.0))

    total = 0.0
    for s in (1, -1):
        for t in (1, -1):
            across, along = np.subtract.outer(x, s * x), np.subtract.outer(y, t * y)
            for i in (1, -1):
                for j in (1, -1):
                    a, b = across + i * size[0] / 2, along + j * size[1] / 2
                    total = total + i * j * primitive(a[:, None, :, None], b[None, :, None, :])
    return np.asarray(total).reshape(len(x) * len(y), -1)


def _far(layer: CylinderLayer, x: FloatArray, y: FloatArray, size: FloatArray, half_space: float) -> FloatArray:
    """Sum the waves of the rest of the compliance of rectangles and their images, shape (n, n) [m/Pa]."""
    outer, nearest = layer.outer_radius, float(min(len(x) * size[0], len(y) * size[1]))
    finest = max(_FINEST / nearest, _LEAST / layer.thickness)
    period = _PERIOD * layer.thickness
    m, k = (
        np.arange(int(finest * outer) + 1.0),
        2 * np.pi / period * (np.arange(int(finest * period / 2 / np.pi)) + 0.5),
    )
    around, along = (np.cos(np.outer(n, p)) * np.sinc(n * w / 2 / np.pi)[:, None] for n, p, w in (
        (m / outer, x, size[0]), (k, y, size[1]))
    )  # fmt: skip
    at = np.cos(np.outer(m / outer, x)), np.cos(np.outer(k, y))
    count = len(x) * len(y)
    out = np.zeros((len(x), len(x), len(y), len(y)))
    for piece in np.array_split(np.arange(len(k)), max(len(k) * len(m) // 50_000, 1)):
        exact = transfer_cylinder_waves(
            len(m), k[piece], layer.core_radius, outer, layer.material
        ).compliance[..., 0, 0]  # fmt: skip
        q = np.hypot(m[:, None] / outer, k[piece])
        rest = exact - half_space / q * (1 - np.exp(-q * layer.thickness))
        # Shares of the waves cos(m theta) cos(k z) in a load on a rectangle and its three images.
        rest *= np.where(m > 0, 2.0, 1.0)[:, None] / (2 * np.pi * outer) * 2 / period * 4 * size[0] * size[1]
        part = np.einsum("mk,kj,kl->mjl", rest, at[1][piece], along[piece], optimize=True)
        out += np.einsum("ma,mb,mjl->abjl", at[0], around, part, optimize=True)
    return np.asarray(out.transpose(0, 2, 1, 3).reshape(count, count))
