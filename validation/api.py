"""The public functions of the package: each does in Python what the command of the same name does, without printing.

Quantities are texts with a unit, such as "5 N" or "0.3 mm", as on the command line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import fastmodel
from fastmodel import Parameters
from validation.errors import InputError, refuse_existing
from validation.extras import REPORT_MODULES, require
from validation.output_folder import check_writable, make_file_name, new_folder, optional_folder, write_text
from validation.parameters import find_parameters, holds_parameters
from validation.sensor_file import BUILT_IN, CURVED, PUBLISHED, SensorDescription
from validation.sensor_file import load as load_description

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration
    from validation.calibration.point_load import PointLoadCalibration
    from validation.calibration.step_response import StepResponse
    from validation.campaign.campaign_file import Campaign
    from validation.campaign.comparison import Comparison
    from validation.campaign.evaluation import Evaluation, RecordingEvaluation
    from validation.data_sets.data_set import DataSet
    from validation.data_sheet import DataSheet
    from validation.derivation.derive import Derivation
    from validation.moving.history import History
    from validation.press_history import HistoryPress
    from validation.recordings.capture import Captured
    from validation.recordings.recording import Recording
    from validation.regression.baseline import Regression
    from validation.simulator_models import Exported
    from validation.weiss.protocol import MatrixInfo, Reading
    from validation.weiss.stream import Gap

Progress = Callable[[str], None]
#: Accepted types of a sensor: a result of `load`, a path, or the name of a built-in sensor.
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
        material: Name of a material that replaces the material of the cover.
        thickness: Thickness with its unit that replaces the thickness of the cover.
        layers: Changes of single layers, such as `2:thickness=1mm`.

    Returns:
        The description of the sensor; for a folder the parameters of its fast model.

    Raises:
        InputError: If the sensor cannot be read, or a cover is given for a folder.
        ParametersError: If the files in the folder are damaged.
        OSError: If the file exists and cannot be read.
    """
    if not holds_parameters(str(sensor)):
        if str(sensor) not in {*BUILT_IN, *PUBLISHED, *CURVED} and Path(sensor).is_dir():
            raise InputError(
                f"{sensor}: `softcover derive --out` did not write this folder; name one that it wrote, or a file"
            )
        return load_description(sensor, material=material, thickness=thickness, layers=layers)
    if material is not None or thickness is not None or layers:
        raise InputError(
            f"--material, --thickness, --layer: the parameters in {sensor} were derived for one cover; "
            f"derive them anew: softcover derive SENSOR --material NAME --out FOLDER"
        )
    return fastmodel.load(Path(sensor))


def load_any(sensor: Sensor) -> SensorDescription | Parameters:
    """Read a sensor as `load` does; a sensor that is already read is returned unchanged."""
    return load(sensor) if isinstance(sensor, str | Path) else sensor


class Stages:
    """Display of the progress of a long computation by a function of the caller.

    Args:
        progress: Function that is called with the name of each stage; None to show nothing.  If it has a method `step`,
            the method is called before each item of a stage instead, with the number of finished items, the number of
            all items and the name of the next one.
    """

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress or (lambda _: None)
        self._step = getattr(progress, "step", None)

    def __call__(self, stage: str) -> None:
        """Show that a stage begins."""
        self._progress(stage)

    def step(self, done: int, total: int, name: str) -> None:
        """Show that `done` of `total` items are finished and that the item `name` comes next."""
        if self._step is not None:
            self._step(done, total, name)
        else:
            self._progress(f"{done}/{total} {name}")


def list_unused(sensor: SensorDescription | Parameters) -> tuple[str, ...]:
    """Return one sentence for each entry of a sensor file that the fast model does not use, such as the friction."""
    from validation.text.friction import describe_friction

    if not isinstance(sensor, SensorDescription) or not sensor.friction:
        return ()
    friction = describe_friction(sensor.friction)
    return (f"friction {friction} from {sensor.source} is not used; the fast model has none",)


