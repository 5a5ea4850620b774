"""The table of published models: names, years, sources, parameters as shipped, and which parameters are fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from meshes import Cover
from validation.published import contact_map, contact_points, penetration
from validation.published.scene import Forces, Values

#: How sure the implementation is.
CODE, SUMMARY = "from its published code", "from a summary of its code"
SECONDARY = "paper not read: from equations in secondary sources"
REPORT = "from the report; unit of the filter's cut-off and handling of borders unknown"
OWN = "our own, for comparison"
#: What the models take the texel forces from.
POINTS, PENETRATION, MAP = "engine's contact points", "rigid penetration", "contact map"


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A published model.

    Attributes:
        name: Short name, unique in the table.
        title: Name of the tool or first author, with the year.
        contact: What the model takes the texel forces from: `POINTS`, `PENETRATION` or `MAP`.
        rule: The model in a few words.
        certainty: How sure the implementation is.
        predict: Function of a scene and of the parameters by name, which returns the forces.
        shipped: Parameters as published; None if they are unknown.  Without an entry, a stiffness is that of the cover
            under a uniform pressure; a cover of incompressible material has none, and no row as shipped.
        start: First values for the fit of parameters that are not in `shipped`.
        fitted: Names of the parameters that are fitted; all must be positive.
        units: Units of the parameters, by name, where they have one.
        total: What the sum of the forces is, if it is not the load by the model itself.
        in_time: Published filters, dampers and noise, which have no effect on a held load and are not built.
    """

    name: str
    title: str
    contact: str
    rule: str
    certainty: str
    predict: Callable[..., Forces]
    shipped: Values | None = field(default_factory=dict)
    start: Values = field(default_factory=dict)
    fitted: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    total: str = ""
    in_time: str = ""

    def find_shipped(self, cover: Cover) -> Values | None:
        """Return the parameters as shipped for a cover; None if they are unknown or undefined."""
        if self.shipped is None:
            return None
        if "stiffness" not in self.fitted or "stiffness" in self.shipped:
            return self.shipped
        stiffness = foundation_stiffness(cover)
        return None if stiffness is None else {**self.shipped, "stiffness": stiffness}


def foundation_stiffness(cover: Cover) -> float | None:
    """Compute pressure over depth of a cover that is compressed without lateral strain; None at Poisson ratio 0.5.

    1 / sum(h / E_oed), E_oed = E (1 - nu) / ((1 + nu) (1 - 2 nu)) [Pa/m].
    """
    compliance = 0.0
    for layer in cover.layers:
        e, nu = layer.material.youngs_modulus, layer.material.poisson_ratio
        compliance += layer.thickness * (1 + nu) * (1 - 2 * nu) / (e * (1 - nu))
    return 1 / compliance if compliance > 0 else None


def _report(sigma: float, ksize_x: int, ksize_y: int, fitted: tuple[str, ...] = ()) -> Model:
    return Model(
        name=f"report-{sigma:g}-{ksize_x}x{ksize_y}",
        title=f"2015 report, sigma {sigma:g}, {ksize_x} x {ksize_y}",
        contact=POINTS,
        rule="sum on boxes, separable Gaussian of unit sum",
        certainty=REPORT,
        predict=contact_points.predict_gaussian_boxes,
        shipped={"sigma": sigma, "ksize_x": ksize_x, "ksize_y": ksize_y},
        units={"sigma": "pitches", "ksize_x": "texels", "ksize_y": "texels"},
        in_time="Butterworth filter before the Gaussian",
        fitted=fitted,
    )


