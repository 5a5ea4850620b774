"""Tables of a sweep file: the sensor, the keys that vary, and what is measured."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from validation.errors import shorten
from validation.schema import Table, types
from validation.text.quantity import find_factor, split_quantity

#: An accepted table of designs.
_DESIGNS = {"cover.layer[0].thickness": "1 mm : 5 mm : 5"}
#: Largest number of designs of a sweep, and of values of one key [-].
MOST_DESIGNS = 100_000
_COLON = re.compile(r"\s*:\s*")


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Values of one key.

    Attributes:
        values: The values, as a sensor file states them; empty for a range.
        low, high: Ends of a range, in `unit`.
        unit: Unit of the range; empty for plain numbers.
    """

    values: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0
    unit: str = ""

    def pick(self, share: float) -> Any:  # noqa: ANN401 -- a value of a sensor file
        """Return the value at a share 0..1 of the range, or of the list."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        return write_value(self.low + share * (self.high - self.low), self.unit)


def write_value(number: float, unit: str) -> Any:  # noqa: ANN401 -- a value of a sensor file
    """Return a number as a sensor file states it: a text with a unit, or a plain number, whole if it is."""
    rounded = float(f"{number:.12g}")
    return f"{rounded:.12g} {unit}" if unit else int(rounded) if rounded.is_integer() else rounded


def _read_axis(value: object) -> Axis:
    """Read a list of values, `from : to : count`, or a range `from : to` from which designs are drawn."""
    if isinstance(value, list):
        if not 0 < len(value) <= MOST_DESIGNS:
            raise ValueError(f"a list holds {len(value)} values; accepted: 1..{MOST_DESIGNS}")
        return Axis(values=tuple(value))
    parts = _COLON.split(value.strip()) if isinstance(value, str) else []
    ends = [split_quantity(part) for part in parts[:2]]
    if len(parts) not in (2, 3) or None in ends:
        raise ValueError(f'{shorten(value)} is no values; write ["1 mm", "2 mm"], "1 mm : 5 mm : 9" or "1 mm : 5 mm"')
    (low, unit), (high, other) = (each for each in ends if each)
    factor = find_factor(other, unit)
    if factor is None:
        raise ValueError(f"{shorten(value)}: both ends need a unit of one kind, as in '1 mm : 5 mm : 9'")
    if len(parts) == 2:  # noqa: PLR2004 -- from and to
        return Axis(low=low, high=factor * high, unit=unit)
    if not parts[2].isdecimal() or not 1 < (count := int(parts[2][:9])) <= MOST_DESIGNS:
        raise ValueError(f"{shorten(value)}: the count must be a whole number in 2..{MOST_DESIGNS}")
    return Axis(values=tuple(write_value(each, unit) for each in np.linspace(low, factor * high, count)))


_AXIS_JSON = {"anyOf": [{"type": "string", "examples": ["1 mm : 5 mm : 9"]}, {"type": "array", "minItems": 1}]}


class SweepTables(Table):
    """Designs of a sensor, and what is measured of each.

    Attributes:
        sensor: Sensor file, from the folder of this file, or a built-in sensor.
        measure: Commands with their options, such as "derive", "limits --noise 5mN" or "regress kernel".
        designs: Values by key of the sensor file: a list, "from : to : count", or a range "from : to" to draw from.
        draw: How designs are drawn: "sobol" or "random"; all combinations of the values when left out.
        count: Number of designs that are drawn.
        seed: Seed of the draw.
    """

    sensor: str = Field(examples=["sensor.toml"])
    measure: Annotated[list[str], types.OneOrMore(), Field(min_length=1, max_length=20)] = Field(examples=["derive"])
    designs: Annotated[
        dict[str, Annotated[Axis, types.Read(_read_axis, _AXIS_JSON)]], Field(min_length=1, examples=[_DESIGNS])
    ]
    draw: Annotated[Literal["sobol", "random"] | None, types.choice("sobol", "random")] = None
    count: Annotated[int, types.number(1, MOST_DESIGNS, whole=True)] | None = None
    seed: Annotated[int, types.number(0, 2**32 - 1, whole=True)] = 0

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of ranges without a draw, and of a draw without a count."""
        if (self.draw is None) != (self.count is None):
            yield "count", 'stands beside draw = "sobol" or "random"; give both or none'
        for key, axis in self.designs.items():
            if self.draw is None and not axis.values:
                yield f'designs."{key}"', "is a range; add a count, as in '1 mm : 5 mm : 9', or draw = \"sobol\""
