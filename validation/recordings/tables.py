"""Reads and writes recordings as CSV files with one line per frame.

The header line names the columns: `time` [s], then optionally `force` [N] and `temperature` [degC], then one column per
texel, row by row, x fastest.  Lines of the form `# key = value` before the header may give `rows`, `columns`, `pitch`
[m], `full_scale`, `indenter`, `load` [N] and `note`.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from meshes import atomic_file
from validation.recordings.recording import (
    DEFAULT_FULL_SCALE,
    DEFAULT_PITCH,
    FloatArray,
    Recording,
    RecordingError,
    Setup,
    hash_contents,
    make_array,
)

#: Accepted keys of the lines `# key = value` of a CSV file; lines with other keys are comments.
_KEYS = frozenset({"rows", "columns", "pitch", "full_scale", "indenter", "load", "note"})
#: Names of the optional columns of a CSV file between the time and the texels.
_SENSOR_COLUMNS = ("force", "temperature")


@dataclass(frozen=True)
class _Table:
    """Content of the CSV file of a recording or of a force sensor.

    Attributes:
        notes: Values of the lines `# key = value`, by key.
        header: Names of the columns, in lower case.
        values: Numbers in the lines below the header, shape (lines, columns).
    """

    notes: Mapping[str, str]
    header: list[str]
    values: FloatArray

    def get_column(self, name: str) -> FloatArray:
        """Return the numbers of the column with this name, shape (lines,); shape (0,) if the column is missing."""
        return self.values[:, self.header.index(name)] if name in self.header else np.empty(0)


def read(path: str | Path, *, rows: int | None = None, columns: int | None = None) -> Recording:
    """Read a recording from a CSV file.

    Args:
        path: The CSV file.
        rows: Number of texels along y; taken from the file if not given [-].
        columns: Number of texels along x; taken from the file if not given [-].

    Raises:
        RecordingError: If the file cannot be read; the message names the line.
    """
    path = Path(path)
    table = _read_table(path)
    if not len(table.values):
        raise RecordingError(f"{path}: no frames; expected at least one line of numbers")
    counts = table.values[:, _find_first_texel(table.header) :].astype(np.int32)
    stamps, temperatures, forces = (table.get_column(name) for name in ("time", "temperature", "force"))
    times = stamps - stamps[0]
    pitch = _read_number(path, table.notes, "pitch", DEFAULT_PITCH)
    digest = hash_contents(path)
    return Recording(
        path=path,
        sha256=digest,
        started=datetime.fromtimestamp(max(0.0, stamps[0]), UTC),
        times=times,
        arrays=(
            make_array(
                *_find_shape(path, table.notes, rows, columns, texels=counts.shape[1]),
                counts,
                pitch=(pitch, pitch),
                full_scale=int(_read_number(path, table.notes, "full_scale", DEFAULT_FULL_SCALE)),
            ),
        ),
        temperatures=temperatures.reshape(-1, 1) if temperatures.size else np.empty((0, 0)),
        temperature_times=times[: len(temperatures)],
        setup=Setup(
            indenter=table.notes.get("indenter", ""),
            load=_read_number(path, table.notes, "load", 0.0) if "load" in table.notes else None,
            note=table.notes.get("note", ""),
            source=path.name,
            source_sha256=digest,
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


def write(recording: Recording, path: str | Path, *, array: int = 0) -> None:
    """Write one array of a recording as a CSV file that `read` reads.

    Args:
        recording: The recording.
        path: The file to write; an existing file is replaced.
        array: Index of the array in the recording.

    Raises:
        OSError: If the file cannot be written; an existing file then remains.
    """
    recorded = recording.arrays[array]
    texels, setup = recorded.texels, recording.setup
    notes = {
        "rows": texels.rows,
        "columns": texels.columns,
        "pitch": texels.pitch[0],
        "full_scale": recorded.full_scale,
        "indenter": setup.indenter,
        "load": "" if setup.load is None else setup.load,
        "note": " ".join(setup.note.split()),
    }
    start = recording.started.timestamp()
    text = io.StringIO()
    text.writelines(f"# {key} = {value}\n" for key, value in notes.items() if value != "")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *(f"texel_{number}" for number in range(texels.count))])
    for time, counts in zip(recording.times, recorded.counts, strict=True):
        writer.writerow([f"{start + time:.6f}", *counts.tolist()])
    atomic_file.replace(Path(path), [text.getvalue().encode()])


def _read_table(path: Path) -> _Table:
    """Read the lines `# key = value`, the header line and the numbers of a CSV file."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise RecordingError(f"{path}: {reason}; expected a CSV file") from error
    notes: dict[str, str] = {}
    header: list[str] = []
    lines: list[tuple[str, list[str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("#"):
            key, _, value = (part.strip() for part in line[1:].partition("="))
            if key in _KEYS:
                notes[key] = value
        elif line.strip():
            place = f"{path}, line {number}"
            cells = [cell.strip() for cell in next(csv.reader([line]))]
            if header:
                lines.append((place, cells))
            else:
                header = [cell.lower() for cell in cells]
                _check_header(place, header)
    if not header:
        raise RecordingError(f"{path}: empty; expected a line `time, ...` and one line per frame")
    values = np.array(list(_read_lines(header, lines))).reshape(-1, len(header))
    return _Table(notes, header, values)


def _find_first_texel(header: list[str]) -> int:
    """Return the index of the first column that holds counts, after the time and the optional columns."""
    return 1 + sum(name in header for name in _SENSOR_COLUMNS)


def _check_header(place: str, header: list[str]) -> None:
    between = header[1 : _find_first_texel(header)]
    if header[0] != "time" or any(name not in _SENSOR_COLUMNS for name in between) or len(set(header)) != len(header):
        raise RecordingError(
            f"{place}: expected the columns `time`, optionally `force` and `temperature`, and then one column per "
            f"texel, each with a name of its own"
        )


def _read_lines(header: list[str], lines: list[tuple[str, list[str]]]) -> Iterator[FloatArray]:
    """Parse and check the numbers of each line.

    Args:
        header: Names of the columns.
        lines: Place of each line for error messages, and the texts of its columns.

    Yields:
        Numbers of one line, shape (columns,).

    Raises:
        RecordingError: If a line has another number of columns than the header, a text is not a finite number, a count
            is not a whole number of 0 or more, or a time is smaller than the time before.
    """
    first = _find_first_texel(header)
    before = -math.inf
    for place, cells in lines:
        if len(cells) != len(header):
            raise RecordingError(f"{place}: {len(cells)} columns; expected {len(header)} as in the first line")
        try:
            values = np.array([float(cell) for cell in cells])
        except ValueError as error:
            raise RecordingError(f"{place}: not a number: {error}") from error
        counts = values[first:]
        if not np.isfinite(values).all() or (counts != np.round(counts)).any() or (counts < 0).any():
            raise RecordingError(f"{place}: counts must be whole numbers of 0 or more, and all numbers finite")
        if values[0] < before:
            raise RecordingError(f"{place}: time {values[0]:g} s comes before {before:g} s of the line above")
        before = values[0]
        yield values


def _find_shape(
    path: Path, notes: Mapping[str, str], rows: int | None, columns: int | None, *, texels: int
) -> tuple[int, int]:
    """Return the numbers of rows and columns of the array.

    Arguments take precedence over the lines `# key = value` of the file.  If only one of the two numbers is known, the
    other follows from the number of texels.
    """
    rows = int(_read_number(path, notes, "rows", 0)) if rows is None else rows
    columns = int(_read_number(path, notes, "columns", 0)) if columns is None else columns
    if rows and not columns:
        columns = texels // rows
    if columns and not rows:
        rows = texels // columns
    if not texels or rows * columns != texels:
        raise RecordingError(
            f"{path}: {texels} texels are not {rows} rows x {columns} columns; "
            f"name both, or write `# rows = 14` and `# columns = 6` before the first line"
        )
    return rows, columns


def _read_number(path: Path, notes: Mapping[str, str], key: str, default: float) -> float:
    """Return the value of the line `# key = value` of a file, a number of 0 or more; `default` if there is no line."""
    try:
        value = float(notes.get(key, default))
    except ValueError as error:
        raise RecordingError(f"{path}: # {key} = {notes[key]}: not a number; expected 0 or more") from error
    if not math.isfinite(value) or value < 0:
        raise RecordingError(f"{path}: # {key} = {notes[key]}: expected a number of 0 or more")
    return value
