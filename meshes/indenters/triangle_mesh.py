"""Indenter bounded by a closed surface of triangles: height of its lower surface, and convex hulls that replace it.

MuJoCo only collides convex solids.  Only the underside of a body touches a cover.  The space above the underside, up to
the body's top, therefore counts as solid.  Vertical planes cut the underside into pieces.  Each piece is replaced by
the convex hull of the piece and of the space above it.  The error is the distance by which a hull reaches below the
underside into empty space.  The piece with the largest error is cut again until the error is within a tolerance.  Where
the underside is convex, the hull is exact.
"""

from __future__ import annotations

import heapq
import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.indenters.shapes import Indenter, Primitive, find_tolerance, require_axis_inside
from meshes.surfaces.triangles import enclosed_volume, normal_vectors


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of the checks and measures of a body of triangles."""

    #: Value below which a ratio counts as zero [-]; above rounding.  The ratios are the volume over the cube of the
    #: body's size, and the height over the size.
    zero: float = 1e-9
    #: Grid points along x and along y at which the gap is compared with its mirror image [-]; chosen by judgement.
    symmetry_points: int = 61
    #: Distance below which the middles of two edges coincide, so that the edges are the same, over the larger half
    #: width of the body [-]; rounding of single precision.
    same_place: float = 1e-6
    #: Angle between two facets above which their common side is an edge of the body and not part of a smooth surface
    #: [rad]; 29 degrees, chosen by judgement.
    edge_angle: float = 0.5


_NUMBERS = _Numbers()


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh(Indenter):
    """A body bounded by n triangles, with its lowest point at z = 0 and its axis through the origin.

    Two bodies are equal when their triangles are equal and in the same order.

    Attributes:
        triangles: Corners (x, y, z) of each triangle, counterclockwise as seen from outside, shape (n, 3, 3) [m].
    """

    triangles: FloatArray

    def __post_init__(self) -> None:
        """Check the triangles and make them read-only; whether the surface is closed is not checked here.

        Raises:
            ValueError: If the shape is wrong, a number is not finite, the triangles face inwards or enclose no volume,
                the lowest point is not at z = 0, or the axis lies outside the bounding rectangle.
        """
        corners = np.array(self.triangles, dtype=np.float64)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):  # noqa: PLR2004
            raise ValueError(f"triangles must have the shape (n, 3, 3), not {corners.shape}")
        if not np.isfinite(corners).all():
            raise ValueError("the corners of all triangles must be finite")
        size = float(np.ptp(corners, axis=(0, 1)).max())
        if not enclosed_volume(corners) > _NUMBERS.zero * size**3:
            raise ValueError("the surface holds no volume, or its triangles face inwards")
        if abs(corners[..., 2].min()) > _NUMBERS.zero * size:
            raise ValueError(f"the lowest point must stand at z = 0, not at {corners[..., 2].min()} m")
        require_axis_inside(corners[..., :2].reshape(-1, 2))
        corners.setflags(write=False)
        object.__setattr__(self, "triangles", corners)

    def __eq__(self, other: object) -> bool:
        """Return whether the other object is a body with equal triangles in the same order."""
        return isinstance(other, TriangleMesh) and np.array_equal(self.triangles, other.triangles)

    def __hash__(self) -> int:
        """Return a hash of the triangles."""
        return hash(self.triangles.tobytes())

    @cached_property
    def is_flat(self) -> bool:
        """Whether every triangle that faces down lies in the plane z = 0."""
        return not self._lower[..., 2].any()

    @cached_property
    def mirror_symmetry(self) -> tuple[bool, bool]:
        """Whether the gap is symmetric about the plane x = 0, and whether about the plane y = 0.

        The gap and its mirror image are compared at the points of a grid.
        """
        half = self.footprint
        x, y = np.meshgrid(*(np.linspace(-h, h, _NUMBERS.symmetry_points) for h in half))
        gap = np.nan_to_num(self.gap(x, y), posinf=-1.0)
        tolerance = find_tolerance(half)
        in_x, in_y = (bool(np.abs(gap - np.flip(gap, axis)).max() < tolerance) for axis in (1, 0))
        return (in_x, in_y)

    @property
    def footprint(self) -> tuple[float, float]:
        """Largest distance of a corner from the axis along x, and the same along y [m]."""
        half = np.abs(self.triangles[..., :2]).max(axis=(0, 1))
        return (float(half[0]), float(half[1]))

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lowest triangle over each point; inf beside the body [m]."""
        x, y = np.broadcast_arrays(x, y)
        return self._gap.evaluate(x.ravel(), y.ravel()).reshape(x.shape)

    def measure_facets(self, height: float, turn: FloatArray | None = None) -> float:
        """Estimate how far the facets up to a height deviate from the smooth surface that they approximate.

        Two facets that meet at a small angle are chords of an arc with the sagitta width times angle over 8.  The
        deviation of a facet is the sum over its sides.  Facets that meet at a larger angle form an edge of the body.

        Args:
            height: Height above the lowest point up to which facets are considered [m].
            turn: Rotation matrix of the body, shape (3, 3); None if the body is not rotated.

        Returns:
            Largest deviation, 0 if no facets meet at a small angle [m].
        """
        lower = self._lower if turn is None else self._lower @ turn.T
        facets = lower[lower[..., 2].min(axis=1) - lower[..., 2].min() < height]
        normal = normal_vectors(facets)
        double_area = np.linalg.norm(normal, axis=1)
        facets, normal = facets[double_area > 0], normal[double_area > 0] / double_area[double_area > 0, None]
        ends = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        owner = np.repeat(np.arange(len(facets)), 3)
        width = np.repeat(double_area[double_area > 0], 3) / length
        # Facets that share an edge share its midpoint.  Sorting the midpoints places them next to each other.
        middle = np.round(ends.mean(axis=1) / (_NUMBERS.same_place * max(self.footprint))).astype(np.int64)
        order = np.lexsort(middle.T)
        one, other = order[:-1], order[1:]
        shared = (middle[one] == middle[other]).all(axis=1)
        one, other = one[shared], other[shared]
        angle = np.arccos(np.clip((normal[owner[one]] * normal[owner[other]]).sum(axis=1), -1.0, 1.0))
        angle[angle > _NUMBERS.edge_angle] = 0.0
        each = np.concatenate([one, other])
        return float(np.bincount(owner[each], width[each] * np.tile(angle, 2) / 8).max(initial=0.0))

    def primitives(self) -> tuple[Primitive, ...]:
        """Return one hull if the lower surface is convex; else hulls whose union approximates the lower surface.

        The approximation is within the tolerance of `HULLS`, or a warning is logged.

        Raises:
            ModuleNotFoundError: If trimesh is not installed.
        """
        return self._primitives

    @cached_property
    def _lower(self) -> FloatArray:
        return select_facing_down(self.triangles)

    @cached_property
    def _gap(self) -> TriangleGap:
        return TriangleGap(self._lower)

    @cached_property
    def _primitives(self) -> tuple[Primitive, ...]:
        return tuple(
            Primitive(kind="hull", vertices=tuple((float(x), float(y), float(z)) for x, y, z in hull))
            for hull in split_into_hulls(self.triangles)
        )


