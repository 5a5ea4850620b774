"""Underside of a body of triangles: its height over points of a plane, and convex hulls that approximate it.

MuJoCo only collides convex solids.  Only the underside of a body touches a cover, so the space above the underside, up
to the body's top, counts as solid.  Vertical planes cut the underside into pieces; each piece is replaced by the convex
hull of the piece and of the space above the piece.  Where a hull reaches below the body's underside, the hull fills
empty space, and the distance by which it does so is the error.  The piece with the largest error is cut again, until
the error is within a tolerance.  A cut does not move the rest of the surface: where the underside is convex, the hull
is exact.
"""

from __future__ import annotations

import heapq
import logging
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshes.array_types import FloatArray, IntArray

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class _GapNumbers:
    """Numbers of the search for the lowest triangle over a point."""

    #: Length that counts as zero, over the larger edge of the bounding box [-]; rounding in double precision.
    zero: float = 1e-12
    #: Most pairs of a point and a triangle that are computed at once [-]; they take about 200 MB.
    most_pairs: int = 2_000_000
    #: Most cells along the longer side of the search grid [-]; more cells hardly save time, as measured.
    most_cells: int = 256
    #: Largest mean number of grid cells that list a triangle [-]; chosen: long triangles take a coarser grid.
    most_entries: int = 30


@dataclass(frozen=True, kw_only=True)
class HullNumbers:
    """Numbers of the approximation by convex hulls."""

    #: Largest distance of a hull from the body, over half the longer edge of the bounding rectangle [-]; chosen.
    tolerance: float = 5e-3
    #: Most hulls of a body [-]; each is a geom of MuJoCo, whose contacts take computing time.
    most: int = 64
    #: Most corners of a hull [-]; MuJoCo's collision detection becomes slower with more.
    most_corners: int = 1000
    #: Share of the directions of the kept corners that point down [-]; chosen: only the lower surface touches.
    downward: float = 0.8
    #: Grid points along the longer edge of the bounding rectangle, where hull and body are compared [-]; chosen.
    points: int = 97
    #: Distance of the first grid point from the edge, in steps [-]; not round, to keep grid lines off the body's edges.
    offset: float = 0.517
    #: Number of heights for which the horizontal distance to the body is tabulated [-]; chosen.
    levels: int = 16
    #: Angles between the x axis and the normals of the vertical planes that are tried as cuts [rad]; chosen.
    cut_angles: tuple[float, ...] = (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4)
    #: Vertical component of a unit normal below which a triangle counts as vertical [-]; rounding of qhull.
    upright: float = 1e-6
    #: Width below which a piece gets no hull, over the largest accepted distance [-]; chosen.
    narrow: float = 1e-3


_GAP, HULLS = _GapNumbers(), HullNumbers()


def select_facing_down(triangles: FloatArray) -> FloatArray:
    """Select the triangles whose outer side faces down; vertical triangles are left out.

    Args:
        triangles: Corners of n triangles, counterclockwise as seen from outside the body, shape (n, 3, 3) [m].

    Returns:
        Corners of the m triangles that face down, shape (m, 3, 3) [m].
    """
    (ax, ay), (bx, by) = (triangles[:, k, :2].T - triangles[:, 0, :2].T for k in (1, 2))
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    return np.asarray(triangles[ax * by - ay * bx < -_GAP.zero * size**2])


def compute_volume(triangles: FloatArray) -> float:
    """Compute the volume that a closed surface of triangles encloses, by the divergence theorem.

    Args:
        triangles: Corners of n triangles, counterclockwise as seen from outside the body, shape (n, 3, 3) [m].

    Returns:
        The volume; negative if the triangles face inwards [m3].
    """
    corners = triangles - triangles[0, 0]
    return float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


