"""The command `softcover export`, which writes a sensor for other simulators."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.options import Json, Layers, MaterialName, Sensor, Thickness, check_choice, collect
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.sensor_file import SensorDescription

#: Formats that can be written: an MJCF model of MuJoCo, or an XML element for Gazebo.
FORMATS = ("mjcf", "gazebo")

_Format = Annotated[str, Parameter(name="--format", help="What to write: mjcf or gazebo.")]
_Out = Annotated[Path, Parameter(help="Folder for the files; an earlier result is replaced.")]
_Method = Annotated[
    str,
    Parameter(
        help="Contact method that the MJCF model is for: default, cover or foundation (one plate for the array), "
        "area or boxes (one box per texel)."
    ),
]


def export(
    sensor: Sensor,
    *,
    format: _Format = "mjcf",  # noqa: A002
    method: _Method = "default",
    out: _Out = Path("softcover-out"),
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    json: Json = False,
) -> None:
    """Write the sensor for other simulators: an MJCF model or a Gazebo block, and the fast model's parameters.

    Examples of use:

        softcover export wts-0614-34 --format mjcf --out wts
        softcover export wts-0614-34 --format mjcf --method boxes --json
        softcover export sensor.toml --format mjcf --material dragon-skin-30 --thickness 2mm
        softcover export derived --format gazebo
    """
    from validation.campaign.comparison import METHODS
    from validation.cli.sensors import find_parameters, read_sensor
    from validation.output_folder import make_file_name, new_folder

    faults: list[str] = []
    collect(faults, lambda: check_choice("--format", "format", format, FORMATS))
    collect(faults, lambda: check_choice("--method", "contact method", method, METHODS))
    if not faults and format == "gazebo" and method != METHODS[0]:
        faults.append("--method: the Gazebo plugin block has one method of its own; use --format mjcf with --method")
    found = collect(faults, lambda: read_sensor(sensor, material=material, thickness=thickness, layers=layer))
    if faults or found is None:
        raise InputError(*faults)
    if format == "gazebo":
        _check_gazebo(found)
    model = make_file_name(found.array.name, suffix=".xml")
    with new_folder(out) as folder:
        with Progress() as progress:
            parameters = find_parameters(found, progress)
        parameters.save(folder)
        used = _write_model(parameters, folder / model, format, method)
    files = [model, "parameters.toml", "cover.npz"]
    if json:
        names = {"sensor": found.array.name, "format": format, "method": used}
        print_json({**names, "out": str(out), "files": files})
    else:
        say(f"wrote {', '.join(files)} to {out}")


def _check_gazebo(found: SensorDescription | Parameters) -> None:
    """Refuse an array or electronics that the Gazebo plugin cannot describe, before the parameters are derived.

    The check does not depend on the spread kernel, so it uses an arbitrary kernel: the real kernel is derived later.

    Raises:
        InputError: If the plugin cannot describe the array or the electronics.
    """
    from fastmodel import Gaussian, Parameters

    kernel = Gaussian.from_sigma(1.0)
    _write_gazebo_block(
        Parameters(array=found.array, spread=found.spread or kernel, filter=found.filter, electronics=found.electronics)
    )


def _write_model(parameters: Parameters, path: Path, form: str, method: str) -> str | None:
    """Write the model of a sensor to a file.

    Args:
        parameters: Parameters of the sensor's fast model.
        path: The file to write.
        form: Format, one of `FORMATS`.
        method: Contact method that a user chose, possibly `default`.

    Returns:
        Name of the contact method that the MJCF model is for; None for Gazebo, whose plugin has a method of its own.
    """
    from fastmodel.contact.methods import choose_method
    from validation.output_folder import write_text

    if form == "gazebo":
        write_text(path, _write_gazebo_block(parameters))
        return None
    used, _ = choose_method(method, parameters)
    write_text(path, make_mjcf(parameters, name=path.stem, method=used))
    return used


def _write_gazebo_block(parameters: Parameters) -> str:
    """Return the XML element that the Gazebo plugin of the 2015 report reads.

    Raises:
        InputError: If the plugin cannot describe the sensor.
    """
    from fastmodel.adapters.gazebo import write_block
    from fastmodel.errors import FastModelError

    try:
        return write_block(parameters)
    except FastModelError as error:
        raise InputError(f"--format: {error}") from None


def make_mjcf(parameters: Parameters, *, name: str, method: str) -> str:
    """Make the text of a complete MJCF model, with the sensor on one body.

    The model contains the rigid plate of the contact methods `cover` and `foundation`, or the rigid texels of the
    methods `area` and `boxes`.  The distribution of the load on texels, the spread, the filter and the electronics are
    not in the model: `fastmodel` computes them from `parameters.toml`.

    Args:
        parameters: Parameters of the sensor's fast model.
        name: Name of the model and of its body; the names of the geoms begin with this name.
        method: Name of the contact method.

    Raises:
        FastModelError: If the contact method needs data that the parameters lack.
    """
    import mujoco

    import fastmodel

    spec = mujoco.MjSpec()
    spec.modelname = name
    body = spec.worldbody.add_body(name=name)
    fastmodel.attach(spec, body, parameters, name=name, contact=method)
    geoms = spec.compile().ngeom
    text: str = spec.to_xml()
    # Compile the MJCF text once, to check that it has as many geoms as the original model.
    loaded = mujoco.MjModel.from_xml_string(text).ngeom
    if loaded != geoms:
        raise RuntimeError(f"the MJCF text of {name} has {loaded} geoms, the model {geoms}")
    return text
