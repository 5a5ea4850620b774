"""The tables of a sensor file as pydantic dataclasses, which check the values and convert quantities to SI units.

Pydantic reports each fault with its path in the file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, Strict, WrapValidator
from pydantic.dataclasses import dataclass

from fastmodel.signal.electronics import TEXEL_FORCE
from meshes.array import MOST_TEXELS
from meshes.catalogue import MATERIALS
from meshes.material import MODELS, SERIES_MODELS, Material
from validation.errors import InputError, match_name, nearest
from validation.text.friction import read_friction
from validation.text.hardness import material_from_hardness, read_hardness
from validation.text.quantity import Kind, read_quantity

_CONFIG = ConfigDict(extra="forbid")

#: Upper limit on lengths, such as the pitch and the thickness of a layer: larger values must have a wrong unit [m].
LONGEST = 1.0
#: Lower limit on lengths: an atom is larger [m].
_SHORTEST = 1e-10
#: Largest radius of a calibration tip: one that is wider presses on several texels of any array [m].
_WIDEST_TIP = 0.02
#: Form of the key `calibrated` for a characteristic of the force that a tip applies through the cover: a number and a
#: unit follow.
_THROUGH_COVER = re.compile(r"through the cover, tip (\S{1,20} ?[a-zA-Z\u00b5\u03bc]{1,20})")
#: Largest length of a wrong value in a message, which leaves room for what is accepted [characters].
_LONGEST_VALUE = 80
#: Number of coefficients of the electronics' characteristic, a polynomial of degree 5 as in the 2015 report [-].
_COEFFICIENTS = 6
#: Upper limit on the absolute value of an exponent of the Ogden material model: powers with larger exponents overflow
#: at moderate stretches [-].
_LARGEST_EXPONENT = 100
#: Names of the parameters of all material models.
PARAMETERS = tuple(dict.fromkeys(name for parameters in MODELS.values() for name in parameters))


def quantity(kind: Kind, *, positive: bool = True) -> BeforeValidator:
    """Make a validator that parses a quantity with a unit and converts it to SI.

    Args:
        kind: Kind of quantity that is expected.
        positive: Whether the quantity must be positive.
    """

    def convert(value: object) -> float:
        number = read_quantity(value, kind)
        if positive and number <= 0:
            raise ValueError(f"must be positive, not {value!r}")
        if kind == "length" and number > LONGEST:
            raise ValueError(f"must be at most {LONGEST:g} m, not {value!r}")
        if positive and kind == "length" and number < _SHORTEST:
            raise ValueError(f"must be at least {_SHORTEST:g} m, not {value!r}")
        return number

    return BeforeValidator(convert)


def _terms(read_one: Callable[[object], float]) -> BeforeValidator:
    """Make a validator that reads a material parameter: one number, or a list with one number per term of the energy.

    Args:
        read_one: Function that reads one number.
    """

    def convert(value: object) -> tuple[float, ...]:
        return tuple(read_one(part) for part in (value if isinstance(value, list) else [value]))

    return BeforeValidator(convert)


def _exponent(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < abs(value) <= _LARGEST_EXPONENT:
        raise ValueError(f"must be a number other than 0, or a list of them, not {value!r}")
    return float(value)


def choice(*names: str) -> BeforeValidator:
    """Make a validator that accepts one of the given names."""

    def check(value: object) -> object:
        if value not in names:
            raise ValueError(f"{value!r} is unknown; {nearest(str(value), names)}")
        return value

    return BeforeValidator(check)


def _bounded(lowest: float, highest: float, note: str = "") -> AfterValidator:
    """Make a validator that accepts a number between two limits.

    Args:
        lowest: Least accepted number.
        highest: Greatest accepted number.
        note: Text that follows the limits in the error message.
    """

    def check(value: float) -> float:
        if not lowest <= value <= highest:
            raise ValueError(f"must lie in {lowest:.10g}..{highest:.10g}{note}, not {value:.10g}")
        return value

    return AfterValidator(check)


def read_unit(value: object) -> float:
    """Read a unit of length such as `mm` [m]."""
    return read_quantity(f"1 {value}", "length")


def _refuse_free_edges(value: object) -> object:
    raise ValueError(f"a cover with a size has free side edges, one without is wide; remove the key, not {value!r}")


def _refuse_even(value: int) -> int:
    if value % 2 == 0:
        raise ValueError(f"must be odd, not {value}")
    return value


def _refuse_other_degrees(coefficients: list[float]) -> list[float]:
    if len(coefficients) != _COEFFICIENTS:
        raise ValueError(f"takes {_COEFFICIENTS} numbers c0..c5 [1/N^k]")
    return coefficients


def _add_grid_keys(value: object) -> object:
    """Set missing keys of a grid of texels to None if the table has the key `positions`, which replaces the grid."""
    if isinstance(value, Mapping) and "positions" in value:
        return dict.fromkeys(("rows", "columns", "pitch")) | dict(value)
    return value


def _lengths(value: object) -> tuple[float, float]:
    """Read a pair of lengths along x and y, given as one length for the two directions or as a list [m]."""
    pair = value if isinstance(value, list) else [value, value]
    if len(pair) != 2:  # noqa: PLR2004 -- x and y
        raise ValueError(f"must be one length or [x, y], not {value!r}")
    numbers = (read_quantity(pair[0], "length"), read_quantity(pair[1], "length"))
    if min(numbers) <= 0:
        raise ValueError(f"must be positive, not {value!r}")
    if max(numbers) > LONGEST:
        raise ValueError(f"must be at most {LONGEST:g} m, not {value!r}")
    return numbers


def read_material(value: object, read_table: Callable[[object], Any]) -> Material:
    """Read a material: its name in the catalogue, or a table of a material model and its parameters.

    Args:
        value: The name or the table.
        read_table: Pydantic's function that reads the table.
    """
    if isinstance(value, str):
        value = match_name(value, MATERIALS)
        if value not in MATERIALS:
            raise ValueError(f"unknown material {value!r}; {nearest(value, MATERIALS)}")
        return MATERIALS[value]
    table: MaterialTable = read_table(value)
    return table.material()


Length = Annotated[float, quantity("length")]
Pressure = Annotated[float, quantity("pressure")]
Count = Annotated[int, Strict(), _bounded(1, 2**32)]
TexelCount = Annotated[int, Strict(), _bounded(1, MOST_TEXELS)]
OddCount = Annotated[TexelCount, AfterValidator(_refuse_even)]
Number = Annotated[float, Strict(), _bounded(-1e12, 1e12)]
Ratio = Annotated[float, Strict(), _bounded(0, 0.5, " (0.5 is incompressible)")]
Share = Annotated[float, Strict(), _bounded(0, 10)]
Lengths = Annotated[tuple[float, float], BeforeValidator(_lengths)]


@dataclass(config=_CONFIG, kw_only=True)
class ArrayTable:
    """Table `[array]`: texels on a grid of given rows, columns and pitch, or at positions listed in another file."""

    rows: TexelCount | None
    columns: TexelCount | None
    pitch: Lengths | None
    positions: str | None = None
    unit: Annotated[float, BeforeValidator(read_unit)] | None = None
    project: Annotated[bool, Strict()] = False
    texel_size: Lengths | None = None
    mask: list[str] | list[list[Annotated[int, _bounded(0, 1)]]] | None = None
    name: str | None = None


@dataclass(config=_CONFIG, kw_only=True)
class MaterialTable:
    """Table `material = { ... }`: a material model, and fields for the parameters of all models.

    Each model requires its own parameters and refuses those of other models.
    """

    model: Annotated[str, choice(*MODELS)]
    poisson_ratio: Ratio | None = None
    youngs_modulus: Pressure | None = None
    shear_modulus: Pressure | None = None
    c10: Pressure | None = None
    c01: Annotated[float, quantity("pressure", positive=False)] | None = None
    c1: Pressure | None = None
    c2: Annotated[float, quantity("pressure", positive=False)] | None = None
    c3: Annotated[float, quantity("pressure", positive=False)] | None = None
    mu: Annotated[tuple[float, ...], _terms(lambda value: read_quantity(value, "pressure"))] | None = None
    alpha: Annotated[tuple[float, ...], _terms(_exponent)] | None = None
    hardness: Annotated[Any, BeforeValidator(read_hardness)] = None
    name: str = ""
    source: str | None = None
    spread: Share | None = None
    poisson_spread: Ratio = 0.0

    def material(self) -> Material:
        """Make the material that the table describes.

        Raises:
            ValueError: If a parameter of the model is missing, or a parameter of another model is given.
        """
        given = {name: value for name in PARAMETERS if (value := getattr(self, name)) is not None}
        if self.poisson_ratio is None and self.model == "linear-elastic":
            raise ValueError("poisson_ratio is missing; write for example poisson_ratio = 0.49")
        made = self._from_parameters(given) if self.hardness is None else self._from_hardness(given)
        return replace(
            made,
            source=made.source if self.source is None else self.source,
            spread=made.spread if self.spread is None else self.spread,
            poisson_spread=self.poisson_spread,
        )

    def _from_parameters(self, given: Mapping[str, Any]) -> Material:
        wanted = MODELS[self.model]
        if set(given) != set(wanted):
            listed = ", ".join(f"{name} [{unit}]" for name, unit in wanted.items())
            terms = " (one number, or a list with one for each term)" if self.model in SERIES_MODELS else ""
            names = ", ".join(sorted(given)) or "nothing"
            raise ValueError(f"{self.model} takes {listed}{terms} and poisson_ratio, not {names}")
        return Material(
            name=self.name or self.model,
            model=self.model,
            parameters=given,
            poisson_ratio=0.5 if self.poisson_ratio is None else self.poisson_ratio,
        )

    def _from_hardness(self, given: Mapping[str, Any]) -> Material:
        if given:
            raise ValueError(f"hardness replaces the modulus; give it or {', '.join(sorted(given))}, not both")
        return material_from_hardness(self.hardness, self.model, poisson_ratio=self.poisson_ratio, name=self.name)


@dataclass(config=_CONFIG, kw_only=True)
class LayerTable:
    """Table `[[cover.layer]]`: one layer of the cover."""

    thickness: Length
    material: Annotated[MaterialTable, WrapValidator(read_material)]


@dataclass(config=_CONFIG, kw_only=True)
class CoverTable:
    """Table `[cover]`: layers of the cover, how its bottom is held, and its size."""

    layer: Annotated[list[LayerTable], Field(min_length=1)]
    base: Annotated[Literal["bonded", "sliding"], choice("bonded", "sliding")] = "bonded"
    size: Lengths | None = None
    free_edges: Annotated[object, BeforeValidator(_refuse_free_edges)] = None


def _calibration(value: object) -> str:
    """Read what a characteristic was calibrated against, and return it as `Electronics.calibrated` has it."""
    accepted = f"accepted: '{TEXEL_FORCE}' or 'through the cover, tip 1 mm' (radius of the tip's hemispherical end)"
    if value == TEXEL_FORCE:
        return TEXEL_FORCE
    tip = _THROUGH_COVER.fullmatch(value) if isinstance(value, str) else None
    if tip is None:
        text = repr(value)
        text = text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}..."
        raise ValueError(f"{text} is not what a characteristic can be calibrated against; {accepted}")
    try:
        radius = read_quantity(tip[1], "length")
    except InputError as error:
        raise ValueError(f"{'; '.join(error.faults)}; {accepted}") from None
    if not 0 < radius <= _WIDEST_TIP:
        raise ValueError(f"the radius of the tip must lie in 0..{1e3 * _WIDEST_TIP:g} mm, not {tip[1]!r}; {accepted}")
    return f"through the cover, tip {1e3 * radius:.9g} mm"


def _friction(value: object) -> float:
    return read_friction(value, example="friction = 0.4 or friction = 'no-slip'")


@dataclass(config=_CONFIG, kw_only=True)
class ContactTable:
    """Table `[contact]`: friction between indenter and cover in the finite elements, infinite for no slip."""

    friction: Annotated[float, BeforeValidator(_friction)] = 0.0


@dataclass(config=_CONFIG, kw_only=True)
class FilterTable:
    """Table `[filter]`: the Butterworth low-pass filter before the electronics."""

    cutoff: Annotated[float, quantity("frequency")]
    order: Annotated[int, Strict(), _bounded(1, 20)] = 2


@dataclass(config=_CONFIG, kw_only=True)
class SpreadTable:
    """Table `[spread]`: a Gaussian spread kernel that replaces the fitted kernel; sigma in pitches, ksize in texels."""

    sigma_x: Annotated[float, Strict(), _bounded(1e-3, 100)]
    sigma_y: Annotated[float, Strict(), _bounded(1e-3, 100)]
    ksize_x: OddCount
    ksize_y: OddCount


@dataclass(config=_CONFIG, kw_only=True)
class ElectronicsTable:
    """Table `[electronics]`: conversion of texel forces to counts; what is left out is assumed and labelled so."""

    rate: Annotated[float, quantity("frequency")] | None = None
    sensitivity: Annotated[float, quantity("per force")] | None = None
    offset: Number = 0.0
    output_max: Count | None = None
    bits: Annotated[int, Strict(), _bounded(1, 32)] = 12
    noise: Annotated[float, quantity("force", positive=False)] = 0.0
    threshold: Annotated[float, Strict(), _bounded(0, 1e9)] = 0.0
    saturation_band: Annotated[float, Strict(), _bounded(0, 1e9)] = 0.0
    characteristic: Annotated[list[Number], AfterValidator(_refuse_other_degrees)] | None = None
    gains: list[Number] | None = None
    calibrated: Annotated[str, BeforeValidator(_calibration)] = TEXEL_FORCE


@dataclass(config=_CONFIG, kw_only=True)
class SensorTables:
    """All tables of a sensor file."""

    array: Annotated[ArrayTable, BeforeValidator(_add_grid_keys)]
    cover: CoverTable
    electronics: ElectronicsTable = Field(default_factory=ElectronicsTable)
    contact: ContactTable = Field(default_factory=ContactTable)
    filter: FilterTable | None = None
    spread: SpreadTable | None = None
    name: str | None = None
