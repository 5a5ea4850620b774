"""Reading of campaign files (TOML): cases, what is compared, and what is required of the fast model.

A fault in a case costs that case: it is left out with a line that names its place in the file, and the others are
scored.  A fault outside the cases, for example in the acceptance criterion, is an error.  The default campaign is such
a file in the package.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshes import Cover, Pose, SolidCover, TexelArray
from validation.campaign.case import Case, name_positions
from validation.errors import InputError, nearest
from validation.schema import parse, read_raw
from validation.schema.campaign import CampaignTables, CaseTable, LoadsForTable
from validation.text.indenter import read_position, read_tilt, read_yaw

if TYPE_CHECKING:
    from validation.curved.places import CurvedPlaces

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
            "inputs": dataclasses.asdict(self.inputs) | {"friction": _number_or_word(self.inputs.friction)},
            "cases": [case.name for case in self.cases],
            "left_out": list(self.left_out),
        }


def read_campaign(
    path: Path | None, array: TexelArray, *, cover: Cover | SolidCover | None = None, curved: CurvedPlaces | None = None
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
        return parse_campaign({}, array, source="built-in", cover=cover, curved=curved)
    return parse_campaign(read_raw(path, CampaignTables), array, source=str(path), cover=cover, curved=curved)


def default_cases(array: TexelArray) -> tuple[Case, ...]:
    """Return the cases of the default campaign for an array."""
    return read_campaign(None, array).cases


@cache
def _read_default(name: str) -> dict[str, Any]:
    return read_raw(Path(str(resources.files("validation.campaign").joinpath(name))), CampaignTables)


def parse_campaign(
    data: Mapping[str, Any],
    array: TexelArray,
    *,
    source: str,
    cover: Cover | SolidCover | None = None,
    curved: CurvedPlaces | None = None,
) -> Campaign:
    """Check the tables of a campaign file and make the campaign.

    What the file leaves out, besides cases, is that of the default campaign.

    Args:
        data: The tables of the file, as the TOML parser returns them.
        array: The array, which defines the named positions of the indenter.
        source: The file; fault lines begin with it.
        cover: The cover, for whose stiffness loads are scaled where the file has `loads_for`.
        curved: Places on a curved cover; None for a flat cover.

    Raises:
        InputError: As for `read_campaign`.
    """
    default = _read_default("default.toml" if curved is None else "curved.toml")
    if "case" in data:
        default = {key: value for key, value in default.items() if key not in ("case", "loads_for")}
    data = default | dict(data)
    tables = parse(data, CampaignTables, source=source)
    scale = _find_load_scale(tables.loads_for, cover, source)
    cases, quick, left_out = _read_cases(tables.case, array, curved)
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


def _find_load_scale(table: LoadsForTable | None, cover: Cover | SolidCover | None, source: str) -> float:
    """Return the factor on the loads for a cover: its modulus times thickness squared, over those of `loads_for`."""
    if table is None:
        return 1.0
    if cover is None:
        raise InputError(f"{source}: loads_for: is for curved covers; remove it, and write the loads as they are")
    stiffness = cover.layers[0].material.youngs_modulus * cover.thickness**2
    return stiffness / (table.modulus * table.thickness**2)


def _read_cases(
    listed: Sequence[Any], array: TexelArray, curved: CurvedPlaces | None
) -> tuple[list[Case], list[str], list[str]]:
    """Read the tables `[[case]]`; return the cases, the names of those of a quick run, and the faults of the others."""
    cases: list[Case] = []
    quick: list[str] = []
    faults: list[str] = []
    place_of: dict[str, str] = {}
    for number, data in enumerate(listed):
        place = f"case[{number}]"
        try:
            read, is_quick = _read_case(data, number, array, curved)
            for case in read:
                _check_new(case, cases, place_of, place)
        except InputError as error:
            faults += error.faults
            continue
        place_of |= dict.fromkeys((case.name for case in read), place)
        cases += read
        quick += [case.name for case in read if is_quick]
    return cases, quick, faults


def _read_case(data: object, number: int, array: TexelArray, curved: CurvedPlaces | None) -> tuple[list[Case], bool]:
    """Read one table `[[case]]`; return a case for each of its loads, and whether a quick run has them."""
    given = data if isinstance(data, Mapping) else {}
    faults: list[str] = []
    pose = Pose()
    try:
        table = parse(data, CaseTable, place=("case", number))
    except InputError as error:
        faults += error.faults
    try:
        pose = _read_pose(given, f"case[{number}]", array, curved)
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


def _read_pose(given: Mapping[str, Any], place: str, array: TexelArray, curved: CurvedPlaces | None) -> Pose:
    """Read the pose of a case: `at`, `yaw` and `tilt`, and on a curved cover `direction`.

    Values that are no texts are left out; the schema refuses them.
    """
    texts = {key: given[key] for key in ("at", "direction", "yaw", "tilt") if isinstance(given.get(key), str)}
    faults: list[str] = []
    if curved is not None:
        if "path" in given:
            faults.append(f"{place}.path: a curved cover has no friction, so earlier loads do not matter; write loads")
        pose = curved.read(texts, place, faults)
    else:
        if "direction" in given:
            faults.append(
                f"{place}.direction: is for curved covers; a flat one is pressed along -z, `tilt` turns the body"
            )
        readers: dict[str, Callable[[str, str], Any]] = {
            "at": lambda text, where: _read_at(text, array, where),
            "yaw": lambda text, where: read_yaw(text, place=where),
            "tilt": lambda text, where: read_tilt(text, place=where),
        }
        parts = {}
        for key, read in readers.items():
            try:
                if key in texts:
                    parts[key] = read(texts[key], f"{place}.{key}")
            except InputError as error:
                faults += error.faults
        pose = Pose.planar(**parts)
    if faults or pose is None:
        raise InputError(*faults)
    return pose


def _read_at(text: str, array: TexelArray, place: str) -> tuple[float, float]:
    named = name_positions(array)
    if text in named:
        return named[text]
    if not any(character.isdigit() for character in text):
        raise InputError(
            f"{place}: unknown position {text[:80]!r}; {nearest(text[:80], named)}, or x,y such as '1mm,-2mm'"
        )
    return read_position(text, place=place)


def _check_new(case: Case, cases: Sequence[Case], place_of: Mapping[str, str], place: str) -> None:
    """Refuse a case with the name or the press of an earlier one: a press that counts twice biases the means."""
    for other in cases:
        first = place_of[other.name]
        if other.name == case.name:
            raise InputError(f"{place}.name: {case.name!r} is the name of {first} already; every case needs its own")
        if case.is_press_of(other):
            raise InputError(f"{place}: {case.name!r} is the same press as {first}, {other.name!r}; change one of them")


def _number_or_word(friction: float) -> float | str:
    return "no-slip" if friction == float("inf") else friction
