"""Convert the tractions at the quadrature points of a solved contact to forces at points in the frame of the indenter.

A contact point has five columns: position x, y [m], the force along z with which the indenter presses on the cover [N],
and the in-plane components x, y of the frictional force that the indenter exerts on the cover [N].  Positions are those
of the deformed cover.  Without friction the last two columns are zero.  The forces along z of all points add up to the
force on the indenter.
"""

from __future__ import annotations

import numpy as np

from fem_reference.finite_strain.contact import ContactState
from meshes.array_types import FloatArray

#: Number of points on each ring of an axisymmetric contact [-].
RING_POINTS = 32
#: Lower bound of a denominator that may be zero [N].
_TINY = 1e-300


def collect_points(contact: ContactState) -> FloatArray:
    """Return the quadrature points in contact with their forces.

    In an axisymmetric contact a point stands for a ring: the columns are radius, force along z and radial frictional
    force, shape (m, 3).  In three dimensions they are x, y, force along z and frictional force along x and y of the
    meshed part, shape (m, 5).
    """
    touching = contact.pressure > 0
    pressing = contact.pressure * contact.weight
    # `ContactState.traction` acts on the indenter, and friction on the cover is opposite.  It oscillates between the
    # points of one facet, so the force on a facet is divided among its points in proportion to the normal forces, which
    # keeps it inside Coulomb's cone.
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

    The points of every second ring are turned by half the angle between two points.

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
