"""Return what a loading path reached if the solver stops before the last target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fem_reference.errors import ConvergenceError, IncompletePathError, TooShallowError
from fem_reference.finite_strain.loading_path import Control, LoadingPath
from fem_reference.finite_strain.newton import PathConvergenceError
from fem_reference.indentation.result import Indentation
from fem_reference.materials import describe_instability

#: Load or depth that is solved again on all grids, over the largest one that the failed solution reached, in successive
#: attempts: finer grids may stop earlier.  The load rises steeply at last, so less of it costs little of the depth, and
#: the finer grids then start from the solutions of the coarser ones.  One attempt in three dimensions [-].
_WITHIN: dict[Control, tuple[float, ...]] = {"load": (0.9, 0.75, 0.5), "depth": (0.97, 0.9, 0.75, 0.5)}
#: Load or depth that a failed solution reached, over the last target, from which finer grids are tried: near the end of
#: a path single coarse grids stop where finer ones do not [-].
_NEARLY: dict[Control, float] = {"load": 0.7, "depth": 0.9}
#: Load or depth over that of the next target above which a target is left out of the part that is solved again [-].
_LEAST_SPACING = 0.97
#: Part of the first target that is tried if the failed solution reached nothing [-].
_PART = 0.2


def solve_as_far(
    path: LoadingPath,
    solve: Callable[[LoadingPath], list[Indentation]],
    finer: Callable[[LoadingPath], list[Indentation]] | None = None,
) -> list[Indentation]:
    """Solve a loading path; if it stops early, solve the part that was reached and report both.

    Args:
        path: Loading path.
        solve: Function that solves a loading path on all grids and returns one result per target.
        finer: The same on finer grids, tried where the path stops shortly before its last target; None if there are
            none.

    Raises:
        IncompletePathError: If the path stops before its last target.  It has the results of the part that was
            reached, which was solved again on all grids.  A contact without friction at small strain has no path: its
            failure at one target is reported at once.
    """
    try:
        return solve(path)
    except (ConvergenceError, np.linalg.LinAlgError) as error:
        failure: Exception = error
    if isinstance(failure, TooShallowError) or _is_linear(path):
        raise IncompletePathError(_explain(path, failure, []), []) from failure
    if finer is not None and _is_nearly_solved(path, failure):
        try:
            return finer(path)
        except (ConvergenceError, np.linalg.LinAlgError):
            pass  # what the coarser grids reached is reported
    first, part = failure, path
    shares = _WITHIN[path.control]
    for within in shares if path.indenter.axisymmetric else shares[:1]:
        part = _shorten(part, failure, within)
        # The first attempt is meshed for what was reached; later ones keep this mesh, because smaller elements stop
        # earlier under a sharp tip.
        part = replace(part, meshed_for=part.targets[-1] if part.meshed_for is None else part.meshed_for)
        try:
            reached = solve(part)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            failure = error
            continue
        raise IncompletePathError(_explain(path, first, reached), reached) from first
    raise IncompletePathError(_explain(path, first, []), []) from first


def _shorten(path: LoadingPath, error: Exception, within: float) -> LoadingPath:
    """Return the part of a path up to a share `within` of the load or depth that a failed solution reached [-].

    If the error does not say what was reached, only a part of the first target is left.
    """
    value = 0.0
    if isinstance(error, PathConvergenceError):
        value = within * (error.load if path.control == "load" else error.depth)
    if not 0 < value < path.targets[-1]:
        return replace(path, targets=(_PART * path.targets[0],))
    kept = tuple(target for target in path.targets if target < _LEAST_SPACING * value)
    return replace(path, targets=(*kept, value))


def _is_nearly_solved(path: LoadingPath, error: Exception) -> bool:
    """Return whether a failed solution without friction came near its last target."""
    if path.friction or not isinstance(error, PathConvergenceError):
        return False
    return bool(getattr(error, path.control) > _NEARLY[path.control] * path.targets[-1])


def _is_linear(path: LoadingPath) -> bool:
    """Return whether every target of a path is solved by itself, at small strain without friction."""
    return path.cover.small_strain_only and not path.friction


def _explain(path: LoadingPath, error: Exception, reached: list[Indentation]) -> str:
    """Say in one line how far a path came, why it stopped, and what to do."""
    thickness = path.cover.thickness
    if reached:
        far = reached[-1]
        share = far.depth / thickness
        message = f"reached {far.total_force:.3g} N, {far.depth * 1e3:.3g} mm deep ({share:.0%} of the thickness)"
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
