"""Compute the contact of the deforming top of a cover with a rigid indenter, at quadrature points of the top facets.

Penalty method: the energy of a quadrature point per reference area is half the penalty times the squared penetration.
Force and tangent are the exact derivatives of this energy, so Newton's method converges quadratically, and the force
acts along the normal of the indenter.  The penalty is moderate, so that steps may be long.  Augmentation (Simo and
Laursen 1992) reduces the penetration further; the error estimates include the effect of what is left.

Friction: a tangential spring connects each point in contact to the position of its first contact on the indenter.  A
return mapping limits the traction of the spring to Coulomb's cone (Simo and Laursen 1992, section 3; Wriggers 2006,
section 5.2).  Within one Newton solution the friction limit is computed from fixed contact pressures.  The tangent is
then symmetric, and exact except for the rotation of the tangent plane on curved indenters.  The cone is updated from
the new pressures until it no longer changes.  Slip is measured from the last recorded state.  A point that comes into
contact during a step has moved freely before.  Its position of first contact is extrapolated from its last motion.

The module also converts the tractions at the quadrature points of a solved contact to forces at points in the frame of
the indenter.

A contact point has five columns: position x, y [m], the force along z with which the indenter presses on the cover [N],
and the in-plane components x, y of the frictional force that the indenter exerts on the cover [N].  Positions are those
of the deformed cover.  Without friction the last two columns are zero.  The forces along z of all points add up to the
force on the indenter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem

from fem_reference.elements.line import sum_blocks
from fem_reference.elements.taylor_hood import MixedElements, evaluate_shapes
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from meshes.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class SurfaceContactSettings:
    """Constants of the penalty method and of friction."""

    #: Contact pressure per reference area, in units of stress, above which the penalty grows in proportion [-].  A
    #: surface under high pressure wrinkles unless the penalty exceeds the pressure over the element size by far.
    stiffen: float = 10.0
    #: Polynomial order of the quadrature on the top facets [-].
    order: int = 5
    #: Largest factor on the last motion of a point, when its position of first contact is extrapolated [-].
    ahead: float = 2.0
    #: Absolute value below which the shape function of a node counts as zero on a facet, so that the node is not on it
    #: [-].
    zero: float = 1e-9


_SETTINGS = SurfaceContactSettings()


#: Stiffness of the tangential spring of friction over the normal penalty, for finite friction coefficients [-].  With a
#: stiffer spring, the trial traction leaves the friction cone on opposite sides in turn, and Newton's method cycles.
#: The elastic slip of the soft spring vanishes as slip is recorded.
TANGENTIAL_PENALTY = 1 / 40
#: Distance from the top of the cover, over the height of the top, below which a facet counts as part of the top [-].
_ON_TOP = 1e-9
#: Lower bound of denominators that may be zero [N] or [Pa].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactState:
    """Contact forces and pressures for given displacements of the cover and a given depth of the indenter.

    Shapes are written with n unknowns, f top facets, q quadrature points per facet and d dimensions.

    Attributes:
        force: Contact part of the residual of equilibrium, shape (n,) [N].
        tangent: Derivative of `force` with respect to the unknowns, shape (n, n).
        depth_force: Derivative of `force` with respect to the depth, shape (n,) [N/m].
        total: Force on the whole indenter along z [N].
        stiffness: Derivative of `total` with respect to the depth at fixed displacements [N/m].
        area: Contact area in the undeformed state [m2].
        overlap: Mean absolute distance between cover and indenter in contact, weighted by pressure [m].
        pressure: Contact pressure per reference area, shape (f, q) [Pa].
        traction: Frictional traction per reference area, shape (f, q, d); None without friction [Pa].
        position: Positions of the quadrature points in the frame of the indenter, shape (f, q, d) [m].
        weight: Reference area that belongs to each quadrature point of the meshed part, shape (f, q) [m2].
        sticking: Whether each point is in contact without sliding, shape (f, q).
        gap: Vertical distance of each point from the indenter, negative for penetration, shape (f, q) [m].
        normal: Normal of the indenter at each point, scaled to a vertical component of 1, shape (f, q, d) [-].
        depth: Approach of the indenter from first touch [m].
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
    weight: FloatArray
    sticking: BoolArray
    gap: FloatArray
    normal: FloatArray
    depth: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TopPoints:
    """Quadrature points on the facets of the top of a cover.

    Shapes are written with f facets, q points per facet, a nodes per facet and d dimensions.

    Attributes:
        shape: Shape functions of the nodes at the points, shape (f, q, a).
        nodes: Indices of the displacement nodes of each facet, shape (f, a).
        position: Positions of the undeformed points, shape (f, q, d) [m].
        weight: Area across the motion of the indenter that belongs to each point, shape (f, q) [m2].
    """

    shape: FloatArray
    nodes: IntArray
    position: FloatArray
    weight: FloatArray

    @classmethod
    def on_plane(cls, elements: MixedElements, top: float) -> TopPoints:
        """Place quadrature points on all facets of the mesh that lie at the height `top` [m]."""
        mesh = elements.basis.mesh
        facets = mesh.facets_satisfying(lambda x: np.abs(x[-1] - top) < _ON_TOP * top, boundaries_only=True)
        basis = skfem.FacetBasis(mesh, elements.basis.elem, facets=facets, intorder=_SETTINGS.order)
        shapes = evaluate_shapes(basis)
        on_facet = np.abs(shapes).max(axis=(0, 1)) > _SETTINGS.zero
        position = np.asarray(basis.global_coordinates())
        return cls(
            shape=shapes[..., on_facet],
            nodes=basis.element_dofs[on_facet].T.astype(np.int64),
            position=np.moveaxis(position, 0, -1),
            weight=basis.dx * (2 * np.pi * position[0] if elements.dimension == 2 else 1.0),  # noqa: PLR2004
        )


