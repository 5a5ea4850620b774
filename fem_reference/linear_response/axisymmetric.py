"""Solve a layered cover with axisymmetric finite elements: mesh, constraints, base pressure, and unit point load.

The base pressure is computed from the reactions of the fixed base nodes.  The sum of the reactions equals the load
except for rounding; the inverse mass matrix of the base edges turns the reactions into a pressure that is quadratic on
each element edge.  The error of this pressure oscillates and is orthogonal to linear functions.  The pressure is
therefore evaluated at the two points of each edge where the oscillation vanishes; in tests the error of the peak was
five to ten times smaller at these points than at the nodes.

The point load is a single nodal force.  The displacement under the force is singular, but the base pressure is
accurate: by Galerkin orthogonality the error of a functional of the base pressure is the error of the dual solution at
the loaded point, and the dual solution is smooth at this point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from scipy.interpolate import CubicSpline

from fem_reference.elements.grading import grade_outward, layer_heights
from fem_reference.elements.line import Line, recover_pressure
from fem_reference.elements.taylor_hood import assemble_linear, mesh_layers, prepare_elements
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover
from meshes.array_types import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class AxisymmetricSettings:
    """Numbers of the meshes in the r-z plane."""

    #: Radius, over the cover thickness, within which the mesh of a point load has elements of equal size [-].
    even: float = 4.0
    #: Size ratio of neighbouring elements outside this radius, minus one, times the number of elements through the
    #: cover [-].
    growth: float = 1.2
    #: Smallest number of elements through a layer [-].
    least: int = 2


_SETTINGS = AxisymmetricSettings()


#: Distance from a boundary of the mesh, over the cover thickness, below which a node counts as on the boundary [-].
_TOLERANCE = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class BaseResponse:
    """Base pressure of an axisymmetric load, per unit load or for the whole load.

    Attributes:
        radius: Distances of m points from the axis, ascending, shape (m,) [m].
        pressure: Base pressure at these points, shape (m,), per unit load [1/m2] or for the whole load [Pa].
        reaction: Sum of the base reactions, per unit load [-] or for the whole load [N].
    """

    radius: FloatArray
    pressure: FloatArray
    reaction: float

    def pack(self, key: str, reach: float) -> dict[str, Any]:
        """Extend the base pressure to the axis by symmetry, and to zero at the outer boundary, radius `reach` [m].

        Returns:
            `radius_KEY` and `pressure_KEY`, shape (m + 2,) each, and `reaction_KEY`, for the result store.
        """
        r, p = self.radius, self.pressure
        around_axis = CubicSpline(np.r_[-r[3::-1], r[:4]], np.r_[p[3::-1], p[:4]])
        return {
            f"radius_{key}": np.r_[0.0, r, reach],
            f"pressure_{key}": np.r_[around_axis(0.0), p, 0.0],
            f"reaction_{key}": self.reaction,
        }


def recover_base_response(nodes: FloatArray, forces: FloatArray) -> BaseResponse:
    """Compute the axisymmetric base pressure from the normal reactions of the base nodes.

    Args:
        nodes: Radii of the m base nodes, ascending; ends and middles of element edges alternate, shape (m,) [m].
        forces: Normal reactions of the nodes, each of a whole circle, shape (m,) [N].
    """
    line = Line(edges=nodes[::2], order=2)
    pressure = recover_pressure([line], forces, axisymmetric=True)
    radius = _find_accurate_radii(line)
    return BaseResponse(radius=radius, pressure=line.at(radius) @ pressure, reaction=float(forces.sum()))


def solve_point_load(cover: Cover, *, elements_per_thickness: int, reach: float) -> BaseResponse:
    """Solve for the base pressure under a unit point load on the axis.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        elements_per_thickness: Number of elements through the whole cover; each layer gets at least two [-].
        reach: Radius of the outer boundary, where all displacements are zero [m].
    """
    # Units of length and stress are the cover thickness and the shear modulus of the top layer: numbers near 1 make
    # the matrix well conditioned.
    unit, modulus = cover.thickness, cover.layers[-1].material.shear_modulus
    size = unit / elements_per_thickness
    radii = grade_outward(size, _SETTINGS.even * unit, reach, growth=1 + _SETTINGS.growth / elements_per_thickness)
    mesh, region = mesh_cover(cover, elements_per_thickness, radii)
    elements = prepare_elements(mesh.scaled(1 / unit), region=region, axisymmetric=True)
    shear = np.array([layer.material.shear_modulus for layer in cover.layers]) / modulus
    compliance = np.array([modulus / layer.material.bulk_modulus for layer in cover.layers])
    matrix = assemble_linear(elements, shear, compliance)
    r, z = elements.nodes.T
    system = ConstrainedSystem(find_constrained(cover, r, z, reach / unit)).factorise(matrix)
    load = np.zeros(matrix.shape[0])
    load[2 * int(np.argmin(np.hypot(r, z - 1))) + 1] = -1.0
    solution = system.solve(load)
    base = np.flatnonzero(np.abs(z) < _TOLERANCE)
    base = base[np.argsort(r[base])]
    found = recover_base_response(r[base], system.reaction(solution, load)[2 * base + 1])
    return BaseResponse(radius=found.radius * unit, pressure=found.pressure / unit**2, reaction=found.reaction)


def find_constrained(cover: Cover, r: FloatArray, z: FloatArray, reach: float) -> IntArray:
    """Return the indices of the displacements that are zero: on the axis, on the base and on the outer boundary.

    The displacement of a cover that slides on its base decays only with the inverse of the distance, parallel to the
    base and without pressure on it.  The outer boundary of such a cover is free; fixed, it would press on the base.

    Args:
        cover: Cover; a bonded base constrains both displacements, a sliding base only the normal displacement.
        r: Radii of the n nodes, shape (n,) [thicknesses].
        z: Heights of the n nodes, shape (n,) [thicknesses].
        reach: Radius of the outer boundary [thicknesses].
    """
    axis, base = r < _TOLERANCE, z < _TOLERANCE
    bonded = cover.base == "bonded"
    outer = (r > reach - _TOLERANCE) & bonded
    radial = axis | outer | (base & bonded)
    return np.concatenate([2 * np.flatnonzero(radial), 2 * np.flatnonzero(base | outer) + 1])


def mesh_cover(
    cover: Cover, count: int, radii: FloatArray, *, surface_size: float | None = None
) -> tuple[skfem.MeshQuad, IntArray]:
    """Mesh a cover with quadrilaterals in the r-z plane.

    Args:
        cover: Cover with its layers.
        count: Number of elements through the whole cover; each layer gets at least two [-].
        radii: Element edges along the radius [m].
        surface_size: Height of the elements at the top [m]; used if it is smaller than the regular element height.

    Returns:
        The mesh, and the index of the layer of each element.
    """
    size = cover.thickness / count
    counts = [max(_SETTINGS.least, round(layer.thickness / size)) for layer in cover.layers]
    heights, layer = layer_heights([each.thickness for each in cover.layers], counts, surface_size=surface_size)
    return mesh_layers([radii], heights, layer)


def _find_accurate_radii(line: Line) -> FloatArray:
    """Compute the two radii on each element edge where the error of the recovered base pressure vanishes [m].

    These radii are the roots of the quadratic polynomial that is orthogonal to all linear functions with weight r.
    """
    start, length = line.edges[:-1], np.diff(line.edges)
    moment = [start / (j + 1) + length / (j + 2) for j in range(4)]
    determinant = moment[1] ** 2 - moment[0] * moment[2]
    linear = (moment[0] * moment[3] - moment[1] * moment[2]) / determinant
    constant = (moment[2] ** 2 - moment[1] * moment[3]) / determinant
    root = np.sqrt(linear**2 / 4 - constant)
    t = np.stack([-linear / 2 - root, -linear / 2 + root], axis=1)
    return np.asarray((start[:, None] + length[:, None] * t).ravel())
