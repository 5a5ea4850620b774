"""All results of an evaluation as one object, which is written to `report.json` and read back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from meshes.bounded_file import FileLimitError, parse_json, read_bytes
from validation.campaign.results import CampaignResult, SkippedCase
from validation.credibility.evidence import Evidence
from validation.data_sets.results import RecordingScores
from validation.errors import InputError
from validation.moving.results import MovingResult
from validation.results import JsonObject, Number, Result, result_model
from validation.results.derivation import Responses
from validation.verdict import Verdict

#: Largest accepted size of a file `report.json` [bytes].
_MOST_BYTES = 2**28


@result_model
class RecordingReport(Result):
    """All results of the evaluation of a sensor on recordings alone.

    Attributes:
        verdict: Whether the fast model meets the acceptance criterion.
        sensor: Name of the sensor.
        cover_assumed: Whether thickness and material of the cover are assumed, not measured.
        recordings: Scores on recordings of real sensors; None if there are no recordings.
        seconds: Wall time by stage [s].
        versions: Versions of the software by name.
    """

    verdict: Verdict
    sensor: str
    cover_assumed: bool
    recordings: RecordingScores | None
    seconds: Mapping[str, float]
    versions: Mapping[str, str]


@result_model
class Report(RecordingReport):
    """All results of the evaluation of a sensor.

    Attributes:
        campaign_file: Content of the campaign file.
        friction: Friction between indenter and cover in the finite elements, as text.
        derive: Response of the cover to a point load, and the parameters of the fast model fitted to it.
        verification: Relative differences of the response of the cover from closed-form solutions, by name [-].
        campaign: Scores of the fast model and of the models for comparison.
        evidence: Code and solution verification, effect of uncertain inputs, error of each stage of the fast model, and
            the range of the cases.
        moving: Results of the cases that change in time.
        not_moved: Those of them that have no scores.
    """

    campaign_file: JsonObject
    friction: str
    derive: Responses
    verification: Mapping[str, Number]
    campaign: CampaignResult
    evidence: Evidence
    moving: tuple[MovingResult, ...] = ()
    not_moved: tuple[SkippedCase, ...] = ()


def read_report(path: Path | str) -> Report | RecordingReport:
    """Read the results of `validate` from a report.

    Args:
        path: The report's `report.json`, or the folder that holds it.

    Returns:
        The report, equal to the report that was written; a `RecordingReport` if it is of recordings alone.

    Raises:
        InputError: If the file is no report; one line per fault, with its place.
        OSError: If the file cannot be read.
    """
    path = Path(path) / "report.json" if Path(path).is_dir() else Path(path)
    try:
        found = parse_json(read_bytes(path, most=_MOST_BYTES))
        alone = isinstance(found, dict) and "recordings" in found and "campaign" not in found
        return (RecordingReport if alone else Report).from_json(found)
    except FileLimitError as error:
        raise InputError(f"{path}: {error}") from None
    except ValidationError as error:
        faults = (f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors())
        raise InputError(*(f"{path}: {fault}" for fault in faults)) from None
