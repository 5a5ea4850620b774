"""Loading path of an indenter of revolution on a laterally wide cover, solved axisymmetrically in the r-z plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fem_reference.elements.grading import grade_around_edge, grade_outward
from fem_reference.elements.taylor_hood import MixedElements, prepare_elements
from fem_reference.finite_strain.contact import SurfaceContact
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from fem_reference.finite_strain.mesh_transfer import SolvedPath
from fem_reference.linear_response.axisymmetric import BaseResponse, find_constrained, mesh_cover, recover_base_response
from meshes import FlatPunch
from meshes.array_types import FloatArray

#: Contact penalty: pressure per penetration, in shear moduli per element size.  It must be much larger than the
#: stiffness that the contact pressure takes from an element; below about 30, surfaces under high pressure wrinkle [-].
PENALTY = 300.0
#: Depth of the first step over the thickness, small enough for a linear response [-].
FIRST_DEPTH = 0.02
#: Element size over the radius of a rounded edge [-].
_EDGE_ELEMENT = 0.46
#: Radius of the region of small elements over the radius of the contact under a curved shape [-].
_FINE_REGION = 1.25
#: Growth of neighbouring elements away from the contact, minus one, times the elements through the cover [-].
_GROWTH = 1.2
#: Distance from a boundary below which a node lies on it, in thicknesses [-].
_ON_BOUNDARY = 1e-9
#: Gap over depth above which a node is open: in the last element in contact the surface waves by less than that [-].
_OPEN = 1e-2
#: Number of open nodes from which the edge of the contact is extrapolated, and number of nodes in contact, from the
#: last one inwards, between which and the first open node it must lie.
_OPEN_NODES, _CLOSED_NODES = 4, 3


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedState:
    """The solution at one target of an axisymmetric path.

    Attributes:
        depth: Approach from first touch [m].
        load: Force [N].
        area: Contact area in the deformed state [m2].
        overlap: Mean penetration that the penalty leaves [m].
        base: Base pressure under the whole load.
    """

    depth: float
    load: float
    area: float
    overlap: float
    base: BaseResponse


def press_axisymmetric(
    path: LoadingPath,
    *,
    elements_per_thickness: int,
    contact_radius: float,
    fillet: float,
    reach: float,
    coarse: SolvedPath | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[PressedState], SolvedPath]:
    """Follow one loading path.

    Args:
        path: Cover, indenter, targets and friction.
        elements_per_thickness: Elements through the cover [-].
        contact_radius: Estimated radius of the largest contact; up to it elements are small [m].
        fillet: Radius of rounded edges [m].
        reach: Radius of the outer boundary, where nothing moves [m].
        coarse: The same path solved on a coarser mesh, to start from.  Not used with friction, where slip depends on
            the loading history.
        progress: Called with a line of text after each step.

    Returns:
        The state at every target, and the solved path for a finer mesh to start from.

    Raises:
        PathConvergenceError: If the path stops before its last target.
    """
    units = path.units
    thin = units.scale_cover(path.cover)
    fillet, radius, reach = (value / units.length for value in (fillet, contact_radius, reach))
    # Mesh: small elements at a sharp edge, or in the whole contact of a curved shape.
    size = min(1.0, radius) / elements_per_thickness
    growth = 1 + _GROWTH / elements_per_thickness
    top = size
    if isinstance(path.indenter, FlatPunch):
        top = _EDGE_ELEMENT * fillet
        radii = grade_around_edge(top, size, radius, reach, growth)
    else:
        radii = grade_outward(size, _FINE_REGION * radius, reach, growth)
    mesh, region = mesh_cover(thin, elements_per_thickness, radii, surface_size=top)
    elements = prepare_elements(mesh, region=region, axisymmetric=True)
    # Problem, in units of thickness and shear modulus.
    surface = IndenterSurface(indenter=path.indenter, fillet=fillet, unit=units.length, load_scale=path.load_scale)
    problem = ContactProblem(
        solid=Solid.from_cover(elements, path.cover, units),
        contact=SurfaceContact(elements, 1.0, surface, penalty=PENALTY / size, friction=path.friction),
        constrained=find_constrained(thin, elements.nodes[:, 0], elements.nodes[:, 1], reach),
        units=units,
        load_scale=path.load_scale,
    )
    reached = problem.follow(
        path.scaled_targets,
        control=path.control,
        first=FIRST_DEPTH * path.load_scale,
        guesses=() if coarse is None or path.friction else coarse.transfer_guesses(elements),
        progress=progress,
    )
    states = [_describe_state(elements, units, surface, each) for each in reached]
    return states, SolvedPath(elements=elements, equilibria=reached)


def _describe_state(
    elements: MixedElements, units: Units, surface: IndenterSurface, reached: ContactEquilibrium
) -> PressedState:
    """Return a converged target in SI units."""
    r, z = elements.nodes.T
    base, top = np.flatnonzero(z < _ON_BOUNDARY), np.flatnonzero(z > 1 - _ON_BOUNDARY)
    base, top = base[np.argsort(r[base])], top[np.argsort(r[top])]
    moved = elements.nodes + reached.state[: elements.displacements].reshape(-1, 2)
    below = recover_base_response(r[base], reached.reaction[2 * base + 1])
    return PressedState(
        depth=reached.depth * units.length,
        load=reached.load * units.force,
        area=_measure_area(surface, moved[top], reached) * units.length**2,
        overlap=reached.contact.overlap * units.length,
        base=BaseResponse(
            radius=below.radius * units.length,
            pressure=below.pressure * units.stress,
            reaction=below.reaction * units.force,
        ),
    )


def _measure_area(surface: IndenterSurface, top: FloatArray, reached: ContactEquilibrium) -> float:
    """Return the contact area, from the radius at which the gap opens.

    Outside a smooth contact the gap grows with the distance from its edge to the power 3/2 (Johnson 1985, section 5.1).
    The gap to the power 2/3 is therefore a straight line over the next open nodes, and its zero is the edge.  This
    resolves the edge more finely than the mesh does.

    Args:
        surface: Surface of the indenter.
        top: Moved nodes of the top, from the axis outwards, shape (n, 2).
        reached: The converged state.
    """
    r, z = top[:, 0], top[:, 1]
    gap = 1 - reached.depth + surface.height(r, np.zeros_like(r)) - z
    closed = np.flatnonzero(gap < _OPEN * reached.depth)
    first_open = int(closed.max()) + 1 if closed.size else 0
    if isinstance(surface.indenter, FlatPunch) or first_open == 0 or first_open + _OPEN_NODES > len(r):
        return reached.contact.area
    near = slice(first_open, first_open + _OPEN_NODES)
    slope, intercept = np.polyfit(r[near], gap[near] ** (2 / 3), 1)
    return float(np.pi * np.clip(-intercept / slope, r[max(first_open - _CLOSED_NODES, 0)], r[first_open]) ** 2)
