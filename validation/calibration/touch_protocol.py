"""The verb `next_touches`: reads the options, chooses touches, and writes the protocol of a measurement."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import Cover
from validation.api import describe
from validation.calibration.next_touches import WANTED, Errors, NextTouches, plan_touches
from validation.errors import Faults, InputError, check_choice
from validation.extras import require
from validation.output_folder import optional_folder
from validation.press_files import write_rows
from validation.render.figure import COLUMN, open_figure, save_figure
from validation.sensor_file import SensorDescription
from validation.text.quantity import read_positive

if TYPE_CHECKING:
    from validation.calibration.calibrate import Calibration

#: Largest number of touches that are planned, and of touches times texels [-].
_MOST, _MOST_PRODUCT = 500, 40000
#: Height of the tool over the cover between touches, and distance from which each place is approached along x and y, so
#: that the play of the axes is always taken up in one direction [mm].
_CLEARANCE, _APPROACH = 5.0, 1.0
#: Largest lengths over the pitch [-], and largest load [N].
_FARTHEST, _HEAVIEST = 20.0, 1e4
_PROTOCOL = """# Touches of {sensor}

Press each place with a tool that loads a circle of {size:g} mm radius, wait as the recordings before, record, release.
Approach each place from the same side. Name each recording by its number.

{says}

| made | touch | texel | x [mm] | y [mm] | z [mm] | load [N] |
|---|---|---|---|---|---|---|
{rows}

Half widths of the 95 % intervals, before and after these touches:

{expected}
"""


def next_touches(
    sensor: SensorDescription | str | Path,
    count: int,
    *,
    after: Calibration | None = None,
    load: str = "1 N",
    radius: str = "1 mm",
    noise: str | None = None,
    place_error: str = "0.1 mm",
    shift_error: str = "0.3 mm",
    force_error: float = 0.01,
    want: Sequence[str] = ("gains", "thickness"),
    out: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextTouches:
    """Choose the touches that settle gains and cover best, and predict the intervals that they will give.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        count: Number of touches.
        after: Calibration whose recordings count as made; flat covers only.
        load: Force of each touch.
        radius: Radius of the circle that the tool loads.
        noise: Standard deviation of the noise of a texel's force; that of the sensor, or one count, when not given.
        place_error: Standard deviation of the place of each touch per axis.
        shift_error: Standard deviation of the shift of all touches together, per axis.
        force_error: Relative standard deviation of the force of each touch, 0..1 [-].
        want: What the touches are to settle, some of `gains`, `thickness`, `poisson`.
        out: Folder for the protocol; None to write none.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option cannot be read, or cannot be used with this cover.
        MissingExtraError: If finite elements are needed and not installed.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    description = describe(sensor)
    _check(description, count, force_error, want, after)
    faults, far = Faults(), _FARTHEST * min(description.array.pitch)
    force = faults.read(read_positive, load, "force", _HEAVIEST, place="--load")
    size = faults.read(read_positive, radius, "length", far, place="--radius", zero=True)
    sigma = noise and faults.read(read_positive, noise, "force", _HEAVIEST, place="--noise")
    own = faults.read(read_positive, place_error, "length", far, place="--place-error", zero=True)
    common = faults.read(read_positive, shift_error, "length", far, place="--shift-error", zero=True)
    faults.refuse()
    require("skfem", useful=("matplotlib",) if out else ())
    with optional_folder(out, "--plan") as folder:
        found = plan_touches(
            description,
            count,
            errors=Errors(place=own, shift=common, force=force_error),
            load=force,
            radius=size,
            noise=sigma or None,
            wanted=want,
            earlier=None if after is None else np.where(np.isnan(after.touches), size, after.touches),
            progress=progress,
        )
        if folder is not None:
            _write(found, description, folder)
    return found


