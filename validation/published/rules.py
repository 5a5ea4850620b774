"""Published models, which compute the forces on the texels from the inputs of one press.

The first models use the forces at the contact points of the physics engine on box texels.  Others use the penetration
of the rigid indenter.  The last models spread a fine map of the contact by a function of the distance.  The map is that
of an elastic foundation under the rigid indenter and carries the load.  For `pressure` it is uniform over the area of
contact, for `depth` it is proportional to the penetration.  Equations and sources: docs/comparison-models.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fastmodel import Gaussian
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray
from validation.published.scene import Forces, Scene, Values, bin_on_texels, find_approach, find_foundation_approach

#: Source of an implementation: code that the authors published.
CODE = "from its published code"
#: Source of an implementation: a summary of code that was not available.
SUMMARY = "from a summary of its code"
#: Source of an implementation: publications that cite the model.
SECONDARY = "paper not read: from equations in secondary sources"
#: Source of an implementation: the report that describes the model.
REPORT = "from the report; unit of the filter's cut-off and handling of borders unknown"
#: Source of an implementation: none, because the model was made for this comparison.
OWN = "our own, for comparison"
#: Input of a model: forces at the contact points of the physics engine.
POINTS = "engine's contact points"
#: Input of a model: depth to which the rigid indenter penetrates the array.
PENETRATION = "rigid penetration"
#: Input of a model: pressure on the contact area.
MAP = "contact map"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a model.

    Attributes:
        shipped: Published value of the parameter.  None if it is unknown, or if it is a fitted stiffness whose
            published value is that of the cover.
        unit: Unit of the parameter; empty for none.
        start: Start value for a fit; None for the published value.
        fitted: Whether the parameter is fitted; a fitted parameter must be positive.
    """

    shipped: float | None = None
    unit: str = ""
    start: float | None = None
    fitted: bool = False


def _given(shipped: float, unit: str = "") -> Parameter:
    return Parameter(shipped=shipped, unit=unit)


