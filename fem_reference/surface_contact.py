"""Frictionless contact of a deforming top surface with a rigid obstacle, at the quadrature points of its facets.

Energy: penalty / 2 times the squared overlap of each point with the obstacle's height, per reference area.  Force and
tangent are its exact derivatives, so Newton's method keeps its order, and the force points along the obstacle's normal.
The penalty is moderate, so that steps may be long; the overlap it leaves is taken away by augmentation (Simo and
Laursen 1992) and what remains is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import skfem

from fem_reference.elements import MixedElements
from fem_reference.obstacle import Obstacle

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Touch:
    """Contact at one state and depth.

    Attributes:
        force: Contact part of the residual over displacement unknowns, shape (n,) [N].
        tangent: Its derivative.
        depth_force: Derivative of the residual by depth, shape (n,) [N/m].
        total: Force on the indenter along z [N].
        stiffness: Derivative of the total by depth at fixed displacements [N/m].
        area: Reference area that touches [m2].
        overlap: Mean distance between touching surface and obstacle, weighted by pressure [m].
        pressure: Contact pressure at the points, per reference area [Pa].
    """

    force: FloatArray
    tangent: sp.csr_matrix
    depth_force: FloatArray
    total: float
    stiffness: float
    area: float
    overlap: float
    pressure: FloatArray


class SurfaceContact:
    """The top of a mesh that may touch an obstacle.

    Args:
        elements: Prepared elements.
        top: Height of the undeformed top [m].
        obstacle: What comes down on it.
        penalty: Pressure per overlap [Pa/m].
        multiple: Whole force over the force on the modelled part (4 for a quarter) [-].
    """

    def __init__(
        self, elements: MixedElements, top: float, obstacle: Obstacle, *, penalty: float, multiple: float = 1.0
    ) -> None:
        mesh, self._d = elements.basis.mesh, elements.dimension
        facets = mesh.facets_satisfying(lambda x: np.abs(x[-1] - top) < 1e-9 * top, boundaries_only=True)
        basis = skfem.FacetBasis(mesh, elements.basis.elem, facets=facets, intorder=5)
        shapes = np.stack([np.broadcast_to(np.asarray(basis.basis[a][0]), basis.dx.shape) for a in range(basis.Nbfun)])
        used = np.abs(shapes).max(axis=(1, 2)) > 1e-9  # noqa: PLR2004 -- functions that live on the facet
        self._shape = shapes[used].transpose(1, 2, 0)
        self._nodes = basis.element_dofs[used].T.astype(np.int64)
        place = np.asarray(basis.global_coordinates())
        self._place = np.moveaxis(place, 0, -1)
        self._weight = basis.dx * (2 * np.pi * place[0] if self._d == 2 else 1.0)  # noqa: PLR2004
        self._top, self._obstacle, self._penalty, self.multiple = top, obstacle, penalty, multiple
        self._multiplier = np.zeros_like(self._weight)
        self._unknowns = (self._d * self._nodes[:, :, None] + np.arange(self._d)).reshape(len(self._nodes), -1)

    def at(self, state: FloatArray, depth: float, *, curved: bool = True) -> Touch:
        """Evaluate contact for displacements `state` [m] and an approach `depth` [m].

        Without `curved` the tangent leaves out the obstacle's curvature: far from equilibrium, false overlaps times the
        curvature of an edge would throw Newton's method off.
        """
        d = self._d
        moved = self._place + np.einsum(
            "fqa,fai->fqi", self._shape, state[self._unknowns].reshape(*self._nodes.shape, d)
        )
        x, y = moved[..., 0], moved[..., 1] if d == 3 else np.zeros_like(moved[..., 0])  # noqa: PLR2004
        height = self._obstacle.at(x, y)
        overlap = moved[..., -1] - (self._top - depth + height.value)
        pressed = self._penalty * overlap + self._multiplier
        touching = pressed > 0
        pressure = np.where(touching, pressed, 0.0) * self._weight
        active = self._penalty * touching * self._weight
        normal = np.concatenate([-height.slope[..., : d - 1], np.ones((*overlap.shape, 1))], axis=-1)
        curve = active[..., None, None] * normal[..., :, None] * normal[..., None, :]
        if curved:
            curve[..., : d - 1, : d - 1] -= pressure[..., None, None] * height.curvature[..., : d - 1, : d - 1]
        return Touch(
            force=self._scatter(pressure[..., None] * normal, len(state)),
            tangent=self._matrix(curve, len(state)),
            depth_force=self._scatter(active[..., None] * normal, len(state)),
            total=float(pressure.sum()) * self.multiple,
            stiffness=float(active.sum()) * self.multiple,
            area=float(self._weight[touching].sum()) * self.multiple,
            overlap=float((pressure * np.abs(overlap)).sum() / max(pressure.sum(), 1e-300)),
            pressure=pressure / self._weight,
        )

    def augment(self, touch: Touch) -> None:
        """Take the pressures found as multipliers, so that the next solve leaves less overlap (Uzawa)."""
        self._multiplier = touch.pressure

    def _scatter(self, density: FloatArray, size: int) -> FloatArray:
        each = np.einsum("fqa,fqi->fai", self._shape, density).reshape(self._unknowns.shape)
        return np.bincount(self._unknowns.ravel(), each.ravel(), minlength=size).astype(float)

    def _matrix(self, density: FloatArray, size: int) -> sp.csr_matrix:
        touching = np.flatnonzero(np.abs(density).max(axis=(1, 2, 3)) > 0)
        shape = self._shape[touching]
        block = np.einsum("fqa,fqij,fqb->faibj", shape, density[touching], shape, optimize=True)
        rows = self._unknowns[touching]
        n = rows.shape[1]
        i = np.repeat(rows, n, axis=1).ravel()
        j = np.tile(rows, (1, n)).ravel()
        return sp.coo_matrix((block.ravel(), (i, j)), shape=(size, size)).tocsr()
