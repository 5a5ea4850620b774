"""The command `softcover datasheet`, which prints the data sheet of a sensor."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.data_sheet import DataSheet
    from validation.sensor_comparison import Compared


def datasheet(
    sensor: options.Sensor,
    *,
    compare: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative=())] = (),
    cover: options.CoverChanges = options.UNCHANGED,
    out: options.File | None = None,
    json: options.Json = False,
) -> None:
    """Print the data sheet of a sensor: each quantity with its definition and where it comes from, or `not stated`.

    Examples of use:

        softcover datasheet wts-0614-34
        softcover datasheet sensor.toml --out sensor.md
        softcover datasheet derived --json
        softcover datasheet wts-0614-34 --compare pr2-fingertip takkstrip
        softcover datasheet wts-0614-34 --compare all

    Args:
        compare: Print the sensor beside these, by what is published of each and where; all: every built-in sensor.
        out: Also write the data sheet to this file, .md or .html.
    """
    from validation import api
    from validation.sensor_comparison import put_side_by_side

    if compare:
        options.refuse_with(
            "--compare", {"--out": out, **{f"--{name}": given or None for name, given in vars(cover).items()}}
        )
        _print_comparison(put_side_by_side((sensor, *compare)), json=json)
        return
    found = options.read_sensor(sensor, cover)
    with output.Progress() as progress:
        sheet = api.datasheet(found, out=out, progress=progress)
    output.print_json(sheet.as_json()) if json else _print(sheet)
    if out is not None:
        output.say(f"wrote {out}")


def _print_comparison(compared: Sequence[Compared], *, json: bool) -> None:
    if json:
        output.print_json({"sensors": [dataclasses.asdict(each) for each in compared]})
        return
    rows = [(each.name, *each.cells) for each in compared]
    output.print_table(("sensor", *compared[0].values), rows, title="Sensors side by side", left=7)
    output.show_wrapped("Counts and images follow from assumed ranges and bits, forces on texels do not.")
    for each in compared:
        output.show_wrapped(f"{each.name}: {each.origins}.", further="    ")


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
