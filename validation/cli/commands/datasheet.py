"""The command `softcover datasheet`, which prints the data sheet of a sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.meaning import print_meaning
from validation.cli.options import Json, Layers, MaterialName, Sensor, Thickness
from validation.cli.output import print_json, print_table, say, show_wrapped
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from validation.data_sheet import Entry

_Out = Annotated[Path | None, Parameter(help="Also write the data sheet to this file, .md or .html.")]


def datasheet(
    sensor: Sensor,
    *,
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    out: _Out = None,
    json: Json = False,
) -> None:
    """Print the data sheet of a sensor: each quantity with its definition and where it comes from, or `not stated`.

    Examples of use:

        softcover datasheet wts-0614-34
        softcover datasheet sensor.toml --out sensor.md
        softcover datasheet derived --json
    """
    from validation.cli.sensors import find_parameters, read_sensor
    from validation.data_sheet import as_html, as_json, as_markdown, make_datasheet
    from validation.output_folder import write_text
    from validation.sensor_file import SensorDescription

    writers = {".md": as_markdown, ".html": as_html}
    if out is not None and out.suffix not in writers:
        raise InputError(f"--out: {out} is neither .md nor .html; write for example --out sensor.md")
    if out is not None and out.exists():
        raise InputError(f"--out: {out} exists; name a new file")
    found = read_sensor(sensor, material=material, thickness=thickness, layers=layer)
    with Progress() as progress:
        parameters = find_parameters(found, progress)
    description = found if isinstance(found, SensorDescription) else None
    name = parameters.array.name if description is None else description.name
    entries = make_datasheet(parameters, description)
    if out is not None:
        write_text(out, writers[out.suffix](entries, name))
    if json:
        print_json({"sensor": name, "entries": as_json(entries)})
    else:
        _print(entries, name)
    if out is not None:
        say(f"wrote {out}")


def _print(entries: Sequence[Entry], name: str) -> None:
    print_table(None, [(entry.name, entry.text) for entry in entries], title=f"Data sheet: {name}", left=2)
    for entry in entries:
        show_wrapped(f"{entry.name}: {entry.definition}. From: {entry.source}.", further="    ")
    missing = [entry.name for entry in entries if not entry.is_stated]
    if missing:
        verdict = (
            f"Not stated: {', '.join(missing)}. Recordings of the real sensor under known loads give most of these: "
            "`softcover record`, then `softcover calibrate ... --sensor FILE --out FILE`."
        )
        print_meaning([verdict])
