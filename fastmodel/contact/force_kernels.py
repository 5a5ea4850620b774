"""Compiled kernels that sum MuJoCo's contact forces along the normals of boxes and of plates.

A contact's force f acts on its second geom, and -f on its first.  It is given in the contact's own frame, whose rows
are the contact normal and two tangents.  Contacts with elliptic cones store f itself.  Contacts with pyramidal cones
store edge forces e: the normal force is their sum, and the i-th tangential force is mu_i (e_2i - e_2i+1).  Components
from the fourth on are torques, which do not press.
Source: MuJoCo documentation, Computation, section "Contact".

All kernels stand in one file: numba's cache notices a change in the file of the called kernel only, not in the files of
the functions that this kernel calls.
"""

from __future__ import annotations

import mujoco
import numpy as np

from fastmodel.compiled import called_by_kernels
from meshes.array_types import FloatArray, IntArray

#: The contacts of a state: both geoms of each contact, shape (k, 2); its first row in the constraint forces, -1 for
#: none, shape (k,); its dimension, shape (k,); the axes of its frame as rows, normal first, shape (k, 9) [-]; its
#: friction coefficients, shape (k, 5) [-]; its position in the world, shape (k, 3) [m]; all constraint forces, shape
#: (rows,) [N]; and whether friction cones are pyramidal.
Contacts = tuple[IntArray, IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, bool]


def read_contacts(data: mujoco.MjData, *, pyramidal: bool) -> Contacts:
    """Read the contacts of a state.

    Args:
        data: The state.
        pyramidal: Whether the model has pyramidal friction cones.
    """
    found = data.contact
    places = (found.frame, found.friction, found.pos)
    return (found.geom, found.efc_address, found.dim, *places, data.efc_force, pyramidal)


def imitate_contacts(data: mujoco.MjData, *, pyramidal: bool) -> tuple[Contacts, Contacts]:
    """Contacts without force in the two memory layouts that MuJoCo gives them, for the compilation of kernels.

    Numba compiles a kernel once per layout.  Arrays of at most one contact count as contiguous, those of several
    contacts as strided.

    Args:
        data: A state without contacts.
        pyramidal: Whether the model has pyramidal friction cones.
    """
    none = read_contacts(data, pyramidal=pyramidal)
    # address -1 marks a contact without force
    geom, address, dim, frame, friction, pos = (np.full((4, *a.shape[1:]), -1, a.dtype)[::2] for a in none[:6])
    return none, (geom, address, dim, frame, friction, pos, *none[6:])


@called_by_kernels
def _decode_force(contacts: Contacts, k: int, force: FloatArray) -> None:
    """Normal and two tangential components of the force of contact k, into `force`, shape (3,) [N]."""
    _, address, dim, _, friction, _, efc_force, pyramidal = contacts
    force[:] = 0.0
    first = address[k]
    if pyramidal and dim[k] > 1:
        for edge in range(2 * (dim[k] - 1)):
            force[0] += efc_force[first + edge]
        for axis in range(1, min(dim[k], 3)):
            edge = first + 2 * (axis - 1)
            force[axis] = friction[k, axis - 1] * (efc_force[edge] - efc_force[edge + 1])
    else:
        for axis in range(min(dim[k], 3)):
            force[axis] = efc_force[first + axis]


def press_boxes(
    contacts: Contacts, geom_xmat: FloatArray, texel_of: IntArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Kernel: compute the contact forces against the boxes' outward normals, by contact and by texel.

    Args:
        contacts: The contacts.
        geom_xmat: Orientation of every geom in the world, shape (geoms, 9) [-].
        texel_of: Texel of every geom, -1 for geoms that are no texel, shape (geoms + 1,).
        count: Number of texels n.

    Returns:
        Force on either geom of each contact, zero for a geom that is no texel, shape (k, 2) [N]; and the sum for each
        texel, shape (n,) [N].
    """
    geom, address, _, frame, _, _, _, _ = contacts
    force, pressed, total = np.zeros(3), np.zeros(geom.shape), np.zeros(count)
    for k in range(len(geom)):
        if address[k] < 0 or (texel_of[geom[k, 0]] < 0 and texel_of[geom[k, 1]] < 0):
            continue
        _decode_force(contacts, k, force)
        for side, sign in ((0, 1.0), (1, -1.0)):
            texel = texel_of[geom[k, side]]
            if texel < 0:
                continue
            # The box's outward normal is the third column of its orientation.
            normal = geom_xmat[geom[k, side], 2::3]
            for axis in range(3):
                for i in range(3):
                    pressed[k, side] += sign * force[axis] * frame[k, 3 * axis + i] * normal[i]
            total[texel] += pressed[k, side]
    return pressed, total


def sum_forces(
    contacts: Contacts, plate: int, body_of_geom: IntArray, axes: FloatArray, origin: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Kernel: sum contact forces against the plate's normal, and their moments, body by body.

    Args:
        contacts: The contacts.
        plate: The plate's geom.
        body_of_geom: Body that each geom moves with, shape (geoms,).
        axes: Axes of the array in the world, as columns, shape (3, 3) [-].
        origin: Origin of the array in the world, shape (3,) [m].

    Returns:
        Ids of the bodies that touch the plate, shape (bodies,); and force [N], force times x and force times y [N m]
        of each, shape (bodies, 3).
    """
    geom, address, _, frame, _, pos, _, _ = contacts
    bodies, sums = np.empty(len(geom), dtype=np.int64), np.zeros((len(geom), 3))
    count, local = 0, np.zeros(3)
    for k in range(len(geom)):
        if address[k] < 0 or (geom[k, 0] != plate and geom[k, 1] != plate):
            continue
        _decode_force(contacts, k, local)
        force, x, y = 0.0, 0.0, 0.0
        for i in range(3):
            for axis in range(3):
                force += local[axis] * frame[k, 3 * axis + i] * axes[i, 2]
            x += (pos[k, i] - origin[i]) * axes[i, 0]
            y += (pos[k, i] - origin[i]) * axes[i, 1]
        other = geom[k, 1]
        if geom[k, 1] == plate:
            force, other = -force, geom[k, 0]
        slot = 0
        while slot < count and bodies[slot] != body_of_geom[other]:
            slot += 1
        if slot == count:
            bodies[slot] = body_of_geom[other]
            count += 1
        sums[slot, 0] += force
        sums[slot, 1] += force * x
        sums[slot, 2] += force * y
    return bodies[:count], sums[:count]
