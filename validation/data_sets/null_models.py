"""Null models: predictions of recorded images from the fitted images alone, without any model of the sensor.

A score of a model must be better than those of the null models to mean something.  As in the models, predicted counts
are limited to the range from zero to the largest count.  If some recordings only place the indenter, the null models
see them too: the pattern and the heaviest image are then taken from those.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType

import numpy as np

from meshes.array_types import FloatArray
from validation.calibration.observations import Observations, join_observations

#: Function from load [N] and temperature [degC] to predicted counts of the n texels, shape (n,) [-].
Predictor = Callable[[float, float], FloatArray]
#: Function from the fitted images, the images that place the indenter (or None), and the largest count to a predictor.
NullModel = Callable[[Observations, Observations | None, float], Predictor]


def fit_zeros(fitted: Observations, placed: Observations | None, output_max: float) -> Predictor:  # noqa: ARG001
    """Return a predictor that gives zero counts for every texel under every load."""
    empty = np.zeros(fitted.counts.shape[1])
    return lambda _load, _temperature: empty


def fit_pattern(fitted: Observations, placed: Observations | None, output_max: float) -> Predictor:
    """Return a predictor that multiplies a mean image by a quadratic in the load, fitted to the sizes of the images.

    With placing images, the pattern is their mean, and the quadratic is scaled to their sums of counts.
    """
    pattern = fitted.counts.mean(axis=0)
    size = fitted.counts @ pattern / max(float(pattern @ pattern), 1e-9)
    degree = min(2, len(np.unique(fitted.loads)) - 1)
    curve = np.polynomial.Polynomial.fit(fitted.loads, size, degree)
    if placed is not None:
        ratio = placed.counts.sum() / max(float(sum(curve(load) for load in placed.loads)) * pattern.sum(), 1e-9)
        pattern = (
            placed.counts.mean(axis=0) / max(float(placed.counts.mean(axis=0).sum()), 1e-9) * pattern.sum() * ratio
        )
    return lambda load, _temperature: np.clip(float(curve(load)) * pattern, 0.0, output_max)


def fit_polynomials(
    fitted: Observations, placed: Observations | None, output_max: float, *, degree: int, temperature: bool = False
) -> Predictor:
    """Return a predictor with a separate polynomial in the load for every texel, by least squares.

    Args:
        fitted: Fitted images.
        placed: Images that place the indenter; fitted as well.
        output_max: Largest count [-].
        degree: Degree of the polynomial [-].
        temperature: Whether each coefficient is a linear function of the temperature.
    """
    seen = fitted if placed is None else join_observations([fitted, placed])
    warm = np.nan_to_num(seen.temperatures, nan=0.0)
    middle, spread = float(warm.mean()), max(float(warm.std()), 1e-9)
    largest = max(float(seen.loads.max()), 1e-9)

    def terms(load: FloatArray, degrees: FloatArray) -> FloatArray:
        powers = (load[:, None] / largest) ** np.arange(degree + 1)
        warmer = ((np.nan_to_num(degrees, nan=middle) - middle) / spread)[:, None]
        return np.hstack([powers, powers * warmer]) if temperature else powers

    coefficients = np.linalg.lstsq(terms(seen.loads, seen.temperatures), seen.counts, rcond=1e-6)[0]

    def predict(load: float, degrees: float) -> FloatArray:
        return np.asarray(np.clip((terms(np.array([load]), np.array([degrees])) @ coefficients)[0], 0.0, output_max))

    return predict


def fit_heaviest(fitted: Observations, placed: Observations | None, output_max: float) -> Predictor:
    """Return a predictor that multiplies the image of the heaviest fitted load by the ratio of the loads."""
    seen = fitted if placed is None else placed
    heaviest = float(seen.loads.max())
    image = seen.counts[seen.loads >= heaviest * (1 - 1e-9)].mean(axis=0)
    return lambda load, _temperature: np.clip(image * load / max(heaviest, 1e-9), 0.0, output_max)


#: Null models by name.
NULLS: Mapping[str, NullModel] = MappingProxyType(
    {
        "zeros": fit_zeros,
        "mean pattern x load curve": fit_pattern,
        "quadratic per texel": partial(fit_polynomials, degree=2),
        "line per texel": partial(fit_polynomials, degree=1),
        "line per texel x temperature": partial(fit_polynomials, degree=1, temperature=True),
        "heaviest fitted image x load ratio": fit_heaviest,
    }
)
