"""What presses on one plate, body by body: force along the plate's normal and its moments about the array's origin.

Both functions take the same arrays as `box_forces` and further: `pos` (k, 3) of the contacts [m], `plate` the plate's
geom, `group` (geoms,) the body that each geom moves with, `axes` (3, 3) the array's axes in the world as columns,
`origin` (3,) its origin [m].  They fill `bodies` (k,) and `sums` (k, 3) with force [N] and force times x and y [Nm] and
return the number of bodies.

`poses_numpy` and `poses_loops` give the axes (p, 3, 3) and origins (p, 3) of some geoms in the array's frame.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def decode(efc_force: FloatArray, address: IntArray, friction: FloatArray, size: int, *, pyramidal: bool) -> FloatArray:
    """Normal and tangential forces in the contact frame, shape (k, 1) or (k, 3) [N].

    Args:
        efc_force: Constraint forces [N].
        address: First row of each contact, shape (k,).
        friction: Friction coefficients, shape (k, 5) [-].
        size: Dimension of all these contacts.
        pyramidal: Whether rows are edges of a pyramid.
    """
    kept = min(size, 3)
    if size == 1 or not pyramidal:
        # MuJoCo lays rows out in the order of contacts: this span says that no others lie between
        if len(address) and address[-1] - address[0] == size * (len(address) - 1):
            return efc_force[address[0] : address[-1] + size].reshape(-1, size)[:, :kept]
        return np.asarray(efc_force[address[:, None] + np.arange(kept)])
    edges = efc_force[address[:, None] + np.arange(2 * (size - 1))]
    tangential = friction[:, : kept - 1] * (edges[:, : 2 * kept - 2 : 2] - edges[:, 1 : 2 * kept - 2 : 2])
    return np.concatenate([edges.sum(axis=1, keepdims=True), tangential], axis=1)


def plate_numpy(  # noqa: PLR0917 -- numba kernels take positions
    geom: IntArray,
    address: IntArray,
    dim: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    pos: FloatArray,
    efc_force: FloatArray,
    pyramidal: bool,
    plate: int,
    group: IntArray,
    axes: FloatArray,
    origin: FloatArray,
    bodies: IntArray,
    sums: FloatArray,
) -> int:
    """All contacts of one dimension at a time."""
    side = (geom == plate) & (address >= 0)[:, None]
    touches = side.any(axis=1).nonzero()[0]
    if not len(touches):
        return 0
    second = side[touches, 1]
    body = group[geom[touches, np.where(second, 0, 1)]]
    pressed = np.zeros(len(touches))
    for size in set(dim[touches].tolist()):
        mine = (dim[touches] == size).nonzero()[0]
        k = touches[mine]
        local = decode(efc_force, address[k], friction[k] if pyramidal else friction, size, pyramidal=pyramidal)
        directions = frame[k].reshape(-1, 3, 3)[:, : local.shape[1]]
        pressed[mine] = np.einsum("ki,kij,j->k", local, directions, axes[:, 2])
    pressed[second] *= -1
    place = (pos[touches] - origin) @ axes[:, :2]
    found, index = np.unique(body, return_inverse=True)
    count = len(found)
    bodies[:count] = found
    for column, values in enumerate((pressed, pressed * place[:, 0], pressed * place[:, 1])):
        sums[:count, column] = np.bincount(index, values, count)
    return count


def plate_loops(  # noqa: C901, PLR0917 -- one flat loop, as numba likes it
    geom: IntArray,
    address: IntArray,
    dim: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    pos: FloatArray,
    efc_force: FloatArray,
    pyramidal: bool,
    plate: int,
    group: IntArray,
    axes: FloatArray,
    origin: FloatArray,
    bodies: IntArray,
    sums: FloatArray,
) -> int:
    """One contact at a time, for numba."""
    count = 0
    local = np.zeros(3)
    for k in range(geom.shape[0]):
        first = address[k]
        if first < 0 or (geom[k, 0] != plate and geom[k, 1] != plate):
            continue
        kept = min(dim[k], 3)
        if pyramidal and dim[k] > 1:
            local[0] = 0.0
            for e in range(2 * (dim[k] - 1)):
                local[0] += efc_force[first + e]
            for axis in range(1, kept):
                e = first + 2 * (axis - 1)
                local[axis] = friction[k, axis - 1] * (efc_force[e] - efc_force[e + 1])
        else:
            for axis in range(kept):
                local[axis] = efc_force[first + axis]
        pressed, x, y = 0.0, 0.0, 0.0
        for i in range(3):
            for axis in range(kept):
                pressed += local[axis] * frame[k, 3 * axis + i] * axes[i, 2]
            x += (pos[k, i] - origin[i]) * axes[i, 0]
            y += (pos[k, i] - origin[i]) * axes[i, 1]
        other = geom[k, 1]
        if geom[k, 1] == plate:
            pressed, other = -pressed, geom[k, 0]
        body, slot = group[other], 0
        while slot < count and bodies[slot] != body:
            slot += 1
        if slot == count:
            bodies[slot] = body
            sums[slot] = 0.0
            count += 1
        sums[slot, 0] += pressed
        sums[slot, 1] += pressed * x
        sums[slot, 2] += pressed * y
    return count


def poses_numpy(
    geoms: IntArray, xmat: FloatArray, xpos: FloatArray, axes: FloatArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """All geoms at once."""
    # dot: between products this small, @ costs twice as much
    turned = axes.T.dot(xmat[geoms].reshape(-1, 3, 3))
    return turned.swapaxes(0, 1), (xpos[geoms] - origin).dot(axes)


def poses_loops(
    geoms: IntArray, xmat: FloatArray, xpos: FloatArray, axes: FloatArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """One geom at a time, for numba."""
    rotation, position = np.zeros((len(geoms), 3, 3)), np.zeros((len(geoms), 3))
    for p in range(len(geoms)):
        g = geoms[p]
        for i in range(3):
            for j in range(3):
                position[p, i] += axes[j, i] * (xpos[g, j] - origin[j])
                for k in range(3):
                    rotation[p, i, k] += axes[j, i] * xmat[g, 3 * j + k]
    return rotation, position
