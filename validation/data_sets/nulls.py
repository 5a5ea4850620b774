"""Null models: predictions of counts without a model of the sensor, with the nuisance terms of the forward model.

A null model has a shape (such as a line in the load for each texel) and terms that describe the state of the sensor:

    counts = S(max(0, level (1 + a (T - T0)) C(t) / C(t0) F(load) - threshold)),  C(t) = 1 + c ln(t / 2 s)

Here F is the shape, a one temperature coefficient for all texels, c the median of the measured creep coefficients, and
S the clipping at the largest count, or the soft saturation of `fastmodel.signal.electronics` with one band for all
texels.  The level of a new session is fitted to its placing images, at their temperature.  The fitted images alone
decide whether a is fitted.  Counts of zero mean that the signal is at most the threshold, unless there is no threshold
and some counts are negative, as the noise about the zero of an offset.  a has a wide prior, the band that of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from fastmodel.signal.electronics import saturate
from meshes.array_types import FloatArray
from validation.calibration.forward_fit import NUMBERS
from validation.calibration.model import CREEP_START, Observations
from validation.calibration.temperatures import describe_confounding

#: Function from observations, whose counts are not used, to the predicted counts of their m images, shape (m, n) [-].
Predictor = Callable[[Observations], FloatArray]
#: Function from loads and temperatures of images to their signals, shape (m, n) [counts].
Signal = Callable[[FloatArray, FloatArray], FloatArray]
#: Function from loads, temperatures and signals of the fitted images to a function for other images.
Shape = Callable[[FloatArray, FloatArray, FloatArray], Signal]

#: Repetitions in which the signals of texels that read zero settle [-].
_ROUNDS = 20
#: Arguments of `scipy.optimize.minimize` for the common parameters.
_MINIMISER: dict[str, Any] = {"method": "Powell", "tol": 1e-3}
#: Spread of the prior of the temperature coefficient [1/K]; wide, so that the images decide.
_TEMPERATURE_SPREAD = 0.1
#: Smallest distance of a count from the largest one, over the band, for which the saturation is inverted [-].
_NEAR = 0.01


def fit_zeros(_loads: FloatArray, _temperatures: FloatArray, signals: FloatArray) -> Signal:
    """Return a signal of zero."""
    return lambda loads, _temperatures: np.zeros((len(loads), signals.shape[1]))


def fit_pattern(loads: FloatArray, _temperatures: FloatArray, signals: FloatArray) -> Signal:
    """Multiply a mean image by a quadratic in the load, fitted to the sizes of the images."""
    pattern = signals.mean(axis=0)
    size = signals @ pattern / max(float(pattern @ pattern), 1e-9)
    curve = np.polynomial.Polynomial.fit(loads, size, min(2, len(np.unique(loads)) - 1))
    return lambda loads, _temperatures: np.outer(curve(loads), pattern)


def fit_polynomials(
    loads: FloatArray, temperatures: FloatArray, signals: FloatArray, *, degree: int, warm: bool = False
) -> Signal:
    """Fit a polynomial in the load for every texel; with `warm`, each coefficient is linear in the temperature."""
    largest = max(float(loads.max()), 1e-9)
    middle, spread = float(np.mean(temperatures)), max(float(np.std(temperatures)), 1e-9)

    def terms(loads: FloatArray, temperatures: FloatArray) -> FloatArray:
        powers = (loads[:, None] / largest) ** np.arange(degree + 1)
        return np.hstack([powers, powers * ((temperatures - middle) / spread)[:, None]]) if warm else powers

    coefficients = np.linalg.lstsq(terms(loads, temperatures), signals, rcond=1e-6)[0]
    return lambda loads, temperatures: np.asarray(terms(loads, temperatures) @ coefficients)


def fit_ratio(loads: FloatArray, _temperatures: FloatArray, signals: FloatArray) -> Signal:
    """Multiply the image of the heaviest load by the ratio of the loads."""
    heaviest = max(float(loads.max()), 1e-9)
    image = signals[loads >= heaviest * (1 - 1e-9)].mean(axis=0)
    return lambda loads, _temperatures: np.outer(loads / heaviest, image)


@dataclass(frozen=True, kw_only=True)
class NullModel:
    """A shape and the terms that it is fitted with.

    Attributes:
        shape: The shape.
        dead_zone: Whether the threshold of the firmware is added to the counts before the shape is fitted.
        soft: Whether a band of soft saturation is fitted; counts are clipped otherwise.
        renew: What placing images change besides the level: nothing (`level`), the shape, to which they replace the
            fitted images (`image`), or a factor on each texel (`texel`).
        least_temperatures: Smallest number of distinct temperatures that the shape needs [-].
    """

    shape: Shape
    dead_zone: bool = True
    soft: bool = False
    renew: str = "level"
    least_temperatures: int = 0

    def applies(self, fitted: Observations, placed: Observations | None) -> bool:
        """Return whether the images determine the model."""
        known = fitted.temperatures[np.isfinite(fitted.temperatures)]
        warm = self.least_temperatures == 0 or len(known) == len(fitted.loads)
        varied = len(np.unique(known)) >= self.least_temperatures
        return warm and varied and (self.renew != "texel" or placed is not None)

    def fit(self, fitted: Observations, placed: Observations | None, output_max: float) -> Predictor:
        """Fit the model to images.

        Args:
            fitted: Fitted images.
            placed: Images of the session that is predicted; None without them.
            output_max: Largest count; inf for none [-].
        """
        fit = _NullFit(self, fitted, output_max)
        free = np.array([not describe_confounding(fitted), self.soft and bool(np.isfinite(output_max))])

        def expand(part: FloatArray) -> FloatArray:
            both = np.zeros(2)
            both[free] = part
            return both

        def cost(part: FloatArray) -> float:
            return fit.cost(expand(part))

        if not free.any():
            return fit.predictor(np.zeros(2), placed)
        found = minimize(cost, np.zeros(int(free.sum())), **_MINIMISER)
        return fit.predictor(expand(found.x), placed)


class _NullFit:
    """Fit of a null model for values of its two common parameters.

    The parameters are the temperature coefficient and the logit of the band over the largest count, both over the
    spreads of their priors.
    """

    def __init__(self, model: NullModel, fitted: Observations, output_max: float) -> None:
        self._model, self._fitted, self._most = model, fitted, output_max
        self._clips = bool((fitted.counts[fitted.measured] >= 0).all())
        known = fitted.creep[np.isfinite(fitted.creep)]
        self._creep = float(np.median(known)) if known.size else 0.0
        warm, ages = fitted.temperatures, fitted.ages
        self._middle = float(np.nanmean(warm)) if np.isfinite(warm).any() else 0.0
        self._age = float(np.nanmean(ages)) if np.isfinite(ages).any() else CREEP_START

    def cost(self, common: FloatArray) -> float:
        """Return the negative logarithm of the posterior density, up to a constant, for the two common parameters."""
        seen = self._fitted
        misfit = (self.predictor(common, None)(seen) - seen.counts)[seen.measured]
        return float(0.5 * misfit.size * np.log(max(float(misfit @ misfit), 1e-9)) + 0.5 * common @ common)

    def predictor(self, common: FloatArray, placed: Observations | None) -> Predictor:
        """Return the predictor for the two common parameters; the shape is fitted by least squares."""
        model, band = self._model, 0.0
        if model.soft and np.isfinite(self._most):
            band = self._most / (1 + float(np.exp(-NUMBERS.band - NUMBERS.band_spread * common[1])))
        coefficient = _TEMPERATURE_SPREAD * common[0]
        signal = self._fit_signal(self._fitted, coefficient, band)
        if placed is not None:
            signal = self._renew(signal, placed, coefficient, band)

        def predict(seen: Observations) -> FloatArray:
            signals = self._factor(seen, coefficient) * signal(seen.loads, self._warm(seen)) - self._threshold(seen)
            return np.asarray(saturate(np.maximum(signals, 0.0), self._most, band))

        return predict

    def _warm(self, seen: Observations) -> FloatArray:
        return np.nan_to_num(seen.temperatures, nan=self._middle)

    def _threshold(self, seen: Observations) -> FloatArray:
        return seen.thresholds[:, None] * float(self._model.dead_zone)

    def _find_zero(self, seen: Observations) -> npt.NDArray[np.bool_]:
        """Return which counts are clipped at zero, shape (m, n)."""
        return np.asarray((seen.counts <= 0) & (self._clips | (seen.thresholds[:, None] > 0)))

    def _factor(self, seen: Observations, coefficient: float) -> FloatArray:
        """Return the factor of temperature and creep on the signals of each image, shape (m, 1) [-]."""
        ages = np.nan_to_num(seen.ages, nan=self._age)
        crept, middle = (1 + self._creep * np.log(age / CREEP_START) for age in (ages, self._age))
        warmer = np.maximum(1 + coefficient * (self._warm(seen) - self._middle), 0.1)
        return np.asarray((warmer * crept / middle)[:, None])

    def _fit_signal(self, seen: Observations, coefficient: float, band: float) -> Signal:
        """Fit the shape; texels that read zero have at most the threshold as signal."""
        factor, threshold = self._factor(seen, coefficient), self._threshold(seen)
        signals = (self._straighten(seen.counts, band) + threshold) / factor
        warm, zero = self._warm(seen), self._find_zero(seen)
        found = self._model.shape(seen.loads, warm, signals)
        for _ in range(_ROUNDS if zero.any() else 0):
            filled = np.where(zero, np.minimum(found(seen.loads, warm), threshold / factor), signals)
            found = self._model.shape(seen.loads, warm, filled)
        return found

    def _straighten(self, counts: FloatArray, band: float) -> FloatArray:
        """Invert the soft saturation."""
        if not band:
            return counts
        knee, left = self._most - band, np.maximum((self._most - counts) / band, _NEAR)
        return np.where(counts > knee, knee - band * np.log(left), counts)

    def _renew(self, signal: Signal, placed: Observations, coefficient: float, band: float) -> Signal:
        """Scale the signal to placing images as the model states."""
        factor, threshold = self._factor(placed, coefficient), self._threshold(placed)
        lit = placed.measured & ~self._find_zero(placed)
        recorded = np.where(lit, (self._straighten(placed.counts, band) + threshold) / factor, 0.0)
        expected = signal(placed.loads, self._warm(placed))
        if self._model.renew == "image":
            pattern = recorded.sum(axis=0) / max(float(expected.sum()), 1e-9)
            return lambda loads, warm: np.outer(signal(loads, warm).sum(axis=1), pattern)
        overlap, square = np.where(lit, recorded * expected, 0.0), np.where(lit, expected**2, 0.0)
        level = np.full(square.shape[1], overlap.sum() / max(float(square.sum()), 1e-9))
        if self._model.renew == "texel":
            level = np.divide(overlap.sum(axis=0), square.sum(axis=0), out=level, where=square.sum(axis=0) > 0)
        return lambda loads, warm: level * signal(loads, warm)


#: A line in the load for each texel.
LINE = NullModel(shape=partial(fit_polynomials, degree=1))
#: Null models by name.
NULLS: Mapping[str, NullModel] = MappingProxyType(
    {
        "zeros": NullModel(shape=fit_zeros),
        "mean pattern x load curve": NullModel(shape=fit_pattern, renew="image"),
        "quadratic per texel": NullModel(shape=partial(fit_polynomials, degree=2)),
        "line per texel": LINE,
        "line per texel, saturating": replace(LINE, soft=True),
        "line per texel, each scaled to the placing image": replace(LINE, renew="texel"),
        "line per texel x temperature per texel": NullModel(
            shape=partial(fit_polynomials, degree=1, warm=True), least_temperatures=2
        ),
        "heaviest image x load ratio": NullModel(shape=fit_ratio, dead_zone=False, renew="image"),
        "heaviest image x load ratio, threshold added back": NullModel(shape=fit_ratio, soft=True, renew="image"),
    }
)
