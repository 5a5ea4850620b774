"""Press a rigid indenter into a solid cover from any direction at small strain, frictionless or without slip."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from fem_reference.curved_cover.compliance import NormalCompliance
from fem_reference.curved_cover.contact import ContactForces, explain_miss, find_touch
from fem_reference.curved_cover.grid_press import GridPress
from fem_reference.curved_cover.no_slip import STEPS, StickingPress
from fem_reference.curved_cover.pressure_shapes import GapSampler
from fem_reference.curved_cover.responses import build_solid, estimate_error, texel_responses
from fem_reference.finite_strain.loading_path import Control
from fem_reference.indentation.problem import PressProblem
from fem_reference.indentation.result import Indentation, warn_of_errors
from meshes import Material, TexelArray
from meshes.array_types import FloatArray
from meshes.solids.solid_mesh import SolidMesh, measure_thickness

#: Largest depth over the thickness that is solved, and depth from which a warning states that strains are not small.
LARGEST_DEPTH, _WARN_DEPTH = 0.8, 0.15
#: Smallest order of convergence that error estimates of depth, load and area assume: that of a sharp edge [-].
_ORDER = 1.0
#: Smallest estimated errors of depth and load: the first times the distance of the nodes over half the smaller width of
#: the contact where a sharp edge ends the pressure, which is singular there, the second likewise without slip, and the
#: third times its square elsewhere.  Above the fourth, depth, load and area are not resolved: on flat pads the depth
#: was up to eight times too large [-].
_EDGE, _STICKING_EDGE, _ROUND, _UNRESOLVED = 0.25, 0.4, 0.13, 1.2
#: Order with which changes of texel forces between meshes decrease at least, unless a sharp edge ends the pressure:
#: then the error varies with the place of the edge on the mesh more than with the size of the elements [-].
_SMOOTH = 2.0
#: Safety factors on the largest change of texel forces between successive meshes: of one texel, and of half the sum
#: over all, with which 36 and 34 of 36 estimates covered the errors of presses on flat pads; of both with two meshes.
_ONE_TEXEL, _SUM, _TWO_MESHES = 2.5, 1.5, 3.0
#: Assumptions of every result.
_ASSUMPTIONS = {
    "strain": "small strain; materials linearised at zero load",
    "motion": "the indenter moves along its direction and does not turn; forces across it are borne by its guide",
    "contact": "along the normals of the undeformed cover, on average over the shapes of the pressure, which is linear "
    "between nodes",
}


def press_small(meshes: tuple[SolidMesh, ...], material: Material, problem: PressProblem, target: float) -> Indentation:
    """Press to one target at small strain, on every mesh; the result is that of the finest.

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
        if tell is not None:
            tell(f"contact, {build_compliance(mesh, material).solid.unknowns} unknowns")
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
    return _collect(
        build_compliance(mesh, material),
        found[-1],
        depth=depths[-1],
        texel_forces=np.where(texels.active, texel_forces[-1], 0.0),
        texels=texels,
        errors=errors,
        warnings=((large,) if share > _WARN_DEPTH else ()) + warn_of_all(errors),
    )


def _begin(mesh: SolidMesh, material: Material, problem: PressProblem) -> GridPress:
    """Prepare the contact on one mesh, with or without slip."""
    compliance, indenter, pose = build_compliance(mesh, material), problem.indenter, problem.pose
    touch = find_touch(compliance.top, indenter, pose, pose.towards)
    if not np.isfinite(touch):
        raise ValueError(explain_miss(compliance.top, pose, pose.towards))
    deepest = LARGEST_DEPTH * measure_thickness(mesh)
    sampler = GapSampler(compliance.top, indenter, pose, pose.towards, touch + deepest, deepest)
    kind = StickingPress if problem.friction else GridPress
    return kind(compliance, sampler, pose.towards, touch, deepest)


@lru_cache(maxsize=3)
def build_compliance(mesh: SolidMesh, material: Material) -> NormalCompliance:
    """Build the compliance of the top of a mesh; the last three are kept, with the nodes that touched so far."""
    return NormalCompliance(build_solid(mesh, material))


