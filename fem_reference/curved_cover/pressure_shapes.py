"""Shape functions of the contact pressure on the top of a curved cover, and the mean gap under each of them.

The contact pressure is interpolated linearly between the nodes of the top.  Each quadratic facet is split into four
parts, on which the shape functions of the pressure (hats) are linear.  Gap and displacement are averaged over each hat
(mortar method; Puso and Laursen 2004), so that the result is continuous when an edge of the indenter moves across a
facet.  The pressure is zero where a line along the normal does not meet the indenter; hats therefore end at sharp
edges.  It is also zero where the gap is far larger than the overlap elsewhere, as below a steep side next to an edge.
Such a gap would increase the mean gap of a hat that is partly in contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fem_reference.curved_cover.facet_surface import FacetSurface, quadrature
from fem_reference.curved_cover.rays import measure_gaps
from fem_reference.elements.line import sum_blocks
from meshes import Indenter
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.pose import Pose
from meshes.solids.facets import QUADRILATERAL, area_vectors, facet_shape, split_facet

#: Number of parts along each side of a facet [-].  Gaps are measured at the middles of the parts.  The number is even,
#: so that the lines on which the slope of a hat jumps run between the parts.
_PARTS = 16
#: Number of parts along each side of a facet in the search for the facets that the indenter can touch [-].
_SEARCH_PARTS = 6
#: Part of the area of a hat that can touch the indenter, over its whole area, up to which the hat carries no force [-].
_LEAST_SHARE = 1e-3
#: Part of the area of a hat that lies below the indenter, over its whole area, below which the hat counts as cut by an
#: edge of the indenter [-].
_WHOLE = 0.999
#: Gap up to which a point has full weight in the mean gap of a hat [-].  The gap is relative to the deepest overlap or
#: to the distance between the points, whichever is larger.  Next to a contact the surface rises by less than the
#: overlap.
_NEAR = 1.0
#: Gap from which a point has no weight in the mean gap of a hat, over the same length as `_NEAR` [-].
_FAR = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanGaps:
    """Mean gaps under hats, or gaps at points, of a top with m nodes.  One hat belongs to each node.

    For gaps at points (`PointSampler`), m is the number of points except for the rows of `spread`.

    Attributes:
        gap: Mean distance to the indenter along the normals, shape (m,) [m]; inf where the pressure is zero.
        rate: Mean decrease of the gap per travel of the indenter, shape (m,) [-].
        area: Area of the part of each hat that can touch, shape (m,) [m2].
        is_cut: Whether a part of each hat lies outside the outline of the indenter, shape (m,).
        spread: Force on each node (row) per unit force of the pressure of each hat (column), shape (m, m) [-].  The
            columns of hats with pressure sum to 1.
        softness: Compliance of a spring between the indenter and each hat, shape (m,) [m/N]; 0 for rigid contact.
    """

    gap: FloatArray
    rate: FloatArray
    area: FloatArray
    is_cut: BoolArray
    spread: sp.csc_matrix
    softness: FloatArray | float = 0.0


#: Smallest cosine between the motion and the inward normal of a facet that can come into contact [-].
_FACING = 0.03


class GapSampler:
    """Points of the part of a top that can come into contact with an indenter on its path.

    Args:
        top: Top of the cover.
        indenter: Rigid indenter.
        pose: Initial pose; the indenter moves without rotation.
        farthest: Largest travel from the pose [m].
        deepest: Largest depth [m].  Points that an indenter of smaller height has passed still count as in contact.

    Attributes:
        penalty: Pressure per penetration at the points, used by `PointSampler`; inf for rigid contact [Pa/m].
    """

    penalty: float = np.inf

    def __init__(
        self, top: FacetSurface, indenter: Indenter, pose: Pose, farthest: float, deepest: float = 0.0
    ) -> None:
        self._deepest, self._top, self._indenter, self._pose = deepest, top, indenter, pose
        every, count = np.arange(len(top.facets)), top.facets.shape[1]
        self._set_points(every, *_middles(count, _SEARCH_PARTS))
        reach = np.ptp(top.nodes[top.facets], axis=1).max(axis=1)
        # Facets that are almost parallel to the motion bear no force along it, such as the sides of a flat pad.
        facing = -area_vectors(top.nodes, top.facets, np.full((1, 2), 0.0 if count == QUADRILATERAL else 1 / 3))[:, 0]
        along = facing @ pose.towards > _FACING * np.linalg.norm(facing, axis=1)
        near = along & (self._measure(farthest) < reach[:, None]).any(axis=1)
        self._set_points(every[near], *self._choose_points(count))

    def _choose_points(self, nodes: int) -> tuple[FloatArray, FloatArray]:
        """Return the points at which gaps are measured and their weights, on a reference facet of 9 or 6 nodes."""
        return _middles(nodes, _PARTS)

    def _set_points(self, facets: IntArray, place: FloatArray, weight: FloatArray) -> None:
        """Place the points at which gaps are measured.

        Args:
            facets: Indices of the facets that get points, shape (f,).
            place: Points on the reference facet, shape (q, 2).
            weight: Weights of these points, shape (q,) [-].
        """
        top = self._top
        self._cells = top.facets[facets]
        count = self._cells.shape[1]
        self._points = np.einsum("qa,fac->fqc", facet_shape(count, place), top.nodes[self._cells], optimize=True)
        self._weight = np.linalg.norm(area_vectors(top.nodes, self._cells, place), axis=2) * weight
        self._shape, self._hat = facet_shape(count, place), evaluate_hats(count, place)
        normals = np.einsum("qa,fac->fqc", self._shape, top.normals[self._cells], optimize=True)
        self._normals = normals / np.linalg.norm(normals, axis=2, keepdims=True)

    def spread_whole(self) -> sp.csc_matrix:
        """Compute nodal forces from forces of whole hats, of which no edge of the indenter cuts off a part.

        Returns:
            Force on each node (row) per unit force of each hat (column), shape (m, m) [-].
        """
        return _spread_whole(self._cells, self._shape, self._hat, self._weight, len(self._top.nodes))

    def _measure(self, travel: float) -> FloatArray:
        """Measure the distance of all points to the indenter along their normals, after a travel of the indenter [m].

        Returns:
            Distances, shape (f, q) [m]; inf where the normal does not point against the motion.
        """
        points, normals = self._points.reshape(-1, 3), self._normals.reshape(-1, 3)
        places = self._pose.points_to_indenter(points - travel * self._pose.towards)
        turned = self._pose.vectors_to_indenter(normals)
        gap = measure_gaps(self._indenter, places, turned, behind=self._deepest)
        return np.where(normals @ self._pose.towards < 0, gap, np.inf).reshape(self._weight.shape)

    def at(self, travel: float) -> MeanGaps:
        """Compute the mean gap under every hat after the indenter moved by the distance `travel` from its pose [m]."""
        count = len(self._top.nodes)
        gap = self._measure(travel)
        covered = np.isfinite(gap)
        height = np.where(covered, gap, 0.0)
        near = np.maximum(np.sqrt(self._weight), -float(gap.min(initial=0.0)))
        weight = self._weight * covered * np.clip((_FAR - height / near) / (_FAR - _NEAR), 0.0, 1.0)
        rate = -(self._normals @ self._pose.towards)
        whole, below, area, total, towards = (
            np.bincount(self._cells.ravel(), (each @ self._hat).ravel(), count)
            for each in (self._weight, self._weight * covered, weight, weight * height, weight * rate)
        )
        carries = area > _LEAST_SHARE * whole
        each = np.where(carries, area, np.inf)
        spread = _assemble_spread(self._cells, self._shape, self._hat, weight, each)
        return MeanGaps(
            gap=np.where(carries, total / each, np.inf),
            rate=towards / each,
            area=np.where(carries, area, 0.0),
            is_cut=below < _WHOLE * whole,
            spread=spread,
        )


class PointSampler(GapSampler):
    """Gauss points of the part of a top that an indenter can touch; see `GapSampler`.

    Every point bears its own contact force.
    """

    def _choose_points(self, nodes: int) -> tuple[FloatArray, FloatArray]:
        return quadrature(nodes)

    def at(self, travel: float) -> MeanGaps:
        """Compute the gap at every Gauss point after the indenter moved by the distance `travel` from its pose [m]."""
        weight = self._weight.ravel()
        rows = np.repeat(self._cells, len(self._shape), axis=0).ravel()
        values = np.tile(self._shape, (len(self._cells), 1)).ravel()
        pointer = np.arange(len(weight) + 1) * self._cells.shape[1]
        return MeanGaps(
            gap=self._measure(travel).ravel(),
            rate=-(self._normals @ self._pose.towards).ravel(),
            area=weight,
            is_cut=np.zeros(len(weight), dtype=bool),
            spread=sp.csc_matrix((values, rows, pointer), shape=(len(self._top.nodes), len(weight))),
            softness=1 / (self.penalty * weight),
        )


def _assemble_spread(
    cells: IntArray, shape: FloatArray, hat: FloatArray, weight: FloatArray, area: FloatArray
) -> sp.csc_matrix:
    """Assemble the force on each node (row) per unit force of the pressure of each hat (column), shape (m, m) [-].

    Args:
        cells: Nodes of f facets, shape (f, a).
        shape: Shape functions of the displacement at q points of a facet, shape (q, a) [-].
        hat: Hats at the quadrature points, shape (q, a) [-].
        weight: Area of each point, shape (f, q) [m2].
        area: Area of each hat, shape (m,) [m2].
    """
    product = np.einsum("qb,qa,fq->fba", shape, hat, weight, optimize=True) / area[cells][:, None, :]
    return sum_blocks(product, cells, cells, (len(area), len(area))).tocsc()


def _spread_whole(cells: IntArray, shape: FloatArray, hat: FloatArray, weight: FloatArray, count: int) -> sp.csc_matrix:
    """Assemble the matrix of `_assemble_spread` for whole hats, of which no edge of the indenter cuts off a part.

    `count` is the number of nodes.
    """
    area = np.bincount(cells.ravel(), (weight @ hat).ravel(), count)
    return _assemble_spread(cells, shape, hat, weight, np.where(area > 0, area, np.inf))


def spread_hats(top: FacetSurface) -> sp.csc_matrix:
    """Compute nodal forces from forces of hats, the shape functions of the contact pressure, on the whole top.

    Returns:
        Force on each node (row) per unit force of each hat (column), shape (m, m) [-].
    """
    count = top.facets.shape[1]
    place, share = _middles(count, _PARTS)
    weight = np.linalg.norm(area_vectors(top.nodes, top.facets, place), axis=2) * share
    return _spread_whole(top.facets, facet_shape(count, place), evaluate_hats(count, place), weight, len(top.nodes))


def _middles(nodes: int, parts: int) -> tuple[FloatArray, FloatArray]:
    """Divide the reference facet of 9 or 6 nodes into equal parts.

    Returns:
        Middles of the q parts, shape (q, 2), and their areas, shape (q,) [-].
    """
    place = split_facet(nodes, parts)[0]
    return place, np.full(len(place), (4.0 if nodes == QUADRILATERAL else 0.5) / len(place))


def evaluate_hats(nodes: int, place: FloatArray) -> FloatArray:
    """Evaluate the functions that are linear (bilinear) between the nodes of a quadratic facet, in the nodes' order.

    Args:
        nodes: Number of nodes of the facet, 9 or 6 [-].
        place: Points on the reference facet, shape (q, 2).

    Returns:
        Values, which sum to 1 at each point, shape (q, nodes) [-].
    """
    u, v = place[:, 0], place[:, 1]
    if nodes == QUADRILATERAL:
        along, across = (np.stack([np.maximum(-x, 0), 1 - np.abs(x), np.maximum(x, 0)], axis=1) for x in (u, v))
        return np.asarray((across[:, :, None] * along[:, None, :]).reshape(len(place), -1))
    w = 1 - u - v
    corners = [2 * w - 1, 2 * u - 1, 2 * v - 1]
    middles = [
        np.minimum(np.minimum(2 * one, 2 * two), 1 - 2 * opposite)
        for one, two, opposite in ((w, u, v), (u, v, w), (v, w, u))
    ]
    return np.asarray(np.maximum(np.stack([*corners, *middles], axis=1), 0.0))
