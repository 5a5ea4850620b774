"""Reads and writes recordings as CSV files with one line per frame.

The header line names the columns: `time` [s], then optionally `force` [N] and `temperature` [degC], then one column per
texel, row by row, x fastest.  Lines of the form `# key = value` before the header may give `rows`, `columns`, `pitch`
[m], `full_scale`, `indenter`, `load` [N] and `note`.  Other keys are kept unchanged (`Setup.other`).  A key consists of
letters, digits, spaces and `_ - . [ ] /`, and starts with a letter.  Every other line that starts with `#` is a
comment.

A file whose header line holds semicolons has semicolons between columns and decimal commas; one with tabs has tabs and
decimal points.  The name of the first column may state another unit of time: `time_ms`, `time [us]`.  `force [N]` and
`temperature [degC]` are read too; a column of another unit than those beside it is no texel and refused.  Times since
1970 may be in seconds, milliseconds, microseconds or nanoseconds, which their size tells; the label `time unit` states
it.
A file with three columns per texel, such as `x0, y0, z0` or `texel_0_x`, needs the name of the axis that is read: key
`axis`, or the option.

Counts may be negative (a zero was subtracted) and may have fractions (means of several frames).  Fractions are rounded
to whole counts, and the label `counts rounded` states the largest change.  Values are refused if rounding would change
them by more than 1 % of the largest value.
"""

from __future__ import annotations

import array
import csv
import io
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from meshes import TexelArray, atomic_file
from meshes.array import MOST_TEXELS
from validation.recordings.recording import (
    DEFAULT_FULL_SCALE,
    DEFAULT_PITCH,
    MOST_FULL_SCALE,
    PITCH_LABEL,
    CountArray,
    FloatArray,
    Recording,
    RecordingError,
    Setup,
    hash_contents,
    make_array,
    open_recorded,
)

#: Pattern of the keys in the lines `# key = value` of a CSV file.
_KEY = re.compile(r"[A-Za-z][\w .\-\[\]/]{0,59}")
#: Keys of the lines `# key = value` that have a meaning; other keys are kept as labels.
_KEYS = frozenset({"rows", "columns", "pitch", "full_scale", "indenter", "load", "note"})
#: Largest accepted number of characters in a line [-]; enough for ten thousand texels.
MOST_CHARACTERS = 2**18
#: Largest accepted number of numbers in a file [-]; enough for 15 minutes of 84 texels at 271 frames/s.
MOST_VALUES = 25_000_000
#: Largest accepted number in a column of times [s], forces [N] or temperatures [degC].  Larger times, in nanoseconds,
#: do not fit into 64 bits.
_LARGEST = 9e9
#: Smallest and largest accepted pitch [m]; other values indicate a wrong unit.
_PITCHES = (1e-6, 1.0)
#: Largest accepted number of keys in a file [-].
_MOST_KEYS = 64
#: Label that states the largest change of counts by rounding.
_ROUNDED = "counts rounded"
#: Largest accepted change of a count by rounding, over the largest count [-].
_MOST_ROUNDED = 0.01
#: Label that states the unit of times since 1970 that are not in seconds.
TIME_UNIT = "time unit"
#: Units of time: units per second by name.
_UNITS = {"ns": 1e9, "us": 1e6, "ms": 1e3, "s": 1.0}
#: Smallest time since 1970, a date in 1973, in seconds.  Larger numbers are in another unit, which their size tells.
_SINCE_1970 = 1e8
#: Pattern of the name of the column of times, with its unit.
_TIME = re.compile(r"time(?:[ _]*[(\[]?(s|ms|us|ns)[)\]]?)?")
#: Pattern of the names of the optional columns with their unit.
_SENSOR_UNIT = re.compile(r"(force)[ _]*[(\[]?n[)\]]?|(temperature)[ _]*[(\[]?(?:deg|°) ?c[)\]]?")
#: Pattern of the end of a name that states a unit.
_UNIT = re.compile(r"[(\[]([^\W\d]+)[)\]]$")
#: Other names of the columns of a history.
_HISTORY = {"force": "load", "load_n": "load", "depth_m": "depth", "x_m": "x", "y_m": "y"}
#: Separators between columns, by name; the first one that the header line holds counts.
_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}
#: Pattern of the name of a column that holds one of three axes of a texel.
_AXIS = re.compile(r"(?P<before>.*)(?P<axis>[xyz])(?P<after>[^a-z]*)")
#: Number of axes of a texel [-].
_AXES = 3
#: Names of the optional columns of a CSV file between the time and the texels.
_SENSOR_COLUMNS = ("force", "temperature")
#: The columns of a recording, in words.
_COLUMNS = (
    "the columns `time` [s] or `time_ms`, optionally `force` and `temperature`, and one column per texel, each with a "
    "name of its own; texels that form no rectangle are not read: order them in rows and columns of one pitch, with a "
    "column of zeros for each missing one"
)


