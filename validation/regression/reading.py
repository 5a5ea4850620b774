"""Input and output of a regression check: a sensor, and readings (values with unit and tolerance)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel import Parameters
from meshes import TexelArray
from validation.derivation.derive import Derivation

if TYPE_CHECKING:
    from validation.campaign.bench import Bench
    from validation.campaign.results import CampaignResult

#: Value of a quantity, in SI units: a number, numbers by label, or an image as rows of numbers by label.  None if the
#: quantity does not apply to a sensor.
Value = float | Mapping[str, float | Sequence[float]] | None
#: Factors from SI units to the units of the baseline.
_FACTORS: Mapping[str, float] = MappingProxyType(
    {"ms": 1e3, "mm": 1e3, "mN": 1e3, "N mm": 1e3, "mm2": 1e6, "%": 1e2, "% of load": 1e2, "N/mm3": 1e-9}
)
#: Smallest tolerance of a quantity whose numbers are all zero, in its unit.
_LEAST = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """A sensor whose quantities a regression check measures.

    Attributes:
        parameters: Parameters of its fast model.
        derivation: Derivation of the parameters by finite elements; None for a folder of parameters.
        seed: Seed of all random numbers in the experiments.
        progress: Called with the number of finished cases, the number of all cases and the name of the next case.
    """

    parameters: Parameters
    derivation: Derivation | None = None
    seed: int = 0
    progress: Callable[[int, int, str], None] | None = None

    @cached_property
    def bench(self) -> Bench | None:
        """The sensor's fast model and the reference without friction; None for a folder of parameters."""
        return self._prepare_bench(self.parameters)

    @cached_property
    def comparison(self) -> Bench | None:
        """The same with the derived parameters, and with all comparison models, fitted."""
        return self._prepare_bench(None)

    def _prepare_bench(self, parameters: Parameters | None) -> Bench | None:
        if self.derivation is None:
            return None
        import validation.campaign.evaluation  # noqa: F401 -- registers the benches of all kinds of covers
        from validation.campaign.bench import prepare_bench

        sensor = replace(self.derivation.sensor, friction=0.0)
        derivation = replace(self.derivation, sensor=sensor)  # type: ignore[type-var]
        return prepare_bench(derivation, (), parameters=parameters)

    @cached_property
    def campaign(self) -> CampaignResult | None:
        """Scores of the fast model in the default list of cases; None for a folder of parameters."""
        if self.derivation is None or self.bench is None:
            return None
        from validation.campaign.evaluation import read_plan
        from validation.campaign.run import run_campaign

        cases = read_plan(None, self.derivation.sensor).cases
        return run_campaign(self.bench, cases, progress=self.progress)


def describe_sensor(name: str, array: TexelArray, *, derived: bool) -> str:
    """Describe in one line the properties that must be equal in two compared measurements: name, texels, and origin.

    Args:
        name: Name of the sensor.
        array: Texels of the sensor.
        derived: Whether the parameters are derived by finite elements for the measurement.
    """
    x, y = (1e3 * pitch for pitch in array.pitch)
    origin = "with" if derived else "without"
    return f"{name}: {array.rows} rows x {array.columns} columns, pitch {x:.6g} x {y:.6g} mm, {origin} finite elements"


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The value of a quantity, measured or stored.

    Attributes:
        unit: Unit of the numbers.
        tolerance: Largest difference of two numbers that is no change, in the unit or as a share of the stored number.
        relative: Whether the tolerance is a share [-].
        numbers: Numbers by label; a quantity of one number has the label "".  An image has one label per row.
    """

    unit: str
    tolerance: float
    relative: bool
    numbers: Mapping[str, tuple[float, ...]]

    @property
    def form(self) -> tuple[str, dict[str, int]]:
        """Unit, and number of values by label; readings are comparable if both are equal."""
        return self.unit, {label: len(row) for label, row in self.numbers.items()}


#: Return value of an experiment: readings by name of the quantity, None for a quantity that does not apply to the
#: sensor.
Readings = dict[str, Reading | None]


def read(value: Value, unit: str, tolerance: float | str) -> Reading | None:
    """Convert the value of a quantity from SI units, and round it by its tolerance; None if it is None.

    Args:
        value: The value in SI units.
        unit: Unit in the baseline.
        tolerance: Largest difference that is no change: a number in the unit, or a text.  The text is `1 % of each` for
            every number by itself, or `1 % of largest` for the largest absolute number of the quantity.
    """
    if value is None:
        return None
    factor = _FACTORS.get(unit, 1.0)
    labelled = value if isinstance(value, Mapping) else {"": value}
    rows = {label: factor * np.atleast_1d(np.asarray(each, dtype=np.float64)) for label, each in labelled.items()}
    relative = isinstance(tolerance, str) and tolerance.endswith(" % of each")
    if not isinstance(tolerance, str):
        allowed = tolerance
    elif relative:
        allowed = float(tolerance.partition(" ")[0]) / 100
    else:
        largest = max((float(abs(each)) for row in rows.values() for each in row if math.isfinite(each)), default=0.0)
        allowed = float(f"{max(float(tolerance.partition(' ')[0]) / 100 * largest, _LEAST):.2g}")
    numbers = {
        label: tuple(_round(number, allowed * (abs(number) if relative else 1)) for number in row.tolist())
        for label, row in rows.items()
    }
    return Reading(unit=unit, tolerance=allowed, relative=relative, numbers=numbers)


def _round(number: float, tolerance: float) -> float:
    """Round a number to about a thousandth of its tolerance, so that files are easy to read."""
    if not math.isfinite(number) or tolerance <= 0:
        return number
    return round(number, 3 - math.floor(math.log10(tolerance))) + 0.0


def list_numbers(tree: object, label: str = "") -> dict[str, list[float]]:
    """List the numbers of nested mappings, sequences and dataclasses by their place, without texts.

    Numbers that are not finite are left out, of a row by themselves, whose other numbers are listed one by one then.

    Args:
        tree: The values; a sequence of numbers is one row.
        label: Place of the values.
    """
    if is_dataclass(tree) and not isinstance(tree, type):
        tree = {each.name: getattr(tree, each.name) for each in fields(tree)}
    elif isinstance(tree, np.ndarray | float | int):
        tree = np.atleast_1d(np.asarray(tree, dtype=np.float64)).tolist()
    parts: Iterable[tuple[object, object]] = ()
    if isinstance(tree, Mapping):
        parts = tree.items()
    elif not isinstance(tree, list | tuple):
        return {}
    elif not all(isinstance(each, float | int) for each in tree) or (len(tree) > 1 and not np.isfinite(tree).all()):
        parts = enumerate(tree)
    else:
        return {label: [float(each) for each in tree]} if np.isfinite(tree).all() else {}
    return {
        place: row
        for name, part in parts
        for place, row in list_numbers(part, f"{label}, {name}" if label else str(name)).items()
    }


def find_unit(metric: str) -> str:
    """Return the unit of a metric in the baseline, from the name of the metric."""
    kinds = {"_m": "mm", "image": "% of white", "pixels": "texels"}
    return next((unit for part, unit in kinds.items() if metric.startswith(part) or metric.endswith(part)), "%")


def list_rows(image: npt.ArrayLike) -> dict[str, list[float]]:
    """Convert an image, shape (rows, columns), to lists of numbers by the label of the row."""
    rows = np.asarray(image, dtype=np.float64)
    digits = len(str(len(rows) - 1))
    return {f"row {index:0{digits}}": row for index, row in enumerate(rows.tolist())}
