"""The command `press` on a sensor with a curved cover."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.campaign.case import describe_pose, tabulate_pose
from validation.cli.curved.derive import describe_known_errors, format_vector, judge_error, say_written
from validation.cli.entry import DONE
from validation.cli.options import collect
from validation.cli.output import Progress, describe_cover, print_json, print_meaning, print_rows, print_table, say
from validation.cli.press_options import read_friction_option
from validation.errors import InputError

if TYPE_CHECKING:
    from meshes import Indenter, TexelArray
    from meshes.array_types import FloatArray
    from validation.curved.places import PoseText
    from validation.curved.press import CurvedPress
    from validation.sensor_file import SensorDescription

#: Number of texels with the largest forces that are listed [-].
_LISTED = 8
#: Strains that the finite elements know.
STRAINS = ("small", "finite")


@dataclass(frozen=True, kw_only=True)
class PressText:
    """Options of a press as text.

    Attributes:
        indenter: The indenter.
        at: Place on the cover, or None.
        direction: Direction of motion, or None.
        yaw: Rotation about the axis of the indenter.
        tilt: Rotations about its x and y axes.
        strain: `small` or `finite`.
        friction: Coefficient of friction or `no-slip`; that of the sensor file if None.
    """

    indenter: str
    at: str | None
    direction: str | None
    yaw: str
    tilt: str = "0deg,0deg"
    strain: str = "small"
    friction: str | None = None


def press_curved_cover(
    sensor: SensorDescription,
    text: PressText,
    *,
    force: tuple[float | None, float | None],
    models: tuple[str, ...],
    out: Path | None,
    json: bool,
) -> int:
    """Run the command `press` on a curved cover.

    Args:
        sensor: The sensor.
        text: Indenter, place and direction.
        force: Load [N] and depth [m], one of which is None.
        models: Wanted models.
        out: Folder for the files, or None.
        json: Whether the result is printed as JSON.

    Raises:
        InputError: With one line per fault.
    """
    from validation.output_folder import new_folder

    if "fem" not in models:
        return press_by_fast_model(sensor, text, force[0], out, json=json)
    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        press = _compute(sensor, text, force, fast="fast" in models)
        if folder:
            from validation.curved.files import write_press

            files = write_press(press, folder)
    if json:
        print_json(press.as_json())
    else:
        _print_press(press)
    for sentence in press.fem.warnings:
        say(f"softcover: warning: {sentence}")
    if "fast" in models and press.fast is None:
        say("softcover: note: the meshes of this cover are too fine for the fast model; --model fem leaves it out")
    return say_written(files, out)


def press_by_fast_model(
    sensor: SensorDescription, text: PressText, load: float | None, out: Path | None, *, json: bool
) -> int:
    """Run the command `press` on a curved cover with the fast model alone, which needs a load.

    Raises:
        InputError: With one line per fault.
    """
    from validation.curved.fast import derive_fast_model, press_fast
    from validation.curved.places import CurvedPlaces
    from validation.curved.press import make_meshes

    read_friction_option(text.friction, used=False)
    if load is None or out is not None:
        faults = ["--depth: the fast model takes a load; write --load"] if load is None else []
        faults += ["--out: needs the finite elements; write --model fem,fast"] if out is not None else []
        raise InputError(*faults)
    shape, pose = _read_text(text, sensor)
    with Progress() as progress:
        meshes = make_meshes(sensor, progress)
        touch = CurvedPlaces(mesh=meshes[-1], texels=sensor.array).find(pose)
        cover = derive_fast_model(sensor, meshes, progress)
        if cover is None:
            raise InputError("--model: the meshes of this cover are too fine for the fast model; write --model fem")
        found = press_fast(cover, shape, touch, load)
    if json:
        about = {"sensor": sensor.name, "cover": sensor.describe_cover(), "indenter": text.indenter, "load": load}
        asked = {"wanted": {"load": load}, "stopped": None, **tabulate_pose(touch)}
        print_json({**about, **asked, "models": {"fast": found.as_json()}, "scores": None})
        return DONE
    rows = [
        ("cover", describe_cover(sensor.cover)),
        ("touched at", describe_pose(touch)),
        ("force on the cover", f"({format_vector(found.force, 4)}) N, {load:.4f} N of it along the direction"),
        ("time", f"{1e3 * found.seconds:.0f} ms, without the derivation of the model"),
    ]
    print_rows(rows, title=f"{text.indenter} on {sensor.name}, {load:.4g} N, fast model")
    _print_texels(sensor.array, found.texel_forces, None)
    return DONE


def _read_text(text: PressText, sensor: SensorDescription) -> tuple[Indenter, PoseText]:
    """Read indenter and pose; raise an InputError with one line per fault."""
    from validation.curved.places import read_pose
    from validation.text.indenter import read_indenter

    faults: list[str] = []
    shape = collect(faults, lambda: read_indenter(text.indenter))
    given = {"at": text.at, "direction": text.direction, "yaw": text.yaw, "tilt": text.tilt}
    texts = {name: value for name, value in given.items() if value is not None}
    pose = collect(faults, lambda: read_pose(texts, "--", planar=sensor.array.planar))
    if text.strain not in STRAINS:
        faults.append(f"--strain: {text.strain[:40]!r} is neither of {' and '.join(STRAINS)}")
    if faults or shape is None or pose is None:
        raise InputError(*faults)
    return shape, pose


def _compute(
    sensor: SensorDescription, text: PressText, force: tuple[float | None, float | None], *, fast: bool
) -> CurvedPress:
    from validation.curved.press import press_sensor

    shape, pose = _read_text(text, sensor)
    friction = read_friction_option(text.friction, used=True)
    with Progress() as progress:
        return press_sensor(
            sensor,
            shape,
            shape=text.indenter,
            load=force[0],
            depth=force[1],
            pose=pose,
            finite=text.strain == "finite",
            friction=friction,
            fast=fast,
            progress=progress,
        )


def _print_press(press: CurvedPress) -> None:
    """Print the result of one indentation as tables and sentences."""
    found, array = press.fem, press.sensor.array
    print_rows(_list_press(press), title=f"{press.shape} on {press.sensor.name}, {found.total_force:.4g} N")
    _print_texels(array, found.texel_forces, press.fast.texel_forces if press.fast else None)
    print_meaning(_explain_press(press))


def _print_texels(array: TexelArray, forces: FloatArray, fast: FloatArray | None) -> None:
    """Print the texels with the largest forces [N], by one model or two."""
    order = np.argsort(-np.abs(forces), kind="stable")[:_LISTED]
    columns = [forces] if fast is None else [forces, fast]
    rows = [
        (str(number), format_vector(1e3 * array.centres[number]), *(f"{1e3 * each[number]:.2f}" for each in columns))
        for number in order
        if forces[number]
    ]
    heads = ("force [mN]",) if fast is None else ("force [mN]", "fast model [mN]")
    print_table(("texel", "centre [mm]", *heads), rows, title="Texels with the largest forces")


def _list_press(press: CurvedPress) -> Iterator[tuple[str, str]]:
    found = press.fem
    yield "cover", describe_cover(press.sensor.cover)
    for line in press.sensor.cover.notes:
        yield "note", line
    yield "touched at", describe_pose(press.touch)
    along = f"{found.total_force:.4f} N of it along the direction"
    yield "force on the cover", f"({format_vector(found.force, 4)}) N, {along}"
    yield "force on the base", f"({format_vector(found.base_force, 4)}) N"
    yield "not measured", f"({format_vector(found.unmeasured, 4)}) N: beside the texels and shear along them"
    yield "depth", f"{1e3 * found.depth:.4f} mm; contact area {1e6 * found.contact_area:.3f} mm²"
    yield "error estimate", describe_known_errors(found.error_estimate)
    if press.fast is not None and press.fast.misplaced is not None:
        yield (
            "fast model",
            f"misplaces {100 * press.fast.misplaced:.2f} % of the load; {1e3 * press.fast.seconds:.0f} ms",
        )
    yield "assumes", "; ".join(f"{name}: {value}" for name, value in found.assumptions.items())
    if found.mesh is not None:
        quality = f"{len(found.mesh.cells)} {'hexahedra' if found.mesh.is_hexahedral else 'tetrahedra'}"
        yield "finest mesh", f"{quality}, {found.mesh.digest[:12]}; {press.seconds:.1f} s"


def _explain_press(press: CurvedPress) -> Iterator[str]:
    found = press.fem
    yield (
        "The force on a texel is the resultant on it along its own normal, so forces on a curved base do not sum to "
        "the load; the balance is that of the two vectors above."
    )
    yield judge_error(found.error_estimate.get("peak_texel", float("nan")), "the forces on the texels")
