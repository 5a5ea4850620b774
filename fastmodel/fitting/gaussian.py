"""Fit of the Gaussian point spread function to texel forces that the finite-element reference computed.

The parameters are the unweighted least-squares fit of the *kernel itself* (sampled at texel centres, cut at ksize, unit
sum) to the response of the texels to uniform pressure on one texel.  Uniform pressure is used because the contact force
on a rigid texel acts on the cover as a pressure over the area of the texel.  A sigma has no meaning without its
estimator: for a thin, nearly incompressible cover, whose response has a narrow core and a long weak tail, sigmas of
different estimators differ by up to a factor of two.  The results therefore list other estimators by name, for
comparison with published widths, which are often given without their definition.  Their values are not used.

`fit_surface_gaussian` fits a Gaussian in surface coordinates to the responses of the texels of a curved cover.  It
describes a cover in two numbers for a report; the contact method `curved` does not use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import ndtr

from fastmodel.errors import FastModelError
from fastmodel.signal.point_spread import Gaussian, find_smallest_kernel, sample_gaussian
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray
from meshes.solids.texels import tangent_axes

#: Two standard deviations of a Gaussian, along x and along y: (sigma_x, sigma_y).
Pair = tuple[float, float]
#: Name of the estimator of `Fit.gaussian`: the unweighted least-squares fit to the response to uniform pressure.
ESTIMATOR = "least-squares-uniform"
#: Smallest and largest sigma in the search for the point spread of a flat cover [pitches].
SIGMA_RANGE = (0.05, 100.0)
#: Smallest and largest sigma in the search for the point spread of a curved cover [pitches].
_RANGE = (0.05, 20.0)
#: Factors on a fitted sigma [-].  The kernel sizes of these sigmas are tried too, in case ksize changes near the sigma.
_NEARBY = (0.99, 1.0, 1.01)
#: Range to which the response at the loaded texel is clipped before the start value of sigma is computed from it [-].
_START_PEAK = (1e-4, 0.9)
#: Range to which the start value of sigma is clipped [pitches].
_START_SIGMA = (0.3, 50.0)
#: Half width, in sigmas, of a kernel that counts as not cut [-].  At this distance a Gaussian is below 1e-31 of its
#: peak.
_UNCUT_REACH = 12
#: Tolerances of the least-squares solver for step, cost and gradient [-], as small as rounding allows.
_TOLERANCE = 1e-15


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A fitted Gaussian point spread function, its misfit, and the widths by other estimators.

    Attributes:
        gaussian: The fitted point spread function.
        residual: Half the sum of absolute differences between response and kernel over the texels, over the load [-].
        outside_kernel: Share of the load that does not act on texels within the kernel, in the response [-].
        estimator: Name of the estimator that gave `gaussian`.
        estimates: (sigma_x, sigma_y) of every estimator, by name [pitches]; nan if an estimator is not defined for the
            response.
    """

    gaussian: Gaussian
    residual: float
    outside_kernel: float
    estimator: str
    estimates: Mapping[str, Pair]