def _estimate(
    meshes: tuple[SolidMesh, ...],
    texel_forces: FloatArray,
    contacts: list[ContactForces],
    depths: list[float],
    control: Control,
) -> dict[str, float]:
    """Estimate the relative errors of the results on the finest mesh, shape of the forces (meshes, texels)."""
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
        "peak_texel": _estimate_change(changes.max(axis=1), meshes, edge, _ONE_TEXEL) / peak,
        "misplaced_force": _estimate_change(changes.sum(axis=1) / 2, meshes, edge, _SUM) / contacts[-1].load,
    }
    for name, values in single.items():
        errors[name] = estimate_error(values, meshes, least=_ORDER) / abs(float(values[-1]))
    last = contacts[-1]
    if len(meshes) > 1 and last.area > 0:
        # Half a node distance at the border of a round area, relative to the area.
        resolved = (1 + edge) * last.spacing / float(np.sqrt(last.area / np.pi))
        errors["contact_area"] = max(errors["contact_area"], resolved)
        narrow = last.spacing / last.half_width
        singular = _EDGE if last.shear is None else _STICKING_EDGE
        for name in ("depth", "total_force"):
            errors[name] = max(errors[name], singular * narrow if edge else _ROUND * narrow**2)
        if narrow > _UNRESOLVED:
            errors |= dict.fromkeys(("depth", "total_force", "contact_area"), float("nan"))
    return errors | {"total_force" if control == "load" else "depth": 0.0}


def _add_step_error(
    errors: dict[str, float],
    changed: FloatArray,
    texel_forces: FloatArray,
    contacts: tuple[ContactForces, ContactForces],
    touch: float,
) -> None:
    """Add to estimated errors what half the number of steps of the path changes; the error falls with their number."""
    rough, fine = contacts
    size = np.abs(changed)
    errors["peak_texel"] += float(size.max() / max(np.abs(texel_forces).max(), np.finfo(float).tiny))
    errors["misplaced_force"] += float(size.sum() / 2 / fine.load)
    errors["texel_sum"] += abs(float(changed.sum() / texel_forces.sum()))
    errors["contact_area"] += abs(rough.area / fine.area - 1)
    errors["depth"] += abs((rough.travel - touch) / (fine.travel - touch) - 1)
    errors["total_force"] += abs(rough.load / fine.load - 1)


def warn_of_all(errors: Mapping[str, float]) -> tuple[str, ...]:
    """State in words which estimated errors are large, and what is not resolved."""
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
    """Estimate the error on the finest mesh from the changes between successive meshes, shape (meshes - 1,)."""
    if len(changes) == 0:
        return float("nan")
    if len(changes) == 1:
        return _TWO_MESHES * float(changes[0])
    finer = (len(meshes[1].cells) / len(meshes[2].cells)) ** (1 / 3)
    decrease = 1.0 if has_edge else finer**_SMOOTH
    return safety * max(decrease * float(changes[0]), float(changes[1]))


def _collect(
    compliance: NormalCompliance,
    contact: ContactForces,
    *,
    depth: float,
    texel_forces: FloatArray,
    texels: TexelArray,
    errors: Mapping[str, float],
    warnings: tuple[str, ...],
) -> Indentation:
    """Solve for the displacements and the reactions under the contact forces, and collect the result."""
    solid, top = compliance.solid, compliance.top
    nodal = np.zeros_like(solid.nodes)
    nodal[top.index] = contact.nodal
    displacement, reaction = solid.solve_fully(nodal)
    force, base_force = nodal.sum(axis=0), -reaction.sum(axis=0)
    pressing = -contact.forces[:, None] * top.normals
    return Indentation(
        texel_forces=texel_forces,
        total_force=contact.load,
        force=force,
        moment=np.cross(solid.nodes, nodal).sum(axis=0),
        base_force=base_force,
        base_moment=-np.cross(solid.nodes[solid.base], reaction).sum(axis=0),
        unmeasured=base_force + texel_forces @ texels.normals,
        balance=measure_balance(force, base_force),
        depth=depth,
        contact_area=contact.area,
        contact_points=top.nodes,
        contact_forces=pressing if contact.shear is None else pressing + contact.shear,
        energy=float((nodal * displacement).sum()) / 2,
        mesh=solid.mesh,
        displacement=displacement,
        error_estimate=errors,
        assumptions=_ASSUMPTIONS | {"friction": "none" if contact.shear is None else "no slip"},
        warnings=warnings,
    )


def measure_balance(force: FloatArray, base_force: FloatArray) -> float:
    """Return how much the force on the base exceeds that on the cover along the latter, over it [-]."""
    return float((base_force - force) @ force / (force @ force))
