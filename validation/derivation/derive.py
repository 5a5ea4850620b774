"""Derive = reference + fit: from a cover to the parameters of the fast model.

The finite elements give the point spread function of the cover; its texel responses are what the Gaussian kernel is
fitted to.  Everything that a reader needs to judge the result goes with it: every estimator's value, the residual,
the force beyond the kernel, the error estimate of the reference, resolution and sensitivities.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fastmodel.fitting.gaussian import Fit, fit_gaussian
from fastmodel.signal.point_spread import Spread, Tabulated
from meshes import Cover, TexelArray
from validation.derivation.depth_fits import DepthFits, fit_depth, not_determined
from validation.derivation.resolution import texel_separation, two_point_separation
from validation.errors import InputError
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters
    from fastmodel.pressure.cover_kernels import CoverCells
    from fem_reference.linear_response.finite_cover import SolidInfluence
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]

#: Relative step of thickness and absolute step of Poisson ratio in the sensitivities [-].
_THICKNESS_STEP = 0.02
_POISSON_STEP = 0.005
#: Rows and columns of the grid that the kernel is fitted on where texels lie on none.
_WIDE = 15


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Derivation:
    """What a cover does to a touch, and the fast model's parameters for it.

    Attributes:
        sensor: What it was derived from.
        influence: The reference's response to loads on the cover.
        texel_response: Response to a unit point load over the middle texel's centre, shape (rows, columns) [-].
        texel_response_uniform: The same for unit force as uniform pressure over that texel [-].
        outside: Force beyond the array of the two responses [-].
        fit: The fitted kernel and how well it fits.
        parameters: What the fast model needs.
        error_estimate: Relative errors of the reference (`total_force`, `peak_texel`, `sigma`) [-].
        depth: Fits to how deep a ball goes; None with free side edges.
        undetermined: What the data cannot tell, a line each.
        seconds: Wall time, without what is worked out only where it is asked for [s].
    """

    sensor: SensorDescription
    influence: PointSpread | SolidInfluence
    texel_response: FloatArray
    texel_response_uniform: FloatArray
    outside: tuple[float, float]
    fit: Fit
    parameters: Parameters
    error_estimate: Mapping[str, float]
    depth: DepthFits | None
    undetermined: tuple[str, ...]
    seconds: float

    @property
    def point_spread(self) -> PointSpread | None:
        """The response as a radial profile; None where free side edges make it differ from place to place."""
        from fem_reference.linear_response.point_spread import PointSpread

        return self.influence if isinstance(self.influence, PointSpread) else None

    @cached_property
    def resolution(self) -> float | None:
        """Smallest separation of two equal point loads with a dip of base pressure between [m].

        None with free side edges.
        """
        return None if (spread := self.point_spread) is None else two_point_separation(spread)

    @cached_property
    def resolution_on_array(self) -> float | None:
        """The same for texel values, in the worst alignment; nan if there is none, None with free side edges [m]."""
        return None if (spread := self.point_spread) is None else texel_separation(spread, self.sensor.array)

    @cached_property
    def sensitivity(self) -> Mapping[str, float]:
        """Derivatives of sigma_x of the uncut kernel, all layers changed together; none with free side edges.

        `thickness` [pitches/m], `poisson_ratio` [pitches] and `youngs_modulus`, which is exactly 0 [pitches/Pa].
        """
        return {} if (spread := self.point_spread) is None else _sensitivity(self.sensor, spread)

    def as_json(self) -> dict[str, Any]:
        """The result under the names that the command line prints."""
        gaussian = self.fit.gaussian
        return {
            "sensor": self.sensor.name,
            "cover": describe_cover(self.sensor.cover),
            "psf": {
                "sigma_x": gaussian.sigma_x,
                "sigma_y": gaussian.sigma_y,
                "ksize_x": gaussian.ksize_x,
                "ksize_y": gaussian.ksize_y,
                "estimator": self.fit.estimator,
                "estimates": {name: list(pair) for name, pair in self.fit.estimates.items()},
                "residual": self.fit.residual,
                "outside_kernel": self.fit.outside_kernel,
            },
            "texel_response": self.texel_response,
            "texel_response_outside": self.outside[0],
            "texel_response_uniform": self.texel_response_uniform,
            "texel_response_uniform_outside": self.outside[1],
            "point_response": None
            if (spread := self.point_spread) is None
            else {"radius_m": spread.radius, "pressure_per_force": spread.pressure_per_force},
            "error_estimate": dict(self.error_estimate),
            "resolution": self.resolution,
            "resolution_on_array": self.resolution_on_array,
            "sensitivity": dict(self.sensitivity),
            "depth": None if self.depth is None else self.depth.as_plain(),
            "undetermined": list(self.undetermined),
            "seconds": self.seconds,
        }


def derive(sensor: SensorDescription, *, progress: Progress | None = None) -> Derivation:
    """Derive the point spread function of a sensor's cover and fit the fast model's kernel to it.

    Args:
        sensor: Array, cover and electronics.
        progress: Told what is being done.

    Raises:
        InputError: If the array is curved.
        ConvergenceError: If the reference did not converge.
    """
    from fastmodel.parameters import Parameters
    from fem_reference.linear_response.finite_cover import solid_influence
    from fem_reference.linear_response.point_spread import PointSpread, point_spread

    started = time.perf_counter()
    tell = progress or (lambda _: None)
    array = _planar_array(sensor)
    wide = sensor.cover.size is None
    tell("point spread function by finite elements")
    spread = point_spread(sensor.cover) if wide else solid_influence(sensor.cover, array, progress=progress)
    point = np.asarray(spread.texel_response(array, load="point"))
    uniform = np.asarray(spread.texel_response(array, load="uniform"))
    tell("kernel fit")
    fit = _fit_on(spread, array, point, uniform)
    tell("cover between cells")
    cells = _cells(sensor, spread)
    radial = spread if isinstance(spread, PointSpread) else None
    depth = fit_depth(sensor.cover) if wide else None
    undetermined = not_determined(sensor, fit, depth)
    return Derivation(
        sensor=sensor,
        influence=spread,
        texel_response=np.asarray(array.image(point), dtype=np.float64),
        texel_response_uniform=np.asarray(array.image(uniform), dtype=np.float64),
        outside=_outside(spread, array),
        fit=fit,
        parameters=Parameters(
            array=array,
            spread=sensor.spread or _spread(spread, array, fit),
            filter=sensor.filter,
            electronics=sensor.electronics,
            provenance=_provenance(sensor, fit, depth, undetermined),
            cells=cells,
            tables={} if radial is None else _radial_tables(radial),
        ),
        error_estimate=spread.error_estimate,
        depth=depth,
        undetermined=undetermined,
        seconds=time.perf_counter() - started,
    )


def _planar_array(sensor: SensorDescription) -> TexelArray:
    """The sensor's array, refused where it is curved: the reference knows no such cover."""
    if sensor.array.planar:
        return sensor.array
    raise InputError(
        f"{sensor.source}: array: the reference knows planar covers only; derive a flat array of its pitch, and "
        f"give its parameters the curved one: dataclasses.replace(fastmodel.load(folder), array=..., tables={{}})"
    )


