"""Contact methods that the fast model is compared with: MuJoCo's own sensors, mounted fairly, and shares by area.

`TouchGrid` is the plugin touch_grid.  It sums contact forces over bins of azimuth and elevation.  The site stands so
far behind the array that the bins are its texels.  Each texel is a box, as with the method `boxes`; the boxes are a
little narrower than the pitch, because a contact point on the border of two bins may count in either.

`Tactile` is the sensor of this name.  It gives the depth of rigid bodies below the centre of each texel, here on one
plate.  The depths are scaled to MuJoCo's force on the plate.  `use_distance_fields` lets it feel bodies made of meshes.

`AreaTexels` redistributes the force of each touching body over box texels by contact area.  The body's contact points
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

from fastmodel import BoxTexels, Foundation
from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import Joints
from fastmodel.contact.boxes import BoxReader
from fastmodel.contact.forces import read_contacts, sum_contacts
from fastmodel.contact.interface import ContactReader, Reading, TexelContact
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: Distance of the site of touch_grid behind the array [m], and width of a box over the pitch [-].
BEHIND, NARROW = 1.0, 0.999
#: Area of a contact polygon, over the product of the texel pitches, up to which it counts as a point or an edge [-].
_FLAT = 1e-6
#: Singular values of the moment equations, over the largest one, below which they count as zero [-].  They occur where
#: all contact polygons lie on one line.
_SINGULAR = 1e-10
#: Smallest number of points that span a polygon, and of polygons that determine a linear pressure [-].
_TRIANGLE = 3


def use_distance_fields() -> None:
    """Give models with `Tactile` distance fields of their meshes, without which it reads zero there."""
    compile_plain = mujoco.MjSpec.compile

    def compile_with_fields(spec: mujoco.MjSpec) -> mujoco.MjModel:
        own = [mesh.name.endswith("/points") for mesh in spec.meshes]
        for mesh, is_own in zip(spec.meshes, own, strict=True):
            mesh.needsdf = any(own) and not is_own
        return compile_plain(spec)

    mujoco.MjSpec.compile = compile_with_fields


@dataclass(frozen=True, kw_only=True)
class TouchGrid(BoxTexels):
    """The plugin touch_grid on boxes, with or without a Gaussian."""

    costly: ClassVar[bool] = False
    computes_spread: bool = True

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add the boxes, the site and the sensor; see `TexelContact.attach`."""
        half = np.array(array.pitch) * (array.columns, array.rows) / 2
        fov = " ".join(str(np.degrees(np.arctan2(each, BEHIND))) for each in half)
        x, y, z = array.centres.mean(axis=0)
        child = mujoco.MjSpec.from_string(f"""<mujoco><extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
          <worldbody><body name="/pad"><site name="/eye" pos="{x} {y} {z - BEHIND}" quat="0 1 0 0"/></body></worldbody>
          <sensor><plugin name="/grid" plugin="mujoco.sensor.touch_grid" objtype="site" objname="/eye">
            <config key="size" value="{array.columns} {array.rows}"/><config key="fov" value="{fov}"/>
            <config key="gamma" value="0"/><config key="nchannel" value="1"/></plugin></sensor></mujoco>""")
        super().attach(child.body("/pad").add_frame(), array, "")
        for geom in child.geoms:
            geom.size[:2] *= NARROW
        frame.attach_body(child.body("/pad"), name, "")

    def bind(self, model: mujoco.MjModel, array: TexelArray, name: str, **given: object) -> _Reader:
        """Find the sensor; see `TexelContact.bind`."""
        return _Reader(super().bind(model, array, name, **given), self, model.sensor(f"{name}/grid").adr[0], array)


