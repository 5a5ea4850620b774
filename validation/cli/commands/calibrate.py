"""The command `softcover calibrate`, which fits the electronics of a real sensor to recordings under known loads."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration
    from validation.calibration.point_load import PointLoadCalibration
    from validation.calibration.step_response import StepResponse

#: Built-in sensor whose published line is printed beside the fitted one.
_PUBLISHED = "wts-0614-34"


def calibrate(
    recordings: list[Path],
    *,
    sensor: Annotated[str, Parameter(metavar="SENSOR")],
    indenter: Annotated[str, Parameter(metavar="INDENTER")] = "",
    at: options.Place | None = None,
    yaw: options.Angle | None = None,
    moved: bool = False,
    method: Annotated[str, Parameter(metavar="METHOD")] = "default",
    array: options.PressedArrayIndex = None,
    threshold: Annotated[float | None, Parameter(metavar="COUNTS")] = None,
    window: options.Span = "6s:9s",
    temperature_channel: options.Index = -1,
    heights: bool = False,
    profile_thickness: bool = False,
    tip: options.Length | None = None,
    texel: options.Index | None = None,
    step: options.Time | None = None,
    out: options.File | None = None,
    picture: options.File | None = None,
    polynomial: bool = False,
    json: options.Json = False,
) -> None:
    """Fit characteristic, gains, pose, saturation, noise and creep to recordings under known loads.

    Each value is printed with its confidence interval.

    Examples of use:

        softcover calibrate 200g.mcap 400g.mcap 600g.mcap 800g.mcap --sensor sensor.toml
        softcover calibrate data-set.toml --sensor sensor.toml --out calibrated.toml --picture left-out.png
        softcover calibrate trial*.mcap --sensor wts-0614-34 --tip 1mm --texel 39
        softcover calibrate dropped.mcap --sensor sensor.toml --step 1.204s

    Args:
        recordings: Recordings under known loads, or one data-set file.
        sensor: Sensor file or built-in sensor; its cover gives the share of each texel.
        indenter: Tool that pressed; as the recordings' labels say when not given.
        at: Position of the tool's axis in the array's frame, e.g. 1mm,-2mm; fitted when not given.
        yaw: Yaw of the tool, e.g. 30deg; fitted when neither it nor --at is given.
        moved: The tool was put down anew for each recording: fit a pose to each.
        method: Contact method: default (finite elements where they apply), cover, foundation, boxes or reference.
        threshold: Counts that the firmware subtracts; as the labels say when not given.
        window: Average the frames between these times after loading.
        temperature_channel: Index of the temperature sensor, negative from the last.
        heights: Fit a seating height to each texel.
        profile_thickness: Examine the thickness of the cover by fits on thinner and thicker covers (about a minute).
        tip: Radius of a rounded tip, e.g. 1mm: fit the slope of one texel per trial.
        texel: Index of the texel under the tip, from 0, row by row.
        step: Instant of a step of the load in one recording: fit the sensor's filter to it, and nothing else.
        out: Sensor file to write: a copy of --sensor with new [electronics].
        picture: Draw left-out recordings and their prediction, a .png file.
        polynomial: Write the characteristic of degree 5 instead of the line.
    """
    from validation import api
    from validation.calibration.calibrate import Calibration

    description, span = options.read_description(sensor), options.read_time_span("--window", window, "6s:9s")
    if step is not None:
        others = {"--out": out, "--picture": picture, "--tip": tip, "--texel": texel, "--indenter": indenter}
        options.refuse_with("--step", others | {"--at": at})
        _show_step(api.fit_filter(recordings, description, step, array=array), json=json)
        return
    with output.Progress() as progress:
        found = api.calibrate(
            recordings, description, indenter=indenter, at=at, yaw=yaw, moved=moved, method=method, array=array,
            threshold=threshold, window=span, temperature_channel=temperature_channel, heights=heights,
            profile_thickness=profile_thickness, tip=tip, texel=texel, out=out, picture=picture,
            polynomial=polynomial, progress=progress,
        )  # fmt: skip
    _tell_files(found, out, picture)
    if json:
        output.print_json(found.as_json())
    elif isinstance(found, Calibration):
        _show(found, sensor)
    else:
        _show_point(found)


def _tell_files(found: Calibration | PointLoadCalibration, *paths: Path | None) -> None:
    """Print what was left out, and the files that were written or not."""
    for line in found.left_out:
        output.say(f"softcover: {line}")
    for path in filter(None, paths):
        output.say(f"wrote {path}" if path.exists() else f"{path} is not written: too few recordings to leave some out")


def _show(found: Calibration, name: str) -> None:
    rows = [
        (
            f"{quantity.replace('_', ' ')} [{each.unit}]",
            f"{each.value:.4g}",
            f"{each.low:.4g} to {each.high:.4g}",
            each.fitted_on,
        )
        for quantity, each in found.estimates.items()
    ]
    headings = ("", "value", f"{found.confidence:.0%} interval", "fitted on")
    output.print_table(headings, rows, title=f"Calibration of {name}", left=len(headings), lines=False)
    if name == _PUBLISHED:
        line = found.report_line
        output.show(
            f"published line of this sensor (2015 report): {line['sensitivity']:g} counts/N, offset {line['offset']:g}"
        )
    for placement, pose in found.poses.items():
        x, y = (f"{1e3 * value:.2f} +- {1e3 * width:.2f} mm" for value, width in (pose["x_m"], pose["y_m"]))
        output.show(f"{placement}: x {x}, y {y}, yaw {math.degrees(pose['yaw_rad'][0]):.1f} deg")
    output.show(f"shares by {found.method}; residual {found.residual_rms_counts:.1f} counts")
    if found.hold_out is not None:
        output.show(f"left-out recordings: {found.hold_out}")
    for note in found.notes:
        output.show(f"- {note}")


def _show_step(found: StepResponse, *, json: bool) -> None:
    """Print the filter of a step, and what to write into a sensor file."""
    if json:
        output.print_json(found.as_json())
        return
    orders = ", ".join(map(str, found.orders))
    output.show(f"{found.frames} frames; noise {found.noise:.3g} counts on the sum; orders not excluded: {orders}")
    low, high = (1e3 * each for each in (found.delay.low, found.delay.high))
    output.show(
        f"delay besides the filter: {1e3 * found.delay.value:.3g} ms (95 % interval {low:.3g} to {high:.3g} ms)"
    )
    if found.reason:
        output.show(f"filter not identifiable: cut-off at least {found.cutoff.low:.3g} Hz; {found.reason}")
        return
    output.show(
        f"cut-off {found.cutoff.value:.4g} Hz (95 % interval {found.cutoff.low:.4g} to {found.cutoff.high:.4g} Hz)"
    )
    output.show(f'for the sensor file:\n\n[filter]\ncutoff = "{found.cutoff.value:.4g} Hz"\norder = {found.orders[0]}')


def _show_point(found: PointLoadCalibration) -> None:
    rows = [
        (
            each.name,
            f"{each.slope:.5g}",
            f"{each.slope / found.tip_share:.5g}",
            f"{each.offset:.4g}",
            "" if each.saturation_force is None else f"{each.saturation_force:.4g}",
        )
        for each in found.trials
    ]
    headings = ("trial", "counts/N applied", "counts/N on the texel", "offset [counts]", "saturates at [N]")
    output.print_table(
        headings, rows, title=f"Texel {found.texel} under a tip of {1e3 * found.tip_radius:g} mm", left=1
    )
    output.show(
        f"the texel measures {found.tip_share:.4f} of the applied force (finite elements; {found.tip_share_light:.4f} "
        f"under light loads, {found.tip_share_heavy:.4f} at {found.largest_load:.3g} N)"
    )
    for name, estimate in found.estimates.items():
        output.show(f"{name.replace('_', ' ')}: {estimate}")
