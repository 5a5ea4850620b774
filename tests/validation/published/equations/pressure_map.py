"""Equations of the models that use a map of the contact pressure."""

import numpy as np

from tests.exact.point_response import point_response_spline
from tests.validation.published.equations.table import area, equation, integrate_texels, place, sink


def pressed(scene, stiffness):
    return sink(scene.map.gaps, 2.0, lambda d: stiffness * scene.map.area * d)


def sample(scene, forces, sigma):
    return [
        area(scene)
        * (forces * np.exp(-((scene.map.points - place(scene, i)) ** 2).sum(axis=1) / (2 * sigma**2))).sum()
        / (2 * np.pi * sigma**2)
        for i in range(scene.array.count)
    ]


@equation("pezzementi-pressure", stiffness=2e9, sigma=1.3e-3)
def pezzementi_pressure(scene, stiffness, sigma):
    touching = pressed(scene, stiffness) > 0
    return sample(scene, 2.0 * touching / touching.sum(), sigma)


@equation("pezzementi-depth", stiffness=2e9, sigma=1.3e-3)
def pezzementi_depth(scene, stiffness, sigma):
    return sample(scene, pressed(scene, stiffness), sigma)


def integrate(scene, stiffness, pressure):
    """Integrate the response to a uniform contact pressure over each texel by the midpoint rule."""
    points = scene.map.points[pressed(scene, stiffness) > 0]
    return 2.0 * integrate_texels(scene, points, pressure).sum(axis=1) / len(points)


@equation("shimojo-1994", stiffness=2e9, depth=1.1e-3)
def shimojo(scene, stiffness, depth):
    return integrate(scene, stiffness, lambda r: 3 * depth**3 / (2 * np.pi * (r**2 + depth**2) ** 2.5))


@equation("exact-layer", stiffness=2e9)
def exact_layer(scene, stiffness):
    return integrate(scene, stiffness, point_response_spline(scene.cover, 12e-3))
