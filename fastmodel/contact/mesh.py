"""Contact method for curved covers in MuJoCo: rigid mesh geoms, and the contact pressure on the curved surface.

MuJoCo collides the convex hull of the cover's top, or of parts of it where it has dents, which gives the force of each
body.  The pressure on the surface follows from the shapes of the bodies and the compliance of the cover.
Friction is not used: the tangential force of a contact acts on no point.  Net force, net torque and tangential forces
of frames are not computed.

The force of a body on a slide joint acts along the joint.  The force of a body that is free to rotate has the direction
of MuJoCo's contact normals, which are normals of the hull's facets.  Where a round body touches a round cover, the
position of this force is uncertain by about half a facet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from fastmodel.contact.bodies import COLOUR, EVERY, check_box, find_geoms
from fastmodel.contact.interface import Reading, TexelContact
from fastmodel.contact.points import Footprint, solve_pressure
from fastmodel.contact.reader import ArrayContact, PressureReader, Solved
from fastmodel.errors import ParametersError
from fastmodel.state import State, take_array
from fastmodel.surface import CoverPoints, Surface
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: Depth of a dent above which bodies would not reach the cover's top, over the thickness [-]; chosen by judgement.
_DENT = 0.1
#: Number of points up to which a part of the top is not divided [-].
_FEWEST = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshContact(TexelContact):
    """Contact method that distributes the force of each body over points of a cover by the cover's compliance.

    Attributes:
        surface: Points of the cover; None for those of the parameters.
        contype: Collision mask of the mesh geom, 31 bits [-].
        conaffinity: Mask of the geoms that it meets, 31 bits [-].
    """

    surface: CoverPoints | None = None
    contype: int = EVERY
    conaffinity: int = EVERY

    computes_spread: ClassVar[bool] = True
    #: The influence divides the force where texels overlap.
    takes_overlaps: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Check the masks.

        Raises:
            ValueError: If a mask is not of 31 bits.
        """
        check_box(1.0, self.contype, self.conaffinity)

    def adapt(self, surface: Surface | None) -> MeshContact:
        """Return the method for the points of a cover.

        Raises:
            ParametersError: If the surface is not a `CoverPoints`.
        """
        if not isinstance(surface, CoverPoints):
            raise ParametersError(
                "the contact method 'curved' needs a curved cover, which these parameters do not hold"
            )
        return replace(self, surface=surface)

    @property
    def pressed_points(self) -> CoverPoints | None:
        """The points of the cover; see `TexelContact.pressed_points`."""
        return self.surface

    def find_start(self, array: TexelArray, at: tuple[float, float], reach: float) -> float:
        """Return the height of the highest point; see `TexelContact.find_start`."""
        return super().find_start(array, at, reach) if self.surface is None else float(self.surface.points[:, 2].max())

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add the mesh geoms; see `TexelContact.attach`.

        Raises:
            ParametersError: If the method has no points.
            FastModelError: If the cover is for another number of texels.
        """
        surface = self._require_surface(array)
        child = mujoco.MjSpec()
        inner = child.worldbody.add_frame()
        for plate, vertices in zip(_name_plates(surface), list_hulls(surface), strict=True):
            child.add_mesh(name=plate, uservert=vertices.ravel().tolist())
            geom = inner.add_geom(name=plate, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=plate, mass=0.0)
            geom.contype, geom.conaffinity, geom.rgba[:] = self.contype, self.conaffinity, COLOUR
        frame.parent.attach_frame(inner, f"{name}/", "").set_frame(frame)

    def sample_top(
        self, model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, array: TexelArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the points of the cover; see `TexelContact.sample_top`."""
        if self.surface is None:
            return super().sample_top(model, data, geoms, array)
        turn, middle = _find_mesh_frame(model, int(geoms[0]))
        axes = data.geom_xmat[geoms[0]].reshape(3, 3) @ turn.T
        origin = data.geom_xpos[geoms[0]] - axes @ middle
        return origin + self.surface.points @ axes.T, self.surface.normals @ axes.T

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> MeshReader:
        """Find the mesh geom in the compiled model; see `TexelContact.bind`.

        The points of the contact method are used, and the argument `surface` is not.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        del surface
        return MeshReader(self._require_surface(array), model, array, name)

    def _require_surface(self, array: TexelArray) -> CoverPoints:
        """Return the points of the cover, after a check that their number of texels is that of a texel array."""
        if self.surface is None:
            raise ParametersError("the contact method 'curved' needs points: give its name or MeshContact(surface=...)")
        self.surface.check(array)
        return self.surface


@lru_cache(maxsize=4)
def list_hulls(cover: CoverPoints) -> tuple[FloatArray, ...]:
    """List the points whose convex hulls collide in MuJoCo, shape (k, 3) [m] for each hull.

    They are the points of the cover's top and, if the top is flat, also the points of the base below.  A top with dents
    is divided until a body stops less than `_DENT` thicknesses above a dent.  The parts overlap by one spacing, so that
    nothing passes between them.
    """
    points, lower = cover.points, cover.points - cover.thickness * cover.normals
    both, extent = np.concatenate([points, lower]), np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    # With the base below, the bottom of a dent lies inside the hull and not on its lower side.
    if _measure_dents(points, both) <= _DENT * cover.thickness:
        return (points if extent[-1] > 1e-6 * extent[0] else both,)
    pending, parts, tree = [np.arange(len(points))], [], cKDTree(points)
    while pending:
        part = pending.pop()
        hull = np.concatenate([points[part], lower[part]])
        if len(part) <= _FEWEST or _measure_dents(points[part], hull) <= _DENT * cover.thickness / 2:
            near = np.unique(np.concatenate(tree.query_ball_point(points[part], cover.spacing))).astype(np.int64)
            parts.append(np.concatenate([points[near], lower[near]]))
            continue
        away = points[part] - points[part].mean(axis=0)
        along = away @ np.linalg.svd(away, full_matrices=False)[2][0]
        order = np.argsort(along, kind="stable")
        pending += [part[order[: len(part) // 2]], part[order[len(part) // 2 :]]]
    return tuple(parts)


def _measure_dents(points: FloatArray, vertices: FloatArray) -> float:
    """Measure how far the deepest of some points lies below the convex hull of vertices, which hold them [m]."""
    planes = ConvexHull(vertices).equations
    return float(-(points @ planes[:, :3].T + planes[:, 3]).max(axis=1).min())


def _name_plates(cover: CoverPoints) -> list[str]:
    """Name the mesh geoms of a cover."""
    return ["plate", *(f"plate{number}" for number in range(1, len(list_hulls(cover))))]


class MeshReader(PressureReader):
    """Reader that computes texel forces from the bodies that press on a curved cover."""

    def __init__(self, cover: CoverPoints, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the mesh geom in the compiled model, and the texel nearest to each point of the cover.

        Args:
            cover: Points of the cover, with compliance and influence.
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor, as given to `MeshContact.attach`.
        """
        geoms = [f"{name}/{plate}" for plate in _name_plates(cover)]
        frame = _find_mesh_frame(model, int(find_geoms(model, geoms, name)[0]))
        super().__init__(model, array, name, geoms=geoms, frame=frame)
        self._cover, self._length = cover, cover.spacing
        self._points, self._texel = cKDTree(cover.points), cover.find_texels(array)
        self._nothing = self.at_rest(np.zeros(array.count))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, and discard previous solutions; see `ContactReader.at_rest`.

        The force on each texel acts at the point of the cover that is nearest to the texel.
        """
        #: Footprint of each body of the last solution, by the id of the body.
        self._last: dict[int, Footprint] = {}
        nearest = self._points.query(self._array.centres + self._cover.thickness * self._array.normals)[1]
        return self._rest(contact_forces, np.asarray(self._cover.influence[:, nearest] @ contact_forces))

    def get_state(self) -> State:
        """Return the last contact, its footprints and its reading; see `ContactReader.get_state`."""
        rows = [[body, *each.row] for body, each in self._last.items()]
        return {"footprints": np.array(rows, dtype=float).reshape(-1, 8), **super().get_state()}

    def set_state(self, state: State) -> None:
        """Restore what `get_state` returned; see `ContactReader.set_state`."""
        rows = take_array(state, "footprints")
        self._last = {int(row[0]): Footprint.of(row[1:]) for row in rows}
        super().set_state(state)

    def find_contact(self, data: mujoco.MjData) -> tuple[ArrayContact, None] | None:
        """Find the bodies that press on the top and their loads, without friction; see `PressureReader.find_contact`.

        On a curved cover every rotation of a body counts as a tilt.
        """
        frame = self._find_frame(data)
        touches = self._list_touches(data, frame)
        if not len(touches.part):
            return None
        nearest = self._points.query(touches.place)[1]
        front = np.einsum("kc,kc->k", touches.outward, self._cover.normals[nearest]) > 0
        contact = self._build_contact(
            data,
            frame,
            touches,
            forces=touches.pressure,
            normals=self._cover.normals,
            upright=np.zeros(3),
            table=np.hstack([touches.place, touches.pressure]),
            front=front,
            points=front & (touches.body < 0),
        )
        return (contact, None) if contact.bodies or len(contact.points) else None

    def _solve(self, contact: ArrayContact) -> Solved:
        """Compute the forces on the points of the cover from the loads of all bodies.

        If the search does not converge, the forces of its last iteration are used.
        """
        cover = self._cover
        found = solve_pressure(cover, contact.poses, contact.loads, [self._last.get(each) for each in contact.bodies])
        # A body that no normal of the cover meets acts through its contact points.
        kept = [number for number, each in enumerate(found) if each is not None]
        solved = [each for each in found if each is not None]
        contact = contact.select(kept)
        self._last = {body: each.footprint for body, each in zip(contact.bodies, solved, strict=True)}
        carried = sum(load.force for load in contact.loads)
        owner = np.repeat(np.arange(len(solved)), [len(each.forces) for each in solved])
        place = np.concatenate([np.zeros((0, 3)), *(each.place for each in solved)])
        normal = np.concatenate([np.zeros((0, 3)), *(each.normal for each in solved)])
        forces = np.concatenate([np.zeros(0), *(each.forces for each in solved)])
        below = np.concatenate([np.zeros(0, dtype=np.int64), *(self._texel[each.nearest] for each in solved)])
        empty = np.zeros((self._array.count, 0))
        layout = (below, np.concatenate([empty, *(each.build_influence(cover) for each in solved)], axis=1))
        contact_forces, texel_forces = self._sum_forces(layout, forces)
        if len(contact.points):
            # contacts without a convex shape act as forces on the nearest points
            nearest, pressure = self._points.query(contact.points[:, :3])[1], contact.points[:, 3:]
            pressing = np.maximum((pressure * cover.normals[nearest]).sum(axis=1), 0.0)
            contact_forces += np.bincount(self._texel[nearest], pressing, self._array.count)
            texel_forces += cover.influence[:, nearest] @ pressing
            carried += float(np.linalg.norm(pressure, axis=1).sum())
        fewest = min((int((each.forces > 0).sum()) for each in solved), default=None)
        reading = Reading(contact_forces, texel_forces, carried, fewest_cells=fewest)
        depth = max((each.depth for each in solved), default=0.0)
        return self._conclude(contact, kept, reading, (owner, place, normal), forces, depth=depth, layout=layout)

    def _find_point_torque(self, points: FloatArray) -> FloatArray:
        """Return the torque of point forces, shape (3,) [N m]; see `PressureReader._find_point_torque`."""
        return np.asarray(-np.cross(points[:, :3], points[:, 3:]).sum(axis=0))

    def _sum_forces(self, layout: tuple[npt.NDArray[Any], ...], forces: FloatArray) -> list[FloatArray]:
        """Sum forces on the cells over texels, see `PressureReader._sum_forces`.

        The layout holds the texel below each cell, and the matrix from forces on cells to forces on texels.
        """
        texels, influence = layout
        return [np.bincount(texels, forces, self._array.count).astype(np.float64), np.asarray(influence @ forces)]


def _find_mesh_frame(model: mujoco.MjModel, geom: int) -> tuple[FloatArray, FloatArray]:
    """Find axes, as columns [-], and origin [m] of a mesh geom in the frame of its vertices.

    MuJoCo moves the origin of a mesh geom to the centre of mass, and turns its axes to the axes of inertia.
    """
    mesh = int(model.geom_dataid[geom])
    return Rotation.from_quat(model.mesh_quat[mesh], scalar_first=True).as_matrix(), model.mesh_pos[mesh].copy()