def _fitted(shipped: float | None = None, unit: str = "", *, start: float | None = None) -> Parameter:
    return Parameter(shipped=shipped, unit=unit, start=start, fitted=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A published model.

    Attributes:
        name: Short name, unique in the table.
        title: Name of the tool or first author, with the year.
        contact: Input from which the model computes texel forces: `POINTS`, `PENETRATION` or `MAP`.
        rule: The model in a few words.
        certainty: Source of the implementation, such as `CODE`.
        predict: Function of a scene and of the parameters by name, which returns the forces.
        parameters: The parameters by name.
        total: Sum of the forces in words, if the model itself does not make it equal to the load.
        in_time: Published filters, dampers and noise, which have no effect on a held load and are not implemented.
    """

    name: str
    title: str
    contact: str
    rule: str
    certainty: str
    predict: Callable[..., Forces]
    parameters: Mapping[str, Parameter]
    total: str = ""
    in_time: str = ""

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters that have one, by name."""
        return {name: each.unit for name, each in self.parameters.items() if each.unit}

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return tuple(name for name, each in self.parameters.items() if each.fitted)

    @property
    def start(self) -> dict[str, float]:
        """Start values of a fit other than the published values, by name."""
        return {name: each.start for name, each in self.parameters.items() if each.start is not None}

    def find_shipped(self, cover: Cover) -> Values | None:
        """Return the parameters as shipped for a cover; None if they are unknown or undefined.

        A stiffness without a published value is that of the cover under a uniform pressure.  It is undefined for a
        cover of incompressible material.
        """
        values = {name: each.shipped for name, each in self.parameters.items()}
        if "stiffness" in self.fitted and values["stiffness"] is None:
            values["stiffness"] = foundation_stiffness(cover)
        known = {name: value for name, value in values.items() if value is not None}
        return known if len(known) == len(values) else None


def foundation_stiffness(cover: Cover) -> float | None:
    """Compute pressure over depth of a cover that is compressed without lateral strain; None at Poisson ratio 0.5.

    1 / sum(h / E_oed), E_oed = E (1 - nu) / ((1 + nu) (1 - 2 nu)) [Pa/m].
    """
    compliance = 0.0
    for layer in cover.layers:
        e, nu = layer.material.youngs_modulus, layer.material.poisson_ratio
        compliance += layer.thickness * (1 + nu) * (1 - 2 * nu) / (e * (1 - nu))
    return 1 / compliance if compliance > 0 else None


#: All published models, by name.  Null models and the fast model are in `validation.campaign.results.MODELS`.
PUBLISHED: dict[str, Model] = {}
#: Function of a scene and of the parameters of a model by name that returns the forces.
Predict = Callable[..., Forces]


def _published(
    name: str, title: str, contact: str, rule: str, certainty: str,
    *, total: str = "", in_time: str = "", **parameters: Parameter,
) -> Callable[[Predict], Predict]:  # fmt: skip
    """Enter a function in the table of models, see `Model`."""

    def enter(predict: Predict) -> Predict:
        PUBLISHED[name] = Model(
            name=name, title=title, contact=contact, rule=rule, certainty=certainty, predict=predict,
            parameters=parameters, total=total, in_time=in_time,
        )  # fmt: skip
        return predict

    return enter


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


for _sigma, _x, _y in ((0.5, 3, 3), (0.8, 3, 3), (1.0, 3, 5), (1.0, 5, 5), (0.8, 5, 5)):
    _published(
        f"report-{_sigma:g}-{_x}x{_y}",
        f"2015 report, sigma {_sigma:g}, {_x} x {_y}",
        POINTS,
        "sum on boxes, separable Gaussian of unit sum",
        REPORT,
        in_time="Butterworth filter before the Gaussian",
        # Only one of the standard deviations is fitted.
        sigma=Parameter(shipped=_sigma, unit="pitches", fitted=(_sigma, _x) == (0.8, 5)),
        ksize_x=_given(_x, "texels"),
        ksize_y=_given(_y, "texels"),
    )(predict_gaussian_boxes)


@_published(
    "tegin-2005",
    "Tegin and Wikander 2005 (GraspIt)",
    POINTS,
    "sum on the texel's box, no spread",
    SECONDARY,
    in_time="y = 0.1 f + 0.9 y every 2.5 ms in GraspIt's later code",
)
def predict_binned(scene: Scene) -> Forces:
    """Tegin and Wikander 2005: sum the contact forces whose point lies on the texel's box; no spread."""
    contacts = scene.contacts
    texels = np.bincount(contacts.texels, _push(scene), scene.array.count).astype(np.float64)
    return Forces(texels, 0.0)


@_published(
    "robworksim-2010",
    "RobWorkSim 2010, paper",
    POINTS,
    "each point spread by the cover's own radial response",
    SECONDARY,
)
def predict_cover_response(scene: Scene) -> Forces:
    """RobWorkSim 2010: spread the force of each contact point by a deformation function of the distance.

    The deformation function is the cover's own response to a point load, integrated over the texel.
    """
    forces, points = _push(scene), scene.contacts.points
    shares = np.array([scene.response(points[:, 0] - x, points[:, 1] - y) for x, y in scene.array.centres[:, :2]])
    texels = shares @ forces
    return Forces(texels, float(forces.sum() - texels.sum()))


@_published(
    "schunk",
    "schunk_simulated_tactile_sensors",
    POINTS,
    "sum on boxes, mean of 3 x 3 texels, clipped counts",
    f"{SUMMARY}; borders unknown",
    total="less where texels saturate",
    in_time="mean of 10 samples",
    counts_per_newton=_given(350.0, "1/N"),
    most_counts=_given(3500.0),
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
    spread = convolve(scene, binned, np.full((3, 3), 1 / 9))
    texels = np.minimum(spread * counts_per_newton, most_counts) / counts_per_newton
    return Forces(texels, float(binned.sum() - spread.sum()))


@_published(
    "gazebo-ros-tactile",
    "gazebo_ros_tactile (ubi-agni)",
    POINTS,
    "each point shared among all texels by Gaussians of distance and angle, unit sum",
    f"{CODE}; default widths unknown",
    in_time="mean between two reads",
    distance=_fitted(unit="m", start=2e-3),
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


@_published(
    "touch-grid",
    "MuJoCo touch_grid",
    POINTS,
    "binned by azimuth and elevation from a site behind the array",
    "checked against the plugin of MuJoCo 4.0",
    field_of_view=_fitted(45.0, "deg"),
)
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
    # A point on an edge belongs to the bin below the edge, as in the plugin.
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


#: Step of RobWorkSim's search for the depth of the indenter [m].
_ROBWORK_STEP = 0.05e-3
#: Number of steps after which RobWorkSim's search ends [-].
_ROBWORK_STEPS = 20
#: Thickness of the cover in RobWorkSim [m].
_ROBWORK_THICKNESS = 2e-3
#: Largest pressure on a texel in RobWorkSim [Pa].
_ROBWORK_PRESSURE = 250e3


@_published(
    "robworksim-later",
    "RobWorkSim, later code",
    PENETRATION,
    "one offset by mean pressure, load shared by depth, mask of 3 x 3 texels",
    CODE,
    total="scaled to the load; the code divides by the number of loaded texels once more",
    in_time="alpha = dt / (tau + dt), tau = 0.1 s; overwritten in the version that was read",
    modulus=_fitted(700e3, "Pa"),
    mask=_fitted(1.0),
)
def predict_robwork(scene: Scene, *, modulus: float, mask: float) -> Forces:
    """RobWorkSim, later code: springs in shares of the load, spread by a mask of 3 x 3 texels, scaled to the load.

    One offset between indenter and array is searched in steps.  At this offset the mean pressure equals the modulus
    times the mean strain of a cover of 2 mm.  The load is then shared among the texels in proportion to depth.

    Args:
        scene: The press.
        modulus: Modulus of the cover [Pa].
        mask: Factor on the width of the mask; 1 as published [-].
    """
    lowest = scene.texel_gaps.min()
    if not np.isfinite(lowest):
        return Forces(np.zeros(scene.array.count), scene.load)
    area, gaps = float(np.prod(scene.array.pitch)), scene.texel_gaps - lowest
    best, least = np.zeros(scene.array.count), np.inf
    for step in range(1, _ROBWORK_STEPS):
        depth = _sink(step * _ROBWORK_STEP, gaps)
        touched = area * np.count_nonzero(depth)
        miss = abs(scene.load / touched - modulus * depth.sum() * area / (_ROBWORK_THICKNESS * touched))
        if miss > least:
            break
        best, least = depth, miss
    spread = convolve(scene, best * scene.load / best.sum(), robwork_mask(mask))
    clipped = np.minimum(spread, _ROBWORK_PRESSURE * area)
    return Forces(clipped * scene.load / clipped.sum(), 0.0)


def robwork_mask(width: float) -> FloatArray:
    """Compute RobWorkSim's mask, weights of 3 x 3 texels with unit sum.

    The weight at the distance r is max(0, 1.224 / (1 + r^2) - 0.348), r in units of 3/4 pitches; it is sampled at 5 x 5
    points per texel, half a step off the middle.

    Args:
        width: Factor on the distances [-].
    """
    at = 4 * (np.arange(15) / 15 - 0.5) / width
    weights = np.maximum(1.224299065420561 / (1 + at[:, None] ** 2 + at**2) - 0.3476635514018692, 0.0)
    if not weights.any():  # kernel narrower than its samples
        return np.pad([[1.0]], 1)
    blocks = weights.reshape(3, 5, 3, 5).sum(axis=(1, 3))
    return np.asarray(blocks / blocks.sum())


@_published(
    "opengrasp-2013",
    "OpenGrasp (Moisio 2013)",
    PENETRATION,
    "elastic foundation k d A on fine cells",
    SUMMARY,
    in_time="damper c; friction with sigma_0, sigma_1, mu_s, mu_d",
    stiffness=_fitted(unit="Pa/m"),
)
def predict_foundation(scene: Scene, *, stiffness: float) -> Forces:
    """OpenGrasp (Moisio 2013): f = k d A per cell, on the cells of a fine grid, summed over each texel; no spread.

    Args:
        scene: The press.
        stiffness: Pressure per depth k [Pa/m].
    """
    points, gaps, area = scene.map
    depth = _sink(find_foundation_approach(gaps, stiffness * area, scene.load), gaps)
    texels = bin_on_texels(scene.array, points, stiffness * area * depth)
    return Forces(texels, scene.load - float(texels.sum()))


@_published(
    "skinsim-2014",
    "SkinSim 2014",
    PENETRATION,
    "one spring per texel, Gaussian of 3 x 3 texels",
    SUMMARY,
    total="amplitude times the sum of the kernel",
    in_time="damper 0.130 N s/m, mass 1 g",
    stiffness=_fitted(16.37, "N/m"),
    amplitude=_fitted(0.159),
    sigma=_fitted(10e-3, "m"),
)
def predict_springs(scene: Scene, *, stiffness: float, amplitude: float, sigma: float) -> Forces:
    """SkinSim 2014: one spring per texel, and a Gaussian of 3 x 3 elements whose sum is not one.

    The weight of a neighbour at the distance d is `amplitude` exp(-d^2 / (2 sigma^2)).

    Args:
        scene: The press.
        stiffness: Stiffness of a spring [N/m].
        amplitude: Weight of the element itself [-].
        sigma: Standard deviation [m].
    """
    springs, outside = _compress(scene, stiffness)
    x, y = np.meshgrid(*(step * np.array([-1, 0, 1]) for step in scene.array.pitch))
    kernel = amplitude * np.exp(-(x**2 + y**2) / (2 * sigma**2))
    texels = convolve(scene, springs, kernel)
    return Forces(texels, float(outside + springs.sum() * kernel.sum() - texels.sum()))


@_published(
    "genesis-taxel",
    "Genesis KinematicTaxel",
    PENETRATION,
    "k d^e at each texel's centre, crosstalk by a Gaussian",
    CODE,
    in_time="damper c = 1, gain 0.85..1.15, dead taxels 5 %, noise 0.005 N",
    stiffness=_fitted(500.0, "N/m^e"),
    exponent=_given(1.2),
    crosstalk=_fitted(0.0, start=0.3),
    sigma=_fitted(0.5, "pitches"),
)
def predict_taxels(scene: Scene, *, stiffness: float, exponent: float, crosstalk: float, sigma: float) -> Forces:
    """Genesis KinematicTaxel: f = k d^e at each texel's centre, then (1 - a) f + a (Gaussian of f).

    Args:
        scene: The press.
        stiffness: Stiffness k of a texel [N/m^e].
        exponent: Exponent e of the depth [-].
        crosstalk: Weight a of the Gaussian part [-].
        sigma: Standard deviation of the Gaussian, which has a unit sum [pitches].
    """
    texels, outside = _compress(scene, stiffness, exponent)
    if crosstalk:
        spread = Gaussian.from_sigma(sigma).operator(scene.array) @ texels
        lost = float(texels.sum() - spread.sum())
        texels = (1 - crosstalk) * texels + crosstalk * spread
        outside += crosstalk * lost
    return Forces(texels, outside)


@_published(
    "penalty",
    "TacSL, FlexiTac",
    PENETRATION,
    "penalty k_n d on a distance field, one point per texel",
    SUMMARY,
    stiffness=_fitted(5000.0, "N/m"),
)
def predict_penalty(scene: Scene, *, stiffness: float) -> Forces:
    """Penalty on a distance field (TacSL, FlexiTac): f = k_n d at one point per texel; no spread.

    Args:
        scene: The press.
        stiffness: Stiffness k_n of a texel [N/m].
    """
    return Forces(*_compress(scene, stiffness))


@_published(
    "mujoco-tactile",
    "MuJoCo tactile sensor",
    PENETRATION,
    "rigid penetration at each texel's centre",
    "checked against the sensor of MuJoCo 4.0",
    total="scaled to the load",
    depth_factor=_fitted(1.0),
)
def predict_mujoco_tactile(scene: Scene, *, depth_factor: float) -> Forces:
    """MuJoCo's tactile sensor: the penetration depth d at each texel's centre, scaled to the load.

    Args:
        scene: The press.
        depth_factor: Factor on the largest rigid penetration in MuJoCo; 1 for the sensor as it is [-].
    """
    depth = _sink(depth_factor * float(scene.contacts.depths.max()), scene.texel_gaps)
    total = depth.sum()
    return Forces(depth * scene.load / total, 0.0) if total > 0 else Forces(depth, scene.load)


def _compress(scene: Scene, stiffness: float, exponent: float = 1.0) -> tuple[FloatArray, float]:
    """Compute forces k d^e at the texels' centres that carry the load, and the load if no centre is under the indenter.

    Args:
        scene: The press.
        stiffness: Stiffness k of a texel [N/m^e].
        exponent: Exponent e of the depth [-].
    """
    gaps = scene.texel_gaps
    if exponent == 1:
        approach = find_foundation_approach(gaps, stiffness, scene.load)
    else:
        approach = find_approach(gaps, lambda depth: stiffness * depth**exponent, scene.load)
    texels = stiffness * _sink(approach, gaps) ** exponent
    return texels, 0.0 if texels.any() else scene.load


def _sink(approach: float, gaps: FloatArray) -> FloatArray:
    """Compute the penetration at points for an approach from first touch, zero if the approach is NaN [m]."""
    return np.zeros_like(gaps) if np.isnan(approach) else np.maximum(approach - gaps, 0.0)


@_published(
    "pezzementi-pressure",
    "Pezzementi 2010, pressure",
    MAP,
    "Gaussian of the contact pressure, sampled at texel centres",
    SECONDARY,
    stiffness=_fitted(unit="Pa/m"),
    sigma=_fitted(unit="m", start=2e-3),
)
def predict_gaussian_of_pressure(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: a Gaussian point spread function of the contact pressure, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        sigma: Standard deviation [m].
    """
    return _sample_gaussian(scene, *_press_uniformly(scene, stiffness), sigma)


@_published(
    "pezzementi-depth",
    "Pezzementi 2010, depth",
    MAP,
    "Gaussian of the contact depth, sampled at texel centres",
    SECONDARY,
    stiffness=_fitted(unit="Pa/m"),
    sigma=_fitted(unit="m", start=2e-3),
)
def predict_gaussian_of_depth(scene: Scene, *, stiffness: float, sigma: float) -> Forces:
    """Pezzementi 2010: a Gaussian point spread function of the contact depth, sampled at the texels' centres.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation [Pa/m].
        sigma: Standard deviation [m].
    """
    depth = _penetrate(scene, stiffness)
    return _sample_gaussian(scene, scene.map.points, depth * scene.load / depth.sum(), sigma)


@_published(
    "shimojo-1994",
    "Shimojo 1994",
    MAP,
    "low-pass (1 + k h) exp(-k h) of the contact pressure",
    f"{SECONDARY}; form of the low-pass chosen by us",
    stiffness=_fitted(unit="Pa/m"),
    depth=_fitted(unit="m", start=2e-3),
)
def predict_low_pass(scene: Scene, *, stiffness: float, depth: float) -> Forces:
    """Shimojo 1994: the cover as a spatial low-pass of the contact pressure, here (1 + k h) exp(-k h).

    This is the transfer function of a half space from its surface to the depth h (Boussinesq), integrated over each
    texel.

    Args:
        scene: The press.
        stiffness: Pressure per depth of the foundation that gives the area of contact [Pa/m].
        depth: Depth h of the texels [m].
    """
    points, forces = _press_uniformly(scene, stiffness)
    texels = half_space_shares(scene.array, points, depth) @ forces
    return Forces(texels, scene.load - float(texels.sum()))


@_published(
    "exact-layer",
    "exact layer as low-pass",
    MAP,
    "exact transfer function of the bonded layer on the same pressure",
    OWN,
    stiffness=_fitted(unit="Pa/m"),
)
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
