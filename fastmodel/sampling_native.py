# ruff: noqa: C901, PLR0912, PLR0915, PLR2004 -- one flat loop over plain numbers, as numba likes it
"""The sampling of `sampling.py` as one loop over cells, for numba."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def sample_loops(  # noqa: PLR0917 -- numba kernels take positions
    kinds: IntArray,
    sizes: FloatArray,
    edge: float,
    planes: FloatArray,
    first_plane: IntArray,
    rotation: FloatArray,
    position: FloatArray,
    windows: IntArray,
    low: FloatArray,
    cell: FloatArray,
    points: int,
    found: FloatArray,
) -> int:
    """Row, column, coverage, x, y and gap of every cell under a body's parts; the number of cells.

    Args:
        kinds: Of each part: 0 polytope, 1 ellipsoid, 2 cylinder, 3 capsule, shape (p,).
        sizes: Half axes; radius and half length, shape (p, 3) [m].
        edge: Distance by which sharp edges of cylinders stand out [m].
        planes: Normal and offset of the polytopes' faces, shape (f, 4) [-, m].
        first_plane: First face of each part, and the number of all, shape (p + 1,).
        rotation: The parts' axes in the array's frame, shape (p, 3, 3) [-].
        position: Their origins, shape (p, 3) [m].
        windows: First column, first row, one past the last column and row of each part, shape (p, 4).
        low: Lowest corner of the grid, shape (2,) [m].
        cell: Edge lengths of a cell, shape (2,) [m].
        points: Points along each edge of a cell at which the gap is taken.
        found: Filled with the result, shape (6, cells of all windows).
    """

    def under(p: int, x: float, y: float) -> float:
        """Height of one part's underside; inf where there is none."""
        dx, dy, dz = x - position[p, 0], y - position[p, 1], -position[p, 2]
        ox = rotation[p, 0, 0] * dx + rotation[p, 1, 0] * dy + rotation[p, 2, 0] * dz
        oy = rotation[p, 0, 1] * dx + rotation[p, 1, 1] * dy + rotation[p, 2, 1] * dz
        oz = rotation[p, 0, 2] * dx + rotation[p, 1, 2] * dy + rotation[p, 2, 2] * dz
        ux, uy, uz = rotation[p, 2, 0], rotation[p, 2, 1], rotation[p, 2, 2]
        bottom, top = -np.inf, np.inf
        if kinds[p] == 0:
            for f in range(first_plane[p], first_plane[p + 1]):
                slope = planes[f, 0] * ux + planes[f, 1] * uy + planes[f, 2] * uz
                room = planes[f, 3] - planes[f, 0] * ox - planes[f, 1] * oy - planes[f, 2] * oz
                if slope < -1e-9:
                    bottom = max(bottom, room / slope)
                elif slope > 1e-9:
                    top = min(top, room / slope)
                elif room < 0:
                    return np.inf
        elif kinds[p] == 1:
            a, b, c = sizes[p, 0], sizes[p, 1], sizes[p, 2]
            square = (ux / a) ** 2 + (uy / b) ** 2 + (uz / c) ** 2
            half = ox * ux / a**2 + oy * uy / b**2 + oz * uz / c**2
            root = half**2 - square * ((ox / a) ** 2 + (oy / b) ** 2 + (oz / c) ** 2 - 1)
            if root < 0:
                return np.inf
            bottom = (-half - np.sqrt(root)) / square
        else:
            radius, length = sizes[p, 0], sizes[p, 1]
            if kinds[p] == 2:
                radius += edge * uz**2
                length += edge
            if abs(uz) > 1e-9:
                bottom = (-np.sign(uz) * length - oz) / uz
                top = (np.sign(uz) * length - oz) / uz
            elif abs(oz) > length:
                top = -np.inf
            square = ux**2 + uy**2
            if square < 1e-18:
                if ox**2 + oy**2 > radius**2:
                    top = -np.inf
            else:
                half = ox * ux + oy * uy
                root = half**2 - square * (ox**2 + oy**2 - radius**2)
                if root < 0:
                    top = -np.inf
                else:
                    bottom = max(bottom, (-half - np.sqrt(root)) / square)
                    top = min(top, (-half + np.sqrt(root)) / square)
            if kinds[p] == 3:
                best = bottom if bottom <= top else np.inf
                for sign in (-1.0, 1.0):
                    ez = oz + sign * length
                    half = ox * ux + oy * uy + ez * uz
                    root = half**2 - (ox**2 + oy**2 + ez**2 - radius**2)
                    if root >= 0:
                        best = min(best, -half - np.sqrt(root))
                return best
        return bottom if bottom <= top and bottom > -np.inf else np.inf

    first_x, first_y = windows[:, 0].min(), windows[:, 1].min()
    columns, rows = windows[:, 2].max() - first_x, windows[:, 3].max() - first_y
    if rows <= 0 or columns <= 0:
        return 0
    height = np.full((rows, columns), np.inf)
    near = np.zeros((rows, columns), dtype=np.bool_)
    for p in range(len(kinds)):
        c0, r0 = windows[p, 0] - first_x, windows[p, 1] - first_y
        c1, r1 = windows[p, 2] - first_x, windows[p, 3] - first_y
        if c1 <= c0 or r1 <= r0:
            continue
        corner = np.empty((r1 - r0 + 1, c1 - c0 + 1))
        for i in range(r1 - r0 + 1):
            for j in range(c1 - c0 + 1):
                x = low[0] + (first_x + c0 + j) * cell[0]
                y = low[1] + (first_y + r0 + i) * cell[1]
                corner[i, j] = under(p, x, y)
        for i in range(r1 - r0):
            for j in range(c1 - c0):
                mean = 0.25 * (corner[i, j] + corner[i + 1, j] + corner[i, j + 1] + corner[i + 1, j + 1])
                height[r0 + i, c0 + j] = min(height[r0 + i, c0 + j], mean)
                near[r0 + i, c0 + j] = True
    count = 0
    for i in range(rows):
        for j in range(columns):
            if not near[i, j]:
                continue
            share, right, up, gap = 1.0, 0.0, 0.0, height[i, j]
            if not np.isfinite(gap):
                hits, sum_x, sum_y, sum_gap = 0, 0.0, 0.0, 0.0
                for a in range(points):
                    v = (a + 0.5) / points - 0.5
                    for b in range(points):
                        u = (b + 0.5) / points - 0.5
                        x = low[0] + (first_x + j + 0.5 + u) * cell[0]
                        y = low[1] + (first_y + i + 0.5 + v) * cell[1]
                        lowest = np.inf
                        for p in range(len(kinds)):
                            c, r = first_x + j, first_y + i
                            if windows[p, 0] <= c < windows[p, 2] and windows[p, 1] <= r < windows[p, 3]:
                                lowest = min(lowest, under(p, x, y))
                        if np.isfinite(lowest):
                            hits += 1
                            sum_x += u
                            sum_y += v
                            sum_gap += lowest
                if hits == 0:
                    continue
                share, right, up, gap = hits / points**2, sum_x / hits, sum_y / hits, sum_gap / hits
            found[0, count] = first_y + i
            found[1, count] = first_x + j
            found[2, count] = share
            found[3, count] = low[0] + (first_x + j + 0.5 + right) * cell[0]
            found[4, count] = low[1] + (first_y + i + 0.5 + up) * cell[1]
            found[5, count] = gap
            count += 1
    return count
