"""Finite-strain pressing of shapes with an axis, in the plane of radius and height."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem_reference.elements.grading import grade_around_edge, grade_outward
from fem_reference.elements.scaling import Units
from fem_reference.elements.taylor_hood import MixedElements, prepare_elements
from fem_reference.finite_strain.contact import SurfaceContact
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import Obstacle
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.mesh_transfer import Coarse
from fem_reference.finite_strain.newton import Equilibrium, Problem
from fem_reference.linear_response.axisymmetric import BaseResponse, find_constrained, mesh_cover, recover_base_response
from meshes import FlatPunch

FloatArray = npt.NDArray[np.float64]

#: Pressure per overlap, in shear moduli per element size.  It must outweigh what the contact pressure itself takes from
#: the stiffness of an element; below about 30 surfaces under high pressure wrinkle.
PENALTY = 300.0
#: Elements over the radius of a rounded edge [-].
_FINE = 0.46
#: A node this close to a boundary lies on it, in thicknesses [-].
_TOUCH = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedState:
    """One converged target of a loading path.

    Attributes:
        depth: Approach from first touch [m].
        load: Force [N].
        area: Area that touches, in the deformed state [m2].
        overlap: Mean distance that the penalty left between the surfaces [m].
        base: Base pressure, for the whole load.
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
    coarse: Coarse | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[PressedState], Coarse]:
    """Follow one loading path; return the state at every target, and the path for a finer mesh to start from.

    Args:
        path: What is pressed how far; a path with friction is walked in small steps.
        elements_per_thickness: Elements through the cover [-].
        contact_radius: Estimated radius of the largest contact; the mesh is fine up to it [m].
        fillet: Radius of the rounding of sharp edges [m].
        reach: Radius of the outer boundary [m].
        coarse: The same path on a coarser mesh, to start from.
        progress: Called with a line of text after each step.

    Raises:
        PathError: If the path stops early.
    """
    units = Units.of(path.cover)
    thin = units.scale_cover(path.cover)
    fillet, radius, reach = (value / units.length for value in (fillet, contact_radius, reach))
    size = min(1.0, radius) / elements_per_thickness
    growth = 1 + 1.2 / elements_per_thickness
    top = size
    if isinstance(path.indenter, FlatPunch):
        top = _FINE * fillet
        radii = grade_around_edge(top, size, radius, reach, growth)
    else:
        radii = grade_outward(size, 1.25 * radius, reach, growth)
    mesh, region = mesh_cover(thin, elements_per_thickness, radii, surface_size=top)
    elements = prepare_elements(mesh, region=region, axisymmetric=True)
    obstacle = Obstacle(indenter=path.indenter, fillet=fillet, unit=units.length, load_scale=path.load_scale)
    problem = Problem(
        solid=Solid.of_cover(elements, path.cover, units),
        contact=SurfaceContact(elements, 1.0, obstacle, penalty=PENALTY / size, friction=path.friction),
        fixed=find_constrained(thin, elements.nodes[:, 0], elements.nodes[:, 1], reach),
        units=units,
        load_scale=path.load_scale,
    )
    aims = [units.scale_target(value, path.control) for value in path.scaled_targets]
    guesses = () if coarse is None or path.friction else coarse.guesses(elements)
    first = 0.02 * path.load_scale
    reached = problem.follow(aims, control=path.control, first=first, guesses=guesses, progress=progress)
    states = [_state(elements, units, obstacle, each) for each in reached]
    return states, Coarse(elements=elements, path=reached)


def _state(elements: MixedElements, units: Units, obstacle: Obstacle, reached: Equilibrium) -> PressedState:
    r, z = elements.nodes.T
    base, top = np.flatnonzero(z < _TOUCH), np.flatnonzero(z > 1 - _TOUCH)
    base, top = base[np.argsort(r[base])], top[np.argsort(r[top])]
    moved = elements.nodes + reached.state[: elements.displacements].reshape(-1, 2)
    below = recover_base_response(r[base], reached.reaction[2 * base + 1])
    return PressedState(
        depth=reached.depth * units.length,
        load=reached.load * units.force,
        area=_area(obstacle, moved[top], reached) * units.length**2,
        overlap=reached.touch.overlap * units.length,
        base=BaseResponse(
            radius=below.radius * units.length,
            pressure=below.pressure * units.stress,
            reaction=below.reaction * units.force,
        ),
    )


def _area(obstacle: Obstacle, top: FloatArray, reached: Equilibrium) -> float:
    """Contact area from where the gap opens.

    Beyond the edge of a smooth contact the gap grows as the distance to the power 3/2 (Johnson 1985, section 5.1), so
    its power 2/3, a straight line along the next few open nodes, meets zero at the edge: finer than the mesh tells
    touching from open.
    """
    r, z = top[:, 0], top[:, 1]
    gap = 1 - reached.depth + obstacle.height(r, np.zeros_like(r)) - z
    shut = np.flatnonzero(gap < _OPEN * reached.depth)
    first = int(shut.max()) + 1 if shut.size else 0
    if isinstance(obstacle.indenter, FlatPunch) or first == 0 or first + _BESIDE > len(r):
        return reached.touch.area
    near = slice(first, first + _BESIDE)
    slope, start = np.polyfit(r[near], gap[near] ** (2 / 3), 1)
    return float(np.pi * np.clip(-start / slope, r[max(first - 3, 0)], r[first]) ** 2)


#: Gap over depth from which a node counts as open: inside the last element that touches the surface waves by less [-].
_OPEN = 1e-2
#: Open nodes that tell where the gap opens.
_BESIDE = 4
