"""Convex hulls that make up the underside of a body.

Only what can be seen from below matters to contact with a cover, so everything over the underside counts as solid.  The
underside is cut by upright planes, each time where the hull of a piece fills most that is empty, until the hulls are
close enough.  Cutting keeps every facet that is not cut: where the underside is convex, the hull is exact.
"""

from __future__ import annotations

import heapq
import logging
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.surfaces.gap import Underside, facing_down

FloatArray = npt.NDArray[np.float64]

_LOG = logging.getLogger(__name__)

#: Depth of what hulls may fill wrongly, over the larger half width of the body; and hulls at most.
TOLERANCE, MOST_HULLS = 5e-3, 64
#: Corners of a hull at most; and the share of directions that point down in which outermost corners are looked for.
MOST_CORNERS, _DOWN = 1000, 0.8
#: Points along the longer side at which hull and body are compared.
_POINTS = 97
#: Heights at which distances along the cover are known.
_LEVELS = 16
#: Directions of cuts that are tried [rad].
_TURNS = tuple(np.arange(4) * np.pi / 4)
#: Upward component of a unit normal below which a face stands upright [-].
_UPRIGHT = 1e-6


def convex_hulls(triangles: FloatArray) -> list[FloatArray]:
    """Corners of convex hulls that make up the underside of a body, shape (k, 3) each [m].

    A hull of more than `MOST_CORNERS` is left with those that are outermost in as many directions, most of them
    downwards: of a ball about a thousandth of its radius is lost between them.

    Args:
        triangles: Closed surface, each triangle counterclockwise as seen from outside, shape (n, 3, 3) [m].

    Raises:
        ModuleNotFoundError: If trimesh is not installed.
    """
    lower = facing_down(triangles)
    seen = _Seen.of(lower, top=1.01 * float(triangles[..., 2].max()))
    pieces = [(-whole.volume, 0, whole) for whole in [_Piece.of(lower, seen)] if whole is not None]
    if pieces[0][2].fault <= seen.tolerance:
        return [_thinned(np.unique(triangles.reshape(-1, 3), axis=0))]
    made = 1
    done: list[_Piece] = []
    while pieces and len(pieces) + len(done) < MOST_HULLS:
        _, _, piece = heapq.heappop(pieces)
        halves = piece.cut(seen) if piece.fault > seen.tolerance else None
        if halves is None:
            done.append(piece)
            continue
        for half in halves:
            made += 1
            heapq.heappush(pieces, (-half.volume, made, half))
    found = [*done, *(piece for _, _, piece in pieces)]
    worst = max(piece.fault for piece in found)
    if worst > seen.tolerance:
        _LOG.warning(
            "%d hulls of the body from a file fill up to %.2g mm of what is empty under it: the fast model takes that "
            "for solid; the reference does not",
            len(found),
            1e3 * worst,
        )
    return [_thinned(piece.hull) for piece in found]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """The underside at points of a grid.

    Attributes:
        x: Positions, shape (n,) [m].
        y: Positions, shape (n,) [m].
        gap: Height of the underside, that of the top where there is none, shape (n,) [m].
        levels: Heights, shape (k,) [m].
        beside: Distance along the cover to where the underside is as low as each level, less one step of the grid,
            shape (k, n) [m].
        top: Height up to which everything over the underside counts as solid [m].
        step: Distance between points of the grid [m].
        tolerance: Depth that hulls may fill wrongly [m].
    """

    x: FloatArray
    y: FloatArray
    gap: FloatArray
    levels: FloatArray
    beside: FloatArray
    top: float
    step: float
    tolerance: float

    @classmethod
    def of(cls, lower: FloatArray, *, top: float) -> _Seen:
        flat = lower[..., :2].reshape(-1, 2)
        low, span = flat.min(axis=0), np.ptp(flat, axis=0)
        count = np.maximum(5, np.round(_POINTS * span / span.max())).astype(int)
        # off the round numbers at which edges stand
        axes = [low[i] + (np.arange(count[i]) + 0.517) / (count[i] + 0.034) * span[i] for i in range(2)]
        x, y = np.meshgrid(*axes)
        gap = Underside(lower).height(x.ravel(), y.ravel()).reshape(x.shape)
        levels = np.linspace(0, gap[np.isfinite(gap)].max(), _LEVELS)
        beside = np.array([_distance(gap <= level, *axes) for level in levels])
        return cls(
            x=x.ravel(),
            y=y.ravel(),
            gap=np.where(np.isfinite(gap), gap, top).ravel(),
            levels=levels,
            beside=np.maximum(beside - float((span / count).max()), 0).reshape(_LEVELS, -1),
            top=top,
            step=float((span / count).max()),
            tolerance=TOLERANCE * float(span.max() / 2),
        )

    def depth(self, hull: FloatArray) -> FloatArray:
        """How deep a hull of this height fills what is empty, zero where there is no hull, shape (n,) [m]."""
        there = np.isfinite(hull)
        height = np.where(there, hull, 0.0)
        away = np.hypot(self.beside, np.maximum(self.levels[:, None] - height, 0)).min(axis=0)
        return np.where(there, np.minimum(self.gap - height, away), 0.0)

    def before_wall(self, point: int, height: float) -> FloatArray:
        """Just before the nearest place to a point where the underside is as low as `height`, shape (2,) [m]."""
        low = np.flatnonzero(self.gap <= height + self.tolerance)
        if not len(low):
            return np.array([self.x[point], self.y[point]])
        away = np.hypot(self.x[low] - self.x[point], self.y[low] - self.y[point])
        near = low[away.argmin()]
        # one step of the grid before the wall, so that nothing of it is left on this side
        step = min(1.0, self.step / away.min()) if away.min() else 0.0
        return np.array([v[near] + step * (v[point] - v[near]) for v in (self.x, self.y)])


