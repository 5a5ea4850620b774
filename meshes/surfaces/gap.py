"""Triangles seen from below: how high the lowest of them stands over any point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Length that counts as none, over the extent of all triangles [-].
_NOTHING = 1e-12
#: Pairs of point and triangle that are looked at in one go, and cells of the index along the longer side at most.
_PAIRS, _CELLS = 2_000_000, 256


def facing_down(triangles: FloatArray) -> FloatArray:
    """Triangles of a closed surface (n, 3, 3) whose outer side faces down; upright ones are left out [m]."""
    (ax, ay), (bx, by) = (triangles[:, k, :2].T - triangles[:, 0, :2].T for k in (1, 2))
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    return np.asarray(triangles[ax * by - ay * bx < -_NOTHING * size**2])


class Underside:
    """Triangles seen from below, sorted into the cells of a grid so that a point meets only those near it."""

    def __init__(self, corners: FloatArray) -> None:
        flat = corners[..., :2]
        self._low = flat.min(axis=(0, 1))
        span = np.ptp(flat, axis=(0, 1))
        self._count, self._cell = self._grid(flat, span)
        first, last = self._cells_of(flat.min(axis=1)), self._cells_of(flat.max(axis=1))
        wide, high = (last - first + 1).T
        owner = np.repeat(np.arange(len(corners)), wide * high)
        offset = np.arange(len(owner)) - np.repeat(np.cumsum(wide * high) - wide * high, wide * high)
        column = first[owner, 0] + offset % wide[owner]
        row = first[owner, 1] + offset // wide[owner]
        number = row * self._count[0] + column
        order = np.argsort(number, kind="stable")
        self._member = owner[order]
        self._start = np.searchsorted(number[order], np.arange(self._count.prod() + 1))
        self._faces(corners)
        self._slack = _NOTHING * float(span.max())

    def _grid(self, flat: FloatArray, span: FloatArray) -> tuple[IntArray, FloatArray]:
        """Cells along x and y, and their edges: as many as triangles at most, fewer where triangles are long."""
        boxes = np.ptp(flat, axis=1)
        cells = float(min(_CELLS, max(1, np.sqrt(len(flat)))))
        while True:
            count = np.maximum(1, np.ceil(cells * span / span.max())).astype(np.int64)
            cell = span / count
            if cells <= 1 or np.prod(boxes / cell + 1, axis=1).sum() < 30 * len(flat):
                return count, cell
            cells /= 2

    def _cells_of(self, points: FloatArray) -> IntArray:
        cells = ((points - self._low) / self._cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, self._count - 1))

    def _faces(self, corners: FloatArray) -> None:
        """Planes z = a x + b y + c, lowest and highest points, and distances from sides as a x + b y + c."""
        flat = corners[..., :2]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        slope = -normal[:, :2] / normal[:, 2:]
        self._plane = np.column_stack([slope, corners[:, 0, 2] - np.sum(slope * flat[:, 0], axis=1)])
        self._lowest, self._highest = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
        along = np.roll(flat, -1, axis=1) - flat
        # Seen from above the corners of a triangle that faces down go clockwise: inside is on the right.
        inward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.hypot(*np.moveaxis(along, -1, 0))[..., None]
        self._sides = np.concatenate([inward, -np.sum(inward * flat, axis=-1, keepdims=True)], axis=-1)

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the lowest triangle over points (m,), inf where there is none [m]."""
        out = np.full(x.shape, np.inf)
        points = np.column_stack([x, y])
        near = np.flatnonzero(
            ((points >= self._low - self._slack) & (points <= self._low + self._count * self._cell + self._slack)).all(
                1
            )
        )
        number = self._cells_of(points[near]) @ np.array([1, self._count[0]])
        many = self._start[number + 1] - self._start[number]
        near, number, many = near[many > 0], number[many > 0], many[many > 0]
        blocks = np.flatnonzero(np.diff(np.cumsum(many) // _PAIRS)) + 1
        for part in np.split(np.arange(len(near)), blocks):
            if len(part):
                out[near[part]] = self._lowest_of(points[near[part]], self._start[number[part]], many[part])
        return out

    def _lowest_of(self, points: FloatArray, start: IntArray, many: IntArray) -> FloatArray:
        """Height over points (k, 2) of the lowest of the `many` triangles listed from `start` on [m]."""
        first = np.cumsum(many) - many
        face = self._member[np.repeat(start - first, many) + np.arange(many.sum())]
        x, y = np.repeat(points, many, axis=0).T
        away = np.full(len(face), np.inf)
        for side in range(3):
            a, b, c = self._sides[face, side].T
            np.minimum(away, a * x + b * y + c, out=away)
        a, b, c = self._plane[face].T
        # Beside an edge, within rounding, a steep plane must not leave its triangle.
        z = np.clip(a * x + b * y + c, self._lowest[face], self._highest[face])
        return np.minimum.reduceat(np.where(away >= -self._slack, z, np.inf), first)
