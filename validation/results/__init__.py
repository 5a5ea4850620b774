"""Results as models: frozen dataclasses that are written to JSON and read back, with the printed form of their fields.

A field that tables show has a `Column`, which holds its heading, unit, format and meaning.  NaN and infinity become
null in JSON. A field of type `Number` reads null as NaN, a field of type `Bound` as infinity.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self, TypeVar, cast, dataclass_transform

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, ConfigDict, Field, GetCoreSchemaHandler
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, SchemaValidator, core_schema

from validation.json_values import to_json_values

T = TypeVar("T")

#: Text in a table for a number that does not exist.
DASH = "\u2013"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Column:
    """Printed form of a quantity in tables.

    Attributes:
        heading: Heading of the column.
        unit: Printed unit; empty for none.
        factor: Factor from the value, in SI units or as a fraction, to the printed unit.
        decimals: Number of printed decimals; None to print significant digits.
        digits: Number of significant digits if `decimals` is None.
        meaning: Explanation of the quantity in a few words.
        shown: Whether tables that show all quantities of a result have the column.
        small: Smaller second line, a format of the result, such as `against: {0.exact}`.
        parts: Headings of the columns of a tuple of numbers.
        words: Printed words by value; empty for numbers and for texts that are printed unchanged.
        alarms: Values whose words are emphasised.
        factor_field: Name of the field with the factor, if rows have different factors.
    """

    heading: str
    unit: str = ""
    factor: float = 1.0
    decimals: int | None = None
    digits: int = 3
    meaning: str = ""
    shown: bool = True
    small: str = ""
    parts: tuple[str, ...] = ()
    words: Mapping[Any, str] = dataclasses.field(default_factory=dict)
    alarms: tuple[Any, ...] = ()
    factor_field: str = ""

    @property
    def title(self) -> str:
        """Heading of the column with its unit in brackets."""
        return f"{self.heading} [{self.unit}]" if self.unit else self.heading

    def text(self, value: float | None) -> str:
        """Format a value of the quantity in the printed unit, without the unit; a dash if it is None or NaN."""
        if value is None or math.isnan(value):
            return DASH
        scaled = self.factor * value
        return format_digits(scaled, self.digits) if self.decimals is None else f"{scaled:.{self.decimals}f}"


def format_digits(value: float, digits: int) -> str:
    """Format a number with the given number of significant digits, without exponent if it lies from 1e-4 to 1e6.

    In the printed units, such as mm, numbers below 1e-12 are rounding errors of zero, and are printed as it.
    """
    if abs(value) < 1e-12 or not math.isfinite(value):  # noqa: PLR2004 -- as the docstring says
        return "0" if abs(value) < 1 else "inf"
    if not 1e-4 <= abs(value) < 1e6:  # noqa: PLR2004 -- as the docstring says
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"


class _Array:
    """Annotation by which pydantic reads a numpy array from nested lists; null becomes NaN."""

    def __init__(self, dtype: npt.DTypeLike) -> None:
        self._dtype = dtype

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(lambda value: np.asarray(value, dtype=self._dtype))


class Unread:
    """Annotation of a field that pydantic keeps unchanged, and that is neither written nor read."""

    def __get_pydantic_core_schema__(  # noqa: D105 -- as pydantic names it
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.any_schema()


#: An array of numbers.
Array = Annotated[npt.NDArray[np.float64], _Array(np.float64)]
#: An array of indices.
Indices = Annotated[npt.NDArray[np.intp], _Array(np.intp)]
#: An image of grey levels, 0..255.
GreyImage = Annotated[npt.NDArray[np.uint8], _Array(np.uint8)]
#: A number that may be NaN; NaN is null in JSON.
Number = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
#: A number that may be infinite; infinity is null in JSON.
Bound = Annotated[float, BeforeValidator(lambda value: math.inf if value is None else value)]


def renamed(key: str) -> Any:  # noqa: ANN401 -- as `pydantic.Field`
    """Return the description of a required field whose key in JSON differs from its name.

    Args:
        key: Name in JSON.
    """
    return Field(validation_alias=key, serialization_alias=key)


class Result:
    """Base of results that can be written as JSON and read again; results with equal JSON are equal.

    Subclasses are decorated with `result_model`.
    """

    #: Properties that are written to JSON in addition to the fields, as pairs (key in JSON, name of the property).
    #: They are not read again.
    computed: ClassVar[tuple[tuple[str, str], ...]] = ()
    #: Printed form in tables of the properties of the class, by name of the property.
    printed: ClassVar[Mapping[str, Column]] = {}

    def as_json(self) -> dict[str, Any]:
        """Return the result as a dictionary of JSON values."""
        fields = {name: info for name, info in _fields(type(self)).items() if not info.exclude}
        own = {info.serialization_alias or name: getattr(self, name) for name, info in fields.items()}
        return {key: to_json_values(value) for key, value in own.items()} | {
            key: to_json_values(getattr(self, name)) for key, name in self.computed
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """Read a result from a dictionary of JSON values.

        Raises:
            ValidationError: If a field is missing or has another type; keys that are no field are ignored.
        """
        validator: SchemaValidator = vars(cls)["__pydantic_validator__"]
        return cast("Self", validator.validate_python(dict(values)))

    def __eq__(self, other: object) -> bool:
        """Return whether both results have the same type and the same JSON values."""
        return type(self) is type(other) and isinstance(other, Result) and self.as_json() == other.as_json()

    def __hash__(self) -> int:
        """Return the hash of the type, which is equal for equal results; arrays in a result have no hash."""
        return hash(type(self))


@dataclass_transform(kw_only_default=True, frozen_default=True, eq_default=False, field_specifiers=(Field, renamed))
def result_model(cls: type[T]) -> type[T]:
    """Decorate a class as a `Result`: a frozen, keyword-only dataclass whose fields pydantic checks."""
    config = ConfigDict(extra="ignore", populate_by_name=True)
    made: Any = dataclass(frozen=True, kw_only=True, eq=False, config=config)(cls)
    return cast("type[T]", made)


def columns(cls: type[Result]) -> dict[str, Column]:
    """Return the printed forms (`Column`) of the fields and properties of a type of results, by name."""
    found = {name: info.metadata for name, info in _fields(cls).items()}
    fields = {name: column for name, metadata in found.items() for column in metadata if isinstance(column, Column)}
    return {**fields, **cls.printed}


#: A dictionary of JSON values; other values are converted when it is made.
JsonObject = Annotated[Mapping[str, Any], BeforeValidator(to_json_values)]


def _fields(cls: type[Result]) -> Mapping[str, FieldInfo]:
    return cast("Mapping[str, FieldInfo]", vars(cls)["__pydantic_fields__"])
