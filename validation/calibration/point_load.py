"""Calibration with a rounded tip over one texel: slope of counts over the applied force, per trial.

The cover spreads the force of the tip, and the texel under it measures a share, which follows from finite elements.
The slope over the force on the texel is the slope over the applied force divided by the share.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from validation.calibration.model import Observations
from validation.calibration.uncertainty import Estimate, estimate_mean
from validation.derivation.contact_range import compute_tip_share, linearise
from validation.results import Result, result_model
from validation.sensor_file import SensorDescription

#: Counts over the largest count of a trial above which images of a saturated trial are left out of the fit [-].  Near
#: saturation the characteristic is no longer straight.
_UNBENT = 0.85
#: Counts over the largest count of a trial above which an image counts as saturated [-].
_SATURATED = 0.97
#: Smallest number of images to which a line is fitted [-].  A trial counts as saturated if more than this number of
#: its images are saturated.
_FEWEST_IMAGES = 2


@result_model
class Trial(Result):
    """Line from applied force to counts of one trial.

    Attributes:
        name: Name of the trial.
        slope: Slope of counts over applied force [counts/N].
        offset: Counts of the line at zero force [-].
        saturation_force: Applied force at which the line reaches the largest count of the trial [N]; None if the trial
            does not saturate.
    """

    name: str
    slope: float
    offset: float
    saturation_force: float | None


@result_model
class PointLoadCalibration(Result):
    """Result of a calibration with a rounded tip: the line of every trial, and means over the trials.

    Attributes:
        texel: Index of the texel under the tip.
        tip_radius: Radius of the tip [m].
        tip_share: Share of the applied force that acts on that texel, fitted over all loads [-].
        tip_share_light: Share of the applied force on that texel under light loads [-].
        tip_share_heavy: Share of the applied force on that texel at `largest_load` [-].
        largest_load: Largest load at which the share was computed [N].
        trials: The line of each trial.
        estimates: Mean slope over the applied force and over the texel force, and mean saturation force, with intervals
            over trials; empty for fewer than three trials.
        left_out: One sentence for each recording that could not be used, whose counts were turned or drift, or whose
            label is in doubt.
    """

    texel: int
    tip_radius: float
    tip_share: float
    tip_share_light: float
    tip_share_heavy: float
    largest_load: float
    trials: tuple[Trial, ...]
    estimates: dict[str, Estimate]
    left_out: tuple[str, ...] = ()


def calibrate_point_load(
    observations: Observations,
    trials: Sequence[str],
    sensor: SensorDescription,
    *,
    radius: float,
    texel: int,
) -> PointLoadCalibration:
    """Fit a line from applied force to counts of one texel to each trial.

    Args:
        observations: Images under known loads on the tip.
        trials: Name of the trial of each image.
        sensor: The sensor: its array and cover.
        radius: Radius of the hemispherical end of the tip [m].
        texel: Index of the texel under the tip.

    Raises:
        ValueError: If the texel does not measure, or a trial has fewer than two loads below saturation.
        ConvergenceError: If the finite elements did not converge.
    """
    from fem_reference import point_spread
    from fem_reference.linear_response.finite_cover import solid_influence

    if not 0 <= texel < sensor.array.count or not sensor.array.active[texel]:
        raise ValueError(
            f"texel {texel} is not an active texel of {sensor.name}; accepted: 0..{sensor.array.count - 1}"
        )
    lines = tuple(
        _fit_trial(name, observations.select(np.array([each == name for each in trials])), texel)
        for name in dict.fromkeys(trials)
    )
    largest = float(max(observations.loads.max(), 1e-9))
    top = float(max(observations.counts[:, texel].max(), 2.0))
    # A line through zero that reaches the largest recorded count under the largest load saturates at the whole count.
    saturation = max(2, round(top)) * largest / top
    cover, array = sensor.layered_cover, sensor.array
    influence = point_spread(linearise(cover)) if cover.size is None else solid_influence(cover, array)
    share = compute_tip_share(cover, array, influence, radius=radius, saturation=saturation)
    slopes = np.array([line.slope for line in lines])
    forces = [line.saturation_force for line in lines if line.saturation_force is not None]
    found = {
        "sensitivity_applied": estimate_mean(slopes, "counts/N applied"),
        "sensitivity": estimate_mean(slopes / share.share, "counts/N on the texel"),
        "saturation_force": estimate_mean(forces, "N applied"),
    }
    return PointLoadCalibration(
        texel=texel,
        tip_radius=share.radius,
        tip_share=share.share,
        tip_share_light=share.lightest,
        tip_share_heavy=share.heaviest,
        largest_load=share.largest_load,
        trials=lines,
        estimates={name: each for name, each in found.items() if each is not None},
    )


def _fit_trial(name: str, trial: Observations, texel: int) -> Trial:
    """Fit a line from load to counts of a texel, to the images of a trial with counts between rest and saturation."""
    counts = trial.counts[:, texel]
    top = float(counts.max())
    saturated = int((counts > _SATURATED * top).sum()) > _FEWEST_IMAGES
    lit = trial.lit[:, texel]
    chosen = lit & (counts < _UNBENT * top) if saturated else lit
    if chosen.sum() < _FEWEST_IMAGES or np.ptp(trial.loads[chosen]) <= 0:
        raise ValueError(f"{name}: texel {texel} is lit below saturation under fewer than two loads; no line")
    slope, offset = np.polyfit(trial.loads[chosen], counts[chosen], 1)
    force = float((top - offset) / slope) if saturated else None
    return Trial(name=name, slope=float(slope), offset=float(offset), saturation_force=force)
