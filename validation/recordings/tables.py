"""Recordings as CSV: one line per frame.

The first line names the columns: `time` [s], then optionally `force` [N] and `temperature` [degC], then one column per
texel, row-major, x fastest.  Lines `# key = value` before it may say `rows`, `columns`, `pitch` [m], `full_scale`,
`indenter`, `load` [N] and `note`.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from validation.recordings.labels import LabelledRecording, Setup, plain_array
from validation.recordings.recording import FloatArray, RecordingError

_KEYS = frozenset({"rows", "columns", "pitch", "full_scale", "indenter", "load", "note"})
_SIDE = ("force", "temperature")
_MOST_FRAMES = 10_000_000


def read(path: str | Path, *, rows: int | None = None, columns: int | None = None) -> LabelledRecording:
    """Read a CSV file.

    Args:
        path: The file.
        rows: Texels along y, where the file does not say so [-].
        columns: Texels along x, where the file does not say so [-].

    Raises:
        RecordingError: If it cannot be read; the message names the line.
    """
    place = Path(path)
    text = _text(place)
    notes, header, lines = _split(place, text)
    table = np.array(list(_numbers(place, header, lines)))
    if not len(table):
        raise RecordingError(f"{place}: no frames; expected at least one line of numbers")
    first = 1 + sum(name in header for name in _SIDE)
    shape = _shape(place, notes, rows, columns, texels=len(header) - first)
    times = table[:, 0] - table[0, 0]
    side = {name: table[:, header.index(name)] if name in header else np.empty(0) for name in _SIDE}
    unknown = np.zeros(len(table), dtype=np.int64)
    digest = hashlib.sha256(text.encode()).hexdigest()
    pitch = _number(place, notes, "pitch", 3.4e-3)
    return LabelledRecording(
        path=place,
        sha256=digest,
        serial="",
        started=datetime.fromtimestamp(max(0.0, table[0, 0]), UTC),
        times=times,
        arrays=(
            plain_array(
                *shape,
                table[:, first:].astype(np.int32),
                pitch=(pitch, pitch),
                full_scale=int(_number(place, notes, "full_scale", 4095)),
            ),
        ),
        temperatures=side["temperature"].reshape(-1, 1) if len(side["temperature"]) else np.empty((0, 0)),
        temperature_times=times if len(side["temperature"]) else np.empty(0),
        setup=_setup(place, notes, digest),
        gaps=(),
        complete=True,
        host_monotonic=unknown,
        ticks=unknown,
        forces=side["force"],
        force_times=times if len(side["force"]) else np.empty(0),
    )


def read_forces(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Read a force sensor's own CSV file with the columns `time` [s] and `force` [N].

    Returns:
        Times and forces, shape (readings,).

    Raises:
        RecordingError: If it cannot be read; the message names the line.
    """
    place = Path(path)
    _, header, lines = _split(place, _text(place))
    table = np.array(list(_numbers(place, header, lines)))
    if "force" not in header or not len(table):
        raise RecordingError(f"{place}: no forces; expected the columns `time` and `force` and at least one line")
    return table[:, 0], table[:, header.index("force")]


def _text(place: Path) -> str:
    try:
        return place.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise RecordingError(f"{place}: {reason}; expected a CSV file") from error


