# ruff: noqa: PLR0917, PLR2004, PLR0912, C901 -- kernels take plain numbers by position, and their tolerances stand where they act
"""Compiled kernels that measure the gap between bodies and the undeformed cover; `fastmodel.pressure.gap` calls them.

`sample_body` averages the gap along an array's normal over cells, `sample_surface` that along the normals of a curved
surface; `cross_lines` finds where any lines meet solids.

These kernels and the functions that they call are in one file, because numba's cache checks only the file of the
called kernel for changes.
"""

from __future__ import annotations

import math

import numpy as np

from fastmodel.compiled import called_by_kernels
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Value of `Solid.kind` for a convex solid with flat faces.
POLYTOPE = 0
#: Value of `Solid.kind` for an ellipsoid.
ELLIPSOID = 1
#: Value of `Solid.kind` for a cylinder.
CYLINDER = 2
#: Value of `Solid.kind` for a capsule.
CAPSULE = 3
#: The arrays of p solids, see `BodyShape.arrays`.
Shape = tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]
#: Arrays that describe the contact grid, see `CellGrid.arrays`.
Grid = tuple[IntArray, FloatArray, FloatArray]
#: Row, column, coverage, x, y and gap of m cells of the contact grid, each of shape (m,); see `GapSamples`.
Cells = tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]
#: The p solids, as a tuple.  The entries are: the solids; the distance by which those with sharp edges are enlarged
#: [m]; axes of the solids, shape (p, 3, 3) [-], and origins, shape (p, 3) [m], in the array's frame.
Body = tuple[Shape, float, FloatArray, FloatArray]
#: The part of the contact grid that is sampled, as a tuple.  The entries are: the window (rectangle of cells) under
#: each of p solids, shape (p, 4); the window around all of them, shape (4,); lowest corner of the grid, shape (2,) [m];
#: and edge lengths of a cell, shape (2,) [m].
View = tuple[IntArray, IntArray, FloatArray, FloatArray]
#: Vertical lines at the positions x[first:last] and y, as a tuple: x [m], y [m], first, last.
Line = tuple[FloatArray, float, int, int]
#: A curved surface, as a tuple: positions [m] and unit normals [-] of p points, shape (p, 3) each, and the indices of
#: the points of each of f triangles, shape (f, 3).
Surface = tuple[FloatArray, FloatArray, IntArray]
#: Cells on a chart of a curved surface, as a tuple.  The entries are: origin of the chart, shape (3,) [m]; its axes x,
#: y and z as rows, z along the normal at the origin, shape (3, 3) [-]; lowest corner of the cells, shape (2,) [m]; edge
#: lengths of a cell, shape (2,) [m]; and smallest cosine between a normal of the surface and z on the chart [-].
Chart = tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]
#: The three components of a vector along x, y and z.
Vector = tuple[float, float, float]

#: Number of points along each edge of a cell at which the gap is evaluated [-].
POINTS = 4
#: Height of a sampled point above the lowest one in its cell, over the edge of the cell, above which the point lies on
#: a wall of a tilted body and does not count [-].  A wall that leans outwards by 1 degree would raise the mean gap of
#: the cells along an edge by millimetres, so that they would lose the contact.
WALL = 0.5
#: Value below which a component of a unit vector counts as zero [-].  A face of a solid then counts as parallel to the
#: array's normal, and the axis of a cylinder as parallel to the array's normal or plane.
_PARALLEL = 1e-9


def sample_body(body: Body, grid: Grid, reach: float, floor: float) -> Cells:
    """Kernel: sample the gap under one body of p solids, and average the gap over cells of the contact grid.

    A vertical line intersects each solid in one interval of heights.  Where the interval begins below `floor`, the gap
    is that of the floor; where it also ends below, the solid lies behind the array and presses on nothing.

    Args:
        body: The solids and their poses.
        grid: The contact grid.
        reach: Gap above the smallest gap up to which cells are kept, with their eight neighbours [m].
        floor: Smallest gap; parts of the body that lie below are not in front of the array [m].

    Returns:
        The kept cells.
    """
    windows, around = _find_windows(body, grid)
    view, top = (windows, around, grid[1], grid[2]), np.inf
    while True:
        centres, near, top = _sample_centres(body, view, reach, floor, top)
        spans = _widen(_find_spans(centres, near, view, top), centres.shape[2] - 2)
        heights = _sample_spans(body, view, near, spans, floor)
        cells, lowest = _average_over_cells(heights, around, grid[1], grid[2], reach)
        if lowest + reach <= top or top >= 1e9:  # 1e9 m is above all bodies
            return cells
        top = min(lowest + reach, 1e9)


