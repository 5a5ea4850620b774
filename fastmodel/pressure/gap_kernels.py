# ruff: noqa: PLR0917 -- kernels take plain numbers by position
"""Compiled kernels that sample the gap under one body; `gap_sampling` calls them.

All stand in one file: numba's cache notices a change in the file of the called kernel only, not in the files of the
functions that this kernel calls.
"""

from __future__ import annotations

import math

import numpy as np

from fastmodel.compiled import called_by_kernels
from fastmodel.pressure.gap import CAPSULE, CYLINDER, ELLIPSOID, POLYTOPE
from meshes.array_types import FloatArray, IntArray

#: Row, column, coverage, x, y and gap of cells, each of shape (m,); see `GapSamples`.
Cells = tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]

#: Points along each edge of a cell at which the gap is taken.
POINTS = 4
#: Component of a unit vector below which it counts as zero: a face or axis is then parallel to the normal or to the
#: array's plane [-].
_PARALLEL = 1e-9


def sample_body(
    shape: tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray],
    edge: float,
    rotation: FloatArray,
    position: FloatArray,
    grid: tuple[IntArray, FloatArray, FloatArray],
    reach: float,
) -> Cells:
    """Sample the gap under one body and average it over cells.

    Args:
        shape: See `BodyShape.arrays`.
        edge: Distance by which sharp edges are enlarged [m].
        rotation: Axes of each solid in the array's frame, as columns, shape (p, 3, 3) [-].
        position: Origin of each solid, shape (p, 3) [m].
        grid: Columns and rows of the grid, its lowest corner [m] and the edges of a cell [m], each of shape (2,).
        reach: Height over the lowest cell up to which cells are kept [m].
    """
    kinds, sizes, planes, first_plane, centres, halves = shape
    size, low, cell = grid
    windows, around = _find_windows(rotation, position, centres, halves, size, low, cell)
    rows, columns = max(around[3] - around[1], 0) * POINTS, max(around[2] - around[0], 0) * POINTS
    heights, x = np.empty((rows, columns)), np.empty(columns)
    bottom, top = np.empty(columns), np.empty(columns)
    for j in range(columns):
        x[j] = low[0] + cell[0] * (around[0] + (j + 0.5) / POINTS)
        for i in range(rows):
            heights[i, j] = np.inf
    for p in range(len(kinds)):
        faces = _transform_faces(planes[first_plane[p] : first_plane[p + 1]], rotation[p], position[p])
        first, last = (windows[p, 0] - around[0]) * POINTS, (windows[p, 2] - around[0]) * POINTS
        for i in range((windows[p, 1] - around[1]) * POINTS, (windows[p, 3] - around[1]) * POINTS):
            y = low[1] + cell[1] * (around[1] + (i + 0.5) / POINTS)
            if kinds[p] == POLYTOPE:
                _cross_faces(faces, x, y, first, last, bottom, top)
            else:
                _cross_round(kinds[p], sizes[p], edge, rotation[p], position[p], x, y, first, last, bottom, top)
            for j in range(first, last):
                height = bottom[j] if -np.inf < bottom[j] <= top[j] else np.inf
                heights[i, j] = min(heights[i, j], height)
    return _average_over_cells(heights, around, low, cell, reach)


