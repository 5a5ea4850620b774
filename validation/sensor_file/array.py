"""Making of a sensor's texels from the table `[array]` of its sensor file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from meshes.array import MOST_TEXELS, check_texel_count
from meshes.bounded_file import FileLimitError, read_text
from validation.errors import InputError, at
from validation.schema.sensor import ArrayTable

FloatArray = npt.NDArray[np.float64]

#: Largest accepted size of a file of texel positions [bytes]: 200 for each texel.
_MOST_BYTES = 200 * MOST_TEXELS
#: Columns of a file of texel positions: centres of the texels [m], and their unit normals [-] if the array is curved.
_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
#: Largest accepted coordinate of a texel; larger ones must have a wrong unit [m].
_FARTHEST = 1000.0
#: Largest difference between the heights of texels of one plane [m].
_SAME_HEIGHT = 1e-9
_EXAMPLE = "the first line must read x,y,z or x,y,z,nx,ny,nz, then one line of numbers in metres per texel"


def build_array(table: ArrayTable, *, name: str, folder: Path) -> TexelArray:
    """Make the texels that the table `[array]` of a sensor file describes.

    Args:
        table: The table `[array]`.
        name: Name of the array if the table has none.
        folder: Folder of the sensor file; the path `positions` in the table is relative to it.

    Raises:
        InputError: If the mask or the positions do not match rows x columns, or texels overlap.
    """
    array = _build_texels(table, table.name or name, folder)
    if array.planar:
        _refuse_overlap(array)
    return array


def _build_texels(table: ArrayTable, name: str, folder: Path) -> TexelArray:
    """Make the texels of a grid, or those at the positions that a CSV file lists.

    If a table with positions has no rows and columns, the tactile image is one row of texels in the order of the list.
    """
    if table.positions is None:
        rows, columns, pitch = table.rows or 0, table.columns or 0, table.pitch or (0.0, 0.0)  # required by the schema
        with at("array: "):
            check_texel_count(rows, columns)
        active = _read_mask(table, rows, columns)
        with at("array: "):
            return TexelArray.grid(rows, columns, pitch, texel_size=table.texel_size, active=active, name=name)
    path = folder / table.positions
    if not path.is_file():
        raise InputError(f"array.positions: no such file: {path}; {_EXAMPLE}")
    with at(f"array.positions: {path}"):
        centres, normals = _read_positions(path, table.unit or 1.0)
    count = len(centres)
    rows, columns = table.rows or 1, table.columns or count
    if rows * columns != count:
        raise InputError(
            f"array.positions: {path} holds {count} texels, rows x columns is {rows * columns}; {_EXAMPLE}"
        )
    pitch = table.pitch or (table.texel_size if count == 1 else None) or _smallest_spacing(centres, normals)
    active = _read_mask(table, rows, columns)
    with at("array: "):
        return TexelArray(
            centres=centres,
            normals=normals,
            texel_size=table.texel_size or pitch,
            pitch=pitch,
            rows=rows,
            columns=columns,
            active=np.ones(count, dtype=bool) if active is None else active.ravel(),
            name=name,
        )


def _smallest_spacing(centres: FloatArray, normals: FloatArray) -> tuple[float, float]:
    """Compute the largest edge length of equal squares, one centred on each texel, that do not overlap.

    For a flat array this is the smallest distance between the centres of two texels, in the maximum norm of x and y.
    The texels of a curved array have no common x and y; there the Euclidean distance is used, which is at least as
    large.

    Args:
        centres: Centres of the n texels, shape (n, 3) [m].
        normals: Unit normals of the texels, shape (n, 3) [-].

    Returns:
        The edge length, twice: along x and along y [m].

    Raises:
        InputError: If there is only one texel, or two texels have the same centre.
    """
    from scipy.spatial import cKDTree

    if len(centres) < 2:  # noqa: PLR2004 -- a distance needs two texels
        raise InputError('array.texel_size: is missing, and one texel has no neighbour; write texel_size = "2 mm"')
    flat = bool(np.allclose(normals, [0, 0, 1]) and np.ptp(centres[:, 2]) < _SAME_HEIGHT)
    places, norm = (centres[:, :2], np.inf) if flat else (centres, 2.0)
    distance = float(np.asarray(cKDTree(places).query(places, k=2, p=norm)[0])[:, 1].min())
    if not distance > 0:
        raise InputError("array.positions: two texels have the same centre; every texel needs its own")
    return (distance, distance)


def _refuse_overlap(array: TexelArray) -> None:
    """Refuse active texels that overlap, because force on the common area would count twice.

    Raises:
        InputError: If two active texels overlap.
    """
    from scipy.spatial import cKDTree

    places = array.centres[array.active, :2] / np.array(array.texel_size)
    if len(places) < 2:  # noqa: PLR2004 -- an overlap needs two texels
        return
    # Only the nearest neighbours are listed: the pairs of ten thousand texels in one place would fill the memory.
    distances, neighbours = (np.asarray(each)[:, 1] for each in cKDTree(places).query(places, k=2, p=np.inf))
    near = np.flatnonzero(distances < 1 - 1e-6)
    if len(near):
        pair = sorted((int(near[0]), int(neighbours[near[0]])))
        first, second = np.flatnonzero(array.active)[pair].tolist()
        x, y = (f"{1e3 * edge:.4g} mm" for edge in array.texel_size)
        raise InputError(
            f"array: texels {first} and {second} overlap, each {x} by {y}; "
            "write a smaller array.texel_size, or move them further apart"
        )


def _read_mask(table: ArrayTable, rows: int, columns: int) -> npt.NDArray[np.bool_] | None:
    """Read the mask of the table `[array]`.

    Returns:
        Whether each texel measures, shape (rows, columns); None if the table has no mask, so that all texels measure.

    Raises:
        InputError: If the mask does not have `rows` lines of `columns` entries 0 or 1.
    """
    if table.mask is None:
        return None
    if len(table.mask) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in table.mask):
        example = "0" + "1" * (columns - 1)
        raise InputError(
            f"array.mask: must have {rows} rows of {columns} entries 0 or 1, "
            f"row 0 (smallest y) first; write for example '{example}' for one row"
        )
    return np.asarray(np.array(table.mask) == "1")


def _read_positions(path: Path, unit: float) -> tuple[FloatArray, FloatArray]:
    """Read the positions of n texels from a CSV file.

    Args:
        path: The file.
        unit: Length of one unit of its coordinates [m].

    Returns:
        Centres of the texels, shape (n, 3) [m], and their unit normals, shape (n, 3) [-].

    Raises:
        InputError: If the file has other columns, or holds too many texels or text that is no number.
            The message repeats nothing of the file: a sensor file from somebody else may name any file.
    """
    try:
        text = read_text(path, most=_MOST_BYTES)
    except FileLimitError as error:
        raise InputError(f" {error}; {_EXAMPLE}") from None
    first, *lines = [line.split(",") for line in text.splitlines() if line.strip()] or [[]]
    width = len(first)
    if tuple(entry.strip() for entry in first) not in (_COLUMNS[:3], _COLUMNS):
        raise InputError(f" begins with another line; {_EXAMPLE}")
    if not 1 <= len(lines) <= MOST_TEXELS:
        raise InputError(f" holds {len(lines)} texels; 1..{MOST_TEXELS} are supported; {_EXAMPLE}")
    numbers = np.full((len(lines), width), np.nan)
    for number, line in enumerate(lines):
        try:
            numbers[number] = [float(entry) for entry in line]
        except ValueError:  # no number, or too few or many
            numbers[number] = np.nan
        if not np.isfinite(numbers[number]).all() or len(line) != width:
            raise InputError(f": texel {number + 1} is not {width} numbers; {_EXAMPLE}")
    centres = unit * numbers[:, :3]
    far = np.flatnonzero(np.abs(centres).max(axis=1) > _FARTHEST)
    if len(far):
        raise InputError(
            f": texel {far[0]} is farther than {_FARTHEST:g} m from the origin; state the unit of the file, for "
            'example unit = "mm"'
        )
    normals = numbers[:, 3:].copy() if width > 3 else np.tile([0.0, 0.0, 1.0], (len(numbers), 1))  # noqa: PLR2004 -- x, y, z
    return centres, normals