@dataclass(frozen=True, kw_only=True)
class _GapNumbers:
    """Constants of the search for the lowest triangle over a point, which uses a grid of cells."""

    #: Length that counts as zero, over the larger edge of the bounding box [-]; rounding in double precision.
    zero: float = 1e-12
    #: Largest number of pairs of a point and a triangle that are computed at once [-]; they take about 200 MB.
    most_pairs: int = 2_000_000
    #: Largest number of cells along the longer side of the search grid [-].  By measurement, more cells hardly save
    #: time.
    most_cells: int = 256
    #: Largest mean number of grid cells that list the same triangle [-]; chosen by judgement.  For long triangles the
    #: grid is made coarser until the mean number is below this limit.
    most_entries: int = 30


@dataclass(frozen=True, kw_only=True)
class HullNumbers:
    """Constants of the approximation by convex hulls."""

    #: Largest distance of a hull from the body, over half the longer edge of the bounding rectangle [-]; chosen by
    #: judgement.
    tolerance: float = 5e-3
    #: Most hulls of a body [-]; each is a geom of MuJoCo, whose contacts take computing time.
    most: int = 64
    #: Most corners of a hull [-]; MuJoCo's collision detection becomes slower with more.
    most_corners: int = 1000
    #: Fraction of the directions that point down, among the directions in which the outermost corners of a hull are
    #: kept [-]; chosen by judgement.  Only the lower surface touches the cover.
    downward: float = 0.8
    #: Grid points along the longer edge of the bounding rectangle, where hull and body are compared [-]; chosen by
    #: judgement.
    points: int = 97
    #: Distance of the first grid point from the edge, in grid steps [-].  The value is not round, so that grid lines do
    #: not lie on edges of the body.
    offset: float = 0.517
    #: Number of heights for which the horizontal distance to the body is tabulated [-]; chosen by judgement.
    levels: int = 16
    #: Angles between the x axis and the normals of the vertical planes that are tried as cuts [rad]; chosen by
    #: judgement.
    cut_angles: tuple[float, ...] = (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4)
    #: Vertical component of a unit normal below which a triangle counts as vertical [-]; above the rounding of qhull,
    #: which computes the hulls.
    upright: float = 1e-6
    #: Width of a piece over the largest accepted distance, below which it gets no hull [-]; chosen by judgement.
    narrow: float = 1e-3


