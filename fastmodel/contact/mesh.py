"""Contact method for points of a cover in MuJoCo: one rigid mesh geom, and the contact pressure on the curved surface.

MuJoCo collides the convex hull of the cover's top, which gives the force of each body.  The forces on the points of the
surface follow from the shapes of the bodies and the compliance of the cover.  Friction is not used: the tangential
force of a contact presses on no point.  Net force, net torque and tangential forces of frames are not computed.

The force of a body on a slide joint acts along the joint.  The force of a body that is free to turn has the direction
of MuJoCo's contact normals, which are those of the hull's facets: where a round body touches a round cover, its place
is uncertain by about half a facet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from fastmodel.contact.bodies import Bodies
from fastmodel.contact.geoms import EVERY, check_box, find_geoms
from fastmodel.contact.interface import Reading
from fastmodel.contact.joints import Joints
from fastmodel.contact.panels import Wrench
from fastmodel.contact.points import PointPressure, solve_pressure
from fastmodel.errors import FastModelError, ParametersError
from fastmodel.pose import Mount, rotate
from fastmodel.pressure.gap_sampling import PosedBody
from fastmodel.state import State, pack, take_array, unpack
from fastmodel.surface import CoverPoints, Surface
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: Largest depth of a point of the top below its convex hull, over the thickness [-]: the depth to which a deep dent of
#: the top would be too far for bodies in MuJoCo.
_DENT = 0.1
#: Smallest over largest extent of the top below which it counts as flat: its points have no volume [-].
_FLAT = 1e-6
#: Relative change of forces, and change of positions over the thickness and of rotations, up to which a contact counts
#: as unchanged, so that the last reading is returned [-].
_UNCHANGED = 1e-5
#: Colour of the geom: red, green, blue, opacity [-].
_COLOUR = (0.25, 0.27, 0.3, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshContact:
    """Contact method that distributes the force of each body over points of a cover by the cover's compliance.

    Attributes:
        surface: Points of the cover; None takes those of the parameters.
        contype: Collision mask of the mesh geom, 31 bits [-].
        conaffinity: Mask of the geoms that it meets, 31 bits [-].
    """

    surface: CoverPoints | None = None
    contype: int = EVERY
    conaffinity: int = EVERY

    costly: ClassVar[bool] = True
    computes_spread: ClassVar[bool] = True
    #: The influence divides the force where texels overlap.
    takes_overlaps: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the masks and that the top is convex.

        Raises:
            ValueError: If a mask is not of 31 bits.
            FastModelError: If the top has dents, into which no body would reach in MuJoCo.
        """
        check_box(1.0, self.contype, self.conaffinity)
        if self.surface is None:
            return
        most = _DENT * self.surface.thickness
        planes = ConvexHull(_list_vertices(self.surface)).equations
        depth = -(self.surface.points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        if depth.max() > most:
            raise FastModelError(
                f"the top of the cover has dents {1e3 * depth.max():.3g} mm deep; MuJoCo collides convex hulls, so "
                f"the contact method 'curved' takes dents of at most {1e3 * most:.2g} mm"
            )

    def adapt(self, surface: Surface | None) -> MeshContact:
        """Return the method for the points of a cover.

        Raises:
            ParametersError: If the surface is none of points.
            FastModelError: If the top has dents.
        """
        if not isinstance(surface, CoverPoints):
            raise ParametersError(
                "the contact method 'curved' needs a curved cover, which these parameters do not hold"
            )
        return replace(self, surface=surface)

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Mount, name: str) -> None:
        """Add the mesh geom to a body of the spec; see `TexelContact.attach`.

        Raises:
            ParametersError: If the method has no points.
            FastModelError: If the cover is for another number of texels.
        """
        surface = self._require_surface(array)
        child = mujoco.MjSpec()
        child.add_mesh(name="plate", uservert=_list_vertices(surface).ravel().tolist())
        frame = child.worldbody.add_frame(pos=pose.position.tolist(), quat=pose.quaternion.tolist())
        geom = child.worldbody.add_geom(name="plate", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="plate", mass=0.0)
        geom.contype, geom.conaffinity, geom.rgba[:] = self.contype, self.conaffinity, _COLOUR
        geom.set_frame(frame)
        body.attach_frame(frame, f"{name}/", "")

    def bind(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        surface: Surface | None = None,  # noqa: ARG002
    ) -> MeshReader:
        """Find the mesh geom in the compiled model; see `TexelContact.bind`.  The points are those of the method.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        return MeshReader(self._require_surface(array), model, array, name)

    def _require_surface(self, array: TexelArray) -> CoverPoints:
        """Return the points, checked against an array."""
        if self.surface is None:
            raise ParametersError("the contact method 'curved' needs points: give its name or MeshContact(surface=...)")
        self.surface.check(array)
        return self.surface


def _list_vertices(cover: CoverPoints) -> FloatArray:
    """Return the points whose convex hull MuJoCo collides: those of the top, and below a flat top those of the base."""
    points = cover.points
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if extent[-1] > _FLAT * extent[0]:
        return points
    return np.concatenate([points, points - cover.thickness * cover.normals])


class MeshReader:
    """Reader that computes texel forces from the bodies that press on a curved cover."""

    def __init__(self, cover: CoverPoints, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the mesh geom, and the nearest texel of every point.

        Args:
            cover: Arrays of the cover.
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor, as given to `MeshContact.attach`.
        """
        self._cover, self._model, self._array = cover, model, array
        geoms = find_geoms(model, [f"{name}/plate"], name)
        self._geom = int(geoms[0])
        self._bodies = Bodies(model, geoms, name)
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))
        self._points = cKDTree(cover.points)
        self._texel = cover.find_texels(array)
        self.at_rest(np.zeros(array.count))

    def compile_kernels(self, data: mujoco.MjData) -> None:  # noqa: ARG002
        """Describe the shapes of all bodies; there is no kernel."""
        self._bodies.find_shapes()

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, and discard previous solutions; see `ContactReader.at_rest`."""
        self._bodies.follow_meshes()
        self._forces = np.zeros(len(self._cover.points))
        self._signature, self._reading = np.zeros(0), Reading(np.zeros(self._array.count), None, 0.0)
        above = self._array.centres + self._cover.thickness * self._array.normals
        nearest = self._points.query(above)[1]
        return Reading(contact_forces, self._cover.influence[:, nearest] @ contact_forces, float(contact_forces.sum()))

    def get_state(self) -> State:
        """Return the last contact, its forces and its reading; see `ContactReader.get_state`."""
        return {"forces": self._forces, "signature": self._signature, **pack("reading", self._reading)}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned; see `ContactReader.set_state`."""
        self._forces = take_array(state, "forces", self._forces)
        self._signature = take_array(state, "signature")
        self._reading = unpack(state, "reading", (Reading,))

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the forces of a step, or return the last ones if no force or pose has changed.

        Raises:
            LifeCycleError: If the size of the geom has changed.
        """
        self._bodies.follow_changes()
        axes, origin = find_frame(self._model, data, self._geom)
        body, force, place = self._list_contacts(data, axes, origin)
        if not len(body):
            return self._rest(np.zeros(0))
        if not np.isfinite(force).all():
            return Reading(np.zeros(self._array.count), None, float("nan"))
        bodies, loads, numbers, scattered = [], [], [], body < 0
        for each in np.unique(body[body >= 0]).tolist():
            mine = body == each
            vector, moment = force[mine].sum(axis=0), np.cross(place[mine], force[mine]).sum(axis=0)
            if not vector.any():
                continue
            slides = self._joints.find_slides(data, each) @ axes
            rotates = self._joints.let_tilt(data, each, np.zeros(3))
            numbers.append(each)
            bodies.append(self._find_pose(data, each, axes, origin))
            loads.append(Wrench.along_free_directions(vector, moment, slides, rotates=rotates))
        signature = np.concatenate(
            [
                np.append(body, 0.0),
                *(np.concatenate([load.vector, load.moment / self._cover.thickness]) / load.force for load in loads),
                np.array([load.force for load in loads]),
                *(np.append(each.position / self._cover.thickness, each.rotation) for each in bodies),
                force[scattered].ravel(),
            ]
        )
        if len(signature) == len(self._signature) and np.allclose(
            signature, self._signature, rtol=_UNCHANGED, atol=_UNCHANGED
        ):
            return self._reading
        forces, carried = np.zeros(len(self._cover.points)), 0.0
        points = None
        if bodies:
            found = self._solve(bodies, loads)
            forces, points = found.forces, int(found.points.min())
            carried = sum(load.force for load, many in zip(loads, found.points, strict=True) if many)
            # A body so small that it fits between the points presses with its contact points.
            scattered = scattered | np.isin(body, np.array(numbers)[found.points == 0])
        forces = forces + self._scatter(place[scattered], force[scattered])
        self._forces, self._signature = forces, signature
        self._reading = Reading(
            np.bincount(self._texel, forces, self._array.count).astype(np.float64),
            self._cover.influence @ forces,
            carried + float(np.linalg.norm(force[scattered], axis=1).sum()),
            fewest_cells=points,
        )
        return self._reading

    def _rest(self, signature: FloatArray) -> Reading:
        """Return the reading of the untouched cover."""
        self._signature = signature
        self._reading = Reading(np.zeros(self._array.count), np.zeros(self._array.count), 0.0)
        return self._reading

    def _solve(self, bodies: list[PosedBody], loads: list[Wrench]) -> PointPressure:
        """Find the forces of all bodies; bodies whose moments no pressure can have keep only their force.

        Where that fails too, the forces of the last step of the search stand.
        """
        found = solve_pressure(self._cover, bodies, loads, self._forces)
        if not found.settled or misses_load(self._cover, found, loads):
            found = solve_pressure(self._cover, bodies, [load.without_moments() for load in loads])
        return found

    def _list_contacts(
        self, data: mujoco.MjData, axes: FloatArray, origin: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """List the contacts that press on the top: body, -1 without a convex shape; force with its sign reversed.

        Returns:
            Body, shape (k,); force, shape (k, 3) [N], and position, shape (k, 3) [m], in the frame of the array.
        """
        contact = data.contact
        own = contact.geom == self._geom
        touching = np.flatnonzero(own.any(axis=1) & (contact.efc_address >= 0))
        pressure = np.zeros((len(touching), 6))
        for number, force in zip(touching.tolist(), pressure, strict=True):
            mujoco.mj_contactForce(self._model, data, number, force)
        second = own[touching, 1]
        other = contact.geom[touching, np.where(second, 0, 1)]
        outward = (contact.frame[touching, :3] @ axes) * np.where(second, -1.0, 1.0)[:, None]
        place = (contact.pos[touching] - origin) @ axes
        nearest = self._points.query(place)[1] if len(place) else np.zeros(0, dtype=np.int64)
        front = np.einsum("kc,kc->k", outward, self._cover.normals[nearest]) > 0
        force = pressure[:, :1] * outward
        return self._bodies.of_geom[other][front], force[front], place[front]

    def _find_pose(self, data: mujoco.MjData, body: int, axes: FloatArray, origin: FloatArray) -> PosedBody:
        """Describe the solids of a body and their poses in the frame of the array."""
        geoms, shape = self._bodies.find_shape(body)
        return PosedBody(
            shape=shape,
            rotation=axes.T @ data.geom_xmat[geoms].reshape(-1, 3, 3),
            position=(data.geom_xpos[geoms] - origin) @ axes,
        )

    def _scatter(self, place: FloatArray, force: FloatArray) -> FloatArray:
        """Let contacts without a convex shape act as forces on the nearest points, shape (m,) [N]."""
        out = np.zeros(len(self._cover.points))
        if len(place):
            nearest = self._points.query(place)[1]
            np.add.at(out, nearest, np.maximum((force * self._cover.normals[nearest]).sum(axis=1), 0.0))
        return out


def misses_load(cover: CoverPoints, found: PointPressure, loads: list[Wrench]) -> bool:
    """Return whether the force of a body that touches differs from its load by more than a hundredth along the load."""
    for number, load in enumerate(loads):
        force = np.where(found.owner == number, found.forces, 0.0) @ cover.normals
        length = float(np.linalg.norm(load.vector))
        if found.points[number] and abs((force - load.vector) @ load.vector) > 1e-2 * load.force * length:
            return True
    return False


def find_frame(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[FloatArray, FloatArray]:
    """Find the frame of the array that a mesh geom belongs to.

    MuJoCo moves the frame of a mesh geom to the centre of the mesh and along its axes of inertia.

    Returns:
        Axes of the array in the world, as columns, shape (3, 3) [-], and its origin, shape (3,) [m].
    """
    mesh = int(model.geom_dataid[geom])
    turn = rotate(model.mesh_quat[mesh], np.eye(3)).T  # axes of the geom in the frame of the array
    axes = data.geom_xmat[geom].reshape(3, 3) @ turn.T
    return axes, data.geom_xpos[geom] - axes @ model.mesh_pos[mesh]
