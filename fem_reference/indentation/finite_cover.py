"""Pressing covers of limited size in three dimensions, at finite strain or with friction.

No two places on such a cover are alike, so the mesh lies in the array's frame, ends at the free side faces, and every
pose is solved.  Where shape and pose mirror in the cover's own middle planes, a half or a quarter is enough.  The
grids are coarse beside those of small strain, so each is taken as a correction of the converged small-strain answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fem_reference import result_store
from fem_reference.elements.grading import fill_by_spacing
from fem_reference.elements.line import Line, recover_pressure
from fem_reference.elements.scaling import Units
from fem_reference.finite_strain.block_path import Block
from fem_reference.finite_strain.indenter_surface import Height, Obstacle
from fem_reference.finite_strain.loading_path import LoadingPath, with_grid
from fem_reference.finite_strain.paired_path import press_pair
from fem_reference.indentation import finite_strain, small_strain
from fem_reference.indentation.grid_solution import Level, shared_out
from fem_reference.small_strain_contact.free_edges import mirrored
from meshes import Cover, Indenter, TexelArray
from meshes.indenters.indenter import Flat
from meshes.pose import Place, Pose

FloatArray = npt.NDArray[np.float64]

GRIDS = finite_strain.SOLID_GRIDS
#: Growth of elements away from contact and sides.
_GROWTH = 0.4


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundedLevel:
    """One grid's answer for one pose.

    Attributes:
        total_force: Force on the indenter [N].
        depth: Approach from first touch [m].
        area: Reference area that touches [m2].
        overlap: Mean distance that contact left between the surfaces, over the depth [-].
        pose: Where the indenter stands.
        x: Nodes of the base along x in the array's frame, side to side, shape (m,) [m].
        y: Nodes along y, shape (n,) [m].
        pressure: Base pressure at the nodes, which integrates to the reactions exactly, shape (m, n) [Pa].
        half: Half widths of the indenter [m].
    """

    total_force: float
    depth: float
    area: float
    overlap: float
    pose: Pose
    x: FloatArray
    y: FloatArray
    pressure: FloatArray
    half: tuple[float, float]

    @property
    def surface(self) -> FloatArray:
        """The base pressure's nodes under the shape, as a stand-in for where it touches, shape (m, 3)."""
        return shared_out(self, self.pose)

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:  # noqa: ARG002
        """Integrate the base pressure over each texel; the pose is the one that was solved."""
        shares = []
        for axis, nodes in enumerate((self.x, self.y)):
            line = Line(edges=nodes[::2], order=2)
            centres, half = array.centres[:, axis], array.texel_size[axis] / 2
            values, place = np.unique(centres, return_inverse=True)
            shares.append(np.array([line.integral(c - half, c + half) for c in values])[place])
        force = np.einsum("na,nb,ab->n", *shares, self.pressure, optimize=True)
        return np.where(array.active, force, 0.0)


@dataclass(frozen=True, kw_only=True)
class PosedObstacle:
    """An obstacle that stands and is turned somewhere else than at the origin.

    Attributes:
        obstacle: The obstacle in its own frame.
        pose: Where it stands, in the obstacle's unit of length.
    """

    obstacle: Obstacle
    pose: Pose

    def with_steepness(self, steepness: float) -> PosedObstacle:
        """The same with that factor on all heights [-]."""
        return replace(self, obstacle=self.obstacle.with_steepness(steepness))

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height over the lowest point, any shape."""
        return self.obstacle.height(*self.pose.local(x, y))

    def at(self, x: FloatArray, y: FloatArray) -> Height:
        """Height with its derivatives along the array's axes."""
        found = self.obstacle.at(*self.pose.local(x, y))
        c, s = self.pose.direction
        turn = np.array([[c, -s], [s, c]])
        return Height(
            value=found.value,
            slope=found.slope @ turn.T,
            curvature=np.einsum("ik,...kl,jl->...ij", turn, found.curvature, turn),
        )


def levels(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
    *,
    place: Place,
    friction: float = 0.0,
) -> list[list[Level]]:
    """The path on three grids, from the store where it is known; a list of grids for every target.

    Raises:
        ValueError: If the cover could slide away on its base.
    """
    if cover.base == "sliding" and not all(mirrored(indenter, place.pose)):
        raise ValueError(
            "a cover of limited size that slides on its base stays where it is only under a shape that mirrors in both "
            "its middle planes; press its middle, bond its base, or take linear-elastic layers"
        )
    path = LoadingPath(cover=cover, indenter=indenter, targets=tuple(targets), control=control, friction=friction)
    known = small_strain.levels(cover, indenter, targets, control, progress, place=place)
    return finite_strain.corrected(path, known, partial(_both, place=place, progress=progress))


def sizes(indenter: Indenter) -> list[float]:  # noqa: ARG001 -- one interface for all solvers
    """Element sizes of the three grids, relative to the thickness [-]."""
    return [1 / n for n in GRIDS]


def least_order(indenter: Indenter) -> float:  # noqa: ARG001 -- one interface for all solvers
    """Smallest order of convergence believed: every answer is a correction, as in `press_finite` [-]."""
    return 2.0


def assumptions(cover: Cover, indenter: Indenter) -> dict[str, str]:
    """How sharp edges and facets were treated."""
    return finite_strain.rounded(indenter, finite_strain.solid_fillet(cover, indenter))


