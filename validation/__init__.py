"""Cases, recordings, scores, reports and the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validation.results.report import Report


def read_report(path: Path | str) -> Report:
    """Read a `report.json`; see `validation.results.report.read_report`."""
    from validation.results import report

    return report.read_report(path)


def __getattr__(name: str) -> str:
    """Look up `__version__` when it is used: the look-up takes a sixth of the time that the command line starts in."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("softcover")
