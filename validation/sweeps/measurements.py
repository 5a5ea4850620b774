"""What a sweep measures: each measurement takes a sensor, and returns quantities with the ends of their errors by name.

A measurement is a command with its options; `regress GROUP` measures what the regression check guards, each number
within its tolerance.
"""

from __future__ import annotations

import inspect
import math
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from validation import api
from validation.errors import InputError, at, check_choice
from validation.metrics import METRICS, Score
from validation.pressing import read_request
from validation.resolution.verb import limits, read_limits
from validation.results import Result, columns
from validation.results.derivation import Kernel, Responses, SurfaceKernel
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from validation.campaign.evaluation import Evaluation
    from validation.derivation.derive import Derivation

#: Smallest relative error of quantities of the finite elements [-], and that of those whose own rule is coarser.
_LEAST = 0.005
_COARSE = {"load_2_percent": 0.05, "load_5_percent": 0.05, "foundation_modulus": 0.01}
#: Relative error of a limit that is a bound, and of one that is averaged over simulated frames [-].
_BOUND, _SIMULATED = 0.01, 0.1
#: Units of the numbers of a press.
_PRESSED = {"total_force": "N", "depth": "m", "contact_area": "m2", "outside": "N"}


class Quantity(NamedTuple):
    """A number with the ends of its error, in a unit.

    Attributes:
        value: The number; NaN if it is not known, inf if there is none.
        low, high: Ends of its error.
        unit: Unit.
    """

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """A sensor, and its derivation when a measurement asks for it.

    Attributes:
        sensor: The sensor.
    """

    sensor: SensorDescription

    @cached_property
    def derivation(self) -> Derivation:
        """Derivation of the sensor."""
        return api.derive(self.sensor)


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A command with its options.

    Attributes:
        command: Name in `COMMANDS`.
        options: Options as keyword arguments.
    """

    command: str
    options: Mapping[str, Any]

    def run(self, subject: Subject) -> dict[str, Quantity]:
        """Measure a sensor."""
        return COMMANDS[self.command](subject, **self.options)

    def check(self, sensor: SensorDescription) -> None:
        """Read the values of the options, and compute nothing.

        Raises:
            InputError: If a value cannot be read or used with the sensor.
        """
        options = dict(self.options)
        with at(f"measure: {self.command}: "):
            if self.command == "limits":
                read_limits(sensor, **{name: each for name, each in options.items() if name != "prior"})
            elif self.command == "press":
                pose = {name: options.pop(name, None) for name in ("at", "direction", "yaw", "tilt")}
                read_request(lambda _: sensor, options.pop("indenter", ""), pose=pose, **options)

    @property
    def names(self) -> set[str]:
        """Names that its quantities may have, without numbers at their ends; empty if they are not known yet."""
        return NAMES[self.command](self.options)


def read_measurement(text: str) -> Measurement:
    """Read a command with options, such as `limits --noise 5mN`.

    Raises:
        InputError: If the command or an option is unknown.
    """
    try:
        command, *words = shlex.split(text)
    except ValueError:
        raise InputError(f"measure: {text!r} is no command; write for example 'limits --noise 5mN'") from None
    check_choice("measure", "command", command, COMMANDS)
    options: dict[str, Any] = {}
    if command == "regress":
        from validation.regression.quantities import EXPERIMENTS

        check_choice("measure", "group of `regress`", " ".join(words), EXPERIMENTS)
        return Measurement(command=command, options={"group": " ".join(words)})
    parameters = inspect.signature({"limits": limits}.get(command) or getattr(api, command)).parameters.values()
    read = re.compile(r"str|str \| None|bool|Literal\[.*\](?: \| None)?")
    known = {each.name: each.annotation for each in parameters if read.fullmatch(str(each.annotation))}
    while words:
        option = words.pop(0)
        name = option.removeprefix("--").replace("-", "_")
        check_choice(f"measure: {command}", "option", option, [f"--{each.replace('_', '-')}" for each in known])
        if known[name] != "bool" and not words:
            raise InputError(f"measure: {command} {option}: needs a value")
        options[name] = True if known[name] == "bool" else words.pop(0)
        if choices := re.findall(r"[\"']([^\"']+)", known[name]) if "Literal" in known[name] else ():
            check_choice(f"measure: {command} {option}", "value", options[name], choices[::2])
    return Measurement(command=command, options=options)


def _about(value: float | None, error: float, unit: str) -> Quantity:
    """Make a quantity with a symmetrical error; without a value nothing is known."""
    if value is None or math.isnan(value):
        return Quantity(math.nan, -math.inf, math.inf, unit)
    return Quantity(float(value), value - error, value + error, unit)


def _read_columns(result: Result | None, share: float) -> dict[str, Quantity]:
    """Return the numbers of a result that have a printed form, in its unit, with a relative error [-]."""
    found = {}
    for name, column in columns(type(result)).items() if result is not None else ():
        value = getattr(result, name)
        parts = {f"{name}_{k}": each for k, each in enumerate(value, 1)} if isinstance(value, tuple) else {name: value}
        for key, each in parts.items():
            if not isinstance(each, str | Mapping):
                number = None if each is None else column.factor * each
                error = max(share, _COARSE.get(name, 0.0)) * abs(number or 0.0)
                found[key] = _about(number, error, column.unit)
    return found


def _find_share(estimates: Mapping[str, float]) -> float:
    return max([_LEAST, *(each for each in estimates.values() if math.isfinite(each))])


def _derive(subject: Subject) -> dict[str, Quantity]:
    derivation = subject.derivation
    result, share = derivation.result, _find_share(derivation.error_estimate)
    found = {
        key: each for part in (result, result.psf, result.gaussian) for key, each in _read_columns(part, share).items()
    }
    for axis, pitch in zip("xy", subject.sensor.array.pitch, strict=True):
        if result.psf is not None:
            sigma = found[f"sigma_{axis}"]
            value, low, high = (1e3 * pitch * each for each in sigma[:3])
            found[f"width_{axis}"] = Quantity(value, low, high, "mm")
    largest = math.inf if isinstance(result.validity, str) else result.validity["largest_load"]
    for name in ("load_2_percent", "load_5_percent"):
        if found[name].value >= largest:  # The fast model was compared up to this load only.
            found[name] = found[name]._replace(high=math.inf)
    return found


def _limits(subject: Subject, **options: Any) -> dict[str, Quantity]:  # noqa: ANN401 -- options of a command
    found = {}
    for each in limits(subject.sensor, **options).counted:
        unit, factor = ("um", 1e6) if each.unit == "m" else ("mN", 1e3)
        value = math.inf if each.value is None else factor * each.value
        share = 0.0 if math.isinf(value) else _BOUND if each.posterior is None or each.counts == "bound" else _SIMULATED
        found[_name(each.name)] = Quantity(value, value * (1 - share), value * (1 + share), unit)
    return found


def _press(subject: Subject, *, indenter: str = "", **options: Any) -> dict[str, Quantity]:  # noqa: ANN401 -- options of a command
    found = api.press(subject.sensor, indenter, **options)
    fem = found.fem
    share = _find_share(fem.error_estimate) if fem else _LEAST
    numbers = {name: _about(value := getattr(fem, name), share * abs(value), unit) for name, unit in _PRESSED.items()}
    largest = float(fem.texel_forces.max()) if fem else math.nan
    numbers["largest_texel"] = _about(largest, share * largest, "N")
    return numbers | _read_columns(found.score, share)


def _validate(subject: Subject, **options: Any) -> dict[str, Quantity]:  # noqa: ANN401 -- options of a command
    evaluation = cast("Evaluation", api.validate(subject.sensor, **options))
    found = {}
    for name, mean in evaluation.campaign.pooled["fast"].items():
        column = METRICS[name]
        value, low, high = (column.factor * each for each in (mean.mean, mean.low, mean.high))
        known = math.isfinite(low + high)
        found[f"mean_{name}"] = Quantity(value, *((low, high) if known else (-math.inf, math.inf)), column.unit)
    return found


def _regress(subject: Subject, *, group: str) -> dict[str, Quantity]:
    from validation.regression import reading
    from validation.regression.quantities import EXPERIMENTS, measure

    guarded = reading.Subject(parameters=subject.derivation.parameters, derivation=subject.derivation)
    readings, failures = measure(guarded, groups={group: EXPERIMENTS[group]}, progress=lambda _: None)
    if failures:
        raise InputError(*failures.values())
    found = {}
    for title, each in readings.items():
        for label, row in each.numbers.items():
            for number, value in enumerate(row):
                name = _name(" ".join([title.partition(": ")[2], label, *([str(number)] if len(row) > 1 else [])]))
                found[name] = _about(value, each.tolerance * (abs(value) if each.relative else 1), each.unit)
    return found


def _name(text: str) -> str:
    """Return a text as a name of a quantity: lower case, digits and `_`."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


#: Measurements by command.
COMMANDS: Mapping[str, Callable[..., dict[str, Quantity]]] = {
    "derive": _derive, "limits": _limits, "press": _press, "validate": _validate, "regress": _regress,
}  # fmt: skip
_PLACES = {f"place_{axis}_force_{known}" for axis in "xy" for known in ("known", "unknown")}
#: Names of the quantities of a measurement, without numbers at their ends, from its options; empty if not known before.
NAMES: Mapping[str, Callable[[Mapping[str, Any]], set[str]]] = {
    "derive": lambda _: {"width_x", "width_y", *columns(Kernel), *columns(SurfaceKernel), *columns(Responses)},
    "limits": lambda options: {
        "force", "least_force_over_the_texel", "least_force_worst_place", *_PLACES,
        *(name for name, option in (("radius", "radius"), ("separation", "two")) if option in options),
    },
    "press": lambda _: {*_PRESSED, "largest_texel", *columns(Score)},
    "validate": lambda _: {f"mean_{name}" for name in METRICS},
    "regress": lambda _: set(),
}  # fmt: skip
