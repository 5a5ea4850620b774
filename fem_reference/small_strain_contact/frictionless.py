"""Solve the frictionless contact of one rigid indenter with a cover at small strain.

The contact is solved on rectangular cells in the frame of the indenter.  The number of cells along x and along y is
chosen on its own, so that slender contacts, thin walls of a face and thin covers are resolved too.  If the size of the
contact is not known in advance, the grid of cells shrinks to the contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy import ndimage

from fem_reference.errors import ConvergenceError, TooShallowError
from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator, find_pressures
from meshes import Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray


class ContactPlace(Protocol):
    """Place of a contact on a cover that is not flat and wide: its gaps and its compliance.

    Coordinates x and y are those of the cells [m].
    """

    @property
    def is_face(self) -> bool:
        """Whether the contact is a flat face."""

    @property
    def window(self) -> tuple[FloatArray, FloatArray]:
        """Middle and half widths of the rectangle that is divided into cells, shape (2,) each [m]."""

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the gap between indenter and cover [m]; inf where no contact is possible."""

    def rate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the decrease of the gap per approach of the indenter [-]."""

    def compliance(
        self, surface: SurfaceCompliance, x: FloatArray, y: FloatArray, cell: tuple[float, float]
    ) -> ComplianceOperator:
        """Create the map from pressures on cells to their displacements.

        Args:
            surface: Compliance of the top of a wide cover.
            x: Middles of the cells, shape (rows, columns).
            y: Middles of the cells, same shape.
            cell: Edge lengths of a cell along x and y [m].
        """


@dataclass(frozen=True, kw_only=True)
class GridSettings:
    """Constants for the choice of cells of a contact, and for the measurement of an indenter's flat face."""

    #: Number of samples along each side of the rectangle around a flat face, in its measurement [-].
    samples: int = 801
    #: Parts along each side of a sample at the outline, in each of which one point is tested [-].
    parts: int = 8
    #: Smallest number of cells along an axis in the pattern that all grids of a contact repeat [-].
    least: int = 16
    #: Largest number of cells along an axis in the pattern that all grids of a contact repeat [-].
    most: int = 96
    #: Largest number of cells in the pattern that all grids of a contact repeat, to limit the computing time [-].
    most_in_all: int = 1600
    #: Largest number of cells along an axis that is tried, over the wanted number [-].  Edges of the face may coincide
    #: with edges of cells only on a finer grid.
    finer: float = 1.2
    #: Number of cells across a thin wall of a face on the grid that repeats the pattern nine times [-].
    per_wall: int = 45
    #: Number of cells per thickness of the top layer on the grid that repeats the pattern nine times [-].
    per_layer: int = 4
    #: Share of a face on walls that are thinner than the wall thickness that the cells must resolve [-].
    thin_share: float = 0.1
    #: Smallest change of the width of a face between neighbouring samples, over its largest width, that counts as a
    #: straight edge [-].
    jump: float = 0.05
    #: Largest change of the width of a face over four samples at a straight edge, over the change over two samples [-].
    sharp: float = 1.2
    #: Largest distance between an edge of the face and the nearest cell edge, over the size of a cell, at which both
    #: count as coincident [-].
    fit: float = 0.02


_GRID = GridSettings()


