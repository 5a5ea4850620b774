"""Press a rigid indenter into a cover and compute the texel forces with error estimates.

Without friction, a cover of `linear-elastic` layers is solved at small strain and any other cover at finite strain;
`Indentation.assumptions` states the kind of strain.  Every indentation is solved on three grids, and the differences
between the grids give the error estimates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fem_reference.errors import ConvergenceError, IncompletePathError, PiercedError
from fem_reference.finite_strain.loading_path import Control, LoadingPath
from fem_reference.indentation import finite_cover, finite_strain, no_slip, small_friction, small_strain
from fem_reference.indentation.grid_solution import GridStudy
from fem_reference.indentation.result import Indentation, combine_grids
from fem_reference.indentation.stopped_path import solve_as_far
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Cover, Indenter, Pose, TexelArray, tilt_indenter
from meshes.pose import Place

#: Pose above the middle of a flat array, along -z.
FLAT = Pose()
#: Depth over thickness that is stated as the largest where a load would pierce the cover [-].
_LARGEST_DEPTH = 0.98
#: Distance between a contact and the sides of the cover, over the decay length of the cover's response, above which the
#: sides are neglected at finite strain and with friction, by the base; and the error of the force that this leaves [-].
_FAR_SIDES, _SIDES_ERROR = {"bonded": 4.0, "sliding": 15.0}, 1e-3


def press(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    pose: Pose = FLAT,
    *,
    load: float | None = None,
    depth: float | None = None,
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
        pose: Position of the indenter's axis, yaw, and tilt of at most 10 degrees about either axis; see
            `tilt_indenter`.  The indenter stays guided along -z; its depth counts from its first touch.
        load: Force along the normal of the array [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip.  Slip depends on the
            loading history, so problems with friction are solved in small steps and take longer [-].
        accuracy: Wanted relative error.  Finer grids are added until all estimated errors are below it; a result that
            does not reach it has a warning that says why.  None for the usual three grids [-].
        fields: Whether the result has displacement and stress in the cover; results without fields are stored apart.
        progress: Called with a line of text before each solve.

    Returns:
        Forces, depth, contact area and their error estimates.

    Raises:
        ValueError: If not exactly one of load and depth is given, it is not positive, or the axis is off the cover.
        PiercedError: If the indenter would pierce the cover.
        IncompletePathError: If the solver stops before the load or depth; the error has the results of what it reached.
    """
    return press_path(
        cover,
        array,
        indenter,
        pose,
        loads=None if load is None else [load],
        depths=None if depth is None else [depth],
        friction=friction,
        accuracy=accuracy,
        fields=fields,
        progress=progress,
    )[0]


