"""Reading of surfaces of triangles and of tetrahedral meshes from files of other programs.

Surfaces: STL, OBJ and PLY files; `.npy` files of points on a grid, shape (rows, columns, 3), where points that are no
numbers, or at the origin, are missing; and `.tet` files, of which the boundary is taken.  None of them states its unit.
"""

from __future__ import annotations

import io
import logging
from pathlib import Path
from typing import Any

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.bounded_file import FileLimitError, read_bytes
from meshes.npz import unpack_npy

#: Endings of the names of files with surfaces, and with tetrahedra.
SURFACES, TETRAHEDRA = (".stl", ".obj", ".ply", ".npy", ".tet"), (".tet",)
#: Largest accepted size of a file [bytes], and numbers of triangles and of tetrahedra [-].
_MOST_BYTES, _MOST_TRIANGLES, _MOST_TETRAHEDRA = 2**27, 200_000, 1_000_000
#: Largest accepted number of nodes of tetrahedra; a mesh has about a fifth as many nodes as tetrahedra [-].
_MOST_NODES = 250_000
#: Largest number of points along an edge of a grid that is used; larger grids are thinned out [-].
_MOST_POINTS = 61
#: Distance of a point at the origin from the points around it, over the spacing of the grid, below which it is one of
#: the surface [-].
_NEAR = 2.0
#: Largest accepted coordinate in a file.
_LARGEST = 1e9


def read_triangles(path: Path, unit: float) -> FloatArray:
    """Read a surface.

    Args:
        path: A file with one of the endings `SURFACES`.
        unit: Length of one unit of the file's coordinates [m].

    Returns:
        Corners of the triangles without collapsed ones, shape (n, 3, 3) [m].

    Raises:
        ValueError: If the file cannot be read, has another format, holds no triangles or too many.
        ModuleNotFoundError: If trimesh is not installed.
    """
    kind = path.suffix.lower()
    if kind not in SURFACES:
        raise ValueError(f"{path.name} has an unknown ending; accepted: {', '.join(SURFACES)}")
    if kind == ".tet":
        from meshes.solids.tetrahedra import list_boundary

        nodes, cells = read_tetrahedra(path, unit)
        return _drop_collapsed(path.name, nodes[list_boundary(orient_tetrahedra(nodes, cells))])
    content = _read(path)
    points, faces = _read_grid(path.name, content) if kind == ".npy" else _read_mesh(path.name, content, kind[1:])
    if not np.isfinite(points).all() or np.abs(points).max(initial=0.0) > _LARGEST:
        raise ValueError(f"{path.name} is damaged: a corner is not a number; export it again")
    if len(faces) > _MOST_TRIANGLES:
        raise ValueError(f"{path.name} has {len(faces)} triangles; at most {_MOST_TRIANGLES} are accepted")
    return _drop_collapsed(path.name, unit * points[faces])


def _drop_collapsed(name: str, corners: FloatArray) -> FloatArray:
    """Leave out triangles with two corners in one place, shape (n, 3, 3).

    Raises:
        ValueError: If none is left.
    """
    edges = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    corners = corners[edges.min(axis=1) > 0]
    if not len(corners):
        raise ValueError(f"{name} holds no triangles; export a surface")
    return np.asarray(corners)


def read_tetrahedra(path: Path, unit: float) -> tuple[FloatArray, IntArray]:
    """Read a `.tet` file: lines `v x y z ...` of nodes and `t a b c d` of tetrahedra, which count nodes from 0.

    Args:
        path: The file.
        unit: Length of one unit of the file's coordinates [m].

    Returns:
        Positions of the nodes, shape (n, 3) [m], and the nodes of each tetrahedron, shape (e, 4).

    Raises:
        ValueError: If the file cannot be read or has another format.
    """
    nodes: list[list[float]] = []
    cells: list[list[int]] = []
    try:
        for line in _read(path).decode("ascii").splitlines():
            words = line.split()
            if words and words[0] == "v":
                nodes.append([float(word) for word in words[1:4]])
            elif words and words[0] == "t":
                cells.append([int(word) for word in words[1:5]])
            if len(nodes) > _MOST_NODES or len(cells) > _MOST_TETRAHEDRA:
                raise FileLimitError  # noqa: TRY301 -- reported below
        points, index = np.array(nodes, dtype=float), np.array(cells, dtype=np.int64)
        valid = points.shape[1:] == (3,) and index.shape[1:] == (4,) and 0 <= index.min() <= index.max() < len(points)
    except FileLimitError:
        raise ValueError(
            f"{path.name} has more than the {_MOST_NODES} nodes or {_MOST_TETRAHEDRA} tetrahedra accepted"
        ) from None
    except (ValueError, OverflowError):
        valid = False
    if not valid or not np.abs(points).max() <= _LARGEST:
        raise ValueError(f"{path.name} is no .tet file: it needs lines 'v x y z' and 't a b c d', nodes counted from 0")
    return unit * points, index


