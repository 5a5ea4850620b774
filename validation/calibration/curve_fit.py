"""Least-squares fit of a sensor's characteristic, with intervals that hold when errors share a recording.

Counts of texel i in observation k under the texel force f = share_i load_k are modelled as

    counts = S(g_i (1 + t (T_k - T_0)) P(f) - threshold),   never below 0,

with a polynomial P of degree 1 or 5, gains g of mean 1, a temperature coefficient t and the soft saturation S of
`fastmodel.signal.electronics`.  `CurveForm` selects which of these are fitted.

All frames of one recording share the same errors (placement, drift, history of the rubber), so the number of recordings
counts as evidence, not the number of frames.  The covariance is the cluster-robust one with the CR3 correction (Bell
and McCaffrey 2002), which is close to a jackknife over recordings.  Intervals use Student's t with one degree of
freedom less than there are recordings.
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

#: Fewest recordings for an interval: the spread between two is too uncertain [-].
_FEWEST_RECORDINGS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Mean tactile images under known loads.

    Attributes:
        loads: Load of each observation, shape (m,) [N].
        counts: Mean counts, shape (m, n) [-].
        shares: Share of the load on each texel, shape (n,) [-].
        groups: Recording of each observation, shape (m,).
        temperatures: Temperature of each observation, NaN if unknown, shape (m,) [degC].
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
        """Texel forces, shape (m, n) [N]."""
        return np.outer(self.loads, self.shares)


@dataclass(frozen=True, kw_only=True)
class CurveForm:
    """Which parts of the curve are fitted.

    Attributes:
        degree: Degree of the polynomial, 1 or 5 [-].
        saturation: Whether largest count and saturation band are fitted.
        gains: Whether every texel has its own gain.
        temperature: Whether the sensitivity depends on the temperature.
        threshold: Counts that the firmware subtracts [-].
    """

    degree: int
    saturation: bool
    gains: bool
    temperature: bool
    threshold: float

    @property
    def shared_names(self) -> list[str]:
        """Names of the parameters that all texels share, in the order of the fit."""
        names = [f"c{power}" for power in range(self.degree + 1)]
        names += ["temperature"] if self.temperature else []
        return names + (["output_max", "saturation_band"] if self.saturation else [])

    def names(self, texels: int) -> list[str]:
        """Names of all parameters, in the order of the fit; the last gain follows from the mean of 1."""
        return self.shared_names + ([f"gain{texel}" for texel in range(texels - 1)] if self.gains else [])


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedCurve:
    """Parameters of the curve with their covariance.

    Attributes:
        form: Which parts were fitted.
        values: Parameters in the order of `form.names`; coefficients in SI units.
        covariance: Cluster-robust covariance of the parameters.
        reference: Temperature T_0 at which the temperature factor is 1 [degC].
        recordings: Number of recordings [-].
        residual: Root mean square of counts minus model [-].
        quantile: Student's t for the requested confidence [-].
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
        """Half width of the interval of each parameter."""
        return self.quantile * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def value(self, name: str) -> float:
        """A parameter that all texels share."""
        return float(self.values[self.form.shared_names.index(name)])

    def predict(self, observations: Observations) -> FloatArray:
        """Counts by the curve, shape (m, n) [-]."""
        return _predict_counts(self.form, self.values, observations.forces, observations.temperatures - self.reference)

    def interval(self, gradient: FloatArray) -> float:
        """Half width of the interval of a function of the parameters with this gradient."""
        variance = float(gradient @ self.covariance @ gradient)
        return self.quantile * math.sqrt(max(0.0, variance))


def fit_curve(observations: Observations, form: CurveForm, *, confidence: float = 0.95) -> FittedCurve:
    """Least squares over all texels and observations.

    Args:
        observations: Mean images under known loads.
        form: Which parts of the curve to fit.
        confidence: Confidence of the intervals, 0..1 [-].

    Raises:
        ValueError: If there are fewer than three recordings or fewer loads than the curve has coefficients.
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
    warmth = observations.temperatures - reference if form.temperature else np.zeros(len(forces))
    start, scale = _start_and_scale(form, forces, observations.counts)

    def misfit(scaled: FloatArray) -> FloatArray:
        return (_predict_counts(form, scaled * scale, forces, warmth) - observations.counts).ravel()

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


def _predict_counts(form: CurveForm, values: FloatArray, forces: FloatArray, warmth: FloatArray) -> FloatArray:
    """Counts by the curve, shape (m, n) [-]; `warmth` is the temperature above T_0, shape (m,) [K]."""
    signal = np.polynomial.polynomial.polyval(forces, values[: form.degree + 1])
    shared = dict(zip(form.shared_names, values.tolist(), strict=False))
    if form.temperature:
        signal = signal * (1 + shared["temperature"] * warmth)[:, None]
    if form.gains:
        free = values[len(shared) :]
        signal = signal * np.append(free, len(free) + 1 - free.sum())
    signal = np.maximum(signal - form.threshold, 0.0)
    if not form.saturation:
        return np.asarray(signal)
    return saturate(signal, shared["output_max"], abs(shared["saturation_band"]))


def _start_and_scale(form: CurveForm, forces: FloatArray, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Start of the fit, and the size of each parameter, by which the solver's steps are scaled.

    The start is a straight line through counts that are neither zero nor near saturation, without dependence on
    temperature and with equal gains.
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
    """CR3 covariance of the parameters, clustered by group."""
    information = jacobian.T @ jacobian
    bread = np.linalg.pinv(information, hermitian=True)
    count = int(groups.max()) + 1
    meat = np.zeros_like(bread)
    for group in range(count):
        rows = jacobian[groups == group]
        own, score = rows.T @ rows, rows.T @ residual[groups == group]
        # X' (I - X B X')^-1 r by Woodbury's identity, which needs the inverse of a small matrix only
        corrected = score + own @ np.linalg.pinv(information - own, rcond=1e-10, hermitian=True) @ score
        meat += np.outer(corrected, corrected)
    return np.asarray((count - 1) / count * bread @ meat @ bread)
