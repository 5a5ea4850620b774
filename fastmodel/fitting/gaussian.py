"""Fitting the Gaussian point spread function to a reference response.

A sigma without its estimator means nothing: for a thin, nearly incompressible cover they differ by a factor
of two, because the true response has a narrow core and a long weak tail.  The parameters are the unweighted
least-squares fit of the *kernel itself* (sampled, cut at ksize, unit sum) to the response to uniform pressure
on one texel, since a force spread over a texel is what a rigid texel passes on.  Every other estimator is
listed beside it by name and never used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError, ShapeError
from fastmodel.fitting.width_estimators import Pair, image_estimates, radial_estimates
from fastmodel.signal.point_spread import Gaussian, find_smallest_kernel, sample_gaussian

FloatArray = npt.NDArray[np.float64]

#: The estimator that the parameters come from.
ESTIMATOR = "least-squares-uniform"
#: Range of sigma that is searched [pitches].
SIGMA_RANGE = (0.05, 100.0)
#: Factors on a fitted sigma between which a jump of ksize counts as near [-].
_ABOUT = (0.99, 1.0, 1.01)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A fitted Gaussian, how well it fits, and what the other estimators say.

    Attributes:
        gaussian: The point spread function.
        residual: Half the summed absolute difference between response and kernel, over the load [-].
        outside_kernel: Share of the load that the reference does not put on texels inside the kernel [-].
        estimator: Name of the estimator that `gaussian` comes from.
        estimates: Every estimator's (sigma_x, sigma_y) by name [pitches]; nan where it does not exist.
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
    """Fit the Gaussian to the texel response to uniform pressure over one texel.

    Below about 0.26 pitches the kernel is one texel wide and its sigma cannot be told from the response.

    Args:
        response: Texel forces as an image, shape (rows, columns) [N].
        loaded: Row and column of the loaded texel [-].
        load: Force on that texel [N].
        active: Which texels measure, shape (rows, columns); all when not given.
        point_response: Texel forces under the same force on a point over the texel's centre, same shape,
            for the estimators that use it [N].
        radius: Radii of the point response at the base, shape (m,), rising from 0, for the radial
            estimators [m].
        pressure_per_force: Base pressure at these radii per unit force, shape (m,) [1/m2].
        pitch: Texel pitch along x and y, needed with `radius` [m].

    Raises:
        ShapeError: If shapes disagree or the loaded texel is not on the image.
        FastModelError: If a value is not finite, the load is not positive, or the radial profile comes
            incomplete.
    """
    image, mask = _checked(response, loaded, load, active)
    gaussian = _fit_kernel(image, loaded, mask)
    kernel = _placed(gaussian, image.shape, loaded)
    estimates: dict[str, Pair] = {ESTIMATOR: (gaussian.sigma_x, gaussian.sigma_y)}
    estimates["least-squares-uniform-uncut"] = _fit_sigmas(image, loaded, mask, None)
    estimates |= image_estimates(image, loaded, "uniform")
    if point_response is not None:
        point, _ = _checked(point_response, loaded, load, active)
        estimates["least-squares-point"] = _fit_sigmas(point, loaded, mask, None)
        estimates |= image_estimates(point, loaded, "point")
    if radius is not None or pressure_per_force is not None:
        estimates |= _radial(radius, pressure_per_force, pitch)
    return Fit(
        gaussian=gaussian,
        residual=float(0.5 * np.abs(image - kernel)[mask].sum()),
        outside_kernel=float(1.0 - image[mask & (kernel > 0)].sum()),
        estimator=ESTIMATOR,
        estimates=estimates,
    )


def _checked(
    response: npt.ArrayLike, loaded: tuple[int, int], load: float, active: npt.ArrayLike | None
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """The response per unit load and the mask, both of shape (rows, columns)."""
    image = np.array(response, dtype=np.float64)
    if image.ndim != 2:  # noqa: PLR2004 -- an image
        raise ShapeError(f"a response is an image of shape (rows, columns), not {image.shape}")
    mask = np.ones(image.shape, dtype=bool) if active is None else np.array(active, dtype=bool)
    if mask.shape != image.shape:
        raise ShapeError(f"active has shape {mask.shape} but the response {image.shape}")
    if not (0 <= loaded[0] < image.shape[0] and 0 <= loaded[1] < image.shape[1]):
        raise ShapeError(f"loaded texel {loaded} is not on an image of shape {image.shape}")
    if not np.isfinite(image).all():
        raise FastModelError("the response holds nan or inf")
    if not 0 < load < np.inf:
        raise FastModelError(f"load must be positive, not {load} N")
    return image / load, mask


def _fit_kernel(image: FloatArray, loaded: tuple[int, int], mask: npt.NDArray[np.bool_]) -> Gaussian:
    """Least squares over sigma with ksize following sigma by its own rule.

    The rule makes the objective jump where ksize does, so sigma is fitted at fixed ksize until both agree.  About such
    a jump they may agree or alternate on either side: there the best of the kernels that obey the rule is taken.
    """
    candidates = [Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, None))]
    tried: set[tuple[int, int]] = set()
    while (ksizes := (candidates[-1].ksize_x, candidates[-1].ksize_y)) not in tried:
        tried.add(ksizes)
        candidates.append(Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, ksizes)))
    last = candidates[-1]
    wide, high = ({find_smallest_kernel(sigma * by) for by in _ABOUT} for sigma in (last.sigma_x, last.sigma_y))
    beside = sorted(set(product(wide, high)) - tried)
    candidates += [Gaussian.from_sigma(*_fit_sigmas(image, loaded, mask, each)) for each in beside]

    def misfit(gaussian: Gaussian) -> float:
        return float(np.sum((image - _placed(gaussian, image.shape, loaded))[mask] ** 2))

    return min(reversed(candidates), key=misfit)


def _fit_sigmas(
    image: FloatArray,
    loaded: tuple[int, int],
    mask: npt.NDArray[np.bool_],
    ksizes: tuple[int, int] | None,
) -> Pair:
    """Sigmas of the unit-sum Gaussian nearest to the image, with given kernel widths or uncut."""
    from scipy.optimize import least_squares

    i = np.arange(image.shape[1]) - loaded[1]
    j = np.arange(image.shape[0]) - loaded[0]

    def parts(logs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        sx, sy = np.exp(logs)
        kx, ky = ksizes or (_uncut(sx), _uncut(sy))
        return (*_axis(i, float(sx), kx), *_axis(j, float(sy), ky))

    def difference(logs: FloatArray) -> FloatArray:
        gx, _, gy, _ = parts(logs)
        return np.asarray((np.outer(gy, gx) - image)[mask])

    def jacobian(logs: FloatArray) -> FloatArray:
        gx, dx, gy, dy = parts(logs)
        return np.stack([np.outer(gy, dx)[mask], np.outer(dy, gx)[mask]], axis=1)

    low, high = np.log(SIGMA_RANGE)
    start = np.log(_first_guess(image, loaded))
    solution = least_squares(difference, start, jac=jacobian, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    sx, sy = np.exp(solution.x)
    return (float(sx), float(sy))


def _axis(offsets: npt.NDArray[np.int64], sigma: float, ksize: int) -> tuple[FloatArray, FloatArray]:
    """One axis of the kernel and its derivative by log sigma: g (d^2 - <d^2>) / sigma^2."""
    g = sample_gaussian(offsets, sigma, ksize)
    lattice = np.arange(-(ksize // 2), ksize // 2 + 1)
    mean_square = float(np.sum(lattice**2 * sample_gaussian(lattice, sigma, ksize)))
    return g, g * (offsets**2 - mean_square) / sigma**2


def _first_guess(image: FloatArray, loaded: tuple[int, int]) -> tuple[float, float]:
    """Sigma of a Gaussian with the image's peak, 1 / sqrt(2 pi peak), inside the searched range."""
    peak = float(np.clip(image[loaded], 1e-4, 0.9))
    sigma = float(np.clip(1 / np.sqrt(2 * np.pi * peak), 0.3, 50.0))
    return (sigma, sigma)


