"""Models that distribute the forces at the contact points of the physics engine over the texels."""

from __future__ import annotations

import numpy as np

from fastmodel import Gaussian
from validation.published.in_time import butterworth, mean_between, mean_of, recursion
from validation.published.model import CODE, POINTS, REPORT, SECONDARY, SUMMARY, Parameter, published
from validation.published.scene import Forces, Scene, convolve


def predict_gaussian_boxes(scene: Scene, *, sigma: float, ksize_x: float, ksize_y: float) -> Forces:
    """2015 report: sum the normal contact forces on each box texel, then convolve with a Gaussian of unit sum.

    Args:
        scene: The press.
        sigma: Standard deviation [pitches].
        ksize_x: Width of the kernel along x, odd [texels].
        ksize_y: Width of the kernel along y, odd [texels].
    """
    kernel = Gaussian(sigma_x=sigma, sigma_y=sigma, ksize_x=int(ksize_x), ksize_y=int(ksize_y))
    texels = kernel.operator(scene.array) @ scene.boxes.contact_forces
    return Forces(texels, float(scene.boxes.total_force - texels.sum()))


#: Orders [-] and cut-offs of the report's filter; the unit of its cut-offs is not stated, hertz is assumed [Hz].
_FILTERS = ((5, 20.0), (5, 8.0), (2, 5.0), (2, 2.0))

# One row has all settings of the filter, which acts on the sums alone: sums and shapes do not depend on each other.
for _sigma, _x, _y, _settings in ((0.5, 3, 3, 1), (0.8, 3, 3, 1), (1.0, 3, 5, 1), (1.0, 5, 5, 1), (0.8, 5, 5, 4)):
    published(
        f"report-{_sigma:g}-{_x}x{_y}",
        title=f"2015 report, sigma {_sigma:g}, {_x} x {_y}",
        contact=POINTS,
        rule="sum on boxes, separable Gaussian of unit sum",
        certainty=REPORT,
        in_time="Butterworth filter before the Gaussian",
        terms={f"order {order}, {cut:g} Hz": butterworth(order, cut) for order, cut in _FILTERS[:_settings]},
        # The rows of the 2015 report share one function, so that one of the rows is fitted.
        sigma=Parameter(shipped=_sigma, unit="pitches", fitted=(_sigma, _x) == (0.8, 5)),
        ksize_x=Parameter(shipped=_x, unit="texels"),
        ksize_y=Parameter(shipped=_y, unit="texels"),
    )(predict_gaussian_boxes)


@published(
    "tegin-2005",
    title="Tegin and Wikander 2005 (GraspIt)",
    contact=POINTS,
    rule="sum on the texel's box, no spread",
    certainty=SECONDARY,
    in_time="y = 0.1 f + 0.9 y every 2.5 ms in GraspIt's later code",
    terms={"y = 0.1 f + 0.9 y every 2.5 ms": recursion(0.1, 2.5e-3)},
)
def predict_binned(scene: Scene) -> Forces:
    """Tegin and Wikander 2005: the force on a texel is the sum of the contact forces on the texel's box."""
    contacts = scene.contacts
    texels = np.bincount(contacts.texels, scene.contacts.pushes, scene.array.count).astype(np.float64)
    return Forces(texels, 0.0)


@published(
    "robworksim-2010",
    title="RobWorkSim 2010, paper",
    contact=POINTS,
    rule="each point spread by the cover's own radial response",
    certainty=SECONDARY,
)
def predict_cover_response(scene: Scene) -> Forces:
    """RobWorkSim 2010: spread the force of each contact point by a deformation function of the distance.

    The deformation function is the cover's own response to a point load, integrated over the texel.
    """
    forces, points = scene.contacts.pushes, scene.contacts.points
    shares = np.array([scene.response(points[:, 0] - x, points[:, 1] - y) for x, y in scene.array.centres[:, :2]])
    texels = shares @ forces
    return Forces(texels, float(forces.sum() - texels.sum()))


