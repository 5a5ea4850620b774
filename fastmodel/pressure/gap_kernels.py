# ruff: noqa: PLR0917, PLR2004 -- flat loops over plain numbers, as numba likes them
"""The sampling of `sampling.py` as loops over cells, for numba."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import called_by_kernels

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
#: A body's parts as they stand: kinds, sizes, edge, faces as `_lines` has them, first face of each, axes and origins.
_Parts = tuple[IntArray, FloatArray, float, FloatArray, IntArray, FloatArray, FloatArray]


def sample_loops(
    kinds: IntArray,
    sizes: FloatArray,
    edge: float,
    planes: FloatArray,
    first_plane: IntArray,
    rotation: FloatArray,
    position: FloatArray,
    centres: FloatArray,
    halves: FloatArray,
    size: IntArray,
    low: FloatArray,
    cell: FloatArray,
    points: int,
    sparse: float,
    reach: float,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Row, column, coverage, x, y and gap of every cell under a body's parts, each of shape (m,).

    Args:
        kinds: Of each part: 0 polytope, 1 ellipsoid, 2 cylinder, 3 capsule, shape (p,).
        sizes: Half axes; radius and half length, shape (p, 3) [m].
        edge: Distance by which sharp edges of cylinders stand out [m].
        planes: Normal and offset of the polytopes' faces, shape (f, 4) [-, m].
        first_plane: First face of each part, and the number of all, shape (p + 1,).
        rotation: The parts' axes in the array's frame, shape (p, 3, 3) [-].
        position: Their origins, shape (p, 3) [m].
        centres: Centre of each part's bounding box in its own frame, shape (p, 3) [m].
        halves: Half edges of these boxes, shape (p, 3) [m].
        size: Columns and rows of the grid, shape (2,).
        low: Lowest corner of the grid, shape (2,) [m].
        cell: Edge lengths of a cell, shape (2,) [m].
        points: Points along each edge of a cell at which the gap is taken.
        sparse: Share of corners under a part below which all of its cells are looked at closely.
        reach: Height over the lowest cell up to which cells are kept [m].
    """
    windows = _windows(rotation, position, centres, halves, size, low, cell)
    height, near, top, c0, r0 = _room(windows, points)
    parts = (kinds, sizes, edge, _lines(planes, first_plane, rotation, position), first_plane, rotation, position)
    _look_at_parts(parts, windows, low, cell, sparse, height, near, top)
    means = _look_closely(parts, windows, low, cell, points, height, near, top)
    return _kept(height, means, r0, c0, low, cell, reach)


