"""Indenters and poses as text: `sphere:radius=5mm`, `box:size=10mmx10mmx5mm`, `--at=0.7mm,-1.1mm`.

The shapes and their parameters are those of `meshes.indenter.SHAPES`; a new shape needs nothing here.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from meshes import Indenter
from meshes.indenter import SHAPES
from validation.errors import InputError, nearest
from validation.quantity import QuantityError, read, read_vector

#: Numbers that a parameter takes, where it is not one.
_SIZES = {("box", "size"): 3, ("h", "size"): 2}
_EXAMPLES = {
    "sphere": "sphere:radius=5mm",
    "cylinder": "cylinder:radius=4mm",
    "box": "box:size=10mmx10mmx5mm",
    "tip": "tip:radius=1mm",
    "roller": "roller:radius=4mm,length=12mm",
    "cone": "cone:angle=120deg,radius=4mm",
    "nut": "nut:across=13mm,bore=8mm",
    "h": "h:size=12mmx16mm,bar=4mm",
}


def read_indenter(text: str, *, place: str = "--indenter") -> Indenter:
    """Make an indenter from `shape:parameter=value,...`.

    Args:
        text: The description.
        place: What to call it in a fault.

    Raises:
        InputError: With one line per fault: an unknown shape or parameter, a missing one, a bad quantity.
    """
    shape, _, rest = text.strip().partition(":")
    if shape not in SHAPES:
        example = _EXAMPLES["sphere"]
        raise InputError(f"{place}: unknown indenter {shape!r}; {nearest(shape, SHAPES)}; for example {example}")
    fields = {field.name: field for field in dataclasses.fields(SHAPES[shape])}
    faults: list[str] = []
    values: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name not in fields or not equals:
            hint = nearest(name, fields)
            faults.append(f"{place}: {shape} has no parameter {name!r}; {hint}; for example {_example(shape)}")
            continue
        try:
            values[name] = _value(shape, fields[name], value, place)
        except QuantityError as error:
            faults.append(str(error))
    given = {part.partition("=")[0].strip() for part in rest.split(",")}
    faults.extend(
        f"{place}: {shape} needs {field.name}; write for example {_example(shape)}"
        for field in fields.values()
        if field.default is dataclasses.MISSING and field.name not in given
    )
    if faults:
        raise InputError(*faults)
    try:
        made: Indenter = SHAPES[shape](**values)
    except ValueError as error:
        raise InputError(f"{place}: {error}; write for example {_example(shape)}") from None
    return made


def read_load(text: str, *, place: str = "--load") -> float:
    """Read a load in N, or as the weight of a mass in g [N].

    Raises:
        InputError: If it is not a positive force.
    """
    return _positive(text, "force", place)


def read_depth(text: str, *, place: str = "--depth") -> float:
    """Read an approach from first touch [m].

    Raises:
        InputError: If it is not a positive length.
    """
    return _positive(text, "length", place)


def read_position(text: str, *, place: str = "--at") -> tuple[float, float]:
    """Read `x,y` in the array's frame [m].

    Raises:
        InputError: If it is not two lengths.
    """
    try:
        x, y = read_vector(text, "length", 2, place=place)
    except QuantityError as error:
        raise InputError(str(error)) from None
    return (x, y)


def read_yaw(text: str, *, place: str = "--yaw") -> float:
    """Read an angle [rad].

    Raises:
        InputError: If it is not an angle.
    """
    try:
        return read(text, "angle", place=place)
    except QuantityError as error:
        raise InputError(str(error)) from None


def _positive(text: str, kind: Any, place: str) -> float:  # noqa: ANN401 -- a literal that read checks
    try:
        number = read(text, kind, place=place)
    except QuantityError as error:
        raise InputError(str(error)) from None
    if number <= 0:
        raise InputError(f"{place}: must be positive, not {text!r}")
    return number


def _value(shape: str, field: dataclasses.Field[Any], text: str, place: str) -> float | tuple[float, ...]:
    where, kind = f"{place}: {shape}.{field.name}", field.metadata.get("quantity", "length")
    count = _SIZES.get((shape, field.name), 1)
    if count > 1:
        return read_vector(text, kind, count, place=where, joint="x")
    return read(text, kind, place=where)


def _example(shape: str) -> str:
    return _EXAMPLES.get(shape, f"{shape}:...")