def fit_gaussian(
    response: npt.ArrayLike,
    loaded: tuple[int, int],
    *,
    load: float = 1.0,
    active: npt.ArrayLike | None = None,
    point_response: npt.ArrayLike | None = None,
    radius: npt.ArrayLike | None = None,
    pressure_per_force: npt.ArrayLike | None = None,
    pitch: tuple[float, float] | None = None,
) -> Fit:
    """Fit the Gaussian point spread function to the texel forces under uniform pressure on one texel.

    For sigmas below about 0.26 pitches the kernel is one texel wide, and the response does not determine sigma.

    Args:
        response: Texel forces as an image, shape (rows, columns) [N].
        loaded: Row and column of the loaded texel [-].
        load: Force on that texel [N].
        active: Mask of the texels that measure, shape (rows, columns), by default all [-].
        point_response: Texel forces under a point force of the same size above the centre of the loaded texel, for the
            estimators that require them, shape (rows, columns) [N].
        radius: Distances from a point force, rising from 0, for the radial estimators, shape (m,) [m].
        pressure_per_force: Pressure at the base at these radii per unit point force, shape (m,) [1/m2].
        pitch: Texel pitch along x and y, required with `radius` [m].

    Raises:
        FastModelError: If shapes disagree or the loaded texel is not on the image.
        FastModelError: If a value is not finite, the load is not positive, or only some of `radius`,
            `pressure_per_force` and `pitch` are given.
    """
    image, mask = _check_response(response, loaded, load, active)
    gaussian = _fit_kernel(image, loaded, mask)
    kernel = _place_kernel(gaussian, image.shape, loaded)
    estimates: dict[str, Pair] = {ESTIMATOR: (gaussian.sigma_x, gaussian.sigma_y)}
    estimates["least-squares-uniform-uncut"] = _fit_sigmas(image, loaded, mask, None)
    estimates |= estimate_from_image(image, loaded, "uniform")
    if point_response is not None:
        point, _ = _check_response(point_response, loaded, load, active)
        if point.shape != image.shape:
            raise FastModelError(f"point_response has shape {point.shape} but the response {image.shape}")
        estimates["least-squares-point"] = _fit_sigmas(point, loaded, mask, None)
        estimates |= estimate_from_image(point, loaded, "point")
    if radius is not None or pressure_per_force is not None:
        estimates |= _estimate_radially(radius, pressure_per_force, pitch)
    return Fit(
        gaussian=gaussian,
        residual=float(0.5 * np.abs(image - kernel)[mask].sum()),
        outside_kernel=float(1.0 - image[mask & (kernel > 0)].sum()),
        estimator=ESTIMATOR,
        estimates=estimates,
    )


def _check_response(
    response: npt.ArrayLike, loaded: tuple[int, int], load: float, active: npt.ArrayLike | None
) -> tuple[FloatArray, BoolArray]:
    """Check a response, and return the response per unit load [-] and the mask, both of shape (rows, columns)."""
    image = np.array(response, dtype=np.float64)
    if image.ndim != 2:  # noqa: PLR2004 -- an image
        raise FastModelError(f"a response is an image of shape (rows, columns), not {image.shape}")
    mask = np.ones(image.shape, dtype=bool) if active is None else np.array(active, dtype=bool)
    if mask.shape != image.shape:
        raise FastModelError(f"active has shape {mask.shape} but the response {image.shape}")
    if not (0 <= loaded[0] < image.shape[0] and 0 <= loaded[1] < image.shape[1]):
        raise FastModelError(f"loaded texel {loaded} is not on an image of shape {image.shape}")
    if not np.isfinite(image).all():
        raise FastModelError("the response holds nan or inf")
    if not 0 < load < np.inf:
        raise FastModelError(f"load must be positive, not {load} N")
    return image / load, mask


def _fit_kernel(image: FloatArray, loaded: tuple[int, int], mask: BoolArray) -> Gaussian:
    """Fit sigma by least squares, with ksize determined by sigma (see `Gaussian.from_sigma`).

    The sum of squares is discontinuous at sigmas where ksize changes.  Sigma is therefore fitted at fixed ksize, and
    the fit is repeated with the ksize of the fitted sigma until a ksize occurs again.  Near a discontinuity this
    iteration may end on its worse side.  The kernel sizes of nearby sigmas are therefore tried as well, and the best of
    all fits is returned.
    """
    candidates = [Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, None))]
    tried: set[tuple[int, int]] = set()
    while (ksizes := (candidates[-1].ksize_x, candidates[-1].ksize_y)) not in tried:
        tried.add(ksizes)
        candidates.append(Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, ksizes)))
    last = candidates[-1]
    wide, high = ({find_smallest_kernel(sigma * by) for by in _NEARBY} for sigma in (last.sigma_x, last.sigma_y))
    beside = sorted(set(product(wide, high)) - tried)
    candidates += [Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, each)) for each in beside]

    def misfit(gaussian: Gaussian) -> float:
        return float(np.sum((image - _place_kernel(gaussian, image.shape, loaded))[mask] ** 2))

    return min(reversed(candidates), key=misfit)


