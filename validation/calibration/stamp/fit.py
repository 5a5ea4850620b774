"""Least-squares fits of a forward model and one load curve to stamp recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from meshes import TexelArray
from validation.calibration.stamp.case import StampCase
from validation.calibration.stamp.forward_models import Candidate, StampModel, uniform
from validation.calibration.stamp.load_curve import LOWER, START, UPPER, LoadCurve

FloatArray = npt.NDArray[np.float64]

#: Counts are fitted in units of this, so that residuals are of order one.
_UNIT = 100.0
#: Gains are held to one as if each ln(gain) of this size cost one residual of `_UNIT` counts [-].
_GAIN_SPREAD = 0.5
_STEP = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class StampFit:
    """A fitted model.

    Attributes:
        candidate: The candidate that fitted best.
        shape: Its numbers, shape (p,).
        load_curve: The load curve, one for all texels.
        gains: One factor per texel; None where texels are not told apart, shape (n,) [-].
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
        """What was fitted, by name with its unit."""
        described = self.candidate.describe(self.shape) | {
            "sensitivity_per_N": self.load_curve.sensitivity,
            "dead_force_N": self.load_curve.dead_force,
            "saturation_band_counts": self.load_curve.saturation_band,
        }
        if self.gains is not None:
            described["gain_sd"] = float(self.gains[self.gains != 1].std()) if (self.gains != 1).any() else 0.0
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
        output_max: Largest count after the threshold, known beforehand [-].

    Returns:
        The fit with nothing per texel, and the one that starts there and adds a gain per texel.
    """
    data = _Data(
        loads=np.array([case.file.load for case in cases]),
        counts=np.array([case.counts for case in cases]),
        active=array.active,
        output_max=output_max,
    )
    # box texels cannot be fitted by slopes: the place comes from the uniform pressure
    place = _fit(uniform(array, _middle(array, data)), data).shape
    fits = [_fit(candidate, data) for candidate in model.candidates((float(place[0]), float(place[1])))]
    plain = min(fits, key=lambda each: each.rms)
    return plain, _with_gains(plain, data)


def _middle(array: TexelArray, data: _Data) -> tuple[float, float]:
    weight = data.counts.sum(axis=0)
    x, y = weight @ array.centres[:, :2] / weight.sum()
    return (float(x), float(y))


def _fit(candidate: Candidate, data: _Data) -> StampFit:
    split = len(candidate.start)
    latest: dict[bytes, FloatArray] = {}

    def forces(shape: FloatArray) -> FloatArray:
        # steps in the curve's numbers leave the forces as they were
        key = shape.tobytes()
        if key not in latest:
            latest.clear()
            latest[key] = np.outer(data.loads, candidate.texel_forces(shape))
        return latest[key]

    def misfit(vector: FloatArray) -> FloatArray:
        predicted = LoadCurve.of(vector[split:], data.output_max).counts(forces(vector[:split]))
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
        load_curve=LoadCurve.of(solution.x[split:], data.output_max),
        gains=None,
        rms=_rms(misfit(solution.x), data),
    )


def _rms(misfit: FloatArray, data: _Data) -> float:
    return float(np.sqrt(np.mean(misfit[:, data.active] ** 2)) * _UNIT)


def _scale(candidate: Candidate) -> FloatArray:
    """Lengths are of the order of a millimetre; all other numbers are angles or logarithms."""
    shape = [1e-3, 1e-3, 0.3, 0.3][-len(candidate.start) :]
    return np.array([*shape, 0.3, 0.3, 1.0])


def _with_gains(plain: StampFit, data: _Data) -> StampFit:
    """Refit the curve with a ln(gain) for every texel that read anything; stamp and cover stay where they are.

    The stamp never moves in a series, so gains that were free together with pose and cover would absorb both.
    """
    forces = np.outer(data.loads, plain.candidate.texel_forces(plain.shape))
    places = np.flatnonzero(data.active & (data.counts.max(axis=0) > 0))
    shared = len(START)

    def gains_of(vector: FloatArray) -> FloatArray:
        gains = np.ones(len(data.active))
        gains[places] = np.exp(vector[shared:])
        return gains

    def misfit(vector: FloatArray) -> FloatArray:
        counts = LoadCurve.of(vector[:shared], data.output_max).counts(forces, gains_of(vector))
        return np.asarray((counts - data.counts) / _UNIT)

    def residual(vector: FloatArray) -> FloatArray:
        counts = misfit(vector)[:, data.active].ravel()
        return np.concatenate([counts, vector[shared:] / _GAIN_SPREAD])

    def jacobian(vector: FloatArray) -> FloatArray:
        base = misfit(vector)
        steps = _STEP * np.eye(len(vector))[:shared]
        columns = [(misfit(vector + step) - base)[:, data.active].ravel() / _STEP for step in steps]
        # a gain moves its own texel only: one difference serves all of them
        slope = (misfit(vector + _STEP * (np.arange(len(vector)) >= shared)) - base) / _STEP
        for texel in places:
            own = np.zeros_like(slope)
            own[:, texel] = slope[:, texel]
            columns.append(own[:, data.active].ravel())
        held = np.hstack([np.zeros((len(places), shared)), np.eye(len(places)) / _GAIN_SPREAD])
        return np.vstack([np.column_stack(columns), held])

    free = np.full(len(places), np.inf)
    start = np.clip(_vector(plain.load_curve), LOWER + 1e-6, UPPER - 1e-6)
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
        load_curve=LoadCurve.of(solution.x[:shared], data.output_max),
        gains=gains_of(solution.x),
        rms=_rms(misfit(solution.x), data),
    )


def _vector(load_curve: LoadCurve) -> FloatArray:
    share = load_curve.saturation_band / load_curve.output_max
    return np.array([np.log(load_curve.sensitivity), np.log(load_curve.dead_force), np.log(share / (1 - share))])
