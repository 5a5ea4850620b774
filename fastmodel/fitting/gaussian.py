"""Fit of the Gaussian point spread function to texel forces that the finite-element reference computed.

The parameters are the unweighted least-squares fit of the *kernel itself* (sampled at texel centres, cut at ksize, unit
sum) to the response of the texels to uniform pressure on one texel.  Uniform pressure is used because the contact force
on a rigid texel acts on the cover as a pressure over the area of the texel.  A sigma has no meaning without its
estimator: for a thin, nearly incompressible cover, whose response has a narrow core and a long weak tail, sigmas of
different estimators differ by up to a factor of two.  The results therefore list other estimators by name.  Their
values are not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError
from fastmodel.fitting.width_estimators import Pair, estimate_from_image, estimate_from_profile
from fastmodel.signal.point_spread import Gaussian, find_smallest_kernel, sample_gaussian
from meshes.array_types import BoolArray, FloatArray

#: Name of the estimator of `Fit.gaussian`: the unweighted least-squares fit to the response to uniform pressure.
ESTIMATOR = "least-squares-uniform"
#: Smallest and largest sigma in the search [pitches].
SIGMA_RANGE = (0.05, 100.0)
#: Factors on a fitted sigma; the kernel sizes of these sigmas are tried too, in case ksize changes near the sigma [-].
_NEARBY = (0.99, 1.0, 1.01)
#: Ranges to which the response at the loaded texel [-], and the sigma that follows from this response [pitches], are
#: clipped to obtain a sigma from which the search starts.
_START_PEAK, _START_SIGMA = (1e-4, 0.9), (0.3, 50.0)
#: Half width, in sigmas, of a kernel that counts as not cut [-]: at this distance a Gaussian is below 1e-31 of its
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

    The sum of squares is discontinuous at sigmas where ksize changes.  So sigma is fitted at fixed ksize, and the fit
    is repeated with the ksize of the fitted sigma until a ksize occurs again.  Near a discontinuity this may end on the
    worse side of it.  So the kernel sizes of nearby sigmas are tried as well, and the best of all fits is returned.
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
    from scipy.optimize import least_squares

    i = np.arange(image.shape[1]) - loaded[1]
    j = np.arange(image.shape[0]) - loaded[0]

    def difference(logs: FloatArray) -> FloatArray:
        sx, sy = (float(each) for each in np.exp(logs))
        kx, ky = ksizes or (_find_uncut_size(sx), _find_uncut_size(sy))
        return np.asarray((np.outer(sample_gaussian(j, sy, ky), sample_gaussian(i, sx, kx)) - image)[mask])

    low, high = np.log(SIGMA_RANGE)
    start = np.log(_guess_sigma(image, loaded))
    solution = least_squares(difference, start, bounds=(low, high), xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=_TOLERANCE)
    sx, sy = np.exp(solution.x)
    return (float(sx), float(sy))


def _guess_sigma(image: FloatArray, loaded: tuple[int, int]) -> Pair:
    """Estimate sigma, for both axes, as that of a Gaussian with the image's peak, 1 / sqrt(2 pi peak) [pitches]."""
    peak = float(np.clip(image[loaded], *_START_PEAK))
    sigma = float(np.clip(1 / np.sqrt(2 * np.pi * peak), *_START_SIGMA))
    return (sigma, sigma)


def _find_uncut_size(sigma: float) -> int:
    """Find the odd width of a kernel that contains the whole Gaussian up to rounding [texels]."""
    return 2 * int(np.ceil(_UNCUT_REACH * sigma)) + 1


def _place_kernel(gaussian: Gaussian, shape: tuple[int, ...], loaded: tuple[int, int]) -> FloatArray:
    """Sample the kernel around the loaded texel, cut at the edges of the image, shape (rows, columns) [-]."""
    gx = sample_gaussian(np.arange(shape[1]) - loaded[1], gaussian.sigma_x, gaussian.ksize_x)
    gy = sample_gaussian(np.arange(shape[0]) - loaded[0], gaussian.sigma_y, gaussian.ksize_y)
    return np.outer(gy, gx)


def _estimate_radially(
    radius: npt.ArrayLike | None, pressure: npt.ArrayLike | None, pitch: tuple[float, float] | None
) -> dict[str, Pair]:
    """Compute (sigma_x, sigma_y) of the radial estimators, by name [pitches]; arguments as for `fit_gaussian`."""
    if radius is None or pressure is None or pitch is None:
        raise FastModelError("the radial estimators need radius, pressure_per_force and pitch together")
    r, p = np.asarray(radius, dtype=np.float64), np.asarray(pressure, dtype=np.float64)
    if r.ndim != 1 or r.shape != p.shape or np.any(np.diff(r) <= 0):
        raise FastModelError(f"radius must rise and match pressure_per_force; shapes {r.shape} and {p.shape}")
    if not (np.isfinite(p).all() and p[0] > 0):
        raise FastModelError("pressure_per_force must be finite and positive at the first radius")
    return {name: (sigma / pitch[0], sigma / pitch[1]) for name, sigma in estimate_from_profile(r, p).items()}