@called_by_kernels
def _sample_centres(
    body: Body, view: View, reach: float, floor: float, top: float
) -> tuple[FloatArray, BoolArray, float]:
    """Sample the gap under each of p solids at the centres of the cells of its window and of one cell around it.

    Args:
        body: The solids and their poses.
        view: Their windows.
        reach: Gap above the smallest gap up to which cells are kept [m].
        floor: Smallest gap; parts of the body that lie below are not in front of the array [m].
        top: Height up to which the gap is sampled; if infinite, it is chosen from the smallest gap at a centre [m].

    Returns:
        Gaps, shape (p, rows + 2, columns + 2) [m], infinite beside a solid; whether each solid may lie below the
        height, shape (p,) (the gaps of other solids are not set); and the height [m].
    """
    (shape, _, rotation, position), (windows, around, low, cell) = body, view
    rows, columns = max(around[3] - around[1], 0) + 2, max(around[2] - around[0], 0) + 2
    heights, x, lowest = np.empty((len(windows), rows, columns)), np.empty(columns), np.inf
    for j in range(columns):
        x[j] = low[0] + cell[0] * (around[0] - 0.5 + j)
    bottom, upper = np.empty(columns), np.empty(columns)
    near, floors = np.zeros(len(windows), dtype=np.bool_), np.empty(len(windows))
    for p in range(len(windows)):
        floors[p] = position[p, 2]
        for i in range(3):
            if rotation[p, 2, i] != 0.0:  # the half edges of a plane are infinite, and 0 times infinity is nan
                floors[p] += rotation[p, 2, i] * shape[4][p, i] - abs(rotation[p, 2, i]) * shape[5][p, i]
    for p in _sort(floors):
        first, last = windows[p, 0] - around[0], windows[p, 2] - around[0] + 2
        near[p] = last > first + 2 and floors[p] <= (top if top < np.inf else lowest + 1.2 * reach)
        if not near[p]:
            continue
        faces = _transform_faces(shape[2][shape[3][p] : shape[3][p + 1]], rotation[p], position[p])
        for i in range(windows[p, 1] - around[1], windows[p, 3] - around[1] + 2):
            y = low[1] + cell[1] * (around[1] - 0.5 + i)
            _cross_solid(body, p, faces, (x, y, first, last), bottom, upper)
            for j in range(first, last):
                heights[p, i, j] = max(bottom[j], floor) if upper[j] > max(bottom[j], floor) else np.inf
                lowest = min(lowest, heights[p, i, j])
    # The smallest gap at a centre is an estimate of the smallest mean gap of a cell.  The caller samples up to a larger
    # height if the estimate was too low.
    return heights, near, lowest + 1.2 * reach if top == np.inf else top


@called_by_kernels
def _sort(values: FloatArray) -> IntArray:
    """Return the indices that sort a few values, shape (p,); numba compiles `numpy.argsort` for seconds."""
    order = np.zeros(len(values), dtype=np.int64)
    for p in range(len(values)):
        q = p
        while q > 0 and values[order[q - 1]] > values[p]:
            order[q] = order[q - 1]
            q -= 1
        order[q] = p
    return order


