"""Profiles the thickness of the cover: what the fitted recordings say about it, and how the other parameters follow.

The forward model is fitted on covers of several thicknesses, whose layers are all scaled by one factor.  Residuals of
one recording and of one placement are correlated, so that they are compared by generalised least squares, with the
variance components of the most likely thickness (see `validation.calibration.uncertainty`).  The interval holds the
thicknesses whose weighted sum of squares, minimised over all other parameters, exceeds the smallest one by less than
the quantile of an F distribution with one and with Satterthwaite's (1946) degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.stats import f as fisher

from validation.calibration import uncertainty
from validation.calibration.forward_fit import ForwardFit, fit_forward
from validation.calibration.model import REFERENCE
from validation.calibration.uncertainty import CONFIDENCE, Estimate, list_errors
from validation.errors import InputError

#: Thicknesses at which the forward model is fitted, over the assumed one [-].
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
#: Number of thicknesses at which a profile is evaluated between the fits [-].
_STEPS = 20001
#: Largest number of fits, distance of a likely thickness from a fitted one, relative, above which it is enclosed by two
#: further ones, and their factor from it [-].
_MOST_FITS, _CLOSE, _BESIDE = 9, 0.03, 1.02
#: Distance of places, over the pitch, below which gains take up the spread of the cover as in a single place [-].
_APART = 0.5


def profile_thickness(fit: ForwardFit, say: Callable[[str], object]) -> tuple[Estimate, dict[float, ForwardFit]]:
    """Fit on covers of `FACTORS` and of likely thicknesses, and find those that agree with the recordings.

    No thickness is determined by one indenter in places within half a pitch, where gains take up the spread.

    Args:
        fit: Fit on the assumed cover.
        say: Called with a line for each other thickness.

    Returns:
        The thickness [mm], and the fits by the thickness over the assumed one, in ascending order.  The lower end of
        the interval is 0 and the upper one infinite where it lies beyond `FACTORS`; the value is then NaN.

    Raises:
        InputError: If the contact method cannot be computed on another cover.
    """
    rescale, assumed = fit.method.rescale, 1e3 * fit.method.thickness
    if rescale is None:
        raise InputError(f"--profile-thickness: needs finite elements (--method {REFERENCE}), not {fit.method.name}")
    places = np.array([[pose.x, pose.y] for pose in fit.poses.values()]) / min(fit.method.array.pitch)
    still = np.ptp(places, axis=0).max() < _APART and len({each.indenter for each in fit.observations.placements}) == 1
    fits, wanted, likely, low, high = {1.0: fit}, set(FACTORS), np.nan, FACTORS[0], FACTORS[-1]
    while wanted := wanted - set(fits):
        for factor in sorted(wanted):
            say(f"fit with a cover of {factor * assumed:.3g} mm")
            fits[factor] = fit_forward(rescale(factor), fit.observations, fit.options)
        fits = dict(sorted(fits.items()))
        low, likely, high = (low, likely, high) if still else _find_interval(fits)
        if len(fits) + 2 <= _MOST_FITS and min(abs(np.log(factor / likely)) for factor in fits) > _CLOSE:
            wanted = {likely / _BESIDE, likely * _BESIDE}
    low, high = assumed * low if low > FACTORS[0] else 0.0, assumed * high if high < FACTORS[-1] else np.inf
    value = assumed * likely if low > 0 and high < np.inf else np.nan
    words = f"covers of {assumed * FACTORS[0]:.3g}..{assumed * FACTORS[-1]:.3g} mm; {assumed:.3g} mm assumed"
    return Estimate(value=value, low=low, high=high, unit="mm", fitted_on=words), fits


def _find_interval(fits: Mapping[float, ForwardFit]) -> tuple[float, float, float]:
    """Return lower end, most likely value and upper end of the interval, over the assumed thickness [-].

    Between the fits, the residuals are interpolated by a cubic spline in the logarithm of the thickness.  Variances and
    derivatives are those of the fit with the smallest residual.
    """
    fitted, best = np.log(list(fits)), min(fits.values(), key=lambda fit: fit.rms)
    # A texel at rest shows no noise, so that with such texels the variance of the others would be too small.
    rows = best.observations.lit[best.observations.measured] & (np.abs(best.jacobian).sum(axis=1) > 0)
    residual, design, factors = list_errors(best, rows)
    (*variances, noise), spread = uncertainty.estimate_components(
        residual, design, factors, least=uncertainty.NUMBERS.rounding**2
    )
    residuals = np.column_stack([list_errors(fit, rows)[0] for fit in fits.values()])
    known = uncertainty.find_directions(design)
    residuals, *left = (each - known @ (known.T @ each) for each in (residuals, *factors))
    root = np.hstack([each * variance**0.5 for each, variance in zip(left, variances, strict=True)])
    inner = noise * np.eye(root.shape[1]) + root.T @ root
    weighted = (residuals - root @ np.linalg.solve(inner, root.T @ residuals)) / noise
    places, spline = np.linspace(fitted[0], fitted[-1], _STEPS), CubicSpline(fitted, np.eye(len(fitted)))
    squares = np.einsum("ta,ab,tb->t", spline(places), residuals.T @ weighted, spline(places))
    likely = places[int(np.argmin(squares))]
    pull = weighted @ spline(likely, 1)
    shares = np.array([float(each @ each) for each in (*(part.T @ pull for part in left), pull)])
    information = float(residuals @ spline(likely, 1) @ pull)
    freedom = max(1.0, 2 * information**2 / max(float(shares @ spread @ shares), 1e-300))
    agree = np.exp(places[squares <= squares.min() + fisher.ppf(CONFIDENCE, 1, freedom)])
    return float(agree[0]), float(np.exp(likely)), float(agree[-1])


def describe_thickness(found: Estimate, assumed: float) -> str:
    """Say in a sentence which thicknesses agree with the recordings, and whether the assumed one [m] does."""
    least, most = (f"at {word} {end:.3g} mm" for word, end in (("least", found.low), ("most", found.high)))
    bounds = [least] * (found.low > 0) + [most] * bool(np.isfinite(found.high))
    said = ", ".join(bounds) or "not determined"
    agrees = "agrees" if found.low <= 1e3 * assumed <= found.high else "does NOT AGREE"
    return f"thickness of the cover: {said} ({found.fitted_on}, which {agrees}); the other intervals contain this range"


def widen(
    estimates: Mapping[str, Estimate], others: Mapping[float, Mapping[str, Estimate]], ends: tuple[float, float]
) -> dict[str, Estimate]:
    """Widen the intervals of estimates by how far their values move within a range of thicknesses.

    Args:
        estimates: Estimates on the assumed cover.
        others: The same estimates by the thickness over the assumed one, in ascending order.
        ends: Ends of the range of thicknesses, over the assumed one, which is limited to `FACTORS` [-].
    """
    values = np.array([[each.value for each in row.values()] for row in others.values()])
    between = PchipInterpolator(np.log(list(others)), values)
    first, last = np.log(np.clip(ends, FACTORS[0], FACTORS[-1])).tolist()
    moved = between(np.append(np.linspace(first, last, _STEPS), 0.0)) - between(0.0)
    return {
        name: replace(each, low=each.low + float(by.min()), high=each.high + float(by.max()))
        for (name, each), by in zip(estimates.items(), moved.T, strict=True)
    }
