"""Solve a flat punch of revolution without slip on a wide cover at small strain, in the r-z plane.

Every point of the cover under the punch moves down by the depth and not sideways, so the problem is linear and one
factorisation solves it.  Elements shrink geometrically towards the edge of the punch, where the stress is singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.elements.grading import grade_around_edge
from fem_reference.elements.taylor_hood import assemble_linear, prepare_elements
from fem_reference.linear_response.axisymmetric import BaseResponse, find_constrained, mesh_cover, recover_base_response
from fem_reference.linear_response.mesh_reach import choose_friction_reach
from fem_reference.small_strain_contact.tension import measure_tension
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover
from meshes.array_types import FloatArray

#: Element size at the edge of the punch over the smaller of its radius and the thickness of the top layer [-].
_EDGE = 1e-4
#: Size ratio of neighbouring elements, minus one, times the number of elements through the cover [-].
_GROWTH = 1.2
#: Distance from a boundary of the mesh, over the cover thickness, below which a node counts as on the boundary [-].
_ON_BOUNDARY = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedDisk:
    """Contact of a flat punch of revolution without slip, per unit depth.

    Attributes:
        force: Normal force on the punch [N/m].
        base: Base pressure over the radius [Pa/m].
        reach: Radius of the outer boundary [m].
        rings: For the circle through each of m nodes under the punch, its radius [m] and the force of the punch on the
            cover along -z and along the radius [N/m], shape (m, 3).
        tension: Tensile part of the contact force away from the edge, over the whole force [-].
    """

    force: float
    base: BaseResponse
    reach: float
    rings: FloatArray
    tension: float


def press_stuck_disk(cover: Cover, radius: float, *, elements_per_thickness: int) -> PressedDisk:
    """Press a flat-ended rigid cylinder without slip into a laterally wide cover by a unit depth.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius of the cylinder [m].
        elements_per_thickness: Number of elements through the cover away from the punch; each layer gets at least
            two [-].
    """
    # Units of length and stress are the cover thickness and the shear modulus of the top layer.
    unit, modulus = cover.thickness, cover.layers[-1].material.shear_modulus
    size = min(unit, radius) / elements_per_thickness
    fine = _EDGE * min(radius, cover.layers[-1].thickness)
    reach = choose_friction_reach(cover, radius)
    radii = grade_around_edge(fine, size, radius, reach, 1 + _GROWTH / elements_per_thickness)
    mesh, region = mesh_cover(cover, elements_per_thickness, radii, surface_size=fine)
    elements = prepare_elements(mesh.scaled(1 / unit), region=region, axisymmetric=True)
    shear = np.array([layer.material.shear_modulus for layer in cover.layers]) / modulus
    compliance = np.array([modulus / layer.material.bulk_modulus for layer in cover.layers])
    matrix = assemble_linear(elements, shear, compliance)
    r, z = elements.nodes.T
    under = np.flatnonzero((z > 1 - _ON_BOUNDARY) & (r < radius / unit * (1 + _ON_BOUNDARY)))
    under = under[np.argsort(r[under])]
    displacement = np.zeros(len(matrix.indptr) - 1)
    displacement[2 * under + 1] = -1.0
    fixed = np.unique(np.concatenate([find_constrained(cover, r, z, reach / unit), 2 * under, 2 * under + 1]))
    system = ConstrainedSystem(fixed).factorise(matrix)
    load = np.zeros_like(displacement)
    reaction = system.reaction(system.solve(load, displacement[fixed]), load) * modulus * unit
    rings = np.column_stack([r[under] * unit, -reaction[2 * under + 1], reaction[2 * under]])
    base = np.flatnonzero(z < _ON_BOUNDARY)
    base = base[np.argsort(r[base])]
    found = recover_base_response(r[base] * unit, reaction[2 * base + 1])
    return PressedDisk(
        force=float(rings[:, 1].sum()),
        base=found,
        reach=reach,
        rings=rings,
        tension=measure_tension(rings[:, 1], radius - rings[:, 0], min(radius, unit)),
    )
