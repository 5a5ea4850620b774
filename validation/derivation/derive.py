"""Derivation of the fast model's parameters from the description of a sensor.

Finite elements give the forces on the texels under loads on the cover.  The Gaussian spread kernel of the fast model is
fitted to these forces.  The result also holds figures that show the quality of the fit: the value of every estimator,
the residual, the force beyond the kernel, the error estimate of the finite elements, resolution and sensitivities.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fastmodel.fitting.gaussian import Fit
from fastmodel.signal.point_spread import Tabulated
from meshes import SolidCover, TexelArray
from validation.derivation.contact_range import (
    DepthFits,
    TipShare,
    compute_tip_share,
    fit_depth,
    list_undetermined,
    press_ball_on_array,
    state_range,
)
from validation.derivation.kernel import (
    Influence,
    cells_with_sides,
    cover_cells,
    fit_kernel,
    gauss_points,
    radial_profile,
    sigma_sensitivities,
    texel_separation,
    two_point_separation,
)
from validation.errors import InputError
from validation.results.derivation import FlatResponses, Kernel, PointResponse
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters
    from fastmodel.surface import CoverCells
    from fem_reference.linear_response.point_spread import PointSpread
    from validation.curved.derive import CurvedDerivation

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Derivation:
    """The finite-element response of a sensor's cover, and the parameters of the sensor's fast model.

    Attributes:
        sensor: Description of the sensor.
        influence: Finite-element response of the texels to loads on the cover.
        texel_response: Forces on the texels under a unit point load over the centre of the middle texel, shape
            (rows, columns) [-].
        texel_response_uniform: Forces on the texels under unit force as uniform pressure over the middle texel, shape
            (rows, columns) [-].
        outside: Forces that no texel measures under these two loads [-].
        fit: The fitted spread kernel and its residual.
        parameters: Parameters of the fast model.
        error_estimate: Estimated relative errors of the finite elements (`total_force`, `peak_texel`, `sigma`) [-].
        depth: Contact stiffnesses fitted to the depth of a sphere; None for a cover with free side edges.
        undetermined: Quantities that the derivation cannot determine, one line of text each.
        tip: Share of the calibration tip's force that the texel under the tip measures; None if the characteristic was
            calibrated against the texel force, or if the finite elements failed.
        seconds: Wall time of the derivation, without the properties that are computed on first use [s].
    """

    sensor: SensorDescription
    influence: Influence
    texel_response: FloatArray
    texel_response_uniform: FloatArray
    outside: tuple[float, float]
    fit: Fit
    parameters: Parameters
    error_estimate: Mapping[str, float]
    depth: DepthFits | None
    undetermined: tuple[str, ...]
    tip: TipShare | None
    seconds: float

    @property
    def point_spread(self) -> PointSpread | None:
        """Response of a wide cover as a radial profile; None with free side edges, where it depends on the position."""
        return radial_profile(self.influence)

    @cached_property
    def resolution(self) -> float | None:
        """Smallest distance of two equal point loads with a dip of pressure at the cover's base between them [m].

        NaN if no distance shows a dip; None for a cover with free side edges.
        """
        return None if (spread := self.point_spread) is None else two_point_separation(spread)

    @cached_property
    def resolution_on_array(self) -> float | None:
        """Smallest distance of two equal point loads with a dip of texel values between two peaks [m].

        The dip must appear at every position of the loads relative to the texels.  NaN if no distance shows the dip;
        None for a cover with free side edges.
        """
        return None if (spread := self.point_spread) is None else texel_separation(spread, self.sensor.array)

    @cached_property
    def sensitivity(self) -> Mapping[str, float]:
        """Derivatives of sigma_x as computed by `sigma_sensitivities`; empty for a cover with free side edges."""
        spread = self.point_spread
        return {} if spread is None else sigma_sensitivities(self.sensor.layered_cover, self.sensor.array, spread)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Responses that do not mean what they say: none."""
        return ()

    @property
    def verification(self) -> Mapping[str, float]:
        """Differences of the response to a unit point load from the closed-form layer solution.

        `radial_profile` is the largest difference of base pressure over the peak pressure, and `texel_response` the
        difference of the force on the loaded texel over the load [-].  Empty with free side edges.
        """
        from fem_reference.closed_form import point_response

        spread, array = self.point_spread, self.sensor.array
        if spread is None:
            return {}
        radius = np.linspace(0, 6 * self.sensor.cover.thickness, 200)
        exact = point_response(self.sensor.layered_cover, radius)
        profile = np.abs(spread.pressure(radius) - exact).max() / exact.max()
        points, weights = gauss_points(array.texel_size, 12)
        force = weights @ point_response(self.sensor.layered_cover, np.hypot(*points.T)) * np.prod(array.texel_size)
        middle = self.texel_response[array.rows // 2, array.columns // 2]
        return {"radial_profile": float(profile), "texel_response": float(abs(middle - force))}

    @property
    def result(self) -> FlatResponses:
        """What is written of the derivation."""
        sensor, fit, spread = self.sensor, self.fit, self.point_spread
        estimates = {name: pair for name, pair in fit.estimates.items() if np.isfinite(pair).all()}
        return FlatResponses(
            sensor=sensor.name,
            cover=sensor.describe_cover(),
            psf=Kernel(
                **dataclasses.asdict(fit.gaussian),
                estimator=fit.estimator,
                estimates=estimates,
                residual=fit.residual,
                outside_kernel=fit.outside_kernel,
            ),
            texel_response=self.texel_response,
            texel_response_outside=self.outside[0],
            texel_response_uniform=self.texel_response_uniform,
            texel_response_uniform_outside=self.outside[1],
            point_response=None
            if spread is None
            else PointResponse(radius_m=spread.radius, pressure_per_force=spread.pressure_per_force),
            error_estimate=self.error_estimate,
            resolution=self.resolution,
            resolution_on_array=self.resolution_on_array,
            sensitivity=self.sensitivity,
            depth=None if self.depth is None else dataclasses.asdict(self.depth),
            validity="not stated" if self.parameters.validity is None else dataclasses.asdict(self.parameters.validity),
            undetermined=self.undetermined,
            assumed_electronics=sensor.assumed_electronics,
            calibration={
                "calibrated": sensor.electronics.calibrated,
                "tip": None if self.tip is None else dataclasses.asdict(self.tip),
            },
            seconds=self.seconds,
        )


def derive(sensor: SensorDescription, *, progress: Progress | None = None) -> Derivation | CurvedDerivation:
    """Compute the response of a sensor's cover by finite elements, and the parameters of its fast model.

    Args:
        sensor: Array, cover and electronics of the sensor.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the array is curved and the cover is not, or the cover cannot be meshed.
        ConvergenceError: If the finite-element solver did not converge.
    """
    if not isinstance(sensor.cover, SolidCover):
        return derive_layers(sensor, progress=progress)
    from validation.curved.derive import derive_curved

    return derive_curved(sensor, progress=progress)


def derive_layers(sensor: SensorDescription, *, progress: Progress | None = None) -> Derivation:
    """Compute the response of a sensor's cover by finite elements, and fit the fast model's parameters to the response.

    Args:
        sensor: Array, cover and electronics of the sensor.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the array is curved.
        ConvergenceError: If the finite-element solver did not converge.
    """
    from fastmodel.parameters import Parameters
    from fem_reference.linear_response.finite_cover import solid_influence
    from fem_reference.linear_response.point_spread import point_spread

    started = time.perf_counter()
    tell = progress or (lambda _: None)
    cover, array = sensor.layered_cover, sensor.array
    if not array.planar:
        raise InputError(
            f"{sensor.source}: array: is curved, and the reference takes planar covers only; derive a flat array of "
            f"its pitch, then exchange the array: dataclasses.replace(fastmodel.load(folder), array=..., tables={{}})"
        )
    wide = cover.size is None
    tell("point spread function by finite elements")
    influence = point_spread(cover) if wide else solid_influence(cover, array, progress=progress)
    point, uniform = (np.asarray(influence.texel_response(array, load=load)) for load in ("point", "uniform"))
    tell("kernel fit")
    fit = fit_kernel(influence, array)
    tell("cover kernels")
    cells = None if sensor.spread else _tabulate_cells(sensor, influence)
    depth = fit_depth(cover) if wide else None
    tip = _press_tip(sensor, influence, tell)
    undetermined = list_undetermined(cover, fit, depth, friction=sensor.friction)
    parameters = Parameters(
        array=array,
        spread=sensor.spread or (fit.gaussian if wide else _tabulate_spread(influence, array)),
        filter=sensor.filter,
        electronics=dataclasses.replace(sensor.electronics, tip_share=None if tip is None else tip.share),
        provenance=_describe_provenance(sensor, fit, depth, undetermined, tip),
        surface=cells,
        tables=_tabulate_response(influence),
    )
    return Derivation(
        sensor=sensor,
        influence=influence,
        texel_response=np.asarray(array.image(point), dtype=np.float64),
        texel_response_uniform=np.asarray(array.image(uniform), dtype=np.float64),
        outside=_force_outside(influence, array),
        fit=fit,
        parameters=_state_range(parameters, sensor, influence, tell),
        error_estimate=influence.error_estimate,
        depth=depth,
        undetermined=undetermined,
        tip=tip,
        seconds=time.perf_counter() - started,
    )


def _press_tip(sensor: SensorDescription, influence: Influence, tell: Progress) -> TipShare | None:
    """Compute the share of the calibration tip's force on the texel; None if it is not needed or not computable."""
    from fem_reference.errors import ConvergenceError

    if sensor.electronics.tip_radius is None:
        return None
    tell("calibration tip over a texel")
    try:
        return compute_tip_share(sensor.layered_cover, sensor.array, influence, sensor.electronics)
    except (ConvergenceError, ValueError) as error:
        tell(f"the share of the calibration tip's force on a texel is not known: {error}")
        return None


def _state_range(parameters: Parameters, sensor: SensorDescription, influence: Influence, tell: Progress) -> Parameters:
    """Add tables under load, where they are useful, and the range in which the fast model holds, where it is known.

    The range is not stated for covers with free side edges, and where the finite elements or the fast model fail.
    """
    from fem_reference.errors import ConvergenceError

    spread = radial_profile(influence)
    if spread is None or parameters.surface is None:
        return parameters
    tell("range of the fast model, by a ball of one pitch radius")
    try:
        presses = press_ball_on_array(sensor.layered_cover, sensor.array, tell)
        return state_range(parameters, sensor.layered_cover, spread, presses)
    except (ConvergenceError, ValueError) as error:
        tell(f"the range of the fast model is not stated: {error}")
        return parameters


def _tabulate_cells(sensor: SensorDescription, influence: Influence) -> CoverCells | None:
    """Tabulate the displacements of cells of the contact grid and the texel forces under a unit load on one cell.

    Returns:
        Both tables; None for a cover with free side edges over texels that do not form a regular grid.
    """
    if (spread := radial_profile(influence)) is not None:
        return cover_cells(sensor.layered_cover, sensor.array, spread)
    return cells_with_sides(sensor.layered_cover, sensor.array, influence) if sensor.array.regular else None


def _tabulate_response(influence: Influence) -> dict[str, FloatArray]:
    """Return radius [m] and pressure per force [1/m2] of the point response; nothing for free side edges."""
    if (spread := radial_profile(influence)) is None:
        return {}
    return {
        "point_response_radius": np.asarray(spread.radius),
        "point_response_pressure": np.asarray(spread.pressure_per_force),
    }


def _tabulate_spread(influence: Influence, array: TexelArray) -> Tabulated:
    """Tabulate the force on every texel per unit force spread uniformly over each texel, for free side edges."""
    columns = [influence.texel_response(array, load="uniform", texel=texel) for texel in range(array.count)]
    return Tabulated(matrix=np.array(columns).T, source="finite elements with free side edges")


def _force_outside(influence: Influence, array: TexelArray) -> tuple[float, float]:
    """Compute the force that no texel measures, under a unit load on the middle texel [-].

    For a wide cover this force is integrated over the radius, independently of the texel forces: that the two add up to
    the load is a check.

    Returns:
        The force under a point load at the texel's centre, and under uniform pressure over the texel [-].
    """
    centre = array.centres[array.middle, :2]
    points, weights = gauss_points(array.texel_size, 12)
    return float(influence.outside(array, centre)[0]), float(weights @ influence.outside(array, centre + points))


def _describe_provenance(
    sensor: SensorDescription,
    fit: Fit,
    depth: DepthFits | None,
    undetermined: tuple[str, ...],
    tip: TipShare | None,
) -> dict[str, Any]:
    from importlib.metadata import version

    return {
        "softcover": version("softcover"),
        "sensor": sensor.name,
        "cover_assumed": sensor.cover.assumed,
        "electronics_assumed": sensor.assumed_electronics,
        "estimator": "given in the sensor file" if sensor.spread else fit.estimator,
        "residual": fit.residual,
        "outside_kernel": fit.outside_kernel,
        "undetermined": undetermined,
        "depth": None if depth is None else dataclasses.asdict(depth),
        "calibration_tip": None if tip is None else dataclasses.asdict(tip),
    }
