"""Comparison of the finite elements with measured forces on the command line: `softcover validate --measured FILE`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from validation.cli.output import Progress, describe_cover, print_json, print_table, say, show

if TYPE_CHECKING:
    from validation.measured_force.comparison import ForceComparison, Row
    from validation.schema.measured_force import Measurement


def compare_measured_force(measured: str, *, json: bool) -> None:
    """Compare the finite elements with forces that were measured at known depths, and print the comparison.

    The moduli are fitted to some of the points, and the others are scored, with the uncertainty of the comparison, both
    without slip and without friction.

    Args:
        measured: A file of measured forces, or the name of a built-in measurement.
        json: Whether to print JSON.

    Raises:
        InputError: If the file has faults.
        MissingExtraError: If the finite elements are not installed.
        OSError: If the file exists and cannot be read.
    """
    from validation.extras import require
    from validation.measured_force.comparison import compare_measurement, read_measured_force

    started = time.perf_counter()
    given = read_measured_force(measured)
    require("skfem")
    with Progress() as progress:
        comparison = compare_measurement(given, progress)
    print_json(comparison.as_json()) if json else _show(comparison, given)
    say(f"compared in {time.perf_counter() - started:.1f} s")


def _show(comparison: ForceComparison, given: Measurement) -> None:
    show(f"{given.name}: {describe_cover(given.cover)}")
    show(f"source: {given.source}")
    for row in comparison.rows:
        show(f"{row.name}: {_describe_moduli(given, row)}")
    print_table(
        ("friction", "mm", "D [N]", "S [N]", "E", "u_val", "u_num", "u_input", "u_D"),
        _list_points(comparison),
        title="Measured force D, computed force S; error E = S - D and standard uncertainties in % of D",
    )
    show("abs(E) < u_val: the comparison cannot resolve an error of the model")
    names = list(comparison.rows[-1].inputs)
    print_table(
        ("friction", "mm", *names),
        _list_inputs(comparison, names),
        title="Parts of u_input in % of D",
    )
    for sentence in comparison.verdict:
        show(sentence)


def _describe_moduli(given: Measurement, row: Row) -> str:
    """Describe the fitted moduli with their 95 % interval: the shear modulus of a single layer, else the factor."""
    layers = given.cover.layers
    unit, label = (layers[0].material.shear_modulus / 1e6, "MPa") if len(layers) == 1 else (1.0, "times those given")
    what = "shear modulus" if len(layers) == 1 else "moduli"
    ends = "" if row.interval is None else " ({:.4g}..{:.4g}, 95 %)".format(*(unit * end for end in row.interval))
    return f"{what} {unit * row.scale:.4g} {label}{ends}"


def _list_points(comparison: ForceComparison) -> Iterator[tuple[str, ...]]:
    given = comparison
    for row in comparison.rows:
        for i in [i for i, fitted in enumerate(given.fitted) if not fitted]:
            parts = (row.u_val[i], row.numerical[i], row.u_input[i], row.measured[i])
            yield (
                row.name,
                f"{1e3 * given.depth[i]:.4g}",
                f"{given.force[i]:.4g}",
                f"{row.predicted[i]:.4g}",
                f"{100 * row.error[i] / given.force[i]:+.1f}",
                *(f"{100 * part / given.force[i]:.1f}" for part in parts),
            )


def _list_inputs(comparison: ForceComparison, names: list[str]) -> Iterator[tuple[str, ...]]:
    given = comparison
    for row in comparison.rows:
        for i in [i for i, fitted in enumerate(given.fitted) if not fitted]:
            parts = (
                f"{100 * row.inputs[name][i] / given.force[i]:.2f} %" if name in row.inputs else "" for name in names
            )
            yield row.name, f"{1e3 * given.depth[i]:.4g}", *parts
