"""Reading of campaign files (TOML): cases, what is compared, and what is required of the fast model.

A fault in a case costs that case: it is left out with a line that names its place in the file, and the others are
scored.  A fault outside the cases, for example in the acceptance criterion, is an error.  The default campaign is such
a file in the package.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, singledispatch
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from meshes import Cover, Pose, TexelArray
from validation.campaign.case import Case, name_positions
from validation.errors import InputError, nearest
from validation.schema import parse, read_raw
from validation.schema.campaign import CampaignTables, CaseTable, LoadsForTable
from validation.text.indenter import read_position, read_tilt, read_yaw

if TYPE_CHECKING:
    from validation.sensor_file import SensorDescription

#: Number of cases of `--quick` if the file marks none [-].
_QUICK = 6


@dataclasses.dataclass(frozen=True, kw_only=True)
class Inputs:
    """Standard uncertainties of the inputs of a comparison.

    Attributes:
        modulus: Of every modulus, over the modulus, where the material states no spread [-].
        poisson_ratio: Of every Poisson ratio, where the material states no spread [-].
        thickness: Of every layer, over its thickness [-].
        position: Of the indenter's axis, along x and along y [m].
        yaw: Of the rotation of the indenter about its axis [rad].
        friction: Upper bound of the friction coefficient, inf for no slip; the lower bound is zero [-].
        data: Of measured forces, over the force; 0 if the reference is the data [-].
    """

    modulus: float = 0.1
    poisson_ratio: float = 0.005
    thickness: float = 0.025
    position: float = 1e-4
    yaw: float = 0.0174532925199433
    friction: float = float("inf")
    data: float = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Criterion:
    """What is required of the fast model, by the name of the metric, in SI units or as a fraction.

    Attributes:
        mean: Largest accepted mean over the cases, including its interval.
        each: Largest accepted value in every single case; a case may replace it.
    """

    mean: Mapping[str, float]
    each: Mapping[str, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Campaign:
    """Cases, intended use and acceptance criterion.

    Attributes:
        name: Name of the campaign.
        source: The file, or `built-in`.
        intended_use: What the fast model is to be used for.
        criterion: What is required.
        inputs: Uncertainty of the inputs.
        cases: The cases without faults.
        quick: Names of the cases of a quick run.
        left_out: One line per fault in a case that is left out.
    """

    name: str
    source: str
    intended_use: str
    criterion: Criterion
    inputs: Inputs
    cases: tuple[Case, ...]
    quick: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    def shorten(self) -> Campaign:
        """Return the campaign of a quick run: the marked cases, or the first six if none is marked."""
        chosen = [case for case in self.cases if case.name in self.quick] or self.cases[:_QUICK]
        return dataclasses.replace(self, name=f"{self.name}, quick", cases=tuple(chosen))

    def as_json(self) -> dict[str, Any]:
        """Return name, intended use, criterion and inputs as a dictionary of JSON values."""
        return {
            "name": self.name,
            "source": self.source,
            "intended_use": self.intended_use,
            "required": {"mean": dict(self.criterion.mean), "each": dict(self.criterion.each)},
            "inputs": dataclasses.asdict(self.inputs)
            | {"friction": "no-slip" if math.isinf(self.inputs.friction) else self.inputs.friction},
            "cases": [case.name for case in self.cases],
            "left_out": list(self.left_out),
        }


class Places(Protocol):
    """Named places on a cover, and the default campaign of this kind of cover."""

    @property
    def default(self) -> str:
        """Name of the file with the default campaign."""

    def read(self, given: Mapping[str, Any], place: str) -> Pose:
        """Read the pose of a case: `at`, `yaw`, `tilt`, and what else this kind of cover has.

        Values that are no texts are left out; the schema refuses them.

        Args:
            given: The table of the case.
            place: Place of the table in the file.

        Raises:
            InputError: With one line per fault.
        """

    def scale_loads(self, table: LoadsForTable, source: str) -> float:
        """Return the factor on the loads of a campaign that is written for another cover.

        Raises:
            InputError: If loads are not scaled for this kind of cover.
        """


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class FlatPlaces:
    """Places on planar layers.

    Attributes:
        array: The array, which defines the named positions of the indenter.
    """

    array: TexelArray
    default: str = "default.toml"

    def read(self, given: Mapping[str, Any], place: str) -> Pose:
        """Read `at`, `yaw` and `tilt` of a case; see `Places`."""
        faults = []
        if "direction" in given:
            faults.append(
                f"{place}.direction: is for curved covers; a flat one is pressed along -z, `tilt` turns the body"
            )
        readers: dict[str, Callable[..., Any]] = {"at": self._read_at, "yaw": read_yaw, "tilt": read_tilt}
        parts = {}
        for key, read in readers.items():
            try:
                if isinstance(given.get(key), str):
                    parts[key] = read(given[key], place=f"{place}.{key}")
            except InputError as error:
                faults += error.faults
        if faults:
            raise InputError(*faults)
        return Pose.planar(**parts)

    def scale_loads(self, table: LoadsForTable, source: str) -> float:
        """Refuse to scale the loads; see `Places`."""
        del table
        raise InputError(f"{source}: loads_for: is for curved covers; remove it, and write the loads as they are")

    def _read_at(self, text: str, *, place: str) -> tuple[float, float]:
        named = name_positions(self.array)
        if text in named:
            return named[text]
        if not any(character.isdigit() for character in text):
            raise InputError(
                f"{place}: unknown position {text[:80]!r}; {nearest(text[:80], named)}, or x,y such as '1mm,-2mm'"
            )
        return read_position(text, place=place)


@singledispatch
def find_places(cover: object, sensor: SensorDescription, progress: Callable[[str], None] | None = None) -> Places:
    """Return the places on a cover; each kind of cover registers its own.

    Args:
        cover: The cover of the sensor.
        sensor: The sensor.
        progress: Called with a line of text before each step.

    Raises:
        TypeError: If no function is registered for the cover.
    """
    del sensor, progress
    raise TypeError(f"no campaign is registered for {type(cover).__name__}")


@find_places.register(Cover)
def _(cover: Cover, sensor: SensorDescription, progress: Callable[[str], None] | None = None) -> Places:
    del cover, progress
    return FlatPlaces(array=sensor.array)


def read_campaign(path: Path | None, places: Places) -> Campaign:
    """Read a campaign file, or the default campaign.

    Args:
        path: The file; None for the default campaign.
        places: Places on the cover, see `find_places`.

    Raises:
        InputError: If the file cannot be read as a campaign, has a fault outside the cases, or no case is usable; one
            line per fault.
        OSError: If the file exists and cannot be read.
    """
    if path is None:
        return parse_campaign({}, places, source="built-in")
    return parse_campaign(read_raw(path, CampaignTables), places, source=str(path))


@cache
def _read_default(name: str) -> dict[str, Any]:
    return read_raw(Path(str(resources.files("validation.campaign").joinpath(name))), CampaignTables)


def parse_campaign(data: Mapping[str, Any], places: Places, *, source: str) -> Campaign:
    """Check the tables of a campaign file and make the campaign.

    What the file leaves out, besides cases, is that of the default campaign.

    Args:
        data: The tables of the file, as the TOML parser returns them.
        places: Places on the cover.
        source: The file; fault lines begin with it.

    Raises:
        InputError: As for `read_campaign`.
    """
    default = _read_default(places.default)
    if "case" in data:
        default = {key: value for key, value in default.items() if key not in ("case", "loads_for")}
    tables = parse(default | dict(data), CampaignTables, source=source)
    scale = 1.0 if tables.loads_for is None else places.scale_loads(tables.loads_for, source)
    cases, quick, left_out = _read_cases(tables.case, places)
    if scale != 1:
        cases = [dataclasses.replace(case, load=float(f"{scale * case.load:.2g}")) for case in cases]
    left_out = [f"{source}: {fault}" for fault in left_out]
    if not cases:
        raise InputError(*left_out, f"{source}: no usable case is left; add one, or mend one of these")
    return Campaign(
        name=tables.name.strip(),
        source=source,
        intended_use=" ".join(tables.intended_use.split()),
        criterion=Criterion(mean=tables.required.mean.list_limits(), each=tables.required.each.list_limits()),
        inputs=Inputs(**tables.inputs.model_dump(exclude_unset=True)),
        cases=tuple(cases),
        quick=tuple(quick),
        left_out=tuple(left_out),
    )


def _read_cases(listed: Sequence[Any], places: Places) -> tuple[list[Case], list[str], list[str]]:
    """Read the tables `[[case]]`; return the cases, the names of those of a quick run, and the faults of the others."""
    cases: list[Case] = []
    quick: list[str] = []
    faults: list[str] = []
    place_of: dict[str, str] = {}
    for number, data in enumerate(listed):
        place = f"case[{number}]"
        try:
            read, is_quick = _read_case(data, number, places)
            for case in read:
                _check_new(case, cases, place_of, place)
        except InputError as error:
            faults += error.faults
            continue
        place_of |= dict.fromkeys((case.name for case in read), place)
        cases += read
        quick += [case.name for case in read if is_quick]
    return cases, quick, faults


def _read_case(data: object, number: int, places: Places) -> tuple[list[Case], bool]:
    """Read one table `[[case]]`; return a case for each of its loads, and whether a quick run has them."""
    given = data if isinstance(data, Mapping) else {}
    faults: list[str] = []
    pose = Pose()
    try:
        table = parse(data, CaseTable, place=("case", number))
    except InputError as error:
        faults += error.faults
    try:
        pose = places.read(given, f"case[{number}]")
    except InputError as error:
        faults += error.faults
    if faults:
        raise InputError(*dict.fromkeys(faults))
    loads = table.all_loads
    names = [table.name] if table.load is not None else [f"{table.name}, {load:.3g} N" for load in loads]
    common: dict[str, Any] = {
        "indenter": table.indenter,
        "shape": given["indenter"],
        "path": tuple(table.path or ()),
        "compared": table.compared or (),
        "required": table.required.list_limits(),
        "pose": pose,
    }
    return [Case(name=name, load=load, **common) for name, load in zip(names, loads, strict=True)], table.quick


def _check_new(case: Case, cases: Sequence[Case], place_of: Mapping[str, str], place: str) -> None:
    """Refuse a case with the name or the press of an earlier one: a press that counts twice biases the means."""
    for other in cases:
        first = place_of[other.name]
        if other.name == case.name:
            raise InputError(f"{place}.name: {case.name!r} is the name of {first} already; every case needs its own")
        if case.is_press_of(other):
            raise InputError(f"{place}: {case.name!r} is the same press as {first}, {other.name!r}; change one of them")
