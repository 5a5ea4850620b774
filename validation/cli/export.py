"""`softcover export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.options import MaterialName, Sensor, Thickness
from validation.cli.output import say
from validation.cli.progress import Progress
from validation.errors import InputError, nearest
from validation.sensor_file import load

if TYPE_CHECKING:
    from fastmodel import Parameters

#: Formats that can be written.
FORMATS = ("mjcf", "gazebo")


def export(
    sensor: Sensor,
    *,
    format: Annotated[str, Parameter(name="--format", help="What to write: mjcf or gazebo.")] = "mjcf",  # noqa: A002
    out: Annotated[Path, Parameter(help="Folder for the files; an earlier result is replaced.")] = Path(
        "softcover-out"
    ),
    material: MaterialName = None,
    thickness: Thickness = None,
) -> None:
    """The sensor for other simulators: an MJCF model or a Gazebo plugin block, and the fast model's parameters."""
    from validation.derive import derive
    from validation.folder import new_folder, write_text
    from validation.mjcf import write_mjcf

    if format not in FORMATS:
        raise InputError(f"--format: unknown format {format!r}; {nearest(format, FORMATS)}")
    description = load(sensor, material=material, thickness=thickness)
    with new_folder(out) as folder:
        with Progress() as progress:
            parameters = derive(description, progress=progress).parameters
        parameters.save(folder)
        if format == "gazebo":
            write_text(folder / f"{description.name}.xml", _plugin_block(parameters))
        else:
            write_mjcf(parameters, folder / f"{description.name}.xml", name=description.name)
    say(f"wrote {description.name}.xml, parameters.toml, cover.npz to {out}")


def _plugin_block(parameters: Parameters) -> str:
    """The 2015 report's plugin element."""
    from fastmodel.errors import FastModelError
    from fastmodel.gazebo import write_block

    try:
        return write_block(parameters)
    except FastModelError as error:
        raise InputError(f"--format: {error}") from None
