"""Types of the values in files: quantities with units, choices, numbers with limits, and materials.

A type is an annotation of a field.  It reads a value of the file, converts it to SI units, and describes itself in the
JSON Schema of the format.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PureWindowsPath
from typing import Annotated, Any, get_args

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, create_model
from pydantic_core import CoreSchema, core_schema

from meshes.array import MOST_TEXELS
from meshes.catalogue import COMMON_NAMES, MATERIALS
from meshes.hardness import HardnessModulus
from meshes.layer import Layer
from meshes.material import MODELS, Material
from meshes.relaxation import Bulk, Relaxation
from validation.errors import InputError, match_name, nearest, shorten
from validation.schema import Table
from validation.text.friction import read_friction
from validation.text.hardness import material_from_hardness, read_hardness
from validation.text.indenter import read_indenter, read_load
from validation.text.quantity import Kind, read_quantity


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on values in all files.

    Attributes:
        longest: Largest length, such as a pitch or a thickness [m]; larger values indicate a wrong unit.
        shortest: Smallest positive length [m], about the size of an atom.
        exponent: Largest absolute exponent of the Ogden model [-]; larger values overflow at moderate stretches.
        number: Greatest absolute value of a plain number [-].
        entries: Largest number of entries in a list [-].
        name: Largest number of characters of a name [-].
    """

    longest: float = 1.0
    shortest: float = 1e-10
    exponent: float = 100.0
    number: float = 1e12
    entries: int = 10_000
    name: int = 80


LIMITS = Limits()
#: Largest number of Prony terms [-], and longest time of a relaxation, 30 years [s].
_MOST_TERMS, _LONGEST = 50, 1e9
#: Names of the parameters of all material models, each once.
PARAMETERS = tuple(dict.fromkeys(name for model in MODELS.values() for name in model.parameters))
_TEXT = {"type": "string"}
_NUMBER_WITH_UNIT = r"^\s*[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?\s*\S.*$"


@dataclass(frozen=True, eq=False)
class Read:
    """Annotation of a value that a function reads from the form in a file.

    Attributes:
        read: Function that converts the value, and raises a `ValueError` that states the fault and what would be
            accepted.
        json: JSON Schema of the value.
    """

    read: Callable[[Any], Any]
    json: Mapping[str, Any] = field(default_factory=lambda: _TEXT)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        """Return the schema by which pydantic reads a field with this annotation: it calls `read`."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON Schema of the value."""
        return dict(self.json)


@dataclass(frozen=True, eq=False)
class TableOr:
    """Annotation of a value that a file gives as a table, or in a shorter form such as a text.

    Attributes:
        table: Class of the table.
        read: Function that converts the value, given a function that reads a table.
        json: JSON Schema of the shorter form; empty if there is none.
    """

    table: type[Table]
    read: Callable[[Any, Callable[[Any], Any]], Any]
    json: Mapping[str, Any] = field(default_factory=dict)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        """Return the schema by which pydantic reads a field with this annotation: it calls `read`."""
        return core_schema.no_info_wrap_validator_function(self.read, handler.generate_schema(self.table))

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON Schema of the shorter form or the table."""
        return {"anyOf": [dict(self.json), handler(core)]} if self.json else handler(core)


@dataclass(frozen=True, eq=False)
class OneByOne:
    """Annotation of a list of 1 to `most` tables that are checked later, one by one.

    A fault only rejects its own table.

    Attributes:
        table: Class of the tables.
        most: Largest number of tables.
    """

    table: type[Table]
    most: int

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        """Return the schema of a list of anything."""

        def check(value: object) -> list[Any]:
            if not isinstance(value, list) or not value:
                raise InputError("must be a list of at least one table")
            if len(value) > self.most:
                raise ValueError(f"{len(value)} tables; at most {self.most} are accepted")
            return value

        return core_schema.no_info_plain_validator_function(check)

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON Schema of a list of tables."""
        return {"type": "array", "items": handler(self.table.__pydantic_core_schema__), "minItems": 1}


class OneOrMore:
    """Annotation of a list.  A file can give a list of one entry as the entry alone."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        """Return the schema of the list."""
        return core_schema.no_info_before_validator_function(
            lambda value: value if isinstance(value, list) else [value], handler(source)
        )

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON Schema of one entry or a list."""
        found = handler(core)
        return {"anyOf": [found["items"], found]}


