"""Request and result of a press, the same for covers of every kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from fem_reference.finite_strain.loading_path import Control
from meshes import Indenter, Pose, TexelArray
from meshes.array_types import FloatArray

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from meshes.solids import SolidMesh

#: Kinds of strain that a user of `press` can request.
STRAINS = ("small", "finite")
#: Estimated relative error above which a result has a warning [-].
_LARGE_ERROR = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class PressProblem:
    """Request to a solver of presses: everything except the cover, with checked values.

    Attributes:
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        pose: Pose of the indenter, and direction of its motion.
        targets: Target loads [N] or depths [m], ascending.
        control: Whether the targets are loads or depths.
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].
        strain: Requested kind of strain; None for the default of the solver.
        accuracy: Wanted relative error; None for the usual grids [-].
        fields: Whether the results have displacement and stress in the cover.
        superposed: Whether finite strain and the sides of layers may be solved apart and added.
        as_far: Whether a path that stops early is solved again as far as all grids reach.
        progress: Called with a line of text before each solve; None for no reports.
    """

    array: TexelArray
    indenter: Indenter
    pose: Pose
    targets: tuple[float, ...]
    control: Control
    friction: float = 0.0
    strain: Literal["small", "finite"] | None = None
    accuracy: float | None = None
    fields: bool = False
    superposed: bool = False
    as_far: bool = True
    progress: Callable[[str], None] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """Result of pressing one indenter into a cover at one load or depth.

    Vectors are in the frame of the array.  Below, n is the number of texels and m the number of contact points.

    Attributes:
        texel_forces: Force on each texel along its own normal, shape (n,) [N]; 0 on inactive texels of a solid.
        outside: Force on the base of layers outside the active texels, computed independently of the load [N].  In
            three dimensions at finite strain or with friction it is the whole base reaction minus `texel_forces`.  On a
            solid it is 0; see `unmeasured`.
        texel_errors: Estimated errors of `texel_forces`, half widths of their 95 % intervals, shape (n,) [N].  A texel
            whose force changes little between the grids by chance gets the mean relative error of all.  NaN with one
            mesh; None if the solver estimates none.
        outside_error: The same for `outside` [N].
        total_force: Force on the indenter along its motion [N].
        force: Force of the indenter on the cover, shape (3,) [N].
        moment: Moment of `force` about the origin, shape (3,) [N m].
        base_force: Force of the cover on its base, shape (3,) [N]; on layers, its tangential components are those of
            `force`.
        base_moment: Moment of `base_force` about the origin, shape (3,) [N m]; None on layers.
        unmeasured: `base_force` less the sum of the texel forces along their normals, shape (3,) [N].
        balance: Forces on the base over `total_force` along the motion, minus 1 [-].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
        contact_area: Contact area; on a solid resolved to an element [m2].
        contact_points: Points of the contact, shape (m, 3) [m].  On layers they are those of the finest grid and lie on
            the deformed cover: cells at small strain without friction, nodes at small strain under a flat face without
            slip, else quadrature points.  On a solid they are the nodes of the undeformed top, most of which bear no
            force.
        contact_forces: Force of the indenter on the cover at each contact point, shape (m, 3) [N].
        energy: Elastic energy stored in the cover; without friction it equals the work of the load.  None for a solid
            at finite strain [J].
        fields: Displacement and stress in layers on the finest mesh, if requested; None where they are not available,
            with a sentence in `warnings`.
        mesh: Finest mesh of a solid; None on layers.
        displacement: Displacements of the displacement nodes of a solid, shape (nodes, 3) [m]; the nodes of the mesh
            come first.  None on layers.
        grid_values: Values on the three grids, coarsest first: `total_force` [N], `depth` [m], `peak_texel` [N],
            `contact_area` [m2], and `size`, the size of cells or elements, of which only ratios are used.
        error_estimate: Estimated relative errors of `total_force`, `depth`, `peak_texel` (the largest texel force) and
            `contact_area` [-]; 0 for the prescribed one of force and depth.  On a solid `peak_texel` is the largest
            error of any texel, `total_force` is the error of the sum of all texel forces under a given load, and
            `misplaced_force` is half the sum of the errors of all texels over the load.  An error is NaN with one mesh,
            or with a warning where the contact is narrower than the elements.
        assumptions: Assumptions of the solution by topic, always with `strain` and `friction`.
        warnings: Sentences about large errors and other reasons not to rely on the result.
        seconds: Elapsed time of the computation, near zero for a stored result [s].
    """

    texel_forces: FloatArray
    outside: float = 0.0
    texel_errors: FloatArray | None = None
    outside_error: float = 0.0
    total_force: float
    force: FloatArray
    moment: FloatArray
    base_force: FloatArray
    base_moment: FloatArray | None = None
    unmeasured: FloatArray
    balance: float
    depth: float
    contact_area: float
    contact_points: FloatArray
    contact_forces: FloatArray
    energy: float | None = None
    fields: CoverFields | None = None
    mesh: SolidMesh | None = None
    displacement: FloatArray | None = None
    error_estimate: Mapping[str, float]
    assumptions: Mapping[str, str]
    warnings: tuple[str, ...]
    seconds: float = 0.0
    grid_values: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def warn_of_errors(errors: Mapping[str, float]) -> tuple[str, ...]:
    """Return a warning that names the estimated relative errors above 5 %, by name of the result; empty without any."""
    large = [f"{name.replace('_', ' ')} {value:.0%}" for name, value in errors.items() if value > _LARGE_ERROR]
    return (f"large estimated error: {', '.join(large)}",) if large else ()


def state_missed_accuracy(result: Indentation, accuracy: float) -> Indentation:
    """Add a warning to a result whose estimated errors exceed the wanted accuracy on the finest grids."""
    errors = result.error_estimate.items()
    missed = [f"{name.replace('_', ' ')} {100 * value:.3g} %" for name, value in errors if value > accuracy]
    if not missed:
        return result
    sentence = f"{100 * accuracy:.3g} % wanted, but the feasible grids reach {', '.join(missed)}"
    return replace(result, warnings=(*result.warnings, sentence))
