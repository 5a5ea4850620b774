"""Parsing of indenters and poses from text: `sphere:radius=5mm`, `box:size=10mmx10mmx5mm`, `--at=0.7mm,-1.1mm`.

The accepted shapes are those of `SHAPES`; their parameters have the names of the fields of the shape's class.  The
corners of a `prism` are separated by `/`; a `mesh` is read from an STL file.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any, Literal

import meshes
from meshes.surfaces.files import LIMITS
from validation.errors import Faults, InputError, nearest, shorten
from validation.text.quantity import read_quantities, read_quantity

#: Number of values of those parameters of indenters that have more than one, by (shape, parameter) [-].
_VALUE_COUNTS = {("box", "size"): 3, ("h", "size"): 2, ("mesh", "axis"): 2}
#: Least and greatest accepted load [N] and depth [m], with their unit.  Beyond them the solvers lose all digits.
_LIMITS = {"force": (1e-6, 1e6, "N"), "length": (1e-9, 1.0, "m")}
#: Largest accepted yaw of an indenter, 360 degrees with an allowance for rounding [rad].
_TURN = 2 * math.pi * (1 + 1e-9)
#: Class or function that makes an indenter, and an example of an accepted text, by the name of the shape on the command
#: line.
SHAPES: dict[str, tuple[Any, str]] = {
    "sphere": (meshes.Sphere, "sphere:radius=5mm"),
    "cylinder": (meshes.Cylinder, "cylinder:radius=4mm"),
    "box": (meshes.Box, "box:size=10mmx10mmx5mm"),
    "tip": (meshes.RoundedTip, "tip:radius=1mm"),
    "roller": (meshes.Roller, "roller:radius=4mm,length=12mm"),
    "cone": (meshes.Cone, "cone:angle=120deg,radius=4mm"),
    "nut": (meshes.Nut, "nut:across=13mm,bore=8mm"),
    "h": (meshes.LetterH, "h:size=12mmx16mm,bar=4mm"),
    "prism": (meshes.Prism, "prism:points=-5mm,-3mm/5mm,-3mm/0mm,6mm"),
    "mesh": (meshes.read_stl, "mesh:path=part.stl,unit=mm"),
}
#: Shapes by their other names on the command line.
_ALIASES = {"ball": "sphere"}
#: Names of shapes for people where the name on the command line is none.
_WORDS = {"sphere": "ball", "tip": "rounded tip", "h": "letter H", "mesh": "body"}
#: Parameters whose value says what it is.
_PLAIN = ("size", "path", "unit")
#: Largest accepted number of characters of an indenter as text [-]; a prism of a thousand corners has as many.
_LONGEST = 20_000
#: Pattern of a comma that separates two parameters of an indenter; commas inside values do not match.
_PARAMETER_COMMA = re.compile(r",(?=\s*[a-z]+\s*(?:=|,|$))")


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Parameter:
    """A parameter of the shape of an indenter: the kind of its value, and whether a text must give it."""

    kind: Literal["length", "angle", "points", "path", "unit"]
    required: bool


#: Parameters of the shape `mesh`, an indenter from an STL file, by name.
_MESH_PARAMETERS = {
    "path": _Parameter(kind="path", required=True),
    "unit": _Parameter(kind="unit", required=False),
    "axis": _Parameter(kind="length", required=False),
}


def read_indenter(text: str, *, place: str = "--indenter") -> meshes.Indenter:
    """Make an indenter from text of the form `shape:parameter=value,...`.

    Args:
        text: The text, for example `sphere:radius=5mm`.
        place: Option or key that holds the text; error messages begin with it.

    Raises:
        InputError: With one line per fault: an unknown shape, a parameter that is unknown, missing or given twice, a
            bad quantity, a width outside the accepted range, a file that cannot be read.
    """
    if len(text) > _LONGEST:
        raise InputError(f"{place}: has {len(text)} characters; at most {_LONGEST} are accepted")
    shape, _, rest = text.strip().partition(":")
    shape = _ALIASES.get(shape, shape)
    if shape not in SHAPES:
        example = SHAPES["sphere"][1]
        raise InputError(
            f"{place}: unknown indenter {shape!r}; {nearest(shape, [*SHAPES, *_ALIASES])}; for example {example}"
        )
    make, example = SHAPES[shape]
    known = _parameters(shape)
    faults = Faults()
    values: dict[str, Any] = {}
    given: set[str] = set()
    for part in filter(None, _PARAMETER_COMMA.split(rest)):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name in given:
            faults.append(f"{place}: {shape}.{name} is given twice; write for example {example}")
        given.add(name)
        if name not in known or not equals:
            hint = nearest(name, known)
            faults.append(f"{place}: {shape} has no parameter {name!r}; {hint}; for example {example}")
            continue
        values[name] = faults.read(_read_value, shape, name, known[name], value, place)
    faults.extend(
        f"{place}: {shape} needs {name}; write for example {example}"
        for name, parameter in known.items()
        if parameter.required and name not in given
    )
    faults.refuse()
    try:
        made: meshes.Indenter = make(**values)
    except ValueError as error:
        remedy = "" if shape == "mesh" else f"; write for example {example}"
        raise InputError(f"{place}: {error}{remedy}") from None
    width = 2 * max(made.footprint)
    if shape != "mesh" and not LIMITS.sizes[0] <= width <= LIMITS.sizes[1]:
        low, high = (f"{1e3 * size:g}" for size in LIMITS.sizes)
        raise InputError(f"{place}: {1e3 * width:.3g} mm is not a possible width; accepted: {low}..{high} mm")
    return made


def describe_indenter(text: str) -> str:
    """Describe an indenter for people: `sphere:radius=5mm` is "ball, radius 5 mm".

    Args:
        text: The indenter as `read_indenter` accepts it.
    """
    shape, _, rest = text.strip().partition(":")
    words = [_WORDS.get(shape, shape)]
    for name, _, value in (part.partition("=") for part in filter(None, _PARAMETER_COMMA.split(rest))):
        if name.strip() == "points":
            words.append(f"{value.count('/') + 1} corners")
            continue
        # A space before a unit, and a cross between two lengths.
        spaced = re.sub(r"(?<=\d)([a-z]+)x(?=\d)", " \\1 \u00d7 ", value) if name == "size" else value
        words.append(("" if name in _PLAIN else f"{name} ") + re.sub(r"(?<=\d)(?=[a-z]+\b)", " ", spaced))
    return ", ".join(words)


def _parameters(shape: str) -> dict[str, _Parameter]:
    """Return the parameters of an indenter's shape by name: the fields of its class that declare a quantity."""
    if shape == "mesh":
        return _MESH_PARAMETERS
    return {
        field.name: _Parameter(kind=field.metadata["quantity"], required=field.default is dataclasses.MISSING)
        for field in dataclasses.fields(SHAPES[shape][0])
        if "quantity" in field.metadata
    }


