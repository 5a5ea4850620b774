"""Fits a sensor's characteristic by least squares, with intervals that allow for common errors within a recording.

Counts of texel i in observation k under the texel force f = share_i load_k are modelled as

    counts = S(max(0, g_i (1 + t (T_k - T_0)) P(f) - threshold)),

with a polynomial P of degree 1 or 5, gains g_i of mean 1, a temperature coefficient t, the temperature T_k of the
observation, a reference temperature T_0 and the soft saturation S of `fastmodel.signal.electronics`.  `CurveForm`
selects which of these are fitted.

All frames of one recording have the same errors (placement, drift, history of the rubber).  The uncertainty therefore
depends on the number of recordings, not on the number of frames.  The covariance of the parameters is the
cluster-robust estimate with the CR3 correction (Bell and McCaffrey 2002), which is close to a jackknife over
recordings.  Intervals use Student's t; the degrees of freedom are the number of recordings minus one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.stats import t as student

from fastmodel.signal.electronics import saturate

FloatArray = npt.NDArray[np.float64]

#: Smallest number of recordings from which an interval is computed; the scatter of two is too uncertain [-].
_FEWEST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Mean tactile images under known loads: m observations of n texels.

    Attributes:
        loads: Load of each observation, shape (m,) [N].
        counts: Mean counts of each texel in each observation, shape (m, n) [-].
        shares: Share of the load on each texel, shape (n,) [-].
        groups: Name of the recording that each observation comes from, shape (m,).
        temperatures: Temperature of the sensor at each observation, NaN if unknown, shape (m,) [degC].
    """

    loads: FloatArray
    counts: FloatArray
    shares: FloatArray
    groups: tuple[str, ...]
    temperatures: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ValueError: If shapes disagree, or a load or share is negative or not finite.
        """
        m, n = len(self.loads), len(self.shares)
        if self.counts.shape != (m, n) or self.temperatures.shape != (m,) or len(self.groups) != m:
            raise ValueError(
                f"{m} loads and {n} shares need counts of shape ({m}, {n}), {m} groups and {m} temperatures"
            )
        for name, values in (("loads", self.loads), ("shares", self.shares)):
            if not (np.isfinite(values).all() and (values >= 0).all()):
                raise ValueError(f"{name} must be numbers of 0 or more")

    @property
    def forces(self) -> FloatArray:
        """Texel forces: load of each observation times share of each texel, shape (m, n) [N]."""
        return np.outer(self.loads, self.shares)


@dataclass(frozen=True, kw_only=True)
class CurveForm:
    """Selects the parameters of the characteristic that are fitted.

    Attributes:
        degree: Degree of the polynomial from force to counts, 1 or 5 [-].
        saturation: Whether the largest count and the width of the bend below it (saturation band) are fitted.
        gains: Whether a gain is fitted for every texel.
        temperature: Whether a temperature coefficient is fitted.
        threshold: Counts that the firmware subtracts; given, not fitted [-].
    """

    degree: int
    saturation: bool
    gains: bool
    temperature: bool
    threshold: float

    @property
    def shared_names(self) -> list[str]:
        """Names of the parameters that all texels share, in the order of the vector of parameters."""
        names = [f"c{power}" for power in range(self.degree + 1)]
        names += ["temperature"] if self.temperature else []
        return names + (["output_max", "saturation_band"] if self.saturation else [])

    def names(self, texels: int) -> list[str]:
        """Return the names of all parameters, in the order of the vector of parameters.

        The gain of the last texel is not a parameter: it follows from the mean gain of 1.
        """
        return self.shared_names + ([f"gain{texel}" for texel in range(texels - 1)] if self.gains else [])


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedCurve:
    """Fitted characteristic: its p parameters with their covariance.

    Attributes:
        form: The selection of parameters that were fitted.
        values: Parameters in the order of `form.names`, shape (p,); the coefficient of force^k in counts/N^k.
        covariance: Cluster-robust covariance of the parameters, shape (p, p).
        reference: Temperature T_0 at which the temperature factor is 1 [degC].
        recordings: Number of recordings in the fit [-].
        residual: Root mean square of the differences between predicted and measured counts [-].
        quantile: Quantile of Student's t for the requested confidence; an interval's half width over the standard
            error [-].
    """

    form: CurveForm
    values: FloatArray
    covariance: FloatArray
    reference: float
    recordings: int
    residual: float
    quantile: float

    @property
    def half_widths(self) -> FloatArray:
        """Half width of the confidence interval of each parameter, shape (p,), in the parameter's unit."""
        return self.quantile * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def value(self, name: str) -> float:
        """Return the value of a parameter that all texels share, by its name in `form.shared_names`."""
        return float(self.values[self.form.shared_names.index(name)])

    def predict(self, observations: Observations) -> FloatArray:
        """Return the counts that the curve predicts at the loads and temperatures of `observations`, shape (m, n)."""
        return _predict_counts(self.form, self.values, observations.forces, observations.temperatures - self.reference)

    def interval(self, gradient: FloatArray) -> float:
        """Return the half width of the confidence interval of a function of the parameters.

        Args:
            gradient: Derivatives of the function with respect to the parameters, shape (p,).
        """
        variance = float(gradient @ self.covariance @ gradient)
        return self.quantile * math.sqrt(max(0.0, variance))


