"""Linear axisymmetric solution of a planar layered cover under a unit point load on its top.

The base pressure is recovered from the reactions of the clamped base nodes: the reactions are consistent with the
elements, add up to the load to rounding, and divided by the mass of the base edges they give a quadratic pressure on
each edge.  Its error is an oscillation that is orthogonal to linear functions, so the pressure is read at the two
points of each edge where that oscillation vanishes; measured, the peak is five to ten times closer there than at the
nodes.  The load is a single nodal force.  That is sound for what is asked here: by Galerkin orthogonality the error
of a base functional is the error of its smooth dual solution at the loaded point, so the singularity under the load
does not reach the base.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import scipy.sparse.linalg as spla
import skfem

from fem_reference.elements.taylor_hood import linear_system, mixed_elements
from fem_reference.materials import bulk_compliance
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover

FloatArray = npt.NDArray[np.float64]

#: A node this close to a boundary lies on it, in thicknesses [-].
_TOUCH = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseResponse:
    """Base pressure per unit load.

    Attributes:
        radius: Distances from the load, ascending, shape (m,) [m].
        pressure: Pressure per force there, shape (m,) [1/m2].
        reaction: Sum of the base reactions per unit load [-].
        unknowns: Unknowns of the solve [-].
    """

    radius: FloatArray
    pressure: FloatArray
    reaction: float
    unknowns: int


def base_response(nodes: FloatArray, forces: FloatArray, unknowns: int) -> BaseResponse:
    """Base pressure from the normal reactions of the base nodes.

    Args:
        nodes: Radii of the base nodes, ascending, edge ends and middles in turn, shape (m,) [m].
        forces: Their normal reactions, whole circles, shape (m,) [N].
        unknowns: Unknowns of the solve, for the record [-].
    """
    radius, pressure = _superconvergent(nodes, spla.spsolve(_edge_mass(nodes), forces))
    return BaseResponse(radius=radius, pressure=pressure, reaction=float(forces.sum()), unknowns=unknowns)


def point_load_response(cover: Cover, *, elements_per_thickness: int, reach: float) -> BaseResponse:
    """Solve for a unit point load on the axis.

    Args:
        cover: Layers; linear elastic at zero load.
        elements_per_thickness: Elements through the whole cover; each layer gets at least two [-].
        reach: Radius of the outer boundary, where nothing moves [m].
    """
    unit, stiff = cover.thickness, cover.layers[-1].material.shear_modulus  # solve for numbers near one
    size = cover.thickness / elements_per_thickness
    radii = graded(size, 4 * cover.thickness, reach, growth=1 + 1.2 / elements_per_thickness)
    mesh, region = tensor_mesh(cover, elements_per_thickness, radii)
    elements = mixed_elements(mesh.scaled(1 / unit), region=region, axisymmetric=True)
    shear = np.array([layer.material.shear_modulus for layer in cover.layers]) / stiff
    volume = np.array([bulk_compliance(layer.material) for layer in cover.layers]) * stiff
    matrix = linear_system(elements, shear, volume)
    r, z = elements.nodes.T
    system = ConstrainedSystem(matrix, held(cover, r, z, reach / unit))
    load = np.zeros(matrix.shape[0])
    load[2 * int(np.argmin(np.hypot(r, z - 1))) + 1] = -1.0
    solution = system.solve(load)
    base = np.flatnonzero(np.abs(z) < _TOUCH)
    base = base[np.argsort(r[base])]
    forces = system.reaction(solution, load)[2 * base + 1]
    unitless = base_response(r[base], forces, matrix.shape[0])
    return BaseResponse(
        radius=unitless.radius * unit,
        pressure=unitless.pressure / unit**2,
        reaction=unitless.reaction,
        unknowns=unitless.unknowns,
    )


def held(cover: Cover, r: FloatArray, z: FloatArray, reach: float) -> npt.NDArray[np.int64]:
    """Held unknowns: the axis and the outer boundary across, the base along the normal and, if bonded, across."""
    axis, base, outer = r < _TOUCH, z < _TOUCH, r > reach - _TOUCH
    across = axis | outer | (base if cover.base == "bonded" else np.zeros_like(base))
    return np.concatenate([2 * np.flatnonzero(across), 2 * np.flatnonzero(base | outer) + 1])


def tensor_mesh(
    cover: Cover, count: int, radii: FloatArray, *, top: float | None = None
) -> tuple[skfem.MeshQuad, npt.NDArray[np.int64]]:
    """Tensor mesh over the given radii [m], and the layer of each element; heights as in `layer_heights`."""
    size = cover.thickness / count
    counts = [max(2, round(layer.thickness / size)) for layer in cover.layers]
    heights, region = layer_heights(cover, counts, top=top)
    mesh = skfem.MeshQuad.init_tensor(radii, heights)
    row = np.searchsorted(heights, mesh.p[1][mesh.t].mean(axis=0)) - 1
    return mesh, region[row]


def layer_heights(
    cover: Cover, counts: list[int], *, top: float | None = None
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Node heights that cut each layer evenly into its number of elements, from 0 up [m], and each element's layer.

    Where `top` is given and smaller, the elements of the uppermost layer shrink to it towards the surface [m].
    """
    steps = [np.full(n, layer.thickness / n) for layer, n in zip(cover.layers, counts, strict=True)]
    if top is not None and top < steps[-1][0]:
        steps[-1] = _shrinking(top, steps[-1][0], cover.layers[-1].thickness)
    heights = np.concatenate([[0.0], np.cumsum(np.concatenate(steps))])
    heights[-1] = cover.thickness
    return heights, np.repeat(np.arange(len(steps)), [len(each) for each in steps])


