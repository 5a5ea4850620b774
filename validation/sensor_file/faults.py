"""From pydantic's errors to one readable line each: path, what is wrong, what would be accepted."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from validation.errors import nearest
from validation.sensor_file.tables import LayerTable, MaterialTable, SensorTables

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

_EXAMPLES = {
    "rows": "rows = 14",
    "columns": "columns = 6",
    "pitch": 'pitch = "3.4 mm" (positions = "texels.csv" alone makes any layout)',
    "thickness": 'thickness = "2 mm"',
    "material": 'material = "dragon-skin-30"',
    "model": 'model = "linear-elastic"',
    "rate": 'rate = "271 Hz"',
    "cutoff": 'cutoff = "40 Hz"',
    "array": "the table [array]",
    "cover": "the table [[cover.layer]]",
    "layer": "the table [[cover.layer]]",
    "electronics": "the table [electronics]",
}

#: Symbols that people write for these keys.
_SYMBOLS = {"nu": "poisson_ratio", "E": "youngs_modulus", "G": "shear_modulus", "h": "thickness"}


def describe(error: ValidationError) -> list[str]:
    """One line per fault."""
    # A value that fits no branch of a union is reported once per branch; its path is the same.
    lines: dict[str, str] = {}
    for details in error.errors():
        place = path(details["loc"])
        lines.setdefault(place, f"{place}: {_what(details)}")
    return list(lines.values())


def path(location: Sequence[int | str]) -> str:
    """Write a location as `cover.layer[0].thickness`."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif "[" not in part:  # pydantic's own names of union branches
            text += f".{part}" if text else part
    return text


def _what(details: ErrorDetails) -> str:
    kind, given = details["type"], details["input"]
    key = str(details["loc"][-1])
    if kind == "value_error":
        return str(details["ctx"]["error"])
    if kind == "unexpected_keyword_argument":
        return f"unknown key; {nearest(_SYMBOLS.get(key, key), _keys(details['loc'][:-1]))}"
    if kind == "missing":
        return f"is missing; write for example {_EXAMPLES.get(key, key)}"
    if kind in ("dataclass_type", "list_type"):
        wanted = "a list" if kind == "list_type" else "a table"
        return f"must be {wanted}, not {given!r}; write for example {_EXAMPLES.get(key, wanted)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}, not {given!r}"


def _keys(location: Sequence[int | str]) -> list[str]:
    """The keys that the table at `location` takes."""
    table: Any = SensorTables
    for part in location:
        if isinstance(part, str):
            table = _table_of(table, part)
    return [field.name for field in dataclasses.fields(table)]


def _table_of(table: type[Any], key: str) -> type[Any]:
    if key in ("layer", "material"):
        return LayerTable if key == "layer" else MaterialTable
    hint = typing.get_type_hints(table)[key]
    return next((option for option in typing.get_args(hint) if dataclasses.is_dataclass(option)), hint)  # type: ignore[return-value]
