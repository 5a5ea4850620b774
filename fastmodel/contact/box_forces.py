"""Sums of MuJoCo's contact forces on boxes, along the boxes' normals.

A contact's force f acts on its second geom, and -f on its first.  It is given in the contact's own frame, whose rows
are the contact normal and two tangents.  Contacts with elliptic cones store f itself.  Contacts with pyramidal cones
store edge forces e: the normal force is their sum, and the i-th tangential force is mu_i (e_2i - e_2i+1).  Components
from the fourth on are torques, which do not press.
Source: MuJoCo documentation, Computation, section "Contact".
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fastmodel.compiled import called_by_kernels

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@called_by_kernels
def decode_force(  # noqa: PLR0917 -- numba kernels take positional arguments
    contact: int,
    address: IntArray,
    dim: IntArray,
    friction: FloatArray,
    efc_force: FloatArray,
    pyramidal: bool,
    force: FloatArray,
) -> None:
    """Decode the force of one contact into the contact's frame; compiled by numba.

    Args:
        contact: Index of the contact [-].
        address: First row of each contact in `efc_force`, shape (k,); not negative for this contact [-].
        dim: Dimension of each contact, shape (k,) [-].
        friction: Friction coefficients, shape (k, 5) [-].
        efc_force: Constraint forces, shape (rows,) [N].
        pyramidal: Whether the model has pyramidal friction cones.
        force: Filled with the normal and two tangential components, shape (3,) [N].
    """
    force[:] = 0.0
    first = address[contact]
    if pyramidal and dim[contact] > 1:
        for edge in range(2 * (dim[contact] - 1)):
            force[0] += efc_force[first + edge]
        for axis in range(1, min(dim[contact], 3)):
            edge = first + 2 * (axis - 1)
            force[axis] = friction[contact, axis - 1] * (efc_force[edge] - efc_force[edge + 1])
    else:
        for axis in range(min(dim[contact], 3)):
            force[axis] = efc_force[first + axis]


def press_boxes(  # noqa: PLR0917 -- numba kernels take positional arguments
    geom: IntArray,
    address: IntArray,
    dim: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    efc_force: FloatArray,
    geom_xmat: FloatArray,
    texel_of: IntArray,
    pyramidal: bool,
    pressed: FloatArray,
    total: FloatArray,
) -> None:
    """Compute the contact forces against the boxes' outward normals, by contact and by texel; compiled by numba.

    Args:
        geom: The two geoms of each contact, shape (k, 2) [-].
        address: First row of each contact in `efc_force`, shape (k,); -1 for none [-].
        dim: Dimension of each contact, shape (k,) [-].
        frame: Contact frames, rows normal and tangents, shape (k, 9) [-].
        friction: Friction coefficients, shape (k, 5) [-].
        efc_force: Constraint forces, shape (rows,) [N].
        geom_xmat: Orientation of every geom in the world, shape (geoms, 9) [-].
        texel_of: Texel of every geom, -1 for geoms that are no texel, shape (geoms + 1,) [-].
        pyramidal: Whether the model has pyramidal friction cones.
        pressed: Filled with the force on either geom, zero for a geom that is no texel, shape (k, 2) [N].
        total: Filled with the sum for each texel, shape (n,) [N].
    """
    force = np.zeros(3)
    pressed[:] = 0.0
    total[:] = 0.0
    for k in range(geom.shape[0]):
        if address[k] < 0 or (texel_of[geom[k, 0]] < 0 and texel_of[geom[k, 1]] < 0):
            continue
        decode_force(k, address, dim, friction, efc_force, pyramidal, force)
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
