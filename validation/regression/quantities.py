"""The table of quantities that a regression check guards, and their measurement.

To guard one more number, let an experiment return it under a new name, and add a line to `_TABLE`.
`docs/regression.md` explains the quantities and the choice of their tolerances.  The experiments here need finite
elements: derived parameters, results of the cases, and accuracy of the fast model.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

import fastmodel
from fastmodel import Parameters
from validation.campaign.results import CaseResult
from validation.metrics import METRICS
from validation.regression.experiments import (
    AREA_METHODS,
    METHODS_OF,
    STAGES,
    Subject,
    Value,
    Values,
    measure_characteristic,
    measure_frames,
    measure_letter,
    measure_load_step,
    measure_noise,
    measure_reset,
    measure_spread,
    measure_stages,
    pool_fixed_scores,
    press_ball,
    press_letter,
    press_oblong,
    score_fixed_images,
)
from validation.sensor_file import BUILT_IN


def measure_derivation(subject: Subject) -> Values:
    """Take the fitted Gaussian, the response of the cover, its stiffness and the estimated errors of the derivation."""
    found = subject.derivation
    if found is None:
        return {}
    result, pitch = found.result, found.sensor.array.pitch
    kernel, surface = result.psf, result.gaussian
    outside = {"point": result.texel_response_outside, "uniform": result.texel_response_uniform_outside}
    loads = {"2 %": result.load_2_percent, "5 %": result.load_5_percent}
    tip = result.calibration["tip"]
    values: dict[str, Value] = {
        "share on the loaded texel": found.own_share,
        "share outside": {name: each for name, each in outside.items() if each is not None} or None,
        "share of the calibration tip": tip and tip["share"],
        "foundation modulus": result.foundation_modulus,
        "depth of a ball": result.depth and {"depths": list(result.depth["depth"])},
        "range of the fast model": {name: each for name, each in loads.items() if each is not None} or None,
        "estimated error": {name: each for name, each in found.error_estimate.items() if math.isfinite(each)} or None,
    }
    if kernel is not None:
        values |= {
            "sigma": {"x": kernel.sigma_x, "y": kernel.sigma_y},
            "ksize": {"x": kernel.ksize_x, "y": kernel.ksize_y},
            "residual": kernel.residual,
            "outside the kernel": kernel.outside_kernel,
        }
    if surface is not None:
        along = zip("xy", surface.sigma_m, pitch, strict=True)
        values |= {"sigma": {axis: sigma / each for axis, sigma, each in along}, "residual": surface.residual}
    return values


def compare_shipped(subject: Subject) -> Values:
    """Compare the parameters that come with the package with those derived anew; for built-in sensors only."""
    found = subject.derivation
    if found is None or found.sensor is not BUILT_IN.get(found.sensor.name):
        return {}
    shipped, derived = fastmodel.load(found.sensor.name), found.parameters
    array = shipped.array

    def differ(take: Callable[[Parameters], npt.ArrayLike]) -> float:
        one, other = np.asarray(take(shipped)), np.asarray(take(derived))
        return float(np.abs(one - other).max() / np.abs(other).max()) if one.shape == other.shape else 1.0

    parts: dict[str, Callable[[Parameters], npt.ArrayLike]] = {
        "texels": lambda each: each.array.centres,
        "mask": lambda each: each.array.active.astype(np.float64),
        "spread": lambda each: each.spread.operator(array),
    }
    if shipped.surface is not None and derived.surface is not None:
        parts["compliance of the cover"] = lambda each: each.surface.compliance if each.surface else 0.0
        parts["influence of the cover"] = lambda each: each.surface.influence if each.surface else 0.0
    same = (
        dataclasses.replace(shipped.electronics, tip_share=None)
        == dataclasses.replace(derived.electronics, tip_share=None),
        shipped.filter == derived.filter,
    )
    differences = {name: differ(take) for name, take in parts.items()}
    differences["calibration tip"] = differ(lambda each: each.electronics.applied_share)
    return {"difference": {**differences, "electronics": float(not same[0]), "filter": float(not same[1])}}


def measure_reference(subject: Subject) -> Values:
    """Take the results of the finite elements in all cases, relative to the load where that is possible."""
    campaign = subject.campaign
    if campaign is None:
        return {}

    def collect(take: Callable[[CaseResult], float]) -> dict[str, float]:
        return {result.case.name: take(result) for result in campaign.cases}

    estimates = campaign.noise_floor
    return {
        "load": collect(lambda each: each.reference.total_force),
        "largest texel force": collect(lambda each: float(each.reference.texel_forces.max())),
        "force outside": collect(lambda each: each.reference.outside / each.case.load),
        "depth": collect(lambda each: each.reference.depth),
        "contact area": collect(lambda each: each.reference.contact_area),
        "imbalance": collect(lambda each: each.reference.balance or 0.0),
        "estimated error": {name: value for name, value in estimates.items() if value > 0},
    }


def measure_accuracy(subject: Subject) -> Values:
    """Take the scores of the fast model against the finite elements in all cases, and means of other methods."""
    campaign = subject.campaign
    if campaign is None:
        return {}
    scores = {result.case.name: result.predictions["fast"].score.as_json() for result in campaign.cases}
    cases = {
        each.name: {case: float(value) for case, score in scores.items() if (value := score[each.name]) is not None}
        for each in QUANTITIES
        if each.group == "accuracy" and each.name in METRICS
    }
    models = [name for name, meaning in campaign.models.items() if not meaning.startswith("null")]
    means = {model: campaign.pooled[model]["misplaced_force"].mean for model in models}
    return {**cases, "mean misplaced force of each method": means, "skipped cases": float(len(campaign.skipped))}


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
        for group, methods in (
            ("H", (*METHODS_OF["cover"], *METHODS_OF["curved"])),
            ("ball", AREA_METHODS),
            ("oblong texels", METHODS_OF["cover"]),
        )
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
