"""Estimators of the width of a point spread function other than the fit in `gaussian`.

Their values are reported for comparison with published widths, which are often given without their definition.  They do
not influence the parameters of the fast model.
"""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Widths along x and y, (sigma_x, sigma_y).
Pair = tuple[float, float]


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
    from scipy.optimize import minimize_scalar

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
