"""Equations of the models that use the contact points of the physics engine."""

import numpy as np

from tests.exact.point_response import point_response_spline
from tests.validation.published.equations.table import (
    COLUMNS,
    ROWS,
    equation,
    gaussian,
    integrate_texels,
    near,
    place,
    spread,
)


@equation("report-0.5-3x3")
@equation("report-0.8-3x3")
@equation("report-1-3x5")
@equation("report-1-5x5")
@equation("report-0.8-5x5")
def report(scene, sigma, ksize_x, ksize_y):
    return spread(scene.boxes.contact_forces, gaussian(sigma, ksize_x, ksize_y))


@equation("tegin-2005")
def binned(scene):
    out = np.zeros(scene.array.count)
    for texel, force, normal in zip(scene.contacts.texels, scene.contacts.forces, scene.contacts.normals, strict=True):
        out[texel] += force * normal[2]
    return out


@equation("schunk", conserves=False, counts_per_newton=350.0, most_counts=60.0)
def schunk(scene, counts_per_newton, most_counts):
    return (
        np.minimum(spread(binned(scene), near(lambda *_: 1 / 9)) * counts_per_newton, most_counts) / counts_per_newton
    )


@equation("robworksim-2010")
def robwork_paper(scene):
    response = point_response_spline(scene.cover, 14e-3)
    pushes = scene.contacts.forces * scene.contacts.normals[:, 2]
    return integrate_texels(scene, scene.contacts.points[:, :2], response, 40) @ pushes


@equation("gazebo-ros-tactile", conserves=False, distance=1.5e-3, angle=0.5, least_force=0.05)
def gazebo(scene, distance, angle, least_force):
    out = np.zeros(scene.array.count)
    for point, normal, force in zip(*scene.contacts[:3], strict=True):
        weights = np.array(
            [
                np.exp(-((place(scene, i) - point[:2]) ** 2).sum() / (2 * distance**2))
                * np.exp(-((1 - normal[2]) ** 2) / (2 * angle**2))
                for i in range(out.size)
            ]
        )
        out += force * weights / weights.sum()
    return np.where(out < least_force, 0.0, out)


@equation("touch-grid")
def touch_grid(scene, field_of_view):
    wide, high = COLUMNS * scene.array.pitch[0] / 2, ROWS * scene.array.pitch[1] / 2
    back = max(wide, high) / np.tan(np.radians(field_of_view))
    half_x, half_y = np.arctan(wide / back), np.arctan(high / back)
    out = np.zeros(scene.array.count)
    for (x, y, z), push in zip(scene.plate.points, scene.plate.forces * scene.plate.normals[:, 2], strict=True):
        azimuth, elevation = np.arctan2(x, back + z), np.arctan2(y, np.hypot(x, back + z))
        column = int((azimuth + half_x) // (2 * half_x / COLUMNS))
        row = int((elevation + half_y) // (2 * half_y / ROWS))
        out[row * COLUMNS + column] += push
    return out