def describe(sensor: Sensor, *, instead: str = "", **changes: Any) -> SensorDescription:  # noqa: ANN401 -- as `load`
    """Return the description of a sensor, for functions that need its cover.

    Args:
        sensor: The sensor.
        instead: Alternative for a folder of parameters, for the error message.
        **changes: Changes of the cover, as for `load`; a sensor that is already read is returned unchanged.

    Raises:
        InputError: If the sensor cannot be read, or only the parameters of its fast model are known.
    """
    if isinstance(sensor, SensorDescription):
        return sensor
    if isinstance(sensor, Parameters) or holds_parameters(str(sensor)):
        place = "sensor" if isinstance(sensor, Parameters) else sensor
        raise InputError(
            f"{place}: holds the parameters of the fast model, but no description of the cover, which is needed here; "
            f"name the sensor file or the built-in sensor that it was derived from{instead and f', or {instead}'}"
        )
    return load_description(sensor, **changes)


def derive(
    sensor: SensorDescription | str | Path,
    *,
    out: str | Path | None = None,
    format: Literal["png", "svg"] = "png",  # noqa: A002 -- as on the command line
    progress: Progress | None = None,
) -> Derivation:
    """Compute the response of a sensor's cover by finite elements, and fit the parameters of its fast model to it.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        out: Folder for the parameters and pictures, which replace an earlier result; None to write nothing.
        format: Format of the plot.
        progress: Called with the name of each stage.

    Returns:
        The responses with their error estimate; `parameters` is the fast model.

    Raises:
        InputError: If the sensor cannot be read or meshed.
        MissingExtraError: If finite elements are not installed.
        ConvergenceError: If the finite elements did not converge.
    """
    description = describe(sensor)
    way_out = f"write the stored parameters: softcover export {description.name} --out FOLDER"
    require(
        "skfem",
        useful=("matplotlib", "pyvista") if out else (),
        otherwise=way_out if description is BUILT_IN.get(description.name) else "",
    )
    from validation.derivation.derive import derive as derive_sensor
    from validation.report.figures import write_derivation

    with optional_folder(out) as folder:
        found = derive_sensor(description, progress=progress)
        if folder:
            write_derivation(found, folder, format)
    return found


def press(
    sensor: Sensor,
    indenter: str,
    *,
    load: str | None = None,
    depth: str | None = None,
    at: str | None = None,
    direction: str | None = None,
    yaw: str | None = None,
    tilt: str | None = None,
    friction: str | None = None,
    strain: Literal["small", "finite"] | None = None,
    accuracy: float | None = None,
    models: Sequence[str] = ("fem", "fast"),
    method: str = "default",
    progress: Progress | None = None,
) -> Comparison:
    """Press an indenter on a sensor by finite elements, by the fast model, or by both.

    Args:
        sensor: The sensor; parameters of the fast model suffice for `models=("fast",)`.
        indenter: Shape of the indenter, such as `sphere:radius=5mm`.
        load: Force on the indenter, such as `5 N`; give either load or depth.
        depth: Distance from first touch, such as `0.3 mm`.
        at: Position of first touch: a name such as `off grid`, or `1mm,-2mm` in the array's frame; three coordinates on
            a curved cover.
        direction: Direction of the motion on a curved cover: a name or a vector.
        yaw: Rotation of the indenter about its axis, such as `45 deg`.
        tilt: Rotations of the indenter about its x and y axes, such as `1deg,0deg`.
        friction: Friction coefficient, or `no-slip`; that of the sensor when not given.
        strain: Kind of strain in a curved cover, small or finite.  For flat covers it follows from their materials.
        accuracy: Wanted relative error of the finite elements; None for the usual grids [-].
        models: Models to compute: `fem`, `fast`.
        method: Contact method of the fast model, `default` or one of `fastmodel.METHODS`.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option cannot be read.
        MissingExtraError: If finite elements are needed and not installed.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.pressing import read_request

    request = read_request(
        lambda _: load_any(sensor), indenter, load=load, depth=depth, friction=friction, strain=strain,
        accuracy=accuracy, models=",".join(models), method=method,
        pose={"at": at, "direction": direction, "yaw": yaw, "tilt": tilt},
    )  # fmt: skip
    return request.run(progress=progress)


def press_in_time(
    sensor: SensorDescription | str | Path,
    indenter: str,
    *,
    history: str | Path | History | None = None,
    hold: str | None = None,
    load: str | None = None,
    depth: str | None = None,
    at: str | None = None,
    yaw: str | None = None,
    tilt: str | None = None,
    progress: Progress | None = None,
) -> HistoryPress:
    """Press an indenter on a relaxing cover over a history of loads or depths, by finite elements.

    Args:
        sensor: Sensor, whose flat linear cover states a `relaxation`.
        indenter: Shape of the indenter, such as `sphere:radius=5mm`.
        history: Load or depth in time: a CSV file, or a `History`; give either a history or `hold`.
        hold: Time for which load or depth are held after a step, such as `60 s`.
        load: Held force, such as `5 N`; with `hold`, give either load or depth.
        depth: Held depth, such as `0.3 mm`.
        at: Position of the indenter's axis, as for `press`.
        yaw: Rotation of the indenter about its axis, such as `45 deg`.
        tilt: Rotations of the indenter about its x and y axes, such as `1deg,0deg`.
        progress: Called with a line of text before each step.

    Returns:
        Force, depth and texel forces at each instant, with error estimates.

    Raises:
        InputError: If an option cannot be read, or the history is not computed on the cover.
        MissingExtraError: If finite elements are not installed.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.pressing import read_request

    require("skfem")
    request = read_request(
        lambda _: describe(sensor), indenter, load=load, depth=depth, history=history, hold=hold,
        pose={"at": at, "yaw": yaw, "tilt": tilt},
    )  # fmt: skip
    return request.follow(progress)


