"""Fits the forward model (pose, contact, counts) to mean images under known loads by robust least squares.

The unknowns are the poses that are not given, the curve from texel force to counts and, if requested, a gain and a
seating height per texel.  Weak priors keep parameters that the data do not determine near their usual values: gains
near one, yaw near zero.  The weight of an image increases with its load, because an uneven seat misplaces a share of a
light load that decreases with the load.  The weight decreases if the residual is far above that of other images
(Huber), so that an unseated weight does not affect the fit.  The priors are weighted against the residual of the fit,
which is determined by repetition.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from meshes.array import TexelArray
from meshes.array_types import FloatArray
from validation.calibration.model import CREEP_START, ContactMethod, CountCurve, Observations, Placement, Pose
from validation.calibration.temperatures import describe_confounding, find_warmth, settle_temperatures
from validation.campaign.texel_metrics import centre_of_pressure

IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class FitNumbers:
    """Constants of the fit.  Spreads are standard deviations of Gaussian priors, chosen wide.

    Attributes:
        gain_spread: Spread of ln(gain) of a texel [-].
        yaw_spread: Spread of a yaw [rad].
        largest_yaw: Largest fitted yaw [rad].
        tilt_spread: Spread of a tilt [rad].
        largest_tilt: Largest fitted tilt [rad].
        height_spread: Spread of a seating height, over the mean load [-].
        gain_temperature_spread: Spread of the temperature coefficient of the gain [1/K].  Sensors known to the authors
            have about 0.01.
        dead_temperature_spread: Spread of the temperature coefficient of the dead force, over the mean texel force
            [1/K].
        band: Mean of the logit of saturation band over largest count [-].
        band_spread: Spread of the logit of `band` [-].
        level_spread: Spread of the logarithm of the level of a session, a factor on the sensitivity [-].
        session_spread: Median of the prior of the spread of ln(gain) between sessions [-].
        session_doubt: Spread of the logarithm of the spread of ln(gain) between sessions, about its median [-].
        rounds: Repetitions of the fit, in which the scale of the residual and the weights of the images settle [-].
        tolerance: Tolerance of the solver on cost and parameters [-].
        most_steps: Largest number of steps of the solver in a repetition [-].
        first_scale: First guess of the scale of the residual [counts].
        least_scale: Smallest scale of the residual [counts]: rounding to whole counts.
        least_emphasis: Smallest load, over the largest, that is used in the weights of images [-].
        huber: Root mean square residual of an image, over the median of all images, above which its weight decreases
            [-].  Three medians are two standard deviations of a Gaussian error of the whole image: one in 20 sound
            images loses weight.
        outlier: Weight of an image below which it is reported as an outlier [-].
        position_step: Step of finite differences in a position, in pitches [-].
        angle_step: Step of finite differences in an angle [rad].
        step: Step of finite differences in other parameters, over their scale [-].
        most_names: Largest number of recordings that a message names [-].
    """

    gain_spread: float = 0.5
    yaw_spread: float = 0.3
    largest_yaw: float = np.pi / 2
    tilt_spread: float = 0.02
    largest_tilt: float = 0.1
    height_spread: float = 0.3
    gain_temperature_spread: float = 0.02
    dead_temperature_spread: float = 0.01
    band: float = 0.0
    band_spread: float = 1.0
    level_spread: float = 0.05
    session_spread: float = 0.3
    session_doubt: float = 0.7
    rounds: int = 3
    tolerance: float = 1e-4
    most_steps: int = 25
    first_scale: float = 100.0
    least_scale: float = 0.5
    least_emphasis: float = 0.05
    huber: float = 3.0
    outlier: float = 0.5
    position_step: float = 0.03
    angle_step: float = 0.02
    step: float = 1e-5
    most_names: int = 5


NUMBERS = FitNumbers()


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a fit: which parameters are fitted, and values of the others.

    Attributes:
        gains: Whether a gain is fitted for each texel.
        heights: Whether a seating height is fitted for each texel.
        temperature: Whether temperature coefficients are fitted; None to decide by the range of temperatures.
        creep: Creep coefficient; None for the median of the coefficients measured in the recordings [-].
        output_max: Largest count after subtraction of the threshold; inf for no saturation; None to fit it [-].
        load_power: Power of the load with which the weight of an image rises [-].
        sessions: Whether each placement is a session with a level and gains of its own, where there are several.
    """

    gains: bool = True
    heights: bool = False
    temperature: bool | None = None
    creep: float | None = None
    output_max: float | None = float("inf")
    load_power: float = 1.0
    sessions: bool = False


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A fitted parameter with its bounds and its Gaussian prior.

    Attributes:
        name: Name, unique in the fit.
        start: Initial value.
        scale: Typical magnitude.
        lower: Lower bound.
        upper: Upper bound.
        mean: Mean of the prior.
        spread: Standard deviation of the prior; inf without a prior.
        placement: Name of the placement to whose pose the parameter belongs; empty for other parameters.
        session: Name of the placement whose level or gains the parameter changes; empty for other parameters.
        part: Index of the parameter in `Pose.vector`.
        texel: Texel of a gain or of a seating height; -1 for other parameters.
        is_gain: Whether the parameter is the logarithm of the gain of a texel, or of its change in a session.
    """

    name: str
    start: float
    scale: float
    lower: float = -np.inf
    upper: float = np.inf
    mean: float = 0.0
    spread: float = np.inf
    placement: str = ""
    session: str = ""
    part: int = -1
    texel: int = -1
    is_gain: bool = False

    @property
    def is_position(self) -> bool:
        """Whether the parameter is a coordinate of a position."""
        return self.part in (0, 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """The p fitted parameters: parts of poses, then parameters common to all texels and heights, then gains.

    Attributes:
        unknowns: The parameters, p entries.
        guesses: Guessed pose of each placement by its name.
        fixed: Curve with the values of parameters that are not fitted.
    """

    unknowns: tuple[Unknown, ...]
    guesses: Mapping[str, Pose]
    fixed: CountCurve

    @cached_property
    def prior(self) -> FloatArray:
        """Inverse variances of the priors, shape (p,); zero without a prior."""
        return self.list("spread") ** -2

    @cached_property
    def gains(self) -> IntArray:
        """Indices of the logarithms of the g fitted gains among the p parameters, shape (g,)."""
        return np.flatnonzero([each.is_gain and not each.session for each in self.unknowns])

    @cached_property
    def session_gains(self) -> IntArray:
        """Indices of the logarithms of the changes of gains in sessions among the p parameters."""
        return np.flatnonzero([each.is_gain and bool(each.session) for each in self.unknowns])

    @cached_property
    def gain_texels(self) -> IntArray:
        """Index of the texel of each fitted gain, shape (g,)."""
        return np.array([self.unknowns[number].texel for number in self.gains], dtype=np.intp)

    @cached_property
    def height_texels(self) -> IntArray:
        """Indices of the h texels for which the load at which the texel begins to carry is fitted, shape (h,)."""
        return np.array([each.texel for each in self.unknowns if each.texel >= 0 and not each.is_gain], dtype=np.intp)

    def list(self, name: str) -> FloatArray:
        """Return an attribute of every parameter, such as its bound `lower`, shape (p,)."""
        return np.array([getattr(each, name) for each in self.unknowns], dtype=np.float64)

    def poses(self, vector: FloatArray) -> dict[str, Pose]:
        """Return the pose of each placement for values of the p parameters, by the name of the placement."""
        parts = {name: pose.vector for name, pose in self.guesses.items()}
        for each, value in zip(self.unknowns, vector, strict=True):
            if each.placement:
                parts[each.placement][each.part] = value
        return {name: Pose(*values.tolist()) for name, values in parts.items()}

    def session_curves(self, vector: FloatArray) -> dict[str, CountCurve]:
        """Return the curve of each session with a level and gains of its own, by its name."""
        common = self.curve(vector)
        gains = {each.session: common.gains.copy() for each in self.unknowns if each.session}
        levels = dict.fromkeys(gains, 1.0)
        for each, value in zip(self.unknowns, vector.tolist(), strict=True):
            if each.session and each.is_gain:
                gains[each.session][each.texel] *= np.exp(value)
            elif each.session:
                levels[each.session] = float(np.exp(value))
        return {
            name: replace(common, gains=own, sensitivity=levels[name] * common.sensitivity)
            for name, own in gains.items()
        }

    def curve(self, vector: FloatArray) -> CountCurve:
        """Return the curve from texel force to counts that sessions share, for values of the p parameters."""
        fixed = self.fixed
        values = {each.name: value for each, value in zip(self.unknowns, vector.tolist(), strict=True)}
        heights, gains = fixed.heights.copy(), fixed.gains.copy()
        heights[self.height_texels] = [values[f"height{texel}"] for texel in self.height_texels]
        gains[self.gain_texels] = np.exp(vector[self.gains])
        names = ("dead_force", "gain_temperature", "dead_temperature", "output_max")
        found = {name: values[name] for name in names if name in values}
        if "ln_sensitivity" in values:
            found["sensitivity"] = float(np.exp(values["ln_sensitivity"]))
        if "band_logit" in values:
            found["saturation_band"] = found.get("output_max", fixed.output_max) / (1 + np.exp(-values["band_logit"]))
        return replace(fixed, gains=gains, heights=heights, **found)


def lay_out(
    observations: Observations,
    options: Options,
    array: TexelArray,
    guesses: Mapping[Placement, Pose],
    session_spread: float = NUMBERS.session_spread,
) -> Layout:
    """List the parameters of a fit.

    Args:
        observations: The images.
        options: Parameters that are fitted, and values of the others.
        array: The texels.
        guesses: Guessed pose of each placement.
        session_spread: Spread of ln(gain) between sessions [-].
    """
    fixed = _guess_curve(observations, options, array)
    unknowns = [each for placement, pose in guesses.items() for each in _list_pose(placement, pose, array)]
    unknowns += _list_curve(fixed, observations, options)
    lit = np.flatnonzero(observations.lit.any(axis=0)).tolist()
    high, spread = NUMBERS.height_spread * float(observations.loads.mean()), NUMBERS.gain_spread
    heights, gains = (lit if wanted else [] for wanted in (options.heights, options.gains))
    unknowns += [Unknown(name=f"height{k}", start=0.0, scale=high, spread=high, texel=k) for k in heights]
    unknowns += [Unknown(name=f"gain{k}", start=0.0, scale=1.0, spread=spread, texel=k, is_gain=True) for k in gains]
    sessions = [placement.name for placement in guesses]
    for name in sessions if options.sessions and len(sessions) > 1 else []:
        level = NUMBERS.level_spread
        unknowns.append(Unknown(name=f"ln level of {name}", start=0.0, scale=0.3, spread=level, session=name))
        unknowns += [
            Unknown(
                name=f"gain{k} of {name}",
                start=0.0,
                scale=1.0,
                spread=session_spread,
                texel=k,
                is_gain=True,
                session=name,
            )
            for k in gains
        ]
    poses = {placement.name: pose for placement, pose in guesses.items()}
    return Layout(unknowns=tuple(unknowns), guesses=poses, fixed=fixed)


def _list_pose(placement: Placement, pose: Pose, array: TexelArray) -> list[Unknown]:
    """List the fitted parts of a pose; a position may lie at most a pitch outside the texels."""
    limits = [float(np.abs(array.centres[:, part]).max() + array.pitch[part]) for part in (0, 1)]
    # Each row holds name, scale, largest value and spread of a part of the pose.
    parts = [
        ("x", array.pitch[0], limits[0], np.inf),
        ("y", array.pitch[1], limits[1], np.inf),
        ("yaw", 0.1, NUMBERS.largest_yaw, NUMBERS.yaw_spread),
        ("tilt x", 0.01, NUMBERS.largest_tilt, NUMBERS.tilt_spread),
        ("tilt y", 0.01, NUMBERS.largest_tilt, NUMBERS.tilt_spread),
    ]
    turned = placement.yaw is None and not placement.indenter.axisymmetric
    fitted = [placement.at is None] * 2 + [turned] + [placement.tilt is None] * 2
    return [
        Unknown(
            name=f"{placement.name} {key}",
            start=pose.vector[part],
            scale=scale,
            lower=-limit,
            upper=limit,
            spread=spread,
            placement=placement.name,
            part=part,
        )
        for part, (key, scale, limit, spread) in enumerate(parts)
        if fitted[part]
    ]


def _list_curve(fixed: CountCurve, observations: Observations, options: Options) -> list[Unknown]:
    """List the parameters common to all texels, for a curve that starts as a line."""
    texel_force = float(observations.loads.mean()) / max(1, int(observations.lit.sum(axis=1).max()))
    unknowns = [
        Unknown(name="ln_sensitivity", start=float(np.log(fixed.sensitivity)), scale=0.3),
        Unknown(name="dead_force", start=0.0, scale=0.3 * texel_force),
    ]
    if options.temperature:
        gain, dead = NUMBERS.gain_temperature_spread, NUMBERS.dead_temperature_spread * texel_force
        unknowns.append(Unknown(name="gain_temperature", start=0.0, scale=0.01, spread=gain))
        unknowns.append(Unknown(name="dead_temperature", start=0.0, scale=0.1 * dead, spread=dead))
    if options.output_max is None:
        top = observations.largest_count
        unknowns.append(
            Unknown(name="output_max", start=fixed.output_max, scale=0.1 * top, lower=0.9 * top, upper=1e3 * top)
        )
    if np.isfinite(fixed.output_max):
        share = fixed.saturation_band / fixed.output_max
        start, spread = float(np.log(share / (1 - share))), NUMBERS.band_spread
        unknowns.append(
            Unknown(name="band_logit", start=start, scale=1.0, lower=-6, upper=6, mean=NUMBERS.band, spread=spread)
        )
    return unknowns


def _guess_curve(observations: Observations, options: Options, array: TexelArray) -> CountCurve:
    """Guess a straight line from the sums of counts over the loads."""
    counts = np.where(observations.lit, observations.counts, 0.0)
    lit = counts.sum(axis=1) > 0
    totals = (counts + observations.thresholds[:, None] * (counts > 0)).sum(axis=1)
    slope = float(np.median(totals[lit] / np.maximum(observations.loads[lit], 1e-9)))
    warm, ages = observations.temperatures, observations.ages
    largest = options.output_max if options.output_max is not None else 1.05 * float(counts.max())
    band = largest / (1 + np.exp(-NUMBERS.band)) if np.isfinite(largest) else 0.0
    return CountCurve(
        sensitivity=max(slope, 1e-9),
        dead_force=0.0,
        gain_temperature=0.0,
        dead_temperature=0.0,
        reference_temperature=float(np.nanmean(warm)) if np.isfinite(warm).any() else float("nan"),
        creep=options.creep or 0.0,
        reference_age=float(np.nanmean(ages)) if np.isfinite(ages).any() else CREEP_START,
        output_max=largest,
        saturation_band=band,
        gains=np.ones(array.count),
        heights=np.zeros(array.count),
    )


def _guess_pose(placement: Placement, observations: Observations, array: TexelArray) -> Pose:
    """Return the known pose of a placement, with the centre of its counts where the position is not known."""
    total = np.where(observations.lit, observations.counts, 0.0)[observations.rows_of(placement)].sum(axis=0)
    x, y = centre_of_pressure(total, array.centres[:, :2]).tolist() if total.any() else (0.0, 0.0)
    at = (x, y) if placement.at is None else placement.at
    return Pose(*at, placement.yaw or 0.0, *(placement.tilt or (0.0, 0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ForwardFit:
    """A fitted forward model, which predicts the counts of a sensor from indenter, load and pose.

    Attributes:
        method: The contact method.
        poses: Pose of each placement, by its name.
        curve: The curve from texel force to counts, with gains and heights.
        options: Options of the fit.
        layout: Names and order of the p fitted parameters.
        vector: The fitted parameters, shape (p,).
        jacobian: Derivatives of the weighted residuals, priors left out, shape (r, p) [1/unit of the parameter].
        residual: Weighted residuals over `scale`, shape (r,) [-].
        index: Number of the image of each residual, shape (r,).
        scale: Robust standard deviation of the residuals [counts].
        session_spread: Estimated spread of ln(gain) between sessions; NaN without sessions [-].
        rms: Root mean square of predicted minus recorded counts over measured texels [counts].
        weights: Weight of each image, 0..1, shape (m,) [-].
        robust: Factor of the weight due to the residual of the image, shape (m,) [-].
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
    index: IntArray
    scale: float
    rms: float
    weights: FloatArray
    robust: FloatArray
    session_spread: float
    warmth: dict[str, float]
    observations: Observations

    def predict(self, observations: Observations) -> FloatArray:
        """Predict the counts of m images, shape (m, n) [-].

        Raises:
            KeyError: If the pose of a placement is neither known nor fitted.
        """
        forces = compute_forces(self.method, observations, self.poses)
        observations = replace(observations, temperatures=settle_temperatures(observations, self.warmth))
        return _predict(self.curve, self.layout.session_curves(self.vector), forces, observations)

    def parameters(self) -> dict[str, float]:
        """Return the fitted parameters by name; the names end in the units."""
        curve, lit = self.curve, self.layout.gain_texels
        described = {
            f"{name} {part}": value
            for name, pose in self.poses.items()
            for part, value in pose.named().items()
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
        for name, each in self.layout.session_curves(self.vector).items():
            described[f"level of {name}"] = each.sensitivity / curve.sensitivity
        if np.isfinite(self.session_spread):
            described["session_gain_sd"] = self.session_spread
        return {**described, "rms_counts": self.rms}

    @property
    def outliers(self) -> list[str]:
        """Names of the recordings whose weight in the fit is below a half, because their residual is large."""
        names = zip(self.observations.groups, self.robust, strict=True)
        return list(dict.fromkeys(group for group, weight in names if weight < NUMBERS.outlier))


def compute_forces(method: ContactMethod, observations: Observations, poses: Mapping[str, Pose]) -> FloatArray:
    """Compute the texel forces of m images, with given poses by the name of the placement, shape (m, n) [N].

    Raises:
        KeyError: If the pose of a placement is neither known nor given.
    """
    forces = np.zeros_like(observations.counts)
    for placement in observations.distinct_placements:
        rows = observations.rows_of(placement)
        pose = poses.get(placement.name) or placement.pose
        if pose is None:
            raise KeyError(placement.name)
        forces[rows] = method.texel_forces(
            placement.indenter, observations.loads[rows], pose, smooth=placement.pose is None
        )
    return forces


def _predict(
    common: CountCurve, sessions: Mapping[str, CountCurve], forces: FloatArray, seen: Observations
) -> FloatArray:
    """Predict the counts of m images with the curve of their session, or the common one, shape (m, n) [-]."""
    counts = np.zeros_like(forces)
    names = np.array([each.name if each.name in sessions else "" for each in seen.placements])
    for name in np.unique(names):
        rows = names == name
        counts[rows] = sessions.get(str(name), common).predict(
            forces[rows],
            temperatures=seen.temperatures[rows],
            ages=seen.ages[rows],
            thresholds=seen.thresholds[rows],
        )
    return counts


def fit_forward(
    method: ContactMethod,
    observations: Observations,
    options: Options,
) -> ForwardFit:
    """Fit the forward model to images.

    With sessions, ln(gain) of a texel in a session is the sum of a common part and of a part of the session.  The
    spread of the latter is estimated from the images, after each repetition.

    Args:
        method: The contact method.
        observations: The images.
        options: Parameters that are fitted, and values of the others.

    Raises:
        ValueError: If there are no images, or their counts do not rise under load; the message names the recordings.
    """
    if not len(observations.loads) or observations.counts[observations.measured].sum() <= 0:
        names, most = list(dict.fromkeys(observations.groups)), NUMBERS.most_names
        more = [f"and {len(names) - most} more"] if len(names) > most else []
        named = ", ".join([*names[:most], *more]) or "the recordings to fit"
        raise ValueError(f"{named}: show no load: on average the counts do not rise under it")
    if options.temperature is None:
        options = replace(options, temperature=not describe_confounding(observations))
    if options.creep is None:
        known = observations.creep[np.isfinite(observations.creep)]
        options = replace(options, creep=float(np.median(known)) if known.size else 0.0)
    problem = _Problem(method, observations, options)
    layout, lit = problem.layout, observations.measured
    loads = observations.loads / max(float(observations.loads.max()), 1e-9)
    emphasis = np.maximum(loads, NUMBERS.least_emphasis) ** options.load_power
    lower, upper, scales = (layout.list(name) for name in ("lower", "upper", "scale"))
    vector = np.clip(layout.list("start"), lower + 1e-9 * scales, upper - 1e-9 * scales)
    problem.scale, problem.weights = NUMBERS.first_scale, emphasis
    for _ in range(NUMBERS.rounds):
        vector = least_squares(
            problem.residuals, vector, jac=problem.jacobian, bounds=(lower, upper), x_scale=scales,
            ftol=NUMBERS.tolerance, xtol=NUMBERS.tolerance, max_nfev=NUMBERS.most_steps,
        ).x  # fmt: skip
        misfit = problem.misfit(vector)
        rms = np.array([_rms(row[measured]) for row, measured in zip(misfit, lit, strict=True)])
        weights = emphasis * np.minimum(1.0, NUMBERS.huber / np.maximum(_compare_to_median(rms, loads), 1e-9))
        scale = max(float(np.sqrt(np.average(rms**2, weights=weights**2))), NUMBERS.least_scale)
        problem.scale, problem.weights = scale, weights
        problem.estimate_session_spread(vector)
    return ForwardFit(
        method=method,
        poses=layout.poses(vector),
        curve=layout.curve(vector),
        options=options,
        layout=problem.layout,
        vector=vector,
        jacobian=problem.data_jacobian(vector),
        residual=(misfit * weights[:, None] / scale)[lit],
        index=np.broadcast_to(np.arange(len(lit))[:, None], lit.shape)[lit],
        scale=scale,
        rms=_rms(misfit[lit]),
        weights=weights,
        robust=weights / emphasis,
        session_spread=problem.session_spread,
        warmth=problem.warmth,
        observations=observations,
    )


def _compare_to_median(rms: FloatArray, loads: FloatArray) -> FloatArray:
    """Compare the residual of each of m images with that of the other images, shape (m,) [-].

    The error of a sound image is similar to that of others, either absolutely or relative to the load.  The smaller
    ratio is used.
    """
    share = rms / np.maximum(loads, NUMBERS.least_emphasis)
    plain, relative = (each / max(float(np.median(each)), NUMBERS.least_scale) for each in (rms, share))
    return np.minimum(plain, relative)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def borrow_poses(fit: ForwardFit, observations: Observations) -> tuple[ForwardFit, list[str]]:
    """Give each placement without a known or fitted pose the last fitted pose of the same indenter.

    Returns:
        Fit with these poses, and one sentence for each placement that got one.

    Raises:
        ValueError: If no placement of the same indenter was fitted.
    """
    poses, said = dict(fit.poses), []
    for placement in observations.distinct_placements:
        if placement.pose is not None or placement.name in fit.poses:
            continue
        fitted = [each.name for each in fit.observations.placements if each.indenter == placement.indenter]
        if not fitted:
            raise ValueError(f"the pose of {placement.name!r} is not known: no recording of its indenter was fitted")
        poses[placement.name] = fit.poses[fitted[-1]]
        said.append(f"no recording places the indenter in {placement.name!r}; its pose is that of {fitted[-1]!r}")
    return replace(fit, poses=poses), said


class _Problem:
    """Residuals of the fit and their derivatives as functions of the vector of parameters."""

    def __init__(self, method: ContactMethod, observations: Observations, options: Options) -> None:
        self.method = method
        self.warmth = find_warmth(observations) if options.sessions and options.temperature else {}
        self.observations = replace(observations, temperatures=settle_temperatures(observations, self.warmth))
        #: Rows and images of each placement, by its name.
        self._images = {
            each.name: ((rows := observations.rows_of(each)), self.observations.select(rows))
            for each in observations.distinct_placements
        }
        self.scale, self.weights = 1.0, np.ones(len(observations.loads))
        self._options = options
        self._guesses = {
            each: _guess_pose(each, observations, method.array) for each in observations.distinct_placements
        }
        self._use_layout(lay_out(observations, options, method.array, self._guesses))
        self.session_spread = NUMBERS.session_spread if self.layout.session_gains.size else float("nan")

    def _use_layout(self, layout: Layout) -> None:
        self.layout = layout
        rows = np.flatnonzero(layout.prior)
        self._prior_rows = np.zeros((len(rows), len(layout.prior)))
        self._prior_rows[np.arange(len(rows)), rows] = np.sqrt(layout.prior[rows])

    def estimate_session_spread(self, vector: FloatArray) -> None:
        """Set the spread of gains between sessions to that of the largest marginal likelihood, with its weak prior.

        The likelihood is that of the problem linearised at `vector`, integrated over all parameters.
        """
        chosen = self.layout.session_gains
        if not chosen.size:
            return
        jacobian, prior = self.data_jacobian(vector), self.layout.prior.copy()
        data = (-self.misfit(vector) * self.weights[:, None] / self.scale)[self.observations.measured]
        target = jacobian.T @ (data + jacobian @ vector)
        information, mean = jacobian.T @ jacobian, self.layout.list("mean")
        best = np.inf
        for spread in NUMBERS.session_spread * np.geomspace(1 / 30, 10, 40):
            prior[chosen] = spread**-2
            posterior = information + np.diag(prior)
            right = target + prior * mean
            _, size = np.linalg.slogdet(posterior)
            cost = size + 2 * chosen.size * np.log(spread) - right @ np.linalg.solve(posterior, right)
            cost += (np.log(spread / NUMBERS.session_spread) / NUMBERS.session_doubt) ** 2
            if cost < best:
                best, self.session_spread = cost, float(spread)
        self._use_layout(
            lay_out(self.observations, self._options, self.method.array, self._guesses, self.session_spread)
        )

    def _predict(self, forces: FloatArray, vector: FloatArray) -> FloatArray:
        layout = self.layout
        return _predict(layout.curve(vector), layout.session_curves(vector), forces, self.observations)

    def misfit(self, vector: FloatArray) -> FloatArray:
        """Predicted minus recorded counts, shape (m, n) [-]."""
        forces = compute_forces(self.method, self.observations, self.layout.poses(vector))
        return self._predict(forces, vector) - self.observations.counts

    def residuals(self, vector: FloatArray) -> FloatArray:
        """Weighted residuals of the counts over their scale, followed by the residuals of the priors."""
        data = (self.misfit(vector) * self.weights[:, None] / self.scale)[self.observations.measured]
        return np.concatenate([data, self._prior_rows @ (vector - self.layout.list("mean"))])

    def jacobian(self, vector: FloatArray) -> FloatArray:
        """Derivatives of `residuals` with respect to the p parameters."""
        return np.vstack([self.data_jacobian(vector), self._prior_rows])

    def data_jacobian(self, vector: FloatArray) -> FloatArray:
        """Derivatives of the weighted residuals of the counts with respect to the p parameters, without the priors."""
        layout = self.layout
        poses, common, sessions = layout.poses(vector), layout.curve(vector), layout.session_curves(vector)
        forces = compute_forces(self.method, self.observations, poses)
        base = _predict(common, sessions, forces, self.observations)
        columns = np.zeros((*base.shape, len(vector)))
        for number, each in enumerate(layout.unknowns):
            if each.placement:
                step = NUMBERS.position_step * min(self.method.array.pitch) if each.is_position else NUMBERS.angle_step
                mine, own = self._images[each.placement]
                ends = []
                for side in (step, -step):
                    moved = poses[each.placement].vector
                    moved[each.part] += side
                    at = {each.placement: Pose(*moved.tolist())}
                    ends.append(_predict(common, sessions, compute_forces(self.method, own, at), own))
                columns[mine, :, number] = (ends[0] - ends[1]) / (2 * step)
            elif not each.is_gain:
                step = NUMBERS.step * each.scale
                moved = vector.copy()
                moved[number] += step
                columns[..., number] = (self._predict(forces, moved) - base) / step
        # A gain changes only the counts of its own texel, so that one difference gives all derivatives.
        moved = vector.copy()
        moved[layout.gains] += NUMBERS.step
        slope = (self._predict(forces, moved) - base) / NUMBERS.step
        names = np.array([each.name for each in self.observations.placements])
        for number, each in enumerate(layout.unknowns):
            if each.is_gain:
                rows = names == each.session if each.session else slice(None)
                columns[rows, each.texel, number] = slope[rows, each.texel]
        return np.asarray((columns * self.weights[:, None, None] / self.scale)[self.observations.measured])
