"""Gap of a surface of triangles: the height of the lowest triangle over a point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Length that counts as zero, over the extent of all triangles: rounding in double precision [-].
_ZERO = 1e-12
#: Most pairs of a point and a triangle that are computed at once, so that they take less than about 200 MB [-].
_MOST_PAIRS = 2_000_000
#: Most cells along the longer side of the search grid; more cost more memory and save hardly any time [-].
_MOST_CELLS = 256
#: Most entries of the search grid per triangle; a long triangle is entered in every cell that it may cross [-].
_MOST_ENTRIES = 30


def select_facing_down(triangles: FloatArray) -> FloatArray:
    """Triangles whose outer side faces down; upright ones are left out.

    Args:
        triangles: Corners, counterclockwise as seen from outside, shape (n, 3, 3) [m].

    Returns:
        Some of them, shape (m, 3, 3) [m].
    """
    (ax, ay), (bx, by) = (triangles[:, k, :2].T - triangles[:, 0, :2].T for k in (1, 2))
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    return np.asarray(triangles[ax * by - ay * bx < -_ZERO * size**2])


def compute_volume(triangles: FloatArray) -> float:
    """Volume that a closed surface of triangles encloses, negative if they face inwards, by the divergence theorem.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].

    Returns:
        The volume [m3].
    """
    corners = triangles - triangles[0, 0]
    return float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


class TriangleGap:
    """Height of the lowest of many triangles that face down.

    A grid of cells over their extent lists the triangles that may cross each cell, so that a point is compared only
    with those of its own cell.

    Args:
        triangles: Triangles that face down, none of them upright, shape (n, 3, 3) [m].
    """

    def __init__(self, triangles: FloatArray) -> None:
        flat = triangles[..., :2]
        extent = np.ptp(flat, axis=(0, 1))
        self._tolerance = _ZERO * float(extent.max())
        self._low = flat.min(axis=(0, 1))
        self._count, self._cell = self._choose_cells(flat, extent)
        self._members, self._start = self._list_members(flat)
        self._plane, self._sides = _describe_planes(triangles), _describe_sides(flat)
        self._lowest, self._highest = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)

    def evaluate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the lowest triangle over each point, inf where there is none.

        Args:
            x: Positions, shape (m,) [m].
            y: Positions, shape (m,) [m].

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
        blocks = np.flatnonzero(np.diff(np.cumsum(members) // _MOST_PAIRS)) + 1
        for part in np.split(np.arange(len(index)), blocks):
            if len(part):
                start = self._start[cell[part]]
                heights[index[part]] = self._find_lowest(points[index[part]], start, members[part])
        return heights

    def _choose_cells(self, flat: FloatArray, extent: FloatArray) -> tuple[IntArray, FloatArray]:
        """Number of cells along x and y, and their edges: about as many as triangles, fewer if these are long."""
        boxes = np.ptp(flat, axis=1)
        along_longer = float(min(_MOST_CELLS, max(1, np.sqrt(len(flat)))))
        while True:
            count = np.maximum(1, np.ceil(along_longer * extent / extent.max())).astype(np.int64)
            cell = extent / count
            if along_longer <= 1 or np.prod(boxes / cell + 1, axis=1).sum() < _MOST_ENTRIES * len(flat):
                return count, cell
            along_longer /= 2

    def _list_members(self, flat: FloatArray) -> tuple[IntArray, IntArray]:
        """Triangles of all cells, cell after cell, and where each cell's triangles start in that list."""
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
        """Column and row of the cell of each point, shape (m, 2)."""
        cells = ((points - self._low) / self._cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, self._count - 1))

    def _find_lowest(self, points: FloatArray, start: IntArray, members: IntArray) -> FloatArray:
        """Height of the lowest triangle over points (k, 2), each with `members` triangles listed from `start` [m]."""
        first = np.cumsum(members) - members
        triangle = self._members[np.repeat(start - first, members) + np.arange(members.sum())]
        x, y = np.repeat(points, members, axis=0).T
        inside = np.full(len(triangle), np.inf)
        for side in range(3):
            a, b, c = self._sides[triangle, side].T
            np.minimum(inside, a * x + b * y + c, out=inside)
        a, b, c = self._plane[triangle].T
        # A point that lies beside an edge by rounding must not follow a steep plane beyond its triangle.
        z = np.clip(a * x + b * y + c, self._lowest[triangle], self._highest[triangle])
        return np.minimum.reduceat(np.where(inside >= -self._tolerance, z, np.inf), first)


def _describe_planes(triangles: FloatArray) -> FloatArray:
    """Coefficients a, b, c of the plane z = a x + b y + c of each triangle, shape (n, 3)."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    slope = -normal[:, :2] / normal[:, 2:]
    return np.column_stack([slope, triangles[:, 0, 2] - np.sum(slope * triangles[:, 0, :2], axis=1)])


def _describe_sides(flat: FloatArray) -> FloatArray:
    """Coefficients a, b, c of the distance a x + b y + c from each side, positive inside, shape (n, 3, 3)."""
    along = np.roll(flat, -1, axis=1) - flat
    # Seen from above, the corners of a triangle that faces down go clockwise: its inside is on the right.
    inward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.hypot(*np.moveaxis(along, -1, 0))[..., None]
    return np.concatenate([inward, -np.sum(inward * flat, axis=-1, keepdims=True)], axis=-1)
