"""Fits the forward model (pose, contact, counts) to mean images under known loads by robust least squares.

Unknown are the poses that are not given, the curve from texel force to counts, and, if wanted, a gain and a seating
height per texel.  Weak priors keep what the data do not determine near its usual value: gains near one, yaw near zero.
The weight of an image rises with its load, because an uneven seat misplaces a share of a light load that falls with the
load.  It falls if the residual is far above that of the others (Huber), so that an unseated weight does not move the
fit.  The priors are weighed against the residual of the fit itself, which is found by repetition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from meshes.array import FloatArray, TexelArray
from validation.calibration.contact import ContactMethod, Pose
from validation.calibration.counts import CountCurve
from validation.calibration.observations import Observations, Placement
from validation.calibration.parameters import Layout, Options, choose_terms
from validation.metrics import centre_of_pressure

#: Repetitions of the fit, in which the scale of the residual and the weights of the images settle [-].
_ROUNDS = 3
#: Largest number of recordings that a message names [-].
_MOST_NAMES = 5
#: Tolerance of the solver on cost and parameters, and its largest number of steps in a repetition [-].
_TOLERANCE, _MOST_STEPS = 1e-5, 25
#: Smallest scale of the residual: rounding to whole counts [counts].
_LEAST_SCALE = 0.5
#: Root mean square residual of an image over the median of all, from which its weight falls (Huber) [-].  Three medians
#: are two standard deviations of a Gaussian error of the whole image, so that one in 20 sound images loses weight.
_HUBER = 3.0
#: Weight of an image below which it is reported as an outlier [-].
_OUTLIER = 0.5
#: First guess of the scale of the residual [counts]; smallest load over the largest by which images are weighed [-].
_FIRST_SCALE, _LEAST_EMPHASIS = 100.0, 0.05
#: Step of finite differences in a position, in pitches, and in an angle [rad].
_POSITION_STEP, _ANGLE_STEP = 0.03, 0.02
#: Step of finite differences in other parameters, over their scale [-].
_STEP = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class ForwardFit:
    """A fitted forward model.

    Attributes:
        method: The contact method.
        poses: Pose of each placement, by its name.
        curve: The curve from texel force to counts, with gains and heights.
        options: What was fitted.
        layout: Names and order of the p fitted parameters.
        vector: The fitted parameters, shape (p,).
        jacobian: Derivatives of the weighted residuals, priors left out, shape (r, p) [1/unit of the parameter].
        residual: Weighted residuals over `scale`, shape (r,) [-].
        index: Number of the image of each residual, shape (r,).
        prior: Inverse variance of the prior of each parameter, shape (p,); zero without a prior.
        scale: Robust standard deviation of the residuals [counts].
        levels: Sensitivity over that of `curve` in each placement that was fitted later, by its name [-].
        rms: Root mean square of predicted minus recorded counts over measured texels [counts].
        weights: Weight of each image, 0..1, shape (m,) [-].
        robust: Factor of the weight that the residual of the image gives, shape (m,) [-].
        observations: The images that were fitted.
    """

    method: ContactMethod
    poses: dict[str, Pose]
    curve: CountCurve
    options: Options
    layout: Layout
    vector: FloatArray
    jacobian: FloatArray
    residual: FloatArray
    index: npt.NDArray[np.intp]
    prior: FloatArray
    scale: float
    rms: float
    weights: FloatArray
    robust: FloatArray
    levels: dict[str, float]
    observations: Observations

    def predict(self, observations: Observations) -> FloatArray:
        """Predict the counts of m images, shape (m, n) [-].

        Raises:
            KeyError: If the pose of a placement is neither known nor fitted.
        """
        forces = compute_forces(self.method, observations, self.poses)
        counts = np.zeros_like(forces)
        levels = np.array([self.levels.get(each.name, 1.0) for each in observations.placements])
        for level in np.unique(levels):
            rows = levels == level
            counts[rows] = replace(self.curve, sensitivity=level * self.curve.sensitivity).predict(
                forces[rows],
                temperatures=observations.temperatures[rows],
                ages=observations.ages[rows],
                thresholds=observations.thresholds[rows],
            )
        return counts

    def parameters(self) -> dict[str, float]:
        """Return the fitted parameters by name; the names end in the units."""
        curve, lit = self.curve, self.layout.gain_texels
        described = {
            f"{name} {part}": value
            for name, pose in self.poses.items()
            for part, value in zip(
                ("x_m", "y_m", "yaw_rad", "tilt_x_rad", "tilt_y_rad"), pose.vector.tolist(), strict=True
            )
            if value
        }
        described |= {"sensitivity_per_N": curve.sensitivity, "dead_force_N": curve.dead_force, "creep": curve.creep}
        if self.options.temperature:
            described["gain_temperature_per_K"] = curve.gain_temperature
            described["dead_temperature_N_per_K"] = curve.dead_temperature
        if np.isfinite(curve.output_max):
            described["saturation_band_counts"] = curve.saturation_band
        if lit.size:
            described["gain_sd"] = float(curve.gains[lit].std())
        if self.layout.height_texels.size:
            described["height_sd_N"] = float(curve.heights[self.layout.height_texels].std())
        described |= {f"level of {name}": level for name, level in self.levels.items()}
        return {**described, "rms_counts": self.rms}

    @property
    def outliers(self) -> list[str]:
        """Recordings whose weight fell below a half."""
        names = zip(self.observations.groups, self.robust, strict=True)
        return list(dict.fromkeys(group for group, weight in names if weight < _OUTLIER))


def compute_forces(method: ContactMethod, observations: Observations, poses: dict[str, Pose]) -> FloatArray:
    """Compute the texel forces of m images, with given poses by the name of the placement, shape (m, n) [N]."""
    forces = np.zeros_like(observations.counts)
    for placement in dict.fromkeys(observations.placements):
        rows = np.array([each == placement for each in observations.placements])
        pose = poses[placement.name] if placement.name in poses else _known_pose(placement)
        forces[rows] = method.texel_forces(placement.indenter, observations.loads[rows], pose)
    return forces


def _known_pose(placement: Placement) -> Pose:
    if placement.at is None or placement.yaw is None or placement.tilt is None:
        raise KeyError(placement.name)
    return Pose(*placement.at, placement.yaw, *placement.tilt)


def fit_forward(
    method: ContactMethod,
    observations: Observations,
    options: Options,
    *,
    start: ForwardFit | None = None,
) -> ForwardFit:
    """Fit the forward model to images.

    Args:
        method: The contact method.
        observations: The images.
        options: What to fit, and what is given.
        start: An earlier fit from which the poses and the curve start; with `options.placing` its gains are kept.

    Raises:
        ValueError: If there are no images, or their counts do not rise under load; the message names the recordings.
    """
    if not len(observations.loads) or observations.counts[observations.measured].sum() <= 0:
        raise ValueError(f"{_name_groups(observations)}: show no load: on average the counts do not rise under it")
    chosen = choose_terms(options, observations)
    return _solve(_Problem(method, observations, chosen, start))


def _name_groups(observations: Observations) -> str:
    """Name the recordings that the images come from, or the first of many."""
    names = list(dict.fromkeys(observations.groups))
    more = [f"and {len(names) - _MOST_NAMES} more"] if len(names) > _MOST_NAMES else []
    return ", ".join([*names[:_MOST_NAMES], *more]) or "the recordings to fit"


def _solve(problem: _Problem) -> ForwardFit:
    """Repeat the fit until the scale of the residual and the weights of the images have settled."""
    method, observations, chosen = problem.method, problem.observations, problem.options
    loads = observations.loads / max(float(observations.loads.max()), 1e-9)
    emphasis = np.maximum(loads, _LEAST_EMPHASIS) ** chosen.load_power
    vector = np.clip(problem.layout.start, problem.layout.lower, problem.layout.upper)
    scale, weights = _FIRST_SCALE, emphasis
    for _ in range(_ROUNDS):
        problem.scale, problem.weights = scale, weights
        solution = least_squares(
            problem.residuals,
            vector,
            jac=problem.jacobian,
            bounds=(problem.layout.lower, problem.layout.upper),
            x_scale=problem.layout.scale,
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            max_nfev=_MOST_STEPS,
        )
        vector = solution.x
        misfit = problem.misfit(vector)
        rms = np.array([_rms(row[lit]) for row, lit in zip(misfit, observations.measured, strict=True)])
        weights = emphasis * np.minimum(1.0, _HUBER / np.maximum(_compare_to_median(rms, loads), 1e-9))
        scale = max(float(np.sqrt(np.average(rms**2, weights=weights**2))), _LEAST_SCALE)
    problem.scale, problem.weights = scale, weights
    misfit = problem.misfit(vector)
    poses, curve = problem.unpack(vector)
    lit = observations.measured
    return ForwardFit(
        method=method,
        poses=poses,
        curve=curve,
        options=chosen,
        layout=problem.layout,
        vector=vector,
        jacobian=problem.data_jacobian(vector),
        residual=(misfit * weights[:, None] / scale)[lit],
        index=np.broadcast_to(np.arange(len(lit))[:, None], lit.shape)[lit],
        prior=problem.layout.prior,
        scale=scale,
        rms=_rms(misfit[lit]),
        weights=weights,
        robust=weights / emphasis,
        levels={},
        observations=observations,
    )


def _compare_to_median(rms: FloatArray, loads: FloatArray) -> FloatArray:
    """Compare the residual of each of m images with that of the others, shape (m,) [-].

    The error of a sound image is as large as that of the others, or as large a share of the load: the smaller ratio
    counts.
    """
    share = rms / np.maximum(loads, _LEAST_EMPHASIS)
    plain, relative = (each / max(float(np.median(each)), _LEAST_SCALE) for each in (rms, share))
    return np.minimum(plain, relative)


def fit_placements(fit: ForwardFit, observations: Observations) -> ForwardFit:
    """Fit the pose and the level of each placement in `observations`; gains and the shape of the curve stay.

    The level is a factor on the sensitivity: counts depend on the history of the rubber and on its temperature, which
    change between sessions.

    Args:
        fit: The fitted forward model.
        observations: Images of placements that were not fitted, or are to be fitted anew.
    """
    options = replace(fit.options, placing=True)
    poses, levels = dict(fit.poses), dict(fit.levels)
    for placement in dict.fromkeys(observations.placements):
        rows = np.array([each == placement for each in observations.placements])
        placed = fit_forward(fit.method, observations.select(rows), options, start=fit)
        poses |= placed.poses
        levels[placement.name] = placed.curve.sensitivity / fit.curve.sensitivity
    return replace(fit, poses=poses, levels=levels)


def borrow_poses(fit: ForwardFit, observations: Observations) -> tuple[ForwardFit, list[str]]:
    """Give each placement whose pose is neither known nor fitted the pose of the last fitted one of the same indenter.

    Returns:
        The fit with these poses, and one sentence for each of them.

    Raises:
        ValueError: If no placement of the same indenter was fitted.
    """
    poses, said = dict(fit.poses), []
    for placement in dict.fromkeys(observations.placements):
        if placement.known or placement.name in fit.poses:
            continue
        fitted = [each.name for each in fit.observations.placements if each.indenter == placement.indenter]
        if not fitted:
            raise ValueError(f"the pose of {placement.name!r} is not known: no recording of its indenter was fitted")
        poses[placement.name] = fit.poses[fitted[-1]]
        said.append(f"no recording places the indenter in {placement.name!r}; its pose is that of {fitted[-1]!r}")
    return replace(fit, poses=poses), said


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


class _Problem:
    """Residuals of the fit and their derivatives as functions of the vector of parameters."""

    def __init__(
        self, method: ContactMethod, observations: Observations, options: Options, start: ForwardFit | None
    ) -> None:
        self.method, self.observations, self.options = method, observations, options
        self.scale, self.weights = 1.0, np.ones(len(observations.loads))
        guesses = {each: _guess_pose(each, observations, method.array) for each in self._placements()}
        if start:
            guesses = {each: start.poses.get(each.name, pose) for each, pose in guesses.items()}
        self.layout = Layout.build(observations, options, method.array, guesses, start.curve if start else None)

    def _placements(self) -> Sequence[Placement]:
        return list(dict.fromkeys(self.observations.placements))

    def unpack(self, vector: FloatArray) -> tuple[dict[str, Pose], CountCurve]:
        """Convert the vector of parameters to poses by name, and the curve."""
        return self.layout.poses(vector), self.layout.curve(vector)

    def misfit(self, vector: FloatArray) -> FloatArray:
        """Predicted minus recorded counts, shape (m, n) [-]."""
        poses, curve = self.unpack(vector)
        return self._predict(compute_forces(self.method, self.observations, poses), curve) - self.observations.counts

    def _predict(self, forces: FloatArray, curve: CountCurve) -> FloatArray:
        seen = self.observations
        return curve.predict(forces, temperatures=seen.temperatures, ages=seen.ages, thresholds=seen.thresholds)

    def residuals(self, vector: FloatArray) -> FloatArray:
        """Weighted residuals over their scale, followed by those of the priors."""
        data = (self.misfit(vector) * self.weights[:, None] / self.scale)[self.observations.measured]
        return np.concatenate([data, self._prior_rows() @ (vector - self.layout.centre)])

    def jacobian(self, vector: FloatArray) -> FloatArray:
        """Derivatives of `residuals`."""
        return np.vstack([self.data_jacobian(vector), self._prior_rows()])

    def _prior_rows(self) -> FloatArray:
        rows = np.flatnonzero(self.layout.prior)
        matrix = np.zeros((len(rows), len(self.layout.prior)))
        matrix[np.arange(len(rows)), rows] = np.sqrt(self.layout.prior[rows])
        return matrix

    def data_jacobian(self, vector: FloatArray) -> FloatArray:
        """Derivatives of the residuals without those of the priors."""
        poses, curve = self.unpack(vector)
        forces = compute_forces(self.method, self.observations, poses)
        base = self._predict(forces, curve)
        columns = np.zeros((*base.shape, len(vector)))
        pitch = min(self.method.array.pitch)
        for number in range(self.layout.pose_count):
            step = _POSITION_STEP * pitch if self.layout.is_position[number] else _ANGLE_STEP
            sides = []
            for sign in (1, -1):
                moved = vector.copy()
                moved[number] += sign * step
                sides.append(compute_forces(self.method, self.observations, self.layout.poses(moved)))
            columns[..., number] = (self._predict(sides[0], curve) - self._predict(sides[1], curve)) / (2 * step)
        for number in self.layout.shared:
            step = _STEP * self.layout.scale[number]
            moved = vector.copy()
            moved[number] += step
            columns[..., number] = (self._predict(forces, self.layout.curve(moved)) - base) / step
        if self.layout.gain_texels.size:
            # A gain changes the counts of its own texel only, so one difference gives all derivatives.
            moved = vector.copy()
            moved[self.layout.gains] += _STEP
            slope = (self._predict(forces, self.layout.curve(moved)) - base) / _STEP
            for number, texel in zip(self.layout.gains, self.layout.gain_texels, strict=True):
                columns[:, texel, number] = slope[:, texel]
        return np.asarray((columns * self.weights[:, None, None] / self.scale)[self.observations.measured])


def _guess_pose(placement: Placement, observations: Observations, array: TexelArray) -> Pose:
    """Return the known pose of a placement, with the centre of its counts where the position is not known."""
    rows = np.array([each == placement for each in observations.placements])
    total = np.where(observations.measured, observations.counts, 0.0)[rows].sum(axis=0)
    x, y = centre_of_pressure(total, array.centres[:, :2]).tolist() if total.any() else (0.0, 0.0)
    at = (x, y) if placement.at is None else placement.at
    return Pose(*at, placement.yaw or 0.0, *(placement.tilt or (0.0, 0.0)))
