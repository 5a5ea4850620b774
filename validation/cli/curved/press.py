"""The command `press` on a sensor with a curved cover."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.cli.curved.derive import describe_body, format_vector, judge_error
from validation.cli.failures import DONE
from validation.cli.meaning import print_meaning
from validation.cli.options import collect
from validation.cli.output import describe_errors, print_json, print_rows, print_table, say
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.curved.press import CurvedPress
    from validation.sensor_file import SensorDescription

#: Number of texels with the largest forces that are listed [-].
_LISTED = 8
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
    """

    indenter: str
    at: str | None
    direction: str | None
    yaw: str


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
        raise InputError("--model: curved covers are pressed by finite elements only; write --model fem")
    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        press = _compute(sensor, text, force)
        if folder:
            from validation.curved.files import write_press

            files = write_press(press, folder)
    if json:
        print_json(press.as_json())
    else:
        _print_press(press)
    for sentence in press.fem.warnings:
        say(f"softcover: warning: {sentence}")
    if "fast" in models:
        say("softcover: note: curved covers are pressed by finite elements only; --model fem says so")
    if files:
        say(f"wrote {', '.join(files)} to {out}")
    return DONE


def _compute(sensor: SensorDescription, text: PressText, force: tuple[float | None, float | None]) -> CurvedPress:
    from validation.curved.press import press_sensor
    from validation.text.indenter import read_indenter, read_yaw

    faults: list[str] = []
    shape = collect(faults, lambda: read_indenter(text.indenter))
    place = collect(faults, lambda: _read_place(text.at))
    towards = collect(faults, lambda: read_direction(text.direction))
    angle = collect(faults, lambda: read_yaw(text.yaw))
    if faults or shape is None or angle is None:
        raise InputError(*faults)
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
    order = np.argsort(-np.abs(found.texel_forces), kind="stable")[:_LISTED]
    rows = [
        (str(number), format_vector(1e3 * array.centres[number]), f"{1e3 * found.texel_forces[number]:.2f}")
        for number in order
        if found.texel_forces[number]
    ]
    print_table(("texel", "centre [mm]", "force [mN]"), rows, title="Texels with the largest forces")
    print_meaning(_explain_press(press))


def _list_press(press: CurvedPress) -> Iterator[tuple[str, str]]:
    found = press.fem
    yield "cover", describe_body(press.sensor)
    yield "touched at", press.touch.describe()
    yield "force on the cover", f"({format_vector(found.force, 4)}) N, {found.load:.4f} N of it along the direction"
    yield "force on the base", f"({format_vector(found.base_force, 4)}) N"
    yield "not measured", f"({format_vector(found.unmeasured, 4)}) N: beside the texels and shear along them"
    yield "depth", f"{1e3 * found.depth:.4f} mm; contact area {1e6 * found.contact_area:.3f} mm²"
    yield "error estimate", describe_errors(found.error_estimate)
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
