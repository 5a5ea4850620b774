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

#: Formats that can be written, and the suffix of the file: a model for MuJoCo, Gazebo, or ROS and others, or the
#: element that the Gazebo plugin of the 2015 report reads.
FORMATS = {"mjcf": ".xml", "gazebo": ".xml", "sdf": ".sdf", "urdf": ".urdf"}

_Format = Annotated[
    str, Parameter(name="--format", help="What to write: mjcf, sdf, urdf, or gazebo (the plugin block of 2015).")
]
#: What to do with a written file, by format.
_NEXT = {
    "mjcf": "look at it: python -m mujoco.viewer --mjcf={path}; put it on a robot: fastmodel.attach(spec, body, "
    "fastmodel.load('{out}')), which also computes texel forces and counts",
    "gazebo": "paste the element into the <link> or <model> of a Gazebo world that loads the plugin of the 2015 report",
    "sdf": "include {path} in a world; its contact sensors publish the forces on the rigid boxes, before the cover "
    "spreads them: fastmodel.load('{out}') holds the spread, filter and electronics that make counts of them",
    "urdf": "join the link {name} to a link of your robot by a fixed joint; the forces on its boxes are those before "
    "the cover spreads them: fastmodel.load('{out}') holds the spread, filter and electronics that make counts of them",
}
_Out = Annotated[Path, Parameter(help="Folder for the files; an earlier result is replaced.")]
_Method = Annotated[
    str,
    Parameter(
        help="Contact method that the model is for: default, cover or foundation (one plate for the array), "
        "area or boxes (one box per texel)."
    ),
]
_Mass = Annotated[
    str | None,
    Parameter(
        help="Mass of the array for sdf and urdf, e.g. 20g; without it sdf is static and urdf has no inertia.",
        allow_leading_hyphen=True,
    ),
]


def export(
    sensor: Sensor,
    *,
    format: _Format = "mjcf",  # noqa: A002
    method: _Method = "default",
    mass: _Mass = None,
    out: _Out = Path("softcover-out"),
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    json: Json = False,
) -> None:
    """Write the sensor for other simulators: a model in MJCF, SDF or URDF, and the fast model's parameters.

    The model holds rigid boxes: a plate, or one box per texel with `--method boxes`.  What the cover does with the
    forces on them is in the parameters, which `fastmodel` reads.

    Examples of use:

        softcover export wts-0614-34 --format mjcf --out wts
        softcover export wts-0614-34 --format urdf --mass 20g
        softcover export wts-0614-34 --format sdf --method boxes
        softcover export wts-0614-34 --format mjcf --method boxes --json
        softcover export sensor.toml --format mjcf --material dragon-skin-30 --thickness 2mm
        softcover export derived --format gazebo
    """
    from validation.campaign.comparison import METHODS
    from validation.cli.sensors import find_parameters, read_sensor, tell_unused
    from validation.output_folder import make_file_name, new_folder

    faults: list[str] = []
    collect(faults, lambda: check_choice("--format", "format", format, tuple(FORMATS)))
    collect(faults, lambda: check_choice("--method", "contact method", method, METHODS))
    if not faults and format == "gazebo" and method != METHODS[0]:
        faults.append("--method: the Gazebo plugin block has one method of its own; use --format mjcf with --method")
    kilograms = collect(faults, lambda: _read_mass(mass, format))
    found = collect(faults, lambda: read_sensor(sensor, material=material, thickness=thickness, layers=layer))
    if faults or found is None:
        raise InputError(*faults)
    if format == "gazebo":
        _check_gazebo(found)
    warnings = tell_unused(found)
    model = make_file_name(found.array.name, suffix=FORMATS[format])
    with new_folder(out) as folder:
        with Progress() as progress:
            parameters = find_parameters(found, progress)
        parameters.save(folder)
        used = _write_model(parameters, folder / model, format, method, kilograms)
    files = [model, "parameters.toml", "cover.npz"]
    if json:
        names = {"sensor": found.array.name, "format": format, "method": used}
        print_json({**names, "out": str(out), "files": files, "warnings": list(warnings)})
    else:
        say(f"wrote {', '.join(files)} to {out}")
        say(_NEXT[format].format(path=out / model, out=out, name=Path(model).stem))


def _read_mass(text: str | None, form: str) -> float | None:
    """Parse the option `--mass` [kg]; None if it is not given.

    Raises:
        InputError: If the text is not a positive mass, or the format has no place for it.
    """
    from validation.text.quantity import read_quantity

    if text is None:
        return None
    if form in {"mjcf", "gazebo"}:
        raise InputError(f"--mass: {form} holds massless boxes or none; leave it out, or take --format sdf or urdf")
    kilograms = read_quantity(text, "mass", place="--mass")
    if not kilograms > 0:
        raise InputError(f"--mass: must be positive, not {text!r}")
    return kilograms


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


def _write_model(parameters: Parameters, path: Path, form: str, method: str, mass: float | None) -> str | None:
    """Write the model of a sensor to a file.

    Args:
        parameters: Parameters of the sensor's fast model.
        path: The file to write.
        form: Format, one of `FORMATS`.
        method: Contact method that a user chose, possibly `default`.
        mass: Mass of the array in SDF and URDF; None if it is not given [kg].

    Returns:
        Name of the contact method that the model is for; None for the Gazebo plugin, which has a method of its own.
    """
    from fastmodel.adapters.rigid_models import list_boxes, write_sdf, write_urdf
    from fastmodel.contact.methods import choose_method
    from validation.output_folder import write_text

    if form == "gazebo":
        write_text(path, _write_gazebo_block(parameters))
        return None
    used, _ = choose_method(method, parameters)
    if form == "mjcf":
        text = make_mjcf(parameters, name=path.stem, method=used)
    else:
        boxes = list_boxes(parameters, method=used)
        rate = parameters.electronics.rate_hz
        text = (
            write_urdf(boxes, name=path.stem, mass=mass)
            if form == "urdf"
            else write_sdf(boxes, name=path.stem, rate_hz=rate, mass=mass)
        )
    write_text(path, text)
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
