"""`softcover export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.campaign.comparison import METHODS
from validation.cli.options import Json, MaterialName, Sensor, Thickness, collect
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.errors import InputError, nearest
from validation.sensor_file import SensorDescription, load

if TYPE_CHECKING:
    from fastmodel import Parameters

#: Formats that can be written.
FORMATS = ("mjcf", "gazebo")

_Format = Annotated[str, Parameter(name="--format", help="What to write: mjcf or gazebo.")]
_Out = Annotated[Path, Parameter(help="Folder for the files; an earlier result is replaced.")]
_Method = Annotated[
    str,
    Parameter(help="Contact of the MJCF model: default, cover or foundation (one plate), area or boxes (one each)."),
]


def export(
    sensor: Sensor,
    *,
    format: _Format = "mjcf",  # noqa: A002
    method: _Method = "default",
    out: _Out = Path("softcover-out"),
    material: MaterialName = None,
    thickness: Thickness = None,
    json: Json = False,
) -> None:
    """The sensor for other simulators: an MJCF model or a Gazebo plugin block, and the fast model's parameters."""
    from validation.derivation.derive import derive
    from validation.output_folder import new_folder

    faults = _faults(format, method)
    description = collect(faults, lambda: load(sensor, material=material, thickness=thickness))
    if faults or description is None:
        raise InputError(*faults)
    if format == "gazebo":
        _refuse_early(description)
    name = f"{description.name}.xml"
    with new_folder(out) as folder:
        with Progress() as progress:
            parameters = derive(description, progress=progress).parameters
        parameters.save(folder)
        used = _write(parameters, folder / name, format, method)
    files = [name, "parameters.toml", "cover.npz"]
    if json:
        result = {"sensor": description.name, "format": format, "method": used, "out": str(out), "files": files}
        print_json(result)
    else:
        say(f"wrote {', '.join(files)} to {out}")


def _faults(form: str, method: str) -> list[str]:
    faults = []
    if form not in FORMATS:
        faults.append(f"--format: unknown format {form!r}; {nearest(form, FORMATS)}")
    if method not in METHODS:
        faults.append(f"--method: unknown contact method {method!r}; {nearest(method, METHODS)}")
    elif form == "gazebo" and method != METHODS[0]:
        faults.append("--method: the Gazebo plugin block has one method of its own; use --format mjcf with --method")
    return faults


def _refuse_early(description: SensorDescription) -> None:
    """Raise what array or electronics keep out of a plugin block, before the work; any kernel may stand in for its."""
    from fastmodel import Gaussian, Parameters

    _plugin_block(
        Parameters(
            array=description.array,
            spread=description.spread or Gaussian.from_sigma(1.0),
            filter=description.filter,
            electronics=description.electronics,
        )
    )


def _write(parameters: Parameters, path: Path, form: str, method: str) -> str | None:
    """Write the model; the name of the contact method that it is for, None where the format has its own."""
    from fastmodel.contact.methods import choose_method
    from validation.cli.mjcf import write_mjcf
    from validation.output_folder import write_text

    if form == "gazebo":
        write_text(path, _plugin_block(parameters))
        return None
    used, _ = choose_method(method, parameters)
    write_mjcf(parameters, path, name=path.stem, method=used)
    return used


def _plugin_block(parameters: Parameters) -> str:
    """The 2015 report's plugin element."""
    from fastmodel.adapters.gazebo import write_block
    from fastmodel.errors import FastModelError

    try:
        return write_block(parameters)
    except FastModelError as error:
        raise InputError(f"--format: {error}") from None
