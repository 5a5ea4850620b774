"""Reading MuJoCo's contact forces as arrays: what presses on each texel along its normal.

A contact's force f in its own frame (rows: normal, two tangents) acts on its second geom, -f on its first.
Elliptic cones store f itself.  Pyramidal cones store edge forces e: the normal force is their sum, the i-th
tangential force mu_i (e_2i - e_2i+1).  Torques (from the fourth component on) press nothing.

Both functions take the same arrays, fill `signals` and return the lowest force on a texel: `geom` (k, 2), `address`
(k,) of the contact's first row in `efc_force` (-1 for none), `dim` (k,), `frame` (k, 9), `friction` (k, 5), `efc_force`
(rows,) [N], `geom_xmat` (geoms, 9), `texel_of` (geoms + 1,) with -1 for other geoms, `pyramidal`, `signals` (n + 1,)
for the force on each texel and, last, their sum [N].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def press_numpy(  # noqa: PLR0917 -- numba kernels take positions
    geom: IntArray,
    address: IntArray,
    dim: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    efc_force: FloatArray,
    geom_xmat: FloatArray,
    texel_of: IntArray,
    pyramidal: bool,
    signals: FloatArray,
    *,
    flat: int = -1,
) -> float:
    """All contacts of one dimension at a time; `flat` is a texel's geom when all normals are parallel, else -1."""
    if flat >= 0 and len(dim) and _in_one_span(dim, address, pyramidal=pyramidal):
        return _press_parallel(
            geom,
            address,
            frame,
            friction,
            efc_force,
            geom_xmat[flat, 2::3],
            texel_of,
            signals,
            int(dim[0]),
            pyramidal=pyramidal,
        )
    total = signals[:-1]
    total[:] = 0.0
    stands = address >= 0
    texels = texel_of.take(geom)  # take: several times faster here than indexing
    for side, sign in ((0, 1.0), (1, -1.0)):
        texel = texels[:, side]
        hit = ((texel >= 0) & stands).nonzero()[0]
        for size, k in _by_dimension(dim, hit):
            local = decode(efc_force, address[k], friction[k] if pyramidal else friction, size, pyramidal=pyramidal)
            normals = geom_xmat.take(geom[:, side][k], axis=0)[:, 2::3]
            along = np.einsum("kij,kj->ki", frame[k].reshape(-1, 3, 3), normals)
            pressed = np.einsum("ki,ki->k", local, along[:, : local.shape[1]])
            total += sign * np.bincount(texel[k], pressed, len(total))
    signals[-1] = np.add.reduce(total)
    return float(np.minimum.reduce(total))


def _press_parallel(  # noqa: PLR0917 -- as above
    geom: IntArray,
    address: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    efc_force: FloatArray,
    normal: FloatArray,
    texel_of: IntArray,
    signals: FloatArray,
    size: int,
    *,
    pyramidal: bool,
) -> float:
    """All contacts at once, where all are of one size and texels share a normal (3,) and a body: they never touch."""
    texel = texel_of.take(geom[:, 0])
    local = decode(efc_force, address, friction, size, pyramidal=pyramidal)
    normals = np.zeros((9, 3))
    normals[:3, 0] = normals[3:6, 1] = normals[6:, 2] = normal
    along = frame @ normals
    pressed = np.vecdot(local, along[:, : local.shape[1]])
    if np.minimum.reduce(texel) < 0:
        np.negative(pressed, out=pressed, where=texel < 0)
        texel = np.maximum(texel, texel_of.take(geom[:, 1]))
    sums = np.bincount(texel + 1, pressed, len(signals))
    signals[:-1] = sums[1:]
    signals[-1] = np.add.reduce(sums[1:])
    return float(np.minimum.reduce(sums[1:]))


def _in_one_span(dim: IntArray, address: IntArray, *, pyramidal: bool) -> bool:
    """Whether contacts are of one dimension and all of them have rows, which then lie one after the other."""
    size, first, count = int(dim[0]), int(address[0]), len(dim)
    rows = 2 * (size - 1) if pyramidal and size > 1 else size
    # contacts without rows shorten the span; counting is several times faster than all()
    whole = first >= 0 and int(address[-1]) - first == rows * (count - 1)
    return whole and int(np.count_nonzero(dim == size)) == count


def _by_dimension(dim: IntArray, hit: IntArray) -> list[tuple[int, IntArray | slice]]:
    """Contacts of each dimension; as a rule there is one, of all contacts, and then a slice is cheaper."""
    if not len(hit):
        return []
    sizes = dim if len(hit) == len(dim) else dim.take(hit)
    first = int(sizes[0])
    if (sizes == first).all():
        return [(first, slice(None) if sizes is dim else hit)]
    return [(size, hit[sizes == size]) for size in set(sizes.tolist())]


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


def press_loops(  # noqa: C901, PLR0917 -- one flat loop, as numba likes it
    geom: IntArray,
    address: IntArray,
    dim: IntArray,
    frame: FloatArray,
    friction: FloatArray,
    efc_force: FloatArray,
    geom_xmat: FloatArray,
    texel_of: IntArray,
    pyramidal: bool,
    signals: FloatArray,
) -> float:
    """One contact at a time, for numba."""
    count = signals.shape[0] - 1
    signals[:] = 0.0
    local = np.zeros(3)
    for k in range(geom.shape[0]):
        first, one, two = address[k], texel_of[geom[k, 0]], texel_of[geom[k, 1]]
        if first < 0 or (one < 0 and two < 0):
            continue
        kept = min(dim[k], 3)
        if pyramidal and dim[k] > 1:
            local[0] = 0.0
            for edge in range(2 * (dim[k] - 1)):
                local[0] += efc_force[first + edge]
            for axis in range(1, kept):
                edge = first + 2 * (axis - 1)
                local[axis] = friction[k, axis - 1] * (efc_force[edge] - efc_force[edge + 1])
        else:
            for axis in range(kept):
                local[axis] = efc_force[first + axis]
        x, y, z = 0.0, 0.0, 0.0
        for axis in range(kept):
            x += local[axis] * frame[k, 3 * axis]
            y += local[axis] * frame[k, 3 * axis + 1]
            z += local[axis] * frame[k, 3 * axis + 2]
        for side in range(2):
            texel = two if side else one
            if texel >= 0:
                n = geom_xmat[geom[k, side]]
                pressed = x * n[2] + y * n[5] + z * n[8]
                signals[texel] += -pressed if side else pressed
    lowest = np.inf
    for i in range(count):
        lowest = min(lowest, signals[i])
        signals[count] += signals[i]
    return lowest
