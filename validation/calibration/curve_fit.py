"""The curve that calibration fits, its least squares, and intervals that hold when errors share a recording.

Counts of texel i in observation k under the texel force f = share_i load_k are modelled as

    counts = S(g_i (1 + t (T_k - T_0)) P(f) - threshold),   never below 0,

with P a polynomial of degree 1 or 5, gains g of mean 1, a temperature coefficient t and the soft saturation S of
`fastmodel.signal.electronics`.  What is not asked for is left out.

All frames of one recording err together (placement, drift, the state of the rubber), so recordings, not frames, count
as evidence: the covariance is the cluster-robust one with the CR3 correction (Bell and McCaffrey 2002), which is close
to a jackknife over recordings, and intervals take Student's t with as many degrees of freedom as there are recordings
less one.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Mean tactile images under known loads.

    Attributes:
        loads: Load of each observation, shape (m,) [N].
        counts: Mean counts, shape (m, n) [-].
        shares: Share of the load on each texel, shape (n,) [-].
        groups: Which recording each observation comes from, shape (m,).
        temperatures: Shape (m,), NaN where unknown [degC].
    """

    loads: FloatArray
    counts: FloatArray
    shares: FloatArray
    groups: tuple[str, ...]
    temperatures: FloatArray

    def __post_init__(self) -> None:
        """Check that the parts fit one another.

        Raises:
            ValueError: If shapes disagree or a load or share is not a number of 0 or more.
        """
        m, n = len(self.loads), len(self.shares)
        if self.counts.shape != (m, n) or self.temperatures.shape != (m,) or len(self.groups) != m:
            raise ValueError(
                f"{m} loads and {n} shares need counts of shape ({m}, {n}), groups and temperatures of {m}"
            )
        for name, values in (("loads", self.loads), ("shares", self.shares)):
            if not (np.isfinite(values).all() and (values >= 0).all()):
                raise ValueError(f"{name} must be numbers of 0 or more")

    @property
    def forces(self) -> FloatArray:
        """Texel forces, shape (m, n) [N]."""
        return np.outer(self.loads, self.shares)

    def select(self, keep: npt.NDArray[np.bool_]) -> Observations:
        """Only some of the observations, `keep` of shape (m,)."""
        groups = tuple(group for group, kept in zip(self.groups, keep, strict=True) if kept)
        return Observations(
            loads=self.loads[keep],
            counts=self.counts[keep],
            shares=self.shares,
            groups=groups,
            temperatures=self.temperatures[keep],
        )


@dataclass(frozen=True, kw_only=True)
class Form:
    """Which parts of the curve are fitted.

    Attributes:
        degree: Of the polynomial, 1 or 5.
        saturation: Whether largest count and saturation band are fitted.
        gains: Whether every texel has a gain of its own.
        temperature: Whether the sensitivity may depend on the temperature.
        threshold: Counts that the firmware subtracts.
    """

    degree: int
    saturation: bool
    gains: bool
    temperature: bool
    threshold: float

    def names(self, texels: int) -> list[str]:
        """Names of the parameters, in the order of the fit."""
        names = [f"c{power}" for power in range(self.degree + 1)]
        names += ["temperature"] if self.temperature else []
        names += ["output_max", "saturation_band"] if self.saturation else []
        return names + ([f"gain{texel}" for texel in range(texels - 1)] if self.gains else [])


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedCurve:
    """Parameters with their covariance.

    Attributes:
        form: Which parts were fitted.
        values: Parameters in the order of `form.names`, polynomial in SI.
        covariance: Cluster-robust covariance of the same.
        reference: Temperature at which the gain has its value, T_0 [degC].
        recordings: Number of recordings.
        residual: Root mean square of counts minus model [-].
        quantile: Student's t for the wanted confidence.
    """

    form: Form
    values: FloatArray
    covariance: FloatArray
    reference: float
    recordings: int
    residual: float
    quantile: float

    def predict(self, observations: Observations) -> FloatArray:
        """Counts that the curve gives, shape (m, n)."""
        return _model(self.form, self.values, observations.forces, observations.temperatures - self.reference)

    def interval(self, gradient: FloatArray) -> float:
        """Half width of the interval of a function of the parameters with this gradient."""
        variance = float(gradient @ self.covariance @ gradient)
        return self.quantile * math.sqrt(max(0.0, variance))


