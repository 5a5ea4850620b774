"""Approximation of the underside of a body by convex hulls, because MuJoCo only collides convex solids.

Only the underside of a body touches a cover, so the space above the underside, up to the body's top, counts as solid.
Vertical planes cut the underside into pieces; each piece is replaced by the convex hull of the piece and of the space
above the piece.  Where a hull reaches below the body's underside, the hull fills empty space, and the distance by which
it does so is the error.  The piece with the largest error is cut again, until the error is within a tolerance.  A cut
does not move the rest of the surface: where the underside is convex, the hull is exact.
"""

from __future__ import annotations

import heapq
import logging
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.surfaces.gap import TriangleGap, select_facing_down

FloatArray = npt.NDArray[np.float64]

_LOG = logging.getLogger(__name__)

#: Largest accepted distance between the lower surface of a hull and the body, over half the longer edge of the body's
#: bounding rectangle [-].
TOLERANCE = 5e-3
#: Largest number of hulls of a body: each hull becomes a geom in MuJoCo, whose contacts take computing time [-].
MOST_HULLS = 64
#: Largest number of corners of a hull: MuJoCo's collision detection becomes slower with more corners [-].
MOST_CORNERS = 1000
#: Of the directions in which the outermost corner of a hull is kept, the share of directions that point down; most of
#: them do, because only the lower surface touches the cover [-].
_DOWNWARD = 0.8
#: Number of grid points along the longer edge of the body's bounding rectangle; at the grid points the heights of hulls
#: and body are compared [-].
_POINTS = 97
#: Distance of the first grid point from the edge of the body's bounding rectangle, in grid steps.  A number that is not
#: round keeps grid lines from coinciding with edges of the body [-].
_OFFSET = 0.517
#: Number of heights for which the horizontal distance from each grid point to the body is tabulated [-].
_LEVELS = 16
#: Angles between the x axis and the normals of the vertical planes that are tried as cuts [rad].
_CUT_ANGLES = tuple(np.arange(4) * np.pi / 4)
#: Vertical component of a triangle's unit normal below which the triangle counts as vertical [-].
_UPRIGHT = 1e-6
#: Width below which a piece of the underside counts as too narrow for a hull, over the largest accepted distance
#: between a hull and the body [-].
_NARROW = 1e-3