def _shrinking(fine: float, coarse: float, total: float) -> FloatArray:
    """Steps that shrink from `coarse` to `fine` and fill `total` [m]."""
    steps = [fine]
    while sum(steps) < total:
        steps.append(min(1.4 * steps[-1], coarse))
    return np.array(steps[::-1]) * total / sum(steps)


def graded(size: float, even: float, reach: float, growth: float) -> FloatArray:
    """Even steps of `size` up to `even`, then steps that grow, scaled to end at `reach` [m]."""
    start = np.linspace(0, even, round(even / size) + 1)
    n = int(np.ceil(np.log1p((reach - even) * (growth - 1) / size) / np.log(growth)))
    steps = growth ** np.arange(1, n + 1)
    return np.concatenate([start, even + (reach - even) * np.cumsum(steps) / steps.sum()])


def toward_edge(fine: float, coarse: float, edge: float, reach: float, growth: float) -> FloatArray:
    """Nodes from 0 to `reach` whose steps shrink to `fine` on both sides of `edge` [m]."""
    inner, step = [edge], fine
    while inner[-1] - step > 0.5 * step:
        inner.append(inner[-1] - step)
        step = min(step * growth**2, coarse)
    outer, step = [edge], fine
    while outer[-1] < reach:
        outer.append(outer[-1] + step)
        step *= growth**2 if step < coarse else growth
    outer[-1] = reach
    return np.array([0.0, *inner[:0:-1], *outer])


def edge_shape(t: FloatArray) -> FloatArray:
    """Quadratic shape functions on 0..1, shape (3, ...)."""
    return np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])


def _superconvergent(nodes: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two points per edge: the roots of the quadratic that is orthogonal to linear functions with weight r."""
    start, length = nodes[:-2:2], nodes[2::2] - nodes[:-2:2]
    moment = [start / (j + 1) + length / (j + 2) for j in range(4)]
    determinant = moment[1] ** 2 - moment[0] * moment[2]
    linear = (moment[0] * moment[3] - moment[1] * moment[2]) / determinant
    constant = (moment[2] ** 2 - moment[1] * moment[3]) / determinant
    root = np.sqrt(linear**2 / 4 - constant)
    t = np.stack([-linear / 2 - root, -linear / 2 + root], axis=1)
    corners = np.stack([values[:-2:2], values[1::2], values[2::2]])
    radius = start[:, None] + length[:, None] * t
    return radius.ravel(), np.einsum("aeq,ae->eq", edge_shape(t), corners).ravel()


def _edge_mass(nodes: FloatArray) -> sp.csc_matrix:
    """Mass matrix of quadratic edges along the base with weight 2 pi r [m2]."""
    points, weights = np.polynomial.legendre.leggauss(4)
    t = (points + 1) / 2
    shape = edge_shape(t)
    edges = np.array(list(pairwise(nodes[::2])))
    length = edges[:, 1] - edges[:, 0]
    radius = edges[:, :1] + length[:, None] * t
    block = np.einsum("aq,bq,eq,q->eab", shape, shape, 2 * np.pi * radius * length[:, None], weights / 2)
    index = 2 * np.arange(len(edges))[:, None] + np.arange(3)
    i = np.repeat(index, 3, axis=1).ravel()
    j = np.tile(index, (1, 3)).ravel()
    return sp.coo_matrix((block.ravel(), (i, j)), shape=(len(nodes), len(nodes))).tocsc()
