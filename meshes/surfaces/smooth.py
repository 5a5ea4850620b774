"""Smooth surface through the corners of the triangles of a CAD export.

A facet of a curved surface lies off the surface by its sag, about edge times angle / 8.  The edges of triangles are
divided at points of the smooth surface until the sag is below a tolerance.  An edge is replaced by a curve whose
tangents at both ends lie in the tangent planes there (as in PN triangles, Vlachos et al. 2001, and Nagata 2005); the
midpoint is exact on circles and, with the normals of Max (1999), on spheres.  Creases and borders stay sharp: they
follow the curve through their own points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.surfaces.triangles import label_parts, list_edges, merge_corners, normal_vectors, unit_vectors

#: Angle between the normals of two triangles from which their edge is a crease [deg].  Triangles of rounded faces in
#: CAD exports differ by less, and chamfers by 45 degrees.
CREASE = 40.0


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of the smoothing of surfaces; chosen on spheres, ellipsoids, tori and rounded blocks."""

    #: Largest number of rounds in which edges are divided in two [-].
    rounds: int = 4
    #: Share of the edges of which the largest sag counts in the error and is made smaller than the tolerance [-].  The
    #: rest lie at jagged borders and sharp spots, where the normals are unknown.
    most_edges: float = 0.95
    #: Number of triangles above which no further round is started [-]; limits the time of the mesher.
    most: int = 16_000
    #: Angle between the normals of triangles of one flat face [rad]; above the rounding of single precision.
    flat: float = 5e-3
    #: Area of the largest flat part at a point over that of a part which has no influence on the normal there [-].
    #: Large facets of a CAD export bend less than small ones.
    larger: float = 4.0
    #: Smallest cosine between the normals of a triangle and of its parts [-]; below it the part stays flat.
    turned: float = 0.7
    #: Error of the smooth surface over the sag of the given triangles [-].
    doubt: float = 0.25


