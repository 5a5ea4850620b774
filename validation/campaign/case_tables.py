"""Reading of the tables `[[case]]` and of limits on metrics in a campaign file."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from meshes import TexelArray
from validation.campaign.case import Case, name_positions
from validation.errors import InputError, nearest
from validation.metrics import Score
from validation.text.indenter import read_indenter, read_load, read_position, read_tilt, read_yaw
from validation.text.quantity import read_quantity

if TYPE_CHECKING:
    from validation.curved.places import CurvedPlaces

T = TypeVar("T")

#: Keys of a table `[[case]]`.
_KEYS = ("name", "indenter", "load", "loads", "path", "at", "yaw", "tilt", "compared", "required", "quick")
_CURVED_KEYS = (*_KEYS, "direction")
#: Of these exactly one is given.
_LOADS = ("load", "loads", "path")
#: Metrics that a campaign can compare and limit.
METRIC_NAMES = tuple(field.name for field in dataclasses.fields(Score))
#: Metrics that count or compare areas: their limits are plain numbers.
_PLAIN = ("pixels_changed", "pixels_changed_line", "pixels_lit_line", "active_area_iou")
#: Metrics that are no errors, so that no limit from above makes sense.
_NOT_ERRORS = ("pixels_lit_line", "active_area_iou")
#: Largest number of loads in one table [-], and of characters of a name [-].
_MOST_LOADS, _LONGEST_NAME = 100, 80
_SHARE = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]{1,3})?)\s*%\s*")


def read_case(table: object, array: TexelArray, place: str, *, curved: CurvedPlaces | None = None) -> list[Case]:
    """Read one table `[[case]]`; a list of loads or a loading path makes one case per load.

    Args:
        table: The table.
        array: The array, which defines the named positions.
        place: Place of the table in the file, such as `case[3]`.
        curved: Places on the sensor's curved cover; None for a flat cover.

    Raises:
        InputError: With one line per fault.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"{place}: must be a table [[case]], not {table!r}"[:200])
    faults = _check_keys(table, place, is_curved=curved is not None)

    def take(key: str, default: T, read: Callable[[Any, str], T]) -> T:
        """Read one key; collect its faults and return the default where it has any or is missing."""
        if key not in table:
            return default
        try:
            return read(table[key], f"{place}.{key}")
        except InputError as error:
            faults.extend(error.faults)
            return default

    for key, example in (("name", "name = 'ball'"), ("indenter", "indenter = 'sphere:radius=5mm'")):
        if key not in table:
            faults.append(f"{place}.{key}: is missing; write for example {example}")
    shape = take("indenter", "", _read_text)
    indenter = take("indenter", None, lambda value, where: read_indenter(_read_text(value, where), place=where))
    required: dict[str, float] = read_limits(table.get("required", {}), f"{place}.required", faults)
    everything: tuple[str, ...] = ()
    compared = take("compared", everything, _read_metrics)
    faults += [
        f"{place}.required.{name}: is not in {place}.compared" for name in required if compared and name not in compared
    ]
    common: dict[str, Any] = {"shape": shape, "compared": compared, "required": required}
    if curved is None:
        common |= {
            "at": take("at", (0.0, 0.0), lambda value, where: _read_at(value, array, where)),
            "yaw": take("yaw", 0.0, lambda value, where: read_yaw(_read_text(value, where), place=where)),
            "tilt": take("tilt", (0.0, 0.0), lambda value, where: read_tilt(_read_text(value, where), place=where)),
        }
    else:
        common["touch"] = curved.read(table, place, faults)
    name = take("name", "", _read_name)
    take("quick", False, _read_switch)  # noqa: FBT003 -- a default
    loads = _read_loads(table, place, faults)
    if faults or indenter is None:
        # a fault of the indenter is found twice, as text and as shape
        raise InputError(*dict.fromkeys(faults))
    path = tuple(loads) if "path" in table else ()
    names = [name] if "load" in table else [f"{name}, {load:.3g} N" for load in loads]
    return [
        Case(name=each, indenter=indenter, load=load, path=path, **common)
        for each, load in zip(names, loads, strict=True)
    ]


def _check_keys(table: Mapping[str, Any], place: str, *, is_curved: bool) -> list[str]:
    """Return one line per key that is unknown, or that the kind of cover does not have."""
    keys = _CURVED_KEYS if is_curved else _KEYS
    faults = []
    for key in table:
        if key == "direction" and not is_curved:
            faults.append(
                f"{place}.direction: is for curved covers; a flat one is pressed along -z, `tilt` turns the body"
            )
        elif key == "path" and is_curved:
            faults.append(f"{place}.path: a curved cover has no friction, so earlier loads do not matter; write loads")
        elif key not in keys:
            faults.append(f"{place}.{key}: unknown key; {nearest(key, keys)}")
    return faults


