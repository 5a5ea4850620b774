"""Gap between a plane and a body of triangles: the height of the body's lowest triangle over points of the plane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Length that counts as zero, over the larger edge of the triangles' bounding box: rounding in double precision [-].
_ZERO = 1e-12
#: Largest number of pairs of a point and a triangle that are computed at once; they take less than about 200 MB [-].
_MOST_PAIRS = 2_000_000
#: Largest number of cells along the longer side of the grid that finds the triangles near a point; more cells take more
#: memory and save hardly any time [-].
_MOST_CELLS = 256
#: Largest average number of grid cells in which a triangle is listed; a triangle is listed in every cell that its
#: bounding box touches, so long triangles need a coarser grid [-].
_MOST_ENTRIES = 30


def select_facing_down(triangles: FloatArray) -> FloatArray:
    """Select the triangles whose outer side faces down; vertical triangles are left out.

    Args:
        triangles: Corners of n triangles, counterclockwise as seen from outside the body, shape (n, 3, 3) [m].

    Returns:
        Corners of the m triangles that face down, shape (m, 3, 3) [m].
    """
    (ax, ay), (bx, by) = (triangles[:, k, :2].T - triangles[:, 0, :2].T for k in (1, 2))
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    return np.asarray(triangles[ax * by - ay * bx < -_ZERO * size**2])


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
        self._tolerance = _ZERO * float(extent.max())
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
        blocks = np.flatnonzero(np.diff(np.cumsum(members) // _MOST_PAIRS)) + 1
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
        along_longer = float(min(_MOST_CELLS, max(1, np.sqrt(len(flat)))))
        while True:
            count = np.maximum(1, np.ceil(along_longer * extent / extent.max())).astype(np.int64)
            cell = extent / count
            if along_longer <= 1 or np.prod(boxes / cell + 1, axis=1).sum() < _MOST_ENTRIES * len(flat):
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
