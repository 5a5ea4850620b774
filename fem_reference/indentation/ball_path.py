"""Press a ball at finite strain on one coarse grid, for the calibration and verification of simpler models.

For these an error of a fraction of a percent is acceptable, and the three grids of `finite_strain` would take too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference import result_store
from fem_reference.errors import PathConvergenceError
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath, Progress
from fem_reference.indentation.finite_strain import choose_fillet
from fem_reference.indentation.grid_solution import GridSolution, RadialBase
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import choose_reach
from meshes import Cover, Sphere
from meshes.array_types import FloatArray

#: Number of elements through the cover on the single coarse grid of `press_ball` [-].
_BALL_ELEMENTS = 4
#: Largest radius of the region of small elements on the grid of `press_ball`, over the radius of the ball [-].
_LARGEST_CONTACT = 0.8


@dataclass(frozen=True, kw_only=True, eq=False)
class BallPath:
    """A ball pressed into a cover to n ascending depths.

    Attributes:
        radius: Radius of the ball [m].
        depth: Approaches of the ball from first touch, shape (n,) [m].
        load: Forces on the ball, shape (n,) [N].
        contact_radius: Radii of the contact area, shape (n,) [m].
        base: Base pressure per force at every depth.
    """

    radius: float
    depth: FloatArray
    load: FloatArray
    contact_radius: FloatArray
    base: tuple[PointSpread, ...]


def press_ball(cover: Cover, radius: float, depths: Sequence[float], *, progress: Progress = None) -> BallPath:
    """Press a ball into a wide cover at finite strain on one coarse grid, or read the path from the result store.

    If the solution stops early, the depths that it reached are solved anew, on a mesh for their smaller contact.

    Args:
        cover: Laterally wide cover; materials for small strain count as neo-Hookean of the same moduli.
        radius: Radius of the ball [m].
        depths: Ascending approaches of the ball from first touch [m].
        progress: Called with a line of text after each step.

    Raises:
        PathConvergenceError: If not even the first depth converges.
    """
    ball = Sphere(radius=radius)

    def solve(wanted: Sequence[float]) -> list[GridSolution]:
        """Solve for a ball at the wanted depths on one grid."""
        # On a thick cover the contact of a ball is smaller than the section of the ball at the depth, because the
        # surface next to the ball moves down.
        contact = min(np.sqrt(radius * wanted[-1]), _LARGEST_CONTACT * radius)
        return press_axisymmetric(
            LoadingPath(cover=cover, indenter=ball, targets=tuple(wanted), control="depth"),
            elements_per_thickness=_BALL_ELEMENTS,
            contact_radius=contact,
            fillet=choose_fillet(cover.thickness, ball),
            reach=choose_reach(cover, contact),
            progress=progress,
        )[0]

    def compute() -> BallPath:
        wanted, states = list(depths), None
        while states is None:
            try:
                states = solve(wanted)
            except PathConvergenceError as error:
                wanted = [depth for depth in wanted[:-1] if depth <= error.depth]
                if not wanted:
                    raise
        return BallPath(
            radius=radius,
            depth=np.array([each.depth for each in states]),
            load=np.array([each.total_force for each in states]),
            contact_radius=np.sqrt(np.array([each.area for each in states]) / np.pi),
            base=tuple(each.base.spread for each in states if isinstance(each.base, RadialBase)),
        )

    inputs = {"cover": cover, "ball": ball, "depths": list(depths), "elements": _BALL_ELEMENTS}
    return result_store.fetch("ball-path", inputs, compute)
