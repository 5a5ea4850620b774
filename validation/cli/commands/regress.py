"""The command `softcover regress`, which compares everything that a sensor's fast model does with stored values."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.entry import CHECK_FAILED, DONE
from validation.cli.meaning import explain_verdict
from validation.cli.options import Json, Sensor
from validation.cli.output import Progress, print_json, say, show
from validation.errors import InputError

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.regression.baseline import Baseline, Change
    from validation.regression.experiments import Subject
    from validation.render.table import Table
    from validation.sensor_file import SensorDescription

_BaselineFile = Annotated[Path, Parameter(help="File with the stored values.")]
_Update = Annotated[bool, Parameter(help="Store the present values and print what changed, instead of checking.")]
_Junit = Annotated[Path | None, Parameter(help="File for the verdict as JUnit XML, one test case per quantity.")]
_Out = Annotated[Path | None, Parameter(help="Folder for regress.csv, each change over its tolerance.")]
_Seed = Annotated[int, Parameter(help="Seed of the noise, from 0 on; no seed changes the verdict.")]


def regress(
    sensor: Sensor,
    *,
    baseline: _BaselineFile = Path("baseline.json"),
    update: _Update = False,
    junit: _Junit = None,
    out: _Out = None,
    seed: _Seed = 0,
    json: Json = False,
) -> int:
    """Compare what the fast model of a sensor measures with a stored baseline; exit with 1 if anything changed.

    Checks the fitted kernel, the filter under a load step, noise, characteristic, saturation, frames, the orientation
    of images, contact methods, metrics and accuracy against finite elements, and prints a line for each change.  For a
    folder that `derive --out` wrote, what needs finite elements is left out.

    Examples of use:

        softcover regress wts-0614-34 --update
        softcover regress wts-0614-34 --out verdict
        softcover regress sensor.toml --baseline ci/sensor.json --junit regress.xml
    """
    from validation.cli.options import read_sensor
    from validation.output_folder import new_folder
    from validation.regression.baseline import (
        compare,
        make_baseline,
        measure_changes,
        merge,
        read_baseline,
        write_junit,
    )
    from validation.regression.experiments import describe_sensor
    from validation.regression.quantities import measure
    from validation.sensor_file import SensorDescription

    started = time.perf_counter()
    _check_options(baseline, junit, out, seed, update=update)
    _require_modules(source := _refuse_curved(read_sensor(sensor), sensor))
    name = source.name if isinstance(source, SensorDescription) else source.array.name
    described = describe_sensor(name, source.array, derived=isinstance(source, SensorDescription))
    # A fault in the baseline is reported before the long computation.
    stored = None if update and not baseline.exists() else read_baseline(baseline, described)
    with new_folder(out) if out else nullcontext() as folder:
        with Progress() as progress:
            readings, failures = measure(_make_subject(source, seed, progress), progress=progress)
        now = make_baseline(described, readings)
        ratios = {} if stored is None else measure_changes(stored, now)
        if folder:
            (folder / "regress.csv").write_text(_tabulate(ratios).to_csv(), encoding="utf-8")
        changes = [] if stored is None else compare(stored, now, failures)
    _show_changes(changes, failures, now, json=json)
    if update:
        merge(stored, now, changes).write(baseline)
        say(f"wrote {baseline}: {len(readings)} quantities, {len(changes) if stored else 'all'} changed or new")
        return DONE
    seconds = time.perf_counter() - started
    say(f"{len(readings)} quantities of {name} measured in {seconds:.1f} s: {len(changes) or 'none'} changed")
    say(explain_verdict(ratios))
    if changes and stored is not None:
        _advise(stored, now, sensor, baseline)
    if junit is not None:
        write_junit(junit, described, now.readings, changes, seconds=seconds)
    if out is not None:
        say(f"wrote regress.csv to {out}")
    return CHECK_FAILED if changes else DONE


def _tabulate(changes: Mapping[str, float]) -> Table:
    """Tabulate the largest change over the tolerance of each quantity, infinity where one side lacks it [-]."""
    from validation.render.table import Cell, Table

    return Table(
        name="regress",
        caption="Change of every quantity over its tolerance",
        headings=("quantity", "change_over_tolerance"),
        rows=[[Cell(text=title), Cell(text=f"{value:.6g}")] for title, value in changes.items()],
    )


def _refuse_curved(source: SensorDescription | Parameters, sensor: str) -> SensorDescription | Parameters:
    """Return what was read, unless it is the folder of a curved cover.

    Raises:
        InputError: If it is.
    """
    from fastmodel.surface import CoverPoints
    from validation.sensor_file import SensorDescription

    if not isinstance(source, SensorDescription) and isinstance(source.surface, CoverPoints):
        raise InputError(
            f"{sensor}: is of a curved cover, and the guarded quantities are those of flat arrays; "
            "`softcover validate` with the sensor file scores it"
        )
    return source


def _require_modules(source: SensorDescription | Parameters) -> None:
    """Check that finite elements are installed, which derive the parameters of a described sensor.

    Raises:
        MissingExtraError: If they are not.
    """
    from validation.extras import require
    from validation.sensor_file import BUILT_IN, SensorDescription

    if not isinstance(source, SensorDescription):
        return
    stored = source is BUILT_IN.get(source.name)
    require(
        "skfem",
        otherwise=f"check the stored parameters: softcover export {source.name} --out FOLDER, softcover regress FOLDER"
        if stored
        else "",
    )


def _show_changes(changes: list[Change], failures: Mapping[str, str], now: Baseline, *, json: bool) -> None:
    """Print the changes and, on standard error, what could not be measured."""
    if json:
        print_json({"changed": len(changes), "changes": [asdict(each) for each in changes], **now.as_json()})
    else:
        for change in changes:
            show(f"{change.quantity}: {change.text}")
    for reason in dict.fromkeys(failures.values()):
        say(f"not measured: {'; '.join(title for title, each in failures.items() if each == reason)}: {reason}")


def _check_options(baseline: Path, junit: Path | None, out: Path | None, seed: int, *, update: bool) -> None:
    """Refuse options that cannot be carried out, before the long computation."""
    faults = []
    for option, path in (("--junit", junit), ("--out", out)):
        if update and path is not None:
            faults.append(f"{option}, --update: give one of the two; --update checks nothing")
    if seed < 0:
        faults.append(f"--seed: accepted: 0 or more, not {seed}")
    for option, path in (("--baseline", baseline if update else None), ("--junit", junit)):
        if path is None:
            continue
        if path.is_dir():
            faults.append(f"{option}: {path} is a folder; name a file")
        elif not next(parent for parent in path.absolute().parents if parent.exists()).is_dir():
            faults.append(f"{option}: {path} lies below a file; name a file in a folder")
    if faults:
        raise InputError(*faults)


def _make_subject(source: SensorDescription | Parameters, seed: int, progress: Progress) -> Subject:
    """Derive the parameters of a described sensor, and make the subject of the measurement."""
    from validation.cli.options import tell_unused
    from validation.regression.experiments import Subject
    from validation.sensor_file import SensorDescription

    if not isinstance(source, SensorDescription):
        return Subject(parameters=source, seed=seed)
    from validation.derivation.derive import derive_layers

    tell_unused(source, ", and this check computes its finite elements without")
    found = derive_layers(source, progress=progress)
    return Subject(parameters=found.parameters, derivation=found, seed=seed, progress=progress.step)


def _advise(stored: Baseline, now: Baseline, sensor: str, baseline: Path) -> None:
    """Say what may have caused the changes, and what to do."""
    others = ", ".join(
        f"{name} {stored.versions.get(name, 'none')} -> {version}"
        for name, version in now.versions.items()
        if stored.versions.get(name) != version
    )
    if others:
        say(f"other versions than in the baseline: {others}")
    say(f"if the changes are meant: softcover regress {sensor} --baseline {baseline} --update")
