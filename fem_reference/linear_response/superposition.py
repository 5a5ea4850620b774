"""Superpose the base forces of many forces on the top of a cover.

The response of the base varies smoothly with the position of a force.  Many forces are therefore replaced by forces on
a regular grid of points that have the same effect on every polynomial of the position up to degree 5.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fem_reference.linear_response.point_spread import TexelInfluence
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Pose

#: Step of the grid to which contact forces are moved for the superposition, over the cover thickness, and number of
#: grid points that replace one force along each axis [-].
_GRID_STEP, _STENCIL = 1 / 8, 6


def superpose(contact: FloatArray, base_response: TexelInfluence, array: TexelArray, pose: Pose) -> FloatArray:
    """Compute the forces on n texels and then the force outside them due to all contact forces, shape (n + 1,) [N].

    Args:
        contact: Columns x, y in the frame of the indenter [m] and force [N] of m cells, shape (m, 3).
        base_response: Base forces per unit point load.
        array: Array with n texels.
        pose: Pose of the indenter in the frame of the array.
    """
    x, y, force = contact.T
    step = base_response.thickness * _GRID_STEP
    (grid_x, along), (grid_y, across) = (_interpolate(each, step) for each in pose.plan_to_array(x, y))
    loads = (along.T @ sp.diags_array(force) @ across).toarray()
    return base_response.base_forces(array, grid_x, grid_y, loads)


def _interpolate(places: FloatArray, step: float) -> tuple[FloatArray, sp.csr_array]:
    """Choose a regular grid over m places and interpolate from it, with Lagrange polynomials of degree 5.

    Args:
        places: Positions, shape (m,) [m].
        step: Largest step of the grid [m].

    Returns:
        Points of the grid, shape (g,) [m], and the weight of every point at every place, shape (m, g) [-].
    """
    low, high = float(places.min()), float(places.max())
    count = max(_STENCIL, int(np.ceil((high - low) / step)) + 1)
    if not high > low:
        return np.array([low]), sp.csr_array(np.ones((len(places), 1)))
    grid = np.linspace(low, high, count)
    offset = (places - low) / (high - low) * (count - 1)
    first = np.clip(np.floor(offset).astype(int) - _STENCIL // 2 + 1, 0, count - _STENCIL)
    node = np.arange(_STENCIL)
    local = (offset - first)[:, None]
    weight = np.ones((len(places), _STENCIL))
    for other in node:
        weight *= np.where(node == other, 1.0, (local - other) / np.where(node == other, 1, node - other))
    row = np.repeat(np.arange(len(places)), _STENCIL)
    return grid, sp.csr_array((weight.ravel(), (row, (first[:, None] + node).ravel())), shape=(len(places), count))
