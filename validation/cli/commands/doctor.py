"""The command `softcover doctor`, which checks the installation or asks a real sensor for its properties."""

from __future__ import annotations

import os
import platform
import shutil
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.entry import CHECK_FAILED, DONE

#: Commands that need a part of the installation, by name of the part: an extra, or an empty name for the base.
_PARTS = {
    "": "fast model, press --model fast, export, terminal view, store",
    "fem": "derive, press",
    "report": "demo, validate",
    "device": "the real sensor and its files",
    "gym": "reinforcement-learning wrapper",
    "torch": "contact and signal chain on arrays of PyTorch",
    "view": "pictures in three dimensions with --out, fields.vtu",
    "curved": "tetrahedra in curved covers from CAD",
}


def doctor(*, port: Annotated[str | None, Parameter(metavar="PORT")] = None, json: options.Json = False) -> int:
    """Print what is installed, what is missing and the command that installs it; exit with 1 if the base is incomplete.

    Examples of use:

        softcover doctor
        softcover doctor --json
        softcover doctor --port /dev/ttyACM0

    Args:
        port: Instead, ask the sensor on this port for what its documentation leaves open.
    """
    if port is not None:
        return _ask_sensor(port, json=json)
    parts = {part: {name: _find_version(name) for name in _find_distributions(part)} for part in _PARTS}
    status = DONE if all(parts[""].values()) else CHECK_FAILED
    if json:
        named = {part or "base": versions for part, versions in parts.items()}
        output.print_json({"python": platform.python_version(), "parts": named, "surroundings": _find_surroundings()})
        return status
    rows = []
    for part, versions in parts.items():
        found = ", ".join(f"{name} {number}" for name, number in versions.items() if number)
        absent = ", ".join(name for name, number in versions.items() if not number)
        target = f"'.[{part}]'" if part else "."
        cure = f"{absent}: in a clone, python -m pip install -e {target}" if absent else "nothing"
        rows.append((part or "(base)", _PARTS[part], found, cure))
    headings = ("part", "for", "installed", "missing, and how to get it")
    title = f"softcover {_find_version('softcover')} on Python {platform.python_version()}"
    output.print_table(headings, rows, title=title, left=len(headings))
    for name, value in _find_surroundings().items():
        output.show(f"{name}: {value}")
    return status


def _find_distributions(extra: str) -> list[str]:
    """List the packages that softcover requires on this platform.

    Args:
        extra: Name of an extra; empty for the base.
    """
    from importlib import metadata

    from packaging.requirements import Requirement

    wanted = []
    for line in metadata.requires("softcover") or []:
        requirement = Requirement(line)
        conditional = requirement.marker is not None and "extra" in str(requirement.marker)
        applies = requirement.marker is None or requirement.marker.evaluate({"extra": extra})
        if requirement.name != "softcover" and conditional == bool(extra) and applies:
            wanted.append(requirement.name)
    return wanted


def _ask_sensor(port: str, *, json: bool) -> int:
    from validation.weiss.inquiry import UNCONFIRMED, inquire
    from validation.weiss.sensor import Sensor

    with Sensor(port) as sensor:
        answers = inquire(sensor)
    if json:
        output.print_json({"port": port, "answers": answers, "assumed": UNCONFIRMED})
        return DONE
    for heading, lines in ((f"the sensor on {port}", answers), ("what the driver assumes", UNCONFIRMED)):
        output.show(heading)
        for topic, line in lines.items():
            output.show(f"  {topic}: {line}")
    return DONE


def _find_surroundings() -> dict[str, str]:
    recordings = Path(os.environ.get("SOFTCOVER_RECORDINGS", "../shared/recordings"))
    browser = next((path for name in ("chromium", "google-chrome", "firefox") if (path := shutil.which(name))), None)
    return {
        "cores": str(os.cpu_count()),
        "recordings": str(recordings) if recordings.is_dir() else "none (set SOFTCOVER_RECORDINGS to their folder)",
        "browser for the report": browser or "none found on the search path; any browser opens index.html",
    }


def _find_version(distribution: str) -> str | None:
    from importlib import metadata

    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None
