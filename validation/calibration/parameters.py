"""The vector of parameters of the forward model: which are fitted, their starts, bounds, scales and priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from meshes.array import FloatArray
from validation.calibration.contact import Pose
from validation.calibration.counts import CountCurve
from validation.calibration.loading import CREEP_START
from validation.calibration.observations import Observations, Placement

IntArray = npt.NDArray[np.intp]

#: Standard deviation of the prior on ln(gain) of a texel [-].
GAIN_SPREAD = 0.5
#: Standard deviation of the prior on a yaw and on a tilt [rad].
_YAW_SPREAD, _TILT_SPREAD = 0.3, 0.02
#: Standard deviation of the prior on a seating height, over the mean load [-].
_HEIGHT_SPREAD = 0.3
#: Standard deviations of the priors on the temperature coefficients of the gain [1/K] and of the dead force, over the
#: mean texel force and per kelvin [1/K]: far above those of sensors known to the authors, about 0.01.
_GAIN_TEMPERATURE_SPREAD, _DEAD_TEMPERATURE_SPREAD = 0.1, 0.1
#: Standard deviation of the prior on the logit of saturation band over largest count, and its mean [-].
_BAND_SPREAD, _BAND = 1.0, 0.0
#: Standard deviation of the prior on the logarithm of the level of a session [-].
_LEVEL_SPREAD = 0.5
#: Smallest range of temperature for which temperature coefficients are fitted [K].
TEMPERATURE_RANGE = 5.0
#: Largest squared correlation of temperature and load for which temperature coefficients are fitted [-].  Above it, the
#: two rise together, and the coefficients would describe the load.
_MOST_CONFOUNDED = 0.8
#: Largest fitted yaw [rad].
_LARGEST_YAW = np.pi / 2


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is fitted, and what is given.

    Attributes:
        gains: Whether a gain is fitted for each texel.
        heights: Whether a seating height is fitted for each texel.
        temperature: Whether temperature coefficients are fitted; None to decide by the range of temperatures.
        creep: Creep coefficient; None for the median of those measured in the recordings [-].
        output_max: Largest count after subtraction of the threshold; inf for no saturation; None to fit it [-].
        saturation_band: Width of the bend below it; None to fit it [-].
        load_power: Power of the load with which the weight of an image rises [-].
        placing: Whether only poses and the level of the sensitivity are fitted.
    """

    gains: bool = True
    heights: bool = False
    temperature: bool | None = None
    creep: float | None = None
    output_max: float | None = float("inf")
    saturation_band: float | None = None
    load_power: float = 1.0
    placing: bool = False


def choose_terms(options: Options, observations: Observations) -> Options:
    """Decide what the data do not leave open: temperature coefficients and the creep coefficient."""
    if options.placing:
        return options
    temperature = options.temperature
    if temperature is None:
        temperature = not describe_confounding(observations)
    creep = options.creep
    if creep is None:
        known = observations.creep[np.isfinite(observations.creep)]
        creep = float(np.median(known)) if known.size else 0.0
    return replace(options, temperature=temperature, creep=creep)


