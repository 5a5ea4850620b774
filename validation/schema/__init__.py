"""One schema for all files that users write: tables in a declarative form, read with all faults listed.

Each format is a class derived from `Table`, in a module of its own. `read` reads a file, and `parse` checks parsed
tables.  Quantities with units become numbers in SI units.  Faults become one `InputError` with one line per fault: the
file, the place in it such as `cover.layer[2].thickness`, the fault, and what would be accepted.

`python -m validation.schema FOLDER` writes a JSON Schema of each format, which editors use to complete keys.
"""

from __future__ import annotations

import json
import re
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from meshes.bounded_file import FileLimitError, parse_json, parse_toml, read_text
from validation.errors import InputError, nearest, shorten

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo
    from pydantic_core import ErrorDetails

#: Largest number of faults of a file that are listed [-].  A long list of wrong numbers would fill the terminal.
_MOST_FAULTS = 20
#: Largest number of characters of an error message about one fault [-].
_LONGEST_LINE = 1000
#: Keys of a file by the symbols that users write instead of them by mistake.
_KEYS_BY_SYMBOL = {"nu": "poisson_ratio", "E": "youngs_modulus", "G": "shear_modulus", "h": "thickness"}
_BARE_KEY = re.compile(r"[A-Za-z0-9_\-]+")


