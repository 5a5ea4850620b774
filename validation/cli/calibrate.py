"""`softcover calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.options import Json
from validation.cli.output import print_json, say
from validation.errors import InputError
from validation.text.indenter import read_indenter, read_position

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration

_Files = Annotated[list[Path], Parameter(help="Recordings under known loads (labels, or a `force` channel).")]
_Indenter = Annotated[str, Parameter(help="Flat tool that pressed; the one in the recordings' labels when not given.")]
_At = Annotated[
    str | None,
    Parameter(help="Its axis in the array's frame; the image's middle when not given.", allow_leading_hyphen=True),
]
_Array = Annotated[int, Parameter(help="Which array of the recordings.")]
_Threshold = Annotated[float | None, Parameter(help="Counts the firmware subtracts; as the labels say when not given.")]
_Window = Annotated[str, Parameter(help="Ages of the load between which frames are averaged, from:to [s].")]
_Sensor = Annotated[Path | None, Parameter(help="Sensor file whose [electronics] are replaced in --out.")]
_Out = Annotated[Path | None, Parameter(help="Sensor file to write.")]
_Polynomial = Annotated[bool, Parameter(help="Write the characteristic of degree 5 instead of the line.")]


def calibrate(
    recordings: _Files,
    *,
    indenter: _Indenter = "",
    at: _At = None,
    array: _Array = 0,
    threshold: _Threshold = None,
    window: _Window = "6:9",
    sensor: _Sensor = None,
    out: _Out = None,
    polynomial: _Polynomial = False,
    json: Json = False,
) -> None:
    """Characteristic, gains, saturation, noise, drift and hysteresis from recordings under known loads."""
    from validation.calibration.calibrate import calibrate as fit
    from validation.calibration.calibrate import flat_shares, middle
    from validation.calibration.write_sensor import as_json, write_sensor
    from validation.recordings.importing import open_recording

    if (sensor is None) != (out is None):
        raise InputError("--sensor, --out: give both to write a sensor file, or neither")
    opened = [open_recording(path) for path in recordings]
    if any(not 0 <= array < len(each.arrays) for each in opened):
        raise InputError(f"--array: not every recording has an array {array}")
    shape = read_indenter(indenter or opened[0].setup.indenter, place="--indenter")
    texels = opened[0].arrays[array].texels
    place = middle(opened, array) if at is None else read_position(at)
    shares = flat_shares(texels, shape, at=place)
    found = fit(opened, shares=shares, array=array, threshold=threshold, window=_ages(window))
    if sensor is not None and out is not None:
        say(f"wrote {write_sensor(found, sensor, out, polynomial=polynomial)}")
    if json:
        print_json({**as_json(found), "at_m": list(place)})
    else:
        _print(found, place)


def _ages(text: str) -> tuple[float, float]:
    start, _, end = text.partition(":")
    try:
        ages = (float(start), float(end))
    except ValueError as error:
        raise InputError(f"--window: {text!r} is no time from:to in seconds; for example 6:9") from error
    if not 0 <= ages[0] < ages[1]:
        raise InputError(f"--window: {text!r} must run from an earlier to a later time; for example 6:9")
    return ages


def _print(found: Calibration, place: tuple[float, float]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"Calibration, {found.confidence:.0%} intervals")
    for heading in ("", "value", "from", "to", "unit", "fitted on"):
        table.add_column(heading)
    for name, estimate in found.estimates.items():
        numbers = (f"{number:.4g}" for number in (estimate.value, estimate.low, estimate.high))
        table.add_row(name.replace("_", " "), *numbers, estimate.unit, estimate.fitted_on)
    sensitivity, offset = found.report_line
    table.add_row("report's line", f"{sensitivity:g} F {offset:+g}", "", "", "counts", "2015 report, WTS 0614-34")
    console = Console()
    console.print(table)
    line = f"residual of the line {found.line.residual:.1f} counts"
    if found.polynomial is not None:
        line += f", of degree 5 {found.polynomial.residual:.1f} counts"
    console.print(line)
    console.print(
        f"assumed: uniform pressure under the tool at {1e3 * place[0]:.2f} mm, {1e3 * place[1]:.2f} mm; "
        f"an error there goes into the gains of the {len(found.texels)} texels"
    )
