"""Net force and torque on an array, and the tangential force on every texel, from MuJoCo's contacts.

The net force is the sum over all contacts of all boxes or plates of the array, including sides and backs.  With one box
per texel, the tangential force on a texel is that of its own contacts.  With plates, MuJoCo's contact points do not
resolve single texels.  The net shear on the front is then shared among texels in proportion to their pressure, and
pressure on the margin takes a corresponding share.

Compiled kernels sum MuJoCo's contact forces along the normals of boxes and of plates.

The force f of a contact acts on the second geom of the contact, and -f acts on the first.  MuJoCo gives f in the frame
of the contact, whose rows are the contact normal and two tangents.  With elliptic friction cones MuJoCo stores f
itself.  With pyramidal cones MuJoCo stores edge forces e: the normal force is their sum, and the i-th tangential force
is mu_i (e_2i - e_2i+1), with friction coefficient mu_i.  Components from the fourth on are the torques of torsional and
rolling friction about the axes of the contact.
Source: MuJoCo documentation, Computation, section "Contact".

All kernels are in one file, because numba's cache checks only the file of the called kernel for changes, not the files
of the functions that this kernel calls.
"""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from fastmodel.compiled import called_by_kernels, compile_kernel
from fastmodel.contact.bodies import number_geoms
from fastmodel.contact.interface import Reading
from fastmodel.signal.point_spread import find_tangents
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Value of `Reading.tangential_source` and `Frame.tangential_source` if the tangential force of a texel is that of its
#: contacts.
BY_GEOM = "contacts of each texel"
#: Value of `Reading.tangential_source` and `Frame.tangential_source` if the net shear is shared among the texels.
SHARED = "net shear, shared in proportion to pressure"