def split_into_hulls(triangles: FloatArray) -> list[FloatArray]:
    """Find convex hulls whose union has the underside of a body, within a tolerance.

    A warning is logged if the error of `MOST_HULLS` hulls exceeds the tolerance.  Of a hull of more than `MOST_CORNERS`
    corners only the outermost corners are kept, most of them on the underside of the hull; the hull of a sphere then
    lies up to about a thousandth of the radius inside the sphere.

    Args:
        triangles: Corners of the n triangles of a closed surface, each counterclockwise as seen from outside, shape
            (n, 3, 3) [m].

    Returns:
        Corners of each hull, shape (k, 3) for k corners [m].

    Raises:
        ModuleNotFoundError: If trimesh is not installed.
    """
    lower = select_facing_down(triangles)
    underside = _Underside.sample(lower, top=1.01 * float(triangles[..., 2].max()))
    whole = _Piece.make(lower, underside)
    if whole is None or whole.error <= underside.tolerance:
        return [_keep_outermost(np.unique(triangles.reshape(-1, 3), axis=0))]
    made = 0
    queue = [(-whole.excess, made, whole)]
    done: list[_Piece] = []
    while queue and len(queue) + len(done) < MOST_HULLS:
        _, _, piece = heapq.heappop(queue)
        halves = piece.cut(underside) if piece.error > underside.tolerance else None
        if halves is None:
            done.append(piece)
            continue
        for half in halves:
            made += 1
            heapq.heappush(queue, (-half.excess, made, half))
    pieces = [*done, *(piece for _, _, piece in queue)]
    worst = max(piece.error for piece in pieces)
    if worst > underside.tolerance:
        _LOG.warning(
            "%d hulls of the body from a file fill up to %.2g mm of what is empty under it: the fast model takes that "
            "for solid; the reference does not",
            len(pieces),
            1e3 * worst,
        )
    return [_keep_outermost(piece.hull) for piece in pieces]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Underside:
    """The underside of a body, sampled at the n points of a horizontal grid.

    Attributes:
        x: x coordinates of the grid points, shape (n,) [m].
        y: y coordinates of the grid points, shape (n,) [m].
        height: Height of the underside over each grid point; `top` beside the body, shape (n,) [m].
        levels: The k heights for which horizontal distances are tabulated, shape (k,) [m].
        beside: Horizontal distance from each grid point to the nearest grid point over which the underside is no higher
            than each of the k heights, less one grid step, shape (k, n) [m].
        top: Height up to which the space above the underside counts as solid [m].
        step: Distance between neighbouring grid points [m].
        tolerance: Largest accepted distance between a hull and the body [m].
    """

    x: FloatArray
    y: FloatArray
    height: FloatArray
    levels: FloatArray
    beside: FloatArray
    top: float
    step: float
    tolerance: float

    @classmethod
    def sample(cls, lower: FloatArray, *, top: float) -> _Underside:
        """Sample the underside of a body at the points of a grid.

        Args:
            lower: Corners of the triangles that face down, shape (n, 3, 3) [m].
            top: Height up to which the space above the underside counts as solid [m].
        """
        flat = lower[..., :2].reshape(-1, 2)
        low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
        count = np.maximum(5, np.round(_POINTS * extent / extent.max())).astype(int)
        axes = [low[i] + (np.arange(count[i]) + _OFFSET) / (count[i] + 2 * _OFFSET - 1) * extent[i] for i in range(2)]
        x, y = (values.ravel() for values in np.meshgrid(*axes))
        height = TriangleGap(lower).evaluate(x, y)
        levels = np.linspace(0, height[np.isfinite(height)].max(), _LEVELS)
        grid = height.reshape(len(axes[1]), len(axes[0]))
        step = float((extent / count).max())
        beside = np.array([_measure_distance(grid <= level, *axes) for level in levels])
        return cls(
            x=x,
            y=y,
            height=np.where(np.isfinite(height), height, top),
            levels=levels,
            beside=np.maximum(beside - step, 0).reshape(_LEVELS, -1),
            top=top,
            step=step,
            tolerance=TOLERANCE * float(extent.max() / 2),
        )

    def measure_error(self, hull: FloatArray) -> FloatArray:
        """Return the distance between the lower surface of a hull and the body, where the hull fills empty space.

        The distance is the smaller of two: vertically up to the body, and sideways to the nearest part of the body.

        Args:
            hull: Height of the hull's lower surface over each of n grid points, inf beside the hull, shape (n,) [m].

        Returns:
            Distances at the grid points, zero beside the hull, shape (n,) [m].
        """
        exists = np.isfinite(hull)
        height = np.where(exists, hull, 0.0)
        sideways = np.hypot(self.beside, np.maximum(self.levels[:, None] - height, 0)).min(axis=0)
        return np.where(exists, np.minimum(self.height - height, sideways), 0.0)

    def find_wall(self, point: int, height: float) -> FloatArray:
        """Find the place beside a grid point where the underside has come down to a given height.

        Args:
            point: Index of the grid point.
            height: Height of the underside to look for [m].

        Returns:
            Position (x, y) one grid step before the nearest grid point at which the underside is as low as `height`;
            the grid point itself if there is none, shape (2,) [m].
        """
        low = np.flatnonzero(self.height <= height + self.tolerance)
        if not len(low):
            return np.array([self.x[point], self.y[point]])
        distance = np.hypot(self.x[low] - self.x[point], self.y[low] - self.y[point])
        nearest = low[distance.argmin()]
        # One grid step before the wall: a cut at this place leaves the wall on the other side of the cut, away from the
        # grid point.
        step = min(1.0, self.step / distance.min()) if distance.min() else 0.0
        return np.array([v[nearest] + step * (v[point] - v[nearest]) for v in (self.x, self.y)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Piece:
    """A piece of the underside of a body, and the convex hull of the piece and of the space above the piece.

    Attributes:
        triangles: Corners of the n triangles of the piece, shape (n, 3, 3) [m].
        hull: The k corners of the hull, shape (k, 3) [m].
        error: Largest distance between the lower surface of the hull and the body over the grid points [m].
        excess: Sum over the grid points of the part of this distance that exceeds the tolerance; the piece with the
            largest sum is cut first [m].
        worst: Position (x, y) of the largest distance, shape (2,) [m].
        wall: Position (x, y) just before the nearest place where the underside of the body is as low as the hull is at
            `worst`, shape (2,) [m].
    """

    triangles: FloatArray
    hull: FloatArray
    error: float
    excess: float
    worst: FloatArray
    wall: FloatArray

    @classmethod
    def make(cls, triangles: FloatArray, underside: _Underside) -> _Piece | None:
        """Make a piece of the given triangles (n, 3, 3); None if they are too narrow for a hull with a volume."""
        from trimesh.convex import convex_hull

        points = np.unique(triangles.reshape(-1, 3), axis=0)
        raised = points.copy()
        raised[:, 2] = underside.top
        if not len(points) or np.ptp(points[:, :2], axis=0).min() <= _NARROW * underside.tolerance:
            return None
        try:
            hull = convex_hull(np.concatenate([points, raised]))
        except Exception:  # noqa: BLE001 -- qhull fails on nearly flat points with errors of several types
            return None
        floor = np.asarray(hull.face_normals)[:, 2] < -_UPRIGHT
        height = TriangleGap(np.asarray(hull.triangles)[floor]).evaluate(underside.x, underside.y)
        error = underside.measure_error(height)
        worst = int(error.argmax())
        return cls(
            triangles=triangles,
            hull=np.array(hull.vertices),
            error=float(error[worst]),
            excess=float(np.maximum(error - underside.tolerance, 0).sum()),
            worst=np.array([underside.x[worst], underside.y[worst]]),
            wall=underside.find_wall(worst, float(height[worst])),
        )

    def cut(self, underside: _Underside) -> tuple[_Piece, _Piece] | None:
        """Cut the piece in two along a vertical plane, the best of several.

        The planes tried go through the place of the largest error, at several angles, and through `wall`.

        Returns:
            The two halves with the least sum of `excess`; None if no cut leaves two halves with a volume.
        """
        best: tuple[_Piece, _Piece] | None = None
        least = np.inf
        cuts = [(np.array([np.cos(angle), np.sin(angle)]), self.worst) for angle in _CUT_ANGLES]
        for normal, place in [*cuts, (self.worst - self.wall, self.wall)]:
            left, right = (_Piece.make(_clip(self.triangles, s * normal, place), underside) for s in (1, -1))
            if left is not None and right is not None and (sum_of_both := left.excess + right.excess) < least:
                best, least = (left, right), sum_of_both
        return best


def _measure_distance(marked: npt.NDArray[np.bool_], x: FloatArray, y: FloatArray) -> FloatArray:
    """Compute the distance of every point of a grid from the nearest marked grid point.

    Args:
        marked: Whether each grid point is marked, shape (rows, columns).
        x: Positions of the columns, shape (columns,) [m].
        y: Positions of the rows, shape (rows,) [m].

    Returns:
        Distances; inf if no point is marked, shape (rows, columns) [m].
    """
    squared = np.where(marked[None], ((y[:, None] - y) ** 2)[..., None], np.inf).min(axis=1)
    return np.asarray(np.sqrt((squared[:, None, :] + ((x[:, None] - x) ** 2)[None]).min(axis=2)))


def _clip(triangles: FloatArray, normal: FloatArray, place: FloatArray) -> FloatArray:
    """Clip triangles by a vertical plane, and keep the side to which the plane's normal points.

    Args:
        triangles: Corners of n triangles, shape (n, 3, 3) [m].
        normal: Horizontal components (x, y) of the plane's normal, of any length, shape (2,).
        place: Horizontal position (x, y) of a point of the plane, shape (2,) [m].

    Returns:
        Corners of the m triangles that make up the kept part, shape (m, 3, 3) [m].
    """
    from trimesh.intersections import slice_faces_plane

    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    points, kept, _ = slice_faces_plane(  # type: ignore[no-untyped-call]
        triangles.reshape(-1, 3), faces, plane_normal=[*normal, 0.0], plane_origin=[*place, 0.0]
    )
    return np.asarray(points[kept], dtype=np.float64).reshape(-1, 3, 3)


def _keep_outermost(corners: FloatArray) -> FloatArray:
    """Reduce the corners of a hull to the outermost ones in `MOST_CORNERS` directions along a spiral on a sphere.

    Args:
        corners: Corners of the hull, shape (n, 3) [m].

    Returns:
        All n corners if there are no more than `MOST_CORNERS`; else some of them, shape (k, 3) [m].
    """
    if len(corners) <= MOST_CORNERS:
        return corners
    share = np.arange(MOST_CORNERS) / (MOST_CORNERS - 1)
    z = np.where(share < _DOWNWARD, share / _DOWNWARD - 1, (share - _DOWNWARD) / (1 - _DOWNWARD))
    # Turns by the golden angle from one direction to the next distribute the directions evenly over the sphere.
    turn = np.arange(MOST_CORNERS) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z])
    return np.asarray(corners[np.unique(((corners - corners.mean(axis=0)) @ directions).argmax(axis=0))])