def orient_tetrahedra(nodes: FloatArray, cells: IntArray) -> IntArray:
    """Return tetrahedra of which all have a positive volume, shape (e, 4)."""
    corner = nodes[cells]
    turned = np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0
    out = cells.copy()
    out[turned] = out[turned][:, [0, 2, 1, 3]]
    return np.asarray(out)


def _read(path: Path) -> bytes:
    try:
        return read_bytes(path, most=_MOST_BYTES)
    except FileLimitError as error:
        raise ValueError(f"{path} {error}") from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}; give the path of a surface") from None


def _read_mesh(name: str, content: bytes, kind: str) -> tuple[FloatArray, IntArray]:
    """Read points and triangles by trimesh."""
    import trimesh

    log = logging.getLogger("trimesh")
    log.disabled = True  # trimesh prints tracebacks for damaged files
    try:
        with np.errstate(all="ignore"):
            found: Any = trimesh.load(
                io.BytesIO(content), file_type=kind, process=False, force="mesh", skip_materials=True
            )
            points, faces = np.asarray(found.vertices, dtype=np.float64), np.asarray(found.faces, dtype=np.int64)
        if points.ndim != 2 or faces.ndim != 2 or not len(faces) or faces.max() >= len(points):  # noqa: PLR2004
            raise ValueError("no triangles")  # noqa: TRY301 -- reported below like every other fault of the content
    except ModuleNotFoundError:
        raise
    except Exception:  # noqa: BLE001 -- a reader of arbitrary bytes raises errors of many types
        raise ValueError(f"{name} is not a whole {kind.upper()} file with triangles; export it again") from None
    finally:
        log.disabled = False
    return points, faces


def _read_grid(name: str, content: bytes) -> tuple[FloatArray, IntArray]:
    """Read points on a grid, and split each of its quadrilaterals without missing corners into two triangles."""
    try:
        grid = unpack_npy(content, most=8 * _MOST_BYTES)
    except FileLimitError as error:
        raise ValueError(f"{name} is no file of numpy that is accepted: {error}") from None
    if grid.ndim != 3 or grid.shape[2] != 3 or grid.dtype.kind not in "fiu" or min(grid.shape[:2]) < 2:  # noqa: PLR2004
        raise ValueError(f"{name} needs points of shape (rows, columns, 3), not {grid.shape}")
    step = max(1, -(-max(grid.shape[:2]) // _MOST_POINTS))
    points = np.asarray(grid[::step, ::step], dtype=float)
    present = _find_present(points)
    points[~present] = 0.0
    index = np.arange(present.size).reshape(present.shape)
    square = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    square = square[present.ravel()[square].all(axis=1)]
    return points.reshape(-1, 3), np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


def _find_present(points: FloatArray) -> BoolArray:
    """Return which points of a grid are present, shape (rows, columns).

    Missing are those that are no numbers; without any, those at the origin, but for a single one near its neighbours.
    """
    finite, zero = (np.asarray(each.all(axis=2)) for each in (np.isfinite(points), points == 0))
    if not finite.all() or zero.sum() != 1:
        return finite if not finite.all() else ~zero
    row, column = np.argwhere(zero)[0]
    around = points[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    spacing = max(float(np.median(np.linalg.norm(np.diff(points, axis=axis), axis=2))) for axis in range(2))
    return ~zero | bool(np.linalg.norm(around, axis=2).max() < _NEAR * spacing)
