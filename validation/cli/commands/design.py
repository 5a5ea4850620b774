"""The command `softcover design`, which compares thicknesses, hardnesses and pitches of a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.resolution.design import Designs

Range = Annotated[str, Parameter(metavar="FROM:TO:COUNT", allow_leading_hyphen=True)]


def design(
    sensor: options.SensorFile = "wts-0614-34",
    *,
    thickness: Range = "1mm:6mm",
    hardness: options.Text | None = None,
    tolerance: float | None = None,
    pitch: Range | None = None,
    load: options.Force = "1N",
    noise: options.Force | None = None,
    radius: options.Length | None = None,
    ball: options.Length | None = None,
    out: options.Folder | None = None,
    json: options.Json = False,
) -> None:
    """Compare thicknesses, hardnesses and pitches: error of place, spread, least force, load range; and the best.

    The numbers are those of `softcover limits`, for flat wide covers. Layers keep their proportions, the array its
    number of texels, and a texel its electronics.

    Examples of use:

        softcover design wts-0614-34 --thickness 1mm:5mm --load 1N --noise 5mN
        softcover design wts-0614-34 --thickness 1mm:5mm:9 --pitch 2mm:5mm:4 --noise 5mN --out designs
        softcover design sensor.toml --hardness 30A:60A:4 --tolerance 5 --ball 5mm --noise 5mN --out designs

    Args:
        thickness: Thicknesses of the cover: FROM:TO for eleven, FROM:TO:COUNT, or one, e.g. 1mm:5mm:9.
        hardness: Hardnesses of the softest layer, e.g. 30A:60A:4; the modulus of the sensor when not given.
        tolerance: Tolerance of the hardness in its units, which gives every number a band; 5 when not given.
        pitch: Smaller pitches of the array, e.g. 2mm:5mm:4; that of the sensor when not given.
        load: Force of a touch, e.g. 0.3N.
        noise: Standard deviation of the noise of a texel's force, e.g. 5mN; that of the sensor when not given, or one
            count.
        radius: Radius of a touch, e.g. 1mm; 0mm for a point, the default.
        ball: Radius of a ball that touches, e.g. 5mm; the radius of the touch then follows from the hardness.
        out: Write a page with maps, and design.json, to this folder.
    """
    from validation.resolution import verb

    with output.Progress() as progress:
        found = verb.design(
            options.read_description(sensor, any_cover=True), thickness=thickness, hardness=hardness,
            tolerance=tolerance, pitch=pitch, load=load, noise=noise, radius=radius, ball=ball, out=out,
            progress=progress,
        )  # fmt: skip
    output.print_json(found.as_json()) if json else _print(found)
    if out is not None:
        output.say(f"wrote {out / 'index.html'}")


def _print(found: Designs) -> None:
    from validation.resolution.design_page import tabulate_best, tabulate_designs

    for axis in found.varied:
        title = f"Designs of {found.sensor} by {axis}, else at the best"
        output.render(tabulate_designs(found, found.line(axis), [axis], caption=title))
    output.render(tabulate_best(found), lines=False)
    output.print_meaning(found.explain())
