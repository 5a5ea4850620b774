"""The tables of a data-set file (TOML) as pydantic dataclasses, which check the values and convert them to SI units."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, Strict
from pydantic.dataclasses import dataclass

from validation.errors import nearest
from validation.text.quantity import read_quantity

_CONFIG = ConfigDict(extra="forbid")

#: Word of a data-set file for a pose that is found from the recordings.
FITTED = "fitted"
#: Words for the source of a load: the labels of each recording, or its force channel.
LABELS, FORCE = "labels", "force"
#: Ways in which the recordings of a series may be used.
_USES = ("fit", "score")
#: Largest accepted number of entries in a list [-].
_MOST_ENTRIES = 10_000


def _read_load(value: object) -> float:
    number = read_quantity(value, "force")
    if number < 0:
        raise ValueError(f"must be 0 or more, not {value!r}")
    return number


def _read_load_or_word(value: object) -> float | str:
    return value if value in (LABELS, FORCE) else _read_load(value)


def _read_pair(value: object, kind: Literal["length", "angle"], example: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:  # noqa: PLR2004 -- x and y
        raise ValueError(f"must be {FITTED!r} or a pair such as {example}, not {value!r}")
    first, second = (read_quantity(part, kind) for part in value)
    return first, second


def _read_position(value: object) -> tuple[float, float] | str:
    return FITTED if value == FITTED else _read_pair(value, "length", '["1.7 mm", "-3.4 mm"]')


def _read_tilt(value: object) -> tuple[float, float] | str:
    return FITTED if value == FITTED else _read_pair(value, "angle", '["1 deg", "0 deg"]')


def _read_yaw(value: object) -> float | str:
    return FITTED if value == FITTED else read_quantity(value, "angle")


def _check_window(value: list[float]) -> tuple[float, float]:
    if len(value) != 2 or not 0 <= value[0] < value[1]:  # noqa: PLR2004 -- from, to
        raise ValueError(f"must be two times after loading in seconds, such as [6, 9], not {value}")
    return value[0], value[1]


def _check_uses(value: list[str]) -> tuple[str, ...]:
    for word in value:
        if word not in _USES:
            raise ValueError(f"{word!r} is unknown; {nearest(word, _USES)}")
    return tuple(value)


def _list(value: object) -> object:
    """Accept one value where a list is expected."""
    return value if isinstance(value, list) else [value]


_Load = Annotated[float, BeforeValidator(_read_load)]
_AnyLoad = Annotated[float | str, BeforeValidator(_read_load_or_word)]
_Position = Annotated[tuple[float, float] | str, BeforeValidator(_read_position)]
_Yaw = Annotated[float | str, BeforeValidator(_read_yaw)]
_Tilt = Annotated[tuple[float, float] | str, BeforeValidator(_read_tilt)]
_Window = Annotated[list[float], AfterValidator(_check_window)]
_Count = Annotated[int, Strict(), Field(ge=0, le=1000)]
_Channel = Annotated[int, Strict(), Field(ge=-1000, le=1000)]
_Threshold = Annotated[float, Strict(), Field(ge=0, le=1e9)]
_Texts = Annotated[list[str], BeforeValidator(_list), Field(max_length=_MOST_ENTRIES)]


@dataclass(config=_CONFIG, kw_only=True)
class CommonKeys:
    """Keys that stand in the data-set file for all series, or in a series for that series."""

    indenter: Annotated[str, Strict()] | None = None
    load: _AnyLoad | None = None
    array: _Count | None = None
    threshold: _Threshold | None = None
    window: _Window | None = None
    temperature_channel: _Channel | None = None
    at: _Position | None = None
    yaw: _Yaw | None = None
    tilt: _Tilt | None = None


@dataclass(config=_CONFIG, kw_only=True)
class FileTable:
    """Table `[[series.file]]`: one recording; `load`, `temperature` and `at` replace those of the series."""

    path: str
    load: _AnyLoad | None = None
    temperature: float | None = None
    at: _Position | None = None
    yaw: _Yaw | None = None
    placement: str | None = None


@dataclass(config=_CONFIG, kw_only=True)
class SeriesTable(CommonKeys):
    """Table `[[series]]`: recordings that belong together."""

    name: str
    files: _Texts = Field(default_factory=list)
    file: Annotated[list[FileTable], Field(max_length=_MOST_ENTRIES)] = Field(default_factory=list)
    loads: dict[str, _Load] = Field(default_factory=dict)
    placement: str | None = None
    use: Annotated[list[str], BeforeValidator(_list), AfterValidator(_check_uses)] = Field(
        default_factory=lambda: list(_USES)
    )


@dataclass(config=_CONFIG, kw_only=True)
class SelectionTable:
    """Recordings of a series: all, those between two loads, or those whose file name matches a pattern."""

    series: str
    files: _Texts = Field(default_factory=list)
    least: _Load | None = None
    most: _Load | None = None


def _read_selection(value: object) -> object:
    return {"series": value} if isinstance(value, str) else value


_Selection = Annotated[SelectionTable, BeforeValidator(_read_selection)]
_Selections = Annotated[list[_Selection], BeforeValidator(_list)]


@dataclass(config=_CONFIG, kw_only=True)
class SplitTable:
    """Table `[[split]]`: recordings to fit, to find the placement of scored series with, and to score."""

    name: str
    fit: _Selections
    score: _Selections
    place: _Selections = Field(default_factory=list)
    about: str = ""


@dataclass(config=_CONFIG, kw_only=True)
class DataSetTables(CommonKeys):
    """All tables of a data-set file."""

    series: Annotated[list[SeriesTable], Field(min_length=1, max_length=_MOST_ENTRIES)]
    split: list[SplitTable] = Field(default_factory=list)
    name: str | None = None
    source: str = ""
    sensor: str | None = None
    path: str | None = None
