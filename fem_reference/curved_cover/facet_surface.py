"""Quadratic facets of the base or the top of a curved cover: areas, normals, integrals and nearest points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.spatial import KDTree

from fem_reference.elements.line import sum_blocks
from meshes.array_types import FloatArray, IntArray
from meshes.solids.facets import QUADRILATERAL, area_vectors, facet_shape, facet_slope, node_normals, split_facet

#: Polynomial order that the quadrature on facets integrates exactly [-].
_ORDER = 6
#: Number of parts along each side of a facet in the search for the nearest point [-].  The middles of the parts are
#: possible starts of the search.
_PARTS = 4
#: Number of starts, the nearest middles of parts of facets, from which the nearest point of a surface is searched [-].
_CANDIDATES = 6
#: Largest number of Gauss-Newton steps of the search for the nearest point, from each start [-].
_STEPS = 12
#: Change of the reference coordinates in a step below which the search has ended [-].
_STILL = 1e-12
#: Squared sine of the angle between the slopes of a facet, below which it has no area there [-].
_FLAT = 1e-24


@dataclass(frozen=True, kw_only=True, eq=False)
class FacetSurface:
    """Surface of quadratic facets on m nodes.

    Attributes:
        nodes: Positions of the m nodes, shape (m, 3) [m].
        facets: Indices of the nodes of each of f facets, shape (f, 9) or (f, 6).
        index: Index of each node in the displacement nodes of the solid, ascending, shape (m,).
    """

    nodes: FloatArray
    facets: IntArray
    index: IntArray

    @classmethod
    def part_of(cls, nodes: FloatArray, facets: IntArray) -> FacetSurface:
        """Create the surface of some facets of a solid.

        Args:
            nodes: Positions of the n displacement nodes of the solid, shape (n, 3) [m].
            facets: Indices of the nodes of each facet, shape (f, 9) or (f, 6).
        """
        index, place = np.unique(facets, return_inverse=True)
        return cls(nodes=nodes[index], facets=place.reshape(facets.shape), index=index)

    @cached_property
    def normals(self) -> FloatArray:
        """Unit normals at the nodes, out of the base or the top, shape (m, 3) [-]."""
        return node_normals(self.nodes, self.facets)[1]

    @cached_property
    def areas(self) -> FloatArray:
        """Integrals of the shape functions, which are the areas that belong to the nodes, shape (m,) [m2].

        They are zero at the corners of flat triangles.
        """
        shape, weight = self._quadrature
        part = np.einsum("fq,qa->fa", weight, shape)
        return np.asarray(np.bincount(self.facets.ravel(), part.ravel(), len(self.nodes)), dtype=float)

    @cached_property
    def mass(self) -> sp.csr_matrix:
        """Integrals over the surface of the products of shape functions of two nodes, shape (m, m) [m2]."""
        return self._integrate_products(self._quadrature[1])

    def integrate_pressure(self, pressure: FloatArray) -> FloatArray:
        """Compute the nodal forces of a pressure on the surface, which acts opposite to the normals.

        Args:
            pressure: Pressures at the nodes, between which the shape functions interpolate, shape (k, m) [Pa].

        Returns:
            Forces, shape (k, m, 3) [N].
        """
        place, weight = quadrature(self.facets.shape[1])
        inward = -area_vectors(self.nodes, self.facets, place) * weight[:, None]
        parts = [(self._integrate_products(inward[..., axis]) @ pressure.T).T for axis in range(3)]
        return np.stack(parts, axis=-1)

    def split(self, parts: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Split every facet into equal parts.

        Args:
            parts: Number of parts along each side of a facet [-].

        Returns:
            Middles of the k parts of each facet, shape (f, k, 3) [m].  Area vectors of the parts, shape (f, k, 3) [m2].
            Edge vectors of the parts, shape (f, k, 2, 3) [m].
        """
        count = self.facets.shape[1]
        place, _ = split_facet(count, parts)
        corner = self.nodes[self.facets]
        middle = np.einsum("qa,fac->fqc", facet_shape(count, place), corner, optimize=True)
        step = (2 if count == QUADRILATERAL else 1) / parts
        edges = np.einsum("qda,fac->fqdc", facet_slope(count, place), corner, optimize=True) * step
        share = (4 if count == QUADRILATERAL else 0.5) / parts**2
        return middle, area_vectors(self.nodes, self.facets, place) * share, edges

    def locate(self, points: FloatArray) -> tuple[sp.csr_matrix, FloatArray]:
        """Find the points of the surface that are nearest to given points.

        Args:
            points: k points, shape (k, 3) [m].

        Returns:
            Matrix that interpolates nodal values at the nearest points, shape (k, m), and the distances, shape (k,)
            [m].
        """
        count = self.facets.shape[1]
        tree, starts = self._search
        found = tree.query(points, k=min(_CANDIDATES, tree.n))[1].reshape(len(points), -1)
        facet, place = found // len(starts), starts[found % len(starts)]
        corner = self.nodes[self.facets[facet]]
        place = _approach(
            np.repeat(points, facet.shape[1], axis=0), corner.reshape(-1, count, 3), place.reshape(-1, 2)
        ).reshape(place.shape)
        away = points[:, None] - (facet_shape(count, place)[..., None, :] @ corner)[..., 0, :]
        distance = np.linalg.norm(away, axis=2)
        best = np.argmin(distance, axis=1)
        every = np.arange(len(points))
        weights = facet_shape(count, place[every, best])
        columns = self.facets[facet[every, best]]
        shape = (len(points), len(self.nodes))
        return sp.csr_matrix(
            (weights.ravel(), columns.ravel(), count * np.arange(len(points) + 1)), shape=shape
        ), distance[every, best]

    @cached_property
    def _search(self) -> tuple[KDTree, FloatArray]:
        """Search tree of points on the facets, and their reference coordinates, which are the same for every facet."""
        return KDTree(self.split(_PARTS)[0].reshape(-1, 3)), split_facet(self.facets.shape[1], _PARTS)[0]

    @cached_property
    def _quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Shape functions at the quadrature points, shape (q, a), and the areas of the points, shape (f, q) [m2]."""
        place, weight = quadrature(self.facets.shape[1])
        area = np.linalg.norm(area_vectors(self.nodes, self.facets, place), axis=2) * weight
        return facet_shape(self.facets.shape[1], place), area

    def _integrate_products(self, weight: FloatArray) -> sp.csr_matrix:
        """Integrate the products of shape functions with weights of the quadrature points, shape (m, m).

        Args:
            weight: Weight of each of q quadrature points of f facets, shape (f, q) [m2].
        """
        shape = self._quadrature[0]
        blocks = np.einsum("fq,qa,qb->fab", weight, shape, shape, optimize=True)
        return sum_blocks(blocks, self.facets, self.facets, (len(self.nodes), len(self.nodes)))


def quadrature(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Return points, shape (q, 2), and weights, shape (q,), of a quadrature on a facet of 9 or 6 nodes."""
    if nodes == QUADRILATERAL:
        points, weights = np.polynomial.legendre.leggauss(_ORDER // 2 + 1)
        v, u = np.meshgrid(points, points, indexing="ij")
        return np.column_stack([u.ravel(), v.ravel()]), np.outer(weights, weights).ravel()
    points, weights = skfem.quadrature.get_quadrature(skfem.ElementTriP2(), _ORDER)
    return np.ascontiguousarray(points.T), np.asarray(weights, dtype=float)


def _approach(points: FloatArray, corner: FloatArray, place: FloatArray) -> FloatArray:
    """Find the places on k facets nearest to k points, by Gauss-Newton steps that stay on the facet.

    Args:
        points: Points, shape (k, 3) [m].
        corner: Positions of the nodes of each facet, shape (k, 9, 3) or (k, 6, 3) [m].
        place: Reference coordinates of the starts, shape (k, 2) [-].

    Returns:
        Reference coordinates, shape (k, 2) [-].
    """
    count, place, left = corner.shape[1], place.copy(), np.arange(len(place))
    for _ in range(_STEPS):
        start = place[left]
        shape = np.concatenate([facet_shape(count, start)[:, None], facet_slope(count, start)], axis=1)
        reached, u, v = np.moveaxis(shape @ corner[left], 1, 0)
        away = points[left] - reached
        uu, uv, vv, right_u, right_v = (
            np.einsum("kd,kd->k", *pair) for pair in ((u, u), (u, v), (v, v), (u, away), (v, away))
        )
        step = np.column_stack([vv * right_u - uv * right_v, uu * right_v - uv * right_u])
        area = (uu * vv - uv * uv)[:, None]
        # A start on a collapsed side of a facet stays where it is; the other starts find the point.
        place[left] = _clip(
            count, start + np.divide(step, area, out=np.zeros_like(step), where=area > _FLAT * (uu * vv)[:, None])
        )
        left = left[np.abs(place[left] - start).max(axis=1) > _STILL]
    return place


def _clip(nodes: int, place: FloatArray) -> FloatArray:
    """Move reference coordinates that lie outside the reference facet of 9 or 6 nodes to its border."""
    if nodes == QUADRILATERAL:
        return np.clip(place, -1.0, 1.0)
    place = np.maximum(place, 0.0)
    return np.asarray(place / np.maximum(place.sum(axis=-1, keepdims=True), 1.0))
