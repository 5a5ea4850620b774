"""The whole evaluation of a sensor: derive its parameters, press the campaign, score recordings if there are any."""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from validation.campaign.case import Case, default_cases
from validation.campaign.run import CampaignResult, run_campaign
from validation.derivation.derive import Derivation, derive
from validation.derivation.quadrature import gauss_points
from validation.errors import InputError
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from validation.calibration.stamp import StampScores


class Progress(Protocol):
    """A display of progress."""

    def __call__(self, stage: str) -> None:
        """Begin a stage."""

    def step(self, done: int, total: int, name: str) -> None:
        """Show that `done` of `total` are finished and `name` comes next."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Everything that a report shows.

    Attributes:
        derivation: Point spread function, fit and parameters.
        verification: Differences between elements and closed-form layer solution: `radial_profile` over its peak,
            `texel_response` over the load [-].
        campaign: The fast model scored against the reference.
        recordings: The fast model scored against recordings, or None where there are none.
        recorded: The sensor of the recordings.
        seconds: Wall time by stage [s].
        versions: Versions of the software.
    """

    derivation: Derivation
    verification: Mapping[str, float]
    campaign: CampaignResult
    recordings: StampScores | None
    recorded: SensorDescription
    seconds: Mapping[str, float]
    versions: Mapping[str, str]

    @property
    def sensor(self) -> SensorDescription:
        """The sensor that was evaluated."""
        return self.derivation.sensor

    def as_json(self) -> dict[str, Any]:
        """Every number, by name."""
        return {
            "sensor": self.sensor.name,
            "cover_assumed": self.sensor.cover.assumed,
            "derive": self.derivation.as_json(),
            "verification": dict(self.verification),
            "campaign": self.campaign.as_json(),
            "recordings": None if self.recordings is None else dataclasses.asdict(self.recordings),
            "seconds": dict(self.seconds),
            "versions": dict(self.versions),
        }


def evaluate(
    sensor: SensorDescription,
    *,
    recordings: Path | None = None,
    recorded: SensorDescription | None = None,
    cases: Sequence[Case] | None = None,
    progress: Progress | None = None,
) -> Evaluation:
    """Derive a sensor's parameters and score the fast model on a campaign.

    The kernel is fitted to the reference's response to one loaded texel, before any case is pressed, and does not
    change afterwards.

    Args:
        sensor: Array, cover and electronics.
        recordings: Folder with a weight series of the stamp; nothing is scored against recordings when not given.
        recorded: The sensor of the recordings; `sensor` when not given.
        cases: The indentations; the default campaign when not given.
        progress: Display of progress.

    Raises:
        InputError: If the sensor cannot be evaluated.
        RecordingError: If the recordings are damaged or of another array.
        ConvergenceError: If the reference did not converge.
    """
    if sensor.cover.size is not None:
        raise InputError(
            f"{sensor.source}: cover.size: a report takes laterally wide covers only; use `softcover derive` and "
            "`softcover press`, or remove the key"
        )
    clock = [time.perf_counter()]
    recorded = recorded or sensor
    # Recordings come first, so that a fault in them shows before the long work.
    scores = None
    if recordings is not None:
        from validation.calibration.stamp import score_recordings

        scores = score_recordings(recordings, recorded, progress=progress)
    clock.append(time.perf_counter())
    derivation = derive(sensor, progress=progress)
    clock.append(time.perf_counter())
    verification = verify(derivation)
    chosen = default_cases(sensor.array) if cases is None else cases
    campaign = run_campaign(sensor.cover, derivation.parameters, chosen, progress=progress.step if progress else None)
    clock.append(time.perf_counter())
    return Evaluation(
        derivation=derivation,
        verification=verification,
        campaign=campaign,
        recordings=scores,
        recorded=recorded,
        seconds=dict(zip(("recordings", "derive", "campaign"), np.diff(clock).tolist(), strict=True)),
        versions=versions(),
    )


def verify(derivation: Derivation) -> dict[str, float]:
    """Compare the elements' point spread function with the closed-form layer solution.

    Raises:
        ValueError: If the cover has free side edges: the closed form is that of a laterally wide cover.
    """
    from fem_reference.closed_form import point_response

    spread, sensor = derivation.point_spread, derivation.sensor
    if spread is None:
        raise ValueError("the closed-form layer solution takes a laterally wide cover only")
    radius = np.linspace(0, 6 * sensor.cover.thickness, 200)
    exact = point_response(sensor.cover, radius)
    profile = np.abs(spread.pressure(radius) - exact).max() / exact.max()
    points, weights = gauss_points(sensor.array.texel_size, 12)
    texel_force = weights @ point_response(sensor.cover, np.hypot(*points.T)) * np.prod(sensor.array.texel_size)
    middle = derivation.texel_response[sensor.array.rows // 2, sensor.array.columns // 2]
    return {"radial_profile": float(profile), "texel_response": float(abs(middle - texel_force))}


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of the libraries that compute."""
    names = ("softcover", "numpy", "scipy", "mujoco", "scikit-fem")
    return {name: metadata.version(name) for name in names} | {"python": platform.python_version()}
