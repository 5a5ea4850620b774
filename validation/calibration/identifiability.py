"""Covariance of the parameters of a fitted forward model, and what the fitted recordings determine.

All texels of one recording have a common relative error (of the load, of creep, of the history of the rubber), and each
texel an error of its own in counts.  The two variances are estimated from the residuals by the method of moments, with
the degrees of freedom that the fit has taken.  The uncertainty then depends on the number of recordings, not on that of
frames.  Intervals use Student's t with degrees of freedom after Satterthwaite (1946).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from meshes.array import FloatArray
from validation.calibration.forward_fit import ForwardFit
from validation.calibration.parameters import describe_confounding

#: Smallest number of recordings from which an interval is computed; the scatter of two is too uncertain [-].
FEWEST_RECORDINGS = 3
#: Standard deviation of rounding to whole counts [counts].
_ROUNDING = 12**-0.5
#: Singular value over the largest one, below which a direction of errors leaves no residual [-].
_NEGLIGIBLE = 1e-6
#: The same, below which that residual is no measure of the error: other errors of the model are as large [-].
_CLEAR = 0.02
#: Repetitions in which weights and variance settle [-].
_REPETITIONS = 20
#: Standard error over that of the prior, below which the data count as determining a gain [-].
_DETERMINED = 0.5
#: Growth of the standard error of a position by fitted gains, above which position and gains are called confounded [-].
_CONFOUNDED = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Covariance of p parameters.

    Attributes:
        covariance: Covariance, shape (p, p).
        quantiles: Quantile of Student's t for each parameter, shape (p,) [-].
        confidence: Confidence level of `quantiles`, 0..1 [-].
    """

    covariance: FloatArray
    quantiles: FloatArray
    confidence: float

    @property
    def standard_errors(self) -> FloatArray:
        """Standard error of each parameter, shape (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def half_width(self, gradient: FloatArray) -> float:
        """Return the half width of the interval of a function with these derivatives, shape (p,)."""
        variance = float(gradient @ self.covariance @ gradient)
        shares = gradient**2 * np.diag(self.covariance)
        quantile = float(np.average(self.quantiles, weights=shares)) if shares.any() else float(self.quantiles.max())
        return quantile * float(np.sqrt(max(variance, 0.0)))


def estimate_uncertainty(fit: ForwardFit, *, confidence: float = 0.95) -> Uncertainty:
    """Estimate the covariance of the parameters of a fit, clustered by recording.

    Args:
        fit: The fit.
        confidence: Confidence level of the intervals, 0..1 [-].

    Raises:
        ValueError: If there are fewer than three recordings.
    """
    names = list(dict.fromkeys(fit.observations.groups))
    if len(names) < FEWEST_RECORDINGS:
        raise ValueError(f"{len(names)} recordings give no interval; at least {FEWEST_RECORDINGS} are needed")
    group = np.array([names.index(each) for each in fit.observations.groups])[fit.index]
    information = fit.jacobian.T @ fit.jacobian + np.diag(fit.prior)
    bread = np.asarray(np.linalg.pinv(information, hermitian=True), dtype=np.float64)
    common = _measure_common_errors(fit, group, bread, len(names))
    shared = bread @ (common.directions.T @ common.directions) @ bread * common.variance
    own = bread @ common.texel_information @ bread * common.texel_variance
    of_prior = bread @ np.diag(fit.prior) @ bread
    parts = [np.diag(each) for each in (shared, own)]
    total = np.maximum(parts[0] + parts[1], 1e-300)
    freedom = total**2 / np.maximum(parts[0] ** 2 / common.freedom + parts[1] ** 2 / common.texel_freedom, 1e-300)
    quantiles = np.asarray(student.ppf(0.5 + confidence / 2, np.maximum(freedom, 1.0)), dtype=np.float64)
    return Uncertainty(covariance=shared + own + of_prior, quantiles=quantiles, confidence=confidence)


@dataclass(frozen=True, kw_only=True, eq=False)
class _CommonErrors:
    """Variances of the errors of k recordings.

    Attributes:
        directions: Derivatives of the weighted residuals along a common relative error, shape (k, p).
        variance: Variance of that relative error [-].
        freedom: Degrees of freedom of `variance` [-].
        texel_information: Jacobian^T D Jacobian with the relative variances D of the texels' errors, shape (p, p).
        texel_variance: Variance of the residual of a texel in an image of weight one [-].
        texel_freedom: Degrees of freedom of `texel_variance` [-].
    """

    directions: FloatArray
    variance: float
    freedom: float
    texel_information: FloatArray
    texel_variance: float
    texel_freedom: float


def _measure_common_errors(
    fit: ForwardFit, group: npt.NDArray[np.intp], bread: FloatArray, count: int
) -> _CommonErrors:
    """Estimate the variances of relative errors of recordings and of errors of texels from the residuals.

    The residuals are (I - H) e for errors e and the hat matrix H of the fit.  What remains of them after projection on
    the directions that relative errors of recordings leave gives the variance of the texels.  What they hold in
    those directions gives the variance of the recordings.  Texels that are predicted to read zero are left out.
    """
    lit = np.abs(fit.jacobian).sum(axis=1) > 0
    jacobian, residual, group = fit.jacobian[lit], fit.residual[lit], group[lit]
    weights = np.asarray(fit.weights[fit.index][lit])
    predicted = residual + weights * fit.observations.counts[fit.observations.measured][lit] / fit.scale
    relative = weights**2
    information, weighted = jacobian.T @ jacobian, jacobian.T @ (relative[:, None] * jacobian)
    hat = bread @ information

    def leave(errors: FloatArray) -> FloatArray:
        """Residuals of errors, (I - H) e, shape (r, k)."""
        return np.asarray(errors - jacobian @ (bread @ (jacobian.T @ errors)))

    images = np.zeros((len(residual), count))
    images[np.arange(len(residual)), group] = predicted
    span, sizes, _ = np.linalg.svd(leave(images), full_matrices=False)
    chosen = sizes > _NEGLIGIBLE * max(float(sizes.max()), 1e-300)
    span, sizes = span[:, chosen], sizes[chosen]
    own = (relative @ leave(span) ** 2) / np.maximum(sizes, 1e-300) ** 2
    texels = relative.sum() - 2 * np.trace(bread @ weighted) + np.trace(hat @ bread @ weighted)
    texels -= own @ sizes**2
    freedom = max(1.0, float(len(residual) - 2 * np.trace(hat) + np.sum(hat * hat.T) - span.shape[1]))
    rest = float(residual @ residual - np.sum((span.T @ residual) ** 2))
    texel_variance = max(rest / max(float(texels), 1e-12), (_ROUNDING / fit.scale) ** 2)

    clear = sizes > _CLEAR * max(float(sizes.max(initial=0.0)), 1e-300)
    squares = (span.T @ residual)[clear] ** 2 / sizes[clear] ** 2
    variance, common_freedom = _estimate_variance(squares, texel_variance * own[clear])
    return _CommonErrors(
        directions=images.T @ jacobian,
        variance=variance,
        freedom=common_freedom,
        texel_information=weighted,
        texel_variance=texel_variance,
        texel_freedom=freedom,
    )


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
    for _ in range(_REPETITIONS):
        weights = (max(variance, 1e-300) / (variance + known + 1e-300)) ** 2
        variance = max(0.0, float(weights @ (squares - known) / max(weights.sum(), 1e-300)))
    return variance, max(1.0, float(weights.sum() ** 2 / max(weights @ weights, 1e-300)))


def describe_fit(fit: ForwardFit) -> Iterator[str]:
    """Yield one sentence for each thing that the fitted recordings determine or leave open."""
    seen = fit.observations
    yield from _describe_gains(fit)
    yield from _describe_pose(fit)
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
    """Say how many gains the data determine, and whether the spread of the cover can be told from them."""
    layout = fit.layout
    if not layout.gain_texels.size:
        return
    information = fit.jacobian.T @ fit.jacobian + np.diag(fit.prior)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(information, hermitian=True)), 0.0))[layout.gains]
    prior = fit.prior[layout.gains] ** -0.5
    known = int((errors < _DETERMINED * prior).sum())
    yield f"gains: {known} of {len(errors)} lit texels are determined by the recordings, the others by the prior near 1"
    places = {each.name for each in fit.observations.placements}
    indenters = {each.indenter for each in fit.observations.placements}
    if len(places) == 1 and len(indenters) == 1:
        yield "the width of the cover's spread cannot be told from the gains: one indenter stands in one place"


def _describe_pose(fit: ForwardFit) -> Iterator[str]:
    """Say whether fitted gains make a fitted position uncertain."""
    layout = fit.layout
    count = layout.pose_count
    if not count or not layout.gain_texels.size:
        return
    information = fit.jacobian.T @ fit.jacobian + np.diag(fit.prior)
    with_gains = np.diag(np.linalg.pinv(information, hermitian=True))
    kept = np.setdiff1d(np.arange(len(information)), layout.gains)
    without = np.diag(np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True))
    for number, (name, part) in enumerate(layout.pose_parts):
        if part < 2:  # noqa: PLR2004 -- x and y
            growth = float(np.sqrt(with_gains[number] / max(without[number], 1e-300)))
            if growth > _CONFOUNDED:
                error = 1e3 * float(np.sqrt(with_gains[number]))
                yield (
                    f"{'xy'[part]} of the indenter in {name!r} is known to {error:.2g} mm, {growth:.0f} times worse "
                    "than without gains: gains take up a shift"
                )
