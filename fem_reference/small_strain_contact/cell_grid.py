"""Divide the plane under an indenter into rectangular cells, fine enough for the contact, its walls and the cover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class GridSettings:
    """Numbers that choose the cells of a contact and measure the face of an indenter."""

    #: Samples along each side of a rectangle around a face [-].
    samples: int = 801
    #: Parts along each side of a sample at the outline, in each of which one point is tested [-].
    parts: int = 8
    #: Smallest number of cells of the repeated pattern along an axis [-].
    least: int = 16
    #: Largest number of cells of the repeated pattern along an axis [-].
    most: int = 96
    #: Largest number of cells of the repeated pattern, to limit the computing time [-].
    most_in_all: int = 3600
    #: Grids that are up to this factor finer are tried for one that fits the edges of the face better [-].
    finer: float = 1.2
    #: Cells across the walls of a face, where a pattern is repeated nine times [-].
    per_wall: int = 45
    #: Cells per thickness of the top layer, where a pattern is repeated nine times [-].
    per_layer: int = 4
    #: Share of a face that lies on walls thinner than the wall that the cells resolve [-].
    thin_share: float = 0.1
    #: Smallest jump of the width of a face, over its largest width, that counts as a straight edge [-].
    jump: float = 0.05
    #: Largest jump of the width of a face over four samples at a straight edge, over that over two [-].
    sharp: float = 1.2
    #: Largest distance between an edge and a cell edge, over a cell, that counts as a fit [-].
    fit: float = 0.02


_SETTINGS = GridSettings()


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
            size = 2e3 * half.max() / _SETTINGS.samples
            raise ValueError(f"no point of a grid of {size:.2g} mm lies on the indenter's face: its walls are too thin")
        step = 2 * half / _SETTINGS.samples
        low, high, walls, edges = np.empty(2), np.empty(2), np.empty(2), []
        for axis in range(2):
            lines = np.moveaxis(share, axis, 0)
            width = lines.sum(axis=1)
            ends = _find_end(width), _SETTINGS.samples - _find_end(width[::-1])
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
        """Area of a cell [m2]."""
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
        layer: Thickness of the top layer of the cover [m].
        cells: Number of cells along an axis that needs no refinement; a multiple of 16 [-].

    Returns:
        Numbers of cells, shape (2,).
    """
    wanted = 2 * half / layer * _SETTINGS.per_layer / 9
    edges: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0))
    if face is not None:
        wanted = np.maximum(wanted, 2 * half / face.walls * _SETTINGS.per_wall / 9)
        edges = face.edges
    pattern = np.clip(wanted, _SETTINGS.least, _SETTINGS.most)
    excess = pattern.prod() / _SETTINGS.most_in_all
    if excess > 1:
        pattern = np.maximum(pattern / np.sqrt(excess), _SETTINGS.least)
    counts = cells // _SETTINGS.least * np.ceil(pattern).astype(int)
    return np.array([_fit_edges(int(n), each) for n, each in zip(counts, edges, strict=True)])


def _sample(gap: GapFunction, middle: FloatArray, half: FloatArray) -> FloatArray:
    """Return the share of each sample of a fine regular grid over a rectangle that lies on the face [-]."""
    step = 2 * half / _SETTINGS.samples
    centres = [m - h + (np.arange(_SETTINGS.samples) + 0.5) * s for m, h, s in zip(middle, half, step, strict=True)]
    x, y = np.meshgrid(*centres, indexing="ij")
    inside: BoolArray = np.isfinite(gap(x, y))
    around = np.ones((3, 3), dtype=bool)
    outline = ndimage.binary_dilation(inside, around) & ~ndimage.binary_erosion(inside, around)
    # One point at random in each part, so that the rounding to whole parts does not add up along a straight edge.
    u, v = (each.ravel() for each in np.indices((_SETTINGS.parts, _SETTINGS.parts)))
    chance = np.random.default_rng(0).random((2, int(outline.sum()), _SETTINGS.parts**2))
    u, v = ((each + jitter) / _SETTINGS.parts - 0.5 for each, jitter in zip((u, v), chance, strict=True))
    share = inside.astype(float)
    points = x[outline][:, None] + step[0] * u, y[outline][:, None] + step[1] * v
    share[outline] = np.isfinite(gap(*points)).mean(axis=1)
    return share


def _find_end(width: FloatArray) -> float:
    """Find the position at which a face begins from its width at every sample; the first sample counts in part."""
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
    return float(length[np.searchsorted(length.cumsum(), _SETTINGS.thin_share * length.sum())])


def _find_edges(width: FloatArray) -> FloatArray:
    """Find the straight edges of a face from its width at every sample, as positions in samples.

    At a straight edge the width jumps within one sample, and is the same before and after it, unlike along a curved
    edge.  The width of the sample that contains the edge tells the position within the sample.
    """
    padded = np.pad(width, 2, mode="edge")
    jump = np.abs(padded[3:-1] - padded[1:-3])
    around = np.abs(padded[4:] - padded[:-4])
    largest = ndimage.maximum_filter1d(jump, 3, mode="constant")
    middle = np.flatnonzero(
        (jump > _SETTINGS.jump * width.max()) & (jump == largest) & (around < _SETTINGS.sharp * jump)
    )
    middle = middle[np.diff(middle, prepend=-2) > 1]  # an edge between two samples is found in both
    before, own, after = (padded[middle + shift] for shift in (1, 2, 3))
    return np.asarray(middle + (after - own) / (after - before))


def _fit_edges(least: int, edges: FloatArray) -> int:
    """Find the smallest number of cells, at least `least`, that fits edges; the best of all tried if none does."""
    tried = np.arange(least, int(_SETTINGS.finer * least) + 1)
    miss = np.array([np.abs(n * edges - np.round(n * edges)).max(initial=0.0) for n in tried])
    return int(tried[np.argmax(miss < _SETTINGS.fit)] if (miss < _SETTINGS.fit).any() else tried[miss.argmin()])
