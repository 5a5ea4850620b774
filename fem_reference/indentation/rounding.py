"""Choose grids, and the radius with which edges and facets are rounded, at finite strain or with friction.

A finite-strain solution under a perfectly sharp edge does not converge as the mesh is refined, and the elements must
resolve a rounded edge.  The radius is therefore as small as the finest grid can resolve; results state the radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_reference.finite_strain.block_path import is_rectangular
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import FlatPunch, Indenter
from meshes.array_types import FloatArray
from meshes.pose import Pose

#: Radius of rounded edges in axisymmetric meshes, over the smaller of cover thickness and half width of the indenter
#: [-].
_FINE = 1 / 20
#: Radius of rounded edges in three dimensions, where elements are larger, over the smaller of cover thickness and half
#: width of the indenter [-].
_COARSE = 1 / 5
#: Number of elements through the cover on the three grids in three dimensions; the result is that of the finest [-].
SOLID_GRIDS = (2, 3, 4)
#: Larger radius of rounded edges over that of `choose_solid_fillet`, where radius and elements are refined in turn [-].
_WIDE_EDGE = 3 / 4
#: Smaller radius of rounded edges over that of `choose_solid_fillet`, where radius and elements are refined in turn
#: [-].
_NARROW_EDGE = 3 / 8
#: Estimated difference between the result with the smaller radius and that with a sharp edge, over the difference
#: between the results with the two radii, for edges on mesh lines [-].  In the r-z plane without slip at finite strain,
#: radii down to a fortieth of the thickness can be solved, and this ratio is 0.9 to 2.1
#: (`tests/verification/test_rounded_edges.py`).
_ON_LINES = 2.0
#: The ratio `_ON_LINES` for edges that are not on mesh lines, which the elements resolve less [-].
_OFF_LINES = 3.0
#: Largest distance from a convex corner of a face to its inset outline, over the inset, for a corner of 50 degrees [-].
#: A point of the face that is further from the inset outline is on a wall that the inset removes.
_MITER = 2.4
#: Smallest width of the thickest wall of a face that a grid can resolve, over half the footprint [-].
_THINNEST_WALL = 0.05
#: Number of sample points along each side of the footprint in the measurement of a face's wall thickness [-].
_SAMPLES = 81


@dataclass(frozen=True, kw_only=True)
class SolidGrid:
    """One of the grids in three dimensions.

    Attributes:
        count: Number of elements through the cover [-].
        fillet: Radius of rounded edges of the indenter [m].
    """

    count: int
    fillet: float


def choose_solid_grids(thickness: float, indenter: Indenter, *, in_turn: bool) -> tuple[SolidGrid, ...]:
    """Choose the three grids in three dimensions.

    With friction the force rises as the radius of an edge falls, and falls with finer elements.  If radius and elements
    are refined together, the two effects cancel in the differences between the grids.  They are therefore refined in
    turn: the second grid has edges of half the radius of the first one, the third grid more elements than the first.

    Args:
        thickness: Thickness of the cover [m].
        indenter: Indenter with a flat face or with edges.
        in_turn: Whether radius and elements are refined in turn.

    Raises:
        ValueError: As for `choose_solid_fillet`.
    """
    fillet = choose_solid_fillet(thickness, indenter)
    if in_turn:
        parts = ((SOLID_GRIDS[0], _WIDE_EDGE), (SOLID_GRIDS[0], _NARROW_EDGE), (SOLID_GRIDS[1], _WIDE_EDGE))
        return tuple(SolidGrid(count=count, fillet=share * fillet) for count, share in parts)
    return tuple(SolidGrid(count=n, fillet=scale_fillet(fillet, n, SOLID_GRIDS)) for n in SOLID_GRIDS)


def choose_edge_safety(path: LoadingPath, pose: Pose) -> float:
    """Choose `_ON_LINES` or `_OFF_LINES`; 0 if radius and elements are not refined in turn [-].

    Args:
        path: Cover, indenter and friction.
        pose: Pose of the indenter in the frame of the mesh.
    """
    if not path.refines_in_turn:
        return 0.0
    face = path.indenter
    on_lines = pose.is_aligned and isinstance(face, FlatPunch) and is_rectangular(face)
    return _ON_LINES if on_lines else _OFF_LINES


def choose_fillet(thickness: float, indenter: Indenter) -> float:
    """Choose the radius of an indenter's rounded edges on the finest grid, on a wide cover [m].

    Args:
        thickness: Thickness of the cover [m].
        indenter: Indenter; solved in three dimensions unless it is axisymmetric.

    Raises:
        ValueError: As for `choose_solid_fillet`.
    """
    if indenter.axisymmetric:
        return min(thickness, *indenter.footprint) * _FINE
    return choose_solid_fillet(thickness, indenter)


def choose_solid_fillet(thickness: float, indenter: Indenter) -> float:
    """Choose the radius of an indenter's rounded edges on the finest three-dimensional grid [m].

    Radii are proportional to the element size, so coarser grids have larger radii.  A wall is a strip of the indenter's
    flat face, such as a leg of the letter H.  The radius is limited so that the middle of the thickest wall stays flat
    even with the radius of the coarsest grid.

    Args:
        thickness: Thickness of the cover, which sets the element size [m].
        indenter: Indenter with a flat face or with edges.

    Raises:
        ValueError: If even the thickest wall is too thin.
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
    """Compute the radius of rounded edges on one of several grids, in proportion to the element size [m].

    The differences between the grids, and thus the error estimates, then include the effect of the rounding.

    Args:
        fillet: Radius of rounded edges on the finest grid [m].
        count: Number of elements through the cover on this grid [-].
        grids: Number of elements through the cover on every grid, finest last [-].
    """
    return fillet * grids[-1] / count


def state_rounding(indenter: Indenter, fillet: float) -> dict[str, str]:
    """State in words, by topic, how edges or facets of an indenter are rounded; empty for a smooth indenter.

    Args:
        indenter: Indenter with its shape.
        fillet: Radius of rounded edges on the finest grid [m].
    """
    if indenter.is_flat:
        rounding = f"rounded with {fillet * 1e3:.3g} mm on the finest grid"
        lost = (
            f"; walls thinner than {2e3 * fillet:.3g} mm are left out of that" if _loses_wall(indenter, fillet) else ""
        )
        return {"edge": f"sharp at small strain, {rounding} for what finite strain or friction adds{lost}"}
    return {} if indenter.axisymmetric else {"surface": f"facets and edges rounded over {fillet * 1e3:.3g} mm"}


def _loses_wall(indenter: Indenter, fillet: float) -> bool:
    """Return whether some wall of the face is so thin that no flat part remains between its rounded edges."""
    if indenter.axisymmetric or not isinstance(indenter, FlatPunch):
        return False
    x, y = _sample_footprint(indenter)
    far = indenter.distance_from_inset(fillet, x, y) > _MITER * fillet
    return bool((far & (indenter.signed_distance(x, y) >= 0)).any())


def _sample_footprint(indenter: Indenter) -> tuple[FloatArray, FloatArray]:
    """Return x and y of the points of a regular grid over the footprint of an indenter [m]."""
    x, y = np.meshgrid(*(np.linspace(-half, half, _SAMPLES) for half in indenter.footprint))
    return x, y
