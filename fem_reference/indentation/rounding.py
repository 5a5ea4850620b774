"""How much the edges and facets of an indenter are rounded for solutions at finite strain or with friction.

A solution at finite strain has no limit under a perfectly sharp edge, and a mesh must resolve the edge.  The radius is
therefore as small as the finest grid can resolve; results state it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshes import FlatPunch, Indenter
from meshes.array_types import FloatArray

#: Largest fillet over the cover's thickness and over the smallest half width of the indenter: in axisymmetric meshes,
#: and in three dimensions, where elements are larger [-].
_FINE, _COARSE = 1 / 20, 1 / 5
#: Miter limit: largest distance from a convex corner to the inset outline, in units of the inset; that of a 50 degree
#: corner [-].
_MITER = 2.4
#: Width of the thickest wall over half the footprint that a grid can still resolve [-].
_THINNEST_WALL = 0.05
#: Samples along each side of the footprint when the wall thickness of a face is measured [-].
_SAMPLES = 81


def choose_fillet(thickness: float, indenter: Indenter) -> float:
    """Return the radius of rounded edges on the finest grid under a wide cover [m].

    Args:
        thickness: Thickness of the cover [m].
        indenter: The shape; in three dimensions unless it is axisymmetric.

    Raises:
        ValueError: As for `choose_solid_fillet`.
    """
    if indenter.axisymmetric:
        return min(thickness, *indenter.footprint) * _FINE
    return choose_solid_fillet(thickness, indenter)


def choose_solid_fillet(thickness: float, indenter: Indenter) -> float:
    """Return the radius of rounded edges on the finest three-dimensional grid [m].

    The thickest wall of a face is wide enough that even the larger radius on the coarsest grid leaves part of it flat.

    Args:
        thickness: Thickness of the cover [m].
        indenter: The shape.

    Raises:
        ValueError: If all walls of the face are too thin for the grids.
    """
    within = min(indenter.footprint)
    if isinstance(indenter, FlatPunch):
        within = min(within, 2 * float(indenter.signed_distance(*_sample_footprint(indenter)).max()))
    if within < _THINNEST_WALL * max(indenter.footprint):
        raise ValueError(
            f"no wall of the indenter's face is wider than about {max(within, 0) * 1e3:.2g} mm, too thin beside "
            f"{2e3 * max(indenter.footprint):.3g} mm for the grids of finite strain and friction; press it without "
            "friction into linear-elastic layers"
        )
    return min(thickness, within) * _COARSE


def scale_fillet(fillet: float, count: int, grids: Sequence[int]) -> float:
    """Return the fillet on one of several grids, in proportion to the element size [m].

    The differences between the grids then include the effect of the fillet, and so do the error estimates.

    Args:
        fillet: Radius on the finest grid [m].
        count: Elements through the cover on this grid [-].
        grids: Elements through the cover on all grids, finest last [-].
    """
    return fillet * grids[-1] / count


def state_rounding(indenter: Indenter, fillet: float) -> dict[str, str]:
    """Return the statement of a result about its rounded edges or facets, empty for a smooth indenter.

    Args:
        indenter: The shape.
        fillet: Radius on the finest grid [m].
    """
    if indenter.is_flat:
        rounding = f"rounded with {fillet * 1e3:.3g} mm on the finest grid"
        lost = (
            f"; walls thinner than {2e3 * fillet:.3g} mm are left out of that" if _loses_wall(indenter, fillet) else ""
        )
        return {"edge": f"sharp at small strain, {rounding} for what finite strain or friction adds{lost}"}
    return {} if indenter.axisymmetric else {"surface": f"facets and edges rounded over {fillet * 1e3:.3g} mm"}


def _loses_wall(indenter: Indenter, fillet: float) -> bool:
    """Return whether a part of the face is so thin that its rounded edges leave no flat part of it."""
    if indenter.axisymmetric or not isinstance(indenter, FlatPunch):
        return False
    x, y = _sample_footprint(indenter)
    far = indenter.distance_from_inset(fillet, x, y) > _MITER * fillet
    return bool((far & (indenter.signed_distance(x, y) >= 0)).any())


def _sample_footprint(indenter: Indenter) -> tuple[FloatArray, FloatArray]:
    """Return the positions of a regular grid over the footprint [m]."""
    x, y = np.meshgrid(*(np.linspace(-half, half, _SAMPLES) for half in indenter.footprint))
    return x, y
