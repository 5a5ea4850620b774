"""Closed surface of a cover from its outer surface and its base or thickness; its bonded, touchable, left-out parts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.surfaces.triangles import (
    collapse_short_edges,
    describe,
    describe_borders,
    enclosed_volume,
    find_crossings,
    list_border,
    merge_corners,
    nearest_points,
    normal_vectors,
    refuse_parts,
    refuse_seams,
    unit_vectors,
)


@dataclass(frozen=True, kw_only=True)
class _OffsetNumbers:
    """Constants of the offset of a surface; chosen so that offsets of the tested surfaces do not fold."""

    #: Largest number of rounds of smoothing of an offset where it folds [-].
    rounds: int = 40
    #: Largest fraction of the area at which the smoothed offset may still fold [-].  The mesher smooths small folds.
    most_folded: float = 0.005
    #: Smallest accepted distance between a surface and its offset, over the requested distance [-].
    thinnest: float = 0.5
    #: Smallest distance between a surface and its offset, over the requested distance, to which folds are smoothed [-].
    #: Smoothing reduces the distance; folds that remain are left to the mesher.
    wanted: float = 0.75
    #: Length of an edge, over the thickness, below which the edge is collapsed before the offset is made [-].
    short: float = 0.2
    #: Number of rounds of smoothing after which one more ring of neighbours around a fold is smoothed [-].
    widen: int = 3
    #: Largest number of rings of neighbours around a fold that are smoothed [-].
    most_rings: int = 10
    #: Factor on the length of smoothed offsets [-]; shorter offsets fold less.
    kept: float = 0.995
    #: Smallest cosine between the normals of a triangle and of its offset [-]; below this value the offset folds.
    folded: float = 0.2


@dataclass(frozen=True, kw_only=True)
class _SideNumbers:
    """Limits that decide which side of a surface is the outside, and which part is bonded; chosen by judgement."""

    #: Largest distance from the base of a triangle that belongs to the base, over the size of the surface [-].
    on_base: float = 0.01
    #: Volume of a closed surface over half its area, over the thickness of the cover below it, up to which the surface
    #: counts as that of the cover itself [-].
    cover: float = 1.25
    #: Solid angle of a closed surface seen from a point, over that of a whole sphere, above which the point counts as
    #: inside the surface [-].
    inside: float = 0.5
    #: Area-weighted mean of the scalar product of normal and position relative to the middle of a surface, over the
    #: size of the surface [-].  Below this value the normals point inwards.
    inwards: float = -0.02
    #: Value of the same area-weighted mean up to which a surface counts as flat [-].  The order of the corners of its
    #: triangles then decides which side is the outside.
    outwards: float = 0.02


#: Labels of the triangles of a cover's surface: an indenter can touch it, it is bonded, or it is neither.
TOUCHABLE, BONDED, LEFT_OUT = 0, 1, 2
_OFFSET = _OffsetNumbers()
_SIDES = _SideNumbers()
#: Index of the strip between the borders of outer surface and base among the groups of triangles of a body.
_STRIP = 2
#: Error message if a base that is the closed surface of a core crosses the outer surface.
_CORE = (
    "the base reaches through the outer surface; give the body of the cover alone as surface, the outer body minus the "
    "core, or open surfaces that end where the cover ends"
)
#: Error message if an open base crosses the outer surface.
_SHEETS = "the outer surface and the base cross each other; check frame and unit, or end both where the cover ends"
#: Error message if the sides of the body cross the outer surface or the base.
_OUTLINES = "the sides between the borders of outer surface and base cross a surface; cut both along the same outline"


@dataclass(frozen=True, kw_only=True, eq=False)
class Shell:
    """Closed surface of a cover.

    Attributes:
        surface: Triangles of the whole surface, counterclockwise as seen from outside, shape (n, 3, 3) [m].
        label: `TOUCHABLE`, `BONDED` or `LEFT_OUT` for each triangle, shape (n,).
        notes: Sentences on changes of the shape and assumptions about it.
        nominal: Requested distance between a surface and its offset [m]; None if the shell was not made by an offset.
        is_folded: Whether the surface crosses itself at small folds of an offset.
        geometry_error: Estimated distance of the surface from the body that it stands for [m].
        is_smooth: Whether the facets of files were smoothed.
    """

    surface: FloatArray
    label: IntArray
    notes: tuple[str, ...] = ()
    nominal: float | None = None
    is_folded: bool = False
    geometry_error: float = 0.0
    is_smooth: bool = False

    @property
    def base(self) -> FloatArray:
        """Triangles of the bonded part, facing into the cover, shape (b, 3, 3) [m]."""
        return np.asarray(self.surface[self.label == BONDED][:, ::-1])

    @property
    def thickness(self) -> float:
        """Thickness of the offset [m]; without an offset, the volume over half of the whole surface area."""
        if self.nominal is not None:
            return self.nominal
        return 4 * enclosed_volume(self.surface) / float(np.linalg.norm(normal_vectors(self.surface), axis=1).sum())


def thicken(triangles: FloatArray, thickness: float, name: str, *, inward: bool) -> Shell:
    """Make a shell between a surface and its offset along the normals.

    Where the curvature of the surface is too large for the thickness, the offset would fold.  There its distance is
    smoothed over the neighbours, and a note states the smallest distance.

    Args:
        triangles: The outer surface if `inward`, else the base, facing outwards, shape (n, 3, 3) [m].
        thickness: Distance between the surface and its offset [m].
        name: Name of the surface in messages.
        inward: Whether the offset lies below the surface.

    Raises:
        ValueError: If the triangles face different ways or inwards, or the offset folds nevertheless.
    """
    points, faces = merge_corners(triangles)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    border = list_border(faces, name)
    refuse_seams(points, border, name)
    refuse_parts(points, faces, name)
    if inward and not len(border):
        _refuse_cover(points[faces], thickness, name)
    assumed = _check_outward(points, faces, name) + describe_borders(points, border[:, :2], name)
    points, faces = collapse_short_edges(points, faces, _OFFSET.short * thickness)
    border = list_border(faces, name)[:, :2]
    normals = point_normals(points, faces)
    step = (-thickness if inward else thickness) * normals
    near = _list_neighbours(faces, len(points))
    areas = np.linalg.norm(normal_vectors(points[faces]), axis=1)
    best, least, distance, sharp = step, np.inf, 0.0, points[0]
    for number in range(_OFFSET.rounds):
        folded = _find_folds(points, points + step, faces, border, inward=inward)
        share = float(areas[folded].sum() / areas.sum())
        if share <= _OFFSET.most_folded and share < least:
            near_by = nearest_points(points + step, points[faces])[0]
            lengths = np.linalg.norm(near_by - points - step, axis=1)
            shortest, sharp = float(lengths.min()), points[lengths.argmin()]
            if shortest >= (_OFFSET.wanted if np.isfinite(least) else _OFFSET.thinnest) * thickness:
                best, least, distance = step, share, shortest
        if not share:
            break
        if number == 0:
            sharp = points[faces[folded][0]].mean(axis=0)
        spots = set(faces[folded].ravel().tolist())
        step = _smooth(step, near, spots, rings=min(1 + number // _OFFSET.widen, _OFFSET.most_rings))
    moved = points + best
    if not distance:
        raise ValueError(
            f"{name} bends more sharply than a thickness of {1e3 * thickness:.3g} mm allows, as at "
            f"({describe(sharp)}) mm; round the edges there, take a smaller thickness, or give the surface of the base"
        )
    outer, inner = (points, moved) if inward else (moved, points)
    notes = assumed
    if distance <= 0.98 * thickness:
        text = f"the surface bends more sharply than {1e3 * thickness:.3g} mm at some points: there the cover is"
        notes += (f"{text} thinner, at least {1e3 * distance:.3g} mm",)
    if least:
        notes += (f"the offset surface folds at {100 * least:.2g} % of its area, where the mesher smooths it",)
    surface = _close(outer, inner, faces, border)
    label = np.zeros(len(surface), dtype=np.int64)
    label[len(faces) : 2 * len(faces)] = BONDED
    return Shell(
        surface=surface,
        label=label,
        notes=notes,
        nominal=thickness,
        is_folded=bool(least),
    )


def join(outer: FloatArray, base: FloatArray, *, distance: float | None = None) -> Shell:
    """Make a shell from an outer surface and a base, or locate the base on the closed surface of a body.

    Args:
        outer: Outer surface in either orientation if it is open, shape (n, 3, 3) [m].  If it is closed and the base
            lies on it, the surface of the whole body.
        base: Surface of the base, facing either way if it is open, shape (b, 3, 3) [m].
        distance: Largest distance of the bonded part of a body's surface from the base; 1 % of the size if None [m].

    Raises:
        ValueError: If only one of the surfaces is closed, or the base does not lie on the surface.
    """
    outer_points, outer_faces = merge_corners(outer)
    base_points, base_faces = merge_corners(base)
    border = list_border(outer_faces, "the outer surface")[:, :2]
    edge = list_border(base_faces, "the base")[:, :2]
    if not len(border):
        chosen = select_base(outer, base, distance=distance, is_closed=not len(edge))
        if chosen.any():
            return Shell(surface=outer, label=np.where(chosen, BONDED, TOUCHABLE))
        if not len(edge):
            _refuse_crossings((outer, base), (_CORE, _CORE))
        if not len(edge) and _are_inside(base_points, outer):
            faces = base_faces if enclosed_volume(base) > 0 else base_faces[:, ::-1]
            into = base_points[faces]
            return _label(outer, into)
        raise ValueError("the base neither lies on the closed outer surface nor inside it; check frame and unit")
    if not len(edge):
        raise ValueError("the outer surface is open and the base is closed; close the outer surface, or cut the base")
    owner = nearest_points(base_points[base_faces].mean(axis=1), outer)[1]
    agreement = np.einsum(
        "fc,fc->f", normal_vectors(base_points[base_faces]), unit_vectors(normal_vectors(outer))[owner]
    ).sum()
    if agreement < 0:
        base_faces = base_faces[:, ::-1]
    into = base_points[base_faces]
    strip = _zip(outer_points, border, base_points, list_border(base_faces[:, ::-1], "the base")[:, :2])
    _refuse_crossings((outer_points[outer_faces], into, strip), (_SHEETS, _OUTLINES))
    shell = _label(outer_points[outer_faces], into, strip)
    if enclosed_volume(shell.surface) < 0:  # The given triangles of the outer surface faced the base; turn all around.
        return replace(shell, surface=shell.surface[:, ::-1])
    return shell


def _label(outer: FloatArray, into: FloatArray, strip: FloatArray | None = None) -> Shell:
    """Make a shell of an outer surface, a base that faces into the cover, and a strip between their borders."""
    groups = [outer, into[:, ::-1], *([] if strip is None else [strip])]
    label = np.repeat([TOUCHABLE, BONDED, TOUCHABLE][: len(groups)], [len(each) for each in groups])
    return Shell(surface=np.concatenate(groups), label=label)


def leave_out(shell: Shell, chosen: BoolArray) -> Shell:
    """Leave out the chosen triangles of a shell that are not bonded, so that no indenter touches them, shape (n,)."""
    return replace(shell, label=np.where(chosen & (shell.label == TOUCHABLE), LEFT_OUT, shell.label))


def _refuse_crossings(groups: tuple[FloatArray, ...], words: tuple[str, str]) -> None:
    """Refuse groups of triangles that cross each other: outer surface, base and the strip between their borders.

    Args:
        groups: Triangles of each group, shape (n, 3, 3) [m].
        words: Error message if the first two groups cross, and if the third crosses one of them or itself.

    Raises:
        ValueError: If groups cross, with the number of crossing pairs and the place of one of them.
    """
    triangles, group = np.concatenate(groups), np.repeat(np.arange(len(groups)), [len(each) for each in groups])
    pairs = np.array(sorted(find_crossings(triangles)), dtype=np.int64).reshape(-1, 2)
    one, other = group[pairs].min(axis=1), group[pairs].max(axis=1)
    for found, what in zip(((one == 0) & (other == 1), other == _STRIP), words, strict=True):
        if found.any():
            place = describe(triangles[pairs[found][0, 0]].mean(axis=0))
            raise ValueError(f"{what} ({int(found.sum())} pairs of triangles cross, as at ({place}) mm)")


def select_base(
    surface: FloatArray, base: FloatArray, *, distance: float | None = None, is_closed: bool = False
) -> BoolArray:
    """Find the triangles of a body's surface that lie on its base.

    Args:
        surface: Triangles of the closed surface, facing outwards, shape (n, 3, 3) [m].
        base: Triangles of the base, shape (b, 3, 3) [m].
        distance: Largest distance from the base; 1 % of the size if None [m].
        is_closed: Whether the base is the closed surface of a core; bonded triangles then face the core.

    Returns:
        Whether each triangle belongs to the base: its corners and its middle lie on it, shape (n,).
    """
    limit = _SIDES.on_base * float(np.ptp(surface, axis=(0, 1)).max()) if distance is None else distance
    points, faces = merge_corners(surface)
    middle = surface.mean(axis=1)
    near = np.linalg.norm(nearest_points(points, base)[0] - points, axis=1) <= limit
    at, owner = nearest_points(middle, base)
    chosen = near[faces].all(axis=1) & (np.linalg.norm(at - middle, axis=1) <= limit)
    if is_closed:
        facing = np.einsum("fc,fc->f", normal_vectors(surface), normal_vectors(base)[owner]) * enclosed_volume(base)
        chosen &= facing < 0
    return np.asarray(chosen)


def point_normals(points: FloatArray, faces: IntArray) -> FloatArray:
    """Compute unit normals at points, as angle-weighted means over their triangles, shape (p, 3) [-]."""
    corner = points[faces]
    normal = unit_vectors(normal_vectors(corner))
    out = np.zeros_like(points)
    for k in range(3):
        one, other = (unit_vectors(corner[:, (k + turn) % 3] - corner[:, k]) for turn in (1, 2))
        angle = np.arccos(np.clip(np.einsum("fc,fc->f", one, other), -1, 1))
        np.add.at(out, faces[:, k], angle[:, None] * normal)
    return unit_vectors(out)


def _refuse_cover(closed: FloatArray, thickness: float, name: str) -> None:
    """Refuse a closed surface that is no thicker than the cover that is wanted below it."""
    area = float(np.linalg.norm(normal_vectors(closed), axis=1).sum()) / 2
    across = 2 * enclosed_volume(closed) / area
    if 0 < across < _SIDES.cover * thickness:
        raise ValueError(
            f"{name} encloses a body that is only {1e3 * across:.2g} mm thick on average: this looks like the cover "
            "itself; give the surface to which it is bonded as base, and leave thickness out"
        )


def _check_outward(points: FloatArray, faces: IntArray, name: str) -> tuple[str, ...]:
    """Refuse a surface that faces inwards; return a note on the outside of a nearly flat surface."""
    area = normal_vectors(points[faces])
    away = points[faces].mean(axis=1) - points.mean(axis=0)
    mean = np.einsum("fc,fc->", area, away) / np.linalg.norm(area, axis=1).sum()
    size = float(np.ptp(points, axis=0).max())
    if mean < _SIDES.inwards * size:
        raise ValueError(
            f"{name} is inside out: its triangles face inwards; reverse its normals, or the rows of a grid; if it is "
            "hollow on the touched side, give its base instead of the thickness"
        )
    if mean > _SIDES.outwards * size:
        return ()
    normal = ", ".join(f"{round(each, 2) + 0.0:g}" for each in unit_vectors(area.sum(axis=0, keepdims=True))[0])
    sentence = (
        f"{name} hardly bends, so its outside follows from the order of its corners: it faces ({normal}); reverse the "
        "triangles, or the rows of a grid, if the base is on that side"
    )
    return (sentence,)


def _find_folds(points: FloatArray, moved: FloatArray, faces: IntArray, border: IntArray, *, inward: bool) -> BoolArray:
    """Return whether the offset of each triangle is inverted or crosses another triangle, shape (f,)."""
    before, after = unit_vectors(normal_vectors(points[faces])), unit_vectors(normal_vectors(moved[faces]))
    # The normal of a very thin triangle may differ much from the normal of the surface around it.  For such a triangle
    # the limit is lower: its offset may be turned as much as the triangle itself, but not much more.
    surface = unit_vectors(point_normals(points, faces)[faces].sum(axis=1))
    limit = np.minimum(_OFFSET.folded, np.einsum("fc,fc->f", before, surface) - _OFFSET.folded)
    out = np.einsum("fc,fc->f", surface, after) < limit
    if not out.any():  # The search for crossing triangles takes long and is made only if no triangle is inverted.
        outer, inner = (points, moved) if inward else (moved, points)
        count = len(faces)
        for pair in find_crossings(_close(outer, inner, faces, border)):
            out[[each % count for each in pair if each < 2 * count]] = True
    return np.asarray(out)


def _close(outer: FloatArray, inner: FloatArray, faces: IntArray, border: IntArray) -> FloatArray:
    """Join an outer and an inner surface, which have the same triangles, by a strip along their border.

    Returns:
        Triangles of the outer surface, then of the inner surface, then of the strip, shape (n, 3, 3) [m].
    """
    first, second = border.T
    strip = np.concatenate(
        [
            np.stack([outer[second], outer[first], inner[first]], axis=1),
            np.stack([outer[second], inner[first], inner[second]], axis=1),
        ]
    )
    return np.concatenate([outer[faces], inner[faces[:, ::-1]], strip])


def _smooth(step: FloatArray, near: list[list[int]], spots: set[int], *, rings: int) -> FloatArray:
    """Average the offset vectors of some points and their neighbours, to remove folds of an offset surface.

    An averaged vector keeps about the mean length of the vectors.

    Args:
        step: Offset vector of each of p points, shape (p, 3) [m].
        near: Indices of the neighbours of each point.
        spots: Indices of the points at folds.
        rings: Number of rings of neighbours that are averaged as well, and number of repetitions.
    """
    for _ in range(rings):
        spots = spots | {other for spot in spots for other in near[spot]}
    out = step.copy()
    for _ in range(rings):
        mean = {spot: out[[spot, *near[spot]]] for spot in spots}
        for spot, values in mean.items():
            length = np.linalg.norm(values, axis=1).mean()
            total = values.sum(axis=0)
            out[spot] = _OFFSET.kept * length * total / max(float(np.linalg.norm(total)), 1e-300)
    return out


def _list_neighbours(faces: IntArray, count: int) -> list[list[int]]:
    near: list[set[int]] = [set() for _ in range(count)]
    for face in faces.tolist():
        for point in face:
            near[point] |= {*face} - {point}
    return [sorted(each) for each in near]


def _zip(outer: FloatArray, border: IntArray, base: FloatArray, edge: IntArray) -> FloatArray:
    """Join the border of an outer surface and that of a base, which faces out of the body, by a strip of triangles."""
    one, other = outer[_order(border, "the outer surface")], base[_order(edge, "the base")][::-1]
    start = int(np.argmin(np.linalg.norm(other - one[0], axis=1)))
    one, other = np.concatenate([one, one[:1]]), np.roll(other, -start, axis=0)
    other = np.concatenate([other, other[:1]])
    i, j, out = 0, 0, []
    while i < len(one) - 1 or j < len(other) - 1:
        on_outer = j == len(other) - 1 or (
            i < len(one) - 1 and np.linalg.norm(one[i + 1] - other[j]) <= np.linalg.norm(one[i] - other[j + 1])
        )
        if on_outer:
            out.append([one[i + 1], one[i], other[j]])
            i += 1
        else:
            out.append([one[i], other[j], other[j + 1]])
            j += 1
    return np.array(out)


def _order(border: IntArray, name: str) -> IntArray:
    """Order the points of the border of a surface along the border, which must be one loop.

    Args:
        border: First and last point of each directed edge of the border, shape (k, 2).
        name: Name of the surface in messages.

    Raises:
        ValueError: If the border has several loops.
    """
    following = dict(border.tolist())
    loop = [int(border[0, 0])]
    while following[loop[-1]] != loop[0] and len(loop) <= len(border):
        loop.append(following[loop[-1]])
    if len(loop) != len(border):
        raise ValueError(f"{name} has several borders; close its holes, or give a closed surface")
    return np.array(loop)


def _are_inside(points: FloatArray, surface: FloatArray) -> bool:
    """Return whether points lie inside a closed surface, by the solid angles of its triangles."""
    for point in points[:: max(1, len(points) // 20)]:
        corner = surface - point
        length = np.linalg.norm(corner, axis=2)
        a, b, c = corner.transpose(1, 0, 2)
        volume = np.einsum("fc,fc->f", a, np.cross(b, c))
        scale = length.prod(axis=1)
        for k in range(3):
            scale += np.einsum("fc,fc->f", corner[:, k], corner[:, (k + 1) % 3]) * length[:, (k + 2) % 3]
        if np.abs(2 * np.arctan2(volume, scale).sum()) / (4 * np.pi) < _SIDES.inside:
            return False
    return True
