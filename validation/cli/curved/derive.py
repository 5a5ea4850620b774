"""The command `derive` on a sensor with a curved cover."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.cli.entry import DONE, OUTSIDE_FAILED
from validation.cli.meaning import GOOD_ERROR
from validation.cli.output import Progress, describe_cover, describe_errors, print_json, print_meaning, print_rows, say

if TYPE_CHECKING:
    from meshes.array_types import FloatArray
    from validation.curved.derive import CurvedDerivation
    from validation.sensor_file import SensorDescription


def derive_curved_cover(sensor: SensorDescription, out: Path | None, *, json: bool) -> int:
    """Run the command `derive` on a curved cover."""
    from validation.curved.derive import derive_curved
    from validation.output_folder import new_folder

    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        with Progress() as progress:
            derivation = derive_curved(sensor, progress=progress)
        if folder:
            from validation.curved.files import write_derivation

            files = write_derivation(derivation, folder)
    if json:
        print_json(derivation.result.as_json())
    else:
        print_rows(_list_derivation(derivation), title=f"Texel responses of {sensor.name}")
        print_meaning(_explain_derivation(derivation))
    for sentence in derivation.warnings:
        say(f"softcover: warning: {sentence}")
    if files and derivation.parameters.surface is None:
        say(
            "softcover: note: the meshes of this cover are too fine for the fast model's contact; parameters.toml "
            "holds the spread of forces alone; give a larger cover.element_size"
        )
    return say_written(files, out)


def say_written(files: tuple[str, ...], out: Path | None) -> int:
    """Name the written files, and return the exit status, which says whether this machine could draw pictures."""
    from validation.scene.draw import lacks_picture

    if files:
        say(f"wrote {', '.join(files)} to {out}")
    return OUTSIDE_FAILED if lacks_picture(files) else DONE


def _list_derivation(derivation: CurvedDerivation) -> Iterator[tuple[str, str]]:
    sensor, shares = derivation.sensor, derivation.own_shares[derivation.sensor.array.active]
    others = derivation.responses.matrix.sum(axis=1)[sensor.array.active] - shares
    size = " x ".join(f"{1e3 * edge:.3g}" for edge in sensor.array.texel_size)
    yield "cover", describe_cover(sensor.cover)
    yield "texels", f"{int(sensor.array.active.sum())} of {size} mm"
    for line in derivation.sensor.cover.notes:
        yield "note", line
    from meshes.solids import check_quality

    for index, line in enumerate(check_quality(derivation.mesh).lines()):
        yield "" if index else "finest mesh", line
    yield "", f"hash {derivation.mesh.digest[:12]}"
    yield "force on a texel", f"{_percent(shares)} of a point force on the top above it (least, median, largest)"
    yield "force on all others", f"{_percent(others)} of it"
    gaussian = derivation.gaussian
    sigma = ", ".join(f"{1e3 * each:.3g}" for each in gaussian.sigma)
    yield "Gaussian", f"sigma {sigma} mm along the surface; it puts {100 * gaussian.residual:.1f} % of a load elsewhere"
    yield "error estimate", describe_known_errors(derivation.responses.error_estimate)
    yield "time", f"{derivation.seconds:.1f} s"


def _explain_derivation(derivation: CurvedDerivation) -> Iterator[str]:
    yield (
        "The force on a texel is the resultant on it along its own normal, shear included: on a curved base the forces "
        "of all texels need not sum to the load."
    )
    yield judge_error(derivation.responses.error_estimate["any_texel"], "the responses, relative to the largest one,")


def judge_error(error: float, what: str) -> str:
    """Return a sentence on an estimated error [-]."""
    if np.isnan(error):
        return f"No error of {what} is known: there is one mesh only."
    if error <= GOOD_ERROR:
        return f"The estimated error of {what} is good: {100 * error:.2g} %."
    return (
        f"The estimated error of {what} is {100 * error:.2g} %, above {100 * GOOD_ERROR:g} %: take it as their "
        "uncertainty."
    )


def describe_known_errors(estimates: Mapping[str, float]) -> str:
    """Describe estimated errors, or say that there are none."""
    known = {name: value for name, value in estimates.items() if not np.isnan(value)}
    return describe_errors(known) or "none: there is one mesh only"


def _percent(values: FloatArray) -> str:
    return " / ".join(f"{100 * value:.1f}" for value in (values.min(), np.median(values), values.max())) + " %"


def format_vector(values: FloatArray, digits: int = 3) -> str:
    """Format the components of a vector."""
    return ", ".join(f"{round(float(each), digits) + 0.0:.4g}" for each in values)