class SurfaceContact:
    """Contact condition between the top of a meshed cover and a rigid indenter.

    Args:
        elements: Elements of the cover.
        top: Height of the undeformed top of the cover, where the lowest point of the indenter is at depth 0 [m].
        indenter: Surface of the indenter.
        penalty: Contact pressure per penetration [Pa/m].
        multiple: Force on the whole indenter over the force on the meshed part: 4 for a quarter [-].
        friction: Coefficient of Coulomb friction, inf for no slip [-].
        points: Quadrature points; those on the plane at the height `top` if None.

    Attributes:
        weight: Reference area that belongs to each of q quadrature points of f top facets, shape (f, q) [m2].
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
        points: TopPoints | None = None,
    ) -> None:
        points = points or TopPoints.on_plane(elements, top)
        self._dimension = elements.dimension
        self._shape, self._nodes, self._position = points.shape, points.nodes, points.position
        self.weight = points.weight
        self._top, self._indenter, self._penalty, self.multiple = top, indenter, penalty, multiple
        self._first_penalty = penalty
        self._multiplier = np.zeros_like(self.weight)
        self.friction = friction
        self._recorded_position = self._position
        self._recorded_traction = np.zeros_like(self._position)
        self._cone_pressure = np.zeros_like(self.weight)
        self._ahead = np.zeros_like(self._position)
        self._last_depth, self._last_position = 0.0, self._position
        self._last_gap = np.asarray(indenter.height(*self._split_plane(self._position)))
        self._spring = penalty * (TANGENTIAL_PENALTY if np.isfinite(friction) else 1.0)
        component = np.arange(self._dimension)
        self._unknowns = (self._dimension * self._nodes[:, :, None] + component).reshape(len(self._nodes), -1)

    def evaluate(self, state: FloatArray, depth: float, *, expected: FloatArray | None = None) -> ContactState:
        """Evaluate contact forces, pressures and tangent for given displacements and depth.

        Args:
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            depth: Approach of the indenter from first touch [m].
            expected: Contact pressure per reference area with which the curvature of the indenter enters the tangent,
                shape (f, q) [Pa]; the pressure of the state if None.  Far from equilibrium, the pressure of large
                penetrations makes Newton's method diverge.
        """
        d = self._dimension
        moved = self._move(state)
        overlap, normal, curvature = self._measure(moved, depth)
        trial = self._penalty * overlap + self._multiplier
        touching = trial > 0
        pressure = np.where(touching, trial, 0.0) * self.weight
        stiffness = self._penalty * touching * self.weight
        force = pressure[..., None] * normal
        per_depth = stiffness[..., None] * normal
        tangent = stiffness[..., None, None] * normal[..., :, None] * normal[..., None, :]
        held = pressure if expected is None else expected * touching * self.weight
        tangent[..., : d - 1, : d - 1] -= held[..., None, None] * curvature
        # Frictional traction at the positions in the frame of the indenter.
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
            weight=self.weight,
            sticking=sticking,
            gap=-overlap,
            normal=normal,
            depth=depth,
        )

    def _measure(self, moved: FloatArray, depth: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measure the overlap of points with the indenter, at their positions in the deformed state, shape (f, q, d).

        Returns:
            Vertical overlap, shape (f, q) [m].  Direction of its gradient, the normal of the indenter scaled to a
            vertical component of 1, shape (f, q, d) [-].  Curvature of the indenter, shape (f, q, d - 1, d - 1) [1/m].
        """
        across = self._dimension - 1
        surface = self._indenter.evaluate(*self._split_plane(moved))
        overlap = moved[..., -1] - (self._top - depth + surface.height)
        normal = np.concatenate([-surface.slope[..., :across], np.ones((*overlap.shape, 1))], axis=-1)
        return overlap, normal, surface.curvature[..., :across, :across]

    def predict_pressure(self, before: ContactState, state: FloatArray, depth: float) -> FloatArray:
        """Compute the contact pressure per reference area from the gap linearised at another state, shape (f, q) [Pa].

        Args:
            before: Contact at the state at which the gap is linearised.
            state: Displacements [m], then mean pressures [Pa], shape (n,).
            depth: Approach of the indenter from first touch [m].
        """
        change = self._move(state) + depth * np.eye(self._dimension)[-1] - before.position
        overlap = np.einsum("fqi,fqi->fq", before.normal, change) - before.gap
        return np.asarray(np.maximum(self._penalty * overlap + self._multiplier, 0.0))

    def _move(self, state: FloatArray) -> FloatArray:
        """Compute the positions of the quadrature points in the deformed state, shape (f, q, d) [m]."""
        displacement = state[self._unknowns].reshape(*self._nodes.shape, self._dimension)
        return np.asarray(self._position + np.einsum("fqa,fai->fqi", self._shape, displacement))

    def _split_plane(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and y of positions, shape (f, q) each; y is 0 in axisymmetric meshes, where x is the radius."""
        x = position[..., 0]
        return x, position[..., 1] if self._dimension == 3 else np.zeros_like(x)  # noqa: PLR2004

    def _return_to_cone(
        self, position: FloatArray, normal: FloatArray, pressure: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Compute the frictional traction at contact points by a return mapping to Coulomb's cone.

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
        """Set the friction cone from the contact pressures of a state; return the relative change of pressure [-]."""
        if not self.friction:
            return 0.0
        change = float((np.abs(contact.pressure - self._cone_pressure) * self.weight).sum())
        self._cone_pressure = contact.pressure
        return change * self.multiple / max(contact.total, _TINY)

    def record_slip(self, contact: ContactState) -> None:
        """Record positions and tractions of a converged state, from which slip is measured in the next step.

        The recorded position of a sticking point is not changed.  For a point out of contact the predicted position of
        first contact is recorded, by continuation of the last motion.
        """
        if contact.traction is None:
            return
        if contact.depth > self._last_depth:
            step = contact.depth - self._last_depth
            closing = (self._last_gap - contact.gap) / step
            ahead = np.where(closing > 0, contact.gap / np.where(closing > 0, closing, 1.0), 0.0)
            ahead = np.where(contact.pressure > 0, 0.0, np.clip(ahead, 0.0, _SETTINGS.ahead * step))
            self._ahead = ahead[..., None] * (contact.position - self._last_position) / step
            self._last_depth, self._last_gap, self._last_position = contact.depth, contact.gap, contact.position
        open_ = (contact.pressure <= 0)[..., None]
        sticking = contact.sticking[..., None]
        self._recorded_position = np.where(sticking, self._recorded_position, contact.position + open_ * self._ahead)
        self._recorded_traction = contact.traction

    def stiffen(self, pressure: float) -> None:
        """Set the penalty in proportion to the largest contact pressure, if this pressure is high.

        With friction the penalty is not changed, because slip is measured from positions on the penetrated surface.

        Args:
            pressure: Largest contact pressure per reference area [units of stress].
        """
        if not self.friction:
            self._penalty = self._first_penalty * max(1.0, pressure / _SETTINGS.stiffen)

    def augment(self, pressure: FloatArray) -> None:
        """Set the pressure at each quadrature point that is added to the penalty pressure, to reduce the penetration.

        Repeated with the last solved contact pressure this is Uzawa's method, in which the pressure converges to the
        Lagrange multiplier of zero penetration.

        Args:
            pressure: Added pressure at q quadrature points of f facets, shape (f, q) [Pa].
        """
        self._multiplier = pressure

    def _assemble_vector(self, density: FloatArray, size: int) -> FloatArray:
        """Sum contact forces at the quadrature points, shape (f, q, d), to forces on all unknowns, shape (n,) [N]."""
        each = np.einsum("fqa,fqi->fai", self._shape, density).reshape(self._unknowns.shape)
        return np.bincount(self._unknowns.ravel(), each.ravel(), minlength=size).astype(float)

    def _assemble_matrix(self, density: FloatArray, size: int) -> sp.csr_matrix:
        """Sum derivatives of contact forces at the quadrature points to the tangent matrix of all unknowns.

        Args:
            density: Derivatives with respect to the position of the point, shape (f, q, d, d) [N/m].
            size: Number of unknowns.
        """
        touching = np.flatnonzero(np.abs(density).max(axis=(1, 2, 3)) > 0)
        shape = self._shape[touching]
        block = np.einsum("fqa,fqij,fqb->faibj", shape, density[touching], shape, optimize=True)
        rows = self._unknowns[touching]
        return sum_blocks(block.reshape(*rows.shape, rows.shape[1]), rows, rows, (size, size))


class NormalContact(SurfaceContact):
    """Contact at small strain: gaps are measured along the normals of the undeformed top, and pressures act along them.

    Args:
        gap: Function that computes the gaps at a depth [m], shape (f, q) [m].
        normals: Unit normals of the points, shape (f, q, d) [-].
        elements, top, indenter, penalty, points: As of `SurfaceContact`.
    """

    def __init__(
        self,
        gap: Callable[[float], FloatArray],
        normals: FloatArray,
        elements: MixedElements,
        top: float,
        indenter: IndenterSurface,
        *,
        penalty: float,
        points: TopPoints,
    ) -> None:
        super().__init__(elements, top, indenter, penalty=penalty, points=points)
        self._gap, self._normals = gap, normals / normals[..., -1:]

    def _measure(self, moved: FloatArray, depth: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measure the overlap along the undeformed normals, over their vertical components; see `SurfaceContact`."""
        overlap = np.einsum("fqi,fqi->fq", self._normals, moved - self._position) - self._gap(depth)
        return overlap, self._normals, np.zeros((*overlap.shape, self._dimension - 1, self._dimension - 1))


#: Number of points on each ring of an axisymmetric contact [-].
RING_POINTS = 32


def collect_points(contact: ContactState) -> FloatArray:
    """Return the quadrature points in contact with their forces.

    The columns are radius, force along z and radial frictional force of rings in an axisymmetric contact, shape (m, 3).
    In three dimensions they are x, y, force along z, and frictional force along x and y of the meshed part, shape (m,
    5).
    """
    touching = contact.pressure > 0
    pressing = contact.pressure * contact.weight
    # `ContactState.traction` acts on the indenter; the friction on the cover is opposite.  It oscillates between the
    # points of one facet.  The force on a facet is therefore divided among its points in proportion to the normal
    # forces, which keeps it inside Coulomb's cone.
    friction = np.zeros_like(contact.position)
    if contact.traction is not None:
        whole = (contact.traction * contact.weight[..., None]).sum(axis=1, keepdims=True)
        total = np.maximum(pressing.sum(axis=1, keepdims=True), _TINY)
        friction = whole * (pressing / total)[..., None]
    normal = pressing + friction[..., -1]
    return np.column_stack([contact.position[touching][:, :-1], normal[touching], -friction[touching][:, :-1]])


def unfold_points(points: FloatArray, symmetric: tuple[bool, bool]) -> FloatArray:
    """Extend the contact points of a half or quarter to the whole contact by mirror images.

    Args:
        points: Contact points of the meshed part, shape (m, 5).
        symmetric: Whether x = 0 and y = 0 are planes of symmetry.
    """
    for axis in range(2):
        if symmetric[axis]:
            sign = np.ones(5)
            sign[[axis, 3 + axis]] = -1.0
            points = np.concatenate([points, points * sign])
    return points


def divide_rings(rings: FloatArray) -> FloatArray:
    """Divide every ring of an axisymmetric contact into points with equal forces, which sum to that of the ring.

    The points of every second ring are rotated by half the angle between two points.

    Args:
        rings: Radius [m], force along z and radial frictional force [N] of k rings, shape (k, 3).

    Returns:
        Contact points, shape (k * `RING_POINTS`, 5).
    """
    radius, normal, radial = rings[:, :, None].transpose(1, 0, 2)
    turn = 0.5 * (np.arange(len(rings)) % 2)[:, None]
    angle = 2 * np.pi * (np.arange(RING_POINTS) + turn) / RING_POINTS
    c, s = np.cos(angle), np.sin(angle)
    columns = [radius * c, radius * s, normal / RING_POINTS, radial / RING_POINTS * c, radial / RING_POINTS * s]
    return np.stack(np.broadcast_arrays(*columns), axis=-1).reshape(-1, 5)
