"""Press a rigid indenter into a solid cover from any direction: the solver of `SolidCover`.

At small strain the contact is frictionless or without slip (`contact`).  It is solved on every mesh.

At finite strain it is frictionless.  The mesh is rotated into the frame of the indenter, with the point of first touch
at the origin, so that elements, contact at quadrature points and loading path are those of flat covers
(`fem_reference.finite_strain`).  The feasible element size is limited, so that the result is a correction.  On every
mesh except the finest the solution at finite strain is computed.  Its discretisation error is removed by the
small-strain solutions on the same mesh and on the finest mesh.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.curved_cover.contact import STEPS, ContactForces, MeshPress, StickingPress, TopCompliance
from fem_reference.curved_cover.facet_surface import FacetSurface, quadrature
from fem_reference.curved_cover.penetration import check_penetration, shape_error, warn_of_shape
from fem_reference.curved_cover.pressure_shapes import GapSampler, PointSampler, evaluate_hats
from fem_reference.curved_cover.rays import explain_miss, find_touch
from fem_reference.curved_cover.responses import (
    build_solid,
    estimate_error,
    find_top,
    lay_out,
    project_texels,
    texel_responses,
)
from fem_reference.curved_cover.solid import DisplacementNodes
from fem_reference.errors import UnsupportedError
from fem_reference.finite_strain.axisymmetric_path import PENALTY
from fem_reference.finite_strain.contact import SurfaceContact, TopPoints
from fem_reference.finite_strain.contact_problem import ContactProblem
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import Control, Units, name_part, report
from fem_reference.indentation.finite_strain import choose_solid_fillet, state_rounding
from fem_reference.indentation.result import Indentation, PressProblem, warn_of_errors
from meshes import Cover, Layer, Material, SolidCover
from meshes.array_types import FloatArray
from meshes.solids.facets import area_vectors, facet_shape
from meshes.solids.solid_mesh import SolidMesh, measure_thickness


@dataclass(frozen=True, kw_only=True)
class SolidPressSettings:
    """Constants of presses of an indenter into a solid cover, and of their error estimates."""

    #: Largest depth over the thickness that is solved [-].
    largest_depth: float = 0.8
    #: Depth over the thickness from which a warning states that strains are not small [-].
    warn_depth: float = 0.15
    #: Smallest order of convergence in error estimates of depth, load and area: the order at a sharp edge [-].
    order: float = 1.0
    #: Smallest estimated relative error of depth and load without friction where the pressure ends at a sharp edge,
    #: over the relative node distance [-].  The relative node distance is the distance of the nodes in contact over
    #: half the smaller width of the contact.  The pressure is singular at a sharp edge.
    edge: float = 0.25
    #: Lower limit of the estimated relative errors of depth and load of a contact without slip that ends at a sharp
    #: edge [-].  It is multiplied by the distance of nodes over half the smaller width of the contact.
    sticking_edge: float = 0.4
    #: Smallest estimated relative error of depth and load where no sharp edge ends the pressure, over the square of the
    #: relative node distance [-].
    round: float = 0.13
    #: Relative node distance above which depth, load and area are not resolved [-].  On flat pads the depth was up to
    #: eight times too large there.
    unresolved: float = 1.2
    #: Smallest order of convergence of the changes of texel forces between meshes where no sharp edge ends the pressure
    #: [-].  At a sharp edge no convergence is assumed, because the error depends more on the position of the edge in
    #: the mesh than on the element size.
    smooth: float = 2.0
    #: Safety factor on the largest change of one texel force between successive meshes [-].  It covered the errors in
    #: 36 of 36 presses on flat pads.
    one_texel: float = 2.5
    #: Safety factor on half the sum of the changes of all texel forces between successive meshes [-].  It covered the
    #: errors in 34 of 36 presses on flat pads.
    sum: float = 1.5
    #: Safety factor in place of `one_texel` and `sum` if there are only two meshes [-].
    two_meshes: float = 3.0
    #: Smallest cosine between the normal of the top and the axis of the indenter at points that can touch, at finite
    #: strain [-].
    least_cosine: float = 0.05
    #: First step of the loading path at finite strain, over the difference between two depths [-]: the depth at which
    #: the first contact point touches, and the depth at small strain.
    first_step: float = 0.5
    #: Mean penetration of indenter and cover at finite strain, over the depth, below which augmentation stops [-].
    overlap: float = 0.002
    #: Stiffness of the contact springs at small strain over the penalty at finite strain [-].  Augmentation makes the
    #: contact at finite strain stiffer by about this factor.
    augmented: float = 30.0
    #: Estimated error of the effect of finite strain on one mesh, over the effect [-].
    one_mesh: float = 0.5
    #: Safety factor in the error of the effect of finite strain, on the difference of the effect between two meshes
    #: [-].
    safety: float = 1.5


_SETTINGS = SolidPressSettings()

#: Assumptions of every press into a solid cover at small strain, by topic.
_ASSUMPTIONS = {
    "strain": "small strain; materials linearised at zero load",
    "motion": "the indenter moves along its direction and does not turn; forces across it are borne by its guide",
    "contact": "along the normals of the undeformed cover, on average over the shapes of the pressure, which is linear "
    "between nodes",
}


def press_solid(cover: SolidCover, problem: PressProblem) -> list[Indentation]:
    """Press an indenter into a solid at every target of a problem, or read the results from the store.

    The indenter moves from its pose along the direction to first touch, and further to the load or depth.

    Raises:
        ValueError: If the cover cannot be meshed, or the indenter never touches.
        UnsupportedError: If friction is neither zero nor no slip, finite strain is requested with friction or tilt, or
            an accuracy is requested.
        PiercedError: If the indenter would go through most of the cover.
        ConvergenceError: If the contact or the load is not found.
    """
    finite = problem.strain == "finite"
    if problem.friction not in {0.0, np.inf}:
        raise UnsupportedError(
            f"{problem.friction:g} is not computed on curved covers; accepted: 0 and no-slip", "friction"
        )
    if problem.friction and finite:
        raise UnsupportedError(
            "on curved covers no slip is computed at small strain only; write --strain small", "friction"
        )
    if finite and any(problem.pose.tilt):
        raise UnsupportedError(
            "at finite strain the indenter moves along its own axis; turn it to look along the direction", "tilt"
        )
    if problem.accuracy is not None:
        raise UnsupportedError("the meshes of a curved cover are given; leave it out", "accuracy")
    meshes = cover.meshes(problem.progress)
    out = []
    for target in problem.targets:
        started = time.perf_counter()

        def compute(target: float = target) -> tuple[int, Indentation]:
            found = (press_finite if finite else press_small)(meshes, cover.material, problem, target)
            number = next(k for k, mesh in enumerate(meshes) if mesh is found.mesh)
            return number, replace(found, mesh=None)

        inputs = {
            "meshes": [mesh.digest for mesh in meshes], "material": cover.material, "texels": problem.array,
            "indenter": problem.indenter, "pose": problem.pose, problem.control: target,
            "friction": problem.friction, "finite": finite,
        }  # fmt: skip
        number, found = result_store.fetch("solid-press", inputs, compute)
        out.append(replace(found, mesh=meshes[number], seconds=time.perf_counter() - started))
    return out


def press_small(meshes: tuple[SolidMesh, ...], material: Material, problem: PressProblem, target: float) -> Indentation:
    """Press a solid to one target load or depth at small strain on every mesh; return the result of the finest mesh.

    Args:
        meshes: One mesh, or two or three from coarse to fine for an error estimate.
        material: Material; hyperelastic materials are linearised at zero load.
        problem: Texels, indenter, pose and friction.
        target: Load [N] or depth [m].
    """
    texels, control, tell = problem.array, problem.control, problem.progress
    responses = texel_responses(meshes, texels, material, progress=tell)
    found, texel_forces, depths = [], [], []
    for mesh, grid in zip(meshes, responses.grids, strict=True):
        report(tell, f"contact, {build_solid(mesh, material).unknowns} unknowns")
        path = _begin(mesh, material, problem)
        contact = path.to(target, control)
        found.append(contact)
        depths.append(contact.travel - path.touch)
        texel_forces.append(grid.texel_forces(contact.nodal))
    errors = _estimate(meshes, np.array(texel_forces), found, depths, control)
    if isinstance(path, StickingPress):
        rough = path.to(target, control, STEPS // 2)
        changed = grid.texel_forces(rough.nodal - contact.nodal)
        _add_step_error(errors, changed, texel_forces[-1], (rough, contact), path.touch)
    share = depths[-1] / measure_thickness(mesh)
    large = f"the depth is {100 * share:.3g} % of the thickness: strains are not small; solve at finite strain"
    # Displacements and base reactions under the contact forces on the finest mesh.
    solid, top = build_solid(mesh, material), find_top(mesh)
    nodal = np.zeros_like(solid.nodes)
    nodal[top.index] = contact.nodal
    displacement, reaction = solid.solve_fully(nodal)
    check_penetration(mesh, displacement, problem.indenter, problem.pose, travel=contact.travel, depth=depths[-1])
    for name, share in (
        ("depth" if control == "load" else "total_force", 1),
        ("peak_texel", 2),
        ("misplaced_force", 2),
    ):
        errors[name] += shape_error(mesh, depths[-1]) / share
    force, base_force = nodal.sum(axis=0), -reaction.sum(axis=0)
    pressing = -contact.forces[:, None] * top.normals
    active = np.where(texels.active, texel_forces[-1], 0.0)
    return Indentation(
        texel_forces=active,
        total_force=contact.load,
        force=force,
        moment=np.cross(solid.nodes, nodal).sum(axis=0),
        base_force=base_force,
        base_moment=-np.cross(solid.nodes[solid.base], reaction).sum(axis=0),
        unmeasured=base_force + active @ texels.normals,
        balance=measure_balance(force, base_force),
        depth=depths[-1],
        contact_area=contact.area,
        contact_points=top.nodes,
        contact_forces=pressing if contact.shear is None else pressing + contact.shear,
        energy=float((nodal * displacement).sum()) / 2,
        mesh=mesh,
        displacement=displacement,
        error_estimate=errors,
        assumptions=_ASSUMPTIONS | {"friction": "none" if contact.shear is None else "no slip"},
        warnings=(
            *((large,) if share > _SETTINGS.warn_depth else ()),
            *warn_of_shape(mesh, depths[-1]),
            *warn_of_all(errors),
        ),
    )


def _begin(
    mesh: SolidMesh, material: Material, problem: PressProblem, points: type[GapSampler] = GapSampler
) -> MeshPress:
    """Create the small-strain contact problem on one mesh, frictionless or without slip.

    Args:
        mesh: Mesh of the cover.
        material: Material, linearised at zero load.
        problem: Indenter, pose and friction.
        points: Kind of points of the top at which gaps are measured.
    """
    top, indenter, pose = find_top(mesh), problem.indenter, problem.pose
    touch = find_touch(top, indenter, pose)
    if not -np.ptp(top.nodes @ pose.towards) <= touch < np.inf:  # missed, or passed by the whole cover
        raise ValueError(explain_miss(top, pose))
    deepest = _SETTINGS.largest_depth * measure_thickness(mesh)
    sampler = points(top, indenter, pose, touch + deepest, deepest)
    kind = StickingPress if problem.friction else MeshPress
    compliance = build_compliance(mesh, material, vectors=problem.friction > 0)
    return kind(compliance, sampler, pose.towards, touch, deepest)


@lru_cache(maxsize=6)
def build_compliance(mesh: SolidMesh, material: Material, *, vectors: bool = False) -> TopCompliance:
    """Build the compliance of the top of a mesh.

    The six most recent compliances are kept in memory, with the rows computed for nodes in contact.
    """
    return TopCompliance(build_solid(mesh, material), vectors=vectors)


def _estimate(
    meshes: tuple[SolidMesh, ...],
    texel_forces: FloatArray,
    contacts: list[ContactForces],
    depths: list[float],
    control: Control,
) -> dict[str, float]:
    """Estimate the relative errors of the results on the finest mesh.

    Args:
        meshes: The m meshes, from coarse to fine.
        texel_forces: Forces on the n texels on each mesh, shape (m, n) [N].
        contacts: Contact on each mesh.
        depths: Depth on each mesh [m].
        control: Whether the load or the depth is prescribed; the error of the prescribed one is zero.

    Returns:
        Estimated relative errors by name of the result [-]; NaN where the mesh does not resolve the contact.
    """
    peak = max(float(np.abs(texel_forces[-1]).max()), np.finfo(float).tiny)
    single = {
        "total_force": np.array([each.load for each in contacts]),
        "depth": np.array(depths),
        "contact_area": np.array([each.area for each in contacts]),
        "texel_sum": texel_forces.sum(axis=1),
    }
    changes = np.abs(np.diff(texel_forces, axis=0))
    edge = contacts[-1].has_edge
    errors = {
        "peak_texel": _estimate_change(changes.max(axis=1), meshes, edge, _SETTINGS.one_texel) / peak,
        "misplaced_force": _estimate_change(changes.sum(axis=1) / 2, meshes, edge, _SETTINGS.sum) / contacts[-1].load,
    }
    for name, values in single.items():
        errors[name] = estimate_error(values, meshes, least=_SETTINGS.order) / abs(float(values[-1]))
    last = contacts[-1]
    if len(meshes) > 1 and last.area > 0:
        # The border of the contact is uncertain by half a node distance.  This is the relative change of a circular
        # area.
        resolved = (1 + edge) * last.spacing / float(np.sqrt(last.area / np.pi))
        errors["contact_area"] = max(errors["contact_area"], resolved)
        narrow = last.spacing / last.half_width
        singular = _SETTINGS.edge if last.shear is None else _SETTINGS.sticking_edge
        for name in ("depth", "total_force"):
            errors[name] = max(errors[name], singular * narrow if edge else _SETTINGS.round * narrow**2)
        if narrow > _SETTINGS.unresolved:
            errors |= dict.fromkeys(("depth", "total_force", "contact_area"), float("nan"))
    return errors | {"total_force" if control == "load" else "depth": 0.0}


def _add_step_error(
    errors: dict[str, float],
    changed: FloatArray,
    texel_forces: FloatArray,
    contacts: tuple[ContactForces, ContactForces],
    touch: float,
) -> None:
    """Add the error of the steps of the path to estimated errors, from a solution with half the number of steps.

    The error of the steps is proportional to the reciprocal of their number.

    Args:
        errors: Estimated relative errors by name [-]; changed in place.
        changed: Texel forces with half the number of steps minus those with all steps, shape (n,) [N].
        texel_forces: Texel forces with all steps, shape (n,) [N].
        contacts: Contact with half the number of steps, and with all steps.
        touch: Travel to the first touch [m].
    """
    rough, fine = contacts
    size = np.abs(changed)
    errors["peak_texel"] += float(size.max() / max(np.abs(texel_forces).max(), np.finfo(float).tiny))
    errors["misplaced_force"] += float(size.sum() / 2 / fine.load)
    errors["texel_sum"] += abs(float(changed.sum() / texel_forces.sum()))
    errors["contact_area"] += abs(rough.area / fine.area - 1)
    errors["depth"] += abs((rough.travel - touch) / (fine.travel - touch) - 1)
    errors["total_force"] += abs(rough.load / fine.load - 1)


def warn_of_all(errors: Mapping[str, float]) -> tuple[str, ...]:
    """Describe in words which estimated errors are large, and which results the meshes do not resolve."""
    if not np.isnan(errors["contact_area"]) or np.isnan(errors["peak_texel"]):
        return warn_of_errors(errors)
    other = "load" if errors["depth"] == 0 else "depth"
    return (
        *warn_of_errors(errors),
        (
            f"the contact is narrower than the elements of the cover: {other} and contact area are not resolved, the "
            "texel forces are; press harder, use a larger indenter or a finer mesh"
        ),
    )


def _estimate_change(changes: FloatArray, meshes: tuple[SolidMesh, ...], has_edge: bool, safety: float) -> float:
    """Estimate the error of a quantity on the finest of m meshes, in the unit of the quantity.

    Args:
        changes: Absolute changes of the quantity between successive meshes, shape (m - 1,).
        meshes: The meshes, from coarse to fine.
        has_edge: Whether a sharp edge ends the pressure.
        safety: Safety factor with three meshes [-].
    """
    if len(changes) == 0:
        return float("nan")
    if len(changes) == 1:
        return _SETTINGS.two_meshes * float(changes[0])
    finer = (len(meshes[1].cells) / len(meshes[2].cells)) ** (1 / 3)
    decrease = 1.0 if has_edge else finer**_SETTINGS.smooth
    return safety * max(decrease * float(changes[0]), float(changes[1]))


def measure_balance(force: FloatArray, base_force: FloatArray) -> float:
    """Return the difference between the force on the base and the force on the cover, over the force on the cover [-].

    The difference is taken along the force on the cover.
    """
    return float((base_force - force) @ force / (force @ force))


def press_finite(
    meshes: tuple[SolidMesh, ...], material: Material, problem: PressProblem, target: float
) -> Indentation:
    """Press a solid to one target load or depth at finite strain, along the axis of the indenter and without friction.

    The arrays of the result are those of the finest mesh solved at finite strain, the second finest of several meshes.
    Texel forces, and depth or load, are corrected for its discretisation error.
    """
    accurate = press_small(meshes, material, problem, target)
    small, full = [], []
    for number, mesh in enumerate(meshes[: max(1, len(meshes) - 1)], start=1):
        small.append(_press_points(mesh, material, problem, target))
        tell = name_part(problem.progress, f"finite strain, mesh {number}")
        full.append(_press_mesh(mesh, material, replace(problem, progress=tell), target, small[-1]))
    name = f"neo-Hookean with the moduli of {material.name}" if material.small_strain_only else material.name
    thickness = measure_thickness(meshes[-1])
    assumptions = {
        "strain": f"finite strain, {name}; corrected for the mesh at small strain",
        "contact": "at quadrature points of the deformed top, along the normals of the indenter",
        **state_rounding(problem.indenter, choose_solid_fillet(thickness, problem.indenter)),
    }
    return _combine(accurate, small, full, problem, assumptions)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Small:
    """Solution at small strain on one mesh, with the contact points and the penalty of finite strain.

    Attributes:
        texel_forces: Force on each of n texels, shape (n,) [N].
        load: Force along the motion [N].
        depth: Depth [m].
        first: Depth at which the first contact point touches [m].
    """

    texel_forces: FloatArray
    load: float
    depth: float
    first: float


def _press_points(mesh: SolidMesh, material: Material, problem: PressProblem, target: float) -> _Small:
    """Solve at small strain with the contact condition at Gauss points, as in the solution at finite strain."""
    press = _begin(mesh, material, problem, PointSampler)
    press.sampler.penalty = PENALTY * _SETTINGS.augmented * material.shear_modulus / measure_thickness(mesh)
    contact = press.to(target, problem.control)
    return _Small(
        texel_forces=texel_responses([mesh], problem.array, material).finest.texel_forces(contact.nodal),
        load=contact.load,
        depth=contact.travel - press.touch,
        first=float(press.sampler.at(press.touch).gap.min()),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Full(_Small):
    """Solution at finite strain on one mesh, in the frame of the array; shapes and units as in `Indentation`.

    Attributes:
        arrays: Attributes of the result by name.
        area: Contact area [m2].
    """

    arrays: dict[str, Any]
    area: float


def _press_mesh(mesh: SolidMesh, material: Material, problem: PressProblem, target: float, small: _Small) -> _Full:
    """Solve one press at finite strain on one mesh, in steps that start at a fraction of the small-strain depth."""
    indenter, pose = problem.indenter, problem.pose
    units = Units(length=measure_thickness(mesh), stress=material.shear_modulus)
    surface, turn = find_top(mesh), pose.rotation.T
    origin = pose.position - find_touch(surface, indenter, pose) * pose.rotation[:, 2]
    layout = DisplacementNodes.on(replace(mesh, nodes=(mesh.nodes - origin) @ turn.T / units.length))
    elements, count = layout.elements, layout.elements.nodes.size
    points, areas = _place_points(layout)
    base = np.unique(layout.base)
    path = ContactProblem(
        solid=Solid.from_cover(elements, Cover(layers=(Layer(thickness=1.0, material=material),)), units),
        contact=SurfaceContact(
            elements,
            0.0,
            IndenterSurface(
                indenter=indenter, fillet=choose_solid_fillet(units.length, indenter) / units.length, unit=units.length
            ),
            penalty=PENALTY / min(1.0, float(np.sqrt(areas.sum(axis=1).mean()))),
            points=points,
        ),
        constrained=(3 * base[:, None] + np.arange(3)).ravel(),
        units=units,
        overlap=_SETTINGS.overlap,
    )
    goal = target / (units.force if problem.control == "load" else units.length)
    first = (small.first + _SETTINGS.first_step * (small.depth - small.first)) / units.length
    reached = path.follow([goal], control=problem.control, first=first, progress=problem.progress)[0]
    contact = reached.contact
    nodes = lay_out(mesh).elements.nodes
    displacement, reaction, pressing = (
        each[:count].reshape(-1, 3) @ turn * unit
        for each, unit in (
            (reached.state, units.length), (reached.reaction, units.force), (contact.force, -units.force)
        )
    )  # fmt: skip
    # The force at a point follows the normal of the indenter, whose component along the motion is 1.
    vectors = -(contact.pressure * contact.weight)[..., None] * (contact.normal @ turn) * units.force
    around = np.searchsorted(surface.index, points.nodes).ravel()
    hats = evaluate_hats(layout.top.shape[1], quadrature(layout.top.shape[1])[0])
    on_hats = np.einsum("fqc,qa->fac", vectors, hats).reshape(-1, 3)
    below = FacetSurface.part_of(nodes, lay_out(mesh).base)
    texels = problem.array
    return _Full(
        texel_forces=np.einsum("nb,bc,nc->n", project_texels(below, texels), reaction[base], texels.normals),
        load=reached.load * units.force,
        depth=reached.depth * units.length,
        first=small.first,
        area=float(areas[contact.pressure > 0].sum()) * units.length**2,
        arrays={
            "force": pressing.sum(axis=0),
            "moment": np.cross(nodes + displacement, pressing).sum(axis=0),
            "base_force": -reaction[base].sum(axis=0),
            "base_moment": -np.cross(below.nodes, reaction[base]).sum(axis=0),
            "contact_points": surface.nodes,
            "contact_forces": np.stack([np.bincount(around, each, len(surface.nodes)) for each in on_hats.T], axis=1),
            "displacement": displacement,
            "mesh": mesh,
        },
    )


def _place_points(layout: DisplacementNodes) -> tuple[TopPoints, FloatArray]:
    """Place quadrature points on the f facets of the top that face the indenter, along z.

    Returns:
        The points, in the frame and unit of the elements, and their areas, shape (f, q) [units of area].
    """
    nodes, count = layout.elements.nodes, layout.top.shape[1]
    place, weight = quadrature(count)
    vectors = area_vectors(nodes, layout.top, place) * weight[:, None]
    areas = np.linalg.norm(vectors, axis=2)
    facing = (vectors[..., 2] > _SETTINGS.least_cosine * areas).all(axis=1)
    facets, shape = layout.top[facing], facet_shape(count, place)
    points = TopPoints(
        shape=np.broadcast_to(shape, (len(facets), *shape.shape)),
        nodes=facets,
        position=np.einsum("qa,fac->fqc", shape, nodes[facets]),
        weight=vectors[facing][..., 2],
    )
    return points, areas[facing]


def _combine(
    accurate: Indentation,
    small: Sequence[_Small],
    full: Sequence[_Full],
    problem: PressProblem,
    assumptions: Mapping[str, str],
) -> Indentation:
    """Correct a press at finite strain for its discretisation error, and estimate the remaining error.

    Args:
        accurate: Result at small strain, from the finest mesh.
        small: Small-strain solutions on the coarser meshes.
        full: Solutions at finite strain on the same meshes.
        problem: Texels, and whether the load or the depth is prescribed.
        assumptions: Statements about the result, by topic.
    """
    shares = np.array([f.texel_forces / f.load - s.texel_forces / s.load for f, s in zip(full, small, strict=True)])
    stiffer = np.array([(f.load / f.depth) / (s.load / s.depth) for f, s in zip(full, small, strict=True)])
    texels, by_load, last = problem.array, problem.control == "load", full[-1]
    load, depth = accurate.total_force, accurate.depth
    if by_load:
        depth /= stiffer[-1]
    else:
        load *= stiffer[-1]
    texel_forces = np.where(texels.active, accurate.texel_forces / accurate.total_force + shares[-1], 0.0) * load
    areas = np.array([each.area for each in full])
    added = {
        "peak_texel": _estimate_effect(shares) * load / float(np.abs(texel_forces).max()),
        "misplaced_force": _estimate_effect(shares, summed=True) / 2,
        "texel_sum": _estimate_effect(shares.sum(axis=1)) * load / abs(float(texel_forces.sum())),
        "depth" if by_load else "total_force": _estimate_effect(stiffer - 1),
        "contact_area": _estimate_effect(areas - areas.mean()) / areas[-1],
    }
    errors = {name: error + added.get(name, 0.0) for name, error in accurate.error_estimate.items()}
    forces = ("force", "moment", "base_force", "base_moment", "contact_forces")
    scaled = {name: load / last.load * last.arrays[name] for name in forces}
    return replace(
        accurate,
        **(last.arrays | scaled),
        texel_forces=texel_forces,
        unmeasured=scaled["base_force"] + texel_forces @ texels.normals,
        total_force=load,
        balance=measure_balance(scaled["force"], scaled["base_force"]),
        depth=depth,
        contact_area=last.area,
        energy=None,
        error_estimate=errors,
        assumptions={**accurate.assumptions, **assumptions},
        warnings=warn_of_all(errors),
    )


def _estimate_effect(values: FloatArray, *, summed: bool = False) -> float:
    """Estimate the error of the effect of finite strain on the finest mesh.

    Args:
        values: Effect on one or n quantities on each mesh on which finite strain was solved, coarsest first, shape
            (meshes,) or (meshes, n).
        summed: Whether to return the sum of the errors of the n quantities instead of the largest error.
    """
    size = np.sum if summed else np.max
    if len(values) == 1:
        return _SETTINGS.one_mesh * float(size(np.abs(values)))
    return _SETTINGS.safety * float(size(np.abs(values[-1] - values[-2])))
