"""The command `softcover press`, which computes one indentation by finite elements and by the fast model."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.entry import DONE, NOT_CONVERGED
from validation.cli.options import Json, Layers, MaterialName, Method, Sensor, Shape, Thickness, check_choice, collect
from validation.cli.output import Progress, print_json, print_table, say
from validation.cli.press_options import (
    Strain,
    check_files,
    check_position,
    read_accuracy,
    read_force,
    read_friction_option,
    read_models,
)
from validation.cli.press_table import print_comparison
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.campaign.case import Case
    from validation.campaign.comparison import Comparison
    from validation.cli.curved.press import PressText
    from validation.press_files.curve import LoadCurve
    from validation.sensor_file import SensorDescription

#: Default of `--tilt`.
_NO_TILT = "0deg,0deg"

_Load = Annotated[str | None, Parameter(help="Force in N, or a weight in g: 4.9N, 500g.", allow_leading_hyphen=True)]
_Depth = Annotated[
    str | None,
    Parameter(help="Approach of the indenter from first touch, instead of a load: 0.3mm.", allow_leading_hyphen=True),
]
_At = Annotated[
    str | None,
    Parameter(
        help="Position of the indenter's axis in the array's frame, x,y; on a curved cover x,y,z of a place on its "
        "surface, or middle, off grid, edge, side. The middle of the array if left out.",
        allow_leading_hyphen=True,
    ),
]
_Direction = Annotated[
    str | None,
    Parameter(
        help="Direction in which the indenter moves on a curved cover, e.g. 0,0,-1, or oblique x, oblique y; along the "
        "normal if left out.",
        allow_leading_hyphen=True,
    ),
]
_Yaw = Annotated[str, Parameter(help="Rotation of the indenter about its axis.", allow_leading_hyphen=True)]
_Tilt = Annotated[
    str,
    Parameter(
        help="Rotations about the x and y axes of the indenter, before the yaw, at most 10deg, on a curved cover "
        "80deg: --tilt=2deg,0deg.",
        allow_leading_hyphen=True,
    ),
]
_Friction = Annotated[
    str | None,
    Parameter(
        help="Friction between indenter and cover in the finite elements: Coulomb's coefficient, or no-slip; that of "
        "the sensor file if left out.",
        allow_leading_hyphen=True,
    ),
]
_Accuracy = Annotated[
    str | None,
    Parameter(help="Wanted relative error of the finite elements, e.g. 1%; finer grids are added to reach it."),
]
_Curve = Annotated[
    int | None,
    Parameter(help="Compute this many points of the curve of load over depth, by finite elements; needs --out."),
]
_Out = Annotated[
    Path | None,
    Parameter(help="Folder for pictures, contact forces, displacement and stress in the cover, or for the curve."),
]
_Model = Annotated[str, Parameter(help="Which models: fem, fast, or fem,fast.")]


def press(
    sensor: Sensor,
    *,
    indenter: Shape,
    load: _Load = None,
    depth: _Depth = None,
    at: _At = None,
    direction: _Direction = None,
    yaw: _Yaw = "0deg",
    tilt: _Tilt = _NO_TILT,
    friction: _Friction = None,
    strain: Strain = None,
    accuracy: _Accuracy = None,
    model: _Model = "fem,fast",
    method: Method = "default",
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    curve: _Curve = None,
    out: _Out = None,
    json: Json = False,
) -> int:
    """Compute one indentation by finite elements and by the fast model, and compare the results.

    Only loading is computed: without friction, unloading retraces the same states; with friction it does not.

    Examples of use:

        softcover press wts-0614-34 --indenter sphere:radius=5mm --load 500g
        softcover press sensor.toml --indenter box:size=9mmx9mmx5mm --load 2N --at=1mm,-2mm --yaw=45deg
        softcover press wts-0614-34 --indenter cylinder:radius=4mm --depth 0.2mm --model fem --json
        softcover press sensor.toml --indenter roller:radius=30mm,length=40mm --load 5N --accuracy 0.5%
        softcover press derived --indenter sphere:radius=5mm --load 500g --model fast
        softcover press wts-0614-34 --indenter sphere:radius=5mm --depth 0.5mm --curve 20 --out curve
        softcover press fingertip --indenter sphere:radius=4mm --load 1N --at=0mm,8mm,0mm --out pressed
    """
    from validation.cli.curved.press import PressText
    from validation.sensor_file.sensor import has_curved_cover

    if has_curved_cover(sensor):
        return _press_curved(
            (sensor, material, thickness, layer),
            unsupported={"--accuracy": accuracy, "--curve": curve,
                         "--method": method != "default"},
            text=PressText(
                indenter=indenter, at=at, direction=direction, yaw=yaw, tilt=tilt, strain=strain or "small",
                friction=friction,
            ),
            force=(load, depth), model=model, out=out, json=json,
        )  # fmt: skip
    for name, given in (("--strain", strain), ("--direction", direction)):
        if given is not None:
            fault = "is for sensors with curved covers; flat ones and folders of derive are pressed along -z"
            raise InputError(f"{name}: {fault} and follow their materials")
    at = "0mm,0mm" if at is None else at
    request = _read_request(
        sensor, indenter=indenter, force=(load, depth), pose=(at, yaw, tilt), friction=friction, accuracy=accuracy,
        model=model, method=method, cover=(material, thickness, layer), files=(curve, out),
    )  # fmt: skip
    return _run(request, curve, out, json=json)


def _run(request: _Request, curve: int | None, out: Path | None, *, json: bool) -> int:
    """Compute the curve or the indentation that the options ask for."""
    from fem_reference.errors import PiercedError

    if "fem" in request.models or request.depth is not None:
        _require_modules(request, out)
    try:
        if curve is not None and out is not None:
            return _trace(request, curve, out, json=json)
        return _compare(request, out, json=json)
    except PiercedError as error:
        raise InputError(f"--{error.control}: {error}") from error


def _require_modules(request: _Request, out: Path | None) -> None:
    """Check that finite elements are installed; the error names the fast model where it can do without them.

    Raises:
        MissingExtraError: If they are not.
    """
    from validation.extras import require
    from validation.sensor_file import BUILT_IN

    stored = request.sensor is BUILT_IN.get(request.sensor.array.name)
    unused = request.depth is None and out is None and request.accuracy is None and not request.friction
    require(
        "skfem",
        useful=("matplotlib", "pyvista") if out else (),
        otherwise="compute the fast model alone: --model fast"
        if stored and unused and "fast" in request.models
        else "",
    )


def _press_curved(
    cover: tuple[str, str | None, str | None, list[str] | None],
    *,
    unsupported: dict[str, object],
    text: PressText,
    force: tuple[str | None, str | None],
    model: str,
    out: Path | None,
    json: bool,
) -> int:
    """Press a sensor with a curved cover; `cover` is the sensor, `--material`, `--thickness` and `--layer`."""
    from fem_reference.errors import PiercedError
    from validation.cli.options import read_description
    from validation.extras import require

    faults = [
        f"{name}: is not supported on curved covers; leave it out" for name, given in unsupported.items() if given
    ]
    sensor, material, thickness, layer = cover
    found = collect(
        faults,
        lambda: read_description(sensor, material=material, thickness=thickness, layers=layer, curved=True),
    )
    models = collect(faults, lambda: read_models(model))
    wanted = collect(faults, lambda: read_force(*force))
    if faults or found is None or models is None or wanted is None:
        raise InputError(*faults)
    require("skfem", useful=("pyvista",) if out else ())
    from validation.cli.curved.press import press_curved_cover

    try:
        return press_curved_cover(found, text, force=wanted, models=models, out=out, json=json)
    except PiercedError as error:
        raise InputError(f"--{error.control}: {error}") from error


@dataclass(frozen=True, kw_only=True)
class _Request:
    """Options of the command, read and checked."""

    sensor: SensorDescription | Parameters
    case: Case
    depth: float | None
    friction: float
    accuracy: float | None
    models: tuple[str, ...]
    method: str


def _read_request(
    sensor: str,
    *,
    indenter: str,
    force: tuple[str | None, str | None],
    pose: tuple[str, str, str],
    friction: str | None,
    accuracy: str | None,
    model: str,
    method: str,
    cover: tuple[str | None, str | None, list[str] | None],
    files: tuple[int | None, Path | None],
) -> _Request:
    """Read and check the options of the command.

    Groups: `--load`, `--depth`; `--at`, `--yaw`, `--tilt`; `--material`, `--thickness`, `--layer`; `--curve`, `--out`.
    """
    from meshes import Pose
    from validation.campaign.case import Case
    from validation.campaign.comparison import METHODS
    from validation.cli.options import read_description, read_sensor
    from validation.text.indenter import read_indenter, read_position, read_tilt, read_yaw

    faults: list[str] = []
    models = collect(faults, lambda: read_models(model))
    needs_reference = models is not None and ("fem" in models or force[1] is not None)
    instead = "" if force[1] is not None else "use it as it is: --model fast"
    read = functools.partial(read_description, instead=instead) if needs_reference else read_sensor
    found = collect(faults, lambda: read(sensor, material=cover[0], thickness=cover[1], layers=cover[2]))
    shape = collect(faults, lambda: read_indenter(indenter))
    position = collect(faults, lambda: read_position(pose[0]))
    angle = collect(faults, lambda: read_yaw(pose[1]))
    tilt = collect(faults, lambda: read_tilt(pose[2]))
    coefficient = collect(faults, lambda: read_friction_option(friction, used=needs_reference or models is None))
    collect(faults, lambda: check_choice("--method", "contact method", method, METHODS))
    collect(faults, lambda: _check_method(method, models, is_curve=files[0] is not None))
    wanted = collect(faults, lambda: read_accuracy(accuracy, used=needs_reference or models is None))
    load, depth = collect(faults, lambda: read_force(*force)) or (None, None)
    if found and position:
        collect(faults, lambda: check_position(found.array, position))
    collect(faults, lambda: check_files(*files, models))
    if faults or not (found and shape and position and models) or angle is None or tilt is None:
        raise InputError(*faults)
    case = Case(name="press", indenter=shape, shape=indenter, load=load or 0.0, pose=Pose.planar(position, angle, tilt))
    return _Request(
        sensor=found,
        case=case,
        depth=depth,
        friction=coefficient if coefficient is not None else getattr(found, "friction", 0.0),
        accuracy=wanted,
        models=models,
        method=method,
    )


def _compare(request: _Request, out: Path | None, *, json: bool) -> int:
    """Compute one indentation by the chosen models, print it, and write its files to `out` if given."""
    from validation.campaign.comparison import compare_models_as_far
    from validation.json_values import json_text
    from validation.output_folder import new_folder
    from validation.parameters import find_parameters
    from validation.press_files.fields_file import write_indentation
    from validation.press_files.picture import write_picture
    from validation.scene.cover_scene import show_indentation
    from validation.scene.draw import write_scene

    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        with Progress() as progress:
            comparison = compare_models_as_far(
                request.sensor,
                request.case,
                depth=request.depth,
                friction=request.friction,
                accuracy=request.accuracy,
                models=request.models,
                method=request.method,
                fields=folder is not None,
                parameters=find_parameters(request.sensor, progress) if "fast" in request.models else None,
                progress=progress,
            )
        if folder and comparison.fem:
            (folder / "press.json").write_text(json_text(comparison.as_json()), encoding="utf-8")
            files = ("press.json", *write_indentation(comparison.fem, folder), *write_picture(comparison, folder))
            files += write_scene(show_indentation(comparison.fem, comparison.sensor.array), folder)
    _show(comparison, json=json)
    if files:
        say(f"wrote {', '.join(files)} to {out}")
    if comparison.stopped:
        say(f"softcover: {comparison.stopped}")
    return NOT_CONVERGED if comparison.stopped else DONE


def _trace(request: _Request, points: int, out: Path, *, json: bool) -> int:
    """Compute a curve of load over depth by finite elements, print it and write it to `out`."""
    from validation.output_folder import new_folder
    from validation.press_files.curve import trace_curve
    from validation.sensor_file import SensorDescription

    case = request.case
    if not isinstance(request.sensor, SensorDescription):
        raise InputError("the finite elements need the description of the cover")
    with new_folder(out) as folder:
        with Progress() as progress:
            curve = trace_curve(
                request.sensor.layered_cover,
                request.sensor.array,
                case.indenter,
                points=points,
                load=case.load if request.depth is None else None,
                depth=request.depth,
                pose=case.pose,
                friction=request.friction,
                accuracy=request.accuracy,
                progress=progress,
            )
        files = curve.write(folder)
    if json:
        print_json(curve.as_json())
    else:
        print_table(("load [N]", "depth [mm]", "area [mm²]", "peak texel [N]", "energy [mJ]"), _list_points(curve))
    for sentence in curve.warnings:
        say(f"softcover: warning: {sentence}")
    if "fast" in request.models:
        say("the curve is that of the finite elements alone; the fast model was not computed")
    say(f"wrote {', '.join(files)} to {out}")
    if curve.stopped:
        say(f"{len(curve.indentations)} of {curve.wanted} points: {curve.stopped}")
    return NOT_CONVERGED if curve.stopped else DONE


def _list_points(curve: LoadCurve) -> Iterator[tuple[str, ...]]:
    """Yield load, depth, contact area, largest texel force and energy of each result as text."""
    for row in curve.rows():
        factors = {"load_N": 1, "depth_m": 1e3, "contact_area_m2": 1e6, "peak_texel_N": 1, "energy_J": 1e3}
        yield tuple(f"{factor * row[name]:.4g}" for name, factor in factors.items())


def _check_method(method: str, models: tuple[str, ...] | None, *, is_curve: bool) -> None:
    """Refuse a contact method of the fast model where the fast model is not computed.

    Raises:
        InputError: If only the finite elements are chosen, or a curve, which they compute alone.
    """
    if method == "default" or models is None or ("fast" in models and not is_curve):
        return
    reason = "--curve is computed by finite elements alone" if is_curve else "--model names the finite elements alone"
    raise InputError(f"--method: {reason}; leave --method out, which chooses how the fast model computes contact")


def _show(comparison: Comparison, *, json: bool) -> None:
    """Print the results, and write the warnings of both models to standard error."""
    if json:
        print_json(comparison.as_json())
    else:
        print_comparison(comparison)
    for result in (comparison.fem, comparison.fast):
        for sentence in result.warnings if result is not None else ():
            say(f"softcover: warning: {sentence}")
