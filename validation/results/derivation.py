"""Results of a derivation, as in `derive.json` and below `derive` in `report.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from validation.results import Array, Column, JsonObject, Number, Result, result_model


@result_model
class Kernel(Result):
    """Gaussian kernel of a flat cover, fitted to the forces on texels under a uniform pressure over one texel.

    Attributes:
        sigma_x, sigma_y: Standard deviations [pitches].
        ksize_x, ksize_y: Odd numbers of texels [-].
        estimator: Name of the estimator of sigma.
        estimates: Sigma along x and y by every estimator that is defined [pitches].
        residual: Half the summed absolute difference from the response, over the load [-].
        outside_kernel: Force of the response beyond ksize, over the load [-].
    """

    sigma_x: Annotated[float, Column(heading="sigma x", unit="pitches", decimals=4)]
    sigma_y: Annotated[float, Column(heading="sigma y", unit="pitches", decimals=4)]
    ksize_x: Annotated[int, Column(heading="ksize x", unit="texels", decimals=0)]
    ksize_y: Annotated[int, Column(heading="ksize y", unit="texels", decimals=0)]
    residual: Annotated[float, Column(heading="load that the kernel puts on wrong texels", unit="%", factor=100)]
    outside_kernel: Annotated[float, Column(heading="load beyond the kernel", unit="%", factor=100)]
    estimator: Annotated[str, Column(heading="estimator of sigma")]
    estimates: Annotated[Mapping[str, tuple[float, float]], Column(heading="sigma x, y by", unit="pitches", decimals=4)]


@result_model
class SurfaceKernel(Result):
    """Gaussian of a curved cover in coordinates of its surface, fitted to the responses to uniform loads on all texels.

    Attributes:
        sigma_m: Standard deviations along the two axes of the surface [m].
        residual: Share of a load on wrong texels, mean over the loaded texels [-].
    """

    sigma_m: Annotated[
        tuple[float, float],
        Column(heading="", unit="mm", factor=1e3, parts=("sigma along the first axis", "sigma along the second axis")),
    ]
    residual: Annotated[float, Column(heading="load that the Gaussian puts on wrong texels", unit="%", factor=100)]


@result_model
class PointResponse(Result):
    """Pressure on the base of a wide cover under a unit point load.

    Attributes:
        radius_m: Distances from the load, shape (m,) [m].
        pressure_per_force: Pressure over force at these distances, shape (m,) [1/m2].
    """

    radius_m: Array
    pressure_per_force: Array


@result_model
class Responses(Result):
    """Response of the n texels under a cover, and the parameters of the fast model fitted to it.

    Attributes that do not apply to a kind of cover are None.

    Attributes:
        sensor: Name of the sensor.
        cover: Layers, base and size.
        texel_response: For planar layers, the force on texels per unit point load over the middle texel, shape (rows,
            columns) [-].  For a solid, the force on each texel (column) per unit point force above each texel (row),
            shape (n, n) [-].
        texel_response_uniform: Response as `texel_response`, for a force distributed evenly over the loaded texel [-].
        psf: The fitted kernel of planar layers.
        gaussian: The fitted Gaussian of a solid.
        texel_response_outside: Force of `texel_response` that no texel measures [-].
        texel_response_uniform_outside: Force of `texel_response_uniform` that no texel measures [-].
        point_response: Pressure on the base over the distance from a point load; None with free side edges.
        resolution: Two-point separation at the base; NaN if there is no dip, None with free side edges [m].
        resolution_on_array: Two-point separation by a texel that moves between the points, by the Rayleigh criterion
            [m].
        sigma_range: Lower and upper end of sigma along x over the ranges of the layers' elastic constants, which count
            as independent; None if no layer states a range [pitches].
        sensitivity: Derivatives of sigma with respect to thickness [pitches/m] and Poisson ratio [pitches].
        depth: Stiffness parameters fitted to the computed depths of a ball under several loads; None with free side
            edges.
        validity: Loads up to which the fast model is accurate, or `not stated`.
        calibration: Force to which the characteristic relates the counts, and the share of a calibration tip's force
            that acts on a texel.
        texels: Centres [m], normals [-], size [m] and active state of the texels of a solid.
        above_m: Points of the surface above the texels, shape (n, 3) [m].
        meshes: Hash, origin and quality of each mesh.
        notes: Information on the mesh for users, one sentence each.
        error_estimate: Estimated relative errors by name [-].
        undetermined: Parameters that the data do not determine, one sentence each.
        warnings: Reasons why a response deviates from its definition, one sentence each.
        assumed_electronics: Properties of the electronics that the sensor file does not state.
        seconds: Wall time [s].
    """

    sensor: str
    cover: JsonObject
    texel_response: Array
    texel_response_uniform: Array
    psf: Kernel | None = None
    gaussian: SurfaceKernel | None = None
    texel_response_outside: float | None = None
    texel_response_uniform_outside: float | None = None
    point_response: PointResponse | None = None
    resolution: Annotated[
        float | None, Column(heading="two-point separation at the base", unit="mm", factor=1e3, decimals=2)
    ] = None
    resolution_on_array: Annotated[
        float | None, Column(heading="two-point separation by a texel of this size", unit="mm", factor=1e3, decimals=2)
    ] = None
    sigma_range: Annotated[
        tuple[float, float] | None,
        Column(heading="sigma x over the ranges of the materials", unit="pitches", decimals=4),
    ] = None
    sensitivity: Mapping[str, float] | None = None
    depth: JsonObject | None = None
    validity: JsonObject | str = "not stated"
    calibration: JsonObject
    texels: JsonObject | None = None
    above_m: Array | None = None
    meshes: tuple[JsonObject, ...] = ()
    notes: tuple[str, ...] = ()
    error_estimate: Annotated[Mapping[str, Number], Column(heading="estimated error,", unit="%", factor=100, digits=2)]
    undetermined: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    assumed_electronics: tuple[str, ...]
    seconds: float
    printed: ClassVar[Mapping[str, Column]] = {
        "own_share": Column(
            heading="",
            unit="%",
            factor=100,
            parts=tuple(f"point force that the texel below measures, {each}" for each in ("least", "largest")),
        ),
        "sigma_by_thickness": Column(heading="sigma by thickness", unit="pitches per mm", factor=1e-3),
        "sigma_by_poisson_ratio": Column(heading="sigma by Poisson ratio", unit="pitches per 0.01", factor=0.01),
        "foundation_modulus": Column(heading="foundation modulus", unit="N/mm3", factor=1e-9),
        "load_2_percent": Column(heading="fast model misplaces at most 2 % up to", unit="N"),
        "load_5_percent": Column(heading="fast model misplaces at most 5 % up to", unit="N"),
    }

    @property
    def own_share(self) -> tuple[float, float] | None:
        """Share of a point force above a texel that this texel measures: least and largest over active texels [-]."""
        if self.texels is None:
            return None
        shares = np.diag(self.texel_response)[np.asarray(self.texels["active"], dtype=bool)]
        return float(shares.min()), float(shares.max())

    @property
    def sigma_by_thickness(self) -> float | None:
        """Derivative of the kernel's standard deviation with respect to the thickness of the cover [pitches/m]."""
        return (self.sensitivity or {}).get("thickness")

    @property
    def sigma_by_poisson_ratio(self) -> float | None:
        """Derivative of the kernel's standard deviation with respect to Poisson's ratio of the cover [pitches]."""
        return (self.sensitivity or {}).get("poisson_ratio")

    @property
    def foundation_modulus(self) -> float | None:
        """Modulus of an elastic foundation fitted to the depth of a ball [N/m3]."""
        return None if self.depth is None else float(self.depth["foundation"]["modulus"])

    @property
    def load_2_percent(self) -> float | None:
        """Load of a ball up to which the fast model misplaces at most 2 % of the load [N]; None if at no load."""
        return None if isinstance(self.validity, str) else self.validity["load_2_percent"] or None

    @property
    def load_5_percent(self) -> float | None:
        """Load of a ball up to which the fast model misplaces at most 5 % of the load [N]; None if at no load."""
        return None if isinstance(self.validity, str) else self.validity["load_5_percent"] or None