@dataclass(frozen=True)
class _Table:
    """Content of the CSV file of a recording or of a force sensor.

    Attributes:
        path: The file.
        notes: Values of the lines `# key = value`, by key.
        header: Names of the columns, in lower case.
        values: Numbers in the lines below the header, shape (lines, columns).
        comma: Whether numbers have decimal commas.
        unit: Unit of times since 1970, if their size told it; empty otherwise.
    """

    path: Path
    notes: Mapping[str, str]
    header: list[str]
    values: FloatArray
    comma: bool = False
    unit: str = ""

    def get_column(self, name: str) -> FloatArray:
        """Return the numbers of the column with this name, shape (lines,); shape (0,) if the column is missing."""
        return self.values[:, self.header.index(name)] if name in self.header else np.empty(0)

    def read_note(self, key: str, least: float = 0.0, most: float = math.inf, *, whole: bool = False) -> float | None:
        """Return the value of the line `# key = value`, a finite number between two limits; None if there is no line.

        Args:
            key: The key.
            least: Least accepted number.
            most: Greatest accepted number.
            whole: Whether the number must be whole.
        """
        if key not in self.notes:
            return None
        start = f"{self.path}: # {key} = {self.notes[key][:40]}"
        expected = f"expected a {'whole number' if whole else 'number'} of {least:.10g} to {most:.10g}"
        try:
            value = _parse_number(self.notes[key], comma=self.comma)
        except ValueError as error:
            raise RecordingError(f"{start}: not a number; {expected}") from error
        if not least <= value <= most or math.isinf(value) or (whole and not value.is_integer()):
            raise RecordingError(f"{start}: {expected}")
        return value


def read(
    path: str | Path,
    *,
    rows: int | None = None,
    columns: int | None = None,
    sensor: TexelArray | None = None,
    axis: str | None = None,
) -> Recording:
    """Read a recording from a CSV file.

    Args:
        path: The CSV file.
        rows: Number of texels along y; taken from the file if not given [-].
        columns: Number of texels along x; taken from the file if not given [-].
        sensor: Array that was recorded, for rows, columns and pitch that neither the arguments nor the file state.
        axis: Axis `x`, `y` or `z` that is read from a file with three columns per texel.

    Raises:
        RecordingError: If the file cannot be read; the message names the line.
    """
    path = Path(path)
    table = _read_table(path)
    if not len(table.values):
        raise RecordingError(f"{path}: no frames; expected at least one line of numbers")
    readings = table.values[:, _choose_columns(table, axis)]
    full_scale = int(table.read_note("full_scale", 1, MOST_FULL_SCALE, whole=True) or DEFAULT_FULL_SCALE)
    if (largest := np.abs(readings).max(initial=0)) > full_scale:
        raise RecordingError(
            f"{path}: a count of {largest:.10g} exceeds the full scale of {full_scale}; write the largest count "
            f"of the sensor before the first line, for example `# full_scale = 65535`"
        )
    counts, other = _round_counts(path, readings)
    other |= {TIME_UNIT: f"{table.unit} since 1970"} if table.unit else {}
    stamps, temperatures, forces = (table.get_column(name) for name in ("time", "temperature", "force"))
    times = stamps - stamps[0]
    if stated := table.read_note("pitch", *_PITCHES):
        pitch = (stated, stated)
    elif sensor is not None:
        pitch = sensor.pitch
    else:
        pitch = (DEFAULT_PITCH, DEFAULT_PITCH)
        other |= PITCH_LABEL
    shape = _find_shape(table, rows, columns, sensor, texels=counts.shape[1])
    active = sensor.active if sensor is not None and shape == (sensor.rows, sensor.columns) else None
    digest = hash_contents(path)
    return Recording(
        path=path,
        sha256=digest,
        started=datetime.fromtimestamp(max(0.0, stamps[0]), UTC),
        times=times,
        arrays=(make_array(*shape, counts, pitch=pitch, full_scale=full_scale, active=active),),
        temperatures=temperatures.reshape(-1, 1) if temperatures.size else np.empty((0, 0)),
        temperature_times=times[: len(temperatures)],
        setup=Setup(
            indenter=table.notes.get("indenter", ""),
            load=table.read_note("load"),
            note=table.notes.get("note", ""),
            source=path.name,
            source_sha256=digest,
            other={key: value for key, value in table.notes.items() if key not in _KEYS} | other,
        ),
        forces=forces,
        force_times=times[: len(forces)],
    )


