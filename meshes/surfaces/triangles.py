"""Surfaces of triangles: closedness, cracks, seams, separate parts, nearest points, and collapse of short edges."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class _SurfaceNumbers:
    """Constants of the checks of surfaces and of the search for nearest points."""

    #: Distance below which corners are the same, over the size of the surface [-].  Single precision has a rounding of
    #: 6e-8.
    same: float = 1e-7
    #: Enclosed volume below which a surface counts as flat, over the cube of its size [-]; above rounding.
    flat: float = 1e-9
    #: Height of a triangle over its longest side, below which it counts as a line [-]; above rounding.
    thinnest: float = 1e-10
    #: Largest number of pairs of points or triangles that are compared at once [-]; limits the memory to some 100 MB.
    pairs: int = 2_000_000


@dataclass(frozen=True, kw_only=True)
class _CrackNumbers:
    """Constants of the search for cracks and seams; chosen on surfaces that CAD programs exported face by face."""

    #: Largest width of a crack along the border that is closed, over the size of the surface [-].
    width: float = 1e-4
    #: Distance between two edges of the border, over the size of the surface, below which they form a seam [-].
    seam: float = 1e-3
    #: Distance between two edges of the border, over the length of the shorter one, below which they form a seam [-].
    beside: float = 0.1
    #: Largest cosine between the directions of two edges of a seam, which run in opposite directions [-].
    against: float = -0.7
    #: Largest extent of a group of corners that are merged to close a crack, over the largest width of a crack [-].
    #: Larger groups of close corners are part of a finely divided border and are not merged.
    chain: float = 4.0
    #: Number of edges of seams after which the search ends [-]; the surface is then refused in any case.
    enough: int = 1000


@dataclass(frozen=True, kw_only=True)
class _CollapseNumbers:
    """Constants of the collapse of short edges; chosen so that offsets of the tested surfaces do not fold."""

    #: Largest number of passes over all edges of a surface [-].
    passes: int = 30
    #: Smallest cosine of the angle by which a collapse may rotate the normal of a triangle [-].
    turned: float = 0.3
    #: Ratio of height to longest side of a triangle that a collapse must not go below [-], unless the ratio of the
    #: triangle was smaller before.
    sliver: float = 0.1


_SURFACE = _SurfaceNumbers()
_CRACKS = _CrackNumbers()
_COLLAPSE = _CollapseNumbers()


def check_closed(triangles: FloatArray, name: str, *, crossings: bool = True) -> None:
    """Check that triangles form a closed surface, oriented outwards, that does not intersect itself.

    Args:
        triangles: Corners of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
        name: Name of the surface in messages.
        crossings: Whether to search for intersections.

    Raises:
        ValueError: With one line that names the fault.
    """
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3) or not len(triangles):  # noqa: PLR2004
        raise ValueError(f"{name} needs triangles of shape (n, 3, 3)")
    if not np.isfinite(triangles).all():
        raise ValueError(f"{name} has a corner that is no number; export it again")
    list_border(merge_corners(triangles)[1], name, closed=True)
    size, volume = float(np.ptp(triangles, axis=(0, 1)).max()), enclosed_volume(triangles)
    if abs(volume) < _SURFACE.flat * size**3:
        raise ValueError(f"{name} encloses no volume; export a solid")
    if volume < 0:
        raise ValueError(f"{name} is inside out: its triangles face inwards; reverse its normals")
    crossed = len(find_crossings(triangles)) if crossings else 0
    if crossed:
        raise ValueError(f"{name} intersects itself in {crossed} pairs of triangles; repair it")


def list_edges(faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """List the edges of n triangles, given as indices of their points, shape (n, 3).

    Returns:
        Directed edges as indices of the first and last point and of the triangle's third point, shape (3 n, 3).  Index
        of the undirected edge of each directed edge, shape (3 n,).  Number of triangles that share each of the m
        undirected edges, shape (m,).
    """
    edges = np.concatenate([np.roll(faces, -k, axis=1) for k in range(3)])
    _, place, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
    return edges, place.ravel(), count


def list_border(faces: IntArray, name: str, *, closed: bool = False) -> IntArray:
    """List the directed edges that belong to one triangle only, with the third point of the triangle, shape (k, 3).

    Args:
        faces: Points of each triangle, shape (f, 3).
        name: Name of the surface in messages.
        closed: Whether to refuse a surface that has such edges.

    Raises:
        ValueError: If more than two triangles share an edge, two triangles at an edge have opposite orientations, or a
            surface that must be closed is open.
    """
    edges, place, count = list_edges(faces)
    alone, crowded = int((count == 1).sum()), int((count > 2).sum())  # noqa: PLR2004 -- two triangles meet in an edge
    if closed and alone:
        raise ValueError(
            f"{name} is not closed: it has {alone} open edges; close the surface in the program that made it, or "
            "repair the file (Blender: 3D Print Toolbox, Make Manifold; MeshLab: Close Holes)"
        )
    if crowded:
        raise ValueError(
            f"{name} is not closed: it has {crowded} edges in which more than two triangles meet; repair it in the "
            "program that made it (Blender: 3D Print Toolbox, Make Manifold)"
        )
    wrong = int((np.abs(np.bincount(place, np.where(edges[:, 0] < edges[:, 1], 1, -1))) > 1).sum())
    if wrong:
        raise ValueError(
            f"{name} has {wrong} edges whose two triangles face different ways; let the program that made it recompute "
            "the normals outwards (Blender: Recalculate Outside), and export again"
        )
    return np.asarray(edges[count[place] == 1])


def merge_corners(triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Merge equal corners of triangles to points.

    Returns:
        Positions of the points, shape (p, 3) [m], and indices of the points of each triangle, shape (n, 3).
    """
    flat = triangles.reshape(-1, 3)
    place = cluster(flat, _SURFACE.same * float(np.ptp(flat, axis=0).max()))
    first = np.unique(place, return_index=True)[1]
    return flat[first], place.reshape(-1, 3)


