"""The stored values of a sensor's quantities, and their comparison with new ones.

A baseline is a JSON file for review by people: one line for each number or row of an image, sorted by name, with unit
and tolerance.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from xml.etree import ElementTree as ET

from validation.errors import InputError
from validation.output_folder import write_text
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Reading, Subject, describe_sensor
from validation.render.table import Table
from validation.schema import read
from validation.schema.baseline import FORMAT, OF_VALUE, BaselineTables
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel import Parameters
    from validation.campaign.evaluation import Progress

#: Packages whose versions a baseline states, because values depend on them.
PACKAGES = ("softcover", "mujoco", "numba", "numpy", "scipy")
#: Smallest tolerance of a number, in its unit.  It allows for rounding where the number is zero.
_LEAST = 1e-9
_OPTION = "--baseline"


@dataclass(frozen=True, kw_only=True)
class Baseline:
    """Values of all quantities of a sensor.

    Attributes:
        sensor: The sensor in one line, see `describe_sensor`.
        versions: Versions of packages by name.
        readings: Value, unit and tolerance by title of the quantity.
    """

    sensor: str
    versions: Mapping[str, str]
    readings: Mapping[str, Reading]

    def write(self, path: Path) -> None:
        """Write the baseline with one line for each number or row of an image, completely or not at all.

        Raises:
            InputError: If a number is not finite.
            OSError: If the file cannot be written.
        """
        if faults := [
            f"{_OPTION}: {path} is not written: {title} is not a finite number"
            for title, reading in self.readings.items()
            if not all(math.isfinite(number) for row in reading.numbers.values() for number in row)
        ]:
            raise InputError(*faults)
        text = json.dumps({"format": FORMAT, **self.as_json()}, indent=1)
        rows = re.sub(r"\[[^][{}]*\]", lambda row: " ".join(row[0].split()).replace("[ ", "[").replace(" ]", "]"), text)
        write_text(path, rows + "\n")

    def as_json(self) -> dict[str, Any]:
        """Return sensor, versions and quantities as a dictionary of JSON values."""
        quantities = {
            title: {
                "unit": reading.unit,
                "tolerance": _format_tolerance(reading),
                "value": _unpack_rows(reading.numbers),
            }
            for title, reading in sorted(self.readings.items())
        }
        return {"sensor": self.sensor, "versions": dict(sorted(self.versions.items())), "quantities": quantities}


@dataclass(frozen=True, kw_only=True)
class Change:
    """The change of a quantity from its stored value, by the number that changed most.

    Attributes:
        quantity: Title of the quantity.
        text: Description of the change and its size, in one line.
        label: Label of the number, and for an image its column; empty for a quantity of one number.
        before: Stored value of the number; None if the quantity is not in the baseline, or has another form.
        now: Measured value of the number; None if it is not finite, or if the quantity was not measured or has another
            form.
        unit: Unit of the numbers.
        tolerance: Largest difference that is no change.
    """

    quantity: str
    text: str = ""
    label: str = ""
    before: float | None = None
    now: float | None = None
    unit: str = ""
    tolerance: float = 0.0

    @property
    def ratio(self) -> float:
        """Difference of the two numbers over the tolerance [-]; infinity if one of the numbers is missing."""
        if self.before is None or self.now is None:
            return math.inf
        return abs(self.now - self.before) / max(self.tolerance, _LEAST)


def make_baseline(sensor: str, readings: Mapping[str, Reading]) -> Baseline:
    """Make a baseline of measured readings, with the versions of the packages that are installed."""
    return Baseline(sensor=sensor, versions={name: version(name) for name in PACKAGES}, readings=readings)


def read_baseline(path: Path, sensor: str) -> Baseline:
    """Read a baseline.

    Args:
        path: The file.
        sensor: The sensor in one line, to which the baseline must belong.

    Raises:
        InputError: If the file does not exist, is no baseline, or belongs to another sensor.
        OSError: If the file cannot be read.
    """
    advice = f"name another file, or remove it and write it anew: softcover regress SENSOR {_OPTION} {path} --update"
    if not path.exists():
        raise InputError(f"{_OPTION}: {path}: no such file; write one with --update")
    try:
        tables = read(path, BaselineTables)
    except InputError as error:
        raise InputError(
            *(f"{_OPTION}: {fault}" for fault in error.faults[:-1]), f"{_OPTION}: {error.faults[-1]}; {advice}"
        ) from None
    if tables.sensor != sensor:
        raise InputError(f"{_OPTION}: {path} belongs to {tables.sensor!r}, not to {sensor!r}; {advice}")
    readings = {}
    for title, entry in tables.quantities.items():
        relative = isinstance(entry.tolerance, str)
        tolerance = float(str(entry.tolerance).removesuffix(OF_VALUE)) / (100 if relative else 1)
        readings[title] = Reading(unit=entry.unit, tolerance=tolerance, relative=relative, numbers=entry.value)
    return Baseline(sensor=tables.sensor, versions=tables.versions, readings=readings)


def compare(stored: Baseline, measured: Baseline, failures: Mapping[str, str]) -> list[Change]:
    """List the quantities that changed; what a group follows from stands before it.

    Tolerances are those of the stored baseline.  A quantity that exists in only one of the two sets counts as changed.

    Args:
        stored: The stored baseline.
        measured: New readings.
        failures: Reasons why quantities could not be measured, by group.
    """
    changes = []
    for title in _list_titles(stored, measured):
        before, now = stored.readings.get(title), measured.readings.get(title)
        if before is None:
            changes.append(Change(quantity=title, text="is not in the baseline"))
        elif now is None:
            reason = failures.get(title.partition(": ")[0], "it does not apply to this sensor any more")
            changes.append(Change(quantity=title, text=f"could not be measured: {reason}"))
        elif (change := _compare_readings(title, before, now)) is not None:
            changes.append(change)
    return changes


def _list_titles(stored: Baseline, measured: Baseline) -> list[str]:
    ranks = {group: rank for rank, group in enumerate(EXPERIMENTS)}
    titles = {*stored.readings, *measured.readings}
    return sorted(titles, key=lambda title: (ranks.get(title.partition(": ")[0], len(ranks)), title))


def measure_changes(stored: Baseline, measured: Baseline) -> dict[str, float]:
    """Return the largest change of each quantity over its tolerance [-], by title; infinity if not comparable."""
    ratios = dict.fromkeys(_list_titles(stored, measured), math.inf)
    for title in stored.readings.keys() & measured.readings.keys():
        before, now = stored.readings[title], measured.readings[title]
        if before.form == now.form:
            ratios[title] = max((each.ratio for each in _list_changes(title, before, now)), default=0.0)
    return ratios


def _list_changes(title: str, before: Reading, now: Reading) -> list[Change]:
    """List the changes of all numbers of a quantity, without their description, from two readings of the same form."""
    return [
        Change(
            quantity=title,
            label=label if len(row) == 1 else f"{label}, column {column}",
            before=stored,
            now=measured if math.isfinite(measured) else None,
            unit=before.unit,
            tolerance=before.tolerance * (abs(stored) if before.relative else 1.0),
        )
        for label, row in before.numbers.items()
        for column, (stored, measured) in enumerate(zip(row, now.numbers[label], strict=True))
    ]


def merge(stored: Baseline | None, measured: Baseline, changes: Sequence[Change]) -> Baseline:
    """Return the baseline for an update: new values of changed quantities, stored values of others and tolerances.

    Values within tolerance are kept.  The difference of two files then shows only changed quantities, and a slow drift
    adds up until it is noticed.

    Args:
        stored: The stored baseline; None if there is none.
        measured: New readings.
        changes: Differences between stored and new values, see `compare`.
    """
    if stored is None:
        return measured
    changed = {change.quantity for change in changes}
    readings = {}
    for title, now in measured.readings.items():
        before = stored.readings.get(title)
        if before is None or before.unit != now.unit:
            readings[title] = now
        else:
            kept = replace(now, tolerance=before.tolerance, relative=before.relative)
            readings[title] = kept if title in changed else before
    return replace(measured, readings=readings)


def _compare_readings(title: str, before: Reading, now: Reading) -> Change | None:
    """Compare two readings; return the number that changed most, or None if all are within the tolerance."""
    if before.form != now.form:
        one, other = (_describe_form(each) for each in (before, now))
        return Change(quantity=title, text=f"has another form: {one} in the baseline, now {other}", unit=now.unit)
    changes = _list_changes(title, before, now)
    moved = sum(each.ratio > 1 for each in changes)
    if not moved:
        return None
    most = max(changes, key=lambda each: each.ratio)
    text = _describe_change(most, before)
    if most.label:
        text = f"{moved} of {len(changes)} numbers changed, most: {most.label} {text}"
    return replace(most, text=text)


def _describe_change(change: Change, before: Reading) -> str:
    """Describe the change of one number of a stored reading in words."""
    unit = "" if before.unit == "-" else f" {before.unit}"
    allowed = str(_format_tolerance(before)) + ("" if before.relative else unit)
    stored, now = change.before or 0.0, change.now
    if now is None:
        return f"is not a finite number any more; it was {stored:.5g}{unit}"
    share = f" ({100 * (now - stored) / abs(stored):+.3g} %)" if stored else ""
    verb = "rose" if now > stored else "fell"
    return f"{verb} from {stored:.5g} to {now:.5g}{unit}{share}, tolerance {allowed}"


def _describe_form(reading: Reading) -> str:
    """Describe the form of a reading in words: its numbers of labels and of values per label, and its unit."""
    lengths = sorted(set(map(len, reading.numbers.values())))
    numbers = lengths[0] if len(lengths) == 1 else f"{lengths[0]} to {lengths[-1]}" if lengths else 0
    names = ", ".join(list(reading.numbers)[:3])
    return f"{len(reading.numbers)} x {numbers} numbers [{reading.unit}]" + (f" ({names} ...)" if names else "")


def _format_tolerance(reading: Reading) -> float | str:
    """Return the tolerance of a reading as a baseline file states it: a number, or a percentage of the value."""
    return f"{100 * reading.tolerance:.3g}{OF_VALUE}" if reading.relative else reading.tolerance


def _unpack_rows(numbers: Mapping[str, tuple[float, ...]]) -> Any:  # noqa: ANN401 -- JSON
    """Convert the numbers of a reading to JSON: one number alone, else numbers or lists by label; to ten digits."""
    rows = {label: [float(f"{number:.10g}") for number in row] for label, row in numbers.items()}
    single = {label: row[0] if len(row) == 1 else row for label, row in rows.items()}
    return single[""] if list(single) == [""] else single


@dataclass(frozen=True, kw_only=True)
class Regression:
    """Result of a regression check.

    Attributes:
        now: New readings.
        stored: The stored baseline; None if there is none yet.
        failures: Reasons why quantities could not be measured, by group.
        seconds: Duration of the check [s].
    """

    now: Baseline
    stored: Baseline | None
    failures: Mapping[str, str]
    seconds: float

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Quantities that differ from the baseline by more than their tolerance, or that only one side has."""
        return () if self.stored is None else tuple(compare(self.stored, self.now, self.failures))

    @property
    def ratios(self) -> dict[str, float]:
        """Largest change of each quantity over its tolerance [-], by title; infinity where one side lacks it."""
        return {} if self.stored is None else measure_changes(self.stored, self.now)

    @property
    def other_versions(self) -> list[str]:
        """Packages whose version differs from the version in the baseline, with both versions."""
        then = {} if self.stored is None else self.stored.versions
        pairs = ((name, then.get(name, "none"), version) for name, version in self.now.versions.items())
        return [f"{name} {old} -> {version}" for name, old, version in pairs if old != version]

    def as_json(self) -> dict[str, Any]:
        """Return changes and readings as a dictionary of JSON values."""
        return {"changed": len(self.changes), "changes": [asdict(each) for each in self.changes], **self.now.as_json()}

    def to_csv(self) -> str:
        """Return the largest change of each quantity over its tolerance as CSV."""
        return Table(
            ("quantity", "change_over_tolerance"), [(title, f"{value:.6g}") for title, value in self.ratios.items()]
        ).to_csv()