class TriangleGap:
    """Finds the height of the lowest triangle over each point, for triangles that face down.

    A search grid over the triangles' bounding rectangle lists for each of its cells the triangles that may cross the
    cell, so that a point is compared only with the triangles of the cell in which it lies.

    Args:
        triangles: Corners of n triangles that face down, none of them vertical, shape (n, 3, 3) [m].
    """

    def __init__(self, triangles: FloatArray) -> None:
        flat = triangles[..., :2]
        extent = np.ptp(flat, axis=(0, 1))
        self._tolerance = _GAP.zero * float(extent.max())
        self._low = flat.min(axis=(0, 1))
        self._count, self._cell = self._choose_cells(flat, extent)
        self._members, self._start = self._list_members(flat)
        self._plane, self._sides = _describe_planes(triangles), _describe_sides(flat)
        self._lowest, self._highest = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)

    def evaluate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lowest triangle over each of m points; inf where no triangle is over the point.

        Args:
            x: x coordinates of the points, shape (m,) [m].
            y: y coordinates of the points, shape (m,) [m].

        Returns:
            Heights, shape (m,) [m].
        """
        heights = np.full(x.shape, np.inf)
        points = np.column_stack([x, y])
        high = self._low + self._count * self._cell
        within = (points >= self._low - self._tolerance) & (points <= high + self._tolerance)
        index = np.flatnonzero(within.all(axis=1))
        cell = self._find_cells(points[index]) @ np.array([1, self._count[0]])
        members = self._start[cell + 1] - self._start[cell]
        index, cell, members = index[members > 0], cell[members > 0], members[members > 0]
        blocks = np.flatnonzero(np.diff(np.cumsum(members) // _GAP.most_pairs)) + 1
        for part in np.split(np.arange(len(index)), blocks):
            if len(part):
                start = self._start[cell[part]]
                heights[index[part]] = self._find_lowest(points[index[part]], start, members[part])
        return heights

    def _choose_cells(self, flat: FloatArray, extent: FloatArray) -> tuple[IntArray, FloatArray]:
        """Choose the search grid: about as many cells as triangles, or fewer if the triangles are long.

        Args:
            flat: Corners of the triangles without their heights, shape (n, 3, 2) [m].
            extent: Edge lengths of the triangles' bounding rectangle, shape (2,) [m].

        Returns:
            Numbers of cells along x and y, and edge lengths of a cell along x and y, shape (2,) each.
        """
        boxes = np.ptp(flat, axis=1)
        along_longer = float(min(_GAP.most_cells, max(1, np.sqrt(len(flat)))))
        while True:
            count = np.maximum(1, np.ceil(along_longer * extent / extent.max())).astype(np.int64)
            cell = extent / count
            if along_longer <= 1 or np.prod(boxes / cell + 1, axis=1).sum() < _GAP.most_entries * len(flat):
                return count, cell
            along_longer /= 2

    def _list_members(self, flat: FloatArray) -> tuple[IntArray, IntArray]:
        """List for each cell of the search grid the triangles whose bounding rectangle touches the cell.

        Returns:
            Indices of triangles, cell after cell; and for each cell the place in this list where its triangles start.
        """
        first, last = self._find_cells(flat.min(axis=1)), self._find_cells(flat.max(axis=1))
        wide, high = (last - first + 1).T
        triangle = np.repeat(np.arange(len(flat)), wide * high)
        offset = np.arange(len(triangle)) - np.repeat(np.cumsum(wide * high) - wide * high, wide * high)
        column = first[triangle, 0] + offset % wide[triangle]
        row = first[triangle, 1] + offset // wide[triangle]
        cell = row * self._count[0] + column
        order = np.argsort(cell, kind="stable")
        return triangle[order], np.searchsorted(cell[order], np.arange(self._count.prod() + 1))

    def _find_cells(self, points: FloatArray) -> IntArray:
        """Return the column and row of the grid cell in which each of m points lies, shape (m, 2)."""
        cells = ((points - self._low) / self._cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, self._count - 1))

    def _find_lowest(self, points: FloatArray, start: IntArray, members: IntArray) -> FloatArray:
        """Return the height of the lowest triangle over each of k points, among the triangles of the point's cell.

        Args:
            points: Positions, shape (k, 2) [m].
            start: Place in the list of triangles at which the triangles of the point's cell start, shape (k,).
            members: Number of triangles in the point's cell, shape (k,).

        Returns:
            Heights; inf where no triangle is over the point, shape (k,) [m].
        """
        first = np.cumsum(members) - members
        triangle = self._members[np.repeat(start - first, members) + np.arange(members.sum())]
        x, y = np.repeat(points, members, axis=0).T
        inside = np.full(len(triangle), np.inf)
        for side in range(3):
            a, b, c = self._sides[triangle, side].T
            np.minimum(inside, a * x + b * y + c, out=inside)
        a, b, c = self._plane[triangle].T
        # A point may lie outside an edge by rounding.  Where the triangle's plane is steep, the plane's height there
        # would leave the range of the triangle's heights; it is clipped to this range.
        z = np.clip(a * x + b * y + c, self._lowest[triangle], self._highest[triangle])
        return np.minimum.reduceat(np.where(inside >= -self._tolerance, z, np.inf), first)


def _describe_planes(triangles: FloatArray) -> FloatArray:
    """Return the coefficients a, b, c of the plane z = a x + b y + c of each of n triangles, shape (n, 3)."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    slope = -normal[:, :2] / normal[:, 2:]
    return np.column_stack([slope, triangles[:, 0, 2] - np.sum(slope * triangles[:, 0, :2], axis=1)])


