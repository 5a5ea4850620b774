"""Printing of the results of one indentation as images and a table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from validation.cli.meaning import explain_comparison
from validation.cli.output import describe_cover, describe_errors, make_console, print_meaning, print_rows
from validation.render import escape

if TYPE_CHECKING:
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison


def print_comparison(comparison: Comparison) -> None:
    """Print the images of texel forces of the chosen models, their results and their scores."""
    from validation.cli.heat_map import draw_force_images
    from validation.press_files import list_images
    from validation.sensor_file import SensorDescription

    console = make_console()
    case, sensor, array = comparison.case, comparison.sensor, comparison.sensor.array
    console.print(escape(f"{case.shape} on {array.name}, {case.load:.4g} N at {case.place}"), markup=False)
    if isinstance(sensor, SensorDescription):
        notes = "".join(f"; {sentence}" for sentence in sensor.cover.notes)
        console.print(escape(f"cover: {describe_cover(sensor.cover)}{notes}") + "\n", markup=False)
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
        on_mesh = fem.mesh is not None
        yield "finite elements", _describe_force(fem.total_force, fem.outside, along=on_mesh)
        yield "", f"depth {1e3 * fem.depth:.4f} mm, contact area {1e6 * fem.contact_area:.3f} mm²"
        if fem.energy is not None:
            yield "", f"elastic energy {1e3 * fem.energy:.4g} mJ"
        if on_mesh:
            for name, force in (("cover", fem.force), ("base", fem.base_force)):
                yield "", f"force on the {name} ({_format_vector(force)}) N"
            yield "", f"not measured ({_format_vector(fem.unmeasured)}) N: beside the texels and shear along them"
        yield "", f"error estimate {errors}"
        yield "", f"assumes {assumptions}; {fem.seconds:.2f} s"
        if fem.mesh is not None:
            kind = "hexahedra" if fem.mesh.is_hexahedral else "tetrahedra"
            yield "", f"finest mesh: {len(fem.mesh.cells)} {kind}, hash {fem.mesh.digest[:12]}"
    if fast is not None:
        yield "fast model", _describe_force(fast.total_force, fast.outside, along=fast.force is not None)
        yield "", f"{fast.seconds:.3f} s"
    if comparison.score is not None:
        values = comparison.score.as_json()
        for index, (name, metric) in enumerate(TABULATED.items()):
            text = f"{metric.heading}: {metric.text(values[name])} {metric.unit}".rstrip()
            yield "" if index else "fast against finite", text


def _describe_force(total: float, outside: float, *, along: bool) -> str:
    """Describe a force [N]: that along the motion, or the whole force and its part outside the array."""
    # Adding 0.0 removes the minus sign of a value that is rounded to negative zero.
    part = " along the motion" if along else f", {round(outside, 4) + 0.0:.4f} N of it outside the array"
    return f"{total:.4f} N{part}"


def _format_vector(values: FloatArray) -> str:
    return ", ".join(f"{round(float(each), 4) + 0.0:.4g}" for each in values)