_GAP = _GapNumbers()
HULLS = HullNumbers()


def select_facing_down(triangles: FloatArray) -> FloatArray:
    """Select the triangles whose outer side faces down; vertical triangles are left out.

    Args:
        triangles: Corners of n triangles, counterclockwise as seen from outside the body, shape (n, 3, 3) [m].

    Returns:
        Corners of the m triangles that face down, shape (m, 3, 3) [m].
    """
    (ax, ay), (bx, by) = (triangles[:, k, :2].T - triangles[:, 0, :2].T for k in (1, 2))
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    return np.asarray(triangles[ax * by - ay * bx < -_GAP.zero * size**2])


class TriangleGap:
    """Finds the height of the lowest triangle over each point, for triangles that face down.

    A search grid over the triangles' bounding rectangle lists for each of its cells the triangles that may cross the
    cell, so that a point is compared only with the triangles of the cell in which it lies.

    Args:
        triangles: Corners of n triangles that face down, none of them vertical, shape (n, 3, 3) [m].
    """

    def __init__(self, triangles: FloatArray) -> None:
        flat = triangles[..., :2]
        extent = np.ptp(flat, axis=(0, 1))
        self._tolerance = _GAP.zero * float(extent.max())
        self._low = flat.min(axis=(0, 1))
        self._count, self._cell = self._choose_cells(flat, extent)
        self._members, self._start = self._list_members(flat)
        # Coefficients a, b, c of the plane z = a x + b y + c of each triangle, shape (n, 3).
        normal = normal_vectors(triangles)
        slope = -normal[:, :2] / normal[:, 2:]
        self._plane = np.column_stack([slope, triangles[:, 0, 2] - np.sum(slope * flat[:, 0], axis=1)])
        # Coefficients a, b, c of the distance a x + b y + c of a point from each side, positive inside the triangle,
        # shape (n, 3, 3).  Seen from above, the corners of a triangle that faces down go clockwise: its inside is right
        # of a side.
        along = np.roll(flat, -1, axis=1) - flat
        inward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.hypot(*np.moveaxis(along, -1, 0))[..., None]
        self._sides = np.concatenate([inward, -np.sum(inward * flat, axis=-1, keepdims=True)], axis=-1)
        self._lowest, self._highest = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)

    def evaluate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the height of the lowest triangle over each of m points; inf where no triangle is over the point.

        Args:
            x: x coordinates of the points, shape (m,) [m].
            y: y coordinates of the points, shape (m,) [m].

        Returns:
            Heights, shape (m,) [m].
        """
        heights = np.full(x.shape, np.inf)
        points = np.column_stack([x, y])
        high = self._low + self._count * self._cell
        within = (points >= self._low - self._tolerance) & (points <= high + self._tolerance)
        index = np.flatnonzero(within.all(axis=1))
        cell = self._find_cells(points[index]) @ np.array([1, self._count[0]])
        members = self._start[cell + 1] - self._start[cell]
        index, cell, members = index[members > 0], cell[members > 0], members[members > 0]
        blocks = np.flatnonzero(np.diff(np.cumsum(members) // _GAP.most_pairs)) + 1
        for part in np.split(np.arange(len(index)), blocks):
            if len(part):
                start = self._start[cell[part]]
                heights[index[part]] = self._find_lowest(points[index[part]], start, members[part])
        return heights

    def _choose_cells(self, flat: FloatArray, extent: FloatArray) -> tuple[IntArray, FloatArray]:
        """Choose the search grid: about as many cells as triangles, or fewer if the triangles are long.

        Args:
            flat: Corners of the triangles without their heights, shape (n, 3, 2) [m].
            extent: Edge lengths of the triangles' bounding rectangle, shape (2,) [m].

        Returns:
            Numbers of cells along x and y, and edge lengths of a cell along x and y, shape (2,) each.
        """
        boxes = np.ptp(flat, axis=1)
        along_longer = float(min(_GAP.most_cells, max(1, np.sqrt(len(flat)))))
        while True:
            count = np.maximum(1, np.ceil(along_longer * extent / extent.max())).astype(np.int64)
            cell = extent / count
            if along_longer <= 1 or np.prod(boxes / cell + 1, axis=1).sum() < _GAP.most_entries * len(flat):
                return count, cell
            along_longer /= 2

    def _list_members(self, flat: FloatArray) -> tuple[IntArray, IntArray]:
        """List for each cell of the search grid the triangles whose bounding rectangle touches the cell.

        Returns:
            Indices of triangles, cell by cell, and the place in this list at which the triangles of each cell start.
        """
        first, last = self._find_cells(flat.min(axis=1)), self._find_cells(flat.max(axis=1))
        wide, high = (last - first + 1).T
        triangle = np.repeat(np.arange(len(flat)), wide * high)
        offset = np.arange(len(triangle)) - np.repeat(np.cumsum(wide * high) - wide * high, wide * high)
        column = first[triangle, 0] + offset % wide[triangle]
        row = first[triangle, 1] + offset // wide[triangle]
        cell = row * self._count[0] + column
        order = np.argsort(cell, kind="stable")
        return triangle[order], np.searchsorted(cell[order], np.arange(self._count.prod() + 1))

    def _find_cells(self, points: FloatArray) -> IntArray:
        """Return the column and row of the grid cell in which each of m points lies, shape (m, 2)."""
        cells = ((points - self._low) / self._cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, self._count - 1))

    def _find_lowest(self, points: FloatArray, start: IntArray, members: IntArray) -> FloatArray:
        """Return the height of the lowest triangle over each of k points, among the triangles of the point's cell.

        Args:
            points: Positions, shape (k, 2) [m].
            start: Place in the list of triangles at which the triangles of each point's cell start, shape (k,).
            members: Number of triangles in each point's cell, shape (k,).

        Returns:
            Heights; inf where no triangle is over the point, shape (k,) [m].
        """
        first = np.cumsum(members) - members
        triangle = self._members[np.repeat(start - first, members) + np.arange(members.sum())]
        x, y = np.repeat(points, members, axis=0).T
        inside = np.full(len(triangle), np.inf)
        for side in range(3):
            a, b, c = self._sides[triangle, side].T
            np.minimum(inside, a * x + b * y + c, out=inside)
        a, b, c = self._plane[triangle].T
        # A point may lie outside an edge by rounding.  Where the triangle's plane is steep, the plane's height there
        # would leave the range of the triangle's heights; it is clipped to this range.
        z = np.clip(a * x + b * y + c, self._lowest[triangle], self._highest[triangle])
        return np.minimum.reduceat(np.where(inside >= -self._tolerance, z, np.inf), first)


def split_into_hulls(triangles: FloatArray) -> list[FloatArray]:
    """Find convex hulls whose union has the underside of a body, within a tolerance.

    A warning is logged if the error of `HULLS.most` hulls exceeds the tolerance.  A hull with more than
    `HULLS.most_corners` corners keeps only the outermost corners, most of them on its underside.  The hull of a sphere
    then lies up to about a thousandth of the radius inside the sphere.

    Args:
        triangles: Corners of the n triangles of a closed surface, each counterclockwise as seen from outside, shape
            (n, 3, 3) [m].

    Returns:
        Corners of each hull, shape (k, 3) for k corners [m].

    Raises:
        ModuleNotFoundError: If trimesh is not installed.
    """
    lower = select_facing_down(triangles)
    underside = _Underside.sample(lower, top=1.01 * float(triangles[..., 2].max()))
    whole = _Piece.make(lower, underside)
    if whole is None or whole.error <= underside.tolerance:
        return [_keep_outermost(np.unique(triangles.reshape(-1, 3), axis=0))]
    made = 0
    queue = [(-whole.excess, made, whole)]
    done: list[_Piece] = []
    while queue and len(queue) + len(done) < HULLS.most:
        _, _, piece = heapq.heappop(queue)
        halves = piece.cut(underside) if piece.error > underside.tolerance else None
        if halves is None:
            done.append(piece)
            continue
        for half in halves:
            made += 1
            heapq.heappush(queue, (-half.excess, made, half))
    pieces = [*done, *(piece for _, _, piece in queue)]
    worst = max(piece.error for piece in pieces)
    if worst > underside.tolerance:
        logging.getLogger(__name__).warning(
            "%d hulls of the body from a file fill up to %.2g mm of what is empty under it: the fast model takes that "
            "for solid; the reference does not",
            len(pieces),
            1e3 * worst,
        )
    return [_keep_outermost(piece.hull) for piece in pieces]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Underside:
    """The underside of a body, sampled at the n points of a horizontal grid.

    Attributes:
        x: x coordinates of the grid points, shape (n,) [m].
        y: y coordinates of the grid points, shape (n,) [m].
        height: Height of the underside over each grid point; `top` beside the body, shape (n,) [m].
        levels: The k heights for which horizontal distances are tabulated, shape (k,) [m].
        beside: Horizontal distance from each grid point to the nearest grid point at which the underside is no higher
            than each of the k heights, less one grid step, shape (k, n) [m].
        top: Height up to which the space above the underside counts as solid [m].
        step: Distance between neighbouring grid points [m].
        tolerance: Largest accepted distance between a hull and the body [m].
    """

    x: FloatArray
    y: FloatArray
    height: FloatArray
    levels: FloatArray
    beside: FloatArray
    top: float
    step: float
    tolerance: float

    @classmethod
    def sample(cls, lower: FloatArray, *, top: float) -> _Underside:
        """Sample the underside of a body at the points of a grid.

        Args:
            lower: Corners of the triangles that face down, shape (n, 3, 3) [m].
            top: Height up to which the space above the underside counts as solid [m].
        """
        flat = lower[..., :2].reshape(-1, 2)
        low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
        count = np.maximum(5, np.round(HULLS.points * extent / extent.max())).astype(int)
        axes = [
            low[i] + (np.arange(count[i]) + HULLS.offset) / (count[i] + 2 * HULLS.offset - 1) * extent[i]
            for i in range(2)
        ]
        x, y = (values.ravel() for values in np.meshgrid(*axes))
        height = TriangleGap(lower).evaluate(x, y)
        levels = np.linspace(0, height[np.isfinite(height)].max(), HULLS.levels)
        grid = height.reshape(len(axes[1]), len(axes[0]))
        step = float((extent / count).max())
        across, along = ((axis[:, None] - axis) ** 2 for axis in axes)
        beside = []
        for level in levels:  # The nearest low point is found within each column of the grid, then among all columns.
            squared = np.where((grid <= level)[None], along[..., None], np.inf).min(axis=1)
            beside.append(np.sqrt((squared[:, None, :] + across[None]).min(axis=2)))
        return cls(
            x=x,
            y=y,
            height=np.where(np.isfinite(height), height, top),
            levels=levels,
            beside=np.maximum(np.array(beside) - step, 0).reshape(HULLS.levels, -1),
            top=top,
            step=step,
            tolerance=HULLS.tolerance * float(extent.max() / 2),
        )

    def measure_error(self, hull: FloatArray) -> FloatArray:
        """Return the distance between the lower surface of a hull and the body, where the hull fills empty space.

        The distance is the smaller of two: vertically up to the body, and sideways to the nearest part of the body.

        Args:
            hull: Height of the hull's lower surface over each of n grid points, inf beside the hull, shape (n,) [m].

        Returns:
            Distances at the grid points, zero beside the hull, shape (n,) [m].
        """
        exists = np.isfinite(hull)
        height = np.where(exists, hull, 0.0)
        sideways = np.hypot(self.beside, np.maximum(self.levels[:, None] - height, 0)).min(axis=0)
        return np.where(exists, np.minimum(self.height - height, sideways), 0.0)

    def find_wall(self, point: int, height: float) -> FloatArray:
        """Find the place next to a grid point at which the underside is as low as a given height.

        Args:
            point: Index of the grid point.
            height: Height of the underside to look for [m].

        Returns:
            Position (x, y) one grid step before the nearest grid point at which the underside is as low as `height`;
            the grid point itself if there is none, shape (2,) [m].
        """
        low = np.flatnonzero(self.height <= height + self.tolerance)
        if not len(low):
            return np.array([self.x[point], self.y[point]])
        distance = np.hypot(self.x[low] - self.x[point], self.y[low] - self.y[point])
        nearest = low[distance.argmin()]
        # One grid step before the wall, so that a cut at this place leaves the wall on the far side of the cut.
        step = min(1.0, self.step / distance.min()) if distance.min() else 0.0
        return np.array([v[nearest] + step * (v[point] - v[nearest]) for v in (self.x, self.y)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Piece:
    """A piece of the underside of a body, and the convex hull of the piece and of the space above the piece.

    Attributes:
        triangles: Corners of the n triangles of the piece, shape (n, 3, 3) [m].
        hull: The k corners of the hull, shape (k, 3) [m].
        error: Largest distance between the lower surface of the hull and the body over the grid points [m].
        excess: Sum over the grid points of the distance in excess of the tolerance [m].  The piece with the largest sum
            is cut first.
        worst: Position (x, y) of the largest distance, shape (2,) [m].
        wall: Position (x, y) just before the nearest place where the underside of the body is as low as the hull is at
            `worst`, shape (2,) [m].
    """

    triangles: FloatArray
    hull: FloatArray
    error: float
    excess: float
    worst: FloatArray
    wall: FloatArray

    @classmethod
    def make(cls, triangles: FloatArray, underside: _Underside) -> _Piece | None:
        """Make a piece of the underside from its triangles; None if they are too narrow for a hull with a volume.

        Args:
            triangles: Corners of the n triangles of the piece, shape (n, 3, 3) [m].
            underside: The sampled underside of the whole body, with which the hull is compared.
        """
        from trimesh.convex import convex_hull

        points = np.unique(triangles.reshape(-1, 3), axis=0)
        raised = points.copy()
        raised[:, 2] = underside.top
        if not len(points) or np.ptp(points[:, :2], axis=0).min() <= HULLS.narrow * underside.tolerance:
            return None
        try:
            hull = convex_hull(np.concatenate([points, raised]))
        except Exception:  # noqa: BLE001 -- qhull fails on nearly flat points with errors of several types
            return None
        floor = np.asarray(hull.face_normals)[:, 2] < -HULLS.upright
        height = TriangleGap(np.asarray(hull.triangles)[floor]).evaluate(underside.x, underside.y)
        error = underside.measure_error(height)
        worst = int(error.argmax())
        return cls(
            triangles=triangles,
            hull=np.array(hull.vertices),
            error=float(error[worst]),
            excess=float(np.maximum(error - underside.tolerance, 0).sum()),
            worst=np.array([underside.x[worst], underside.y[worst]]),
            wall=underside.find_wall(worst, float(height[worst])),
        )

    def cut(self, underside: _Underside) -> tuple[_Piece, _Piece] | None:
        """Cut the piece in two along the best of several vertical planes.

        The planes go through the point where the piece has its largest error, at several angles.  A further plane goes
        through the point `wall` beside a vertical wall.

        Returns:
            The two halves with the least sum of `excess`; None if no cut leaves two halves with a volume.
        """
        best: tuple[_Piece, _Piece] | None = None
        least = np.inf
        cuts = [(np.array([np.cos(angle), np.sin(angle)]), self.worst) for angle in HULLS.cut_angles]
        for normal, place in [*cuts, (self.worst - self.wall, self.wall)]:
            left, right = (_Piece.make(_clip(self.triangles, s * normal, place), underside) for s in (1, -1))
            if left is not None and right is not None and (sum_of_both := left.excess + right.excess) < least:
                best, least = (left, right), sum_of_both
        return best


def _clip(triangles: FloatArray, normal: FloatArray, place: FloatArray) -> FloatArray:
    """Clip triangles by a vertical plane, and keep the side to which the plane's normal points.

    Args:
        triangles: Corners of n triangles, shape (n, 3, 3) [m].
        normal: Horizontal components (x, y) of the plane's normal, of any length, shape (2,).
        place: Horizontal position (x, y) of a point of the plane, shape (2,) [m].

    Returns:
        Corners of the m triangles that make up the kept part, shape (m, 3, 3) [m].
    """
    from trimesh.intersections import slice_faces_plane

    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    points, kept, _ = slice_faces_plane(  # type: ignore[no-untyped-call]
        triangles.reshape(-1, 3), faces, plane_normal=[*normal, 0.0], plane_origin=[*place, 0.0]
    )
    return np.asarray(points[kept], dtype=np.float64).reshape(-1, 3, 3)


def _keep_outermost(corners: FloatArray) -> FloatArray:
    """Reduce the corners of a hull to the outermost ones in `HULLS.most_corners` directions along a spiral on a sphere.

    Args:
        corners: Corners of the hull, shape (n, 3) [m].

    Returns:
        All n corners if there are no more than `HULLS.most_corners`; else some of them, shape (k, 3) [m].
    """
    if len(corners) <= HULLS.most_corners:
        return corners
    share = np.arange(HULLS.most_corners) / (HULLS.most_corners - 1)
    z = np.where(share < HULLS.downward, share / HULLS.downward - 1, (share - HULLS.downward) / (1 - HULLS.downward))
    # Turns by the golden angle from one direction to the next distribute the directions evenly over the sphere.
    turn = np.arange(HULLS.most_corners) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z])
    return np.asarray(corners[np.unique(((corners - corners.mean(axis=0)) @ directions).argmax(axis=0))])