def _both(
    path: LoadingPath, approaches: Sequence[float], place: Place, progress: Callable[[str], None] | None
) -> finite_strain.Twice:
    inputs = {"path": path, "grids": GRIDS, "pose": place.pose}
    data = result_store.fetch("bounded-press", inputs, lambda: _solve(path, approaches, place, progress))
    rest, deep = (
        [[_level(data, each, place.pose, f"{name}_{n}_{i}") for n in GRIDS] for i in range(len(path.targets))]
        for name, each in (("rest", path.at_rest), ("deep", path))
    )
    return rest, deep


def _solve(
    path: LoadingPath, approaches: Sequence[float], place: Place, progress: Callable[[str], None] | None
) -> dict[str, Any]:
    last = path.targets[-1]
    known = small_strain.levels(path.cover, path.indenter, [last], path.control, progress, place=place)
    out: dict[str, Any] = {}
    pair = None
    for n in GRIDS:
        block = _block(path, place.pose, known[0][0].surface, elements=n)
        rest, deep, pair = press_pair(
            path, block, approaches, elements_per_thickness=n, before=pair, progress=with_grid(progress, n)
        )
        for name, states in (("rest", rest), ("deep", deep)):
            for i, state in enumerate(states):
                here = f"{name}_{n}_{i}"
                x, y, pressure = _base_pressure(state.lines, state.forces, block.mirrored)
                out |= {f"x_{here}": x, f"y_{here}": y, f"pressure_{here}": pressure}
                out[f"scalars_{here}"] = np.array([state.load, state.depth, state.area, state.overlap / state.depth])
    return out


def _level(data: dict[str, Any], path: LoadingPath, pose: Pose, here: str) -> Level:
    load, depth, area, overlap = (float(value) for value in data[f"scalars_{here}"])
    return BoundedLevel(
        total_force=load / path.steepness,
        depth=depth / path.steepness,
        area=area,
        overlap=overlap,
        pose=pose,
        x=data[f"x_{here}"],
        y=data[f"y_{here}"],
        pressure=data[f"pressure_{here}"] / path.steepness,
        half=path.indenter.footprint,
    )


def _block(path: LoadingPath, pose: Pose, surface: FloatArray, *, elements: int) -> Block:
    """The whole cover, or the half or quarter that is enough; fine around the small-strain contact."""
    cover, indenter = path.cover, path.indenter
    unit = Units.of(cover).length
    flat = isinstance(indenter, Flat)
    points = surface[:, :2]
    if flat:
        signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        points = signs * np.array(indenter.footprint)
    placed = np.stack(pose.placed(*points.T)) / unit
    ends = np.array(cover.size) / 2 / unit
    low, high = np.maximum(placed.min(axis=1), -ends), np.minimum(placed.max(axis=1), ends)
    along = pose.square and not indenter.axisymmetric
    fillet = finite_strain.on_grid(finite_strain.solid_fillet(cover, indenter), elements, GRIDS) / unit
    size = min(1.0, float((high - low).min())) / elements
    fine = 0.6 * fillet if flat and along else 0.5 * size
    even = mirrored(indenter, pose)
    sides = [_side((low[axis], high[axis]), float(ends[axis]), (fine, size), mirror=even[axis]) for axis in (0, 1)]
    obstacle = Obstacle(indenter=indenter, fillet=fillet, unit=unit)
    posed = PosedObstacle(obstacle=obstacle, pose=replace(pose, at=(pose.at[0] / unit, pose.at[1] / unit)))
    return Block(sides=sides, mirrored=even, size=size, obstacle=posed, free=True)


def _side(span: tuple[float, float], end: float, steps: tuple[float, float], *, mirror: bool) -> FloatArray:
    """Nodes from side to side, or from the middle: fine at the contact's ends, `coarse` in it and at the sides."""
    fine, coarse = steps
    low, high = span
    marks = [value for value in (low, high) if abs(value) < end * (1 - 1e-9)]
    edges = [0.0 if mirror else -end, *(m for m in marks if not mirror or m > 0), end]
    parts = [np.array(edges[:1])]
    for start, stop in pairwise(edges):
        x = np.linspace(start, stop, 801)
        near = np.min([np.abs(x - mark) for mark in marks], axis=0) if marks else np.full_like(x, np.inf)
        inside = np.maximum(np.maximum(low - x, x - high), 0)
        most = np.minimum(1.2 * coarse + _GROWTH * inside, 1.5 * coarse + _GROWTH * np.minimum(end - x, end + x))
        parts.append(fill_by_spacing(x, np.minimum(fine + _GROWTH * near, most))[1:])
    return np.concatenate(parts)


def _base_pressure(
    lines: Sequence[FloatArray], forces: FloatArray, even: tuple[bool, bool]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The continuous pressure whose consistent nodal forces the reactions are, mirrored halves included."""
    nodes = list(lines)
    value = recover_pressure([Line(edges=each[::2], order=2) for each in nodes], forces)
    for axis in (0, 1):
        if even[axis]:
            nodes[axis] = np.concatenate([-nodes[axis][:0:-1], nodes[axis]])
            value = np.concatenate([np.flip(value, axis), np.delete(value, 0, axis)], axis)
    return nodes[0], nodes[1], value
