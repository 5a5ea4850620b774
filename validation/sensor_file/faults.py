"""Error messages for the faults of a sensor file: the place in the file, what is wrong, and what would be accepted."""

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

#: Example of accepted text for each key that may be missing or have a value of the wrong type.
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
    "series": "the table [[series]]",
    "name": 'name = "room"',
    "path": 'path = "press1.csv"',
    "fit": 'fit = ["room"]',
    "score": 'score = ["warm"]',
    "indenter": 'indenter = "sphere:radius=7.5mm"',
    "point": "the tables [[point]]",
    "depth": 'depth = "0.5 mm"',
    "force": 'force = "1.65 N"',
    "use": 'use = "fit"',
}

#: Largest number of faults that are listed; a list of wrong numbers would fill the terminal [-].
_MOST_FAULTS = 20
#: Largest number of characters of a value that a message repeats, and of a whole message [-].
_LONGEST, _LONGEST_LINE = 80, 1000
#: Keys of a sensor file, by the symbols that users write by mistake.
KEYS_BY_SYMBOL = {"nu": "poisson_ratio", "E": "youngs_modulus", "G": "shear_modulus", "h": "thickness"}


def list_faults(error: ValidationError, tables: type[Any] = SensorTables) -> list[str]:
    """Return one line of text per fault that pydantic found in a file.

    Args:
        error: The faults.
        tables: Dataclass of all tables of the file; those of a sensor file when not given.
    """
    # Pydantic reports a value that fits no member of a union once per member, with the same path: keep the first one.
    lines: dict[str, str] = {}
    for details in error.errors():
        place = format_path(details["loc"])
        line = f"{place}: {_explain(details, tables)}"
        lines.setdefault(place, line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}...")
    listed = list(lines.values())
    return listed if len(listed) <= _MOST_FAULTS else [*listed[:_MOST_FAULTS], f"and {len(listed) - _MOST_FAULTS} more"]


def format_path(location: Sequence[int | str]) -> str:
    """Format a location in a sensor file as text, such as `cover.layer[0].thickness`.

    Args:
        location: Keys of tables and indices of lists, from the outermost.
    """
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif "[" not in part:  # pydantic adds names of its own, with a bracket, for the members of a union
            text += f".{part}" if text else part
    return text


def _explain(details: ErrorDetails, tables: type[Any]) -> str:
    """Describe one fault that pydantic found, and name accepted values."""
    kind, given = details["type"], _shorten(details["input"])
    key = str(details["loc"][-1])
    if kind == "value_error":
        return str(details["ctx"]["error"])
    if kind == "unexpected_keyword_argument":
        return f"unknown key; {nearest(KEYS_BY_SYMBOL.get(key, key), _keys_of_table(details['loc'][:-1], tables))}"
    if kind == "missing":
        return f"is missing; write for example {_EXAMPLES.get(key, key)}"
    if kind in ("dataclass_type", "list_type"):
        wanted = "a list" if kind == "list_type" else "a table"
        return f"must be {wanted}, not {given}; write for example {_EXAMPLES.get(key, wanted)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}, not {given}"


def _shorten(value: object) -> str:
    """Return a value of a sensor file as text for a message, cut if it is long."""
    text = repr(value) if isinstance(value, str | int | float | bool | None) else f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _keys_of_table(location: Sequence[int | str], tables: type[Any]) -> list[str]:
    """List the keys that are accepted in the table at a location of a file with the given tables."""
    table: Any = tables
    for key in location:
        if key in ("layer", "material"):
            table = LayerTable if key == "layer" else MaterialTable
        elif isinstance(key, str):
            hint = typing.get_type_hints(table)[key]
            table = next((option for option in typing.get_args(hint) if dataclasses.is_dataclass(option)), hint)
    return [field.name for field in dataclasses.fields(table)]
