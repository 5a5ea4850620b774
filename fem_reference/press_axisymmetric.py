"""Finite-strain pressing of shapes with an axis, in the plane of radius and height."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.axisymmetric import BaseResponse, base_response, graded, held, tensor_mesh, toward_edge
from fem_reference.elements import MixedElements, Pattern, mixed_elements
from fem_reference.equilibrium import Equilibrium, Problem
from fem_reference.finite_strain import Solid
from fem_reference.materials import bulk_compliance, finite_strain_energy
from fem_reference.obstacle import Obstacle
from fem_reference.surface_contact import SurfaceContact
from fem_reference.transfer import Coarse
from meshes import Cover, Indenter
from meshes.indenter import Flat

FloatArray = npt.NDArray[np.float64]

#: Pressure per overlap, in shear moduli per element size.  It must outweigh what the contact pressure itself takes from
#: the stiffness of an element; below about 30 surfaces under high pressure wrinkle.
PENALTY = 150.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedState:
    """One converged target of a loading path.

    Attributes:
        depth: Approach from first touch [m].
        load: Force [N].
        area: Reference area that touches [m2].
        overlap: Largest distance that the penalty left between surfaces [m].
        base: Base pressure, for the whole load.
        top: Radius and height of the deformed top, shape (m, 2) [m].
    """

    depth: float
    load: float
    area: float
    overlap: float
    base: BaseResponse
    top: FloatArray


def press_axisymmetric(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    *,
    control: str,
    elements_per_thickness: int,
    contact_radius: float,
    fillet: float,
    reach: float,
    coarse: Coarse | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[PressedState], Coarse]:
    """Follow one loading path; return the state at every target, and the path for a finer mesh to start from.

    Args:
        cover: Layers; a small-strain material counts as neo-Hookean with the same moduli.
        indenter: An axisymmetric shape.
        targets: Loads [N] or depths [m], ascending.
        control: "load" or "depth".
        elements_per_thickness: Elements through the cover [-].
        contact_radius: Estimated radius of the largest contact; the mesh is fine up to it [m].
        fillet: Radius of the rounding of sharp edges [m].
        reach: Radius of the outer boundary [m].
        coarse: The same path on a coarser mesh, to start from.
        progress: Called with a line of text after each step.

    Raises:
        PathError: If the path stops early.
    """
    size = min(cover.thickness / elements_per_thickness, contact_radius / elements_per_thickness)
    growth = 1 + 1.2 / elements_per_thickness
    if isinstance(indenter, Flat):
        radii = toward_edge(fillet * 6 / elements_per_thickness, size, contact_radius, reach, growth)
    else:
        radii = graded(size, 1.25 * contact_radius, reach, growth)
    mesh, region = tensor_mesh(cover, elements_per_thickness, radii)
    elements = mixed_elements(mesh, region=region, axisymmetric=True)
    r, z = elements.nodes.T
    solid = Solid(
        elements=elements,
        energies=[finite_strain_energy(layer.material) for layer in cover.layers],
        bulk_compliance=np.array([bulk_compliance(layer.material) for layer in cover.layers]),
        pattern=Pattern(elements),
    )
    penalty = PENALTY * cover.layers[-1].material.shear_modulus / size
    contact = SurfaceContact(elements, cover.thickness, Obstacle(indenter=indenter, fillet=fillet), penalty=penalty)
    problem = Problem(solid=solid, contact=contact, fixed=held(cover, r, z, reach))
    guesses = () if coarse is None else coarse.guesses(elements)
    path = problem.follow(targets, control=control, first=0.02 * cover.thickness, guesses=guesses, progress=progress)
    return [_state(elements, cover, reached) for reached in path], Coarse(elements=elements, path=path)


def _state(elements: MixedElements, cover: Cover, reached: Equilibrium) -> PressedState:
    r, z = elements.nodes.T
    tolerance = 1e-9 * cover.thickness
    base, top = np.flatnonzero(z < tolerance), np.flatnonzero(z > cover.thickness - tolerance)
    base, top = base[np.argsort(r[base])], top[np.argsort(r[top])]
    moved = elements.nodes + reached.state[: elements.displacements].reshape(-1, 2)
    return PressedState(
        depth=reached.depth,
        load=reached.load,
        area=reached.touch.area,
        overlap=reached.touch.overlap,
        base=base_response(r[base], reached.reaction[2 * base + 1], len(reached.state)),
        top=moved[top],
    )
