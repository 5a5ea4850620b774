"""Solve the contact of a rigid frictionless indenter with a wide cover by boundary elements.

A wide cover is so large that its edges have no effect.  The method uses the exact compliance of the cover and no finite
elements; it verifies contacts of shapes without an exact solution.  The contact pressure is constant on each of many
rectangular cells, which shrink toward the edge of the contact, so that few cells resolve the singular pressure at the
edge.  Displacement and gap are compared at the centres of the cells, and an active-set method finds the contact area.
The compliance is split into the compliance of a half space, integrated exactly (Love 1929; Johnson, Contact Mechanics,
1985, eq. 3.25), and a smooth remainder, integrated with four Gauss points per cell.  Shapes must be symmetric about
x = 0 and y = 0; one quarter is solved.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import fht, fhtoffset
from scipy.interpolate import CubicSpline

from fem_reference.closed_form.contact import LOGARITHMIC_HALF_WIDTH, LOGARITHMIC_POINTS
from fem_reference.closed_form.layer import tabulate_texel_response, transfer
from meshes import Cover, Indenter, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose
from tests.exact.active_set import solve_active_set

#: Exponent of the power law that weights the integrand of the Hankel transform, so that it vanishes at both ends [-].
_BIAS = -0.5
#: Product of wave number and thickness of the top layer beyond which the cover responds like a half space: exp(-2 x 30)
#: = 1e-26 [-].
_DEEP = 30.0
#: Distance of the two Gauss points on a side of a cell from the middle of the side, over the length of the side [-].
_GAUSS = 0.5 / np.sqrt(3)
#: Half width of the grid over that of the contact, and range of their ratio outside which the grid is changed [-].
_MARGIN, _FILLED, _TIGHT = 1.1, 0.8, 0.999
#: Largest number of grids that are tried [-].
_GRIDS = 12
#: Number of points along each axis at which the first estimate of the contact is sought [-].
_SAMPLES = 4001
#: Largest size of a cell over the thickness of the cover, times the number of cells along a side [-].
_LARGEST = 7.2
#: Gauss points along each side of a cell for the superposition of texel forces [-].
_TEXEL_POINTS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Excess:
    """Displacement of the top of a cover under a unit point load, less that of a half space of the top layer.

    Attributes:
        half_space: Displacement times distance on the half space, (1 - nu) / (2 pi mu) [m2/N].
        table: Excess over the logarithm of the distance from the load [m/N].
    """

    half_space: float
    table: CubicSpline

    def __call__(self, distance: FloatArray) -> FloatArray:
        """Evaluate the excess at distances r >= 0 from the load, any shape [m/N]."""
        logarithm = np.log(np.maximum(distance, np.exp(self.table.x[0])))
        return np.asarray(self.table(np.minimum(logarithm, self.table.x[-1])))


def tabulate_excess(cover: Cover) -> Excess:
    """Tabulate the displacement of a wide cover's top under a unit point load, beyond that of a half space.

    (1 / 2 pi) int (C(k) - c / k) J0(k r) k dk, with the compliance C of the cover and c = (1 - nu) / mu of its top
    layer.  The integrand is -c at k = 0; the transform -c / sqrt(r^2 + b^2) of -c exp(-b k) is separated to make it
    vanish there.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
    """
    top = cover.layers[-1]
    plane = (1 - top.material.poisson_ratio) / top.material.shear_modulus
    step = 2 * LOGARITHMIC_HALF_WIDTH / LOGARITHMIC_POINTS
    middle = 1 / np.sqrt(top.thickness * cover.thickness)
    k = middle * np.exp(step * (np.arange(LOGARITHMIC_POINTS) + 0.5) - LOGARITHMIC_HALF_WIDTH)
    deep = k * top.thickness > _DEEP
    known = transfer(cover, np.where(deep, _DEEP / top.thickness, k)).compliance
    excess = np.where(deep, 0.0, known * k - plane)
    offset = fhtoffset(step, 0.0, bias=_BIAS)
    shifted = fht(excess + plane * np.exp(-k * cover.thickness), step, 0.0, offset=offset, bias=_BIAS)
    r = np.exp(offset) / k[::-1]
    value = (shifted / r - plane / np.hypot(r, cover.thickness)) / (2 * np.pi)
    inside = (r > 1e-4 * top.thickness) & (r < 1e4 * cover.thickness)
    return Excess(half_space=plane / (2 * np.pi), table=CubicSpline(np.log(r[inside]), value[inside]))


def superpose(cover: Cover, array: TexelArray, x: FloatArray, y: FloatArray, force: FloatArray) -> FloatArray:
    """Compute the forces on the n texels of an array under point loads on a wide cover, shape (n,) [N].

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        array: Array with the texels.
        x: x coordinates of the m loads in the frame of the array, shape (m,) [m].
        y: y coordinates of the loads, shape (m,) [m].
        force: Loads, shape (m,) [N].
    """
    response = tabulate_texel_response(cover, array.texel_size)
    out = np.array([response(x - cx, y - cy) @ force for cx, cy in array.centres[:, :2]])
    return np.where(array.active, out, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedCells:
    """Solved contact of a rigid indenter with a cover, as pressures on quadrangles in the frame of the indenter.

    Attributes:
        cover: The cover that was pressed.
        depth: Approach of the indenter from first touch [m].
        corners: Corners (x, y) of the m quadrangles in contact, shape (m, 4, 2) [m].
        pressure: Contact pressure on each, shape (m,) [Pa].
        contact_area: Contact area, with the edge of a curved contact found between cells [m2].
    """

    cover: Cover
    depth: float
    corners: FloatArray
    pressure: FloatArray
    contact_area: float

    @cached_property
    def force(self) -> FloatArray:
        """Contact force on each quadrangle, shape (m,) [N]."""
        return np.asarray(self.pressure * measure_areas(self.corners))

    @property
    def total_force(self) -> float:
        """Normal force on the indenter [N]."""
        return float(np.sum(self.force))

    @property
    def centres(self) -> FloatArray:
        """Centres (x, y) of the quadrangles, shape (m, 2) [m]."""
        return np.asarray(self.corners.mean(axis=1))

    def texel_forces(self, array: TexelArray, pose: Pose | None = None) -> FloatArray:
        """Compute the forces on the n texels of an array by superposition of exact texel responses.

        Args:
            array: Array with the texels.
            pose: Pose of the indenter in the frame of the array; the indenter is above its origin if None.

        Returns:
            Force on each texel; 0 on inactive texels, which measure nothing, shape (n,) [N].
        """
        points, weights = place_gauss_points(self.corners, _TEXEL_POINTS)
        x, y = points.reshape(-1, 2).T
        if pose is not None:
            x, y = pose.to_array(x, y)
        return superpose(self.cover, array, x, y, (self.pressure[:, None] * weights).ravel())


def measure_areas(corners: FloatArray) -> FloatArray:
    """Measure the areas of quadrangles from their corners in order, shape (m, 4, 2) [m].

    Returns:
        Areas, shape (m,) [m2].
    """
    x, y = (corners[:, 2] - corners[:, 0]).T
    u, v = (corners[:, 3] - corners[:, 1]).T
    return np.asarray(np.abs(x * v - y * u) / 2)


def place_gauss_points(corners: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Place Gauss points in quadrangles.

    Args:
        corners: Corners of the quadrangles, shape (m, 4, 2) [m].
        count: Number of points along each side [-].

    Returns:
        Points, shape (m, count^2, 2) [m], and weights, shape (m, count^2) [m2].
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    s, t = (each.ravel()[:, None] for each in np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2, indexing="ij"))
    a, b, c, d = (corners[:, i, None] for i in range(4))
    along, across = (b - a) * (1 - t) + (c - d) * t, (d - a) * (1 - s) + (c - b) * s
    jacobian = np.abs(along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0])
    points = a * (1 - s) * (1 - t) + b * s * (1 - t) + c * s * t + d * (1 - s) * t
    return points, jacobian * np.outer(weights, weights).ravel() / 4


def collect_rectangles(x: FloatArray, y: FloatArray) -> FloatArray:
    """Collect the corners of the cells of a tensor grid, x slowest, from its nodes.

    Args:
        x: Nodes along x, ascending, shape (i + 1,) [m].
        y: Nodes along y, ascending, shape (j + 1,) [m].

    Returns:
        Corners, shape (i * j, 4, 2) [m].
    """
    ends = ((x[:-1], y[:-1]), (x[1:], y[:-1]), (x[1:], y[1:]), (x[:-1], y[1:]))
    grids = [np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1) for u, v in ends]
    return np.stack(grids, axis=2).reshape(-1, 4, 2)


def pressed_shape(cover: Cover, indenter: Indenter, depth: float, *, cells: int = 24) -> PressedCells:
    """Press a rigid indenter that is symmetric about x = 0 and y = 0 into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Indenter with its shape.
        depth: Approach of the indenter from first touch [m].
        cells: Number of boundary elements along each side of the solved quarter; more where these would be larger than
            `_LARGEST / cells` thicknesses of the cover [-].

    Returns:
        The contact pressures on the cells in contact.

    Raises:
        RuntimeError: If the active-set method or the search for the extent of the contact does not converge.
    """
    largest = _LARGEST / cells * cover.thickness
    footprint = np.array(indenter.footprint)
    half = np.minimum(_MARGIN * _estimate_contact(indenter, depth), footprint)
    for _ in range(_GRIDS):
        x, y = (_grade_toward_edge(extent, cells, largest) for extent in half)
        u, v = (each.ravel() for each in np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, indexing="ij"))
        wide, high = (each.ravel() for each in np.meshgrid(np.diff(x), np.diff(y), indexing="ij"))
        pressure = solve_active_set(_assemble(cover, u, v, wide, high), depth - indenter.gap(u, v))
        hit = pressure > 0
        touched = np.array([(u + wide / 2)[hit].max(), (v + high / 2)[hit].max()])
        full = (touched > _TIGHT * half) & (half < footprint)
        if not full.any() and (touched > _FILLED * half).all():
            break
        half = np.minimum(np.where(full, 1.4, _MARGIN) * touched, footprint)
    else:
        raise RuntimeError(f"no grid fits the contact after {_GRIDS} attempts")
    quarter = collect_rectangles(x, y)[hit]
    images = [quarter * [a, b] for a in (1, -1) for b in (1, -1)]
    return PressedCells(
        cover=cover,
        depth=depth,
        corners=np.concatenate(images),
        pressure=np.tile(pressure[hit], 4),
        contact_area=4 * _measure_contact(x, y, pressure.reshape(len(x) - 1, -1), indenter),
    )


def _estimate_contact(indenter: Indenter, depth: float) -> FloatArray:
    """Estimate half widths of the contact along x and y: where the undeformed surfaces would meet, shape (2,) [m]."""
    out = []
    for axis, extent in enumerate(indenter.footprint):
        points = np.zeros((2, _SAMPLES))
        points[axis] = extent * np.linspace(0, 1, _SAMPLES) ** 2
        below = np.flatnonzero(indenter.gap(*points) < depth)
        out.append(points[axis, min(below[-1] + 1, _SAMPLES - 1)])
    return np.array(out)


def _measure_contact(x: FloatArray, y: FloatArray, pressure: FloatArray, indenter: Indenter) -> float:
    """Measure the contact area of the solved quarter [m2].

    Along x the contact ends where the square of the pressure, extrapolated from the last two cells, is zero: at the
    edge of a curved contact the pressure grows with the square root of the distance.  A contact that reaches the
    outline of the indenter ends there.  Open cells further in do not count: on a stiff top over a soft layer a contact
    may touch along its rim only.
    """
    middle = (x[1:] + x[:-1]) / 2
    width = np.zeros(len(y) - 1)
    for j, column in enumerate(pressure.T):
        hit = np.flatnonzero(column > 0)
        if not len(hit):
            continue
        last = hit[-1]
        width[j] = x[last + 1]
        if x[last + 1] < indenter.footprint[0] * _TIGHT and last > 0 and column[last - 1] > column[last]:
            before, after = column[last - 1] ** 2, column[last] ** 2
            edge = middle[last] + after * (middle[last] - middle[last - 1]) / (before - after)
            width[j] = min(edge, x[min(last + 2, len(x) - 1)])
        width[j] -= np.diff(x)[:last][column[:last] <= 0].sum()
    return float(width @ np.diff(y))


def _grade_toward_edge(extent: float, cells: int, largest: float) -> FloatArray:
    """Place nodes from 0 to `extent`, spaced for a pressure with a square-root singularity at `extent` [m]."""
    count = max(cells, int(np.ceil(np.pi / 2 * extent / largest)))
    return extent * np.sin(np.linspace(0, np.pi / 2, count + 1))


def _assemble(cover: Cover, u: FloatArray, v: FloatArray, wide: FloatArray, high: FloatArray) -> FloatArray:
    """Assemble the compliance matrix of the m cells of a quarter of the contact.

    Args:
        cover: Cover under the indenter.
        u: x coordinates of the centres of the cells, shape (m,) [m].
        v: y coordinates of the centres, shape (m,) [m].
        wide: Sizes of the cells along x, shape (m,) [m].
        high: Sizes of the cells along y, shape (m,) [m].

    Returns:
        Displacement at each centre (rows) per pressure on each cell and its three mirror images (columns), shape (m, m)
        [m/Pa].
    """
    excess = tabulate_excess(cover)
    out = np.zeros((len(u), len(u)))
    for a in (1, -1):
        for b in (1, -1):
            dx, dy = u[:, None] - a * u, v[:, None] - b * v
            out += excess.half_space * _integrate_distance(dx, dy, wide / 2, high / 2)
            for s in (_GAUSS, -_GAUSS):
                for t in (_GAUSS, -_GAUSS):
                    out += excess(np.hypot(dx + s * wide, dy + t * high)) * (wide * high / 4)
    return out


def _integrate_distance(x: FloatArray, y: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Integrate 1 / distance from (x, y) over rectangles with half sides a and b around the origin [m]."""
    out = np.zeros_like(x)
    for s in (1, -1):
        for t in (1, -1):
            p, q = x + s * a, y + t * b
            r = np.hypot(p, q)
            out += s * t * (p * np.arctanh(q / r) + q * np.arctanh(p / r))
    return out
