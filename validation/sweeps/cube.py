"""The result of a sweep: quantities of all designs as one cube, its netCDF file, and which designs meet a wish.

A design is certain to meet a wish if its quantities do within all of their error, and possible if they do somewhere
within it.  Between the points of a grid, quantities are interpolated linearly along each axis.  The error is then
larger by the sum over the axes of the largest difference that leaving out one point makes, which for a smooth quantity
is four times that of the interpolation itself.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes.array_types import BoolArray, FloatArray
from validation.errors import InputError, check_choice
from validation.schema.sweep import MOST_DESIGNS, SweepTables, write_value
from validation.sweeps.designs import Design, find_numbers
from validation.sweeps.run import Found, list_versions
from validation.text.quantity import find_factor

if TYPE_CHECKING:
    import xarray

_CLAUSE = re.compile(r"\s*(\w+)\s*([<>])\s*([-+.\deE]*\d)\s*(.*?)\s*")
#: Fewest points of an axis between which quantities are interpolated [-].
_FEWEST = 3


@dataclass(frozen=True, kw_only=True)
class Clause:
    """A condition on a quantity.

    Attributes:
        text: The condition as the user wrote it.
        name: Name of the quantity.
        sign: 1 if the quantity must exceed the limit, -1 if it must lie below.
        limit: The limit in its unit.
        unit: Unit of the limit.
    """

    text: str
    name: str
    sign: int
    limit: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A design and a wish.

    Attributes:
        values: Values by key of the sensor file.
        state: `certain`, `possible`, `excluded` or `not computed`.
        reason: First condition that is not certain, with the quantity; or why the design is not computed.
        between: Whether the design lies between computed ones.
    """

    values: Mapping[str, Any]
    state: str
    reason: str
    between: bool


