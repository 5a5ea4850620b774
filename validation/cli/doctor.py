"""`softcover doctor`."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from cyclopts import Parameter
from packaging.requirements import Requirement

from validation.cli.failures import CHECK_FAILED, DONE
from validation.cli.output import print_json

_WHAT_FOR: Mapping[str, str] = MappingProxyType(
    {
        "": "fast model, export, terminal view",
        "fem": "derive, press",
        "report": "demo, validate",
        "device": "the real sensor and its files",
        "gym": "reinforcement-learning wrapper",
    }
)


def doctor(
    *,
    port: Annotated[str | None, Parameter(help="Ask the sensor on this port what no document says.")] = None,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Say what is installed, what is missing and the command that brings it.

    Leaves with 1 when the base installation itself is broken.

    Args:
        port: Ask the sensor on this port instead.
        as_json: Print one JSON object.
    """
    if port is not None:
        return _ask_sensor(port, as_json=as_json)
    parts = {part: {name: _version(name) for name in _find_distributions(part)} for part in _WHAT_FOR}
    status = DONE if all(parts[""].values()) else CHECK_FAILED
    if as_json:
        named = {part or "base": versions for part, versions in parts.items()}
        print_json({"python": platform.python_version(), "parts": named, "surroundings": _surroundings()})
        return status
    _print_tables(parts)
    return status


def _find_distributions(extra: str) -> list[str]:
    """Distributions that the base installation (`extra` empty) or an extra requires on this platform, as declared."""
    wanted = []
    for line in metadata.requires("softcover") or []:
        requirement = Requirement(line)
        conditional = requirement.marker is not None and "extra" in str(requirement.marker)
        applies = requirement.marker is None or requirement.marker.evaluate({"extra": extra})
        if requirement.name != "softcover" and conditional == bool(extra) and applies:
            wanted.append(requirement.name)
    return wanted


def _ask_sensor(port: str, *, as_json: bool) -> int:
    from validation.weiss.inquiry import inquire
    from validation.weiss.sensor import Sensor
    from validation.weiss.unconfirmed import UNCONFIRMED

    with Sensor(port) as sensor:
        answers = inquire(sensor)
    if as_json:
        print_json({"port": port, "answers": answers, "assumed": UNCONFIRMED})
        return DONE
    from rich.console import Console

    console = Console()
    for heading, lines in ((f"the sensor on {port}", answers), ("what the driver assumes", UNCONFIRMED)):
        console.print(f"[bold]{heading}[/bold]")
        for topic, line in lines.items():
            console.print(f"  {topic}: {line}", highlight=False, markup=False)
    return DONE


def _print_tables(parts: Mapping[str, Mapping[str, str | None]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"softcover {_version('softcover')} on Python {platform.python_version()}")
    for heading in ("part", "for", "installed", "missing, and how to get it"):
        table.add_column(heading)
    for part, versions in parts.items():
        found = ", ".join(f"{name} {number}" for name, number in versions.items() if number)
        absent = ", ".join(name for name, number in versions.items() if not number)
        target = f"'softcover\\[{part}]'" if part else "softcover"
        cure = f"{absent}: [bold]python -m pip install {target}[/bold]" if absent else "[green]nothing[/green]"
        table.add_row(part or "(base)", _WHAT_FOR[part], found, cure)
    console = Console()
    console.print(table)
    for name, value in _surroundings().items():
        console.print(f"{name}: {value}", highlight=False)


def _surroundings() -> dict[str, str]:
    recordings = Path(os.environ.get("SOFTCOVER_RECORDINGS", "../shared/recordings"))
    browser = next((path for name in ("chromium", "google-chrome", "firefox") if (path := shutil.which(name))), None)
    return {
        "cores": str(os.cpu_count()),
        "recordings": str(recordings) if recordings.is_dir() else "none (set SOFTCOVER_RECORDINGS to their folder)",
        "browser for the report": browser or "none found on the search path; any browser opens index.html",
    }


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
