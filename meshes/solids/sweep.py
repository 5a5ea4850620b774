"""Sweep a surface of quadrilaterals along its normals to a structured mesh of hexahedra."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from meshes.array_types import FloatArray, IntArray
from meshes.solids.base_surface import BaseSurface
from meshes.solids.solid_mesh import SolidMesh

#: Number of layers of elements through the cover, and smallest number that is accepted [-].
LAYERS, LEAST_LAYERS = 4, 2
#: Height of the elements at base and top over the height in the middle of a cover of many layers [-].
_GRADING = 0.5


def sweep(surface: BaseSurface, thickness: npt.ArrayLike, *, layers: int = LAYERS, inward: bool = False) -> SolidMesh:
    """Make the mesh of a cover between a base surface and the surface at a distance along its normals.

    The same input gives the same mesh bit by bit.  The nodes on the base are those of the surface.

    Args:
        surface: Base of the cover; its outer surface if `inward`.
        thickness: Thickness of the cover, one number or one per point of the surface, shape (p,) [m].
        layers: Number of layers of elements, which are thinner towards base and top [-].
        inward: Whether the surface is the outer one, so that the base lies below it.

    Raises:
        ValueError: If a thickness is not positive or there are too few layers.
    """
    height = np.broadcast_to(np.asarray(thickness, dtype=float), len(surface.points))
    if not (np.isfinite(height) & (height > 0)).all():
        raise ValueError(f"the thickness must be positive everywhere, not {height.min():.4g} m")
    if layers < LEAST_LAYERS:
        raise ValueError(f"a cover needs at least {LEAST_LAYERS} layers of elements, not {layers}")
    step = height[:, None] * surface.normals
    base = surface.points - step if inward else surface.points
    levels = grade_heights(layers)
    levels = np.sort(np.concatenate([levels, (levels[1:] + levels[:-1]) / 2]))
    nodes = base + levels[:, None, None] * step
    if inward:
        nodes[-1] = surface.points
    count, quads = len(base), surface.quads
    up = np.arange(3)[:, None] * count
    first = 2 * count * np.arange(layers)[:, None, None, None]
    cells = first + quads[None, :, None, :] + up
    sides = first + _border_edges(quads)[None, :, None, :] + up
    settings = {**surface.settings, "layers": layers, "inward": inward}
    if np.ptp(height) == 0:
        settings["thickness"] = float(height[0])
    return SolidMesh(
        nodes=nodes.reshape(-1, 3),
        cells=cells.reshape(-1, 27),
        base=quads.copy(),
        top=quads + 2 * layers * count,
        sides=sides.reshape(-1, 9),
        source=surface.source,
        settings=settings,
    )


def grade_heights(layers: int) -> FloatArray:
    """Return the heights of the element edges over the thickness, from 0 to 1, shape (layers + 1,) [-]."""
    size = _GRADING + (1 - _GRADING) * np.sin(np.pi * (np.arange(layers) + 0.5) / layers)
    edges = np.concatenate([[0.0], np.cumsum(size) / size.sum()])
    edges[-1] = 1.0
    return np.asarray(edges)


def _border_edges(quads: IntArray) -> IntArray:
    """List the edges that belong to one quadrilateral only, counterclockwise, as indices of 3 points, shape (s, 3)."""
    edges = quads[:, [[0, 1, 2], [2, 5, 8], [8, 7, 6], [6, 3, 0]]].reshape(-1, 3)
    _, place, count = np.unique(edges[:, 1], return_inverse=True, return_counts=True)
    return np.asarray(edges[count[place] == 1])
