"""Models that take texel forces from the contact points of the physics engine.

All use MuJoCo's own contact points on box texels.  Equations and sources: docs/comparison-models.md.
"""

from __future__ import annotations

import numpy as np

from fastmodel import Gaussian
from meshes.array_types import FloatArray
from validation.published.scene import Forces, Scene


def predict_gaussian_boxes(scene: Scene, *, sigma: float, ksize_x: float, ksize_y: float) -> Forces:
    """2015 report: sum the normal contact forces on each box texel, then spread by a separable Gaussian with unit sum.

    Args:
        scene: The press.
        sigma: Standard deviation [pitches].
        ksize_x: Width of the kernel along x, odd [texels].
        ksize_y: Width of the kernel along y, odd [texels].
    """
    kernel = Gaussian(sigma_x=sigma, sigma_y=sigma, ksize_x=int(ksize_x), ksize_y=int(ksize_y))
    texels = kernel.operator(scene.array) @ scene.boxes.contact_forces
    return Forces(texels, float(scene.boxes.total_force - texels.sum()))


def predict_binned(scene: Scene) -> Forces:
    """Tegin and Wikander 2005: sum the contact forces whose point lies on the texel's box; no spread."""
    contacts = scene.contacts
    texels = np.bincount(contacts.texels, _push(scene), scene.array.count).astype(np.float64)
    return Forces(texels, 0.0)


def predict_mean_3x3(scene: Scene, *, counts_per_newton: float, most_counts: float) -> Forces:
    """schunk_simulated_tactile_sensors: bin the contact forces, take the mean of 3 x 3 texels, clip the counts.

    The mean divides by 9 at the edges too, so that force is lost there.

    Args:
        scene: The press.
        counts_per_newton: Sensitivity [1/N].
        most_counts: Counts at which a texel saturates [-].
    """
    binned = predict_binned(scene).texels
    spread = convolve(scene, binned, np.full((3, 3), 1 / 9))
    texels = np.minimum(spread * counts_per_newton, most_counts) / counts_per_newton
    return Forces(texels, float(binned.sum() - spread.sum()))


def predict_cover_response(scene: Scene) -> Forces:
    """RobWorkSim 2010: spread the force of each contact point by a deformation function of the distance.

    The deformation function is the cover's own response to a point load, integrated over the texel.
    """
    forces, points = _push(scene), scene.contacts.points
    shares = np.array([scene.response(points[:, 0] - x, points[:, 1] - y) for x, y in scene.array.centres[:, :2]])
    texels = shares @ forces
    return Forces(texels, float(forces.sum() - texels.sum()))


def predict_normalised_gaussian(scene: Scene, *, distance: float, angle: float, least_force: float) -> Forces:
    """gazebo_ros_tactile: share each contact force among all texels by Gaussians of distance and angle, with unit sum.

    The weight of a texel is exp(-d^2 / (2 s_d^2)) exp(-(1 - n.n_k)^2 / (2 s_a^2)), d the distance of its centre from
    the contact point, n and n_k the normals of contact and texel.  Only pushing forces count.

    Args:
        scene: The press.
        distance: s_d [m].
        angle: s_a [-].
        least_force: Texel forces below this are set to zero [N].
    """
    contacts, array = scene.contacts, scene.array
    pushing = contacts.forces > 0
    apart = np.linalg.norm(contacts.points[pushing, None] - array.centres, axis=-1)
    turned = 1 - contacts.normals[pushing] @ array.normals.T
    exponent = -(apart**2) / (2 * distance**2) - turned**2 / (2 * angle**2)
    # the common factor of a contact's weights cancels in their sum
    weights = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    texels = contacts.forces[pushing] @ weights
    return Forces(np.where(texels < least_force, 0.0, texels), 0.0)


def predict_touch_grid(scene: Scene, *, field_of_view: float) -> Forces:
    """MuJoCo's touch_grid: bin the contact forces by azimuth and elevation, seen from a site behind the array.

    The bins divide the field of view evenly in angle.  The site stands behind the array's centre, where the field of
    view just covers the longer side of the array.

    Args:
        scene: The press.
        field_of_view: Half the field of view along the longer side of the array [deg].
    """
    array, contacts = scene.array, scene.contacts
    width, height = (array.pitch[0] * array.columns / 2, array.pitch[1] * array.rows / 2)
    centre = array.centres.mean(axis=0)
    back = max(width, height) / np.tan(np.radians(field_of_view))
    x, y, z = (contacts.points - centre + [0, 0, back]).T
    azimuth, elevation = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
    # a point on an edge belongs to the bin below the edge, as in the plugin
    column = np.searchsorted(np.linspace(-1, 1, array.columns + 1) * np.arctan(width / back), azimuth) - 1
    row = np.searchsorted(np.linspace(-1, 1, array.rows + 1) * np.arctan(height / back), elevation) - 1
    inside = (column >= 0) & (column < array.columns) & (row >= 0) & (row < array.rows)
    forces = _push(scene)
    texels = np.bincount(row[inside] * array.columns + column[inside], forces[inside], array.count)
    return Forces(texels.astype(np.float64), float(forces[~inside].sum()))


def convolve(scene: Scene, texels: FloatArray, kernel: FloatArray) -> FloatArray:
    """Convolve the image of texel forces with a kernel, zero beyond the edges of the array, shape (n,) [N].

    Args:
        scene: The press, whose array gives rows and columns.
        texels: Force on each texel, shape (n,) [N].
        kernel: Weights, odd numbers of rows and columns [-].
    """
    from scipy.ndimage import convolve as convolve_image

    image = texels.reshape(scene.array.rows, scene.array.columns)
    return np.asarray(convolve_image(image, kernel, mode="constant")).ravel()


def _push(scene: Scene) -> FloatArray:
    """Return the part of each contact force along the array's normal, shape (m,) [N]."""
    return scene.contacts.forces * scene.contacts.normals[:, 2]
