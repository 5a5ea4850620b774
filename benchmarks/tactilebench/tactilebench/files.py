"""Files of forces: CSV with one row per texel, or npz with one array per case; and the empty CSV to fill in."""

from __future__ import annotations

import csv
import math
import re
import reprlib
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from tactilebench.case import BenchError, Case, FloatArray, as_numbers, check_file, read_arrays
from tactilebench.draw import TIERS

#: Largest accepted size of a file, and of the arrays in an npz file [bytes].
LARGEST = 20_000_000
#: Columns of a CSV file; `instant` may be left out for cases without motion.
COLUMNS = ("case", "instant", "texel", "force_n")
#: Value of the column `texel` in a row for the force beyond the texels.
OUTSIDE = "outside"

Forces = dict[str, FloatArray]
N = TypeVar("N", int, float)


def read_forces(path: str | Path, known: Sequence[Case]) -> tuple[Forces, Forces]:
    """Read the forces on the texels, and beyond them where the file states that, by the name of the case [N].

    Cases of other tiers than those of the known cases are left out.

    Raises:
        BenchError: If the file cannot be read, is not whole, or belongs to another version.
    """
    try:
        check_file(path)
        size = Path(path).stat().st_size
        if not 0 < size <= LARGEST:
            raise BenchError(f"{path}: has {size} bytes; write a file with forces, of at most {LARGEST // 10**6} MB")
        read = _read_npz if zipfile.is_zipfile(path) else _read_csv
        return read(Path(path), {case.name: case for case in known})
    except UnicodeDecodeError:
        raise BenchError(f"{path}: is neither text in UTF-8 nor npz; write CSV with {','.join(COLUMNS)}") from None
    except OSError as error:
        raise BenchError(f"{path}: cannot be read: {error.strerror}") from None
    except (zipfile.BadZipFile, csv.Error) as error:
        raise BenchError(f"{path}: cannot be read: {error}") from None


def write_template(known: Sequence[Case]) -> Iterator[str]:
    """Yield the lines of a CSV file in which only the forces are missing."""
    yield f"# tactilebench {known[0].version}"
    yield ",".join(COLUMNS)
    for case in known:
        for k in range(len(case.loads)):
            yield from (f"{case.name},{k},{texel}," for texel in range(case.shape[-1]))


def _read_csv(path: Path, known: dict[str, Case]) -> tuple[Forces, Forces]:
    text = path.read_bytes().decode("utf-8-sig")
    if "\0" in text:
        raise BenchError(f"{path}: is binary; write CSV with the columns {','.join(COLUMNS)}, or npz")
    lines = text.splitlines()
    skipped = 0
    while lines and lines[0].startswith("#"):
        for found in re.findall(r"tactilebench v?(\d[\d.]*\d)", lines.pop(0)):
            _check_version(path, found, next(iter(known.values())).version)
        skipped += 1
    rows = csv.DictReader(lines)
    rows.fieldnames = [str(each).strip() for each in rows.fieldnames or ()]
    if missing := [name for name in COLUMNS if name not in rows.fieldnames and name != "instant"]:
        raise BenchError(f"{path}: no column {missing[0]!r}; the columns are {','.join(COLUMNS)}, with commas between")
    if twice := [name for name in COLUMNS if rows.fieldnames.count(name) > 1]:
        raise BenchError(f"{path}: column {twice[0]!r} is listed twice; keep one of them")
    forces = {name: np.full((len(case.loads), case.shape[-1]), np.nan) for name, case in known.items()}
    outside = {name: np.full(len(case.loads), np.nan) for name, case in known.items()}
    tiers = {case.tier for case in known.values()}
    for row in rows:
        place, name = f"{path}:{rows.line_num + skipped}", (row["case"] or "").strip()
        if None in row:
            raise BenchError(f"{place} has more entries than the header; write decimals with a point, not a comma")
        if name in known:
            _take_row(f"{place}: {name}", row, forces[name], outside[name])
        else:
            _check_tier(place, name, tiers)
    found = []
    for values in (forces, outside):
        stated = {name: each for name, each in values.items() if np.isfinite(each).any()}
        _refuse_holes(path, stated)
        found.append({name: each if known[name].motion else each[0] for name, each in stated.items()})
    return found[0], found[1]