@dataclass(frozen=True, kw_only=True)
class Tactile(Foundation):
    """The sensor tactile on a plate, with or without a Gaussian."""

    costly: ClassVar[bool] = False
    computes_spread: bool = True

    def attach(self, frame: mujoco.MjsFrame, array: TexelArray, name: str) -> None:
        """Add the plate, the points of the texels and the sensor; see `TexelContact.attach`."""
        # A point below the plate makes the mesh a solid; it touches nothing.
        points = np.vstack([array.centres, array.centres.mean(axis=0) - [0, 0, self.plate.height]])
        text = " ".join(map(str, points.ravel()))
        child = mujoco.MjSpec.from_string(f"""<mujoco><asset><mesh name="/points" vertex="{text}"/></asset><worldbody>
          <body name="/pad">
            <geom name="/points" type="mesh" mesh="/points" contype="0" conaffinity="0" mass="0"/></body>
          </worldbody><sensor><tactile name="/depths" geom="/points" mesh="/points"/></sensor></mujoco>""")
        super().attach(child.body("/pad").add_frame(), array, "")
        frame.attach_body(child.body("/pad"), name, "")

    def bind(self, model: mujoco.MjModel, array: TexelArray, name: str, **given: object) -> _Reader:
        """Find the sensor; see `TexelContact.bind`."""
        return _Reader(super().bind(model, array, name, **given), self, model.sensor(f"{name}/depths").adr[0], array)


class _Reader:
    """Reader of a MuJoCo sensor on plates or boxes that another reader knows."""

    def __init__(
        self, inner: BoxReader | ContactReader, method: TouchGrid | Tactile, start: int, array: TexelArray
    ) -> None:
        self._method, self._array, self._start = method, array, start
        self._model, self._parts = inner._model, inner._net_force.parts  # noqa: SLF001
        self.get_state, self.set_state = inner.get_state, inner.set_state

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """Make the reading for given contact forces, as if the sensor measured them."""
        return Reading(
            contact_forces, contact_forces if self._method.computes_spread else None, float(contact_forces.sum())
        )

    def read(self, data: mujoco.MjData) -> Reading:
        """Read the sensor; values that pull are set to zero, and the others scaled to the sum of the contact forces."""
        values = data.sensordata[self._start : self._start + self._array.count]
        if isinstance(self._method, TouchGrid):
            values = values.reshape(self._array.rows, -1)[::-1].ravel()  # its rows count downwards
        values = np.maximum(values, 0.0)
        contacts = read_contacts(self._model, data)
        found = compile_kernel(sum_contacts)(contacts, data.geom_xmat, data.geom_xpos, self._parts)
        load = float(-found[1][:, 2].sum())
        forces = values * (load / max(values.sum(), 1e-12))
        return self.at_rest(forces)._replace(carried=load)


@dataclass(frozen=True, kw_only=True)
class AreaTexels(BoxTexels):
    """Rigid boxes, whose forces are redistributed by the area of contact polygons."""

    costly: ClassVar[bool] = True

    def bind(self, model: mujoco.MjModel, array: TexelArray, name: str, **_: object) -> AreaReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`."""
        return AreaReader(model, array, name)


class AreaReader(BoxReader):
    """Reader that sums contact forces on each box and redistributes the force of each body by contact area."""

    def __init__(self, model: mujoco.MjModel, array: TexelArray, name: str) -> None:
        """Find the geoms of the texels and the joints of the array; see `BoxReader`."""
        super().__init__(model, array, name)
        self._joints = Joints(model, int(model.geom_bodyid[self._first]))
        self._smallest = _FLAT * array.pitch[0] * array.pitch[1]

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the forces on the texels, and redistribute the force of each body by contact area."""
        contacts = read_contacts(self._model, data)
        pressed = compile_kernel(sum_contacts)(contacts, data.geom_xmat, data.geom_xpos, self._net_force.parts)[0]
        found = super().read(data)
        return found._replace(contact_forces=self._share(data, pressed, found.contact_forces))

    def _share(self, data: mujoco.MjData, pressed: FloatArray, total: FloatArray) -> FloatArray:
        """Redistribute the force of each body by contact area, shape (n,) [N].

        A flex or another body without a convex shape keeps the forces of its contact points.

        Args:
            data: The state.
            pressed: Force on both geoms of each of k contacts, see `sum_contacts`, shape (k, 2) [N].
            total: Force on each box, not negative, shape (n,) [N].
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


#: The compared methods, by name.
METHODS: dict[str, str | TexelContact] = {
    "cover": "cover",
    "foundation": "foundation",
    "area": AreaTexels(),
    "boxes": "boxes",
    "touch_grid": TouchGrid(),
    "tactile": Tactile(),
    "tactile, Gaussian": Tactile(computes_spread=False),
}