def validate(
    sensor: SensorDescription | str | Path,
    *,
    campaign: str | Path | None = None,
    quick: bool = False,
    budget: str | None = None,
    recordings: str | Path | DataSet | None = None,
    data_set: str | Path | None = None,
    recorded: SensorDescription | None = None,
    only_recordings: bool = False,
    out: str | Path | None = None,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
) -> Evaluation | RecordingEvaluation:
    """Score the fast model of a sensor against finite elements, and against recordings if a folder is given.

    Args:
        sensor: The sensor.
        campaign: Campaign file with cases and requirements on the fast model; None for the default campaign.
        quick: Whether to compute the cases that tell most, within five minutes of processor time.
        budget: Processor time, such as `20 min`, that the cases that tell most may take; None for all cases.
        recordings: Folder with recordings under known loads, or a data-set file.
        data_set: Data-set file; the file in the folder when not given.
        recorded: Sensor that made the recordings; `sensor` when not given.
        only_recordings: Whether to score recordings alone, without finite elements.
        out: Folder for the report, which replaces an earlier one; None to write none.
        progress: Called with the name of each stage.
        announce: Function that is called before the long computations with lines on omitted parts and computing times.

    Returns:
        All scores, a `RecordingEvaluation` for recordings alone; `verdict.accepted` states whether the fast model meets
        the acceptance criterion.

    Raises:
        InputError: If the sensor, the campaign or the recordings cannot be used.
        MissingExtraError: If finite elements or packages of the report are not installed.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.campaign.plan import read_budget
    from validation.recordings.importing import list_modules

    allowed = read_budget(budget, quick=quick)
    description, tell = describe(sensor), announce or (lambda _: None)
    data = _find_recordings(description, recordings, data_set)
    if only_recordings and (data is None or allowed):
        raise InputError(
            "--only-recordings: name the recordings with --recordings or --data-set, and leave out --quick and --budget"
        )
    require(
        "skfem", *(REPORT_MODULES if out else ()), *list_modules(file.path for file in (data.files if data else ()))
    )
    from validation.campaign.evaluation import evaluate, evaluate_recordings, read_plan

    shown = Stages(progress)
    plan = read_plan(None if campaign is None else Path(campaign), description, shown)
    with optional_folder(out) as folder:
        if only_recordings and data is not None:
            found: RecordingEvaluation = evaluate_recordings(
                recorded or description, data, campaign=plan, progress=shown
            )
        else:
            _announce(plan, description, tell)
            found = full = evaluate(
                description, campaign=plan, recordings=data, recorded=recorded, budget=allowed, progress=shown,
                announce=announce,
            )  # fmt: skip
            if full.plan.spare:
                tell(f"ten more minutes would add: {'; '.join(case.name for case in full.plan.spare)}")
        if folder:
            from validation.report import write_report

            shown("report")
            write_report(found, folder)
    return found


def _announce(plan: Campaign, sensor: SensorDescription, tell: Callable[[str], None]) -> None:
    """Tell which cases of a campaign are left out, and that friction takes time."""
    from validation.text.friction import describe_friction

    for line in plan.left_out:
        tell(f"softcover: left out: {line}")
    if sensor.friction:
        tell(
            f"friction {describe_friction(sensor.friction)} from {sensor.source} in the finite elements of "
            "every case, which takes minutes for each flat face; the fast model has none"
        )


def _find_recordings(
    sensor: SensorDescription, recordings: str | Path | DataSet | None, data_set: str | Path | None
) -> DataSet | None:
    """Find the recordings that options of `validate` name; None if they name none."""
    from validation.data_sets.data_set import DataSet, find_data_set

    if recordings is None and data_set is None:
        return None
    sensor.require_layers("--recordings, --data-set: recordings of curved covers are not scored; leave them out")
    return recordings if isinstance(recordings, DataSet) else find_data_set(recordings, data_set)


def regress(
    sensor: Sensor, *, baseline: str | Path, update: bool = False, seed: int = 0, progress: Progress | None = None
) -> Regression:
    """Compare quantities measured by the fast model of a sensor with a stored baseline.

    Args:
        sensor: Sensor.  With parameters alone, quantities that need finite elements are left out.
        baseline: The baseline file.
        update: Whether the baseline is written, with the new values of changed quantities.
        seed: Seed of the noise [-].
        progress: Called with the name of each stage.

    Returns:
        The readings; `changes` lists the quantities outside their tolerances and is empty if none changed.

    Raises:
        InputError: If the sensor or the baseline cannot be read.
        MissingExtraError: If finite elements are needed and not installed.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.regression.baseline import check_sensor

    found = load_any(sensor)
    if not isinstance(found, Parameters):
        way_out = f"check the stored parameters: softcover export {found.name} --out FOLDER, softcover regress FOLDER"
        require("skfem", otherwise=way_out if found is BUILT_IN.get(found.name) else "")
    return check_sensor(found, Path(baseline), update=update, seed=seed, progress=Stages(progress))


