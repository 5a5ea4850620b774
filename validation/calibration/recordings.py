"""Calibrates a sensor from files: reads recordings under known loads, chooses a contact method, and fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from fastmodel import METHODS
from validation.calibration.calibrate import Calibration, calibrate, draw_hold_out, write_sensor
from validation.calibration.contact import REFERENCE, ContactMethod, make_fast_method, make_reference_method
from validation.calibration.point_load import PointLoadCalibration, calibrate_point_load
from validation.data_sets.data_set import DEFAULT_WINDOW
from validation.data_sets.from_files import Keys, describe_files
from validation.data_sets.images import Image, observe, read_images
from validation.errors import InputError, nearest
from validation.extras import require
from validation.parameters import find_parameters
from validation.recordings.importing import list_modules
from validation.sensor_file import BUILT_IN, SensorDescription, load
from validation.text.quantity import read_quantity


def calibrate_recordings(
    recordings: Sequence[str | Path],
    sensor: str | Path | SensorDescription,
    *,
    indenter: str = "",
    at: str | None = None,
    yaw: str | None = None,
    moved: bool = False,
    method: str = "default",
    array: int | None = None,
    threshold: float | None = None,
    window: tuple[float, float] = DEFAULT_WINDOW,
    temperature_channel: int = -1,
    heights: bool = False,
    tip: str | None = None,
    texel: int | None = None,
    out: str | Path | None = None,
    picture: str | Path | None = None,
    polynomial: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Calibration | PointLoadCalibration:
    """Fit the electronics of a sensor to recordings under known loads.

    Args:
        recordings: Recordings, or one data-set file, which states tool, pose, threshold and window itself.
        sensor: The sensor, its file, or the name of a built-in one; its cover gives the share of each texel.
        indenter: Tool that pressed, such as `box:size=10mmx10mmx5mm`; empty to take it from the labels.
        at: Position of its axis, such as `1mm,-2mm`; None to fit it.
        yaw: Its yaw, such as `10deg`; None for 0 if `at` is given, else to fit it.
        moved: Whether each recording has a pose of its own.
        method: Contact method: `default`, one of `fastmodel.METHODS`, or `reference` for finite elements.
        array: Index of the pressed array; None for the one that is pressed most.
        threshold: Counts that the firmware subtracted; None for what the labels say [-].
        window: First and last time after loading between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor, negative from the last.
        heights: Whether a seating height is fitted to each texel.
        tip: Radius of a rounded tip that pressed on one texel, such as `1mm`; the slope of each trial is fitted then.
        texel: Index of the texel under the tip.
        out: Sensor file to write: a copy of `sensor` with new electronics.
        picture: Picture of left-out recordings to write.
        polynomial: Whether the written characteristic is the polynomial of degree 5 instead of the line.
        progress: Called with the name of each stage.

    Returns:
        The calibration; with `tip` the slopes of the trials.

    Raises:
        InputError: If an option is wrong, or no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
        ConvergenceError: If the finite elements did not converge.
    """
    paths = [Path(each) for each in recordings]
    for option, path in (("--out", out), ("--picture", picture)):
        if path is not None and Path(path).exists():
            raise InputError(f"{option}: {path} exists; name a new file")
    if (tip is None) != (texel is None):
        raise InputError("--tip, --texel: give both to calibrate one texel with a rounded tip, or neither")
    if threshold is not None and threshold < 0:
        raise InputError(f"--threshold: must be 0 or more, not {threshold:g}")
    accepted = ("default", *METHODS, REFERENCE)
    if method not in accepted:
        raise InputError(f"--method: unknown contact method {method!r}; {nearest(method, accepted)}")
    description = sensor if isinstance(sensor, SensorDescription) else load(sensor)
    if out is not None and description is BUILT_IN.get(description.name):
        raise InputError(f"--out: {description.name} is built in and has no file to copy; see `softcover init`")
    keys = Keys(
        indenter=indenter or (f"tip:radius={tip}" if tip else ""),
        at=at,
        yaw=yaw,
        moved=moved,
        array=array,
        threshold=threshold,
        window=window,
        temperature_channel=temperature_channel,
    )
    images, left_out = _read_images(paths, description, keys, method="" if tip else method, draws=picture is not None)
    if tip is not None and texel is not None:
        # Recordings with a force channel are a trial each; recordings under single loads are one trial together.
        names = [image.file.name for image in images]
        trials = names if len(set(names)) < len(names) else ["all recordings"] * len(names)
        radius = read_quantity(tip, "length", place="--tip")
        slopes = calibrate_point_load(observe(images), trials, description, radius=radius, texel=texel)
        return slopes.model_copy(update={"left_out": left_out})
    found = calibrate(
        observe(images),
        choose_method(description, method, images, progress),
        noise=[image.noise for image in images],
        full_scale=max(image.full_scale for image in images),
        heights=heights,
    )
    if out is not None:
        write_sensor(found, description.source, out, polynomial=polynomial)
    if picture is not None and found.hold_out is not None:
        draw_hold_out(found.hold_out, description.array, Path(picture))
    return found.model_copy(update={"left_out": left_out})


def _read_images(
    paths: Sequence[Path], sensor: SensorDescription, keys: Keys, *, method: str, draws: bool
) -> tuple[list[Image], tuple[str, ...]]:
    """Read the images that may be fitted, and one sentence for each recording that cannot be used.

    Args:
        paths: Recordings, or one data-set file.
        sensor: The sensor.
        keys: Options for recordings.
        method: Contact method; empty for the finite elements under a tip.
        draws: Whether a picture will be drawn.

    Raises:
        InputError: If no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
    """

    def require_modules(files: Sequence[Path]) -> None:
        needed = [*list_modules(files), *(["matplotlib"] if draws else [])]
        # The fast model of a built-in sensor is stored; by default finite elements compute the contact.
        if method and sensor is BUILT_IN.get(sensor.name):
            require(*needed, useful=() if method in METHODS else ("skfem",))
        else:
            require(*needed, "skfem")

    if not any(path.suffix == ".toml" for path in paths):
        require_modules(paths)
    data_set = describe_files(paths, keys, sensor.array)
    require_modules([file.path for file in data_set.files])
    images, problems = read_images(data_set, sensor.array)
    left_out = (*data_set.problems, *problems)
    images = [image for image in images if "fit" in image.file.uses]
    if not images:
        raise InputError(*left_out, "no recording can be used")
    return images, left_out


def choose_method(
    sensor: SensorDescription,
    method: str,
    images: Sequence[Image],
    progress: Callable[[str], None] | None = None,
) -> ContactMethod:
    """Return the contact method of a name.

    The default is finite elements; for fitted tilts, a cover of finite size or a given spread, where they are slow or
    do not apply, it is the method `cover`, or `area` for a given spread.
    """
    level = all(image.file.placement.tilt is not None for image in images)
    solvable = sensor.spread is None and sensor.cover.size is None and level
    if method == REFERENCE or (method == "default" and solvable):
        stored = sensor is BUILT_IN.get(sensor.name)
        require("skfem", otherwise="compute the contact by the fast model: --method cover" if stored else "")
        return make_reference_method(sensor.cover, sensor.array)
    parameters = find_parameters(sensor, progress)
    if method == "default":
        method = "area" if parameters.cells is None else "cover"
    return make_fast_method(parameters, method)
