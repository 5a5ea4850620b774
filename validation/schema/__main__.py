"""Write a JSON Schema of each file format into a folder: `python -m validation.schema FOLDER`.

Editors with support for JSON Schema complete keys and show their meaning.  The schemas use draft 4, which the language
server Taplo for TOML supports.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from validation.schema import Table
from validation.schema.baseline import BaselineTables
from validation.schema.campaign import CampaignTables
from validation.schema.data_set import DataSetTables
from validation.schema.measured_force import Measurement
from validation.schema.sensor import SensorTables
from validation.schema.sweep import SweepTables

#: Class of the tables of each file format, by name of the file with its JSON Schema.
FORMATS: Mapping[str, type[Table]] = {
    "sensor": SensorTables,
    "campaign": CampaignTables,
    "sweep": SweepTables,
    "data-set": DataSetTables,
    "measured-force": Measurement,
    "baseline": BaselineTables,
}
_ENTRY = re.compile(r"^    (?:    )?(\w+): (.+?)(?=^    (?:    )?\w+: |\Z)", re.MULTILINE | re.DOTALL)


class _Generator(GenerateJsonSchema):
    """Generator of a JSON Schema of the file in its written form.

    Optional keys can be left out but are never null.  Defaults in SI units are dropped if the file has text with a
    unit.
    """

    def nullable_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401 -- a schema of pydantic
        """Return the JSON Schema of an optional value without null, because a file leaves out the key instead."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401 -- a schema of pydantic
        """Return the JSON Schema of a value with a default; a default in SI units is dropped if the file holds text."""
        found = super().default_schema(schema)
        default = found.get("default")
        is_plain = isinstance(default, str | bool | int) or (isinstance(default, float) and "type" in found)
        if not is_plain or (found.get("type") == "string" and not isinstance(default, str)):
            found.pop("default", None)
        return found


def make_json_schema(table: type[Table]) -> dict[str, Any]:
    """Return the JSON Schema of a format, with the meaning of each key from the docstrings of its tables."""
    found = table.model_json_schema(ref_template="#/definitions/{model}", schema_generator=_Generator)
    found["definitions"] = found.pop("$defs", {})
    classes = {each.__name__: each for each in _list_tables(Table)}
    for part in (found, *found["definitions"].values()):
        bases = classes[part["title"]].__mro__[1:] if part.get("title") in classes else ()
        _describe(part, [base.__doc__ for base in bases if issubclass(base, Table) and base.__doc__])
    return {"$schema": "http://json-schema.org/draft-04/schema#", **found}


def _list_tables(table: type[Table]) -> Iterator[type[Table]]:
    for each in table.__subclasses__():
        yield each
        yield from _list_tables(each)


def _describe(part: dict[str, Any], inherited: Sequence[str]) -> None:
    """Move the lines of docstrings about keys to the keys, and drop titles, because they repeat names.

    Args:
        part: JSON Schema of a table, whose description is the docstring of its class.
        inherited: Docstrings of the base classes of that class.
    """
    text, _, attributes = part.get("description", "").partition("\n\nAttributes:\n")
    part.pop("title", None)
    if text:
        part["description"] = " ".join(text.split("\n\n")[0].split())
    listed = [*(base.partition("Attributes:\n")[2].replace("\n        ", "\n    ") for base in inherited), attributes]
    entries = {name: " ".join(about.split()) for lines in listed for name, about in _ENTRY.findall(lines)}
    for name, value in part.get("properties", {}).items():
        value.pop("title", None)
        about = [entries.get(name, ""), value.get("description", "")]
        if "$ref" in value:
            part["properties"][name] = {"allOf": [{"$ref": value.pop("$ref")}], **value}
        if about[0] or about[1]:
            part["properties"][name]["description"] = " ".join(filter(None, (about[0], about[1] and f"({about[1]})")))


def write_json_schemas(folder: Path) -> list[Path]:
    """Write the JSON Schema of each format into a folder, and return the paths of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, table in FORMATS.items():
        paths.append(folder / f"{name}.json")
        paths[-1].write_text(json.dumps(make_json_schema(table), indent=1) + "\n", encoding="utf-8")
    return paths


if __name__ == "__main__":
    if len(sys.argv) != 2:  # noqa: PLR2004 -- the program and the folder
        sys.exit("usage: python -m validation.schema FOLDER")
    for path in write_json_schemas(Path(sys.argv[1])):
        sys.stdout.write(f"{path}\n")
