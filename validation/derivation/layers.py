"""Derivation for a cover of planar layers: forces on the texels by finite elements, and fits of the fast model.

Finite elements give the forces on the texels under loads on the cover.  The Gaussian spread kernel of the fast model is
fitted to these forces.  The result also holds figures that show the quality of the fit: the value of every estimator,
the residual, the force beyond the kernel, the error estimate of the finite elements, resolution and sensitivities.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from fastmodel.fitting.gaussian import Fit
from fastmodel.signal.point_spread import Spread, Tabulated
from meshes import Cover
from meshes.array_types import FloatArray
from validation.derivation.base import Progress, derive_cover, describe_provenance
from validation.derivation.contact_range import (
    DepthFits,
    TipShare,
    compute_tip_share,
    find_saturation,
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
    sigma_range,
    sigma_sensitivities,
    texel_separation,
    two_point_separation,
)
from validation.errors import at
from validation.results.derivation import Kernel, PointResponse, Responses
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters
    from fem_reference.linear_response.point_spread import PointSpread


#: Share of a load that a kernel puts on wrong texels below which a Gaussian describes the spread well [-].
_GOOD_RESIDUAL = 0.05


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class LayeredDerivation:
    """The finite-element response of planar layers, and the parameters of the sensor's fast model.

    Attributes:
        sensor: Description of the sensor.
        influence: Finite-element response of the texels to loads on the cover.
        fit: The fitted spread kernel and its residual.
        parameters: Parameters of the fast model.
        depth: Contact stiffnesses fitted to the depth of a sphere; None for a cover with free side edges.
        tip: Share of the calibration tip's force that the texel under the tip measures; None if the curve from force to
            counts was calibrated against the texel force, or if the finite elements failed.
        seconds: Wall time of the derivation, without the properties that are computed on first use [s].
    """

    sensor: SensorDescription
    influence: Influence
    fit: Fit
    parameters: Parameters
    depth: DepthFits | None
    tip: TipShare | None
    seconds: float

    def _respond(self, load: Literal["point", "uniform"]) -> FloatArray:
        array = self.sensor.array
        return np.asarray(array.image(self.influence.texel_response(array, load=load)), dtype=np.float64)

    @cached_property
    def texel_response(self) -> FloatArray:
        """Forces on the texels under a unit point load over the middle texel's centre, shape (rows, columns) [-]."""
        return self._respond("point")

    @cached_property
    def texel_response_uniform(self) -> FloatArray:
        """Forces under unit force as uniform pressure over the middle texel, shape (rows, columns) [-]."""
        return self._respond("uniform")

    @cached_property
    def outside(self) -> tuple[float, float]:
        """Forces that no texel measures under a unit point load and a unit uniform load over the middle texel [-].

        For a wide cover they are integrated over the radius, independently of the texel forces.  The sum of both must
        be the load, which is a check.
        """
        array, influence = self.sensor.array, self.influence
        centre = array.centres[array.middle, :2]
        points, weights = gauss_points(array.texel_size, 12)
        return float(influence.outside(array, centre)[0]), float(weights @ influence.outside(array, centre + points))

    @property
    def error_estimate(self) -> Mapping[str, float]:
        """Estimated relative errors of the finite elements (`total_force`, `peak_texel`, `sigma`) [-]."""
        return self.influence.error_estimate

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Quantities that the derivation cannot determine, one line of text each."""
        sensor = self.sensor
        return list_undetermined(sensor.layered_cover, self.fit, self.depth, friction=sensor.friction)

    @property
    def point_spread(self) -> PointSpread | None:
        """Response of a wide cover as a radial profile; None with free side edges, where it depends on the position."""
        return radial_profile(self.influence)

    @property
    def sigma(self) -> float:
        """Standard deviation of the fitted Gaussian along x [m]."""
        return self.fit.gaussian.sigma_x * self.sensor.array.pitch[0]

    @property
    def own_share(self) -> Mapping[str, float]:
        """Share of a load over the middle texel that this texel measures, by the load [-]."""
        row, column = divmod(self.sensor.array.middle, self.sensor.array.columns)
        point, uniform = (np.atleast_2d(each) for each in (self.texel_response, self.texel_response_uniform))
        return {"point": float(point[row, column]), "uniform": float(uniform[row, column])}

    @property
    def maps(self) -> Mapping[str, FloatArray]:
        """Forces under a point load and a uniform load on the middle texel, and those of the fitted kernel."""
        array = self.sensor.array
        return {
            "point load": self.texel_response.ravel(),
            "uniform load": self.texel_response_uniform.ravel(),
            "fitted kernel": self.fit.gaussian.operator(array)[:, array.middle],
        }

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

    @cached_property
    def result(self) -> Responses:
        """Results of the derivation that are written to files."""
        sensor, fit, spread = self.sensor, self.fit, self.point_spread
        estimates = {name: pair for name, pair in fit.estimates.items() if np.isfinite(pair).all()}
        return Responses(
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
            resolution=None if spread is None else two_point_separation(spread),
            resolution_on_array=None if spread is None else texel_separation(spread, sensor.array),
            sigma_range=None if spread is None else self._find_range(spread),
            sensitivity={} if spread is None else sigma_sensitivities(sensor.layered_cover, sensor.array, spread),
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

    def _find_range(self, spread: PointSpread) -> tuple[float, float] | None:
        """Return the ends of sigma along x over the ranges of the materials [pitches]; None if none is stated."""
        ends = sigma_range(self.sensor.layered_cover, self.sensor.array, spread)
        return ends and (ends[0] * self.fit.gaussian.sigma_x, ends[1] * self.fit.gaussian.sigma_x)

    def explain(self) -> Iterator[str]:
        """Yield sentences about the kernel and the range of the fast model, and what is not determined."""
        residual, validity = self.fit.residual, self.parameters.validity
        yield (
            f"The Gaussian kernel puts {100 * residual:.1f} % of a load on wrong texels (good: below "
            f"{100 * _GOOD_RESIDUAL:.0f} %)."
        )
        if residual > _GOOD_RESIDUAL:
            yield (
                "The real spread has a narrow core and a long, weak tail, which no Gaussian follows; simulators that "
                "know kernels only (Gazebo) have this error."
            )
        if self.fit.outside_kernel < 0:
            yield "The force beyond the kernel is negative: near incompressibility the base is pulled at some distance."
        if self.point_spread is None:
            yield "Side edges are free: the spread differs from place to place; sigma is that of the middle texel."
        if validity is None:
            yield "The range of the fast model is not known here; compare your own touches by `softcover press`."
        elif validity.load_5_percent > 0:
            good = validity.load_2_percent > 0
            load = validity.load_2_percent if good else validity.load_5_percent
            yield (
                "The fast model does not use the kernel but the spread itself. Under a ball of "
                f"{1e3 * validity.ball_radius:.3g} mm radius it puts {'at most 2 %' if good else '2 to 5 % (usable)'} "
                f"of the force on wrong texels up to {load:.3g} N, at {validity.strain} strain; compare your own "
                "touches by `softcover press`."
            )
        else:
            yield (
                "The fast model puts more than 5 % of the force on wrong texels under a ball at every load compared: "
                "take the finite elements (`softcover press --model fem`)."
            )
        if self.tip is not None:
            yield (
                f"The texel under a calibration tip measures {self.tip.lightest:.4f} of a point load and "
                f"{self.tip.heaviest:.4f} of {self.tip.largest_load:.3g} N; the share is fitted up to this load."
            )
        for line in self.undetermined:
            yield f"Not determined: {line}."


@derive_cover.register(Cover)
def _(cover: Cover, sensor: SensorDescription, progress: Progress | None = None) -> LayeredDerivation:
    """Compute the response of planar layers by finite elements, and fit the fast model's parameters to the response.

    Raises:
        InputError: If the array is curved.
        ConvergenceError: If the finite-element solver did not converge.
    """
    from fastmodel.parameters import Parameters
    from fem_reference.linear_response.axisymmetric import point_spread
    from fem_reference.linear_response.finite_cover import solid_influence

    started = time.perf_counter()
    tell = progress or (lambda _: None)
    array = sensor.array
    with at(f"{sensor.source}: array: "):
        array.require_planar()
    wide = cover.size is None
    tell("point spread function by finite elements")
    influence = point_spread(cover) if wide else solid_influence(cover, array, progress=progress)
    tell("kernel fit")
    fit = fit_kernel(influence, array)
    tell("cover kernels")
    profile = radial_profile(influence)
    cells = None
    spread: Spread = sensor.spread or fit.gaussian
    if sensor.spread is None and profile is not None:
        cells = cover_cells(cover, array, profile)
    elif sensor.spread is None:
        # Near free side edges the spread of each texel is a table of its own.
        columns = [influence.texel_response(array, load="uniform", texel=texel) for texel in range(array.count)]
        spread = Tabulated(matrix=np.array(columns).T, source="finite elements with free side edges")
        cells = cells_with_sides(cover, array, influence) if array.regular else None
    depth = fit_depth(cover) if wide else None
    tip, radius = None, sensor.electronics.tip_radius
    if radius is not None:
        tell("calibration tip over a texel")
        with _told(tell, "the share of the calibration tip's force on a texel is not known"):
            saturation = find_saturation(sensor.electronics)
            tip = compute_tip_share(cover, array, influence, radius=radius, saturation=saturation)
    parameters = Parameters(
        array=array,
        spread=spread,
        filter=sensor.filter,
        electronics=dataclasses.replace(sensor.electronics, tip_share=None if tip is None else tip.share),
        provenance=describe_provenance(sensor)
        | {
            "estimator": "given in the sensor file" if sensor.spread else fit.estimator,
            "residual": fit.residual,
            "outside_kernel": fit.outside_kernel,
            "undetermined": list_undetermined(cover, fit, depth, friction=sensor.friction),
            "depth": None if depth is None else dataclasses.asdict(depth),
            "calibration_tip": None if tip is None else dataclasses.asdict(tip),
        },
        surface=cells,
        # Response to a point load: radius [m] and pressure per force [1/m2].
        tables={}
        if profile is None
        else {
            "point_response_radius": np.asarray(profile.radius),
            "point_response_pressure": np.asarray(profile.pressure_per_force),
        },
    )
    # The range is not stated for covers with free side edges, and where the finite elements or the fast model fail.
    if profile is not None and cells is not None:
        tell("range of the fast model, by a ball of one pitch radius")
        with _told(tell, "the range of the fast model is not stated"):
            presses = press_ball_on_array(cover, array, tell)
            tell("fast model under the same ball")
            parameters = state_range(parameters, cells, cover, profile, presses)
    return LayeredDerivation(
        sensor=sensor,
        influence=influence,
        fit=fit,
        parameters=parameters,
        depth=depth,
        tip=tip,
        seconds=time.perf_counter() - started,
    )


@contextmanager
def _told(tell: Progress, what: str) -> Iterator[None]:
    """Catch errors of finite elements and of the fast model, and tell the user what is missing and why.

    Args:
        tell: Function that receives the line for the user.
        what: Statement of what is missing.
    """
    from fem_reference.errors import ConvergenceError

    try:
        yield
    except (ConvergenceError, ValueError) as error:
        tell(f"{what}: {error}")
