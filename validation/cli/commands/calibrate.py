"""The command `softcover calibrate`, which fits the electronics of a real sensor to recordings under known loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.options import Json, PressedArrayIndex, check_choice, read_time_span
from validation.cli.output import print_json, print_table, say, show
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration
    from validation.calibration.contact import ContactMethod
    from validation.calibration.point_load import PointLoadCalibration
    from validation.data_sets.images import Image
    from validation.sensor_file import SensorDescription

#: Built-in sensor whose published line is printed beside the fitted one.
_PUBLISHED = "wts-0614-34"

_Files = Annotated[list[Path], Parameter(help="Recordings under known loads, or one data-set file.")]
_Sensor = Annotated[str, Parameter(help="Sensor file or built-in sensor; its cover gives the share of each texel.")]
_Indenter = Annotated[str, Parameter(help="Tool that pressed; as the recordings' labels say when not given.")]
_At = Annotated[
    str | None,
    Parameter(
        help="Position of the tool's axis in the array's frame; fitted when not given.", allow_leading_hyphen=True
    ),
]
_Yaw = Annotated[
    str | None,
    Parameter(help="Yaw of the tool; fitted when neither it nor --at is given.", allow_leading_hyphen=True),
]
_Moved = Annotated[bool, Parameter(help="The tool was put down anew for each recording: fit a pose to each.")]
_Method = Annotated[
    str,
    Parameter(
        help="Contact method: default (finite elements where they apply), cover, area, boxes, foundation or reference."
    ),
]
_Threshold = Annotated[
    float | None, Parameter(help="Counts that the firmware subtracts; as the labels say when not given.")
]
_Window = Annotated[str, Parameter(help="Average the frames between these times after loading, from:to [s].")]
_Channel = Annotated[int, Parameter(help="Index of the temperature sensor, negative from the last.")]
_Heights = Annotated[bool, Parameter(help="Fit a seating height to each texel.")]
_Tip = Annotated[str | None, Parameter(help="Radius of a rounded tip: fit the slope of one texel per trial.")]
_Texel = Annotated[int | None, Parameter(help="Index of the texel under the tip, from 0, row by row.")]
_Out = Annotated[Path | None, Parameter(help="Sensor file to write: a copy of --sensor with new [electronics].")]
_Picture = Annotated[Path | None, Parameter(help="Draw left-out recordings and their prediction, a .png file.")]
_Polynomial = Annotated[bool, Parameter(help="Write the characteristic of degree 5 instead of the line.")]


def calibrate(
    recordings: _Files,
    *,
    sensor: _Sensor,
    indenter: _Indenter = "",
    at: _At = None,
    yaw: _Yaw = None,
    moved: _Moved = False,
    method: _Method = "default",
    array: PressedArrayIndex = None,
    threshold: _Threshold = None,
    window: _Window = "6:9",
    temperature_channel: _Channel = -1,
    heights: _Heights = False,
    tip: _Tip = None,
    texel: _Texel = None,
    out: _Out = None,
    picture: _Picture = None,
    polynomial: _Polynomial = False,
    json: Json = False,
) -> None:
    """Fit characteristic, gains, pose, saturation, noise and creep to recordings under known loads.

    Each value is printed with its confidence interval.

    Examples of use:

        softcover calibrate 200g.mcap 400g.mcap 600g.mcap 800g.mcap --sensor sensor.toml
        softcover calibrate data-set.toml --sensor sensor.toml --out calibrated.toml --picture left-out.png
        softcover calibrate trial*.mcap --sensor wts-0614-34 --tip 1mm --texel 39
    """
    from validation.data_sets.from_files import Keys, describe_files

    _check_files(out, picture, sensor)
    _check_options(tip, texel, threshold)
    description = _read_sensor(sensor)
    _require_modules(recordings, sensor, method, tip, picture)
    keys = Keys(
        indenter=indenter or (f"tip:radius={tip}" if tip else ""),
        at=at,
        yaw=yaw,
        moved=moved,
        array=array,
        threshold=threshold,
        window=read_time_span("--window", window, "6:9"),
        temperature_channel=temperature_channel,
    )
    data_set = describe_files(recordings, keys, description.array)
    _require_modules([file.path for file in data_set.files], sensor, method, tip, picture)
    images = _read_images(data_set, description)
    if tip is not None and texel is not None:
        _calibrate_point(images, description, tip, texel, json=json)
        return
    found = _fit(images, _choose_method(description, method, images), heights=heights)
    if out is not None:
        _write(found, sensor, out, polynomial=polynomial)
    if picture is not None:
        _draw(found, description, picture)
    print_json(found.as_json()) if json else _print(found, description)


def _require_modules(paths: Sequence[Path], sensor: str, method: str, tip: str | None, picture: Path | None) -> None:
    """Check that the packages which read the recordings, solve the contact and draw are installed.

    Nothing is checked for a data-set file, until the recordings that it names are known.

    Raises:
        MissingExtraError: If one is missing.
    """
    from fastmodel import METHODS
    from validation.extras import require
    from validation.recordings.importing import list_modules
    from validation.sensor_file import BUILT_IN

    if any(path.suffix == ".toml" for path in paths):
        return
    needed = [*list_modules(paths), *(["matplotlib"] if picture else [])]
    if tip is None and sensor in BUILT_IN:
        # The fast model of a built-in sensor is stored; by default finite elements compute the contact.
        useful = () if method in METHODS else ("skfem",)
        require(*needed, useful=useful)
    else:
        require(*needed, "skfem")


def _fit(images: list[Image], method: ContactMethod, *, heights: bool) -> Calibration:
    from validation.calibration.calibrate import calibrate as fit
    from validation.data_sets.images import observe

    noise = [image.noise for image in images]
    full_scale = max(image.full_scale for image in images)
    return fit(observe(images), method, noise=noise, full_scale=full_scale, heights=heights)


def _check_files(out: Path | None, picture: Path | None, sensor: str) -> None:
    from validation.sensor_file import BUILT_IN

    for option, path in (("--out", out), ("--picture", picture)):
        if path is not None and path.exists():
            raise InputError(f"{option}: {path} exists; name a new file")
    if out is not None and sensor in BUILT_IN:
        raise InputError(f"--out: {sensor} is built in and has no file to copy; make one with `softcover init`")


def _check_options(tip: str | None, texel: int | None, threshold: float | None) -> None:
    if (tip is None) != (texel is None):
        raise InputError("--tip, --texel: give both to calibrate one texel with a rounded tip, or neither")
    if threshold is not None and threshold < 0:
        raise InputError(f"--threshold: must be 0 or more, not {threshold:g}")


def _read_sensor(sensor: str) -> SensorDescription:
    from validation.cli.sensors import read_description

    return read_description(sensor)


def _read_images(data_set: object, description: SensorDescription) -> list[Image]:
    """Read the recordings; a line is printed for each that cannot be used.

    Raises:
        InputError: If none can be used.
    """
    from validation.data_sets.data_set import DataSet
    from validation.data_sets.images import read_images

    if not isinstance(data_set, DataSet):
        raise TypeError("expected a data set")
    images, problems = read_images(data_set, description.array)
    lines = [*data_set.problems, *problems]
    images = [image for image in images if "fit" in image.file.uses]
    if not images:
        raise InputError(*lines, "no recording can be used")
    for line in lines:
        say(f"softcover: {line}")
    return images


def _choose_method(description: SensorDescription, method: str, images: list[Image]) -> ContactMethod:
    """Return the contact method of a name.

    The default is finite elements; for fitted tilts, a cover of finite size or a given spread, where they are slow or
    do not apply, it is the method `cover`, or `area` for a given spread.
    """
    from fastmodel import METHODS
    from validation.calibration.contact import REFERENCE, make_fast_method, make_reference_method
    from validation.cli.sensors import find_parameters
    from validation.extras import require
    from validation.sensor_file import BUILT_IN

    check_choice("--method", "contact method", method, ("default", *METHODS, REFERENCE))
    stored = description is BUILT_IN.get(description.name)
    level = all(image.file.placement.tilt is not None for image in images)
    solvable = description.spread is None and description.cover.size is None and level
    if method == REFERENCE or (method == "default" and solvable):
        require("skfem", otherwise="compute the contact by the fast model: --method cover" if stored else "")
        return make_reference_method(description.cover, description.array)
    with Progress() as progress:
        parameters = find_parameters(description, progress)
    if method == "default":
        method = "area" if parameters.cells is None else "cover"
    return make_fast_method(parameters, method)


def _calibrate_point(images: list[Image], sensor: SensorDescription, tip: str, texel: int, *, json: bool) -> None:
    from validation.calibration.point_load import calibrate_point_load
    from validation.data_sets.images import observe
    from validation.text.quantity import read_quantity

    # Recordings with a force channel are a trial each; recordings under single loads are one trial together.
    names = [image.file.name for image in images]
    ramped = len(set(names)) < len(names)
    trials = names if ramped else ["all recordings"] * len(names)
    radius = read_quantity(tip, "length", place="--tip")
    found = calibrate_point_load(observe(images), trials, sensor, radius=radius, texel=texel)
    if json:
        print_json(found.as_json())
        return
    _print_point(found)


def _print_point(found: PointLoadCalibration) -> None:
    rows = [
        (
            name,
            f"{slope:.5g}",
            f"{slope / found.share.share:.5g}",
            f"{offset:.4g}",
            "" if math.isnan(force) else f"{force:.4g}",
        )
        for name, slope, offset, force in zip(
            found.names,
            found.slopes.tolist(),
            found.offsets.tolist(),
            found.saturation_forces.tolist(),
            strict=True,
        )
    ]
    headings = ("trial", "counts/N applied", "counts/N on the texel", "offset [counts]", "saturates at [N]")
    print_table(headings, rows, title=f"Texel {found.texel} under a tip of {1e3 * found.share.radius:g} mm", left=1)
    share = found.share
    show(
        f"the texel measures {share.share:.4f} of the applied force (finite elements; {share.lightest:.4f} under light "
        f"loads, {share.heaviest:.4f} at {share.largest_load:.3g} N)"
    )
    for name, estimate in found.estimates.items():
        show(
            f"{name.replace('_', ' ')}: {estimate.value:.5g} [{estimate.low:.5g}, {estimate.high:.5g}] {estimate.unit}"
        )


def _write(found: Calibration, sensor: str, path: Path, *, polynomial: bool) -> None:
    from validation.calibration.write_sensor import write_sensor

    say(f"wrote {write_sensor(found, sensor, path, polynomial=polynomial)}")


def _draw(found: Calibration, sensor: SensorDescription, path: Path) -> None:
    from validation.calibration.picture import draw_hold_out

    if found.hold_out is None:
        say("--picture: too few recordings to leave some out; no picture")
    else:
        say(f"wrote {draw_hold_out(found.hold_out, sensor.array, path)}")


def _print(found: Calibration, sensor: SensorDescription) -> None:
    rows = []
    for name, estimate in found.estimates.items():
        interval = f"{estimate.low:.4g}..{estimate.high:.4g}"
        rows.append((name.replace("_", " "), f"{estimate.value:.4g}", interval, estimate.unit, estimate.fitted_on))
    headings = ("", "value", f"{found.confidence:.0%} interval", "unit", "fitted on")
    print_table(headings, rows, title=f"Calibration of {sensor.name}", left=len(headings), lines=False)
    if sensor.name == _PUBLISHED:
        gain, offset = found.report_line
        show(f"published line of this sensor (2015 report): {gain:g} counts/N, offset {offset:g} counts")
    for name, (pose, widths) in found.poses.items():
        x, y = (f"{1e3 * pose[axis]:.2f} +- {1e3 * widths[axis]:.2f} mm" for axis in (0, 1))
        show(f"{name}: x {x}, y {y}, yaw {57.29578 * pose[2]:.1f} deg")
    show(f"shares by {found.fit.method.name}: {found.fit.method.about}; residual {found.fit.rms:.1f} counts")
    if found.hold_out is not None:
        show(f"left-out recordings: {found.hold_out.summary}")
    for note in found.notes:
        show(f"- {note}")