def check_sensor(
    source: SensorDescription | Parameters, path: Path, *, update: bool = False, seed: int = 0, progress: Progress
) -> Regression:
    """Measure all quantities of a sensor and compare them with a baseline, or write the baseline.

    A fault in the baseline is reported before the long computation.

    Args:
        source: Description of a sensor, or parameters of its fast model.  With parameters, quantities that need finite
            elements are left out.
        path: The baseline file.
        update: Whether the baseline is written.
        seed: Seed of the noise [-].
        progress: Display of progress.

    Raises:
        InputError: If the baseline cannot be read.
        ConvergenceError: If the finite elements did not converge.
    """
    from validation.derivation.derive import derive

    started = time.perf_counter()
    sensor = source if isinstance(source, SensorDescription) else None
    described = describe_sensor(sensor.name if sensor else source.array.name, source.array, derived=sensor is not None)
    stored = None if update and not path.exists() else read_baseline(path, described)
    derivation = derive(sensor, progress=progress) if sensor else None
    parameters = derivation.parameters if derivation else cast("Parameters", source)
    subject = Subject(parameters=parameters, derivation=derivation, seed=seed, progress=progress.step)
    readings, failures = measure(subject, progress=progress)
    now = make_baseline(described, readings)
    found = Regression(now=now, stored=stored, failures=failures, seconds=time.perf_counter() - started)
    if update:
        merge(stored, now, found.changes).write(path)
    return found


