"""Press a rigid indenter into a solid cover from any direction: the solver of `SolidCover`.

At small strain the contact is frictionless, with friction or without slip (`local_contact`).  It is solved on every
mesh.

At finite strain it is frictionless.  The mesh is rotated into the frame of the indenter, with the point of first touch
at the origin, so that elements, contact at quadrature points and loading path are those of flat covers
(`fem_reference.finite_strain`).  The feasible element size is limited, so that the result is a correction.  On every
mesh except the finest the solution at finite strain is computed.  Its discretisation error is removed by the
solution at small strain with the same elements and quadrature points, and by that on cells.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.curved_cover.facet_surface import FacetSurface, quadrature
from fem_reference.curved_cover.local_contact import CellContact, CellPress
from fem_reference.curved_cover.penetration import check_penetration, measure_penetration, shape_error, warn_of_shape
from fem_reference.curved_cover.rays import explain_miss, find_touch, measure_gaps
from fem_reference.curved_cover.responses import (
    build_solid,
    find_top,
    project_texels,
    texel_responses,
)
from fem_reference.curved_cover.solid import DisplacementNodes
from fem_reference.errors import UnsupportedError
from fem_reference.finite_strain.axisymmetric_path import PENALTY
from fem_reference.finite_strain.contact import NormalContact, SurfaceContact, TopPoints
from fem_reference.finite_strain.contact_problem import ContactProblem
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import Control, Units, name_part, report
from fem_reference.grid_convergence import field_convergence, pool_errors
from fem_reference.indentation.finite_strain import choose_solid_fillet, state_rounding
from fem_reference.indentation.result import (
    Indentation,
    PressProblem,
    state_missed_accuracy,
    warn_of_errors,
)
from meshes import Cover, SolidCover
from meshes.array_types import FloatArray
from meshes.layer import Layers, scale_layers
from meshes.solids.facets import area_vectors, facet_shape
from meshes.solids.solid_mesh import SolidMesh, measure_thickness


@dataclass(frozen=True, kw_only=True)
class SolidPressSettings:
    """Constants of presses of an indenter into a solid cover, and of their error estimates."""

    #: Largest depth over the thickness that is solved [-].
    largest_depth: float = 0.8
    #: Depth over the thickness from which a warning states that strains are not small [-].
    warn_depth: float = 0.15
    #: Number of cells across the contact on each mesh, coarsest first [-].
    cells: tuple[int, ...] = (64, 96, 144)
    #: Factor on estimated errors of contacts at a border of the top, whose effect the lattice of the remainder does not
    #: resolve, and their smallest value for a contact narrower than the lattice [-].  The load of a ball on the border
    #: of a pad was 13 % too large.
    border: tuple[float, float] = (2.0, 0.25)
    #: Number of cells across the contact of a second solution on the finest mesh [-].
    rough: int = 96
    #: Smallest and largest order of convergence in error estimates: the smallest is that at a sharp edge [-].
    order: tuple[float, float] = (1.0, 3.0)
    #: The same for forces on texels, which are smooth functions of the contact [-].
    texel_order: tuple[float, float] = (1.5, 2.5)
    #: Smallest ratio of the element sizes of two meshes in error estimates [-].
    ratio: float = 1.4
    #: Smallest estimated relative error, from the splines of the remainder and the elements' local error [-].
    least: float = 3e-3
    #: Smallest estimated relative error of the contact area, whose edge is located within cells [-].
    least_area: float = 7e-3
    #: Smallest estimated relative error of the sum of the texels, and the same over the error of the peak texel; the
    #: change of the sum between two meshes may vanish by chance [-].
    least_sum: tuple[float, float] = (5e-3, 0.25)
    #: Smallest cosine between the normal of the top and the axis of the indenter at points that can touch, at finite
    #: strain [-].
    least_cosine: float = 0.05
    #: First step of the loading path at finite strain, over the difference between two depths [-]: the depth at which
    #: the first contact point touches, and the depth at small strain.
    first_step: float = 0.5
    #: Mean penetration of indenter and cover at finite strain, over the depth, below which augmentation stops [-].
    overlap: float = 0.002
    #: Estimated error of the effect of finite strain on one mesh, over the effect [-].
    one_mesh: float = 0.5
    #: Safety factor in the error of the effect of finite strain, on the difference of the effect between two meshes
    #: [-].
    safety: float = 1.5
    #: The same for the effect of friction [-].
    sticking: float = 1.5
    #: Numbers of cells along each axis and of steps of contacts with friction; the second solution only tells the error
    #: of the first [-].
    rubbing: tuple[tuple[int, int], ...] = ((64, 16), (48, 8))
    #: Smallest thickness of a layer over that of the cover at finite strain [-].  With 2.5 % the depth of a ball on a
    #: foil was wrong by 4 %, more than estimated; with 5 % by 0.2 %.
    thinnest: float = 0.045
    #: Gap in place of an infinite one at points that the indenter misses, over the thickness [-].
    far: float = 1e3


_SETTINGS = SolidPressSettings()

#: Assumptions of every press into a solid cover at small strain, by topic.
_ASSUMPTIONS = {
    "strain": "small strain; materials linearised at zero load",
    "motion": "the indenter moves along its direction and does not turn; forces across it are borne by its guide",
    "contact": "along the normals of the undeformed cover, on cells",
}

#: Warning about a contact that reaches the border of the part of the top that is solved.
_CUT_OFF = (
    "the contact wraps around the cover by more than 60 degrees: what lies beyond bears no force; press less, or with "
    "a smaller indenter"
)


def press_solid(cover: SolidCover, problem: PressProblem) -> list[Indentation]:
    """Press an indenter into a solid at every target of a problem, or read the results from the store.

    The indenter moves from its pose along the direction to first touch, and further to the load or depth.

    Raises:
        ValueError: If the cover cannot be meshed, or the indenter never touches.
        UnsupportedError: If finite strain is requested with friction, tilt or foils, or no mesh reaches the accuracy.
        PiercedError: If the indenter would go through most of the cover.
        ConvergenceError: If the contact or the load is not found.
    """
    finite = problem.strain == "finite"
    if problem.friction and finite:
        raise UnsupportedError(
            "on curved covers friction is computed at small strain only; write --strain small", "friction"
        )
    if finite and min(cover.thicknesses) < _SETTINGS.thinnest * cover.thickness:
        raise UnsupportedError(
            f"at finite strain layers thinner than {100 * _SETTINGS.thinnest:g} % of the cover are not resolved; write "
            "--strain small",
            "strain",
        )
    if finite and any(problem.pose.tilt):
        raise UnsupportedError(
            "at finite strain the indenter moves along its own axis; turn it to look along the direction", "tilt"
        )
    wanted = 1.0 if problem.accuracy is None else problem.accuracy
    if wanted < (least := _SETTINGS.least_area):
        raise UnsupportedError(f"no mesh reaches it: the smallest error that is stated here is {least:.2%}", "accuracy")
    meshes = cover.meshes(problem.progress)
    found = _press_targets(meshes, cover.layers, problem)
    if (
        problem.accuracy is not None
        and cover.refine is not None
        and max(max(each.error_estimate.values()) for each in found) > wanted
    ):
        report(problem.progress, f"{100 * wanted:.3g} % wanted: a finer mesh is added")
        found = _press_targets((*meshes[1:], cover.refine(cover.thicknesses)), cover.layers, problem)
    return found if problem.accuracy is None else [state_missed_accuracy(each, wanted) for each in found]


def _press_targets(meshes: tuple[SolidMesh, ...], layers: Layers, problem: PressProblem) -> list[Indentation]:
    """Press a solid to every target of a problem, or read the results from the store."""
    finite, out = problem.strain == "finite", []
    for target in problem.targets:
        started = time.perf_counter()

        def compute(target: float = target) -> tuple[int, Indentation]:
            solve = press_finite if finite else press_rubbing if problem.friction else press_small
            found = solve(meshes, layers, problem, target)
            number = next(k for k, mesh in enumerate(meshes) if mesh is found.mesh)
            return number, replace(found, mesh=None)

        inputs = {
            "meshes": [mesh.digest for mesh in meshes], "layers": layers, "texels": problem.array,
            "indenter": problem.indenter, "pose": problem.pose, problem.control: target,
            "friction": problem.friction, "finite": finite,
        }  # fmt: skip
        number, found = result_store.fetch("solid-press", inputs, compute)
        out.append(replace(found, mesh=meshes[number], seconds=time.perf_counter() - started))
    return out


def press_small(meshes: tuple[SolidMesh, ...], layers: Layers, problem: PressProblem, target: float) -> Indentation:
    """Press a solid to one target load or depth at small strain on every mesh; return the result of the finest mesh.

    Args:
        meshes: One mesh, or two or three from coarse to fine for an error estimate.
        layers: Layers of the cover; hyperelastic materials are linearised at zero load.
        problem: Texels, indenter, pose and friction.
        target: Load [N] or depth [m].
    """
    mesh, texels = meshes[-1], problem.array
    contact, texel_forces, texel_errors, depth, errors = _press_meshes(meshes, layers, problem, target)
    share = depth / measure_thickness(mesh)
    large = f"the depth is {100 * share:.3g} % of the thickness: strains are not small; solve at finite strain"
    carried = _carry(mesh, layers, contact.nodal)
    displacement, force, base_force = (carried[name] for name in ("displacement", "force", "base_force"))
    check_penetration(mesh, displacement, problem.indenter, problem.pose, travel=contact.travel, depth=depth)
    for name, part in (
        ("depth" if problem.control == "load" else "total_force", 1),
        ("peak_texel", 2),
        ("misplaced_force", 2),
    ):
        errors[name] += shape_error(mesh, depth) / part
    active = np.where(texels.active, texel_forces, 0.0)
    texel_errors += np.abs(active) * shape_error(mesh, depth) / 2
    return Indentation(
        **carried,
        texel_forces=active,
        texel_errors=np.where(texels.active, pool_errors(texel_errors, active), 0.0),
        total_force=contact.load,
        unmeasured=base_force + active @ texels.normals,
        balance=measure_balance(force, base_force),
        depth=depth,
        contact_area=contact.area,
        contact_points=contact.points,
        contact_forces=contact.forces,
        energy=float((contact.nodal * displacement[find_top(mesh).index]).sum()) / 2,
        error_estimate=errors,
        assumptions=_ASSUMPTIONS | {"friction": "none"},
        warnings=(
            *((large,) if share > _SETTINGS.warn_depth and problem.strain != "finite" else ()),
            *warn_of_shape(mesh, depth),
            *((_CUT_OFF,) if contact.is_cut else ()),
            *warn_of_errors(errors),
        ),
    )


def _carry(mesh: SolidMesh, layers: Layers, nodal: FloatArray) -> dict[str, Any]:
    """Solve a mesh under forces on the m nodes of its top, shape (m, 3) [N].

    Returns:
        Attributes of the result by name: displacements, and forces and moments on the cover and on its base.
    """
    solid, top = build_solid(mesh, layers), find_top(mesh)
    forces = np.zeros_like(solid.nodes)
    forces[top.index] = nodal
    displacement, reaction = solid.solve_fully(forces)
    return {
        "force": nodal.sum(axis=0),
        "moment": np.cross(top.nodes, nodal).sum(axis=0),
        "base_force": -reaction.sum(axis=0),
        "base_moment": -np.cross(solid.nodes[solid.base], reaction).sum(axis=0),
        "displacement": displacement,
        "mesh": mesh,
    }


def _press_meshes(
    meshes: tuple[SolidMesh, ...], layers: Layers, problem: PressProblem, target: float
) -> tuple[CellContact, FloatArray, FloatArray, float, dict[str, float]]:
    """Solve the contact without friction on every mesh.

    Returns:
        Contact, forces on the texels and their estimated errors [N], and depth [m] on the finest mesh, extrapolated to
        cells of size zero, and estimated relative errors by name.
    """
    control, responses = problem.control, texel_responses(meshes, problem.array, layers, progress=problem.progress)
    found, texel_forces, depths = [], [], []
    counts = _SETTINGS.cells[-len(meshes) :]
    for mesh, grid, cells in zip(meshes, responses.grids, counts, strict=True):
        report(problem.progress, f"contact on {cells} cells across, {build_solid(mesh, layers).unknowns} unknowns")
        press = _begin(mesh, layers, problem, target, cells)
        contact = press.solve()
        found.append(contact)
        depths.append(contact.depth)
        texel_forces.append(grid.texel_forces(contact.nodal))
    errors = _estimate(np.array(texel_forces), found, depths, control)
    # Where an edge ends the contact, the error of the cells is proportional to their size.
    rough = press.solve(_SETTINGS.rough)
    more = _SETTINGS.rough / (counts[-1] - _SETTINGS.rough)
    moved = more * (contact.travel - rough.travel)
    factor = 1 + more * (contact.load - rough.load) / contact.load
    unsure = more * np.abs(grid.texel_forces(contact.nodal / contact.load - rough.nodal / rough.load)) / 2
    share = np.abs(texel_forces[-1]).max(initial=np.finfo(float).tiny) / contact.load
    changes = np.abs(texel_forces[-1] - texel_forces[0 if len(meshes) == 1 else -2])
    parts = changes / np.maximum(changes.max(), np.finfo(float).tiny)
    texel_errors = contact.load * (errors["peak_texel"] * share * parts + unsure)
    errors["peak_texel"] += float(unsure.max() / share)
    errors["misplaced_force"] += float(unsure.sum()) / 2
    errors["depth"] += abs(moved) / depths[-1] / 2
    errors["total_force"] += abs(factor - 1) / 2
    errors["depth" if control == "depth" else "total_force"] = 0.0
    contact = replace(
        contact,
        forces=factor * contact.forces,
        nodal=factor * contact.nodal,
        load=factor * contact.load,
        travel=contact.travel + moved,
    )
    return contact, factor * texel_forces[-1], texel_errors, depths[-1] + moved, errors


def _begin(mesh: SolidMesh, layers: Layers, problem: PressProblem, target: float, cells: int) -> CellPress:
    """Solve the contact without friction on a number of cells across the contact on one mesh."""
    solid, top = build_solid(mesh, layers), find_top(mesh)
    return CellPress.begin(
        solid, top, problem.indenter, problem.pose, _require_touch(top, problem),
        target=target, control=problem.control, deepest=_SETTINGS.largest_depth * measure_thickness(mesh), cells=cells,
    )  # fmt: skip


def _require_touch(top: FacetSurface, problem: PressProblem) -> float:
    """Return the travel to first touch [m].

    Raises:
        ValueError: If the indenter never touches.
    """
    touch = find_touch(top, problem.indenter, problem.pose)
    # An indenter that begins beyond the top has passed it, unless it overlaps the top, as a tilted one may.
    passed = touch < -np.ptp(top.nodes @ problem.pose.towards)
    inside = measure_penetration(problem.indenter, problem.pose.points_to_indenter(top.nodes)).max()
    if touch == np.inf or (passed and inside <= 0):
        raise ValueError(explain_miss(top, problem.pose))
    return touch


def _estimate(
    texel_forces: FloatArray, contacts: Sequence[CellContact], depths: Sequence[float], control: Control
) -> dict[str, float]:
    """Estimate the relative errors of the results on the finest mesh.

    Args:
        texel_forces: Forces on the n texels on each of m meshes, from coarse to fine, shape (m, n) [N].
        contacts: Contact on each mesh.
        depths: Depth on each mesh [m].
        control: Whether the load or the depth is prescribed; the error of the prescribed one is zero.

    Returns:
        Estimated relative errors by name of the result [-]; NaN with one mesh.
    """
    last = contacts[-1]
    values = {
        "peak_texel": texel_forces,
        "total_force": [each.load for each in contacts],
        "depth": depths,
        "contact_area": [each.area for each in contacts],
        "texel_sum": texel_forces.sum(axis=1),
    }
    scales = {"peak_texel": max(float(np.abs(texel_forces[-1]).max()), np.finfo(float).tiny)}
    errors = dict.fromkeys((*values, "misplaced_force"), float("nan"))
    if len(contacts) > 1:
        sizes = [each.size for each in contacts]
        for k in range(len(sizes) - 2, -1, -1):
            sizes[k] = max(sizes[k], _SETTINGS.ratio * sizes[k + 1])
        for name, each in values.items():
            least, most = _SETTINGS.texel_order if "texel" in name else _SETTINGS.order
            error = field_convergence(each, sizes, least=least, most=most)
            scale = scales[name] if name in scales else abs(float(each[-1]))
            factor, border = _SETTINGS.border if last.at_border else (1.0, 0.0)
            errors[name] = max(factor * error / scale, border * last.at_border, _SETTINGS.least)
        changes = np.abs(texel_forces[-1] - texel_forces[-2])
        widespread = float(changes.sum() / max(changes.max(), np.finfo(float).tiny)) / 2
        # The area follows the travel and the load.
        errors["contact_area"] = max(
            errors["contact_area"], errors["depth"], errors["total_force"], _SETTINGS.least_area
        )
        least_sum, share = _SETTINGS.least_sum
        errors["texel_sum"] = max(errors["texel_sum"], least_sum, share * errors["peak_texel"])
        errors["misplaced_force"] = errors["peak_texel"] * scales["peak_texel"] * max(widespread, 1.0) / last.load
    return errors | {"total_force" if control == "load" else "depth": 0.0}


def measure_balance(force: FloatArray, base_force: FloatArray) -> float:
    """Return the difference between the force on the base and the force on the cover, over the force on the cover [-].

    The difference is taken along the force on the cover.
    """
    return float((base_force - force) @ force / (force @ force))


def press_finite(meshes: tuple[SolidMesh, ...], layers: Layers, problem: PressProblem, target: float) -> Indentation:
    """Press a solid to one target load or depth at finite strain, along the axis of the indenter and without friction.

    The arrays of the result are those of the finest mesh solved at finite strain, the second finest of several meshes.
    Texel forces, and depth or load, are corrected for its discretisation error.
    """
    accurate = press_small(meshes, layers, problem, target)
    pairs = []
    for number, mesh in enumerate(meshes[: max(1, len(meshes) - 1)], start=1):
        parts = [name_part(problem.progress, f"{each} strain, mesh {number}") for each in ("small", "finite")]
        small, full = (
            _press_mesh(mesh, layers, replace(problem, progress=tell), target, accurate.depth, linear=linear)
            for tell, linear in zip(parts, (True, False), strict=True)
        )
        pairs.append((small, full))
    materials = [each.material for each in scale_layers(layers, 1.0)]
    names = [f"neo-Hookean with the moduli of {m.name}" if m.small_strain_only else m.name for m in materials]
    thickness = measure_thickness(meshes[-1])
    assumptions = {
        "strain": f"finite strain, {' under '.join(dict.fromkeys(names))}; corrected for the mesh at small strain",
        "contact": "at quadrature points of the deformed top, along the normals of the indenter",
        **state_rounding(problem.indenter, choose_solid_fillet(thickness, problem.indenter)),
    }
    return _combine(accurate, pairs, problem, assumptions)


def press_rubbing(meshes: tuple[SolidMesh, ...], layers: Layers, problem: PressProblem, target: float) -> Indentation:
    """Press a solid with friction or without slip to one target load or depth at small strain.

    The effect of friction, from contacts without and with friction on the same cells, is added to the accurate contact
    without friction.
    """
    accurate = press_small(meshes, layers, replace(problem, friction=0.0), target)
    found: list[tuple[_Full, _Full]] = []
    for mesh in meshes:
        report(problem.progress, f"contact with friction, {build_solid(mesh, layers).unknowns} unknowns")
        press = _begin(mesh, layers, problem, target, _SETTINGS.cells[0])
        grids = _SETTINGS.rubbing if mesh is meshes[-1] else _SETTINGS.rubbing[:1]
        describe = partial(_describe, mesh, layers, problem)
        found.extend((describe(smooth), describe(rubs)) for smooth, rubs in press.rub(problem.friction, grids))
    *found, rough = found
    law = "no slip" if np.isinf(problem.friction) else f"Coulomb, coefficient {problem.friction:g}"
    return _combine(accurate, found, problem, {"friction": law}, rough=rough)


def _describe(mesh: SolidMesh, layers: Layers, problem: PressProblem, contact: CellContact) -> _Full:
    """Describe a contact on the cells of one mesh."""
    return _Full(
        texel_forces=texel_responses([mesh], problem.array, layers).finest.texel_forces(contact.nodal),
        load=contact.load,
        depth=contact.depth,
        area=contact.area,
        arrays=_carry(mesh, layers, contact.nodal)
        | {"contact_points": contact.points, "contact_forces": contact.forces},
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Full:
    """Solution on one mesh, in the frame of the array.

    Attributes:
        texel_forces: Force on each of n texels, shape (n,) [N].
        load: Force along the motion [N].
        depth: Depth [m].
        area: Contact area [m2].
        arrays: Attributes of the result by name; shapes and units as in `Indentation`.
    """

    texel_forces: FloatArray
    load: float
    depth: float
    area: float
    arrays: dict[str, Any]


def _press_mesh(
    mesh: SolidMesh, layers: Layers, problem: PressProblem, target: float, expected: float, *, linear: bool
) -> _Full:
    """Solve one press on one mesh with contact at quadrature points, at finite or at small strain.

    Args:
        mesh: Mesh of the cover.
        layers: Layers of the cover.
        problem: Indenter, pose and texels.
        target: Load [N] or depth [m].
        expected: Depth at small strain [m], whose part is the first step.
        linear: Whether to solve at small strain, as `press_small` but with the contact condition of finite strain.
    """
    indenter, pose = problem.indenter, problem.pose
    cover = Cover(layers=scale_layers(layers, measure_thickness(mesh)))
    units = Units.of(cover)
    surface, turn = find_top(mesh), pose.rotation.T
    touch = find_touch(surface, indenter, pose)
    origin = pose.position - touch * pose.rotation[:, 2]
    layout = DisplacementNodes.on(replace(mesh, nodes=(mesh.nodes - origin) @ turn.T / units.length), layers)
    elements, count = layout.elements, layout.elements.nodes.size
    points, areas, normals = _place_points(layout)
    base = np.unique(layout.base)

    def measure_gap(depth: float) -> FloatArray:
        """Measure the gaps along the normals, over their vertical components; large where the indenter is missed."""
        places = (points.position.reshape(-1, 3) + np.array([0.0, 0.0, depth])) * units.length
        deepest = _SETTINGS.largest_depth * units.length
        gaps = measure_gaps(indenter, places, normals.reshape(-1, 3), behind=deepest).reshape(areas.shape)
        return np.where(np.isfinite(gaps), gaps, _SETTINGS.far * units.length) / units.length / normals[..., 2]

    solid = Solid.from_cover(elements, cover, units)
    top = IndenterSurface(
        indenter=indenter, fillet=choose_solid_fillet(units.length, indenter) / units.length, unit=units.length
    )
    kind = partial(NormalContact, measure_gap, normals) if linear else SurfaceContact
    penalty = PENALTY / min(1.0, float(np.sqrt(areas.sum(axis=1).mean())))
    path = ContactProblem(
        solid=solid.linearise_at_rest() if linear else solid,
        contact=kind(elements, 0.0, top, penalty=penalty, points=points),
        constrained=(3 * base[:, None] + np.arange(3)).ravel(),
        units=units,
        overlap=_SETTINGS.overlap,
    )
    goal = target / (units.force if problem.control == "load" else units.length)
    least = float(measure_gap(0.0).min())
    first = least + _SETTINGS.first_step * (expected / units.length - least)
    reached = path.follow([goal], control=problem.control, first=first, progress=problem.progress)[0]
    contact = reached.contact
    nodes = mesh.nodes
    displacement, reaction, pressing = (
        each[:count].reshape(-1, 3) @ turn * unit
        for each, unit in (
            (reached.state, units.length), (reached.reaction, units.force), (contact.force, -units.force)
        )
    )  # fmt: skip
    # The force at a point follows the normal, whose component along the motion is 1.
    vectors = -(contact.pressure * contact.weight)[..., None] * (contact.normal @ turn) * units.force
    touching = contact.pressure > 0
    places = points.position[touching] * units.length @ turn + origin
    below = FacetSurface.part_of(nodes, mesh.base)
    texels = problem.array
    return _Full(
        texel_forces=np.einsum("nb,bc,nc->n", project_texels(below, texels), reaction[base], texels.normals),
        load=reached.load * units.force,
        depth=reached.depth * units.length,
        area=float(areas[touching].sum()) * units.length**2,
        arrays={
            "force": pressing.sum(axis=0),
            "moment": np.cross(nodes + displacement, pressing).sum(axis=0),
            "base_force": -reaction[base].sum(axis=0),
            "base_moment": -np.cross(below.nodes, reaction[base]).sum(axis=0),
            "contact_points": places,
            "contact_forces": vectors[touching],
            "displacement": displacement,
            "mesh": mesh,
        },
    )


def _place_points(layout: DisplacementNodes) -> tuple[TopPoints, FloatArray, FloatArray]:
    """Place quadrature points on the f facets of the top that face the indenter, along z.

    Returns:
        The points, in the frame and unit of the elements, their areas, shape (f, q) [units of area], and their unit
        normals, shape (f, q, 3) [-].
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
    return points, areas[facing], vectors[facing] / areas[facing][..., None]