def _distance(where: npt.NDArray[np.bool_], x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance of each point of a grid (rows, columns) from the nearest marked one, inf if there is none [m]."""
    squared = np.where(where[None], ((y[:, None] - y) ** 2)[..., None], np.inf).min(axis=1)
    return np.asarray(np.sqrt((squared[:, None, :] + ((x[:, None] - x) ** 2)[None]).min(axis=2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Piece:
    """Part of the underside and the hull of all that is over it.

    Attributes:
        triangles: The part, shape (n, 3, 3) [m].
        hull: Corners of the hull, shape (k, 3) [m].
        fault: How deep the hull fills what is empty, at most [m].
        volume: Sum over the grid of how much deeper than the tolerance it does [m].
        place: Where it does so most, shape (2,) [m].
        wall: Just before the nearest place where the underside is as low as the hull, shape (2,) [m].
    """

    triangles: FloatArray
    hull: FloatArray
    fault: float
    volume: float
    place: FloatArray
    wall: FloatArray

    @classmethod
    def of(cls, triangles: FloatArray, seen: _Seen) -> _Piece | None:
        """None where too little is left to have a volume."""
        from trimesh.convex import convex_hull

        points = np.unique(triangles.reshape(-1, 3), axis=0)
        raised = points.copy()
        raised[:, 2] = seen.top
        if not len(points) or np.ptp(points[:, :2], axis=0).min() <= 1e-3 * seen.tolerance:
            return None
        try:
            hull = convex_hull(np.concatenate([points, raised]))
        except Exception:  # noqa: BLE001 -- qhull on what is flat
            return None
        floor = np.asarray(hull.face_normals)[:, 2] < -_UPRIGHT
        height = Underside(np.asarray(hull.triangles)[floor]).height(seen.x, seen.y)
        excess = seen.depth(height)
        worst = int(excess.argmax())
        return cls(
            triangles=triangles,
            hull=np.array(hull.vertices),
            fault=float(excess[worst]),
            volume=float(np.maximum(excess - seen.tolerance, 0).sum()),
            place=np.array([seen.x[worst], seen.y[worst]]),
            wall=seen.before_wall(worst, float(height[worst])),
        )

    def cut(self, seen: _Seen) -> tuple[_Piece, _Piece] | None:
        """Both halves of the best cut through the worst place, or along the wall beside it; None where no cut helps."""
        best: tuple[_Piece, _Piece] | None = None
        least = np.inf
        cuts = [(np.array([np.cos(turn), np.sin(turn)]), self.place) for turn in _TURNS]
        for normal, place in [*cuts, (self.place - self.wall, self.wall)]:
            left, right = (_Piece.of(_sliced(self.triangles, s * normal, place), seen) for s in (1, -1))
            if left is not None and right is not None and (score := left.volume + right.volume) < least:
                best, least = (left, right), score
        return best


def _thinned(corners: FloatArray) -> FloatArray:
    """The outermost corners in many directions, which lie along a spiral on the unit sphere."""
    if len(corners) <= MOST_CORNERS:
        return corners
    share = np.arange(MOST_CORNERS) / (MOST_CORNERS - 1)
    z = np.where(share < _DOWN, share / _DOWN - 1, (share - _DOWN) / (1 - _DOWN))
    turn = np.arange(MOST_CORNERS) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z])
    middle = corners.mean(axis=0)
    return np.asarray(corners[np.unique(((corners - middle) @ directions).argmax(axis=0))])


def _sliced(triangles: FloatArray, normal: FloatArray, place: FloatArray) -> FloatArray:
    """The part of triangles on the side of an upright plane that its normal points to, shape (m, 3, 3) [m]."""
    from trimesh.intersections import slice_faces_plane

    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    points, kept, _ = slice_faces_plane(  # type: ignore[no-untyped-call]
        triangles.reshape(-1, 3), faces, plane_normal=[*normal, 0.0], plane_origin=[*place, 0.0]
    )
    return np.asarray(points[kept], dtype=np.float64).reshape(-1, 3, 3)
