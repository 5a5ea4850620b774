"""Estimated quantities with confidence intervals, and what the fitted recordings determine.

Recorded counts have three kinds of errors.  All texels of one recording have a common relative error (of load, creep,
and history of the rubber).  All recordings of one placement share how the indenter sits: each texel has a seating
height, which changes its force by an amount that does not depend on the load.  Each texel of an image has an error of
its own in counts.  The three variances are estimated from the residuals by restricted maximum likelihood.  The
uncertainty therefore depends on the numbers of recordings and placements, not on that of frames.  Intervals use
Student's t with degrees of freedom after Satterthwaite (1946).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2
from scipy.stats import t as student

from meshes.array_types import FloatArray
from validation.calibration.forward_fit import ForwardFit
from validation.calibration.model import BoolArray
from validation.calibration.temperatures import describe_confounding
from validation.results import Bound, Number, Result, result_model

#: Confidence level of all intervals, 0..1 [-].
CONFIDENCE = 0.95
#: Smallest number of recordings for which an interval is computed [-]; the scatter of two recordings is too uncertain.
FEWEST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True)
class UncertaintyNumbers:
    """Constants of the estimate of the uncertainty.

    Attributes:
        rounding: Standard deviation of rounding to whole counts [counts].
        negligible: Singular value over the largest one, below which a direction counts as not present [-].
        clear: Share of an error that remains in the residuals, below which the residuals do not measure the error,
            because other errors of the model are as large [-].
        least_load: Smallest load, over the largest, that divides the effect of a seating height [-].
        repetitions: Number of repetitions of the estimate of variances, after which they are constant [-].
        determined: Standard error over that of the prior, below which a gain counts as determined by the data [-].
        confounded: Ratio of the standard errors of a position with and without fitted gains, above which position and
            gains count as confounded [-].
    """

    rounding: float = 12**-0.5
    negligible: float = 1e-6
    clear: float = 0.02
    least_load: float = 0.05
    repetitions: int = 20
    determined: float = 0.5
    confounded: float = 2.0


NUMBERS = UncertaintyNumbers()


@result_model
class Estimate(Result):
    """An estimated quantity with its confidence interval.

    Attributes:
        value: The estimate; NaN if the data determine only a bound.
        low: Lower end of the interval.
        high: Upper end of the interval; infinite if the data determine none.
        unit: Unit of `value`, `low` and `high`.
        fitted_on: Description of the data of the estimate.
    """

    value: Number
    low: float
    high: Bound
    unit: str
    fitted_on: str

    @classmethod
    def symmetric(cls, value: float, half_width: float, unit: str, fitted_on: str) -> Estimate:
        """Make an estimate whose interval is `value - half_width` to `value + half_width`."""
        return cls(value=value, low=value - half_width, high=value + half_width, unit=unit, fitted_on=fitted_on)

    def __str__(self) -> str:
        """Return value, interval and unit."""
        return f"{self.value:.5g} [{self.low:.5g}, {self.high:.5g}] {self.unit}"


def estimate_mean(values: Sequence[float] | FloatArray, unit: str) -> Estimate | None:
    """Estimate a mean with Student's interval from independent values, NaN left out; None for fewer than three."""
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) < FEWEST_RECORDINGS:
        return None
    half = student.ppf(0.5 + CONFIDENCE / 2, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known))
    return Estimate.symmetric(float(known.mean()), float(half), unit, f"{len(known)} recordings")


def predict_mean(values: FloatArray, groups: FloatArray, unit: str) -> Estimate | None:
    """Estimate a mean with Student's interval for the mean of another group; None for fewer than three values.

    Values of one group may have a common error, so that the interval follows from the spread of the means of the
    groups.  With fewer than three groups it is that of independent values.

    Args:
        values: The values, NaN left out, shape (m,).
        groups: Number of the group of each value, for example its load, shape (m,).
        unit: Unit of the values.
    """
    known = np.isfinite(values)
    means = np.array([values[known & (groups == group)].mean() for group in np.unique(groups[known])])
    if len(means) < FEWEST_RECORDINGS:
        return estimate_mean(values, unit)
    half = student.ppf(0.5 + CONFIDENCE / 2, len(means) - 1) * means.std(ddof=1) * np.sqrt(1 + 1 / len(means))
    return Estimate.symmetric(float(values[known].mean()), float(half), unit, f"another load, by {len(means)} loads")


