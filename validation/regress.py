"""Regression check of accuracy: compares scores of the fast model with the scores in a stored baseline.

A campaign scores a list of cases (indentations).  `make_baseline` takes the scores of the fast model from a campaign;
`compare_baselines` lists the scores that changed.  A score is worse if it exceeds the stored score by more than the
tolerance of its metric.  Each tolerance is larger than the error of the finite-element reference and the differences
between machines, and smaller than a change of accuracy that matters.
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

#: Version of the format of baseline files; files of other versions are refused [-].
FORMAT = 1
#: Tolerance of each metric: largest increase of a score over the stored score that does not count as worse.  Units are
#: those of the metrics: [m] for `centre_of_pressure_m`, [%] for `image_changed_percent`, [-] for the others.
TOLERANCES: Mapping[str, float] = MappingProxyType(
    {
        "misplaced_force": 0.005,
        "relative_l2": 0.01,
        "total_force_error": 0.002,
        "centre_of_pressure_m": 20e-6,
        "image_changed_percent": 0.1,
    }
)
#: Key in `Baseline.scores` of the mean scores over all cases.
MEAN = "mean over cases"


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Scores of the fast model for one sensor and one list of cases (indentations), to compare later scores with.

    Attributes:
        sensor: Name of the sensor.
        fingerprint: Hash of array, cover and cases; baselines with different hashes cannot be compared.
        scores: Scores by name of the case (or `MEAN`), then by name of the metric; None for an undefined score.
    """

    sensor: str
    fingerprint: str
    scores: Mapping[str, Mapping[str, float | None]]

    def save(self, path: Path) -> None:
        """Write the baseline as a JSON file, completely or not at all.

        Raises:
            OSError: If the file cannot be written.
        """
        write_text(path, json.dumps({"format": FORMAT, **asdict(self)}, indent=1, sort_keys=True) + "\n")


@dataclass(frozen=True, kw_only=True)
class Change:
    """One score that differs from its stored value by more than the tolerance of its metric.

    Attributes:
        case: Name of the case, or `MEAN`.
        metric: Name of the metric.
        before: Score in the baseline; None if it was undefined.
        now: Present score; None if it is undefined.
        worse: Whether the score increased or became undefined.
    """

    case: str
    metric: str
    before: float | None
    now: float | None
    worse: bool


def load_baseline(path: Path) -> Baseline:
    """Read the baseline that `Baseline.save` wrote.

    Raises:
        InputError: If the file does not exist, is not a baseline or has another format version.
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
    """List the scores of `now` that differ from those of `baseline` by more than the tolerance of their metric.

    A score that is defined in `baseline` and undefined in `now` counts as worse.

    Returns:
        The changes: scores that became worse first, each group by falling ratio of change to tolerance.

    Raises:
        InputError: If the two baselines differ in array, cover or list of cases.
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
    """Return the increase of a score: infinity if it became undefined, minus infinity if it became defined."""
    if before is None:
        return 0.0 if now is None else -math.inf
    return math.inf if now is None else now - before


def _fingerprint(sensor: SensorDescription, campaign: CampaignResult) -> str:
    """Return the SHA-256 of array, cover and cases, which two baselines must have in common to be compared."""
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
