"""Tables of a data-set file: recordings under known loads, and the splits by which models are scored on them."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator
from functools import partial
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field

from validation.errors import shorten
from validation.schema import Table, types
from validation.schema.campaign import RecordingLimitsTable
from validation.text.quantity import Kind, read_quantity

#: Relative tolerance with which a selection of recordings by load includes its limits [-].
_SAME_LOAD = 1e-6
#: Word of a data-set file for a pose that is fitted to the recordings.
FITTED = "fitted"
#: Word of a data-set file for loads from the labels of each recording.
LABELS = "labels"
#: Word of a data-set file for loads from the force channel of each recording.
FORCE = "force"
#: Word of a data-set file for the zero of each texel from the frames at rest of each recording.
REST = "rest"
#: Word of a data-set file for counts that are zeroed already.
NO_ZERO = "none"
_TEXT = {"type": "string"}
_PAIR_JSON = {"anyOf": [{"enum": [FITTED]}, {"type": "array", "items": _TEXT, "minItems": 2, "maxItems": 2}]}


def _read_load(value: object) -> float:
    number = read_quantity(value, "force")
    if number < 0:
        raise ValueError(f"must be 0 or more, not {value!r}")
    return number


def _fitted_or_pair(kind: Kind, example: str) -> types.Read:
    """Make the annotation of a pose that is the word `fitted` or a pair of quantities along or about x and y.

    Args:
        kind: Kind of the two quantities.
        example: An accepted pair, for error messages.
    """

    def convert(value: object) -> tuple[float, float] | str:
        if value == FITTED:
            return FITTED
        if not isinstance(value, list) or len(value) != 2:  # noqa: PLR2004 -- x and y
            raise ValueError(f"must be {FITTED!r} or a pair such as {example}, not {shorten(str(value))}")
        first, second = (read_quantity(part, kind) for part in value)
        return first, second

    return types.Read(convert, _PAIR_JSON)


def _check_window(value: list[float]) -> tuple[float, float]:
    if len(value) != 2 or not 0 <= value[0] < value[1]:  # noqa: PLR2004 -- from, to
        raise ValueError(f"must be two times after loading in seconds, such as [6, 9], not {value}")
    return value[0], value[1]


def _read_selection(value: object, read_table: Callable[[Any], Any]) -> Any:  # noqa: ANN401 -- a table
    return read_table({"series": value} if isinstance(value, str) else value)


_Text = Annotated[str, Field(strict=True)]
_Path = Annotated[
    str, Field(strict=True), AfterValidator(partial(types.check_below, remedy="; or name it with --recordings"))
]
_Load = Annotated[float, types.Read(_read_load)]
_AnyLoad = Annotated[float | str, types.Read(lambda value: value if value in (LABELS, FORCE) else _read_load(value))]
_Position = Annotated[tuple[float, float] | str, _fitted_or_pair("length", '["1.7 mm", "-3.4 mm"]')]
_Tilt = Annotated[tuple[float, float] | str, _fitted_or_pair("angle", '["1 deg", "0 deg"]')]
_Yaw = Annotated[float | str, types.Read(lambda value: FITTED if value == FITTED else read_quantity(value, "angle"))]
_Window = Annotated[list[float], AfterValidator(_check_window)]
_Texts = Annotated[tuple[str, ...], types.OneOrMore(), Field(max_length=types.LIMITS.entries)]
_Patterns = Annotated[tuple[_Path, ...], types.OneOrMore(), Field(max_length=types.LIMITS.entries)]
_Uses = Annotated[tuple[Annotated[str, types.choice("fit", "score")], ...], types.OneOrMore()]


class CommonKeys(Table):
    """Keys of a data-set file that apply to all series, or to one series if they stand in it.

    Attributes:
        indenter: Indenter, such as "box:size=10mmx10mmx5mm".
        load: Load, or its source: "labels" of each recording, or its "force" channel.
        array: Index of the pressed array; the array with the largest change of counts when left out.
        threshold: Counts that the firmware subtracted; the value in the labels when left out.
        zero: Zero of each texel: the frames at "rest" of each recording, "none" for counts that are zeroed already,
            or the path of a recording of the unloaded array.
        window: First and last time after loading between which frames are averaged, in seconds.
        temperature_channel: Index of the temperature sensor, negative ones from the end.
        at: Position of the indenter's axis, or "fitted".
        yaw: Rotation of the indenter about its axis, or "fitted".
        tilt: Tilt of the indenter about x and y, or "fitted".
    """

    indenter: _Text | None = None
    load: _AnyLoad | None = None
    array: Annotated[int, types.number(0, 1000, whole=True)] | None = None
    threshold: Annotated[float, types.number(0, 1e9)] | None = None
    zero: _Path | None = None
    window: _Window | None = None
    temperature_channel: Annotated[int, types.number(-1000, 1000, whole=True)] | None = None
    at: _Position | None = None
    yaw: _Yaw | None = None
    tilt: _Tilt | None = None


class FileTable(Table):
    """One recording; its keys replace those of the series.

    Attributes:
        path: Path of the recording.
        load: Load, or its source.
        temperature: Temperature in degrees Celsius that replaces that of the recording.
        at: Position of the indenter's axis, or "fitted".
        yaw: Rotation of the indenter about its axis, or "fitted".
        placement: Name of the placement; recordings with the same name share a pose.
    """

    path: _Path = Field(examples=["press1.csv"])
    load: _AnyLoad | None = None
    temperature: float | None = None
    at: _Position | None = None
    yaw: _Yaw | None = None
    placement: str | None = None


class SeriesTable(CommonKeys):
    """Recordings that belong together.

    Attributes:
        name: Name of the series.
        files: Patterns of the names of recordings.
        file: Recordings with keys of their own.
        loads: Loads by pattern of the names of recordings.
        placement: Name of the placement; series with the same name share a pose.
        use: Permitted uses of the recordings.
    """

    name: str = Field(examples=["room"])
    files: _Patterns = ()
    file: Annotated[tuple[FileTable, ...], Field(max_length=types.LIMITS.entries)] = ()
    loads: dict[str, _Load] = Field(default_factory=dict)
    placement: str | None = None
    use: _Uses = ("fit", "score")


class SelectionTable(Table):
    """Recordings of a series: all, those between two loads, or those whose file name matches a pattern.

    Attributes:
        series: Name of the series.
        files: Patterns of the names of recordings.
        least: Least load of the selected recordings.
        most: Greatest load of the selected recordings.
    """

    series: str = Field(examples=["room"])
    files: _Texts = ()
    least: _Load | None = None
    most: _Load | None = None

    def takes(self, series: str, file: str, load: float) -> bool:
        """Return whether the selection takes the recording of a series with a file name and a load [N]."""
        named = not self.files or any(fnmatch.fnmatchcase(file, each) for each in self.files)
        above = self.least is None or load >= self.least * (1 - _SAME_LOAD)
        below = self.most is None or load <= self.most * (1 + _SAME_LOAD)
        return series == self.series and named and above and below


_Selections = Annotated[
    tuple[Annotated[SelectionTable, types.TableOr(SelectionTable, _read_selection, _TEXT)], ...], types.OneOrMore()
]


class SplitTable(Table):
    """A division of the recordings.

    Attributes:
        name: Name of the split.
        fit: Recordings to which electronics, gains and poses are fitted.
        score: Recordings that are scored.
        place: Recordings to which only the poses of the scored recordings are fitted.
        about: Purpose of the split.
    """

    name: str = Field(examples=["warmer"])
    fit: _Selections = Field(examples=[["room"]])
    score: _Selections = Field(examples=[["warm"]])
    place: _Selections = ()
    about: str = ""


class DataSetTables(CommonKeys):
    """Recordings under known loads, and the splits by which models are scored on them.

    Attributes:
        series: Recordings that belong together.
        split: Divisions into fitted and scored recordings.
        name: Name of the data set; the name of the file when left out.
        source: Publication of the recordings.
        sensor: Sensor file or built-in sensor that made the recordings.
        path: Folder of the recordings, below the folder of the file.
        required: Requirements on the scores, which replace those of the campaign.
    """

    MOST_BYTES: ClassVar[int] = 2**22

    series: Annotated[list[SeriesTable], Field(min_length=1, max_length=types.LIMITS.entries)]
    split: tuple[SplitTable, ...] = ()
    name: str | None = None
    source: str = ""
    sensor: str | None = None
    path: _Path | None = None
    required: RecordingLimitsTable = RecordingLimitsTable()

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield names of series and splits that occur twice."""
        for key, tables in (("series", self.series), ("split", self.split)):
            names = [table.name for table in tables]
            twice = sorted({name for name in names if names.count(name) > 1})
            yield from ((key, f"the name {name!r} stands twice; each needs its own") for name in twice)