def _combine(
    accurate: Indentation,
    pairs: Sequence[tuple[_Full, _Full]],
    problem: PressProblem,
    assumptions: Mapping[str, str],
    *,
    rough: tuple[_Full, _Full] | None = None,
) -> Indentation:
    """Correct a press at finite strain or with friction for its discretisation error, and estimate the remaining error.

    Args:
        accurate: Result without friction at small strain, from the finest mesh.
        pairs: Solutions on some meshes, coarsest first: without friction at small strain, and that of the problem.
        problem: Texels, and whether the load or the depth is prescribed.
        assumptions: Statements about the result, by topic.
        rough: Last pair on fewer cells and in fewer steps.
    """
    texels, by_load, last = problem.array, problem.control == "load", pairs[-1][1]
    shares, stiffer, wider = (np.array(each) for each in zip(*(_compare(*pair) for pair in pairs), strict=True))
    load, depth = accurate.total_force, accurate.depth
    if by_load:
        depth /= stiffer[-1]
    else:
        load *= stiffer[-1]
    texel_forces = np.where(texels.active, accurate.texel_forces / accurate.total_force + shares[-1], 0.0) * load
    safety = _SETTINGS.safety if rough is None else _SETTINGS.sticking
    peak, whole = float(np.abs(texel_forces).max()) / load, abs(float(texel_forces.sum())) / load
    unsure = _estimate_effect(shares, safety)
    added = {
        "peak_texel": float(unsure.max()) / peak,
        "misplaced_force": float(unsure.sum()) / 2,
        "texel_sum": float(_estimate_effect(shares.sum(axis=1), safety)) / whole,
        "depth" if by_load else "total_force": float(_estimate_effect(stiffer - 1, safety)),
        "contact_area": float(_estimate_effect(wider - 1, safety)),
    }
    if rough is not None:
        share, stiff, wide = _compare(*rough)
        change = np.abs(share - shares[-1])
        unsure = unsure + change
        added["peak_texel"] += float(change.max()) / peak
        added["misplaced_force"] += float(change.sum()) / 2
        added["texel_sum"] += abs(float((share - shares[-1]).sum())) / whole
        added["depth" if by_load else "total_force"] += abs(stiff - stiffer[-1])
        added["contact_area"] += abs(wide - wider[-1])
    small = np.asarray(accurate.texel_errors, dtype=float) / accurate.total_force
    unsure = pool_errors((small + unsure) * load, texel_forces)
    errors = {name: error + added.get(name, 0.0) for name, error in accurate.error_estimate.items()}
    kept = [each for each in accurate.warnings if each not in warn_of_errors(accurate.error_estimate)]
    forces = ("force", "moment", "base_force", "base_moment", "contact_forces")
    scaled = {name: load / last.load * last.arrays[name] for name in forces}
    return replace(
        accurate,
        **(last.arrays | scaled),
        texel_forces=texel_forces,
        texel_errors=np.where(texels.active, unsure, 0.0),
        unmeasured=scaled["base_force"] + texel_forces @ texels.normals,
        total_force=load,
        balance=measure_balance(scaled["force"], scaled["base_force"]),
        depth=depth,
        contact_area=accurate.contact_area * float(wider[-1]),
        energy=None,
        error_estimate=errors,
        assumptions={**accurate.assumptions, **assumptions},
        warnings=(*kept, *warn_of_errors(errors)),
    )


def _compare(small: _Full, full: _Full) -> tuple[FloatArray, float, float]:
    """Compare two solutions: change of the forces of texels over the load, and ratios of stiffness and area [-]."""
    shares = full.texel_forces / full.load - small.texel_forces / small.load
    return shares, (full.load / full.depth) / (small.load / small.depth), full.area / small.area


def _estimate_effect(values: FloatArray, safety: float) -> FloatArray:
    """Estimate the error of the effect of finite strain or of friction on the finest mesh.

    Args:
        values: Effect on one or n quantities on each mesh on which it was solved, coarsest first, shape
            (meshes,) or (meshes, n).
        safety: Safety factor on the difference between the two finest meshes [-].

    Returns:
        Errors, shape () or (n,).
    """
    if len(values) == 1:
        return np.asarray(_SETTINGS.one_mesh * np.abs(values[0]))
    return np.asarray(safety * np.abs(values[-1] - values[-2]))
