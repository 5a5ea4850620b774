"""The verbs of the package: each does in Python what the command of the same name does, without printing.

Quantities are texts with a unit, such as "5 N" or "0.3 mm", as on the command line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import fastmodel
from fastmodel import Parameters
from validation.errors import InputError
from validation.parameters import holds_parameters
from validation.sensor_file import BUILT_IN, SensorDescription
from validation.sensor_file import load as load_description

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration
    from validation.calibration.point_load import PointLoadCalibration

Progress = Callable[[str], None]
#: What a verb takes as a sensor: what `load` returns, a path, or the name of a built-in sensor.
Sensor = SensorDescription | Parameters | str | Path


def load(
    sensor: str | Path,
    *,
    material: str | None = None,
    thickness: str | None = None,
    layers: Sequence[str] = (),
) -> SensorDescription | Parameters:
    """Read a sensor.

    Args:
        sensor: Path of a sensor file, name of a built-in sensor, or folder that `derive` wrote.
        material: Name of a material that replaces the cover's.
        thickness: Thickness with its unit that replaces the cover's.
        layers: Changes of single layers, such as `2:thickness=1mm`.

    Returns:
        The description of the sensor; of a folder the parameters of its fast model.

    Raises:
        InputError: If the sensor cannot be read, or a cover is given for a folder.
        ParametersError: If the files in the folder are damaged.
        OSError: If the file exists and cannot be read.
    """
    if not holds_parameters(str(sensor)):
        return load_description(str(sensor), material=material, thickness=thickness, layers=layers)
    if material is not None or thickness is not None or layers:
        raise InputError(
            f"--material, --thickness, --layer: the parameters in {sensor} were derived for one cover; "
            f"derive them anew: softcover derive SENSOR --material NAME --out FOLDER"
        )
    return fastmodel.load(Path(sensor))


def _describe(sensor: Sensor) -> SensorDescription:
    """Return the description of a sensor.

    Raises:
        InputError: If only the parameters of its fast model are known.
    """
    found = load(sensor) if isinstance(sensor, str | Path) else sensor
    if isinstance(found, Parameters):
        raise InputError(f"{sensor}: parameters of the fast model do not describe the cover; name the sensor file")
    return found


def calibrate(
    recordings: Sequence[str | Path],
    sensor: SensorDescription | str | Path,
    *,
    indenter: str = "",
    at: str | None = None,
    yaw: str | None = None,
    moved: bool = False,
    method: str = "default",
    array: int | None = None,
    threshold: float | None = None,
    window: tuple[float, float] = (6.0, 9.0),
    temperature_channel: int = -1,
    heights: bool = False,
    tip: str | None = None,
    texel: int | None = None,
    out: str | Path | None = None,
    picture: str | Path | None = None,
    polynomial: bool = False,
    progress: Progress | None = None,
) -> Calibration | PointLoadCalibration:
    """Fit the electronics of a real sensor to recordings under known loads.

    Args:
        recordings: Recordings, or one data-set file, which states tool, pose, threshold and window itself.
        sensor: The sensor; its cover gives the share of each texel.
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
        picture: Picture of left-out recordings to write; none is written if there are too few to leave some out.
        polynomial: Whether the written characteristic is the polynomial of degree 5 instead of the line.
        progress: Called with the name of each stage.

    Returns:
        The calibration; with `tip` the slopes of the trials.

    Raises:
        InputError: If an option is wrong, or no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.calibration.calibrate import Calibration
    from validation.calibration.recordings import calibrate_recordings
    from validation.data_sets.from_files import Keys
    from validation.text.quantity import read_quantity

    description = _describe(sensor)
    for option, path in (("--out", out), ("--picture", picture)):
        if path is not None and Path(path).exists():
            raise InputError(f"{option}: {path} exists; name a new file")
    if out is not None and description is BUILT_IN.get(description.name):
        raise InputError(f"--out: {description.name} is built in and has no file to copy; see `softcover init`")
    keys = Keys(
        indenter=indenter or (f"tip:radius={tip}" if tip else ""), at=at, yaw=yaw, moved=moved, array=array,
        threshold=threshold, window=window, temperature_channel=temperature_channel,
    )  # fmt: skip
    found = calibrate_recordings(
        [Path(each) for each in recordings], description, keys, method=method, heights=heights, texel=texel,
        tip=None if tip is None else read_quantity(tip, "length", place="--tip"),
        draws=picture is not None, progress=progress,
    )  # fmt: skip
    if isinstance(found, Calibration):
        found.write_files(description, out=out, picture=picture, polynomial=polynomial)
    return found
