"""Convex hulls that make up the underside of a body.

Only the underside of a body touches a cover, so everything above the underside counts as solid.  The underside is cut
into pieces by vertical planes, and each piece gets the convex hull of itself and of all that is above it.  Where a hull
reaches below the body's underside, it fills empty space.  The piece whose hull does so most is cut again, until the
error is within a tolerance.  A cut leaves the other triangles as they are: where the underside is convex, the hull is
exact.
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

#: Largest accepted distance between a hull and the body, over the larger half width of the body [-].
TOLERANCE = 5e-3
#: Most hulls of a body: each becomes a geom, whose contacts cost time in the simulation [-].
MOST_HULLS = 64
#: Most corners of a hull: MuJoCo's collision detection slows down with their number [-].
MOST_CORNERS = 1000
#: Share of downward ones among the directions in which the outermost corners of a hull are kept [-].
_DOWNWARD = 0.8
#: Grid points along the longer side of the body at which hulls and body are compared [-].
_POINTS = 97
#: Position of the first grid point, in grid steps from the edge of the body.  It is no round number, so that grid lines
#: do not coincide with edges of the body [-].
_OFFSET = 0.517
#: Heights of the body for which horizontal distances are tabulated [-].
_LEVELS = 16
#: Directions of the normals of cuts that are tried [rad].
_CUT_ANGLES = tuple(np.arange(4) * np.pi / 4)
#: Vertical component of a face's unit normal below which the face counts as upright [-].
_UPRIGHT = 1e-6
#: Width below which a piece counts as flat, over the tolerance [-].
_NARROW = 1e-3


def split_into_hulls(triangles: FloatArray) -> list[FloatArray]:
    """Find convex hulls that make up the underside of a body.

    A warning is logged if `MOST_HULLS` do not reach the tolerance.  Of a hull of more than `MOST_CORNERS` only the
    outermost corners are kept, most of them on its underside; a sphere then loses about a thousandth of its radius
    between them.

    Args:
        triangles: Closed surface, each triangle counterclockwise as seen from outside, shape (n, 3, 3) [m].

    Returns:
        Corners of each hull, shape (k, 3) [m].

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
    """The underside of a body, sampled at the points of a grid.

    Attributes:
        x: Positions, shape (n,) [m].
        y: Positions, shape (n,) [m].
        height: Height of the underside; `top` beside the body, shape (n,) [m].
        levels: Heights at which horizontal distances are tabulated, shape (k,) [m].
        beside: Horizontal distance from each point to where the underside is no higher than each level, less one grid
            step, shape (k, n) [m].
        top: Height up to which everything above the underside counts as solid [m].
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
        """Sample the triangles that face down (n, 3, 3)."""
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
        """Distance from the lower surface of a hull up to the body, where the hull fills empty space.

        It is the smaller of the vertical distance and the distance to the nearest part of the body beside the point.

        Args:
            hull: Height of the hull's lower surface at each point, inf beside the hull, shape (n,) [m].

        Returns:
            Distances, zero beside the hull, shape (n,) [m].
        """
        exists = np.isfinite(hull)
        height = np.where(exists, hull, 0.0)
        sideways = np.hypot(self.beside, np.maximum(self.levels[:, None] - height, 0)).min(axis=0)
        return np.where(exists, np.minimum(self.height - height, sideways), 0.0)

    def find_wall(self, point: int, height: float) -> FloatArray:
        """Place one grid step before the nearest point where the underside is as low as `height`, shape (2,) [m].

        Args:
            point: Index of the grid point from which to look.
            height: Height [m].
        """
        low = np.flatnonzero(self.height <= height + self.tolerance)
        if not len(low):
            return np.array([self.x[point], self.y[point]])
        distance = np.hypot(self.x[low] - self.x[point], self.y[low] - self.y[point])
        nearest = low[distance.argmin()]
        # A cut at this place leaves nothing of the wall on the side of the point.
        step = min(1.0, self.step / distance.min()) if distance.min() else 0.0
        return np.array([v[nearest] + step * (v[point] - v[nearest]) for v in (self.x, self.y)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Piece:
    """A piece of the underside, and the hull of it and of all that is above it.

    Attributes:
        triangles: Triangles of the piece, shape (n, 3, 3) [m].
        hull: Corners of the hull, shape (k, 3) [m].
        error: Largest distance between hull and body [m].
        excess: Sum over the grid of how far the distance exceeds the tolerance; the largest is cut first [m].
        worst: Position of the largest distance, shape (2,) [m].
        wall: Position before the nearest place where the underside is as low as the hull is there, shape (2,) [m].
    """

    triangles: FloatArray
    hull: FloatArray
    error: float
    excess: float
    worst: FloatArray
    wall: FloatArray

    @classmethod
    def make(cls, triangles: FloatArray, underside: _Underside) -> _Piece | None:
        """Make a piece of triangles; None if they are too narrow for a hull with a volume."""
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
        """Try several cuts, through the place of the largest error or along the wall; return the halves of the best.

        None if no cut leaves two halves with a volume.
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
    """Distance of each point of a grid (rows, columns) from the nearest marked point; inf if none is marked [m]."""
    squared = np.where(marked[None], ((y[:, None] - y) ** 2)[..., None], np.inf).min(axis=1)
    return np.asarray(np.sqrt((squared[:, None, :] + ((x[:, None] - x) ** 2)[None]).min(axis=2)))


def _clip(triangles: FloatArray, normal: FloatArray, place: FloatArray) -> FloatArray:
    """The part of triangles on one side of a vertical plane, the side to which its normal points.

    Args:
        triangles: Shape (n, 3, 3) [m].
        normal: Horizontal normal of the plane, of any length, shape (2,).
        place: A point of the plane, shape (2,) [m].

    Returns:
        Triangles, shape (m, 3, 3) [m].
    """
    from trimesh.intersections import slice_faces_plane

    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    points, kept, _ = slice_faces_plane(  # type: ignore[no-untyped-call]
        triangles.reshape(-1, 3), faces, plane_normal=[*normal, 0.0], plane_origin=[*place, 0.0]
    )
    return np.asarray(points[kept], dtype=np.float64).reshape(-1, 3, 3)


def _keep_outermost(corners: FloatArray) -> FloatArray:
    """Of too many corners (n, 3), those that are outermost in `MOST_CORNERS` directions along a spiral."""
    if len(corners) <= MOST_CORNERS:
        return corners
    share = np.arange(MOST_CORNERS) / (MOST_CORNERS - 1)
    z = np.where(share < _DOWNWARD, share / _DOWNWARD - 1, (share - _DOWNWARD) / (1 - _DOWNWARD))
    turn = np.arange(MOST_CORNERS) * np.pi * (3 - np.sqrt(5))  # the golden angle spreads the directions evenly
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z])
    return np.asarray(corners[np.unique(((corners - corners.mean(axis=0)) @ directions).argmax(axis=0))])