def _take_row(place: str, row: Mapping[str, str], forces: FloatArray, outside: FloatArray) -> None:
    """Put the force of a row where it belongs, into forces (t, n) on the texels or (t,) beyond them."""
    try:
        texel, k, value = row["texel"].strip(), _read(int, row.get("instant") or "0"), _read(float, row["force_n"])
        target, index = (outside, k) if texel == OUTSIDE else (forces[k], _read(int, texel))
        before = target[index]
    except IndexError:
        counts = f"texels 0..{forces.shape[1] - 1} and instants 0..{forces.shape[0] - 1}"
        raise BenchError(f"{place} has {counts}; count from 0") from None
    except (ValueError, TypeError, AttributeError):
        given = ", ".join(f"{name} {reprlib.repr(row[name])}" for name in COLUMNS[1:] if name in row)
        raise BenchError(
            f"{place} has {given}; texel and instant must be whole numbers, force_n a number with a decimal point"
        ) from None
    if min(index, k) < 0 or not math.isfinite(value):
        raise BenchError(
            f"{place}: texel {texel} has force_n {row['force_n']}; it must be finite, and texels count from 0"
        )
    if math.isfinite(before):
        raise BenchError(f"{place} lists texel {texel} twice; keep one of the rows")
    target[index] = value


def _read(kind: type[N], text: str) -> N:
    """Return a text as a number; raise a ValueError for what only Python takes for one, as 1_000."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return kind(text)


def _read_npz(path: Path, known: dict[str, Case]) -> tuple[Forces, Forces]:
    with zipfile.ZipFile(path) as archive:
        if sum(each.file_size for each in archive.infolist()) > LARGEST:
            raise BenchError(f"{path}: its arrays hold more than {LARGEST // 10**6} MB; give one array per case")
        if len(set(archive.namelist())) < len(archive.namelist()):
            raise BenchError(f"{path}: a case is listed twice; keep one of the arrays")
    arrays = read_arrays(path)
    if "version" in arrays:
        found = "".join(map(str, np.ravel(arrays.pop("version"))))
        _check_version(path, found.removeprefix("v"), next(iter(known.values())).version)
    tiers, ends = {case.tier for case in known.values()}, f"/{OUTSIDE}"
    forces: Forces = {}
    outside: Forces = {}
    for key, values in arrays.items():
        name = key.removesuffix(ends)
        if name in known:
            (outside if key.endswith(ends) else forces)[name] = as_numbers(f"{path}: {key}", values)
        else:
            _check_tier(path, name, tiers)
    return forces, outside


def _check_tier(place: str | Path, name: str, tiers: set[str]) -> None:
    """Raise a BenchError if the name of a case that is unknown here is not of another tier."""
    if not (tier := re.match(r"[a-z_]+(?=-\d)", name)) or tier[0] in tiers or tier[0] not in TIERS:
        raise BenchError(
            f"{place}: case {reprlib.repr(name)} is unknown here; `python -m tactilebench cases` lists the cases"
        )


def _check_version(path: Path, found: str, version: str) -> None:
    """Raise a BenchError if a file was written for another version of the benchmark."""
    if found != version:
        raise BenchError(f"{path}: was written for version {found}, not {version}; compute the cases of {version}")


def _refuse_holes(path: Path, forces: Forces) -> None:
    """Raise a BenchError if a value of a case is missing."""
    for name, values in forces.items():
        if (holes := np.argwhere(np.isnan(values))).size:
            raise BenchError(
                f"{path}: {name} lacks {len(holes)} of {values.size} values, the first at instant {holes[0][0]}"
                f"{f', texel {holes[0][1]}' if values.ndim > 1 else ' outside'}; add them"
            )
