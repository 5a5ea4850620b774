"""Covariance of the parameters of a fitted forward model, and what the fitted recordings determine.

All images of one recording have common errors (placement, drift, history of the rubber).  The uncertainty therefore
depends on the number of recordings.  The covariance is the cluster-robust estimate with the CR3 correction (Bell and
McCaffrey 2002), close to a jackknife over recordings, extended by the variance of the priors.  Intervals use Student's
t with the degrees of freedom of the recordings that bear on a parameter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from meshes.array import FloatArray
from validation.calibration.forward_fit import ForwardFit
from validation.calibration.parameters import describe_confounding

#: Smallest number of recordings from which an interval is computed; the scatter of two is too uncertain [-].
FEWEST_RECORDINGS = 3
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
    jacobian, residual = fit.jacobian, fit.residual
    information = jacobian.T @ jacobian + np.diag(fit.prior)
    bread = np.linalg.pinv(information, hermitian=True)
    meat = np.zeros_like(bread)
    shares = np.zeros((len(names), len(bread)))
    for number in range(len(names)):
        rows = jacobian[group == number]
        own, score = rows.T @ rows, rows.T @ residual[group == number]
        # X' (I - X B X')^-1 r for the rows X of the Jacobian and the residuals r of one recording, with B the inverse
        # of `information`.  Woodbury's identity replaces the inverse by that of a p x p matrix.
        corrected = score + own @ np.linalg.pinv(information - own, rcond=1e-10, hermitian=True) @ score
        meat += np.outer(corrected, corrected)
        shares[number] = np.einsum("ij,jk,ki->i", bread, own, bread)
    covariance = (len(names) - 1) / len(names) * bread @ meat @ bread + bread @ np.diag(fit.prior) @ bread
    # Recordings that do not press on a texel say nothing about its gain: count those that bear on a parameter.
    bearing = np.maximum(shares.sum(axis=0) ** 2 / np.maximum((shares**2).sum(axis=0), 1e-300), 2.0)
    quantiles = student.ppf(0.5 + confidence / 2, np.maximum(bearing - 1, 1.0))
    return Uncertainty(covariance=covariance, quantiles=quantiles, confidence=confidence)


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
    yield "the filter's cut-off is not identifiable: steady images are fitted"


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
