"""Calibration with a rounded tip over one texel: slope of counts over the applied force, per trial.

The cover spreads the force of the tip, and the texel under it measures a share.  That share follows from finite
elements, so that the slope over the force on the texel is the slope over the applied force divided by the share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastmodel import Electronics
from meshes.array import FloatArray
from validation.calibration.estimates import Estimate, estimate_mean
from validation.calibration.observations import Observations
from validation.derivation.calibration_tip import TipShare, compute_tip_share, linearise
from validation.derivation.kernel_fit import Influence
from validation.sensor_file import SensorDescription

#: Counts over the largest count of a trial, from which the saturation bends the line, so that images are left out [-].
_UNBENT = 0.85
#: Smallest number of images and of different loads in a trial [-].
_FEWEST_IMAGES = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class PointLoadCalibration:
    """Slopes of the trials.

    Attributes:
        texel: Index of the texel under the tip.
        share: Share of the applied force on that texel.
        names: Name of each trial.
        slopes: Slope of counts over applied force of each trial, shape (k,) [counts/N].
        offsets: Counts of the line at zero force, shape (k,) [-].
        saturation_forces: Applied force at which the line reaches the largest count of the trial, shape (k,) [N]; NaN
            if the trial does not saturate.
        estimates: Mean slope over the applied force and over the texel force, with intervals over trials; empty for
            fewer than three trials.
    """

    texel: int
    share: TipShare
    names: tuple[str, ...]
    slopes: FloatArray
    offsets: FloatArray
    saturation_forces: FloatArray
    estimates: dict[str, Estimate]

    def as_json(self) -> dict[str, Any]:
        """Return all results by name."""
        return {
            "texel": self.texel,
            "tip_share": self.share.share,
            "tip_share_light": self.share.lightest,
            "tip_share_heavy": self.share.heaviest,
            "trials": [
                {"name": name, "slope": slope, "offset": offset, "saturation_force": force}
                for name, slope, offset, force in zip(
                    self.names,
                    self.slopes.tolist(),
                    self.offsets.tolist(),
                    [None if np.isnan(each) else float(each) for each in self.saturation_forces],
                    strict=True,
                )
            ],
            "estimates": {name: vars(estimate) for name, estimate in self.estimates.items()},
        }


def calibrate_point_load(
    observations: Observations,
    trials: Sequence[str],
    sensor: SensorDescription,
    *,
    radius: float,
    texel: int,
    confidence: float = 0.95,
) -> PointLoadCalibration:
    """Fit a line from applied force to counts of one texel to each trial.

    Args:
        observations: Images under known loads on the tip.
        trials: Name of the trial of each image.
        sensor: The sensor: its array and cover.
        radius: Radius of the hemispherical end of the tip [m].
        texel: Index of the texel under the tip.
        confidence: Confidence level of the intervals over trials, 0..1 [-].

    Raises:
        ValueError: If the texel does not measure, or a trial has fewer than two loads below saturation.
        ConvergenceError: If the finite elements did not converge.
    """
    if not 0 <= texel < sensor.array.count or not sensor.array.active[texel]:
        raise ValueError(
            f"texel {texel} is not an active texel of {sensor.name}; accepted: 0..{sensor.array.count - 1}"
        )
    names = tuple(dict.fromkeys(trials))
    rows = [np.array([each == name for each in trials]) for name in names]
    lines = [_fit_trial(name, observations.select(each), texel) for name, each in zip(names, rows, strict=True)]
    slopes, offsets, forces = (np.array(values) for values in zip(*lines, strict=True))
    rate = sensor.electronics.rate_hz
    largest = float(max(observations.loads.max(), 1e-9))
    top = float(max(observations.counts[:, texel].max(), 2.0))
    electronics = Electronics(
        rate_hz=rate,
        sensitivity=top / largest,
        output_max=max(2, round(top)),
        bits=32,
        calibrated=f"through the cover, tip {1e3 * radius:.9g} mm",
    )
    share = compute_tip_share(sensor.cover, sensor.array, _solve_influence(sensor), electronics)
    if share is None:
        raise RuntimeError("a characteristic through the cover has a share")
    found = {
        "sensitivity_applied": estimate_mean(slopes, "counts/N applied", confidence),
        "sensitivity": estimate_mean(slopes / share.share, "counts/N on the texel", confidence),
        "saturation_force": estimate_mean(forces, "N applied", confidence),
    }
    return PointLoadCalibration(
        texel=texel,
        share=share,
        names=names,
        slopes=slopes,
        offsets=offsets,
        saturation_forces=forces,
        estimates={name: each for name, each in found.items() if each is not None},
    )


def _solve_influence(sensor: SensorDescription) -> Influence:
    """Compute the response of the texels to loads on the cover by finite elements."""
    from fem_reference import point_spread
    from fem_reference.linear_response.finite_cover import solid_influence

    wide = sensor.cover.size is None
    return point_spread(linearise(sensor.cover)) if wide else solid_influence(sensor.cover, sensor.array)


def _fit_trial(name: str, trial: Observations, texel: int) -> tuple[float, float, float]:
    """Fit a line to the images of a trial that are lit and below saturation.

    Returns:
        Slope [counts/N], counts at zero force [-], and applied force at which the line reaches the largest count [N].
    """
    counts = trial.counts[:, texel]
    top = float(counts.max())
    rising = (counts > 0) & (counts < _UNBENT * top)
    saturated = int((counts > 0.97 * top).sum()) > 2  # noqa: PLR2004 -- a plateau of several images
    chosen = rising if saturated else counts > 0
    if chosen.sum() < _FEWEST_IMAGES or np.ptp(trial.loads[chosen]) <= 0:
        raise ValueError(f"{name}: texel {texel} is lit below saturation under fewer than two loads; no line")
    slope, offset = np.polyfit(trial.loads[chosen], counts[chosen], 1)
    force = (top - offset) / slope if saturated else float("nan")
    return float(slope), float(offset), float(force)