#: All published models, by name.  Null models and the fast model are in `validation.campaign.run.MODELS`.
PUBLISHED: Mapping[str, Model] = {
    model.name: model
    for model in (
        _report(0.5, 3, 3),
        _report(0.8, 3, 3),
        _report(1.0, 3, 5),
        _report(1.0, 5, 5),
        _report(0.8, 5, 5, fitted=("sigma",)),
        Model(
            name="tegin-2005",
            title="Tegin and Wikander 2005 (GraspIt)",
            contact=POINTS,
            rule="sum on the texel's box, no spread",
            certainty=SECONDARY,
            predict=contact_points.predict_binned,
            in_time="y = 0.1 f + 0.9 y every 2.5 ms in GraspIt's later code",
        ),
        Model(
            name="robworksim-2010",
            title="RobWorkSim 2010, paper",
            contact=POINTS,
            rule="each point spread by the cover's own radial response",
            certainty=SECONDARY,
            predict=contact_points.predict_cover_response,
        ),
        Model(
            name="schunk",
            title="schunk_simulated_tactile_sensors",
            contact=POINTS,
            rule="sum on boxes, mean of 3 x 3 texels, clipped counts",
            certainty=f"{SUMMARY}; borders unknown",
            predict=contact_points.predict_mean_3x3,
            shipped={"counts_per_newton": 350.0, "most_counts": 3500.0},
            units={"counts_per_newton": "1/N"},
            total="less where texels saturate",
            in_time="mean of 10 samples",
        ),
        Model(
            name="gazebo-ros-tactile",
            title="gazebo_ros_tactile (ubi-agni)",
            contact=POINTS,
            rule="each point shared among all texels by Gaussians of distance and angle, unit sum",
            certainty=f"{CODE}; default widths unknown",
            predict=contact_points.predict_normalised_gaussian,
            shipped=None,
            start={"distance": 2e-3, "angle": 1.0, "least_force": 0.0},
            fitted=("distance",),
            units={"distance": "m", "least_force": "N"},
            in_time="mean between two reads",
        ),
        Model(
            name="touch-grid",
            title="MuJoCo touch_grid",
            contact=POINTS,
            rule="binned by azimuth and elevation from a site behind the array",
            certainty="checked against the plugin of MuJoCo 4.0",
            predict=contact_points.predict_touch_grid,
            shipped={"field_of_view": 45.0},
            fitted=("field_of_view",),
            units={"field_of_view": "deg"},
        ),
        Model(
            name="robworksim-later",
            title="RobWorkSim, later code",
            contact=PENETRATION,
            rule="one offset by mean pressure, load shared by depth, mask of 3 x 3 texels",
            certainty=CODE,
            predict=penetration.predict_robwork,
            shipped={"modulus": 700e3, "mask": 1.0},
            fitted=("modulus", "mask"),
            units={"modulus": "Pa"},
            total="scaled to the load; the code divides by the number of loaded texels once more",
            in_time="alpha = dt / (tau + dt), tau = 0.1 s; overwritten in the version that was read",
        ),
        Model(
            name="opengrasp-2013",
            title="OpenGrasp (Moisio 2013)",
            contact=PENETRATION,
            rule="elastic foundation k d A on fine cells",
            certainty=SUMMARY,
            predict=penetration.predict_foundation,
            fitted=("stiffness",),
            units={"stiffness": "Pa/m"},
            in_time="damper c; friction with sigma_0, sigma_1, mu_s, mu_d",
        ),
        Model(
            name="skinsim-2014",
            title="SkinSim 2014",
            contact=PENETRATION,
            rule="one spring per texel, Gaussian of 3 x 3 texels",
            certainty=SUMMARY,
            predict=penetration.predict_springs,
            shipped={"stiffness": 16.37, "amplitude": 0.159, "sigma": 10e-3},
            fitted=("stiffness", "amplitude", "sigma"),
            units={"stiffness": "N/m", "sigma": "m"},
            total="amplitude times the sum of the kernel",
            in_time="damper 0.130 N s/m, mass 1 g",
        ),
        Model(
            name="genesis-taxel",
            title="Genesis KinematicTaxel",
            contact=PENETRATION,
            rule="k d^e at each texel's centre, crosstalk by a Gaussian",
            certainty=CODE,
            predict=penetration.predict_taxels,
            shipped={"stiffness": 500.0, "exponent": 1.2, "crosstalk": 0.0, "sigma": 0.5},
            start={"crosstalk": 0.3},
            fitted=("stiffness", "crosstalk", "sigma"),
            units={"stiffness": "N/m^e", "sigma": "pitches"},
            in_time="damper c = 1, gain 0.85..1.15, dead taxels 5 %, noise 0.005 N",
        ),
        Model(
            name="penalty",
            title="TacSL, FlexiTac",
            contact=PENETRATION,
            rule="penalty k_n d on a distance field, one point per texel",
            certainty=SUMMARY,
            predict=penetration.predict_penalty,
            shipped={"stiffness": 5000.0},
            fitted=("stiffness",),
            units={"stiffness": "N/m"},
        ),
        Model(
            name="mujoco-tactile",
            title="MuJoCo tactile sensor",
            contact=PENETRATION,
            rule="rigid penetration at each texel's centre",
            certainty="checked against the sensor of MuJoCo 4.0",
            predict=penetration.predict_mujoco_tactile,
            shipped={"depth_factor": 1.0},
            fitted=("depth_factor",),
            total="scaled to the load",
        ),
        Model(
            name="pezzementi-pressure",
            title="Pezzementi 2010, pressure",
            contact=MAP,
            rule="Gaussian of the contact pressure, sampled at texel centres",
            certainty=SECONDARY,
            predict=contact_map.predict_gaussian_of_pressure,
            shipped=None,
            start={"sigma": 2e-3},
            fitted=("stiffness", "sigma"),
            units={"stiffness": "Pa/m", "sigma": "m"},
        ),
        Model(
            name="pezzementi-depth",
            title="Pezzementi 2010, depth",
            contact=MAP,
            rule="Gaussian of the contact depth, sampled at texel centres",
            certainty=SECONDARY,
            predict=contact_map.predict_gaussian_of_depth,
            shipped=None,
            start={"sigma": 2e-3},
            fitted=("stiffness", "sigma"),
            units={"stiffness": "Pa/m", "sigma": "m"},
        ),
        Model(
            name="shimojo-1994",
            title="Shimojo 1994",
            contact=MAP,
            rule="low-pass (1 + k h) exp(-k h) of the contact pressure",
            certainty=f"{SECONDARY}; form of the low-pass chosen by us",
            predict=contact_map.predict_low_pass,
            shipped=None,
            start={"depth": 2e-3},
            fitted=("stiffness", "depth"),
            units={"stiffness": "Pa/m", "depth": "m"},
        ),
        Model(
            name="exact-layer",
            title="exact layer as low-pass",
            contact=MAP,
            rule="exact transfer function of the bonded layer on the same pressure",
            certainty=OWN,
            predict=contact_map.predict_exact_layer,
            fitted=("stiffness",),
            units={"stiffness": "Pa/m"},
        ),
    )
}
