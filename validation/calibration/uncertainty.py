"""Estimated quantities with confidence intervals, and what the fitted recordings determine.

All texels of one recording have a common relative error (of load, creep, and history of the rubber), and each texel has
an error of its own in counts.  The two variances are estimated from the residuals by the method of moments, with the
degrees of freedom used by the fit.  The uncertainty therefore depends on the number of recordings, not on that of
frames.  Intervals use Student's t with degrees of freedom after Satterthwaite (1946).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from meshes.array_types import FloatArray
from validation.calibration.forward_fit import ForwardFit
from validation.calibration.temperatures import describe_confounding
from validation.results import Result, result_model

#: Confidence level of all intervals, 0..1 [-].
CONFIDENCE = 0.95
#: Smallest number of recordings for which an interval is computed [-]; the scatter of two recordings is too uncertain.
FEWEST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True)
class UncertaintyNumbers:
    """Constants of the estimate of the uncertainty.

    Attributes:
        rounding: Standard deviation of rounding to whole counts [counts].
        negligible: Singular value over the largest one, below which a relative error of recordings has no effect on
            the residuals [-].
        clear: Singular value over the largest one, below which the residuals do not measure the relative errors of
            recordings, because other errors of the model are as large [-].
        repetitions: Number of repetitions of the estimate of weights and variance, after which both are constant [-].
        determined: Standard error over that of the prior, below which a gain counts as determined by the data [-].
        confounded: Ratio of the standard errors of a position with and without fitted gains, above which position and
            gains count as confounded [-].
    """

    rounding: float = 12**-0.5
    negligible: float = 1e-6
    clear: float = 0.02
    repetitions: int = 20
    determined: float = 0.5
    confounded: float = 2.0


NUMBERS = UncertaintyNumbers()


@result_model
class Estimate(Result):
    """An estimated quantity with its confidence interval.

    Attributes:
        value: The estimate.
        low: Lower end of the interval.
        high: Upper end of the interval.
        unit: Unit of `value`, `low` and `high`.
        fitted_on: Description of the data of the estimate.
    """

    value: float
    low: float
    high: float
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


def measure_scatter(fit: ForwardFit, noise: Sequence[float]) -> dict[str, Estimate]:
    """Estimate noise, creep and scatter between recordings of one load, each only if enough recordings allow it.

    Args:
        fit: The fitted forward model.
        noise: Standard deviation of a texel's counts in each image [counts].

    Returns:
        Up to three estimates by name: `noise` is the standard deviation of a texel's counts from frame to frame
        [counts], `creep` the relative growth of counts per unit of ln(time) [-], and `hysteresis` the relative standard
        deviation between recordings of one load in one placement, with temperature allowed for [-].
    """
    found = {
        "noise": estimate_mean(noise, "counts"),
        "creep": estimate_mean(fit.observations.creep, "per ln(time)"),
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
    """Covariance and degrees of freedom of the p fitted parameters of a forward model.

    Attributes:
        covariance: Covariance of the parameters, in products of their units, shape (p, p).
        quantiles: Quantile of Student's t for each parameter: the half width of its two-sided confidence interval over
            its standard error, shape (p,) [-].
    """

    covariance: FloatArray
    quantiles: FloatArray

    def half_width(self, gradient: FloatArray) -> float:
        """Return the half width of the confidence interval of a function of the parameters, in its unit.

        Args:
            gradient: Derivatives of the function by the p parameters, shape (p,).
        """
        variance = float(gradient @ self.covariance @ gradient)
        shares = gradient**2 * np.diag(self.covariance)
        quantile = float(np.average(self.quantiles, weights=shares)) if shares.any() else float(self.quantiles.max())
        return quantile * float(np.sqrt(max(variance, 0.0)))


def estimate_uncertainty(fit: ForwardFit) -> Uncertainty:
    """Estimate the covariance of the parameters of a fit, clustered by recording.

    Args:
        fit: The fit, to at least three recordings.
    """
    prior = np.diag(fit.layout.prior)
    bread = np.asarray(np.linalg.pinv(fit.jacobian.T @ fit.jacobian + prior, hermitian=True), dtype=np.float64)
    errors = _measure_errors(fit, bread)
    parts = [bread @ meat @ bread * variance for meat, variance, _ in errors]
    variances = [np.diag(each) for each in parts]
    total = np.maximum(sum(variances), 1e-300)
    of_parts = sum(each**2 / freedom for each, (*_, freedom) in zip(variances, errors, strict=True))
    freedom = total**2 / np.maximum(of_parts, 1e-300)
    quantiles = np.asarray(student.ppf(0.5 + CONFIDENCE / 2, np.maximum(freedom, 1.0)), dtype=np.float64)
    return Uncertainty(covariance=sum(parts) + bread @ prior @ bread, quantiles=quantiles)


def _measure_errors(fit: ForwardFit, bread: FloatArray) -> list[tuple[FloatArray, float, float]]:
    """Estimate the variances of relative errors of recordings and of errors of texels from the residuals.

    The residuals are (I - H) e for errors e and the hat matrix H of the fit.  Relative errors of recordings cause
    residuals in certain directions.  The part of the residuals in these directions gives the variance of the
    recordings, and the remaining part gives the variance of the texels.  Texels with a prediction of zero are left out.

    Returns:
        For the relative errors of recordings [-], then for the errors of texels in an image of weight one: Jacobian^T D
        Jacobian with the covariance D of unit errors, shape (p, p), the variance, and its degrees of freedom [-].
    """
    lit = np.abs(fit.jacobian).sum(axis=1) > 0
    jacobian, residual = fit.jacobian[lit], fit.residual[lit]
    weights = np.asarray(fit.weights[fit.index][lit])
    predicted = residual + weights * fit.observations.counts[fit.observations.measured][lit] / fit.scale
    relative = weights**2
    information, weighted = jacobian.T @ jacobian, jacobian.T @ (relative[:, None] * jacobian)
    hat = bread @ information

    def leave(errors: FloatArray) -> FloatArray:
        """Return the residuals (I - H) e of a fit whose observations have the k errors e, shape (r, k)."""
        return np.asarray(errors - jacobian @ (bread @ (jacobian.T @ errors)))

    names = list(dict.fromkeys(fit.observations.groups))
    recording = np.array([names.index(each) for each in fit.observations.groups])[fit.index][lit]
    images = np.zeros((len(residual), len(names)))
    images[np.arange(len(residual)), recording] = predicted
    span, sizes, _ = np.linalg.svd(leave(images), full_matrices=False)
    chosen = sizes > NUMBERS.negligible * max(float(sizes.max()), 1e-300)
    span, sizes = span[:, chosen], sizes[chosen]
    own = (relative @ leave(span) ** 2) / np.maximum(sizes, 1e-300) ** 2
    texels = relative.sum() - 2 * np.trace(bread @ weighted) + np.trace(hat @ bread @ weighted)
    texels -= own @ sizes**2
    texel_freedom = max(1.0, float(len(residual) - 2 * np.trace(hat) + np.sum(hat * hat.T) - span.shape[1]))
    rest = float(residual @ residual - np.sum((span.T @ residual) ** 2))
    texel_variance = max(rest / max(float(texels), 1e-12), (NUMBERS.rounding / fit.scale) ** 2)
    clear = sizes > NUMBERS.clear * max(float(sizes.max(initial=0.0)), 1e-300)
    squares = (span.T @ residual)[clear] ** 2 / sizes[clear] ** 2
    variance, freedom = _estimate_variance(squares, texel_variance * own[clear])
    directions = images.T @ jacobian
    return [(directions.T @ directions, variance, freedom), (weighted, texel_variance, texel_freedom)]


def _estimate_variance(squares: FloatArray, known: FloatArray) -> tuple[float, float]:
    """Estimate the common part v of the variances of k independent errors.

    Args:
        squares: Squares of the errors, whose expected values are v + `known`, shape (k,).
        known: Known parts of the variances, shape (k,).

    Returns:
        The estimate, weighted by the inverse variances of the squares, and its degrees of freedom.
    """
    if not squares.size:
        return 0.0, 1.0
    variance, weights = float(squares.mean()), np.ones(len(squares))
    for _ in range(NUMBERS.repetitions):
        weights = (max(variance, 1e-300) / (variance + known + 1e-300)) ** 2
        variance = max(0.0, float(weights @ (squares - known) / max(weights.sum(), 1e-300)))
    return variance, max(1.0, float(weights.sum() ** 2 / max(weights @ weights, 1e-300)))


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
            f"{creep.max():.3f} in {creep.size} recordings); a time constant cannot be identified"
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
    if len({each.name for each in placements}) == 1 and len({each.indenter for each in placements}) == 1:
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