def fit_filter(
    recordings: Sequence[str | Path], sensor: SensorDescription | str | Path, at: float, *, array: int | None = None
) -> StepResponse:
    """Fit the low-pass filter of a real sensor to a recording with one step of the load.

    Args:
        recordings: One recording.
        sensor: Sensor, for recordings that state no layout.
        at: Instant of the step from the first frame [s].
        array: Index of the pressed array; None for the array with the largest change of counts.

    Returns:
        Orders, cut-off and delay with intervals, or why they are not identifiable.

    Raises:
        InputError: If there is not one recording, the step lies outside it, or nothing changes there.
        RecordingError: If the recording is damaged.
    """
    from validation.calibration.step_response import fit_step, sum_pressed
    from validation.recordings.importing import open_recording
    from validation.recordings.recording import choose_array

    if len(recordings) != 1:
        raise InputError(f"--step: takes one recording, not {len(recordings)}")
    recording = open_recording(recordings[0], sensor=describe(sensor).array)
    pressed = recording.arrays[choose_array(recording, array)]
    return fit_step(*sum_pressed(pressed, recording.times, at), at)


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
    profile_thickness: bool = False,
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
        sensor: Sensor; its cover gives the share of each texel.
        indenter: Tool that pressed on the array, such as `box:size=10mmx10mmx5mm`; empty to take it from the labels.
        at: Position of the tool's axis, such as `1mm,-2mm`; None to fit it.
        yaw: Yaw of the tool, such as `10deg`; None for 0 if `at` is given, else to fit it.
        moved: Whether each recording has its own pose.
        method: Contact method: `default`, one of `fastmodel.METHODS`, or `reference` for finite elements.
        array: Index of the pressed array; None for the array with the largest change of counts.
        threshold: Counts that the firmware subtracted [-]; None for the value in the labels.
        window: First and last time after loading between which frames are averaged [s].
        temperature_channel: Index of the temperature sensor, negative from the last.
        heights: Whether a seating height is fitted for each texel.
        profile_thickness: Whether the thickness of the cover is examined by fits on thinner and thicker covers.
        tip: Radius of a rounded tip that pressed on one texel, such as `1mm`; the slope of each trial is fitted then.
        texel: Index of the texel under the tip.
        out: Sensor file to write: a copy of `sensor` with new electronics.
        picture: Picture of left-out recordings to write; not written if there are too few recordings to leave some out.
        polynomial: Whether the written characteristic is the polynomial of degree 5 instead of the line.
        progress: Called with the name of each stage.

    Returns:
        The calibration; with `tip` the slopes of the trials.

    Raises:
        InputError: If an option is wrong, or no recording can be used.
        MissingExtraError: If a package is missing that reads the recordings, solves the contact or draws.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.calibration.calibrate import Calibration, calibrate_recordings
    from validation.schema.data_set import CommonKeys
    from validation.text.indenter import read_position, read_yaw
    from validation.text.quantity import read_quantity

    description = describe(sensor)
    check_writable(*(Path(path) for path in (out, picture) if path is not None))
    for option, path in (("--out", out), ("--picture", picture)):
        refuse_existing(option, None if path is None else Path(path))
    if out is not None and description.source.startswith("built-in"):
        raise InputError(f"--out: {description.name} is built in and has no file to copy; see `softcover init`")
    keys = CommonKeys.model_construct(
        indenter=indenter or (f"tip:radius={tip}" if tip else None), array=array, threshold=threshold, window=window,
        at=None if at is None else read_position(at), yaw=None if yaw is None else read_yaw(yaw),
        temperature_channel=temperature_channel,
    )  # fmt: skip
    found = calibrate_recordings(
        [Path(each) for each in recordings], description, keys, moved=moved, method=method, heights=heights,
        texel=texel, tip=None if tip is None else read_quantity(tip, "length", place="--tip"),
        profile=profile_thickness, draws=picture is not None, progress=progress,
    )  # fmt: skip
    if isinstance(found, Calibration):
        found.write_files(description, out=out, picture=picture, polynomial=polynomial)
    return found


