"""Press a rigid indenter on a curved cover from any direction at small strain, frictionless or without slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from fem_reference.curved_cover.compliance import NormalCompliance
from fem_reference.curved_cover.contact import ContactForces, explain_miss, find_touch
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.grid_press import GridPress
from fem_reference.curved_cover.no_slip import STEPS, StickingPress
from fem_reference.curved_cover.pressure_shapes import GapSampler
from fem_reference.curved_cover.responses import build_solid, check_meshes, estimate_error, texel_responses
from meshes import Indenter, Material, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose
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
#: Estimated error above which a warning names it [-].
_LARGE_ERROR = 0.05
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


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedIndentation:
    """Result of a press on a curved cover, on the finest mesh.

    Attributes:
        texel_forces: Force on each of n texels along its own normal, 0 on inactive ones, shape (n,) [N].
        force: Force of the indenter on the cover, shape (3,) [N].
        moment: Moment of this force about the origin of the array's frame, shape (3,) [N m].
        base_force: Force of the cover on its base, from the reactions; equals `force`, shape (3,) [N].
        base_moment: Moment of this force about the origin, shape (3,) [N m].
        unmeasured: `base_force` less the sum of the texel forces along their normals, as a vector: force beside the
            texels and shear along them, shape (3,) [N].
        load: Component of `force` along the direction of motion [N].
        depth: Distance that the indenter moved since it first touched the undeformed top [m].
        contact_area: Area of the top that belongs to the nodes in contact; resolved to an element [m2].
        top: Top of the cover.
        contact_forces: Force of the contact pressure around each of the m nodes of the top, against the normals, never
            negative, shape (m,) [N].
        shear: Force of the indenter on the cover across the normal around each of these nodes, shape (m, 3) [N]; None
            without friction.
        displacement: Displacements of the displacement nodes of the solid; those of the mesh come first, shape
            (nodes, 3) [m].
        mesh: Finest mesh.
        error_estimate: Estimated relative errors by name, nan with one mesh: `texel_forces` (largest error of a texel
            over the largest texel force), `misplaced_force` (half the sum of the errors of all texels over the load),
            `total_force` of all texels, `contact_area`, and `depth` under a given load or `load` at a given depth; the
            last two are nan where the contact is narrower than the elements, and a warning says so [-].
        assumptions: What was assumed.
        warnings: What limits the result.
    """

    texel_forces: FloatArray
    force: FloatArray
    moment: FloatArray
    base_force: FloatArray
    base_moment: FloatArray
    unmeasured: FloatArray
    load: float
    depth: float
    contact_area: float
    top: FacetSurface
    contact_forces: FloatArray
    displacement: FloatArray
    mesh: SolidMesh
    error_estimate: Mapping[str, float]
    assumptions: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    shear: FloatArray | None = None

    @property
    def total_force(self) -> float:
        """The load, under the name that it has on flat covers [N]."""
        return self.load

    @property
    def balance(self) -> float:
        """Difference between the forces on base and cover along the motion, over the load [-]."""
        return float((self.base_force - self.force) @ self.force / (self.load * np.linalg.norm(self.force)))

    @property
    def outside(self) -> float:
        """Zero: the force beside the texels is the vector `unmeasured` [N]."""
        return 0.0


def press_curved(
    meshes: SolidMesh | Sequence[SolidMesh],
    texels: TexelArray,
    material: Material,
    indenter: Indenter,
    pose: Pose,
    *,
    load: float | None = None,
    depth: float | None = None,
    direction: npt.ArrayLike | None = None,
    friction: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> CurvedIndentation:
    """Press a rigid indenter on a curved cover.

    The indenter moves from its pose along the direction until it touches, and on until load or depth are reached.

    Args:
        meshes: Mesh of the cover, or two or three meshes of it from coarse to fine for an error estimate.
        texels: Texels on the base of the meshes.
        material: Material; hyperelastic materials are linearised at zero load.
        indenter: The indenter.
        pose: Orientation of the indenter, and a position on its way.
        load: Force along the direction [N]; give either load or depth.
        depth: Distance from the first touch [m].
        direction: Direction of motion, any length, shape (3,); that in which the indenter looks if None.
        friction: 0, or inf for no slip [-].
        progress: Called with a line of text before each solution.

    Raises:
        ValueError: If input is missing or wrong, or the indenter never touches.
        PiercedError: If the indenter would go through most of the cover.
        ConvergenceError: If the contact or the load is not found.
    """
    target, control = choose_target(load, depth)
    towards = pose.towards if direction is None else np.array(direction, dtype=float)
    towards = towards / np.linalg.norm(towards)
    if friction not in (0.0, np.inf):
        raise ValueError(f"friction on curved covers must be 0, or inf for no slip; not {friction}")
    every = check_meshes(meshes)
    responses = texel_responses(every, texels, material, progress=progress)
    found, texel_forces, depths = [], [], []
    for mesh, grid in zip(every, responses.grids, strict=True):
        if progress is not None:
            progress(f"contact, {build_compliance(mesh, material).solid.unknowns} unknowns")
        path = _begin(mesh, material, (indenter, pose), towards, sticks=friction > 0)
        contact = path.to(target, control)
        found.append(contact)
        depths.append(contact.travel - path.touch)
        texel_forces.append(grid.texel_forces(contact.nodal))
    errors = _estimate(every, np.array(texel_forces), found, depths, control)
    if isinstance(path, StickingPress):
        rough = path.to(target, control, STEPS // 2)
        changed = grid.texel_forces(rough.nodal - contact.nodal)
        _add_step_error(errors, changed, texel_forces[-1], (rough, contact), path.touch)
    share = depths[-1] / measure_thickness(mesh)
    large = f"the depth is {100 * share:.3g} % of the thickness: strains are not small; solve at finite strain"
    warnings = ((large,) if share > _WARN_DEPTH else ()) + warn_of_errors(errors)
    values = np.where(texels.active, texel_forces[-1], 0.0)
    return _collect(build_compliance(mesh, material), found[-1], depths[-1], values, texels, mesh, errors, warnings)


def _begin(
    mesh: SolidMesh, material: Material, body: tuple[Indenter, Pose], towards: FloatArray, *, sticks: bool
) -> GridPress:
    """Prepare the contact of an indenter in a pose that moves in a direction on one mesh, with or without slip."""
    compliance = build_compliance(mesh, material)
    touch = find_touch(compliance.top, *body, towards)
    if not np.isfinite(touch):
        raise ValueError(explain_miss(compliance.top, body[1], towards))
    deepest = LARGEST_DEPTH * measure_thickness(mesh)
    sampler = GapSampler(compliance.top, *body, towards, touch + deepest, deepest)
    return (StickingPress if sticks else GridPress)(compliance, sampler, towards, touch, deepest)


@lru_cache(maxsize=3)
def build_compliance(mesh: SolidMesh, material: Material) -> NormalCompliance:
    """Build the compliance of the top of a mesh; the last three are kept, with the nodes that touched so far."""
    return NormalCompliance(build_solid(mesh, material))


def choose_target(load: float | None, depth: float | None) -> tuple[float, Literal["load", "depth"]]:
    """Return the target and whether it is a load or a depth; raise a ValueError if it is neither or not positive."""
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth, not both")
    value = load if depth is None else depth
    if value is None or not np.isfinite(value) or value <= 0:
        raise ValueError(f"{'load' if depth is None else 'depth'} must be positive, not {value}")
    return float(value), "load" if depth is None else "depth"


def _estimate(
    meshes: tuple[SolidMesh, ...],
    texel_forces: FloatArray,
    contacts: list[ContactForces],
    depths: list[float],
    control: Literal["load", "depth"],
) -> dict[str, float]:
    """Estimate the relative errors of the results on the finest mesh, shape of the forces (meshes, texels)."""
    peak = max(float(np.abs(texel_forces[-1]).max()), np.finfo(float).tiny)
    single = {
        "total_force": texel_forces.sum(axis=1),
        "depth": np.array(depths),
        "load": np.array([each.load for each in contacts]),
        "contact_area": np.array([each.area for each in contacts]),
    }
    changes = np.abs(np.diff(texel_forces, axis=0))
    edge = contacts[-1].has_edge
    errors = {
        "texel_forces": _estimate_change(changes.max(axis=1), meshes, edge, _ONE_TEXEL) / peak,
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
        for name in ("depth", "load"):
            errors[name] = max(errors[name], singular * narrow if edge else _ROUND * narrow**2)
        if narrow > _UNRESOLVED:
            errors |= dict.fromkeys(("depth", "load", "contact_area"), float("nan"))
    errors.pop("load" if control == "load" else "depth")
    return errors


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
    errors["texel_forces"] += float(size.max() / max(np.abs(texel_forces).max(), np.finfo(float).tiny))
    errors["misplaced_force"] += float(size.sum() / 2 / fine.load)
    errors["total_force"] += abs(float(changed.sum() / texel_forces.sum()))
    errors["contact_area"] += abs(rough.area / fine.area - 1)
    if "depth" in errors:
        errors["depth"] += abs((rough.travel - touch) / (fine.travel - touch) - 1)
    else:
        errors["load"] += abs(rough.load / fine.load - 1)


def warn_of_errors(errors: Mapping[str, float]) -> tuple[str, ...]:
    """State in words which estimated errors are large, and what is not resolved."""
    large = [f"{name.replace('_', ' ')} {value:.0%}" for name, value in errors.items() if value > _LARGE_ERROR]
    out = [f"large estimated error: {', '.join(large)}"] if large else []
    if np.isnan(errors["contact_area"]) and not np.isnan(errors["texel_forces"]):
        other = "depth" if "depth" in errors else "load"
        out.append(
            f"the contact is narrower than the elements of the cover: {other} and contact area are not resolved, the "
            "texel forces are; press harder, use a larger indenter or a finer mesh"
        )
    return tuple(out)


def _estimate_change(changes: FloatArray, meshes: tuple[SolidMesh, ...], has_edge: bool, safety: float) -> float:
    """Estimate the error on the finest mesh from the changes between successive meshes, shape (meshes - 1,)."""
    if len(changes) == 0:
        return float("nan")
    if len(changes) == 1:
        return _TWO_MESHES * float(changes[0])
    finer = (len(meshes[1].cells) / len(meshes[2].cells)) ** (1 / 3)
    decrease = 1.0 if has_edge else finer**_SMOOTH
    return safety * max(decrease * float(changes[0]), float(changes[1]))


def _collect(  # noqa: PLR0917
    compliance: NormalCompliance,
    contact: ContactForces,
    depth: float,
    texel_forces: FloatArray,
    texels: TexelArray,
    mesh: SolidMesh,
    errors: Mapping[str, float],
    warnings: tuple[str, ...],
) -> CurvedIndentation:
    """Solve for the displacements and the reactions under the contact forces, and collect the result."""
    solid, top = compliance.solid, compliance.top
    nodal = np.zeros_like(solid.nodes)
    nodal[top.index] = contact.nodal
    displacement, reaction = solid.solve_fully(nodal)
    base_force = -reaction.sum(axis=0)
    return CurvedIndentation(
        texel_forces=texel_forces,
        force=nodal.sum(axis=0),
        moment=np.cross(solid.nodes, nodal).sum(axis=0),
        base_force=base_force,
        base_moment=-np.cross(solid.nodes[solid.base], reaction).sum(axis=0),
        unmeasured=base_force + texel_forces @ texels.normals,
        load=contact.load,
        depth=depth,
        contact_area=contact.area,
        top=top,
        contact_forces=contact.forces,
        displacement=displacement,
        mesh=mesh,
        error_estimate=errors,
        assumptions=_ASSUMPTIONS | {"friction": "none" if contact.shear is None else "no slip"},
        warnings=warnings,
        shear=contact.shear,
    )
