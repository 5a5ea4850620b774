"""Reading of surfaces, tetrahedra and indenters from files of other programs.

Surfaces come from STL, OBJ and PLY files, from `.npy` files of points on a grid, and from the boundary of `.tet` files.
The grid has the shape (rows, columns, 3); points that are not finite or lie at the origin are missing.  Indenters come
from STL files.  None of these formats states a unit.
"""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.bounded_file import FileLimitError, read_bytes, unpack_npy
from meshes.indenters.polygons import cross
from meshes.indenters.shapes import Prism
from meshes.indenters.triangle_mesh import TriangleMesh, select_facing_down
from meshes.surfaces.triangles import enclosed_volume, list_border, list_edges

#: Endings of the names of files that hold a surface.
SURFACES = (".stl", ".obj", ".ply", ".npy", ".tet")
#: Endings of the names of files that hold tetrahedra.
TETRAHEDRA = (".tet",)


@dataclass(frozen=True, kw_only=True)
class FileLimits:
    """Limits on what files hold; a file beyond them is refused."""

    #: Largest number of triangles of a surface [-].  Covers and indenters need far fewer.
    triangles: int = 200_000
    #: Largest number of tetrahedra of a `.tet` file [-].  A solvable mesh has fewer.
    tetrahedra: int = 1_000_000
    #: Largest number of nodes of a `.tet` file [-].  A mesh has about a fifth as many nodes as tetrahedra.
    nodes: int = 250_000
    #: Largest file of a surface or of tetrahedra [bytes]; chosen from the limits on triangles and tetrahedra.
    surface_bytes: int = 2**27
    #: Largest STL file of an indenter [bytes]: 400 bytes per accepted triangle.  A triangle takes about 250 bytes in an
    #: ASCII file.
    stl_bytes: int = 80_000_000
    #: Largest coordinate of a surface, in the unit of the file.  A larger one indicates a damaged file.
    surface_coordinate: float = 1e9
    #: Largest coordinate of an indenter, in the unit of the file.  A larger one indicates a damaged file.
    stl_coordinate: float = 1e12
    #: Largest number of points along an edge of a grid [-]; a larger grid is thinned out.  Chosen for the time of
    #: meshing.
    grid_points: int = 61
    #: Distance of a point at the origin from its neighbours, over the grid's spacing, up to which the point counts as
    #: present [-].
    near: float = 2.0
    #: Smallest and largest accepted length of an indenter's largest edge [m].  Other lengths indicate a wrong unit.
    sizes: tuple[float, float] = (2e-5, 1.0)
    #: Height above an indenter's flat face from which its underside cannot touch the cover [m]; half of a thick cover
    #: of 10 mm.
    out_of_reach: float = 5e-3
    #: Length that counts as zero, over the largest edge of an indenter [-]; STL files store seven digits.
    zero: float = 1e-6


LIMITS = FileLimits()


def read_triangles(path: Path, unit: float) -> FloatArray:
    """Read a surface.

    Args:
        path: Path of a file with one of the endings `SURFACES`.
        unit: Length of one unit of the file's coordinates [m].

    Returns:
        Corners of the triangles without collapsed ones, shape (n, 3, 3) [m].

    Raises:
        ValueError: If the file cannot be read, has another format, or holds no triangles or too many.
        ModuleNotFoundError: If trimesh is not installed.
    """
    kind = path.suffix.lower()
    if kind not in SURFACES:
        raise ValueError(f"{path.name} has an unknown ending; accepted: {', '.join(SURFACES)}")
    if kind == ".tet":
        from meshes.solids.tetrahedra import list_boundary, orient_tetrahedra

        nodes, cells = read_tetrahedra(path, unit)
        return _drop_collapsed(path.name, nodes[list_boundary(orient_tetrahedra(nodes, cells))])
    content = _read(path)
    if kind == ".npy":
        points, faces = _read_grid(path.name, content)
    else:
        points, faces = _read_mesh(path.name, content, kind[1:], LIMITS.surface_coordinate)
    return _drop_collapsed(path.name, unit * points[faces])


def _drop_collapsed(name: str, corners: FloatArray) -> FloatArray:
    """Leave out triangles with two corners in one place, shape (n, 3, 3).

    Raises:
        ValueError: If no triangle is left.
    """
    edges = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    corners = corners[edges.min(axis=1) > 0]
    if not len(corners):
        raise ValueError(f"{name} holds no triangles; export a surface")
    return np.asarray(corners)