def describe_cover(cover: Cover) -> dict[str, Any]:
    """The cover as plain data, with its label where it is assumed."""
    return {
        "assumed": cover.assumed,
        "base": cover.base,
        "size_m": cover.size,
        "thickness_m": cover.thickness,
        "layers": [
            {
                "thickness_m": layer.thickness,
                "material": layer.material.name,
                "model": layer.material.model,
                "youngs_modulus": layer.material.youngs_modulus,
                "poisson_ratio": layer.material.poisson_ratio,
                "source": layer.material.source,
                "spread": layer.material.spread,
            }
            for layer in cover.layers
        ],
    }


def _spread(influence: PointSpread | SolidInfluence, array: TexelArray, fit: Fit) -> Spread:
    """The kernel of a wide cover; with free side edges what force spread evenly over each texel puts on all of them."""
    from fem_reference.linear_response.point_spread import PointSpread

    if isinstance(influence, PointSpread):
        return fit.gaussian
    columns = [influence.texel_response(array, load="uniform", texel=texel) for texel in range(array.count)]
    return Tabulated(matrix=np.array(columns).T, source="finite elements with free side edges")


def _outside(spread: PointSpread | SolidInfluence, array: TexelArray) -> tuple[float, float]:
    """Force beyond the array under a unit point load on the middle texel and under uniform pressure there [-].

    Of a wide cover integrated over the radius, apart from the texels, so that the balance of the two is a check.
    """
    from fem_reference.linear_response.point_spread import PointSpread

    centre = array.centres[array.middle, :2]
    nodes, weights = np.polynomial.legendre.leggauss(2 if isinstance(spread, PointSpread) else 12)
    x, y = np.meshgrid(nodes * array.texel_size[0] / 2, nodes * array.texel_size[1] / 2)
    places = centre + np.column_stack([x.ravel(), y.ravel()])
    if isinstance(spread, PointSpread):
        point, even = spread.outside(array, centre, angles=90), spread.outside(array, places, angles=40)
    else:
        point, even = spread.outside(array, centre), spread.outside(array, places)
    return float(point[0]), float(np.outer(weights, weights).ravel() / 4 @ even)


def _cells(sensor: SensorDescription, spread: PointSpread | SolidInfluence) -> CoverCells | None:
    """The cover between cells, where the array is even and no other spread asked for."""
    from fem_reference.linear_response.point_spread import PointSpread
    from validation.derivation.cover_kernels import cells_with_sides, cover_cells

    if sensor.spread is not None:
        return None
    if isinstance(spread, PointSpread):
        return cover_cells(sensor.cover, sensor.array, spread)
    return cells_with_sides(sensor.cover, sensor.array, spread) if sensor.array.even else None


def _fit_on(
    spread: PointSpread | SolidInfluence, array: TexelArray, point: FloatArray | None, uniform: FloatArray
) -> Fit:
    """The fit on the array's own image where that is a grid, else on the image of a grid of its pitch."""
    if array.even:
        return _fit(spread, array, point, uniform)
    grid = _grid_of(array)
    responses = (np.asarray(spread.texel_response(grid, load=load)) for load in ("point", "uniform"))
    return _fit(spread, grid, *responses)


