"""The accuracy gate: scores of the fast model against a stored baseline.

`make_baseline` turns a campaign into a baseline, `compare_baselines` lists the scores that moved.  A score is worse if
it exceeds the stored one by more than the tolerance of its metric.  Each tolerance is larger than the reference's own
error and the differences between machines, and smaller than a change that matters.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType

from validation.campaign.run import CampaignResult
from validation.errors import InputError
from validation.json_values import to_json_values
from validation.output_folder import write_text
from validation.sensor_file import SensorDescription

#: Version of the file format [-].
FORMAT = 1
#: Largest growth of a metric that does not count as worse, in the metric's own unit.
TOLERANCES: Mapping[str, float] = MappingProxyType(
    {
        "misplaced_force": 0.005,
        "relative_l2": 0.01,
        "total_force_error": 0.002,
        "centre_of_pressure_m": 20e-6,
        "image_changed_percent": 0.1,
    }
)
#: Name of the entry that holds the means over all cases.
MEAN = "mean over cases"


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Scores of the fast model for one sensor and one list of cases.

    Attributes:
        sensor: Name of the sensor.
        fingerprint: Hash of array, cover and cases; baselines with different hashes cannot be compared.
        scores: By case (and `MEAN`) and metric; None where a metric does not exist.
    """

    sensor: str
    fingerprint: str
    scores: Mapping[str, Mapping[str, float | None]]

    def save(self, path: Path) -> None:
        """Write the file atomically.

        Raises:
            OSError: If it cannot be written.
        """
        write_text(path, json.dumps({"format": FORMAT, **asdict(self)}, indent=1, sort_keys=True) + "\n")


@dataclass(frozen=True, kw_only=True)
class Change:
    """One score that moved by more than its tolerance.

    Attributes:
        case: Name of the case, or `MEAN`.
        metric: Name of the metric.
        before: Stored value; None where there was none.
        now: Present value; None where there is none.
        worse: Whether accuracy dropped.
    """

    case: str
    metric: str
    before: float | None
    now: float | None
    worse: bool


def load_baseline(path: Path) -> Baseline:
    """Read a baseline.

    Raises:
        InputError: If there is no such file or it is not a baseline.
    """
    if not path.is_file():
        raise InputError(f"--baseline: {path}: no such file; write one with --update")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise InputError(f"--baseline: {path}: format {data['format']!r}; this version reads {FORMAT}")
        return Baseline(sensor=data["sensor"], fingerprint=data["fingerprint"], scores=data["scores"])
    except (json.JSONDecodeError, UnicodeDecodeError, KeyError, TypeError) as error:
        raise InputError(f"--baseline: {path}: not a baseline ({error}); write one with --update") from None


def make_baseline(sensor: SensorDescription, campaign: CampaignResult) -> Baseline:
    """Make a baseline from the scores of the fast model in a campaign."""
    scores = {result.case.name: result.predictions["fast"].score.as_json() for result in campaign.cases}
    scores[MEAN] = {name: to_json_values(value.mean) for name, value in campaign.pooled["fast"].items()}
    return Baseline(
        sensor=sensor.name,
        fingerprint=_fingerprint(sensor, campaign),
        scores={case: {metric: values[metric] for metric in TOLERANCES} for case, values in scores.items()},
    )


def compare_baselines(baseline: Baseline, now: Baseline) -> list[Change]:
    """Scores that moved by more than their tolerance, the worst first.

    A score that existed in the baseline and does not exist now counts as worse.

    Raises:
        InputError: If the two differ in array, cover or list of cases.
    """
    if baseline.fingerprint != now.fingerprint:
        raise InputError(
            f"--baseline: belongs to sensor {baseline.sensor!r} with another array, cover or list of cases than "
            f"{now.sensor!r}; write one for this sensor with --update"
        )
    moved: list[tuple[float, Change]] = []
    for case, scores in baseline.scores.items():
        for metric, tolerance in TOLERANCES.items():
            before, present = scores.get(metric), now.scores.get(case, {}).get(metric)
            growth = _measure_growth(before, present)
            if abs(growth) > tolerance:
                change = Change(case=case, metric=metric, before=before, now=present, worse=growth > 0)
                moved.append((abs(growth) / tolerance, change))
    return [change for _, change in sorted(moved, key=lambda each: (not each[1].worse, -each[0]))]


def _measure_growth(before: float | None, now: float | None) -> float:
    """Growth of a score; infinite for one that vanished, minus infinite for a new one."""
    if before is None:
        return 0.0 if now is None else -math.inf
    return math.inf if now is None else now - before


def _fingerprint(sensor: SensorDescription, campaign: CampaignResult) -> str:
    """Hash of everything that two baselines must share."""
    array = sensor.array
    cases = [result.case for result in campaign.cases] + [each.case for each in campaign.skipped]
    described = {
        "centres": array.centres.round(9),
        "texel_size": array.texel_size,
        "active": array.active,
        "cover": sensor.describe_cover(),
        "cases": sorted([case.name, case.shape, round(case.load, 9), *case.at, case.yaw] for case in cases),
    }
    return hashlib.sha256(json.dumps(to_json_values(described), sort_keys=True).encode()).hexdigest()
