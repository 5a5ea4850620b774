"""`softcover validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli.evaluate import evaluate_into
from validation.cli.options import Json, MaterialName, Recordings, Sensor, Thickness
from validation.recordings.series import find_recordings_folder
from validation.sensor_file import load


def validate(
    sensor: Sensor,
    *,
    recordings: Recordings = None,
    material: MaterialName = None,
    thickness: Thickness = None,
    out: Annotated[Path, Parameter(help="Folder for the report; an earlier one is replaced.")] = Path(
        "softcover-report"
    ),
    json: Json = False,
) -> int:
    """Score the fast model of a sensor against finite elements, and against recordings where given."""
    description = load(sensor, material=material, thickness=thickness)
    # Recordings belong to one sensor: only those that the user names are taken for this one's.
    folder = None if recordings is None else find_recordings_folder(recordings)
    return evaluate_into(out, description, recordings=folder, recorded=description, json=json)
