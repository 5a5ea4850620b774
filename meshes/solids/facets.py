"""Shape functions and normals of facets: quadrilaterals of 9 nodes and triangles of 6 nodes.

The nodes of a quadrilateral are in lexicographic order, node i + 3 j at (i, j) of 3 x 3, with i along the first
coordinate; the reference square is -1..1.  The reference triangle has the corners (0, 0), (1, 0) and (0, 1); nodes 3,
4 and 5 of a triangle of 6 nodes are the middles of its sides 01, 12 and 20.
"""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray, IntArray

#: Number of nodes of a quadratic quadrilateral [-].
QUADRILATERAL = 9
#: Cosine of the angle between two facets below which the edge between them is sharp [-]; 40 degrees.
_SHARP = 0.77
#: Number of nodes of a quadratic triangle [-].
QUADRATIC_TRIANGLE = 6


def line_shape(x: FloatArray) -> FloatArray:
    """Evaluate the three quadratic shape functions on -1..1 with nodes -1, 0, 1, shape (..., 3)."""
    return np.stack([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2], axis=-1)


def line_slope(x: FloatArray) -> FloatArray:
    """Evaluate the derivatives of `line_shape`, shape (..., 3)."""
    return np.stack([x - 0.5, -2 * x, x + 0.5], axis=-1)


def facet_shape(nodes: int, place: FloatArray) -> FloatArray:
    """Evaluate the shape functions of a facet.

    Args:
        nodes: Number of nodes of the facet, 9 or 6 [-].
        place: Points on the reference facet, shape (..., 2).

    Returns:
        Values, shape (..., nodes) [-].
    """
    u, v = place[..., 0], place[..., 1]
    if nodes == QUADRATIC_TRIANGLE:
        w = 1 - u - v
        return np.stack([w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w], axis=-1)
    out = line_shape(v)[..., :, None] * line_shape(u)[..., None, :]
    return out.reshape(*u.shape, QUADRILATERAL)


def facet_slope(nodes: int, place: FloatArray) -> FloatArray:
    """Evaluate the derivatives of `facet_shape` along the two reference coordinates, shape (..., 2, nodes) [-]."""
    u, v = place[..., 0], place[..., 1]
    if nodes == QUADRATIC_TRIANGLE:
        w, zero = 1 - u - v, np.zeros_like(u)
        along_u = [1 - 4 * w, 4 * u - 1, zero, 4 * (w - u), 4 * v, -4 * v]
        along_v = [1 - 4 * w, zero, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)]
        return np.stack([np.stack(along_u, axis=-1), np.stack(along_v, axis=-1)], axis=-2)
    first = line_shape(v)[..., :, None] * line_slope(u)[..., None, :]
    second = line_slope(v)[..., :, None] * line_shape(u)[..., None, :]
    return np.stack([each.reshape(*u.shape, QUADRILATERAL) for each in (first, second)], axis=-2)


def node_places(nodes: int) -> FloatArray:
    """Return the positions of the nodes on the reference facet with a given number of nodes, shape (nodes, 2) [-]."""
    if nodes != QUADRILATERAL:
        corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]
        return np.array(corners)
    v, u = np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], indexing="ij")
    return np.column_stack([u.ravel(), v.ravel()])


def split_facet(nodes: int, parts: int) -> tuple[FloatArray, FloatArray]:
    """Split the reference facet into equal parts: squares, or triangles of which some are upside down.

    Args:
        nodes: Number of nodes of the facet [-].
        parts: Number of parts along each side [-].

    Returns:
        Middles of the k = parts^2 parts, shape (k, 2) [-], and q quadrature points of each part, shape (k, q, 2) [-].
        The mean over the quadrature points is exact for quadratic functions.
    """
    step = np.arange(parts)
    v, u = np.meshgrid(step, step, indexing="ij")
    if nodes == QUADRILATERAL:
        middle = (2 * np.column_stack([u.ravel(), v.ravel()]) + 1) / parts - 1
        around = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / (np.sqrt(3) * parts)
        return middle, middle[:, None] + around
    upright = np.column_stack([u[u + v < parts], v[u + v < parts]]) + 1 / 3
    inverted = np.column_stack([u[u + v < parts - 1], v[u + v < parts - 1]]) + 2 / 3
    middle = np.concatenate([upright, inverted]) / parts
    # The middles of a triangle's three sides, relative to its centroid, are the quadrature points.
    around = np.array([[1, 1], [-2, 1], [1, -2]]) / (6 * parts)
    sign = np.concatenate([np.ones(len(upright)), -np.ones(len(inverted))])
    return middle, middle[:, None] + sign[:, None, None] * around


def split_triangles(facets: IntArray) -> IntArray:
    """Split facets into flat triangles between their nodes, 8 for a quadrilateral and 4 for a quadratic triangle.

    Args:
        facets: Indices of the nodes of f facets, shape (f, 9) or (f, 6).

    Returns:
        Indices of the corners of the triangles, those of a facet in a row, shape (n, 3).
    """
    parts = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    if facets.shape[1] == QUADRILATERAL:
        parts = np.array([[k, *pair] for k in (0, 1, 3, 4) for pair in ((k + 1, k + 4), (k + 4, k + 3))])
    return np.asarray(facets[:, parts].reshape(-1, 3))


def area_vectors(nodes: FloatArray, facets: IntArray, place: FloatArray) -> FloatArray:
    """Compute the normal vectors of facets; their length is the area per unit of reference area.

    Args:
        nodes: Positions of the nodes, shape (n, 3) [m].
        facets: Indices of the a nodes of each of f facets, shape (f, a).
        place: q points on the reference facet, shape (q, 2).

    Returns:
        Vectors, shape (f, q, 3) [m2].
    """
    along = np.einsum("qda,fac->fqdc", facet_slope(facets.shape[1], place), nodes[facets], optimize=True)
    return np.cross(along[:, :, 0], along[:, :, 1])


def node_normals(nodes: FloatArray, facets: IntArray) -> tuple[IntArray, FloatArray]:
    """Compute unit normals at the nodes of facets, as area-weighted means over the facets of each node.

    At a sharp edge the mean is taken on one side of it, that of the largest facet.

    Args:
        nodes: Positions of the nodes, shape (n, 3) [m].
        facets: Indices of the a nodes of each of f facets, shape (f, a).

    Returns:
        Indices of the m nodes, ascending, shape (m,), and their unit normals, shape (m, 3) [-].
    """
    vectors = area_vectors(nodes, facets, node_places(facets.shape[1])).reshape(-1, 3)
    used, place = np.unique(facets, return_inverse=True)
    place = place.ravel()
    sizes = np.linalg.norm(vectors, axis=1)
    largest = np.empty(len(used), dtype=np.int64)
    order = np.argsort(sizes, kind="stable")
    largest[place[order]] = order
    cosine = np.einsum("kc,kc->k", vectors, vectors[largest[place]])
    vectors = vectors * (cosine >= _SHARP * sizes * sizes[largest[place]])[:, None]
    total = np.stack([np.bincount(place, vectors[:, k], len(used)) for k in range(3)], axis=1)
    return used, total / np.linalg.norm(total, axis=1, keepdims=True)
