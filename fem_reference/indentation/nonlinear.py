"""Choose solver and grids of an indentation of layers with friction or at finite strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem_reference.finite_strain.loading_path import LoadingPath, Progress
from fem_reference.indentation import finite_strain, small_strain
from fem_reference.indentation.grid_solution import GridStudy
from fem_reference.linear_response.surface_compliance import decay_length
from fem_reference.small_strain_contact import friction_rings, no_slip
from meshes.pose import Place

#: Distance between a contact and the sides of the cover above which the sides are neglected at finite strain or with
#: friction, over the decay length of the cover's response; the key is the kind of base [-].
_FAR_SIDES = {"bonded": 4.0, "sliding": 15.0}
#: Relative error of the force where the sides are neglected [-].
_SIDES_ERROR = 1e-3


def study_path(path: LoadingPath, place: Place, progress: Progress, refinement: int = 0) -> GridStudy:
    """Solve a loading path on three grids by the solver for its strain, friction and cover.

    Args:
        path: Cover, indenter, targets and friction.
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each step.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].
    """
    if is_far_from_sides(path, place, progress):
        study = study_path(replace(path, cover=replace(path.cover, size=None)), place, progress, refinement)
        return replace(
            study,
            least_error=max(study.least_error, _SIDES_ERROR),
            assumptions=study.assumptions | {"sides": "too far from the contact to matter"},
        )
    small, in_plane = path.cover.small_strain_only, finite_strain.is_in_plane(path)
    rubbing = None
    # Not in three dimensions at finite strain, where the correction would have a larger effect of rounded edges.
    if np.isinf(path.friction) and path.indenter.is_flat and (small or in_plane):
        rubbing = no_slip.study_path(path, place, progress)
    if rubbing is None and path.friction and in_plane:
        rubbing = friction_rings.study_path(path, progress, refinement)
    if rubbing is not None and small:
        return rubbing
    if rubbing is not None and max(each.depth for each in rubbing.solutions[-1]) >= path.cover.thickness:
        rubbing = None  # Rubber bears loads at which the small-strain solution pierces the cover.
    return finite_strain.study_path(path, place, progress, refinement, rubbing)


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
    return bool(nearest - np.hypot(*contact.T).max() > _FAR_SIDES[cover.base] * decay_length(wide))


def count_refinements(path: LoadingPath, place: Place, progress: Progress = None) -> int:
    """Return how often the grids of a loading path can be refined."""
    small = path.cover.small_strain_only
    if is_far_from_sides(path, place, progress):
        path = replace(path, cover=replace(path.cover, size=None))
    if small and np.isinf(path.friction) and path.indenter.is_flat:
        return 0  # the grids of a face without slip are fixed
    if not finite_strain.is_in_plane(path):
        return 0  # finer grids are not feasible in three dimensions
    return len(friction_rings.GRIDS if small else finite_strain.GRIDS) - 3
