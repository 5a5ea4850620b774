"""Models that spread a fine map of the contact by a function of the distance.

The map is that of an elastic foundation under the rigid indenter: `pressure` is uniform over the area of contact,
`depth` is proportional to the penetration; each carries the load.  Equations and sources: docs/comparison-models.md.
"""

from __future__ import annotations

import numpy as np

from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.published.scene import Forces, Scene, find_foundation_approach


def predict_gaussian_of_pressure(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: a Gaussian point spread function of the contact pressure, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        sigma: Standard deviation [m].
    """
    return _sample_gaussian(scene, *_press_uniformly(scene, stiffness), sigma)


def predict_gaussian_of_depth(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: a Gaussian point spread function of the contact depth, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation [Pa/m].
        sigma: Standard deviation [m].
    """
    depth = _penetrate(scene, stiffness)
    return _sample_gaussian(scene, scene.map.points, depth * scene.load / depth.sum(), sigma)


def predict_low_pass(scene: Scene, *, stiffness: float, depth: float) -> Forces:
    """Shimojo 1994: the cover as a spatial low-pass of the contact pressure, here (1 + k h) exp(-k h).

    This is the transfer function of a half space from its surface to the depth h (Boussinesq), integrated over each
    texel.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        depth: h [m].
    """
    points, forces = _press_uniformly(scene, stiffness)
    texels = half_space_shares(scene.array, points, depth) @ forces
    return Forces(texels, scene.load - float(texels.sum()))


def predict_exact_layer(scene: Scene, *, stiffness: float) -> Forces:
    """Our own exact transfer function of the bonded layer, on the same contact pressure as `predict_low_pass`.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
    """
    touching = _penetrate(scene, stiffness) > 0
    texels = scene.layer_shares[:, touching] @ np.full(touching.sum(), scene.load / max(touching.sum(), 1))
    return Forces(texels, scene.load - float(texels.sum()))


def half_space_shares(array: TexelArray, points: FloatArray, depth: float) -> FloatArray:
    """Integrate the pressure of unit point loads on a half space, at a depth, over each texel.

    The integral of Boussinesq's 3 h^3 / (2 pi (r^2 + h^2)^(5/2)) over a rectangle is a sum over its corners (Newmark
    1935).

    Args:
        array: The n texels.
        points: Positions of the loads, shape (m, 2) [m].
        depth: h [m].

    Returns:
        Shares, shape (n, m) [-].
    """
    total = np.zeros((array.count, len(points)))
    for sign_x in (-1, 1):
        for sign_y in (-1, 1):
            corner = array.centres[:, :2] + np.array([sign_x, sign_y]) * array.texel_size / 2
            a, b = np.moveaxis(corner[:, None] - points, -1, 0)
            total += sign_x * sign_y * _integrate_to_corner(a, b, depth)
    return total


def _integrate_to_corner(a: FloatArray, b: FloatArray, h: float) -> FloatArray:
    """Integrate Boussinesq's pressure of a unit load over the rectangle from the load to (a, b), signed [-]."""
    square_a, square_b = a**2 + h**2, b**2 + h**2
    r = np.sqrt(square_a + b**2)
    return np.asarray(
        (np.arctan(a * b / (h * r)) + a * b * h * (square_a + square_b) / (square_a * square_b * r)) / (2 * np.pi)
    )


def _penetrate(scene: Scene, stiffness: float) -> FloatArray:
    """Compute the penetration into the foundation at the cells of the map, shape (m,) [m]."""
    _, gaps, area = scene.map
    return np.maximum(find_foundation_approach(gaps, stiffness * area, scene.load) - gaps, 0.0)


def _press_uniformly(scene: Scene, stiffness: float) -> tuple[FloatArray, FloatArray]:
    """Divide the load evenly among the cells in contact: their positions, shape (k, 2) [m], and forces, (k,) [N]."""
    points = scene.map.points[_penetrate(scene, stiffness) > 0]
    return points, np.full(len(points), scene.load / max(len(points), 1))


def _sample_gaussian(scene: Scene, points: FloatArray, forces: FloatArray, sigma: float) -> Forces:
    """Spread forces at points by a Gaussian of unit integral, sampled at texel centres times the texel's area.

    Args:
        scene: The press.
        points: Positions of the forces, shape (m, 2) [m].
        forces: Forces, shape (m,) [N].
        sigma: Standard deviation [m].
    """
    array = scene.array
    scale = float(np.prod(array.pitch)) / (2 * np.pi * sigma**2)
    wide, high = (np.exp(-((array.centres[:, axis, None] - points[:, axis]) ** 2) / (2 * sigma**2)) for axis in (0, 1))
    texels = scale * (wide * high) @ forces
    return Forces(texels, scene.load - float(texels.sum()))