def _check(
    sensor: SensorDescription, count: int, force_error: float, want: Sequence[str], after: Calibration | None
) -> None:
    """Check number of touches, error of force, what is wanted, and that the cover can have them.

    Raises:
        InputError: If one is out of its range.
    """
    most = min(_MOST, _MOST_PRODUCT // sensor.array.count)
    if not 1 <= count <= most:
        raise InputError(f"--next: must lie in 1..{most} for {sensor.array.count} texels, not {count}")
    if not 0 <= force_error < 1:
        raise InputError(f"--force-error: must lie in 0..1, such as 0.01 for 1 %, not {force_error:g}")
    for each in want:
        check_choice("--want", "quantity", each, WANTED)
    flat = isinstance(sensor.cover, Cover)
    if not want or (not flat and set(want) != {"gains"}):
        raise InputError(f"--want: name {', '.join(WANTED) if flat else 'gains alone: the cover is curved'}")
    if after is not None and not flat:
        raise InputError("--next: after recordings, touches are planned on flat covers; leave the recordings out")


def _write(found: NextTouches, sensor: SensorDescription, folder: Path) -> None:
    """Write table, protocol, path of a printer and picture of planned touches into a folder."""
    rows = [
        (number, each.texel, *(f"{1e3 * value:.3f}" for value in each.at), f"{each.load:g}")
        for number, each in enumerate(found.touches, 1)
    ]
    write_rows(folder / "touches.csv", ("touch", "texel", "x [mm]", "y [mm]", "z [mm]", "load [N]"), rows)
    lines = "\n".join(f"| [ ] | {' | '.join(map(str, row))} |" for row in rows)
    expected = "\n".join(f"- {name}: {before}, then {after}" for name, before, after in found.list_expected())
    (folder / "protocol.md").write_text(
        _PROTOCOL.format(
            sensor=found.sensor, size=1e3 * found.radius, rows=lines, expected=expected, says="\n".join(found.explain())
        )
    )
    if isinstance(sensor.cover, Cover):
        (folder / "touches.gcode").write_text("\n".join(_list_moves(found)) + "\n")
    save_figure(folder / "touches.png", lambda path: _draw(found, sensor, path))


def _list_moves(found: NextTouches) -> Iterator[str]:
    """Yield the lines of a G-code file: absolute moves in mm, and a pause over each place."""
    yield "; origin: middle of the array on top of its cover, x along the rows, z upwards; set it with G92 X0 Y0 Z0"
    yield "; each place is approached from -x and -y; M0 waits: press, record, release, then go on"
    yield from ("G21", "G90", f"G0 Z{_CLEARANCE:.3f}")
    for number, each in enumerate(found.touches, 1):
        x, y = (1e3 * value for value in each.at[:2])
        yield f"G0 X{x - _APPROACH:.3f} Y{y - _APPROACH:.3f}"
        yield f"G1 X{x:.3f} Y{y:.3f} Z{_CLEARANCE:.3f} F600"
        yield f"M0 ; touch {number}: {each.load:g} N"
    yield "M2"


def _draw(found: NextTouches, sensor: SensorDescription, path: Path) -> None:
    """Draw the places of the touches on the array, with their numbers."""
    array = sensor.array
    places = np.array([each.at[:2] for each in found.touches]) * 1e3
    with open_figure(path, height=COLUMN, width=COLUMN) as figure:
        axes = figure.subplots()
        half = 500 * np.array(array.texel_size)
        square = half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
        for centre in 1e3 * array.centres[array.active, :2]:
            axes.fill(*(centre + square).T, facecolor="#eee", edgecolor="#bbb")
        spots: dict[tuple[float, float], list[str]] = {}
        for number, (x, y) in enumerate(places.tolist(), 1):
            spots.setdefault((x, y), []).append(str(number))
        axes.plot(*places.T, "o", markersize=3)
        for place, numbers in spots.items():
            axes.annotate(",".join(numbers), place, xytext=(2, 2), textcoords="offset points", fontsize=6)
        axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title=f"{found.sensor}: touches in their order")