def fit_curve(observations: Observations, form: CurveForm, *, confidence: float = 0.95) -> FittedCurve:
    """Fit a characteristic to mean images under known loads by least squares over all texels and observations.

    Args:
        observations: Mean images under known loads.
        form: Selection of the parameters to fit.
        confidence: Confidence level of the intervals, 0..1 [-].

    Raises:
        ValueError: If there are fewer than three recordings, or fewer different loads than polynomial coefficients.
    """
    groups = list(dict.fromkeys(observations.groups))
    loads = len(np.unique(observations.loads))
    if len(groups) < _FEWEST_RECORDINGS or loads < form.degree + 1:
        raise ValueError(
            f"{len(groups)} recordings with {loads} loads cannot determine a curve of degree {form.degree}; "
            f"at least {_FEWEST_RECORDINGS} recordings and {form.degree + 1} loads are needed"
        )
    forces = observations.forces
    reference = float(np.nanmean(observations.temperatures)) if form.temperature else 0.0
    above_reference = observations.temperatures - reference if form.temperature else np.zeros(len(forces))
    start, scale = _start_and_scale(form, forces, observations.counts)

    def misfit(scaled: FloatArray) -> FloatArray:
        return (_predict_counts(form, scaled * scale, forces, above_reference) - observations.counts).ravel()

    solution = least_squares(misfit, start / scale, x_scale="jac", method="trf")
    index = np.repeat([groups.index(group) for group in observations.groups], observations.counts.shape[1])
    covariance = _robust_covariance(np.asarray(solution.jac), np.asarray(solution.fun), index)
    return FittedCurve(
        form=form,
        values=np.asarray(solution.x * scale),
        covariance=covariance * np.outer(scale, scale),
        reference=reference,
        recordings=len(groups),
        residual=float(np.sqrt(np.mean(solution.fun**2))),
        quantile=float(student.ppf(0.5 + confidence / 2, len(groups) - 1)),
    )


def _predict_counts(form: CurveForm, values: FloatArray, forces: FloatArray, above_reference: FloatArray) -> FloatArray:
    """Evaluate the characteristic.

    Args:
        form: Selection of the fitted parameters.
        values: Parameters in the order of `form.names`, shape (p,).
        forces: Texel forces, shape (m, n) [N].
        above_reference: Temperature minus the reference temperature T_0 at each observation, shape (m,) [K].

    Returns:
        Counts, shape (m, n) [-].
    """
    signal = np.polynomial.polynomial.polyval(forces, values[: form.degree + 1])
    shared = dict(zip(form.shared_names, values.tolist(), strict=False))
    if form.temperature:
        signal = signal * (1 + shared["temperature"] * above_reference)[:, None]
    if form.gains:
        free = values[len(shared) :]
        signal = signal * np.append(free, len(free) + 1 - free.sum())
    signal = np.maximum(signal - form.threshold, 0.0)
    if not form.saturation:
        return np.asarray(signal)
    return np.asarray(saturate(signal, shared["output_max"], abs(shared["saturation_band"])))


def _start_and_scale(form: CurveForm, forces: FloatArray, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the initial parameters of the fit, and their typical magnitudes, which scale the steps of the solver.

    The initial curve is a straight line through counts that are neither zero nor near saturation, without dependence
    on temperature and with equal gains.

    Returns:
        Initial parameters and magnitudes, each of shape (p,).
    """
    top = float(counts.max())
    live = (counts > 0) & (counts < (0.8 * top if form.saturation else np.inf))
    slope, offset = np.polyfit(forces[live], counts[live] + form.threshold, 1) if live.sum() > 1 else (1.0, 0.0)
    polynomial = np.zeros(form.degree + 1)
    polynomial[:2] = offset, slope
    parts = [(polynomial, 1e3 * top * np.maximum(forces.max(), 1e-9) ** -np.arange(form.degree + 1.0))]
    if form.temperature:
        parts.append((np.zeros(1), np.full(1, 10.0)))
    if form.saturation:
        parts.append((np.array([1.02 * top, 0.2 * top]), np.full(2, top)))
    if form.gains:
        parts.append((np.ones(forces.shape[1] - 1), np.ones(forces.shape[1] - 1)))
    start, typical = (np.concatenate(each) for each in zip(*parts, strict=True))
    return start, np.maximum(np.abs(start), 1e-3 * typical)


def _robust_covariance(jacobian: FloatArray, residual: FloatArray, groups: npt.NDArray[np.int64]) -> FloatArray:
    """Return the covariance of the parameters, clustered by recording, with the CR3 correction.

    Args:
        jacobian: Derivatives of the residuals with respect to the parameters, shape (r, p) for r residuals.
        residual: Residuals of the fit, shape (r,).
        groups: Number of the recording that each residual belongs to, shape (r,).

    Returns:
        Covariance, shape (p, p).
    """
    information = jacobian.T @ jacobian
    bread = np.linalg.pinv(information, hermitian=True)
    count = int(groups.max()) + 1
    meat = np.zeros_like(bread)
    for group in range(count):
        rows = jacobian[groups == group]
        own, score = rows.T @ rows, rows.T @ residual[groups == group]
        # X' (I - X B X')^-1 r for the rows X of the Jacobian and the residuals r of one recording, with B the inverse
        # of `information`.  Woodbury's identity replaces the inverse by that of a p x p matrix.
        corrected = score + own @ np.linalg.pinv(information - own, rcond=1e-10, hermitian=True) @ score
        meat += np.outer(corrected, corrected)
    return np.asarray((count - 1) / count * bread @ meat @ bread)