def read_wish(text: str) -> list[Clause]:
    """Read a wish such as `width_x < 4 mm, load_5_percent > 5 N`.

    Raises:
        InputError: If a condition cannot be read.
    """
    found = []
    for part in text.split(","):
        match = _CLAUSE.fullmatch(part)
        if match is None:
            raise InputError(f"--wish: {part.strip()!r} is no condition; write for example 'width_x < 4 mm'")
        name, sign, limit, unit = match.groups()
        try:
            found.append(
                Clause(text=part.strip(), name=name, sign=1 if sign == ">" else -1, limit=float(limit), unit=unit)
            )
        except ValueError:
            raise InputError(f"--wish: {limit!r} in {part.strip()!r} is no number") from None
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Swept:
    """Result of a sweep of n designs.

    Attributes:
        tables: The sweep file.
        designs: The designs.
        results: Results by measurement of each design; None for one that was lost.
        lost: Why designs were lost, by their number.
        wish: Conditions; empty if there is no wish.
    """

    tables: SweepTables
    designs: Sequence[Design]
    results: Sequence[Sequence[Found | None]]
    lost: Mapping[int, str]
    wish: Sequence[Clause] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values along the axes of a grid; the number of designs if they are drawn."""
        drawn = (len(self.designs),)
        return drawn if self.tables.draw else tuple(len(axis.values) for axis in self.tables.designs.values())

    @cached_property
    def words(self) -> list[str]:
        """Why each design has no quantities, or lacks some; empty if it has all."""
        return [
            design.refusal
            or "; ".join(filter(None, [self.lost.get(number), *(each["words"] for each in found if each)]))
            for number, (design, found) in enumerate(zip(self.designs, self.results, strict=True))
        ]

    @cached_property
    def quantities(self) -> dict[str, tuple[str, FloatArray]]:
        """Unit, and value and ends of the error of each design, shape (n, 3), by name; NaN where there is none.

        A name that an earlier measurement has ends with the number of the measurement.
        """
        cube: dict[str, tuple[str, FloatArray]] = {}
        for number in range(len(self.tables.measure)):
            own: dict[str, tuple[str, FloatArray]] = {}
            for row, found in enumerate(self.results):
                for name, (*numbers, unit) in (found[number] or {}).get("quantities", {}).items() if found else ():
                    label = f"{name}_{number + 1}" if name in cube else name
                    empty = np.full((len(self.designs), 3), np.nan)
                    own.setdefault(label, (unit, empty))[1][row] = numbers
            cube |= own
        return cube

    @cached_property
    def axes(self) -> dict[str, tuple[list[Any], tuple[FloatArray, str] | None]]:
        """Values along each axis of a grid, or of all drawn designs, and their numbers with the unit, by key."""
        listed = {
            key: [design.values[key] for design in self.designs] if self.tables.draw else list(axis.values)
            for key, axis in self.tables.designs.items()
        }
        return {key: (values, find_numbers(values)) for key, values in listed.items()}

    def check_wish(self) -> None:
        """Refuse a wish for unknown quantities or with units of another kind.

        Raises:
            InputError: If there is a fault and some design was measured.
        """
        for clause in self.wish if self.quantities else ():
            check_choice("--wish", "quantity", clause.name, self.quantities)
            unit = self.quantities[clause.name][0]
            if find_factor(clause.unit, unit) is None:
                raise InputError(
                    f"--wish: {clause.text!r}: {clause.name} has the unit {unit}; write for example '< 1 {unit}'"
                )

    def judge(self) -> Iterator[Judged]:
        """Yield every design, and every one half-way between those of a grid, with what is known of the wish."""
        whole = {clause.name: self.quantities[clause.name][1] for clause in self.wish if self.quantities}
        for row, design in enumerate(self.designs):
            missing = not whole or any(np.isnan(each[row]).all() for each in whole.values())
            state, reason = ("not computed", self.words[row]) if missing else self._judge(whole, row)
            yield Judged(values=design.values, state=state, reason=reason, between=False)
        numbers = [found for _, found in self.axes.values()]
        if self.tables.draw or not whole or any(each is None or len(each[0]) < _FEWEST for each in numbers):
            return
        lines = [each[0] for each in numbers if each]
        if any((np.diff(each) <= 0).any() for each in lines) or math.prod(2 * n - 1 for n in self.shape) > MOST_DESIGNS:
            return
        places = np.array(list(itertools.product(*(np.arange(2 * n - 1) / 2 for n in self.shape))))
        places = places[(places % 1 > 0).any(axis=1)]
        points = np.stack([np.interp(places[:, k], range(n), lines[k]) for k, n in enumerate(self.shape)], axis=-1)
        filled = {name: self._interpolate(table, lines, points, places % 1 > 0) for name, table in whole.items()}
        for row, point in enumerate(points):
            state, reason = self._judge(filled, row)
            values = {
                key: write_value(x, found[1])
                for x, (key, (_, found)) in zip(point, self.axes.items(), strict=True)
                if found
            }
            yield Judged(values=values, state=state, reason=reason, between=True)

    def _interpolate(
        self, table: FloatArray, lines: Sequence[FloatArray], points: FloatArray, beside: BoolArray
    ) -> FloatArray:
        """Interpolate a quantity of a grid, with its error, shape (m, 3).

        Args:
            table: Value and ends of its error, shape (n, 3).
            lines: Numbers along the k axes.
            points: Places, shape (m, k).
            beside: Whether each place lies between points along each axis, shape (m, k).
        """
        from scipy.interpolate import RegularGridInterpolator

        grid, error = table.reshape(*self.shape, 3), np.zeros(len(points))
        with np.errstate(invalid="ignore"):
            found = np.stack([RegularGridInterpolator(lines, grid[..., k])(points) for k in range(3)], axis=-1)
            for axis, line in enumerate(lines):
                values = np.moveaxis(grid[..., 0], axis, -1)
                share = (line[1:-1] - line[:-2]) / (line[2:] - line[:-2])
                left_out = values[..., :-2] * (1 - share) + values[..., 2:] * share
                error += np.where(beside[:, axis], np.abs(left_out - values[..., 1:-1]).max(), 0.0)
            found += error[:, None] * np.array([0, -1, 1])
        ends = np.array([np.nan, -np.inf, np.inf])
        return np.where(np.isnan(found), ends, found)

    def _judge(self, tables: Mapping[str, FloatArray], row: int) -> tuple[str, str]:
        """Judge the wish from value and ends of the error of the quantities; return the state and the reason."""
        state, reason = "certain", ""
        for clause in self.wish:
            unit, limit = self.quantities[clause.name][0], clause.limit
            limit *= find_factor(clause.unit, unit) or math.nan
            value, *ends = tables[clause.name][row]
            worst, best = (clause.sign * end for end in ends[:: clause.sign])
            text = f"{clause.name} {value:.4g} ({ends[0]:.4g} to {ends[1]:.4g}) {unit}, wished {clause.text}"
            if best <= clause.sign * limit:
                return "excluded", text
            if worst <= clause.sign * limit:
                state, reason = "possible", reason or text
        return state, reason

    def as_json(self) -> dict[str, Any]:
        """Return designs, quantities and the verdicts on the wish as a dictionary of JSON values."""
        keys = ("value", "low", "high")
        return {
            "versions": list_versions(),
            "lost": len(self.lost),
            "units": {name: unit for name, (unit, _) in self.quantities.items()},
            "designs": [
                {"values": design.values, "words": self.words[row]}
                | {
                    "quantities": {
                        name: dict(zip(keys, each[row].tolist(), strict=True))
                        for name, (_, each) in self.quantities.items()
                    }
                }
                for row, design in enumerate(self.designs)
            ],
            "wish": [vars(each) for each in self.judge()] if self.wish else [],
        }

    def make_cube(self) -> xarray.Dataset:
        """Make the cube: a dimension per axis of a grid, or `design`; ends of errors as `NAME_low` and `NAME_high`."""
        import xarray

        names = ["design"] if self.tables.draw else list(self.axes)
        variables: dict[str, Any] = {"words": (names, np.array(self.words).reshape(self.shape))}
        for name, (unit, table) in self.quantities.items():
            for suffix, column in zip(("", "_low", "_high"), table.T, strict=True):
                variables[name + suffix] = (names, column.reshape(self.shape), {"units": unit})
        coordinates = {}
        for key, (values, numbers) in self.axes.items():
            listed, unit = numbers or (np.array(values, dtype=str), "")
            coordinates[key] = ("design" if self.tables.draw else key, listed, {"units": unit})
        about = {"versions": list_versions(), "sweep": self.tables.model_dump(mode="json")}
        return xarray.Dataset(variables, coordinates, {name: json.dumps(each) for name, each in about.items()})

    def explain(self) -> Iterator[str]:
        """Yield sentences about failures, costs and the wish."""
        failed = sum(map(bool, self.words))
        seconds = sum(each["seconds"] for found in self.results for each in found if each)
        count = len(self.designs)
        yield f"{count} designs, {count - failed} measured in full, in {seconds:.3g} s of processor time."
        for words, count in Counter(filter(None, self.words)).most_common(10):
            yield f"{count} x: {words}."
        if self.wish:
            judged = list(self.judge())
            for between, where in ((False, "designs"), (True, "places half-way between designs")):
                counted = Counter(each.state for each in judged if each.between == between)
                if counted:
                    yield f"Wish, {where}: {', '.join(f'{count} {state}' for state, count in counted.items())}."
