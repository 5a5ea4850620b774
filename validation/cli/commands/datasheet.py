"""The command `softcover datasheet`, which prints the data sheet of a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.data_sheet import DataSheet


def datasheet(
    sensor: options.Sensor,
    *,
    cover: options.CoverChanges = options.UNCHANGED,
    out: options.File | None = None,
    json: options.Json = False,
) -> None:
    """Print the data sheet of a sensor: each quantity with its definition and where it comes from, or `not stated`.

    Examples of use:

        softcover datasheet wts-0614-34
        softcover datasheet sensor.toml --out sensor.md
        softcover datasheet derived --json

    Args:
        out: Also write the data sheet to this file, .md or .html.
    """
    from validation import api

    found = options.read_sensor(sensor, cover)
    with output.Progress() as progress:
        sheet = api.datasheet(found, out=out, progress=progress)
    output.print_json(sheet.as_json()) if json else _print(sheet)
    if out is not None:
        output.say(f"wrote {out}")


def _print(sheet: DataSheet) -> None:
    output.print_table((), [(entry.name, entry.text) for entry in sheet.entries], title=sheet.title)
    for entry in sheet.entries:
        output.show_wrapped(f"{entry.name}: {entry.definition}. From: {entry.source}.", further="    ")
    if missing := [entry.name for entry in sheet.entries if not entry.is_stated]:
        verdict = (
            f"Not stated: {', '.join(missing)}. Recordings of the real sensor under known loads give most of these: "
            "`softcover record`, then `softcover calibrate ... --sensor FILE --out FILE`."
        )
        output.print_meaning([verdict])
