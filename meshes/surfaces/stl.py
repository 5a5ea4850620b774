"""Indenters from STL files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes.indenters.prism import Prism
from meshes.surfaces.triangle_mesh import TriangleMesh

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Triangles of a file at most; an indenter needs far fewer.
MOST_TRIANGLES = 200_000
#: Bytes of a file at most: a triangle in ASCII takes about 250.
_MOST_BYTES = 400 * MOST_TRIANGLES
#: Length of a body at least and at most: beyond, the unit is wrong [m].
SIZES = (2e-5, 1.0)
#: Height over a flat face from which on a body is taken never to touch: half of a cover of 10 mm [m].
OUT_OF_REACH = 5e-3
#: Height that counts as none, over the size of the body: STL holds seven digits [-].
_NOTHING = 1e-6


def read_stl(path: str | Path, *, unit: float = 1e-3, axis: tuple[float, float] | None = None) -> Prism | TriangleMesh:
    """Read a closed body from an STL file, binary or ASCII; it presses along the file's -z.

    A body that stands on a flat face, all else of its underside being higher than `OUT_OF_REACH`, becomes a `Prism` of
    that face, and its edges are treated as sharp; any other becomes a `TriangleMesh`.

    Args:
        path: The file.
        unit: Length of one unit of the file, which does not say what it is in [m].
        axis: Where the axis stands in the file's x and y; the middle of the body's extent when not given [m].

    Raises:
        ValueError: With one line that says what is wrong with the file: it cannot be read, is no STL file, has too many
            triangles or an unlikely size, or its surface is open, has triangles that face different ways, or holds no
            volume.
        ModuleNotFoundError: If trimesh is not installed.
    """
    source = Path(path)
    if not (np.isfinite(unit) and unit > 0):
        raise ValueError(f"the unit of {source.name} must be a positive length, not {unit} m")
    points, faces = _load(source)
    _check_closed(source.name, faces)
    corners = points[faces] * unit
    size = float(np.ptp(corners, axis=(0, 1)).max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise ValueError(
            f"{source.name} would be {1e3 * size:.3g} mm long, no size for an indenter "
            f"({1e3 * SIZES[0]:g}..{1e3 * SIZES[1]:g} mm); give the unit of the file, for example unit=mm or unit=inch"
        )
    volume = float(np.einsum("ni,ni->", corners[:, 0] - corners[0, 0], np.cross(*_edges(corners))) / 6)
    if abs(volume) <= _NOTHING**2 * size**3:
        raise ValueError(f"{source.name} holds no volume: it is a sheet, not a body; export a solid")
    if volume < 0:  # inside out as a whole, as mirrored parts are: the body is the same
        corners = corners[:, ::-1]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    centre = (low + high)[:2] / 2 if axis is None else np.array(axis)
    corners -= np.array([*centre, low[2]])
    try:
        return _standing(TriangleMesh(triangles=corners), size)
    except ValueError as error:
        raise ValueError(f"{source.name}: {error}") from None


def _edges(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]


def _load(source: Path) -> tuple[FloatArray, IntArray]:
    """Points and faces of a file, points in one place being one."""
    try:
        size = source.stat().st_size
        if not source.is_file():
            raise ValueError(f"{source} is not a file; give the path of an STL file")
        if size > _MOST_BYTES:
            raise _too_many(source.name, f"{size / 1e6:.0f} MB")
        content = source.read_bytes()
    except OSError as error:
        raise ValueError(f"{source}: {error.strerror}; give the path of an STL file") from None
    points, faces = _parse(source.name, content)
    if len(faces) > MOST_TRIANGLES:
        raise _too_many(source.name, f"{len(faces)} triangles")
    if not np.isfinite(points).all() or np.abs(points).max() > _FARTHEST:
        raise ValueError(f"{source.name} is damaged: a corner is not a number; export it again")
    points, number = np.unique(points, axis=0, return_inverse=True)
    faces = number.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        raise ValueError(f"{source.name} holds no triangles; export a solid")
    return points, faces


#: Coordinate beyond which a file is damaged [-].
_FARTHEST = 1e12


def _parse(name: str, content: bytes) -> tuple[FloatArray, IntArray]:
    import io

    from trimesh.exchange.stl import load_stl

    try:
        with np.errstate(all="ignore"):
            loaded = load_stl(io.BytesIO(content))
        points = np.array(loaded["vertices"], dtype=np.float64).reshape(-1, 3)
        faces = np.array(loaded["faces"], dtype=np.int64).reshape(-1, 3)
        if not len(faces) or faces.min() < 0 or faces.max() >= len(points):
            raise ValueError("no triangles")  # noqa: TRY301 -- told below like every other fault of the content
    except Exception:  # noqa: BLE001 -- a reader of arbitrary bytes raises many unrelated types
        raise ValueError(f"{name} is not a whole STL file; export it again, as binary or ASCII STL") from None
    return points, faces


def _too_many(name: str, found: str) -> ValueError:
    return ValueError(
        f"{name} has {found}, more than the {MOST_TRIANGLES} triangles that are accepted; export it more coarsely"
    )


def _check_closed(name: str, faces: IntArray) -> None:
    """Check that every edge joins two triangles, which run along it in opposite directions.

    Raises:
        ValueError: If one does not.
    """
    directed = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    _, edge, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    alone, crowded = int((count == 1).sum()), int((count > 2).sum())  # noqa: PLR2004 -- two triangles meet in an edge
    if alone or crowded:
        found = f"{alone} open edges" if alone else f"{crowded} edges in which more than two triangles meet"
        raise ValueError(
            f"{name} is not closed: it has {found}; close the surface in the program that made it, or repair the file "
            "(Blender: 3D Print Toolbox, Make Manifold; MeshLab: Close Holes)"
        )
    direction = np.where(directed[:, 0] < directed[:, 1], 1, -1)
    wrong = int(np.count_nonzero(np.bincount(edge.reshape(-1), direction)))
    if wrong:
        raise ValueError(
            f"{name} has {wrong} edges whose two triangles face different ways; let the program that made it recompute "
            "the normals outwards (Blender: Recalculate Outside), and export again"
        )


def _standing(body: TriangleMesh, size: float) -> Prism | TriangleMesh:
    """The body, or the prism on its lowest face where nothing else of its underside can be reached."""
    low = body.lower
    face = low[(low[..., 2] <= _NOTHING * size).all(axis=1)]
    if not len(face):
        return body
    rest = low[(low[..., 2] > _NOTHING * size).any(axis=1)]
    if len(rest) and rest[..., 2].min() < OUT_OF_REACH:
        return body
    loops = [tuple((x, y) for x, y in loop) for loop in _outlines(face[..., :2])]
    try:
        return Prism(points=loops[0], holes=tuple(loops[1:]))
    except ValueError:  # an outline that touches itself, or stands beside the axis: rounded edges, but right
        return body


def _outlines(face: FloatArray) -> list[list[list[float]]]:
    """Outlines of triangles in a plane (n, 3, 2), the longest first, without corners on straight sides [m]."""
    points, number = np.unique(face.reshape(-1, 2), axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    directed = np.concatenate([number[:, [k, (k + 1) % 3]] for k in range(3)])
    _, edge, count = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    following: dict[int, list[int]] = {}
    for start, end in directed[count[edge.reshape(-1)] == 1].tolist():
        following.setdefault(start, []).append(end)
    loops = []
    while following:
        chain = [next(iter(following))]
        while chain:
            here = chain[-1]
            if here not in following:
                break
            after = following[here].pop()
            if not following[here]:
                del following[here]
            if after in chain:  # a loop closes; what came before it goes on
                cut = chain.index(after)
                loops.append(_straightened(points[chain[cut:]]))
                chain = chain[: cut + 1] if cut else []
            else:
                chain.append(after)
    return [loop.tolist() for loop in sorted(loops, key=len, reverse=True) if len(loop) > 2]  # noqa: PLR2004


def _straightened(loop: FloatArray) -> FloatArray:
    """Without corners that lie on straight sides."""
    here, there = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turn = here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]
    return np.asarray(loop[np.abs(turn) > _NOTHING * np.hypot(*here.T) * np.hypot(*there.T)])