@published(
    "schunk",
    title="schunk_simulated_tactile_sensors",
    contact=POINTS,
    rule="sum on boxes, mean of 3 x 3 texels, clipped counts",
    certainty=f"{SUMMARY}; borders unknown",
    total="less where texels saturate",
    in_time="mean of 10 samples",
    terms={"mean of 10 samples of 1 ms": mean_of(10, 1e-3)},
    counts_per_newton=Parameter(shipped=350.0, unit="1/N"),
    most_counts=Parameter(shipped=3500.0),
)
def predict_mean_3x3(scene: Scene, *, counts_per_newton: float, most_counts: float) -> Forces:
    """schunk_simulated_tactile_sensors: bin the contact forces, take the mean of 3 x 3 texels, clip the counts.

    The mean divides by 9 also at the edges, so that force is lost there.

    Args:
        scene: The press.
        counts_per_newton: Sensitivity [1/N].
        most_counts: Counts at which a texel saturates [-].
    """
    binned = predict_binned(scene).texels
    spread = convolve(scene.array, binned, np.full((3, 3), 1 / 9))
    texels = np.minimum(spread * counts_per_newton, most_counts) / counts_per_newton
    return Forces(texels, float(binned.sum() - spread.sum()))


@published(
    "gazebo-ros-tactile",
    title="gazebo_ros_tactile (ubi-agni)",
    contact=POINTS,
    rule="each point shared among all texels by Gaussians of distance and angle, unit sum",
    certainty=f"{CODE}; default widths unknown",
    in_time="mean between two reads",
    terms={"mean between two reads, 100 Hz": mean_between(10e-3)},
    distance=Parameter(unit="m", start=2e-3, fitted=True),
    angle=Parameter(start=1.0),
    least_force=Parameter(start=0.0, unit="N"),
)
def predict_normalised_gaussian(scene: Scene, *, distance: float, angle: float, least_force: float) -> Forces:
    """gazebo_ros_tactile: share each contact force among all texels by Gaussians of distance and angle, with unit sum.

    The weight of a texel is exp(-d^2 / (2 s_d^2)) exp(-(1 - n.n_k)^2 / (2 s_a^2)), d the distance of its centre from
    the contact point, n and n_k the normals of contact and texel.  Only pushing forces count.

    Args:
        scene: The press.
        distance: Standard deviation s_d of the distance [m].
        angle: Standard deviation s_a of the cosine difference [-].
        least_force: Force below which a texel force is set to zero [N].
    """
    contacts, array = scene.contacts, scene.array
    pushing = contacts.forces > 0
    apart = np.linalg.norm(contacts.points[pushing, None] - array.centres, axis=-1)
    turned = 1 - contacts.normals[pushing] @ array.normals.T
    exponent = -(apart**2) / (2 * distance**2) - turned**2 / (2 * angle**2)
    # The common factor of a contact's weights cancels in their sum.
    weights = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    texels = contacts.forces[pushing] @ weights
    return Forces(np.where(texels < least_force, 0.0, texels), 0.0)


@published(
    "touch-grid",
    title="MuJoCo touch_grid",
    contact=POINTS,
    rule="binned by azimuth and elevation from a site behind the array",
    certainty="checked against the plugin of MuJoCo 4.0",
    field_of_view=Parameter(shipped=45.0, unit="deg", fitted=True),
)
def predict_touch_grid(scene: Scene, *, field_of_view: float) -> Forces:
    """MuJoCo's touch_grid: bin the contact forces on one plate by azimuth and elevation, seen from a site behind it.

    The bins divide the field of view evenly in angle.  The site stands behind the array's centre, where the field of
    view just covers the longer side of the array.

    Args:
        scene: The press.
        field_of_view: Half the field of view along the longer side of the array [deg].
    """
    array, contacts = scene.array, scene.plate
    width, height = (array.pitch[0] * array.columns / 2, array.pitch[1] * array.rows / 2)
    centre = array.centres.mean(axis=0)
    back = max(width, height) / np.tan(np.radians(field_of_view))
    x, y, z = (contacts.points - centre + [0, 0, back]).T
    azimuth, elevation = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
    # A point on an edge belongs to the bin below the edge, as in the plugin.
    column = np.searchsorted(np.linspace(-1, 1, array.columns + 1) * np.arctan(width / back), azimuth) - 1
    row = np.searchsorted(np.linspace(-1, 1, array.rows + 1) * np.arctan(height / back), elevation) - 1
    inside = (column >= 0) & (column < array.columns) & (row >= 0) & (row < array.rows)
    forces = contacts.pushes
    texels = np.bincount(row[inside] * array.columns + column[inside], forces[inside], array.count)
    return Forces(texels.astype(np.float64), float(forces[~inside].sum()))
