"""Calibrates a sensor from files: reads recordings under known loads, chooses a contact method, and fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from fastmodel import METHODS
from validation.calibration.calibrate import Calibration, calibrate
from validation.calibration.contact import REFERENCE, ContactMethod, make_fast_method, make_reference_method
from validation.calibration.point_load import PointLoadCalibration, calibrate_point_load
from validation.data_sets.from_files import Keys, describe_files
from validation.data_sets.images import Image, observe, read_images
from validation.errors import InputError, nearest
from validation.extras import require
from validation.parameters import find_parameters
from validation.recordings.importing import list_modules
from validation.sensor_file import BUILT_IN, SensorDescription


def calibrate_recordings(
    paths: Sequence[Path],
    sensor: SensorDescription,
    keys: Keys,
    *,
    method: str = "default",
    heights: bool = False,
    tip: float | None = None,
    texel: int | None = None,
    draws: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Calibration | PointLoadCalibration:
    """Fit the electronics of a sensor to recordings under known loads.

    Args:
        paths: Recordings, or one data-set file, which states tool, pose, threshold and window itself.
        sensor: The sensor; its cover gives the share of each texel.
        keys: Tool, pose, pressed array, threshold and window of the recordings.
        method: Contact method: `default`, one of `fastmodel.METHODS`, or `reference` for finite elements.
        heights: Whether a seating height is fitted to each texel.
        tip: Radius of a rounded tip on one texel, whose slope is fitted per trial; None for an array [m].
        texel: Index of the texel under the tip.
        draws: Whether the caller will draw left-out recordings.
        progress: Called with the name of each stage.

    Raises:
        InputError: If an option is wrong, or no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
        ConvergenceError: If the finite elements did not converge.
    """
    if keys.threshold is not None and keys.threshold < 0:
        raise InputError(f"--threshold: must be 0 or more, not {keys.threshold:g}")
    accepted = ("default", *METHODS, REFERENCE)
    if method not in accepted:
        raise InputError(f"--method: unknown contact method {method!r}; {nearest(method, accepted)}")
    if (tip is None) != (texel is None):
        raise InputError("--tip, --texel: give both to calibrate one texel with a rounded tip, or neither")
    images, left_out = _read_images(paths, sensor, keys, method="" if tip else method, draws=draws)
    found: Calibration | PointLoadCalibration
    if tip is not None and texel is not None:
        # Recordings with a force channel are a trial each; recordings under single loads are one trial together.
        names = [image.file.name for image in images]
        trials = names if len(set(names)) < len(names) else ["all recordings"] * len(names)
        found = calibrate_point_load(observe(images), trials, sensor, radius=tip, texel=texel)
    else:
        found = calibrate(
            observe(images),
            choose_method(sensor, method, images, progress),
            noise=[image.noise for image in images],
            full_scale=max(image.full_scale for image in images),
            heights=heights,
        )
    return replace(found, left_out=left_out)


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
        return make_reference_method(sensor.layered_cover, sensor.array)
    parameters = find_parameters(sensor, progress)
    if method == "default":
        method = "area" if parameters.surface is None else "cover"
    return make_fast_method(parameters, method)