def read_load(text: str, *, place: str = "--load") -> float:
    """Parse a load, a force such as `4.9 N` or the weight of a mass such as `500 g`, and return it in newtons [N].

    Raises:
        InputError: If the text is not a positive force from 1 uN to 1 MN.
    """
    return _read_positive(text, "force", place)


def read_depth(text: str, *, place: str = "--depth") -> float:
    """Parse an indentation depth, the approach of the indenter from first touch, and return it in metres [m].

    Raises:
        InputError: If the text is not a positive length from 1 nm to 1 m.
    """
    return _read_positive(text, "length", place)


def read_position(text: str, *, place: str = "--at") -> tuple[float, float]:
    """Parse the position `x,y` of an indenter's axis in the array's frame, and return it in metres [m].

    Raises:
        InputError: If the text is not two lengths.
    """
    x, y = read_quantities(text, "length", 2, place=place)
    return (x, y)


def read_yaw(text: str, *, place: str = "--yaw") -> float:
    """Parse the yaw angle of an indenter, a number with its unit such as `31deg`, and return it in radians [rad].

    Raises:
        InputError: If the text is not an angle, or more than one turn.
    """
    yaw = read_quantity(text, "angle", place=place)
    if abs(yaw) > _TURN:
        raise InputError(f"{place}: {text!r} is more than one turn; accepted: -360deg..360deg")
    return yaw


