"""Forces between rigid bodies and a curved cover.

The contact of each body is solved on the cells of a chart of the top around the point that the body reaches first, by
the method of flat covers (`fastmodel.pressure.solvers`).  The cells follow the size of the contact.  Their compliance
is that of a flat layer plus the remainder of the cover, see `CoverPoints`.  The force of each body is prescribed along
one direction, and along further directions if the body is free to move in them.  The Lagrange multipliers of these
constraints are the motions of the body.  Gaps are measured along the normals of the undeformed cover.  They are
measured again after each motion of a body, until the motion is small.  Several bodies are solved in turn, each on the
top that the others displace.

`press_points` presses one indenter on a guide; `fastmodel.indent` is its public form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import add_geoms
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pressure.gap import BodyShape, GapSamples, PosedBody, describe_solid
from fastmodel.pressure.gap_kernels import sample_surface
from fastmodel.pressure.pressure_kernels import gather_shares, minimise_energy, place_cells
from fastmodel.pressure.solvers import Load, join_constraints, press_springs
from fastmodel.surface import CoverPoints, cell_edge, choose_edge
from meshes import Indenter
from meshes.array_types import FloatArray, IntArray
from meshes.pose import Pose


@dataclass(frozen=True, kw_only=True)
class ChartSettings:
    """Constants of the charts on which contacts with curved covers are solved."""

    #: Smallest cosine between a normal of the top and that at the first touch where contact is possible [-].
    least_cosine: float = 0.4
    #: Wanted, smallest and largest numbers of cells across a contact [-].
    across: tuple[int, int, int] = (14, 12, 24)
    #: Width of the cells over that of the contact, and cells added to it [-].
    wider: tuple[float, int] = (1.25, 4)
    #: Difference of gaps and distances over the thickness below which they are equal [-].
    equal: float = 1e-6
    #: Gap above the smallest up to which cells are solved, over the approach [-].
    reach: float = 1.5
    #: Largest ratio of the edges of a cell [-].
    slender: float = 64.0
    #: Largest size of the cells at the start, over the thickness [-].
    largest: float = 12.0
    #: Numbers of rows or columns of cells for which the compliance is tabulated [-].
    table: int = 40
    #: Change of the travel over the thickness at which the search for the travel stops [-].
    settled: float = 1e-3
    #: Largest numbers of solutions for one body, and of rounds over all bodies [-].
    steps: tuple[int, int] = (16, 8)
    #: Change of the travel of a body over the thickness at which the rounds over all bodies end [-].
    coupled: float = 1e-4
    #: Sum of changes of forces in a step over the load at which the solution for the pressure stops, and largest number
    #: of its steps [-].
    solver: tuple[float, int] = (2e-4, 200)


_SETTINGS = ChartSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class Footprint:
    """Where a body touches a cover.  The next search starts from it.

    Attributes:
        travel: Distance that the body moved along the first direction of its load from the given pose [m].
        approach: Distance that it moved since its first touch [m].
        middle: Middle of the contact in the array's frame, shape (3,) [m].
        half: Half widths of the contact along x and y of its chart, shape (2,) [m].
    """

    travel: float
    approach: float
    middle: FloatArray
    half: FloatArray

    @classmethod
    def of(cls, row: FloatArray) -> Footprint:
        """Make a footprint of its numbers, see `row`."""
        return cls(travel=float(row[0]), approach=float(row[1]), middle=row[2:5].copy(), half=row[5:].copy())

    @property
    def row(self) -> list[float]:
        """The numbers of the footprint, 7 of them."""
        return [self.travel, self.approach, *self.middle.tolist(), *self.half.tolist()]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyPressure:
    """Forces of one body on k cells of a cover.

    Attributes:
        forces: Force on each cell against its normal, shape (k,) [N].
        place: Positions of the cells, shape (k, 3) [m].
        normal: Normals of the cells, shape (k, 3) [-].
        corners: Indices of the a points from which the cover is interpolated at each cell, shape (k, a).
        parts: Weights of these points, shape (k, a) [-].
        loads: Indices of the j loads of the cover among which the forces are distributed, shape (j,).
        shares: Parts of the force on each cell that the loads take, shape (j, k) [-].
        footprint: Where the body touches.
        depth: Largest displacement of the cover [m].
        settled: Whether the search for contact and travel converged.
    """

    forces: FloatArray
    place: FloatArray
    normal: FloatArray
    corners: IntArray
    parts: FloatArray
    loads: IntArray
    shares: FloatArray
    footprint: Footprint
    depth: float
    settled: bool

    @property
    def nearest(self) -> IntArray:
        """Index of the point of the cover next to each cell, shape (k,)."""
        return np.asarray(self.corners[np.arange(len(self.corners)), self.parts.argmax(axis=1)])

    def build_influence(self, cover: CoverPoints) -> FloatArray:
        """Build the matrix from forces on the cells to forces on the n texels, shape (n, k) [-]."""
        return np.asarray(np.einsum("nkc,kc->nk", cover.influence[:, self.corners], self.parts, optimize=True))

    def displace(self, cover: CoverPoints, loads: IntArray) -> FloatArray:
        """Compute the displacements at some loads of the cover, far from the body, shape (loads,) [m]."""
        smooth = cover.remainder[np.ix_(loads, self.loads)] @ (self.shares @ self.forces)
        pressed = np.flatnonzero(self.forces)
        away = np.linalg.norm(cover.centres[loads, None] - self.place[pressed], axis=2)
        return np.asarray(smooth + cover.move_layer(away) @ self.forces[pressed])


def solve_pressure(
    cover: CoverPoints,
    bodies: Sequence[PosedBody],
    loads: Sequence[Load],
    last: Sequence[Footprint | None] | None = None,
) -> list[BodyPressure | None]:
    """Find the forces of bodies on a cover under given loads.

    Args:
        cover: The cover.
        bodies: Shapes and poses of the bodies in the array's frame, in contact or not.
        loads: Force of each body on the cover with reversed sign, see `Load`.
        last: Where each body touched in a similar contact; None if unknown.

    Returns:
        Forces of each body; None for a body that no normal of the cover meets, which does not change the forces of
        the others.
    """
    starts = list(last or [None] * len(bodies))
    found: list[BodyPressure | None] = [None] * len(bodies)
    for _ in range(_SETTINGS.steps[1] if len(bodies) > 1 else 1):
        change = 0.0
        for number, (body, load) in enumerate(zip(bodies, loads, strict=True)):
            others = [each for other, each in enumerate(found) if other != number and each is not None]
            before = found[number]
            found[number] = now = _press_body(cover, body, load, others, starts[number])
            starts[number] = None if now is None else now.footprint
            if now is not None:
                change = max(change, np.inf if before is None else abs(now.footprint.travel - before.footprint.travel))
        if change <= _SETTINGS.coupled * cover.thickness:
            break
    return found


def _press_body(
    cover: CoverPoints, body: PosedBody, load: Load, others: Sequence[BodyPressure], last: Footprint | None
) -> BodyPressure | None:
    """Find the forces of one body on a cover that other bodies displace."""
    outward, travel = load.directions[0], 0.0 if last is None else last.travel
    first, beside = _find_first_point(cover, _move(body, outward, travel), outward)
    if first is None:
        return None
    origin, normal = cover.points[first], cover.normals[first]
    x = body.rotation[0][:, int(abs(body.rotation[0][:, 0] @ normal) > abs(body.rotation[0][:, 1] @ normal))]
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(normal, x), normal])
    if last is None:
        # The half edges of a plane are infinite.
        largest = _SETTINGS.largest * cover.thickness
        turned = np.abs(axes[:2] @ body.rotation) @ np.minimum(body.shape.halves, largest)[..., None]
        middle, half = axes[:2] @ beside, np.minimum(2 * turned[..., 0].max(axis=0), largest)
        reach = cover.thickness
    else:
        middle, half = axes[:2] @ (last.middle - origin), last.half
        reach = _SETTINGS.reach * last.approach
    found: BodyPressure | None = None
    for _ in range(_SETTINGS.steps[0]):
        half = np.maximum(half, half.max() / _SETTINGS.slender)
        cells = ChartCells.around(origin, axes, middle, half, cover.heights[first])
        contact = cells.measure(cover, _move(body, outward, travel), reach)
        if not contact.samples.count:
            return found
        found = contact.solve(load, travel, others)
        change, travel = found.footprint.travel - travel, found.footprint.travel
        pressed = found.forces > 0
        ends = np.array([contact.samples.column[pressed], contact.samples.row[pressed]])
        low, high = ends.min(axis=1), ends.max(axis=1)
        # A contact that reaches the border of the cells needs more cells, and one on few cells smaller ones.
        clipped, across = (low <= 0) | (high >= cells.size - 1), high - low + 1
        few = (across < _SETTINGS.across[1]) & (half > half.max() / _SETTINGS.slender)
        approach = found.footprint.approach
        is_near = reach < approach  # a body may touch at gaps up to its approach
        reach = _SETTINGS.reach * approach
        if (
            not is_near
            and found.settled
            and not (clipped | few).any()
            and abs(change) <= _SETTINGS.settled * cover.thickness
        ):
            break
        middle = cells.low + cells.edge * (low + high + 1) / 2
        half = np.where(clipped, 1.5 * half, np.where(few | (across > _SETTINGS.across[2]), found.footprint.half, half))
    return found


def _move(body: PosedBody, outward: FloatArray, travel: float) -> PosedBody:
    """Move a body against a direction by a distance [m]."""
    return replace(body, position=body.position - travel * outward)


def _find_first_point(cover: CoverPoints, body: PosedBody, outward: FloatArray) -> tuple[int | None, FloatArray]:
    """Find the point of the cover that a body reaches first.

    Of points that it reaches at the same time, as under a flat face, and of all points for a body that lies between
    them, it is the one next to the path of its middle, so that rounding does not choose.

    Returns:
        Index of the point, None for a body that lies beside the cover; and where the path of the middle of a body
        between the points lies from this point, shape (3,) [m].
    """
    rate = cover.normals @ outward
    gap = body.measure_gaps(cover.points, cover.normals, behind=cover.thickness)
    gap = np.where(rate > 0, gap / np.maximum(rate, _SETTINGS.least_cosine), np.inf)
    equal = _SETTINGS.equal * cover.thickness
    away = body.centres.mean(axis=0) - cover.points
    away -= np.outer(away @ outward, outward)
    beside = np.where(rate > 0, np.round(np.linalg.norm(away, axis=1) / equal) * equal, np.inf)
    if np.isfinite(gap).any():
        return int(np.where(gap <= gap.min() + equal, beside, np.inf).argmin()), np.zeros(3)
    nearest = int(beside.argmin())
    return (nearest if beside[nearest] <= 2 * cover.spacing else None), away[nearest]


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartCells:
    """Equal cells on a chart of the top of a cover.

    Attributes:
        origin: Origin of the chart, a point of the top, shape (3,) [m].
        axes: Axes x, y and z of the chart as rows; z is the normal of the top at the origin, shape (3, 3) [-].
        low: Lowest corner of the cells on the chart, shape (2,) [m].
        numbers: Numbers of the edges of the cells along x and y, see `choose_edge`.
        edge: Edges of a cell, shape (2,) [m].
        size: Numbers of cells along x and y, shape (2,).
    """

    origin: FloatArray
    axes: FloatArray
    low: FloatArray
    numbers: tuple[int, int]
    edge: FloatArray
    size: IntArray

    @classmethod
    def around(
        cls, origin: FloatArray, axes: FloatArray, middle: FloatArray, half: FloatArray, thickness: float
    ) -> ChartCells:
        """Divide the surroundings of a contact with the given middle and half widths into cells.

        Args:
            origin: Origin of the chart, shape (3,) [m].
            axes: Axes of the chart as rows, shape (3, 3) [-].
            middle: Middle of the contact on the chart, shape (2,) [m].
            half: Half widths of the contact, shape (2,) [m].
            thickness: Thickness of the cover at the origin [m].
        """
        x, y = (choose_edge(2 * each / _SETTINGS.across[0] / thickness) for each in half.tolist())
        edge = thickness * np.array([cell_edge(x), cell_edge(y)])
        size = np.ceil(2 * half / edge * _SETTINGS.wider[0]).astype(np.int64) + _SETTINGS.wider[1]
        return cls(origin=origin, axes=axes, low=middle - edge * size / 2, numbers=(x, y), edge=edge, size=size)

    def measure(self, cover: CoverPoints, body: PosedBody, reach: float) -> ChartContact:
        """Measure the gap between a body and the cells up to a gap of `reach` above the smallest [m]."""
        solids = body.shape.arrays, body.shape.edge, body.rotation, body.position
        chart = self.origin, self.axes, self.low, self.edge, _SETTINGS.least_cosine
        (row, column, coverage, x, y, gap), place, normal, below, parts = compile_kernel(sample_surface)(
            solids,
            (cover.points, cover.normals, cover.triangles),
            chart,
            (int(self.size[1]), int(self.size[0])),
            (reach, cover.thickness),
        )
        owner = np.zeros(len(row), dtype=np.int64)
        # The remainder is so smooth that it is interpolated on flat triangles; the influence on quadratic facets.
        loads, shares = compile_kernel(gather_shares)(
            cover.triangles[below], parts, cover.shared, cover.shares, len(cover.centres)
        )
        corners, parts = cover.interpolate(below, parts)
        return ChartContact(
            cover=cover,
            cells=self,
            samples=GapSamples(owner, row, column, coverage, x, y, gap, place, normal),
            corners=corners,
            parts=parts,
            loads=loads,
            shares=shares,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartContact:
    """The k cells of a chart under a body.

    Attributes:
        cover: The cover.
        cells: All cells.
        samples: Those under the body, with their gaps.
        corners: Indices of the a points from which the cover is interpolated at each cell, shape (k, a).
        parts: Weights of these points, shape (k, a) [-].
        loads: Indices of the j loads of the cover among which forces on the cells are distributed, shape (j,).
        shares: Parts of the force on each cell that these loads take, shape (j, k) [-].
    """

    cover: CoverPoints
    cells: ChartCells
    samples: GapSamples
    corners: IntArray
    parts: FloatArray
    loads: IntArray
    shares: FloatArray

    def solve(self, load: Load, travel: float, others: Sequence[BodyPressure]) -> BodyPressure:
        """Find the forces on the cells.

        Args:
            load: Load of the body.
            travel: Distance that the body moved from its pose [m].
            others: Forces of other bodies, which displace the cover.
        """
        samples, edge = self.samples, self.cells.edge
        layer = self.cover.cells_of(self.cells.numbers, _SETTINGS.table)
        # The compliance of a layer is inversely proportional to its thickness, at places in proportion to it.
        softer = self.cover.thickness * cell_edge(self.cells.numbers[0]) / float(edge[0])
        if others:
            moved = np.sum([each.displace(self.cover, self.loads) for each in others], axis=0)
            samples = replace(samples, gap=samples.gap + moved @ self.shares)
        _, shape, first, weight, own = compile_kernel(place_cells)(
            (samples.row, samples.column, samples.coverage, samples.x, samples.y),
            (self.cells.size, self.cells.low, edge),
            softer * layer.kernel[:2, :2],
            softer * layer.square,
        )
        along, across = layer.convolution.matrices(*shape)
        remainder = np.ascontiguousarray(self.cover.remainder[np.ix_(self.loads, self.loads)])
        mean, tolerance = float(np.sqrt(edge.prod())), _SETTINGS.solver[0] * load.force
        constraints, _ = join_constraints(
            [load], samples.body, samples.place, samples.normal, mean, softer * float(layer.kernel[0, 0])
        )
        start, _ = press_springs(samples, [load], layer.stiffness / softer, mean)
        forces, _, motion, _, converged = compile_kernel(minimise_energy)(
            (first, weight, own, softer * along, across, self.shares, remainder),
            samples.gap,
            constraints,
            start,
            (tolerance, 0.25 * tolerance * softer / layer.stiffest, _SETTINGS.solver[1]),
        )
        pressed = np.flatnonzero(forces)
        columns = constraints[0][pressed]
        # All motions of the body, projected on its first direction; other directions may be almost parallel to it.
        change = float(columns[:, 0] @ (columns @ motion) / (columns[:, 0] @ columns[:, 0]))
        middle = np.average(samples.place[pressed], axis=0, weights=forces[pressed])
        width = np.ptp([samples.column[pressed], samples.row[pressed]], axis=1) + 1
        return BodyPressure(
            forces=forces,
            place=samples.place,
            normal=samples.normal,
            corners=self.corners,
            parts=self.parts,
            loads=self.loads,
            shares=self.shares,
            footprint=Footprint(
                travel=travel + change,
                approach=change - float((samples.gap / np.maximum(constraints[0][:, 0], _SETTINGS.least_cosine)).min()),
                middle=middle,
                half=width * edge / 2,
            ),
            depth=float((columns @ motion - samples.gap[pressed]).max()),
            settled=bool(converged),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PointPress:
    """Result of a press on a curved cover by the fast model.

    Attributes:
        texel_forces: Force on each of n texels along its normal, shape (n,) [N].
        pressure: Forces on the cells of the cover.
        force: Force of the indenter on the cover, shape (3,) [N].
        depth: Approach of the indenter along the direction since its first touch [m].
    """

    texel_forces: FloatArray
    pressure: BodyPressure
    force: FloatArray
    depth: float


def press_points(
    cover: CoverPoints,
    indenter: Indenter,
    pose: Pose,
    *,
    load: float,
    direction: npt.ArrayLike | None = None,
) -> PointPress:
    """Press an indenter that moves along a direction without turning; a guide bears the forces across it.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its path.
        load: Force along the direction [N].
        direction: Direction of motion, of any length, shape (3,) [-]; the direction that the indenter faces if None.

    Raises:
        FastModelError: If the load is not positive, or the contact does not converge.
        MissedArrayError: If the indenter never touches the cover.
    """
    if not 0 < load < np.inf:
        raise FastModelError(f"load must be positive, not {load} N")
    towards = pose.towards if direction is None else np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    wrench = Load.along_free_directions(load * outward, np.zeros(3), outward[None], rotates=False)
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    found = solve_pressure(cover, [body], [wrench])[0]
    if found is None or not found.settled:
        raise FastModelError(f"the contact under {load:.4g} N was not found; use a smaller load")
    return PointPress(
        texel_forces=found.build_influence(cover) @ found.forces,
        pressure=found,
        force=-found.forces @ found.normal,
        depth=found.footprint.approach,
    )


def find_first_contact(
    cover: CoverPoints, indenter: Indenter, pose: Pose, direction: npt.ArrayLike, *, within: float
) -> IntArray:
    """Find the points of the undeformed cover that a rigid indenter reaches first: contact of two rigid bodies.

    Args:
        cover: The cover.
        indenter: The shape.
        pose: Orientation of the indenter, and a position on its path.
        direction: Direction of motion, of any length, shape (3,) [-].
        within: Distance along the direction from the first point up to which points count as reached at the same time
            [m].

    Returns:
        Indices of the points.

    Raises:
        MissedArrayError: If the indenter never touches the cover.
    """
    towards = np.array(direction, dtype=float)
    outward = -towards / np.linalg.norm(towards)
    body = _move_to_touch(cover, pose_indenter(indenter, pose), outward)
    facing = np.flatnonzero(cover.normals @ outward > 0)
    gap = body.measure_gaps(cover.points[facing], np.broadcast_to(outward, (len(facing), 3)))
    if not np.isfinite(gap).any():  # The body lies between the points.
        first, _ = _find_first_point(cover, body, outward)
        return np.array([] if first is None else [first], dtype=np.intp)
    return np.asarray(facing[gap <= gap.min() + within])


def pose_indenter(indenter: Indenter, pose: Pose) -> PosedBody:
    """Describe the solids of an indenter at a pose, in the array's frame."""
    spec = mujoco.MjSpec()
    add_geoms(spec, spec.worldbody.add_body(), indenter)
    model = spec.compile()
    turns = Rotation.from_quat(model.geom_quat, scalar_first=True).as_matrix()
    return PosedBody(
        shape=BodyShape.of([describe_solid(model, geom) for geom in range(model.ngeom)]),
        rotation=np.ascontiguousarray(pose.rotation @ turns),
        position=pose.position + model.geom_pos @ pose.rotation.T,
    )


def _move_to_touch(cover: CoverPoints, body: PosedBody, outward: FloatArray) -> PosedBody:
    """Move a body along a direction, unit vector against `outward`, until it touches the undeformed cover.

    Raises:
        MissedArrayError: If the body never touches the cover.
    """
    facing = cover.points[cover.normals @ outward > 0]
    middle = body.centres.mean(axis=0)
    # Start far in front of the cover, so that the whole body lies before every point.
    spans = (*np.ptp(cover.points, axis=0), *np.ptp(body.position, axis=0), body.shape.halves.max())
    size = float(max(spans))
    start = max(float(((facing - middle) @ outward).max(initial=0.0)), 0.0) + 4 * size
    ahead = replace(body, position=body.position + start * outward)
    gap = ahead.measure_gaps(facing, np.broadcast_to(outward, facing.shape)).min(initial=np.inf)
    if not np.isfinite(gap):
        # The body lies beside the cover, or between its points.
        first, _ = _find_first_point(cover, ahead, outward)
        if first is None:
            raise MissedArrayError("the indenter never touches the cover; check its position and direction")
        gap = float((ahead.centres.mean(axis=0) - cover.points[first]) @ outward)
    return replace(ahead, position=ahead.position - gap * outward)
