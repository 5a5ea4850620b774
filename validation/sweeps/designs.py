"""The designs of a sweep: values of keys of a sensor file, and the sensor that each describes."""

from __future__ import annotations

import copy
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshes.array_types import FloatArray
from validation.errors import InputError
from validation.schema.sweep import MOST_DESIGNS, Axis, SweepTables
from validation.sensor_file import SensorDescription
from validation.sensor_file.sensor import parse, read_tables
from validation.text.quantity import find_factor, split_quantity

_PART = re.compile(r"[^.\[\]]+|\[\d+\]")


@dataclass(frozen=True, kw_only=True)
class Design:
    """One design.

    Attributes:
        values: Values by key of the sensor file.
        sensor: The sensor; None if it is refused.
        refusal: Why it is refused; empty if it is not.
    """

    values: Mapping[str, Any]
    sensor: SensorDescription | None
    refusal: str = ""


def list_designs(tables: SweepTables, folder: Path) -> list[Design]:
    """List the designs of a sweep.  A design that the sensor file refuses has its words.

    Args:
        tables: The sweep file.
        folder: Its folder.

    Raises:
        InputError: If there are too many designs, or all are refused.
    """
    path = folder / tables.sensor if (folder / tables.sensor).is_file() else Path(tables.sensor)
    raw, designs = read_tables(str(path)), []
    for values in _list_values(tables):
        changed = copy.deepcopy(raw)
        try:
            for key, value in values.items():
                _set_key(changed, key, value)
            designs.append(Design(values=values, sensor=parse(changed, source=path)))
        except ValueError as error:
            designs.append(Design(values=values, sensor=None, refusal="; ".join(str(error).splitlines())))
    if all(each.sensor is None for each in designs):
        raise InputError(f"every design is refused, the first by: {designs[0].refusal}")
    return designs


def _list_values(tables: SweepTables) -> Iterator[dict[str, Any]]:
    axes: list[Axis] = list(tables.designs.values())
    if tables.draw is None:
        if (count := math.prod(len(axis.values) for axis in axes)) > MOST_DESIGNS:
            raise InputError(f"designs: {count} designs; at most {MOST_DESIGNS} are accepted: thin out the values")
        combined: Any = itertools.product(*(axis.values for axis in axes))
    else:
        combined = ([axis.pick(each) for axis, each in zip(axes, row, strict=True)] for row in _draw(tables, len(axes)))
    return (dict(zip(tables.designs, row, strict=True)) for row in combined)


def _draw(tables: SweepTables, axes: int) -> FloatArray:
    """Draw shares of ranges, shape (count, axes) [-]."""
    count = tables.count or 1
    if tables.draw == "random":
        return np.random.default_rng(tables.seed).random((count, axes))
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(axes, rng=tables.seed).random_base2(math.ceil(math.log2(count)))[:count])


def _set_key(tables: dict[str, Any], key: str, value: object) -> None:
    """Set a key of nested tables, such as `cover.layer[0].thickness`; tables that are missing are made.

    Raises:
        InputError: If the key leads through what is no table or list, or beyond the end of a list.
    """
    *parents, last = (int(part[1:-1]) if part[0] == "[" else part for part in _PART.findall(key))
    place: Any = tables
    try:
        for part in parents:
            place = place[part] if isinstance(part, int) else place.setdefault(part, {})
        if isinstance(last, int) or isinstance(place, Mapping):
            place[last] = value
            return
    except (LookupError, TypeError, AttributeError):
        pass
    raise InputError(f"{key}: the sensor file has no such table or list; write for example cover.layer[0].thickness")


def find_numbers(values: Sequence[Any]) -> tuple[FloatArray, str] | None:
    """Return the numbers of an axis and their unit; None if the values are no quantities of one kind, as materials."""
    found = [split_quantity(each) if isinstance(each, str) else (each, "") for each in values]
    if not all(each and isinstance(each[0], int | float) and not isinstance(each[0], bool) for each in found):
        return None
    unit = found[0][1] if found[0] else ""
    factors = [each and find_factor(each[1], unit) for each in found]
    if None in factors:
        return None
    return np.array([each[0] * factor for each, factor in zip(found, factors, strict=True) if each and factor]), unit
