"""The command `press` on a sensor with a curved cover."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.cli.curved.derive import describe_body, describe_known_errors, format_vector, judge_error, say_written
from validation.cli.failures import DONE
from validation.cli.meaning import print_meaning
from validation.cli.options import collect
from validation.cli.output import print_json, print_rows, print_table, say
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from meshes import Indenter, TexelArray
    from meshes.array_types import FloatArray
    from validation.curved.press import CurvedPress
    from validation.sensor_file import SensorDescription

#: Number of texels with the largest forces that are listed [-].
_LISTED = 8
#: Strains that the finite elements know.
STRAINS = ("small", "finite")
#: Component of a direction: a number without unit.
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\s*")


@dataclass(frozen=True, kw_only=True)
class PressText:
    """Options of a press as text.

    Attributes:
        indenter: The indenter.
        at: Place on the cover, or None.
        direction: Direction of motion, or None.
        yaw: Rotation about the axis of the indenter.
        strain: `small` or `finite`.
    """

    indenter: str
    at: str | None
    direction: str | None
    yaw: str
    strain: str = "small"


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
    from validation.curved.press import make_meshes
    from validation.curved.touch import find_touch_place

    if load is None or out is not None:
        faults = ["--depth: the fast model takes a load; write --load"] if load is None else []
        faults += ["--out: needs the finite elements; write --model fem,fast"] if out is not None else []
        raise InputError(*faults)
    shape, place, towards, angle = _read_text(text)
    with Progress() as progress:
        meshes = make_meshes(sensor, progress)
        touch = find_touch_place(meshes[-1], sensor.array, at=place, direction=towards, yaw=angle)
        cover = derive_fast_model(sensor, meshes, progress)
        if cover is None:
            raise InputError("--model: the meshes of this cover are too fine for the fast model; write --model fem")
        found = press_fast(cover, shape, touch, load)
    if json:
        about = {"sensor": sensor.name, "cover": sensor.describe_cover(), "indenter": text.indenter}
        pose = {"at": touch.point, "direction": touch.direction, "yaw": touch.yaw, "load": load}
        print_json({**about, **pose, "models": {"fast": found.as_json()}})
        return DONE
    rows = [
        ("cover", describe_body(sensor)),
        ("touched at", touch.describe()),
        ("force on the cover", f"({format_vector(found.force, 4)}) N, {load:.4f} N of it along the direction"),
        ("time", f"{1e3 * found.seconds:.0f} ms, without the derivation of the model"),
    ]
    print_rows(rows, title=f"{text.indenter} on {sensor.name}, {load:.4g} N, fast model")
    _print_texels(sensor.array, found.texel_forces, None)
    return DONE


def _read_text(text: PressText) -> tuple[Indenter, tuple[float, ...] | None, tuple[float, float, float] | None, float]:
    """Read indenter, place, direction and yaw; raise an InputError with one line per fault."""
    from validation.text.indenter import read_indenter, read_yaw

    faults: list[str] = []
    shape = collect(faults, lambda: read_indenter(text.indenter))
    place = collect(faults, lambda: _read_place(text.at))
    towards = collect(faults, lambda: read_direction(text.direction))
    angle = collect(faults, lambda: read_yaw(text.yaw))
    if text.strain not in STRAINS:
        faults.append(f"--strain: {text.strain[:40]!r} is neither of {' and '.join(STRAINS)}")
    if faults or shape is None or angle is None:
        raise InputError(*faults)
    return shape, place, towards, angle


def _compute(
    sensor: SensorDescription, text: PressText, force: tuple[float | None, float | None], *, fast: bool
) -> CurvedPress:
    from validation.curved.press import press_sensor

    shape, place, towards, angle = _read_text(text)
    with Progress() as progress:
        return press_sensor(
            sensor,
            shape,
            shape=text.indenter,
            load=force[0],
            depth=force[1],
            at=place,
            direction=towards,
            yaw=angle,
            finite=text.strain == "finite",
            fast=fast,
            progress=progress,
        )


def read_direction(text: str | None) -> tuple[float, float, float] | None:
    """Parse a direction, three numbers without unit such as `0,0,-1`.

    Raises:
        InputError: If the text is not three numbers, or all are zero.
    """
    if text is None:
        return None
    parts = text.split(",")
    if len(text) > 100 or len(parts) != 3 or not all(map(_NUMBER.fullmatch, parts)):  # noqa: PLR2004
        raise InputError(f"--direction: {text[:80]!r} is not three numbers x,y,z; write for example --direction=0,0,-1")
    x, y, z = map(float, parts)
    if not 0 < max(abs(x), abs(y), abs(z)) < float("inf"):
        raise InputError("--direction: must not be zero; write for example --direction=0,0,-1")
    return x, y, z


def _read_place(text: str | None) -> tuple[float, ...] | None:
    from validation.text.quantity import read_quantities

    if text is None:
        return None
    count = 3 if text.count(",") >= 2 else 2  # noqa: PLR2004 -- three lengths have two commas
    return read_quantities(text, "length", count, place="--at")


def _print_press(press: CurvedPress) -> None:
    """Print the result of one indentation as tables and sentences."""
    found, array = press.fem, press.sensor.array
    print_rows(_list_press(press), title=f"{press.shape} on {press.sensor.name}, {found.load:.4g} N")
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
    yield "cover", describe_body(press.sensor)
    yield "touched at", press.touch.describe()
    yield "force on the cover", f"({format_vector(found.force, 4)}) N, {found.load:.4f} N of it along the direction"
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
    quality = f"{len(found.mesh.cells)} {'hexahedra' if found.mesh.is_hexahedral else 'tetrahedra'}"
    yield "finest mesh", f"{quality}, {found.mesh.digest[:12]}; {press.seconds:.1f} s"


def _explain_press(press: CurvedPress) -> Iterator[str]:
    found = press.fem
    yield (
        "The force on a texel is the resultant on it along its own normal, so forces on a curved base do not sum to "
        "the load; the balance is that of the two vectors above."
    )
    yield judge_error(found.error_estimate.get("texel_forces", float("nan")), "the forces on the texels")
