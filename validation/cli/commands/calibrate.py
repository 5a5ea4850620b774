"""The command `softcover calibrate`, which fits the electronics of a real sensor to recordings under known loads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration
    from validation.calibration.point_load import PointLoadCalibration
    from validation.calibration.step_response import StepResponse
    from validation.sensor_file import SensorDescription

#: Built-in sensor whose published line is printed beside the fitted one.
_PUBLISHED = "wts-0614-34"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NextTouches:
    """Options that plan touches: `--next` and those that need it."""

    next: Annotated[
        int | None,
        Parameter(metavar="NUMBER", help="Plan this number of touches, after the recordings if there are any."),
    ] = None
    load: Annotated[options.Force | None, Parameter(help="Force of each planned touch; 1N if not given.")] = None
    radius: Annotated[
        options.Length | None, Parameter(help="Radius of the circle that the tool loads, e.g. 2mm; 1mm if not given.")
    ] = None
    noise: Annotated[
        options.Force | None,
        Parameter(help="Standard deviation of the noise of a texel's force; that of the sensor, or one count."),
    ] = None
    place_error: Annotated[
        options.Length | None, Parameter(help="Standard deviation of each place per axis; 0.1mm if not given.")
    ] = None
    shift_error: Annotated[
        options.Length | None, Parameter(help="Standard deviation of the shift of all places; 0.3mm if not given.")
    ] = None
    force_error: Annotated[
        float | None,
        Parameter(metavar="RATIO", help="Relative standard deviation of each force; 0.01 if not given."),
    ] = None
    want: Annotated[
        str | None,
        Parameter(metavar="NAMES", help="What to settle: gains,thickness if not given; poisson."),
    ] = None
    plan: Annotated[
        options.Folder | None, Parameter(help="Write table, protocol, path for a printer (G-code) and picture.")
    ] = None


#: No touches are planned.
_NO_PLAN = NextTouches()


def calibrate(
    recordings: list[Path] | None = None,
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
    planned: NextTouches = _NO_PLAN,
    json: options.Json = False,
) -> None:
    """Fit characteristic, gains, pose, saturation, noise and creep to recordings under known loads, or plan touches.

    Each value is printed with its confidence interval. --next plans the touches that settle gains and cover best, with
    the intervals that they will give, before anything is measured or after the recordings.

    Examples of use:

        softcover calibrate 200g.mcap 400g.mcap 600g.mcap 800g.mcap --sensor sensor.toml
        softcover calibrate data-set.toml --sensor sensor.toml --out calibrated.toml --picture left-out.png
        softcover calibrate trial*.mcap --sensor wts-0614-34 --tip 1mm --texel 39
        softcover calibrate dropped.mcap --sensor sensor.toml --step 1.204s
        softcover calibrate --sensor wts-0614-34 --next 36 --noise 5mN --plan touches

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

    others: dict[str, Any] = {"--out": out, "--picture": picture, "--tip": tip, "--texel": texel, "--at": at}
    others["--indenter"] = indenter
    _check_plan(planned, {**others, "--step": step, "--yaw": yaw}, after=bool(recordings))
    if not recordings:
        _plan(planned, options.read_description(sensor, any_cover=True), None, json=json)
        return
    description, span = options.read_description(sensor), options.read_time_span("--window", window, "6s:9s")
    if step is not None:
        options.refuse_with("--step", others)
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
    _show_fit(found, sensor, planned, description, json=json)


def _show_fit(
    found: Calibration | PointLoadCalibration,
    sensor: str,
    planned: NextTouches,
    description: SensorDescription,
    *,
    json: bool,
) -> None:
    from validation.calibration.calibrate import Calibration

    if json and planned == _NO_PLAN:
        output.print_json(found.as_json())
    elif not isinstance(found, Calibration):
        _show_point(found)
    else:
        if not json:
            _show(found, sensor)
        if planned != _NO_PLAN:
            _plan(planned, description, found, json=json)


def _check_plan(planned: NextTouches, others: Mapping[str, Any], *, after: bool) -> None:
    """Check that touches can be planned with the other options, before anything is fitted.

    Raises:
        InputError: If they cannot.
    """
    if planned == _NO_PLAN:
        return
    if planned.next is None:
        raise InputError("--next NUMBER is missing, which the options of planned touches need")
    without = ("--tip", "--texel", "--step") if after else tuple(others)
    options.refuse_with("--next" + " without recordings" * (not after), {name: others[name] for name in without})


def _plan(planned: NextTouches, sensor: SensorDescription, after: Calibration | None, *, json: bool) -> None:
    """Plan touches, and print them and what they settle.

    Raises:
        InputError: If `--next` is missing, or an option cannot be used.
    """
    from validation.calibration.touch_protocol import next_touches

    given = {name: value for name, value in vars(planned).items() if value is not None}
    if planned.next is None:
        raise InputError("RECORDINGS: name recordings under known loads, or plan them with --next NUMBER")
    if "want" in given:
        given["want"] = tuple(filter(None, (each.strip() for each in given["want"].split(","))))
    with output.Progress() as progress:
        found = next_touches(
            sensor, given.pop("next"), after=after, out=given.pop("plan", None), progress=progress, **given
        )
    if planned.plan is not None:
        output.say(f"wrote {planned.plan}")
    if json:
        output.print_json(found.as_json())
        return
    rows = [
        (str(number), str(each.texel), *(f"{1e3 * value:.3f}" for value in each.at[:2]), f"{each.load:g}")
        for number, each in enumerate(found.touches, 1)
    ]
    headings = ("touch", "texel", "x [mm]", "y [mm]", "load [N]")
    output.print_table(headings, rows, title=f"Next touches of {found.sensor}", lines=False)
    output.print_table(
        ("", "before", "after"), list(found.list_expected()), title="Expected 95 % intervals", lines=False
    )
    output.print_meaning(found.explain())


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
