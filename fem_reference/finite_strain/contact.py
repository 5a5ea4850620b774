"""Contact of a deforming top surface with a rigid indenter, at the quadrature points of the top facets.

Penalty method: the energy of a point is half the penalty times its squared penetration, per reference area.  Force and
tangent are the exact derivatives of this energy, so Newton's method keeps its quadratic convergence, and the force acts
along the indenter's normal.  The penalty is moderate, so that steps may be long.  Augmentation (Simo and Laursen 1992)
reduces the penetration that it leaves; the rest is part of the error estimates.

Friction: a point in contact is connected by a tangential spring to the place where it first touched, and the spring's
traction is returned to Coulomb's cone (Simo and Laursen 1992, section 3; Wriggers 2006, section 5.2).  The width of the
cone is kept constant while Newton's method runs.  The tangent is then symmetric, and exact except for the rotation of
the tangent plane on curved indenters.  Afterwards the cone is updated until it no longer changes.  Slip is measured
from the last recorded state, so steps must be small while the contact grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem

from fem_reference.elements.taylor_hood import MixedElements, evaluate_shapes
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from meshes.array_types import BoolArray, FloatArray

#: Tangential over normal penalty where points may slide.  With a stiffer spring a point leaves the cone on one side and
#: returns on the other, and Newton's method cycles.  The elastic slip of the soft spring is removed as slip is recorded
#: [-].
TANGENTIAL_PENALTY = 1 / 40
#: Quadrature order on the facets.
_ORDER = 5
#: Distance from the top below which a facet lies on it, over the height of the top [-].
_ON_TOP = 1e-9
#: Value of a shape function below which it vanishes on a facet [-].
_ZERO = 1e-9
#: Lower bound of denominators that may be zero [N] or [Pa].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactState:
    """Contact at one state and depth.

    Shapes are (f, q) for values at quadrature point q of facet f, (f, q, d) for vectors there.

    Attributes:
        force: Contact part of the residual over all unknowns, shape (n,) [N].
        tangent: Derivative of `force` by the unknowns, shape (n, n).
        depth_force: Derivative of `force` by the depth, shape (n,) [N/m].
        total: Force on the indenter along z [N].
        stiffness: Derivative of `total` by the depth at fixed displacements [N/m].
        area: Reference area in contact [m2].
        overlap: Mean distance between the surfaces in contact, weighted by pressure [m].
        pressure: Contact pressure per reference area, shape (f, q) [Pa].
        traction: Frictional traction per reference area, shape (f, q, d); None without friction [Pa].
        position: Positions of the points in the indenter's frame, shape (f, q, d) [m].
        sticking: Which points in contact do not slide, shape (f, q).
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
    position: FloatArray
    sticking: BoolArray