def describe_confounding(observations: Observations) -> str:
    """Say why temperature coefficients cannot be fitted; empty if they can."""
    warm, loads = observations.temperatures, observations.loads
    if not np.isfinite(warm).all():
        return "the temperature is not known in every recording"
    span = float(np.ptp(warm))
    if span < TEMPERATURE_RANGE:
        return f"the temperature varies by {span:.1f} K only; {TEMPERATURE_RANGE:g} K are needed"
    if np.ptp(loads) > 0:
        together = float(np.corrcoef(warm, loads)[0, 1] ** 2)
        if together > _MOST_CONFOUNDED:
            return f"temperature and load rise together (squared correlation {together:.2f})"
    return ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """Order, starts, bounds, scales and priors of the p fitted parameters.

    Attributes:
        names: Name of each parameter, p entries.
        placements: Placement and guessed pose of each placement.
        pose_parts: Name of the placement and index into `Pose.vector` of each fitted part of a pose.
        shared: Indices of the parameters that are neither parts of poses nor gains.
        gains: Indices of the logarithms of gains.
        gain_texels: Texel of each gain.
        height_texels: Texel of each seating height, in the order of the parameters.
        fixed: The curve that holds what is not fitted.
        start: Initial values, shape (p,).
        lower: Lower bounds, shape (p,).
        upper: Upper bounds, shape (p,).
        scale: Typical magnitudes, shape (p,).
        centre: Means of the priors, shape (p,).
        prior: Inverse variances of the priors, shape (p,); zero without a prior.
    """

    names: tuple[str, ...]
    placements: dict[Placement, Pose]
    pose_parts: tuple[tuple[str, int], ...]
    gain_texels: IntArray
    height_texels: IntArray
    fixed: CountCurve
    start: FloatArray
    lower: FloatArray
    upper: FloatArray
    scale: FloatArray
    centre: FloatArray
    prior: FloatArray

    @property
    def pose_count(self) -> int:
        """Number of fitted parts of poses, which come first [-]."""
        return len(self.pose_parts)

    @property
    def is_position(self) -> list[bool]:
        """Whether each part of a pose is a position, not an angle."""
        return [part < 2 for _, part in self.pose_parts]  # noqa: PLR2004 -- x and y

    @property
    def gains(self) -> IntArray:
        """Indices of the logarithms of the gains, which come last."""
        return np.arange(len(self.names) - len(self.gain_texels), len(self.names))

    @property
    def shared(self) -> range:
        """Indices of the parameters between poses and gains."""
        return range(self.pose_count, len(self.names) - len(self.gain_texels))

    def poses(self, vector: FloatArray) -> dict[str, Pose]:
        """Return the pose of each placement by its name."""
        parts = {placement.name: pose.vector for placement, pose in self.placements.items()}
        for number, (name, part) in enumerate(self.pose_parts):
            parts[name][part] = vector[number]
        return {name: Pose(*values.tolist()) for name, values in parts.items()}

    def curve(self, vector: FloatArray) -> CountCurve:
        """Return the curve from force to counts."""
        values = {self.names[number]: float(vector[number]) for number in self.shared}
        fixed = self.fixed
        heights, gains = fixed.heights, fixed.gains
        if self.height_texels.size:
            heights = heights.copy()
            heights[self.height_texels] = [values[f"height{texel}"] for texel in self.height_texels]
        if self.gain_texels.size:
            gains = gains.copy()
            gains[self.gain_texels] = np.exp(vector[self.gains])
        largest = values.get("output_max", fixed.output_max)
        band = fixed.saturation_band
        if "band_logit" in values:
            band = largest / (1 + np.exp(-values["band_logit"]))
        return replace(
            fixed,
            sensitivity=float(np.exp(values["ln_sensitivity"])) if "ln_sensitivity" in values else fixed.sensitivity,
            dead_force=values.get("dead_force", fixed.dead_force),
            gain_temperature=values.get("gain_temperature", fixed.gain_temperature),
            dead_temperature=values.get("dead_temperature", fixed.dead_temperature),
            output_max=largest,
            saturation_band=band,
            gains=gains,
            heights=heights,
        )

    @classmethod
    def build(
        cls,
        observations: Observations,
        options: Options,
        array: TexelArray,
        guesses: dict[Placement, Pose],
        curve: CountCurve | None,
    ) -> Layout:
        """Lay out the parameters of a fit from guessed poses and a curve to start from; None guesses a line."""
        entries = _Entries()
        parts = []
        for placement, pose in guesses.items():
            for part, value in _list_pose_parts(placement, pose):
                parts.append((placement.name, part))
                entries.add_pose(f"{placement.name} {_PARTS[part]}", part, value, array)
        fixed = curve or _guess_curve(observations, options, array)
        lit = observations.measured & (observations.counts > 0)
        texels = np.flatnonzero(lit.any(axis=0))
        none = np.empty(0, dtype=np.intp)
        if options.placing:
            level = float(np.log(fixed.sensitivity))
            entries.add("ln_sensitivity", level, scale=0.3, prior=(level, _LEVEL_SPREAD))
        else:
            _add_curve(entries, fixed, observations, options)
            if options.heights:
                spread = _HEIGHT_SPREAD * float(observations.loads.mean())
                for texel in texels:
                    entries.add(f"height{texel}", float(fixed.heights[texel]), scale=spread, prior=(0.0, spread))
            if options.gains:
                for texel in texels:
                    entries.add(f"gain{texel}", float(np.log(fixed.gains[texel])), scale=1.0, prior=(0.0, GAIN_SPREAD))
        return cls(
            placements=guesses,
            pose_parts=tuple(parts),
            gain_texels=texels if options.gains and not options.placing else none,
            height_texels=texels if options.heights and not options.placing else none,
            fixed=fixed,
            **entries.arrays(),
        )


_PARTS = ("x", "y", "yaw", "tilt x", "tilt y")


def _list_pose_parts(placement: Placement, pose: Pose) -> list[tuple[int, float]]:
    """List index and start of each part of a pose that is fitted."""
    values = pose.vector.tolist()
    parts = [] if placement.at is not None else [0, 1]
    if placement.yaw is None and not placement.indenter.axisymmetric:
        parts.append(2)
    parts += [] if placement.tilt is not None else [3, 4]
    return [(part, values[part]) for part in parts]