class NetForceReader:
    """Reader of net force, net torque and tangential forces of one array of n texels.

    Attributes:
        parts: Boxes or plates as arguments of kernels, see `Parts`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        geoms: IntArray,
        *,
        axes: FloatArray,
        middle: FloatArray,
        neighbours: BoolArray | None = None,
    ) -> None:
        """Tabulate the geoms of the array and their axes.

        Args:
            model: The compiled model.
            array: The array.
            geoms: Ids of its m geoms, boxes or plates, shape (m,).
            axes: Axes of the first geom in the frame of the array, as columns, shape (3, 3) [-].
            middle: Centre of the first geom in the frame of the array, shape (3,) [m].
            neighbours: For one box per texel, whether each box has a neighbour at its sides -x, +x, -y, +y, shape
                (n, 4); None for plates.
        """
        self._model, self._array, self._by_geom = model, array, neighbours is not None
        sides = np.zeros((len(geoms), 4), dtype=bool) if neighbours is None else neighbours
        first, contiguous = int(geoms[0]), np.ascontiguousarray(axes)
        self.parts: Parts = (number_geoms(model, geoms), sides, first, contiguous, middle)
        # Axes of each geom in the frame of the array.  The quaternions give them in the frame of the body.
        turns = Rotation.from_quat(model.geom_quat[geoms], scalar_first=True).as_matrix()
        self._axes = np.ascontiguousarray(axes @ turns[0].T @ turns)
        # Masked texels measure nothing, so their tangential forces are set to zero.
        self._masked = None if array.active.all() else ~array.active
        self._tangents = np.stack(find_tangents(array), axis=1) * array.active[:, None, None]
        self._share_shear = compile_kernel(share_shear)

    def add(self, reading: Reading, sums: Sums | None) -> Reading:
        """Return a reading with net force, net torque and tangential forces.

        Args:
            reading: The reading without them.
            sums: Sums of the contact forces, see `sum_contacts`.  If they are None, the net force is the sum of the
                reading's contact forces, and the tangential forces are zero.
        """
        source = BY_GEOM if self._by_geom else SHARED
        if sums is None:
            forces = -reading.contact_forces[:, None] * self._array.normals
            torque = np.cross(self._array.centres, forces).sum(axis=0)
            wrench, tangential = np.append(forces.sum(axis=0), torque), np.zeros((self._array.count, 2))
        else:
            _, fronts, wrench, _ = sums
            if self._by_geom:
                tangential = fronts[:, :2]  # The x and y axes of a box are the two tangents of its texel.
                if self._masked is not None:
                    tangential[self._masked] = 0.0
            else:
                tangential = self._share_shear(fronts, self._axes, reading.contact_forces, self._tangents)
        return reading._replace(wrench=wrench, tangential=tangential, tangential_source=source)


#: Smallest cosine of the angle between a contact's normal, away from the array, and the array's normal for which the
#: contact is on the array's front [-].  Other contacts are on the sides or the back of a plate or box.
FRONT = 0.1

#: The option `cone` of a model with pyramidal friction cones, as a number: comparing with the name takes longer.
_PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)
#: Ids and numbers as MuJoCo stores them.
_Ids = npt.NDArray[np.int32]
#: The k contacts of a simulation state, as a tuple.  The first seven entries have one row per contact: ids of the two
#: geoms, shape (k, 2); index of the contact's first entry in the constraint forces, -1 for none, shape (k,); number of
#: force components, shape (k,); axes of the contact frame as rows, normal first, shape (k, 9) [-]; friction
#: coefficients, shape (k, 5) [-]; position in the world, shape (k, 3) [m]; and distance of the surfaces, negative for
#: penetration, shape (k,) [m].  The last entries are the constraint forces, shape (rows,) [N], and whether friction
#: cones are pyramidal.
Contacts = tuple[_Ids, _Ids, _Ids, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, bool]


def read_contacts(model: mujoco.MjModel, data: mujoco.MjData) -> Contacts:
    """Read the contacts of a simulation state as arguments of kernels.

    The option `cone` of the model is read each time, because it may change during a simulation.
    """
    found, pyramidal = data.contact, model.opt.cone == _PYRAMIDAL
    places = (found.frame, found.friction, found.pos, found.dist)
    return (found.geom, found.efc_address, found.dim, *places, data.efc_force, pyramidal)


@called_by_kernels
def _decode_force(contacts: Contacts, k: int, force: FloatArray) -> None:
    """Compute the normal component and the two tangential components of the force of contact k, and its torques.

    The six numbers are written to `force`, shape (6,) [N, N m].
    """
    _, address, dim, _, friction, _, _, efc_force, pyramidal = contacts
    force[:] = 0.0
    first = address[k]
    if pyramidal and dim[k] > 1:
        for edge in range(2 * (dim[k] - 1)):
            force[0] += efc_force[first + edge]
        for axis in range(1, dim[k]):
            edge = first + 2 * (axis - 1)
            force[axis] = friction[k, axis - 1] * (efc_force[edge] - efc_force[edge + 1])
    else:
        for axis in range(dim[k]):
            force[axis] = efc_force[first + axis]


#: An array of m boxes or plates, as a tuple.  The entries are: index of the box or plate of every geom, -1 for geoms of
#: other bodies, shape (geoms + 1,); whether each box has a neighbour at its sides -x, +x, -y, +y, shape (m, 4); id of
#: the first box or plate; axes of the first one in the frame of the array, as columns, shape (3, 3) [-]; and its centre
#: in this frame, shape (3,) [m].
Parts = tuple[IntArray, BoolArray, int, FloatArray, FloatArray]
#: Return value of `sum_contacts`: forces on both geoms of each contact [N], force on the front of each box or plate
#: [N], net force and torque on the array [N, N m], and the sum of the forces at backs and free sides [N].
Sums = tuple[FloatArray, FloatArray, FloatArray, float]


@called_by_kernels
def sum_contacts(  # noqa: C901 -- in one function, as calls make it a tenth slower
    contacts: Contacts, geom_xmat: FloatArray, geom_xpos: FloatArray, parts: Parts
) -> Sums:
    """Kernel: sum the forces and torques that all contacts exert on an array of m boxes or plates.

    A contact with a side of a box that has a neighbour there counts as a contact with its front, because MuJoCo reports
    such contacts for a body that stands on both boxes.

    Args:
        contacts: The k contacts.
        geom_xmat: Orientation of every geom in the world, as rotation matrix, shape (geoms, 9) [-].
        geom_xpos: Position of every geom in the world, shape (geoms, 3) [m].
        parts: The boxes or plates of the array.

    Returns:
        Force against the outward normal of both geoms of each contact, shape (k, 2) [N]; it is zero at backs and free
        sides and for geoms of other bodies.  Force on the front of each box or plate along its axes, shape (m, 3) [N].
        Force on the array, and torque about its origin, in its frame, shape (6,) [N, N m].  Sum of the forces against
        the normals at backs and free sides [N].
    """
    geom, address, dim, frame, _, pos, _, _, _ = contacts
    part_of, neighbours, first, turn, middle = parts
    pressed, fronts, beside = np.zeros((len(geom), 2)), np.zeros((len(neighbours), 3)), 0.0
    # `local` is force and torque of a contact in its own frame.  `net` is the net force in the world, and `moment` the
    # net torque about the centre of the first box or plate, in the world.
    local, net, moment = np.zeros(6), np.zeros(3), np.zeros(3)
    for k in range(len(geom)):
        if address[k] < 0 or (part_of[geom[k, 0]] < 0 and part_of[geom[k, 1]] < 0):
            continue
        _decode_force(contacts, k, local)
        rx = pos[k, 0] - geom_xpos[first, 0]
        ry = pos[k, 1] - geom_xpos[first, 1]
        rz = pos[k, 2] - geom_xpos[first, 2]
        for side in range(2):
            own, part, sign = geom[k, side], part_of[geom[k, side]], 2.0 * side - 1.0
            if part < 0:
                continue
            fx = sign * (local[0] * frame[k, 0] + local[1] * frame[k, 3] + local[2] * frame[k, 6])
            fy = sign * (local[0] * frame[k, 1] + local[1] * frame[k, 4] + local[2] * frame[k, 7])
            fz = sign * (local[0] * frame[k, 2] + local[1] * frame[k, 5] + local[2] * frame[k, 8])
            net[0] += fx
            net[1] += fy
            net[2] += fz
            moment[0] += ry * fz - rz * fy
            moment[1] += rz * fx - rx * fz
            moment[2] += rx * fy - ry * fx
            for axis in range(dim[k] - 3):
                for i in range(3):
                    moment[i] += sign * local[3 + axis] * frame[k, 3 * axis + i]
            x, y, z = 0.0, 0.0, 0.0  # components of the contact normal, away from the box, along the axes of the box
            for i in range(3):
                x -= sign * frame[k, i] * geom_xmat[own, 3 * i]
                y -= sign * frame[k, i] * geom_xmat[own, 3 * i + 1]
                z -= sign * frame[k, i] * geom_xmat[own, 3 * i + 2]
            along = fx * geom_xmat[own, 2] + fy * geom_xmat[own, 5] + fz * geom_xmat[own, 8]
            if _is_front(x, y, z, neighbours, part):
                pressed[k, side] = -along
                fronts[part, 0] += fx * geom_xmat[own, 0] + fy * geom_xmat[own, 3] + fz * geom_xmat[own, 6]
                fronts[part, 1] += fx * geom_xmat[own, 1] + fy * geom_xmat[own, 4] + fz * geom_xmat[own, 7]
                fronts[part, 2] += along
            else:
                beside -= along
    place = _find_place(geom_xmat, geom_xpos, first, turn, middle)
    wrench = np.zeros(6)
    for j in range(3):
        for i in range(3):
            wrench[j] += net[i] * place[i, j]
            wrench[3 + j] += moment[i] * place[i, j]
    for i, j, m in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        wrench[3 + i] += middle[j] * wrench[m] - middle[m] * wrench[j]
    return pressed, fronts, wrench, beside


@called_by_kernels
def _is_front(x: float, y: float, z: float, neighbours: BoolArray, part: int) -> bool:
    """Return whether a contact is with the front of a box, or with a side at which the box has a neighbour.

    Args:
        x: Component of the contact normal, away from the box, along the box's x axis [-].
        y: Component along the box's y axis [-].
        z: Component along the box's outward normal [-].
        neighbours: Whether every box has a neighbour at its sides -x, +x, -y, +y, shape (m, 4).
        part: Index of the box.
    """
    if z >= FRONT:
        return True
    if abs(x) > abs(y):
        return z > -abs(x) and neighbours[part, 1 if x > 0 else 0]
    return z > -abs(y) and neighbours[part, 3 if y > 0 else 2]


def press_boxes(
    contacts: Contacts, geom_xmat: FloatArray, geom_xpos: FloatArray, parts: Parts
) -> tuple[FloatArray, float, Sums]:
    """Kernel: compute the force that presses on each of n box texels.

    If a box is pulled, its force is set to zero, and the other forces are scaled to keep their sum, or to zero if the
    sum is negative.

    Args:
        contacts: The contacts.
        geom_xmat: Orientation of every geom in the world, as rotation matrix, shape (geoms, 9) [-].
        geom_xpos: Position of every geom in the world, shape (geoms, 3) [m].
        parts: The boxes.

    Returns:
        Force on each texel, shape (n,) [N].  Sum of the forces against the normals, at all sides of the boxes [N].  The
        return value of `sum_contacts`.
    """
    found = sum_contacts(contacts, geom_xmat, geom_xpos, parts)
    fronts, forces, total, positive = found[1], np.zeros(len(found[1])), 0.0, 0.0
    for texel in range(len(forces)):
        forces[texel] = -fronts[texel, 2]
        total += forces[texel]
        positive += max(forces[texel], 0.0)
    if positive != total:
        for texel in range(len(forces)):
            forces[texel] = max(forces[texel], 0.0) * (max(total, 0.0) / positive) if positive > 0 else 0.0
    return forces, total + found[3], found


def share_shear(fronts: FloatArray, axes: FloatArray, contact_forces: FloatArray, tangents: FloatArray) -> FloatArray:
    """Kernel: share the net shear on m plates among n texels in proportion to pressure.

    The shear is the part of the forces along the plates.  Pressure on the margin takes its share of the shear with it.

    Args:
        fronts: Force on the front of each plate along its axes, shape (m, 3) [N].
        axes: Axes of each plate in the frame of the array, as columns, shape (m, 3, 3) [-].
        contact_forces: Force that presses on each texel, shape (n,) [N].
        tangents: Two tangents of each texel in the frame of the array, shape (n, 2, 3) [-].

    Returns:
        Force on each texel along its tangents, shape (n, 2) [N].
    """
    shear, pressing, pressed, shared = np.zeros(3), 0.0, 0.0, np.zeros(tangents.shape[:2])
    for part in range(len(fronts)):
        pressing -= fronts[part, 2]
        for i in range(3):
            shear[i] += fronts[part, 0] * axes[part, i, 0] + fronts[part, 1] * axes[part, i, 1]
    for texel in range(len(contact_forces)):
        pressed += contact_forces[texel]
    for texel in range(len(contact_forces)):
        if contact_forces[texel] > 0:
            share = contact_forces[texel] / max(pressing, pressed)
            for axis in range(2):
                for i in range(3):
                    shared[texel, axis] += share * tangents[texel, axis, i] * shear[i]
    return shared


def press_plate(
    contacts: Contacts, geom_xmat: FloatArray, geom_xpos: FloatArray, parts: Parts, body_of_geom: IntArray
) -> tuple[IntArray, FloatArray, IntArray, FloatArray, FloatArray, Sums]:
    """Kernel: sum, for each body, the contact forces against a plate's normal, and the moments of these forces.

    Args:
        contacts: The contacts.
        geom_xmat: Orientation of every geom in the world, as rotation matrix, shape (geoms, 9) [-].
        geom_xpos: Position of every geom in the world, shape (geoms, 3) [m].
        parts: The plate.
        body_of_geom: Id of the body that each geom moves with, shape (geoms + 1,).  It is -1 for a geom of unknown
            shape, whose forces count as point forces.  The last entry is for flexes.

    Returns:
        Ids of the bodies of known shape that exert force on the plate's front, shape (bodies,).  For each of these
        bodies: sums over its contacts of force [N], force times x and force times y [N m], and its deepest penetration
        [m], shape (bodies, 4).  For each of the m contacts with the plate's front: index of its body, -1 for an unknown
        shape, shape (m,), and x, y [m] and force [N], shape (m, 3).  Axes of the array in the world, as columns, and
        its origin, shape (4, 3) [-, m].  The return value of `sum_contacts`.
    """
    geom, _, _, _, _, pos, dist, _, _ = contacts
    _, _, plate, turn, middle = parts
    found = sum_contacts(contacts, geom_xmat, geom_xpos, parts)
    pressed, place = found[0], _find_place(geom_xmat, geom_xpos, plate, turn, middle)
    bodies, sums = np.empty(len(geom), dtype=np.int64), np.zeros((len(geom), 4))
    owner, points = np.empty(len(geom), dtype=np.int64), np.zeros((len(geom), 3))
    count, touching = 0, 0
    for k in range(len(geom)):
        force = pressed[k, 0] + pressed[k, 1]
        if force == 0:
            continue
        for i in range(3):
            points[touching, 0] += (pos[k, i] - place[3, i]) * place[i, 0]
            points[touching, 1] += (pos[k, i] - place[3, i]) * place[i, 1]
        points[touching, 2] = force
        body = body_of_geom[geom[k, 0] if geom[k, 1] == plate else geom[k, 1]]
        owner[touching] = -1
        if body >= 0:
            slot = 0
            while slot < count and bodies[slot] != body:
                slot += 1
            if slot == count:
                bodies[slot] = body
                count += 1
            owner[touching] = slot
            sums[slot, 0] += force
            sums[slot, 1] += force * points[touching, 0]
            sums[slot, 2] += force * points[touching, 1]
            sums[slot, 3] = max(sums[slot, 3], -dist[k])
        touching += 1
    return bodies[:count], sums[:count], owner[:touching], points[:touching], place, found


@called_by_kernels
def _find_place(
    geom_xmat: FloatArray, geom_xpos: FloatArray, plate: int, turn: FloatArray, middle: FloatArray
) -> FloatArray:
    """Compute axes, as columns, and origin of an array in the world from the pose of its first geom, shape (4, 3).

    Args:
        geom_xmat: Orientation of each geom in the world, as rotation matrix, shape (geoms, 9) [-].
        geom_xpos: Position of each geom in the world, shape (geoms, 3) [m].
        plate: Id of the first geom.
        turn: Axes of the first geom in the frame of the array, as columns, shape (3, 3) [-].
        middle: Centre of the first geom in the frame of the array, shape (3,) [m].
    """
    place = np.zeros((4, 3))
    for i in range(3):
        for j in range(3):
            for axis in range(3):
                place[i, j] += geom_xmat[plate, 3 * i + axis] * turn[j, axis]
    for i in range(3):
        place[3, i] = geom_xpos[plate, i]
        for j in range(3):
            place[3, i] -= place[i, j] * middle[j]
    return place
