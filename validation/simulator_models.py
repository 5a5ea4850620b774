"""Models of a sensor for other simulators: MJCF, SDF, URDF, and the element that the Gazebo plugin of 2015 reads.

The models hold rigid boxes: a plate, or one box per texel.  The parameters of the fast model, which are written beside
each model, describe the effect of the cover.
"""

from __future__ import annotations

from pathlib import Path

from fastmodel import Gaussian, Parameters
from fastmodel.errors import FastModelError
from validation.errors import Faults, InputError, check_choice
from validation.results import Result, result_model
from validation.sensor_file import SensorDescription

#: Suffix of the model's file by format of the model: MuJoCo, the Gazebo plugin of 2015, SDFormat, URDF.
FORMATS = {"mjcf": ".xml", "gazebo": ".xml", "sdf": ".sdf", "urdf": ".urdf"}


@result_model
class Exported(Result):
    """Files written for another simulator.

    Attributes:
        sensor: Name of the sensor.
        format: Format of the model, one of `FORMATS`.
        method: Contact method of the model; None for the Gazebo plugin, which has its own method.
        out: Folder of the files.
        files: Names of the files; the first is the model.
        warnings: Sentences about values of the sensor file that the fast model does not use.
    """

    sensor: str
    format: str
    method: str | None
    out: str
    files: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def read_options(form: str, method: str, mass: str | None) -> float | None:
    """Check the options of an export, and return the mass of the array [kg]; None if it is not given.

    Raises:
        InputError: With one line per fault.
    """
    from validation.campaign.comparison import METHODS

    faults = Faults()
    faults.read(check_choice, "--format", "format", form, FORMATS)
    faults.read(check_choice, "--method", "contact method", method, METHODS)
    if not faults and form == "gazebo" and method != METHODS[0]:
        faults.append("--method: the Gazebo plugin block has one method of its own; use --format mjcf with --method")
    kilograms = None if mass is None else faults.read(_read_mass, mass, form)
    faults.refuse()
    return kilograms


def _read_mass(text: str, form: str) -> float:
    from validation.text.quantity import read_quantity

    if form in {"mjcf", "gazebo"}:
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
