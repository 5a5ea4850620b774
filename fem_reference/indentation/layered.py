"""Press a rigid indenter into layers: the solver of `Cover`.

Without friction, a cover of `linear-elastic` layers is solved at small strain and any other cover at finite strain;
`Indentation.assumptions` states the kind of strain.  Every indentation is solved on three grids, and the differences
between the grids give the error estimates.  On a laterally wide cover the contact is the same at every position and
orientation of the indenter, so one stored solution is used for all poses.  On a cover of limited size every pose is
solved; the indenter may extend beyond its side edges, and contact is considered on the top only.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fem_reference.errors import (
    ConvergenceError,
    IncompletePathError,
    PathConvergenceError,
    PiercedError,
    TooShallowError,
    UnsupportedError,
)
from fem_reference.finite_strain.loading_path import Control, LoadingPath, Progress, report
from fem_reference.grid_convergence import pool_errors
from fem_reference.indentation import small_strain
from fem_reference.indentation.grid_solution import (
    GridSolution,
    GridStudy,
    correct_solution,
    estimate_spread,
    extrapolate_solutions,
)
from fem_reference.indentation.result import Indentation, PressProblem, state_missed_accuracy, warn_of_errors
from fem_reference.linear_response.surface_compliance import decay_length, membrane_length
from fem_reference.materials import describe_instability, warn_of_instability
from meshes import Cover, Indenter, tilt_indenter
from meshes.array_types import FloatArray
from meshes.pose import Place

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.finite_strain.contact_problem import SolvedPath

#: Function that returns a quantity of the solution on one grid, such as its total force [N].
Quantity = Callable[[GridSolution], float]

#: Depth over thickness at which the largest load is computed that an error message states if a load would pierce the
#: cover [-].
_LARGEST_DEPTH = 0.98
#: Depth over cover thickness above which a small-strain result is marked as outside its range.  At this depth the force
#: on a sphere agrees with the finite-strain force within 0.3 % [-].
_SMALL_STRAIN_DEPTH = 0.3
#: Relative error of a force per relative error of the depth.  The penetration that remains in the contact is an error
#: of the depth, and contact forces increase at most with the square of the depth [-].
_FORCE_PER_OVERLAP = 2.0
#: Smallest estimated relative error of a contact area: that of the measured area of a flat face [-].
_LEAST_AREA_ERROR = 2e-5
#: Difference between the forces on the base and the load, over the load, above which a result has a warning [-].
_LARGE_IMBALANCE = 1e-3
#: Last load or depth of successive attempts to solve a path again after it stopped early, over the largest load or
#: depth that the stopped solution reached [-].  Several attempts are needed because finer grids may stop earlier.  The
#: first attempt reduces a load more than a depth: at the end of a path a small change of depth changes the load much.
#: In three dimensions only the first attempt is made.
_WITHIN: dict[Control, tuple[float, ...]] = {"load": (0.75, 0.6, 0.4), "depth": (0.97, 0.9, 0.75, 0.5)}
#: Load or depth that a stopped solution reached, over the last target, above which finer grids are tried [-].  Near the
#: end of a path some coarse grids stop where finer grids do not.
_NEARLY: dict[Control, float] = {"load": 0.7, "depth": 0.9}
#: Target over the last load or depth of the part that is solved again, above which the target is omitted [-].
_LEAST_SPACING = 0.97
#: Fraction of the first target that is solved if the stopped solution reached no load or depth [-].
_PART = 0.2
#: Distance between a contact and the sides of the cover above which the sides are neglected at finite strain or with
#: friction, over the decay length of the cover's response; the key is the kind of base [-].
_FAR_SIDES = {"bonded": 4.0, "sliding": 15.0}
#: Distance from the top within which nodes of the fields lie on it, over the thickness [-].
_ON_TOP = 1e-9
#: Relative error of the force that is stated where the sides of the cover are neglected [-].
_SIDES_ERROR = 1e-3


def press_layers(cover: Cover, problem: PressProblem) -> list[Indentation]:
    """Press an indenter into layers at every target of a problem.

    Raises:
        ValueError: If the axis of the indenter is beside the cover.
        UnsupportedError: If the motion is not along -z, a strain other than that of the materials is requested, or an
            accuracy that no grid reaches.
        PiercedError: If the indenter would pierce the cover.
        IncompletePathError: If the solver stops before the last target; the error has the results that were reached.
    """
    if problem.strain is not None and (problem.strain == "small") != cover.small_strain_only:
        raise UnsupportedError(
            f"layers follow their materials, which are solved at {'small' if cover.small_strain_only else 'finite'} "
            "strain; leave it out, or change the material",
            "strain",
        )
    deep = [depth for depth in problem.targets if problem.control == "depth" and depth >= cover.thickness]
    if deep:
        raise PiercedError(
            f"at a depth of {deep[-1] * 1e3:.4g} mm the indenter would pierce the cover; use less than its thickness, "
            f"{cover.thickness * 1e3:.4g} mm",
            "depth",
        )
    pose = problem.pose
    if not pose.is_planar:
        raise UnsupportedError(
            f"a flat cover is pressed along -z, not along {pose.direction}; tilt turns the indenter", "direction"
        )
    if cover.size is not None and any(abs(a) > edge / 2 for a, edge in zip(pose.at, cover.size, strict=True)):
        x, y, width, height = (1e3 * value for value in (*pose.at, *cover.size))
        raise ValueError(
            f"the indenter's axis at ({x:.4g}, {y:.4g}) mm stands beside the cover, which measures {width:.4g} x "
            f"{height:.4g} mm around the array's middle"
        )
    path = LoadingPath(
        cover=cover,
        indenter=tilt_indenter(problem.indenter, pose.tilt),
        targets=problem.targets,
        control=problem.control,
        friction=problem.friction,
        fields=problem.fields,
    )
    if problem.accuracy is not None and problem.accuracy < (least := find_least_error(path)):
        raise UnsupportedError(f"no grid reaches it: the smallest error that is stated here is {least:.2%}", "accuracy")
    place = Place(array=problem.array, pose=replace(pose, tilt=(0.0, 0.0)))
    press = LayerPress(place=place, progress=problem.progress, superposed=problem.superposed, as_far=problem.as_far)
    return press.solve_as_far(path) if problem.accuracy is None else press.refine(path, problem.accuracy)


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerPress:
    """Presses of an indenter into layers at one place.

    Attributes:
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each step.
        superposed: Whether finite strain and the sides of the cover are solved apart and added, see `superpose_sides`.
        as_far: Whether a path that stops early is solved again as far as all grids reach.
        start: Part of the path that an earlier attempt solved, for initial guesses.
    """

    place: Place
    progress: Progress = None
    superposed: bool = False
    as_far: bool = True
    start: SolvedPath | None = None

    def refine(self, path: LoadingPath, accuracy: float) -> list[Indentation]:
        """Solve a loading path on finer and finer grids until the estimated errors are at most the wanted accuracy.

        Args:
            path: Cover, indenter, targets and friction.
            accuracy: Wanted relative error [-].
        """
        finest = self.count_refinements(path)
        best: list[Indentation] = []
        least = np.inf
        for refinement in range(finest + 1):
            try:
                results = self.solve_as_far(path, refinement)
            except IncompletePathError:
                if not best:
                    raise
                # The results of the coarser grids are complete and are returned.
                break
            reached = max(max(each.error_estimate.values()) for each in results)
            if reached <= accuracy:
                return results
            # The estimated error need not decrease from grid to grid.
            if reached < least:
                best, least = results, reached
            if refinement < finest:
                wanted = f"{100 * accuracy:.3g} % wanted"
                report(self.progress, f"estimated error {100 * reached:.3g} %, {wanted}: a finer grid is added")
        return [state_missed_accuracy(each, accuracy) for each in best]

    def solve_as_far(self, path: LoadingPath, refinement: int = 0) -> list[Indentation]:
        """Solve a loading path; if it stops early, solve the part that was reached and report both.

        Finer grids are tried where the path stops shortly before its last target.

        Raises:
            IncompletePathError: If the path stops before its last target.  It has the results of the part that was
                reached, solved again on all grids.  Without friction at small strain every target is solved by itself,
                and a failure at one target is reported at once.
        """
        try:
            return self.solve(path, refinement)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            first = failure = error
        if isinstance(first, TooShallowError) or _is_linear(path):
            raise IncompletePathError(_explain(path, first, []), []) from first
        near = not path.friction and isinstance(first, PathConvergenceError)
        near = near and getattr(first, path.control) > _NEARLY[path.control] * path.targets[-1]
        if near and refinement < self.count_refinements(path):
            try:
                return self.solve(path, refinement + 1)
            except (ConvergenceError, np.linalg.LinAlgError):
                pass  # The failure on the coarser grids is reported below.
        part, shares = path, _WITHIN[path.control] if self.as_far else ()
        again = replace(self, start=getattr(first, "solved", None))
        for within in shares if path.indenter.axisymmetric else shares[:1]:
            part = _shorten(part, failure, within)
            # The first attempt is meshed for the load or depth that was reached.  Later attempts keep this mesh,
            # because smaller elements stop earlier under a sharp tip.
            part = replace(part, meshed_for=part.targets[-1] if part.meshed_for is None else part.meshed_for)
            try:
                reached = again.solve(part, refinement)
            except (ConvergenceError, np.linalg.LinAlgError) as error:
                failure = error
                continue
            raise IncompletePathError(_explain(path, first, reached), reached) from first
        raise IncompletePathError(_explain(path, first, []), []) from first

    def solve(self, path: LoadingPath, refinement: int) -> list[Indentation]:
        """Solve a loading path on three grids; `refinement` grids are skipped at the coarse end.

        Raises:
            PiercedError: If a load would pierce the cover.  The error states the largest load that the cover bears:
                without friction, the load at a depth of almost the thickness.
        """
        started = time.perf_counter()
        solve: Callable[..., GridStudy] = partial(study_nonlinear, start=self.start)
        if _is_linear(path):
            solve = small_strain.study_path
        elif self.superposed and path.cover.size is not None and not (path.friction or path.fields):
            solve = superpose_sides
        study, thickness = solve(path, self.place, self.progress, refinement), path.cover.thickness
        for grids, load in zip(study.solutions, path.targets, strict=True):
            if grids[-1].depth >= thickness:
                most = (_LARGEST_DEPTH * thickness,)
                bare = replace(path, targets=most, control="depth", friction=0.0, fields=False)
                largest = small_strain.study_path(bare, self.place, None).solutions[0][-1].total_force
                raise PiercedError(
                    f"{load:.4g} N would pierce the cover ({grids[-1].depth * 1e3:.3g} mm deep, the cover has "
                    f"{thickness * 1e3:.4g} mm); use at most {largest:.3g} N, a wider indenter or a stiffer cover",
                    "load",
                    largest,
                )
        seconds = (time.perf_counter() - started) / len(path.targets)
        if path.fields:
            report(self.progress, "displacement and stress in the cover")
        count = len(path.targets)
        return [_combine_grids(study, number, path, self.place, seconds=seconds) for number in range(count)]

    def count_refinements(self, path: LoadingPath) -> int:
        """Return how often the grids of a loading path can be refined."""
        if _is_linear(path):
            return len(small_strain.CELLS) - 3
        from fem_reference.indentation import finite_strain, rubbing

        cover = path.cover
        if cover.small_strain_only:
            return len(rubbing.GRIDS) - 3
        if is_far_from_sides(path, self.place, self.progress):
            cover = replace(cover, size=None)
        if not replace(path, cover=cover).is_in_plane:
            return 0  # Finer grids are not feasible in three dimensions.
        return len(finite_strain.GRIDS) - 3


def find_least_error(path: LoadingPath) -> float:
    """Return a lower bound of the largest relative error that any grids of a path state, known beforehand [-].

    Every solution contains one at small strain without friction, and its error.
    """
    least = small_strain.least_error(path.cover)
    if _is_linear(path) or not path.cover.small_strain_only:
        return least
    from fem_reference.indentation import rubbing

    return max(least, rubbing.least_area_error(path, len(rubbing.GRIDS) - 3))


def study_nonlinear(
    path: LoadingPath,
    place: Place,
    progress: Progress,
    refinement: int = 0,
    *,
    start: SolvedPath | None = None,
) -> GridStudy:
    """Solve a loading path with friction or at finite strain on three grids, by the solver for its strain and cover.

    Args:
        path: Cover, indenter, targets and friction.
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].
        start: Part of this path that was solved before, for initial guesses.
    """
    from fem_reference.indentation import finite_strain, rubbing

    if is_far_from_sides(path, place, progress):
        wide = replace(path, cover=replace(path.cover, size=None))
        study = study_nonlinear(wide, place, progress, refinement, start=start)
        return replace(
            study,
            least_error=max(study.least_error, _SIDES_ERROR),
            assumptions=study.assumptions | {"sides": "too far from the contact to matter"},
        )
    if path.cover.small_strain_only:
        return rubbing.study_path(path, place, progress, refinement)
    # In three dimensions the correction of a solution with friction would contain a larger effect of rounded edges.
    rubbed = rubbing.study_path(path, place, progress, refinement) if path.friction and path.is_in_plane else None
    if rubbed is not None and max(each.depth for each in rubbed.solutions[-1]) >= path.cover.thickness:
        rubbed = None  # Rubber bears loads at which the small-strain solution pierces the cover.
    return finite_strain.study_path(path, place, progress, refinement, rubbed, start=start)


def superpose_sides(path: LoadingPath, place: Place, progress: Progress, refinement: int = 0) -> GridStudy:
    """Add the effect of finite strain on a wide cover to the small-strain solution of a cover of limited size.

    Each effect is computed without the other one.  What they change together is missing.  It is estimated as the larger
    one of two products: of the two effects on the texel forces, and of the effect of the sides on the depth and the
    depth over the thickness, because at finite strain effects change in proportion to the depth.

    Args:
        path: Cover of limited size, indenter and targets, without friction.
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each step.
        refinement: As for `study_nonlinear`.
    """
    if is_far_from_sides(path, place, progress):
        return study_nonlinear(path, place, progress, refinement)
    wide = replace(path, cover=replace(path.cover, size=None))
    full = study_nonlinear(wide, place, progress, refinement)
    linear = small_strain.study_path(wide, None, progress)
    sides = small_strain.study_path(path, place, progress)
    solutions, missing = [], _SIDES_ERROR
    for strained, plain, limited in zip(full.solutions, linear.solutions, sides.solutions, strict=True):
        sets = (strained, plain, limited)
        finite, small, edged = (
            grids[-1].base.forces(place.array, place.pose) / grids[-1].total_force for grids in sets
        )
        yielding = [grids[-1].depth / grids[-1].total_force for grids in (limited, plain)]
        missing = max(
            missing,
            float(np.abs(finite - small).sum() * np.abs(edged - small).sum()),
            abs(yielding[0] / yielding[1] - 1) * strained[-1].depth / path.cover.thickness,
        )
        flat = path.indenter.is_flat
        solutions.append([
            correct_solution(
                extrapolate_solutions(limited) if flat else limited[-1],
                baseline=extrapolate_solutions(plain) if flat else plain[-1], full=each, control=path.control,
            )
            for each in strained
        ])  # fmt: skip
    stated = {"sides": "added at small strain, without what they change in finite strain"}
    return replace(
        full, solutions=solutions, least_error=max(full.least_error, missing), accurate=sides,
        assumptions=full.assumptions | stated,
    )  # fmt: skip


def is_far_from_sides(path: LoadingPath, place: Place, progress: Progress = None) -> bool:
    """Return whether the effect of the cover's sides on a contact is negligible, so that a wide cover can be solved.

    Fields extend to the sides, so that a path with fields is solved with the sides.
    """
    cover = path.cover
    if cover.size is None or path.fields:
        return False
    wide = replace(cover, size=None)
    contact = small_strain.estimate_contact(replace(path, cover=wide), None, progress)
    nearest = min(edge / 2 - abs(at) for edge, at in zip(cover.size, place.pose.at, strict=True))
    length = max(decay_length(wide), membrane_length(wide) if path.friction else 0.0)
    return bool(nearest - np.hypot(*contact.T).max() > _FAR_SIDES[cover.base] * length)


def _shorten(path: LoadingPath, error: Exception, within: float) -> LoadingPath:
    """Return the part of a path up to a share `within` of the load or depth that a failed solution reached [-].

    If the error does not state a load or depth, only a part of the first target is left.
    """
    value = 0.0
    if isinstance(error, PathConvergenceError):
        value = within * (error.load if path.control == "load" else error.depth)
    if not 0 < value < path.targets[-1]:
        return replace(path, targets=(_PART * path.targets[0],))
    kept = tuple(target for target in path.targets if target < _LEAST_SPACING * value)
    return replace(path, targets=(*kept, value))


def _is_linear(path: LoadingPath) -> bool:
    """Return whether a path is at small strain without friction, where every target is solved by itself."""
    return path.cover.small_strain_only and not path.friction


def _explain(path: LoadingPath, error: Exception, reached: list[Indentation]) -> str:
    """State in one line the load or depth that a path reached, why it stopped, and a remedy."""
    thickness = path.cover.thickness
    if reached:
        far = reached[-1]
        share = far.depth / thickness
        message = f"reached {far.total_force:.3g} N, {far.depth * 1e3:.3g} mm deep ({share:.0%} of the thickness)"
    elif isinstance(error, PathConvergenceError) and error.load > 0:
        reach = f"{error.load:.3g} N" if path.control == "load" else f"{1e3 * error.depth:.3g} mm"
        message = f"one grid reached about {reach}"
    else:
        message = "reached no load"
    last = path.targets[-1]
    wanted = f"{last:.3g} N" if path.control == "load" else f"{last * 1e3:.3g} mm"
    cause = error.cause if isinstance(error, PathConvergenceError) else " ".join(str(error).split())
    unstable = [describe_instability(layer.material) for layer in path.cover.layers]
    found = "".join(f"; {sentence}" for sentence in dict.fromkeys(unstable) if sentence)
    if isinstance(error, TooShallowError) or _is_linear(path):
        return f"{message} of the {wanted} asked for: {cause}"
    return f"{message} of the {wanted} asked for: {cause}{found}; press less, or with a wider or rounder indenter"


def _combine_grids(study: GridStudy, number: int, path: LoadingPath, place: Place, *, seconds: float) -> Indentation:
    """Combine the solutions of one target on three grids to the result for one pose.

    Args:
        study: Solutions of every target, and properties of the three grids.
        number: Index of the target.
        path: Cover, indenter and friction.
        place: Array, and pose of the indenter.
        seconds: Elapsed time of the solutions [s].
    """
    started = time.perf_counter()
    grids = study.solutions[number]
    finest = grids[-1]

    @cache
    def base_forces(solution: GridSolution) -> FloatArray:
        """Compute the forces of a solution on the texels and outside them; they are kept for the error estimate."""
        return solution.base.forces(place.array, place.pose)

    base = study.combine(grids, base_forces)
    texel_forces, outside = base[:-1], float(base[-1])
    peak = int(np.argmax(np.abs(texel_forces)))
    quantities: dict[str, Quantity] = {
        "total_force": attrgetter("total_force"),
        "depth": attrgetter("depth"),
        "peak_texel": lambda each: float(base_forces(each)[peak]),
    }
    # If the load is prescribed, `total` is the requested load, so that `balance` reveals a solver that misses it.
    by_load = path.control == "load"
    total = path.targets[number] if by_load else float(study.combine(grids, lambda each: each.total_force))
    balance = float(base.sum()) / total - 1
    errors = _estimate_errors(study, number, quantities, place, peak) | {
        "contact_area": _estimate_area_error(study, grids, path)
    }
    errors["peak_texel"] += abs(balance)
    texel_errors = _estimate_texels(study, number, base_forces, place, (balance, errors["peak_texel"]))
    errors["total_force" if by_load else "depth"] = 0.0
    scale = total / finest.contact[:, 2].sum()
    depth = float(study.combine(grids, lambda each: each.depth))
    points, forces = _place_contact(finest, path, place, depth, scale)
    fields, missing = _find_fields(finest, path, place, scale) if path.fields else (None, [])
    known: dict[str, str] = {}
    if fields is not None:
        fields = replace(fields, error=_measure_fields(fields, finest, path, place, depth))
        known["fields"] = f"at its worst point the touched surface is {fields.error:.2%} of the depth off the indenter"
    shear = forces[:, :2].sum(axis=0)
    return Indentation(
        texel_forces=texel_forces,
        outside=outside,
        texel_errors=texel_errors[:-1],
        outside_error=float(texel_errors[-1]),
        total_force=total,
        force=np.array([*shear, -total]),
        moment=np.cross(points, forces).sum(axis=0),
        base_force=np.array([*shear, -float(texel_forces.sum()) - outside]),
        unmeasured=np.array([*shear, -outside]),
        balance=balance,
        depth=depth,
        contact_area=finest.area,
        contact_points=points,
        contact_forces=forces,
        energy=float(study.combine(grids, lambda each: each.energy)),
        fields=fields,
        error_estimate=errors,
        assumptions=state_assumptions(path.cover, path.indenter, finest.depth, path.friction)
        | study.assumptions
        | known,
        warnings=(*warn_of_errors(errors), *_warn(path, balance, finest.depth), *study.warnings, *missing),
        seconds=seconds + time.perf_counter() - started,
        grid_values={
            name: tuple(float(quantity(each)) for each in grids)
            for name, quantity in (
                quantities | {"contact_area": attrgetter("area"), "size": attrgetter("size")}
            ).items()
        },
    )


def _find_fields(
    finest: GridSolution, path: LoadingPath, place: Place, scale: float
) -> tuple[CoverFields | None, list[str]]:
    """Return displacement and stress in the frame of the array, or None and the reason for their absence."""
    from fem_reference.indentation.linear_fields import solve_linear_fields, state_missing_fields

    missing = state_missing_fields(path, place.pose)
    fields = finest.fields
    if not missing and fields is None:
        contact = np.column_stack([finest.contact, *([] if finest.shear is None else finest.shear.T)])
        contact *= [1, 1, *[scale] * (contact.shape[1] - 2)]
        fields = solve_linear_fields(path, contact, place, depth=finest.depth)
    elif fields is not None and path.cover.size is None:
        fields = fields.to_array(place.pose)
    return fields, [missing] if missing else []


def _measure_fields(fields: CoverFields, finest: GridSolution, path: LoadingPath, place: Place, depth: float) -> float:
    """Measure by how much the top of fields is off the indenter where a solution has contact, over the depth [-]."""
    top = np.flatnonzero(fields.position[:, 2] > path.cover.thickness * (1 - _ON_TOP))
    at = fields.position[top] + (0.0 if path.cover.small_strain_only else fields.displacement[top])
    x, y = place.pose.to_indenter(at[:, 0], at[:, 1])
    gap, contact = np.asarray(path.indenter.gap(x, y)), finest.contact[finest.contact[:, 2] > 0, :2]
    if fields.axisymmetric:
        near = np.hypot(x, y) <= np.hypot(*contact.T).max()
    else:  # Half a diagonal of the square that a point stands for.
        near = cKDTree(contact).query(np.column_stack([x, y]))[0] < np.sqrt(finest.area / len(contact) / 2)
    touched = near & np.isfinite(gap)
    miss = fields.displacement[top, 2][touched] + depth - gap[touched]
    return float(np.abs(miss).max(initial=0.0) / depth)


def _warn(path: LoadingPath, balance: float, depth: float) -> list[str]:
    """Return warnings about forces that do not balance, and about materials that are pressed beyond their stability.

    Args:
        path: Cover that is pressed.
        balance: Force on the base over the load, minus 1 [-].
        depth: Depth of the indenter [m].
    """
    out = []
    if abs(balance) > _LARGE_IMBALANCE:
        out.append(
            f"the forces on the base differ from the load by {balance:+.2%}, which is part of the peak texel's estimate"
        )
    if path.cover.small_strain_only:
        return out
    remaining = 1 - depth / path.cover.thickness
    unstable = dict.fromkeys(warn_of_instability(layer.material, remaining) for layer in path.cover.layers)
    return [*out, *(sentence for sentence in unstable if sentence)]


def _place_contact(
    finest: GridSolution, path: LoadingPath, place: Place, depth: float, scale: float
) -> tuple[FloatArray, FloatArray]:
    """Return the contact points and the forces on the cover there, in the frame of the array, shape (m, 3) each.

    Args:
        finest: Solution on the finest grid.
        path: Cover and indenter.
        place: Array, and pose of the indenter.
        depth: Approach of the indenter [m].
        scale: Total force of the result over that of the contact forces [-].
    """
    x, y, pressed = finest.contact.T
    # Contact points lie on the indenter.  The middles of cells that its outline cuts may lie beside a flat face; they
    # count as points of the face.
    height = path.indenter.gap(x, y)
    points = np.column_stack(
        [*place.pose.to_array(x, y), path.cover.thickness - depth + np.where(np.isfinite(height), height, 0.0)]
    )
    turn = replace(place.pose, point=(0.0, 0.0, 0.0))
    across = np.zeros((2, len(x))) if finest.shear is None else np.array(turn.to_array(*finest.shear.T)) * scale
    return points, np.column_stack([*across, -pressed * scale])


def _estimate_errors(
    study: GridStudy, number: int, quantities: Mapping[str, Quantity], place: Place, peak: int
) -> dict[str, float]:
    """Estimate the relative errors of force, depth and the force on the texel of index `peak` [-].

    A solution that corrects another one has the errors of both.

    Args:
        study: Solutions of every target, and properties of the three grids.
        number: Index of the target.
        quantities: Functions that return force, depth and the force on the texel of a solution, by name.
        place: Array, and pose of the indenter.
        peak: Index of the texel with the largest force.
    """
    overlap = max(study.solutions[number][-1].overlap, study.least_overlap)
    errors = {
        "total_force": _FORCE_PER_OVERLAP * overlap,
        "depth": overlap,
        "peak_texel": _FORCE_PER_OVERLAP * overlap,
    }
    part: GridStudy | None = study
    while part is not None:
        grids = part.solutions[number]
        for name, quantity in quantities.items():
            errors[name] += part.estimate_error(grids, quantity)
        share = quantities["peak_texel"](grids[-1]) / grids[-1].total_force
        errors["peak_texel"] += grids[-1].base.estimate_error(place, peak, share)
        part = part.accurate
    return errors


def _estimate_texels(
    study: GridStudy,
    number: int,
    base_forces: Callable[[GridSolution], FloatArray],
    place: Place,
    known: tuple[float, float],
) -> FloatArray:
    """Estimate the errors of the forces on n texels and outside them, with the parts of `_estimate_errors` [N].

    Args:
        study: Solutions of every target, and properties of the three grids.
        number: Index of the target.
        base_forces: Function that returns the forces of a solution, shape (n + 1,) [N].
        place: Array, and pose of the indenter.
        known: Relative error that all have, the imbalance of the forces, and that of the largest texel force [-].
    """
    overlap = max(study.solutions[number][-1].overlap, study.least_overlap)
    size = np.abs(study.combine(study.solutions[number], base_forces))
    errors = (_FORCE_PER_OVERLAP * overlap + abs(known[0])) * size
    part: GridStudy | None = study
    while part is not None:
        grids = part.solutions[number]
        load = grids[-1].total_force
        response = load * grids[-1].base.texel_errors(place, base_forces(grids[-1]) / load)
        errors = errors + part.texel_errors(grids, base_forces) + response
        part = part.accurate
    errors[:-1] = pool_errors(errors[:-1], size[:-1])
    peak = size[:-1].argmax()
    errors[peak] = max(errors[peak], known[1] * size[peak])
    return errors


def _estimate_area_error(study: GridStudy, grids: Sequence[GridSolution], path: LoadingPath) -> float:
    """Estimate the relative error of the contact area [-].

    A face that is completely in contact has an area given by its geometry, the same on all grids.  All other contacts
    end where the pressure does, which depends on the compliance of the cover.
    """
    spread = estimate_spread([each.area for each in grids])
    if path.indenter.is_flat and spread < _LEAST_AREA_ERROR:
        return _LEAST_AREA_ERROR
    return max(spread, grids[-1].area_spread, study.least_error, study.least_area_error, _LEAST_AREA_ERROR)


def state_assumptions(cover: Cover, indenter: Indenter, depth: float, friction: float = 0.0) -> dict[str, str]:
    """State the assumptions about strain, friction, base and sides of the cover, and whether the depth is in range.

    Args:
        cover: The cover.
        indenter: The indenter.
        depth: Depth of the indenter [m].
        friction: Coefficient of friction between indenter and cover, inf for no slip [-].
    """
    law = "no slip" if np.isinf(friction) else f"Coulomb, coefficient {friction:g}" if friction else "frictionless"
    out = {"strain": "small" if cover.small_strain_only else "finite", "friction": law, "base": cover.base}
    if cover.size is not None:
        x, y = (1e3 * edge for edge in cover.size)
        out["sides"] = f"free, {x:.4g} x {y:.4g} mm, touched on top only"
    facets = indenter.measure_facets(depth)
    if facets:
        out["facets"] = (
            f"pressed as they are, up to {facets * 1e3:.2g} mm ({facets / depth:.1%} of the depth) from the smooth "
            "surface that they stand for, which no error estimate contains"
        )
    share = depth / cover.thickness
    if cover.small_strain_only and share > _SMALL_STRAIN_DEPTH:
        out["range"] = f"indented to {share:.0%} of the thickness: more than small strain is meant for"
    return out
