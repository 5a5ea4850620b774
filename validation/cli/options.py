"""Options that several commands have in common, the sensor that they name, and checks of options.

The help of an option that only one command has is in `Args` of the docstring of the command.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, Token

from validation.cli.output import note, say
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.sensor_file import SensorDescription

SensorFile = Annotated[
    str,
    Parameter(
        help="A sensor file, or a built-in sensor: wts-0614-34, sdh2-distal, or one that `softcover datasheet "
        "wts-0614-34 --compare all` lists; with curved covers: fingertip, phalanx, flat-pad."
    ),
]
Sensor = Annotated[
    str,
    Parameter(
        help="A sensor file, a built-in sensor (wts-0614-34, sdh2-distal), or a folder that `derive --out` wrote."
    ),
]


def _convert_time(_: type, tokens: Sequence[Token]) -> float:
    """Convert the word of an option to a time [s].

    Raises:
        InputError: If the word is neither a time with a unit, such as 500ms, nor a number of seconds.
    """
    return read_time(tokens[0].value)


# Types of options by what their text is; the help page shows the name in capitals.  A quantity may begin with a minus
# sign, so that a negative one is refused as a quantity and not taken for an option.
Length = Annotated[str, Parameter(metavar="LENGTH", allow_leading_hyphen=True)]
Force = Annotated[str, Parameter(metavar="FORCE", allow_leading_hyphen=True)]
Mass = Annotated[str, Parameter(metavar="MASS", allow_leading_hyphen=True)]
Angle = Annotated[str, Parameter(metavar="ANGLE", allow_leading_hyphen=True)]
Place = Annotated[str, Parameter(metavar="PLACE", allow_leading_hyphen=True)]
Time = Annotated[float, Parameter(metavar="TIME", allow_leading_hyphen=True, converter=_convert_time)]
Span = Annotated[str, Parameter(metavar="FROM:TO")]
Text = Annotated[str, Parameter(metavar="TEXT")]
File = Annotated[Path, Parameter(metavar="FILE")]
Folder = Annotated[Path, Parameter(metavar="FOLDER")]
Index = Annotated[int, Parameter(metavar="INDEX")]
Counts = Annotated[int, Parameter(metavar="COUNTS")]
Json = Annotated[
    bool, Parameter(name="--json", help="Print one JSON object on standard output, and nothing else there.")
]
Shape = Annotated[
    str, Parameter(metavar="INDENTER", help="Shape of the indenter, e.g. sphere:radius=5mm or box:size=10mmx10mmx5mm.")
]
Method = Annotated[
    str,
    Parameter(metavar="METHOD", help="Contact method of the fast model: default, cover, foundation or boxes."),
]
RecordingFile = Annotated[Path, Parameter(help="A recording: .mcap, .dsa, .csv, .bag, or a folder of ROS 2.")]
Topic = Annotated[
    str | None,
    Parameter(name="--topic", metavar="TOPIC", help="Topic that holds the frames, in bags of other programs."),
]
PressedArrayIndex = Annotated[
    int | None,
    Parameter(
        name="--array",
        metavar="INDEX",
        help="Index of the array if the recording has several, from 0; the one that is pressed most when not given.",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Labels:
    """Options that say how a recording is made; they are kept in its file."""

    indenter: Annotated[str, Parameter(metavar="INDENTER", help="Shape of the indenter; kept in the file.")] = ""
    load: Annotated[Force | None, Parameter(help="Force or weight, e.g. 4.9N or 500g; kept in the file.")] = None
    note: Annotated[Text, Parameter(help="Any other text to keep in the file.")] = ""


#: Labels of a recording for which no option is given.
UNLABELLED = Labels()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CoverChanges:
    """Options that change the cover of a sensor: `--material`, `--thickness`, `--layer`."""

    material: Annotated[
        str | None, Parameter(metavar="MATERIAL", help="Replaces the cover's material; see `softcover materials`.")
    ] = None
    thickness: Annotated[Length | None, Parameter(help="Replaces the cover's thickness, e.g. 2mm.")] = None
    layers: Annotated[
        tuple[str, ...],
        Parameter(
            name="--layer",
            metavar="LAYER",
            negative=(),
            help="Changes one layer of the cover, 1 being the bottom one, or adds one on top: "
            "2:thickness=1mm,youngs_modulus=3GPa. "
            "Keys: thickness, material, youngs_modulus, poisson_ratio, hardness, model and its parameters. "
            "May be given several times.",
        ),
    ] = ()

    @property
    def words(self) -> list[str]:
        """The options as words of a command line."""
        given = [("--material", self.material), ("--thickness", self.thickness)]
        given += [("--layer", each) for each in self.layers]
        return [word for option, text in given if text is not None for word in (option, shlex.quote(text))]


#: Changes of a cover for which no option is given.
UNCHANGED = CoverChanges()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class InTime:
    """Options that follow a press on a relaxing cover in time: `--history`, `--hold`."""

    history: Annotated[
        File | None,
        Parameter(help="Load or depth in time on a relaxing linear cover: CSV, columns time and load or depth."),
    ] = None
    hold: Annotated[
        str | None,
        Parameter(metavar="TIME", allow_leading_hyphen=True, help="Hold the load or depth on such a cover, e.g. 60s."),
    ] = None


#: Neither of these options.
AT_ONCE = InTime()


def check_range(option: str, value: float | None, most: float = math.inf) -> None:
    """Refuse the value of an option that is below 0 or above `most`; None, an option that is not given, is accepted.

    Raises:
        InputError: If the number is out of range; the message names the option.
    """
    if value is not None and not 0 <= value <= most:
        accepted = "0 or more" if most == math.inf else f"0..{most}"
        raise InputError(f"{option}: accepted: {accepted}, not {value:g}")


def refuse_with(option: str, others: Mapping[str, object]) -> None:
    """Refuse options that have no effect beside another one; those that are None or empty were not given.

    Raises:
        InputError: If one was given.
    """
    if given := [name for name, value in others.items() if value not in (None, "")]:
        raise InputError(f"{', '.join(given)}: has no effect with {option}; leave it out")


def read_time(text: str) -> float:
    """Parse a time with its unit, such as `500ms` or `2min`, or a number of seconds.

    Returns:
        The time [s].

    Raises:
        InputError: If the text is neither.
    """
    from validation.text.quantity import read_quantity

    try:
        seconds = float(text)
    except ValueError:
        return read_quantity(text, "time", example="10s")
    if not math.isfinite(seconds) or "_" in text:
        raise InputError(f"{text[:40]!r} is not a finite time; write for example '10s'")
    return seconds


def read_time_span(option: str, text: str, example: str) -> tuple[float, float]:
    """Parse a time span from text of the form `from:to`, two times.

    Args:
        option: Name of the option, for the error message.
        text: The time span.
        example: Example of an accepted text, for the error message.

    Returns:
        The two times [s].

    Raises:
        InputError: If the text is not two numbers with 0 <= from < to.
    """
    start, _, end = text.partition(":")
    try:
        span = (read_time(start), read_time(end))
    except InputError:
        span = (math.nan, math.nan)
    if not 0 <= span[0] < span[1]:
        raise InputError(
            f"{option}: {text!r} is not a time span from:to, the earlier time first; for example {example}"
        )
    return span


def read_sensor(
    sensor: str,
    changes: CoverChanges = UNCHANGED,
    *,
    any_cover: bool = False,
) -> SensorDescription | Parameters:
    """Read a sensor as `validation.load` does, for a command that needs only the fast model.

    Args:
        sensor: Path of a sensor file, name of a built-in sensor, or folder that `derive` wrote.
        changes: Changes of the cover.
        any_cover: Whether the command supports covers of any kind, and not only planar layers.

    Raises:
        InputError: If the sensor cannot be read, or describes a curved cover, for which `derive` must be used.
    """
    from validation import api
    from validation.sensor_file import SensorDescription

    found = api.load(sensor, **vars(changes))
    if isinstance(found, SensorDescription):
        _check_description(found, any_cover=any_cover)
    return found


def read_description(
    sensor: str,
    changes: CoverChanges = UNCHANGED,
    *,
    any_cover: bool = False,
    instead: str = "",
    in_time: bool = False,
) -> SensorDescription:
    """Read the description of a sensor, for a command that needs the sensor's cover.

    Args:
        sensor: Path of a sensor file, or name of a built-in sensor.
        changes: Changes of the cover.
        any_cover: Whether the command supports covers of any kind, and not only planar layers.
        instead: Alternative for a folder of parameters, for the error message.
        in_time: Whether the command follows the relaxation of the cover.

    Raises:
        InputError: If the sensor cannot be read, is a folder with parameters of the fast model, or has a curved cover
            that the command does not support.
    """
    from validation import api

    found = api.describe(sensor, instead=instead, **vars(changes))
    _check_description(found, any_cover=any_cover, in_time=in_time)
    return found


def _check_description(found: SensorDescription, *, any_cover: bool, in_time: bool = False) -> None:
    """Refuse a cover that a command does not support, and keep notes on assumed electronics and ignored relaxation."""
    if not any_cover:
        _ = found.layered_cover  # This property raises an error for a solid cover.
    if not in_time and any(layer.material.relaxation for layer in found.cover.layers):
        note("the cover relaxes; results hold just after loading: `softcover press --history` follows them in time")
    if assumed := ", ".join(found.assumed_electronics):
        note(
            f"{found.source} does not state all of [electronics]; assumed: {assumed}; counts and images follow from "
            "that, forces do not"
        )


def tell_unused(sensor: SensorDescription | Parameters, more: str = "") -> tuple[str, ...]:
    """Print a warning for each entry of a sensor file that the fast model does not use, and return the sentences.

    Args:
        sensor: Result of `read_sensor`.  A folder of parameters has no unused entries.
        more: Text at the end of the printed lines.
    """
    from validation import api

    sentences = api.list_unused(sensor)
    for sentence in sentences:
        say(f"softcover: warning: {sentence}{more}")
    return sentences
