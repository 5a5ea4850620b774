"""Combine the solutions of an indentation on three grids to the result of a press, with errors and warnings."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.grid_solution import BaseForces, GridSolution, GridStudy, estimate_spread
from fem_reference.indentation.linear_fields import solve_linear_fields, state_missing_fields
from fem_reference.materials import warn_of_instability
from meshes.array_types import FloatArray
from meshes.pose import Place

#: Depth over cover thickness above which a small-strain result is marked as outside its range.  At this depth the force
#: on a sphere agrees with the finite-strain force within 0.3 % [-].
_SMALL_STRAIN_DEPTH = 0.3
#: Relative error of a force per relative error of the depth.  The penetration that remains in the contact is an error
#: of the depth, and contact forces increase at most with the square of the depth [-].
_FORCE_PER_OVERLAP = 2.0
#: Smallest estimated error of a contact area: that of the measured area of a face [-].
_LEAST_AREA_ERROR = 2e-5
#: Estimated relative error above which a result has a warning [-].
_LARGE_ERROR = 0.05
#: Difference between the forces on the base and the load, over the load, above which a result has a warning [-].
_LARGE_IMBALANCE = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """Result of pressing one indenter into a cover at one load or depth.

    Attributes:
        texel_forces: Normal force on each of n texels, shape (n,) [N].
        outside: Force that acts on the base outside the active texels [N], computed independently of the load; in three
            dimensions at finite strain or with friction, the whole base reaction minus `texel_forces`.
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
        fields: Displacement and stress in the cover, if they were asked for, on the finest mesh; None, and a
            sentence in `warnings`, where they are not available.
        grid_values: `total_force` [N], `depth` [m], `peak_texel` [N] and `contact_area` [m2] on the three grids,
            coarsest first, and `size`, the sizes of their cells or elements, of which only ratios are used.
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
    grid_values: dict[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def force(self) -> FloatArray:
        """Force of the indenter on the cover, shape (3,) [N]."""
        across = (0.0, 0.0) if self.shear is None else self.shear.sum(axis=0)
        return np.array([*across, -self.total_force])

    @property
    def moment(self) -> FloatArray | None:
        """Moment of this force about the origin of the array's frame, shape (3,) [N m]; None with friction."""
        if self.shear is not None:
            return None  # the heights of the contact points are not kept
        x, y, pressed = self.contact.T
        return np.array([-(y @ pressed), x @ pressed, 0.0])

    @property
    def base_force(self) -> FloatArray:
        """Force of the cover on its base, shape (3,) [N]; across the normal that of the indenter."""
        return np.array([*self.force[:2], -float(self.texel_forces.sum()) - self.outside])

    @property
    def unmeasured(self) -> FloatArray:
        """Part of the force on the base that no texel measures, shape (3,) [N]."""
        return np.asarray(self.base_force + np.array([0.0, 0.0, float(self.texel_forces.sum())]))


def combine_grids(study: GridStudy, number: int, path: LoadingPath, place: Place, *, seconds: float) -> Indentation:
    """Combine the solutions of one target on three grids to the result for one pose.

    Args:
        study: Solutions of every target, and properties of the three grids.
        number: Index of the target.
        path: Cover, indenter and friction.
        place: Array, and pose of the indenter.
        seconds: Time that the solutions took [s].
    """
    started = time.perf_counter()
    grids = _fix_place(study.solutions[number], place)
    finest = grids[-1]

    def base_forces(solution: GridSolution) -> FloatArray:
        return solution.base_forces(place.array, place.pose)

    base = study.combine(grids, base_forces)
    texel_forces, outside = base[:-1], float(base[-1])
    peak = int(np.argmax(np.abs(texel_forces)))
    # A prescribed load is the one that was asked for, so that `balance` shows if a solver misses it.
    by_load = path.control == "load"
    total = path.targets[number] if by_load else float(study.combine(grids, lambda each: each.total_force))
    balance = float(base.sum()) / total - 1
    errors = _estimate_errors(study, number, grids, place, peak) | {
        "contact_area": _estimate_area_error(study, grids, path)
    }
    errors["peak_texel"] += abs(balance)
    errors["total_force" if by_load else "depth"] = 0.0
    x, y, force = finest.contact.T
    scale = total / force.sum()
    turn = replace(place.pose, point=(0.0, 0.0, 0.0))
    shear = None if finest.shear is None else np.column_stack(turn.to_array(*finest.shear.T)) * scale
    missing = state_missing_fields(path, place.pose) if path.fields else ""
    fields = _find_fields(finest, path, place, scale) if path.fields and not missing else None
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
        warnings=(
            *_warn(errors, balance),
            *_warn_of_instability(path, finest.depth),
            *study.warnings,
            *([missing] if missing else []),
        ),
        seconds=seconds + time.perf_counter() - started,
        grid_values=_list_grid_values(grids, place, peak),
    )