_NUMBERS = _Numbers()
#: Corners 0, 1 and 2 and middles 3, 4 and 5 of the sides 01, 12 and 20 of the parts of a triangle, by the sum of 1, 2
#: and 4 for a divided first, second and third side.
_PARTS = (
    [[0, 1, 2]],
    [[0, 3, 2], [3, 1, 2]],
    [[0, 1, 4], [0, 4, 2]],
    [[3, 1, 4], [0, 3, 4], [0, 4, 2]],
    [[0, 1, 5], [1, 2, 5]],
    [[0, 3, 5], [3, 1, 2], [3, 2, 5]],
    [[5, 4, 2], [0, 1, 4], [0, 4, 5]],
    [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
)


def smooth_surface(
    triangles: FloatArray, tolerance: float, *, crease: float = CREASE
) -> tuple[FloatArray, float, float]:
    """Divide triangles at points of the smooth surface through their corners.

    Args:
        triangles: Corners of each triangle, shape (n, 3, 3) [m].
        tolerance: Sag above which an edge is divided [m].
        crease: Angle from which an edge stays sharp; 0 leaves the triangles as they are [deg].

    Returns:
        Corners of the triangles, shape (m, 3, 3) [m]; largest sag of the given triangles [m]; estimated distance of
        the new triangles from the true surface [m].
    """
    points, faces = merge_corners(triangles)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    given = 0.0
    for number in range(_NUMBERS.rounds + 1):
        middles, place, sag = _find_middles(points, faces, np.radians(crease or CREASE))
        largest = float(np.quantile(sag, _NUMBERS.most_edges))
        given = given or float(sag.max())
        if not crease or largest <= tolerance or number == _NUMBERS.rounds or len(faces) > _NUMBERS.most:
            break
        points, faces = _divide(points, faces, middles, place, sag > tolerance)
    return points[faces], given, largest + _NUMBERS.doubt * given if crease else given


def _find_middles(points: FloatArray, faces: IntArray, crease: float) -> tuple[FloatArray, IntArray, FloatArray]:
    """Find the point of the smooth surface in the middle of each edge.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        crease: Angle from which an edge is a crease [rad].

    Returns:
        Middles of the m edges, shape (m, 3) [m]; index of the edge of each side of each triangle, shape (f, 3); and
        distances of the middles from the straight edges, shape (m,) [m].
    """
    edges, place, _ = list_edges(faces)
    both, _, angle = _list_angles(points, faces)
    first, last = both.T
    face = np.arange(len(edges)) % len(faces)
    vectors = normal_vectors(points[faces])
    joined = angle < crease
    # Corners of triangles around a point between creases have one normal, which follows the largest flat parts there.
    # Directed edge k of `edges` starts at corner k.
    ahead = np.roll(np.arange(len(edges)).reshape(3, -1), -1, axis=0).ravel()
    pairs = np.concatenate([np.stack([first, ahead[last]], axis=1), np.stack([ahead[first], last], axis=1)])
    group = label_parts(len(edges), pairs[np.tile(joined, 2)])
    area = measure_flat(points, faces)[face]
    largest = np.zeros(len(edges))
    np.maximum.at(largest, group, area)
    weights = _weigh_corners(points, faces).T.ravel() * (_NUMBERS.larger * area > largest[group])
    total = np.zeros((len(edges), 3))
    np.add.at(total, group, weights[:, None] * vectors[face])
    normal = unit_vectors(total)[group]
    ends = edges[first, :2]
    chord = points[ends[:, 1]] - points[ends[:, 0]]
    length = np.linalg.norm(chord, axis=1, keepdims=True)
    chord = chord / np.maximum(length, 1e-300)
    lines = _find_tangents(points, ends[~joined], crease)
    move = np.zeros_like(chord)
    for number, at in enumerate((first, ahead[first])):
        tangent = chord - np.einsum("ec,ec->e", chord, normal[at])[:, None] * normal[at]
        tangent[~joined] = lines[number]
        tangent = unit_vectors(tangent)
        along = np.einsum("ec,ec->e", tangent, chord)[:, None]
        move += (1 - 2 * number) * length / 4 * tangent / (1 + np.maximum(along, 0.0))
    middles = points[ends].mean(axis=1) + move
    return middles, place.reshape(3, -1).T, np.linalg.norm(move, axis=1)


def measure_flat(points: FloatArray, faces: IntArray) -> FloatArray:
    """Measure the area of the flat part of a surface that each triangle belongs to, shape (f,) [m2]."""
    _, face, angle = _list_angles(points, faces)
    part = label_parts(len(faces), face[angle < _NUMBERS.flat])
    area = np.linalg.norm(normal_vectors(points[faces]), axis=1) / 2
    return np.asarray(np.bincount(part, area, len(faces))[part])


def _list_angles(points: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """List the m edges of a surface.

    Returns:
        Two directed edges of `list_edges` at each edge, shape (m, 2); their triangles, shape (m, 2); and the angle
        between the normals of these, pi at a border, shape (m,) [rad].
    """
    _, place, count = list_edges(faces)
    side = np.argsort(place, kind="stable")
    start = np.cumsum(count) - count
    both = np.stack([side[start], side[start + count - 1]], axis=1)
    face = both % len(faces)
    normals = unit_vectors(normal_vectors(points[faces]))[face]
    angle = np.arccos(np.clip(np.einsum("ec,ec->e", normals[:, 0], normals[:, 1]), -1, 1))
    return both, face, np.where(count == 2, angle, np.pi)  # noqa: PLR2004 -- two triangles meet in an edge


def _weigh_corners(points: FloatArray, faces: IntArray) -> FloatArray:
    """Return the weight of each triangle's normal vector in the normals at its corners, shape (f, 3) [1/m4].

    The weights are exact on spheres (Max, Journal of Graphics Tools 4 (1999) 1).
    """
    corner = points[faces]
    square = ((np.roll(corner, -1, axis=1) - corner) ** 2).sum(axis=2)
    return np.asarray(1 / np.maximum(square * np.roll(square, 1, axis=1), 1e-300))


def _find_tangents(points: FloatArray, ends: IntArray, crease: float) -> tuple[FloatArray, FloatArray]:
    """Return the tangents of creases and borders at both ends of their edges, shape (k, 3) each [-].

    The tangent is that of the parabola through a point and its two neighbours.  Where a crease ends, divides or turns
    by more than `crease`, it is the edge itself.
    """
    chord = points[ends[:, 1]] - points[ends[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, 1e-300)[:, None]
    count = np.bincount(ends.ravel(), minlength=len(points))
    out = []
    for number in range(2):
        at = ends[:, number]
        total = np.zeros((len(points), 3))
        for which, sign in enumerate((1.0, -1.0)):
            np.add.at(total, ends[:, which], sign * unit / length[:, None])
        sign = 1.0 - 2 * number
        other = total[at] - sign * unit / length[:, None]  # out of the point along the other edge, over its length
        turn = np.einsum("ec,ec->e", unit_vectors(other), unit) * -sign
        tangent = unit / length[:, None] - sign * other
        smooth = (count[at] == 2) & (turn > np.cos(crease))  # noqa: PLR2004 -- one edge before and one after
        out.append(np.where(smooth[:, None], tangent, unit))
    return out[0], out[1]


def _divide(
    points: FloatArray, faces: IntArray, middles: FloatArray, place: IntArray, wanted: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Divide triangles at the middles of edges, which stay on the straight edge where a part would turn over.

    Args:
        points: Positions of the points, shape (p, 3) [m].
        faces: Points of each triangle, shape (f, 3).
        middles: Middles of the m edges, shape (m, 3) [m].
        place: Index of the edge of each side of each triangle, shape (f, 3).
        wanted: Whether each edge is divided, shape (m,).
    """
    straight = np.zeros_like(middles)
    straight[place] = (points[faces] + points[np.roll(faces, -1, axis=1)]) / 2
    number = len(points) + np.cumsum(wanted) - 1
    six = np.hstack([faces, number[place]])
    kind = wanted[place] @ [1, 2, 4]
    parts = np.concatenate([six[kind == each][:, _PARTS[each]].reshape(-1, 3) for each in range(8)])
    parent = np.concatenate([np.repeat(np.flatnonzero(kind == each), len(_PARTS[each])) for each in range(8)])
    before = unit_vectors(normal_vectors(points[faces]))[parent]
    for _ in range(2):
        new = np.concatenate([points, middles[wanted]])
        after = unit_vectors(normal_vectors(new[parts]))
        turned = parent[np.einsum("fc,fc->f", before, after) < _NUMBERS.turned]
        edges = np.unique(place[turned])
        middles[edges] = straight[edges]
    return np.concatenate([points, middles[wanted]]), parts
