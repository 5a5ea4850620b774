"""Fits a forward model of the stamp and one curve from force to counts to recordings, by least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from meshes.array import FloatArray, TexelArray
from validation.calibration.stamp.case import StampCase
from validation.calibration.stamp.forward_models import Candidate, StampModel, uniform
from validation.calibration.stamp.load_curve import LOWER, START, UPPER, LoadCurve
from validation.metrics import centre_of_pressure

#: Scale by which differences of counts are divided to make the residuals of the fit of order one [counts].
_UNIT = 100.0
#: Standard deviation of the Gaussian prior on ln(gain) of a texel [-].  A gain with |ln(gain)| of this value adds as
#: much to the sum of squares as one residual of `_UNIT` counts.
_GAIN_SPREAD = 0.5
#: Tolerance of |gain - 1| below which a gain counts as not fitted, because no fitted image determines it [-].
_UNFITTED_GAIN = 1e-6
#: Step of the finite differences of the Jacobian, in transformed parameters (logarithms and logit) [-].
_STEP = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class StampFit:
    """Forward model of the stamp with fitted parameters, load curve and gains.

    Attributes:
        candidate: The parametrisation of the forward model with the smallest residual.
        shape: The p fitted parameters of the candidate, shape (p,).
        load_curve: The fitted curve from texel force to counts, one for all texels.
        gains: Gain of each of the n texels, shape (n,) [-]; None if no gains were fitted.
        rms: Root mean square of predicted minus recorded counts, over active texels of the fitted recordings [counts].
    """

    candidate: Candidate
    shape: FloatArray
    load_curve: LoadCurve
    gains: FloatArray | None
    rms: float

    def counts(self, load: float) -> FloatArray:
        """Predict the mean counts of each texel under a weight, shape (n,) [-].

        Args:
            load: Weight on the stamp [N].
        """
        forces = load * self.candidate.texel_forces(self.shape)
        return self.load_curve.counts(forces, 1.0 if self.gains is None else self.gains)

    def parameters(self) -> dict[str, float]:
        """Return the fitted parameters by name; the names end in the units."""
        described = self.candidate.describe(self.shape) | {
            "sensitivity_per_N": self.load_curve.sensitivity,
            "dead_force_N": self.load_curve.dead_force,
            "saturation_band_counts": self.load_curve.saturation_band,
        }
        if self.gains is not None:
            fitted = self.gains[np.abs(self.gains - 1) > _UNFITTED_GAIN]
            described["gain_sd"] = float(fitted.std()) if fitted.size else 0.0
        return described


@dataclass(frozen=True, kw_only=True, eq=False)
class _Data:
    """Loads and counts of the recordings that are fitted, as arrays.

    Attributes:
        loads: Weight on the stamp in each of the k recordings, shape (k,) [N].
        counts: Mean counts of the n texels, shape (k, n) [-].
        active: Whether each texel measures, shape (n,).
        output_max: Largest count after subtraction of the threshold [-].
    """

    loads: FloatArray
    counts: FloatArray
    active: npt.NDArray[np.bool_]
    output_max: int


def fit(
    model: StampModel, cases: Sequence[StampCase], array: TexelArray, *, output_max: int
) -> tuple[StampFit, StampFit]:
    """Fit a forward model of the stamp to recordings, without and with texel gains.

    Args:
        model: The forward model.
        cases: Recordings to fit.
        array: The texels of the pressed array.
        output_max: Largest count after subtraction of the threshold; it is given, not fitted [-].

    Returns:
        The fit without texel gains, and a second fit that starts from the first and adds a gain per texel.
    """
    data = _Data(
        loads=np.array([case.file.load for case in cases]),
        counts=np.array([case.counts for case in cases]),
        active=array.active,
        output_max=output_max,
    )
    # The forces that the fast model gives are discontinuous functions of the pose, so their gradient cannot be used.
    # The first estimate of the position is therefore fitted with uniform pressure under the stamp.
    x, y = centre_of_pressure(data.counts.sum(axis=0), array.centres[:, :2]).tolist()
    x, y, *_ = _fit(uniform(array, (x, y)), data).shape.tolist()
    fits = [_fit(candidate, data) for candidate in model.candidates((x, y))]
    plain = min(fits, key=lambda each: each.rms)
    return plain, _with_gains(plain, data)


def _fit(candidate: Candidate, data: _Data) -> StampFit:
    """Fit the parameters of a candidate and the load curve, without texel gains."""
    split = len(candidate.start)

    # Finite differences in the parameters of the load curve leave the texel forces unchanged, so the forces of the
    # latest parameters of the candidate are cached.
    @lru_cache(maxsize=1)
    def forces(*shape: float) -> FloatArray:
        return np.outer(data.loads, candidate.texel_forces(np.array(shape)))

    def misfit(vector: FloatArray) -> FloatArray:
        predicted = LoadCurve.from_vector(vector[split:], data.output_max).counts(forces(*vector[:split]))
        return (predicted - data.counts) / _UNIT

    def residual(vector: FloatArray) -> FloatArray:
        return misfit(vector)[:, data.active].ravel()

    solution = least_squares(
        residual,
        np.r_[candidate.start, START],
        bounds=(np.r_[candidate.lower, LOWER], np.r_[candidate.upper, UPPER]),
        x_scale=_scale(candidate),
        ftol=1e-4,
        xtol=1e-4,
        max_nfev=60,
    )
    return StampFit(
        candidate=candidate,
        shape=solution.x[:split],
        load_curve=LoadCurve.from_vector(solution.x[split:], data.output_max),
        gains=None,
        rms=_rms(misfit(solution.x), data),
    )


def _rms(misfit: FloatArray, data: _Data) -> float:
    """Return the root mean square over active texels [counts] of residuals in units of `_UNIT`, shape (k, n)."""
    return float(np.sqrt(np.mean(misfit[:, data.active] ** 2)) * _UNIT)


def _scale(candidate: Candidate) -> FloatArray:
    """Return the scale of each fitted parameter for the solver, shape (p + 3,).

    The scales are 1 mm for positions, 0.3 for angles [rad] and logarithms, and 1 for the logit of the saturation band.
    """
    shape = [1e-3, 1e-3, 0.3, 0.3][-len(candidate.start) :]
    return np.array([*shape, 0.3, 0.3, 1.0])


def _with_gains(plain: StampFit, data: _Data) -> StampFit:
    """Fit the load curve again together with ln(gain) of every texel that is not zero in all recordings.

    The pose of the stamp and the cover stay as fitted in `plain`.  The stamp does not move within a series, so gains
    that were fitted together with pose and cover would compensate errors of the pose and the cover.
    """
    forces = np.outer(data.loads, plain.candidate.texel_forces(plain.shape))
    places = np.flatnonzero(data.active & (data.counts.max(axis=0) > 0))
    shared = len(START)

    def gains_of(vector: FloatArray) -> FloatArray:
        gains = np.ones(len(data.active))
        gains[places] = np.exp(vector[shared:])
        return gains

    def misfit(vector: FloatArray) -> FloatArray:
        counts = LoadCurve.from_vector(vector[:shared], data.output_max).counts(forces, gains_of(vector))
        return np.asarray((counts - data.counts) / _UNIT)

    def residual(vector: FloatArray) -> FloatArray:
        counts = misfit(vector)[:, data.active].ravel()
        return np.concatenate([counts, vector[shared:] / _GAIN_SPREAD])

    def jacobian(vector: FloatArray) -> FloatArray:
        base = misfit(vector)
        steps = _STEP * np.eye(len(vector))[:shared]
        columns = [(misfit(vector + step) - base)[:, data.active].ravel() / _STEP for step in steps]
        # A gain changes the counts of its own texel only.  One finite difference, with all ln(gain) increased at once,
        # therefore gives the derivatives with respect to all of them.
        slope = (misfit(vector + _STEP * (np.arange(len(vector)) >= shared)) - base) / _STEP
        texels = np.arange(len(data.active))
        columns += [np.where(texels == texel, slope, 0.0)[:, data.active].ravel() for texel in places]
        prior = np.hstack([np.zeros((len(places), shared)), np.eye(len(places)) / _GAIN_SPREAD])
        return np.vstack([np.column_stack(columns), prior])

    free = np.full(len(places), np.inf)
    start = np.clip(plain.load_curve.vector, LOWER + 1e-6, UPPER - 1e-6)
    solution = least_squares(
        residual,
        np.r_[start, np.zeros(len(places))],
        jac=jacobian,
        bounds=(np.r_[LOWER, -free], np.r_[UPPER, free]),
        ftol=1e-3,
        xtol=1e-3,
        max_nfev=30,
    )
    return replace(
        plain,
        load_curve=LoadCurve.from_vector(solution.x[:shared], data.output_max),
        gains=gains_of(solution.x),
        rms=_rms(misfit(solution.x), data),
    )