def write_junit(path: Path, sensor: str, titles: Iterable[str], changes: Sequence[Change], *, seconds: float) -> None:
    """Write one test case for each quantity, which fails if the quantity changed; completely or not at all.

    Args:
        path: The file.
        sensor: The sensor in one line.
        titles: Titles of all quantities.
        changes: The quantities that changed.
        seconds: Duration of the check [s].

    Raises:
        OSError: If the file cannot be written.
    """
    changed = {change.quantity: change for change in changes}
    names = sorted({*titles, *changed})
    counts = {"tests": str(len(names)), "failures": str(len(changed)), "errors": "0", "time": f"{seconds:.1f}"}
    suite = ET.Element("testsuite", {"name": _clean(f"softcover regress, {sensor}"), **counts})
    for title in names:
        group, _, name = title.partition(": ")
        case = ET.SubElement(suite, "testcase", {"classname": _clean(group), "name": _clean(name or group)})
        if title in changed:
            message = _clean(f"{title}: {changed[title].text}")
            failure = ET.SubElement(case, "failure", {"type": "changed", "message": message})
            failure.text = message
    root = ET.Element("testsuites", counts)
    root.append(suite)
    ET.indent(root)
    write_text(path, ET.tostring(root, encoding="unicode") + "\n")


def _clean(text: str) -> str:
    """Replace characters that XML does not allow."""
    return "".join(each if each.isprintable() else "?" for each in text)