def fit_curve(observations: Observations, form: Form, *, confidence: float = 0.95) -> FittedCurve:
    """Least squares over all texels and observations.

    Args:
        observations: What to fit.
        form: Which parts of the curve to fit.
        confidence: Of the intervals, 0..1 [-].

    Raises:
        ValueError: If there are fewer than three recordings or fewer loads than the curve needs.
    """
    groups = list(dict.fromkeys(observations.groups))
    loads = len(np.unique(observations.loads))
    if len(groups) < 3 or loads < form.degree + 1:  # noqa: PLR2004 -- two recordings tell no spread
        raise ValueError(
            f"{len(groups)} recordings with {loads} loads cannot fix a curve of degree {form.degree}; "
            f"at least 3 recordings and {form.degree + 1} loads are needed"
        )
    forces = observations.forces
    reference = float(np.nanmean(observations.temperatures)) if form.temperature else 0.0
    warmth = observations.temperatures - reference if form.temperature else np.zeros(len(forces))
    start = _start(form, forces, observations.counts)
    scale = np.maximum(np.abs(start), 1e-3 * _typical(form, forces, observations.counts))

    def misfit(scaled: FloatArray) -> FloatArray:
        return (_model(form, scaled * scale, forces, warmth) - observations.counts).ravel()

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


def _model(form: Form, values: FloatArray, forces: FloatArray, warmth: FloatArray) -> FloatArray:
    """Counts, shape (m, n)."""
    rest = values[form.degree + 1 :]
    signal = np.polynomial.polynomial.polyval(forces, values[: form.degree + 1])
    if form.temperature:
        signal = signal * (1 + rest[0] * warmth)[:, None]
        rest = rest[1:]
    largest, band = (rest[0], abs(rest[1])) if form.saturation else (np.inf, 0.0)
    if form.gains:
        free = rest[2 if form.saturation else 0 :]
        signal = signal * np.append(free, len(free) + 1 - free.sum())
    signal = np.maximum(signal - form.threshold, 0.0)
    return saturate(signal, largest, band) if form.saturation else signal


def _start(form: Form, forces: FloatArray, counts: FloatArray) -> FloatArray:
    """A straight line through the middle, no dependence on temperature, equal gains."""
    ceiling = 0.8 * float(counts.max()) if form.saturation else float(np.inf)
    live = (counts > 0) & (counts < ceiling)
    slope, offset = np.polyfit(forces[live], counts[live] + form.threshold, 1) if live.sum() > 1 else (1.0, 0.0)
    polynomial = np.zeros(form.degree + 1)
    polynomial[:2] = offset, slope
    start = [*polynomial]
    start += [0.0] if form.temperature else []
    start += [1.02 * counts.max(), 0.2 * counts.max()] if form.saturation else []
    start += [1.0] * (forces.shape[1] - 1) if form.gains else []
    return np.array(start)


def _typical(form: Form, forces: FloatArray, counts: FloatArray) -> FloatArray:
    """Size of each parameter, so that the solver's steps make sense."""
    powers = np.maximum(forces.max(), 1e-9) ** -np.arange(form.degree + 1.0)
    typical = [*(1e3 * counts.max() * powers)]
    typical += [10.0] if form.temperature else []
    typical += [counts.max()] * 2 if form.saturation else []
    typical += [1.0] * (forces.shape[1] - 1) if form.gains else []
    return np.array(typical)


def _robust_covariance(jacobian: FloatArray, residual: FloatArray, groups: npt.NDArray[np.int64]) -> FloatArray:
    """CR3 covariance over groups."""
    information = jacobian.T @ jacobian
    bread = np.linalg.pinv(information, hermitian=True)
    count = int(groups.max()) + 1
    meat = np.zeros_like(bread)
    for group in range(count):
        rows = jacobian[groups == group]
        own, score = rows.T @ rows, rows.T @ residual[groups == group]
        # X' (I - X B X')^-1 r, by Woodbury's identity in the parameters' few dimensions
        corrected = score + own @ np.linalg.pinv(information - own, rcond=1e-10, hermitian=True) @ score
        meat += np.outer(corrected, corrected)
    return np.asarray((count - 1) / count * bread @ meat @ bread)