def number(least: float, most: float, note: str = "", *, whole: bool = False) -> Read:
    """Make the annotation of a number from `least` to `most`.

    Args:
        least: Least accepted number.
        most: Greatest accepted number.
        note: Text that follows the limits in messages.
        whole: Whether the number must be whole.
    """
    limits = f"in {least:.10g}..{most:.10g}{note}"

    def check(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
            raise InputError(f"must be a{' whole' * whole} number {limits}, not {shorten(value)}")
        if not least <= value <= most:
            raise ValueError(f"must lie {limits}, not {value:.10g}")
        return value if whole else float(value)

    return Read(check, {"type": "integer" if whole else "number", "minimum": least, "maximum": most})


def quantity(kind: Kind, *, positive: bool = True, most: float | None = None) -> Read:
    """Make the annotation of a quantity with a unit, which becomes a number in SI units.

    Args:
        kind: Kind of quantity.
        positive: Whether the quantity must be positive, and a length within the limits on lengths.
        most: Greatest value in SI units; the least is then 0; None for no other limits.
    """

    def convert(value: object) -> float:
        number = read_quantity(value, kind)
        if positive and number <= 0:
            raise ValueError(f"must be positive, not {value!r}")
        if kind == "length" and number > LIMITS.longest:
            raise ValueError(f"must be at most {LIMITS.longest:g} m, not {value!r}")
        if positive and kind == "length" and number < LIMITS.shortest:
            raise ValueError(f"must be at least {LIMITS.shortest:g} m, not {value!r}")
        if most is not None and not 0 <= number <= most:
            raise ValueError(f"must lie in 0..{most:g} (SI units), not {value!r}")
        return number

    return Read(convert, {"type": "string", "pattern": _NUMBER_WITH_UNIT, "description": f"{kind} with its unit"})


def check_below(value: str, remedy: str = "") -> str:
    """Refuse a path or pattern that is absolute or holds `..`, on any system: the command line names folders."""
    path = PureWindowsPath(value)  # it knows `/`, too
    if path.anchor or ".." in path.parts:
        raise ValueError(f"must lie below the folder of the file, not {shorten(value)}{remedy}")
    return value


def choice(*names: str) -> Read:
    """Make the annotation of a text that must be one of the given names."""

    def check(value: object) -> str:
        if not isinstance(value, str) or value not in names:
            raise ValueError(f"{shorten(value)} is unknown; {nearest(str(value)[: LIMITS.name], names)}")
        return value

    return Read(check, {"enum": list(names)})


def text(read: Callable[..., Any], example: str) -> Read:
    """Make the annotation of a text that a function of `validation.text` reads.

    Args:
        read: Function that reads the text; its arguments are the text and, as `place`, the start of error messages.
        example: An accepted text.
    """

    def convert(value: object) -> Any:  # noqa: ANN401 -- what the function returns
        if not isinstance(value, str):
            raise InputError(f"must be a text, not {shorten(value)}; write for example {example!r}")
        try:
            return read(value, place="")
        except InputError as error:
            raise InputError(*(fault.removeprefix(": ") for fault in error.faults)) from None

    return Read(convert, {"type": "string", "examples": [example]})


def read_percentage(value: object) -> float:
    """Read a percentage such as `3 %`, and return it as a fraction [-].

    Raises:
        ValueError: If the value is not a percentage of 0 or more.
    """
    number = str(value).strip().removesuffix("%") if isinstance(value, str) and value.rstrip().endswith("%") else ""
    try:
        share = float(number) / 100 if len(number) <= LIMITS.name and "_" not in number else -1.0
    except ValueError:
        share = -1.0
    if not 0 <= share < float("inf"):
        raise ValueError(f"{shorten(value)} is no percentage; write for example '3 %'")
    return share


def percentage(most: float = float("inf")) -> Read:
    """Make the annotation of a percentage such as `3 %`, which becomes a fraction from 0 to `most` [-]."""

    def convert(value: object) -> float:
        share = read_percentage(value)
        if share > most:
            raise ValueError(f"must lie in 0..{100 * most:g} %, not {value!r}")
        return share

    return Read(convert, {"type": "string", "pattern": r"^\s*[0-9.]+([eE][-+]?[0-9]+)?\s*%\s*$", "examples": ["3 %"]})


def _read_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or len(value) > LIMITS.name:
        raise ValueError(f"must be a text of 1 to {LIMITS.name} characters, not {shorten(value)}")
    return value.strip()


def _read_pair(value: object, read_one: Callable[[object], float] | None = None) -> tuple[float, float]:
    """Read a pair of lengths along x and y, given as one length for the two directions or as a list [m]."""
    pair = value if isinstance(value, list) else [value, value]
    if len(pair) != 2:  # noqa: PLR2004 -- x and y
        raise ValueError(f"must be one length or [x, y], not {shorten(value)}")
    x, y = map(read_one or _LENGTH.read, pair)
    return (x, y)


def _read_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < abs(value) <= LIMITS.exponent:
        raise ValueError(f"must be a number other than 0, or a list of them, not {shorten(value)}")
    return float(value)


def _terms(read_one: Callable[[object], float], one: Mapping[str, Any]) -> Read:
    """Make the annotation of a material parameter: one number, or a list with one number per term of the energy."""
    return Read(
        lambda value: tuple(read_one(part) for part in (value if isinstance(value, list) else [value])),
        {"anyOf": [dict(one), {"type": "array", "items": dict(one)}]},
    )


_LENGTH = quantity("length")
Length = Annotated[float, _LENGTH]
_PAIR_JSON = {"anyOf": [_LENGTH.json, {"type": "array", "items": _LENGTH.json, "minItems": 2, "maxItems": 2}]}
Lengths = Annotated[tuple[float, float], Read(_read_pair, _PAIR_JSON)]
_WIDTH = quantity("length", positive=False, most=LIMITS.longest)
Widths = Annotated[tuple[float, float], Read(lambda value: _read_pair(value, _WIDTH.read), _PAIR_JSON)]
LengthUnit = Annotated[float, Read(lambda value: read_quantity(f"1 {value}", "length"))]
Pressure = Annotated[float, quantity("pressure")]
Force = Annotated[float, quantity("force")]
Frequency = Annotated[float, quantity("frequency")]
Friction = Annotated[
    float,
    Read(
        lambda value: read_friction(value, example="friction = 0.4 or friction = 'no-slip'"),
        {"anyOf": [{"type": "number", "minimum": 0}, {"enum": ["no-slip"]}]},
    ),
]
Indenter = Annotated[Any, text(read_indenter, "sphere:radius=5mm")]
Load = Annotated[float, text(read_load, "4.9 N")]
Name = Annotated[str, Read(_read_name, {"type": "string", "minLength": 1, "maxLength": LIMITS.name})]
Count = Annotated[int, number(1, 2**32, whole=True)]
TexelCount = Annotated[int, number(1, MOST_TEXELS, whole=True)]
Number = Annotated[float, number(-LIMITS.number, LIMITS.number)]
_Seconds = Annotated[float, quantity("time", most=_LONGEST)]
_Part = Annotated[float, number(0, 1)]
PoissonRatio = Annotated[float, number(0, 0.5, " (0.5 is incompressible)")]


class RelaxationTable(Table):
    """Relaxation of the shear modulus in time: Prony terms `g`, or the `exponent` of a power law.

    Attributes:
        g: Prony terms, each the share of the modulus that relaxes with its time.
        tau: Time of each term, or the one time of a power law.
        exponent: Exponent of a power law, (1 + t / tau)^-exponent.
        bulk: Whether the bulk modulus relaxes with the shear modulus, or is constant.
    """

    tau: Annotated[list[_Seconds], OneOrMore(), Field(min_length=1, max_length=_MOST_TERMS)]
    g: Annotated[list[_Part], OneOrMore(), Field(min_length=1, max_length=_MOST_TERMS)] | None = None
    exponent: _Part | None = None
    bulk: Annotated[Bulk, choice(*get_args(Bulk))] = "relaxing"

    def make(self) -> Relaxation:
        """Make the relaxation that the table describes."""
        return Relaxation(tau=tuple(self.tau), g=tuple(self.g or ()), exponent=self.exponent, bulk=self.bulk)


class _MaterialTable(Table):
    """A material model and its parameters.  Each model requires its own parameters and refuses those of other models.

    Attributes:
        model: Name of the material model.
        poisson_ratio: Poisson ratio at small strain; 0.5 (incompressible) when left out, except for linear-elastic.
        hardness: Shore hardness such as "30 shore-a", which replaces the modulus.
        name: Name of the material in tables.
        source: Origin of the parameters.
        spread: Relative spread of the modulus between sources.
        poisson_spread: Spread of the Poisson ratio between sources.
        relaxation: How the modulus, which is that just after a step, falls in time.
    """

    model: Annotated[str, choice(*MODELS)] = Field(examples=["linear-elastic"])
    poisson_ratio: PoissonRatio | None = None
    hardness: Annotated[HardnessModulus, Read(read_hardness)] | None = None
    name: str = ""
    source: str | None = None
    spread: Annotated[float, number(0, 10)] | None = None
    poisson_spread: PoissonRatio = 0.0
    relaxation: RelaxationTable | None = None

    def make(self) -> Material:
        """Make the material that the table describes.

        Raises:
            ValueError: If a parameter of the model is missing, or a parameter of another model is given.
        """
        given = {name: value for name in PARAMETERS if (value := getattr(self, name)) is not None}
        if self.poisson_ratio is None and self.model == "linear-elastic":
            raise ValueError("poisson_ratio is missing; write for example poisson_ratio = 0.49")
        if self.hardness is None:
            made = self._from_parameters(given)
        elif given:
            raise ValueError(f"hardness replaces the modulus; give it or {', '.join(sorted(given))}, not both")
        else:
            made = material_from_hardness(self.hardness, self.model, poisson_ratio=self.poisson_ratio, name=self.name)
        return replace(
            made,
            source=made.source if self.source is None else self.source,
            spread=made.spread if self.spread is None else self.spread,
            poisson_spread=self.poisson_spread,
            relaxation=None if self.relaxation is None else self.relaxation.make(),
        )

    def _from_parameters(self, given: Mapping[str, Any]) -> Material:
        wanted = MODELS[self.model].parameters
        if set(given) != set(wanted):
            listed = ", ".join(f"{name} [{each.unit}]" for name, each in wanted.items())
            terms = " (one number, or a list with one for each term)" if MODELS[self.model].has_terms else ""
            names = ", ".join(sorted(given)) or "nothing"
            ratio = "" if MODELS[self.model].poisson_ratio else " and poisson_ratio"
            raise ValueError(f"{self.model} takes {listed}{terms}{ratio}, not {names}")
        left_out = math.nan if MODELS[self.model].poisson_ratio else 0.5
        return Material(
            name=self.name or self.model,
            model=self.model,
            parameters=given,
            poisson_ratio=left_out if self.poisson_ratio is None else self.poisson_ratio,
        )


def _annotate(name: str) -> Any:  # noqa: ANN401 -- the type of a field
    """Return type and default of the field of a material's table for a parameter, which several models may share."""
    models = [model for model in MODELS.values() if name in model.parameters]
    shared = [model.parameters[name] for model in models]
    if {each.unit for each in shared} == {"Pa"}:
        one = quantity("pressure", positive=all(each.positive for each in shared))
    else:
        one = Read(_read_number, {"type": "number"})
    several = any(model.has_terms for model in models)
    kind = Annotated[tuple[float, ...], _terms(one.read, one.json)] if several else Annotated[float, one]
    return kind | None, None


def _explain(name: str) -> str:
    """Return the line on a material parameter in the docstring of the table of a material."""
    meanings = [
        f"{model.parameters[name].meaning} of {key}" for key, model in MODELS.items() if name in model.parameters
    ]
    about = "; ".join(meanings)
    return f"    {name}: {about[0].upper()}{about[1:]}."


#: Table `material` of a TOML file; its keys are those of any material and the parameters of all material laws.
MaterialTable: type[_MaterialTable] = create_model(
    "MaterialTable",
    __base__=_MaterialTable,
    __doc__="\n".join([inspect.cleandoc(str(_MaterialTable.__doc__)), *map(_explain, PARAMETERS)]),
    **{name: _annotate(name) for name in PARAMETERS},
)


def read_material_name(value: str) -> Material:
    """Return the material of the catalogue by its name, with any case and separators.

    Raises:
        ValueError: If the name is unknown.
    """
    name = match_name(value, MATERIALS)
    if name not in MATERIALS:
        raise ValueError(f"unknown material {shorten(value)}; {nearest(name[: LIMITS.name], MATERIALS, COMMON_NAMES)}")
    return MATERIALS[name]


def _read_material(value: object, read_table: Callable[[Any], Any]) -> Material:
    if isinstance(value, str):
        return read_material_name(value)
    made: Material = read_table(value).make()
    return made


AnyMaterial = Annotated[Material, TableOr(MaterialTable, _read_material, {"enum": list(MATERIALS)})]


class LayerTable(Table):
    """One layer of a cover.

    Attributes:
        thickness: Thickness of the layer.
        material: Name of a material of the catalogue, or a table of a material model and its parameters.
    """

    thickness: Length = Field(examples=["2 mm"])
    material: AnyMaterial = Field(examples=["dragon-skin-30"])

    def make(self) -> Layer:
        """Make the layer that the table describes."""
        return Layer(thickness=self.thickness, material=self.material)