def cluster(points: FloatArray, distance: float) -> IntArray:
    """Find clusters of points that lie in one place; return the number of the cluster of each point, shape (p,).

    Args:
        points: Positions of p points, shape (p, 3) [m].
        distance: Largest gap in the sorted values of each coordinate within a cluster [m].  It should be far smaller
            than the distance between different places.
    """
    label, count = np.zeros(len(points), dtype=np.int64), 0
    while True:  # dividing a cluster along one axis may leave parts with gaps along another axis
        for values in points.T:
            order = np.lexsort((values, label))
            apart = (np.diff(label[order]) != 0) | (np.diff(values[order]) > distance)
            label[order] = np.concatenate([[0], np.cumsum(apart)])
        if label.max(initial=0) == count:
            return label
        count = int(label.max())


def enclosed_volume(triangles: FloatArray) -> float:
    """Compute the volume that closed triangles enclose, negative if they face inwards [m3]."""
    corners = triangles - triangles.mean(axis=(0, 1))
    return float(np.linalg.det(corners).sum() / 6)


def normal_vectors(triangles: FloatArray) -> FloatArray:
    """Return normal vectors of triangles with twice their area as length, shape (n, 3) [m2]."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Scale n vectors to length 1, shape (n, 3) [-]; vectors of length zero stay zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))


def find_crossings(triangles: FloatArray) -> set[tuple[int, int]]:
    """Find the pairs of triangles without a common corner in which an edge of one crosses the other."""
    faces = merge_corners(triangles)[1]
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    crossing: set[tuple[int, int]] = set()
    for near in list_near_pairs(low, high):
        apart = (faces[near[0]][:, :, None] != faces[near[1]][:, None, :]).all(axis=(1, 2))
        one, other = near[0][apart], near[1][apart]
        hit = _edges_cross(triangles[one], triangles[other]) | _edges_cross(triangles[other], triangles[one])
        crossing |= {(int(min(pair)), int(max(pair))) for pair in zip(one[hit], other[hit], strict=True)}
    return crossing


def list_near_pairs(low: FloatArray, high: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """List the pairs of overlapping boxes among n boxes, in blocks.

    Candidates are the pairs that overlap along the axis with the fewest overlaps.

    Args:
        low: Lower ends of the boxes, shape (n, 3) [m].
        high: Upper ends, shape (n, 3) [m].
    """
    orders = np.argsort(low, axis=0, kind="stable")
    ends = [np.searchsorted(low[order, k], high[order, k], side="right") for k, order in enumerate(orders.T)]
    axis = int(np.argmin([end.sum() for end in ends]))
    order, following = orders[:, axis], ends[axis] - np.arange(len(low)) - 1
    steps = np.concatenate([[0], np.cumsum(following)])
    start = 0
    while start < len(low):
        stop = max(start + 1, int(np.searchsorted(steps, steps[start] + _SURFACE.pairs, side="right")) - 1)
        count = following[start:stop]
        first = np.repeat(np.arange(start, stop), count)
        second = first + 1 + np.arange(count.sum()) - np.repeat(steps[start:stop] - steps[start], count)
        one, other = order[first], order[second]
        near = (low[one] <= high[other]).all(axis=1) & (high[one] >= low[other]).all(axis=1)
        yield one[near], other[near]
        start = stop


def nearest_points(points: FloatArray, triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Find the point of a surface of triangles that is nearest to each given point.

    Args:
        points: Positions of k points, shape (k, 3) [m].
        triangles: Corners of n triangles, shape (n, 3, 3) [m].

    Returns:
        Nearest points, shape (k, 3) [m], and the indices of their triangles, shape (k,).
    """
    out, owner = np.empty_like(points), np.empty(len(points), dtype=np.int64)
    middle = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
    block = max(1, _SURFACE.pairs // (2 * len(triangles)))
    centre = middle.mean(axis=0)
    others = ((middle - centre) ** 2).sum(axis=1)
    for start in range(0, len(points), block):
        part = points[start : start + block]
        # The distance of a point from the nearest triangle's middle is an upper bound of its distance from the surface.
        # Triangles beyond this distance are left out.  The distances are those of a matrix product, with its rounding.
        there = part - centre
        own = (there**2).sum(axis=1)[:, None]
        away = np.sqrt(np.maximum(own + others - 2 * there @ (middle - centre).T, 0.0) + _SURFACE.same * (own + others))
        point, triangle = np.nonzero(away - radius <= away.min(axis=1)[:, None])
        candidate = _nearest_of_each(part[point], triangles[triangle])
        square = ((candidate - part[point]) ** 2).sum(axis=1)
        order = np.lexsort((triangle, square, point))
        best = order[np.searchsorted(point[order], np.arange(len(part)))]
        out[start : start + block], owner[start : start + block] = candidate[best], triangle[best]
    return out, owner


def _nearest_of_each(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return the nearest point of a triangle to a point, for k pairs of point and triangle, shape (k, 3) [m]."""
    along = np.roll(triangles, -1, axis=1) - triangles
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    away = points[:, None] - triangles
    share = np.clip((away * along).sum(axis=-1) / square, 0.0, 1.0)
    sides = triangles + share[..., None] * along
    best = np.argmin(((sides - points[:, None]) ** 2).sum(axis=-1), axis=1)
    side = sides[np.arange(len(points)), best]
    normal = np.cross(along[:, 0], along[:, 1])
    double_area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(double_area, 1e-300)[:, None]
    plane = points - (away[:, 0] * normal).sum(axis=-1)[:, None] * normal
    inside = ((np.cross(along, plane[:, None] - triangles) * normal[:, None]).sum(axis=-1) >= 0).all(axis=-1)
    # A triangle whose corners lie on a line has no normal; its nearest point lies on one of its sides.
    inside &= double_area > _SURFACE.thinnest * square.max(axis=1)
    return np.asarray(np.where(inside[:, None], plane, side))


def _edges_cross(one: FloatArray, other: FloatArray) -> BoolArray:
    """Return for k pairs of triangles whether an edge of the first triangle crosses the second, shape (k,)."""
    origin, first, second = other[:, 0], other[:, 1] - other[:, 0], other[:, 2] - other[:, 0]
    normal = np.cross(first, second)
    out = np.zeros(len(one), dtype=bool)
    for k in range(3):
        start, end = one[:, k], one[:, (k + 1) % 3]
        before = ((start - origin) * normal).sum(axis=1)
        after = ((end - origin) * normal).sum(axis=1)
        across = before * after < 0
        share = np.where(across, before / np.where(across, before - after, 1.0), 0.0)
        point = start + share[:, None] * (end - start) - origin
        square = np.maximum((normal**2).sum(axis=1), 1e-300)
        u = (np.cross(point, second) * normal).sum(axis=1) / square
        v = (np.cross(first, point) * normal).sum(axis=1) / square
        out |= across & (u > 0) & (v > 0) & (u + v < 1)
    return out


def close_cracks(triangles: FloatArray) -> FloatArray:
    """Merge corners on the border of a surface whose distance is below 1e-4 of its size.

    Faces that were exported one by one differ at their common border by the rounding of coordinates.

    Args:
        triangles: Corners of each triangle, shape (n, 3, 3) [m].

    Returns:
        The triangles without those that collapse, shape (m, 3, 3) [m].
    """
    points, faces = merge_corners(triangles)
    edges, place, count = list_edges(faces)
    border = np.unique(edges[count[place] == 1, :2])
    if not len(border):
        return triangles
    size = float(np.ptp(points, axis=0).max())
    label = cluster(points[border], _CRACKS.width * size)
    goal = border[np.unique(label, return_index=True)[1]][label]
    near = np.linalg.norm(points[goal] - points[border], axis=1) <= _CRACKS.chain * _CRACKS.width * size
    target = np.arange(len(points))
    target[border[near]] = goal[near]
    kept = (target[faces] != np.roll(target[faces], 1, axis=1)).all(axis=1)
    return np.asarray(points[target[faces[kept]]])


def refuse_seams(points: FloatArray, border: IntArray, name: str) -> None:
    """Refuse a surface with two parts of the border that lie along each other and should be one edge.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        border: Points of each edge of the border and the third point of its triangle, shape (k, 3).
        name: Name of the surface in messages.

    Raises:
        ValueError: If there is a seam, with its place.
    """
    edges = border[:, :2]
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    square = np.maximum(_dot(along, along), 1e-300)
    length = np.sqrt(square)
    inward = points[border[:, 2]] - start
    inward -= (_dot(inward, along) / square)[:, None] * along
    close = _CRACKS.seam * float(np.ptp(points, axis=0).max())
    reach = np.maximum(close, _CRACKS.beside * length)[:, None] / 2
    ends = np.stack([start, start + along])
    found, gap, place = set[int](), 0.0, np.zeros(3)
    for pairs in list_near_pairs(ends.min(axis=0) - reach, ends.max(axis=0) + reach):
        one, other = np.concatenate([pairs, pairs[::-1]], axis=1)
        against = _dot(along[one], along[other]) <= _CRACKS.against * length[one] * length[other]
        apart = (edges[one][:, :, None] != edges[other][:, None, :]).all(axis=(1, 2))
        one, other = one[against & apart], other[against & apart]
        away = start[one] + along[one] / 2 - start[other]
        away -= np.clip(_dot(away, along[other]) / square[other], 0.0, 1.0)[:, None] * along[other]
        distance = np.linalg.norm(away, axis=1)
        # Ignore the opposite border of a narrow strip of surface: it lies beyond the triangle at this edge.
        across = -_dot(away, inward[one]) > _dot(inward[one], inward[one]) / 2
        beside = ~across & (distance <= _CRACKS.beside * np.minimum(length[one], length[other]))
        near = beside | (distance <= close)
        if near.any():
            found |= set(one[near].tolist())
            worst = np.argmax(np.where(near, distance, -1.0))
            if distance[worst] >= gap:
                gap, place = float(distance[worst]), start[one[worst]] + along[one[worst]] / 2
        if len(found) >= _CRACKS.enough:
            break
    if found:
        least = "at least " if len(found) >= _CRACKS.enough else ""
        raise ValueError(
            f"{name} has a seam: {least}{len(found)} edges of its border lie within {1e3 * gap:.2g} mm of another part "
            f"of the border, as at ({describe(place)}) mm; join the faces there before the export"
        )


def refuse_parts(points: FloatArray, faces: IntArray, name: str) -> None:
    """Refuse a surface of several parts that share no point: one of them was exported by mistake.

    Raises:
        ValueError: If there are several parts, with the place of the smallest.
    """
    part = label_parts(len(points), faces)[faces[:, 0]]
    corner = points[faces]
    area = np.linalg.norm(normal_vectors(corner), axis=1)
    labels = np.unique(part)
    if len(labels) > 1:
        each = np.bincount(part, area)[labels]
        middle = corner[part == labels[np.argmin(each)]].mean(axis=(0, 1))
        raise ValueError(
            f"{name} consists of {len(labels)} parts that do not hang together, the smallest with "
            f"{100 * each.min() / each.sum():.2g} % of the area near ({describe(middle)}) mm; export the touched "
            "surface alone, and one file for each cover"
        )


def describe_borders(points: FloatArray, border: IntArray, name: str) -> tuple[str, ...]:
    """State in a sentence that a surface has several borders, and the place of the smallest; empty for one border.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        border: Points of each edge of the border, shape (k, 2).
        name: Name of the surface.
    """
    loop = label_parts(len(points), border)[border[:, 0]] if len(border) else border
    loops = [points[border[loop == each, 0]] for each in np.unique(loop)]
    if len(loops) <= 1:
        return ()
    width, middle = min((float(np.ptp(each, axis=0).max()), tuple(each.mean(axis=0))) for each in loops)
    sentence = (
        f"{name} has {len(loops)} borders, the smallest {1e3 * width:.3g} mm wide around ({describe(middle)}) mm; the "
        "cover ends at each of them with free sides: fill holes that are not meant"
    )
    return (sentence,)


def label_parts(count: int, faces: IntArray) -> IntArray:
    """Number the connected parts of a set of points, shape (count,).

    Points are connected by triangles, edges or other elements.

    Args:
        count: Number of points [-].
        faces: Points of each element, shape (f, k).
    """
    label = np.arange(count)
    while True:
        before = label.copy()
        lowest = label[faces].min(axis=1, keepdims=True)
        # Relabelling whole parts at once, not only single points, connects long chains of points in few rounds.
        np.minimum.at(label, before[faces], lowest)
        np.minimum.at(label, faces, lowest)
        label = label[label]
        if (label == before).all():
            return label


def describe(place: FloatArray | tuple[float, ...]) -> str:
    """Format a position in metres as text in millimetres, for example "1.5, 0, -2"."""
    return ", ".join(f"{round(1e3 * each, 2) + 0.0:g}" for each in place)


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Compute the scalar products of k pairs of vectors, shape (k,)."""
    return np.asarray(np.einsum("kc,kc->k", one, other))


def collapse_short_edges(points: FloatArray, faces: IntArray, length: float) -> tuple[FloatArray, IntArray]:
    """Collapse edges below a length to one of their ends, as long as the surface stays manifold.

    Points on the border are not moved or removed.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        length: Edges below this length are collapsed [m].

    Returns:
        Points and triangles that remain.
    """
    faces = faces.copy()
    for _ in range(_COLLAPSE.passes):
        edges, place, count = list_edges(faces)
        keys = np.empty((len(count), 2), dtype=np.int64)
        keys[place] = np.sort(edges[:, :2], axis=1)
        size = np.linalg.norm(points[keys[:, 0]] - points[keys[:, 1]], axis=1)
        border = set(keys[count == 1].ravel().tolist())
        around: dict[int, list[int]] = defaultdict(list)
        for number, face in enumerate(faces.tolist()):
            for point in face:
                around[point].append(number)
        locked: set[int] = set()
        removed: set[int] = set()
        for index in np.argsort(size, kind="stable"):
            if size[index] >= length:
                break
            removed |= _collapse(points, faces, around, keys[index].tolist(), (border, locked))
        if not removed:
            break
        faces = np.delete(faces, sorted(removed), axis=0)
    used, place = np.unique(faces, return_inverse=True)
    return points[used], place.reshape(-1, 3)


def _collapse(
    points: FloatArray, faces: IntArray, around: dict[int, list[int]], edge: list[int], kept: tuple[set[int], set[int]]
) -> set[int]:
    """Collapse one edge to one of its ends, if the surface stays manifold and no triangle turns over.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, changed in place, shape (f, 3).
        around: Triangles around each point.
        edge: The two points of the edge.
        kept: Points on the border, which must not be removed; and points near an edge that was collapsed in the same
            pass, which are added here.

    Returns:
        Indices of the triangles that vanish; empty if the edge was not collapsed.
    """
    border, locked = kept
    gone, stays = edge if edge[1] in border else edge[::-1]
    if gone in border or gone in locked or stays in locked:
        return set()
    mine, others = around[gone], around[stays]
    shared = set(mine) & set(others)
    near = [{int(point) for face in each for point in faces[face]} for each in (mine, others)]
    if len((near[0] & near[1]) - {gone, stays}) != len(shared):
        return set()
    moving = [face for face in mine if face not in shared]
    before = faces[moving]
    after = np.where(before == gone, stays, before)
    one, other = (normal_vectors(points[each]) for each in (before, after))
    size = np.linalg.norm(one, axis=1)
    turned = _dot(one, other) < _COLLAPSE.turned * size * np.linalg.norm(other, axis=1)
    # The normals of tiny triangles are unreliable.  Only triangles of more than a tenth of the largest area are checked
    # for turning over.
    if turned[size > 0.1 * size.max(initial=0.0)].any():
        return set()
    shape = [_shapes(points[each]).min(initial=1.0) for each in (before, after)]
    if shape[1] < min(_COLLAPSE.sliver, shape[0]):
        return set()
    faces[moving] = after
    locked |= near[0] | near[1]
    return shared


def _shapes(triangles: FloatArray) -> FloatArray:
    """Return the ratio of height to longest side of triangles, shape (n,) [-]."""
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    area = np.linalg.norm(normal_vectors(triangles), axis=1)
    return np.asarray(area / np.maximum(sides**2, np.finfo(float).tiny))
