"""`softcover derive`."""

from __future__ import annotations

import contextlib

from validation.cli.options import Json, MaterialName, Out, Sensor, Thickness
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.derivation.derive import Derivation
from validation.derivation.derive import derive as derive_parameters
from validation.output_folder import new_folder
from validation.sensor_file import load


def derive(
    sensor: Sensor,
    *,
    material: MaterialName = None,
    thickness: Thickness = None,
    out: Out = None,
    json: Json = False,
) -> None:
    """Point spread function of a sensor's cover, and the fast model's parameters fitted to it."""
    description = load(sensor, material=material, thickness=thickness)
    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        with Progress() as progress:
            derivation = derive_parameters(description, progress=progress)
        if folder:
            from validation.report.derivation import write_derivation

            files = write_derivation(derivation, folder)
    if json:
        print_json(derivation.as_json())
    else:
        _print(derivation)
    if out:
        say(f"wrote {', '.join(files)} to {out}")


def _print(derivation: Derivation) -> None:
    from rich.console import Console

    from validation.cli.tables import derivation_table, estimates_table

    console = Console()
    console.print(derivation_table(derivation))
    console.print(estimates_table(derivation))
