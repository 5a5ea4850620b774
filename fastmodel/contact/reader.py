"""From MuJoCo's contacts with an array to the forces on its texels: the part that all readers of pressure share.

`PressureReader.read` computes the `Reading` of one simulation step in four stages:

1. `find_contact` converts MuJoCo's contacts to an `ArrayContact`: load, shape and pose of each body that presses on the
   array, and point forces where the shape of a body is not known.
2. If this contact differs little from that of the last solution, see `KEPT`, the last solution is adapted to the new
   loads.
3. `_solve` computes the pressure of all bodies on the surface, and sums the pressure over texels.
4. `NetForceReader.add` adds net force, net torque and tangential forces.

The surface consists of cells of plates (`fastmodel.contact.plate`) or of points of a mesh (`fastmodel.contact.mesh`).
These two files implement stages 1 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import Bodies, Joints, find_geoms, number_geoms
from fastmodel.contact.forces import NetForceReader, Sums
from fastmodel.contact.interface import Reading
from fastmodel.errors import FastModelError
from fastmodel.pressure.gap import BodyShape, PosedBody
from fastmodel.pressure.pressure_kernels import find_modes
from fastmodel.pressure.solvers import Load
from fastmodel.state import State, pack, take_array, unpack
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Largest change of a contact for which the last solution is adapted [-].  The change is the largest relative change of
#: the pressure on a cell, or ten times the motion of a body, if that is more.  The motion is the larger of two: the
#: path along the cover over the size of the contact, added to the angle about the normal; and the change of the gap by
#: a tilt over the depth of the contact, of which a twentieth counts for a body whose moments determine its tilt.
KEPT = 0.04
#: Mean square distance of the pressure from its centre, over the edge of a cell, below which a change of the moments is
#: met in part only [-].
_LOOSE = 0.1
#: Change of a contact between two readings below which it counts as at rest, in the terms of `KEPT`; and largest change
#: of point forces over their sum for which the last solution is used again [-].
_UNCHANGED = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class ArrayContact:
    """Bodies that press on an array, with their loads and poses, and contact points outside these bodies.

    A contact point is a row of numbers.  For plates the row is x and y on the contact grid [m] and the force along the
    normal [N].  For a mesh it is the position [m] and the force vector [N] in the array's frame.

    Attributes:
        bodies: Id of each body of known shape that presses on the front of the array.
        loads: Force and moments of each body.
        poses: Shape of each body and its pose in the array's frame.
        owner: Index in `bodies` of the body of each of m contact points, shape (m,).
        touches: Contact points of the bodies, shape (m, 3 or 6).
        points: The k contact points of bodies without a known shape.  They act as point forces, shape (k, 3 or 6).
        beside: Signed sum of the forces at the sides and on the back of a plate [N].
    """

    bodies: tuple[int, ...]
    loads: tuple[Load, ...]
    poses: tuple[PosedBody, ...]
    owner: IntArray
    touches: FloatArray
    points: FloatArray
    beside: float

    def has_points_of(self, other: ArrayContact, length: float) -> bool:
        """Return whether the point forces equal those of another contact; places may differ by a part of a length."""
        if len(self.points) != len(other.points):
            return False
        if not len(self.points):
            return True
        places = (self.points.shape[1] + 1) // 2
        apart, total = np.abs(self.points - other.points), np.abs(self.points[:, places:]).sum()
        return bool((apart <= np.where(np.arange(apart.shape[1]) < places, length, total) * _UNCHANGED).all())

    def select(self, kept: Sequence[int]) -> ArrayContact:
        """Return a contact with some of the bodies; contact points of the other bodies become point forces.

        Args:
            kept: Indices in `bodies` of the bodies that keep their shapes.
        """
        number = np.full(len(self.bodies), -1)
        number[list(kept)] = np.arange(len(kept))
        owner = number[self.owner]
        return replace(
            self,
            bodies=tuple(self.bodies[k] for k in kept),
            loads=tuple(self.loads[k] for k in kept),
            poses=tuple(self.poses[k] for k in kept),
            owner=owner[owner >= 0],
            touches=self.touches[owner >= 0],
            points=np.concatenate([self.points, self.touches[owner < 0]]),
        )


class Solved(NamedTuple):
    """A solution, and how its pressure changes with the loads.

    Small changes of load and moments multiply the pressure by a factor that is linear in the position.  Such a change
    is a sum of k modes, one for the force and, for a body that is free to tilt, one for each moment.

    Attributes:
        contact: The contact that was solved; bodies that lie over no cell are point forces in it.
        kept: Index in the bodies of MuJoCo's contact of each body that was solved.
        reading: The reading, without net force and tangential forces.
        modes: Change of the force on each of m cells or points by each mode, shape (k, m) [N].
        torques: Change of the reading's `torques` by each mode, shape (k, 6) [N m].
        layout: Arrays by which the reader sums forces on the cells over texels.
        weights: Weights of the modes for unit changes of the loads, shape (k, k) [1/N].
        centres: Centre of the pressure of each body, about which moments are taken, shape (bodies, 3) [m].
        largest: Largest relative change of the pressure on a cell by each mode, shape (k,) [-].
        depth: Largest overlap of the undeformed surfaces [m].
        sizes: Largest distance of a cell under each body from the centre of its pressure, and half a cell [m].
    """

    contact: ArrayContact
    kept: tuple[int, ...]
    reading: Reading
    modes: FloatArray
    torques: FloatArray
    layout: tuple[npt.NDArray[Any], ...]
    weights: FloatArray
    centres: FloatArray
    largest: FloatArray
    depth: float
    sizes: tuple[float, ...]

    def compare(self, contact: ArrayContact, edge: float) -> tuple[FloatArray, FloatArray, float]:
        """Compare a contact with that of the solution.

        Args:
            contact: The contact.
            edge: Edge of a cell [m].

        Returns:
            Weights of the modes that adapt the solution to the contact, shape (k,) [-]; change of the torques of
            bodies that are free to tilt, shape (3,) [N m]; and the change of the contact, see `KEPT` [-], infinite if
            other bodies or point forces press.
        """
        last, changes, missed, moved = self.contact, [], np.zeros(3), 0.0
        if len(self.kept) < len(contact.bodies) and max(self.kept, default=0) < len(contact.bodies):
            contact = contact.select(self.kept)
        if contact.bodies != last.bodies or not contact.has_points_of(last, edge):
            return np.zeros(0), missed, math.inf
        bodies = zip(contact.loads, last.loads, contact.poses, last.poses, self.centres, self.sizes, strict=True)
        for load, old, pose, before, centre, size in bodies:
            slide, turn, tilt = pose.measure_motion(before, centre, old.directions[0])
            # The moments determine the tilt of a body that is free to turn; its pose matters where they cannot be met.
            moved = max(moved, slide / size + turn, (0.05 if len(load.turns) else 1.0) * tilt * size / self.depth)
            changes.append(load.find_change(old, centre, edge))
            if len(load.turns):
                missed += load.find_missed_torque(-old.moment)
        change = changes[0] if len(changes) == 1 else np.concatenate([np.zeros(0), *changes])
        weights = self.weights.dot(change)
        # The modes allow for changes of the loads, with an error of second order, but not for motions.
        return weights, missed, max(10 * moved, float(np.abs(weights).dot(self.largest)))


class Touches(NamedTuple):
    """The k contacts of a simulation state with an array, in the frame of the array.

    Attributes:
        part: Index of the touched geom among the geoms of the array, shape (k,).
        body: Id of the touching body, shape (k,); -1 for a body without a convex shape.
        outward: Contact normal that points away from the array, shape (k, 3) [-].
        pressure: Normal force on the array with its sign reversed, shape (k, 3) [N].
        friction: Tangential force on the array with its sign reversed, shape (k, 3) [N].
        place: Position of the contact, shape (k, 3) [m].
        depth: Penetration of the two geoms, shape (k,) [m].
    """

    part: IntArray
    body: IntArray
    outward: FloatArray
    pressure: FloatArray
    friction: FloatArray
    place: FloatArray
    depth: FloatArray


class PressureReader:
    """Base class of the readers that compute texel forces from the bodies that press on a surface."""

    #: Edge of a cell, or distance of the points, of the surface [m].
    _length: float
    #: Height of the array's geoms; parts of a body that lie behind the geoms exert no pressure [m].
    _height: float = np.inf
    #: The reading without contacts.
    _nothing: Reading
    #: Reader of net force, net torque and tangential forces; None if the contact method does not compute them.
    _net_force: NetForceReader | None = None

    def __init__(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        geoms: Sequence[str],
        frame: tuple[FloatArray, FloatArray],
        edge: float = 0.0,
    ) -> None:
        """Find the geoms of the array in the compiled model, and describe the bodies that can touch them.

        Args:
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor.
            geoms: Names of the array's geoms.
            frame: Axes, as columns, shape (3, 3) [-], and middle [m] of the first geom in the frame of the array.
            edge: Distance by which solids with sharp edges are enlarged [m].

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        self._geoms = find_geoms(model, geoms, name)
        self._geom, self._name = int(self._geoms[0]), geoms[0]
        self._model, self._array, self._turn, self._middle = model, array, frame[0].T, frame[1]
        self._part_of = number_geoms(model, self._geoms)
        self._bodies = Bodies(model, self._geoms, name, edge)
        self._bodies.find_shapes()
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))
        self._transform_poses, self._find_modes = compile_kernel(transform_poses), compile_kernel(find_modes)
        self._solved: Solved | None = None
        self._change = 0.0
        #: Change of the values of the reading by each mode, see `Reading.change`; None until it is needed.
        self._modes: FloatArray | None = None

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of a simulation step, or adapt the last ones to slight changes of loads and poses.

        Raises:
            LifeCycleError: If the size of the array's geoms has changed.
            FastModelError: If a contact force is not finite.
        """
        if not data.nefc:
            return self._nothing
        self._bodies.follow_changes()
        found = self.find_contact(data)
        if found is None:
            return self._nothing
        contact, sums = found
        reading = self._find_pressure(contact)
        if contact.beside:
            reading = reading._replace(carried=reading.carried + contact.beside)
        return reading if self._net_force is None else self._net_force.add(reading, sums)

    def _find_pressure(self, contact: ArrayContact) -> Reading:
        """Adapt the last solution to a contact that has changed slightly, or solve the contact."""
        last = self._solved
        if last is not None:
            weights, torque, change = last.compare(contact, self._length)
            # A contact that has come to rest is solved exactly.
            at_rest = abs(change - self._change) <= _UNCHANGED < 0.1 * change
            self._change = change
            if change <= KEPT and not at_rest:
                if not weights.any():
                    return last.reading
                if self._modes is None:
                    self._modes = np.array(
                        [np.concatenate([*self._sum_forces(last.layout, mode), [mode.sum()]]) for mode in last.modes]
                    )
                torques = weights @ last.torques
                torques[3:] += torque
                return last.reading.change(weights @ self._modes, torques)
        self._solved, self._change, self._modes = self._solve(contact), 0.0, None
        return self._solved.reading

    def _find_point_torque(self, points: FloatArray) -> FloatArray:
        """Return the torque of point forces on the array, see `ArrayContact`, about the array's origin (3,) [N m]."""
        raise NotImplementedError

    def _sum_forces(self, layout: tuple[npt.NDArray[Any], ...], forces: FloatArray) -> Sequence[FloatArray]:
        """Sum forces on cells or points over texels.

        Args:
            layout: Arrays that describe the cells, see `Solved`.
            forces: Force on each of m cells, shape (m,) [N].

        Returns:
            Contact force on each of n texels, shape (n,), and force at the base, shape (n,), if the method computes
            it [N].
        """
        raise NotImplementedError

    def find_contact(self, data: mujoco.MjData) -> tuple[ArrayContact, Sums | None] | None:
        """Find the bodies that press on the array in a simulation state, and sum all contact forces on the array.

        Returns:
            The bodies with their loads and poses, and for plates the return value of `sum_contacts`, from which net
            force and tangential forces are computed.  None if nothing touches the array.

        Raises:
            FastModelError: If a contact force is not finite.
        """
        raise NotImplementedError

    def _solve(self, contact: ArrayContact) -> Solved:
        """Compute the pressure of all bodies of a contact, and sum the pressure over texels.

        The force beside the front of the array does not count in the reading.
        """
        raise NotImplementedError

    def get_state(self) -> State:
        """Return the last contact and its reading as arrays; see `ContactReader.get_state`."""
        return {"change": np.array(self._change), **pack("solved", self._solved)}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned; see `ContactReader.set_state`."""
        self._change, self._modes = float(take_array(state, "change")), None
        self._solved = unpack(state, "solved", (Solved, ArrayContact, Load, PosedBody, BodyShape, Reading))

    def _rest(self, contact_forces: FloatArray, texel_forces: FloatArray | None) -> Reading:
        """Discard the last solution, and make the reading of given contact forces.

        Args:
            contact_forces: Force that presses on each of n texels, before spread, shape (n,) [N].
            texel_forces: Force on each texel after spread, shape (n,) [N]; None if the method computes none.
        """
        self._solved, self._change, self._modes = None, 0.0, None
        self._bodies.follow_meshes()
        torque = -np.cross(self._array.centres, self._array.normals).T @ contact_forces
        torques = np.concatenate([torque, np.zeros(3)])
        return Reading(contact_forces, texel_forces, float(contact_forces.sum()), torques=torques)

    def _conclude(
        self,
        contact: ArrayContact,
        kept: Sequence[int],
        reading: Reading,
        cells: tuple[IntArray, FloatArray, FloatArray],
        forces: FloatArray,
        *,
        depth: float,
        layout: tuple[npt.NDArray[Any], ...],
    ) -> Solved:
        """Add torques and modes to the reading of a solution.

        Args:
            contact: The contact that was solved.
            kept: Index in the bodies of MuJoCo's contact of each of its bodies.
            reading: The reading of all forces.
            cells: Body, position, shape (m, 3) [m], and normal, shape (m, 3) [-], of the m cells or points.
            forces: Force on each of them, without point forces, shape (m,) [N].
            depth: Largest overlap of the undeformed surfaces [m].
            layout: Arrays by which `_sum_forces` sums forces on the cells.
        """
        owner, place, normal = cells
        torques, found, changes = np.zeros(6), [np.zeros((0, len(forces)))], [np.zeros((0, 6))]
        torques[:3] = self._find_point_torque(contact.points)
        weights, largest, centres, sizes = [], [], [], []
        for body, load in enumerate(contact.loads):
            part = np.where(owner == body, forces, 0.0) if len(contact.loads) > 1 else forces
            along = load.directions[:1], load.turns
            centre, size, modes, moments, gram, most = self._find_modes(place, normal, part, along, self._length)
            torques[:3] -= moments[0]
            torques[3:] += load.find_missed_torque(-moments[0])
            found.append(modes[1:])
            changes.append(np.hstack([-moments[1:], moments[1:] @ load.turns.T @ load.turns]))
            # A row of cells cannot shift its force across, which the second term allows for.
            loose = np.where(np.arange(len(gram)) > 0, _LOOSE, 1e-12) * gram[0, 0]
            weights.append(np.linalg.inv(gram + np.diag(loose)))
            largest.append(np.maximum(most, _LOOSE))
            centres.append(centre)
            sizes.append(size + 0.5 * self._length)
        return Solved(
            contact=contact,
            kept=tuple(kept),
            reading=reading._replace(torques=torques),
            modes=np.concatenate(found),
            torques=np.concatenate(changes),
            layout=layout,
            weights=np.asarray(weights[0] if len(weights) == 1 else block_diag(*weights, np.zeros((0, 0)))),
            centres=np.array(centres).reshape(-1, 3),
            largest=np.concatenate([*largest, np.zeros(0)]),
            depth=depth,
            sizes=tuple(sizes),
        )

    def _find_frame(self, data: mujoco.MjData) -> FloatArray:
        """Find the axes of the array in the world, as columns, and its origin, shape (4, 3) [-, m]."""
        # dot instead of @, because @ takes twice as long for arrays this small
        axes = data.geom_xmat[self._geom].reshape(3, 3).dot(self._turn)
        return np.vstack([axes, data.geom_xpos[self._geom] - axes.dot(self._middle)])

    def _list_touches(self, data: mujoco.MjData, frame: FloatArray) -> Touches:
        """List the contacts of a state with the array; `frame` is the return value of `_find_frame`."""
        contact = data.contact
        part = self._part_of[contact.geom]
        k, side = ((part >= 0) & (contact.efc_address >= 0)[:, None]).nonzero()
        local = np.zeros((len(k), 6))  # force and torque of each contact in the frame of the contact
        for number, force in zip(k.tolist(), local, strict=True):
            mujoco.mj_contactForce(self._model, data, number, force)
        if not np.isfinite(local).all():
            self._refuse(data)
        axes = contact.frame[k].reshape(-1, 3, 3) @ frame[:3]
        axes[side == 1] *= -1
        return Touches(
            part=part[k, side],
            body=self._bodies.of_geom[contact.geom[k, 1 - side]],
            outward=axes[:, 0],
            pressure=local[:, :1] * axes[:, 0],
            friction=np.einsum("ki,kij->kj", local[:, 1:3], axes[:, 1:]),
            place=(contact.pos[k] - frame[3]) @ frame[:3],
            depth=-contact.dist[k],
        )

    def _build_contact(
        self,
        data: mujoco.MjData,
        frame: FloatArray,
        touches: Touches,
        *,
        forces: FloatArray,
        normals: FloatArray,
        upright: FloatArray,
        table: FloatArray,
        front: BoolArray,
        points: BoolArray,
    ) -> ArrayContact:
        """Sum the contact forces of each body to a force vector with its moment.

        Args:
            data: The state of the simulation.
            frame: Axes and origin of the array in the world, see `_find_frame`.
            touches: The k contacts.
            forces: Part of each contact force that counts as pressure, shape (k, 3) [N].
            normals: Normals of the surface, shape (n, 3) [-].  A body whose force points against all of them exerts no
                pressure.
            upright: Axis in the world about which a body may rotate without tilting, shape (3,) [-]; zero if every
                rotation counts as a tilt.
            table: The contacts as rows of numbers, see `ArrayContact`, shape (k, 3 or 6).
            front: Whether each contact is with the front of the array, shape (k,).
            points: Whether each contact acts as a point force, because its body has no known shape, shape (k,).
        """
        loads: dict[int, Load] = {}
        for body in np.unique(touches.body[front & (touches.body >= 0)]).tolist():
            mine = front & (touches.body == body)
            vector, moment = forces[mine].sum(axis=0), np.cross(touches.place[mine], forces[mine]).sum(axis=0)
            if (normals @ vector).max() > 0:
                slides = self._joints.find_slides(data, body) @ frame[:3]
                rotates = self._joints.let_tilt(data, body, upright)
                loads[body] = Load.along_free_directions(vector, moment, slides, rotates=rotates)
        known = front & np.isin(touches.body, list(loads))
        return ArrayContact(
            bodies=tuple(loads),
            loads=tuple(loads.values()),
            poses=tuple(
                self._find_pose(data, body, frame, float(touches.depth[touches.body == body].max())) for body in loads
            ),
            owner=np.searchsorted(np.array(list(loads), dtype=np.int64), touches.body[known]),
            touches=table[known],
            points=table[points],
            beside=0.0,
        )

    def _find_pose(self, data: mujoco.MjData, body: int, frame: FloatArray, depth: float) -> PosedBody:
        """Compute the poses of a body's solids in the array's frame.

        Args:
            data: The state of the simulation.
            body: Id of the body.
            frame: Axes and origin of the array in the world, see `_find_frame`.
            depth: Deepest penetration of the body into the geoms of the array [m].
        """
        geoms, shape = self._bodies.find_shape(body)
        rotation, position = self._transform_poses(geoms, data.geom_xmat, data.geom_xpos, frame)
        return PosedBody(shape=shape, rotation=rotation, position=position, depth=depth)

    def _refuse(self, data: mujoco.MjData) -> None:
        """Raise the error about contact forces that are not finite."""
        raise FastModelError(f"contact forces on geom {self._name!r} are not finite at t = {data.time:g} s")


def transform_poses(
    geoms: IntArray, xmat: FloatArray, xpos: FloatArray, frame: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Kernel: transform the poses of p geoms from the world to the array's frame.

    Args:
        geoms: Ids of the p geoms, shape (p,).
        xmat: Axes of all geoms in the world, shape (geoms, 9) [-].
        xpos: Origins of all geoms in the world, shape (geoms, 3) [m].
        frame: Axes of the array in the world, as columns, and its origin, shape (4, 3) [-, m].

    Returns:
        Axes of the p geoms in the array's frame, as columns, shape (p, 3, 3) [-], and their origins, shape (p, 3) [m].
    """
    rotation, position = np.zeros((len(geoms), 3, 3)), np.zeros((len(geoms), 3))
    for p in range(len(geoms)):
        g = geoms[p]
        for i in range(3):
            for j in range(3):
                position[p, i] += frame[j, i] * (xpos[g, j] - frame[3, j])
                for k in range(3):
                    rotation[p, i, k] += frame[j, i] * xmat[g, 3 * j + k]
    return rotation, position
