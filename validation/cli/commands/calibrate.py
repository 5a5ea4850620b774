"""The command `softcover calibrate`, which fits the electronics of a real sensor to recordings under known loads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.options import ArrayIndex, Json, check_array_index, read_time_span
from validation.cli.output import print_json, print_table, say, show
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration

_Files = Annotated[list[Path], Parameter(help="Recordings under known loads (labels, or a `force` channel).")]
_Indenter = Annotated[str, Parameter(help="Flat tool that pressed; as the recordings' labels say when not given.")]
_At = Annotated[
    str | None,
    Parameter(
        help="Position of the tool's axis in the array's frame; the middle of the image when not given.",
        allow_leading_hyphen=True,
    ),
]
_Threshold = Annotated[
    float | None, Parameter(help="Counts that the firmware subtracts; as the labels say when not given.")
]
_Window = Annotated[str, Parameter(help="Average the frames between these times after loading, from:to [s].")]
_Sensor = Annotated[Path | None, Parameter(help="Sensor file to copy to --out with new [electronics].")]
_Out = Annotated[Path | None, Parameter(help="Sensor file to write.")]
_Polynomial = Annotated[bool, Parameter(help="Write the characteristic of degree 5 instead of the line.")]


def calibrate(
    recordings: _Files,
    *,
    indenter: _Indenter = "",
    at: _At = None,
    array: ArrayIndex = 0,
    threshold: _Threshold = None,
    window: _Window = "6:9",
    sensor: _Sensor = None,
    out: _Out = None,
    polynomial: _Polynomial = False,
    json: Json = False,
) -> None:
    """Fit characteristic, gains, saturation, noise, drift and hysteresis to recordings under known loads.

    Each value is printed with its confidence interval.

    Examples of use:

        softcover calibrate 200g.mcap 400g.mcap 600g.mcap 800g.mcap
        softcover calibrate *.mcap --array 1 --threshold 100 --sensor sensor.toml --out calibrated.toml
    """
    from validation.calibration.calibrate import calibrate as fit
    from validation.calibration.calibrate import find_pressed_position, flat_shares
    from validation.calibration.write_sensor import write_sensor
    from validation.recordings.importing import open_recording
    from validation.text.indenter import read_indenter, read_position

    if (sensor is None) != (out is None):
        raise InputError("--sensor, --out: give both to write a sensor file, or neither")
    if out is not None and out.exists():
        raise InputError(f"--out: {out} exists; name a new file")
    span = read_time_span("--window", window, "6:9")
    opened = [open_recording(path) for path in recordings]
    for recording in opened:
        check_array_index(recording, array)
    shape = read_indenter(indenter or opened[0].setup.indenter, place="--indenter")
    position = find_pressed_position(opened, array) if at is None else read_position(at)
    shares = flat_shares(opened[0].arrays[array].texels, shape, at=position)
    found = fit(opened, shares=shares, array=array, threshold=threshold, window=span)
    if sensor is not None and out is not None:
        say(f"wrote {write_sensor(found, sensor, out, polynomial=polynomial)}")
    if json:
        print_json({**found.as_json(), "at_m": list(position)})
    else:
        _print(found, position)


def _print(found: Calibration, position: tuple[float, float]) -> None:
    rows = []
    for name, estimate in found.estimates.items():
        numbers = (f"{number:.4g}" for number in (estimate.value, estimate.low, estimate.high))
        rows.append((name.replace("_", " "), *numbers, estimate.unit, estimate.fitted_on))
    sensitivity, offset = found.report_line
    rows.append(("report's line", f"{sensitivity:g} F {offset:+g}", "", "", "counts", "2015 report, WTS 0614-34"))
    headings = ("", "value", "from", "to", "unit", "fitted on")
    print_table(headings, rows, title=f"Calibration, {found.confidence:.0%} intervals", left=len(headings))
    line = f"residual of the line {found.line.residual:.1f} counts"
    if found.polynomial is not None:
        line += f", of degree 5 {found.polynomial.residual:.1f} counts"
    show(line)
    show(
        f"assumed: uniform pressure under the tool at {1e3 * position[0]:.2f} mm, {1e3 * position[1]:.2f} mm; "
        f"an error there goes into the gains of the {len(found.texels)} texels"
    )