class Table(BaseModel):
    """A table of a file; unknown keys are faults.

    Attributes:
        MOST_BYTES: Largest accepted size of a file that holds the table [bytes].
        IS_JSON: Whether the file is in JSON; otherwise it is in TOML.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    MOST_BYTES: ClassVar[int] = 2**20
    IS_JSON: ClassVar[bool] = False

    def list_faults(self) -> Iterable[tuple[str, str]]:
        """List the faults that concern several keys of this table.

        Returns:
            One pair per fault: the key at which it is reported, or an empty text for the whole table, and a sentence
            that states the fault.
        """
        return ()


T = TypeVar("T", bound=Table)


def read(path: Path, schema: type[T], *, hint: str = "") -> T:
    """Read a file in TOML or JSON.

    Args:
        path: Path of the file.
        schema: Tables of the file's format.
        hint: Other accepted names, for the message that the file does not exist.

    Raises:
        InputError: If the file does not exist, exceeds the limits on size and depth, or has faults; one line per fault.
        OSError: If the file exists and cannot be read.
    """
    return parse(read_raw(path, schema, hint=hint), schema, source=str(path))


def read_raw(path: Path, schema: type[Table], *, hint: str = "") -> dict[str, Any]:
    """Read a file as `read` does, but return its content without a check of keys and values."""
    if not path.exists():
        raise InputError(f"{path}: no such file{hint and f' {hint}'}")
    try:
        text = read_text(path, most=schema.MOST_BYTES)
        data = parse_json(text) if schema.IS_JSON else parse_toml(text)
    except FileLimitError as error:
        kind = "JSON" if schema.IS_JSON else "TOML"
        raise InputError(f"{path}: not a {kind} file that is accepted: {error}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: must hold a table, not {shorten(data)}")
    return data


def parse(data: object, schema: type[T], *, source: str = "", place: Sequence[int | str] = ()) -> T:
    """Check the tables of a file and convert their values.

    Args:
        data: Content of the file, as returned by the parser of TOML or JSON.
        schema: The tables of the format.
        source: Name of the file, with which every line about a fault begins.
        place: Place of the tables in the file: keys and indices, from the outermost.

    Raises:
        InputError: With one line per fault.
    """
    start = f"{source}: " if source else ""
    try:
        tables = schema.model_validate(data)
    except ValidationError as error:
        raise InputError(*(f"{start}{line}" for line in _list_faults(error, schema, place))) from None
    if faults := [f"{start}{line}" for line in _list_own_faults(tables, format_place(place))]:
        raise InputError(*faults)
    return tables


def format_place(place: Sequence[int | str]) -> str:
    """Format a place in a file as text, such as `cover.layer[0].thickness`.

    Args:
        place: Keys of tables and indices of lists, from the outermost.
    """
    text = ""
    for part in place:
        if isinstance(part, int):
            text += f"[{part}]"
        elif "[" not in part:  # A name with a bracket is no key, but that of a member of a union.
            key = part if _BARE_KEY.fullmatch(part) else json.dumps(part)
            text += f".{key}" if text else key
    return text


def _list_own_faults(table: Table, place: str) -> Iterator[str]:
    """Yield one line for each fault that concerns several keys, in a table and its subtables.

    Args:
        table: The table.
        place: Place of the table in the file.
    """
    for key, text in table.list_faults():
        where = ".".join(filter(None, (place, key)))
        yield f"{where}: {text}" if where else text
    for name in type(table).model_fields:
        value = getattr(table, name)
        inner = f"{place}.{name}" if place else name
        if isinstance(value, Table):
            yield from _list_own_faults(value, inner)
        elif isinstance(value, list | tuple):
            for number, item in enumerate(value):
                if isinstance(item, Table):
                    yield from _list_own_faults(item, f"{inner}[{number}]")


def _list_faults(error: ValidationError, schema: type[Table], place: Sequence[int | str]) -> list[str]:
    """Return one line for each fault that pydantic found in a file, each once, in the order of the file."""
    lines: dict[str, None] = {}
    found = error.errors(include_url=False)
    for details in found:
        if details["type"] == "too_short" and any(details["loc"] == each["loc"][:-1] for each in found):
            continue  # pydantic calls a list too short if its entries have faults.
        where = format_place([*place, *details["loc"]])
        for text in _explain(details, schema):
            line = f"{where}: {text}" if where else text
            lines.setdefault(line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}...")
    listed = list(lines)
    return listed if len(listed) <= _MOST_FAULTS else [*listed[:_MOST_FAULTS], f"and {len(listed) - _MOST_FAULTS} more"]


def _explain(details: ErrorDetails, schema: type[Table]) -> tuple[str, ...]:
    """Describe one fault that pydantic found in a file, and name accepted values.

    The result has several lines if one text in the file has several faults.
    """
    kind, given, place = details["type"], shorten(details["input"]), details["loc"]
    key = str(place[-1]) if place else ""
    if kind == "value_error":
        raised = details["ctx"]["error"]
        return raised.faults if isinstance(raised, InputError) else (str(raised),)
    if kind == "extra_forbidden":
        return (f"unknown key; {nearest(_KEYS_BY_SYMBOL.get(key, key), _follow(schema, place[:-1]).model_fields)}",)
    fields = _follow(schema, place[:-1]).model_fields
    example = _show_example(place, fields[key]) if key in fields else ""
    remedy = example and f"; write for example {example}"
    if kind == "missing":
        return (f"is missing{remedy}",)
    if kind in ("too_short", "too_long"):
        limits = details["ctx"]
        wanted = f"at most {limits['max_length']}" if "max_length" in limits else f"at least {limits['min_length']}"
        return (f"must have {wanted} entries, not {limits['actual_length']}{remedy}",)
    if kind in ("model_type", "model_attributes_type", "dict_type", "list_type", "tuple_type", "string_type"):
        wanted = {"list_type": "a list", "tuple_type": "a list", "string_type": "a text"}.get(kind, "a table")
        return (f"must be {wanted}, not {given}{remedy}",)
    return (f"{details['msg'][0].lower()}{details['msg'][1:]}, not {given}{remedy}",)


def _show_example(place: Sequence[int | str], field: FieldInfo) -> str:
    """Return an accepted line of TOML for the key at a place; empty if its field has no example."""
    if field.examples and isinstance(example := field.examples[0], dict):
        entries = ", ".join(f"{json.dumps(key)} = {json.dumps(each)}" for key, each in example.items())
        return f"{place[-1]} = {{ {entries} }}"
    if field.examples:
        return f"{place[-1]} = {json.dumps(field.examples[0])}"
    if not any(_find_tables(field.annotation, field.metadata)):
        return ""
    name = format_place([part for part in place if isinstance(part, str)])
    return f"the tables [[{name}]]" if typing.get_origin(field.annotation) in (list, tuple) else f"the table [{name}]"


def _follow(schema: type[Table], place: Sequence[int | str]) -> type[Table]:
    """Return the class of the table at a place in a file.

    Args:
        schema: Class of the whole file.
        place: Keys and indices from the outermost table, and names `[Class]` of the chosen members of unions.  Indices
            and keys that the user chooses freely do not change the class.
    """
    found = schema
    tables: list[type[Table]] = []
    for part in place:
        if isinstance(part, str) and part in found.model_fields:
            field = found.model_fields[part]
            tables = list(_find_tables(field.annotation, field.metadata))
            found = tables[0] if tables else found
        elif isinstance(part, str) and part.startswith("["):
            found = next((table for table in tables if f"[{table.__name__}]" == part), found)
    return found


def _find_tables(annotation: Any, metadata: Sequence[Any] = ()) -> Iterator[type[Table]]:  # noqa: ANN401 -- a type
    """Yield the classes of tables in the type annotation of a field, starting with those that its metadata names."""
    for item in metadata:
        if (table := getattr(item, "table", None)) is not None:
            yield table
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in typing.get_args(annotation):
        if not isinstance(inner, Mapping):
            yield from _find_tables(inner, [inner] if hasattr(inner, "table") else ())
