"""Derive the fast model of a curved cover from the reference: compliance of its surface and forces on its texels."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fastmodel.surface import CoverPoints
from fem_reference import result_store
from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.responses import build_solid, find_top
from fem_reference.linear_response.surface_compliance import surface_compliance
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.layer import Layers, scale_layers
from meshes.solids.facets import QUADRILATERAL, facet_shape, split_facet, split_triangles
from meshes.solids.solid_mesh import SolidMesh, measure_height
from meshes.solids.texels import tangent_axes


@dataclass(frozen=True, kw_only=True)
class LatticeSettings:
    """Constants of the loads between which the compliance of a curved cover is tabulated."""

    #: Largest number of loads; one solution of the cover is needed for each [-].
    most: int = 2500
    #: Smallest distance between the centres of two loads, over the size of the elements [-].
    apart: float = 1.3
    #: Radius of a load, over the size of the elements [-].  Elements are too soft under narrower loads.
    radius: float = 2.5
    #: Parts of a facet along each side in integrals of loads, and in those of the flat layer [-].
    parts: tuple[int, int] = (4, 2)
    #: Loads among which a force on a point is distributed [-].
    shared: int = 24
    #: Length over which the shares of the loads decrease, over the size of the elements [-].
    decrease: float = 2.2
    #: Regularisation of the equations for the moments of order 0 to 3, over the largest entry [-].  Near a border of
    #: the top the higher moments cannot be met.
    regular: tuple[float, ...] = (1e-9, 1e-5, 1e-3, 1e-2)
    #: Loads or quadrature points that are treated at once, to limit the memory [-].
    block: int = 64
    #: Distance over the thickness to which the compliance of the flat layer is tabulated, and points of the table per
    #: thickness of the top layer [-].
    table: tuple[int, int] = (10, 20)
    #: Smallest local thickness of the layer over that of most of the cover, which tapers off where its top is bonded
    #: [-].
    thinnest: float = 0.5
    #: Integral of the reciprocal distance less its sum over all other points of a lattice, over the root of the area of
    #: a point: for squares and for equal-sided triangles (numerically; for squares -4 zeta(1/2) beta(1/2)) [-].
    omitted: tuple[float, float] = (3.9003, 3.787)


_SETTINGS = LatticeSettings()

#: Reason why a solid cover has no fast model of contact, for messages.
TOO_FINE = "the meshes of this cover are too fine for the fast model"


def choose_mesh(meshes: tuple[SolidMesh, ...]) -> SolidMesh | None:
    """Choose the mesh for the fast model: the second of three, or a coarser one; None if all need too many loads.

    Args:
        meshes: Meshes of the cover, coarsest first.
    """
    candidates = reversed(meshes[: 1 + len(meshes) // 2])
    return next((mesh for mesh in candidates if len(place_loads(mesh)[0]) <= _SETTINGS.most), None)


def place_loads(mesh: SolidMesh) -> tuple[IntArray, FloatArray]:
    """Choose nodes of the top as centres of loads.

    Returns:
        Indices of the m centres in the nodes of the top, shape (m,), and size of the elements at each node of the top,
        shape (nodes,) [m].
    """
    top = find_top(mesh)
    count = top.facets.shape[1]
    areas = np.linalg.norm(top.split(1)[1], axis=2).sum(axis=1)
    used = np.bincount(top.facets.ravel(), minlength=len(top.nodes))
    sizes = np.sqrt(np.bincount(top.facets.ravel(), np.repeat(areas, count), len(top.nodes)) / used)
    near = cKDTree(top.nodes).query_ball_point(top.nodes, _SETTINGS.apart * sizes)
    free = np.ones(len(top.nodes), dtype=bool)
    centres = []
    # Loads at the border first, so that little force is distributed beyond the loads.
    edges = np.sort(split_triangles(top.facets)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, uses = np.unique(edges, axis=0, return_counts=True)
    border = np.unique(pairs[uses == 1])
    for node in (*border, *np.setdiff1d(np.arange(len(top.nodes)), border)):
        if free[node]:
            centres.append(node)
            free[near[node]] = False
    return np.array(centres), sizes


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceLoads:
    """Loads of unit resultant on the top of a mesh, at g quadrature points.

    Attributes:
        points: Positions of the points, shape (g, 3) [m].
        weights: Part of each of m loads at each point, shape (m, g) [-].
        nodal: Forces of each load on the n nodes of the top along x, y and z, three matrices of shape (m, n) [-].
        omitted: Mean of the reciprocal distance over the area of each point with which a sum over points becomes an
            integral, shape (g,) [1/m].
    """

    points: FloatArray
    weights: sp.csr_matrix
    nodal: tuple[sp.csr_matrix, ...]
    omitted: FloatArray

    @classmethod
    def on(cls, top: FacetSurface, centres: IntArray, sizes: FloatArray, parts: int) -> SurfaceLoads:
        """Distribute each load around its centre over the facets, each split into equal parts along its sides."""
        count = top.facets.shape[1]
        middles, vectors, _ = top.split(parts)
        points, vectors = middles.reshape(-1, 3), vectors.reshape(-1, 3)
        areas = np.linalg.norm(vectors, axis=1)
        shape = np.tile(facet_shape(count, split_facet(count, parts)[0]), (len(top.facets), 1))
        rows = np.repeat(np.arange(len(points)), count)
        columns = np.repeat(top.facets, len(shape) // len(top.facets), axis=0).ravel()
        onto = sp.csr_matrix((shape.ravel(), (rows, columns)), shape=(len(points), len(top.nodes)))
        radii = _SETTINGS.radius * sizes[centres]
        near = cKDTree(points).query_ball_point(top.nodes[centres], radii)
        load = np.repeat(np.arange(len(centres)), [len(each) for each in near])
        point = np.concatenate(near).astype(np.int64)
        away = np.linalg.norm(points[point] - top.nodes[centres[load]], axis=1) / radii[load]
        facing = (vectors[point] * top.normals[centres[load]]).sum(axis=1) > 0
        value = (1 - away**2) ** 2 * areas[point] * facing
        value /= np.bincount(load, value)[load]
        weights = sp.csr_matrix((value, (load, point)), shape=(len(centres), len(points)))
        inward = -vectors / areas[:, None]
        nodal = tuple(sp.csr_matrix(weights @ onto.multiply(inward[:, [axis]])) for axis in range(3))
        omitted = _SETTINGS.omitted[int(count != QUADRILATERAL)] * np.sqrt(areas)
        return cls(points=points, weights=weights, nodal=nodal, omitted=omitted / areas)


def derive_points(mesh: SolidMesh, texels: TexelArray, layers: Layers) -> CoverPoints:
    """Compute the arrays of the fast model on the top of one mesh, or read them from the store.

    The compliance of the solid less that of a flat layer is smooth.  It is tabulated between loads that the elements
    resolve (see `CoverPoints`), each with the pressure (1 - (d / r)^2)^2 at the distance d from its centre.  The cost
    is one solution per load and per texel.

    Args:
        mesh: Mesh of the cover.
        texels: Texels on the base of the mesh.
        layers: Material of the cover, or its layers; hyperelastic materials are linearised at zero load.

    Raises:
        ValueError: If the mesh cannot be used or a texel is not on its base.
    """
    responses = texel_responses([mesh], texels, layers)
    top, base = responses.finest.top, FacetSurface.part_of(mesh.nodes, mesh.base)
    thickness = measure_height(mesh)
    heights = np.maximum(base.locate(top.nodes)[1], _SETTINGS.thinnest * thickness)
    centres, sizes = place_loads(mesh)
    flat_layers = scale_layers(layers, thickness)
    reach, points = _SETTINGS.table
    layer = surface_compliance(Cover(layers=flat_layers), reach * thickness)
    count = int(np.ceil(reach * points * thickness / flat_layers[-1].thickness))
    radii: FloatArray = np.linspace(0, reach * thickness, count + 1)
    table = np.asarray(layer.regular(np.minimum(radii, layer.reach)))
    loads = SurfaceLoads.on(top, centres, sizes, _SETTINGS.parts[0])

    def compute() -> dict[str, FloatArray]:
        solid, found = build_solid(mesh, layers), np.empty((len(centres), len(centres)))
        for start in range(0, len(centres), _SETTINGS.block):
            part = slice(start, min(start + _SETTINGS.block, len(centres)))
            forces = np.zeros((part.stop - start, len(solid.nodes), 3))
            forces[:, top.index] = np.stack([each[part].toarray() for each in loads.nodal], axis=-1)
            moved = solid.solve(top.index, forces=forces)
            found[part] = np.sum([(each @ moved[..., axis].T).T for axis, each in enumerate(loads.nodal)], axis=0)
        flat = SurfaceLoads.on(top, centres, sizes, _SETTINGS.parts[1])
        scale = np.maximum(base.locate(flat.points)[1] / thickness, _SETTINGS.thinnest)
        return {"remainder": (found + found.T) / 2 - _load_layer(flat, scale, radii, table, layer.half_space)}

    inputs = {"mesh": mesh.digest, "material": layers, "code": result_store.hash_file(__file__)}
    shared, shares = _share_forces(top, centres, sizes, loads)
    return CoverPoints(
        points=top.nodes,
        normals=top.normals,
        facets=top.facets,
        centres=top.nodes[centres],
        shared=shared,
        shares=shares,
        influence=responses.finest.normal_influence * texels.active[:, None],
        remainder=result_store.fetch("curved-remainder", inputs, compute)["remainder"],
        layer=table,
        layer_step=float(radii[1]),
        top_compliance=layer.half_space,
        heights=heights,
        thickness=thickness,
    )


def _load_layer(
    loads: SurfaceLoads, scale: FloatArray, radii: FloatArray, table: FloatArray, half_space: float
) -> FloatArray:
    """Compute the compliance of a flat layer between m loads, at straight distances of their points, (m, m) [m/N].

    Args:
        loads: The loads, at g points.
        scale: Thickness of the layer at each point over that of the table, shape (g,) [-].  Between two points it is
            the mean of both.
        radii: Distances of the table [m].
        table: Compliance of the layer less that of a half space at these distances [m/N].
        half_space: Displacement times distance per unit force on a half space [m2/N].
    """
    points, weights = loads.points, loads.weights
    out = np.zeros((weights.shape[0], len(points)))
    for start in range(0, len(points), _SETTINGS.block):
        part = np.arange(start, min(start + _SETTINGS.block, len(points)))
        away = np.linalg.norm(points[:, None] - points[None, part], axis=2)
        mean = (scale[:, None] + scale[None, part]) / 2
        moved = np.interp(away / mean, radii, table) / mean + half_space / np.maximum(away, np.finfo(float).tiny)
        moved[away > mean * radii[-1]] = 0.0
        moved[part, part - start] = table[0] / scale[part] + half_space * loads.omitted[part]
        out[:, part] = weights @ moved
    found = weights @ out.T
    return np.asarray(found + found.T) / 2


def _share_forces(
    top: FacetSurface, centres: IntArray, sizes: FloatArray, loads: SurfaceLoads
) -> tuple[IntArray, FloatArray]:
    """Distribute unit forces on the n nodes of the top among the loads with equal moments up to the third order.

    The moments are those in the plane tangent to the top at the node.  Among all such shares, the sum of squares,
    weighted by distance, is the smallest.

    Returns:
        Indices of q loads for each node, and their shares, shape (n, q) each [-].
    """
    count = min(_SETTINGS.shared, len(centres))
    shared = np.asarray(cKDTree(top.nodes[centres]).query(top.nodes, count)[1]).reshape(len(top.nodes), -1)
    # All moments up to the third of a load are the entries of the mean of y x y x y, where y is (1, place).
    place = np.column_stack([np.ones(len(loads.points)), loads.points])
    moments = loads.weights @ np.einsum("ga,gb,gc->gabc", place, place, place).reshape(len(place), -1)
    moments = moments.reshape(-1, 4, 4, 4)[shared]
    frame = np.zeros((len(top.nodes), 3, 4))
    frame[:, 0, 0] = 1.0
    frame[:, 1:, 1:] = tangent_axes(top.normals) / sizes[:, None, None]
    frame[:, 1:, 0] = -np.einsum("nij,nj->ni", frame[:, 1:, 1:], top.nodes)
    moments = np.einsum("nia,njb,nkc,nqabc->nqijk", frame, frame, frame, moments, optimize=True)
    rows = [moments[(slice(None), slice(None), *each)] for each in combinations_with_replacement(range(3), 3)]
    equations = np.stack(rows, axis=1)
    away = np.linalg.norm(top.nodes[centres[shared]] - top.nodes[:, None], axis=2) / sizes[:, None]
    facing = (top.normals[centres[shared]] * top.normals[:, None]).sum(axis=2) > 0
    weight = np.where(facing, np.exp(-((away / _SETTINGS.decrease) ** 2)), 0.0)
    weighted = equations * weight[:, None]
    system = weighted @ equations.transpose(0, 2, 1)
    order = [sum(index > 0 for index in each) for each in combinations_with_replacement(range(3), 3)]
    scale = np.abs(system).max(axis=(1, 2))[:, None, None]
    system += scale * np.diag(np.array(_SETTINGS.regular)[order])
    target = np.zeros((len(top.nodes), len(rows), 1))
    target[:, 0] = 1.0
    shares = np.einsum("nkq,nk->nq", weighted, np.linalg.solve(system, target)[..., 0])
    return shared, shares / shares.sum(axis=1, keepdims=True)