@called_by_kernels
def _find_spans(centres: FloatArray, near: BoolArray, view: View, top: float) -> IntArray:
    """Find, in each row of cells, the columns between which the gap may be below a height.

    The gap h below a convex solid is a convex function.  Its values at the centre c of a cell and at the centres of the
    eight neighbours, of which M is the largest, bound it within the cell: h >= 1.5 h(c) - 0.5 M.  Cells with a centre,
    or a neighbour's centre, that is not below the solid count as below the height.

    Args:
        centres: Gaps at the centres, see `_sample_centres` [m].
        near: Which solids may lie below the height, shape (p,).
        view: Windows of the solids.
        top: The height [m].

    Returns:
        First and one past the last column of the window `around`, for each of its rows, shape (rows, 2).
    """
    (windows, around, _, _), spans = view, np.zeros((centres.shape[1] - 2, 2), dtype=np.int64)
    for i in range(len(spans)):
        spans[i, 0] = centres.shape[2]
    for p in range(len(near)):
        for i in range(windows[p, 1] - around[1], windows[p, 3] - around[1] if near[p] else 0):
            for j in range(windows[p, 0] - around[0], windows[p, 2] - around[0]):
                most = -np.inf
                for k in range(9):
                    most = max(most, centres[p, i + k // 3, j + k % 3])
                if most == np.inf or 1.5 * centres[p, i + 1, j + 1] - 0.5 * most <= top:
                    spans[i, 0], spans[i, 1] = min(spans[i, 0], j), max(spans[i, 1], j + 1)
    return spans


@called_by_kernels
def _widen(spans: IntArray, columns: int) -> IntArray:
    """Extend the columns between two spans of each row, shape (rows, 2), by one cell on all sides."""
    wide = np.empty(spans.shape, dtype=np.int64)
    for i in range(len(spans)):
        wide[i, 0], wide[i, 1] = spans[i, 0], spans[i, 1]
        for k in range(max(i - 1, 0), min(i + 2, len(spans))):
            if spans[k, 0] < spans[k, 1]:
                wide[i, 0] = min(wide[i, 0], max(spans[k, 0] - 1, 0))
                wide[i, 1] = max(wide[i, 1], min(spans[k, 1] + 1, columns))
    return wide


@called_by_kernels
def _sample_spans(body: Body, view: View, near: BoolArray, spans: IntArray, floor: float) -> FloatArray:
    """Sample the gap at `POINTS` x `POINTS` points of the cells between two columns of each row of cells.

    Args:
        body: The solids and their poses.
        view: Their windows.
        near: Which solids are sampled, shape (p,); others lie so high that they touch nothing.
        spans: First and one past the last column of each row of cells, shape (rows, 2).
        floor: Smallest gap; parts of the body that lie below are not in front of the array [m].

    Returns:
        Gap at each point, infinite elsewhere and beside the body, shape (rows * POINTS, columns * POINTS) [m].
    """
    (shape, _, rotation, position), (windows, around, low, cell) = body, view
    columns = max(around[2] - around[0], 0) * POINTS
    heights, bottom, top = np.full((len(spans) * POINTS, columns), np.inf), np.empty(columns), np.empty(columns)
    x = np.empty(columns)
    for j in range(columns):
        x[j] = low[0] + cell[0] * (around[0] + (j + 0.5) / POINTS)
    for p in range(len(near)):
        faces = _transform_faces(shape[2][shape[3][p] : shape[3][p + 1]], rotation[p], position[p])
        for i in range((windows[p, 1] - around[1]) * POINTS, (windows[p, 3] - around[1]) * POINTS):
            first = max(windows[p, 0] - around[0], spans[i // POINTS, 0]) * POINTS
            last = min(windows[p, 2] - around[0], spans[i // POINTS, 1]) * POINTS
            if first >= last or not near[p]:
                continue
            y = low[1] + cell[1] * (around[1] + (i + 0.5) / POINTS)
            _cross_solid(body, p, faces, (x, y, first, last), bottom, top)
            for j in range(first, last):
                height = max(bottom[j], floor) if top[j] > max(bottom[j], floor) else np.inf
                heights[i, j] = min(heights[i, j], height)
    return heights


@called_by_kernels
def _find_windows(body: Body, grid: Grid) -> tuple[IntArray, IntArray]:
    """Find the window (rectangle of cells) under the bounding box of each of p solids, and the window around them all.

    Returns:
        The windows of the solids, shape (p, 4), and the window around them, shape (4,): first column, first row, one
        past the last column, one past the last row.
    """
    (shape, _, rotation, position), (size, low, cell) = body, grid
    centres, halves, windows = shape[4], shape[5], np.empty((len(rotation), 4), dtype=np.int64)
    around = np.zeros(4, dtype=np.int64)
    around[0], around[1] = size[0], size[1]
    for p in range(len(rotation)):
        for axis in range(2):
            middle, half = position[p, axis], 0.0
            for i in range(3):
                middle += rotation[p, axis, i] * centres[p, i]
                if rotation[p, axis, i] != 0.0:  # the half edges of a plane are infinite, and 0 times infinity is nan
                    half += abs(rotation[p, axis, i]) * halves[p, i]
            first, last = (middle - half - low[axis]) / cell[axis], (middle + half - low[axis]) / cell[axis]
            windows[p, axis] = math.floor(min(max(first, 0.0), size[axis]))
            windows[p, axis + 2] = math.ceil(min(max(last, 0.0), size[axis]))
        if windows[p, 0] < windows[p, 2] and windows[p, 1] < windows[p, 3]:
            for axis in range(2):
                around[axis] = min(around[axis], windows[p, axis])
                around[axis + 2] = max(around[axis + 2], windows[p, axis + 2])
        else:
            windows[p, 2], windows[p, 3] = windows[p, 0], windows[p, 1]
    return windows, around


@called_by_kernels
def _transform_faces(planes: FloatArray, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Express each of f faces of a polytope as a function of x and y in the array's frame, shape (f, 4).

    The first entry is -1 if the outward normal of the face points downwards, 1 if upwards, and 0 if the face is
    vertical.  The other entries are a, b, c of a + b x + c y [m, -, -].  For a vertical face this is the distance from
    the face, negative outside the solid; otherwise it is the height of the face.
    """
    faces = np.empty((len(planes), 4))
    for f in range(len(planes)):
        u, v, w, offset = planes[f, 0], planes[f, 1], planes[f, 2], planes[f, 3]
        nx = rotation[0, 0] * u + rotation[0, 1] * v + rotation[0, 2] * w
        ny = rotation[1, 0] * u + rotation[1, 1] * v + rotation[1, 2] * w
        nz = rotation[2, 0] * u + rotation[2, 1] * v + rotation[2, 2] * w
        offset += nx * position[0] + ny * position[1] + nz * position[2]
        slope = 1.0 if abs(nz) <= _PARALLEL else nz
        faces[f, 0] = 0.0 if abs(nz) <= _PARALLEL else math.copysign(1.0, nz)
        faces[f, 1], faces[f, 2], faces[f, 3] = offset / slope, -nx / slope, -ny / slope
    return faces


@called_by_kernels
def _cross_solid(body: Body, p: int, faces: FloatArray, line: Line, bottom: FloatArray, top: FloatArray) -> None:
    """Intersect vertical lines with one solid; write the heights of both intersections to `bottom` and `top` [m].

    Where a line misses the solid, `bottom` exceeds `top`.  In the frame of a round solid each line is o + z u, with the
    array's normal u and the height z.

    Args:
        body: The solids and their poses.
        p: Index of the solid.
        faces: Faces of the solid if it is a polytope, see `_transform_faces`.
        line: The lines, at the positions x[first:last] and y.
        bottom: Height at which each line enters the solid, written here [m].
        top: Height at which each line leaves the solid, written here [m].
    """
    (shape, edge, rotation, position), (x, y, first, last) = body, line
    if shape[0][p] == POLYTOPE:
        _cross_faces(faces, line, bottom, top)
        return
    turn, place = rotation[p], position[p]
    # The rotations are written out for single numbers, because passing arrays to a function for each line would double
    # the time.
    kind, size = shape[0][p], (shape[1][p, 0], shape[1][p, 1], shape[1][p, 2])
    up, dy, dz = (turn[2, 0], turn[2, 1], turn[2, 2]), y - place[1], -place[2]
    for j in range(first, last):
        dx = x[j] - place[0]
        ox = turn[0, 0] * dx + turn[1, 0] * dy + turn[2, 0] * dz
        oy = turn[0, 1] * dx + turn[1, 1] * dy + turn[2, 1] * dz
        oz = turn[0, 2] * dx + turn[1, 2] * dy + turn[2, 2] * dz
        if kind == ELLIPSOID:  # A call of its own, because numba does not inline the larger function for all kinds.
            scaled = (ox / size[0], oy / size[1], oz / size[2]), (up[0] / size[0], up[1] / size[1], up[2] / size[2])
            bottom[j], top[j] = _cross_ball(scaled[0], scaled[1], 1.0)
        else:
            bottom[j], top[j] = _cross_round(kind, size, edge, (ox, oy, oz), up)


@called_by_kernels
def _turn_back(turn: FloatArray, x: float, y: float, z: float) -> Vector:
    """Return the components of a vector along axes, given as the columns of a matrix, shape (3, 3)."""
    return (
        turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z,
        turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z,
        turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z,
    )


@called_by_kernels
def _cross_faces(faces: FloatArray, line: Line, bottom: FloatArray, top: FloatArray) -> None:
    """Intersect vertical lines with a polytope; write the heights of both intersections to `bottom` and `top` [m]."""
    x, y, first, last = line
    low, high, place = bottom[first:last], top[first:last], x[first:last]
    for j in range(len(place)):
        low[j], high[j] = -np.inf, np.inf
    for f in range(len(faces)):
        level, slope = faces[f, 1] + faces[f, 3] * y, faces[f, 2]
        if faces[f, 0] < 0:
            for j in range(len(place)):
                low[j] = max(low[j], level + slope * place[j])
        elif faces[f, 0] > 0:
            for j in range(len(place)):
                high[j] = min(high[j], level + slope * place[j])
        else:
            for j in range(len(place)):
                if level + slope * place[j] < 0:
                    high[j] = -np.inf


@called_by_kernels
def _cross_round(kind: int, size: Vector, edge: float, o: Vector, u: Vector) -> tuple[float, float]:
    """Find the interval of s in which the line o + s u lies in an ellipsoid, cylinder or capsule in its own frame."""
    if kind == ELLIPSOID:
        a, b, c = size
        return _cross_ball((o[0] / a, o[1] / b, o[2] / c), (u[0] / a, u[1] / b, u[2] / c), 1.0)
    low, high = _cross_cylinder(size[0], size[1], edge if kind == CYLINDER else 0.0, o, u)
    rim = (1 - _PARALLEL) * size[1]
    if kind == CAPSULE and not (low <= high and abs(o[2] + low * u[2]) < rim and abs(o[2] + high * u[2]) < rim):
        # Beyond its round side, the capsule is the union of the cylinder and of the two balls at its ends.
        if low > high:
            low, high = np.inf, -np.inf
        for sign in (-1.0, 1.0):
            enter, leave = _cross_ball((o[0], o[1], o[2] + sign * size[1]), u, size[0])
            if enter <= leave:
                low, high = min(low, enter), max(high, leave)
    return low, high


@called_by_kernels
def _cross_ball(o: Vector, u: Vector, radius: float) -> tuple[float, float]:
    """Find the two roots s of |o + s u| = radius, lower one first; return (inf, -inf) if no root is real."""
    square = u[0] ** 2 + u[1] ** 2 + u[2] ** 2
    half = o[0] * u[0] + o[1] * u[1] + o[2] * u[2]
    root = half**2 - square * (o[0] ** 2 + o[1] ** 2 + o[2] ** 2 - radius**2)
    if root < 0:
        return np.inf, -np.inf
    return (-half - math.sqrt(root)) / square, (-half + math.sqrt(root)) / square


@called_by_kernels
def _cross_cylinder(radius: float, length: float, edge: float, o: Vector, u: Vector) -> tuple[float, float]:
    """Find the interval of s in which the line o + s u lies in a cylinder about the z axis, |z| < length.

    The radius is enlarged in proportion to uz^2: fully for an upright cylinder, which presses with its sharp edge, and
    not at all for a horizontal cylinder, which presses with its round side.
    """
    radius, length = radius + edge * u[2] ** 2, length + edge
    bottom, top = -np.inf, np.inf
    if abs(u[2]) > _PARALLEL:
        bottom, top = -o[2] / u[2] - abs(length / u[2]), -o[2] / u[2] + abs(length / u[2])
    elif abs(o[2]) > length:
        return np.inf, -np.inf
    if u[0] ** 2 + u[1] ** 2 < _PARALLEL**2:
        return (bottom, top) if o[0] ** 2 + o[1] ** 2 <= radius**2 else (np.inf, -np.inf)
    enter, leave = _cross_ball((o[0], o[1], 0.0), (u[0], u[1], 0.0), radius)
    return max(bottom, enter), min(top, leave)


def cross_lines(
    shape: Shape, rotation: FloatArray, position: FloatArray, points: FloatArray, along: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Kernel: find where lines through k points enter and leave each of p solids.

    Args:
        shape: The solids.
        rotation: Axes of each solid, as columns, shape (p, 3, 3) [-].
        position: Origin of each solid, shape (p, 3) [m].
        points: The points, shape (k, 3) [m].
        along: Direction of each line, of unit length, shape (k, 3) [-].

    Returns:
        Distances along the lines from the points, each of shape (p, k) [m]; inf and -inf for a line that misses.
    """
    enter, leave = np.full((len(position), len(points)), np.inf), np.full((len(position), len(points)), -np.inf)
    for p in range(len(position)):
        size, planes = (shape[1][p, 0], shape[1][p, 1], shape[1][p, 2]), shape[2][shape[3][p] : shape[3][p + 1]]
        for k in range(len(points)):
            x, y, z = points[k, 0] - position[p, 0], points[k, 1] - position[p, 1], points[k, 2] - position[p, 2]
            o = _turn_back(rotation[p], x, y, z)
            u = _turn_back(rotation[p], along[k, 0], along[k, 1], along[k, 2])
            low, high = _cross_line(shape[0][p], size, planes, o, u)
            if low <= high:
                enter[p, k], leave[p, k] = low, high
    return enter, leave


@called_by_kernels
def _cross_line(kind: int, size: Vector, planes: FloatArray, o: Vector, u: Vector) -> tuple[float, float]:
    """Find where a line enters and leaves a solid; it misses if the first distance is larger than the second.

    Args:
        kind: Kind of the solid, see `Solid`.
        size: Size of the solid [m].
        planes: Planes of the faces of a polytope, shape (f, 4) [-, m].
        o: A point of the line in the frame of the solid [m].
        u: Direction of the line in the frame of the solid, of unit length [-].
    """
    if kind != POLYTOPE:
        return _cross_round(kind, size, 0.0, o, u)
    low, high = -np.inf, np.inf
    for f in range(len(planes)):
        speed = planes[f, 0] * u[0] + planes[f, 1] * u[1] + planes[f, 2] * u[2]
        room = planes[f, 3] - (planes[f, 0] * o[0] + planes[f, 1] * o[1] + planes[f, 2] * o[2])
        if speed < -_PARALLEL:
            low = max(low, room / speed)
        elif speed > _PARALLEL:
            high = min(high, room / speed)
        elif room < 0:
            high = -np.inf
    return low, high


def sample_surface(
    body: Body, surface: Surface, chart: Chart, size: tuple[int, int], limits: tuple[float, float]
) -> tuple[Cells, FloatArray, FloatArray, IntArray, FloatArray]:
    """Kernel: measure the gap between a body and a curved surface, and average it over the cells of a chart.

    The gap is measured along the normals of the surface.

    Args:
        body: The solids and their poses.
        surface: The surface.
        chart: The chart.
        size: Numbers of rows and columns of cells.
        limits: Gap above the smallest mean gap up to which cells are kept, with their eight neighbours, and distance
            behind the surface within which a body that has passed it is detected [m].

    Returns:
        The k kept cells.  Positions of their centroids, shape (k, 3) [m], and unit normals there, shape (k, 3) [-].
        Index of the triangle of the surface at the centroid, shape (k,), and the weights of its corners, shape (k, 3)
        [-].
    """
    (points, normals, facets), (origin, axes, low, cell, least), (rows, columns) = surface, chart, size
    places = _place_on_chart(points, normals, origin, axes, least)
    # The middles of all cells are sampled first, and all points of cells at the border of the body or of the surface.
    chosen, heights = np.ones((rows, columns), dtype=np.bool_), np.full((rows * POINTS, columns * POINTS), np.inf)
    owner, lines = _place_samples(places, surface, low, cell, chosen, 1)
    centres = _measure_gaps(body, owner, lines, limits[1])
    highest = centres.min() + 1.5 * limits[0]
    for r in range(rows):
        for c in range(columns):
            least_here, most_here = np.inf, -np.inf
            for k in range(9):
                beside = centres[min(max(r + k // 3 - 1, 0), rows - 1), min(max(c + k % 3 - 1, 0), columns - 1)]
                least_here, most_here = min(least_here, beside), max(most_here, beside)
            chosen[r, c] = least_here <= highest and most_here == np.inf
            if least_here <= highest and most_here < np.inf:
                heights[r * POINTS : (r + 1) * POINTS, c * POINTS : (c + 1) * POINTS] = centres[r, c]
    finer, lines = _place_samples(places, surface, low, cell, chosen, POINTS)
    heights = np.minimum(heights, _measure_gaps(body, finer, lines, limits[1]))
    cells, _ = _average_over_cells(heights, np.array([0, 0, columns, rows]), low, cell, limits[0])
    below = np.zeros(len(cells[0]), dtype=np.int64)
    place, outward, parts = np.zeros((len(below), 3)), np.zeros((len(below), 3)), np.zeros((len(below), 3))
    for k in range(len(below)):
        r, c, x, y = cells[0][k], cells[1][k], cells[3][k], cells[4][k]
        i, j = int((y - low[1]) / cell[1] * POINTS), int((x - low[0]) / cell[0] * POINTS)
        facet = finer[i, j] if chosen[r, c] else owner[r, c]
        # The centroid of a partly covered cell may lie beside the surface.
        for n in range(POINTS**2 if facet < 0 else 0):
            i, j = r * POINTS + n // POINTS, c * POINTS + n % POINTS
            facet = finer[i, j] if heights[i, j] < np.inf else facet
        below[k] = facet
        _weigh_corners(places, facets[facet], x, y, parts[k])
        _interpolate(surface, facets[facet], parts[k], place[k], outward[k])
    return cells, place, outward, below, parts


@called_by_kernels
def _measure_gaps(body: Body, owner: IntArray, lines: FloatArray, behind: float) -> FloatArray:
    """Measure gaps at sampled points along the normals, infinite beside body and surface, shape (rows, columns) [m].

    Args:
        body: The solids and their poses.
        owner: Facet at each sampled point, negative beside the surface, shape (rows, columns).
        lines: Position [m] and unit normal [-] of the surface at each sampled point, shape (rows, columns, 6).
        behind: Distance behind the surface within which a body that has passed it is detected [m].
    """
    (shape, _, rotation, position), gaps = body, np.full(owner.shape, np.inf)
    for p in range(len(position)):
        size, planes = (shape[1][p, 0], shape[1][p, 1], shape[1][p, 2]), shape[2][shape[3][p] : shape[3][p + 1]]
        kind, x, y, z, turn = shape[0][p], position[p, 0], position[p, 1], position[p, 2], rotation[p]
        for i in range(owner.shape[0]):
            for j in range(owner.shape[1]):
                if owner[i, j] >= 0:
                    o = _turn_back(turn, lines[i, j, 0] - x, lines[i, j, 1] - y, lines[i, j, 2] - z)
                    u = _turn_back(turn, lines[i, j, 3], lines[i, j, 4], lines[i, j, 5])
                    enter, leave = _cross_line(kind, size, planes, o, u)
                    if enter <= leave and leave >= -behind:
                        gaps[i, j] = min(gaps[i, j], enter)
    return gaps


@called_by_kernels
def _place_on_chart(
    points: FloatArray, normals: FloatArray, origin: FloatArray, axes: FloatArray, least: float
) -> FloatArray:
    """Compute the coordinates of points on a chart, shape (p, 2) [m]; infinite at points that face away.

    The direction from the origin is that of the projection onto the tangent plane, the distance that in space.
    """
    places = np.full((len(points), 2), np.inf)
    for k in range(len(points)):
        if normals[k, 0] * axes[2, 0] + normals[k, 1] * axes[2, 1] + normals[k, 2] * axes[2, 2] > least:
            x, y, square = 0.0, 0.0, 0.0
            for n in range(3):
                away = points[k, n] - origin[n]
                x, y, square = x + axes[0, n] * away, y + axes[1, n] * away, square + away * away
            flat = math.sqrt(x * x + y * y)
            scale = math.sqrt(square) / flat if flat > 0 else 0.0
            places[k, 0], places[k, 1] = scale * x, scale * y
    return places


@called_by_kernels
def _place_samples(
    places: FloatArray, surface: Surface, low: FloatArray, cell: FloatArray, chosen: BoolArray, parts: int
) -> tuple[IntArray, FloatArray]:
    """Find the surface at parts x parts points of some cells of a chart.

    Returns:
        Facet at each point, negative where there is none, shape (rows, columns) of points; and position [m] and unit
        normal [-] of the surface, shape (rows, columns, 6).
    """
    facets, rows, columns = surface[2], chosen.shape[0] * parts, chosen.shape[1] * parts
    owner, lines = np.full((rows, columns), -1), np.empty((rows, columns, 6))
    weight, point, normal = np.zeros(3), np.zeros(3), np.zeros(3)
    for f in range(len(facets) if chosen.any() else 0):
        ax, ay = places[facets[f, 0], 0], places[facets[f, 0], 1]
        bx, by = places[facets[f, 1], 0], places[facets[f, 1], 1]
        cx, cy = places[facets[f, 2], 0], places[facets[f, 2], 1]
        double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if not 0 < double < np.inf:
            continue
        first = max(math.ceil((min(ax, bx, cx) - low[0]) / cell[0] * parts - 0.5 - 1e-6), 0)
        last = min(math.floor((max(ax, bx, cx) - low[0]) / cell[0] * parts - 0.5 + 1e-6), columns - 1)
        bottom = max(math.ceil((min(ay, by, cy) - low[1]) / cell[1] * parts - 0.5 - 1e-6), 0)
        top = min(math.floor((max(ay, by, cy) - low[1]) / cell[1] * parts - 0.5 + 1e-6), rows - 1)
        for i in range(bottom, top + 1):
            y = low[1] + cell[1] * (i + 0.5) / parts
            for j in range(first, last + 1):
                if not chosen[i // parts, j // parts]:
                    continue
                _weigh_corners(places, facets[f], low[0] + cell[0] * (j + 0.5) / parts, y, weight)
                if min(weight[0], weight[1], weight[2]) >= -1e-6:
                    owner[i, j] = f
                    _interpolate(surface, facets[f], weight, point, normal)
                    for n in range(3):
                        lines[i, j, n], lines[i, j, n + 3] = point[n], normal[n]
    return owner, lines


@called_by_kernels
def _weigh_corners(places: FloatArray, corners: IntArray, x: float, y: float, weight: FloatArray) -> None:
    """Compute the weights of the corners of a facet at a place of the chart, and write them to `weight`, shape (3,)."""
    ax, ay, bx, by = places[corners[0], 0], places[corners[0], 1], places[corners[1], 0], places[corners[1], 1]
    cx, cy = places[corners[2], 0], places[corners[2], 1]
    double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    weight[0] = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / double
    weight[1] = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / double
    weight[2] = 1 - weight[0] - weight[1]


@called_by_kernels
def _interpolate(
    surface: Surface, corners: IntArray, weight: FloatArray, point: FloatArray, normal: FloatArray
) -> None:
    """Interpolate a surface on one facet; write position [m] and unit normal [-] to `point` and `normal`.

    The point is halfway between the flat facet and the mean of its projections onto the planes tangent at the corners
    (Boubekeur and Alexa, Phong tessellation, ACM Trans. Graphics 27, 2008), which is exact on quadratic surfaces.
    """
    points, normals, _ = surface
    size, up_x, up_y, up_z = 0.0, 0.0, 0.0, 0.0
    for n in range(3):
        point[n] = normal[n] = 0.0
        for k in range(3):
            point[n] += weight[k] * points[corners[k], n]
            normal[n] += weight[k] * normals[corners[k], n]
    for k in range(3):
        size += normal[k] * normal[k]
        height = 0.0
        for n in range(3):
            height += 0.5 * weight[k] * (points[corners[k], n] - point[n]) * normals[corners[k], n]
        up_x += height * normals[corners[k], 0]
        up_y += height * normals[corners[k], 1]
        up_z += height * normals[corners[k], 2]
    point[0], point[1], point[2] = point[0] + up_x, point[1] + up_y, point[2] + up_z
    for n in range(3):
        normal[n] /= math.sqrt(size)


@called_by_kernels
def _average_over_cells(
    heights: FloatArray, around: IntArray, low: FloatArray, cell: FloatArray, reach: float
) -> tuple[Cells, float]:
    """Compute coverage, centroid and mean gap of the cells that have sampled points under the body.

    Args:
        heights: Gap at each sampled point, infinite beside the body, shape (rows * POINTS, columns * POINTS) [m].
        around: Window of the sampled cells, see `_find_windows`, shape (4,).
        low: Lowest corner of the contact grid, shape (2,) [m].
        cell: Edge lengths of a cell, shape (2,) [m].
        reach: Gap above the smallest mean gap up to which cells are kept, with their eight neighbours [m].

    Returns:
        The kept cells, and the smallest mean gap of a cell, infinite if there is no cell [m].
    """
    rows, columns = heights.shape[0] // POINTS, heights.shape[1] // POINTS
    # Coverage, x and y of the centroid relative to the centre, and mean gap; one cell around the window has no points.
    found, lowest = np.full((4, rows + 2, columns + 2), np.inf), np.inf
    for r in range(rows):
        for c in range(columns):
            hits, sum_x, sum_y, total, lowest_here = 0, 0.0, 0.0, 0.0, np.inf
            for i in range(POINTS):
                for j in range(POINTS):
                    lowest_here = min(lowest_here, heights[r * POINTS + i, c * POINTS + j])
            for i in range(POINTS):
                for j in range(POINTS):
                    height = heights[r * POINTS + i, c * POINTS + j]
                    if height < np.inf and height <= lowest_here + WALL * cell[0]:
                        hits += 1
                        sum_x += (j + 0.5) / POINTS - 0.5
                        sum_y += (i + 0.5) / POINTS - 0.5
                        total += height
            if hits > 0:
                found[0, r + 1, c + 1], found[3, r + 1, c + 1] = hits / POINTS**2, total / hits
                found[1, r + 1, c + 1], found[2, r + 1, c + 1] = sum_x / hits, sum_y / hits
                lowest = min(lowest, total / hits)
    row, column = np.empty(rows * columns, dtype=np.int64), np.empty(rows * columns, dtype=np.int64)
    values, kept = np.empty((4, rows * columns)), 0
    for r in range(rows):
        for c in range(columns):
            if found[3, r + 1, c + 1] < np.inf:
                least = np.inf
                for k in range(9):
                    least = min(least, found[3, r + k // 3, c + k % 3])
                if least <= lowest + reach:
                    row[kept], column[kept] = around[1] + r, around[0] + c
                    values[0, kept], values[3, kept] = found[0, r + 1, c + 1], found[3, r + 1, c + 1]
                    values[1, kept] = low[0] + (column[kept] + 0.5 + found[1, r + 1, c + 1]) * cell[0]
                    values[2, kept] = low[1] + (row[kept] + 0.5 + found[2, r + 1, c + 1]) * cell[1]
                    kept += 1
    cells = (row[:kept], column[:kept], values[0, :kept], values[1, :kept], values[2, :kept], values[3, :kept])
    return cells, lowest