def _split(place: Path, text: str) -> tuple[dict[str, str], list[str], list[tuple[int, list[str]]]]:
    """Notes, names of columns and numbered lines."""
    notes: dict[str, str] = {}
    header: list[str] = []
    lines: list[tuple[int, list[str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("#"):
            key, _, value = (part.strip() for part in line[1:].partition("="))
            if key in _KEYS:
                notes[key] = value
        elif line.strip():
            cells = [cell.strip() for cell in next(csv.reader([line]))]
            if header:
                lines.append((number, cells))
            else:
                header = [cell.lower() for cell in cells]
                _check_header(place, number, header)
    if not header:
        raise RecordingError(f"{place}: empty; expected a line `time, ...` and one line per frame")
    return notes, header, lines


def _check_header(place: Path, number: int, header: list[str]) -> None:
    side = header[1 : 1 + sum(name in header for name in _SIDE)]
    if header[0] != "time" or any(name not in _SIDE for name in side) or len(set(header)) != len(header):
        raise RecordingError(
            f"{place}, line {number}: expected the columns `time`, then `force` and `temperature` where there are "
            f"such, then one column per texel, each with its own name"
        )


def _numbers(place: Path, header: list[str], lines: list[tuple[int, list[str]]]) -> Iterator[FloatArray]:
    """The lines as numbers, checked."""
    first = 1 + sum(name in header for name in _SIDE)
    before = -math.inf
    for number, cells in lines[: _MOST_FRAMES + 1]:
        where = f"{place}, line {number}"
        if len(cells) != len(header):
            raise RecordingError(f"{where}: {len(cells)} columns; expected {len(header)} as in the first line")
        try:
            values = np.array([float(cell) for cell in cells])
        except ValueError as error:
            raise RecordingError(f"{where}: not a number: {error}") from error
        counts = values[first:]
        if not np.isfinite(values).all() or (counts != np.round(counts)).any() or (counts < 0).any():
            raise RecordingError(f"{where}: counts must be whole numbers of 0 or more, and all numbers finite")
        if values[0] < before:
            raise RecordingError(f"{where}: time {values[0]:g} s comes before {before:g} s of the line above")
        before = values[0]
        yield values


def _shape(
    place: Path, notes: Mapping[str, str], rows: int | None, columns: int | None, *, texels: int
) -> tuple[int, int]:
    rows = int(_number(place, notes, "rows", 0)) if rows is None else rows
    columns = int(_number(place, notes, "columns", 0)) if columns is None else columns
    if rows and not columns:
        columns = texels // rows
    if columns and not rows:
        rows = texels // columns
    if not texels or rows * columns != texels:
        raise RecordingError(
            f"{place}: {texels} texels are not {rows} rows x {columns} columns; "
            f"name both, or write `# rows = 14` and `# columns = 6` before the first line"
        )
    return rows, columns


def _number(place: Path, notes: Mapping[str, str], key: str, default: float) -> float:
    try:
        value = float(notes.get(key, default))
    except ValueError as error:
        raise RecordingError(f"{place}: # {key} = {notes[key]}: not a number") from error
    if not math.isfinite(value) or value < 0:
        raise RecordingError(f"{place}: # {key} = {notes[key]}: expected a number of 0 or more")
    return value


def _setup(place: Path, notes: Mapping[str, str], digest: str) -> Setup:
    load = _number(place, notes, "load", 0.0) if "load" in notes else None
    return Setup(
        indenter=notes.get("indenter", ""),
        load=load,
        note=notes.get("note", ""),
        source=place.name,
        source_sha256=digest,
    )


def write(recording: LabelledRecording, path: str | Path, *, array: int = 0) -> None:
    """Write one array of a recording as CSV that `read` reads.

    Args:
        recording: The recording.
        path: The file; an old one is replaced.
        array: Which array.
    """
    recorded = recording.arrays[array]
    texels = recorded.texels
    notes = {
        "rows": texels.rows,
        "columns": texels.columns,
        "pitch": texels.pitch[0],
        "full_scale": recorded.full_scale,
        "indenter": recording.setup.indenter,
        "load": "" if recording.setup.load is None else recording.setup.load,
        "note": " ".join(recording.setup.note.split()),
    }
    start = recording.started.timestamp()
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {key} = {value}\n" for key, value in notes.items() if value != "")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *(f"texel_{number}" for number in range(texels.count))])
        for time, counts in zip(recording.times, recorded.counts, strict=True):
            writer.writerow([f"{start + time:.6f}", *counts.tolist()])
