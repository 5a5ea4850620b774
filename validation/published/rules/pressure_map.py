"""Models that spread a fine map of the contact by a function of the distance.

The map is that of an elastic foundation under the rigid indenter, which carries the load.  The pressure of a model is
either uniform over the area of contact, or proportional to the penetration.
"""

from __future__ import annotations

import numpy as np

from meshes import TexelArray
from meshes.array_types import FloatArray
from validation.published.model import MAP, OWN, SECONDARY, Parameter, published
from validation.published.scene import Forces, Scene, sink_springs


@published(
    "pezzementi-pressure",
    title="Pezzementi 2010, pressure",
    contact=MAP,
    rule="Gaussian of the contact pressure, sampled at texel centres",
    certainty=SECONDARY,
    stiffness=Parameter(unit="Pa/m", fitted=True),
    sigma=Parameter(unit="m", start=2e-3, fitted=True),
)
def predict_gaussian_of_pressure(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: spread a uniform contact pressure by a Gaussian, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        sigma: Standard deviation [m].
    """
    return _sample_gaussian(scene, *_press_uniformly(scene, stiffness), sigma)


@published(
    "pezzementi-depth",
    title="Pezzementi 2010, depth",
    contact=MAP,
    rule="Gaussian of the contact depth, sampled at texel centres",
    certainty=SECONDARY,
    stiffness=Parameter(unit="Pa/m", fitted=True),
    sigma=Parameter(unit="m", start=2e-3, fitted=True),
)
def predict_gaussian_of_depth(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: spread a contact pressure in proportion to depth by a Gaussian, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation [Pa/m].
        sigma: Standard deviation [m].
    """
    depth = _penetrate(scene, stiffness)
    return _sample_gaussian(scene, scene.map.points, depth * scene.load / depth.sum(), sigma)


@published(
    "shimojo-1994",
    title="Shimojo 1994",
    contact=MAP,
    rule="low-pass (1 + k h) exp(-k h) of the contact pressure",
    certainty=f"{SECONDARY}; form of the low-pass chosen by us",
    stiffness=Parameter(unit="Pa/m", fitted=True),
    depth=Parameter(unit="m", start=2e-3, fitted=True),
)
def predict_low_pass(scene: Scene, *, stiffness: float, depth: float) -> Forces:
    """Shimojo 1994: filter a uniform contact pressure by a spatial low-pass, here (1 + k h) exp(-k h).

    With the wave number k, this is the transfer function of a half space from its surface to the depth h (Boussinesq).
    The filtered pressure is integrated over each texel.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        depth: Depth h of the texels [m].
    """
    points, forces = _press_uniformly(scene, stiffness)
    texels = half_space_shares(scene.array, points, depth) @ forces
    return Forces(texels, scene.load - float(texels.sum()))


@published(
    "exact-layer",
    title="exact layer as low-pass",
    contact=MAP,
    rule="exact transfer function of the bonded layer on the same pressure",
    certainty=OWN,
    stiffness=Parameter(unit="Pa/m", fitted=True),
)
def predict_exact_layer(scene: Scene, *, stiffness: float) -> Forces:
    """Filter a uniform contact pressure by the exact transfer function of a bonded elastic layer.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
    """
    touching = _penetrate(scene, stiffness) > 0
    texels = scene.layer_shares[:, touching].sum(axis=1) * scene.load / max(touching.sum(), 1)
    return Forces(texels, scene.load - float(texels.sum()))


def half_space_shares(array: TexelArray, points: FloatArray, depth: float) -> FloatArray:
    """Integrate the pressure of unit point loads on a half space, at a depth, over each texel.

    The integral of Boussinesq's 3 h^3 / (2 pi (r^2 + h^2)^(5/2)) over a rectangle is a sum over its corners (Newmark
    1935).

    Args:
        array: The n texels.
        points: Positions of the loads, shape (m, 2) [m].
        depth: Depth h of the texels [m].

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
    """Integrate Boussinesq's pressure at the depth h under a unit load over the rectangle from the load to (a, b) [-].

    The sign of the result is that of the product a b.
    """
    square_a, square_b = a**2 + h**2, b**2 + h**2
    r = np.sqrt(square_a + b**2)
    return np.asarray(
        (np.arctan(a * b / (h * r)) + a * b * h * (square_a + square_b) / (square_a * square_b * r)) / (2 * np.pi)
    )


def _penetrate(scene: Scene, stiffness: float) -> FloatArray:
    """Compute the penetration into the foundation at the cells of the map, shape (m,) [m]."""
    _, gaps, area = scene.map
    return sink_springs(gaps, stiffness * area, scene.load)


def _press_uniformly(scene: Scene, stiffness: float) -> tuple[FloatArray, FloatArray]:
    """Divide the load evenly among the cells of the map that are in contact.

    Returns:
        Positions of the k cells in contact, shape (k, 2) [m], and the forces on these cells, shape (k,) [N].
    """
    points = scene.map.points[_penetrate(scene, stiffness) > 0]
    return points, np.full(len(points), scene.load / max(len(points), 1))


def _sample_gaussian(scene: Scene, points: FloatArray, forces: FloatArray, sigma: float) -> Forces:
    """Spread point forces by a Gaussian of unit integral.

    The force on a texel is the value of the spread pressure at the texel's centre times the area of a pitch.

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
