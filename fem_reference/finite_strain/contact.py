"""Contact of a deforming top surface with a rigid obstacle, at the quadrature points of its facets.

Energy: penalty / 2 times the squared overlap of each point with the obstacle's height, per reference area.  Force and
tangent are its exact derivatives, so Newton's method keeps its order, and the force points along the obstacle's normal.
The penalty is moderate, so that steps may be long; the overlap it leaves is taken away by augmentation (Simo and
Laursen 1992) and what remains is part of the error estimates.

Friction: a point in touch is tied to where it touched by a tangential spring, whose traction is returned to Coulomb's
cone (Simo and Laursen 1992, section 3; Wriggers 2006, section 5.2).  The cone's width is frozen while Newton's method
runs, which leaves the tangent symmetric and, but for the turn of the tangent plane on curved shapes, exact; it is
renewed until it no longer changes.  Slip counts from the last settled state: steps must be small where the contact
grows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import skfem

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.indenter_surface import Height

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class Rigid(Protocol):
    """What comes down on the top: an `Obstacle`, or one that stands elsewhere."""

    def at(self, x: FloatArray, y: FloatArray) -> Height:
        """Height over its lowest point with its derivatives, at points in the mesh's frame."""


#: Tangential over normal penalty where points may slide: stiffer springs leave the cone on one side and come back on
#: the other.  What a spring gives is taken away as slip is settled [-].
_ALONG = 1 / 40


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
        traction: Frictional traction on the points, per reference area, shape (..., d); None without friction [Pa].
        place: Where the points are over the indenter, shape (..., d) [m].
        sticks: Which points friction holds where they are, shape (...,).
    """

    force: FloatArray
    tangent: sp.csr_matrix
    depth_force: FloatArray
    total: float
    stiffness: float
    area: float
    overlap: float
    pressure: FloatArray
    traction: FloatArray | None
    place: FloatArray
    sticks: npt.NDArray[np.bool_]


class SurfaceContact:
    """The top of a mesh that may touch an obstacle.

    Args:
        elements: Prepared elements.
        top: Height of the undeformed top [m].
        obstacle: What comes down on it.
        penalty: Pressure per overlap [Pa/m].
        multiple: Whole force over the force on the modelled part (4 for a quarter) [-].
        friction: Coefficient of Coulomb's law, inf for no slip [-].

    Attributes:
        weight: Reference area of each point, shape (f, q) [m2].
    """

    def __init__(
        self,
        elements: MixedElements,
        top: float,
        obstacle: Rigid,
        *,
        penalty: float,
        multiple: float = 1.0,
        friction: float = 0.0,
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
        self.weight = basis.dx * (2 * np.pi * place[0] if self._d == 2 else 1.0)  # noqa: PLR2004
        self._top, self._obstacle, self._penalty, self.multiple = top, obstacle, penalty, multiple
        self._multiplier = np.zeros_like(self.weight)
        self.friction = friction
        self._settled_place = self._place
        self._settled_traction = np.zeros_like(self._place)
        self._cone = np.zeros_like(self.weight)
        self._spring = penalty * (_ALONG if np.isfinite(friction) else 1.0)
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
        pressure = np.where(touching, pressed, 0.0) * self.weight
        active = self._penalty * touching * self.weight
        normal = np.concatenate([-height.slope[..., : d - 1], np.ones((*overlap.shape, 1))], axis=-1)
        curve = active[..., None, None] * normal[..., :, None] * normal[..., None, :]
        if curved:
            curve[..., : d - 1, : d - 1] -= pressure[..., None, None] * height.curvature[..., : d - 1, : d - 1]
        force = pressure[..., None] * normal
        per_depth = active[..., None] * normal
        place = moved + depth * np.eye(d)[-1]
        traction, sticks = None, np.zeros_like(touching)
        if self.friction:
            traction, along, sticks = self._drag(place, normal, pressure / self.weight)
            force = force + traction * self.weight[..., None]
            along *= self.weight[..., None, None]
            curve, per_depth = curve + along, per_depth + along[..., -1]
        return Touch(
            force=self._scatter(force, len(state)),
            tangent=self._matrix(curve, len(state)),
            depth_force=self._scatter(per_depth, len(state)),
            total=float(force[..., -1].sum()) * self.multiple,
            stiffness=float(per_depth[..., -1].sum()) * self.multiple,
            area=float(self.weight[touching].sum()) * self.multiple,
            overlap=float((pressure * np.abs(overlap)).sum() / max(pressure.sum(), 1e-300)),
            pressure=pressure / self.weight,
            traction=traction,
            place=place,
            sticks=sticks,
        )

    def _drag(
        self, place: FloatArray, normal: FloatArray, pressure: FloatArray
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Frictional traction that holds the points back, its derivative by their place, and which points stick.

        Args:
            place: Points over the indenter, shape (f, q, d) [m].
            normal: The pressure's direction, of vertical part one, shape (f, q, d) [-].
            pressure: Per reference area, along `normal`, shape (f, q) [Pa].
        """
        length = np.linalg.norm(normal, axis=-1)
        unit = normal / length[..., None]
        plane = np.eye(self._d) - unit[..., :, None] * unit[..., None, :]
        spring = self._spring * (pressure > 0)
        trial = self._settled_traction + self._spring * (place - self._settled_place)
        trial = np.einsum("fqij,fqj->fqi", plane, trial) * (pressure > 0)[..., None]
        size = np.linalg.norm(trial, axis=-1)
        slips = np.zeros_like(size, dtype=bool)
        kept = np.ones_like(size)
        if np.isfinite(self.friction):
            limit = self.friction * self._cone * length
            slips = size > limit
            kept[slips] = limit[slips] / size[slips]
        way = trial / np.maximum(size, 1e-300)[..., None]
        across = plane - slips[..., None, None] * way[..., :, None] * way[..., None, :]
        return kept[..., None] * trial, (kept * spring)[..., None, None] * across, (pressure > 0) & ~slips

    def renew_cone(self, touch: Touch) -> float:
        """Take the pressures found for the width of Coulomb's cone; return how much of them changed [-]."""
        if not self.friction:
            return 0.0
        change = float((np.abs(touch.pressure - self._cone) * self.weight).sum())
        self._cone = touch.pressure
        return change * self.multiple / max(touch.total, 1e-300)

    def settle(self, touch: Touch) -> None:
        """Count slip from this converged state on; points that stick are pulled back to where they stuck."""
        if touch.traction is not None:
            self._settled_place = np.where(touch.sticks[..., None], self._settled_place, touch.place)
            self._settled_traction = touch.traction

    def augment(self, pressure: FloatArray) -> None:
        """Take pressures found, shape (f, q) [Pa], as multipliers: the next solve leaves less overlap (Uzawa)."""
        self._multiplier = pressure

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
