"""Solve a loading path of an indenter of revolution on a laterally wide cover, axisymmetrically in the r-z plane.

A loading path is a sequence of ascending target loads or depths, solved one after the other from the undeformed state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem_reference.elements.grading import grade_around_edge, grade_outward
from fem_reference.errors import PathConvergenceError
from fem_reference.fields.cover_fields import recover_fields
from fem_reference.finite_strain.contact import SurfaceContact, collect_points, divide_rings
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem, SolvedPath
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Progress
from fem_reference.indentation.grid_solution import GridSolution, RadialBase
from fem_reference.linear_response.axisymmetric import RadialCover
from meshes import FlatPunch


@dataclass(frozen=True, kw_only=True)
class AxisymmetricPathSettings:
    """Constants of loading paths in the r-z plane."""

    #: Part of the bulk modulus that acts on the displacements directly, under curved indenters and flat faces deep in
    #: the cover at finite strain, in shear moduli [-].  Without it, balls on incompressible covers stop before 75 % of
    #: the thickness.
    direct_bulk: float = 50.0
    #: Element size at the rounded edge of a flat punch over the radius of the edge [-].
    edge_element: float = 0.46
    #: Radius of the region of small elements over the radius of the contact, under a curved indenter [-].
    fine_region: float = 1.25
    #: Size ratio of neighbouring elements away from the contact, minus one, times the number of elements through the
    #: cover [-].
    growth: float = 1.2
    #: Distance from the edge of the contact, over the thickness of the top layer, within which the gap grows with the
    #: power 3/2 of the distance [-].
    near_edge: float = 0.5
    #: Smallest number of quadrature points out of contact from whose gaps the edge of the contact is extrapolated [-].
    least_points: int = 3
    #: Largest number of such points, those of two elements [-].
    most_points: int = 6


_SETTINGS = AxisymmetricPathSettings()


#: Contact penalty: contact pressure per penetration, in shear moduli per element size [-].  A high contact pressure
#: reduces the stiffness of the surface elements, and the penalty must exceed this reduction by far.  Below about 30,
#: surfaces under high pressure wrinkle.
PENALTY = 300.0
#: Small-strain depth over cover thickness above which a flat face counts as deep in the cover [-].
DEEP = 0.25
#: Depth of the first step of a loading path over the cover thickness, small enough for a linear response [-].
FIRST_DEPTH = 0.02
#: Smallest number of steps of a loading path with friction in the r-z plane, over the number of elements through the
#: cover [-].  The error of the steps then decreases with the element size, and the differences between grids include
#: both errors.
FRICTION_STEPS = 1.25


def press_axisymmetric(
    path: LoadingPath,
    *,
    elements_per_thickness: int,
    contact_radius: float,
    fillet: float,
    reach: float,
    approach: float = 0.0,
    coarse: SolvedPath | None = None,
    progress: Progress = None,
) -> tuple[list[GridSolution], SolvedPath]:
    """Press an indenter of revolution into a wide cover along one loading path, on one mesh.

    Args:
        path: Cover, indenter, target loads or depths, and friction.
        elements_per_thickness: Number of elements through the cover [-].
        contact_radius: Estimated radius of the largest contact, within which elements are small [m].
        fillet: Radius of rounded edges of the indenter [m].
        reach: Radius of the outer boundary, where all displacements are zero [m].
        approach: Small-strain depth at the last target under a flat face [m].
        coarse: Solution of the same loading path on a coarser mesh, for initial guesses of Newton's method.  Not used
            with friction, because slip depends on the loading history.
        progress: Called with a line of text after each step.

    Returns:
        The solution at every target, without the load scale, and the solved path as initial guesses for a finer mesh.

    Raises:
        PathConvergenceError: If the path stops before its last target.
    """
    units = path.units
    fillet, radius, reach = (value / units.length for value in (fillet, contact_radius, reach))
    deep = isinstance(path.indenter, FlatPunch) and approach > DEEP * path.cover.thickness
    size = min(1.0, radius) / elements_per_thickness
    growth = 1 + _SETTINGS.growth / elements_per_thickness
    if isinstance(path.indenter, FlatPunch):
        top = _SETTINGS.edge_element * fillet
        # The cover slides outwards around an edge deep in it; the elements there come from a strip inside the edge.
        radii = grade_around_edge(top, size, radius, reach, growth, even=deep * radius / 2)
    else:
        radii, top = grade_outward(size, _SETTINGS.fine_region * radius, reach, growth), size
    radial = RadialCover.mesh(path.cover, elements_per_thickness, radii, surface_size=top)
    elements = radial.elements
    # Contact problem in units of the cover's thickness and shear modulus.
    surface = IndenterSurface(indenter=path.indenter, fillet=fillet, unit=units.length, load_scale=path.load_scale)
    direct = _SETTINGS.direct_bulk if path.load_scale == 1 and (deep or not path.indenter.is_flat) else 0.0
    solid = Solid.from_cover(elements, path.cover, units, direct=direct)
    problem = ContactProblem(
        solid=solid,
        contact=SurfaceContact(elements, 1.0, surface, penalty=PENALTY / size, friction=path.friction),
        constrained=radial.constrained,
        units=units,
        load_scale=path.load_scale,
        friction_steps=round(FRICTION_STEPS * elements_per_thickness),
    )
    guide = None if path.friction else coarse
    steps: list[ContactEquilibrium] = []
    try:
        reached = problem.follow(
            path.scaled_targets,
            control=path.control,
            first=FIRST_DEPTH * path.load_scale,
            guesses=guide.transfer_guesses(elements) if guide else (),
            between=guide.transfer_steps(elements) if guide else (),
            progress=progress,
            record=steps.append,
        )
    except PathConvergenceError as error:
        error.solved = SolvedPath(elements=elements, equilibria=(), steps=steps, coarse=coarse)
        raise
    solved = SolvedPath(elements=elements, equilibria=reached, steps=steps, coarse=coarse)
    states = [_describe_state(solid, path, each, radial) for each in reached]
    return [replace(each, size=1 / elements_per_thickness) for each in states], solved


def _describe_state(solid: Solid, path: LoadingPath, reached: ContactEquilibrium, radial: RadialCover) -> GridSolution:
    """Convert the equilibrium at one target load or depth to a solution in SI units, without the load scale."""
    units, scale = path.units, path.load_scale
    # With a small load scale the strains are so small that the energy of finite strain would be lost in rounding.
    stored = solid if scale == 1 else solid.linearise_at_rest()
    fields = None
    if path.fields:
        fields = recover_fields(solid, reached.state, units, load_scale=scale, linear=scale != 1)
    force = reached.load * units.force / scale
    points = divide_rings(collect_points(reached.contact) * [units.length, *[units.force / scale] * 2])
    area, area_spread = _measure_area(path, reached)
    spread = radial.recover_base(reached.reaction, reached.load)
    return GridSolution(
        size=1.0,
        total_force=force,
        depth=reached.depth * units.length / scale,
        area=area * units.length**2,
        area_spread=area_spread,
        overlap=reached.contact.overlap / reached.depth,
        contact=points[:, :3],
        shear=points[:, 3:] if path.friction else None,
        base=RadialBase(spread=spread, force=force),
        energy=stored.energy(reached.state) * units.force * units.length / scale**2,
        fields=fields,
    )


def _measure_area(path: LoadingPath, reached: ContactEquilibrium) -> tuple[float, float]:
    """Compute the contact area from the radius at which the gap between indenter and cover opens.

    The edge lies between the outermost quadrature point in contact and the next one.  Outside a smooth contact the gap
    grows with the distance from the edge to the power 3/2 (Johnson 1985, section 5.1), as long as this distance is
    small beside the thickness of the top layer.  A straight line is therefore fitted to the gap to the power 2/3 at
    the first points out of contact, and its zero is the edge of the contact.

    Args:
        path: Cover and indenter.
        reached: Equilibrium at one target, in units of the cover thickness.

    Returns:
        The contact area, in squared thicknesses, and the area of the ring in which the edge lies over it [-].
    """
    contact = reached.contact
    order = np.argsort(contact.position[..., 0], axis=None)
    r, gap, pressure = (each.ravel()[order] for each in (contact.position[..., 0], contact.gap, contact.pressure))
    outside = int(np.flatnonzero(pressure > 0).max(initial=-1)) + 1
    if isinstance(path.indenter, FlatPunch) or not 0 < outside <= len(r) - _SETTINGS.most_points:
        return contact.area, 0.0
    near = _SETTINGS.near_edge * path.cover.layers[-1].thickness / path.cover.thickness
    count = int(np.clip((r[outside:] < r[outside] + near).sum(), _SETTINGS.least_points, _SETTINGS.most_points))
    part = slice(outside, outside + count)
    slope, intercept = np.polyfit(r[part], np.maximum(gap[part], 0.0) ** (2 / 3), 1)
    low, high = r[outside - 1], r[outside]
    edge = float(np.clip(-intercept / slope, low, high)) if slope > 0 else float(low + high) / 2
    return np.pi * edge**2, float(high**2 - low**2) / edge**2