class _Entries:
    """Collects the parameters of a layout."""

    def __init__(self) -> None:
        self._rows: list[tuple[str, float, float, float, float, float, float]] = []

    def add(
        self,
        name: str,
        start: float,
        *,
        scale: float,
        bounds: tuple[float, float] = (-np.inf, np.inf),
        prior: tuple[float, float] | None = None,
    ) -> None:
        """Add a parameter; `prior` is the mean and the standard deviation of a Gaussian prior."""
        centre, weight = (0.0, 0.0) if prior is None else (prior[0], prior[1] ** -2)
        inside = float(np.clip(start, bounds[0] + 1e-9 * scale, bounds[1] - 1e-9 * scale))
        self._rows.append((name, inside, *bounds, scale, centre, weight))

    def add_pose(self, name: str, part: int, value: float, array: TexelArray) -> None:
        """Add a part of a pose; a position may leave the texels by no more than a pitch."""
        if part < 2:  # noqa: PLR2004 -- x and y
            limit = float(np.abs(array.centres[:, part]).max() + array.pitch[part])
            self.add(name, value, scale=array.pitch[part], bounds=(-limit, limit))
        elif part == 2:  # noqa: PLR2004 -- yaw
            self.add(name, value, scale=0.1, bounds=(-_LARGEST_YAW, _LARGEST_YAW), prior=(0.0, _YAW_SPREAD))
        else:
            self.add(name, value, scale=0.01, bounds=(-0.1, 0.1), prior=(0.0, _TILT_SPREAD))

    def arrays(self) -> dict[str, Any]:
        """Return names, starts, bounds, scales and priors by the names of `Layout`."""
        names = tuple(row[0] for row in self._rows)
        numbers = np.array([row[1:] for row in self._rows]).reshape(-1, 6).T
        keys = ("start", "lower", "upper", "scale", "centre", "prior")
        return {"names": names, **dict(zip(keys, numbers, strict=True))}


def _guess_curve(observations: Observations, options: Options, array: TexelArray) -> CountCurve:
    """Guess a straight line from the sums of counts over the loads."""
    counts = np.where(observations.measured, observations.counts, 0.0)
    lit = counts.sum(axis=1) > 0
    totals = (counts + observations.thresholds[:, None] * (counts > 0)).sum(axis=1)
    slope = float(np.median(totals[lit] / np.maximum(observations.loads[lit], 1e-9)))
    warm = observations.temperatures
    largest = options.output_max if options.output_max is not None else 1.05 * float(counts.max())
    band = options.saturation_band
    if band is None:
        band = largest / (1 + np.exp(-_BAND)) if np.isfinite(largest) else 0.0
    return CountCurve(
        sensitivity=max(slope, 1e-9),
        dead_force=0.0,
        gain_temperature=0.0,
        dead_temperature=0.0,
        reference_temperature=float(np.nanmean(warm)) if np.isfinite(warm).any() else float("nan"),
        creep=options.creep or 0.0,
        reference_age=float(np.nanmean(ages)) if np.isfinite(ages := observations.ages).any() else CREEP_START,
        output_max=largest,
        saturation_band=band,
        gains=np.ones(array.count),
        heights=np.zeros(array.count),
    )


def _add_curve(entries: _Entries, fixed: CountCurve, observations: Observations, options: Options) -> None:
    """Add the parameters that all texels share."""
    texel_force = float(observations.loads.mean()) / max(1, int((observations.counts > 0).sum(axis=1).max()))
    entries.add("ln_sensitivity", float(np.log(fixed.sensitivity)), scale=0.3)
    entries.add("dead_force", fixed.dead_force, scale=0.3 * texel_force)
    if options.temperature:
        spread = _DEAD_TEMPERATURE_SPREAD * texel_force
        prior = (0.0, _GAIN_TEMPERATURE_SPREAD)
        entries.add("gain_temperature", fixed.gain_temperature, scale=0.01, prior=prior)
        entries.add("dead_temperature", fixed.dead_temperature, scale=0.1 * spread, prior=(0.0, spread))
    if options.output_max is None:
        top = float(observations.counts.max())
        entries.add("output_max", fixed.output_max, scale=0.1 * top, bounds=(0.9 * top, 1e3 * top))
    if options.saturation_band is None and np.isfinite(fixed.output_max):
        share = fixed.saturation_band / fixed.output_max
        start = float(np.log(share / (1 - share)))
        entries.add("band_logit", start, scale=1.0, bounds=(-6.0, 6.0), prior=(_BAND, _BAND_SPREAD))
