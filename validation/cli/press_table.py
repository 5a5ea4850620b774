"""Printing of the results of one indentation as images and a table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from validation.cli.meaning import explain_comparison
from validation.cli.output import describe_cover, describe_errors, make_console, print_meaning, print_rows
from validation.render import escape

if TYPE_CHECKING:
    from validation.campaign.comparison import Comparison


def print_comparison(comparison: Comparison) -> None:
    """Print the images of texel forces of the chosen models, their results and their scores."""
    from validation.cli.heat_map import draw_force_images
    from validation.press_files.picture import list_images
    from validation.sensor_file import SensorDescription

    console = make_console()
    case, sensor, array = comparison.case, comparison.sensor, comparison.sensor.array
    console.print(escape(f"{case.shape} on {array.name}, {case.load:.4g} N at {case.place}"), markup=False)
    if isinstance(sensor, SensorDescription):
        console.print(escape(f"cover: {describe_cover(sensor.cover)}") + "\n", markup=False)
    images = list(list_images(comparison))
    console.print(draw_force_images(array, images, width=console.width))
    print_rows(_list_results(comparison))
    print_meaning(explain_comparison(comparison))


def _list_results(comparison: Comparison) -> Iterator[tuple[str, str]]:
    """Yield name and text of the results of each model and, if there are results of both models, of the scores."""
    from validation.metrics import TABULATED

    fem, fast = comparison.fem, comparison.fast
    if fem is not None and "fem" in comparison.models:
        errors = describe_errors(fem.error_estimate)
        assumptions = ", ".join(f"{name}: {value}" for name, value in fem.assumptions.items())
        yield "finite elements", f"{fem.total_force:.4f} N, {_format_force(fem.outside)} of it outside the array"
        yield "", f"depth {1e3 * fem.depth:.4f} mm, contact area {1e6 * fem.contact_area:.3f} mm²"
        if fem.energy is not None:
            yield "", f"elastic energy {1e3 * fem.energy:.4g} mJ"
        yield "", f"error estimate {errors}"
        yield "", f"assumes {assumptions}; {fem.seconds:.2f} s"
    if fast is not None:
        where = "outside the array" if comparison.sensor.array.planar else "not along the normals of texels"
        yield "fast model", f"{fast.total_force:.4f} N, {_format_force(fast.outside)} of it {where}"
        yield "", f"{fast.seconds:.3f} s"
    if comparison.score is not None:
        values = comparison.score.as_json()
        for index, (name, metric) in enumerate(TABULATED.items()):
            text = f"{metric.heading}: {metric.text(values[name])} {metric.unit}".rstrip()
            yield "" if index else "fast against finite", text


def _format_force(value: float) -> str:
    # Adding 0.0 removes the minus sign of a value that is rounded to negative zero.
    return f"{round(value, 4) + 0.0:.4f} N"
