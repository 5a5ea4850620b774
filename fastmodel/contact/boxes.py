"""Contact methods with one rigid box geom per texel.

`BoxTexels` is the method of the 2015 report.  The forces on all boxes add up to the weight, but MuJoCo divides the
force of a flat face among the boxes by the *number of contact points* per box instead of by area.  This is the main
error of the method.

`AreaTexels` redistributes the force of each touching body over the boxes by contact area.  The body's contact points
on one box span a polygon.  A pressure p(x, y) = a + b x + c y acts on all polygons of the body.  Its coefficients are
chosen so that the force and both moments on the body equal those of MuJoCo.  For a guided body the pressure is uniform,
because the guide takes up the moments.  The forces on boxes that a body touches only in points or along edges are not
changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import EVERY, Bodies, Joints, check_box, describe_box, find_geoms
from fastmodel.contact.forces import NetForceReader, press_boxes, read_contacts
from fastmodel.contact.interface import Reading, TexelContact
from fastmodel.signal.point_spread import find_tangents
from fastmodel.state import State
from fastmodel.surface import Surface
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray, IntArray

#: Colour of masked texels: red, green, blue, opacity [-].
_MASKED_COLOUR = (0.5, 0.5, 0.5, 0.4)


@dataclass(frozen=True, kw_only=True)
class BoxTexels(TexelContact):
    """Contact method with one rigid box per texel, whose outer face is the texel.

    The boxes are as wide as the texel pitch, so that no gaps remain between the boxes.  They have no mass.  Masked
    texels have boxes too, because the cover carries load there although the sensor does not measure this load.

    Attributes:
        height: Height of a box, inwards from its outer face [m].
        contype: Collision mask of the boxes, 31 bits [-].  With all bits, the default, the boxes collide with every
            geom that collides with anything, including other arrays.
        conaffinity: Mask of the geoms that the boxes collide with, 31 bits [-].
    """

    height: float = 2e-3
    contype: int = EVERY
    conaffinity: int = EVERY

    costly: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive or a mask not of 31 bits.
        """
        check_box(self.height, self.contype, self.conaffinity)

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add one box geom per texel; see `TexelContact.attach`."""
        axes = np.stack([*find_tangents(array), array.normals], axis=-1)
        turns = Rotation.from_matrix(axes).as_quat(scalar_first=True)
        places = array.centres - 0.5 * self.height * array.normals
        half = (array.pitch[0] / 2, array.pitch[1] / 2, self.height / 2)
        box = describe_box(half, self.contype, self.conaffinity)
        for index, active in enumerate(array.active):
            geom = frame.add_geom(name=f"{name}/texel{index}", pos=places[index], quat=turns[index], **box)
            if not active:
                geom.rgba[:] = _MASKED_COLOUR

    def bind(self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None) -> BoxReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`.  The argument `surface` is not used.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        del surface
        return BoxReader(model, array, name)


class BoxReader:
    """Reader that sums MuJoCo's contact forces on each box; a contact belongs to a box by its geom id."""

    def __init__(self, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the geoms of the n texels.

        Args:
            model: The compiled model.
            array: The texels.
            name: Name of the sensor, as given to `BoxTexels.attach`.
        """
        geoms = find_geoms(model, [f"{name}/texel{index}" for index in range(array.count)], name)
        self._count, self._model, self._first = len(geoms), model, int(geoms[0])
        self._bodies = Bodies(model, geoms, name)
        axes = np.stack([*(each[0] for each in find_tangents(array)), array.normals[0]], axis=-1)
        middle = array.centres[0] - model.geom_size[geoms[0], 2] * array.normals[0]
        neighbours, self._press_boxes = _find_neighbours(array), compile_kernel(press_boxes)
        self._net_force = NetForceReader(model, array, geoms, axes=axes, middle=middle, neighbours=neighbours)

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces of the last simulation step; see `ContactReader.read`.

        Each contact force is projected on the normal of its box, because at an edge of the box the contact normal has
        another direction.  Forces on the backs and free sides of boxes count only towards the total.
        An indenter that hooks on the side of a box inside the array can pull it upwards by friction.  The force on such
        a box is set to zero, and the other forces are scaled to keep their sum.

        Raises:
            LifeCycleError: If the size of the boxes has changed.
        """
        self._bodies.check_size()
        contacts = read_contacts(self._model, data)
        forces, carried, sums = self._press_boxes(contacts, data.geom_xmat, data.geom_xpos, self._net_force.parts)
        return self._net_force.add(Reading(self._share(data, sums[0], forces), None, carried), sums)

    def get_state(self) -> State:
        """Return no arrays, because a reading of this method does not depend on earlier readings."""
        return {}

    def set_state(self, state: State) -> None:
        """Do nothing, because a reading of this method does not depend on earlier readings."""

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, shape (n,) [N]; see `ContactReader.at_rest`."""
        return self._net_force.add(Reading(contact_forces, None, float(contact_forces.sum())), None)

    def _share(self, data: mujoco.MjData, pressed: FloatArray, total: FloatArray) -> FloatArray:  # noqa: ARG002
        """Distribute the forces of a state over the texels; here each box keeps its own force, shape (n,) [N].

        Args:
            data: The state.
            pressed: Force on both geoms of each of k contacts, see `sum_contacts`, shape (k, 2) [N].
            total: Force on each box, not negative, shape (n,) [N].
        """
        return total


def _find_neighbours(array: TexelArray) -> BoolArray:
    """Find whether each of n texels has a neighbour at its sides -x, +x, -y, +y, shape (n, 4)."""
    tree, found = cKDTree(array.centres), np.zeros((array.count, 4), dtype=bool)
    for axis, tangent in enumerate(find_tangents(array)):
        for side, sign in enumerate((-1.0, 1.0)):
            beyond = array.centres + sign * array.pitch[axis] * tangent
            distance, _ = tree.query(beyond)
            found[:, 2 * axis + side] = np.asarray(distance) < min(array.pitch) / 2
    return found


#: Area of a contact polygon, over the product of the texel pitches, up to which it counts as a point or an edge [-].
_FLAT = 1e-6
#: Singular values of the moment equations, over the largest one, below which they count as zero [-].  They occur where
#: all contact polygons lie on one line.
_SINGULAR = 1e-10
#: Smallest number of points that span a polygon, and of polygons that determine a linear pressure [-].
_TRIANGLE = 3


@dataclass(frozen=True, kw_only=True)
class AreaTexels(BoxTexels):
    """Contact method with rigid boxes, whose forces are redistributed by the area of contact polygons.

    The settings are those of `BoxTexels`.
    """

    costly: ClassVar[bool] = True

    def bind(
        self, model: mujoco.MjModel, array: TexelArray, name: str, *, surface: Surface | None = None
    ) -> AreaReader:
        """Find the boxes in the compiled model; see `BoxTexels.bind`."""
        del surface
        return AreaReader(model, array, name)


class AreaReader(BoxReader):
    """Reader that sums contact forces on each box and redistributes the force of each body by contact area."""

    def __init__(self, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the geoms of the texels and the joints of the array; see `BoxReader`."""
        super().__init__(model, array, name)
        self._joints = Joints(model, int(model.geom_bodyid[self._first]))
        self._smallest = _FLAT * array.pitch[0] * array.pitch[1]

    def _share(self, data: mujoco.MjData, pressed: FloatArray, total: FloatArray) -> FloatArray:
        """Redistribute the force of each body by contact area, shape (n,) [N]; see `BoxReader._share`.

        A flex or another body without a convex shape keeps the forces of its contact points.
        """
        if np.count_nonzero(total) <= 1:
            return total
        self._bodies.follow_changes()
        contact = data.contact
        texels = self._net_force.parts[0][contact.geom]
        k, side = ((texels >= 0) & (pressed != 0)).nonzero()
        texel, force, place = texels[k, side], pressed[k, side], contact.pos[k]
        body = self._bodies.of_geom[contact.geom[k, 1 - side]]
        rotation = data.geom_xmat[self._first].reshape(3, 3)
        local = (place - data.geom_xpos[self._first]) @ rotation
        scattered = body < 0
        shared = np.bincount(texel[scattered], force[scattered], self._count).astype(np.float64)
        for each in np.unique(body[~scattered]):
            mine = body == each
            tilts = self._joints.let_tilt(data, int(each), rotation[:, 2])
            shared += self._redistribute(texel[mine], force[mine], local[mine, :2], tilts=tilts)
        shared = np.maximum(shared, 0.0)
        return shared * (total.sum() / shared.sum()) if shared.sum() > 0 else total

    def _redistribute(self, texel: IntArray, force: FloatArray, place: FloatArray, *, tilts: bool) -> FloatArray:
        """Redistribute the force of one body over n texels by contact area, shape (n,) [N].

        Args:
            texel: Texel of each of the body's contacts, shape (k,) [-].
            force: Force of each contact against the texel's normal, shape (k,) [N].
            place: Positions of the contacts in the plane of the array, shape (k, 2) [m].
            tilts: Whether the body is free to tilt; the pressure then also has the moments of the contact forces.
        """
        own = np.bincount(texel, force, self._count).astype(np.float64)
        touched = np.unique(texel)
        outlines = np.array([_measure_polygon(place[texel == each]) for each in touched])
        wide = outlines[:, 0] > self._smallest
        if not wide.any():
            return own
        area, middle = outlines[wide, 0], outlines[wide, 1:]
        inside = np.isin(texel, touched[wide])
        load = float(force[inside].sum())
        basis = np.column_stack([np.ones(len(middle)), middle])
        pressure = np.array([load / area.sum(), 0.0, 0.0])
        if tilts and len(area) >= _TRIANGLE:
            wanted = np.array([load, *(force[inside] @ place[inside])])
            pressure = np.linalg.lstsq(basis.T @ (area[:, None] * basis), wanted, rcond=_SINGULAR)[0]
        own[touched[wide]] = area * (basis @ pressure)
        return own


def _measure_polygon(points: FloatArray) -> tuple[float, float, float]:
    """Compute area [m2] and centroid x, y [m] of the convex hull of k points, shape (k, 2).

    If the hull has no area, the mean of the points is returned as its centroid.
    Source: shoelace formula.
    """
    middle = points.mean(axis=0)
    area, offset = 0.0, np.zeros(2)
    if len(points) >= _TRIANGLE:
        corners = np.array(_find_hull(points.tolist())) - middle
        after = np.roll(corners, -1, axis=0)
        cross = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
        area = max(0.5 * float(cross.sum()), 0.0)
        if area > 0:
            offset = cross @ (corners + after) / (6 * area)
    return area, float(middle[0] + offset[0]), float(middle[1] + offset[1])


def _find_hull(points: list[list[float]]) -> list[list[float]]:
    """Find the corners of the convex hull of points, counterclockwise.  Source: monotone chain, Andrew (1979)."""
    ordered = sorted(points)
    corners: list[list[float]] = []
    for sweep in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for point in sweep:
            while len(chain) > 1 and _cross(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    return corners or ordered[:1]


def _cross(a: list[float], b: list[float], c: list[float]) -> float:
    """Compute the cross product of b - a and c - a, which is positive if the path a, b, c turns left [m2]."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
