"""Other ways to put a width on a point spread function, each a small formula.

None of them sets a parameter.  They are listed because published widths use any of them without saying which.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: (sigma_x, sigma_y).
Pair = tuple[float, float]


def image_estimates(image: FloatArray, loaded: tuple[int, int], load_name: str) -> dict[str, Pair]:
    """Widths from a texel image of unit load, by name [pitches].

    - `variance-*`: sqrt(sum F d^2 / sum F) over the array; nan when negative texels outweigh.
    - `peak-*`: 1 / sqrt(2 pi F_max), the width of a continuous Gaussian with this peak.
    - `neighbour-*`: 1 / sqrt(2 ln(F_0 / F_1)), from the loaded texel and the mean of its two neighbours.

    Args:
        image: Texel forces per unit load, shape (rows, columns) [-].
        loaded: Row and column of the loaded texel.
        load_name: Ending of the names, "uniform" or "point".
    """
    row, column = loaded
    along_x = (image.sum(axis=0), image[row], column)
    along_y = (image.sum(axis=1), image[:, column], row)
    peak = _root(1 / (2 * np.pi * image[loaded])) if image[loaded] > 0 else float("nan")
    return {
        f"variance-{load_name}": (
            _image_variance(along_x[0], along_x[2]),
            _image_variance(along_y[0], along_y[2]),
        ),
        f"peak-{load_name}": (peak, peak),
        f"neighbour-{load_name}": (_neighbour(along_x[1], along_x[2]), _neighbour(along_y[1], along_y[2])),
    }


def radial_estimates(radius: FloatArray, pressure: FloatArray) -> dict[str, float]:
    """Widths from the radial base pressure under a unit point load, by name [m].

    - `radial-profile`: least squares of exp(-r^2 / 2 s^2) / (2 pi s^2), weighted by dr.
    - `radial-profile-area`: the same, weighted by area (r dr).
    - `radial-peak`: 1 / sqrt(2 pi p(0)).
    - `radial-half-height`: radius where p falls to half its peak, over sqrt(2 ln 2).
    - `radial-half-force`: radius that holds half the force, over sqrt(2 ln 2).
    - `radial-variance`: sqrt(pi int p r^3 dr); for one bonded layer h sqrt(nu / (1 - nu)).

    Args:
        radius: Radii, shape (m,), rising [m].
        pressure: Pressure per force at these radii, shape (m,) [1/m2].
    """
    half = float(np.sqrt(2 * np.log(2)))
    rings = 2 * np.pi * radius * pressure
    force = np.append(0.0, np.cumsum(0.5 * (rings[1:] + rings[:-1]) * np.diff(radius)))
    return {
        "radial-profile": _profile_fit(radius, pressure, np.ones_like(radius)),
        "radial-profile-area": _profile_fit(radius, pressure, radius),
        "radial-peak": _root(1 / (2 * np.pi * pressure[0])),
        "radial-half-height": _first_crossing(radius, pressure[0] / 2 - pressure) / half,
        "radial-half-force": _first_crossing(radius, force - 0.5) / half,
        "radial-variance": _root(float(np.pi * np.trapezoid(pressure * radius**3, radius))),
    }


def _profile_fit(radius: FloatArray, pressure: FloatArray, weight: FloatArray) -> float:
    from scipy.optimize import minimize_scalar

    def misfit(log_sigma: float) -> float:
        s = np.exp(log_sigma)
        model = np.exp(-0.5 * (radius / s) ** 2) / (2 * np.pi * s**2)
        return float(np.trapezoid(weight * (model - pressure) ** 2, radius) / pressure[0] ** 2)

    guess = np.log(_root(1 / (2 * np.pi * pressure[0])))
    found = minimize_scalar(misfit, bounds=(guess - 2, guess + 2), method="bounded", options={"xatol": 1e-10})
    return float(np.exp(found.x))


def _first_crossing(radius: FloatArray, rising: FloatArray) -> float:
    """Where a curve that starts below zero first crosses it, linear between samples; nan when never."""
    above = np.flatnonzero(rising >= 0)
    if len(above) == 0 or above[0] == 0:
        return float("nan")
    k = int(above[0])
    share = -rising[k - 1] / (rising[k] - rising[k - 1])
    return float(radius[k - 1] + share * (radius[k] - radius[k - 1]))


def _image_variance(profile: FloatArray, loaded: int) -> float:
    offsets = np.arange(len(profile)) - loaded
    if profile.sum() <= 0:
        return float("nan")
    return _root(np.sum(profile * offsets**2) / np.sum(profile))


def _neighbour(line: FloatArray, loaded: int) -> float:
    beside = [line[k] for k in (loaded - 1, loaded + 1) if 0 <= k < len(line)]
    mean = float(np.mean(beside)) if beside else 0.0
    if not 0 < mean < line[loaded]:
        return float("nan")
    return _root(0.5 / np.log(line[loaded] / mean))


def _root(value: float | np.floating) -> float:
    return float(np.sqrt(value)) if value >= 0 else float("nan")
