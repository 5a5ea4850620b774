"""`softcover demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli.evaluate import evaluate_into
from validation.cli.options import Json, Recordings
from validation.recordings.series import find_recordings_folder
from validation.sensor_file import BUILT_IN

#: The sensor that the recordings were made with.
_RECORDED = "sdh2-distal"


def demo(
    *,
    out: Annotated[Path, Parameter(help="Folder for the report; an earlier one is replaced.")] = Path(
        "softcover-report"
    ),
    recordings: Recordings = None,
    json: Json = False,
) -> int:
    """The whole way on the default sensor: PSF, fit, scores against elements and recordings, report."""
    return evaluate_into(
        out,
        BUILT_IN["wts-0614-34"],
        recordings=find_recordings_folder(recordings),
        recorded=BUILT_IN[_RECORDED],
        json=json,
    )
