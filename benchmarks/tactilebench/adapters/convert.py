"""Convert what Genesis, Newton, Isaac Lab or FlexiTac report to the CSV file that `python -m tactilebench score` reads.

    python benchmarks/tactilebench/adapters/convert.py contacts FILE.csv > mine.csv
    python benchmarks/tactilebench/adapters/convert.py taxels FILE.json > mine.csv

`contacts` (Genesis: positions and forces of `get_contacts`; Newton: points and forces of its contacts) is CSV with the
columns case,x,y,z,fx,fy,fz and perhaps instant: points [m] and forces on the cover [N] in the frame of the array, one
row per contact.  Each force goes to the texel below its point, flat arrays only; a case without contacts has one row of
zeros.  `taxels` (Isaac Lab: `tactile_normal_force` of its TacSL sensor, or a force matrix; FlexiTac) is JSON, an object
from the name of a case to its forces: [row][column], with a motion [instant][row][column], row 0 at the smallest y;
each a normal force, positive under pressure, or the three components of the force on the texel [N].  Isaac Lab lists
its points along the mesh's second axis fastest: transpose forces of a mesh whose axes are x and y of the array.

These forms are documented here; no file of these programs was at hand when this reader was written.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from bodies import FloatArray, sum_on_texels

from tactilebench import BenchError, Case, cases
from tactilebench.__main__ import show

COLUMNS = ("case", "x", "y", "z", "fx", "fy", "fz")


def read_contacts(path: Path, known: dict[str, Case]) -> dict[str, FloatArray]:
    """Read contacts, and return the forces on texels by the name of the case, each of the shape (t, n) [N].

    Raises:
        BenchError: If a column is missing, or a case or instant is unknown, a cover curved, or a number not finite.
    """
    rows = csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines())
    if missing := [name for name in COLUMNS if name not in (rows.fieldnames or ())]:
        raise BenchError(f"{path}: no column {missing[0]!r}; the columns are {','.join(COLUMNS)}")
    found: dict[str, FloatArray] = {}
    for row in rows:
        place = f"{path}:{rows.line_num}"
        if None in row:
            raise BenchError(f"{place} has more entries than the header; write decimals with a point, not a comma")
        case = find_case(place, row["case"], known)
        if case.cover.geometry:
            raise BenchError(f"{place}: {case.name} has a curved cover; give its forces by texel, with `taxels`")
        try:
            numbers, instant = np.array([float(row[name]) for name in COLUMNS[1:]]), int(row.get("instant") or 0)
        except (ValueError, TypeError):
            raise BenchError(f"{place}: {', '.join(COLUMNS[1:])} must be numbers, instant a whole number") from None
        if not (np.isfinite(numbers).all() and 0 <= instant < len(case.loads)):
            raise BenchError(f"{place}: numbers must be finite, instant from 0 to {len(case.loads) - 1}")
        forces = found.setdefault(case.name, np.zeros((len(case.loads), len(case.centres))))
        forces[instant] += sum_on_texels(case, numbers[None, :2], -numbers[5:])
    return found


def read_taxels(path: Path, known: dict[str, Case]) -> dict[str, FloatArray]:
    """Read forces by row and column, and return them by the name of the case, each of the shape (t, n) [N].

    Raises:
        BenchError: If the file is no JSON object, a case is unknown, or its forces have another shape or no numbers.
    """
    try:
        read = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=collect)
    except (ValueError, RecursionError) as error:
        raise BenchError(f"{path}: is no JSON of forces: {error}") from None
    if not isinstance(read, dict):
        raise BenchError(f"{path}: must be an object from names of cases to forces, not {type(read).__name__}")
    found = {}
    for name, given in read.items():
        case = find_case(str(path), name, known)
        shape = (*case.shape[:-1], case.rows, len(case.centres) // case.rows)
        try:
            forces = np.array(given, dtype=np.float64)
        except (ValueError, TypeError):
            forces = np.full(0, np.nan)
        if forces.shape not in {shape, (*shape, 3)} or not np.isfinite(forces).all():
            raise BenchError(f"{path}: {name}: forces must be finite numbers of shape {shape} or {(*shape, 3)}")
        if forces.shape != shape:
            forces = -np.einsum("...nc,nc->...n", forces.reshape(*case.shape, 3), case.normals)
        found[name] = forces.reshape(len(case.loads), -1)
    return found


def collect(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the entries of a JSON object; raise a ValueError if one is listed twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a case is listed twice; keep one of its entries")
    return found


#: Readers of the two forms.
READERS = {"contacts": read_contacts, "taxels": read_taxels}


def find_case(place: str, name: str, known: dict[str, Case]) -> Case:
    """Return the case of a name; raise a BenchError that states the place if there is none."""
    if name not in known:
        raise BenchError(f"{place}: case {name!r} is unknown here; `python -m tactilebench cases` lists the cases")
    return known[name]


def write(forces: dict[str, FloatArray], version: str) -> Iterator[str]:
    """Yield the lines of a file of forces."""
    yield f"# tactilebench {version}"
    yield "case,instant,texel,force_n"
    for name, instants in forces.items():
        for k, values in enumerate(instants):
            yield from (f"{name},{k},{texel},{value:.6g}" for texel, value in enumerate(values))


def main() -> int:
    """Convert a file, and return the exit status: 2 after a line about bad input, else 0."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("form", choices=READERS)
    parser.add_argument("file", type=Path)
    parser.add_argument("--seed", type=int, help="fresh cases of this seed")
    given = parser.parse_args()
    try:
        known = {case.name: case for case in cases(seed=given.seed)}
        forces = READERS[given.form](given.file, known)
        if not forces:
            raise BenchError(f"{given.file}: holds no case; see the form in the first lines of this script")  # noqa: TRY301
    except (BenchError, OSError, UnicodeDecodeError, csv.Error) as error:
        text = f"{given.file}: cannot be read: {error}" if not isinstance(error, BenchError) else error
        print(f"convert.py: {text}", file=sys.stderr)
        return 2
    return show("\n".join(write(forces, next(iter(known.values())).version)))


if __name__ == "__main__":
    sys.exit(main())