def measure_scatter(fit: ForwardFit, noise: Sequence[float]) -> dict[str, Estimate]:
    """Estimate noise, creep and scatter between recordings of one load, each only if enough recordings allow it.

    Args:
        fit: The fitted forward model.
        noise: Standard deviation of a texel's counts in each image [counts].

    Returns:
        Up to three estimates by name: `noise` is the standard deviation of a texel's counts from frame to frame
        [counts], `creep` the relative growth of counts per unit of ln(time), with an interval for another load [-], and
        `hysteresis` the relative standard deviation between recordings of one load in one placement, with temperature
        allowed for [-].
    """
    found = {
        "noise": estimate_mean(noise, "counts"),
        "creep": predict_mean(fit.observations.creep, fit.observations.loads, "per ln(time)"),
        "hysteresis": _measure_repeatability(fit),
    }
    return {name: estimate for name, estimate in found.items() if estimate is not None}


def _measure_repeatability(fit: ForwardFit) -> Estimate | None:
    """Estimate the relative standard deviation of the sum of counts between recordings of one load and placement.

    Sums are divided by the predicted sum, so that temperature and age do not count.  None without repeats.
    """
    seen = fit.observations
    ratios: dict[tuple[str, float], list[float]] = {}
    predicted = np.where(seen.measured, fit.predict(seen), 0.0).sum(axis=1)
    recorded = np.where(seen.measured, seen.counts, 0.0).sum(axis=1)
    for number, placement in enumerate(seen.placements):
        steady = seen.groups.count(seen.groups[number]) == 1
        if steady and recorded[number] > 0 and predicted[number] > 0:
            key = placement.name, float(seen.loads[number])
            ratios.setdefault(key, []).append(float(recorded[number] / predicted[number]))
    repeats = [np.array(values) for values in ratios.values() if len(values) > 1]
    freedom = sum(len(values) - 1 for values in repeats)
    if not freedom:
        return None
    square = sum(float(np.sum((values / values.mean() - 1) ** 2)) for values in repeats)
    low, high = (np.sqrt(square / chi2.ppf(0.5 + side * CONFIDENCE / 2, freedom)) for side in (1, -1))
    fitted_on = f"{len(repeats)} loads with {freedom + len(repeats)} recordings"
    value = float(np.sqrt(square / freedom))
    return Estimate(value=value, low=float(low), high=float(high), unit="share", fitted_on=fitted_on)


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Covariance of the p fitted parameters of a forward model: a sum over k kinds of errors, the last by the priors.

    Attributes:
        parts: Covariance of the parameters for errors of variance one of each kind, shape (k, p, p).
        variances: Variance of each kind of errors, shape (k,).
        spread: Covariance of the estimated `variances`, shape (k, k).
    """

    parts: FloatArray
    variances: FloatArray
    spread: FloatArray

    def half_width(self, gradient: FloatArray) -> float:
        """Return the half width of the confidence interval of a function of the parameters, in its unit.

        Args:
            gradient: Derivatives of the function by the p parameters, shape (p,).
        """
        unit = self.parts @ gradient @ gradient
        variance, uncertain = max(0.0, float(unit @ self.variances)), float(unit @ self.spread @ unit)
        freedom = max(1.0, 2 * variance**2 / max(uncertain, 1e-300))
        return float(student.ppf(0.5 + CONFIDENCE / 2, freedom) * np.sqrt(variance))


def estimate_uncertainty(fit: ForwardFit) -> Uncertainty:
    """Estimate the covariance of the parameters of a fit from three kinds of errors of the recorded counts.

    Texels without influence on the parameters are left out.

    Args:
        fit: The fit, to at least three recordings.
    """
    lit = np.abs(fit.jacobian).sum(axis=1) > 0
    residual, design, factors = list_errors(fit, lit)
    variances, spread = estimate_components(residual, design, factors, least=NUMBERS.rounding**2)
    prior = np.diag(fit.layout.prior)
    bread = np.asarray(np.linalg.pinv(fit.jacobian.T @ fit.jacobian + prior, hermitian=True), dtype=np.float64)
    weighted = (fit.weights / fit.scale)[fit.index[lit], None] * fit.jacobian[lit]
    roots = [bread @ (weighted.T @ each) for each in factors]
    parts = [*(root @ root.T for root in roots), bread @ (weighted.T @ weighted) @ bread, bread @ prior @ bread]
    return Uncertainty(parts=np.array(parts), variances=np.append(variances, 1.0), spread=np.pad(spread, (0, 1)))


def list_errors(fit: ForwardFit, rows: BoolArray) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """List residuals without weights, and what they depend on.

    Args:
        fit: The fit.
        rows: Whether each residual of the fit is taken; r of them are.

    Returns:
        Predicted minus recorded counts, shape (r,) [counts]; their derivatives with respect to the p parameters, shape
        (r, p); and the effects of the relative error of each recording and of the seating height of each texel in each
        placement, shape (r, number of errors) each [counts].
    """
    seen = fit.observations
    image, texel = (index[rows] for index in np.nonzero(seen.measured))
    weights = (fit.weights / fit.scale)[image]
    residual = fit.residual[rows] / weights
    predicted = residual + seen.counts[image, texel]
    recordings = _spread_columns(predicted, [seen.groups[number] for number in image])
    places = [(seen.placements[i].name, k) for i, k in zip(image, texel, strict=True)]
    seats = _spread_columns(predicted / np.maximum(seen.loads, NUMBERS.least_load * seen.loads.max())[image], places)
    return residual, fit.jacobian[rows] / weights[:, None], (recordings, seats)


def _spread_columns(values: FloatArray, keys: Sequence[Hashable]) -> FloatArray:
    """Return a matrix with a column for each of k different keys, which holds the values of that key, shape (r, k)."""
    order = {key: column for column, key in enumerate(dict.fromkeys(keys))}
    matrix = np.zeros((len(values), len(order)))
    matrix[np.arange(len(values)), [order[key] for key in keys]] = values
    return matrix


def estimate_components(
    residual: FloatArray, design: FloatArray, factors: Sequence[FloatArray], *, least: float
) -> tuple[FloatArray, FloatArray]:
    """Estimate variance components of a linear model by restricted maximum likelihood (Patterson and Thompson 1971).

    The observations are `design` b + sum_k factors_k u_k + e, with unknown b, and independent u_k and e.  The variances
    of u_k and e follow from Fisher scoring.  Only the part of the observations that `design` cannot describe is used.
    It is split into the part in the directions of the factors and the rest, in which there is only e.

    Args:
        residual: Observations, or their residuals for any b, shape (r,).
        design: Matrix of the fitted parameters, shape (r, p).
        factors: Matrices of the k factors, shape (r, columns of the factor) each.
        least: Smallest variance of e.

    Returns:
        Variances of the elements of each u_k, then of e, shape (k + 1,), and their covariance, shape (k + 1, k + 1).
        A variance that the observations do not determine, or that is estimated as zero, is zero without covariance.
    """
    known = find_directions(design)
    residual, *left = (each - known @ (known.T @ each) for each in (residual, *factors))
    norms = [[np.linalg.norm(each, axis=0) for each in pair] for pair in zip(left, factors, strict=True)]
    parts = [part * (norm > NUMBERS.clear * of) for part, (norm, of) in zip(left, norms, strict=True)]
    span = find_directions(np.hstack(parts))
    seen = span.T @ residual
    kernels = np.array([*((each := span.T @ part) @ each.T for part in parts), np.eye(len(seen))])
    rest, freedom = float(residual @ residual - seen @ seen), len(residual) - known.shape[1] - len(seen)
    variances = np.full(len(kernels), max(least, float(residual @ residual) / max(freedom + len(seen), 1)))
    variances[:-1] /= np.maximum([np.square(part).sum() / len(part) for part in parts], 1e-300)
    for _ in range(NUMBERS.repetitions):
        inverse = np.linalg.inv(np.tensordot(variances, kernels, 1))
        products = inverse @ kernels
        information = np.einsum("aij,bji->ab", products, products)
        squares = products @ inverse @ seen @ seen
        information[-1, -1] += freedom / variances[-1] ** 2
        squares[-1] += rest / variances[-1] ** 2
        information += np.diag(1e-12 * np.diag(information) + 1e-200)
        scales = np.diag(information) ** -0.5
        root = np.linalg.cholesky(scales[:, None] * information * scales)
        variances = scales * nnls(root.T, np.linalg.solve(root, scales * squares))[0]
        variances[-1] = max(variances[-1], least)
    estimated = np.ix_(variances > 0, variances > 0)
    spread = np.zeros_like(information)
    spread[estimated] = 2 * np.linalg.inv(information[estimated])
    return variances, spread


def find_directions(matrix: FloatArray) -> FloatArray:
    """Return orthonormal columns that span those of a matrix, shape (r, rank)."""
    span, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(span[:, sizes > NUMBERS.negligible * max(float(sizes.max(initial=0.0)), 1e-300)])


def describe_fit(fit: ForwardFit) -> Iterator[str]:
    """Yield one sentence for each property that the fitted recordings determine or leave undetermined."""
    seen = fit.observations
    if fit.layout.gain_texels.size:
        yield from _describe_gains(fit)
    confounded = describe_confounding(seen)
    if confounded:
        yield f"temperature coefficients are not identifiable: {confounded}"
    else:
        curve = fit.curve
        yield f"temperature: gain {100 * curve.gain_temperature:+.2f} %/K, dead force {curve.dead_temperature:+.2g} N/K"
    creep = seen.creep[np.isfinite(seen.creep)]
    if creep.size:
        yield (
            f"creep: counts grow as 1 + c ln(t / 2 s) with c = {np.median(creep):.3f} ({creep.min():.3f}.."
            f"{creep.max():.3f} in {creep.size} recordings, from 2 s after loading on); earlier and later times are "
            "extrapolated, what remains after unloading is not known, and a time constant cannot be identified"
        )
    if fit.outliers:
        yield f"little weight, because their residual is large: {', '.join(fit.outliers)}"
    yield "the filter's cut-off was not examined: the fit takes one mean image of each recording"


def _describe_gains(fit: ForwardFit) -> Iterator[str]:
    """Describe how many gains the data determine, and what remains undetermined: the cover's spread, a position."""
    layout = fit.layout
    information = fit.jacobian.T @ fit.jacobian + np.diag(layout.prior)
    variances = np.diag(np.linalg.pinv(information, hermitian=True))
    errors = np.sqrt(np.maximum(variances, 0.0))[layout.gains]
    known = int((errors < NUMBERS.determined * layout.prior[layout.gains] ** -0.5).sum())
    yield f"gains: {known} of {len(errors)} lit texels are determined by the recordings, the others by the prior near 1"
    placements = fit.observations.placements
    one_place = len({each.name for each in placements}) == 1
    if one_place:
        yield "gains contain how the indenter sits in its only placement; a second placement tells the two apart"
    if one_place and len({each.indenter for each in placements}) == 1:
        yield "the width of the cover's spread cannot be told from the gains: one indenter stands in one place"
    kept = np.setdiff1d(np.arange(len(information)), layout.gains)
    without = np.diag(np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True))
    for number, each in enumerate(layout.unknowns):
        if each.is_position:
            growth = float(np.sqrt(variances[number] / max(without[number], 1e-300)))
            if growth > NUMBERS.confounded:
                error = 1e3 * float(np.sqrt(variances[number]))
                yield (
                    f"{'xy'[each.part]} of the indenter in {each.placement!r} is known to {error:.2g} mm, {growth:.0f} "
                    "times worse than without gains: gains take up a shift"
                )
