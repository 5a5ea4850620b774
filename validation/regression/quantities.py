"""The table of quantities that a regression check guards, and their measurement.

To guard one more number, let an experiment return it under a new name, and add a line to `_TABLE`.
`docs/regression.md` explains the quantities and the choice of their tolerances.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from validation.regression.electronics import STAGES, measure_characteristic, measure_stages
from validation.regression.fixed_images import pool_fixed_scores, score_fixed_images
from validation.regression.pressing import FLAT_METHODS, measure_spread, press_ball, press_letter, press_oblong
from validation.regression.reference import compare_shipped, measure_accuracy, measure_derivation, measure_reference
from validation.regression.running import (
    measure_frames,
    measure_letter,
    measure_load_step,
    measure_noise,
    measure_reset,
)
from validation.regression.subject import Subject, Value, Values

#: Experiments by the group of quantities that each one gives.
EXPERIMENTS: Mapping[str, Callable[[Subject], Values]] = MappingProxyType(
    {
        "characteristic": measure_characteristic,
        "electronics": measure_stages,
        "filter": measure_load_step,
        "frames": measure_frames,
        "noise": measure_noise,
        "reset": measure_reset,
        "orientation": measure_letter,
        "spread": measure_spread,
        "H": press_letter,
        "ball": press_ball,
        "oblong texels": press_oblong,
        "metric": score_fixed_images,
        "pooling": pool_fixed_scores,
        "kernel": measure_derivation,
        "shipped parameters": compare_shipped,
        "reference": measure_reference,
        "accuracy": measure_accuracy,
    }
)
#: Factors from SI units to the units of the baseline.
_FACTORS: Mapping[str, float] = MappingProxyType(
    {"ms": 1e3, "mm": 1e3, "mN": 1e3, "N mm": 1e3, "mm2": 1e6, "%": 1e2, "% of load": 1e2, "N/mm3": 1e-9}
)
#: Smallest tolerance of a quantity whose numbers are all zero, in its unit.
_LEAST = 1e-9


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A guarded quantity: one number, or numbers by label.

    Attributes:
        group: Key of the experiment in `EXPERIMENTS`.
        name: Name under which the experiment returns the value.
        unit: Unit in the baseline.
        tolerance: Largest difference that counts as none, see `_TABLE`.
    """

    group: str
    name: str
    unit: str
    tolerance: float | str

    @property
    def title(self) -> str:
        """Name of the quantity in baselines and reports."""
        name = self.name.removesuffix("_m").removesuffix("_percent")
        return f"{self.group}: {name.replace('_', ' ')}"


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The value of a quantity, measured or stored.

    Attributes:
        unit: Unit of the numbers.
        tolerance: Largest difference of two numbers that counts as none: in the unit, or a share of the stored number.
        relative: Whether the tolerance is a share [-].
        numbers: Numbers by label; a quantity of one number has the label "".  An image has one label per row.
    """

    unit: str
    tolerance: float
    relative: bool
    numbers: Mapping[str, tuple[float, ...]]


#: The guarded quantities: group, name under which the group's experiment returns it, unit, and tolerance.  A tolerance
#: is a number in the unit, or a text: `1 % of each`, of every number by itself, or `1 % of largest`, of the largest
#: absolute number of the quantity.
_TABLE: tuple[tuple[str, str, str, float | str], ...] = (
    ("characteristic", "force", "mN", "0.2 % of each"),
    ("characteristic", "sensitivity", "counts/N", "0.5 % of each"),
    ("characteristic", "largest count (saturation)", "counts", 1.5),
    ("characteristic", "counts of each texel", "counts", 1.5),
    ("characteristic", "frame rate", "Hz", "0.01 % of each"),
    ("characteristic", "noise", "mN", "0.1 % of largest"),
    *(("electronics", stage, "counts", 0.5) for stage in STAGES),
    ("filter", "rise time", "ms", "1 % of each"),
    ("filter", "overshoot", "%", 0.2),
    ("filter", "force after the step", "N", "0.2 % of each"),
    ("frames", "time of the first frames", "ms", 0.01),
    ("frames", "frames per second", "Hz", "0.1 % of each"),
    ("frames", "delay of the force", "ms", 0.1),
    ("frames", "delay of the time", "ms", 0.01),
    ("noise", "standard deviation", "mN", "5 % of each"),
    ("noise", "mean", "mN", 5.0),
    ("noise", "difference for the same seed", "mN", 0.5),
    ("noise", "correlation", "-", 0.1),
    ("reset", "counts after a reset", "counts", "0.1 % of each"),
    ("reset", "trace of the load before", "counts", 1.5),
    ("orientation", "image", "grey levels", 2.0),
    ("orientation", "net force", "N", "0.5 % of largest"),
    ("orientation", "net torque", "N mm", "0.5 % of largest"),
    ("orientation", "force outside", "% of load", 0.05),
    ("spread", "share", "%", 0.1),
    ("spread", "share outside", "%", 0.1),
    ("spread", "foundation modulus", "N/mm3", "0.5 % of each"),
    *(
        (group, f"{method}, {name}", unit, tolerance)
        for group, methods in (("H", FLAT_METHODS), ("ball", ("foundation", "cover")), ("oblong texels", FLAT_METHODS))
        for method in methods
        for name, unit, tolerance in (
            ("force of each texel", "mN", "1 % of largest"),
            ("largest force after spread", "mN", "0.5 % of each"),
            ("load carried", "N", "0.2 % of each"),
            ("force outside", "% of load", 0.05),
            ("depth", "mm", "1 % of each"),
        )
    ),
    *(
        ("metric", name, unit, "0.1 % of each")
        for unit, names in (
            ("%", ("total_force_error", "misplaced_force", "relative_l2", "active_area_iou", "peak_error")),
            ("mm", ("centre_of_pressure_m", "wasserstein_m", "width_error_x_m", "width_error_y_m")),
            ("% of white", ("image_changed_percent", "image_changed_line_percent")),
            ("texels", ("pixels_changed", "pixels_changed_line", "pixels_lit_line")),
        )
        for name in names
    ),
    ("metric", "fixed images", "-", "0.1 % of each"),
    ("pooling", "mean", "-", "0.1 % of each"),
    ("pooling", "skill", "-", "0.1 % of each"),
    ("kernel", "sigma", "pitches", "0.5 % of each"),
    ("kernel", "ksize", "texels", 0.5),
    ("kernel", "residual", "%", 0.1),
    ("kernel", "outside the kernel", "%", 0.1),
    ("kernel", "share on the loaded texel", "%", 0.1),
    ("kernel", "share outside", "%", 0.05),
    ("kernel", "share of the calibration tip", "%", 0.3),
    ("kernel", "foundation modulus", "N/mm3", "1 % of each"),
    ("kernel", "depth of a ball", "mm", "0.5 % of each"),
    ("kernel", "range of the fast model", "N", "5 % of each"),
    ("kernel", "estimated error", "%", "20 % of each"),
    ("shipped parameters", "difference", "%", 0.1),
    ("reference", "load", "N", "0.1 % of each"),
    ("reference", "largest texel force", "mN", "0.2 % of each"),
    ("reference", "force outside", "% of load", 0.1),
    ("reference", "depth", "mm", "0.2 % of each"),
    ("reference", "contact area", "mm2", "0.5 % of each"),
    ("reference", "imbalance", "% of load", 0.02),
    ("reference", "estimated error", "%", "20 % of each"),
    ("accuracy", "misplaced_force", "%", 0.05),
    ("accuracy", "relative_l2", "%", 0.1),
    ("accuracy", "total_force_error", "%", 0.02),
    ("accuracy", "centre_of_pressure_m", "mm", 0.002),
    ("accuracy", "image_changed_percent", "% of white", 0.02),
    ("accuracy", "mean misplaced force of each method", "%", "2 % of each"),
    ("accuracy", "skipped cases", "cases", 0.5),
)
QUANTITIES = tuple(
    Quantity(group=group, name=name, unit=unit, tolerance=tolerance) for group, name, unit, tolerance in _TABLE
)


def measure(
    subject: Subject,
    *,
    groups: Mapping[str, Callable[[Subject], Values]] = EXPERIMENTS,
    progress: Callable[[str], None],
) -> tuple[dict[str, Reading], dict[str, str]]:
    """Run experiments on a sensor.

    Args:
        subject: The sensor.
        groups: The experiments to run, by group of quantities.
        progress: Called with the name of each group before its experiment.

    Returns:
        The readings by title of the quantity, without quantities that do not apply to the sensor; and by title of the
        quantity why it could not be measured.
    """
    readings: dict[str, Reading] = {}
    failures: dict[str, str] = {}
    for group, experiment in groups.items():
        progress(group)
        mine = [quantity for quantity in QUANTITIES if quantity.group == group]
        try:
            values = experiment(subject)
        except ValueError as error:  # all packages raise subclasses of it for input that they cannot compute
            failures |= {quantity.title: " ".join(str(error).split()) for quantity in mine}
            continue
        for quantity in mine:
            if (value := values.get(quantity.name)) is not None:
                readings[quantity.title] = make_reading(quantity, value)
    return readings, failures


def make_reading(quantity: Quantity, value: Value) -> Reading:
    """Convert the value of a quantity from SI units, and round it by its tolerance."""
    factor = _FACTORS.get(quantity.unit, 1.0)
    labelled = value if isinstance(value, Mapping) else {"": float(value or 0.0)}
    rows = {
        label: [factor * number for number in ([each] if isinstance(each, int | float) else each)]
        for label, each in labelled.items()
    }
    tolerance, relative = _read_tolerance(quantity.tolerance, [number for row in rows.values() for number in row])
    return Reading(
        unit=quantity.unit,
        tolerance=tolerance,
        relative=relative,
        numbers={
            label: tuple(_round(number, tolerance * (abs(number) if relative else 1)) for number in row)
            for label, row in rows.items()
        },
    )


def _read_tolerance(tolerance: float | str, numbers: Sequence[float]) -> tuple[float, bool]:
    """Return a tolerance of `_TABLE` for given numbers, and whether it is a share of each number."""
    if not isinstance(tolerance, str):
        return tolerance, False
    share, _, of = tolerance.partition(" % of ")
    if of == "each":
        return float(share) / 100, True
    largest = max((abs(number) for number in numbers if math.isfinite(number)), default=0.0)
    return float(f"{max(float(share) / 100 * largest, _LEAST):.2g}"), False


def _round(number: float, tolerance: float) -> float:
    """Round a number to about a thousandth of its tolerance, so that files are easy to read."""
    if not math.isfinite(number) or tolerance <= 0:
        return number
    return round(number, 3 - math.floor(math.log10(tolerance))) + 0.0
