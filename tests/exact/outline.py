"""Press a rigid flat face of any outline into a wide cover by boundary elements, to verify the finite elements.

The face is a set of quadrangles, which shrink toward the edges of the face, where the pressure is singular.  The
pressure is constant on each.  Displacement and depth are compared at the centres.  The compliance of the cover is
that of a half space, whose integral over a polygon is exact (a sum over its sides: Johnson, Contact Mechanics, 1985,
section 3.3), plus a smooth excess (`boundary`), integrated with Gauss points.  Where the contact would have to pull,
the face separates from the cover.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from meshes import Box, Cover, Indenter
from meshes.array_types import FloatArray
from meshes.indenters.shapes import PolygonalPunch
from tests.exact.active_set import solve_active_set
from tests.exact.boundary import (
    Excess,
    PressedCells,
    collect_rectangles,
    measure_areas,
    place_gauss_points,
    tabulate_excess,
)

#: Gauss points along each side of a quadrangle: for distances above `_NEAR` diagonals, and for smaller ones [-].
_FAR_POINTS, _NEAR_POINTS = 2, 6
_NEAR = 2.5
#: Largest size of a quadrangle over the thickness of the cover [-].
_LARGEST = 0.6
#: Coordinates closer than this count as equal [m].
_COINCIDENT = 1e-9
#: Number of matrix rows that are computed at once, to limit the memory [-].
_ROWS = 64


def press_face(cover: Cover, indenter: Indenter, depth: float, *, cells: int = 12) -> PressedCells:
    """Press a rigid indenter with a flat face into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Box, nut, or prism and letter with sides along x and y only.
        depth: Approach of the indenter from first touch [m].
        cells: Number of quadrangles between two edges of the face; more where these would be larger than `_LARGEST`
            thicknesses of the cover [-].

    Raises:
        TypeError: If the indenter is not one of these shapes.
        ValueError: If the outline has oblique sides and is not that of a nut.
        RuntimeError: If the contact does not converge.
    """
    corners = split_face(indenter, cells, _LARGEST * cover.thickness * 12 / cells)
    matrix = assemble_compliance(tabulate_excess(cover), corners)
    pressure = solve_active_set(matrix, np.full(len(corners), depth))
    hit = pressure > 0
    area = float(measure_areas(corners[hit]).sum())
    return PressedCells(cover=cover, depth=depth, corners=corners[hit], pressure=pressure[hit], contact_area=area)


def split_face(indenter: Indenter, cells: int, largest: float) -> FloatArray:
    """Split a flat face into quadrangles that shrink toward its edges, corners of shape (m, 4, 2) [m].

    Args:
        indenter: Indenter with a flat face.
        cells: Smallest number of quadrangles between two edges [-].
        largest: Largest size of a quadrangle [m].

    Raises:
        TypeError: As for `press_face`.
        ValueError: As for `press_face`.
    """
    if isinstance(indenter, Box):
        a, b = indenter.footprint
        return _split_rectilinear([[(-a, -b), (a, -b), (a, b), (-a, b)]], cells, largest, indenter)
    if not isinstance(indenter, PolygonalPunch):
        raise TypeError(f"no boundary elements for the face of {type(indenter).__name__}")
    polygons = [[(float(x), float(y)) for x, y in each] for each in indenter.polygons]
    sides = [np.diff(np.array([*each, each[0]]), axis=0) for each in polygons]
    if all((np.abs(side) < _COINCIDENT).any(axis=1).all() for side in sides):
        return _split_rectilinear(polygons, cells, largest, indenter)
    if len(polygons) == 2 and len(polygons[0]) == len(polygons[1]):
        return _split_frame(np.array(polygons[0]), np.array(polygons[1]), cells, largest)
    raise ValueError("no boundary elements for a face with oblique sides and without a bore like its outline")


def _grade(start: float, end: float, cells: int, largest: float) -> FloatArray:
    """Place nodes between two edges, denser toward both for a square-root singularity [m]."""
    count = max(cells, int(np.ceil(np.pi / 2 * (end - start) / largest)))
    return start + (end - start) * (1 - np.cos(np.linspace(0, np.pi, count + 1))) / 2


def _split_rectilinear(
    polygons: Sequence[Sequence[tuple[float, float]]], cells: int, largest: float, indenter: Indenter
) -> FloatArray:
    """Split a face with sides along x and y on a grid through all its sides, shape (m, 4, 2) [m]."""
    nodes = []
    for axis in (0, 1):
        values = np.sort([corner[axis] for polygon in polygons for corner in polygon])
        lines = values[np.concatenate([[True], np.diff(values) > _COINCIDENT])]
        parts = [_grade(a, b, cells, largest)[:-1] for a, b in pairwise(lines)]
        nodes.append(np.concatenate([*parts, lines[-1:]]))
    corners = collect_rectangles(*nodes)
    middle = corners.mean(axis=1)
    return corners[np.isfinite(indenter.gap(*middle.T))]


def _split_frame(outer: FloatArray, inner: FloatArray, cells: int, largest: float) -> FloatArray:
    """Split the face between two polygons of n corners each into quadrangles, sector by sector, shape (m, 4, 2) [m]."""
    out = []
    for i in range(len(outer)):
        wall = float(np.linalg.norm(outer[i] - inner[i]))
        s = _grade(0.0, 1.0, cells, largest / wall)
        t = _grade(0.0, 1.0, cells, largest / float(np.linalg.norm(outer[i] - outer[i - 1])))
        a, b, c, d = inner[i - 1], outer[i - 1], outer[i], inner[i]
        u, v = s[:, None, None], t[None, :, None]
        grid = a * (1 - u) * (1 - v) + b * u * (1 - v) + c * u * v + d * (1 - u) * v
        out.append(_collect_quadrangles(grid))
    return np.concatenate(out)


def _collect_quadrangles(grid: FloatArray) -> FloatArray:
    """Collect the quadrangles of a structured grid of points, shape (rows, columns, 2), as shape (m, 4, 2)."""
    return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 2)


def assemble_compliance(excess: Excess, corners: FloatArray) -> FloatArray:
    """Assemble the displacement at each centre (rows) per pressure on each quadrangle (columns), shape (m, m) [m/Pa].

    Args:
        excess: Displacement under a point load beyond that of a half space.
        corners: Corners of the quadrangles, shape (m, 4, 2) [m].
    """
    target = corners.mean(axis=1)
    diagonal = np.hypot(*(corners[:, 2] - corners[:, 0]).T)
    far, near = (place_gauss_points(corners, n) for n in (_FAR_POINTS, _NEAR_POINTS))
    out = np.empty((len(corners), len(corners)))
    for start in range(0, len(target), _ROWS):
        rows = slice(start, start + _ROWS)
        at = target[rows, None, :]
        out[rows] = excess.half_space * integrate_reciprocal_distance(at, corners)
        for k in range(far[1].shape[1]):
            out[rows] += excess(np.hypot(*np.moveaxis(far[0][:, k] - at, -1, 0))) * far[1][:, k]
        i, j = np.nonzero(np.hypot(*np.moveaxis(target - at, -1, 0)) < _NEAR * diagonal)
        distance = {n: np.hypot(*np.moveaxis(p[j] - at[i], -1, 0)) for n, (p, _) in enumerate((far, near))}
        out[i + start, j] += (excess(distance[1]) * near[1][j]).sum(axis=1) - (excess(distance[0]) * far[1][j]).sum(
            axis=1
        )
    return out


def integrate_reciprocal_distance(at: FloatArray, corners: FloatArray) -> FloatArray:
    """Integrate 1 / distance from points over convex quadrangles of their plane [m].

    Args:
        at: Points (x, y), shape (n, 1, 2) [m].
        corners: Corners of the quadrangles in order, shape (m, 4, 2) [m].

    Returns:
        The integrals, shape (n, m) [m].
    """
    x, y = (corners[:, 2] - corners[:, 0]).T
    u, v = (corners[:, 3] - corners[:, 1]).T
    turn = np.sign(x * v - y * u)
    out = np.zeros((len(at), len(corners)))
    for i in range(4):
        start, end = corners[:, i], corners[:, (i + 1) % 4]
        length = np.hypot(*(end - start).T)
        tangent = (end - start) / np.where(length > 0, length, 1.0)[:, None]
        first = ((start - at) * tangent).sum(axis=-1)
        height = (at - start)[..., 0] * -tangent[:, 1] + (at - start)[..., 1] * tangent[:, 0]
        distance = np.maximum(np.abs(height), 1e-300)
        out += height * (np.arcsinh((first + length) / distance) - np.arcsinh(first / distance))
    return np.asarray(out * turn)
