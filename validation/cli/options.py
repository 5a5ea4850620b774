"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

from cyclopts import Parameter

from validation.errors import InputError

T = TypeVar("T")

Sensor = Annotated[str, Parameter(help="A sensor file, or a built-in sensor: wts-0614-34, sdh2-distal.")]
Json = Annotated[
    bool, Parameter(name="--json", help="Print one JSON object on standard output, and nothing else there.")
]
Out = Annotated[Path | None, Parameter(name="--out", help="Folder for the files; an earlier result is replaced.")]
MaterialName = Annotated[
    str | None, Parameter(name="--material", help="Replaces the cover's material; see `softcover materials`.")
]
Thickness = Annotated[
    str | None,
    Parameter(name="--thickness", help="Replaces the cover's thickness, e.g. 2mm.", allow_leading_hyphen=True),
]
Recordings = Annotated[
    Path | None, Parameter(name="--recordings", help="Folder with recordings of a real sensor under known weights.")
]


def within(option: str, value: float | None, most: float = float("inf")) -> None:
    """Refuse a number below 0 or above `most`.

    Raises:
        InputError: If it is; the message names the option.
    """
    if value is not None and not 0 <= value <= most:
        accepted = "0 or more" if most == float("inf") else f"0..{most}"
        raise InputError(f"{option}: accepted: {accepted}, not {value:g}")


def collect(faults: list[str], read: Callable[[], T]) -> T | None:
    """Run one reader; keep its faults, so that all of them are reported at once."""
    try:
        return read()
    except InputError as error:
        faults.extend(error.faults)
        return None