#: Function that computes the gap between indenter and cover [m] from x and y [m]; inf where no contact is possible.
GapFunction = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Face:
    """Flat face of an indenter, measured on a fine regular grid of samples.

    Attributes:
        middle: Middle of the rectangle along x and y that bounds the face, shape (2,) [m].
        half: Half widths of this rectangle, shape (2,) [m].
        area: Area of the face [m2].
        walls: Width, along x and along y, that nearly all walls of the face have at least, shape (2,) [m].
        edges: Positions of the straight edges across x and across y within the rectangle, from 0 to 1 [-].
    """

    middle: FloatArray
    half: FloatArray
    area: float
    walls: FloatArray
    edges: tuple[FloatArray, FloatArray]

    @classmethod
    def measure(cls, gap: GapFunction, middle: FloatArray, half: FloatArray) -> Face:
        """Measure the face that a gap function describes within a rectangle of given middle and half widths.

        Raises:
            ValueError: If no sample lies on the face.
        """
        share = _sample(gap, middle, half)
        if not share.any():
            size = 2e3 * half.max() / _GRID.samples
            raise ValueError(f"no point of a grid of {size:.2g} mm lies on the indenter's face: its walls are too thin")
        step = 2 * half / _GRID.samples
        low, high, walls, edges = np.empty(2), np.empty(2), np.empty(2), []
        for axis in range(2):
            lines = np.moveaxis(share, axis, 0)
            width = lines.sum(axis=1)
            ends = _find_end(width), _GRID.samples - _find_end(width[::-1])
            low[axis], high[axis] = (middle - half)[axis] + step[axis] * np.array(ends)
            walls[axis] = step[axis] * _measure_walls(lines > 0.5)  # noqa: PLR2004 -- half covered
            edges.append((_find_edges(width) - ends[0]) / (ends[1] - ends[0]))
        area = float(share.sum() * step.prod())
        return cls(middle=(low + high) / 2, half=(high - low) / 2, area=area, walls=walls, edges=(edges[0], edges[1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """Grid of equal rectangular cells around the middle of a rectangle.

    Attributes:
        x: x coordinates of the centres of the cells, shape (rows, columns) [m].
        y: y coordinates of the centres of the cells, shape (rows, columns) [m].
        cell: Edge lengths of a cell along x and y [m].
        middle: Middle of the rectangle, shape (2,) [m].
        scale: Factor by which the cells were scaled about the middle [-].
    """

    x: FloatArray
    y: FloatArray
    cell: tuple[float, float]
    middle: FloatArray
    scale: float = 1.0

    @classmethod
    def span(cls, middle: FloatArray, half: FloatArray, counts: IntArray) -> CellGrid:
        """Divide a rectangle of given middle and half widths into given numbers of cells along x and y."""
        cell = 2 * half / counts
        axes = [
            start + (np.arange(n) - (n - 1) / 2) * edge for start, n, edge in zip(middle, counts, cell, strict=True)
        ]
        x, y = np.meshgrid(*axes, indexing="ij")
        return cls(x=x, y=y, cell=(float(cell[0]), float(cell[1])), middle=middle)

    def match_area(self, gap: GapFunction, face: Face) -> CellGrid:
        """Scale the cells so that the cells inside a flat face have the same total area as the face.

        The area of the rectangles inside a curved edge deviates irregularly from that of the face; with the right area
        the error decreases smoothly with the cell size and can be extrapolated.
        """
        own = int(np.isfinite(gap(self.x, self.y)).sum())
        if not own:
            size = 1e3 * max(self.cell)
            raise ValueError(f"no cell of {size:.2g} mm has its middle on the indenter's face: its walls are too thin")
        scale = np.sqrt(face.area / (own * self.area))
        x, y = (m + (place - m) * scale for m, place in zip(self.middle, (self.x, self.y), strict=True))
        cell = (self.cell[0] * float(scale), self.cell[1] * float(scale))
        return CellGrid(x=x, y=y, cell=cell, middle=self.middle, scale=float(scale))

    @property
    def area(self) -> float:
        """Area of one cell of the grid [m2]."""
        return self.cell[0] * self.cell[1]

    @property
    def unscaled(self) -> tuple[FloatArray, FloatArray]:
        """Positions (x, y) of the cell centres before scaling, which determine the cells under the indenter [m]."""
        x, y = (m + (place - m) / self.scale for m, place in zip(self.middle, (self.x, self.y), strict=True))
        return x, y


def choose_counts(half: FloatArray, face: Face | None, layer: float, cells: int) -> IntArray:
    """Choose the numbers of cells along x and y that divide a rectangle.

    All grids repeat one pattern of cells, which has at least 16 cells along each axis, more where walls of the face or
    the top layer are thin.  Every grid is then made finer until straight edges of the face along x or y coincide with
    edges of cells.

    Args:
        half: Half widths of the rectangle, shape (2,) [m].
        face: Flat face that the rectangle bounds; None for a curved indenter, whose contact fills the rectangle.
        layer: Distance over which the top layer of the cover spreads a load [m].
        cells: Number of cells along an axis that needs no refinement; a multiple of 16 [-].

    Returns:
        Numbers of cells, shape (2,).
    """
    wanted = 2 * half / layer * _GRID.per_layer / 9
    edges: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0))
    if face is not None:
        wanted = np.maximum(wanted, 2 * half / face.walls * _GRID.per_wall / 9)
        edges = face.edges
    pattern = np.clip(wanted, _GRID.least, _GRID.most)
    excess = pattern.prod() / _GRID.most_in_all
    if excess > 1:
        pattern = np.maximum(pattern / np.sqrt(excess), _GRID.least)
    counts = cells // _GRID.least * np.ceil(pattern).astype(int)
    return np.array([_fit_edges(int(n), each) for n, each in zip(counts, edges, strict=True)])


def _sample(gap: GapFunction, middle: FloatArray, half: FloatArray) -> FloatArray:
    """Measure which part of each sample of a fine regular grid lies on the flat face of an indenter.

    Args:
        gap: Gap function, finite on the face.
        middle: Middle of the rectangle that is sampled, shape (2,) [m].
        half: Half widths of the rectangle, shape (2,) [m].

    Returns:
        Part of each sample that lies on the face, from 0 to 1, shape (samples, samples) [-].
    """
    step = 2 * half / _GRID.samples
    centres = [m - h + (np.arange(_GRID.samples) + 0.5) * s for m, h, s in zip(middle, half, step, strict=True)]
    x, y = np.meshgrid(*centres, indexing="ij")
    inside: BoolArray = np.isfinite(gap(x, y))
    around = np.ones((3, 3), dtype=bool)
    outline = ndimage.binary_dilation(inside, around) & ~ndimage.binary_erosion(inside, around)
    # One random point is tested in each part of a sample at the outline.  With regular points the errors of the parts
    # would add up along a straight edge.
    u, v = (each.ravel() for each in np.indices((_GRID.parts, _GRID.parts)))
    chance = np.random.default_rng(0).random((2, int(outline.sum()), _GRID.parts**2))
    u, v = ((each + jitter) / _GRID.parts - 0.5 for each, jitter in zip((u, v), chance, strict=True))
    share = inside.astype(float)
    points = x[outline][:, None] + step[0] * u, y[outline][:, None] + step[1] * v
    share[outline] = np.isfinite(gap(*points)).mean(axis=1)
    return share


def _find_end(width: FloatArray) -> float:
    """Find the position along an axis at which a face begins.

    Args:
        width: Width of the face at every sample along the axis, shape (n,) [samples].

    Returns:
        Position [samples]; the first sample counts in the proportion of its width to the next one.
    """
    first = int(np.flatnonzero(width)[0])
    following = width[min(first + 1, len(width) - 1)]
    return first + 1 - min(1.0, float(width[first] / max(following, width[first])))


def _measure_walls(lines: BoolArray) -> float:
    """Measure the thin walls of a sampled face across its lines: all but a small share of the face is on wider walls.

    Args:
        lines: Whether each sample lies on the face; walls are measured along the first axis.

    Returns:
        Width of the walls [samples].
    """
    change = np.diff(np.pad(lines.T, ((0, 0), (1, 1))).astype(int), axis=1)
    length = np.sort(np.nonzero(change == -1)[1] - np.nonzero(change == 1)[1])
    if not length.size:
        return 1.0
    return float(length[np.searchsorted(length.cumsum(), _GRID.thin_share * length.sum())])


def _find_edges(width: FloatArray) -> FloatArray:
    """Find the straight edges of a face from its width at every sample, as positions in samples.

    At a straight edge the width jumps within one sample, and is the same before and after it, unlike along a curved
    edge.  The width of the sample that contains the edge tells the position within the sample.
    """
    padded = np.pad(width, 2, mode="edge")
    jump = np.abs(padded[3:-1] - padded[1:-3])
    around = np.abs(padded[4:] - padded[:-4])
    largest = ndimage.maximum_filter1d(jump, 3, mode="constant")
    middle = np.flatnonzero((jump > _GRID.jump * width.max()) & (jump == largest) & (around < _GRID.sharp * jump))
    # An edge exactly between two samples is found in both of them and must count once.
    middle = middle[np.diff(middle, prepend=-2) > 1]
    before, own, after = (padded[middle + shift] for shift in (1, 2, 3))
    return np.asarray(middle + (after - own) / (after - before))


def _fit_edges(least: int, edges: FloatArray) -> int:
    """Find the number of cells along an axis whose edges coincide with the edges of a face.

    Args:
        least: Smallest number of cells [-].
        edges: Positions of the edges of the face within the divided length, from 0 to 1 [-].

    Returns:
        The smallest number that fits; the best of all that are tried if none fits.
    """
    tried = np.arange(least, int(_GRID.finer * least) + 1)
    miss = np.array([np.abs(n * edges - np.round(n * edges)).max(initial=0.0) for n in tried])
    return int(tried[np.argmax(miss < _GRID.fit)] if (miss < _GRID.fit).any() else tried[miss.argmin()])


@dataclass(frozen=True, kw_only=True)
class FrictionlessSettings:
    """Constants of the contact of one indenter: refinement of its grid, first guesses, and area."""

    #: Number of samples of the height of an indenter of revolution along its radius, to bound its contact [-].
    radii: int = 10_001
    #: Largest number of times that a contact is solved, on grids that shrink to its size [-].
    refinements: int = 8
    #: Half width of the contact over that of the grid, along each axis, above which the grid no longer shrinks [-].
    filled: float = 0.8
    #: Half width of a new grid, over the half width of the contact on the previous grid [-].
    margin: float = 1.1
    #: Smallest ratio of successive half widths of the grid: a grid is at most twenty times smaller than the last [-].
    shrinking: float = 0.05
    #: Share of all cells, those with the smallest gaps, in the initial guess of a contact under a given load [-].
    first_share: float = 0.2
    #: Largest gap over the depth of the cells in the initial guess of a contact at a given depth [-].
    first_depth: float = 0.5
    #: Smallest number of cells in the initial guess of the contact at a given depth [-].
    first_cells: int = 9
    #: Number of cells of a grid along an axis, over that of the coarser grid whose contact is its initial guess [-].
    #: Without a good guess many changes of the set of cells in contact are needed, because under a stiff top layer each
    #: change removes only one ring of cells.
    coarsening: int = 3
    #: Smallest number of cells along an axis of a coarser grid whose contact is the initial guess on a finer one [-].
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
        shear: Frictional force on each of these cells along x and y, shape (2, m) [N]; None without friction.
        shear_work: Sum of these forces times the displacements of the cells [J].
    """

    x: FloatArray
    y: FloatArray
    force: FloatArray
    cell: tuple[float, float]
    depth: float
    area: float
    shear: FloatArray | None = None
    shear_work: float = 0.0

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
    sides: ContactPlace | None = None,
) -> ContactPatch:
    """Press an indenter into a cover, on grids that shrink until at least `cells` cells span the contact.

    Args:
        surface: Compliance of the top of a wide cover.
        indenter: Indenter with its shape.
        cells: Number of cells across the contact along each axis [-].  Slender contacts, faces with walls and thin
            covers get more in proportion, see `choose_counts`.
        load: Normal force [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        sides: Place with its own gaps and additional compliance; None for a wide flat cover.

    Raises:
        ValueError: If not exactly one of load and depth is given, or no cell lies on a face with thin walls.
        ConvergenceError: If the contact does not converge; `TooShallowError` if too shallow for any cell to touch.
    """
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth")
    first = (np.zeros(2), np.array(bound_contact(indenter, surface.thickness))) if sides is None else sides.window

    measure_gap = indenter.gap if sides is None else sides.gap
    is_face = indenter.is_flat if sides is None else sides.is_face
    face = Face.measure(measure_gap, *first) if is_face else None
    if face is not None:
        first = face.middle, face.half
    fixed = indenter.mirror_symmetry if face is None and sides is None else (True, True)
    middle, half = first
    for _ in range(_SETTINGS.refinements):
        grid = CellGrid.span(middle, half, choose_counts(half, face, surface.bending, cells))
        if face is not None:
            grid = grid.match_area(measure_gap, face)
        if sides is None:
            compliance = ComplianceOperator(surface, grid.x.shape, grid.cell)
        else:
            compliance = sides.compliance(surface, grid.x, grid.y, grid.cell)
        gap = measure_gap(*grid.unscaled)
        guess = _guess_from_coarser(surface, measure_gap, grid, half, load=load, depth=depth)
        rate = None if sides is None or load is None else sides.rate(grid.x, grid.y)
        pressure, approach = _solve(compliance, gap, grid.area, guess, load=load, depth=depth, rate=rate)
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
    """Clip a rectangle of cells to the first rectangle, so that cell edges stay on the sharp edges of a tilted face.

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
    """Guess the cells in contact from solutions on coarser grids of the same rectangle, the coarsest first.

    Under a stiff top layer a guess that is one coarse cell larger on each side doubles the number of exchanges, because
    each of them removes one ring of cells.

    Args:
        surface: Compliance of the top of a wide cover; free side edges do not matter for a guess.
        measure_gap: Function that computes the gap.
        grid: Grid of cells.
        half: Half widths of the rectangle that the grid divides, shape (2,) [m].
        load: Normal force [N], or None.
        depth: Approach of the indenter [m], or None.

    Returns:
        Whether each cell is in the guess, shape (rows, columns); None if the grid is too coarse for a coarser one, or
        if the contact on the coarser grid does not converge.
    """
    shapes = [np.array(grid.x.shape)]
    while (counts := shapes[-1] // _SETTINGS.coarsening).min() >= _SETTINGS.coarsest:
        shapes.append(counts)
    guess: BoolArray | None = None
    for counts, finer in pairwise(reversed(shapes)):
        coarse = CellGrid.span(grid.middle, half, counts)
        gap, before, guess = measure_gap(coarse.x, coarse.y), guess, None
        if not np.isfinite(gap).any():
            continue
        compliance = ComplianceOperator(surface, coarse.x.shape, coarse.cell)
        try:
            touching = _solve(compliance, gap, coarse.area, before, load=load, depth=depth)[0] > 0
        except ConvergenceError:
            continue
        rows, columns = (np.arange(n) * m // n for n, m in zip(finer, counts, strict=True))
        guess = touching[np.ix_(rows, columns)]
    return guess


def _solve(
    compliance: ComplianceOperator,
    gap: FloatArray,
    area: float,
    guess: BoolArray | None,
    *,
    load: float | None,
    depth: float | None,
    rate: FloatArray | None = None,
) -> tuple[FloatArray, float]:
    """Solve for the pressures [Pa] on cells of given area [m2], and the approach [m], at a given load or depth.

    The initial guess of the cells in contact is `guess`, or else that of `guess_touching`.  `rate` is the motion
    against the normal of each cell per approach [-]; None for 1.
    """
    shed = guess is not None
    touching = guess_touching(gap, depth) if guess is None else guess & np.isfinite(gap)
    if not touching.any():
        touching = guess_touching(gap, depth)
    if load is None and depth is not None:
        return find_pressures(compliance, gap - depth, touching, shed=shed)[0], depth
    sums = np.array([(load or 0.0) / area])
    columns = np.ones((1, *gap.shape)) if rate is None else rate[None]
    pressure, motion = find_pressures(compliance, gap, touching, columns=columns, sums=sums, shed=shed)
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
    """Fit a quadratic polynomial of x and y to the 5 x 5 values around each of m cells.

    Args:
        values: Values on all cells, shape (rows, columns).
        place: Row and column of each of the m cells, shape (m,) each.

    Returns:
        Coefficients of the terms of `_list_powers`, shape (6, m).
    """
    offset = np.arange(-_SETTINGS.fitted, _SETTINGS.fitted + 1)
    rows, columns = (each.ravel() for each in np.meshgrid(offset, offset, indexing="ij"))
    around = np.array([values[place[0] + i, place[1] + j] for i, j in zip(rows, columns, strict=True)])
    return np.asarray(np.linalg.pinv(_list_powers(rows.astype(float), columns.astype(float)).T) @ around)


def _list_powers(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the terms of a quadratic polynomial of x and y, shape (6, ...)."""
    return np.array([np.ones(np.shape(x)), x, y, x * x, y * y, x * y])
