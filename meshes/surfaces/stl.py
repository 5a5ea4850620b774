"""Reading of indenters from STL files."""

from __future__ import annotations

import io
import logging
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes.bounded_file import read_bytes
from meshes.indenters.polygons import cross
from meshes.indenters.prism import Prism
from meshes.indenters.triangle_mesh import TriangleMesh
from meshes.surfaces.gap import compute_volume, select_facing_down

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Largest accepted number of triangles in an STL file; an indenter needs far fewer [-].
MOST_TRIANGLES = 200_000
#: Largest accepted size of an STL file: a triangle takes about 250 bytes in ASCII, and this allows 400 [bytes].
_MOST_BYTES = 400 * MOST_TRIANGLES
#: Least and greatest accepted length of a body, the largest edge of its bounding box; outside this range the unit of
#: the file must be wrong [m].
SIZES = (2e-5, 1.0)
#: Largest accepted coordinate in an STL file, in the unit of the file; with a larger one the file counts as damaged.
_LARGEST_COORDINATE = 1e12
#: Height above a body's lowest, flat face.  Parts of the underside that are higher are assumed never to touch the
#: cover: 5 mm is half the thickness of a thick cover of 10 mm [m].
OUT_OF_REACH = 5e-3
#: Length that counts as zero, over the largest edge of the body's bounding box: STL files store seven digits [-].
_ZERO = 1e-6


