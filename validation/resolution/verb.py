"""The verb `limits`: reads the options, computes, and draws the map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from validation.api import describe
from validation.errors import Faults, InputError, refuse_existing
from validation.extras import require
from validation.output_folder import check_writable
from validation.sensor_file import SensorDescription
from validation.text.quantity import Kind, read_quantity

if TYPE_CHECKING:
    from validation.resolution.limits import Limits

#: Number of thicknesses of a curve, and thinnest and thickest one [m].
_THICKNESSES, _THINNEST, _THICKEST = 11, 1e-5, 0.1
#: Largest radius and distance of touches, over the pitch [-], and largest load of one [N].
_FARTHEST, _HEAVIEST = 20.0, 1e4


def limits(
    sensor: SensorDescription | str | Path,
    *,
    load: str = "1 N",
    noise: str | None = None,
    two: str | None = None,
    radius: str = "0 mm",
    thicknesses: str | None = None,
    picture: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Limits:
    """Compute the smallest errors of place, force, radius and separation, and the least force that a sensor detects.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        load: Force of a touch.
        noise: Standard deviation of the noise of a texel's force; that of the sensor, or one count, when not given.
        two: Distance of two touches whose separation is told; None for one touch.
        radius: Radius of a touch, `0 mm` for a point.
        thicknesses: Least and largest thickness of a curve over the thickness of a flat cover, such as `1mm:6mm`.
        picture: File for the error of place above every texel, .png or .svg; None to compute no map.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option cannot be read, or the counts of the sensor fall while the force rises.
        MissingExtraError: If finite elements or the drawing are needed and not installed.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    description, target = describe(sensor), None if picture is None else Path(picture)
    options = _read_options(description, load=load, noise=noise, two=two, radius=radius, thicknesses=thicknesses)
    if target is not None and target.suffix not in {".png", ".svg"}:
        raise InputError(f"--picture: {target} is neither .png nor .svg; write for example --picture limits.png")
    refuse_existing("--picture", target)
    check_writable(target)
    require("skfem", useful=("matplotlib",) if target else ())
    from validation.resolution.limits import find_limits
    from validation.resolution.picture import draw_map

    found = find_limits(description, **options, over_array=target is not None, progress=progress)
    if target is not None:
        draw_map(found, description.array, target)
    return found


def _read_options(
    sensor: SensorDescription,
    *,
    load: str,
    noise: str | None,
    two: str | None,
    radius: str,
    thicknesses: str | None,
) -> dict[str, Any]:
    """Read quantities of limits, to the arguments of `validation.resolution.limits.find_limits`.

    Raises:
        InputError: With one line per fault.
    """
    faults, far = Faults(), _FARTHEST * min(sensor.array.pitch)
    found = {
        "load": faults.read(_read, load, "force", _HEAVIEST, place="--load"),
        "radius": faults.read(_read, radius, "length", far, place="--radius", zero=True),
        "noise": noise and faults.read(_read, noise, "force", _HEAVIEST, place="--noise"),
        "separation": two and faults.read(_read, two, "length", far, place="--two"),
        "thicknesses": faults.read(_read_span, thicknesses, place="--thicknesses") if thicknesses else (),
    }
    faults.refuse()
    return found


def _read(text: str, kind: Kind, most: float, *, place: str, zero: bool = False) -> float:
    number = read_quantity(text, kind, place=place)
    if number < 0 or (number == 0 and not zero):
        raise InputError(f"{place}: must {'not be negative' if zero else 'be positive'}, not {text!r}")
    if number > most:
        unit = {"force": "N", "length": "m"}[kind]
        raise InputError(f"{place}: must be at most {most:g} {unit}, not {text!r}")
    return number


def _read_span(text: str, *, place: str) -> tuple[float, ...]:
    ends = text.split(":")
    if len(ends) != 2:  # noqa: PLR2004 -- from and to
        raise InputError(f"{place}: {text!r} is not FROM:TO; write for example 1mm:6mm")
    low, high = (read_quantity(each, "length", place=place, example="1mm:6mm") for each in ends)
    if not _THINNEST <= low < high <= _THICKEST:
        raise InputError(f"{place}: {text!r} must rise, within 0.01mm:100mm; write for example 1mm:6mm")
    step = (high - low) / (_THICKNESSES - 1)
    return tuple(low + step * number for number in range(_THICKNESSES))