def record(
    port: str,
    out: str | Path,
    *,
    seconds: float | None = None,
    indenter: str = "",
    load: str | None = None,
    note: str = "",
    threshold: int | None = None,
    gain: int | None = None,
    tare: bool = False,
    interval_ms: int = 0,
    run_length: bool = False,
    reconnect: float = 0.0,
    baud_rate: int = 115_200,
    on_start: Callable[[MatrixInfo], None] | None = None,
    on_event: Callable[[Reading | Gap], None] | None = None,
) -> Captured:
    """Record a real sensor in an MCAP file.

    Args:
        port: Port of the sensor, such as `/dev/ttyACM0`, or a pyserial URL.
        out: New .mcap file.
        seconds: Duration; None to record until Ctrl-C [s].
        indenter: Tool that presses, such as `sphere:radius=5mm`; stored in the file.
        load: Force or weight, such as `4.9N` or `500g`; stored in the file.
        note: Further remarks to store in the file.
        threshold: Threshold of the sensor [counts]; None for no change.
        gain: Front-end gain of the sensor [-]; None for no change.
        tare: Whether the sensor takes the image at the start as zero.
        interval_ms: Time between frames [ms]; 0 for the shortest time that the sensor supports.
        run_length: Whether frames are run-length encoded, for slow lines.
        reconnect: Longest time to wait for a lost port to return [s].
        baud_rate: Speed of a true UART; USB ports ignore it [1/s].
        on_start: Called with the size of the array before the first frame.
        on_event: Called with each frame and each gap.

    Raises:
        InputError: If the file exists, or the indenter or the load cannot be read.
        PortError: If the port cannot be opened or is lost.
    """
    from validation.recordings.capture import record as capture
    from validation.recordings.recording import Setup
    from validation.weiss.sensor import Sensor as Device

    setup, path = Setup.read(indenter, load, note), Path(out)
    refuse_existing("--out", path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with Device(port, baud_rate=baud_rate) as device:
        if threshold is not None:
            device.set_threshold(threshold)
        if gain is not None:
            device.set_gain(gain)
        if tare:
            device.tare()
        if on_start is not None:
            on_start(device.read_matrix())
        return capture(
            device, path, setup=setup, seconds=seconds, run_length=run_length, interval_ms=interval_ms,
            reconnect=reconnect, on_event=on_event,
        )  # fmt: skip


def replay(
    file: str | Path, *, topic: str | None = None, rows: int | None = None, columns: int | None = None
) -> Recording:
    """Read a recording of any known format.

    Args:
        file: A recording: .mcap, .dsa, .csv, .bag, or a folder of ROS 2.
        topic: Topic that holds the frames, in bags of other programs.
        rows: Number of rows of texels, for tables that state none.
        columns: Number of columns of texels, for tables that state none.

    Returns:
        Frames, times, temperatures, forces and labels.

    Raises:
        RecordingError: If the file is damaged or of no known format.
        OSError: If it cannot be read.
    """
    from validation.recordings.importing import open_recording

    return open_recording(Path(file), topic=topic, rows=rows, columns=columns)


def export(
    sensor: Sensor,
    out: str | Path,
    *,
    format: str = "mjcf",  # noqa: A002 -- as on the command line
    method: str = "default",
    mass: str | None = None,
    load: str | None = None,
    changes: Sequence[str] = (),
    progress: Progress | None = None,
) -> Exported:
    """Write a sensor for other simulators: a model of rigid boxes, and the fast model's parameters.

    The formats with a scored value hold the value that a simulator asks for, with its error in finite-element presses.

    Args:
        sensor: The sensor.
        out: Folder for the files; an earlier result is replaced.
        format: Format of the model, `mjcf`, `sdf`, `urdf`, or `gazebo`, the plugin block of 2015; or the simulator or
            data set of a scored value, `drake`, `newton`, `genesis`, `isaac`, `lerobot` or `ros2`.
        method: Contact method of the model, `default` or one of `fastmodel.METHODS`.
        mass: Mass of the array for SDF and URDF, such as `20g`.  Without it an SDF model is static and a URDF model has
            no inertia.
        load: Range of loads in which a value is fitted and scored, such as `1N:5N`; None for the loads of a point that
            give a texel a count and that saturate it.
        changes: Words of the command line by which the cover was changed, for the command in the file.
        progress: Called with the name of each stage.

    Raises:
        InputError: If an option is wrong, the Gazebo plugin cannot describe the sensor, or no value can be scored.
        MissingExtraError: If finite elements are needed and not installed.
    """
    from validation.simulator_models import FORMATS, Exported, check_gazebo, read_options, write_model

    kilograms, loads = read_options(format, method, mass, load)
    found = load_any(sensor)
    if format not in FORMATS:
        from validation.simulator_values.export import export_values

        found = describe(found)
        done = export_values(found, Path(out), form=format, loads=loads, changes=changes, progress=progress)
        return replace(done, warnings=list_unused(found))
    if format == "gazebo":
        check_gazebo(found)
    model = make_file_name(found.array.name, suffix=FORMATS[format])
    with new_folder(Path(out)) as folder:
        parameters = find_parameters(found, progress)
        used = write_model(parameters, folder / model, form=format, method=method, mass=kilograms)
    return Exported(
        sensor=found.array.name, format=format, method=used, out=str(out),
        files=(model, "parameters.toml", "cover.npz"), warnings=list_unused(found),
    )  # fmt: skip


def datasheet(sensor: Sensor, *, out: str | Path | None = None, progress: Progress | None = None) -> DataSheet:
    """Make the data sheet of a sensor: each quantity with its definition and origin, or `not stated`.

    Args:
        sensor: The sensor.
        out: File to write, .md or .html; None to write none.
        progress: Called with the name of each stage.

    Raises:
        InputError: If `out` exists or ends otherwise, or the sensor cannot be read.
        MissingExtraError: If finite elements are needed and not installed.
    """
    from validation.data_sheet import make_datasheet

    target = None if out is None else Path(out)
    if target is not None and target.suffix not in {".md", ".html"}:
        raise InputError(f"--out: {target} is neither .md nor .html; write for example --out sensor.md")
    refuse_existing("--out", target)
    check_writable(target)
    found = load_any(sensor)
    description = None if isinstance(found, Parameters) else found
    sheet = make_datasheet(find_parameters(found, progress), description)
    if target is not None:
        write_text(target, sheet.html() if target.suffix == ".html" else sheet.markdown())
    return sheet