def _grid_of(array: TexelArray) -> TexelArray:
    """A grid of an array's pitch and texels, wide enough for a kernel."""
    return TexelArray.grid(_WIDE, _WIDE, array.pitch, texel_size=array.texel_size)


def _fit(spread: PointSpread | SolidInfluence, array: TexelArray, point: FloatArray | None, uniform: FloatArray) -> Fit:
    from fem_reference.linear_response.point_spread import PointSpread

    radial = spread if isinstance(spread, PointSpread) else None
    return fit_gaussian(
        array.image(uniform),
        (array.rows // 2, array.columns // 2),
        active=array.image(array.active),
        point_response=None if point is None else array.image(point),
        radius=None if radial is None else radial.radius,
        pressure_per_force=None if radial is None else radial.pressure_per_force,
        pitch=array.pitch,
    )


def _sensitivity(sensor: SensorDescription, spread: PointSpread) -> dict[str, float]:
    """Derivatives of sigma_x: by thickness from the scaling law, by Poisson ratio from the exact layer, by E none.

    Of the uncut kernel: the smallest ksize that holds 99.9 % jumps, and the cut kernel's sigma with it.
    """
    array, height = sensor.array if sensor.array.even else _grid_of(sensor.array), sensor.cover.thickness
    # The response of a cover scaled by s to an array equals that of the cover itself to the array scaled by 1 / s.
    thicker, thinner = (_sigma(spread, _scaled(array, 1 / (1 + step))) for step in (_THICKNESS_STEP, -_THICKNESS_STEP))
    return {
        "thickness": (thicker - thinner) / (2 * _THICKNESS_STEP * height),
        "poisson_ratio": sum(_poisson_slope(sensor, array, spread, index) for index in range(len(sensor.cover.layers))),
        # Multiplying all moduli by a number multiplies all displacements by its inverse, and no force.
        "youngs_modulus": 0.0,
    }


def _poisson_slope(sensor: SensorDescription, array: TexelArray, spread: PointSpread, index: int) -> float:
    """Derivative of sigma_x by one layer's Poisson ratio: slope of a parabola through three ratios in their range."""
    here = sensor.cover.layers[index].material.poisson_ratio
    middle = float(np.clip(here, _POISSON_STEP, 0.5 - _POISSON_STEP))

    def at(ratio: float) -> float:
        return _sigma(_exact(_with_poisson_ratio(sensor.cover, index, ratio), spread), array)

    low, high = at(middle - _POISSON_STEP), at(middle + _POISSON_STEP)
    slope = (high - low) / (2 * _POISSON_STEP)
    if here == middle:  # a parabola's slope midway is that of its chord
        return slope
    return slope + (here - middle) * (high - 2 * at(middle) + low) / _POISSON_STEP**2


def _exact(cover: Cover, spread: PointSpread) -> PointSpread:
    """The exact layer solution: a derivative needs two more covers, and elements would triple the wait."""
    from fem_reference.closed_form import point_response

    return dataclasses.replace(spread, pressure_per_force=point_response(cover, spread.radius), coarse=())


def _sigma(spread: PointSpread, array: TexelArray) -> float:
    uniform = np.asarray(spread.texel_response(array, load="uniform"))
    return _fit(spread, array, None, uniform).estimates["least-squares-uniform-uncut"][0]


def _scaled(array: TexelArray, factor: float) -> TexelArray:
    return dataclasses.replace(
        array,
        centres=array.centres * factor,
        texel_size=(array.texel_size[0] * factor, array.texel_size[1] * factor),
        pitch=(array.pitch[0] * factor, array.pitch[1] * factor),
    )


def _with_poisson_ratio(cover: Cover, index: int, ratio: float) -> Cover:
    """The cover with another Poisson ratio in one layer."""
    layers = list(cover.layers)
    material = dataclasses.replace(layers[index].material, poisson_ratio=ratio)
    layers[index] = dataclasses.replace(layers[index], material=material)
    return dataclasses.replace(cover, layers=tuple(layers))


def _radial_tables(spread: PointSpread) -> dict[str, FloatArray]:
    """The radial profile as the parameter folder keeps it: radii [m] and pressure per force [1/m²]."""
    return {
        "point_response_radius": np.asarray(spread.radius),
        "point_response_pressure": np.asarray(spread.pressure_per_force),
    }


def _provenance(
    sensor: SensorDescription, fit: Fit, depth: DepthFits | None, undetermined: tuple[str, ...]
) -> dict[str, Any]:
    from importlib.metadata import version

    return {
        "softcover": version("softcover"),
        "sensor": sensor.name,
        "cover_assumed": sensor.cover.assumed,
        "estimator": "given in the sensor file" if sensor.spread else fit.estimator,
        "residual": fit.residual,
        "outside_kernel": fit.outside_kernel,
        "undetermined": undetermined,
        "depth": None if depth is None else depth.as_plain(),
    }