def read_limits(table: object, place: str, faults: list[str]) -> dict[str, float]:
    """Read a table of largest accepted values by metric, such as `{ misplaced_force = "3 %" }`.

    Returns:
        The limits as the metrics have them: fractions, metres, percent where the name says so, plain numbers.
    """
    if not isinstance(table, Mapping):
        faults.append(f"{place}: must be a table of metrics, such as {{ misplaced_force = '3 %' }}")
        return {}
    out: dict[str, float] = {}
    known = [name for name in METRIC_NAMES if name not in _NOT_ERRORS]
    for name, value in table.items():
        where = f"{place}.{name}"
        if name not in known:
            faults.append(f"{where}: unknown metric; {nearest(name, known)}")
            continue
        try:
            out[name] = _read_limit(name, value, where)
        except InputError as error:
            faults.extend(error.faults)
    return out


def read_share(value: object, place: str) -> float:
    """Read a percentage such as "3 %" and return it as a fraction [-].

    Raises:
        InputError: If the text is no percentage.
    """
    match = _SHARE.fullmatch(value) if isinstance(value, str) and len(value) < _LONGEST_NAME else None
    if match is None:
        raise InputError(f"{place}: {_shorten(value)} is no percentage; write for example '3 %'")
    return float(match[1]) / 100


def _read_limit(name: str, value: object, place: str) -> float:
    if name in _PLAIN:
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
            raise InputError(f"{place}: must be a number from 0 on, not {_shorten(value)}")
        return float(value)
    if name.endswith("_m"):
        number = read_quantity(value, "length", place=place)
        if number < 0:
            raise InputError(f"{place}: must not be negative, not {_shorten(value)}")
        return number
    share = read_share(value, place)
    return 100 * share if name.endswith("_percent") else share


def _read_loads(table: Mapping[str, Any], place: str, faults: list[str]) -> list[float]:
    """Read the one load, the loads that are applied at once, or the ascending loads of a path [N]."""
    given = [key for key in _LOADS if key in table]
    if len(given) != 1:
        found = "nothing" if not given else " and ".join(given)
        faults.append(f"{place}.load: give one of load, loads (each applied at once) and path (ascending), not {found}")
        return []
    key = given[0]
    values = [table[key]] if key == "load" else table[key]
    if not isinstance(values, list) or not 0 < len(values) <= _MOST_LOADS:
        faults.append(f"{place}.{key}: must be a list of 1 to {_MOST_LOADS} loads, such as ['100 g', '500 g']")
        return []
    loads: list[float] = []
    for number, value in enumerate(values):
        where = f"{place}.{key}" if key == "load" else f"{place}.{key}[{number}]"
        try:
            load = read_load(_read_text(value, where), place=where)
        except InputError as error:
            faults += error.faults
            continue
        if load in loads:
            faults.append(f"{where}: {value!r} is listed twice")
        elif key == "path" and loads and load < loads[-1]:
            faults.append(f"{where}: the loads of a path must ascend, because unloading is not computed")
        loads.append(load)
    return loads


def _read_text(value: object, place: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{place}: must be a text with a unit, not {_shorten(value)}")
    return value


def _read_name(value: object, place: str) -> str:
    if not isinstance(value, str) or not value.strip() or len(value) > _LONGEST_NAME:
        raise InputError(f"{place}: must be a text of 1 to {_LONGEST_NAME} characters, not {_shorten(value)}")
    return value.strip()


def _read_at(value: object, array: TexelArray, place: str) -> tuple[float, float]:
    named = name_positions(array)
    text = _read_text(value, place)
    if text in named:
        return named[text]
    if not any(character.isdigit() for character in text):
        raise InputError(f"{place}: unknown position {text!r}; {nearest(text, named)}, or x,y such as '1mm,-2mm'")
    return read_position(text, place=place)


def _read_metrics(value: object, place: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(f"{place}: must be a list of metrics, such as ['misplaced_force']")
    for name in value:
        if name not in METRIC_NAMES:
            raise InputError(f"{place}: unknown metric {_shorten(name)}; {nearest(str(name), METRIC_NAMES)}")
    return tuple(value)


def _read_switch(value: object, place: str) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{place}: must be true or false, not {_shorten(value)}")
    return value


def _shorten(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_NAME else f"{text[:_LONGEST_NAME]}..."
