"""Solve the frictionless contact of an indenter with a curved top on cells that shrink to the contact.

The contact is solved by the solver of flat covers (`small_strain_contact.frictionless`) in a chart of the top around
the first touch.  A point of the chart lies in the same direction from the origin as the projection of its point of the
top onto the tangent plane, and at the distance of the two points of the top (on a sphere: Lambert's equal-area
projection).  Distances are therefore nearly kept.

The normal compliance of the top is that of a flat bonded layer of the local thickness, which has the singularity under
a point force, plus a remainder: the compliance of the solid less that of the layer.  The remainder is smooth.  It is
computed from the factorised solid for loads that are B-splines on a coarse lattice, which the elements resolve.  A
force on a cell is distributed to the lattice with the same resultant and the same first to third moments; displacements
are interpolated with the same weights, so that the compliance is symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from scipy.interpolate import BSpline, RectBivariateSpline

from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.rays import find_first_node, measure_gaps
from fem_reference.curved_cover.solid import CoverSolid
from fem_reference.errors import ConvergenceError, PiercedError
from fem_reference.finite_strain.loading_path import Control
from fem_reference.linear_response.surface_compliance import SurfaceCompliance, surface_compliance
from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact.constrained_solver import Compliance, ComplianceOperator
from fem_reference.small_strain_contact.friction_cells import WIDER, RubbingContact, VectorOperator, is_cut_off
from fem_reference.small_strain_contact.frictionless import CellGrid, ContactPatch, measure_area, solve_contact
from meshes import Cover, Indenter
from meshes.array_types import BoolArray, FloatArray
from meshes.layer import scale_layers
from meshes.pose import Pose
from meshes.solids.facets import node_normals


@dataclass(frozen=True, kw_only=True)
class LocalSettings:
    """Constants of the chart, of the lattice of the remainder, and of the search for the contact."""

    #: Smallest cosine between the normal of the top and that at the first touch where contact is possible [-].
    least_cosine: float = 0.4
    #: Samples of the top per element along each axis of the chart [-].
    samples: int = 4
    #: Smallest and largest number of samples of the top along each axis of the chart [-].
    counts: tuple[int, int] = (24, 200)
    #: Spacing of the lattice over the size of the elements of the top [-].  With cubic splines and 1.5 the elements are
    #: 0.5 % too soft under one spline, with 1 they are 6 to 40 % too soft.
    spacing: float = 1.5
    #: Degree of the splines [-].
    degree: int = 3
    #: Intervals of the lattice around the window [-].
    margin: int = 1
    #: Points per element of the top along each axis, in integrals of splines [-].
    parts: int = 8
    #: Number of loads that are solved for at once, to limit the memory [-].
    block: int = 64
    #: Reach of the table of the layer's compliance, over the half width of the chart [-].
    reach: float = 8.0
    #: Points along each axis at which the rectangle of possible contact is searched [-].
    searched: int = 121
    #: Number of bisections at each side of this rectangle [-].
    bisections: int = 24
    #: Number of cells across the contact of the first solution, which chooses the window of the remainder [-].
    first_cells: int = 32
    #: Half width of the window of the remainder, over that of the contact before it is solved [-].
    window: float = 1.3
    #: Number of successively smaller rectangles in the search for the first touch [-].
    zooms: int = 12
    #: Number of points along each side of these rectangles [-].
    sampled: int = 41
    #: Smallest part of a distributed force on the top, by which the force is divided [-].
    kept: float = 0.1
    #: Half width of the cells with friction, over that of the contact without it [-].
    rubbed: float = 1.12
    #: Largest number of windows that are tried [-].
    windows: int = 5
    #: Width of the contact over that of the window above which the window is too small [-].
    full: float = 0.97
    #: Largest change of the travel over the depth at which the search for a load stops [-].
    settled: float = 1e-5
    #: Largest number of solutions in the search for a load [-].
    steps: int = 20
    #: Length of a vector in place of zero where the top is not charted [m2].
    tiny: float = 1e-30
    #: Cosine above `least_cosine` below which a contact counts as cut off at the border of the solved part [-].
    cut: float = 0.05


_SETTINGS = LocalSettings()

#: Function that creates the compliance of a flat layer from a number of cells along x and y and their edge lengths [m].
LayerOperator = Callable[[tuple[int, ...], tuple[float, float]], Compliance]

#: Rectangle of a chart: its middle and its half widths, shape (2,) each [m].
Window = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Coordinates (x, y) of a part of the top around the first touch.

    Attributes:
        top: Top of the cover.
        origin: Origin of the chart, a point of the top, shape (3,) [m].
        axes: Axes x, y and z of the chart as rows; z is the normal of the top at the origin, shape (3, 3) [-].
        half: Half width of the square that is charted [m].
    """

    top: FacetSurface
    origin: FloatArray
    axes: FloatArray
    half: float

    @cached_property
    def size(self) -> float:
        """Mean size of the elements of the top [m]."""
        return float(np.sqrt(np.linalg.norm(self.top.split(1)[1], axis=2).sum(axis=1).mean()))

    @cached_property
    def normals(self) -> FloatArray:
        """Unit normals of the charted facets at the nodes of the top; 0 at other nodes, shape (m, 3) [-]."""
        out = np.zeros_like(self.top.nodes)
        used, normals = node_normals(self.top.nodes, self._plane.facets)
        out[used] = normals
        return out

    def locate(self, x: FloatArray, y: FloatArray) -> tuple[sp.csr_matrix, FloatArray]:
        """Find the points of the top at (x, y), shape (k,) each [m].

        Returns:
            Matrix that interpolates values at the m nodes of the top, shape (k, m), and distances from the chart of the
            top, 0 on it, shape (k,) [m].
        """
        return self._plane.locate(np.column_stack([x, y, np.zeros(len(x))]))

    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the points of the top at (x, y), its unit normals there, and whether the top is charted there.

        Points and normals have the shape (..., 3) [m, -] and are in the frame of the array.
        """
        splines, beside = self._splines
        points, along, across = (
            np.stack([each(x, y, dx=i, dy=j, grid=False) for each in splines], axis=-1)
            for i, j in ((0, 0), (1, 0), (0, 1))
        )
        normals = np.cross(along, across)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), _SETTINGS.tiny)
        inside = (np.maximum(np.abs(x), np.abs(y)) <= self.half) & (normals @ self.axes[2] > _SETTINGS.least_cosine)
        return points, normals, np.asarray(inside & (beside(x, y, grid=False) < self._step / 2))

    def frames(self, normals: FloatArray) -> FloatArray:
        """Return the directions against unit normals and along two tangents, shape (..., 3, 3) [-].

        The tangents are the axes x and y of the chart, turned as z is turned to the normal by the shortest way.
        """
        along = self.axes[:2] @ normals[..., None] / (1 + normals @ self.axes[2])[..., None, None]
        tangents = self.axes[:2] - along * (self.axes[2] + normals)[..., None, :]
        return np.concatenate([-normals[..., None, :], tangents], axis=-2)

    @cached_property
    def _plane(self) -> FacetSurface:
        """Facets that face along z, with their nodes at (x, y, 0)."""
        place = (self.top.nodes - self.origin) @ self.axes.T
        away = np.hypot(place[:, 0], place[:, 1])
        scale = np.where(away > 0, np.linalg.norm(place, axis=1) / np.where(away > 0, away, 1.0), 1.0)
        facing = (self.top.normals @ self.axes[2] > _SETTINGS.least_cosine / 2)[self.top.facets].all(axis=1)
        return FacetSurface(
            nodes=place * scale[:, None] * [1, 1, 0], facets=self.top.facets[facing], index=self.top.index
        )

    @property
    def _step(self) -> float:
        """Distance between samples of the top [m]."""
        low, high = _SETTINGS.counts
        return 2 * self.half / float(np.clip(np.ceil(2 * _SETTINGS.samples * self.half / self.size), low, high) - 1)

    @cached_property
    def _splines(self) -> tuple[list[RectBivariateSpline], RectBivariateSpline]:
        """Components of the points of the top [m], and distances from the chart of the top [m], over x and y."""
        axis = np.linspace(-self.half, self.half, round(2 * self.half / self._step) + 1)
        x, y = np.meshgrid(axis, axis, indexing="ij")
        weights, beside = self.locate(x.ravel(), y.ravel())
        points = (weights @ self.top.nodes).reshape(*x.shape, 3)
        return (
            [RectBivariateSpline(axis, axis, points[..., k]) for k in range(3)],
            RectBivariateSpline(axis, axis, beside.reshape(x.shape), kx=1, ky=1),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChartedContact:
    """Indenter over a chart after a travel: what `solve_contact` asks of a place with its own gaps.

    Attributes:
        chart: Chart of the top.
        indenter: Rigid indenter.
        pose: Initial pose.
        touch: Travel to the first touch [m].
        deepest: Largest depth that is solved [m].
        travel: Distance by which the indenter moved from its pose [m].
        window: Rectangle that is divided into cells, or in which the first touch is searched.
        remainder: Compliance of the solid less that of the flat layer; None to neglect it.
    """

    is_face: ClassVar[bool] = False

    chart: Chart
    indenter: Indenter
    pose: Pose
    touch: float
    deepest: float
    travel: float
    window: Window
    remainder: Remainder | None = None

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Compute the distance from the top to the indenter along the normals; inf where no contact is possible [m]."""
        points, normals, inside = self.chart.place(x.ravel(), y.ravel())
        places = self.pose.points_to_indenter(points - self.travel * self.pose.towards)
        gap = measure_gaps(self.indenter, places, self.pose.vectors_to_indenter(normals), behind=2 * self.deepest)
        return np.where(inside & (normals @ self.pose.towards < 0), gap, np.inf).reshape(x.shape)

    def gap_after(self, x: FloatArray, y: FloatArray, travel: float) -> FloatArray:
        """Compute the gap as `gap`, after a travel of the indenter [m]."""
        return replace(self, travel=travel).gap(x, y)

    def rate(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the motion against the normal of the top per travel of the indenter [-]."""
        return np.asarray(-(self.chart.place(x, y)[1] @ self.pose.towards))

    def compliance(
        self, surface: SurfaceCompliance, x: FloatArray, y: FloatArray, cell: tuple[float, float]
    ) -> ComplianceOperator:
        """Create the map from pressures on cells to their displacements, see `ContactPlace.compliance`."""
        addition = None if self.remainder is None else self.remainder.on_points(x.ravel(), y.ravel())
        return ComplianceOperator(surface, x.shape, cell, addition)

    def bound(self) -> Window:
        """Find the rectangle of the chart in which the indenter overlaps the top; its sides lie on straight edges."""
        axis = np.linspace(-self.chart.half, self.chart.half, _SETTINGS.searched)
        x, y = np.meshgrid(axis, axis, indexing="ij")
        overlap = self.gap(x, y) < 0
        if not overlap.any():
            raise ConvergenceError("the indenter is too narrow for the contact to be found; use a wider one")
        ends = np.empty((2, 2))
        for side, pick in enumerate((np.min, np.max)):
            for along, each in enumerate((x, y)):
                ends[side, along] = self._bisect(
                    along, float(pick(each[overlap])), (2 * side - 1) * (axis[1] - axis[0])
                )
        return ends.mean(axis=0), np.ptp(ends, axis=0) / 2

    def find_touch(self) -> float:
        """Find the travel to the first touch in the window, from one at which the indenter is near the top [m].

        The rectangle that is sampled shrinks to the points that may touch first.  Along an edge of the indenter it
        shrinks across the edge first.
        """
        middle, half = self.window
        place, touch = self, self.travel
        for _ in range(_SETTINGS.zooms):
            axes = [m + h * np.linspace(-1, 1, _SETTINGS.sampled) for m, h in zip(middle, half, strict=True)]
            x, y = np.meshgrid(*axes, indexing="ij")
            rate = np.maximum(self.rate(x, y), _SETTINGS.least_cosine / 2)
            travel = place.travel + place.gap(x, y) / rate
            if not np.isfinite(travel).any():
                raise ConvergenceError("the indenter is too narrow for the contact to be found; use a wider one")
            touch = float(travel.min())
            place = replace(place, travel=touch)
            best = np.unravel_index(np.argmin(travel), travel.shape)
            around = travel[tuple(slice(max(k - 1, 0), k + 2) for k in best)]
            near = travel <= touch + float(np.ptp(around[np.isfinite(around)]))
            step = 2 * half / (_SETTINGS.sampled - 1)
            ends = np.array([[pick(each[near]) for each in (x, y)] for pick in (np.min, np.max)])
            low, high = np.maximum(ends[0] - step, middle - half), np.minimum(ends[1] + step, middle + half)
            middle, half = (low + high) / 2, (high - low) / 2
        return touch

    def _bisect(self, along: int, within: float, step: float) -> float:
        """Find the end of the overlap along an axis between a place with overlap and the next one without [m]."""
        across = np.linspace(-self.chart.half, self.chart.half, 4 * _SETTINGS.searched)
        without = within + step
        for _ in range(_SETTINGS.bisections):
            middle = (within + without) / 2
            places = np.full_like(across, middle), across
            is_within = (self.gap(*places[:: 1 - 2 * along]) < 0).any()
            within, without = (middle, without) if is_within else (within, middle)
        return within


@dataclass(frozen=True, kw_only=True, eq=False)
class Remainder:
    """Compliance of a solid less that of a flat layer, between the splines of a lattice.

    Attributes:
        knots: Knots of the splines along x and along y [m].
        inside: Part of each spline that lies on the top, shape (along x, along y) [-].
        compliance: Displacement weighted by a spline per force that is distributed by a spline, shape (m, m) [m/N]; of
            three components of each spline, shape (3 m, 3 m), the component first.
    """

    knots: tuple[FloatArray, FloatArray]
    inside: FloatArray
    compliance: FloatArray

    @classmethod
    def build(cls, solid: CoverSolid, chart: Chart, layer: LayerOperator, window: Window, count: int = 1) -> Remainder:
        """Compute the remainder around a window, from one solution of the solid for each spline and component.

        Args:
            solid: Factorised cover.
            chart: Chart of its top.
            layer: Function that creates the compliance of the flat layer on a grid of cells.
            window: Rectangle of the chart.
            count: 1 for forces against the normals, 3 for those along the tangents as well (`Chart.frames`).
        """
        spacing, cell = _SETTINGS.spacing * chart.size, chart.size / _SETTINGS.parts
        knots, axes = [], []
        for middle, half in zip(*window, strict=True):
            splines = int(np.ceil(2 * half / spacing)) + 2 * (_SETTINGS.margin + _SETTINGS.degree)
            knots.append(middle + spacing * (np.arange(splines + 1) - splines / 2))
            points = int(np.ceil(splines * spacing / cell))
            axes.append(middle + cell * (np.arange(points) - (points - 1) / 2))
        x, y = np.meshgrid(*axes, indexing="ij")
        weights, beside = chart.locate(x.ravel(), y.ravel())
        normals = weights @ chart.normals
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        along, across = (_evaluate(each, place) for each, place in zip(knots, axes, strict=True))
        shares = np.einsum("xi,yj->ijxy", along, across).reshape(-1, x.size) * (cell / spacing) ** 2
        shares *= beside < cell / 2
        frames = chart.frames(normals)[:, :count]
        spread = [[sp.csr_matrix(weights.multiply(frames[:, i, [k]])) for k in range(3)] for i in range(count)]
        near = layer(x.shape, (cell, cell))
        compliance = np.empty((count, len(shares), count, len(shares)))
        for i in range(count):
            for start in range(0, len(shares), _SETTINGS.block):
                block = slice(start, start + _SETTINGS.block)
                part = shares[block]
                forces = np.zeros((len(part), len(solid.nodes), 3))
                forces[:, chart.top.index] = np.stack([part @ each for each in spread[i]], axis=-1)
                moved = solid.solve(chart.top.index, forces=forces)
                pressure = np.zeros((count, *x.shape))
                for k, each in enumerate(part, start=start):
                    pressure[i] = each.reshape(x.shape) / cell**2
                    compliance[i, k] = -near.displace(pressure).reshape(count, -1) @ shares.T
                for j in range(count):
                    sunk = np.sum([(each @ moved[..., axis].T).T for axis, each in enumerate(spread[j])], axis=0)
                    compliance[i, block, j] += sunk @ shares.T
        whole = compliance.reshape(count * len(shares), -1)
        return cls(
            knots=(knots[0], knots[1]),
            inside=shares.sum(axis=1).reshape(along.shape[1], across.shape[1]),
            compliance=(whole + whole.T) / 2,
        )

    def on_points(self, x: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Create the map from forces on k points to their displacements along the forces.

        Forces [N] and displacements [m] have the shape (k,), or (3, k) in the components of `Chart.frames`.
        """
        along, across = (_distribute(each, place) for each, place in zip(self.knots, (x, y), strict=True))
        # At a border of the top splines are cut off; the resultant is kept, its moments are not.
        kept = np.maximum(((along @ self.inside) * across).sum(axis=1), _SETTINGS.kept)
        across /= kept[:, None]

        def displace(force: FloatArray) -> FloatArray:
            load = along.T @ (across * force[..., None])
            moved = (self.compliance @ load.ravel()).reshape(load.shape)
            return np.asarray(((along @ moved) * across).sum(axis=-1))

        return displace


def _evaluate(knots: FloatArray, places: FloatArray) -> FloatArray:
    """Evaluate the splines on equidistant knots that vanish at both ends, shape (places, splines) [-]."""
    degree = _SETTINGS.degree
    count = len(knots) - degree - 1
    value = [BSpline.basis_element(knots[i : i + degree + 2], extrapolate=False)(places) for i in range(count)]
    return np.nan_to_num(np.array(value).T)


def _distribute(knots: FloatArray, places: FloatArray) -> FloatArray:
    """Compute the shares of splines in unit forces at k places, shape (k, splines) [-].

    A spline of degree d distributes a force with the variance (d + 1) / 12 of the spacing squared, and so do the values
    of the splines at a place.  The filter (-c, 1 + 2 c, -c) with c = (d + 1) / 12 removes both.
    """
    value, share = _evaluate(knots, places), (_SETTINGS.degree + 1) / 12
    out = (1 + 2 * share) * value
    out[:, 1:] -= share * value[:, :-1]
    out[:, :-1] -= share * value[:, 1:]
    return np.asarray(out)


@dataclass(frozen=True, kw_only=True, eq=False)
class CellContact:
    """Contact of an indenter on cells of a curved top.

    Attributes:
        points: Points of the top in the middles of the k cells in contact, shape (k, 3) [m].
        forces: Forces of the indenter on the cover there, shape (k, 3) [N].
        nodal: The same forces on the m nodes of the top, shape (m, 3) [N].
        load: Force along the motion [N].
        travel: Distance by which the indenter moved from its pose [m].
        touch: Travel to the first touch [m].
        area: Contact area [m2].
        size: Size of the elements of the top [m].
        is_cut: Whether the contact reaches the border of the part of the top that was solved.
        at_border: Spacing of the lattice over the smaller half width of a contact so near to a border of the top that
            the lattice does not resolve the effect of the border, at most 1; 0 for other contacts [-].
    """

    points: FloatArray
    forces: FloatArray
    nodal: FloatArray
    load: float
    travel: float
    touch: float
    area: float
    size: float
    is_cut: bool
    at_border: float

    @property
    def depth(self) -> float:
        """Approach of the indenter from first touch [m]."""
        return self.travel - self.touch


@dataclass(frozen=True, kw_only=True, eq=False)
class CellPress:
    """Contact of an indenter with a curved top on cells, at a depth or under a load.

    Attributes:
        solid: Factorised cover.
        place: Chart, indenter and remainder; its window contains the contact.
        layer: Compliance of the flat layer.
        load: Load [N]; None at a depth.
        patch: Contact without friction on the first cells.
    """

    solid: CoverSolid
    place: ChartedContact
    layer: SurfaceCompliance
    load: float | None
    patch: ContactPatch

    @classmethod
    def begin(
        cls,
        solid: CoverSolid,
        top: FacetSurface,
        indenter: Indenter,
        pose: Pose,
        touch: float,
        *,
        target: float,
        control: Control,
        cells: int,
        deepest: float,
    ) -> CellPress:
        """Press an indenter into a curved top to a load [N] or a depth [m] at small strain, without friction.

        Args:
            solid: Factorised cover.
            top: Its top.
            indenter: Rigid indenter.
            pose: Initial pose; the indenter moves along its direction.
            touch: Travel to the first touch, known to a fraction of an element [m].
            target: Load or depth.
            control: Which of the two is given.
            cells: Number of cells across the contact.
            deepest: Largest depth that is solved [m].

        Raises:
            PiercedError: If the target is deeper.
            ConvergenceError: If the contact or the load is not found.
        """
        chart = _chart(top, indenter, pose, touch, deepest)
        unbounded = np.zeros(2), np.full(2, chart.half)
        place = ChartedContact(
            chart=chart, indenter=indenter, pose=pose, touch=touch, deepest=deepest, travel=touch + deepest,
            window=unbounded,
        )  # fmt: skip
        most = place.bound()
        touch = replace(place, window=most, travel=touch).find_touch()
        place = replace(place, touch=touch)
        layer = surface_compliance(_find_layer(solid, chart), _SETTINGS.reach * chart.half)
        place = replace(place, travel=touch if control == "load" else touch + target, window=most)
        load = target if control == "load" else None
        if control == "depth" and target > deepest:
            raise PiercedError(
                f"at a depth of {1e3 * target:.4g} mm the indenter would go through most of the cover; use at most "
                f"{1e3 * deepest:.4g} mm",
                "depth",
            )
        patch, place = _find(place, layer, load, _SETTINGS.first_cells, rough=True)
        for _ in range(_SETTINGS.windows):
            middle, half = _measure(patch)
            low = np.maximum(middle - _SETTINGS.window * half, most[0] - most[1])
            high = np.minimum(middle + _SETTINGS.window * half, most[0] + most[1])
            window = (low + high) / 2, (high - low) / 2
            remainder = Remainder.build(solid, chart, partial(ComplianceOperator, layer), window)
            patch, place = _find(replace(place, window=window, remainder=remainder), layer, load, cells)
            middle, half = _measure(patch)
            short = (1 - _SETTINGS.full) * window[1]
            below = (middle - half < low + short) & (low > most[0] - most[1])
            above = (middle + half > high - short) & (high < most[0] + most[1])
            if not (below | above).any():
                return cls(solid=solid, place=place, layer=layer, load=load, patch=patch)
        raise ConvergenceError(f"the extent of the contact was not found in {_SETTINGS.windows} steps; use less load")

    def solve(self, cells: int | None = None) -> CellContact:
        """Solve the contact without friction on a number of cells across the contact; None for the first ones."""
        patch, place = (self.patch, self.place) if cells is None else _find(self.place, self.layer, self.load, cells)
        return _describe(place, (patch.x, patch.y), patch.force[None], _measure(patch), area=patch.area)

    def rub(
        self, friction: float, grids: Sequence[tuple[int, int]], wider: float = 1.0
    ) -> list[tuple[CellContact, CellContact]]:
        """Solve the contact without and with friction on the same cells.

        Args:
            friction: Coefficient of friction, inf for no slip [-].
            grids: Numbers of cells along each axis and of steps from first touch.
            wider: Factor on the half width of the cells; they are widened where the contact reaches their edge [-].

        Returns:
            Both contacts of each grid.  The load of the first one is near the given load, that of the second the same.

        Raises:
            ConvergenceError: If the contact is not found.
        """
        place, (middle, half) = self.place, _measure(self.patch)
        chart, window = place.chart, place.window
        bounds = window[0] - window[1], window[0] + window[1]
        low = np.maximum(middle - wider * _SETTINGS.rubbed * half, bounds[0])
        high = np.minimum(middle + wider * _SETTINGS.rubbed * half, bounds[1])
        layer = VectorCompliance.tabulate(_find_layer(self.solid, chart), _SETTINGS.reach * chart.half)
        remainder = Remainder.build(self.solid, chart, partial(VectorOperator, layer), window, 3)
        out = []
        for cells, steps in grids:
            grid = CellGrid.span((low + high) / 2, (high - low) / 2, np.array([cells, cells]))
            x, y = grid.x, grid.y
            frames = chart.frames(chart.place(x, y)[1])
            contact = RubbingContact(
                gap=partial(place.gap_after, x, y),
                motion=np.moveaxis(frames @ place.pose.towards, -1, 0),
                compliance=VectorOperator(layer, x.shape, grid.cell, remainder.on_points(x.ravel(), y.ravel())),
                area=grid.area,
                friction=friction,
            )
            depth = place.travel - place.touch
            smooth = replace(contact, friction=0.0).follow(place.touch, depth, 1)
            load = None if self.load is None else contact.measure_load(smooth)
            full = contact.follow(place.touch, depth, steps, load)
            if is_cut_off(full.touching, low > bounds[0], high < bounds[1]):
                return self.rub(friction, grids, wider * WIDER)
            pair = []
            for state in (smooth, full):
                here, kept = replace(place, travel=state.travel), state.touching
                pair.append(
                    _describe(
                        here, (x[kept], y[kept]), state.traction[:, kept] * grid.area, (middle, half),
                        area=measure_area(state.traction[0], np.isfinite(here.gap(x, y)), grid.cell),
                    )
                )  # fmt: skip
            out.append((pair[0], pair[1]))
        return out


def _find_layer(solid: CoverSolid, chart: Chart) -> Cover:
    """Return the flat layers of a cover, scaled to the thickness of the cover at the origin of a chart."""
    base = FacetSurface.part_of(solid.nodes, solid.layout.base)
    thickness = float(base.locate(chart.origin[None])[1][0])
    return Cover(layers=scale_layers(solid.layers, thickness))


def _describe(
    place: ChartedContact, at: tuple[FloatArray, FloatArray], force: FloatArray, within: Window, *, area: float
) -> CellContact:
    """Describe a solved contact in the frame of the array.

    Args:
        place: Indenter over the chart.
        at: x and y of the k cells in contact, shape (k,) each [m].
        force: Forces on them against the normals and, with friction, along the tangents, shape (1, k) or (3, k) [N].
        within: Rectangle around the contact.
        area: Contact area [m2].
    """
    chart = place.chart
    points, normals, _ = chart.place(*at)
    forces = np.einsum("ik,kic->kc", force, chart.frames(normals)[:, : len(force)])
    # Points around the contact, one lattice spacing outside of it, and their distances from the top.
    middle, half = within
    turn = np.linspace(0, 2 * np.pi, 4 * _SETTINGS.counts[0])
    around = np.clip(np.sqrt(2) * np.stack([np.cos(turn), np.sin(turn)]), -1, 1)
    spacing = chart.size * _SETTINGS.spacing
    _, beside = chart.locate(*(middle[:, None] + (half + spacing)[:, None] * around))
    return CellContact(
        points=points,
        forces=forces,
        nodal=np.asarray(chart.locate(*at)[0].T @ forces),
        load=float((forces @ place.pose.towards).sum()),
        travel=place.travel,
        touch=place.touch,
        area=area,
        size=chart.size,
        at_border=float(min(spacing / half.min(), 1.0) * (beside > spacing / 4).any()),
        is_cut=bool((normals @ chart.axes[2] < _SETTINGS.least_cosine + _SETTINGS.cut).any()),
    )


def _chart(top: FacetSurface, indenter: Indenter, pose: Pose, touch: float, deepest: float) -> Chart:
    """Chart the top around the first touch, as far as the indenter can reach; x is along that of the indenter."""
    first = find_first_node(top, indenter, pose, touch)
    normal = top.normals[first]
    x = pose.rotation[:, int(abs(pose.rotation[:, 0] @ normal) > abs(pose.rotation[:, 1] @ normal))]
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    chart = Chart(top=top, origin=top.nodes[first], axes=np.stack([x, np.cross(normal, x), normal]), half=0.0)
    places = pose.points_to_indenter(top.nodes - (touch + deepest) * pose.towards)
    gap = measure_gaps(indenter, places, pose.vectors_to_indenter(top.normals), behind=2 * deepest)
    reached = (gap < chart.size) & (top.normals @ normal > 0)
    far = np.linalg.norm(top.nodes[reached] - chart.origin, axis=1).max(initial=0.0)
    return replace(chart, half=float(far + 2 * chart.size))


def _find(
    place: ChartedContact, layer: SurfaceCompliance, load: float | None, cells: int, *, rough: bool = False
) -> tuple[ContactPatch, ChartedContact]:
    """Solve the contact at the travel of a place, or repeatedly until the travel under a load [N] no longer changes.

    The gap is measured along the normals of the top.  Its change with the travel is linear to first order only.  On
    cells that are wider than the contact the travel may jump back and forth; a `rough` result only shows where the
    contact is.
    """
    if load is None:
        return solve_contact(layer, place.indenter, cells=cells, depth=0.0, sides=place), place
    for _ in range(_SETTINGS.steps):
        patch = solve_contact(layer, place.indenter, cells=cells, load=load, sides=place)
        place = replace(place, travel=place.travel + patch.depth)
        depth = place.travel - place.touch
        if depth > place.deepest:
            deep = replace(place, travel=place.touch + place.deepest)
            most = solve_contact(layer, place.indenter, cells=cells, depth=0.0, sides=deep)
            raise PiercedError(
                f"{load:.4g} N would press the indenter through most of the cover; use at most "
                f"{most.force @ deep.rate(most.x, most.y):.3g} N, a wider indenter or a stiffer cover",
                "load",
            )
        if abs(patch.depth) <= _SETTINGS.settled * depth:
            return patch, place
    if rough:
        return patch, place
    raise ConvergenceError(f"the depth under {load:.4g} N was not found in {_SETTINGS.steps} steps")


def _measure(patch: ContactPatch) -> Window:
    """Return the rectangle around the cells in contact."""
    ends = np.array([[pick(patch.x), pick(patch.y)] for pick in (np.min, np.max)])
    return ends.mean(axis=0), np.ptp(ends, axis=0) / 2 + np.array(patch.cell) / 2
