"""Reading of the sensor that the argument SENSOR of a command names, and of the parameters of its fast model."""

from __future__ import annotations

from collections.abc import Sequence

from fastmodel import Parameters
from fastmodel.surface import CoverPoints
from validation import api
from validation.cli.output import note, say
from validation.errors import InputError
from validation.parameters import find_parameters, holds_parameters
from validation.sensor_file import SensorDescription, load

__all__ = ["check_curved_method", "find_parameters", "read_description", "read_sensor", "tell_unused"]


def read_description(
    sensor: str,
    *,
    material: str | None = None,
    thickness: str | None = None,
    layers: Sequence[str] | None = None,
    curved: bool = False,
    instead: str = "",
) -> SensorDescription:
    """Read the description of a sensor, for a command that needs the sensor's cover.

    Args:
        sensor: Path of a sensor file, or name of a built-in sensor.
        material: Name of a material that replaces the cover's material.
        thickness: Thickness with its unit that replaces the cover's thickness.
        layers: Changes of single layers, values of the option `--layer`.
        curved: Whether the command can treat curved covers.
        instead: What the user can do with a folder of parameters, for the error message; empty if nothing.

    Raises:
        InputError: If the sensor cannot be read, or `sensor` is a folder with parameters of the fast model, which do
            not describe the cover, or the command cannot treat its curved cover.
        OSError: If the file exists and cannot be read.
    """
    if holds_parameters(sensor):
        raise InputError(
            f"{sensor}: holds the parameters of the fast model, but no description of the cover, which is needed here; "
            f"name the sensor file or the built-in sensor that it was derived from{instead and f', or {instead}'}"
        )
    found = load(sensor, material=material, thickness=thickness, layers=layers or ())
    if not curved:
        _ = found.layered_cover  # a solid is refused
    return _tell_assumed(found)


def _tell_assumed(found: SensorDescription) -> SensorDescription:
    """Keep a note on what is assumed about the electronics; return the description as it is."""
    if found.assumed_electronics:
        note(
            f"{found.source} does not state all of [electronics]; assumed: "
            f"{', '.join(found.assumed_electronics)}; counts and images follow from that, forces do not"
        )
    return found


def read_sensor(
    sensor: str,
    *,
    material: str | None = None,
    thickness: str | None = None,
    layers: Sequence[str] | None = None,
    curved: bool = False,
) -> SensorDescription | Parameters:
    """Read a sensor, for a command that needs only the fast model.

    Args:
        sensor: Path of a sensor file, name of a built-in sensor, or path of a folder that `softcover derive` wrote.
        material: Name of a material that replaces the cover's material.
        thickness: Thickness with its unit that replaces the cover's thickness.
        layers: Changes of single layers, values of the option `--layer`.
        curved: Whether the command can treat curved covers.

    Returns:
        The parameters of the fast model if `sensor` is a folder that `softcover derive` wrote; else the description of
        the sensor.

    Raises:
        InputError: If the sensor cannot be read, or `material`, `thickness` or `layers` is given for a folder of
            parameters, which were derived for one cover.
        ParametersError: If the files in the folder are damaged.
        OSError: If the file exists and cannot be read.
    """
    found = api.load(sensor, material=material, thickness=thickness, layers=layers or ())
    if isinstance(found, Parameters):
        return found
    _ = curved or found.layered_cover  # a solid is refused
    return _tell_assumed(found)


def check_curved_method(found: SensorDescription | Parameters | None, method: str) -> None:
    """Refuse a contact method of flat arrays for the parameters of a curved cover.

    Raises:
        InputError: If the method is not the default.
    """
    if isinstance(found, Parameters) and isinstance(found.surface, CoverPoints) and method != "default":
        raise InputError(f"--method: {method} is for flat covers, this one is curved; leave --method out")


def tell_unused(sensor: SensorDescription | Parameters, more: str = "") -> tuple[str, ...]:
    """Print what a sensor file states and the fast model does not use, a warning each, and return the sentences.

    Args:
        sensor: Result of `read_sensor`; a folder of parameters states nothing that the fast model does not use.
        more: Text that the printed lines end with.
    """
    sentences = api.list_unused(sensor)
    for sentence in sentences:
        say(f"softcover: warning: {sentence}{more}")
    return sentences
