"""Reading of campaign files (TOML): cases, what is compared, and what is required of the fast model.

A fault in a case costs that case: it is left out with a line that names its place in the file, and the others are
scored.  A fault outside the cases, for example in the acceptance criterion, is an error.  The default campaign is such
a file in the package.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshes import Cover, TexelArray
from meshes.bounded_file import FileLimitError, parse_toml, read_text
from validation.campaign.case import Case
from validation.campaign.case_tables import read_case, read_limits, read_share
from validation.errors import InputError, nearest
from validation.text.friction import read_friction
from validation.text.quantity import Kind, read_quantity

if TYPE_CHECKING:
    from validation.curved.places import CurvedPlaces

#: Largest accepted size of a campaign file [bytes], and largest number of cases [-].
_MOST_BYTES, _MOST_CASES = 2**20, 1000
#: Number of cases of `--quick` if the file marks none [-].
_QUICK = 6
#: Keys of the file, of `[required]` and of `[inputs]`.
_KEYS = ("name", "intended_use", "required", "inputs", "loads_for", "case")
_REQUIRED_KEYS = ("mean", "each")


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
            "inputs": dataclasses.asdict(self.inputs) | {"friction": _number_or_word(self.inputs.friction)},
            "cases": [case.name for case in self.cases],
            "left_out": list(self.left_out),
        }


def read_campaign(
    path: Path | None, array: TexelArray, *, cover: Cover | None = None, curved: CurvedPlaces | None = None
) -> Campaign:
    """Read a campaign file, or the default campaign.

    Args:
        path: The file; None for the default campaign.
        array: The array, which defines the named positions of the indenter.
        cover: The cover, for whose stiffness loads are scaled where the file has `loads_for`.
        curved: Places on a curved cover, which has a default campaign of its own; None for a flat cover.

    Raises:
        InputError: If the file cannot be read as a campaign, has a fault outside the cases, or no case is usable; one
            line per fault.
        OSError: If the file exists and cannot be read.
    """
    if path is None:
        return parse_campaign(
            _read_default(_name_default(curved)), array, source="built-in", cover=cover, curved=curved
        )
    if not path.exists():
        raise InputError(f"--campaign: {path}: no such file")
    try:
        tables = parse_toml(read_text(path, most=_MOST_BYTES))
        return parse_campaign(tables, array, source=str(path), cover=cover, curved=curved)
    except FileLimitError as error:
        raise InputError(f"{path}: {error}") from None


def default_cases(array: TexelArray) -> tuple[Case, ...]:
    """Return the cases of the default campaign for an array."""
    return read_campaign(None, array).cases


def _name_default(curved: CurvedPlaces | None) -> str:
    return "default.toml" if curved is None else "curved.toml"


@cache
def _read_default(name: str) -> dict[str, Any]:
    return parse_toml(resources.files("validation.campaign").joinpath(name).read_text(encoding="utf-8"))


def parse_campaign(
    tables: Mapping[str, Any],
    array: TexelArray,
    *,
    source: str,
    cover: Cover | None = None,
    curved: CurvedPlaces | None = None,
) -> Campaign:
    """Check the tables of a campaign file and make the campaign.

    What the file leaves out, besides cases, is that of the default campaign.

    Args:
        tables: The tables of the file.
        array: The array, which defines the named positions of the indenter.
        source: The file; fault lines begin with it.
        cover: The cover, for whose stiffness loads are scaled where the file has `loads_for`.
        curved: Places on a curved cover; None for a flat cover.

    Raises:
        InputError: As for `read_campaign`.
    """
    faults = [f"{key}: unknown key; {nearest(key, _KEYS)}" for key in tables if key not in _KEYS]
    default = _read_default(_name_default(curved))
    texts = {key: _read_text_key(tables.get(key, default[key]), key, faults) for key in ("name", "intended_use")}
    criterion = _read_criterion(tables.get("required", default["required"]), faults)
    inputs = _read_inputs(tables.get("inputs", default["inputs"]), faults)
    listed = tables.get("case", default["case"])
    scale = _read_load_scale(tables if "case" in tables else default, cover, faults)
    if not isinstance(listed, list) or not listed:
        faults.append("case: must be at least one table [[case]]")
    elif len(listed) > _MOST_CASES:
        faults.append(f"case: {len(listed)} cases; at most {_MOST_CASES} are accepted")
    if faults:
        raise InputError(*(f"{source}: {fault}" for fault in faults))
    cases, quick, left_out = _read_cases(listed, array, curved)
    if scale != 1:
        cases = [dataclasses.replace(case, load=float(f"{scale * case.load:.2g}")) for case in cases]
    left_out = [f"{source}: {fault}" for fault in left_out]
    if not cases:
        raise InputError(*left_out, f"{source}: no usable case is left")
    return Campaign(
        name=texts["name"],
        source=source,
        intended_use=" ".join(texts["intended_use"].split()),
        criterion=criterion,
        inputs=inputs,
        cases=tuple(cases),
        quick=tuple(quick),
        left_out=tuple(left_out),
    )


def _read_load_scale(tables: Mapping[str, Any], cover: Cover | None, faults: list[str]) -> float:
    """Read `loads_for`, and return the factor on the loads for a cover: modulus times thickness squared, over these."""
    table = tables.get("loads_for")
    if table is None:
        return 1.0
    if cover is None:
        faults.append("loads_for: is for curved covers; write the loads as they are")
    elif not isinstance(table, Mapping) or sorted(table) != ["modulus", "thickness"]:
        faults.append("loads_for: must be { modulus = '1 MPa', thickness = '2 mm' }")
    else:
        try:
            modulus = read_quantity(table["modulus"], "pressure", place="loads_for.modulus")
            thickness = read_quantity(table["thickness"], "length", place="loads_for.thickness")
        except InputError as error:
            faults += error.faults
            return 1.0
        if min(modulus, thickness) > 0:
            return cover.layers[0].material.youngs_modulus * cover.thickness**2 / (modulus * thickness**2)
        faults.append("loads_for: modulus and thickness must be positive")
    return 1.0


def _read_cases(
    listed: Sequence[Any], array: TexelArray, curved: CurvedPlaces | None
) -> tuple[list[Case], list[str], list[str]]:
    """Read the tables `[[case]]`; return the cases, the names of those of a quick run, and the faults of the others."""
    cases: list[Case] = []
    quick: list[str] = []
    faults: list[str] = []
    place_of: dict[str, str] = {}
    for number, table in enumerate(listed):
        place = f"case[{number}]"
        try:
            read = read_case(table, array, place, curved=curved)
            for case in read:
                _check_new(case, cases, place_of, place)
        except InputError as error:
            faults += error.faults
            continue
        place_of |= dict.fromkeys((case.name for case in read), place)
        cases += read
        if table.get("quick"):
            quick += [case.name for case in read]
    return cases, quick, faults


def _check_new(case: Case, cases: Sequence[Case], place_of: Mapping[str, str], place: str) -> None:
    """Refuse a case with the name or the press of an earlier one: a press that counts twice biases the means."""
    for other in cases:
        first = place_of[other.name]
        if other.name == case.name:
            raise InputError(f"{place}.name: {case.name!r} is the name of {first} already; every case needs its own")
        if case.is_press_of(other):
            raise InputError(f"{place}: {case.name!r} is the same press as {first}, {other.name!r}; change one of them")


def _read_text_key(value: object, key: str, faults: list[str]) -> str:
    if not isinstance(value, str) or not value.strip():
        faults.append(f"{key}: must be a text, not {value!r}"[:200])
        return ""
    return value.strip()


def _read_criterion(table: object, faults: list[str]) -> Criterion:
    if not isinstance(table, Mapping):
        faults.append("required: must be a table with the tables mean and each")
        return Criterion(mean={}, each={})
    faults += [
        f"required.{key}: unknown key; {nearest(key, _REQUIRED_KEYS)}" for key in table if key not in _REQUIRED_KEYS
    ]
    limits = {key: read_limits(table.get(key, {}), f"required.{key}", faults) for key in _REQUIRED_KEYS}
    if not any(limits.values()) and not faults:
        faults.append("required: states no limit; write for example mean = { misplaced_force = '3 %' }")
    return Criterion(**limits)


def _read_inputs(table: object, faults: list[str]) -> Inputs:
    """Read `[inputs]`; keys that are left out keep their default values."""
    known = [field.name for field in dataclasses.fields(Inputs)]
    if not isinstance(table, Mapping):
        faults.append("inputs: must be a table")
        return Inputs()
    values: dict[str, float] = {}
    for key, value in table.items():
        place = f"inputs.{key}"
        if key not in known:
            faults.append(f"{place}: unknown key; {nearest(key, known)}")
            continue
        try:
            values[key] = _read_input(key, value, place)
        except InputError as error:
            faults += error.faults
    return Inputs(**values)


def _read_input(key: str, value: object, place: str) -> float:
    """Read one uncertainty; those of modulus, thickness and data are shares in percent."""
    kinds: dict[str, Kind] = {"position": "length", "yaw": "angle"}
    if key == "friction":
        try:
            return read_friction(value, example="friction = 0.4 or friction = 'no-slip'")
        except ValueError as error:
            raise InputError(f"{place}: {error}") from None
    if key in kinds:
        number = read_quantity(value, kinds[key], place=place)
    elif key == "poisson_ratio":
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{place}: must be a number, not {value!r}; write for example 0.005")
        number = float(value)
    else:
        number = read_share(value, place)
    if not 0 <= number <= 1:
        raise InputError(f"{place}: must lie in 0..1 (SI units), not {value!r}")
    return number


def _number_or_word(friction: float) -> float | str:
    return "no-slip" if friction == float("inf") else friction