def read_stl(path: str | Path, *, unit: float = 1e-3, axis: tuple[float, float] | None = None) -> Prism | TriangleMesh:
    """Read a closed body from a binary or ASCII STL file, as an indenter that presses along the file's -z.

    A body becomes a `Prism` if it stands on a flat face and all the rest of its underside is more than `OUT_OF_REACH`
    above this face; the edges of the face are then treated as sharp.  Any other body becomes a `TriangleMesh`.

    Args:
        path: Path of the STL file.
        unit: Length of one unit of the file's coordinates; STL files do not state their unit [m].
        axis: Position of the indenter's axis in the file's x and y; the middle of the body's bounding rectangle if
            None [m].

    Raises:
        ValueError: With one line that says what is wrong: the file cannot be read, is no STL file, or has too many
            triangles or an unlikely size; or its surface is open, has triangles with opposite orientations, or
            encloses no volume.
        ModuleNotFoundError: If trimesh is not installed.
    """
    source = Path(path)
    if not (np.isfinite(unit) and unit > 0):
        raise ValueError(f"the unit of {source.name} must be a positive length, not {unit} m")
    points, faces = _merge_points(source.name, *_parse(source.name, _read_bytes(source)))
    _check_closed(source.name, faces)
    corners = points[faces] * unit
    size = float(np.ptp(corners, axis=(0, 1)).max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise ValueError(
            f"{source.name} would be {1e3 * size:.3g} mm long, no size for an indenter "
            f"({1e3 * SIZES[0]:g}..{1e3 * SIZES[1]:g} mm); give the unit of the file, for example unit=mm or unit=inch"
        )
    volume = compute_volume(corners)
    if abs(volume) <= _ZERO**2 * size**3:
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


def _read_bytes(source: Path) -> bytes:
    """Read the content of an STL file, if its size is at most `_MOST_BYTES`.

    Raises:
        ValueError: If the path cannot be read or is not a file, or the file is too large.
    """
    try:
        size = source.stat().st_size
        if not source.is_file():
            raise ValueError(f"{source} is not a file; give the path of an STL file")
        if size > _MOST_BYTES:
            raise _too_many_triangles(source.name, f"{size / 1e6:.0f} MB")
        return read_bytes(source, most=_MOST_BYTES)
    except OSError as error:
        raise ValueError(f"{source}: {error.strerror}; give the path of an STL file") from None


def _parse(name: str, content: bytes) -> tuple[FloatArray, IntArray]:
    """Parse the content of an STL file.

    Args:
        name: Name of the file in error messages.
        content: The file's bytes.

    Returns:
        Coordinates of n points in the file's unit, shape (n, 3); indices of the three points of each of m triangles,
        shape (m, 3).

    Raises:
        ValueError: If the content is not a whole STL file, or has too many triangles.
    """
    from trimesh.exchange.stl import load_stl

    log = logging.getLogger("trimesh.util")
    log.disabled = True  # trimesh prints tracebacks for damaged files
    try:
        with np.errstate(all="ignore"):
            loaded = load_stl(io.BytesIO(content))
            points = np.array(loaded["vertices"], dtype=np.float64).reshape(-1, 3)
            faces = np.array(loaded["faces"], dtype=np.int64).reshape(-1, 3)
        if not len(faces) or faces.min() < 0 or faces.max() >= len(points):
            raise ValueError("no triangles")  # noqa: TRY301 -- reported below like every other fault of the content
    except Exception:  # noqa: BLE001 -- a reader of arbitrary bytes raises errors of many types
        raise ValueError(f"{name} is not a whole STL file; export it again, as binary or ASCII STL") from None
    finally:
        log.disabled = False
    if len(faces) > MOST_TRIANGLES:
        raise _too_many_triangles(name, f"{len(faces)} triangles")
    return points, faces


def _merge_points(name: str, points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge equal points, and remove the triangles of which two corners coincide.

    Args:
        name: Name of the file in error messages.
        points: Coordinates of the points, shape (n, 3).
        faces: Indices of the three points of each triangle, shape (m, 3).

    Returns:
        The points without duplicates, and the remaining triangles as indices of these points.

    Raises:
        ValueError: If a coordinate is not a number or too large, or no triangle is left.
    """
    if not np.isfinite(points).all() or np.abs(points).max() > _LARGEST_COORDINATE:
        raise ValueError(f"{name} is damaged: a corner is not a number; export it again")
    points, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        raise ValueError(f"{name} holds no triangles; export a solid")
    return points, faces


def _too_many_triangles(name: str, found: str) -> ValueError:
    return ValueError(
        f"{name} has {found}, more than the {MOST_TRIANGLES} triangles that are accepted; export it more coarsely"
    )


def _check_closed(name: str, faces: IntArray) -> None:
    """Check that a surface is closed and oriented: two triangles share every edge, and run along it in opposite ways.

    Args:
        name: Name of the file in error messages.
        faces: Indices of the three points of each triangle, shape (m, 3).

    Raises:
        ValueError: If an edge belongs to one triangle or to more than two, or its two triangles have opposite
            orientations.
    """
    directed, edge, count = _list_edges(faces)
    alone, crowded = int((count == 1).sum()), int((count > 2).sum())  # noqa: PLR2004 -- two triangles meet in an edge
    if alone or crowded:
        found = f"{alone} open edges" if alone else f"{crowded} edges in which more than two triangles meet"
        raise ValueError(
            f"{name} is not closed: it has {found}; close the surface in the program that made it, or repair the file "
            "(Blender: 3D Print Toolbox, Make Manifold; MeshLab: Close Holes)"
        )
    direction = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    wrong = int(np.count_nonzero(np.bincount(edge, direction)))
    if wrong:
        raise ValueError(
            f"{name} has {wrong} edges whose two triangles face different ways; let the program that made it recompute "
            "the normals outwards (Blender: Recalculate Outside), and export again"
        )


def _list_edges(faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """List the edges of n triangles, given as indices of their points, shape (n, 3).

    Returns:
        Indices of the first and last point of the three edges of each triangle, shape (3 n, 2); for each of these
        directed edges, the index of the undirected edge, shape (3 n,); and the number of triangles that share each of
        the m undirected edges, shape (m,).
    """
    directed = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    _, edge, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    return directed, edge.reshape(-1), count


def _convert_to_prism(body: TriangleMesh, size: float) -> Prism | TriangleMesh:
    """Convert a body that stands on a flat face to a prism, if no other part of its underside can touch the cover.

    Args:
        body: The body.
        size: Largest edge of the body's bounding box [m].

    Returns:
        A prism on the body's lowest face, or the body itself.
    """
    lower = select_facing_down(body.triangles)
    on_face = (lower[..., 2] <= _ZERO * size).all(axis=1)
    face, rest = lower[on_face], lower[~on_face]
    if not len(face) or (len(rest) and rest[..., 2].min() < OUT_OF_REACH):
        return body
    outlines = [tuple((x, y) for x, y in outline) for outline in _trace_outlines(face[..., :2])]
    try:
        return Prism(points=outlines[0], holes=tuple(outlines[1:]))
    except ValueError:  # an outline touches itself, or the axis lies outside the shape: keep the body of triangles
        return body


def _trace_outlines(face: FloatArray) -> list[list[list[float]]]:
    """Trace the closed outlines of a flat face of n triangles.

    Args:
        face: Corners (x, y) of the triangles, shape (n, 3, 2) [m].

    Returns:
        Corners (x, y) of each outline; the outline with most corners comes first [m].
    """
    points, index = np.unique(face.reshape(-1, 2), axis=0, return_inverse=True)
    directed, edge, count = _list_edges(index.reshape(-1, 3))
    following: dict[int, list[int]] = {}
    for start, end in directed[count[edge] == 1].tolist():
        following.setdefault(start, []).append(end)
    outlines = []
    while following:
        chain = [next(iter(following))]
        places = {chain[0]: 0}  # position of each point in the chain
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
                outlines.append(_remove_straight_corners(points[chain[first:]]))
                kept = first + 1 if first else 0
                for point in chain[kept:]:
                    del places[point]
                del chain[kept:]
            else:
                places[after] = len(chain)
                chain.append(after)
    return [each.tolist() for each in sorted(outlines, key=len, reverse=True) if len(each) > 2]  # noqa: PLR2004


def _remove_straight_corners(outline: FloatArray) -> FloatArray:
    """Return the corners of an outline, shape (n, 2), without those on a straight line between their neighbours."""
    before, after = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
    straight = np.abs(cross(before, after)) <= _ZERO * np.hypot(*before.T) * np.hypot(*after.T)
    return np.asarray(outline[~straight])