@called_by_kernels
def _find_windows(
    rotation: FloatArray,
    position: FloatArray,
    centres: FloatArray,
    halves: FloatArray,
    size: IntArray,
    low: FloatArray,
    cell: FloatArray,
) -> tuple[IntArray, IntArray]:
    """Windows of cells under the bounding box of each solid, shape (p, 4), and around all of them, shape (4,).

    A window is its first column and row, and one past its last column and row.
    """
    windows = np.empty((len(rotation), 4), dtype=np.int64)
    around = np.zeros(4, dtype=np.int64)
    around[0], around[1] = size[0], size[1]
    for p in range(len(rotation)):
        for axis in range(2):
            middle, half = position[p, axis], 0.0
            for i in range(3):
                middle += rotation[p, axis, i] * centres[p, i]
                if rotation[p, axis, i] != 0.0:  # 0 times inf is nan: half edges of a plane are infinite
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
    """Express each face as a function of the place (x, y) in the array's frame, shape (f, 4).

    The first entry is -1 if the face bounds vertical lines from below, 1 from above, 0 if it stands vertical.  The
    others are a, b, c of a + b x + c y: the height of the face; for a vertical face, the distance to it, negative
    outside [m, -, -].
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
def _cross_faces(
    faces: FloatArray, x: FloatArray, y: float, first: int, last: int, bottom: FloatArray, top: FloatArray
) -> None:
    """Interval in which vertical lines at x[first:last] and y cross a polytope, into `bottom` and `top` [m]."""
    low, high = bottom[first:last], top[first:last]
    place = x[first:last]
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
def _cross_round(
    kind: int,
    size: FloatArray,
    edge: float,
    rotation: FloatArray,
    position: FloatArray,
    x: FloatArray,
    y: float,
    first: int,
    last: int,
    bottom: FloatArray,
    top: FloatArray,
) -> None:
    """The same for an ellipsoid, cylinder or capsule.

    Lines are written as o + z u in the frame of the solid, with u the array's normal.
    """
    ux, uy, uz = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    for j in range(first, last):
        dx, dy, dz = x[j] - position[0], y - position[1], -position[2]
        ox = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
        oy = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
        oz = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
        if kind == ELLIPSOID:
            a, b, c = size
            bottom[j], top[j] = _cross_ball(ox / a, oy / b, oz / c, ux / a, uy / b, uz / c, 1.0)
            continue
        bottom[j], top[j] = _cross_cylinder(size[0], size[1], edge if kind == CYLINDER else 0.0, ox, oy, oz, ux, uy, uz)
        if kind == CAPSULE:
            # a point belongs to the capsule if it belongs to the cylinder or to one of the two balls at its ends
            low, high = (bottom[j], top[j]) if bottom[j] <= top[j] else (np.inf, -np.inf)
            for sign in (-1.0, 1.0):
                enter, leave = _cross_ball(ox, oy, oz + sign * size[1], ux, uy, uz, size[0])
                if enter <= leave:
                    low, high = min(low, enter), max(high, leave)
            bottom[j], top[j] = low, high


@called_by_kernels
def _cross_ball(ox: float, oy: float, oz: float, ux: float, uy: float, uz: float, radius: float) -> tuple[float, float]:
    """Roots z of |o + z u| = radius; an empty interval where there are none."""
    square = ux**2 + uy**2 + uz**2
    half = ox * ux + oy * uy + oz * uz
    root = half**2 - square * (ox**2 + oy**2 + oz**2 - radius**2)
    if root < 0:
        return np.inf, -np.inf
    return (-half - math.sqrt(root)) / square, (-half + math.sqrt(root)) / square


@called_by_kernels
def _cross_cylinder(
    radius: float, length: float, edge: float, ox: float, oy: float, oz: float, ux: float, uy: float, uz: float
) -> tuple[float, float]:
    """Interval in which a line crosses a cylinder about the z axis, -length < z < length.

    The radius is enlarged in proportion to uz^2: fully for an upright cylinder, which presses with its sharp edge, and
    not at all for a lying one, which presses with its round side.
    """
    radius += edge * uz**2
    length += edge
    bottom, top = -np.inf, np.inf
    if abs(uz) > _PARALLEL:
        bottom, top = -oz / uz - abs(length / uz), -oz / uz + abs(length / uz)
    elif abs(oz) > length:
        return np.inf, -np.inf
    if ux**2 + uy**2 < _PARALLEL**2:
        return (bottom, top) if ox**2 + oy**2 <= radius**2 else (np.inf, -np.inf)
    enter, leave = _cross_ball(ox, oy, 0.0, ux, uy, 0.0, radius)
    return max(bottom, enter), min(top, leave)


@called_by_kernels
def _average_over_cells(
    heights: FloatArray, around: IntArray, low: FloatArray, cell: FloatArray, reach: float
) -> Cells:
    """Coverage, centroid and mean gap of the cells with any point under the body, up to `reach` over the lowest."""
    rows, columns = heights.shape[0] // POINTS, heights.shape[1] // POINTS
    row, column = np.empty(rows * columns, dtype=np.int64), np.empty(rows * columns, dtype=np.int64)
    found, count, lowest = np.empty((4, rows * columns)), 0, np.inf
    for r in range(rows):
        for c in range(columns):
            hits, sum_x, sum_y, total = 0, 0.0, 0.0, 0.0
            for i in range(POINTS):
                for j in range(POINTS):
                    height = heights[r * POINTS + i, c * POINTS + j]
                    if height < np.inf:
                        hits += 1
                        sum_x += (j + 0.5) / POINTS - 0.5
                        sum_y += (i + 0.5) / POINTS - 0.5
                        total += height
            if hits > 0:
                row[count], column[count] = around[1] + r, around[0] + c
                found[0, count], found[3, count] = hits / POINTS**2, total / hits
                found[1, count] = low[0] + (column[count] + 0.5 + sum_x / hits) * cell[0]
                found[2, count] = low[1] + (row[count] + 0.5 + sum_y / hits) * cell[1]
                lowest = min(lowest, found[3, count])
                count += 1
    kept = 0
    for k in range(count):
        if found[3, k] <= lowest + reach:
            row[kept], column[kept] = row[k], column[k]
            for field in range(4):
                found[field, kept] = found[field, k]
            kept += 1
    return row[:kept], column[:kept], found[0, :kept], found[1, :kept], found[2, :kept], found[3, :kept]
