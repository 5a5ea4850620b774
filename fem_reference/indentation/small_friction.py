"""Solve indenters of revolution with friction on a wide cover at small strain.

The solution with friction on rings (`friction_rings`) corrects the accurate frictionless solution, see `correction`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.finite_strain.loading_path import LoadingPath, name_grid
from fem_reference.indentation import small_strain
from fem_reference.indentation.correction import SolvedPair, correct_path
from fem_reference.indentation.finite_strain import read_axisymmetric_solution
from fem_reference.indentation.grid_solution import GridSolution, GridStudy
from fem_reference.small_strain_contact.friction_rings import RingContact, count_rings

#: Function that is called with a line of text about the progress of a solution, or None.
Progress = Callable[[str], None] | None

#: Number of elements through the cover on all grids; three neighbouring grids give a result and its error [-].
GRIDS = (6, 9, 13, 19, 28)
#: Smallest estimated error [-].
_LEAST_ERROR = 5e-4


def count_refinements() -> int:
    """Return how often the grids of `study_path` can be refined."""
    return len(GRIDS) - 3


def study_path(path: LoadingPath, progress: Progress, refinement: int = 0) -> GridStudy:
    """Solve a loading path with friction on three grids.

    Args:
        path: Wide cover, indenter of revolution, target loads or depths, and friction.
        progress: Called with a line of text before each solve.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        The solutions of every target, and how they converge.
    """
    accurate = small_strain.study_path(path, None, progress)
    grids = GRIDS[refinement : refinement + 3]
    solve = partial(_solve_pair, smooth=accurate.solutions[-1][-1], grids=grids, progress=progress)
    ring = 1 / count_rings(grids[-1])
    return GridStudy(
        solutions=correct_path(path, accurate.solutions, solve),
        least_order=1.0,
        least_error=_LEAST_ERROR,
        # The edge of the contact is found within half a ring, a change of the area by the width of the ring.
        least_area_error=0.0 if path.indenter.is_flat else ring,
        accurate=accurate,
        assumptions={},
    )


def _solve_pair(
    path: LoadingPath, _approaches: Sequence[float], *, smooth: GridSolution, grids: Sequence[int], progress: Progress
) -> SolvedPair:
    """Solve a loading path without and with friction on three grids, or read both from the result store.

    Args:
        path: Cover, indenter, targets and friction.
        smooth: Accurate solution of the last target without friction, which gives the size of the contact.
        grids: Number of elements through the cover on each grid [-].
        progress: Called with a line of text before each solve.
    """
    path = replace(path, load_scale=1.0)
    radius = (smooth.area / math.pi) ** 0.5

    def compute() -> dict[str, Any]:
        out: dict[str, Any] = {}
        for count in grids:
            tell = name_grid(progress, count)
            if tell is not None:
                tell("rings with friction")
            contact = RingContact(path.cover, path.indenter, contact_radius=radius, count=count)
            for name, friction in (("baseline", 0.0), ("full", path.friction)):
                fields = path.fields and name == "full" and count == grids[-1]
                states = contact.press(path.targets, path.control, friction=friction, depth=smooth.depth, fields=fields)
                for number, state in enumerate(states):
                    key = f"{name}_{count}_{number}"
                    out |= state.base.pack(key, state.reach)
                    out[f"scalars_{key}"] = np.array([state.load, state.depth, state.area, 0.0, state.energy])
                    out[f"rings_{key}"] = state.rings
                    if state.fields is not None:
                        out |= state.fields.pack(f"fields_{key}")
        return out

    data = result_store.fetch("friction-rings", {"path": path, "grids": grids}, compute)
    baseline, full = (
        [
            [read_axisymmetric_solution(data, f"{name}_{count}_{number}", 1 / count, each) for count in grids]
            for number in range(len(path.targets))
        ]
        for name, each in (("baseline", replace(path, friction=0.0)), ("full", path))
    )
    return baseline, full