@called_by_kernels()
def _room(windows: IntArray, points: int) -> tuple[FloatArray, npt.NDArray[np.bool_], FloatArray, int, int]:
    """Heights of the cells of all windows, not found yet; marks; room for a line; the first column and row."""
    c0, r0, columns, rows = _around(windows)
    height, near = np.empty((rows, columns)), np.zeros((rows, columns), dtype=np.bool_)
    for i in range(rows * columns):
        height[i // columns, i % columns] = np.inf
    return height, near, np.empty(max(columns + 1, points)), c0, r0


@called_by_kernels()
def _look_at_parts(
    parts: _Parts,
    windows: IntArray,
    low: FloatArray,
    cell: FloatArray,
    sparse: float,
    height: FloatArray,
    near: npt.NDArray[np.bool_],
    top: FloatArray,
) -> None:
    """Fill heights of cells that lie under a part altogether, and mark those that an outline may cross."""
    c0, r0, _, _ = _around(windows)
    for p in range(len(windows)):
        left, first, right, last = windows[p]
        if left < right and first < last:
            corner = np.empty((last - first + 1, right - left + 1))
            x, y = _places(low[0], cell[0], left, right, 1), _places(low[1], cell[1], first, last, 1)
            _undersides(parts, p, x, y, top, corner)
            _look_at_corners(corner, sparse, first - r0, left - c0, height, near)


@called_by_kernels()
def _look_closely(
    parts: _Parts,
    windows: IntArray,
    low: FloatArray,
    cell: FloatArray,
    points: int,
    height: FloatArray,
    near: npt.NDArray[np.bool_],
    top: FloatArray,
) -> FloatArray:
    """Coverage of every cell and middle of its covered part (in cells from the cell's); fills heights at outlines."""
    c0, r0, columns, rows = _around(windows)
    gaps, offsets = np.empty((2, points, points)), _places(-0.5, 1.0, 0, 1, points)
    fine_x = _places(low[0], cell[0], c0, c0 + columns, points)
    fine_y = _places(low[1], cell[1], r0, r0 + rows, points)
    means = np.empty((rows, columns, 3))
    for i in range(rows):
        for j in range(columns):
            means[i, j, 0], means[i, j, 1], means[i, j, 2] = 1.0, 0.0, 0.0
            if height[i, j] < np.inf or not near[i, j]:
                continue
            for a in range(points * points):
                gaps[0, a // points, a % points] = np.inf
            x, y = fine_x[j * points : (j + 1) * points], fine_y[i * points : (i + 1) * points]
            for p in range(len(windows)):
                if windows[p, 0] <= c0 + j < windows[p, 2] and windows[p, 1] <= r0 + i < windows[p, 3]:
                    _undersides(parts, p, x, y, top, gaps[1])
                    _lower(gaps)
            means[i, j, 0], means[i, j, 1], means[i, j, 2], height[i, j] = _means(gaps[0], offsets)
    return means


@called_by_kernels()
def _kept(
    height: FloatArray, means: FloatArray, r0: int, c0: int, low: FloatArray, cell: FloatArray, reach: float
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """What `sample_loops` returns, of the cells with a height up to the reach over the lowest."""
    highest = np.inf
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            highest = min(highest, height[i, j] + reach)
    row, column = np.empty(height.size, dtype=np.int64), np.empty(height.size, dtype=np.int64)
    found = np.empty((4, height.size))
    count = 0
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            if height[i, j] < np.inf and height[i, j] <= highest:
                row[count], column[count] = r0 + i, c0 + j
                found[0, count], found[3, count] = means[i, j, 0], height[i, j]
                found[1, count] = low[0] + (c0 + j + 0.5 + means[i, j, 1]) * cell[0]
                found[2, count] = low[1] + (r0 + i + 0.5 + means[i, j, 2]) * cell[1]
                count += 1
    return row[:count], column[:count], found[0, :count], found[1, :count], found[2, :count], found[3, :count]


@called_by_kernels()
def _around(windows: IntArray) -> tuple[int, int, int, int]:
    """First column and row of all windows (p, 4) together, and how many columns and rows they take."""
    c0, r0, c1, r1 = windows[0, 0], windows[0, 1], windows[0, 2], windows[0, 3]
    for p in range(len(windows)):
        c0, r0 = min(c0, windows[p, 0]), min(r0, windows[p, 1])
        c1, r1 = max(c1, windows[p, 2]), max(r1, windows[p, 3])
    return c0, r0, max(c1 - c0, 0), max(r1 - r0, 0)


@called_by_kernels()
def _places(low: float, edge: float, first: int, last: int, points: int) -> FloatArray:
    """Both ends of cells from the first to before the last, or so many points within each, along one axis."""
    inside = points > 1
    places = np.empty((last - first) * points if inside else last - first + 1)
    for i in range(len(places)):
        places[i] = low + edge * (first + (i + 0.5) / points if inside else first + i)
    return places


@called_by_kernels()
def _windows(
    rotation: FloatArray,
    position: FloatArray,
    centres: FloatArray,
    halves: FloatArray,
    size: IntArray,
    low: FloatArray,
    cell: FloatArray,
) -> IntArray:
    """First column, first row, one past the last column and row of cells under each part, shape (p, 4)."""
    windows = np.empty((len(rotation), 4), dtype=np.int64)
    for p in range(len(rotation)):
        for axis in range(2):
            middle, half = position[p, axis], 0.0
            for i in range(3):
                middle += rotation[p, axis, i] * centres[p, i]
                if rotation[p, axis, i] != 0.0:  # a plane has no ends
                    half += abs(rotation[p, axis, i]) * halves[p, i]
            first = np.floor((middle - half - low[axis]) / cell[axis])
            last = np.ceil((middle + half - low[axis]) / cell[axis])
            windows[p, axis] = int(min(max(first, 0.0), size[axis]))
            windows[p, axis + 2] = int(min(max(last, 0.0), size[axis]))
    return windows


@called_by_kernels()
def _lines(planes: FloatArray, first_plane: IntArray, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Of each face: which end of a vertical line it bounds (-1 lower, 1 upper, 0 whether there is any), and the plane.

    The plane is height (or, where it stands upright, room) = a + b dx + c dy from the part's origin, shape (f, 4).
    """
    lines = np.empty((len(planes), 4))
    for p in range(len(first_plane) - 1):
        r, z = rotation[p], position[p, 2]
        for f in range(first_plane[p], first_plane[p + 1]):
            u, v, w, offset = planes[f]
            nx = r[0, 0] * u + r[0, 1] * v + r[0, 2] * w
            ny = r[1, 0] * u + r[1, 1] * v + r[1, 2] * w
            nz = r[2, 0] * u + r[2, 1] * v + r[2, 2] * w
            upright = abs(nz) <= 1e-9
            slope = 1.0 if upright else nz
            lines[f, 0] = 0.0 if upright else np.sign(nz)
            lines[f, 1], lines[f, 2], lines[f, 3] = (offset + nz * z) / slope, -nx / slope, -ny / slope
    return lines


@called_by_kernels()
def _undersides(parts: _Parts, p: int, x: FloatArray, y: FloatArray, top: FloatArray, under: FloatArray) -> None:
    """Height of one part's underside at all x and y, inf where there is none, into `under` (y, x).

    `top` is room to work in.  Many points at a call: handing arrays over costs more than a point does.
    """
    kinds, sizes, edge, lines, first_plane, rotation, position = parts
    if kinds[p] == 0:
        _under_faces(lines, first_plane[p], first_plane[p + 1], x, y, position[p, 0], position[p, 1], top, under)
        return
    r = rotation[p]
    for i in range(len(y)):
        for j in range(len(x)):
            dx, dy, dz = x[j] - position[p, 0], y[i] - position[p, 1], -position[p, 2]
            under[i, j] = _under_round(
                kinds[p], sizes[p, 0], sizes[p, 1], sizes[p, 2], edge,
                r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz,
                r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz,
                r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz,
                r[2, 0], r[2, 1], r[2, 2],
            )  # fmt: skip


@called_by_kernels()
def _under_faces(
    lines: FloatArray,
    first: int,
    last: int,
    x: FloatArray,
    y: FloatArray,
    middle_x: float,
    middle_y: float,
    top: FloatArray,
    under: FloatArray,
) -> None:
    """Height of a polytope's underside; rows of points at a time, so that the processor takes several at once."""
    for i in range(len(y)):
        for j in range(len(x)):
            under[i, j], top[j] = -np.inf, np.inf
        for f in range(first, last):
            side, level, slope = lines[f, 0], lines[f, 1] + lines[f, 3] * (y[i] - middle_y), lines[f, 2]
            for j in range(len(x)):
                value = level + slope * (x[j] - middle_x)
                if side < 0:
                    under[i, j] = value if value > under[i, j] else under[i, j]  # noqa: FURB136 -- max() is slower here
                elif side > 0:
                    top[j] = value if value < top[j] else top[j]  # noqa: FURB136
                elif value < 0:
                    top[j] = -np.inf
        for j in range(len(x)):
            under[i, j] = under[i, j] if -np.inf < under[i, j] <= top[j] else np.inf


@called_by_kernels()
def _under_round(
    kind: int,
    a: float,
    b: float,
    c: float,
    edge: float,
    ox: float,
    oy: float,
    oz: float,
    ux: float,
    uy: float,
    uz: float,
) -> float:
    """Height of the underside of an ellipsoid, cylinder or capsule of size a, b, c; inf where there is none."""
    if kind == 1:
        square = (ux / a) ** 2 + (uy / b) ** 2 + (uz / c) ** 2
        half = ox * ux / a**2 + oy * uy / b**2 + oz * uz / c**2
        root = half**2 - square * ((ox / a) ** 2 + (oy / b) ** 2 + (oz / c) ** 2 - 1)
        return np.inf if root < 0 else (-half - np.sqrt(root)) / square
    best = _under_cylinder(a, b, edge if kind == 2 else 0.0, ox, oy, oz, ux, uy, uz)
    if kind == 3:
        for sign in (-1.0, 1.0):
            ez = oz + sign * b
            half = ox * ux + oy * uy + ez * uz
            root = half**2 - (ox**2 + oy**2 + ez**2 - a**2)
            if root >= 0:
                best = min(best, -half - np.sqrt(root))
    return float(best)


@called_by_kernels()
def _under_cylinder(
    radius: float, length: float, edge: float, ox: float, oy: float, oz: float, ux: float, uy: float, uz: float
) -> float:
    """Height of a cylinder's underside; inf where there is none."""
    bottom, top = -np.inf, np.inf
    radius += edge * uz**2
    length += edge
    if abs(uz) > 1e-9:
        bottom = (-np.sign(uz) * length - oz) / uz
        top = (np.sign(uz) * length - oz) / uz
    elif abs(oz) > length:
        return np.inf
    square = ux**2 + uy**2
    if square < 1e-18:
        if ox**2 + oy**2 > radius**2:
            return np.inf
    else:
        half = ox * ux + oy * uy
        root = half**2 - square * (ox**2 + oy**2 - radius**2)
        if root < 0:
            return np.inf
        bottom = max(bottom, (-half - np.sqrt(root)) / square)
        top = min(top, (-half + np.sqrt(root)) / square)
    return bottom if bottom <= top and bottom > -np.inf else np.inf


@called_by_kernels()
def _look_at_corners(
    corner: FloatArray, sparse: float, row: int, column: int, height: FloatArray, near: npt.NDArray[np.bool_]
) -> None:
    """Take the mean of a cell's corners where all lie under the part; else mark cells that its outline may cross."""
    rows, columns = corner.shape
    hits = 0
    for i in range(rows):
        for j in range(columns):
            hits += corner[i, j] < np.inf
    thin = hits < sparse * corner.size
    for i in range(rows - 1):
        for j in range(columns - 1):
            mean = 0.25 * (corner[i, j] + corner[i + 1, j] + corner[i, j + 1] + corner[i + 1, j + 1])
            if mean < np.inf:
                height[row + i, column + j] = min(height[row + i, column + j], mean)
                continue
            around = thin
            # any corner within one cell of the cell's own corners
            for a in range(max(i - 1, 0), min(i + 3, rows)):
                for b in range(max(j - 1, 0), min(j + 3, columns)):
                    around = around or corner[a, b] < np.inf
            near[row + i, column + j] |= around


@called_by_kernels()
def _lower(gaps: FloatArray) -> None:
    """Keep the smaller of both gaps (2, points, points) in the first."""
    for a in range(gaps.shape[1]):
        for b in range(gaps.shape[2]):
            gaps[0, a, b] = min(gaps[0, a, b], gaps[1, a, b])


@called_by_kernels()
def _means(gaps: FloatArray, offsets: FloatArray) -> tuple[float, float, float, float]:
    """Share of points with a gap, their mean place along x and y, and the mean gap."""
    hits, sum_x, sum_y, sum_gap = 0, 0.0, 0.0, 0.0
    for a in range(len(offsets)):
        for b in range(len(offsets)):
            if gaps[a, b] < np.inf:
                hits += 1
                sum_x += offsets[b]
                sum_y += offsets[a]
                sum_gap += gaps[a, b]
    if hits == 0:
        return 0.0, 0.0, 0.0, np.inf
    return hits / gaps.size, sum_x / hits, sum_y / hits, sum_gap / hits
