"""The command `softcover limits`, which prints the smallest errors and forces that a sensor can tell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from validation.cli import options, output

if TYPE_CHECKING:
    from validation.resolution.limits import Limits

#: Printed unit and factor by the unit of a limit.
_UNITS = {"m": ("um", 1e6), "N": ("mN", 1e3), "mm": ("mm", 1e3)}


def limits(
    sensor: options.SensorFile,
    *,
    load: options.Force = "1N",
    noise: options.Force | None = None,
    two: options.Length | None = None,
    radius: options.Length = "0mm",
    thicknesses: options.Span | None = None,
    prior: Literal["around", "between"] = "around",
    cover: options.CoverChanges = options.UNCHANGED,
    picture: options.File | None = None,
    json: options.Json = False,
) -> None:
    """Compute the smallest errors of place, force, radius and separation, and the least force that a sensor detects.

    Errors are standard deviations, root mean squares over touches within a pitch around the middle texel. The bound of
    Cramer and Rao counts where three texels are lit and it is below a tenth of the pitch; elsewhere that of the
    posterior does, for a place anywhere within the pitch. 90 % of touches with the least force are detected, with
    0.1 % of false alarms.

    Examples of use:

        softcover limits wts-0614-34 --noise 5mN
        softcover limits wts-0614-34 --noise 5mN --load 0.3N --two 3mm --radius 1mm
        softcover limits sensor.toml --thicknesses 1mm:6mm
        softcover limits wts-0614-34 --noise 5mN --picture limits.png

    Args:
        load: Force of a touch, e.g. 0.3N.
        noise: Standard deviation of the noise of a texel's force, e.g. 5mN; that of the sensor when not given, or one
            count.
        two: Distance of two touches whose separation is told, e.g. 3mm.
        radius: Radius of a touch, e.g. 1mm; 0mm for a point.
        thicknesses: Also compute eleven thicknesses of a flat cover from the first to the second, e.g. 1mm:6mm.
        prior: Where a touch may be: within a pitch around the middle texel, or between it and the next
            ones.
        picture: Draw the error of place above every texel, a .png or .svg file.
    """
    from validation.resolution import verb

    description = options.read_description(sensor, cover, any_cover=True)
    with output.Progress() as progress:
        found = verb.limits(
            description, load=load, noise=noise, two=two, radius=radius, thicknesses=thicknesses, prior=prior,
            picture=picture, progress=progress,
        )  # fmt: skip
    output.print_json(found.as_json()) if json else _print(found)
    if picture is not None:
        output.say(f"wrote {picture}")


def _print(found: Limits) -> None:
    alone = {each.name: each.value for each in found.ideal}
    rows = [
        (each.name, *(_show(each.unit, value) for value in (alone[each.name], each.bound, each.posterior, each.value)))
        for each in found.counted
    ]
    output.print_table(("", "noise alone", "bound", "posterior", "as counted"), rows, title=f"Limits of {found.sensor}")
    if found.thicknesses:
        units = {"thickness_m": "mm", "ideal_m": "m", "counted_m": "m", "least_force_N": "N"}
        output.print_table(
            ("thickness", "place, noise alone", "place, as counted", "least force"),
            [[_show(units[key], value) for key, value in row.items()] for row in found.thicknesses],
            title="Error of place per axis, force known, by the thickness of the cover",
        )
    output.print_meaning(found.explain())


def _show(unit: str, value: float | None) -> str:
    """Return a number in its printed unit, or a dash where there is none."""
    from validation.results import DASH, format_digits

    name, factor = _UNITS[unit]
    return DASH if value is None else f"{format_digits(factor * value, 3)} {name}"