def read_tilt(text: str, *, place: str = "--tilt") -> tuple[float, float]:
    """Parse the tilt of an indenter, two angles with their units about its x and y axes such as `2deg,0deg` [rad].

    Raises:
        InputError: If the text is not two angles, or an angle is larger than the solvers accept.
    """
    tilt = read_angles(text, place=place, example="2deg,0deg")
    try:
        meshes.tilt_indenter(meshes.Sphere(radius=1.0), tilt)
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None
    return tilt


def read_angles(text: str, *, place: str, example: str) -> tuple[float, float]:
    """Parse two angles of any size, rotations of an indenter about its x and y axes, and return them in radians [rad].

    Args:
        text: The text.
        place: Option or key that holds the text; error messages begin with it.
        example: Accepted text, for error messages.

    Raises:
        InputError: If the text is not two angles.
    """
    parts = text.split(",")
    if len(parts) != 2:  # noqa: PLR2004 -- about x and y
        raise InputError(f"{place}: {shorten(text)} is not two angles about x and y; write for example {example}")
    about_x, about_y = (read_quantity(part, "angle", place=place) for part in parts)
    return about_x, about_y


def _read_positive(text: str, kind: Literal["force", "length"], place: str) -> float:
    number = read_quantity(text, kind, place=place)
    if number <= 0:
        raise InputError(f"{place}: must be positive, not {text!r}")
    least, most, unit = _LIMITS[kind]
    if not least <= number <= most:
        raise InputError(
            f"{place}: {number:g} {unit} is not possible on a tactile array; accepted: {least:g}..{most:g} {unit}"
        )
    return number


def _read_value(shape: str, name: str, parameter: _Parameter, text: str, place: str) -> Any:  # noqa: ANN401 -- by kind
    where, count = f"{place}: {shape}.{name}", _VALUE_COUNTS.get((shape, name), 1)
    match parameter.kind:
        case "path":
            if not text:
                raise InputError(f"{where}: names no file; write for example {SHAPES[shape][1]}")
            return text
        case "unit":
            # The unit of an STL file is given by its name, such as "mm", or as a length, such as "0.5mm".
            return read_quantity(text if re.match(r"[-+.\d]", text) else f"1 {text}", "length", place=where)
        case "points":
            return _read_points(text, where)
        case "length" | "angle" as kind:
            if count == 1:
                return read_quantity(text, kind, place=where)
            return read_quantities(text, kind, count, place=where, joint="," if shape == "mesh" else "x")


def _read_points(text: str, where: str) -> tuple[tuple[float, float], ...]:
    """Parse the corners of a polygon from text of the form `x,y/x,y/...`; a plain 0 needs no unit.

    Args:
        text: The corners.
        where: Place of the text; error messages begin with it.

    Returns:
        Positions (x, y) of the corners [m].

    Raises:
        InputError: If a corner is not two lengths.
    """
    corners: list[tuple[float, float]] = []
    for corner in text.split("/"):
        parts = [f"{part} m" if re.fullmatch(r"[-+]?0+\.?0*", part.strip()) else part for part in corner.split(",")]
        if len(parts) != 2:  # noqa: PLR2004 -- x and y
            number, example = len(corners) + 1, SHAPES["prism"][1]
            raise InputError(f"{where}: corner {number}, {corner!r}, is not 2 values; write for example {example}")
        x, y = (read_quantity(part, "length", place=where) for part in parts)
        corners.append((x, y))
    return tuple(corners)
