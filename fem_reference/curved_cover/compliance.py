"""Compliance of the top of a curved cover between its nodes, computed where it is needed and kept.

The compliance of a node is one solution of the factorised solid for each direction of the force.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.solid import CoverSolid
from meshes.array_types import FloatArray, IntArray

#: Number of nodes of the top that are loaded at a time, along the normal and along three axes, to limit the memory [-].
_BLOCK, _VECTOR_BLOCK = 64, 16


class NormalCompliance:
    """Normal displacements of all m nodes of the top per normal force on one of them.

    Args:
        solid: Factorised cover.
    """

    def __init__(self, solid: CoverSolid) -> None:
        self.solid = solid
        self.top = FacetSurface.part_of(solid.nodes, solid.layout.top)
        self._rows: dict[int, FloatArray] = {}

    @cached_property
    def vectors(self) -> VectorCompliance:
        """Compliance to forces in all directions."""
        return VectorCompliance(self.solid, self.top.index)

    def rows(self, nodes: IntArray) -> FloatArray:
        """Return the displacements against the normals per force against the normal of each of k nodes.

        Args:
            nodes: Indices of nodes of the top, shape (k,).

        Returns:
            Displacements of all nodes of the top, shape (k, m) [m/N].
        """
        missing = [int(node) for node in nodes if int(node) not in self._rows]
        for start in range(0, len(missing), _BLOCK):  # loads on all nodes of the cover take much memory
            part = missing[start : start + _BLOCK]
            forces = np.zeros((len(part), len(self.solid.nodes), 3))
            forces[np.arange(len(part)), self.top.index[part]] = -self.top.normals[part]
            moved = self.solid.solve(self.top.index, forces=forces)
            found = -np.einsum("kmc,mc->km", moved, self.top.normals, optimize=True)
            self._rows.update(zip(part, found, strict=True))
        return np.array([self._rows[int(node)] for node in nodes]).reshape(len(nodes), len(self.top.nodes))


class VectorCompliance:
    """Displacements of the nodes of the top per force on one of them along x, y and z.

    Args:
        solid: Factorised cover.
        nodes: Indices, in the solid, of the m nodes of the top, shape (m,).
    """

    def __init__(self, solid: CoverSolid, nodes: IntArray) -> None:
        self._solid, self._nodes = solid, nodes
        self._columns: dict[int, FloatArray] = {}

    def columns(self, loaded: IntArray, seen: IntArray) -> FloatArray:
        """Return the displacements of w nodes of the top per force on each of k others.

        Args:
            loaded: Indices of nodes of the top, shape (k,).
            seen: Indices of nodes of the top, shape (w,).

        Returns:
            Displacements by loaded node, direction of the force, moved node and direction, shape (k, 3, w, 3) [m/N].
        """
        missing = [int(node) for node in loaded if int(node) not in self._columns]
        for start in range(0, len(missing), _VECTOR_BLOCK):
            part = np.array(missing[start : start + _VECTOR_BLOCK])
            forces = np.zeros((len(part), 3, len(self._solid.nodes), 3))
            for axis in range(3):
                forces[np.arange(len(part)), axis, self._nodes[part], axis] = 1.0
            moved = self._solid.solve(self._nodes, forces=forces.reshape(-1, *self._solid.nodes.shape))
            self._columns.update(zip(part.tolist(), moved.reshape(len(part), 3, -1, 3), strict=True))
        return np.array([self._columns[int(node)][:, seen] for node in loaded])
