"""The whole way for one sensor: derive, press the campaign, score recordings where there are any."""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from validation.campaign.case import Case
from validation.campaign.run import CampaignResult, default_cases, run_campaign
from validation.derivation.derive import Derivation, derive
from validation.errors import InputError
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from validation.calibration.stamp import StampScores


class Progress(Protocol):
    """What a display of progress offers."""

    def __call__(self, stage: str) -> None:
        """Begin a stage."""

    def step(self, done: int, total: int, name: str) -> None:
        """Report that `done` of `total` are finished and `name` comes next."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Everything that a report shows.

    Attributes:
        derivation: Point spread function, fit and parameters.
        verification: Largest differences between elements and exact layer solution: `radial_profile` over its
            peak, `texel_response` over the load [-].
        campaign: The fast model scored against the reference.
        recordings: The fast model scored against recordings, or None where there are none.
        recorded: The sensor of the recordings.
        seconds: Wall time by stage [s].
        versions: What computed it.
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
        """What was evaluated."""
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
    """Derive a sensor's parameters and score the fast model on the default campaign.

    The kernel is fitted to the reference's response to one loaded texel, before any case is pressed, and is not
    touched again.

    Args:
        sensor: Array, cover and electronics.
        recordings: Folder with a weight series of the stamp, if it is to be scored.
        recorded: The sensor of the recordings; `sensor` when not given.
        cases: What to press; the default campaign when not given.
        progress: Told what is being done.

    Raises:
        InputError: If the sensor cannot be evaluated.
        RecordingError: If the recordings are damaged or of another array.
        ConvergenceError: If the reference did not converge.
    """
    if sensor.cover.size is not None:
        raise InputError(
            f"{sensor.source}: cover.size: reports are made for laterally wide covers only; use derive and press, or "
            "remove the key"
        )
    clock = [time.perf_counter()]
    # Recordings come first: what is wrong with them shows before the long work.
    scores = _recordings(recordings, recorded or sensor, progress)
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
        recorded=recorded or sensor,
        seconds=dict(zip(("recordings", "derive", "campaign"), np.diff(clock).tolist(), strict=True)),
        versions=versions(),
    )


def _recordings(folder: Path | None, recorded: SensorDescription, progress: Progress | None) -> StampScores | None:
    if folder is None:
        return None
    from validation.calibration.stamp import score_recordings

    return score_recordings(folder, recorded, progress=progress)


def verify(derivation: Derivation) -> dict[str, float]:
    """Compare the elements' point spread function with the exact layer solution."""
    from fem_reference.closed_form import point_response

    spread, array = derivation.point_spread, derivation.sensor.array
    if spread is None:
        raise ValueError("the exact layer solution is that of a laterally wide cover")
    radius = np.linspace(0, 6 * derivation.sensor.cover.thickness, 200)
    exact = point_response(derivation.sensor.cover, radius)
    profile = np.abs(spread.pressure(radius) - exact).max() / exact.max()
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.array(array.texel_size) / 2
    x, y = np.meshgrid(nodes * half[0], nodes * half[1])
    share = np.outer(weights, weights) * half[0] * half[1]
    peak = float((point_response(derivation.sensor.cover, np.hypot(x, y)) * share).sum())
    middle = float(derivation.texel_response[array.rows // 2, array.columns // 2])
    return {"radial_profile": float(profile), "texel_response": abs(middle - peak)}


def versions() -> dict[str, str]:
    """Versions of what computes."""
    names = ("softcover", "numpy", "scipy", "mujoco", "scikit-fem")
    return {name: metadata.version(name) for name in names} | {"python": platform.python_version()}
