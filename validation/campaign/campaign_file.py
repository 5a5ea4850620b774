"""Reading of campaign files (TOML): cases, compared metrics, and requirements on the fast model.

A fault in a case only affects that case: it is left out with a line that names its place in the file, and the other
cases are scored.  A fault outside the cases, for example in the acceptance criterion, is an error.  The default
campaign is such a file in the package.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from meshes import Indenter, Pose
from validation.campaign.case import Case
from validation.errors import Faults, InputError
from validation.moving.history import MovingCase, read_moving
from validation.places import FlatPlaces, Places
from validation.schema import parse, read_raw
from validation.schema.campaign import BEHIND_NULL, CampaignTables, CaseTable, OtherTable

#: Requirements on recordings that a campaign file and a data-set file do not state, see docs/validation.md.
RECORDING_LIMITS: Mapping[str, float] = MappingProxyType(
    {"image_changed_percent": 2.0, "relative_l2": 0.1, BEHIND_NULL: 0.2}
)
#: Names of the built-in campaigns besides those by default.
BUILT_IN = ("report-2015", "moving")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Inputs:
    """Standard uncertainties of the inputs of a comparison.

    Attributes:
        modulus: Standard uncertainty of Young's modulus over the modulus, for materials that state no spread [-].
        poisson_ratio: Standard uncertainty of Poisson's ratio, for materials that state no spread [-].
        thickness: Standard uncertainty of the thickness of each layer over the thickness [-].
        position: Standard uncertainty of the position of the indenter's axis, along x and along y [m].
        yaw: Standard uncertainty of the rotation of the indenter about its axis [rad].
        friction: Upper bound of the friction coefficient, inf for no slip; the lower bound is zero [-].
        data: Standard uncertainty of measured forces over the force [-]; 0 if finite elements replace a measurement.
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
    """Requirements on the fast model, by the name of the metric, in SI units or as a fraction.

    Attributes:
        mean: Largest accepted mean over the cases, including its interval.
        each: Largest accepted value in every single case; a case may state another value.
        recordings: Largest accepted mean over the loads of each split of the recordings, including its interval.
    """

    mean: Mapping[str, float]
    each: Mapping[str, float]
    recordings: Mapping[str, float] = dataclasses.field(default_factory=lambda: RECORDING_LIMITS)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Campaign:
    """Cases, intended use and acceptance criterion.

    Attributes:
        name: Name of the campaign.
        source: Path of the file, or `built-in`.
        intended_use: Intended use of the fast model, in words.
        criterion: Acceptance criterion.
        inputs: Uncertainty of the inputs.
        cases: The cases without faults.
        quick: Names of the cases that a run with a budget prefers.
        left_out: One line per fault in a case that is left out.
        spare: Further cases of a run with a budget, most useful first, for time that its cases leave.  After the run,
            those that ten more minutes would add.
        moving: Cases that change in time; they do not count for the verdict.
        inherits: Whether the file of the campaign states no requirements, so that the built-in ones count.
    """

    name: str
    source: str
    intended_use: str
    criterion: Criterion
    inputs: Inputs
    cases: tuple[Case, ...]
    quick: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    spare: tuple[Case, ...] = ()
    moving: tuple[MovingCase, ...] = ()
    inherits: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return name, intended use, criterion and inputs as a dictionary of JSON values."""
        return {
            "name": self.name,
            "source": self.source,
            "intended_use": self.intended_use,
            "required": {key: dict(limits) for key, limits in vars(self.criterion).items()},
            "inputs": dataclasses.asdict(self.inputs)
            | {"friction": "no-slip" if math.isinf(self.inputs.friction) else self.inputs.friction},
            "cases": [case.name for case in self.cases],
            "left_out": list(self.left_out),
        }


def read_campaign(path: Path | None, places: Places) -> Campaign:
    """Read a campaign file, or the default campaign.

    Args:
        path: Path of the file, or the name of a built-in campaign (`BUILT_IN`); None for the default campaign.
        places: Places on the cover, see `find_places`.

    Raises:
        InputError: If the file cannot be read as a campaign, has a fault outside the cases, or no case is usable; one
            line per fault.
        OSError: If the file exists and cannot be read.
    """
    if path is None:
        return parse_campaign({}, places, source="built-in")
    if str(path) in BUILT_IN and not path.exists():
        return parse_campaign(_read_default(f"{path}.toml"), places, source=f"built-in {path}")
    tables = read_raw(path, CampaignTables)
    if not tables:
        raise InputError(
            f"{path}: is empty; write [[case]] or [required], or leave the file out for the built-in campaign"
        )
    return parse_campaign(tables, places, source=str(path), folder=path.parent)


@cache
def _read_default(name: str) -> dict[str, Any]:
    return read_raw(Path(str(resources.files("validation.campaign").joinpath(name))), CampaignTables)


def parse_campaign(
    data: Mapping[str, Any],
    places: Places,
    *,
    source: str,
    folder: Path = Path(),
) -> Campaign:
    """Check the tables of a campaign file and make the campaign.

    Entries other than cases that are missing in the file are those of the default campaign.

    Args:
        data: The tables of the file, as the TOML parser returns them.
        places: Places on the cover.
        source: The file; fault lines begin with it.
        folder: Folder of the files that it names.

    Raises:
        InputError: As for `read_campaign`.
    """
    default = _read_default(places.default)
    if "case" in data:
        default = {key: value for key, value in default.items() if key not in ("case", "loads_for", "deepest")}
    tables = parse(default | dict(data), CampaignTables, source=source)
    scale = 1.0 if tables.loads_for is None else places.scale_loads(tables.loads_for, source)
    cases, quick, left_out = _read_cases(tables.case, places)
    if scale != 1:
        cases = [case.with_load(float(f"{scale * case.load:.2g}")) for case in cases]
    asked, use = cases, " ".join(tables.intended_use.split())
    if tables.deepest is not None:
        cases = _lower_loads(cases, places, tables.deepest)
    if cases != asked:
        low, high = (edge(case.load for case in cases) for edge in (min, max))
        use = f"{use} Loads are lowered for this soft cover: {low:.2g} N to {high:.2g} N."
    moving, faults = read_moving(tables.moving, places, scale=scale, deepest=tables.deepest, folder=folder)
    left_out = [f"{source}: {fault}" for fault in (*left_out, *faults)]
    if not cases:
        raise InputError(*left_out, f"{source}: no usable case is left; add one, or mend one of these")
    return Campaign(
        name=tables.name.strip(),
        source=source,
        intended_use=use,
        criterion=Criterion(
            mean=tables.required.mean.list_limits(),
            each=tables.required.each.list_limits(),
            recordings={**RECORDING_LIMITS, **tables.required.recordings.list_limits()},
        ),
        inputs=Inputs(**tables.inputs.model_dump(exclude_unset=True)),
        cases=tuple(cases),
        quick=tuple(quick),
        left_out=tuple(left_out),
        moving=tuple(moving),
        inherits="required" not in data and not source.startswith("built-in"),
    )


def _read_cases(listed: Sequence[Any], places: Places) -> tuple[list[Case], list[str], list[str]]:
    """Read the tables `[[case]]`; return the cases, the names of the cases of a quick run, and all faults.

    Two names of places, such as the middle of the array and that of a texel, are one place on some arrays.  Of two
    cases that become the same press there the first one is kept.
    """
    cases: list[Case] = []
    quick: list[str] = []
    faults: list[str] = []
    place_of: dict[str, str] = {}
    at_of: dict[str, str] = {}
    for number, data in enumerate(listed):
        place = f"case[{number}]"
        try:
            read, is_quick = _read_case(data, number, places)
            at = data.get("at", "centre").strip()
            for case in tuple(read):
                twin = next((other for other in cases if case.is_press_of(other)), None)
                if twin is not None and at != at_of[twin.name] and "," not in at + at_of[twin.name]:
                    read.remove(case)
                    quick += [twin.name] * is_quick
            for case in read:
                _check_new(case, cases, place_of, place)
        except InputError as error:
            faults += error.faults
            continue
        place_of |= dict.fromkeys((case.name for case in read), place)
        at_of |= dict.fromkeys((case.name for case in read), at)
        cases += read
        quick += [case.name for case in read if is_quick]
    return cases, quick, faults


def _read_case(data: object, number: int, places: Places) -> tuple[list[Case], bool]:
    """Read one table `[[case]]`; return a case for each of its loads, and whether they belong to a quick run."""
    given = data if isinstance(data, Mapping) else {}
    texts = {key: given[key] for key in ("at", "direction", "yaw", "tilt") if isinstance(given.get(key), str)}
    faults = Faults()
    if "others" in given and isinstance(places, FlatPlaces):
        places = dataclasses.replace(places, whole=True)
    table = faults.read(parse, data, CaseTable, place=("case", number))
    if table and table.others and "others" in places.refused:
        raise InputError(f"case[{number}].others: {places.refused['others']}")
    pose = faults.read(lambda: places.find(places.parse({"at": "centre", **texts}, f"case[{number}].")))
    others = tuple(
        faults.read(_read_other, other, given["others"][k], places, f"case[{number}].others[{k}].")
        for k, other in enumerate(table.others if table else ())
    )
    # The schema and the reading of the pose may report the same fault, which is kept once.
    faults[:] = dict.fromkeys(faults)
    faults.refuse()
    if others:
        _check_apart([(table.indenter, pose), *((each.indenter, each.pose) for each in others)], f"case[{number}]")
    loads = table.all_loads
    names = [table.name] if table.load is not None else [f"{table.name}, {load:.3g} N" for load in loads]
    common: dict[str, Any] = {
        "indenter": table.indenter,
        "shape": given["indenter"],
        "path": tuple(table.path or ()),
        "compared": table.compared or (),
        "required": table.required.list_limits(),
        "pose": pose,
        "others": others,
    }
    rest = sum(each.load for each in others)
    return [Case(name=name, load=load + rest, **common) for name, load in zip(names, loads, strict=True)], table.quick


def _check_apart(placed: Sequence[tuple[Indenter, Pose]], place: str) -> None:
    """Refuse bodies whose footprints overlap; the first body is that of the case."""
    from fem_reference.small_strain_contact.several_indenters import find_overlap

    if pair := find_overlap(placed):
        first = f"others[{pair[0] - 1}]" if pair[0] else "the first body"
        raise InputError(f"{place}.others[{pair[1] - 1}].at: the body overlaps {first}; move one of them")


def _read_other(table: OtherTable, given: Mapping[str, Any], places: Places, place: str) -> Case:
    """Read a further body of a case."""
    texts = {key: text for key in ("at", "yaw") if (text := getattr(table, key)) is not None}
    pose = places.find(places.parse(texts, place))
    return Case(name=given["indenter"], indenter=table.indenter, shape=given["indenter"], load=table.load, pose=pose)


def _lower_loads(cases: Sequence[Case], places: Places, share: float) -> list[Case]:
    """Lower all loads of an indenter by one factor, where the largest presses the cover deeper than a share of it.

    The loads of several bodies are lowered by one factor, so that none presses deeper.
    """
    bodies = [body for case in cases for body in case.bodies]
    largest = {body.shape: max(each.load for each in bodies if each.shape == body.shape) for body in bodies}
    factor = {body.shape: min(1.0, places.limit_load(body, share) / largest[body.shape]) for body in bodies}
    factors = [min(factor[body.shape] for body in case.bodies) for case in cases]
    return [
        case if each == 1 else case.with_load(float(f"{each * case.load:.2g}"))
        for case, each in zip(cases, factors, strict=True)
    ]


def _check_new(case: Case, cases: Sequence[Case], place_of: Mapping[str, str], place: str) -> None:
    """Refuse a case with the name or the press of an earlier case, because a repeated press biases the means."""
    for other in cases:
        first = place_of[other.name]
        if other.name == case.name:
            raise InputError(f"{place}.name: {case.name!r} is the name of {first} already; every case needs its own")
        if case.is_press_of(other):
            raise InputError(f"{place}: {case.name!r} is the same press as {first}, {other.name!r}; change one of them")
