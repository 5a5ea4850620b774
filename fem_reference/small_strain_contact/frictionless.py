"""Solve the frictionless contact of one rigid indenter with a cover at small strain.

The contact is solved on rectangular cells in the frame of the indenter.  The number of cells along x and along y is
chosen on its own, so that slender contacts, thin walls of a face and thin covers are resolved too.  If the size of the
contact is not known in advance, the grid of cells shrinks to the contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from fem_reference.errors import ConvergenceError, TooShallowError
from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from fem_reference.small_strain_contact.cell_grid import CellGrid, Face, GapFunction, choose_counts
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator, find_pressures
from fem_reference.small_strain_contact.free_edges import SideEdges
from meshes import Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class FrictionlessSettings:
    """Numbers of the contact of one indenter: refinement of its grid, first guesses, and area."""

    #: Samples of the height of an axisymmetric indenter along its radius [-].
    radii: int = 10_001
    #: Largest number of solutions on successively smaller grids [-].
    refinements: int = 8
    #: Half width of the contact over that of the grid, along each axis, above which the grid is fine enough [-].
    filled: float = 0.8
    #: Half width of a new grid over that of the last contact [-].
    margin: float = 1.1
    #: Smallest ratio of successive half widths of the grid: a grid is at most twenty times smaller than the last [-].
    shrinking: float = 0.05
    #: Share of all cells, those with the smallest gaps, in the initial guess of a contact under a given load [-].
    first_share: float = 0.2
    #: Largest gap over the depth of the cells in the initial guess of a contact at a given depth [-].
    first_depth: float = 0.5
    #: Smallest number of cells in the initial guess of a contact [-].
    first_cells: int = 9
    #: Cells of a grid over those of the coarser grid whose contact is its initial guess, along an axis.  Under a stiff
    #: top layer every exchange of cells peels only one ring off the contact [-].
    coarsening: int = 3
    #: Smallest number of cells of that coarser grid along an axis [-].
    coarsest: int = 16
    #: Half width of the square of cells to which a polynomial is fitted at the edge of the contact [cells].
    fitted: int = 2
    #: Parts of a cell along each axis in which the edge of the contact is located [-].
    parts: int = 12


_SETTINGS = FrictionlessSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactPatch:
    """Solved contact of an indenter, as forces on rectangular cells in the frame of the indenter.

    Attributes:
        x: x coordinates of the centres of the m cells in contact, shape (m,) [m].
        y: y coordinates of these centres, shape (m,) [m].
        force: Contact force on each of these cells, shape (m,) [N].
        cell: Edge lengths of a cell along x and y [m].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
        area: Contact area; the edge of the contact is located within the cells [m2].
    """

    x: FloatArray
    y: FloatArray
    force: FloatArray
    cell: tuple[float, float]
    depth: float
    area: float

    @property
    def total_force(self) -> float:
        """Normal force on the indenter, the sum of the forces on all cells [N]."""
        return float(self.force.sum())


def solve_contact(
    surface: SurfaceCompliance,
    indenter: Indenter,
    *,
    cells: int,
    load: float | None = None,
    depth: float | None = None,
    sides: SideEdges | None = None,
) -> ContactPatch:
    """Press an indenter into a cover, on grids that shrink until at least `cells` cells span the contact.

    Args:
        surface: Compliance of the top of a wide cover.
        indenter: Indenter with its shape.
        cells: Number of cells across the contact along each axis [-].  Slender contacts, faces with walls and thin
            covers get more in proportion, see `choose_counts`.
        load: Normal force [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        sides: Free side edges of the cover; None for a wide cover.

    Raises:
        ValueError: If not exactly one of load and depth is given, or no cell lies on a face with thin walls.
        ConvergenceError: If the contact does not converge; `TooShallowError` if too shallow for any cell to touch.
    """
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth")
    first = (np.zeros(2), np.array(bound_contact(indenter, surface.thickness))) if sides is None else sides.window

    def measure_gap(x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the gap between indenter and cover [m]; inf beside the indenter and beside the cover."""
        value = indenter.gap(x, y)
        return value if sides is None else np.where(sides.contain(x, y), value, np.inf)

    face = Face.measure(measure_gap, *first) if indenter.is_flat else None
    if face is not None:
        first = face.middle, face.half
    fixed = indenter.mirror_symmetry if face is None and sides is None else (True, True)
    middle, half = first
    for _ in range(_SETTINGS.refinements):
        grid = CellGrid.span(middle, half, choose_counts(half, face, surface.scale, cells))
        if face is not None:
            grid = grid.match_area(measure_gap, face)
        addition = None if sides is None else sides.add_compliance(grid.x.ravel(), grid.y.ravel())
        compliance = ComplianceOperator(surface, grid.x.shape, grid.cell, addition)
        gap = measure_gap(*grid.unscaled)
        guess = _guess_from_coarser(surface, measure_gap, grid, half, load=load, depth=depth)
        pressure, approach = _solve(compliance, gap, grid.area, guess, load=load, depth=depth)
        touching = pressure > 0
        # If the gaps of all cells exceed the depth, the contact is around the cell with the smallest gap.
        near = touching if touching.any() else gap == gap.min()
        middle, extent = _enclose(grid, near, middle, fixed)
        if face is not None or (extent > _SETTINGS.filled * half).all():
            break
        middle, half = _clip(
            middle, np.minimum(np.maximum(_SETTINGS.margin * extent, _SETTINGS.shrinking * half), half), first
        )
    if not touching.any():
        raise TooShallowError(f"nothing touches on cells of {max(grid.cell) * 1e3:.2g} mm; press deeper")
    force = pressure[touching] * grid.area
    area = measure_area(pressure, np.isfinite(gap), grid.cell)
    return ContactPatch(x=grid.x[touching], y=grid.y[touching], force=force, cell=grid.cell, depth=approach, area=area)


def _enclose(
    grid: CellGrid, near: BoolArray, middle: FloatArray, keep: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray]:
    """Return the middle and the half widths of a rectangle that contains some cells, shape (2,) each [m].

    The contact of a shape without a plane of symmetry, such as a tilted face, may lie far beside the axis.

    Args:
        grid: Grid of cells.
        near: Whether each cell is to be contained, shape (rows, columns).
        middle: Middle of the present rectangle, shape (2,) [m].
        keep: Whether to keep this middle along x, and along y.
    """
    low, high = (np.array([bound(grid.x[near]), bound(grid.y[near])]) for bound in (np.min, np.max))
    middle = np.where(keep, middle, (low + high) / 2)
    return middle, np.maximum(high - middle, middle - low) + np.array(grid.cell) / 2


def _clip(middle: FloatArray, half: FloatArray, first: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Clip a rectangle to the first rectangle, so that cell edges stay on the sharp edges of a tilted face.

    Rectangles are given and returned as middle and half widths, shape (2,) each [m].
    """
    low = np.maximum(middle - half, first[0] - first[1])
    high = np.minimum(middle + half, first[0] + first[1])
    return (low + high) / 2, (high - low) / 2


def bound_contact(indenter: Indenter, thickness: float) -> tuple[float, float]:
    """Compute half widths along x and y that no contact exceeds before the indenter pierces the cover [m].

    These are the half widths of the footprint, or for an axisymmetric indenter those of the part of its surface that is
    lower than the cover thickness [m].
    """
    if not indenter.axisymmetric:
        return indenter.footprint
    r = np.linspace(0, indenter.footprint[0], _SETTINGS.radii)
    low = np.flatnonzero(indenter.gap(r, np.zeros_like(r)) <= thickness)
    radius = float(r[min(int(low[-1]) + 1, len(r) - 1)])
    return radius, radius


def guess_touching(gap: FloatArray, depth: float | None) -> BoolArray:
    """Guess the cells in contact: all cells of a flat face, else those with the smallest gaps.

    Args:
        gap: Gap at each cell before the indenter moves, inf where no contact is possible, shape (rows, columns) [m].
        depth: Approach of the indenter [m]; None if the load is given.

    Returns:
        Whether each cell is in the initial guess, shape (rows, columns).
    """
    allowed = np.isfinite(gap)
    heights = gap[allowed]
    if (heights == 0).all():
        return allowed
    if depth is None:
        return np.asarray(allowed & (gap <= np.quantile(heights, _SETTINGS.first_share)))
    few = float(np.sort(heights)[min(_SETTINGS.first_cells, heights.size) - 1])
    return np.asarray(allowed & (gap <= max(few, _SETTINGS.first_depth * depth)))


def _guess_from_coarser(
    surface: SurfaceCompliance,
    measure_gap: GapFunction,
    grid: CellGrid,
    half: FloatArray,
    *,
    load: float | None,
    depth: float | None,
) -> BoolArray | None:
    """Guess the cells in contact from a solution on a coarser grid of the same rectangle, itself guessed in this way.

    The guess is larger than the contact of the coarser grid by one of its cells on each side.  Cells too many are
    removed in few exchanges; with cells too few, a stiff top layer would overlap the indenter nearly everywhere.

    Args:
        surface: Compliance of the top of a wide cover; free side edges do not matter for a guess.
        measure_gap: Function that computes the gap.
        grid: Grid of cells.
        half: Half widths of the rectangle that the grid divides, shape (2,) [m].
        load: Normal force [N], or None.
        depth: Approach of the indenter [m], or None.

    Returns:
        Whether each cell is in the guess, shape (rows, columns); None if the grid is too coarse for a coarser one.
    """
    counts = np.array(grid.x.shape) // _SETTINGS.coarsening
    if counts.min() < _SETTINGS.coarsest:
        return None
    coarse = CellGrid.span(grid.middle, half, counts)
    gap = measure_gap(coarse.x, coarse.y)
    if not np.isfinite(gap).any():
        return None
    compliance = ComplianceOperator(surface, coarse.x.shape, coarse.cell)
    guess = _guess_from_coarser(surface, measure_gap, coarse, half, load=load, depth=depth)
    try:
        touching = _solve(compliance, gap, coarse.area, guess, load=load, depth=depth)[0] > 0
    except ConvergenceError:
        return None
    touching = ndimage.binary_dilation(touching, np.ones((3, 3), dtype=bool))
    rows, columns = (np.arange(n) * m // n for n, m in zip(grid.x.shape, counts, strict=True))
    return touching[np.ix_(rows, columns)]


def _solve(
    compliance: ComplianceOperator,
    gap: FloatArray,
    area: float,
    guess: BoolArray | None,
    *,
    load: float | None,
    depth: float | None,
) -> tuple[FloatArray, float]:
    """Solve for the pressures [Pa] on cells of given area [m2], and the approach [m], at a given load or depth.

    The initial guess of the cells in contact is `guess`, or else that of `guess_touching`.
    """
    shed = guess is not None
    touching = guess_touching(gap, depth) if guess is None else guess & np.isfinite(gap)
    if not touching.any():
        touching = guess_touching(gap, depth)
    if load is None and depth is not None:
        return find_pressures(compliance, gap - depth, touching, shed=shed)[0], depth
    sums = np.array([(load or 0.0) / area])
    pressure, motion = find_pressures(compliance, gap, touching, columns=np.ones((1, *gap.shape)), sums=sums, shed=shed)
    return pressure, float(motion[0])


def measure_area(pressure: FloatArray, allowed: BoolArray, cell: tuple[float, float]) -> float:
    """Measure the contact area.

    Towards the edge of a contact under a smooth surface, the square of the pressure decreases to zero linearly with the
    distance from the edge (Johnson, Contact Mechanics, 1985, section 4.2).  A quadratic polynomial is fitted to the
    squared pressure of the 5 x 5 cells around the nearest cell that is surrounded by cells in contact, and its zero is
    the edge.  Where the polynomial does not vanish near the edge, cells count as a whole.

    Args:
        pressure: Pressure on every cell, positive in contact, shape (rows, columns) [Pa].
        allowed: Whether contact is possible on each cell, shape (rows, columns).
        cell: Edge lengths of a cell along x and y [m].

    Returns:
        Area [m2].
    """
    touching = pressure > 0
    ring = np.ones((3, 3), dtype=bool)
    known = ndimage.binary_erosion(touching, ring, iterations=_SETTINGS.fitted)
    # Beside cells that cannot touch, the contact ends at the edge of the indenter, where the pressure does not vanish.
    whole = ndimage.binary_erosion(touching | ~allowed, ring, iterations=_SETTINGS.fitted, border_value=1) & touching
    if not known.any():
        return float(touching.sum() * cell[0] * cell[1])
    band = ndimage.binary_dilation(touching, ring) & allowed & ~whole
    source = ndimage.distance_transform_edt(~known, sampling=cell, return_distances=False, return_indices=True)
    place = np.nonzero(band)
    nearest = source[0][place], source[1][place]
    share = np.zeros(len(place[0]))
    fitted = _fit_squares(pressure**2, nearest)
    part = (np.arange(_SETTINGS.parts) + 0.5) / _SETTINGS.parts - 0.5
    for u in part:
        for v in part:
            x, y = place[0] - nearest[0] + u, place[1] - nearest[1] + v
            share += (_list_powers(x, y) * fitted).sum(axis=0) > 0
    share /= _SETTINGS.parts**2
    inside = touching[place]
    share[(share == 1) & ~inside] = 0.0
    share[(share == 0) & inside] = 1.0
    return float((share.sum() + whole.sum()) * cell[0] * cell[1])


def _fit_squares(values: FloatArray, place: tuple[IntArray, IntArray]) -> FloatArray:
    """Fit a quadratic polynomial to the 5 x 5 values around each of m places, coefficients of shape (6, m)."""
    offset = np.arange(-_SETTINGS.fitted, _SETTINGS.fitted + 1)
    rows, columns = (each.ravel() for each in np.meshgrid(offset, offset, indexing="ij"))
    around = np.array([values[place[0] + i, place[1] + j] for i, j in zip(rows, columns, strict=True)])
    return np.asarray(np.linalg.pinv(_list_powers(rows.astype(float), columns.astype(float)).T) @ around)


def _list_powers(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the terms of a quadratic polynomial of x and y, shape (6, ...)."""
    return np.array([np.ones(np.shape(x)), x, y, x * x, y * y, x * y])
