"""Press a ball into a wide cover at finite strain to ascending depths, on one coarse grid.

The path serves to calibrate and to check simpler models, where a fraction of a percent does not matter and the three
grids of `press` would take too long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.newton import PathConvergenceError
from fem_reference.indentation.rounding import choose_fillet
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import choose_reach
from meshes import Cover, Sphere
from meshes.array_types import FloatArray

#: Number of elements through the cover [-].
_ELEMENTS = 4
#: Largest radius of the region of small elements, over the radius of the ball [-].
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


def press_ball(
    cover: Cover, radius: float, depths: Sequence[float], *, progress: Callable[[str], None] | None = None
) -> BallPath:
    """Press a ball into a wide cover at finite strain, or read the path from the result store.

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

    def compute() -> dict[str, Any]:
        wanted = list(depths)
        while True:
            try:
                return _solve(LoadingPath(cover=cover, indenter=ball, targets=tuple(wanted), control="depth"), progress)
            except PathConvergenceError as error:
                wanted = _keep_reached(wanted, error)

    inputs = {"cover": cover, "ball": ball, "depths": list(depths), "elements": _ELEMENTS}
    data = result_store.fetch("ball-path", inputs, compute)
    load = data["load"]
    base = tuple(
        PointSpread.unpack(data, f"{i}", thickness=cover.thickness, force=force) for i, force in enumerate(load)
    )
    return BallPath(
        radius=radius, depth=data["depth"], load=load, contact_radius=np.sqrt(data["area"] / np.pi), base=base
    )


def _keep_reached(depths: list[float], error: PathConvergenceError) -> list[float]:
    """Return the depths that a stopped path reached, at least one fewer; raise the error again if there are none."""
    kept = [depth for depth in depths[:-1] if depth <= error.depth]
    if not kept:
        raise error
    return kept


def _solve(path: LoadingPath, progress: Callable[[str], None] | None) -> dict[str, Any]:
    """Solve a loading path on one grid, and return its states as arrays for the result store."""
    ball = max(path.indenter.footprint)
    # A thick cover yields beside the ball: its contact is smaller than that of a ball cut off at the depth.
    contact = min(np.sqrt(ball * path.targets[-1]), _LARGEST_CONTACT * ball)
    reach = choose_reach(path.cover, contact)
    states, _ = press_axisymmetric(
        path,
        elements_per_thickness=_ELEMENTS,
        contact_radius=contact,
        fillet=choose_fillet(path.cover.thickness, path.indenter),
        reach=reach,
        progress=progress,
    )
    out: dict[str, Any] = {
        name: np.array([getattr(each, name) for each in states]) for name in ("load", "depth", "area")
    }
    for i, state in enumerate(states):
        out |= state.base.pack(f"{i}", reach)
    return out
