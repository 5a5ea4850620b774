"""The verb `sweep`: reads the file, computes what is missing, and collects the cube."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from validation.api import Stages
from validation.errors import InputError, at, check_choice
from validation.extras import REPORT_MODULES, require
from validation.output_folder import optional_folder
from validation.schema import read
from validation.schema.sweep import SweepTables
from validation.sweeps.cube import Clause, Swept, read_wish
from validation.sweeps.designs import Design, list_designs
from validation.sweeps.measurements import Measurement, read_measurement
from validation.sweeps.run import Task, check_store, find_key, read_result, run_here
from validation.text.quantity import format_time


def sweep(
    file: str | Path,
    *,
    wish: str | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    only_plan: bool = False,
    progress: Callable[[str], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> Swept:
    """Measure many designs of a sensor.  What is in the store of results is not computed again.

    Args:
        file: Sweep file.
        wish: Conditions such as `width_x < 4 mm, load_5_percent > 5 N`.
        out: Folder for the page, the maps and `sweep.nc`, which replaces an earlier one; None to write none.
        workers: Number of processes to start on this machine; None to compute in this one.
        cluster: Address or scheduler file of a running cluster of dask.distributed.
        only_plan: Whether to state number and cost of the designs, and to compute none.
        progress: Called with a line of text before each step.
        announce: Called with lines about number and cost of the designs.

    Raises:
        InputError: If the file, the wish or an option cannot be used, or the cluster does not answer.
        MissingExtraError: If a package is missing.
        OSError: If the store cannot be written.
    """
    require("skfem", *((*REPORT_MODULES, "xarray") if out else ()), *(("distributed",) if workers or cluster else ()))
    _check(workers, cluster, out, only_plan=only_plan)
    plan, tell, shown = _read_plan(Path(file), wish), announce or (lambda _: None), Stages(progress)
    check_store()
    stored = plan.collect()
    stored.check_wish()
    tasks = plan.list_tasks(stored)
    costs = [sum(each["seconds"] for each in found if each) for found in stored.results if found and all(found)]
    refused = sum(each.sensor is None for each in plan.designs)
    tell(f"{len(plan.designs)} designs: {len(costs)} stored, {refused} refused, {len(tasks)} to compute")
    if costs and tasks:
        tell(_describe_cost(sum(costs) / len(costs), len(tasks), workers))
    done = itertools.count(1)

    def finish(number: int) -> None:
        shown.step(count := next(done), len(tasks), "designs")
        if count == 1 and not costs:  # The first design tells the cost, and which quantities there are.
            seconds = sum(each["seconds"] for key in plan.keys[number] if (each := read_result(key)))
            tell(_describe_cost(seconds, len(tasks) - 1, workers))
            if plan.wish:
                plan.collect().check_wish()

    with optional_folder(out) as folder:
        lost: Mapping[int, str] = {}
        if tasks and not only_plan:
            shown.step(0, len(tasks), "designs")
            if workers or cluster:
                from validation.sweeps.cluster import run_there

                lost = run_there(tasks, finish, workers=workers, address=cluster)
            else:
                run_here(tasks, finish)
        found = plan.collect(lost)
        if not only_plan and (absent := [number for number in tasks if not all(found.results[number])]):
            found = replace(found, lost={**dict.fromkeys(absent, "its result is not in the store"), **lost})
        found.check_wish()
        if folder is not None:
            from validation.sweeps.page import write_page

            write_page(found, folder)
    return found


def _check(workers: int | None, cluster: str | None, out: str | Path | None, *, only_plan: bool) -> None:
    """Check options that exclude each other.

    Raises:
        InputError: If two do, or there is no worker.
    """
    if workers and cluster:
        raise InputError("--workers, --cluster: give one of the two")
    if workers is not None and workers < 1:
        raise InputError(f"--workers: must be at least 1, not {workers}; leave it out to compute in this process")
    if out and only_plan:
        raise InputError("--out, --only-plan: nothing is measured that could be written; leave one out")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plan:
    """What a sweep computes.

    Attributes:
        tables: The sweep file.
        designs: Its designs.
        measurements: What is measured of each.
        wish: Conditions.
    """

    tables: SweepTables
    designs: Sequence[Design]
    measurements: Sequence[Measurement]
    wish: Sequence[Clause]

    @cached_property
    def keys(self) -> list[list[str]]:
        """Keys of the results of each design; none for a refused one."""
        return [
            [find_key(each.sensor, one) for one in self.measurements] if each.sensor else [] for each in self.designs
        ]

    def collect(self, lost: Mapping[int, str] = MappingProxyType({})) -> Swept:
        """Read all results from the store."""
        results = [[read_result(key) for key in each] for each in self.keys]
        return Swept(tables=self.tables, designs=self.designs, results=results, lost=lost, wish=self.wish)

    def list_tasks(self, stored: Swept) -> dict[int, Task]:
        """List what is missing by number of the design."""
        missing = {
            number: (design.sensor, [one for one, each in zip(self.measurements, found, strict=False) if not each])
            for number, (design, found) in enumerate(zip(self.designs, stored.results, strict=True))
        }
        return {number: (sensor, measures) for number, (sensor, measures) in missing.items() if sensor and measures}


def _read_plan(path: Path, wish: str | None) -> _Plan:
    clauses, tables = [] if wish is None else read_wish(wish), read(path, SweepTables)
    with at(f"{path}: "):
        measurements, designs = [read_measurement(each) for each in tables.measure], list_designs(tables, path.parent)
        for each in measurements:
            _check_options(each, designs)
    names = [each.names for each in measurements]
    for clause in clauses if all(names) else ():
        known = set().union(*names)
        if not {clause.name, re.sub(r"_\d+$", "", clause.name)} & known:
            check_choice("--wish", "quantity", clause.name, sorted(known))
    return _Plan(tables=tables, designs=designs, measurements=measurements, wish=clauses)


def _check_options(measurement: Measurement, designs: Sequence[Design]) -> None:
    """Check options against the designs, of which one may refuse what another takes.

    Raises:
        InputError: If all refuse them.
    """
    refused = None
    for sensor in filter(None, (each.sensor for each in designs)):
        try:
            measurement.check(sensor)
        except InputError as error:
            refused = refused or error
        else:
            return
    if refused:
        raise refused


def _describe_cost(seconds: float, count: int, workers: int | None) -> str:
    where = f", {format_time(seconds * count / workers)} on {workers} workers" if workers else ""
    return f"one design takes {seconds:.3g} s of processor time, {count} about {format_time(seconds * count)}{where}"