def _describe_sides(flat: FloatArray) -> FloatArray:
    """Return the coefficients a, b, c of the distance a x + b y + c of a point from each side of n flat triangles.

    The distance is positive inside the triangle.

    Returns:
        Coefficients by triangle, side and coefficient, shape (n, 3, 3).
    """
    along = np.roll(flat, -1, axis=1) - flat
    # Seen from above, the corners of a triangle that faces down go clockwise, and its inside is on the right of a side.
    inward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.hypot(*np.moveaxis(along, -1, 0))[..., None]
    return np.concatenate([inward, -np.sum(inward * flat, axis=-1, keepdims=True)], axis=-1)


def split_into_hulls(triangles: FloatArray) -> list[FloatArray]:
    """Find convex hulls whose union has the underside of a body, within a tolerance.

    A warning is logged if the error of `HULLS.most` hulls exceeds the tolerance.  Of a hull of more than
    `HULLS.most_corners` corners only the outermost corners are kept, most of them on the underside of the hull; the
    hull of a sphere then lies up to about a thousandth of the radius inside the sphere.

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
    while queue and len(queue) + len(done) < HULLS.most:
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
        count = np.maximum(5, np.round(HULLS.points * extent / extent.max())).astype(int)
        axes = [
            low[i] + (np.arange(count[i]) + HULLS.offset) / (count[i] + 2 * HULLS.offset - 1) * extent[i]
            for i in range(2)
        ]
        x, y = (values.ravel() for values in np.meshgrid(*axes))
        height = TriangleGap(lower).evaluate(x, y)
        levels = np.linspace(0, height[np.isfinite(height)].max(), HULLS.levels)
        grid = height.reshape(len(axes[1]), len(axes[0]))
        step = float((extent / count).max())
        beside = np.array([_measure_distance(grid <= level, *axes) for level in levels])
        return cls(
            x=x,
            y=y,
            height=np.where(np.isfinite(height), height, top),
            levels=levels,
            beside=np.maximum(beside - step, 0).reshape(HULLS.levels, -1),
            top=top,
            step=step,
            tolerance=HULLS.tolerance * float(extent.max() / 2),
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
        if not len(points) or np.ptp(points[:, :2], axis=0).min() <= HULLS.narrow * underside.tolerance:
            return None
        try:
            hull = convex_hull(np.concatenate([points, raised]))
        except Exception:  # noqa: BLE001 -- qhull fails on nearly flat points with errors of several types
            return None
        floor = np.asarray(hull.face_normals)[:, 2] < -HULLS.upright
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
        cuts = [(np.array([np.cos(angle), np.sin(angle)]), self.worst) for angle in HULLS.cut_angles]
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
    """Reduce the corners of a hull to the outermost ones in `HULLS.most_corners` directions along a spiral on a sphere.

    Args:
        corners: Corners of the hull, shape (n, 3) [m].

    Returns:
        All n corners if there are no more than `HULLS.most_corners`; else some of them, shape (k, 3) [m].
    """
    if len(corners) <= HULLS.most_corners:
        return corners
    share = np.arange(HULLS.most_corners) / (HULLS.most_corners - 1)
    z = np.where(share < HULLS.downward, share / HULLS.downward - 1, (share - HULLS.downward) / (1 - HULLS.downward))
    # Turns by the golden angle from one direction to the next distribute the directions evenly over the sphere.
    turn = np.arange(HULLS.most_corners) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z])
    return np.asarray(corners[np.unique(((corners - corners.mean(axis=0)) @ directions).argmax(axis=0))])