def _uncut(sigma: float) -> int:
    return 2 * int(np.ceil(12 * sigma)) + 1


def _placed(gaussian: Gaussian, shape: tuple[int, ...], loaded: tuple[int, int]) -> FloatArray:
    """The kernel laid over an image about the loaded texel, cut at the image's edges."""
    gx, _ = _axis(np.arange(shape[1]) - loaded[1], gaussian.sigma_x, gaussian.ksize_x)
    gy, _ = _axis(np.arange(shape[0]) - loaded[0], gaussian.sigma_y, gaussian.ksize_y)
    return np.outer(gy, gx)


def _radial(
    radius: npt.ArrayLike | None, pressure: npt.ArrayLike | None, pitch: tuple[float, float] | None
) -> dict[str, Pair]:
    if radius is None or pressure is None or pitch is None:
        raise FastModelError("the radial estimators need radius, pressure_per_force and pitch together")
    r, p = np.asarray(radius, dtype=np.float64), np.asarray(pressure, dtype=np.float64)
    if r.ndim != 1 or r.shape != p.shape or np.any(np.diff(r) <= 0):
        raise ShapeError(f"radius must rise and match pressure_per_force; shapes {r.shape} and {p.shape}")
    if not (np.isfinite(p).all() and p[0] > 0):
        raise FastModelError("pressure_per_force must be finite and positive at the first radius")
    return {name: (sigma / pitch[0], sigma / pitch[1]) for name, sigma in radial_estimates(r, p).items()}
