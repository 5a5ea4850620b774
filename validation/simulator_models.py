"""Models of a sensor for other simulators: MJCF, SDF, URDF, and the element that the Gazebo plugin of 2015 reads.

The models hold rigid boxes: a plate, or one box per texel.  The parameters of the fast model, which are written beside
each model, describe the effect of the cover.
"""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from fastmodel import Gaussian, Parameters
from fastmodel.errors import FastModelError
from validation.errors import Faults, InputError, check_choice, shorten
from validation.results import JsonObject, Result, result_model
from validation.sensor_file import SensorDescription

#: Suffix of the model's file by format of the model: MuJoCo, the Gazebo plugin of 2015, SDFormat, URDF.
FORMATS = {"mjcf": ".xml", "gazebo": ".xml", "sdf": ".sdf", "urdf": ".urdf"}
#: Formats that hold scored values: keys of `validation.simulator_values.targets.TARGETS`.
SCORED = ("drake", "newton", "genesis", "isaac", "lerobot", "ros2")


@result_model
class Exported(Result):
    """Files written for another simulator.

    Attributes:
        sensor: Name of the sensor.
        format: Format of the model, one of `FORMATS` or `SCORED`.
        method: Contact method of the model; None for the Gazebo plugin and scored values, which have none.
        out: Folder of the files.
        files: Names of the files; the first is the model.
        warnings: Sentences about values of the sensor file that the fast model does not use.
        scores: Summary of `scored.json`: loads [N], and the rows without their presses; empty for the other formats.
    """

    sensor: str
    format: str
    method: str | None
    out: str
    files: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    scores: JsonObject = field(default_factory=dict)


def read_options(
    form: str, method: str, mass: str | None, load: str | None = None
) -> tuple[float | None, tuple[float, float] | None]:
    """Check the options of an export, and return the mass of the array [kg] and the range of loads [N], if given.

    Raises:
        InputError: With one line per fault.
    """
    from validation.campaign.comparison import METHODS

    faults = Faults()
    faults.read(check_choice, "--format", "format", form, (*FORMATS, *SCORED))
    faults.read(check_choice, "--method", "contact method", method, METHODS)
    if form in SCORED and method != METHODS[0]:
        faults.append(f"--method: {form} has a contact of its own; leave it out")
    if form in FORMATS and load is not None:
        faults.append(f"--load: {form} holds no scored value; leave it out, or take --format {' or '.join(SCORED)}")
    if not faults and form == "gazebo" and method != METHODS[0]:
        faults.append("--method: the Gazebo plugin block has one method of its own; use --format mjcf with --method")
    kilograms = None if mass is None else faults.read(_read_mass, mass, form)
    loads = None if load is None else faults.read(_read_loads, load)
    faults.refuse()
    return kilograms, loads


def _read_loads(text: str) -> tuple[float, float]:
    from validation.text.quantity import read_quantity

    ends = text.split(":")
    if len(ends) != 2:  # noqa: PLR2004 -- from and to
        raise InputError(f"--load: {shorten(text)} is no range from:to; write for example 1N:5N")
    low, high = (read_quantity(each, "force", place="--load", example="1N:5N") for each in ends)
    if not 0 < low < high:
        raise InputError(f"--load: must be positive, the smaller load first, not {shorten(text)}; for example 1N:5N")
    return low, high


def _read_mass(text: str, form: str) -> float:
    from validation.text.quantity import read_quantity

    if form not in {"sdf", "urdf"}:
        raise InputError(f"--mass: {form} holds massless boxes or none; leave it out, or take --format sdf or urdf")
    kilograms = read_quantity(text, "mass", place="--mass")
    if not kilograms > 0:
        raise InputError(f"--mass: must be positive, not {text!r}")
    return kilograms


def check_gazebo(sensor: SensorDescription | Parameters) -> None:
    """Refuse a sensor whose array or electronics the Gazebo plugin cannot describe, before its parameters are derived.

    Raises:
        InputError: If the plugin cannot describe the array or the electronics.
    """
    spread = sensor.spread or Gaussian.from_sigma(1.0)  # The plugin can describe any kernel, so that any will do here.
    electronics = sensor.electronics
    _make_gazebo_block(Parameters(array=sensor.array, spread=spread, filter=sensor.filter, electronics=electronics))


def write_model(parameters: Parameters, path: Path, *, form: str, method: str, mass: float | None) -> str | None:
    """Write the model of a sensor to a file, and the parameters of its fast model beside it.

    Args:
        parameters: Parameters of the sensor's fast model.
        path: The file to write, in an existing folder.
        form: Format, one of `FORMATS`.
        method: Contact method, possibly `default`.
        mass: Mass of the array in SDF and URDF; None if it is not given [kg].

    Returns:
        Name of the contact method of the model; None for the Gazebo plugin, which has its own method.

    Raises:
        InputError: If the Gazebo plugin cannot describe the sensor.
        FastModelError: If the contact method needs data that the parameters lack.
    """
    from fastmodel.adapters.rigid_models import list_boxes, write_sdf, write_urdf
    from fastmodel.attachment import choose_method
    from validation.output_folder import write_text

    parameters.save(path.parent)
    if form == "gazebo":
        write_text(path, _make_gazebo_block(parameters))
        return None
    used, _ = choose_method(method, parameters)
    if form == "mjcf":
        text = make_mjcf(parameters, name=path.stem, method=used)
    elif form == "urdf":
        text = write_urdf(list_boxes(parameters, method=used), name=path.stem, mass=mass)
    else:
        rate = parameters.electronics.rate_hz
        text = write_sdf(list_boxes(parameters, method=used), name=path.stem, rate_hz=rate, mass=mass)
    write_text(path, text)
    return used


def _make_gazebo_block(parameters: Parameters) -> str:
    """Return the XML element that the Gazebo plugin of the 2015 report reads.

    Raises:
        InputError: If the plugin cannot describe the sensor.
    """
    from fastmodel.adapters.gazebo import write_block

    try:
        return write_block(parameters)
    except FastModelError as error:
        raise InputError(f"--format: {error}") from None


def make_mjcf(parameters: Parameters, *, name: str, method: str) -> str:
    """Make the text of a complete MJCF model, with the sensor on one body.

    The model contains the rigid plate of the contact methods `cover` and `foundation`, or the rigid texels of the
    method `boxes`.  The distribution of the load on texels, the spread, the filter and the electronics are not in the
    model: `fastmodel` computes them from `parameters.toml`.

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
