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

import numpy as np
import numpy.typing as npt
import skfem

from fem_reference.elements.grading import grade_outward, layer_heights
from fem_reference.elements.line import Line, recover_pressure
from fem_reference.elements.taylor_hood import linear_system, mesh_layers, mixed_elements
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
    """

    radius: FloatArray
    pressure: FloatArray
    reaction: float


def base_response(nodes: FloatArray, forces: FloatArray) -> BaseResponse:
    """Base pressure from the normal reactions of the base nodes.

    Args:
        nodes: Radii of the base nodes, ascending, edge ends and middles in turn, shape (m,) [m].
        forces: Their normal reactions, whole circles, shape (m,) [N].
    """
    line = Line(edges=nodes[::2], order=2)
    radius, pressure = _superconvergent(line, recover_pressure([line], forces, axisymmetric=True))
    return BaseResponse(radius=radius, pressure=pressure, reaction=float(forces.sum()))


def point_load_response(cover: Cover, *, elements_per_thickness: int, reach: float) -> BaseResponse:
    """Solve for a unit point load on the axis.

    Args:
        cover: Layers; linear elastic at zero load.
        elements_per_thickness: Elements through the whole cover; each layer gets at least two [-].
        reach: Radius of the outer boundary, where nothing moves [m].
    """
    unit, stiff = cover.thickness, cover.layers[-1].material.shear_modulus  # solve for numbers near one
    size = cover.thickness / elements_per_thickness
    radii = grade_outward(size, 4 * cover.thickness, reach, growth=1 + 1.2 / elements_per_thickness)
    mesh, region = tensor_mesh(cover, elements_per_thickness, radii)
    elements = mixed_elements(mesh.scaled(1 / unit), region=region, axisymmetric=True)
    shear = np.array([layer.material.shear_modulus for layer in cover.layers]) / stiff
    compliance = np.array([stiff / layer.material.bulk_modulus for layer in cover.layers])
    matrix = linear_system(elements, shear, compliance)
    r, z = elements.nodes.T
    system = ConstrainedSystem(matrix, held(cover, r, z, reach / unit))
    load = np.zeros(matrix.shape[0])
    load[2 * int(np.argmin(np.hypot(r, z - 1))) + 1] = -1.0
    solution = system.solve(load)
    base = np.flatnonzero(np.abs(z) < _TOUCH)
    base = base[np.argsort(r[base])]
    forces = system.reaction(solution, load)[2 * base + 1]
    unitless = base_response(r[base], forces)
    return BaseResponse(
        radius=unitless.radius * unit,
        pressure=unitless.pressure / unit**2,
        reaction=unitless.reaction,
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
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=top)
    return mesh_layers([radii], heights, layer)


def _superconvergent(line: Line, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two points per edge: the roots of the quadratic that is orthogonal to linear functions with weight r."""
    start, length = line.edges[:-1], np.diff(line.edges)
    moment = [start / (j + 1) + length / (j + 2) for j in range(4)]
    determinant = moment[1] ** 2 - moment[0] * moment[2]
    linear = (moment[0] * moment[3] - moment[1] * moment[2]) / determinant
    constant = (moment[2] ** 2 - moment[1] * moment[3]) / determinant
    root = np.sqrt(linear**2 / 4 - constant)
    t = np.stack([-linear / 2 - root, -linear / 2 + root], axis=1)
    radius = (start[:, None] + length[:, None] * t).ravel()
    return radius, line.at(radius) @ values
