"""What a derivation found, as it is written to `derive.json` and below `derive` in `report.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from validation.results import Array, Column, JsonObject, Number, Result, result_model


@result_model
class Kernel(Result):
    """The Gaussian kernel that is fitted to the force on texels under uniform pressure over one of them.

    Attributes:
        sigma_x, sigma_y: Standard deviations [pitches].
        ksize_x, ksize_y: Odd numbers of texels [-].
        estimator: How sigma was found.
        estimates: Sigma along x and y by every estimator that is defined [pitches].
        residual: Half the summed absolute difference from the response, over the load [-].
        outside_kernel: Force of the response beyond ksize, over the load [-].
    """

    sigma_x: Annotated[float, Column(heading="sigma x", unit="pitches", decimals=4)]
    sigma_y: Annotated[float, Column(heading="sigma y", unit="pitches", decimals=4)]
    ksize_x: Annotated[int, Column(heading="ksize x", unit="texels", decimals=0)]
    ksize_y: Annotated[int, Column(heading="ksize y", unit="texels", decimals=0)]
    estimator: str
    estimates: Mapping[str, tuple[float, float]]
    residual: Annotated[float, Column(heading="kernel's misfit", unit="% of the load", factor=100)]
    outside_kernel: Annotated[float, Column(heading="beyond the kernel", unit="% of the load", factor=100)]


@result_model
class PointResponse(Result):
    """Pressure on the base of a wide cover under a unit point load.

    Attributes:
        radius_m: Distances from the load, shape (m,) [m].
        pressure_per_force: Pressure over force there, shape (m,) [1/m2].
    """

    radius_m: Array
    pressure_per_force: Array


@result_model
class FlatResponses(Result):
    """Response of a flat cover, and the fast model's parameters that are fitted to it.

    Attributes:
        sensor: Name of the sensor.
        cover: Layers, base and size.
        psf: The fitted kernel.
        texel_response: Force on texels per unit point load over the middle one, shape (rows, columns) [-].
        texel_response_outside: Force of it that falls outside the array [-].
        texel_response_uniform: The same for uniform pressure over that texel, shape (rows, columns) [-].
        texel_response_uniform_outside: Force of it that falls outside the array [-].
        point_response: Radial profile; None with free side edges.
        error_estimate: Estimated relative errors by name [-].
        resolution: Two-point separation at the base; NaN if there is no dip, None with free side edges [m].
        resolution_on_array: The same with these texels, in the worst alignment [m].
        sensitivity: Change of sigma by thickness [pitches/m] and Poisson ratio [pitches].
        depth: Fits to the depth of a ball; None with free side edges.
        validity: Range of the fast model, or `not stated`.
        undetermined: What the data do not determine.
        assumed_electronics: What the sensor file does not state of the electronics.
        calibration: Force of the characteristic, and the share of a calibration tip's force on a texel.
        seconds: Wall time [s].
    """

    sensor: str
    cover: JsonObject
    psf: Kernel
    texel_response: Array
    texel_response_outside: float
    texel_response_uniform: Array
    texel_response_uniform_outside: float
    point_response: PointResponse | None
    error_estimate: Mapping[str, Number]
    resolution: float | None
    resolution_on_array: float | None
    sensitivity: Mapping[str, float]
    depth: JsonObject | None
    validity: JsonObject | str
    undetermined: tuple[str, ...]
    assumed_electronics: tuple[str, ...]
    calibration: JsonObject
    seconds: float


@result_model
class CurvedResponses(Result):
    """Responses of the n texels of a curved cover.

    Attributes:
        sensor: Name of the sensor.
        cover: The material and the thickness.
        texels: Centres [m], normals, size [m] and whether they are active.
        above_m: Points of the surface above the texels, shape (n, 3) [m].
        texel_response: Force on each texel (column) per unit point force above each texel (row), shape (n, n) [-].
        texel_response_uniform: The same for a force that is spread over the texel, shape (n, n) [-].
        gaussian: Sigma along the two axes of the surface [m], and the load that it puts on wrong texels [-].
        error_estimate: Estimated relative errors by name [-].
        meshes: Hash, origin and quality of each mesh.
        notes: What is to know about the mesh.
        warnings: Responses that do not mean what they say.
        assumed_electronics: What the sensor file does not state of the electronics.
        seconds: Wall time [s].
    """

    sensor: str
    cover: JsonObject
    texels: JsonObject
    above_m: Array
    texel_response: Array
    texel_response_uniform: Array
    gaussian: JsonObject
    error_estimate: Mapping[str, Number]
    meshes: tuple[JsonObject, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    assumed_electronics: tuple[str, ...]
    seconds: float