def _list_grid_values(grids: Sequence[GridSolution], place: Place, peak: int) -> dict[str, tuple[float, ...]]:
    """List force, depth, the force on the texel of index `peak`, contact area and element size of each grid."""
    quantities: dict[str, Callable[[GridSolution], float]] = {
        "size": lambda each: each.size,
        "total_force": lambda each: each.total_force,
        "depth": lambda each: each.depth,
        "peak_texel": lambda each: float(each.base_forces(place.array, place.pose)[peak]),
        "contact_area": lambda each: each.area,
    }
    return {name: tuple(float(quantity(each)) for each in grids) for name, quantity in quantities.items()}


def _estimate_errors(
    study: GridStudy, number: int, grids: Sequence[GridSolution], place: Place, peak: int
) -> dict[str, float]:
    """Estimate the relative errors of force, depth and the force on the texel of index `peak` [-].

    A solution that corrects another one has the errors of both.

    Args:
        study: Solutions of every target, and properties of the three grids.
        number: Index of the target.
        grids: Solutions of the target, with the base forces of the place.
        place: Array, and pose of the indenter.
        peak: Index of the texel with the largest force.
    """
    overlap = max(grids[-1].overlap, study.least_overlap)
    errors = {
        "total_force": _FORCE_PER_OVERLAP * overlap,
        "depth": overlap,
        "peak_texel": _FORCE_PER_OVERLAP * overlap,
    }
    quantities: dict[str, Callable[[GridSolution], float]] = {
        "total_force": lambda each: each.total_force,
        "depth": lambda each: each.depth,
        "peak_texel": lambda each: float(each.base_forces(place.array, place.pose)[peak]),
    }
    parts = [(study, grids)]
    corrected = study.accurate
    while corrected is not None:
        parts.append((corrected, _fix_place(corrected.solutions[number], place)))
        corrected = corrected.accurate
    for part, solutions in parts:
        for name, quantity in quantities.items():
            errors[name] += part.estimate_error(solutions, quantity)
        finest = solutions[-1]
        if finest.base_error is not None:
            share = quantities["peak_texel"](finest) / finest.total_force
            errors["peak_texel"] += finest.base_error(place, peak, share)
    return errors


def _estimate_area_error(study: GridStudy, grids: Sequence[GridSolution], path: LoadingPath) -> float:
    """Estimate the relative error of the contact area [-].

    The area of a face that touches with all of itself is geometry, and the same on all grids.  All other contacts end
    where the pressure does, which the compliance of the cover decides.
    """
    spread = estimate_spread([each.area for each in grids])
    if path.indenter.is_flat and spread < _LEAST_AREA_ERROR:
        return _LEAST_AREA_ERROR
    return max(spread, study.least_error, study.least_area_error, _LEAST_AREA_ERROR)


def _fix_place(grids: Sequence[GridSolution], place: Place) -> list[GridSolution]:
    """Compute the base forces of solutions once for a place; they are needed for the result and for its error."""
    return [replace(each, base_forces=_keep(each.base_forces(place.array, place.pose))) for each in grids]


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


def _warn_of_instability(path: LoadingPath, depth: float) -> tuple[str, ...]:
    """State in words which materials are pressed beyond their stability."""
    remaining = 1 - depth / path.cover.thickness
    if path.load_scale < 1 or path.cover.small_strain_only:
        return ()
    said = [warn_of_instability(layer.material, remaining) for layer in path.cover.layers]
    return tuple(dict.fromkeys(sentence for sentence in said if sentence))


def _find_fields(finest: GridSolution, path: LoadingPath, place: Place, scale: float) -> CoverFields:
    """Return displacement and stress in the cover in the frame of the array, solved from the contact forces if absent.

    Args:
        finest: Solution on the finest grid.
        path: Cover and indenter.
        place: Array, and pose of the indenter.
        scale: Total force of the result over that of the contact forces [-].
    """
    if finest.fields is None and not path.cover.small_strain_only:
        raise RuntimeError("the solution at finite strain has no fields")
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
    facets = path.indenter.measure_facets(depth)
    if facets:
        out["facets"] = (
            f"pressed as they are, up to {facets * 1e3:.2g} mm ({facets / depth:.1%} of the depth) from the smooth "
            "surface that they stand for, which no error estimate contains"
        )
    share = depth / cover.thickness
    if cover.small_strain_only and share > _SMALL_STRAIN_DEPTH:
        out["range"] = f"indented to {share:.0%} of the thickness: more than small strain is meant for"
    return out
