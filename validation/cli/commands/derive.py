"""The command `softcover derive`, which computes the parameters of a sensor's fast model by finite elements."""

from __future__ import annotations

from typing import Literal

from validation.cli import options, output
from validation.cli.entry import DONE, OUTSIDE_FAILED


def derive(
    sensor: options.SensorFile,
    *,
    cover: options.CoverChanges = options.UNCHANGED,
    out: options.Folder | None = None,
    format: Literal["png", "svg"] = "png",  # noqa: A002 -- the option's name
    json: options.Json = False,
) -> int:
    """Compute the point spread function of a sensor's cover, and fit the fast model's parameters to it.

    Prints sigma and ksize of the Gaussian kernel and the share of the load that the kernel puts on wrong texels; sigma
    by every other estimator; the two-point resolution, which is the smallest distance of two equal loads with a dip
    between them, at the cover's base and in the texel values; the change of sigma with thickness and Poisson ratio; and
    the error estimate of the finite elements.

    Young's modulus has no effect on the point spread function: a softer cover of the same thickness and Poisson ratio
    spreads a given pressure just as far.  With several layers, the ratios of their moduli have an effect.  The modulus
    determines the depth and the contact area of an indenter: see `softcover press`.

    Examples of use:

        softcover derive wts-0614-34
        softcover derive sensor.toml --out derived
        softcover derive wts-0614-34 --material dragon-skin-30 --thickness 3mm --json
        softcover derive fingertip --out fingertip

    Args:
        out: Folder for the files; an earlier result is replaced.
        format: Format of the picture.
    """
    from validation import api
    from validation.scene.draw import lacks_picture

    description = options.read_description(sensor, cover, any_cover=True)
    with output.Progress() as progress:
        found = api.derive(description, out=out, format=format, progress=progress)
    result = found.result
    if json:
        output.print_json(result.as_json())
    else:
        import numpy as np

        from validation.cli.heat_map import draw_share_image
        from validation.render.table import tabulate_facts

        *_, uniform, _ = found.maps.values()
        output.show_wrapped(f"{description.name}, cover {output.describe_cover(description.cover)}", further="  ")
        output.render(tabulate_facts("responses", "Responses of the texels", result))
        output.show("Uniform load on one texel: share of it on each texel, %")
        output.make_console().print(draw_share_image(np.asarray(found.sensor.array.image(uniform), dtype=np.float64)))
        remedy = "take it as their uncertainty, and check a touch of yours by `softcover press`"
        output.print_meaning([*result.notes, *found.explain(), output.explain_error(result.error_estimate, remedy)])
    for sentence in result.warnings:
        output.say(f"softcover: warning: {sentence}")
    if out is None:
        return DONE
    if found.parameters.surface is None:
        output.say(
            "softcover: note: the parameters hold the spread of forces alone, and no contact of the cover; meshes may "
            "be too fine (cover.element_size), or texels form no regular grid"
        )
    files = tuple(sorted(each.name for each in out.iterdir() if not each.name.startswith(".")))
    output.say(f"wrote {', '.join(files)} to {out}")
    return OUTSIDE_FAILED if lacks_picture(files) else DONE
