"""Making of a sensor's texels from the table `[array]` of its sensor file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes import TexelArray
from meshes.array import MOST_TEXELS, check_texel_count
from meshes.bounded_file import FileLimitError, read_text
from validation.errors import InputError
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


def build_array(table: ArrayTable, *, name: str, source: Path) -> TexelArray:
    """Make the texels that the table `[array]` of a sensor file describes.

    Args:
        table: The table `[array]`.
        name: Name of the array if the table has none.
        source: Path of the sensor file; the path `positions` in the table is relative to its folder.

    Raises:
        InputError: If the mask or the positions do not match rows x columns, or texels overlap.
    """
    try:
        array = _build_texels(table, name=table.name or name, folder=source.parent)
        if array.planar:
            _refuse_overlap(array)
    except InputError as error:
        raise InputError(*(f"{source}: {fault}" for fault in error.faults)) from None
    except ValueError as error:
        raise InputError(f"{source}: array: {error}") from None
    return array


def _build_texels(table: ArrayTable, *, name: str, folder: Path) -> TexelArray:
    if table.positions is not None:
        return _build_from_positions(table, folder / table.positions, name=name)
    if table.rows is None or table.columns is None or table.pitch is None:
        raise InputError('array: give rows, columns and pitch, or positions = "texels.csv" for any layout')
    check_texel_count(table.rows, table.columns)
    active = _read_mask(table, table.rows, table.columns)
    return TexelArray.grid(
        table.rows, table.columns, table.pitch, texel_size=table.texel_size, active=active, name=name
    )


def _build_from_positions(table: ArrayTable, path: Path, *, name: str) -> TexelArray:
    """Make texels at the positions that a CSV file lists.

    If the table has no rows and columns, the tactile image is one row of texels in the order of the list.

    Args:
        table: The table `[array]`.
        path: Path of the CSV file.
        name: Name of the array.

    Raises:
        InputError: If the file is damaged, or the number of texels is not rows x columns.
    """
    if (table.rows is None) != (table.columns is None):
        raise InputError("array: give both rows and columns, or leave both out: the image is then one row of texels")
    centres, normals = _read_positions(path, table.unit or 1.0)
    rows, columns = table.rows or 1, table.columns or len(centres)
    if rows * columns != len(centres):
        raise InputError(
            f"array.positions: {path} holds {len(centres)} texels, rows x columns is {rows * columns}; {_EXAMPLE}"
        )
    alone = table.texel_size if len(centres) == 1 else None
    pitch = table.pitch or alone or _smallest_spacing(centres, normals)
    active = _read_mask(table, rows, columns)
    return TexelArray(
        centres=centres,
        normals=normals,
        texel_size=table.texel_size or pitch,
        pitch=pitch,
        rows=rows,
        columns=columns,
        active=np.ones(len(centres), dtype=bool) if active is None else active.ravel(),
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
        first, second = (int(np.flatnonzero(array.active)[k]) for k in pair)
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
    lines = table.mask
    if len(lines) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in lines):
        example = "0" + "1" * (columns - 1)
        raise InputError(
            f"array.mask: must have {rows} rows of {columns} entries 0 or 1, "
            f"row 0 (smallest y) first; write for example '{example}' for one row"
        )
    return np.array([[entry == "1" for entry in line] for line in lines])


def _read_positions(path: Path, unit: float) -> tuple[FloatArray, FloatArray]:
    """Read the positions of n texels from a CSV file.

    Args:
        path: The file.
        unit: Length of one unit of its coordinates [m].

    Returns:
        Centres of the texels, shape (n, 3) [m], and their unit normals, shape (n, 3) [-].

    Raises:
        InputError: If the file does not exist, has other columns, or holds too many texels or text that is no number.
            The message repeats nothing of the file: a sensor file from somebody else may name any file.
    """
    if not path.is_file():
        raise InputError(f"array.positions: no such file: {path}; {_EXAMPLE}")
    try:
        text = read_text(path, most=_MOST_BYTES)
        lines = [line.split(",") for line in text.splitlines() if line.strip()]
    except FileLimitError as error:
        raise InputError(f"array.positions: {path} {error}; {_EXAMPLE}") from None
    header = tuple(entry.strip() for entry in lines[0]) if lines else ()
    if header not in (_COLUMNS[:3], _COLUMNS):
        raise InputError(f"array.positions: {path} begins with another line; {_EXAMPLE}")
    if not 1 <= len(lines) - 1 <= MOST_TEXELS:
        raise InputError(
            f"array.positions: {path} holds {len(lines) - 1} texels; 1..{MOST_TEXELS} are supported; {_EXAMPLE}"
        )
    numbers = np.array([_read_numbers(line, len(header), path, k) for k, line in enumerate(lines[1:], start=1)])
    normals = numbers[:, 3:] if len(header) > 3 else np.tile([0.0, 0.0, 1.0], (len(numbers), 1))  # noqa: PLR2004 -- x, y, z
    centres = unit * numbers[:, :3]
    far = np.flatnonzero(np.abs(centres).max(axis=1) > _FARTHEST)
    if len(far):
        raise InputError(
            f"array.positions: {path}: texel {far[0]} is farther than {_FARTHEST:g} m from the origin; state the unit "
            'of the file, for example unit = "mm"'
        )
    return centres, normals.copy()


def _read_numbers(entries: list[str], count: int, path: Path, texel: int) -> list[float]:
    """Read the numbers of one texel; raise an `InputError` if they are not `count` finite numbers."""
    try:
        numbers = [float(entry) for entry in entries]
    except ValueError:
        numbers = []
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise InputError(f"array.positions: {path}: texel {texel} is not {count} numbers; {_EXAMPLE}")
    return numbers