class SurfaceContact:
    """The top of a mesh that may touch an indenter.

    Args:
        elements: Prepared elements.
        top: Height of the undeformed top [m].
        indenter: Surface of the indenter.
        penalty: Pressure per penetration [Pa/m].
        multiple: Force on the whole indenter over the force on the meshed part: 4 for a quarter [-].
        friction: Coefficient of Coulomb friction, inf for no slip [-].

    Attributes:
        weight: Reference area of each point, shape (f, q) [m2].
    """

    def __init__(
        self,
        elements: MixedElements,
        top: float,
        indenter: IndenterSurface,
        *,
        penalty: float,
        multiple: float = 1.0,
        friction: float = 0.0,
    ) -> None:
        mesh, self._dimension = elements.basis.mesh, elements.dimension
        facets = mesh.facets_satisfying(lambda x: np.abs(x[-1] - top) < _ON_TOP * top, boundaries_only=True)
        basis = skfem.FacetBasis(mesh, elements.basis.elem, facets=facets, intorder=_ORDER)
        shapes = evaluate_shapes(basis)
        on_facet = np.abs(shapes).max(axis=(0, 1)) > _ZERO
        self._shape = shapes[..., on_facet]
        self._nodes = basis.element_dofs[on_facet].T.astype(np.int64)
        position = np.asarray(basis.global_coordinates())
        self._position = np.moveaxis(position, 0, -1)
        self.weight = basis.dx * (2 * np.pi * position[0] if self._dimension == 2 else 1.0)  # noqa: PLR2004
        self._top, self._indenter, self._penalty, self.multiple = top, indenter, penalty, multiple
        self._multiplier = np.zeros_like(self.weight)
        self.friction = friction
        self._recorded_position = self._position
        self._recorded_traction = np.zeros_like(self._position)
        self._cone_pressure = np.zeros_like(self.weight)
        self._spring = penalty * (TANGENTIAL_PENALTY if np.isfinite(friction) else 1.0)
        component = np.arange(self._dimension)
        self._unknowns = (self._dimension * self._nodes[:, :, None] + component).reshape(len(self._nodes), -1)

    def evaluate(self, state: FloatArray, depth: float, *, curved: bool = True) -> ContactState:
        """Evaluate the contact.

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            depth: Approach of the indenter [m].
            curved: Whether the tangent includes the indenter's curvature.  Far from equilibrium, large penetrations
                times the curvature of an edge would make Newton's method diverge.
        """
        d = self._dimension
        displacement = state[self._unknowns].reshape(*self._nodes.shape, d)
        moved = self._position + np.einsum("fqa,fai->fqi", self._shape, displacement)
        x, y = moved[..., 0], moved[..., 1] if d == 3 else np.zeros_like(moved[..., 0])  # noqa: PLR2004
        surface = self._indenter.evaluate(x, y)
        # Pressure, and its vector along the indenter's normal with a vertical component of one.
        overlap = moved[..., -1] - (self._top - depth + surface.height)
        trial = self._penalty * overlap + self._multiplier
        touching = trial > 0
        pressure = np.where(touching, trial, 0.0) * self.weight
        stiffness = self._penalty * touching * self.weight
        normal = np.concatenate([-surface.slope[..., : d - 1], np.ones((*overlap.shape, 1))], axis=-1)
        force = pressure[..., None] * normal
        per_depth = stiffness[..., None] * normal
        tangent = stiffness[..., None, None] * normal[..., :, None] * normal[..., None, :]
        if curved:
            tangent[..., : d - 1, : d - 1] -= pressure[..., None, None] * surface.curvature[..., : d - 1, : d - 1]
        # Friction.
        position = moved + depth * np.eye(d)[-1]
        traction, sticking = None, np.zeros_like(touching)
        if self.friction:
            traction, derivative, sticking = self._return_to_cone(position, normal, pressure / self.weight)
            force = force + traction * self.weight[..., None]
            derivative *= self.weight[..., None, None]
            tangent, per_depth = tangent + derivative, per_depth + derivative[..., -1]
        return ContactState(
            force=self._assemble_vector(force, len(state)),
            tangent=self._assemble_matrix(tangent, len(state)),
            depth_force=self._assemble_vector(per_depth, len(state)),
            total=float(force[..., -1].sum()) * self.multiple,
            stiffness=float(per_depth[..., -1].sum()) * self.multiple,
            area=float(self.weight[touching].sum()) * self.multiple,
            overlap=float((pressure * np.abs(overlap)).sum() / max(pressure.sum(), _TINY)),
            pressure=pressure / self.weight,
            traction=traction,
            position=position,
            sticking=sticking,
        )

    def _return_to_cone(
        self, position: FloatArray, normal: FloatArray, pressure: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Compute the friction traction by a return mapping to Coulomb's cone.

        Points are the q quadrature points of f facets in d dimensions.

        Args:
            position: Positions of the points in the indenter's frame, shape (f, q, d) [m].
            normal: Surface normal, scaled so that its vertical component is 1, shape (f, q, d) [-].
            pressure: Pressure along `normal` per unit reference area, shape (f, q) [Pa].

        Returns:
            The traction, shape (f, q, d) [Pa], its derivative with respect to the position, shape (f, q, d, d) [Pa/m],
            and whether each point sticks, shape (f, q).
        """
        length = np.linalg.norm(normal, axis=-1)
        unit = normal / length[..., None]
        plane = np.eye(self._dimension) - unit[..., :, None] * unit[..., None, :]
        spring = self._spring * (pressure > 0)
        trial = self._recorded_traction + self._spring * (position - self._recorded_position)
        trial = np.einsum("fqij,fqj->fqi", plane, trial) * (pressure > 0)[..., None]
        size = np.linalg.norm(trial, axis=-1)
        slides = np.zeros_like(size, dtype=bool)
        reduction = np.ones_like(size)
        if np.isfinite(self.friction):
            limit = self.friction * self._cone_pressure * length
            slides = size > limit
            reduction[slides] = limit[slides] / size[slides]
        direction = trial / np.maximum(size, _TINY)[..., None]
        projection = plane - slides[..., None, None] * direction[..., :, None] * direction[..., None, :]
        derivative = (reduction * spring)[..., None, None] * projection
        return reduction[..., None] * trial, derivative, (pressure > 0) & ~slides

    def update_cone(self, contact: ContactState) -> float:
        """Set the width of Coulomb's cone from the pressures of a state; return their relative change [-]."""
        if not self.friction:
            return 0.0
        change = float((np.abs(contact.pressure - self._cone_pressure) * self.weight).sum())
        self._cone_pressure = contact.pressure
        return change * self.multiple / max(contact.total, _TINY)

    def record_slip(self, contact: ContactState) -> None:
        """Measure slip from this converged state on; points that stick stay connected to where they first stuck."""
        if contact.traction is not None:
            sticking = contact.sticking[..., None]
            self._recorded_position = np.where(sticking, self._recorded_position, contact.position)
            self._recorded_traction = contact.traction

    def augment(self, pressure: FloatArray) -> None:
        """Add a pressure, shape (f, q) [Pa], to that of the penalty; with a solved pressure the penetration shrinks.

        Repeated, this is Uzawa's method: the pressure becomes the Lagrange multiplier of zero penetration.
        """
        self._multiplier = pressure

    def _assemble_vector(self, density: FloatArray, size: int) -> FloatArray:
        """Sum forces at the points, shape (f, q, d), to nodal forces, shape (size,) [N]."""
        each = np.einsum("fqa,fqi->fai", self._shape, density).reshape(self._unknowns.shape)
        return np.bincount(self._unknowns.ravel(), each.ravel(), minlength=size).astype(float)

    def _assemble_matrix(self, density: FloatArray, size: int) -> sp.csr_matrix:
        """Sum derivatives at the points, shape (f, q, d, d), to a matrix of shape (size, size)."""
        touching = np.flatnonzero(np.abs(density).max(axis=(1, 2, 3)) > 0)
        shape = self._shape[touching]
        block = np.einsum("fqa,fqij,fqb->faibj", shape, density[touching], shape, optimize=True)
        rows = self._unknowns[touching]
        n = rows.shape[1]
        i = np.repeat(rows, n, axis=1).ravel()
        j = np.tile(rows, (1, n)).ravel()
        return sp.coo_matrix((block.ravel(), (i, j)), shape=(size, size)).tocsr()
