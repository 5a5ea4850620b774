"""Tables of a baseline: the stored values that a regression check compares with, in JSON."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from validation.errors import shorten
from validation.schema import Table
from validation.schema.types import Read

#: Version of the format of baseline files; files of other versions are refused [-].
FORMAT = 2
#: End of the text of a tolerance that is a share of the stored number, such as `0.5 % of value`.
OF_VALUE = " % of value"


def _read_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{shorten(value)} is not a finite number")
    return value


def _read_rows(value: object) -> dict[str, tuple[float, ...]]:
    """Return numbers by label, from a number, or from numbers or lists of numbers by label."""
    labelled = value if isinstance(value, dict) else {"": value}
    rows = {label: row if isinstance(row, list) else [row] for label, row in labelled.items()}
    return {label: tuple(_read_number(number) for number in row) for label, row in rows.items()}


def _read_tolerance(value: object) -> float | str:
    is_share = isinstance(value, str) and value.endswith(OF_VALUE)
    try:
        number = _read_number(float(str(value).removesuffix(OF_VALUE)) if is_share else value)
    except ValueError:
        raise ValueError(f"{shorten(value)} is not a finite number, nor a share such as '0.5{OF_VALUE}'") from None
    if number <= 0:
        raise ValueError(f"must be positive, not {shorten(value)}")
    return str(value) if is_share else number


def _read_format(value: object) -> Any:  # noqa: ANN401 -- the version
    if value != FORMAT or isinstance(value, bool):
        raise ValueError(f"its format is {shorten(value)}; this version reads {FORMAT}")
    return value


_NUMBER = {"type": "number"}
_ROW = {"anyOf": [_NUMBER, {"type": "array", "items": _NUMBER}]}
_ROWS_JSON = {"anyOf": [_NUMBER, {"type": "object", "additionalProperties": _ROW}]}


class ReadingTable(Table):
    """The stored value of a quantity that a regression check compares.

    Attributes:
        unit: Unit of the numbers.
        tolerance: Largest difference that is no change, in the unit or as a share such as "0.5 % of value".
        value: A number, or numbers or lists of numbers by label.
    """

    unit: str = Field(examples=["N"])
    tolerance: Annotated[float | str, Read(_read_tolerance, {"anyOf": [_NUMBER, {"type": "string"}]})] = Field(
        examples=[0.1]
    )
    value: Annotated[dict[str, tuple[float, ...]], Read(_read_rows, _ROWS_JSON)] = Field(examples=[1.5])


class BaselineTables(Table):
    """Values of all quantities of a sensor.

    Attributes:
        format: Version of the format.
        sensor: The sensor in one line.
        versions: Versions of packages by name.
        quantities: Stored value of each quantity by its title.
    """

    MOST_BYTES: ClassVar[int] = 2**24
    IS_JSON: ClassVar[bool] = True

    format: Annotated[Literal[2], Read(_read_format, {"enum": [FORMAT]})] = Field(examples=[FORMAT])
    sensor: str
    versions: dict[str, str]
    quantities: dict[str, ReadingTable]
