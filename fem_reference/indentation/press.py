"""Press a rigid indenter into a cover and compute the texel forces with error estimates.

Without friction, a cover of `linear-elastic` layers is solved at small strain and any other cover at finite strain;
`Indentation.assumptions` states the kind of strain.  Every indentation is solved on three grids, and the differences
between the grids give the error estimates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.loading_path import Control, LoadingPath
from fem_reference.indentation import finite_cover, finite_strain, no_slip, small_strain
from fem_reference.indentation.grid_solution import BaseForces, GridSolution, GridStudy, estimate_spread
from fem_reference.indentation.linear_fields import solve_linear_fields
from meshes import Cover, Indenter, TexelArray, TriangleMesh, tilt_indenter
from meshes.array_types import FloatArray
from meshes.pose import Place, PlanarPose

#: Depth over cover thickness above which a small-strain result is marked as outside its range.  At this depth the force
#: on a sphere agrees with the finite-strain force within 0.3 % [-].
_SMALL_STRAIN_DEPTH = 0.3
#: Relative error of a force per relative error of the depth.  The penetration that remains in the contact is an error
#: of the depth, and contact forces increase at most with the square of the depth [-].
_FORCE_PER_OVERLAP = 2.0
#: Estimated relative error above which a result has a warning [-].
_LARGE_ERROR = 0.05
#: Difference between the forces on the base and the load, over the load, above which a result has a warning [-].
_LARGE_IMBALANCE = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """Result of pressing one indenter into a cover at one load or depth.

    Attributes:
        texel_forces: Normal force on each of n texels, shape (n,) [N].
        outside: Force that acts on the base outside the active texels [N], computed independently of the load.
        total_force: Normal force on the indenter [N].
        balance: Sum of `texel_forces` and `outside` over `total_force`, minus 1 [-].
        depth: Approach of the indenter from first touch of the undeformed cover [m].
        contact_area: Contact area [m2].
        contact: Columns x, y in the frame of the array [m] and normal force [N] of m contact points, shape (m, 3).  The
            points are those of the finest grid and lie on the deformed cover: at small strain, cells without friction
            and nodes under a flat face without slip, else quadrature points.  Their forces, multiplied by one factor
            near 1, add up to `total_force`.
        shear: Components x and y, in the frame of the array, of the frictional force that the indenter exerts on the
            cover at these points, multiplied by the same factor, shape (m, 2) [N]; None without friction.
        energy: Elastic energy stored in the cover [J].  Without friction it equals the work of the load.
        fields: Displacement and stress in the cover, if they were asked for, on the finest mesh.
        error_estimate: Estimated relative errors of `total_force`, `depth`, `peak_texel` (the largest texel force) and
            `contact_area`; 0 for the prescribed one of force and depth [-].
        assumptions: Assumptions of the solution by topic, always with `strain`, `friction` and `base`.
        warnings: Sentences about large errors and other reasons not to rely on the result.
        seconds: Elapsed time of the computation, near zero for a stored result [s].
    """

    texel_forces: FloatArray
    outside: float
    total_force: float
    balance: float
    depth: float
    contact_area: float
    contact: FloatArray
    shear: FloatArray | None
    energy: float
    fields: CoverFields | None
    error_estimate: dict[str, float]
    assumptions: dict[str, str]
    warnings: tuple[str, ...]
    seconds: float


def press(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    load: float | None = None,
    depth: float | None = None,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    friction: float = 0.0,
    accuracy: float | None = None,
    fields: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Indentation:
    """Press a rigid indenter, guided along the normal of the array, into a cover.

    On a laterally wide cover the contact is the same at every position and orientation of the indenter, so one stored
    solution is used for all poses.  On a cover of limited size every pose is solved.  The indenter may extend beyond
    the side edges of the cover; contact is considered on the top only.

    Args:
        cover: Cover; solved at small strain if every layer is `linear-elastic`, else at finite strain.
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        load: Force along the normal of the array [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations of the indenter about the x and y axes of its frame, before the yaw, at most 10 degrees; see
            `tilt_indenter`.  The indenter stays guided along the normal; its depth counts from its first touch [rad].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip.  Slip depends on the
            loading history, so problems with friction are solved in small steps and take longer [-].
        accuracy: Wanted relative error.  Finer grids are added until all estimated errors are below it; a result that
            does not reach it has a warning that says why.  None for the usual three grids [-].
        fields: Whether the result has displacement and stress in the cover; results without fields are stored apart.
        progress: Called with a line of text before each solve.

    Returns:
        Forces, depth, contact area and their error estimates.

    Raises:
        ValueError: If not exactly one of load and depth is given, if it is not positive, if the indenter would pierce
            the cover, or if its axis is not over the cover.
        ConvergenceError: If the contact does not converge.
    """
    return press_path(
        cover,
        array,
        indenter,
        loads=None if load is None else [load],
        depths=None if depth is None else [depth],
        at=at,
        yaw=yaw,
        tilt=tilt,
        friction=friction,
        accuracy=accuracy,
        fields=fields,
        progress=progress,
    )[0]


def press_path(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    loads: Sequence[float] | None = None,
    depths: Sequence[float] | None = None,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    friction: float = 0.0,
    accuracy: float | None = None,
    fields: bool = False,
    progress: Callable[[str], None] | None = None,
) -> list[Indentation]:
    """Press a rigid indenter into a cover at several ascending loads or depths, one after the other; see `press`.

    Unloading is not computed.  Without friction it retraces the path of loading; with friction it does not.

    Args:
        cover: Cover, as for `press`.
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        loads: Ascending forces along the normal of the array [N].  Give either `loads` or `depths`.
        depths: Ascending approaches of the indenter from first touch [m].
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations of the indenter about the x and y axes of its frame, as for `press` [rad].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].
        accuracy: Wanted relative error, as for `press` [-].
        fields: Whether the results have displacement and stress in the cover.
        progress: Called with a line of text before each solve.

    Returns:
        One result per load or depth, in the same order.

    Raises:
        ValueError: As for `press`, or if loads or depths descend.
        ConvergenceError: As for `press`.
    """
    targets, control = _check_targets(cover, loads, depths)
    place = Place(array=array, pose=PlanarPose(at=(float(at[0]), float(at[1])), yaw=float(yaw)))
    _check_axis(cover, place.pose)
    if not friction >= 0:
        raise ValueError(f"a friction coefficient is zero, positive or inf (no slip), not {friction}")
    if accuracy is not None and not 0 < accuracy < 1:
        raise ValueError(f"an accuracy is a relative error between 0 and 1, such as 0.01, not {accuracy}")
    indenter = tilt_indenter(indenter, tilt)
    path = LoadingPath(
        cover=cover, indenter=indenter, targets=targets, control=control, friction=friction, fields=fields
    )
    finest = _count_refinements(path) if accuracy is not None else 0
    for refinement in range(finest + 1):
        results = _press_on_grids(path, place, progress, refinement)
        reached = max(max(each.error_estimate.values()) for each in results)
        if accuracy is None or reached <= accuracy:
            return results
        if progress is not None and refinement < finest:
            progress(f"estimated error {reached:.2%}, {accuracy:.2%} wanted: a finer grid is added")
    return [_state_missed_accuracy(each, accuracy or 0.0) for each in results]


def _press_on_grids(
    path: LoadingPath, place: Place, progress: Callable[[str], None] | None, refinement: int
) -> list[Indentation]:
    """Solve a loading path on three grids; `refinement` grids are skipped at the coarse end."""
    started = time.perf_counter()
    study = _study_path(path, place, progress, refinement)
    for grids in study.solutions:
        _check_depth(path.cover, grids[-1].depth)
    seconds = (time.perf_counter() - started) / len(path.targets)
    return [
        _combine_grids(study, grids, path, place, target=target, seconds=seconds)
        for grids, target in zip(study.solutions, path.targets, strict=True)
    ]


def _study_path(path: LoadingPath, place: Place, progress: Callable[[str], None] | None, refinement: int) -> GridStudy:
    """Solve a loading path on three grids by the solver for its strain, friction and cover."""
    small = path.cover.small_strain_only
    if small and not path.friction:
        return small_strain.study_path(path, place, progress, refinement)
    if small and np.isinf(path.friction) and path.indenter.is_flat:
        study = no_slip.study_path(path, place, progress)
        if study is not None:
            return study
    if path.cover.size is None:
        return finite_strain.study_path(path, progress, refinement)
    return finite_cover.study_path(path, place, progress)


def _count_refinements(path: LoadingPath) -> int:
    """Return how often the grids of a loading path can be refined."""
    if path.cover.small_strain_only and not path.friction:
        return small_strain.count_refinements(path)
    return finite_strain.count_refinements(path) if path.cover.size is None else 0


def _state_missed_accuracy(result: Indentation, accuracy: float) -> Indentation:
    """Add a warning to a result whose estimated errors exceed the wanted accuracy on the finest grids."""
    missed = [
        f"{name.replace('_', ' ')} {value:.2%}" for name, value in result.error_estimate.items() if value > accuracy
    ]
    if not missed:
        return result
    sentence = f"{accuracy:.2%} wanted, but the finest feasible grids reach {', '.join(missed)}"
    return replace(result, warnings=(*result.warnings, sentence))


def _combine_grids(
    study: GridStudy, grids: Sequence[GridSolution], path: LoadingPath, place: Place, *, target: float, seconds: float
) -> Indentation:
    """Combine the solutions of one target on three grids to the result for one pose.

    Args:
        study: Properties of the three grids.
        grids: Solutions of the target, coarsest grid first.
        path: Cover, indenter and friction.
        place: Array, and pose of the indenter.
        target: Load [N] or depth [m] that was asked for.
        seconds: Time that the solutions took [s].
    """
    started = time.perf_counter()
    # The base forces of each grid are computed once; they are needed for the result and for its error.
    grids = [replace(each, base_forces=_keep(each.base_forces(place.array, place.pose))) for each in grids]
    finest = grids[-1]

    def base_forces(solution: GridSolution) -> FloatArray:
        return solution.base_forces(place.array, place.pose)

    base = study.combine(grids, base_forces)
    texel_forces, outside = base[:-1], float(base[-1])
    peak = int(np.argmax(np.abs(texel_forces)))
    # A prescribed load is the one that was asked for, so that `balance` shows if a solver misses it.
    total = target if path.control == "load" else float(study.combine(grids, lambda each: each.total_force))
    balance = float(base.sum()) / total - 1
    overlap = max(finest.overlap, study.least_overlap)
    errors = {
        "total_force": study.estimate_error(grids, lambda each: each.total_force) + _FORCE_PER_OVERLAP * overlap,
        "depth": study.estimate_error(grids, lambda each: each.depth) + overlap,
        "peak_texel": study.estimate_error(grids, lambda each: float(base_forces(each)[peak]))
        + study.base_error
        + _FORCE_PER_OVERLAP * overlap
        + abs(balance),
        "contact_area": max(estimate_spread([each.area for each in grids]), study.least_error),
    }
    errors["total_force" if path.control == "load" else "depth"] = 0.0
    x, y, force = finest.contact.T
    scale = total / force.sum()
    turn = replace(place.pose, at=(0.0, 0.0))
    shear = None if finest.shear is None else np.column_stack(turn.to_array(*finest.shear.T)) * scale
    fields = _find_fields(finest, path, place, scale) if path.fields else None
    return Indentation(
        texel_forces=texel_forces,
        outside=outside,
        total_force=total,
        balance=balance,
        depth=float(study.combine(grids, lambda each: each.depth)),
        contact_area=finest.area,
        contact=np.column_stack([*place.pose.to_array(x, y), force * scale]),
        shear=shear,
        energy=float(study.combine(grids, lambda each: each.energy)),
        fields=fields,
        error_estimate=errors,
        assumptions=_state_assumptions(path, finest.depth) | study.assumptions,
        warnings=_warn(errors, balance),
        seconds=seconds + time.perf_counter() - started,
    )


def _keep(values: FloatArray) -> BaseForces:
    """Return a function that returns the same forces for the one array and pose that they were computed for."""
    return lambda _array, _pose: values


def _warn(errors: dict[str, float], balance: float) -> tuple[str, ...]:
    """State in words which estimated errors are large, and whether the forces on the base miss the load."""
    large = [f"{name.replace('_', ' ')} {value:.0%}" for name, value in errors.items() if value > _LARGE_ERROR]
    out = [f"large estimated error: {', '.join(large)}"] if large else []
    if abs(balance) > _LARGE_IMBALANCE:
        out.append(f"the forces on the base differ from the load by {balance:+.2%}")
    return tuple(out)


def _find_fields(finest: GridSolution, path: LoadingPath, place: Place, scale: float) -> CoverFields:
    """Return displacement and stress in the cover in the frame of the array, solved from the contact forces if absent.

    Args:
        finest: Solution on the finest grid.
        path: Cover and indenter.
        place: Array, and pose of the indenter.
        scale: Total force of the result over that of the contact forces [-].
    """
    if finest.fields is None:
        return solve_linear_fields(path, finest.contact * [1, 1, scale], place, depth=finest.depth)
    return finest.fields if path.cover.size is not None else finest.fields.to_array(place.pose)


def _state_assumptions(path: LoadingPath, depth: float) -> dict[str, str]:
    """State the assumptions about strain, friction, base and sides of the cover, and whether the depth is in range."""
    cover, friction = path.cover, path.friction
    law = "no slip" if np.isinf(friction) else f"Coulomb, coefficient {friction:g}" if friction else "frictionless"
    out = {"strain": "small" if cover.small_strain_only else "finite", "friction": law, "base": cover.base}
    if cover.size is not None:
        x, y = (1e3 * edge for edge in cover.size)
        out["sides"] = f"free, {x:.4g} x {y:.4g} mm, touched on top only"
    facets = path.indenter.measure_facets(depth) if isinstance(path.indenter, TriangleMesh) else 0.0
    if facets:
        out["facets"] = (
            f"pressed as they are, up to {facets * 1e3:.2g} mm ({facets / depth:.1%} of the depth) from the smooth "
            "surface that they stand for, which no error estimate contains"
        )
    share = depth / cover.thickness
    if cover.small_strain_only and share > _SMALL_STRAIN_DEPTH:
        out["range"] = f"indented to {share:.0%} of the thickness: more than small strain is meant for"
    return out


def _check_targets(
    cover: Cover, loads: Sequence[float] | None, depths: Sequence[float] | None
) -> tuple[tuple[float, ...], Control]:
    """Check the targets of a loading path; return them and whether they are loads or depths.

    Raises:
        ValueError: If both or neither of loads and depths are given, or if a value is not positive, not ascending, or a
            depth that exceeds the thickness of the cover.
    """
    if (loads is None) == (depths is None):
        raise ValueError("give either a load or a depth, not both")
    control: Control = "load" if depths is None else "depth"
    targets = tuple(float(value) for value in (loads if depths is None else depths) or ())
    if not targets:
        raise ValueError(f"give at least one {control}")
    for value in targets:
        if not np.isfinite(value) or value <= 0:
            raise ValueError(f"{control} must be positive, not {value}")
        if control == "depth":
            _check_depth(cover, value)
    if list(targets) != sorted(targets):
        raise ValueError(f"{control}s of one path must ascend, because unloading is not computed: {list(targets)}")
    return targets, control


def _check_depth(cover: Cover, depth: float) -> None:
    """Raise a ValueError if the indenter would pierce the cover."""
    if depth >= cover.thickness:
        raise ValueError(
            f"the indenter would pierce the cover: depth {depth * 1e3:.3g} mm of {cover.thickness * 1e3:.3g} mm; "
            "use less load, a wider indenter or a stiffer cover"
        )


def _check_axis(cover: Cover, pose: PlanarPose) -> None:
    """Raise a ValueError if the indenter's axis is not over the cover."""
    if cover.size is None or all(abs(a) <= edge / 2 for a, edge in zip(pose.at, cover.size, strict=True)):
        return
    x, y, width, height = (1e3 * value for value in (*pose.at, *cover.size))
    raise ValueError(
        f"the indenter's axis at ({x:.4g}, {y:.4g}) mm stands beside the cover, which measures {width:.4g} x "
        f"{height:.4g} mm around the array's middle"
    )