def read_forces(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Read the CSV file of a force sensor, with the columns `time` [s] and `force` [N].

    Returns:
        Times [s] and forces [N], each of shape (readings,).

    Raises:
        RecordingError: If the file cannot be read; the message names the line.
    """
    path = Path(path)
    table = _read_table(path)
    forces = table.get_column("force")
    if not forces.size:
        raise RecordingError(f"{path}: no forces; expected the columns `time` and `force` and at least one line")
    return table.get_column("time"), forces


def read_history(path: str | Path, *kinds: tuple[str, ...]) -> dict[str, FloatArray]:
    """Read the CSV file of a history: the column `time` [s], and others such as `load` or `load_N` [N] or `depth` [m].

    Args:
        path: The file.
        kinds: Each accepted set of columns beside `time`.

    Returns:
        Numbers by column, `time` from zero on, shape (k,) each [s, N, m].

    Raises:
        RecordingError: If the file cannot be read, or has other columns; the message names the line.
    """
    expected = (
        f"`time` [s] with {', or '.join(' and '.join(f'`{name}`' for name in kind) for kind in kinds)} [N, m], and a "
        "line for each instant"
    )
    table = _read_table(Path(path), expected, "a CSV file with a history")
    found = {_HISTORY.get(name, name): table.get_column(name) for name in table.header}
    if set(found) not in [{"time", *kind} for kind in kinds] or not len(table.values):
        raise RecordingError(
            f"{path}: columns {', '.join(table.header)[:80]}, {len(table.values)} lines; expected {expected}"
        )
    if found["time"][0] < 0:
        raise RecordingError(f"{path}: begins at {found['time'][0]:g} s; a history begins at 0 s or later")
    return found | {"time": found["time"] - found["time"][0]}


def write(recording: Recording, path: str | Path, *, array: int = 0) -> None:
    """Write one array of a recording as a CSV file that `read` reads.

    Readings of the force sensor and of the first temperature channel are interpolated to the times of the frames.

    Args:
        recording: The recording.
        path: The file to write; an existing file is replaced.
        array: Index of the array in the recording.

    Raises:
        OSError: If the file cannot be written; an existing file then remains.
    """
    recorded, setup = recording.arrays[array], recording.setup
    texels = recorded.texels
    notes = {
        "rows": texels.rows,
        "columns": texels.columns,
        "pitch": texels.pitch[0],
        "full_scale": recorded.full_scale,
        "indenter": setup.indenter,
        "load": "" if setup.load is None else setup.load,
        "note": " ".join(setup.note.split()),
    }
    others = {key: value for key, value in setup.other.items() if _KEY.fullmatch(key) and key not in _KEYS}
    notes |= {key: " ".join(value.split()) for key, value in others.items()}
    start = recording.started.timestamp()
    text = io.StringIO()
    text.writelines(f"# {key} = {value}\n" for key, value in notes.items() if value != "")
    read = {"force": (recording.force_times, recording.forces)}
    if recording.temperatures.size:
        read["temperature"] = (recording.temperature_times, recording.temperatures[:, 0])
    extra = {
        name: np.interp(recording.times, times[known], values[known]).tolist()
        for name, (times, values) in read.items()
        if (known := np.isfinite(values)).any()
    }
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *extra, *(f"texel_{number}" for number in range(texels.count))])
    for time, *values, counts in zip(recording.times, *extra.values(), recorded.counts, strict=True):
        writer.writerow([f"{start + time:.6f}", *map(repr, values), *counts.tolist()])
    atomic_file.replace(Path(path), [text.getvalue().encode()])


def _read_table(path: Path, columns: str = _COLUMNS, kind: str = "a recording") -> _Table:
    """Read the lines `# key = value`, the header line and the numbers of a CSV file; errors name columns and kind."""
    notes: dict[str, str] = {}
    header: list[str] = []
    values = array.array("d")
    before = -math.inf
    first, delimiter, stated, unit, scale = 0, "", "", "", 1.0
    for place, line in _read_lines(path, kind):
        if line.startswith("#"):
            _add_note(place, line, notes)
            continue
        try:
            delimiter = delimiter or next((each for each in _SEPARATORS if each in line), ",")
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
        except csv.Error as error:
            raise RecordingError(f"{place}: {error}; expected numbers between commas, semicolons or tabs") from error
        if not header:
            header, stated = _read_header(place, cells, _SEPARATORS[delimiter], columns)
            first = _find_first_texel(header)
            continue
        if len(values) + len(cells) > MOST_VALUES:
            raise RecordingError(f"{place}: more than the {MOST_VALUES} numbers accepted")
        numbers = _read_numbers(place, cells, header, comma=delimiter == ";")
        if not values:
            unit = next((name for name, by in _UNITS.items() if numbers[0] >= _SINCE_1970 * by), "s")
            scale = _UNITS[stated or unit]
            unit = "" if stated or unit == "s" else unit
        numbers[0] /= scale
        _check_range(place, numbers[:first])
        if numbers[0] < before:
            raise RecordingError(f"{place}: time {numbers[0]:g} s comes before {before:g} s of the line above")
        before = numbers[0]
        values.extend(numbers)
    if not header:
        raise RecordingError(f"{path}: empty; expected a line `time, ...` and a line for each instant")
    return _Table(path, notes, header, np.frombuffer(values).reshape(-1, len(header)), delimiter == ";", unit)


def _read_lines(path: Path, kind: str) -> Iterator[tuple[str, str]]:
    """Yield the place of each line of a CSV file that is not empty, for error messages, and its text.

    Raises:
        RecordingError: If the file cannot be read, is no text in UTF-8, or has a line longer than `MOST_CHARACTERS`.
    """
    with io.TextIOWrapper(open_recorded(path, kind), encoding="utf-8-sig") as file:
        try:
            for number, line in enumerate(iter(lambda: file.readline(MOST_CHARACTERS + 1), ""), start=1):
                place = f"{path}, line {number}"
                if len(line) > MOST_CHARACTERS:
                    raise RecordingError(f"{place}: more than the {MOST_CHARACTERS} characters accepted in a line")
                if line.strip():
                    yield place, line.rstrip("\n")
        except UnicodeDecodeError as error:
            raise RecordingError(f"{path}: not text in UTF-8; expected a CSV file, saved as UTF-8") from error


def _add_note(place: str, line: str, notes: dict[str, str]) -> None:
    """Add the key and the value of a line `# key = value` to the notes; other lines are comments."""
    key, separator, value = (part.strip() for part in line[1:].partition("="))
    if not separator or not _KEY.fullmatch(key):
        return
    if key in notes:
        raise RecordingError(f"{place}: `# {key} = ` stands twice; expected one value")
    if len(notes) >= _MOST_KEYS:
        raise RecordingError(f"{place}: more than the {_MOST_KEYS} keys accepted")
    notes[key] = value


def _read_header(place: str, cells: list[str], separator: str, columns: str) -> tuple[list[str], str]:
    """Return the names of the columns in lower case: time, optional ones, and texels; and the stated unit of time."""
    header = [
        _SENSOR_UNIT.sub(r"\1\2", name) if _SENSOR_UNIT.fullmatch(name) else name for name in map(str.lower, cells)
    ]
    time = _TIME.fullmatch(header[0])
    header[0] = "time" if time else header[0]
    between = header[1 : _find_first_texel(header)]
    if time is None or not set(between) <= set(_SENSOR_COLUMNS) or len(set(header)) != len(header):
        raise RecordingError(
            f"{place}: {len(cells)} columns between {separator}, {', '.join(cells)[:40]!r}...; expected, between "
            f"commas, semicolons (with decimal commas) or tabs, {columns}"
        )
    return header, time[1] or ""


def _find_first_texel(header: list[str]) -> int:
    """Return the index of the first column that holds counts, after the time and the optional columns."""
    return 1 + sum(name in header for name in _SENSOR_COLUMNS)


def _choose_columns(table: _Table, axis: str | None) -> list[int]:
    """Return the indices of the columns with counts: all texels, or one axis of each.

    Raises:
        RecordingError: If the file holds three axes per texel and none is named, or one is named and there are none, or
            if a column has another unit than the others.
    """
    first = _find_first_texel(table.header)
    units = [unit[1] if (unit := _UNIT.search(name)) else "" for name in table.header[first:]]
    if 1 < len(set(units)) < len(units):
        odd = table.header[first + units.index(min(units, key=units.count))]
        raise RecordingError(
            f"{table.path}: the column {odd!r} has another unit than those beside it and is no texel; name a force "
            "`force [N]`, a temperature `temperature [degC]`, put them after the time, and leave other columns out"
        )
    found = [_AXIS.fullmatch(name) for name in table.header[first:]]
    axes = [match["axis"] if match else "" for match in found]
    texels: dict[tuple[str, str], set[str]] = {}
    for match in filter(None, found):
        texels.setdefault((match["before"], match["after"]), set()).add(match["axis"])
    spatial = bool(axes) and all(axes) and all(len(each) == _AXES for each in texels.values())
    axis = axis or (table.notes.get("axis") if spatial else None)
    if (axis is None and not spatial) or (spatial and axis in axes):
        return [first + number for number, each in enumerate(axes) if not spatial or each == axis]
    seen = f"{len(texels)} texels with three axes" if spatial else "one column per texel"
    remedy = "name the normal one: `# axis = z` before the first line, or `softcover import --axis z`"
    remedy = remedy if spatial else "leave the axis out"
    raise RecordingError(
        f"{table.path}: {seen} ({', '.join(table.header[first : first + _AXES])}, ...) and axis = {axis}; {remedy}"
    )


def _read_numbers(place: str, cells: list[str], header: list[str], *, comma: bool = False) -> list[float]:
    """Parse and check the numbers of one line below the header.

    Raises:
        RecordingError: If the number of columns differs from the header, or a text is not a finite number.
    """
    if len(cells) != len(header):
        raise RecordingError(f"{place}: {len(cells)} columns; expected {len(header)} as in the first line")
    try:
        values = [_parse_number(cell, comma=comma) for cell in cells]
    except ValueError as error:
        raise RecordingError(f"{place}: not a number: {str(error)[:80]}") from None
    if not all(map(math.isfinite, values)):
        raise RecordingError(f"{place}: all numbers must be finite")
    return values


def _check_range(place: str, values: list[float]) -> None:
    """Refuse times, forces and temperatures that no sensor gives."""
    if max(map(abs, values)) > _LARGEST:
        raise RecordingError(f"{place}: times, forces and temperatures must lie within {_LARGEST:g}")


def _parse_number(text: str, *, comma: bool = False) -> float:
    """Convert text to a number, with a decimal comma if told; underscores, which `float` skips, are refused."""
    return float((text.replace(".", "x").replace(",", ".") if comma and "," in text else text).replace("_", "x"))


def _round_counts(path: Path, values: FloatArray) -> tuple[CountArray, dict[str, str]]:
    """Round values to whole counts.

    Returns:
        The counts, shape (frames, n) [-]; and a label that states the largest change, empty if there is none.

    Raises:
        RecordingError: If rounding would change a value by more than 1 % of the largest value, so that the values are
            no counts.
    """
    counts = np.rint(values)
    change, largest = float(np.abs(counts - values).max(initial=0)), float(np.abs(values).max(initial=0))
    if change > _MOST_ROUNDED * largest:
        raise RecordingError(
            f"{path}: values up to {largest:.4g} with fractions are no counts: rounding would change them by up to "
            f"{change:.2g}; multiply them by a factor, so that they are counts, and state it as `# factor = ...`"
        )
    return counts.astype(np.int32), {_ROUNDED: f"by at most {change:.3g}"} if change else {}


def _find_shape(
    table: _Table, rows: int | None, columns: int | None, sensor: TexelArray | None, *, texels: int
) -> tuple[int, int]:
    """Return the numbers of rows and columns of the array.

    Arguments take precedence over the lines `# key = value` of the file, and these over the array of the sensor.  If
    only one of the two numbers is known, the other one follows from the number of texels.
    """
    rows = rows or int(table.read_note("rows", 1, MOST_TEXELS, whole=True) or 0)
    columns = columns or int(table.read_note("columns", 1, MOST_TEXELS, whole=True) or 0)
    if sensor is not None and not rows and not columns:
        rows, columns = sensor.rows, sensor.columns
    rows, columns = rows or texels // (columns or texels + 1), columns or texels // (rows or texels + 1)
    if not 1 <= texels <= MOST_TEXELS or rows < 1 or rows * columns != texels:
        side = next(each for each in range(math.isqrt(texels) or 1, 0, -1) if texels % each == 0)
        layout = f"are not {rows} rows x {columns} columns" if rows else "in an unknown number of rows and columns"
        raise RecordingError(
            f"{table.path}: {texels} texels {layout}; write for example `# rows = {texels // side}` and `# columns = "
            f"{side}` before the first line, or give --rows and --columns; each missing texel of a rectangle needs a "
            "column of zeros"
        )
    return rows, columns