def press_path(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    pose: Pose = FLAT,
    *,
    loads: Sequence[float] | None = None,
    depths: Sequence[float] | None = None,
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
        pose: Pose of the indenter, as for `press`.
        loads: Ascending forces along the normal of the array [N].  Give either `loads` or `depths`.
        depths: Ascending approaches of the indenter from first touch [m].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].
        accuracy: Wanted relative error, as for `press` [-].
        fields: Whether the results have displacement and stress in the cover.
        progress: Called with a line of text before each solve.

    Returns:
        One result per load or depth, in the same order.

    Raises:
        ValueError: As for `press`, or if loads or depths descend.
        IncompletePathError: As for `press`.
    """
    targets, control = _check_targets(cover, loads, depths)
    if not pose.is_planar:
        raise ValueError(f"a flat cover is pressed along -z, not along {pose.direction}; tilt turns the indenter")
    place = Place(array=array, pose=replace(pose, tilt=(0.0, 0.0)))
    _check_axis(cover, place.pose)
    if not friction >= 0:
        raise ValueError(f"a friction coefficient is zero, positive or inf (no slip), not {friction}")
    if accuracy is not None and not 0 < accuracy < 1:
        raise ValueError(f"an accuracy is a relative error between 0 and 1, such as 0.01, not {accuracy}")
    indenter = tilt_indenter(indenter, pose.tilt)
    path = LoadingPath(
        cover=cover, indenter=indenter, targets=targets, control=control, friction=friction, fields=fields
    )
    return _refine(path, place, accuracy, progress)


def _refine(
    path: LoadingPath, place: Place, accuracy: float | None, progress: Callable[[str], None] | None
) -> list[Indentation]:
    """Solve a loading path, on finer and finer grids until the estimated errors are below a wanted accuracy.

    Args:
        path: Cover, indenter, targets and friction.
        place: Array, and pose of the indenter.
        accuracy: Wanted relative error; None for the first grids [-].
        progress: Called with a line of text before each step.
    """
    finest = _count_refinements(path, place) if accuracy is not None else 0
    best: list[Indentation] = []
    least = np.inf
    for refinement in range(finest + 1):
        try:
            solve = partial(_press_on_grids, place=place, progress=progress, refinement=refinement)
            finer = partial(_press_on_finer_grids, place=place, progress=progress, refinement=refinement)
            results = solve_as_far(path, solve, finer)
        except IncompletePathError:
            if not best:
                raise
            break  # the results of the coarser grids are complete
        reached = max(max(each.error_estimate.values()) for each in results)
        if accuracy is None or reached <= accuracy:
            return results
        if reached < least:  # the estimate need not fall from grid to grid
            best, least = results, reached
        if progress is not None and refinement < finest:
            progress(f"estimated error {100 * reached:.3g} %, {100 * accuracy:.3g} % wanted: a finer grid is added")
    return [_state_missed_accuracy(each, accuracy or 0.0) for each in best]


def _press_on_grids(
    path: LoadingPath, place: Place, progress: Callable[[str], None] | None, refinement: int
) -> list[Indentation]:
    """Solve a loading path on three grids; `refinement` grids are skipped at the coarse end."""
    started = time.perf_counter()
    study = _study_path(path, place, progress, refinement)
    for grids, target in zip(study.solutions, path.targets, strict=True):
        if grids[-1].depth >= path.cover.thickness:
            _refuse_load(path, place, target, grids[-1].depth)
    seconds = (time.perf_counter() - started) / len(path.targets)
    if path.fields and progress is not None:
        progress("displacement and stress in the cover")
    return [combine_grids(study, number, path, place, seconds=seconds) for number in range(len(path.targets))]


def _press_on_finer_grids(
    path: LoadingPath, place: Place, progress: Callable[[str], None] | None, refinement: int
) -> list[Indentation]:
    """Solve a loading path on the grids of one refinement more; raise a `ConvergenceError` if there are none."""
    if refinement >= _count_refinements(path, place):
        raise ConvergenceError("there are no finer grids")
    return _press_on_grids(path, place, progress, refinement + 1)


def _study_path(path: LoadingPath, place: Place, progress: Callable[[str], None] | None, refinement: int) -> GridStudy:
    """Solve a loading path on three grids by the solver for its strain, friction and cover."""
    small = path.cover.small_strain_only
    if small and not path.friction:
        return small_strain.study_path(path, place, progress, refinement)
    if _is_far_from_sides(path, place, progress):
        study = _study_path(replace(path, cover=replace(path.cover, size=None)), place, progress, refinement)
        return replace(
            study,
            least_error=max(study.least_error, _SIDES_ERROR),
            assumptions=study.assumptions | {"sides": "too far from the contact to matter"},
        )
    in_plane = path.cover.size is None and path.indenter.axisymmetric
    rubbing = None
    # Not in three dimensions at finite strain, where the effect of rounded edges on the correction would be larger.
    if np.isinf(path.friction) and path.indenter.is_flat and (small or in_plane):
        rubbing = no_slip.study_path(path, place, progress)
    if rubbing is None and path.friction and in_plane:
        rubbing = small_friction.study_path(path, progress, refinement)
    if rubbing is not None and small:
        return rubbing
    if rubbing is not None and max(each.depth for each in rubbing.solutions[-1]) >= path.cover.thickness:
        rubbing = None  # rubber bears loads at which the small-strain solution pierces the cover
    if path.cover.size is None:
        return finite_strain.study_path(path, progress, refinement, rubbing)
    return finite_cover.study_path(path, place, progress)


def _is_far_from_sides(path: LoadingPath, place: Place, progress: Callable[[str], None] | None) -> bool:
    """Return whether a contact with friction or at finite strain, simpler on a wide cover, is not changed by sides.

    Fields are asked for up to the sides, so a path with fields is solved with these.
    """
    cover = path.cover
    if cover.size is None or path.fields:
        return False
    wide = replace(cover, size=None)
    radius = np.hypot(*small_strain.estimate_contact(replace(path, cover=wide), None, progress).T).max()
    nearest = min(edge / 2 - abs(at) for edge, at in zip(cover.size, place.pose.at, strict=True))
    return bool(nearest - radius > _FAR_SIDES[cover.base] * decay_length(wide))


def _count_refinements(path: LoadingPath, place: Place) -> int:
    """Return how often the grids of a loading path can be refined."""
    if path.cover.small_strain_only and not path.friction:
        return small_strain.count_refinements()
    if _is_far_from_sides(path, place, None):
        path = replace(path, cover=replace(path.cover, size=None))
    if path.cover.small_strain_only and np.isinf(path.friction) and path.indenter.is_flat:
        return 0  # the grids of a face without slip are fixed
    if path.cover.small_strain_only and path.cover.size is None and path.indenter.axisymmetric:
        return small_friction.count_refinements()
    return finite_strain.count_refinements(path) if path.cover.size is None else 0


def _state_missed_accuracy(result: Indentation, accuracy: float) -> Indentation:
    """Add a warning to a result whose estimated errors exceed the wanted accuracy on the finest grids."""
    missed = [
        f"{name.replace('_', ' ')} {100 * value:.3g} %"
        for name, value in result.error_estimate.items()
        if value > accuracy
    ]
    if not missed:
        return result
    sentence = f"{100 * accuracy:.3g} % wanted, but the feasible grids reach {', '.join(missed)}"
    return replace(result, warnings=(*result.warnings, sentence))


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
    """Raise a PiercedError if a depth exceeds the thickness of the cover."""
    if depth >= cover.thickness:
        raise PiercedError(
            f"at a depth of {depth * 1e3:.4g} mm the indenter would pierce the cover; use less than its thickness, "
            f"{cover.thickness * 1e3:.4g} mm",
            "depth",
        )


def _refuse_load(path: LoadingPath, place: Place, load: float, depth: float) -> None:
    """Raise a PiercedError that states the load which the cover bears: without friction, at almost its thickness.

    Args:
        path: Cover and indenter.
        place: Array, and pose of the indenter.
        load: Load that pierces the cover [N].
        depth: Depth at this load [m].
    """
    most = _LARGEST_DEPTH * path.cover.thickness
    bare = replace(path, targets=(most,), control="depth", friction=0.0, fields=False)
    largest = small_strain.solve_path(bare, place, None)[0][-1].total_force
    raise PiercedError(
        f"{load:.4g} N would pierce the cover ({depth * 1e3:.3g} mm deep, the cover has "
        f"{path.cover.thickness * 1e3:.4g} mm); use at most {largest:.3g} N, a wider indenter or a stiffer cover",
        "load",
    )


def _check_axis(cover: Cover, pose: Pose) -> None:
    """Raise a ValueError if the indenter's axis is not over the cover."""
    if cover.size is None or all(abs(a) <= edge / 2 for a, edge in zip(pose.at, cover.size, strict=True)):
        return
    x, y, width, height = (1e3 * value for value in (*pose.at, *cover.size))
    raise ValueError(
        f"the indenter's axis at ({x:.4g}, {y:.4g}) mm stands beside the cover, which measures {width:.4g} x "
        f"{height:.4g} mm around the array's middle"
    )
