"""Least-squares fits of a forward model and one load curve to stamp recordings."""

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

#: Unit of the residuals, so that they are of order one [counts].
_UNIT = 100.0
#: Standard deviation of the prior on ln(gain): a gain this far from one costs as much as `_UNIT` counts [-].
_GAIN_SPREAD = 0.5
#: Gains closer to one than this belong to texels that no fitted image determines [-].
_UNFITTED_GAIN = 1e-6
#: Step of the finite differences in logarithms [-].
_STEP = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class StampFit:
    """A fitted model.

    Attributes:
        candidate: The candidate with the smallest residual.
        shape: Its fitted parameters, shape (p,).
        load_curve: The load curve, one for all texels.
        gains: Gain of each texel, shape (n,) [-]; None if no gains were fitted.
        rms: Root mean square residual over active texels of the fitted cases [counts].
    """

    candidate: Candidate
    shape: FloatArray
    load_curve: LoadCurve
    gains: FloatArray | None
    rms: float

    def counts(self, load: float) -> FloatArray:
        """Predicted mean counts under a weight, shape (n,) [-].

        Args:
            load: Weight on the stamp [N].
        """
        forces = load * self.candidate.texel_forces(self.shape)
        return self.load_curve.counts(forces, 1.0 if self.gains is None else self.gains)

    def parameters(self) -> dict[str, float]:
        """The fitted parameters, by name with unit."""
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
    """Fitted cases as arrays: loads (k,), counts (k, n) and which texels measure (n,)."""

    loads: FloatArray
    counts: FloatArray
    active: npt.NDArray[np.bool_]
    output_max: int


def fit(
    model: StampModel, cases: Sequence[StampCase], array: TexelArray, *, output_max: int
) -> tuple[StampFit, StampFit]:
    """Fit a model without and with texel gains.

    Args:
        model: The forward model.
        cases: Recordings to fit.
        array: The texels.
        output_max: Largest count after the threshold; it is given, not fitted [-].

    Returns:
        The fit without texel gains, and a second fit that starts from it and adds a gain per texel.
    """
    data = _Data(
        loads=np.array([case.file.load for case in cases]),
        counts=np.array([case.counts for case in cases]),
        active=array.active,
        output_max=output_max,
    )
    # The forces on box texels jump with the pose and have no usable gradient: the pose comes from uniform pressure.
    x, y = centre_of_pressure(data.counts.sum(axis=0), array.centres[:, :2]).tolist()
    x, y, *_ = _fit(uniform(array, (x, y)), data).shape.tolist()
    fits = [_fit(candidate, data) for candidate in model.candidates((x, y))]
    plain = min(fits, key=lambda each: each.rms)
    return plain, _with_gains(plain, data)


def _fit(candidate: Candidate, data: _Data) -> StampFit:
    split = len(candidate.start)

    # Finite differences in the load curve leave the forces unchanged: keep the latest forces.
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
    return float(np.sqrt(np.mean(misfit[:, data.active] ** 2)) * _UNIT)


def _scale(candidate: Candidate) -> FloatArray:
    """Typical size of each parameter: a millimetre for lengths; angles and logarithms otherwise."""
    shape = [1e-3, 1e-3, 0.3, 0.3][-len(candidate.start) :]
    return np.array([*shape, 0.3, 0.3, 1.0])


def _with_gains(plain: StampFit, data: _Data) -> StampFit:
    """Refit the load curve with a ln(gain) for every texel that is not always zero; pose and cover stay fixed.

    The stamp does not move within a series, so gains that were fitted together with pose and cover would absorb both.
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
        # A gain affects its own texel only, so one difference gives the derivatives by all gains.
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