def read_tetrahedra(path: Path, unit: float) -> tuple[FloatArray, IntArray]:
    """Read a `.tet` file: lines `v x y z ...` of nodes and `t a b c d` of tetrahedra, which count nodes from 0.

    Args:
        path: Path of the file.
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
            if len(nodes) > LIMITS.nodes or len(cells) > LIMITS.tetrahedra:
                raise FileLimitError  # noqa: TRY301 -- reported below
        points, index = np.array(nodes, dtype=float), np.array(cells, dtype=np.int64)
        valid = points.shape[1:] == (3,) and index.shape[1:] == (4,) and 0 <= index.min() <= index.max() < len(points)
    except FileLimitError:
        raise ValueError(
            f"{path.name} has more than the {LIMITS.nodes} nodes or {LIMITS.tetrahedra} tetrahedra accepted"
        ) from None
    except (ValueError, OverflowError):
        valid = False
    if not valid or not np.abs(points).max() <= LIMITS.surface_coordinate:
        raise ValueError(f"{path.name} is no .tet file: it needs lines 'v x y z' and 't a b c d', nodes counted from 0")
    return unit * points, index


def _read(path: Path, *, most: int = LIMITS.surface_bytes, what: str = "a surface") -> bytes:
    try:
        return read_bytes(path, most=most)
    except FileLimitError as error:
        raise ValueError(f"{path} {error}; give the path of {what}, exported more coarsely if it is large") from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}; give the path of {what}") from None


def _read_mesh(name: str, content: bytes, kind: str, largest: float) -> tuple[FloatArray, IntArray]:
    """Read points and triangles from the bytes of an STL, OBJ or PLY file by trimesh.

    Args:
        name: Name of the file in messages.
        content: Bytes of the file.
        kind: Format of the file: `stl`, `obj` or `ply`.
        largest: Largest accepted coordinate, in the unit of the file.

    Raises:
        ValueError: If the file is damaged, or has coordinates above the limit or too many triangles.
    """
    import trimesh

    log = logging.getLogger("trimesh.util")
    log.disabled = True  # Otherwise trimesh logs tracebacks for damaged files.
    try:
        with np.errstate(all="ignore"):
            found: Any = trimesh.load(
                io.BytesIO(content), file_type=kind, process=False, force="mesh", skip_materials=True
            )
            points, faces = np.asarray(found.vertices, dtype=np.float64), np.asarray(found.faces, dtype=np.int64)
        whole = points.ndim == 2 == faces.ndim and len(faces) and 0 <= faces.min() <= faces.max() < len(points)  # noqa: PLR2004
    except ModuleNotFoundError:
        raise
    except Exception:  # noqa: BLE001 -- a reader of arbitrary bytes raises errors of many types
        whole = False
    finally:
        log.disabled = False
    if not whole:
        raise ValueError(f"{name} is not a whole {kind.upper()} file with triangles; export it again")
    _check_points(name, points, len(faces), largest)
    return points, faces


def _check_points(name: str, points: FloatArray, count: int, largest: float) -> None:
    """Raise a ValueError if a coordinate is not finite or exceeds a limit, or if there are too many triangles."""
    if not np.isfinite(points).all() or np.abs(points).max(initial=0.0) > largest:
        raise ValueError(f"{name} is damaged: a corner is not a number; export it again")
    if count > LIMITS.triangles:
        raise ValueError(
            f"{name} has {count} triangles, more than the {LIMITS.triangles} that are accepted; export it more coarsely"
        )


def _read_grid(name: str, content: bytes) -> tuple[FloatArray, IntArray]:
    """Read points on a grid, and split each of its quadrilaterals without missing corners into two triangles."""
    try:
        grid = unpack_npy(content, most=8 * LIMITS.surface_bytes)
    except FileLimitError as error:
        raise ValueError(f"{name} is no file of numpy that is accepted: {error}") from None
    if grid.ndim != 3 or grid.shape[2] != 3 or grid.dtype.kind not in "fiu" or min(grid.shape[:2]) < 2:  # noqa: PLR2004
        raise ValueError(f"{name} needs points of shape (rows, columns, 3), not {grid.shape}")
    step = max(1, -(-max(grid.shape[:2]) // LIMITS.grid_points))
    points = np.asarray(grid[::step, ::step], dtype=float)
    present = _find_present(points)
    points[~present] = 0.0
    index = np.arange(present.size).reshape(present.shape)
    square = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    square = square[present.ravel()[square].all(axis=1)]
    _check_points(name, points, 2 * len(square), LIMITS.surface_coordinate)
    return points.reshape(-1, 3), np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


def _find_present(points: FloatArray) -> BoolArray:
    """Return which points of a grid are present, shape (rows, columns).

    Points that are not finite are missing.  If all are finite, points at the origin are missing, except a single one
    near its neighbours.
    """
    finite, zero = (np.asarray(each.all(axis=2)) for each in (np.isfinite(points), points == 0))
    if not finite.all() or zero.sum() != 1:
        return finite if not finite.all() else ~zero
    row, column = np.argwhere(zero)[0]
    around = points[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    spacing = max(float(np.median(np.linalg.norm(np.diff(points, axis=axis), axis=2))) for axis in range(2))
    return ~zero | bool(np.linalg.norm(around, axis=2).max() < LIMITS.near * spacing)


def read_stl(path: str | Path, *, unit: float = 1e-3, axis: tuple[float, float] | None = None) -> Prism | TriangleMesh:
    """Read a closed body from a binary or ASCII STL file, as an indenter that presses along the file's -z.

    A body becomes a `Prism` if it stands on a flat face and the rest of its underside is more than 5 mm
    above this face; the edges of the face are then treated as sharp.  Any other body becomes a `TriangleMesh`.

    Args:
        path: Path of the STL file.
        unit: Length of one unit of the file's coordinates; STL files do not state their unit [m].
        axis: Position of the indenter's axis in the file's x and y; the middle of the body's bounding rectangle if
            None [m].

    Raises:
        ValueError: With one line that names the fault: the file cannot be read, is no STL file, or has too many
            triangles or an unlikely size; or its surface is open, has triangles of opposite orientations, or encloses
            no volume.
        ModuleNotFoundError: If trimesh is not installed.
    """
    source = Path(path)
    if not (np.isfinite(unit) and unit > 0):
        raise ValueError(f"the unit of {source.name} must be a positive length, not {unit} m")
    content = _read(source, most=LIMITS.stl_bytes, what="an STL file")
    points, faces = _read_mesh(source.name, content, "stl", LIMITS.stl_coordinate)
    points, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        raise ValueError(f"{source.name} holds no triangles; export a solid")
    list_border(faces, source.name, closed=True)
    corners = points[faces] * unit
    size = float(np.ptp(corners, axis=(0, 1)).max())
    low_mm, high_mm = 1e3 * LIMITS.sizes[0], 1e3 * LIMITS.sizes[1]
    if not low_mm <= 1e3 * size <= high_mm:
        raise ValueError(
            f"{source.name} would be {1e3 * size:.3g} mm long, no size for an indenter "
            f"({low_mm:g}..{high_mm:g} mm); give the unit of the file, for example unit=mm or unit=inch"
        )
    volume = enclosed_volume(corners)
    if abs(volume) <= LIMITS.zero**2 * size**3:
        raise ValueError(f"{source.name} holds no volume: it is a sheet, not a body; export a solid")
    if volume < 0:  # all triangles face inwards, as in a mirrored body: reverse the order of their corners
        corners = corners[:, ::-1]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    centre = (low + high)[:2] / 2 if axis is None else np.array(axis)
    corners -= np.array([*centre, low[2]])
    try:
        return _convert_to_prism(TriangleMesh(triangles=corners), size)
    except ValueError as error:
        raise ValueError(f"{source.name}: {error}") from None


def _convert_to_prism(body: TriangleMesh, size: float) -> Prism | TriangleMesh:
    """Convert a body that stands on a flat face to a prism, if no other part of its underside can touch the cover.

    Args:
        body: Body of triangles.
        size: Largest edge of the body's bounding box [m].

    Returns:
        A prism on the body's lowest face, or the body itself.
    """
    lower = select_facing_down(body.triangles)
    on_face = (lower[..., 2] <= LIMITS.zero * size).all(axis=1)
    face, rest = lower[on_face], lower[~on_face]
    if not len(face) or (len(rest) and rest[..., 2].min() < LIMITS.out_of_reach):
        return body
    outlines = [tuple((x, y) for x, y in outline) for outline in _trace_outlines(face[..., :2])]
    try:
        return Prism(points=outlines[0], holes=tuple(outlines[1:]))
    except ValueError:  # The face has no valid outline, so the indenter stays a body of triangles.
        return body


def _trace_outlines(face: FloatArray) -> list[list[list[float]]]:
    """Trace the closed outlines of a flat face of n triangles.

    Args:
        face: Corners (x, y) of the triangles, shape (n, 3, 2) [m].

    Returns:
        Corners (x, y) of each outline; the outline with most corners comes first [m].
    """
    points, index = np.unique(face.reshape(-1, 2), axis=0, return_inverse=True)
    edges, place, count = list_edges(index.reshape(-1, 3))
    following: dict[int, list[int]] = {}
    for start, end in edges[count[place] == 1, :2].tolist():
        following.setdefault(start, []).append(end)
    outlines = []
    while following:
        chain = [next(iter(following))]
        places = {chain[0]: 0}  # index of each point in the list `chain`
        while chain:
            here = chain[-1]
            if here not in following:
                break
            after = following[here].pop()
            if not following[here]:
                del following[here]
            # The chain is the list of points followed so far.  If the next point is already in the chain, the points
            # from its first occurrence on form a closed outline.  They are removed, and the chain continues from there.
            if (first := places.get(after)) is not None:
                outline = points[chain[first:]]
                before, behind = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
                straight = LIMITS.zero * np.hypot(*before.T) * np.hypot(*behind.T)
                outlines.append(outline[np.abs(cross(before, behind)) > straight])
                kept = first + 1 if first else 0
                for point in chain[kept:]:
                    del places[point]
                del chain[kept:]
            else:
                places[after] = len(chain)
                chain.append(after)
    return [each.tolist() for each in sorted(outlines, key=len, reverse=True) if len(each) > 2]  # noqa: PLR2004