def _fit_sigmas(
    image: FloatArray,
    loaded: tuple[int, int],
    mask: BoolArray,
    ksizes: tuple[int, int] | None,
) -> Pair:
    """Fit sigma_x and sigma_y of a Gaussian with unit sum to a response by least squares [pitches].

    Args:
        image: Response per unit load, shape (rows, columns) [-].
        loaded: Row and column of the loaded texel [-].
        mask: Texels that measure, shape (rows, columns) [-].
        ksizes: Widths of the kernel along x and y [texels]; None for a kernel without a cut.
    """

    def difference(logs: FloatArray) -> FloatArray:
        sx, sy = np.exp(logs).tolist()
        kx, ky = ksizes or (2 * int(np.ceil(_UNCUT_REACH * sigma)) + 1 for sigma in (sx, sy))
        gaussian = Gaussian(sigma_x=sx, sigma_y=sy, ksize_x=kx, ksize_y=ky)
        return np.asarray((_place_kernel(gaussian, image.shape, loaded) - image)[mask])

    # The search starts at the width of a Gaussian with the peak of the image, 1 / sqrt(2 pi peak).
    peak = np.clip(image[loaded], *_START_PEAK)
    start = np.full(2, np.log(np.clip(1 / np.sqrt(2 * np.pi * peak), *_START_SIGMA)))
    low, high = np.log(SIGMA_RANGE)
    solution = least_squares(difference, start, bounds=(low, high), xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE)
    sx, sy = np.exp(solution.x)
    return (float(sx), float(sy))


def _place_kernel(gaussian: Gaussian, shape: tuple[int, ...], loaded: tuple[int, int]) -> FloatArray:
    """Sample a point spread function around the loaded texel, cut at the edges of the image, shape (rows, columns) [-].

    Args:
        gaussian: The point spread function.
        shape: Rows and columns of the image.
        loaded: Row and column of the loaded texel.
    """
    along_y, along_x = np.arange(shape[0]) - loaded[0], np.arange(shape[1]) - loaded[1]
    return np.outer(
        sample_gaussian(along_y, gaussian.sigma_y, gaussian.ksize_y),
        sample_gaussian(along_x, gaussian.sigma_x, gaussian.ksize_x),
    )


def _estimate_radially(
    radius: npt.ArrayLike | None, pressure: npt.ArrayLike | None, pitch: tuple[float, float] | None
) -> dict[str, Pair]:
    """Estimate (sigma_x, sigma_y) from the pressure around a point force, by name of the estimator [pitches].

    Args:
        radius: Distances from the point force, rising from 0, shape (m,) [m].
        pressure: Pressure at the base at these distances per unit force, shape (m,) [1/m2].
        pitch: Texel pitch along x and y [m].

    Raises:
        FastModelError: If an argument is missing or has a wrong shape, or a value is not finite.
    """
    if radius is None or pressure is None or pitch is None:
        raise FastModelError("the radial estimators need radius, pressure_per_force and pitch together")
    r, p = np.asarray(radius, dtype=np.float64), np.asarray(pressure, dtype=np.float64)
    if r.ndim != 1 or r.shape != p.shape or np.any(np.diff(r) <= 0):
        raise FastModelError(f"radius must rise and match pressure_per_force; shapes {r.shape} and {p.shape}")
    if not (np.isfinite(p).all() and p[0] > 0):
        raise FastModelError("pressure_per_force must be finite and positive at the first radius")
    return {name: (sigma / pitch[0], sigma / pitch[1]) for name, sigma in estimate_from_profile(r, p).items()}


def estimate_from_image(image: FloatArray, loaded: tuple[int, int], load_name: str) -> dict[str, Pair]:
    """Estimate widths from the texel forces F per unit load on one texel, by name of the estimator [pitches].

    - `variance-*`: sqrt(sum F d^2 / sum F) over the array, with distance d from the loaded texel; nan if negative texel
      forces make the root imaginary.
    - `peak-*`: 1 / sqrt(2 pi F_0), the width of a continuous Gaussian with the force F_0 on the loaded texel as peak.
    - `neighbour-*`: 1 / sqrt(2 ln(F_0 / F_1)), with the mean F_1 of the forces on the two neighbours along the axis.

    Args:
        image: Texel forces per unit load, shape (rows, columns) [-].
        loaded: Row and column of the loaded texel [-].
        load_name: Kind of the load, "uniform" or "point", with which the names of the estimators end.
    """
    row, column = loaded
    peak = _take_root(1 / (2 * np.pi * image[loaded])) if image[loaded] > 0 else float("nan")
    return {
        f"variance-{load_name}": (
            _measure_deviation(image.sum(axis=0), column),
            _measure_deviation(image.sum(axis=1), row),
        ),
        f"peak-{load_name}": (peak, peak),
        f"neighbour-{load_name}": (
            _compare_neighbours(image[row], column),
            _compare_neighbours(image[:, column], row),
        ),
    }


