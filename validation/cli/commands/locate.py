"""The command `softcover locate`, which finds touches in the frames of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.resolution.locate import Estimate, Located

#: Largest number of printed rows; the file of `--out` holds all.
_ROWS = 20


def locate(
    sensor: options.SensorFile,
    file: options.RecordingFile,
    *,
    touches: Annotated[int, Parameter(metavar="COUNT")] = 1,
    radius: Annotated[str | None, Parameter(metavar="LENGTH|FROM:TO", allow_leading_hyphen=True)] = None,
    noise: options.Force | None = None,
    cover: options.CoverChanges = options.UNCHANGED,
    array: options.PressedArrayIndex = None,
    topic: options.Topic = None,
    out: options.File | None = None,
    picture: options.File | None = None,
    json: options.Json = False,
) -> None:
    """Find the place, force and radius of touches in each frame of a recording, with intervals that hold 95 %.

    A frame that tells no touch, or less than it seems to, says so in words.

    Examples of use:

        softcover locate wts-0614-34 touch.mcap --noise 5mN
        softcover locate wts-0614-34 two.csv --touches 2 --out touches.csv
        softcover locate sensor.toml touch.mcap --radius 0mm:2mm --picture touch.png

    Args:
        touches: Number of touches in a frame, 1 to 4.
        radius: Radius of the touches, or its range, e.g. 0mm:2mm; from 0 to one pitch when not given.
        noise: Standard deviation of the noise of a texel's force, e.g. 5mN; that of the sensor when not given, or one
            count.
        out: Write all touches as CSV.
        picture: Draw the brightest frame with its touches, a .png or .svg file.
    """
    from meshes import Cover
    from validation.resolution import verb

    description = options.read_description(sensor, cover, any_cover=True)
    with output.Progress() as progress:
        found = verb.locate(
            description, file, touches=touches, radius=radius, noise=noise, array=array, topic=topic, out=out,
            picture=picture, progress=progress,
        )  # fmt: skip
    output.print_json(found.as_json()) if json else _print(found, flat=isinstance(description.cover, Cover))
    for path in filter(None, (out, picture)):
        output.say(f"wrote {path}")


def _print(found: Located, *, flat: bool) -> None:
    rows, rest = [], 0
    touched = [frame for frame in found.frames if frame.touches]
    if touched and len(found.frames) > _ROWS:  # Frames at rest would hide the touches.
        rest = len(found.frames) - len(touched)
    for frame in touched if rest else found.frames:
        for touch in frame.touches or (None,):
            x, y, z, force, radius = (touch.x, touch.y, touch.z, touch.force, touch.radius) if touch else (None,) * 5
            places = [_show(each, 1e3) for each in ((x, y) if flat else (x, y, z))]
            words = "; ".join(frame.words)
            rows.append([f"{frame.time:.2f}", *places, _show(force, 1.0), _show(radius, 1e3), words])
    head = ("time [s]", "x [mm]", "y [mm]", *(() if flat else ("z [mm]",)), "force [N]", "radius [mm]", "")
    output.print_table(head, rows[:_ROWS], title=f"Touches of {found.sensor}", lines=False)
    left = {"more rows": max(0, len(rows) - _ROWS), "at rest": rest}
    if words := " and ".join(f"{count} {name}" for name, count in left.items() if count):
        output.show(f"... and {words}; --out FILE or --json has all\n")
    output.print_meaning(found.explain())


def _show(estimate: Estimate | None, factor: float) -> str:
    """Return an estimate and half its interval, or a dash where there is none."""
    if estimate is None:
        return "\u2013"
    half = factor * (estimate.high - estimate.low) / 2
    return f"{factor * estimate.value:.2f} \u00b1 {half:.2f}"
