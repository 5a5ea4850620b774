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


def collect_points(contact: ContactState) -> FloatArray:
    """Return the quadrature points in contact with their forces.

    In an axisymmetric contact a point stands for a ring: the columns are radius, force along z and radial frictional
    force, shape (m, 3).  In three dimensions they are x, y, force along z and frictional force along x and y of the
    meshed part, shape (m, 5).
    """
    touching = contact.pressure > 0
    weight = contact.weight[touching]
    position = contact.position[touching][:, :-1]
    # `ContactState.force` is the force of the cover on the indenter along z, and friction on the cover is opposite.
    friction = np.zeros((len(weight), position.shape[1] + 1))
    if contact.traction is not None:
        friction = contact.traction[touching] * weight[:, None]
    normal = contact.pressure[touching] * weight + friction[:, -1]
    return np.column_stack([position, normal, -friction[:, :-1]])


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