def estimate_from_profile(radius: FloatArray, pressure: FloatArray) -> dict[str, float]:
    """Estimate widths from the pressure p(r) at the base under a unit point load, by name of the estimator [m].

    - `radial-profile`: least-squares fit of exp(-r^2 / 2 s^2) / (2 pi s^2) to p(r), with equal weight per radius (dr).
    - `radial-profile-area`: the same fit with equal weight per area (r dr).
    - `radial-peak`: 1 / sqrt(2 pi p(0)).
    - `radial-half-height`: radius at which p is half its peak, over sqrt(2 ln 2).
    - `radial-half-force`: radius of the circle that carries half the force, over sqrt(2 ln 2).
    - `radial-variance`: sqrt(pi int p r^3 dr); for one bonded layer of thickness h this is h sqrt(nu / (1 - nu)).

    Args:
        radius: Distances r from the load, rising, shape (m,) [m].
        pressure: Pressure p per force at these distances, shape (m,) [1/m2].
    """
    half = float(np.sqrt(2 * np.log(2)))
    rings = 2 * np.pi * radius * pressure
    force = np.append(0.0, np.cumsum(0.5 * (rings[1:] + rings[:-1]) * np.diff(radius)))
    return {
        "radial-profile": _fit_profile(radius, pressure, np.ones_like(radius)),
        "radial-profile-area": _fit_profile(radius, pressure, radius),
        "radial-peak": _take_root(1 / (2 * np.pi * pressure[0])),
        "radial-half-height": _find_crossing(radius, pressure[0] / 2 - pressure) / half,
        "radial-half-force": _find_crossing(radius, force - 0.5) / half,
        "radial-variance": _take_root(float(np.pi * np.trapezoid(pressure * radius**3, radius))),
    }


def _fit_profile(radius: FloatArray, pressure: FloatArray, weight: FloatArray) -> float:
    """Fit the standard deviation s of a Gaussian to a radial profile of pressure with given weights [m]."""

    def misfit(log_sigma: float) -> float:
        s = np.exp(log_sigma)
        model = np.exp(-0.5 * (radius / s) ** 2) / (2 * np.pi * s**2)
        return float(np.trapezoid(weight * (model - pressure) ** 2, radius) / pressure[0] ** 2)

    guess = np.log(_take_root(1 / (2 * np.pi * pressure[0])))
    found = minimize_scalar(misfit, bounds=(guess - 2, guess + 2), method="bounded", options={"xatol": 1e-10})
    return float(np.exp(found.x))


def _find_crossing(radius: FloatArray, rising: FloatArray) -> float:
    """Find the first radius at which a curve that starts below zero crosses zero [m]; nan if there is none.

    The curve is interpolated linearly between samples.
    """
    above = np.flatnonzero(rising >= 0)
    if len(above) == 0 or above[0] == 0:
        return float("nan")
    k = int(above[0])
    share = -rising[k - 1] / (rising[k] - rising[k - 1])
    return float(radius[k - 1] + share * (radius[k] - radius[k - 1]))


def _measure_deviation(profile: FloatArray, loaded: int) -> float:
    """Compute the root of the normalised second moment of a profile about the loaded texel [pitches].

    The result is nan if the sum of the profile is not positive or its second moment is negative.
    """
    offsets = np.arange(len(profile)) - loaded
    if profile.sum() <= 0:
        return float("nan")
    return _take_root(np.sum(profile * offsets**2) / np.sum(profile))


def _compare_neighbours(line: FloatArray, loaded: int) -> float:
    """Estimate a width from the forces on the loaded texel and on its neighbours on a line of texels [pitches].

    The result is nan unless the mean force on the neighbours lies between zero and the force on the loaded texel.
    """
    beside = [line[k] for k in (loaded - 1, loaded + 1) if 0 <= k < len(line)]
    mean = float(np.mean(beside)) if beside else 0.0
    if not 0 < mean < line[loaded]:
        return float("nan")
    return _take_root(0.5 / np.log(line[loaded] / mean))


