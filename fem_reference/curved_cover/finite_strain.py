"""Press a rigid indenter into a curved cover at finite strain, frictionless.

The mesh is turned into the frame of the indenter, whose lowest point first touches at the origin, so that elements,
contact at quadrature points, and loading path are those of flat covers (`fem_reference.finite_strain`).  The element
size limits what is feasible, so the result is a correction: on each mesh but the finest the solution at finite strain
is computed, and the error of its mesh is removed by the small-strain solutions on that mesh and on the finest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem_reference.curved_cover.contact import find_touch
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.grid_press import GridPress
from fem_reference.curved_cover.pressure_shapes import PointSampler, evaluate_hats, gauss_points
from fem_reference.curved_cover.responses import project_texels, texel_responses
from fem_reference.curved_cover.small_strain import (
    LARGEST_DEPTH,
    build_compliance,
    measure_balance,
    press_small,
    warn_of_all,
)
from fem_reference.curved_cover.solid import DisplacementNodes
from fem_reference.finite_strain.axisymmetric_path import PENALTY
from fem_reference.finite_strain.contact import SurfaceContact, TopPoints
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import Control, Units
from fem_reference.indentation.problem import PressProblem
from fem_reference.indentation.result import Indentation
from fem_reference.indentation.rounding import choose_solid_fillet, state_rounding
from meshes import Cover, Indenter, Layer, Material, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose
from meshes.solids.facets import area_vectors, facet_shape
from meshes.solids.solid_mesh import SolidMesh, measure_thickness

#: Smallest cosine between the normal of the top and the axis of the indenter at points that can touch [-].
_LEAST_COSINE = 0.05
#: First step of the loading path, from the first touch of a contact point, over the way from there to the depth at
#: small strain [-].
_FIRST_STEP = 0.5
#: Mean penetration of indenter and cover, over the depth, below which augmentation stops [-].
_OVERLAP = 2e-3
#: Stiffness of the contact at small strain over the penalty, as augmentation makes it [-].
_AUGMENTED = 30.0
#: Largest estimated error of the effect of finite strain that one mesh gives, over the effect; safety factor on the
#: difference between the effects on two meshes [-].
_ONE_MESH, _SAFETY = 0.5, 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reached:
    """Solution at finite strain on one mesh, in the frame of the array and in SI units; shapes as in the result."""

    texel_forces: FloatArray
    force: FloatArray
    moment: FloatArray
    base_force: FloatArray
    base_moment: FloatArray
    load: float
    depth: float
    area: float
    top: FacetSurface
    contact_forces: FloatArray
    displacement: FloatArray
    mesh: SolidMesh


def press_finite(
    meshes: tuple[SolidMesh, ...], material: Material, problem: PressProblem, target: float
) -> Indentation:
    """Press to one target at finite strain, along the axis of the indenter and without friction; see `press_small`.

    The arrays of the result are those of the finest mesh on which finite strain was solved: the last but one of
    several.  Texel forces, and depth or load, are corrected for its discretisation error.
    """
    accurate = press_small(meshes, material, problem, target)
    small, full = [], []
    for number, mesh in enumerate(meshes[: max(1, len(meshes) - 1)], start=1):
        small.append(_press_points(mesh, material, problem, target))
        full.append(_solve(mesh, material, problem, target, small[-1], number))
    assumptions = _state_assumptions(material, problem.indenter, measure_thickness(meshes[-1]))
    return _combine(accurate, small, full, problem.array, problem.control, assumptions)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Small:
    """Solution at small strain on one mesh, with the contact points and the penalty of finite strain.

    Attributes:
        texel_forces: Force on each of n texels, shape (n,) [N].
        load: Force along the motion [N].
        depth: Depth [m].
        first: Depth at which the nearest contact point touches [m].
    """

    texel_forces: FloatArray
    load: float
    depth: float
    first: float


def _press_points(mesh: SolidMesh, material: Material, problem: PressProblem, target: float) -> _Small:
    """Solve at small strain with contact at the Gauss points at which finite strain states it."""
    pose, thickness, compliance = problem.pose, measure_thickness(mesh), build_compliance(mesh, material)
    touch = find_touch(compliance.top, problem.indenter, pose, pose.towards)
    deepest = LARGEST_DEPTH * thickness
    penalty = PENALTY * _AUGMENTED * material.shear_modulus / thickness
    sampler = PointSampler(compliance.top, problem.indenter, pose, pose.towards, touch + deepest, deepest, penalty)
    contact = GridPress(compliance, sampler, pose.towards, touch, deepest).to(target, problem.control)
    return _Small(
        texel_forces=texel_responses(mesh, problem.array, material).finest.texel_forces(contact.nodal),
        load=contact.load,
        depth=contact.travel - touch,
        first=float(sampler.at(touch).gap.min()),
    )


def _state_assumptions(material: Material, indenter: Indenter, thickness: float) -> dict[str, str]:
    """State in words, by topic, what is assumed at finite strain; thickness of the cover in [m]."""
    name = f"neo-Hookean with the moduli of {material.name}" if material.small_strain_only else material.name
    return {
        "strain": f"finite strain, {name}; corrected for the mesh at small strain",
        "contact": "at quadrature points of the deformed top, along the normals of the indenter",
        **state_rounding(indenter, choose_solid_fillet(thickness, indenter)),
    }


def _solve(  # noqa: PLR0917
    mesh: SolidMesh, material: Material, problem: PressProblem, target: float, small: _Small, number: int
) -> _Reached:
    """Follow the loading path on one mesh, from a part of the depth at small strain."""
    indenter, pose, tell = problem.indenter, problem.pose, problem.progress
    own = DisplacementNodes.on(mesh)
    units = Units(length=measure_thickness(mesh), stress=material.shear_modulus)
    travel = find_touch(FacetSurface.part_of(own.elements.nodes, own.top), indenter, pose, -pose.rotation[:, 2])
    origin = pose.position - travel * pose.rotation[:, 2]
    layout = DisplacementNodes.on(replace(mesh, nodes=(mesh.nodes - origin) @ pose.rotation / units.length))
    solid = Solid.from_cover(layout.elements, Cover(layers=(Layer(thickness=1.0, material=material),)), units)
    top = _place_points(layout)
    fillet = choose_solid_fillet(units.length, indenter) / units.length
    contact = SurfaceContact(
        layout.elements,
        0.0,
        IndenterSurface(indenter=indenter, fillet=fillet, unit=units.length),
        penalty=PENALTY / min(1.0, float(np.sqrt(top.areas.sum(axis=1).mean()))),
        points=top.points,
    )
    base = np.unique(layout.base)
    path = ContactProblem(
        solid=solid,
        contact=contact,
        constrained=(3 * base[:, None] + np.arange(3)).ravel(),
        units=units,
        overlap=_OVERLAP,
    )
    goal = target / (units.force if problem.control == "load" else units.length)
    first = (small.first + _FIRST_STEP * (small.depth - small.first)) / units.length
    numbered = None if tell is None else lambda text: tell(f"finite strain, mesh {number}: {text}")
    reached = path.follow([goal], control=problem.control, first=first, progress=numbered)[0]
    return _collect(_Solved(mesh=mesh, own=own, pose=pose, units=units, top=top, reached=reached), problem.array)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Top:
    """Points on f facets of the top that look towards the indenter.

    Attributes:
        points: The points, in the frame and unit of the elements.
        hats: Hats at the q points of a facet, shape (q, a).
        areas: Areas of the points, shape (f, q) [units of area].
    """

    points: TopPoints
    hats: FloatArray
    areas: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solved:
    """Equilibrium on one mesh, with the nodes of the mesh in the frame of the array."""

    mesh: SolidMesh
    own: DisplacementNodes
    pose: Pose
    units: Units
    top: _Top
    reached: ContactEquilibrium


def _place_points(layout: DisplacementNodes) -> _Top:
    """Place quadrature points on the facets of the top that look towards the indenter, along z."""
    nodes, count = layout.elements.nodes, layout.top.shape[1]
    place, weight = gauss_points(count)
    vectors = area_vectors(nodes, layout.top, place) * weight[:, None]
    areas = np.linalg.norm(vectors, axis=2)
    facing = (vectors[..., 2] > _LEAST_COSINE * areas).all(axis=1)
    facets, shape = layout.top[facing], facet_shape(count, place)
    points = TopPoints(
        shape=np.broadcast_to(shape, (len(facets), *shape.shape)),
        nodes=facets,
        position=np.einsum("qa,fac->fqc", shape, nodes[facets]),
        weight=vectors[facing][..., 2],
    )
    return _Top(points=points, hats=evaluate_hats(count, place), areas=areas[facing])


def _collect(solved: _Solved, texels: TexelArray) -> _Reached:
    """Convert a solution to the frame of the array and to SI units."""
    nodes, units, reached, top = solved.own.elements.nodes, solved.units, solved.reached, solved.top
    base, surface = (FacetSurface.part_of(nodes, facets) for facets in (solved.own.base, solved.own.top))
    turn, count = solved.pose.rotation.T, nodes.size
    displacement = reached.state[:count].reshape(-1, 3) @ turn * units.length
    reaction = (reached.reaction[:count].reshape(-1, 3) @ turn * units.force)[base.index]
    contact = reached.contact
    pressing = -(contact.force[:count].reshape(-1, 3) @ turn) * units.force
    # The force at a point follows the normal of the indenter, whose component along the motion is 1.
    vectors = -(contact.pressure * contact.weight)[..., None] * (contact.normal @ turn) * units.force
    around = np.searchsorted(surface.index, top.points.nodes).ravel()
    hats = np.einsum("fqc,qa->fac", vectors, top.hats).reshape(-1, 3)
    return _Reached(
        texel_forces=np.einsum("nb,bc,nc->n", project_texels(base, texels), reaction, texels.normals),
        force=pressing.sum(axis=0),
        moment=np.cross(nodes + displacement, pressing).sum(axis=0),
        base_force=-reaction.sum(axis=0),
        base_moment=-np.cross(base.nodes, reaction).sum(axis=0),
        load=reached.load * units.force,
        depth=reached.depth * units.length,
        area=float(top.areas[contact.pressure > 0].sum()) * units.length**2,
        top=surface,
        contact_forces=np.stack([np.bincount(around, each, len(surface.nodes)) for each in hats.T], axis=1),
        displacement=displacement,
        mesh=solved.mesh,
    )


def _combine(  # noqa: PLR0917
    accurate: Indentation,
    small: Sequence[_Small],
    full: Sequence[_Reached],
    texels: TexelArray,
    control: Control,
    assumptions: Mapping[str, str],
) -> Indentation:
    """Correct the solution at finite strain for the error of its mesh, and estimate what remains."""
    shares = np.array([f.texel_forces / f.load - s.texel_forces / s.load for f, s in zip(full, small, strict=True)])
    stiffer = np.array([(f.load / f.depth) / (s.load / s.depth) for f, s in zip(full, small, strict=True)])
    last = full[-1]
    load, depth = accurate.total_force, accurate.depth
    if control == "load":
        depth /= stiffer[-1]
    else:
        load *= stiffer[-1]
    texel_forces = np.where(texels.active, accurate.texel_forces / accurate.total_force + shares[-1], 0.0) * load
    areas = np.array([each.area for each in full])
    peak = float(np.abs(texel_forces).max())
    added = {
        "peak_texel": _estimate_effect(shares) * load / peak,
        "misplaced_force": _estimate_effect(shares, summed=True) / 2,
        "texel_sum": _estimate_effect(shares.sum(axis=1)) * load / abs(float(texel_forces.sum())),
        "depth" if control == "load" else "total_force": _estimate_effect(stiffer - 1),
        "contact_area": _estimate_effect(areas - areas.mean()) / areas[-1],
    }
    errors = {name: error + added.get(name, 0.0) for name, error in accurate.error_estimate.items()}
    scale = load / last.load
    force, base_force = scale * last.force, scale * last.base_force
    return replace(
        accurate,
        texel_forces=texel_forces,
        force=force,
        moment=scale * last.moment,
        base_force=base_force,
        base_moment=scale * last.base_moment,
        unmeasured=base_force + texel_forces @ texels.normals,
        total_force=load,
        balance=measure_balance(force, base_force),
        depth=depth,
        contact_area=last.area,
        contact_points=last.top.nodes,
        energy=None,
        contact_forces=scale * last.contact_forces,
        displacement=last.displacement,
        mesh=last.mesh,
        error_estimate=errors,
        assumptions={**accurate.assumptions, **assumptions},
        warnings=warn_of_all(errors),
    )


def _estimate_effect(values: FloatArray, *, summed: bool = False) -> float:
    """Estimate the largest error of the effect of finite strain, or the sum of all, from it on one or two meshes."""
    size = np.sum if summed else np.max
    if len(values) == 1:
        return _ONE_MESH * float(size(np.abs(values)))
    return _SAFETY * float(size(np.abs(values[-1] - values[-2])))