def _take_root(value: float | np.floating) -> float:
    """Return the square root of a number, or nan if the number is negative."""
    return float(np.sqrt(value)) if value >= 0 else float("nan")


@dataclass(frozen=True, kw_only=True)
class SurfaceGaussian:
    """Gaussian point spread on a curved cover, fitted by unweighted least squares over all pairs of texels.

    The two standard deviations are along the tangent axes of the loaded texel.

    Attributes:
        sigma: Standard deviations along the first and the second tangent axis, on the base [m].
        residual: Half the sum of absolute differences between response and Gaussian over the load, mean over the loaded
            texels [-].
    """

    sigma: tuple[float, float]
    residual: float

    def spread(self, array: TexelArray, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Compute the force on each texel per unit normal force on points of the surface.

        Args:
            array: n texels; inactive ones get no force.
            points: Points above the base or on it, shape (p, 3) [m].
            normals: Unit normals of the surface at these points, shape (p, 3) [-].

        Returns:
            Shares, shape (p, n) [-].
        """
        return _integrate(unroll_from(array, points, normals), np.array(self.sigma), array.texel_size) * array.active


def fit_surface_gaussian(array: TexelArray, response: FloatArray) -> SurfaceGaussian:
    """Fit a Gaussian to the responses of n texels.

    Args:
        array: The texels on the base.
        response: Force on each texel (column) per unit force over each texel (row), shape (n, n) [-].

    Raises:
        FastModelError: If the response is for another number of texels.
    """
    if response.shape != (array.count, array.count):
        raise FastModelError(f"a response of {array.count} texels has shape {(array.count,) * 2}, not {response.shape}")
    place = unroll_from(array, array.centres, array.normals)
    pairs = np.ix_(array.active, array.active)
    place, wanted = place[pairs], response[pairs]

    def differ(logarithm: FloatArray) -> FloatArray:
        return np.asarray(_integrate(place, np.exp(logarithm), array.texel_size) - wanted).ravel()

    bounds = np.log(np.outer(_RANGE, array.pitch))
    found = least_squares(differ, np.log(0.5 * np.array(array.pitch)), bounds=bounds)
    sigma = np.exp(found.x)
    rest = np.abs(found.fun.reshape(wanted.shape)).sum(axis=1) / 2
    return SurfaceGaussian(sigma=(float(sigma[0]), float(sigma[1])), residual=float(rest.mean()))


def unroll_from(array: TexelArray, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Compute the places of all texels in the surface coordinates of points: arc lengths along tangent axes.

    The arc between a point and a texel counts as part of a circle that turns by the angle of their normals, in the
    direction in which the normal turns.  Lengths across this direction are not changed.  This is exact on planes,
    spheres, and cylinders.

    Args:
        array: n texels.
        points: Points of the surface, shape (p, 3) [m].
        normals: Unit normals of the surface at these points, shape (p, 3) [-].

    Returns:
        Places, shape (p, n, 2) [m].
    """
    apart = array.centres[None] - points[:, None]
    axes = tangent_axes(normals)
    flat = np.einsum("lad,ltd->lta", axes, apart)
    turn = np.arccos(np.clip(normals @ array.normals.T, -1.0, 1.0))
    towards = np.einsum("lad,td->lta", axes, array.normals)
    towards /= np.maximum(np.linalg.norm(towards, axis=2, keepdims=True), np.finfo(float).eps)
    # np.sinc(x / pi) is sin(x) / x.  The projection of a chord on the tangent plane is R sin(turn), its arc is R turn.
    longer = 1 / np.maximum(np.sinc(turn / np.pi), np.finfo(float).eps) - 1
    along = np.einsum("lta,lta->lt", flat, towards)
    return np.asarray(flat + (longer * along)[..., None] * towards)


def _integrate(place: FloatArray, sigma: FloatArray, size: tuple[float, float]) -> FloatArray:
    """Integrate a Gaussian around each of p points over the rectangles of n texels, shape (p, n) [-].

    Args:
        place: Places of the texels in the surface coordinates of each point, shape (p, n, 2) [m].
        sigma: Standard deviations along the two coordinates, shape (2,) [m].
        size: Edge lengths of a texel along the two coordinates [m].
    """
    half = np.array(size) / 2
    return np.asarray((ndtr((place + half) / sigma) - ndtr((place - half) / sigma)).prod(axis=-1))
